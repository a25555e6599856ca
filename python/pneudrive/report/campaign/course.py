"""A campaign's friction along the stroke and over time: position, drift, repeatability, loops, stick-slip."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.numbers import with_interval
from pneudrive.report import axes as draw
from pneudrive.report import style
from pneudrive.report.campaign.curves import MM, condition_names
from pneudrive.report.page import Paragraph
from pneudrive.report.topics import Topic
from pneudrive.report.words import plural, spread_evenly

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from pneudrive.friction.campaign.loops import Loop
    from pneudrive.friction.campaign.result import CampaignCharacteristics, PositionPattern
    from pneudrive.report.page import Section

HOUR_S = 3600.0
MOST_PANELS = 6
MOST_LOOPS = 6
MOST_CONDITIONS = 8


def position(found: CampaignCharacteristics) -> Section | None:
    """Return the section on friction along the stroke."""
    shown = [p for p in found.position if np.isfinite(p.relative).sum() > 3][:MOST_PANELS]
    if not shown:
        return None
    topic = Topic("campaign", "position")
    rows = (row for p in shown for row in _patterns(found, p))
    picture = topic.picture("campaign-position", draw_position(found, shown))
    return topic.section(topic.text(), picture, topic.table(rows))


def _patterns(found: CampaignCharacteristics, p: PositionPattern) -> Iterator[tuple]:
    label = _place(found, p)
    yield label, "trend", with_interval(p.trend_per_m, 100.0, "%/m"), p.trend_per_m.p
    for h in p.harmonics:
        wave = f"wavelength {MM * h.wavelength_m:.3g} mm"
        yield label, wave, with_interval(h.amplitude, 100.0, "%"), h.amplitude.p


def _place(found: CampaignCharacteristics, p: PositionPattern) -> str:
    return condition_names(found)(p.condition) if p.condition is not None else p.levels or "all cycles"


def draw_position(found: CampaignCharacteristics, shown: list[PositionPattern]) -> Figure:
    """Draw relative friction over position, one panel for each condition."""
    label = "friction minus its mean / %"
    figure, axes = draw.grid(len(shown), 3, 1.9, 0.5, x="position / mm", y=label, sharey=True)
    for axis, p in zip(axes, shown, strict=True):
        known = np.isfinite(p.relative)
        x = MM * p.position_m[known]
        middle, low, high = (100.0 * (v[known] - 1.0) for v in (p.relative, p.low, p.high))
        draw.tinted(axis, x, (low, high))
        axis.plot(x, middle, color=style.BLUE, lw=1.0)
        draw.zero_line(axis, 0.6)
        axis.set_title(f"{_place(found, p)}\n({plural(p.cycles, 'cycle')})")
    return figure


def drift(found: CampaignCharacteristics) -> Section | None:
    """Return the section on changes over the campaign: control runs, run-in, temperature, zero of the sensor."""
    d, zero = found.drift, found.zero
    if d is None:
        return None
    topic = Topic("campaign", "drift")
    basis = topic.texts["told"].get(d.basis)
    causes = (
        ("over time", d.per_hour, "N/h"),
        ("over travel (run-in)", d.per_decade_of_travel, "N per decade"),
        ("with temperature", d.per_kelvin, "N/K"),
        ("after an interruption", d.interrupted, "N"),
    )
    rows: list[tuple] = [
        (word, with_interval(e, unit=unit), e.p) if e else (word, "the plan does not determine the drift", None)
        for word, e, unit in causes
    ]
    if basis:
        rows.append(("states of the campaign, relative to its mean", f"{d.spread_n:.2g} N (standard deviation)", ""))
    if zero.time_s.size:
        rows.append(("zero of the force sensor", with_interval(zero.per_hour, unit="N/h"), ""))
    drawn = basis and d.time_s.size > 2 and np.isfinite(d.drift_n).any()
    return topic.section(
        Paragraph(topic.say(told=basis or topic.say("untold")) + (topic.say("model") if basis else "")),
        topic.picture("campaign-drift", draw_drift(found)) if drawn else None,
        topic.table(rows),
    )


def draw_drift(found: CampaignCharacteristics) -> Figure:
    """Draw drift over time with control runs, and below it the sensor's zero if there are zero runs."""
    d, zero = found.drift, found.zero
    assert d is not None
    two = zero.time_s.size > 1
    figure, axes = draw.stack(3.8 if two else 2.6, [2, 1] if two else [1], "time / h")
    axes[0].margins(x=0.02)  # room for markers
    order = np.argsort(d.time_s)
    hours = d.time_s[order] / HOUR_S
    draw.tinted(axes[0], hours, (d.low_n[order], d.high_n[order]))
    axes[0].plot(hours, d.drift_n[order], color=style.BLUE, label="drift of the mixed model")
    if d.sentinel_n.size:
        away = d.sentinel_n - d.sentinel_n.mean()
        axes[0].plot(d.sentinel_time_s / HOUR_S, away, "D", color=style.ORANGE, ms=4, mfc="white", label="sentinels")
    draw.zero_line(axes[0], 0.6)
    axes[0].set_ylabel("drift / N")
    axes[0].legend(ncols=2)
    if two:
        black = {"fmt": "s", "color": style.BLACK, "mfc": "white", "ms": 3.5}
        axes[1].errorbar(zero.time_s / HOUR_S, zero.zero_n, yerr=2 * zero.stderr_n, **black)
        axes[1].set_ylabel("sensor zero / N")
    return figure


