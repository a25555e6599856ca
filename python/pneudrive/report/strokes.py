"""Friction of recordings over speed and from stroke to stroke: maps, recovery of true values, drift, stick-slip."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import polars as pl

from pneudrive.figures import MEASURED, MODEL, THIN, Axis, Band, Figure, Line, Look, Markers, Panel, Rule, ramp
from pneudrive.friction.friction_map import ALL_RECORDINGS, PA_PER_BAR, MapGroup, bar, groups_of
from pneudrive.friction.sentences import flag_findings
from pneudrive.friction.stick_slip import NEEDED_RISE_SAMPLES, StickSlip
from pneudrive.numbers import fixed
from pneudrive.report.page import Fits, Paragraph, Topic, by_seal, figure_of, gauge_bar, plural, spread_evenly
from pneudrive.signals.motion import local_slope
from pneudrive.views import Finding, ShownCurve, ShownTable, ShownValue, View, worst

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import xarray as xr

    from pneudrive.arrays import Array
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import Level, RecordingResult
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.report.page import Blocks


# --- Friction over speed: views of friction maps and of characterised recordings, and recovered truth.

MOST_PANELS = 9
MOST_CURVES = 8  # of one assembly
MANY = 60  # points beyond which markers get smaller
SHOWN_ERRORS = 4.0  # standard errors to either side
STRIBECK = "stribeck"
DETERMINED = "Fitted parameters (± half of the 95 % interval); these data do not determine missing parameters"
UNDETERMINED = "Values that these data cannot determine"


def map_view(table: xr.Dataset, fits: Fits | None = None) -> View:
    """Return the view of a friction map: friction over speed with U (k = 2), its extremes, and flags with remedies.

    Parameters
    ----------
    table : Dataset
        Friction map.
    fits : mapping, optional
        Assembly -> law -> fit. Determined laws are drawn; undetermined values become findings.
    """
    groups = [(group, group.curves(table)) for group in groups_of(table)]
    curves = [curve for _, own in groups for curve in own]
    names = table["recording"].to_numpy().astype(str).tolist()
    raised: dict[str, list[str]] = {}
    for name, flags in zip(names, table["flags"].to_numpy(), strict=True):
        for flag in str(flags).split(","):
            raised.setdefault(flag, []).append(name)
    findings, tables = flag_findings(raised, len(set(names))), ()
    topic = Topic("recordings", "speed")
    labels = topic.say("with_labels") if len({group.assembly for group, _ in groups}) > 1 else ""
    law = topic.say("with_law") if any(map(_speed_law, (fits or {}).values())) else ""
    if fits is not None:
        about, tables = _fitted(fits)
        findings += about or [Finding(topic.say("no_law"), "open")] * (not tables)
    return View(
        f"{table.sizes['row']} points of friction",
        curves=curves,
        state=worst(findings),
        leading=tuple(_ends(table)),
        findings=findings,
        tables=tables,
        figures=(topic.figure("friction-speed", speed_figure(groups, fits or {}), law=law, labels=labels),),
    )


def _ends(table: xr.Dataset) -> Iterator[ShownValue]:
    """Yield the lowest and the highest friction with U (k = 2)."""
    order = np.argsort(table["friction_n"].to_numpy(), kind="stable")
    for word, row in (("lowest", order[0]), ("highest", order[-1])):
        point = table.isel(row=row)
        friction, stderr, systematic = (float(point[f"{name}_n"]) for name in ("friction", "stderr", "u_systematic"))
        reach = 2.0 * float(np.hypot(np.nan_to_num(stderr), systematic))
        where = f"{point.recording.item()}, {1e3 * abs(float(point.velocity_m_s)):.3g} mm/s"
        name = f"{word} friction ({where})"
        yield ShownValue(word, word, name, friction, "N", (friction - reach, friction + reach))


def richest(by_law: Mapping[str, FrictionFit]) -> FrictionFit:
    """Return the fit of the law with the most parameters."""
    return by_law.get(STRIBECK) or next(iter(by_law.values()))


def _speed_law(by_law: Mapping[str, FrictionFit]) -> FrictionFit | None:
    """Return the fit of friction over speed; None if the data do not determine the dependence on speed."""
    fit = by_law.get(STRIBECK)
    return fit if fit is not None and "stribeck_velocity" in fit.determined else None


def _fitted(fits: Fits) -> tuple[list[Finding], list[ShownTable]]:
    """Return findings and tables of the fit with the most parameters of each assembly."""
    values, lost, notes = [], dict[Finding, list[str]](), []
    for group, by_law in fits.items():
        fit = richest(by_law)
        view = fit.view()
        values += [replace(v, label=f"{group}: {v.label}") for v in view.rows if v.label in fit.intervals]
        notes += [Finding(f"{group}: {note}.", "open") for note in fit.notes]
        for finding in view.findings:
            lost.setdefault(finding, []).append(group)
    head, rows = View("", values).table()
    tables = [ShownTable(DETERMINED, head, rows)] if rows else []
    if lost:
        cells = [(", ".join(groups), f.text, f.remedy.removeprefix("Remedy: ")) for f, groups in lost.items()]
        tables.append(ShownTable(UNDETERMINED, ("group", "value", "measure"), cells))
        names = dict.fromkeys(item.parameter for by_law in fits.values() for item in richest(by_law).undetermined)
        notes.append(Finding(f"{UNDETERMINED}: {', '.join(names)}.", "open", "The table states what to measure."))
    return notes, tables


def speed_figure(groups: list[tuple[MapGroup, list[ShownCurve]]], fits: Fits) -> Figure:
    """Draw friction and determined laws over speed: a panel for each assembly, a style for each pair of pressures."""
    panels: dict[str, list[tuple[MapGroup, ShownCurve]]] = {}
    for group, curves in groups:
        panels.setdefault(group.assembly, []).extend((group, curve) for curve in curves)
    is_single = len(panels) == 1
    count = sum(curve.x.size for _, curves in groups for curve in curves)
    drawn = []
    for assembly, members in spread_evenly(panels.items(), MOST_PANELS):
        fit = _speed_law(fits.get(assembly) or fits.get(ALL_RECORDINGS) or {})
        by_pressure = sorted(members, key=lambda member: tuple(member[0].gauges))
        shown, marks = spread_evenly(by_pressure, MOST_CURVES), []
        for index, (group, curve) in enumerate(by_pressure):
            at = next((place for place, member in enumerate(shown) if member[1] is curve), None)
            if at is None:
                marks.append(Markers(curve.x, curve.y, look=THIN, size=1.5))
                continue
            own, ends = ramp(at, len(shown)), curve.band or (curve.y, curve.y)
            label = curve.label.removeprefix(f"{assembly}: ") if is_single else ""
            names = () if is_single else (*[""] * (curve.x.size - 1), bar(max(group.gauges, key=abs)))
            size = 2.2 if count > MANY else 4.0
            look = {"size": size, "filled": not index % 2, "names": names}
            marks.append(Markers(curve.x, curve.y, label, own, *ends, **look))
            if fit is not None:
                grid = np.geomspace(curve.x.min(), curve.x.max(), 200)
                law = fit.predict(grid, *map(float, group.gauges))
                marks += [Band(grid, law.lower_n, law.upper_n), Line(grid, law.friction_n, look=own, width=0.9)]
        drawn.append(Panel(marks, "" if is_single else assembly))
    y = Axis("friction / N", low=0.0) if all((c.y >= 0.0).all() for _, own in groups for c in own) else "friction / N"
    return figure_of("curves-of-one" if is_single else "curves", drawn, y=y)


# --- Recovered truth of simulated recordings.


def recovered(found: Characterisation) -> pl.DataFrame | None:
    """Return friction with the true value of each simulated recording, SI; None without simulated recordings."""
    rows = []
    for result in found.results:
        truth = result.recording.truth
        if truth is None or "friction_n" not in truth or len(result.levels) != 1:
            continue
        (level,) = result.levels
        rows.append(
            {
                "speed_m_s": truth["speed_m_s"],
                "gauge_pa": max(truth["pressure_a_pa"], truth["pressure_b_pa"]) - level.ambient_pressure_pa,
                "friction_n": level.friction_n,
                "stderr_n": level.stderr_n,
                "error_n": level.friction_n - truth["friction_n"],
                "is_inside": abs(level.friction_n - truth["friction_n"]) <= level.expanded_n,
                "expanded_n": level.expanded_n,
                "true_n": truth["friction_n"],
            }
        )
    return pl.DataFrame(rows) if rows else None


def recovered_part(topic: Topic, found: Characterisation) -> Blocks:
    """Show the recovered friction of simulated recordings."""
    pairs = recovered(found)
    if pairs is None:
        return
    errors_n, expanded = np.abs(pairs["error_n"].to_numpy()), pairs["expanded_n"]
    ends = dict.fromkeys(f"{value:.2f}" for value in (expanded.min(), expanded.max()))
    within = int(np.sum(errors_n <= 2 * np.nan_to_num(pairs["stderr_n"].to_numpy())))
    counts = {"all": pairs.height, "inside": pairs["is_inside"].sum(), "within": within}
    yield topic.text(**counts, reach=" to ".join(ends), worst=1e3 * errors_n.max())
    yield topic.figure("recovered", errors(pairs))


def errors(pairs: pl.DataFrame) -> Figure:
    """Draw true and recovered curves over speed, and errors with their statistical part."""
    left: list[Any] = []
    right: list[Any] = [Rule(y=(-2.0, 2.0), label="two standard errors", look=Look("band"))]
    gauges = np.unique(pairs["gauge_pa"].to_numpy().round(-2))
    for index, gauge in enumerate(gauges[:MOST_CURVES]):
        own = ramp(index, min(gauges.size, MOST_CURVES))
        chosen = pairs.filter((pl.col("gauge_pa") - gauge).abs() < 100.0).sort("speed_m_s")
        names = ("speed_m_s", "friction_n", "true_n", "error_n", "stderr_n")
        speed, friction, true, error_n, stderr = chosen.select(names).to_numpy().T
        with np.errstate(divide="ignore", invalid="ignore"):  # one further off is drawn on the frame
            error = np.clip(error_n / stderr, -SHOWN_ERRORS, SHOWN_ERRORS)
        left.append(Line(speed, true, look=own, width=0.9))
        left.append(Markers(speed, friction, f"{gauge / PA_PER_BAR:.2g} bar gauge", own, size=3.2))
        right.append(Markers(speed, error, look=own, size=3.2))
    ends = Axis("error / standard error", low=-SHOWN_ERRORS, high=SHOWN_ERRORS)
    right.append(Rule(y=0.0, look=MEASURED, width=0.8))
    return figure_of("errors", [Panel(left, y="friction / N"), Panel(right, y=ends)])


# --- Changes of recordings from stroke to stroke: drift, the peaks after reversals, and stick-slip.

MOST_SEALS, MOST_ROWS, MOST_NAMED = 6, 12, 10
SHOWN_S = 10.0
MOST_SLIPS, MOST_COLUMNS = 24, 3


def drift(topic: Topic, found: Characterisation) -> Blocks:
    """Show friction stroke by stroke, if a level has three strokes in a direction."""
    long = [level for level in found.levels if max(v.size for v in level.stroke_friction_n.values()) >= 3]
    if not long:
        return
    drifting = [v for v in long if any(s.has_trend for s in v.spreads.values())]
    strongest = sorted(drifting, key=lambda level: -_drift_share(level))[:MOST_ROWS]
    yield topic.text(drifting=len(drifting), levels=plural(len(long), "speed level"))
    yield topic.figure("drift", courses(found))
    if strongest:
        yield topic.table(map(_drift_row, strongest), count=len(strongest))


def _drift_share(level: Level) -> float:
    """Return the largest drift over all strokes of a direction, as a fraction of friction."""
    slopes = [abs(s.slope_n) * s.strokes for s in level.spreads.values() if s.has_trend]
    return max(slopes, default=0.0) / max(abs(level.friction_n), 1e-9)


def _drift_row(level: Level) -> tuple[object, ...]:
    cells: list[object] = []
    for direction in (1, -1):
        s = level.spreads[direction]
        cells += [direction * s.slope_n, s.trend_p] if s.strokes > 1 else [None, None]
    both = level.spreads.values()
    return level.recording, *cells, sum(s.strokes for s in both), sum(s.effective for s in both)


def courses(found: Characterisation) -> Figure:
    """Draw friction relative to its mean from stroke to stroke, a panel for each seal."""
    panels = []
    for seal, results in spread_evenly(by_seal(found).items(), MOST_SEALS):
        pairs = [(r, level, _course(level)) for r in results for level in r.levels]
        shortest = min(course.size for *_, course in pairs)
        median = np.median([course[:shortest] for *_, course in pairs], axis=0)
        marks: list[Any] = [Line(_numbers(course), course, look=THIN, width=0.5) for *_, course in pairs]
        marks.append(Line(_numbers(median), median, f"median of {len(pairs)}", width=1.4))
        result, level, course = max(pairs, key=lambda pair: _drift_share(pair[1]))
        if _drift_share(level) > 0.0:
            run = result.recording.labels.get("run")
            label = f"{fixed(gauge_bar(level), 1)} bar" + (f", run {run}" if run else "")
            marks.append(Markers(_numbers(course), course, label, Look("blue", "--", "s"), size=2.5, joined=True))
        panels.append(Panel([*marks, Rule(y=0.0)], seal))
    return figure_of("courses", panels)


def _numbers(course: np.ndarray) -> np.ndarray:
    return np.arange(1, course.size + 1)


def _course(level: Level) -> np.ndarray:
    """Return the relative deviation of friction from the level's mean for each pair of strokes."""
    each = [values for values in level.stroke_friction_n.values() if values.size]
    shortest = min(values.size for values in each)
    return np.mean([values[:shortest] for values in each], axis=0) / level.friction_n - 1


