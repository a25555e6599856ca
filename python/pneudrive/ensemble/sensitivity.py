"""Sensitivity of a drive's outputs to its numbers: Sobol indices and Morris' elementary effects."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.ensemble.design import design_of
from pneudrive.ensemble.engine import Rows
from pneudrive.ensemble.many import study_of
from pneudrive.ensemble.store import results
from pneudrive.ensemble.study import Members
from pneudrive.errors import CommandError, nearest, warn
from pneudrive.estimate.sensitivity import elementary_effects, morris_points, sobol_indices, sobol_points
from pneudrive.lazy_names import upper
from pneudrive.progress import Watch

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.describe.tables.parts import Initial
    from pneudrive.ensemble.outputs import Output
    from pneudrive.ensemble.store import Executor
    from pneudrive.ensemble.study import EnsembleStudy
    from pneudrive.progress import Flag
    from pneudrive.simulation import command as commands

    Array = NDArray[np.float64]

#: Base points of Sobol indices, trajectories of Morris' method, by default.
BASE_POINTS, TRAJECTORIES = 1024, 50
METHODS = ("sobol", "morris")
#: Variables of the result -> long name, by method; those that are shares have no unit, the others that of the output.
SOBOL = {
    "first": "fraction of the variance that the number causes alone",
    "total": "fraction of the variance that the number causes, with its interactions",
}
MORRIS = {
    "mu_star": "mean of the absolute elementary effects",
    "mu": "mean of the elementary effects",
    "sigma": "standard deviation of the elementary effects",
}


def sensitivity(
    drive: Drive,
    command: commands.Command,
    duration: str | float,
    *,
    vary: Mapping[str, Any],
    outputs: Sequence[str | Output] | None = None,
    method: str = "sobol",
    n: int | None = None,
    initial: Initial | Mapping[str, object] | str | None = None,
    rtol: float = 1e-6,
    seed: int = 0,
    confidence: float = 0.95,
    executor: Executor | None = None,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Find the numbers of a drive that its outputs depend on.

    ``"sobol"`` gives the fraction of each output's variance that each number causes alone (first order) and with its
    interactions (total) [saltelli2010,jansen1999]. It runs n (d + 2) members for d numbers. ``"morris"`` screens many
    numbers with few runs, n (d + 1). It gives means and standard deviation of elementary effects
    [morris1991,campolongo2007].

    Parameters
    ----------
    drive, command, duration, outputs, initial, rtol, executor, progress, cancel
        As for `pneudrive.simulate_many`. Outputs that are samples do not have a sensitivity.
    vary : mapping
        Name -> distribution, ``"normal(30 N, 10 %)"``. The numbers vary independently.
    method : str
        ``"sobol"`` or ``"morris"``.
    n : int, optional
        Base points (by default 1024; best a power of 2), or trajectories (50).
    seed : int
        Random seed of the design and of the bootstrap.
    confidence : float
        Nominal coverage of the bootstrap intervals.

    Returns
    -------
    xarray.Dataset
        Dimensions number and output. They contain ``first``, ``total``, with ``first_interval`` and ``total_interval``
        (dimension end: lower, upper). With the method of Morris, they contain ``mu_star`` with ``mu_star_interval``,
        ``mu`` and ``sigma``. Their unit is that of the output (coordinate ``unit``) over the whole distribution of the
        number. ``used`` counts the base points or trajectories of each output without missing values. NaN for an output
        that does not vary.

    Warns
    -----
    PneudriveWarning
        Members failed, or an output has no value for some members. Their base points or trajectories are left out.

    Raises
    ------
    CommandError
        As `pneudrive.simulate_many`, or an unknown method, or a number without a distribution.

    Examples
    --------
    >>> import pneudrive as pn
    >>> drive = pn.Drive.load("catalogue:parker-osp-p25-sy5000")
    >>> vary = {"load.mass": "uniform(1 kg, 5 kg)", "friction.viscous": "normal(40 N s/m, 10 %)"}
    >>> found = pn.sensitivity(drive, 1.0, "0.1 s", vary=vary, outputs=["max(velocity)"], n=64)
    >>> found.total.sel(output="max_velocity").idxmax().item()
    'load.mass'
    """
    if method not in METHODS:
        raise CommandError(f'there is no method "{method}"', remedy=nearest(method, METHODS))
    if not 0.0 < confidence < 1.0:
        raise CommandError(f"confidence = {confidence}", rule="between 0 and 1")
    count = n if n is not None else BASE_POINTS if method == "sobol" else TRAJECTORIES
    if isinstance(count, bool) or count < 2:
        raise CommandError(f"n = {count} is too few", rule="at least 2")
    design = replace(design_of(vary), members=count)
    study = study_of(drive, command, duration, vary=design, outputs=outputs, initial=initial, rtol=rtol)
    shape = study.rows.shape
    if shape is None or design.correlation or design.fit is not None:
        rule = "a distribution of each number, all independent"
        raise CommandError("vary does not fit sensitivity", rule=rule, remedy='For instance "normal(30 N, 10 %)".')
    sampled = [output.name for output in study.outputs if output.word == "samples"]
    if sampled:
        raise CommandError(f"outputs: {sampled[0]} is sampled", rule="sensitivities are of numbers")
    names, about = study.rows.names, {**study.about(), "vary": shape.about()}
    about |= {"method": method, "n": count, "seed": seed, "confidence": confidence}
    cube = sobol_points(count, len(names), seed) if method == "sobol" else morris_points(count, len(names), seed)
    study = replace(study, rows=Rows.table(names, shape.values(cube)))
    study.plans.check(study.rows.size)
    values = _values(study, executor, Watch(progress, cancel))
    if method == "sobol":
        shares = sobol_indices(values, len(names), confidence=confidence, seed=seed)
        found = {"first": shares.first, "total": shares.total}
        intervals, used = {"first": shares.first_interval, "total": shares.total_interval}, shares.rows
    else:
        effects = elementary_effects(cube, values, confidence=confidence, seed=seed)
        found = {"mu_star": effects.mu_star, "mu": effects.mu, "sigma": effects.sigma}
        intervals, used = {"mu_star": effects.mu_star_interval}, effects.trajectories
    return _labelled(study, found, intervals, used, about)


