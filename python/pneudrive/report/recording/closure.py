"""Closure of the force balance: effective area and force zero from half the sum of both directions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.page import Paragraph
from pneudrive.report.topics import Topic
from pneudrive.report.words import MOST_SHOWN, sentence, spread_evenly

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from pneudrive.estimate.estimates import Estimate
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.pressure import ClosureFit
    from pneudrive.report.page import Section

MOST_GROUPS = 8
MOST_JOINED = 12  # points beyond which residuals are not joined by lines


def section(found: Characterisation) -> Section | None:
    """Return the section on half the sum of both directions' forces against pressure; None at one pressure."""
    if not found.closures:
        return None
    topic, shown = Topic("recordings", "closure"), spread_evenly(found.closures, MOST_GROUPS)
    text = topic.say("one_chamber" if _is_one_chamber(shown) else "both_chambers")
    text = topic.say("with_residuals", said=text) if _has_spare(shown) else text
    return topic.section(
        topic.text(),
        topic.picture("closure", draw(shown), said=text),
        topic.table(_rows(found.closures)),
        *(Paragraph(sentence(fit.statement)) for fit in found.closures[:MOST_SHOWN] if fit.degrees_of_freedom <= 0),
    )


def _is_one_chamber(closures: Sequence[ClosureFit]) -> bool:
    return all(len(fit.areas_m2) == 1 for fit in closures)


def _has_spare(closures: Sequence[ClosureFit]) -> bool:
    return any(fit.degrees_of_freedom > 0 for fit in closures)


def draw(closures: Sequence[ClosureFit]) -> Figure:
    """Draw all groups over pressure, or over the fit if both chambers' pressures changed. Residuals are drawn below.

    A line with as many parameters as points has no residuals. If all lines are of this kind, there is only one panel.
    """
    has_spare = _has_spare(closures)
    figure = style.new_figure(4.0 if has_spare else 2.8)
    panels = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1)) if has_spare else [figure.subplots()]
    above, below = panels[0], panels[-1]
    one_chamber = _is_one_chamber(closures)
    for index, fit in enumerate(sorted(closures, key=lambda fit: fit.group)):
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
        if fit.degrees_of_freedom > 0:
            below.plot(x, rest, linestyle=line, marker=look.marker, color=look.color, mfc="none", lw=0.8)
    if has_spare:
        below.axhline(0, color=style.GREY, lw=0.8)
        below.set_ylabel("residual / N")
    above.set_ylabel("half sum −\nnominal area × pressure / N" if one_chamber else "half sum of forces / N")
    below.set_xlabel("gauge pressure / bar" if one_chamber else "half sum as fitted / N")
    above.legend(ncols=2)
    figure.align_ylabels()
    return figure


def nominal_force(fit: ClosureFit) -> NDArray[np.float64]:
    """Return the pressure force on the nominal area of the one chamber whose pressure changed, +x, N."""
    side, area = next(iter(fit.nominal_m2.items()))
    return (-area if side == "a" else area) * fit.pressure_pa


def _rows(closures: Sequence[ClosureFit]) -> Iterator[tuple]:
    for fit in closures[:MOST_SHOWN]:
        for side, area in fit.areas_m2.items():
            nominal = fit.nominal_m2[side]
            off, low, high = (100 * (v / nominal - 1) for v in (area.value, area.low, area.high))
            between = f"{low:+.2f} … {high:+.2f}" if np.isfinite(area.low) else "no spare recording"
            zero = _interval(fit.force_zero_n)
            yield fit.group, side, nominal * 1e4, area.value * 1e4, off, between, zero, len(fit.recordings)


def _interval(estimate: Estimate) -> str:
    if not np.isfinite(estimate.low):
        return f"{estimate.value:+.2f}"
    return f"{estimate.value:+.2f} ({estimate.low:+.2f} … {estimate.high:+.2f})"
