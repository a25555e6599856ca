"""Whether a recording can be one of a drive: units, zeros and gaps that would otherwise come out as strange physics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.characterise.drive_recording import DriveRecording
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
