"""Cycles as points of curves over speed: common positions, conditions, speed levels, excluded cycles, repeats.

Fast cycles need a longer path to settle than slow cycles. Because friction varies over position, means over different
parts of the stroke are not comparable. The pattern over position is therefore estimated from all cycles together, and
the mean of each cycle is converted to the common range.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneudrive.arrays import Array, Bools, Columns, Ints, Row
from pneudrive.estimate.autocorrelation import cells, levels, means, moderate, stderr_of_mean
from pneudrive.friction.bins import known_mean, pair_stderr
from pneudrive.friction.campaign.reading import CampaignData, CycleTable
from pneudrive.friction.friction_map import PA_PER_BAR, Condition
from pneudrive.friction.level import BELOW_AMBIENT, chance_n
from pneudrive.friction.sentences import Statement, named, say
from pneudrive.friction.stick_slip import RIPPLE_LIMIT

SWING_SHARE = 0.05  # of the friction: smaller swings are roughness or noise
SWING_FLOOR = 3.0  # times the noise while standing
UNRESOLVED = 0.4  # worst-case ripple of the piston's speed for a swing at the natural frequency
UNNAMED = "speed ripple"
STICK_SLIP = ("stick-slip", "force swing")
NAMES = (*STICK_SLIP, UNNAMED)


def unsteady(cycles: CycleTable, tares: CycleTable, stiffness_n_m: float | None, mass_kg: float) -> NDArray:
    """Return for each cycle the reason why sliding was not steady; "" for steady sliding.

    There are three signs. (1) The axis moves unevenly. (2) The piston moves unevenly. Its position is the axis position
    minus the deflection of the force sensor. (3) The force oscillates by much more than the sensor's noise. Sign (3) is
    sufficient alone if such an oscillation at the natural frequency of the rig would change the speed of the piston by
    more than 40 %. Samples may be too far apart for (1) and (2).
    """
    scatter, speed = np.nan_to_num(cycles["scatter_n"]).max(axis=1), cycles.over_sides("velocity_m_s")
    # Without zero runs: slow noise is visible within a bin of a slow cycle, but not within a bin of a fast cycle.
    slow = speed <= np.median(speed)
    floor = np.median(tares["standing_sd_n"]) if len(tares) else np.quantile(scatter[slow], 0.25)
    level = known_mean(np.abs(known_mean(cycles["balance_n"], axis=2)), axis=1)
    swings = (scatter >= SWING_FLOOR * floor) & (scatter >= SWING_SHARE * level)
    uneven, piston = ((cycles[name] > RIPPLE_LIMIT).any(axis=1) for name in ("ripple", "piston_ripple"))
    known = np.where((cycles["stick_slip"] == 1.0).any(axis=1), STICK_SLIP[0], UNNAMED)
    hidden = np.zeros(len(cycles), dtype=bool)
    if stiffness_n_m and mass_kg:
        hidden = swings & (scatter / np.sqrt(stiffness_n_m * mass_kg) > UNRESOLVED * speed)
    return np.where(uneven | (swings & piston), known, np.where(hidden, STICK_SLIP[1], "")).astype(object)


NEGATIVE = "negative friction"
OUTLIER = "outlier"
SURE = 3.0  # standard errors below zero: negative beyond noise
NEIGHBOURS = 6  # nearest cycles in speed for the comparison of a cycle's friction
FAR = 10.0  # factor of friction to neighbouring speeds: an error of sensor, unit or range, not a seal


def implausible_friction(condition: Ints, speed_m_s: Array, friction_n: Array, stderr_n: Array) -> NDArray:
    """Return for each cycle the reason why its friction is implausible; "" for plausible friction."""
    pace = np.log(np.maximum(speed_m_s, 1e-12))
    found = np.full(friction_n.size, "", dtype=object)
    for here in (np.flatnonzero(condition == k) for k in np.unique(condition)):
        order = here[np.argsort(pace[here], kind="stable")]
        for at, i in enumerate(order.tolist()):
            near = order[max(at - NEIGHBOURS, 0) : at + NEIGHBOURS + 1]
            near = near[near != i]
            near = near[np.argsort(np.abs(pace[near] - pace[i]), kind="stable")][:NEIGHBOURS]
            usual = np.median(np.abs(friction_n[near])) if near.size >= ENOUGH_CYCLES else 0.0
            if friction_n[i] < -SURE * stderr_n[i]:
                found[i] = NEGATIVE
            elif usual > 0 and not usual / FAR <= abs(friction_n[i]) <= usual * FAR:
                found[i] = OUTLIER
    return found


OTHER_SPEED = 1.5  # ratio of measured speed to that in the header, either way
#: Deviation from the set pressure that a regulator error cannot explain: the largest of an absolute value, Pa, a
#: fraction of the gauge pressure, and a number of standard uncertainties of the sensor (assumed).
SET_PA, SET_SHARE, PRESSURE_ACCURACIES = 1e4, 0.1, 4.0


def suspicions(cycles: CycleTable, accuracy: Mapping[str, float], ambient_pa: float) -> Iterator[Statement]:
    """Return statements on cycles whose speed or pressures deviate from the plan.

    Air flow raises the pressure in one direction and lowers it in the other. The mean of both directions is therefore
    compared with the set pressures in the headers.

    Parameters
    ----------
    cycles : CycleTable
    accuracy : mapping
        Channel -> standard uncertainty, SI.
    ambient_pa : float
    """

    def of(kind: str, doubtful: Bools, **values: object) -> Statement:
        return say(kind, count=doubtful.sum(), keys=named(cycles["key"][doubtful]), **values)

    ratio = cycles.over_sides("velocity_m_s") / cycles["set_speed_m_s"]
    off = np.isfinite(ratio) & (ratio > 0) & ~((ratio >= 1.0 / OTHER_SPEED) & (ratio <= OTHER_SPEED))
    if off.any():
        yield of("data.other_speed", off, ratio=np.median(ratio[off]))
    for side in "ab":
        name = f"pressure_{side}_pa"
        least = max(SET_PA, PRESSURE_ACCURACIES * accuracy.get(name, 0.0))
        planned, measured = cycles[f"set_{side}_pa"], known_mean(cycles[name], axis=1)
        away = measured - planned
        off = np.abs(away) > np.maximum(SET_SHARE * np.abs(planned - ambient_pa), least)
        if off.any():
            yield of("data.not_as_set", off, side=side, mean=np.median(away[off]) / PA_PER_BAR, all=len(cycles))
        low = (measured < ambient_pa - least) | (planned < (1.0 - BELOW_AMBIENT) * ambient_pa)
        if low.any():
            lowest = np.fmin(measured, planned)[low].min() / PA_PER_BAR
            yield of("data.below_ambient", low, side=side, lowest=lowest, ambient=ambient_pa / PA_PER_BAR)


ITERATIONS = 8
ENOUGH_CYCLES = 4  # least number for a pattern over position
COMMON_SHARE = 0.5  # of the cycles have settled in a bin of the common range
SMALL_FRICTION = 0.2  # of the median: least friction for a relative pattern
FREEDOM_PER_CYCLE = 10.0  # degrees of freedom of the noise of one cycle: independent stretches of about 60 bins


def reduce(cycles: CycleTable, edges_m: Array, steady: Bools) -> tuple[Row, Columns]:
    """Convert the means of cycles with both directions to the common range of position.

    Parameters
    ----------
    cycles : CycleTable
        Cycles with both directions.
    edges_m : ndarray, shape (bins + 1,)
    steady : ndarray of bool, shape (n,)
        Cycles without stick-slip, from which the pattern is estimated.

    Returns
    -------
    dict of ndarray, shape (bins,)
        `CurvePoints.pattern`.
    dict of ndarray, shape (n,)
        Further columns of `CurvePoints`, from ``speed_m_s`` to ``relative_n``.
    """
    (up, down), (air_up, air_down) = (np.moveaxis(cycles[name], 1, 0) for name in ("balance_n", "air_n"))
    friction = (up - down) / 2.0
    covered = np.isfinite(friction)
    air = np.where(covered, -(air_up - air_down) / 2.0, np.nan)
    tells = steady if steady.sum() >= ENOUGH_CYCLES else np.ones(len(cycles), dtype=bool)
    common: Bools = covered[tells].mean(axis=0) >= COMMON_SHARE
    if not common.any():
        common = covered.any(axis=0)
    speed = (cycles["velocity_m_s"][:, 0] - cycles["velocity_m_s"][:, 1]) / 2.0
    columns, patterns, rests = {"speed_m_s": speed}, {}, {}
    for name, values in {"friction": friction, "offset": (up + down) / 2.0, "air": air}.items():
        relative = name == "friction"
        patterns[name] = pattern = _pattern(values[tells], common, relative=relative)
        columns[f"{name}_n"] = mean = _means(values, pattern, common, relative=relative)
        level = mean[:, None]
        rests[name] = values - level * (1.0 + pattern) if relative else values - level - pattern
    rests["total"] = rests["friction"] + rests["air"]
    spare = np.sqrt(tells.sum() / max(tells.sum() - 1.0, 1.0)) if tells.sum() >= ENOUGH_CYCLES else 1.0
    scatter = pair_stderr(cycles["deviation_n"], cycles["effective"])
    for name, rest in rests.items():
        # The scatter of strokes is that of the balance: the air's force alone has only its noise.
        own = np.full(len(cycles), np.nan) if name == "air" else scatter
        noise = [stderr_of_mean(row[used]) for row, used in zip(spare * rest, _used(rest, common), strict=True)]
        stderr = chance_n(own, np.array(noise))
        known = stderr > 0.0
        if known.sum() >= ENOUGH_CYCLES:  # shrunk towards its trend over speed
            freedom = np.full(known.sum(), FREEDOM_PER_CYCLE)
            stderr[known] = np.sqrt(moderate(stderr[known] ** 2, freedom, speed[known]))
        columns[f"{name}_stderr_n"] = stderr
    with np.errstate(invalid="ignore", divide="ignore"):
        columns["relative_n"] = friction / columns["friction_n"][:, None]
    return {
        "position_m": (edges_m[:-1] + edges_m[1:]) / 2.0,
        "common": common,
        "friction": np.where(covered.any(axis=0), patterns["friction"], np.nan),
        "offset_n": patterns["offset"],
    }, columns


def _pattern(values: Array, common: Bools, *, relative: bool = False) -> Array:
    """Return the pattern over position: the deviation from each row's mean, averaged over rows; zero with too few rows.

    A relative pattern is zero if a row has little friction.
    """
    pattern = np.zeros(values.shape[1])
    level = _means(values, pattern, common)
    if values.shape[0] < ENOUGH_CYCLES or (relative and level.min() < SMALL_FRICTION * np.median(level)):
        return pattern
    for _ in range(ITERATIONS):
        level = _means(values, pattern, common, relative=relative)[:, None]
        pattern = known_mean(values / level if relative else values - level, axis=0) - float(relative)
        pattern = np.nan_to_num(pattern - pattern[common].mean())
    return pattern


def _means(values: Array, pattern: Array, common: Bools, *, relative: bool = False) -> Array:
    """Return the mean of each row over the common bins, with missing bins filled from the pattern."""
    here = _used(values, common)
    added, share = (0.0, 1.0 + pattern) if relative else (pattern, 1.0)
    return (np.where(here, values, 0.0) - here * added).sum(axis=1) / (here * share).sum(axis=1)


def _used(values: Array, common: Bools) -> Bools:
    """Mark the common bins with a value in each row. Rows without common bins use all bins with a value."""
    known = np.isfinite(values)
    shared = known & common
    return np.where(shared.any(axis=1, keepdims=True), shared, known)


SATURATED_SHARE = 0.005  # of a cycle's samples: with more at the sensor's limit, the mean is not that of friction
SAME_SPEED = 0.05  # measured speeds closer than this are one point of the curve
MOST_CYCLES = 600  # cycles that are fitted one by one: memory grows with their square, time with their cube
MOST_CELLS = 1200  # condition, speed level and block: beyond it, neighbouring blocks are joined


@dataclass(frozen=True, eq=False)
class CurvePoints(CycleTable):
    """Cycles with both directions, and the selection of points of F(v).

    Further columns:

    - ``speed_m_s``: mean of both directions.
    - ``friction_n``, ``offset_n``: half the difference and half the sum of the balances of both directions.
    - ``air_n``: half the difference of the pressure force between both directions, positive against the motion.
    - ``friction_stderr_n``, ``offset_stderr_n``, ``air_stderr_n``, ``total_stderr_n``: standard errors from the
      scatter of the strokes, at least the noise within strokes.
    - ``relative_n``: friction in each bin divided by its mean over the bins. NaN without settled samples.
    - ``curve``, ``level``: numbers of the condition and of the speed level. Levels ascend.
    - ``cell``: number of the combination of condition and speed level.
    - ``reason``: reason for exclusion from F(v). Empty for a point of F(v).

    Attributes
    ----------
    pattern : dict of ndarray, shape (bins,)
        Friction over position, common to all cycles: ``position_m``; ``common``, the mask of the common range;
        ``friction`` divided by its mean in the common range, minus 1 (NaN in bins without data); ``offset_n``.
    conditions : tuple of Condition
        Conditions of the cycles, each once.
    level_speeds_m_s : ndarray, shape (levels,)
    whole : CycleTable
        All cycles with both directions.
    members : tuple of ndarray of int, length n
        Rows of `whole` that form each point: several if a large campaign was condensed.
    """

    pattern: Row
    conditions: tuple[Condition, ...]
    level_speeds_m_s: Array
    whole: CycleTable
    members: tuple[NDArray[np.intp], ...]

    @property
    def count(self) -> Array:
        """Number of cycles of each point (shape (n,))."""
        return np.array([some.size for some in self.members], dtype=float)

    @property
    def use(self) -> Bools:
        """Mask of the cycles that are points of F(v)."""
        return self["reason"] == ""

    @property
    def assemblies(self) -> dict[str, Bools]:
        """Mounting, seal and drive -> mask of their points of F(v)."""
        titles = np.array([c.title for c in self.conditions])
        return {title: self.use & (titles == title)[self["curve"]] for title in dict.fromkeys(titles.tolist())}

    def labels(self, name: str, rows: NDArray[np.intp]) -> list[list]:
        """Return for each of these points the values of a column in all its cycles."""
        return [self.whole[name][self.members[i]].tolist() for i in rows]

    def condensed(self) -> CurvePoints:
        """Group successive repeats of one condition, speed class and block, if there are too many points to fit each.

        If there are very many groups, neighbouring blocks of the same levels are merged.
        """
        used = np.flatnonzero(self.use)
        if used.size <= MOST_CYCLES:
            return self
        stretch = np.zeros(len(self), dtype=np.int64)  # blocks, counted from 0 in each assembly
        for members in self.assemblies.values():
            stretch[members] = np.unique(self["block"][members], return_inverse=True)[1]
        groups = [used[group] for group in grouped(self["cell"][used], stretch[used], MOST_CYCLES, MOST_CELLS)]
        means = {}
        for name in ("speed_m_s", "friction_n", "offset_n", "air_n"):
            means[name] = np.array([self[name][group].mean() for group in groups])
        for name in ("friction_stderr_n", "offset_stderr_n", "air_stderr_n", "total_stderr_n"):
            means[name] = np.array([np.sqrt(np.sum(self[name][group] ** 2)) / group.size for group in groups])
        middle = np.array([group[group.size // 2] for group in groups])
        return replace(self.at(middle).having(**means), members=tuple(groups))


def points_of(reading: CampaignData) -> CurvePoints | None:
    """Return the sliding cycles as points; None if no cycle has both directions."""
    cycles = reading.sliding.at(np.flatnonzero(reading.sliding.moves.all(axis=1)))
    rig = reading.identity
    if not len(cycles):
        return None
    shaky = unsteady(cycles, reading.tares, rig.stiffness_n_m, rig.mass_beyond_sensor_kg)
    pattern, columns = reduce(cycles, reading.edges_m, shaky == "")
    conditions = tuple(sorted(set(cycles["condition"])))
    curve = np.array([conditions.index(c) for c in cycles["condition"]], dtype=np.int64)
    speed = columns["speed_m_s"]
    level = levels(np.log(speed), np.log1p(SAME_SPEED))
    speeds = np.array([speed[level == k].mean() for k in range(level.max() + 1)])
    # Stick-slip in some cycles excludes all cycles at their condition and speed.
    cell = cells(curve, level)
    first = {int(c): why for c, why in zip(cell[::-1], shaky[::-1], strict=True) if why}
    (share,) = means(cell, shaky != "")
    saturated = np.array([flags.get("saturated", 0) for flags in cycles["flags"]])
    spoiled = np.where(saturated > SATURATED_SHARE * cycles["samples"].sum(axis=1), "saturated", "")
    common = np.array([first.get(c, "") for c in cell.tolist()], dtype=object)
    reason = np.where(shaky != "", shaky, np.where(share[cell] > 0.5, common, spoiled)).astype(object)
    unlikely = implausible_friction(curve, speed, columns["friction_n"], columns["friction_stderr_n"])
    columns |= {"curve": curve, "level": level, "cell": cell, "reason": np.where(reason == "", unlikely, reason)}
    alone = tuple(np.arange(len(cycles))[:, None])
    return CurvePoints(cycles.columns | columns, pattern, conditions, speeds, cycles, alone)


def grouped(place: Ints, stretch: Ints, rows: int, most: int) -> list[list[int]]:
    """Group successive cycles at one point in the same part of the campaign.

    If there are very many groups, neighbouring parts of the campaign are merged.

    Parameters
    ----------
    place, stretch : ndarray of int, shape (n,)
        For each cycle, in the order of execution: index of its point, and index of its part of the campaign.
    rows : int
        Approximate number of groups.
    most : int
        Number of combinations of point and part beyond which parts are merged.

    Returns
    -------
    list of list of int
        Members of each group, in the order of their middle cycles. Together they contain every cycle once.
    """
    stretches = 1
    while (cell := cells(place, stretch // stretches)).max() >= most and stretches <= stretch.max():
        stretches += 1
    order, each = np.argsort(cell, kind="stable"), -(-cell.size // rows)
    members = np.split(order, np.flatnonzero(np.diff(cell[order])) + 1)
    groups = [some[k : k + each].tolist() for some in members for k in range(0, some.size, each)]
    return sorted(groups, key=lambda group: group[len(group) // 2])


def shares_of(labels: Sequence[Sequence[int]]) -> Array:
    """Return the fraction of each label in each group (shape (groups, labels))."""
    names = sorted({label for row in labels for label in row})
    counts = np.array([[row.count(name) for name in names] for row in labels], dtype=float)
    counts = counts.reshape(len(labels), len(names))
    return counts / counts.sum(axis=1, keepdims=True)
