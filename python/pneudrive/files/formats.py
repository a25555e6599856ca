"""Reading of binary formats by their libraries: Parquet in this process, the others in the reader process."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files.bounds import bound
from pneudrive.files.content import check_unpacked, most_unpacked

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import polars as pl
    from numpy.typing import NDArray

    from pneudrive.arrays import Array, Plain

    Columns = dict[str, NDArray[Any]]

resource: Any = None
with contextlib.suppress(ImportError):  # not on Windows
    import resource

MEMORY_OF_SMALL = 500_000_000  # bytes that a small MAT file may take: some copies of `packed.SMALL`
MOST_PLACES = 100  # of a column of lists that become columns
UNIT_OF = "unit of "  # prefix of a column's name: key of its unit in the file's metadata
LONGEST_REASON = 200  # characters of what a library says
OF_FILE = "the file of this row"  # name of an added column
CLASSIC_NETCDF = b"CDF"  # first bytes of netCDF 3

Rows = tuple[int, int]


@dataclass(frozen=True)
class Opened:
    """Columns of an open file.

    Attributes
    ----------
    names : callable
        Returns the names of the columns.
    get : callable
        ``get(names, dates, rows)`` reads columns. Those in `dates` are returned as texts or NumPy's ``datetime64``, if
        possible. `rows` is (first, last + 1), or None for all.
    count : callable
        Returns the number of rows; None for a format without tables.
    metadata : dict
        Texts in the file's metadata.
    """

    names: Callable[[], list[str]]
    get: Callable[[list[str], frozenset[str], Rows | None], Columns]
    count: Callable[[], int | None]
    metadata: dict[str, str]


def open_parquet(path: Path) -> Opened:
    """Open a Parquet file; its columns are read only on request."""
    import polars as pl

    @cache
    def scan() -> pl.LazyFrame:
        return _without_lists(pl.scan_parquet(path))

    def count() -> int:
        return int(scan().select(pl.len()).collect().item())

    def get(wanted: list[str], _: frozenset[str], part: Rows | None) -> Columns:
        table, size = scan().select(wanted), path.stat().st_size
        # A long constant column is a small file: rows beyond the bounds are not read.
        kinds = table.collect_schema().dtypes()
        width = sum(8 if kind.is_numeric() or kind.is_temporal() else 16 for kind in kinds)
        most = int(most_unpacked(size) / max(width, 1)) + 1
        first, end = part or (0, most)
        frame = table.slice(first, min(end - first, most)).collect()
        check_unpacked(frame.height * width, size, RecordingError)
        texts = [int(column.str.len_bytes().sum()) for column in frame.iter_columns() if column.dtype == pl.String]
        check_unpacked(sum(texts), size, RecordingError)  # a text may stand in the file once, for all rows
        return {name: plain(frame[name].to_numpy()) for name in wanted}

    return Opened(lambda: scan().collect_schema().names(), get, count, pl.read_parquet_metadata(path))


def plain(column: NDArray[Any]) -> NDArray[Any]:
    """Return numbers and times unchanged, and all other values as texts or None."""
    if column.dtype.kind in "iufbMm":
        return column
    texts = [None if value is None else str(value) for value in column.ravel().tolist()]
    return np.array(texts, dtype=object).reshape(column.shape)


def _without_lists(table: pl.LazyFrame) -> pl.LazyFrame:
    """Return a table with each column of short lists split into columns ``name[0]``, ``name[1]``, ..."""
    import polars as pl

    schema = table.collect_schema()
    inner = {name: kind.inner for name, kind in schema.items() if isinstance(kind, pl.List | pl.Array)}
    lists = [name for name, kind in inner.items() if pl.Series(dtype=kind).dtype.is_numeric()]
    if not lists:
        return table
    short = table.with_columns(pl.col(name).cast(pl.List(inner[name])) for name in lists)
    widths = short.head(1).select(pl.col(lists).list.len().max()).collect().row(0, named=True)
    return short.with_columns(
        pl.col(name).list.get(at, null_on_oob=True).alias(f"{name}[{at}]")
        for name in lists
        for at in range(min(widths[name] or 0, MOST_PLACES))
    ).drop(lists)


def read_alike(paths: Sequence[Path], wanted: Sequence[str]) -> list[Columns] | None:
    """Read columns of Parquet files by one query, which takes longer than reading a small file.

    Return None if a column is missing in a file, or a value: it would turn the integers of all files into floats.
    """
    import polars as pl

    try:
        frame = pl.scan_parquet(list(paths), include_file_paths=OF_FILE).select(*wanted, OF_FILE).collect()
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException):  # the columns differ, or are damaged
        return None
    if any(frame[name].null_count() for name in wanted):
        return None
    stretches = frame[OF_FILE].rle().struct.unnest()
    rows = dict(zip(stretches["value"], stretches["len"], strict=True))  # a file without rows does not appear
    columns = {name: frame[name].to_numpy() for name in wanted}
    ends = np.cumsum([0, *(rows.get(str(path), 0) for path in paths)]).tolist()
    return [{name: column[begin:end] for name, column in columns.items()} for begin, end in pairwise(ends)]


def open_netcdf(path: Path) -> Opened:
    """Open a netCDF file, of version 3 or 4."""
    import xarray as xr

    with path.open("rb") as file:
        engine = "scipy" if file.read(3) == CLASSIC_NETCDF else "h5netcdf"
    if engine == "h5netcdf":  # xarray reads the axes when it opens the file; a classic file is as long as it says
        _check_hdf5(path)
    data = xr.open_dataset(path, engine=engine, decode_times=False)
    unpacked = sum(variable.nbytes for variable in data.variables.values())
    check_unpacked(unpacked, path.stat().st_size, RecordingError)
    sizes = {v.shape[0] for v in data.variables.values() if v.ndim == 1}

    def get(wanted: list[str], dates: frozenset[str], rows: Rows | None) -> Columns:
        found = _rows_of({name: data[name] for name in wanted}, rows)
        for name in dates & found.keys():
            if " since " in str(found[name].attrs.get("units", "")):
                found[name] = xr.decode_cf(found[name].to_dataset(name="t"), decode_timedelta=False)["t"]
        return {name: values.to_numpy() for name, values in found.items()}

    metadata = {str(key): value for key, value in data.attrs.items() if isinstance(value, str)}
    usual = sizes.pop() if len(sizes) == 1 else None
    return Opened(lambda: [str(n) for n in data.variables], get, lambda: usual, metadata)


def open_tdms(path: Path) -> Opened:
    """Open a TDMS file; channels are named ``group/channel``.

    A waveform has no time channel. Its ``time``, s from the first start, is computed from its properties. Channels with
    different start times or rates are interpolated to the times of the fastest channel.
    """
    nptdms = _optional("nptdms", "tdms")
    header = [channel for group in nptdms.TdmsFile.read_metadata(path).groups() for channel in group.channels()]
    unpacked = sum(len(channel) * getattr(channel.dtype, "itemsize", 8) for channel in header)
    check_unpacked(unpacked, path.stat().st_size, RecordingError)
    data = nptdms.TdmsFile.read(path)
    channels = {f"{group.name}/{channel.name}": channel for group in data.groups() for channel in group.channels()}
    clocked = [name for name, channel in channels.items() if "wf_increment" in channel.properties]
    timed = bool(clocked) and not any(name.rpartition("/")[2] == "time" for name in channels)

    def get(wanted: list[str], _: frozenset[str], rows: Rows | None) -> Columns:
        found = {name: np.asarray(channels[name][:]) for name in wanted if name in channels}
        times = _waveform_times({name: channels[name] for name in found if name in clocked}) if timed else {}
        if timed and "time" in wanted and not times:
            raise RecordingError("no channel of the layout has times")
        if times:
            base, found = _on_one_clock(times, found)
            found |= {"time": base} if "time" in wanted else {}
        return _rows_of(found, rows)

    said = {name: str(channel.properties.get("unit_string", "")).strip() for name, channel in channels.items()}
    units = {UNIT_OF + name: unit for name, unit in said.items() if unit}
    return Opened(lambda: [*(["time"] if timed else []), *channels], get, _no_tables, units)


def open_mf4(path: Path) -> Opened:
    """Open an MDF file; channels are interpolated to the times of the fastest requested channel (``time``, s).

    A name in several channel groups is written ``number of the group/name``.
    """
    asammdf = _optional("asammdf", "mf4")
    data = asammdf.MDF(path)
    masters = set(data.masters_db.items())
    places: dict[str, tuple[str, int, int]] = {}
    for name, entries in data.channels_db.items():
        real = [place for place in entries if tuple(place) not in masters]
        places |= {(f"{p[0]}/{name}" if len(real) > 1 else name): (name, *p) for p in real}
    places.pop("time", None)

    def get(wanted: list[str], _: frozenset[str], rows: Rows | None) -> Columns:
        chosen = [name for name in wanted if name != "time"]
        if not chosen:
            raise RecordingError("the layout names no channel except the time")
        signals = {n: data.get(places[n][0], group=places[n][1], index=places[n][2]) for n in chosen}
        times = {name: signal.timestamps for name, signal in signals.items()}
        base, values = _on_one_clock(times, {name: np.asarray(signal.samples) for name, signal in signals.items()})
        return _rows_of({**values, "time": base}, rows)

    return Opened(lambda: ["time", *sorted(places)], get, _no_tables, {})


def open_mat(path: Path) -> Opened:
    """Open a MAT file (v5 to v7.3); fields of structures have dotted names.

    The signals of a Simulink scope are an array of structures. Columns are named by ``label``, or numbered without
    labels: ``signals[1].values``.
    """
    pymatreader = _optional("pymatreader", "mat")
    flat: Columns = {}

    def collect(prefix: str, value: Any) -> None:  # noqa: ANN401 - any content
        if isinstance(value, dict):
            labels = value.get("label")
            labels = [one for one in labels if isinstance(one, str) and one] if isinstance(labels, list) else []
            labels = labels if len({*labels, *flat}) == len(labels) + len(flat) else []
            for key, inner in value.items():
                if isinstance(inner, list) and any(np.ndim(one) for one in inner):
                    numbered = [f"{prefix}[{at}].{key}" for at in range(len(inner))]
                    names = labels if len(labels) == len(inner) else numbered
                    flat.update(zip(names, map(np.squeeze, inner), strict=True))
                else:
                    collect(f"{prefix}.{key}" if prefix else str(key), inner)
        elif np.ndim(value) >= 1:
            flat[prefix] = np.squeeze(np.asarray(value))

    if _optional("h5py", "mat").is_hdf5(path):  # from version 7.3 on, beginning at byte 512
        _check_hdf5(path)
    else:
        from scipy.io import whosmat

        unpacked = sum(8 * math.prod(shape) for _, shape, kind in whosmat(path) if kind != "sparse")
        check_unpacked(unpacked, path.stat().st_size, RecordingError)
    with _limited_memory(path):
        content = pymatreader.read_mat(path)
    collect("", {key: value for key, value in content.items() if not key.startswith("__")})

    def get(wanted: list[str], _: frozenset[str], rows: Rows | None) -> Columns:
        return _rows_of({name: flat[name] for name in wanted}, rows)

    return Opened(lambda: list(flat), get, _no_tables, {})


#: Format in the layout file -> its name in messages, and its opener.
OPENERS: dict[str, tuple[str, Callable[[Path], Opened]]] = {
    "parquet": ("Parquet", open_parquet),
    "netcdf": ("netCDF", open_netcdf),
    "tdms": ("TDMS", open_tdms),
    "mf4": ("MDF", open_mf4),
    "mat": ("MAT", open_mat),
}


@contextlib.contextmanager
def _limited_memory(path: Path) -> Iterator[None]:
    """Limit the memory for a MAT file, because arrays inside structures state their sizes only when they are read."""
    try:
        used = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    except (OSError, AttributeError):  # not Linux: the bound reader_bytes is left
        yield
        return
    usual, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = used + MEMORY_OF_SMALL + int(bound("unpacking_factor") * path.stat().st_size)
    resource.setrlimit(resource.RLIMIT_DATA, (most if usual < 0 else min(most, usual), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (usual, hard))


def _check_hdf5(path: Path) -> None:
    """Check the sizes of all data sets by their headers, because a small file can hold any number of fill values.

    Raises
    ------
    RecordingError
        The data sets are too large.
    """
    h5py = _optional("h5py", "netcdf")
    sizes: list[int] = []
    with h5py.File(path) as file:
        file.visititems(lambda _, item: sizes.append(item.nbytes) if isinstance(item, h5py.Dataset) else None)
    check_unpacked(sum(sizes), path.stat().st_size, RecordingError)


def _rows_of(columns: Plain, rows: Rows | None) -> Plain:
    """Return some rows of columns; single values are unchanged."""
    part = slice(*(rows or (None,)))
    return {name: column[part] if column.ndim else column for name, column in columns.items()}


def _no_tables() -> None:
    """Return None, because channels of these formats may differ in length."""


def _waveform_times(channels: Plain) -> dict[str, Array]:
    """Return the times of the samples of TDMS waveforms, s from the first start.

    Raises
    ------
    RecordingError
        Some channels have a start time, others do not.
    """
    starts = {name: channel.properties.get("wf_start_time") for name, channel in channels.items()}
    without = [name for name, start in starts.items() if start is None]
    if without and len(without) < len(starts):
        raise RecordingError.of("files.start-times", without=", ".join(without))
    known = [np.datetime64(start, "ns") for start in starts.values() if start is not None]
    out = {}
    for name, channel in channels.items():
        begin = channel.properties.get("wf_start_offset", 0.0)
        if known:
            begin += (np.datetime64(starts[name], "ns") - min(known)) / np.timedelta64(1, "ns") / 1e9
        out[name] = begin + np.arange(len(channel)) * channel.properties["wf_increment"]
    return out


def _on_one_clock(times: dict[str, Array], values: Columns) -> tuple[Array, Columns]:
    """Return the times of the fastest channel that covers half of the time span, and all channels at these times.

    Channels are NaN before their first and after their last sample. Text channels are unchanged.
    """
    spans = {name: float(np.ptp(own)) for name, own in times.items() if own.size}
    if not spans:
        return np.zeros(0), values
    long = [name for name, span in spans.items() if span >= 0.5 * max(spans.values())]
    base = times[max(long, key=lambda name: times[name].size / max(spans[name], 1e-30))]
    out = dict(values)
    for name, own in times.items():
        column = values[name]
        if column.ndim == 1 and column.dtype.kind in "iuf" and own.size and not np.array_equal(base, own):
            out[name] = np.interp(base, own, column.astype(float), left=np.nan, right=np.nan)
    return base, out


def _optional(module: str, form: str) -> Any:  # noqa: ANN401 - a module
    try:
        return import_module(module)
    except ImportError:
        raise RecordingError.of("files.optional-library", form=form, module=module) from None
