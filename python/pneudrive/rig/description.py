"""Description of a simulated rig: a TOML file in which each value has a unit and states its source.

Only known keys are read. One file can extend another.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, create_model

from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.formulas.law import law_of
from pneudrive.describe.keys import wrong
from pneudrive.describe.tables.friction import Friction
from pneudrive.describe.tables.geometry import piston_areas
from pneudrive.errors import DescriptionError, Problems
from pneudrive.rig.interface import Sampling
from pneudrive.rig.keys import KEYS, MOUNTING, NEEDED, RIGID, Key
from pneudrive.rig.motion import MotionLimits
from pneudrive.rig.sensors import CLOCKS, AnalogSensor, Encoder, EncoderClock, TimeClock

SCHEMA = 1
#: Top-level keys of a rig file that are not tables.
TOP = ("schema", "name", "kind", "extends")
_PURE = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)([eE][+-]?\d+)?$")
RULE = '{ value = "25 mm", source = "assumed", reason = "..." }'


@dataclass(frozen=True)
class Source:
    """Source of a value of the rig.

    Attributes
    ----------
    value : str
        As written, with its unit.
    source : str
        Key of references.bib, or ``assumed``.
    reason : str
    """

    value: str
    source: str
    reason: str


def bare(text: str) -> str | float:
    """Convert quoted pure numbers and percentages to the form of a drive file, without quotes."""
    plain = text.strip().removesuffix("%").rstrip()
    if not _PURE.match(plain):
        return text
    return float(plain) / 100.0 if "%" in text else float(plain)


@lru_cache(maxsize=1)
def _rig_class() -> type[Described]:
    """Return the class of a rig file, with a table for each of `KEYS`."""
    tables = {name: (_table_class(name, keys), ...) for name, keys in KEYS.items()}
    mounting = _table_class("mounting", MOUNTING)
    fields: dict[str, Any] = {"mounting": (dict[str, mounting], Field(default_factory=dict))}  # type: ignore[valid-type]
    return create_model("RigTables", __base__=Described, **tables, **fields)


def _table_class(name: str, keys: dict[str, Key]) -> type[Described]:
    fields: dict[str, Any] = {
        key: (Annotated[Any, one.mark], Field(default=one.default, alias=key, description=one.meaning))
        for key, one in keys.items()
    }
    return create_model(f"Rig{name.title()}", __base__=Described, **fields)


def read_tables(path: Path) -> tuple[str, Any, Friction, dict[str, Source]]:
    """Read a rig file: name, tables in SI, friction, and the source of each value.

    Raises
    ------
    DescriptionError
        The file is not valid; the error lists all problems.
    """
    content = open_file(path)
    problems, sources = Problems(), dict[str, Source]()
    plain = {
        name: problems.take(_plain, name, table, sources, problems, otherwise={})
        for name, table in content.items()
        if name not in TOP
    }
    before = dict(problems.found)
    friction = problems.take(_friction, plain.pop("friction", {}), path)
    tables = problems.take(_rig_class().model_validate, {name: {} for name in KEYS} | plain)
    keys = {place: getattr(one, "key", None) or "" for place, one in problems.found.items()}
    unknown = tuple(keys[place] for place, one in problems.found.items() if "is not a known key" in one.what)
    without_source = {keys[place] for place in before if not keys[place].startswith(unknown)}
    for place, key in keys.items():  # one error for each key: unknown, without source, or another problem
        if (place in before) != (key in without_source):
            del problems.found[place]
    with toml.locating(path, toml.read(path)[1]):
        problems.tell()
    return str(content.get("name", path.stem)), tables, friction, sources


def _friction(given: dict[str, Any], path: Path) -> Friction:
    """Read the friction table, as in a drive file but with a required law."""
    law = given.get("law")
    if not isinstance(law, str):
        raise wrong("friction.law", "friction.law is missing", rule='law = "stribeck", without source')
    return Friction.model_validate(given | {"law": law_of(law, path.parent) or law})


def open_file(path: str | Path) -> dict[str, Any]:
    """Read the tables of a rig file, merged over those of the file that it extends.

    Raises
    ------
    DescriptionError
        A file cannot be read, has another schema, or extends itself.
    """
    return _open(Path(path), ())


def _open(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    where = str(path)
    if path in above:
        raise DescriptionError("the rig file extends itself", where=where)
    content, _ = toml.read(path, start="The guides on rigs show examples of rig files.")
    if content.get("schema") != SCHEMA:
        raise DescriptionError("the rig file has another schema", where=where, rule=f"schema = {SCHEMA}")
    base = content.pop("extends", None)
    if base is None:
        return content
    from pneudrive.rig.loading import shipped_rigs

    below = _open(shipped_rigs().get(str(base), path.parent / str(base)), (*above, path))
    law, old = (_table(one, "friction").get("law") for one in (content, below))
    if law is not None and law != old:  # another friction law drops the values of the old one
        kept = {key: table for key, table in _table(below, "friction").items() if toml.is_table(table)}
        below["friction"] = kept
    return toml.merge(below, content, toml.is_table)


def _table(content: dict[str, Any], name: str) -> dict[str, Any]:
    table = content.get(name)
    return table if isinstance(table, dict) else {}


def _plain(name: str, given: Any, sources: dict[str, Source], problems: Problems) -> Any:  # noqa: ANN401
    """Return the values without sources, in the form of a drive file. A list or pair may give one common source."""
    if name == "friction.law":
        if isinstance(given, str):
            return given
        raise wrong(name, f"{name} takes a name without a source", rule='law = "stribeck", without source')
    if isinstance(given, list) and "." in name:
        return [_plain(f"{name}.{number}", one, sources, problems) for number, one in enumerate(given)]
    if not isinstance(given, dict):
        if "." not in name:
            raise wrong(name, f"{name} = {given!r} is not a table")
        raise wrong(name, f"{name} = {given!r} has no source", rule=RULE)
    said = {key: given[key] for key in ("source", "reason") if key in given}
    inner = {key: value for key, value in given.items() if key not in said}
    if "value" in given and (set(inner) != {"value"} or "source" not in said):
        unknown = next((key for key in inner if key != "value"), None)
        what = f"{name}: {unknown!r} is unknown" if unknown else f"{name} has no source"
        raise wrong(name, what, rule=RULE)
    if isinstance(given.get("value"), list):
        return [
            _plain(f"{name}.{number}", _with(one, said), sources, problems) for number, one in enumerate(given["value"])
        ]
    if "value" in given:
        text = str(given["value"])
        sources[name] = Source(text, str(said["source"]), str(said.get("reason", "")))
        return bare(text)
    return {
        key: problems.take(_plain, f"{name}.{key}", {"value": value} | said if said else value, sources, problems)
        for key, value in inner.items()
    }


def _with(given: object, said: dict[str, Any]) -> dict[str, Any]:
    """Add the source of a list to its entry."""
    return (given if isinstance(given, dict) else {"value": given}) | said


DEFAULT = Path(__file__).with_name("default.toml")

#: Share of its range by which a gauge transducer reads below zero before it saturates (assumed).
BELOW_ZERO = 0.02
#: Range and resolution of the thermometer (assumed): a 4-wire Pt100 with a 16-bit converter.
THERMOMETER_K, THERMOMETER_BITS = (253.15, 353.15), 16


@dataclass(frozen=True)
class RigMounting:
    """Mounting of the drive: force across the axis, and coefficient of friction of the guide that carries it."""

    side_load_n: float = 0.0
    coefficient: float = 0.0


@dataclass(frozen=True)
class RigDescription:
    """Description of a simulated rig in SI.

    Attributes
    ----------
    name : str
    law, parameters, pressure : str, dict, dict or None
        Friction of the piston as in a drive file; `pressure` in N/Pa per chamber.
    dependences : dict
        Other friction modifiers (dwell, relaxation, position, direction), in the core's form.
    mountings : dict of RigMounting
    cylinder, rod_diameter_m, bore_m, stroke_m, moving_mass_kg, incline_rad, ambient_pressure_pa, ambient_temperature_k
    limits, margin_m
        Servo axis, and the distance of its reversals from the ends of the stroke.
    clock
        Sample clock of `SimulatedRig.drag`.
    sampling : Sampling
        Usual sampling of a session.
    stiffness_n_m, damping_n_s_m : float
        Stiffness and damping of the force sensor.
    force_sensor, pressure_sensor, thermometer, encoder
    force_accuracy_n, pressure_accuracy_pa, temperature_accuracy_k : float
        Standard uncertainties stated in recordings.
    barrel_share : float
        Share of the seal's rise of temperature that reaches the thermometer on the barrel.
    servo, chambers, drift, thermal, run_in, repeatability, supply, safety : dict
        The tables of the file in SI, None if a key is absent.
    sources : dict
        ``table.key`` -> `Source`.
    """

    name: str
    law: str
    parameters: dict[str, float]
    pressure: dict[str, float] | None
    dependences: dict[str, Any]
    mountings: dict[str, RigMounting]
    cylinder: str
    bore_m: float
    rod_diameter_m: float
    stroke_m: float
    moving_mass_kg: float
    incline_rad: float
    ambient_pressure_pa: float
    ambient_temperature_k: float
    limits: MotionLimits
    margin_m: float
    clock: TimeClock | EncoderClock
    sampling: Sampling
    stiffness_n_m: float
    damping_n_s_m: float
    force_sensor: AnalogSensor
    pressure_sensor: AnalogSensor
    thermometer: AnalogSensor
    encoder: Encoder
    force_accuracy_n: float
    pressure_accuracy_pa: float
    temperature_accuracy_k: float
    barrel_share: float
    servo: dict[str, Any]
    chambers: dict[str, Any]
    pressure_measured_at: str
    drift: dict[str, float]
    thermal: dict[str, float]
    run_in: dict[str, float]
    repeatability: dict[str, float]
    supply_pressure_pa: float | None
    safety: dict[str, float | None]
    sources: dict[str, Source] = field(repr=False)

    @property
    def areas_m2(self) -> tuple[float, float]:
        """Piston areas in chambers a and b."""
        return piston_areas(self.cylinder, self.bore_m, self.rod_diameter_m)

    @property
    def area_m2(self) -> float:
        """Piston area in chamber a."""
        return self.areas_m2[0]


def read_description(path: str | Path = DEFAULT) -> RigDescription:
    """Read a rig file.

    Raises
    ------
    DescriptionError
        If the file cannot be read, a key is unknown or missing, a value lacks its unit or its source.
    """
    name, tables, friction, sources = read_tables(Path(path))
    with toml.locating(path, toml.read(path)[1]):
        _check(tables)
    values = {table: dict(vars(getattr(tables, table))) for table in KEYS}
    return _build(name, values, friction, tables.mounting, sources)


def _check(tables: Any) -> None:  # noqa: ANN401 - of a class that is made of the keys
    """Check the values against each other, and raise all errors at once."""
    cylinder, servo, chambers, problems = tables.cylinder, tables.servo, tables.chambers, Problems()

    def refuse(key: str, what: str, rule: str) -> None:
        problems.add(wrong(key, what, rule=rule))

    if 2.0 * servo.margin >= cylinder.stroke:
        refuse("servo.margin", "servo.margin leaves no stroke to move", "0 <= margin < stroke / 2")
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


def _build(
    name: str,
    values: dict[str, dict[str, Any]],
    friction: Friction,
    mountings: dict[str, Any],
    sources: dict[str, Source],
) -> RigDescription:
    cylinder, servo, force, air = (values[t] for t in ("cylinder", "servo", "force_sensor", "pressure_sensor"))
    ambient, sampling, warm = values["ambient"], values["sampling"], values["temperature_sensor"]
    core = friction.core()
    low, high = ambient["pressure"] - BELOW_ZERO * air["range"], ambient["pressure"] + air["range"]
    return RigDescription(
        name=name,
        law=core.pop("law"),
        parameters=core.pop("parameters"),
        pressure=core.pop("pressure"),
        dependences=core,
        mountings={RIGID: RigMounting()} | {key: RigMounting(*vars(one).values()) for key, one in mountings.items()},
        cylinder=cylinder["kind"],
        bore_m=cylinder["bore"],
        rod_diameter_m=cylinder["rod_diameter"],
        stroke_m=cylinder["stroke"],
        moving_mass_kg=cylinder["moving_mass"],
        incline_rad=cylinder["incline"],
        ambient_pressure_pa=ambient["pressure"],
        ambient_temperature_k=ambient["temperature"],
        limits=MotionLimits(servo["acceleration"], servo["jerk"]),
        margin_m=servo["margin"],
        clock=CLOCKS[sampling["clock"]](int(sampling["samples_per_cycle"])),
        sampling=Sampling(
            int(sampling["samples_per_stroke"]),
            sampling["burst_rate"],
            sampling["burst_before"],
            sampling["burst_after"],
            sampling["hold_rate"],
        ),
        stiffness_n_m=force["stiffness"],
        damping_n_s_m=force["damping"],
        force_sensor=AnalogSensor(-force["range"], force["range"], int(force["bits"]), force["noise"], force["zero"]),
        pressure_sensor=AnalogSensor(low, high, int(air["bits"]), air["noise"], air["zero"]),
        thermometer=AnalogSensor(*THERMOMETER_K, THERMOMETER_BITS, warm["noise"]),
        encoder=Encoder(values["encoder"]["resolution"]),
        force_accuracy_n=force["accuracy"],
        pressure_accuracy_pa=air["accuracy"],
        temperature_accuracy_k=warm["accuracy"],
        barrel_share=warm["share"],
        servo=servo,
        chambers=values["chambers"],
        pressure_measured_at=air["at"],
        drift={"per_k": force["zero_drift_temperature"], "per_s": force["zero_drift_time"]},
        thermal=values["thermal"],
        run_in=values["run_in"],
        repeatability=values["repeatability"],
        supply_pressure_pa=values["supply"]["pressure"],
        safety=values["safety"],
        sources=sources,
    )
