"""The datasheet of a drive as one HTML page, or as a PDF: two pages, and up to two more with recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive import __version__
from pneudrive.datasheet.registry import characteristics
from pneudrive.datasheet.words import written_value
from pneudrive.numbers import plain
from pneudrive.report import style
from pneudrive.report.axes import TINT
from pneudrive.report.circuit.drawing import draw_circuit
from pneudrive.report.datasheet.figures import panel
from pneudrive.report.page import Items, PageTable, Paragraph, Picture, Report, inline, section, svg_text
from pneudrive.report.provenance import reference
from pneudrive.report.typst_page import write_pdf
from pneudrive.simulation.trajectory import check_target, whole

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.datasheet.measured import MeasuredBeside
    from pneudrive.datasheet.sheet import Datasheet
    from pneudrive.report.page import Block, Section

SUFFIXES = (".html", ".pdf")
CURVES = (
    *("velocity", "force-speed", "square-response", "impact", "natural-frequency", "stiffness"),
    *("bode", "flow", "exergy"),
)
COLUMNS, ROW_IN, BAR_PT = 3, 1.5, 4.4
SIMULATED = (
    "All numbers and curves of this page are simulated from the values below, with the equations of pneudrive "
    f"{__version__}; comparisons with recordings are marked. Pressures are absolute unless called gauge; "
    "litres ANR are at 100 kPa, 20 °C and 65 % humidity."
)


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
    for part in report.sections:
        for block in part.blocks if part is not None else ():
            if isinstance(block, Picture):
                if block.name != "circuit":
                    style.finish(block.figure, synthetic=bool(block.synthetic))
                report.pictures[block.name] = svg_text(block.figure)
    if target.suffix.lower() == ".pdf":
        return write_pdf(report, target)
    pictures = {
        block.name: block.caption
        for part in report.sections
        if part
        for block in part.blocks
        if isinstance(block, Picture)
    }
    small = '<svg style="max-width: 26rem; display: block" '
    report.pictures["circuit"] = report.pictures["circuit"].replace("<svg ", small, 1)
    report.pictures = {name: inline(svg, name, pictures[name]) for name, svg in report.pictures.items()}
    with whole(target) as temporary:
        temporary.write_text(report.html(linked=False), encoding="utf-8")
    return target


def _title(found: Datasheet) -> str:
    measured = found.measured
    if measured is None:
        return f"{found.drive.name}: datasheet, simulated"
    kind = "synthetic recordings" if measured.synthetic else "recordings"
    return f"{found.drive.name}: datasheet, simulated beside {kind}"


def _sections(found: Datasheet) -> list[Section | None]:
    return [
        section(
            "drive", "Circuit", Picture("circuit", "Circuit of the drive.", draw_circuit(found.drive)), synthetic=False
        ),
        _numbers(found),
        section("curves", "Curves", Picture("curves", _caption(found), _curves(found))),
        _measured(found.measured) if found.measured is not None else None,
        _values(found),
        _definitions(found),
    ]


def _numbers(found: Datasheet) -> Section:
    rows = tuple((number.name, number.standard, number.out, number.back) for number in found.numbers)
    return section(
        "numbers",
        "Numbers",
        PageTable(
            ("number", "standard", "out, or the only one", "back"), rows, "In brackets: interval", numbers_from=2
        ),
        Paragraph(SIMULATED),
        _published(found),
        *(Paragraph(f"{name}: {why}", "note") for name, why in found.failed.items() if name != "published"),
    )


def _published(found: Datasheet) -> PageTable | None:
    """Return the printed figures of the drive's parts, with those of the drive."""
    if "published" not in found.results:
        return None
    table = found.results["published"]
    columns = [100.0 * table.difference.to_numpy(), table.computed.to_numpy(), table.printed.to_numpy()]
    rows = []
    for name, more, computed, printed in zip(table["figure"].to_numpy(), *columns, strict=True):
        rows.append((str(name), plain(printed), plain(computed), f"{more:+.2g} %"))
    head = ("printed figure, SI", "printed", "of this drive", "difference")
    return PageTable(head, tuple(rows), "Published figures of the parts")


def _caption(found: Datasheet) -> str:
    said = next(iter(found.results.values())).attrs.get("interval", "") if found.results else ""
    return f"Curves of the drive, simulated. Bands: {said}."


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
    blocks: list[Block] = [Items(measured.names)]
    blocks += [
        Paragraph(text, "holds" if met else "note" if met is None else "fails") for met, text in measured.verdicts
    ]
    if measured.numbers:
        rows = tuple(
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
        head = ("stroke", "number", "measured (95 %)", "strokes", "simulated", "")
        blocks.append(PageTable(head, rows, "The same definitions, read from recording and simulation", numbers_from=2))
    figure = _beside(measured)
    if figure is not None:
        caption = "Measured (points, lines) and simulated (dashed)."
        blocks.append(Picture("measured", caption, figure, synthetic=measured.synthetic))
    return section("measured", "Measured and simulated", *blocks, synthetic=measured.synthetic)


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


def _values(found: Datasheet) -> Section:
    rows = tuple((value.key.removeprefix("components."), value.value, value.origin) for value in found.values)
    return section(
        "values",
        "Values and where they come from",
        PageTable(("value", "", "from"), rows, numbers_from=9),
        synthetic=False,
    )


def _definitions(found: Datasheet) -> Section:
    known = characteristics()
    shown = [name for name in found.results if name in known]
    items = tuple(f"{known[name].title}: {known[name].definition} ({known[name].algorithm})" for name in shown)
    keys = dict.fromkeys(key for name in shown for key in known[name].cites)
    cited = tuple(line for key in keys if (line := reference(key)))
    return section(
        "definitions",
        "Assumed, definitions, sources",
        Items(tuple(f"assumed: {one}" for one in found.assumed)),
        Items(items),
        Items(cited),
        synthetic=False,
    )
