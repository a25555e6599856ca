"""A sampled servo on a session, as a user writes it: a drive follows a sine about a position."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from pneudrive.simulation.session import Session

#: Outputs that are read at each sample: position and velocity for the controller, then the gas.
READS = ("position_m", "velocity_m_s", "pressure_a_pa", "temperature_a_k", "pressure_b_pa", "temperature_b_k")


def controller(kp: float, kd: float, amplitude: float, frequency: float, middle: float) -> Callable[..., float]:
    """Return proportional-derivative control of a sine, m and Hz, clipped to -1 .. 1."""
    w = 2.0 * math.pi * frequency

    def command(t: float, x: float, v: float, *_: float) -> float:
        error, slip = middle + amplitude * math.sin(w * t) - x, amplitude * w * math.cos(w * t) - v
        return min(1.0, max(-1.0, kp * error + kd * slip))

    return command


def compiled(kp: float, kd: float, amplitude: float, frequency: float, middle: float) -> Any:
    """Return the same controller, compiled by Numba to a function in C."""
    import numba

    w = 2.0 * math.pi * frequency

    @numba.cfunc(numba.float64(numba.float64, numba.types.CPointer(numba.float64)))
    def command(t: float, read: Any) -> float:
        error, slip = middle + amplitude * math.sin(w * t) - read[0], amplitude * w * math.cos(w * t) - read[1]
        return min(1.0, max(-1.0, kp * error + kd * slip))

    return command


def follow_sine(
    core: Any, control: Any, duration: float, rate: float, start: Mapping[str, float], rtol: float
) -> dict[str, np.ndarray]:
    """Run a compiled drive from its start under a controller, s and Hz. Return time, outputs and command."""
    return Session(core.start(start, rtol)).control(control, 1.0 / rate, duration, reads=READS)
