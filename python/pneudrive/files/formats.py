"""Binary formats read by libraries written in C, in a separate process. Parquet is read by `pneudrive.files.tables`.

`pneudrive.files.tables` starts the process, and sends requests over a pipe. A damaged file can affect only this
process. An exception is returned as the answer. After a crash, a timeout or exhausted memory, the client starts another
process.
"""

from __future__ import annotations

import contextlib
import math
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from functools import lru_cache
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneudrive.arrays import Array, Plain
from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.files.bounds import bound
from pneudrive.files.content import check_unpacked

Columns = dict[str, NDArray[Any]]

MEMORY_OF_SMALL = 500_000_000  # bytes that a small MAT file may take: some copies of `content.SMALL`
UNIT_OF = "unit of "  # prefix of a column's name: key of its unit in the file's metadata
LONGEST_REASON = 200  # characters of a library message
CLASSIC_NETCDF = b"CDF"  # first bytes of netCDF 3


#: Open file: names of its columns; ``get(names, dates)``, which reads columns; and texts in the file's metadata.
#: Columns in `dates` are returned as texts or NumPy's ``datetime64``, if possible.
Opened = tuple[list[str], "Callable[[list[str], frozenset[str]], Columns]", dict[str, str]]


def plain(column: NDArray[Any]) -> NDArray[Any]:
    """Return numbers and times unchanged, and all other values as texts or None."""
    if column.dtype.kind in "iufbMm":
        return column
    texts = [None if value is None else str(value) for value in column.ravel().tolist()]
    return np.array(texts, dtype=object).reshape(column.shape)


def open_netcdf(path: Path) -> Opened:
    """Open a netCDF file (version 3 or 4)."""
    import xarray as xr

    with path.open("rb") as file:
        engine = "scipy" if file.read(3) == CLASSIC_NETCDF else "h5netcdf"
    if engine == "h5netcdf":  # xarray reads the axes when it opens the file; a classic file is as long as it says
        _check_hdf5(path)
    data = xr.open_dataset(path, engine=engine, decode_times=False)
    unpacked = sum(variable.nbytes for variable in data.variables.values())
    check_unpacked(unpacked, path.stat().st_size, RecordingError)

    def get(wanted: list[str], dates: frozenset[str]) -> Columns:
        found = {name: data[name] for name in wanted}
        for name in dates & found.keys():
            if " since " in str(found[name].attrs.get("units", "")):
                found[name] = xr.decode_cf(found[name].to_dataset(name="t"), decode_timedelta=False)["t"]
        return {name: values.to_numpy() for name, values in found.items()}

    metadata = {str(key): value for key, value in data.attrs.items() if isinstance(value, str)}
    return [str(name) for name in data.variables], get, metadata


def open_tdms(path: Path) -> Opened:
    """Open a TDMS file; channels are named ``group/channel``.

    A waveform has no time channel. Its ``time`` (in s from the first start) is computed from its properties. Channels
    with different start times or rates are interpolated to the times of the fastest channel.
    """
    nptdms = _optional("nptdms", "tdms")
    header = [channel for group in nptdms.TdmsFile.read_metadata(path).groups() for channel in group.channels()]
    unpacked = sum(len(channel) * getattr(channel.dtype, "itemsize", 8) for channel in header)
    check_unpacked(unpacked, path.stat().st_size, RecordingError)
    data = nptdms.TdmsFile.read(path)
    channels = {f"{group.name}/{channel.name}": channel for group in data.groups() for channel in group.channels()}
    clocked = [name for name, channel in channels.items() if "wf_increment" in channel.properties]
    timed = bool(clocked) and not any(name.rpartition("/")[2] == "time" for name in channels)

    def get(wanted: list[str], _: frozenset[str]) -> Columns:
        found = {name: np.asarray(channels[name][:]) for name in wanted if name in channels}
        times = _waveform_times({name: channels[name] for name in found if name in clocked}) if timed else {}
        if timed and "time" in wanted and not times:
            raise RecordingError("no channel of the layout has times")
        if times:
            base, found = _on_one_clock(times, found)
            found |= {"time": base} if "time" in wanted else {}
        return found

    said = {name: str(channel.properties.get("unit_string", "")).strip() for name, channel in channels.items()}
    units = {UNIT_OF + name: unit for name, unit in said.items() if unit}
    return [*(["time"] if timed else []), *channels], get, units


