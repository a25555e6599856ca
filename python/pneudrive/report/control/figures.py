"""Figures of control: a run along its reference, a reference against its drive, laws over each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.report import style
from pneudrive.report.axes import legend_over, stack, zero_line
from pneudrive.report.written import drawn
from pneudrive.simulation.trajectory import check_si

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.control.motion import Reference
    from pneudrive.control.results.comparison import ControlComparison
    from pneudrive.control.tuning import Plant

MOST_DRAWN = 4000  # samples of a curve
MOST_IN_A_ROW = 4  # entries of a legend
FAR_APART = 20.0  # ratio of the largest errors of two laws beyond which their axis is logarithmic
SMALL_M = 5e-3  # largest error that is drawn in micrometres


def plot_control(run: xr.Dataset, path: str | Path | None = None) -> Figure:
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
    return drawn(lambda: _run(run), path)


def plot_reference(reference: Reference, plant: Plant, path: str | Path | None = None) -> Figure:
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
    return drawn(lambda: _reference(reference, plant), path)


def panels(count: int) -> tuple[Figure, list[Axes]]:
    """Return a figure of equal panels below each other, on one time axis."""
    return stack(1.2 * count + 0.5, [1] * count)


def _error_unit(errors_m: Sequence[Any]) -> tuple[float, str]:
    """Return factor and unit in which errors are drawn."""
    largest = max((float(np.abs(one).max()) for one in errors_m), default=0.0)
    return (1e6, "um") if largest < SMALL_M else (1e3, "mm")


def _run(run: xr.Dataset) -> Figure:
    check_si(run)
    figure, (track, error, pressure, command, force) = panels(5)
    part = style.thin(run.time, MOST_DRAWN)
    time = run.time.to_numpy()[part]
    known = {str(name): run[name].to_numpy()[part] for name in run.data_vars}
    track.plot(time, 1e3 * known["reference"], color=style.ORANGE, linestyle="--", label="reference")
    track.plot(time, 1e3 * known["position"], color=style.BLACK, label="position")
    track.set_ylabel("position / mm")
    off = known["reference"] - known["position"]
    factor, unit = _error_unit([off])
    error.plot(time, factor * off, color=style.BLACK)
    error.set_ylabel(f"error / {unit}")
    zero_line(error)
    pressure.plot(time, 1e-5 * known["pressure_a"], color=style.BLACK, label="chamber a")
    pressure.plot(time, 1e-5 * known["pressure_b"], color=style.ORANGE, linestyle="--", label="chamber b")
    pressure.set_ylabel("pressure / bar abs")
    command.plot(time, known["command"], color=style.BLACK, drawstyle="steps-post", lw=0.8)
    command.set_ylabel("command")
    force.plot(time, known["disturbance"], color=style.BLACK, lw=0.8)
    force.set_ylabel("disturbance / N")
    for axis in (track, pressure):
        legend_over(axis, 2)
    figure.align_ylabels()
    style.finish(figure, synthetic=True)
    track.set_title(f"a   {run.attrs.get('law', '')} on {run.attrs.get('title', 'a drive')}", loc="left")
    return figure


def _reference(reference: Reference, plant: Plant) -> Figure:
    figure, (position, velocity, acceleration) = panels(3)
    end_s = 4.0 / reference.frequency_hz if reference.is_sine else reference.duration_s
    time = np.linspace(0.0, end_s, MOST_DRAWN)
    x, v, a, _ = reference.at(time).T
    position.plot(time, 1e3 * x, color=style.BLACK)
    position.set_ylabel("position / mm")
    for end in (0.0, 1e3 * plant.stroke_m):
        position.axhline(end, color=style.GREY, linestyle="--")
    velocity.plot(time, v, color=style.BLACK)
    velocity.set_ylabel("velocity / (m/s)")
    for limit in (-plant.speed_m_s, plant.speed_m_s):
        velocity.axhline(limit, color=style.GREY, linestyle="--")
    acceleration.plot(time, a, color=style.BLACK)
    acceleration.set_ylabel("acceleration / (m/s$^2$)")
    figure.align_ylabels()
    style.finish(figure, synthetic=False)
    return figure


def tracks(found: ControlComparison, along: str) -> Figure:
    """Draw the laws' tracks over each other, and their errors, along one reference; the first seed of each law."""
    figure, (track, error) = stack(4.2, [1, 1])
    curves = []
    for number, law in enumerate(found.tunings):
        run = next((one for one in found.of(law, along) if one.score is not None), None)
        if run is not None:
            columns = run.columns("time_s", "position_m", "reference_m")
            part = style.thin(columns["time_s"], MOST_DRAWN)
            curves.append((law, style.look(number), {name: values[part] for name, values in columns.items()}))
    errors = [one["reference_m"] - one["position_m"] for *_, one in curves]
    factor, unit = _error_unit(errors)
    for (law, look, one), off in zip(curves, errors, strict=True):
        shown = {"color": look.color, "linestyle": look.linestyle, "lw": 0.9}
        track.plot(one["time_s"], 1e3 * one["position_m"], **shown, label=law)
        error.plot(one["time_s"], factor * off, **shown)
    if curves:
        one = curves[0][2]
        track.plot(one["time_s"], 1e3 * one["reference_m"], color="#c0392b", lw=0.6, label="reference")
    track.set_ylabel("position / mm")
    error.set_ylabel(f"error / {unit}")
    zero_line(error)
    _show_all(error, factor, errors)
    handles, labels = track.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=MOST_IN_A_ROW)
    figure.align_ylabels()
    return figure


def boxes(found: ControlComparison, along: str) -> Figure:
    """Draw the largest errors of all members along one reference, a box for each law."""
    figure = style.new_figure(0.5 + 0.34 * len(found.tunings))
    axis = figure.subplots()
    each = [[run.score.max_error_m for run in found.of(law, along) if run.score is not None] for law in found.tunings]
    factor, unit = _error_unit([np.asarray(one) for one in each if one])
    there = [place for place, one in enumerate(each, start=1) if one]  # a law whose runs are all lost has no box
    if there:
        axis.boxplot(
            [factor * np.asarray(one) for one in each if one],
            positions=there,
            orientation="horizontal",
            whis=(5, 95),
            medianprops={"color": style.ORANGE},
            flierprops={"marker": ".", "markersize": 3},
        )
        style.logarithmic(axis)
    axis.set_yticks(range(1, len(each) + 1), list(found.tunings))
    axis.set_ylim(len(each) + 0.5, 0.5)
    axis.set_xlabel(f"largest error / {unit}")
    return figure


def _show_all(axis: Axes, factor: float, errors_m: Sequence[Any]) -> None:
    """Make small errors visible next to large ones: a logarithmic axis on both sides of a linear part."""
    largest = [factor * float(np.abs(one).max()) for one in errors_m]
    if largest and max(largest) > FAR_APART * min(largest) > 0.0:
        axis.set_yscale("symlog", linthresh=10.0 ** np.floor(np.log10(min(largest))))
        axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
