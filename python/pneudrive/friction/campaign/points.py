"""Cycles as points of curves over speed: common positions, conditions, speed levels, excluded cycles, repeats.

Cycles at high speed need a longer path to settle than slow ones. Friction varies over the path, so means over different
parts differ. The pattern over position is found from all cycles together. Each cycle's mean is then its value over the
common range.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.autocorrelation import stderrs_of_means
from pneudrive.estimate.groups import cells, levels
from pneudrive.estimate.moderate import moderate
from pneudrive.friction.bins import known_mean, pair_stderr
from pneudrive.friction.budget import chance_n, unseen_n
from pneudrive.friction.campaign.result import ExcludedPoint
from pneudrive.friction.conditions import PA_PER_BAR
from pneudrive.friction.level import BELOW_AMBIENT
from pneudrive.friction.sentences import Said, named
from pneudrive.friction.stick_slip import RIPPLE_LIMIT

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.campaign.reading import CampaignData
    from pneudrive.friction.conditions import Condition
    from pneudrive.friction.cycle import CycleData

    Array = NDArray[np.float64]
    Whole = NDArray[np.int64]

SWING_SHARE = 0.05  # of the friction: smaller swings are roughness or noise
SWING_FLOOR = 3.0  # times the noise while standing
UNRESOLVED = 0.4  # worst-case ripple of the piston's speed for a swing at the natural frequency
UNNAMED = "speed ripple"
STICK_SLIP = ("stick-slip", "force swing")
NAMES = (*STICK_SLIP, UNNAMED)


def unsteady(
    data: Sequence[CycleData], tares: Sequence[CycleData], stiffness_n_m: float | None, mass_kg: float
) -> tuple[str, ...]:
    """Return for each cycle the reason why sliding on the rig's spring was not steady; "" if it was steady.

    There are three signs. (1) The axis itself runs unevenly. (2) The piston's position, which is the axis
    position minus the deflection of the force sensor, is uneven. (3) If samples are too far apart for both, the force
    oscillates by much more than the sensor's noise. An oscillation of this size at the natural frequency of the rig
    would change the speed of the piston by 40 %.
    """
    floor = _noise(data, tares)
    return tuple(_reason(d, floor, stiffness_n_m, mass_kg) for d in data)


def _reason(d: CycleData, floor: float, stiffness_n_m: float | None, mass_kg: float) -> str:
    sides = list(d.sides.values())
    if any(s.ripple > RIPPLE_LIMIT for s in sides):
        return "stick-slip" if any(s.stick_slip for s in sides) else UNNAMED
    scatter = max(0.0 if np.isnan(s.scatter_n) else s.scatter_n for s in sides)
    if scatter < SWING_FLOOR * floor:
        return ""
    level = float(np.nanmean([abs(np.nanmean(s.balance_n)) for s in sides]))
    if scatter < SWING_SHARE * level:
        return ""
    if any(s.piston_ripple > RIPPLE_LIMIT for s in sides):
        return "stick-slip" if any(s.stick_slip for s in sides) else UNNAMED
    if stiffness_n_m and mass_kg:
        swing = scatter / np.sqrt(stiffness_n_m * mass_kg)
        if swing > UNRESOLVED * np.mean([abs(s.velocity_m_s) for s in sides]):
            return "force swing"
    return ""


def _noise(data: Sequence[CycleData], tares: Sequence[CycleData]) -> float:
    """Return the noise of the force at rest.

    Without zero runs, return the lower quartile of the slower half of the cycles.

    Slow noise is visible within a bin of a slow cycle, but not within a bin of a fast cycle.
    """
    if tares:
        return float(np.median([t.standing_sd_n for t in tares]))
    speeds = np.array([np.mean([abs(s.velocity_m_s) for s in d.sides.values()]) for d in data])
    scatters = np.array([max(float(np.nan_to_num(s.scatter_n)) for s in d.sides.values()) for d in data])
    slow = speeds <= np.median(speeds)
    return float(np.quantile(scatters[slow], 0.25))


NEGATIVE = "negative friction"
OUTLIER = "outlier"
SURE = 3.0  # standard errors below zero: negative beyond noise
NEIGHBOURS = 6  # nearest cycles in speed for the comparison of a cycle's friction
ENOUGH = 4
FAR = 10.0  # factor of friction to neighbouring speeds: an error of sensor, unit or range, not a seal


def implausible_friction(
    condition: NDArray[np.int64],
    speed_m_s: NDArray[np.float64],
    friction_n: NDArray[np.float64],
    stderr_n: NDArray[np.float64],
) -> tuple[str, ...]:
    """Return for each cycle of a campaign, shape (n,), the reason why its friction is impossible.

    "" if it is possible.
    """
    pace = np.log(np.maximum(speed_m_s, 1e-12))
    found: list[str] = [""] * friction_n.size
    for here in (np.flatnonzero(condition == k) for k in np.unique(condition)):
        order = here[np.argsort(pace[here], kind="stable")]
        for at, i in enumerate(order.tolist()):
            near = order[max(at - NEIGHBOURS, 0) : at + NEIGHBOURS + 1]
            near = near[near != i]
            near = near[np.argsort(np.abs(pace[near] - pace[i]), kind="stable")][:NEIGHBOURS]
            usual = float(np.median(np.abs(friction_n[near]))) if near.size >= ENOUGH else 0.0
            if friction_n[i] < -SURE * stderr_n[i]:
                found[i] = NEGATIVE
            elif usual > 0 and not usual / FAR <= abs(friction_n[i]) <= usual * FAR:
                found[i] = OUTLIER
    return tuple(found)


OTHER_SPEED = 1.5  # ratio of measured speed to that in the header, either way
#: A measured pressure that differs from the set one by more than this, or than this share of the gauge pressure,
#: or so many standard uncertainties of the sensor, whichever is most, is not an error of the regulator (assumed).
SET_PA, SET_SHARE, PRESSURE_ACCURACIES = 1e4, 0.1, 4.0


def suspicions(data: Sequence[CycleData], accuracy: Mapping[str, float], ambient_pa: float) -> Iterator[Said]:
    """Return sentences on cycles whose speeds or pressures differ from those of their plan.

    Parameters
    ----------
    data : sequence of CycleData
    accuracy : mapping
        Channel -> standard uncertainty, SI.
    ambient_pa : float
    """
    off = []
    for d in data:
        stated = d.plan.speed_m_s
        measured = float(np.mean([abs(s.velocity_m_s) for s in d.sides.values()])) if d.sides else float("nan")
        if stated and measured > 0 and not 1.0 / OTHER_SPEED <= measured / stated <= OTHER_SPEED:
            off.append((d.plan.key, measured / stated))
    if off:
        ratio = float(np.median([r for _, r in off]))
        yield "data.other_speed", {"count": len(off), "keys": named(key for key, _ in off), "ratio": ratio}
    yield from _set_and_measured(data, accuracy, ambient_pa)
    low = {
        d.plan.key: min(d.condition.pressure_a_pa, d.condition.pressure_b_pa)
        for d in data
        if min(d.condition.pressure_a_pa, d.condition.pressure_b_pa) < (1.0 - BELOW_AMBIENT) * ambient_pa
    }
    if low:
        lowest = min(low.values()) / PA_PER_BAR
        yield "data.below_ambient", {"count": len(low), "lowest": lowest, "ambient": ambient_pa / PA_PER_BAR}


def _set_and_measured(data: Sequence[CycleData], accuracy: Mapping[str, float], ambient_pa: float) -> Iterator[Said]:
    """Compare the pressures of the samples with the set ones in the headers.

    The mean of both directions is compared, because the moving air raises the pressure in one direction and lowers it
    in the other.
    """
    for side in ("a", "b"):
        name = f"pressure_{side}_pa"
        sure = PRESSURE_ACCURACIES * accuracy.get(name, 0.0)
        off, low = {}, {}
        for d in data:
            if not d.sides:
                continue
            planned = d.plan.pressures_pa.get(side, float("nan"))
            measured = float(np.mean([getattr(s, name) for s in d.sides.values()]))
            if abs(measured - planned) > max(SET_PA, SET_SHARE * abs(planned - ambient_pa), sure):
                off[d.plan.key] = measured - planned
            if measured < ambient_pa - max(SET_PA, sure) and planned >= (1.0 - BELOW_AMBIENT) * ambient_pa:
                low[d.plan.key] = measured
        if off:
            mean = float(np.median(list(off.values())))
            kind = "one_is_gauge" if abs(abs(mean) - ambient_pa) < 0.1 * ambient_pa else "not_as_set"
            values = {"mean": mean / PA_PER_BAR, "off": len(off), "count": len(data), "keys": named(off)}
            yield f"data.{kind}", dict(side=side, **values)
        if low:
            lowest = min(low.values()) / PA_PER_BAR
            values = {"count": len(low), "keys": named(low), "lowest": lowest, "ambient": ambient_pa / PA_PER_BAR}
            yield "data.vacuum", dict(side=side, **values)


ITERATIONS = 8
ENOUGH_CYCLES = 4  # least number for a pattern over position
COMMON_SHARE = 0.5  # of the cycles have settled in a bin of the common range
SMALL_FRICTION = 0.2  # of the median: least friction for a relative pattern
FREEDOM_PER_CYCLE = 10.0  # degrees of freedom of the noise of one cycle: independent stretches of about 60 bins


@dataclass(frozen=True, eq=False)
class Reduced:
    """Cycles with both directions, shape (n,) unless said otherwise; N.

    Attributes
    ----------
    data : tuple of CycleData
    speed_m_s : ndarray
        Mean of both directions.
    friction_n, offset_n, air_n : ndarray
        Half the difference and half the sum of the balance; half the difference of the chambers' force, positive
        against the motion.
    friction_stderr_n, offset_stderr_n, air_stderr_n, total_stderr_n : ndarray
        From the cycle alone: scatter of its strokes, at least the noise within them.
    position_m : ndarray, shape (bins,)
    common : ndarray of bool, shape (bins,)
    pattern : ndarray, shape (bins,)
        Friction over its mean in the common range less one; NaN in bins without data.
    offset_pattern_n : ndarray, shape (bins,)
    relative_n : ndarray, shape (n, bins)
        Friction of each cycle over its mean; NaN if nothing has settled.
    coverage : float
        Share of the whole way that the common range covers.
    """

    data: tuple[CycleData, ...]
    speed_m_s: Array
    friction_n: Array
    offset_n: Array
    air_n: Array
    friction_stderr_n: Array
    offset_stderr_n: Array
    air_stderr_n: Array
    total_stderr_n: Array
    position_m: Array
    common: NDArray[np.bool_]
    pattern: Array
    offset_pattern_n: Array
    relative_n: Array
    coverage: float

    @property
    def total_n(self) -> Array:
        """Half the difference of the force sensor's readings, without weight and inertia."""
        return self.friction_n + self.air_n

    @property
    def u_position(self) -> float:
        """Relative standard uncertainty of the common range's mean as an estimate of the whole stroke's mean."""
        return unseen_n(self.pattern[self.common], self.coverage)

    @property
    def u_position_offset_n(self) -> float:
        """The same for half the sum, N."""
        return unseen_n(self.offset_pattern_n[self.common], self.coverage)


