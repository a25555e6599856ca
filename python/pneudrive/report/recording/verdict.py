"""The verdict in five lines, with U (k = 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.pressure import CONFOUNDED
from pneudrive.numbers import fixed, with_u
from pneudrive.report.recording.speed import richest
from pneudrive.report.topics import Topic
from pneudrive.report.words import by_seal, gauge_bar, plural, speed_mm_s

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pneudrive.estimate.estimates import Estimate
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.report.study import Fits, Study

LINES = 5
WIDEST_AREA = 0.3  # of the nominal area, from end to end of the interval


def verdict(found: Characterisation | None, fits: Fits, study: Study | None = None) -> list[str]:
    """Return the lines of the verdict on recordings and of a study."""
    return lines_of(found, fits, () if study is None else study.addition(found).verdict)


def lines_of(found: Characterisation | None, fits: Fits, of_study: Iterable[str]) -> list[str]:
    """Return the lines on recordings, and after them those of a study."""
    topic, last = Topic("recordings", "verdict"), list(of_study)
    lines = []
    if found is not None:
        lines = [_friction(topic, found), _pressure(topic, found), _closure(topic, found), _open(topic, found, fits)]
        last = last or [_quality(topic, found)]
    return [*lines, *last][:LINES]


def _friction(topic: Topic, found: Characterisation) -> str:
    levels = sorted(found.levels, key=lambda level: level.friction_n)
    recordings = {r.name: r for r in found.recordings}
    kind = "simulated recording" if found.synthetic else "recording"
    shown = [
        topic.say(
            "level",
            friction=with_u(level.friction_n, level.expanded_n),
            recording=level.recording,
            bar=fixed(gauge_bar(level, recordings[level.recording]), 1),
            speed=speed_mm_s(level),
        )
        for level in (levels if len(levels) == 1 else (levels[0], levels[-1]))
    ]
    counts = {"recordings": plural(len(found.results), kind), "seals": plural(len(by_seal(found)), "seal")}
    return topic.say("friction", **counts, shown=" to ".join(shown))


def _pressure(topic: Topic, found: Characterisation) -> str:
    lines, spread = found.pressure_lines, found.run_spread
    known = topic.say("no_runs") if not spread else topic.say("runs", percent=100 * spread.relative)
    if spread and _beyond_u(found):
        known = topic.say("runs_beyond_u", runs=known)
    if not lines:
        return topic.say("no_pressure", known=known)
    slopes = sorted(1e5 * line.slope_n_pa for line in lines)
    rise = f"{_range(slopes, '+.2f')} N/bar"
    confounded = sum(abs(line.speed_pressure_correlation) > CONFOUNDED for line in lines)
    tail = topic.say("confounded", some=confounded, all=len(lines)) if confounded else ""
    return topic.say("pressure", rise=rise, known=known, tail=tail)


def _range(values: list[float], form: str) -> str:
    """Return the ends of sorted values in words; one number where there is one value."""
    return " to ".join(f"{one:{form}}" for one in (values[:1] if len(values) == 1 else (values[0], values[-1])))


def _beyond_u(found: Characterisation) -> bool:
    relative = [level.expanded_n / level.friction_n for level in found.levels if level.friction_n > 0]
    return bool(relative) and found.run_spread is not None and found.run_spread.relative > float(np.median(relative))


def _closure(topic: Topic, found: Characterisation) -> str:
    if not found.closures:
        return topic.say("no_closure")
    known = [c for c in found.closures if all(_is_determined(a, c.nominal_m2[s]) for s, a in c.areas_m2.items())]
    if not known:
        return topic.say("no_area")
    areas = sorted(100 * (a.value / c.nominal_m2[s] - 1) for c in known for s, a in c.areas_m2.items())
    zeros = sorted(c.force_zero_n.value for c in known)
    large = sum(abs(level.offset_n) > level.friction_n for level in found.levels)
    offset = topic.say("offset", recordings=plural(large, "recording")) if large else ""
    return topic.say("closure", areas=_range(areas, "+.1f"), zeros=_range(zeros, "+.2f"), offset=offset)


def _is_determined(area: Estimate, nominal: float) -> bool:
    """Return whether an area can be reported: a narrow interval, or too few recordings for an interval."""
    return not np.isfinite(area.low) or area.high - area.low < WIDEST_AREA * nominal


def _open(topic: Topic, found: Characterisation, fits: Fits) -> str:
    speeds = [p.speed_m_s * 1e3 for p in found.points]
    low, high = f"{min(speeds):.3g}", f"{max(speeds):.3g}"
    span = f"{low} to {high} mm/s" if low != high else f"{low} mm/s alone"
    if not fits:
        return topic.say("no_law", span=span)
    names = {item.parameter for by_law in fits.values() for item in richest(by_law).undetermined}
    lost = [words for name, words in topic.texts["parameters"].items() if name in names]
    return topic.say("open", span=span, lost=", ".join(lost)) if lost else topic.say("every", span=span)


def _quality(topic: Topic, found: Characterisation) -> str:
    peaks = [p for level in found.levels for p in level.peaks]
    usable = sum(not p.flags for p in peaks)
    said = topic.say("peaks", usable=usable, peaks=plural(len(peaks), "reversal peak")) if peaks else ""
    drifting = sum("trend" in level.flags for level in found.levels)
    return topic.say("quality", drifting=drifting, levels=plural(len(found.levels), "speed level"), peaks=said)
