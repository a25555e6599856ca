"""Stops as files: one row per stop, and the results of each series on breakaway over duration."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import polars as pl

from pneudrive.friction.campaign.stops.stop import Stop
from pneudrive.simulation.trajectory import check_target, write_frame

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.estimate.estimates import Estimate
    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.campaign.stops.dwell_forms import DwellLawFit
    from pneudrive.friction.campaign.stops.dwell_series import DwellSeries

STOPS_FILE = "stops.parquet"
NESTED = {"condition", "relaxation", "recovery", "trace", "flags"}  # fields that are not columns


def dwell_tables(found: CampaignCharacteristics) -> list[dict[str, Any]]:
    """Return the series as plain data for files."""
    return [_series(series) for series in found.dwell]


def _series(s: DwellSeries) -> dict[str, Any]:
    durations = [stop.dwell_s for stop in s.stops]
    of_condition = zip(s.conditions, s.slopes, s.mean_slopes, strict=False)
    plain = ("reference_s", "running_n", "scatter_n", "block_n", "outlying")
    estimates = ("slope", "mean_slope", "increment", "share", "pressure")
    return {
        "series": s.name,
        "speed_m_s": s.speed_m_s,
        "released": s.released,
        "stops": len(s.stops),
        "left_out": s.left_out,
        "shortest_s": min(durations, default=float("nan")),
        "longest_s": max(durations, default=float("nan")),
        **{name: getattr(s, name) for name in (*plain, *estimates)},
        "condition": [
            {
                "pressure_a_pa": c.pressure_a_pa,
                "pressure_b_pa": c.pressure_b_pa,
                "slope": slope,
                "mean_slope": mean,
            }
            for c, slope, mean in of_condition
        ],
        "law": [_law(law) for law in s.laws],
    }


def _law(law: DwellLawFit) -> dict[str, Any]:
    plain = ("bic", "weight", "level_n", "amplitude_n", "slope_n", "slope_low_n", "slope_high_n")
    return {
        "name": law.name,
        "formula": law.form.formula,
        "source": law.form.source,
        "delta_aicc": law.delta,
        **{name: getattr(law, name) for name in plain},
        "shape": {name: [value, *law.shape_intervals[name]] for name, value in law.shape.items()},
    }


def write_stops(found: CampaignCharacteristics, path: str | Path) -> Path:
    """Write one row per stop, .parquet or .csv.

    Raises
    ------
    CommandError
        If the file cannot be written.
    """
    path = check_target(path, (".parquet", ".csv"))
    write_frame(pl.DataFrame([_row(stop) for stop in found.stops], infer_schema_length=None), path)
    return path


def _row(stop: Stop) -> dict[str, Any]:
    relaxation, recovery = stop.relaxation, stop.recovery
    plain = {field.name: getattr(stop, field.name) for field in fields(Stop) if field.name not in NESTED}
    return {
        **vars(stop.condition),
        **plain,
        **_three("relaxation_n", relaxation.amount if relaxation else None),
        **_three("relaxation_n_per_decade", relaxation.per_decade if relaxation else None),
        "relaxation_form": relaxation.form if relaxation else "",
        **_three("recovery_m", recovery.distance if recovery else None),
        **_three("recovery_s", recovery.time if recovery else None),
        **_three("left_n", recovery.left if recovery else None),
        "usable": stop.usable,
        "flags": ",".join(stop.flags),
    }


def _three(name: str, estimate: Estimate | None) -> dict[str, float]:
    ends = {"": "value", "_low": "low", "_high": "high"}
    return {f"{name}{end}": getattr(estimate, of, float("nan")) for end, of in ends.items()}
