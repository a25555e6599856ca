"""Layout file, which describes a foreign recording. Each table is a class; `Layout` applies the overrides of a file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import Field, StrictBool, create_model, model_validator

from pneudrive import units
from pneudrive.arrays import Array, NamedNumbers, Plain
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.describe import marks
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.marks import POSITIVE, Between, Bounds, Percent, Quantity, Reads, Text, Whole, absolute
from pneudrive.describe.tables.parts import PistonTable
from pneudrive.errors import DescriptionError, LayoutError, Problems, invalid, package_table, wrong
from pneudrive.files.content import COMPRESSIONS
from pneudrive.files.tables import FORMATS
from pneudrive.friction.friction_map import COLUMNS
from pneudrive.repr_tables import Shown
from pneudrive.signals.columns import ColumnUnit, column_unit, uncertainty
from pneudrive.signals.force_calibration import ForceCalibration, of_quantities
from pneudrive.signals.text_table import TextForm
from pneudrive.signals.times import COUNTERS, DATE_TIME, ISO

#: Kind of recording -> SI units of its channels, required channels, and requirements in words.
KINDS: dict[str, Plain] = package_table(__file__, "columns.toml")["kinds"]
#: Channel -> SI unit.
UNITS: dict[str, str] = KINDS["drive"]["units"] | KINDS["fixed-volume"]["units"]
RIG_TABLES = ("geometry", "chamber_a", "chamber_b", "force", "window")  # not used by other kinds of recordings
DELIMITERS = {"whitespace": None, "tab": "\t", "comma": ",", "semicolon": ";", "space": " "}
#: SI unit -> example of a unit as written in a layout.
EXAMPLES = {"Pa": "bar gauge", "m": "mm", "s": "s", "N": "N", "m/s": "mm/s", "K": "degC"}


def _place(given: object) -> int | str:
    """Return the number or name of a column. Reject values that are neither."""
    if isinstance(given, bool) or not isinstance(given, int | str):
        raise DescriptionError.of("signals.not-a-column", given=given)
    return given


_Place = Annotated[int | str | None, Reads(_place)]


def _scale(given: object) -> float:
    if Quantity("").read(given) == 0.0:
        raise DescriptionError("scale = 0 makes all values equal", rule="value in its unit = raw * scale + offset")
    return Quantity("").read(given)


def _unit(channel: str, given: object) -> ColumnUnit | str:
    """Read the unit of a channel; for a command or a date, the unit is a text."""
    is_text = channel == "command" or (channel == "time" and given == DATE_TIME)
    return str(given) if is_text else column_unit(given, UNITS[channel])  # type: ignore[arg-type]


def _one_character(given: object) -> str:
    if not isinstance(given, str) or len(given) != 1:
        raise DescriptionError(f"{given!r} must be one character")
    return given


def _delimiter(given: object) -> str | None:
    if not isinstance(given, str) or (given not in DELIMITERS and len(given) != 1):
        raise DescriptionError(f"{given!r} is not known", rule=f"one character, or one of {', '.join(DELIMITERS)}")
    return DELIMITERS.get(given, given)


class Column(Described):
    """Keys common to the columns of all channels."""

    channel: ClassVar[str] = ""
    column: Annotated[int | str, Reads(_place)]
    clock: _Place = None
    wraps: Annotated[float | None, Quantity("", bounds=POSITIVE)] = None
    guessed: StrictBool = False
    scale: Annotated[float, Reads(_scale)] = 1.0
    offset: Annotated[float, Quantity("")] = 0.0
    delay_s: Annotated[float, Quantity("s", "s")] = 0.0
    accuracy: Any = None
    range: Any = None
    positive: Literal["+x", "-x"] = "+x"
    unit: Any = None
    calibration: Text = ""
    format: str = ISO

    @property
    def is_date(self) -> bool:
        """Whether the column contains dates and times."""
        return self.unit == DATE_TIME

    @property
    def conversion(self) -> ColumnUnit:
        """Linear conversion of the unit to SI. A command and a date have the factor 1."""
        return self.unit if isinstance(self.unit, ColumnUnit) else ColumnUnit(1.0)

    @property
    def moduli(self) -> tuple[float, ...]:
        """If this column is a counter: possible numbers of counts after which it restarts."""
        return COUNTERS if self.wraps is None else (self.wraps,)

    def in_unit(self, raw: Array) -> Array:
        """Return raw numbers in the column's unit, positive in +x."""
        return (raw * self.scale + self.offset) * (1 if self.positive == "+x" else -1)

    def corrected(self, force_n: Array, curve: ForceCalibration) -> Array:
        """Return forces (positive in +x) corrected by a calibration curve, which has the sign of the sensor."""
        sign = 1 if self.positive == "+x" else -1
        return sign * curve.force_n(sign * force_n)

    @model_validator(mode="after")
    def _fits_the_channel(self) -> Column:
        said = self.model_fields_set
        if self.channel == "command" and ("unit" in said) != ("range" in said):
            raise invalid("", "signals.unit-and-range")
        if "positive" in said and self.channel not in ("force", "position", "velocity", "command"):
            raise invalid("positive", "signals.not-a-direction", positive=self.positive)
        if "format" in said and not self.is_date:
            raise invalid("format", "signals.not-a-format", format=self.format, date_time=DATE_TIME)
        if "clock" in said and self.channel == "time":
            raise wrong("clock", "channel time has no key clock", rule="clock names the column of a channel's times")
        return self


