"""diffrax on JAX: Kvaerno's ESDIRK methods, compiled by XLA; many drives at once by `vmap`."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from benches.problem import SCALE, A, Case
from benches.solvers.base import Peer
from benches.solvers.branchless import derivative
from benches.solvers.rhs import PARAMETERS

jax.config.update("jax_enable_x64", True)
MAX_STEPS = 100_000
OPERATIONS = SimpleNamespace(sqrt=jnp.sqrt, exp=jnp.exp, where=jnp.where, minimum=jnp.minimum, maximum=jnp.maximum)


def _steps(case: Case, method: Any, at_samples: bool) -> Any:
    """Return ``f(parameters, tol) -> states``, over all command steps, at the samples or at the end."""

    def run(q: Any, tol: Any) -> Any:
        y, parts = jnp.asarray(case.initial), [jnp.asarray(case.initial)[None]]
        for u, times in case.segments:
            scale = jnp.asarray(SCALE)
            term = diffrax.ODETerm(lambda _t, s, _a, u=u: jnp.stack(derivative(OPERATIONS, s, u, q)))
            save = diffrax.SaveAt(ts=jnp.asarray(times)) if at_samples else diffrax.SaveAt(t1=True)
            control = diffrax.PIDController(rtol=tol, atol=tol * scale)
            found = diffrax.diffeqsolve(
                term,
                method(),
                times[0],
                times[-1],
                1e-5,
                y,
                saveat=save,
                stepsize_controller=control,
                max_steps=100_000,
            ).ys
            y = found[-1]
            parts.append(found[1:] if at_samples else found)
        return jnp.concatenate(parts) if at_samples else y

    return run


class Diffrax(Peer):
    """One of Kvaerno's methods; compilation is outside the timing."""

    slow = True  # compiled for each case anew: A and B

    def __init__(self, order: int) -> None:
        self.name = f"diffrax Kvaerno{order} (XLA)"
        self.method = {3: diffrax.Kvaerno3, 5: diffrax.Kvaerno5}[order]
        self.compiled: dict[str, Any] = {}

    def solve(self, case: Case, tol: float) -> np.ndarray:
        """Return the states of a case at its samples, shape (n, 7)."""
        if case.name not in self.compiled:
            self.compiled[case.name] = jax.jit(_steps(case, self.method, at_samples=True))
        return np.asarray(self.compiled[case.name](tuple(PARAMETERS), tol))

    bare = solve


def many(tol: float) -> Any:
    """Return a compiled function of parameters, shape (members, 25), that gives final states of case A."""
    run = _steps(A, diffrax.Kvaerno3, at_samples=False)
    return jax.jit(jax.vmap(lambda q: run(tuple(q), tol)))
