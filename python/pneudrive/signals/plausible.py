"""Whether a recording matches its drive: units, zeros, motion, gaps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.signals.impossible import QUANTILES
from pneudrive.signals.motion import NOISE_FACTOR, noise_level

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.signals.drive_recording import DriveRecording

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