def reduce(data: Sequence[CycleData], edges_m: Array, steady: NDArray[np.bool_]) -> Reduced:
    """Bring cycles with both directions to the common range of position.

    Parameters
    ----------
    data : sequence of CycleData
        With both sides.
    edges_m : ndarray, shape (bins + 1,)
    steady : ndarray of bool, shape (n,)
        Cycles used for the pattern: those without stick-slip.
    """
    up = np.array([d.sides[1].balance_n for d in data])
    down = np.array([d.sides[-1].balance_n for d in data])
    air = -np.array([d.sides[1].air_n - d.sides[-1].air_n for d in data]) / 2.0
    friction, offset = (up - down) / 2.0, (up + down) / 2.0
    air = np.where(np.isfinite(friction), air, np.nan)
    covered = np.isfinite(friction)
    tells = steady if steady.sum() >= ENOUGH_CYCLES else np.ones(len(data), dtype=bool)
    common: NDArray[np.bool_] = np.asarray(covered[tells].mean(axis=0) >= COMMON_SHARE)
    if not common.any():
        common = np.asarray(covered.any(axis=0))
    pattern = _relative_pattern(friction[tells], common)
    offset_pattern = _additive_pattern(offset[tells], common)
    mean_friction = _relative_means(friction, pattern, common)
    mean_offset = _additive_means(offset, offset_pattern, common)
    air_pattern = _additive_pattern(air[tells], common)
    mean_air = _additive_means(air, air_pattern, common)
    speed = np.array([(d.sides[1].velocity_m_s - d.sides[-1].velocity_m_s) / 2.0 for d in data])
    spare = np.sqrt(tells.sum() / max(tells.sum() - 1.0, 1.0)) if tells.sum() >= ENOUGH_CYCLES else 1.0
    rest = friction - mean_friction[:, None] * (1.0 + np.nan_to_num(pattern))
    rest_air = air - mean_air[:, None] - np.nan_to_num(air_pattern)
    rests = (rest, offset - mean_offset[:, None] - np.nan_to_num(offset_pattern), rest_air, rest + rest_air)
    scatter = np.array([pair_stderr(d.sides[1].spread, d.sides[-1].spread) for d in data])
    # The scatter of strokes is that of the balance: the air's force alone has only its noise.
    scatters = (scatter, scatter, np.full(len(data), np.nan), scatter)
    stderrs = [_by_chance(own, spare * r, common, speed) for own, r in zip(scatters, rests, strict=True)]
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = friction / mean_friction[:, None]
    return Reduced(
        data=tuple(data),
        speed_m_s=speed,
        friction_n=mean_friction,
        offset_n=mean_offset,
        air_n=mean_air,
        friction_stderr_n=stderrs[0],
        offset_stderr_n=stderrs[1],
        air_stderr_n=stderrs[2],
        total_stderr_n=stderrs[3],
        position_m=(edges_m[:-1] + edges_m[1:]) / 2.0,
        common=common,
        pattern=np.where(covered.any(axis=0), pattern, np.nan),
        offset_pattern_n=offset_pattern,
        relative_n=relative,
        coverage=float(common.mean()),
    )


