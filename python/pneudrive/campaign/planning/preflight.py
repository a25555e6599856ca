"""The plan as data, and its pre-flight check: every cycle is compared with the limits of the rig.

The check also collects cautions.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from pneudrive.campaign.cycle import Cycle
from pneudrive.constants import STANDARD_GRAVITY_M_S2, ZERO_CELSIUS_K
from pneudrive.errors import ProtocolError, nearest, package_table
from pneudrive.repr_tables import Shown
from pneudrive.rig.interface import Changeable, Envelope, Hold, Identity, Move, Rig
from pneudrive.rig.motion import Limits

if TYPE_CHECKING:
    from pneudrive.arrays import Interval, NamedNumbers
    from pneudrive.campaign.planning.protocol import Protocol


#: Bytes per sample in a file of `write_cycle`: 15 (long stops) to 21 (fast sweeps) on simulated rigs.
BYTES_PER_SAMPLE = 20
#: Bytes of the header and the Parquet metadata of a cycle's file (measured).
BYTES_PER_CYCLE = 5000


@dataclass(frozen=True)
class Planned:
    """A cycle of a plan, with its expected times and number of samples.

    Attributes
    ----------
    cycle : Cycle
    wait_s : float
        Assumed time before the cycle in s, from the protocol: pressure settling, or work of the operator.
    axis_s : float
        Time of the moves and holds, in s. It is exact if the axis moves at its limits.
    samples : int
    """

    cycle: Cycle
    wait_s: float
    axis_s: float
    samples: int

    @property
    def time_s(self) -> float:
        """Waiting and axis time, in s."""
        return self.axis_s + self.wait_s


@dataclass(frozen=True, repr=False)
class Plan(Shown):
    """The cycles of a protocol on a rig, in order.

    Attributes
    ----------
    protocol, identity, envelope
    planned : tuple of Planned
        Cycles in the order in which they are run.
    notes : tuple of str
        Cautions.
    """

    protocol: Protocol
    identity: Identity
    envelope: Envelope
    planned: tuple[Planned, ...] = ()
    notes: tuple[str, ...] = ()

    @cached_property
    def cycles(self) -> tuple[Cycle, ...]:
        """All cycles, in order."""
        return tuple(planned.cycle for planned in self.planned)

    @cached_property
    def ends_m(self) -> Interval:
        """Ends of the part of the stroke that the campaign uses, in m."""
        (low, high), used = self.envelope.position_m, self.protocol.position
        if used.range is None:
            return low + used.margin_m, high - used.margin_m
        return used.range[0].at(low, high), used.range[1].at(low, high)

    @property
    def length_m(self) -> float:
        """Length of a stroke of the campaign, in m."""
        return self.ends_m[1] - self.ends_m[0]

    @cached_property
    def limits(self) -> Limits:
        """Limits of acceleration and jerk of the axis."""
        return Limits(self.envelope.acceleration_m_s2, self.envelope.jerk_m_s3)

    def cruise_s(self, speed_m_s: float) -> float:
        """Return the time at constant speed in a stroke, in s; 0 if the stroke is too short for its ramps."""
        return max(self.length_m / speed_m_s - self.limits.ramp_time_s(speed_m_s), 0.0)

    @cached_property
    def allowed(self) -> Envelope:
        """Limits of the rig, tightened by the limits and the conditions of the protocol."""
        rig, tight, conditions = self.envelope, self.protocol.limits, self.protocol.conditions
        ambient, temperature = self.identity.ambient_pressure_pa, rig.temperature_k
        supply = max(0.0, rig.supply_pressure_pa)  # NaN is no limit
        low, high = rig.pressure_pa
        if tight.pressure is not None:
            high = min(high, tight.pressure.absolute_pa(ambient))
        if conditions.supply_pressure is not None:
            supply = max(supply, conditions.supply_pressure.absolute_pa(ambient))
        if (asked := conditions.temperature_k) is not None:
            temperature = max(temperature[0], asked[0]), min(temperature[1], asked[1])
        upper = {
            name: min(getattr(rig, name), getattr(tight, name) or math.inf)
            for name in ("speed_m_s", "acceleration_m_s2", "force_n")
        }
        return replace(rig, pressure_pa=(low, high), supply_pressure_pa=supply, temperature_k=temperature, **upper)

    @property
    def time_s(self) -> float:
        """Total time in s, without homing and without setting the pressures."""
        return sum(planned.time_s for planned in self.planned)

    def remaining_s(self, done: set[str]) -> float:
        """Return the time in s of the cycles whose keys are not in `done`."""
        return sum(planned.time_s for planned in self.planned if planned.cycle.key not in done)


def size_of(plan: Iterable[Planned]) -> int:
    """Estimate the size on disk in bytes, by `BYTES_PER_SAMPLE`. An operator's step also writes a file."""
    return sum(BYTES_PER_SAMPLE * planned.samples + BYTES_PER_CYCLE for planned in plan)


