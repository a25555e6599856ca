"""Pictures of simulated runs: a trajectory over time, and speed and stroke time over the tubes of a drive."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import product
from textwrap import fill
from typing import TYPE_CHECKING

from pneudrive.figures import LOOKS, MEASURED, MODEL, Axis, Figure, Line, Look, Markers, Panel, Rule, ramp, stack, thin
from pneudrive.report.control import view_of_controlled_run
from pneudrive.report.render import PICTURES, draw_figure, drawn, render, write_picture
from pneudrive.simulation.run_view import run_view
from pneudrive.simulation.trajectory import attributes, check_si, columns, whole
from pneudrive.views import ShownFigure, ShownTable, ShownValue, View

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import matplotlib.figure
    import xarray as xr

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive

WITHOUT = Look("grey", "--")
MOST_IN_A_ROW = 4  # entries of a legend
TITLE_LETTERS = 100  # of a line
MOST_SHOWN = 4000  # samples of a view
ENDINGS = (*PICTURES, ".html")
ABOUT_TUBES = (
    "Tubes are steady: C = 0.029 d^2/sqrt(L/d^1.25 + 510), an empirical formula (assumed; smooth-pipe theory gives "
    "10 to 15 % more), and their volume; waves are left out. Strokes are simulated from rest at the start of the "
    "stroke, the emptying chamber at supply pressure; the choked speed is the limit that the exhaust path alone causes."
)
#: Column of a table of tubes -> variable of the study.
TUBE_COLUMNS = (
    ("choked m/s", "vent_speed"),
    ("out s", "stroke_time_out"),
    ("back s", "stroke_time_back"),
    ("mean m/s", "mean_speed"),
    ("end m/s", "end_speed"),
)
#: Panels: label, name of the variable or last part of it, its unit.
PANELS = (
    ("position / mm", "position", "m"),
    ("velocity / (m/s)", "velocity", "m/s"),
    ("pressure / bar abs", "pressure", "Pa"),
    ("gas temperature / K", "temperature", "K"),
    ("friction force / N", "friction_force", "N"),
    ("end stop force / N", "end_stop_force", "N"),
    ("valve position", "position", "1"),
    ("command", "command", "1"),
)


def plot(
    run: xr.Dataset, path: str | Path | None = None, circuit: Circuit | Drive | None = None
) -> matplotlib.figure.Figure:
    """Draw a trajectory over time: position, velocity, pressures, temperatures, friction, end stops, command.

    Parameters
    ----------
    run : xarray.Dataset
        Result of ``pneudrive.simulate``. Missing variables are left out. A circuit shows the first eight of each kind,
        because more would not be distinguishable.
    path : path-like, optional
        Picture to write: .png, .svg, .pdf, or .html (a page with the picture and its provenance).
    circuit : Circuit or Drive, optional
        Simulated circuit: a page then has a section for each of its platforms.

    Returns
    -------
    matplotlib.figure.Figure
        A notebook shows it; elsewhere give a `path`, or use ``figure.savefig(...)``.

    Raises
    ------
    CommandError
        Unknown suffix, the file cannot be written, or the run is not in SI.

    Examples
    --------
    >>> import pneudrive as pn
    >>> run = pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 1", "0.1 s")
    >>> len(pn.report.plot(run).axes)
    6
    """

    def write(figure: matplotlib.figure.Figure, target: Path) -> None:
        if target.suffix.lower() == ".html":
            _write_page(figure, run, target, circuit)
        else:
            write_picture(figure, target)

    spec = over_time(run)
    return drawn(lambda: render(spec), path, ENDINGS, write)


def over_time(run: xr.Dataset, most: int = 20_000) -> Figure:
    """Draw one panel for each kind of variable, on one time axis, from at most `most` samples."""
    check_si(run)
    part = thin(run.time, most)
    time, panels = run.time.to_numpy()[part], []
    for label, variables in _panels(run):
        lines = [
            Line(time, run[name].to_numpy()[part], words * (len(variables) > 1), own, 1.0, steps=label == "command")
            for name, own, words in variables
        ]
        panels.append(Panel(lines, y=label))
    title = run.attrs.get("title")
    above = fill(f"{title} (simulated)", TITLE_LETTERS) if title else ""
    size = 1.15 * len(panels) + 0.5
    return stack(panels or [Panel([])], size, legend="over", entries=MOST_IN_A_ROW, title=above)


def _panels(run: xr.Dataset) -> Iterator[tuple[str, list[tuple[str, Look, str]]]]:
    """Yield label and variables (name, look, words) of each panel with data."""
    for label, last, unit in PANELS:
        wanted = re.compile(rf"{last}(_[ab])?|.+\.{last}")
        of_kind = (str(name) for name, variable in run.data_vars.items() if variable.attrs.get("units") == unit)
        names = [name for name in of_kind if wanted.fullmatch(name)][: len(LOOKS)]
        is_drive = not any("." in name for name in names)
        looks = (MEASURED, MODEL) if is_drive else LOOKS  # of a drive with its two chambers
        if any(_has_something(run, name) for name in names):
            yield label, [(name, own, _words(name, last)) for name, own in zip(names, looks, strict=False)]


def _words(name: str, last: str) -> str:
    """Return the name of a curve: the component, or the chamber."""
    component, _, variable = name.rpartition(".")
    return component or variable.removeprefix(last).replace("_", "chamber ")


def _has_something(run: xr.Dataset, name: str) -> bool:
    """Return whether a variable exists; end stops only if one was touched."""
    return not name.endswith("end_stop_force") or bool((run[name] != 0.0).any())


def view_of_run(run: xr.Dataset, described: Circuit | Drive | None = None) -> View:
    """Return the view of a run with its picture. `described` is its drive, for the gas; default: air."""
    about = attributes(run)
    if "score" in about:
        return view_of_controlled_run(run)
    figure = ShownFigure("trajectory", f"{about.get('title') or 'Trajectory'}, simulated.", over_time(run, MOST_SHOWN))
    return replace(run_view(columns(run), about, described), figures=(figure,))


def _write_page(
    figure: matplotlib.figure.Figure, run: xr.Dataset, target: Path, circuit: Circuit | Drive | None
) -> None:
    """Write a page that loads nothing: platforms, values and picture of the run, then its provenance."""
    from pneudrive.platforms import platforms
    from pneudrive.report.page import Section, inline, svg_text, view_report, view_section
    from pneudrive.report.platform.page import platform_run_view

    about, view = attributes(run), view_of_run(run, circuit)
    names = ("version", "solver", "rtol", "description_hash", "statistics")
    rows = [(name, str(about[name])) for name in names if name in about]
    rows += [("assumed", text) for text in about.get("assumed", [])]
    machines = platforms(circuit) if circuit is not None else []
    table = ShownTable("Provenance", ("", ""), tuple(rows))
    sections = [view_section("platform", platform_run_view(platform, columns(run))) for platform in machines]
    report = view_report(view, *sections, Section("provenance", "Provenance", (table,)), synthetic=True)
    report.pictures = {shown.name: inline(svg_text(figure), shown.name, shown.caption) for shown in view.figures}
    with whole(target) as temporary:
        temporary.write_text(report.alone(), encoding="utf-8")


def plot_lines(study: xr.Dataset, path: str | Path | None = None) -> matplotlib.figure.Figure:
    """Draw mean speed and stroke time over the length of the tubes, a curve for each bore.

    Parameters
    ----------
    study : xarray.Dataset
        From `pneudrive.lines`.
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
    return draw_figure(tubes_figure(study), path, synthetic=True)


