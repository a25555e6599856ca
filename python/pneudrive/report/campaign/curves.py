"""Curves of friction over speed of a campaign, the contribution of the air, and effects of the pressures."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.conditions import PA_PER_BAR, Condition
from pneudrive.numbers import with_interval, with_u
from pneudrive.report import axes as draw
from pneudrive.report import style
from pneudrive.report.page import Paragraph
from pneudrive.report.topics import Topic
from pneudrive.report.words import plural, spread_evenly
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from matplotlib.figure import Figure

    from pneudrive.friction.campaign.result import AirShare, CampaignCharacteristics, Curve, PressureEffects
    from pneudrive.report.page import Section
    from pneudrive.views import ShownCurve

MOST_CURVES = 8  # that a reader can distinguish in one picture
MOST_PANELS = 6
SHOWN_SPEEDS = 12  # rows of a table
MM = 1e3
CHAMBERS = ("chamber a", "chamber b", "both together")


def condition_names(found: CampaignCharacteristics) -> Callable[[Condition], str]:
    """Return a function that names the conditions of a campaign."""
    return partial(Condition.label, ambient_pressure_pa=found.identity.ambient_pressure_pa)


def curves(found: CampaignCharacteristics) -> Section | None:
    """Return the section on friction over speed at every condition."""
    both = [c for c in found.curves if c.direction == 0]
    if not both:
        return None
    topic, view = Topic("campaign", "curves"), found.view()
    shown = spread_evenly(view.curves, MOST_CURVES)
    text = topic.say()
    if len(shown) < len(both):
        text += topic.say("fewer", shown=len(shown), all=len(both))
    if any(c.contains_air for c in both):
        text += topic.say("with_air")
    picture = topic.picture("campaign-curves", draw_curves(shown))
    return topic.section(Paragraph(text), picture, topic.table(_curve_rows(found, both)))


def _curve_rows(found: CampaignCharacteristics, both: Sequence[Curve]) -> Iterator[tuple]:
    named = condition_names(found)
    for c in both[:MOST_CURVES]:
        for i in spread_evenly(np.flatnonzero(c.measured).tolist(), SHOWN_SPEEDS):
            friction = with_u(float(c.friction_n[i]), float(c.high_n[i] - c.low_n[i]) / 2.0, "")
            speed, uncertainties = MM * c.speed_m_s[i], (c.stderr_n[i], c.u_systematic_n[i])
            yield (named(c.condition), speed, friction, *uncertainties, int(c.cycles[i]))


def draw_curves(shown: Sequence[ShownCurve]) -> Figure:
    """Draw curves with bands in one picture, with a colour for each group if there are several."""
    figure = style.new_figure(3.8)
    axis = figure.subplots()
    groups = sorted({c.group for c in shown})
    (x_size, x_unit), (size, unit) = readable(shown[0].x_unit), readable(shown[0].unit)
    for index, c in enumerate(shown):
        look, x, y = style.look(index), c.x / x_size, c.y / size
        if len(groups) > 1:
            look = look._replace(color=style.look(groups.index(c.group)).color)
        low, high = (y, y) if c.band is None else (c.band[0] / size, c.band[1] / size)
        if x.size == 1:
            draw.bars(axis, x, y, draw.spread(y, low, high), look, ms=3.6, label=c.label)
        else:
            draw.band(axis, x, y, (low, high), look, 0.13, lw=1.0, label=c.label)
            draw.marks(axis, x[c.measured], y[c.measured], look, 3.6)
        if c.excluded[0].size:
            axis.plot(c.excluded[0] / x_size, c.excluded[1] / size, "x", color=look.color, ms=4)
    draw.speed_axis(axis, np.concatenate([c.x for c in shown]) / x_size)
    axis.set(xlabel=f"{shown[0].x_quantity} / ({x_unit})", ylabel=f"{shown[0].quantity} / {unit}")
    draw.legend_of(figure, axis, most=3)
    return figure


def air(found: CampaignCharacteristics) -> Section | None:
    """Return the section on the force of the air in rising curves."""
    if not found.air:
        return None
    topic = Topic("campaign", "air")
    separated = [a for a in found.air if a.separated]
    shown = spread_evenly(separated or list(found.air), MOST_PANELS)
    text = "separated" if separated else "together"
    return topic.section(
        topic.text(text, rises=" ".join(_rise(topic, found, a) for a in shown)),
        topic.picture("campaign-air", draw_air(found, shown), parts=topic.say(f"parts_{text}")),
        topic.table(_air_rows(found, shown)),
    )


def _rise(topic: Topic, found: CampaignCharacteristics, a: AirShare) -> str:
    """Return the text on the contribution of air to the rise from the least total force to the highest speed."""
    least, last = int(np.argmin(a.total_n)), a.speed_m_s.size - 1
    where = condition_names(found)(a.condition)
    rise = float(a.total_n[last] - a.total_n[least])
    part = float(a.air_n[last] - a.air_n[least])
    if rise <= 0 or least == last:
        return topic.say("level", where=where)
    reach = float(a.air_high_n[last] - a.air_low_n[last]) / 2.0
    share = f"{part:.2g} N ({100 * part / rise:.0f} %) are" if abs(part) > reach else f"at most {reach:.2g} N may be"
    slow, fast = (MM * a.speed_m_s[i] for i in (least, last))
    return topic.say("rise", where=where, slow=slow, fast=fast, rise=rise, share=share)


def _parts(a: AirShare) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return the force with the ends of its interval, and the same for its parts if they can be separated."""
    total = {"total": (a.total_n, a.total_low_n, a.total_high_n)}
    if not a.separated:
        return total
    return total | {"seal": (a.seal_n, a.seal_low_n, a.seal_high_n), "air": (a.air_n, a.air_low_n, a.air_high_n)}


