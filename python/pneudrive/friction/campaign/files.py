"""Characteristics as files: map, curves, effects."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe.files.toml import key_text, value_text
from pneudrive.friction.campaign.stops.files import STOPS_FILE, dwell_tables, write_stops
from pneudrive.friction.friction_map import write_map
from pneudrive.simulation.trajectory import check_target, whole, write_frame

if TYPE_CHECKING:
    from pneudrive.friction.campaign.compare.comparison import Comparison
    from pneudrive.friction.campaign.result import CampaignCharacteristics

MAP_FILES = ("map.parquet", "map.csv")
CURVES_FILE, EFFECTS_FILE = "curves.parquet", "effects.toml"
CURVE_COLUMNS = (
    "speed_m_s",
    "friction_n",
    "low_n",
    "high_n",
    "stderr_n",
    "u_systematic_n",
    "statistical_low_n",
    "statistical_high_n",
    "measured",
    "cycles",
)


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
    return [*written, write_stops(found, folder / STOPS_FILE)] if found.stops else written


def write_curves_and_effects(found: CampaignCharacteristics, folder: Path) -> list[Path]:
    """Write curves.parquet and effects.toml. Without curves, write only effects.toml."""
    effects = write_effects(found, folder / EFFECTS_FILE)
    return [write_curves(found, folder / CURVES_FILE), effects] if found.curves else [effects]


def write_curves(found: CampaignCharacteristics, path: str | Path) -> Path:
    """Write all curves as one table: condition, direction, the columns of `Curve`, and the excluded points."""
    import polars as pl

    path = check_target(path, (".parquet", ".csv"))
    rows: list[dict[str, Any]] = []
    for curve in found.curves:
        of_curve = {name: getattr(curve, name) for name in ("direction", "contains_air", "complete")}
        common = {**vars(curve.condition), **of_curve}
        rows += [
            {**common, **{name: getattr(curve, name)[i].item() for name in CURVE_COLUMNS}, "excluded": ""}
            for i in range(curve.speed_m_s.size)
        ]
        nothing = dict.fromkeys((name for name in CURVE_COLUMNS if name.endswith("_n")), float("nan"))
        if curve.direction == 0:
            rows += [
                {
                    **common,
                    **nothing,
                    "speed_m_s": point.speed_m_s,
                    "friction_n": point.friction_n,
                    "measured": True,
                    "cycles": 1,
                    "excluded": point.reason,
                }
                for point in curve.excluded
            ]
    write_frame(pl.DataFrame(rows, infer_schema_length=None), path)
    return path


def write_effects(found: CampaignCharacteristics, path: str | Path) -> Path:
    """Write effects with their intervals, the budget and the statements as TOML."""
    path = check_target(path, (".toml",))
    tables: dict[str, Any] = {
        "campaign": found.name,
        "rig": found.identity.name,
        "synthetic": found.synthetic,
        "protocol": found.protocol,
        "cycles": len(found.cycles),
        "flags": found.flags,
        "ranges": found.ranges,
        "repeatability": found.repeatability,
        "drift": found.drift,
        "zero": found.zero,
        "statement": list(found.statements),
        "skipped": list(found.skipped),
        "source": list(found.sources),
        "pressure": list(found.pressure),
        "direction": list(found.asymmetry),
        "air": list(found.air),
        "position": list(found.position),
        "stick_slip": list(found.stick_slip),
        "stick_slip_threshold": list(found.stick_slip_thresholds),
        "dwell": dwell_tables(found),
    }
    return _write(tables, path)


def write_comparison(compared: Comparison, path: str | Path) -> Path:
    """Write the tests of a comparison, its cautions, and the differences at common points as TOML."""
    path = check_target(path, (".toml",))
    tables: dict[str, Any] = {
        "first": compared.first.name,
        "second": compared.second.name,
        "synthetic": compared.first.synthetic or compared.second.synthetic,
        "different": compared.different,
        "test": list(compared.tests),
        "check": list(compared.checks),
        "statement": list(compared.statements),
    }
    if compared.curves is not None:
        points = compared.curves.points
        tables["curves"] = {
            "speed_m_s": points.speed_m_s,
            "gauge_a_pa": points.gauge_pa[:, 0],
            "gauge_b_pa": points.gauge_pa[:, 1],
            "first_n": compared.curves.friction_n[0],
            "second_n": compared.curves.friction_n[1],
            "relative_difference": [e.value for e in compared.curves.difference],
            "low": [e.low for e in compared.curves.difference],
            "high": [e.high for e in compared.curves.difference],
            "corrected_p": compared.curves.adjusted_p,
        }
    return _write(tables, path)


def _write(tables: dict[str, Any], path: Path) -> Path:
    with whole(path) as temporary:
        temporary.write_text("\n".join(_lines(tables, ())) + "\n", encoding="utf-8")
    return path


def _lines(table: dict[str, Any], name: tuple[str, ...]) -> list[str]:
    """Return lines of TOML: plain values, tables, lists of tables; None and empty values are left out."""
    plain, inner, lists = [], [], []
    for key, given in table.items():
        value = given.tolist() if isinstance(given, np.ndarray | np.generic) else given
        if value is None or (isinstance(value, list | tuple | dict) and not len(value)):
            continue
        if is_dataclass(value) or isinstance(value, dict):
            inner.append((key, _fields(value)))
        elif isinstance(value, list | tuple) and (is_dataclass(value[0]) or isinstance(value[0], dict)):
            lists.append((key, [_fields(item) for item in value]))
        else:
            plain.append(f"{key_text(key)} = {value_text(value)}")
    lines = plain
    for key, value in inner:
        lines += ["", f"[{'.'.join((*name, key_text(key)))}]", *_lines(value, (*name, key_text(key)))]
    for key, items in lists:
        for item in items:
            lines += ["", f"[[{'.'.join((*name, key_text(key)))}]]", *_lines(item, (*name, key_text(key)))]
    return lines


def _fields(value: Any) -> dict[str, Any]:  # noqa: ANN401 - any of the results' dataclasses
    return value if isinstance(value, dict) else {field.name: getattr(value, field.name) for field in fields(value)}
