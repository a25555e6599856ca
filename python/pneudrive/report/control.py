"""Figures of control, and the report of a benchmark of controllers."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.control.pose.path import PoseScore
from pneudrive.control.scores import view_of_score, written
from pneudrive.figures import MODEL, Axis, Figure, Line, Look, Panel, Rule, look, stack, thin
from pneudrive.report.page import Topic, plural, view_report
from pneudrive.report.render import DrawnFigure, box_marks, draw_figure
from pneudrive.simulation.trajectory import attributes, check_si
from pneudrive.views import MOST_LEADING, Finding, ShownFigure, ShownValue, View

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence
    from pathlib import Path

    import xarray as xr

    from pneudrive.arrays import Array, Columns, Keyed, Plain
    from pneudrive.control.benchmarks import ControlComparison, ControlledRun
    from pneudrive.control.motion import Reference
    from pneudrive.control.tuning import Tuning

MOST_DRAWN = 4000  # samples of a curve
SMALL_M = 5e-3  # largest error that is drawn in micrometres
REFERENCE = Look("grey", "--")


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


def view_of_controlled_run(run: xr.Dataset) -> View:
    """Return the view of a run under control, of an axis or a platform: score, events and picture."""
    about = attributes(run)
    is_pose = "coordinates" in about["score"]
    view = PoseScore.read(about["score"]).view(about) if is_pose else view_of_score(about)
    return replace(view, figures=(ShownFigure("control", f"{view.title}.", run_figure(run)),))


def run_figure(run: xr.Dataset) -> Figure:
    """Draw a run under control over time."""
    check_si(run)
    part = thin(run.time, MOST_DRAWN)
    time = run.time.to_numpy()[part]
    known = {str(name): run[name].to_numpy()[part] for name in run.data_vars}
    title = f"{run.attrs.get('law', '')} on {run.attrs.get('title', 'a drive')}"
    score = attributes(run).get("score", {})
    panels = _pose_panels(time, known, score, title) if "coordinates" in score else _axis_panels(time, known, title)
    return _over_time(panels)


def _axis_panels(time: Array, known: Columns, title: str) -> list[Panel]:
    off = known["reference"] - known["position"]
    pressures = [Line(time, known["pressure_a"], "chamber a"), Line(time, known["pressure_b"], "chamber b", MODEL)]
    return [
        Panel(
            [Line(time, known["reference"], "reference", MODEL), Line(time, known["position"], "position")],
            title,
            y="position / mm",
        ),
        Panel([Line(time, off), Rule(y=0.0)], y=f"error / {error_unit([off])}"),
        Panel(pressures, y="pressure / bar abs"),
        Panel([Line(time, known["command"], width=0.8, steps=True)], y="command"),
        Panel([Line(time, known["disturbance"], width=0.8)], y="disturbance / N"),
    ]


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
    time = np.linspace(0.0, end_s, MOST_DRAWN)
    x, v, a, _ = reference.at(time).T
    out, back = tuning.speeds_m_s
    limits = (0.0, tuning.plant.stroke_m), (-back, out)
    stroke, speed = ([Rule(y=limit, look=REFERENCE, width=1.1) for limit in pair] for pair in limits)
    panels = [
        Panel([Line(time, x), *stroke], y="position / mm"),
        Panel([Line(time, v), *speed], y="velocity / (m/s)"),
        Panel([Line(time, a)], y="acceleration / (m/s²)"),
    ]
    return draw_figure(_over_time(panels), path, synthetic=False)


def _over_time(panels: Sequence[Panel]) -> Figure:
    return stack(panels, 1.2 * len(panels) + 0.5, legend="over", entries=6)


def error_unit(errors_m: Sequence[Any]) -> str:
    """Return the unit in which errors are drawn."""
    largest = max((np.abs(error).max() for error in errors_m if len(error)), default=0.0)
    return "um" if largest < SMALL_M else "mm"


def gain_rows(laws: Keyed) -> Iterator[tuple[str, ...]]:
    """Yield the rows of a table of gains: law, key, value, meaning and rule of each."""
    for law, tuning in laws.items():
        yield from ((law, *(gain[key] for key in ("key", "written", "meaning", "rule"))) for gain in tuning["gains"])


# --- a benchmark of controllers --------------------------------------------------------------------------------------


def controllers_view(found: ControlComparison, measures: Collection[str] = ()) -> View:
    """Return the view of a benchmark. `measures` selects the columns of its table, by default all."""
    topic, leading, failed = Topic("control", "reference"), [], [run for run in found.runs if run.score is None]
    for along, text in found.references.items():
        best = found.best(along)
        if best is not None:
            error = written("max_error_m", found.middle(best, along, "max_error_m"))
            said = topic.say("best", called=_called(along, text), law=best)
            leading.append(ShownValue(f"{along}.best", along, said, error))
    ended = Counter((run.law, run.reason) for run in failed).items()
    findings = [
        Finding(f"{plural(count, 'run')} of {law} ended early: {reason}", "bad") for (law, reason), count in ended
    ]
    total = found.count * len(found.references) * len(found.laws)
    if not found.is_finished:
        findings.append(Finding(f"{len(found.runs)} of {total} runs are done.", "open", "Repeat the command."))
    truth = ((name, *ends) for name, ends in found.truth.items())
    return View(
        f"{found.drive} under {plural(len(found.laws), 'law')} of control, {plural(len(found.runs), 'simulated run')}",
        [value for along in found.references for value in found.values(along, measures)],
        notes=tuple(_conditions(found)),
        state="bad" if failed else "good" if found.is_finished else "open",
        leading=leading[:MOST_LEADING],
        findings=findings,
        tables=(Topic("control", "true").table(truth),) if found.truth else (),
        figures=tuple(
            figure for number in range(len(found.references)) for figure in _reference_figures(found, number)
        ),
    )


def _called(name: str, text: str) -> str:
    return text if name == text else f"{name} ({text})"


def _conditions(found: ControlComparison) -> Iterator[str]:
    """Yield the differences between the runs, and between the true drive and the assumed one."""
    topic, setup = Topic("control", "method"), str(found.about.get("setup_about", ""))
    each = plural(found.count, "member") if found.spread else f"{plural(found.count, 'seed')} of noise"
    yield topic.say("members" if found.spread else "seeds", each=each)
    yield topic.say("about" if setup else "setup", name=found.setup, about=setup)
    for name, tuning in found.about["laws"].items():
        if tuning["believes"] != found.drive:
            yield topic.say("believes", law=name, drive=tuning["believes"])
    if found.mismatch:
        yield topic.say("mismatch", mismatch=found.mismatch)
    if found.spread:
        yield topic.say("spread", spread=found.spread)


def _reference_figures(found: ControlComparison, number: int) -> Iterator[ShownFigure]:
    """Yield the errors of all members of a spread as one box per law, and the tracks of all laws in one picture."""
    topic, along = Topic("control", "reference"), list(found.references)[number]
    said: Plain = {"called": _called(along, found.references[along]), "spread": found.spread}
    each = [[run.score.max_error_m for run in found.of(law, along) if run.score is not None] for law in found.laws]
    if found.spread and any(each):
        marks = [mark for position, values in enumerate(each) if values for mark in box_marks(position, values)]
        x = Axis(f"largest error / {error_unit(each)}", "log")
        laws = Axis(names=found.laws, low=len(each) - 0.5, high=-0.5)
        figure = Figure([Panel(marks)], x, laws, row_in=0.5 + 0.34 * len(each), rest_in=0.0)
        yield ShownFigure(f"boxes-{number + 1}", topic.say("boxes", **said), figure)
    tracks, references, errors = [], [], []
    for run, columns in tracks_of(found, along):
        part, own = thin(columns["time_s"], MOST_DRAWN), look(found.laws.index(run.law))
        time, position, reference, error = (values[part] for values in columns.values())
        tracks.append(Line(time, position, run.law, own, 0.9))
        references.append(Line(time, reference, "reference", Look("red"), 0.6))
        errors.append(Line(time, error, look=own, width=0.9))
    if tracks:
        error = Axis(f"error / {error_unit([line.y for line in errors])}", "far")
        positions = Panel([*tracks, *references[:1]], y="position / mm")
        panels = [positions, Panel([*errors, Rule(y=0.0)], y=error)]
        caption = topic.say("tracks", which="member 1" if found.spread else "first seed", **said)
        yield ShownFigure(f"tracks-{number + 1}", caption, stack(panels, 4.2))


def tracks_of(found: ControlComparison, along: str) -> Iterator[tuple[ControlledRun, Columns]]:
    """Yield the first run of each law along a reference that has a file: time, position, reference and error, SI."""
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