# --- peaks after reversals -------------------------------------------------------------------------------------------


def peaks(topic: Topic, found: Characterisation) -> Blocks:
    """Show friction peaks after reversals, and doubts about them."""
    every = [peak for level in found.levels for peak in level.peaks]
    if not every:
        return
    good = [peak for peak in every if not peak.flags]
    real = [peak for peak in good if peak.significant]
    counts = {flag: sum(flag in peak.flags for peak in every) for flag in topic.texts["spoils"]}
    spoilt = "; ".join(
        f"{words.format(needed=NEEDED_RISE_SAMPLES)}: {counts[flag]}"
        for flag, words in topic.texts["spoils"].items()
        if counts[flag]
    )
    numbers = {"reversals": plural(len(every), "reversal"), "good": plural(len(good), "peak"), "real": len(real)}
    yield topic.text("spoilt" if spoilt else "text", **numbers, spoilt=spoilt)
    if len(good) < len(every) / 2:
        yield topic.text("few", "note")
    yield from topic.listed(topic.say("peak", p=p) for p in real[:MOST_NAMED])


# --- stick-slip ------------------------------------------------------------------------------------------------------


def stick_slip(topic: Topic, found: Characterisation) -> Blocks:
    """Show stick-slip, with pictures."""
    every = [(r, level, s) for r in found.results for level in r.levels for s in level.stick_slip]
    slipping = [item for item in every if item[2].found and "stick_slip" in item[1].flags]
    if not every or (found.synthetic and not slipping):
        return
    strokes = plural(len(every), "stroke")
    if not slipping:  # the text names the shortest visible period
        jumps = [s for *_, s in every if s.found]
        text = topic.say("nothing", strokes=strokes, finest=np.median([s.resolution_s for *_, s in every]))
        if jumps:
            percent = 100 * max(s.stuck_share for s in jumps)
            text += topic.say("jumps", strokes=plural(len(jumps), "stroke"), percent=percent)
        yield Paragraph(text)
        return
    over_time, phases = motion_figures([_of_stroke(*item) for item in slipping[:MOST_COLUMNS]])
    rows = [
        {"level": level, "stroke": s, "ratio": s.peak_speed_m_s / s.mean_speed_m_s if s.mean_speed_m_s > 0 else None}
        for _, level, s in slipping[:MOST_SLIPS]
    ]
    yield topic.text(some=len(slipping), strokes=strokes)
    yield topic.table(rows)
    yield topic.figure("stick-slip-recordings", over_time)
    yield topic.figure("stick-slip-recordings-phase", phases)


