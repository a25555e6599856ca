"""The tables of a layout file, one class each, and their combination for one file."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, StrictBool, create_model, model_validator

from pneudrive import units
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.describe.base import Described
from pneudrive.describe.keys import WrongValueError, wrong
from pneudrive.describe.marks import (
    Angle,
    Between,
    Bounds,
    Choice,
    Percent,
    PressureBetween,
    Quantity,
    Reads,
    StatedPressure,
    Whole,
    absolute,
)
from pneudrive.describe.tables.geometry import PistonTable
from pneudrive.files.tables import FORMATS
from pneudrive.friction.friction_map import COLUMNS
from pneudrive.signals.force_calibration import ForceCalibration, of_quantities
from pneudrive.signals.tables import date_times
from pneudrive.signals.tables.column_units import ColumnUnit, column_unit, uncertainty
from pneudrive.signals.tables.text_table import TextForm

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from pneudrive.errors import DescriptionError

# Channel -> SI unit.
CHANNEL_UNITS = {"time": "s", "position": "m", "force": "N", "pressure_a": "Pa", "pressure_b": "Pa"}
# Further channels of a recording of a drive; a layout with a command is one of a drive.
DRIVE_UNITS = {"command": "", "velocity": "m/s", "temperature_a": "K", "temperature_b": "K"}
# Channels of a recording of a fixed volume. Its command is the opening fraction of the line, and its inlet pressure is
# measured between line and tube.
VOLUME_UNITS = {"time": "s", "pressure": "Pa", "inlet_pressure": "Pa", "command": ""}
UNITS = {**CHANNEL_UNITS, **DRIVE_UNITS, **VOLUME_UNITS}
#: Kind of recording -> its channels, and those that it needs.
CHANNELS = {
    "rig": (CHANNEL_UNITS, ("time", "position", "force")),
    "drive": (CHANNEL_UNITS | DRIVE_UNITS, ("time", "command", "position", "pressure_a", "pressure_b")),
    "fixed-volume": (VOLUME_UNITS, ("time", "pressure")),
}
DELIMITERS = {"whitespace": None, "tab": "\t", "comma": ",", "semicolon": ";", "space": " "}
#: SI unit -> a unit that a column may have.
EXAMPLES = {"Pa": "bar gauge", "m": "mm", "s": "s", "N": "N", "m/s": "mm/s", "K": "degC"}


def _place(given: object) -> int | str:
    """Read the number or name of a column, which may be in a table."""
    if isinstance(given, bool) or not isinstance(given, int | str):
        remedy = 'column = 0, or a name of the header in quotes: column = "Force"'
        raise WrongValueError(f"{given!r} is not a column", remedy=remedy)
    return given


def _scale(given: object) -> float:
    if Quantity("").read(given) == 0.0:
        raise WrongValueError("scale = 0 makes all values equal", rule="SI value = (raw * scale + offset) in its unit")
    return Quantity("").read(given)


def _unit(channel: str, given: object) -> ColumnUnit | str:
    """Read the unit of a channel; of a command, and of a date, it is a text."""
    is_text = channel == "command" or (channel == "time" and given == date_times.UNIT)
    return str(given) if is_text else column_unit(given, UNITS[channel])  # type: ignore[arg-type]


def _one_character(given: object) -> str:
    if not isinstance(given, str) or len(given) != 1:
        raise WrongValueError(f"{given!r} must be one character")
    return given


def _delimiter(given: object) -> str | None:
    if not isinstance(given, str) or (given not in DELIMITERS and len(given) != 1):
        raise WrongValueError(f"{given!r} is not known", rule=f"one character, or one of {', '.join(DELIMITERS)}")
    return DELIMITERS.get(given, given)


class ColumnTable(Described):
    """Keys of the columns of all channels."""

    channel: ClassVar[str] = ""
    column: Annotated[int | str, Reads(_place)]
    clock: Annotated[int | str | None, Reads(_place)] = None
    wraps: Annotated[float | None, Quantity("", bounds=Bounds(above=0.0))] = None
    guessed: StrictBool = False
    scale: Annotated[float, Reads(_scale)] = 1.0
    offset: Annotated[float, Quantity("")] = 0.0
    delay_s: Annotated[float, Quantity("s", "s")] = 0.0
    accuracy: Any = None
    range: Any = None
    positive: Literal["+x", "-x"] = "+x"
    unit: Any = None
    calibration: Annotated[str, Reads(str)] = ""
    format: str = date_times.ISO

    @property
    def is_date(self) -> bool:
        """Whether the column contains dates and times."""
        return self.unit == date_times.UNIT

    @property
    def conversion(self) -> ColumnUnit:
        """Unit as a line to SI. A command and a date have the factor 1."""
        return self.unit if isinstance(self.unit, ColumnUnit) else ColumnUnit(1.0)

    def in_unit(self, raw: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return raw numbers in the column's unit, towards +x. Unchanged numbers are not copied."""
        value = raw if self.scale == 1.0 else raw * self.scale
        value = value if self.offset == 0.0 else value + self.offset
        return value if self.positive == "+x" else -1 * value

    @model_validator(mode="after")
    def _fits_the_channel(self) -> ColumnTable:
        said = self.model_fields_set
        if self.channel == "command" and ("unit" in said) != ("range" in said):
            rule = "a command is the fraction of full opening, -1 to 1: give scale and offset, or unit and range"
            remedy = 'command = { column = 0, unit = "V", range = "0 V .. 10 V" }: full opening to either side'
            raise wrong("", "give a unit or a range, not both", rule=rule, remedy=remedy)
        if "positive" in said and self.channel not in ("force", "position", "velocity", "command"):
            rule = 'positive is "+x" or "-x", for force, position, velocity and command only'
            raise wrong("positive", f"positive = {self.positive!r}", rule=rule)
        if "format" in said and not self.is_date:
            rule = f'a format is a text, for a time with unit = "{date_times.UNIT}" only'
            raise wrong("format", f"format = {self.format!r}", rule=rule)
        if "clock" in said and self.channel == "time":
            raise wrong("clock", "the time cannot have a clock", rule="clock names the column of a channel's times")
        return self


