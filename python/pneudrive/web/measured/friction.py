"""Friction maps and fits as the page draws them."""

from __future__ import annotations

import shlex
from collections import Counter
from posixpath import basename, dirname
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import CommandError
from pneudrive.friction.friction_map import AMBIENT, read_map
from pneudrive.friction.sentences import flag_sentences
from pneudrive.identify.files import common, curve_differences
from pneudrive.identify.static.fit import fit_file
from pneudrive.identify.static.result import FrictionFit
from pneudrive.views import ShownCurve, View
from pneudrive.web.lineage import recordings_of_map
from pneudrive.web.measured.map_fits import FIT, assemblies_of, fits_of
from pneudrive.web.requests import WRONG_REQUEST
from pneudrive.web.workspace import safe

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import xarray as xr

    from pneudrive.identify.static.result import Prediction
    from pneudrive.web.workspace import Workspace

MAPS = (".parquet", ".csv")
MOST_POINTS = 10_000
MOST_CURVES = 8  # of each seal, mounting and drive: as many as there are line styles
HEAT_COLUMNS, HEAT_ROWS = 24, 60
SPEEDS = 120  # points of a curve
NEAR = 0.05  # speeds that differ by less, relatively, are one speed
SAME_PA = 1e4  # chamber pressures that differ by less make one curve


def shown_map(workspace: Workspace, name: str, fit: str) -> dict[str, Any]:
    """Return a friction map with the curves of its fit, and which recordings are in the workspace.

    Raises
    ------
    CommandError
        The fit is not next to the map.
    RecordingError
        The file is not a friction map.
    """
    fits = [one.path for one in workspace.files() if one.kind == "fit" and dirname(one.path) == dirname(name)]
    if fit and fit not in fits:
        raise CommandError(f"there is no fit {fit[:80]} beside the map")
    found = drawn_map(workspace.path(name, MAPS), basename(fit) or FIT)
    return {**found, "fits": fits, "recordings": recordings_of_map(workspace, name)}


def drawn_map(path: Path, fit_name: str = FIT) -> dict[str, Any]:
    """Return the points of a map, in groups of one assembly and pair of chamber pressures, with curves of fits.

    Each curve belongs to the fit of one seal, mounting and drive. A fit over several seals, mountings or drives has no
    curve.

    Raises
    ------
    RecordingError
        The file is not a friction map.
    """
    found = read_map(path)
    ambient = float(found.attrs.get(AMBIENT, STANDARD_ATMOSPHERE_PA))
    rows = np.arange(min(found.sizes["row"], MOST_POINTS))
    pairs = _pressures(found, rows) - ambient
    assemblies = assemblies_of(found, rows)
    names = list(dict.fromkeys(assemblies.tolist()))
    groups = []
    for name in names:
        own = np.flatnonzero(assemblies == name)
        for inside in (own[part] for part in alike(pairs[own])):
            gauges = pairs[inside].mean(axis=0)
            label = f"{name}: {_label(gauges)}" if len(names) > 1 else _label(gauges)
            points = _points(found, rows[inside])
            groups.append({"assembly": name, "gauges": gauges.tolist(), "label": label, "points": points})
    groups.sort(key=lambda one: (names.index(one["assembly"]), *one["gauges"]))
    fits, why = fits_of(path, fit_name, names)
    ends = np.abs(found["velocity_m_s"].to_numpy())
    speeds = np.geomspace(ends.min(), ends.max(), SPEEDS) if ends.min() < ends.max() else ends[:1]
    curves = Counter[str]()
    for group in groups:
        fit = fits.get(group["assembly"])
        curves[group["assembly"]] += 1
        if fit is not None and curves[group["assembly"]] <= MOST_CURVES:
            predicted = fit.predict(speeds, *group["gauges"])
            own = [one["speed"] for one in group["points"]]
            group["curve"] = {
                "speed": speeds.tolist(),
                **_band(predicted),
                "measured": [min(own), max(own)],
            }
    return {
        "groups": groups,
        "heat": _heat(groups, fits),
        "fit": why,
        "left_out": int(found.sizes["row"] - len(rows)),
        "flags": flag_sentences(flag for text in found["flags"].to_numpy() for flag in str(text).split(",")),
    }