def _of_stroke(result: RecordingResult, level: Level, s: StickSlip) -> MotionPanels:
    r = result.recording
    part = slice(*np.searchsorted(r.time_s, (s.start_s, s.stop_s)))
    time, position = r.time_s[part], r.position_m[part]
    window = max(int(s.resolution_s / 2 / max(float(np.median(np.diff(time))), 1e-12)) // 2, 1)
    velocity = s.direction * local_slope(time, position, window)
    return motion_panels(level.recording, time - time[0], s.direction * position, velocity, s.mean_speed_m_s)


FASTER = Axis("speed / (mm/s)", above=0.2)


#: Speed over time, position over time, and speed over position minus the mean motion.
MotionPanels: TypeAlias = tuple[Panel, Panel, Panel]


def motion_panels(title: str, time_s: Array, position_m: Array, velocity_m_s: Array, mean_m_s: float) -> MotionPanels:
    """Draw one motion; its time starts at zero."""
    part, trend = time_s <= SHOWN_S, np.polynomial.Polynomial.fit(time_s, position_m, 1)(time_s)
    mean = Rule(y=mean_m_s, label=f"mean {1e3 * mean_m_s:.2f} mm/s", look=MODEL, width=1.0)
    speed = Panel([Line(time_s[part], velocity_m_s[part], width=0.8), mean], title, y=FASTER)
    position = Panel([Line(time_s[part], position_m[part], width=1.0)], y="position / mm")
    return speed, position, Panel([Line(position_m - trend, velocity_m_s, width=0.5), replace(mean, label="")], title)


def motion_figures(motions: Sequence[MotionPanels]) -> tuple[Figure, Figure]:
    """Draw motions over time and in the phase plane, a column for each."""
    speeds, positions, phases = zip(*motions, strict=True)
    over_time = figure_of("motions", [*speeds, *positions], columns=len(motions))
    return over_time, figure_of("phase-planes", phases, columns=len(motions))
