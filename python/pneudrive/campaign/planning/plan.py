"""The plan of a campaign: every cycle in order, its time and its size on disk."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from pneudrive.batching import many_objects
from pneudrive.campaign.planning.order import ordered_blocks, ordered_cells
from pneudrive.campaign.planning.planned import BYTES_PER_SAMPLE, Plan, Planned, size_of
from pneudrive.campaign.planning.points import (
    VENTED,
    Builder,
    Cell,
    Pair,
    Way,
    cycle_count,
    cycle_samples,
    cycle_time_s,
    pairs,
)
from pneudrive.campaign.planning.preflight import check, check_range
from pneudrive.constants import STANDARD_GRAVITY_M_S2
from pneudrive.errors import ProtocolError, nearest
from pneudrive.files.bounds import within
from pneudrive.rig.interface import Hold
from pneudrive.rig.plain_data import identity_of, plain

if TYPE_CHECKING:
    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.planning.protocol import Protocol
    from pneudrive.rig.interface import Envelope, Identity


def lay_out(protocol: Protocol, identity: Identity, envelope: Envelope) -> Plan:
    """Lay out a protocol for a rig and check it against the rig's limits.

    The same arguments give the same plan, on every machine; keys of cycles do not depend on other cycles.

    Parameters
    ----------
    protocol : Protocol
    identity : Identity
        Ambient pressure, areas and masses; for a resumed campaign, those in its folder.
    envelope : Envelope

    Returns
    -------
    Plan

    Raises
    ------
    ProtocolError
        If the plan exceeds the rig's limits; the message names cycle, value, limit and remedy.
    RigError
        If the identity has a value that no rig has.
    """
    # The description of a custom rig goes into its folder, and must be readable from there.
    identity_of(json.loads(json.dumps(identity.to_dict(), default=plain)), f'rig "{identity.name}"')
    plan = draft(protocol, identity, envelope)
    return Plan(protocol, identity, envelope, plan.planned, check(plan))


def draft(protocol: Protocol, identity: Identity, envelope: Envelope) -> Plan:
    """Lay out a protocol without a check against the rig's limits; `lay_out` does both."""
    check_range(protocol, envelope)
    count = cycle_count(protocol)
    within("cycles", count, f"the protocol asks for {count:,} cycles or more", ProtocolError, protocol.origin)
    layout = _Layout(protocol, Builder(protocol, identity, envelope))
    with many_objects():
        planned = layout.run()
    seen: set[str] = set()
    for one in planned:
        if one.cycle.key in seen:
            raise ProtocolError(
                f"two cycles have the key {one.cycle.key}",
                where=protocol.origin,
                rule="levels must differ within 6 significant digits",
            )
        seen.add(one.cycle.key)
    return Plan(protocol, identity, envelope, tuple(planned))


def cell_name(levels: dict[str, str], cell: Cell) -> str:
    """Return the name of a cell within the campaign: ``mounting = foot: stop/t15/...``."""
    hard = ", ".join(f"{name} = {level}" for name, level in levels.items())
    return f"{hard}: {cell.name}" if hard else cell.name


