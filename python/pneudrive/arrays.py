"""Types of arrays, intervals, rows and plain data, for annotations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

#: Array of real numbers.
Array: TypeAlias = NDArray[np.float64]
#: Array of truth values, and of whole numbers.
Bools: TypeAlias = NDArray[np.bool_]
Ints: TypeAlias = NDArray[np.int64]
#: Lower and upper end.
Interval: TypeAlias = tuple[float, float]
#: Values by column or key.
Row: TypeAlias = dict[str, Any]
#: Plain data by key, as in TOML and JSON: to write, and given only to be read.
Plain: TypeAlias = dict[str, Any]
Keyed: TypeAlias = Mapping[str, Any]
