"""Views and reports of a campaign (statements, effects, curves, stops, course, run) and of two compared campaigns."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from pneudrive.campaign.cycle import KINDS
from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.estimate.estimates import Estimate
from pneudrive.figures import SPEED, Axis, Band, Figure, Line, Look, Markers, Panel, Rule, banded, ends, look, stack
from pneudrive.friction.friction_map import BOTH, CHAMBERS, LEVELS, PA_PER_BAR, Condition, conditions_of
from pneudrive.friction.sentences import Statement, flag_table
from pneudrive.numbers import plain, with_interval, with_u
from pneudrive.report import page
from pneudrive.report.page import MM, Blocks, Paragraph, Topic, condition_names, figure_of, plural, spread_evenly
from pneudrive.views import MOST_LEADING, Finding, ShownFigure, ShownValue, State, View, worst

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from pneudrive.friction.campaign.compare import Comparison, CurveComparison
    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.campaign.stops.dwell_law import DwellSeries

MOST_CURVES = 8  # that a reader can distinguish in one picture
MOST_PANELS = MOST_LOOPS = 6
OF_INTERVAL = ("", "_low", "_high")  # endings of the columns of a value and its interval
SHOWN_SPEEDS = 12  # rows of a table
MOST_LINES = 120  # lines of a protocol that are shown
MOST_SKIPPED = 40


def write_campaign_report(found: CampaignCharacteristics, folder: str | Path) -> Path:
    """Write report.html, which loads no other files, and its figures as PNG and SVG.

    Parameters
    ----------
    found : CampaignCharacteristics
    folder : path-like
        An existing folder; figures go into its subfolder ``figures``.

    Returns
    -------
    pathlib.Path
        Path of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    view = found.view()
    title = f"{'Synthetic friction' if found.synthetic else 'Friction'} campaign: {found.name}"
    parts = {"run": run, **FIGURED, "flags": flags, "budget": budget, "provenance": sources}
    further = page.sections_of("campaign", parts, found)
    report = page.view_report(replace(view, title=title, curves=(), figures=()), *further, synthetic=found.synthetic)
    report.verdict = [view.title, *report.verdict]
    return report.write(folder)


# --- view ------------------------------------------------------------------------------------------------------------


def campaign_view(found: CampaignCharacteristics) -> View:
    """Return the view of a campaign, or of the curves of recordings."""
    ambient, values = found.identity.ambient_pressure_pa, tuple(_values(found))
    findings = findings_of(found.statements)
    # Headline: number of cycles, rig, and number of open findings. Recordings have no rig.
    is_campaign, rig = found.name != found.identity.name, f"on {found.identity.name}"
    count = plural(len(found.cycles) + len(found.stops), "cycle" if is_campaign else "speed level")
    if found.synthetic or not is_campaign:
        rig = "on a simulated rig (synthetic)" if found.synthetic else "of recordings"
    lost = f"; {plural(len(found.skipped), 'cycle')} could not be used" if found.skipped else ""
    missing = sum(not s.carried for s in found.statements)
    rest = f" {plural(missing, 'question is', 'questions are')} not answered by these data." if missing else ""
    return View(
        title=f"{f'{found.name}: ' if is_campaign else ''}{count} {rig}{lost}.{rest}",
        rows=values,
        curves=tuple(curve.shown(ambient) for curve in found.curves if curve.direction == BOTH),
        state=worst(findings),
        leading=tuple(_leading(found, values)),
        findings=findings,
        figures=shown_figures(page.sections_of("campaign", FIGURED, found)),
    )


def shown_figures(sections: Iterable[page.Section]) -> tuple[ShownFigure, ...]:
    """Return the figures of sections for a view."""
    return tuple(block for section in sections for block in section.blocks if isinstance(block, ShownFigure))


def findings_of(statements: Iterable[Statement]) -> list[Finding]:
    """Return statements as findings. Doubts about the data are ``bad``, undetermined values are ``open``."""
    findings = []
    for s in statements:
        state: State = "good" if s.carried else "bad" if s.topic == "data" else "open"
        findings.append(Finding(s.text, state, f"Remedy: {s.remedy}" if s.remedy else ""))
    return findings


