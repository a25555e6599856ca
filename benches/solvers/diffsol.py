"""diffsol's BDF through pydiffsol: DiffSL code, compiled by LLVM, Jacobian by automatic differentiation.

It takes one absolute tolerance, so it integrates the states divided by SCALE.  The language has no
branches: a kink is written with `min`, `max` and `heaviside`; both sides stay finite.
"""

from __future__ import annotations

import math

import numpy as np
import pydiffsol

from benches.problem import SCALE, Case
from benches.solvers.base import Peer
from benches.solvers.rhs import PARAMETERS

NAMES = (
    "k", "rg", "psup", "tsup", "pexh", "texh", "bore", "stroke", "dead", "mass", "alpha", "twall",
    "rhoc", "b", "rlin", "psilin", "kstop", "dstop", "dsat", "fc", "fs", "vs", "fv", "sig", "sigd",
)  # fmt: skip
PORTS = ("ppa", "tpa", "ppb", "tpb", "open")


def _chamber(name: str, volume: str, rate: str, surface: str) -> str:
    """DiffSL lines for one chamber; its flow is positive into it."""
    c = name
    return f"""
    fw{c} {{ heaviside(pp{c} - p{c}) }}
    pup{c} {{ max(pp{c}, p{c}) }}
    r{c} {{ min(pp{c}, p{c}) / pup{c} }}
    tup{c} {{ fw{c} * tp{c} + (1.0 - fw{c}) * t{c} }}
    s{c} {{ (min(max(r{c}, b), rlin) - b) / (1.0 - b) }}
    psi{c} {{ min(sqrt(1.0 - s{c} * s{c}), psilin * (1.0 - r{c}) / (1.0 - rlin)) }}
    w{c} {{ (2.0 * fw{c} - 1.0) * open * rhoc * pup{c} / sqrt(tup{c}) * psi{c} }}
    vol{c} {{ {volume} }}
    vrate{c} {{ {rate} }}
    heat{c} {{ alpha * ({surface}) * (twall - t{c}) }}
    prate{c} {{ (k * rg * tup{c} * w{c} - k * p{c} * vrate{c} + (k - 1.0) * heat{c}) / vol{c} }}
    trate{c} {{ t{c} * (prate{c} / p{c} + vrate{c} / vol{c} - rg * t{c} * w{c} / (p{c} * vol{c})) }}
"""


def code() -> str:
    """Return the DiffSL model; inputs are the ports, the opening and the initial (scaled) state."""
    starts = [f"y{i}" for i in range(7)]
    inputs = ", ".join(f"{name} = 1.0" for name in (*PORTS, *starts))
    constants = "\n".join(f"    {n} {{ {v!r} }}" for n, v in zip(NAMES, PARAMETERS, strict=True))
    states = ", ".join(
        f"s{name} = {start}" for name, start in zip(("x", "v", "pa", "ta", "pb", "tb", "z"), starts, strict=True)
    )
    sx, sv, sp, st, _, _, sz = (repr(float(s)) for s in SCALE)
    area, barrel = repr(0.25 * math.pi * PARAMETERS[6] ** 2), repr(math.pi * PARAMETERS[6])
    return f"""
    in_i {{ {inputs} }}
{constants}
    area {{ {area} }}
    barrel {{ {barrel} }}
    u_i {{ {states} }}
    x {{ {sx} * sx }}
    v {{ {sv} * sv }}
    pa {{ {sp} * spa }}
    ta {{ {st} * sta }}
    pb {{ {sp} * spb }}
    tb {{ {st} * stb }}
    z {{ {sz} * sz }}
    {_chamber("a", "dead + area * x", "area * v", "barrel * x + 2.0 * area")}
    {_chamber("b", "dead + area * (stroke - x)", "-area * v", "barrel * (stroke - x) + 2.0 * area")}
    g {{ fc + (fs - fc) * exp(-(v / vs) * (v / vs)) }}
    zrate {{ v - sig * abs(v) / g * z }}
    friction {{ sig * z + sigd * zrate + fv * v }}
    dl {{ max(0.0, -x) }}
    dr {{ max(0.0, x - stroke) }}
    fl {{ max(0.0, kstop * dl - dstop * min(dl / dsat, 1.0) * v) }}
    fr {{ max(0.0, kstop * dr + dstop * min(dr / dsat, 1.0) * v) }}
    F_i {{
        v / {sx},
        (area * (pa - pb) - friction - fr + fl) / mass / {sv},
        pratea / {sp},
        tratea / {st},
        prateb / {sp},
        trateb / {st},
        zrate / {sz},
    }}
    """


def _inputs(u: float, scaled: np.ndarray) -> np.ndarray:
    supply, exhaust = PARAMETERS[2:4], PARAMETERS[4:6]
    ports = (*supply, *exhaust) if u >= 0.0 else (*exhaust, *supply)
    return np.array([*ports, abs(u), *scaled])


class Diffsol(Peer):
    """pydiffsol BDF; the code is compiled once, outside the timing."""

    name = "pydiffsol BDF (LLVM)"

    def __init__(self) -> None:
        self.ode = pydiffsol.Ode(code(), matrix_type=pydiffsol.nalgebra_dense, ode_solver=pydiffsol.bdf)

    def segment(self, y: np.ndarray, u: float, times: np.ndarray, tol: float) -> np.ndarray:
        """Return the states at `times` under the command `u`, starting with `y`."""
        self.ode.rtol = self.ode.atol = tol
        if len(times) == 2:
            return (self.ode.solve_dense(_inputs(u, y / SCALE), times[1:] - times[0]).ys * SCALE[:, None]).T
        return (self._scaled(y / SCALE, u, times) * SCALE[:, None]).T

    def bare(self, case: Case, tol: float) -> object:
        """Solve a case of command steps for the scaled states, one array a step; a controller needs the states."""
        if case.servo is not None:
            return self.solve(case, tol)
        self.ode.rtol = self.ode.atol = tol
        y, parts = case.initial / SCALE, []
        for u, times in case.segments:
            parts.append(self._scaled(y, u, times))
            y = parts[-1][:, -1]
        return parts

    def _scaled(self, y: np.ndarray, u: float, times: np.ndarray) -> np.ndarray:
        return self.ode.solve_dense(_inputs(u, y), times - times[0]).ys
