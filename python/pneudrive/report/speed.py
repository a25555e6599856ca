"""Friction of recordings over speed, values that the data cannot determine, recovered truth, and the verdict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.figures import SPEED, Axis, Band, Figure, Line, Look, Markers, Panel, Rule, look, ramp
from pneudrive.friction.friction_map import ALL_RECORDINGS
from pneudrive.friction.pressure import CONFOUNDED, MINIMUM_RANGE_PA
from pneudrive.identify.static.model import unit_of
from pneudrive.numbers import fixed, with_u
from pneudrive.report.tables import by_seal, gauge_bar, plural, sentence, speed_mm_s, spread_evenly
from pneudrive.report.topics import Topic
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from pneudrive.estimate.estimates import Estimate
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.pressure import LevelPoint
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.report.fit import Fits, Study
    from pneudrive.report.page import Block, Section

MOST_LABELS = 40  # points labelled with their pressure
MOST_CURVES = 8
MANY = 60  # points beyond which markers get smaller
SAME_BAR, SAME_PRESSURE_PA = 0.05, 100.0
SHOWN_ERRORS = 4.0  # standard errors to either side
LINES = 5  # of the verdict
WIDEST_AREA = 0.3  # of the nominal area, from end to end of the interval


def section(found: Characterisation, fits: Fits) -> Section:
    """Return the section on friction over speed: fitted law, parameters, and undetermined values."""
    topic, speeds = Topic("recordings", "speed"), np.array([p.speed_m_s for p in found.points])
    has_curve = any("stribeck_velocity" in fit.determined for by_law in fits.values() for fit in by_law.values())
    texts = {
        "law": topic.say("with_law") if has_curve else "",
        "labels": topic.say("with_labels") if is_labelled(found) else "",
    }
    return topic.section(
        topic.text(points=plural(len(found.points), "point"), slow=speeds.min() * 1e3, fast=speeds.max() * 1e3),
        topic.picture("friction-speed", over_speed(found, fits), **texts),
        *(_fitted(topic, fits) if fits else [topic.text("no_law", "note")]),
    )


def _fitted(topic: Topic, fits: Fits) -> Iterator[Block]:
    yield topic.table(_parameters(fits))
    lost: dict[tuple[str, str, str], list[str]] = {}
    notes: dict[str, list[str]] = {}
    for group, by_law in fits.items():
        fit, names = richest(by_law), dict[tuple[str, str], list[str]]()
        for item in fit.undetermined:
            names.setdefault((item.reason, item.remedy), []).append(item.parameter.replace("_", " "))
        for (reason, remedy), own in names.items():
            lost.setdefault((", ".join(own), reason, remedy), []).append(group)
        for note in fit.notes:
            notes.setdefault(note, []).append(group)
    rows = [(", ".join(groups), *row) for row, groups in lost.items()]
    yield topic.table(rows, "lost") if rows else topic.text("determined")
    yield from topic.listed((sentence(f"{', '.join(groups)}: {note}") for note, groups in notes.items()), "notes")


def richest(by_law: Mapping[str, FrictionFit]) -> FrictionFit:
    """Return the fit of the law with the most parameters."""
    return by_law.get("stribeck") or next(iter(by_law.values()))


def _parameters(fits: Fits) -> Iterator[tuple[str, ...]]:
    """Yield group, law, name, estimate with U and statistical interval of each determined parameter."""
    for group, by_law in fits.items():
        alike: dict[tuple[str, ...], list[str]] = {}  # a law without its falling part is the smaller law
        for law, fit in by_law.items():
            alike.setdefault(fit.free, []).append(law)
        for laws in alike.values():
            fit = by_law[laws[0]]
            for name in (name for name in fit.free if name in fit.intervals):
                value = fit.parameters.get(name, fit.parameters.get(f"{name[:-1]}", float("nan")))
                size, unit = readable(unit_of(name))
                low, high = (bound / size for bound in fit.intervals[name])
                estimate = with_u(value / size, fit.expanded_uncertainty(name) / size, unit)
                interval = f"{low:.4g} … {high:.4g} {unit}".strip()
                yield group, ", ".join(laws), name.replace("_", " "), estimate, interval


@dataclass(frozen=True)
class PointGroup:
    """Points with one look: of one seal, or of one pair of chamber pressures (gauge, Pa)."""

    label: str
    points: tuple[LevelPoint, ...]
    seal: str
    gauges_pa: tuple[float, float] | None


def groups_of(found: Characterisation) -> list[PointGroup]:
    """Group points by seal, or by the pressures of both chambers if there is one seal."""
    seals = sorted({p.seal for p in found.points})  # the order, and so the colours, of all figures
    if len(seals) > 1:
        return [PointGroup(s, tuple(p for p in found.points if p.seal == s), s, None) for s in seals]
    gauges = _gauges(found)
    groups: dict[tuple[float, float], list[LevelPoint]] = {}
    for p in found.points:
        a, b = gauges[p.recording, p.friction_n]
        at = (SAME_BAR * round(a / 1e5 / SAME_BAR), SAME_BAR * round(b / 1e5 / SAME_BAR))
        groups.setdefault(at, []).append(p)
    out = []
    for at in sorted(groups):
        mean = np.mean([gauges[p.recording, p.friction_n] for p in groups[at]], axis=0)
        a, b = (abs(v) if abs(v) < SAME_BAR / 2 else v for v in at)
        words = f"{a:.2g} bar" if a == b else f"a {a:.2g} bar, b {b:.2g} bar"
        out.append(PointGroup(words, tuple(groups[at]), seals[0], (float(mean[0]), float(mean[1]))))
    return out


def _gauges(found: Characterisation) -> dict[tuple[str, float], tuple[float, float]]:
    """Return mean gauge pressures of both chambers by recording and friction, which the rows of a pair share."""
    curves, ambient = found.friction_map, found.recordings[0].ambient_pressure_pa
    rows: dict[tuple[str, float], list[tuple[float, float]]] = {}
    columns = [curves[name].to_numpy() for name in ("recording", "friction_n", "pressure_a_pa", "pressure_b_pa")]
    for name, friction, a, b in zip(*columns, strict=True):
        rows.setdefault((str(name), float(friction)), []).append((a - ambient, b - ambient))
    return {key: (float(np.mean(v, axis=0)[0]), float(np.mean(v, axis=0)[1])) for key, v in rows.items()}


def is_labelled(found: Characterisation) -> bool:
    """Return whether points are labelled with their pressure: several seals and pressures, and few points."""
    several = len({p.seal for p in found.points}) > 1
    spread = float(np.ptp([p.pressure_pa for p in found.points]))
    return several and len(found.points) <= MOST_LABELS and spread > MINIMUM_RANGE_PA


def over_speed(found: Characterisation, fits: Fits) -> Figure:
    """Draw all points over speed, a look for each seal or pressure, and the fitted law if it is determined."""
    groups, is_small = groups_of(found), len(found.points) > MANY
    shown, marks, is_named = spread_evenly(groups, MOST_CURVES), [], is_labelled(found)
    for group in (group for group in groups if group not in shown):
        x, y = np.array([(p.speed_m_s, p.friction_n) for p in group.points]).T
        marks.append(Markers(x, y, look=Look("grey", "-", "."), size=1.5))
    for index, group in enumerate(shown):
        x, y, reach = np.array([(p.speed_m_s, p.friction_n, np.nan_to_num(p.expanded_n)) for p in group.points]).T
        names = [f"{p.pressure_pa / 1e5:.2g}" for p in group.points] if is_named else ()
        given = {"size": 2.2 if is_small else 4.0, "filled": not index % 2, "names": names}
        marks.append(Markers(x, y, group.label, look(index), y - reach, y + reach, **given))
        marks += _law(group, fits.get(group.seal) or fits.get(ALL_RECORDINGS), look(index))
    y_axis = Axis("friction / N", low=0.0)
    return Figure([Panel(marks)], SPEED, y_axis, row_in=3.6, rest_in=0.0, entries=6)


def _law(group: PointGroup, by_law: Mapping[str, FrictionFit] | None, own: Look) -> list[Band | Line]:
    """Draw the fitted law at the group's pressures if the data determine how it depends on speed."""
    fit = (by_law or {}).get("stribeck")
    if fit is None or group.gauges_pa is None or "stribeck_velocity" not in fit.determined:
        return []
    speeds = np.array([p.speed_m_s for p in group.points])
    grid = np.geomspace(speeds.min(), speeds.max(), 200)
    law = fit.predict(grid, *group.gauges_pa)
    return [Band(grid, law.lower_n, law.upper_n), Line(grid, law.friction_n, look=own, width=0.9)]