class TimeTable(ColumnTable):
    """Keys of the time: a column, a date and a time of day in two columns, or the rate of the samples."""

    channel: ClassVar[str] = "time"
    column: Annotated[int | str | None, Reads(_place)] = None  # type: ignore[assignment]
    rate_hz: Annotated[float | None, Quantity("1/s", "Hz", Bounds(above=0.0))] = None
    date: Annotated[int | str | None, Reads(_place)] = None
    date_format: str = date_times.ISO

    @model_validator(mode="after")
    def _once(self) -> TimeTable:
        if (self.column is None) == (self.rate_hz is None):
            remedy = 'time = { column = 0, unit = "s" }, or time = { rate = "50 Hz" }'
            raise wrong("", "give the column of the time, or the rate of the samples", remedy=remedy)
        if self.column is not None and self.unit is None:
            raise wrong("unit", "unit is missing", remedy='time = { column = 0, unit = "s" }')
        if "date_format" in self.model_fields_set and self.date is None:
            raise wrong("date_format", f"date_format = {self.date_format!r}", rule="it belongs to a column: date = 0")
        return self


def _column_class(channel: str) -> type[ColumnTable]:
    """Return the class of the column of a channel."""
    si_unit = UNITS[channel]
    ends = PressureBetween() if si_unit == "Pa" else Reads(str) if channel == "command" else Between(si_unit)
    fields: dict[str, Any] = {
        "accuracy": (Annotated[Any, Reads(partial(uncertainty, si_unit=si_unit))], None),
        "range": (Annotated[Any, ends], None),
        "unit": (
            Annotated[Any, Reads(partial(_unit, channel))],
            Field(None if channel in ("command", "time") else ..., examples=[EXAMPLES.get(si_unit, "V")]),
        ),
    }
    base = TimeTable if channel == "time" else ColumnTable
    made = create_model(f"{channel.title()}Column", __base__=base, **fields)
    made.channel = channel
    return made


def _cycle(given: object) -> int | str:
    return _place(given.get("column") if isinstance(given, dict) else given)


def _labels(given: object) -> dict[str, str]:
    """Read labels, and the pattern of labels in file names: each is a column of the friction map."""
    if not isinstance(given, dict):
        raise WrongValueError(f"{given!r} is not a table")
    labels = {key: str(value) for key, value in given.items()}
    pattern = labels.get("pattern", "")
    names = re.findall(r"\{(\w+)\}", pattern)
    if pattern and (not names or len(set(names)) != len(names) or any(name.isdigit() for name in names)):
        rule = 'a text with each {name} once, as in "{seal}_{pressure}bar"; "" for none'
        raise WrongValueError(f"{pattern!r} is not a valid pattern", rule=rule, sub="pattern")
    for name in (*labels, *names):
        if name in COLUMNS:
            rule = "each label becomes a column of the friction map, which already has this column"
            raise WrongValueError(f"a label cannot be called '{name}'", rule=rule)
    return labels