def repeatability(found: CampaignCharacteristics) -> Section | None:
    """Return the section on repeatability."""
    r = found.repeatability
    if r is None:
        return None
    topic = Topic("campaign", "repeatability")
    rows = (
        ("within a block, equal conditions (repeatability)", r.within or "not repeated"),
        ("between blocks and days", r.between or "not repeated"),
        ("in total (reproducibility)", r.total or "not repeated"),
    )
    scale = topic.say("relative" if r.relative else "absolute")
    return topic.section(topic.text(basis=r.basis, scale=scale), topic.table(rows))


def loops(found: CampaignCharacteristics) -> Section | None:
    """Return the section on hysteresis around reversals."""
    if not found.loops:
        return None
    topic, named = Topic("campaign", "loops"), condition_names(found)
    shown = spread_evenly(sorted(found.loops, key=lambda loop: loop.speed_m_s), MOST_LOOPS)
    rows = (SimpleNamespace(condition=named(loop.condition), loop=loop) for loop in shown)
    return topic.section(topic.text(), topic.picture("campaign-loops", draw_loops(found, shown)), topic.table(rows))


def draw_loops(found: CampaignCharacteristics, shown: list[Loop]) -> Figure:
    """Draw friction over position around reversals."""
    figure, axes = draw.grid(len(shown), 3, 2.1, 0.4, x="position / mm", y="friction / N", sharey=True)
    for axis, loop in zip(axes, shown, strict=True):
        axis.plot(MM * loop.position_m, loop.friction_n, ".", ms=1.4, color=style.BLUE)
        draw.zero_line(axis, 0.6)
        axis.set_title(f"{MM * loop.speed_m_s:.3g} mm/s, {condition_names(found)(loop.condition)}")
    return figure


def stick_slip(found: CampaignCharacteristics) -> Section | None:
    """Return the section on stick-slip."""
    if not found.stick_slip:
        return None
    topic, named = Topic("campaign", "stick-slip"), condition_names(found)
    rows = [SimpleNamespace(condition=named(p.condition), point=p) for p in found.stick_slip if p.share > 0]
    return topic.section(
        topic.text(thresholds=" ".join(t.text for t in found.stick_slip_thresholds)),
        topic.picture("campaign-stick-slip", _draw_ripple(found)),
        topic.table(rows) if rows else None,
    )


def _draw_ripple(found: CampaignCharacteristics) -> Figure:
    figure = style.new_figure(2.5)
    axis = figure.subplots()
    conditions = list(dict.fromkeys(p.condition for p in found.stick_slip))
    for index, condition in enumerate(spread_evenly(conditions, MOST_CONDITIONS)):
        look, label = style.look(index), condition_names(found)(condition)
        points = sorted((p for p in found.stick_slip if p.condition == condition), key=lambda p: p.speed_m_s)
        speed, ripple = (np.array([f * getattr(p, n) for p in points]) for f, n in ((MM, "speed_m_s"), (100, "ripple")))
        slips = [p.share > 0 for p in points]
        draw.marks(axis, speed, ripple, look, 4, ls=look.linestyle, label=label)
        draw.marks(axis, speed[slips], ripple[slips], look, 4, mfc=look.color)
    draw.speed_axis(axis, [MM * p.speed_m_s for p in found.stick_slip])
    axis.set_ylim(bottom=0)
    axis.set_ylabel("ripple of speed / %")
    draw.legend_of(figure, axis, most=3)
    return figure
