"""A circuit as a drawing, with symbols after ISO 1219."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive.report import style
from pneudrive.report.circuit.blocks import MODULE_IN, NAME_PT
from pneudrive.report.circuit.shapes import CircuitShapes, circuit_shapes
from pneudrive.report.render import drawn

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.report.circuit.shapes import Shape

PEN, THICK = 0.8, 1.6  # points: width of lines, and of moving parts


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
    return drawn(lambda: _figure(circuit_shapes(circuit)), path)


def _figure(drawing: CircuitShapes) -> Figure:
    left, bottom, right, top = drawing.paper
    figure = style.new_figure((top - bottom) * MODULE_IN, (right - left) * MODULE_IN)
    figure.set_layout_engine("none")
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axis.set_axis_off()
    axis.grid(visible=False)
    axis.set_xlim(left, right)
    axis.set_ylim(bottom, top)
    for shape in drawing.shapes:
        _draw(axis, shape)
    return figure


def _draw(axis: Axes, shape: Shape) -> None:
    from matplotlib.patches import Arc, Circle, Polygon

    word, (x, y) = shape.word, shape.points[0]
    if word in ("line", "thick", "dashed"):
        xs, ys = [point[0] for point in shape.points], [point[1] for point in shape.points]
        look: Any = (0, (4, 2)) if word == "dashed" else "-"
        width = THICK if word == "thick" else PEN
        axis.plot(xs, ys, color=style.ink("black"), lw=width, linestyle=look, solid_capstyle="round")
    elif word in ("triangle", "head"):
        colours: dict[str, Any] = {"facecolor": style.ink("black"), "edgecolor": style.ink("black")}
        axis.add_patch(Polygon(list(shape.points), closed=True, fill=word == "head", lw=PEN, **colours))
    elif word == "arc":
        low, high = shape.angles
        axis.add_patch(Arc((x, y), 2 * shape.size, 2 * shape.size, theta1=low, theta2=high, lw=PEN))
    elif word == "dot":
        axis.add_patch(Circle((x, y), shape.size, facecolor=style.ink("black"), edgecolor="none"))
    else:
        align, _, top = shape.align.partition(" ")
        weight = "bold" if shape.size == NAME_PT else "normal"
        place: dict[str, Any] = {"ha": align, "va": top or "center", "fontweight": weight}
        axis.text(x, y, shape.text, fontsize=shape.size, **place)
