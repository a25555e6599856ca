"""CVODE (BDF) of SUNDIALS through scikit-sundae."""

from __future__ import annotations

from typing import Any

import numpy as np
from sksundae.cvode import CVODE

from benches.problem import CASE_A, CASE_C, SAMPLES_C, SCALE, SEGMENTS_A, SERVO, command, initial

PERIOD = 1.0 / SERVO["sample_rate_hz"]
MAX_STEPS = 100_000


class Sundae:
    """CVODE with one right-hand side ``f(t, y, dy, u)`` and a dense finite-difference Jacobian."""

    def __init__(self, name: str, derivative: Any) -> None:
        self.name = name
        self.command = 0.0

        def rhs(t: float, y: np.ndarray, dy: np.ndarray) -> None:
            derivative(t, y, dy, self.command)

        self.rhs = rhs

    def _solver(self, tol: float) -> CVODE:
        return CVODE(self.rhs, method="BDF", rtol=tol, atol=tol * SCALE, max_num_steps=MAX_STEPS)

    def case_a(self, tol: float) -> np.ndarray:
        """Return the states of case A at 1 kHz, shape (2001, 7)."""
        solver, y, parts = self._solver(tol), initial(CASE_A), [initial(CASE_A)[None]]
        for u, times in SEGMENTS_A:
            self.command = u
            states = solver.solve(times, y).y
            parts.append(states[1:])
            y = states[-1].copy()
        return np.concatenate(parts)

    def case_c(self, tol: float) -> np.ndarray:
        """Return the states of case C at its samples, shape (10001, 7)."""
        solver, states = self._solver(tol), np.empty((SAMPLES_C + 1, 7))
        states[0] = y = initial(CASE_C)
        for i in range(SAMPLES_C):
            self.command = command(i, y[0], y[1])
            end = (i + 1) * PERIOD
            solver.init_step(i * PERIOD, y)
            states[i + 1] = y = solver.step(end, tstop=end).y
        return states
