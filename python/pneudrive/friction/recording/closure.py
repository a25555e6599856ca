"""Closure of the force balance: half the sum of both directions against pressure gives area and force zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import Estimate
from pneudrive.friction.reduction.condition import group_of
from pneudrive.friction.sentences import sentence
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.friction.reduction.level import Level
    from pneudrive.signals.recording import Recording

TOGETHER = 0.05  # pressures change together if the rest is below this share
IMPLAUSIBLE_AREA = 0.25  # relative difference from nominal that no tolerance of a bore explains
MINIMUM_RANGE_PA = 2e4  # pressures that differ by less are equal: they give neither area nor slope
# Least ratio of the independent spread of both pressures to the sensors' uncertainty. A noisy regressor biases its
# factor towards zero, by 1 / (1 + RELIABLE**2) at this limit.
RELIABLE = 5.0


@dataclass(frozen=True)
class ClosurePoint:
    """Half the sum of both directions' forces at one pressure, without friction.

    ``u_a_pa``, ``u_b_pa`` are the standard uncertainties of the two pressures.
    """

    recording: str
    group: str
    half_sum_force_n: float
    gauge_a_pa: float
    gauge_b_pa: float
    weight_n: float
    area_a_m2: float
    area_b_m2: float
    u_a_pa: float = 0.0
    u_b_pa: float = 0.0


def closure_point(recording: Recording, level: Level) -> ClosurePoint | None:
    """Return half the sum of both directions' forces at equal positions; None without both directions or a pressure."""
    if len(level.sides) != 2 or recording.area_a_m2 + recording.area_b_m2 == 0:
        return None
    gauge, weight = level.gauge_pa(recording.ambient_pressure_pa), recording.weight_n
    known = {entry.source: entry.standard_uncertainty for entry in level.budget}
    force = level.offset_n - gauge["a"] * recording.area_a_m2 + gauge["b"] * recording.area_b_m2 + weight
    return ClosurePoint(
        recording=recording.name,
        group=group_of(recording.labels),
        half_sum_force_n=force,
        gauge_a_pa=gauge["a"],
        gauge_b_pa=gauge["b"],
        weight_n=weight,
        area_a_m2=recording.area_a_m2,
        area_b_m2=recording.area_b_m2,
        u_a_pa=known.get("pressure a: common error", 0.0),
        u_b_pa=known.get("pressure b: common error", 0.0),
    )


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class ClosureFit(Shown):
    """Effective areas and force zero of one group of recordings (one seal, one geometry).

    ``areas_m2`` has an entry for each chamber whose pressure changed, ``nominal_m2`` the areas of the
    layout. ``force_zero_n`` is the reading of the sensor without friction and pressure. ``pressure_pa``,
    ``residual_n`` (points,) are the gauge pressure of the chamber that changed most and the residuals
    of the line. ``statement`` is a sentence.
    """

    group: str
    recordings: tuple[str, ...]
    areas_m2: dict[str, Estimate]
    nominal_m2: dict[str, float]
    force_zero_n: Estimate
    pressure_pa: NDArray[np.float64]
    half_sum_force_n: NDArray[np.float64]
    residual_n: NDArray[np.float64]
    residual_deviation_n: float
    degrees_of_freedom: int
    statement: str


def fit_closures(points: list[ClosurePoint]) -> list[ClosureFit]:
    """Fit  F = A_b p_b - A_a p_a + weight + zero  to each group, gauge pressures.

    Groups in which no pressure changes by more than 0.2 bar, or with fewer than two points, are left out. If both
    pressures change together, one factor on both areas is fitted; if their forces cancel within the sensors'
    uncertainty, no area can be determined.
    """
    groups: dict[tuple, list[ClosurePoint]] = {}
    for point in points:
        groups.setdefault((point.group, point.area_a_m2, point.area_b_m2), []).append(point)
    fits = [_fit(members) for members in groups.values()]
    return [fit for fit in fits if fit is not None]


