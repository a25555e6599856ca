"""Effects of stops: relaxation while held, breakaway against stop duration, return to uninterrupted sliding."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.conditions import PA_PER_BAR
from pneudrive.numbers import with_interval
from pneudrive.report import axes as draw
from pneudrive.report import style
from pneudrive.report.campaign.curves import CHAMBERS, MM, condition_names
from pneudrive.report.topics import Topic
from pneudrive.report.words import plural, spread_evenly

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.estimate.estimates import Estimate
    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.campaign.stops.dwell_law import DwellSeries
    from pneudrive.friction.campaign.stops.dwell_models import DwellLawFit
    from pneudrive.friction.campaign.stops.stop import Stop, StopTrace
    from pneudrive.report.page import Block, Section

MOST_TRACES = 3
MOST_SERIES = 4
MOST_CONDITIONS = 4
#: Time around a restart that is drawn, in units of the time from restart to peak.
BEFORE, AFTER = 1.5, 20.0
SHORTEST_S = 1e-3
APPROACH = 0.7  # share of the approach that is drawn at most
SHAPES = {"t0": "t0", "tau": "τ", "gamma": "γ", "m": "m"}


def stops(found: CampaignCharacteristics) -> Section | None:
    """Return the section on stops; None without stops."""
    if not found.stops:
        return None
    topic = Topic("campaign", "stops")
    series = [s for s in found.dwell if s.stops and s.curve is not None]
    moved = any(s.relaxation is not None or s.recovery for s in found.stops)
    return topic.section(
        topic.text(stops=plural(len(found.stops), "stop")),
        topic.picture("campaign-stop-traces", draw_traces(found)),
        *(_dwell_blocks(topic, found, series[:MOST_SERIES]) if series else ()),
        *(_relaxation_blocks(topic, found) if moved else ()),
        *topic.listed((str(s) for s in found.statements if s.topic == "stops"), "spoken"),
    )


# --- traces --------------------------------------------------------------------------------------------------------


def draw_traces(found: CampaignCharacteristics) -> Figure:
    """Draw a short, a middle and a long stop."""
    usable = [s for s in found.stops if s.usable] or list(found.stops)
    chosen = spread_evenly(sorted(usable, key=lambda s: s.dwell_s), MOST_TRACES)
    figure = style.new_figure(1.75 * len(chosen) + 0.4)
    grid = figure.subplots(len(chosen), 2, squeeze=False, width_ratios=[3, 2])
    for row, stop in zip(grid, chosen, strict=True):
        _whole(row[0], stop, condition_names(found)(stop.condition))
        _restart(row[1], stop)
        row[0].set_ylabel("friction / N")
    grid[-1][0].set_xlabel("time since rest / s")
    grid[-1][1].set_xlabel("time since restart / ms")
    return figure


def _whole(axis: Axes, stop: Stop, condition: str) -> None:
    t = stop.trace
    axis.axvspan(0.0, stop.dwell_s, color=style.SHADE, lw=0)
    axis.plot(t.time_s, t.friction_n, color=style.BLACK, lw=0.7)
    axis.axhline(stop.running_n, color=style.BLUE, ls="--", lw=0.9)
    held = "released" if stop.released else "held"
    way = "+x" if stop.direction > 0 else "−x"
    axis.set_title(f"{stop.stop_s:g} s {held}, restart {way} at {MM * stop.speed_m_s:.3g} mm/s, {condition}")
    reach = max(stop.dwell_s, 3 * stop.loading_s, SHORTEST_S)
    # The start of the approach may still show the reversal.
    begin = max(APPROACH * t.time_s[0], -0.35 * reach)
    _limits(axis, t, begin, min(t.time_s[-1], 1.6 * reach + AFTER * stop.loading_s))


def _restart(axis: Axes, stop: Stop) -> None:
    time = 1e3 * (stop.trace.time_s - stop.dwell_s)
    axis.plot(time, stop.trace.friction_n, ".", color=style.BLACK, ms=1.8)
    axis.axhline(stop.running_n, color=style.BLUE, ls="--", lw=0.9)
    axis.plot(1e3 * stop.loading_s, stop.breakaway_n, "o", ms=7, mfc="none", color=style.ORANGE, mew=1.2)
    shown = max(stop.loading_s, SHORTEST_S)
    begin, end = -BEFORE * shown, AFTER * shown
    _limits(axis, stop.trace, stop.dwell_s + begin, stop.dwell_s + end)
    axis.set_xlim(1e3 * begin, 1e3 * end)


def _limits(axis: Axes, trace: StopTrace, begin_s: float, end_s: float) -> None:
    """Set the axes to a span of time and its forces."""
    inside = trace.friction_n[(trace.time_s >= begin_s) & (trace.time_s <= end_s)]
    axis.set_xlim(begin_s, end_s)
    if inside.size and np.ptp(inside) > 0:
        margin = 0.08 * float(np.ptp(inside))
        axis.set_ylim(float(inside.min()) - margin, float(inside.max()) + 2 * margin)


# --- breakaway against duration ------------------------------------------------------------------------------------


def _dwell_blocks(topic: Topic, found: CampaignCharacteristics, shown: list[DwellSeries]) -> Iterator[Block]:
    yield topic.picture("campaign-dwell", draw_dwell(found, shown))
    yield topic.table((row for s in shown for row in _slopes(found, s)), "slopes")
    for s in shown:
        if s.laws:
            yield topic.table(_laws(s), "laws", series=s.name, reference_s=s.reference_s)
    under_pressure = [s for s in shown if s.pressure is not None]
    if under_pressure:
        yield topic.table((row for s in under_pressure for row in _pressures(s)), "pressures")


def best_of(laws: tuple[DwellLawFit, ...], *, saturates: bool) -> DwellLawFit | None:
    """Return the best law among the laws that saturate, or among those that do not."""
    return next((law for law in laws if law.form.saturates == saturates and law.name != "none"), None)


def draw_dwell(found: CampaignCharacteristics, shown: list[DwellSeries]) -> Figure:
    """Draw the increment over duration, one panel for each series."""
    figure, axes = draw.grid(len(shown), 2, 3.2, 0.3)
    for axis, s in zip(axes, shown, strict=True):
        for index, condition in enumerate(s.conditions[:MOST_CONDITIONS]):
            look = style.look(index)
            draw.band(axis, s.duration_s, s.increment_n[index], (s.low_n[index], s.high_n[index]), look, lw=1.1)
            own = [stop for stop in s.stops if stop.condition == condition]
            durations = [stop.dwell_s * (1.0 + 0.04 * index) for stop in own]
            label = condition_names(found)(condition)
            draw.marks(axis, durations, [stop.increment_n for stop in own], look, 3.4, label=label)
        for law, line in ((best_of(s.laws, saturates=False), (0, (6, 2))), (best_of(s.laws, saturates=True), ":")):
            if law is not None:
                values = law.increment_n(s.duration_s, 0)
                axis.plot(s.duration_s, values, color=style.ORANGE, ls=line, lw=1.4, label=_law_label(law))
        draw.duration_axis(axis, s.name)
        axis.legend(fontsize=6.5)
        style.headroom(axis, above=0.15)
    return figure


def _law_label(law: DwellLawFit) -> str:
    return f"{law.form.title} (ΔAICc {law.delta:.0f})" if np.isfinite(law.delta) else law.form.title


def _slopes(found: CampaignCharacteristics, s: DwellSeries) -> Iterator[tuple]:
    durations = [stop.dwell_s for stop in s.stops]
    span = f"{min(durations):.3g} to {max(durations):.3g}"
    for condition, slope, mean in zip(s.conditions, s.slopes, s.mean_slopes, strict=True):
        yield f"{s.name}: {condition_names(found)(condition)}", span, s.reference_s, slope, mean
    if len(s.conditions) > 1:
        yield f"{s.name}: mean", span, s.reference_s, s.slope, s.mean_slope


def _laws(s: DwellSeries) -> Iterator[tuple]:
    least = min(law.bic for law in s.laws)
    for law in s.laws:
        shape = "; ".join(_shape(law, *one) for one in law.form.units.items()) or None
        slope = f"{law.slope_n:.3g} ({law.slope_low_n:.3g} … {law.slope_high_n:.3g})"
        yield f"{law.form.title}: {law.form.formula}", shape, slope, law.delta, law.bic - least, law.weight


def _shape(law: DwellLawFit, name: str, unit: str) -> str:
    low, high = law.shape_intervals[name]
    lower = f"{low:.2g}" if low > 0 else "open"
    upper = f"{high:.2g}" if np.isfinite(high) else "open"
    return f"{SHAPES[name]} = {law.shape[name]:.2g} ({lower} … {upper}) {unit}".strip()


def _pressures(s: DwellSeries) -> Iterator[tuple[str | None, ...]]:
    p = s.pressure
    assert p is not None
    slopes, increments = (p.slope_a, p.slope_b, p.slope_sum), (p.increment_a, p.increment_b, p.increment_sum)
    for word, slope, increment in zip(CHAMBERS, slopes, increments, strict=True):
        if slope is not None:
            yield s.name, word, with_interval(slope, PA_PER_BAR, ""), with_interval(increment, PA_PER_BAR, "")
    if not any(slopes):
        yield s.name, p.statement, None, None


# --- relaxation and way back ---------------------------------------------------------------------------------------


def _relaxation_blocks(topic: Topic, found: CampaignCharacteristics) -> Iterator[Block]:
    yield topic.picture("campaign-stop-relaxation", draw_relaxation(found))
    groups: dict[tuple[float, bool, float], list[Stop]] = {}
    for stop in found.stops:
        groups.setdefault((stop.speed_m_s, stop.released, stop.stop_s), []).append(stop)
    yield topic.table((_medians(*key, group) for key, group in sorted(groups.items())), "medians")


def draw_relaxation(found: CampaignCharacteristics) -> Figure:
    """Draw relaxation and recovery distance against duration."""
    figure = style.new_figure(2.7)
    left, right = figure.subplots(1, 2)
    right.set_visible(any(s.recovery is not None for s in found.stops))
    left.set_visible(any(s.relaxation is not None for s in found.stops))
    conditions = list(dict.fromkeys(s.condition for s in sorted(found.stops, key=lambda s: s.condition)))
    for index, condition in enumerate(conditions[:MOST_CONDITIONS]):
        look, shift = style.look(index), 1.0 + 0.05 * index
        own = [s for s in found.stops if s.condition == condition]
        common = {"ms": 3.2, "elinewidth": 0.6, "capsize": 0, "label": condition_names(found)(condition)}
        held = [(s.dwell_s * shift, s.relaxation.amount) for s in own if s.relaxation is not None]
        if held:
            value, low, high = draw.arrays(e for _, e in held)
            draw.bars(left, [t for t, _ in held], value, (high - low) / 2.0, look, **common)
        back = [(s.dwell_s * shift, s.recovery) for s in own if s.recovery is not None]
        whole = [(t, r.distance) for t, r in back if r.complete]
        if whole:
            ends = draw.arrays((e for _, e in whole), MM)
            draw.bars(right, [t for t, _ in whole], ends[0], draw.spread(*ends), look, **common)
        cut = [(t, r.seen_m) for t, r in back if not r.complete]
        if cut:
            right.plot([t for t, _ in cut], [MM * m for _, m in cut], "^", color=look.color, ms=4, ls="none")
    for axis in (left, right):
        style.logarithmic(axis)
        axis.set_xlabel("stop duration / s")
    left.set_ylabel("fall of the force / N")
    right.set_ylabel("way back / mm")
    right.set_ylim(bottom=0)
    draw.legend_of(figure, left if left.get_legend_handles_labels()[0] else right, most=3)
    return figure


def _medians(speed_m_s: float, released: bool, duration_s: float, group: list[Stop]) -> tuple[object, ...]:
    """Return medians over stops of equal duration, axis and speed."""
    relaxed = [s.relaxation for s in group if s.relaxation]
    back = [s.recovery for s in group if s.recovery]
    whole = [r for r in back if r.complete]
    forms = [r.form for r in relaxed]
    distance = _median([MM * r.distance.value for r in whole])
    cut = f" ({len(back) - len(whole)} cut)" if len(back) > len(whole) else ""
    return (
        f"{duration_s:g} s, {'released' if released else 'held'}, {MM * speed_m_s:.3g} mm/s",
        len(group),
        _median([r.amount.value for r in relaxed]),
        max(set(forms), key=forms.count) if forms else None,
        _median([r.per_decade.value for r in relaxed if r.per_decade and _told(r.per_decade)]),
        _median([s.increment_n for s in group]),
        _median([s.loading_rate_n_s for s in group]),
        f"{'–' if distance is None else format(distance, '.3g')}{cut}",
        _median([r.time.value for r in whole]),
    )


def _told(e: Estimate) -> bool:
    return e.high - e.low < 2.0 * abs(e.value)


def _median(values: list[float]) -> float | None:
    known = [v for v in values if np.isfinite(v)]
    return float(np.median(known)) if known else None
