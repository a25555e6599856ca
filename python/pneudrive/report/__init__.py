"""Figures, tables and pages: the only part that draws. The first figure imports matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.lazy_names import lazy, upper

if TYPE_CHECKING:
    from pneudrive.report.campaign import write_campaign_report as write_campaign_report
    from pneudrive.report.circuit.svg import draw_circuit as draw_circuit
    from pneudrive.report.control import plot_control as plot_control
    from pneudrive.report.control import plot_reference as plot_reference
    from pneudrive.report.control import write_control_report as write_control_report
    from pneudrive.report.datasheet import plot_characteristic as plot_characteristic
    from pneudrive.report.layout_figure import write_layout_figure as write_layout_figure
    from pneudrive.report.platform.page import animate_platform as animate_platform
    from pneudrive.report.platform.page import draw_platform as draw_platform
    from pneudrive.report.recordings import plot_pressure as plot_pressure
    from pneudrive.report.recordings import write_report as write_report
    from pneudrive.report.trajectory import plot as plot
    from pneudrive.report.trajectory import plot_lines as plot_lines
#: Module -> its names.
_HOMES = {
    "campaign": ["write_campaign_report"],
    "circuit.svg": ["draw_circuit"],
    "control": ["plot_control", "plot_reference", "write_control_report"],
    "datasheet": ["plot_characteristic"],
    "layout_figure": ["write_layout_figure"],
    "platform.page": ["animate_platform", "draw_platform"],
    "trajectory": ["plot", "plot_lines"],
    "recordings": ["plot_pressure", "write_report"],
}
_STUDY = ("Reproduction", "reproduce")  # of the source paper, a layer above the report

__all__ = [
    "Reproduction",  # pyright: ignore[reportUnsupportedDunderAll]
    "animate_platform",
    "draw_circuit",
    "draw_platform",
    "plot",
    "plot_characteristic",
    "plot_control",
    "plot_lines",
    "plot_pressure",
    "plot_reference",
    "reproduce",  # pyright: ignore[reportUnsupportedDunderAll]
    "write_campaign_report",
    "write_control_report",
    "write_layout_figure",
    "write_report",
]


_own = lazy(__name__, _HOMES)


def __getattr__(name: str) -> object:
    if name in _STUDY:
        return upper(name)
    return _own(name)
