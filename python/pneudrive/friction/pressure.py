"""Results of several recordings over pressure: effective area and force zero (closure), friction over pressure.

Both results are computed from a table of points, with a row for each speed level of each recording. The
columns `recording`, `seal` and `run` name the origin of a row.

`pressure_pa` (Pa) is the higher gauge pressure of both chambers. `speed_m_s` (m/s) is the mean speed of both
directions, and `speed_stderr_m_s` the standard error of that mean from the scatter of the strokes.

`friction_n` (N) has the expanded uncertainty U (k = 2) `expanded_n`. `offset_n` is NaN without both directions.
`weight_n` is the weight along the axis.

`gauge_a_pa` (Pa) is the gauge pressure of chamber a, `u_a_pa` its standard uncertainty, and `area_a_m2` (m2) the
nominal area of the chamber. Columns of chamber b have b in place of a.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import polars as pl

from pneudrive.arrays import Array, Columns, Interval, NamedNumbers, Row, evenly
from pneudrive.estimate.estimates import Estimate, changed, rms, student
from pneudrive.friction.friction_map import TABLES
from pneudrive.friction.level import Level
from pneudrive.friction.sentences import sentence
from pneudrive.numbers import with_u
from pneudrive.repr_tables import Shown

TOGETHER = 0.05  # pressures change together if the rest is below this share
IMPLAUSIBLE_AREA = 0.25  # relative difference from nominal that no tolerance of a bore explains
MINIMUM_RANGE_PA = 2e4  # pressures that differ by less are equal: they give neither area nor slope
# Least ratio of the independent spread of both pressures to the sensors' uncertainty. A noisy regressor biases its
# factor towards zero, by 1 / (1 + RELIABLE**2) at this limit.
RELIABLE = 5.0
BAND_POINTS = 41
SAME_SPEED = 0.02  # controlled speeds closer than this are one level
SHOWN_SPEEDS = 5
CONFOUNDED = 0.7  # correlation of speed and pressure above which their effects are confounded
SPEED_OF_REPEAT = 0.25  # largest difference of speed between repeats without controlled speed
NET = "net"  # name of both areas together
CONTRADICTION = 1e-3  # p-value of groups of residuals below which the line does not hold
SAME_PRESSURE = 0.1  # recordings within this share of their pressure are repeats


def point_of(level: Level) -> Row:
    """Return the row of a speed level in the table of points."""
    recording, gauge = level.motion.recording, level.gauge_pa
    known = {entry.source: entry.standard_uncertainty for entry in level.budget}
    row = {name: getattr(level, name) for name in TABLES["lists"]["point"]} | {"weight_n": recording.weight_n}
    for side in "ab":
        row[f"gauge_{side}_pa"] = gauge[side]
        row[f"u_{side}_pa"] = known.get(f"pressure {side}: common error", 0.0)
        row[f"area_{side}_m2"] = getattr(recording, f"area_{side}_m2")
    return row


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class ClosureFit(Shown):
    """Effective areas and force zero of one group of recordings (one seal, one geometry).

    ``areas_m2`` has an entry for each chamber whose pressure changed, ``nominal_m2`` the areas of the
    layout. If both pressures changed together, the only entry is ``net``: the force of both chambers divided by the
    pressure that changed most. ``force_zero_n`` is the reading of the sensor without friction and pressure.
    For each point, ``pressure_pa`` is the gauge pressure of the chamber that changed most, and ``residual_n`` is the
    residual of the line. Intervals are unbounded without a redundant recording, or if the residuals contradict the
    line.
    """

    group: str
    recordings: tuple[str, ...]
    areas_m2: dict[str, Estimate]
    nominal_m2: dict[str, float]
    force_zero_n: Estimate
    pressure_pa: Array
    half_sum_force_n: Array
    residual_n: Array
    degrees_of_freedom: int
    statement: str

    @property
    def has_interval(self) -> bool:
        """Whether the interval of the force zero is bounded."""
        return self.force_zero_n.low > -np.inf


def fit_closures(points: pl.DataFrame) -> list[ClosureFit]:
    """Fit  F = A_b p_b - A_a p_a + weight + zero  to each group, with gauge pressures.

    Groups in which no pressure changes by more than 0.2 bar, or with fewer than two points, are left out. If both
    pressures change together, only the net area of both is fitted; if their forces cancel within the sensors'
    uncertainty, no area can be determined.
    """
    paired = points.filter(pl.col("offset_n").is_finite(), pl.any_horizontal(pl.col("area_a_m2", "area_b_m2") != 0.0))
    groups = paired.partition_by("seal", "area_a_m2", "area_b_m2", maintain_order=True)
    return [fit for group in groups if (fit := _closure(group)) is not None]


def _closure(points: pl.DataFrame) -> ClosureFit | None:
    seal, nominal = points["seal"][0], {side: points[f"area_{side}_m2"][0] for side in "ab"}
    gauge = {side: points[f"gauge_{side}_pa"].to_numpy() for side in "ab"}
    # Force of the rig against each chamber, by nominal areas: the fit gives a factor on each.
    push = {"a": -nominal["a"] * gauge["a"], "b": nominal["b"] * gauge["b"]}
    unsure = {side: nominal[side] * rms(points[f"u_{side}_pa"].to_numpy()) for side in "ab"}
    factors = _factors(gauge, push, unsure, max(nominal.values()))
    if not factors or len(points) < len(factors) + 1:
        return None
    # Half the sum of the forces of both directions at equal positions does not contain friction.
    offset, weight = points["offset_n"].to_numpy(), points["weight_n"].to_numpy()
    total = offset + push["a"] + push["b"] + weight
    varied = sum(factors, ())
    # A chamber at constant pressure acts with its nominal area.
    force = total - weight - sum(push[side] for side in "ab" if side not in varied)
    matrix = np.column_stack([*(sum(push[s] for s in sides) for sides in factors), np.ones(len(points))])
    solution = np.linalg.lstsq(matrix, force, rcond=None)[0]
    residual = force - matrix @ solution
    dof = len(points) - matrix.shape[1]
    deviation = np.sqrt(residual @ residual / dof) if dof > 0 else np.nan
    errors = deviation * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    doubt = _contradiction(points, residual) if dof > 0 else "few"
    freedom = 0 if doubt else dof
    lead = max(varied, key=lambda side: np.ptp(gauge[side]))
    sizes = {side: nominal[side] for side, *_ in factors}
    if len(factors[0]) == 2:  # the same force follows from many pairs of areas
        sizes = {NET: float(np.std(push["a"] + push["b"]) / np.std(gauge[lead]))}
    estimates = zip(sizes.items(), solution, errors, strict=False)
    areas = {side: _estimate(k * area, error * area, freedom, "m2") for (side, area), k, error in estimates}
    zero = _estimate(solution[-1], errors[-1], freedom, "N")
    parts = []
    for side, area in areas.items():
        off, low, high = (100 * (value / sizes[side] - 1) for value in (area.value, area.low, area.high))
        shown = sentence("closure.area", side=side, area_cm2=area.value * 1e4, off=off)
        parts.append(sentence("closure.area_interval", area=shown, low=low, high=high) if not doubt else shown)
    far = any(abs(area.value / sizes[side] - 1) > IMPLAUSIBLE_AREA for side, area in areas.items())
    why = "implausible" if far else "together" if NET in areas else "one_side" if len(areas) == 1 else None
    end = sentence(f"closure.zero_{doubt or 'interval'}", zero=zero) + (sentence(f"closure.{why}") if why else "")
    return ClosureFit(
        group=seal,
        recordings=tuple(points["recording"]),
        areas_m2=areas,
        nominal_m2=sizes,
        force_zero_n=zero,
        pressure_pa=gauge[lead],
        half_sum_force_n=total,
        residual_n=residual,
        degrees_of_freedom=dof,
        statement=f"{seal}: {', '.join(parts)}; {end}.",
    )


def _contradiction(points: pl.DataFrame, residual_n: Array) -> str:
    """Return "speed" or "recording" if residuals differ between speeds or recordings (one-way F-test), else ""."""
    from scipy.stats import f_oneway

    points = points.with_columns(residual_n=residual_n)
    by_speed = _neighbours(points, "speed_m_s", lambda v: SAME_SPEED * v)
    for name, groups in (("speed", by_speed), ("recording", points.partition_by("recording"))):
        values = [group["residual_n"].to_numpy() for group in groups]
        if 1 < len(groups) < len(points) and f_oneway(*values).pvalue < CONTRADICTION:
            return name
    return ""


def _factors(gauge: Columns, push: Columns, unsure: NamedNumbers, area: float) -> list[tuple[str, ...]]:
    """Return the chambers of each area factor that the data determine: one per chamber, one for both, or none."""
    sides = [side for side in ("a", "b") if np.ptp(gauge[side]) > MINIMUM_RANGE_PA]
    if len(sides) < 2:
        return [tuple(sides)] if sides else []
    spread = np.column_stack([push[side] - push[side].mean() for side in sides])
    _, (large, small), axes = np.linalg.svd(spread, full_matrices=False)
    noise = np.array([unsure[side] for side in sides])
    is_apart = small / np.sqrt(len(spread)) > RELIABLE * np.linalg.norm(axes[1] * noise)
    if small > TOGETHER * large and is_apart:
        return [("a",), ("b",)]
    net = push["a"] + push["b"]
    is_visible = np.ptp(net) > MINIMUM_RANGE_PA * area and np.std(net) > RELIABLE * np.linalg.norm(noise)
    return [("a", "b")] if is_visible else []


def _estimate(value: float, stderr: float, dof: int, unit: str) -> Estimate:
    """Return a value with its interval, which is unbounded without a redundant recording."""
    if dof <= 0:
        return Estimate(float(value), -np.inf, np.inf, np.nan, unit)
    return Estimate.of(float(value), float(stderr), dof, unit)


@dataclass(frozen=True)
class RunSpread:
    """Relative standard deviation between runs with equal seal, pressure and speed, pooled over all such groups.

    ``cells`` lists these groups: (seal, pressure in Pa, smallest friction, largest friction, relative difference).
    """

    relative: float
    degrees_of_freedom: int
    cells: tuple[tuple[str, float, float, float, float], ...]


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class PressureLine(Shown):
    """Friction = intercept + slope * gauge pressure for one seal.

    ``table`` has the points, and ``points`` its rows. ``band_mean_n`` is the line at 41 pressures ``band_pressure_pa``.
    ``band_low_n`` and ``band_high_n`` are the 95 % prediction interval of a further run. ``covariance`` is that of
    (intercept_n, slope_n_pa), and ``slope_interval_n_pa`` is a 95 % interval. ``basis`` states which runs determine the
    spread between runs. These are the runs of this seal (``own``) or of other seals (``pooled``). It is ``unknown``
    without such runs.
    """

    seal: str
    table: pl.DataFrame
    intercept_n: float
    slope_n_pa: float
    slope_interval_n_pa: Interval
    covariance: Array
    band_pressure_pa: Array
    band_mean_n: Array
    band_low_n: Array
    band_high_n: Array
    basis: str
    statement: str

    @property
    def points(self) -> tuple[SimpleNamespace, ...]:
        """Points of the line, with the columns of the table as attributes."""
        return tuple(SimpleNamespace(**row) for row in self.table.iter_rows(named=True))


def run_spread(points: pl.DataFrame) -> RunSpread | None:
    """Return the relative spread between runs; None without repeated runs."""
    cells: list[tuple[str, float, float, float, float]] = []
    squares, freedom = 0.0, 0
    for members in points.partition_by("seal", maintain_order=True):
        # Repeats have about the same pressure and speed.
        for some in _neighbours(members, "pressure_pa", lambda v: SAME_PRESSURE * max(abs(v), 1e4)):
            for cell in _neighbours(some, "speed_m_s", lambda v: SPEED_OF_REPEAT * v):
                runs = cell.partition_by("run", maintain_order=True)
                values = np.array([run["friction_n"].to_numpy().mean() for run in runs])
                if values.size >= 2:
                    mean = float(values.mean())
                    squares += ((values / mean - 1) ** 2).sum()
                    freedom += values.size - 1
                    low, high = float(values.min()), float(values.max())
                    cells.append((cell["seal"][0], cell["pressure_pa"][0], low, high, (high - low) / mean))
    if freedom == 0:
        return None
    return RunSpread(float(np.sqrt(squares / freedom)), freedom, tuple(cells))


def _neighbours(points: pl.DataFrame, column: str, width: Callable[[float], float]) -> list[pl.DataFrame]:
    """Group points by a column. Each value exceeds the lowest value v of its group by at most `width(v)`."""
    points = points.sort(column, maintain_order=True)
    values, starts = points[column].to_list(), [0]
    for i, value in enumerate(values):
        lowest = values[starts[-1]]
        if value - lowest > width(lowest):
            starts.append(i)
    return [points[begin:end] for begin, end in pairwise([*starts, len(values)])]


def fit_pressure_lines(points: pl.DataFrame) -> list[PressureLine]:
    """Fit the line over pressure to each seal with at least three recordings at two or more pressures.

    If speed was controlled and crossed with pressure, a line is fitted at each of up to five speeds.
    """
    spread = run_spread(points)
    lines = []
    for members in points.partition_by("seal", maintain_order=True):
        groups = _neighbours(members, "speed_m_s", lambda v: SAME_SPEED * v)
        crossed = [group for group in groups if _has_line(group)]
        if len(crossed) >= 2 and sum(map(len, crossed)) >= 0.6 * len(members):
            for i in evenly(len(crossed), SHOWN_SPEEDS):
                speed = 1e3 * crossed[i]["speed_m_s"][0]
                lines.append(_line(f"{members['seal'][0]} at {speed:.3g} mm/s", crossed[i], spread))
        elif _has_line(members):
            lines.append(_line(members["seal"][0], members, spread))
    return lines


def _has_line(points: pl.DataFrame) -> bool:
    return len(points) >= 3 and np.ptp(points["pressure_pa"].to_numpy()) > MINIMUM_RANGE_PA


def _line(title: str, points: pl.DataFrame, spread: RunSpread | None) -> PressureLine:
    names = ("pressure_pa", "friction_n", "speed_m_s", "speed_stderr_m_s")
    pressure, friction, speed, speed_stderr = (points[name].to_numpy() for name in names)
    scale = np.abs(pressure).max()
    matrix = np.column_stack([np.ones(pressure.size), pressure / scale])
    solution = np.linalg.lstsq(matrix, friction, rcond=None)[0]
    residual = friction - matrix @ solution
    dof = pressure.size - 2
    own = residual @ residual / dof
    repeated = spread is not None and any(cell[0] == points["seal"][0] for cell in spread.cells)
    basis = "own" if repeated else "pooled" if spread else "unknown"

    band = np.linspace(min(pressure.min(), 0.0), pressure.max(), BAND_POINTS)
    design = np.column_stack([np.ones(BAND_POINTS), band / scale])
    mean = design @ solution
    single, freedom = np.full(BAND_POINTS, own), float(dof)
    inverse = np.linalg.inv(matrix.T @ matrix)
    variance = own
    if spread is not None:
        # With several runs of this seal, scatter about the line and spread between runs both estimate
        # the deviation of a further recording; the larger one counts. With one run the scatter lacks
        # the spread between runs, so the pooled spread is added.
        between = (spread.relative * np.abs(mean)) ** 2
        typical = np.mean((spread.relative * friction) ** 2)
        single = np.maximum(single, between) if repeated else single + between
        variance = max(own, typical) if repeated else own + typical
        if typical > own:
            freedom = float(spread.degrees_of_freedom + (dof if repeated else 0))
    leverage = np.einsum("ij,jk,ik->i", design, inverse, design)
    half = student(freedom) * np.sqrt(single + variance * leverage)
    unit = np.diag([1.0, 1.0 / scale])
    has_changed = changed(speed, float(np.median(speed_stderr)))
    together = float(np.corrcoef(speed, pressure)[0, 1]) if has_changed else 0.0
    intercept_n, slope_n_pa = float(solution[0]), float(solution[1] / scale)
    covariance = unit @ (inverse * variance) @ unit
    half_n, half_n_pa = (student(freedom) * np.sqrt(np.diag(covariance))).tolist()
    word = "falls" if together < 0 else "rises"
    confounded = sentence("pressure_line.confounded", word=word, together=together)
    return PressureLine(
        seal=title,
        table=points,
        intercept_n=intercept_n,
        slope_n_pa=slope_n_pa,
        slope_interval_n_pa=(slope_n_pa - half_n_pa, slope_n_pa + half_n_pa),
        covariance=covariance,
        band_pressure_pa=band,
        band_mean_n=mean,
        band_low_n=mean - half,
        band_high_n=mean + half,
        basis=basis,
        statement=sentence(
            "pressure_line.line",
            seal=title,
            intercept=with_u(intercept_n, half_n),
            rise=with_u(slope_n_pa * 1e5, half_n_pa * 1e5, "N/bar"),
            interval=sentence(f"pressure_line.{basis}", percent=0.0 if spread is None else 100 * spread.relative),
            confounded=confounded if abs(together) > CONFOUNDED else "",
        ),
    )
