"""Views of runs: a trajectory, tubes of a drive, a circuit along recorded motions, an ensemble, sensitivities."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import product
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import figures
from pneudrive.errors import CommandError
from pneudrive.figures import LOOKS, Axis, Band, Bars, Figure, Line, Look, Markers, Panel, Rule, ramp, stack, thin
from pneudrive.identify.follow.fit import fitted_pressures
from pneudrive.identify.identified import comparison_figure
from pneudrive.report.control import view_of_controlled_run
from pneudrive.report.page import Section, Topic, figure_of, plural, view_report
from pneudrive.report.render import DrawnFigure, draw_figure
from pneudrive.simulation.run_view import run_view
from pneudrive.simulation.trajectory import attributes, check_si, columns
from pneudrive.units import readable
from pneudrive.views import MOST_LEADING, Finding, ShownFigure, ShownValue, View, worst

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import xarray as xr

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.identify.follow.problem import FollowSolution
    from pneudrive.validate.motion import Closure, MotionValidation


# --- Pictures of simulated runs: a trajectory over time, and speed and stroke time over the tubes of a drive.

WITHOUT = Look("grey", "--")
MOST_IN_A_ROW = 4  # entries of a legend
TITLE_LETTERS = 100  # of a line
MOST_SHOWN = 4000  # samples of a view


def plot(run: xr.Dataset, path: str | Path | None = None) -> DrawnFigure:
    """Draw a trajectory over time: position, velocity, pressures, temperatures, friction, end stops, command.

    Parameters
    ----------
    run : xarray.Dataset
        Result of ``pneudrive.simulate``. Missing variables are left out. For a circuit, the first eight variables of
        each kind are drawn, because more would not be distinguishable.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Returns
    -------
    matplotlib.figure.Figure
        A notebook shows the figure. Elsewhere, give a `path`, or use ``figure.savefig(...)``.

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
    return draw_figure(over_time(run), path)


def over_time(run: xr.Dataset, most: int = 20_000) -> Figure:
    """Draw one panel for each kind of variable, on one time axis, from at most `most` samples."""
    check_si(run)
    if "time" not in run.coords:
        raise CommandError("this is not the dataset of a run", rule="with a coordinate time, as pn.simulate returns it")
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
    for label, last, unit in Topic("trajectory", "run").texts["panels"]:
        wanted = re.compile(rf"{last}(_[ab])?|.+\.{last}")
        of_kind = (str(name) for name, variable in run.data_vars.items() if variable.attrs.get("units") == unit)
        names = [name for name in of_kind if wanted.fullmatch(name)][: len(LOOKS)]
        is_drive = not any("." in name for name in names)
        looks = (figures.MEASURED, figures.MODEL) if is_drive else LOOKS  # of a drive with its two chambers
        # End stops only if one was touched.
        if any(not name.endswith("end_stop_force") or bool((run[name] != 0.0).any()) for name in names):
            yield label, [(name, own, _words(name, last)) for name, own in zip(names, looks, strict=False)]


def _words(name: str, last: str) -> str:
    """Return the name of a curve: the component, or the chamber."""
    component, _, variable = name.rpartition(".")
    return component or variable.removeprefix(last).replace("_", "chamber ")


def view_of_run(run: xr.Dataset, described: Circuit | Drive | None = None) -> View:
    """Return the view of a run with its picture. `described` is the simulated drive, for its gas; default: air."""
    about = attributes(run)
    if "score" in about:
        return view_of_controlled_run(run)
    figure = ShownFigure("trajectory", f"{about.get('title') or 'Trajectory'}, simulated.", over_time(run, MOST_SHOWN))
    return replace(run_view(columns(run), about, described), figures=(figure,))


def plot_lines(study: xr.Dataset, path: str | Path | None = None) -> DrawnFigure:
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
    return figure_of("tubes", panels)


def view_of_tubes(study: xr.Dataset) -> View:
    """Return speeds and stroke times of a drive for each bore and length of its tubes, with the picture."""
    topic, drives = Topic("trajectory", "tubes"), {"without tubes": study.attrs["without_tubes"]}
    drives |= {"as described": study.attrs["as_described"]} if "as_described" in study.attrs else {}
    for d, m in product(study.diameter.to_numpy(), study.length.to_numpy()):
        values = study.sel(diameter=d, length=m)
        drives[f"{1e3 * d:g} mm {m:g} m"] = {str(name): float(values[name]) for name in study.data_vars}
    full, heads = study.attrs["without_tubes"]["mean_speed"], topic.texts["columns"]
    rows = []
    for label, values in drives.items():
        texts = {"C dm3/(s bar)": f"{1e8 * values['vent_conductance']:.3f}"}
        texts |= {head: f"{values[key]:.3f}" if values[key] == values[key] else "never" for head, key in heads}
        ratio = values["mean_speed"] / full
        texts |= {"of the speed": f"{100.0 * ratio:.0f} %" if ratio == ratio else ""}
        rows += [ShownValue(f"{label}.{head}", label, head, text) for head, text in texts.items()]
    figure = ShownFigure("tubes", f"{study.attrs['title']}: speed and stroke time.", tubes_figure(study))
    return View(str(study.attrs["title"]), rows, notes=(topic.say("about"),), figures=(figure,))


