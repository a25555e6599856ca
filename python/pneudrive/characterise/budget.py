"""Systematic uncertainty of friction and offset as in the GUM: one entry per source, combined at the end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
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


def _said(recording: Recording, channel: str) -> tuple[str, str]:
    """Basis and note of an accuracy that was given: the layout may itself call it assumed."""
    text = recording.calibration.get(channel, "")
    return ("assumed" if text.lower().startswith("assumed") else "layout"), text


def _pressure_entries(recording: Recording, side: str, up: DirectionMeans, down: DirectionMeans) -> list[BudgetEntry]:
    channel = f"pressure_{side}_pa"
    values = getattr(recording, channel)
    area = getattr(recording, f"area_{side}_m2")
    ambient = recording.ambient_pressure_pa
    if np.ptp(values) == 0 and channel not in recording.accuracy and abs(values[0] - ambient) < 1.0:
        return []  # open to ambient: nothing was measured, nothing acts
    largest = float(np.max(np.abs(values - ambient)))
    if channel in recording.accuracy:
        uncertainty = recording.accuracy[channel]
        basis, note = _said(recording, channel)
    else:
        span = USUAL_RANGES_PA[np.searchsorted(USUAL_RANGES_PA, largest)] if largest <= USUAL_RANGES_PA[-1] else largest
        uncertainty, basis = float(span * ASSUMED_PRESSURE_OF_RANGE), "assumed"
        note = f"0.5 % of a {span / 1e5:g} bar range, rectangular"
    change = abs(getattr(up, channel) - getattr(down, channel)) / 2
    common = uncertainty * area
    direction = common * ASSUMED_DIRECTION_SHARE / np.sqrt(2.0)
    return [
        BudgetEntry(
            f"pressure {side}: common error",
            uncertainty,
            "Pa",
            basis,
            "B",
            common * change / largest if largest else 0.0,
            common,
            f"{note}; cancels in the pair but for the pressure's change with direction".lstrip("; "),
        ),
        BudgetEntry(
            f"pressure {side}: hysteresis",
            uncertainty * ASSUMED_DIRECTION_SHARE,
            "Pa",
            "assumed",
            "B",
            direction,
            direction,
            "a third of the accuracy taken to change with direction",
        ),
    ]


def _force_entries(recording: Recording, up: DirectionMeans, down: DirectionMeans) -> list[BudgetEntry]:
    largest = float(np.max(np.abs(recording.force_n)))
    if "force_n" in recording.accuracy:
        uncertainty = recording.accuracy["force_n"]
        basis, note = _said(recording, "force_n")
    else:
        uncertainty, basis = largest * ASSUMED_FORCE_OF_LARGEST, "assumed"
        note = "0.2 % of the largest force, rectangular"
    change = abs(up.force_n - down.force_n) / 2
    direction = uncertainty * ASSUMED_DIRECTION_SHARE / np.sqrt(2.0)
    return [
        BudgetEntry(
            "force: common error and zero",
            uncertainty,
            "N",
            basis,
            "B",
            uncertainty * change / largest if largest else 0.0,
            uncertainty,
            f"{note}; cancels in the pair but for the force's change with direction".lstrip("; "),
        ),
        BudgetEntry(
            "force: hysteresis",
            uncertainty * ASSUMED_DIRECTION_SHARE,
            "N",
            "assumed",
            "B",
            direction,
            direction,
            "a third of the accuracy taken to change with direction",
        ),
    ]


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


def combined(entries: list[BudgetEntry]) -> tuple[float, float]:
    """Give the standard uncertainty of friction and of offset, sources taken as independent."""
    return (
        float(np.sqrt(sum(e.friction_n**2 for e in entries))),
        float(np.sqrt(sum(e.offset_n**2 for e in entries))),
    )


def expanded(stderr_n: float, u_systematic_n: float) -> float:
    """Give the expanded uncertainty U with k = 2, N."""
    return COVERAGE_FACTOR * float(np.hypot(np.nan_to_num(stderr_n), u_systematic_n))
