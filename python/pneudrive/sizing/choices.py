"""Catalogue parts for a task: cylinders, valves, tubes and flow controls, with assumed values for gaps in data sheets.

A value that a data sheet does not give is assumed by a rule of this module. Every file and result marks it as assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any

from pneudrive import units
from pneudrive.describe.components import component_class
from pneudrive.describe.files.catalogue import PREFIX, Entry, check, entries, part_table
from pneudrive.describe.files.sourced import parted
from pneudrive.errors import wrong

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pneudrive.arrays import Keyed, NamedNumbers, Plain
    from pneudrive.sizing.task import SizingTask

CYLINDERS = ("cylinder/rodless", "cylinder/single-rod", "cylinder/through-rod")
PROPORTIONAL = "valve/proportional-5/3"
VALVES = ("valve/switching-5/2", "valve/switching-5/3", PROPORTIONAL)
TUBE, FLOW_CONTROL = "tube", "flow-control"
#: Slots of a drive -> kinds of components for it.
SLOTS: dict[str, tuple[str, ...]] = {
    "cylinder": CYLINDERS,
    "valve": VALVES,
    "tube": (TUBE,),
    "flow_control": (FLOW_CONTROL,),
}
#: Name in the slot of flow controls for a drive without flow controls.
WITHOUT = "none"
#: Density of steel, kg/m3 (assumed), for the mass of a rod.
STEEL_KG_M3 = 7850.0
#: Pressure at which makers state forces, Pa above ambient.
CATALOGUE_PA = 6e5
#: Length up to which a cushion counts as a rubber element, m (assumed).
RUBBER_M = 5e-3
#: Largest length of a cushion as a fraction of the stroke: longer cushions would overlap, and are left out.
LONGEST_CUSHION = 0.45
#: Stiffness of the end stops, N/m (assumed; less than 0.1 mm deflection under the force of a piston), and damping
#: relative to critical damping (a piston does not rebound, and the contact takes few steps).
STOP_N_M, STOP_DAMPING = 1e7, 8.0
#: Relative difference below which strokes count as equal.
SAME_STROKE = 1e-3


@dataclass(frozen=True)
class PartChoice:
    """Part of the catalogue as a component of the circuit for a task.

    Attributes
    ----------
    name : str
        Name in the catalogue.
    table : dict
        Table of the component, each value with its origin.
    numbers : dict
        Numbers of the part by key, SI. Keys of its friction begin with ``friction.parameters.``.
    form : tuple
        Properties that are not numbers. Parts of equal form differ only in their numbers.
    assumed : frozenset of str
        Keys of assumed values.
    printed : dict
        Further figures of the sheet.
    alike : tuple of str
        Names of catalogue parts that give the same results.
    """

    name: str
    table: Mapping[str, Any]
    numbers: Mapping[str, float]
    form: tuple[str, ...] = ()
    assumed: frozenset[str] = frozenset()
    printed: Mapping[str, Any] = field(default_factory=dict)
    alike: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """Kind of the component."""
        return self.table["kind"]

    def printed_si(self, key: str, unit: str) -> float | None:
        """Return a printed figure in SI, or None."""
        given = self.printed.get(key)
        if given is None:
            return None
        if unit == "Pa":
            return units.parse_pressure(given).value_pa
        return units.parse(given, unit) if unit else float(given)

    @property
    def tube_diameter_m(self) -> float | None:
        """Outer diameter of a tube, or of the tubes that fit into the connectors of another part, m."""
        return self.printed_si("outer_diameter", "m") or self.printed_si("tube_outer_diameter", "m")


NO_FLOW_CONTROL = PartChoice(WITHOUT, {"kind": FLOW_CONTROL}, {})


@dataclass(frozen=True)
class DriveChoice:
    """One combination of parts.

    Attributes
    ----------
    cylinder, valve, tube, flow_control : PartChoice
        A flow control called "none" is left out.
    """

    cylinder: PartChoice
    valve: PartChoice
    tube: PartChoice
    flow_control: PartChoice

    @property
    def parts(self) -> dict[str, str]:
        """Names of the parts by slot."""
        return {slot: getattr(self, slot).name for slot in SLOTS}

    @property
    def name(self) -> str:
        """Names of the parts, joined to one word."""
        return "+".join(self.parts.values())

    @property
    def is_throttled(self) -> bool:
        """Whether the choice has flow controls."""
        return self.flow_control.name != WITHOUT

    @property
    def sizes(self) -> tuple[float, ...]:
        """Bore, conductances of valve and fully open needle (0 without a needle), bore of the tubes; SI."""
        needle = self.flow_control.numbers["needle_conductance"] if self.is_throttled else 0.0
        return self.cylinder.numbers["bore"], self.valve.numbers["conductance"], needle, self.tube.numbers["diameter"]

    @property
    def valve_paths(self) -> dict[str, NamedNumbers]:
        """Paths from the supply and to the exhaust that the valve opens for a stroke: name -> numbers, SI."""
        valve = self.valve.numbers
        alike = {key: valve[key] for key in ("subsonic_index", "linear_above")}
        ends = {"feed": ("conductance", "critical_pressure_ratio")}
        ends["vent"] = ("exhaust_conductance", "exhaust_critical_pressure_ratio")
        return {
            name: alike | {own: valve.get(key, valve[own]) for own, key in zip(ends["feed"], keys, strict=True)}
            for name, keys in ends.items()
        }

    @property
    def is_cushioned(self) -> bool:
        """Whether the cylinder has cushions."""
        return "cushion_b_length" in self.cylinder.numbers

    @property
    def areas_m2(self) -> tuple[float, float]:
        """Areas of the piston on the sides of chamber a and chamber b."""
        numbers, kind = self.cylinder.numbers, self.cylinder.kind
        whole, rod = (math.pi / 4.0 * numbers.get(key, 0.0) ** 2 for key in ("bore", "rod_diameter"))
        return whole - rod * (kind == "cylinder/through-rod"), whole - rod * (kind != "cylinder/rodless")


def choices(task: SizingTask) -> dict[str, list[PartChoice]]:
    """Return the parts of the catalogue for each slot, without those that the task excludes.

    Raises
    ------
    DescriptionError
        A part of the catalogue is not valid, or no part is left for a slot.
    """
    known = [entry for entry in entries().values() if not entry.is_drive]
    found: dict[str, list[PartChoice]] = {}
    for slot, kinds in SLOTS.items():
        chosen = [one for one in known if one.kind in kinds and not task.excludes(one.name, one.kind)]
        if not task.servo_valves:
            chosen = [one for one in chosen if one.kind != PROPORTIONAL]
        found[slot] = [_MAKERS[slot](one, task) for one in sorted(chosen, key=lambda one: one.name)]
    for slot, parts in found.items():
        if not parts and slot != "flow_control":
            raise wrong("exclude", f"exclude removes each {slot} of the catalogue", remedy="Exclude less.")
    if not task.excludes(WITHOUT, FLOW_CONTROL) or not found["flow_control"]:
        found["flow_control"].append(NO_FLOW_CONTROL)
    return found


def grouped(parts: Sequence[PartChoice]) -> list[PartChoice]:
    """Return one part of each group of parts with equal data, with the names of the others.

    Parameters
    ----------
    parts : sequence of PartChoice
        Parts within the limits of their data sheets.
    """
    groups: dict[tuple[Any, ...], list[PartChoice]] = {}
    for one in parts:
        shared = (one.form, one.tube_diameter_m, tuple(sorted(one.numbers.items())), one.assumed)
        groups.setdefault(shared, []).append(one)
    return [replace(first, alike=tuple(one.name for one in rest)) for first, *rest in groups.values()]


def combined(found: Mapping[str, Sequence[PartChoice]]) -> list[DriveChoice]:
    """Return all combinations of parts."""
    return [DriveChoice(*parts) for parts in product(*(found[slot] for slot in SLOTS))]


def _choice(entry: Entry, given: Keyed, assumed: Mapping[str, tuple[Any, str]]) -> PartChoice:
    """Return a part whose values are overridden by those of the task and completed by assumed ones."""
    check(entry)
    kind = component_class(entry.kind)
    table = kind.flat(part_table(PREFIX + entry.name))
    friction = dict(table.pop("friction", {}))
    for key, (value, why) in assumed.items():
        target, _, last = key.rpartition(".")
        of = friction if target else table
        of.setdefault(last, {"value": value, "assumed": why})
    table |= given
    if friction:
        table["friction"] = friction
    return _read(entry, table)


def _read(entry: Entry, table: Keyed) -> PartChoice:
    """Read a table as a component."""
    made = component_class(entry.kind).model_validate(table)
    core = made.core(0.0)
    numbers, friction = core.pop("numbers"), core.pop("friction") or {}
    numbers |= {f"friction.parameters.{key}": value for key, value in friction.pop("parameters", {}).items()}
    said = {key for key, one in made.origins.items() if one.assumed is not None}
    printed = {one.key: one.value for one in entry.printed}
    form = (repr(core), repr(friction), *sorted(numbers))
    return PartChoice(entry.name, table, numbers, form, frozenset(said), printed)


def _cylinder(entry: Entry, task: SizingTask) -> PartChoice:
    own = {value.key: value for value in entry.values}
    bore = units.parse(own["bore"].value, "m")
    area = math.pi / 4.0 * bore**2
    rodless = entry.kind == "cylinder/rodless"
    stroke = own.get("stroke")
    is_fixed = stroke is not None and stroke.source is not None
    length = units.parse(stroke.value, "m") if is_fixed else task.stroke_m  # type: ignore[union-attr]
    rod = units.parse(own["rod_diameter"].value, "m") if "rod_diameter" in own else 0.35 * bore
    if rodless:
        mass, why = 0.7 * (bore / 25e-3) ** 2.2, "not on the data sheet: piston and carriage, 0.7 kg at bore 25"
    else:
        sides = 2.0 if entry.kind == "cylinder/through-rod" else 1.0
        bar = STEEL_KG_M3 * math.pi / 4.0 * rod**2 * (sides * length)
        mass, why = 0.2 * (bore / 32e-3) ** 2.5 + bar, "not on the sheet: piston, 0.2 kg at bore 32, and a rod of steel"
    dead = area * 15e-3
    assumed: dict[str, tuple[Any, str]] = {
        "moving_mass": (f"{mass:.3g} kg", why),
        **_friction(entry, bore),
    }
    if not rodless:
        assumed["rod_diameter"] = (f"{1e3 * rod:.3g} mm", "not on the sheet: 35 % of the bore")
    reason = "not on the sheet: 15 mm of the bore at each end, port and fitting included"
    cushion = _cushion(entry, bore, length)
    share = 0.6 if cushion else 1.0
    over: Plain = {"incline": units.write(task.incline_rad, "rad", "deg")}
    for end in "ab":
        given = own.get("dead_volume")
        volume = units.parse(given.value[end], "m3") if given is not None else dead
        if cushion:
            assumed |= {f"cushion_{end}_{key}": one for key, one in cushion.items()}
            assumed[f"cushion_{end}_port_volume"] = (_cm3((1.0 - share) * volume), "two fifths of the dead volume")
        assumed[f"dead_volume_{end}"] = (_cm3(share * volume), reason)
        if cushion:  # the dead volume of the sheet is split between chamber and port
            over[f"dead_volume_{end}"] = {"value": _cm3(share * volume), "assumed": reason}
    if not any(key.startswith("end_stop") for key in own):
        damping = 2.0 * STOP_DAMPING * math.sqrt(STOP_N_M * (task.mass_kg + mass))
        why = "a contact without rebound, which ends the stroke"
        stop = (f"{STOP_N_M:.0e} N/m", f"{damping:.3g} N s/m", "0.1 mm")
        keys = ("end_stop_stiffness", "end_stop_damping", "end_stop_damping_depth")
        assumed |= {key: (value, why) for key, value in zip(keys, stop, strict=True)}
    if not is_fixed:
        over["stroke"] = units.write(task.stroke_m, "m", "mm")
    return _guided(entry, _choice(entry, over, assumed), task.guide_friction_n)


def _guided(entry: Entry, choice: PartChoice, guide_n: float) -> PartChoice:
    """Return a cylinder with the friction of the guide added."""
    if guide_n == 0.0:
        return choice
    friction = dict(choice.table["friction"])
    for key in ("coulomb", "breakaway"):
        own = parted({key: friction[key]})[0][key]
        why = f"{own} of the cylinder and {guide_n:.3g} N of the guide"
        friction[key] = {"value": f"{units.parse(own, 'N') + guide_n:.4g} N", "assumed": why}
    return _read(entry, dict(choice.table) | {"friction": friction})


def _friction(entry: Entry, bore: float) -> dict[str, tuple[Any, str]]:
    """Return the assumed friction, a Stribeck law, for a data sheet without friction."""
    area = math.pi / 4.0 * bore**2
    own = {value.key: value.value for value in entry.values}
    printed = {value.key: value.value for value in entry.printed}
    least = printed.get("minimum_operating_pressure")
    if "friction.coulomb" in own:
        coulomb = units.parse(own["friction.coulomb"], "N")
        breakaway, why = 4.0 / 3.0 * coulomb, "not on data sheets: a third above Coulomb friction"
    elif least is not None:
        breakaway = units.parse_pressure(least).value_pa * area
        coulomb, why = 0.7 * breakaway, "from the minimum operating pressure times the area of the piston"
    else:
        coulomb = 0.05 * CATALOGUE_PA * area
        breakaway, why = 1.4 * coulomb, "not on data sheets: 5 % of the force at 6 bar, 7 % at breakaway"
    return {
        "friction.law": ("stribeck", "no sheet gives a friction curve"),
        "friction.coulomb": (f"{coulomb:.4g} N", why),
        "friction.breakaway": (f"{breakaway:.4g} N", why),
        "friction.stribeck_velocity": ("20 mm/s", "no sheet gives it"),
        "friction.viscous": (f"{40.0 * bore / 25e-3:.3g} N s/m", "not on data sheets: 40 N s/m at bore 25"),
    }


def _cushion(entry: Entry, bore: float, stroke: float) -> dict[str, tuple[Any, str]]:
    """Return assumed values of adjustable cushions that the data sheet does not give.

    Empty if the cylinder has no cushions or no room for them.
    """
    if any(value.key.startswith("cushion") for value in entry.values):
        return {}
    printed = {value.key: value.value for value in entry.printed}
    length, why = printed.get("cushion_length"), "the cushion's length on the sheet"
    if length is None and str(printed.get("cushion", "")).startswith("pneumatic"):
        length, why = f"{500.0 * bore:.3g} mm", "not on the sheet: half the bore"
    if length is None or not RUBBER_M < units.parse(length, "m") < LONGEST_CUSHION * stroke:
        return {}
    needle = 0.15 * (bore / 32e-3) ** 2
    return {
        "length": (length, why),
        "plunger_diameter": (f"{500.0 * bore:.3g} mm", "not on the sheet: half the bore"),
        "needle_conductance": (f"{needle:.3g} dm3/(s bar)", "fully open, not on the sheet: 0.15 at bore 32"),
    }


def _valve(entry: Entry, _task: SizingTask) -> PartChoice:
    if entry.kind == PROPORTIONAL:
        own = {value.key for value in entry.values}
        late = {} if own & {"frequency", "delay"} else {"delay": ("20 ms", "usual for a solenoid valve")}
        return _choice(entry, {}, late)
    why = "not on the sheet: usual for a solenoid valve of this size"
    return _choice(entry, {}, {"time_on": ("20 ms", why), "time_off": ("30 ms", why)})


def _tube(entry: Entry, task: SizingTask) -> PartChoice:
    return _choice(entry, {"length": units.write(task.tube_length_m, "m", "m")}, {})


def _flow_control(entry: Entry, _task: SizingTask) -> PartChoice:
    own = {value.key: value for value in entry.values}
    keys = [key for key in own if key.startswith("needle_")]
    free = {key.replace("needle", "check"): (own[key].value, "equal to the fully open needle") for key in keys}
    has = any(key.startswith("check_") for key in own)
    return _choice(entry, {}, {} if has else free)


_MAKERS = {"cylinder": _cylinder, "valve": _valve, "tube": _tube, "flow_control": _flow_control}


def _cm3(volume_m3: float) -> str:
    return f"{1e6 * volume_m3:.3g} cm3"