# --- recovered truth -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Recovered:
    """Friction of simulated recordings and their ground truth; arrays of one length, SI."""

    speed_m_s: np.ndarray
    gauge_pa: np.ndarray
    friction_n: np.ndarray
    stderr_n: np.ndarray
    expanded_n: np.ndarray
    true_n: np.ndarray

    @property
    def inside(self) -> int:
        """Number of values within their U (k = 2)."""
        return int(np.sum(np.abs(self.friction_n - self.true_n) <= self.expanded_n))

    @property
    def within_statistics(self) -> int:
        """Number of values within two statistical standard errors."""
        return int(np.sum(np.abs(self.friction_n - self.true_n) <= 2 * np.nan_to_num(self.stderr_n)))


def recovered(found: Characterisation) -> Recovered | None:
    """Return friction with the ground truth of each simulated recording; None without one."""
    rows = []
    for result in found.results:
        truth = result.recording.truth
        if truth is None or "friction_n" not in truth or len(result.levels) != 1:
            continue
        level = result.levels[0]
        gauge = max(truth["pressure_a_pa"], truth["pressure_b_pa"]) - result.recording.ambient_pressure_pa
        values = (level.friction_n, level.stderr_n, level.expanded_n, truth["friction_n"])
        rows.append((truth["speed_m_s"], gauge, *values))
    return Recovered(*np.array(rows, dtype=float).T) if rows else None


