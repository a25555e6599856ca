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

MOST_GROUPS = 8
MOST_JOINED = 12  # points beyond which residuals are not joined by lines


def section(found: Characterisation) -> Section | None:
    """Half the sum of both directions' forces against pressure; None where no pressure was changed."""
    if not found.closures:
        return None
    shown = spread_evenly(found.closures, MOST_GROUPS)
    blocks: list = [
        Text(
            "Friction drops out of half the sum of both directions' forces. What is left should be pressure times "
            "area: the slope gives the effective area, the intercept the force zero. A wrong bore, a wrong pressure "
            "gain and a wrong force gain look alike here; none of them touches friction, which is the half "
            "difference."
        ),
        Picture(
            "closure",
            caption(shown),
            draw(shown),
            synthetic=found.synthetic,
        ),
        _table(found.closures),
    ]
    blocks += [Text(sentence(fit.statement)) for fit in found.closures[:MOST_SHOWN] if fit.degrees_of_freedom <= 0]
    return Section("closure", "Closure of the force balance", tuple(blocks), synthetic=found.synthetic)


def draw(closures: list[ClosureFit]) -> Figure:
    """All groups in one pair of panels: against pressure, or against the fit where both chambers' pressures changed."""
    figure = style.new_figure(4.0)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    one_chamber = all(len(fit.areas_m2) == 1 for fit in closures)
    for index, fit in enumerate(closures):
        look = style.look(index)
        force, rest = fit.half_sum_force_n, fit.residual_n
        x = fit.pressure_pa / 1e5 if one_chamber else force - rest
        if one_chamber:
            force = force - nominal_force(fit)
        order = np.argsort(x, kind="stable")
        x, force, rest = x[order], force[order], rest[order]
        line = look.linestyle if x.size <= MOST_JOINED else "none"
        above.plot(x, force, look.marker, color=look.color, mfc="none", label=fit.group)
        above.plot(x, force - rest, linestyle=look.linestyle, color=look.color, lw=0.8)
        below.plot(x, rest, linestyle=line, marker=look.marker, color=look.color, mfc="none", lw=0.8)
    below.axhline(0, color=style.GREY, lw=0.8)
    above.set_ylabel("half sum −\nnominal area × pressure / N" if one_chamber else "half sum of forces / N")
    below.set_ylabel("residual / N")
    below.set_xlabel("gauge pressure / bar" if one_chamber else "half sum as fitted / N")
    above.legend(ncols=2)
    figure.align_ylabels()
    return figure


def caption(closures: list[ClosureFit]) -> str:
    """Say what the figure shows."""
    if all(len(fit.areas_m2) == 1 for fit in closures):
        return (
            "Above: half the sum of both directions' forces, less what pressure needs on the nominal area, with the "
            "fitted line: its slope is the error of the area, its intercept the force zero. Below: what is left."
        )
    return "Above: half the sum of both directions' forces against the fit. Below: what the fit leaves."


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
