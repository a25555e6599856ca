"""The plan of a campaign on a rig: design points (combinations of levels) in running order, cycles, and a summary.

The summary lists the blocks with their time and amount of data, and the result of the pre-flight check.
"""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import groupby, product
from pathlib import Path
from typing import Any, TypeVar

from rich import filesize

from pneudrive.batching import many_objects
from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.planning import preflight
from pneudrive.campaign.planning.preflight import Plan, Planned, size_of
from pneudrive.campaign.planning.protocol import VENTED, AxisPosition, Pair, Protocol
from pneudrive.constants import STANDARD_GRAVITY_M_S2
from pneudrive.errors import ProtocolError
from pneudrive.files.bounds import within
from pneudrive.files.content import rendered
from pneudrive.numbers import duration
from pneudrive.repr_tables import aligned
from pneudrive.rig.interface import Envelope, Hold, Identity, Move, Sampling, Step, as_json, identity_of
from pneudrive.rig.motion import Limits, move, step_samples

T = TypeVar("T")
#: Kinds of cycles that measure a design point.
POINTS = ("sweep", "stop")
#: End of the key of a cycle that occurs several times in a block: repeats of a point, and control runs.
NUMBERED = dict.fromkeys(POINTS, "/r{}") | {"sentinel": "/n{}"}
#: Text of the summary.
TEMPLATE = Path(__file__).with_name("plan.txt.j2")


def _sweep_levels(protocol: Protocol) -> list[tuple[str, float]]:
    """Return the branch (up or down) and speed of each sweep point at one pressure, in the requested order."""
    if protocol.speed is None:
        return []
    up, order = protocol.speed.levels_m_s, protocol.speed.order
    if order == "up-and-down":
        return [*(("up", speed) for speed in up), *(("down", speed) for speed in up[::-1])]
    return [("", speed) for speed in (up if order == "ascending" else up[::-1])]


def _stop_levels(protocol: Protocol) -> tuple[Sequence[Any], ...]:
    """Return the levels of stops at one pressure: position (varies slowest), release, speed, direction, duration."""
    stop = protocol.stop
    if stop is None:
        return ((),)
    directions = ("+x", "-x") if protocol.directions == "both" else (protocol.directions,)
    return stop.position, stop.released, stop.restart_speed_m_s, directions, stop.durations_s


@lru_cache(maxsize=4096)
def _move_s(distance_m: float, speed_m_s: float, limits: Limits) -> float:
    return move(distance_m, speed_m_s, limits).duration_s


def ordered_points(protocol: Protocol, block: int, families: Sequence[list[list[Planned]]]) -> list[Planned]:
    """Return the design points of a block in running order, with all repeats.

    Parameters
    ----------
    protocol : Protocol
    block : int
        Number of the block, from 1.
    families : sequence of list
        Points of the sweep, then points of the stops. Each of the two has a list of points for each pressure.
    """
    kind, repeats = protocol.order.kind, protocol.repeats
    if kind == "as-given":  # a change of pressure is slow: the list is repeated at each pressure
        return [point for family in families for points in family for point in points * repeats]
    if kind == "interleaved":
        columns = [[alternate(points) for points in alternate(family)] for family in families]
        return [point for family in columns for row in zip(*family, strict=True) for point in row] * repeats
    every = [point for family in families for points in family for point in points]
    seeds = (f"{protocol.seed}/b{block}/r{repeat}" for repeat in range(1, repeats + 1))
    return [point for seed in seeds for point in shuffle(every, lambda point: point.cycle.key, seed)]


def shuffle(items: Sequence[T], name: Callable[[T], str], seed: str) -> list[T]:
    """Shuffle items by the hash of the seed and the name of each item.

    The relative order of two items is the same on every machine and does not depend on other items.
    """
    return sorted(items, key=lambda item: hashlib.sha256(f"{seed}\0{name(item)}".encode()).digest())


