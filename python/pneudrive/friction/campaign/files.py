"""Characteristics as files: friction map with 95 % band and levels of the plan, curves, effects, stops."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe.files.toml import sections
from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.friction.bins import known_mean
from pneudrive.friction.campaign.curves import Fits, cycle_terms
from pneudrive.friction.campaign.cycles import OF_SIDES, WAYS
from pneudrive.friction.campaign.stops.stop import TRACE
from pneudrive.friction.friction_map import AMBIENT, BOTH, LEVEL_COLUMNS, LEVELS, TABLES, columns_to_dataset, write_map
from pneudrive.friction.friction_map import COLUMNS as MAP_COLUMNS
from pneudrive.simulation.trajectory import check_target, write_frame, write_whole

if TYPE_CHECKING:
    import xarray as xr

    from pneudrive.arrays import Row
    from pneudrive.friction.campaign.compare import Comparison
    from pneudrive.friction.campaign.points import CurvePoints
    from pneudrive.friction.campaign.reading import CampaignData
    from pneudrive.friction.campaign.result import CampaignCharacteristics, PressureEffects
    from pneudrive.friction.campaign.stops.dwell_law import DwellPressure, DwellSeries
    from pneudrive.friction.campaign.stops.dwell_models import DwellLawFit

STOPS_FILE = "stops.parquet"
COLUMNS = {**MAP_COLUMNS, **LEVEL_COLUMNS}
BANDS = tuple(name for name in LEVEL_COLUMNS if name.endswith("_n"))


def friction_map(reading: CampaignData, points: CurvePoints | None, fits: Fits | None, protocol: str) -> xr.Dataset:
    """Return the map, one row per cycle and direction, in the order of the campaign."""
    cycles, edges, ambient_pa = reading.sliding, reading.edges_m, reading.identity.ambient_pressure_pa
    count, moves, known = len(cycles), cycles.moves, np.isfinite(cycles["balance_n"])
    columns: dict[str, np.ndarray] = {name: cycles[name] for name in MAP_COLUMNS if name in OF_SIDES}
    columns |= {name: np.full((count, 2), np.nan) for name in ("offset_n", "stderr_n", "u_systematic_n", *BANDS)}
    columns["direction"] = np.tile(WAYS, (count, 1))
    columns["balance_n"] = known_mean(cycles["balance_n"], axis=2)
    columns["friction_n"] = WAYS * columns["balance_n"]
    columns["position_from_m"] = edges[known.argmax(axis=2)]
    columns["position_to_m"] = edges[known.shape[2] - known[:, :, ::-1].argmax(axis=2)]
    reason = np.full(count, "unpaired", dtype=object)
    if points is not None:
        both = moves.all(axis=1)
        reason[both] = points["reason"]
        for name, value in _paired(points, fits, edges[1] - edges[0]).items():
            columns[name][both] = value
    raised = zip(cycles["flags"], (why.replace("-", "_").replace(" ", "_") for why in reason), strict=True)
    flags = [",".join(dict.fromkeys([*flags, *([why] if why else [])])) for flags, why in raised]
    of_cycle = {name: cycles[name] for name in ("temperature_k", "kind", "block", "repeat", "began_s")}
    of_cycle |= {name: np.array([getattr(c, name) for c in cycles["condition"]], dtype=object) for name in LEVELS}
    of_cycle |= {
        "recording": cycles["key"],
        "flags": np.array(flags, object),
        AMBIENT: np.full(count, ambient_pa),
    }
    columns |= {name: np.tile(values[:, None], 2) for name, values in of_cycle.items()}
    rows = {name: values[moves] for name, values in columns.items()}
    order = np.lexsort((-rows["direction"], rows["recording"].astype(str), rows["began_s"]))
    found = columns_to_dataset({name: values[order] for name, values in rows.items()}, COLUMNS)
    found.attrs |= {"title": "friction map of a campaign", "protocol": protocol, AMBIENT: ambient_pa}
    found.attrs["synthetic"] = reading.identity.synthetic
    return found


def _paired(points: CurvePoints, fits: Fits | None, width_m: float) -> dict[str, np.ndarray]:
    """Return the columns of cycles with both directions, shape (n, 1) or (n, 2), for bins of width `width_m`."""
    friction, offset = points["friction_n"][:, None], points["offset_n"][:, None]
    # Offset from the drifting zero of the force sensor; 0 without zero runs.
    own = np.full(len(points), np.nan) if fits is None else np.zeros(len(points))
    if fits is not None and fits.has_zero:
        of_offset = fits.offset.fit
        zero = float(np.average([state.beta[0] for state in of_offset.states], weights=of_offset.weights))
        order = fits.offset.data.order
        at = np.argsort(order, kind="stable")
        own = points["offset_n"] - zero - np.interp(points["order"], order[at], fits.offset.drift.mean[at])
    own = friction + WAYS * own[:, None]
    stderr, systematic, one_sided = (values[:, None] for values in cycle_terms(points, fits))
    half = NORMAL_95 * np.hypot(stderr, systematic)
    half_direction = NORMAL_95 * np.sqrt(stderr**2 + systematic**2 + one_sided)
    common = points.pattern.position_m[points.pattern.common]
    return {
        "balance_n": WAYS * friction + offset,
        "friction_n": friction,
        "offset_n": offset,
        "stderr_n": stderr,
        "u_systematic_n": systematic,
        "friction_low_n": friction - half,
        "friction_high_n": friction + half,
        "friction_direction_n": own,
        "friction_direction_low_n": own - half_direction,
        "friction_direction_high_n": own + half_direction,
        "air_n": points["air_n"][:, None],
        "position_from_m": common[:1, None] - width_m / 2.0,
        "position_to_m": common[-1:, None] + width_m / 2.0,
    }


MAP_FILES = ("map.parquet", "map.csv")
CURVES_FILE, EFFECTS_FILE = "curves.parquet", "effects.toml"


def write_characteristics(found: CampaignCharacteristics, folder: str | Path) -> list[Path]:
    """Write map.parquet, map.csv, curves.parquet and effects.toml; stops.parquet if there are stops.

    Returns
    -------
    list of pathlib.Path

    Raises
    ------
    CommandError
        If the folder cannot be written.
    """
    folder = Path(folder)
    written = [write_map(found.friction_map, folder / name) for name in MAP_FILES]
    written += write_curves_and_effects(found, folder)
    return [*written, write_stops(found, folder / STOPS_FILE)] if len(found.stops) else written


def write_curves_and_effects(found: CampaignCharacteristics, folder: Path) -> list[Path]:
    """Write curves.parquet, and effects, intervals, budget and statements as effects.toml; without curves only this."""
    tables: Row = {key: attrgetter(name)(found) for key, name in TABLES["effects"].items()}
    tables["cycles"], tables["dwell"] = len(found.cycles), [_series(series) for series in found.dwell]
    tables["pressure"] = [by_chamber(effects) for effects in found.pressure]
    effects = _write(tables, folder / EFFECTS_FILE)
    return [write_curves(found, folder / CURVES_FILE), effects] if found.curves else [effects]


def write_curves(found: CampaignCharacteristics, path: str | Path) -> Path:
    """Write all curves as one table with condition, direction, columns of `Curve`, and excluded points."""
    import polars as pl

    path, frames, names = check_target(path, (".parquet", ".csv")), [], TABLES["lists"]["curve"]
    for curve in found.curves:
        out = curve.excluded if curve.direction == BOTH else ()
        added: dict[str, list[Any]] = {name: [getattr(p, name) for p in out] for name in ("speed_m_s", "friction_n")}
        added |= {"measured": [True] * len(out), "cycles": [1] * len(out)}
        nothing = [np.nan] * len(out)
        columns = {name: [*getattr(curve, name).tolist(), *added.get(name, nothing)] for name in names}
        excluded = [*[""] * curve.speed_m_s.size, *(p.reason for p in out)]
        of_curve = vars(curve.condition) | {n: getattr(curve, n) for n in ("direction", "contains_air", "complete")}
        same = {name: [value] * len(excluded) for name, value in of_curve.items()}
        frames.append(pl.DataFrame({**same, **columns, "excluded": excluded}))
    write_frame(pl.concat(frames), path)
    return path


def write_comparison(compared: Comparison, path: str | Path) -> Path:
    """Write the tests of a comparison, its cautions, and the differences at common points as TOML."""
    tables: Row = {
        "first": compared.first.name,
        "second": compared.second.name,
        "synthetic": compared.first.synthetic or compared.second.synthetic,
        "different": compared.different,
        "test": compared.tests,
        "check": compared.checks,
        "statement": compared.statements,
    }
    if compared.curves is not None:
        columns = compared.curves.points.select("speed_m_s", "gauge_a_pa", "gauge_b_pa", "first_n", "second_n")
        tables["curves"] = columns.to_dict(as_series=False)
        for name, of in {"relative_difference": "value", "low": "low", "high": "high"}.items():
            tables["curves"][name] = [getattr(estimate, of) for estimate in compared.curves.difference]
        tables["curves"]["corrected_p"] = compared.curves.points["corrected_p"].to_list()
    return _write(tables, path)


def _write(tables: Row, path: str | Path) -> Path:
    return write_whole(check_target(path, (".toml",)), "\n".join(sections(_plain(tables))) + "\n")


def _plain(value: Any) -> Any:  # noqa: ANN401 - any of the results' dataclasses
    """Return results as plain data. Empty results become None: files do not have them."""
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, dict):
        return {key: part for key, each in value.items() if (part := _plain(each)) is not None} or None
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return [_plain(each) for each in value] or None if isinstance(value, list | tuple) else value


def by_chamber(effects: PressureEffects | DwellPressure) -> Row:
    """Return pressure effects as plain data. The chamber is part of a key, ``slope_a``."""
    names = {"slopes": "slope", "means": "mean", "increments": "increment"}
    found: Row = {}
    for name, value in vars(effects).items():
        found |= {f"{names[name]}_{key}": each for key, each in value.items()} if name in names else {name: value}
    return found


def _series(s: DwellSeries) -> Row:
    """Return a series as plain data for files."""
    durations = s.stops["dwell_s"].to_list()
    of_condition = zip(s.conditions, s.slopes, s.mean_slopes, strict=False)
    named = {"series": s.name, "speed_m_s": s.speed_m_s, "released": s.released}
    named |= {"stops": len(s.stops), "left_out": s.left_out}
    return {
        **named,
        "shortest_s": min(durations, default=np.nan),
        "longest_s": max(durations, default=np.nan),
        **{name: getattr(s, name) for name in TABLES["stops"]["series"]},
        "pressure": by_chamber(s.pressure) if s.pressure else None,
        "condition": [
            {"pressure_a_pa": c.pressure_a_pa, "pressure_b_pa": c.pressure_b_pa, "slope": slope, "mean_slope": mean}
            for c, slope, mean in of_condition
        ],
        "law": [_law(law) for law in s.laws],
    }


def _law(law: DwellLawFit) -> Row:
    return {
        "name": law.name,
        "formula": law.form.formula,
        "source": law.form.source,
        "delta_aicc": law.delta,
        **{name: getattr(law, name) for name in TABLES["stops"]["law"]},
        "shape": {name: [value, *law.shape_intervals[name]] for name, value in law.shape.items()},
    }


def write_stops(found: CampaignCharacteristics, path: str | Path) -> Path:
    """Write one row per stop, .parquet or .csv.

    Raises
    ------
    CommandError
        If the file cannot be written.
    """
    import polars as pl

    path = check_target(path, (".parquet", ".csv"))
    write_frame(found.stops.drop(TRACE).with_columns(pl.col("flags").list.join(",")), path)
    return path
