"""Friction against speed, and what the data cannot determine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.numbers import with_u
from pneudrive.report.page import Items, Picture, Section, Table, Text
from pneudrive.report.speed_figure import caption, draw
from pneudrive.report.words import plural, sentence

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.characterise import Characterisation
    from pneudrive.identify import FrictionFit

    Fits = Mapping[str, Mapping[str, FrictionFit]]

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
    speeds = np.array([p.speed_m_s for p in found.points])
    blocks: list = [
        Text(
            f"{plural(len(found.points), 'point')} from {speeds.min() * 1e3:.3g} to {speeds.max() * 1e3:.3g} mm/s. "
            "Each is a mean of sliding friction over the window, both directions paired."
        ),
        Picture(
            "friction-speed",
            caption(found, fits),
            draw(found, fits),
            synthetic=found.synthetic,
        ),
    ]
    if fits:
        blocks.append(_table(fits))
        lost = undetermined(fits)
        if lost:
            head = ("group", "cannot be determined", "because", "measure")
            blocks.append(Table(head, lost, "What these data cannot determine", numbers_from=9))
        else:
            blocks.append(Text("Every parameter is determined: each has a closed interval."))
        notes = fit_notes(fits)
        blocks += [Text("Notes of the fits:"), Items(notes)] if notes else []
    else:
        blocks.append(Text("No law could be fitted: there are fewer values than a law has parameters.", "note"))
    return Section("speed", "Friction against speed, and what cannot be determined", tuple(blocks), found.synthetic)


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


def _table(fits: Fits) -> Table:
    rows = []
    for group, by_law in fits.items():
        alike: dict[tuple[str, ...], list[str]] = {}  # a law that lost its falling part is the smaller law
        for law, fit in by_law.items():
            alike.setdefault(fit.free, []).append(law)
        for laws in alike.values():
            rows += [(group, ", ".join(laws), *cells) for cells in parameter_rows(by_law[laws[0]])]
    head = ("group", "law", "parameter", "estimate, U (k = 2)", "95 % interval, statistical")
    return Table(head, tuple(rows), "Fitted parameters; what is absent is not determined by these data", numbers_from=3)


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
