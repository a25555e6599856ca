"""The page that compares two campaigns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.conditions import PA_PER_BAR
from pneudrive.numbers import with_interval
from pneudrive.report import axes as draw
from pneudrive.report import style
from pneudrive.report.campaign.curves import MM
from pneudrive.report.page import Report
from pneudrive.report.topics import Topic
from pneudrive.report.words import plural, spread_evenly

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.friction.campaign.compare import Comparison, CurveComparison
    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.campaign.stops.dwell_law import DwellSeries
    from pneudrive.report.page import Section

MOST_PANELS = 4
MOST_ROWS = 60
CHANCE = 0.05
NAMES = ("first", "second")


@style.applied()
def write_comparison_report(comparison: Comparison, folder: str | Path) -> Path:
    """Write report.html of a comparison, and its figures as PNG and SVG.

    Parameters
    ----------
    comparison : Comparison
    folder : path-like
        An existing folder.

    Returns
    -------
    pathlib.Path
        Folder of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    c = comparison
    parts = [_questions(c), _comparable(c), _curves(c, c.curves) if c.curves is not None else None]
    parts.append(_dwell(c) if c.dwell else None)
    return Report(f"{c.first.name} against {c.second.name}", _verdict(c), parts, synthetic(c)).write(folder)


def synthetic(comparison: Comparison) -> bool:
    """Return whether one of the campaigns ran on a simulated rig."""
    return comparison.first.synthetic or comparison.second.synthetic


def _verdict(c: Comparison) -> Iterator[str]:
    topic = Topic("comparison", "verdict")
    yield f"{c}{topic.say('synthetic') if synthetic(c) else ''}"
    for test in c.tests:
        if test.different and test.difference is not None:
            what = f"{test.what[:1].upper()}{test.what[1:]}"
            beyond = topic.say("beyond") if test.beyond_repeatability else ""
            yield topic.say("test", what=what, size=with_interval(test.difference), beyond=beyond, note=test.note)
    unlike = [check.what for check in c.checks if not check.comparable]
    yield topic.say("unlike", what=", ".join(unlike)) if unlike else topic.say("alike")


def _questions(c: Comparison) -> Section:
    topic = Topic("comparison", "questions")
    remarks = topic.listed((str(s) for s in c.statements), "remarks", "note")
    return topic.section(topic.text(), topic.table(c.tests), *remarks)


def _comparable(c: Comparison) -> Section:
    topic = Topic("comparison", "comparable")
    rows = ((k.what, k.first, k.second, k.comparable, "" if k.comparable else k.consequence) for k in c.checks)
    return topic.section(
        topic.text(first=_labels(c.first), second=_labels(c.second)),
        topic.table(rows, first=c.first.name, second=c.second.name),
    )


def _labels(found: CampaignCharacteristics) -> str:
    own = dict(found.identity.labels)
    for cycle in found.cycles[:1]:
        levels = {name: getattr(cycle.condition, name) for name in ("mounting", "seal", "drive")}
        own |= {name: level for name, level in levels.items() if level}
    return ", ".join(f"{k} {v}" for k, v in own.items()) or "none"


# --- curves --------------------------------------------------------------------------------------------------------


def _curves(c: Comparison, curves: CurveComparison) -> Section:
    topic, points = Topic("comparison", "curves"), curves.points
    first, second = (int(points.count[points.campaign == k].sum()) for k in (0, 1))
    rows = (
        (
            _gauge(points.gauge_pa[i], points.levels[i]),
            MM * points.speed_m_s[i],
            *curves.friction_n[:, i],
            with_interval(curves.difference[i], _mean(curves, i), "N"),
            float(curves.adjusted_p[i]),
        )
        for i in range(min(points.speed_m_s.size, MOST_ROWS))
    )
    common = plural(points.speed_m_s.size, "point")
    return topic.section(
        topic.text(points=common, first=plural(first, "cycle"), second=second),
        topic.picture("compare-curves", draw_curves(c, curves), first=c.first.name, second=c.second.name),
        topic.table(rows),
    )


def _mean(curves: CurveComparison, point: int) -> float:
    return float(curves.friction_n[:, point].mean())


def _gauge(pair: np.ndarray, levels: str) -> str:
    a, b = (round(float(v) / PA_PER_BAR, 3) + 0.0 for v in pair)
    text = f"{a:.3g} bar in both" if a == b else f"a {a:.3g} bar, b {b:.3g} bar"
    return f"{text}, {levels}" if levels else text


