"""The description of a simulated rig: a TOML file in which each value states its source."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.describe import friction_laws, toml
from pneudrive.describe.geometry import piston_areas
from pneudrive.errors import DescriptionError, nearest
from pneudrive.rig.motion import Limits
from pneudrive.rig.sensors import CLOCKS, AnalogSensor, Encoder, EncoderClock, TimeClock
from pneudrive.units import parse, parse_pressure

if TYPE_CHECKING:
    from collections.abc import Collection

DEFAULT = Path(__file__).with_name("default.toml")
SCHEMA = 1
#: table -> key -> SI unit as `pneudrive.units` writes it ("1": a pure number, "abs": an absolute pressure).
#: The parameters of friction are those of the law, which the core knows.
KEYS: dict[str, dict[str, str]] = {
    "cylinder": {"bore": "m", "stroke": "m", "moving_mass": "kg", "incline": "rad"},
    "ambient": {"pressure": "abs"},
    "servo": {"acceleration": "m/s^2", "jerk": "m/s^3", "margin": "m"},
    "sampling": {"samples_per_cycle": "1"},
    "force_sensor": {
        "stiffness": "N/m",
        "damping": "N s/m",
        "range": "N",
        "bits": "1",
        "noise": "N",
        "zero": "N",
        "accuracy": "N",
    },
    "pressure_sensor": {"range": "Pa", "bits": "1", "noise": "Pa", "zero": "Pa", "accuracy": "Pa"},
    "encoder": {"resolution": "m"},
}
#: Share of its range that a gauge transducer still shows below zero before it saturates (assumed).
BELOW_ZERO = 0.02


@dataclass(frozen=True)
class Source:
    """Where a value of the rig comes from.

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


@dataclass(frozen=True)
class RigDescription:
    """All of a simulated rig in SI.

    Attributes
    ----------
    name : str
    law, parameters, pressure : str, dict, dict or None
        Friction of the piston as in a drive file; `pressure` in N/Pa per chamber.
    area_m2, bore_m, stroke_m, moving_mass_kg, incline_rad, ambient_pressure_pa : float
    limits, margin_m
        Servo axis, and the distance of its reversals from the ends of the stroke.
    clock
        Sample clock.
    stiffness_n_m, damping_n_s_m : float
        Of the force sensor.
    force_sensor, pressure_sensor, encoder
    force_accuracy_n, pressure_accuracy_pa : float
        Standard uncertainties that the recordings state.
    sources : dict
        ``table.key`` -> `Source`.
    """

    name: str
    law: str
    parameters: dict[str, float]
    pressure: dict[str, float] | None
    bore_m: float
    stroke_m: float
    moving_mass_kg: float
    incline_rad: float
    ambient_pressure_pa: float
    limits: Limits
    margin_m: float
    clock: TimeClock | EncoderClock
    stiffness_n_m: float
    damping_n_s_m: float
    force_sensor: AnalogSensor
    pressure_sensor: AnalogSensor
    encoder: Encoder
    force_accuracy_n: float
    pressure_accuracy_pa: float
    sources: dict[str, Source]

    @property
    def area_m2(self) -> float:
        """Piston area, the same on both sides (rodless)."""
        return piston_areas("rodless", self.bore_m)[0]


def read_description(path: str | Path = DEFAULT) -> RigDescription:
    """Read a rig file.

    Raises
    ------
    DescriptionError
        If the file cannot be read, a key is unknown or missing, a value lacks its unit or its source.
    """
    where = str(path)
    try:
        content = toml.tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, toml.tomllib.TOMLDecodeError) as error:
        raise DescriptionError("the rig file cannot be read", where=where, value=str(error)) from error
    if content.get("schema") != SCHEMA:
        raise DescriptionError("the rig file has another schema", where=where, rule=f"schema = {SCHEMA}")
    reader = _Reader(content, where)
    values = {table: reader.table(table) for table in KEYS}
    values["friction"] = reader.friction()
    pressure = reader.pressure()
    reader.finish()
    return _build(str(content.get("name", Path(path).stem)), reader, values, pressure)


def _build(
    name: str, reader: _Reader, values: dict[str, dict[str, float]], pressure: dict[str, float] | None
) -> RigDescription:
    cylinder, servo, force, air = (values[t] for t in ("cylinder", "servo", "force_sensor", "pressure_sensor"))
    ambient = values["ambient"]["pressure"]
    for key in ("bore", "stroke", "moving_mass"):
        reader.positive("cylinder", key, cylinder[key])
    reader.positive("force_sensor", "stiffness", force["stiffness"])
    if 2.0 * servo["margin"] >= cylinder["stroke"] or servo["margin"] < 0.0:
        raise DescriptionError("servo.margin leaves no way to go", where=reader.where, rule="0 <= margin < stroke / 2")
    return RigDescription(
        name=name,
        law=reader.law,
        parameters=values["friction"],
        pressure=pressure,
        bore_m=cylinder["bore"],
        stroke_m=cylinder["stroke"],
        moving_mass_kg=cylinder["moving_mass"],
        incline_rad=cylinder["incline"],
        ambient_pressure_pa=ambient,
        limits=Limits(servo["acceleration"], servo["jerk"]),
        margin_m=servo["margin"],
        clock=CLOCKS[reader.clock](int(values["sampling"]["samples_per_cycle"])),
        stiffness_n_m=force["stiffness"],
        damping_n_s_m=force["damping"],
        force_sensor=AnalogSensor(-force["range"], force["range"], int(force["bits"]), force["noise"], force["zero"]),
        pressure_sensor=AnalogSensor(
            ambient - BELOW_ZERO * air["range"], ambient + air["range"], int(air["bits"]), air["noise"], air["zero"]
        ),
        encoder=Encoder(values["encoder"]["resolution"]),
        force_accuracy_n=force["accuracy"],
        pressure_accuracy_pa=air["accuracy"],
        sources=reader.sources,
    )