def _fit(points: list[ClosurePoint]) -> ClosureFit | None:
    first = points[0]
    gauge = {side: np.array([getattr(p, f"gauge_{side}_pa") for p in points]) for side in ("a", "b")}
    # Force of the rig against each chamber, by nominal areas: the fit gives a factor on each.
    nominal = {"a": first.area_a_m2, "b": first.area_b_m2}
    push = {"a": -nominal["a"] * gauge["a"], "b": nominal["b"] * gauge["b"]}
    unsure = {
        side: nominal[side] * float(np.sqrt(np.mean([getattr(p, f"u_{side}_pa") ** 2 for p in points])))
        for side in ("a", "b")
    }
    factors = _factors(gauge, push, unsure, max(nominal.values()))
    if not factors or len(points) < len(factors) + 1:
        return None
    total = np.array([p.half_sum_force_n for p in points])
    force = total - np.array([p.weight_n for p in points])
    for side in ("a", "b"):
        if not any(side in sides for sides in factors):  # a chamber at constant pressure acts with its nominal area
            force = force - push[side]
    matrix = np.column_stack([*(sum(push[s] for s in sides) for sides in factors), np.ones(len(points))])
    solution = np.linalg.lstsq(matrix, force, rcond=None)[0]
    residual = np.asarray(force - matrix @ solution, dtype=np.float64)
    dof = len(points) - matrix.shape[1]
    deviation = float(np.sqrt(residual @ residual / dof)) if dof > 0 else float("nan")
    errors = deviation * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    found = {side: (k, nominal[side]) for k, sides in enumerate(factors) for side in sides}
    areas = {side: _estimate(solution[k] * area, errors[k] * area, dof, "m2") for side, (k, area) in found.items()}
    zero = _estimate(solution[-1], errors[-1], dof, "N")
    lead = max(areas, key=lambda side: float(np.ptp(gauge[side])))
    return ClosureFit(
        group=first.group,
        recordings=tuple(p.recording for p in points),
        areas_m2=areas,
        nominal_m2={side: nominal[side] for side in areas},
        force_zero_n=zero,
        pressure_pa=gauge[lead],
        half_sum_force_n=total,
        residual_n=residual,
        residual_deviation_n=deviation,
        degrees_of_freedom=dof,
        statement=_statement(first.group, areas, nominal, zero, dof, together=len(factors) < len(areas)),
    )


def _factors(
    gauge: dict[str, NDArray[np.float64]],
    push: dict[str, NDArray[np.float64]],
    unsure: dict[str, float],
    area: float,
) -> list[tuple[str, ...]]:
    """Return the areas that can be determined: each separately, both by one factor, or none."""
    sides = [side for side in ("a", "b") if np.ptp(gauge[side]) > MINIMUM_RANGE_PA]
    if len(sides) < 2:
        return [tuple(sides)] if sides else []
    spread = np.column_stack([push[side] - push[side].mean() for side in sides])
    _, (large, small), axes = np.linalg.svd(spread, full_matrices=False)
    scale = np.sqrt(len(spread))
    noise = np.array([unsure[side] for side in sides])
    if small > TOGETHER * large and small / scale > RELIABLE * np.linalg.norm(axes[1] * noise):
        return [("a",), ("b",)]
    net = push["a"] + push["b"]
    is_visible = np.ptp(net) > MINIMUM_RANGE_PA * area and np.std(net) > RELIABLE * np.linalg.norm(noise)
    return [("a", "b")] if is_visible else []


def _estimate(value: float, stderr: float, dof: int, unit: str) -> Estimate:
    if dof <= 0:
        return Estimate(float(value), float("-inf"), float("inf"), float("nan"), unit)
    return Estimate.of(float(value), float(stderr), dof, unit)


def _statement(
    group: str, areas: dict[str, Estimate], nominal: dict[str, float], zero: Estimate, dof: int, *, together: bool
) -> str:
    parts = []
    for side, area in areas.items():
        off, low, high = (100 * (value / nominal[side] - 1) for value in (area.value, area.low, area.high))
        shown = sentence("closure.area", side=side, area_cm2=area.value * 1e4, off=off)
        parts.append(sentence("closure.area_interval", area=shown, low=low, high=high) if dof > 0 else shown)
    far = any(abs(area.value / nominal[side] - 1) > IMPLAUSIBLE_AREA for side, area in areas.items())
    why = "implausible" if far else "together" if together else "one_side" if len(areas) == 1 else None
    end = sentence("closure.zero_interval" if dof > 0 else "closure.zero", zero=zero)
    return f"{group}: {', '.join(parts)}; {end}{sentence(f'closure.{why}') if why else ''}."
