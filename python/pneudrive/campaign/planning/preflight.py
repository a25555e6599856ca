"""The pre-flight check: every cycle of a plan against the limits of the rig, and cautions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pneudrive.campaign.planning.points import Way
from pneudrive.constants import STANDARD_GRAVITY_M_S2, ZERO_CELSIUS_K
from pneudrive.errors import ProtocolError, nearest
from pneudrive.rig.interface import Changeable, Hold, Move

if TYPE_CHECKING:
    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.planning.points import Plan
    from pneudrive.campaign.planning.protocol import Protocol
    from pneudrive.rig.interface import Envelope, Identity, Rig
    from pneudrive.rig.motion import Limits


#: Relative tolerance of a limit, for rounding.
ROUNDING = 1e-9
#: Chambers on a common manifold have equal pressure, within the resolution of the cycles' keys.
SAME_PRESSURE_PA = 0.1
#: Number of violations that are shown; all are counted.
SHOWN = 5
#: Remedy for the largest contribution to a force.
LESS_FORCE = {
    "difference of the pressure forces": "Bring the pressures of the chambers closer together.",
    "inertia": "Lower the speed.",
    "known weight": "Take a smaller weight.",
}


@dataclass(frozen=True)
class Violation:
    """A limit that a cycle would break.

    Attributes
    ----------
    item : str
        ``speed``, ``ramp``, ``acceleration``, ``stroke``, ``force``, ``release``, ``pressure`` or ``manifold``.
    key : str
        Index of the cycle.
    value, limit, remedy : str
        In words, with units.
    """

    item: str
    key: str
    value: str
    limit: str
    remedy: str


def check(plan: Plan) -> tuple[str, ...]:
    """Check every cycle against the envelope and return cautions.

    Raises
    ------
    ProtocolError
        If a cycle breaks a limit; the message names the first one, value, limit, remedy and their number.
    """
    _check_temperature(plan.protocol, plan.envelope)
    alike, allowed = _alike(plan), Allowed.of(plan)
    found = [v for one in alike for v in violations(one[0], allowed)]
    if found:
        keys = {one[0].key: [cycle.key for cycle in one[1:]] for one in alike}
        found += [replace(v, key=key) for v in found for key in keys[v.key]]
        raise _refusal(plan, found)
    return cautions(plan)


def _alike(plan: Plan) -> list[list[Cycle]]:
    """Group cycles with equal demands on the rig, such as repeats, in the order of their first cycles."""
    found: dict[tuple, list[Cycle]] = {}
    for cycle in plan.cycles:
        asks = (cycle.kind, cycle.steps, cycle.speed_m_s, cycle.start_m, cycle.pressure_a_pa, cycle.pressure_b_pa)
        found.setdefault(asks, []).append(cycle)
    return list(found.values())


@dataclass(frozen=True)
class Allowed:
    """The limits of a rig, tightened by a protocol.

    Attributes
    ----------
    identity, envelope
        Limit of the rig.
    axis : Limits
        For its starts and stops.
    speed_m_s, acceleration_m_s2, force_n, pressure_pa : float
        Upper limits.
    """

    identity: Identity
    envelope: Envelope
    axis: Limits
    speed_m_s: float
    acceleration_m_s2: float
    force_n: float
    pressure_pa: float

    @classmethod
    def of(cls, plan: Plan) -> Allowed:
        """Return the tighter limits of rig and protocol."""
        rig, tight, identity = plan.envelope, plan.protocol.limits, plan.identity
        ambient = identity.ambient_pressure_pa
        pressure = math.inf if tight.pressure is None else tight.pressure.absolute_pa(ambient)
        return cls(
            identity,
            rig,
            Way.on(plan.protocol, rig).limits,
            min(rig.speed_m_s, tight.speed_m_s or math.inf),
            min(rig.acceleration_m_s2, tight.acceleration_m_s2 or math.inf),
            min(rig.force_n, tight.force_n or math.inf),
            min(rig.pressure_pa[1], pressure),
        )

    def peak_acceleration_m_s2(self, cycle: Cycle) -> float:
        """Return the largest acceleration in a cycle."""
        return max((_peak_acceleration(d, s.speed_m_s, self.axis) for d, s in _moves(cycle)), default=0.0)

    def forces_n(self, cycle: Cycle) -> dict[str, float]:
        """Return the contributions to the largest sensor force in a cycle; none is negative."""
        hung = max((step.weight_n for step in cycle.steps if isinstance(step, Hold)), default=0.0)
        if hung:  # on the sensor, the drive uncoupled
            return {"known weight": hung}
        return {
            "friction": self.envelope.expected_friction_n,
            "difference of the pressure forces": abs(self.pressure_force_n(cycle)),
            "inertia": self.identity.mass_beyond_sensor_kg * self.peak_acceleration_m_s2(cycle),
            "weight of the moving parts": abs(self.weight_n),
        }

    def pressure_force_n(self, cycle: Cycle) -> float:
        """Return the pressure force in +x, N."""
        ambient = self.identity.ambient_pressure_pa
        gauge_a, gauge_b = cycle.pressure_a_pa - ambient, cycle.pressure_b_pa - ambient
        return gauge_a * self.identity.area_a_m2 - gauge_b * self.identity.area_b_m2

    @property
    def weight_n(self) -> float:
        """Return the weight of the moving parts along -x, N."""
        rig = self.identity
        return rig.mass_beyond_sensor_kg * STANDARD_GRAVITY_M_S2 * math.sin(rig.incline_rad)


def margins(plan: Plan) -> dict[str, tuple[float, float, str]]:
    """Return (largest value of the plan, limit, unit) for each limit that concerns the plan."""
    allowed, cycles = Allowed.of(plan), [alike[0] for alike in _alike(plan)]
    speed = max(step.speed_m_s for cycle in cycles for _, step in _moves(cycle))
    acceleration = max(allowed.peak_acceleration_m_s2(cycle) for cycle in cycles)
    force = max(sum(allowed.forces_n(cycle).values()) for cycle in cycles)
    pressure = max(max(cycle.pressure_a_pa, cycle.pressure_b_pa) for cycle in cycles)
    return {
        "speed": (1e3 * speed, 1e3 * allowed.speed_m_s, "mm/s"),
        "acceleration": (acceleration, allowed.acceleration_m_s2, "m/s2"),
        "force": (force, allowed.force_n, "N"),
        "pressure": (pressure / 1e5, allowed.pressure_pa / 1e5, "bar abs"),
    }


def check_range(protocol: Protocol, envelope: Envelope) -> None:
    """Refuse a range of positions that is empty or leaves the rig's range."""
    way = Way.on(protocol, envelope)
    low, high = envelope.position_m
    if way.length_m <= 0.0 or way.low_m < low - ROUNDING or way.high_m > high + ROUNDING:
        raise protocol.fail(
            "position",
            f"the campaign would move from {_mm(way.low_m)} to {_mm(way.high_m)}",
            rule=f"the axis may move from {_mm(low)} to {_mm(high)}",
            remedy="Change [position] range or margin.",
        )


