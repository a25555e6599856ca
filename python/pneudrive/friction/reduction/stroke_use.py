"""Strokes of a recording that are used for its results, and the reasons why others are not used."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pneudrive.friction.reduction.strokes import COVERED_SHARE
from pneudrive.friction.sentences import sentence

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from pneudrive.signals.motion import Stroke

MOST_NAMED = 12  # recordings with a sentence of their own


@dataclass(frozen=True)
class StrokeUse:
    """Number of strokes of one recording, number of used strokes, and number of unused strokes by reason.

    Attributes
    ----------
    recorded, used : int
    left_out : dict
        Reason -> number of strokes: ``window`` (less than a quarter of the window is crossed), ``unsettled`` (too few
        settled samples in the window), ``apart`` (the speed class has no position common to both directions).
    """

    recorded: int = 0
    used: int = 0
    left_out: dict[str, int] = field(default_factory=dict)

    @classmethod
    def of(
        cls, strokes: Sequence[Stroke], used: Collection[int], covering: Collection[int], window_m: tuple[float, float]
    ) -> StrokeUse:
        """Count the strokes.

        Parameters
        ----------
        strokes : sequence of Stroke
            All strokes of the recording.
        used, covering : collection of int
            Indices of the strokes in a speed class with a result, and of those that cover the window.
        window_m : tuple of float
            Positions between which friction is averaged.
        """
        reasons = [_reason(s, covering, window_m) for s in strokes if s.index not in used]
        counts = {name: reasons.count(name) for name in ("window", "unsettled", "apart") if name in reasons}
        return cls(len(strokes), len(strokes) - len(reasons), counts)

    @property
    def why(self) -> str:
        """Reasons in words; "" if all strokes are used."""
        return ", ".join(sentence(f"strokes.{name}", count=count) for name, count in self.left_out.items())


def _reason(stroke: Stroke, covering: Collection[int], window_m: tuple[float, float]) -> str:
    if stroke.index in covering:
        return "apart"
    low, high = sorted((stroke.from_m, stroke.to_m))
    crossed = min(high, window_m[1]) - max(low, window_m[0])
    return "window" if crossed < COVERED_SHARE * (window_m[1] - window_m[0]) else "unsettled"


def stroke_notes(uses: Mapping[str, StrokeUse]) -> list[str]:
    """Return one sentence for each recording with unused strokes. Many recordings share one sentence.

    Parameters
    ----------
    uses : mapping
        Name of each recording -> its strokes.
    """
    partial = sorted(
        (use.used / max(use.recorded, 1), i, name, use) for i, (name, use) in enumerate(uses.items()) if use.why
    )
    shown, rest = partial[:MOST_NAMED], partial[MOST_NAMED:]
    notes = [
        sentence("strokes.partial", name=name, used=use.used, recorded=use.recorded, why=use.why)
        for _, _, name, use in sorted(shown, key=lambda item: item[1])
    ]
    if rest:
        used, recorded = (sum(getattr(use, name) for *_, use in rest) for name in ("used", "recorded"))
        notes.append(sentence("strokes.rest", count=len(rest), used=used, recorded=recorded))
    return notes
