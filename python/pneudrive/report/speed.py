"""Friction against speed, and what the data cannot determine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.numbers import with_u
from pneudrive.report.speed_figure import draw, has_curve, is_labelled
from pneudrive.report.topics import Topic
from pneudrive.report.words import plural, sentence

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pneudrive.characterise.characterisation import Characterisation
    from pneudrive.identify.result import FrictionFit
    from pneudrive.report.page import Block, Section
    from pneudrive.report.study import Fits

#: Parameter -> factor from SI and unit in which people read it.
SHOWN_UNITS = {
    "coulomb": (1.0, "N"),
    "breakaway": (1.0, "N"),
    "stribeck_velocity": (1e3, "mm/s"),
    "stribeck_exponent": (1.0, ""),
    "viscous": (1.0, "N s/m"),
}


def section(found: Characterisation, fits: Fits) -> Section:
    """Friction over speed with the fitted law, the fitted parameters, and statements of what is not determined."""
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
    """List group, parameters, reason and remedy of what the richest fit of each group cannot determine."""
    rows: dict[tuple[str, str, str], list[str]] = {}
    for group, by_law in fits.items():
        lost: dict[tuple[str, str], list[str]] = {}
        for item in richest(by_law).undetermined:
            lost.setdefault((item.reason, item.remedy), []).append(item.parameter.replace("_", " "))
        for (reason, remedy), names in lost.items():
            rows.setdefault((", ".join(names), reason, remedy), []).append(group)
    return tuple((", ".join(groups), names, reason, remedy) for (names, reason, remedy), groups in rows.items())


def fit_notes(fits: Fits) -> tuple[str, ...]:
    """Give the notes of the richest fits, each with the groups that it is about."""
    notes: dict[str, list[str]] = {}
    for group, by_law in fits.items():
        for note in richest(by_law).notes:
            notes.setdefault(note, []).append(group)
    return tuple(sentence(f"{', '.join(groups)}: {note}") for note, groups in notes.items())


def _rows(fits: Fits) -> Iterator[tuple[str, ...]]:
    for group, by_law in fits.items():
        alike: dict[tuple[str, ...], list[str]] = {}  # a law that lost its falling part is the smaller law
        for law, fit in by_law.items():
            alike.setdefault(fit.free, []).append(law)
        for laws in alike.values():
            for cells in parameter_rows(by_law[laws[0]]):
                yield group, ", ".join(laws), *cells


def parameter_rows(fit: FrictionFit) -> list[tuple[str, str, str]]:
    """Name, estimate with U and statistical interval of each parameter that the data determine."""
    rows = []
    for name in fit.free:
        if name not in fit.intervals:
            continue
        value = fit.parameters.get(name, fit.parameters.get(f"{name[:-1]}", float("nan")))
        factor, unit = SHOWN_UNITS.get(name, (1e5, "N/bar"))
        low, high = (factor * bound for bound in fit.intervals[name])
        shown = with_u(factor * value, factor * fit.expanded_uncertainty(name), unit)
        rows.append((name.replace("_", " "), shown, f"{low:.4g} … {high:.4g} {unit}".strip()))
    return rows
