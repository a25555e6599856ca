"""The datasheet of a drive as one HTML page, or as a PDF: two pages, and up to two more with recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive import __version__
from pneudrive.datasheet.registry import characteristics
from pneudrive.datasheet.sheet import written_value
from pneudrive.numbers import plain
from pneudrive.report import style
from pneudrive.report.axes import TINT
from pneudrive.report.circuit.drawing import draw_circuit
from pneudrive.report.datasheet.figures import panel
from pneudrive.report.page import Items, Paragraph, Report
from pneudrive.report.provenance import references
from pneudrive.report.topics import Topic
from pneudrive.report.typst_page import write_pdf
from pneudrive.simulation.trajectory import check_target, whole

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.datasheet.measured import MeasuredBeside
    from pneudrive.datasheet.sheet import Datasheet
    from pneudrive.report.page import Section

SUFFIXES = (".html", ".pdf")
CURVES = (
    *("velocity", "force-speed", "square-response", "impact", "natural-frequency", "stiffness"),
    *("bode", "flow", "exergy"),
)
COLUMNS, ROW_IN, BAR_PT = 3, 1.5, 4.4
#: Makes the drawing of the circuit, the first picture, smaller than the page.
SMALL_CIRCUIT = ("<svg ", '<svg style="max-width: 26rem; display: block" ')


@style.applied()
def write_datasheet(found: Datasheet, path: str | Path) -> Path:
    """Write a datasheet.

    Parameters
    ----------
    found : Datasheet
        From `pneudrive.datasheet.sheet.build`.
    path : path-like
        .html, which loads nothing from anywhere, or .pdf (extra ``pdf``).

    Returns
    -------
    pathlib.Path

    Raises
    ------
    CommandError
        Another suffix, a file that cannot be written, or a missing installation of typst.
    """
    target = check_target(path, SUFFIXES)
    report = Report(_title(found), found.headlines, _sections(found), synthetic=True)
    if target.suffix.lower() == ".pdf":
        report.pictures = report.plain_svg()
        return write_pdf(report, target)
    with whole(target) as temporary:
        temporary.write_text(report.alone().replace(*SMALL_CIRCUIT, 1), encoding="utf-8")
    return target


def _title(found: Datasheet) -> str:
    measured = found.measured
    if measured is None:
        return f"{found.drive.name}: datasheet, simulated"
    kind = "synthetic recordings" if measured.synthetic else "recordings"
    return f"{found.drive.name}: datasheet, simulated beside {kind}"


def _sections(found: Datasheet) -> list[Section | None]:
    drive, curves, values = (Topic("datasheet", key) for key in ("drive", "curves", "values"))
    bands = next(iter(found.results.values())).attrs.get("interval", "") if found.results else ""
    rows = ((value.key.removeprefix("components."), value.value, value.origin) for value in found.values)
    return [
        drive.section(drive.picture("circuit", draw_circuit(found.drive)), synthetic=False),
        _numbers(found),
        curves.section(curves.picture("curves", _curves(found), bands=bands)),
        _measured(found.measured) if found.measured is not None else None,
        values.section(values.table(rows), synthetic=False),
        _definitions(found),
    ]


def _numbers(found: Datasheet) -> Section:
    topic = Topic("datasheet", "numbers")
    return topic.section(
        topic.table(found.numbers),
        topic.text(version=__version__),
        topic.table(_published(found), "published") if "published" in found.results else None,
        *(Paragraph(f"{name}: {why}", "note") for name, why in found.failed.items() if name != "published"),
    )


def _published(found: Datasheet) -> Iterator[tuple[str, ...]]:
    """Yield the printed figures of the drive's parts, with those of the drive."""
    table = found.results["published"]
    columns = [100.0 * table.difference.to_numpy(), table.computed.to_numpy(), table.printed.to_numpy()]
    for name, more, computed, printed in zip(table["figure"].to_numpy(), *columns, strict=True):
        yield str(name), plain(printed), plain(computed), f"{more:+.2g} %"


