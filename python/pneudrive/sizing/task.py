"""Task of a drive: load, stroke, times and spreads, and the parts to choose from. `SizingTask` reads its file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import Field, model_validator

from pneudrive import units
from pneudrive.arrays import Interval, Keyed, NamedNumbers, Plain
from pneudrive.constants import IMPACT_ENERGY_J_M2, STANDARD_GRAVITY_M_S2
from pneudrive.control.mismatch import ValueOrRange
from pneudrive.describe import marks
from pneudrive.describe.base import Described, inline
from pneudrive.describe.components import component_class
from pneudrive.describe.files import toml
from pneudrive.describe.files.catalogue import PREFIX, Entry, check, entries, part_table
from pneudrive.describe.files.sourced import parted
from pneudrive.describe.marks import NOT_NEGATIVE, POSITIVE, Between, Bounds, Force, Length, Mass, Percent, Quantity
from pneudrive.describe.marks import StatedPressure as Stated
from pneudrive.describe.system import DescribedValue
from pneudrive.describe.tables.parts import Ambient
from pneudrive.errors import invalid, wrong

#: Coefficient of friction of a guide for the load (assumed: usual values; ball guides with seals).
GUIDES = {"none": 0.0, "ball": 0.02, "plain": 0.15}
_LONG = re.compile(r"(?<![\w.])\d*\.\d{10,}(?:[eE][-+]?\d+)?(?![\w.])")
Seconds = Annotated[float | None, Quantity("s", "s", POSITIVE)]
Speed = Annotated[float | None, Quantity("m/s", "m/s", POSITIVE)]
_Factor = Annotated[float | None, Quantity("", bounds=POSITIVE)]
Share = Annotated[float, Percent("%", None, Bounds(at_least=0.0, below=90.0))]


class TaskSupply(Described):
    """Supply at the valve, with its spread."""

    table_name = "supply"
    pressure: Annotated[units.Pressure, Stated()] = Field(examples=["6 bar gauge"])
    spread_pa: Annotated[float, Quantity("Pa", "bar", NOT_NEGATIVE)] = Field(
        default=0.5e5, description="largest deviation of the pressure, +-"
    )


class TaskSpreads(Described):
    """Ranges of values that vary between drives or over time; samples are uniform over each range."""

    table_name = "spread"
    mass: Share = Field(default=0.1, description="of the load, +-")
    friction: Annotated[Interval, ValueOrRange()] = Field(
        default=(0.7, 1.5), description="factors of the friction of cylinder and guide"
    )
    conductance: Share = Field(default=0.1, description="of valves, tubes and needles, +-; doubled for assumed values")
    temperature_k: Annotated[Interval | None, Between("K", "degC")] = Field(
        default=None, description="of air and cylinder; absent: 10 K below to 15 K above the ambient temperature"
    )
    heat_transfer: Annotated[Interval, ValueOrRange()] = Field(
        default=(0.5, 2.0), description="factors of the heat transfer in chambers, by ratio; smaller ones for tubes"
    )
    assumed: Share = Field(default=0.3, description="of assumed dead volumes, piston masses and valve times, +-")


class SizingTask(Described):
    """Task of a drive: `pneudrive size` reads it from a TOML file.

    Examples
    --------
    >>> task = SizingTask(mass="8 kg", stroke="400 mm", time="0.6 s", incline="90 deg", supply={"pressure": "6 bar gauge"})
    >>> round(task.static_force_n, 2)
    78.45
    """  # noqa: E501

    elsewhere: ClassVar = {
        "components": "This file describes a circuit. A task has mass, stroke, time and supply.",
        "cylinder": "This file describes a drive. A task has mass, stroke, time and supply.",
        "cycles_per_minute": "Write cycles_per_hour: 20 a minute are 1200 an hour.",
    }
    schema_version: Literal[1] = Field(default=1, alias="schema")
    name: str = "task"
    mass_kg: Mass = Field(description="mass of the load; the mass of the piston is added")
    stroke_m: Length
    max_stroke_m: marks.MaybeLength = Field(
        default=None, description="longest stroke on the sheet of the cylinder; absent: that of the catalogue"
    )
    time_s: Seconds = Field(default=None, description="from the command to the end, outwards")
    return_time_s: Seconds = Field(default=None, description="time of the return stroke; absent: as outwards")
    speed_m_s: Speed = Field(default=None, description="can replace time: stroke divided by time")
    incline_rad: marks.Angle = Field(default=0.0, description="direction of the outward stroke; 90 deg: it lifts")
    external_force_n: Force = Field(default=0.0, description="constant force against the outward stroke")
    holding_force_n: Annotated[float, Quantity("N", "N", NOT_NEGATIVE)] = Field(
        default=0.0, description="force of the piston at the end of the outward stroke"
    )
    held_by: Literal["machine", "clamp"] | None = Field(
        default=None, description="what holds the load when the pressure fails; absent: only friction"
    )
    clamp_force_n: Annotated[float | None, Quantity("N", "N", POSITIVE)] = Field(
        default=None, description="holding force of the clamp, from its data sheet"
    )
    end_speed_m_s: Speed = Field(default=None, description="largest speed at the contact with an end")
    impact_energy_j: Annotated[float | None, Quantity("J", "J", POSITIVE)] = Field(
        default=None,
        alias="impact_energy",
        description="largest energy at the contact with an end; absent: that of the sheet, or 4 mJ/mm2 of piston",
    )
    peak_pressure: Annotated[units.Pressure | None, Stated()] = Field(
        default=None, description="largest pressure in a chamber; absent: that of the cylinder in the catalogue"
    )
    guide: Literal["none", "ball", "plain"] = Field(
        default="none", description='what carries the load: linear or recirculating ball guides are "ball"'
    )
    tube_length_m: Length = Field(default=1.0, description="of each tube between valve and cylinder")
    cycles: _Factor = Field(default=None, description="life; compared with B10 of the catalogue")
    cycles_per_hour: _Factor = Field(default=None, description="for air and energy of a year")
    hours_per_year: Annotated[float, Quantity("", bounds=Bounds(above=0.0, at_most=8784.0))] = Field(
        default=2000.0, description="hours of operation in a year; the default is one shift"
    )
    price_per_kwh: _Factor = Field(default=None, description="of electricity, in the currency")
    currency: str = Field(default="EUR", description="of the price")
    servo_valves: bool = Field(default=False, description="include proportional valves")
    margin: Share = Field(default=0.0, description="reserve that each limit keeps")
    exclude: tuple[str, ...] = Field(default=(), description="names, kinds or patterns of the catalogue: smc-cy1b*")
    supply: TaskSupply
    spread: TaskSpreads = TaskSpreads()
    ambient: Ambient = Ambient()

    @model_validator(mode="after")
    def _fits_together(self) -> SizingTask:
        if (self.time_s is None) == (self.speed_m_s is None):
            state = "time is missing" if self.time_s is None else "time and speed are both given"
            raise invalid("time", "sizing.one_time", state=state)
        if (self.held_by == "clamp") != (self.clamp_force_n is not None):
            state = "clamp_force is missing" if self.held_by else "clamp_force is given without a clamp"
            raise invalid("held_by", "sizing.clamp", state=state)
        if self.clamp_force_n is not None and self.clamp_force_n < (pulls := abs(self.static_force_n)):
            raise invalid("clamp_force", "sizing.weak_clamp", force=self.clamp_force_n, pulls=pulls)
        most = 3600.0 / (self.outward_s + self.back_s)
        if self.cycles_per_hour is not None and self.cycles_per_hour > most:
            raise invalid("cycles_per_hour", "sizing.cycles", cycles=self.cycles_per_hour, most=most)
        if not self.supply_pa - self.supply.spread_pa > self.ambient.pressure_pa:
            values = {"spread": 1e-5 * self.supply.spread_pa, "ambient": self.ambient.pressure}
            raise invalid("supply.pressure", "sizing.low_supply", pressure=self.supply.pressure, **values)
        known = sorted({word for one in entries().values() if not one.is_drive for word in (one.name, one.kind)})
        for place, word in enumerate(self.exclude):
            if not any(fnmatchcase(one, word) for one in known):
                what = f'exclude: the catalogue has no part and no kind "{word}"'
                close = get_close_matches(word, known, n=1)
                remedy = f"Did you mean '{close[0]}'?" if close else "`pneudrive catalogue` lists names and kinds."
                raise wrong(f"exclude.{place}", what, remedy=remedy)
        return self

    @classmethod
    def load(cls, source: str | Path) -> SizingTask:
        """Read a task from a TOML file, or from its text if `source` has more than one line.

        Raises
        ------
        DescriptionError
            The file is not valid; the message gives file, line, value, rule and remedy.
        """
        if isinstance(source, str) and "\n" in source:
            origin, text = "task", source
            tables = toml.parse(text, origin)
        else:
            origin = str(source)
            tables, text = toml.read(source, start="The guide page on sizing has example tasks.")
        with toml.locating(origin, text):
            return cls.model_validate({"name": Path(origin).stem} | tables)

    def excludes(self, name: str, kind: str) -> bool:
        """Return whether a part of the catalogue is excluded."""
        is_servo = kind == PROPORTIONAL and not self.servo_valves
        return is_servo or any(fnmatchcase(name, word) or fnmatchcase(kind, word) for word in self.exclude)

    @property
    def supply_pa(self) -> float:
        """Nominal absolute supply pressure, in Pa."""
        return self.supply.pressure.absolute_pa(self.ambient.pressure_pa)

    @property
    def temperatures_k(self) -> Interval:
        """Range of the temperature of air and cylinder, in K."""
        return self.spread.temperature_k or (self.ambient.temperature_k - 10.0, self.ambient.temperature_k + 15.0)

    @property
    def outward_s(self) -> float:
        """Longest allowed time of the outward stroke, in s."""
        return self.stroke_m / self.speed_m_s if self.time_s is None else self.time_s  # type: ignore[operator]

    @property
    def back_s(self) -> float:
        """Longest allowed time of the return stroke, in s."""
        return self.outward_s if self.return_time_s is None else self.return_time_s

    @property
    def static_force_n(self) -> float:
        """Force (N) against the outward stroke at rest, without friction: weight along the axis and external force."""
        return self.mass_kg * STANDARD_GRAVITY_M_S2 * math.sin(self.incline_rad) + self.external_force_n

    @property
    def across_n(self) -> float:
        """Weight of the load across the axis, in N."""
        across = 0.0 if abs(self.incline_rad) == 0.5 * math.pi else math.cos(self.incline_rad)  # else 6e-17
        return self.mass_kg * STANDARD_GRAVITY_M_S2 * across

    @property
    def guide_friction_n(self) -> float:
        """Friction of the guide under the weight of the load, in N."""
        return GUIDES[self.guide] * self.across_n


def task_schema() -> Plain:
    """Return the JSON schema (draft 2020-12) of a task."""
    schema = SizingTask.model_json_schema(by_alias=True)
    timed = [{"required": ["time"]}, {"required": ["speed"]}]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "oneOf": timed}


def values_of(task: SizingTask) -> list[DescribedValue]:
    """Return every value of a task as text, defaults included, in the order of its file, with its meaning as origin."""
    given = dict(toml.leaves(task.to_dict()))
    meanings = dict(toml.leaves(_meanings(task)))
    out = []
    for key, value in toml.leaves(task.with_defaults()):
        if key != "schema":
            # Digits beyond ten are noise of a conversion, for example of 6 lb to kg.
            is_text = isinstance(value, str)
            text = _LONG.sub(lambda found: f"{float(found[0]):.10g}", value) if is_text else inline(value)
            kind = "given" if key in given else "default"
            out.append(DescribedValue(key, text, meanings.get(key, ""), kind))
    return out


def follows_from(task: SizingTask) -> list[tuple[str, float, str]]:
    """Return the values derived from a task: name, value, unit."""
    return [
        ("force against the outward stroke at rest, without friction", task.static_force_n, "N"),
        ("friction of the guide under the load", task.guide_friction_n, "N"),
        ("longest time outwards", task.outward_s, "s"),
        ("longest time back", task.back_s, "s"),
    ]


def _meanings(part: Described) -> Plain:
    """Return the meaning of each key, in nested tables as in a file."""
    fields = type(part).model_fields.items()
    each = {entry.alias or name: (getattr(part, name), entry.description or "") for name, entry in fields}
    return {key: _meanings(value) if isinstance(value, Described) else text for key, (value, text) in each.items()}


# --- Parts of the catalogue for a task: cylinders, valves, tubes, flow controls; missing values are assumed.

PROPORTIONAL, FLOW_CONTROL = "valve/proportional-5/3", "flow-control"
#: Slots of a drive -> kinds of components for it.
SLOTS: dict[str, tuple[str, ...]] = {
    "cylinder": ("cylinder/rodless", "cylinder/single-rod", "cylinder/through-rod"),
    "valve": ("valve/switching-5/2", "valve/switching-5/3", PROPORTIONAL),
    "tube": ("tube",),
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
        Numbers of the part in SI by key. Keys of its friction begin with ``friction.parameters.``.
    form : tuple
        Properties that are not numbers. Parts of equal form differ only in their numbers.
    assumed : frozenset of str
        Keys of assumed values.
    printed : dict
        Further values of the data sheet.
    """

    name: str
    table: Keyed
    numbers: Mapping[str, float]
    form: tuple[str, ...] = ()
    assumed: frozenset[str] = frozenset()
    printed: Keyed = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """Kind of the component."""
        return self.table["kind"]

    def printed_si(self, key: str, unit: str) -> float | None:
        """Return a printed value in SI, or None if the sheet does not have it."""
        given = self.printed.get(key)
        if given is None:
            return None
        if unit == "Pa":
            return units.parse_pressure(given).value_pa
        return units.parse(given, unit) if unit else float(given)

    @property
    def exhaust_conductance(self) -> float:
        """Conductance of a valve from the cylinder to its exhaust, in m3/(s Pa)."""
        return self.numbers.get("exhaust_conductance", self.numbers["conductance"])

    @property
    def tube_diameter_m(self) -> float | None:
        """Outer diameter (m) of a tube, or of the tubes that fit into the connectors of another part."""
        return self.printed_si("outer_diameter", "m") or self.printed_si("tube_outer_diameter", "m")


