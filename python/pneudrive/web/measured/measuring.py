"""A recording measured at two times, requested by the page, and the same as command and as Python."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import FiniteFloat, StrictStr

from pneudrive.signals.channels import pairs
from pneudrive.signals.measuring import measured
from pneudrive.web.messages import plain
from pneudrive.web.requests import PageRequest
from pneudrive.web.workspace import safe

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.web.measured.recordings import Recordings

    Array = NDArray[Any]


class MeasureRequest(PageRequest):
    """Two times at which the page measures a recording.

    Attributes
    ----------
    path : str
    at : (float, float)
        s, or numbers of samples.
    columns : tuple of str
    beside : str
        Another recording. Empty for no other.
    strokes : (int, int)
        Numbers of the aligned strokes, from 1.
    shift : float
        Resulting time shift of the other recording, s.
    """

    path: StrictStr
    at: tuple[FiniteFloat, FiniteFloat]
    columns: tuple[StrictStr, ...]
    beside: StrictStr
    strokes: tuple[int, int]
    shift: FiniteFloat

    def answer(self, recordings: Recordings) -> dict[str, Any]:
        """Return the channels at two samples, also of the other recording, and the same as command and as Python.

        Raises
        ------
        PneudriveError
            As for `Recordings.need`.
        """
        own = recordings.need(self.path)
        channels = [channel for channel in own.channels if channel.column in self.columns]
        names = [channel.column for channel in channels]
        rows = measured(self.path, channels, *_ends([own.sample_at(at, names) for at in self.at]))
        if self.beside:
            other = recordings.need(self.beside)
            both = [pair for pair in pairs(own.file, other.file) if pair.own.column in names]
            wanted = [one.other.column for one in both]
            there, values = _ends([other.sample_at(at - self.shift, wanted) for at in self.at])
            shown = {one.own.column: one.of(values[one.other.column]) for one in both}
            rows += measured(self.beside, [one.own for one in both], there + self.shift, shown)
        told = [{**vars(one), "difference": one.difference, "slope": one.slope} for one in rows]
        timed = own.time is not None
        return {"rows": plain(told), "command": self.as_command(timed=timed), "python": self.as_python()}

    def as_command(self, *, timed: bool) -> str:
        """Return the shell line that measures the same in the folder of the workspace."""
        words = ["pneudrive", "measure", safe(self.path)]
        for option, at in zip(("--at", "--to"), self.at, strict=True):
            words += [option, f"{at!r} s" if timed else repr(at)]
        if self.beside:
            words += ["--compare-with", safe(self.beside), "--strokes", ",".join(map(str, self.strokes))]
        return shlex.join(words)

    def as_python(self) -> str:
        """Return the Python lines that measure the same in the folder of the workspace."""
        beside = f", beside={self.beside!r}, strokes={self.strokes!r}" if self.beside else ""
        return f"import pneudrive as pn\n\nfound = pn.measure({self.path!r}, {self.at[0]!r}, {self.at[1]!r}{beside})\n"


def _ends(samples: Sequence[tuple[float, dict[str, float]]]) -> tuple[Array, dict[str, Array]]:
    """Return times and values of samples as arrays."""
    names = samples[0][1]
    return np.array([time for time, _ in samples]), {
        name: np.array([own[name] for _, own in samples]) for name in names
    }
