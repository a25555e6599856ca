"""Lines between the ports of a drawing: at right angles on a grid, around blocks, with few bends and crossings."""

from __future__ import annotations

import heapq
from itertools import pairwise
from typing import TYPE_CHECKING

from pneudrive.report.circuit.blocks import DIRECTIONS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from pneudrive.report.circuit.blocks import Block, Place
    from pneudrive.report.circuit.layout import Net

BEND, CROSSING = 2, 6  # in steps
MARGIN = 6  # around all blocks
_STEPS = tuple(DIRECTIONS.values())
#: One step of a line, from the smaller point to the larger one.
Step = tuple["Place", "Place"]


class NoWayError(Exception):
    """Error: there is no way for a line. The drawing is repeated with more room between the blocks."""


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
