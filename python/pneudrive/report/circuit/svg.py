"""The drawing of a circuit as SVG text, for a notebook: no script, no style sheet, every text escaped.

An untrusted notebook removes the tags. Line ends separate the texts even in a viewer without SVG.
"""

from __future__ import annotations

from html import escape
from math import cos, radians, sin
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


PT = 1 / 7.2  # modules of 0.1 inch
PIXELS = 9  # of a module
ANCHORS = {"left": "start", "center": "middle", "right": "end"}
STROKES = {"thick": ' stroke-width="0.25"', "dashed": ' stroke-dasharray="0.5 0.35"'}


def circuit_svg(described: Circuit | Drive) -> str:
    """Return the drawing of a circuit, or of the circuit of a drive, as an SVG element in the colour of the text.

    Raises
    ------
    DescriptionError
        If two components have one place.

    Examples
    --------
    >>> import pneudrive as pn
    >>> from pneudrive.report.circuit.svg import circuit_svg
    >>> circuit_svg(pn.Drive.load("catalogue:reference"))[:5]
    '<svg '
    """
    (left, bottom, right, top), shapes, *_ = circuit_shapes(described)
    width, height = right - left, top - bottom
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left:.3g} {-top:.3g} {width:.4g} {height:.4g}" role="img" '
        f'aria-label="Circuit of {escape(described.name)}, symbols after ISO 1219" width="{PIXELS * width:.0f}" '
        'style="max-width:100%;height:auto" fill="none" stroke="currentColor" stroke-width="0.12">'
    )
    return head + "".join(map(_element, shapes)) + "</svg>"


def _element(shape: Shape) -> str:
    x, y = shape.points[0][0], -shape.points[0][1]
    if shape.word == "text":
        side, _, hangs = shape.align.partition(" ")
        down = 0.8 if hangs else 0.35  # of the size of the text, from its point to its base line
        size = shape.size * PT
        return (
            f'<text x="{x:.4g}" y="{y + down * size:.4g}" font-size="{size:.3g}" text-anchor="{ANCHORS[side]}" '
            f'fill="currentColor" stroke="none">{escape(shape.text)}</text>\n'
        )
    if shape.word == "dot":
        return f'<circle cx="{x:.4g}" cy="{y:.4g}" r="{shape.size:.3g}" fill="currentColor" stroke="none"/>'
    if shape.word == "arc":
        low, high = shape.angles
        r, ends = (
            shape.size,
            [
                f"{x + shape.size * cos(radians(angle)):.4g} {y - shape.size * sin(radians(angle)):.4g}"
                for angle in (low, 0.5 * (low + high), high)
            ],
        )  # in two halves: a full circle has one point for both ends
        return f'<path d="M {ends[0]} A {r} {r} 0 0 0 {ends[1]} A {r} {r} 0 0 0 {ends[2]}"/>'
    points = " ".join(f"{px:.4g},{-py:.4g}" for px, py in shape.points)
    if shape.word in ("triangle", "head"):
        fill = ' fill="currentColor"' if shape.word == "head" else ""
        return f'<polygon points="{points}"{fill}/>'
    return f'<polyline points="{points}"{STROKES.get(shape.word, "")}/>'


# --- A circuit as a drawing, with symbols after ISO 1219.

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
