"""Trends of friction over time, travel, temperature, position, and the pressures of both chambers.

Drift, run-in and repeatability come from the cycles of one condition. The pattern over position has a trend and
harmonics, with the cycles as repeats. Slopes over both pressures are given at each speed, with their interaction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, fdtrc

from pneudrive.arrays import Array, Bools, Columns, Ints
from pneudrive.estimate.autocorrelation import cells, centred_walk, moderate, projection, stderrs_of_means
from pneudrive.estimate.estimates import CHANCE, NORMAL_95, Estimate, mean_estimate, student
from pneudrive.estimate.mixed import MixedFit, MixedModel, RandomEffect, independent
from pneudrive.friction.campaign.curves import Fits
from pneudrive.friction.campaign.points import FREEDOM_PER_CYCLE, CurvePoints, shares_of
from pneudrive.friction.campaign.result import Drift, PositionPattern, PositionWave, PressureEffects, Repeatability
from pneudrive.friction.campaign.smooth import CYCLE_SCALE
from pneudrive.friction.friction_map import HOUR_S, PA_PER_BAR, TOLD, Condition, classify_pressures
from pneudrive.friction.sentences import Statement, say

#: Cause of a drift -> its effect in `Drift`, and the unit.
EFFECTS = {
    "time": ("per_hour", "N/h"),
    "travel": ("per_decade_of_travel", "N/decade"),
    "temperature": ("per_kelvin", "N/K"),
    "interrupted": ("interrupted", "N"),
}
LEAST_KELVIN = 0.5  # least range of temperature for an effect
LEAST_DECADES = 0.5  # of travel
FIRST_TRAVEL_M = 1.0  # least travel for its logarithm
LONG_REST_S, LONG_REST_RATIO = 30.0, 5.0  # a rest is an interruption beyond both, the ratio to the usual rest
FEWEST_INTERRUPTED = 3
ENOUGH_FOR_LINE = 3  # degrees of freedom above which a line over the campaign is removed from repeats
TOGETHER = 0.95  # correlation above which two causes cannot be separated


def causes(fits: Fits) -> Columns:
    """Return the possible causes of a drift that vary enough to have an effect, at the points of F(v).

    The causes are time (h), travel (decades), temperature (K), and interruption (1 after a long rest or a cycle with a
    stop).
    """
    used = fits.points.at(fits.points.use)
    columns, rest = {"time": used["began_s"] / HOUR_S}, used["rest_s"]
    decades, kelvin = np.log10(used["travel_m"] + FIRST_TRAVEL_M), used["temperature_k"]
    if np.ptp(decades) >= LEAST_DECADES:
        columns["travel"] = decades
    if np.isfinite(kelvin).all() and np.ptp(kelvin) >= LEAST_KELVIN:
        columns["temperature"] = kelvin
    usual = np.nanmedian(rest) if np.isfinite(rest).any() else 0.0
    interrupted = np.nan_to_num(rest) > max(LONG_REST_S, LONG_REST_RATIO * usual)
    if FEWEST_INTERRUPTED <= interrupted.sum() <= interrupted.size - FEWEST_INTERRUPTED:
        columns["interrupted"] = interrupted.astype(float)
    return columns


def drift_of(fits: Fits) -> Drift:
    """Return the drift over the campaign and the effects of its causes. Undetermined effects have the value None."""
    points, fit, scale = fits.points, fits.friction, fits.scale_n
    known, effects = causes(fits), dict[str, Estimate | None]()
    has_drift, model = fit.data.drift, fit.fit.model
    for cause, (name, unit) in EFFECTS.items():
        effects[name] = None
        if cause in known and (has_drift or cause == "interrupted"):
            # The effect on mean friction is estimated together with a smooth drift.
            x = np.column_stack([model.x, known[cause] - known[cause].mean()])
            if _is_determined(x):
                effects[name] = replace(model, x=x).fit().contrast(scale * np.eye(x.shape[1])[-1], unit)
    time, sentinel = points["elapsed_s"], points["kind"] == "sentinel"
    repeated = (np.bincount(points["cell"][points.use]) > 1).any()
    basis = "sentinels" if sentinel.any() else "repeats" if repeated else "smooth curve"
    value, half = fit.drift.mean * scale, fit.drift.half_width() * scale
    return Drift(
        time_s=time[points.use],
        drift_n=value,
        low_n=value - half,
        high_n=value + half,
        sentinel_time_s=time[sentinel],
        sentinel_n=points["friction_n"][sentinel],
        **effects,
        basis=basis if has_drift else "not determined",
        spread_n=float(np.std(value)),
    )


def _is_determined(x: Array) -> bool:
    """Return whether the cycles determine all fixed effects and their scatter."""
    return x.shape[0] > x.shape[1] + 1 and independent(x).size == x.shape[1]


def repeatability(fits: Fits) -> Repeatability:
    """Return the standard deviations of a cycle's friction, from repeats and control runs if there are any."""
    fit, pure, scale, basis = fits.friction, pure_scatter(fits), fits.scale_n, "smooth curve"
    if pure is not None:
        found, level, basis = pure
        scale = level if fit.data.logarithmic else scale
        within = found.scaled(scale)
    else:
        noise = float(np.sqrt(np.mean(fit.data.noise))) * scale
        within = fit.fit.deviation("cycle").scaled(scale)
        ends = {name: float(np.hypot(getattr(within, name), noise)) for name in ("value", "low", "high")}
        within = replace(within, **ends)
    between = total = None
    if fit.data.blocks is not None:
        between = fit.fit.deviation("block").scaled(scale)
        value = float(np.hypot(within.value, between.value))
        stderr = float(np.hypot(within.stderr * within.value, between.stderr * between.value)) / max(value, 1e-12)
        reach = NORMAL_95 * stderr / max(value, 1e-12)
        ends = {"low": value * np.exp(-reach), "high": value * np.exp(reach)}
        total = replace(within, value=value, **ends, stderr=stderr)
    return Repeatability(within, between, total, fit.relative > 0.5, basis)


