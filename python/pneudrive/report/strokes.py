"""Changes of recordings from stroke to stroke: drift, the peaks after reversals, and stick-slip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.figures import THIN, Axis, Figure, Line, Look, Markers, Panel, Rule
from pneudrive.friction.stick_slip import NEEDED_RISE_SAMPLES, offset_line
from pneudrive.numbers import fixed
from pneudrive.report.page import Paragraph
from pneudrive.report.tables import Topic, by_seal, gauge_bar, plural, spread_evenly
from pneudrive.signals.motion import local_slope

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import Level, RecordingResult
    from pneudrive.friction.stick_slip import ReversalPeak, StickSlip
    from pneudrive.report.page import Section

MOST_PANELS, MOST_ROWS, MOST_NAMED = 6, 12, 10
SHOWN_S = 10.0
MOST_SLIPS, MOST_COLUMNS = 24, 3


def drift(found: Characterisation) -> Section | None:
    """Return the section on friction stroke by stroke; None if no level has three strokes in a direction."""
    long = [level for level in found.levels if max(v.size for v in level.stroke_friction_n.values()) >= 3]
    if not long:
        return None
    topic, drifting = Topic("recordings", "drift"), [v for v in long if any(s.has_trend for s in v.spreads.values())]
    strongest = sorted(drifting, key=lambda level: -_drift_share(level))[:MOST_ROWS]
    return topic.section(
        topic.text(drifting=len(drifting), levels=plural(len(long), "speed level")),
        topic.picture("drift", courses(found)),
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


def courses(found: Characterisation) -> Figure:
    """Draw friction against its mean from stroke to stroke, a panel for each seal."""
    panels = []
    for seal, results in spread_evenly(list(by_seal(found).items()), MOST_PANELS):
        pairs = [(r, level, _course(level)) for r in results for level in r.levels]
        shortest = min(course.size for *_, course in pairs)
        median = np.median([course[:shortest] for *_, course in pairs], axis=0)
        marks: list[Any] = [Line(_numbers(course), course, look=THIN, width=0.5) for *_, course in pairs]
        marks.append(Line(_numbers(median), median, f"median of {len(pairs)}", width=1.4))
        result, level, course = max(pairs, key=lambda pair: _drift_share(pair[1]))
        if _drift_share(level) > 0.0:
            run = result.recording.labels.get("run")
            label = f"{fixed(gauge_bar(level), 1)} bar" + (f", run {run}" if run else "")
            marks.append(Markers(_numbers(course), course, label, Look("blue", "--", "s"), size=2.5, joined=True))
        panels.append(Panel([*marks, Rule(y=0.0)], seal))
    y = Axis("friction against the mean / %", below=0.15)
    shared = {"share_x": "all", "share_y": "all", "legend": "panel", "row_in": 2.0}
    return Figure(panels, "stroke in its direction", y, columns=3, **shared)


def _numbers(course: np.ndarray) -> np.ndarray:
    return np.arange(1, course.size + 1)


def _course(level: Level) -> np.ndarray:
    """Return the friction of each pair of strokes relative to the level's mean, less 1."""
    each = [values for values in level.stroke_friction_n.values() if values.size]
    shortest = min(values.size for values in each)
    return np.mean([values[:shortest] for values in each], axis=0) / level.friction_n - 1


# --- peaks after reversals -------------------------------------------------------------------------------------------


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
        topic.picture("reversals", reversals(every)),
        *topic.listed(topic.say("peak", p=p) for p in real[:MOST_NAMED]),
    )


