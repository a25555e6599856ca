"""Flow tables of proportional valves: how they are written, read back and refused, and what flows."""

from __future__ import annotations

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import DescriptionError

# Two 3/2 proportional valves: force and stiffness are both commanded.
AXIS = """
connections = ["mains -> v_a.1", "mains -> v_b.1", "v_a.2 -> axis.a", "v_b.2 -> axis.b"]

[components.mains]
kind = "reservoir"
pressure = "7 bar abs"

[components.v_a]
kind = "valve/proportional-3/2"
flow_table = [
  { opening = -1, exhaust = "2.4 dm3/(s bar)" }, { opening = 0 }, { opening = 1, supply = "2.7 dm3/(s bar)" }
]
frequency = "90 Hz"
damping_ratio = 0.7
delay = "1 ms"
hysteresis = "0.4 %"
copies = ["v_a", "v_b"]

[components.axis]
kind = "cylinder/rodless"
bore = "25 mm"
stroke = "500 mm"
dead_volume = { a = "10 cm3", b = "10 cm3" }
moving_mass = "2 kg"
friction = { law = "coulomb", coulomb = "30 N", viscous = "40 N s/m" }
"""
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
        ('[{ supply = "1 dm3/(s bar)" }, { opening = 1 }]', "only opening needed"),
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
