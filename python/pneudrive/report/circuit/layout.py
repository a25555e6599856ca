"""Layout of a circuit drawing: components as blocks, their positions, and the paths of the lines between them.

A block has a symbol, ports and a label. Lengths are in modules, x right, y up.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain, pairwise
from typing import Any, NamedTuple

from pneudrive.arrays import Interval, Keyed
from pneudrive.describe import Circuit, Component
from pneudrive.describe.connections import Joint, Wiring, is_platform
from pneudrive.describe.kinds import flow_keys, is_needed
from pneudrive.errors import CommandError, package_table, wrong
from pneudrive.report.render import FONT, applied, load_matplotlib

Placed = Mapping[str, "Block"]
Beside = dict[str, str]  # component without gas -> the component that moves it
Pulls = dict[str, list[tuple[str, str, str]]]  # component -> its port, and component and port near which it is

MODULE_IN = 0.1  # inch, height of a module on paper
NAME_PT, TEXT_PT = 7.0, 6.0
LINE = 1.1  # line spacing of a label
WIDE = 10.0  # a symbol of this width has its label above, not beside
MOST_VALUES = 2  # in a label
DIRECTIONS = {"right": (1, 0), "left": (-1, 0), "up": (0, 1), "down": (0, -1)}
#: Mark of a port -> its strokes: kind, and corners along the direction of the port and across it.
MARKS: dict[str, tuple[tuple[Any, ...], ...]] = {
    "exhaust": (("triangle", (0.1, 0.45), (0.1, -0.45), (1.0, 0.0)),),  # open to the ambient air
    "shut": (("line", (-0.35, -0.35), (0.35, 0.35)), ("line", (-0.35, 0.35), (0.35, -0.35))),
}

_TABLES = package_table(__file__, "symbols.toml")
SYMBOLS = {kind: symbol for symbol in _TABLES["symbols"] for kind in symbol["kinds"]}

#: Corners of a rectangle: x and y of the lower left, x and y of the upper right.
Box = tuple[float, float, float, float]
Place = tuple[int, int]
Point = tuple[float, float]
Points = tuple[Point, ...]


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
        Component to which the shape belongs; empty for lines between components, title and notes.
    size : float
        Radius of an arc or a dot in modules, or size of a text in points.
    text : str
    align : str
        Alignment of a text: ``"center"``, ``"left"`` or ``"right"`` of its point. ``"top"`` is added if the text is
        below the point.
    angles : tuple of float
        First and last angle of an arc, in degrees counterclockwise from the x axis.
    net : int
        Index in `CircuitShapes.nets` for a line between components; -1 for other shapes.
    """

    word: str
    points: Points
    component: str = ""
    size: float = 0.0
    text: str = ""
    align: str = "center"
    angles: tuple[float, float] = (0.0, 360.0)
    net: int = -1

    def outline(self, words: Collection[str] = ("arc",), steps: int = 24) -> Points:
        """Return the points of the shape, or points along its outline if it is round and its `word` is in `words`."""
        if self.word not in words:
            return self.points
        ((x, y),), r, (low, high) = self.points, self.size, map(math.radians, self.angles)
        angles = [low + (high - low) * k / steps for k in range(steps + 1)]
        return tuple((x + r * math.cos(angle), y + r * math.sin(angle)) for angle in angles)


