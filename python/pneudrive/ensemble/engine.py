"""Interface to the core, which simulates members and returns outputs. Only this module calls the core for ensembles."""

from __future__ import annotations

import os
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import CommandError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from pneudrive._core import Ensemble
    from pneudrive._core import Output as CoreOutput
    from pneudrive.arrays import Array
    from pneudrive.describe.system import System
    from pneudrive.ensemble.outputs import MemberPlans, Reduction
    from pneudrive.ensemble.variation import CoreMembers


#: Status of a member that was simulated to the end.
DONE = 0


def run(
    system: System,
    members: CoreMembers,
    plans: MemberPlans,
    rtol: float,
    kept: Sequence[Reduction],
    threads: int | None = None,
    look: Callable[[float], object] | None = None,
) -> tuple[list[Array], NDArray[np.uint8], dict[int, str]]:
    """Run members and return the requested outputs.

    Parameters
    ----------
    system : System
    members : CoreMembers
        n members.
    plans : MemberPlans
        Commands of these members.
    rtol : float
    kept : sequence of Reduction
        Reductions without user functions.
    threads : int, optional
        Default: all processors.
    look : callable, optional
        Called with the number of finished members. An exception ends the run.

    Returns
    -------
    list of ndarray
        An array for each reduction, shape (n,) or (n, samples); NaN if a member failed.
    ndarray of uint8, shape (n,)
        0 done, 1 the run failed, 2 the numbers are inconsistent.
    dict
        Index of a failed member -> reason.

    Raises
    ------
    CommandError
        The core cannot vary one of the numbers, or a value is out of bounds.
    """
    core, n, done = _ensemble(system, *members.paths), len(members.values), 0
    values: dict[int, Array] = {}
    status, reasons = np.zeros(n, np.uint8), {}

    def tell(count: float) -> None:
        assert look is not None
        look(done + count)

    for at, steps, durations in plans.alike():  # members whose commands change at the same times
        places = np.arange(n)[at]
        part = members if len(places) == n else members.at(places)
        starts = [part.starts[name] for name in core.start_names]
        rows = 1 if all(np.ndim(start) == 0 for start in starts) else len(places)
        request: Any = {
            "values": part.values,
            "plans": steps,
            "duration": durations,
            "initial": np.column_stack([np.broadcast_to(start, rows) for start in starts]),
            "contact_age_s": float(part.starts.get("contact_age_s", 0.0)),
            "rtol": rtol,
            "threads": threads or processors(),
        }
        rates: list[float | None] = [*sorted({one.rate_hz for one in kept if one.word == "samples"})] or [None]
        for rate in rates:  # the core samples at one rate in a run; unsampled outputs come with the first rate
            asked = [k for k, one in enumerate(kept) if (one.rate_hz if one.word == "samples" else rates[0]) == rate]
            try:
                outcome = core.run(
                    request | {"outputs": [_output(kept[k]) for k in asked]}, None if look is None else tell
                )
            except ValueError as error:
                raise CommandError(str(error)) from None
            except RuntimeError as error:
                raise SimulationError(str(error)) from None
            for k, value in zip(asked, outcome["outputs"], strict=True):
                values.setdefault(k, np.empty((n, *value.shape[1:])))[places] = value
            status[places] = outcome["status"]
            reasons |= {int(places[place]): why for place, why in outcome["reasons"].items()}
        done += len(places)
    return [values[k] for k in range(len(kept))], status, reasons


def processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@lru_cache(maxsize=8)
def _ensemble(system: System, *paths: str) -> Ensemble:
    """Return the core's ensemble of a system. It is created once and cached."""
    from pneudrive import _core

    try:
        return _core.Ensemble(system.json, list(paths), system.names)
    except ValueError as error:
        raise CommandError.of("ensemble.held", error=error) from None


def _output(one: Reduction) -> CoreOutput:
    """Return the output in the form that the core expects."""
    what: Any = one.word
    level = one.rate_hz if what == "samples" else one.level
    return {"column": one.columns[0], "what": what, "value": level, "above": one.above}
