"""The report of a campaign: verdict, curves, effects, course over time and position, the run, and its sources."""

from __future__ import annotations

import math
from collections import Counter
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import __version__
from pneudrive.campaign.cycle import KINDS
from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.figures import SPEED, Axis, Band, Figure, Line, Look, Markers, Panel, Rule, ends, look, stack
from pneudrive.friction.campaign.compare import about_of
from pneudrive.friction.friction_map import PA_PER_BAR
from pneudrive.friction.sentences import flag_table
from pneudrive.numbers import with_interval, with_u
from pneudrive.report import stops
from pneudrive.report.layout_figure import rig_diagram
from pneudrive.report.page import Paragraph, Report
from pneudrive.report.provenance import references, software
from pneudrive.report.tables import CHAMBERS, MM, condition_names, plural, spread_evenly
from pneudrive.report.topics import Topic
from pneudrive.rig.interface import Envelope
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from pneudrive.friction.campaign.result import (
        AirShare,
        CampaignCharacteristics,
        Curve,
        PositionPattern,
        PressureEffects,
    )
    from pneudrive.friction.campaign.stops.dwell_law import DwellSeries
    from pneudrive.report.page import Block, PageTable, Section
    from pneudrive.views import ShownCurve

MOST_CURVES = 8  # that a reader can distinguish in one picture
MOST_PANELS = MOST_LOOPS = 6
MOST_CONDITIONS = 8
SHOWN_SPEEDS = 12  # rows of a table
MOST_LINES = 120  # lines of a protocol that are shown
MOST_SKIPPED = 40
METHODS = ("gum2008", "patterson1971", "wahba1983", "burnham2002", "kato1972", "dieterich1979", "armstrong1994")


