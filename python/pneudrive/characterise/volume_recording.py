"""Recordings of a fixed volume: a pressure over time, and the opening of the line where that was recorded."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.characterise.layout import Layout, stem
from pneudrive.characterise.load import convert, layout_beside, read_raw
from pneudrive.characterise.plausible import refuse_pressure
from pneudrive.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LEAST_SAMPLES = 10


@dataclass(frozen=True, eq=False)  # holds arrays: equal only to itself
class VolumeRecording:
    """What was measured of a fixed volume.

    Attributes
    ----------
    name : str
    time_s : ndarray, shape (n,)
        Rising, from 0.
    pressure_pa : ndarray, shape (n,)
        Absolute.
    opening : ndarray, shape (n,)
        Share of the line's full opening, held from each sample to the next; 1 where nothing was recorded.
    labels : dict
    source : Path or None
    sha256 : str
        Of the three columns.
    """

    name: str
    time_s: Array
    pressure_pa: Array
    opening: Array
    labels: dict[str, str] = field(default_factory=dict)
    source: Path | None = None
    sha256: str = ""

    @property
    def duration_s(self) -> float:
        """Time of the last sample, s."""
        return float(self.time_s[-1])

    @property
    def steps(self) -> tuple[Array, Array]:
        """Times at which the opening changes, and what it changes to."""
        change = np.r_[True, np.diff(self.opening) != 0.0]
        return self.time_s[change], self.opening[change]


def volume_recording(
    columns: Mapping[str, Any],
    name: str = "recording",
    labels: Mapping[str, str] | None = None,
    source: Path | None = None,
) -> VolumeRecording:
    """Make a recording of columns in SI: ``time_s``, ``pressure_pa`` and, where it was recorded, ``command``.

    Samples that are not finite, and such that repeat a time, are left out.

    Raises
    ------
    RecordingError
        A column is missing, lengths differ, time runs backwards, too few samples are left, a pressure is impossible,
        or an opening is beyond 0 .. 1.
    """
    where = str(source or name)
    missing = [c for c in ("time_s", "pressure_pa") if c not in columns]
    if missing:
        raise RecordingError(
            f"the recording lacks {', '.join(missing)}",
            where=where,
            value=f"columns: {', '.join(map(str, columns))}",
            rule="a fixed volume has time_s and pressure_pa (absolute), and command where its line opens or shuts",
        )
    time, pressure = (np.asarray(columns[c], dtype=np.float64).ravel() for c in ("time_s", "pressure_pa"))
    opening = np.asarray(columns.get("command", np.ones(time.size)), dtype=np.float64).ravel()
    if not time.size == pressure.size == opening.size:
        shown = f"time_s: {time.size}, pressure_pa: {pressure.size}, command: {opening.size}"
        raise RecordingError("the columns differ in length", where=where, value=shown)
    finite = np.isfinite(time) & np.isfinite(pressure) & np.isfinite(opening)
    time, pressure, opening = time[finite], pressure[finite], opening[finite]
    falls = np.flatnonzero(np.diff(time) < 0.0)
    if falls.size:
        shown = f"{time[falls[0]]:g} s, then {time[falls[0] + 1]:g} s"
        raise RecordingError("time runs backwards", where=f"{where}, sample {falls[0] + 1}", value=shown)
    fresh = np.r_[True, np.diff(time) > 0.0][: time.size]
    time, pressure, opening = time[fresh], pressure[fresh], opening[fresh]
    if time.size < LEAST_SAMPLES:
        raise RecordingError(f"{time.size} samples are left", where=where, rule=f"at least {LEAST_SAMPLES}")
    refuse_pressure("pressure", pressure, where)
    beyond = np.flatnonzero((opening < 0.0) | (opening > 1.0))
    if beyond.size:
        raise RecordingError(
            f"command = {opening[beyond[0]]:g}",
            where=f"{where}, sample {beyond[0]}",
            rule="0 <= command <= 1: the share of the line's full opening",
            remedy="scale it in the layout: command = { column = ..., scale = ..., offset = ... }",
        )
    digest = hashlib.sha256(b"".join(v.tobytes() for v in (time, pressure, opening))).hexdigest()
    return VolumeRecording(name, time - time[0], pressure, opening, dict(labels or {}), source, digest)


def read_volume_recordings(
    recordings: Any,  # noqa: ANN401 - one or several, of several kinds
    layout: Layout | str | Path | None = None,
) -> list[VolumeRecording]:
    """Read recordings of a fixed volume.

    Parameters
    ----------
    recordings
        One or several of: a file, a mapping of SI columns, a `VolumeRecording`.
    layout
        How files are read (``kind = "fixed-volume"``); None: ``layout.toml`` beside each file, or in the folder above.

    Raises
    ------
    RecordingError, LayoutError
        With file, value, rule and remedy.
    """
    given: Sequence[Any] = (
        [recordings] if isinstance(recordings, str | Path | Mapping | VolumeRecording) else list(recordings)
    )
    if not given:
        raise RecordingError("no recording is named", remedy="give at least one file")
    said = layout if layout is None or isinstance(layout, Layout) else Layout.load(layout)
    out = []
    for number, item in enumerate(given, start=1):
        if isinstance(item, VolumeRecording):
            out.append(item)
        elif isinstance(item, Mapping):
            out.append(volume_recording(item, f"recording {number}"))
        else:
            path = Path(item)
            out.append(_through(path, said or layout_beside(path)))
    return out


def _through(path: Path, layout: Layout) -> VolumeRecording:
    said = layout.for_volume_file(path)
    raw, _, _ = read_raw(path, said)
    values = {channel: convert(said, channel, column) for channel, column in raw.items()}
    names = {"time": "time_s", "pressure": "pressure_pa", "command": "command"}
    return volume_recording({names[c]: v for c, v in values.items()}, stem(path), said.labels, path)
