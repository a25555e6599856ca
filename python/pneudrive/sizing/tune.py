"""Tuning of needles and cushions of one choice of parts: maximises the smallest margin over a few cases.

The search refines a grid twice, without derivatives, because arrivals, impacts and check valves cause kinks. All grid
points run in parallel. The cases are nominal, slow and fast. About 1 % of the samples are slower than the slow case,
and 1 % are faster than the fast case.
"""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.constants import AIR_GAS_CONSTANT_J_KG_K, ANR_DENSITY_KG_M3, ANR_TEMPERATURE_K
from pneudrive.sizing.checks import energy_limit, peak_limit
from pneudrive.sizing.strokes import DRAWN, DriveStrokes, Setting, StrokeResults, StrokeRuns, points, run_all

if TYPE_CHECKING:
    from collections.abc import Generator, Iterable, Sequence

    from pneudrive.arrays import Array, Bools
    from pneudrive.sizing.choices import DriveChoice
    from pneudrive.sizing.task import SizingTask

    #: Generator that yields runs, receives their results, and returns the settings.
    Search = Generator[StrokeRuns, StrokeResults, Any]

#: First grid in the nominal case: conductances of the needle, relative to the one that is just sufficient with choked
#: flow; and openings of the cushion.
NEEDLES = (0.75, 0.92, 1.12, 1.4, 1.8, 2.5, 4.0)
CUSHIONS = (0.06, 0.25, 1.0)
#: Factors of needle and cushion in two refinements about the best settings, over all cases.
FINER = (((0.8, 1.0, 1.25), (0.5, 1.0, 2.0)), ((0.86, 0.93, 1.0, 1.07, 1.15), (0.8, 1.0, 1.22)))
#: Number of samples that are run before the last refinement, and number of worst samples per limit that become its
#: cases.
MORE, WORST = 24, 5
#: Largest number of rounds of this refinement, and worst-case margin at which it ends early.
ROUNDS, SETTLED = 3, 0.1
#: Number of cases that run together when few pairs are left: the SIMD lanes of two processors.
AT_ONCE = 16
#: Excess over the smallest margin above which a limit is not considered first for a pair (assumed).
DECIDES = 0.3
#: Time margin by which a smaller opening may be faster, due to solver errors and rebounds (assumed).
TIME_SLACK = 0.03
#: Nominal margin below which settings are not refined, and the other stroke is not considered.
SMALL = -0.15
#: Worst-case margin below which rough settings are not refined further.
FAR = -0.15
#: Position in each range for the slow and the fast case (assumed: about 1 % of the samples are more extreme).
SLOW, FAST = 0.15, 0.85
#: Sampled quantities of which a low value makes a stroke slow. For all others, a high value makes it slow.
_HELPS = ("supply pressure", "valve conductance", "tube conductance", "needle", "cushion")
#: Margin of a case whose stroke does not end.
NEVER = -10.0


class Tuned(NamedTuple):
    """Result of a search.

    Attributes
    ----------
    setting : Setting
    nominal : float
        Least margin of the nominal case over both strokes; below 0 if no setting does the task.
    short : tuple
        Limit with the smallest margin: name, limit and value, SI. It refers to the nominal case if this case misses the
        task, otherwise to all cases.
    least : float
        Least margin of all cases.
    air : float
        Mass drawn from the supply in both strokes of the nominal case, kg.
    times : tuple of float
        Times of the strokes in the nominal case, s. Empty if a stroke with fully open needles is too slow even in the
        fast case.
    """

    setting: Setting
    nominal: float
    short: tuple[str, float, float]
    least: float = NEVER
    air: float = 0.0
    times: tuple[float, ...] = ()


def cases(task: SizingTask, outward: bool) -> Array:
    """Return the sampled numbers of the cases nominal, slow and fast, shape (3, len(DRAWN))."""
    rows = np.full((3, len(DRAWN)), 0.5)
    low, high = task.spread.friction
    rows[0, DRAWN.index("friction")] = (1.0 - low) / (high - low) if low < 1.0 < high else 0.5
    pulls = (task.static_force_n if outward else -task.static_force_n) < 0.0
    for row, share in ((1, SLOW), (2, FAST)):
        for name in _HELPS:
            rows[row, DRAWN.index(name)] = share
        for name in ("friction", "valve time", "mass of the piston", "heat transfer"):
            rows[row, DRAWN.index(name)] = 1.0 - share
        rows[row, DRAWN.index("load")] = share if pulls else FAST
    return rows


def tune(strokes: DriveStrokes) -> Tuned:
    """Find the settings of both strokes of one choice."""
    rough = tune_all([strokes])
    return tune_all([strokes], rough)[0] if is_worth_more(rough[0]) else rough[0]


def is_worth_more(rough: Tuned) -> bool:
    """Return whether refined settings may meet the task."""
    return rough.nominal >= 0.0 and rough.least >= FAR