def draw_air(found: CampaignCharacteristics, shown: Sequence[AirShare]) -> Figure:
    """Draw total, air and seal over speed, one panel for each condition."""
    figure, axes = draw.grid(len(shown), 3, 2.3, 0.5, y="force / N", sharey=True)
    for axis, a in zip(axes, shown, strict=True):
        speed = MM * a.speed_m_s
        for index, (label, (middle, *ends)) in enumerate(_parts(a).items()):
            draw.band(axis, speed, middle, (ends[0], ends[1]), style.look(index), label=label)
        if not a.separated:
            axis.plot(speed, a.air_bound_n, ls=":", color=style.ORANGE, label="air, at most")
        draw.speed_axis(axis, speed)
        axis.set_title(condition_names(found)(a.condition))
    draw.legend_of(figure, axes[0])
    return figure


def _air_rows(found: CampaignCharacteristics, shown: Sequence[AirShare]) -> Iterator[tuple]:
    for a in shown:
        for i in sorted({0, a.speed_m_s.size // 2, a.speed_m_s.size - 1}):
            cells = [with_u(float(m[i]), float(high[i] - low[i]) / 2.0, "") for m, low, high in _parts(a).values()]
            rest = [] if a.separated else [None, f"at most {a.air_bound_n[i]:.2g}"]
            yield (condition_names(found)(a.condition), MM * a.speed_m_s[i], *cells, *rest)


def pressure(found: CampaignCharacteristics) -> Section | None:
    """Return the section on effects of the chamber pressures, and their interaction."""
    if not found.pressure:
        return None
    topic = Topic("campaign", "pressure")
    texts = []
    for effects in found.pressure:
        pairs = ", ".join(f"{a / PA_PER_BAR:.3g}/{b / PA_PER_BAR:.3g}" for a, b in effects.gauge_pa)
        name = f"{effects.levels}: " if effects.levels else ""
        texts.append(topic.text(name=name, statement=effects.statement, pairs=pairs))
    drawn = [e for e in found.pressure if e.slope_a or e.slope_b or e.slope_sum]
    rows = [row for e in found.pressure for row in _pressure_rows(e)]
    return topic.section(
        *texts,
        topic.picture("campaign-pressure", draw_pressure(drawn)) if drawn else None,
        topic.table(rows) if rows else None,
    )


def _pressure_rows(e: PressureEffects) -> Iterator[tuple]:
    levels = e.levels or "all"
    for word, mean in zip(CHAMBERS, (e.mean_a, e.mean_b, e.mean_sum), strict=True):
        if mean is not None:
            yield levels, word, with_interval(mean, PA_PER_BAR, "N/bar"), mean.p
    if e.interaction is not None:
        yield levels, "interaction a × b", with_interval(e.interaction_n_pa2, PA_PER_BAR**2, "N/bar²"), e.interaction.p
    if e.curvature is not None:
        yield levels, "curvature", "", e.curvature.p


def draw_pressure(effects: Sequence[PressureEffects]) -> Figure:
    """Draw slopes over speed, one panel for each set of levels."""
    figure, axes = draw.grid(len(effects), 3, 2.4, 0.4, y="friction per pressure / (N/bar)", sharey=True)
    for axis, e in zip(axes, effects, strict=True):
        for index, (label, slopes) in enumerate(zip(CHAMBERS, (e.slope_a, e.slope_b, e.slope_sum), strict=True)):
            if slopes:
                look, (value, low, high) = style.look(index), draw.arrays(slopes, PA_PER_BAR)
                speed = MM * e.speed_m_s * (1.0 + 0.03 * (index - 1))  # side by side
                reach = draw.spread(value, low, high)
                draw.bars(axis, speed, value, reach, look, ls=look.linestyle, ms=3.5, label=label)
        draw.zero_line(axis)
        draw.speed_axis(axis, MM * e.speed_m_s)
        axis.set_title(e.levels)
        axis.legend()
    return figure


def direction(found: CampaignCharacteristics) -> Section | None:
    """Return the section on half the difference between both directions."""
    if not found.asymmetry:
        return None
    topic, named = Topic("campaign", "direction"), condition_names(found)
    separable = any(a.basis == "tare" for a in found.asymmetry)
    rows = ((named(a.condition), a.basis, a.mean, a.mean.p, plural(a.speed_m_s.size, "speed")) for a in found.asymmetry)
    return topic.section(topic.text("separable" if separable else "inseparable"), topic.table(rows))
