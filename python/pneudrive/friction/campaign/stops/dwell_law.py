"""Breakaway against stop duration and pressure: slope per decade, laws in comparison, limits of the stops."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.estimate.groups import cells
from pneudrive.friction.campaign.stops.dwell_curve import DwellCurve, DwellData, fit_curve
from pneudrive.friction.campaign.stops.dwell_forms import fit_forms
from pneudrive.friction.campaign.stops.dwell_series import DwellPressure, DwellSeries, durations_of
from pneudrive.friction.campaign.stops.dwell_statements import dwell_statements
from pneudrive.friction.conditions import PA_PER_BAR, TOLD, classify_pressures
from pneudrive.friction.sentences import say

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.estimate.estimates import Estimate
    from pneudrive.friction.campaign.stops.stop import Stop
    from pneudrive.friction.conditions import Condition
    from pneudrive.friction.sentences import Statement

    Array = NDArray[np.float64]

#: Duration of the slope: the stop of the source paper [bracha].
REFERENCE_S = 15.0
INSIDE = 1.5  # factor by which the durations must exceed it on both sides
GRID_POINTS = 61
SAME_PLACE_M = 1e-3
SAME_PRESSURE_PA = 100.0


def fit_dwell(stops: Sequence[Stop], ambient_pressure_pa: float) -> tuple[tuple[DwellSeries, ...], list[Statement]]:
    """Describe breakaway against stop duration.

    Parameters
    ----------
    stops : sequence of Stop
    ambient_pressure_pa : float

    Returns
    -------
    tuple of DwellSeries, list of Statement
        One series for each set of levels, restart speed and axis (held, released), with determined and undetermined
        values.
    """
    groups: dict[tuple, list[Stop]] = {}
    for stop in stops:
        groups.setdefault((*stop.condition.levels, round(stop.speed_m_s, 6), stop.released), []).append(stop)
    series, statements = [], []
    for key in sorted(groups):
        one = _series(groups[key], ambient_pressure_pa)
        series.append(one)
        statements += dwell_statements(one, groups[key])
    return tuple(series), statements


def _series(stops: list[Stop], ambient: float) -> DwellSeries:
    used = [s for s in stops if s.usable]
    conditions = sorted({s.condition for s in used})
    enough = [c for c in conditions if durations_of([s for s in used if s.condition == c]) >= 2]
    used = [s for s in used if s.condition in enough]
    series = DwellSeries(
        levels=stops[0].condition.title,
        speed_m_s=stops[0].speed_m_s,
        released=stops[0].released,
        conditions=tuple(enough),
        stops=tuple(used),
        left_out=len(stops) - len(used),
        reference_s=_reference([s.dwell_s for s in used]),
        running_n=_running(used or stops),
    )
    curve = fit_curve(_data(used, enough)) if used else None
    return replace(series, **_results(series, curve, ambient)) if curve is not None else series


def _results(series: DwellSeries, curve: DwellCurve, ambient: float) -> dict[str, Any]:
    at = np.log10([series.reference_s])
    low, high = float(curve.data.log_s.min()), float(curve.data.log_s.max())
    slopes, gains = curve.slopes(at), curve.gains(low, high)
    # Inertia adds to every peak, but less if the contact is softer: at most all of it over the durations.
    u = series.inertia_n / max(high - low, 0.3) / np.sqrt(12.0)
    grid = np.linspace(low, high, GRID_POINTS)
    shown = curve.values(grid).estimates()
    ends = {"increment_n": "value", "low_n": "low", "high_n": "high"}
    slope = slopes.mean().estimates()[0].widened(u)
    return {
        "slopes": tuple(e.widened(u) for e in slopes.estimates()),
        "mean_slopes": tuple(e.widened(u) for e in gains.estimates()),
        "slope": slope,
        "mean_slope": gains.mean().estimates()[0].widened(u),
        "increment": curve.values(at).mean().estimates()[0],
        "share": slope.scaled(1.0 / series.running_n, "") if series.running_n > 0 else None,
        "duration_s": 10.0**grid,
        **{name: np.array([getattr(e, end) for e in shown]).reshape(-1, GRID_POINTS) for name, end in ends.items()},
        "laws": fit_forms(curve, series.reference_s),
        "pressure": _pressure(curve, at, ambient),
        "scatter_n": curve.fit.most_probable_sd("scatter"),
        "block_n": curve.fit.most_probable_sd("block"),
        "outlying": tuple(k for k, w in zip(curve.data.key, curve.weight, strict=True) if w < 0.7),
        "curve": curve,
    }


def _reference(durations: list[float]) -> float:
    if not durations:
        return REFERENCE_S
    low, high = min(durations), max(durations)
    if low * INSIDE <= REFERENCE_S <= high / INSIDE:
        return REFERENCE_S
    return float(f"{np.sqrt(low * high):.3g}")


def _running(stops: Sequence[Stop]) -> float:
    """Average running friction; the mean of both directions removes the offset."""
    by_direction = [np.mean([s.running_n for s in stops if s.direction == d]) for d in {s.direction for s in stops}]
    return float(np.mean(by_direction)) if by_direction else float("nan")


def _data(stops: list[Stop], conditions: list[Condition]) -> DwellData:
    place = np.array([(s.direction, round(s.position_m / SAME_PLACE_M)) for s in stops], dtype=np.int64)
    return DwellData(
        key=tuple(s.key for s in stops),
        duration_s=np.array([s.dwell_s for s in stops]),
        increment_n=np.array([s.increment_n for s in stops]),
        stderr_n=np.array([s.increment_stderr_n for s in stops]),
        condition=np.array([conditions.index(s.condition) for s in stops], dtype=np.int64),
        place=cells(*place.T),
        began_s=np.array([s.began_s for s in stops]),
        block=np.array([s.block for s in stops], dtype=np.int64),
        conditions=tuple(conditions),
        drift_prior_n=_running_drift(stops) * float(np.ptp([s.increment_n for s in stops])),
    )


def _running_drift(stops: Sequence[Stop]) -> float:
    """Return the relative drift of running friction over half the campaign. The same drift is assumed for ageing."""
    time = np.array([s.began_s for s in stops])
    if np.ptp(time) == 0:
        return 0.0
    running = np.array([s.running_n for s in stops])
    for direction in {s.direction for s in stops}:
        own = np.array([s.direction == direction for s in stops])
        running[own] -= running[own].mean()
    slope = float(np.polyfit((time - time.mean()) / np.ptp(time), running, 1)[0])
    return abs(slope) / 2.0 / max(abs(_running(stops)), 1e-9)


def _pressure(curve: DwellCurve, at: Array, ambient: float) -> DwellPressure | None:
    """Regress slopes and increments of the conditions on their pressures, as linear functions of one model."""
    gauge = np.array([(c.pressure_a_pa - ambient, c.pressure_b_pa - ambient) for c in curve.data.conditions])
    if len(gauge) < 2 or not (np.ptp(gauge, axis=0) > SAME_PRESSURE_PA).any():
        return None
    kind = classify_pressures(gauge / PA_PER_BAR)
    names = () if kind == "line" else TOLD.get(kind, ("sum",))
    found: dict[str, Estimate] = {}
    if names:
        away = gauge - gauge.mean(axis=0)
        columns = [away[:, 1] if name == "b" else away[:, 0] for name in names]
        rows = np.linalg.pinv(np.column_stack([np.ones(len(gauge)), *columns]))[1:].astype(np.float64)
        for word, functionals in (("slope", curve.slopes(at)), ("increment", curve.values(at))):
            estimates = functionals.combine(rows).estimates("N/Pa")
            found |= {f"{word}_{name}": estimate for name, estimate in zip(names, estimates, strict=True)}
    return DwellPressure(say(f"stops.pressure_{kind}").text, **found)
