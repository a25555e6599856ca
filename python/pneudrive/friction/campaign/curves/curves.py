"""Curves of friction over speed from the cycles of a campaign, with a band for all observed and stated sources."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.estimate.groups import cells, levels
from pneudrive.friction.campaign.basics import BOTH
from pneudrive.friction.campaign.curves.condense import grouped
from pneudrive.friction.campaign.curves.outliers import WILD, WILD_SPREAD, wild_cycles
from pneudrive.friction.campaign.curves.reduction import Reduced, reduce
from pneudrive.friction.campaign.curves.smooth import (
    CARRIED,
    CurveData,
    CurveFit,
    carried_drift,
    either_chance,
    fit_curves,
    with_doubt,
)
from pneudrive.friction.campaign.cycles.self_excited import reasons as self_excited
from pneudrive.friction.campaign.result import Curve, ExcludedPoint
from pneudrive.friction.reduction.plausible import OUTLIER, implausible_friction

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.estimate.mixed import Predicted
    from pneudrive.friction.campaign.basics import Condition
    from pneudrive.friction.campaign.cycles.cycle import CycleData
    from pneudrive.friction.campaign.cycles.reading import CampaignData

    Array = NDArray[np.float64]

SATURATED_SHARE = 0.005  # of a cycle's samples: with more at the sensor's limit, the mean is not that of friction
SAME_SPEED = 0.05  # measured speeds closer than this are one point of the curve
BETWEEN = 24  # speeds of a curve between the measured ones
POSITIVE_SHARE = 0.2  # of the median friction: least friction for relative scatter
FEWEST = 4  # cycles
MOST_CYCLES = 600  # cycles that are fitted one by one: memory grows with their square, time with their cube
#: Least standard error at a speed, share of the scatter of its cycles, even if neighbouring speeds and
#: other pressures seem to determine the curve better (assumed).
OWN_SHARE = 0.8
MOST_CELLS = 1200  # condition, speed level and block: beyond it, neighbouring blocks are joined, then speed levels


@dataclass(frozen=True, eq=False)
class Points:
    """Cycles with both directions, and the selection of points of F(v).

    Attributes
    ----------
    reduced : Reduced
    conditions : tuple of Condition
        Those that occur.
    condition : ndarray of int, shape (n,)
        Index of each cycle's condition.
    level : ndarray of int, shape (n,)
        Index of each cycle's speed level; levels ascend.
    level_speeds_m_s : ndarray, shape (levels,)
    reasons : tuple of str, length n
        Why a cycle is not a point of F(v); "" if it is one.
    unpaired : tuple of CycleData
        With one direction only.
    members : tuple of tuple of CycleData, length n
        Cycles of each point: more than one if a large campaign was condensed.
    """

    reduced: Reduced
    conditions: tuple[Condition, ...]
    condition: NDArray[np.int64]
    level: NDArray[np.int64]
    level_speeds_m_s: Array
    reasons: tuple[str, ...]
    unpaired: tuple[CycleData, ...]
    members: tuple[tuple[CycleData, ...], ...]

    @property
    def count(self) -> Array:
        """Number of cycles of each point, shape (n,)."""
        return np.array([len(some) for some in self.members], dtype=float)

    @property
    def use(self) -> NDArray[np.bool_]:
        """Cycles that are points of F(v)."""
        return np.array([not reason for reason in self.reasons], dtype=bool)

    @property
    def cell(self) -> NDArray[np.int64]:
        """Number of the condition and speed level of each cycle, shape (n,)."""
        return cells(self.condition, self.level)

    def cycles(self, members: NDArray[np.bool_]) -> list[CycleData]:
        """Return the marked cycles."""
        return [d for d, member in zip(self.reduced.data, members, strict=True) if member]

    def __len__(self) -> int:
        """Return the number of cycles with both directions."""
        return len(self.reduced.data)


def points_of(reading: CampaignData) -> Points | None:
    """Return the sliding cycles as points; None if no cycle has both directions."""
    paired = [d for d in reading.sliding if len(d.sides) == 2]
    unpaired = tuple(d for d in reading.sliding if len(d.sides) != 2)
    if not paired:
        return None
    unsteady = self_excited(paired, reading.tares, reading.identity)
    reduced = reduce(paired, reading.edges_m, np.array([not reason for reason in unsteady], dtype=bool))
    conditions = tuple(sorted({d.condition for d in paired}))
    condition = np.array([conditions.index(d.condition) for d in paired], dtype=np.int64)
    level = levels(np.log(reduced.speed_m_s), np.log1p(SAME_SPEED))
    speeds = np.array([reduced.speed_m_s[level == k].mean() for k in range(int(level.max()) + 1)])
    unlikely = implausible_friction(condition, reduced.speed_m_s, reduced.friction_n, reduced.friction_stderr_n)
    reasons = tuple(a or b for a, b in zip(_reasons(paired, unsteady, condition, level), unlikely, strict=True))
    return Points(reduced, conditions, condition, level, speeds, reasons, unpaired, tuple((d,) for d in paired))


def _reasons(
    data: Sequence[CycleData], unsteady: Sequence[str], condition: NDArray[np.int64], level: NDArray[np.int64]
) -> tuple[str, ...]:
    """Return why each cycle is not a point of F(v). Stick-slip concerns a condition and speed, not a single cycle."""
    cell = cells(condition, level)
    first = {int(c): reason for c, reason in zip(cell[::-1], unsteady[::-1], strict=True) if reason}
    share = np.bincount(cell, [bool(reason) for reason in unsteady]) / np.bincount(cell)
    found = []
    for d, reason, c in zip(data, unsteady, cell.tolist(), strict=True):
        limit = SATURATED_SHARE * sum(s.samples for s in d.sides.values())
        if reason or share[c] > 0.5:
            found.append(reason or first[c])
        else:
            found.append("saturated" if d.flags.get("saturated", 0) > limit else "")
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Fits:
    """The models behind the curves.

    Attributes
    ----------
    points : Points
    friction : CurveFit
        Of half the difference of both directions.
    offset : CurveFit
        Of half the sum, with the tares.
    drift_share : float
        Share of a steady drift that the design cannot separate from the curves.
    block_kind : str
        block, day, or "" if there is none.
    doubtful : tuple of int
        Points that are possible outliers: curves average over both cases.
    """

    points: Points
    friction: CurveFit
    offset: CurveFit
    drift_share: float
    block_kind: str
    doubtful: tuple[int, ...] = ()

    def rest(self) -> Array:
        """Return the residuals of the used cycles without drift, in the response's unit, shape (used,)."""
        return self.friction.data.y - self.friction.drift - self.friction.steady()

    @property
    def blocks(self) -> Array | None:
        """Share of each block, or day, in each point; None if the design does not determine their deviations."""
        return self.friction.data.blocks

    @property
    def level_n(self) -> float:
        """Mean friction of the points, N."""
        return float(self.points.reduced.friction_n[self.points.use].mean())

    @property
    def scale_n(self) -> float:
        """Newton at mean friction for one unit of the friction model's response."""
        return self.level_n if self.friction.logarithmic else 1.0

    @property
    def has_zero(self) -> bool:
        """Whether tares show the zero of the force sensor."""
        return bool((self.offset.data.curve < 0).any())


