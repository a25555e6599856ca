"""Sensitivity of a drive's outputs to its numbers: Sobol indices and Morris' elementary effects.

Both methods use points in the unit cube, which the distributions convert to values of the numbers.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import qmc

from pneudrive.ensemble.design import HALF_CELL, Rows, design_of
from pneudrive.ensemble.many import EnsembleStudy, Executor, Members, results, study_of
from pneudrive.errors import CommandError, nearest, warn
from pneudrive.lazy_names import upper
from pneudrive.progress import Flag, Progress, Watch

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.arrays import Array
    from pneudrive.describe import Drive, Initial
    from pneudrive.ensemble.outputs import Output
    from pneudrive.simulation import command as commands

#: Base points of Sobol indices, trajectories of Morris' method, by default.
BASE_POINTS, TRAJECTORIES = 1024, 50
METHODS = ("sobol", "morris")
LEVELS = 4  # of the grid of Morris' method
#: Resamples of the bootstrap, and how many are evaluated together.
RESAMPLES, TOGETHER = 1000, 50
#: Variables of the result -> long name; those that are fractions have no unit, the others that of the output.
LONG_NAMES = {
    "first": "fraction of the variance that the number causes alone",
    "total": "fraction of the variance that the number causes, with its interactions",
    "mu_star": "mean of the absolute elementary effects",
    "mu": "mean of the elementary effects",
    "sigma": "standard deviation of the elementary effects",
    "used": "number of points used: those with finite values",
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
    progress: Progress | None = None,
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
    points, indices = (sobol_points, sobol_indices) if method == "sobol" else (morris_points, elementary_effects)
    cube = points(count, len(names), seed)
    study = replace(study, rows=Rows.table(names, shape.values(cube)))
    study.plans.check(study.rows.size)
    values = _values(study, executor, Watch(progress, cancel))
    return _labelled(study, indices(cube, values, confidence=confidence, seed=seed), about)


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


def _labelled(study: EnsembleStudy, found: Mapping[str, NDArray[Any]], about: Mapping[str, Any]) -> xr.Dataset:
    import xarray as xr

    upper("Pneu")  # registers `dataset.pneu`
    unit = {"units": "1" if "first" in found else "that of the output"}
    dimensions, variables = ("end", "number", "output"), dict[str, Any]()
    for name, x in found.items():
        long_name = LONG_NAMES.get(name) or f"interval of the {LONG_NAMES[name.removesuffix('_interval')]}"
        variables[name] = (
            dimensions[-x.ndim :],
            x,
            {"long_name": long_name, **({"units": "1"} if x.ndim == 1 else unit)},
        )
    coordinates = {
        "number": ("number", list(study.rows.names), {"long_name": "number of the drive"}),
        "output": ("output", [output.name for output in study.outputs], {"long_name": "output"}),
        "unit": ("output", [output.unit for output in study.outputs], {"long_name": "unit of the output"}),
        "end": ("end", ["lower", "upper"], {"long_name": "end of the interval"}),
    }
    drive = study.variation.drive
    citations = ["saltelli2010", "jansen1999"] if "first" in found else ["morris1991", "campolongo2007"]
    return xr.Dataset(variables, coordinates, {"title": drive.name, **about, "citations": citations})


def sobol_points(n: int, d: int, seed: int) -> Array:
    """Return the points at which Sobol indices are estimated, shape (n (d + 2), d), within the unit cube.

    The points are n points A, n points B, and for each argument the points A with this argument from B [saltelli2010].
    A and B are
    halves of one scrambled Sobol sequence in 2 d dimensions; n should be a power of 2.
    """
    both = qmc.Sobol(2 * d, scramble=True, rng=seed).random_base2(int(np.ceil(np.log2(n))))[:n] + HALF_CELL
    a, b = both[:, :d], both[:, d:]
    mixed = np.repeat(a[None], d, axis=0)
    for k in range(d):
        mixed[k, :, k] = b[:, k]
    return np.concatenate([a, b, mixed.reshape(-1, d)])


def sobol_indices(
    points: Array, values: Array, *, confidence: float = 0.95, resamples: int = RESAMPLES, seed: int = 0
) -> dict[str, NDArray[Any]]:
    """Estimate Sobol indices of first and total order.

    First order by Saltelli's estimator of 2010, total by Jansen's: ``S_i = mean(f_B (f_ABi - f_A)) / V`` and ``T_i =
    mean((f_A - f_ABi)^2) / (2 V)``. V is the variance of f over A and B, and f is taken minus its mean
    [saltelli2010,jansen1999].
    For each output, a base point is left out if one of its d + 2 values is not finite.

    Parameters
    ----------
    points : ndarray, shape (n (d + 2), d)
        Points from `sobol_points`.
    values : ndarray, shape (n (d + 2), s)
        Values of s outputs there.
    confidence : float
        Nominal coverage probability of an interval, from a percentile bootstrap over base points.
    resamples : int
        Number of bootstrap samples, rounded up to a multiple of 50.
    seed : int
        Random seed of the bootstrap.

    Returns
    -------
    dict
        ``first`` and ``total``, shape (d, s), with ``first_interval`` and ``total_interval``, shape (2, d, s).
        ``used``: base points of each output. NaN for an output that does not vary, or with less than 2 base points.
    """
    d, s = points.shape[1], values.shape[1]
    each = np.asarray(values, dtype=np.float64).reshape(d + 2, -1, s)
    found = np.full((2, d, s), np.nan)
    ends = np.full((2, 2, d, s), np.nan)
    used = np.zeros(s, dtype=np.int64)
    for k in range(s):
        f = each[:, np.isfinite(each[..., k]).all(axis=0), k]
        used[k] = m = f.shape[1]
        if m < 2 or np.ptp(f[:2]) == 0.0:
            continue
        f = f - f[:2].mean()
        found[..., k] = _indices(f, np.full((1, m), 1.0 / m))[0]
        rng = np.random.default_rng([seed, k])
        weights = (rng.multinomial(m, np.full(m, 1.0 / m), size=TOGETHER) / m for _ in range(0, resamples, TOGETHER))
        again = np.concatenate([_indices(f, weight) for weight in weights])
        ends[..., k] = np.nanquantile(again, _tails(confidence), axis=0)
    return {
        "first": found[0],
        "total": found[1],
        "first_interval": ends[:, 0],
        "total_interval": ends[:, 1],
        "used": used,
    }


def _tails(confidence: float) -> list[float]:
    """Return the probabilities at both ends of an interval."""
    return [0.5 * (1.0 - confidence), 0.5 * (1.0 + confidence)]


def _indices(f: Array, weights: Array) -> Array:
    """Return first and total order of one output, shape (r, 2, d), for r weightings of its base points.

    Parameters
    ----------
    f : ndarray, shape (d + 2, m)
        Values at A, B, and A with each argument of B.
    weights : ndarray, shape (r, m)
        Weights of the base points. Each row adds up to 1.
    """
    a, b, mixed = f[0], f[1], f[2:]
    mean, moved = weights @ (0.5 * (a + b)), mixed - a
    variance = weights @ (0.5 * (a * a + b * b)) - mean * mean
    first = weights @ (b * moved).T - mean[:, None] * (weights @ moved.T)
    with np.errstate(invalid="ignore", divide="ignore"):  # a resample that is all one point
        return np.stack([first, 0.5 * (weights @ (moved * moved).T)], axis=1) / variance[:, None, None]


def morris_points(trajectories: int, d: int, seed: int) -> Array:
    """Return Morris' trajectories through a grid in the unit cube, shape (trajectories (d + 1), d) [morris1991].

    Each trajectory starts at a random point of a grid of four levels. It moves one argument after the other, in
    random order and by two levels. The grid uses the centres of cells, so no point is on a
    face of the cube, where the value of a normal distribution would be infinite.
    """
    rng = np.random.default_rng(seed)
    step = LEVELS // 2
    out = np.empty((trajectories, d + 1, d))
    for path in out:
        at = rng.integers(LEVELS, size=d)
        path[0] = at
        for k, argument in enumerate(rng.permutation(d), start=1):
            at[argument] += step if at[argument] < step else -step
            path[k] = at
    return (out.reshape(-1, d) + 0.5) / LEVELS


def elementary_effects(
    points: Array, values: Array, *, confidence: float = 0.95, resamples: int = RESAMPLES, seed: int = 0
) -> dict[str, NDArray[Any]]:
    """Estimate Morris' measures [morris1991], with the mean of absolute effects [campolongo2007].

    Parameters
    ----------
    points : ndarray, shape (trajectories (d + 1), d)
        Points from `morris_points`.
    values : ndarray, shape (trajectories (d + 1), s)
        Values of s outputs there; a trajectory with one that is not finite is left out, output by output.
    confidence, resamples, seed
        As for `sobol_indices`.

    Returns
    -------
    dict
        ``mu_star``, ``mu`` and ``sigma``: mean of the absolute elementary effects, their mean and standard deviation,
        shape (d, s), in units of the output over the unit range of the argument. ``mu_star_interval``, shape (2, d, s).
        ``used``: trajectories of each output. NaN for an output with less than 2 trajectories.
    """
    d, s = points.shape[1], values.shape[1]
    moves = np.diff(points.reshape(-1, d + 1, d), axis=1)
    order = np.abs(moves).argmax(axis=2)[..., None]
    effects = np.empty((len(moves), d, s))
    by_step = np.diff(values.reshape(-1, d + 1, s), axis=1) / np.take_along_axis(moves, order, axis=2)
    np.put_along_axis(effects, order, by_step, axis=1)
    complete = np.isfinite(effects.sum(axis=1))
    found = {name: np.full((d, s), np.nan) for name in ("mu_star", "mu", "sigma")}
    interval = np.full((2, d, s), np.nan)
    for k in range(s):
        own = effects[complete[:, k], :, k]
        if len(own) < 2:
            continue
        size = np.abs(own)
        for measure, x in zip(
            found.values(), (size.mean(axis=0), own.mean(axis=0), own.std(axis=0, ddof=1)), strict=True
        ):
            measure[:, k] = x
        picks = np.random.default_rng([seed, k]).integers(len(own), size=(resamples, len(own)))
        interval[..., k] = np.quantile(size[picks].mean(axis=1), _tails(confidence), axis=0)
    return {**found, "mu_star_interval": interval, "used": complete.sum(axis=0)}
