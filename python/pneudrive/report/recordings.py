"""Recordings: views of a recording, of a friction map and of a characterisation, and the report of recordings."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from pneudrive import figures
from pneudrive.errors import RecordingError
from pneudrive.figures import THIN, Axis, Band, Figure, Line, Look, Markers, Panel, Rule, look, ramp, stack, thin
from pneudrive.friction.characterisation import MINIMUM_RANGE_PA, NET, Characterisation, ClosureFit, PressureLine
from pneudrive.friction.friction_map import ALL_RECORDINGS, MapGroup, bar, group_of, groups_of
from pneudrive.friction.level import COVERAGE_FACTOR
from pneudrive.friction.sentences import flag_findings
from pneudrive.identify.static.result import FrictionFit
from pneudrive.numbers import fixed, plain
from pneudrive.report import campaign, page
from pneudrive.report.page import Blocks, Fits, Paragraph, Report, Topic, figure_of
from pneudrive.report.render import DrawnFigure, draw_figure
from pneudrive.signals.motion import Stroke, find_strokes, local_slope
from pneudrive.signals.recording import Recording, clean
from pneudrive.units import readable
from pneudrive.views import Finding, ShownCurve, ShownFigure, ShownTable, ShownValue, View, worst

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import xarray as xr

    from pneudrive.arrays import Array
    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.signals.proposal import Proposal

#: Parts common to recordings and campaigns.
CURVES = {key: campaign.FIGURED[key] for key in ("curves", "pressure", "position", "stick-slip")}
CURVES |= {"statements": campaign.statements, "budget": campaign.budget}


# --- Figures of a recording and its rig, and of how a proposed layout reads a foreign file.

MOST_LOOPS = 200  # over position: more thin lines cannot be told apart
FIRST_SAMPLES = 4000  # of columns that do not form a recording


def write_layout_figure(proposal: Proposal, path: str | Path) -> Path:
    """Draw the channels as pneudrive reads them, with shaded strokes towards +x, and force against position.

    Parameters
    ----------
    proposal
        As returned by ``propose_layout``.
    path
        Picture to write. The suffix selects the kind (.png, .svg, .pdf).

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    CommandError
        The picture cannot be written.
    """
    understood = f"as understood, {len(proposal.strokes)} strokes found"
    if proposal.recording is not None:
        notes = {guess.role: f"column {guess.column!r}: {guess.reason}" for guess in proposal.guesses}
        title = f"{proposal.path.name}: {understood}"
        figure = record_figure(proposal.recording, proposal.strokes, notes, title)
    else:  # the raw columns, which do not form a recording
        roles, panels = {guess.index: guess for guess in proposal.guesses}, []
        for index, values in enumerate(proposal.file.values[:8]):
            part, guess = values[:FIRST_SAMPLES], roles.get(index)
            name = proposal.file.names[index] if proposal.file.names else f"column {index}"
            label = name if guess is None else f"{name}\n{guess.role}\n({guess.unit})"
            panels.append(Panel([Line(range(len(part)), part, width=0.7)], y=Axis(label, is_si=False)))
        title = f"{proposal.path.name}: {proposal.problem or understood}"
        figure = stack(panels, 5.4, x="row", title=title)
    draw_figure(figure, path)
    return Path(path)


def record_figure(
    recording: Recording, strokes: Sequence[Stroke], notes: Mapping[str, str] | None = None, title: str = ""
) -> Figure:
    """Draw the channels over time, with shaded strokes towards +x, and force against position.

    Parameters
    ----------
    recording : Recording
    strokes : sequence of Stroke
    notes : mapping, optional
        Channel -> title of its panel. With notes, only the first strokes are drawn, otherwise the whole recording.
    title : str
    """
    time, position, force = recording.time_s - recording.time_s[0], recording.position_m, recording.force_n
    shown = strokes[:6] if notes else strokes
    stop = shown[-1].stop if notes and shown else len(time)
    part = slice(0, stop, thin(range(stop)).step)
    channels = {"position": (position, "position / mm")}
    for side in (side for side in "ab" if not is_open(recording, side)):
        gauge = getattr(recording, f"pressure_{side}_pa") - recording.ambient_pressure_pa
        channels[f"pressure_{side}"] = gauge, f"pressure {side} /\nbar gauge"
    channels["force"] = force, "force, +x / N"
    spans = [Rule((time[s.start], time[s.stop - 1]), look=Look("shade two")) for s in shown if s.direction > 0]
    panels = [
        Panel([*spans, Line(time[part], values[part], width=0.8)], fill((notes or {}).get(role, ""), 95), y=label)
        for role, (values, label) in channels.items()
    ]
    ways = {1: Look(), -1: Look("orange", "--")}
    loops = [
        Line(position[s.samples], force[s.samples], look=ways[s.direction], width=0.5)
        for s in page.spread_evenly(strokes, MOST_LOOPS)
    ]
    tall = Panel(loops, "", "position / mm", "force, +x / N (solid: towards +x, dashed: back)")
    more = {"tall": tall, "widths": (2, 1), "title": title, "text_scale": 0.85}
    return stack(panels, 1.4 * len(panels), x="time / s (dark: towards +x)", **more)


def is_open(recording: Recording, side: str) -> bool:
    """Return whether a chamber was open to ambient, so that its pressure equals ambient pressure exactly."""
    values = getattr(recording, f"pressure_{side}_pa")
    return bool(np.ptp(values) == 0 and abs(values[0] - recording.ambient_pressure_pa) < 1.0)


# --- The view of one recording.


def recording_view(recording: Recording) -> View:
    """Return the view of a recording: ranges and accuracies of channels, faulty samples with remedies, two figures."""
    topic, faults, found = Topic("recordings", "recording"), dict(recording.flags), ()
    with suppress(RecordingError):  # the view of an unusable recording shows its samples
        faults = clean(recording).flags
        found = tuple(find_strokes(recording.name, recording.time_s, recording.position_m))
    findings = flag_findings({kind: [recording.name] for kind, count in faults.items() if count}, 1)
    seconds = float(recording.time_s[-1] - recording.time_s[0]) if len(recording) else 0.0
    numbers = {
        "duration": (seconds, "s"),
        "samples": (float(len(recording)), ""),
        "samples per second": ((len(recording) - 1) / seconds if seconds else math.nan, ""),
        "strokes": (float(len(found)), ""),
    }
    return View(
        f"{recording.name} ({'simulated' if recording.synthetic else 'measured'})",
        state=worst(findings),
        leading=tuple(ShownValue(k, k, k, *value) for k, value in numbers.items() if math.isfinite(value[0])),
        findings=findings,
        tables=(topic.table(_sensors((recording,)), "sensors"),) if len(recording) else (),
        figures=(topic.figure("record", record_figure(recording, found)),) if len(recording) else (),
    )


# --- The view of a friction map: friction over speed.

MOST_PANELS, MOST_CURVES = 9, 8  # of a figure or section, of one panel
MANY = 60  # points beyond which markers get smaller
DETERMINED = "Determined parameters of a Stribeck curve (± half of the 95 % interval); `pneudrive fit` compares laws"
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
    names, raised = table["recording"].values.astype(str).tolist(), dict[str, list[str]]()
    for name, flags in zip(names, table["flags"].values.astype(str), strict=True):
        for flag in flags.split(","):
            raised.setdefault(flag, []).append(name)
    findings, tables = flag_findings(raised, len(set(names))), ()
    topic = Topic("recordings", "speed")
    labels = topic.say("with_labels") if len({group.assembly for group, _ in groups}) > 1 else ""
    law = topic.say("with_law") if any(map(_speed_law, (fits or {}).values())) else ""
    if fits is not None:
        about, tables = _fitted(fits)
        findings += about or [Finding(topic.say("no_law"), "open")] * (not tables)
    leading = []  # the lowest and the highest friction with U (k = 2)
    order = np.argsort(table["friction_n"].values, kind="stable")
    for word, row in (("lowest", order[0]), ("highest", order[-1])):
        point = table.isel(row=row)
        friction, stderr, systematic = (float(point[f"{name}_n"]) for name in ("friction", "stderr", "u_systematic"))
        reach = 2.0 * np.hypot(np.nan_to_num(stderr), systematic)
        name = f"{word} friction ({point.recording.item()}, {1e3 * abs(float(point.velocity_m_s)):.3g} mm/s)"
        leading.append(ShownValue(word, word, name, friction, "N", (friction - reach, friction + reach)))
    return View(
        f"{table.sizes['row']} points of friction",
        curves=curves,
        state=worst(findings),
        leading=leading,
        findings=findings,
        tables=tables,
        figures=(topic.figure("friction-speed", speed_figure(groups, fits or {}), law=law, labels=labels),),
    )


def richest(by_law: Mapping[str, FrictionFit]) -> FrictionFit:
    """Return the fit of the law with the most parameters."""
    return by_law.get("stribeck") or next(iter(by_law.values()))


def _speed_law(by_law: Mapping[str, FrictionFit]) -> FrictionFit | None:
    """Return the fit of friction over speed; None if the data do not determine the dependence on speed."""
    fit = by_law.get("stribeck")
    return fit if fit is not None and "stribeck_velocity" in fit.determined else None


def _fitted(fits: Fits) -> tuple[list[Finding], list[ShownTable]]:
    """Return findings and tables on the fit with the most parameters, for each assembly."""
    values, lost, notes = [], dict[Finding, list[str]](), []
    for group, by_law in fits.items():
        fit = richest(by_law)
        view = fit.view()
        values += [replace(v, label=f"{group}: {v.label}") for v in view.rows if v.label in fit.intervals]
        notes += [Finding(f"{group}: {note}.", "open") for note in fit.notes]
        notes += [replace(f, text=f"{group}: {f.text}") for f in view.findings if f.state == "bad"]
        for finding in (f for f in view.findings if f.state != "bad"):
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
    """Draw friction and fitted laws over speed: a panel for each assembly, a line style for each pair of pressures."""
    panels: dict[str, list[tuple[MapGroup, ShownCurve]]] = {}
    for group, curves in groups:
        panels.setdefault(group.assembly, []).extend((group, curve) for curve in curves)
    is_single = len(panels) == 1
    count = sum(curve.x.size for _, curves in groups for curve in curves)
    drawn = []
    for assembly, members in page.spread_evenly(panels.items(), MOST_PANELS):
        fit = _speed_law(fits.get(assembly) or fits.get(ALL_RECORDINGS) or {})
        by_pressure = sorted(members, key=lambda member: tuple(member[0].gauges))
        shown, marks = page.spread_evenly(range(len(members)), MOST_CURVES), []
        for index, (group, curve) in enumerate(by_pressure):
            if index not in shown:
                marks.append(Markers(curve.x, curve.y, look=THIN, size=1.5))
                continue
            own, ends = ramp(shown.index(index), len(shown)), curve.band or (curve.y, curve.y)
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


def recovered(found: Characterisation) -> Array:
    """Return error, standard error and U (k = 2) of the friction of simulated recordings, in N (3, recordings)."""
    rows = []
    for result in found.results:
        truth, levels = result.recording.truth or {}, result.levels
        if "friction_n" in truth and len(levels) == 1:
            rows.append((levels[0].friction_n - truth["friction_n"], levels[0].stderr_n, levels[0].expanded_n))
    return np.array(rows, dtype=float).reshape(-1, 3).T


def recovered_part(topic: Topic, found: Characterisation) -> Blocks:
    """Compare the friction evaluated from simulated recordings with its true value."""
    errors, stderr, expanded = np.abs(recovered(found))
    if errors.size:
        ends = dict.fromkeys(f"{value:.2f}" for value in (expanded.min(), expanded.max()))
        within = np.sum(errors <= 2 * np.nan_to_num(stderr))
        counts = {"all": errors.size, "inside": np.sum(errors <= expanded), "within": within}
        yield topic.text(**counts, reach=" to ".join(ends), worst=1e3 * errors.max())


# --- The view of a characterisation.

COLUMNS, NAME_LETTERS = 4, 18  # panels in a row, letters of a name over one
MOST_STROKES = 100  # of each direction: more thin lines cannot be told apart


def characterisation_view(found: Characterisation, fits: Fits | None = None) -> View:
    """Return the view of a characterisation: values of each speed level, leading values, flags with remedies, figures.

    Parameters
    ----------
    found : Characterisation
    fits : mapping, optional
        Group -> law -> FrictionFit: fitted laws, parameters, and undetermined values.
    """
    base, topic = map_view(found.friction_map, fits), Topic("recordings", "view")
    spread = found.run_spread
    relative = [level.expanded_n / level.friction_n for level in found.levels if level.friction_n > 0]
    findings = [*base.findings, *(Finding(doubt, "bad") for doubt in found.doubts)]
    if spread and relative and spread.relative > np.median(relative):
        findings.append(
            Finding(topic.say("runs_beyond_u", percent=100 * spread.relative), "open", topic.say("more_runs"))
        )
    figures, tables = [*base.figures], [*base.tables]
    if np.ptp(found.table["pressure_pa"].to_numpy()) >= MINIMUM_RANGE_PA:
        known = topic.say("between", percent=100 * spread.relative) if spread else "nothing was run twice"
        band = topic.say("runs" if spread else "one_run")
        texts = {"further": BAND[spread is not None], "known": known, "band": band}
        figures.append(topic.figure("friction-pressure", over_pressure(found), **texts))
    if spread is not None:
        cells = ((seal, p / 1e5, *rest) for seal, p, *rest in spread.cells)
        tables.append(topic.table(cells, "cells"))
    if found.closures:
        shown = page.spread_evenly(found.closures, MOST_CURVES)
        text = topic.say("one_chamber" if _is_one_chamber(shown) else "both_chambers")
        text = topic.say("with_residuals", said=text) if any(fit.degrees_of_freedom > 0 for fit in shown) else text
        figures.append(topic.figure("closure", closures(shown), said=text))
        tables.append(topic.table(_areas(found.closures), "areas"))
    figures += _loops(topic, found)
    single = (page.sentence(fit.statement) for fit in found.closures[: page.MOST_SHOWN] if not fit.has_interval)
    return replace(
        base,
        title=f"{page.plural(len(found.results), 'recording')} ({'simulated' if found.synthetic else 'measured'})",
        rows=tuple(_values(found)),
        curves=(),
        state=worst(findings),
        leading=(*base.leading, *_effects(found)),
        findings=findings,
        notes=(*(note for note in found.notes if note not in found.doubts), *single),
        tables=tables,
        figures=figures,
    )


def _values(found: Characterisation) -> Iterator[ShownValue]:
    """Yield speeds, strokes, friction and offset with U (k = 2), and flags of each level."""
    seen = {way for level in found.levels for way in level.sides}
    ways = {way: sign for way, sign in ((1, "+x"), (-1, "-x")) if way in seen}
    for count, level in ((len(result.levels), level) for result in found.results for level in result.levels):
        label = level.recording if count == 1 else f"{level.recording}#{level.index + 1}"
        for way, sign in ways.items():
            speed = abs(level.sides[way]["velocity_m_s"]) if way in level.sides else math.nan
            yield ShownValue(f"{label}.speed{sign}", label, f"speed {sign}", speed, "m/s")
        used = sum(side["strokes"] for side in level.sides.values())
        yield ShownValue(f"{label}.strokes", label, "strokes", f"{used} of {len(level.table.rows)}")
        values = {"friction": (level.friction_n, level.expanded_n)}
        values |= {"offset": (level.offset_n, COVERAGE_FACTOR * level.u_offset_n)}
        for name, (value, u) in values.items():
            yield ShownValue(f"{label}.{name}", label, name, value, "N", (value - u, value + u))
        raised = dict.fromkeys(flag for row in level.rows for flag in row["flags"].split(",") if flag)
        yield ShownValue(f"{label}.flags", label, "flags", " ".join(raised))


def _effects(found: Characterisation) -> Iterator[ShownValue]:
    """Yield the largest effect of pressure on friction, the spread of runs, and the largest zero error of force."""
    if found.pressure_lines:
        line = max(found.pressure_lines, key=lambda line: abs(line.slope_n_pa))
        name = f"friction per pressure ({line.seal})"
        yield ShownValue("slope", line.seal, name, line.slope_n_pa, "N/Pa", line.slope_interval_n_pa)
    if found.run_spread is not None:
        percent = f"{100 * found.run_spread.relative:.0f} %"
        yield ShownValue("spread", "runs", "standard deviation between runs", percent)
    known = [fit for fit in found.closures if fit.has_interval or fit.degrees_of_freedom <= 0]
    if known:
        fit = max(known, key=lambda fit: abs(fit.force_zero_n.value))
        zero = fit.force_zero_n
        interval = (zero.low, zero.high) if fit.has_interval else None
        yield ShownValue("zero", fit.group, f"force zero ({fit.group})", zero.value, "N", interval)


def _loops(topic: Topic, found: Characterisation) -> Iterator[ShownFigure]:
    """Yield the force balance over position: one figure for each seal, with a panel for each level.

    A panel has both directions, half their difference and half their sum, and thin lines for single strokes.
    """
    groups = page.by_seal(found)
    for seal, results in groups.items():
        levels = [level for result in results for level in result.levels]
        shown = page.spread_evenly(levels, max(page.MOST_SHOWN // len(groups), 2 * COLUMNS))
        some = topic.say("some", shown=len(shown), all=len(levels)) if len(shown) < len(levels) else ""
        panels = []
        for level in shown:
            x, p = level.profile.position_m, level.profile
            strokes = (page.spread_evenly(own, MOST_STROKES) for own in (p.up_strokes_n, p.down_strokes_n))
            marks = [
                Rule(level.window_m),
                *(Line(x, values, look=THIN, width=0.3) for values in chain.from_iterable(strokes)),
                Rule(y=0.0),
                Line(x, p.up_n, "towards +x", Look("blue")),
                Line(x, p.down_n, "towards −x", Look("blue", "--")),
                Line(x, p.friction_n, "friction (half difference)", figures.MEASURED, 1.8),
                Line(x, p.offset_n, "offset (half sum)", Look("orange", ":"), 1.8),
            ]
            pressure, speed = fixed(page.gauge_bar(level), 1), 1e3 * level.speed_m_s
            panels.append(Panel(marks, f"{fill(level.recording, NAME_LETTERS)}\n{pressure} bar, {speed:.3g} mm/s"))
        name = re.sub(r"[^A-Za-z0-9]+", "-", seal).strip("-").lower() or "seal"
        figure = topic.figure("loops", figure_of("friction-loops", panels), seal=seal, some=some)
        yield replace(figure, name=f"loops-{name}")


MOST_JOINED = 12  # points beyond which residuals are not joined by lines


def _is_one_chamber(fits: Sequence[ClosureFit]) -> bool:
    return all(len(fit.areas_m2) == 1 and NET not in fit.areas_m2 for fit in fits)


def closures(fits: Sequence[ClosureFit]) -> Figure:
    """Draw the half sum of forces of each group over pressure, or over its fitted value if both pressures changed.

    Residuals are in a panel below. A line with as many parameters as points has no residuals.
    """
    above, below, one_chamber = [], [], _is_one_chamber(fits)
    for index, fit in enumerate(sorted(fits, key=lambda fit: fit.group)):
        own, x, force = look(index), fit.half_sum_force_n - fit.residual_n, fit.half_sum_force_n
        if one_chamber:
            (side, area), *_ = fit.nominal_m2.items()  # of the one chamber whose pressure changed
            x, force = fit.pressure_pa, force - (-area if side == "a" else area) * fit.pressure_pa
        x, force, rest = np.array([x, force, fit.residual_n])[:, np.argsort(x, kind="stable")]
        above += [Markers(x, force, fit.group, own), Line(x, force - rest, look=own, width=0.8)]
        if fit.degrees_of_freedom > 0:
            below.append(Markers(x, rest, look=own, joined=x.size <= MOST_JOINED))
    y = "half sum −\nnominal area × pressure / N" if one_chamber else "half sum of forces / N"
    panels = [Panel(above, y=y, legend="panel")]
    panels += [Panel([Rule(y=0.0), *below], y="residual / N")] if below else []
    x_axis = "gauge pressure / bar" if one_chamber else "half sum as fitted / N"
    height, heights = (4.0, (2, 1)) if below else (2.8, ())
    return stack(panels, height, heights, x_axis)


def _areas(fits: Sequence[ClosureFit]) -> Iterator[tuple]:
    for fit in fits[: page.MOST_SHOWN]:
        for side, area in fit.areas_m2.items():
            nominal = fit.nominal_m2[side]
            off, low, high = (100 * (v / nominal - 1) for v in (area.value, area.low, area.high))
            between = f"{low:+.2f} … {high:+.2f}" if fit.has_interval else "not determined"
            zero = fit.force_zero_n
            ends = f" ({zero.low:+.2f} … {zero.high:+.2f})" if np.isfinite(zero.low) else ""
            sizes = nominal * 1e4, area.value * 1e4, off, between
            yield fit.group, side, *sizes, f"{zero.value:+.2f}{ends}", len(fit.recordings)


#: Whether a run was repeated -> meaning of the band.
BAND = {True: "a further run", False: "a further recording of the same run"}


def plot_pressure(found: Characterisation, path: str | Path) -> DrawnFigure:
    """Draw friction against pressure with prediction bands, and write it.

    Parameters
    ----------
    found : Characterisation
        From ``characterise_recordings``, with recordings at two or more pressures.
    path : path-like
        Picture to write: .png, .svg or .pdf.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    """
    return draw_figure(over_pressure(found), path)


def over_pressure(found: Characterisation) -> Figure:
    """Draw a panel for each line of friction over pressure, and one for each seal without a line, on shared axes."""
    panels: list[tuple[str, pl.DataFrame, PressureLine | None]]
    panels = [(line.seal, line.table, line) for line in found.pressure_lines]
    with_line = {seal for _, points, _ in panels for seal in points["seal"]}
    rest = found.table.filter(~pl.col("seal").is_in(with_line)).partition_by("seal", maintain_order=True)
    shown = page.spread_evenly([*panels, *((points["seal"][0], points, None) for points in rest)], MOST_PANELS)
    every = pl.concat([points for _, points, _ in shown])
    highest = (every["friction_n"] + every["expanded_n"].fill_nan(0.0)).max()
    bands = [line.band_high_n.max() for *_, line in shown if line is not None]
    y = Axis("friction / N", low=0.0, high=min(1.05 * max([highest, *bands]), 2 * highest))
    runs = sorted(set(every["run"]))  # a run keeps its marker in all panels
    drawn = [pressure_panel(points, line, runs, title) for title, points, line in shown]
    return figure_of("pressure", drawn, y=y, width_in=7.1 if len(shown) > 1 else 4.5)


def pressure_panel(points: pl.DataFrame, line: PressureLine | None, runs: Sequence[str], title: str = "") -> Panel:
    """Draw the points of each run, and the fitted line with its band."""
    marks: list[Band | Line | Markers] = []
    if line is not None:
        x, label = line.band_pressure_pa, f"95 % for {BAND[line.basis != 'unknown']}"
        marks += [Band(x, line.band_low_n, line.band_high_n, label), Line(x, line.band_mean_n, "line", width=0.9)]
    own = sorted(set(points["run"]))
    for run in own:
        x, y, reach = points.filter(run=run).select("pressure_pa", "friction_n", "expanded_n").to_numpy().T
        index = runs.index(run) if len(own) > 1 else 0
        label = f"run {run}, with U (k = 2)" if len(own) > 1 else "recording with U (k = 2)"
        marks.append(Markers(x, y, label, look(index), y - reach, y + reach, filled=not index))
    return Panel(marks, title)


# --- Stick-slip of strokes.

SHOWN_S = 10.0
MOST_SLIPS, MOST_COLUMNS = 24, 3


def stick_slip(topic: Topic, found: Characterisation) -> Blocks:
    """Show stick-slip of strokes over time and in the phase plane, or the shortest period that would be visible."""
    every = [(r, level, s) for r in found.results for level in r.levels for s in level.stick_slip]
    slipping = [item for item in every if item[2].found and "stick_slip" in item[1].flags]
    if not every or (found.synthetic and not slipping):
        return
    strokes = page.plural(len(every), "stroke")
    if not slipping:
        text = topic.say("nothing", strokes=strokes, finest=np.median([s.resolution_s for *_, s in every]))
        if stuck := [100 * s.stuck_share for *_, s in every if s.found]:
            text += topic.say("jumps", strokes=page.plural(len(stuck), "stroke"), percent=max(stuck))
        yield Paragraph(text)
        return
    motions = []
    for result, level, s in slipping[:MOST_COLUMNS]:
        part = slice(*np.searchsorted(result.recording.time_s, (s.start_s, s.stop_s)))
        time, position = result.recording.time_s[part], s.direction * result.recording.position_m[part]
        window = max(int(s.resolution_s / 2 / max(np.median(np.diff(time)), 1e-12)) // 2, 1)
        speed = local_slope(time, position, window)
        motions.append((level.recording, time - time[0], position, speed, s.mean_speed_m_s))
    over_time, phases = motion_figures(motions)
    rows = [
        {"level": level, "stroke": s, "ratio": s.peak_speed_m_s / s.mean_speed_m_s if s.mean_speed_m_s > 0 else None}
        for _, level, s in slipping[:MOST_SLIPS]
    ]
    yield topic.text(some=len(slipping), strokes=strokes)
    yield topic.table(rows)
    yield topic.figure("stick-slip-recordings", over_time)
    yield topic.figure("stick-slip-recordings-phase", phases)


def motion_figures(motions: Sequence[tuple[str, Array, Array, Array, float]]) -> tuple[Figure, Figure]:
    """Draw motions over time and in the phase plane (speed over position without its trend), one column per motion.

    Parameters
    ----------
    motions : sequence of tuple
        Title, time from zero, position, speed and mean speed of each motion, in SI.
    """
    speeds, positions, phases = [], [], []
    for title, time, position, speed, mean_m_s in motions:
        part, trend = time <= SHOWN_S, np.polynomial.Polynomial.fit(time, position, 1)(time)
        mean = Rule(y=mean_m_s, label=f"mean {1e3 * mean_m_s:.2f} mm/s", look=figures.MODEL, width=1.0)
        above = [Line(time[part], speed[part], width=0.8), mean]
        speeds.append(Panel(above, title, y=Axis("speed / (mm/s)", above=0.2)))
        positions.append(Panel([Line(time[part], position[part], width=1.0)], y="position / mm"))
        phases.append(Panel([Line(position - trend, speed, width=0.5), replace(mean, label="")], title))
    over_time = figure_of("motions", [*speeds, *positions], columns=len(motions))
    return over_time, figure_of("phase-planes", phases, columns=len(motions))


# --- The report.


def recordings_report(found: Characterisation, fits: Fits, curves: CampaignCharacteristics | None = None) -> Report:
    """Return the report: the view, and sections on measurement, raw record, budget, curves over speed, and provenance.

    The parameters are those of `write_report`.
    """
    parts = page.sections_of("recordings", {"measured": measured, "record": record, "budget": budget}, found)
    parts += page.sections_of("recordings", {"recovered": recovered_part}, found, synthetic=True)
    parts += page.sections_of("recordings", {"stick-slip-of-strokes": stick_slip}, found)
    over_speed = [] if curves is None else page.sections_of("campaign", CURVES, curves)
    parts += [replace(part, key=f"{part.key}-over-speed") for part in over_speed]
    parts += page.sections_of("recordings", {"provenance": provenance}, found, synthetic=False)
    title = "Friction of simulated recordings" if found.synthetic else "Friction of a pneumatic piston from recordings"
    view = replace(characterisation_view(found, fits), title=title)
    return page.view_report(view, *parts, synthetic=found.synthetic)


def write_report(
    found: Characterisation, fits: Fits | FrictionFit, folder: str | Path, curves: CampaignCharacteristics | None = None
) -> Path:
    """Write report.html, which loads no other files, and its figures as PNG and SVG.

    Parameters
    ----------
    found : Characterisation
        Result of real or simulated recordings.
    fits : mapping or FrictionFit
        Group -> law -> FrictionFit (may be empty), or one fit of all recordings.
    folder : path-like
        An existing folder; figures go into its subfolder ``figures``.
    curves : CampaignCharacteristics, optional
        Curves, effects and statements of the recordings, from ``recorded_characteristics``.

    Returns
    -------
    pathlib.Path
        Path of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    laws = {ALL_RECORDINGS: {fits.law: fits}} if isinstance(fits, FrictionFit) else fits
    return recordings_report(found, laws, curves).write(folder)


