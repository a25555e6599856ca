"""Components of a circuit that are added, joined and removed: the text stays valid and keeps its comments."""

from __future__ import annotations

import zipfile
from hashlib import sha256
from pathlib import Path

import pytest

import pneudrive as pn
from pneudrive.describe.circuit import Circuit
from pneudrive.describe.kinds import component_kinds
from pneudrive.errors import CommandError
from pneudrive.web.drive.description import kinds, restructured
from pneudrive.web.drive.run_request import described_at
from pneudrive.web.workspace import Workspace
from web.client import get, post, run_line, run_python
from web.conftest import Served

EXAMPLES = Path(__file__).parents[2] / "examples"
PAIR = (EXAMPLES / "two_cylinders.toml").read_text()


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace.at(tmp_path)


def changed(workspace: Workspace, text: str, act: str, one: str = "", other: str = "", kind: str = "") -> str:
    asked = {"path": "pair.toml", "text": text, "act": act, "one": one, "other": other, "kind": kind}
    return restructured(workspace, **asked)["text"]


def circuit(workspace: Workspace, text: str) -> Circuit:
    found = described_at(workspace, "pair.toml", text)
    assert isinstance(found, Circuit)
    return found


def joints(workspace: Workspace, text: str) -> set[frozenset[str]]:
    return {frozenset(one) for one in circuit(workspace, text).wiring.core()}


def test_each_kind_can_be_added_with_the_values_it_begins_with(workspace: Workspace) -> None:
    text = PAIR.replace('"valve_r.4 -> fc_ra -> right.a",', "").replace(
        "[components.mains]", 'plugged = ["right.a", "valve_r.4"]\n\n[components.mains]'
    )
    text = text.replace('"fc_la", "fc_lb", "fc_ra", "fc_rb"', '"fc_la", "fc_lb", "fc_rb"')
    before = circuit(workspace, text)
    for kind, _ in kinds()["kinds"]:
        has_gas = component_kinds()[kind]["ports"][0]["kind"] == "gas"
        after = circuit(workspace, changed(workspace, text, "add", "valve_r.4" if has_gas else "left.rod", kind=kind))
        (name,) = set(after.components) - set(before.components)
        assert after.components[name].kind == kind
    assert "# Assumed initial values." in changed(workspace, text, "add", "valve_r.4", kind="tube")


def test_a_component_goes_into_a_line_and_out_again(workspace: Workspace) -> None:
    text = changed(workspace, PAIR, "add", "valve_l.4", kind="tube")
    assert '"valve_l.4 -> tube -> fc_la -> left.a"' in text
    assert "# Ports 3 and 5 of the valves are exhausts" in text
    assert joints(workspace, changed(workspace, text, "remove", "tube")) == joints(workspace, PAIR)
    with pytest.raises(CommandError, match="already connected"):
        changed(workspace, PAIR, "add", "valve_l.4", kind="valve/switching-5/2")


def test_a_line_is_cut_and_joined_again(workspace: Workspace) -> None:
    cut = changed(workspace, PAIR, "cut", "left.a")
    assert frozenset(("fc_la.2", "ambient")) in joints(workspace, cut)  # an open hose
    assert "left.a" in circuit(workspace, cut).plugged
    assert '"fc_la.2 -> silencer.1"' in changed(workspace, cut, "add", "fc_la.2", kind="silencer")
    again = changed(workspace, cut, "join", "left.a", "fc_la.2")
    assert joints(workspace, again) == joints(workspace, PAIR)
    assert "plugged" not in again


@pytest.mark.parametrize("name", ["fc_la", "left", "tank", "valve_l", "mains"])
def test_what_is_left_after_a_component_is_removed_is_valid(workspace: Workspace, name: str) -> None:
    text = changed(workspace, PAIR, "remove", name)
    assert set(circuit(workspace, text).components) == set(circuit(workspace, PAIR).components) - {name}


