"""Figures, tables and pages: the only part that draws. Matplotlib is imported when the first figure is drawn."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pneudrive.report.campaign import write_campaign_report as write_campaign_report
    from pneudrive.report.circuit_drawing import draw_circuit as draw_circuit
    from pneudrive.report.layout_figure import write_layout_figure as write_layout_figure
    from pneudrive.report.lines_figure import plot_lines as plot_lines
    from pneudrive.report.pressure import plot_pressure as plot_pressure
    from pneudrive.report.trajectory import plot as plot
    from pneudrive.report.write import write_report as write_report
    from pneudrive.studies.bracha.reproduction import Reproduction as Reproduction
    from pneudrive.studies.bracha.reproduction import reproduce as reproduce

_HOME = {
    "plot": "trajectory",
    "draw_circuit": "circuit_drawing",
    "plot_lines": "lines_figure",
    "plot_pressure": "pressure",
    "write_report": "write",
    "write_layout_figure": "layout_figure",
    "write_campaign_report": "campaign",
}
__all__ = [
    "Reproduction",
    "draw_circuit",
    "plot",
    "plot_lines",
    "plot_pressure",
    "reproduce",
    "write_campaign_report",
    "write_layout_figure",
    "write_report",
]


def __getattr__(name: str) -> object:
    if name in ("Reproduction", "reproduce"):  # a study stands above the report that it adds to
        return getattr(import_module("pneudrive.studies.bracha.reproduction"), name)
    if name in _HOME:
        return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    msg = f"module 'pneudrive.report' has no attribute '{name}'"
    raise AttributeError(msg)
