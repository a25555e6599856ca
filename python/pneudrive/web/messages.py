"""Frames of a socket or a body: a head of JSON, then arrays that the page reads in place.

Length of the head (4 bytes, little-endian), the head, then each array, each on a multiple of 8 bytes.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from traceback import print_exception
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[Any]
ALIGNED = 8
LONGEST_NAME = 200  # longest name in a message
TYPES = {"float32": "<f4", "float64": "<f8"}


def pack(head: Mapping[str, Any], arrays: Mapping[str, Array], *, drawn: bool = False) -> bytes:
    """Pack a head and arrays of 32- or 64-bit floats.

    The head gets ``arrays``: name, type (``"f4"`` or ``"f8"``), offset after the head and length of each. Infinite
    values and NaN in the head become null, because JSON does not support them.

    Parameters
    ----------
    head : mapping
    arrays : mapping
        Shape (n,) each.
    drawn : bool
        Whether arrays are only drawn. They are sent in 32 bits as differences from a middle value, which is listed
        last. No value has an error above 2^-25 of the range of its array.
    """
    listed, blocks, at = [], [], 0
    for name, values in arrays.items():
        if drawn:
            ends = np.fmin.reduce(values, initial=np.inf), np.fmax.reduce(values, initial=-np.inf)
            middle = 0.5 * float(ends[0]) + 0.5 * float(ends[1]) if np.isfinite(ends).all() else 0.0
            own = np.subtract(values, middle, dtype=np.float64).astype("<f4")
        else:
            middle, own = None, np.ascontiguousarray(values, dtype=TYPES[values.dtype.name])
        listed.append([name, own.dtype.str[1:], at, len(own), *([] if middle is None else [middle])])
        padding = -own.nbytes % ALIGNED
        blocks += [own.tobytes(), bytes(padding)]
        at += own.nbytes + padding
    text = json.dumps(plain({**head, "arrays": listed}), default=str, allow_nan=False).encode()
    text += b" " * (-(4 + len(text)) % ALIGNED)
    return b"".join([struct.pack("<I", len(text)), text, *blocks])


def unpack(frame: bytes) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read a frame, as the page does.

    Raises
    ------
    ValueError
        The frame is cut off or not one of ours.
    """
    if len(frame) < 4:
        raise ValueError("a frame begins with the length of its head")
    (length,) = struct.unpack_from("<I", frame)
    start = 4 + length
    if start > len(frame):
        raise ValueError("the head is cut off")
    head = json.loads(frame[4:start])
    arrays = {}
    for name, kind, at, count, *middle in head.pop("arrays"):
        own = np.frombuffer(frame, dtype=f"<{kind}", count=count, offset=start + at)
        arrays[name] = own + np.float64(middle[0]) if middle else own
    return head, arrays


def problems_of(error: Any) -> list[dict[str, Any]]:  # noqa: ANN401 - a PneudriveError
    """Return an error and its sub-errors as plain data: file, line, what, value, rule and remedy."""
    out = []
    for one in error.each():
        file, _, line = (one.where or "").rpartition(":")
        out.append(
            {
                "file": (file if line.isdigit() else one.where or "").rpartition("/")[2],
                "line": int(line) if line.isdigit() else None,
                "key": getattr(one, "key", None),
                "what": one.what,
                "value": None if one.value is None else str(one.value),
                "rule": one.rule,
                "remedy": one.remedy,
            }
        )
    return out


def plain(value: Any) -> Any:  # noqa: ANN401 - plain data
    """Return plain data for JSON, with null in place of infinity and NaN."""
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def number(value: object) -> float | None:
    """Return a number for JSON, which supports neither infinity nor NaN."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


#: Exceptions of code that meets a table without a key, a value of another kind, or damaged bytes.
_OF_CONTENT = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, EOFError, zlib.error, struct.error)


def fault_of(fault: BaseException, path: str = "") -> CommandError:
    """Return the error for an unexpected exception.

    Parameters
    ----------
    fault : BaseException
        Panics of the core are not of the class `Exception`.
    path : str
        File that was read. Empty if the request names no file.
    """
    text = f"{type(fault).__name__}: {fault}"
    if path and isinstance(fault, _OF_CONTENT):
        return CommandError(
            f"{path[:LONGEST_NAME]} cannot be shown: it is incomplete or damaged",
            value=f"{fault.args[0]} is missing" if isinstance(fault, KeyError) and fault.args else text,
            remedy="Make it again. If the file is complete, report this error with the file.",
        )
    print_exception(fault)
    return CommandError(
        f"a fault of pneudrive: {text}", remedy="Report it with the files of this run; the terminal shows the details."
    )
