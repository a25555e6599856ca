"""A circuit against an independent model of it: regulator, tanks, flow control, check valve and quick exhaust valve."""

from __future__ import annotations

import numpy as np

import pneudrive as pn
from oracle.network import Gas, Network, check_valve, clip, path

ROOM, AMBIENT, MAINS = 293.15, 101325.0, 12e5
SET, DROP, LAG, OFFSET, RISE = 5e5, 6e4, 0.03, 2e4, 2e4
B, CRACKING = 0.3, 1e4
START = [2e5, 6e5, 6.5e5]
CIRCUIT = """
schema = 1
connections = ["mains -> reg -> one", "one -> control -> two", "one -> quick -> three"]
[components.mains]
kind = "reservoir"
pressure = "12 bar abs"
[components.reg]
kind = "regulator"
set_pressure = "5 bar abs"
conductance = "2 dm3/(s bar)"
[components.one]
kind = "tank"
volume = "1 l"
[components.two]
kind = "tank"
volume = "0.3 l"
[components.three]
kind = "tank"
volume = "0.2 l"
[components.control]
kind = "flow-control"
needle_conductance = "0.2 dm3/(s bar)"
conductance = "1 dm3/(s bar)"
[components.quick]
kind = "quick-exhaust"
conductance = "1 dm3/(s bar)"
exhaust_conductance = "3 dm3/(s bar)"
[initial]
one = "2 bar abs"
two = "6 bar abs"
three = "6.5 bar abs"
"""


def flows(gas: list[Gas], seat: np.ndarray) -> list[tuple[float, int | Gas, int | Gas]]:
    one, two, three = gas
    mains, ambient = (MAINS, ROOM), (AMBIENT, ROOM)
    u = clip((three[0] - one[0]) / 1e4)
    return [
        (path(2e-8 * seat[0], B, mains, one), mains, 0),
        (path(1e-9 * clip((one[0] - SET - OFFSET) / RISE), B, one, ambient), 0, ambient),
        (path(2e-9, B, one, two), 0, 1),
        (check_valve(1e-8, B, CRACKING, one, two), 0, 1),
        (check_valve(1e-8, B, CRACKING, one, three), 0, 2),
        (path(3e-8 * u * u * (3.0 - 2.0 * u), B, three, ambient), 2, ambient),
    ]


def seat(p: float) -> float:
    return clip((SET - p) / DROP)


def test_pressures_are_those_of_an_independent_model():
    model = Network((1e-3, 3e-4, 2e-4), flows, lambda gas, y: [(seat(gas[0][0]) - y[0]) / LAG])
    times = np.arange(61) * 0.01
    expected = model.pressures([(p, ROOM) for p in START], [seat(START[0])], times)
    # The third tank empties through its exhaust, and the regulator relieves.
    assert expected[2, 2] < 5.2e5
    assert expected[0].max() > SET + OFFSET
    run = pn.Circuit.load(CIRCUIT).simulate({}, "0.6 s", sample_rate="100 Hz")
    for name, own in zip(("one", "two", "three"), expected, strict=True):
        np.testing.assert_allclose(run[f"{name}.pressure"], own, rtol=1e-5)
