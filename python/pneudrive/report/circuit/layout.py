"""Places of the components of a drawing, and ways of the lines between them."""

from __future__ import annotations

import heapq
import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from pneudrive.describe.connections import Joint, Port, Wiring, is_platform
from pneudrive.errors import DescriptionError
from pneudrive.report.circuit.blocks import DIRECTIONS, Block, Place, blocks

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from pneudrive.describe.circuit import Circuit


BEND, CROSSING = 2, 6  # in steps
MARGIN = 6  # around all blocks
_STEPS = tuple(DIRECTIONS.values())
#: One step of a line, from the smaller point to the larger one.
Step = tuple["Place", "Place"]


class NoWayError(Exception):
    """A line has no way. The drawing is repeated with more room between the blocks."""


class Routes:
    """The lines of a drawing.

    Parameters
    ----------
    placed : mapping
        Blocks by name, placed.
    nets : sequence of Net

    Attributes
    ----------
    lines : list of set
        The steps of each net.
    pilots : list of set
        Steps that belong to pilot lines.
    """

    def __init__(self, placed: Mapping[str, Block], nets: Sequence[Net]) -> None:
        self.blocked = {cell for block in placed.values() for cell in block.cells()}
        self.bounds = _around(self.blocked)
        self.pins = {point: number for number, net in enumerate(nets) for point in net.points(placed)}
        self.through: dict[Place, dict[int, str]] = {}  # point -> net -> "h", "v", or "x" where it bends or branches
        self.lines: list[set[Step]] = [set() for _ in nets]
        self.pilots: list[set[Step]] = [set() for _ in nets]
        points = [net.points(placed) for net in nets]
        # Short lines first; but of the rods below a platform the outermost first, so that they do not cross.
        is_rod = [net.kind == "axis" for net in nets]
        order = [(rod, -_reach(own) if rod else _reach(own)) for rod, own in zip(is_rod, points, strict=True)]
        for number in sorted(range(len(nets)), key=order.__getitem__):
            self._join(number, points[number], {nets[number].point(placed, pin) for pin in nets[number].pilots})

    def _join(self, net: int, points: Sequence[Place], pilots: Collection[Place]) -> None:
        """Join the ports of a net one by one, pilot ports last."""
        first = next(point for point in points if point not in pilots)
        tree, left = {first}, [point for point in points if point != first]
        while left:
            goal = min(left, key=lambda point: (point in pilots, min(_far(point, own) for own in tree)))
            left.remove(goal)
            if goal in tree:
                continue
            way = self._way(net, tree, goal)
            steps: set[Step] = {tuple(sorted(pair)) for pair in pairwise(way)}  # type: ignore[misc]
            self.lines[net] |= steps
            self.pilots[net] |= steps if goal in pilots else set()
            tree |= set(way)
        for point in tree:
            self.through.setdefault(point, {})[net] = self._kind(net, point)

    def _kind(self, net: int, point: Place) -> str:
        ways = [d for d in _STEPS if tuple(sorted((point, (point[0] + d[0], point[1] + d[1])))) in self.lines[net]]
        if len(ways) != 2 or point in self.pins:
            return "x"
        (ax, _), (bx, _) = ways
        return "x" if abs(ax) != abs(bx) else "h" if ax else "v"

    def _way(self, net: int, tree: Iterable[Place], goal: Place) -> list[Place]:
        """Return the cheapest way from any point of a net to a port."""
        queue: list[tuple[int, int, Place, Place]] = []
        best: dict[tuple[Place, Place], int] = {}
        came: dict[tuple[Place, Place], tuple[Place, Place]] = {}
        still = (0, 0)
        for point in sorted(tree):
            if not any(other != net for other in self.through.get(point, ())):
                best[point, still] = 0
                heapq.heappush(queue, (_far(point, goal), 0, point, still))
        while queue:
            _, cost, point, last = heapq.heappop(queue)
            if point == goal:
                return self._back(came, (point, last))
            if cost > best[point, last]:
                continue
            crosses = last != still and any(other != net for other in self.through.get(point, ()))
            for step in _STEPS:
                if step == (-last[0], -last[1]) or (crosses and step != last):
                    continue
                to = point[0] + step[0], point[1] + step[1]
                extra = self._enter(net, to, step, goal)
                if extra is None:
                    continue
                new = cost + 1 + extra + (BEND if last not in (still, step) else 0)
                if new < best.get((to, step), 1 << 30):
                    best[to, step] = new
                    came[to, step] = point, last
                    heapq.heappush(queue, (new + _far(to, goal), new, to, step))
        raise NoWayError

    def _enter(self, net: int, to: Place, step: Place, goal: Place) -> int | None:
        """Return the extra cost of entering a point; None if no line may enter it."""
        low_x, low_y, high_x, high_y = self.bounds
        if not (low_x <= to[0] <= high_x and low_y <= to[1] <= high_y):
            return None
        if to != goal and (to in self.blocked or to in self.pins):
            return None
        others = [way for other, way in self.through.get(to, {}).items() if other != net]
        across = "v" if step[0] else "h"
        if any(way != across for way in others) or (others and to == goal):
            return None
        return CROSSING * len(others)

    def _back(self, came: Mapping[tuple[Place, Place], tuple[Place, Place]], at: tuple[Place, Place]) -> list[Place]:
        way = [at[0]]
        while at in came:
            at = came[at]
            way.append(at[0])
        return way[::-1]

    def branches(self, net: int) -> list[Place]:
        """Return the points at which more than two parts of a line meet."""
        count: dict[Place, int] = {}
        for step in self.lines[net]:
            for point in step:
                count[point] = count.get(point, 0) + 1
        return sorted(point for point, number in count.items() if number > 2)

    def runs(self, net: int, *, pilots: bool) -> list[Step]:
        """Return the longest straight parts of a line: of its pilot lines, or of the rest."""
        out = []
        own = self.pilots[net] if pilots else self.lines[net] - self.pilots[net]
        for axis in (0, 1):
            steps = sorted((step for step in own if step[0][axis] == step[1][axis]), key=lambda s: (s[0][axis], s))
            for low, high in steps:
                if out and out[-1][1] == low and out[-1][0][axis] == out[-1][1][axis]:
                    out[-1] = out[-1][0], high
                else:
                    out.append((low, high))
        return out