@dataclass
class Block:
    """A component in a drawing."""

    name: str
    strokes: Sequence[Shape]
    ports: Mapping[str, Place]
    directions: Mapping[str, str]  # side on which each port leaves
    symbol: Box
    label: Sequence[Shape]  # lines of text beside the symbol, each at the top of the label
    box: Box  # bounding box
    x: int = 0
    y: int = 0
    marks: dict[str, str] = field(default_factory=dict)  # port -> "exhaust" or "shut"

    def port(self, name: str) -> Place:
        """Return the position of a port."""
        return self.x + self.ports[name][0], self.y + self.ports[name][1]

    def rectangle(self) -> Box:
        """Return the bounding box at the position of the block."""
        low_x, low_y, high_x, high_y = self.box
        return self.x + low_x, self.y + low_y, self.x + high_x, self.y + high_y

    def cells(self) -> Iterator[Place]:
        """Yield the grid points that lines must not cross."""
        for low_x, low_y, high_x, high_y in (self.symbol, label_box(self.label)):
            for x in range(math.ceil(low_x - 0.4), math.floor(high_x + 0.4) + 1):
                for y in range(math.ceil(low_y - 0.4), math.floor(high_y + 0.4) + 1):
                    yield self.x + x, self.y + y
        for port in self.marks:
            (x, y), (across, up) = self.port(port), DIRECTIONS[self.directions[port]]
            yield x + across, y + up

    def shapes(self) -> Iterator[Shape]:
        """Yield the shapes of the symbol at its position, of its port marks, and of its label."""
        for stroke in self.strokes:
            yield stroke._replace(points=moved(stroke.points, self.x, self.y), component=self.name)
        for port, mark in self.marks.items():
            place, (dx, dy) = self.port(port), DIRECTIONS[self.directions[port]]
            for word, *corners in MARKS[mark]:
                points = [(along * dx + across * dy, along * dy + across * dx) for along, across in corners]
                yield Shape(word, moved(points, *place), self.name)
        for number, line in enumerate(self.label):
            ((x, y),) = line.points
            yield line._replace(points=((self.x + x, self.y + y - LINE * (number + 0.5)),))


def moved(points: Sequence[Any], x: float = 0.0, y: float = 0.0) -> Points:
    """Return the points as floats, moved by x and y."""
    return tuple((x + point[0], y + point[1]) for point in points)


def label_box(label: Sequence[Shape]) -> Box:
    """Return the rectangle of a label."""
    ((x, y),) = label[0].points
    width = max(text_width(line.text, line.size) for line in label)
    left = x if label[0].align == "left" else x - width
    return left, y - LINE * len(label), left + width, y


@lru_cache(maxsize=4096)
def text_width(text: str, points: float) -> float:
    """Return the width of a text, in modules."""
    load_matplotlib()
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    if not text.strip():
        return 0.0
    with applied():
        path = TextPath((0.0, 0.0), text, size=points, prop=FontProperties(family=FONT))
    return float(path.get_extents().width) / 72.0 / MODULE_IN


def _block(name: str, one: Component) -> Block:
    """Return the block of a component. Its position is set later."""
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
    box = bounds([*(point for stroke in strokes for point in stroke.outline()), *places])
    directions = {}  # side of the symbol on which each port leaves
    for port, (x, y) in ports.items():
        away = {"left": x - box[0], "down": y - box[1], "right": box[2] - x, "up": box[3] - y}
        directions[port] = min(away, key=lambda side: (away[side], side not in ("down", "up")))
    label = _label(name, one, box, set(directions.values()))
    whole = bounds([corner for one_box in (box, label_box(label)) for corner in (one_box[:2], one_box[2:])])
    return Block(name, strokes, ports, directions, box, label, whole)


def _drawn(strokes: Sequence[Keyed], right: float = 0.0) -> Iterator[Shape]:
    """Yield the shapes of strokes, moved by `right` modules to the right."""
    for stroke in strokes:
        if "use" in stroke:
            yield from _drawn(_TABLES["parts"][stroke["use"]], right + stroke.get("right", 0.0))
        else:
            points = tuple((right + x, float(y)) for x, y in stroke["points"])
            yield Shape(**{**stroke, "points": points})