def pure_scatter(fits: Fits) -> tuple[Estimate, float, str] | None:
    """Estimate the standard deviation of a cycle from repeats and control runs, independently of the curves.

    Return the estimate in the unit of the curves' response, the mean friction (N) of these cycles, and the source.

    Cycles at one condition and speed are used, after subtracting their mean, a line over the campaign and the means of
    the blocks. Means of several cycles have a larger weight. None without repeats.
    """
    points, fit = fits.points, fits.friction
    use = np.flatnonzero(points.use)
    cell = points["cell"][use]
    again = np.bincount(cell)[cell] > 1
    if not again.any():
        return None
    use, cell, weight = use[again], cells(cell[again]), np.sqrt(fit.data.count[again])
    groups = cell.max() + 1
    x = np.eye(groups)[cell]
    if use.size - groups > ENOUGH_FOR_LINE:
        x = np.column_stack([x, fit.data.order[again], shares_of(points.labels("block", use))])
    x, y = weight[:, None] * x[:, independent(x)], weight * fit.data.y[again]
    rest, free = y - projection(y, x), y.size - x.shape[1]
    if free < 1:
        return None
    value = float(np.sqrt(rest @ rest / free))
    low, high = (value * float(np.sqrt(free / chdtri(free, p))) for p in (0.025, 0.975))
    sentinel = points["kind"][use] == "sentinel"
    others = np.bincount(cell[~sentinel], minlength=groups)  # one more sweep at the point of the sentinels
    kinds = (["repeats"] if others.max() > 1 else []) + (["sentinels"] if sentinel.any() else [])
    basis = " and ".join(kinds)
    estimate = Estimate(value, low, high, value / float(np.sqrt(2.0 * free)), "N", free)
    return estimate, float(points["friction_n"][use].mean()), basis


#: Largest number of waves of a pattern. Waves have 0.9 to 8 periods in the range; longer waves count as a trend.
MOST_WAVES = 4
TIMES = np.arange(0.9, 8.01, 0.1)
FINER = (0.02, 0.004, 0.001)
RESOLVED = 0.5  # least difference of the orders of two waves: nearer ones look alike over the range
#: Decrease of chi-square by a significant wave (p = 0.001, three parameters, about fifty positions).
CLEAR = 25.0
FEWEST_BINS = 16
FEWEST_CYCLES = 4
MOST_FITTED = 100  # cycles whose slopes are fitted one by one; if there are more, neighbours in speed are grouped
APART = 2.0  # least ratio of the slowest to the fastest cycle's time and force for a drift of the zero
COVERED = 0.9  # of the common bins: cycles that lack more are not used for trend and harmonics


def position_dependence(points: CurvePoints) -> tuple[PositionPattern, ...]:
    """Return friction over position for each mounting, seal and drive, then for each condition with enough cycles."""
    found = [_describe(points, title, None, members) for title, members in points.assemblies.items()]
    for title in points.assemblies:
        own = [(i, c) for i, c in enumerate(points.conditions) if c.title == title]
        if len(own) > 1:
            found += [_describe(points, title, c, points.use & (points["curve"] == i)) for i, c in own]
    return tuple(pattern for pattern in found if pattern is not None)


