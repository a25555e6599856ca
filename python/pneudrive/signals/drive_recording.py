"""Recordings of a drive or of a fixed volume: command and measurements over time."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RecordingError, warn
from pneudrive.files.content import parse_json
from pneudrive.files.tables import open_table
from pneudrive.repr_tables import Shown
from pneudrive.signals.importer import read_raw, si_columns
from pneudrive.signals.impossible import refuse_pressure
from pneudrive.signals.layout import FileLayout, Layout, stem
from pneudrive.signals.load import find_layout, layout_beside
from pneudrive.signals.trajectories import is_run
from pneudrive.simulation.trajectory import columns_in, meaning, read_columns

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Given = str | Path | xr.Dataset | Mapping[str, Any]

NEEDED = ("time_s", "command", "position_m", "pressure_a_pa", "pressure_b_pa")
OPTIONAL = ("velocity_m_s", "temperature_a_k", "temperature_b_k", "force_n", "friction_force_n")
LEAST_SAMPLES = 50
#: Columns of a fixed volume in SI; the first two are needed.
OF_VOLUME = ("time_s", "pressure_pa", "command", "inlet_pressure_pa")
LEAST_OF_VOLUME = 10
#: Columns that only a simulation has completely.
_SIMULATED = {"acceleration_m_s2", "mass_flow_a_kg_s", "mass_flow_b_kg_s"}


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class DriveRecording(Shown):
    """A recording of a drive, in SI with absolute pressures.

    Attributes
    ----------
    name : str
    columns : dict
        Arrays of one length: ``time_s`` (increasing, from 0), ``command`` (held from each sample to the next),
        ``position_m``, ``pressure_a_pa``, ``pressure_b_pa``. Velocity, temperatures and forces are included if
        measured.
    labels : dict
        Free text that distinguishes records: pressure, mounting, day.
    source : Path or None
    sha256 : str
        Standard uncertainty of the columns.
    synthetic : bool
        It comes from a simulation.
    start_s : float
        Time 0 on the clock of the file, s.
    """

    name: str
    columns: dict[str, Array]
    labels: dict[str, str] = field(default_factory=dict)
    source: Path | None = None
    sha256: str = ""
    synthetic: bool = False
    start_s: float = 0.0

    def __len__(self) -> int:
        """Return the number of samples."""
        return self.time_s.size

    def __getitem__(self, column: str) -> Array:
        return self.columns[column]

    def __contains__(self, column: str) -> bool:
        return column in self.columns

    @property
    def time_s(self) -> Array:
        """Times, s, from 0."""
        return self.columns["time_s"]

    @property
    def duration_s(self) -> float:
        """Time of the last sample, s."""
        return float(self.time_s[-1])

    @property
    def steps(self) -> tuple[Array, Array]:
        """Times at which the command changes, and its new values."""
        command = self.columns["command"]
        change = np.r_[True, np.diff(command) != 0.0]
        return self.time_s[change], command[change]


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class VolumeRecording(DriveRecording):
    """A recording of a fixed volume.

    Its columns are ``time_s`` (increasing, from 0), ``pressure_pa`` (absolute) and ``command``. The command is the
    fraction of the line's full opening, constant from each sample to the next, and 1 if not recorded. If recorded,
    ``inlet_pressure_pa`` (absolute, between the line and the tube) is included.
    """

    @property
    def pressure_pa(self) -> Array:
        """Pressure of the volume, absolute, Pa."""
        return self.columns["pressure_pa"]

    @property
    def opening(self) -> Array:
        """Fraction of the line's full opening."""
        return self.columns["command"]

    @property
    def measured(self) -> dict[str, Array]:
        """The recorded pressures, by the names of a simulated tank's outputs."""
        return {name: self.columns[name] for name in ("pressure_pa", "inlet_pressure_pa") if name in self}

    def at(self, keep: NDArray[np.bool_]) -> VolumeRecording:
        """Return the recording at some of its samples."""
        return replace(self, columns={name: column[keep] for name, column in self.columns.items()})


