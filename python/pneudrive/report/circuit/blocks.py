"""The components of a circuit as blocks of a drawing: symbol, ports, label. Lengths in modules, x right, y up."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from pneudrive.describe.kinds import is_needed
from pneudrive.errors import package_table
from pneudrive.report import style

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from pneudrive.describe import Circuit, Component

MODULE_IN = 0.1  # inch, height of a module on paper
NAME_PT, TEXT_PT = 7.0, 6.0
LINE = 1.1  # line spacing of a label
WIDE = 10.0  # a symbol of this width has its label above, not beside
MOST_VALUES = 2  # in a label
DIRECTIONS = {"right": (1, 0), "left": (-1, 0), "up": (0, 1), "down": (0, -1)}

_TABLES = package_table(__file__, "symbols.toml")
SYMBOLS = {kind: symbol for symbol in _TABLES["symbols"] for kind in symbol["kinds"]}

#: Corners of a rectangle: x and y of the lower left, x and y of the upper right.
Box = tuple[float, float, float, float]
Place = tuple[int, int]


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


class Label(NamedTuple):
    """Lines of text next to a symbol."""

    lines: tuple[str, ...]
    x: float  # of the left end, or of the right end
    y: float  # of the top
    align: str  # "left" or "right"


@dataclass
class Block:
    """A component in a drawing."""

    name: str
    kind: str
    strokes: Sequence[Shape]
    ports: Mapping[str, Place]
    directions: Mapping[str, str]  # side on which each port leaves
    symbol: Box
    label: Label
    box: Box  # bounding box
    x: int = 0
    y: int = 0
    rank: int = 0
    is_fixed: bool = False
    marks: dict[str, str] = field(default_factory=dict)  # port -> "exhaust" or "shut"

    def port(self, name: str) -> Place:
        """Return the position of a port."""
        return self.x + self.ports[name][0], self.y + self.ports[name][1]

    def rectangle(self) -> Box:
        """Return the bounding box at the position of the block."""
        low_x, low_y, high_x, high_y = self.box
        return self.x + low_x, self.y + low_y, self.x + high_x, self.y + high_y

    def cells(self) -> Iterator[Place]:
        """Return the points of the grid on which no line runs."""
        for low_x, low_y, high_x, high_y in (self.symbol, label_box(self.label)):
            for x in range(math.ceil(low_x - 0.4), math.floor(high_x + 0.4) + 1):
                for y in range(math.ceil(low_y - 0.4), math.floor(high_y + 0.4) + 1):
                    yield self.x + x, self.y + y
        for port in self.marks:
            (x, y), (across, up) = self.port(port), DIRECTIONS[self.directions[port]]
            yield x + across, y + up


def label_box(label: Label) -> Box:
    """Return the rectangle of a label."""
    width = max(text_width(line, size(number)) for number, line in enumerate(label.lines))
    left = label.x if label.align == "left" else label.x - width
    return left, label.y - LINE * len(label.lines), left + width, label.y


def size(line: int) -> float:
    """Return the size of a line of a label, points: the name first."""
    return NAME_PT if line == 0 else TEXT_PT


@lru_cache(maxsize=4096)
def text_width(text: str, points: float) -> float:
    """Return the width of a text, in modules."""
    style.load_matplotlib()
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    if not text.strip():
        return 0.0
    with style.applied():
        path = TextPath((0.0, 0.0), text, size=points, prop=FontProperties(family=style.FONT))
    return float(path.get_extents().width) / 72.0 / MODULE_IN


def blocks(circuit: Circuit) -> dict[str, Block]:
    """Return a block for each component. Positions are set later."""
    return {name: _block(name, one) for name, one in circuit.components.items()}


def _block(name: str, one: Component) -> Block:
    entry = one.entry
    symbol = SYMBOLS.get(entry["kind"])
    if symbol:
        chosen = {str(getattr(one, choice["name"])) for choice in entry["choices"]} | set(one.plain())
        extra = [stroke for option, own in symbol["when"].items() if option in chosen for stroke in own]
        strokes = list(_drawn([*symbol["strokes"], *extra]))
        places = list(map(tuple, symbol["ports"]))
    else:
        strokes, places = _plain(entry)
    ports = {port["name"]: place for port, place in zip(entry["ports"], places, strict=True)}
    box = _bounds([*(point for stroke in strokes for point in _points(stroke)), *places])
    directions = {port: _side(place, box) for port, place in ports.items()}
    label = _label(name, one, box, set(directions.values()))
    whole = _bounds([corner for one_box in (box, label_box(label)) for corner in (one_box[:2], one_box[2:])])
    return Block(name, one.kind, strokes, ports, directions, box, label, whole)


def _drawn(strokes: Sequence[Mapping[str, Any]], right: float = 0.0) -> Iterator[Shape]:
    """Yield the shapes of strokes, moved to the right."""
    for stroke in strokes:
        if "use" in stroke:
            yield from _drawn(_TABLES["parts"][stroke["use"]], right + stroke.get("right", 0.0))
        else:
            points = tuple((right + x, float(y)) for x, y in stroke["points"])
            yield Shape(**{**stroke, "points": points})


def _plain(entry: Mapping[str, Any]) -> tuple[list[Shape], list[Place]]:
    """Return a box with a title: inlets below, outlets above, other ports to the right.

    A component without gas is on the right of an actuator: its first port is on the left.
    """
    title = entry["title"].partition(",")[0]
    sides: dict[str, list[str]] = {"down": [], "up": [], "left": [], "right": []}
    volumes = sum(port["holds"] == "volume" for port in entry["ports"])
    has_gas = any(port["kind"] == "gas" for port in entry["ports"])
    for port in entry["ports"]:
        feeds = port["holds"] == "pressure" or (sides["down"] and not (port["holds"] == "volume" and volumes > 1))
        other = "right" if has_gas or sides["left"] else "left"
        side = other if port["exhaust"] or port["kind"] != "gas" else "up" if feeds else "down"
        sides[side].append(port["name"])
    names = max((text_width(name, TEXT_PT) for name in sides["right"] + sides["left"]), default=0.0)
    least = [2 * len(sides[side]) + 2 for side in ("up", "down")]
    width = max(6, math.ceil(text_width(title, TEXT_PT) + 2 * names) + 2, *least)
    width, height = width + width % 2, max(4, 2 * len(sides["right"]) + 2)
    strokes = [Shape("line", ((0, 0), (0, height), (width, height), (width, 0), (0, 0)))]
    strokes.append(Shape("text", ((0.5 * width, 0.5 * height),), size=TEXT_PT, text=title))
    places: dict[str, Place] = {}
    for side, ports in sides.items():
        for number, name in enumerate(ports):
            along = 2 * number - len(ports) + 1
            if side in ("left", "right"):
                rim, out = (width, 1) if side == "right" else (0, -1)
                places[name] = x, y = rim + out, height // 2 - along
                inner, text = (rim, y), (rim - out * (0.3 + 0.5 * text_width(name, TEXT_PT)), y)
            else:
                places[name] = x, y = width // 2 + along, (height + 1 if side == "up" else -1)
                inner, text = (x, min(max(y, 0), height)), (x, height - 0.7 if side == "up" else 0.7)
            strokes += [Shape("line", ((x, y), inner)), Shape("text", (text,), size=TEXT_PT, text=name)]
    return strokes, [places[port["name"]] for port in entry["ports"]]


def _points(shape: Shape) -> Points:
    """Return points that bound a shape."""
    if shape.word != "arc":
        return shape.points
    ((x, y),) = shape.points
    low, high = map(math.radians, shape.angles)
    steps = [low + (high - low) * k / 24 for k in range(25)]
    return tuple((x + shape.size * math.cos(angle), y + shape.size * math.sin(angle)) for angle in steps)


def _bounds(points: Sequence[tuple[float, float]]) -> Box:
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return min(xs), min(ys), max(xs), max(ys)


def _side(place: Place, box: Box) -> str:
    """Return the side of a symbol with a given port."""
    x, y = place
    away = {"left": x - box[0], "down": y - box[1], "right": box[2] - x, "up": box[3] - y}
    return min(away, key=lambda side: (away[side], side not in ("down", "up")))


def _label(name: str, one: Component, box: Box, taken: set[str]) -> Label:
    lines = (name, *_values(one))
    wide = box[2] - box[0] >= WIDE
    free = [side for side in (("up", "right", "left") if wide else ("right", "left", "up")) if side not in taken]
    middle = 0.5 * (box[1] + box[3]) + 0.5 * LINE * len(lines)
    places: dict[str, Callable[[], Label]] = {
        "right": lambda: Label(lines, box[2] + 0.7, middle, "left"),
        "left": lambda: Label(lines, box[0] - 0.7, middle, "right"),
        "up": lambda: Label(lines, box[0] + 0.2, box[3] + 0.5 + LINE * len(lines), "left"),
        "": lambda: Label(lines, box[2] + 0.7, box[3] + 0.5 + LINE * len(lines), "left"),  # beyond the corner
    }
    return places[free[0] if free else ""]()


def _values(one: Component) -> Iterator[str]:
    """Return the first values that the component's kind requires."""
    given = one.plain()
    shown = 0
    for parameter in one.entry["parameters"]:
        keys = [parameter["key"], *one.same_size(parameter["key"])]
        key = next((key for key in keys if key in given), None)
        if is_needed(parameter, given) and key is not None and shown < MOST_VALUES:
            shown += 1
            yield f"{_word(key)} {_typeset(given[key])}"


def _word(key: str) -> str:
    """Return a key as a label with common symbols: ``C needle`` for ``needle_conductance``."""
    if key == "critical_pressure_ratio":
        return "b"
    of, is_conductance, _ = key.rpartition("conductance")
    return f"C {of}".replace("_", " ").strip() if is_conductance else key.replace("_", " ")


def _typeset(value: object) -> str:
    number, space, unit = str(value).partition(" ")
    with suppress(ValueError):
        number = f"{float(number):.5g}".replace("e+0", "e").replace("e-0", "e-")
    unit = unit.replace("m3", "m\N{SUPERSCRIPT THREE}").replace("m2", "m\N{SUPERSCRIPT TWO}")
    return f"{number}{space}{unit}"
