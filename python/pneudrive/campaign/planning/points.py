"""The cells of a protocol (combinations of levels), and the cycle that measures each on a given rig."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.planning.protocol_values import AMBIENT
from pneudrive.rig.interface import Hold, Move, Sampling
from pneudrive.rig.motion import Limits, move
from pneudrive.rig.sampling import step_samples

if TYPE_CHECKING:
    from pneudrive.campaign.planning.protocol import Protocol
    from pneudrive.campaign.planning.protocol_values import Place
    from pneudrive.rig.interface import Envelope, Identity, Step
    from pneudrive.units import Pressure

#: Samples per stroke of a cycle that only prepares: enough to show a fault (assumed).
PREPARING = Sampling(samples_per_stroke=500, burst_rate_hz=0.0)
#: Rate of samples at rest while a sensor is checked (assumed).
CHECKING = Sampling(hold_rate_hz=1000.0, burst_rate_hz=0.0)


@dataclass(frozen=True)
class Pair:
    """Pressures in both chambers, as stated."""

    a: Pressure
    b: Pressure

    @property
    def name(self) -> str:
        """Part of a key: ``a0.5/b0.5``, bar gauge; ``a1.5abs`` if stated absolute."""
        return f"a{_bar(self.a)}/b{_bar(self.b)}"

    def absolute_pa(self, ambient_pa: float) -> tuple[float, float]:
        """Return both pressures as absolute pressures, Pa."""
        return self.a.absolute_pa(ambient_pa), self.b.absolute_pa(ambient_pa)


#: Chambers open to ambient.
VENTED = Pair(AMBIENT, AMBIENT)


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
    stop_s, released, place
        Levels of a stop.
    """

    kind: str
    pressures: Pair
    speed_m_s: float
    direction: str
    turn: str = ""
    stop_s: float | None = None
    released: bool = False
    place: Place | None = None

    @cached_property
    def name(self) -> str:
        """Permanent name of the cell within its block: the middle part of a key."""
        speed = f"v{1e3 * self.speed_m_s:.6g}"
        if self.place is None:
            way = "" if self.direction == "both" else self.direction
            parts = [speed, self.pressures.name, way, self.turn]
        else:
            held = "released" if self.released else "held"
            parts = [f"t{self.stop_s:.6g}", self.pressures.name, speed, held, self.place.name, self.direction]
        return "/".join([self.kind, *(part for part in parts if part)])

    def levels(self) -> dict[str, Any]:
        """Return the level of each factor by its name."""
        if self.place is None:
            return {"speed": self.speed_m_s, "turn": self.turn, "pressure": self.pressures.name}
        return {
            "stop": self.stop_s,
            "pressure": self.pressures.name,
            "restart": self.speed_m_s,
            "position": self.place.name,
            "axis": "released" if self.released else "held",
            "direction": self.direction,
        }


def pairs(protocol: Protocol) -> list[Pair]:
    """Return the pairs of pressures in the order given."""
    return [Pair(a, b) for a, b in protocol.pressure.levels]


def sweep_cells(protocol: Protocol) -> list[Cell]:
    """Return the cells of the sweep, pressure outermost, speeds in the requested order."""
    if protocol.speed is None:
        return []
    up = protocol.speed.levels_m_s
    order = protocol.speed.order
    runs = {
        "ascending": [("", up)],
        "descending": [("", up[::-1])],
        "up-and-down": [("up", up), ("down", up[::-1])],
    }[order]
    return [
        Cell("sweep", pair, speed, protocol.directions, turn)
        for pair in pairs(protocol)
        for turn, speeds in runs
        for speed in speeds
    ]


def stop_cells(protocol: Protocol) -> list[Cell]:
    """Return the cells of the stops, pressure outermost, durations innermost."""
    stop = protocol.stop
    if stop is None:
        return []
    directions = ("+x", "-x") if protocol.directions == "both" else (protocol.directions,)
    return [
        Cell("stop", pair, speed, direction, stop_s=duration, released=released, place=place)
        for pair in pairs(protocol)
        for place in stop.position
        for released in stop.released
        for speed in stop.restart_speed_m_s
        for direction in directions
        for duration in stop.durations_s
    ]


