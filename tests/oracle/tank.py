"""A tank as a textbook writes it, for SciPy: pressure and temperature, nothing of the core's."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

K, R = 1.4, 287.05
RHO_0, T_0 = 1.185, 293.15  # standard reference atmosphere of ISO 6358
LEAK_RATIO = 0.2


def iso6358(c: float, b: float, p_up: float, t_up: float, p_down: float, linear_above: float = 1.0) -> float:
    """Mass flow from up to down, kg/s; a straight line from the ratio `linear_above` on."""
    ratio = p_down / p_up
    choked = c * p_up * RHO_0 * math.sqrt(T_0 / t_up)
    if ratio > linear_above:
        choked *= (1.0 - ratio) / (1.0 - linear_above)
        ratio = linear_above
    return choked if ratio <= b else choked * math.sqrt(max(1.0 - ((ratio - b) / (1.0 - b)) ** 2, 0.0))


def between(
    c: float, b: float, p: float, t: float, p_tank: float, t_tank: float, linear_above: float = 1.0
) -> tuple[float, float]:
    """Mass flow into the tank and the temperature with which it comes."""
    if p >= p_tank:
        return iso6358(c, b, p, t, p_tank, linear_above), t
    return -iso6358(c, b, p_tank, t_tank, p, linear_above), t_tank


def pressure(
    time: np.ndarray,
    p_start: float,
    *,
    volume: float,
    c: float,
    b: float,
    other: float = 1.013e5,
    heat: float = 0.0,
    leak: float = 0.0,
    opens: float = 0.0,
    shuts: float = math.inf,
    linear_above: float = 1.0,
    ambient: tuple[float, float] = (1.013e5, 293.15),
) -> np.ndarray:
    """Pressure, Pa, at `time`; the line is open from `opens` to `shuts`."""
    p_a, t_a = ambient

    def rate(t: float, y: np.ndarray) -> list[float]:
        p, temperature = y
        flows = [between(leak, LEAK_RATIO, p_a, t_a, p, temperature)]
        if opens <= t < shuts:
            flows.append(between(c, b, other, t_a, p, temperature, linear_above))
        into = sum(m for m, _ in flows)
        enthalpy = sum(m * K * R / (K - 1.0) * origin for m, origin in flows)
        dp = (K - 1.0) / volume * (enthalpy + heat * (t_a - temperature))
        return [dp, temperature * (dp / p - into * R * temperature / (p * volume))]

    out, y = np.empty_like(time), [p_start, t_a]
    edges = [time[0], *[t for t in (opens, shuts) if time[0] < t < time[-1]], time[-1]]
    for begin, end in pairwise(edges):
        part = (time >= begin) & (time <= end)
        middle = 0.5 * (begin + end)
        run = solve_ivp(
            lambda t, y, m=middle: rate(m, y), (begin, end), y, t_eval=None, dense_output=True, rtol=1e-9, atol=1e-6
        )
        out[part] = run.sol(time[part])[0]
        y = run.y[:, -1]
    return out
