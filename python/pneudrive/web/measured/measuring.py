"""A recording measured between two times, requested by the page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pydantic import FiniteFloat, StrictStr

from pneudrive.signals.channels import pairs
from pneudrive.web.messages import plain
from pneudrive.web.requests import PageRequest

if TYPE_CHECKING:
    from pneudrive.web.measured.recordings import OpenRecording, Recordings


@dataclass(frozen=True)
class MeasuredChannel:
    """One channel at two samples.

    Attributes
    ----------
    recording : str
        File.
    label, unit : str
        Unit of the channel. Channels of another recording use the unit of the first.
    time_s : (float, float)
        Times of the samples. Times of another recording are on the clock of the first.
    values : (float, float)
    """

    recording: str
    label: str
    unit: str
    time_s: tuple[float, float]
    values: tuple[float, float]

    @property
    def difference(self) -> float:
        """Second value minus the first one."""
        return self.values[1] - self.values[0]

    @property
    def slope(self) -> float:
        """Difference divided by the time between the samples, unit per s; NaN if both samples are the same."""
        between = self.time_s[1] - self.time_s[0]
        return self.difference / between if between else float("nan")


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
    shift : float
        Time shift of the other recording, s.
    """

    path: StrictStr
    at: tuple[FiniteFloat, FiniteFloat]
    columns: tuple[StrictStr, ...]
    beside: StrictStr
    shift: FiniteFloat

    def answer(self, recordings: Recordings) -> dict[str, Any]:
        """Return the channels at two samples, also of the other recording.

        Raises
        ------
        PneudriveError
            As for `Recordings.need`.
        """
        own = recordings.need(self.path)
        channels = [channel for channel in own.channels if channel.column in self.columns]
        names = [channel.column for channel in channels]
        times, values = self._ends(own, names, 0.0)
        rows = [MeasuredChannel(self.path, one.label, one.unit, times, values[one.column]) for one in channels]
        if self.beside:
            other = recordings.need(self.beside)
            both = [pair for pair in pairs(own.file, other.file) if pair.own.column in names]
            times, values = self._ends(other, [pair.other.column for pair in both], self.shift)
            for pair in both:
                first, second = (pair.of(value) for value in values[pair.other.column])
                rows.append(MeasuredChannel(self.beside, pair.own.label, pair.own.unit, times, (first, second)))
        return {"rows": plain([{**vars(one), "difference": one.difference, "slope": one.slope} for one in rows])}

    def _ends(
        self, recording: OpenRecording, names: list[str], shift: float
    ) -> tuple[tuple[float, float], dict[str, tuple[float, float]]]:
        """Return times and values of the samples nearest to both times, on the clock of the first recording."""
        (first, before), (second, behind) = (recording.sample_at(at - shift, names) for at in self.at)
        return (first + shift, second + shift), {name: (before[name], behind[name]) for name in names}
