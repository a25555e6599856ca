"""Samples of an open recording. Samples around the last view are read ahead and kept for the next view."""

from __future__ import annotations

import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from pneudrive.errors import PneudriveError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.signals.channels import ChannelFile

    Array = NDArray[Any]

MOST_ROWS = 1 << 20  # read ahead
PAINTED_S = 0.02  # reading ahead uses every processor, so it begins after the requested view is painted


class KeptRows(NamedTuple):
    """Columns between two rows: times in s, and values, with NaN for missing numbers."""

    first: int
    last: int
    time_s: Array
    values: dict[str, Array]

    def holds(self, names: Sequence[str], rows: tuple[int, int]) -> bool:
        """Return whether some rows of some columns are kept."""
        return self.first <= rows[0] and rows[1] <= self.last and all(name in self.values for name in names)

    def part(self, names: Sequence[str], rows: tuple[int, int]) -> KeptRows:
        """Return some rows of some columns without a copy."""
        own = slice(rows[0] - self.first, rows[1] - self.first)
        return KeptRows(*rows, self.time_s[own], {name: self.values[name][own] for name in names})


class KeptSamples:
    """The samples of one recording. Only the recording of the last view keeps samples.

    Parameters
    ----------
    file : ChannelFile
    """

    _last: ClassVar[KeptSamples | None] = None

    def __init__(self, file: ChannelFile) -> None:
        self.file = file
        self.reads = 0
        self._kept: KeptRows | None = None
        self._reading = threading.Lock()

    def get(self, names: Sequence[str], rows: tuple[int, int]) -> KeptRows:
        """Return columns between two rows, read if they are not kept.

        Raises
        ------
        RecordingError
            As for `pneudrive.files.tables.Table.get`.
        """
        kept = self._kept
        if kept is None or not kept.holds(names, rows):
            with self._reading:  # the reading ahead in progress may contain them
                kept = self._kept
            if kept is None or not kept.holds(names, rows):
                return self._read(names, rows)
        return kept.part(names, rows)

    def ahead(self, names: Sequence[str], rows: tuple[int, int], count: int) -> None:
        """Read in the background the samples that views around and inside some rows need, unless half of them are kept.

        Parameters
        ----------
        names : sequence of str
        rows : (int, int)
            Rows of the view.
        count : int
            Rows of the recording.
        """
        half = min(rows[1] - rows[0], MOST_ROWS // 3) // 2
        near, far = ((max(rows[0] - by, 0), min(rows[1] + by, count)) for by in (half, 2 * half))
        if (self._kept is None or not self._kept.holds(names, near)) and self._reading.acquire(blocking=False):
            threading.Thread(target=self._keep, args=(names, far), daemon=True).start()

    def _keep(self, names: Sequence[str], rows: tuple[int, int]) -> None:
        try:
            time.sleep(PAINTED_S)
            with suppress(PneudriveError):  # the view that needs them reports the error
                self._kept = self._read(names, rows)
                if KeptSamples._last not in (None, self):
                    KeptSamples._last._kept = None
                KeptSamples._last = self
        finally:
            self._reading.release()

    def _read(self, names: Sequence[str], rows: tuple[int, int]) -> KeptRows:
        self.reads += 1
        seconds, values = self.file.read(names, rows)
        for name, own in values.items():
            if not np.isfinite(own).all():
                values[name] = np.where(np.isfinite(own), own, np.nan)
        return KeptRows(*rows, seconds, values)
