"""Friction against speed, and what the data cannot determine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.page import Items, Picture, Section, Table, Text
from pneudrive.report.words import plural, sentence, spread_evenly, with_u

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.characterise import Characterisation
    from pneudrive.characterise.pressure_line import FrictionPoint
    from pneudrive.identify import FrictionFit

    Fits = Mapping[str, Mapping[str, FrictionFit]]

ALL = "all recordings"
#: Parameter -> factor from SI and unit in which people read it.
SHOWN_UNITS = {
    "coulomb": (1.0, "N"),
    "breakaway": (1.0, "N"),
    "stribeck_velocity": (1e3, "mm/s"),
    "stribeck_exponent": (1.0, ""),
    "viscous": (1.0, "N s/m"),
}
WIDE = 3.0  # ratio of speeds beyond which speed has a logarithmic axis


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
            "Friction against speed with U (k = 2)" + (" and the fitted laws" if _has_curve(found, fits) else "") + ".",
            draw(found, fits),
            synthetic=found.synthetic,
        ),
    ]
    if fits:
        blocks.append(_table(fits))
        blocks.append(Text("What these data cannot determine:"))
        blocks.append(Items(undetermined(fits) or ("Nothing: every parameter has a closed interval.",)))
        notes = tuple(dict.fromkeys(sentence(n) for by_law in fits.values() for f in by_law.values() for n in f.notes))
        blocks += [Text("Notes of the fits:"), Items(notes)] if notes else []
    else:
        blocks.append(Text("No law could be fitted: there are fewer values than a law has parameters.", "note"))
    return Section("speed", "Friction against speed, and what cannot be determined", tuple(blocks), found.synthetic)


def undetermined(fits: Fits, law: str = "stribeck") -> tuple[str, ...]:
    """Statements of the richest fit of each group, those that groups share said once."""
    said: dict[str, list[str]] = {}
    for group, by_law in fits.items():
        fit = by_law.get(law) or next(iter(by_law.values()))
        for statement in fit.statements():
            said.setdefault(statement, []).append(group)
    return tuple(f"{', '.join(groups)}: {statement}" for statement, groups in said.items())


def _has_curve(found: Characterisation, fits: Fits) -> bool:
    return any("stribeck_velocity" in f.determined for by_law in fits.values() for f in by_law.values())


def draw(found: Characterisation, fits: Fits) -> Figure:
    """All points over speed, a look for each seal."""
    figure = style.new_figure(3.4)
    axis = figure.subplots()
    seals = list(dict.fromkeys(p.seal for p in found.points))
    for index, seal in enumerate(seals):
        look = style.look(index)
        points = [p for p in found.points if p.seal == seal]
        axis.errorbar(
            [p.speed_m_s * 1e3 for p in points],
            [p.friction_n for p in points],
            yerr=[np.nan_to_num(p.expanded_n) for p in points],
            fmt=look.marker,
            color=look.color,
            mfc="white" if index % 2 else look.color,
            elinewidth=0.7,
            label=seal,
        )
    speeds = np.array([p.speed_m_s for p in found.points])
    if speeds.max() > WIDE * speeds.min():
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    for index, seal in enumerate(seals):
        _curves(axis, index, [p for p in found.points if p.seal == seal], fits.get(seal) or fits.get(ALL), found)
    axis.set_ylim(bottom=0)
    axis.set_xlabel("speed / (mm/s)")
    axis.set_ylabel("friction / N")
    axis.legend(ncols=3)
    return figure


def _curves(
    axis: Axes, index: int, points: list[FrictionPoint], fits: Mapping[str, FrictionFit] | None, found: Characterisation
) -> None:
    """The fitted law at each pressure, where the data determine how it depends on speed."""
    fit = (fits or {}).get("stribeck")
    if fit is None or "stribeck_velocity" not in fit.determined:
        return
    speeds = np.array([p.speed_m_s for p in points])
    grid = np.geomspace(speeds.min(), speeds.max(), 200)
    pressures = sorted({round(p.pressure_pa, -4) for p in points})
    sides = _pressurised(found)
    for pressure in spread_evenly(pressures, 4):
        gauges = [pressure if side in sides else 0.0 for side in ("a", "b")]
        predicted = fit.predict(grid, *gauges)
        axis.fill_between(grid * 1e3, predicted.lower_n, predicted.upper_n, color=style.BAND, lw=0)
        axis.plot(grid * 1e3, predicted.friction_n, linestyle=style.look(index).linestyle, color=style.look(index).color)


def _pressurised(found: Characterisation) -> set[str]:
    """Sides whose pressure follows the one that a point carries."""
    curves = found.friction_map
    ambient = found.recordings[0].ambient_pressure_pa
    return {s for s in ("a", "b") if float(np.abs(curves[f"pressure_{s}_pa"].to_numpy() - ambient).max()) > 2e4}


def _table(fits: Fits) -> Table:
    rows = []
    for group, by_law in fits.items():
        for law, fit in by_law.items():
            rows += [(group, law, *cells) for cells in parameter_rows(fit)]
    head = ("group", "law", "parameter", "estimate, U (k = 2)", "95 % interval, statistical")
    return Table(head, tuple(rows), "Fitted parameters; what is absent is not determined by these data", numbers_from=3)


def parameter_rows(fit: FrictionFit) -> list[tuple[str, str, str]]:
    """Name, estimate with U and statistical interval of each parameter that the data determine."""
    rows = []
    for name in fit.free:
        if name not in fit.determined and not name.endswith("_ab"):
            continue
        value = fit.parameters.get(name, fit.parameters.get(f"{name[:-1]}", float("nan")))
        factor, unit = SHOWN_UNITS.get(name, (1e5, "N/bar"))
        low, high = (factor * bound for bound in fit.intervals[name])
        shown = with_u(factor * value, factor * fit.expanded_uncertainty(name), unit)
        rows.append((name.replace("_", " "), shown, f"{low:.4g} … {high:.4g} {unit}".strip()))
    return rows
