"""Which choices of parts cannot do a task, whatever their settings: bounds on the safe side, without simulation.

Every bound takes the favourable end of each spread, so that what it removes fails in all draws.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from pneudrive import units
from pneudrive.constants import AIR_GAS_CONSTANT_J_KG_K, ANR_DENSITY_KG_M3, ANR_TEMPERATURE_K, STANDARD_GRAVITY_M_S2
from pneudrive.describe.circuit import Circuit
from pneudrive.sizing.choices import SAME_STROKE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.sizing.choices import DriveChoice, PartChoice
    from pneudrive.sizing.task import SizingTask

#: By this factor the gas ahead of a piston is compressed, at most, over a whole stroke (assumed): 1.5 leaves room for
#: drives that run ahead of their choked speed.
COMPRESSED = 1.5
#: Time of a run in which the flow through a tube settles, s, and pressure behind it over that before it: choked.
SETTLED_S, VACUUM = 1.0, 1e-4


class Shortage(NamedTuple):
    """What a choice lacks.

    Attributes
    ----------
    limit : str
        What it cannot do.
    share : float
        What it can do at most, over what is needed; below 1. 0 where no change of the task helps.
    said : str
        The same in words.
    """

    limit: str
    share: float
    said: str


class SafeBounds:
    """Bounds of a task.

    Parameters
    ----------
    task : SizingTask
    tubes : sequence of PartChoice
        Tubes that occur.
    """

    def __init__(self, task: SizingTask, tubes: Sequence[PartChoice]) -> None:
        self.task = task
        self.tubes = {tube.name: tube_conductance(tube, task) for tube in tubes}
        ambient = task.ambient.pressure_pa
        self.high, self.low = task.supply_pa + task.supply.spread_pa, task.supply_pa - task.supply.spread_pa
        self.gauge = self.high - ambient
        weight = task.static_force_n - task.external_force_n
        light, heavy = 1.0 - task.spread.mass, 1.0 + task.spread.mass
        out, back = (min(sign * weight * one for one in (light, heavy)) for sign in (1.0, -1.0))
        self.against = {True: out + task.external_force_n, False: back - task.external_force_n}

    def lacks(self, choice: DriveChoice) -> Shortage | None:
        """Return what a choice cannot do, or None."""
        for find in (self._stroke, self._sheet, self._force, self._time):
            found = find(choice)
            if found is not None:
                return found
        return None

    def _stroke(self, choice: DriveChoice) -> Shortage | None:
        stroke = choice.cylinder.numbers["stroke"]
        if abs(stroke - self.task.stroke_m) <= SAME_STROKE * self.task.stroke_m:
            return None
        return Shortage("stroke", 0.0, f"the part has a stroke of {1e3 * stroke:g} mm")

    def _sheet(self, choice: DriveChoice) -> Shortage | None:
        """Hold the task against what the sheets print."""
        for part in (choice.cylinder, choice.valve, choice.tube, choice.flow_control):
            most = part.printed_si("maximum_pressure", "Pa")
            if most is not None and self.gauge > most:
                return Shortage("supply pressure", 0.0, f"{part.name} takes {1e-5 * most:g} bar gauge at most")
            life = part.printed_si("b10_cycles", "")
            if life is not None and self.task.cycles is not None and life < self.task.cycles:
                return Shortage("life", life / self.task.cycles, f"{part.name} has a B10 of {life:g} cycles")
        holding = choice.cylinder.printed_si("coupling_holding_force", "N")
        push = self.gauge * choice.areas_m2[0]
        if holding is not None and push > holding:
            return Shortage(
                "coupling", holding / push, f"the coupling holds {holding:g} N, the piston pushes {push:.0f} N"
            )
        load = choice.cylinder.printed_si("max_load", "N")
        if load is not None and self.task.guide == "none":
            weight = self.task.mass_kg * STANDARD_GRAVITY_M_S2 * math.cos(self.task.incline_rad)
            if weight > load:
                return Shortage(
                    "load", load / weight, f"the carriage carries {load:g} N, the load weighs {weight:.0f} N"
                )
        return None

    def _force(self, choice: DriveChoice) -> Shortage | None:
        friction = choice.cylinder.table["friction"]["coulomb"]
        least = self.task.spread.friction[0] * _newton(friction)
        areas = choice.areas_m2
        for outward, area in zip((True, False), areas, strict=True):
            most = self.gauge * area
            needed = self.against[outward] + least
            if outward:
                needed = max(needed, self.against[True] + self.task.holding_force_n)
            if most < needed:
                way = "outwards" if outward else "back"
                return Shortage("force", max(most, 0.0) / needed, f"{way}: {most:.0f} N at most, {needed:.0f} N needed")
        return None

    def _time(self, choice: DriveChoice) -> Shortage | None:
        areas = choice.areas_m2
        for outward, area, other, limit in (
            (True, *areas, self.task.outward_s),
            (False, *reversed(areas), self.task.back_s),
        ):
            least = max(self._thrust_s(choice, outward, area), self._flow_s(choice, other, outward))
            if least > limit:
                way = "outwards" if outward else "back"
                return Shortage("time", limit / least, f"{way}: {least:.3g} s at least, {limit:.3g} s allowed")
        return None

    def _thrust_s(self, choice: DriveChoice, outward: bool, area: float) -> float:
        """Return the time of a stroke under the full force all the way, without friction."""
        spread = self.task.spread
        own = choice.cylinder.numbers["moving_mass"]
        own *= 1.0 - spread.assumed * ("moving_mass" in choice.cylinder.assumed)
        mass = own + self.task.mass_kg * (1.0 - spread.mass)
        force = self.gauge * area - self.against[outward]
        return math.sqrt(2.0 * self.task.stroke_m * mass / force) if force > 0.0 else math.inf

    def _flow_s(self, choice: DriveChoice, area: float, outward: bool) -> float:
        """Return the least time in which the gas ahead of the piston leaves: choked, and compressed all the while."""
        wide = 1.0 + 2.0 * self.task.spread.conductance
        valve = choice.valve.numbers
        sizes = [valve.get("exhaust_conductance", valve["conductance"]), self.tubes[choice.tube.name]]
        sizes += [choice.flow_control.numbers["needle_conductance"]] if choice.is_throttled else []
        hot = self.task.spread.temperature_k[1]
        speed = min(sizes) * wide * ANR_DENSITY_KG_M3 * AIR_GAS_CONSTANT_J_KG_K * math.sqrt(ANR_TEMPERATURE_K * hot)
        driven = max(-self.against[outward], 0.0)  # a load that pulls compresses the gas as well
        compressed = COMPRESSED + driven / (self.low * area)
        kept = (compressed - 1.0) * (1.0 + self.task.spread.assumed) * _dead(choice, "b" if outward else "a")
        return max(area * self.task.stroke_m - kept, 0.0) / (compressed * speed)


def air_estimate_kg(choice: DriveChoice, task: SizingTask) -> float:
    """Return the air of a cycle in which both sides fill wholly, kg."""
    areas = choice.areas_m2
    volume = sum(areas) * task.stroke_m + _dead(choice, "a") + _dead(choice, "b")
    gauge = task.supply_pa - task.ambient.pressure_pa
    return gauge * volume / (AIR_GAS_CONSTANT_J_KG_K * task.ambient.temperature_k)


def tube_conductance(tube: PartChoice, task: SizingTask) -> float:
    """Return the sonic conductance of a tube, m3/(s Pa), from its choked flow."""
    pressure = task.supply_pa
    mains = {"kind": "reservoir", "pressure": f"{pressure!r} Pa abs", "temperature": f"{ANR_TEMPERATURE_K} K"}
    line = Circuit.model_validate(
        {
            "ambient": {"pressure": f"{VACUUM * pressure!r} Pa abs"},
            "components": {"mains": mains, "tube": dict(tube.table)},
            "connections": ("mains -> tube -> ambient",),
        }
    )
    run = line.simulate(None, SETTLED_S, sample_rate=1.0 / SETTLED_S)
    return abs(float(run["tube.mass_flow"][-1])) / (ANR_DENSITY_KG_M3 * pressure)


def _dead(choice: DriveChoice, end: str) -> float:
    """Return the volume beside the stroke on one side: dead volume, port of the cushion, tube, m3."""
    numbers, tube = choice.cylinder.numbers, choice.tube.numbers
    own = numbers[f"dead_volume_{end}"] + numbers.get(f"cushion_{end}_port_volume", 0.0)
    return own + math.pi / 4.0 * tube["diameter"] ** 2 * tube["length"]


def _newton(given: object) -> float:
    return units.parse(str(given["value"] if isinstance(given, dict) else given), "N")
