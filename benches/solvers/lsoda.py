"""SciPy's LSODA, through `solve_ivp` (its documented door) and through the older, faster `odeint`."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import odeint, solve_ivp

from benches.problem import CASE_A, CASE_C, SAMPLES_C, SCALE, SEGMENTS_A, SERVO, command, initial

PERIOD = 1.0 / SERVO["sample_rate_hz"]
MAX_STEPS = 100_000


class _Lsoda:
    """One way into LSODA with one right-hand side ``f(t, y, dy, u)``."""

    citation = "scipy"

    def __init__(self, name: str, derivative: Any) -> None:
        self.name = name

        def rhs(t: float, y: np.ndarray, u: float) -> np.ndarray:
            dy = np.empty(7)
            derivative(t, y, dy, u)
            return dy

        self.rhs = rhs

    def segment(self, y: np.ndarray, u: float, times: np.ndarray, tol: float) -> np.ndarray:
        """Return the states at `times` under the command `u`, starting with `y`."""
        raise NotImplementedError

    def case_a(self, tol: float) -> np.ndarray:
        """Return the states of case A at 1 kHz, shape (2001, 7)."""
        y, parts = initial(CASE_A), [initial(CASE_A)[None]]
        for u, times in SEGMENTS_A:
            states = self.segment(y, u, times, tol)
            parts.append(states[1:])
            y = states[-1]
        return np.concatenate(parts)

    def case_c(self, tol: float) -> np.ndarray:
        """Return the states of case C at its samples, shape (10001, 7)."""
        states = np.empty((SAMPLES_C + 1, 7))
        states[0] = y = initial(CASE_C)
        for i in range(SAMPLES_C):
            u = command(i, y[0], y[1])
            states[i + 1] = y = self.segment(y, u, np.array([i * PERIOD, (i + 1) * PERIOD]), tol)[-1]
        return states


class SolveIvp(_Lsoda):
    """`scipy.integrate.solve_ivp(method="LSODA")`."""

    def segment(self, y: np.ndarray, u: float, times: np.ndarray, tol: float) -> np.ndarray:
        """Return the states at `times` under the command `u`, starting with `y`."""
        return solve_ivp(
            self.rhs, (times[0], times[-1]), y, method="LSODA", t_eval=times, rtol=tol, atol=tol * SCALE, args=(u,)
        ).y.T


class OdeInt(_Lsoda):
    """`scipy.integrate.odeint`: the same LSODA with its loop in compiled code."""

    def segment(self, y: np.ndarray, u: float, times: np.ndarray, tol: float) -> np.ndarray:
        """Return the states at `times` under the command `u`, starting with `y`."""
        return odeint(self.rhs, y, times, args=(u,), tfirst=True, rtol=tol, atol=tol * SCALE, mxstep=MAX_STEPS)