def write_campaign_report(found: CampaignCharacteristics, folder: str | Path) -> Path:
    """Write report.html, which loads no other files, and its figures as PNG and SVG.

    Parameters
    ----------
    found : CampaignCharacteristics
    folder : path-like
        An existing folder; figures go into its folder ``figures``.

    Returns
    -------
    pathlib.Path
        Path of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    parts = (
        *(run, curves, air, pressure, direction, position, stops.section, drift, repeatability, loops, stick_slip),
        *(statements, flags, budget, sources),
    )  # a section without data is None
    title = f"{'Synthetic friction' if found.synthetic else 'Friction'} campaign: {found.name}"
    return Report(title, verdict(found), [part(found) for part in parts], found.synthetic).write(folder)


# --- verdict ---------------------------------------------------------------------------------------------------------


def verdict(found: CampaignCharacteristics) -> Iterator[str]:
    """Return the results in a few lines."""
    made = "on a simulated rig (synthetic)" if found.synthetic else f"on {found.identity.name}"
    read = len(found.cycles) + len(found.stops)
    lost = f"; {plural(len(found.skipped), 'cycle')} could not be used" if found.skipped else ""
    yield f"{plural(read, 'cycle')} {made}{lost}."
    yield from _friction(found)
    yield from _air(found)
    for series in found.dwell:
        if series.slope is not None:
            best = f"; best law: {series.laws[0].form.title}" if series.laws else ""
            yield (
                f"Breakaway after a stop ({series.name}) changes by {with_interval(series.slope, unit='N')} per decade "
                f"of duration at {series.reference_s:g} s{_with_pressure(series)}{best}."
            )
    r, d = found.repeatability, found.drift
    if r is not None and r.within is not None:
        between = f", between blocks and days {r.between.value:.2g} N" if r.between is not None else ""
        drifted = f"; friction drifted by {np.ptp(d.drift_n):.2g} N" if d is not None and d.drift_n.size else ""
        yield f"One cycle repeats within {r.within.value:.2g} N (standard deviation){between}{drifted}."
    missing = sum(not s.carried for s in found.statements)
    if missing:
        count = plural(missing, "question is", "questions are")
        yield f"{count} not answered by these data; the sections name them and the data they need."


def _friction(found: CampaignCharacteristics) -> Iterator[str]:
    both = [c for c in found.curves if c.direction == 0]
    if not both:
        yield "These cycles do not give friction over speed."
        return
    first = both[0]
    half = [float(v) for v in (first.high_n - first.low_n) / 2.0]
    levels = " and ".join(
        f"{with_u(float(first.friction_n[i]), half[i])} at {MM * first.speed_m_s[i]:.3g} mm/s"
        for i in dict.fromkeys(int(i) for i in np.flatnonzero(first.measured)[[0, -1]])
    )
    where = condition_names(found)(first.condition)
    yield f"Friction at {where}: {levels} (± half of the 95 % interval); {plural(len(both), 'condition')} in all."
    for effects in found.pressure:
        slopes = _effects(effects, "mean", " ({})", ("a", "b", "both chambers together"))
        if slopes:
            name = f" ({effects.levels})" if effects.levels else ""
            joint = effects.interaction_n_pa2
            tail = f"; interaction {with_interval(joint, PA_PER_BAR**2, 'N/bar²')}" if joint is not None else ""
            yield f"Friction changes with pressure{name}, mean over speeds: {', '.join(slopes)}{tail}."


def _effects(of: object, name: str, words: str, chambers: tuple[str, str, str]) -> list[str]:
    """Return the known effects of both pressures as text."""
    each = zip((getattr(of, f"{name}_{side}") for side in ("a", "b", "sum")), chambers, strict=True)
    return [with_interval(e, PA_PER_BAR, "N/bar") + words.format(chamber) for e, chamber in each if e is not None]


def _air(found: CampaignCharacteristics) -> Iterator[str]:
    separated = [a for a in found.air if a.separated]
    if separated:
        a = max(separated, key=lambda share: share.air_n[-1])
        half = float(a.air_high_n[-1] - a.air_low_n[-1]) / 2.0
        text = f"{a.air_n[-1]:.2g} of {a.total_n[-1]:.3g} N are air, not seal"
        if abs(a.air_n[-1]) < half:
            text = f"no force of the air is visible in {a.total_n[-1]:.3g} N (± {half:.2g} N)"
        yield f"At {MM * a.speed_m_s[-1]:.3g} mm/s and {condition_names(found)(a.condition)}, {text}."
    elif found.air:
        yield "Air and seal cannot be separated: pressures were not measured in the chambers."


def _with_pressure(series: DwellSeries) -> str:
    """Return the text on the change of the slope with pressure; "" at one pressure."""
    chambers = ("p_a", "p_b", "both pressures together")
    slopes = _effects(series.pressure, "slope", " of {}", chambers) if series.pressure else []
    return f", and that slope by {' and '.join(slopes)}" if slopes else ""


# --- curves, air and pressures ---------------------------------------------------------------------------------------


def curves(found: CampaignCharacteristics) -> Section | None:
    """Return the section on friction over speed at every condition."""
    both = [c for c in found.curves if c.direction == 0]
    if not both:
        return None
    topic, shown = Topic("campaign", "curves"), spread_evenly(found.view().curves, MOST_CURVES)
    text = topic.say()
    if len(shown) < len(both):
        text += topic.say("fewer", shown=len(shown), all=len(both))
    if any(c.contains_air for c in both):
        text += topic.say("with_air")
    picture = topic.picture("campaign-curves", curve_figure(shown))
    return topic.section(Paragraph(text), picture, topic.table(_curve_rows(found, both)))


def _curve_rows(found: CampaignCharacteristics, both: Sequence[Curve]) -> Iterator[tuple]:
    named = condition_names(found)
    for c in both[:MOST_CURVES]:
        for i in spread_evenly(np.flatnonzero(c.measured).tolist(), SHOWN_SPEEDS):
            friction = with_u(float(c.friction_n[i]), float(c.high_n[i] - c.low_n[i]) / 2.0, "")
            speed, uncertainties = MM * c.speed_m_s[i], (c.stderr_n[i], c.u_systematic_n[i])
            yield (named(c.condition), speed, friction, *uncertainties, int(c.cycles[i]))


def curve_figure(shown: Sequence[ShownCurve]) -> Figure:
    """Draw curves with bands in one picture, with a colour for each group if there are several."""
    groups, marks = sorted({c.group for c in shown}), []
    for index, c in enumerate(shown):
        own = look(index)._replace(color=look(groups.index(c.group) if len(groups) > 1 else index).color)
        low, high = (c.y, c.y) if c.band is None else c.band
        if c.x.size == 1:
            marks.append(Markers(c.x, c.y, c.label, own, low, high, 3.6))
        else:
            marks += [Band(c.x, low, high, look=own), Line(c.x, c.y, c.label, own, 1.0)]
            marks.append(Markers(c.x[c.measured], c.y[c.measured], look=own, size=3.6))
        if c.excluded[0].size:
            marks.append(Markers(*c.excluded, look=own._replace(marker="x")))
    (_, x_unit), (_, unit) = readable(shown[0].x_unit), readable(shown[0].unit)
    x = Axis(f"{shown[0].x_quantity} / ({x_unit})", "wide")
    return Figure([Panel(marks)], x, f"{shown[0].quantity} / {unit}", row_in=3.8, rest_in=0.0, entries=3)


def air(found: CampaignCharacteristics) -> Section | None:
    """Return the section on the force of the air in rising curves."""
    if not found.air:
        return None
    topic, named = Topic("campaign", "air"), condition_names(found)
    separated = [a for a in found.air if a.separated]
    shown = spread_evenly(separated or list(found.air), MOST_PANELS)
    text, panels = "separated" if separated else "together", []
    for a in shown:
        marks: list[Band | Line] = []
        for index, (label, (middle, low, high)) in enumerate(_parts(a).items()):
            own = look(index)
            marks += [Band(a.speed_m_s, low, high, look=own), Line(a.speed_m_s, middle, label, own)]
        if not a.separated:
            marks.append(Line(a.speed_m_s, a.air_bound_n, "air, at most", Look("orange", ":")))
        panels.append(Panel(marks, named(a.condition)))
    figure = Figure(panels, SPEED, "force / N", columns=3, row_in=2.3, share_y="all")
    return topic.section(
        topic.text(text, rises=" ".join(_rise(topic, named(a.condition), a) for a in shown)),
        topic.picture("campaign-air", figure, parts=topic.say(f"parts_{text}")),
        topic.table(row for a in shown for row in _air_rows(named(a.condition), a)),
    )


def _rise(topic: Topic, where: str, a: AirShare) -> str:
    """Return the text on the contribution of air to the rise from the least total force to the highest speed."""
    least, last = int(np.argmin(a.total_n)), a.speed_m_s.size - 1
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


def _air_rows(condition: str, a: AirShare) -> Iterator[tuple]:
    for i in sorted({0, a.speed_m_s.size // 2, a.speed_m_s.size - 1}):
        cells = [with_u(float(m[i]), float(high[i] - low[i]) / 2.0, "") for m, low, high in _parts(a).values()]
        rest = [] if a.separated else [None, f"at most {a.air_bound_n[i]:.2g}"]
        yield (condition, MM * a.speed_m_s[i], *cells, *rest)


def pressure(found: CampaignCharacteristics) -> Section | None:
    """Return the section on effects of the chamber pressures, and their interaction."""
    if not found.pressure:
        return None
    topic, texts = Topic("campaign", "pressure"), []
    for effects in found.pressure:
        pairs = ", ".join(f"{a / PA_PER_BAR:.3g}/{b / PA_PER_BAR:.3g}" for a, b in effects.gauge_pa)
        name = f"{effects.levels}: " if effects.levels else ""
        texts.append(topic.text(name=name, statement=effects.statement, pairs=pairs))
    panels = [_slopes(e) for e in found.pressure if e.slope_a or e.slope_b or e.slope_sum]
    y, size = "friction per pressure / (N/bar)", {"columns": 3, "row_in": 2.4, "rest_in": 0.4}
    figure = Figure(panels, SPEED, y, share_y="all", legend="panel", **size)
    rows = [row for e in found.pressure for row in _pressure_rows(e)]
    return topic.section(
        *texts,
        topic.picture("campaign-pressure", figure) if panels else None,
        topic.table(rows) if rows else None,
    )


def _slopes(e: PressureEffects) -> Panel:
    marks: list[Any] = [Rule(y=0.0, look=Look("black"))]
    for index, (label, slopes) in enumerate(zip(CHAMBERS, (e.slope_a, e.slope_b, e.slope_sum), strict=True)):
        if slopes:
            speed = e.speed_m_s * (1.0 + 0.03 * (index - 1))  # side by side
            value, low, high = ends(slopes)
            marks.append(Markers(speed, value, label, look(index), low, high, 3.5, joined=True))
    return Panel(marks, e.levels)


def _pressure_rows(e: PressureEffects) -> Iterator[tuple]:
    levels = e.levels or "all"
    for word, mean in zip(CHAMBERS, (e.mean_a, e.mean_b, e.mean_sum), strict=True):
        if mean is not None:
            yield levels, word, with_interval(mean, PA_PER_BAR, "N/bar"), mean.p
    if e.interaction is not None:
        yield levels, "interaction a × b", with_interval(e.interaction_n_pa2, PA_PER_BAR**2, "N/bar²"), e.interaction.p
    if e.curvature is not None:
        yield levels, "curvature", "", e.curvature.p


def direction(found: CampaignCharacteristics) -> Section | None:
    """Return the section on half the difference between both directions."""
    if not found.asymmetry:
        return None
    topic, named = Topic("campaign", "direction"), condition_names(found)
    separable = any(a.basis == "tare" for a in found.asymmetry)
    rows = ((named(a.condition), a.basis, a.mean, a.mean.p, plural(a.speed_m_s.size, "speed")) for a in found.asymmetry)
    return topic.section(topic.text("separable" if separable else "inseparable"), topic.table(rows))


# --- course along the stroke and over time ---------------------------------------------------------------------------


def position(found: CampaignCharacteristics) -> Section | None:
    """Return the section on friction along the stroke."""
    shown = [p for p in found.position if np.isfinite(p.relative).sum() > 3][:MOST_PANELS]
    if not shown:
        return None
    topic, named, panels, rows = Topic("campaign", "position"), condition_names(found), [], []
    for p in shown:
        where = named(p.condition) if p.condition is not None else p.levels or "all cycles"
        x, middle, low, high = (v[np.isfinite(p.relative)] for v in (p.position_m, p.relative, p.low, p.high))
        marks = [Band(x, low - 1.0, high - 1.0), Rule(y=0.0), Line(x, middle - 1.0, look=Look("blue"), width=1.0)]
        panels.append(Panel(marks, f"{where}\n({plural(p.cycles, 'cycle')})"))
        rows += _patterns(where, p)
    size = {"columns": 3, "row_in": 1.9, "share_y": "all"}
    figure = Figure(panels, "position / mm", "friction minus its mean / %", **size)
    return topic.section(topic.text(), topic.picture("campaign-position", figure), topic.table(rows))


def _patterns(where: str, p: PositionPattern) -> Iterator[tuple]:
    yield where, "trend", with_interval(p.trend_per_m, 100.0, "%/m"), p.trend_per_m.p
    for h in p.harmonics:
        wave = f"wavelength {MM * h.wavelength_m:.3g} mm"
        yield where, wave, with_interval(h.amplitude, 100.0, "%"), h.amplitude.p


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
    is_drawn = basis and d.time_s.size > 2 and np.isfinite(d.drift_n).any()
    return topic.section(
        Paragraph(topic.say(told=basis or topic.say("untold")) + (topic.say("model") if basis else "")),
        topic.picture("campaign-drift", drift_figure(found)) if is_drawn else None,
        topic.table(rows),
    )


def drift_figure(found: CampaignCharacteristics) -> Figure:
    """Draw drift over time with control runs, and below it the sensor's zero if there are zero runs."""
    d, zero = found.drift, found.zero
    assert d is not None
    order = np.argsort(d.time_s)
    time, middle, low, high = (v[order] for v in (d.time_s, d.drift_n, d.low_n, d.high_n))
    marks = [Band(time, low, high), Rule(y=0.0), Line(time, middle, "drift of the mixed model", Look("blue"))]
    if d.sentinel_n.size:
        away = d.sentinel_n - d.sentinel_n.mean()
        marks.append(Markers(d.sentinel_time_s, away, "sentinels", Look("orange", "-", "D")))
    panels = [Panel(marks, y="drift / N")]
    if zero.time_s.size > 1:
        low, high = zero.zero_n - 2 * zero.stderr_n, zero.zero_n + 2 * zero.stderr_n
        points = Markers(zero.time_s, zero.zero_n, "", Look("black", "-", "s"), low, high)
        panels.append(Panel([points], y="sensor zero / N"))
    height, heights = (3.8, (2, 1)) if len(panels) > 1 else (2.6, ())
    return stack(panels, height, heights, Axis("time / h", below=0.02, above=0.02))


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
    panels = [
        Panel(
            [Markers(loop.position_m, loop.friction_n, look=Look("blue", "-", "."), size=1.4), Rule(y=0.0)],
            f"{MM * loop.speed_m_s:.3g} mm/s, {named(loop.condition)}",
        )
        for loop in shown
    ]
    figure = Figure(panels, "position / mm", "friction / N", columns=3, row_in=2.1, rest_in=0.4, share_y="all")
    rows = (SimpleNamespace(condition=named(loop.condition), loop=loop) for loop in shown)
    return topic.section(topic.text(), topic.picture("campaign-loops", figure), topic.table(rows))