# --- The check.

#: Relative tolerance of a limit, for rounding.
ROUNDING = 1e-9
#: Largest difference of two pressures that count as equal, for chambers on a common manifold: resolution of the keys.
SAME_PRESSURE_PA = 0.1
#: Largest number of violations in a message.
SHOWN = 5
_TEXTS = package_table(__file__, "preflight.toml")
#: Name of a violated limit or of a caution in ``preflight.toml``, and the values of its text.
Finding = tuple[str, dict[str, Any]]


def check(plan: Plan) -> tuple[str, ...]:
    """Check every cycle against the envelope and return cautions.

    Raises
    ------
    ProtocolError
        If a cycle violates a limit. The message names the first such cycle, its value, limit and remedy, and the number
        of violating cycles.
    """
    asked, (low, high) = plan.protocol.conditions.temperature_k, plan.allowed.temperature_k
    if asked is not None and not low < high:
        raise plan.protocol.fail(
            "conditions.temperature",
            f"the protocol requires a temperature of {_celsius(asked)}",
            rule=f"the rig measures only at {_celsius(plan.envelope.temperature_k)}",
            remedy="Change [conditions] temperature.",
        )
    first: dict[str, tuple[str, dict[str, Any]]] = {}  # of each limit: the first cycle that violates it
    counts, count = Counter[str](), 0
    for cycles in _alike(plan):
        found = list(violations(cycles[0], plan))
        for limit, values in found:
            first.setdefault(limit, (cycles[0].key, values))
        counts.update(dict.fromkeys((limit for limit, _ in found), len(cycles)))
        count += len(cycles) if found else 0
    if not first:
        return cautions(plan)
    lines, remedies = [], []
    for limit, (key, values) in list(first.items())[:SHOWN]:
        text, remedy = (text.format(**values) for text in _TEXTS["limits"][limit].values())
        lines.append(f"{limit}: cycle {key}: {text} ({_cycles(counts[limit])})")
        remedies.append(remedy)
    raise ProtocolError(
        f'the rig "{plan.identity.name}" cannot run this protocol: '
        f"{count} of {_cycles(len(plan.cycles))} {'breaks' if count == 1 else 'break'} limits of the rig",
        where=plan.protocol.origin,
        value="\n    ".join(lines),
        rule="the rig's envelope, tightened by [limits]",
        remedy=" ".join(dict.fromkeys(remedies)),
    )


def _alike(plan: Plan) -> list[list[Cycle]]:
    """Group cycles with equal demands on the rig, such as repeats. Groups are in the order of their first cycles."""
    groups: dict[tuple, list[Cycle]] = {}
    for cycle in plan.cycles:
        demands = (cycle.kind, cycle.steps, cycle.speed_m_s, cycle.start_m, cycle.pressures_pa)
        groups.setdefault(demands, []).append(cycle)
    return list(groups.values())


