"""An independent model of circuits of rigid volumes: mass and energy of each, and the flow paths between them.

It shares no code with the product: the published equations in plain Python, solved by SciPy's explicit
Runge-Kutta method of order 8.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

K, GAS_CONSTANT = 1.4, 287.05  # -, J/(kg K)
CP, CV = K * GAS_CONSTANT / (K - 1.0), GAS_CONSTANT / (K - 1.0)
ANR_DENSITY, ANR_TEMPERATURE = 1.185, 293.15  # kg/m3, K: ISO 8778
LINEAR_ABOVE = 0.999

#: Pressure, Pa absolute, and temperature, K.
Gas = tuple[float, float]


def flow_function(r: float, b: float, end: float = 1.0) -> float:
    """Return ISO 6358's phi at the pressure ratio r; `end` is the ratio at which nothing flows any more."""
    if r <= b:
        return 1.0
    r = b + (r - b) * (1.0 - b) / (end - b)
    if r >= 1.0:
        return 0.0
    ellipse = np.sqrt(1.0 - ((min(r, LINEAR_ABOVE) - b) / (1.0 - b)) ** 2)
    return float(ellipse if r <= LINEAR_ABOVE else ellipse * (1.0 - r) / (1.0 - LINEAR_ABOVE))


def path(conductance: float, b: float, one: Gas, two: Gas) -> float:
    """Return the mass flow, kg/s, from one to two through a path of sonic conductance C, m3/(s Pa)."""
    sign, (p, t), (behind, _) = (1.0, one, two) if one[0] >= two[0] else (-1.0, two, one)
    return sign * conductance * p * ANR_DENSITY * np.sqrt(ANR_TEMPERATURE / t) * flow_function(behind / p, b)


def check_valve(conductance: float, b: float, cracking: float, one: Gas, two: Gas) -> float:
    """Return the mass flow, kg/s, through a path that opens from one to two where p1 - p2 > p_c."""
    p, t = one
    choked = conductance * p * ANR_DENSITY * np.sqrt(ANR_TEMPERATURE / t)
    return choked * flow_function(two[0] / p, b, 1.0 - cracking / p)


def clip(share: float) -> float:
    """Return a share between 0 and 1."""
    return min(max(share, 0.0), 1.0)


@dataclass(frozen=True)
class Network:
    """Volumes, m3, in an adiabatic circuit; `flows` gives (mass flow, from, to) at their states and those of `extra`.

    The index of a volume, or the gas of a reservoir, stands for each end; `extra_rates` gives rates of other states.
    """

    volumes: tuple[float, ...]
    flows: Callable[[list[Gas], np.ndarray], list[tuple[float, int | Gas, int | Gas]]]
    extra_rates: Callable[[list[Gas], np.ndarray], list[float]]

    def _gas(self, y: np.ndarray) -> list[Gas]:
        gas = []
        for i, volume in enumerate(self.volumes):
            mass, energy = y[2 * i], y[2 * i + 1]
            t = energy / (mass * CV)
            gas.append((mass * GAS_CONSTANT * t / volume, t))
        return gas

    def _rates(self, y: np.ndarray) -> np.ndarray:
        n, gas, rates = 2 * len(self.volumes), self._gas(y), np.zeros_like(y)
        for flow, one, two in self.flows(gas, y[n:]):
            donor = one if flow >= 0.0 else two
            t = gas[donor][1] if isinstance(donor, int) else donor[1]
            for end, sign in ((one, -1.0), (two, 1.0)):
                if isinstance(end, int):
                    rates[2 * end : 2 * end + 2] += sign * flow * np.array([1.0, CP * t])
        rates[n:] = self.extra_rates(gas, y[n:])
        return rates

    def pressures(self, start: list[Gas], extra: list[float], times: np.ndarray) -> np.ndarray:
        """Return the pressures, Pa, shape (volumes, times), from a start."""
        each = [(p * v / (GAS_CONSTANT * t), p * v / (K - 1.0)) for (p, t), v in zip(start, self.volumes, strict=True)]
        y0 = [*(value for pair in each for value in pair), *extra]
        done = solve_ivp(
            lambda _, y: self._rates(y),
            (times[0], times[-1]),
            y0,
            "DOP853",
            times,
            rtol=1e-9,
            atol=1e-13,
            max_step=2e-4,
        )
        return np.array([[gas[0] for gas in self._gas(y)] for y in done.y.T]).T