def cycle_count(protocol: Protocol) -> int:
    """Return the number of points of all blocks without building them."""
    stop, speed = protocol.stop, protocol.speed
    turns = 0 if speed is None else len(speed.levels_m_s) * (2 if speed.order == "up-and-down" else 1)
    if stop is not None:
        ways = 2 if protocol.directions == "both" else 1
        levels = (stop.position, stop.released, stop.restart_speed_m_s, stop.durations_s)
        turns += ways * math.prod(map(len, levels))
    blocks = math.prod(len(factor.levels) for factor in protocol.hard.values()) * protocol.order.replicates
    return turns * len(protocol.pressure.levels) * protocol.repeats * blocks


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


class Builder:
    """Builder of the cycles of one protocol on one rig.

    Parameters
    ----------
    protocol : Protocol
    identity : Identity
    envelope : Envelope
    """

    def __init__(self, protocol: Protocol, identity: Identity, envelope: Envelope) -> None:
        self.protocol, self.ambient_pa = protocol, identity.ambient_pressure_pa
        self.way = Way.on(protocol, envelope)
        self.first = pairs(protocol)[0]
        self.block, self.levels = 1, dict[str, str]()
        self._steps: dict[str, tuple[Step, ...]] = {}

    def begin_block(self, block: int, levels: dict[str, str]) -> None:
        """Begin a block at these levels of the hard-to-change factors."""
        self.block, self.levels = block, levels

    def point(self, cell: Cell, repeat: int) -> Cycle:
        """Return the cycle that measures a cell."""
        if cell.name not in self._steps:
            self._steps[cell.name] = self._sweep(cell) if cell.place is None else self._stop(cell)
        return self._cycle(
            f"{cell.name}/r{repeat}",
            cell.kind,
            self._steps[cell.name],
            cell.pressures,
            repeat=repeat,
            speed_m_s=cell.speed_m_s,
            stop_s=cell.stop_s,
            released=cell.released,
        )

    def strokes(self, speed_m_s: float) -> int:
        """Return the number of strokes of a sweep that gives the requested time at constant speed."""
        speeds = self.protocol.speed
        cruise = self.way.cruise_s(speed_m_s)
        if speeds is None or cruise == 0.0:
            return 1
        return min(max(math.ceil(speeds.settled_time_s / cruise), 1), speeds.most_strokes)

    def sentinel(self, number: int) -> Cycle:
        """Return a control run. They are counted from 1 in each block."""
        sentinel = self.protocol.sentinel
        assert sentinel is not None
        pair = self.first if sentinel.pressure is None else Pair(sentinel.pressure, sentinel.pressure)
        steps = self._out_and_back(sentinel.speed_m_s, 1)
        return self._cycle(f"sentinel/n{number}", "sentinel", steps, pair, speed_m_s=sentinel.speed_m_s)

    def warm_up(self, word: str, cycles: int, speed_m_s: float) -> Cycle:
        """Return the strokes of a warm-up or run-in."""
        return self._cycle(word, "warm-up", self._out_and_back(speed_m_s, cycles), self.first, sampling=PREPARING)

    def standing(self, kind: str, hold: Hold, pair: Pair, weight_kg: float | None = None) -> Cycle:
        """Return a cycle at rest: zero run, leak check or known weight."""
        return self._cycle(kind, kind, (hold,), pair, sampling=CHECKING, released=hold.released, weight_kg=weight_kg)

    def blank(self, word: str, speed_m_s: float) -> Cycle:
        """Return a blank stroke; `word` is before or after."""
        return self._cycle(f"blank-{word}", "blank", self._out_and_back(speed_m_s, 1), VENTED, speed_m_s=speed_m_s)

    def operator(self, word: str, text: str) -> Cycle:
        """Return an operator's step."""
        return self._cycle(f"operator/{word}", "operator", (), VENTED, text=text)

    def _cycle(
        self,
        key: str,
        kind: str,
        steps: tuple[Step, ...],
        pair: Pair,
        *,
        sampling: Sampling | None = None,
        **rest: Any,  # noqa: ANN401 - the optional fields of Cycle
    ) -> Cycle:
        return Cycle(
            f"b{self.block}/{key}",
            kind,
            steps,
            sampling or self.protocol.sampling,
            *pair.absolute_pa(self.ambient_pa),
            block=self.block,
            levels=self.levels,
            start_m=self.way.low_m,
            **rest,
        )

    def _out_and_back(self, speed_m_s: float, times: int) -> tuple[Step, ...]:
        return (Move(self.way.high_m, speed_m_s), Move(self.way.low_m, speed_m_s)) * times

    def _sweep(self, cell: Cell) -> tuple[Step, ...]:
        speeds = self.protocol.speed
        back = cell.speed_m_s if speeds is None or cell.direction == "both" else speeds.return_speed_m_s
        out_speed = back if cell.direction == "-x" else cell.speed_m_s
        back_speed = back if cell.direction == "+x" else cell.speed_m_s
        once = (Move(self.way.high_m, out_speed), Move(self.way.low_m, back_speed))
        return once * self.strokes(cell.speed_m_s)

    def _stop(self, cell: Cell) -> tuple[Step, ...]:
        """Return the steps of a stop: preconditioning, uninterrupted stroke, interrupted stroke, way back."""
        stop = self.protocol.stop
        assert stop is not None
        assert cell.place is not None
        assert cell.stop_s is not None
        low, high, back = self.way.low_m, self.way.high_m, stop.preconditioning.speed_m_s
        sign = 1.0 if cell.direction == "+x" else -1.0
        near, far = (low, high) if sign > 0.0 else (high, low)
        at = cell.place.at(low, high)
        begin = near if stop.approach_m is None else at - sign * stop.approach_m
        end = far if stop.recovery_m is None else at + sign * stop.recovery_m
        speed = cell.speed_m_s
        to_begin = [Move(near, back)] if begin == near else [Move(near, back), Move(begin, back)]
        steps: list[Step] = list(self._out_and_back(back, stop.preconditioning.strokes))
        steps += [*to_begin, Move(end, speed)] * stop.reference_strokes + to_begin
        if cell.stop_s == 0.0:
            steps += [Move(end, speed)]
        else:
            approach = stop.approach_speed_m_s or speed
            steps += [Move(at, approach), Hold(cell.stop_s, released=cell.released), Move(end, speed)]
        return _without_standing([*steps, Move(low, back)], low)