def stick_slip(found: CampaignCharacteristics) -> Section | None:
    """Return the section on stick-slip."""
    if not found.stick_slip:
        return None
    topic, named, marks = Topic("campaign", "stick-slip"), condition_names(found), []
    conditions = spread_evenly(list(dict.fromkeys(p.condition for p in found.stick_slip)), MOST_CONDITIONS)
    for index, condition in enumerate(conditions):
        points = sorted((p for p in found.stick_slip if p.condition == condition), key=lambda p: p.speed_m_s)
        speed, ripple, slips = (np.array([getattr(p, n) for p in points]) for n in ("speed_m_s", "ripple", "share"))
        marks.append(Markers(speed, ripple, named(condition), look(index), joined=True))
        marks.append(Markers(speed[slips > 0], ripple[slips > 0], look=look(index), filled=True))
    figure = Figure([Panel(marks)], SPEED, Axis("ripple of speed / %", low=0.0), row_in=2.5, rest_in=0.0, entries=3)
    rows = [SimpleNamespace(condition=named(p.condition), point=p) for p in found.stick_slip if p.share > 0]
    return topic.section(
        topic.text(thresholds=" ".join(t.text for t in found.stick_slip_thresholds)),
        topic.picture("campaign-stick-slip", figure),
        topic.table(rows) if rows else None,
    )