def tune_all(every: Sequence[DriveStrokes], rough: Sequence[Tuned] | None = None) -> list[Tuned]:
    """Find the settings of choices of one task. Their next runs are simulated together.

    Parameters
    ----------
    every : sequence of DriveStrokes
    rough : sequence of Tuned, optional
        Rough settings to refine. By default, rough settings are searched.
    """
    searches = [_rough(one) for one in every]
    if rough is not None:
        searches = [_fine(one, begun) for one, begun in zip(every, rough, strict=True)]
    asked = {place: next(one) for place, one in enumerate(searches)}
    found: dict[int, Tuned] = {}
    while asked:
        results = run_all(list(asked.values()))
        due, asked = dict(zip(asked, results, strict=True)), {}
        for place, result in due.items():
            try:
                asked[place] = searches[place].send(result)
            except StopIteration as end:  # noqa: PERF203 - a run takes longer
                found[place] = end.value
    return [found[place] for place in range(len(every))]


def _rough(strokes: DriveStrokes) -> Search:
    """Search rough settings of a choice: yield runs, receive their results, return the settings.

    If a stroke with fully open needles is too slow even in the fast case, no search is made, because no setting is
    faster.
    """
    task = strokes.task
    for outward, limit in ((True, task.outward_s), (False, task.back_s)):
        opened = yield StrokeRuns(strokes, outward, cases(task, outward)[2:], np.ones((1, 4)))
        time = float(opened.time[0])
        if time > limit:
            margin = 1.0 - time / limit if np.isfinite(time) else NEVER
            return Tuned(Setting(), margin, (f"time {'out' if outward else 'back'}", limit, time), margin)
    every, setting = [], Setting()
    for outward in (True, False):
        rows, grid = cases(task, outward), product(*_grid(strokes, outward))
        best = yield from _best(strokes, outward, setting, grid, rows[:1])
        if best.nominal >= SMALL:
            setting = best.setting
            best = yield from _best(strokes, outward, setting, _near(strokes, outward, setting, FINER[0]), rows)
        every, setting = [*every, best], best.setting
        if best.nominal < SMALL:
            break
    return _joined(every)


def _fine(strokes: DriveStrokes, rough: Tuned) -> Search:
    """Refine rough settings of a choice, with more cases."""
    every, setting, draws = [], rough.setting, points(MORE)
    for outward in (True, False):
        best, rows = rough, cases(strokes.task, outward)
        for _ in range(ROUNDS):
            asked = StrokeRuns(strokes, outward, draws, np.tile(np.array(setting), (MORE, 1)))
            named = _margins(strokes.task, strokes.choice, outward, (yield asked))
            worst = np.unique([margins.argsort()[:WORST] for *_, margins in named])
            rows = np.unique(np.vstack([rows[3:], draws[worst]]), axis=0)  # with the openings of the previous round
            rows = np.vstack([cases(strokes.task, outward), rows])
            near = _near(strokes, outward, setting, FINER[1])
            best = yield from _best(strokes, outward, setting, near, rows)
            is_settled, setting = best.setting == setting, best.setting
            if is_settled or best.least >= SETTLED:
                break
        every.append(best)
    return _joined(every)


def _joined(every: Sequence[Tuned]) -> Tuned:
    """Return the settings of both strokes as one result."""
    nominal, least = min(one.nominal for one in every), min(one.least for one in every)
    worse = min(every, key=lambda one: one.nominal if nominal < 0.0 else one.least)
    air, times = sum(one.air for one in every), tuple(one.times[0] for one in every)
    return Tuned(every[-1].setting, nominal, worse.short, least, air, times)


def _grid(strokes: DriveStrokes, outward: bool) -> tuple[Sequence[float], Sequence[float]]:
    """Return the first grid of openings of needle and cushion."""
    choice = strokes.choice
    needles = _needles(strokes, outward) if choice.is_throttled else [1.0]
    return needles, CUSHIONS if choice.is_cushioned else (1.0,)


def _near(
    strokes: DriveStrokes, outward: bool, setting: Setting, finer: tuple[tuple[float, ...], ...]
) -> Iterable[tuple[float, ...]]:
    """Return openings near those of a setting."""
    grid = _grid(strokes, outward)
    factors = [each if len(one) > 1 else (1.0,) for each, one in zip(finer, grid, strict=True)]
    own = setting[:2] if outward else setting[2:]
    return dict.fromkeys(tuple(min(a * b, 1.0) for a, b in zip(own, pair, strict=True)) for pair in product(*factors))


def _needles(strokes: DriveStrokes, outward: bool) -> list[float]:
    """Return the first openings of the needle: about C = A L / (t rho0 R (T0 T)^0.5), and fully open."""
    task, choice = strokes.task, strokes.choice
    limit = task.outward_s if outward else task.back_s
    speed = ANR_DENSITY_KG_M3 * AIR_GAS_CONSTANT_J_KG_K * math.sqrt(ANR_TEMPERATURE_K * task.ambient.temperature_k)
    needed = choice.areas_m2[1 if outward else 0] * task.stroke_m / (limit * speed)
    whole = choice.flow_control.numbers["needle_conductance"]
    return sorted({min(one * needed / whole, 1.0) for one in NEEDLES} | {1.0})


