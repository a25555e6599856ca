"""A campaign's curves of friction over speed, what of them is air, and what the pressures do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characteristics.basics import PA_PER_BAR
from pneudrive.numbers import with_u
from pneudrive.report import style
from pneudrive.report.page import Picture, Section, Table, Text
from pneudrive.report.words import plural, spread_evenly

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.characteristics import CampaignCharacteristics, Curve, Estimate
    from pneudrive.characteristics.effects import AirShare, PressureEffects

MOST_CURVES = 8  # that can be told apart in one picture
MOST_PANELS = 6
WIDE = 3.0  # ratio of speeds beyond which their axis is logarithmic
SHOWN_SPEEDS = 12  # rows of a table
MM = 1e3


def estimate(e: Estimate | None, factor: float = 1.0, unit: str | None = None) -> str:
    """Write a value with its 95 % interval.

    Examples
    --------
    >>> from pneudrive.characteristics import Estimate
    >>> estimate(Estimate(1.2345e-5, 1.1e-5, 1.4e-5, 1e-6, "N/Pa"), 1e5, "N/bar")
    '1.23 (1.10 … 1.40) N/bar'
    """
    if e is None or not np.isfinite(e.value):
        return "not determined"
    value, low, high = (factor * v for v in (e.value, e.low, e.high))
    reach = max(abs(high - value) if np.isfinite(high) else 0.0, abs(value - low), 1e-12)
    digits = int(np.clip(1 - np.floor(np.log10(reach)), 0, 6))
    value, low, high = (round(v, digits) + 0.0 if np.isfinite(v) else v for v in (value, low, high))  # no -0.00
    top = f"{high:.{digits}f}" if np.isfinite(high) else "…"
    return f"{value:.{digits}f} ({low:.{digits}f} … {top}) {e.unit if unit is None else unit}".strip()


def picture(found: CampaignCharacteristics, name: str, caption: str, figure: Figure) -> Picture:
    """Make a picture; what rests on a simulated rig says so inside it, for it may travel without its caption."""
    if found.synthetic:
        figure.text(0.998, 0.004, "synthetic", ha="right", va="bottom", fontsize=6.5, color="#8a4b00")
    return Picture(name, caption, figure, synthetic=found.synthetic)


def curves(found: CampaignCharacteristics) -> Section | None:
    """Friction over speed at every condition."""
    both = [c for c in found.curves if c.direction == 0]
    if not both:
        return None
    shown = spread_evenly(both, MOST_CURVES)
    text = (
        "Half the difference of both directions, so that the zero of the sensor and other offsets cancel. Bands are "
        "pointwise 95 % for friction in the mean state of the campaign: noise, scatter from cycle to cycle, blocks, "
        "and what all points share (gain, hysteresis, position). How far other states of the campaign lie from it "
        "stands under its drift."
    )
    if len(shown) < len(both):
        text += f" {len(shown)} of {len(both)} conditions are drawn; all are in curves.parquet."
    if any(c.contains_air for c in both):
        text += " Pressures were not measured in the chambers: these curves are those of seal and air together."
    blocks: list = [
        Text(text),
        picture(
            found,
            "campaign-curves",
            "Friction over speed: markers at measured speeds, curves and 95 % bands between them; crosses are points "
            "that are no points of F(v) (stick-slip, not settled) and do not count.",
            draw_curves(found, shown),
        ),
        _curve_table(found, both),
    ]
    return Section("curves", "Friction over speed", tuple(blocks), synthetic=found.synthetic)


def speed_axis(axis: Axes, speeds: np.ndarray) -> None:
    """Label an axis of speed, logarithmic where speeds differ much."""
    if speeds.size and speeds.max() > WIDE * speeds.min():
        style.logarithmic(axis)
    axis.set_xlabel("speed / (mm/s)")


def draw_curves(found: CampaignCharacteristics, shown: Sequence[Curve]) -> Figure:
    """One picture of all curves with bands."""
    figure = style.new_figure(3.8)
    axis = figure.subplots()
    ambient = found.identity.ambient_pressure_pa
    handles = []
    for index, c in enumerate(shown):
        look = style.look(index)
        speed = MM * c.speed_m_s
        axis.fill_between(speed, c.low_n, c.high_n, color=look.color, alpha=0.13, lw=0)
        (line,) = axis.plot(speed, c.friction_n, linestyle=look.linestyle, color=look.color, lw=1.0)
        axis.plot(
            speed[c.measured], c.friction_n[c.measured], look.marker, color=look.color, mfc="white", ms=3.6, ls="none"
        )
        line.set_label(c.condition.label(ambient))
        handles.append(line)
        if c.excluded:
            where = [MM * p.speed_m_s for p in c.excluded]
            axis.plot(where, [p.friction_n for p in c.excluded], "x", color=look.color, ms=4)
    speed_axis(axis, MM * np.concatenate([c.speed_m_s for c in shown]))
    axis.set_ylabel("seal and air / N" if any(c.contains_air for c in shown) else "friction / N")
    style.legend_above(figure, handles, columns=min(len(handles), 3))
    return figure


def _curve_table(found: CampaignCharacteristics, both: Sequence[Curve]) -> Table:
    rows = []
    for c in both[:MOST_CURVES]:
        at = spread_evenly(np.flatnonzero(c.measured).tolist(), SHOWN_SPEEDS)
        for i in at:
            half = float(c.high_n[i] - c.low_n[i]) / 2.0
            rows.append(
                (
                    c.condition.label(found.identity.ambient_pressure_pa),
                    f"{MM * c.speed_m_s[i]:.4g}",
                    with_u(float(c.friction_n[i]), half, ""),
                    f"{c.stderr_n[i]:.2g}",
                    f"{c.u_systematic_n[i]:.2g}",
                    str(int(c.cycles[i])),
                )
            )
    head = ("condition", "speed, mm/s", "friction ± half of 95 %, N", "by chance, N", "systematic, N", "cycles")
    return Table(head, tuple(rows), "Friction at measured speeds; the last but one columns are standard uncertainties")


def air(found: CampaignCharacteristics) -> Section | None:
    """Tell what of a curve that rises with speed is the force of the air."""
    if not found.air:
        return None
    separated = [a for a in found.air if a.separated]
    shown = spread_evenly(separated or list(found.air), MOST_PANELS)
    if separated:
        text = (
            "While the piston moves, air is squeezed out of one chamber and drawn into the other: their pressures part "
            "and push against the motion. The force sensor shows both; with pressures measured in the chambers the "
            "force of the air is taken out, and what is left is the seal. "
        )
        text += " ".join(_rise(found, a) for a in shown)
        caption = "Force against the motion (total) and its parts, air and seal, with 95 % bands."
    else:
        text = (
            "The pressures were not measured in the chambers, so that air and seal cannot be told apart. If the "
            "seal's friction does not fall below its least value as speed rises, the air takes at most what is drawn."
        )
        caption = "Force against the motion (total) with its 95 % band, and the most of it that may be air."
    blocks: list = [Text(text), picture(found, "campaign-air", caption, draw_air(found, shown))]
    blocks.append(_air_table(found, shown))
    return Section("air", "Which part of a rising curve is air", tuple(blocks), synthetic=found.synthetic)


def _rise(found: CampaignCharacteristics, a: AirShare) -> str:
    """Say how much of the rise from the least total to the highest speed is air."""
    least, last = int(np.argmin(a.total_n)), a.speed_m_s.size - 1
    where = a.condition.label(found.identity.ambient_pressure_pa)
    rise = float(a.total_n[last] - a.total_n[least])
    part = float(a.air_n[last] - a.air_n[least])
    if rise <= 0 or least == last:
        return f"At {where} the curve does not rise with speed."
    reach = float(a.air_high_n[last] - a.air_low_n[last]) / 2.0
    share = f"{part:.2g} N ({100 * part / rise:.0f} %) are" if abs(part) > reach else f"at most {reach:.2g} N may be"
    return (
        f"At {where}: from {MM * a.speed_m_s[least]:.3g} to {MM * a.speed_m_s[last]:.3g} mm/s the force rises by "
        f"{rise:.2g} N, of which {share} air."
    )


def draw_air(found: CampaignCharacteristics, shown: Sequence[AirShare]) -> Figure:
    """Total, air and seal over speed, one panel a condition."""
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    figure = style.new_figure(2.3 * rows + 0.5)
    axes = style.panels(figure, len(shown), columns, sharey=True)
    for axis, a in zip(axes, shown, strict=True):
        speed = MM * a.speed_m_s
        parts = [("total", a.total_n, a.total_low_n, a.total_high_n)]
        if a.separated:
            parts += [("seal", a.seal_n, a.seal_low_n, a.seal_high_n), ("air", a.air_n, a.air_low_n, a.air_high_n)]
        for index, (label, middle, low, high) in enumerate(parts):
            look = style.look(index)
            axis.fill_between(speed, low, high, color=look.color, alpha=0.15, lw=0)
            axis.plot(speed, middle, ls=look.linestyle, color=look.color, label=label)
        if not a.separated:
            axis.plot(speed, a.air_bound_n, ls=":", color=style.ORANGE, label="air, at most")
        speed_axis(axis, speed)
        axis.set_title(a.condition.label(found.identity.ambient_pressure_pa))
    for axis in axes[::columns]:
        axis.set_ylabel("force / N")
    style.legend_above(figure, axes[0].get_legend_handles_labels()[0])
    return figure


def _air_table(found: CampaignCharacteristics, shown: Sequence[AirShare]) -> Table:
    rows = []
    for a in shown:
        label = a.condition.label(found.identity.ambient_pressure_pa)
        for i in sorted({0, a.speed_m_s.size // 2, a.speed_m_s.size - 1}):
            cells = [f"{MM * a.speed_m_s[i]:.4g}"]
            for middle, low, high in (
                (a.total_n, a.total_low_n, a.total_high_n),
                (a.seal_n, a.seal_low_n, a.seal_high_n),
                (a.air_n, a.air_low_n, a.air_high_n),
            ):
                cells.append(with_u(float(middle[i]), float(high[i] - low[i]) / 2.0, "") if a.separated else "–")
            if not a.separated:
                cells[1] = with_u(float(a.total_n[i]), float(a.total_high_n[i] - a.total_low_n[i]) / 2.0, "")
                cells[3] = f"at most {a.air_bound_n[i]:.2g}"
            rows.append((label, *cells))
    head = ("condition", "speed, mm/s", "total, N", "seal, N", "air, N")
    return Table(head, tuple(rows), "Parts of the force against the motion, ± half of the 95 % interval")


def pressure(found: CampaignCharacteristics) -> Section | None:
    """Effects of the chamber pressures, and their interaction."""
    if not found.pressure:
        return None
    blocks: list = []
    for effects in found.pressure:
        pairs = ", ".join(f"{a / PA_PER_BAR:.3g}/{b / PA_PER_BAR:.3g}" for a, b in effects.gauge_pa)
        name = f"{effects.levels}: " if effects.levels else ""
        blocks.append(Text(f"{name}{effects.statement} Pressure pairs a/b in bar gauge: {pairs}."))
    drawn = [e for e in found.pressure if e.slope_a or e.slope_b or e.slope_sum]
    if drawn:
        caption = "Change of friction with each chamber's pressure, at each speed, with 95 % intervals."
        blocks.append(picture(found, "campaign-pressure", caption, draw_pressure(drawn)))
    rows = []
    for e in found.pressure:
        for word, mean in (("chamber a", e.mean_a), ("chamber b", e.mean_b), ("both together", e.mean_sum)):
            if mean is not None:
                rows.append((e.levels or "all", word, estimate(mean, PA_PER_BAR, "N/bar"), _chance(mean.p)))
        if e.interaction is not None:
            mean = estimate(e.interaction_n_pa2, PA_PER_BAR**2, "N/bar²")
            rows.append((e.levels or "all", "interaction a × b", mean, _chance(e.interaction.p)))
        if e.curvature is not None:
            rows.append((e.levels or "all", "curvature", "", _chance(e.curvature.p)))
    if rows:
        head = ("levels", "effect", "mean over speeds (95 %)", "p")
        blocks.append(Table(head, tuple(rows), "Effects of pressure; p: probability of as much by chance", 3))
    return Section("pressure", "Effects of pressure", tuple(blocks), synthetic=found.synthetic)


def _chance(p: float) -> str:
    if not np.isfinite(p):
        return "–"
    return "< 0.001" if p < 1e-3 else f"{p:.2g}"


def draw_pressure(effects: Sequence[PressureEffects]) -> Figure:
    """Slopes over speed, one panel a set of levels."""
    columns = min(3, len(effects))
    figure = style.new_figure(2.4 * -(-len(effects) // columns) + 0.4)
    axes = style.panels(figure, len(effects), columns, sharey=True)
    for axis, e in zip(axes, effects, strict=True):
        kinds = (("chamber a", e.slope_a), ("chamber b", e.slope_b), ("both together", e.slope_sum))
        for index, (label, slopes) in enumerate(kinds):
            if not slopes:
                continue
            look = style.look(index)
            value, low, high = (
                PA_PER_BAR * np.array([getattr(s, n) for s in slopes]) for n in ("value", "low", "high")
            )
            shift = 1.0 + 0.03 * (index - 1)  # side by side
            axis.errorbar(
                MM * e.speed_m_s * shift,
                value,
                yerr=[value - low, high - value],
                fmt=look.marker,
                ls=look.linestyle,
                color=look.color,
                mfc="white",
                ms=3.5,
                elinewidth=0.8,
                label=label,
            )
        axis.axhline(0.0, color=style.BLACK, lw=0.7)
        speed_axis(axis, MM * e.speed_m_s)
        axis.set_title(e.levels)
        axis.legend()
    for axis in axes[::columns]:
        axis.set_ylabel("friction per pressure / (N/bar)")
    return figure


def direction(found: CampaignCharacteristics) -> Section | None:
    """Half the difference between both directions."""
    if not found.asymmetry:
        return None
    separable = any(a.basis == "tare" for a in found.asymmetry)
    text = (
        "Half the difference of friction between +x and -x."
        if separable
        else "Half the difference between +x and -x: without tare cycles the zero of the sensor is in it, and friction "
        "that depends on direction cannot be told from it."
    )
    rows = tuple(
        (
            a.condition.label(found.identity.ambient_pressure_pa),
            a.basis,
            estimate(a.mean),
            _chance(a.mean.p),
            plural(a.speed_m_s.size, "speed"),
        )
        for a in found.asymmetry
    )
    head = ("condition", "zero of the sensor", "mean over speeds (95 %)", "p", "from")
    table = Table(head, rows, "Dependence on direction", numbers_from=9)
    return Section("direction", "Direction", (Text(text), table), synthetic=found.synthetic)
