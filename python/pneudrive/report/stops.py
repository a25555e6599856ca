"""Effects of stops: relaxation while held, breakaway against stop duration, return to uninterrupted sliding."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.figures import Axis, Band, Figure, Line, Look, Markers, Panel, Rule, ends, look
from pneudrive.friction.friction_map import PA_PER_BAR
from pneudrive.numbers import with_interval
from pneudrive.report.tables import CHAMBERS, MM, condition_names, plural, spread_evenly
from pneudrive.report.topics import Topic

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.campaign.stops.dwell_law import DwellSeries
    from pneudrive.friction.campaign.stops.dwell_models import DwellLawFit
    from pneudrive.friction.campaign.stops.stop import Stop
    from pneudrive.report.page import Block, Section

MOST_TRACES = 3
MOST_SERIES = MOST_CONDITIONS = 4
#: Time around a restart that is drawn, in units of the time from restart to peak.
BEFORE, AFTER = 1.5, 20.0
SHORTEST_S = 1e-3
APPROACH = 0.7  # share of the approach that is drawn at most
SHAPES = {"t0": "t0", "tau": "τ", "gamma": "γ", "m": "m"}
DURATION, INCREMENT = Axis("stop duration / s", "log"), Axis("breakaway increment / N", above=0.15)


def section(found: CampaignCharacteristics) -> Section | None:
    """Return the section on stops; None without stops."""
    if not found.stops:
        return None
    topic = Topic("campaign", "stops")
    series = [s for s in found.dwell if s.stops and s.curve is not None]
    moved = any(s.relaxation is not None or s.recovery for s in found.stops)
    return topic.section(
        topic.text(stops=plural(len(found.stops), "stop")),
        topic.picture("campaign-stop-traces", traces(found)),
        *(_dwell_blocks(topic, found, series[:MOST_SERIES]) if series else ()),
        *(_relaxation_blocks(topic, found) if moved else ()),
        *topic.listed((str(s) for s in found.statements if s.topic == "stops"), "spoken"),
    )


# --- traces ----------------------------------------------------------------------------------------------------------


def traces(found: CampaignCharacteristics) -> Figure:
    """Draw a short, a middle and a long stop, and their restarts in detail."""
    usable = [s for s in found.stops if s.usable] or list(found.stops)
    chosen = spread_evenly(sorted(usable, key=lambda s: s.dwell_s), MOST_TRACES)
    named = condition_names(found)
    panels = [panel for stop in chosen for panel in (_whole(stop, named(stop.condition)), _restart(stop))]
    return Figure(panels, columns=2, row_in=1.75, rest_in=0.4, widths=(3, 2))


RUNNING = Look("blue", "--")


def _whole(stop: Stop, condition: str) -> Panel:
    t = stop.trace
    held = "released" if stop.released else "held"
    way = "+x" if stop.direction > 0 else "−x"
    title = f"{stop.stop_s:g} s {held}, restart {way} at {MM * stop.speed_m_s:.3g} mm/s, {condition}"
    reach = max(stop.dwell_s, 3 * stop.loading_s, SHORTEST_S)
    # The start of the approach may still show the reversal.
    span = (max(APPROACH * t.time_s[0], -0.35 * reach), min(t.time_s[-1], 1.6 * reach + AFTER * stop.loading_s))
    marks = [
        Rule((0.0, stop.dwell_s)),
        Line(t.time_s, t.friction_n, width=0.7),
        Rule(y=stop.running_n, look=RUNNING, width=0.9),
    ]
    return Panel(
        marks, title, Axis("time since rest / s", low=span[0], high=span[1]), _force(stop, *span, "friction / N")
    )


def _restart(stop: Stop) -> Panel:
    shown = max(stop.loading_s, SHORTEST_S)
    begin, end = -BEFORE * shown, AFTER * shown
    marks = [
        Markers([stop.loading_s], [stop.breakaway_n], look=Look("orange"), size=7.0),
        Markers(stop.trace.time_s - stop.dwell_s, stop.trace.friction_n, look=Look("black", "-", "."), size=1.8),
        Rule(y=stop.running_n, look=RUNNING, width=0.9),
    ]
    x = Axis("time since restart / ms", low=begin, high=end)
    return Panel(marks, "", x, _force(stop, stop.dwell_s + begin, stop.dwell_s + end, ""))


def _force(stop: Stop, begin_s: float, end_s: float, label: str) -> Axis:
    """Return an axis with the forces of a span of time."""
    time, friction = stop.trace.time_s, stop.trace.friction_n
    inside = friction[(time >= begin_s) & (time <= end_s)]
    if not inside.size or np.ptp(inside) <= 0:
        return Axis(label)
    margin = 0.08 * float(np.ptp(inside))
    return Axis(label, low=float(inside.min()) - margin, high=float(inside.max()) + 2 * margin)


# --- breakaway against duration --------------------------------------------------------------------------------------


def _dwell_blocks(topic: Topic, found: CampaignCharacteristics, shown: list[DwellSeries]) -> Iterator[Block]:
    panels = [_increments(found, s) for s in shown]
    figure = Figure(panels, DURATION, INCREMENT, columns=2, row_in=3.2, rest_in=0.3, legend="panel", text_scale=0.9)
    yield topic.picture("campaign-dwell", figure)
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


def _increments(found: CampaignCharacteristics, s: DwellSeries) -> Panel:
    """Draw the increments of a series over duration, with the best laws."""
    marks: list[Any] = []
    for index, condition in enumerate(s.conditions[:MOST_CONDITIONS]):
        own, stops = look(index), [stop for stop in s.stops if stop.condition == condition]
        marks.append(Band(s.duration_s, s.low_n[index], s.high_n[index], look=own))
        marks.append(Line(s.duration_s, s.increment_n[index], look=own))
        durations = [stop.dwell_s * (1.0 + 0.04 * index) for stop in stops]
        label = condition_names(found)(condition)
        marks.append(Markers(durations, [stop.increment_n for stop in stops], label, own, size=3.4))
    for law, dash in ((best_of(s.laws, saturates=False), (0, (6, 2))), (best_of(s.laws, saturates=True), ":")):
        if law is not None:
            title = f"{law.form.title} (ΔAICc {law.delta:.0f})" if np.isfinite(law.delta) else law.form.title
            marks.append(Line(s.duration_s, law.increment_n(s.duration_s, 0), title, Look("orange", dash), 1.4))
    return Panel(marks, s.name)


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
        shape = "; ".join(_shape(law, *unit) for unit in law.form.units.items()) or None
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


# --- relaxation and way back -----------------------------------------------------------------------------------------


def _relaxation_blocks(topic: Topic, found: CampaignCharacteristics) -> Iterator[Block]:
    yield topic.picture("campaign-stop-relaxation", relaxation(found))
    groups: dict[tuple[float, bool, float], list[Stop]] = {}
    for stop in found.stops:
        groups.setdefault((stop.speed_m_s, stop.released, stop.stop_s), []).append(stop)
    yield topic.table((_medians(*key, group) for key, group in sorted(groups.items())), "medians")


def relaxation(found: CampaignCharacteristics) -> Figure:
    """Draw relaxation and recovery distance against duration; a triangle is a recovery that is cut off."""
    left: list[Markers] = []
    right: list[Markers] = []
    conditions = list(dict.fromkeys(s.condition for s in sorted(found.stops, key=lambda s: s.condition)))
    for index, condition in enumerate(conditions[:MOST_CONDITIONS]):
        own, shift, label = look(index), 1.0 + 0.05 * index, condition_names(found)(condition)
        stops = [(s.dwell_s * shift, s) for s in found.stops if s.condition == condition]
        held = [(t, s.relaxation.amount) for t, s in stops if s.relaxation is not None]
        back = [(t, s.recovery) for t, s in stops if s.recovery is not None]
        whole = [(t, r.distance) for t, r in back if r.complete]
        cut = [(t, r.seen_m) for t, r in back if not r.complete]
        for marks, pairs in ((left, held), (right, whole)):
            if pairs:
                value, low, high = ends(e for _, e in pairs)
                marks.append(Markers([t for t, _ in pairs], value, label, own, low, high, 3.2))
        if cut:
            times, seen = zip(*cut, strict=True)
            right.append(Markers(times, seen, look=own._replace(marker="^"), filled=True))
    panels = [Panel(left, y="fall of the force / N") if any(s.relaxation is not None for s in found.stops) else None]
    has_recovery = any(s.recovery is not None for s in found.stops)
    panels.append(Panel(right, y=Axis("way back / mm", low=0.0)) if has_recovery else None)
    return Figure(panels, DURATION, columns=2, row_in=2.7, rest_in=0.0, entries=3)


def _medians(speed_m_s: float, released: bool, duration_s: float, group: list[Stop]) -> tuple[object, ...]:
    """Return medians over stops of equal duration, axis and speed."""
    relaxed = [s.relaxation for s in group if s.relaxation]
    back = [s.recovery for s in group if s.recovery]
    whole = [r for r in back if r.complete]
    forms = [r.form for r in relaxed]
    decades = [r.per_decade for r in relaxed if r.per_decade]
    distance = _median([MM * r.distance.value for r in whole])
    cut = f" ({len(back) - len(whole)} cut)" if len(back) > len(whole) else ""
    return (
        f"{duration_s:g} s, {'released' if released else 'held'}, {MM * speed_m_s:.3g} mm/s",
        len(group),
        _median([r.amount.value for r in relaxed]),
        max(set(forms), key=forms.count) if forms else None,
        _median([e.value for e in decades if e.high - e.low < 2.0 * abs(e.value)]),
        _median([s.increment_n for s in group]),
        _median([s.loading_rate_n_s for s in group]),
        f"{'–' if distance is None else format(distance, '.3g')}{cut}",
        _median([r.time.value for r in whole]),
    )


def _median(values: list[float]) -> float | None:
    known = [v for v in values if np.isfinite(v)]
    return float(np.median(known)) if known else None