def draw_curves(c: Comparison, curves: CurveComparison) -> Figure:
    """Draw curves of both campaigns above their differences, a column for each pair of pressures."""
    points = curves.points
    groups: dict[tuple, list[int]] = {}
    for i, at in enumerate(zip(map(tuple, points.gauge_pa.round(-2)), points.levels, strict=True)):
        groups.setdefault(at, []).append(i)
    shown = spread_evenly(list(groups), MOST_PANELS)
    figure = style.new_figure(4.4)
    axes = figure.subplots(2, len(shown), squeeze=False, sharex="col", sharey="row", height_ratios=[3, 2])
    for (above, below), at in zip(axes.T, shown, strict=True):
        chosen = sorted(groups[at], key=lambda i: points.speed_m_s[i])
        _both(above, c, curves, chosen)
        _less(below, curves, chosen)
        above.set_title(_gauge(np.array(at[0]), at[1]))
    axes[0][0].set_ylabel("friction / N")
    axes[1][0].set_ylabel("second minus first / N")
    draw.legend_of(figure, axes[0][0])
    return figure


def _both(axis: Axes, c: Comparison, curves: CurveComparison, chosen: list[int]) -> None:
    speed, wanted = MM * curves.points.speed_m_s[chosen], curves.points.gauge_pa[chosen[0]]
    for k, found in enumerate((c.first, c.second)):
        look, ambient = style.look(k), found.identity.ambient_pressure_pa
        for curve in found.curves:
            pair = (curve.condition.pressure_a_pa - ambient, curve.condition.pressure_b_pa - ambient)
            if curve.direction == 0 and np.allclose(pair, wanted, atol=2000.0):
                ends = (curve.low_n, curve.high_n)
                draw.band(axis, MM * curve.speed_m_s, curve.friction_n, ends, look, 0.12, lw=1.0)
                break
        label = found.name if c.first.name != c.second.name else f"{found.name} ({NAMES[k]})"
        draw.marks(axis, speed, curves.friction_n[k, chosen], look, 3.6, ls=look.linestyle, lw=0, label=label)


def _less(axis: Axes, curves: CurveComparison, chosen: list[int]) -> None:
    for i in chosen:
        value, low, high = draw.arrays([curves.difference[i]], _mean(curves, i))
        color = style.ORANGE if curves.adjusted_p[i] < CHANCE else style.GREY
        face = color if color == style.ORANGE else "white"
        reach, look = [value - low, high - value], style.Look(color, "-", "D")
        draw.bars(axis, MM * curves.points.speed_m_s[i], value, reach, look, mfc=face, ms=4)
    draw.zero_line(axis)
    draw.speed_axis(axis, MM * curves.points.speed_m_s[chosen])


# --- stops ---------------------------------------------------------------------------------------------------------


def _dwell(c: Comparison) -> Section:
    topic, names = Topic("comparison", "dwell"), (c.first.name, c.second.name)
    rows = (
        (s.name, name, len(s.stops), s.reference_s, s.increment, s.slope, s.laws[0].form.title if s.laws else None)
        for pair in c.dwell
        for name, s in zip(names, pair, strict=True)
    )
    picture = topic.picture("compare-dwell", draw_dwell(c), first=names[0], second=names[1])
    return topic.section(picture, topic.table(rows))


def draw_dwell(c: Comparison) -> Figure:
    """Draw both campaigns' curves of breakaway over duration, a panel for each series."""
    shown = list(c.dwell)[:MOST_PANELS]
    figure, axes = draw.grid(len(shown), 2, 2.8, 0.3)
    for axis, pair in zip(axes, shown, strict=True):
        for k, series in enumerate(pair):
            _series(axis, series, k, f"{(c.first.name, c.second.name)[k]} ({NAMES[k]})")
        draw.duration_axis(axis, pair[0].name)
    draw.legend_of(figure, axes[0])
    return figure


def _series(axis: Axes, series: DwellSeries, k: int, label: str) -> None:
    look = style.look(k)
    assert series.curve is not None
    conditions = len(series.conditions)
    log_s = np.log10(series.duration_s)
    rows = np.kron(np.full((1, conditions), 1.0 / conditions), np.eye(log_s.size))
    mean, low, high = draw.arrays(series.curve.values(log_s).combine(rows.astype(np.float64)).estimates())
    draw.band(axis, series.duration_s, mean, (low, high), look, lw=1.1, label=label)
    durations = [s.dwell_s * (1.0 + 0.05 * k) for s in series.stops]
    draw.marks(axis, durations, [s.increment_n for s in series.stops], look, 3.0)