def _values(found: CampaignCharacteristics) -> Iterator[ShownValue]:
    """Yield counts, ranges, and each effect with its interval and p-value."""
    for name in ("cycles", "skipped", "curves", "stops"):
        yield ShownValue(name, name, "value", str(len(getattr(found, name))))
    r = found.ranges
    for name, (low, high), size, zero, unit in (
        ("speeds", r.speed_m_s, 1e-3, 0.0, "mm/s"),
        ("gauge pressure a", r.gauge_a_pa, PA_PER_BAR, 0.0, "bar"),
        ("gauge pressure b", r.gauge_b_pa, PA_PER_BAR, 0.0, "bar"),
        ("temperature", r.temperature_k, 1.0, ZERO_CELSIUS_K, "°C"),
    ):
        if math.isfinite(low):
            limits = (plain(round((end - zero) / size, 3)) for end in (low, high))
            yield ShownValue(name, name, "value", f"{' to '.join(limits)} {unit}")
    for name, e in found.effects().items():
        if isinstance(e, Estimate):
            yield ShownValue(name, name, "value", e.value, e.unit, (e.low, e.high))
        if math.isfinite(e.p):
            yield ShownValue(f"{name}, p", name, "p", page.chance(e.p))


def _leading(found: CampaignCharacteristics, values: Sequence[ShownValue]) -> Iterator[ShownValue]:
    """Yield friction at the lowest and the highest speed, and the main effects."""
    named = condition_names(found)
    for c in [c for c in found.curves if c.direction == BOTH][:1]:
        for i in dict.fromkeys(np.flatnonzero(c.measured)[[0, -1]].tolist()):
            name = f"friction at {MM * c.speed_m_s[i]:.3g} mm/s, {named(c.condition)}:"
            yield ShownValue(name, name, name, float(c.friction_n[i]), "N", (float(c.low_n[i]), float(c.high_n[i])))
    first = slice(0, 1)  # of several pressures; the mean over conditions is the last one of a series of stops
    for begin, part in (("pressure of", first), ("breakaway per decade", slice(-1, None)), ("scatter of one", first)):
        chosen = [row for row in values if row.key.startswith(begin) and row.quantity == "value"]
        yield from (replace(row, quantity=f"{row.label}:") for row in chosen[part])