_COLUMNS: dict[str, Any] = {name: (_column_class(name) | None, None) for name in UNITS}
ColumnsTable = create_model(
    "ColumnsTable", __base__=Described, cycle=(Annotated[int | str | None, Reads(_cycle)], None), **_COLUMNS
)
ColumnsTable.table_name = "columns"
_PRESSURE: Any = _column_class("pressure")
#: Relative standard uncertainty of the area of a parallel force that the layout does not state (assumed).
ASSUMED_PARALLEL_AREA = 0.05


class GeometryTable(PistonTable):
    """``[geometry]``: the areas of the piston and their standard uncertainty."""

    table_name: ClassVar[str] = "geometry"
    bore_accuracy: Annotated[float | None, Reads(partial(uncertainty, si_unit="m"))] = None
    area_accuracy: Annotated[float | None, Percent(bounds=Bounds(at_least=0.0, below=100.0))] = None


class ChamberTable(Described):
    """The pressure in a chamber if it is not measured."""

    open_to_ambient: StrictBool = False
    pressure: Annotated[units.Pressure | None, StatedPressure()] = None


class RigTable(Described):
    """``[rig]``: the rig of the drive."""

    table_name: ClassVar[str] = "rig"
    ambient_pressure: Annotated[units.Pressure, StatedPressure(gauge_allowed=False)] = units.Pressure(
        STANDARD_ATMOSPHERE_PA, gauge=False
    )
    incline_rad: Angle = 0.0
    mass_beyond_sensor_kg: Annotated[float, Quantity("kg", bounds=Bounds(at_least=0.0))] = 0.0
    stiffness_n_m: Annotated[float | None, Quantity("N/m", bounds=Bounds(above=0.0))] = None
    alignment_rad: Annotated[float | None, Reads(partial(uncertainty, si_unit="rad"))] = None


class WindowTable(Described):
    """``[window]``: the part of the stroke in which friction is averaged."""

    table_name: ClassVar[str] = "window"
    position: Annotated[tuple[float, float] | None, Between("m", "mm")] = None


class ParallelTable(Described):
    """``[[force]]``: a force in parallel with the rig's, such as that of a hydraulic ram, from measured pressures.

    The force is ``area (pressure - against)``; without `against` the ambient pressure acts on the other side.
    ``area_accuracy`` is a relative standard uncertainty, as all accuracies of a layout are.
    """

    table_name: ClassVar[str] = "force"
    name: Annotated[str, Reads(str)] = "parallel force"
    area_m2: Annotated[float, Quantity("m2", "cm2", Bounds(above=0.0))]
    area_accuracy: Annotated[float, Percent(bounds=Bounds(at_least=0.0, below=100.0))] = ASSUMED_PARALLEL_AREA
    positive: Literal["+x", "-x"] = "+x"
    pressure: _PRESSURE  # type: ignore[valid-type]
    against: _PRESSURE | None = None  # type: ignore[valid-type]


