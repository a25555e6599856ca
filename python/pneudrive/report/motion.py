"""Pages of a circuit along recorded motions: chambers, force balance, and what the recordings do not determine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.figures import MODEL, RESIDUAL, Figure, Line, Look, Markers, Panel, stack
from pneudrive.numbers import plain
from pneudrive.report.page import Picture, Report
from pneudrive.report.tables import sentence
from pneudrive.report.topics import Topic

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.identify.follow.fit import FollowFit
    from pneudrive.identify.follow.problem import FollowSolution
    from pneudrive.report.page import Section
    from pneudrive.validate.closure import Closure
    from pneudrive.validate.motion import MotionValidation

MOST_RECORDS = 4


def follow_page(fit: FollowFit, folder: str | Path) -> Path:
    """Write the page of a fit into an existing folder."""
    topic, rows = Topic("motion", "values"), []
    for name, value in fit.values.items():
        low, high = fit.intervals[name]
        spread = fit.spreads.get(name)
        between = None if spread is None else f"{plain(spread[0])} to {plain(spread[1])}"
        rows.append((name, fit.units[name], plain(value), f"{plain(low)} to {plain(high)}", between))
    values = topic.section(topic.text(), topic.table(rows), *topic.listed(fit.undetermined))
    lines = [
        f"{record.name}, chamber {side}: rms {100 * share:.2f} % of the range."
        for record in fit.records
        for side, share in zip("ab", record.rms, strict=True)
    ]
    title = f"{fit.circuit.name} along recorded motions"
    parts = [values, _rivals(fit), *_chambers(fit.solution)]
    return Report(title, [*lines, *map(sentence, fit.notes)], parts).write(folder)


def motion_page(found: MotionValidation, folder: str | Path) -> Path:
    """Write the page of a validation into an existing folder."""
    lines = [f"{sentence(text)} {'Met.' if met else 'Missed.'}" for met, text in found.verdicts]
    title = f"{found.circuit.name} along recorded motions"
    parts = [*_chambers(found.solution), *_forces(found.closures)]
    return Report(title, [*lines, *map(sentence, found.doubts)], parts).write(folder)


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
            (side, 100 * share, walls[side] + float(local[2 + index]), float(local[4]))
            for index, (side, share) in enumerate(zip("ab", solution.rms(at), strict=True))
        ]
        over_time = Picture(f"chambers-{at + 1}", topic.say("time", name=record.name), over_time_figure(solution, at))
        loops = Picture(f"volume-{at + 1}", topic.say("volume", name=record.name), volume_figure(solution, at))
        out.append(topic.section(topic.table(rows), over_time, loops, name=record.name))
    return out


def over_time_figure(solution: FollowSolution, at: int) -> Figure:
    """Draw measured and simulated pressures over time, with their residuals in % of the range."""
    record, panels = solution.problem.records[at], []
    shown = solution.problem.shown(at, solution.raws[at], float(solution.point.local[at, 4]))
    for side, measured, model, size in zip("ab", record.pressures_pa, shown, record.ranges_pa, strict=True):
        lines = [Line(record.grid_s, measured, "measured"), Line(record.grid_s, model, "simulated", MODEL)]
        panels.append(Panel(lines, y=f"pressure {side} / bar"))
        rest = Line(record.grid_s, (measured - model) / size, look=RESIDUAL, width=0.7)
        panels.append(Panel([rest], y="residual / %"))
    return stack(panels, 5.6, (2, 1, 2, 1))


def volume_figure(solution: FollowSolution, at: int) -> Figure:
    """Draw pressures over the volumes of the chambers, and residuals over the position."""
    problem, record = solution.problem, solution.problem.records[at]
    problem.driven.values_form(problem.numbers, np.exp(solution.point.shared))
    volumes, rest = problem.driven.volumes_m3(record.positions_m), solution.rest(at)
    left, right = [], []
    for index, (side, color) in enumerate((("a", "blue"), ("b", "orange"))):
        measured, own = record.pressures_pa[index], Look(color)
        left.append(Line(volumes[side], measured, f"chamber {side}", own))
        left.append(Line(volumes[side], measured - rest[index], look=Look("black", "--"), width=0.7))
        right.append(Line(record.positions_m, rest[index] / record.ranges_pa[index], look=own, width=0.5))
    panels = [Panel(left, "", "volume / l", "pressure / bar"), Panel(right, "", "position / m", "residual / %")]
    return Figure(panels, columns=2, row_in=3.4, rest_in=0.0)


def _forces(closures: tuple[Closure, ...]) -> list[Section]:
    if not closures:
        return []
    topic, rows = Topic("motion", "forces"), []
    for c in closures:
        gains = "; ".join(f"{name} {g.value:.3f} [{g.low:.3f}, {g.high:.3f}]" for name, g in c.gains.items())
        viscous = f"{c.viscous.value:.0f} [{c.viscous.low:.0f}, {c.viscous.high:.0f}]"
        rows.append((c.name, c.rms_n, 100 * c.share, c.offset_n, gains or None, viscous, c.correlation))
    first = [
        f"{c.name}: gain and viscous friction correlate at {c.correlation:.2f}. Friction depends on the area."
        for c in closures
        if c.correlation is not None
    ] + [f"{c.name}: {c.delay}. This delay is removed from the force balance." for c in closures if c.recorded]
    dots = Look("blue", "-", ".")
    panels = [Panel([Markers(c.time_s, c.residual_n / c.range_n, look=dots, size=1.0)], c.name) for c in closures]
    figure = Figure(panels, "time / s", "residual / %", row_in=1.3, rest_in=1.2)
    doubts = [doubt for c in closures for doubt in c.doubts]
    picture = Picture("closure", topic.say("residual"), figure)
    return [topic.section(*topic.listed(first), topic.text(), topic.table(rows), *topic.listed(doubts), picture)]
