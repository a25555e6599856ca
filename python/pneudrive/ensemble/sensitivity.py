"""Sensitivity of a drive's outputs to its parameters: Sobol indices.

The points are in the unit cube. Distributions map them to values of the parameters.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import bootstrap, qmc

from pneudrive.ensemble.design import HALF_CELL, Rows, design_of
from pneudrive.ensemble.many import Executor, run_study, study_of
from pneudrive.errors import CommandError, warn
from pneudrive.lazy_names import upper
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.simulation.simulate import whole_number

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.arrays import Array, Bools, Keyed
    from pneudrive.describe import Drive
    from pneudrive.describe.tables.parts import Initial
    from pneudrive.ensemble.outputs import Output
    from pneudrive.simulation import command as commands

#: Default number of base points.
BASE_POINTS = 1024
#: Nominal coverage of the bootstrap intervals.
CONFIDENCE = 0.95
#: Number of bootstrap resamples, and number of resamples that are evaluated together.
RESAMPLES, TOGETHER = 1000, 50
#: Variables of the result -> long name.
LONG_NAMES = {
    "first": "fraction of the variance that the number causes alone",
    "total": "fraction of the variance that the number causes, with its interactions",
    "used": "number of points with finite values",
}


def sensitivity(
    drive: Drive,
    command: commands.Command,
    duration: str | float,
    *,
    vary: Keyed,
    outputs: Sequence[str | Output] | None = None,
    n: int = BASE_POINTS,
    initial: Initial | Mapping[str, object] | str | None = None,
    rtol: float = 1e-6,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Estimate how much the outputs of a drive depend on each of its parameters.

    A Sobol index is the fraction of an output's variance due to one parameter alone (first order), or including its
    interactions (total) [saltelli2010,jansen1999]. The estimate needs n (d + 2) members for d parameters.

    Parameters
    ----------
    drive, command, duration, outputs, initial, rtol, executor, progress, cancel
        As for `pneudrive.simulate_many`. Each output must be a single number, not samples.
    vary : mapping
        Name -> distribution, ``"normal(30 N, 10 %)"``. The numbers vary independently.
    n : int
        Number of base points, preferably a power of 2. For a screening of many numbers, 32 can suffice.
    seed : int
        Random seed of the design and of the bootstrap.

    Returns
    -------
    xarray.Dataset
        Dimensions number and output. Variables ``first`` and ``total``, and their bounds ``first_interval`` and
        ``total_interval`` (dimension end: lower, upper). ``used`` counts, for each output, the base points without
        missing values. Indices of a constant output are NaN.

    Warns
    -----
    PneudriveWarning
        Members failed, or an output has no value for some members. The base points of these members are left out.

    Raises
    ------
    CommandError
        As for `pneudrive.simulate_many`, or a number has no distribution.

    Examples
    --------
    >>> import pneudrive as pn
    >>> drive = pn.Drive.load("catalogue:parker-osp-p25-sy5000")
    >>> vary = {"load.mass": "uniform(1 kg, 5 kg)", "friction.viscous": "normal(40 N s/m, 10 %)"}
    >>> found = pn.sensitivity(drive, 1.0, "0.1 s", vary=vary, outputs=["max(velocity)"], n=64)
    >>> found.total.sel(output="max_velocity").idxmax().item()
    'load.mass'
    """
    import xarray as xr

    design = replace(design_of(vary), members=whole_number("n", n, 2))
    study = study_of(drive, command, duration, vary=design, outputs=outputs, initial=initial, rtol=rtol)
    rows = study.rows
    if rows.quantiles is None or design.correlation or design.fit is not None:
        rule = "one distribution for each number, without correlations"
        raise CommandError("vary is not valid for a sensitivity study", rule=rule, remedy='Write "normal(30 N, 10 %)".')
    sampled = [output.name for output in study.outputs if output.word == "samples"]
    if sampled:
        raise CommandError(f"outputs: {sampled[0]} is sampled", rule="each output is one number")
    about = {**study.about(), "vary": {key: rows.about[key] for key in ("distributions", "correlation")}}
    about |= {"n": n, "seed": seed, "confidence": CONFIDENCE}
    cube = sobol_points(n, len(rows.names), seed)
    study = replace(study, rows=Rows.table(rows.names, rows.quantiles(cube)))
    study.plans.check(study.rows.size)
    study.rows.check(study.variation)
    found = run_study(study, Watch(progress, cancel), executor)
    values = np.column_stack(found.values)
    lost = [one.name for one, column in zip(study.outputs, values.T, strict=True) if not np.isfinite(column).all()]
    if lost:
        members = f"{found.failed} of {study.rows.size} members failed; " if found.failed else ""
        warn(f"{members}some members have no {', '.join(lost)}: their points are left out")
    upper("Pneu")  # registers `dataset.pneu`
    dimensions = ("end", "number", "output")
    variables = {}
    for name, x in sobol_indices(cube, values, seed=seed).items():
        long_name = LONG_NAMES.get(name) or f"interval of the {LONG_NAMES[name.removesuffix('_interval')]}"
        variables[name] = (dimensions[-x.ndim :], x, {"long_name": long_name, "units": "1"})
    coordinates = {
        "number": ("number", list(study.rows.names), {"long_name": "number of the drive"}),
        "output": ("output", [output.name for output in study.outputs], {"long_name": "output"}),
        "unit": ("output", [output.unit for output in study.outputs], {"long_name": "unit of the output"}),
        "end": ("end", ["lower", "upper"], {"long_name": "end of the interval"}),
    }
    about |= {"title": drive.name, "citations": ["saltelli2010", "jansen1999"]}
    return xr.Dataset(variables, coordinates, about)


