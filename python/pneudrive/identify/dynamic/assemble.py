"""Result of a dynamic identification from the end of its search: values, intervals, notes, statistics."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import __version__
from pneudrive.estimate.estimates import student
from pneudrive.estimate.transforms import intervals as intervals_at
from pneudrive.free.parameters import Parameter, numbers_of
from pneudrive.identify.determined import SIMULATED
from pneudrive.identify.dynamic.mixture import applied_note
from pneudrive.identify.dynamic.model_error import model_errors
from pneudrive.identify.dynamic.result import DriveFit, Series, fit_hash
from pneudrive.identify.dynamic.uncertainty import profile
from pneudrive.identify.dynamic.undetermined import LARGEST_REACH, statements
from pneudrive.numbers import plain
from pneudrive.units import readable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.identify.dynamic.problem import FitProblem
    from pneudrive.identify.dynamic.search import Watcher
    from pneudrive.identify.dynamic.solved import Attempt, SearchOptions
    from pneudrive.identify.dynamic.uncertainty import Solved
    from pneudrive.signals.drive_recording import DriveRecording

    Array = NDArray[np.float64]

#: Correlation of residuals, in samples, above which there is a note, unless their variance is only that of the solver.
CORRELATED, SOLVER_SHARE = 10.0, 0.1
#: Fit, %, below which the error is not one of parameters: worse than the mean of the record.
SENSELESS_PERCENT = 0.0


def assembled(
    drive: Drive,
    parameters: list[Parameter],
    records: list[DriveRecording],
    attempt: Attempt,
    options: SearchOptions,
    watcher: Watcher,
) -> DriveFit:
    """Return the fit of the best search."""
    solved = attempt.solved
    problem, point, found = solved.problem, solved.point, solved.information
    values = problem.values(point.eta)
    names = problem.names
    by_coordinate = problem.transforms.jacobian(point.eta)
    covariance = by_coordinate @ found.covariance(problem) @ by_coordinate.T
    reach = student(solved.freedom)
    every = [*parameters, *problem.sensors]
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    lower = [p.lower if isinstance(p, Parameter) else -np.inf for p in every]
    low, high = intervals_at(values, reach * spread, lower, [p.upper for p in every])
    sizes = np.array([max(abs(v), s) for v, s in zip(values, _sizes(parameters, problem), strict=True)])
    for k, p in enumerate(parameters):  # next to nothing: no share of itself, but the data exclude the start value
        end, is_wide = values[k] + reach * spread[k], high[k] - values[k] > LARGEST_REACH * sizes[k]
        if np.isfinite(p.lower) and is_wide and end < LARGEST_REACH * p.value:
            low[k], high[k], sizes[k] = max(p.lower, values[k] - reach * spread[k]), end, p.value
    intervals = {n: (float(a), float(b)) for n, a, b in zip(names, low, high, strict=True)}
    statistics = _statistics(problem, solved, watcher)
    fit = DriveFit(
        values=dict(zip(names[: problem.drive_size], values.tolist(), strict=False)),
        units={**{p.name: p.unit for p in parameters}, **{s.name: s.unit for s in problem.sensors}},
        sensors=dict(zip(names[problem.drive_size :], values[problem.drive_size :].tolist(), strict=True)),
        free=tuple(names),
        covariance=covariance,
        intervals=intervals,
        sources={n: tuple(r.name for r in records) for n in names[: problem.drive_size]},
        undetermined=(),
        notes=tuple(_notes(drive, options, attempt, statistics, records)),
        statistics=statistics,
        converged=attempt.converged,
        fits=not attempt.missed,
        model_errors=model_errors(drive, parameters, solved),
        provenance=_provenance(drive, records, attempt, options, parameters),
        start=drive,
        series=_series(problem, solved, records),
        solved=solved,
        profiler=partial(profile, solved),
    )
    lost = statements(names, values, sizes, intervals, fit.units, fit.correlation, found.weak)
    fit.provenance["fit_hash"] = fit_hash(fit.provenance, fit.values)
    notes = (*fit.notes, *applied_note(solved, {u.parameter for u in lost}))
    return replace(fit, undetermined=(*options.lost, *lost), notes=notes)


def _sizes(parameters: list[Parameter], problem: FitProblem) -> list[float]:
    return [p.size if np.isinf(p.lower) else 0.0 for p in parameters] + [s.size for s in problem.sensors]


def _notes(
    drive: Drive, options: SearchOptions, attempt: Attempt, statistics: dict[str, float], records: list[DriveRecording]
) -> list[str]:
    notes, solved = list(options.notes), attempt.solved
    problem = solved.problem
    if not attempt.converged:
        if not options.interrupted:
            blind = not any(c.name.startswith("pressure") for one in problem.experiments for c in one.channels)
            more = "; a position alone does not determine the gas: record the chamber pressures" if blind else ""
            notes.append(f"the search did not converge: check the residuals, or try other segments{more}")
        notes.append("there are no intervals, because they are valid only at the end of a search")
    elif not drive.is_plain:
        notes.append("intervals cover noise only: the model error of a drive that runs as its circuit is unknown")
    units = numbers_of(drive)
    moved = problem.experiments[0].shooter.family.derived_values(problem.values(solved.point.eta))
    notes += [
        f"{_written(name, value, units[name].unit)} is derived from free values, as the drive does not give it"
        for name, value in moved.items()
    ]
    coloured = [
        f"{problem.experiments[i].channels[c].name} of {records[i].name} ({tau:.0f} samples)"
        for (i, c), (variance, tau) in solved.information.inflation.items()
        if tau > CORRELATED and variance > SOLVER_SHARE
    ]
    if coloured and attempt.converged:
        notes.append(f"residuals are correlated over time: {', '.join(coloured)}; intervals are widened for it")
    if attempt.missed:
        notes += _misfit(attempt, statistics)
    if any(r.synthetic for r in records):
        notes.append(SIMULATED)
    return notes


def _written(name: str, si: float, unit: str) -> str:
    factor, shown = readable(unit)
    return f"{name} = {plain(si / factor, 4)} {shown}".strip()


def _misfit(attempt: Attempt, statistics: dict[str, float]) -> list[str]:
    """Return a note on channels that the model does not follow."""
    notes = []
    fits = {k: v for k, v in statistics.items() if k.startswith("fit_percent.")}
    worst = min(fits, key=lambda k: fits[k])
    if fits[worst] < SENSELESS_PERCENT:
        notes.append(
            f"the model does not follow the recording ({worst.removeprefix('fit_percent.')}: fit "
            f"{fits[worst]:.0f} %). Check for a reversed sign or swapped chambers: a command above "
            "0 fills chamber a, which moves the piston towards greater positions"
        )
    missed = ", ".join(f"{name} is off by {ratio:.2g} times its noise" for name, ratio in attempt.missed.items())
    notes.append(
        f"the model does not fit: {missed}. Values and intervals compensate for the error, and the "
        "true values may lie outside: apply the fit to the drive and run `pneudrive validate` for the causes"
    )
    return notes


def _statistics(problem: FitProblem, solved: Solved, watcher: Watcher) -> dict[str, float]:
    out = {
        "samples": float(sum(len(e.measured) for e in problem.experiments)),
        "iterations": float(watcher.count),
        "cost": solved.at.cost,
        "gap": solved.at.standing.gap,
    }
    for name, rms in problem.rms(solved.at.residuals).items():
        out[f"rms.{name}"] = rms
        own = [(e, i) for e in problem.experiments for i, c in enumerate(e.channels) if c.name == name]
        out[f"noise.{name}"] = float(np.sqrt(np.mean([e.noise[i] ** 2 for e, i in own])))
        power = np.mean([np.nanvar(e.measured[:, i]) for e, i in own])
        out[f"fit_percent.{name}"] = float(100.0 * (1.0 - rms / np.sqrt(power))) if power > 0.0 else np.nan
    return out


def _series(problem: FitProblem, solved: Solved, records: list[DriveRecording]) -> dict[str, dict[str, Series]]:
    out: dict[str, dict[str, Series]] = {}
    for experiment, residual, record in zip(problem.experiments, solved.at.residuals, records, strict=True):
        out[record.name] = {
            channel.name: Series(
                record.time_s,
                experiment.measured[:, c],
                experiment.measured[:, c] - residual[:, c] * experiment.noise[c],
            )
            for c, channel in enumerate(experiment.channels)
        }
    return out


def _provenance(
    drive: Drive, records: list[DriveRecording], attempt: Attempt, options: SearchOptions, parameters: list[Parameter]
) -> dict[str, Any]:
    return {
        "version": __version__,
        "method": "output error",
        "drive": drive.name,
        "description_hash": drive.description_hash,
        "recordings": [
            {"name": r.name, "sha256": r.sha256, "file": str(r.source or ""), "seconds": r.duration_s} for r in records
        ],
        "start": {p.name: p.value for p in parameters},
        "segment_s": attempt.segment_s if attempt.segment_s is not None else "one",
        "robust": options.robust,
        "rtol": options.rtol,
    }
