"""Measurement of a recording at two times: value, difference and slope, also for another recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import CommandError, LayoutError, RecordingError
from pneudrive.files.content import exists
from pneudrive.repr_tables import Card, Shown
from pneudrive.signals.channels import first_fall, open_channels, pairs
from pneudrive.signals.layout import Layout
from pneudrive.signals.load import find_layout, load_drive_motion, load_recording
from pneudrive.signals.motion import find_strokes
from pneudrive.signals.samples import SampleFault, find_faults
from pneudrive.signals.trajectories import is_trajectory, read_trajectory
from pneudrive.simulation.trajectory import SUFFIXES
from pneudrive.units import parse

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.signals.channels import ChannelFile, FileChannel
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

    Array = NDArray[Any]


@dataclass(frozen=True)
class MeasuredChannel:
    """One channel at two samples.

    Attributes
    ----------
    recording : str
        File.
    label, unit : str
        Unit of the channel. Channels of another recording use the unit of the first.
    time_s : (float, float)
        Times of the samples. Times of another recording are on the clock of the first.
    values : (float, float)
    """

    recording: str
    label: str
    unit: str
    time_s: tuple[float, float]
    values: tuple[float, float]

    @property
    def difference(self) -> float:
        """Second value minus the first one."""
        return self.values[1] - self.values[0]

    @property
    def slope(self) -> float:
        """Difference divided by the time between the samples, unit per s; NaN if both samples are the same."""
        between = self.time_s[1] - self.time_s[0]
        return self.difference / between if between else float("nan")


@dataclass(frozen=True, repr=False)
class Measurement(Shown):
    """Result of `measure`.

    Attributes
    ----------
    channels : tuple of MeasuredChannel
    shift_s : float
        Shift added to the times of the other recording. 0 without one.
    faults : dict of str to SampleFault
        Faults of the recording, by kind; see `pneudrive.signals.samples.find_faults`. Empty if its layout does not name
        the position.
    unknown : str
        Why no faults are known, for instance as time runs backwards; empty where nothing hinders.
    notes : tuple of str
        Notes on the reading of the recordings, for instance that samples are counted.
    """

    channels: tuple[MeasuredChannel, ...]
    shift_s: float
    faults: dict[str, SampleFault]
    unknown: str = ""
    notes: tuple[str, ...] = ()

    def _card(self) -> Card:
        head = ("channel", "at", "to", "value", "value there", "difference", "per s")
        rows = [
            (
                f"{one.recording}: {one.label}{one.unit and f', {one.unit}'}",
                *(f"{number:.7g}" for number in (*one.time_s, *one.values, one.difference, one.slope)),
            )
            for one in self.channels
        ]
        notes = [f"{kind.replace('_', ' ')}: {one.count}" for kind, one in self.faults.items()]
        notes += [f"faults could not be searched: {self.unknown}"] if self.unknown else []
        return Card("Measurement", head, rows, [*notes, *self.notes])


def measure(
    recording: str | Path,
    at: float | str,
    to: float | str,
    *,
    beside: str | Path | None = None,
    strokes: tuple[int, int] = (1, 1),
) -> Measurement:
    """Measure between two times of a recording.

    Parameters
    ----------
    recording : str or Path
        File of any format. Its columns are defined by ``layout.toml`` next to it, or in the folder above.
    at, to : float or str
        Times, s, or ``"1.25 s"``; the nearest sample counts. Numbers of samples if the file has no increasing times.
    beside : str or Path, optional
        Another recording, of which the same channels are measured at the same times, in the same units.
    strokes : (int, int)
        Strokes of the recording and of the other one that are aligned, counted from 1.

    Returns
    -------
    Measurement
        Numbers of the file in the units of its layout, or without one in the file's units. Nothing is smoothed.

    Raises
    ------
    RecordingError, LayoutError
        As for `load_recordings`.
    CommandError
        A time is not valid, or a stroke does not exist.

    Examples
    --------
    >>> import tempfile
    >>> import pneudrive as pn
    >>> run = pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 0.6, 0.5 s: -0.6", "1 s")
    >>> path = pn.save(run, f"{tempfile.mkdtemp()}/run.parquet")
    >>> found = pn.measure(path, "0.1 s", "0.2 s").channels[0]
    >>> found.label, found.difference == float(run.position[200] - run.position[100])
    ('position', True)
    """
    path, other = Path(recording), None if beside is None else Path(beside)
    layout, others_layout = _layout(path), None if other is None else _layout(other)
    times, shift, unknown = (time_of(at), time_of(to)), 0.0, ""
    try:
        moved = motion_of(path, layout)
    except (RecordingError, LayoutError) as error:  # what can be read can be measured; aligned it cannot be
        if other is not None:
            raise
        moved, unknown = None, error.what
    with TemporaryDirectory() as folder:
        opened, clock = _opened(path, layout, Path(folder) / "own")
        notes = [f"{path.name}: {one}" for one in opened.notes]
        found = measured(path.name, opened.channels, *_at(opened, clock, times))
        if other is not None:
            second, others_clock = _opened(other, others_layout, Path(folder) / "beside")
            notes += [f"{other.name}: {one}" for one in second.notes]
            both = pairs(opened, second)
            if opened.time is None:
                what = f"{path.name} and {other.name} cannot be aligned on a stroke: samples are counted"
                raise CommandError(what, remedy="Correct their times: each time must be at least the previous one.")
            there = strokes_in(motion_of(other, others_layout))
            shift = shift_between((path.name, strokes_in(moved)), (other.name, there), strokes)
            seconds, values = _at(second, others_clock, (times[0] - shift, times[1] - shift))
            values = {pair.own.column: pair.of(values[pair.other.column]) for pair in both}
            found += measured(other.name, [pair.own for pair in both], seconds + shift, values)
    return Measurement(tuple(found), shift, {} if moved is None else find_faults(moved), unknown, tuple(notes))


def measured(
    name: str, channels: Sequence[FileChannel], time_s: Array, values: Mapping[str, Array]
) -> list[MeasuredChannel]:
    """Return channels at two samples, from their times and values, shape (2,) each."""
    ends = float(time_s[0]), float(time_s[1])
    each = ((channel, values[channel.column]) for channel in channels)
    return [MeasuredChannel(name, one.label, one.unit, ends, (float(own[0]), float(own[1]))) for one, own in each]


def nearest_sample(time_s: Array, at: float) -> int:
    """Return the index of the sample nearest to a time among increasing times.

    The earlier of two equally near samples.
    """
    after = min(int(np.searchsorted(time_s, at)), len(time_s) - 1)
    return after - 1 if after and at - time_s[after - 1] <= time_s[after] - at else after


def motion_of(path: Path, layout: Layout | None) -> Recording | None:
    """Return a recording of a rig or a drive by its layout, or a trajectory.

    None for others, whose motion is unknown.
    """
    if layout is not None:
        read = {"rig": load_recording, "drive": load_drive_motion}.get(layout.kind)
        return None if read is None else read(path, layout)
    return read_trajectory(path, path.stem) if path.suffix in SUFFIXES and is_trajectory(path) else None


def strokes_in(recording: Recording | None) -> list[tuple[float, float, Stroke]]:
    """Return begin and end of each stroke, s, and the stroke."""
    if recording is None:
        return []
    time = recording.time_s
    found = find_strokes(recording.name, time, recording.position_m)
    return [(float(time[one.start]), float(time[one.stop - 1]), one) for one in found]


def shift_between(
    own: tuple[str, Sequence[tuple[float, float, Stroke]]],
    other: tuple[str, Sequence[tuple[float, float, Stroke]]],
    numbers: tuple[int, int],
) -> float:
    """Return the shift for the times of another recording that aligns two strokes, s.

    Parameters
    ----------
    own, other : (str, sequence)
        Name of a recording and its strokes, from `strokes_in`.
    numbers : (int, int)
        Numbers of the strokes, from 1.

    Raises
    ------
    CommandError
        The stroke does not exist.
    """
    begins = []
    for (name, strokes), number in zip((own, other), numbers, strict=True):
        if not 1 <= number <= len(strokes):
            remedy = "Without a layout of a rig or a drive no strokes are known: pneudrive layout FILE proposes one."
            what = f"{name} has no stroke {number}"
            raise CommandError(what, value=f"{len(strokes)} strokes", remedy=None if strokes else remedy)
        begins.append(strokes[number - 1][0])
    return begins[0] - begins[1]


def time_of(given: float | str) -> float:
    """Read a time in s, or the number of a sample.

    Raises
    ------
    CommandError
        It is neither.
    """
    try:
        value = float(given)
    except ValueError:
        value = parse(str(given), "s")
    if not np.isfinite(value):
        raise CommandError(
            f'the time "{given}" is not finite', rule='a time such as "1.25 s", or the number of a sample'
        )
    return value


def _layout(path: Path) -> Layout | None:
    if not exists(path):
        raise CommandError(f"there is no recording {path}", remedy="Name a file that exists.")
    return None if path.suffix in SUFFIXES and is_trajectory(path) else find_layout(path)


def _opened(path: Path, layout: Layout | None, cache: Path) -> tuple[ChannelFile, Array]:
    """Open a recording, and return its times; if times do not increase, samples are counted instead."""
    file = open_channels(path, layout, cache)
    seconds, _ = file.read([], (0, file.count()))
    if not len(seconds):
        raise RecordingError("the file holds no samples", where=path.name)
    fall = first_fall(seconds, seconds[0])
    return (file, seconds) if fall is None else (file.counted(fall), np.arange(len(seconds), dtype=float))


def _at(file: ChannelFile, seconds: Array, times: tuple[float, float]) -> tuple[Array, dict[str, Array]]:
    """Return times and values of the samples nearest to two times."""
    rows = [nearest_sample(seconds, one) for one in times]
    names = [channel.column for channel in file.channels]
    each = [file.read(names, (row, row + 1))[1] for row in rows]
    return seconds[rows], {name: np.array([float(one[name][0]) for one in each]) for name in names}
