"""CVODE through CasADi: symbolic right-hand side, exact Jacobian, states divided by SCALE."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import casadi
import numpy as np

from benches.problem import SCALE
from benches.solvers.base import Peer
from benches.solvers.branchless import derivative
from benches.solvers.rhs import PARAMETERS

OPERATIONS = SimpleNamespace(
    sqrt=casadi.sqrt, exp=casadi.exp, where=casadi.if_else, minimum=casadi.fmin, maximum=casadi.fmax
)


class CasadiCvodes(Peer):
    """`casadi.integrator(..., "cvodes", ...)`, made once for each command's sign, length and tolerance."""

    name = "CasADi cvodes"

    def __init__(self) -> None:
        self.made: dict[tuple[Any, ...], Any] = {}

    def segment(self, y: np.ndarray, u: float, times: np.ndarray, tol: float) -> np.ndarray:
        """Return the states at `times` under the command `u`, starting with `y`."""
        key = (u >= 0.0, len(times), tol)
        if key not in self.made:
            self.made[key] = self._integrator(u >= 0.0, times - times[0], tol)
        found = self.made[key](x0=y / SCALE, p=abs(u))["xf"]
        return np.vstack([y, np.asarray(found).T * SCALE])

    def _integrator(self, forward: bool, times: np.ndarray, tol: float) -> Any:
        scaled, opening = casadi.SX.sym("y", 7), casadi.SX.sym("u")
        y = [scaled[i] * SCALE[i] for i in range(7)]
        rates = derivative(OPERATIONS, y, _Signed(opening, forward), PARAMETERS)
        ode = casadi.vertcat(*(rate / SCALE[i] for i, rate in enumerate(rates)))
        options = {"reltol": tol, "abstol": tol, "max_num_steps": 100_000, "show_eval_warnings": False}
        problem = {"x": scaled, "p": opening, "ode": ode}
        return casadi.integrator("run", "cvodes", problem, 0.0, list(times[1:]), options)


class _Signed:
    """An opening whose sign is known while its size is a symbol."""

    def __init__(self, opening: Any, forward: bool) -> None:
        self.opening, self.forward = opening, forward

    def __ge__(self, _: float) -> bool:
        return self.forward

    def __abs__(self) -> Any:
        return self.opening
