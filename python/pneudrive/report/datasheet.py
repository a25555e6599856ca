"""The data sheet of a drive as one HTML page, or as a PDF of two to four pages, and pictures of characteristics."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import __version__
from pneudrive.arrays import evenly
from pneudrive.datasheet.characteristic import results_of, value_rows
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.datasheet.registry import characteristics
from pneudrive.datasheet.sheet import Datasheet, energy_limit_j, in_words, shown_unit, written_value
from pneudrive.errors import CommandError
from pneudrive.figures import MODEL, Axis, Band, Bars, Figure, Line, Markers, Panel, label_of, look
from pneudrive.numbers import plain
from pneudrive.report.circuit.svg import circuit_figure
from pneudrive.report.page import Paragraph, Report, Topic, figure_of, references, view_section, write_pdf
from pneudrive.report.render import DrawnFigure, draw_figure
from pneudrive.report.validation import channel_figure, friction_figure
from pneudrive.simulation.trajectory import check_target, write_whole
from pneudrive.validate.validation import run_columns
from pneudrive.views import MOST_LEADING, ShownFigure, ShownTable, ShownValue, View, worst

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import xarray as xr

    from pneudrive.datasheet.measured import MeasuredBeside

SUFFIXES = (".html", ".pdf")
MOST_CURVES, MOST_BARS, MOST_VALUES = 5, 12, 24  # of one result in a table
LOGARITHMIC = 30.0  # ratio of frequencies from which on their axis is logarithmic
#: Text in the SVG of the circuit drawing, and its replacement, which makes the drawing smaller than the page.
SMALL_CIRCUIT = ("<svg ", '<svg style="max-width: 26rem; display: block" ')


def plot_characteristic(found: xr.Dataset, path: str | Path | None = None) -> DrawnFigure:
    """Draw a characteristic.

    Parameters
    ----------
    found : xarray.Dataset
        Result of `pneudrive.drive_characteristic`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    CommandError
        The characteristic has no curve, the suffix is unknown, or the file cannot be written.
    """
    kind = characteristics()[found.attrs["characteristic"]]
    if not kind.x:
        remedy = "This result is not drawn; its numbers are in the data set."
        raise CommandError(f"{kind.name} has no curve", remedy=remedy)
    (shown,) = characteristic_view(found).figures
    return draw_figure(shown.figure, path, synthetic=True)


def characteristic_view(found: xr.Dataset) -> View:
    """Return the view of a characteristic: its results, definition and standard. Single numbers come first."""
    rows = []
    for name, at, value, low, high in value_rows(found, written_value):
        if found[name].size <= MOST_VALUES:
            written = written_value(value, found[name].attrs["units"], low, high)
            rows.append((in_words(name), at, written, found[name].attrs["long_name"]))
    kind, results = characteristics()[found.attrs["characteristic"]], results_of(found)
    long = [in_words(name) for name in results if found[name].size > MOST_VALUES]
    notes = [found.attrs["definition"], f"Standard: {found.attrs['standard']}"]
    notes += [f"More than {MOST_VALUES} values each, in --out FILE.csv: {', '.join(long)}"] if long else []
    single = (name for name in results if not found[name].ndim)
    values = [ShownValue(n, "", in_words(n), float(found[n]), found[n].attrs["units"]) for n in single]
    panels = characteristic_panels(found) if kind.x else []
    return View(
        found.attrs["title"],
        leading=values[:MOST_LEADING],
        notes=(*notes, f"Interval: {found.attrs.get('interval', 'not requested')}"),
        tables=(ShownTable("", ("result", "at", "value", "meaning"), rows),),
        figures=(ShownFigure(kind.name, f"{kind.title}.", figure_of("characteristic", panels)),) if panels else (),
    )


def characteristic_panels(found: xr.Dataset, title: str = "") -> list[Panel]:
    """Return a panel for each result in the figure of a characteristic."""
    kind, title = characteristics()[found.attrs["characteristic"]], title or found.attrs["title"]
    x, parts, panels = kind.x, kind.y.split(), []
    for name in parts:
        # Of several panels, the last word of each name distinguishes them.
        own = f"{title}, {name.rpartition('_')[2]}" if len(parts) > 1 else title
        if found[x].dtype.kind in "US":  # one bar for each entry, the largest on top
            values = shown_unit(found[name].attrs["units"])[0] * np.asarray(found[name])
            order = np.argsort(values)
            if len(order) > MOST_BARS:
                order = [k for k in order if k in np.argsort(-np.abs(values))[:MOST_BARS]]
            bars = Bars(np.arange(len(order)), values[order], thickness=0.6, across=True)
            labels = [str(found[x].values[k]) for k in order]
            panels.append(Panel([bars], own, _axis(found, name), Axis(names=labels)))
            continue
        is_wide = found[x].attrs["units"] == "Hz" and found[x].max() > LOGARITHMIC * found[x].min() > 0.0
        x_axis = _axis(found, x, "log" if is_wide else "linear")
        panels.append(Panel(list(_curves(found, x, name)), own, x_axis, _axis(found, name)))
    return panels


def _axis(found: xr.Dataset, name: str, scale: str = "linear") -> Axis:
    unit, words = shown_unit(found[name].attrs["units"])[1], in_words(name)
    return Axis(label_of(words, unit), scale, is_si=False)


def _curves(found: xr.Dataset, x: str, name: str) -> Iterator[Line | Band]:
    """Yield a line for each curve of a result in displayed units, and the band of its interval."""
    along = found[x].dims[-1]
    (other,) = [str(dim) for dim in found[name].dims if dim != along] or [""]
    factor, by = (shown_unit(found[of].attrs["units"])[0] for of in (name, x))
    for index, k in enumerate(evenly(found.sizes.get(other, 1), MOST_CURVES)):
        at = {other: k} if other else {}
        abscissa = by * np.asarray(found[x].isel(at, missing_dims="ignore"))
        label = found[other].values[k] if other else ""
        if not isinstance(label, str):  # only the first label names the quantity
            size, unit = shown_unit(found[other].attrs["units"])
            label = f"{size * float(label):.3g}{'' if unit == '1' else f' {unit}'}"
            label = label if index else f"{in_words(other)} {label}"
        yield Line(abscissa, factor * np.asarray(found[name].isel(at)), label, look(index))
        if f"{name}_low" in found:
            low, high = (factor * np.asarray(found[f"{name}_{end}"].isel(at)) for end in ("low", "high"))
            yield Band(abscissa, low, high, look=look(index))


# --- data sheet ------------------------------------------------------------------------------------------------------


def write_datasheet(found: Datasheet, path: str | Path) -> Path:
    """Write a datasheet.

    Parameters
    ----------
    found : Datasheet
        From `pneudrive.datasheet.sheet.build`.
    path : path-like
        .html, which loads no other files, or .pdf (extra ``pdf``).

    Returns
    -------
    pathlib.Path

    Raises
    ------
    CommandError
        The suffix is unknown, the file cannot be written, or typst is not installed.
    """
    target, view = check_target(path, SUFFIXES), found.view()
    drive, numbers = Topic("datasheet", "drive"), Topic("datasheet", "numbers")
    notes = (
        numbers.say(version=__version__),
        *(f"{name}: {why}" for name, why in found.failed.items() if name != "published"),
    )
    known = [characteristics()[name] for name in found.results if name in characteristics()]
    definitions = Topic("datasheet", "definitions").section(
        Paragraph([f"assumed: {line}" for line in found.assumed]),
        Paragraph([f"{kind.title}: {kind.definition} ({kind.algorithm})" for kind in known]),
        Paragraph(references(dict.fromkeys(key for kind in known for key in kind.cites))),
        synthetic=False,
    )
    curves, *compared = view.figures
    rest = replace(view, title=numbers.say("title"), leading=(), findings=(), notes=notes, figures=(curves,))
    sections = [
        drive.section(drive.figure("circuit", circuit_figure(found.drive)), synthetic=False),
        view_section("numbers", rest),
        definitions,
    ]
    if found.measured is not None and compared:
        sections.insert(2, Topic("datasheet", "measured").section(*compared, synthetic=found.measured.synthetic))
    report = Report(view.title, [*view.findings, *view.notes], sections, synthetic=True)
    if target.suffix.lower() == ".pdf":
        report.draw()
        return write_pdf(report, target)
    return write_whole(target, report.alone().replace(*SMALL_CIRCUIT, 1))


def sheet_view(found: Datasheet) -> View:
    """Return hazards, leading numbers, tables of numbers and values, curves, and the comparison with recordings."""
    topics = {key: Topic("datasheet", key) for key in ("numbers", "curves", "measured", "values")}
    bands = next(iter(found.results.values())).attrs.get("interval", "") if found.results else ""
    values = ((one.key.removeprefix("components."), one.value, one.origin) for one in found.values)
    tables = [topics["numbers"].table(found.numbers)]
    drawn = {name: found.results[name] for name in topics["curves"].texts["shown"] if name in found.results}
    titled = ((name.replace("-", " "), result) for name, result in drawn.items())
    panels = [panel for title, result in titled for panel in characteristic_panels(result, title)]
    figures = [topics["curves"].figure("curves", figure_of("sheet", panels), bands=bands)]
    if "published" in found.results:
        # Numbers that makers print for the drive's parts, with the values computed for the drive.
        table, rows = found.results["published"], []
        columns = (table["figure"], table.printed, table.computed, 100.0 * table.difference)
        for name, printed, computed, more in zip(*(column.values for column in columns), strict=True):
            rows.append((str(name), plain(printed), plain(computed), f"{more:+.2g} %"))
        tables.append(topics["numbers"].table(rows, "published"))
    if found.measured is not None:
        rows = []
        for n in found.measured.numbers:
            measured, simulated = written_value(n.measured, n.unit, n.low, n.high), written_value(n.simulated, n.unit)
            agrees = "agrees" if n.agrees else "differs"
            rows.append((n.stroke, in_words(n.name), measured, str(n.repeats), simulated, agrees))
        tables.append(topics["measured"].table(rows))
        caption = topics["measured"].texts["pictures"]["measured"]
        figures += [ShownFigure(name, caption, figure) for name, figure in _comparisons(found.measured)]
    tables.append(topics["values"].table(values))
    beside = "" if found.measured is None else f", compared with {'synthetic ' * found.measured.synthetic}recordings"
    return View(
        f"{found.drive.name}: datasheet, simulated{beside}",
        state=worst(found.findings) if found.findings else "open",
        leading=tuple(_leading(found)),
        findings=found.findings,
        notes=(*found.notes, *(f"Compared with: {name}" for name in (found.measured.names if found.measured else ()))),
        tables=[table for table in tables if table.rows],
        figures=figures,
    )


def _leading(found: Datasheet) -> Iterator[ShownValue]:
    """Yield stroke times, the harder impact with its limit (if the piston reaches its ends), and air consumption."""
    square = found.results.get("square-response")
    if square is not None and square.stroke_time.notnull().all():
        for way, time in zip(("out", "back"), square.stroke_time.values, strict=True):
            yield ShownValue(f"time {way}", "", f"time {way}", float(time), "s")
        energy, limit = float(square.end_energy.max()), energy_limit_j(HeldDrive(found.drive))
        state = "bad" if energy > limit else "good"
        yield ShownValue("impact", "", "impact", energy, "J", limit=limit, state=state)
    if "air" in found.results:
        words = "air of a full cycle, l ANR"
        yield ShownValue("air", "", words, float(found.results["air"].full))


def _comparisons(measured: MeasuredBeside) -> Iterator[tuple[str, Figure]]:
    """Yield names and figures of measurements and their simulation: first run, first frequency response, friction."""
    if measured.validation is not None:
        yield "measured", channel_figure(run_columns(measured.validation.records[0]))
    for response in measured.responses[:1]:
        points = Markers(response.frequency_hz, response.measured_m_s, "measured", size=2.5, filled=True)
        line = Line(response.frequency_hz, response.simulated_m_s, "simulated", MODEL)
        title = f"coherence above {response.coherence.min():.2f}"
        x, y = Axis("frequency / Hz", "log"), "velocity over command / (m/s)"
        yield "response", Figure([Panel([points, line], title, x, y)], row_in=2.6, legend="panel")
    if measured.friction is not None:
        yield "friction", friction_figure(measured.friction.curves)