def _describe(
    points: CurvePoints,
    title: str,
    condition: Condition | None,
    members: Bools,
) -> PositionPattern | None:
    common, here = points.pattern["common"], points.at(members)
    rows = here["relative_n"][:, common]
    position = points.pattern["position_m"][common]
    enough = np.isfinite(rows).mean(axis=1) >= COVERED
    seen = np.isfinite(rows[enough]).any(axis=0)
    rows, position = rows[enough][:, seen], position[seen]
    if rows.shape[0] < FEWEST_CYCLES or position.size < FEWEST_BINS:
        return None
    slowness = 1.0 / (here["speed_m_s"] * np.abs(here["friction_n"]))[enough]
    rows = rows - _trend(position, rows, slowness, ())[1] * slowness[:, None] * (position - position.mean())
    count, mean = np.isfinite(rows).sum(axis=0), np.nanmean(rows, axis=0)
    deviation = np.sqrt(np.nansum((rows - mean) ** 2, axis=0) / np.maximum(count - 1, 1))
    half = np.array([student(n - 1) for n in count]) * deviation / np.sqrt(count)
    waves = _waves(position, mean, deviation / np.sqrt(count))
    coefficients = _each(_columns(position, waves), rows)
    trend = _trend(position, rows, slowness, waves)[0]
    parts = zip(waves, coefficients[:, 2::2].T, coefficients[:, 3::2].T, strict=True)
    harmonics = tuple(_harmonic(order, _length(position) / order, *both) for order, *both in parts)
    ends = (mean - half, mean + half)
    return PositionPattern(condition, position, mean, *ends, trend, harmonics, rows.shape[0], title)


def _trend(position: Array, rows: Array, slowness: Array, waves: Sequence[float]) -> tuple[Estimate, float]:
    """Estimate the common trend along x without the drift of the sensor's zero, and the rate of this drift in N/s.

    The zero drifts during a cycle. In strokes towards +x, the drift grows along x; in strokes towards -x, it falls
    along x. In half the difference of both directions, the drift appears as a slope of rate / speed over x. This
    affects slow cycles most, and because the rate varies, slow cycles have the least weight in the trend. An error of a
    wave's length looks partly like a trend. The wave lengths of each cycle may therefore deviate slightly.
    """
    # Relative trend of friction along x in each cycle, and its variance from noise within the cycle.
    columns = _columns(position, waves)
    # Derivatives of the mean pattern with respect to the order of each wave.
    of_mean = np.linalg.lstsq(columns, np.nanmean(rows, axis=0), rcond=None)[0]
    phase = 2.0 * np.pi * (position - position.mean()) / _length(position)
    pairs = [(k, k + 1) for k in range(2, columns.shape[1], 2)]
    stretches = [phase * (of_mean[b] * columns[:, a] - of_mean[a] * columns[:, b]) for a, b in pairs]
    columns = np.column_stack([columns, *stretches])
    slopes = _each(columns, rows)
    rest = np.nan_to_num(rows - slopes @ columns.T)
    weights = np.linalg.pinv(columns)[1]
    spare = rest.shape[1] / (rest.shape[1] - columns.shape[1])  # noise absorbed by the columns
    variance = spare * (rest.shape[1] * stderrs_of_means(rest * weights)) ** 2
    found = slopes[:, 1]
    if slowness.max() < APART * slowness.min() or found.size < FEWEST_CYCLES + 1:
        return mean_estimate(found, "1/m"), 0.0
    usual = np.median(slowness)
    groups = np.array_split(np.argsort(slowness), min(MOST_FITTED, found.size))
    count = np.array([group.size for group in groups], dtype=float)
    slow = np.array([slowness[group].mean() for group in groups]) / usual
    variance = np.maximum(variance, 1e-12 * np.var(found) + 1e-30)
    variance = moderate(variance, np.full(variance.size, FREEDOM_PER_CYCLE), slowness)
    scale = max(float(np.std(found)), 1e-12)
    model = MixedModel(
        np.array([found[group].mean() for group in groups]),
        np.column_stack([np.ones(slow.size), slow]),
        np.array([variance[group].sum() for group in groups]) / count**2,
        (RandomEffect("cycle", np.diag(1.0 / count), scale), RandomEffect("zero", np.diag(slow**2 / count), scale)),
    )
    fit = model.fit()
    return fit.contrast(np.array([1.0, 0.0]), "1/m"), fit.contrast(np.array([0.0, 1.0])).value / usual


