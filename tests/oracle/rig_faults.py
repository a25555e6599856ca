"""Rig with deliberate faults, to test how a campaign handles them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RigError
from pneudrive.rig.interface import RigState, closed_after
from pneudrive.rig.simulated import SimulatedRig

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from pneudrive.rig.description import RigDescription
    from pneudrive.rig.interface import Rig, Samples, Sampling, Step


@dataclass(frozen=True)
class Fault:
    """Fault of a rig.

    Parameters
    ----------
    kind : str
        ``stuck``: a channel keeps its value from the beginning of the interval; ``nan``: it reads NaN; ``saturated``:
        the upper end of its range, or `value`; ``offset``: too high by `value`. ``dropped`` and ``duplicated``:
        samples are lost, or repeated; ``clock``: the clock jumps back by `value` s. ``lost``: RigError in the middle
        of a cycle. ``state``: `looks` readings of the state give `value` for `channel`, or the fault `text`.
    cycles : container of int, optional
        Affected calls of `acquire`, counted from 1; None: all.
    begin_s, end_s : float
        Interval within the cycle.
    channel : str
        Channel of the samples, or of `RigState` for kind ``state``.
    value : float, optional
    text : str
        Fault in the state, or message of the lost connection.
    looks : int
        Kind ``state``: number of affected calls of `state`, from the first one after the previous cycle.
    """

    kind: str
    cycles: tuple[int, ...] | range | None = None
    begin_s: float = 0.0
    end_s: float = float("inf")
    channel: str = "force_n"
    value: float | None = None
    text: str = ""
    looks: int = 3

    def strikes(self, cycle: int) -> bool:
        """Return whether the fault affects a cycle."""
        return self.cycles is None or cycle in self.cycles


@dataclass
class FaultyRig:
    """Rig with faults; all other methods are passed on unchanged, including `memory` and `truth`.

    Parameters
    ----------
    rig : Rig
    faults : sequence of Fault

    Examples
    --------
    >>> from pneudrive.rig import Hold, Samples, Sampling, load_rig
    >>> rig = FaultyRig(load_rig(), [Fault("nan", cycles=(2,), begin_s=0.5, end_s=0.6)])
    >>> [bool(np.isnan(Samples.join(list(rig.acquire([Hold(1.0)], Sampling()))).force_n).any()) for _ in range(2)]
    [False, True]
    """

    rig: Rig
    faults: Sequence[Fault]
    cycle: int = field(default=0, init=False)
    looks: int = field(default=0, init=False)

    def __getattr__(self, name: str) -> Any:
        """Pass on all other attributes of the rig."""
        if name.startswith("__") or name == "rig":
            raise AttributeError(name)
        return getattr(self.rig, name)

    def state(self) -> RigState:
        """Return the state of the rig; a fault may change it before the affected cycle."""
        state = self.rig.state()
        self.looks += 1
        for fault in self.faults:
            if fault.kind == "state" and fault.strikes(self.cycle + 1) and self.looks <= fault.looks:
                shown = fault.text or fault.value
                state = replace(state, **{"fault" if fault.text else fault.channel: shown})
        return state

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        """Run the steps, with faults in the samples."""
        self.cycle += 1
        self.looks = 0
        struck = [fault for fault in self.faults if fault.kind != "state" and fault.strikes(self.cycle)]
        return self._spoil(self.rig.acquire(steps, sampling), struck)

    def _spoil(self, parts: Iterator[Samples], faults: Iterable[Fault]) -> Iterator[Samples]:
        kept: dict[int, float] = {}
        limits = self.rig.identity().limits
        with closed_after(parts) as given:
            for samples in given:
                time, spoiled = samples.time_s, samples
                for i, fault in enumerate(faults):
                    inside = (fault.begin_s <= time) & (time < fault.end_s)
                    if not inside.any():
                        continue
                    if fault.kind == "lost":
                        raise RigError(fault.text or "the connection to the rig is lost")
                    if fault.kind in ("dropped", "duplicated"):
                        times = np.where(inside, 2 if fault.kind == "duplicated" else 0, 1)
                        spoiled, time = spoiled.rows(np.repeat(np.arange(time.size), times)), np.repeat(time, times)
                        continue
                    channel = "time_s" if fault.kind == "clock" else fault.channel
                    values = getattr(spoiled, channel).copy()
                    if fault.kind == "stuck":
                        values[inside] = kept.setdefault(i, float(values[inside][0]))
                    elif fault.kind == "saturated":
                        values[inside] = limits[channel][1] if fault.value is None else fault.value
                    elif fault.kind == "nan":
                        values[inside] = np.nan
                    else:
                        values[inside] += (fault.value or 0.0) * (-1.0 if fault.kind == "clock" else 1.0)
                    spoiled = replace(spoiled, **{channel: values})
                yield spoiled


def with_tables(description: RigDescription, **changes: dict[str, Any]) -> RigDescription:
    """Return the description of a rig with other values in some of its tables."""
    tables = description.tables
    changed = {name: getattr(tables, name).model_copy(update=values) for name, values in changes.items()}
    return replace(description, tables=tables.model_copy(update=changed))


def with_friction(rig: SimulatedRig, law: str | None = None, **parameters: float) -> SimulatedRig:
    """Return a rig with another friction law or other parameters (SI, names as in the drive file)."""
    known = rig.description.friction
    changed = known | {"law": law or known["law"], "parameters": known["parameters"] | parameters}
    return SimulatedRig(replace(rig.description, friction=changed))
