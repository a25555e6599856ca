"""Stick-slip in time and in the phase plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.page import Paragraph
from pneudrive.report.topics import Topic
from pneudrive.report.words import plural
from pneudrive.signals.motion import local_slope

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import Level, RecordingResult
    from pneudrive.friction.stick_slip import StickSlip
    from pneudrive.report.page import Section

SHOWN_S = 10.0
MOST_ROWS = 24
MOST_COLUMNS = 3


@dataclass(frozen=True)
class DrawnMotion:
    """One motion that is drawn: time from zero, SI."""

    title: str
    time_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    mean_speed_m_s: float


def section(found: Characterisation) -> Section | None:
    """Return the section on stick-slip, with pictures; None if there is nothing to report."""
    every = [(r, level, s) for r in found.results for level in r.levels for s in level.stick_slip]
    slipping = [item for item in every if item[2].found and "stick_slip" in item[1].flags]
    if not every or (found.synthetic and not slipping):
        return None
    topic = Topic("recordings", "stick-slip")
    strokes = plural(len(every), "stroke")
    if not slipping:
        return topic.section(Paragraph(_nothing(topic, strokes, [s for _, _, s in every])))
    shown = [_of_stroke(*item) for item in slipping[:MOST_COLUMNS]]
    return topic.section(
        topic.text(some=len(slipping), strokes=strokes),
        topic.table(_row(level, s) for _, level, s in slipping[:MOST_ROWS]),
        topic.picture("stick-slip-recordings", in_time(shown)),
        topic.picture("stick-slip-recordings-phase", phase_plane(shown)),
    )


def _nothing(topic: Topic, strokes: str, each: list[StickSlip]) -> str:
    """Return the text for recordings without stick-slip, with the shortest visible period."""
    text = topic.say("nothing", strokes=strokes, finest=float(np.median([s.resolution_s for s in each])))
    jumps = [s for s in each if s.found]
    if jumps:
        most = 100 * max(s.stuck_share for s in jumps)
        text += topic.say("jumps", strokes=plural(len(jumps), "stroke"), percent=most)
    return text


def _row(level: Level, s: StickSlip) -> tuple[object, ...]:
    mean = 1e3 * s.mean_speed_m_s
    ratio = s.peak_speed_m_s / s.mean_speed_m_s if s.mean_speed_m_s > 0 else None
    return level.recording, s.direction, mean, s.periods, s.period_s, 1e3 * s.step_m, ratio, 100 * s.stuck_share


def _of_stroke(result: RecordingResult, level: Level, s: StickSlip) -> DrawnMotion:
    r = result.recording
    part = slice(*np.searchsorted(r.time_s, (s.start_s, s.stop_s)))
    time, position = r.time_s[part], r.position_m[part]
    window = max(int(s.resolution_s / 2 / max(float(np.median(np.diff(time))), 1e-12)) // 2, 1)
    velocity = s.direction * local_slope(time, position, window)
    return DrawnMotion(level.recording, time - time[0], s.direction * position, velocity, s.mean_speed_m_s)


def in_time(motions: Sequence[DrawnMotion]) -> Figure:
    """Draw speed above position, a column for each motion."""
    figure = style.new_figure(3.4)
    grid = figure.subplots(2, len(motions), squeeze=False, sharex="col", sharey="row")
    for (above, below), motion in zip(grid.T, motions, strict=True):
        part = motion.time_s <= SHOWN_S
        time = motion.time_s[part]
        above.plot(time, 1e3 * motion.velocity_m_s[part], color=style.BLACK, lw=0.8)
        mean = 1e3 * motion.mean_speed_m_s
        above.axhline(mean, color=style.ORANGE, linestyle="--", lw=1.0, label=f"mean {mean:.2f} mm/s")
        above.legend(loc="upper right", fontsize=6.8)
        below.plot(time, 1e3 * motion.position_m[part], color=style.BLACK, lw=1.0)
        above.set_title(motion.title, fontsize=7.5)
        below.set_xlabel("time / s")
    style.headroom(grid[0, 0], above=0.2)
    grid[0, 0].set_ylabel("speed / (mm/s)")
    grid[1, 0].set_ylabel("position / mm")
    figure.align_ylabels()
    return figure


def phase_plane(motions: Sequence[DrawnMotion]) -> Figure:
    """Draw speed against position less mean motion."""
    figure = style.new_figure(2.6)
    axes = figure.subplots(1, len(motions), squeeze=False, sharey=True)[0]
    for axis, motion in zip(axes, motions, strict=True):
        trend = np.polynomial.Polynomial.fit(motion.time_s, motion.position_m, 1)(motion.time_s)
        axis.plot(1e3 * (motion.position_m - trend), 1e3 * motion.velocity_m_s, color=style.BLACK, lw=0.5)
        axis.axhline(1e3 * motion.mean_speed_m_s, color=style.ORANGE, linestyle="--", lw=1.0)
        axis.set_title(motion.title, fontsize=7.5)
        axis.set_xlabel("position − mean motion / mm")
    axes[0].set_ylabel("speed / (mm/s)")
    return figure
