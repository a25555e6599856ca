"""Uncertainty budget of one row of the friction map, term by term, as in the GUM.

Measurand: friction, half the difference of the mean force balance in +x and in -x at equal positions. Terms are
independent, so their standard uncertainties add as root sum of squares; the expanded uncertainty has k = 2.
For a row of a recording (one speed level):

    stderr_n        type A   `chance_n`: scatter of the strokes' means, at least the noise within the strokes
    u_systematic_n  type B   `Level.budget`: for each source its sensitivity times its uncertainty

For a row of a campaign (one cycle):

    stderr_n        type A   `chance_n` of its strokes, and scatter from cycle to cycle
    u_systematic_n  type B   `campaign.curves.systematic`: gain, hysteresis, mean over position
                    type A   state of the campaign, and block or day

The parts of gain, hysteresis and zero of a cycle come from the same `systematic_budget` (`stated_shares`). With zero
runs and known weights, some of these parts are measured instead (``campaign/reading.py``).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pneudrive.arrays import Array, Interval, Row
from pneudrive.friction.strokes import CLOCK_S
from pneudrive.signals.recording import Recording

COVERAGE_FACTOR = 2.0
BEYOND_SHARE = 0.05  # of the drive's stroke, at its ends, that the moves leave out (assumed)
CLOCKS = "clocks of several loggers"
# Assumed if the layout does not state it; the budget marks each as assumed.
ASSUMED_PRESSURE_OF_RANGE = 0.005 / float(np.sqrt(3.0))  # limits of 0.5 % of full scale, rectangular
ASSUMED_FORCE_OF_LARGEST = 0.002 / np.sqrt(3.0)  # limits of 0.2 % of the largest force, rectangular
ASSUMED_BORE = 0.002  # of the bore: 0.05 mm on 25 mm
ASSUMED_ALIGNMENT_RAD = np.deg2rad(1.0)
ASSUMED_DIRECTION_SHARE = 1.0 / 3.0  # of a sensor's accuracy: changes with direction, so it survives the pairing
SENSORS = ("pressure_a_pa", "pressure_b_pa", "force_n")  # in the order of the budget
USUAL_RANGES_PA = np.array([1, 1.6, 2.5, 4, 6, 10, 16, 25, 40, 100]) * 1e5


@dataclass(frozen=True)
class BudgetEntry:
    """One source of uncertainty: its standard uncertainty, and its contributions to friction and offset in N.

    ``basis`` is "layout" (the accuracy was given), "assumed" or "data"; ``kind`` "A" or "B" (GUM).
    """

    source: str
    standard_uncertainty: float
    unit: str
    basis: str
    friction_n: float
    offset_n: float
    note: str = ""
    kind: str = "B"


def systematic_budget(
    recording: Recording,
    up: Row,
    down: Row,
    offset_slope_n_m: float = 0.0,
    sample_interval_s: float = 0.0,
    late_s: float = 0.0,
) -> list[BudgetEntry]:
    """Return the contribution of each systematic source to friction (half difference) and offset (half sum).

    Parameters
    ----------
    recording : Recording
        Its ``accuracy`` entries are standard uncertainties.
    up, down : dict
        Rows of `Strokes.sides`: means in +x and -x over the window.
    offset_slope_n_m, sample_interval_s : float
        Slope of the offset over position, and interval within which all channels are sampled. A time skew between them
        appears as friction.
    late_s : float
        Standard uncertainty of the times of the pressures.
    """
    entries = [entry for channel in SENSORS for entry in _sensor_entries(recording, channel, up, down)]
    # Areas of the piston.
    accuracy, basis, unit, note = recording.accuracy, "layout", "m", ""
    bore = np.sqrt(4 * max(recording.area_a_m2, recording.area_b_m2) / np.pi)
    if "area" in accuracy:
        relative, shown, unit = accuracy["area"], accuracy["area"], ""
    elif "bore_m" in accuracy and bore > 0:
        relative, shown = 2 * accuracy["bore_m"] / bore, accuracy["bore_m"]
    else:
        relative, shown, basis, note = 2 * ASSUMED_BORE, ASSUMED_BORE * bore, "assumed", "0.2 % of the bore"
    ambient = recording.ambient_pressure_pa
    half_difference = half_sum = 0.0
    for side, area in (("a", recording.area_a_m2), ("b", -recording.area_b_m2)):
        p_up, p_down = (m[f"pressure_{side}_pa"] - ambient for m in (up, down))
        half_difference += area * (p_up - p_down) / 2
        half_sum += area * (p_up + p_down) / 2
    friction, offset = abs(relative * half_difference), abs(relative * half_sum)
    entries.append(BudgetEntry("bore (area)", float(shown), unit, basis, friction, offset, note))
    angle = accuracy.get("alignment_rad", float(ASSUMED_ALIGNMENT_RAD))
    known = "layout" if "alignment_rad" in accuracy else "assumed"
    turned, shared = (half * angle**2 / 2 for half in _halves(up["force_n"], down["force_n"]))
    words = "cosine error; friction from a side load is friction of the rig and remains in the result"
    entries.append(BudgetEntry("alignment of the force axis", angle, "rad", known, turned, shared, words))
    skew, speed = sample_interval_s / np.sqrt(12.0), (abs(up["velocity_m_s"]) + abs(down["velocity_m_s"])) / 2
    turned, words = abs(offset_slope_n_m) * speed * skew, "rectangular over one sampling interval"
    entries.append(BudgetEntry("time skew between channels", skew, "s", "assumed", turned, 0.0, words))
    if recording.parallel:
        largest = max(f.uncertainty for f in recording.parallel)
        names = ", ".join(f.name for f in recording.parallel)
        area = _halves(up["parallel_n"], down["parallel_n"])
        entries.append(BudgetEntry("areas of parallel forces", largest, "", "layout", *area, names))
    if late_s != 0.0:  # the delay of several loggers, or as closed chambers show it
        basis = "assumed" if recording.parallel and late_s == CLOCK_S else "data"
        words = "delay of the pressures relative to the force"
        entries.append(BudgetEntry(CLOCKS, late_s, "s", basis, *_halves(up["late_n"], down["late_n"]), words))
    return entries


def _halves(up: float, down: float) -> Interval:
    """Return the absolute values of half the difference and half the sum of both directions."""
    return abs(up - down) / 2.0, abs(up + down) / 2.0


def unseen_n(pattern_n: Array, coverage: float) -> float:
    """Return the standard uncertainty, in N, of the mean over some position bins as the mean of the whole stroke.

    The uncertainty is the standard deviation of `pattern_n`, the friction in each bin, times the fraction of the stroke
    outside the bins. The bins cover the fraction ``coverage`` of the travel.
    """
    known = pattern_n[np.isfinite(pattern_n)]
    return (1.0 - coverage * (1.0 - BEYOND_SHARE)) * float(known.std()) if known.size else 0.0


def _sensor_entries(recording: Recording, channel: str, up: Row, down: Row) -> list[BudgetEntry]:
    """Return the budget entries of a sensor: common error and hysteresis, or those of a calibration.

    Half the difference of both directions contains only the error that changes with direction.

    The standard uncertainty of the channel is that of the layout, or assumed. At the largest reading, the whole
    uncertainty may be an error of gain.
    """
    values = getattr(recording, channel)
    if channel == "force_n":
        known = recording.force_calibration
        if known is not None:
            found = known.doubts((up["force_n"] - down["force_n"]) / 2.0, (up["force_n"] + down["force_n"]) / 2.0)
            return [
                BudgetEntry(f"force: {name}", u, "N", "layout", friction, offset, known.words())
                for name, (u, friction, offset) in found.items()
            ]
        name, unit, zero, newton_per_unit = "force", "N", 0.0, 1.0
        largest = float(np.max(np.abs(values)))
        u, note = largest * ASSUMED_FORCE_OF_LARGEST, "0.2 % of the largest force, rectangular"
    else:
        name, unit, zero = channel.removesuffix("_pa").replace("_", " "), "Pa", recording.ambient_pressure_pa
        if np.ptp(values) == 0 and channel not in recording.accuracy and abs(values[0] - zero) < 1.0:
            return []  # open to ambient: not measured, no force
        newton_per_unit = recording.area_a_m2 if channel == "pressure_a_pa" else recording.area_b_m2
        largest = usual_range(float(np.max(np.abs(values - zero))))
        u, note = largest * ASSUMED_PRESSURE_OF_RANGE, f"0.5 % of a {largest / 1e5:g} bar range, rectangular"
    basis = "assumed"
    if channel in recording.accuracy:
        u, note = recording.accuracy[channel], recording.calibration.get(channel, "")
        basis = "assumed" if note.lower().startswith("assumed") else "layout"
    limits = recording.limits.get(channel)
    reference = max(abs(limit - zero) for limit in limits) if limits else largest
    change = abs(up[channel] - down[channel]) / 2
    common = u * newton_per_unit
    left = common * change / reference if reference else 0.0
    hysteresis = common * ASSUMED_DIRECTION_SHARE / float(np.sqrt(2.0))
    note = f"{note}; cancels in the pair except for the change of the reading with direction".lstrip("; ")
    turns, lost = "a third of the accuracy is assumed to change with direction", u * ASSUMED_DIRECTION_SHARE
    return [
        BudgetEntry(f"{name}: common error", u, unit, basis, left, common, note),
        BudgetEntry(f"{name}: hysteresis", lost, unit, "assumed", hysteresis, hysteresis, turns),
    ]


def usual_range(largest_pa: float) -> float:
    """Return the smallest usual transducer range that contains a pressure, or the pressure if it exceeds all ranges."""
    above = USUAL_RANGES_PA[largest_pa <= USUAL_RANGES_PA]
    return float(above[0]) if above.size else largest_pa


def chance_n(scatter_n: Array | float, noise_n: Array | float) -> Array:
    """Return the type A standard uncertainty of friction in N: scatter between strokes, but at least their noise.

    The scatter is NaN for single strokes (`pair_stderr`). The noise is that of the bins within the strokes, without
    their pattern over position.
    """
    return np.fmax(scatter_n, noise_n)


def stated_shares(
    recording: Recording,
    up: Row,
    down: Row,
    late_s: float = 0.0,
) -> dict[str, float | bool]:
    """Return the parts of a cycle's budget that campaigns treat separately, by column of the cycle.

    All cycles have the same sensors. The parts are proportional to friction, constant, or removed by zero runs.
    """
    entries = systematic_budget(recording, up, down, late_s=late_s)
    # Hysteresis needs a reading that changes with direction: a constant pressure has none.
    turns = {c: abs(up[f"pressure_{c}_pa"] - down[f"pressure_{c}_pa"]) for c in "ab"}
    moves = {f"pressure {c}: hysteresis": turns[c] * getattr(recording, f"area_{c}_m2") / 2.0 for c in "ab"}
    constant = ("hysteresis", "linearity")
    changing = [min(e.friction_n, moves.get(e.source, np.inf)) for e in entries if e.source.endswith(constant)]
    shared = [e for e in entries if not e.source.endswith("hysteresis")]
    # Tares remove the zero; the rest of an accuracy grows with the reading.
    ambient = recording.ambient_pressure_pa
    readings = {
        "force: common error": _of_range(recording, "force_n", (up["force_n"] + down["force_n"]) / 2.0, 0.0),
        "pressure a: common error": _of_range(recording, "pressure_a_pa", up["pressure_a_pa"], ambient),
        "pressure b: common error": _of_range(recording, "pressure_b_pa", up["pressure_b_pa"], ambient),
        "bore (area)": 1.0,
        **dict.fromkeys(("force: gain", "force: linearity", "force: creep"), 1.0),
    }
    named = entries if recording.force_calibration is not None else []
    offsets = {e.source: e.offset_n * readings.get(e.source, 0.0) for e in shared}
    return {
        "u_gain_n": combined_n(e.friction_n for e in shared if not e.source.endswith(constant)),
        "u_hysteresis_n": combined_n(changing),
        "u_offset_n": combined_n(offsets.values()),
        **{f"u_pressure_{c}_n": offsets.get(f"pressure {c}: common error", 0.0) for c in "ab"},
        **{e.source: e.friction_n for e in named if e.source.startswith("force: ")},
        "u_air_n": combined_n(e.friction_n for e in entries if e.source.startswith(("pressure", "bore"))),
        "assumed": any(e.source == "force: common error" and e.basis == "assumed" for e in entries),
    }


def combined_n(parts: Iterable[float]) -> float:
    """Return the combined standard uncertainty, in N, of the parts from independent sources."""
    return float(np.sqrt(sum(part**2 for part in parts)))


def _of_range(recording: Recording, channel: str, reading: float, zero: float) -> float:
    """Return the reading as a fraction of the sensor's range, both measured from `zero`."""
    limits = recording.limits.get(channel)
    reach = max(abs(v - zero) for v in limits) if limits else np.max(np.abs(getattr(recording, channel) - zero))
    return min(abs(reading - zero) / float(reach), 1.0) if reach > 0 else 0.0
