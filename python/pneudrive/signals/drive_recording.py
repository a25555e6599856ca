"""Recordings of a drive or of a fixed volume: command and measurements over time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from pneudrive.arrays import Array, ArrayPair, Bools, Columns, Keyed, Plain, rows_of
from pneudrive.errors import RecordingError, warn
from pneudrive.files.content import parse_json
from pneudrive.files.tables import open_table
from pneudrive.repr_tables import Shown
from pneudrive.signals.layout import KINDS, AnyLayout, Layout, stem
from pneudrive.signals.load import digest_of, find_layout, import_file, is_run, layout_beside
from pneudrive.signals.motion import NOISE_FACTOR, noise_level
from pneudrive.signals.recording import QUANTILES, refuse_pressure
from pneudrive.simulation.trajectory import columns_in, meaning, read_columns

if TYPE_CHECKING:
    import xarray as xr

#: Accepted forms of a recording of a drive.
Given: TypeAlias = "str | Path | xr.Dataset | Mapping[str, Any]"
NEEDED = ("time_s", "command", "position_m", "pressure_a_pa", "pressure_b_pa")
OPTIONAL = ("velocity_m_s", "temperature_a_k", "temperature_b_k", "force_n", "friction_force_n")
LEAST_SAMPLES = 50
#: Columns of a fixed volume in SI. The first two are required.
OF_VOLUME = ("time_s", "pressure_pa", "command", "inlet_pressure_pa")
LEAST_OF_VOLUME = 10
#: Columns that are complete only in simulations.
_SIMULATED = {"acceleration_m_s2", "mass_flow_a_kg_s", "mass_flow_b_kg_s"}
#: Largest overshoot of the position into an end stop, as a fraction of the stroke (assumed).
BEYOND_STROKE = 0.1
#: Pressures below this fraction of ambient, or above this multiple of the supply, are treated as gauge pressures or as
#: pressures in another unit (assumed).
LOWEST, HIGHEST = 0.5, 3.0
#: Largest sampling interval that resolves a motion, s (assumed).
COARSEST_S = 0.1
#: A gap exceeds this multiple of the usual sampling interval, and this time, s.
GAP_STEPS, GAP_S = 5.0, 0.02
MOST_GAPS = 3
#: The piston moves at the start if its mean speed over this first time, s, exceeds this speed, m/s (assumed).
START_S, LEAST_SPEED_M_S = 0.005, 0.02
#: Time after which any valve has settled at its command, s.
SETTLED_S = 10.0
#: Parameters that can be identified without motion of the piston.
AT_REST = ("cylinder.leakage", "cylinder.heat_transfer", "cylinder.wall_temperature", "cylinder.dead_volume")


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
        Hash of the file, if there is one.
    synthetic : bool
        Whether the recording comes from a simulation.
    start_s : float
        Time 0 on the clock of the file, in s.
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
        """Times in s, from 0."""
        return self.columns["time_s"]

    @property
    def duration_s(self) -> float:
        """Time of the last sample, in s."""
        return float(self.time_s[-1])

    @property
    def steps(self) -> ArrayPair:
        """Times at which the command changes, and its new values.

        The valve starts at rest, as in a simulation. If the piston moves at the first sample, the valve has already
        settled at the first command.
        """
        command = self.columns["command"]
        position = self.columns.get("position_m", 0.0 * command)
        change = np.r_[True, np.diff(command) != 0.0]
        times = self.time_s[change]
        moved = abs(np.interp(START_S, self.time_s, position) - position[0])
        if moved > LEAST_SPEED_M_S * START_S + 5.0 * noise_level(position):
            times[0] -= SETTLED_S
        return times, command[change]


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class VolumeRecording(DriveRecording):
    """A recording of a fixed volume.

    Columns are ``time_s`` (increasing, from 0), ``pressure_pa`` (absolute), ``command`` and, if recorded,
    ``inlet_pressure_pa`` (absolute, between line and tube). The command is the opening fraction of the line, constant
    from each sample to the next, and 1 if not recorded.
    """

    @property
    def pressure_pa(self) -> Array:
        """Absolute pressure of the volume in Pa."""
        return self.columns["pressure_pa"]

    @property
    def opening(self) -> Array:
        """Fraction of the line's full opening."""
        return self.columns["command"]

    @property
    def measured(self) -> Columns:
        """Recorded pressures, under the names of a simulated tank's outputs."""
        return {name: self.columns[name] for name in ("pressure_pa", "inlet_pressure_pa") if name in self}

    def at(self, keep: Bools) -> VolumeRecording:
        """Return the recording with only these samples."""
        return replace(self, columns=rows_of(self.columns, keep))


