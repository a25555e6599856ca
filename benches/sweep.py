"""Tolerance that each solver needs, and its time: interleaved, least and median of rounds."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benches.problem import DEFAULT, GRID, Case, meets

SHORTEST_S = 2e-3  # a faster call is repeated until it has taken this long, so that the clock does not matter

WARMED_BELOW_S = 0.1  # such a call is made once untimed before it is timed


@dataclass
class Entry:
    """One solver on one case."""

    solver: str
    case: Case
    solve: Callable[[Case, float], np.ndarray]  # pressure and temperature states, for the error
    bare: Callable[[Case, float], Any]  # the same solution as the solver has it, for the time
    errors: dict[float, tuple[float, float]] = field(default_factory=dict)
    failures: dict[float, str] = field(default_factory=dict)
    seconds: dict[float, list[float]] = field(default_factory=dict)

    def run_sweep(self, grid: Sequence[float] = GRID) -> None:
        """Measure the error at every tolerance of the grid; a failure counts as an infinite error."""
        for tol in grid:
            self.errors[tol] = self._error_at(tol)

    def _error_at(self, tol: float) -> tuple[float, float]:
        try:
            return self.case.errors(self.solve(self.case, tol))
        except Exception as error:  # what a foreign solver raises is not known: it is a row of the table
            self.failures[tol] = f"{type(error).__name__}: {error}"
            return math.inf, math.inf

    @property
    def loosest(self) -> float | None:
        """Loosest tolerance at which this and every tighter one meet both bounds."""
        found = None
        for tol in sorted(self.errors):
            if not meets(self.errors[tol]):
                break
            found = tol
        return found

    def timed(self) -> list[float]:
        """Return the tolerances to time: the loosest that suffices, and the default."""
        return sorted({t for t in (self.loosest, DEFAULT) if t is not None and math.isfinite(self.errors[t][0])})

    def milliseconds(self, tol: float | None) -> float | None:
        """Median processor time of one solution, ms."""
        return None if tol is None or tol not in self.seconds else 1e3 * statistics.median(self.seconds[tol])

    def as_json(self) -> dict[str, Any]:
        """Return what `results.json` keeps."""

        def rounded(value: float) -> float | None:
            return float(f"{value:.3g}") if math.isfinite(value) else None

        return {
            "solver": self.solver,
            "case": self.case.name,
            "loosest_tolerance": self.loosest,
            "milliseconds": {f"{t:g}": float(f"{1e3 * statistics.median(s):.4g}") for t, s in self.seconds.items()},
            "least_milliseconds": {f"{t:g}": float(f"{1e3 * min(s):.4g}") for t, s in self.seconds.items()},
            "errors_um_and_relative": {f"{t:g}": [rounded(e) for e in pair] for t, pair in self.errors.items()},
            "failures": {f"{t:g}": text for t, text in self.failures.items()},
        }


def once(solve: Callable[[], Any]) -> float:
    """Processor time of one call in seconds, all threads. Short calls are repeated and averaged.

    On a quiet machine it equals the wall time. On a busy machine it still belongs to the solver only.
    """
    calls, started = 0, time.process_time()
    while True:
        solve()
        calls += 1
        elapsed = time.process_time() - started
        if elapsed >= SHORTEST_S:
            return elapsed / calls


def interleave(entries: Sequence[Entry], rounds: int) -> None:
    """Time every entry once a round, so that a disturbance affects all entries equally."""
    for _ in range(rounds):
        for entry in entries:
            for tol in entry.timed():
                if min(entry.seconds.get(tol, [0.0])) < WARMED_BELOW_S:
                    entry.bare(entry.case, tol)  # a foreign solver has just emptied the cache
                entry.seconds.setdefault(tol, []).append(once(lambda e=entry, t=tol: e.bare(e.case, t)))
