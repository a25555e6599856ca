"""Figures, tables and pages. Only this package draws. matplotlib is imported for the first figure."""

from __future__ import annotations

from pneudrive.lazy_names import lazily, upper

with lazily(__name__) as _HOMES:
    from pneudrive.report.campaign import write_campaign_report as write_campaign_report
    from pneudrive.report.circuit.svg import draw_circuit as draw_circuit
    from pneudrive.report.datasheet import plot_characteristic as plot_characteristic
    from pneudrive.report.platform import animate_platform as animate_platform
    from pneudrive.report.platform import draw_platform as draw_platform
    from pneudrive.report.recordings import plot_pressure as plot_pressure
    from pneudrive.report.recordings import write_layout_figure as write_layout_figure
    from pneudrive.report.recordings import write_report as write_report
    from pneudrive.report.trajectory import plot as plot
    from pneudrive.report.trajectory import plot_control as plot_control
    from pneudrive.report.trajectory import plot_lines as plot_lines
    from pneudrive.report.trajectory import plot_reference as plot_reference
    from pneudrive.report.trajectory import write_control_report as write_control_report

_STUDY = ("Reproduction", "reproduce")  # of the source paper, a layer above the report

__all__ = [*sorted(_HOMES), *_STUDY]  # noqa: PLE0604 # pyright: ignore[reportUnsupportedDunderAll]
_own = vars()["__getattr__"]


def __getattr__(name: str) -> object:
    return upper(name) if name in _STUDY else _own(name)
