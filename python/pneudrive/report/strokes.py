"""From stroke to stroke: drift, and the peaks after reversals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.reversal import NEEDED_RISE_SAMPLES, offset_line
from pneudrive.numbers import fixed
from pneudrive.report import style
from pneudrive.report.page import Items, Picture, Section, Table, Text
from pneudrive.report.words import by_seal, gauge_bar, plural, spread_evenly

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.characterise import Characterisation
    from pneudrive.characterise.extract import Level, RecordingResult
    from pneudrive.characterise.reversal import ReversalPeak

COLUMNS = 3
MOST_PANELS = 6
MOST_ROWS = 12
SPOILS = {
    "undersampled": f"fewer than {NEEDED_RISE_SAMPLES} samples on the rise",
    "pressure_transient": "pressure changes during the rise",
    "inertia": "the mass beyond the sensor is accelerated during the rise",
    "gap": "a gap in the samples",
    "no_peak": "no maximum of its own",
}


def drift(found: Characterisation) -> Section | None:
    """Friction of each stroke in the order of time; None where no level has three strokes in a direction."""
    long = [level for level in found.levels if max(v.size for v in level.stroke_friction_n.values()) >= 3]
    if not long:
        return None
    drifting = [level for level in long if any(s.has_trend for s in level.spreads.values())]
    blocks: list = [
        Text(
            f"Friction of each stroke, offset taken out. In {len(drifting)} of {plural(len(long), 'speed level')} it "
            "drifts beyond chance (Kendall's test, 5 %); where it does, strokes are not independent and the standard "
            "error counts fewer of them."
        ),
        Picture(
            "drift",
            "Friction of each stroke in the order of time, relative to the mean of its recording, mean of both "
            "directions: every recording of the seal (grey), their median, and the one that drifts most.",
            draw_drift(found),
            synthetic=found.synthetic,
        ),
    ]
    strongest = sorted(drifting, key=lambda level: -_drift_share(level))[:MOST_ROWS]
    rows = tuple(_drift_row(level) for level in strongest)
    if rows:
        head = ("recording", "per stroke +x, N", "p", "per stroke −x, N", "p", "strokes", "independent")
        blocks.append(Table(head, rows, f"The {len(rows)} levels that drift most (Theil-Sen slope, Kendall's p)"))
    return Section("drift", "Drift from stroke to stroke", tuple(blocks), synthetic=found.synthetic)


def _drift_share(level: Level) -> float:
    """Largest drift over all strokes of a direction, as a share of friction."""
    slopes = [abs(s.slope_n) * s.strokes for s in level.spreads.values() if s.has_trend]
    return max(slopes, default=0.0) / max(abs(level.friction_n), 1e-9)


def _drift_row(level: Level) -> tuple[str, ...]:
    cells = []
    for direction in (1, -1):
        s = level.spreads[direction]
        cells += [f"{direction * s.slope_n:+.3f}", f"{s.trend_p:.2g}"] if s.strokes > 1 else ["–", "–"]
    strokes = sum(s.strokes for s in level.spreads.values())
    return (level.recording, *cells, str(strokes), f"{sum(s.effective for s in level.spreads.values()):.1f}")


def draw_drift(found: Characterisation) -> Figure:
    """One panel for each seal."""
    groups = spread_evenly(list(by_seal(found).items()), MOST_PANELS)
    rows = -(-len(groups) // COLUMNS)
    figure = style.new_figure(2.15 * rows + 0.5, style.WIDTH_IN if len(groups) > 1 else 4.5)
    axes = style.panels(figure, len(groups), COLUMNS, sharex=True, sharey=True)
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
    """Friction of each pair of strokes against the level's mean, %; of as many strokes as both directions have."""
    each = [values for values in level.stroke_friction_n.values() if values.size]
    shortest = min(values.size for values in each)
    return 100 * (np.mean([values[:shortest] for values in each], axis=0) / level.friction_n - 1)


def _short(result: RecordingResult, level: Level) -> str:
    run = result.recording.labels.get("run")
    name = f"{fixed(gauge_bar(level, result.recording), 1)} bar"
    return f"{name}, run {run}" if run else name


def peaks(found: Characterisation) -> Section | None:
    """Peaks after reversals with what spoils them; None where nothing reversed."""
    every = [(result, level, peak) for result in found.results for level in result.levels for peak in level.peaks]
    if not every:
        return None
    good = [peak for _, _, peak in every if not peak.flags]
    real = [peak for peak in good if peak.significant]
    counts = {flag: sum(flag in peak.flags for _, _, peak in every) for flag in SPOILS}
    spoilt = "; ".join(f"{SPOILS[flag]}: {count}" for flag, count in counts.items() if count)
    text = (
        f"{plural(len(every), 'reversal')}: {plural(len(good), 'peak')} usable, of which {len(real)} stand out of the "
        f"noise. What spoils the others ({spoilt}; several may apply to one)."
        if spoilt
        else f"{plural(len(every), 'reversal')}, all usable; {len(real)} stand out of the noise."
    )
    blocks: list = [Text(text)]
    if len(good) < len(every) / 2:
        blocks.append(
            Text(
                "These recordings cannot say how large breakaway friction is: the rise after a reversal is over "
                "before enough samples are taken, or pressure moves the force while it rises. Sampling at 1 kHz or "
                "more, and a reservoir at the chamber, would show it.",
                "note",
            )
        )
    caption = "(a) One reversal, each sample marked, offset taken out. (b) All peaks over the samples on their rise."
    blocks.append(Picture("reversals", caption, draw_peaks(every), synthetic=found.synthetic))
    if real:
        lines = [f"{p.recording}, {p.friction_n:.2f} N, {p.excess_n:+.2f} N over sliding" for p in real[:10]]
        blocks.append(Items(tuple(lines)))
    return Section("reversals", "Peaks after reversals", tuple(blocks), synthetic=found.synthetic)


def draw_peaks(every: list[tuple[RecordingResult, Level, ReversalPeak]]) -> Figure:
    """One reversal in full, and all of them by the number of samples on their rise."""
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
    left.set_xlabel("time from the peak / s")
    left.set_ylabel("friction / N")
    left.set_title(f"{r.name}, stroke {peak.stroke}")
    left.legend(fontsize=6.8, loc="best")
    good = [p for _, _, p in every if not p.flags]
    bad = [p for _, _, p in every if p.flags]
    for group, marker, face, label in ((bad, "x", style.GREY, "spoilt"), (good, "o", style.BLUE, "usable")):
        right.plot(
            [p.rise_samples for p in group], [p.excess_n for p in group], marker, color=face, ms=3.5, label=label
        )
    right.axvline(NEEDED_RISE_SAMPLES, color=style.BLACK, linestyle="--", lw=0.9, label="samples needed")
    right.set_xlabel("samples on the rise")
    right.set_ylabel("peak over sliding friction / N")
    right.set_xlim(left=0)
    right.legend(fontsize=6.8)
    return figure
