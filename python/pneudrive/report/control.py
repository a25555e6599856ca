"""Figures of control, and the report of a benchmark of controllers."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.control.results.measures import written
from pneudrive.figures import MODEL, Axis, Figure, Line, Look, Panel, Rule, look, stack, thin
from pneudrive.report.page import Items, PageTable, Picture, Report
from pneudrive.report.render import box_marks, draw_figure
from pneudrive.report.tables import plural
from pneudrive.report.topics import Topic
from pneudrive.simulation.trajectory import check_si

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import matplotlib.figure
    import xarray as xr

    from pneudrive.control.motion import Reference
    from pneudrive.control.results.comparison import ControlComparison
    from pneudrive.control.tuning import Plant
    from pneudrive.report.page import Section

MOST_DRAWN = 4000  # samples of a curve
SMALL_M = 5e-3  # largest error that is drawn in micrometres
REFERENCE = Look("grey", "--")
REQUIRED = "required\nforce / N"


def plot_control(run: xr.Dataset, path: str | Path | None = None) -> matplotlib.figure.Figure:
    """Draw a run under control over time: position and reference, error, pressures, command, disturbance.

    Parameters
    ----------
    run : xarray.Dataset
        From `pneudrive.control.run`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    """
    check_si(run)
    time, known = _samples(run)
    off = known["reference"] - known["position"]
    pressures = [Line(time, known["pressure_a"], "chamber a"), Line(time, known["pressure_b"], "chamber b", MODEL)]
    panels = [
        Panel(
            [Line(time, known["reference"], "reference", MODEL), Line(time, known["position"], "position")],
            f"{run.attrs.get('law', '')} on {run.attrs.get('title', 'a drive')}",
            y="position / mm",
        ),
        Panel([Line(time, off), Rule(y=0.0)], y=f"error / {_error_unit([off])}"),
        Panel(pressures, y="pressure / bar abs"),
        Panel([Line(time, known["command"], width=0.8, steps=True)], y="command"),
        Panel([Line(time, known["disturbance"], width=0.8)], y="disturbance / N"),
    ]
    return draw_figure(_over_time(panels), path, synthetic=True)


def plot_reference(reference: Reference, plant: Plant, path: str | Path | None = None) -> matplotlib.figure.Figure:
    """Draw a reference with the stroke and the speed of its drive.

    Parameters
    ----------
    reference : Reference
    plant : Plant
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
    stroke = [Rule(y=end, look=REFERENCE, width=1.1) for end in (0.0, plant.stroke_m)]
    speed = [Rule(y=limit, look=REFERENCE, width=1.1) for limit in (-plant.speed_m_s, plant.speed_m_s)]
    panels = [
        Panel([Line(time, x), *stroke], y="position / mm"),
        Panel([Line(time, v), *speed], y="velocity / (m/s)"),
        Panel([Line(time, a)], y="acceleration / (m/s²)"),
    ]
    return draw_figure(_over_time(panels), path, synthetic=False)


def plot_pose(run: xr.Dataset, path: str | Path | None = None) -> matplotlib.figure.Figure:
    """Draw a platform under control over time: coordinates with references, errors, positions and forces of the legs.

    Parameters
    ----------
    run : xarray.Dataset
        From `pneudrive.control.run_pose`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    """
    check_si(run)
    time, known = _samples(run)
    score = run.attrs["score"]
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
    title = f"{run.attrs.get('law', '')} on {run.attrs.get('title', 'a platform')}"
    units = [label for label in ("place / mm", "tilt / deg") if label in coordinates]
    panels = [
        *(Panel(coordinates[label], title if label == units[0] else "", y=label) for label in units),
        Panel([*errors, Rule(y=0.0)], y="error / % of\namplitude"),
        Panel([Line(time, known[f"{leg}.position"], leg, own) for leg, own in legs.items()], y="leg / mm"),
        Panel(
            [Line(time, known[f"{leg}.required_force"], look=own) for leg, own in legs.items()], y="required\nforce / N"
        ),
    ]
    return draw_figure(_over_time(panels), path, synthetic=True)


def _samples(run: xr.Dataset) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return time and columns of a run, thinned."""
    part = thin(run.time, MOST_DRAWN)
    return run.time.to_numpy()[part], {str(name): run[name].to_numpy()[part] for name in run.data_vars}


def _over_time(panels: Sequence[Panel]) -> Figure:
    return stack(panels, 1.2 * len(panels) + 0.5, legend="over", entries=6)


def _error_unit(errors_m: Sequence[Any]) -> str:
    """Return the unit in which errors are drawn."""
    largest = max((float(np.abs(error).max()) for error in errors_m), default=0.0)
    return "um" if largest < SMALL_M else "mm"


def tracks_figure(found: ControlComparison, along: str) -> Figure:
    """Draw the laws' tracks over each other, and their errors, along one reference; the first seed of each law."""
    tracks, references, errors = [], [], []
    for number, law in enumerate(found.tunings):
        run = next((run for run in found.of(law, along) if run.score is not None), None)
        if run is not None:
            time, position, reference = run.columns("time_s", "position_m", "reference_m").values()
            part = thin(time, MOST_DRAWN)
            tracks.append(Line(time[part], position[part], law, look(number), 0.9))
            references.append(Line(time[part], reference[part], "reference", Look("red"), 0.6))
            errors.append(Line(time[part], (reference - position)[part], look=look(number), width=0.9))
    error = Axis(f"error / {_error_unit([line.y for line in errors])}", "far")
    return stack([Panel([*tracks, *references[:1]], y="position / mm"), Panel([*errors, Rule(y=0.0)], y=error)], 4.2)


