"""The drawing of a circuit as shapes, for any output on paper or on a screen. Lengths in modules, y up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from pneudrive.report.circuit.blocks import DIRECTIONS, LINE, TEXT_PT, size, text_width
from pneudrive.report.circuit.layout import place
from pneudrive.report.circuit.routes import NoWayError, Routes

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.report.circuit.blocks import Block, Box
    from pneudrive.report.circuit.layout import Net

SPREADS = (1.0, 1.4, 2.0, 3.0, 5.0)  # room between the blocks: tried in turn until all lines find a way
EDGE = 2.0  # modules of paper around everything
TITLE_PT = 9.0
LEAST_WIDTH = 40.0  # modules, so that the notes below have room
ARROW, MARK = 0.45, 0.9  # half width and height of the mark of an exhaust
SAID = "Symbols after ISO 1219."

#: Of the symbols of cylinders: width of the barrel, and from its left end to the piston.
BARREL_WIDTH, PISTON_FROM = 12.0, 3.0

Points = tuple[tuple[float, float], ...]


class Shape(NamedTuple):
    """One stroke, dot or text of a drawing.

    Attributes
    ----------
    word : str
        ``"line"``, ``"thick"``, ``"dashed"``, ``"triangle"`` (an outline), ``"head"`` (filled), ``"arc"``, ``"dot"`` or
        ``"text"``.
    points : tuple
        Corners of a line or triangle. Otherwise, the single point of the shape.
    component : str
        Component that it belongs to; empty for lines between components, title and notes.
    size : float
        Radius of an arc or a dot, modules; size of a text, points.
    text : str
    align : str
        Alignment of a text: ``"center"``, ``"left"`` or ``"right"`` of its point. ``"top"`` is added if the text is
        below the point.
    angles : tuple of float
        First and last angle of an arc, degrees against the clock from the right.
    net : int
        Number of the line between components, in `CircuitShapes.nets`; -1 for other shapes.
    """

    word: str
    points: Points
    component: str = ""
    size: float = 0.0
    text: str = ""
    align: str = "center"
    angles: tuple[float, float] = (0.0, 360.0)
    net: int = -1


class CircuitShapes(NamedTuple):
    """Shapes of a drawing.

    Attributes
    ----------
    paper : tuple
        x and y of the lower left corner, x and y of the upper right one.
    shapes : list of Shape
    nets : list
        Component and port of each end of a line.
    ports : dict
        Component -> port -> place.
    """

    paper: Box
    shapes: list[Shape]
    nets: list[list[tuple[str, str]]]
    ports: Mapping[str, Mapping[str, tuple[float, float]]]


class PistonShapes(NamedTuple):
    """Place of a cylinder with one piston in the drawing, for an animation.

    Attributes
    ----------
    barrel : tuple
        x and y of the lower left corner, x and y of the upper right one; chamber a on the left.
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
    """Return the pistons of a drawing by component, of symbols that have one piston in one barrel."""
    out: dict[str, PistonShapes] = {}
    for name in dict.fromkeys(one.component for one in shapes if one.component):
        own = {number: one for number, one in enumerate(shapes) if one.component == name and one.word != "text"}
        faces = [one.points for one in own.values() if _is_piston(one)]
        if len(faces) != 1:
            continue
        (left, low), (_, high), (right, _), _ = faces[0]
        start = left - PISTON_FROM
        moves = {number: [_moves(x - start, y - low) for x, y in one.points] for number, one in own.items()}
        barrel = (start, low, start + BARREL_WIDTH, high)
        out[name] = PistonShapes(barrel, (left, right), {number: one for number, one in moves.items() if any(one)})
    return out


def _is_piston(shape: Shape) -> bool:
    """Whether it is the piston of the symbols of cylinders."""
    if shape.word != "line" or len(shape.points) != 4:
        return False
    (x, y), *rest = shape.points
    steps = [(round(px - x, 6), round(py - y, 6)) for px, py in rest]
    return steps == [(0.0, 4.0), (0.8, 4.0), (0.8, 0.0)]


def _moves(x: float, y: float) -> bool:
    """Whether a point of the symbol moves: at the piston's faces, or at cushions and carriage, which are around it."""
    return 2.9 < x < 3.9 or (0.9 < x < 5.3 and y > 0.5)