def peak_acceleration_m_s2(plan: Plan, distance_m: float, speed_m_s: float) -> float:
    """Return the largest acceleration of a move within the limits of acceleration and jerk, in m/s2."""
    limits = plan.limits
    return min(limits.acceleration_m_s2, math.sqrt(min(speed_m_s, limits.top_speed_m_s(distance_m)) * limits.jerk_m_s3))


def acceleration_of(cycle: Cycle, plan: Plan) -> float:
    """Return the largest acceleration in a cycle, in m/s2."""
    return max((peak_acceleration_m_s2(plan, d, step.speed_m_s) for d, step, _ in _moves(cycle)), default=0.0)


def forces_n(cycle: Cycle, plan: Plan) -> NamedNumbers:
    """Return the magnitudes of the contributions to the largest sensor force in a cycle, in N."""
    hung = max((step.weight_n for step in cycle.steps if isinstance(step, Hold)), default=0.0)
    if hung:  # on the sensor, the drive uncoupled
        return {"known weight": hung}
    return {
        "friction": plan.allowed.expected_friction_n,
        "difference of the pressure forces": abs(pressure_force_n(cycle, plan.identity)),
        "inertia": plan.identity.mass_beyond_sensor_kg * acceleration_of(cycle, plan),
        "weight of the moving parts": abs(weight_n(plan.identity)),
    }


def pressure_force_n(cycle: Cycle, rig: Identity) -> float:
    """Return the pressure force in +x, in N."""
    ambient = rig.ambient_pressure_pa
    return (cycle.pressure_a_pa - ambient) * rig.area_a_m2 - (cycle.pressure_b_pa - ambient) * rig.area_b_m2


def weight_n(rig: Identity) -> float:
    """Return the component of the moving parts' weight along -x, in N."""
    return rig.mass_beyond_sensor_kg * STANDARD_GRAVITY_M_S2 * math.sin(rig.incline_rad)


def margins(plan: Plan) -> dict[str, tuple[float, float, str]]:
    """Return (largest value of the plan, limit, unit) for each limit that applies to the plan."""
    allowed, cycles = plan.allowed, [alike[0] for alike in _alike(plan)]
    speed = max(step.speed_m_s for cycle in cycles for _, step, _ in _moves(cycle))
    pressure = max(max(cycle.pressures_pa) for cycle in cycles)
    return {
        "speed": (1e3 * speed, 1e3 * allowed.speed_m_s, "mm/s"),
        "acceleration": (max(acceleration_of(cycle, plan) for cycle in cycles), allowed.acceleration_m_s2, "m/s2"),
        "force": (max(sum(forces_n(cycle, plan).values()) for cycle in cycles), allowed.force_n, "N"),
        "pressure": (pressure / 1e5, allowed.pressure_pa[1] / 1e5, "bar abs"),
    }


def check_levels(protocol: Protocol, rig: Rig) -> None:
    """Reject a level of mounting, seal or drive that the rig does not have. Only simulated rigs can be checked."""
    if not isinstance(rig, Changeable):
        return
    known = rig.levels()
    for name, factor in protocol.hard.items():
        for level in factor.levels if name in known else ():  # an unlisted factor takes any name
            if level not in known[name]:
                raise protocol.fail(
                    f"{name}.levels",
                    f"{name}.levels: the rig has no {name} '{level}'",
                    remedy=nearest(level, known[name]) if known[name] else f"The rig has only one {name}.",
                )


def violations(cycle: Cycle, plan: Plan) -> Iterator[Finding]:
    """Yield the limits that one cycle violates."""
    yield from _motion(cycle, plan)
    yield from _pressures(cycle, plan)
    yield from _force(cycle, plan)


