"""Checks of the machine builder: side load, buckling of the rod, absorbers, holding force without supply.

Each check names the standard or the maker's rule that it follows. If the data sheet of the part does not give a needed
value, the check reports this.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from pneudrive.constants import STANDARD_GRAVITY_M_S2
from pneudrive.numbers import plain as three
from pneudrive.sizing.shortage import Shortage

if TYPE_CHECKING:
    from pneudrive.sizing.choices import PartChoice
    from pneudrive.sizing.sized_drive import SizedDrive
    from pneudrive.sizing.task import SizingTask

#: Modulus of elasticity of a steel rod, Pa (assumed: usual for steel).
STEEL_PA = 210e9
#: Safety of the rod against buckling (assumed: usual in makers' diagrams for pneumatic cylinders).
BUCKLING_SAFETY = 5.0
#: Free length over stroke of a rod whose cylinder is fixed at its front and whose end is guided, and whose end is free
#: (Euler: effective length 0.7 and 2 times the free length).
EFFECTIVE = {"none": 2.0, "ball": 0.7, "plain": 0.7}


class MachineCheck(NamedTuple):
    """One check.

    Attributes
    ----------
    name : str
    value, limit : float or None
        In the unit; None where no sheet gives it.
    unit : str
    is_kept : bool or None
        None where it cannot be decided.
    rule : str
        Standard or rule that it follows.
    """

    name: str
    value: float | None
    limit: float | None
    unit: str
    is_kept: bool | None
    rule: str

    def __str__(self) -> str:
        known = "not decided" if self.is_kept is None else "kept" if self.is_kept else "NOT KEPT"
        value, limit = (f"{three(one)} {self.unit}" if one is not None else "not on the sheet" for one in self[1:3])
        return f"{self.name}: {value}, limit {limit}: {known} ({self.rule})"


def buckling_n(cylinder: PartChoice, task: SizingTask) -> float | None:
    """Return the buckling force of the rod divided by the safety, N; None for a cylinder without a pushing rod.

    Euler: F = pi^2 E I / (k L)^2 with I = pi d^4/64, L the stroke.
    """
    rod = cylinder.numbers.get("rod_diameter", 0.0)
    if rod == 0.0:
        return None
    inertia = math.pi / 64.0 * rod**4
    return math.pi**2 * STEEL_PA * inertia / (EFFECTIVE[task.guide] * task.stroke_m) ** 2 / BUCKLING_SAFETY


def side_load_n(task: SizingTask) -> float:
    """Return the weight of the load across the axis that the cylinder carries, N; zero with a guide."""
    across = 0.0 if abs(task.incline_rad) == 0.5 * math.pi else math.cos(task.incline_rad)
    return task.mass_kg * STANDARD_GRAVITY_M_S2 * across if task.guide == "none" else 0.0


def push_n(cylinder: PartChoice, task: SizingTask) -> float:
    """Return the largest force on the rod, N: the highest supply pressure on the whole piston."""
    gauge = task.supply_pa + task.supply.spread_pa - task.ambient.pressure_pa
    return gauge * math.pi / 4.0 * cylinder.numbers["bore"] ** 2


def mechanical_shortage(cylinder: PartChoice, task: SizingTask) -> Shortage | None:
    """Return the reason why a cylinder cannot carry the load: side load of its sheet, or buckling of its rod."""
    load, weight = cylinder.printed_si("max_load", "N"), side_load_n(task)
    if load is not None and weight > load:
        said = f"it permits {three(load)} N across, the load weighs {three(weight)} N"
        return Shortage("side load", load / weight, said)
    limit, push = buckling_n(cylinder, task), push_n(cylinder, task)
    if limit is not None and push > limit:
        said = f"the rod can bear {three(limit)} N without buckling, and the piston pushes with {three(push)} N"
        return Shortage("buckling", limit / push, said)
    return None


def machine_checks(drive: SizedDrive, cylinder: PartChoice, task: SizingTask) -> list[MachineCheck]:
    """Return the checks of a sized drive."""
    found = []

    def check(name: str, value: float | None, limit: float | None, unit: str, rule: str) -> None:
        kept = None if value is None or limit is None else value <= limit
        found.append(MachineCheck(name, value, limit, unit, kept, rule))

    weight = side_load_n(task)
    if weight:
        check("side load", weight, cylinder.printed_si("max_load", "N"), "N", "maker's sheet of the cylinder")
    if (buckles := buckling_n(cylinder, task)) is not None:
        rule = f"Euler with a safety of {BUCKLING_SAFETY:g}, steel, effective length {EFFECTIVE[task.guide]:g} strokes"
        check("buckling of the rod", push_n(cylinder, task), buckles, "N", rule)
    energy = cylinder.printed_si("cushion_energy", "J")
    check("energy at the end", drive.energy, energy or task.impact_energy_j, "J", "maker's data sheet, or the task")
    if task.cycles_per_hour and (hourly := cylinder.printed_si("absorber_energy_per_hour", "J")):
        check(
            "energy per hour", 2.0 * task.cycles_per_hour * drive.energy, hourly, "J", "maker's sheet of the absorber"
        )
    hangs = abs(task.mass_kg * STANDARD_GRAVITY_M_S2 * math.sin(task.incline_rad))
    if hangs:
        holds = cylinder.numbers["friction.parameters.coulomb"] * task.spread.friction[0]
        rule = "after ISO 4414: a loss of supply must cause no hazard; without a clamp only friction holds the load"
        check("load that hangs at pressure loss", hangs, holds, "N", rule)
    return found