def fit_points(reading: CampaignData, points: Points) -> Fits | None:
    """Fit the models; return None with too few points of F(v).

    A cycle far off all others (a failed sensor) is removed, and the rest fitted again.
    In a large campaign, neighbouring repeats are fitted as one.
    """
    if points.use.sum() > MOST_CYCLES:
        return _fit_points(reading, condensed(points))
    fits = _fit_points(reading, points)
    if fits is None:
        return None
    rows = np.flatnonzero(points.use)
    found, readings = wild_cycles(fits.friction.data)
    if found:
        wild = set(rows[found].tolist())
        kept = tuple(OUTLIER if i in wild else reason for i, reason in enumerate(points.reasons))
        fits = _fit_points(reading, replace(points, reasons=kept))
    if fits is None or not readings:
        return fits
    left = np.flatnonzero(fits.points.use)
    among = [np.searchsorted(left, rows[some]) for some in readings]
    both = with_doubt(fits.friction, among, WILD_SPREAD * fits.friction.data.level, WILD / (1.0 - WILD))
    return replace(fits, friction=both, doubtful=tuple(rows[readings[-1]].tolist()))


def condensed(points: Points) -> Points:
    """Group successive repeats of one condition, speed class and block.

    Where there are very many cells, neighbouring blocks of the same levels count as one, then neighbouring speeds.
    """
    reduced = points.reduced
    used = np.flatnonzero(points.use)
    keys = (points.condition[used], _stretches(points)[used], points.level[used])
    found, speeds = grouped(*keys, rows=MOST_CYCLES, cells=MOST_CELLS)
    groups = [used[group].tolist() for group in found]
    middle = [g[len(g) // 2] for g in groups]

    def mean(values: Array) -> Array:
        return np.array([values[g].mean() for g in groups])

    def stderr(values: Array) -> Array:
        return np.array([np.sqrt(np.sum(values[g] ** 2)) / len(g) for g in groups])

    joined = replace(
        reduced,
        data=tuple(reduced.data[i] for i in middle),
        **{n: mean(getattr(reduced, n)) for n in ("speed_m_s", "friction_n", "offset_n", "air_n")},
        **{f"{n}_stderr_n": stderr(getattr(reduced, f"{n}_stderr_n")) for n in ("friction", "offset", "air", "total")},
        relative_n=reduced.relative_n[middle],
    )
    of_level = points.level_speeds_m_s
    return replace(
        points,
        reduced=joined,
        condition=points.condition[middle],
        level=points.level[middle] // speeds,
        level_speeds_m_s=np.array([of_level[k : k + speeds].mean() for k in range(0, of_level.size, speeds)]),
        reasons=("",) * len(groups),
        members=tuple(tuple(reduced.data[i] for i in g) for g in groups),
    )


def _stretches(points: Points) -> NDArray[np.int64]:
    """Count each cycle's block among those of the same mounting, seal and drive, from 0."""
    data = points.reduced.data
    ranks: dict[tuple[str, ...], dict[int, int]] = {}
    found = []
    for d in data:
        same = ranks.setdefault(d.condition.levels, {})
        found.append(same.setdefault(d.head.cycle.block, len(same)))
    return np.array(found, dtype=np.int64)


def _fit_points(reading: CampaignData, points: Points) -> Fits | None:
    use = points.use
    if use.sum() < FEWEST:
        return None
    reduced = points.reduced
    order = np.array([reading.order(d.head) for d in reduced.data])
    kept = sorted(set(points.condition[use]))
    curve = np.array([kept.index(c) if c in kept else 0 for c in points.condition], dtype=np.int64)
    blocks, kind = block_shares(reading, points)
    ones = np.ones(int(use.sum()))
    alike = (reduced.speed_m_s[use], curve[use], order[use], points.count[use], ones)
    friction = CurveData(reduced.friction_n[use], reduced.friction_stderr_n[use] ** 2, *alike, blocks)
    share = carried_drift(friction)
    fitted = _better(replace(friction, drift=share < CARRIED))
    offset = CurveData(reduced.offset_n[use], reduced.offset_stderr_n[use] ** 2, *alike)
    offset = _with_tares(reading, offset)
    carries = carried_drift(offset) < CARRIED or (offset.curve < 0).sum() > 1
    return Fits(points, fitted, fit_curves(replace(offset, drift=carries)), share, kind)


def fit_response(reading: CampaignData, fits: Fits, y: Array, stderr: Array, *, drift: bool) -> CurveFit:
    """Fit curves to another result of the same cycles, shape (n,), with chance in N.

    Parameters
    ----------
    reading : CampaignData
    fits : Fits
        The models of friction, whose order, curves and blocks are used.
    y, stderr : ndarray, shape (n,)
        Of all cycles with both directions.
    drift : bool
        Whether it may drift like friction.
    """
    use, like = fits.points.use, fits.friction.data
    order = np.array([reading.order(d.head) for d in fits.points.reduced.data])[use]
    data = replace(like, y=y[use], noise=stderr[use] ** 2, order=order, logarithmic=False)
    return fit_curves(data if drift else replace(data, drift=False, blocks=None))


def block_shares(reading: CampaignData, points: Points) -> tuple[Array | None, str]:
    """Find blocks whose deviation can be separated from the levels: some levels have several blocks, or several days.

    Returns
    -------
    ndarray or None, shape (used, blocks)
        Share of each in the cycles of a point.
    str
        block, day, or "" if there is none.
    """
    members = [some for some, use in zip(points.members, points.use, strict=True) if use]
    named = [some[0].condition.levels for some in members]
    levels = np.array([named.index(name) for name in named])
    days = reading.days()
    kinds = {
        "block": [[d.head.cycle.block for d in some] for some in members],
        "day": [[days[d.head.cycle.key] for d in some] for some in members],
    }
    for kind, labels in kinds.items():
        shares = shares_of(labels)
        if any((shares[levels == level] > 0.0).any(axis=0).sum() > 1 for level in set(levels.tolist())):
            return shares, kind
    return None, ""


def shares_of(labels: Sequence[Sequence[int]]) -> Array:
    """Return the share of each label in each row of them, shape (rows, labels)."""
    column = {label: k for k, label in enumerate(sorted({label for row in labels for label in row}))}
    shares = np.zeros((len(labels), len(column)))
    for i, row in enumerate(labels):
        for label in row:
            shares[i, column[label]] += 1.0
    return shares / shares.sum(axis=1, keepdims=True)


def _better(data: CurveData) -> CurveFit:
    """Fit friction or its logarithm, whichever is more likely, with both forms of scatter."""
    plain = fit_curves(data)
    if data.y.min() <= POSITIVE_SHARE * np.median(data.y):
        return plain
    relative = fit_curves(data.logarithms())
    # Densities of y and of ln y differ by a factor y for each degree of freedom of the restricted likelihood.
    freedom = len(data) - plain.fit.model.x.shape[1]
    likelier = relative.fit.log_likelihood() - freedom * float(np.mean(np.log(data.y)))
    better = relative if likelier > plain.fit.log_likelihood() else plain
    del plain, relative  # free the other one before a third: each takes much memory
    return either_chance(better)


def _with_tares(reading: CampaignData, data: CurveData) -> CurveData:
    """Add the tares: observations of the zero alone, on no curve."""
    tares = reading.tares
    ones = np.ones(len(tares))
    added = {
        "y": np.array([t.standing_n for t in tares]),
        "noise": np.array([t.standing_stderr_n**2 for t in tares]),
        "speed_m_s": np.nan * ones,
        "curve": np.full(len(tares), -1, dtype=np.int64),
        "order": np.array([reading.order(t.head) for t in tares]),
        "count": ones,
        "chance": ones,
    }
    return replace(data, **{name: np.concatenate([getattr(data, name), values]) for name, values in added.items()})


@dataclass(frozen=True, eq=False)
class Systematic:
    """Standard uncertainties that all points of a curve share, N, shape (m,).

    ``state_n`` is the difference between friction in another state of the campaign and its mean state: no uncertainty
    of the curve of the mean state, but of the information from a single cycle.
    """

    gain_n: Array
    hysteresis_n: Array
    position_n: Array
    state_n: Array
    zero_n: Array

    def friction_n(self) -> Array:
        """Return that of half the difference of both directions, in the mean state of the campaign."""
        return np.sqrt(self.gain_n**2 + self.hysteresis_n**2 + self.position_n**2)

    def direction_n(self) -> Array:
        """Return that of one direction."""
        return np.hypot(self.friction_n(), self.zero_n)


def systematic(fits: Fits, friction_n: Array, half_sum_n: Array, condition: int) -> Systematic:
    """Return the uncertainties that all points share, at these frictions and half sums (without zero if known)."""
    points = fits.points
    members = points.use & (points.condition == condition)
    data = points.cycles(members)
    level = float(np.mean(points.reduced.friction_n[members]))
    gain = float(np.mean([d.u_gain_n for d in data])) / max(abs(level), 1e-12)
    spread = float(np.std(fits.friction.drift))
    static = float(np.mean([d.u_offset_n for d in data]))
    pattern = points.reduced.offset_pattern_n[points.reduced.common]
    place = points.reduced.unseen * float(np.std(pattern)) if pattern.size else 0.0
    zero = np.full(friction_n.size, np.hypot(static, place))
    if not fits.has_zero:
        zero = np.hypot(zero, np.abs(half_sum_n))
    return Systematic(
        gain_n=gain * np.abs(friction_n),
        hysteresis_n=np.full(friction_n.size, float(np.mean([d.u_hysteresis_n for d in data]))),
        position_n=points.reduced.u_position * np.abs(friction_n),
        state_n=spread * np.abs(friction_n) if fits.friction.logarithmic else np.full(friction_n.size, spread),
        zero_n=zero,
    )


def curves_of(fits: Fits, *, contains_air: bool) -> tuple[Curve, ...]:
    """Return the curves of all conditions: half the difference of both directions, then +x and -x."""
    curves: list[Curve] = []
    for at in curve_speeds(fits.points):
        value, low, high = by_chance(fits, fits.friction, at)
        offset = fits.offset.at(at.number, at.speed_m_s)
        shared = systematic(fits, value, offset.mean, at.index)
        excluded = _excluded(fits.points, at.index)
        for direction in (BOTH, 1, -1):
            centre, below, above = value, value - low, high - value
            u = shared.friction_n() if direction == BOTH else shared.direction_n()
            if direction != BOTH:
                if fits.has_zero:
                    centre = value + direction * offset.mean
                reach = offset.half_width()
                below, above = np.hypot(below, reach), np.hypot(above, reach)
            curves.append(
                Curve(
                    condition=at.condition,
                    direction=direction,
                    speed_m_s=at.speed_m_s,
                    friction_n=centre,
                    low_n=centre - np.hypot(below, NORMAL_95 * u),
                    high_n=centre + np.hypot(above, NORMAL_95 * u),
                    stderr_n=(below + above) / (2.0 * NORMAL_95),
                    u_systematic_n=u,
                    measured=at.measured,
                    cycles=at.cycles,
                    excluded=excluded,
                    contains_air=contains_air,
                    complete=fits.drift_share < CARRIED,
                )
            )
    return tuple(curves)


def in_newton(fit: CurveFit, found: Predicted) -> tuple[Array, Array, Array]:
    """Return the value, low and high of the statistical 95 % interval, N."""
    half = found.half_width()
    if fit.logarithmic:
        return np.exp(found.mean), np.exp(found.mean - half), np.exp(found.mean + half)
    return found.mean, found.mean - half, found.mean + half


def by_chance(fits: Fits, fit: CurveFit, at: CurveSpeeds) -> tuple[Array, Array, Array]:
    """Return the value, low and high of the 95 % interval by chance, N, with a least width from the scatter there.

    Neighbouring speeds and other pressures contribute, so the model may be more certain of a point than its own cycles
    are. This is accepted down to `OWN_SHARE`. Between the measured speeds the number of cycles is interpolated.
    """
    value, low, high = in_newton(fit, fit.at(at.number, at.speed_m_s))
    known, u = at.cycles > 0, np.log(at.speed_m_s)
    among = np.interp(u, u[known], at.cycles[known])
    least = OWN_SHARE * NORMAL_95 * deviation_n(fits, "cycle", value) / np.sqrt(among)
    return value, np.minimum(low, value - least), np.maximum(high, value + least)


@dataclass(frozen=True, eq=False)
class CurveSpeeds:
    """Speeds of one curve: the measured ones and some between, shape (m,) each.

    Attributes
    ----------
    number, index : int
        Index of the curve in the models, and of its condition among those of the points.
    condition : Condition
    speed_m_s : ndarray
    measured : ndarray of bool
    cycles : ndarray of int
        0 between the measured speeds.
    """

    number: int
    index: int
    condition: Condition
    speed_m_s: Array
    measured: NDArray[np.bool_]
    cycles: NDArray[np.int64]

    def only_measured(self) -> CurveSpeeds:
        """Leave out the speeds between."""
        arrays = {name: getattr(self, name)[self.measured] for name in ("speed_m_s", "measured", "cycles")}
        return replace(self, **arrays)


def curve_speeds(points: Points) -> tuple[CurveSpeeds, ...]:
    """Return the speeds of all curves, in the order of the models' numbers."""
    kept = sorted(set(points.condition[points.use].tolist()))
    return tuple(_speeds(points, number, index) for number, index in enumerate(kept))


def _speeds(points: Points, number: int, index: int) -> CurveSpeeds:
    members = points.use & (points.condition == index)
    levels = [members & (points.level == k) for k in sorted(set(points.level[members]))]
    speeds = np.array([points.reduced.speed_m_s[level].mean() for level in levels])
    counts = np.array([points.count[level].sum() for level in levels], dtype=np.int64)
    between = np.geomspace(speeds[0], speeds[-1], BETWEEN + 2)[1:-1] if speeds.size > 1 else np.zeros(0)
    apart = np.abs(between[:, None] / speeds[None, :] - 1.0).min(axis=1) > SAME_SPEED / 2.0
    every = np.concatenate([speeds, between[apart]])
    cycles = np.concatenate([counts, np.zeros(every.size - speeds.size, dtype=np.int64)])
    order = np.argsort(every)
    measured = order < speeds.size
    return CurveSpeeds(number, index, points.conditions[index], every[order], measured, cycles[order])


def _excluded(points: Points, condition: int) -> tuple[ExcludedPoint, ...]:
    found = []
    for i, reason in enumerate(points.reasons):
        if reason and points.condition[i] == condition:
            sides = points.reduced.data[i].sides.values()
            ripple = max(np.nan_to_num([v for s in sides for v in (s.ripple, s.piston_ripple)]))
            speed, friction = points.reduced.speed_m_s[i], points.reduced.friction_n[i]
            found.append(ExcludedPoint(float(speed), float(friction), reason, float(ripple)))
    return tuple(sorted(found, key=lambda p: p.speed_m_s))


def deviation_n(fits: Fits, source: str, friction_n: Array) -> Array:
    """Return the standard deviation that a source of chance adds to a single cycle, at these frictions, N."""
    fit = fits.friction
    sd = fit.fit.most_probable_sd(source) * fits.scale_n
    relative = fit.relative if source == "cycle" else float(fit.logarithmic)
    return sd * np.sqrt(relative * (friction_n / fits.level_n) ** 2 + 1.0 - relative)
