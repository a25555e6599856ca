"""Correction of a recording for known errors of its sensors, before it is compared with a model."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import FitError
from pneudrive.identify.dynamic.sensors import CHANNELS, Sensor, channels_of, command_delay
from pneudrive.numbers import plain
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.signals.drive_recording import DriveRecording


def corrected(
    recording: DriveRecording, sensors: Mapping[str, Sensor | Mapping[str, Any]] | None
) -> tuple[DriveRecording, list[str]]:
    """Correct a recording for offsets, gains and the delay of the command; return it with a note.

    Parameters
    ----------
    recording : DriveRecording
    sensors : mapping or None
        Channel -> `Sensor` or its keywords, as of `identify`; offset, gain and lag are numbers here.

    Raises
    ------
    FitError
        The recording lacks a channel, or a number is free.
    """
    if not sensors:
        return recording, []
    delay = command_delay(sensors)
    present = [name for name, column in CHANNELS.items() if column in recording]
    columns, said = dict(recording.columns), []
    if delay.free or any(channel.free for channel in channels_of(present, sensors)):
        raise FitError("validate fits no numbers", remedy="Fit free numbers by identify, and pass its fit to validate.")
    for channel in channels_of(present, sensors):
        if channel.offset != 0.0 or channel.gain != 1.0:
            columns[channel.column] = (columns[channel.column] - channel.offset) / channel.gain
            factor, unit = readable(channel.unit)
            gain = f", gain {plain(channel.gain, 5)}" if channel.gain != 1.0 else ""
            said.append(f"{channel.name} offset {plain(channel.offset / factor)} {unit}{gain}")
        if channel.lag > 0.0:
            said.append(f"{channel.name} lag of {plain(1e3 * channel.lag)} ms, which is not corrected")
    if delay.value_s != 0.0:
        time, command = recording.time_s, recording["command"]
        held = np.searchsorted(time, time - delay.value_s + 1e-9 * recording.duration_s, side="right") - 1
        columns["command"] = command[np.clip(held, 0, time.size - 1)]
        said.append(f"command that acts {plain(1e3 * delay.value_s)} ms late")
    if not said:
        return recording, []
    note = f"{recording.name}: corrected for known errors of its sensors: {'; '.join(said)}"
    return replace(recording, columns=columns), [note]