def test_a_drive_becomes_the_circuit_that_it_is(workspace: Workspace) -> None:
    drive = 'drive = "catalogue:reference"\n'
    with pytest.raises(CommandError, match="fixed structure"):
        changed(workspace, drive, "remove", "valve")
    text = changed(workspace, drive, "open")
    described = described_at(workspace, "pair.toml", drive)
    assert circuit(workspace, text).description_hash == described.circuit.description_hash
    assert (
        "flow_control"
        in circuit(workspace, changed(workspace, text, "add", "cylinder.a", kind="flow-control")).components
    )


# --- A drive for other tools from the page: the FMU is that of command and Python, and the page shows what is in it.

ASKED = {"kind": "export", "drive": "axis.toml", "to": "fmu", "fmi": "3.0", "initial": "position = 50 mm", "name": "x"}


@pytest.mark.parametrize("change", [{}, {"fmi": "2.0", "actuator": True, "initial": ""}])
def test_page_command_and_python_write_the_same_fmu(
    served: Served, monkeypatch: pytest.MonkeyPatch, change: dict
) -> None:
    copied = post(served, "/api/work", ASKED | change)
    monkeypatch.chdir(served.folder)
    Path("results").mkdir()
    assert run_line(copied["command"]) == 0
    by_command = Path("results/x.fmu").read_bytes()
    names = run_python(copied["python"])
    done = names["done"]
    assert Path("results/x.fmu").read_bytes() == by_command
    shown = get(served, "/api/fmu", path="results/x.fmu")
    assert shown["sha256"] == sha256(by_command).hexdigest()
    view = shown["view"]
    assert f"FMI {done.version}" in view["title"]
    assert done.token in view["notes"][0]
    tables = {table["caption"].partition(",")[0].lower(): table["rows"] for table in view["tables"]}
    for causality in ("inputs", "outputs", "parameters"):
        variables, seen = getattr(done, causality), tables.get(causality, [])
        assert [(name, unit, meaning) for name, unit, _, meaning in seen] == [
            (one.name, one.unit, one.meaning) for one in variables
        ]
        for (_, _, start, _), variable in zip(seen, variables, strict=True):
            assert start == ("" if variable.start is None else f"{variable.start:.6g}")
    assert ("co-simulation" in view["title"]) is not bool(change)
    assert get(served, "/api/studies")["files"][-1]["kind"] == "fmu"


@pytest.mark.parametrize(
    "change",
    [
        {"drive": "missing.toml"},
        {"drive": "../axis.toml"},
        {"drive": 3},
        {"to": "simscape"},
        {"fmi": "1.0"},
        {"name": "a/b"},
        {"name": "\U0001d49c" * 81},
        {"initial": ["position"]},
    ],
)
def test_a_wrong_request_starts_nothing(served: Served, change: dict) -> None:
    assert post(served, "/api/jobs", ASKED | change, 400)["problems"]
    assert not served.jobs


def test_what_is_no_fmu_is_answered_in_words(served: Served) -> None:
    path = served.folder / "x.fmu"

    def said() -> str:
        answered = served.client.get("/api/fmu", params={"path": "x.fmu"}, headers=served.headers)
        assert answered.status_code == 400
        return answered.json()["problems"][0]["what"]

    path.write_text("no archive")
    assert "cannot be read as an FMU" in said()
    bomb = '<!DOCTYPE a [<!ENTITY b "bbbbbbbb"><!ENTITY c "&b;&b;">]><fmiModelDescription modelName="&c;"/>'
    for text in (bomb.encode(), bomb.encode("utf-16"), b"<fmi", b" " * 17_000_000):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", text)
        assert "x.fmu" in said()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("other.xml", "<a/>")
    assert "cannot be read as an FMU" in said()
    assert pn.export_fmu(pn.Drive.load("catalogue:reference"), path).token in str(get(served, "/api/fmu", path="x.fmu"))
