"""Choices of parts that pass the safe bounds, as cylinders with tubes, and the reason for each removed choice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.sizing.candidate import Dropped, TubedCylinder
from pneudrive.sizing.choices import SLOTS, choices, grouped
from pneudrive.sizing.prune import SafeBounds, air_estimate_kg

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.sizing.choices import PartChoice
    from pneudrive.sizing.shortage import Shortage
    from pneudrive.sizing.task import SizingTask


class Pruning:
    """Parts of the catalogue for a task, without those that cannot do it with any settings.

    Parameters
    ----------
    task : SizingTask
    """

    def __init__(self, task: SizingTask) -> None:
        self.task = task
        self.pairs: list[TubedCylinder] = []
        self.dropped: list[Dropped] = []
        self.shortages: list[tuple[dict[str, str], Shortage]] = []
        self.found = found = choices(task)
        self.bounds = bounds = SafeBounds(task, found["tube"])
        self.enumerated = int(np.prod([len(found[slot]) for slot in SLOTS]))
        kept: dict[str, list[PartChoice]] = {}
        for slot in SLOTS:
            lacks = {one.name: bounds.cylinder(one) if slot == "cylinder" else bounds.part(one) for one in found[slot]}
            kept[slot] = grouped([one for one in found[slot] if lacks[one.name] is None])
            for name, shortage in lacks.items():
                if shortage is not None:
                    others = [len(found[other]) for other in SLOTS if other != slot]
                    self._drop({slot: name}, int(np.prod(others)), shortage)
        for cylinder in kept["cylinder"]:
            for tube in kept["tube"]:
                self._pair(cylinder, tube, kept["valve"], kept["flow_control"], bounds)
        self.pairs.sort(key=lambda one: (one.fill, one.cylinder.name, one.tube.name))

    def _drop(self, parts: dict[str, str], count: int, shortage: Shortage) -> None:
        every = {slot: parts.get(slot, "*") for slot in SLOTS}
        self.dropped.append(Dropped(every, count, shortage.limit, shortage.said))
        self.shortages.append((every, shortage))

    def _pair(
        self,
        cylinder: PartChoice,
        tube: PartChoice,
        valves: Sequence[PartChoice],
        controls: Sequence[PartChoice],
        bounds: SafeBounds,
    ) -> None:
        """Leave out valves and flow controls through which the gas cannot leave in time."""
        names = {"cylinder": cylinder.name, "tube": tube.name}
        slow = {valve.name: bounds.flow(cylinder, tube, valve=valve) for valve in valves}
        slow |= {control.name: bounds.flow(cylinder, tube, control=control) for control in controls}
        wide = [valve for valve in valves if slow[valve.name] is None]
        open_ = [control for control in controls if slow[control.name] is None]
        for slot, every, others in (("valve", valves, len(controls)), ("flow_control", controls, len(wide))):
            for one in every:
                if others and (shortage := slow[one.name]) is not None:
                    self._drop(names | {slot: one.name}, others, shortage)
        if wide and open_:
            fill = air_estimate_kg(cylinder, tube, self.task)
            self.pairs.append(TubedCylinder(cylinder, tube, wide, open_, fill, bounds.tubes[tube.name]))
