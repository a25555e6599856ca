"""A campaign's friction along the stroke and over time: position, drift, repeatability, loops, stick-slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.campaign_curves import MM, estimate, picture, speed_axis
from pneudrive.report.page import Section, Table, Text
from pneudrive.report.words import plural, spread_evenly

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.characteristics import CampaignCharacteristics
    from pneudrive.characteristics.effects import Loop, PositionDependence

HOUR_S = 3600.0
MOST_PANELS = 6
MOST_LOOPS = 6


def position(found: CampaignCharacteristics) -> Section | None:
    """Friction along the stroke."""
    shown = [p for p in found.position if np.isfinite(p.relative).sum() > 3]
    if not shown:
        return None
    shown = shown[:MOST_PANELS]
    blocks: list = [
        Text("Friction over its mean along the stroke: bore, alignment and wear leave their mark there."),
        picture(
            found,
            "campaign-position",
            "Friction along the stroke less its mean, in per cent of it, with pointwise 95 % intervals.",
            draw_position(found, shown),
        ),
    ]
    rows = []
    for p in shown:
        label = _position_label(found, p)
        rows.append((label, "trend", estimate(p.trend_per_m, 100.0, "%/m"), _p(p.trend_per_m.p)))
        for h in p.harmonics:
            wave = f"wavelength {MM * h.wavelength_m:.3g} mm"
            rows.append((label, wave, estimate(h.amplitude, 100.0, "%"), _p(h.amplitude.p)))
    head = ("condition", "pattern", "size (95 %)", "p")
    blocks.append(Table(head, tuple(rows), "Patterns along the stroke; p: probability of as much by chance", 3))
    return Section("position", "Friction along the stroke", tuple(blocks), synthetic=found.synthetic)


def _p(p: float) -> str:
    return "–" if not np.isfinite(p) else "< 0.001" if p < 1e-3 else f"{p:.2g}"


def _position_label(found: CampaignCharacteristics, p: PositionDependence) -> str:
    return p.condition.label(found.identity.ambient_pressure_pa) if p.condition is not None else "all cycles"


def draw_position(found: CampaignCharacteristics, shown: list[PositionDependence]) -> Figure:
    """Relative friction over position, one panel a condition."""
    columns = min(3, len(shown))
    figure = style.new_figure(1.9 * -(-len(shown) // columns) + 0.5)
    axes = style.panels(figure, len(shown), columns, sharey=True)
    for axis, p in zip(axes, shown, strict=True):
        known = np.isfinite(p.relative)
        x = MM * p.position_m[known]
        middle, low, high = (100.0 * (v[known] - 1.0) for v in (p.relative, p.low, p.high))
        axis.fill_between(x, low, high, color=style.BAND, lw=0)
        axis.plot(x, middle, color=style.BLUE, lw=1.0)
        axis.axhline(0.0, color=style.BLACK, lw=0.6)
        axis.set_title(f"{_position_label(found, p)} ({plural(p.cycles, 'cycle')})")
        axis.set_xlabel("position / mm")
    for axis in axes[::columns]:
        axis.set_ylabel("friction less its mean / %")
    return figure


UNTOLD = "not determined: the order of the cycles hides it"


def drift(found: CampaignCharacteristics) -> Section | None:
    """Change over the campaign: sentinels, run-in, temperature; zero of the sensor."""
    d = found.drift
    if d is None:
        return None
    told = {
        "sentinels": "told by the sentinels, which repeat one speed",
        "repeats": "told by repeats of equal cycles",
        "smooth curve": "told from cycles about smooth curves: weaker than sentinels would",
    }.get(d.basis)
    text = f"What changes over the campaign beside speed, pressure and levels is {told or UNTOLD}."
    if told:
        text += (
            " It is separated from the effect of interest by a mixed model; the curves above are at the mean state of "
            "the campaign."
        )
    blocks: list = [Text(text)]
    if told and d.time_s.size > 2 and np.isfinite(d.drift_n).any():
        caption = "Drift of friction over the campaign with its 95 % interval; sentinels about their mean."
        blocks.append(picture(found, "campaign-drift", caption, draw_drift(found)))
    rows = []
    causes = (
        ("over time", d.per_hour, 1.0, "N/h"),
        ("over travel (run-in)", d.per_decade_of_travel, 1.0, "N per decade"),
        ("with temperature", d.per_kelvin, 1.0, "N/K"),
        ("after an interruption", d.interrupted, 1.0, "N"),
    )
    for word, cause, factor, unit in causes:
        said = estimate(cause, factor, unit) if cause is not None else "the plan does not carry it"
        rows.append((word, said, _p(cause.p) if cause is not None else "–"))
    if told:
        rows.append(("other states of the campaign from its mean", f"{d.spread_n:.2g} N (standard deviation)", ""))
    zero = found.zero
    if zero.time_s.size:
        rows.append(("zero of the force sensor", estimate(zero.per_hour, 1.0, "N/h"), ""))
    head = ("change", "size (95 %)", "p")
    blocks.append(Table(head, tuple(rows), "Each taken by itself; causes that went together cannot be told apart", 2))
    return Section("drift", "Drift, run-in and sentinels", tuple(blocks), synthetic=found.synthetic)


def draw_drift(found: CampaignCharacteristics) -> Figure:
    """Drift over time, with sentinels, and the sensor's zero below where tares tell it."""
    d, zero = found.drift, found.zero
    assert d is not None
    two = zero.time_s.size > 1
    figure = style.new_figure(2.6 if not two else 3.8)
    axes = figure.subplots(1 + two, 1, sharex=True, squeeze=False, height_ratios=[2, 1] if two else [1])[:, 0]
    order = np.argsort(d.time_s)
    hours = d.time_s[order] / HOUR_S
    axes[0].fill_between(hours, d.low_n[order], d.high_n[order], color=style.BAND, lw=0)
    axes[0].plot(hours, d.drift_n[order], color=style.BLUE, label="drift of the mixed model")
    if d.sentinel_n.size:
        away = d.sentinel_n - d.sentinel_n.mean()
        axes[0].plot(d.sentinel_time_s / HOUR_S, away, "D", color=style.ORANGE, ms=4, mfc="white", label="sentinels")
    axes[0].axhline(0.0, color=style.BLACK, lw=0.6)
    axes[0].set_ylabel("drift / N")
    axes[0].legend(ncols=2)
    if two:
        axes[1].errorbar(
            zero.time_s / HOUR_S, zero.zero_n, yerr=2 * zero.stderr_n, fmt="s", color=style.BLACK, mfc="white", ms=3.5
        )
        axes[1].set_ylabel("sensor zero / N")
    axes[-1].set_xlabel("time / h")
    return figure