def view_of_map(workspace: Workspace, path: str) -> View:
    """Return friction over speed, a curve of measured points for each assembly and pair of pressures."""
    found = read_map(workspace.path(path, MAPS))
    rows = np.arange(min(found.sizes["row"], MOST_POINTS))
    ambient = float(found.attrs.get(AMBIENT, STANDARD_ATMOSPHERE_PA))
    pairs, assemblies = _pressures(found, rows) - ambient, assemblies_of(found, rows)
    speed, friction = np.abs(found["velocity_m_s"].to_numpy()), found["friction_n"].to_numpy()
    reach = 2.0 * np.hypot(found["stderr_n"].to_numpy(), found["u_systematic_n"].to_numpy())  # U, k = 2
    curves = []
    for name in dict.fromkeys(assemblies.tolist()):
        own = np.flatnonzero(assemblies == name)
        for inside in (own[part] for part in alike(pairs[own])):
            part = inside[np.argsort(speed[inside], kind="stable")]
            label = _label(pairs[part].mean(axis=0))
            band = (friction[part] - reach[part], friction[part] + reach[part])
            titles = ("speed", "friction", "m/s", "N", band)
            known = np.ones(len(part), dtype=bool)
            curves.append(ShownCurve(label, f"{name}: {label}", speed[part], friction[part], *titles, known, name))
    return View(f"{len(rows)} points of friction", curves=tuple(curves))


def map_slice(workspace: Workspace, name: str, fit: str, speed: str) -> dict[str, Any]:
    """Return a map at one speed: friction over the gauge pressure of one chamber, for each pressure of the other.

    Parameters
    ----------
    workspace : Workspace
    name : str
        Name of the map.
    fit : str
        Name of the fit next to the map whose curves are drawn.
    speed : str
        m/s. Points count within `NEAR` of it.

    Raises
    ------
    RecordingError
        The file is not a friction map.
    CommandError
        The speed is not positive.
    """
    try:
        fit_name, speed_m_s = basename(fit) or FIT, float(speed)
    except ValueError:
        raise CommandError(WRONG_REQUEST, remedy="Reload the page.") from None
    if not (np.isfinite(speed_m_s) and speed_m_s > 0.0):
        raise CommandError(f"speed = {speed_m_s} m/s", rule="a speed above zero")
    path = workspace.path(name, MAPS)
    found = drawn_map(path, fit_name)
    gauges = np.array([one["gauges"] for one in found["groups"]])
    along = int(np.ptp(gauges[:, 1]) >= np.ptp(gauges[:, 0]))
    assemblies = np.array([one["assembly"] for one in found["groups"]])
    names = list(dict.fromkeys(assemblies.tolist()))
    fits, _ = fits_of(path, fit_name, names)
    parts = [np.flatnonzero(assemblies == one) for one in names]
    groups, others = [], []
    for inside in (part[near] for part in parts for near in alike(gauges[part][:, [1 - along]])):
        own = [found["groups"][k] for k in inside]
        of_seal, title = fits.get(own[0]["assembly"]), f"{own[0]['assembly']}: " if len(names) > 1 else ""
        points = [
            {**point, "gauge": group["gauges"][along]}
            for group in own
            for point in group["points"]
            if abs(np.log(point["speed"] / speed_m_s)) <= NEAR
        ]
        other = float(gauges[inside, 1 - along].mean())
        label = f"{title}chamber {'ba'[along]} at {bar(other)} bar gauge"
        groups.append({"assembly": own[0]["assembly"], "label": label, "points": points})
        reach = gauges[inside, along]
        if of_seal is not None and np.ptp(reach) > SAME_PA:
            over = np.linspace(reach.min(), reach.max(), SPEEDS)
            pair = (over, other) if along == 0 else (other, over)
            said = of_seal.predict(np.full(SPEEDS, speed_m_s), *pair)
            known = [point["gauge"] for point in points] or [np.inf, -np.inf]
            groups[-1]["curve"] = {"gauge": over.tolist(), "measured": [min(known), max(known)], **_band(said)}
            groups[-1]["curve"]["measured"] = [number(one) for one in groups[-1]["curve"]["measured"]]
            file = fit_file(own[0]["assembly"]) if len(names) > 1 else fit_name
            others.append((_fit_name(name, file), other, float(reach.min()), float(reach.max())))
    pair = ", ".join([f"np.linspace(low, high, {SPEEDS})", "other"][:: 1 - 2 * along])
    python = (
        "import numpy as np\nfrom pneudrive.identify.static.result import FrictionFit\n\n"
        f"# fit, gauge pressure of chamber {'ba'[along]}, and the ends of that of chamber {'ab'[along]}, Pa\n"
        f"levels = {others!r}\n"
        f"found = [FrictionFit.from_toml(file).predict({speed_m_s!r}, {pair}) for file, other, low, high in levels]\n"
    )
    return {"chamber": "ab"[along], "groups": groups, "python": python if others else ""}