def drive_recording(
    columns: Keyed,
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
        Whether measured columns may contain NaN. Time and command must not.

    Raises
    ------
    RecordingError
        A column is missing or not finite, lengths differ, times do not increase, or a command is outside -1 .. 1.
    """
    where = str(source or name)
    used = _arrays(columns, needed, (*NEEDED, *OPTIONAL), where, "drive")
    time = used["time_s"]
    if time.size < LEAST_SAMPLES:
        raise RecordingError(f"the recording has {time.size} samples", where=where, rule=f"at least {LEAST_SAMPLES}")
    for column in used if not gaps else ("time_s", "command"):
        bad = np.flatnonzero(~np.isfinite(used[column]))
        if bad.size:
            raise RecordingError.of("signals.not-finite", where=f"{where}, sample {bad[0]}", column=column)
    _refuse_fall(time, np.diff(time) <= 0.0, "time_s does not increase", where)
    _refuse_command(used["command"], -1.0, "the fraction of the valve's full opening, with sign", where)
    for column in ("pressure_a_pa", "pressure_b_pa"):
        low = float(np.fmin.reduce(used[column])) if column in used else np.inf
        if low <= 0.0:
            raise RecordingError.of("signals.not-absolute", where=where, column=column, low=low)
    digest = digest_of(used.values())
    synthetic = set(columns) >= _SIMULATED
    used["time_s"] = time - time[0]
    return DriveRecording(name, used, dict(labels or {}), source, digest, synthetic, float(time[0]))


def volume_recording(
    columns: Keyed,
    name: str = "recording",
    labels: Mapping[str, str] | None = None,
    source: Path | None = None,
) -> VolumeRecording:
    """Make a recording of a fixed volume from SI columns: ``time_s``, ``pressure_pa`` and the others in `OF_VOLUME`.

    Samples that are not finite or repeat a time are left out.

    Raises
    ------
    RecordingError
        A column is missing, lengths differ, time runs backwards, too few samples are left, a pressure is impossible, or
        an opening is outside 0 .. 1.
    """
    where = str(source or name)
    opened = {"command": np.ones(np.size(columns.get("time_s", ()))), **columns}
    used = _arrays(opened, OF_VOLUME[:2], OF_VOLUME, where, "fixed-volume")
    finite = np.all([np.isfinite(values) for values in used.values()], axis=0)
    used = rows_of(used, finite)
    _refuse_fall(used["time_s"], np.diff(used["time_s"]) < 0.0, "time runs backwards", where)
    fresh = np.diff(used["time_s"], prepend=-np.inf) > 0.0
    used = rows_of(used, fresh)
    time = used["time_s"]
    if time.size < LEAST_OF_VOLUME:
        raise RecordingError(f"{time.size} samples are left", where=where, rule=f"at least {LEAST_OF_VOLUME}")
    for pressure in ("pressure_pa", "inlet_pressure_pa"):
        if pressure in used:
            refuse_pressure(pressure.removesuffix("_pa"), used[pressure], where)
    _refuse_command(used["command"], 0.0, "the fraction of the line's full opening", where)
    digest = digest_of(used.values())
    used["time_s"] = time - time[0]
    return VolumeRecording(name, used, dict(labels or {}), source, digest)


def _arrays(columns: Keyed, needed: Sequence[str], known: Iterable[str], where: str, kind: str) -> Columns:
    """Return the known columns for this kind of recording as arrays of equal length; reject missing columns."""
    if missing := [column for column in needed if column not in columns]:
        shown = f"columns: {', '.join(map(str, columns))}"
        what = f"the recording lacks {', '.join(missing)}"
        rule = KINDS[kind]["rule"].format(needed=", ".join(needed))
        raise RecordingError(what, where=where, value=shown, rule=rule, remedy=KINDS[kind].get("remedy"))
    arrays = {c: np.ascontiguousarray(columns[c], dtype=float) for c in known if c in columns}
    if any(values.shape != (arrays["time_s"].size,) for values in arrays.values()):
        shown = ", ".join(f"{column}: {values.shape}" for column, values in arrays.items())
        raise RecordingError("the columns differ in length", where=where, value=shown)
    return arrays


def _refuse_fall(time_s: Array, falls: Bools, what: str, where: str) -> None:
    if falls.any():
        at = int(np.argmax(falls))
        shown = f"{time_s[at]:g} s, then {time_s[at + 1]:g} s"
        raise RecordingError(what, where=f"{where}, sample {at + 1}", value=shown)


def _refuse_command(command: Array, lowest: float, meaning: str, where: str) -> None:
    beyond = np.flatnonzero((command < lowest) | (command > 1.0))
    if beyond.size:
        names = {"command": command[beyond[0]], "lowest": lowest, "meaning": meaning}
        raise RecordingError.of("signals.command-beyond", where=f"{where}, sample {beyond[0]}", **names)


def read_drive_recordings(
    recordings: Given | DriveRecording | Sequence[Given | DriveRecording],
    layout: AnyLayout,
    needed: Sequence[str] = NEEDED,
    *,
    gaps: bool = False,
    names: Mapping[str, str] | None = None,
) -> list[DriveRecording]:
    """Read recordings of a drive.

    Parameters
    ----------
    recordings
        One or several recordings. Each is a file of ``pneudrive simulate --out`` (.parquet, .csv, .nc), a foreign file
        with a layout, a result of ``pn.simulate``, a mapping of SI columns, or a `DriveRecording`.
    layout
        Layout of foreign files. None: ``layout.toml`` next to each foreign file.
    needed : sequence of str
        Required columns.
    gaps : bool
        Whether measured columns may contain NaN.
    names : mapping, optional
        Column name in a recording of a circuit -> name of the same column in a recording of a drive.

    Raises
    ------
    RecordingError, LayoutError
        The message gives file, value, rule and remedy.
    """
    items, layout = _items(recordings, layout)
    out: list[DriveRecording] = []
    for number, item in enumerate(items, start=1):
        read = item
        if not isinstance(item, DriveRecording):
            names = names or {}
            columns, name, labels, source = _drive_columns(item, f"recording {number}", layout, needed, names)
            columns = {names.get(column, column): values for column, values in columns.items()}
            read = drive_recording(columns, name, labels, source, needed, gaps=gaps)
        if read.name in {other.name for other in out}:
            folder = read.source.parent.name if read.source is not None else f"{number}"
            read = replace(read, name=f"{folder}/{read.name}")
        out.append(read)
    return out


def read_volume_recordings(
    recordings: Any,  # noqa: ANN401 - one or several, of several kinds
    layout: AnyLayout,
) -> list[VolumeRecording]:
    """Read recordings of a fixed volume.

    Parameters
    ----------
    recordings
        One or several of: a file, a mapping of SI columns, a `VolumeRecording`.
    layout
        Layout of files (``kind = "fixed-volume"``). None: ``layout.toml`` next to each file, or in the folder above.

    Raises
    ------
    RecordingError, LayoutError
        The message gives file, value, rule and remedy.
    """
    items, layout = _items(recordings, layout)
    out = []
    for number, item in enumerate(items, start=1):
        if isinstance(item, VolumeRecording):
            out.append(item)
        elif isinstance(item, Mapping):
            out.append(volume_recording(item, f"recording {number}"))
        else:
            path = Path(item)
            out.append(volume_recording(*_imported(path, layout or layout_beside(path), "fixed-volume")))
    return out


def _items(recordings: Any, layout: AnyLayout) -> tuple[list[Any], Layout | None]:  # noqa: ANN401
    single = isinstance(recordings, str | Path | Mapping | DriveRecording) or is_run(recordings)
    items: list[Any] = [recordings] if single else [*recordings]  # type: ignore[misc]
    if not items:
        raise RecordingError("no recording is given", remedy="give at least one file")
    return items, layout if layout is None or isinstance(layout, Layout) else Layout.load(layout)


def _drive_columns(
    item: Given, name: str, layout: Layout | None, needed: Sequence[str], names: Mapping[str, str]
) -> tuple[Plain, str, dict[str, str], Path | None]:
    """Return columns in SI, name, labels and file of a recording in any form."""
    known = (*NEEDED, *OPTIONAL, *_SIMULATED)
    known += tuple(full for full, short in names.items() if short in known)
    if is_run(item):
        variables = {meaning(column)[0]: column for column in known}
        columns = {variables[str(v)]: item[v].to_numpy() for v in item.variables if str(v) in variables}
        return columns, name, _labels(item.attrs), None
    if isinstance(item, Mapping):
        return {str(column): values for column, values in item.items()}, name, {}, None
    path = Path(str(item))
    if layout is None:
        there = columns_in(path, known)
        if set(needed) <= {names.get(column, column) for column in there}:  # a file of `simulate`
            text = open_table(path, "parquet").metadata.get("pneudrive", "{}") if path.suffix == ".parquet" else "{}"
            return read_columns(path, there), stem(path), _labels(parse_json(text, str(path), RecordingError)), path
        layout = find_layout(path) if path.is_file() else layout_beside(path)
    if layout is None:
        with path.open("rb") as file:
            line = file.readline(200)  # of a text file: mostly the names of its columns
        begins = f"it begins with: {line.decode(errors='replace').strip()}" if b"\0" not in line else None
        raise RecordingError.of("signals.not-of-drive", where=str(path), value=begins, needed=", ".join(NEEDED))
    return _imported(path, layout, "drive")


def _labels(about: object) -> dict[str, str]:
    """Return the labels in the attributes of a simulated run."""
    labels = about.get("labels") if isinstance(about, dict) else None
    return {str(key): str(text) for key, text in labels.items()} if isinstance(labels, dict) else {}


def _imported(path: Path, layout: Layout, kind: str) -> tuple[Plain, str, dict[str, str], Path]:
    """Read a file by its layout. Return columns in SI, name, labels and path; warn of faults on reading."""
    said = layout.for_file(path, kind)
    columns, flags, _ = import_file(path, said)
    for flag, count in flags.items():
        warn(f"{path.name} has the flag {flag} ({count}): see the flags in the guide, Your own recordings")
    return columns, stem(path), said.labels, path


def check_plausible(recording: DriveRecording, stroke: float, ambient: float, supply: float) -> None:
    """Reject a recording that does not match a stroke (in m) and the ambient and supply pressures (in Pa).

    Raises
    ------
    RecordingError
        Time, position or pressures have a wrong unit, pressures are gauge, or positions are outside the stroke.
    """
    where = str(recording.source or recording.name)
    step = np.median(np.diff(recording.time_s))
    if step > COARSEST_S:
        raise RecordingError.of("signals.coarse-samples", where=where, step=step, coarsest=COARSEST_S)
    margin, pressures = BEYOND_STROKE * stroke, (LOWEST * ambient, HIGHEST * supply)
    limits = {"position_m": (-margin, stroke + margin), "pressure_a_pa": pressures, "pressure_b_pa": pressures}
    for column, (least, most) in limits.items():
        if column in recording and np.isfinite(recording[column]).any():
            low, high = np.nanquantile(recording[column], QUANTILES)  # single outliers are ignored
            if low < least or high > most:
                numbers = {"low": low, "high": high, "stroke": stroke, "ambient": ambient, "supply": supply}
                if column == "position_m":
                    raise RecordingError.of("signals.impossible-positions", where=where, column=column, **numbers)
                raise RecordingError.of("signals.impossible-pressures", where=where, column=column, **numbers)


def refuse_standstill(recordings: Sequence[DriveRecording], free: Sequence[str]) -> None:
    """Reject free parameters that need motion if the piston does not move in any recording.

    Raises
    ------
    RecordingError
        The piston does not move.
    """
    names = [name for name in free if not name.startswith(AT_REST)]
    seen = [r for r in recordings if "position_m" in r and np.isfinite(r["position_m"]).any()]
    if not names or not seen or any(moves(r["position_m"]) for r in seen):
        return
    travel = max(float(np.nanmax(r["position_m"]) - np.nanmin(r["position_m"])) for r in seen)
    files = ", ".join(str(r.source or r.name) for r in seen)
    raise RecordingError.of("signals.no-motion-of-drive", where=files, names=", ".join(names), travel_mm=1e3 * travel)


def moves(position_m: Array) -> bool:
    """Return whether a position changes by more than its noise."""
    known = position_m[np.isfinite(position_m)]
    return known.size > 0 and float(np.ptp(known)) > NOISE_FACTOR * noise_level(known)


def time_gaps(recordings: Sequence[DriveRecording]) -> list[str]:
    """Return notes on gaps in the samples, during which the command of the valve is unknown."""
    out = []
    for recording in recordings:
        time = recording.time_s
        steps = np.diff(time)
        at = np.flatnonzero(steps > max(GAP_STEPS * np.median(steps), GAP_S))
        if at.size:
            places = ", ".join(f"{time[i]:.4g} .. {time[i + 1]:.4g} s" for i in at[:MOST_GAPS])
            more = f" and {at.size - MOST_GAPS} more" if at.size > MOST_GAPS else ""
            out.append(
                f"{recording.name} has no samples in {places}{more}: the command is assumed constant there; if it was "
                "not, cut the recording in two"
            )
    return out
