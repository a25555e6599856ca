"""Closure of the force balance: effective area and force zero from half the sum of both directions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.page import Picture, Section, Table, Text
from pneudrive.report.words import MOST_SHOWN, sentence, spread_evenly

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from pneudrive.characterise import Characterisation
    from pneudrive.characterise.closure import ClosureFit, Estimate


def section(found: Characterisation) -> Section | None:
    """Half the sum of both directions' forces against pressure; None where no pressure was changed."""
    if not found.closures:
        return None
    blocks: list = [
        Text(
            "Friction drops out of half the sum of both directions' forces. What is left should be pressure times "
            "area: the slope gives the effective area, the intercept the force zero. A wrong bore, a wrong pressure "
            "gain and a wrong force gain look alike here; none of them touches friction, which is the half "
            "difference."
        ),
        Picture(
            "closure",
            "Above: half the sum of both directions' forces, less what pressure needs on the nominal area, with the "
            "fitted line: its slope is the error of the area, its intercept the force zero. Below: what the line "
            "leaves.",
            draw(spread_evenly(found.closures, 8)),
            synthetic=found.synthetic,
        ),
        _table(found.closures),
    ]
    blocks += [Text(sentence(fit.statement)) for fit in found.closures[:MOST_SHOWN] if fit.degrees_of_freedom <= 0]
    return Section("closure", "Closure of the force balance", tuple(blocks), synthetic=found.synthetic)


def draw(closures: list[ClosureFit]) -> Figure:
    """All groups in one pair of panels."""
    figure = style.new_figure(4.0)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    less_nominal = all(len(fit.areas_m2) == 1 for fit in closures)
    for index, fit in enumerate(closures):
        look = style.look(index)
        order = np.argsort(fit.pressure_pa)
        bar = fit.pressure_pa[order] / 1e5
        force, rest = fit.half_sum_force_n[order], fit.residual_n[order]
        if less_nominal:
            force = force - nominal_force(fit)[order]
        above.plot(bar, force, look.marker, color=look.color, mfc="none", label=fit.group)
        above.plot(bar, force - rest, linestyle=look.linestyle, color=look.color, lw=0.8)
        below.plot(bar, rest, linestyle=look.linestyle, marker=look.marker, color=look.color, mfc="none", lw=0.8)
    below.axhline(0, color=style.GREY, lw=0.8)
    above.set_ylabel("half sum −\nnominal area × pressure / N" if less_nominal else "half sum of forces / N")
    below.set_ylabel("residual / N")
    below.set_xlabel("gauge pressure / bar")
    above.legend(ncols=2)
    figure.align_ylabels()
    return figure


def nominal_force(fit: ClosureFit) -> NDArray[np.float64]:
    """Force that pressure would need on the nominal area of the one chamber whose pressure changed, +x, N."""
    side, area = next(iter(fit.nominal_m2.items()))
    return (-area if side == "a" else area) * fit.pressure_pa


def _table(closures: tuple[ClosureFit, ...]) -> Table:
    rows = []
    for fit in closures[:MOST_SHOWN]:
        for side, area in fit.areas_m2.items():
            nominal = fit.nominal_m2[side]
            off = [100 * (v / nominal - 1) for v in (area.value, area.low, area.high)]
            between = f"{off[1]:+.2f} … {off[2]:+.2f}" if np.isfinite(area.low) else "no spare recording"
            cells = (f"{nominal * 1e4:.4g}", f"{area.value * 1e4:.4g}", f"{off[0]:+.2f}", between)
            rows.append((fit.group, side, *cells, _interval(fit.force_zero_n), str(len(fit.recordings))))
    head = (
        "group",
        "chamber",
        "nominal, cm²",
        "effective, cm²",
        "difference, %",
        "95 %",
        "force zero, N (95 %)",
        "points",
    )
    return Table(head, tuple(rows), "Effective area and force zero", numbers_from=2)


def _interval(estimate: Estimate) -> str:
    if not np.isfinite(estimate.low):
        return f"{estimate.value:+.2f}"
    return f"{estimate.value:+.2f} ({estimate.low:+.2f} … {estimate.high:+.2f})"
