"""The short form of a circuit: a drive file, with tubes and flow controls, and beside components of one's own."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.cli.main import run
from pneudrive.errors import DescriptionError

SHORT = (Path(__file__).parents[1] / "data" / "short.toml").read_text("utf-8")
LINES = """[tubing]
a = { length = "2 m", diameter = "4 mm" }
b = { length = "2 m", diameter = "4 mm" }
[flow_control]
a = { conductance = "0.4 dm3/(s bar)", throttles = "out" }
b = { nominal_flow = "60 l/min ANR", check_conductance = "0.7 dm3/(s bar)" }
"""
START = "position = 0 mm, pressure_b = 3 bar abs"


@pytest.fixture
def short(tmp_path):
    def load(text):
        path = tmp_path / "drive.toml"
        path.write_text(text)
        return pn.Drive.load(path)

    return load


def test_the_circuit_of_a_drive_gives_its_bits(short):
    drive = short(SHORT)
    one = pn.simulate(drive, "0 s: 1, 0.2 s: -1", "0.4 s", initial=START)
    other = drive.circuit.simulate(
        "0 s: 1, 0.2 s: -1", "0.4 s", initial={"cylinder.position": "0 mm", "cylinder.b": "3 bar abs"}
    )
    for variable in ("position", "velocity", "friction_force", "end_stop_force"):
        assert np.array_equal(one[variable], other[f"cylinder.{variable}"])
    for chamber in "ab":
        assert np.array_equal(one[f"pressure_{chamber}"], other[f"cylinder.{chamber}.pressure"])
        assert np.array_equal(one[f"mass_flow_{chamber}"], other[f"cylinder.{chamber}.mass_flow"])
    assert one.attrs["statistics"] == other.attrs["statistics"]


def test_lines_lie_between_valve_and_cylinder(short):
    drive = short(SHORT + LINES)
    assert drive.circuit.connections == (
        "supply -> valve.1",
        "valve.4 -> tube_a -> flow_control_a -> cylinder.a",
        "valve.2 -> tube_b -> flow_control_b -> cylinder.b",
        "load -> cylinder.rod",
        "spring -> cylinder.rod",
    )
    a, b = (drive.circuit.components[f"flow_control_{chamber}"].numbers(1e5) for chamber in "ab")
    assert (a["needle_conductance"], a["check_conductance"]) == (4e-9, 4e-9)
    assert b["needle_conductance"] == pytest.approx(60 / 6e4 / 7e5 / np.sqrt(1 - ((6 / 7 - 0.3) / 0.7) ** 2))
    assert b["check_conductance"] == pytest.approx(7e-9)
    assert any(
        line.startswith("flow_control_a.check_conductance = 0.4 dm3/(s bar), assumed as") for line in drive.assumed()
    )
    assert pn.Drive.model_validate(drive.to_dict()).description_hash == drive.description_hash
    assert pn.Circuit.load(drive.circuit.to_toml()).core_json() == drive.circuit.core_json()
    assert pickle.loads(pickle.dumps(drive)).description_hash == drive.description_hash
    wider = drive.replace({"flow_control.a.needle_nominal_flow": "90 l/min ANR", "flow_control.b.check_kv": 0.2})
    assert wider.flow_control["a"] == {"needle_nominal_flow": "90 l/min ANR", "throttles": "out"}
    assert wider.flow_control["b"] == {"nominal_flow": "60 l/min ANR", "check_kv": 0.2}
    longer = drive.replace({"tubing.a.length": "5 m"})
    assert longer.description_hash != drive.description_hash
    assert drive.core_json() == drive.circuit.core_json()


def test_a_tube_has_the_kind_of_its_model(short):
    models = {"auto": "tube/auto", "steady": "tube", "lumped": "tube/lumped", "distributed": "tube/distributed"}
    for model, kind in models.items():
        drive = short(SHORT + LINES.replace('"2 m"', f'"2 m", model = "{model}"', 1))
        assert drive.circuit.components["tube_a"].kind == kind
        assert drive.circuit.components["tube_b"].kind == "tube"
    for wrong, said in (('model = "long"', "model = 'long' is not known"), ('kind = "tube", model = "auto"', "both")):
        with pytest.raises(DescriptionError, match=said) as refused:
            short(SHORT + LINES.replace('"2 m"', f'"2 m", {wrong}', 1))
        assert "tubing.a" in str(refused.value)


def test_a_drive_with_lines_keeps_the_names_of_a_drive(short):
    drive, plain = short(SHORT + LINES), short(SHORT)
    slow, fast = (pn.simulate(d, 1.0, "0.1 s", initial=START, ledger=d is drive) for d in (drive, plain))
    assert list(slow)[:12] == list(fast)[:12]
    assert slow["tube_a.2.pressure"][0] == pytest.approx(1.01325e5)  # as chamber a
    assert slow["tube_b.2.pressure"][0] == pytest.approx(3e5)
    assert 0.005 < slow.position[-1] < 0.8 * fast.position[-1]
    assert abs(slow.attrs["ledger"]["energy_error"]) < 1e-6
    assert slow["tube_a.mass_flow"].attrs["units"] == "kg/s"
    session = drive.start(START)
    session.set("command", 1.0)
    session.advance(0.1)
    assert session.read("position_m") == slow.position[-1]
    assert session.read("pressure_a_pa") == slow.pressure_a[-1]
    session.schedule("load_force_n", [(0.25, 10.0)])
    assert session.linearise().inputs == ("command", "load_force_n", "supply_pressure_pa")
    with pytest.raises(pn.errors.CommandError, match="Did you mean 'load_force_n'"):
        session.set("load_force", 1.0)


def test_lines_on_the_command_line(tmp_path, capsys, printed):
    path, out = tmp_path / "drive.toml", tmp_path / "run.csv"
    path.write_text(SHORT + LINES)
    command = ["--command", "0 s: 1", "--duration", "0.1 s", "--initial", "position = 0 mm"]
    assert re.search(r"\nposition +0\.000 mm ", printed(["simulate", path, *command, "--out", out]))
    assert out.read_text().splitlines()[0].startswith("time_s,position_m,velocity_m_s,")
    said = printed(["check", path])
    assert "  flow_control_a, flow_control_b: cracking_pressure = 0.1 bar, a usual spring\n" in said
    assert "  each joint of valve.4, tube_a.2, valve.2, tube_b.2 has" in said
    said = printed(["check", "catalogue:parker-osp-p25-sy5000"])
    assert "cylinder.bore = 25 mm [parker-osp-p-0980]" in said
    assert "cylinder.moving_mass = 0.7 kg, not read on the sheet" in said
    assert "overlap, leakage, hysteresis = 0, as in an ideal valve" in printed(["check", "catalogue:reference"])
    path.write_text(SHORT.replace('stroke = "100 mm"', 'stroke = "500 m"'))
    run(["check", str(path)])
    assert "cylinder.stroke = 500000 mm; check the unit: usual sizes are 1 mm to" in capsys.readouterr().out


def test_what_a_user_changes_is_not_assumed_by_the_catalogue(tmp_path):
    path = tmp_path / "drive.toml"
    path.write_text(
        'drive = "catalogue:parker-osp-p25-sy5000"\n[cylinder]\nmoving_mass = "1 kg"\n[valve]\nkv = 0.4\n'
        '[tubing]\na = { length = "1 m", diameter = "4 mm" }\n'
    )
    drive = pn.Drive.load(path)
    keys = {line.partition(" = ")[0] for line in (*drive.sources(), *drive.assumed())}
    assert {"cylinder.bore", "cylinder.stroke", "friction.coulomb"} <= keys
    assert not {"cylinder.moving_mass", "valve.conductance"} & keys
    changed = drive.replace({"friction.coulomb": "40 N"})
    assert not any("friction.coulomb" in line for line in changed.sources())
    assert "parker-osp-p-0980" in pn.simulate(drive, 1.0, "0.01 s").attrs["citations"]


MIXED = (Path(__file__).parents[1] / "data" / "short_form_mixed.toml").read_text("utf-8")


def mixed():
    return MIXED.format(short=SHORT.replace("schema = 1\n", ""))


def test_short_tables_stand_beside_components():
    """Ports that connections name leave the usual joints; others keep them; a table may add keys to the short form."""
    circuit = pn.Circuit.load(mixed())
    assert circuit.connections[3:] == (
        "supply -> valve.1",
        "valve.2 -> cylinder.b",
        "load -> cylinder.rod",
        "spring -> cylinder.rod",
    )
    assert circuit.components["cylinder"].leakage_m3_s_pa == pytest.approx(1e-11)
    ran = circuit.simulate(1.0, "0.1 s", initial={"cylinder.position": "0 mm"})
    assert ran["cylinder.position"][-1] > 0.01
    again = pn.Circuit.load(circuit.to_toml())
    assert again.core_json() == circuit.core_json()


FAULTS = {
    "a length": (('length = "2 m"', 'length = "2 bar"'), 'tube_a.length: unit "bar" is a', '"2 bar"', "a length"),
    "a chamber": (("\nb = { nominal", "\nc = { nominal"), "flow_control.c is not a known key", "c = { nominal", "a, b"),
    "no size": (('conductance = "0.4 dm3/(s bar)", ', ""), "needle_conductance", "a = { throttles", "nominal_flow"),
    "no table": (("[tubing]\na = {", "[tubing]\na = 4 # {"), "tubing.a = 4 is not a table", "a = 4", "Write {"),
    "a choice": (('"out"', '"outwards"'), "flow_control_a.throttles = 'outwards'", "outwards", "out"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_a_line_is_told_where_it_stands(tmp_path, refusal, fault):
    (old, new), what, mark, rest = FAULTS[fault]
    text = (SHORT + LINES).replace(old, new, 1)
    path = tmp_path / "drive.toml"
    path.write_text(text)
    line = next(n for n, one in enumerate(text.splitlines(), start=1) if mark in one)
    refusal(["check", path], what, f"{path}:{line}", rest)


def test_a_fault_of_a_short_table_in_a_circuit_is_told_where_it_stands(tmp_path):
    text = mixed().replace('bore = "32 mm"', 'bore = "32 bar"').replace('coulomb = "20 N"', 'coulomb = "20 m"')
    text = text.replace('leakage = "0.001 dm3/(s bar)"', 'leakage = "1 mm"').replace('"proportional-5/3"', "{ a = 1 }")
    path = tmp_path / "circuit.toml"
    path.write_text(text)
    with pytest.raises(DescriptionError) as caught:
        pn.Circuit.load(path)
    found = {int(one.where.rpartition(":")[2]): one.what for one in caught.value.each()}
    lines = text.splitlines()
    assert [lines[number - 1].split(" ")[0] for number in found] == ["kind", "bore", "coulomb", "leakage"]


def test_a_short_supply_feeds_a_single_acting_cylinder():
    """Spring, 3/2 valve, and the supply of a drive file: the valve is the user's, so are its joints."""
    circuit = pn.Circuit.load(Path(__file__).parents[1] / "data" / "short_supply.toml")
    assert circuit.connections == ("supply -> valve.1", "valve.2 -> clamp.a")
    ran = circuit.simulate("0 s: 1, 0.3 s: 0", "0.8 s", initial={"clamp.position": "0 mm"})
    assert ran["clamp.position"].max() > 0.049
    assert ran["clamp.position"][-1] < 0.001
    assert {"ckd-sm-p00077", "ckd-4ga"} <= set(ran.attrs["citations"])
