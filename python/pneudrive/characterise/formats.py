"""Recordings that are not text: Parquet and netCDF, and what optional libraries read."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.characterise.date_times import ISO, UNIT, guess_form, seconds
from pneudrive.characterise.text_table import Table, column_number, measurable
from pneudrive.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

TEXT_KINDS = frozenset("OSTU")  # kinds of arrays of texts
GUESSED_FROM = 400  # values from which the form of dates is guessed
CLASSIC_NETCDF = b"CDF"  # first bytes of netCDF 3


@dataclass(frozen=True)
class OpenFile:
    """Names of a file's columns, and a function that reads some of them.

    Where ``as_dates`` holds a name, the function gives texts or NumPy's ``datetime64`` for it, if it can.
    """

    names: list[str]
    get: Callable[[list[str], frozenset[str]], dict[str, NDArray[Any]]]


def open_parquet(path: Path) -> OpenFile:
    """Open a Parquet file."""
    import polars as pl

    try:
        names = list(pl.read_parquet_schema(path))
    except (OSError, pl.exceptions.PolarsError) as error:
        raise _unreadable("Parquet", path, error) from None

    def get(wanted: list[str], _: frozenset[str]) -> dict[str, NDArray[Any]]:
        try:
            frame = pl.read_parquet(path, columns=wanted)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise _unreadable("Parquet", path, error) from None
        return {name: frame[name].to_numpy() for name in wanted}

    return OpenFile(names, get)


def open_netcdf(path: Path) -> OpenFile:
    """Open a netCDF file, of version 3 or 4."""
    import xarray as xr

    try:
        with path.open("rb") as file:
            engine = "scipy" if file.read(3) == CLASSIC_NETCDF else "h5netcdf"
        with xr.open_dataset(path, engine=engine, decode_times=False) as data:
            data.load()
    except (OSError, ValueError) as error:
        raise _unreadable("netCDF", path, error) from None

    def get(wanted: list[str], as_dates: frozenset[str]) -> dict[str, NDArray[Any]]:
        found = {name: data[name] for name in wanted}
        for name in as_dates & found.keys():
            if " since " in str(found[name].attrs.get("units", "")):
                found[name] = xr.decode_cf(found[name].to_dataset(name="t"), decode_timedelta=False)["t"]
        return {name: values.to_numpy() for name, values in found.items()}

    return OpenFile([str(n) for n in data.variables], get)


def open_tdms(path: Path) -> OpenFile:
    """Open a TDMS file; channels are named ``group/channel``.

    A waveform has no channel of times: ``time`` is then what its properties say, s from its start.
    """
    nptdms = _optional("nptdms", "tdms", path)
    try:
        data = nptdms.TdmsFile.read(path)
        channels = {f"{group.name}/{channel.name}": channel for group in data.groups() for channel in group.channels()}
    except Exception as error:  # the library's own errors are of many kinds
        raise _unreadable("TDMS", path, error) from None
    waveforms = any("wf_increment" in channel.properties for channel in channels.values())
    timed = waveforms and not any(name.rpartition("/")[2] == "time" for name in channels)

    def get(wanted: list[str], _: frozenset[str]) -> dict[str, NDArray[Any]]:
        found = {name: channels[name][:] for name in wanted if name in channels}
        if timed and "time" in wanted:
            with_clock = [n for n in found if "wf_increment" in channels[n].properties]
            if not with_clock:
                raise RecordingError("no channel that is read has a time of its own", where=str(path))
            found["time"] = channels[with_clock[0]].time_track()
        return found

    return OpenFile([*(["time"] if timed else []), *channels], get)


def open_mf4(path: Path) -> OpenFile:
    """Open an MDF file. All channels are brought to the time base of the first one wanted, which is ``time``, s.

    A name that several channel groups have is written ``number of the group/name``.
    """
    asammdf = _optional("asammdf", "mf4", path)
    try:
        with asammdf.MDF(path) as data:
            masters = {(group, index) for group, index in data.masters_db.items()}
            places = {}
            for name, entries in data.channels_db.items():
                real = [place for place in entries if tuple(place) not in masters]
                places |= {(f"{p[0]}/{name}" if len(real) > 1 else name): (name, *p) for p in real}
    except Exception as error:  # the library's own errors are of many kinds
        raise _unreadable("MDF", path, error) from None
    places.pop("time", None)

    def get(wanted: list[str], _: frozenset[str]) -> dict[str, NDArray[Any]]:
        chosen = [name for name in wanted if name != "time"]
        if not chosen:
            raise RecordingError("no channel but the time is wanted", where=str(path))
        try:
            with asammdf.MDF(path) as data:
                signals = {n: data.get(places[n][0], group=places[n][1], index=places[n][2]) for n in chosen}
        except Exception as error:  # as above
            raise _unreadable("MDF", path, error) from None
        base = signals[chosen[0]].timestamps
        values = {n: _on(base, signal.timestamps, np.asarray(signal.samples)) for n, signal in signals.items()}
        return {**values, "time": base}

    return OpenFile(["time", *sorted(places)], get)


def open_mat(path: Path) -> OpenFile:
    """Open a MAT file (v5 to v7.3); fields of structures have dotted names."""
    pymatreader = _optional("pymatreader", "mat", path)
    try:
        data = pymatreader.read_mat(path)
    except Exception as error:  # the library's own errors are of many kinds
        raise _unreadable("MAT", path, error) from None
    flat: dict[str, NDArray[Any]] = {}

    def collect(prefix: str, value: Any) -> None:  # noqa: ANN401 - whatever the file holds
        if isinstance(value, dict):
            for key, inner in value.items():
                collect(f"{prefix}.{key}" if prefix else str(key), inner)
        elif np.ndim(value) >= 1:
            flat[prefix] = np.squeeze(np.asarray(value))

    collect("", {key: value for key, value in data.items() if not key.startswith("__")})
    return OpenFile(list(flat), lambda wanted, _: {n: flat[n] for n in wanted})


# Format of the layout file -> how it is opened.
FORMATS: dict[str, Callable[[Path], OpenFile]] = {
    "parquet": open_parquet,
    "netcdf": open_netcdf,
    "tdms": open_tdms,
    "mf4": open_mf4,
    "mat": open_mat,
}


def read_columns(form: str, path: Path, wanted: list[int | str], dates: dict[int | str, str] | None = None) -> Table:
    """Read the wanted columns of a file that is not text.

    Parameters
    ----------
    form : str
        Key of `FORMATS`.
    path : Path
    wanted : list of int or str
        Numbers or names of columns.
    dates : dict, optional
        Those that hold dates and times, with the form of texts; they become seconds since the first one.

    Raises
    ------
    RecordingError
        No such column, not a file of this format, or a column that does not hold numbers.
    """
    opened = FORMATS[form](path)
    short: dict[str, list[str]] = {}
    for name in opened.names:  # a TDMS channel may go without its group where that is unique
        short.setdefault(name.rpartition("/")[2], []).append(name)
    full = [short[w][0] if isinstance(w, str) and len(short.get(w, [])) == 1 else w for w in wanted]
    names = [opened.names[column_number(column, opened.names, len(opened.names), path)] for column in full]
    forms = {name: dates[column] for name, column in zip(names, wanted, strict=True) if dates and column in dates}
    values = opened.get(list(dict.fromkeys(names)), frozenset(forms))
    columns = [as_numbers(np.asarray(values[name]), name, path, forms.get(name)) for name in names]
    if len({column.size for column in columns}) > 1:
        sizes = ", ".join(f"{n}: {c.size}" for n, c in zip(names, columns, strict=True))
        rule = "all channels are sampled together; channels of other rates are brought to one before"
        raise RecordingError("the columns differ in length", where=str(path), value=sizes, rule=rule)
    return Table(names=[str(w) for w in wanted], columns=columns)


def read_all(form: str, path: Path) -> tuple[list[str], list[NDArray[np.float64]], dict[int, str]]:
    """Read every column that holds numbers, or dates and times, and is as long as most of them are.

    Returns
    -------
    list of str, list of ndarray, dict
        Names, columns, and those of the columns (by place) that hold dates, with their form.
    """
    opened = FORMATS[form](path)
    found: dict[str, tuple[NDArray[np.float64], str | None]] = {}
    for name, values in opened.get(opened.names, frozenset()).items():
        column = np.asarray(values)
        date_form = ISO if column.dtype.kind == "M" else None
        if column.ndim == 1 and column.dtype.kind in TEXT_KINDS:
            date_form = guess_form([str(text) for text in column[:GUESSED_FROM].tolist()])
        try:
            found[name] = as_numbers(column, name, path, date_form), date_form
        except RecordingError:
            continue  # texts, tables
    sizes = [column.size for column, _ in found.values()]
    usual = max(sizes, key=sizes.count, default=0)
    kept = {name: pair for name, pair in found.items() if pair[0].size == usual}
    dates = {place: written for place, (_, written) in enumerate(kept.values()) if written is not None}
    return list(kept), [column for column, _ in kept.values()], dates


def as_numbers(column: NDArray[Any], name: str, path: Path, date_form: str | None = None) -> NDArray[np.float64]:
    """Give a column as float64, dates and times as seconds since the first one.

    Raises
    ------
    RecordingError
        It holds something else than the layout says.
    """
    if column.ndim == 1 and column.dtype.kind in {*TEXT_KINDS, "M"} and date_form is not None:
        return seconds(column if column.dtype.kind == "M" else column.astype(object).tolist(), date_form, path)
    if column.ndim != 1 or not np.issubdtype(column.dtype, np.number):
        is_date = column.dtype.kind == "M"
        raise RecordingError(
            f"column '{name}' holds dates and times" if is_date else f"column '{name}' is not a row of numbers",
            where=str(path),
            value=f"{column.dtype}, {column.shape}",
            remedy=f'unit = "{UNIT}" in the layout' if is_date else "name another column in the layout",
        )
    if date_form is not None:
        raise RecordingError(
            f"column '{name}' holds numbers, no dates and times",
            where=str(path),
            value=f"{column[:1].tolist()}",
            remedy='say the unit in which it counts: unit = "s", or unit = "day"',
        )
    return measurable(column.astype(np.float64))


def _on(base: NDArray[np.float64], times: NDArray[np.float64], values: NDArray[Any]) -> NDArray[Any]:
    """Bring a channel to other times; one that has them already, and one that is no row of numbers, stays as it is."""
    if values.ndim != 1 or not np.issubdtype(values.dtype, np.number) or np.array_equal(base, times):
        return values
    return np.interp(base, times, values.astype(np.float64))


def _optional(module: str, form: str, path: Path) -> Any:  # noqa: ANN401 - a module
    try:
        return import_module(module)
    except ImportError:
        raise RecordingError(
            f"format '{form}' needs the optional library {module}",
            where=str(path),
            remedy="pip install 'pneudrive[formats]'",
        ) from None


def _unreadable(kind: str, path: Path, error: Exception) -> RecordingError:
    if isinstance(error, FileNotFoundError):
        return RecordingError("there is no such file", where=str(path))
    reason = (str(error).strip() or type(error).__name__).splitlines()[0][:200]
    return RecordingError(f"the file cannot be read as {kind}", where=str(path), value=reason)
