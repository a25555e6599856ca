"""Friction over position: its pattern over the common range, trend and harmonics. Cycles are the repeats."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.autocorrelation import stderrs_of_means
from pneudrive.estimate.estimates import Estimate, mean_estimate, student
from pneudrive.estimate.mixed import MixedModel, RandomEffect
from pneudrive.estimate.moderate import moderate
from pneudrive.friction.campaign.effects.effect import PositionPattern, PositionWave
from pneudrive.friction.common_range import FREEDOM_PER_CYCLE
from pneudrive.friction.conditions import Condition

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.campaign.curves.points import Points

    Array = NDArray[np.float64]

#: Waves that fit 0.9 to 8 times into the range, which is shorter than the stroke; fewer are a trend.
MOST_WAVES = 4
TIMES = np.arange(0.9, 8.01, 0.1)
FINER = (0.02, 0.004, 0.001)
RESOLVED = 0.5  # least difference of the orders of two waves: nearer ones look alike over the range
#: Fall of chi-square by a wave (three parameters, some fifty places) that exceeds chance (p = 0.001).
CLEAR = 25.0
FEWEST_BINS = 16
FEWEST_CYCLES = 4
MOST_FITTED = 100  # cycles whose slopes are fitted one by one; if there are more, neighbours in speed are grouped
APART = 2.0  # least ratio of the slowest to the fastest cycle's time and force for a drift of the zero
COVERED = 0.9  # of the common bins: cycles that lack more are not used for trend and harmonics


def position_dependence(points: Points) -> tuple[PositionPattern, ...]:
    """Describe friction over position: for each mounting, seal and drive, then for conditions with enough cycles."""
    own = [(c.title, c, points.use & (points.condition == i)) for i, c in enumerate(points.conditions)]
    parts = {title: [one for one in own if one[0] == title] for title, _, _ in own}
    groups = [(title, None, np.any([one[2] for one in some], axis=0)) for title, some in parts.items()]
    groups += [one for some in parts.values() if len(some) > 1 for one in some]
    found = [_describe(points, *group) for group in groups]
    return tuple(one for one in found if one is not None)


def _describe(
    points: Points, title: str, condition: Condition | None, members: NDArray[np.bool_]
) -> PositionPattern | None:
    reduced = points.reduced
    rows = reduced.relative_n[members][:, reduced.common]
    position = reduced.position_m[reduced.common]
    enough = np.isfinite(rows).mean(axis=1) >= COVERED
    rows = rows[enough]
    if rows.shape[0] < FEWEST_CYCLES or position.size < FEWEST_BINS:
        return None
    slowness = 1.0 / (reduced.speed_m_s[members] * np.abs(reduced.friction_n[members]))[enough]
    rows = rows - _trend(position, rows, slowness, (), 1.0)[1] * slowness[:, None] * (position - position.mean())
    known = np.isfinite(rows)
    count = known.sum(axis=0)
    mean = np.where(known, rows, 0.0).sum(axis=0) / np.maximum(count, 1)
    deviation = np.sqrt((np.where(known, rows - mean, 0.0) ** 2).sum(axis=0) / np.maximum(count - 1, 1))
    half = np.array([student(n - 1) for n in count]) * deviation / np.sqrt(np.maximum(count, 1))
    width = float(position[1] - position[0])
    length = position.size * width
    waves = _waves(position, mean, deviation / np.sqrt(np.maximum(count, 1)), length)
    coefficients = _each(_columns(position, waves, length), rows)
    trend = _trend(position, rows, slowness, waves, length)[0]
    harmonics = tuple(
        _harmonic(times, length / times, coefficients[:, 2 * i + 2], coefficients[:, 2 * i + 3])
        for i, times in enumerate(waves)
    )
    ends = (mean - half, mean + half)
    return PositionPattern(condition, position, mean, *ends, trend, harmonics, rows.shape[0], title)


def _trend(
    position: Array, rows: Array, slowness: Array, waves: Sequence[float], length: float
) -> tuple[Estimate, float]:
    """Estimate the common change along x without the drift of the sensor's zero, and the rate of that drift, N/s.

    The zero drifts during a cycle. In strokes towards +x the drift grows along x, in strokes towards -x it falls along
    x. In half the difference it appears as a slope of rate / speed. Slow cycles show this drift most. Because its rate
    varies, they contribute least
    to the trend. The lengths of the waves are uncertain, and an error of the length looks partly like a trend. Each
    cycle therefore has waves that may be slightly longer or shorter.
    """
    found, variance = _slopes(position, rows, waves, length)
    if slowness.max() < APART * slowness.min() or found.size < FEWEST_CYCLES + 1:
        return mean_estimate(found, "1/m"), 0.0
    usual = float(np.median(slowness))
    groups = np.array_split(np.argsort(slowness), min(MOST_FITTED, found.size))
    count = np.array([group.size for group in groups], dtype=float)
    slow = np.array([slowness[group].mean() for group in groups]) / usual
    variance = moderate(variance, np.full(variance.size, FREEDOM_PER_CYCLE), slowness)
    scale = max(float(np.std(found)), 1e-12)
    model = MixedModel(
        np.array([found[group].mean() for group in groups]),
        np.column_stack([np.ones(slow.size), slow]),
        np.array([variance[group].sum() for group in groups]) / count**2,
        (RandomEffect("cycle", 1.0 / count, scale), RandomEffect("zero", slow**2 / count, scale)),
    )
    fit = model.fit()
    return fit.contrast(np.array([1.0, 0.0]), "1/m"), fit.contrast(np.array([0.0, 1.0])).value / usual


def _slopes(position: Array, rows: Array, waves: Sequence[float], length: float) -> tuple[Array, Array]:
    """Return the relative change of friction along x in each cycle, and its variance by noise within the cycle."""
    columns = _columns(position, waves, length)
    columns = np.hstack([columns, _stretches(position, np.nanmean(rows, axis=0), columns, length)])
    found = _each(columns, rows)
    rest = np.nan_to_num(rows - found @ columns.T)
    weights = np.linalg.pinv(columns)[1]
    spare = rest.shape[1] / (rest.shape[1] - columns.shape[1])  # noise absorbed by the columns
    variance = spare * (rest.shape[1] * stderrs_of_means(rest * weights)) ** 2
    return found[:, 1], np.maximum(variance, 1e-12 * float(np.var(found[:, 1])) + 1e-30)


def _columns(position: Array, waves: Sequence[float], length: float) -> Array:
    """Return columns of mean, trend, cosine and sine of waves of these orders; shape (n, 2 + 2 waves)."""
    away = position - position.mean()
    columns = [np.ones(away.size), away]
    for times in waves:
        phase = 2.0 * np.pi * times * away / length
        columns += [np.cos(phase), np.sin(phase)]
    return np.column_stack(columns)


def _waves(position: Array, mean: Array, stderr: Array, length: float) -> list[float]:
    """Find the order of each wave: the number of periods in the range, rarely a whole number.

    Waves are added one after the other, the strongest first, while a wave explains more of the pattern than chance.
    With each new wave, all orders are adjusted.
    """
    weight = 1.0 / np.maximum(stderr, 1e-3 * float(np.median(stderr)) + 1e-12)

    def left(waves: Sequence[float]) -> float:
        if len(waves) > 1 and np.diff(np.sort(waves)).min() < RESOLVED:
            return float("inf")
        columns = weight[:, None] * _columns(position, waves, length)
        rest = weight * mean - columns @ np.linalg.lstsq(columns, weight * mean, rcond=None)[0]
        return float(rest @ rest)

    waves: list[float] = []
    while len(waves) < MOST_WAVES:
        trial = [*waves, min(TIMES, key=lambda times: left([*waves, times]))]
        for step in FINER:
            for i, at in enumerate(trial):
                near = [at + step * k for k in range(-10, 11)]
                inside = [times for times in near if TIMES[0] <= times <= TIMES[-1]]
                trial[i] = min(inside, key=lambda times: left([*trial[:i], times, *trial[i + 1 :]]))
        if left(waves) - left(trial) < CLEAR * max(left(trial) / max(mean.size - 2 - 3 * len(trial), 1), 1.0):
            break
        waves = [float(times) for times in trial]
    return waves


def _stretches(position: Array, mean: Array, columns: Array, length: float) -> Array:
    """Change of the mean pattern with the order of each of its waves; shape (n, waves)."""
    found = np.linalg.lstsq(columns, mean, rcond=None)[0]
    phase = 2.0 * np.pi * (position - position.mean()) / length
    pairs = [(k, k + 1) for k in range(2, columns.shape[1], 2)]
    parts = [phase * (found[sine] * columns[:, cosine] - found[cosine] * columns[:, sine]) for cosine, sine in pairs]
    return np.column_stack(parts) if parts else np.zeros((position.size, 0))


def _each(columns: Array, rows: Array) -> Array:
    """Return the coefficients of the columns in each cycle, shape (cycles, columns)."""
    masks, which = np.unique(np.isfinite(rows), axis=0, return_inverse=True)
    found = np.empty((rows.shape[0], columns.shape[1]))
    for number, here in enumerate(masks):  # cycles that lack the same bins form one problem
        members = which.ravel() == number
        found[members] = np.linalg.lstsq(columns[here], rows[np.ix_(members, here)].T, rcond=None)[0].T
    return found


def _harmonic(times: float, wavelength: float, cosine: Array, sine: Array) -> PositionWave:
    """Estimate one harmonic; its amplitude is tested by Hotelling's T2 of both parts."""
    from scipy.special import fdtrc

    n = cosine.size
    both = np.column_stack([cosine, sine])
    mean = both.mean(axis=0)
    covariance = np.cov(both.T) / n
    size = float(np.hypot(*mean))
    along = mean / size if size > 0 else np.array([1.0, 0.0])
    stderr = float(np.sqrt(max(along @ covariance @ along, 0.0)))
    half = student(n - 1) * stderr
    try:
        t2 = float(mean @ np.linalg.solve(covariance, mean))
        p = float(fdtrc(2, n - 2, t2 * (n - 2) / (2.0 * (n - 1))))
    except np.linalg.LinAlgError:
        p = float(size == 0.0)
    amplitude = Estimate(size, max(size - half, 0.0), size + half, stderr, "1", n - 1, p)
    return PositionWave(times, wavelength, mean_estimate(cosine, "1"), mean_estimate(sine, "1"), amplitude)