def _plain(entry: Keyed) -> tuple[list[Shape], list[Place]]:
    """Return a box with a title and its ports: gas below, motion on the left."""
    title, ports = entry["title"].partition(",")[0], entry["ports"]
    widest = max(text_width(port["name"], TEXT_PT) for port in ports)
    pitch, places = 2 + math.ceil(widest), []
    width, height = max(math.ceil(text_width(title, TEXT_PT)) + 2 * pitch, pitch * len(ports)), 2 * len(ports) + 2
    strokes = [Shape("line", ((0, 0), (0, height), (width, height), (width, 0), (0, 0)))]
    texts = [(title, (0.5 * width, 0.5 * height))]
    for number, port in enumerate(ports, start=1):
        x, y = (pitch * number - 1, -1) if port["kind"] == "gas" else (-1, 2 * number)
        places.append((x, y))
        strokes.append(Shape("line", ((x, y), (max(x, 0), max(y, 0)))))
        texts.append((port["name"], (x, y + 1.7) if y < 0 else (x + 1.3 + 0.5 * widest, y)))
    return [*strokes, *(Shape("text", (at,), size=TEXT_PT, text=text) for text, at in texts)], places


def bounds(points: Iterable[Point], room: float = 0.0) -> Box:
    """Return the rectangle around points, with a margin `room` on all sides."""
    xs, ys = zip(*points, strict=True)
    return min(xs) - room, min(ys) - room, max(xs) + room, max(ys) + room


def _label(name: str, one: Component, box: Box, taken: set[str]) -> list[Shape]:
    """Return the label of a component (name and first required values), on a side without ports."""
    given, values = one.plain(), []
    for parameter in one.entry["parameters"]:
        keys = flow_keys(one.entry, parameter["key"])
        key = next((key for key in keys if key in given), None)
        if key is None or not is_needed(parameter, given):
            continue
        # Common symbols: ``C needle`` for ``needle_conductance``.
        of, is_conductance, _ = key.rpartition("conductance")
        symbol = f"C {of}" if is_conductance else "b" if key == "critical_pressure_ratio" else key
        number, space, unit = str(given[key]).partition(" ")
        with suppress(ValueError):
            number = f"{float(number):.5g}".replace("e+0", "e").replace("e-0", "e-")
        unit = unit.replace("m3", "m\N{SUPERSCRIPT THREE}").replace("m2", "m\N{SUPERSCRIPT TWO}")
        values.append(f"{symbol.replace('_', ' ').strip()} {number}{space}{unit}")
    lines = (name, *values[:MOST_VALUES])
    wide = box[2] - box[0] >= WIDE
    free = [side for side in (("up", "right", "left") if wide else ("right", "left", "up")) if side not in taken]
    middle = 0.5 * (box[1] + box[3]) + 0.5 * LINE * len(lines)
    places = {
        "right": (box[2] + 0.7, middle, "left"),
        "left": (box[0] - 0.7, middle, "right"),
        "up": (box[0] + 0.2, box[3] + 0.5 + LINE * len(lines), "left"),
        "": (box[2] + 0.7, box[3] + 0.5 + LINE * len(lines), "left"),  # beyond the corner
    }
    x, y, align = places[free[0] if free else ""]
    sizes = (NAME_PT, *[TEXT_PT] * MOST_VALUES)
    return [Shape("text", ((x, y),), name, size, text, align) for text, size in zip(lines, sizes, strict=False)]


# --- Places of the blocks, and ways of the lines between them.

BEND, CROSSING = 2, 6  # in steps
MARGIN = 6  # around all blocks
_STEPS = tuple(DIRECTIONS.values())
#: One step of a line, from the smaller point to the larger one.
Step = tuple[Place, Place]


class NoWayError(Exception):
    """No path was found for a line. The layout is repeated with more room between the blocks."""


