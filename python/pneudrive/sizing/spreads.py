"""One choice of parts with its settings over the spreads of a task."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive.sizing.checks import SizedDrive, explained, interval, is_met, limits, passed, probability_bound
from pneudrive.sizing.strokes import COARSE, RTOL, DriveStrokes, Setting

if TYPE_CHECKING:
    from pneudrive.arrays import Array
    from pneudrive.sizing.checks import LimitMargin
    from pneudrive.sizing.strokes import StrokeResults

#: Draws that are simulated for a limit beside those that may fail, and the estimated margin, over the least one, up to
#: which a limit may decide.
HARD, NEAR = 16, 0.15


class DrawResults(NamedTuple):
    """Results of samples: summary, margins of each limit, and air of each sample, kg."""

    drive: SizedDrive
    limits: list[LimitMargin]
    air: Array


class Hardest(NamedTuple):
    """Bounds of a choice over all samples: largest margin, least number of failing samples, and estimated air, kg."""

    margin: float
    failed: int
    air: float


def sized(strokes: DriveStrokes, setting: Setting, draws: Array, rtol: float = COARSE) -> SizedDrive:
    """Simulate a choice with its settings over samples of the spreads, and compare the results with the task."""
    return simulated(strokes, setting, draws, rtol).drive


def simulated(strokes: DriveStrokes, setting: Setting, draws: Array, rtol: float = COARSE) -> DrawResults:
    """Simulate a choice with its settings over samples of the spreads, and keep the results of each sample."""
    out, back = _both(strokes, setting, draws, rtol)
    task, choice = strokes.task, strokes.choice
    found = limits(task, choice, out, back)
    met = int(is_met(found).sum())
    binding = min(found, key=lambda one: one.margin)
    shares = explained(draws, binding.margins)
    assumed = strokes.drawn_assumed()
    first = max(assumed, key=lambda name: shares[name], default="")
    air = out.air + back.air
    figures = {one.name: one.values for one in found} | {
        "time_out": out.time,
        "time_back": back.time,
        "end_speed": np.maximum(out.end_speed, back.end_speed),
        "energy": np.maximum(out.energy, back.energy),
        "peak_pressure": np.maximum(out.peak_pressure, back.peak_pressure),
        "air": air,
        "load_ratio_out": strokes.load_ratio(True, draws),
        "load_ratio_back": strokes.load_ratio(False, draws),
    }
    intervals = {name: interval(values) for name, values in figures.items()}
    drive = SizedDrive(
        parts=choice.parts,
        setting=setting._asdict(),
        draws=len(draws),
        met=met,
        probability_bound=probability_bound(met, len(draws)),
        **{name: intervals[name][1] for name in ("time_out", "time_back", "end_speed", "energy", "peak_pressure")},
        air=float(air.mean()),
        margins={one.name: one.margin for one in found},
        worst={one.name: (one.worst, one.limit, one.unit) for one in found},
        measure=f"{first} of {choice.parts[assumed[first]]}" if first else "",
        explains=shares[first] if first else 0.0,
        sizes=choice.sizes,
        intervals=intervals,
    )
    return DrawResults(drive, found, air)


def hardest(strokes: DriveStrokes, setting: Setting, known: DrawResults, draws: Array) -> Hardest:
    """Return upper bounds of a choice's results over all samples, from a few of them.

    The first samples give a linear estimate of all margins. The samples with the lowest estimates are simulated. The
    result is always a bound, because samples that are not simulated can only reduce the margin. The mean air is
    estimated.

    Parameters
    ----------
    strokes : DriveStrokes
    setting : Setting
    known : DrawResults
        Of the first draws.
    draws : ndarray, shape (n, len(DRAWN))
        All draws.
    """
    allowed, first = passed(len(draws)), len(known.air)
    design = np.column_stack([np.ones(len(draws)), draws])
    columns = np.column_stack([*(limit.margins for limit in known.limits), known.air])
    *estimates, air = (design @ np.linalg.lstsq(design[:first], columns, rcond=None)[0]).T
    lows = [float(np.partition(estimate, allowed)[allowed]) for estimate in estimates]
    near = [one for one, low in zip(estimates, lows, strict=True) if low < min(lows) + NEAR]
    places = np.unique(np.concatenate([one.argsort()[: HARD + allowed] for one in near]))
    found = limits(strokes.task, strokes.choice, *_both(strokes, setting, draws[places], RTOL))
    margin = min(float(np.sort(one.margins)[allowed]) for one in found)
    return Hardest(margin, int((~is_met(found)).sum()), float(air.mean()))


def _both(strokes: DriveStrokes, setting: Setting, draws: Array, rtol: float) -> list[StrokeResults]:
    """Run both strokes."""
    rows = np.tile(np.array(setting), (len(draws), 1))
    return [strokes.run(outward, draws, rows, rtol) for outward in (True, False)]
