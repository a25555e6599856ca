"""CVODE (BDF) of SUNDIALS through scikit-sundae."""

from __future__ import annotations

from typing import Any

import numpy as np
from sksundae.cvode import CVODE

from benches.problem import SCALE, Case
from benches.solvers.base import Peer

MAX_STEPS = 100_000


class Sundae(Peer):
    """CVODE with one right-hand side ``f(t, y, dy, u)`` and a dense finite-difference Jacobian."""

    def __init__(self, name: str, derivative: Any, slow: bool = False) -> None:
        self.name, self.slow = name, slow
        self.command = 0.0

        def rhs(t: float, y: np.ndarray, dy: np.ndarray) -> None:
            derivative(t, y, dy, self.command)

        self.rhs = rhs

    def solve(self, case: Case, tol: float) -> np.ndarray:
        """Return the states of a case; one solver object runs the whole case."""
        self.solver = CVODE(self.rhs, method="BDF", rtol=tol, atol=tol * SCALE, max_num_steps=MAX_STEPS)
        return super().solve(case, tol)

    bare = solve

    def segment(self, y: np.ndarray, u: float, times: np.ndarray, tol: float) -> np.ndarray:
        """Return the states at `times` under the command `u`, starting with `y`."""
        self.command = u
        if len(times) > 2:
            return self.solver.solve(times, y).y
        self.solver.init_step(times[0], y)
        return self.solver.step(times[1], tstop=times[1]).y[None]