NO_FLOW_CONTROL = PartChoice(WITHOUT, {"kind": FLOW_CONTROL}, {})
#: Slot -> parts.
Parts: TypeAlias = dict[str, list[PartChoice]]


@dataclass(frozen=True)
class DriveChoice:
    """One combination of parts.

    Attributes
    ----------
    cylinder, valve, tube, flow_control : PartChoice
        A flow control called "none" is left out. A missing valve or tube counts as ideal.
    """

    cylinder: PartChoice
    valve: PartChoice = NO_FLOW_CONTROL
    tube: PartChoice = NO_FLOW_CONTROL
    flow_control: PartChoice = NO_FLOW_CONTROL

    @property
    def parts(self) -> dict[str, str]:
        """Names of the parts by slot."""
        return {slot: getattr(self, slot).name for slot in SLOTS}

    @property
    def name(self) -> str:
        """Names of the parts, joined by "+"."""
        return "+".join(self.parts.values())

    @property
    def is_throttled(self) -> bool:
        """Whether the choice has flow controls."""
        return self.flow_control.name != WITHOUT

    @property
    def sizes(self) -> tuple[float, ...]:
        """Bore, conductances of valve and fully open needle (0 without a needle), and bore of the tubes, in SI."""
        needle = self.flow_control.numbers["needle_conductance"] if self.is_throttled else 0.0
        return self.cylinder.numbers["bore"], self.valve.numbers["conductance"], needle, self.tube.numbers["diameter"]

    @property
    def valve_paths(self) -> dict[str, NamedNumbers]:
        """Paths from the supply and to the exhaust that the valve opens for a stroke: name -> numbers in SI."""
        valve = self.valve.numbers
        feed = {key: valve[key] for key in ("subsonic_index", "linear_above", "conductance", "critical_pressure_ratio")}
        return {"feed": feed, "vent": {key: valve.get(f"exhaust_{key}", size) for key, size in feed.items()}}

    def exhaust_sizes(self, tube_m3_s_pa: float) -> list[float]:
        """Return the conductances (m3/(s Pa)) on the exhaust path of the cylinder, with a fully open needle.

        A missing valve or flow control is left out. `tube_m3_s_pa` is the conductance of the tube.
        """
        valve = [self.valve.exhaust_conductance] if self.valve.numbers else []
        needle = [self.flow_control.numbers["needle_conductance"]] if self.is_throttled else []
        return [*valve, tube_m3_s_pa, *needle]

    @property
    def is_cushioned(self) -> bool:
        """Whether the cylinder has cushions."""
        return "cushion_b_length" in self.cylinder.numbers

    @property
    def areas_m2(self) -> Interval:
        """Areas of the piston on the sides of chamber a and chamber b."""
        numbers, kind = self.cylinder.numbers, self.cylinder.kind
        whole, rod = (math.pi / 4.0 * numbers.get(key, 0.0) ** 2 for key in ("bore", "rod_diameter"))
        return whole - rod * (kind == "cylinder/through-rod"), whole - rod * (kind != "cylinder/rodless")


