"""Frames of the server, read as the page reads them."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from pneudrive.arrays import Array


def unpack(frame: bytes) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read a frame, as the page does."""
    (length,) = struct.unpack_from("<I", frame)
    head = json.loads(frame[4 : 4 + length])
    arrays = {}
    for name, kind, at, count, *middle in head.pop("arrays"):
        own = np.frombuffer(frame, dtype=f"<{kind}", count=count, offset=4 + length + at)
        arrays[name] = own + np.float64(middle[0]) if middle else own
    return head, arrays
