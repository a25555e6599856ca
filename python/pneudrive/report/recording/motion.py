"""Pages of a circuit along recorded motions: chambers, force balance, and what the recordings do not determine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.numbers import plain
from pneudrive.report import style
from pneudrive.report.axes import stack
from pneudrive.report.page import Picture, Report
from pneudrive.report.topics import Topic
from pneudrive.report.words import sentence

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from pneudrive.identify.follow.fit import FollowFit
    from pneudrive.identify.follow.problem import FollowSolution
    from pneudrive.report.page import Section
    from pneudrive.validate.closure import Closure
    from pneudrive.validate.motion import MotionValidation

MOST_RECORDS = 4


@style.applied()
def follow_page(fit: FollowFit, folder: str | Path) -> Path:
    """Write the page of a fit into an existing folder."""
    topic = Topic("motion", "values")
    rows = []
    for name, value in fit.values.items():
        low, high = fit.intervals[name]
        spread = fit.spreads.get(name)
        between = None if spread is None else f"{plain(spread[0])} to {plain(spread[1])}"
        rows.append((name, fit.units[name], plain(value), f"{plain(low)} to {plain(high)}", between))
    values = topic.section(topic.text(), topic.table(rows), *topic.listed(fit.undetermined))
    parts = [values, _rivals(fit), *_chambers(fit.solution)]
    verdicts = [
        f"{record.name}, chamber {side}: rms {100 * share:.2f} % of the range."
        for record in fit.records
        for side, share in zip("ab", record.rms, strict=True)
    ]
    title = f"{fit.circuit.name} along recorded motions"
    return Report(title, [*verdicts, *map(sentence, fit.notes)], parts).write(folder)


@style.applied()
def motion_page(found: MotionValidation, folder: str | Path) -> Path:
    """Write the page of a validation into an existing folder."""
    marks = {True: "Met.", False: "Missed."}
    verdicts = [f"{sentence(text)} {marks[met]}" for met, text in found.verdicts]
    title = f"{found.circuit.name} along recorded motions"
    parts = [*_chambers(found.solution), *_forces(found.closures)]
    return Report(title, [*verdicts, *map(sentence, found.doubts)], parts).write(folder)


def _rivals(fit: FollowFit) -> Section | None:
    topic = Topic("motion", "rivals")
    rows = (
        (r.words, r.fit_percent, 100 * r.gain, ", ".join(f"{100 * p:.0f}" for p in r.predictions) or None,
         "yes" if r.earns else "no" if r.predictions else None)
        for r in fit.rivals
    )  # fmt: skip
    return topic.section(topic.text(), topic.table(rows)) if fit.rivals else None


def _chambers(solution: FollowSolution | None) -> list[Section]:
    if solution is None:
        return []
    out = []
    for at, record in enumerate(solution.problem.records[:MOST_RECORDS]):
        topic = Topic("motion", "chambers")
        local, walls = solution.point.local[at], solution.problem.driven.wall_k
        rows = [
            (side, 100 * share, walls[side] + float(local[2 + place]), float(local[4]))
            for place, (side, share) in enumerate(zip("ab", solution.rms(at), strict=True))
        ]
        over_time = Picture(f"chambers-{at + 1}", topic.say("time", name=record.name), over_time_figure(solution, at))
        loops = Picture(f"volume-{at + 1}", topic.say("volume", name=record.name), volume_figure(solution, at))
        out.append(topic.section(topic.table(rows), over_time, loops, name=record.name))
    return out


def over_time_figure(solution: FollowSolution, at: int) -> Figure:
    """Draw measured and simulated pressures over time, with their residuals in % of the range."""
    record = solution.problem.records[at]
    shown = solution.problem.shown(at, solution.raws[at], float(solution.point.local[at, 4]))
    figure, axes = stack(5.6, (2, 1, 2, 1))
    for side, measured, model, size, above, below in zip(
        "ab", record.pressures_pa, shown, record.ranges_pa, axes[::2], axes[1::2], strict=True
    ):
        above.plot(record.grid_s, measured / 1e5, color=style.BLACK, label="measured")
        above.plot(record.grid_s, model / 1e5, "--", color=style.ORANGE, label="simulated")
        above.set_ylabel(f"pressure {side} / bar")
        below.plot(record.grid_s, 100 * (measured - model) / size, color=style.BLUE, lw=0.7)
        below.set_ylabel("residual / %")
    axes[0].legend(loc="upper right")
    return figure


def volume_figure(solution: FollowSolution, at: int) -> Figure:
    """Draw pressures over the volumes of the chambers, and residuals over the position."""
    problem, record = solution.problem, solution.problem.records[at]
    problem.driven.values_form(problem.numbers, np.exp(solution.point.shared))
    volumes, rest = problem.driven.volumes_m3(record.positions_m), solution.rest(at)
    shown = record.pressures_pa - rest
    figure = style.new_figure(3.4)
    left, right = figure.subplots(1, 2)
    for place, (side, colour) in enumerate((("a", style.BLUE), ("b", style.ORANGE))):
        left.plot(1e3 * volumes[side], record.pressures_pa[place] / 1e5, color=colour, label=f"chamber {side}")
        left.plot(1e3 * volumes[side], shown[place] / 1e5, "--", color=style.BLACK, lw=0.7)
        right.plot(record.positions_m, 100 * rest[place] / record.ranges_pa[place], color=colour, lw=0.5)
    left.set(xlabel="volume / l", ylabel="pressure / bar")
    left.legend()
    right.set(xlabel="position / m", ylabel="residual / %")
    return figure


def _forces(closures: tuple[Closure, ...]) -> list[Section]:
    if not closures:
        return []
    topic = Topic("motion", "forces")
    rows = []
    for c in closures:
        gains = "; ".join(f"{name} {g.value:.3f} [{g.low:.3f}, {g.high:.3f}]" for name, g in c.gains.items())
        viscous = f"{c.viscous.value:.0f} [{c.viscous.low:.0f}, {c.viscous.high:.0f}]"
        rows.append((c.name, c.rms_n, 100 * c.share, c.offset_n, gains or None, viscous, c.correlation))
    first = [
        f"{c.name}: gain and viscous friction correlate at {c.correlation:.2f}. Friction depends on the area."
        for c in closures
        if c.correlation is not None
    ] + [f"{c.name}: {c.delay}. This delay is removed from the force balance." for c in closures if c.recorded]
    pictures = [Picture("closure", topic.say("residual"), closure_figure(closures))]
    doubts = [doubt for c in closures for doubt in c.doubts]
    return [topic.section(*topic.listed(first), topic.text(), topic.table(rows), *topic.listed(doubts), *pictures)]


def closure_figure(closures: tuple[Closure, ...]) -> Figure:
    """Draw the residual of each force balance over time."""
    figure = style.new_figure(1.2 + 1.3 * len(closures))
    for c, axis in zip(closures, np.atleast_1d(figure.subplots(len(closures), 1)), strict=True):
        axis.plot(c.time_s, 100 * c.residual_n / c.range_n, ".", ms=1, color=style.BLUE)
        axis.set(ylabel="residual / %", title=c.name)
        axis.set_xlabel("time / s")
    return figure