def _motion(cycle: Cycle, plan: Plan) -> Iterator[Finding]:
    low, high = plan.allowed.position_m
    top_m_s = plan.allowed.speed_m_s
    top_m_s2 = plan.allowed.acceleration_m_s2
    moves = list(_moves(cycle))
    for distance, step, _ in moves:
        if not low - ROUNDING <= step.to_m <= high + ROUNDING:
            keys = "[stop] position, approach or recovery" if cycle.kind == "stop" else "[position]"
            yield "stroke", {"at": 1e3 * step.to_m, "low": 1e3 * low, "high": 1e3 * high, "keys": keys}
        if step.speed_m_s > top_m_s * (1.0 + ROUNDING):
            yield "speed", {"speed": 1e3 * step.speed_m_s, "most": 1e3 * top_m_s}
        peak = peak_acceleration_m_s2(plan, distance, step.speed_m_s)
        if peak > top_m_s2 * (1.0 + ROUNDING):
            yield "acceleration", {"peak": peak, "most": top_m_s2}
    for distance, step, is_before_hold in moves if cycle.kind in MEASURING else ():
        speed, reached = step.speed_m_s, plan.limits.top_speed_m_s(distance)
        if (is_before_hold or speed == cycle.speed_m_s) and speed > reached * (1.0 + ROUNDING):  # others only return
            ramps = 1e3 * (2.0 * plan.limits.ramp_distance_m(speed))
            yield "ramp", {"speed": 1e3 * speed, "way": 1e3 * distance, "reached": 1e3 * reached, "ramps": ramps}


#: Kinds of cycles whose moves must reach their speed.
MEASURING = ("sweep", "stop", "sentinel", "blank")


def _pressures(cycle: Cycle, plan: Plan) -> Iterator[Finding]:
    low, high = plan.allowed.pressure_pa
    a, b = cycle.pressures_pa
    for chamber, value in (("a", a), ("b", b)):
        if not low * (1.0 - ROUNDING) <= value <= high * (1.0 + ROUNDING):
            limit = f"allowed: {_bar(low)} to {_bar(high)}" if low < high else f"chambers open to ambient, {_bar(low)}"
            yield "pressure", {"value": value / 1e5, "chamber": chamber, "limit": limit}
    if not plan.allowed.separate_pressures and abs(a - b) > SAME_PRESSURE_PA:
        yield "manifold", {"a": a / 1e5, "b": b / 1e5}


def _balance(rig: Identity) -> str:
    """Return the remedy for an excessive pressure force. It depends on the ratio of the piston areas."""
    ratio = rig.area_b_m2 / rig.area_a_m2
    if math.isclose(ratio, 1.0):
        return "Bring the pressures of the chambers closer together"
    return f"Bring the gauge pressure of chamber a closer to {ratio:.3g} times that of chamber b (areas differ)"


def _force(cycle: Cycle, plan: Plan) -> Iterator[Finding]:
    rig, balance = plan.identity, _balance(plan.identity)
    push = abs(pressure_force_n(cycle, rig) - weight_n(rig))
    holds = plan.allowed.expected_friction_n
    if push > holds > 0.0 and any(isinstance(step, Hold) and step.released for step in cycle.steps):
        yield "release", {"push": push, "holds": holds, "balance": balance}
    parts = forces_n(cycle, plan)
    total = sum(parts.values())
    if total > plan.allowed.force_n * (1.0 + ROUNDING):
        shown = " + ".join(f"{value:.3g} N {name}" for name, value in parts.items() if value > 0.0)
        less = _TEXTS["less"][max(parts, key=lambda name: parts[name])].format(balance=balance)
        yield "force", {"total": total, "parts": shown, "most": plan.allowed.force_n, "less": less}


def _moves(cycle: Cycle) -> Iterator[tuple[float, Move, bool]]:
    """Yield every move, its length in m, and whether a hold follows."""
    at = cycle.start_m if cycle.start_m is not None else math.nan
    for step, after in zip_longest(cycle.steps, cycle.steps[1:]):
        if isinstance(step, Move):
            yield abs(step.to_m - at), step, isinstance(after, Hold)
            at = step.to_m


def _cycles(count: int) -> str:
    return f"{count} cycle{'' if count == 1 else 's'}"


def millimetres(value_m: float) -> str:
    """Return a length as text."""
    return f"{1e3 * value_m:.5g} mm"


