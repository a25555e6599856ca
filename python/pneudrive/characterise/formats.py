"""Recordings that are not text: Parquet and netCDF, and what optional libraries read."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.characterise.text_table import Table, column_number, measurable
from pneudrive.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray


@dataclass(frozen=True)
class OpenFile:
    """Names of a file's columns, and a function that reads some of them."""

    names: list[str]
    get: Callable[[list[str]], dict[str, NDArray[Any]]]


def open_parquet(path: Path) -> OpenFile:
    """Open a Parquet file."""
    import polars as pl

    try:
        names = list(pl.read_parquet_schema(path))
    except (OSError, pl.exceptions.PolarsError) as error:
        raise _unreadable("Parquet", path, error) from None

    def get(wanted: list[str]) -> dict[str, NDArray[Any]]:
        try:
            frame = pl.read_parquet(path, columns=wanted)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise _unreadable("Parquet", path, error) from None
        return {name: frame[name].to_numpy() for name in wanted}

    return OpenFile(names, get)


def open_netcdf(path: Path) -> OpenFile:
    """Open a netCDF 4 file."""
    import xarray as xr

    try:
        with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as data:
            data.load()
    except (OSError, ValueError) as error:
        raise _unreadable("netCDF", path, error) from None
    return OpenFile([str(n) for n in data.variables], lambda wanted: {n: data[n].to_numpy() for n in wanted})


def open_tdms(path: Path) -> OpenFile:
    """Open a TDMS file; channels are named ``group/channel``."""
    nptdms = _optional("nptdms", "tdms", path)
    try:
        data = nptdms.TdmsFile.read(path)
        channels = {
            f"{group.name}/{channel.name}": channel[:] for group in data.groups() for channel in group.channels()
        }
    except Exception as error:  # the library's own errors are of many kinds
        raise _unreadable("TDMS", path, error) from None
    return OpenFile(list(channels), lambda wanted: {n: channels[n] for n in wanted})


def open_mf4(path: Path) -> OpenFile:
    """Open an MDF 4 file. All channels are brought to the time base of the first one wanted, which is ``time``."""
    asammdf = _optional("asammdf", "mf4", path)
    try:
        with asammdf.MDF(path) as data:
            names = sorted(name for name in data.channels_db if name not in ("time", "t"))
            signals = {name: data.get(name) for name in names}
    except Exception as error:  # the library's own errors are of many kinds
        raise _unreadable("MDF", path, error) from None

    def get(wanted: list[str]) -> dict[str, NDArray[Any]]:
        chosen = [name for name in wanted if name != "time"]
        if not chosen:
            raise RecordingError("no channel but the time is wanted", where=str(path))
        base = signals[chosen[0]].timestamps
        values = {n: np.interp(base, signals[n].timestamps, signals[n].samples.astype(float)) for n in chosen}
        return {**values, "time": base}

    return OpenFile(["time", *names], get)


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
    return OpenFile(list(flat), lambda wanted: {n: flat[n] for n in wanted})


# Format of the layout file -> how it is opened.
FORMATS: dict[str, Callable[[Path], OpenFile]] = {
    "parquet": open_parquet,
    "netcdf": open_netcdf,
    "tdms": open_tdms,
    "mf4": open_mf4,
    "mat": open_mat,
}


def read_columns(form: str, path: Path, wanted: list[int | str]) -> Table:
    """Read the wanted columns of a file that is not text.

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
    values = opened.get(list(dict.fromkeys(names)))
    columns = []
    for name in names:
        column = np.asarray(values[name])
        if column.ndim != 1 or not np.issubdtype(column.dtype, np.number):
            raise RecordingError(
                f"column '{name}' is not a row of numbers",
                where=str(path),
                value=f"{column.dtype}, {column.shape}",
                remedy="name another column in the layout",
            )
        columns.append(measurable(column.astype(np.float64)))
    if len({column.size for column in columns}) > 1:
        sizes = ", ".join(f"{n}: {c.size}" for n, c in zip(names, columns, strict=True))
        rule = "all channels are sampled together; channels of other rates are brought to one before"
        raise RecordingError("the columns differ in length", where=str(path), value=sizes, rule=rule)
    return Table(names=[str(w) for w in wanted], columns=columns)


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
