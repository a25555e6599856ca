"""A plan: cycles in order, each with its time and size."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from pneudrive.repr_tables import Shown
from pneudrive.rig.interface import Move

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.planning.points import Cell
    from pneudrive.campaign.planning.protocol import Protocol
    from pneudrive.rig.interface import Envelope, Identity

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