def _relative_pattern(values: Array, common: NDArray[np.bool_]) -> Array:
    """Return the relative deviation from the mean of each row, mean over rows; zero with too few rows."""
    bins = values.shape[1]
    level = _additive_means(values, np.zeros(bins), common)
    if values.shape[0] < ENOUGH_CYCLES or level.min() < SMALL_FRICTION * np.median(level):
        return np.zeros(bins)
    pattern = np.zeros(bins)
    for _ in range(ITERATIONS):
        level = _relative_means(values, pattern, common)
        pattern = known_mean(values / level[:, None], axis=0) - 1.0
        pattern = np.nan_to_num(pattern - pattern[common].mean())
    return pattern


def _additive_pattern(values: Array, common: NDArray[np.bool_]) -> Array:
    pattern = np.zeros(values.shape[1])
    if values.shape[0] < ENOUGH_CYCLES:
        return pattern
    for _ in range(ITERATIONS):
        pattern = known_mean(values - _additive_means(values, pattern, common)[:, None], axis=0)
        pattern = np.nan_to_num(pattern - pattern[common].mean())
    return pattern


def _relative_means(values: Array, pattern: Array, common: NDArray[np.bool_]) -> Array:
    """Return the mean of each row over the common bins, with missing bins filled from the pattern."""
    here = np.isfinite(values) & _used(values, common)
    total = np.where(here, values, 0.0).sum(axis=1)
    return total / (here * (1.0 + pattern)).sum(axis=1)


