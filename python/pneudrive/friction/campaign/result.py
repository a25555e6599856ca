"""Results of a campaign: cycles, curves, effects and statements on friction, and their files."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from pneudrive.arrays import Array, Bools, Interval, Ints, Row, attributes_of
from pneudrive.describe.files.toml import sections
from pneudrive.estimate.estimates import NORMAL_95, Estimate, FTest
from pneudrive.friction.friction_map import BOTH, CHAMBERS, TABLES, Condition, Skipped, write_map
from pneudrive.lazy_names import upper
from pneudrive.repr_tables import Shown
from pneudrive.simulation.trajectory import check_target, write_frame, write_whole
from pneudrive.views import ShownCurve, View, Viewed

if TYPE_CHECKING:
    import xarray as xr

    from pneudrive.friction.campaign.reading import Loop
    from pneudrive.friction.campaign.stops.dwell_law import DwellSeries
    from pneudrive.friction.sentences import Statement
    from pneudrive.rig.interface import Identity


@dataclass(frozen=True, eq=False)
class PressureEffects:
    """Effects of the chamber pressures on friction, for one set of levels.

    Attributes
    ----------
    levels : str
        Mounting, seal, drive.
    speed_m_s : ndarray, shape (m,)
        Speeds that were measured at all pressure pairs used.
    slopes : dict
        Chamber (a, b, or sum if only the sum of both is determined) -> change of friction at each speed, in N/Pa.
    means : dict
        Chamber -> mean over all speeds.
    interaction : FTest or None
        Test of the effect of p_a p_b (mean and change with log speed). None if the design does not determine it.
    interaction_n_pa2 : Estimate or None
        Mean of this effect over speeds, in N/Pa2.
    curvature : FTest or None
        Test of the effects of the squares of both pressures.
    gauge_pa : tuple of (float, float)
        Gauge pressures of the pairs used.
    hidden_n : float
        Possible change in friction over the campaign, in N, that the plan does not separate from the effect of
        pressure. The intervals include it as a standard uncertainty. 0 if the plan separates them.
    statement : str
    """

    levels: str
    speed_m_s: Array
    gauge_pa: tuple[tuple[float, float], ...]
    hidden_n: float
    statement: str
    slopes: dict[str, tuple[Estimate, ...]]
    means: dict[str, Estimate]
    interaction: FTest | None = None
    interaction_n_pa2: Estimate | None = None
    curvature: FTest | None = None


@dataclass(frozen=True, eq=False)
class AirShare:
    """Half the difference of the force readings between both directions at one condition, divided into air and seal.

    Attributes
    ----------
    condition : Condition
    separated : bool
        Whether pressures were measured in the chambers.
    speed_m_s : ndarray, shape (m,)
    total_n, total_low_n, total_high_n : ndarray, shape (m,)
        Reading of the force sensor without inertia and weight.
    air_n, air_low_n, air_high_n : ndarray, shape (m,)
        NaN if not separated.
    seal_n, seal_low_n, seal_high_n : ndarray, shape (m,)
        NaN if not separated.
    air_bound_n : ndarray, shape (m,)
        Upper bound of the force of the air; NaN if separated. The bound assumes that friction of the seal does not fall
        as speed rises.
    """

    condition: Condition
    separated: bool
    speed_m_s: Array
    total_n: Array
    total_low_n: Array
    total_high_n: Array
    air_n: Array
    air_low_n: Array
    air_high_n: Array
    seal_n: Array
    seal_low_n: Array
    seal_high_n: Array
    air_bound_n: Array


@dataclass(frozen=True)
class PositionWave:
    """A wave of friction over position. `order` is the number of periods in the range, not necessarily a whole number.

    Cosine, sine (about the middle of the range) and amplitude are relative to the mean friction.
    """

    order: float
    wavelength_m: float
    cosine: Estimate
    sine: Estimate
    amplitude: Estimate


@dataclass(frozen=True, eq=False)
class PositionPattern:
    """Friction against position at one set of levels, relative to the mean friction over the range.

    Attributes
    ----------
    condition : Condition or None
        None: all cycles of the mounting, seal and drive.
    position_m : ndarray, shape (m,)
        Centres of the bins.
    relative, low, high : ndarray, shape (m,)
        Friction divided by its mean, and its 95 % interval.
    trend_per_m : Estimate
        Relative change along x.
    harmonics : tuple of PositionWave
        Significant waves of the pattern, the strongest first.
    cycles : int
    levels : str
        Mounting, seal, drive.
    """

    condition: Condition | None
    position_m: Array
    relative: Array
    low: Array
    high: Array
    trend_per_m: Estimate
    harmonics: tuple[PositionWave, ...]
    cycles: int
    levels: str = ""


@dataclass(frozen=True, eq=False)
class Asymmetry:
    """Half the difference of friction between +x and -x at one condition.

    Attributes
    ----------
    condition : Condition
    speed_m_s : ndarray, shape (m,)
        Measured speeds.
    mean : Estimate
        (F(+x) - F(-x)) / 2, mean over all speeds, without the zero of the sensor if there are zero runs. Its p-value
        tests symmetry.
    basis : str
        "tare", or "not separable": without zero runs the difference includes the zero of the sensor.
    """

    condition: Condition
    speed_m_s: Array
    mean: Estimate
    basis: str


@dataclass(frozen=True)
class StickSlipPoint:
    """Stick-slip at one condition and speed, as medians over both directions of all cycles.

    ``share`` is the fraction of cycles with unsteady sliding. ``strokes`` is twice the number of cycles.
    ``amplitude_n`` is the peak-to-peak range of the force in mid stroke, without the lowest and highest 2 %.
    """

    condition: Condition
    speed_m_s: float
    share: float
    strokes: int
    ripple: float
    period_s: float
    step_m: float
    amplitude_n: float


@dataclass(frozen=True)
class StickSlipThreshold:
    """Speed below which stick-slip starts: between the highest speed with stick-slip and the lowest without it."""

    condition: Condition
    low_m_s: float
    high_m_s: float
    text: str


@dataclass(frozen=True, eq=False)
class Drift:
    """Change of friction over the campaign that speed, pressure and levels do not explain.

    Attributes
    ----------
    time_s, drift_n, low_n, high_n : ndarray, shape (m,)
        Drift at each cycle, relative to the mean of the campaign.
    sentinel_time_s, sentinel_n : ndarray, shape (k,)
        Time and friction of each control run.
    per_hour, per_decade_of_travel, per_kelvin : Estimate or None
        Effect linear in time, in the logarithm of travel, or in temperature; None if the design does not determine it.
    interrupted : Estimate or None
        Friction after an interruption minus friction in continuous operation.
    basis : str
        sentinels, repeats, smooth curve, not determined.
    spread_n : float
        Standard deviation of the drift over the cycles: typical difference between friction at one time and the curves.
        The curves hold for the mean state of the campaign, and their bands do not cover this difference.
    """

    time_s: Array
    drift_n: Array
    low_n: Array
    high_n: Array
    sentinel_time_s: Array
    sentinel_n: Array
    per_hour: Estimate | None
    per_decade_of_travel: Estimate | None
    per_kelvin: Estimate | None
    interrupted: Estimate | None
    basis: str
    spread_n: float


@dataclass(frozen=True)
class Repeatability:
    """Standard deviations, in N, of the scatter of friction from cycle to cycle, split into parts as in ISO 5725.

    ``within`` is the part in one block at equal conditions. ``between`` is the part from block to block or day to day.
    ``total`` is both together. All three apply at the mean friction of the repeated cycles. ``relative`` states whether
    they are proportional to friction. ``basis`` is the source: repeats, sentinels (control runs), or both; or
    "smooth curve" (residuals of the curves) if no cycle was repeated.
    """

    within: Estimate
    between: Estimate | None
    total: Estimate | None
    relative: bool
    basis: str


@dataclass(frozen=True, eq=False)
class SensorZero:
    """Zero of the force sensor.

    Attributes
    ----------
    time_s, zero_n, stderr_n : ndarray, shape (k,)
        Zero of each zero run.
    per_hour : Estimate or None
    basis : str
        "tare" or "not measured".
    """

    time_s: Array
    zero_n: Array
    stderr_n: Array
    per_hour: Estimate | None
    basis: str


@dataclass(frozen=True, eq=False, repr=False)
class Curve(Shown):
    """Friction against speed at one condition, with a pointwise 95 % band.

    Friction and band refer to the mean state of the campaign. `Drift.spread_n` is the scatter of the
    states. `Repeatability.within` is the scatter of cycles in one state.

    Attributes
    ----------
    condition : Condition
    direction : int
        +1, -1, or 0 for half the difference of both directions.
    speed_m_s, friction_n, low_n, high_n : ndarray, shape (m,)
        Curve at ascending speeds: measured and intermediate ones.
    stderr_n : ndarray, shape (m,)
        Statistical standard error (noise, cycle to cycle, block, day) of friction in the mean state of the campaign.
    u_systematic_n : ndarray, shape (m,)
        Standard uncertainty that all points share (gain, hysteresis, position, and the zero for one direction).
    cycles : ndarray of int, shape (m,)
        Number of cycles at each speed; 0 between the measured speeds.
    excluded : polars.DataFrame
        Points that are shown but not used for F(v), slowest first: ``speed_m_s``, ``friction_n``, ``reason``.
    contains_air : bool
        Whether the curve may include the force of the air, because pressures were not measured in the chambers.
    complete : bool
        False if speed changed steadily over time, so that the band does not cover a drift (run-in, zero of the force
        sensor).
    """

    condition: Condition
    direction: int
    speed_m_s: Array
    friction_n: Array
    low_n: Array
    high_n: Array
    stderr_n: Array
    u_systematic_n: Array
    cycles: Ints
    excluded: pl.DataFrame
    contains_air: bool = False
    complete: bool = True

    @property
    def measured(self) -> Bools:
        """Mask (m,) of the measured speeds; False for speeds between them."""
        return self.cycles > 0

    def shown(self, ambient_pressure_pa: float) -> ShownCurve:
        """Return the curve for display. Each combination of mounting, seal and drive is a group."""
        return ShownCurve(
            key=str(self.condition),
            label=self.condition.label(ambient_pressure_pa),
            x=self.speed_m_s,
            y=self.friction_n,
            x_quantity="speed",
            quantity="seal and air" if self.contains_air else "friction",
            x_unit="m/s",
            unit="N",
            band=(self.low_n, self.high_n),
            measured=self.measured,
            group=self.condition.title,
            excluded=(self.excluded["speed_m_s"].to_numpy(), self.excluded["friction_n"].to_numpy()),
        )


@dataclass(frozen=True)
class UncertaintySource:
    """A source of uncertainty of the curves.

    Attributes
    ----------
    name : str
    standard_uncertainty_n : float
        Root mean square over the points of all curves.
    kind : str
        "A" (from the scatter of these data) or "B" (stated or assumed).
    basis : str
        Origin of the value: data, stated, assumed, not determined.
    note : str
    """

    name: str
    standard_uncertainty_n: float
    kind: str
    basis: str
    note: str = ""


@dataclass(frozen=True)
class Ranges:
    """Lowest and highest measured values. Results outside are extrapolated. Pressures are gauge."""

    speed_m_s: Interval
    gauge_a_pa: Interval
    gauge_b_pa: Interval
    temperature_k: Interval


@dataclass(frozen=True, eq=False, repr=False)
class CampaignCharacteristics(Viewed):
    """All friction results of a campaign, in SI units. Pressures are absolute unless called gauge.

    Attributes
    ----------
    name : str
    folder : pathlib.Path
    about : dict
        ``campaign.json``; empty for recordings.
    identity : Identity
        Identity and calibration of the rig.
    protocol : str
        Selection of samples: settled or source-paper.
    cycles : polars.DataFrame
        One row for each cycle, in the order in which they were run: key, kind, block, repeat, day, condition, speed,
        friction with its standard error, flags, and more.
    skipped : tuple of Skipped
    flags : dict
        Name of a flag -> number of cycles with this flag.
    friction_map : xarray.Dataset
        One row per cycle, speed level and direction: the columns of a friction map, the 95 % band and the levels.
    curves : tuple of Curve
    sources : tuple of UncertaintySource
        Uncertainty budget of the curves.
    pressure, air, position, asymmetry, loops, stick_slip, stick_slip_thresholds, drift, repeatability, zero
    stops : polars.DataFrame
        One row for each stop, see `pneudrive.friction.campaign.stops.stop.find_stops`; empty without stops.
    dwell : tuple of DwellSeries
        Breakaway over stop duration, one for each set of levels, restart speed and axis state (held, released).
    ranges : Ranges
    statements : tuple of Statement
        Statements on determined and undetermined effects, and on the cycles that would determine them.
    """

    name: str
    folder: Path
    about: Row
    identity: Identity
    protocol: str
    cycles: pl.DataFrame
    skipped: tuple[Skipped, ...]
    flags: dict[str, int]
    friction_map: xr.Dataset
    zero: SensorZero
    ranges: Ranges
    stops: pl.DataFrame
    curves: tuple[Curve, ...] = ()
    sources: tuple[UncertaintySource, ...] = ()
    pressure: tuple[PressureEffects, ...] = ()
    air: tuple[AirShare, ...] = ()
    position: tuple[PositionPattern, ...] = ()
    asymmetry: tuple[Asymmetry, ...] = ()
    loops: tuple[Loop, ...] = ()
    stick_slip: tuple[StickSlipPoint, ...] = ()
    stick_slip_thresholds: tuple[StickSlipThreshold, ...] = ()
    drift: Drift | None = None
    repeatability: Repeatability | None = None
    dwell: tuple[DwellSeries, ...] = ()
    statements: tuple[Statement, ...] = ()

    @property
    def synthetic(self) -> bool:
        """Whether the data come from a simulated rig."""
        return self.identity.synthetic

    def view(self) -> View:
        """Return headline, effects, curves of both directions together, figures, and statements on the data."""
        return upper("campaign_view")(self)

    def effects(self) -> dict[str, Estimate | FTest]:
        """Return each effect on friction that the data determine, by its name and condition."""
        named = partial(Condition.label, ambient_pressure_pa=self.identity.ambient_pressure_pa)
        found: dict[str, Estimate | FTest | None] = {}
        for e in self.pressure:
            where = f" ({e.levels})" if e.levels else ""
            found |= {f"pressure of {CHAMBERS[name]}{where}": mean for name, mean in e.means.items()}
            found[f"interaction of both pressures{where}"] = e.interaction_n_pa2
            found[f"curvature over pressure{where}"] = e.curvature
        for a in self.asymmetry:
            zero = "" if a.basis == "tare" else " (with the sensor's zero)"
            found[f"half of +x less -x{zero}, {named(a.condition)}"] = a.mean
        for p in self.position:
            where = named(p.condition) if p.condition is not None else p.levels or "all cycles"
            found[f"trend along the stroke, {where}"] = p.trend_per_m
            for wave in p.harmonics:
                found[f"wave of {1e3 * wave.wavelength_m:.3g} mm along the stroke, {where}"] = wave.amplitude
        if (r := self.repeatability) is not None:
            kind = ", proportional to friction" if r.relative else ""
            found[f"scatter of one cycle, from {r.basis}{kind}"] = r.within
            found |= {"scatter of blocks or days": r.between, "scatter in total": r.total}
        if (d := self.drift) is not None:
            found |= {"drift per hour": d.per_hour, "run-in per decade of travel": d.per_decade_of_travel}
            found |= {"drift per kelvin": d.per_kelvin, "friction after an interruption": d.interrupted}
        found["zero of the force sensor per hour"] = self.zero.per_hour
        for s in self.dwell:
            series = f", {s.name}" if len(self.dwell) > 1 else ""
            found |= {f"{name}{series}": estimate for name, estimate in s.effects(named).items()}
        return {name: estimate for name, estimate in found.items() if estimate is not None}


# --- Results as files: friction map, curves, effects, stops.

#: Attributes with a value for each chamber -> beginning of their keys in a file.
OF_CHAMBERS = {"slopes": "slope", "means": "mean", "increments": "increment"}


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
    written = [write_map(found.friction_map, folder / name) for name in ("map.parquet", "map.csv")]
    written += write_curves_and_effects(found, folder)
    if len(found.stops):
        stops = found.stops.select(pl.exclude("^trace_.*$")).with_columns(pl.col("flags").list.join(","))
        written.append(check_target(folder / "stops.parquet"))
        write_frame(stops, written[-1])
    return written


def write_curves_and_effects(found: CampaignCharacteristics, folder: Path) -> list[Path]:
    """Write effects, intervals, budget and statements as effects.toml, and curves.parquet if there are curves."""
    tables = _entries(found, "effects") | {"cycles": len(found.cycles), "dwell": [_series(s) for s in found.dwell]}
    effects, target = write_tables(tables, folder / "effects.toml"), folder / "curves.parquet"
    if not found.curves:
        return [effects]
    frames = []  # of each curve: condition, direction, columns of `Curve`, and excluded points
    for curve in found.curves:
        rows = pl.DataFrame(attributes_of(curve, *TABLES["lists"]["curve"])).with_columns(excluded=pl.lit(""))
        middle, half = pl.col("friction_n"), NORMAL_95 * pl.col("stderr_n")
        rows = rows.with_columns(statistical_low_n=middle - half, statistical_high_n=middle + half)
        if curve.direction == BOTH:
            out = curve.excluded.with_columns(measured=True, cycles=pl.lit(1, pl.Int64))
            rows = pl.concat([rows, out.rename({"reason": "excluded"})], how="diagonal")
        of_curve = vars(curve.condition) | attributes_of(curve, "direction", "contains_air", "complete")
        frames.append(pl.DataFrame([of_curve]).join(rows, how="cross", maintain_order="right"))
    write_frame(pl.concat(frames).with_columns(pl.col(pl.Float64).fill_null(np.nan)), target)
    return [target, effects]


def write_tables(tables: Row, path: str | Path) -> Path:
    """Write results as TOML."""
    return write_whole(check_target(path, (".toml",)), "\n".join(sections(_plain(tables))) + "\n")


def _plain(value: Any) -> Any:  # noqa: ANN401 - any of the results' dataclasses
    """Return results as plain data. Empty results become None, so that files do not contain them.

    The chamber of an effect of pressure is part of the key, such as ``slope_a``.
    """
    if is_dataclass(value):
        parts: Row = {}
        for field in fields(value):
            part, effect = getattr(value, field.name), OF_CHAMBERS.get(field.name)
            parts |= {field.name: part} if effect is None else {f"{effect}_{key}": e for key, e in part.items()}
        value = parts
    if isinstance(value, dict):
        return {key: part for key, each in value.items() if (part := _plain(each)) is not None} or None
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return [_plain(each) for each in value] or None if isinstance(value, list | tuple) else value


def _entries(found: object, table: str) -> Row:
    """Return the entries of a table in a result file: key -> value of the attribute that `TABLES` names."""
    return {key: attrgetter(path)(found) for key, path in TABLES[table].items()}


def _series(s: DwellSeries) -> Row:
    """Return a series as plain data for files."""
    durations = s.stops["dwell_s"].to_list()
    row = _entries(s, "series") | {"stops": len(s.stops), "condition": [], "law": []}
    row |= {"shortest_s": min(durations, default=np.nan), "longest_s": max(durations, default=np.nan)}
    for c, slope, mean in zip(s.conditions, s.slopes, s.mean_slopes, strict=False):
        pressures = {"pressure_a_pa": c.pressure_a_pa, "pressure_b_pa": c.pressure_b_pa}
        row["condition"].append(pressures | {"slope": slope, "mean_slope": mean})
    for law in s.laws:
        shape = {name: [value, *law.shape_intervals[name]] for name, value in law.shape.items()}
        row["law"].append(_entries(law, "law") | {"shape": shape})
    return row
