"""SciPy's LSODA, through `solve_ivp` (its documented door) and through the older, faster `odeint`."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import odeint, solve_ivp

from benches.problem import SCALE
from benches.solvers.base import Peer

MAX_STEPS = 100_000


class _Lsoda(Peer):
    """One way into LSODA with one right-hand side ``f(t, y, dy, u)``."""

    def __init__(self, name: str, derivative: Any, slow: bool = False) -> None:
        self.name, self.slow = name, slow

        def rhs(t: float, y: np.ndarray, u: float) -> np.ndarray:
            dy = np.empty(7)
            derivative(t, y, dy, u)
            return dy

        self.rhs = rhs


class SolveIvp(_Lsoda):
    """`scipy.integrate.solve_ivp`, LSODA or another of its methods."""

    method = "LSODA"

    def segment(self, y: np.ndarray, u: float, times: np.ndarray, tol: float) -> np.ndarray:
        """Return the states at `times` under the command `u`, starting with `y`."""
        return solve_ivp(
            self.rhs, (times[0], times[-1]), y, method=self.method, t_eval=times, rtol=tol, atol=tol * SCALE, args=(u,)
        ).y.T


class Radau(SolveIvp):
    """`scipy.integrate.solve_ivp(method="Radau")`."""

    method = "Radau"


class OdeInt(_Lsoda):
    """`scipy.integrate.odeint`: the same LSODA with its loop in compiled code."""

    def segment(self, y: np.ndarray, u: float, times: np.ndarray, tol: float) -> np.ndarray:
        """Return the states at `times` under the command `u`, starting with `y`."""
        return odeint(self.rhs, y, times, args=(u,), tfirst=True, rtol=tol, atol=tol * SCALE, mxstep=MAX_STEPS)