def choices(task: SizingTask) -> Parts:
    """Return the parts of the catalogue for each slot, without those that the task excludes.

    Raises
    ------
    DescriptionError
        A part of the catalogue is not valid, or no part is left for a slot.
    """
    known = [entry for entry in entries().values() if not entry.is_drive]
    found: Parts = {}
    for slot, kinds in SLOTS.items():
        chosen = [one for one in known if one.kind in kinds and not task.excludes(one.name, one.kind)]
        found[slot] = [part_choice(one, task) for one in sorted(chosen, key=lambda one: one.name)]
    for slot, parts in found.items():
        if not parts and slot != "flow_control":
            raise wrong("exclude", f"exclude removes every {slot} of the catalogue", remedy="Exclude fewer parts.")
    if not task.excludes(WITHOUT, FLOW_CONTROL) or not found["flow_control"]:
        found["flow_control"].append(NO_FLOW_CONTROL)
    return found


def grouped(parts: Sequence[PartChoice]) -> list[PartChoice]:
    """Return the first part of each group of parts with equal data.

    Parameters
    ----------
    parts : sequence of PartChoice
        Parts within the limits of their data sheets.
    """
    first: dict[tuple[Any, ...], PartChoice] = {}
    for one in parts:
        first.setdefault((one.form, one.tube_diameter_m, tuple(sorted(one.numbers.items())), one.assumed), one)
    return list(first.values())


