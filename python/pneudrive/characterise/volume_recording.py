"""Recordings of a fixed volume: a pressure over time, and the opening of the line where that was recorded."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.characterise.layout import VOLUME_UNITS, Layout, stem
from pneudrive.characterise.load import convert, layout_beside, read_raw
from pneudrive.characterise.plausible import refuse_pressure
from pneudrive.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LEAST_SAMPLES = 10
#: Columns in SI; the first two are needed.
COLUMNS = ("time_s", "pressure_pa", "command", "inlet_pressure_pa")


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
    inlet_pressure_pa : ndarray, shape (n,), or None
        Absolute, between the line and the tube; None where it was not recorded.
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
    inlet_pressure_pa: Array | None = None
    labels: dict[str, str] = field(default_factory=dict)
    source: Path | None = None
    sha256: str = ""

    @property
    def measured(self) -> dict[str, Array]:
        """The pressures that were recorded, by the names of what a simulated tank shows."""
        inlet = {} if self.inlet_pressure_pa is None else {"inlet_pressure_pa": self.inlet_pressure_pa}
        return {"pressure_pa": self.pressure_pa} | inlet

    def __getitem__(self, column: str) -> Array:
        return self.measured[column]

    def at(self, keep: NDArray[np.bool_]) -> VolumeRecording:
        """Return the recording at some of its samples."""
        inlet = self.inlet_pressure_pa
        return replace(
            self,
            time_s=self.time_s[keep],
            pressure_pa=self.pressure_pa[keep],
            opening=self.opening[keep],
            inlet_pressure_pa=None if inlet is None else inlet[keep],
        )

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
    """Make a recording of columns in SI: ``time_s``, ``pressure_pa``, and what else of `COLUMNS` was recorded.

    Samples that are not finite, and such that repeat a time, are left out.

    Raises
    ------
    RecordingError
        A column is missing, lengths differ, time runs backwards, too few samples are left, a pressure is impossible,
        or an opening is beyond 0 .. 1.
    """
    where = str(source or name)
    missing = [c for c in COLUMNS[:2] if c not in columns]
    if missing:
        raise RecordingError(
            f"the recording lacks {', '.join(missing)}",
            where=where,
            value=f"columns: {', '.join(map(str, columns))}",
            rule="a fixed volume has time_s and pressure_pa (absolute), command where its line opens or shuts, and "
            "inlet_pressure_pa where that before a tube was recorded",
        )
    values = {c: np.asarray(columns[c], dtype=np.float64).ravel() for c in COLUMNS if c in columns}
    values.setdefault("command", np.ones(values["time_s"].size))
    if len({column.size for column in values.values()}) > 1:
        shown = ", ".join(f"{name}: {column.size}" for name, column in values.items())
        raise RecordingError("the columns differ in length", where=where, value=shown)
    finite = np.all([np.isfinite(column) for column in values.values()], axis=0)
    values = {name: column[finite] for name, column in values.items()}
    time = values["time_s"]
    falls = np.flatnonzero(np.diff(time) < 0.0)
    if falls.size:
        shown = f"{time[falls[0]]:g} s, then {time[falls[0] + 1]:g} s"
        raise RecordingError("time runs backwards", where=f"{where}, sample {falls[0] + 1}", value=shown)
    fresh = np.r_[True, np.diff(time) > 0.0][: time.size]
    values = {name: column[fresh] for name, column in values.items()}
    time, opening = values["time_s"], values["command"]
    if time.size < LEAST_SAMPLES:
        raise RecordingError(f"{time.size} samples are left", where=where, rule=f"at least {LEAST_SAMPLES}")
    for name in ("pressure_pa", "inlet_pressure_pa"):
        if name in values:
            refuse_pressure(name.removesuffix("_pa"), values[name], where)
    beyond = np.flatnonzero((opening < 0.0) | (opening > 1.0))
    if beyond.size:
        raise RecordingError(
            f"command = {opening[beyond[0]]:g}",
            where=f"{where}, sample {beyond[0]}",
            rule="0 <= command <= 1: the share of the line's full opening",
            remedy="scale it in the layout: command = { column = ..., scale = ..., offset = ... }",
        )
    digest = hashlib.sha256(b"".join(values[name].tobytes() for name in COLUMNS if name in values)).hexdigest()
    return VolumeRecording(
        name,
        time - time[0],
        values["pressure_pa"],
        opening,
        values.get("inlet_pressure_pa"),
        dict(labels or {}),
        source,
        digest,
    )


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
    values = {f"{c}_{VOLUME_UNITS[c].lower()}".rstrip("_"): convert(said, c, column) for c, column in raw.items()}
    return volume_recording(values, stem(path), said.labels, path)