def _fit_name(map_name: str, fit_name: str) -> str:
    return f"{map_name.rpartition('/')[0]}/{fit_name}".lstrip("/")


def map_difference(workspace: Workspace, path: str, fit: str, other: str) -> dict[str, Any]:
    """Return the difference between two maps, for each pair of pressures that both have measured.

    Points are paired one to one (same direction, speeds within `NEAR`). The curves belong to the fits next to the maps.

    Raises
    ------
    RecordingError
        A file is not a friction map.
    CommandError
        The maps have no pressures in common.
    """
    names, fit_name = (path, other), basename(fit) or FIT
    places = [workspace.path(name, MAPS) for name in names]
    beside = [fit_name, FIT]
    old, new = (drawn_map(place, one)["groups"] for place, one in zip(places, beside, strict=True))
    # Maps with one assembly each are always compared. Otherwise equal assemblies are compared.
    several = all(len({one["assembly"] for one in groups}) == 1 for groups in (old, new))
    listed = (list(dict.fromkeys(one["assembly"] for one in groups)) for groups in (old, new))
    fits = [fits_of(place, own, one) for place, own, one in zip(places, beside, listed, strict=True)]
    groups, pairs = [], []
    for one in old:
        alike_pairs = (two for two in new if np.abs(np.subtract(one["gauges"], two["gauges"])).max() < SAME_PA)
        pair = next((two for two in alike_pairs if several or two["assembly"] == one["assembly"]), None)
        if pair is None:
            continue
        group: dict[str, Any] = {"label": one["label"], "points": _paired(one["points"], pair["points"])}
        first, second = (fits[k][0].get(side["assembly"]) for k, side in enumerate((one, pair)))
        low, high = (0.0, -1.0) if first is None or second is None else common(first, second, "speed_m_s")
        if first is not None and second is not None and low < high:
            speeds = np.geomspace(low, high, SPEEDS)
            found = curve_differences(first, second, speeds, *one["gauges"])
            ends = {"friction": "value", "low": "low", "high": "high"}
            curve = {name: [number(getattr(each, key)) for each in found] for name, key in ends.items()}
            group["curve"] = {"speed": speeds.tolist(), "measured": [low, high], **curve}
            pairs.append(tuple(one["gauges"]))
        groups.append(group)
    if not groups:
        raise CommandError("the maps have no pair of chamber pressures in common", value=" and ".join(names))
    fit_names = list(map(_fit_name, names, beside))
    python = (
        "import numpy as np\nfrom pneudrive.identify.files import common, curve_differences\n"
        "from pneudrive.identify.static.result import FrictionFit\n\n"
        f"before, after = (FrictionFit.from_toml(name) for name in {fit_names!r})\n"
        f'speeds = np.geomspace(*common(before, after, "speed_m_s"), {SPEEDS})\n'
        f"gauges = {pairs!r}  # gauge pressures of chambers a and b, Pa\n"
        "found = [curve_differences(before, after, speeds, *pair) for pair in gauges]\n"
    )
    command = shlex.join(["pneudrive", "compare", *map(safe, fit_names)])
    about = {"groups": groups, "fit": " ".join(why for _, why in fits if why)}
    return about | {"command": command if pairs else "", "python": python if pairs else ""}