def _curves(found: Datasheet) -> Figure:
    names = [name for name in CURVES if name in found.results]
    figure = style.new_figure(ROW_IN * -(-len(names) // COLUMNS))
    for axis, name in zip(style.panels(figure, len(names), COLUMNS), names, strict=True):
        panel(axis, found.results[name], title=name.replace("-", " "))
        axis.tick_params(labelsize=6.0)
        if axis.patches:  # one bar for each component
            axis.tick_params("y", labelsize=BAR_PT)
        axis.xaxis.label.set_fontsize(6.5)
        axis.yaxis.label.set_fontsize(6.5)
        legend = axis.get_legend()
        if legend is not None:
            for text in legend.get_texts():
                text.set_fontsize(5.5)
    return figure


def _measured(measured: MeasuredBeside) -> Section:
    topic, figure = Topic("datasheet", "measured"), _beside(measured)
    rows = (
        (
            number.stroke,
            number.name.replace("_", " "),
            written_value(number.measured, number.unit, number.low, number.high),
            str(number.repeats),
            written_value(number.simulated, number.unit),
            "agrees" if number.agrees else "differs",
        )
        for number in measured.numbers
    )
    return topic.section(
        Items(measured.names),
        *(Paragraph(text, "holds" if met else "note" if met is None else "fails") for met, text in measured.verdicts),
        topic.table(rows) if measured.numbers else None,
        None if figure is None else topic.picture("measured", figure),
        synthetic=measured.synthetic,
    )


def _beside(measured: MeasuredBeside) -> Figure | None:
    """Draw measurement and simulation together."""
    count = (2 if measured.validation is not None else 0) + bool(measured.responses) + (measured.friction is not None)
    if not count:
        return None
    figure = style.new_figure(2.2)
    axes = iter(style.panels(figure, count, count))
    if measured.validation is not None:
        _run(next(axes), measured, ("position_m",), 1e3, "position / mm")
        _run(next(axes), measured, ("pressure_a_pa", "pressure_b_pa"), 1e-5, "pressure / bar abs")
    if measured.responses:
        _response(next(axes), measured)
    if measured.friction is not None:
        _friction(next(axes), measured)
    return figure


def _run(axis: Axes, measured: MeasuredBeside, channels: tuple[str, ...], factor: float, label: str) -> None:
    record = measured.validation.records[0]  # type: ignore[union-attr]
    time = record.signals.time_s
    some = style.thin(time, 1500)
    for index, name in enumerate(channels):
        color = (style.BLACK, style.BLUE)[index]
        axis.plot(
            time[some],
            factor * getattr(record.signals, name)[some],
            color=color,
            lw=1.4,
            alpha=0.55,
            label=f"{name[:10].replace('_', ' ').strip()} measured",
        )
        axis.plot(time[some], factor * record.free[name][some], color=style.ORANGE, ls="--", lw=0.9)
    axis.set(xlabel="time / s", ylabel=label, title=record.recording.name)


def _response(axis: Axes, measured: MeasuredBeside) -> None:
    one = measured.responses[0]
    axis.plot(one.frequency_hz, one.measured_m_s, "o", color=style.BLACK, ms=2.5, label="measured")
    axis.plot(one.frequency_hz, one.simulated_m_s, "--", color=style.ORANGE, label="simulated")
    axis.set(
        xlabel="frequency / Hz",
        ylabel="velocity over command / (m/s)",
        title=f"coherence above {one.coherence.min():.2f}",
    )
    style.logarithmic(axis)
    axis.legend(fontsize=6.0)


def _friction(axis: Axes, measured: MeasuredBeside) -> None:
    curves = measured.friction.curves  # type: ignore[union-attr]
    shown = curves[:: max(len(curves) // 6, 1)][:6]
    for index, curve in enumerate(shown):
        look = style.ramp(index, len(shown))
        order = np.argsort(curve.speed_m_s)
        speed = 1e3 * curve.speed_m_s[order]
        axis.errorbar(
            speed,
            curve.friction_n[order],
            yerr=[
                np.maximum(curve.friction_n - curve.low_n, 0.0)[order],
                np.maximum(curve.high_n - curve.friction_n, 0.0)[order],
            ],
            fmt=look.marker,
            color=look.color,
            mfc="white",
            ms=3,
            elinewidth=0.7,
            label=curve.condition[:28],
        )
        axis.plot(speed, curve.model_n[order], ls="--", marker="_", ms=9, color=look.color, alpha=1.0 - TINT)
    axis.set(xlabel="speed / (mm/s)", ylabel="friction / N", title="friction: measured (points), law (dashed)")
    axis.legend(fontsize=5.5, ncols=2)


def _definitions(found: Datasheet) -> Section:
    known = characteristics()
    shown = [known[name] for name in found.results if name in known]
    keys = dict.fromkeys(key for one in shown for key in one.cites)
    return Topic("datasheet", "definitions").section(
        Items(tuple(f"assumed: {one}" for one in found.assumed)),
        Items(tuple(f"{one.title}: {one.definition} ({one.algorithm})" for one in shown)),
        Items(references(keys)),
        synthetic=False,
    )