class TimeColumn(Column):
    """Keys of the time: a time column, date and time of day in two columns, or the sampling rate."""

    channel: ClassVar[str] = "time"
    column: _Place = None  # type: ignore[assignment]
    rate_hz: Annotated[float | None, Quantity("1/s", "Hz", POSITIVE)] = None
    date: _Place = None
    date_format: str = ISO

    @model_validator(mode="after")
    def _once(self) -> TimeColumn:
        if (self.column is None) == (self.rate_hz is None):
            raise invalid("", "signals.no-time-or-rate")
        if self.column is not None and self.unit is None:
            raise wrong("unit", "unit is missing", remedy='time = { column = 0, unit = "s" }')
        if "date_format" in self.model_fields_set and self.date is None:
            raise wrong("date_format", f"date_format = {self.date_format!r}", rule="a date column is needed: date = 0")
        return self


def _column_class(channel: str) -> type[Column]:
    """Return the class of the column of a channel."""
    si_unit = UNITS[channel]
    ends = marks.PressureBetween() if si_unit == "Pa" else Reads(str) if channel == "command" else Between(si_unit)
    fields: Plain = {
        "accuracy": (Annotated[Any, Reads(partial(uncertainty, si_unit=si_unit))], None),
        "range": (Annotated[Any, ends], None),
        "unit": (
            Annotated[Any, Reads(partial(_unit, channel))],
            Field(None if channel in ("command", "time") else ..., examples=[EXAMPLES.get(si_unit, "V")]),
        ),
    }
    base = TimeColumn if channel == "time" else Column
    made = create_model(f"{channel.title()}Column", __base__=base, **fields)
    made.channel = channel
    return made


def _cycle(given: object) -> int | str:
    return _place(given.get("column") if isinstance(given, dict) else given)


def _labels(given: object) -> dict[str, str]:
    """Read labels, and the pattern of labels in file names. Each label becomes a column of the friction map."""
    if not isinstance(given, dict):
        raise DescriptionError(f"{given!r} is not a table")
    labels = {key: str(value) for key, value in given.items()}
    pattern = labels.get("pattern", "")
    names = re.findall(r"\{(\w+)\}", pattern)
    if pattern and (not names or len(set(names)) != len(names) or any(name.isdigit() for name in names)):
        rule = 'a text with each {name} once, as in "{seal}_{pressure}bar"; "" for none'
        raise wrong("pattern", f"{pattern!r} is not a valid pattern", rule=rule)
    for name in (*labels, *names):
        if name in COLUMNS:
            raise DescriptionError.of("signals.label-taken", name=name)
    return labels