def _around(cells: Iterable[Place]) -> tuple[int, int, int, int]:
    cells = list(cells)
    xs, ys = [x for x, _ in cells], [y for _, y in cells]
    return min(xs) - MARGIN, min(ys) - MARGIN, max(xs) + MARGIN, max(ys) + MARGIN


def _reach(points: Sequence[Place]) -> int:
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return max(xs) - min(xs) + max(ys) - min(ys)


def _far(one: Place, other: Place) -> int:
    return abs(one[0] - other[0]) + abs(one[1] - other[1])


SWEEPS = 12
GAP = 3.0  # between blocks of a rank


class Net(NamedTuple):
    """Ports that one line joins."""

    pins: tuple[tuple[str, str], ...]  # component, port
    kind: str  # "gas" or "axis"
    pilots: tuple[tuple[str, str], ...] = ()  # pilot ports

    @staticmethod
    def point(placed: Mapping[str, Block], pin: tuple[str, str]) -> Place:
        """Return the position of a port."""
        return placed[pin[0]].port(pin[1])

    def points(self, placed: Mapping[str, Block]) -> list[Place]:
        """Return the positions of the ports."""
        return [self.point(placed, pin) for pin in self.pins]


def nets(circuit: Circuit, placed: Mapping[str, Block]) -> list[Net]:
    """Return the lines between ports; a port open to the ambient air, or shut, gets a mark at its block."""
    out = []
    for joint in circuit.wiring.joints:
        pins = tuple((port.component, port.name) for port in joint.ports)
        if joint.ambient:
            for name, port in pins:
                placed[name].marks[port] = "exhaust"
        elif len(pins) > 1:
            kind = "axis" if joint.ports[0].kind == "axis" else "gas"
            out.append(Net(pins, kind, tuple((port.component, port.name) for port in joint.ports if port.is_pilot)))
        elif pins and joint.ports[0].kind == "gas":
            placed[pins[0][0]].marks[pins[0][1]] = "shut"
    return out


def place(circuit: Circuit, spread: float) -> tuple[dict[str, Block], list[Net]]:
    """Place the components of a circuit; `spread` widens the room for lines between them.

    Raises
    ------
    DescriptionError
        If two components with `at` overlap.
    """
    placed = blocks(circuit)
    lines = nets(circuit, placed)
    above = {name for name in placed if is_platform(circuit.components[name].entry)}
    beside = _beside(lines, circuit, above)
    ranks = _ranks(circuit.wiring, [name for name in placed if name not in beside and name not in above])
    ranks |= dict.fromkeys(above, 1 + max(ranks.values(), default=0))
    for name, rank in ranks.items():
        placed[name].rank = rank
    groups = {name: [name, *(other for other, (of, _) in beside.items() if of == name)] for name in ranks}
    rows: dict[int, list[str]] = {}
    for name, rank in sorted(ranks.items(), key=lambda item: item[1]):
        rows.setdefault(rank, []).append(name)
    extent = {name: _group_extent(groups[name], beside, placed) for name in ranks}
    _order(rows, extent, _pulls(lines, beside, above), placed, spread)
    y = 0.0
    for rank in sorted(rows):
        row = [placed[name] for name in rows[rank]]
        between = sum(_parts(line, rows[rank], ranks) for line in lines)
        y += -min(block.box[1] for block in row)
        for block in row:
            block.y = round(y)
        y = math.ceil(y) + max(block.box[3] for block in row) + 3.0 * spread + 0.5 * spread * between
    for group in groups.values():
        _put_beside(group, beside, placed)
    _fix(circuit, placed)
    return placed, lines