def check_levels(protocol: Protocol, rig: Rig) -> None:
    """Refuse a level of mounting, seal or drive that the rig lacks; only a simulated rig knows its levels."""
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


def violations(cycle: Cycle, allowed: Allowed) -> list[Violation]:
    """Return the first violation of each limit by one cycle."""
    first: dict[str, Violation] = {}
    for find in (_motion, _pressures, _force):
        for item, value, limit, remedy in find(cycle, allowed):
            first.setdefault(item, Violation(item, cycle.key, value, limit, remedy))
    return list(first.values())


#: Item, value, limit and remedy of a violation.
Found = Iterator[tuple[str, str, str, str]]


def _motion(cycle: Cycle, allowed: Allowed) -> Found:
    low, high = allowed.envelope.position_m
    for distance, step in _moves(cycle):
        speed = step.speed_m_s
        if not low - ROUNDING <= step.to_m <= high + ROUNDING:
            remedy = "Change [stop] position, approach or recovery." if cycle.kind == "stop" else "Change [position]."
            yield "stroke", _mm(step.to_m), f"from {_mm(low)} to {_mm(high)}", remedy
        if speed > allowed.speed_m_s * (1.0 + ROUNDING):
            yield "speed", _mm_s(speed), f"at most {_mm_s(allowed.speed_m_s)}", "Lower the speed."
        peak, top = _peak_acceleration(distance, speed, allowed.axis), allowed.acceleration_m_s2
        if peak > top * (1.0 + ROUNDING):
            remedy = "Lower the speed: the rig ramps with its own acceleration, which a protocol cannot change."
            yield "acceleration", f"{peak:.4g} m/s2", f"at most {top:.4g} m/s2", remedy
    for distance, step in _measuring(cycle):
        speed, reached = step.speed_m_s, allowed.axis.top_speed_m_s(distance)
        if speed > reached * (1.0 + ROUNDING):
            ramps = _mm(2.0 * allowed.axis.ramp_distance_m(speed))
            limit = f"at most {_mm_s(reached)}, because starting and stopping take {ramps}"
            yield "ramp", f"{_mm_s(speed)} within {_mm(distance)}", limit, "Lower the speed, or use more of the stroke."


