"""Implausible readings of a recording of a driven circuit: they are refused, or reported with the likely cause."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import FitError, RecordingError
from pneudrive.identify.follow.driven import SIDES
from pneudrive.identify.follow.problem import FollowPoint, solve_follow

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.identify.follow.driven import DrivenCircuit
    from pneudrive.identify.follow.motion import DrivenRecording
    from pneudrive.identify.follow.problem import FollowSolution

BEYOND = 0.03  # of the stroke: largest excess of a position
LEAST_TRAVEL = 0.1  # of the stroke: less travel than this is probably another unit
LEAST_LEVEL = 0.3  # of the ambient pressure: a closed chamber below it is read with another unit, or as gauge
TOGETHER = 0.5  # least correlation of a pressure with the position that counts
BETTER = 0.8  # another reading is named if its residuals are below this ratio
POOR = 0.03  # of the range: larger residuals mean that the model or the reading is wrong
NEAR_AMBIENT = 0.1  # of the ambient pressure: largest distance of an open chamber from it (assumed)
OPEN_TOGETHER = 0.2  # least correlation of an open chamber's pressure with the rate of its volume that counts (assumed)


def check_readings(driven: DrivenCircuit, records: Sequence[DrivenRecording]) -> list[str]:
    """Refuse recordings that cannot belong to the circuit; return warnings.

    Raises
    ------
    RecordingError
        The position leaves the stroke, a pressure is impossible, or the chambers are swapped.
    """
    doubts = []
    for record in records:
        x, stroke = record.positions_m, driven.stroke_m
        low, high = float(x.min()), float(x.max())
        if low < -BEYOND * stroke or high > (1.0 + BEYOND) * stroke:
            raise RecordingError(
                f"the position goes from {low:.4g} to {high:.4g} m, beyond the stroke of {stroke:.4g} m",
                where=record.name,
                remedy="check unit and zero of the position in the layout, or the stroke of the circuit",
            )
        small = ""
        if high - low < LEAST_TRAVEL * stroke:
            small = (
                f"the piston moves over {1e3 * (high - low):.3g} mm of {1e3 * stroke:.4g} mm: check the unit of the "
                "position"
            )
            doubts.append(f"{record.name}: {small}")
        if open_recordings(driven, [record]):
            doubts += [f"{record.name}: {text}" for text in _open_doubts(driven, record)]
            continue
        lowest = record.pressures_pa.min(axis=1)
        for side, change in zip(SIDES, record.ranges_pa, strict=True):
            if change == 0.0:
                rule = "both pressures of a driven piston are measured"
                what = f"the pressure of chamber {side} is constant"
                raise RecordingError(what, where=record.name, rule=rule, remedy=small or None)
        for side, value in zip(SIDES, lowest, strict=True):
            if value < LEAST_LEVEL * STANDARD_ATMOSPHERE_PA:
                raise RecordingError(
                    f"the pressure of chamber {side} falls to {value:.4g} Pa",
                    where=record.name,
                    rule="pressures of a gas spring are near or above the ambient pressure; they are absolute",
                    remedy="check the unit, and gauge or abs, in the layout",
                )
        _refuse_swapped(record)
    return doubts


def _refuse_swapped(record: DrivenRecording) -> None:
    """Refuse pressures that rise as the gas of their chamber expands."""
    ranges = record.ranges_pa / record.pressures_pa.mean(axis=1)
    together = [float(np.corrcoef(p, record.positions_m)[0, 1]) for p in record.pressures_pa]
    wrong = [together[0] > TOGETHER and ranges[0] > BEYOND, together[1] < -TOGETHER and ranges[1] > BEYOND]
    if any(wrong):
        words = "both pressures rise as the gas of their chambers expands" if all(wrong) else ""
        side = "a" if wrong[0] else "b"
        raise RecordingError(
            words or f"the pressure of chamber {side} rises as its gas expands",
            where=record.name,
            rule="chamber a grows with the position, chamber b shrinks",
            remedy="swap pressure_a and pressure_b in the layout, or reverse the position: scale = -1, with an offset",
        )


def _open_doubts(driven: DrivenCircuit, record: DrivenRecording) -> list[str]:
    """Return warnings on open chambers. Their pressure is ambient, and slightly lower while their gas expands."""
    ambient = float(driven.form["ambient"]["pressure_pa"])
    means = record.pressures_pa.mean(axis=1)
    far = {side: float(mean) for side, mean in zip(SIDES, means, strict=True)
           if abs(mean - ambient) > NEAR_AMBIENT * ambient}  # fmt: skip
    found = []
    if far:
        twice = all(abs(mean - 2.0 * ambient) < NEAR_AMBIENT * ambient for mean in means)
        shown = " and ".join(f"{mean / 1e5:.4g} bar in {side}" for side, mean in far.items())
        cause = "the pressures are read as gauge, but seem to be absolute" if twice else "check the unit"
        found.append(f"the chambers are open, but have {shown} at {ambient / 1e5:.4g} bar of the ambient air: {cause}")
    speed = np.gradient(record.positions_m, record.grid_s)
    moving = [side for side, p, way in zip(SIDES, record.pressures_pa, (1.0, -1.0), strict=True)
              if np.ptp(p) > 0.0 and np.corrcoef(p, way * speed)[0, 1] > OPEN_TOGETHER]  # fmt: skip
    if moving:
        found.append(
            f"the pressure of the open chamber {' and '.join(moving)} rises while its gas expands: pressure_a and "
            "pressure_b seem to be swapped"
        )
    return found


def open_recordings(driven: DrivenCircuit, records: Sequence[DrivenRecording]) -> list[DrivenRecording]:
    """Return the recordings whose chambers are open: their pressures stay constant."""
    return [r for r in records if r.is_open(np.array([*driven.volumes_m3(r.positions_m).values()]))]


def refuse_open(driven: DrivenCircuit, records: Sequence[DrivenRecording]) -> list[DrivenRecording]:
    """Return the recordings with closed chambers.

    Raises
    ------
    FitError
        No recording has closed chambers.
    """
    idle = open_recordings(driven, records)
    used = [record for record in records if record not in idle]
    if not used:
        raise FitError(
            "the pressures stay constant while the volumes change: the chambers are open",
            value=", ".join(record.name for record in idle),
            rule="volumes, heat transfer and leaks show in closed chambers only",
            remedy="use a recording with closed chambers; `pneudrive characterise` evaluates friction of this one",
        )
    return used


def other_readings(solution: FollowSolution) -> list[str]:
    """Return as text whether the recordings fit better with gauge or with absolute pressures."""
    problem = solution.problem
    ambient = float(problem.driven.form["ambient"]["pressure_pa"])
    base = _size(solution)
    found = []
    for shift, words in (
        (ambient, "read as absolute, but seem to be gauge"),
        (-ambient, "read as gauge, but seem to be absolute"),
    ):
        records = [replace(r, pressures_pa=r.pressures_pa + shift) for r in problem.records]
        if min(float(r.pressures_pa.min()) for r in records) < LEAST_LEVEL * ambient:
            continue
        other = replace(problem, records=records, weights=list(problem.weights))
        try:
            size = _size(solve_follow(other, FollowPoint(solution.point.shared, solution.point.local), passes=1))
        except FitError:
            continue
        # A reading is the cause only if the model fits with it. A wrong model says nothing about sensors.
        if size < min(BETTER * base, POOR):
            found.append(
                f"the pressures are {words}: with {'+' if shift > 0 else '-'}{ambient / 1e5:.4g} bar the residuals "
                f"fall to {100 * size / base:.0f} % of their present size; check gauge and abs in the layout"
            )
    return found


def poor_fit(solution: FollowSolution) -> list[str]:
    """Return the likely causes of residuals that are too large for this model."""
    worst = max(float(solution.rms(at).max()) for at in range(len(solution.problem.records)))
    if worst < POOR:
        return []
    return [
        f"the model does not fit: residuals of {100 * worst:.2g} % of the range. Identify volumes and heat transfer "
        "first. Else check areas and stroke of the circuit, the gas, whether the chambers are closed, the unit of the "
        "position, and gauge or abs of the pressures"
    ]


def _size(solution: FollowSolution) -> float:
    every = [solution.rms(at) for at in range(len(solution.problem.records))]
    return float(np.sqrt(np.mean(np.square(every))))
