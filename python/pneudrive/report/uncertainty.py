"""Uncertainty budget, and flags."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.numbers import with_u
from pneudrive.report import style
from pneudrive.report.page import Picture, Section, Table, Text
from pneudrive.report.words import FLAGS, plural

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.characterise import Characterisation
    from pneudrive.characterise.extract import Level

STATISTICAL = "spread between strokes"


def budget(found: Characterisation) -> Section:
    """List what each source contributes to friction, of the levels with the smallest and the largest uncertainty."""
    levels = sorted(found.levels, key=lambda level: level.expanded_n)
    least, most = levels[0], levels[-1]
    shown = [least] if least is most else [least, most]
    assumed = sorted({e.source for level in levels for e in level.budget if e.basis == "assumed"})
    blocks: list = [
        Text(
            "Combined as in the GUM: the spread between strokes (not between samples, which are not independent) and "
            "the systematic sources, in quadrature; U = 2 u. What both directions share, such as the zero and most of "
            "the gain of a sensor, cancels in friction and stays in the offset."
        ),
        Picture(
            "budget",
            "Standard uncertainty of friction by source, for the recordings with the smallest and the largest U.",
            draw(shown),
            synthetic=found.synthetic,
        ),
        *(_table(level) for level in shown),
    ]
    if assumed:
        blocks.append(
            Text(
                f"Assumed, because the layout does not say: {', '.join(assumed)}. State the accuracies of your "
                "sensors in the layout and these entries become yours.",
                "note",
            )
        )
    return Section("budget", "Uncertainty budget", tuple(blocks), synthetic=found.synthetic)


def contributions(level: Level) -> dict[str, float]:
    """Give the standard uncertainty of friction by source, N, the statistical one first."""
    out = {STATISTICAL: float(np.nan_to_num(level.stderr_n))}
    for entry in level.budget:
        out[entry.source] = float(np.hypot(out.get(entry.source, 0.0), entry.friction_n))
    return out


def draw(levels: list[Level]) -> Figure:
    """Bars by source, one for each level."""
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


def _table(level: Level) -> Table:
    rows = [(STATISTICAL, "data", "A", "", f"{np.nan_to_num(level.stderr_n):.3f}", "–")]
    for e in sorted(level.budget, key=lambda e: -e.friction_n):
        size = f"{e.standard_uncertainty:.3g} {e.unit}".strip()
        note = f"{size}{'; ' if e.note else ''}{e.note}"
        rows.append((e.source, e.basis, e.kind, note, f"{e.friction_n:.3f}", f"{e.offset_n:.3f}"))
    combined = float(np.hypot(np.nan_to_num(level.stderr_n), level.u_systematic_n))
    rows.append(("combined, u", "", "", "", f"{combined:.3f}", f"{level.u_offset_n:.3f}"))
    rows.append(("expanded, U (k = 2)", "", "", "", f"{level.expanded_n:.3f}", f"{2 * level.u_offset_n:.3f}"))
    head = ("source", "basis", "type", "standard uncertainty", "friction, N", "offset, N")
    return Table(head, tuple(rows), f"Budget of {level.recording}", numbers_from=4)


def flags(found: Characterisation) -> Section:
    """Every flag that was raised, what it means and where."""
    where: dict[str, list[str]] = {}
    for level in found.levels:
        spoilt = ["breakaway_spoiled"] if level.peaks and all(p.flags for p in level.peaks) else []
        for flag in (*level.flags, *spoilt):
            where.setdefault(flag, []).append(level.recording)
    samples: dict[str, int] = {}
    for recording in found.recordings:
        for flag, count in recording.flags.items():
            samples[flag] = samples.get(flag, 0) + count
    rows = []
    for flag in [*FLAGS, *(f for f in where if f not in FLAGS)]:
        if flag in where:
            names = list(dict.fromkeys(where[flag]))
            shown = "all recordings" if len(names) == len(found.results) > 1 else ", ".join(names[:8])
            shown += f" and {len(names) - 8} more" if len(names) > 8 and "all" not in shown else ""
            count = str(samples[flag]) if flag in samples else ""
            rows.append((flag.replace("_", " "), FLAGS.get(flag, ""), shown, str(len(names)), count))
    if not rows:
        return Section("flags", "Flags", (Text("No flag was raised."),), synthetic=found.synthetic)
    head = ("flag", "meaning", "where", "recordings", "samples")
    text = Text(f"{plural(len(rows), 'kind')} of flags. They mark what a reader of the friction map should know.")
    return Section("flags", "Flags", (text, Table(head, tuple(rows), numbers_from=3)), synthetic=found.synthetic)