_COLUMNS: Plain = {"cycle": (Annotated[int | str | None, Reads(_cycle)], None)}
_COLUMNS |= {name: (_column_class(name) | None, None) for name in UNITS}
Columns = create_model("Columns", __base__=Described, **_COLUMNS)
Columns.table_name = "columns"
_PRESSURE: Any = _column_class("pressure")
#: Default relative standard uncertainty of the area of a parallel force (assumed).
ASSUMED_PARALLEL_AREA = 0.05


class GeometryTable(PistonTable):
    """``[geometry]``: the areas of the piston and their standard uncertainty."""

    table_name = "geometry"
    bore_accuracy: Annotated[float | None, Reads(partial(uncertainty, si_unit="m"))] = None
    area_accuracy: Annotated[float | None, Percent(bounds=Bounds(at_least=0.0, below=100.0))] = None


class ChamberTable(Described):
    """``[chamber_a]``, ``[chamber_b]``: the pressure in a chamber that is not measured."""

    open_to_ambient: StrictBool = False
    pressure: marks.MaybePressure = None


class RigTable(Described):
    """``[rig]``: ambient pressure, incline, moved mass, stiffness and alignment of the rig."""

    table_name = "rig"
    ambient_pressure: Annotated[units.Pressure, marks.StatedPressure(gauge_allowed=False)] = units.Pressure(
        STANDARD_ATMOSPHERE_PA, gauge=False
    )
    incline_rad: marks.Angle = 0.0
    mass_beyond_sensor_kg: Annotated[float, Quantity("kg", bounds=marks.NOT_NEGATIVE)] = 0.0
    stiffness_n_m: Annotated[float | None, Quantity("N/m", bounds=POSITIVE)] = None
    alignment_rad: Annotated[float | None, Reads(partial(uncertainty, si_unit="rad"))] = None


class WindowTable(Described):
    """``[window]``: the part of the stroke in which friction is averaged."""

    table_name = "window"
    position: Annotated[tuple[float, float] | None, Between("m", "mm")] = None


class ParallelTable(Described):
    """``[[force]]``: a force in parallel with that of the rig, such as from a hydraulic ram, computed from pressures.

    The force is ``area (pressure - against)``. If `against` is absent, it is the ambient pressure.
    ``area_accuracy`` is a relative standard uncertainty. All accuracies of a layout are standard uncertainties.
    """

    table_name = "force"
    name: Text = "parallel force"
    area_m2: Annotated[float, Quantity("m2", "cm2", POSITIVE)]
    area_accuracy: marks.Accuracy = ASSUMED_PARALLEL_AREA
    positive: Literal["+x", "-x"] = "+x"
    pressure: _PRESSURE  # type: ignore[valid-type]
    against: _PRESSURE | None = None  # type: ignore[valid-type]


