"""LSODA in compiled code from end to end through numbalsoda: right-hand side, solver and controller.

It takes one absolute tolerance, so it integrates the states divided by SCALE.  It is built by a Fortran compiler.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numbalsoda import lsoda, lsoda_sig

from benches.problem import SCALE, Case
from benches.solvers.base import Peer
from benches.solvers.rhs import PARAMETERS, jitted

MAX_STEPS = 100_000
N_DATA = 1 + len(PARAMETERS)
SCALES = tuple(SCALE)


def _right_hand_side() -> int:
    """Compile the scaled right-hand side; its data are the command and the parameters."""
    derivative = jitted()

    @numba.cfunc(lsoda_sig)
    def scaled(_t: float, y_: Any, dy_: Any, data_: Any) -> None:
        y, dy, data = numba.carray(y_, (7,)), numba.carray(dy_, (7,)), numba.carray(data_, (N_DATA,))
        states, rates = np.empty(7), np.empty(7)
        for i in range(7):
            states[i] = y[i] * SCALES[i]
        derivative(states, rates, data[0], data[1:])
        for i in range(7):
            dy[i] = rates[i] / SCALES[i]

    _KEPT.append(scaled)
    return scaled.address


_KEPT: list[Any] = []  # a compiled function lives as long as its object


@numba.njit
def _control(address: int, states: np.ndarray, data: np.ndarray, gains: np.ndarray, tol: float) -> None:
    """Fill `states`, the first of which is the start, under the controller of `benches.problem.Servo`."""
    kp, kd, amplitude, frequency, rate, centre = gains
    w, times, y = 2.0 * np.pi * frequency, np.empty(2), states[0] / SCALE
    for i in range(len(states) - 1):
        phase = w * i / rate
        error = centre + amplitude * np.sin(phase) - states[i, 0]
        slip = amplitude * w * np.cos(phase) - states[i, 1]
        data[0] = min(1.0, max(-1.0, kp * error + kd * slip))
        times[0], times[1] = i / rate, (i + 1) / rate
        found, _ = lsoda(address, y, times, data, tol, tol, MAX_STEPS)
        y = found[1]
        states[i + 1] = y * SCALE


@numba.njit
def ensemble(address: int, starts: np.ndarray, data: np.ndarray, ends: np.ndarray, steps: Any, tol: float) -> None:
    """Fill `ends`, shape (members, 7), by the command steps ``steps``: commands and the times between them."""
    commands, times = steps
    for member in range(len(data)):
        y = starts / SCALE
        for k in range(len(commands)):
            data[member, 0] = commands[k]
            y = lsoda(address, y, times[k : k + 2], data[member], tol, tol, MAX_STEPS)[0][1]
        ends[member] = y * SCALE


class NumbaLsoda(Peer):
    """numbalsoda's LSODA."""

    name = "numbalsoda LSODA"

    def __init__(self) -> None:
        self.address = _right_hand_side()
        self.data = np.array([0.0, *PARAMETERS])

    def segment(self, y: np.ndarray, u: float, times: np.ndarray, tol: float) -> np.ndarray:
        """Return the states at `times` under the command `u`, starting with `y`."""
        self.data[0] = u
        found, success = lsoda(self.address, y / SCALE, times, self.data, rtol=tol, atol=tol, mxstep=MAX_STEPS)
        if not success:
            raise RuntimeError("LSODA gave up")
        return found * SCALE


class Compiled(NumbaLsoda):
    """The same with the controller's loop compiled, too."""

    name = "numbalsoda LSODA, controller in Numba"

    def control(self, case: Case, tol: float) -> np.ndarray:
        """Solve a case with its controller in compiled code."""
        servo = case.servo
        assert servo is not None
        states = np.empty((servo.samples + 1, 7))
        states[0] = case.initial
        gains = (servo.kp, servo.kd, servo.amplitude_m, servo.frequency_hz, servo.sample_rate_hz, servo.centre_m)
        _control(self.address, states, self.data, np.array(gains), tol)
        return states