def part_choice(entry: Entry, task: SizingTask) -> PartChoice:
    """Return a part of the catalogue. Values of the task replace its values, and assumed values fill the gaps."""
    own = {value.key: value.value for value in entry.values}
    printed = {value.key: value.value for value in entry.printed}
    given: Plain = {}
    assumed: dict[str, tuple[Any, str]] = {}
    if entry.kind in SLOTS["cylinder"]:
        is_fixed = any(value.key == "stroke" and value.source is not None for value in entry.values)
        given, assumed = _cylinder(entry.kind, own, printed, task, is_fixed=is_fixed)
    elif entry.kind in SLOTS["tube"]:
        given = {"length": units.write(task.tube_length_m, "m", "m")}
    elif entry.kind == FLOW_CONTROL and not any(key.startswith("check_") for key in own):
        needle = {key: size for key, size in own.items() if key.startswith("needle_")}
        why = "equal to the fully open needle"
        assumed = {key.replace("needle", "check"): (size, why) for key, size in needle.items()}
    elif entry.kind == PROPORTIONAL and not own.keys() & {"frequency", "delay"}:
        assumed = {"delay": ("20 ms", "usual for a solenoid valve")}
    elif entry.kind in SLOTS["valve"] and entry.kind != PROPORTIONAL:
        why = "not on the sheet: usual for a solenoid valve of this size"
        assumed = {"time_on": ("20 ms", why), "time_off": ("30 ms", why)}
    check(entry)
    kind = component_class(entry.kind)
    table = kind.flat(part_table(PREFIX + entry.name))
    friction = dict(table.pop("friction", {}))
    for key, (value, why) in assumed.items():
        target, _, last = key.rpartition(".")
        of = friction if target else table
        of.setdefault(last, {"value": value, "assumed": why})
    if friction and task.guide_friction_n:
        for key in ("coulomb", "breakaway"):
            alone = parted({key: friction[key]})[0][key]
            why = f"{alone} of the cylinder and {task.guide_friction_n:.3g} N of the guide"
            size = f"{units.parse(alone, 'N') + task.guide_friction_n:.4g} N"
            friction[key] = {"value": size, "assumed": why}
    table |= given
    if friction:
        table["friction"] = friction
    made = kind.model_validate(table)
    core = made.core(0.0)
    numbers, law = core.pop("numbers"), core.pop("friction") or {}
    numbers |= {f"friction.parameters.{key}": value for key, value in law.pop("parameters", {}).items()}
    said = {key for key, one in made.origins.items() if one.assumed is not None}
    form = (repr(core), repr(law), *sorted(numbers))
    return PartChoice(entry.name, table, numbers, form, frozenset(said), printed)