def _parts(line: Net, row: Sequence[str], ranks: Mapping[str, int]) -> int:
    """Return 1 if a line goes to a higher row and may need a separate track, otherwise 0."""
    found = [ranks[name] for name, _ in line.pins if name in ranks]
    return int(bool(found) and min(found) <= ranks[row[0]] < max(found))


def _beside(lines: Sequence[Net], circuit: Circuit, above: Collection[str]) -> dict[str, tuple[str, str]]:
    """Return the components without gas that move with an actuator, each with the neighbour that moves it."""
    has_gas = {name for name in circuit.components if any(p.kind == "gas" for p in circuit.wiring.ports(name))}
    out: dict[str, tuple[str, str]] = {}
    found = {name: name for name in has_gas}
    grows = True
    while grows:
        grows = False
        for line in (line for line in lines if line.kind == "axis"):
            known = next((name for name, _ in line.pins if name in found), None)
            new = [name for name, _ in line.pins if name not in found and name not in above]
            if known is not None and new:
                found |= dict.fromkeys(new, found[known])
                out |= dict.fromkeys(new, (found[known], known))
                grows = True
    return out


def _columns(names: Sequence[str], beside: Mapping[str, tuple[str, str]]) -> list[list[str]]:
    """Return the neighbours of an actuator in columns, by their distance in the chain of motion."""
    columns = [[names[0]]]
    while column := [name for name in names[1:] if beside[name][1] in columns[-1]]:
        columns.append(column)
    return columns[1:]


def _put_beside(names: Sequence[str], beside: Mapping[str, tuple[str, str]], placed: Mapping[str, Block]) -> None:
    """Place the moved components to the right of their actuator, each at the height of the component that moves it."""
    last = placed[names[0]].x + placed[names[0]].box[2]
    for column in _columns(names, beside):
        floor = -math.inf
        for name in column:
            block, of = placed[name], placed[beside[name][1]]
            block.x = math.ceil(last - block.box[0] + 3)
            own = next(iter(block.ports.values()))[1]
            rods = [place[1] for port, place in of.ports.items() if of.directions[port] == "right"]
            first = of.y + (rods[0] if rods else math.ceil(of.symbol[3]) + 1) - own
            block.y = first if floor == -math.inf else max(first, math.ceil(floor - block.box[1]))
            floor = block.y + block.box[3] + 1
        last = max(placed[name].x + placed[name].box[2] for name in column)


def _group_extent(
    names: Sequence[str], beside: Mapping[str, tuple[str, str]], placed: Mapping[str, Block]
) -> tuple[float, float]:
    """Return the extent of a block to the left and right of its origin, including its neighbours."""
    own = placed[names[0]]
    widths = (max(placed[name].box[2] - placed[name].box[0] + 4 for name in c) for c in _columns(names, beside))
    marked = 1.0 if own.marks else 0.0
    return own.box[0] - marked, own.box[2] + sum(widths) + marked


def _ranks(wiring: Wiring, names: Sequence[str]) -> dict[str, int]:
    """Return the distance of each component from the supply. Exhaust parts are below, and actuators are on top."""
    known: dict[str, int] = {}
    ports = {name: [port for port in wiring.ports(name) if port.kind == "gas"] for name in names}
    first = [name for name in names if _is_supply(ports[name])] or list(names[:1])
    todo = list(first)
    known |= dict.fromkeys(first, 0)
    while len(known) < len(names):
        for name in todo:  # grows during the loop
            for port in ports[name]:
                joint = wiring.at.get(port)
                for other in joint.ports if joint is not None and not port.exhaust else ():
                    if other.component not in known and not other.exhaust:
                        known[other.component] = known[name] + 1
                        todo.append(other.component)
        left = [name for name in names if name not in known]
        if left:
            name = next((one for one in left if _behind(one, ports, wiring, known) is not None), left[0])
            known[name] = _behind(name, ports, wiring, known) or 0
            todo = [name] if _behind(name, ports, wiring, known) is None else []
    actuators = [name for name in names if len(ports[name]) and any(p.kind == "axis" for p in wiring.ports(name))]
    top = max([known[name] for name in actuators] + [rank + 1 for name, rank in known.items() if name not in actuators])
    return known | dict.fromkeys(actuators, top)