class Routes:
    """The lines of a drawing.

    Parameters
    ----------
    placed : mapping
        Blocks by name, placed.
    joints : sequence of Joint
        Joints, each with two or more ports.

    Attributes
    ----------
    lines : list of dict
        For each joint: step of its line -> whether the step belongs to a pilot line.
    """

    def __init__(self, placed: Placed, joints: Sequence[Joint]) -> None:
        self.blocked = {cell for block in placed.values() for cell in block.cells()}
        self.bounds = bounds(self.blocked, MARGIN)
        self.through: dict[Place, dict[int, str]] = {}  # point -> net -> "h", "v", or "x" where it bends or branches
        self.lines: list[dict[Step, bool]] = [{} for _ in joints]
        # Positions of the ports of each joint, and whether only a pilot line leads to a port.
        nets = [{placed[port.component].port(port.name): port.is_pilot for port in joint.ports} for joint in joints]
        self.pins = {point for net in nets for point in net}
        # Other lines come before rods, short ones first. Of the rods, long ones come first, so that they do not cross.
        is_rods = list(map(is_rod, joints))
        reaches = (high_x - low_x + high_y - low_y for low_x, low_y, high_x, high_y in map(bounds, nets))
        order = [(rod, -reach if rod else reach) for rod, reach in zip(is_rods, reaches, strict=True)]
        for number in sorted(range(len(nets)), key=order.__getitem__):
            self._join(number, nets[number])

    def _join(self, net: int, is_pilot: Mapping[Place, bool]) -> None:
        """Join the ports of a net one by one, pilot ports last."""
        first = next(point for point, pilot in is_pilot.items() if not pilot)
        tree, left = {first}, [point for point in is_pilot if point != first]
        while left:
            goal = min(left, key=lambda point: (is_pilot[point], min(_far(point, own) for own in tree)))
            left.remove(goal)
            way = self._way(tree, goal)
            self.lines[net] |= {tuple(sorted(pair)): is_pilot[goal] for pair in pairwise(way)}  # type: ignore[misc]
            tree |= set(way)
        for point, ways in self._ways(net).items():
            is_straight = len(ways) == 2 and ways[0] == ways[1] and point not in self.pins
            self.through.setdefault(point, {})[net] = ways[0] if is_straight else "x"

    def _ways(self, net: int) -> dict[Place, list[str]]:
        """Return the directions, "h" or "v", of the steps of a line at each of its points."""
        ways: dict[Place, list[str]] = {}
        for low, high in self.lines[net]:
            for point in (low, high):
                ways.setdefault(point, []).append("h" if low[1] == high[1] else "v")
        return ways

    def _way(self, tree: Iterable[Place], goal: Place) -> list[Place]:
        """Return the cheapest path from any point of a net to a port, around the lines of earlier nets."""
        queue: list[tuple[float, float, Place, Place, list[Place]]] = []
        best: dict[tuple[Place, Place], float] = {}
        still = (0, 0)
        for point in sorted(tree):
            if point not in self.through:
                best[point, still] = 0
                heapq.heappush(queue, (_far(point, goal), 0, point, still, [point]))
        while queue:
            _, cost, point, last, way = heapq.heappop(queue)
            if point == goal:
                return way
            if cost > best[point, last]:
                continue
            crosses = last != still and point in self.through
            for step in _STEPS:
                if step == (-last[0], -last[1]) or (crosses and step != last):
                    continue
                to = point[0] + step[0], point[1] + step[1]
                new = cost + 1 + self._enter(to, step, goal) + (BEND if last not in (still, step) else 0)
                if new < best.get((to, step), math.inf):
                    best[to, step] = new
                    heapq.heappush(queue, (new + _far(to, goal), new, to, step, [*way, to]))
        raise NoWayError

    def _enter(self, to: Place, step: Place, goal: Place) -> float:
        """Return the extra cost of entering a point; infinite if no line may enter it."""
        low_x, low_y, high_x, high_y = self.bounds
        is_outside = not (low_x <= to[0] <= high_x and low_y <= to[1] <= high_y)
        is_full = to != goal and (to in self.blocked or to in self.pins)
        others, across = self.through.get(to, {}).values(), "v" if step[0] else "h"
        is_taken = any(way != across for way in others) or (others and to == goal)
        return math.inf if is_outside or is_full or is_taken else CROSSING * len(others)

    def runs(self, net: int, *, pilots: bool) -> list[Step]:
        """Return the longest straight parts of a net, either of its pilot lines or of its other lines."""
        out = []
        own = [step for step, is_pilot in self.lines[net].items() if is_pilot == pilots]
        for axis in (0, 1):
            along = (step for step in own if step[0][axis] == step[1][axis])
            steps = sorted(along, key=lambda step: (step[0][axis], step))
            for low, high in steps:
                if out and out[-1][1] == low and out[-1][0][axis] == out[-1][1][axis]:
                    out[-1] = out[-1][0], high
                else:
                    out.append((low, high))
        return out

    def shapes(self, joints: Sequence[Joint]) -> Iterator[Shape]:
        """Yield the lines of all joints, their pilot lines, and the dots where they branch."""
        for number, joint in enumerate(joints):
            for word, is_pilot in (("thick" if is_rod(joint) else "line", False), ("dashed", True)):
                for ends in self.runs(number, pilots=is_pilot):
                    yield Shape(word, moved(ends), net=number)
            for branch in sorted(point for point, ways in self._ways(number).items() if len(ways) > 2):
                yield Shape("dot", moved([branch]), size=0.28, net=number)