def _values(study: EnsembleStudy, executor: Executor | None, watch: Watch) -> Array:
    """Run all members and return their outputs, shape (members, outputs)."""
    study.variation.check(study.rows.take(0, study.rows.size))
    found = Members.of(study, results(study, None, None, executor, watch))
    values = np.column_stack(found.values)
    lost = [one.name for one, column in zip(study.outputs, values.T, strict=True) if not np.isfinite(column).all()]
    if lost:
        members = f"{found.failed} of {study.rows.size} members failed; " if found.failed else ""
        warn(f"{members}some members have no {', '.join(lost)}: their points are left out")
    return values


def _labelled(
    study: EnsembleStudy,
    found: Mapping[str, Array],
    intervals: Mapping[str, Array],
    used: NDArray[np.int64],
    about: Mapping[str, Any],
) -> xr.Dataset:
    import xarray as xr

    upper("Pneu")  # registers `dataset.pneu`
    said = SOBOL | MORRIS
    share = {"units": "1"} if "first" in found else {"units": "that of the output"}
    plane = ("number", "output")
    variables: dict[str, Any] = {name: (plane, x, {"long_name": said[name], **share}) for name, x in found.items()}
    for name, ends in intervals.items():
        long_name = f"interval of the {said[name]}"
        variables[f"{name}_interval"] = (("end", *plane), ends, {"long_name": long_name, **share})
    variables["used"] = ("output", used, {"long_name": "number of points used: those with finite values", "units": "1"})
    coordinates = {
        "number": ("number", list(study.rows.names), {"long_name": "number of the drive"}),
        "output": ("output", [output.name for output in study.outputs], {"long_name": "output"}),
        "unit": ("output", [output.unit for output in study.outputs], {"long_name": "unit of the output"}),
        "end": ("end", ["lower", "upper"], {"long_name": "end of the interval"}),
    }
    drive = study.variation.drive
    citations = ["saltelli2010", "jansen1999"] if "first" in found else ["morris1991", "campolongo2007"]
    return xr.Dataset(variables, coordinates, {"title": drive.name, **about, "citations": citations})
