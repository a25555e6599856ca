"""Searches of a fit: their options, and where one ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pneudrive.identify.dynamic.sensors import Delay

if TYPE_CHECKING:
    from pneudrive.identify.base import Undetermined
    from pneudrive.identify.dynamic.uncertainty import Solved
    from pneudrive.signals.drive_recording import DriveRecording

#: Lengths of the segments of the first phase, s, and those of a second attempt; the shortest has so many samples.
LADDER_S, SECOND_LADDER_S, LEAST_SEGMENT_SAMPLES = (0.01, 0.04), (0.02, 0.08), 8


@dataclass(frozen=True)
class Attempt:
    """One search from start to end.

    Attributes
    ----------
    solved : Solved
    converged : bool
    missed : dict
        Channel -> residuals over its noise from sample to sample, where they are larger by more than `MISFIT`.
    score : float
        Mean logarithm of the residuals, each over the noise of its channel from sample to sample.
    segment_s : float or None
        Length of its segments.
    """

    solved: Solved
    converged: bool
    missed: dict[str, float]
    score: float
    segment_s: float | None

    @property
    def good(self) -> bool:
        """Whether the search converged to where the model follows what was measured."""
        return self.converged and not self.missed

    def rank(self) -> tuple[bool, bool, float]:
        """Less is better."""
        return not self.good, not self.converged, self.score


@dataclass
class SearchOptions:
    """Checked options of `identify`."""

    segment_s: float | None
    robust: bool
    rtol: float
    threads: int
    notes: list[str] = field(default_factory=list)
    lost: list[Undetermined] = field(default_factory=list)
    interrupted: bool = False
    last_attempt: bool = False
    lengths_s: tuple[float, ...] = LADDER_S
    delay: Delay = field(default_factory=Delay)

    @property
    def ladder(self) -> tuple[float, ...]:
        """Lengths to which the segments of the first phase grow, s."""
        return tuple(length for length in self.lengths_s[1:] if self.segment_s is not None and length < self.segment_s)

    def first_segment_s(self, record: DriveRecording) -> float | None:
        """Length of the first segments; None where there is no first phase."""
        if self.segment_s is None:
            return None
        step = record.duration_s / (len(record) - 1)
        return min(self.segment_s, max(self.lengths_s[0], LEAST_SEGMENT_SAMPLES * step))
