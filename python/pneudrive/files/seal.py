"""Parquet files that carry the SHA-256 of their own bytes: whoever reads one knows whether it is as it was written."""

from __future__ import annotations

import hashlib
import io
import mmap
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    import polars as pl

#: Key of the Parquet metadata under which a file carries the SHA-256 of its own bytes.
SEAL = "pneudrive-seal"
BLANK = "0" * 64
PARQUET = b"PAR1"
MAPPED = 1 << 20  # bytes from which a file is mapped: reading a smaller one takes less
TAIL = 8  # length of the footer and the mark of the format

Bytes = bytes | mmap.mmap


def sealed_parquet(frame: pl.DataFrame, metadata: dict[str, str]) -> bytes:
    """Give the bytes of a Parquet file with its seal."""
    with io.BytesIO() as memory:
        frame.write_parquet(memory, metadata={**metadata, SEAL: BLANK})
        parquet = memory.getvalue()
    footer = _footer(parquet)
    at = None if footer is None else _seal_at(parquet, footer)
    assert at is not None, "the file was written without a blank seal"
    return parquet[:at] + hashlib.sha256(parquet).hexdigest().encode() + parquet[at + len(BLANK) :]


def damage(parquet: Bytes) -> str | None:
    """Say what is wrong with the bytes of a Parquet file, before anything tries to make sense of them.

    Returns
    -------
    str or None
        None where nothing is wrong, as far as can be told: without a seal only the ends of the file are looked at.
    """
    return _look(parquet)[0]


def _look(parquet: Bytes) -> tuple[str | None, bool]:
    """Say what is wrong, see `damage`, and whether there is a seal that holds."""
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
        return ("the file is damaged: its seal cannot be read" if with_seal else None), False
    total = hashlib.sha256(memoryview(parquet)[:at])
    total.update(BLANK.encode())
    total.update(memoryview(parquet)[at + len(BLANK) :])
    if total.hexdigest().encode() != parquet[at : at + len(BLANK)]:
        return "the file is damaged: its bytes do not have the SHA-256 that they had when it was written", False
    return None, True


@dataclass(frozen=True)
class Looked:
    """What was found of a Parquet file.

    Attributes
    ----------
    wrong : str or None
        What is wrong with it, see `damage`.
    own : bool
        Whether it has a seal that holds.
    end : bytes
        Its footer with what stands around it, for `footer_text`; empty where the file is large.
    """

    wrong: str | None
    own: bool
    end: bytes = b""


def footer_text(parquet: Bytes, key: str) -> str | None:
    """Find a text that a file carries, by its bytes or their end, without a library that reads all of them.

    Whether the rest of the footer makes sense is not asked: a seal says so, or who reads the columns finds it.

    Returns
    -------
    str or None
        None where it is not there exactly once.
    """
    footer = _footer(parquet)
    mark = b"\x18" + bytes([len(key)]) + key.encode() + b"\x18"  # a text as key, another one follows
    at = -1 if footer is None else parquet.find(mark, footer)
    if at < 0 or parquet.find(mark, at + 1) >= 0:
        return None
    at += len(mark)
    length = shift = 0
    while parquet[at] & 0x80:  # seven bits of the length in each byte, the lowest first
        length |= (parquet[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
    length |= parquet[at] << shift
    text = parquet[at + 1 : at + 1 + length]
    if parquet[at + 1 + length : at + 2 + length] != b"\0":  # the end of the pair
        return None
    try:
        return text.decode()
    except UnicodeDecodeError:
        return None


def look(path: Path, size: int) -> Looked:
    """Look at a Parquet file of so many bytes before anything tries to make sense of it.

    Raises
    ------
    OSError
        It cannot be read.
    """
    if size >= MAPPED:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return Looked(*_look(data))
    # A campaign has 20,000 of them: an object for each file would take twice as long as reading it.
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
    try:
        parquet = os.read(descriptor, size)
    finally:
        os.close(descriptor)
    wrong, own = _look(parquet)
    return Looked(wrong, own, b"" if wrong else parquet[(_footer(parquet) or 0) - len(PARQUET) :])


def _footer(parquet: Bytes) -> int | None:
    """Give the place where the footer begins."""
    length = int.from_bytes(parquet[-TAIL:-4], "little")
    return None if length > len(parquet) - TAIL - 4 else len(parquet) - TAIL - length


def _seal_at(parquet: Bytes, footer: int) -> int | None:
    """Find the 64 characters of the seal in the footer: the key, then type and length of the text (compact Thrift)."""
    mark = SEAL.encode() + b"\x18" + bytes([len(BLANK)])
    at = parquet.rfind(mark, footer)
    return None if at < 0 or at + len(mark) + len(BLANK) > len(parquet) else at + len(mark)
