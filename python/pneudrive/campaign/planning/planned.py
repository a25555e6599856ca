"""A plan as data: range of the axis, and cycles in running order."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from pneudrive.campaign.cycle import Cycle
from pneudrive.repr_tables import Shown
from pneudrive.rig.interface import Envelope, Identity
from pneudrive.rig.motion import Limits

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pneudrive.arrays import Interval
    from pneudrive.campaign.planning.protocol import Protocol


#: Bytes per sample in a file of `write_cycle`: 15 (long stops) to 21 (fast sweeps) on simulated rigs.
BYTES_PER_SAMPLE = 20.0
#: Bytes of the header and the Parquet metadata of a cycle's file (measured).
BYTES_PER_CYCLE = 5000.0


@dataclass(frozen=True)
class Planned:
    """A cycle of a plan.

    Attributes
    ----------
    cycle : Cycle
    wait_s : float
        Assumed time before the cycle, s, from the protocol: pressure settling, or work of the operator.
    axis_s : float
        Time of the moves and holds, s. Exact if the axis reaches its limits.
    samples : int
    """

    cycle: Cycle
    wait_s: float
    axis_s: float
    samples: int

    @property
    def time_s(self) -> float:
        """Total time, s."""
        return self.axis_s + self.wait_s


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
    planned: tuple[Planned, ...] = ()
    notes: tuple[str, ...] = ()

    @cached_property
    def cycles(self) -> tuple[Cycle, ...]:
        """All cycles, in order."""
        return tuple(one.cycle for one in self.planned)

    @cached_property
    def ends_m(self) -> Interval:
        """Ends of the part of the stroke that the campaign uses."""
        (low, high), used = self.envelope.position_m, self.protocol.position
        if used.range is None:
            return low + used.margin_m, high - used.margin_m
        return used.range[0].at(low, high), used.range[1].at(low, high)

    @property
    def length_m(self) -> float:
        """Length of a stroke, m."""
        return self.ends_m[1] - self.ends_m[0]

    @cached_property
    def limits(self) -> Limits:
        """Limits of the axis."""
        return Limits(self.envelope.acceleration_m_s2, self.envelope.jerk_m_s3)

    def cruise_s(self, speed_m_s: float) -> float:
        """Return the time at constant speed in a stroke, s; 0 if the stroke is too short for its ramps."""
        return max(self.length_m / speed_m_s - self.limits.ramp_time_s(speed_m_s), 0.0)

    @cached_property
    def allowed(self) -> Envelope:
        """Limits of the rig, tightened by the protocol."""
        rig, tight = self.envelope, self.protocol.limits
        low, high = rig.pressure_pa
        if tight.pressure is not None:
            high = min(high, tight.pressure.absolute_pa(self.identity.ambient_pressure_pa))
        upper = {
            name: min(getattr(rig, name), getattr(tight, name) or math.inf)
            for name in ("speed_m_s", "acceleration_m_s2", "force_n")
        }
        return replace(rig, pressure_pa=(low, high), **upper)

    @property
    def time_s(self) -> float:
        """Total time, s, without homing and changes of pressure."""
        return sum(one.time_s for one in self.planned)

    def remaining_s(self, done: set[str]) -> float:
        """Return the time of the cycles whose keys are not in `done`, s."""
        return sum(one.time_s for one in self.planned if one.cycle.key not in done)


def size_of(planned: Iterable[Planned]) -> float:
    """Return the size on disk, bytes, estimated by `BYTES_PER_SAMPLE`. An operator's step also writes a file."""
    return sum(BYTES_PER_SAMPLE * one.samples + BYTES_PER_CYCLE for one in planned)