def _columns(position: Array, waves: Sequence[float]) -> Array:
    """Return the design columns: mean, trend, cosine and sine of the wave of each order (shape (n, 2 + 2 waves))."""
    away, length = position - position.mean(), _length(position)
    columns = [np.ones(away.size), away]
    for times in waves:
        phase = 2.0 * np.pi * times * away / length
        columns += [np.cos(phase), np.sin(phase)]
    return np.column_stack(columns)


def _length(position: Array) -> float:
    """Return the length of a position range from the centres of its bins, which have equal width."""
    return position.size * float(position[1] - position[0])


def _waves(position: Array, mean: Array, stderr: Array) -> list[float]:
    """Find the order of each wave: the number of periods in the range, rarely a whole number.

    Waves are added one by one, the strongest first, while each new wave is significant. With each new wave, all orders
    are adjusted.
    """
    weight = 1.0 / np.maximum(stderr, 1e-3 * np.median(stderr) + 1e-12)

    def left(waves: Sequence[float]) -> float:
        if len(waves) > 1 and np.diff(np.sort(waves)).min() < RESOLVED:
            return np.inf
        columns = weight[:, None] * _columns(position, waves)
        rest = weight * mean - projection(weight * mean, columns)
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


def _each(columns: Array, rows: Array) -> Array:
    """Fit the columns to each cycle. Return the coefficients (shape (cycles, columns))."""
    masks, which = np.unique(np.isfinite(rows), axis=0, return_inverse=True)
    found = np.empty((rows.shape[0], columns.shape[1]))
    for number, here in enumerate(masks):  # cycles that lack the same bins form one problem
        members = which.ravel() == number
        found[members] = np.linalg.lstsq(columns[here], rows[np.ix_(members, here)].T, rcond=None)[0].T
    return found


def _harmonic(order: float, wavelength: float, cosine: Array, sine: Array) -> PositionWave:
    """Estimate one harmonic. Its amplitude is tested by Hotelling's T2 of cosine and sine part."""
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
    return PositionWave(order, wavelength, mean_estimate(cosine, "1"), mean_estimate(sine, "1"), amplitude)


#: Relative change of friction over a campaign, by run-in or wear, that may be mistaken for an effect of pressure if the
#: order of the cycles follows pressure (assumed standard uncertainty).
HIDDEN_CHANGE = 0.1
#: A warning is given if the effect of a pressure may contain more than this fraction of `HIDDEN_CHANGE`.
FOLLOWS_TIME = 0.1


@dataclass(frozen=True, eq=False)
class _Design:
    """Cycles of one set of levels that determine the effects of pressure. `used` marks them among all points.

    Pressures are gauge, in bar. ``kind`` names the determined slopes: both, a, b, sum or line. ``equal`` has a column
    for each set of repeated cycles at other speeds, such as control runs. The pressure of each set is constant, so
    these cycles only show the effect of time. Their ``level`` is -1.
    """

    used: Bools
    points: CurvePoints
    kind: str
    speeds: Array
    level: Ints
    gauge: Array
    equal: Array
    pairs: tuple[tuple[float, float], ...]

    @property
    def compared(self) -> Bools:
        """Return the cycles at speeds that were measured at all pressure pairs."""
        return self.level >= 0

    def centred(self, values: Array) -> Array:
        """Return the values minus their mean over the compared cycles; zero for other cycles."""
        return np.where(self.compared, values - values[self.compared].mean(), 0.0)


