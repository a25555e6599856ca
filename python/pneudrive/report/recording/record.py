"""The raw record with its strokes shaded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.page import Picture
from pneudrive.report.recording.measured import is_open
from pneudrive.report.topics import Topic
from pneudrive.report.words import by_seal, gauge_bar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import RecordingResult
    from pneudrive.report.page import Section

IN_ONE_FIGURE = 3
MOST_FIGURES = 3


def section(found: Characterisation) -> Section:
    """Return the section with one recording of each seal over time, all channels."""
    topic = Topic("recordings", "record")
    chosen = [group[len(group) // 2] for group in by_seal(found).values()][: IN_ONE_FIGURE * MOST_FIGURES]
    parts = [chosen[i : i + IN_ONE_FIGURE] for i in range(0, len(chosen), IN_ONE_FIGURE)]
    captions = [topic.say("caption", names=", ".join(r.recording.name for r in part)) for part in parts]
    pictures = (
        Picture(f"record-{i}", caption, draw(part))
        for i, (caption, part) in enumerate(zip(captions, parts, strict=True), 1)
    )
    return topic.section(topic.text(), *pictures)


def draw(results: list[RecordingResult]) -> Figure:
    """Draw position, pressure and force over time, a column for each recording."""
    sides = [s for s in ("a", "b") if not all(is_open(r.recording, s) for r in results)] or ["b"]
    rows = 2 + len(sides)
    figure = style.new_figure(1.15 * rows + 0.5)
    grid = figure.subplots(rows, len(results), squeeze=False, sharex="col", sharey="row")
    for column, result in zip(grid.T, results, strict=True):
        r = result.recording
        channels = [("position / mm", r.position_m * 1e3)]
        for side in sides:
            gauge = (getattr(r, f"pressure_{side}_pa") - r.ambient_pressure_pa) / 1e5
            channels.append((f"pressure {side} /\nbar gauge", gauge))
        channels.append(("force F / N", r.force_n))
        part = style.thin(r.time_s)
        time = r.time_s - r.time_s[0]
        for axis, (label, values) in zip(column, channels, strict=True):
            for stroke in result.strokes:
                if stroke.direction > 0:
                    axis.axvspan(time[stroke.start], time[stroke.stop - 1], color=style.SHADE, lw=0)
            axis.plot(time[part], values[part], color=style.BLACK, lw=0.6)
            axis.grid(visible=False)
            if result is results[0]:
                axis.set_ylabel(label)
        column[0].set_title(f"{r.name} ({gauge_bar(result.levels[0], r):.2g} bar)")
        column[-1].set_xlabel("time / s")
        column[-1].set_xlim(0, float(np.max(time)))
    figure.align_ylabels()
    return figure