class FileLayout(Described):
    """A layout with the overrides that match the name of one file. Values are in SI."""

    schema_version: Any = Field(default=1, alias="schema")
    kind: Literal["rig", "drive", "fixed-volume"] | None = None
    format: Annotated[str, marks.Choice(("csv", *FORMATS))] = "csv"
    delimiter: Annotated[str | None, Reads(_delimiter)] = None
    header: StrictBool = False
    quoted: StrictBool = False
    decimal: Literal[".", ","] = "."
    thousands: Annotated[str | None, Reads(_one_character)] = None
    comment: str = "#"
    header_delimiter: Annotated[str | None, Reads(_delimiter)] = ""
    skip_lines: Annotated[int, Whole(at_least=0, bound=None)] = 0
    skip_samples: Annotated[int, Whole(at_least=0, bound=None)] = 0
    columns: Columns = Columns()  # type: ignore[valid-type]
    geometry: GeometryTable = GeometryTable()
    chamber_a: ChamberTable = ChamberTable()
    chamber_b: ChamberTable = ChamberTable()
    rig: RigTable = RigTable()
    force: tuple[ParallelTable, ...] = ()
    window: WindowTable = WindowTable()
    force_calibration: Annotated[ForceCalibration | None, Reads(of_quantities)] = None
    labels: Annotated[dict[str, str], Reads(_labels)] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _signs_differ(self) -> FileLayout:
        if self.delimiter == self.decimal and not self.quoted:
            raise invalid("delimiter", "signals.comma-twice", decimal=self.decimal)
        return self

    @cached_property
    def channels(self) -> dict[str, Column]:
        """Columns by channel; those of parallel forces are ``force 1: pressure`` and ``force 1: against``."""
        found: dict[str, Column] = {}
        for name in KINDS[self.kind or "rig"]["units"]:
            column: Column | None = getattr(self.columns, name)
            if column is None:
                continue
            if column.range is not None and name == "command":
                # The ends of the signal are -1 and 1, or 0 and 1 for the line of a volume.
                low, high = units.parse_range(column.range, column.unit)
                lowest = 0.0 if self.kind == "fixed-volume" else -1.0
                scale = (1.0 - lowest) / (high - low)
                offset = lowest - low * scale
                column = column.model_copy(update={"range": (low, high), "scale": scale, "offset": offset})
            elif column.range is not None and UNITS[name] == "Pa":
                column = column.model_copy(update={"range": absolute(column.range, self.ambient_pa)})
            found[name] = column
        for number, force in enumerate(self.force, 1):
            found[f"force {number}: pressure"] = force.pressure
            if force.against is not None:
                found[f"force {number}: against"] = force.against
        return found

    @property
    def time(self) -> TimeColumn:
        """Time column, or sampling rate."""
        return self.channels["time"]  # type: ignore[return-value]

    @property
    def dates(self) -> dict[int | str, str]:
        """Columns of dates and times, with their format."""
        time = self.time
        clocks = [time.column, *(column.clock for column in self.channels.values())] if time.is_date else []
        found = {place: time.format for place in clocks if place is not None}
        return found if time.date is None else found | {time.date: time.date_format}

    @property
    def places(self) -> list[int | str]:
        """Columns to read from the file: values of the channels, dates, and clocks."""
        columns = self.channels.values()
        places = [*(c.column for c in columns), self.time.date, *(c.clock for c in columns)]
        return list(dict.fromkeys(place for place in places if place is not None))

    @property
    def is_plain(self) -> bool:
        """Whether every channel is a column whose rows can be read independently."""
        columns = self.channels.values()
        special = (self.time.rate_hz, self.time.date, *(c.clock for c in columns), *(c.wraps for c in columns))
        return all(value is None for value in special)

    @property
    def ambient_pa(self) -> float:
        """Absolute pressure around the rig."""
        return self.rig.ambient_pressure.value_pa

    @property
    def text_form(self) -> TextForm:
        """Format of a text table. If no comment sign is stated, a character that no text contains is used."""
        form: Plain = {name: getattr(self, name) for name in TextForm.__dataclass_fields__}
        form["comment"] = self.comment or "\0"
        return TextForm(**form)

    def problems(self, kind: str, *, is_part: bool) -> Iterator[DescriptionError]:
        """Yield errors for values given twice, and for missing keys unless the layout may be incomplete."""
        read = dict[int | str, str]()
        for channel in KINDS[kind]["units"]:
            column: Column | None = getattr(self.columns, channel)
            if column is None and channel in KINDS[kind]["needed"] and not is_part:
                unit = f', unit = "{EXAMPLES[UNITS[channel]]}"' if UNITS[channel] else ""
                remedy = f"{channel} = {{ column = 0{unit} }}"
                yield wrong("columns", f"[columns] does not name the column of the {channel}", remedy=remedy)
            if column is None or column.column is None:
                continue
            other = read.setdefault(column.column, channel)
            if UNITS[other] != UNITS[channel]:  # both chambers may share a transducer
                what = f"columns.{other} and columns.{channel} read the same column: {column.column!r}"
                yield wrong(f"columns.{channel}", what, rule="a column has only one quantity")
        for side in "ab" if kind == "rig" else "":
            table, column_name = f"chamber_{side}", f"pressure_{side}"
            chamber: ChamberTable = getattr(self, table)
            is_measured = getattr(self.columns, column_name) is not None
            ways = is_measured + chamber.open_to_ambient + (chamber.pressure is not None)
            if ways > 1 or (ways == 0 and not is_part):
                says = "defines more than once" if ways else "does not state"
                rule = f"exactly one of columns.{column_name}, {table}.open_to_ambient = true, {table}.pressure"
                key = table if table in self.model_fields_set else "columns"
                yield wrong(key, f"the layout {says} the pressure in chamber {side}", rule=rule)

    def chamber_pressures(self) -> NamedNumbers:
        """Return the absolute pressures of chambers that are stated, not measured."""
        out = {}
        for side, chamber in (("a", self.chamber_a), ("b", self.chamber_b)):
            if chamber.open_to_ambient:
                out[f"pressure_{side}"] = self.ambient_pa
            elif chamber.pressure is not None:
                out[f"pressure_{side}"] = chamber.pressure.absolute_pa(self.ambient_pa)
        return out