def drive_recording(
    columns: Mapping[str, Any],
    name: str = "recording",
    labels: Mapping[str, str] | None = None,
    source: Path | None = None,
    needed: Sequence[str] = NEEDED,
    *,
    gaps: bool = False,
) -> DriveRecording:
    """Make a recording from SI columns.

    Parameters
    ----------
    columns : mapping
        Name -> values, shape (n,).
    name : str
    labels : mapping, optional
    source : Path, optional
        The file, for messages.
    needed : sequence of str
        Required columns.
    gaps : bool
        Whether measured columns may contain NaN; time and command never do.

    Raises
    ------
    RecordingError
        If a column is missing or not finite, lengths differ, times do not rise, or a command is outside -1 .. 1.
    """
    where = str(source or name)
    remedy = "name the columns like `pneudrive simulate --out`, or name them in a layout"
    _need(columns, needed, where, f"a recording of a drive has {', '.join(needed)}", remedy)
    used = {c: np.ascontiguousarray(columns[c], dtype=np.float64) for c in (*NEEDED, *OPTIONAL) if c in columns}
    _check(used, where, gaps=gaps)
    time = used["time_s"]
    kept = {**used, "time_s": time - time[0]}
    digest, synthetic = _digest(used.values()), set(columns) >= _SIMULATED
    return DriveRecording(name, kept, dict(labels or {}), source, digest, synthetic, float(time[0]))


def volume_recording(
    columns: Mapping[str, Any],
    name: str = "recording",
    labels: Mapping[str, str] | None = None,
    source: Path | None = None,
) -> VolumeRecording:
    """Make a recording of a fixed volume from SI columns: ``time_s``, ``pressure_pa``, and others of `OF_VOLUME`.

    Samples that are not finite or repeat a time are left out.

    Raises
    ------
    RecordingError
        If a column is missing, lengths differ, time runs backwards, too few samples are left, a pressure is impossible,
        or an opening is outside 0 .. 1.
    """
    where = str(source or name)
    rule = (
        "a fixed volume has time_s and pressure_pa (absolute), command where its line opens or shuts, and "
        "inlet_pressure_pa if recorded before a tube"
    )
    _need(columns, OF_VOLUME[:2], where, rule)
    values = {c: np.asarray(columns[c], dtype=np.float64).ravel() for c in OF_VOLUME if c in columns}
    values.setdefault("command", np.ones(values["time_s"].size))
    _same_length(values, where)
    finite = np.all([np.isfinite(column) for column in values.values()], axis=0)
    values = {name: column[finite] for name, column in values.items()}
    _refuse_fall(values["time_s"], np.diff(values["time_s"]) < 0.0, "time runs backwards", where)
    fresh = np.r_[True, np.diff(values["time_s"]) > 0.0][: values["time_s"].size]
    values = {name: column[fresh] for name, column in values.items()}
    time = values["time_s"]
    if time.size < LEAST_OF_VOLUME:
        raise RecordingError(f"{time.size} samples are left", where=where, rule=f"at least {LEAST_OF_VOLUME}")
    for pressure in ("pressure_pa", "inlet_pressure_pa"):
        if pressure in values:
            refuse_pressure(pressure.removesuffix("_pa"), values[pressure], where)
    _within(values["command"], 0.0, "the fraction of the line's full opening", where)
    kept = {**values, "time_s": time - time[0]}
    return VolumeRecording(name, kept, dict(labels or {}), source, _digest(values[c] for c in OF_VOLUME if c in values))


def _need(columns: Mapping[str, Any], needed: Sequence[str], where: str, rule: str, remedy: str | None = None) -> None:
    missing = [c for c in needed if c not in columns]
    if missing:
        shown = f"columns: {', '.join(map(str, columns))}"
        raise RecordingError(
            f"the recording lacks {', '.join(missing)}", where=where, value=shown, rule=rule, remedy=remedy
        )