def _far(one: Place, other: Place) -> int:
    return abs(one[0] - other[0]) + abs(one[1] - other[1])


SWEEPS = 12
GAP = 3.0  # between blocks of a rank


def is_rod(joint: Joint) -> bool:
    """Return whether a joint couples motions, not gas."""
    return joint.ports[0].kind == "axis"


def place(circuit: Circuit, spread: float) -> tuple[dict[str, Block], list[Joint]]:
    """Set the positions of the components of a circuit. `spread` widens the space for lines between them.

    Raises
    ------
    DescriptionError
        Two components with `at` overlap.
    """
    placed = {name: _block(name, one) for name, one in circuit.components.items()}
    joints = []  # with a line between ports; a port that is open to the ambient air, or shut, gets a mark
    for joint in circuit.wiring.joints:
        if len(joint.ports) > 1 and not joint.ambient:
            joints.append(joint)
            continue
        for port in joint.ports:
            if joint.ambient or port.kind == "gas":
                placed[port.component].marks[port.name] = "exhaust" if joint.ambient else "shut"
    above = {name for name in placed if is_platform(circuit.components[name].entry)}
    beside = _beside(joints, circuit, above)
    ranks = _ranks(circuit.wiring, [name for name in placed if name not in beside and name not in above])
    ranks |= dict.fromkeys(above, 1 + max(ranks.values(), default=0))
    rows = {rank: [name for name in ranks if ranks[name] == rank] for rank in sorted(set(ranks.values()))}
    spans = [[ranks[port.component] for port in joint.ports if port.component in ranks] for joint in joints]
    # Components that an actuator moves, in columns by their number of couplings from the actuator; and the extent of
    # each block with these components to the left and right of its origin.
    columns, extent = {}, {}
    for name in ranks:
        reached = [[name]]
        while column := [other for other, mover in beside.items() if mover in reached[-1]]:
            reached.append(column)
        columns[name] = reached[1:]
        boxes = ([placed[other].box for other in column] for column in columns[name])
        widths = (max(box[2] - box[0] + 4 for box in column) for column in boxes)
        block, marked = placed[name], 1.0 if placed[name].marks else 0.0
        extent[name] = block.box[0] - marked, block.box[2] + sum(widths) + marked
    actuators = {name: actuator for actuator, moved in columns.items() for name in chain.from_iterable(moved)}
    _order(rows, extent, _pulls(joints, actuators, above), placed, spread)
    y = 0.0
    for rank, names in rows.items():
        row = [placed[name] for name in names]
        # Lines that lead to a higher row may each need a track.
        between = sum(min(span) <= rank < max(span) for span in spans if span)
        y += -min(block.box[1] for block in row)
        for block in row:
            block.y = round(y)
        y = math.ceil(y) + max(block.box[3] for block in row) + 3.0 * spread + 0.5 * spread * between
    for name in ranks:
        _put_beside(placed[name], columns[name], beside, placed)
    _fix(circuit, placed)
    return placed, joints