def _pressures(cycle: Cycle, allowed: Allowed) -> Found:
    low, high = allowed.envelope.pressure_pa[0], allowed.pressure_pa
    a, b = cycle.pressure_a_pa, cycle.pressure_b_pa
    for chamber, value in (("a", a), ("b", b)):
        if not low * (1.0 - ROUNDING) <= value <= high * (1.0 + ROUNDING):
            limit = f"{_bar(low)} to {_bar(high)}" if low < high else f"the chambers are open to ambient, {_bar(low)}"
            yield "pressure", f"{_bar(value)} in chamber {chamber}", limit, "Change [pressure]."
    if not allowed.envelope.separate_pressures and abs(a - b) > SAME_PRESSURE_PA:
        limit = "the same pressure in both chambers, because they share a common manifold"
        remedy = "Give the pressures as [pressure] both, or use a rig with a regulator for each chamber."
        yield "manifold", f"{_bar(a)} and {_bar(b)}", limit, remedy


def _force(cycle: Cycle, allowed: Allowed) -> Found:
    push = abs(allowed.pressure_force_n(cycle) - allowed.weight_n)
    holds = allowed.envelope.expected_friction_n
    if push > holds > 0.0 and any(isinstance(step, Hold) and step.released for step in cycle.steps):
        limit = f"only friction holds a released axis, with at most {holds:.3g} N"
        remedy = 'Take equal pressures, or [stop] axis = "held"; do not release an inclined rig for its tare.'
        yield "release", f"pressure and weight push with {push:.3g} N", limit, remedy
    parts = allowed.forces_n(cycle)
    total = sum(parts.values())
    if total > allowed.force_n * (1.0 + ROUNDING):
        largest = max(parts, key=lambda name: parts[name])
        shown = " + ".join(f"{value:.3g} N {name}" for name, value in parts.items() if value > 0.0)
        remedy = LESS_FORCE.get(largest, "Use a rig whose force sensor has a greater range.")
        yield "force", f"{total:.4g} N ({shown})", f"at most {allowed.force_n:.4g} N", remedy


def _check_temperature(protocol: Protocol, envelope: Envelope) -> None:
    asked = protocol.conditions.temperature_k
    low, high = envelope.temperature_k
    if asked is not None and not max(asked[0], low) < min(asked[1], high):
        raise protocol.fail(
            "conditions.temperature",
            f"the protocol measures at {_celsius(asked)}",
            rule=f"the rig measures at {_celsius((low, high))}",
            remedy="Change [conditions] temperature.",
        )