def pressure_effects(ambient_pa: float, fits: Fits, title: str, members: Bools) -> PressureEffects | None:
    """Return the effects of pressure for a set of mounting, seal and drive; None without several pressure pairs."""
    design = _design(ambient_pa, fits, members)
    if design is None:
        return None
    speed = np.eye(design.speeds.size)[design.level] * design.compared[:, None]
    gauges = {name: design.gauge[:, int(name == "b")] for name in TOLD.get(design.kind, ("sum",))}
    count, base = design.speeds.size, np.hstack([design.equal, speed])
    x = np.hstack([base, *(speed * p[:, None] for p in gauges.values())])
    if x.shape[0] <= x.shape[1] + 1:  # too few cycles for a slope at each speed: one common slope
        count, x = 1, np.hstack([base, *(p[:, None] for p in gauges.values())])
    # An interaction is neither scatter nor drift: slopes are estimated with it, at the mean pressures.
    product = [np.prod([design.centred(p) for p in gauges.values()], axis=0)] if design.kind == "both" else []
    wide = _widened(design, x, product)
    together = wide[:, x.shape[1] :] if x.shape[0] > wide.shape[1] + 1 else x[:, :0]
    x = np.hstack([together, x])
    fit = _fit(fits, design, x)
    if fit is None:
        return None
    used, hidden_n = design.points, 0.0
    # Standard uncertainty of a change of friction between pressures from the sensors, N.
    u = float(np.mean(np.hypot(used["u_gain_n"], used["u_hysteresis_n"])))
    # A steady change by 1 N from the first cycle to the last looks like these coefficients of the pressure columns.
    of_order = np.linalg.lstsq(fit.model.x, used["order"] - used["order"].mean(), rcond=None)[0]
    if not fits.friction.data.drift:  # else the design determines a drift, which is then in the model
        hidden_n = HIDDEN_CHANGE * float(np.abs(fit.model.y).mean())

    def slope(row: Array, span: float) -> Estimate:
        doubt = float(np.hypot(u / max(span, 1e-12), hidden_n * abs(row @ of_order)))
        return fit.contrast(row).widened(doubt).scaled(1.0 / PA_PER_BAR, "N/Pa")

    # The last columns are the slopes at each speed, one pressure after the other.
    rows_of = np.eye(x.shape[1])[-count * len(gauges) :].reshape(len(gauges), count, -1)
    slopes, means, with_time = {}, {}, []
    for (name, gauge), rows in zip(gauges.items(), rows_of, strict=True):
        span, of_mean = np.ptp(gauge), rows.mean(axis=0)
        slopes[name], means[name] = tuple(slope(row, span) for row in rows), slope(of_mean, span)
        if hidden_n * abs(of_mean @ of_order) * span > FOLLOWS_TIME * hidden_n:
            with_time.append(name)
    interaction, joint, curvature = None, None, None
    if together.shape[1] and not hidden_n:
        rows = np.eye(x.shape[1])[: together.shape[1]]
        interaction, joint = fit.f_test(rows), fit.contrast(rows[0]).scaled(PA_PER_BAR**-2, "N/Pa2")
    if not hidden_n:
        squares = [design.centred(p) ** 2 * design.compared for p in gauges.values()]
        wide = _widened(design, x, [square for square in squares if np.ptp(square) > 0.0])
        bent = _fit(fits, design, wide) if wide.shape[1] > x.shape[1] else None
        curvature = None if bent is None else bent.f_test(np.eye(wide.shape[1])[x.shape[1] :])
    found = PressureEffects(
        levels=title,
        speed_m_s=design.speeds if count > 1 else design.speeds.mean(keepdims=True),
        gauge_pa=tuple((PA_PER_BAR * a, PA_PER_BAR * b) for a, b in design.pairs),
        hidden_n=hidden_n,
        statement="",
        interaction=interaction,
        interaction_n_pa2=joint,
        curvature=curvature,
        slopes=slopes,
        means=means,
    )
    return replace(found, statement=" ".join(one.text for one in _sentences(design, found, with_time, u)))


def _design(ambient_pa: float, fits: Fits, members: Bools) -> _Design | None:
    """Select the speeds that were measured at all pressure pairs, and classify the effects that the pairs determine."""
    points = fits.points
    absolute = np.array([(c.pressure_a_pa, c.pressure_b_pa) for c in points.conditions])
    gauge = (np.round((absolute - ambient_pa) / PA_PER_BAR, 3) + 0.0)[points["curve"]]
    pairs, level, cell = np.unique(gauge[members], axis=0), points["level"], points["cell"]
    at = {int(k): np.unique(gauge[members & (level == k)], axis=0) for k in set(level[members])}
    kept = sorted(k for k, found in at.items() if len(found) == len(pairs))
    if len(pairs) < 2 or not kept:
        return None
    compared = members & np.isin(level, kept)
    # Equal cycles at other speeds, in one set each; a single cycle carries no information.
    sets, counts = np.unique(cell[members & ~compared], return_counts=True)
    equal = members & ~compared & np.isin(cell, sets[counts > 1])
    used = compared | equal
    return _Design(
        used=used,
        points=points.at(used),
        kind=classify_pressures(pairs),
        speeds=points.level_speeds_m_s[kept],
        level=np.where(compared[used], np.searchsorted(kept, level[used]), -1),
        gauge=np.where(compared[used, None], gauge[used], 0.0),
        equal=(cell[used][:, None] == sets[counts > 1]) & equal[used][:, None],
        pairs=tuple((float(a), float(b)) for a, b in pairs),
    )


