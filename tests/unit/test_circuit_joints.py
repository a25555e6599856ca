"""Treatment of joints of two restrictions."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.describe.files.load import circuit_schema
from pneudrive.errors import DescriptionError

FILE = """
junctions = "series"
connections = ["mains -> inlet -> hose -> tank"]

[initial]
tank = "1 bar abs"

[components]
mains = { kind = "reservoir", pressure = "7 bar abs" }
inlet = { kind = "fitting", conductance = "2 dm3/(s bar)", critical_pressure_ratio = 0.3 }
hose = { kind = "tube", length = "1 m", diameter = "4 mm" }
tank = { kind = "tank", volume = "1 l" }
"""


def test_restrictions_in_a_row_are_merged_on_request():
    merged = pn.Circuit.load(FILE)
    apart = merged.replace({"junctions": "volume"})
    assert (merged.joint_volumes, [name for name, _ in apart.joint_volumes]) == ([], ["inlet.2"])
    assert "inlet.pressure" not in merged.start_names
    assert pn.Circuit.load(merged.to_toml()).core_json() == merged.core_json()
    # What is said by default is not said: a circuit without the key is the same as before there was one.
    assert "junctions" not in apart.core_json()
    run, other = (circuit.simulate(None, "0.1 s", rtol=1e-8) for circuit in (merged, apart))
    flow = run["hose.mass_flow"]
    assert bool((flow == run["inlet.mass_flow"]).all())
    assert float(flow[0]) == pytest.approx(1.067e-8 * 7e5 * 1.185, rel=1e-3)  # choked
    # The joint between them has to be filled first.
    filled, of_joint = float(run["tank.pressure"][-1]), 6.3e-3 * 6e5
    assert 0.0 < filled - float(other["tank.pressure"][-1]) < 2.0 * of_joint


def test_a_joint_that_is_merged_away_has_no_start():
    with pytest.raises(DescriptionError, match=r"initial\.inlet\.2|inlet\.2 is not a start value"):
        pn.Circuit.load(FILE.replace("[initial]", '[initial]\ninlet.2 = "2 bar abs"'))


def test_other_words_are_refused():
    with pytest.raises(DescriptionError, match="junctions"):
        pn.Circuit.load(FILE.replace('"series"', '"merged"'))
    assert circuit_schema()["properties"]["junctions"]["enum"] == ["volume", "series"]


# --- Pilot lines, and components of which a number is needed unless something else is given.

HOLD = (Path(__file__).parents[1] / "data" / "hold.toml").read_text("utf-8")


def test_a_load_is_held_until_the_pilot_comes():
    circuit = pn.Circuit.load(HOLD)
    joints = json.loads(circuit.core_json())["joints"]
    assert ["valve.4", "tank.1", "hold.12"] in joints
    run = circuit.simulate({"valve": "0 s: 0, 1 s: 1"}, "10 s")
    np.testing.assert_array_equal(run["load.pressure"][:1001], 5e5)
    assert run["load.pressure"][-1] < 1.2e5
    # The joint with the pilot is the tank's: 1 cm3, and the valve's port has no volume of its own.
    assert not any("hold.12" in line for line in circuit.assumed())


@pytest.mark.parametrize(
    ("old", "new", "what", "remedy"),
    [
        ("valve.4 .. hold.12", "valve.4 -> hold.12", "hold.12 is a pilot port", '"valve.4 .. hold.12"'),
        ("valve.4 -> tank", "valve.4 .. tank", "neither valve.4 nor tank.1 is a pilot port", '"valve.4 -> tank.1"'),
        ('"valve.4 .. hold.12",', "", "port hold.12 is not connected", '"valve.4 .. hold.12"'),
        ("valve.2 -> hold", "valve.2 .. hold", "and \"..\"", "two connections"),
        ("hold.12", "hold.12 .. tank", "hold.12 is joined twice", "keep one of the lines"),
        ('"valve.4 .. hold.12",\n]', ']\nplugged = ["hold.12"]', "no gas reaches the pilot port hold.12", ".. hold.12"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_pilot_line_is_told(old, new, what, remedy):
    assert old in HOLD
    with pytest.raises(DescriptionError) as caught:
        pn.Circuit.load(HOLD.replace(old, new))
    assert what in str(caught.value)
    assert remedy in str(caught.value)


def test_a_number_is_needed_unless_something_else_is_given():
    kind = {"kind": "flow-control", "needle_conductance": "0.1 dm3/(s bar)"}
    made = pn.Circuit(
        components={"fc": kind | {"throttles": "both"}, "tank": {"kind": "tank", "volume": "1 l"}},
        connections=["tank -> fc -> ambient"],
    )
    assert "conductance" not in json.loads(made.core_json())["components"][0]["numbers"]
    with pytest.raises(DescriptionError, match=r"conductance is missing.*"):
        made.replace({"components.fc.throttles": "in"})
    leak = {"kind": "leak", "gap_height": "10 um", "diameter": "20 mm"}
    with pytest.raises(DescriptionError, match="length is missing") as caught:
        made.replace({"components.fc": leak})
    assert "needed unless coefficient is given" in str(caught.value)
    given = made.replace({"components.fc": {"kind": "leak", "coefficient": "1e-15 kg K/(s Pa2)"}})
    flow = given.simulate(None, "0.1 s", initial={"tank": "6 bar abs"})["fc.mass_flow"][0]
    assert float(flow) == pytest.approx(1e-15 * (6e5**2 - 101325.0**2) / 293.15, rel=1e-9)
