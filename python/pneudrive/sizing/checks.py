"""Checks of the machine builder: side load, buckling of the rod, absorbers, holding force without supply.

Each check names the standard or the maker's rule that it follows. If the data sheet of the part does not give a needed
value, the check reports this.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from pneudrive.constants import STANDARD_GRAVITY_M_S2
from pneudrive.errors import OPEN_CHECK
from pneudrive.numbers import plain as three
from pneudrive.sizing.judge import energy_limit
from pneudrive.sizing.shortage import Shortage

if TYPE_CHECKING:
    from pneudrive.sizing.choices import DriveChoice, PartChoice
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
        In the unit; None if no data sheet states it.
    unit : str
    is_kept : bool or None
        None if it cannot be decided.
    rule : str
        Standard or rule that it follows.
    remedies : tuple of str
        Changes of task or catalogue, each of which closes the check.
    """

    name: str
    value: float | None
    limit: float | None
    unit: str
    is_kept: bool | None
    rule: str
    remedies: tuple[str, ...] = ()

    @property
    def is_open(self) -> bool:
        """Whether the drive must not be ordered yet: the check is not kept, or not decided."""
        return self.is_kept is not True

    def __str__(self) -> str:
        state = "not decided" if self.is_kept is None else "kept" if self.is_kept else "NOT KEPT"
        value, limit = (f"{three(one)} {self.unit}" if one is not None else "" for one in self[1:3])
        limit = limit or ("of the machine" if self.is_kept else "not on the sheet")
        line = f"{self.name}: {value}, limit {limit}: {state} ({self.rule})"
        return f"{OPEN_CHECK}{line}. Remedy: {'; or '.join(self.remedies)}" if self.is_open else line


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


def machine_checks(drive: SizedDrive, choice: DriveChoice, task: SizingTask) -> list[MachineCheck]:
    """Return the checks of a sized drive: those that are not kept first, then those that are not decided."""
    found, cylinder = [], choice.cylinder

    def check(name: str, value: float, limit: float | None, unit: str, rule: str, *remedies: str) -> None:
        kept = None if limit is None else value <= limit
        found.append(MachineCheck(name, value, limit, unit, kept, rule, remedies))

    own = "of the maker's sheet in a catalogue of your own (--catalogue)"
    weight = side_load_n(task)
    if weight:
        carried = 'guide = "ball" or "plain", if the machine carries the load'
        limit = cylinder.printed_si("max_load", "N")
        check("side load", weight, limit, "N", "maker's sheet of the cylinder", carried, f"printed.max_load {own}")
    if (buckles := buckling_n(cylinder, task)) is not None:
        rule = f"Euler with a safety of {BUCKLING_SAFETY:g}, steel, effective length {EFFECTIVE[task.guide]:g} strokes"
        check("buckling of the rod", push_n(cylinder, task), buckles, "N", rule)
    limit, origin = energy_limit(task, choice)
    absorber = "impact_energy, from the data sheet of cylinder or shock absorber"
    check("energy at the end", drive.energy, limit, "J", origin, absorber)
    if task.cycles_per_hour and (hourly := cylinder.printed_si("absorber_energy_per_hour", "J")):
        energy = 2.0 * task.cycles_per_hour * drive.energy
        check("energy per hour", energy, hourly, "J", "maker's sheet of the absorber", "fewer cycles_per_hour")
    if task.cycles is not None:
        lives = [part.printed_si("b10_cycles", "") for part in (cylinder, choice.valve)]
        life = min((one for one in lives if one is not None), default=None) if None not in lives else None
        kept = None if life is None else task.cycles <= life
        rule, remedy = "B10 of cylinder and valve, ISO 19973", f"printed.b10_cycles of both {own}"
        found.append(MachineCheck("life", task.cycles, life, "cycles", kept, rule, (remedy,)))
    if math.sin(task.incline_rad):
        found.append(_hanging_load(choice, task))
    return sorted(found, key=lambda one: (one.is_kept is not False, one.is_kept is not None))


def _hanging_load(choice: DriveChoice, task: SizingTask) -> MachineCheck:
    """Return the check of the load and piston that hang when the pressure fails."""
    numbers = choice.cylinder.numbers
    mass = task.mass_kg * (1.0 + task.spread.mass) + numbers["moving_mass"]
    hangs = mass * STANDARD_GRAVITY_M_S2 * abs(math.sin(task.incline_rad))
    name, rule = "load that hangs at pressure loss", "after ISO 4414: a loss of supply must cause no hazard"
    if task.held_by == "machine":
        return MachineCheck(name, hangs, None, "N", True, f'{rule}; held_by = "machine"')
    holds, is_known = task.clamp_force_n, True
    rule += "; held by the clamp of the task" if task.held_by else "; without a clamp only friction holds the load"
    if holds is None:
        holds = numbers["friction.parameters.coulomb"] * task.spread.friction[0]
        is_known = holds < hangs or "friction.coulomb" not in choice.cylinder.assumed
        rule += "" if is_known else ", and this friction is assumed"
    remedies = (
        f'a clamp: held_by = "clamp", clamp_force = "{math.ceil(hangs)} N" or more',
        'held_by = "machine", if a lock or brake of the machine holds the load',
    )
    return MachineCheck(name, hangs, holds, "N", hangs <= holds if is_known else None, rule, remedies)