def _bar(value_pa: float) -> str:
    return f"{value_pa / 1e5:.4g} bar abs"


def _celsius(span_k: Interval) -> str:
    return f"{span_k[0] - ZERO_CELSIUS_K:.4g} to {span_k[1] - ZERO_CELSIUS_K:.4g} degC"


#: Rate around reversals below which the height of a breakaway peak is lost, Hz. A peak lasts a few ms (assumed).
BURST_RATE_HZ = 5000.0
#: Rate between bursts below which stick-slip and short events are invisible, Hz (assumed).
BASE_RATE_HZ = 100.0


def cautions(plan: Plan) -> tuple[str, ...]:
    """Return warnings: effects that a plan shows poorly or not at all, and notes on rig, time and unused tables."""
    texts = _TEXTS["cautions"]
    return tuple(texts[key].format(**values) for key, values in (*_of_samples(plan), *_of_design(plan)))


def _of_samples(plan: Plan) -> Iterator[Finding]:
    """Yield the effects that the samples and strokes of a plan cannot show."""
    protocol = plan.protocol
    samples = plan.protocol.samples
    speeds = plan.protocol.speed
    burst = samples.burst_rate_hz if samples.burst_after_s > 0.0 else 0.0
    if burst < BURST_RATE_HZ:
        yield "bursts", {"rate": burst, "needed": BURST_RATE_HZ}
    swept: tuple[float, ...] = () if speeds is None else speeds.levels_m_s
    slowest = min(*swept, *(protocol.stop.restart_speed_m_s if protocol.stop else ()), math.inf)
    rate = samples.samples_per_stroke / (plan.length_m / slowest)
    if rate < BASE_RATE_HZ:
        yield "slow", {"speed": 1e3 * slowest, "samples": samples.samples_per_stroke, "rate": rate}
    if speeds is None:
        return
    top, ignored = speeds.levels_m_s[-1], protocol.filter.ignore_initial
    ramp = plan.limits.ramp_distance_m(top) / plan.length_m
    cruise_s = plan.cruise_s(top) * speeds.most_strokes
    if ramp > ignored:
        yield "ramps", {"speed": 1e3 * top, "ramp": 100 * ramp, "ignored": 100 * ignored}
    if cruise_s < speeds.settled_time_s:
        strokes = {"strokes": speeds.most_strokes, "cruise": cruise_s, "settled": speeds.settled_time_s}
        yield "settled", {"speed": 1e3 * top, **strokes}


def _of_design(plan: Plan) -> Iterator[Finding]:
    """Yield the effects that the design of a plan cannot separate, and notes on rig, time and unused tables."""
    protocol, allowed, ambient = plan.protocol, plan.allowed, plan.identity.ambient_pressure_pa
    if protocol.repeats < 2 and protocol.order.replicates < 2:
        yield "repeats", {}
    if protocol.directions != "both":
        yield "directions", {"directions": protocol.directions}
    varied = [name for name, factor in protocol.hard.items() if len(factor.levels) > 1]
    if varied and protocol.order.replicates < 2:
        yield "replicates", {"factors": " and ".join(varied)}
    if protocol.stop is not None and not protocol.stop.reference_strokes and 0.0 not in protocol.stop.durations_s:
        yield "reference", {}
    if allowed.expected_friction_n <= 0.0:
        yield "friction", {}
    if plan.identity.chambers == "open" and protocol.before_block.leak_check_s is not None:
        yield "leak", {}
    highest = max(p.absolute_pa(ambient) for pair in protocol.pressure.levels for p in pair)
    if 0.0 < allowed.supply_pressure_pa < highest:
        yield "supply", {"least": allowed.supply_pressure_pa / 1e5, "highest": highest / 1e5}
    if plan.time_s > protocol.limits.time_s:
        yield "time", {"hours": plan.time_s / 3600, "limit": protocol.limits.time_s / 3600}
    for table in ("adaptive", "design", "fraction"):
        if getattr(protocol, table) is not None:
            yield "unused", {"table": table}