def provenance(topic: Topic, found: Characterisation) -> Blocks:
    """Show the software, the sources of the methods, and whether the data are real."""
    yield topic.text("synthetic" if found.synthetic else "real")
    yield topic.table([*page.software(), ("protocol of the characterisation", found.protocol)])
    yield from topic.listed(page.references(topic.texts["cites"]), "sources")


def measured(topic: Topic, found: Characterisation) -> Blocks:
    """Show rig, sensors and files."""
    first, uses = found.recordings[0], found.stroke_uses.values()
    yield topic.text(
        recordings=page.plural(len(found.results), "recording"),
        seals=page.plural(len(page.by_seal(found)), "seal"),
        used=sum(use.used for use in uses),
        strokes=sum(use.recorded for use in uses),
    )
    # Cylinder, piston, force sensor, and the servo axis or hand, with the signs.
    states = {}
    for side in "ab":
        stated = "stated" if np.ptp(getattr(first, f"pressure_{side}_pa")) == 0 else "measured"
        states[side] = "open to ambient" if is_open(first, side) else f"p_{side} {stated}"
    incline = first.incline_rad
    rig = page.sketch("recording", ["inclined"] if incline else [], **states, incline=np.degrees(incline))
    yield topic.figure("rig", rig, area_a=first.area_a_m2 * 1e4, area_b=first.area_b_m2 * 1e4)
    yield Topic("recordings", "recording").table(_sensors(found.recordings), "sensors")
    files = []
    for r in (result.recording for result in found.results):
        where = "/".join(r.source.resolve().parts[-2:]) if r.source else "simulated" if r.synthetic else "from Python"
        labels = (group_of(r.labels), r.labels.get("run", ""), r.sha256[:16] if r.sha256 else None)
        use, lasts_s = found.stroke_uses[r.name], r.time_s[-1] - r.time_s[0]
        diameter = np.sqrt(4 * max(r.area_a_m2, r.area_b_m2) / np.pi) * 1e3
        files.append((where, *labels, len(r), use.recorded, use.used, use.why or None, lasts_s, diameter))
    yield topic.table(files, "files")
    yield from topic.listed(topic.say("left_out", name=name, why=why) for name, why in found.skipped)


