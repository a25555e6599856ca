"""Stick-slip in time and in the phase plane: of recordings, and of the drive of the source paper's figures 1 to 3."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.motion import local_slope
from pneudrive.report import style
from pneudrive.report.page import Picture, Section, Table, Text
from pneudrive.report.words import plural

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from pneudrive.characterise import Characterisation, StickSlip
    from pneudrive.characterise.extract import Level, RecordingResult
    from pneudrive.paper import PaperFigure

PAPER_FIGURES = {1: "LuGre, read by sensors", 2: "LuGre", 3: "Coulomb and Stribeck"}
SHOWN_S = 10.0
MOST_ROWS = 24
MOST_COLUMNS = 3
HEAD = ("mean, mm/s", "periods", "period, s", "step, mm", "peak over mean", "stuck, % of time")


@dataclass(frozen=True)
class Shown:
    """One motion that is drawn: time from zero, SI."""

    title: str
    time_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    mean_speed_m_s: float


def section(found: Characterisation | None, figures: Mapping[int, PaperFigure]) -> Section | None:
    """Stick-slip of the recordings, then of the simulated drive; None where there is nothing to say."""
    blocks: list = []
    synthetic = True
    if found is not None:
        blocks += _of_recordings(found)
        synthetic = found.synthetic
    chosen = [figures[n] for n in PAPER_FIGURES if n in figures]
    if chosen:
        blocks += _of_paper(chosen)
    if not blocks or (not chosen and len(blocks) == 1 and found is not None and found.synthetic):
        return None
    return Section("stick-slip", "Stick-slip in time and in the phase plane", tuple(blocks), synthetic=synthetic)


def _of_recordings(found: Characterisation) -> list:
    """Say what the recordings show, and draw those that stick and slip."""
    every = [(r, level, s) for r in found.results for level in r.levels for s in level.stick_slip]
    if not every:
        return []
    slipping = [item for item in every if item[2].found and "stick_slip" in item[1].flags]
    if not slipping:
        return [Text(_nothing([s for _, _, s in every]))]
    rows = tuple(
        (level.recording, f"{s.direction:+d}", *_cells(s), f"{100 * s.stuck_share:.0f}")
        for _, level, s in slipping[:MOST_ROWS]
    )
    shown = [_of_stroke(*item) for item in slipping[:MOST_COLUMNS]]
    return [
        Text(f"The recordings: {len(slipping)} of {plural(len(every), 'stroke')} stick and slip."),
        Table(("recording", "direction", *HEAD), rows, "Stick-slip in the recordings", numbers_from=1),
        Picture("stick-slip-recordings", "Stick-slip in the recordings: speed above, position below.", in_time(shown)),
        Picture("stick-slip-recordings-phase", "The same strokes in the phase plane.", phase_plane(shown)),
    ]


def _nothing(strokes: list[StickSlip]) -> str:
    """Say that no recording sticks and slips, and what could have been seen."""
    finest = float(np.median([s.resolution_s for s in strokes]))
    text = (
        f"The recordings: none of {plural(len(strokes), 'stroke')} belongs to a motion that sticks and slips. "
        f"Sampling and noise of the position let one see periods longer than {finest:.2g} s."
    )
    jumps = [s for s in strokes if s.found]
    if jumps:
        text += (
            f" In {plural(len(jumps), 'stroke')} the position jumps a few times, but stands still for at most "
            f"{100 * max(s.stuck_share for s in jumps):.0f} % of the time."
        )
    return text


def _cells(s: StickSlip) -> tuple[str, ...]:
    ratio = s.peak_speed_m_s / s.mean_speed_m_s if s.mean_speed_m_s > 0 else float("nan")
    return (
        f"{1e3 * s.mean_speed_m_s:.2f}",
        str(s.periods),
        f"{s.period_s:.3f}",
        f"{1e3 * s.step_m:.2f}",
        f"{ratio:.1f}",
    )


def _of_stroke(result: RecordingResult, level: Level, s: StickSlip) -> Shown:
    r = result.recording
    part = slice(*np.searchsorted(r.time_s, (s.start_s, s.stop_s)))
    time, position = r.time_s[part], r.position_m[part]
    window = max(int(s.resolution_s / 2 / max(float(np.median(np.diff(time))), 1e-12)) // 2, 1)
    velocity = s.direction * local_slope(time, position, window)
    return Shown(level.recording, time - time[0], s.direction * position, velocity, s.mean_speed_m_s)


def _of_paper(figures: list[PaperFigure]) -> list:
    rows = []
    for f in figures:
        q = f.quantities
        numbers = (1e3 * q["mean_speed_m_s"], q["periods"], q["period_s"], 1e3 * q["step_m"], q["peak_ratio"])
        formats = (".2f", ".0f", ".3f", ".2f", ".1f")
        cells = [format(value, form) for value, form in zip(numbers, formats, strict=True)]
        rows.append((str(f.number), PAPER_FIGURES[f.number], *cells, f"{100 * q['stuck_share']:.0f}"))
    shown = [
        Shown(
            f"figure {f.number}: {PAPER_FIGURES[f.number]}",
            f.columns["time_s"],
            f.columns["position_m"],
            f.columns["velocity_m_s"],
            f.quantities["mean_speed_m_s"],
        )
        for f in figures
    ]
    return [
        Text(
            "A simulated drive with a valve that is nearly closed: air is compressed while the piston sticks, and "
            "pushes it a step further when friction gives way. Stuck counts the time below a fifth of the mean "
            "speed."
        ),
        Table(("figure", "friction", *HEAD), tuple(rows), "Stick-slip, measured over whole periods", numbers_from=2),
        Picture(
            "stick-slip-time",
            "As the paper's figures 1 to 3: speed above, position below, in the order of the table.",
            in_time(shown),
            synthetic=True,
        ),
        Picture(
            "stick-slip-phase",
            "Phase plane: speed against the distance from the mean motion, dashed the mean speed. Each loop is one "
            "period; the flat lower side is sticking, where the piston falls behind at the mean speed.",
            phase_plane(shown),
            synthetic=True,
        ),
    ]


def in_time(motions: list[Shown]) -> Figure:
    """Speed above position, a column for each motion."""
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


def phase_plane(motions: list[Shown]) -> Figure:
    """Speed against position less mean motion."""
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
