"""Parquet files that contain the SHA-256 of their bytes as a checksum, so that a reader detects any change."""

from __future__ import annotations

import hashlib
import io
import mmap
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    import polars as pl

#: Key of the checksum in the Parquet metadata: SHA-256 of the file's own bytes.
SEAL = "pneudrive-seal"
BLANK = "0" * 64
PARQUET = b"PAR1"
MAPPED = 1 << 20  # bytes from which a file is mapped: a smaller file is read faster without a map
STRETCH = 1 << 24  # bytes of a mapped file that are hashed at a time
TAIL = 8  # length of the footer and the mark of the format

Bytes = bytes | mmap.mmap


def sealed_parquet(frame: pl.DataFrame, metadata: dict[str, str]) -> bytes:
    """Return the bytes of a Parquet file that contains this table, the metadata and a checksum."""
    with io.BytesIO() as memory:
        frame.write_parquet(memory, metadata={**metadata, SEAL: BLANK})
        parquet = memory.getvalue()
    footer = _footer(parquet)
    at = None if footer is None else _seal_at(parquet, footer)
    assert at is not None, "the file was written without room for a checksum"
    return parquet[:at] + hashlib.sha256(parquet).hexdigest().encode() + parquet[at + len(BLANK) :]


def _look(parquet: Bytes) -> tuple[str | None, bool]:
    """Check the bytes of a Parquet file, see `look`."""
    if not len(parquet):
        return "the file is empty", False
    if parquet[:4] != PARQUET or len(parquet) < 12:
        return "this is not a Parquet file", False
    footer = _footer(parquet)
    if parquet[-4:] != PARQUET or footer is None:
        return "the file is cut off: its end is missing", False
    at = _seal_at(parquet, footer)
    if at is None:
        with_seal = parquet.find(SEAL.encode(), footer) >= 0
        return ("the file is damaged: its checksum cannot be read" if with_seal else None), False
    total = hashlib.sha256()
    for begin in range(0, at, STRETCH):
        total.update(memoryview(parquet)[begin : min(begin + STRETCH, at)])
        if isinstance(parquet, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):  # or all of it would stay in memory
            parquet.madvise(mmap.MADV_DONTNEED, begin, STRETCH)
    total.update(BLANK.encode())
    total.update(memoryview(parquet)[at + len(BLANK) :])
    if total.hexdigest().encode() != parquet[at : at + len(BLANK)]:
        return "the file is damaged: its bytes do not match its checksum (SHA-256)", False
    return None, True


def look(path: Path, size: int) -> tuple[str | None, bool]:
    """Check a Parquet file of `size` bytes before a library parses it.

    Returns
    -------
    str or None
        Damage in words. None if no damage is found; without a checksum only the ends of the file are checked.
    bool
        Whether the file has a valid checksum.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    if size >= MAPPED:
        status = path.stat()
        return _look_mapped(path.resolve(), status.st_size, status.st_mtime_ns, status.st_ino)
    with path.open("rb", buffering=0) as file:  # a campaign has 20,000 files: a buffer for each would take longer
        return _look(file.read(size))


@lru_cache(maxsize=16)
def _look_mapped(path: Path, _size: int, _changed_ns: int, _number: int) -> tuple[str | None, bool]:
    """Check a large file. The result is cached while the file is unchanged, because hashing takes long."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        return _look(data)


def _footer(parquet: Bytes) -> int | None:
    """Return the offset of the footer, or None if the stated length exceeds the file."""
    length = int.from_bytes(parquet[-TAIL:-4], "little")
    return None if length > len(parquet) - TAIL - 4 else len(parquet) - TAIL - length


def _seal_at(parquet: Bytes, footer: int) -> int | None:
    """Return the offset of the checksum (64 characters), which follows its key, type and length (compact Thrift)."""
    mark = SEAL.encode() + b"\x18" + bytes([len(BLANK)])
    at = parquet.rfind(mark, footer)
    return None if at < 0 or at + len(mark) + len(BLANK) > len(parquet) else at + len(mark)