def _cylinder(
    kind: str, own: Keyed, printed: Keyed, task: SizingTask, *, is_fixed: bool
) -> tuple[Plain, dict[str, tuple[Any, str]]]:
    """Return the values of a cylinder that follow from the task, and the assumed values.

    `own` and `printed` are the values of its data sheet. The stroke of the sheet is used if it is fixed.
    """
    bore = units.parse(own["bore"], "m")
    area = math.pi / 4.0 * bore**2
    rodless = kind == "cylinder/rodless"
    length = units.parse(own["stroke"], "m") if is_fixed else task.stroke_m
    rod = units.parse(own["rod_diameter"], "m") if "rod_diameter" in own else 0.35 * bore
    if rodless:
        mass, why = 0.7 * (bore / 25e-3) ** 2.2, "not on the data sheet: piston and carriage, 0.7 kg at bore 25"
    else:
        sides = 2.0 if kind == "cylinder/through-rod" else 1.0
        bar = STEEL_KG_M3 * math.pi / 4.0 * rod**2 * (sides * length)
        mass, why = 0.2 * (bore / 32e-3) ** 2.5 + bar, "not on the sheet: piston, 0.2 kg at bore 32, and a rod of steel"
    assumed: dict[str, tuple[Any, str]] = {"moving_mass": (f"{mass:.3g} kg", why), **_friction(own, printed, bore)}
    if not rodless:
        assumed["rod_diameter"] = (f"{1e3 * rod:.3g} mm", "not on the sheet: 35 % of the bore")
    reason = "not on the sheet: 15 mm of the bore at each end, port and fitting included"
    cushion = _cushion(own, printed, bore, length)
    share = 0.6 if cushion else 1.0
    over: Plain = {"incline": units.write(task.incline_rad, "rad", "deg")}
    for end in "ab":
        volume = units.parse(own["dead_volume"][end], "m3") if "dead_volume" in own else area * 15e-3
        if cushion:  # the dead volume of the sheet is split between chamber and port
            assumed |= {f"cushion_{end}_{key}": one for key, one in cushion.items()}
            assumed[f"cushion_{end}_port_volume"] = (_cm3((1.0 - share) * volume), "two fifths of the dead volume")
            over[f"dead_volume_{end}"] = {"value": _cm3(share * volume), "assumed": reason}
        assumed[f"dead_volume_{end}"] = (_cm3(share * volume), reason)
    if not any(key.startswith("end_stop") for key in own):
        damping = 2.0 * STOP_DAMPING * math.sqrt(STOP_N_M * (task.mass_kg + mass))
        why = "a contact without rebound, which ends the stroke"
        stop = (f"{STOP_N_M:.0e} N/m", f"{damping:.3g} N s/m", "0.1 mm")
        keys = ("end_stop_stiffness", "end_stop_damping", "end_stop_damping_depth")
        assumed |= {key: (value, why) for key, value in zip(keys, stop, strict=True)}
    if not is_fixed:
        over["stroke"] = units.write(task.stroke_m, "m", "mm")
    return over, assumed


