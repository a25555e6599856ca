"""The cells of a protocol (combinations of levels) in running order, and the table of planned cycles on a rig."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any, TypeVar

from pneudrive.repr_tables import Shown
from pneudrive.rig.interface import Hold, Move, Sampling
from pneudrive.rig.motion import Limits, move, step_samples

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.planning.protocol import AxisPosition, Pair, Protocol
    from pneudrive.rig.interface import Envelope, Identity, Step


T = TypeVar("T")


@dataclass(frozen=True)
class Cell:
    """One combination of the levels that are changed within a block.

    Attributes
    ----------
    kind : str
        ``sweep`` or ``stop``.
    pressures : Pair
    speed_m_s : float
        Speed of the sweep, or of the restart after the stop.
    direction : str
        ``both``, ``+x`` or ``-x``.
    turn : str
        ``up`` or ``down`` if a speed is measured twice, on the way up and down the list.
    stop_s, released, position
        Levels of a stop.
    """

    kind: str
    pressures: Pair
    speed_m_s: float
    direction: str
    turn: str = ""
    stop_s: float | None = None
    released: bool = False
    position: AxisPosition | None = None

    @cached_property
    def name(self) -> str:
        """Permanent name of the cell within its block: the middle part of a key."""
        speed = f"v{1e3 * self.speed_m_s:.6g}"
        if self.position is None:
            way = "" if self.direction == "both" else self.direction
            parts = [speed, self.pressures.name, way, self.turn]
        else:
            held = "released" if self.released else "held"
            parts = [f"t{self.stop_s:.6g}", self.pressures.name, speed, held, self.position.name, self.direction]
        return "/".join([self.kind, *(part for part in parts if part)])


def _sweep_levels(protocol: Protocol) -> list[tuple[str, float]]:
    """Return turn and speed of each point of the sweep at one pressure, in the requested order."""
    if protocol.speed is None:
        return []
    up, order = protocol.speed.levels_m_s, protocol.speed.order
    if order == "up-and-down":
        return [*(("up", speed) for speed in up), *(("down", speed) for speed in up[::-1])]
    return [("", speed) for speed in (up if order == "ascending" else up[::-1])]


def _stop_levels(protocol: Protocol) -> tuple[Sequence[Any], ...]:
    """Return the levels of the stops at one pressure: position, release, speed, direction, and duration innermost."""
    stop = protocol.stop
    if stop is None:
        return ((),)
    directions = ("+x", "-x") if protocol.directions == "both" else (protocol.directions,)
    return stop.position, stop.released, stop.restart_speed_m_s, directions, stop.durations_s


def cells_of(protocol: Protocol) -> tuple[list[Cell], list[Cell]]:
    """Return the cells of the sweep and of the stops, pressure outermost."""
    pairs, levels = protocol.pressure.levels, list(product(*_stop_levels(protocol)))
    turns = _sweep_levels(protocol)
    sweep = [Cell("sweep", pair, speed, protocol.directions, turn) for pair in pairs for turn, speed in turns]
    stops = [
        Cell("stop", pair, speed, direction, stop_s=stop_s, released=released, position=position)
        for pair in pairs
        for position, released, speed, direction, stop_s in levels
    ]
    return sweep, stops


def cycle_count(protocol: Protocol) -> int:
    """Return the number of points of all blocks without building them."""
    points = len(_sweep_levels(protocol)) + math.prod(map(len, _stop_levels(protocol)))
    blocks = math.prod(len(factor.levels) for factor in protocol.hard.values()) * protocol.order.replicates
    return points * len(protocol.pressure.levels) * protocol.repeats * blocks


@dataclass(frozen=True)
class Way:
    """The part of the stroke that a campaign uses, and the axis that moves there.

    Attributes
    ----------
    low_m, high_m : float
    limits : Limits
    """

    low_m: float
    high_m: float
    limits: Limits

    @classmethod
    def on(cls, protocol: Protocol, envelope: Envelope) -> Way:
        """Return the range of a protocol on a rig."""
        low, high = envelope.position_m
        given, margin = protocol.position.range, protocol.position.margin_m
        ends = (low + margin, high - margin) if given is None else (given[0].at(low, high), given[1].at(low, high))
        return cls(*ends, Limits(envelope.acceleration_m_s2, envelope.jerk_m_s3))

    @property
    def length_m(self) -> float:
        """Length of a stroke, m."""
        return self.high_m - self.low_m

    def cruise_s(self, speed_m_s: float) -> float:
        """Return the time at constant speed in a stroke, s; 0 if the ramps do not fit."""
        return max(self.length_m / speed_m_s - self.limits.ramp_time_s(speed_m_s), 0.0)


@lru_cache(maxsize=4096)
def _time_and_samples(step: Step, distance_m: float, limits: Limits, sampling: Sampling) -> tuple[float, int]:
    """Return time, s, and samples of a step from rest to rest, as `pneudrive.rig.motion.schedule` spaces them."""
    if isinstance(step, Hold):
        time_s = step.duration_s
    else:
        time_s = move(distance_m, step.speed_m_s, limits).duration_s if distance_m else 0.0
    return time_s, step_samples(time_s, isinstance(step, Move), sampling)


def axis_use(steps: Sequence[Step], way: Way, sampling: Sampling) -> tuple[float, int]:
    """Return the time of the axis for the steps of a cycle, moves and holds, s, and the number of samples."""
    at, time_s, samples = way.low_m, 0.0, int(bool(steps))
    for step in steps:
        distance = 0.0
        if isinstance(step, Move):
            distance, at = step.to_m - at, step.to_m
        step_s, count = _time_and_samples(step, distance, way.limits, sampling)
        time_s, samples = time_s + step_s, samples + count
    return time_s, samples


def ordered_blocks(protocol: Protocol) -> list[dict[str, str]]:
    """Return the levels of the hard-to-change factors block by block, one replicate after the other.

    Equal levels of the factor that is hardest to change follow each other, even if levels are shuffled.
    """
    blocks: list[dict[str, str]] = []
    for replicate in range(1, protocol.order.replicates + 1):
        shuffled: list[list[str]] = []
        for name, factor in protocol.hard.items():
            levels = factor.levels
            if protocol.order.kind == "randomised":
                levels = shuffle(levels, str, f"{protocol.seed}/replicate {replicate}/{name}")
            shuffled.append(levels)
        blocks += [dict(zip(protocol.hard, levels, strict=True)) for levels in product(*shuffled)]
    return blocks


def ordered_cells(protocol: Protocol, block: int) -> list[tuple[Cell, int]]:
    """Return the cells of a block with their repeat (from 1) in running order."""
    repeats = range(1, protocol.repeats + 1)
    families, kind = cells_of(protocol), protocol.order.kind
    if kind == "as-given":  # a change of pressure is slow: the list is repeated at each pressure
        order = {pair: index for index, pair in enumerate(protocol.pressure.levels)}
        listed = ([(cell, repeat) for repeat in repeats for cell in cells] for cells in families)
        return [entry for entries in listed for entry in sorted(entries, key=lambda entry: order[entry[0].pressures])]
    if kind == "interleaved":
        return [(cell, repeat) for repeat in repeats for cells in families for cell in _interleaved(cells)]
    every = [cell for cells in families for cell in cells]
    return [
        (cell, repeat)
        for repeat in repeats
        for cell in shuffle(every, lambda cell: cell.name, f"{protocol.seed}/b{block}/r{repeat}")
    ]


def shuffle(items: Sequence[T], name: Callable[[T], str], seed: str) -> list[T]:
    """Shuffle by the hash of seed and name.

    The order is equal on every machine and version, and independent of other items.
    """
    return sorted(items, key=lambda item: hashlib.sha256(f"{seed}\0{name(item)}".encode()).digest())


def alternate(items: Sequence[T]) -> list[T]:
    """Take items alternately from the first and the second half, which separates neighbouring levels in time.

    Examples
    --------
    >>> alternate([1, 2, 3, 4, 5])
    [1, 4, 2, 5, 3]
    """
    half = (len(items) + 1) // 2
    return [items[index // 2 + index % 2 * half] for index in range(len(items))]


def _interleaved(cells: list[Cell]) -> list[Cell]:
    """Alternate within each pressure; pressures follow one after the other."""
    by_pressure: dict[str, list[Cell]] = {}
    for cell in cells:
        by_pressure.setdefault(cell.pressures.name, []).append(cell)
    columns = [alternate(group) for group in alternate(list(by_pressure.values()))]
    return [cell for row in zip(*columns, strict=True) for cell in row]


#: Bytes per sample in a cycle's file: 15 (long stops) to 21 (fast sweeps) on simulated rigs, as `write_cycle`
#: writes it; `test_plan_on_rig` holds the estimate against files.
BYTES_PER_SAMPLE = 20.0
#: Bytes of a cycle's file beside its samples, measured likewise: Parquet's metadata and the header.
BYTES_PER_CYCLE = 5000.0


@dataclass(frozen=True)
class Planned:
    """A cycle of a plan.

    Attributes
    ----------
    cycle : Cycle
    axis_s : float
        Time of its moves and holds, exact for the axis' limits.
    wait_s : float
        Time before it: settling after a change of pressure, or the operator's work. Assumed, as in the protocol.
    samples : int
    cell : Cell or None
        Condition that it measures. None for a cycle that prepares or checks.
    """

    cycle: Cycle
    axis_s: float
    wait_s: float
    samples: int
    cell: Cell | None = None

    @property
    def time_s(self) -> float:
        """Total time, s."""
        return self.axis_s + self.wait_s

    @property
    def strokes(self) -> int:
        """Number of moves."""
        return sum(isinstance(step, Move) for step in self.cycle.steps)


@dataclass(frozen=True, repr=False)
class Plan(Shown):
    """The cycles of a protocol on a rig, in order.

    Attributes
    ----------
    protocol, identity, envelope
    planned : tuple of Planned
        In the order in which they are run.
    notes : tuple of str
        Cautions.
    """

    protocol: Protocol
    identity: Identity
    envelope: Envelope
    planned: tuple[Planned, ...]
    notes: tuple[str, ...] = field(default=())

    @cached_property
    def cycles(self) -> tuple[Cycle, ...]:
        """All cycles, in order."""
        return tuple(one.cycle for one in self.planned)

    @property
    def time_s(self) -> float:
        """Total time, s, without homing and changes of pressure."""
        return sum(one.time_s for one in self.planned)

    @property
    def samples(self) -> int:
        """Total number of samples."""
        return sum(one.samples for one in self.planned)

    @property
    def strokes(self) -> int:
        """Total number of moves."""
        return sum(one.strokes for one in self.planned)

    @property
    def bytes(self) -> float:
        """Size on disk, estimated by `BYTES_PER_SAMPLE`."""
        return size_of(self.planned)

    def remaining_s(self, done: set[str]) -> float:
        """Return the time of the cycles whose keys are not given, s."""
        return sum(one.time_s for one in self.planned if one.cycle.key not in done)


def size_of(planned: Iterable[Planned]) -> float:
    """Return the size on disk, bytes, estimated by `BYTES_PER_SAMPLE`; an operator's step writes a file too."""
    return sum(BYTES_PER_SAMPLE * one.samples + BYTES_PER_CYCLE for one in planned)