def _sensors(recordings: tuple[Recording, ...]) -> Iterator[tuple]:
    """Yield the range of each channel over all recordings, and its stated accuracy."""
    for channel, (name, factor, unit) in Topic("recordings", "recording").texts["channels"].items():
        values = [getattr(r, channel) for r in recordings]
        if channel.startswith("pressure"):
            if all(is_open(r, channel[9]) for r in recordings):
                yield name, "open to ambient: not measured", None, None
                continue
            values = [v - r.ambient_pressure_pa for v, r in zip(values, recordings, strict=True)]
        stated = [r.accuracy[channel] * factor for r in recordings if channel in r.accuracy]
        unstated = "not stated" if channel == "position_m" else "not stated: assumed (see the budget)"
        accuracy = f"{max(stated):.3g} {unit.split()[0]}" if stated else unstated
        notes = {r.calibration[channel] for r in recordings if channel in r.calibration}
        if notes and (stated or channel != "position_m"):
            accuracy += f" ({'; '.join(sorted(notes))})"
        low, high = min(v.min() for v in values) * factor, max(v.max() for v in values) * factor
        yield name, f"{unit}; standard uncertainty {accuracy}", low, high
    rates = [(len(r) - 1) / (r.time_s[-1] - r.time_s[0]) for r in recordings]
    yield "sampling", "samples per second, mean of each recording", min(rates), max(rates)