class LayoutTables(Described):
    """A layout, or the layout of one file with the overrides that match its name."""

    schema_version: Any = Field(default=1, alias="schema")
    kind: Literal["rig", "drive", "fixed-volume"] | None = None
    format: Annotated[str, Choice(("csv", *FORMATS))] = "csv"
    delimiter: Annotated[str | None, Reads(_delimiter)] = None
    header: StrictBool = False
    quoted: StrictBool = False
    decimal: Literal[".", ","] = "."
    thousands: Annotated[str | None, Reads(_one_character)] = None
    comment: str = "#"
    header_delimiter: Annotated[str | None, Reads(_delimiter)] = ""
    skip_lines: Annotated[int, Whole(at_least=0, bound=None)] = 0
    skip_samples: Annotated[int, Whole(at_least=0, bound=None)] = 0
    columns: ColumnsTable = ColumnsTable()  # type: ignore[valid-type]
    geometry: GeometryTable = GeometryTable()
    chamber_a: ChamberTable = ChamberTable()
    chamber_b: ChamberTable = ChamberTable()
    rig: RigTable = RigTable()
    force: tuple[ParallelTable, ...] = ()
    window: WindowTable = WindowTable()
    force_calibration: Annotated[ForceCalibration | None, Reads(of_quantities)] = None
    labels: Annotated[dict[str, str], Reads(_labels)] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _signs_differ(self) -> LayoutTables:
        if self.delimiter == self.decimal and not self.quoted:
            what = f"'{self.decimal}' cannot be both delimiter and decimal sign"
            raise wrong("delimiter", what, remedy="if the numbers are in quotation marks, write quoted = true")
        return self

    @property
    def ambient_pa(self) -> float:
        """Absolute pressure around the rig."""
        return self.rig.ambient_pressure.value_pa

    @property
    def text_form(self) -> TextForm:
        """Format of a text table. No comment sign: a character that no text contains."""
        form: dict[str, Any] = {name: getattr(self, name) for name in TextForm.__dataclass_fields__}
        form["comment"] = self.comment or "\0"
        return TextForm(**form)

    def missing(self, kind: str) -> Iterator[DescriptionError]:
        """Return keys that a file of this kind needs and the layout lacks."""
        units, needed = CHANNELS[kind]
        for channel in needed:
            if getattr(self.columns, channel) is None:
                unit = f', unit = "{EXAMPLES[units[channel]]}"' if units[channel] else ""
                remedy = f"{channel} = {{ column = 0{unit} }}"
                yield wrong("columns", f"[columns] does not say where the {channel} is", remedy=remedy)
        if kind == "rig":
            for side in "ab":
                if not self._ways(side):
                    yield self._not_once(side, "does not state")

    def contradictions(self, kind: str) -> Iterator[DescriptionError]:
        """Return values that the layout gives twice for a file of this kind."""
        read: dict[int | str, str] = {}
        units = CHANNELS[kind][0]
        for channel in units:
            column: ColumnTable | None = getattr(self.columns, channel)
            if column is None or column.column is None:
                continue
            other = read.setdefault(column.column, channel)
            if units[other] != units[channel]:  # both chambers may share a transducer
                what = f"columns.{other} and columns.{channel} read one column: {column.column!r}"
                yield wrong(f"columns.{channel}", what, rule="a column must be one quantity")
        for side in "ab" if kind == "rig" else "":
            if self._ways(side) > 1:
                yield self._not_once(side, "states more than once")

    def _ways(self, side: str) -> int:
        """Return the number of ways in which the pressure in a chamber is given."""
        chamber: ChamberTable = getattr(self, f"chamber_{side}")
        is_measured = getattr(self.columns, f"pressure_{side}") is not None
        return is_measured + chamber.open_to_ambient + (chamber.pressure is not None)

    def _not_once(self, side: str, says: str) -> DescriptionError:
        table, column = f"chamber_{side}", f"pressure_{side}"
        rule = f"exactly one of columns.{column}, {table}.open_to_ambient = true, {table}.pressure"
        key = table if table in self.model_fields_set else "columns"
        return wrong(key, f"the layout {says} the pressure in chamber {side}", rule=rule)

    def chamber_pressures(self) -> dict[str, float]:
        """Return the absolute pressures of chambers that are stated, not measured."""
        out = {}
        for side, chamber in (("a", self.chamber_a), ("b", self.chamber_b)):
            if chamber.open_to_ambient:
                out[f"pressure_{side}"] = self.ambient_pa
            elif chamber.pressure is not None:
                out[f"pressure_{side}"] = chamber.pressure.absolute_pa(self.ambient_pa)
        return out

    def channel(self, name: str, kind: str) -> ColumnTable | None:
        """Return the column of a channel with ``range`` in SI; scale and offset of a command follow from its range."""
        column: ColumnTable | None = getattr(self.columns, name)
        if column is None or column.range is None:
            return column
        if name == "command":  # the ends of the signal are -1 and 1, or 0 and 1 for the line of a volume
            low, high = units.parse_range(column.range, column.unit)
            lowest = 0.0 if kind == "fixed-volume" else -1.0
            scale = (1.0 - lowest) / (high - low)
            return column.model_copy(update={"range": (low, high), "scale": scale, "offset": lowest - low * scale})
        is_pressure = UNITS[name] == "Pa"
        return column.model_copy(update={"range": absolute(column.range, self.ambient_pa)}) if is_pressure else column

    def geometry_accuracy(self) -> dict[str, float]:
        """Return the standard uncertainties of the geometry that the layout gives."""
        g = self.geometry
        said = {"area": g.area_accuracy} if g.bore_m is None else {"bore_m": g.bore_accuracy}
        said["alignment_rad"] = self.rig.alignment_rad
        return {name: value for name, value in said.items() if value is not None}