def tubes_figure(study: xr.Dataset) -> Figure:
    """Draw mean speed and stroke time over the length of the tubes, a curve for each bore."""
    panels, bores, length = [], study.diameter.to_numpy(), study.length.to_numpy()
    for label, name in (("mean speed of the stroke / (m/s)", "mean_speed"), ("stroke time / s", "stroke_time_out")):
        curves = [
            Markers(length, study[name][number].to_numpy(), f"{1e3 * bore:g} mm bore", ramp(number, bores.size),
                   filled=True, joined=True)
            for number, bore in enumerate(bores)
        ]  # fmt: skip
        without = Rule(y=study.attrs["without_tubes"][name], label="without tubes", look=WITHOUT, width=1.1)
        panels.append(Panel([*curves, without], y=Axis(label, low=0.0)))
    return Figure(panels, Axis("length of each tube / m", low=0.0), columns=2, row_in=2.9, rest_in=0.0)


def view_of_tubes(study: xr.Dataset) -> View:
    """Return speeds and stroke times of a drive for each bore and length of its tubes, with the picture."""
    drives = {"without tubes": study.attrs["without_tubes"]}
    drives |= {"as described": study.attrs["as_described"]} if "as_described" in study.attrs else {}
    for d, m in product(study.diameter.to_numpy(), study.length.to_numpy()):
        values = study.sel(diameter=d, length=m)
        drives[f"{1e3 * d:g} mm {m:g} m"] = {str(name): float(values[name]) for name in study.data_vars}
    full = study.attrs["without_tubes"]["mean_speed"]
    rows = []
    for label, values in drives.items():
        texts = {"C dm3/(s bar)": f"{1e8 * values['vent_conductance']:.3f}"}
        texts |= {head: f"{values[key]:.3f}" if values[key] == values[key] else "never" for head, key in TUBE_COLUMNS}
        ratio = values["mean_speed"] / full
        texts |= {"of the speed": f"{100.0 * ratio:.0f} %" if ratio == ratio else ""}
        rows += [ShownValue(f"{label}.{head}", label, head, text) for head, text in texts.items()]
    figure = ShownFigure("tubes", f"{study.attrs['title']}: speed and stroke time.", tubes_figure(study))
    return View(str(study.attrs["title"]), tuple(rows), notes=(ABOUT_TUBES,), figures=(figure,))
