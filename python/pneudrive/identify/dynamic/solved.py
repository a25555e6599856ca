"""Options and results of the searches of a fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pneudrive.identify.dynamic.sensors import Delay

if TYPE_CHECKING:
    from pneudrive.identify.determined import Undetermined
    from pneudrive.identify.dynamic.uncertainty import Solved
    from pneudrive.signals.drive_recording import DriveRecording

#: Lengths of the segments of the first phase, s, and of a second attempt; least number of samples of a segment.
LADDER_S, SECOND_LADDER_S, LEAST_SEGMENT_SAMPLES = (0.01, 0.04), (0.02, 0.08), 8


@dataclass(frozen=True)
class Attempt:
    """One search from start to end.

    Attributes
    ----------
    solved : Solved
    converged : bool
    missed : dict
        Channel -> residuals relative to its noise from sample to sample, if larger than `MISFIT`.
    score : float
        Mean logarithm of the residuals, relative to the noise of each channel from sample to sample.
    segment_s : float or None
        Length of the segments.
    """

    solved: Solved
    converged: bool
    missed: dict[str, float]
    score: float
    segment_s: float | None

    @property
    def good(self) -> bool:
        """Whether the search converged and the model follows the measurements."""
        return self.converged and not self.missed

    def rank(self) -> tuple[bool, bool, float]:
        """Rank of the attempt; a smaller value is better."""
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
        """Increasing lengths of the segments of the first phase, s."""
        return tuple(length for length in self.lengths_s[1:] if self.segment_s is not None and length < self.segment_s)

    def first_segment_s(self, record: DriveRecording) -> float | None:
        """Length of the first segments; None without a first phase."""
        if self.segment_s is None:
            return None
        step = record.duration_s / (len(record) - 1)
        return min(self.segment_s, max(self.lengths_s[0], LEAST_SEGMENT_SAMPLES * step))
