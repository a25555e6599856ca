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
from pneudrive.characterise import write_map
from pneudrive.cli.main import run as run_command
from pneudrive.identify.dynamic.result import DriveFit
from web.conftest import Served
from web.maps import coulomb, friction_map
from web.test_friction import post
from web.test_recordings import get

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
    before = drive()
    (folder / "axis.toml").write_text(before.to_toml())
    pl.DataFrame(record(before, 3, duration_s=1.0).columns).write_parquet(folder / "monday.parquet")
    pn.save(pn.simulate(before, "0 s: 0.3, 0.4 s: -0.3", "0.8 s"), folder / RUN)
    fit = pn.identify(before, folder / "monday.parquet", ["valve.conductance"])
    fit.to_toml(folder / FIT)
    (folder / AFTER).write_text(fit.apply().to_toml())
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


def test_a_changed_input_is_told_downstream_and_a_renamed_one_is_not(chain: Served) -> None:
    axis = chain.folder / "axis.toml"
    axis.rename(chain.folder / "moved.toml")  # the hash finds it
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
    # Another recording of the name in a newer folder is not the one; it is only asked about where there are two.
    (folder / "tuesday").mkdir()
    other = shutil.copy(folder / names[0], folder / "tuesday" / names[1])
    assert states(get(chain, "/api/lineage", path=out)["inputs"]) == dict.fromkeys(names, "same")
    assert get(chain, "/api/map", path=out)["recordings"] == {"O-ring_1bar": names[0], "O-ring_5bar": names[1]}
    shutil.copy(folder / names[0], folder / names[1])
    assert get(chain, "/api/stale")["stale"] == {out: ["O-ring_5bar"]}
    assert get(chain, "/api/lineage", path=out)["again"] is None  # nobody knows from which of the two
    assert get(chain, "/api/map", path=out)["recordings"] == {"O-ring_1bar": names[0]}
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


def test_the_rig_of_a_campaign_is_told_from_another_of_its_name(served: Served) -> None:
    campaign = served.folder / "campaigns" / "first"
    campaign.mkdir(parents=True)
    texts = {"monday/rig.toml": "kind = 'opc-ua'\n", "tuesday/rig.toml": "kind = 'opc-ua' # mine\n"}
    for name, text in texts.items():
        (served.folder / name).parent.mkdir()
        (served.folder / name).write_text(text)
    digest = hashlib.sha256(texts["tuesday/rig.toml"].encode()).hexdigest()
    for name in ("campaign.json", "rig.json"):
        (campaign / name).write_text(json.dumps({"rig": "/rigs/rig.toml", "rig_sha256": digest}))
    assert states(get(served, "/api/lineage", path="campaigns/first")["inputs"]) == {"tuesday/rig.toml": "same"}
    (served.folder / "tuesday/rig.toml").write_text("kind = 'opc-ua' # yours\n")
    assert get(served, "/api/stale")["stale"] == {"campaigns/first": ["/rigs/rig.toml"]}
    (served.folder / "monday/rig.toml").unlink()
    assert get(served, "/api/stale")["stale"] == {"campaigns/first": ["tuesday/rig.toml"]}


def test_a_law_of_its_own_that_changed_is_a_change_of_the_drive(served: Served) -> None:
    shutil.copy(LAW, served.folder)
    numbers = 'coulomb = "30 N"\nbreakaway = "45 N"\nstribeck_velocity = "20 mm/s"\n'
    numbers += 'bristle_stiffness = "1e5 N/m"\nbristle_damping = "300 N s/m"\n'
    (served.folder / "own.toml").write_text(
        f'drive = "catalogue:reference"\n[friction]\nlaw = "file:{LAW.name}"\n{numbers}'
    )
    pn.save(pn.simulate(pn.Drive.load(served.folder / "own.toml"), "0.3", "20 ms"), served.folder / RUN)
    assert states(get(served, "/api/lineage", path=RUN)["inputs"]) == {"own.toml": "same"}
    shown = get(served, "/api/file", path="own.toml", checked="1")["checked"]["values"]
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
    assert low < 33.0 < high
    monkeypatch.chdir(chain.folder)
    assert run_command(shlex.split(found["command"])[1:]) == 0
    printed = capsys.readouterr().out
    assert "coulomb" in printed
    exec(found["python"], {})
    assert "key='coulomb'" in capsys.readouterr().out
    refused = post(chain, "/api/compare", {"before": names[0], "after": "axis.toml"}, 400)
    assert "of one kind" in refused["problems"][0]["what"]
    assert post(chain, "/api/compare", {"before": "../a.toml", "after": "axis.toml"}, 400)["problems"]
