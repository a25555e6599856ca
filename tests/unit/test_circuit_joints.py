"""Treatment of joints of two restrictions."""

from __future__ import annotations

import pytest

import pneudrive as pn
from pneudrive.describe.files.schema import circuit_schema
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
    assert "inlet.pressure" not in merged.start_keys
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
