"""Loops of friction against position: both directions, half their difference, half their sum."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from pneudrive.numbers import fixed, with_u
from pneudrive.report import style
from pneudrive.report.axes import grid
from pneudrive.report.page import Picture
from pneudrive.report.topics import Topic
from pneudrive.report.words import MOST_SHOWN, broken, by_seal, gauge_bar, speed_mm_s, spread_evenly

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import Level, RecordingResult
    from pneudrive.report.page import Section

COLUMNS, NAME_LETTERS = 4, 18  # panels in a row, letters of a name over one
MOST_LARGE = 12  # levels that are named


def section(found: Characterisation) -> Section:
    """Return the section with a figure for each seal, a panel for each recording and speed class."""
    topic, groups, pictures = Topic("recordings", "loops"), by_seal(found), []
    for seal, results in groups.items():
        pairs = [(r, level) for r in results for level in r.levels]
        shown = spread_evenly(pairs, max(MOST_SHOWN // len(groups), 2 * COLUMNS))
        name = re.sub(r"[^A-Za-z0-9]+", "-", seal).strip("-").lower() or "seal"
        some = topic.say("some", shown=len(shown), all=len(pairs)) if len(shown) < len(pairs) else ""
        pictures.append(Picture(f"loops-{name}", topic.say("caption", seal=seal, some=some), draw(shown)))
    large = [
        topic.say(
            "large",
            recording=level.recording,
            offset_n=level.offset_n,
            friction=with_u(level.friction_n, level.expanded_n),
        )
        for level in found.levels
        if abs(level.offset_n) > level.friction_n
    ]
    return topic.section(topic.text(), *topic.listed(large[:MOST_LARGE]), *pictures)


def draw(pairs: list[tuple[RecordingResult, Level]]) -> Figure:
    """Draw the panels of one seal on shared axes."""
    figure, axes = grid(len(pairs), COLUMNS, 1.75, 0.7, sharex=True, sharey=True)
    handles: list = []
    for axis, (result, level) in zip(axes, pairs, strict=True):
        handles = _panel(axis, level)
        pressure, speed = gauge_bar(level, result.recording), speed_mm_s(level)
        axis.set_title(
            f"{broken(level.recording, NAME_LETTERS)}\n{fixed(pressure, 1)} bar, {speed:.3g} mm/s", fontsize=7.5
        )
    style.outer_labels(figure, "position / mm", "balance, friction, offset / N")
    style.legend_above(figure, handles)
    return figure


def _panel(axis: Axes, level: Level) -> list:
    p = level.profile
    x = p.position_m * 1e3
    axis.axvspan(level.window_m[0] * 1e3, level.window_m[1] * 1e3, color=style.SHADE, lw=0)
    for strokes in (p.up_strokes_n, p.down_strokes_n):
        axis.plot(x, strokes.T, color=style.GREY, lw=0.3)
    axis.axhline(0.0, color=style.GREY, lw=0.6)
    return [
        axis.plot(x, p.up_n, "-", color=style.BLUE, label="towards +x")[0],
        axis.plot(x, p.down_n, "--", color=style.BLUE, label="towards −x")[0],
        axis.plot(x, p.friction_n, "-", color=style.BLACK, lw=1.8, label="friction (half difference)")[0],
        axis.plot(x, p.offset_n, ":", color=style.ORANGE, lw=1.8, label="offset (half sum)")[0],
    ]