# --- Pages of a circuit along recorded motions: chambers, force balance, and what the recordings do not determine.

MOST_RECORDS = 4


def motion_view(found: MotionValidation) -> View:
    """Return the view of a circuit along recorded motions: verdicts, force balances, and pressures."""
    findings = [Finding(text, "good" if met else "bad") for met, text in found.verdicts]
    findings += [Finding(doubt, "open") for doubt in found.doubts]
    notes = [f"{record.name}: {record}" for record in found.records]
    notes += [f"{name}: its chambers are open, so its pressures test neither volumes nor heat" for name in found.open]
    topic, figures = Topic("motion", "forces"), []
    if found.solution is not None:
        figure = comparison_figure(fitted_pressures(found.solution))
        figures.append(ShownFigure("pressures", Topic("motion", "chambers").say("time"), figure))
    if found.closures:
        dots, each = Look("blue", "-", "."), found.closures
        residuals = {c.name: Markers(c.time_s, c.residual_n / c.range_n, look=dots, size=1.0) for c in each}
        panels = [Panel([markers], name) for name, markers in residuals.items()]
        figures.append(ShownFigure("closure", topic.say("residual"), figure_of("closure", panels)))
        notes += [*map(str, found.closures), topic.say()]
    return View(
        f"{found.circuit.name} along recorded motions",
        notes=notes,
        state=worst(findings),
        findings=findings,
        tables=(topic.table(map(_force_row, found.closures)),) if found.closures else (),
        figures=figures,
    )


def motion_page(found: MotionValidation, folder: str | Path) -> Path:
    """Write the page of a validation into an existing folder."""
    return view_report(found.view(), *chambers(found.solution)).write(folder)


def _force_row(c: Closure) -> tuple[object, ...]:
    gains = "; ".join(f"{name} {g.value:.3f} [{g.low:.3f}, {g.high:.3f}]" for name, g in c.gains.items())
    viscous = f"{c.viscous.value:.0f} [{c.viscous.low:.0f}, {c.viscous.high:.0f}]"
    return c.name, c.rms_n, c.share, c.offset_n, gains or None, viscous, c.correlation


def chambers(solution: FollowSolution | None) -> list[Section]:
    """Return a section on each recording along a motion: residuals, start, and pressures over volumes."""
    if solution is None:
        return []
    out = []
    for at, record in enumerate(solution.problem.records[:MOST_RECORDS]):
        topic = Topic("motion", "chambers")
        local, walls = solution.point.local[at], solution.problem.driven.wall_k
        rows = [
            (side, share, walls[side] + local[2 + index], local[4])
            for index, (side, share) in enumerate(zip("ab", solution.rms(at), strict=True))
        ]
        loops = ShownFigure(f"volume-{at + 1}", topic.say("volume", name=record.name), volume_figure(solution, at))
        out.append(topic.section(topic.table(rows), loops, name=record.name))
    return out


def volume_figure(solution: FollowSolution, at: int) -> Figure:
    """Draw pressures over the volumes of the chambers, and their residuals over the position."""
    problem, record = solution.problem, solution.problem.records[at]
    problem.driven.values_form(problem.numbers, np.exp(solution.point.shared))
    volumes, rest = problem.driven.volumes_m3(record.positions_m), solution.rest(at)
    left, right = [], []
    for index, (side, color) in enumerate((("a", "blue"), ("b", "orange"))):
        measured, own = record.pressures_pa[index], Look(color)
        left.append(Line(volumes[side], measured, f"chamber {side}", own))
        left.append(Line(volumes[side], measured - rest[index], look=Look("black", "--"), width=0.7))
        right.append(Line(record.positions_m, rest[index] / record.ranges_pa[index], look=own, width=0.5))
    panels = [Panel(left, "", "volume / l", "pressure / bar"), Panel(right, "", "position / m", "residual / %")]
    return figure_of("volumes", panels)


# --- Views of an ensemble (spread of each output, fans over time) and of sensitivities (bars of each number).

#: Column of the view of an ensemble -> quantile.
QUANTILES = {"lowest": 0.0, "5 %": 0.05, "median": 0.5, "95 %": 0.95, "highest": 1.0}
MOST_PANELS, BINS = 6, 24
#: Variables of a sensitivity that are drawn -> look.
DRAWN = {"total": Look("blue"), "first": Look("orange")}


