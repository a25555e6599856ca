"""Views of runs: a trajectory, tubes of a drive, runs and benchmarks of control, an ensemble, sensitivities."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from itertools import product
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import figures
from pneudrive.control.pose.path import PoseScore
from pneudrive.control.scores import view_of_score, written
from pneudrive.errors import CommandError
from pneudrive.figures import Axis, Band, Bars, Figure, Line, Look, Markers, Panel, Rule, look, ramp, stack, thin
from pneudrive.report.page import Topic, figure_of, plural, view_report
from pneudrive.report.render import DrawnFigure, draw_figure
from pneudrive.simulation.run_view import run_view
from pneudrive.simulation.trajectory import attributes, check_si, columns
from pneudrive.units import readable
from pneudrive.views import MOST_LEADING, Finding, ShownFigure, ShownValue, View

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence
    from pathlib import Path

    import xarray as xr

    from pneudrive.arrays import Array, Columns, Keyed, Plain
    from pneudrive.control.benchmarks import ControlComparison, ControlledRun
    from pneudrive.control.motion import Reference
    from pneudrive.control.tuning import Tuning
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive


# --- Pictures of simulated runs: a trajectory over time, and speed and stroke time over the tubes of a drive.

REFERENCE = Look("grey", "--")
MOST_SHOWN = 4000  # samples of a curve in a view


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
        raise CommandError("this is not the dataset of a run", rule="a dataset as pn.simulate returns it, with time")
    part = thin(run.time, most)
    time, panels = run.time.values[part], []
    for label, last, unit in Topic("trajectory", "run").texts["panels"]:
        wanted = re.compile(rf"{last}(_[ab])?|.+\.{last}")
        of_kind = (str(name) for name, variable in run.data_vars.items() if variable.attrs.get("units") == unit)
        names = [name for name in of_kind if wanted.fullmatch(name)][: len(figures.LOOKS)]
        # End stops only if one was touched.
        if all(name.endswith("end_stop_force") and not bool((run[name] != 0.0).any()) for name in names):
            continue
        is_circuit, lines = any("." in name for name in names), []
        looks = figures.LOOKS if is_circuit else (figures.MEASURED, figures.MODEL)  # of a drive with its two chambers
        for name, own in zip(names, looks, strict=False):
            # If there are several curves, each is named by its component, or by its chamber.
            words = name.rpartition(".")[0] or name.removeprefix(last).replace("_", "chamber ")
            words = words if len(names) > 1 else ""
            lines.append(Line(time, run[name].values[part], words, own, 1.0, steps=label == "command"))
        panels.append(Panel(lines, y=label))
    above = fill(f"{run.attrs['title']} (simulated)", 100) if run.attrs.get("title") else ""
    return stack(panels or [Panel([])], 1.15 * len(panels) + 0.5, legend="over", title=above)


def view_of_run(run: xr.Dataset, described: Circuit | Drive | None = None) -> View:
    """Return the view of a run with its picture. The view of a controlled run also has the score and the events.

    `described` is the simulated drive, whose gas is needed for air volumes. Default: air.
    """
    about = attributes(run)
    if "score" in about:  # a run under control, of an axis or a platform
        is_pose = "coordinates" in about["score"]
        view = PoseScore.read(about["score"]).view(about) if is_pose else view_of_score(about)
        return replace(view, figures=(ShownFigure("control", f"{view.title}.", run_figure(run)),))
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
    panels, bores, length = [], study.diameter.values, study.length.values
    for label, name in (("mean speed of the stroke / (m/s)", "mean_speed"), ("stroke time / s", "stroke_time_out")):
        curves = [
            Markers(length, study[name][number].values, f"{1e3 * bore:g} mm bore", ramp(number, bores.size),
                   filled=True, joined=True)
            for number, bore in enumerate(bores)
        ]  # fmt: skip
        without = Rule(y=study.attrs["without_tubes"][name], label="without tubes", look=REFERENCE, width=1.1)
        panels.append(Panel([*curves, without], y=Axis(label, low=0.0)))
    return figure_of("tubes", panels)


def view_of_tubes(study: xr.Dataset) -> View:
    """Return speeds and stroke times of a drive for each bore and length of its tubes, with the picture."""
    topic, known = Topic("trajectory", "tubes"), ("without_tubes", "as_described")
    drives = {name.replace("_", " "): study.attrs[name] for name in known if name in study.attrs}
    for d, m in product(study.diameter.values, study.length.values):
        drives[f"{1e3 * d:g} mm {m:g} m"] = study.sel(diameter=d, length=m)
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


# --- Runs under control.


def plot_control(run: xr.Dataset, path: str | Path | None = None) -> DrawnFigure:
    """Draw a run under control over time: position and reference, error, pressures, command, disturbance.

    For a platform, draw coordinates with references, errors, and positions and forces of the legs.

    Parameters
    ----------
    run : xarray.Dataset
        From `pneudrive.control.run` or `pneudrive.control.run_pose`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    """
    return draw_figure(run_figure(run), path, synthetic=True)


def run_figure(run: xr.Dataset) -> Figure:
    """Draw a run under control over time."""
    check_si(run)
    part = thin(run.time, MOST_SHOWN)
    time = run.time.values[part]
    known = {str(name): run[name].values[part] for name in run.data_vars}
    title = f"{run.attrs.get('law', '')} on {run.attrs.get('title', 'a drive')}"
    score = attributes(run).get("score", {})
    if "coordinates" in score:
        return _over_time(_pose_panels(time, known, score, title))
    off = known["reference"] - known["position"]
    chambers = ("a", figures.MEASURED), ("b", figures.MODEL)
    both = [Line(time, known["reference"], "reference", figures.MODEL), Line(time, known["position"], "position")]
    pressures = [Line(time, known[f"pressure_{side}"], f"chamber {side}", own) for side, own in chambers]
    panels = [
        Panel(both, title, y="position / mm"),
        Panel([Line(time, off), Rule(y=0.0)], y=f"error / {error_unit([off])}"),
        Panel(pressures, y="pressure / bar abs"),
        Panel([Line(time, known["command"], width=0.8, steps=True)], y="command"),
        Panel([Line(time, known["disturbance"], width=0.8)], y="disturbance / N"),
    ]
    return _over_time(panels)


def _pose_panels(time: Array, known: Columns, score: Plain, title: str) -> list[Panel]:
    platform = next(name.rpartition(".")[0] for name in known if name.endswith("_reference"))
    coordinates: dict[str, list[Line]] = {}
    errors: list[Line | Rule] = []
    for number, (key, score_of) in enumerate(score["coordinates"].items()):
        wanted, actual = known[f"{platform}.{key}_reference"], known[f"{platform}.{key}"]
        lines = coordinates.setdefault("place / mm" if score_of["unit"] == "m" else "tilt / deg", [])
        lines += [Line(time, actual, key, Look(look(number).color)), Line(time, wanted, look=REFERENCE, width=0.8)]
        if score_of["amplitude"] > 0.0:
            error = (wanted - actual) / score_of["amplitude"]
            errors.append(Line(time, error, look=Look(look(number).color), width=0.8))
    legs = {leg: Look(look(number).color) for number, leg in enumerate(score["legs"])}
    units = [label for label in ("place / mm", "tilt / deg") if label in coordinates]
    forces = [Line(time, known[f"{leg}.required_force"], look=own) for leg, own in legs.items()]
    return [
        *(Panel(coordinates[label], title if label == units[0] else "", y=label) for label in units),
        Panel([*errors, Rule(y=0.0)], y="error / % of\namplitude"),
        Panel([Line(time, known[f"{leg}.position"], leg, own) for leg, own in legs.items()], y="leg / mm"),
        Panel(forces, y="required\nforce / N"),
    ]


def plot_reference(reference: Reference, tuning: Tuning, path: str | Path | None = None) -> DrawnFigure:
    """Draw a reference with the stroke and the highest speeds of the drive.

    Parameters
    ----------
    reference : Reference
    tuning : Tuning
        Result of `pneudrive.control.tune`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    """
    end_s = 4.0 / reference.frequency_hz if reference.is_sine else reference.duration_s
    time = np.linspace(0.0, end_s, MOST_SHOWN)
    out, back = tuning.speeds_m_s
    limits = {"position / mm": (0.0, tuning.plant.stroke_m), "velocity / (m/s)": (-back, out)}
    panels = []
    for label, values in zip((*limits, "acceleration / (m/s²)"), reference.at(time).T, strict=False):
        rules = (Rule(y=limit, look=REFERENCE, width=1.1) for limit in limits.get(label, ()))
        panels.append(Panel([Line(time, values), *rules], y=label))
    return draw_figure(_over_time(panels), path, synthetic=False)


def _over_time(panels: Sequence[Panel]) -> Figure:
    return stack(panels, 1.2 * len(panels) + 0.5, legend="over", entries=6)


def error_unit(errors_m: Sequence[Any]) -> str:
    """Return the unit in which errors are drawn: micrometres if all are below 5 mm, otherwise millimetres."""
    largest = max((np.abs(error).max() for error in errors_m if len(error)), default=0.0)
    return "um" if largest < 5e-3 else "mm"


def gain_rows(laws: Keyed) -> Iterator[tuple[str, ...]]:
    """Yield the rows of a table of gains: controller, key, value, meaning and rule."""
    for law, tuning in laws.items():
        yield from ((law, *(gain[key] for key in ("key", "written", "meaning", "rule"))) for gain in tuning["gains"])


# --- a benchmark of controllers --------------------------------------------------------------------------------------


def controllers_view(found: ControlComparison, measures: Collection[str] = ()) -> View:
    """Return the view of a benchmark. `measures` selects the columns of its table, by default all."""
    topic, leading, failed = Topic("control", "reference"), [], [run for run in found.runs if run.score is None]
    for along, text in found.references.items():
        if (best := found.best(along)) is not None:
            error = written("max_error_m", found.middle(best, along, "max_error_m"))
            said = topic.say("best", called=_called(along, text), law=best)
            leading.append(ShownValue(f"{along}.best", along, said, error))
    ended = Counter((run.law, run.reason) for run in failed).items()
    findings = [
        Finding(f"{plural(count, 'run')} of {law} ended early: {reason}", "bad") for (law, reason), count in ended
    ]
    if not found.is_finished:
        total = found.count * len(found.references) * len(found.laws)
        findings.append(Finding(f"{len(found.runs)} of {total} runs are done.", "open", "Repeat the command."))
    truth = ((name, *ends) for name, ends in found.truth.items())
    # Differences between the runs, and between the true drive and the assumed one.
    topic, setup = Topic("control", "method"), str(found.about.get("setup_about", ""))
    each = plural(found.count, "member") if found.spread else f"{plural(found.count, 'seed')} of noise"
    notes = [topic.say("members" if found.spread else "seeds", each=each)]
    notes.append(topic.say("about" if setup else "setup", name=found.setup, about=setup))
    for name, tuning in found.about["laws"].items():
        if tuning["believes"] != found.drive:
            notes.append(topic.say("believes", law=name, drive=tuning["believes"]))
    notes += [topic.say("mismatch", mismatch=found.mismatch)] if found.mismatch else []
    notes += [topic.say("spread", spread=found.spread)] if found.spread else []
    return View(
        f"{found.drive} under {plural(len(found.laws), 'controller')}, {plural(len(found.runs), 'simulated run')}",
        [value for along in found.references for value in found.values(along, measures)],
        notes=notes,
        state="bad" if failed else "good" if found.is_finished else "open",
        leading=leading[:MOST_LEADING],
        findings=findings,
        tables=(Topic("control", "true").table(truth),) if found.truth else (),
        figures=tuple(_reference_figures(found)),
    )


def _called(name: str, text: str) -> str:
    return text if name == text else f"{name} ({text})"


def _reference_figures(found: ControlComparison) -> Iterator[ShownFigure]:
    """Yield, for each reference, the errors of all members of a spread, and tracks and errors of all controllers."""
    topic = Topic("control", "reference")
    for number, (along, text) in enumerate(found.references.items(), 1):
        called = _called(along, text)
        each = [[run.score.max_error_m for run in found.of(law, along) if run.score is not None] for law in found.laws]
        if found.spread and any(each):
            marks = [mark for position, values in enumerate(each) if values for mark in box_marks(position, values)]
            x = Axis(f"largest error / {error_unit(each)}", "log")
            laws = Axis(names=found.laws, low=len(each) - 0.5, high=-0.5)
            figure = Figure([Panel(marks)], x, laws, row_in=0.5 + 0.34 * len(each), rest_in=0.0)
            yield ShownFigure(f"boxes-{number}", topic.say("boxes", called=called, spread=found.spread), figure)
        tracks, references, errors = [], [], []
        for run, track in tracks_of(found, along):
            part, own = thin(track["time_s"], MOST_SHOWN), look(found.laws.index(run.law))
            time, position, reference, error = (values[part] for values in track.values())
            tracks.append(Line(time, position, run.law, own, 0.9))
            references.append(Line(time, reference, "reference", Look("red"), 0.6))
            errors.append(Line(time, error, look=own, width=0.9))
        if tracks:
            error = Axis(f"error / {error_unit([line.y for line in errors])}", "far")
            positions = Panel([*tracks, *references[:1]], y="position / mm")
            caption = topic.say("tracks", which="member 1" if found.spread else "first seed", called=called)
            figure = stack([positions, Panel([*errors, Rule(y=0.0)], y=error)], 4.2)
            yield ShownFigure(f"tracks-{number}", caption, figure)


def box_marks(position: int, values: Sequence[float]) -> Iterator[Any]:
    """Yield a vertical box plot of values at a position: 5, 25, 50, 75 and 95 % quantiles, and the values outside."""
    low, first, middle, last, high = np.quantile(values, (0.05, 0.25, 0.5, 0.75, 0.95))
    outside = [v for v in values if not low <= v <= high]
    yield Line((low, high), (position, position), width=0.9)
    yield Line((first, last), (position, position), look=Look("grey"), width=7.0)
    yield Markers([middle], [position], look=Look("orange", "-", "|"), size=9.0)
    yield Markers(outside, [position] * len(outside), look=Look("black", "-", "."), size=3.0)


def tracks_of(found: ControlComparison, along: str) -> Iterator[tuple[ControlledRun, Columns]]:
    """Yield the first stored run of each controller along a reference: time, position, reference and error in SI."""
    for law in found.laws:
        run = next((run for run in found.of(law, along) if run.score is not None and run.file.is_file()), None)
        if run is not None:
            columns = run.columns("time_s", "position_m", "reference_m")
            yield run, columns | {"error_m": columns["reference_m"] - columns["position_m"]}


def write_control_report(found: ControlComparison, folder: str | Path) -> Path:
    """Write report.html, which loads no other files, and its figures as PNG and SVG.

    Parameters
    ----------
    found : ControlComparison
    folder : path-like
        An existing folder.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    view, method, told = found.view(), Topic("control", "method"), Topic("control", "told")
    assumed = told.section(
        told.table(found.about["plant"], "plant"), told.table(gain_rows(found.about["laws"]), "gains"), synthetic=False
    )
    return view_report(view, method.section(method.text()), assumed, synthetic=True).write(folder)