def layout_schema() -> Plain:
    """Return the JSON schema of a layout file. Each ``[[for]]`` has the same keys, plain or dotted."""
    schema = FileLayout.model_json_schema(by_alias=True)
    group = {"type": "object", "properties": {"match": {"type": "string"}}, "required": ["match"]}
    schema["properties"]["for"] = {"type": "array", "items": group}
    return schema


#: Layout, or its file; None: the file beside the recordings.
AnyLayout: TypeAlias = "Layout | str | Path | None"


@dataclass(frozen=True, repr=False, eq=False)
class Layout(Shown):
    """A layout file before the overrides for a recording are applied.

    Examples
    --------
    >>> layout = Layout.loads('''
    ... [columns]
    ... time = { column = 0, unit = "ms" }
    ... position = { column = 1, unit = "mm" }
    ... force = { column = 2, unit = "N" }
    ... [geometry]
    ... bore = "25 mm"
    ... [chamber_a]
    ... open_to_ambient = true
    ... [chamber_b]
    ... pressure = "3 bar gauge"
    ... ''')
    >>> layout.for_file(Path("run.csv")).chamber_pressures()["pressure_b"]
    401325.0
    """

    tree: dict[str, Any]
    origin: str = "layout"
    text: str = ""

    @classmethod
    def load(cls, path: str | Path) -> Layout:
        """Read and check a layout file.

        Raises
        ------
        LayoutError
            The message gives file, line, value, rule and remedy.
        """
        tree, text = toml.read(path, LayoutError, "`pneudrive layout FILE` proposes one.")
        return cls(tree, str(path), text)._checked()

    @classmethod
    def loads(cls, text: str, origin: str = "layout") -> Layout:
        """Read and check a layout from TOML text."""
        return cls(toml.parse(text, origin, LayoutError), origin, text)._checked()

    def for_file(self, path: Path, kind: str = "rig") -> FileLayout:
        """Apply the overrides that match the file's name, for a recording of a kind.

        Raises
        ------
        LayoutError
            A value is wrong for this file, or the layout has another kind.
        """
        if self.kind != kind and "fixed-volume" in (self.kind, kind):
            stated, other = (name.replace("-", " ") for name in (self.kind, kind))
            key, needs = "kind" if "kind" in self.tree else "", KINDS[kind]["needs"]
            raise self.fail(invalid(key, "signals.layout-of-other-kind", kind=stated, other=other, rule=needs))
        names = (path.name, stem(path))
        chosen = tuple(
            number
            for number, override in enumerate(self.tree.get("for", []))
            if any(fnmatchcase(name, override["match"]) for name in names)
        )
        layout = _read(self, chosen)
        labels = {key: text for key, text in layout.labels.items() if key != "pattern"}
        pattern = layout.labels.get("pattern", "")
        found = labels_from_name(pattern, stem(path)) if pattern else {}
        if isinstance(found, str):
            names = {"pattern": pattern, "file": path.name, "rule": found}
            raise self.fail(invalid(self._place("labels.pattern", chosen), "signals.pattern-differs", **names))
        update: Plain = {"kind": kind, "labels": labels | found}
        if kind != "rig":  # a drive and a fixed volume have no tables of a rig
            update |= {name: FileLayout.model_fields[name].default for name in RIG_TABLES}
            update["rig"] = RigTable().model_copy(update={"ambient_pressure": layout.rig.ambient_pressure})
        return layout.model_copy(update=update)

    @property
    def kind(self) -> str:
        """Kind of recording: a ``rig``, a ``drive`` (a layout with a command), or a ``fixed-volume``."""
        trees = [self.tree, *self.tree.get("for", [])]
        names_command = any(isinstance(tree.get("columns"), dict) and "command" in tree["columns"] for tree in trees)
        return self.tree.get("kind", "drive" if names_command else "rig")

    def fail(self, error: DescriptionError) -> LayoutError:
        """Return an error of the layout that names the line of the key."""
        return toml.located(error, self.origin, self.text).turned(LayoutError)

    def _place(self, key: str, chosen: Sequence[int]) -> str:
        """Return the location of a key in the file or in an override. A missing key has the location of its table."""
        trees = [*((f"for.{index}.", self.tree["for"][index]) for index in reversed(chosen)), ("", self.tree)]
        while key:
            for at, tree in trees:
                found: Any = tree
                for part in key.split("."):
                    found = found.get(part) if isinstance(found, dict) else None
                if found is not None:
                    return f"{at}{key}"
            key = key.rpartition(".")[0]
        return key

    def read(self, chosen: Sequence[int], *, is_part: bool = False) -> FileLayout:
        """Read the layout with some of its overrides.

        Parameters
        ----------
        chosen : sequence of int
            Numbers of the overrides, in ascending order.
        is_part : bool
            Whether the layout may be incomplete.

        Raises
        ------
        LayoutError
            The layout is not valid; the message lists all errors.
        """
        tree = {key: value for key, value in self.tree.items() if key != "for"}
        for index in chosen:
            rest = {key: value for key, value in self.tree["for"][index].items() if key != "match"}
            columns, said = tree.get("columns", {}), rest.get("columns", {})
            if isinstance(columns, dict) and isinstance(said, dict):
                # An override replaces some tables as a whole: columns with place and unit, and chamber pressures
                # given in another way.
                whole = [name for name, one in said.items() if isinstance(one, dict) and {"column", "unit"} <= {*one}]
                tree["columns"] = {name: one for name, one in columns.items() if name not in whole}
                for side in "ab":
                    if f"chamber_{side}" in rest:
                        tree["columns"].pop(f"pressure_{side}", None)
                    if {f"chamber_{side}", f"pressure_{side}"} & {*rest, *said}:
                        tree.pop(f"chamber_{side}", None)
            tree = toml.merge(tree, rest)
        problems, kind = Problems(), self.kind
        layout: FileLayout | None = problems.take(FileLayout.model_validate, tree)
        if layout is not None and kind in list(KINDS):  # a [[for]] may replace an unknown kind
            for error in layout.problems(kind, is_part=is_part):
                problems.add(error)
            if kind == "rig" and not (is_part and layout.geometry == GeometryTable()):
                problems.take(layout.geometry.areas)
        if is_part:  # another [[for]] may supply missing keys: only the layout of a file must be complete
            problems.found = {at: one for at, one in problems.found.items() if " is missing" not in one.what}
        for error in problems.found.values():
            error.key = self._place(getattr(error, "key", None) or "", chosen)  # type: ignore[attr-defined]
        with toml.locating(self.origin, self.text, LayoutError):
            problems.tell()
        return FileLayout() if layout is None else layout

    def _checked(self) -> Layout:
        """Report all unknown keys and wrong values together, before the first recording is opened."""
        overrides, problems = self.tree.get("for", []), Problems()
        if not isinstance(overrides, list) or not all(isinstance(one, dict) for one in overrides):
            raise self.fail(wrong("for", "[for] must be written [[for]], one for each group of files"))
        for index, override in enumerate(overrides):
            if not isinstance(override.get("match"), str):
                what = "[[for]] does not say which files it is for"
                problems.add(self.fail(wrong(f"for.{index}", what, remedy='match = "*257*"')))
        for chosen in ([], *([index] for index in range(len(overrides)))):
            with problems.caught():
                self.read(chosen, is_part=bool(overrides))
        problems.tell()
        return self


