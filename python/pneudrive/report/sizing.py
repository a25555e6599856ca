"""View of a sizing, and its page with the values of the best choice, the task, and the commands that repeat it."""

from __future__ import annotations

import math
import platform
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from pneudrive import __version__
from pneudrive.constants import ANR_LITRES_PER_KG
from pneudrive.describe.files import toml
from pneudrive.describe.system import values_of
from pneudrive.figures import THIN, Figure, Line, Look, Markers, Panel, Rule
from pneudrive.files.writing import make_subfolder
from pneudrive.report import page
from pneudrive.report.circuit.svg import circuit_figure
from pneudrive.report.page import Paragraph, Report, Topic, figure_of, references, sections_of, sketch, view_section
from pneudrive.report.render import DrawnFigure, draw_figure
from pneudrive.sizing.checks import READ, SizedDrive, read
from pneudrive.sizing.result import WRITTEN, SizingResult, in_words, maker_type, yearly
from pneudrive.sizing.result import values_of as drive_values
from pneudrive.sizing.search import MOST, is_of_command
from pneudrive.sizing.task import GUIDES, WITHOUT, follows_from
from pneudrive.sizing.task import values_of as task_values
from pneudrive.views import Finding, ShownTable, ShownValue, View

#: Quantities without a limit in the table of ranges: label, name of the value, factor from SI, unit.
FREE = (
    ("end speed, the worse stroke", "end_speed", 1.0, "m/s"),
    ("peak pressure", "peak_pressure", 1e-5, "bar abs"),
    ("air of a cycle", "air", ANR_LITRES_PER_KG, "l ANR"),
    ("load ratio out", "load_ratio_out", 100.0, "%"),
    ("load ratio back", "load_ratio_back", 100.0, "%"),
)
#: Folder of the sheet, next to the report.
SHEET = "sheet"
_KEY = re.compile(r"\[([\w-]+)\]")


def sizing_view(found: SizingResult) -> View:
    """Return the view of a sizing: answer, open checks with remedies, candidates with limits, plot of time over air."""
    topic, cheaper = Topic("sizing", "candidates"), found.cheaper[:WRITTEN]
    best = {found.ranked.index(drive) + 1: drive for drive in found.by_cylinder}
    rows = ((f"{k:02d}.toml", d.part_names, d.needles, ", ".join(d.open_names) or "none") for k, d in best.items())
    is_open = found.feasible or (found.miss is None and found.provisional)
    tables = (
        topic.table(rows, "ranking"),
        _ranges(best or dict(enumerate(cheaper, 1)), Topic("sizing", "limits").say("table")),
        topic.table(cheaper, "missed", which=topic.say("cheaper" if best else "nearest")),
    )
    values = ((rank, drive_values(drive, row)) for row, (rank, drive) in enumerate(best.items(), 1))
    return View(
        found.answer,
        [replace(value, label=str(rank)) for rank, own in values for value in own],
        state="good" if found.ready else "open" if is_open else "bad",
        leading=tuple(_leading(found)),
        findings=found.findings,
        notes=found.remarks,
        tables=[table for table in tables if table.rows],
        figures=(topic.figure("candidates", candidate_figure(found)),) if found.simulated else (),
    )


def _leading(found: SizingResult) -> Iterator[ShownValue]:
    """Yield the values of the best choice that have limits, and its air consumption."""
    task, best = found.task, found.best
    if best is None:
        return
    limits = {"time out": task.outward_s, "time back": task.back_s, "impact": best.worst["energy out"][1]}
    values = {value.quantity: replace(value, label="best") for value in drive_values(best, 1)}
    yield from (replace(values[name], limit=limit) for name, limit in limits.items())
    yield values["air of a cycle, l ANR"]
    yield ShownValue("rank 1.margin", "best", "margin", 100.0 * best.margin, "%")


def _ranges(numbered: Mapping[int, SizedDrive], caption: str) -> ShownTable:
    """Return a table with the range of 98 % of the samples, limit and margin for each choice and quantity."""
    shown = list(numbered.values())
    names = dict.fromkeys(name for drive in shown for name in drive.worst)
    rows = []
    for name in names:
        limits = {read(*drive.worst[name][1:]) for drive in shown if name in drive.worst}
        common = limits.pop() if len(limits) == 1 else ""  # others stand in the cells
        cells = []
        for drive in shown:
            if name not in drive.worst:
                cells.append("–")
                continue
            value, limit, unit = drive.worst[name]
            ends = _ends(drive, name, READ.get(unit, (1.0,))[0]) or read(value, unit)
            of = "" if common else f" of {read(limit, unit)}"
            cells.append(f"{ends}{of} ({100.0 * drive.margins[name]:.0f}\u00a0%)")
        rows.append((f"{name}, limit {common}" if common else name, *cells))
    for words, name, factor, unit in FREE:
        ends = [_ends(drive, name, factor) for drive in shown]
        if words not in names and any(ends):
            rows.append((f"{words}, {unit}", *ends))
    return ShownTable(caption, ("", *(f"{k} {maker_type(d.parts['cylinder'])}" for k, d in numbered.items())), rows)