def alternate(items: Sequence[T]) -> list[T]:
    """Take items alternately from both halves, so that neighbouring levels are far apart in time.

    Examples
    --------
    >>> alternate([1, 2, 3, 4, 5])
    [1, 4, 2, 5, 3]
    """
    half = (len(items) + 1) // 2
    return [items[index // 2 + index % 2 * half] for index in range(len(items))]


# --- Layout of a protocol, and its text.

#: Sampling of preparatory cycles: enough samples per stroke to show a fault (assumed).
PREPARING = Sampling(samples_per_stroke=500, burst_rate_hz=0.0)
#: Sampling rate at rest while a sensor is checked (assumed).
CHECKING = Sampling(hold_rate_hz=1000.0, burst_rate_hz=0.0)


def lay_out(protocol: Protocol, identity: Identity, envelope: Envelope) -> Plan:
    """Lay out a protocol for a rig and check it against the rig's limits.

    The same arguments give the same plan on every machine. The key of a cycle does not depend on other cycles.

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
    return replace(plan, notes=preflight.check(plan))


def draft(protocol: Protocol, identity: Identity, envelope: Envelope) -> Plan:
    """Lay out a protocol without a check against the rig's limits; `lay_out` does both."""
    plan, (low, high) = Plan(protocol, identity, envelope), envelope.position_m
    begin, end = plan.ends_m
    if plan.length_m <= 0.0 or begin < low - preflight.ROUNDING or end > high + preflight.ROUNDING:
        raise protocol.fail(
            "position",
            f"the campaign would move from {preflight.millimetres(begin)} to {preflight.millimetres(end)}",
            rule=f"the axis may move from {preflight.millimetres(low)} to {preflight.millimetres(high)}",
            remedy="Change [position] range or margin.",
        )
    # The number of points in all blocks, before the blocks are built.
    points = len(_sweep_levels(protocol)) + math.prod(map(len, _stop_levels(protocol)))
    blocks = math.prod(len(factor.levels) for factor in protocol.hard.values()) * protocol.order.replicates
    count = points * len(protocol.pressure.levels) * protocol.repeats * blocks
    within("cycles", count, f"the protocol asks for {count:,} cycles or more", ProtocolError, protocol.origin)
    with many_objects():
        plan = replace(plan, planned=tuple(_planned(plan)))
    times = Counter(cycle.key.rpartition("/")[0] for cycle in plan.cycles if cycle.kind in POINTS)
    for point, repeats in times.items():
        if repeats > protocol.repeats:
            rule = "levels must differ in their first 6 significant digits"
            raise ProtocolError(f"two cycles have the key {point}/r1", where=protocol.origin, rule=rule)
    return plan


def _planned(plan: Plan) -> Iterator[Planned]:
    """Yield the cycles of all blocks in running order. Repeats of a design point share their steps."""
    protocol = plan.protocol
    pairs = protocol.pressure.levels
    before = None
    families = (
        [[_sweep(plan, pair, *levels) for levels in _sweep_levels(protocol)] for pair in pairs],
        [[_stop(plan, pair, *levels) for levels in product(*_stop_levels(protocol))] for pair in pairs],
    )
    at = VENTED.absolute_pa(plan.identity.ambient_pressure_pa)
    # Levels of the hard-to-change factors, one replicate after the other. Even if levels are shuffled, equal levels of
    # the hardest-to-change factor stay together.
    blocks: list[dict[str, str]] = []
    for replicate in range(1, protocol.order.replicates + 1):
        hard = {name: factor.levels for name, factor in protocol.hard.items()}
        if protocol.order.kind == "randomised":
            hard = {n: shuffle(each, str, f"{protocol.seed}/replicate {replicate}/{n}") for n, each in hard.items()}
        blocks += [dict(zip(hard, each, strict=True)) for each in product(*hard.values())]
    for block, levels in enumerate(blocks, start=1):
        numbers = Counter[str]()
        for entry in _block(plan, before, levels, ordered_points(protocol, block, families)):
            cycle, name = entry.cycle, entry.cycle.key
            numbers[name] += 1
            key = f"b{block}/{name}{NUMBERED.get(cycle.kind, '').format(numbers[name])}"
            repeat = numbers[name] if cycle.kind in POINTS else 1
            before_pa, at = at, cycle.pressures_pa
            wait_s = entry.wait_s + (protocol.pressure.settling_s if at != before_pa else 0.0)
            cycle = replace(cycle, key=key, block=block, repeat=repeat, levels=levels)
            yield Planned(cycle, wait_s, entry.axis_s, entry.samples)
        before = levels


def _block(
    plan: Plan, before: dict[str, str] | None, levels: dict[str, str], points: list[Planned]
) -> Iterator[Planned]:
    """Yield the cycles of a block in running order. They are not yet assigned to the block.

    Parameters
    ----------
    plan : Plan
    before, levels : dict
        Levels of the factors that are changed by hand: in the previous block (None for the first block) and in this
        block.
    points : list of Planned
        Design points in running order.
    """
    p = plan.protocol
    old = before or {}
    blank_m_s = plan.protocol.before_block.blank_stroke_m_s
    for name, factor in p.hard.items():
        if old.get(name) != levels[name] or before == levels:
            ask = factor.ask or f"{name}: {{level}}. Confirm when it is in place."
            text = ask.replace("{level}", levels[name])
            yield _entry(plan, f"operator/{name}", "operator", wait_s=factor.time_s, text=text)
    new = before is None or any(old.get(name) != levels.get(name) for name in ("seal", "drive"))
    yield from _preparations(plan, new=new)
    if blank_m_s is not None:
        yield _entry(plan, "blank-before", "blank", _out_and_back(plan, blank_m_s), speed_m_s=blank_m_s)
    if p.sentinel is not None:
        every, speed, pressure = p.sentinel.every, p.sentinel.speed_m_s, p.sentinel.pressure
        pair = p.pressure.levels[0] if pressure is None else Pair(pressure, pressure)
        control = _entry(plan, "sentinel", "sentinel", _out_and_back(plan, speed), pair, speed_m_s=speed)
        for start in range(0, len(points), every):
            yield from (control, *points[start : start + every])
        yield control
    else:
        yield from points
    if blank_m_s is not None:
        yield _entry(plan, "blank-after", "blank", _out_and_back(plan, blank_m_s), speed_m_s=blank_m_s)


def _preparations(plan: Plan, *, new: bool) -> Iterator[Planned]:
    """Yield run-in, warm-up and sensor checks, in this order, so that zeros are measured on the warm rig."""
    p = plan.protocol
    warm_up = plan.protocol.warm_up
    checks = plan.protocol.before_block
    if warm_up is not None:
        for word, times in (("run-in", warm_up.run_in_cycles if new else 0), ("warm-up", warm_up.cycles)):
            if times:
                steps = _out_and_back(plan, warm_up.speed_m_s, times)
                yield _entry(plan, word, "warm-up", steps, p.pressure.levels[0], PREPARING)
    if checks.tare_s is not None:
        hold = Hold(checks.tare_s, released=True)
        yield _entry(plan, "tare", "tare", (hold,), sampling=CHECKING, released=True)
    weight = checks.known_weight
    if weight is not None:
        mass, force = f"{weight.mass_kg:g} kg", weight.mass_kg * STANDARD_GRAVITY_M_S2
        on = f"Uncouple the drive and hang the known weight of {mass} on the force sensor, pulling in +x."
        off = f"Take the weight of {mass} off and couple the drive again."
        yield _entry(plan, "operator/weight-on", "operator", wait_s=weight.change_s, text=on)
        hold = Hold(weight.time_s, weight_n=force)
        yield _entry(plan, "weight", "weight", (hold,), sampling=CHECKING, weight_kg=weight.mass_kg)
        yield _entry(plan, "operator/weight-off", "operator", wait_s=weight.change_s, text=off)
    if checks.leak_check_s is not None:
        ambient_pa = plan.identity.ambient_pressure_pa
        sides = zip(*p.pressure.levels, strict=True)
        highest = Pair(*(max(side, key=lambda pressure: pressure.absolute_pa(ambient_pa)) for side in sides))
        yield _entry(plan, "leak", "leak", (Hold(checks.leak_check_s, shut=True),), highest, CHECKING)


def _entry(
    plan: Plan,
    name: str,
    kind: str,
    steps: tuple[Step, ...] = (),
    pair: Pair = VENTED,
    sampling: Sampling | None = None,
    wait_s: float = 0.0,
    **about: Any,  # noqa: ANN401 - the optional fields of Cycle
) -> Planned:
    """Return a cycle that is not yet assigned to a block. Its key does not contain the number of the block."""
    pressures = pair.absolute_pa(plan.identity.ambient_pressure_pa)
    cycle = Cycle(name, kind, steps, sampling or plan.protocol.sampling, *pressures, start_m=plan.ends_m[0], **about)
    at = plan.ends_m[0]
    axis_s = 0.0
    samples = int(bool(steps))
    for step in steps:
        if isinstance(step, Hold):
            step_s = step.duration_s
        else:
            distance, at = step.to_m - at, step.to_m
            step_s = _move_s(distance, step.speed_m_s, plan.limits) if distance else 0.0
        axis_s += step_s
        samples += step_samples(step_s, isinstance(step, Move), cycle.sampling)
    return Planned(cycle, wait_s, axis_s, samples)


def _out_and_back(plan: Plan, speed_m_s: float, times: int = 1) -> tuple[Step, ...]:
    low, high = plan.ends_m
    return (Move(high, speed_m_s), Move(low, speed_m_s)) * times


def _sweep(plan: Plan, pair: Pair, turn: str, speed: float) -> Planned:
    """Return a point of the sweep; the number of its strokes gives the requested time at constant speed."""
    speeds = plan.protocol.speed
    direction = plan.protocol.directions
    low, high = plan.ends_m
    assert speeds is not None
    cruise = plan.cruise_s(speed)
    strokes = min(max(math.ceil(speeds.settled_time_s / cruise), 1), speeds.most_strokes) if cruise else 1
    back = speed if direction == "both" else speeds.return_speed_m_s
    out_speed, back_speed = (back, speed) if direction == "-x" else (speed, back)
    steps = (Move(high, out_speed), Move(low, back_speed)) * strokes
    parts = ("sweep", f"v{1e3 * speed:.6g}", pair.name, direction if direction != "both" else "", turn)
    return _entry(plan, "/".join(filter(None, parts)), "sweep", steps, pair, speed_m_s=speed)


def _stop(
    plan: Plan,
    pair: Pair,
    position: AxisPosition,
    released: bool,
    speed: float,
    direction: str,
    stop_s: float,
) -> Planned:
    """Return the cycle of a stop: preconditioning strokes, uninterrupted stroke, interrupted stroke, return stroke."""
    stop, (low, high) = plan.protocol.stop, plan.ends_m
    assert stop is not None
    back, at = stop.preconditioning.speed_m_s, position.at(low, high)
    sign, near, far = (1.0, low, high) if direction == "+x" else (-1.0, high, low)
    begin = near if stop.approach_m is None else at - sign * stop.approach_m
    end = far if stop.recovery_m is None else at + sign * stop.recovery_m
    to_begin = [Move(near, back)] if begin == near else [Move(near, back), Move(begin, back)]
    steps: list[Step] = list(_out_and_back(plan, back, stop.preconditioning.strokes))
    steps += [*to_begin, Move(end, speed)] * stop.reference_strokes + to_begin
    if stop_s > 0.0:
        steps += [Move(at, stop.approach_speed_m_s or speed), Hold(stop_s, released=released)]
    out: list[Step] = []
    at = low
    for step in [*steps, Move(end, speed), Move(low, back)]:  # without moves of zero length
        if isinstance(step, Hold) or step.to_m != at:
            out.append(step)
            at = at if isinstance(step, Hold) else step.to_m
    held = "released" if released else "held"
    name = f"stop/t{stop_s:.6g}/{pair.name}/v{1e3 * speed:.6g}/{held}/{position.name}/{direction}"
    return _entry(plan, name, "stop", tuple(out), pair, speed_m_s=speed, stop_s=stop_s, released=released)


def show(plan: Plan) -> str:
    """Return the summary: blocks with their content and time, and the result of the pre-flight check."""
    text = rendered(
        TEMPLATE,
        {"duration": duration, "levels": _range, "pressures": _pressures},
        plan=plan,
        p=plan.protocol,
        blocks=_blocks(plan),
        kinds=Counter(planned.cycle.kind for planned in plan.planned),
        size=filesize.decimal(size_of(plan.planned)),
        bytes_per_sample=preflight.BYTES_PER_SAMPLE,
        margins=preflight.margins(plan),
    )
    return text.rstrip("\n")


def _blocks(plan: Plan) -> str:
    groups = {block: list(group) for block, group in groupby(plan.planned, key=lambda planned: planned.cycle.block)}
    rows = [["block", "set-up", "cells", "cycles", "strokes", "time, h:min", "data"]]
    for block, group in [*groups.items(), (0, list(plan.planned))]:
        levels = group[0].cycle.levels if block else {}
        cells = sum(p.cycle.kind in POINTS and p.cycle.repeat == 1 for p in group)
        strokes = sum(isinstance(step, Move) for p in group for step in p.cycle.steps)
        minutes = round(sum(p.time_s for p in group) / 60.0)
        counts = [cells // (1 if block else plan.protocol.order.replicates), len(group), strokes]
        set_up = ", ".join(f"{name} {level}" for name, level in levels.items()) or "-"
        time = f"{minutes // 60}:{minutes % 60:02d}"
        rows.append([str(block or "all"), set_up, *map(str, counts), time, filesize.decimal(size_of(group))])
    return aligned(rows if len(groups) > 1 else rows[:2], right_from=2, indent="")


def _pressures(levels: Sequence[Pair]) -> str:
    """Return the pressures as text, absolute or gauge as in the protocol."""
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
