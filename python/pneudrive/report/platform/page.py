"""A run of a platform on a page: its drawing, and pose, legs, pressures and forces as small multiples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.platforms.outputs import motion_of, platform_outputs, pose_columns
from pneudrive.report import style
from pneudrive.report.page import PageTable, Picture, Report, Section
from pneudrive.report.platform.figures import frame_axis, put_scene
from pneudrive.report.platform.scene import platform_scene
from pneudrive.simulation.trajectory import check_target, columns_in, read_columns, whole

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from pneudrive.platforms.kinematics import Platform

    Array = NDArray[np.float64]

ROW_IN = 1.35  # height of a row of panels
MOST_POSES = 400  # of a path
MOST_SAMPLES = 4000  # of a curve
RANGE_HEAD = ("", "quantity", "least", "most")
#: Panels of legs: label, factor from SI, and the form of its columns.
LEG_PANELS = (
    ("position / mm", 1e3, "{leg}.position_m"),
    ("pressure a / bar abs", 1e-5, "{leg}.a.pressure_pa"),
    ("pressure b / bar abs", 1e-5, "{leg}.b.pressure_pa"),
    ("leg force / N", 1.0, "{platform}.leg_{i}_force_n"),
    ("side force / N", 1.0, "{platform}.leg_{i}_side_force_n"),
)


def run_columns(platform: Platform) -> list[str]:
    """Return the columns of a run that the pictures of a platform use, time first."""
    legs = [row for row in LEG_PANELS if row[2].startswith("{leg}")]
    own = [end.format(leg=leg.name) for _, _, end in legs for leg in platform.legs]
    return ["time_s", *(name for row in pose_columns(platform) for name in row), *own]


def read_platform_run(platform: Platform, path: str | Path) -> dict[str, Array]:
    """Return the columns of a file of a run that the pictures of a platform use.

    Raises
    ------
    RecordingError
        The file does not exist or is damaged.
    CommandError
        It is not a run of this platform.
    """
    found = read_columns(path, columns_in(path, run_columns(platform)))
    motion_of(platform, found)
    return found


def write_platform_page(platform: Platform, columns: Mapping[str, Array], path: str | Path) -> Path:
    """Write a page of a run of a platform, which loads nothing.

    Parameters
    ----------
    platform : Platform
    columns : mapping
        Columns of the run, SI.
    path : path-like
        .html.

    Raises
    ------
    CommandError
        The run has no column of this platform, or the file cannot be written.
    """
    target = check_target(path, (".html",))
    with style.applied(), whole(target) as temporary:
        part = platform_section(platform, columns)
        time = columns["time_s"]
        lines = [f"{len(time)} samples from {time[0]:g} s to {time[-1]:g} s."]
        report = Report(f"Run of {platform.name}", lines, [part], synthetic=True)
        temporary.write_text(report.alone(), encoding="utf-8")
    return target


def run_ranges(platform: Platform, columns: Mapping[str, Array]) -> list[tuple[str, str, str, str]]:
    """Return name, quantity, least and largest value of each curve of a run with its outputs."""
    rows = []
    for label, factor, each in _panels(platform, columns):
        for name, curve in each.items():
            ends = (round(factor * float(end), 6) + 0.0 for end in (curve.min(), curve.max()))
            rows.append((name, label, *(f"{end:.4g}" for end in ends)))
    return rows


def platform_section(platform: Platform, columns: Mapping[str, Array]) -> Section:
    """Return the drawing of a run, its curves, and the range of each."""
    found = {**columns, **platform_outputs(platform, columns)}
    caption = f"{platform.name} at the end of the run with the path of its origin, and the curves of the run."
    picture = Picture(platform.name, caption, _figure(platform, found))
    table = PageTable(RANGE_HEAD, tuple(run_ranges(platform, found)), "Ranges of the run", numbers_from=2)
    return Section("platform", f"Platform {platform.name}", (picture, table))


def _panels(platform: Platform, columns: Mapping[str, Array]) -> list[tuple[str, float, dict[str, Array]]]:
    """Return label, factor from SI, and named curves of each panel."""
    pose, units = pose_columns(platform)[0], platform.units
    panels = []
    for label, factor, unit in (("place / mm", 1e3, "m"), ("tilt / deg", float(np.degrees(1.0)), "rad")):
        each = {platform.coordinates[k]: np.asarray(columns[pose[k]]) for k, own in enumerate(units) if own == unit}
        panels.append((f"{next(iter(each))} / mm" if len(each) == 1 else label, factor, each))
    smallest = columns[f"{platform.name}.smallest_singular_value"]
    panels.append(("smallest singular value", 1.0, {platform.name: smallest}))
    for label, factor, end in LEG_PANELS:
        legs = enumerate((leg.name for leg in platform.legs), start=1)
        names = {leg: end.format(platform=platform.name, i=i, leg=leg) for i, leg in legs}
        panels.append((label, factor, {leg: columns[name] for leg, name in names.items() if name in columns}))
    return [panel for panel in panels if panel[2]]


def _figure(platform: Platform, columns: Mapping[str, Array]) -> Figure:
    time = np.asarray(columns["time_s"])
    panels = _panels(platform, columns)
    count = -(-len(panels) // 2)
    figure = style.new_figure(ROW_IN * count)
    grid = figure.add_gridspec(count, 3, width_ratios=(1.15, 1.0, 1.0))
    pose = motion_of(platform, columns)[0]
    scene = platform_scene(platform, pose[np.unique(np.linspace(0, len(pose) - 1, MOST_POSES).round().astype(int))])
    drawing = figure.add_subplot(grid[:, 0])
    frame_axis(drawing, scene)
    drawing.set_aspect("equal", anchor="N")
    put_scene(drawing, scene, scale=0.6)
    part, legs = style.thin(time, MOST_SAMPLES), {leg.name for leg in platform.legs}
    for k, (label, factor, each) in enumerate(panels):
        axis = figure.add_subplot(grid[k // 2, 1 + k % 2])
        for i, (name, values) in enumerate(each.items()):
            color, line, _ = style.look(i)
            axis.plot(time[part], factor * values[part], color=color, linestyle=line, lw=1.0, label=name)
        axis.set_title(label)
        axis.margins(x=0)
        if legs.issuperset(each):
            columns_of = {"ncols": 3, "loc": "upper left", "bbox_to_anchor": (0.0, 0.0), "columnspacing": 1.0}
            drawing.legend(*axis.get_legend_handles_labels(), **columns_of)
        elif len(each) > 1:
            style.headroom(axis, above=0.35)
            axis.legend(loc="upper right", ncols=len(each), handlelength=1.4, columnspacing=0.8, borderaxespad=0.0)
        if k >= len(panels) - 2:
            axis.set_xlabel("time / s")
        else:
            axis.tick_params(labelbottom=False)
    return figure
