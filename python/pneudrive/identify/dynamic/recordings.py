"""Selection of the columns of a recording for the comparison with the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError, nearest
from pneudrive.simulation.trajectory import meaning

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.signals.drive_recording import DriveRecording

#: Channel -> column of a recording and of the core.
CHANNELS = {
    meaning(column)[0]: column
    for column in (
        "position_m",
        "pressure_a_pa",
        "pressure_b_pa",
        "velocity_m_s",
        "temperature_a_k",
        "temperature_b_k",
        "friction_force_n",
    )
}
#: Default channels; others are compared on request.
USUAL = ("position", "pressure_a", "pressure_b")
LEAST_VALUES = 20


def channels_in(recording: DriveRecording, wanted: Sequence[str] | None) -> list[str]:
    """Return the channels of a recording to compare with the model.

    Parameters
    ----------
    recording : DriveRecording
    wanted : sequence of str or None
        None: position and pressures, if measured.

    Raises
    ------
    RecordingError
        A channel is unknown or missing in the recording, or no channel is given.
    """
    where = str(recording.source or recording.name)
    for name in wanted or ():
        if name not in CHANNELS:
            raise RecordingError(f"{name} is not a channel", where=where, remedy=nearest(name, CHANNELS))
        if CHANNELS[name] not in recording:
            raise RecordingError(
                f"the recording has no column {CHANNELS[name]}",
                where=where,
                value=f"columns: {', '.join(recording.columns)}",
            )
    found = [c for c in USUAL if CHANNELS[c] in recording] if wanted is None else list(wanted)
    if not found:
        raise RecordingError(
            "the recording has no channel to compare", where=where, rule=f"some of {', '.join(CHANNELS)}"
        )
    for name in found:
        if np.isfinite(recording[CHANNELS[name]]).sum() < LEAST_VALUES:
            raise RecordingError(f"{name} has fewer than {LEAST_VALUES} values", where=where)
    return found
