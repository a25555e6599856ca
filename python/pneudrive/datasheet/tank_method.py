"""Air of a cycle from a tank that feeds the drive, disconnected from the mains: measured and simulated.

    m = V (p_1 - p_2) / (n R T)       V volume of the tank, m3; T its temperature at rest, that of the room, K;
                                      p_1, p_2 its pressures at rest before and after n cycles, Pa; R of the drive's gas

The gas cools during outflow, so the recording must start and end at rest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive import units
from pneudrive.datasheet.characteristics.air import drawn_mass
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.datasheet.strokes import litres_anr
from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.signals.drive_recording import read_volume_recordings
from pneudrive.signals.layout import Layout
from pneudrive.signals.load import find_layout

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pneudrive.describe.drive import Drive
    from pneudrive.signals.drive_recording import VolumeRecording

KIND = "fixed-volume"
#: Labels of a recording, and an example of each.
LABELS = {"tank_volume": "20 l", "cycles": "25", "half_period": "1 s"}
RESTING = 0.02  # share of the samples at each end whose mean is a pressure at rest
STILL = 5e-4  # largest relative change of the pressure among them


class TankAir(NamedTuple):
    """Air of a cycle, measured and simulated, litres ANR."""

    name: str
    cycle: str
    measured: float
    simulated: float
    synthetic: bool


def is_of_tank(path: Path, layout: Path | None) -> bool:
    """Return whether a file is a recording of a fixed volume by its layout."""
    found = find_layout(path) if layout is None else Layout.load(layout)
    return found is not None and found.kind == KIND


def tank_air(drive: Drive, recordings: Sequence[Path], layout: Path | None) -> list[TankAir]:
    """Read the air of a cycle from recordings of the tank, and simulate these cycles at its mean pressure.

    Raises
    ------
    RecordingError, LayoutError
        A recording cannot be used: a label is missing, or the pressure is not at rest at its ends.
    """
    return [_air(drive, one) for one in read_volume_recordings(list(recordings), layout)]


def _air(drive: Drive, recording: VolumeRecording) -> TankAir:
    volume, half = _label(recording, "tank_volume", "m3"), _label(recording, "half_period", "s")
    cycles = _label(recording, "cycles", "")
    before, after = _at_rest(recording)
    room, density = drive.ambient.temperature_k, drive.gas.anr_density_kg_m3
    mass = volume * (before - after) / (cycles * drive.gas.gas_constant_j_kg_k * room)
    fed = HeldDrive(drive.replace({"supply.pressure": f"{0.5 * (before + after)!r} Pa abs"}))
    cycle = f"half period {recording.labels['half_period']}"
    simulated = litres_anr(drawn_mass(fed, 1.0, half), density)
    return TankAir(recording.name, cycle, litres_anr(mass, density), simulated, "synthetic" in recording.labels)


def _label(recording: VolumeRecording, key: str, unit: str) -> float:
    where, example = str(recording.source or recording.name), f'[labels] {key} = "{LABELS[key]}" in the layout'
    if key not in recording.labels:
        raise RecordingError(
            f"the air of a tank needs its value {key.replace('_', ' ')}", where=where, remedy=f"Write {example}."
        )
    text = recording.labels[key]
    try:
        value = units.parse(text, unit) if unit else float(text)
    except (PneudriveError, ValueError):
        value = np.nan
    if not 0.0 < value < np.inf:
        raise RecordingError(
            f'{key} = "{text}" is not valid', where=where, rule="above zero", remedy=f"Write {example}."
        )
    return value


def _at_rest(recording: VolumeRecording) -> tuple[float, float]:
    """Return the pressures before and after the cycles."""
    count = max(int(RESTING * recording.pressure_pa.size), 2)
    where, found = str(recording.source or recording.name), []
    for which, part in (("begins", recording.pressure_pa[:count]), ("ends", recording.pressure_pa[-count:])):
        half = count // 2
        moved = abs(float(part[:half].mean() - part[half:].mean())) / float(part.mean())
        if moved > STILL:
            raise RecordingError(
                f"the tank is not at rest where its recording {which}",
                where=where,
                value=f"its pressure changes by {100.0 * moved:.2g} % in this part",
                rule=f"at most {100.0 * STILL:g} % within {100.0 * RESTING:g} % of the recording",
                remedy="Record until the tank has the temperature of the room again.",
            )
        found.append(float(part.mean()))
    if found[1] >= found[0]:
        raise RecordingError("the pressure of the tank does not fall", where=where, rule="the drive empties the tank")
    return found[0], found[1]
