"""Mismatch: deviations of the simulated drive from the description that the controllers use, fixed or random."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field

from pneudrive import _core
from pneudrive.arrays import Interval, Keyed, NamedNumbers, Plain
from pneudrive.control.setup import Disturbance, Setup, read_ready
from pneudrive.describe.base import Described
from pneudrive.describe.kinds import component_kinds
from pneudrive.describe.marks import Bounds, Choice, Quantity, parameter_quantities
from pneudrive.describe.tables.friction import friction_laws, options_of
from pneudrive.errors import DescriptionError, invalid

if TYPE_CHECKING:
    from pneudrive.control.tuning import Plant

READY = Path(__file__).with_name("mismatches")
#: Weak supply (assumed): volume behind its conductance, m3, and critical pressure ratio of the conductance.
SUPPLY_VOLUME_M3, SUPPLY_RATIO = 0.2e-3, 0.5


ABOVE_ZERO = Bounds(above=0.0)


@dataclass(frozen=True)
class ValueOrRange(Quantity):
    """Annotation of a value, or of a uniformly sampled range such as ``"75 Hz .. 125 Hz"``. Both ends are stored."""

    si_unit: str = ""
    bounds: Bounds = ABOVE_ZERO

    def read(self, given: object) -> Interval:  # type: ignore[override]
        """Read a value or a range, and return both ends in SI."""
        ends: list[Any] = [end.strip() for end in given.split("..")] if isinstance(given, str) else [given]
        if len(ends) > 2 or "" in ends:
            raise DescriptionError(f'"{given}" is not a range', remedy='Write "0.8 .. 1.2".')
        if not self.si_unit and isinstance(given, str):
            try:
                ends = [float(end) for end in ends]
            except ValueError:
                raise DescriptionError(f'"{given}" is not a number', remedy='Write 1.2, or "0.8 .. 1.2".') from None
        low, high = (Quantity.read(self, end) for end in (ends[0], ends[-1]))
        if not low <= high:
            raise DescriptionError(f'range "{given}" is empty', rule="the first end must not exceed the second")
        return low, high

    def show(self, value: Interval) -> str | float:  # type: ignore[override]
        """Return a value or a range in the form that users write."""
        ends = [Quantity.show(self, end) for end in value]
        return ends[0] if ends[0] == ends[1] else " .. ".join(e if isinstance(e, str) else f"{e:g}" for e in ends)

    def schema(self) -> Plain:
        """Return the JSON schema of a value or a range in the form that users write."""
        form = {"type": "string", "x-unit": self.si_unit} if self.si_unit else {"type": ["number", "string"]}
        return form | {"description": "a value, or a range LOW .. HIGH"}


Factor = Annotated[Interval | None, ValueOrRange()]
_ANY = Bounds()
#: Key of a proportional valve -> bounds of its values, from the core's table.
_OF_VALVE = {key: of.bounds for key, of in parameter_quantities(component_kinds()["valve/proportional-5/3"]).items()}


def _factor(of: str) -> Any:  # noqa: ANN401 - pydantic's own
    return Field(default=None, description=f"factor of {of}")


class Mismatch(Described):
    """Deviations of a drive from its description.

    Each deviation is a number, or a range that is sampled uniformly for the members of a spread.

    Examples
    --------
    >>> Mismatch(moving_mass=1.3, overlap="0.005 .. 0.04").ranges
    {'moving_mass': (1.3, 1.3), 'overlap': (0.005, 0.04)}
    """

    schema_version: Literal[1] = Field(default=1, alias="schema")
    about: str = ""
    friction_level: Factor = _factor("the law's Coulomb and breakaway friction, without the effect of pressure")
    viscous: Factor = _factor("the viscous friction")
    stribeck_velocity: Factor = _factor("the Stribeck velocity")
    bristle_stiffness: Factor = _factor("the stiffness of the contact in stick")
    conductance: Factor = _factor("the conductance of the valve")
    moving_mass: Factor = _factor("the moving mass, loads included")
    heat_transfer: Factor = _factor("the heat-transfer coefficient, or that of its law")
    dead_volume: Factor = _factor("both dead volumes")
    supply_pressure: Factor = _factor("the absolute pressure of the supply")
    supply_conductance: Factor = Field(
        default=None, description="conductance from the supply to 0.2 l before the valve, relative to the valve's"
    )
    spool_frequency_hz: Annotated[Interval | None, ValueOrRange("1/s", "Hz", _OF_VALVE["frequency"])] = None
    delay_s: Annotated[Interval | None, ValueOrRange("s", "ms", _OF_VALVE["delay"])] = None
    overlap: Annotated[Interval | None, ValueOrRange(bounds=_OF_VALVE["overlap"])] = None
    leakage: Annotated[Interval | None, ValueOrRange(bounds=_OF_VALVE["leakage"])] = None
    hysteresis: Annotated[Interval | None, ValueOrRange(bounds=_OF_VALVE["hysteresis"])] = None
    pressure_zero_pa: Annotated[Interval | None, ValueOrRange("Pa", "kPa", _ANY)] = Field(
        default=None, description="zero of each pressure sensor"
    )
    pressure_gain: Annotated[Interval | None, ValueOrRange(bounds=_ANY)] = Field(
        default=None, description="relative error of the gain of each pressure sensor"
    )
    friction_law: Annotated[str | None, Choice(tuple(str(own["name"]) for own in _core.friction_laws()))] = Field(
        default=None, description="law that replaces the drive's; the numbers that both have are kept"
    )
    disturbances: tuple[Disturbance, ...] = ()

    @property
    def ranges(self) -> dict[str, Interval]:
        """Ends of the range of each deviating value, by name."""
        return {name: getattr(self, name) for name in PLACES if getattr(self, name) is not None}

    @property
    def is_spread(self) -> bool:
        """Whether any deviation is a range, so that members differ."""
        return any(low < high for low, high in self.ranges.values())

    def drawn(self, seed: int, member: int) -> NamedNumbers:
        """Return the values of a member. A value depends only on seed, member and name.

        Parameters
        ----------
        seed, member : int
            Key of the counter-based generator.

        Returns
        -------
        dict
            Name -> value; names for the second pressure sensor end in ``_b``.
        """
        shares = np.random.Generator(np.random.Philox(key=[seed, member])).random(len(DRAWS))
        out = {}
        for name, share in zip(DRAWS, shares, strict=True):
            ends = self.ranges.get(name.removesuffix("_b"))
            if ends is not None:
                out[name] = ends[0] + float(share) * (ends[1] - ends[0])
        return out


#: A mismatch, the name of a mismatch in the package, or a TOML file.
MismatchOrFile: TypeAlias = Mismatch | str | Path

#: Deviation -> components that it affects, and their parameters. Values of a spool and of sensors replace described
#: values; other values multiply them. Random values depend on the order of this table.
PLACES = {
    "friction_level": ("friction", ("coulomb", "breakaway")),
    "viscous": ("friction", ("viscous",)),
    "stribeck_velocity": ("friction", ("stribeck_velocity",)),
    "bristle_stiffness": ("friction", ("bristle_stiffness",)),
    "conductance": ("valves", ("conductance", "exhaust_conductance")),
    "moving_mass": ("cylinder", ("moving_mass",)),
    "heat_transfer": ("cylinder", ("heat_transfer", "heat_transfer_scale")),
    "dead_volume": ("cylinder", ("dead_volume_a", "dead_volume_b")),
    "supply_pressure": ("supply", ("pressure",)),
    "supply_conductance": ("new component", ()),
    "spool_frequency_hz": ("spool", ("frequency",)),
    "delay_s": ("spool", ("delay",)),
    "overlap": ("spool", ("overlap",)),
    "leakage": ("spool", ("leakage",)),
    "hysteresis": ("spool", ("hysteresis",)),
    "pressure_zero_pa": ("sensors", ("zero_pa",)),
    "pressure_gain": ("sensors", ("gain_error",)),
}
OF_VALVE = {name: keys[0] for name, (place, keys) in PLACES.items() if place == "spool"}
_SENSORS = {name: keys[0] for name, (place, keys) in PLACES.items() if place == "sensors"}
DRAWS = (*PLACES, *(f"{name}_b" for name in _SENSORS))


def mismatched(
    core_json: str,
    plant: Plant,
    setup: Setup,
    mismatch: Mismatch,
    drawn: NamedNumbers,
) -> tuple[str, NamedNumbers, Setup, NamedNumbers]:
    """Apply the sampled values of a mismatch to a drive in the core's form.

    Returns
    -------
    str
        The circuit in the core's form.
    dict
        Values of the start state that the description does not contain.
    Setup
        The setup with the errors of its sensors and with all disturbances.
    dict
        Name of each deviating value -> the true value.

    Raises
    ------
    DescriptionError
        The drive does not have the component or sensor that a deviation changes.
    """
    form = json.loads(core_json)
    named = {one["name"]: one for one in form["components"]}
    cylinder, valves = named[plant.cylinder], [named[name] for name in plant.valves]
    conductance = valves[0]["numbers"]["conductance"]
    of_valves = [valve["numbers"] for valve in valves]  # a law assumes equal valves
    tables = {
        "friction": [(cylinder["friction"] or {}).get("parameters", {})],
        "cylinder": [cylinder["numbers"]],
        "valves": of_valves,
        "spool": of_valves if "frequency" in of_valves[0] else [],
        "supply": [one["numbers"] for one in form["components"] if one["kind"].startswith("reservoir")],
    }
    for name, value in drawn.items():
        place, keys = PLACES[name.removesuffix("_b")]
        found = [(numbers, key) for numbers in tables.get(place, ()) for key in keys if key in numbers]
        if place == "spool" and not found:
            raise invalid(name, "control.no_spool", name=name, valve=valves[0]["name"])
        if place in tables and not found:
            raise invalid(name, "control.no_effect", name=name, keys=" and no ".join(keys))
        for numbers, key in found:
            numbers[key] = value if place == "spool" else value * numbers[key]
    for load in (one for one in form["components"] if one["kind"] == "load"):
        load["numbers"]["mass"] *= drawn.get("moving_mass", 1.0)
    if mismatch.friction_law is not None:
        if mismatch.friction_law == cylinder["friction"]["law"]:
            raise invalid("friction_law", "control.same_law", law=mismatch.friction_law)
        cylinder["friction"] = _other_law(mismatch.friction_law, cylinder["friction"])
    start = _supply(form, drawn, conductance)
    unseen = set() if setup.sensors.pressure_a is not None else _SENSORS.keys()
    values = {name: value for name, value in drawn.items() if name.removesuffix("_b") not in unseen}
    return json.dumps(form, sort_keys=True), start, _sensors(setup, mismatch, drawn), values


def _other_law(word: str, friction: Keyed) -> Plain:
    """Return friction with another law. Parameters that both laws have are kept, and formulas are dropped."""
    law, has = friction_laws()[word], dict(friction["parameters"])
    if friction.get("elements"):
        has["bristle_stiffness"] = sum(one["stiffness_n_m"] for one in friction["elements"])
    parameters = {}
    for one in law["parameters"]:
        name, usual = one["key"], one["default"]
        if name in has:
            parameters[name] = has[name]
        elif usual is None:
            raise invalid("friction_law", "control.law_needs", law=word, name=name)
    fits = options_of(law) | {"formula": False, "elements": False}
    kept = {key: value for key, value in friction.items() if fits.get(key, True)}
    return kept | {"law": word, "parameters": parameters}


def _supply(form: Plain, drawn: NamedNumbers, conductance: float) -> NamedNumbers:
    """Add a restricted supply line to `form`, and return the start state of the volume in this line."""
    if "supply_conductance" not in drawn:
        return {}
    # A commanded circuit has exactly one supply.
    (supply,) = (one for one in form["components"] if one["kind"].startswith("reservoir"))
    restriction, volume = (f"{supply['name']}_{what}" for what in ("restriction", "volume"))
    weak = {"conductance": drawn["supply_conductance"] * conductance, "critical_pressure_ratio": SUPPLY_RATIO}
    for name, kind, numbers in ((volume, "tank", {"volume": SUPPLY_VOLUME_M3}), (restriction, "fitting", weak)):
        form["components"].append({"name": name, "kind": kind, "choices": {}, "friction": None, "numbers": numbers})
    form["joints"] = [
        [f"{volume}.1" if port == f"{supply['name']}.1" else port for port in joint] for joint in form["joints"]
    ]
    for joint in form["joints"]:
        if f"{volume}.1" in joint:
            joint.append(f"{restriction}.2")
    form["joints"].append([f"{supply['name']}.1", f"{restriction}.1"])
    pressure = supply["numbers"]["pressure"]
    temperature = supply["numbers"].get("temperature", form["ambient"]["temperature_k"])
    return {f"{volume}.pressure_pa": pressure, f"{volume}.temperature_k": temperature}


def _sensors(setup: Setup, mismatch: Mismatch, drawn: NamedNumbers) -> Setup:
    changed = setup.sensors
    for sensor, mark in (("pressure_a", ""), ("pressure_b", "_b")):
        own = getattr(changed, sensor)
        if own is not None:
            values = {key: drawn[name + mark] for name, key in _SENSORS.items() if name + mark in drawn}
            changed = changed.model_copy(update={sensor: own.model_copy(update=values)})
    # The forces are steps, which add up: each value acts from its time until the next value of the same force.
    each, forces = (setup.disturbances, mismatch.disturbances), []
    for at_s in sorted({one.at_s for of in each for one in of}):
        acting = (next((one.force_n for one in reversed(of) if one.at_s <= at_s), 0.0) for of in each)
        forces.append(Disturbance.model_construct(at_s=at_s, force_n=sum(acting)))
    return setup.model_copy(update={"sensors": changed, "disturbances": tuple(forces)})


@cache
def ready_mismatches() -> dict[str, Path]:
    """Return the files of the package's mismatches by name."""
    return {path.stem: path for path in sorted(READY.glob("*.toml"))}


def read_mismatch(given: MismatchOrFile) -> tuple[Mismatch, str]:
    """Read a mismatch of the package by its name, or a TOML file.

    Parameters
    ----------
    given : Mismatch, str or path-like
        A mismatch is returned unchanged.

    Returns
    -------
    Mismatch, str
        The mismatch and its name: the name in the package or of the file, or ``"own"`` for a given object.

    Raises
    ------
    DescriptionError
        The file is not valid; the message gives file, line, value, rule and remedy.

    Examples
    --------
    >>> read_mismatch("mass+30")[0].moving_mass
    (1.3, 1.3)
    """
    return read_ready(Mismatch, given, ready_mismatches(), "For instance: schema = 1, then moving_mass = 1.3.")
