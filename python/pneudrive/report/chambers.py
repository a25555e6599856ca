"""The printed chamber equations against the energy balance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.paper.chamber_laws import AS_PRINTED, ENERGY_BALANCE
from pneudrive.report import style
from pneudrive.report.page import Picture, Section, Table, Text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.paper.chamber_laws import ChamberComparison

LINES = {ENERGY_BALANCE: ("-", style.BLACK, "energy balance"), AS_PRINTED: ("--", style.ORANGE, "as printed")}


def section(compared: ChamberComparison) -> Section:
    """Say what equations (2) and (3) of the paper cost, in numbers and over time."""
    residual = compared.energy_residual_j[AS_PRINTED]
    blocks = (
        Text(
            "Equations (2) and (3) as printed subtract the stored heat twice: a closed chamber without heat follows "
            "p V^1.2 instead of p V^1.4, half of the exchanged heat counts, and energy is not conserved. The "
            "printed area term adds an area to a volume. Below, one stroke out and back at full opening, with the "
            "same assumed drive."
        ),
        _table(compared),
        Picture(
            "chamber-laws",
            "One stroke out and back with both chamber laws: position and its difference (as printed less balance), "
            "pressure and gas temperature.",
            draw(compared),
            synthetic=True,
        ),
        Text(
            "The stroke times nearly agree, which is why a comparison of positions does not reveal the error; "
            f"{residual:.1f} J of {compared.stroke_work_j:.0f} J of stroke work come from nowhere. The printed law "
            "is there to reproduce the paper only; everything else uses the energy balance.",
            "note",
        ),
    )
    return Section("chambers", "Printed chamber equations against the energy balance", blocks, synthetic=True)


def _table(compared: ChamberComparison) -> Table:
    def gas(law: str, side: str) -> str:
        t = compared.runs[law][f"temperature_{side}"]
        return f"{float(t.min()):.0f} … {float(t.max()):.0f}"

    laws = (ENERGY_BALANCE, AS_PRINTED)
    rows = (
        ("time of the stroke out, s", *(f"{compared.stroke_time_s[law]:.4f}" for law in laws)),
        ("gas in chamber a, K", *(gas(law, "a") for law in laws)),
        ("gas in chamber b, K", *(gas(law, "b") for law in laws)),
        ("energy of chamber a from nowhere, J", *(f"{compared.energy_residual_j[law]:.1f}" for law in laws)),
        ("largest difference of position, mm", "–", f"{1e3 * compared.largest_difference('position'):.1f}"),
        ("largest difference of pressure a, bar", "–", f"{1e-5 * compared.largest_difference('pressure_a'):.2f}"),
        ("largest difference of temperature b, K", "–", f"{compared.largest_difference('temperature_b'):.0f}"),
    )
    return Table(("", "energy balance", "as printed"), rows)


def draw(compared: ChamberComparison) -> Figure:
    """Position and its difference, pressures and temperatures over time."""
    figure = style.new_figure(4.4)
    axes = figure.subplots(3, 2, sharex=True)
    balanced, printed = (compared.runs[law] for law in (ENERGY_BALANCE, AS_PRINTED))
    part = style.thin(balanced.time)
    time = balanced.time[part]
    shown = (("pressure", 1e-5, "pressure {} / bar abs"), ("temperature", 1.0, "gas temperature {} / K"))
    for law, (line, color, words) in LINES.items():
        run = compared.runs[law]
        axes[0, 0].plot(time, 1e3 * run.position[part], line, color=color, label=words)
        for row, (name, factor, label) in zip(axes[1:], shown, strict=True):
            for axis, side in zip(row, "ab", strict=True):
                axis.plot(time, factor * run[f"{name}_{side}"][part], line, color=color)
                axis.set_ylabel(label.format(side))
    axes[0, 0].set_ylabel("position / mm")
    axes[0, 0].legend(loc="lower center")
    axes[0, 1].plot(time, 1e3 * (printed.position - balanced.position)[part], color=style.BLACK)
    axes[0, 1].set_ylabel("difference of position / mm")
    for axis in axes[-1]:
        axis.set_xlabel("time / s")
    figure.align_ylabels()
    return figure