def _refusal(plan: Plan, found: list[Violation]) -> ProtocolError:
    """Return the error with the first cycle that breaks each limit, and their number."""
    counts: dict[str, int] = {}
    for one in found:
        counts[one.item] = counts.get(one.item, 0) + 1
    first = [next(one for one in found if one.item == item) for item in counts]
    lines = [f"{v.item}: cycle {v.key}: {v.value}; {v.limit} ({_cycles(counts[v.item])})" for v in first[:SHOWN]]
    broken = len({one.key for one in found})
    return ProtocolError(
        f'the rig "{plan.identity.name}" cannot run this protocol:  '
        f"{broken} of {_cycles(len(plan.cycles))} {'breaks' if broken == 1 else 'break'} its limits",
        where=plan.protocol.origin,
        value="\n    ".join(lines),
        rule="the rig's envelope, tightened by [limits]",
        remedy=" ".join(dict.fromkeys(v.remedy for v in first[:SHOWN])),
    )


def _moves(cycle: Cycle) -> Iterator[tuple[float, Move]]:
    """Yield every move with its length, m."""
    at = cycle.start_m if cycle.start_m is not None else math.nan
    for step in cycle.steps:
        if isinstance(step, Move):
            yield abs(step.to_m - at), step
            at = step.to_m


def _measuring(cycle: Cycle) -> Iterator[tuple[float, Move]]:
    """Yield the moves at the speed of the cycle; a way back may stay below its speed."""
    if cycle.kind in {"sweep", "stop", "sentinel", "blank"}:
        before_hold = {i for i, step in enumerate(cycle.steps[1:]) if isinstance(step, Hold)}
        moves = [i for i, step in enumerate(cycle.steps) if isinstance(step, Move)]
        for index, (distance, step) in zip(moves, _moves(cycle), strict=True):
            if step.speed_m_s == cycle.speed_m_s or index in before_hold:
                yield distance, step


def _peak_acceleration(distance_m: float, speed_m_s: float, limits: Limits) -> float:
    """Return the largest acceleration of a move, m/s2.

    Below the limit of the axis if the jerk limit does not allow more.
    """
    speed = min(speed_m_s, limits.top_speed_m_s(distance_m))
    return min(limits.acceleration_m_s2, math.sqrt(speed * limits.jerk_m_s3))


def _cycles(count: int) -> str:
    return f"{count} cycle{'' if count == 1 else 's'}"


def _mm(value_m: float) -> str:
    return f"{1e3 * value_m:.5g} mm"


def _mm_s(value_m_s: float) -> str:
    return f"{1e3 * value_m_s:.4g} mm/s"


def _bar(value_pa: float) -> str:
    return f"{value_pa / 1e5:.4g} bar abs"


def _celsius(span_k: tuple[float, float]) -> str:
    return f"{span_k[0] - ZERO_CELSIUS_K:.4g} to {span_k[1] - ZERO_CELSIUS_K:.4g} degC"


#: A breakaway peak lasts a few milliseconds: below this rate its height is lost (assumed).
BURST_RATE_HZ = 5000.0
#: Below this rate between the bursts, stick-slip and short events are invisible (assumed).
BASE_RATE_HZ = 100.0


def cautions(plan: Plan) -> tuple[str, ...]:
    """Return the effects that a plan cannot show, or can show only poorly."""
    protocol, way = plan.protocol, Way.on(plan.protocol, plan.envelope)
    return (
        *_sampling(protocol, way),
        *_settled(protocol, way),
        *_design(protocol),
        *_rig(plan.protocol, plan.identity, plan.envelope),
        *_time(plan),
        *_unused(protocol),
    )


