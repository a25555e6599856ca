"""Numbers in the report's form, and values that several sections need."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.conditions import Condition, group_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import Level, RecordingResult
    from pneudrive.signals.recording import Recording

MM = 1e3  # of a metre
CHAMBERS = ("chamber a", "chamber b", "both together")
MOST_SHOWN = 24  # panels of one kind in a report; a campaign has too many recordings to show all


def condition_names(found: CampaignCharacteristics) -> Callable[[Condition], str]:
    """Return a function that names the conditions of a campaign."""
    return partial(Condition.label, ambient_pressure_pa=found.identity.ambient_pressure_pa)


def seal_of(recording: Recording) -> str:
    """Return the name of the assembly: seal, mounting, drive."""
    return group_of(recording.labels)


def by_seal(found: Characterisation) -> dict[str, list[RecordingResult]]:
    """Group recordings by seal, each group in order of pressure."""
    groups: dict[str, list[RecordingResult]] = {}
    for result in found.results:
        groups.setdefault(seal_of(result.recording), []).append(result)
    return {seal: sorted(group, key=lambda r: gauge_bar(r.levels[0])) for seal, group in groups.items()}


def gauge_bar(level: Level) -> float:
    """Return the higher gauge pressure of both chambers, mean of both directions, bar."""
    return level.pressure_pa / 1e5


def speed_mm_s(level: Level) -> float:
    """Return the mean speed of both directions in the window, mm/s."""
    return 1e3 * level.speed_m_s


def chance(p: float) -> str:
    """Return a probability of chance as text.

    Examples
    --------
    >>> chance(0.0342), chance(1e-5), chance(float("nan"))
    ('0.034', '< 0.001', '–')
    """
    return "–" if not np.isfinite(p) else "< 0.001" if p < 1e-3 else f"{p:.2g}"


def spread_evenly(items: Sequence, most: int = MOST_SHOWN) -> list:
    """Return at most `most` of the items, evenly spread over all of them."""
    if len(items) <= most:
        return list(items)
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, most).astype(int))]


def broken(name: str, most: int) -> str:
    r"""Return a name in lines of at most `most` letters, where its parts allow it.

    Examples
    --------
    >>> broken("Kidney_2bar_tweederun", 18), broken("O-ring_1bar", 18)
    ('Kidney_2bar_\ntweederun', 'O-ring_1bar')
    """
    lines = [""]
    for part in re.findall(r"[^_\s]+[_\s]*|[_\s]+", name):
        if lines[-1] and len(lines[-1] + part.rstrip()) > most:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def plural(count: int, one: str, many: str = "") -> str:
    """Return a count with its noun.

    Examples
    --------
    >>> plural(1, "seal"), plural(3, "seal")
    ('1 seal', '3 seals')
    """
    return f"{count} {one if count == 1 else many or one + 's'}"


def sentence(text: str) -> str:
    """Return a text as a sentence: capital letter, one full stop, printed signs.

    Examples
    --------
    >>> sentence("area 5 cm2 +-0.1 cm2")
    'Area 5 cm² ±0.1 cm².'
    """
    text = text.replace("+-", "±").replace("cm2", "cm²")
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."
