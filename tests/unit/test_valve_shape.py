"""Overlap and leakage of the valve of a drive file: the circuit's valve acts, and identify and validate know them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.describe.files.load import drive_schema
from pneudrive.describe.tables.parts import Valve
from pneudrive.describe.tables.valve_flow import KV_PER_CV, conductance_from_kv
from pneudrive.errors import DescriptionError, FitError
from pneudrive.validate.balance import openings

pytestmark = pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")
START = "position = 200 mm, pressure_a = 3 bar abs, pressure_b = 3 bar abs"
STEPS = [(0.0, 0.05), (0.15, 0.6), (0.25, -0.05), (0.4, -0.5), (0.5, 0.15), (0.65, -0.15)]


@pytest.fixture(scope="module")
def plain():
    return pn.Drive.load("catalogue:reference")


@pytest.fixture(scope="module")
def recorded(plain):
    run = pn.simulate(plain.replace({"valve.overlap": 0.03}), STEPS, "0.8 s", initial=START)
    noise, size = np.random.default_rng(3), run.time.size
    columns = {"time_s": run.time.to_numpy(), "command": run.command.to_numpy()}
    columns["position_m"] = run.position.to_numpy() + 2e-6 * noise.standard_normal(size)
    return columns | {
        f"pressure_{c}_pa": run[f"pressure_{c}"].to_numpy() + 300.0 * noise.standard_normal(size) for c in "ab"
    }


def test_an_edge_opens_behind_its_overlap(plain):
    """A command u acts as (u - d) / (1 - d): the run is that of the valve without overlap under this command."""
    shifted = [(t, float(np.sign(u) * max(abs(u) - 0.1, 0.0) / 0.9)) for t, u in STEPS]
    with_overlap = pn.simulate(plain.replace({"valve.overlap": 0.1}), STEPS, "0.8 s", initial=START, rtol=1e-9)
    without = pn.simulate(plain, shifted, "0.8 s", initial=START, rtol=1e-9)
    assert np.abs(with_overlap.position - without.position).max() < 1e-8
    assert np.abs(without.position - pn.simulate(plain, STEPS, "0.8 s", initial=START).position).max() > 1e-2


def test_the_balances_use_the_openings_of_the_run(plain):
    leaky = plain.replace({"valve.overlap": 0.02, "valve.leakage": 0.004})
    found = pn.validate(leaky, pn.simulate(leaky, STEPS, "0.8 s", initial=START))
    assert found.verdicts[1].value < 1e-4
    assert found.diagnosis().is_clean
    shut = openings(leaky, np.zeros(1))
    assert shut == pytest.approx(np.full((1, 4), 0.004))
    assert openings(leaky, np.array([0.51]))[0] == pytest.approx([0.5, 0.0, 0.0, 0.5], abs=2e-7)


def test_a_drive_without_these_keys_is_as_before(plain):
    assert plain.description_hash == "6dd42b38838bd530334e75ffcda9d794a940c8a1734304a60ebb3537f6798480"
    assert plain.replace({"valve.overlap": 0.03}).description_hash != plain.description_hash
    with pytest.raises(DescriptionError, match=r"valve\.overlap: 1.0 is out of bounds"):
        plain.replace({"valve.overlap": 1.0})


def test_the_overlap_is_identified_and_applied(plain, recorded):
    fit = pn.identify(plain, recorded, ["valve.overlap", "valve.conductance"])
    low, high = fit.intervals["valve.overlap"]
    assert low <= 0.03 <= high
    assert high - low < 1e-3
    assert fit.apply(plain).valve.overlap == pytest.approx(0.03, abs=5e-4)
    with pytest.raises(FitError, match=r"valve\.overlop is not a number of this drive"):
        pn.identify(plain, recorded, ["valve.overlop"])
    with pytest.raises(FitError, match=r"(?s)a drive file does not have valve\.delay.*command: delay = free"):
        pn.identify(plain, recorded, ["valve.delay"])


# --- The size of a valve in four ways: against printed pairs of a catalogue, which no formula here was fitted to.

# series: C dm3/(s bar), b, Cv, nominal flow l/min ANR [smc-eus11-83]
SY = {
    "SY3000": (1.1, 0.28, 0.29, 276),
    "SY5000": (2.8, 0.37, 0.90, 746),
    "SY7000": (4.5, 0.28, 1.4, 1130),
    "SY9000": (10, 0.29, 2.5, 2527),
}


def valve(**size):
    return Valve(kind="proportional-5/3", **size).conductance_m3_s_pa


@pytest.mark.parametrize(("c", "b", "cv", "flow"), SY.values(), ids=SY)
def test_printed_pairs(c, b, cv, flow):
    assert valve(conductance=f"{c} dm3/(s bar)", critical_pressure_ratio=b) == pytest.approx(c * 1e-8)
    assert valve(nominal_flow=f"{flow} l/min ANR", critical_pressure_ratio=b) == pytest.approx(c * 1e-8, rel=2e-3)
    assert valve(cv=cv, critical_pressure_ratio=b) == pytest.approx(c * 1e-8, rel=0.19)


def test_kv_and_cv_are_one_thing_in_two_units():
    assert pytest.approx(0.865, abs=5e-4) == KV_PER_CV
    assert valve(cv=1.0, critical_pressure_ratio=0.3) == valve(kv=KV_PER_CV, critical_pressure_ratio=0.3)
    assert valve(kv="2 Kv", critical_pressure_ratio=0.3) == conductance_from_kv(2.0)


@pytest.mark.parametrize(("key", "own", "other"), [("kv", "0.3 m3/h", "0.3 Cv"), ("cv", "0.3 Cv", "0.3 Kv")])
def test_the_schema_takes_what_the_file_takes(key, own, other):
    number, text = drive_schema()["$defs"]["Valve"]["properties"][key]["anyOf"][0]["anyOf"]
    assert number == {"type": "number", "exclusiveMinimum": 0.0}
    assert re.search(text["pattern"], own)
    assert not re.search(text["pattern"], other)
    assert valve(**{key: own}, critical_pressure_ratio=0.3) == valve(**{key: 0.3}, critical_pressure_ratio=0.3)


# --- Flow tables of proportional valves: how they are written, read back and refused, and what flows.

# Two 3/2 proportional valves: force and stiffness are both commanded.
AXIS = (Path(__file__).parents[1] / "data" / "valve_shape_axis.toml").read_text("utf-8")
TABLE = AXIS[AXIS.index("flow_table") : AXIS.index("frequency")]


def test_two_valves_command_force_and_stiffness():
    circuit = pn.Circuit.load(AXIS)
    assert circuit.components["v_a"].hysteresis == 0.004
    assert circuit.components["v_a"].flow_table[0] == (-1.0, 0.0, 0.0, pytest.approx(2.4e-8), 0.0)
    again = pn.Circuit.load(circuit.to_toml())
    assert again.core_json() == circuit.core_json()
    start = {"axis.a": "3 bar abs", "axis.b": "3 bar abs"}
    stiff = circuit.simulate(dict.fromkeys(("v_a", "v_b"), "0 s: 0, 10 ms: 1"), "0.1 s", initial=start)
    soft = circuit.simulate({"v_a": -1, "v_b": -1}, "0.1 s", initial=start)
    for side in "ab":
        assert float(stiff[f"axis.{side}.pressure"][-1]) > 5e5
        assert float(soft[f"axis.{side}.pressure"][-1]) < 2e5
    # Nothing flows before the dead time is over.
    flow, opening = stiff["v_a.mass_flow_2"].to_numpy(), stiff["v_a.position"].to_numpy()
    assert (flow[:12] == 0.0).all()
    # Then 2.7e-8 m3/(s Pa) 1.185 kg/m3 7e5 Pa phi, by the share that the spool opens of it.
    ratio = stiff["axis.a.pressure"].to_numpy()[12:] / 7e5
    phi = np.sqrt(1.0 - np.maximum(0.0, (ratio - 0.3) / 0.7) ** 2)
    share = np.clip(opening[12:], 0.0, 1.0)
    assert share[0] < 0.5 < share[4]
    subsonic = ratio < 0.99
    expected = 2.7e-8 * 1.185 * 7e5 * phi * share**2 * (3.0 - 2.0 * share)
    assert flow[12:][subsonic] == pytest.approx(expected[subsonic], rel=1e-9)
    assert any("critical_pressure_ratio = 0.3" in line for line in circuit.assumed())


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('[{ opening = 0 }, { opening = "x %", supply = "1 dm3/(s bar)" }]', "opening of point 2"),
        ('[{ opening = 0 }, { opening = 1, suply = "1 dm3/(s bar)" }]', "point 2"),
        ("[{ opening = 0 }, { opening = 1 }]", "v_a.flow_table opens no edge"),
        ('[{ opening = 0 }, { opening = 1, supply = "1 bar" }]', "supply of point 2"),
        ('[{ supply = "1 dm3/(s bar)" }, { opening = 1 }]', "only opening must be given"),
    ],
)
def test_wrong_flow_tables_are_told(table, said):
    with pytest.raises(DescriptionError, match=said):
        pn.Circuit.load(AXIS.replace(TABLE, f"flow_table = {table}\n"))


def test_a_valve_has_a_size_or_a_flow_table():
    with pytest.raises(DescriptionError, match=r"v_a\.conductance and v_a\.flow_table both set this value"):
        pn.Circuit.load(AXIS.replace('frequency = "90 Hz"', 'conductance = "2 dm3/(s bar)"'))
    with pytest.raises(DescriptionError, match="conductance"):
        pn.Circuit.load(AXIS.replace(TABLE, ""))