class _Layout:
    """Collector of the cycles, block by block."""

    def __init__(self, protocol: Protocol, builder: Builder) -> None:
        self.protocol, self.make = protocol, builder
        self.way: Way = builder.way
        self.planned: list[Planned] = []
        self._takes: dict[str, tuple[float, int]] = {}  # cell or key -> time on the axis, samples
        self.at = VENTED.absolute_pa(builder.ambient_pa)
        highest = [
            max(side, key=lambda p: p.absolute_pa(builder.ambient_pa))
            for side in zip(*protocol.pressure.levels, strict=True)
        ]
        self.highest = Pair(*highest)

    def run(self) -> list[Planned]:
        chosen = self._fraction()
        before: dict[str, str] = {}
        number = 0
        for index, levels in enumerate(ordered_blocks(self.protocol), start=1):
            cells = [
                (cell, repeat)
                for cell, repeat in ordered_cells(self.protocol, index)
                if chosen is None or cell_name(levels, cell) in chosen
            ]
            if cells:
                number += 1
                self._block(number, levels, before, cells)
                before = levels
        return self.planned

    def _fraction(self) -> set[str] | None:
        fraction = self.protocol.fraction
        if fraction is None:
            return None
        cells = [cell for cell, repeat in ordered_cells(self.protocol, 1) if repeat == 1]
        known = {cell_name(levels, cell) for levels in ordered_blocks(self.protocol) for cell in cells}
        for name in fraction.cells:
            if name not in known:
                remedy = nearest(name, known) if len(known) < 20 else nearest(name, known).partition(" Known")[0]
                raise self.protocol.fail(
                    "fraction.cells",
                    f"fraction.cells: there is no cell {name!r}",
                    rule="a cell combines levels of the protocol",
                    remedy=remedy if remedy.startswith("Did") else "`pneudrive design` writes them.",
                )
        return set(fraction.cells)

    def _block(self, block: int, levels: dict[str, str], before: dict[str, str], cells: list[tuple[Cell, int]]) -> None:
        p, make, blank_m_s = self.protocol, self.make, self.protocol.before_block.blank_stroke_m_s
        make.begin_block(block, levels)
        for name, factor in p.hard.items():
            if before.get(name) != levels[name] or (block > 1 and before == levels):
                ask = factor.ask or f"{name}: {{level}}. Confirm when it is in place."
                self._add(make.operator(name, ask.replace("{level}", levels[name])), wait_s=factor.time_s)
        self._prepare(new=block == 1 or any(before.get(name) != levels.get(name) for name in ("seal", "drive")))
        if blank_m_s is not None:
            self._add(make.blank("before", blank_m_s))
        every = p.sentinel.every if p.sentinel is not None else 0
        sentinels = 0
        for index, (cell, repeat) in enumerate(cells):
            if every and index % every == 0:
                sentinels += 1
                self._add(make.sentinel(sentinels))
            self._add(make.point(cell, repeat), cell=cell)
        if every:
            self._add(make.sentinel(sentinels + 1))
        if blank_m_s is not None:
            self._add(make.blank("after", blank_m_s))

    def _prepare(self, *, new: bool) -> None:
        """Run in new parts, warm up, then check the sensors. The zero of the sensors is then that of the warm rig."""
        make, warm_up, checks = self.make, self.protocol.warm_up, self.protocol.before_block
        if warm_up is not None:
            if new and warm_up.run_in_cycles:
                self._add(make.warm_up("run-in", warm_up.run_in_cycles, warm_up.speed_m_s))
            if warm_up.cycles:
                self._add(make.warm_up("warm-up", warm_up.cycles, warm_up.speed_m_s))
        if checks.tare_s is not None:
            self._add(make.standing("tare", Hold(checks.tare_s, released=True), VENTED))
        weight = checks.known_weight
        if weight is not None:
            mass, force = f"{weight.mass_kg:g} kg", weight.mass_kg * STANDARD_GRAVITY_M_S2
            on = f"Uncouple the drive and hang the known weight of {mass} on the force sensor, pulling in +x."
            off = f"Take the weight of {mass} off and couple the drive again."
            self._add(make.operator("weight-on", on), wait_s=weight.change_s)
            self._add(make.standing("weight", Hold(weight.time_s, weight_n=force), VENTED, weight.mass_kg))
            self._add(make.operator("weight-off", off), wait_s=weight.change_s)
        if checks.leak_check_s is not None:
            self._add(make.standing("leak", Hold(checks.leak_check_s, shut=True), self.highest))

    def _add(self, cycle: Cycle, *, wait_s: float = 0.0, cell: Cell | None = None) -> None:
        now = (cycle.pressure_a_pa, cycle.pressure_b_pa)
        if now != self.at:
            wait_s += self.protocol.pressure.settling_s
            self.at = now
        name = cell.name if cell is not None else cycle.key
        if name not in self._takes:
            self._takes[name] = cycle_time_s(cycle, self.way.limits), cycle_samples(cycle, self.way.limits)
        axis_s, samples = self._takes[name]
        self.planned.append(Planned(cycle, axis_s, wait_s, samples, cell))


__all__ = ["BYTES_PER_SAMPLE", "Plan", "Planned", "cell_name", "draft", "lay_out", "pairs", "size_of"]