def _ends(drive: SizedDrive, name: str, factor: float) -> str:
    """Return the range of 98 % of the samples as text. The text is empty for a folder of an earlier version."""
    if name not in drive.intervals:
        return ""
    low, high = (f"{factor * end:.3g}" if end < math.inf else "no end" for end in drive.intervals[name])
    return f"{low} … {high}"


def plot_sizing(result: SizingResult, path: str | Path | None = None) -> DrawnFigure:
    """Draw stroke time (99 % quantile) over air per cycle: a point for each choice, and the limits.

    Lines at the best candidate show the range of 98 % of its samples.

    Parameters
    ----------
    result : SizingResult
        From `pneudrive.size`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    CommandError
        If the suffix is unknown, or the file cannot be written.
    """
    return draw_figure(candidate_figure(result), path, synthetic=True)


def candidate_figure(result: SizingResult) -> Figure:
    """Draw a panel for each stroke."""
    task, best, panels = result.task, result.best, []
    names = {drive.name for drive in result.ranked}
    rest = [drive for drive in result.simulated if drive.name not in names]
    groups = (
        ([drive for drive in rest if not drive.is_feasible], Look("grey", "-", "x"), "misses a limit"),
        ([drive for drive in rest if drive.is_feasible], THIN, "not simulated to the end"),
        (result.ranked, Look("blue"), "meets the task"),
    )
    for way, limit in (("out", task.outward_s), ("back", task.back_s)):
        marks: list[Markers | Line | Rule] = []
        if best is not None:
            air, time, own = best.air_litres_anr, getattr(best, f"time_{way}"), Look("orange")
            marks.append(Markers([air], [time], "best", own, size=9.0))
            if best.intervals:  # the range of 98 % of the samples
                across = [ANR_LITRES_PER_KG * end for end in best.intervals["air"]]
                marks.append(Line(across, [time, time], look=own, width=1.2))
                marks.append(Line([air, air], [best.intervals[f"time_{way}"][0], time], look=own, width=1.2))
        for chosen, own, label in groups:
            shown = [(drive.air_litres_anr, t) for drive in chosen if (t := getattr(drive, f"time_{way}")) < math.inf]
            if shown:
                air, times = zip(*shown, strict=True)
                marks.append(Markers(air, times, label, own, filled=True))
        marks.append(Rule(y=limit * (1.0 - task.margin), label="longest time", look=Look("black", "--"), width=1.1))
        panels.append(Panel(marks, f"stroke {way}", y=f"time {way}, worst 1 % / s"))
    return figure_of("candidates", panels)