def sobol_points(n: int, d: int, seed: int) -> Array:
    """Return the points of the unit cube at which Sobol indices are estimated, shape (n (d + 2), d).

    The points are n points A, n points B, and, for each argument, the points A with this argument taken from B
    [saltelli2010].
    A and B are halves of one scrambled Sobol sequence in 2 d dimensions; n should be a power of 2.
    """
    sequence = qmc.Sobol(2 * d, scramble=True, rng=seed)
    power = int(np.ceil(np.log2(n)))
    both = sequence.random_base2(power)[:n] + HALF_CELL
    a, b = both[:, :d], both[:, d:]
    mixed = np.where(np.eye(d, dtype=bool)[:, None], b, a)
    return np.concatenate([a, b, mixed.reshape(-1, d)])


def sobol_indices(
    points: Array, values: Array, *, resamples: int = RESAMPLES, seed: int = 0
) -> dict[str, NDArray[Any]]:
    """Estimate Sobol indices of first and total order.

    For each output, a base point is left out if one of its d + 2 values is not finite.

    Parameters
    ----------
    points : ndarray, shape (n (d + 2), d)
        Points from `sobol_points`.
    values : ndarray, shape (n (d + 2), s)
        Values of s outputs at these points.
    resamples : int
        Number of bootstrap samples of the base points. The intervals are percentiles.
    seed : int
        Random seed of the bootstrap.

    Returns
    -------
    dict
        ``first`` and ``total``, shape (d, s), with ``first_interval`` and ``total_interval``, shape (2, d, s).
        ``used``: number of base points for each output. Indices are NaN if an output does not vary or has fewer than 2
        base points.
    """
    d, s = points.shape[1], values.shape[1]
    each = np.asarray(values, dtype=float).reshape(d + 2, -1, s)
    complete: Bools = np.asarray(np.isfinite(each).all(axis=0))
    indices = np.full((2, d, s), np.nan)
    ends = np.full((2, 2, d, s), np.nan)
    for k in range(s):
        f = each[:, complete[:, k], k]
        if f.shape[1] < 2 or np.ptp(f[:2]) == 0.0:
            continue
        indices[..., k] = _indices(f)
        again = bootstrap(
            [np.arange(f.shape[1])],
            lambda rows, axis, f=f: _indices(f[:, rows]),  # scipy requires the argument `axis`: the last axis
            n_resamples=resamples,
            batch=TOGETHER,
            method="percentile",
            rng=np.random.default_rng([seed, k]),
        ).bootstrap_distribution
        tails = [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)]
        ends[..., k] = np.nanquantile(again, tails, axis=-1)
    intervals = {"first_interval": ends[:, 0], "total_interval": ends[:, 1]}
    return {"first": indices[0], "total": indices[1], **intervals, "used": complete.sum(axis=0)}


def _indices(f: Array) -> Array:
    """Return the Sobol indices of first and total order of one output, shape (2, d, ...).

    The first order is Saltelli's estimator of 2010, ``S_i = mean(f_B (f_ABi - f_A)) / V``. The total is Jansen's, ``T_i
    = mean((f_A - f_ABi)^2) / (2 V)``. V is the variance of f over A and B. The mean of f is subtracted
    [saltelli2010,jansen1999]. `scipy.stats.sobol_indices` has the same estimators, but requires n to be a power of 2.

    Parameters
    ----------
    f : ndarray, shape (d + 2, ..., m)
        Values at A, at B, and at A with each argument in turn taken from B.
    """
    b = f[1] - f[:2].mean(axis=(0, -1))[..., None]
    moved = f[2:] - f[0]
    with np.errstate(invalid="ignore", divide="ignore"):  # a resample can consist of a single point
        first, total = np.mean(b * moved, axis=-1), 0.5 * np.mean(moved**2, axis=-1)
        return np.stack([first, total]) / f[:2].var(axis=(0, -1))