def open_mf4(path: Path) -> Opened:
    """Open an MDF file. Channels are interpolated to the times of the fastest requested channel (``time``, in s).

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

    def get(wanted: list[str], _: frozenset[str]) -> Columns:
        chosen = [name for name in wanted if name != "time"]
        if not chosen:
            raise RecordingError("the layout names only the column of the time")
        at = {name: places[name] for name in chosen}
        signals = {name: data.get(channel, group=group, index=index) for name, (channel, group, index) in at.items()}
        times = {name: signal.timestamps for name, signal in signals.items()}
        base, values = _on_one_clock(times, {name: np.asarray(signal.samples) for name, signal in signals.items()})
        return {**values, "time": base}

    return ["time", *sorted(places)], get, {}


def open_mat(path: Path) -> Opened:
    """Open a MAT file (v5 to v7.3); fields of structures have dotted names.

    The signals of a Simulink scope are an array of structures. Columns are named by ``label``. Without labels they are
    numbered: ``signals[1].values``.
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

    is_hdf5 = _optional("h5py", "mat").is_hdf5(path)  # from version 7.3 on, beginning at byte 512
    if is_hdf5:
        _check_hdf5(path)
    else:
        from scipy.io import whosmat

        unpacked = sum(8 * math.prod(shape) for _, shape, kind in whosmat(path) if kind != "sparse")
        check_unpacked(unpacked, path.stat().st_size, RecordingError)
    with _limited_memory(path):
        content = pymatreader.read_mat(path)
    collect("", {key: value for key, value in content.items() if not key.startswith("__")})
    names = sorted(flat) if is_hdf5 else list(flat)  # the library reads a structure in HDF5 in any order
    return names, lambda wanted, _: {name: flat[name] for name in wanted}, {}


#: Format in the layout file -> name in messages, and function that opens a file.
OPENERS: dict[str, tuple[str, Callable[[Path], Opened]]] = {
    "netcdf": ("netCDF", open_netcdf),
    "tdms": ("TDMS", open_tdms),
    "mf4": ("MDF", open_mf4),
    "mat": ("MAT", open_mat),
}


@contextlib.contextmanager
def _limited_memory(path: Path) -> Iterator[None]:
    """Limit the memory for a MAT file, because arrays inside structures state their sizes only when they are read."""
    import resource

    try:
        used = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    except OSError:  # not Linux: the bound reader_bytes is left
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


def _waveform_times(channels: Plain) -> dict[str, Array]:
    """Return the times of the samples of TDMS waveforms, in s from the first start.

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
    """Return the times of the fastest channel that covers half the time span or more, and all channels at these times.

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


# --- The process that reads.


@lru_cache(maxsize=1)
def _opened(form: str, path: str, _state: tuple[int, int, int]) -> Opened:
    """Open a file. The last one stays open, because a request for columns usually follows a request for names."""
    return OPENERS[form][1](Path(path))


def answer(request: dict[str, Any]) -> Any:  # noqa: ANN401 - of each request its own
    """Answer a request for a file. An exception of a library is returned as the answer."""
    form, path = request["form"], request["path"]
    try:
        about = Path(path).stat()
        names, get, metadata = _opened(form, path, (about.st_mtime_ns, about.st_size, about.st_ino))
        if request["wanted"] is None:
            return names, metadata
        found = get(request["wanted"], request["dates"])
        _opened.cache_clear()
        return {name: plain(np.asarray(values)) for name, values in found.items()}
    except PneudriveError as error:
        return error
    except BaseException as error:  # libraries raise any exception
        if isinstance(error, (KeyboardInterrupt, SystemExit)):
            raise
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        if isinstance(error, (KeyError, IndexError, AttributeError, TypeError)):
            reason = f"{type(error).__name__}: {reason}"
        _opened.cache_clear()
        return RecordingError(f"the file cannot be read as {OPENERS[form][0]}", value=reason[:LONGEST_REASON])


def main() -> None:
    """Answer requests until the other side closes the pipe."""
    import resource

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the client handles Ctrl-C
    warnings.simplefilter("ignore")
    connection, most = Connection(int(sys.argv[1])), int(sys.argv[2])
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (most if hard < 0 else min(most, hard), hard))
    with contextlib.suppress(EOFError, OSError):
        while True:
            request = connection.recv()
            signal.alarm(request["seconds"])  # the default handler ends the process, even inside a library
            connection.send(answer(request))
            signal.alarm(0)
