"""One choice of parts with its settings over the spreads of a task."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.sizing import judge
from pneudrive.sizing.sized_drive import SizedDrive
from pneudrive.sizing.strokes import COARSE, DriveStrokes, Setting

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def sized(strokes: DriveStrokes, setting: Setting, draws: Array, rtol: float = COARSE) -> SizedDrive:
    """Simulate a choice with its settings over draws and compare it with its task."""
    rows = np.tile(np.array(setting), (len(draws), 1))
    out, back = (strokes.run(outward, draws, rows, rtol) for outward in (True, False))
    task, choice = strokes.task, strokes.choice
    found = judge.limits(task, choice, out, back)
    met = int(judge.is_met(found).sum())
    binding = min(found, key=lambda one: one.margin)
    explained = judge.explained(draws, binding.margins)
    assumed = strokes.drawn_assumed()
    first = max(assumed, key=lambda name: explained[name], default="")
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
    intervals = {name: judge.interval(values) for name, values in figures.items()}
    return SizedDrive(
        parts=choice.parts,
        setting=setting._asdict(),
        draws=len(draws),
        met=met,
        probability_bound=judge.probability_bound(met, len(draws)),
        **{name: intervals[name][1] for name in ("time_out", "time_back", "end_speed", "energy", "peak_pressure")},
        air=float(air.mean()),
        margins={one.name: one.margin for one in found},
        worst={one.name: (one.worst, one.limit, one.unit) for one in found},
        measure=f"{first} of {choice.parts[assumed[first]]}" if first else "",
        explains=explained[first] if first else 0.0,
        sizes=choice.sizes,
        intervals=intervals,
    )
