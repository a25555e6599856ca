"""Settings of needles and cushions of one choice of parts: those with which the worst of a few cases keeps most margin.

A search without derivatives over a grid that is refined twice: arrivals, impacts and check valves make kinks, and the
grid runs side by side. Cases are nominal, slow and fast; the last two lie where about 1 % of the draws lie beyond.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.sizing.judge import peak_limit
from pneudrive.sizing.strokes import DRAWN, Setting, StrokeRuns, points, run_all

if TYPE_CHECKING:
    from collections.abc import Generator, Iterable, Sequence

    from numpy.typing import NDArray

    from pneudrive.sizing.choices import DriveChoice
    from pneudrive.sizing.strokes import DriveStrokes, StrokeResults
    from pneudrive.sizing.task import SizingTask

    Array = NDArray[np.float64]
    #: Yields runs, takes their results.
    Search = Generator[StrokeRuns, StrokeResults, Any]

#: Openings that are tried first in the nominal case, and the factors of two refinements about the best of them in all
#: cases.
NEEDLES = tuple(map(float, np.geomspace(0.004, 1.0, 8)))
CUSHIONS = (0.06, 0.25, 1.0)
FINER = ((0.65, 1.0, 1.5), (0.82, 1.0, 1.22))
#: Draws beside the cases in the last refinement.
MORE = 6
#: With a nominal margin below this, nothing is refined.
HOPELESS = -0.3
#: Shares of each range in the slow and in the fast case (assumed: several numbers at once there are as rare as 1 %).
SLOW, FAST = 0.15, 0.85
#: Speed at the end, over the mean speed, that counts as all of the limit where a task sets none.
SOFT = 3.0
SOFT_NAME = "end speed without a limit"
#: What is drawn, where a low value makes a stroke slow; the others the other way round.
_HELPS = ("supply pressure", "valve conductance", "tube conductance", "needle", "cushion")
#: Margin of a case that does not arrive.
NEVER = -10.0


class Tuned(NamedTuple):
    """Result of a search.

    Attributes
    ----------
    setting : Setting
    nominal : float
        Least margin of the nominal case, both ways; below 0 where no setting does the task.
    short : tuple
        The limit that it misses or comes nearest to, its limit and its value, SI.
    least : float
        Least margin of all cases.
    air : float
        Mass drawn from the supply in the nominal case, both ways, kg.
    times : tuple of float
        Of the strokes in the nominal case, s.
    """

    setting: Setting
    nominal: float
    short: tuple[str, float, float]
    least: float = NEVER
    air: float = 0.0
    times: tuple[float, ...] = ()


def cases(task: SizingTask, outward: bool) -> Array:
    """Return the draws of the cases nominal, slow and fast, shape (3, len(DRAWN))."""
    rows = np.full((3, len(DRAWN)), 0.5)
    low, high = task.spread.friction
    rows[0, DRAWN.index("friction")] = (1.0 - low) / (high - low) if low < 1.0 < high else 0.5
    pulls = (task.static_force_n if outward else -task.static_force_n) < 0.0
    for row, share in ((1, SLOW), (2, FAST)):
        for name in _HELPS:
            rows[row, DRAWN.index(name)] = share
        for name in ("friction", "valve time", "mass of the piston"):
            rows[row, DRAWN.index(name)] = 1.0 - share
        rows[row, DRAWN.index("load")] = share if pulls else FAST
    return rows


def tune(strokes: DriveStrokes) -> Tuned:
    """Find the settings of both strokes of one choice."""
    return tune_all([strokes])[0]


def tune_all(every: Sequence[DriveStrokes], is_quick: bool = False) -> list[Tuned]:
    """Find the settings of choices of one task; their next runs are simulated together.

    Parameters
    ----------
    every : sequence of DriveStrokes
    is_quick : bool
        Look at the nominal case on the first grid alone.
    """
    searches = [_search(one, is_quick) for one in every]
    asked = {place: next(one) for place, one in enumerate(searches)}
    found: dict[int, Tuned] = {}
    while asked:
        results = run_all(list(asked.values()))
        due, asked = dict(zip(asked, results, strict=True)), {}
        for place, result in due.items():
            following = _sent(searches[place], result)
            if isinstance(following, Tuned):
                found[place] = following
            else:
                asked[place] = following
    return [found[place] for place in range(len(every))]


def _sent(search: Search, result: StrokeResults) -> StrokeRuns | Tuned:
    try:
        return search.send(result)
    except StopIteration as end:
        return end.value


def _search(strokes: DriveStrokes, is_quick: bool) -> Search:
    """Search the settings of a choice: yield runs, take their results, return the settings.

    If a stroke is too slow fully open even in the fast case, nothing is searched: no setting makes it faster.
    """
    task = strokes.task
    for outward, limit in ((True, task.outward_s), (False, task.back_s)):
        opened = yield StrokeRuns(strokes, outward, cases(task, outward)[2:], np.ones((1, 4)))
        time = float(opened.time[0])
        if time > limit:
            margin = 1.0 - time / limit if np.isfinite(time) else NEVER
            return Tuned(Setting(), margin, (f"time {'out' if outward else 'back'}", limit, time))
    out = yield from _stroke(strokes, True, Setting(), is_quick)
    if out.nominal < HOPELESS:
        return out
    back = yield from _stroke(strokes, False, out.setting, is_quick)
    worse = min(out, back, key=lambda one: one.nominal)
    least = min(out.least, back.least)
    return Tuned(back.setting, worse.nominal, worse.short, least, out.air + back.air, out.times + back.times)


def _stroke(strokes: DriveStrokes, outward: bool, setting: Setting, is_quick: bool) -> Search:
    """Find the settings of one stroke; those of the other are kept."""
    task, choice = strokes.task, strokes.choice
    is_limited = task.end_speed_m_s is not None or task.impact_energy_j is not None
    needles = NEEDLES if choice.is_throttled else (1.0,)
    cushions = CUSHIONS if choice.is_cushioned and is_limited else (1.0,)
    rows = cases(task, outward)
    best = max((yield from _tried(strokes, outward, setting, product(needles, cushions), rows[:1])), key=_key)
    if best.nominal < HOPELESS or is_quick:
        return best
    for round_, finer in enumerate(FINER):
        if round_ == len(FINER) - 1:
            rows = np.vstack([rows, points(MORE)])
        shares = [finer if len(one) > 1 else (1.0,) for one in (needles, cushions)]
        own = best.setting[:2] if outward else best.setting[2:]
        near = [tuple(min(a * b, 1.0) for a, b in zip(own, pair, strict=True)) for pair in product(*shares)]
        best = max((yield from _tried(strokes, outward, setting, dict.fromkeys(near), rows)), key=_key)
    return best


def _key(one: Tuned) -> tuple[float, float]:
    return (one.least, one.nominal)


def _tried(
    strokes: DriveStrokes,
    outward: bool,
    setting: Setting,
    pairs: Iterable[tuple[float, ...]],
    rows: Array,
) -> Search:
    """Run the cases of each pair of needle and cushion."""
    places = ("needle_out", "cushion_out") if outward else ("needle_back", "cushion_back")
    settings = [setting._replace(**dict(zip(places, pair, strict=True))) for pair in pairs]
    draws, shares = np.tile(rows, (len(settings), 1)), np.repeat(np.array(settings), len(rows), axis=0)
    found = yield StrokeRuns(strokes, outward, draws, shares)
    named = _margins(strokes.task, strokes.choice, outward, found)
    table = np.array([margins for _, _, _, margins in named]).reshape(len(named), len(settings), len(rows))
    hard = len(named) - (named[-1][0] == SOFT_NAME)
    tries = []
    for place, one in enumerate(settings):
        at = place * len(rows)
        worst = int(table[:hard, place, 0].argmin())
        name, limit, values, _ = named[worst]
        short, least = (name, limit, float(values[at])), float(table[:, place].min())
        tries.append(
            Tuned(one, float(table[worst, place, 0]), short, least, float(found.air[at]), (float(found.time[at]),))
        )
    return tries


def _margins(
    task: SizingTask, choice: DriveChoice, outward: bool, found: StrokeResults
) -> list[tuple[str, float, Array, Array]]:
    """Return name, limit, values and margins of the limits that the needles decide."""
    way, limit = ("out", task.outward_s) if outward else ("back", task.back_s)
    named = [(f"time {way}", limit, found.time)]
    if task.end_speed_m_s is not None:
        named.append((f"end speed {way}", task.end_speed_m_s, found.end_speed))
    if task.impact_energy_j is not None:
        named.append((f"energy {way}", task.impact_energy_j, found.energy))
    if task.end_speed_m_s is None and task.impact_energy_j is None:
        named.append((SOFT_NAME, SOFT * task.stroke_m / limit, found.end_speed))
    peak = peak_limit(task, choice)
    if peak is not None:
        named.insert(1, ("peak pressure", peak, found.peak_pressure))
    arrived = np.isfinite(found.time)
    return [(name, most, values, np.where(arrived, 1.0 - values / most, NEVER)) for name, most, values in named]
