"""What stops do: relaxation while held, breakaway against stop duration, way back to uninterrupted sliding."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characteristics.basics import PA_PER_BAR
from pneudrive.report import style
from pneudrive.report.campaign_curves import MM, estimate, picture
from pneudrive.report.page import Items, Section, Table, Text
from pneudrive.report.words import plural, spread_evenly

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.characteristics import CampaignCharacteristics, Estimate
    from pneudrive.characteristics.stops.dwell_forms import LawFit
    from pneudrive.characteristics.stops.dwell_law import DwellSeries
    from pneudrive.characteristics.stops.stop import Stop, Trace

MOST_TRACES = 3
MOST_SERIES = 4
MOST_CONDITIONS = 4
#: Time around a restart that is drawn, in units of that from restart to peak.
BEFORE, AFTER = 1.5, 20.0
SHORTEST_S = 1e-3
APPROACH = 0.7  # share of the approach that is drawn at most
SHAPES = {"t0": "t0", "tau": "τ", "gamma": "γ", "m": "m"}


def stops(found: CampaignCharacteristics) -> Section | None:
    """Everything on stops; None where none was made."""
    if not found.stops:
        return None
    blocks: list = [
        Text(
            f"{plural(len(found.stops), 'stop')} in the middle of a move, raw samples. Each gives three results: how "
            "the force relaxes while the piston is held, how much higher the force peaks at the restart than in "
            "uninterrupted sliding, and how far and how long it takes until the curve is back at the uninterrupted one."
        ),
        picture(
            found,
            "campaign-stop-traces",
            "Friction around single stops, with uninterrupted sliding (dashed) and the breakaway peak (ring). Left: "
            "the whole stop; right: the restart, time from its beginning. The offset of the sensor is in it.",
            draw_traces(found),
        ),
    ]
    series = [s for s in found.dwell if s.stops]
    drawn = [s for s in series if s.curve is not None]
    if drawn:
        blocks += _dwell_blocks(found, drawn)
    held = [s for s in found.stops if s.relaxation is not None]
    if held or any(s.recovery for s in found.stops):
        blocks.append(
            picture(
                found,
                "campaign-stop-relaxation",
                "Left: fall of the force while held. Right: travel until the excess over uninterrupted sliding has "
                "fallen to 5 % of the peak; arrows: the move ended before. Bars: 95 % intervals of single stops.",
                draw_relaxation(found),
            )
        )
        blocks.append(_summary(found))
    spoken = tuple(str(s) for s in found.statements if s.topic == "stops")
    if spoken:
        blocks += [Text("What the stops carry, and what they do not:"), Items(spoken)]
    return Section("stops", "Stops", tuple(blocks), synthetic=found.synthetic)


# --- traces --------------------------------------------------------------------------------------------------------


def draw_traces(found: CampaignCharacteristics) -> Figure:
    """Draw a short, a middle and a long stop."""
    usable = [s for s in found.stops if s.usable] or list(found.stops)
    chosen = spread_evenly(sorted(usable, key=lambda s: s.dwell_s), MOST_TRACES)
    figure = style.new_figure(1.75 * len(chosen) + 0.4)
    grid = figure.subplots(len(chosen), 2, squeeze=False, width_ratios=[3, 2])
    for row, stop in zip(grid, chosen, strict=True):
        _whole(row[0], stop, found.identity.ambient_pressure_pa)
        _restart(row[1], stop)
        row[0].set_ylabel("friction / N")
    grid[-1][0].set_xlabel("time since rest / s")
    grid[-1][1].set_xlabel("time since restart / ms")
    return figure


def _whole(axis: Axes, stop: Stop, ambient: float) -> None:
    t = stop.trace
    axis.axvspan(0.0, stop.dwell_s, color=style.SHADE, lw=0)
    axis.plot(t.time_s, t.friction_n, color=style.BLACK, lw=0.7)
    axis.axhline(stop.running_n, color=style.BLUE, ls="--", lw=0.9)
    held = "released" if stop.released else "held"
    way = "+x" if stop.direction > 0 else "−x"
    condition = stop.condition.label(ambient)
    axis.set_title(f"{stop.stop_s:g} s {held}, restart {way} at {MM * stop.speed_m_s:.3g} mm/s, {condition}")
    reach = max(stop.dwell_s, 3 * stop.loading_s, SHORTEST_S)
    # The beginning of the approach may still show the reversal before it.
    _limits(
        axis, t, max(APPROACH * t.time_s[0], -0.35 * reach), min(t.time_s[-1], 1.6 * reach + AFTER * stop.loading_s)
    )


def _restart(axis: Axes, stop: Stop) -> None:
    time = 1e3 * (stop.trace.time_s - stop.dwell_s)
    axis.plot(time, stop.trace.friction_n, ".", color=style.BLACK, ms=1.8)
    axis.axhline(stop.running_n, color=style.BLUE, ls="--", lw=0.9)
    axis.plot(1e3 * stop.loading_s, stop.breakaway_n, "o", ms=7, mfc="none", color=style.ORANGE, mew=1.2)
    shown = max(stop.loading_s, SHORTEST_S)
    begin, end = -BEFORE * shown, AFTER * shown
    _limits(axis, stop.trace, stop.dwell_s + begin, stop.dwell_s + end)
    axis.set_xlim(1e3 * begin, 1e3 * end)


def _limits(axis: Axes, trace: Trace, begin_s: float, end_s: float) -> None:
    """Show a span of time, and the forces in it."""
    inside = trace.friction_n[(trace.time_s >= begin_s) & (trace.time_s <= end_s)]
    axis.set_xlim(begin_s, end_s)
    if inside.size and np.ptp(inside) > 0:
        margin = 0.08 * float(np.ptp(inside))
        axis.set_ylim(float(inside.min()) - margin, float(inside.max()) + 2 * margin)


# --- breakaway against duration ------------------------------------------------------------------------------------


def _dwell_blocks(found: CampaignCharacteristics, series: list[DwellSeries]) -> list:
    shown = series[:MOST_SERIES]
    blocks: list = [
        picture(
            found,
            "campaign-dwell",
            "Breakaway increment over running friction against stop duration: single stops, the law-free curve with "
            "its 95 % band, and the best unbounded and the best saturating law at the first condition.",
            draw_dwell(found, shown),
        ),
        _slopes(found, shown),
    ]
    blocks += [_laws(s) for s in shown if s.laws]
    pressures = [s for s in shown if s.pressure is not None]
    if pressures:
        blocks.append(_pressures(pressures))
    return blocks


def best_of(laws: tuple[LawFit, ...], *, saturates: bool) -> LawFit | None:
    """Return the best law that saturates, or that does not."""
    return next((law for law in laws if law.form.saturates == saturates and law.name != "none"), None)


def draw_dwell(found: CampaignCharacteristics, shown: list[DwellSeries]) -> Figure:
    """Increment over duration, one panel a series."""
    columns = min(2, len(shown))
    figure = style.new_figure(3.2 * -(-len(shown) // columns) + 0.3)
    axes = style.panels(figure, len(shown), columns)
    ambient = found.identity.ambient_pressure_pa
    for axis, s in zip(axes, shown, strict=True):
        for index, condition in enumerate(s.conditions[:MOST_CONDITIONS]):
            look = style.look(index)
            axis.fill_between(s.duration_s, s.low_n[index], s.high_n[index], color=look.color, alpha=0.15, lw=0)
            axis.plot(s.duration_s, s.increment_n[index], color=look.color, ls=look.linestyle, lw=1.1)
            own = [stop for stop in s.stops if stop.condition == condition]
            shift = 1.0 + 0.04 * index
            axis.plot(
                [stop.dwell_s * shift for stop in own],
                [stop.increment_n for stop in own],
                look.marker,
                color=look.color,
                mfc="white",
                ms=3.4,
                ls="none",
                label=condition.label(ambient),
            )
        for law, line in ((best_of(s.laws, saturates=False), (0, (6, 2))), (best_of(s.laws, saturates=True), ":")):
            if law is not None:
                values = law.increment_n(s.duration_s, 0)
                axis.plot(s.duration_s, values, color=style.ORANGE, ls=line, lw=1.4, label=_law_label(law))
        style.logarithmic(axis)
        axis.set_xlabel("stop duration / s")
        axis.set_ylabel("breakaway increment / N")
        axis.set_title(s.name)
        axis.legend(fontsize=6.5)
        style.headroom(axis, above=0.15)
    return figure


def _law_label(law: LawFit) -> str:
    return f"{law.form.title} (ΔAICc {law.delta:.0f})" if np.isfinite(law.delta) else law.form.title


def _slopes(found: CampaignCharacteristics, shown: list[DwellSeries]) -> Table:
    rows = []
    for s in shown:
        durations = [stop.dwell_s for stop in s.stops]
        span = f"{min(durations):.3g} to {max(durations):.3g}"
        for condition, slope, mean in zip(s.conditions, s.slopes, s.mean_slopes, strict=True):
            rows.append(
                (
                    f"{s.name}: {condition.label(found.identity.ambient_pressure_pa)}",
                    span,
                    f"{s.reference_s:g}",
                    estimate(slope, unit=""),
                    estimate(mean, unit=""),
                )
            )
        if len(s.conditions) > 1:
            rows.append(
                (
                    f"{s.name}: mean",
                    span,
                    f"{s.reference_s:g}",
                    estimate(s.slope, unit=""),
                    estimate(s.mean_slope, unit=""),
                )
            )
    head = ("series", "stops, s", "at, s", "slope there, N per decade", "mean slope, N per decade")
    caption = (
        "Slope of breakaway per decade of stop duration with its 95 % interval, free of any law: at one duration, and "
        "on average from the shortest to the longest stop"
    )
    return Table(head, tuple(rows), caption)


def _laws(s: DwellSeries) -> Table:
    rows = []
    for law in s.laws:
        shape = "; ".join(_shape(law, name, unit) for name, unit in law.form.shape)
        slope = f"{law.slope_n:.3g} ({law.slope_low_n:.3g} … {law.slope_high_n:.3g})"
        rows.append(
            (
                f"{law.form.title}: {law.form.formula}",
                shape or "–",
                slope,
                f"{law.delta:.1f}" if np.isfinite(law.delta) else "–",
                f"{law.bic - min(x.bic for x in s.laws):.1f}" if np.isfinite(law.bic) else "–",
                f"{100 * law.weight:.0f} %" if np.isfinite(law.weight) else "–",
            )
        )
    head = ("law", "shape (95 %)", f"slope at {s.reference_s:g} s, N per decade", "ΔAICc", "ΔBIC", "weight")
    caption = (
        f"Laws for {s.name}, best first. A difference of AICc beyond 10 leaves a law without support, below 2 none is "
        "better; beyond the durations that were run every law is an extrapolation"
    )
    return Table(head, tuple(rows), caption, numbers_from=2)


def _shape(law: LawFit, name: str, unit: str) -> str:
    low, high = law.shape_intervals[name]
    lower = f"{low:.2g}" if low > 0 else "open"
    upper = f"{high:.2g}" if np.isfinite(high) else "open"
    return f"{SHAPES[name]} = {law.shape[name]:.2g} ({lower} … {upper}) {unit}".strip()


def _pressures(series: list[DwellSeries]) -> Table:
    rows = []
    for s in series:
        p = s.pressure
        assert p is not None
        kinds = (
            ("chamber a", p.slope_a, p.increment_a),
            ("chamber b", p.slope_b, p.increment_b),
            ("both together", p.slope_sum, p.increment_sum),
        )
        for word, slope, increment in kinds:
            if slope is not None:
                on_slope = estimate(slope, PA_PER_BAR, "")
                rows.append((s.name, word, on_slope, estimate(increment, PA_PER_BAR, "")))
        if not any(e is not None for _, e, _ in kinds):
            rows.append((s.name, p.statement, "–", "–"))
    head = ("series", "pressure", "slope, (N per decade)/bar", "increment, N/bar")
    return Table(head, tuple(rows), "What pressure does to ageing, at the reference duration, with 95 % intervals", 2)


# --- relaxation and way back ---------------------------------------------------------------------------------------


def draw_relaxation(found: CampaignCharacteristics) -> Figure:
    """Relaxation and recovery distance against duration."""
    figure = style.new_figure(2.7)
    left, right = figure.subplots(1, 2)
    right.set_visible(any(s.recovery is not None for s in found.stops))
    left.set_visible(any(s.relaxation is not None for s in found.stops))
    ambient = found.identity.ambient_pressure_pa
    conditions = list(dict.fromkeys(s.condition for s in sorted(found.stops, key=lambda s: s.condition)))
    for index, condition in enumerate(conditions[:MOST_CONDITIONS]):
        look = style.look(index)
        own = [s for s in found.stops if s.condition == condition]
        shift = 1.0 + 0.05 * index
        common = {"fmt": look.marker, "color": look.color, "mfc": "white", "ms": 3.2, "elinewidth": 0.6, "capsize": 0}
        held = [s for s in own if s.relaxation is not None]
        if held:
            amount = [s.relaxation.amount for s in held if s.relaxation]
            value = np.array([e.value for e in amount])
            reach = np.array([(e.high - e.low) / 2.0 for e in amount])
            where = [s.dwell_s * shift for s in held]
            left.errorbar(where, value, yerr=reach, label=condition.label(ambient), **common)
        back = [(s.dwell_s * shift, s.recovery) for s in own if s.recovery is not None]
        whole = [(t, r.distance) for t, r in back if r.complete]
        if whole:
            value = MM * np.array([e.value for _, e in whole])
            low, high = (MM * np.array([getattr(e, n) for _, e in whole]) for n in ("low", "high"))
            right.errorbar([t for t, _ in whole], value, yerr=[np.maximum(value - low, 0), np.maximum(high - value, 0)],
                           label=condition.label(ambient), **common)  # fmt: skip
        cut = [(t, r.seen_m) for t, r in back if not r.complete]
        if cut:
            right.plot([t for t, _ in cut], [MM * m for _, m in cut], "^", color=look.color, ms=4, ls="none")
    for axis in (left, right):
        style.logarithmic(axis)
        axis.set_xlabel("stop duration / s")
    left.set_ylabel("fall of the force / N")
    right.set_ylabel("way back / mm")
    right.set_ylim(bottom=0)
    handles = left.get_legend_handles_labels()[0] or right.get_legend_handles_labels()[0]
    if handles:
        style.legend_above(figure, handles, columns=min(len(handles), 3))
    return figure


def _summary(found: CampaignCharacteristics) -> Table:
    """Medians over stops of one duration, way of holding and speed."""
    groups: dict[tuple, list[Stop]] = {}
    for stop in found.stops:
        groups.setdefault((stop.speed_m_s, stop.released, stop.stop_s), []).append(stop)
    rows = []
    for (speed, released, duration), group in sorted(groups.items()):
        relaxed = [s.relaxation for s in group if s.relaxation]
        back = [s.recovery for s in group if s.recovery]
        whole = [r for r in back if r.complete]
        forms = [r.form for r in relaxed]
        rows.append(
            (
                f"{duration:g} s, {'released' if released else 'held'}, {MM * speed:.3g} mm/s",
                str(len(group)),
                _median([r.amount.value for r in relaxed]),
                max(set(forms), key=forms.count) if forms else "–",
                _median([r.per_decade.value for r in relaxed if r.per_decade and _told(r.per_decade)]),
                _median([s.increment_n for s in group]),
                _median([s.loading_rate_n_s for s in group]),
                _median([MM * r.distance.value for r in whole])
                + (f" ({len(back) - len(whole)} cut)" if len(back) > len(whole) else ""),
                _median([r.time.value for r in whole]),
            )
        )
    head = (
        "stop",
        "number",
        "fall, N",
        "form",
        "fall, N per decade",
        "increment, N",
        "loading, N/s",
        "way back, mm",
        "time back, s",
    )
    return Table(head, tuple(rows), "Medians over equal stops")


def _told(e: Estimate) -> bool:
    return e.high - e.low < 2.0 * abs(e.value)


def _median(values: list[float]) -> str:
    known = [v for v in values if np.isfinite(v)]
    return f"{np.median(known):.3g}" if known else "–"