class _Reader:
    """Takes values with units and sources out of the parsed file; what is left over is unknown."""

    def __init__(self, content: dict, where: str) -> None:
        self.content = content
        self.where = where
        self.sources: dict[str, Source] = {}
        self.law = str(content.get("friction", {}).pop("law", "stribeck"))
        if self.law not in friction_laws():
            what = f"friction.law = {self.law!r} is unknown"
            raise DescriptionError(what, where=where, remedy=nearest(self.law, friction_laws()))
        self.clock = self._word("sampling.clock", content.get("sampling", {}).pop("clock", None), CLOCKS)

    def table(self, table: str) -> dict[str, float]:
        given = self.content.get(table, {})
        out = {}
        for key, unit in KEYS[table].items():
            if key not in given:
                raise DescriptionError(f"{table}.{key} is missing", where=self.where, remedy="see the default rig file")
            out[key] = self._value(f"{table}.{key}", given.pop(key), unit)
        return out

    def friction(self) -> dict[str, float]:
        given = self.content.get("friction", {})
        out = {}
        for parameter in friction_laws()[self.law]["parameters"]:
            key, unit = parameter["key"], parameter["unit"]
            if key in given:
                out[key] = self._value(f"friction.{key}", given.pop(key), "1" if unit == "-" else unit)
            elif parameter["default"] is None:
                raise DescriptionError(f"friction.{key} is missing", where=self.where, rule=parameter["meaning"])
        return out

    def pressure(self) -> dict[str, float] | None:
        given = self.content.get("friction", {}).pop("pressure", None)
        if given is None:
            return None
        out = {}
        for force, entry in given.items():
            if force not in ("coulomb", "breakaway"):
                raise DescriptionError(
                    f"friction.pressure.{force} is unknown", where=self.where, rule="coulomb, breakaway"
                )
            for chamber in ("a", "b"):
                one = {**entry, "value": entry.get(chamber, "0 N/bar")}
                one.pop("a", None)
                one.pop("b", None)
                out[f"{force}_{chamber}"] = self._value(f"friction.pressure.{force}.{chamber}", one, "N/Pa")
        return out

    def finish(self) -> None:
        keys = {**KEYS, "friction": [p["key"] for p in friction_laws()[self.law]["parameters"]]}
        for table, rest in self.content.items():
            if table in ("schema", "name"):
                continue
            if table not in keys:
                raise DescriptionError(f"[{table}] is unknown", where=self.where, rule=f"tables: {', '.join(keys)}")
            for key in rest:
                rule = f"keys: {', '.join(keys[table])}"
                raise DescriptionError(f"{table}.{key} is unknown", where=self.where, rule=rule)

    def positive(self, table: str, key: str, value: float) -> None:
        if not (math.isfinite(value) and value > 0.0):
            raise DescriptionError(f"{table}.{key} must be positive", where=self.where, value=value)

    def _word(self, name: str, entry: object, choices: Collection[str]) -> str:
        text = self._text(name, entry)
        if text not in choices:
            remedy = nearest(text, choices)
            raise DescriptionError(f"{name} = {text!r} is unknown", where=self.where, remedy=remedy)
        return text

    def _text(self, name: str, entry: object) -> str:
        if not isinstance(entry, dict) or not {"value", "source"} <= set(entry):
            raise DescriptionError(
                f"{name} does not say its source",
                where=self.where,
                value=entry,
                rule='{ value = "25 mm", source = "assumed", reason = "..." }',
            )
        text = str(entry["value"])
        self.sources[name] = Source(text, str(entry["source"]), str(entry.get("reason", "")))
        return text

    def _value(self, name: str, entry: object, unit: str) -> float:
        text = self._text(name, entry)
        if unit == "1":
            try:
                return float(text)
            except ValueError as error:
                raise DescriptionError(f"{name} is a pure number", where=self.where, value=text) from error
        if unit == "abs":
            stated = parse_pressure(text)
            if stated.gauge:
                raise DescriptionError(f"{name} is an absolute pressure", where=self.where, value=text)
            return stated.value_pa
        return parse(text, unit)