def recovered_section(found: Characterisation, fits: Fits) -> Section | None:
    """Return the section on recovered friction and parameters; None without simulated recordings."""
    pairs = recovered(found)
    if pairs is None:
        return None
    topic, rows = Topic("recordings", "recovered"), list(_recovered_parameters(found, fits))
    ends = [f"{value:.2f}" for value in (pairs.expanded_n.min(), pairs.expanded_n.max())]
    counts = {"all": pairs.true_n.size, "inside": pairs.inside, "within": pairs.within_statistics}
    worst = 1e3 * float(np.max(np.abs(pairs.friction_n - pairs.true_n)))
    return topic.section(
        topic.text(**counts, reach=" to ".join(dict.fromkeys(ends)), worst=worst),
        topic.picture("recovered", errors(pairs)),
        topic.table(rows) if rows else None,
        synthetic=True,
    )


def _recovered_parameters(found: Characterisation, fits: Fits) -> Iterator[tuple[str, str, str, str, str]]:
    """Yield true and recovered value of each parameter of the fit that covers all recordings."""
    fit = next(iter(fits.values()), {}).get("stribeck") if fits else None
    truth = next((r.truth for r in found.recordings if r.truth), None)
    if fit is None or truth is None or truth["law"] != "stribeck":
        return
    known = dict(truth["parameters"]) | (truth["pressure"] or {})
    for name in fit.free:
        single = name.removesuffix("b") if name.endswith("_ab") else name
        if single not in known or name not in fit.intervals:
            continue
        size, unit = readable(unit_of(name))
        values = (fit.parameters[single], fit.expanded_uncertainty(name), known[single])
        value, expanded, true = (v / size for v in values)
        low, high = (bound / size for bound in fit.intervals[name])
        inside = "yes" if abs(value - true) <= expanded else "no"
        words = single.replace("_", " ") + (" and b" if name.endswith("_ab") else "")
        interval = f"{low:.4g} … {high:.4g} {unit}".strip()
        yield words, f"{true:.4g} {unit}".strip(), with_u(value, expanded, unit), interval, inside