def _same_length(columns: dict[str, Array], where: str) -> None:
    if any(values.shape != (columns["time_s"].size,) for values in columns.values()):
        shown = ", ".join(f"{c}: {values.shape}" for c, values in columns.items())
        raise RecordingError("the columns differ in length", where=where, value=shown)


def _refuse_fall(time_s: Array, falls: NDArray[np.bool_], what: str, where: str) -> None:
    if falls.any():
        at = int(np.argmax(falls))
        shown = f"{time_s[at]:g} s, then {time_s[at + 1]:g} s"
        raise RecordingError(what, where=f"{where}, sample {at + 1}", value=shown)


def _within(command: Array, lowest: float, meaning: str, where: str) -> None:
    beyond = np.flatnonzero((command < lowest) | (command > 1.0))
    if beyond.size:
        raise RecordingError(
            f"command = {command[beyond[0]]:g}",
            where=f"{where}, sample {beyond[0]}",
            rule=f"{lowest:g} <= command <= 1: {meaning}",
            remedy="scale it in the layout: command = { column = ..., scale = ..., offset = ... }",
        )


def _digest(columns: Iterable[Array]) -> str:
    return hashlib.sha256(b"".join(values.tobytes() for values in columns)).hexdigest()


def _check(columns: dict[str, Array], where: str, *, gaps: bool) -> None:
    _same_length(columns, where)
    n = columns["time_s"].size
    if n < LEAST_SAMPLES:
        raise RecordingError(f"the recording has {n} samples", where=where, rule=f"at least {LEAST_SAMPLES}")
    for column, values in columns.items():
        if gaps and column not in ("time_s", "command"):
            continue
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            remedy = "cut the file there, or fill short gaps"
            raise RecordingError(f"{column} is not finite", where=f"{where}, sample {bad[0]}", remedy=remedy)
    _refuse_fall(columns["time_s"], np.diff(columns["time_s"]) <= 0.0, "time_s does not rise", where)
    _within(columns["command"], -1.0, "the fraction of the valve's full opening, with sign", where)
    for side in [side for side in "ab" if f"pressure_{side}_pa" in columns]:
        low = float(np.fmin.reduce(columns[f"pressure_{side}_pa"]))
        if low <= 0.0:
            rule = "pressures must be absolute, Pa"
            raise RecordingError(f"pressure_{side}_pa = {low:g} Pa", where=where, rule=rule, remedy="gauge or abs?")


