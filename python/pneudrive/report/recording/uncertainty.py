"""Uncertainty budget, and flags."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.sentences import flag_table
from pneudrive.numbers import plain, with_u
from pneudrive.report import style
from pneudrive.report.topics import Topic
from pneudrive.report.words import plural
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import Level
    from pneudrive.report.page import Section

STATISTICAL = "spread between strokes"
MOST_NAMED = 8  # names of recordings with a flag


def budget(found: Characterisation) -> Section:
    """Return the section on contributions to friction, at the smallest and the largest uncertainty."""
    topic, levels = Topic("recordings", "budget"), sorted(found.levels, key=lambda level: level.expanded_n)
    shown = levels if len(levels) == 1 else [levels[0], levels[-1]]
    assumed = ", ".join(sorted({e.source for level in levels for e in level.budget if e.basis == "assumed"}))
    return topic.section(
        topic.text(),
        topic.picture("budget", draw(shown)),
        *(topic.table(_rows(level), recording=level.recording) for level in shown),
        topic.text("assumed", "note", sources=assumed) if assumed else None,
    )


def contributions(level: Level) -> dict[str, float]:
    """Return the standard uncertainty of friction by source, N, the statistical one first."""
    out = {STATISTICAL: float(np.nan_to_num(level.stderr_n))}
    for entry in level.budget:
        out[entry.source] = float(np.hypot(out.get(entry.source, 0.0), entry.friction_n))
    return out


def draw(levels: list[Level]) -> Figure:
    """Draw bars by source, one for each level."""
    parts = [contributions(level) for level in levels]
    sources = sorted({s for p in parts for s in p}, key=lambda s: max(p.get(s, 0.0) for p in parts))
    figure = style.new_figure(0.27 * len(sources) + 1.1)
    axis = figure.subplots()
    y = np.arange(len(sources))
    height = 0.8 / len(levels)
    for index, (level, part) in enumerate(zip(levels, parts, strict=True)):
        axis.barh(
            y + (index - (len(levels) - 1) / 2) * height,
            [part.get(s, 0.0) for s in sources],
            height,
            color="white" if index else style.BLUE,
            edgecolor=style.BLACK,
            linewidth=0.6,
            hatch="////" if index else None,
            label=f"{level.recording}: {with_u(level.friction_n, level.expanded_n)}",
        )
    axis.set_yticks(y, sources)
    axis.grid(visible=False, axis="y")
    axis.set_xlabel("standard uncertainty of friction / N")
    axis.legend(loc="lower right")
    return figure


def _rows(level: Level) -> Iterator[tuple]:
    chance = float(np.nan_to_num(level.stderr_n))
    yield STATISTICAL, "data", "A", "", chance, None
    for e in sorted(level.budget, key=lambda e: -e.friction_n):
        factor, unit = readable(e.unit)
        size = f"{plain(e.standard_uncertainty / factor)} {unit}".strip()
        yield e.source, e.basis, e.kind, f"{size}{'; ' if e.note else ''}{e.note}", e.friction_n, e.offset_n
    yield "combined, u", "", "", "", float(np.hypot(chance, level.u_systematic_n)), level.u_offset_n
    yield "expanded, U (k = 2)", "", "", "", level.expanded_n, 2 * level.u_offset_n


def flags(found: Characterisation) -> Section:
    """Return the section on flags: meaning and place of each."""
    topic, where, samples = Topic("recordings", "flags"), {}, Counter()
    for level in found.levels:
        spoilt = ["breakaway_spoiled"] if level.peaks and all(p.flags for p in level.peaks) else []
        for flag in (*level.flags, *spoilt):
            where.setdefault(flag, {})[level.recording] = True
    for recording in found.recordings:
        samples.update(recording.flags)
    rows = []
    for flag, texts in flag_table().items():
        names = list(where.get(flag, ()))
        if not names:
            continue
        more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
        every = len(names) == len(found.results) > 1
        shown = "all recordings" if every else ", ".join(names[:MOST_NAMED]) + more
        rows.append((flag.replace("_", " "), texts["means"], texts["do"], shown, len(names), samples.get(flag, "")))
    if not rows:
        return topic.section(topic.text("nothing"))
    return topic.section(topic.text(kinds=plural(len(rows), "kind")), topic.table(rows))
