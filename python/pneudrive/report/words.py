"""Numbers as the report writes them, and the questions that several sections ask."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.pressure_line import ALL_RECORDINGS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.characterise import Characterisation, Recording
    from pneudrive.characterise.extract import Level, RecordingResult

MOST_SHOWN = 24  # panels of one kind in a report; a campaign has more recordings than anyone looks at
#: What each flag of the friction map and of the samples means.
FLAGS = {
    "non_finite": "samples with a value that is not finite, left out",
    "repeated_time": "samples that repeat a time, left out",
    "spike": "single samples that stand far out of both neighbours, left out",
    "saturated": "samples at the end of a sensor's range",
    "stuck": "samples in which a channel stood still while the piston travelled",
    "gap": "intervals at least five times as long as usual",
    "unreadable_row": "rows that could not be read",
    "negative_friction": "friction is negative beyond its uncertainty: a sign in the layout is wrong",
    "unpaired": "one direction only: the offset is not separated from friction",
    "single_stroke": "one stroke in a direction: no spread between strokes",
    "trend": "friction drifts from stroke to stroke beyond chance",
    "stick_slip": "the piston sticks and slips: the mean over the window is no point of a friction curve",
    "speed_ripple": "speed varies by more than 20 % within a stroke",
    "window_not_covered": "part of the window has no settled samples",
    "pressure_moves": "pressure changes within a stroke by more than half the friction",
    "unequal_speeds": "the two directions moved at speeds that differ by more than 10 %",
    "below_ambient": "a chamber is below ambient pressure: a vacuum, or gauge pressures called absolute",
    "beyond_usual": "pressures or speeds are unusual for pneumatic drives",
    "force_not_pressure": "the force does not follow pressure times area",
    "friction_beyond_piston": "friction is more than 10 bar push on the piston",
    "no_friction": "friction is less than a force sensor sees",
    "breakaway_spoiled": "no reversal peak is usable",
}


def seal_of(recording: Recording) -> str:
    """Name of the seal, or the group of recordings that no label tells apart."""
    return recording.labels.get("seal", ALL_RECORDINGS)


def by_seal(found: Characterisation) -> dict[str, list[RecordingResult]]:
    """Group recordings by seal, each group in order of pressure."""
    groups: dict[str, list[RecordingResult]] = {}
    for result in found.results:
        groups.setdefault(seal_of(result.recording), []).append(result)
    return {seal: sorted(group, key=lambda r: gauge_bar(r.levels[0], r.recording)) for seal, group in groups.items()}


def gauge_bar(level: Level, recording: Recording) -> float:
    """Gauge pressure of the side that is pressurised more, mean of both directions, bar."""
    return level.larger_gauge_pa(recording.ambient_pressure_pa) / 1e5


def speed_mm_s(level: Level) -> float:
    """Mean speed of both directions in the window, mm/s."""
    return 1e3 * level.speed_m_s


def chance(p: float) -> str:
    """Write the probability of as much by chance.

    Examples
    --------
    >>> chance(0.0342), chance(1e-5), chance(float("nan"))
    ('0.034', '< 0.001', '–')
    """
    return "–" if not np.isfinite(p) else "< 0.001" if p < 1e-3 else f"{p:.2g}"


def spread_evenly(items: Sequence, most: int = MOST_SHOWN) -> list:
    """At most `most` of the items, evenly over all of them."""
    if len(items) <= most:
        return list(items)
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, most).astype(int))]


def plural(count: int, one: str, many: str = "") -> str:
    """Write a count with its noun.

    Examples
    --------
    >>> plural(1, "seal"), plural(3, "seal")
    ('1 seal', '3 seals')
    """
    return f"{count} {one if count == 1 else many or one + 's'}"


def sentence(text: str) -> str:
    """Begin with a capital letter, end with one full stop, and set signs as in print.

    Examples
    --------
    >>> sentence("area 5 cm2 +-0.1 cm2")
    'Area 5 cm² ±0.1 cm².'
    """
    text = text.replace("+-", "±").replace("cm2", "cm²")
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."