def _without_standing(steps: list[Step], start_m: float) -> tuple[Step, ...]:
    """Remove moves of zero length."""
    out: list[Step] = []
    at = start_m
    for step in steps:
        if isinstance(step, Move):
            if step.to_m == at:
                continue
            at = step.to_m
        out.append(step)
    return tuple(out)


@lru_cache(maxsize=4096)
def move_time_s(distance_m: float, speed_m_s: float, limits: Limits) -> float:
    """Return the time of a move from rest to rest, s."""
    return move(distance_m, speed_m_s, limits).duration_s if distance_m else 0.0


def step_times_s(cycle: Cycle, limits: Limits) -> list[float]:
    """Return the time of each step of a cycle, s."""
    at, out = cycle.start_m, []
    for step in cycle.steps:
        if isinstance(step, Move):
            assert at is not None
            out.append(move_time_s(step.to_m - at, step.speed_m_s, limits))
            at = step.to_m
        else:
            out.append(step.duration_s)
    return out


def cycle_time_s(cycle: Cycle, limits: Limits) -> float:
    """Return the time of the axis for a cycle, moves and holds, s."""
    return sum(step_times_s(cycle, limits))


def cycle_samples(cycle: Cycle, limits: Limits) -> int:
    """Return the number of samples of a cycle, as `pneudrive.rig.sampling.schedule` spaces them."""
    times = step_times_s(cycle, limits)
    steps = zip(times, cycle.steps, strict=True)
    return sum(_samples(time, isinstance(step, Move), cycle.sampling) for time, step in steps) + bool(cycle.steps)


@lru_cache(maxsize=4096)
def _samples(duration_s: float, moving: bool, sampling: Sampling) -> int:
    return step_samples(duration_s, moving, sampling)


def _bar(pressure: Pressure) -> str:
    return f"{pressure.value_pa / 1e5:.6g}{'' if pressure.gauge else 'abs'}"
