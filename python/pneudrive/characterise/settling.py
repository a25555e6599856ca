"""Which samples of a stroke count: a settling criterion, or the source paper's protocol."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from pneudrive.characterise.motion import local_slope, middle

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characterise.motion import Stroke


@dataclass(frozen=True, eq=False)
class Motion:
    """What a choice of samples may look at: arrays of shape (n,), and the strokes in them."""

    time_s: NDArray[np.float64]
    position_m: NDArray[np.float64]
    balance_n: NDArray[np.float64]
    strokes: list[Stroke]


class SampleChoice(Protocol):
    """A way to choose, and perhaps smooth, the samples of a stroke that enter its mean."""

    @property
    def name(self) -> str:
        """Name for provenance."""
        ...

    @property
    def uses_window(self) -> bool:
        """Whether the mean is over equal positions of the window; otherwise over all samples that count."""
        ...

    def choose(self, motion: Motion) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Give the mask of samples that count, shape (n,), and the balance to average, shape (n,)."""
        ...


@dataclass(frozen=True)
class Settled:
    """Samples after the reversal's transient, with no need for a controlled speed.

    A stroke has settled after ``speed_travels`` times the travel in which its speed reaches ``speed_share`` of its
    own middle speed, and after ``force_travels`` times the travel in which the balance goes through ``force_share`` of
    its swing from the opposite direction's level. Presliding approaches like  1 - 2 exp(-x/l):  80 % of the swing takes
    1.6 l, and after three times that 2 % are left; a higher share would wait for a friction that varies over position.
    At the end, samples below the speed share are dropped. The levels are medians over the middle 60 % of the travel,
    so neither speed nor force needs to be constant.
    """

    speed_share: float = 0.8
    force_share: float = 0.8
    speed_travels: float = 2.0
    force_travels: float = 3.0
    name: str = "settled"
    uses_window: bool = True

    def choose(self, motion: Motion) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Give the mask of settled samples and the balance as it is."""
        position_m, balance_n = motion.position_m, motion.balance_n
        velocity = local_slope(motion.time_s, position_m)
        levels = {d: _middle_level(motion, d) for d in (1, -1)}
        mask = np.zeros(position_m.size, dtype=bool)
        for stroke in motion.strokes:
            part = stroke.samples
            travelled = np.abs(position_m[part] - stroke.from_m)
            fast = np.abs(velocity[part]) >= self.speed_share * abs(stroke.speed_m_s)
            if not fast.any():
                continue
            begin = self.speed_travels * travelled[int(np.argmax(fast))]
            own, opposite = levels[stroke.direction], levels[-stroke.direction]
            if own is not None and opposite is not None and own != opposite:
                risen = (balance_n[part] - opposite) / (own - opposite) >= self.force_share
                if risen.any():
                    begin = max(begin, self.force_travels * travelled[int(np.argmax(risen))])
            last_fast = int(fast.size - np.argmax(fast[::-1]))
            kept = travelled >= begin
            kept[last_fast:] = False
            mask[part] = kept
        return mask, balance_n


@dataclass(frozen=True)
class SourcePaper:
    """The source paper's protocol: first 5 % dropped, moving average of 5 samples, mean of the rest.

    The moving average leaves the mean nearly unchanged; it is kept so that published numbers can be
    compared. Dropping 5 % is not enough where the distance to reach speed is longer.
    """

    dropped_share: float = 0.05
    average_samples: int = 5
    name: str = "source-paper"
    uses_window: bool = False

    def choose(self, motion: Motion) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Give the mask of samples after the first 5 % of each stroke and the smoothed balance."""
        mask = np.zeros(motion.time_s.size, dtype=bool)
        smooth = motion.balance_n.copy()
        kernel = np.ones(self.average_samples)
        for stroke in motion.strokes:
            length = stroke.stop - stroke.start
            dropped = int(np.ceil(self.dropped_share * length))
            mask[stroke.start + dropped : stroke.stop] = True
            part = motion.balance_n[stroke.samples]
            smooth[stroke.samples] = np.convolve(part, kernel, "same") / np.convolve(np.ones(length), kernel, "same")
        return mask, smooth


SAMPLE_CHOICES = {"settled": Settled, "source-paper": SourcePaper}


def _middle_level(motion: Motion, direction: int) -> float | None:
    """Median balance over the middle 60 % of all strokes of one direction."""
    values = []
    for stroke in motion.strokes:
        if stroke.direction == direction:
            share = (motion.position_m[stroke.samples] - stroke.from_m) / (stroke.to_m - stroke.from_m)
            values.append(motion.balance_n[stroke.samples][(share > 0.2) & (share < 0.8)])
    joined = np.concatenate(values) if values else np.array([])
    return middle(joined) if joined.size else None