def _friction(own: Keyed, printed: Keyed, bore: float) -> dict[str, tuple[Any, str]]:
    """Return the assumed friction, a Stribeck law, for a data sheet without friction."""
    area = math.pi / 4.0 * bore**2
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


def _cushion(own: Keyed, printed: Keyed, bore: float, stroke: float) -> dict[str, tuple[Any, str]]:
    """Return assumed values of adjustable cushions that the data sheet does not give.

    Empty if the cylinder has no cushions or no room for them.
    """
    if any(key.startswith("cushion") for key in own):
        return {}
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


def _cm3(volume_m3: float) -> str:
    return f"{1e6 * volume_m3:.3g} cm3"


def peak_limit(task: SizingTask, choice: DriveChoice) -> float | None:
    """Return the largest allowed absolute pressure in the cylinder, from the task or from the data sheet."""
    ambient = task.ambient.pressure_pa
    if task.peak_pressure is not None:
        return task.peak_pressure.absolute_pa(ambient)
    printed = choice.cylinder.printed_si("maximum_pressure", "Pa")
    return None if printed is None else printed + ambient


def energy_limit(task: SizingTask, choice: DriveChoice) -> tuple[float, str]:
    """Return the largest allowed energy (J) at an end, and its origin: task and data sheet, or an assumed rule."""
    stated = (task.impact_energy_j, "task"), (choice.cylinder.printed_si("cushion_energy", "J"), "data sheet")
    known = [(limit, origin) for limit, origin in stated if limit is not None]
    if known:
        return min(known)
    rule = f"assumed: {1e-3 * IMPACT_ENERGY_J_M2:g} mJ for each mm2 of piston; neither task nor data sheet has a limit"
    return IMPACT_ENERGY_J_M2 * max(choice.areas_m2), rule