def ensemble_view(found: xr.Dataset) -> View:
    """Return the view of an ensemble: spread of each output over the members with a value, and failures."""
    rows, missing, fans, counts = [], [], [], []
    for name, column in ((str(name), found[name]) for name in found.data_vars if name not in ("status", "reason")):
        values, (size, unit) = column.to_numpy(), readable(str(column.attrs.get("units", "1")))
        label = Axis(figures.label_of(name, unit))
        finite = values[np.isfinite(values)]
        if values.ndim > 1:
            low, first, middle, last, high = np.nanquantile(values, (0.05, 0.25, 0.5, 0.75, 0.95), axis=0)
            time, tints = found["time"].to_numpy(), (Look("grey"), Look("blue"))
            bands = [Band(time, low, high, "5 to 95 %", tints[0]), Band(time, first, last, "25 to 75 %", tints[1])]
            fans.append(Panel([*bands, Line(time, middle, "median")], "", "time / s", label))
            continue
        ends = np.quantile(finite, list(QUANTILES.values())) / size if finite.size else ()
        texts = [f"{end:.5g} {unit}".strip() for end in ends] or ["-"] * len(QUANTILES)
        rows += [ShownValue(f"{name}, {q}", name, q, text) for q, text in zip(QUANTILES, texts, strict=True)]
        if finite.size < values.size:
            missed = f"{name} has no value in {values.size - finite.size} of {values.size} members"
            missing.append(Finding(f"{missed}: its row is of the others.", "open"))
        if finite.size and np.ptp(finite) > 0.0:
            number, edges = np.histogram(finite, BINS)
            middles = 0.5 * (edges[1:] + edges[:-1])
            bars = Bars(middles, number, thickness=float(edges[1] - edges[0]))
            counts.append(Panel([bars], "", label, "members"))
    status = found["status"].to_numpy() if "status" in found else np.zeros(found.sizes["member"])
    failed = np.flatnonzero(status)[:1]
    words = (str(found["reason"].to_numpy()[i]) if "reason" in found else "see the table of members" for i in failed)
    reasons = [Finding(f"member {i}: {reason}", "bad") for i, reason in zip(failed, words, strict=True)]
    topic, drawn = Topic("trajectory", "ensemble"), {"fan": fans, "members": counts}
    before = f"{found.attrs['title']}: " if "title" in found.attrs else ""
    return View(
        f"{before}{found.sizes['member']} members, {np.count_nonzero(status)} failed",
        rows,
        state="bad" if failed.size else "open" if missing else "good",
        findings=(*reasons, *missing),
        figures=[topic.figure(key, figure_of("ensemble", each[:MOST_PANELS])) for key, each in drawn.items() if each],
    )


def sensitivity_view(found: xr.Dataset) -> View:
    """Return the view of sensitivities: effect of each number on each output with intervals, and bars."""
    numbers = [str(name) for name in found["number"].to_numpy()]
    rows, leading, findings, panels = [], [], [], []
    for output in map(str, found["output"].to_numpy()):
        own = found.sel(output=output)
        total = own["total"].to_numpy()
        if not np.isfinite(total).any():
            findings.append(Finding(f"{output} does not vary with these numbers.", "open"))
            continue
        marks, positions = [], np.arange(len(numbers), dtype=float)
        for place, (name, color) in enumerate(DRAWN.items()):
            at = positions + 0.2 - 0.4 * place
            low, high = own[f"{name}_interval"].to_numpy()
            marks.append(Bars(at, own[name].to_numpy(), name, color, 0.35, across=True))
            marks += [Line(ends, (y, y)) for y, *ends in zip(at, low, high, strict=True)]
            for number, value, *ends in zip(numbers, own[name].to_numpy(), low, high, strict=True):
                key, interval = f"{output}, {number}, {name}", (float(ends[0]), float(ends[1]))
                rows.append(ShownValue(key, f"{output}: {number}", name, float(value), "", interval))
        at = int(np.nanargmax(total))
        words = f"{output}, most by {numbers[at]}: total"
        leading.append(replace(rows[at - len(DRAWN) * len(numbers)], quantity=words))
        panels.append(Panel(marks, output, Axis("fraction of the variance", is_si=False), Axis(names=numbers)))
    points = zip(found["output"].values, found["used"].values, strict=True)
    used = ", ".join(f"{int(count)} for {name}" for name, count in points)
    figure = figure_of("ensemble", panels[:MOST_PANELS], row_in=0.7 + 0.3 * len(numbers))
    count = f"{plural(len(numbers), 'number')}, {plural(found.sizes['output'], 'output')}"
    return View(
        f"{found.attrs.get('title', 'Sensitivities')}: {count}",
        rows,
        notes=(f"points used: {used}",),
        state="open" if findings else "good",
        leading=leading[:MOST_LEADING],
        findings=findings,
        figures=(ShownFigure("sensitivity", "Effect of each number, with 95 % intervals.", figure),) if panels else (),
    )