# --- the run ---------------------------------------------------------------------------------------------------------


def run(found: CampaignCharacteristics) -> Section:
    """Return the section on protocol, rig, operator and numbers of cycles."""
    topic, about, rig = Topic("campaign", "run"), about_of(found), found.identity
    kinds = Counter(c.kind for c in found.cycles) + Counter({"stop": len(found.stops)})
    counts = ", ".join(f"{plural(n, kind)} ({KINDS.get(kind, kind)})" for kind, n in kinds.items())
    envelope = _envelope(about)
    labels = {**rig.labels, **about.get("labels", {})}
    rows = (
        ("campaign", found.name),
        ("rig", rig.name),
        ("operator", str(about.get("operator") or "not stated")),
        ("labels", ", ".join(f"{k} {v}" for k, v in labels.items()) or "none"),
        ("created", str(about.get("created", "not stated"))),
        ("seed of the order", str(about.get("seed", "not stated"))),
        ("areas a, b", f"{1e4 * rig.area_a_m2:.4g} cm², {1e4 * rig.area_b_m2:.4g} cm²"),
        ("mass beyond the sensor", f"{rig.mass_beyond_sensor_kg:.3g} kg"),
        ("stiffness", f"{rig.stiffness_n_m:.3g} N/m" if rig.stiffness_n_m else "not stated: stick-slip is not judged"),
        ("chambers", f"{rig.chambers}; pressure measured at the {rig.pressure_measured_at}"),
        ("ambient pressure", f"{rig.ambient_pressure_pa / 1e5:.4g} bar abs"),
        ("selection of samples", found.protocol),
    )
    return topic.section(
        topic.text("simulated", "note") if found.synthetic else topic.text("measured"),
        topic.text("counts", counts=counts or "none"),
        topic.picture("campaign-rig", rig_diagram(rig, envelope)) if envelope is not None else None,
        topic.table(rows, "facts"),
        _ranges(topic, found),
        _sensors(topic, found),
    )