def _additive_means(values: Array, pattern: Array, common: NDArray[np.bool_]) -> Array:
    here = np.isfinite(values) & _used(values, common)
    total = (np.where(here, values, 0.0) - here * pattern).sum(axis=1)
    return total / here.sum(axis=1)


def _used(values: Array, common: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the common bins; all bins in a row without them."""
    has = np.asarray((np.isfinite(values) & common).any(axis=1))
    return np.where(has[:, None], common[None, :], True)


def _by_chance(scatter: Array, rest: Array, common: NDArray[np.bool_], speed: Array) -> Array:
    """Return `chance_n` of each row's mean, shrunk towards its trend over speed."""
    used = _used(rest, common) & np.isfinite(rest)
    count, own = used.sum(axis=1), np.zeros(rest.shape[0])
    for number in np.unique(count[count > 0]).tolist():
        members = count == number
        own[members] = stderrs_of_means(rest[members][used[members]].reshape(-1, number))
    own = chance_n(scatter, own)
    known = own > 0.0
    if known.sum() < ENOUGH_CYCLES:
        return own
    out = own.copy()
    out[known] = np.sqrt(moderate(own[known] ** 2, np.full(int(known.sum()), FREEDOM_PER_CYCLE), speed[known]))
    return out


SATURATED_SHARE = 0.005  # of a cycle's samples: with more at the sensor's limit, the mean is not that of friction
SAME_SPEED = 0.05  # measured speeds closer than this are one point of the curve
BETWEEN = 24  # speeds of a curve between the measured ones
MOST_CYCLES = 600  # cycles that are fitted one by one: memory grows with their square, time with their cube
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
    def is_large(self) -> bool:
        """Whether there are too many points to fit each of them."""
        return bool(self.use.sum() > MOST_CYCLES)

    @property
    def order(self) -> Array:
        """Relative place of each cycle in the order of the campaign, 0 to 1, shape (n,)."""
        return np.array([d.plan.order for d in self.reduced.data])

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
    rig = reading.identity
    shaky = unsteady(paired, reading.tares, rig.stiffness_n_m, rig.mass_beyond_sensor_kg)
    reduced = reduce(paired, reading.edges_m, np.array([not reason for reason in shaky], dtype=bool))
    conditions = tuple(sorted({d.condition for d in paired}))
    condition = np.array([conditions.index(d.condition) for d in paired], dtype=np.int64)
    level = levels(np.log(reduced.speed_m_s), np.log1p(SAME_SPEED))
    speeds = np.array([reduced.speed_m_s[level == k].mean() for k in range(int(level.max()) + 1)])
    unlikely = implausible_friction(condition, reduced.speed_m_s, reduced.friction_n, reduced.friction_stderr_n)
    reasons = tuple(a or b for a, b in zip(_reasons(paired, shaky, condition, level), unlikely, strict=True))
    return Points(reduced, conditions, condition, level, speeds, reasons, unpaired, tuple((d,) for d in paired))


def _reasons(
    data: Sequence[CycleData], unsteady: Sequence[str], condition: NDArray[np.int64], level: NDArray[np.int64]
) -> tuple[str, ...]:
    """Return the reason why each cycle is not a point of F(v).

    Stick-slip concerns a condition and speed, not a single cycle.
    """
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


def condensed(points: Points) -> Points:
    """Group successive repeats of one condition, speed class and block.

    If there are very many groups, neighbouring blocks of the same levels are merged, then neighbouring speeds.
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
    """Return the number of each cycle's block, counted from 0 for each combination of mounting, seal and drive."""
    data = points.reduced.data
    ranks: dict[tuple[str, ...], dict[int, int]] = {}
    found = []
    for d in data:
        same = ranks.setdefault(d.condition.levels, {})
        found.append(same.setdefault(d.plan.block, len(same)))
    return np.array(found, dtype=np.int64)


def grouped(place: Whole, stretch: Whole, level: Whole, rows: int, cells: int) -> tuple[list[list[int]], int]:
    """Group successive cycles with the same place and level in the same part of the campaign.

    If there are very many groups, neighbouring parts of the campaign with the same levels are merged, then neighbouring
    levels.

    Parameters
    ----------
    place, stretch, level : ndarray of int, shape (n,)
        Index of each cycle in the order of execution, from 0.
    rows : int
        Approximate number of groups.
    cells : int
        Most combinations that stay separate.

    Returns
    -------
    list of list of int
        Members of each group, in the order of their middle cycles. Together they contain every cycle once.
    int
        Number of neighbouring levels that count as one.
    """
    stretches = levels = 1
    while np.unique(cell := _cells(place, stretch // stretches, level // levels)).size > cells:
        if stretches <= stretch.max():
            stretches += 1
        elif levels <= level.max():
            levels += 1
        else:
            break
    members: dict[int, list[int]] = {}
    for i, key in enumerate(cell.tolist()):
        members.setdefault(key, []).append(i)
    each = -(-cell.size // rows)
    groups = [some[k : k + each] for some in members.values() for k in range(0, len(some), each)]
    groups.sort(key=lambda group: group[len(group) // 2])
    return groups, levels


def _cells(place: Whole, stretch: Whole, level: Whole) -> Whole:
    """Return one number for each combination."""
    return (place * (level.max() + 1) + level) * (stretch.max() + 1) + stretch


def block_shares(points: Points) -> tuple[Array | None, str]:
    """Find blocks whose deviation can be separated from the levels: some levels have several blocks, or several days.

    Returns
    -------
    ndarray or None, shape (used, blocks)
        Share of each in the cycles of a point.
    str
        block, day, or "" without groups.
    """
    members = [some for some, use in zip(points.members, points.use, strict=True) if use]
    named = [some[0].condition.levels for some in members]
    of_levels = np.array([named.index(name) for name in named])
    kinds = {
        "block": [[d.plan.block for d in some] for some in members],
        "day": [[d.plan.day for d in some] for some in members],
    }
    for kind, labels in kinds.items():
        shares = shares_of(labels)
        if any((shares[of_levels == level] > 0.0).any(axis=0).sum() > 1 for level in set(of_levels.tolist())):
            return shares, kind
    return None, ""


def shares_of(labels: Sequence[Sequence[int]]) -> Array:
    """Return the fraction of each label in each row of the group, shape (rows, labels)."""
    column = {label: k for k, label in enumerate(sorted({label for row in labels for label in row}))}
    shares = np.zeros((len(labels), len(column)))
    for i, row in enumerate(labels):
        for label in row:
            shares[i, column[label]] += 1.0
    return shares / shares.sum(axis=1, keepdims=True)


@dataclass(frozen=True, eq=False)
class CurveSpeeds:
    """Speeds of one curve: the measured ones and some in between, shape (m,) each.

    Attributes
    ----------
    number, index : int
        Index of the curve in the models, and of its condition among those of the points.
    condition : Condition
    speed_m_s : ndarray
    measured : ndarray of bool
    cycles : ndarray of int
        0 between the measured speeds.
    excluded : tuple of ExcludedPoint
        Cycles of the condition that are not points of the curve, slowest first.
    """

    number: int
    index: int
    condition: Condition
    speed_m_s: Array
    measured: NDArray[np.bool_]
    cycles: NDArray[np.int64]
    excluded: tuple[ExcludedPoint, ...]


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
    excluded = _excluded(points, index)
    return CurveSpeeds(number, index, points.conditions[index], every[order], measured, cycles[order], excluded)


def _excluded(points: Points, condition: int) -> tuple[ExcludedPoint, ...]:
    found = []
    for i, reason in enumerate(points.reasons):
        if reason and points.condition[i] == condition:
            sides = points.reduced.data[i].sides.values()
            ripple = max(np.nan_to_num([v for s in sides for v in (s.ripple, s.piston_ripple)]))
            speed, friction = points.reduced.speed_m_s[i], points.reduced.friction_n[i]
            found.append(ExcludedPoint(float(speed), float(friction), reason, float(ripple)))
    return tuple(sorted(found, key=lambda p: p.speed_m_s))