def reversals(every: list[tuple[RecordingResult, Level, ReversalPeak]]) -> Figure:
    """Draw one reversal in detail, and all reversals over the number of samples on their rise."""
    result, level, peak = every[int(np.argsort([p.rise_samples for _, _, p in every])[len(every) // 2])]
    r = result.recording
    top = int(np.searchsorted(r.time_s, peak.time_s))
    part = slice(max(top - 40, 0), top + 60)
    turn = next(stroke.from_m for stroke in level.strokes if stroke.index == peak.stroke)
    slope, intercept = offset_line(level.profile, turn)
    friction = peak.direction * (result.balance_n[part] - (slope * r.position_m[part] + intercept))
    detail = [
        Markers(r.time_s[part] - peak.time_s, friction, size=2.5, joined=True, filled=True),
        Rule(y=peak.sliding_n, label="sliding friction in the window", look=Look("blue", "--"), width=0.9),
        Rule(0.0, label=f"peak, {peak.rise_samples} samples on the rise", look=Look("orange", ":"), width=1.1),
    ]
    over = []
    for label, own, is_good in (("spoilt", Look("grey", "-", "x"), False), ("usable", Look("blue", "-", "o"), True)):
        group = [(p.rise_samples, p.excess_n) for _, _, p in every if bool(p.flags) != is_good]
        x, y = np.array(group, dtype=float).reshape(-1, 2).T
        over.append(Markers(x, y, label, own, size=3.5, filled=True))
    needed = Rule(float(NEEDED_RISE_SAMPLES), label="samples needed", look=Look("black", "--"), width=0.9)
    title, x_axis = f"{r.name}, stroke {peak.stroke}", Axis("samples on the rise", low=0.0)
    left = Panel(detail, title, "time from the peak / s", "friction / N")
    right = Panel([*over, needed], "", x_axis, "peak over sliding friction / N")
    return Figure([left, right], columns=2, row_in=2.8, rest_in=0.0, legend="panel", text_scale=0.93)


# --- stick-slip ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DrawnMotion:
    """One motion that is drawn: time from zero, SI."""

    title: str
    time_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    mean_speed_m_s: float


def stick_slip(found: Characterisation) -> Section | None:
    """Return the section on stick-slip, with pictures; None if there is nothing to report."""
    every = [(r, level, s) for r in found.results for level in r.levels for s in level.stick_slip]
    slipping = [item for item in every if item[2].found and "stick_slip" in item[1].flags]
    if not every or (found.synthetic and not slipping):
        return None
    topic, strokes = Topic("recordings", "stick-slip"), plural(len(every), "stroke")
    if not slipping:  # the text names the shortest visible period
        jumps = [s for *_, s in every if s.found]
        text = topic.say("nothing", strokes=strokes, finest=float(np.median([s.resolution_s for *_, s in every])))
        if jumps:
            percent = 100 * max(s.stuck_share for s in jumps)
            text += topic.say("jumps", strokes=plural(len(jumps), "stroke"), percent=percent)
        return topic.section(Paragraph(text))
    shown = [_of_stroke(*item) for item in slipping[:MOST_COLUMNS]]
    return topic.section(
        topic.text(some=len(slipping), strokes=strokes),
        topic.table(_slip(level, s) for _, level, s in slipping[:MOST_SLIPS]),
        topic.picture("stick-slip-recordings", in_time(shown)),
        topic.picture("stick-slip-recordings-phase", phase_plane(shown)),
    )


def _slip(level: Level, s: StickSlip) -> tuple[object, ...]:
    mean = 1e3 * s.mean_speed_m_s
    ratio = s.peak_speed_m_s / s.mean_speed_m_s if s.mean_speed_m_s > 0 else None
    return level.recording, s.direction, mean, s.periods, s.period_s, 1e3 * s.step_m, ratio, 100 * s.stuck_share


def _of_stroke(result: RecordingResult, level: Level, s: StickSlip) -> DrawnMotion:
    r = result.recording
    part = slice(*np.searchsorted(r.time_s, (s.start_s, s.stop_s)))
    time, position = r.time_s[part], r.position_m[part]
    window = max(int(s.resolution_s / 2 / max(float(np.median(np.diff(time))), 1e-12)) // 2, 1)
    velocity = s.direction * local_slope(time, position, window)
    return DrawnMotion(level.recording, time - time[0], s.direction * position, velocity, s.mean_speed_m_s)


MEAN = Look("orange", "--")


def in_time(motions: Sequence[DrawnMotion]) -> Figure:
    """Draw speed above position, a column for each motion."""
    above, below = [], []
    for m in motions:
        part = m.time_s <= SHOWN_S
        mean = Rule(y=m.mean_speed_m_s, label=f"mean {1e3 * m.mean_speed_m_s:.2f} mm/s", look=MEAN, width=1.0)
        above.append(Panel([Line(m.time_s[part], m.velocity_m_s[part], width=0.8), mean], m.title, y=FASTER))
        below.append(Panel([Line(m.time_s[part], m.position_m[part], width=1.0)], y="position / mm"))
    shared = {"share_x": "col", "share_y": "row", "legend": "panel", "text_scale": 0.9}
    return Figure([*above, *below], "time / s", columns=len(motions), row_in=1.7, rest_in=0.0, **shared)


FASTER = Axis("speed / (mm/s)", above=0.2)


def phase_plane(motions: Sequence[DrawnMotion]) -> Figure:
    """Draw speed against position less mean motion."""
    panels = []
    for m in motions:
        trend = np.polynomial.Polynomial.fit(m.time_s, m.position_m, 1)(m.time_s)
        mean = Rule(y=m.mean_speed_m_s, look=MEAN, width=1.0)
        panels.append(Panel([Line(m.position_m - trend, m.velocity_m_s, width=0.5), mean], m.title))
    shared = {"columns": len(motions), "share_y": "all", "row_in": 2.6, "rest_in": 0.0, "text_scale": 0.9}
    return Figure(panels, "position − mean motion / mm", "speed / (mm/s)", **shared)