def _envelope(about: dict[str, Any]) -> Envelope | None:
    stated = about.get("envelope")
    if not isinstance(stated, dict):
        return None
    try:
        values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in stated.items()}
        return Envelope(**values)
    except TypeError:
        return None


def _ranges(topic: Topic, found: CampaignCharacteristics) -> PageTable:
    r = found.ranges
    rows = (
        ("speed, mm/s", [1e3 * v for v in r.speed_m_s], ".4g"),
        ("pressure a, bar gauge", [v / 1e5 for v in r.gauge_a_pa], ".3g"),
        ("pressure b, bar gauge", [v / 1e5 for v in r.gauge_b_pa], ".3g"),
        ("temperature, °C", [v - ZERO_CELSIUS_K for v in r.temperature_k], ".1f"),
    )
    texts = ((name, *(f"{v:{form}}" if math.isfinite(v) else "none" for v in limits)) for name, limits, form in rows)
    return topic.table(texts, "ranges")


def _sensors(topic: Topic, found: CampaignCharacteristics) -> PageTable:
    rig = found.identity
    unstated = "not stated: assumed"
    rows = [
        (
            channel,
            "{:g} … {:g}".format(*rig.limits[channel]) if channel in rig.limits else "not stated",
            f"{rig.accuracy[channel]:.3g}" if channel in rig.accuracy else unstated,
            rig.calibration.get(channel, "not stated"),
        )
        for channel in dict.fromkeys([*rig.accuracy, *rig.limits, *rig.resolution, *rig.calibration])
    ]
    return topic.table(rows or [("all", "not stated", unstated, "not stated")], "sensors")