def _beside(joints: Sequence[Joint], circuit: Circuit, above: Collection[str]) -> Beside:
    """Return the components without gas that move with an actuator, each with the neighbour that moves it."""
    has_gas = {name for name in circuit.components if any(p.kind == "gas" for p in circuit.wiring.ports(name))}
    out: Beside = {}
    rods = [[port.component for port in joint.ports] for joint in joints if is_rod(joint)]
    for names in len(rods) * rods:  # each pass reaches at least one rod more
        movers = [name for name in names if name in has_gas or name in out]
        if movers:
            out |= {name: movers[0] for name in names if name not in movers and name not in above}
    return out


def _put_beside(actuator: Block, columns: Sequence[Sequence[str]], beside: Beside, placed: Placed) -> None:
    """Place the moved components to the right of their actuator, each at the height of the component that moves it."""
    last = actuator.x + actuator.box[2]
    for column in columns:
        floor = -math.inf
        for name in column:
            block, of = placed[name], placed[beside[name]]
            block.x = math.ceil(last - block.box[0] + 3)
            own = next(iter(block.ports.values()))[1]
            rods = [place[1] for port, place in of.ports.items() if of.directions[port] == "right"]
            first = of.y + (rods[0] if rods else math.ceil(of.symbol[3]) + 1) - own
            block.y = first if floor == -math.inf else max(first, math.ceil(floor - block.box[1]))
            floor = block.y + block.box[3] + 1
        last = max(placed[name].x + placed[name].box[2] for name in column)


def _ranks(wiring: Wiring, names: Sequence[str]) -> dict[str, int]:
    """Return the row of each component: its distance from the supply. Exhausts are below, and actuators are on top."""
    ports = {name: [port for port in wiring.ports(name) if port.kind == "gas"] for name in names}
    # A supply (a reservoir, a compressor) holds a pressure, or has a single port.
    supplies = [
        name
        for name, own in ports.items()
        if any(port.holds == "pressure" for port in own) or (len(own) == 1 and own[0].is_single)
    ]
    # Joined components, and whether an exhaust joins them.
    joined = {
        name: [(other.component, port.exhaust or other.exhaust)
               for port in own if port in wiring.at for other in wiring.at[port].ports]
        for name, own in ports.items()
    }  # fmt: skip
    todo = supplies or list(names[:1])
    known = dict.fromkeys(todo, 0)
    while len(known) < len(names):
        for name in todo:  # grows during the loop
            for other, is_exhaust in joined[name]:
                if other not in known and not is_exhaust:
                    known[other] = known[name] + 1
                    todo.append(other)
        left = [name for name in names if name not in known]
        # One row below the component that exhausts there.
        exhausts = ((name, other) for name in left for other, is_exhaust in joined[name] if is_exhaust)
        behind = [(name, known[other] - 1) for name, other in exhausts if other in known]
        todo = [] if behind else left[:1]
        known |= dict(behind[:1]) or dict.fromkeys(todo, 0)
    actuators = [name for name in names if len(ports[name]) and any(p.kind == "axis" for p in wiring.ports(name))]
    top = max([known[name] for name in actuators] + [rank + 1 for name, rank in known.items() if name not in actuators])
    return known | dict.fromkeys(actuators, top)


