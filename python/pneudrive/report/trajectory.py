"""A trajectory as a picture."""

from __future__ import annotations

import re
from textwrap import fill
from typing import TYPE_CHECKING, Any

from pneudrive.report import style
from pneudrive.report.axes import legend_over, stack
from pneudrive.report.written import PICTURES, drawn, write_picture
from pneudrive.simulation.trajectory import attributes, check_si, columns, whole

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr
    from matplotlib.figure import Figure

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive

#: Names of rows in the table of provenance -> attribute that lists them.
LISTS = {"warning": "warnings", "assumed": "assumed"}
MOST_IN_A_ROW = 4  # entries of a legend
TITLE_LETTERS = 100  # of a line
ENDINGS = (*PICTURES, ".html")
#: Panels: label, factor from SI, name of the variable or last part of it, its unit.
PANELS = (
    ("position / mm", 1e3, "position", "m"),
    ("velocity / (m/s)", 1.0, "velocity", "m/s"),
    ("pressure / bar abs", 1e-5, "pressure", "Pa"),
    ("gas temperature / K", 1.0, "temperature", "K"),
    ("friction force / N", 1.0, "friction_force", "N"),
    ("end stop force / N", 1.0, "end_stop_force", "N"),
    ("valve position", 1.0, "position", "1"),
    ("command", 1.0, "command", "1"),
)
#: Of a drive with its two chambers.
CHAMBERS = ((style.BLACK, "-"), (style.ORANGE, "--"))


def plot(run: xr.Dataset, path: str | Path | None = None, circuit: Circuit | Drive | None = None) -> Figure:
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

    def write(figure: Figure, target: Path) -> None:
        if target.suffix.lower() == ".html":
            _write_page(figure, run, target, circuit)
        else:
            write_picture(figure, target)

    return drawn(lambda: draw(run), path, ENDINGS, write)


def draw(run: xr.Dataset) -> Figure:
    """Draw one panel for each kind of variable, on one time axis."""
    check_si(run)
    shown = _panels(run)
    figure, axes = stack(1.15 * len(shown) + 0.5, [1] * max(len(shown), 1))
    part = style.thin(run.time, 20_000)
    time = run.time.to_numpy()[part]
    for axis, (label, factor, variables) in zip(axes, shown, strict=False):
        for name, look, words in variables:
            values = factor * run[name].to_numpy()[part]
            steps = "steps-post" if label == "command" else "default"
            axis.plot(time, values, **look, lw=1.0, drawstyle=steps, label=words or None)
        if len(variables) > 1:
            legend_over(axis, min(len(variables), MOST_IN_A_ROW))
        axis.set_ylabel(label)
    title = run.attrs.get("title")
    if title:
        figure.suptitle(fill(f"{title} (simulated)", TITLE_LETTERS), fontsize=9, x=0.01, ha="left")
    figure.align_ylabels()
    return figure


def _panels(run: xr.Dataset) -> list[tuple[str, float, list[tuple[str, dict[str, Any], str]]]]:
    """Return label, factor and variables (name, look, words) of each panel with data."""
    panels = []
    for label, factor, last, unit in PANELS:
        wanted = re.compile(rf"{last}(_[ab])?|.+\.{last}")
        of_kind = (str(name) for name, one in run.data_vars.items() if one.attrs.get("units") == unit)
        names = [name for name in of_kind if wanted.fullmatch(name)][: len(style.LOOKS)]
        is_drive = not any("." in name for name in names)
        looks = CHAMBERS if is_drive else [style.look(i)[:2] for i in range(len(names))]
        drawn = [
            (name, {"color": color, "linestyle": line}, _words(name, last))
            for name, (color, line) in zip(names, looks, strict=False)
        ]
        if any(_has_something(run, name) for name in names):
            panels.append((label, factor, drawn))
    return panels


def _words(name: str, last: str) -> str:
    """Return the name of a curve: the component, or the chamber."""
    component, _, variable = name.rpartition(".")
    return component or variable.removeprefix(last).replace("_", "chamber ")


def _has_something(run: xr.Dataset, name: str) -> bool:
    """Return whether a variable exists; end stops only if one was touched."""
    return not name.endswith("end_stop_force") or bool((run[name] != 0.0).any())


def _write_page(figure: Figure, run: xr.Dataset, target: Path, circuit: Circuit | Drive | None) -> None:
    """Write a page that loads nothing: platforms, the picture, then its provenance."""
    from pneudrive.platforms import platforms
    from pneudrive.report.page import PageTable, Picture, Report, Section, inline, svg_text
    from pneudrive.report.platform.page import platform_section

    names = ("version", "solver", "rtol", "description_hash", "statistics")
    about = attributes(run)
    rows = [(name, str(about[name])) for name in names if name in about]
    rows += [(name, one) for name in ("warning", "assumed") for one in about.get(LISTS[name], [])]
    title = str(run.attrs.get("title") or "Trajectory")
    picture = Picture("trajectory", f"{title}, simulated.", figure)
    table = PageTable(("", ""), tuple(rows), "Provenance", numbers_from=9)
    position = run["position"].to_numpy() * 1e3 if "position" in run else None
    lines = [f"{run.sizes['time']} samples to {float(run.time[-1]):g} s."]
    if position is not None:
        lines.append(
            f"Position {position[0]:.3f} mm to {position[-1]:.3f} mm, between {position.min():.3f} and "
            f"{position.max():.3f} mm."
        )
    own = platforms(circuit) if circuit is not None else []
    sections = [platform_section(platform, columns(run)) for platform in own]
    sections.append(Section("trajectory", "Trajectory", (picture, table)))
    report = Report(title, lines, sections, synthetic=True)
    report.pictures[picture.name] = inline(svg_text(figure), picture.name, picture.caption)
    with whole(target) as temporary:
        temporary.write_text(report.alone(), encoding="utf-8")