def statements(found: CampaignCharacteristics) -> Section | None:
    """Return the section of statements: missing ones first."""
    if not found.statements:
        return None
    topic = Topic("campaign", "statements")
    missing, carried = (
        [str(s) for s in found.statements if s.carried == known and s.topic != "stops"] for known in (False, True)
    )
    return topic.section(*topic.listed(missing, "missing", "note"), *topic.listed(carried, "carried"))


def flags(found: CampaignCharacteristics) -> Section:
    """Return the section on flags of cycles and stops, and on skipped cycles."""
    topic = Topic("campaign", "flags")
    counts = Counter(found.flags) + Counter(flag for s in found.stops for flag in s.flags)
    texts = {flag: flag_table().get(flag, {"means": "", "do": ""}) for flag in counts}
    raised = ((flag.replace("_", " "), texts[flag]["means"], texts[flag]["do"], n) for flag, n in counts.most_common())
    skipped = ((s.key or None, s.file, s.reason) for s in found.skipped[:MOST_SKIPPED])
    left_out = len(found.skipped) - MOST_SKIPPED
    more = f"; {left_out} more are not listed" if left_out > 0 else ""
    return topic.section(
        topic.table(raised, "raised") if counts else topic.text("none_raised"),
        topic.table(skipped, "skipped", more=more) if found.skipped else topic.text("none_skipped"),
    )


def budget(found: CampaignCharacteristics) -> Section | None:
    """Return the section on the sources of uncertainty of the curves."""
    if not found.sources:
        return None
    topic = Topic("campaign", "budget")
    rows = ((s.name, s.kind, s.basis, s.note, s.standard_uncertainty_n) for s in found.sources)
    return topic.section(topic.text(), topic.table(rows))


def sources(found: CampaignCharacteristics) -> Section:
    """Return the section on software, protocol as run, sources of methods."""
    rows = [
        ("pneudrive, this report", __version__),
        ("pneudrive, the campaign", str(about_of(found).get("version", "not stated"))),
        *software(),
        ("raw data", f"{found.folder.name}/cycles, one Parquet file per cycle"),
    ]
    topic = Topic("campaign", "provenance")
    return topic.section(
        topic.table(rows, "software"),
        *_protocol(topic, found),
        *topic.listed(references(METHODS), "sources"),
    )


def _protocol(topic: Topic, found: CampaignCharacteristics) -> Iterator[Block]:
    protocol = found.folder / "campaign.toml"
    if protocol.is_file():
        lines = protocol.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        more = [topic.say("more", count=len(lines) - MOST_LINES)] if len(lines) > MOST_LINES else []
        yield topic.text("protocol")
        yield Paragraph("\n".join([*lines[:MOST_LINES], *more]), "code")
