"""The plan of a campaign on a rig: design points (combinations of levels) in running order, cycles, and a summary.

The summary lists the blocks with their time and amount of data, and the result of the pre-flight check.
"""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import groupby, product
from typing import Any, TypeVar

from pneudrive.batching import many_objects
from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.planning.planned import BYTES_PER_SAMPLE, Cell, Plan, Planned, Way, size_of
from pneudrive.campaign.planning.preflight import ROUNDING, check, margins, millimetres
from pneudrive.campaign.planning.protocol import VENTED, Pair, Protocol
from pneudrive.constants import STANDARD_GRAVITY_M_S2
from pneudrive.errors import ProtocolError
from pneudrive.files.bounds import within
from pneudrive.numbers import duration
from pneudrive.repr_tables import aligned
from pneudrive.rig.interface import Envelope, Hold, Identity, Move, Sampling, Step, as_json, identity_of
from pneudrive.rig.motion import Limits, move, step_samples

T = TypeVar("T")


def _sweep_levels(protocol: Protocol) -> list[tuple[str, float]]:
    """Return the branch (up or down) and speed of each sweep point at one pressure, in the requested order."""
    if protocol.speed is None:
        return []
    up, order = protocol.speed.levels_m_s, protocol.speed.order
    if order == "up-and-down":
        return [*(("up", speed) for speed in up), *(("down", speed) for speed in up[::-1])]
    return [("", speed) for speed in (up if order == "ascending" else up[::-1])]


def _stop_levels(protocol: Protocol) -> tuple[Sequence[Any], ...]:
    """Return the stop levels at one pressure: position (varies slowest), release, speed, direction, duration."""
    stop = protocol.stop
    if stop is None:
        return ((),)
    directions = ("+x", "-x") if protocol.directions == "both" else (protocol.directions,)
    return stop.position, stop.released, stop.restart_speed_m_s, directions, stop.durations_s


def cycle_count(protocol: Protocol) -> int:
    """Return the number of points in all blocks, without building the blocks."""
    points = len(_sweep_levels(protocol)) + math.prod(map(len, _stop_levels(protocol)))
    blocks = math.prod(len(factor.levels) for factor in protocol.hard.values()) * protocol.order.replicates
    return points * len(protocol.pressure.levels) * protocol.repeats * blocks


@lru_cache(maxsize=4096)
def _time_and_samples(step: Step, distance_m: float, limits: Limits, sampling: Sampling) -> tuple[float, int]:
    """Return time, s, and number of samples of a step from rest to rest; see `pneudrive.rig.motion.step_times`."""
    if isinstance(step, Hold):
        time_s = step.duration_s
    else:
        time_s = move(distance_m, step.speed_m_s, limits).duration_s if distance_m else 0.0
    return time_s, step_samples(time_s, isinstance(step, Move), sampling)


def axis_use(steps: Sequence[Step], way: Way, sampling: Sampling) -> tuple[float, int]:
    """Return the duration of the moves and holds of a cycle, s, and the number of samples."""
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

    Even if levels are shuffled, equal levels of the hardest-to-change factor stay together.
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
    """Return the design points of a block in running order, each with its repeat number from 1."""
    repeats, kind, levels = range(1, protocol.repeats + 1), protocol.order.kind, protocol.pressure.levels
    turns, stops = _sweep_levels(protocol), list(product(*_stop_levels(protocol)))
    families = (
        [Cell("sweep", pair, speed, protocol.directions, turn) for pair in levels for turn, speed in turns],
        [
            Cell("stop", pair, speed, direction, stop_s=stop_s, released=released, position=position)
            for pair in levels
            for position, released, speed, direction, stop_s in stops
        ],
    )
    if kind == "as-given":  # a change of pressure is slow: the list is repeated at each pressure
        listed = ([(cell, repeat) for repeat in repeats for cell in cells] for cells in families)
        return [
            entry for entries in listed for entry in sorted(entries, key=lambda entry: levels.index(entry[0].pressures))
        ]
    if kind == "interleaved":
        return [(cell, repeat) for repeat in repeats for cells in families for cell in _interleaved(cells)]
    every = [cell for cells in families for cell in cells]
    return [
        (cell, repeat)
        for repeat in repeats
        for cell in shuffle(every, lambda cell: cell.name, f"{protocol.seed}/b{block}/r{repeat}")
    ]


