"""Prediction with the values that `apply` writes: fitted values, and start values of undetermined parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError, warn
from pneudrive.identify.dynamic.problem import Iterate
from pneudrive.numbers import plain
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from pneudrive.identify.dynamic.uncertainty import Solved

    Array = NDArray[np.float64]

#: Start of the note.
KEPT = "apply keeps the start value of "


def applied_note(solved: Solved, kept: Collection[str]) -> list[str]:
    """Return a note that compares the error of a free run with the applied values and with the fitted ones.

    The start of each recording and the errors of its sensors are those of the fit. The fit has no such note if no
    values were kept, or none was determined.

    Parameters
    ----------
    solved : Solved
        End of the search.
    kept : collection of str
        Undetermined values, which keep their start value.
    """
    problem = solved.problem
    places = [i for i, p in enumerate(problem.parameters) if p.name in kept]
    if not places or len(places) == problem.drive_size:
        return []
    fitted = problem.values(solved.point.eta)
    mixed = fitted.copy()
    mixed[places] = [problem.parameters[i].value for i in places]
    before, after = _free_run(solved, fitted), _free_run(solved, mixed)
    words = f"{KEPT}{', '.join(problem.parameters[i].name for i in places)} in addition to the fitted values: "
    if not after:
        return [f"{words}this mixture cannot be simulated"]
    shown = {c.name: readable(c.unit) for e in problem.experiments for c in e.channels}
    errors = []
    for name, rms in after.items():
        factor, unit = shown[name]
        fitted_words = f" (fitted values: {plain(before[name] / factor)} {unit})" if before else ""
        errors.append(f"{plain(rms / factor)} {unit} in {name}{fitted_words}")
    return [f"{words}the error of a free run of this mixture is {', '.join(errors)}, rms"]


def warn_of_mixture(notes: Sequence[str], kept: Collection[str], *, same_start: bool) -> None:
    """Warn of start values that are combined with fitted ones; include the error of this mixture if it is known.

    Parameters
    ----------
    notes : sequence of str
        Notes of the fit.
    kept : collection of str
        Undetermined values.
    same_start : bool
        Whether the kept values are those of the start of the search.
    """
    note = next((note for note in notes if note.startswith(KEPT)), None)
    if note is not None and same_start:
        warn(note)
    elif kept:
        warn(
            f"the recordings do not determine {', '.join(sorted(kept))}, so that the fitted values are combined with "
            "values outside the fit: run `pneudrive validate` on the result"
        )


def _free_run(solved: Solved, values: Array) -> dict[str, float]:
    """Return the root mean square error of each channel of free runs, SI; empty if a run fails."""
    problem, whole = solved.problem, np.zeros(1, dtype=np.int64)
    shooters = [experiment.shooter for experiment in problem.experiments]
    point = Iterate(problem.transforms.internal(values), [states[:1] for states in solved.point.states])
    try:
        for experiment in problem.experiments:
            experiment.shooter = experiment.shooter.with_starts(whole)
        shots = problem.run(point, derivatives=False)
        if isinstance(shots, str):
            return {}
        return problem.rms([
            problem.measure(i, point.eta, slice(None), s.outputs, np.zeros((*s.outputs.shape, problem.size)))[0]
            for i, s in enumerate(shots)
        ])  # fmt: skip
    except FitError:  # the core rejects such a drive
        return {}
    finally:
        for experiment, shooter in zip(problem.experiments, shooters, strict=True):
            experiment.shooter = shooter