def read_drive_recordings(
    recordings: Given | DriveRecording | Sequence[Given | DriveRecording],
    layout: Layout | str | Path | None = None,
    needed: Sequence[str] = NEEDED,
    *,
    gaps: bool = False,
) -> list[DriveRecording]:
    """Read recordings of a drive.

    Parameters
    ----------
    recordings
        One or several recordings. Each is a file (.parquet, .csv, .nc as ``pneudrive simulate --out`` writes, or any
        that a layout reads), a result of ``pn.simulate``, a mapping of SI columns, or a `DriveRecording`.
    layout
        How foreign files are read. None: ``layout.toml`` next to a file that ``simulate`` did not write.
    needed : sequence of str
        Required columns.
    gaps : bool
        Whether measured columns may contain NaN.

    Raises
    ------
    RecordingError, LayoutError
        With file, value, rule and remedy.
    """
    given, said = _given(recordings, layout)
    out: list[DriveRecording] = []
    for number, item in enumerate(given, start=1):
        read = _read(item, f"recording {number}", said, needed, gaps=gaps)
        taken = {r.name for r in out}
        if read.name in taken:
            folder = read.source.parent.name if read.source is not None else f"{number}"
            read = replace(read, name=f"{folder}/{read.name}")
        out.append(read)
    return out


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
        How files are read (``kind = "fixed-volume"``). None: ``layout.toml`` next to each file, or in the folder above.

    Raises
    ------
    RecordingError, LayoutError
        With file, value, rule and remedy.
    """
    given, layout = _given(recordings, layout)
    out = []
    for number, item in enumerate(given, start=1):
        if isinstance(item, VolumeRecording):
            out.append(item)
        elif isinstance(item, Mapping):
            out.append(volume_recording(item, f"recording {number}"))
        else:
            said = (layout or layout_beside(Path(item))).for_volume_file(Path(item))
            out.append(volume_recording(_columns_of(Path(item), said), stem(Path(item)), said.labels, Path(item)))
    return out


def _given(recordings: Any, layout: Layout | str | Path | None) -> tuple[list[Any], Layout | None]:  # noqa: ANN401
    single = isinstance(recordings, str | Path | Mapping | DriveRecording) or is_run(recordings)
    given: list[Any] = [recordings] if single else [*recordings]  # type: ignore[misc]
    if not given:
        raise RecordingError("no recording is given", remedy="give at least one file")
    return given, layout if layout is None or isinstance(layout, Layout) else Layout.load(layout)


def _read(
    item: Given | DriveRecording, name: str, layout: Layout | None, needed: Sequence[str], *, gaps: bool
) -> DriveRecording:
    if isinstance(item, DriveRecording):
        return item
    if is_run(item):
        known = {variable: column for column in (*NEEDED, *OPTIONAL, *_SIMULATED) for variable in [meaning(column)[0]]}
        columns = {known[str(v)]: item[v].to_numpy() for v in item.variables if str(v) in known}
        labels = item.attrs.get("labels")
        return drive_recording(columns, name, labels if isinstance(labels, dict) else None, needed=needed, gaps=gaps)
    if isinstance(item, Mapping):
        return drive_recording({str(column): values for column, values in item.items()}, name, needed=needed, gaps=gaps)
    path = Path(str(item))
    if layout is None and (columns := _own_columns(path, needed)) is not None:
        return drive_recording(columns, stem(path), _own_labels(path), path, needed, gaps=gaps)
    said = (layout or _beside(path)).for_drive_file(path)
    return drive_recording(_columns_of(path, said), stem(path), said.labels, path, needed, gaps=gaps)


def _own_columns(path: Path, needed: Sequence[str]) -> dict[str, Array] | None:
    """Return the columns of a file of ``simulate``; None for other files."""
    there = columns_in(path, (*NEEDED, *OPTIONAL, *_SIMULATED))
    return read_columns(path, there) if set(needed) <= set(there) else None


def _own_labels(path: Path) -> dict[str, str]:
    """Return the labels of the simulated drive, if the file has them."""
    if path.suffix != ".parquet":
        return {}
    metadata = open_table(path, "parquet").metadata.get("pneudrive", "{}")
    kept = parse_json(metadata, str(path), RecordingError)
    labels = kept.get("labels") if isinstance(kept, dict) else None
    return {str(k): str(v) for k, v in labels.items()} if isinstance(labels, dict) else {}


def _beside(path: Path) -> Layout:
    if not path.is_file():
        raise RecordingError("there is no such file", where=str(path))
    beside = find_layout(path)
    if beside is not None:
        return beside
    raise RecordingError(
        "the file is not a recording of a drive, and there is no layout to read it",
        where=str(path),
        value=_first_line(path),
        rule=f"a recording of a drive has {', '.join(NEEDED)}",
        remedy="name time, command, position and both pressures in a layout: --layout LAYOUT.toml",
    )


def _first_line(path: Path) -> str | None:
    """Return the start of a text file, which mostly names its columns."""
    with path.open("rb") as file:
        line = file.readline(200)
    return f"it begins with: {line.decode(errors='replace').strip()}" if b"\0" not in line else None


def _columns_of(path: Path, said: FileLayout) -> dict[str, Array]:
    """Read a file through a layout: columns in SI, on one time base."""
    raw, flags, _ = read_raw(path, said)
    for flag, count in flags.items():
        warn(f"{path.name} has the flag {flag} ({count}): see the flags in the guide, Your own recordings")
    return si_columns(said, raw)