def write_sizing_report(found: SizingResult, folder: str | Path) -> Path:
    """Write report.html, which loads no other files, its figures, and the sheet of the best choice.

    Parameters
    ----------
    found : SizingResult
        From `pneudrive.size`.
    folder : path-like
        An existing folder.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    topic, view = Topic("sizing", "candidates"), found.view()
    notes = (topic.say(), Topic("sizing", "limits").say())
    shown = replace(view, title=topic.say("title"), leading=(), findings=(), notes=notes)
    about = {"best": _best, "values": _values, "task": _task, "again": _method}
    parts = [view_section("candidates", shown), *sections_of("sizing", about, found, synthetic=False)]
    verdict = [Finding(view.title, view.state), *view.findings, *map(Finding, view.notes)]
    lines = [replace(line, text=f"{line.text[:1].upper()}{line.text[1:]}") for line in verdict]
    if found.best is not None:
        parts.append(Topic("sizing", "sources").section(Paragraph(_cited(found)), synthetic=False))
        topic, sheet, into = Topic("sizing", "sheet"), sizing_sheet(found), Path(folder) / SHEET
        given = "; ".join(f"{value.key} {value.value}" for value in task_values(found.task) if value.kind == "given")
        note = topic.text(version=__version__, sources="; ".join(_cited(found)) or "none")
        blocks = (Paragraph(given), *sheet.figures, *sheet.tables, Paragraph(sheet.notes), note)
        answer = Finding(found.answer, sheet.state)
        make_subfolder(into)
        Report(sheet.title, [answer, *sheet.findings], [topic.section(*blocks)], synthetic=True).write(into)
    return Report(f"{found.task.name}: sizing, simulated", lines, parts, synthetic=True).write(folder)


# --- The sheet of the best choice: one page to send.


def sizing_sheet(found: SizingResult) -> View:
    """Return the sheet of the best choice: sketch, order list, open checks, and its ranges against the limits."""
    topic, task, best = Topic("sizing", "sheet"), found.task, found.ranked[0]
    stroke = f"{1e3 * task.stroke_m:.4g} mm"
    number = {"cylinder": f"1, stroke {stroke}", "tube": f"{2.0 * task.tube_length_m:.3g} m", "flow_control": "2"}
    parts = {slot: name for slot, name in best.parts.items() if name not in (WITHOUT, "*")}
    order = [(number.get(slot, "1"), slot.replace("_", " "), maker_type(name), name) for slot, name in parts.items()]
    hanging = [("missing", math.ceil(check.value)) for check in found.open_checks if "hangs" in check.name]
    clamps = hanging or ([] if task.clamp_force_n is None else [("clamp", task.clamp_force_n)])
    order += [("1", slot, f"rod clamp, {force:g} N or more", "–") for slot, force in clamps]
    # Load, cylinder with bore and stroke, tubes, valve and supply, with their types.
    drawing = sketch(
        "choice",
        ["hanging"] if hanging else [],
        mass=task.mass_kg,
        stroke=stroke,
        bore=1e3 * best.sizes[0],
        tube_m=task.tube_length_m,
        gauge=1e-5 * (task.supply_pa - task.ambient.pressure_pa),
        incline=math.degrees(task.incline_rad),
        **{slot: maker_type(best.parts[slot]) for slot in ("cylinder", "tube", "valve")},
    )
    return View(
        f"{task.name}: {in_words(best.parts)}",
        state="good" if found.ready else "open",
        leading=tuple(_leading(found)),
        findings=tuple(check.finding for check in found.open_checks),
        notes=(*yearly(found), f"{best.needles}.", topic.say("ports")),
        tables=(topic.table(order, "order"), _ranges({1: best}, topic.say("ranges"))),
        figures=(topic.figure("sketch", drawing),),
    )


def _best(topic: Topic, found: SizingResult) -> page.Blocks:
    best = found.best
    if best is not None:
        parts = [f"{slot.replace('_', ' ')}: {name}" for slot, name in best.parts.items()]
        yield Paragraph((*parts, best.needles))
        yield topic.figure("circuit", circuit_figure(found.circuit()), parts=best.part_names)


def _values(topic: Topic, found: SizingResult) -> page.Blocks:
    """Show the values of the best choice with their sources."""
    if found.best is None:
        return
    circuit = found.circuit()
    words, values = {"given": "the task, or the choice of parts", "default": "default"}, []
    for value in (value for value in values_of(circuit) if not value.key.endswith(".kind")):
        is_whole = value.kind == "source" or value.origin.startswith("assumed")
        origin = words.get(value.kind, value.origin if is_whole else f"{value.kind}: {value.origin}")
        values.append((value.key.removeprefix("components."), str(value.value), origin))
    named = tuple(f"{key} = " for key, *_ in values)
    yield topic.table(values)
    yield Paragraph(tuple(line for line in circuit.assumed() if not line.startswith(named)))


def _task(topic: Topic, found: SizingResult) -> page.Blocks:
    guide = found.task.guide
    follows = [f"{what}: {value:.4g} {unit}" for what, value, unit in follows_from(found.task)]
    follows += [topic.say("guide", name=guide, friction=GUIDES[guide])] if GUIDES[guide] else []
    yield topic.table(task_values(found.task))
    yield Paragraph(follows)


def _method(topic: Topic, found: SizingResult) -> page.Blocks:
    asked = found.asked
    options = ", ".join(f"{name}={count}" for name, count in asked.items())
    lines = [f'import pneudrive as pn\n\nfound = pn.size("task.toml", {options})\nfound.report("out")']
    if is_of_command(asked):
        options = f"--samples {asked['draws']}"
        options += f" --max-candidates {asked['most']}" if asked["most"] != MOST else ""
        lines.insert(0, f"pneudrive size task.toml {options} --out out")
    yield Paragraph((found.extent, topic.say("moments"), topic.say("stroke")))
    yield topic.text(version=__version__, python=platform.python_version())
    yield from (Paragraph(line, "code") for line in (*lines, toml.write(found.task.to_dict()).strip()))


def _cited(found: SizingResult) -> tuple[str, ...]:
    """Return the literature references for the values of the best choice."""
    return references(dict.fromkeys(key for one in values_of(found.circuit()) for key in _KEY.findall(one.origin)))