def _is_supply(ports: Sequence[Port]) -> bool:
    """Return whether a component with these ports supplies gas: a reservoir, a compressor."""
    return any(port.holds == "pressure" for port in ports) or (len(ports) == 1 and ports[0].is_single)


def _behind(name: str, ports: Mapping[str, Sequence[object]], wiring: Wiring, known: Mapping[str, int]) -> int | None:
    """Return the rank of a component at an exhaust: below the component of the exhaust."""
    for port in ports[name]:
        joint: Joint | None = wiring.at.get(port)  # type: ignore[call-overload]
        for other in joint.ports if joint is not None else ():
            if other.component in known and (other.exhaust or port.exhaust):  # type: ignore[attr-defined]
                return known[other.component] - 1
    return None


def _pulls(
    lines: Sequence[Net], beside: Mapping[str, tuple[str, str]], above: Collection[str]
) -> dict[str, list[tuple[str, str, str]]]:
    """Return the ports, and the ports of other components near which a component is placed.

    A component that actuators carry is placed above them. The actuators are not moved apart for this component.
    """
    pulls: dict[str, list[tuple[str, str, str]]] = {}
    rods = {name: (name, port) for line in lines if line.kind == "axis" for name, port in line.pins}
    for line in lines:
        for name, port in line.pins:
            others = [pin for pin in line.pins if pin[0] != name and pin[0] not in above]
            if name in above:
                others = [rods[beside[other][0]] if other in beside else (other, end) for other, end in others]
            pulls.setdefault(name, []).extend((port, *other) for other in others)
    return pulls


def _order(
    rows: Mapping[int, list[str]],
    extent: Mapping[str, tuple[float, float]],
    pulls: Mapping[str, Sequence[tuple[str, str, str]]],
    placed: Mapping[str, Block],
    spread: float,
) -> None:
    """Order the blocks of each row near the blocks they are joined to, upward and downward."""
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
                    if other in placed and placed[other].rank != rank and other in extent
                ]
                want[name] = sum(aims) / len(aims) if aims else float(placed[name].x)
            row.sort(key=lambda name: (want[name], placed[name].x))
            for name, x in zip(
                row, _apart([want[n] for n in row], [extent[n] for n in row], GAP * spread), strict=True
            ):
                placed[name].x = x


def _apart(want: Sequence[float], extents: Sequence[tuple[float, float]], gap: float) -> list[int]:
    """Return places in this order that keep blocks apart and are nearest to the wanted places (least squares)."""
    offsets = [0.0]
    for (_, right), (left, _) in pairwise(extents):
        offsets.append(offsets[-1] + math.ceil(right - left + gap))
    pools: list[tuple[float, int]] = []  # mean, number: pool adjacent violators
    for value in (w - o for w, o in zip(want, offsets, strict=True)):
        mean, count = value, 1
        while pools and pools[-1][0] > mean:
            before, many = pools.pop()
            mean, count = (before * many + mean * count) / (many + count), many + count
        pools.append((mean, count))
    free = [mean for mean, count in pools for _ in range(count)]
    return [round(value) + round(offset) for value, offset in zip(free, offsets, strict=True)]


def _fix(circuit: Circuit, placed: Mapping[str, Block]) -> None:
    """Move components to the places in their description; others make room."""
    for name, block in placed.items():
        at = circuit.components[name].at
        if at is not None:
            block.x, block.y, block.is_fixed = round(at[0]), round(at[1]), True
    fixed = [block for block in placed.values() if block.is_fixed]
    for number, block in enumerate(fixed):
        for other in fixed[:number]:
            if _overlap(block, other):
                remedy = f"Move {block.name}; {other.name} takes x {_range(other, 0)}, y {_range(other, 1)}."
                error = DescriptionError(f"{other.name} and {block.name} overlap", remedy=remedy)
                error.key = f"components.{block.name}.at"
                raise error
    standing = list(fixed)
    for block in placed.values() if fixed else ():
        if not block.is_fixed:
            while any(_overlap(block, other) for other in standing):
                block.x += 1
            standing.append(block)


def _range(block: Block, axis: int) -> str:
    rectangle = block.rectangle()
    return f"{rectangle[axis]:.0f} .. {rectangle[axis + 2]:.0f}"


def _overlap(one: Block, other: Block) -> bool:
    a, b = one.rectangle(), other.rectangle()
    return a[0] - 1 < b[2] and b[0] - 1 < a[2] and a[1] - 1 < b[3] and b[1] - 1 < a[3]
