"""Impossible values, from wrong units, columns or signs, are refused. Unusual ones become flags of the map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.signals.motion import NOISE_FACTOR, noise_level, thinned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.signals.drive_recording import DriveRecording
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

#: Quantiles by which a channel is judged, without outliers.
QUANTILES = (0.01, 0.99)
# Limits of any rig (all assumed): beyond the first of each pair a recording is refused, beyond the second doubted.
LOWEST_PA = -5e3  # absolute: largest error of a transducer's zero at vacuum
PRESSURES_PA = (100e5, 20e5)
SPEEDS_M_S = (50.0, 10.0)
SLOWEST_M_S = 5e-5  # a stroke of 50 mm in a quarter of an hour: slower ones are doubted, too
FORCES_N = (1e7, 1e6)
LONGEST_M = 100.0


def refuse_pressure(name: str, pressure_pa: NDArray[np.float64], where: str) -> None:
    """Refuse an absolute pressure below vacuum or beyond the range of any rig. Single outliers are ignored.

    Raises
    ------
    RecordingError
        If it does.
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
            remedy="check the column, its unit, its decimal sign, and whether it is gauge or absolute: in the "
            "layout, or in the program that wrote the file",
        )


def refuse_channels(recording: Recording) -> None:
    """Refuse a recording of a rig with impossible pressures or forces.

    Raises
    ------
    RecordingError
        If a pressure is below vacuum, or pressures or forces exceed those of any rig.
    """
    where = str(recording.source or recording.name)
    for channel in ("pressure_a_pa", "pressure_b_pa"):
        refuse_pressure(channel.removesuffix("_pa"), getattr(recording, channel), where)
    if recording.force_n.size and not _all_within(recording.force_n, -FORCES_N[0], FORCES_N[0]):
        strongest = float(np.quantile(np.abs(thinned(recording.force_n)), QUANTILES[1]))
        _no_more("the force reaches", strongest, FORCES_N[0], "N", "force", where)


def refuse_impossible(recording: Recording, strokes: Sequence[Stroke]) -> None:
    """Refuse a recording of a rig with impossible values.

    Raises
    ------
    RecordingError
        If a pressure is below vacuum, or pressures, speeds, travels or forces exceed those of any rig.
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
            f"{what} {value:.4g} {unit}, more than any pneumatic rig",
            where=where,
            rule=f"at most {limit:g} {unit}",
            remedy=f"check the unit of the {column}: in the layout, or in the program that wrote the file",
        )


def _all_within(values: NDArray[np.float64], low: float, high: float) -> bool:
    """Return whether all values are within; then the slow quantiles are not needed."""
    return bool(low <= values.min() and values.max() <= high)


#: A position beyond the ends by more than this share of the stroke is not an overshoot into an end stop (assumed).
BEYOND_STROKE = 0.1
#: Pressures below this share of ambient, or above this multiple of the supply, are in another unit or gauge (assumed).
LOWEST, HIGHEST = 0.5, 3.0
#: Samples further apart than this do not show a motion, s (assumed).
COARSEST_S = 0.1
#: A gap is longer than this multiple of the usual step, and than this, s.
GAP_STEPS, GAP_S = 5.0, 0.02
MOST_GAPS = 3
#: Numbers that a recording shows without motion of the piston.
AT_REST = ("cylinder.leakage", "cylinder.heat_transfer", "cylinder.wall_temperature", "cylinder.dead_volume")


def check_plausible(recording: DriveRecording, drive: Drive) -> None:
    """Refuse a recording that does not match the drive.

    Raises
    ------
    RecordingError
        Time, position or pressures have another unit, are gauge, or are outside the stroke.
    """
    where = str(recording.source or recording.name)
    step = float(np.median(np.diff(recording.time_s)))
    if step > COARSEST_S:
        raise RecordingError(
            f"the samples are {step:g} s apart",
            where=where,
            rule=f"time_s in seconds, at most {COARSEST_S:g} s from sample to sample",
            remedy='check the unit of the time; a layout states it: time = { column = ..., unit = "ms" }',
        )
    stroke, ambient, supply = drive.cylinder.stroke_m, drive.ambient.pressure_pa, drive.supply_pressure_pa
    margin = BEYOND_STROKE * stroke
    _column_within(recording, "position_m", -margin, stroke + margin, f"from 0 to the stroke of {stroke:g} m",
            "check the unit and the zero of the position, or cylinder.stroke", where)  # fmt: skip
    for column in ("pressure_a_pa", "pressure_b_pa"):
        _column_within(recording, column, LOWEST * ambient, HIGHEST * supply,
                f"absolute, in Pa: between ambient, {ambient:g} Pa, and supply, {supply:g} Pa",
                "check the unit, and whether it is gauge pressure; a layout states both", where)  # fmt: skip


def _column_within(
    recording: DriveRecording, column: str, lower: float, upper: float, rule: str, remedy: str, where: str
) -> None:
    if column not in recording or not np.isfinite(recording[column]).any():
        return
    low, high = np.nanquantile(recording[column], QUANTILES)
    if low < lower or high > upper:
        raise RecordingError(
            f"{column} goes from {low:.4g} to {high:.4g}, which is impossible for this drive",
            where=where,
            rule=rule,
            remedy=remedy,
        )


def refuse_standstill(recordings: Sequence[DriveRecording], free: Sequence[str]) -> None:
    """Refuse free numbers that need motion if the piston does not move in any recording.

    Raises
    ------
    RecordingError
        If it does not move.
    """
    names = [name for name in free if not name.startswith(AT_REST)]
    seen = [r for r in recordings if "position_m" in r and np.isfinite(r["position_m"]).any()]
    if not names or not seen or any(moves(r["position_m"]) for r in seen):
        return
    travel = max(float(np.nanmax(r["position_m"]) - np.nanmin(r["position_m"])) for r in seen)
    raise RecordingError(
        f"the piston does not move, and without motion {', '.join(names)} cannot be determined",
        where=", ".join(str(r.source or r.name) for r in seen),
        value=f"its position changes by {travel * 1e3:.3g} mm",
        rule="identification of a drive needs recordings with motion",
        remedy="check the column of the position; a test of a fixed volume has its own description and layout: "
        '[volume], and kind = "fixed-volume"',
    )


def moves(position_m: NDArray[np.float64]) -> bool:
    """Whether a position changes by more than its noise."""
    known = position_m[np.isfinite(position_m)]
    return known.size > 0 and float(np.ptp(known)) > NOISE_FACTOR * noise_level(known)


def time_gaps(recordings: Sequence[DriveRecording]) -> list[str]:
    """Return notes on gaps in the samples, during which the command of the valve is unknown."""
    out = []
    for recording in recordings:
        time = recording.time_s
        steps = np.diff(time)
        at = np.flatnonzero(steps > max(GAP_STEPS * float(np.median(steps)), GAP_S))
        if at.size:
            places = ", ".join(f"{time[i]:.4g} .. {time[i + 1]:.4g} s" for i in at[:MOST_GAPS])
            more = f" and {at.size - MOST_GAPS} more" if at.size > MOST_GAPS else ""
            out.append(
                f"{recording.name} has no samples in {places}{more}: the command is assumed constant there; if it was "
                "not, cut the recording in two"
            )
    return out
