"""A circuit as a drawing, with symbols after ISO 1219."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive.report import style
from pneudrive.report.circuit_blocks import DIRECTIONS, LINE, MODULE_IN, TEXT_PT, size, text_width
from pneudrive.report.circuit_layout import place
from pneudrive.report.circuit_routes import NoWayError, Routes
from pneudrive.report.written import drawn

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.report.circuit_blocks import Block
    from pneudrive.report.circuit_layout import Net

SPREADS = (1.0, 1.4, 2.0, 3.0, 5.0)  # room between the blocks: tried in turn until all lines find a way
EDGE = 2.0  # modules of paper around everything
TITLE_PT = 9.0
LEAST_WIDTH = 40.0  # modules, so that the notes below have room
PEN, THICK = 0.8, 1.6  # points: width of lines, and of moving parts
ARROW, MARK = 0.45, 0.9  # half width and height of the mark of an exhaust
SAID = "Symbols after ISO 1219."


def draw_circuit(circuit: Circuit | Drive, path: str | Path | None = None) -> Figure:
    """Draw a circuit, or the circuit of a drive: supply below, actuators above.

    Parameters
    ----------
    circuit : Circuit or Drive
        A component with `at` is drawn there, in modules of the drawing.
    path : path-like, optional
        Picture to write: .svg, .png or .pdf.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    DescriptionError
        If two components have one place.

    Examples
    --------
    >>> import pneudrive as pn
    >>> figure = pn.report.draw_circuit(pn.Drive.load("catalogue:reference"))
    """
    shown: Circuit = circuit if hasattr(circuit, "wiring") else circuit.circuit  # type: ignore[union-attr,assignment]
    return drawn(lambda: _figure(shown, *arranged(shown)), path)


def arranged(circuit: Circuit) -> tuple[dict[str, Block], list[Net], Routes]:
    """Place the components and find a way for every line, with more room between them if necessary."""
    for spread in SPREADS:
        placed, nets = place(circuit, spread)
        try:
            return placed, nets, Routes(placed, nets)
        except NoWayError:
            if spread == SPREADS[-1]:
                raise
    raise NoWayError


def _figure(circuit: Circuit, placed: dict[str, Block], nets: Sequence[Net], routes: Routes) -> Figure:
    low_x, low_y, high_x, high_y = _extent(placed, routes)
    width = max(high_x - low_x, LEAST_WIDTH, text_width(circuit.name, TITLE_PT))
    notes = list(_wrapped(_notes(circuit), width))
    left, bottom = low_x - EDGE, low_y - EDGE - LINE * len(notes) - 0.5
    right, top = low_x + width + EDGE, high_y + EDGE + 2.0
    figure = style.new_figure((top - bottom) * MODULE_IN, (right - left) * MODULE_IN)
    figure.set_layout_engine("none")
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axis.set_axis_off()
    axis.grid(visible=False)
    axis.set_xlim(left, right)
    axis.set_ylim(bottom, top)
    for number, net in enumerate(nets):
        for ends in routes.runs(number, pilots=False):
            _path(axis, ends, lw=THICK if net.kind == "axis" else PEN)
        for ends in routes.runs(number, pilots=True):
            _path(axis, ends, dashed=True)
        for branch in routes.branches(number):
            _dot(axis, branch, 0.28)
    for block in placed.values():
        _block(axis, block)
    axis.text(low_x, top - EDGE, circuit.name, fontsize=TITLE_PT, va="top")
    for number, line in enumerate(notes):
        axis.text(low_x, low_y - EDGE - LINE * number, line, fontsize=TEXT_PT, va="top", color=style.BLACK)
    return figure


def _extent(placed: dict[str, Block], routes: Routes) -> tuple[float, float, float, float]:
    boxes = [block.rectangle() for block in placed.values()]
    boxes += [(x, y, x, y) for block in placed.values() for x, y in block.cells()]
    boxes += [(*low, *high) for line in routes.lines for low, high in line]
    low_x, low_y, high_x, high_y = zip(*boxes, strict=True)
    return min(low_x), min(low_y), max(high_x), max(high_y)


def _notes(circuit: Circuit) -> str:
    volumes = circuit.joint_volumes
    listed = ", ".join(f"{name} {1e6 * volume:.3g} cm\N{SUPERSCRIPT THREE}" for name, volume in volumes)
    return f"Volumes of joints: {listed}. {SAID}" if listed else SAID


def _wrapped(text: str, width: float) -> Iterator[str]:
    line, taken = "", 0.0
    for word in text.split(" "):
        wide = text_width(f"{word}n", TEXT_PT)  # with about a space
        if line and taken + wide > width:
            yield line
            line, taken = word, wide
        else:
            line, taken = f"{line} {word}".strip(), taken + wide
    yield line


def _block(axis: Axes, block: Block) -> None:
    for stroke in block.strokes:
        _stroke(axis, stroke, block)
    for port, mark in block.marks.items():
        _mark(axis, block.port(port), DIRECTIONS[block.directions[port]], mark)
    for number, line in enumerate(block.label.lines):
        axis.text(
            block.x + block.label.x,
            block.y + block.label.y - LINE * (number + 0.5),
            line,
            fontsize=size(number),
            fontweight="bold" if number == 0 else "normal",
            ha=block.label.align,
            va="center",
        )


def _stroke(axis: Axes, stroke: Sequence[Any], block: Block) -> None:
    from matplotlib.patches import Arc

    word = stroke[0]
    if word in ("line", "dashed"):
        _path(axis, [(block.x + x, block.y + y) for x, y in stroke[1]], dashed=word == "dashed")
    elif word in ("triangle", "head"):
        _triangle(axis, [(block.x + x, block.y + y) for x, y in stroke[1]], filled=word == "head")
    else:
        x, y = block.x + stroke[1][0], block.y + stroke[1][1]
        if word == "arc":
            low, high = stroke[3]
            axis.add_patch(Arc((x, y), 2 * stroke[2], 2 * stroke[2], theta1=low, theta2=high, lw=PEN))
        elif word == "dot":
            _dot(axis, (x, y), stroke[2])
        else:
            axis.text(x, y, stroke[2], fontsize=TEXT_PT, ha="center", va="center")


def _mark(axis: Axes, at: tuple[float, float], direction: tuple[int, int], mark: str) -> None:
    """Draw the mark of a port that is open to the ambient air, or shut."""
    (x, y), (dx, dy) = at, direction
    if mark == "exhaust":
        base = x + 0.1 * dx, y + 0.1 * dy
        wide = [(base[0] + side * dy * ARROW, base[1] + side * dx * ARROW) for side in (1, -1)]
        _triangle(axis, [*wide, (base[0] + MARK * dx, base[1] + MARK * dy)], filled=False)
    else:
        for side in (1, -1):
            ends = [(x - 0.35 * (dy * side + dx), y - 0.35 * (dx * side + dy))]
            ends.append((x + 0.35 * (dy * side + dx), y + 0.35 * (dx * side + dy)))
            _path(axis, ends)


def _path(axis: Axes, points: Sequence[Any], *, lw: float = PEN, dashed: bool = False) -> None:
    xs, ys = [point[0] for point in points], [point[1] for point in points]
    look: Any = (0, (4, 2)) if dashed else "-"
    axis.plot(xs, ys, color=style.BLACK, lw=lw, linestyle=look, solid_capstyle="round")


def _triangle(axis: Axes, points: Sequence[Any], *, filled: bool) -> None:
    from matplotlib.patches import Polygon

    axis.add_patch(
        Polygon(list(points), closed=True, fill=filled, facecolor=style.BLACK, edgecolor=style.BLACK, lw=PEN)
    )


def _dot(axis: Axes, at: tuple[float, float], radius: float) -> None:
    from matplotlib.patches import Circle

    axis.add_patch(Circle(at, radius, facecolor=style.BLACK, edgecolor="none"))
