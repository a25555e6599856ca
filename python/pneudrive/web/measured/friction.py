"""Friction maps and fits for the page: points, curves, cuts, differences, residuals, next points."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from posixpath import basename, dirname, join
from typing import Annotated, Literal

import numpy as np
import polars as pl
import xarray as xr
from pydantic import Field, FiniteFloat

from pneudrive.arrays import Array, Ints, Plain
from pneudrive.campaign.planning.next_points import limits_of
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.figures import Axis, Figure, Line, Panel
from pneudrive.friction.friction_map import SAME_PA, alike, bar, groups_of, read_map
from pneudrive.identify.design import next_measurements
from pneudrive.identify.files import AnyFit, read_fit
from pneudrive.identify.identified import comparison_figure
from pneudrive.identify.static.fit import fit_file
from pneudrive.identify.static.result import PROBABILITIES, FrictionFit, SlidingFit, ellipses, profiles, with_map
from pneudrive.rig.rig_file import load_rig
from pneudrive.units import readable
from pneudrive.views import ShownFigure, View
from pneudrive.web.jobs import RIG
from pneudrive.web.messages import bounded, python, shell
from pneudrive.web.results import FIT, SAME, Lineage
from pneudrive.web.workspace import DESCRIPTIONS, Workspace

MAPS = (".parquet", ".csv")
MOST_POINTS = 10_000
MOST_CURVES = 8  # of each seal, mounting and drive: as many as there are line styles
MOST_NEXT = 200  # largest number of proposed points
SPEEDS = 120  # points of a curve
PROFILES = (
    "Interval of each value at every probability, by profile likelihood: all other values are fitted again at each "
    "point. If the curve of a side ends below 95 %, the data do not limit the value on this side."
)
ELLIPSES = (
    "Ellipses of first order; their projections are 95 % intervals. If a profile is asymmetric, trust the profile and "
    "not the ellipse."
)
Speed = Annotated[FiniteFloat, Field(gt=0.0)]  # m/s
NEAR = 0.05  # speeds that differ by less, relatively, are one speed


def fits_of(path: Path, fit_name: str, names: list[str]) -> tuple[dict[str, FrictionFit], str]:
    """Return the fit of each assembly, and reasons for missing fits.

    If a map has several assemblies, the default name stands for one file per assembly. Any other name is the fit of one
    seal, mounting or drive.
    """
    files = {name: fit_file(name) for name in names if fit_name in (FIT, fit_file(name))}
    if len(names) == 1:
        files = {names[0]: fit_name}
    if not files:
        return {}, f"{fit_name} is a fit over several seals or mountings: its curve belongs to none of them."
    fits, reasons = {}, []
    for name, file in files.items():
        if (path.parent / file).is_file():
            try:
                fits[name] = FrictionFit.from_toml(path.parent / file)
            except PneudriveError as error:  # another kind of fit has no curve over speed
                reasons.append(f"{file}: {error.what}.")
        else:
            reasons.append(f"There is no {file} next to the map.")
    return fits, " ".join(dict.fromkeys(reasons))


def shown_map(workspace: Workspace, path: str, fit: str) -> Plain:
    """Return a friction map with the curves of its fit, and the recordings found in the workspace.

    Raises
    ------
    CommandError
        The fit is not next to the map.
    RecordingError
        The file is not a friction map.
    """
    fits = [file.path for file in workspace.files() if file.kind == "fit" and dirname(file.path) == dirname(path)]
    if fit and fit not in fits:
        raise CommandError(f"there is no fit {fit[:80]} next to the map")
    found = drawn_map(workspace.path(path, MAPS), basename(fit) or FIT)
    names = dict.fromkeys(group["assembly"] for group in found["groups"])
    files = {name: join(dirname(path), fit_file(name) if len(names) > 1 else FIT) for name in names}
    seals = {name: file if file in fits else "" for name, file in files.items()}
    recordings = {edge.name: edge.path for edge in Lineage(workspace).edges(path) if edge.path}
    return {**found, "fits": fits, "seals": seals, "recordings": recordings}


def _drawn_groups(path: Path, fit_name: str) -> tuple[xr.Dataset, list[Plain], dict[str, FrictionFit], str]:
    """Return a map, its groups as plain data, the fit of each assembly, and reasons for missing fits."""
    table = read_map(path)
    found = groups_of(table, MOST_POINTS)
    names = list(dict.fromkeys(group.assembly for group in found))
    found.sort(key=lambda group: (names.index(group.assembly), *group.gauges))
    groups = [
        {
            "assembly": group.assembly,
            "gauges": group.gauges.tolist(),
            "label": f"{group.assembly}: {group.label}" if len(names) > 1 else group.label,
            "points": _points(table, group.rows),
        }
        for group in found
    ]
    return table, groups, *fits_of(path, fit_name, names)


def drawn_map(path: Path, fit_name: str = FIT) -> Plain:
    """Return the points of a map, grouped by assembly and pair of chamber pressures, and the curves of its fits.

    Each curve belongs to the fit of one seal, mounting and drive. A fit over several seals, mountings or drives has no
    curve.

    Raises
    ------
    RecordingError
        The file is not a friction map.
    """
    table, groups, fits, why = _drawn_groups(path, fit_name)
    ends = np.abs(table["velocity_m_s"].to_numpy())
    slowest, fastest = ends.min(), ends.max()
    speeds = np.geomspace(slowest, fastest, SPEEDS) if slowest < fastest else ends[:1]
    curves = Counter[str]()
    for group in groups:
        fit = fits.get(group["assembly"])
        curves[group["assembly"]] += 1
        if fit is not None and curves[group["assembly"]] <= MOST_CURVES:
            own = [point["x"] for point in group["points"]]
            group["curve"] = _curve(fit, speeds, own, speeds, *group["gauges"])
    return {
        "groups": groups,
        "fit": why,
        "left_out": max(int(table.sizes["row"]) - MOST_POINTS, 0),
    }


def map_slice(workspace: Workspace, path: str, fit: str, speed: Literal["all"] | Speed) -> Plain:
    """Return friction over the gauge pressure of one chamber, for each pressure of the other.

    Parameters
    ----------
    workspace : Workspace
    path : str
        Name of the map.
    fit : str
        Name of the fit, next to the map, whose curves are drawn.
    speed : float or "all"
        Speed in m/s; only points within `NEAR` of this speed are used. "all": all points are used, and a curve is drawn
        at the mean speed of the assembly.

    Raises
    ------
    RecordingError
        The file is not a friction map.
    """
    fit_name, chosen_m_s = basename(fit) or FIT, None if speed == "all" else speed
    _, drawn, fits, _ = _drawn_groups(workspace.path(path, MAPS), fit_name)
    along = int(np.diff(np.ptp([group["gauges"] for group in drawn], axis=0))[0] >= 0.0)
    names = list(dict.fromkeys(group["assembly"] for group in drawn))
    groups, levels = [], []
    for name in names:
        part = [group for group in drawn if group["assembly"] == name]
        gauges = np.array([group["gauges"] for group in part])
        speeds = [point["x"] for group in part for point in group["points"]]
        speed_m_s = chosen_m_s or float(np.exp(np.mean(np.log(speeds))))
        for inside in alike(gauges[:, [1 - along]]):
            points = [
                {**point, "x": part[k]["gauges"][along], "speed": point["x"]}
                for k in inside
                for point in part[k]["points"]
                if chosen_m_s is None or abs(np.log(point["x"] / speed_m_s)) <= NEAR
            ]
            other = float(gauges[inside, 1 - along].mean())
            title = f"{name}: " if len(names) > 1 else ""
            label = f"{title}chamber {'ba'[along]} at {bar(other)} bar gauge"
            group: Plain = {"assembly": name, "label": label, "points": points, "speed": speed_m_s}
            groups.append(group)
            reach = gauges[inside, along]
            if name in fits and np.ptp(reach) > SAME_PA:
                over = np.linspace(reach.min(), reach.max(), SPEEDS)
                pair = (over, other) if along == 0 else (other, over)
                known = [point["x"] for point in points] or [np.inf, -np.inf]
                group["curve"] = _curve(fits[name], over, known, np.full(SPEEDS, speed_m_s), *pair)
                file = fit_file(name) if len(names) > 1 else fit_name
                ends = float(reach.min()), float(reach.max())
                levels.append((join(dirname(path), file), speed_m_s, other, *ends))
    ends = ", ".join([f"np.linspace(low, high, {SPEEDS})", "other"][:: 1 - 2 * along])
    lines = python("slice", other="ba"[along], along="ab"[along], levels=levels, ends=ends) if levels else ""
    return {"chamber": "ab"[along], "groups": groups, "python": lines}


def _curve(fit: FrictionFit, x: Array, measured: list[float], *at: Array | float) -> Plain:
    """Return the friction of a fit with its interval, over speed or over a gauge pressure."""
    curve = fit.predict(*at)
    columns = {"x": x, "y": curve.friction_n, "low": curve.lower_n, "high": curve.upper_n}
    return {name: values.tolist() for name, values in columns.items()} | {"measured": [min(measured), max(measured)]}


def _points(table: xr.Dataset, rows: Ints) -> list[Plain]:
    part = {str(name): column.to_numpy() for name, column in table.isel(row=rows).items()}
    columns = {name: part[name] for name in ("recording", "direction", "flags")}
    columns |= {"x": np.abs(part["velocity_m_s"]), "y": part["friction_n"]}
    columns["spread"] = 2.0 * np.hypot(part["stderr_n"], part["u_systematic_n"])  # U, k = 2
    return pl.DataFrame(columns).with_columns(pl.col("spread").fill_nan(None)).to_dicts()


def behind_fit(workspace: Workspace, path: str) -> Plain:
    """Return details of a fit as a view: confidence ellipses; if its map exists, also residuals and profiles.

    Raises
    ------
    FitError
        The file is not a fit.
    """
    fit = read_fit(workspace.path(path, DESCRIPTIONS))
    figures, panels = [], []
    for (x_name, y_name), correlation, points in ellipses(fit) if fit.covariance.size and fit.intervals else ():
        (x_size, x), (y_size, y) = _axis(fit, x_name), _axis(fit, y_name)
        line = Line(*(points / [x_size, y_size]).T)
        panels.append(Panel([line], f"{y_name} over {x_name}: correlation {correlation:.2g}", x, y))
    if panels:
        figures.append(ShownFigure("Values that change together", ELLIPSES, Figure(panels, columns=3)))
    edge = next(iter(Lineage(workspace).edges(path)), None) if isinstance(fit, SlidingFit) else None
    why, lines = "", {}
    if not isinstance(fit, SlidingFit):
        why = f"The {fit.TITLE} stores no samples. Validation compares it with its recordings."
    elif edge is None or edge.state != SAME:
        why = "Residuals and profiles need the map of the fit, but this map was removed or changed."
    else:
        table = read_map(workspace.path(edge.path))
        copied = ""
        if isinstance(fit, FrictionFit) and fit.model.knee_pa is None:
            copied = "ends = profiles(fit, curves)\n"
            panels = []
            percent = [*(100.0 * p for p in reversed(PROBABILITIES)), 0.0, *(100.0 * p for p in PROBABILITIES)]
            for name, ends in profiles(fit, table).items():
                size, axis = _axis(fit, name)
                at = np.array([*ends[::-1, 0], fit.free_values()[name], *ends[:, 1]]) / size
                known = np.isfinite(at)  # an open end is left out
                line = Line(at[known], np.array(percent)[known])
                panels.append(Panel([line], f"Profile of {name}", axis, "probability of the interval, %"))
            figures.insert(0, ShownFigure("Profiles", PROFILES, Figure(panels, columns=3)))
        compared = comparison_figure(with_map(fit, table).compared())
        figures.insert(0, ShownFigure("Friction and residuals over speed", "", compared))
        lines["command"] = shell("report", path, map=edge.path, out=f"{path.removesuffix('.toml')}-report")
        lines["python"] = python("fit", map=edge.path, fit=path, profiles=copied)
    return {"designs": isinstance(fit, FrictionFit), "view": View(why, figures=figures).data(), **lines}


def _axis(fit: AnyFit, name: str) -> tuple[float, Axis]:
    """Return the size in SI of the unit in which a value is shown, and the axis in this unit."""
    size, unit = readable(fit.units[name])
    return size, Axis(name if unit in ("", "1") else f"{name} / {unit}", is_si=False)


def next_points(
    workspace: Workspace,
    path: str,
    points: Annotated[int | None, bounded(1, MOST_NEXT, f"1 to {MOST_NEXT}, or none")] = None,
) -> Plain:
    """Return the next points to measure for a fit on the simulated rig, with their expected benefit.

    Raises
    ------
    FitError
        The file is not the fit of a friction map, or the number of points is below 1.
    """
    fit = FrictionFit.from_toml(workspace.path(path, DESCRIPTIONS))
    rig = load_rig(RIG)
    plan = next_measurements(fit, limits_of(fit, rig.identity(), rig.limits()), points=points)
    return {
        "view": plan.view().data(),
        "command": shell("design", path, rig=RIG, points=points),
        "python": "import pneudrive as pn\n" + python("design", fit=path, rig=RIG, points=points) + "\n",
    }