def _sampling(protocol: Protocol, way: Way) -> Iterator[str]:
    samples = protocol.samples
    burst = samples.burst_rate_hz if samples.burst_after_s > 0.0 else 0.0
    if burst < BURST_RATE_HZ:
        yield (
            f"sampling.burst_rate is {burst:g} Hz: breakaway and restart need {BURST_RATE_HZ:g} Hz or more, "
            "or their peaks are too low"
        )
    speeds = [*(protocol.speed.levels_m_s if protocol.speed else ())]
    speeds += protocol.stop.restart_speed_m_s if protocol.stop else ()
    slowest = min(speeds)
    rate = samples.samples_per_stroke / (way.length_m / slowest)
    if rate < BASE_RATE_HZ:
        yield (
            f"at {1e3 * slowest:.4g} mm/s, {samples.samples_per_stroke} samples a stroke are {rate:.2g} a second "
            "between the bursts: enough for a mean force, but not for stick-slip"
        )


def _settled(protocol: Protocol, way: Way) -> Iterator[str]:
    speeds = protocol.speed
    if speeds is None:
        return
    top = speeds.levels_m_s[-1]
    ramp = way.limits.ramp_distance_m(top) / way.length_m
    if ramp > protocol.filter.ignore_initial:
        yield (
            f"at {1e3 * top:.4g} mm/s the axis accelerates over {100 * ramp:.2g} % of the stroke, more than the "
            f"{100 * protocol.filter.ignore_initial:.2g} % that are ignored: the settled part is found from the speed"
        )
    cruise = way.cruise_s(top)
    if cruise * speeds.most_strokes < speeds.settled_time_s:
        yield (
            f"at {1e3 * top:.4g} mm/s, {speeds.most_strokes} strokes last {cruise * speeds.most_strokes:.2g} s at "
            f"constant speed, less than speed.settled_time = {speeds.settled_time_s:g} s"
        )


def _design(protocol: Protocol) -> Iterator[str]:
    if protocol.repeats < 2 and protocol.order.replicates < 2:
        yield "repeats = 1: repeatability cannot be determined"
    if protocol.directions != "both":
        yield f'directions = "{protocol.directions}": friction cannot be separated from an offset of the force'
    varied = [name for name, factor in protocol.hard.items() if len(factor.levels) > 1]
    if varied and protocol.order.replicates < 2:
        yield (
            f"order.replicates = 1: each {' and '.join(varied)} is one block, so its effect cannot be separated from "
            "that of a new set-up"
        )
    if protocol.stop is not None and not protocol.stop.reference_strokes and 0.0 not in protocol.stop.durations_s:
        yield "stop.reference_strokes = 0 and no stop of 0 s: recovery after a stop has no reference"


def _rig(protocol: Protocol, identity: Identity, envelope: Envelope) -> Iterator[str]:
    if envelope.expected_friction_n <= 0.0:
        yield "the rig does not state an expected friction: the check of the force ignores friction"
    if identity.chambers == "open" and protocol.before_block.leak_check_s is not None:
        yield "before_block.leak_check: the chambers of the rig are open, so this check has no effect"
    asked = protocol.conditions.supply_pressure
    ambient = identity.ambient_pressure_pa
    least = max(envelope.supply_pressure_pa, asked.absolute_pa(ambient) if asked is not None else 0.0)
    highest = max(p.absolute_pa(ambient) for pair in protocol.pressure.levels for p in pair)
    if 0.0 < least < highest:
        yield (
            f"the supply may fall to {least / 1e5:.4g} bar abs, but the protocol needs {highest / 1e5:.4g} bar abs: "
            "raise conditions.supply_pressure"
        )


def _time(plan: Plan) -> Iterator[str]:
    limit = plan.protocol.limits.time_s
    if plan.time_s > limit:
        yield f"it takes {plan.time_s / 3600:.3g} h, more than limits.time = {limit / 3600:.3g} h"


def _unused(protocol: Protocol) -> Iterator[str]:
    for table in ("adaptive", "design"):
        if getattr(protocol, table) is not None:
            yield f"[{table}] is not applied: the plan runs as listed, and `pneudrive design` proposes further points"