def boxes_figure(found: ControlComparison, along: str) -> Figure:
    """Draw the largest errors of all members along one reference, a box for each law; none if all runs are lost."""
    each = [[run.score.max_error_m for run in found.of(law, along) if run.score is not None] for law in found.tunings]
    marks = [mark for position, values in enumerate(each) if values for mark in box_marks(position, values)]
    x = Axis(f"largest error / {_error_unit([np.asarray(values) for values in each if values])}", "log")
    laws = Axis(names=list(found.tunings), low=len(each) - 0.5, high=-0.5)
    return Figure([Panel(marks)], x, laws, row_in=0.5 + 0.34 * len(each), rest_in=0.0)


# --- report of a benchmark -------------------------------------------------------------------------------------------


def write_control_report(found: ControlComparison, folder: str | Path) -> Path:
    """Write report.html, which loads nothing from anywhere, and its figures as PNG and SVG.

    Parameters
    ----------
    found : ControlComparison
    folder : path-like
        Must be there.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    each = [_reference(found, number) for number in range(len(found.references))]
    parts = [_method(found), *each, _told(found), *_true(found)]
    title = f"{found.drive} under {plural(len(found.tunings), 'law')} of control"
    return Report(title, _verdict(found), parts, synthetic=True).write(folder)


def _verdict(found: ControlComparison) -> list[str]:
    lines = []
    for name, one in found.references.items():
        best = found.best(name)
        if best is not None:
            error = written("max_error_m", found.middle(best, name, "max_error_m"))
            lines.append(f"{_called(name, one.text)}: {best} has the smallest largest error, {error} (simulated).")
    failed = [run for run in found.runs if run.score is None]
    lines += [f"{run.law} along {run.reference}, seed {run.seed}, failed: {run.reason}" for run in failed[:3]]
    return lines


def _called(name: str, text: str) -> str:
    return text if name == text else f"{name} ({text})"


def _method(found: ControlComparison) -> Section:
    topic, setup = Topic("control", "method"), found.setup
    count = len({run.seed for run in found.runs})
    each = plural(count, "member") if found.spread else f"{plural(count, 'seed')} of noise"
    lines = [f"{each} for each law and reference"]
    lines.append(topic.say("about" if setup.about else "setup", name=found.setup_name, about=setup.about))
    for name, tuning in found.tunings.items():
        if tuning.belief.name != found.drive:
            lines.append(topic.say("believes", law=name, drive=tuning.belief.name))
    if found.mismatch:
        lines.append(topic.say("mismatch", mismatch=found.mismatch))
    if found.spread:
        lines.append(topic.say("spread", spread=found.spread))
    return topic.section(topic.text(), Items(tuple(lines)))


def _reference(found: ControlComparison, number: int) -> Section:
    """Show the scores along one reference; of a spread the fractions of its members, and a box for each law."""
    topic, name = Topic("control", "reference"), list(found.references)[number]
    said: dict[str, Any] = {"called": _called(name, found.references[name].text), "spread": found.spread}
    pictures = []
    if found.spread:
        pictures.append(Picture(f"boxes-{number + 1}", topic.say("boxes", **said), boxes_figure(found, name)))
    heads, rows = found.table(name, spread=bool(found.spread))
    table = PageTable(tuple(heads), tuple(map(tuple, rows)), topic.say("members" if found.spread else "seeds", **said))
    caption = topic.say("tracks", which="member 1" if found.spread else "first seed", **said)
    pictures.append(Picture(f"tracks-{number + 1}", caption, tracks_figure(found, name)))
    return replace(topic.section(table, *pictures, **said), key=f"reference-{number + 1}")


def _true(found: ControlComparison) -> list[Section]:
    """Describe the true values that differ from the assumed ones: least and largest over all members."""
    each: dict[str, list[float]] = {}
    for run in found.runs:
        for name, value in run.truth.items():
            each.setdefault(name, []).append(value)
    topic, rows = Topic("control", "true"), ((name, min(values), max(values)) for name, values in each.items())
    return [topic.section(topic.text(), topic.table(rows))] if each else []


def _told(found: ControlComparison) -> Section:
    """Describe each controller: its gains with their rules, and the drive that it assumes."""
    rows = (
        (name, gain.key, str(gain), gain.meaning, "given" if gain.given else gain.rule)
        for name, tuning in found.tunings.items()
        for gain in tuning.gains
    )
    topic, first = Topic("control", "told"), next(iter(found.tunings.values()))
    return topic.section(topic.table(first.plant.rows(), "plant"), topic.table(rows, "gains"), synthetic=False)
