"""Friction against speed, and parameters that the data cannot determine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.conditions import ALL_RECORDINGS
from pneudrive.friction.pressure import MINIMUM_RANGE_PA
from pneudrive.identify.base import shown_in
from pneudrive.identify.static.model import unit_of
from pneudrive.numbers import with_u
from pneudrive.report import axes as draw_axes
from pneudrive.report import style
from pneudrive.report.topics import Topic
from pneudrive.report.words import plural, sentence, spread_evenly

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.pressure import LevelPoint
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.report.page import Block, Section
    from pneudrive.report.study import Fits


MOST_LABELS = 40  # points labelled with their pressure
MOST_CURVES = 8
MANY = 60  # points beyond which markers get smaller
SAME_BAR = 0.05


def section(found: Characterisation, fits: Fits) -> Section:
    """Return the section on friction over speed: fitted law, parameters, and undetermined values."""
    topic, speeds = Topic("recordings", "speed"), np.array([p.speed_m_s for p in found.points])
    ends = {"slow": speeds.min() * 1e3, "fast": speeds.max() * 1e3}
    law = topic.say("with_law") if has_curve(fits) else ""
    labels = topic.say("with_labels") if is_labelled(found) else ""
    return topic.section(
        topic.text(points=plural(len(found.points), "point"), **ends),
        topic.picture("friction-speed", draw(found, fits), law=law, labels=labels),
        *(_fitted(topic, fits) if fits else [topic.text("no_law", "note")]),
    )


def _fitted(topic: Topic, fits: Fits) -> Iterator[Block]:
    yield topic.table(_rows(fits))
    lost = undetermined(fits)
    yield topic.table(lost, "lost") if lost else topic.text("determined")
    yield from topic.listed(fit_notes(fits), "notes")


def richest(by_law: Mapping[str, FrictionFit]) -> FrictionFit:
    """Return the fit of the law with the most parameters."""
    return by_law.get("stribeck") or next(iter(by_law.values()))


def undetermined(fits: Fits) -> tuple[tuple[str, str, str, str], ...]:
    """Return group, parameters, reason and remedy of values that the most detailed fit cannot determine."""
    rows: dict[tuple[str, str, str], list[str]] = {}
    for group, by_law in fits.items():
        lost: dict[tuple[str, str], list[str]] = {}
        for item in richest(by_law).undetermined:
            lost.setdefault((item.reason, item.remedy), []).append(item.parameter.replace("_", " "))
        for (reason, remedy), names in lost.items():
            rows.setdefault((", ".join(names), reason, remedy), []).append(group)
    return tuple((", ".join(groups), names, reason, remedy) for (names, reason, remedy), groups in rows.items())


def fit_notes(fits: Fits) -> tuple[str, ...]:
    """Return the notes of the most detailed fits, each with its groups."""
    notes: dict[str, list[str]] = {}
    for group, by_law in fits.items():
        for note in richest(by_law).notes:
            notes.setdefault(note, []).append(group)
    return tuple(sentence(f"{', '.join(groups)}: {note}") for note, groups in notes.items())


def _rows(fits: Fits) -> Iterator[tuple[str, ...]]:
    for group, by_law in fits.items():
        alike: dict[tuple[str, ...], list[str]] = {}  # a law without its falling part is the smaller law
        for law, fit in by_law.items():
            alike.setdefault(fit.free, []).append(law)
        for laws in alike.values():
            for cells in parameter_rows(by_law[laws[0]]):
                yield group, ", ".join(laws), *cells


def parameter_rows(fit: FrictionFit) -> list[tuple[str, str, str]]:
    """Return name, estimate with U and statistical interval of each determined parameter."""
    rows = []
    for name in fit.free:
        if name not in fit.intervals:
            continue
        value = fit.parameters.get(name, fit.parameters.get(f"{name[:-1]}", float("nan")))
        size, unit = shown_in(unit_of(name))
        low, high = (bound / size for bound in fit.intervals[name])
        shown = with_u(value / size, fit.expanded_uncertainty(name) / size, unit)
        rows.append((name.replace("_", " "), shown, f"{low:.4g} … {high:.4g} {unit}".strip()))
    return rows


@dataclass(frozen=True)
class Group:
    """Points with one look: of one seal, or of one pair of chamber pressures (gauge, Pa)."""

    label: str
    points: tuple[LevelPoint, ...]
    seal: str
    gauges_pa: tuple[float, float] | None


def groups_of(found: Characterisation) -> list[Group]:
    """Group points by seal, or by the pressures of both chambers if there is one seal."""
    seals = sorted({p.seal for p in found.points})  # the order, and so the colours, of all figures
    if len(seals) > 1:
        return [Group(s, tuple(p for p in found.points if p.seal == s), s, None) for s in seals]
    gauges = _gauges(found)
    groups: dict[tuple[float, float], list[LevelPoint]] = {}
    for p in found.points:
        a, b = gauges[p.recording, p.friction_n]
        at = (SAME_BAR * round(a / 1e5 / SAME_BAR), SAME_BAR * round(b / 1e5 / SAME_BAR))
        groups.setdefault(at, []).append(p)
    out = []
    for at in sorted(groups):
        mean = np.mean([gauges[p.recording, p.friction_n] for p in groups[at]], axis=0)
        out.append(Group(_words(at), tuple(groups[at]), seals[0], (float(mean[0]), float(mean[1]))))
    return out


def _gauges(found: Characterisation) -> dict[tuple[str, float], tuple[float, float]]:
    """Return mean gauge pressures of both chambers by recording and friction, which the rows of a pair share."""
    curves, ambient = found.friction_map, found.recordings[0].ambient_pressure_pa
    rows: dict[tuple[str, float], list[tuple[float, float]]] = {}
    columns = [curves[name].to_numpy() for name in ("recording", "friction_n", "pressure_a_pa", "pressure_b_pa")]
    for name, friction, a, b in zip(*columns, strict=True):
        rows.setdefault((str(name), float(friction)), []).append((a - ambient, b - ambient))
    return {key: (float(np.mean(v, axis=0)[0]), float(np.mean(v, axis=0)[1])) for key, v in rows.items()}


def _words(bar: tuple[float, float]) -> str:
    a, b = (abs(v) if abs(v) < SAME_BAR / 2 else v for v in bar)
    return f"{a:.2g} bar" if a == b else f"a {a:.2g} bar, b {b:.2g} bar"


def is_labelled(found: Characterisation) -> bool:
    """Return whether points are labelled with their pressure: several seals and pressures, and few points."""
    several = len({p.seal for p in found.points}) > 1
    spread = float(np.ptp([p.pressure_pa for p in found.points]))
    return several and len(found.points) <= MOST_LABELS and spread > MINIMUM_RANGE_PA


def has_curve(fits: Fits) -> bool:
    """Return whether any fit determines how friction falls with speed."""
    return any("stribeck_velocity" in fit.determined for by_law in fits.values() for fit in by_law.values())


def draw(found: Characterisation, fits: Fits) -> Figure:
    """Draw all points over speed, a look for each seal or pressure, and the fitted law if it is determined."""
    figure = style.new_figure(3.6)
    axis = figure.subplots()
    groups = groups_of(found)
    shown = spread_evenly(groups, MOST_CURVES)
    size = 2.2 if len(found.points) > MANY else 4.0
    for group in groups:
        if group not in shown:
            speeds = [p.speed_m_s * 1e3 for p in group.points]
            axis.plot(speeds, [p.friction_n for p in group.points], ".", color=style.GREY, ms=1.5)
    for index, group in enumerate(shown):
        look = style.look(index)
        speed, friction, reach = np.array([(p.speed_m_s * 1e3, p.friction_n, p.expanded_n) for p in group.points]).T
        small = {"ms": size, "elinewidth": 0.7, "capsize": size / 2, "mfc": "white" if index % 2 else look.color}
        draw_axes.bars(axis, speed, friction, np.nan_to_num(reach), look, **small, label=group.label)
        _curve(axis, look, group, fits.get(group.seal) or fits.get(ALL_RECORDINGS))
    if is_labelled(found):
        for p in found.points:
            place = (p.speed_m_s * 1e3, p.friction_n)
            axis.annotate(f"{p.pressure_pa / 1e5:.2g}", place, (3.5, 2.5), textcoords="offset points", fontsize=5.5)
    draw_axes.speed_axis(axis, [p.speed_m_s * 1e3 for p in found.points])
    axis.set_ylim(bottom=0)
    axis.set_ylabel("friction / N")
    style.legend_above(figure, axis.get_legend_handles_labels()[0], columns=min(len(shown), 6))
    return figure


def _curve(axis: Axes, look: style.Look, group: Group, by_law: Mapping[str, FrictionFit] | None) -> None:
    """Draw the fitted law at the group's pressures if the data determine how it depends on speed."""
    fit = (by_law or {}).get("stribeck")
    if fit is None or group.gauges_pa is None or "stribeck_velocity" not in fit.determined:
        return
    speeds = np.array([p.speed_m_s for p in group.points])
    grid = np.geomspace(speeds.min(), speeds.max(), 200)
    law = fit.predict(grid, *group.gauges_pa)
    draw_axes.tinted(axis, grid * 1e3, (law.lower_n, law.upper_n))
    axis.plot(grid * 1e3, law.friction_n, linestyle=look.linestyle, color=look.color, lw=0.9)
