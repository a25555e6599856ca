"""Task of a drive: load, stroke, times and spreads. `SizingTask` reads its file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import Field, model_validator

from pneudrive import units
from pneudrive.constants import STANDARD_GRAVITY_M_S2
from pneudrive.describe import marks
from pneudrive.describe.base import Described, inline
from pneudrive.describe.files import toml
from pneudrive.describe.files.catalogue import entries
from pneudrive.describe.marks import NOT_NEGATIVE, POSITIVE, Between, Bounds, Force, Length, Mass, Percent, Quantity
from pneudrive.describe.marks import StatedPressure as Stated
from pneudrive.describe.tables.parts import Ambient
from pneudrive.errors import WrongValueError, invalid, wrong

#: Coefficient of friction of a guide for the load (assumed: usual values; ball guides with seals).
GUIDES = {"none": 0.0, "ball": 0.02, "plain": 0.15}
_LONG = re.compile(r"(?<![\w.])\d*\.\d{10,}(?:[eE][-+]?\d+)?(?![\w.])")
Seconds = Annotated[float | None, Quantity("s", "s", POSITIVE)]
Speed = Annotated[float | None, Quantity("m/s", "m/s", POSITIVE)]
_Factor = Annotated[float | None, Quantity("", bounds=POSITIVE)]
Share = Annotated[float, Percent("%", None, Bounds(at_least=0.0, below=90.0))]


class _Factors(Between):
    """Annotation of a field for a range of factors, ``"0.7 .. 1.5"``."""

    def read(self, given: object) -> tuple[float, float]:  # type: ignore[override]
        """Convert and check."""
        ends = given.split("..") if isinstance(given, str) else []
        try:
            low, high = (float(end) for end in ends)
        except ValueError:
            raise WrongValueError(f"{given!r} is not a range of factors", remedy='Write "0.7 .. 1.5".') from None
        if not 0.0 < low <= high < math.inf:
            raise WrongValueError(f'"{given}" is out of bounds', rule="0 < first end <= second end")
        return low, high

    def show(self, value: tuple[float, float]) -> str:  # type: ignore[override]
        """Write the range."""
        return f"{value[0]:g} .. {value[1]:g}"

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the form that users write."""
        return {"type": "string", "pattern": r"^.+ \.\. .+$"}


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
    friction: Annotated[tuple[float, float], _Factors("")] = Field(
        default=(0.7, 1.5), description="factors of the friction of cylinder and guide"
    )
    conductance: Share = Field(default=0.1, description="of valves, tubes and needles, +-; doubled for assumed values")
    temperature_k: Annotated[tuple[float, float] | None, Between("K", "degC")] = Field(
        default=None, description="of air and cylinder; absent: 10 K below to 15 K above the ambient temperature"
    )
    heat_transfer: Annotated[tuple[float, float], _Factors("")] = Field(
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
    }
    schema_version: Literal[1] = Field(default=1, alias="schema")
    name: str = "task"
    mass_kg: Mass = Field(description="mass of the load; the mass of the piston is added")
    stroke_m: Length
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
    guide: Literal["none", "ball", "plain"] = Field(default="none", description="what carries the load")
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
        return any(fnmatchcase(name, word) or fnmatchcase(kind, word) for word in self.exclude)

    @property
    def template_key(self) -> str:
        """Properties of the task that determine a circuit, except for sampled numbers."""
        return (
            f"{self.stroke_m!r} {self.incline_rad!r} {self.external_force_n!r} {self.supply} {self.ambient.to_dict()}"
        )

    @property
    def supply_pa(self) -> float:
        """Nominal supply pressure, absolute, Pa."""
        return self.supply.pressure.absolute_pa(self.ambient.pressure_pa)

    @property
    def temperatures_k(self) -> tuple[float, float]:
        """Range of the temperature of air and cylinder, K."""
        return self.spread.temperature_k or (self.ambient.temperature_k - 10.0, self.ambient.temperature_k + 15.0)

    @property
    def outward_s(self) -> float:
        """Longest time of the outward stroke, s."""
        return self.stroke_m / self.speed_m_s if self.time_s is None else self.time_s  # type: ignore[operator]

    @property
    def back_s(self) -> float:
        """Longest time of the return stroke, s."""
        return self.outward_s if self.return_time_s is None else self.return_time_s

    @property
    def static_force_n(self) -> float:
        """Force against the outward stroke at rest, without friction: weight along the axis and external force, N."""
        return self.mass_kg * STANDARD_GRAVITY_M_S2 * math.sin(self.incline_rad) + self.external_force_n

    @property
    def across_n(self) -> float:
        """Weight of the load across the axis, N."""
        across = 0.0 if abs(self.incline_rad) == 0.5 * math.pi else math.cos(self.incline_rad)  # else 6e-17
        return self.mass_kg * STANDARD_GRAVITY_M_S2 * across

    @property
    def guide_friction_n(self) -> float:
        """Friction of the guide under the weight of the load, N."""
        return GUIDES[self.guide] * self.across_n


def task_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a task."""
    schema = SizingTask.model_json_schema(by_alias=True)
    timed = [{"required": ["time"]}, {"required": ["speed"]}]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "oneOf": timed}


class TaskValue(NamedTuple):
    """One value of a task: key, text, whether it is given or a default, and meaning."""

    key: str
    text: str
    is_given: bool
    meaning: str


def values_of(task: SizingTask) -> list[TaskValue]:
    """Return every value of a task, including defaults, in the order of its file."""
    given = dict(toml.leaves(task.to_dict()))
    meanings = dict(_meanings(task))
    return [
        TaskValue(key, _brief(value) if isinstance(value, str) else inline(value), key in given, meanings.get(key, ""))
        for key, value in toml.leaves(task.with_defaults())
        if key != "schema"
    ]


def _brief(text: str) -> str:
    """Return a text with its numbers rounded to ten digits.

    Further digits are noise of a conversion, for example of 6 lb to kg.
    """
    return _LONG.sub(lambda found: f"{float(found[0]):.10g}", text)


def follows_from(task: SizingTask) -> list[tuple[str, float, str]]:
    """Return the values derived from a task: name, value, unit."""
    return [
        ("force against the outward stroke at rest, without friction", task.static_force_n, "N"),
        ("friction of the guide under the load", task.guide_friction_n, "N"),
        ("longest time outwards", task.outward_s, "s"),
        ("longest time back", task.back_s, "s"),
    ]


def _meanings(part: Any, before: str = "") -> Iterator[tuple[str, str]]:  # noqa: ANN401 - a table of a description
    for name, field in type(part).model_fields.items():
        key, value = f"{before}{field.alias or name}", getattr(part, name)
        if hasattr(type(value), "model_fields"):
            yield from _meanings(value, f"{key}.")
        else:
            yield key, field.description or ""