def errors(pairs: Recovered) -> Figure:
    """Draw curves over speed, and errors with their statistical part."""
    left: list[Any] = []
    right: list[Any] = [Rule(y=(-2.0, 2.0), label="two standard errors", look=Look("band"))]
    gauges = np.unique(pairs.gauge_pa.round(-2))
    for index, gauge in enumerate(gauges[:8]):
        own = ramp(index, min(gauges.size, 8))
        chosen = np.flatnonzero(np.abs(pairs.gauge_pa - gauge) < SAME_PRESSURE_PA)
        chosen = chosen[np.argsort(pairs.speed_m_s[chosen])]
        speed, friction, true = (v[chosen] for v in (pairs.speed_m_s, pairs.friction_n, pairs.true_n))
        with np.errstate(divide="ignore", invalid="ignore"):
            error = (friction - true) / pairs.stderr_n[chosen]
        error = np.clip(error, -SHOWN_ERRORS, SHOWN_ERRORS)  # one further off is drawn on the frame
        left.append(Line(speed, true, look=own, width=0.9))
        left.append(Markers(speed, friction, f"{gauge / 1e5:.2g} bar gauge", own, size=3.2))
        right.append(Markers(speed, error, look=own, size=3.2))
    ends = Axis("error / standard error", low=-SHOWN_ERRORS, high=SHOWN_ERRORS)
    panels = [Panel(left, y="friction / N"), Panel([*right, Rule(y=0.0, look=Look("black"), width=0.8)], y=ends)]
    return Figure(panels, Axis("speed / (mm/s)", "log"), columns=2, row_in=3.0, rest_in=0.0)


# --- verdict ---------------------------------------------------------------------------------------------------------


def verdict(found: Characterisation | None, fits: Fits, study: Study | None = None) -> list[str]:
    """Return the lines of the verdict on recordings and of a study."""
    return lines_of(found, fits, () if study is None else study.addition(found).verdict)


def lines_of(found: Characterisation | None, fits: Fits, of_study: Iterable[str]) -> list[str]:
    """Return the lines on recordings, with U (k = 2), and after them those of a study."""
    topic, last = Topic("recordings", "verdict"), list(of_study)
    lines = []
    if found is not None:
        lines = [_friction(topic, found), _pressure(topic, found), _closure(topic, found), _open(topic, found, fits)]
        last = last or [_quality(topic, found)]
    return [*lines, *last][:LINES]


def _friction(topic: Topic, found: Characterisation) -> str:
    levels = sorted(found.levels, key=lambda level: level.friction_n)
    kind = "simulated recording" if found.synthetic else "recording"
    shown = [
        topic.say(
            "level",
            friction=with_u(level.friction_n, level.expanded_n),
            recording=level.recording,
            bar=fixed(gauge_bar(level), 1),
            speed=speed_mm_s(level),
        )
        for level in (levels if len(levels) == 1 else (levels[0], levels[-1]))
    ]
    counts = {"recordings": plural(len(found.results), kind), "seals": plural(len(by_seal(found)), "seal")}
    return topic.say("friction", **counts, shown=" to ".join(shown))


def _pressure(topic: Topic, found: Characterisation) -> str:
    lines, spread = found.pressure_lines, found.run_spread
    known = topic.say("no_runs") if not spread else topic.say("runs", percent=100 * spread.relative)
    relative = [level.expanded_n / level.friction_n for level in found.levels if level.friction_n > 0]
    if spread and relative and spread.relative > float(np.median(relative)):
        known = topic.say("runs_beyond_u", runs=known)
    if not lines:
        return topic.say("no_pressure", known=known)
    rise = f"{_range(sorted(1e5 * line.slope_n_pa for line in lines), '+.2f')} N/bar"
    confounded = sum(abs(line.speed_pressure_correlation) > CONFOUNDED for line in lines)
    tail = topic.say("confounded", some=confounded, all=len(lines)) if confounded else ""
    return topic.say("pressure", rise=rise, known=known, tail=tail)


def _range(values: list[float], form: str) -> str:
    """Return the ends of sorted values in words; one number where there is one value."""
    return " to ".join(f"{value:{form}}" for value in (values[:1] if len(values) == 1 else (values[0], values[-1])))


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
    text = topic.say("peaks", usable=usable, peaks=plural(len(peaks), "reversal peak")) if peaks else ""
    drifting = sum("trend" in level.flags for level in found.levels)
    return topic.say("quality", drifting=drifting, levels=plural(len(found.levels), "speed level"), peaks=text)