def circuit_shapes(described: Circuit | Drive) -> CircuitShapes:
    """Return the drawing of a circuit, or of the circuit of a drive: supply below, actuators above.

    Raises
    ------
    DescriptionError
        If two components have one place.
    """
    circuit: Circuit = described if hasattr(described, "wiring") else described.circuit  # type: ignore[union-attr,assignment]
    placed, nets, routes = arranged(circuit)
    low_x, low_y, high_x, high_y = _extent(placed, routes)
    width = max(high_x - low_x, LEAST_WIDTH, text_width(circuit.name, TITLE_PT))
    notes = list(_wrapped(_notes(circuit), width))
    paper = (low_x - EDGE, low_y - EDGE - LINE * len(notes) - 0.5, low_x + width + EDGE, high_y + EDGE + 2.0)
    shapes = [*_lines(nets, routes)]
    for block in placed.values():
        shapes += _block(block)
    shapes.append(Shape("text", ((low_x, paper[3] - EDGE),), "", TITLE_PT, circuit.name, "left top"))
    for number, line in enumerate(notes):
        shapes.append(Shape("text", ((low_x, low_y - EDGE - LINE * number),), "", TEXT_PT, line, "left top"))
    ends = [[*net.pins, *net.pilots] for net in nets]
    ports = {name: {port: block.port(port) for port in block.directions} for name, block in placed.items()}
    return CircuitShapes(paper, shapes, ends, ports)


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


def _extent(placed: dict[str, Block], routes: Routes) -> Box:
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


def _lines(nets: Sequence[Net], routes: Routes) -> Iterator[Shape]:
    for number, net in enumerate(nets):
        for ends in routes.runs(number, pilots=False):
            yield Shape("thick" if net.kind == "axis" else "line", _pairs(ends), net=number)
        for ends in routes.runs(number, pilots=True):
            yield Shape("dashed", _pairs(ends), net=number)
        for branch in routes.branches(number):
            yield Shape("dot", _pairs([branch]), size=0.28, net=number)


def _pairs(points: Sequence[Any], x: float = 0.0, y: float = 0.0) -> Points:
    return tuple((x + point[0], y + point[1]) for point in points)


def _block(block: Block) -> Iterator[Shape]:
    for stroke in block.strokes:
        yield _stroke(stroke, block)
    for port, mark in block.marks.items():
        yield from _mark(block.name, block.port(port), DIRECTIONS[block.directions[port]], mark)
    for number, line in enumerate(block.label.lines):
        at = (block.x + block.label.x, block.y + block.label.y - LINE * (number + 0.5))
        yield Shape("text", (at,), block.name, size(number), line, block.label.align)


def _stroke(stroke: Sequence[Any], block: Block) -> Shape:
    word = stroke[0]
    if word in ("line", "dashed", "triangle", "head"):
        return Shape(word, _pairs(stroke[1], block.x, block.y), block.name)
    at = _pairs([stroke[1]], block.x, block.y)
    if word == "arc":
        low, high = stroke[3]
        return Shape(word, at, block.name, stroke[2], angles=(low, high))
    if word == "dot":
        return Shape(word, at, block.name, stroke[2])
    return Shape("text", at, block.name, TEXT_PT, stroke[2])


def _mark(name: str, at: tuple[float, float], direction: tuple[int, int], mark: str) -> Iterator[Shape]:
    """Yield the mark of a port that is open to the ambient air, or shut."""
    (x, y), (dx, dy) = at, direction
    if mark == "exhaust":
        base = x + 0.1 * dx, y + 0.1 * dy
        wide = [(base[0] + side * dy * ARROW, base[1] + side * dx * ARROW) for side in (1, -1)]
        yield Shape("triangle", _pairs([*wide, (base[0] + MARK * dx, base[1] + MARK * dy)]), name)
    else:
        for side in (1, -1):
            ends = [(x - 0.35 * (dy * side + dx), y - 0.35 * (dx * side + dy))]
            ends.append((x + 0.35 * (dy * side + dx), y + 0.35 * (dx * side + dy)))
            yield Shape("line", _pairs(ends), name)
