"""What results were made from, by the hashes that they carry, and two of them compared."""

from __future__ import annotations

import hashlib
import json
import shlex
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from oracle.drive_records import drive, record
from pneudrive.campaign.run import run_campaign
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.characterise import write_map
from pneudrive.cli.main import run as run_command
from pneudrive.describe.files.toml import value_text as toml_value
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.simulation.trajectory import save_columns
from waiting import until
from web.client import get, post, run_line, run_python
from web.conftest import Served, app_of
from web.maps import coulomb, friction_map

RUN, FIT, AFTER = "run.parquet", "fit.toml", "after.toml"
LAWS = "results/laws"
CHECK, CHECKED = "results/check/validation.toml", "results/check/run-1.parquet"
MAP = "results/rings/map.parquet"
LAW = Path(__file__).parents[2] / "examples" / "laws" / "lugre.toml"
MEASURED = Path(__file__).parents[2] / "data" / "measurements" / "zillen-2021-pneumatic-piston"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with a chain: description -> run -> fit -> drive -> validation, and recordings -> map -> fit."""
    folder = tmp_path_factory.mktemp("chain")
    (folder / "axis.toml").write_text(drive().to_toml())
    before = pn.Drive.load(folder / "axis.toml")
    pl.DataFrame(record(before, 3, duration_s=1.0).columns).write_parquet(folder / "monday.parquet")
    pn.save(pn.simulate(before, "0 s: 0.3, 0.4 s: -0.3", "0.8 s"), folder / RUN)
    fit = pn.identify(before, folder / "monday.parquet", ["valve.conductance"])
    fit.to_toml(folder / FIT)
    assert run_command(["apply", str(folder / FIT), "--out", str(folder / AFTER)]) == 0
    (folder / "results" / "check").mkdir(parents=True)
    pn.validate(pn.Drive.load(folder / AFTER), folder / "monday.parquet").write(folder / "results" / "check")
    (folder / "results" / "rings").mkdir()
    pn.control.benchmark(
        before, ["pid"], ["250 mm; 0.1 s: 260 mm in 0.2 s"], seeds=1, mismatch="mass+30", out=folder / LAWS
    )
    curves = friction_map(coulomb(30.0))
    write_map(curves, folder / MAP)
    pn.fit_friction(curves, "coulomb").to_toml(folder / "results/rings/fit.toml")
    one = curves.isel(row=np.arange(6))
    pn.fit_friction(one, "coulomb").to_toml(folder / "results/rings/fit-monday.toml")
    return folder


@pytest.fixture
def chain(served: Served, made: Path) -> Served:
    shutil.copytree(made, served.folder, dirs_exist_ok=True)
    return served


def states(inputs: list[dict]) -> dict[str, str]:
    return {one["path"] or one["name"]: one["state"] for one in inputs}


def test_a_chain_goes_back_to_the_description_by_hashes(chain: Served) -> None:
    found = get(chain, "/api/lineage", path=CHECK)
    assert states(found["inputs"]) == {AFTER: "same", "monday.parquet": "same"}
    of_drive = found["inputs"][0]["inputs"]
    assert states(of_drive) == {FIT: "same"}
    assert states(of_drive[0]["inputs"]) == {"axis.toml": "same", "monday.parquet": "same"}
    assert found["inputs"][0]["digest"] == pn.Drive.load(chain.folder / AFTER).description_hash[:12]
    assert set(get(chain, "/api/lineage", path="axis.toml")["made"]) == {RUN, FIT, LAWS}
    assert get(chain, "/api/lineage", path="monday.parquet")["made"].count(CHECK) == 1
    for fit, names in (("fit.toml", ["monday", "tuesday"]), ("fit-monday.toml", ["monday", "tuesday"])):
        (of_map,) = get(chain, "/api/lineage", path=f"results/rings/{fit}")["inputs"]
        assert (of_map["path"], of_map["state"]) == (MAP, "same")
        assert [one["name"] for one in of_map["inputs"]] == names
        assert states(of_map["inputs"]) == {"monday.parquet": "named", "tuesday": "missing"}
    assert get(chain, "/api/stale") == {"stale": {}, "unchecked": 0}


def test_a_changed_input_is_told_downstream_and_a_missing_one_is_not(chain: Served) -> None:
    axis = chain.folder / "axis.toml"
    axis.rename(chain.folder / "moved.toml")
    assert get(chain, "/api/lineage", path=RUN)["inputs"][0]["state"] == "missing"
    (chain.folder / AFTER).write_text((chain.folder / AFTER).read_text().replace("name =", "# mine\nname ="))
    assert get(chain, "/api/stale")["stale"] == {}
    (chain.folder / "moved.toml").rename(axis)
    axis.write_text(drive(load__mass="9 kg").to_toml())
    stale = get(chain, "/api/stale")["stale"]
    assert stale == {key: ["axis.toml"] for key in [FIT, AFTER, CHECK, CHECKED, LAWS]}
    assert get(chain, "/api/lineage", path=RUN)["inputs"][0]["state"] == "differs"  # values may have been set for it
    axis.unlink()
    assert get(chain, "/api/stale")["stale"] == {}  # what is gone is told in the chain
    assert get(chain, "/api/lineage", path=RUN)["inputs"][0]["state"] == "missing"


def test_changed_samples_and_a_changed_map_make_results_stale(chain: Served) -> None:
    path = chain.folder / "monday.parquet"
    frame = pl.read_parquet(path)
    frame.with_columns(pl.col("position_m") + 1e-9).write_parquet(path)
    stale = get(chain, "/api/stale")["stale"]
    assert stale == {key: ["monday.parquet"] for key in [FIT, AFTER, CHECK, CHECKED]}
    frame.with_columns(note=pl.lit(1)).write_parquet(path)  # of what a fit does not read, nothing counts
    write_map(friction_map(coulomb(30.5)), chain.folder / MAP)
    stale = get(chain, "/api/stale")["stale"]
    assert stale == {key: [MAP] for key in ["results/rings/fit.toml", "results/rings/fit-monday.toml"]}


def test_a_map_is_stale_once_the_file_of_a_recording_has_other_content(chain: Served) -> None:
    folder, out = chain.folder, "results/o-ring/map.parquet"
    (folder / out).parent.mkdir()
    shutil.copy(MEASURED / "layout.toml", folder)
    for pressure in (1, 5):
        shutil.copy(MEASURED / "friction" / f"O-ring_{pressure}bar.csv.xz", folder)
    names = [f"O-ring_{pressure}bar.csv.xz" for pressure in (1, 5)]
    write_map(pn.characterise([folder / name for name in names]), folder / out)
    assert states(get(chain, "/api/lineage", path=out)["inputs"]) == dict.fromkeys(names, "same")
    # Another recording of the name in a newer folder is not the one.
    (folder / "tuesday").mkdir()
    other = shutil.copy(folder / names[0], folder / "tuesday" / names[1])
    assert states(get(chain, "/api/lineage", path=out)["inputs"]) == dict.fromkeys(names, "same")
    assert get(chain, "/api/map", path=out)["recordings"] == {"O-ring_1bar": names[0], "O-ring_5bar": names[1]}
    shutil.copy(folder / names[0], folder / names[1])
    assert get(chain, "/api/stale")["stale"] == {out: names[1:]}
    assert get(chain, "/api/lineage", path=out)["again"]["recordings"] == names
    other.unlink()
    assert get(chain, "/api/stale")["stale"] == {out: names[1:]}
    (folder / names[1]).unlink()
    assert states(get(chain, "/api/lineage", path=out)["inputs"]) == {names[0]: "same", "O-ring_5bar": "missing"}


def test_a_validation_keeps_its_recording_beside_another_of_its_name(chain: Served) -> None:
    (chain.folder / "tuesday").mkdir()
    another = pl.read_parquet(chain.folder / "monday.parquet").with_columns(pl.col("position_m") + 1e-9)
    another.write_parquet(chain.folder / "tuesday" / "monday.parquet")
    shown = get(chain, "/api/validation", path=CHECK)
    assert [one["file"] for one in shown["record"]] == ["monday.parquet"]
    assert {each["file"] for one in shown["values"] for each in one.get("source", [])} == {
        ""
    }  # known by its name alone


@pytest.mark.parametrize("rig", ["tuesday/rig.toml", "/elsewhere/rig.toml"])
def test_the_rig_of_a_campaign_is_known_by_its_path(served: Served, rig: str) -> None:
    campaign = served.folder / "campaigns" / "first"
    campaign.mkdir(parents=True)
    (served.folder / "tuesday").mkdir()
    text = "kind = 'opc-ua'\n"
    (served.folder / "tuesday/rig.toml").write_text(text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    for name in ("campaign.json", "rig.json"):
        (campaign / name).write_text(
            json.dumps({"inputs": [{"kind": "rig", "name": rig, "file": rig, "sha256": digest}]})
        )
    is_known = not rig.startswith("/")
    found = states(get(served, "/api/lineage", path="campaigns/first")["inputs"])
    assert found == {rig: "same" if is_known else "missing"}
    (served.folder / "tuesday/rig.toml").write_text("kind = 'opc-ua' # yours\n")
    assert get(served, "/api/stale")["stale"] == ({"campaigns/first": ["tuesday/rig.toml"]} if is_known else {})


def test_a_law_of_its_own_that_changed_is_a_change_of_the_drive(served: Served) -> None:
    shutil.copy(LAW, served.folder)
    numbers = 'coulomb = "30 N"\nbreakaway = "45 N"\nstribeck_velocity = "20 mm/s"\n'
    numbers += 'bristle_stiffness = "1e5 N/m"\nbristle_damping = "300 N s/m"\n'
    (served.folder / "own.toml").write_text(
        f'drive = "catalogue:reference"\n[friction]\nlaw = "file:{LAW.name}"\n{numbers}'
    )
    pn.save(pn.simulate(pn.Drive.load(served.folder / "own.toml"), "0.3", "20 ms"), served.folder / RUN)
    assert states(get(served, "/api/lineage", path=RUN)["inputs"]) == {"own.toml": "same"}
    asked = {"path": "own.toml", "text": get(served, "/api/file", path="own.toml")["text"]}
    shown = served.client.post("/api/check", json=asked, headers=served.headers).json()["values"]
    assert {one["key"]: one["kind"] for one in shown}["friction.law"] == "given"
    law = served.folder / LAW.name
    law.write_text(law.read_text().replace("(v/stribeck_velocity)^2", "(v/stribeck_velocity)^4"))
    assert states(get(served, "/api/lineage", path=RUN)["inputs"]) == {"own.toml": "differs"}


def test_a_fit_that_was_made_anew_makes_its_drive_stale(chain: Served) -> None:
    text = (chain.folder / FIT).read_text()
    (chain.folder / FIT).write_text(text + "\n# again\n")
    assert get(chain, "/api/lineage", path=AFTER)["inputs"][0]["state"] == "same"  # a comment is no value
    own = DriveFit.from_toml(chain.folder / FIT).provenance["fit_hash"]
    (chain.folder / FIT).write_text(text.replace(own, "0" * len(own)))  # as of another search over these recordings
    assert get(chain, "/api/stale")["stale"] == {AFTER: [FIT], CHECK: [FIT], CHECKED: [FIT]}


@pytest.mark.parametrize("path", [FIT, CHECK, AFTER, "results/rings/fit.toml"])
def test_a_result_is_made_again_by_its_command(chain: Served, path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    again = get(chain, "/api/lineage", path=path)["again"]
    copied = post(chain, "/api/work", again)
    monkeypatch.chdir(chain.folder)
    monkeypatch.setattr("pneudrive.report.validation.write_validation_report", lambda *_: "report.html")  # takes long
    line = shlex.split(copied["command"].splitlines()[-1])
    assert run_command(line[1:]) == 0
    out = line[line.index("--out") + 1]
    written = Path(out, "validation.toml") if path == CHECK else Path(out)
    assert written.name != Path(path).name or path == CHECK
    after = written.as_posix()
    old, new = (states(get(chain, "/api/lineage", path=one)["inputs"]) for one in (path, after))
    assert old == new
    if path != CHECK:
        assert post(chain, "/api/compare", {"before": path, "after": after})["values"] == []


def test_two_fits_are_compared_as_the_command_does(
    chain: Served, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    names = ["results/rings/fit.toml", "results/rings/fit-monday.toml"]
    fits = [
        pn.fit_friction(friction_map(coulomb(30.0)), "coulomb"),
        pn.fit_friction(friction_map(coulomb(33.0)), "coulomb"),
    ]
    for fit, name in zip(fits, names, strict=True):
        fit.to_toml(chain.folder / name)
    found = post(chain, "/api/compare", {"before": names[0], "after": names[1]})
    one = {value["key"]: value for value in found["values"]}["coulomb"]
    assert one["change"] == pytest.approx(0.1, abs=2e-3)
    low, high = (float(end) for end in one["interval_after"].split(" … "))
    assert low <= 33.0 <= high
    monkeypatch.chdir(chain.folder)
    assert run_line(found["command"]) == 0
    printed = capsys.readouterr().out
    assert "coulomb" in printed
    run_python(found["python"])
    assert "coulomb +10 %" in capsys.readouterr().out
    refused = post(chain, "/api/compare", {"before": names[0], "after": "axis.toml"}, 400)
    assert "of the same kind" in refused["problems"][0]["what"]
    assert post(chain, "/api/compare", {"before": "../a.toml", "after": "axis.toml"}, 400)["problems"]


@pytest.mark.parametrize("kind", ["drive", "fit", "friction map", "recording", "rig", "unknown"])
def test_a_written_list_of_inputs_opens_nothing_outside_and_never_fails(chain: Served, kind: str) -> None:
    (chain.folder.parent / "secret.toml").write_text("a = 1")
    known = ["catalogue:x", "catalogue:../secret", "/etc/hostname", "../secret.toml", LAWS, "axis.toml", "a\x00b", ""]
    about = {"inputs": [{"kind": kind, "name": "x", "file": file, "sha256": "0"} for file in known]}
    table = {"time_s": np.arange(3.0), "position_m": np.zeros(3)}
    save_columns(table, about, chain.folder / "forged.parquet")
    found = get(chain, "/api/lineage", path="forged.parquet")["inputs"]
    assert {one["path"] for one in found} <= {"", LAWS, "axis.toml", *(known[:2] if kind == "drive" else ())}
    for wrong in (3, [3], [{"kind": kind}], [{"kind": kind, "name": "", "file": 3, "sha256": ""}]):
        text = f"kind = 'drive'\n[values.x]\nvalue = 1\n[provenance]\ninputs = {toml_value(wrong)}\n"
        (chain.folder / "forged.toml").write_text(text)
        assert get(chain, "/api/lineage", path="forged.toml")["inputs"] == []


def test_any_two_results_of_one_kind_are_compared(chain: Served) -> None:
    (chain.folder / "heavy.toml").write_text(drive(load__mass="9 kg").to_toml())
    pn.save(pn.simulate(pn.Drive.load(chain.folder / "heavy.toml"), "0.3", "0.8 s"), chain.folder / "heavy.parquet")
    for pair in ((RUN, "heavy.parquet"), (CHECK, CHECK), (MAP, MAP), (LAWS, LAWS), ("axis.toml", "heavy.toml")):
        found = post(chain, "/api/compare", dict(zip(("before", "after"), pair, strict=True)))
        assert bool(found["values"]) == (pair[0] != pair[1]), pair
    assert "the same kind" in post(chain, "/api/compare", {"before": RUN, "after": CHECK}, 400)["problems"][0]["what"]


# --- A campaign on the simulated rig, begun by the page, killed, resumed: the bits of one that nobody disturbed.

NAME = "campaigns/first"
PROTOCOL = (Path(__file__).parents[1] / "data/three_speeds_protocol.toml").read_text("utf-8")


def campaign(served: Served, done: int) -> dict:
    def answer() -> dict:
        return served.client.get("/api/campaign", params={"path": NAME}, headers=served.headers).json()

    until(lambda: answer().get("done", -1) >= done)
    return answer()


def bits(folder: Path) -> dict[str, np.ndarray]:
    return {one.head.cycle.key: one.samples().force_n for one in Campaign.open(folder).cycles()}


def test_a_campaign_is_watched_killed_and_resumed(served: Served) -> None:
    (served.folder / "speeds.toml").write_text(PROTOCOL)
    job = post(served, "/api/campaigns", {"protocol": "speeds.toml", "name": "first", "pace": 3})
    line = "pneudrive campaign run speeds.toml --rig default --out campaigns/first --yes --speed 3"
    assert job["command"].splitlines()[-1] == line
    seen = campaign(served, 1)
    assert seen["synthetic"]
    assert seen["state"] in ("running", "starting")
    assert seen["planned"] > seen["done"]
    process = served.jobs[0].process
    process.kill()
    process.wait()
    post(served, "/api/campaigns", {"resume": NAME})
    seen = campaign(served, seen["planned"])
    assert [len(group["points"]) for group in seen["groups"]] == [3]
    assert any("finished" in line for line in seen["log"])
    assert {one["kind"] for one in get(served, "/api/studies")["files"] if one["path"] == NAME} == {"campaign"}

    run_campaign(served.folder / "speeds.toml", "default", served.folder / "alone")
    expected, found = bits(served.folder / "alone"), bits(served.folder / NAME)
    assert expected.keys() == found.keys()
    assert all(np.array_equal(found[key], expected[key]) for key in expected)


def test_a_campaign_that_was_begun_anew_in_its_folder_shows_its_own_points(served: Served) -> None:
    def speeds() -> list[float]:
        groups = get(served, "/api/campaign", path=NAME)["groups"]
        return sorted(round(one["x"], 4) for group in groups for one in group["points"])

    (served.folder / "speeds.toml").write_text(PROTOCOL)
    run_campaign(served.folder / "speeds.toml", "default", served.folder / NAME)
    assert speeds() == [0.1, 0.1732, 0.3]
    shutil.rmtree(served.folder / NAME)
    (served.folder / "speeds.toml").write_text(
        PROTOCOL.replace('from = "100', 'from = "150').replace("= 3\ns", "= 2\ns")
    )
    run_campaign(served.folder / "speeds.toml", "default", served.folder / NAME)
    until(lambda: speeds() == [0.15, 0.3])


def test_the_plan_on_the_page_is_that_of_command_and_python(served: Served, capsys: pytest.CaptureFixture) -> None:
    (served.folder / "speeds.toml").write_text(PROTOCOL)
    shown = post(served, "/api/plan", {"protocol": "quick-look"})
    assert run_line(shown["command"]) == 0
    assert capsys.readouterr().out == f"{shown['text']}\n"
    run_python(shown["python"])
    assert capsys.readouterr().out == f"{shown['text']}\n"
    pressures = PROTOCOL.replace('["0 bar gauge"]', '["0 bar gauge", "29 psi gauge"]')
    (served.folder / "psi.toml").write_text(pressures)
    text = post(served, "/api/plan", {"protocol": "psi.toml"})["text"]
    assert "pressure 2 levels in both chambers, 0 bar gauge to 1.99948 bar gauge" in text
    (served.folder / "fast.toml").write_text(PROTOCOL.replace("300 mm/s", "30 m/s"))
    refused = post(served, "/api/plan", {"protocol": "fast.toml"}, 400)["problems"][0]
    assert "speed" in refused["what"] + str(refused["value"])
    assert "there is no protocol" in post(served, "/api/plan", {"protocol": 3}, 400)["problems"][0]["what"]


def test_a_server_without_control_only_watches(served: Served) -> None:
    (served.folder / "speeds.toml").write_text(PROTOCOL)
    run_campaign(served.folder / "speeds.toml", "default", served.folder / "done")
    for word in ("pause", "stop", "resume", "abort"):
        refused = post(served, "/api/campaign", {"path": "done", "word": word}, 400)
        assert "does not control them" in refused["problems"][0]["what"]
    served.app = app_of(served.workspace, served.folder.parent / "built", control=True)
    served.client.app = served.app
    served.client._transport.app = served.app
    refused = post(served, "/api/campaign", {"path": "done", "word": "abort"}, 400)
    assert "no process works" in refused["problems"][0]["what"]


@pytest.mark.parametrize(
    "asked",
    [
        {"protocol": "../speeds.toml", "name": "x"},
        {"protocol": "unknown", "name": "x"},
        {"protocol": "quick-look", "name": "../x"},
        {"protocol": "quick-look", "name": "x", "pace": 0.1},
        {"protocol": "quick-look", "name": "x", "pace": "fast"},
        {"resume": "../elsewhere"},
        {"resume": "missing"},
        {},
    ],
)
def test_a_campaign_elsewhere_is_not_begun(served: Served, asked: dict) -> None:
    assert post(served, "/api/campaigns", asked, 400)["problems"]
    assert not (served.folder / "campaigns").exists()
