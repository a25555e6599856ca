"""Characteristics of drives under switching valves, and under several valves: 1 and -1 are the two directions.

A 5/2 valve, two 3/2 valves and a proportional valve that are fully open have the same paths, so that all steady states
agree. Air of a full cycle is that of chambers that fill and vent at room temperature: V (p - p_0)/(R T).
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.datasheet.plant import actuation_of
from pneudrive.datasheet.registry import characteristics
from pneudrive.datasheet.sheet import build
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.progress import UNWATCHED

HEAD = """
[components.supply]
kind = "reservoir"
pressure = "6 bar gauge"
[components.cylinder]
kind = "cylinder/single-rod"
bore = "32 mm"
rod_diameter = "12 mm"
stroke = "100 mm"
dead_volume = { a = "5 cm3", b = "5 cm3" }
moving_mass = "1 kg"
friction = { law = "coulomb", coulomb = "20 N" }
"""
VALVE = """
[components.{name}]
kind = "{kind}"
conductance = "1 dm3/(s bar)"
critical_pressure_ratio = 0.3
"""
TIMES = 'time_on = "10 ms"\ntime_off = "10 ms"\n'
FIVE = ["supply -> v.1", "v.4 -> cylinder.a", "v.2 -> cylinder.b"]
PAIR = ["supply -> va.1", "supply -> vb.1", "va.2 -> cylinder.a", "vb.2 -> cylinder.b"]
#: Characteristics that a drive with a switching valve does not have, each with a word of the reason.
NONE = {
    "pressure-gain": "can only switch",
    "bode": "can only switch",
    "describing-function": "can only switch",
    "cushion": "no cushion",
    "sensitivity": "is a circuit",
    "lines": "needs a drive",
    "published": "no printed figure of a part",
}


def circuit(valves, connections, more="", head=HEAD):
    text = f"connections = {connections!r}\n{head}"
    for name, kind in valves.items():
        text += VALVE.format(name=name, kind=f"valve/{kind}") + more + (TIMES if "switching" in kind else "")
    return pn.Circuit.load(text)


@pytest.fixture(scope="module")
def switched():
    return circuit({"v": "switching-5/2"}, FIVE)


@pytest.mark.parametrize("name", [name for name in characteristics() if name not in ("minimum-pressure", "exergy")])
def test_a_circuit_with_a_5_2_valve_has_each_characteristic_or_says_why_not(switched, name):
    if name in NONE:
        with pytest.raises(PneudriveError, match=NONE[name]):
            pn.drive_characteristic(switched, name)
        return
    settings: dict[str, Any] = {"load-describing-function": {"frequencies": [4.0], "amplitudes": [50.0]}}.get(name, {})
    found = pn.drive_characteristic(switched, name, **settings)
    finite = [np.isfinite(found[variable]).all() for variable in found.data_vars]
    assert any(finite)
    assert found.attrs["characteristic"] == name


def test_fully_open_valves_of_three_kinds_have_the_same_steady_states(switched):
    others = [
        circuit({"v": "proportional-5/3"}, FIVE),
        circuit({"va": "switching-3/2", "vb": "switching-3/2"}, PAIR),
        circuit({"va": "proportional-3/2", "vb": "proportional-3/2"}, PAIR),
    ]
    want = pn.drive_characteristic(switched, "force-speed", points=3)
    for other in others:
        found = pn.drive_characteristic(other, "force-speed", points=3)
        for name in ("speed", "blocked_force", "stall_force"):
            np.testing.assert_allclose(found[name], want[name], rtol=1e-9)


def test_blocked_force_is_pressure_times_area_and_signs_are_those_of_the_piston(switched):
    area_a = 0.25 * math.pi * 0.032**2
    area_b = area_a - 0.25 * math.pi * 0.012**2
    found = pn.drive_characteristic(switched, "force-speed", points=1)
    rod_n = 1.01325e5 * (area_a - area_b)
    want = [7.01325e5 * area_a - 1.01325e5 * area_b - rod_n, 7.01325e5 * area_b - 1.01325e5 * area_a + rod_n]
    np.testing.assert_allclose(found.blocked_force, want, rtol=1e-6)
    out, back = (pn.drive_characteristic(switched, "step-response", command=u) for u in (1.0, -1.0))
    assert out.position[-1] > 0.099
    assert back.position[-1] < 0.001


def test_directions_are_found_where_ports_are_swapped_or_a_valve_is_normally_open(switched):
    swapped = circuit({"v": "switching-5/2"}, ["supply -> v.1", "v.2 -> cylinder.a", "v.4 -> cylinder.b"])
    assert (actuation_of(switched).out, actuation_of(swapped).out) == ({"v": 1.0}, {"v": 0.0})
    opened = circuit({"va": "switching-3/2", "vb": "switching-3/2"}, PAIR, 'normally = "open"\n')
    assert actuation_of(opened).out == {"va": 0.0, "vb": 1.0}


def test_air_of_a_full_cycle_is_that_of_two_fillings(switched):
    area_a = 0.25 * math.pi * 0.032**2
    area_b = area_a - 0.25 * math.pi * 0.012**2
    filled = 0.1 * (area_a + area_b) + 2 * 5e-6
    dead = 5e-6 * 2
    density = 287.05 * 293.15
    mass = (6e5 * filled + 1.01325e5 * (filled - dead)) / density  # a chamber at its end begins at ambient pressure
    litres = 1e3 * mass / switched.gas.anr_density_kg_m3
    found = float(pn.drive_characteristic(switched, "air").full)
    assert found == pytest.approx(litres, rel=0.02)


def test_a_chamber_that_a_spring_empties_begins_at_ambient_pressure():
    spring = 'kind = "cylinder/single-acting"\nspring_stiffness = "600 N/m"\nspring_preload = "30 N"\n'
    spring += 'breather_conductance = "1 dm3/(s bar)"\ncritical_pressure_ratio = 0.3\n'
    single = circuit(
        {"v": "switching-3/2"},
        ["supply -> v.1", "v.2 -> cylinder.a"],
        head=HEAD.replace('kind = "cylinder/single-rod"\n', spring),
    )
    found = pn.drive_characteristic(single, "step-response")
    np.testing.assert_allclose([found.pressure_a[0], found.pressure_b[0]], 1.01325e5, rtol=1e-6)
    assert list(pn.drive_characteristic(single, "flow").path.to_numpy()) == ["supply to a", "exhaust of a"]


def test_partial_commands_of_a_switching_valve_are_refused(switched):
    with pytest.raises(CommandError, match="can only switch"):
        pn.equilibrium(switched, 0.5)
    assert pn.equilibrium(switched, 1.0).gas_force_n > 0.0


def test_a_datasheet_of_a_circuit_has_numbers_and_reasons(switched, monkeypatch):
    monkeypatch.setattr("pneudrive.datasheet.sheet.OF_A_SHEET", ("force-speed", "square-response", "bode", "flow"))
    found = build(switched, [], None, UNWATCHED)
    assert {"stroke time", "blocked force"} <= {one.name for one in found.numbers}
    assert "can only switch" in found.failed["bode"]
    assert "100 mm at 7.01 bar abs" in found.notes[0]
    assert {one.key for one in found.values} >= {"components.v.conductance", "components.cylinder.stroke"}
    with pytest.raises(CommandError, match="is a circuit"):
        build(switched, [Path("run.csv")], None, UNWATCHED)


def test_the_sheet_of_a_drive_on_an_on_off_valve_has_no_small_signal_numbers_and_states_its_load_cases(monkeypatch):
    some = ("velocity", "square-response", "impact", "bode", "air")
    monkeypatch.setattr("pneudrive.datasheet.sheet.OF_A_SHEET", some)
    drive = pn.Drive.load("catalogue:smc-cm2y-25-sy3000")
    sheet = build(drive, [], None, UNWATCHED, intervals=False)
    assert not {"velocity gain", "dead zone", "resonance, small command"} & {number.name for number in sheet.numbers}
    assert "can only switch" in sheet.failed["bode"]
    stroke, air = (next(line for line in sheet.notes if line.startswith(word)) for word in ("Stroke", "Air"))
    assert "periodic cycle of 2 x " in stroke
    assert "(2 x 20 s)" in air
    # From rest, the sheet has the stroke time of a run from rest: time on counts.
    run = pn.simulate(drive, 1.0, "1 s", initial={"position": "0 mm", "pressure_b": "6 bar gauge"})
    hit = next(one["time_s"] for one in run.attrs["impacts"] if one["end"] == "b")
    assert float(sheet.results["impact"].stroke_time[-1, 0]) == pytest.approx(hit, rel=1e-3)
    assert f"from rest {hit:.3g} s out" in stroke
