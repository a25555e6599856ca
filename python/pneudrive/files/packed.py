"""Plain and compressed text, piece by piece; a file that unpacks to too much is rejected before it fills the memory."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zlib
from typing import TYPE_CHECKING, BinaryIO, cast

from pneudrive.files.bounds import within
from pneudrive.files.content import check_file, unreadable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from pneudrive.errors import PneudriveError

#: Suffix of a file -> its unpacking function.
COMPRESSIONS: dict[str, Callable[[Path], object]] = {".gz": gzip.open, ".xz": lzma.open, ".bz2": bz2.open}
PIECE = 1 << 22
SMALL = 1e8  # bytes that every machine has: a small file of constants may unpack to more than the usual factor


def pieces(path: Path, kind: type[PneudriveError], folder: str | None = None, size: int = PIECE) -> Iterator[bytes]:
    """Yield the bytes of a file in pieces, unpacked according to its suffix.

    Parameters
    ----------
    path : Path
    kind : type of PneudriveError
    folder : str, optional
        Remedy if the path is a folder.
    size : int
        Largest number of bytes of a piece.

    Raises
    ------
    PneudriveError
        The file does not exist, is not a plain file, too large (also unpacked), damaged or cut off.
    """
    there = check_file(path, kind, folder=folder)
    packed = path.suffix in COMPRESSIONS and there > 0
    total = 0
    try:
        with cast("BinaryIO", COMPRESSIONS[path.suffix](path)) if packed else path.open("rb") as file:
            while piece := file.read(size):
                total += len(piece)
                if packed:
                    check_unpacked(total, there, kind, str(path))
                else:
                    within("file_bytes", total, "the file grew while it was read", kind, str(path))
                yield piece
    except (EOFError, zlib.error, lzma.LZMAError, gzip.BadGzipFile) as error:
        raise kind(f"the file cannot be decompressed: {error}", where=str(path)) from None
    except OSError as error:  # how bz2 reports damaged content
        if error.errno is None:
            raise kind(f"the file cannot be decompressed: {error}", where=str(path)) from None
        raise unreadable(path, error, kind) from None


def check_unpacked(size: int, packed: int, kind: type[PneudriveError], where: str | None = None) -> None:
    """Raise an error for a file that unpacks to too many bytes.

    Raises
    ------
    PneudriveError
    """
    what = f"the file of {packed:,} bytes unpacks to {size:,} bytes or more"
    within("unpacked_bytes", size, what, kind, where)
    if size > SMALL:
        within("unpacking_factor", size / max(packed, 1), what, kind, where)