def shuffle(items: Sequence[T], name: Callable[[T], str], seed: str) -> list[T]:
    """Shuffle items by the hash of the seed and the name of each item.

    The relative order of two items is the same on every machine and does not depend on other items.
    """
    return sorted(items, key=lambda item: hashlib.sha256(f"{seed}\0{name(item)}".encode()).digest())


def alternate(items: Sequence[T]) -> list[T]:
    """Take items alternately from both halves, so that neighbouring levels are apart in time.

    Examples
    --------
    >>> alternate([1, 2, 3, 4, 5])
    [1, 4, 2, 5, 3]
    """
    half = (len(items) + 1) // 2
    return [items[index // 2 + index % 2 * half] for index in range(len(items))]


def _interleaved(cells: list[Cell]) -> list[Cell]:
    """Order the levels of each pressure by `alternate`, and keep the order of the pressures."""
    by_pressure = [list(group) for _, group in groupby(cells, key=lambda cell: cell.pressures)]
    columns = [alternate(group) for group in alternate(by_pressure)]
    return [cell for row in zip(*columns, strict=True) for cell in row]


# --- Layout of a protocol, and its text.

#: Sampling of preparatory cycles: enough samples per stroke to show a fault (assumed).
PREPARING = Sampling(samples_per_stroke=500, burst_rate_hz=0.0)
#: Sampling rate at rest while a sensor is checked (assumed).
CHECKING = Sampling(hold_rate_hz=1000.0, burst_rate_hz=0.0)


def lay_out(protocol: Protocol, identity: Identity, envelope: Envelope) -> Plan:
    """Lay out a protocol for a rig and check it against the rig's limits.

    The same arguments give the same plan, on every machine; keys of cycles do not depend on other cycles.

    Parameters
    ----------
    protocol : Protocol
    identity : Identity
        Ambient pressure, areas and masses of the rig. A resumed campaign reads them from its folder.
    envelope : Envelope

    Returns
    -------
    Plan

    Raises
    ------
    ProtocolError
        If the plan exceeds the rig's limits; the message names cycle, value, limit and remedy.
    RigError
        If the identity has an impossible value.
    """
    # The description of a custom rig goes into its folder, and must be readable from there.
    identity_of(as_json(identity.to_dict()), f'rig "{identity.name}"')
    plan = draft(protocol, identity, envelope)
    return replace(plan, notes=check(plan))


def draft(protocol: Protocol, identity: Identity, envelope: Envelope) -> Plan:
    """Lay out a protocol without a check against the rig's limits; `lay_out` does both."""
    way, (low, high) = Way.on(protocol, envelope), envelope.position_m
    if way.length_m <= 0.0 or way.low_m < low - ROUNDING or way.high_m > high + ROUNDING:
        raise protocol.fail(
            "position",
            f"the campaign would move from {millimetres(way.low_m)} to {millimetres(way.high_m)}",
            rule=f"the axis may move from {millimetres(low)} to {millimetres(high)}",
            remedy="Change [position] range or margin.",
        )
    count = cycle_count(protocol)
    within("cycles", count, f"the protocol asks for {count:,} cycles or more", ProtocolError, protocol.origin)
    with many_objects():
        planned = _Layout(protocol, identity, envelope).run()
    keys = Counter(p.cycle.key for p in planned)
    for key, times in keys.items():
        if times > 1:
            rule = "levels must differ within 6 significant digits"
            raise ProtocolError(f"two cycles have the key {key}", where=protocol.origin, rule=rule)
    return Plan(protocol, identity, envelope, tuple(planned))


class _Layout:
    """Builder of the cycles of a plan, block by block in running order."""

    def __init__(self, protocol: Protocol, identity: Identity, envelope: Envelope) -> None:
        self.protocol, self.ambient_pa = protocol, identity.ambient_pressure_pa
        self.way = Way.on(protocol, envelope)
        self.first = protocol.pressure.levels[0]
        self.block, self.levels = 0, dict[str, str]()
        self.planned: list[Planned] = []
        self._uses: dict[str, tuple[tuple[Step, ...], float, int]] = {}  # cell or key -> steps, axis time, samples
        self._pressures = VENTED.absolute_pa(self.ambient_pa)

    def run(self) -> list[Planned]:
        """Return the cycles of all blocks."""
        for levels in ordered_blocks(self.protocol):
            before, self.levels = self.levels, levels
            self.block += 1
            self._block(before, ordered_cells(self.protocol, self.block))
        return self.planned

    def _block(self, before: dict[str, str], cells: list[tuple[Cell, int]]) -> None:
        p, levels, blank_m_s = self.protocol, self.levels, self.protocol.before_block.blank_stroke_m_s
        for name, factor in p.hard.items():
            if before.get(name) != levels[name] or (self.block > 1 and before == levels):
                ask = factor.ask or f"{name}: {{level}}. Confirm when it is in place."
                self._operator(name, ask.replace("{level}", levels[name]), factor.time_s)
        self._prepare(new=self.block == 1 or any(before.get(name) != levels.get(name) for name in ("seal", "drive")))
        if blank_m_s is not None:
            self._add("blank-before", "blank", self._out_and_back(blank_m_s), speed_m_s=blank_m_s)
        every = p.sentinel.every if p.sentinel is not None else 0
        for index, (cell, repeat) in enumerate(cells):
            if every and index % every == 0:
                self._sentinel(index // every + 1)
            self._point(cell, repeat)
        if every:
            self._sentinel(math.ceil(len(cells) / every) + 1)
        if blank_m_s is not None:
            self._add("blank-after", "blank", self._out_and_back(blank_m_s), speed_m_s=blank_m_s)

    def _prepare(self, *, new: bool) -> None:
        """Add run-in, warm-up and sensor checks, in this order, so that zeros are measured on the warm rig."""
        p, warm_up, checks = self.protocol, self.protocol.warm_up, self.protocol.before_block
        if warm_up is not None:
            for word, times in (("run-in", warm_up.run_in_cycles if new else 0), ("warm-up", warm_up.cycles)):
                if times:
                    steps = self._out_and_back(warm_up.speed_m_s, times)
                    self._add(word, "warm-up", steps, self.first, sampling=PREPARING)
        if checks.tare_s is not None:
            hold = Hold(checks.tare_s, released=True)
            self._add("tare", "tare", (hold,), sampling=CHECKING, released=True)
        weight = checks.known_weight
        if weight is not None:
            mass, force = f"{weight.mass_kg:g} kg", weight.mass_kg * STANDARD_GRAVITY_M_S2
            on = f"Uncouple the drive and hang the known weight of {mass} on the force sensor, pulling in +x."
            off = f"Take the weight of {mass} off and couple the drive again."
            self._operator("weight-on", on, weight.change_s)
            hold = Hold(weight.time_s, weight_n=force)
            self._add("weight", "weight", (hold,), sampling=CHECKING, weight_kg=weight.mass_kg)
            self._operator("weight-off", off, weight.change_s)
        if checks.leak_check_s is not None:
            sides = zip(*p.pressure.levels, strict=True)
            highest = Pair(*(max(side, key=lambda pressure: pressure.absolute_pa(self.ambient_pa)) for side in sides))
            self._add("leak", "leak", (Hold(checks.leak_check_s, shut=True),), highest, sampling=CHECKING)

    def _operator(self, word: str, text: str, wait_s: float) -> None:
        self._add(f"operator/{word}", "operator", (), wait_s=wait_s, text=text)

    def _sentinel(self, number: int) -> None:
        """Add a control run. Control runs are counted from 1 in each block."""
        sentinel = self.protocol.sentinel
        assert sentinel is not None
        pair = self.first if sentinel.pressure is None else Pair(sentinel.pressure, sentinel.pressure)
        steps = self._out_and_back(sentinel.speed_m_s)
        self._add(f"sentinel/n{number}", "sentinel", steps, pair, speed_m_s=sentinel.speed_m_s)

    def _point(self, cell: Cell, repeat: int) -> None:
        """Add the cycle that measures a design point."""
        factors = {name: getattr(cell, name) for name in ("speed_m_s", "stop_s", "released")}
        steps = () if cell.name in self._uses else self._sweep(cell) if cell.position is None else self._stop(cell)
        self._add(f"{cell.name}/r{repeat}", cell.kind, steps, cell.pressures, cell=cell, repeat=repeat, **factors)

    def _add(
        self,
        key: str,
        kind: str,
        steps: tuple[Step, ...],
        pair: Pair = VENTED,
        *,
        wait_s: float = 0.0,
        cell: Cell | None = None,
        sampling: Sampling | None = None,
        **rest: Any,  # noqa: ANN401 - the optional fields of Cycle
    ) -> None:
        """Add a cycle to the plan. Repeats of a design point reuse the steps of its first cycle."""
        key, sampling = f"b{self.block}/{key}", sampling or self.protocol.sampling
        name = cell.name if cell is not None else key
        if name not in self._uses:
            self._uses[name] = (steps, *axis_use(steps, self.way, sampling))
        steps, axis_s, samples = self._uses[name]
        pressures = pair.absolute_pa(self.ambient_pa)
        if pressures != self._pressures:
            wait_s += self.protocol.pressure.settling_s
            self._pressures = pressures
        rest |= {"block": self.block, "levels": self.levels, "start_m": self.way.low_m}
        self.planned.append(
            Planned(Cycle(key, kind, steps, sampling, *pressures, **rest), axis_s, wait_s, samples, cell)
        )

    def _out_and_back(self, speed_m_s: float, times: int = 1) -> tuple[Step, ...]:
        return (Move(self.way.high_m, speed_m_s), Move(self.way.low_m, speed_m_s)) * times

    def _sweep(self, cell: Cell) -> tuple[Step, ...]:
        """Return the strokes of a sweep; their number gives the requested time at constant speed."""
        speeds, speed = self.protocol.speed, cell.speed_m_s
        assert speeds is not None
        cruise = self.way.cruise_s(speed)
        strokes = min(max(math.ceil(speeds.settled_time_s / cruise), 1), speeds.most_strokes) if cruise else 1
        back = speed if cell.direction == "both" else speeds.return_speed_m_s
        out_speed, back_speed = (back, speed) if cell.direction == "-x" else (speed, back)
        return (Move(self.way.high_m, out_speed), Move(self.way.low_m, back_speed)) * strokes

    def _stop(self, cell: Cell) -> tuple[Step, ...]:
        """Return the steps of a stop: preconditioning, uninterrupted stroke, interrupted stroke, way back."""
        stop, speed = self.protocol.stop, cell.speed_m_s
        assert stop is not None
        assert cell.position is not None
        assert cell.stop_s is not None
        low, high, back = self.way.low_m, self.way.high_m, stop.preconditioning.speed_m_s
        sign = 1.0 if cell.direction == "+x" else -1.0
        near, far = (low, high) if sign > 0.0 else (high, low)
        at = cell.position.at(low, high)
        begin = near if stop.approach_m is None else at - sign * stop.approach_m
        end = far if stop.recovery_m is None else at + sign * stop.recovery_m
        to_begin = [Move(near, back)] if begin == near else [Move(near, back), Move(begin, back)]
        steps: list[Step] = list(self._out_and_back(back, stop.preconditioning.strokes))
        steps += [*to_begin, Move(end, speed)] * stop.reference_strokes + to_begin
        if cell.stop_s > 0.0:
            steps += [Move(at, stop.approach_speed_m_s or speed), Hold(cell.stop_s, released=cell.released)]
        out: list[Step] = []
        at = low
        for step in [*steps, Move(end, speed), Move(low, back)]:  # without moves of zero length
            if isinstance(step, Hold) or step.to_m != at:
                out.append(step)
                at = at if isinstance(step, Hold) else step.to_m
        return tuple(out)


def show(plan: Plan) -> str:
    """Return the summary: blocks with their content and time, and the result of the pre-flight check."""
    rig = f'on "{plan.identity.name}"{" (simulated: its data are synthetic)" if plan.identity.synthetic else ""}'
    used = [f"{name} {value:.4g} of {limit:.4g} {unit}" for name, (value, limit, unit) in margins(plan).items()]
    lines = [f"{plan.protocol.name}, {rig}", "", _blocks(plan), "", *_contents(plan), ""]
    return "\n".join([*lines, f"pre-flight: passed ({', '.join(used)})", *(f"note: {note}" for note in plan.notes)])


def size(count: float) -> str:
    """Return a number of bytes as text."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count / 1e3:.3g} kB"


def _blocks(plan: Plan) -> str:
    groups = {block: list(group) for block, group in groupby(plan.planned, key=lambda planned: planned.cycle.block)}
    rows = [["block", "set-up", "cells", "cycles", "strokes", "time, h:min", "data"]]
    for block, group in [*groups.items(), (0, list(plan.planned))]:
        levels = group[0].cycle.levels if block else {}
        cells = {(str(p.cycle.levels), p.cell.name) for p in group if p.cell is not None}
        minutes = round(sum(p.time_s for p in group) / 60.0)
        counts = [len(cells), len(group), sum(p.strokes for p in group), f"{minutes // 60}:{minutes % 60:02d}"]
        set_up = ", ".join(f"{name} {level}" for name, level in levels.items()) or "-"
        rows.append([str(block or "all"), set_up, *map(str, counts), size(size_of(group))])
    return aligned(rows if len(groups) > 1 else rows[:2], right_from=2, indent="")


def _contents(plan: Plan) -> list[str]:
    p = plan.protocol
    kinds = Counter(planned.cycle.kind for planned in plan.planned)
    operator_s = sum(planned.wait_s for planned in plan.planned if planned.cycle.kind == "operator")
    settling_s = sum(planned.wait_s for planned in plan.planned) - operator_s
    axis_s = sum(planned.axis_s for planned in plan.planned)
    seed = f" (seed {p.seed})" if p.order.kind == "randomised" else ""
    each = f"{p.pressure.settling_s:g} s each, assumed"
    waits = f", settling after changes of pressure {duration(settling_s)} ({each})" if settling_s else ""
    hands = f", operator {duration(operator_s)} (assumed)" if operator_s else ""
    speeds = [] if p.speed is None else [f"speed    {_range(p.speed.levels_m_s, 1e3, 'mm/s')}"]
    if p.stop is not None:
        speeds.append(f"stop     {_range(p.stop.durations_s, 1.0, 's')}")
        speeds.append(f"restart  {_range(p.stop.restart_speed_m_s, 1e3, 'mm/s')}")
    return [
        f"cycles   {', '.join(f'{kind} {count}' for kind, count in kinds.items())}",
        *speeds,
        f"pressure {_pressures(p.pressure.levels)}",
        f"order    {p.order.kind}{seed}; repeats {p.repeats}, replicates {p.order.replicates}",
        f"time     {duration(plan.time_s)}: axis {duration(axis_s)}{waits}{hands}",
        f"data     {sum(planned.samples for planned in plan.planned)} samples, {size(size_of(plan.planned))} "
        f"({BYTES_PER_SAMPLE:g} bytes per sample, measured on files of the simulated rig)",
    ]


def _pressures(levels: Sequence[Pair]) -> str:
    """Return the pressures as text, absolute or gauge as stated."""
    (a, b), last = ([f"{p.to('bar'):.6g} bar {'gauge' if p.gauge else 'abs'}" for p in levels[end]] for end in (0, -1))
    if len(levels) == 1:
        return f"{a} in both chambers" if levels[0].a == levels[0].b else f"{a} in chamber a, {b} in chamber b"
    if all(a == b for a, b in levels):
        return f"{len(levels)} levels in both chambers, {a} to {last[0]}"
    return f"{len(levels)} pairs, a {a} and b {b} to a {last[0]} and b {last[1]}"


def _range(levels: Sequence[float], factor: float, unit: str) -> str:
    if len(levels) == 1:
        return f"{factor * levels[0]:.4g} {unit}"
    return f"{len(levels)} levels, {factor * levels[0]:.4g} to {factor * levels[-1]:.4g} {unit}"