_read = lru_cache(maxsize=256)(Layout.read)


def stem(path: Path) -> str:
    """Return the file name without its suffix and without the suffix of its compression.

    Examples
    --------
    >>> stem(Path("NAPN_1bar.csv.xz"))
    'NAPN_1bar'
    """
    name = path.name
    for suffix in COMPRESSIONS:
        name = name.removesuffix(suffix)
    return Path(name).stem


_FIELD = re.compile(r"(\{\w+\})")  # in a pattern of labels
# Field of a pattern of labels -> its expression, and its name in messages. Other fields take any text.
FIELDS = {"pressure": (r"[-+]?\d+(?:[.,]\d+)?(?: ?(?:mbar|bar|kPa|MPa|Pa|psi))?", "a number, with or without a unit")}


def labels_from_name(pattern: str, name: str) -> dict[str, str] | str:
    """Return the labels in a file name, or a text on the first difference if the name does not match the pattern.

    ``{pressure}`` matches a number, with or without a unit: ``5``, ``0,5``, ``1bar``. Every other field matches any
    text of at least one character. Each field, from left to right, matches the shortest possible text.

    Examples
    --------
    >>> labels_from_name("{seal}_{pressure}bar", "O-ring_5bar")
    {'seal': 'O-ring', 'pressure': '5'}
    >>> labels_from_name("{seal}_{pressure}", "O-ring_5bar")
    {'seal': 'O-ring', 'pressure': '5bar'}
    """
    parts = _FIELD.split(pattern)
    found = _matched(parts, name, "$")
    if found is not None:
        return dict(zip((part[1:-1] for part in parts[1::2]), found[1::2], strict=False))
    begins = ((part, _matched(parts[:count], name, "")) for count, part in enumerate(parts) if part)
    part, begin = [(part, begin) for part, begin in begins if begin is not None][-1]
    about = f"{part} ({FIELDS.get(part[1:-1], ('', 'any text'))[1]})" if part.startswith("{") else f"'{part}'"
    left = name[len("".join(begin)) :]
    return f"at {about}, " + (f"'{left}' of the name is not matched" if left else "the name is too short")


def _matched(parts: list[str], name: str, end: str) -> tuple[str, ...] | None:
    """Match a name with the parts of a pattern, then with the expression `end`. Return the matched texts, or None.

    Polars matches in linear time. `re` would try every division of the name, and the number of divisions grows
    exponentially with the number of fields.
    """
    import polars as pl

    groups = list(map(re.escape, parts))
    groups[1::2] = (FIELDS.get(part[1:-1], (".+?",))[0] for part in parts[1::2])
    expression = "(?s)^" + "".join(f"({group})" for group in (*groups, end))
    found = pl.Series([name]).str.extract_groups(expression).struct.unnest().row(0)
    return None if None in found else found