def _fit(fits: Fits, design: _Design, x: Array) -> MixedFit | None:
    """Fit fixed effects with the random effects of the curves' model; None with too few cycles."""
    if not _is_determined(x):
        return None
    y = design.points["friction_n"]
    # A relative source is proportional to friction as predicted by the fixed effects, not to
    # the values themselves, which such a source would explain exactly.
    steady = projection(y, x)
    level = steady / steady.mean()
    share, relative = (level if fits.friction.data.logarithmic else np.ones(y.size)), fits.friction.relative
    usual = CYCLE_SCALE * max(np.abs(y).mean(), 1e-9)
    outer, own = np.outer(share, share), relative * level**2 + 1.0 - relative
    components = [RandomEffect("cycle", np.diag(own / fits.points.count[design.used]), usual)]
    if fits.friction.data.drift:
        components.append(RandomEffect("drift", outer * centred_walk(design.points["order"]), usual))
    if (blocks := fits.friction.data.blocks) is not None:
        blocks = blocks[design.used[fits.points.use]]
        if blocks.any(axis=0).sum() > 1:
            components.append(RandomEffect("block", outer * (blocks @ blocks.T), usual))
    return MixedModel(y, x, design.points["friction_stderr_n"] ** 2, tuple(components)).fit()


def _widened(design: _Design, x: Array, columns: list[Array]) -> Array:
    """Return x with further columns and their products with log speed. Return x alone if a column is not independent.

    The further columns are the product of both centred pressures, or their squares. They give the mean effect over
    speeds. Their products with log speed give the change of the effect with speed. If x contains the product of both
    pressures, the slope of one pressure applies at the mean of the other.
    """
    tilt = design.centred(np.log(design.points["speed_m_s"]))
    over_speed = [column * tilt for column in columns] if design.speeds.size > 1 else []
    wide = np.column_stack([x, *columns, *over_speed])
    kept = independent(wide)
    return wide[:, kept] if np.isin(x.shape[1] + np.arange(len(columns)), kept).all() else x


def _sentences(
    design: _Design,
    found: PressureEffects,
    with_time: list[str],
    u: float,
) -> Iterator[Statement]:
    """Yield statements on the determined slopes, on their additivity (interaction test) and on undetermined values.

    An interaction within the accuracy of the sensors is ignored.
    """
    test, joint = found.interaction, found.interaction_n_pa2
    titles = {"a": "p_a", "b": "p_b", "sum": "both pressures together"}
    slopes = " and ".join(f"{e.scaled(PA_PER_BAR, 'N/bar'):.2f} of {titles[name]}" for name, e in found.means.items())
    pairs = ", ".join(f"{a:.3g}/{b:.3g}" for a, b in design.pairs)
    yield say("pressure.slopes", pairs=pairs, speeds=design.speeds.size, slopes=slopes)
    if design.kind != "both":
        yield say(f"pressure.{design.kind if design.kind in {'sum', 'line'} else 'single'}")
    elif test is None or joint is None:
        yield say("pressure.no_interaction")
    else:
        reach = max(abs(joint.low), abs(joint.high)) * PA_PER_BAR**2
        most = reach * np.abs(design.gauge[:, 0] * design.gauge[:, 1]).max()
        numbers = f"F({test.numerator:.0f}, {test.denominator:.0f}) = {test.f:.2f}, {_chance(test.p)}"
        if test.p >= CHANCE:
            yield say("pressure.add", test=numbers, reach=reach)
        elif most < 2.0 * u:
            yield say("pressure.add_within_accuracy", test=numbers, most=most, accuracy=2.0 * u)
        else:
            yield say("pressure.interact", test=numbers, joint=joint.scaled(PA_PER_BAR**2, "N/bar2"))
    if found.curvature is not None and found.curvature.p < CHANCE:
        yield say("pressure.curved", chance=_chance(found.curvature.p))
    if with_time:
        names = " and ".join({"a": "p_a", "b": "p_b", "sum": "the pressures"}[name] for name in with_time)
        yield say("pressure.follows_time", names=names, hidden=found.hidden_n, share=100 * HIDDEN_CHANGE)


def _chance(p: float) -> str:
    """Return a probability as text; values below 0.001 as ``p < 0.001``."""
    return f"p = {p:.2g}" if p >= 0.001 else "p < 0.001"
