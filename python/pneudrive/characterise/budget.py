"""Systematic uncertainty of friction and offset as in the GUM: one entry per source, combined at the end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.characterise.recording import Recording

COVERAGE_FACTOR = 2.0
# Assumed where the layout does not say; the budget marks each as assumed.
ASSUMED_PRESSURE_OF_RANGE = 0.005 / np.sqrt(3.0)  # limits of 0.5 % of full scale, rectangular
ASSUMED_FORCE_OF_LARGEST = 0.002 / np.sqrt(3.0)  # limits of 0.2 % of the largest force, rectangular
ASSUMED_BORE = 0.002  # of the bore: 0.05 mm on 25 mm
ASSUMED_ALIGNMENT_RAD = np.deg2rad(1.0)
# Share of a sensor's accuracy that changes with direction (hysteresis) and so survives the pairing.
ASSUMED_DIRECTION_SHARE = 1.0 / 3.0
USUAL_RANGES_PA = np.array([1, 1.6, 2.5, 4, 6, 10, 16, 25, 40, 100]) * 1e5


@dataclass(frozen=True)
class BudgetEntry:
    """One line: its standard uncertainty, and what it does to friction and to offset, in N.

    ``basis`` is "layout" (the accuracy was given), "assumed" or "data"; ``kind`` "A" or "B" (GUM).
    """

    source: str
    standard_uncertainty: float
    unit: str
    basis: str
    kind: str
    friction_n: float
    offset_n: float
    note: str = ""


@dataclass(frozen=True)
class DirectionMeans:
    """Means over the window in one direction, which the sensitivities are taken at."""

    force_n: float
    pressure_a_pa: float
    pressure_b_pa: float
    speed_m_s: float


def systematic_budget(
    recording: Recording,
    up: DirectionMeans,
    down: DirectionMeans,
    offset_slope_n_m: float = 0.0,
    sample_interval_s: float = 0.0,
) -> list[BudgetEntry]:
    """List what each systematic source does to friction (half difference) and offset (half sum).

    Parameters
    ----------
    recording
        Its ``accuracy`` entries are standard uncertainties.
    up, down
        Means in +x and -x over the window.
    offset_slope_n_m
        Change of offset over position: what a skew between channels turns into friction.
    sample_interval_s
        Channels are taken to be simultaneous within this interval.
    """
    entries: list[BudgetEntry] = []
    for side in ("a", "b"):
        entries += _pressure_entries(recording, side, up, down)
    entries += _force_entries(recording, up, down)
    entries += _geometry_entries(recording, up, down)
    skew = sample_interval_s / np.sqrt(12.0)
    speed = (abs(up.speed_m_s) + abs(down.speed_m_s)) / 2
    entries.append(
        BudgetEntry(
            "time skew between channels",
            skew,
            "s",
            "assumed",
            "B",
            abs(offset_slope_n_m) * speed * skew,
            0.0,
            "rectangular over one sampling interval",
        )
    )
    return entries


@dataclass(frozen=True)
class _Sensor:
    """A sensor in the balance: its accuracy, and what one unit of it is in N.

    ``reference`` is the value at which the whole accuracy may be an error of gain, ``change`` half the difference of
    the mean readings of both directions.
    """

    name: str
    unit: str
    uncertainty: float
    basis: str
    note: str
    newton_per_unit: float
    change: float
    reference: float

    def entries(self) -> list[BudgetEntry]:
        """List the common error, of which the pair leaves what changes with direction, and hysteresis."""
        common = self.uncertainty * self.newton_per_unit
        hysteresis = common * ASSUMED_DIRECTION_SHARE / float(np.sqrt(2.0))
        left = common * self.change / self.reference if self.reference else 0.0
        note = f"{self.note}; cancels in the pair but for the change of the reading with direction".lstrip("; ")
        share = "a third of the accuracy taken to change with direction"
        lost = self.uncertainty * ASSUMED_DIRECTION_SHARE
        return [
            BudgetEntry(f"{self.name}: common error", self.uncertainty, self.unit, self.basis, "B", left, common, note),
            BudgetEntry(f"{self.name}: hysteresis", lost, self.unit, "assumed", "B", hysteresis, hysteresis, share),
        ]


def _accuracy(recording: Recording, channel: str, assumed: float, words: str) -> tuple[float, str, str]:
    """Give the standard uncertainty of a channel, its basis and a note; the layout may itself call it assumed."""
    if channel not in recording.accuracy:
        return assumed, "assumed", words
    text = recording.calibration.get(channel, "")
    return recording.accuracy[channel], ("assumed" if text.lower().startswith("assumed") else "layout"), text


def _reference(recording: Recording, channel: str, otherwise: float, zero: float = 0.0) -> float:
    """Largest value that the sensor can give, where the layout says it."""
    if channel not in recording.limits:
        return otherwise
    return max(abs(limit - zero) for limit in recording.limits[channel])


def _pressure_entries(recording: Recording, side: str, up: DirectionMeans, down: DirectionMeans) -> list[BudgetEntry]:
    channel = f"pressure_{side}_pa"
    values, ambient = getattr(recording, channel), recording.ambient_pressure_pa
    if np.ptp(values) == 0 and channel not in recording.accuracy and abs(values[0] - ambient) < 1.0:
        return []  # open to ambient: nothing was measured, nothing acts
    largest = float(np.max(np.abs(values - ambient)))
    span = USUAL_RANGES_PA[np.searchsorted(USUAL_RANGES_PA, largest)] if largest <= USUAL_RANGES_PA[-1] else largest
    words = f"0.5 % of a {span / 1e5:g} bar range, rectangular"
    uncertainty, basis, note = _accuracy(recording, channel, float(span * ASSUMED_PRESSURE_OF_RANGE), words)
    return _Sensor(
        name=f"pressure {side}",
        unit="Pa",
        uncertainty=uncertainty,
        basis=basis,
        note=note,
        newton_per_unit=getattr(recording, f"area_{side}_m2"),
        change=abs(getattr(up, channel) - getattr(down, channel)) / 2,
        reference=_reference(recording, channel, float(span), ambient),
    ).entries()


def _force_entries(recording: Recording, up: DirectionMeans, down: DirectionMeans) -> list[BudgetEntry]:
    if recording.force_calibration is not None:
        known = recording.force_calibration
        found = known.doubts((up.force_n - down.force_n) / 2.0, (up.force_n + down.force_n) / 2.0)
        return [
            BudgetEntry(f"force: {name}", u, "N", "layout", "B", friction, offset, known.words())
            for name, (u, friction, offset) in found.items()
        ]
    largest = float(np.max(np.abs(recording.force_n)))
    words = "0.2 % of the largest force, rectangular"
    uncertainty, basis, note = _accuracy(recording, "force_n", largest * ASSUMED_FORCE_OF_LARGEST, words)
    return _Sensor(
        name="force",
        unit="N",
        uncertainty=uncertainty,
        basis=basis,
        note=note,
        newton_per_unit=1.0,
        change=abs(up.force_n - down.force_n) / 2,
        reference=_reference(recording, "force_n", largest),
    ).entries()


def _geometry_entries(recording: Recording, up: DirectionMeans, down: DirectionMeans) -> list[BudgetEntry]:
    full = max(recording.area_a_m2, recording.area_b_m2)
    bore = np.sqrt(4 * full / np.pi)
    if "area" in recording.accuracy:
        relative, basis, shown, unit = recording.accuracy["area"], "layout", recording.accuracy["area"], ""
    elif "bore_m" in recording.accuracy and bore > 0:
        relative, basis = 2 * recording.accuracy["bore_m"] / bore, "layout"
        shown, unit = recording.accuracy["bore_m"], "m"
    else:
        relative, basis, shown, unit = 2 * ASSUMED_BORE, "assumed", ASSUMED_BORE * bore, "m"
    ambient = recording.ambient_pressure_pa
    half_difference = half_sum = 0.0
    for side, sign in (("a", 1.0), ("b", -1.0)):
        area = getattr(recording, f"area_{side}_m2")
        p_up, p_down = (getattr(m, f"pressure_{side}_pa") - ambient for m in (up, down))
        half_difference += sign * area * (p_up - p_down) / 2
        half_sum += sign * area * (p_up + p_down) / 2
    alignment = recording.accuracy.get("alignment_rad", float(ASSUMED_ALIGNMENT_RAD))
    return [
        BudgetEntry(
            "bore (area)",
            float(shown),
            unit,
            basis,
            "B",
            abs(relative * half_difference),
            abs(relative * half_sum),
            "" if basis == "layout" else "0.2 % of the bore",
        ),
        BudgetEntry(
            "alignment of the force axis",
            alignment,
            "rad",
            "layout" if "alignment_rad" in recording.accuracy else "assumed",
            "B",
            abs(up.force_n - down.force_n) / 2 * alignment**2 / 2,
            abs(up.force_n + down.force_n) / 2 * alignment**2 / 2,
            "cosine error; a side load's own friction is friction of the rig and stays in the result",
        ),
    ]


def uncertainty_of(entries: Sequence[BudgetEntry], source: str) -> float:
    """Give the standard uncertainty of one source, in its unit; 0 where the budget does not list it."""
    return next((entry.standard_uncertainty for entry in entries if entry.source == source), 0.0)


def combined(entries: list[BudgetEntry]) -> tuple[float, float]:
    """Give the standard uncertainty of friction and of offset, sources taken as independent."""
    return (
        float(np.sqrt(sum(e.friction_n**2 for e in entries))),
        float(np.sqrt(sum(e.offset_n**2 for e in entries))),
    )


def expanded(stderr_n: float, u_systematic_n: float) -> float:
    """Give the expanded uncertainty U with k = 2, N."""
    return COVERAGE_FACTOR * float(np.hypot(np.nan_to_num(stderr_n), u_systematic_n))