def record(topic: Topic, found: Characterisation) -> Blocks:
    """Show all channels over time, for one recording of each seal."""
    yield topic.text()
    for index, group in enumerate(list(page.by_seal(found).values())[:MOST_PANELS], 1):
        shown = group[len(group) // 2]
        caption = topic.say("caption", name=shown.recording.name, bar=page.gauge_bar(shown.levels[0]))
        yield ShownFigure(f"record-{index}", caption, record_figure(shown.recording, shown.strokes))


def budget(topic: Topic, found: Characterisation) -> Blocks:
    """Show the uncertainty budget of the speed levels with the smallest and the largest uncertainty."""
    levels = sorted(found.levels, key=lambda level: level.expanded_n)
    assumed = ", ".join(sorted({e.source for level in levels for e in level.budget if e.basis == "assumed"}))
    yield topic.text()
    for level in [levels[0], *levels[1:][-1:]]:
        chance = np.nan_to_num(level.stderr_n)
        rows: list[tuple] = [("spread between strokes", "data", "A", "", chance, None)]
        for e in sorted(level.budget, key=lambda e: -e.friction_n):
            factor, unit = readable(e.unit)
            size = f"{plain(e.standard_uncertainty / factor)} {unit}".strip()
            size += f"; {e.note}" if e.note else ""
            rows.append((e.source, e.basis, e.kind, size, e.friction_n, e.offset_n))
        rows.append(("combined, u", "", "", "", np.hypot(chance, level.u_systematic_n), level.u_offset_n))
        rows.append(("expanded, U (k = 2)", "", "", "", level.expanded_n, 2 * level.u_offset_n))
        yield topic.table(rows, recording=level.recording, speed_mm_s=1e3 * level.speed_m_s)
    if assumed:
        yield topic.text("assumed", "note", sources=assumed)
