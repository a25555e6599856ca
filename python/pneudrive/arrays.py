"""Types of arrays, intervals and rows, for annotations."""

from __future__ import annotations

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
