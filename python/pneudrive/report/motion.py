"""Pages of a circuit along recorded motions: chambers, force balance, and what the recordings do not determine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.figures import Figure, Line, Look, Markers, Panel
from pneudrive.identify.follow.fit import fitted_pressures
from pneudrive.identify.identified import comparison_figure
from pneudrive.report.fit import write_fit_report
from pneudrive.report.page import Picture, view_report
from pneudrive.report.tables import Topic
from pneudrive.views import Finding, ShownFigure, View, worst

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.identify.follow.fit import FollowFit
    from pneudrive.identify.follow.problem import FollowSolution
    from pneudrive.report.page import Section
    from pneudrive.validate.motion import Closure, MotionValidation

MOST_RECORDS = 4


def follow_page(fit: FollowFit, folder: str | Path) -> Path:
    """Write the page of a fit into an existing folder."""
    return write_fit_report(fit, folder, _chambers(fit.solution))


def motion_view(found: MotionValidation) -> View:
    """Return the view of a circuit along recorded motions: verdicts, force balances, and pressures."""
    findings = [Finding(text, "good" if met else "bad") for met, text in found.verdicts]
    findings += [Finding(doubt, "open") for doubt in found.doubts]
    notes = [f"{record.name}: {record}" for record in found.records]
    notes += [f"{name}: its chambers are open, so its pressures test neither volumes nor heat" for name in found.open]
    topic, figures = Topic("motion", "forces"), []
    if found.solution is not None:
        figure = comparison_figure(fitted_pressures(found.solution))
        figures.append(ShownFigure("pressures", Topic("motion", "chambers").say("time"), figure))
    if found.closures:
        figures.append(ShownFigure("closure", topic.say("residual"), closure_figure(found.closures)))
        notes += [*map(str, found.closures), topic.say()]
    return View(
        f"{found.circuit.name} along recorded motions",
        notes=tuple(notes),
        state=worst(findings),
        findings=tuple(findings),
        tables=(topic.shown(map(_force_row, found.closures)),) if found.closures else (),
        figures=tuple(figures),
    )


def motion_page(found: MotionValidation, folder: str | Path) -> Path:
    """Write the page of a validation into an existing folder."""
    return view_report(found.view(), *_chambers(found.solution)).write(folder)


def closure_figure(closures: tuple[Closure, ...]) -> Figure:
    """Draw the residual of each force balance over time."""
    dots = Look("blue", "-", ".")
    panels = [Panel([Markers(c.time_s, c.residual_n / c.range_n, look=dots, size=1.0)], c.name) for c in closures]
    return Figure(panels, "time / s", "residual / %", row_in=1.3, rest_in=1.2)


def _force_row(c: Closure) -> tuple[object, ...]:
    gains = "; ".join(f"{name} {g.value:.3f} [{g.low:.3f}, {g.high:.3f}]" for name, g in c.gains.items())
    viscous = f"{c.viscous.value:.0f} [{c.viscous.low:.0f}, {c.viscous.high:.0f}]"
    return c.name, c.rms_n, 100 * c.share, c.offset_n, gains or None, viscous, c.correlation


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
        loops = Picture(f"volume-{at + 1}", topic.say("volume", name=record.name), volume_figure(solution, at))
        out.append(topic.section(topic.table(rows), loops, name=record.name))
    return out


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
