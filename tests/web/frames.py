"""Frames of the server, read as the page reads them."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from pneudrive.web.messages import Array


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
