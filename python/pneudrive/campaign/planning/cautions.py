"""Cautions about a plan that may be run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.campaign.planning.points import Way

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.campaign.planning.planned import Plan
    from pneudrive.campaign.planning.protocol import Protocol
    from pneudrive.rig.interface import Envelope, Identity

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
