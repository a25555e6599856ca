"""Plain and compressed text, piece by piece: what unpacks to too much is refused before it fills the memory."""

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

#: Suffix of a file -> what unpacks it.
COMPRESSIONS: dict[str, Callable[[Path], object]] = {".gz": gzip.open, ".xz": lzma.open, ".bz2": bz2.open}
PIECE = 1 << 22
SMALL_BYTES = 1 << 26  # below this no ratio of sizes is looked at


def pieces(path: Path, kind: type[PneudriveError], folder: str | None = None, size: int = PIECE) -> Iterator[bytes]:
    """Give the bytes of a file one after the other, unpacked where its suffix says that it is packed.

    Parameters
    ----------
    path : Path
    kind : type of PneudriveError
    folder : str, optional
        What to do where the path is a folder.
    size : int
        Most bytes of a piece.

    Raises
    ------
    PneudriveError
        There is no such file, it is no plain file, too large (also unpacked), damaged or cut off.
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
                    within("file_bytes", total, "the file grows while it is read", kind, str(path))
                yield piece
    except (EOFError, zlib.error, lzma.LZMAError, gzip.BadGzipFile) as error:
        raise kind(f"the file cannot be decompressed: {error}", where=str(path)) from None
    except OSError as error:  # bz2 says so what is wrong with the content
        if error.errno is None:
            raise kind(f"the file cannot be decompressed: {error}", where=str(path)) from None
        raise unreadable(path, error, kind) from None


def check_unpacked(size: int, packed: int, kind: type[PneudriveError], where: str | None = None) -> None:
    """Refuse what unpacks to too much, whatever packed it.

    Raises
    ------
    PneudriveError
    """
    what = f"the file of {packed:,} bytes unpacks to {size:,} bytes or more"
    within("unpacked_bytes", size, what, kind, where)
    if size > SMALL_BYTES:
        within("unpacked_ratio", size / max(packed, 1), what, kind, where)