def _paired(old: list[dict[str, Any]], new: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the differences of the points of two maps, each used once.

    The uncertainties of both maps are treated as independent.
    """
    left, out = list(new), []
    for one in old:
        near = [two for two in left if two["direction"] == one["direction"]]
        near.sort(key=lambda two: abs(np.log(two["speed"] / one["speed"])))
        if not near or abs(np.log(near[0]["speed"] / one["speed"])) > NEAR:
            continue
        two = near[0]
        left.remove(two)
        spreads = (one["spread"], two["spread"])
        spread = None if None in spreads else float(np.hypot(*spreads))
        out.append({**two, "friction": two["friction"] - one["friction"], "spread": spread})
    return out


def _band(said: Prediction) -> dict[str, list[float]]:
    return {"friction": said.friction_n.tolist(), "low": said.lower_n.tolist(), "high": said.upper_n.tolist()}


def _heat(groups: list[dict[str, Any]], fits: Mapping[str, FrictionFit]) -> dict[str, Any]:
    """Return friction over speed and pressure as cells: the mean of the points, otherwise the value of the fit.

    Each pair of pressures has one row of cells ``[friction, kind]``. The kind is ``"measured"``, ``"fit"`` between the
    measured speeds of the row, or ``"extrapolated"`` beyond them. A cell without point and fit has the value None.
    """
    speeds = np.array([one["speed"] for group in groups for one in group["points"]])
    if not len(speeds) or not 0.0 < speeds.min() < speeds.max():
        return {"edges": [], "rows": []}
    edges = np.geomspace(speeds.min(), speeds.max(), HEAT_COLUMNS + 1)
    middles = np.sqrt(edges[1:] * edges[:-1])
    rows = []
    for group in groups[:HEAT_ROWS]:
        own = np.array([one["speed"] for one in group["points"]])
        friction = np.array([one["friction"] for one in group["points"]])
        column = np.clip(np.searchsorted(edges, own, side="right") - 1, 0, HEAT_COLUMNS - 1)
        fit = fits.get(group["assembly"])
        known = None if fit is None else fit.predict(middles, *group["gauges"]).friction_n
        cells: list[list[Any] | None] = []
        for place, middle in enumerate(middles):
            inside = friction[column == place]
            if len(inside):
                cells.append([float(inside.mean()), "measured"])
            elif known is None:
                cells.append(None)
            else:
                between = own.min() <= middle <= own.max()
                cells.append([float(known[place]), "fit" if between else "extrapolated"])
        rows.append({"label": group["label"], "assembly": group["assembly"], "cells": cells})
    return {"edges": edges.tolist(), "rows": rows}


def _pressures(found: xr.Dataset, rows: Any) -> Any:  # noqa: ANN401 - arrays of numbers
    """Return the absolute pressures of both chambers, the mean of each recording, shape (rows, 2), Pa."""
    names = np.unique(found["recording"].to_numpy()[rows].astype(str), return_inverse=True)[1]
    each = np.bincount(names)
    means = [np.bincount(names, found[f"pressure_{side}_pa"].to_numpy()[rows]) / each for side in "ab"]
    return np.column_stack(means)[names]


def alike(pairs: Any) -> list[Any]:  # noqa: ANN401 - arrays of numbers
    """Return the rows of each group of pressures that differ by less than `SAME_PA` from those of its first row."""
    left, out = np.arange(len(pairs)), []
    while len(left):
        near = (np.abs(pairs[left] - pairs[left[0]]) < SAME_PA).all(axis=1)
        out.append(left[near])
        left = left[~near]
    return out


def _points(found: xr.Dataset, rows: Any) -> list[dict[str, Any]]:  # noqa: ANN401 - an array of numbers
    part = found.isel(row=rows)
    spread = 2.0 * np.hypot(part["stderr_n"].to_numpy(), part["u_systematic_n"].to_numpy())  # U, k = 2
    columns = {
        "recording": part["recording"].to_numpy().tolist(),
        "direction": part["direction"].to_numpy().tolist(),
        "speed": np.abs(part["velocity_m_s"].to_numpy()).tolist(),
        "friction": part["friction_n"].to_numpy().tolist(),
        "spread": [None if np.isnan(one) else float(one) for one in spread],
        "flags": part["flags"].to_numpy().tolist(),
    }
    return [dict(zip(columns, one, strict=True)) for one in zip(*columns.values(), strict=True)]


def _label(gauges: Any) -> str:  # noqa: ANN401 - two numbers
    a, b = map(bar, gauges)
    return f"a {a}, b {b} bar gauge"


def bar(gauge_pa: float) -> str:
    """Return a gauge pressure in bar as text. Values near zero become zero."""
    return f"{0.0 if abs(gauge_pa) < 0.5 * SAME_PA else gauge_pa / 1e5:.3g}"


def number(value: object) -> float | None:
    """Return a number for JSON, which supports neither infinity nor NaN."""
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else None
