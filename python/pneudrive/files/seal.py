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
    at = _seal_at(parquet)
    assert at is not None, "the file was written without a blank seal"
    return parquet[:at] + hashlib.sha256(parquet).hexdigest().encode() + parquet[at + len(BLANK) :]


def damage(parquet: Bytes) -> str | None:
    """Say what is wrong with the bytes of a Parquet file, before anything tries to make sense of them.

    Returns
    -------
    str or None
        None where nothing is wrong, as far as can be told: without a seal only the ends of the file are looked at.
    """
    if not len(parquet):
        return "the file is empty"
    if parquet[:4] != PARQUET or len(parquet) < 12:
        return "this is not a Parquet file"
    if parquet[-4:] != PARQUET or _footer(parquet) is None:
        return "the file is cut off: its end is missing"
    at = _seal_at(parquet)
    if at is None:
        return "the file is damaged: its seal cannot be read" if has_seal(parquet) else None
    total = hashlib.sha256(memoryview(parquet)[:at])
    total.update(BLANK.encode())
    total.update(memoryview(parquet)[at + len(BLANK) :])
    if total.hexdigest().encode() != parquet[at : at + len(BLANK)]:
        return "the file is damaged: its bytes do not have the SHA-256 that they had when it was written"
    return None


def has_seal(parquet: Bytes) -> bool:
    """Tell whether the file was written with a seal; others may be sound too."""
    footer = _footer(parquet)
    return footer is not None and SEAL.encode() in parquet[footer:]


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
        Its footer with what stands around it, for `sealed_text`; empty where the file is large.
    """

    wrong: str | None
    own: bool
    end: bytes = b""


def sealed_text(parquet: Bytes, key: str) -> str | None:
    """Find a text that a sealed file carries, by its bytes or their end, without a library that reads all of them.

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


def look(path: Path) -> Looked:
    """Look at a Parquet file before anything tries to make sense of it.

    Raises
    ------
    OSError
        It cannot be read.
    """
    with open(path, "rb", buffering=0) as file:  # noqa: PTH123 - a campaign has 20,000 of them
        size = os.fstat(file.fileno()).st_size
        if size < MAPPED:
            parquet = file.read(size)
            wrong, own = _look(parquet)
            return Looked(wrong, own, parquet[(_footer(parquet) or 0) - len(PARQUET) :] if own else b"")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return Looked(*_look(data))


def _look(parquet: Bytes) -> tuple[str | None, bool]:
    wrong = damage(parquet)
    return wrong, wrong is None and has_seal(parquet)


def _footer(parquet: Bytes) -> int | None:
    """Give the place where the footer begins."""
    length = int.from_bytes(parquet[-TAIL:-4], "little")
    return None if length > len(parquet) - TAIL - 4 else len(parquet) - TAIL - length


def _seal_at(parquet: Bytes) -> int | None:
    """Find the 64 characters of the seal in the footer: the key, then type and length of the text (compact Thrift)."""
    footer = _footer(parquet)
    if footer is None:
        return None
    mark = SEAL.encode() + b"\x18" + bytes([len(BLANK)])
    at = parquet.rfind(mark, footer)
    return None if at < 0 or at + len(mark) + len(BLANK) > len(parquet) else at + len(mark)