def repeatability(found: CampaignCharacteristics) -> Section | None:
    """How well a cycle repeats."""
    r = found.repeatability
    if r is None:
        return None
    rows = tuple(
        (word, estimate(e) if e is not None else "not repeated")
        for word, e in (
            ("within a block, equal conditions (repeatability)", r.within),
            ("between blocks and days", r.between),
            ("in total (reproducibility)", r.total),
        )
    )
    scale = "in proportion to friction; given at the mean friction" if r.relative else "equal at all friction"
    text = f"Standard deviation of the friction of one cycle, from {r.basis}; {scale}."
    table = Table(("scatter", "standard deviation (95 %)"), rows, numbers_from=9)
    return Section("repeatability", "Repeatability", (Text(text), table), synthetic=found.synthetic)


def loops(found: CampaignCharacteristics) -> Section | None:
    """Hysteresis around reversals."""
    if not found.loops:
        return None
    shown = spread_evenly(sorted(found.loops, key=lambda loop: loop.speed_m_s), MOST_LOOPS)
    blocks = (
        Text(
            "Friction around reversals, raw samples. Presliding: the travel in which friction goes from 10 to 90 % of "
            "its swing; with a soft rig the rig's own deflection is in it."
        ),
        picture(
            found,
            "campaign-loops",
            "Hysteresis at reversals: friction (its sign that of the motion it opposes) over position.",
            draw_loops(found, shown),
        ),
        Table(
            ("cycle", "condition", "speed, mm/s", "presliding, mm", "memory, N"),
            tuple(
                (
                    loop.key,
                    loop.condition.label(found.identity.ambient_pressure_pa),
                    f"{MM * loop.speed_m_s:.3g}",
                    f"{MM * loop.presliding_m:.3g}",
                    f"{loop.width_n:.2g}" if np.isfinite(loop.width_n) else "–",
                )
                for loop in shown
            ),
            "Memory: mean difference between slowing down and speeding up at equal speeds",
            numbers_from=2,
        ),
    )
    return Section("loops", "Hysteresis at reversals", blocks, synthetic=found.synthetic)


