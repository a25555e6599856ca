"""A small file states a large table: it is refused by its header, before anything is read."""

from __future__ import annotations

import os
import re
import struct
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import polars as pl
import pytest

from pneudrive.errors import RecordingError
from pneudrive.files import tables
from pneudrive.files.tables import open_table


def constants_netcdf(path: Path) -> None:
    """Write two columns of a fill value, which stands for any number of samples."""
    with h5py.File(path, "w") as file:
        for name in ("time", "position"):
            file.create_dataset(name, (400_000_000,), "f8", chunks=(1_000_000,), fillvalue=1.0)


def constants_mat(path: Path) -> None:
    """Write a fill value into a MAT file of version 7.3, which is HDF5."""
    with h5py.File(path, "w", userblock_size=512) as file:
        data = file.create_dataset("time", (1, 400_000_000), "f8", chunks=(1, 1_000_000), fillvalue=1.0)
        data.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def cells_mat(path: Path, *, inside: bool) -> None:
    """Write a cell array, alone or inside a structure, that states 400 million cells and holds none."""

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    def matrix(of_class: int, rows: int, name: bytes, rest: bytes) -> bytes:
        head = element(6, struct.pack("<II", of_class, 0)) + element(5, struct.pack("<ii", rows, 1))
        return element(14, head + element(1, name) + rest)

    cells = matrix(1, 400_000_000, b"" if inside else b"many", b"")
    if inside:
        cells = matrix(2, 1, b"record", struct.pack("<HHI", 5, 4, 8) + element(1, b"many".ljust(8, b"\0")) + cells)
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + cells)


def constants_parquet(path: Path) -> None:
    """Write equal values, which are stored once with their number."""
    pl.DataFrame({"time": pl.repeat(1.0, 20_000_000, eager=True)}).write_parquet(path)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.nc", constants_netcdf),
        ("b.mat", constants_mat),
        ("c.mat", partial(cells_mat, inside=False)),
        ("d.mat", partial(cells_mat, inside=True)),
        ("e.parquet", constants_parquet),
    ],
)
def test_a_small_file_does_not_fill_the_memory(tmp_path, name, write):
    """Each of these states 160 MB to 6 GB in at most 1 MB, and is refused by its header."""
    write(tmp_path / name)
    assert (tmp_path / name).stat().st_size < 1e6
    before = max(most_memory(), 5e8)  # the libraries of this process and of the reader
    with pytest.raises(RecordingError, match=r"unpacks to|Unable to allocate|MemoryError|cannot be read"):
        all_columns(tmp_path / name)
    assert most_memory() - before < 3e8


def all_columns(path: Path) -> None:
    opened = open_table(path, {".nc": "netcdf"}.get(path.suffix, path.suffix[1:]))
    opened.get(opened.names)


def most_memory() -> float:
    """Return the largest memory of this process and of the reader process so far, bytes."""
    process = tables._reader._process
    files = [Path(f"/proc/{pid}/status") for pid in (os.getpid(), process.pid if process else None)]
    found = [re.search(r"VmHWM:\s+(\d+)", one.read_text()) for one in files if one.exists()]
    return 1024.0 * sum(int(one[1]) for one in found if one)