def statements(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show findings on the curves of recordings, and the effects."""
    yield from page.view_section(topic.key, replace(found.view(), curves=(), figures=(), leading=())).blocks


# --- curves, air and pressures ---------------------------------------------------------------------------------------


def curves(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show friction over speed at every condition."""
    both = [c for c in found.curves if c.direction == BOTH]
    if not both:
        return
    named, shown = condition_names(found), spread_evenly(both, MOST_CURVES)
    fewer = topic.say("fewer", shown=len(shown), all=len(both)) if len(shown) < len(both) else ""
    with_air = topic.say("with_air") if any(c.contains_air for c in both) else ""
    yield Paragraph(f"{topic.say()}{fewer}{with_air}")
    # All curves with their bands in one picture, with a colour for each group if there are several.
    groups, marks = sorted({c.condition.title for c in shown}), []
    for index, c in enumerate(shown):
        color = look(groups.index(c.condition.title) if len(groups) > 1 else index).color
        own, label = look(index)._replace(color=color), named(c.condition)
        speed, friction = c.speed_m_s, c.friction_n
        if speed.size == 1:
            marks.append(Markers(speed, friction, label, own, c.low_n, c.high_n, 3.6))
        else:
            marks += banded(speed, friction, c.low_n, c.high_n, label, own, 1.0)
            marks.append(Markers(speed[c.measured], friction[c.measured], look=own, size=3.6))
        if c.excluded.height:
            excluded = c.excluded.select("speed_m_s", "friction_n").to_numpy().T
            marks.append(Markers(*excluded, look=own._replace(marker="x")))
    force = "seal and air" if shown[0].contains_air else "friction"
    figure = Figure([Panel(marks)], SPEED, f"{force} / N", row_in=3.8, rest_in=0.0, entries=3)
    yield topic.figure("campaign-curves", figure)
    rows = []
    for c in both[:MOST_CURVES]:
        for i in spread_evenly(np.flatnonzero(c.measured).tolist(), SHOWN_SPEEDS):
            friction = with_u(float(c.friction_n[i]), float(c.high_n[i] - c.low_n[i]) / 2.0, "")
            uncertainties = c.stderr_n[i], c.u_systematic_n[i]
            rows.append((named(c.condition), MM * c.speed_m_s[i], friction, *uncertainties, c.cycles[i]))
    yield topic.table(rows)


def air(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show which part of the friction over speed the air force explains."""
    if not found.air:
        return
    named, separated = condition_names(found), [a for a in found.air if a.separated]
    shown = spread_evenly(separated or found.air, MOST_PANELS)
    text, panels = "separated" if separated else "together", []
    for a in shown:
        marks: list[Any] = []
        for index, label in enumerate(("total", "seal", "air") if a.separated else ("total",)):
            value, low, high = (getattr(a, f"{label}{end}_n") for end in OF_INTERVAL)
            marks += banded(a.speed_m_s, value, low, high, label, look(index))
        if not a.separated:
            marks.append(Line(a.speed_m_s, a.air_bound_n, "air, at most", Look("orange", ":")))
        panels.append(Panel(marks, named(a.condition)))
    yield topic.text(text)
    yield topic.figure("campaign-air", figure_of("air", panels), parts=topic.say(f"parts_{text}"))


def pressure(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show effects of the chamber pressures, and their interaction."""
    panels = []
    for effects in found.pressure:
        pairs = ", ".join(f"{a / PA_PER_BAR:.3g}/{b / PA_PER_BAR:.3g}" for a, b in effects.gauge_pa)
        name = f"{effects.levels}: " if effects.levels else ""
        yield topic.text(name=name, statement=effects.statement, pairs=pairs)
        marks: list[Any] = [Rule(y=0.0, look=Look("black"))]
        for index, (chamber, slopes) in enumerate(effects.slopes.items()):
            speed = effects.speed_m_s * (1.0 + 0.03 * (index - 1))  # side by side
            value, low, high = ends(slopes)
            marks.append(Markers(speed, value, CHAMBERS[chamber], look(index), low, high, 3.5, joined=True))
        panels += [Panel(marks, effects.levels)] if effects.slopes else []
    if panels:
        yield topic.figure("campaign-pressure", figure_of("slopes", panels))


# --- course along the stroke and over time ---------------------------------------------------------------------------


def position(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show friction along the stroke."""
    named, panels = condition_names(found), []
    for p in [p for p in found.position if np.isfinite(p.relative).sum() > 3][:MOST_PANELS]:
        where = named(p.condition) if p.condition is not None else p.levels or "all cycles"
        known = np.isfinite(p.relative)
        x, middle, low, high = np.array([p.position_m, p.relative - 1.0, p.low - 1.0, p.high - 1.0])[:, known]
        marks = [Band(x, low, high), Rule(y=0.0), Line(x, middle, look=Look("blue"), width=1.0)]
        panels.append(Panel(marks, f"{where}\n({plural(p.cycles, 'cycle')})"))
    if panels:
        yield topic.text()
        yield topic.figure("campaign-position", figure_of("position", panels))


def drift(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show the drift over the campaign, with the sentinels (repeats of one speed), and the zero of the sensor."""
    d = found.drift
    if d is None:
        return
    basis = topic.texts["told"].get(d.basis)
    yield Paragraph(topic.say(told=basis or topic.say("untold")) + (topic.say("model") if basis else ""))
    if not basis or d.time_s.size <= 2 or not np.isfinite(d.drift_n).any():
        return
    # Drift over time with the sentinels; below, the zero of the sensor if it was measured several times.
    order, zero = np.argsort(d.time_s), found.zero
    time, middle, low, high = np.array([d.time_s, d.drift_n, d.low_n, d.high_n])[:, order]
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
    figure = stack(panels, height, heights, Axis("time / h", below=0.02, above=0.02))
    yield topic.figure("campaign-drift", figure)


def loops(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show hysteresis around reversals."""
    if not found.loops:
        return
    named = condition_names(found)
    shown = spread_evenly(sorted(found.loops, key=lambda loop: loop.speed_m_s), MOST_LOOPS)
    panels = [
        Panel(
            [Markers(loop.position_m, loop.friction_n, look=Look("blue", "-", "."), size=1.4), Rule(y=0.0)],
            f"{MM * loop.speed_m_s:.3g} mm/s, {named(loop.condition)}",
        )
        for loop in shown
    ]
    yield topic.text()
    yield topic.figure("campaign-loops", figure_of("loops", panels))


def stick_slip(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show stick-slip."""
    if not found.stick_slip:
        return
    named, marks = condition_names(found), []
    conditions = spread_evenly(dict.fromkeys(p.condition for p in found.stick_slip), MOST_CURVES)
    for index, condition in enumerate(conditions):
        points = sorted((p for p in found.stick_slip if p.condition == condition), key=lambda p: p.speed_m_s)
        speed, ripple, slips = (np.array([getattr(p, n) for p in points]) for n in ("speed_m_s", "ripple", "share"))
        marks.append(Markers(speed, ripple, named(condition), look(index), joined=True))
        marks.append(Markers(speed[slips > 0], ripple[slips > 0], look=look(index), filled=True))
    yield topic.text(thresholds=" ".join(t.text for t in found.stick_slip_thresholds))
    yield topic.figure("campaign-stick-slip", figure_of("ripple", [Panel(marks)]))
    if rows := [{"condition": named(p.condition), "point": p} for p in found.stick_slip if p.share > 0]:
        yield topic.table(rows)


# --- stops -----------------------------------------------------------------------------------------------------------

MOST_SHOWN = 4  # series of stops, and conditions of one series
#: Displayed time before and after a restart, in units of the time from restart to peak.
BEFORE, AFTER = 1.5, 20.0
SHORTEST_S = 1e-3
SHAPES = {"t0": "t0", "tau": "τ", "gamma": "γ", "m": "m"}


def stops(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show stops: force over time, breakaway over the stop duration, relaxation and recovery."""
    if not len(found.stops):
        return
    yield topic.text(stops=plural(len(found.stops), "stop"))
    yield topic.figure("campaign-stop-traces", traces(found))
    series = [s for s in found.dwell if s.curve is not None][:MOST_SHOWN]
    if series:
        yield topic.figure("campaign-dwell", figure_of("dwell", [_increments(found, s) for s in series]))
    yield from (topic.table(_laws(s), "laws", series=s.name, reference_s=s.reference_s) for s in series if s.laws)
    if any(len(_known(found.stops, name)) for name in ("relaxation_n", "recovery_m")):
        yield topic.figure("campaign-stop-relaxation", relaxation(found))


# --- traces ----------------------------------------------------------------------------------------------------------


def traces(found: CampaignCharacteristics) -> Figure:
    """Draw a short, a medium and a long stop, and their restarts in detail."""
    usable, named = found.stops.filter("usable"), condition_names(found)
    rows = (usable if len(usable) else found.stops).sort("dwell_s", maintain_order=True)
    chosen = rows[spread_evenly(range(len(rows)), 3)]  # three stops fit in one picture
    panels = []
    for stop, condition in zip(chosen.iter_rows(named=True), conditions_of(chosen), strict=True):
        time, friction = (np.array(stop[f"trace_{name}"]) for name in ("time_s", "friction_n"))
        dwell_s, loading_s, speed_m_s = (stop[name] for name in ("dwell_s", "loading_s", "speed_m_s"))
        held, way = "released" if stop["released"] else "held", "+x" if stop["direction"] > 0 else "−x"
        title = f"{stop['stop_s']:g} s {held}, restart {way} at {MM * speed_m_s:.3g} mm/s, {named(condition)}"
        reach = max(dwell_s, 3 * loading_s, SHORTEST_S)
        # At most 70 % of the approach: its start may still show the reversal.
        low, high = max(0.7 * time[0], -0.35 * reach), min(time[-1], 1.6 * reach + AFTER * loading_s)
        begin, end = (factor * max(loading_s, SHORTEST_S) for factor in (-BEFORE, AFTER))
        running, since = Rule(y=stop["running_n"], look=Look("blue", "--"), width=0.9), time - dwell_s
        # Only the shown samples are drawn, so that the range of the force follows from them.
        whole, restart = (time >= low) & (time <= high), (since >= begin) & (since <= end)
        course = [Rule((0.0, dwell_s)), Line(time[whole], friction[whole], width=0.7), running]
        panels.append(Panel(course, title, Axis("time since rest / s", low=low, high=high), "friction / N"))
        raw = Markers(since[restart], friction[restart], look=Look("black", "-", "."), size=1.8)
        peak = Markers([loading_s], [stop["breakaway_n"]], look=Look("orange"), size=7.0)
        panels.append(Panel([peak, raw, running], "", Axis("time since restart / ms", low=begin, high=end), Axis("")))
    return figure_of("stops", panels)


# --- breakaway against duration --------------------------------------------------------------------------------------


def _increments(found: CampaignCharacteristics, s: DwellSeries) -> Panel:
    """Draw the breakaway increments of a series of stops over the stop duration, with the best laws."""
    marks: list[Any] = []
    for index, condition in enumerate(s.conditions[:MOST_SHOWN]):
        own, members = look(index), s.stops.filter(**vars(condition))
        marks += banded(s.duration_s, s.increment_n[index], s.low_n[index], s.high_n[index], look=own)
        durations = members["dwell_s"].to_numpy() * (1.0 + 0.04 * index)
        label = condition_names(found)(condition)
        marks.append(Markers(durations, members["increment_n"].to_numpy(), label, own, size=3.4))
    for saturates, dash in ((False, (0, (6, 2))), (True, ":")):
        laws = (law for law in s.laws if law.form.saturates == saturates and law.name != "none")
        if (law := next(laws, None)) is not None:  # the best one
            title = f"{law.form.title} (ΔAICc {law.delta:.0f})" if np.isfinite(law.delta) else law.form.title
            marks.append(Line(s.duration_s, law.increment_n(s.duration_s, 0), title, Look("orange", dash), 1.4))
    return Panel(marks, s.name)


def _laws(s: DwellSeries) -> Iterator[tuple]:
    """Yield the title and formula, shape parameters, slope, and differences in AICc and BIC of each law."""
    least = min(law.bic for law in s.laws)
    for law in s.laws:
        shapes = []
        for name, unit in law.form.units.items():
            ends = (f"{end:.2g}" if 0 < end < np.inf else "open" for end in law.shape_intervals[name])
            shapes.append(f"{SHAPES[name]} = {law.shape[name]:.2g} ({' … '.join(ends)}) {unit}".strip())
        slope = f"{law.slope_n:.3g} ({law.slope_low_n:.3g} … {law.slope_high_n:.3g})"
        yield f"{law.form.title}: {law.form.formula}", "; ".join(shapes) or None, slope, law.delta, law.bic - least


# --- relaxation and recovery -----------------------------------------------------------------------------------------


def _known(stops: pl.DataFrame, name: str) -> pl.DataFrame:
    """Return the stops in which the quantity `name` has a value."""
    return stops.filter(stops[name].is_not_nan())


def relaxation(found: CampaignCharacteristics) -> Figure:
    """Draw relaxation and recovery distance over the stop duration. Triangles mark incomplete recoveries."""
    left: list[Markers] = []
    right: list[Markers] = []
    for index, condition in enumerate(sorted(set(conditions_of(found.stops)))[:MOST_SHOWN]):
        own, label = look(index), condition_names(found)(condition)
        stops = found.stops.filter(**vars(condition)).with_columns(shown_s=pl.col("dwell_s") * (1.0 + 0.05 * index))
        back = _known(stops, "recovery_m")
        whole, cut = back.filter("recovery_complete"), back.filter(~pl.col("recovery_complete"))
        for marks, name, rows in ((left, "relaxation_n", _known(stops, "relaxation_n")), (right, "recovery_m", whole)):
            if len(rows):
                value, low, high = rows.select(f"{name}{end}" for end in OF_INTERVAL).to_numpy().T
                marks.append(Markers(rows["shown_s"].to_numpy(), value, label, own, low, high, 3.2))
        if len(cut):
            shown, seen = cut.select("shown_s", "recovery_seen_m").to_numpy().T
            right.append(Markers(shown, seen, look=own._replace(marker="^"), filled=True))
    axes: tuple[Axis | str, ...] = "fall of the force / N", Axis("recovery distance / mm", low=0.0)
    panels = [Panel(marks, y=y) if marks else None for marks, y in zip((left, right), axes, strict=True)]
    return figure_of("relaxation", panels)


# --- the run ---------------------------------------------------------------------------------------------------------


def run(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show protocol, rig, operator and numbers of cycles."""
    about, rig = found.about, found.identity
    kinds = Counter(found.cycles["kind"]) + Counter({"stop": len(found.stops)})
    counts = ", ".join(f"{plural(n, kind)} ({KINDS.get(kind, kind)})" for kind, n in kinds.items())
    yield topic.text("simulated", "note") if found.synthetic else topic.text("measured")
    yield topic.text("counts", counts=counts or "none")
    labels = {**rig.labels, **about.get("labels", {})}
    values = {
        "created": about.get("created", "not stated"),
        "seed": about.get("seed", "not stated"),
        "operator": about.get("operator") or "not stated",
        "labels": ", ".join(f"{k} {v}" for k, v in labels.items()) or "none",
        "areas_cm2": (1e4 * rig.area_a_m2, 1e4 * rig.area_b_m2),
        "ambient_bar": rig.ambient_pressure_pa / 1e5,
        "stiffness": topic.say("stiffness", rig=rig) if rig.stiffness_n_m else topic.say("no_stiffness"),
    }
    rows = ((name, form.format(found=found, rig=rig, **values)) for name, form in topic.texts["about"].items())
    yield topic.table(rows, "facts")
    channels = dict.fromkeys([*rig.accuracy, *rig.limits, *rig.resolution, *rig.calibration])
    sensors = []  # channel, range, standard uncertainty and calibration of each
    for channel in channels or ["all channels"]:
        limits = "{:g} … {:g}".format(*rig.limits[channel]) if channel in rig.limits else "not stated"
        accuracy = f"{rig.accuracy[channel]:.3g}" if channel in rig.accuracy else "not stated: assumed"
        sensors.append((channel, limits, accuracy, rig.calibration.get(channel, "not stated")))
    yield topic.table(sensors, "sensors")


def flags(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show flags of cycles and stops, and skipped cycles."""
    raised = found.stops["flags"].to_list() if len(found.stops) else []
    counts = Counter(found.flags) + Counter(flag for flags in raised for flag in flags)
    about = ((flag, count, flag_table().get(flag, {"means": "", "do": ""})) for flag, count in counts.most_common())
    rows = ({"flag": flag.replace("_", " "), "cycles": count, **texts} for flag, count, texts in about)
    skipped = ((s.key or None, s.file, s.reason) for s in found.skipped[:MOST_SKIPPED])
    left_out = len(found.skipped) - MOST_SKIPPED
    more = f"; {left_out} more are not listed" if left_out > 0 else ""
    yield topic.table(rows, "raised") if counts else topic.text("none_raised")
    yield topic.table(skipped, "skipped", more=more) if found.skipped else topic.text("none_skipped")


def budget(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show the sources of uncertainty of the curves."""
    if found.sources:
        yield topic.text()
        yield topic.table(found.sources)


def sources(topic: Topic, found: CampaignCharacteristics) -> Blocks:
    """Show the software, the protocol that was run, and the sources of the methods."""
    rows = [
        ("pneudrive, the campaign", str(found.about.get("version", "not stated"))),
        *page.software(),
        ("raw data", f"{found.folder.name}/cycles, one Parquet file per cycle"),
    ]
    yield topic.table(rows, "software")
    protocol = found.folder / "campaign.toml"
    if protocol.is_file():
        lines = protocol.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        more = [topic.say("more", count=len(lines) - MOST_LINES)] if len(lines) > MOST_LINES else []
        yield topic.text("protocol")
        yield Paragraph("\n".join([*lines[:MOST_LINES], *more]), "code")
    yield from topic.listed(page.references(topic.texts["cites"]), "sources")


#: Parts with figures. The name of the function is also the key of the section.
_PARTS: tuple[Any, ...] = (curves, air, pressure, position, stops, drift, loops, stick_slip)
FIGURED: dict[str, page.Part] = {part.__name__.replace("_", "-"): part for part in _PARTS}


# --- comparison of two campaigns --------------------------------------------------------------------------------------

MOST_PAIRS = 4
MOST_ROWS = 60
CHANCE = 0.05
ORDINALS = ("first", "second")


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
    c, topic, view = comparison, Topic("comparison", "verdict"), comparison.view()
    synthetic = c.first.synthetic or c.second.synthetic
    unlike = [check.what for check in c.checks if not check.comparable]
    last = topic.say("unlike", what=", ".join(unlike)) if unlike else topic.say("alike")
    title, notes = f"{c.first.name} against {c.second.name}", (topic.say("questions"), *view.notes)
    parts = page.sections_of("comparison", {"comparable": _comparable, **COMPARED}, c)
    report = page.view_report(replace(view, title=title, notes=notes, figures=()), *parts, synthetic=synthetic)
    report.verdict = [f"{view.title}{topic.say('synthetic') if synthetic else ''}", *report.verdict, last]
    return report.write(folder)


def comparison_view(c: Comparison) -> View:
    """Return the view of a comparison: a row for each test, and the figures of both campaigns."""
    times = Counter(test.what for test in c.tests)
    values, leading = [], []
    for test in c.tests:
        # If several series of stops have the same test, the note of the series is added to its name.
        name = f"{test.what}, {test.note}" if times[test.what] > 1 else test.what
        if (e := test.difference) is not None:
            size = ShownValue(name, name, "second minus first", e.value, e.unit, (e.low, e.high))
            values.append(size)
            leading += [replace(size, quantity=f"{name}:")] if test.different else []
        differs = "yes" if test.different else "not shown"
        texts = {"p": page.chance(test.p), "p corrected": page.chance(test.adjusted_p), "different": differs}
        values += [ShownValue(f"{name}, {quantity}", name, quantity, text) for quantity, text in texts.items()]
    findings = findings_of(c.statements)
    return View(
        title=f"{c.second.name} minus {c.first.name}: {c}",
        rows=values,
        state=worst(findings),
        leading=leading[:MOST_LEADING],
        findings=findings,
        notes=[page.sentence(f"{test.what}: {test.note}") for test in c.tests],
        figures=shown_figures(page.sections_of("comparison", COMPARED, c)),
    )


def _comparable(topic: Topic, c: Comparison) -> Blocks:
    rows = ((k.what, k.first, k.second, k.comparable, "" if k.comparable else k.consequence) for k in c.checks)
    yield topic.text(first=_labels(c.first), second=_labels(c.second))
    yield topic.table(rows, first=c.first.name, second=c.second.name)


def _labels(found: CampaignCharacteristics) -> str:
    labels = dict(found.identity.labels)
    for row in found.cycles.head(1).select(LEVELS).iter_rows(named=True):
        labels |= {name: level for name, level in row.items() if level}
    return ", ".join(f"{k} {v}" for k, v in labels.items()) or "none"


def _common_curves(topic: Topic, c: Comparison) -> Blocks:
    """Show the curves of both campaigns, and below them their differences, in a column for each pair of pressures."""
    curves = c.curves
    if curves is None:
        return
    first, second = (int(curves.cycles.filter(campaign=k)["count"].sum()) for k in (0, 1))
    rows, mean_n = curves.points.head(MOST_ROWS).to_dicts(), curves.friction_n.mean(axis=0)
    for i, row in enumerate(rows):
        row["pressures"] = Condition(row["gauge_a_pa"], row["gauge_b_pa"], row["title"]).label(0.0)
        row["difference"] = with_interval(curves.difference[i], mean_n[i], "N")
    gauges, speed = curves.points.select("gauge_a_pa", "gauge_b_pa").to_numpy(), curves.points["speed_m_s"]
    groups: dict[tuple, list[int]] = {}
    for i, at in enumerate(zip(*gauges.round(-2).T, curves.points["title"], strict=True)):
        groups.setdefault(at, []).append(i)
    above, below = [], []
    for at, members in spread_evenly(groups.items(), MOST_PAIRS):
        chosen = sorted(members, key=speed.__getitem__)
        above.append(Panel(_both(c, curves, chosen), Condition(*at).label(0.0), y="friction / N"))
        marks: list[Any] = [Rule(y=0.0, look=Look("black"))]
        for i in chosen:
            differs = curves.points["corrected_p"][i] < CHANCE  # then the marker is filled
            own = Look("orange" if differs else "grey", "-", "D")
            value, low, high = ends([curves.difference[i]], mean_n[i])
            marks.append(Markers([speed[i]], value, "", own, low, high, filled=differs))
        below.append(Panel(marks, y="second minus first / N"))
    figure = figure_of("both-curves", [*above, *below], columns=len(above))
    points = plural(curves.points.height, "point")
    yield topic.text(points=points, first=plural(first, "cycle"), second=second)
    yield topic.figure("compare-curves", figure, first=c.first.name, second=c.second.name)
    yield topic.table(rows)


def _both(c: Comparison, curves: CurveComparison, chosen: list[int]) -> list[Any]:
    *gauge, speed = curves.points.select("gauge_a_pa", "gauge_b_pa", "speed_m_s").to_numpy().T
    marks = []
    for k, found in enumerate((c.first, c.second)):
        own, ambient = look(k), found.identity.ambient_pressure_pa
        for curve in found.curves:
            pair = (curve.condition.pressure_a_pa - ambient, curve.condition.pressure_b_pa - ambient)
            if curve.direction == BOTH and np.allclose(pair, [side[chosen[0]] for side in gauge], atol=2000.0):
                marks += banded(curve.speed_m_s, curve.friction_n, curve.low_n, curve.high_n, look=own, width=1.0)
                break
        label = found.name if c.first.name != c.second.name else f"{found.name} ({ORDINALS[k]})"
        marks.append(Markers(speed[chosen], curves.friction_n[k, chosen], label, own, size=3.6))
    return marks


def _dwell(topic: Topic, c: Comparison) -> Blocks:
    names = c.first.name, c.second.name
    rows = (
        (s.name, name, len(s.stops), s.reference_s, s.increment, s.slope, s.laws[0].form.title if s.laws else None)
        for pair in c.dwell
        for name, s in zip(names, pair, strict=True)
    )
    panels = []
    for pair in list(c.dwell)[:MOST_PAIRS]:
        marks: list[Any] = []
        for k, s in enumerate(pair):
            assert s.curve is not None
            # Breakaway over duration of this campaign: the mean of its conditions.
            conditions, log_s = len(s.conditions), np.log10(s.duration_s)
            weights = np.kron(np.full((1, conditions), 1.0 / conditions), np.eye(log_s.size))
            mean, low, high = ends(s.curve.values(log_s).combine(weights.astype(float)).estimates())
            marks += banded(s.duration_s, mean, low, high, f"{names[k]} ({ORDINALS[k]})", look(k))
            durations = s.stops["dwell_s"].to_numpy() * (1.0 + 0.05 * k)
            marks.append(Markers(durations, s.stops["increment_n"].to_numpy(), look=look(k), size=3.0))
        panels.append(Panel(marks, pair[0].name))
    if panels:
        yield topic.figure("compare-dwell", figure_of("both-dwell", panels), first=names[0], second=names[1])
        yield topic.table(rows)


#: Parts of a comparison with figures by the key of their section.
COMPARED = {"curves": _common_curves, "dwell": _dwell}
