"""Recordings of a driven piston: its motion as straight lines, and both pressures on a grid of times."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.describe.circuit import Circuit
from pneudrive.errors import CommandError, RecordingError
from pneudrive.signals.load import load_recordings
from pneudrive.signals.motion import NOISE_FACTOR, noise_level
from pneudrive.signals.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.signals.layout import Layout

    Array = NDArray[np.float64]

MOST_GRID = 4500  # times at which pressures are compared
COARSEST_S = 0.1  # largest step of these times, unless the recording has fewer samples
TOLERANCE = 1e-4  # largest distance of the straight lines from the measured positions, of the travel
AT_REST_S, AT_REST = 0.5, 0.002  # first seconds in which the travel is below this share: the start is at rest
OPEN_CHANGE, OPEN_VOLUME = 0.03, 1.1  # relative change of a pressure below which a chamber is open; ratio of volumes


@dataclass(frozen=True, eq=False)
class DrivenRecording:
    """A recording of a driven piston.

    Attributes
    ----------
    recording : Recording
    nodes : tuple of ndarray
        Times and positions between which the motion is straight.
    grid_s : ndarray
        Times of the comparison, from 0.
    pressures_pa : ndarray
        Measured pressures a and b at these times, shape (2, n).
    positions_m : ndarray
        Positions at these times.
    noise_pa : ndarray
        Noise and resolution of both pressures.
    at_rest : bool
        Whether it begins at rest.
    """

    recording: Recording
    nodes: tuple[Array, Array]
    grid_s: Array
    pressures_pa: Array
    positions_m: Array
    noise_pa: Array
    at_rest: bool
    labels: dict[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.recording.name

    @property
    def ranges_pa(self) -> Array:
        """Range of each pressure."""
        return np.ptp(self.pressures_pa, axis=1)

    def is_open(self, volumes: Array) -> bool:
        """Whether pressures stay constant although the volumes change: the chambers are open."""
        steady = self.ranges_pa / self.pressures_pa.mean(axis=1)
        ratio = volumes.max(axis=1) / volumes.min(axis=1)
        return bool((steady < OPEN_CHANGE).all() and (ratio > OPEN_VOLUME).any())


def check_follow(follow: str) -> None:
    """Refuse a value of the argument `follow` other than ``"motion"``."""
    if follow != "motion":
        raise CommandError(f"follow = {follow!r} is not known", rule='the only value is "motion"')


def refuse_circuit(drive: object) -> None:
    """Refuse a circuit where a drive with a valve command is fitted or validated."""
    if isinstance(drive, Circuit):
        raise CommandError(
            f"{drive.name} is a circuit, not a drive",
            rule="a drive runs under the recorded command of its valve",
            remedy='if its piston follows the recorded position, add follow="motion"',
        )


def driven_recordings(
    recordings: Iterable[str | Path | Recording], layout: Layout | str | Path | None = None
) -> list[DrivenRecording]:
    """Read recordings of a driven piston: time, position and both pressures, with a force if there is one.

    Raises
    ------
    RecordingError, LayoutError
        A file cannot be read so.
    """
    items = list(recordings)
    files = [item for item in items if not isinstance(item, Recording)]
    read = iter(load_recordings(files, layout)) if files else iter(())
    return [driven_recording(item if isinstance(item, Recording) else next(read)) for item in items]


def driven_recording(recording: Recording) -> DrivenRecording:
    """Prepare one recording.

    Raises
    ------
    RecordingError
        Too few samples are left.
    """
    values = [recording.time_s, recording.position_m, recording.pressure_a_pa, recording.pressure_b_pa]
    keep = np.all([np.isfinite(value) for value in values], axis=0)
    keep &= np.r_[True, np.diff(recording.time_s) > 0.0]
    recording = recording.at(keep)
    time, position = recording.time_s - recording.time_s[0], recording.position_m
    if time.size < 100:
        raise RecordingError(f"{time.size} samples are left", where=recording.name, rule="at least 100")
    pressures = np.array([recording.pressure_a_pa, recording.pressure_b_pa])
    usual = float(np.median(np.diff(time)))
    stride = max(int(np.ceil(time.size / MOST_GRID)), int(COARSEST_S / usual), 1)
    noise = np.array([max(noise_level(pressure), _step(pressure) / np.sqrt(12.0), 1.0) for pressure in pressures])
    travel = float(np.ptp(position))
    kept = straight_lines(time, position, max(TOLERANCE * travel, NOISE_FACTOR * noise_level(position)))
    begins = position[time <= AT_REST_S]
    return DrivenRecording(
        recording,
        (time[kept], position[kept]),
        time[::stride],
        pressures[:, ::stride],
        position[::stride],
        noise,
        bool(np.ptp(begins) < AT_REST * travel),
    )


def _step(values: Array) -> float:
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0.0]
    return float(steps.min()) if steps.size else 0.0


def straight_lines(time_s: Array, position_m: Array, tolerance_m: float) -> NDArray[np.intp]:
    """Return samples so that straight lines between them are within a tolerance of the motion (Douglas and Peucker)."""
    keep = np.zeros(time_s.size, dtype=bool)
    keep[[0, -1]] = True
    parts = [(0, time_s.size - 1)]
    while parts:
        a, b = parts.pop()
        if b - a < 2:
            continue
        slope = (position_m[b] - position_m[a]) / (time_s[b] - time_s[a])
        off = np.abs(position_m[a + 1 : b] - position_m[a] - slope * (time_s[a + 1 : b] - time_s[a]))
        worst = int(np.argmax(off))
        if off[worst] > tolerance_m:
            at = a + 1 + worst
            keep[at] = True
            parts += [(a, at), (at, b)]
    return np.flatnonzero(keep)