def _pulls(joints: Sequence[Joint], actuators: Mapping[str, str], above: Collection[str]) -> Pulls:
    """Return, for each component, pairs of its port and of the neighbouring port near which it is placed.

    A component carried by actuators is placed above them, without moving the actuators apart.
    """
    pulls: Pulls = {}
    rods = {port.component: port for joint in joints if is_rod(joint) for port in joint.ports}
    for joint in joints:
        for port in joint.ports:
            others = [other for other in joint.ports if other.component not in (port.component, *above)]
            if port.component in above:
                others = [rods.get(actuators.get(other.component, ""), other) for other in others]
            own = pulls.setdefault(port.component, [])
            own += [(port.name, other.component, other.name) for other in others]
    return pulls


def _order(
    rows: Mapping[int, list[str]],
    extent: Mapping[str, Interval],
    pulls: Pulls,
    placed: Placed,
    spread: float,
) -> None:
    """Order the blocks of each row near their connected blocks, in upward and downward passes."""
    for row in rows.values():
        x = 0.0
        for name in row:
            placed[name].x = round(x - extent[name][0])
            x += extent[name][1] - extent[name][0] + GAP * spread
    for sweep in range(SWEEPS):
        for rank in sorted(rows, reverse=sweep % 2 == 0):
            row, want = rows[rank], {}
            for name in row:
                aims = [
                    placed[other].port(end)[0] - placed[name].ports[port][0]
                    for port, other, end in pulls.get(name, ())
                    if other in extent and other not in row
                ]
                want[name] = sum(aims) / len(aims) if aims else placed[name].x
            row.sort(key=lambda name: (want[name], placed[name].x))
            places = _apart([want[name] for name in row], [extent[name] for name in row], GAP * spread)
            for name, x in zip(row, places, strict=True):
                placed[name].x = x


def _apart(want: Sequence[float], extents: Sequence[Interval], gap: float) -> list[int]:
    """Return positions that keep the blocks apart in this order, and are nearest to `want` (least squares)."""
    from scipy.optimize import isotonic_regression

    offsets = [0.0]
    for (_, right), (left, _) in pairwise(extents):
        offsets.append(offsets[-1] + math.ceil(right - left + gap))
    free = isotonic_regression([w - o for w, o in zip(want, offsets, strict=True)]).x
    return [round(value) + round(offset) for value, offset in zip(free.tolist(), offsets, strict=True)]


def _fix(circuit: Circuit, placed: Placed) -> None:
    """Move components to the positions in their description. Other components make room."""
    places = {name: at for name in placed if (at := circuit.components[name].at) is not None}
    standing: list[Block] = []
    for name, at in places.items():
        block = placed[name]
        block.x, block.y = map(round, at)
        for other in standing:
            if _overlap(block, other):
                left, low, right, high = other.rectangle()
                remedy = f"Move {name}; {other.name} fills x {left:.0f} .. {right:.0f}, y {low:.0f} .. {high:.0f}."
                raise wrong(f"components.{name}.at", f"{other.name} and {name} overlap", remedy=remedy)
        standing.append(block)
    for name, block in placed.items() if places else ():
        if name not in places:
            while any(_overlap(block, other) for other in standing):
                block.x += 1
            standing.append(block)


def _overlap(one: Block, other: Block) -> bool:
    (left, low, right, high), b = one.rectangle(), other.rectangle()
    return left - 1 < b[2] and b[0] - 1 < right and low - 1 < b[3] and b[1] - 1 < high


#: Factors on the room between blocks, tried in turn until all lines have a path.
SPREADS = (1.0, 1.4, 2.0, 3.0, 5.0)


def arranged(circuit: Circuit) -> tuple[dict[str, Block], list[Joint], Routes]:
    """Position the components and find a path for every line, with more space if necessary."""
    for spread in SPREADS:
        placed, joints = place(circuit, spread)
        with suppress(NoWayError):
            return placed, joints, Routes(placed, joints)
    rule = f"a path for each line, with up to {SPREADS[-1]:g} times the usual distance between components"
    raise CommandError(f"{circuit.name} cannot be drawn", rule=rule, remedy="Divide the circuit; draw each section.")