def draw_loops(found: CampaignCharacteristics, shown: list[Loop]) -> Figure:
    """Friction over position around reversals."""
    columns = min(3, len(shown))
    figure = style.new_figure(2.1 * -(-len(shown) // columns) + 0.4)
    axes = style.panels(figure, len(shown), columns, sharey=True)
    for axis, loop in zip(axes, shown, strict=True):
        axis.plot(MM * loop.position_m, loop.friction_n, ".", ms=1.4, color=style.BLUE)
        axis.axhline(0.0, color=style.BLACK, lw=0.6)
        axis.set_title(f"{MM * loop.speed_m_s:.3g} mm/s, {loop.condition.label(found.identity.ambient_pressure_pa)}")
        axis.set_xlabel("position / mm")
    for axis in axes[::columns]:
        axis.set_ylabel("friction / N")
    return figure


def stick_slip(found: CampaignCharacteristics) -> Section | None:
    """Where the drive sticks and slips."""
    if not found.stick_slip:
        return None
    slipping = [p for p in found.stick_slip if p.share > 0]
    ambient = found.identity.ambient_pressure_pa
    said = " ".join(t.text for t in found.stick_slip_thresholds)
    text = (
        "Stick-slip belongs to the rig and the seal together: a stiffer rig starts it at a lower speed. Points taken "
        f"in it are no points of F(v) and do not count in the curves. {said}"
    )
    blocks: list = [Text(text)]
    caption = "Ripple of speed (standard deviation over mean); filled where strokes stick and slip."
    blocks.append(picture(found, "campaign-stick-slip", caption, _draw_ripple(found)))
    if slipping:
        head = ("condition", "speed, mm/s", "strokes", "of these slip", "period, s", "step, mm", "swing of force, N")
        rows = tuple(
            (
                p.condition.label(ambient),
                f"{MM * p.speed_m_s:.3g}",
                str(p.strokes),
                f"{100 * p.share:.0f} %",
                f"{p.period_s:.3g}",
                f"{MM * p.step_m:.3g}",
                f"{p.amplitude_n:.3g}",
            )
            for p in slipping
        )
        blocks.append(Table(head, rows, "Stick-slip, medians over strokes"))
    return Section("stick-slip", "Stick-slip", tuple(blocks), synthetic=found.synthetic)


def _draw_ripple(found: CampaignCharacteristics) -> Figure:
    figure = style.new_figure(2.5)
    axis = figure.subplots()
    conditions = list(dict.fromkeys(p.condition for p in found.stick_slip))
    for index, condition in enumerate(spread_evenly(conditions, 8)):
        look = style.look(index)
        points = sorted((p for p in found.stick_slip if p.condition == condition), key=lambda p: p.speed_m_s)
        speed = [MM * p.speed_m_s for p in points]
        ripple = [100 * p.ripple for p in points]
        label = condition.label(found.identity.ambient_pressure_pa)
        axis.plot(speed, ripple, look.marker, ls=look.linestyle, color=look.color, mfc="white", ms=4, label=label)
        slips = [p.share > 0 for p in points]
        axis.plot(
            np.array(speed)[slips],
            np.array(ripple)[slips],
            look.marker,
            ls="none",
            color=look.color,
            mfc=look.color,
            ms=4,
        )
    speed_axis(axis, np.array([MM * p.speed_m_s for p in found.stick_slip]))
    axis.set_ylim(bottom=0)
    axis.set_ylabel("ripple of speed / %")
    style.legend_above(figure, axis.get_legend_handles_labels()[0], columns=min(len(conditions), 3))
    return figure
