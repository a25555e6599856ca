"""Description of a simulated rig: its sensors, and a TOML file in which each value has a unit and a source.

Unknown keys are rejected. One file can extend another. The core defines the parameters of the components. The friction
table has the parameters of its law, and the same modifiers as a drive file.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, create_model

from pneudrive import units
from pneudrive.arrays import Array, Pair, Plain
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.formulas import law_of, read_file
from pneudrive.describe.kinds import component_kinds
from pneudrive.describe.marks import Bounds, Choice, Mark, Quantity, StatedPressure, parameter_quantity
from pneudrive.describe.tables.friction import Friction
from pneudrive.describe.tables.parts import piston_areas
from pneudrive.errors import DescriptionError, Problems, package_table, together, wrong
from pneudrive.rig.interface import Sampling
from pneudrive.rig.motion import MotionLimits
from pneudrive.rig.rig_file import RigFile, shipped_rigs


@dataclass(frozen=True)
class AnalogSensor:
    """Sensor with an amplifier and a converter: zero, gain, white noise, range, resolution.

    Parameters
    ----------
    low, high : float
        Range in the unit of the signal. Signals outside the range saturate.
    bits : int
        Resolution of the converter over the range.
    noise : float
        Standard deviation of the white noise of one sample.
    zero : float
        Reading for a zero signal, added to every sample.
    gain_error : float
        Relative error of the gain.
    hysteresis : float
        Error that has the sign of the signal. It is constant for signals beyond 1 % of the range.
    """

    low: float
    high: float
    bits: int
    noise: float
    zero: float = 0.0
    gain_error: float = 0.0
    hysteresis: float = 0.0

    def __post_init__(self) -> None:
        """Check the resolution; the rig file checks the other values."""
        if not 4 <= self.bits <= 32:
            raise DescriptionError(f"a converter must have 4 to 32 bits, not {self.bits}")

    @property
    def step(self) -> float:
        """Smallest step of the converter."""
        return (self.high - self.low) / (2**self.bits - 1)

    def read(self, signal: Array, rng: np.random.Generator | None, drift: float | Array = 0.0) -> Array:
        """Return the recorded samples of `signal`, same shape and unit.

        Parameters
        ----------
        signal : ndarray
        rng : numpy.random.Generator or None
            Generator of the noise; None: no noise, as for the mean of many samples.
        drift : float or ndarray
            Drift of the zero.
        """
        seen = (1.0 + self.gain_error) * signal + (self.zero + drift)
        if self.hysteresis:
            width = 0.01 * (self.high - self.low)
            seen = seen + self.hysteresis * np.clip(signal / width, -1.0, 1.0)
        if rng is not None and self.noise > 0.0:
            seen = seen + self.noise * rng.standard_normal(np.shape(signal))
        steps = np.rint((np.clip(seen, self.low, self.high) - self.low) / self.step)
        return self.low + self.step * steps


@dataclass(frozen=True)
class Encoder:
    """Incremental encoder.

    Parameters
    ----------
    resolution_m : float
        Distance between two counts.
    """

    resolution_m: float

    def read(self, position_m: Array) -> Array:
        """Return the counted position: the last full count."""
        return np.floor(position_m / self.resolution_m) * self.resolution_m


@dataclass(frozen=True)
class AbsolutePressure(Quantity):
    """Annotation of a field for an absolute pressure, stored in Pa."""

    def read(self, given: object) -> float:
        """Convert and check an absolute pressure."""
        pressure = StatedPressure().read(given)
        if pressure.gauge:
            raise DescriptionError(f'"{given}" is not an absolute pressure', remedy='Write "... abs".')
        return pressure.value_pa


@dataclass(frozen=True)
class Difference(Quantity):
    """Annotation of a field for a difference of temperatures, in K."""

    def read(self, given: object) -> float:
        """Convert and check a difference of temperatures."""
        if not str(given).endswith(" K"):
            raise DescriptionError(f'"{given}" is not a difference of temperatures', rule='in K, e.g. "0.5 K"')
        return super().read(given)


def _mark(unit: str, bounds: Bounds) -> Mark:
    """Return the annotation of a unit: "1" for a number, "abs" for absolute pressure, "delta K" for a difference."""
    if unit == "abs":
        return AbsolutePressure("Pa", "bar", bounds)
    return Difference("K", "K", bounds) if unit == "delta K" else Quantity("" if unit == "1" else unit, bounds=bounds)


def _key(key: str, row: Plain) -> tuple[Any, Any]:
    """Return type and field of a key from its row in ``keys.toml``; a required key has the default ``...``."""
    default = None if row.get("optional") else row.get("default", ...)
    meaning = row.get("meaning")
    if "words" in row:
        mark: Mark = Choice(tuple(row["words"]))
    elif "of" in row:
        kind, _, name = row["of"].rpartition(".")
        parameter = next(p for p in component_kinds()[kind]["parameters"] if p["key"] == name)
        if default is ... and parameter["default"] is not None:
            default = parameter["default"]
        mark, usual = parameter_quantity(parameter), parameter["meaning"]
        meaning = meaning or usual[0].lower() + usual[1:]
    else:
        sign = next(sign for sign in BOUNDS if sign in row)
        mark = _mark(row[sign], BOUNDS[sign])
    return Annotated[Any, mark], Field(default=default, alias=key, description=meaning)


BOUNDS = {"positive": Bounds(above=0.0), "not_negative": Bounds(at_least=0.0), "any_sign": Bounds()}
_TABLES: Plain = package_table(__file__, "keys.toml")
#: table -> its title
TABLES: dict[str, str] = {name: table["title"] for name, table in _TABLES.items() if "title" in table}
KEYS: dict[str, Plain] = {
    name: {key: _key(key, row) for key, row in _TABLES[name].items() if key != "title"} for name in TABLES
}
#: Keys of a table [mounting.NAME]: a mounting other than `RIGID`.
MOUNTING: Plain = {key: _key(key, row) for key, row in _TABLES["mounting"].items()}
#: Mounting of every rig, without side load.
RIGID = "rigid"

_SUPPLIED = tuple(key for key in KEYS["chambers"] if key not in ("kind", "leakage", "piston_leakage"))
#: Required keys of each kind of chambers.
NEEDED: dict[str, tuple[str, ...]] = {
    "held": (),
    "open": ("dead_volume", "heat_transfer", "line_conductance", "critical_pressure_ratio"),
    "common": _SUPPLIED,
    "separate": _SUPPLIED,
}

SCHEMA = 1
#: Top-level keys of a rig file that are not tables.
TOP = ("schema", "name", "kind", "extends")
RULE = '{ value = "25 mm", source = "assumed", reason = "..." }'


@dataclass(frozen=True)
class Source:
    """Source of a value of the rig.

    Attributes
    ----------
    value : str
        Value as written, with its unit.
    source : str
        Key of references.bib, or ``assumed``.
    reason : str
    """

    value: str
    source: str
    reason: str


def bare(text: str) -> str | float:
    """Convert quoted numbers without a unit and quoted percentages to numbers, as in a drive file."""
    number, unit = units.split_number(text)
    if np.isnan(number) or unit not in ("", "%"):
        return text
    return number / 100.0 if unit else number


@lru_cache(maxsize=1)
def _rig_class() -> type[Described]:
    """Return the class of a rig file, with a table for each of `KEYS`."""
    classes = {n: create_model(f"Rig{n.title()}", __base__=Described, **keys) for n, keys in KEYS.items()}
    mounting = create_model("RigMounting", __base__=Described, **MOUNTING)
    tables = {name: (cls, ...) for name, cls in classes.items()}
    fields: Plain = {"mounting": (dict[str, mounting], Field(default_factory=dict))}  # type: ignore[valid-type]
    return create_model("RigTables", __base__=Described, **tables, **fields)


def rig_schema() -> Plain:
    """Return the JSON schema of a rig file, which describes a simulated rig, or identity and limits of another rig."""
    written = {"type": ["string", "number", "boolean"]}
    parts = dict.fromkeys(("value", "source", "reason"), written)
    sourced = {"anyOf": [written, {"type": "object", "properties": parts, "required": ["value", "source"]}]}
    schema: Plain = RigFile.model_json_schema(by_alias=True)
    schema["additionalProperties"] = True  # keys of further kinds
    schema["properties"] |= {"extends": {"type": "string"}, "name": {"type": "string"}}
    for name, keys in KEYS.items():
        described = {key: {**sourced, "description": field.description} for key, (_, field) in keys.items()}
        schema["properties"][name] = {"type": "object", "properties": described}
    return schema


def _friction(given: Plain, path: Path) -> Friction:
    """Read the friction table, as in a drive file but with a required law."""
    if not isinstance(given.get("law"), str):
        raise wrong("friction.law", "friction.law is missing", rule='law = "stribeck", without a source')
    read_file(given, "law", "friction", law_of, path)
    return Friction.model_validate(given)


def open_file(path: str | Path, above: tuple[Path, ...] = ()) -> Plain:
    """Read the tables of a rig file, merged over those of the file that it extends.

    Raises
    ------
    DescriptionError
        A file cannot be read, has another schema, or extends itself.
    """
    path, where = Path(path), str(path)
    if path in above:
        raise DescriptionError("the rig file extends itself", where=where)
    content, _ = toml.read(path, start="The guides on rigs show examples of rig files.")
    if content.get("schema") != SCHEMA:
        raise DescriptionError("the rig file has another schema", where=where, rule=f"schema = {SCHEMA}")
    base = content.pop("extends", None)
    if base is None:
        return content
    below = open_file(shipped_rigs().get(str(base), path.parent / str(base)), (*above, path))
    law, old = (_table(one, "friction").get("law") for one in (content, below))
    if law is not None and law != old:  # another friction law drops the values of the old one
        kept = {key: table for key, table in _table(below, "friction").items() if toml.is_table(table)}
        below["friction"] = kept
    return toml.merge(below, content, toml.is_table)


def _table(content: Plain, name: str) -> Plain:
    table = content.get(name)
    return table if isinstance(table, dict) else {}


def _plain(name: str, given: Any, sources: dict[str, Source], problems: Problems, origin: Plain) -> Any:  # noqa: ANN401
    """Return the values without sources, in the form of a drive file. A list or pair may have a common `origin`."""
    if name == "friction.law":
        if isinstance(given, str):
            return given
        raise wrong(name, f"{name} must be a name without a source", rule='law = "stribeck", without a source')
    if not isinstance(given, dict) and "." not in name:
        raise wrong(name, f"{name} = {given!r} is not a table")
    inner: Plain = dict(given) if isinstance(given, dict) else {"value": given}
    origin = origin | {key: inner.pop(key) for key in ("source", "reason") if key in inner}
    if "value" not in inner:
        return {
            key: problems.take(_plain, f"{name}.{key}", value, sources, problems, origin)
            for key, value in inner.items()
        }
    value = inner.pop("value")
    if inner:
        raise wrong(name, f"{name}: {next(iter(inner))!r} is unknown", rule=RULE)
    if isinstance(value, list):
        return [_plain(f"{name}.{number}", one, sources, problems, origin) for number, one in enumerate(value)]
    if "source" not in origin:
        shown = name if isinstance(given, dict) else f"{name} = {given!r}"
        raise wrong(name, f"{shown} has no source", rule=RULE)
    sources[name] = Source(str(value), str(origin["source"]), str(origin.get("reason", "")))
    return bare(str(value))


DEFAULT = Path(__file__).with_name("default.toml")

#: Fraction of the range by which a gauge transducer reads below zero before it saturates (assumed).
BELOW_ZERO = 0.02
#: Range and resolution of the thermometer (assumed): a 4-wire Pt100 with a 16-bit converter.
THERMOMETER_K, THERMOMETER_BITS = (253.15, 353.15), 16


@dataclass(frozen=True)
class RigDescription:
    """Description of a simulated rig in SI.

    Attributes
    ----------
    name : str
    friction : dict
        Friction of the piston in the core's form: law, parameters, pressure in N/Pa per chamber, and other modifiers
        (dwell, relaxation, position, direction).
    tables : Described
        The tables of `KEYS` in SI, such as ``tables.servo.margin``. An absent key has the value None.
        ``tables.mounting`` has each mounting other than `RIGID`, by name.
    sources : dict
        ``table.key`` -> `Source`.
    """

    name: str
    friction: dict[str, Any]
    tables: Any
    sources: dict[str, Source] = field(repr=False)

    @cached_property
    def areas_m2(self) -> Pair:
        """Piston areas in chambers a and b, in m2."""
        return piston_areas(self.tables.cylinder.kind, self.tables.cylinder.bore, self.tables.cylinder.rod_diameter)

    @property
    def ambient_pressure_pa(self) -> float:
        """Absolute pressure of the room."""
        return self.tables.ambient.pressure

    @cached_property
    def limits(self) -> MotionLimits:
        """Limits of the servo axis."""
        return MotionLimits(self.tables.servo.acceleration, self.tables.servo.jerk)

    @cached_property
    def sampling(self) -> Sampling:
        """Default sampling of a session."""
        s = self.tables.sampling
        return Sampling(int(s.samples_per_stroke), s.burst_rate, s.burst_before, s.burst_after, s.hold_rate)

    @cached_property
    def force_sensor(self) -> AnalogSensor:
        """Force sensor without calibration errors."""
        s = self.tables.force_sensor
        return AnalogSensor(-s.range, s.range, int(s.bits), s.noise, s.zero)

    @cached_property
    def pressure_sensor(self) -> AnalogSensor:
        """Pressure sensor for absolute pressures, without calibration errors."""
        s, ambient = self.tables.pressure_sensor, self.ambient_pressure_pa
        return AnalogSensor(ambient - BELOW_ZERO * s.range, ambient + s.range, int(s.bits), s.noise, s.zero)

    @cached_property
    def thermometer(self) -> AnalogSensor:
        """Thermometer without calibration errors."""
        return AnalogSensor(*THERMOMETER_K, THERMOMETER_BITS, self.tables.temperature_sensor.noise)

    @cached_property
    def encoder(self) -> Encoder:
        """Encoder of the carriage."""
        return Encoder(self.tables.encoder.resolution)


def read_description(path: str | Path) -> RigDescription:
    """Read a rig file.

    Raises
    ------
    DescriptionError
        If the file cannot be read, a key is unknown or missing, or a value has no unit or source.
    """
    path, sources = Path(path), dict[str, Source]()
    content, unsourced, problems = open_file(path), Problems(), Problems()
    plain = {
        name: unsourced.take(_plain, name, table, sources, unsourced, {}, otherwise={})
        for name, table in content.items()
        if name not in TOP
    }
    friction = problems.take(_friction, plain.pop("friction", {}), path)
    tables = problems.take(_rig_class().model_validate, {name: {} for name in KEYS} | plain)
    # One error for each key: it is unknown, has no source, or has another problem.
    found = problems.found.values()
    unknown = tuple(one.key or "" for one in found if "is not a known key" in one.what)
    without_source = [one for one in unsourced.found.values() if not (one.key or "").startswith(unknown)]
    told = {one.key for one in without_source}
    others = [one for one in found if one.key not in told]
    with toml.locating(path, toml.read(path)[1]):
        if errors := [*without_source, *others]:
            raise together(errors)
        _check(tables)
    description = RigDescription(str(content.get("name", path.stem)), friction.core(), tables, sources)
    for sensor in ("force_sensor", "pressure_sensor"):
        getattr(description, sensor)  # a resolution that is not possible is an error of the file
    return description


def _check(tables: Any) -> None:  # noqa: ANN401 - of a class that is made of the keys
    """Check that the values are consistent, and raise all errors at once."""
    cylinder = tables.cylinder
    servo = tables.servo
    chambers = tables.chambers
    problems = Problems()

    def refuse(key: str, what: str, rule: str) -> None:
        problems.add(wrong(key, what, rule=rule))

    if 2.0 * servo.margin >= cylinder.stroke:
        refuse("servo.margin", "servo.margin leaves no stroke for motion", "0 <= margin < stroke / 2")
    if cylinder.rod_diameter >= cylinder.bore:
        refuse("cylinder.rod_diameter", "cylinder.rod_diameter is not smaller than the bore", "rod_diameter < bore")
    if (servo.bandwidth is None) != (servo.damping_ratio is None):
        rule = "give both, or neither for a rigid axis"
        refuse("servo.bandwidth", "servo.bandwidth and servo.damping_ratio are needed together", rule)
    if servo.ripple > 0.0 and servo.pitch is None:
        refuse("servo.ripple", "servo.ripple needs servo.pitch", "servo.pitch is the period of the ripple")
    for key in NEEDED[chambers.kind]:
        if getattr(chambers, key) is None:
            refuse("chambers", f"chambers.{key} is missing", f'chambers of kind "{chambers.kind}" need this value')
    problems.tell()
