"""Friction against pressure per seal, with a prediction interval that includes the spread between runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import changed, student
from pneudrive.friction.recording.closure import MINIMUM_RANGE_PA
from pneudrive.friction.reduction.condition import ALL_RECORDINGS as ALL_RECORDINGS
from pneudrive.friction.reduction.condition import group_of
from pneudrive.friction.sentences import sentence
from pneudrive.numbers import with_u
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pneudrive.friction.reduction.level import RecordingResult

BAND_POINTS = 41
SAME_SPEED = 0.02  # controlled speeds closer than this are one level
SHOWN_SPEEDS = 5
CONFOUNDED = 0.7  # correlation of speed and pressure above which their effects are confounded
SPEED_OF_REPEAT = 0.25  # largest difference of speed between repeats without controlled speed
SAME_PRESSURE = 0.1  # recordings within this share of their pressure are repeats


@dataclass(frozen=True)
class FrictionPoint:
    """Friction of one recording and speed level. ``speed_stderr_m_s`` is the scatter of its strokes' speeds."""

    recording: str
    seal: str
    run: str
    pressure_pa: float
    speed_m_s: float
    friction_n: float
    expanded_n: float
    speed_stderr_m_s: float = 0.0


def friction_points(result: RecordingResult) -> list[FrictionPoint]:
    """Return one point per speed class: friction at the higher gauge pressure of both chambers."""
    recording = result.recording
    return [
        FrictionPoint(
            recording=recording.name,
            seal=group_of(recording.labels),
            run=recording.labels.get("run", "1"),
            pressure_pa=level.larger_gauge_pa(recording.ambient_pressure_pa),
            speed_m_s=level.speed_m_s,
            friction_n=level.friction_n,
            expanded_n=level.expanded_n,
            speed_stderr_m_s=level.speed_stderr_m_s,
        )
        for level in result.levels
    ]


@dataclass(frozen=True)
class RunSpread:
    """Relative standard deviation between runs at one seal and pressure, pooled over all such cells.

    ``cells`` lists (seal, pressure in Pa, smallest, largest friction, relative difference).
    """

    relative: float
    degrees_of_freedom: int
    cells: tuple[tuple[str, float, float, float, float], ...]


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class PressureLine(Shown):
    """Friction = intercept + slope * gauge pressure for one seal.

    ``band_pressure_pa``, ``band_mean_n``, ``band_low_n``, ``band_high_n`` (41,) are the line and the 95 % prediction
    interval for the friction of a further run. ``covariance`` belongs to (intercept_n, slope_n_pa). ``basis`` is the
    source of the spread between runs: ``own`` runs, ``pooled`` from other seals, ``unknown``.
    """

    seal: str
    points: tuple[FrictionPoint, ...]
    intercept_n: float
    slope_n_pa: float
    covariance: NDArray[np.float64]
    band_pressure_pa: NDArray[np.float64]
    band_mean_n: NDArray[np.float64]
    band_low_n: NDArray[np.float64]
    band_high_n: NDArray[np.float64]
    basis: str
    speed_pressure_correlation: float
    statement: str


def run_spread(points: list[FrictionPoint]) -> RunSpread | None:
    """Return the relative spread between runs; None without repeated runs."""
    cells: list[tuple[str, float, float, float, float]] = []
    squares, freedom = 0.0, 0
    for seal in dict.fromkeys(p.seal for p in points):
        members = [p for p in points if p.seal == seal]
        if len({p.run for p in members}) < 2:
            continue
        for cell in _repeats(members):
            values = _run_means(cell)
            if values.size >= 2:
                mean = float(values.mean())
                squares += float(((values / mean - 1) ** 2).sum())
                freedom += values.size - 1
                low, high = float(values.min()), float(values.max())
                cells.append((seal, cell[0].pressure_pa, low, high, (high - low) / mean))
    if freedom == 0:
        return None
    return RunSpread(float(np.sqrt(squares / freedom)), freedom, tuple(cells))


def _repeats(points: list[FrictionPoint]) -> list[list[FrictionPoint]]:
    """Return the points of about the same pressure and speed."""
    cells: list[list[FrictionPoint]] = []
    for group in _neighbours(points, lambda p: p.pressure_pa, lambda v: SAME_PRESSURE * max(abs(v), 1e4)):
        cells += _neighbours(group, lambda p: p.speed_m_s, lambda v: SPEED_OF_REPEAT * v)
    return cells


def _neighbours(
    points: list[FrictionPoint], value: Callable[[FrictionPoint], float], width: Callable[[float], float]
) -> list[list[FrictionPoint]]:
    """Group points whose values are within a width above the lowest of the group."""
    groups: list[list[FrictionPoint]] = []
    for point in sorted(points, key=value):
        lowest = value(groups[-1][0]) if groups else 0.0
        if groups and value(point) - lowest <= width(lowest):
            groups[-1].append(point)
        else:
            groups.append([point])
    return groups


