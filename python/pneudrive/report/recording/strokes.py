"""Changes from stroke to stroke: drift, and the peaks after reversals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.breakaway import NEEDED_RISE_SAMPLES, offset_line
from pneudrive.numbers import fixed
from pneudrive.report import style
from pneudrive.report.axes import grid
from pneudrive.report.topics import Topic
from pneudrive.report.words import by_seal, gauge_bar, plural, spread_evenly

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.friction.breakaway import ReversalPeak
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import Level, RecordingResult
    from pneudrive.report.page import Section

COLUMNS = 3
MOST_PANELS = 6
MOST_ROWS = 12
MOST_NAMED = 10  # peaks


def drift(found: Characterisation) -> Section | None:
    """Return the section on friction stroke by stroke; None if no level has three strokes in a direction."""
    long = [level for level in found.levels if max(v.size for v in level.stroke_friction_n.values()) >= 3]
    if not long:
        return None
    topic, drifting = Topic("recordings", "drift"), [v for v in long if any(s.has_trend for s in v.spreads.values())]
    strongest = sorted(drifting, key=lambda level: -_drift_share(level))[:MOST_ROWS]
    return topic.section(
        topic.text(drifting=len(drifting), levels=plural(len(long), "speed level")),
        topic.picture("drift", draw_drift(found)),
        topic.table(map(_drift_row, strongest), count=len(strongest)) if strongest else None,
    )


def _drift_share(level: Level) -> float:
    """Return the largest drift over all strokes of a direction, relative to friction."""
    slopes = [abs(s.slope_n) * s.strokes for s in level.spreads.values() if s.has_trend]
    return max(slopes, default=0.0) / max(abs(level.friction_n), 1e-9)


def _drift_row(level: Level) -> tuple[object, ...]:
    cells: list[object] = []
    for direction in (1, -1):
        s = level.spreads[direction]
        cells += [direction * s.slope_n, s.trend_p] if s.strokes > 1 else [None, None]
    both = level.spreads.values()
    return level.recording, *cells, sum(s.strokes for s in both), float(sum(s.effective for s in both))


def draw_drift(found: Characterisation) -> Figure:
    """Draw one panel for each seal."""
    groups = spread_evenly(list(by_seal(found).items()), MOST_PANELS)
    figure, axes = grid(len(groups), COLUMNS, 2.15, 0.5, alone_in=4.5, sharex=True, sharey=True)
    for axis, (seal, results) in zip(axes, groups, strict=True):
        pairs = [(r, level, _course(level)) for r in results for level in r.levels]
        strongest = max(pairs, key=lambda pair: _drift_share(pair[1]))
        for _, _, course in pairs:
            axis.plot(np.arange(1, course.size + 1), course, color=style.GREY, lw=0.5, alpha=0.7)
        shortest = min(course.size for _, _, course in pairs)
        median = np.median([course[:shortest] for _, _, course in pairs], axis=0)
        number = np.arange(1, shortest + 1)
        axis.plot(number, median, "-", color=style.BLACK, lw=1.4, label=f"median of {len(pairs)}")
        if _drift_share(strongest[1]) > 0.0:
            course = strongest[2]
            label = _short(strongest[0], strongest[1])
            axis.plot(np.arange(1, course.size + 1), course, "--s", color=style.BLUE, ms=2.5, lw=0.9, label=label)
        axis.axhline(0, color=style.GREY, lw=0.8)
        axis.set_title(seal)
        axis.legend(loc="lower right")
    style.headroom(axes[0], below=0.15)
    style.outer_labels(figure, "stroke in its direction", "friction against the mean / %")
    return figure


def _course(level: Level) -> np.ndarray:
    """Return the friction of each pair of strokes less the level's mean, %."""
    each = [values for values in level.stroke_friction_n.values() if values.size]
    shortest = min(values.size for values in each)
    return 100 * (np.mean([values[:shortest] for values in each], axis=0) / level.friction_n - 1)


def _short(result: RecordingResult, level: Level) -> str:
    run = result.recording.labels.get("run")
    name = f"{fixed(gauge_bar(level, result.recording), 1)} bar"
    return f"{name}, run {run}" if run else name


def peaks(found: Characterisation) -> Section | None:
    """Return the section on peaks after reversals and their faults; None without reversals."""
    every = [(result, level, peak) for result in found.results for level in result.levels for peak in level.peaks]
    if not every:
        return None
    topic, good = Topic("recordings", "reversals"), [peak for _, _, peak in every if not peak.flags]
    real = [peak for peak in good if peak.significant]
    counts = {flag: sum(flag in peak.flags for _, _, peak in every) for flag in topic.texts["spoils"]}
    spoilt = "; ".join(
        f"{words.format(needed=NEEDED_RISE_SAMPLES)}: {counts[flag]}"
        for flag, words in topic.texts["spoils"].items()
        if counts[flag]
    )
    numbers = {"reversals": plural(len(every), "reversal"), "good": plural(len(good), "peak"), "real": len(real)}
    return topic.section(
        topic.text("spoilt" if spoilt else "text", **numbers, spoilt=spoilt),
        topic.text("few", "note") if len(good) < len(every) / 2 else None,
        topic.picture("reversals", draw_peaks(every)),
        *topic.listed(topic.say("peak", p=p) for p in real[:MOST_NAMED]),
    )


def draw_peaks(every: list[tuple[RecordingResult, Level, ReversalPeak]]) -> Figure:
    """Draw one reversal in detail, and all reversals over the number of samples on their rise."""
    figure = style.new_figure(2.8)
    left, right = figure.subplots(1, 2)
    result, level, peak = every[int(np.argsort([p.rise_samples for _, _, p in every])[len(every) // 2])]
    r = result.recording
    top = int(np.searchsorted(r.time_s, peak.time_s))
    part = slice(max(top - 40, 0), top + 60)
    turn = next(stroke.from_m for stroke in level.strokes if stroke.index == peak.stroke)
    slope, intercept = offset_line(level.profile, turn)
    friction = peak.direction * (result.balance_n[part] - (slope * r.position_m[part] + intercept))
    left.plot(r.time_s[part] - peak.time_s, friction, "o-", color=style.BLACK, ms=2.5, lw=0.7)
    left.axhline(peak.sliding_n, color=style.BLUE, linestyle="--", lw=0.9, label="sliding friction in the window")
    left.axvline(0, color=style.ORANGE, linestyle=":", label=f"peak, {peak.rise_samples} samples on the rise")
    left.set(xlabel="time from the peak / s", ylabel="friction / N", title=f"{r.name}, stroke {peak.stroke}")
    left.legend(fontsize=6.8, loc="best")
    good = [p for _, _, p in every if not p.flags]
    bad = [p for _, _, p in every if p.flags]
    for group, marker, face, label in ((bad, "x", style.GREY, "spoilt"), (good, "o", style.BLUE, "usable")):
        x, y = [p.rise_samples for p in group], [p.excess_n for p in group]
        right.plot(x, y, marker, color=face, ms=3.5, label=label)
    right.axvline(NEEDED_RISE_SAMPLES, color=style.BLACK, linestyle="--", lw=0.9, label="samples needed")
    right.set(xlabel="samples on the rise", ylabel="peak over sliding friction / N")
    right.set_xlim(left=0)
    right.legend(fontsize=6.8)
    return figure