# --- Views of an ensemble (spread of each output, fans over time) and of sensitivities (bars of each number).

#: Column of the view of an ensemble -> quantile.
QUANTILES = {"lowest": 0.0, "5 %": 0.05, "median": 0.5, "95 %": 0.95, "highest": 1.0}
MOST_PANELS, BINS = 6, 24
#: Variables of a sensitivity that are drawn -> look.
DRAWN = {"total": Look("blue"), "first": Look("orange")}


def ensemble_view(found: xr.Dataset) -> View:
    """Return the view of an ensemble: the spread of each output over all members with a value, and the failures."""
    rows, missing, fans, counts = [], [], [], []
    for name, column in found.drop_vars(("status", "reason"), errors="ignore").items():
        values, (size, unit) = column.values, readable(str(column.attrs.get("units", "1")))
        label = Axis(figures.label_of(str(name), unit))
        finite = values[np.isfinite(values)]
        if values.ndim > 1:
            low, first, middle, last, high = np.nanquantile(values, (0.05, 0.25, 0.5, 0.75, 0.95), axis=0)
            time, tints = found["time"].values, (Look("grey"), Look("blue"))
            bands = [Band(time, low, high, "5 to 95 %", tints[0]), Band(time, first, last, "25 to 75 %", tints[1])]
            fans.append(Panel([*bands, Line(time, middle, "median")], "", "time / s", label))
            continue
        ends = np.quantile(finite, list(QUANTILES.values())) / size if finite.size else ()
        texts = [f"{end:.5g} {unit}".strip() for end in ends] or ["-"] * len(QUANTILES)
        rows += [ShownValue(f"{name}, {q}", str(name), q, text) for q, text in zip(QUANTILES, texts, strict=True)]
        if finite.size < values.size:
            missed = f"{name} has no value in {values.size - finite.size} of {values.size} members"
            missing.append(Finding(f"{missed}: its row describes the others.", "open"))
        if finite.size and np.ptp(finite) > 0.0:
            number, edges = np.histogram(finite, BINS)
            middles = 0.5 * (edges[1:] + edges[:-1])
            bars = Bars(middles, number, thickness=edges[1] - edges[0])
            counts.append(Panel([bars], "", label, "members"))
    status = found["status"].values if "status" in found else np.zeros(found.sizes["member"])
    failed = np.flatnonzero(status)[:1]
    words = found["reason"].values if "reason" in found else ["see the table of members"] * status.size
    reasons = [Finding(f"member {i}: {words[i]}", "bad") for i in failed]
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
    """Return the view of sensitivities: the effect of each number on each output, with intervals and a bar chart."""
    numbers = found["number"].values.tolist()
    rows, leading, findings, panels = [], [], [], []
    for output in found["output"].values.tolist():
        own = found.sel(output=output)
        total = own["total"].values
        if not np.isfinite(total).any():
            findings.append(Finding(f"{output} does not vary with these numbers.", "open"))
            continue
        marks, positions = [], np.arange(len(numbers))
        for place, (name, color) in enumerate(DRAWN.items()):
            at = positions + 0.2 - 0.4 * place
            low, high = own[f"{name}_interval"].values
            marks.append(Bars(at, own[name].values, name, color, 0.35, across=True))
            marks += [Line(ends, (y, y)) for y, *ends in zip(at, low, high, strict=True)]
            for number, value, *ends in zip(numbers, own[name].values, low, high, strict=True):
                key = f"{output}, {number}, {name}"
                rows.append(ShownValue(key, f"{output}: {number}", name, value, "", tuple(ends)))
        at = int(np.nanargmax(total))
        row = rows[at - len(DRAWN) * len(numbers)]
        leading.append(replace(row, quantity=f"{output}, most by {numbers[at]}: total"))
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
