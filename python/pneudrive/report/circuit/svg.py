"""The drawing of a circuit: shapes in modules, y up, as a figure, and as SVG text for a notebook.

The SVG text has no script and no style sheet, and every text is escaped. A viewer without SVG, or an untrusted
notebook, shows the bare texts, one per line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from textwrap import wrap
from typing import NamedTuple

import numpy as np

from pneudrive.describe import Circuit, Drive
from pneudrive.figures import Drawing, Figure, Panel, PenStroke
from pneudrive.report.circuit.layout import LINE, MODULE_IN, NAME_PT, TEXT_PT, Box, Shape, arranged, bounds, text_width
from pneudrive.report.render import DrawnFigure, draw_figure

EDGE = 2.0  # modules of paper around everything
TITLE_PT = 9.0
LEAST_WIDTH = 40.0  # modules, so that the notes below have room
SAID = "Symbols after ISO 1219."
LETTER = 0.6  # modules: width of a letter of the notes, rounded up

#: Symbol of a cylinder, modules: width of the barrel, distance from its left end to the piston, corners of the piston.
BARREL_WIDTH, PISTON_FROM = 12.0, 3.0
PISTON = [(0.0, 0.0), (0.0, 4.0), (0.8, 4.0), (0.8, 0.0)]


class CircuitShapes(NamedTuple):
    """Shapes of a drawing.

    Attributes
    ----------
    paper : tuple
        x and y of the lower left corner, x and y of the upper right corner.
    shapes : list of Shape
    nets : list
        Component and port of each end of a line.
    ports : dict
        Component -> port -> position.
    box : tuple
        Corners of the rectangle around components and lines, as those of the paper.
    """

    paper: Box
    shapes: list[Shape]
    nets: list[list[tuple[str, str]]]
    ports: Mapping[str, Mapping[str, tuple[float, float]]]
    box: Box


class PistonShapes(NamedTuple):
    """Position of a cylinder with one piston in the drawing, for an animation.

    Attributes
    ----------
    barrel : tuple
        x and y of the lower left corner, x and y of the upper right corner. Chamber a is on the left.
    piston : tuple
        x of its faces in the drawing.
    moves : dict
        Number of a shape -> whether each of its points moves with the piston. For a rod, only the end at the piston
        moves.
    """

    barrel: Box
    piston: tuple[float, float]
    moves: dict[int, list[bool]]


def pistons(shapes: Sequence[Shape]) -> dict[str, PistonShapes]:
    """Return the pistons of a drawing by component, for symbols with one piston in one barrel."""
    out: dict[str, PistonShapes] = {}
    for name in dict.fromkeys(one.component for one in shapes if one.component):
        own = {number: one for number, one in enumerate(shapes) if one.component == name and one.word != "text"}
        lines = (one.points for one in own.values() if one.word == "line" and len(one.points) == len(PISTON))
        faces = [points for points in lines if np.allclose(np.subtract(points, points[0]), PISTON)]
        if len(faces) != 1:
            continue
        (left, low), (_, high), (right, _), _ = faces[0]
        start = left - PISTON_FROM
        moves = {number: [_moves(x - start, y - low) for x, y in one.points] for number, one in own.items()}
        barrel = (start, low, start + BARREL_WIDTH, high)
        out[name] = PistonShapes(barrel, (left, right), {number: one for number, one in moves.items() if any(one)})
    return out


def _moves(x: float, y: float) -> bool:
    """Return whether a point of the symbol moves with the piston: on its faces, its cushions or its carriage."""
    return 2.9 < x < 3.9 or (0.9 < x < 5.3 and y > 0.5)


def circuit_shapes(described: Circuit | Drive) -> CircuitShapes:
    """Return the drawing of a circuit, or of the circuit of a drive: supply below, actuators above.

    Raises
    ------
    DescriptionError
        If two components have the same position.
    """
    circuit = described.circuit
    placed, joints, routes = arranged(circuit)
    corners: list[tuple[float, float]] = [end for line in routes.lines for step in line for end in step]
    for block in placed.values():
        corners += [block.rectangle()[:2], block.rectangle()[2:], *block.cells()]
    box = bounds(corners)
    low_x, low_y, high_x, high_y = box
    width = max(high_x - low_x, LEAST_WIDTH, text_width(circuit.name, TITLE_PT))
    volumes = [f"{name} {1e6 * volume:.3g} cm\N{SUPERSCRIPT THREE}" for name, volume in circuit.joint_volumes]
    notes = wrap(f"Volumes of joints: {', '.join(volumes)}. {SAID}" if volumes else SAID, int(width / LETTER))
    paper = (low_x - EDGE, low_y - EDGE - LINE * len(notes) - 0.5, low_x + width + EDGE, high_y + EDGE + 2.0)
    shapes = [*routes.shapes(joints), *(shape for block in placed.values() for shape in block.shapes())]
    shapes.append(Shape("text", ((low_x, paper[3] - EDGE),), "", TITLE_PT, circuit.name, "left top"))
    for number, line in enumerate(notes):
        shapes.append(Shape("text", ((low_x, low_y - EDGE - LINE * number),), "", TEXT_PT, line, "left top"))
    nets = [[(port.component, port.name) for port in joint.ports] for joint in joints]
    ports = {name: {port: block.port(port) for port in block.directions} for name, block in placed.items()}
    return CircuitShapes(paper, shapes, nets, ports, box)


PT = 1 / 7.2  # modules of 0.1 inch
PIXELS = 9  # of a module
ANCHORS = {"left": "start", "center": "middle", "right": "end"}


def circuit_svg(described: Circuit | Drive) -> str:
    """Return the drawing of a circuit, or of the circuit of a drive, as an SVG element in the colour of the text.

    Raises
    ------
    DescriptionError
        If two components have the same position.

    Examples
    --------
    >>> import pneudrive as pn
    >>> from pneudrive.report.circuit.svg import circuit_svg
    >>> circuit_svg(pn.Drive.load("catalogue:reference"))[:5]
    '<svg '
    """
    (left, bottom, right, top), shapes, *_ = circuit_shapes(described)
    width, height = right - left, top - bottom
    elements = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left:.3g} {-top:.3g} {width:.4g} {height:.4g}" role="img" '
        f'aria-label="Circuit of {escape(described.name)}, symbols after ISO 1219" width="{PIXELS * width:.0f}" '
        'style="max-width:100%;height:auto" fill="none" stroke="currentColor">'
    ]
    for stroke in map(_pen, shapes):  # y of an SVG points down
        size, width = PT * stroke.size, PT * stroke.width
        if stroke.text:
            ((x, y),) = stroke.points
            side, _, hangs = stroke.align.partition(" ")
            down = 0.8 if hangs == "top" else 0.35  # of the size of the text, from its point to its base line
            elements.append(
                f'<text x="{x:.4g}" y="{down * size - y:.4g}" font-size="{size:.3g}" text-anchor="{ANCHORS[side]}" '
                f'fill="currentColor" stroke="none">{escape(stroke.text)}</text>\n'
            )
            continue
        points = " ".join(f"{x:.4g},{-y:.4g}" for x, y in stroke.points)
        fill, dash = "currentColor" if stroke.fill else "none", " ".join(f"{width * part:.3g}" for part in stroke.dash)
        elements.append(
            f'<polyline points="{points}" stroke-width="{width:.3g}" fill="{fill}" '
            f'stroke-dasharray="{dash or "none"}"/>'
        )
    return "".join([*elements, "</svg>"])


# --- A circuit as a drawing, with symbols after ISO 1219.

PEN, THICK = 0.8, 1.6  # points: width of lines, and of moving parts
ARC_STEPS = 48  # of an arc or a dot


def draw_circuit(circuit: Circuit | Drive, path: str | Path | None = None) -> DrawnFigure:
    """Draw a circuit, or the circuit of a drive: supply below, actuators above.

    Parameters
    ----------
    circuit : Circuit or Drive
        A component with `at` is drawn at this position, in modules of the drawing.
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
        If two components have the same position.

    Examples
    --------
    >>> import pneudrive as pn
    >>> figure = pn.report.draw_circuit(pn.Drive.load("catalogue:reference"))
    """
    return draw_figure(circuit_figure(circuit), path)


def circuit_figure(described: Circuit | Drive) -> Figure:
    """Return the drawing of a circuit as a figure that fills its paper."""
    (left, bottom, right, top), shapes, *_ = circuit_shapes(described)
    panel = Panel([Drawing([_pen(shape) for shape in shapes], (left, right), (bottom, top))])
    height_in, width_in = (top - bottom) * MODULE_IN, (right - left) * MODULE_IN
    return Figure([panel], row_in=height_in, rest_in=0.0, width_in=width_in, has_margins=False)


def _pen(shape: Shape) -> PenStroke:
    word, points = shape.word, shape.points
    if word == "text":
        align, _, top = shape.align.partition(" ")
        return PenStroke(
            points, shape.text, size=shape.size, align=f"{align} {top or 'center'}", bold=shape.size == NAME_PT
        )
    points = shape.outline(("arc", "dot"), ARC_STEPS)
    closed = (*points, points[0]) if word in ("triangle", "head") else points
    fill, dash = "black" if word in ("head", "dot") else "", (4, 2) if word == "dashed" else ()
    return PenStroke(closed, fill=fill, dash=dash, width={"thick": THICK, "dot": 0.0}.get(word, PEN))
