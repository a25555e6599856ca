"""Stops as files: one row per stop, and what each series says of breakaway over duration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pneudrive.trajectory import check_target, write_frame

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.characteristics.result import CampaignCharacteristics
    from pneudrive.characteristics.stops.dwell_forms import LawFit
    from pneudrive.characteristics.stops.dwell_law import DwellPressure, DwellSeries
    from pneudrive.characteristics.stops.stop import Stop
    from pneudrive.estimate.estimates import Estimate

STOPS_FILE = "stops.parquet"


@dataclass(frozen=True)
class AtCondition:
    """What one condition of a series says; slopes in N per decade of duration."""

    pressure_a_pa: float
    pressure_b_pa: float
    slope: Estimate
    mean_slope: Estimate


@dataclass(frozen=True)
class Law:
    """One law of a series; lists are by condition."""

    name: str
    formula: str
    source: str
    delta_aicc: float
    bic: float
    weight: float
    shape: dict[str, list[float]]  # name -> value, low, high
    level_n: list[float]
    amplitude_n: list[float]
    slope_n: float
    slope_low_n: float
    slope_high_n: float


@dataclass(frozen=True)
class Dwell:
    """One series."""

    series: str
    speed_m_s: float
    released: bool
    stops: int
    left_out: int
    shortest_s: float
    longest_s: float
    reference_s: float
    running_n: float
    scatter_n: float
    block_n: float
    outlying: list[str]
    slope: Estimate | None
    mean_slope: Estimate | None
    increment: Estimate | None
    share: Estimate | None
    pressure: DwellPressure | None
    condition: list[AtCondition]
    law: list[Law]


def dwell_tables(found: CampaignCharacteristics) -> list[Dwell]:
    """List the series in a form that files can hold."""
    return [_dwell(series) for series in found.dwell]


def _dwell(s: DwellSeries) -> Dwell:
    durations = [stop.dwell_s for stop in s.stops]
    conditions = [
        AtCondition(c.pressure_a_pa, c.pressure_b_pa, slope, mean)
        for c, slope, mean in zip(s.conditions, s.slopes, s.mean_slopes, strict=False)
    ]
    return Dwell(
        series=s.name,
        speed_m_s=s.speed_m_s,
        released=s.released,
        stops=len(s.stops),
        left_out=s.left_out,
        shortest_s=min(durations, default=float("nan")),
        longest_s=max(durations, default=float("nan")),
        reference_s=s.reference_s,
        running_n=s.running_n,
        scatter_n=s.scatter_n,
        block_n=s.block_n,
        outlying=list(s.outlying),
        slope=s.slope,
        mean_slope=s.mean_slope,
        increment=s.increment,
        share=s.share,
        pressure=s.pressure,
        condition=conditions,
        law=[_law(law) for law in s.laws],
    )


def _law(law: LawFit) -> Law:
    return Law(
        name=law.name,
        formula=law.form.formula,
        source=law.form.source,
        delta_aicc=law.delta,
        bic=law.bic,
        weight=law.weight,
        shape={name: [value, *law.shape_intervals[name]] for name, value in law.shape.items()},
        level_n=law.level_n.tolist(),
        amplitude_n=law.amplitude_n.tolist(),
        slope_n=law.slope_n,
        slope_low_n=law.slope_low_n,
        slope_high_n=law.slope_high_n,
    )


def write_stops(found: CampaignCharacteristics, path: str | Path) -> Path:
    """Write one row per stop, .parquet or .csv.

    Raises
    ------
    CommandError
        The file cannot be written.
    """
    import polars as pl

    path = check_target(path, (".parquet", ".csv"))
    write_frame(pl.DataFrame([_row(stop) for stop in found.stops], infer_schema_length=None), path)
    return path


PLAIN = (
    "index", "key", "block", "repeat", "direction", "speed_m_s", "position_m", "began_s", "stop_s", "dwell_s",
    "released", "running_n", "running_stderr_n", "basis", "breakaway_n", "breakaway_stderr_n", "increment_n",
    "increment_stderr_n", "loading_rate_n_s", "loading_s", "sample_rate_hz", "inertia_n",
)  # fmt: skip


def _row(stop: Stop) -> dict[str, Any]:
    relaxation, recovery = stop.relaxation, stop.recovery
    row: dict[str, Any] = {**vars(stop.condition), **{name: getattr(stop, name) for name in PLAIN}}
    row |= _three("relaxation_n", relaxation.amount if relaxation else None)
    row |= _three("relaxation_n_per_decade", relaxation.per_decade if relaxation else None)
    row["relaxation_form"] = relaxation.form if relaxation else ""
    row |= _three("recovery_m", recovery.distance if recovery else None)
    row |= _three("recovery_s", recovery.time if recovery else None)
    row |= _three("left_n", recovery.left if recovery else None)
    return row | {"usable": stop.usable, "flags": ",".join(stop.flags)}


def _three(name: str, estimate: Estimate | None) -> dict[str, float]:
    nothing = float("nan")
    value = (estimate.value, estimate.low, estimate.high) if estimate is not None else (nothing, nothing, nothing)
    return dict(zip((name, f"{name}_low", f"{name}_high"), value, strict=True))
