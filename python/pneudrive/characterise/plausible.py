"""What no rig and no drive can have measured: wrong units, columns and signs, before they come out as strange physics.

Impossible numbers are refused; numbers that are possible and unusual are doubts, which the friction map carries as
flags and the notes as sentences.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.motion import NOISE_FACTOR, noise_level, thinned
from pneudrive.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.characterise.drive_recording import DriveRecording
    from pneudrive.characterise.motion import Stroke
    from pneudrive.characterise.recording import Recording
    from pneudrive.describe import Drive

#: A position this share of the stroke beyond its ends is no overshoot into an end stop (assumed).
BEYOND_STROKE = 0.1
#: Pressures below this share of ambient, or above this multiple of the supply, are in another unit or gauge (assumed).
LOWEST, HIGHEST = 0.5, 3.0
#: Values by which a channel is judged: outliers do not count.
QUANTILES = (0.01, 0.99)
#: Samples further apart than this do not show a motion, s (assumed).
COARSEST_S = 0.1
#: A gap is longer than this multiple of the usual step, and than this, s.
GAP_STEPS, GAP_S = 5.0, 0.02
MOST_GAPS = 3
# What any rig can do (all assumed): beyond the first of each pair a recording is refused, beyond the second doubted.
LOWEST_PA = -5e3  # absolute: the zero of a transducer at vacuum may be this far off
PRESSURES_PA = (100e5, 20e5)
SPEEDS_M_S = (50.0, 10.0)
FORCES_N = (1e7, 1e6)
LONGEST_M = 100.0
BELOW_AMBIENT = 0.1  # of ambient pressure: lower ones are a vacuum, or gauge pressures written as absolute
UNFOLLOWED = 0.25  # of pressure times area: the force misses that much of it
SMALLEST_N = 1e-3  # friction that no force sensor of a piston drive sees
FULL_PRESSURE_PA = 10e5  # friction above what this pressure pushes on the piston would stop any drive


def check_plausible(recording: DriveRecording, drive: Drive) -> None:
    """Refuse a recording that cannot be of the drive.

    Raises
    ------
    RecordingError
        Time, position or pressures are in another unit, gauge, or beside the stroke.
    """
    where = str(recording.source or recording.name)
    step = float(np.median(np.diff(recording.time_s)))
    if step > COARSEST_S:
        raise RecordingError(
            f"the samples are {step:g} s apart",
            where=where,
            rule=f"time_s in seconds, at most {COARSEST_S:g} s from sample to sample",
            remedy='look at the unit of the time; a layout says it: time = { column = ..., unit = "ms" }',
        )
    stroke, ambient, supply = drive.cylinder.stroke_m, drive.ambient.pressure_pa, drive.supply_pressure_pa
    margin = BEYOND_STROKE * stroke
    _within(recording, "position_m", -margin, stroke + margin, f"from 0 to the stroke of {stroke:g} m",
            "look at the unit and the zero of the position, or at cylinder.stroke", where)  # fmt: skip
    for column in ("pressure_a_pa", "pressure_b_pa"):
        _within(recording, column, LOWEST * ambient, HIGHEST * supply,
                f"absolute, in Pa: between the ambient pressure of {ambient:g} Pa and the supply's of {supply:g} Pa",
                "look at the unit, and whether it is gauge pressure; a layout says both", where)  # fmt: skip


def _within(
    recording: DriveRecording, column: str, lower: float, upper: float, rule: str, remedy: str, where: str
) -> None:
    if column not in recording or not np.isfinite(recording[column]).any():
        return
    low, high = np.nanquantile(recording[column], QUANTILES)
    if low < lower or high > upper:
        raise RecordingError(
            f"{column} goes from {low:.4g} to {high:.4g}, which this drive cannot do",
            where=where,
            rule=rule,
            remedy=remedy,
        )


#: What a drive's recording tells where the piston stands.
AT_REST = ("cylinder.leakage", "cylinder.heat_transfer", "cylinder.wall_temperature", "cylinder.dead_volume")


def refuse_standstill(recordings: Sequence[DriveRecording], free: Sequence[str]) -> None:
    """Refuse to look for what only motion shows where the piston does not move in any recording.

    Raises
    ------
    RecordingError
        It does not.
    """
    sought = [name for name in free if not name.startswith(AT_REST)]
    seen = [r for r in recordings if "position_m" in r and np.isfinite(r["position_m"]).any()]
    if not sought or not seen or any(_moves(r["position_m"]) for r in seen):
        return
    travel = max(float(np.nanmax(r["position_m"]) - np.nanmin(r["position_m"])) for r in seen)
    raise RecordingError(
        f"the piston does not move, and without motion nothing is known of {', '.join(sought)}",
        where=", ".join(str(r.source or r.name) for r in seen),
        value=f"its position changes by {travel * 1e3:.3g} mm",
        rule="a drive is identified from recordings in which it moves",
        remedy="look at the column of the position; a test of a fixed volume has a description and a layout of its "
        'own: [volume], and kind = "fixed-volume"',
    )


def _moves(position_m: NDArray[np.float64]) -> bool:
    known = position_m[np.isfinite(position_m)]
    return known.size > 0 and float(np.ptp(known)) > NOISE_FACTOR * noise_level(known)


def time_gaps(recordings: Sequence[DriveRecording]) -> list[str]:
    """Say where samples are missing: what the valve was told there is not known."""
    out = []
    for recording in recordings:
        time = recording.time_s
        steps = np.diff(time)
        at = np.flatnonzero(steps > max(GAP_STEPS * float(np.median(steps)), GAP_S))
        if at.size:
            places = ", ".join(f"{time[i]:.4g} .. {time[i + 1]:.4g} s" for i in at[:MOST_GAPS])
            more = f" and {at.size - MOST_GAPS} more" if at.size > MOST_GAPS else ""
            out.append(
                f"{recording.name} has no samples in {places}{more}: the command is taken as held there; if it was "
                "not, cut the recording in two"
            )
    return out


def refuse_pressure(name: str, pressure_pa: NDArray[np.float64], where: str) -> None:
    """Refuse an absolute pressure that lies below vacuum or beyond any rig; single outliers do not count.

    Raises
    ------
    RecordingError
        It does.
    """
    if pressure_pa.size == 0 or _all_within(pressure_pa, LOWEST_PA, PRESSURES_PA[0]):
        return
    low, high = np.quantile(thinned(pressure_pa), QUANTILES)
    if low < LOWEST_PA or high > PRESSURES_PA[0]:
        worst, why = (low, "lies below vacuum") if low < LOWEST_PA else (high, "no pneumatic rig has")
        raise RecordingError(
            f"{name} is {worst / 1e5:.4g} bar absolute, which {why}",
            where=where,
            rule=f"from 0 to {PRESSURES_PA[0] / 1e5:g} bar absolute",
            remedy="look at the column, its unit, its decimal sign, and whether it is gauge or absolute: in the "
            "layout, or in what wrote the file",
        )


def refuse_channels(recording: Recording) -> None:
    """Refuse a recording of a rig whose pressures or forces no rig can have.

    Raises
    ------
    RecordingError
        A pressure below vacuum, or pressures or forces beyond any rig.
    """
    where = str(recording.source or recording.name)
    for channel in ("pressure_a_pa", "pressure_b_pa"):
        refuse_pressure(channel.removesuffix("_pa"), getattr(recording, channel), where)
    if recording.force_n.size and not _all_within(recording.force_n, -FORCES_N[0], FORCES_N[0]):
        strongest = float(np.quantile(np.abs(thinned(recording.force_n)), QUANTILES[1]))
        _no_more("the force reaches", strongest, FORCES_N[0], "N", "force", where)


def refuse_impossible(recording: Recording, strokes: Sequence[Stroke]) -> None:
    """Refuse a recording of a rig that holds what no rig can do.

    Raises
    ------
    RecordingError
        A pressure below vacuum, or pressures, speeds, travels or forces beyond any rig.
    """
    refuse_channels(recording)
    where = str(recording.source or recording.name)
    fastest = max(abs(stroke.speed_m_s) for stroke in strokes)
    longest = max(abs(stroke.to_m - stroke.from_m) for stroke in strokes)
    _no_more("the piston moves at", fastest, SPEEDS_M_S[0], "m/s", "time and the position", where)
    _no_more("the strokes are", longest, LONGEST_M, "m long", "position", where)


def _no_more(what: str, value: float, limit: float, unit: str, column: str, where: str) -> None:
    if value > limit:
        raise RecordingError(
            f"{what} {value:.4g} {unit}, which no pneumatic rig does",
            where=where,
            rule=f"at most {limit:g} {unit}",
            remedy=f"look at the unit of the {column}: in the layout, or in what wrote the file",
        )


def _all_within(values: NDArray[np.float64], low: float, high: float) -> bool:
    """Whether not even a single outlier is outside: the quantiles, which take long, are not asked for then."""
    return bool(low <= values.min() and values.max() <= high)


def doubts_of(
    recording: Recording,
    gauge_pa: dict[str, float],
    speed_m_s: float,
    friction_n: float,
    offset_n: float,
    u_offset_n: float,
) -> dict[str, str]:
    """Say what about a speed level is possible, and hardly so: flag -> what to look at, in a sentence.

    A recording whose areas are zero has no pressure to be held against: its force is the friction itself.
    """
    ambient, found = recording.ambient_pressure_pa, {}
    lowest, highest = min(gauge_pa.values()), max(gauge_pa.values())
    areas = recording.area_a_m2, recording.area_b_m2
    if lowest < -BELOW_AMBIENT * ambient:
        found["below_ambient"] = (
            f"a chamber is at {(lowest + ambient) / 1e5:.3g} bar absolute, below ambient pressure: a "
            "vacuum, or gauge pressures that the layout calls absolute"
        )
    if highest + ambient > PRESSURES_PA[1] or speed_m_s > SPEEDS_M_S[1]:
        found["beyond_usual"] = (
            f"pressures up to {(highest + ambient) / 1e5:.3g} bar absolute at {speed_m_s:.3g} m/s "
            "are unusual for pneumatic drives: look at the units of pressure, position and time"
        )
    pushed = gauge_pa["b"] * areas[1] - gauge_pa["a"] * areas[0] + recording.weight_n
    friction, missed = abs(friction_n), abs(offset_n)  # the offset is NaN where one direction is missing
    if any(areas) and missed > max(UNFOLLOWED * abs(pushed), friction, 3.0 * u_offset_n) and abs(pushed) > friction:
        found["force_not_pressure"] = (
            f"the mean force of both directions is {pushed + offset_n:.4g} N where pressure times area (and "
            f"weight) is {pushed:.4g} N: look at the sign and unit of the force, the chamber of each pressure, gauge "
            "or absolute, and the bore; or the sensor was zeroed under pressure"
        )
    if any(areas) and friction > FULL_PRESSURE_PA * max(areas):
        found["friction_beyond_piston"] = (
            f"a friction of {friction:.4g} N is more than {FULL_PRESSURE_PA / 1e5:g} bar push on the piston "
            f"({FULL_PRESSURE_PA * max(areas):.4g} N): look at the unit of the force and at the bore"
        )
    if any(areas) and friction < SMALLEST_N:
        found["no_friction"] = (
            f"a friction of {friction:.2g} N is less than a force sensor sees: look at the column and unit of the force"
        )
    return found