def _run_means(cell: list[FrictionPoint]) -> NDArray[np.float64]:
    runs = dict.fromkeys(p.run for p in cell)
    return np.array([float(np.mean([p.friction_n for p in cell if p.run == run])) for run in runs], dtype=np.float64)


def fit_pressure_lines(points: list[FrictionPoint]) -> list[PressureLine]:
    """Fit the line over pressure to each seal with at least three recordings at two or more pressures.

    If speed was controlled and crossed with pressure, a line is fitted at each of up to five speeds.
    """
    spread = run_spread(points)
    lines = []
    for seal in dict.fromkeys(p.seal for p in points):
        members = [p for p in points if p.seal == seal]
        for title, group in _speed_groups(seal, members):
            pressures = np.array([p.pressure_pa for p in group])
            if len(group) >= 3 and np.ptp(pressures) > MINIMUM_RANGE_PA:
                lines.append(_fit(title, seal, group, spread))
    return lines


def _speed_groups(seal: str, points: list[FrictionPoint]) -> list[tuple[str, list[FrictionPoint]]]:
    """Return points by speed if speed and pressure were crossed, otherwise all together."""
    groups = _neighbours(points, lambda p: p.speed_m_s, lambda v: SAME_SPEED * v)
    crossed = [g for g in groups if len(g) >= 3 and np.ptp([p.pressure_pa for p in g]) > MINIMUM_RANGE_PA]
    if len(crossed) < 2 or sum(len(g) for g in crossed) < 0.6 * len(points):
        return [(seal, points)]
    chosen = np.unique(np.linspace(0, len(crossed) - 1, SHOWN_SPEEDS).astype(int))
    return [(f"{seal} at {crossed[i][0].speed_m_s * 1e3:.3g} mm/s", crossed[i]) for i in chosen]


def _fit(title: str, seal: str, points: list[FrictionPoint], spread: RunSpread | None) -> PressureLine:
    pressure = np.array([p.pressure_pa for p in points])
    friction = np.array([p.friction_n for p in points])
    scale = float(np.abs(pressure).max())
    matrix = np.column_stack([np.ones(pressure.size), pressure / scale])
    solution = np.linalg.lstsq(matrix, friction, rcond=None)[0]
    residual = friction - matrix @ solution
    dof = pressure.size - 2
    own = float(residual @ residual) / dof
    repeated = spread is not None and any(cell[0] == seal for cell in spread.cells)
    basis = "own" if repeated else "pooled" if spread else "unknown"

    band = np.linspace(min(float(pressure.min()), 0.0), float(pressure.max()), BAND_POINTS)
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
        typical = float(np.mean((spread.relative * friction) ** 2))
        single = np.maximum(single, between) if repeated else single + between
        variance = max(own, typical) if repeated else own + typical
        if typical > own:
            freedom = float(spread.degrees_of_freedom + (dof if repeated else 0))
    leverage = np.einsum("ij,jk,ik->i", design, inverse, design)
    half = student(freedom) * np.sqrt(single + variance * leverage)
    unit = np.diag([1.0, 1.0 / scale])
    speeds = np.array([abs(p.speed_m_s) for p in points])
    scatter = float(np.median([p.speed_stderr_m_s for p in points]))
    together = float(np.corrcoef(speeds, pressure)[0, 1]) if changed(speeds, scatter) else 0.0
    covariance = np.asarray(unit @ (inverse * variance) @ unit, dtype=np.float64)
    slope = float(solution[1] / scale)
    return PressureLine(
        seal=title,
        points=tuple(points),
        intercept_n=float(solution[0]),
        slope_n_pa=slope,
        covariance=covariance,
        band_pressure_pa=band,
        band_mean_n=mean,
        band_low_n=mean - half,
        band_high_n=mean + half,
        basis=basis,
        speed_pressure_correlation=together,
        statement=_statement(title, float(solution[0]), slope, covariance, freedom, basis, together, spread),
    )


def _statement(
    seal: str,
    intercept: float,
    slope: float,
    covariance: NDArray[np.float64],
    freedom: float,
    basis: str,
    together: float,
    spread: RunSpread | None,
) -> str:
    half_n, half_n_pa = student(freedom) * np.sqrt(np.diag(covariance))
    interval = f"pressure_line.{basis if spread is not None else 'unknown'}"
    confounded = ""
    if abs(together) > CONFOUNDED:
        word = "falls" if together < 0 else "rises"
        confounded = sentence("pressure_line.confounded", word=word, together=together)
    return sentence(
        "pressure_line.line",
        seal=seal,
        intercept=with_u(intercept, half_n),
        rise=with_u(slope * 1e5, half_n_pa * 1e5, "N/bar"),
        interval=sentence(interval, percent=100 * spread.relative if spread is not None else 0.0),
        confounded=confounded,
    )