def _best(
    strokes: DriveStrokes,
    outward: bool,
    setting: Setting,
    pairs: Iterable[tuple[float, ...]],
    rows: Array,
) -> Search:
    """Return the pair of needle and cushion whose worst case has the largest margin.

    Pairs that cannot be the best are not run in all cases. The result is the same as with all runs, as long as no
    smaller opening is faster by more than `TIME_SLACK`.
    """
    places = ("needle_out", "cushion_out") if outward else ("needle_back", "cushion_back")
    openings = np.array(list(pairs))
    settings = [setting._replace(**dict(zip(places, pair, strict=True))) for pair in openings.tolist()]
    shares, shape = np.array(settings), (len(settings), len(rows))
    known = StrokeResults(*np.full((len(StrokeResults._fields), len(settings) * len(rows)), np.nan))
    is_run, named, table = np.zeros(shape, bool), [], np.array([])
    todo = np.array([one == setting for one in settings])[:, None] | is_run
    if len(rows) == 1:
        todo = (openings[:, 1] == openings[:, 1].max())[:, None]
    while todo.any():
        one, row = np.nonzero(todo)
        found = yield StrokeRuns(strokes, outward, rows[row], shares[one])
        for column, values in zip(known, found, strict=True):
            column[todo.ravel()] = values
        is_run |= todo
        named = _margins(strokes.task, strokes.choice, outward, known)
        table = np.where(is_run, [margins.reshape(shape) for *_, margins in named], np.inf)
        todo = _next_runs(table, is_run, openings)
    whole = np.flatnonzero(is_run.all(axis=1)).tolist()
    best = max(whole, key=lambda one: (table[:, one].min(), table[:, one, 0].min()))
    if outward and (held := strokes.task.holding_force_n):  # no setting changes it
        named.append(("holding force", held, known.force, known.force / held - 1.0))
    of_best, at = np.array([margins.reshape(shape)[best] for *_, margins in named]), best * len(rows)
    nominal, least = float(of_best[:, 0].min()), float(of_best.min())
    shown = of_best[:, :1] if nominal < 0.0 else of_best
    worst, case = np.unravel_index(shown.argmin(), shown.shape)
    name, limit, values, _ = named[worst]
    short = (name, limit, float(values[at + case]))
    return Tuned(settings[best], nominal, short, least, float(known.air[at]), (float(known.time[at]),))


def _next_runs(table: Array, is_run: Bools, openings: Array) -> Bools:
    """Return the cases of the pairs that may be the best, shape (pairs, cases); none if the best pair is known.

    The bound of a pair is its smallest margin in the cases that have run. In the nominal case, the time margin of a
    pair with wider cushion and needle is also a bound. This does not hold for a half-closed cushion: a needle that
    slows the piston down before the cushion may shorten the stroke.

    Parameters
    ----------
    table : ndarray, shape (limits, pairs, cases)
        Margins, the time first; infinite for cases that have not run.
    is_run : ndarray, shape (pairs, cases)
    openings : ndarray, shape (pairs, 2)
    """
    bounds, is_whole = table.min(axis=(0, 2)), is_run.all(axis=1)
    if is_run.shape[1] == 1:
        needle, cushion = openings.T
        is_wider = (needle[:, None] <= needle) & (cushion == cushion.max())
        bounds = np.minimum(bounds, np.where(is_wider, table[0, :, 0], np.inf).min(axis=1) + TIME_SLACK)
    least = bounds[is_whole].max()
    left = ~is_run & (~is_whole & (bounds >= least))[:, None]
    if is_run.any(axis=1).sum() == 1:  # the others run the cases first that decide about this one
        of_first = table[:, is_whole][:, 0]
        deciding = of_first[of_first.min(axis=1) <= least + DECIDES].argmin(axis=1)
        left[:, np.setdiff1d(np.arange(is_run.shape[1]), deciding)] = False
        return left
    order = np.argsort(-bounds, kind="stable")
    number = np.empty(left.shape, int)
    number[order] = left[order].cumsum().reshape(left.shape)
    return left & (number <= AT_ONCE)


def _margins(
    task: SizingTask, choice: DriveChoice, outward: bool, found: StrokeResults
) -> list[tuple[str, float, Array, Array]]:
    """Return name, limit, values and margins of the limits that the needles affect."""
    way, limit = ("out", task.outward_s) if outward else ("back", task.back_s)
    named = [(f"time {way}", limit, found.time)]
    if task.end_speed_m_s is not None:
        named.append((f"end speed {way}", task.end_speed_m_s, found.end_speed))
    named.append((f"energy {way}", energy_limit(task, choice)[0], found.energy))
    peak = peak_limit(task, choice)
    if peak is not None:
        named.insert(1, ("peak pressure", peak, found.peak_pressure))
    arrived = np.isfinite(found.time)
    return [(name, most, values, np.where(arrived, 1.0 - values / most, NEVER)) for name, most, values in named]
