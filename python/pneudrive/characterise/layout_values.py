"""Values of a layout in SI, each error pointing at the line on which its key stands."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

from pneudrive.characterise import date_times
from pneudrive.characterise.column_units import ColumnUnit, column_unit, pressure_range, share, uncertainty
from pneudrive.characterise.force_calibration import ForceCalibration, of_quantities
from pneudrive.characterise.friction_map import COLUMNS
from pneudrive.characterise.layout import (
    CHANNEL_UNITS,
    DRIVE_UNITS,
    VOLUME_UNITS,
    Column,
    FileLayout,
    Layout,
    SampledLayout,
    labels_from_name,
    stem,
    where_pattern_ends,
)
from pneudrive.characterise.text_table import TextForm
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.describe.geometry import KINDS, piston_areas
from pneudrive.errors import DescriptionError, LayoutError, Problems, nearest
from pneudrive.files.tables import FORMATS
from pneudrive.units import parse, parse_pressure, parse_range

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

DELIMITERS = {"whitespace": None, "tab": "\t", "comma": ",", "semicolon": ";", "space": " "}
SIGNS = {"+x": 1, "-x": -1}
#: SI unit -> a unit that a column may have.
EXAMPLES = {"Pa": "bar gauge", "m": "mm", "s": "s", "N": "N", "m/s": "mm/s", "K": "degC"}


class LayoutValues:
    """Reads the merged tree of one file. ``sources`` says where an override's value was written.

    ``is_part``: not everything that a file needs has to be there. What is wrong is told together, once all was read.
    """

    def __init__(
        self,
        layout: Layout,
        tree: dict[str, Any],
        sources: dict[tuple[str, ...], tuple[str, ...]],
        *,
        is_part: bool = False,
    ) -> None:
        self.layout, self.tree, self.sources, self.is_part = layout, tree, sources, is_part
        self.problems = Problems()
        self.take = self.problems.take

    def fail(self, what: str, *path: str, rule: str | None = None, remedy: str | None = None) -> LayoutError:
        """Build an error at a key, wherever its value was written."""
        return self.layout.fail(what, *self.sources.get(path, path), rule=rule, remedy=remedy)

    def read(self, table: str, key: str, how: Callable[[Any], Any]) -> Any:  # noqa: ANN401 - whatever `how` gives
        """Read an optional key; None where it is absent."""
        value = self.tree.get(table, {}).get(key)
        return None if value is None else self.said(how, value, table, key)

    def said(self, how: Callable[[Any], Any], value: object, *path: str) -> Any:  # noqa: ANN401
        """Read a value, with the unit reader's complaint put at the key's line."""
        try:
            return how(value)
        except DescriptionError as error:
            raise self.fail(f"{'.'.join(path)}: {error.what}", *path, rule=error.rule, remedy=error.remedy) from None

    def positive(self, table: str, key: str, si_unit: str) -> float | None:
        """Read an optional quantity that must be above zero."""
        value = self.read(table, key, lambda text: parse(text, si_unit))
        if value is not None and value <= 0:
            raise self.fail(f"{table}.{key} must be greater than zero", table, key)
        return value

    def file_layout(self, path: Path | None) -> FileLayout:
        """Put everything together for one file; None stands for no file in particular."""
        ambient = self.take(self.ambient, otherwise=STANDARD_ATMOSPHERE_PA)
        columns = self.columns(CHANNEL_UNITS, ("time", "position", "force"), ambient)
        area_a, area_b, accuracy = self.take(self.areas, otherwise=(0.0, 0.0, {}))
        incline, mass = self.posture()
        alignment = self.take(self.read, "rig", "alignment", lambda text: uncertainty(text, "rad"))
        rest = {
            "cycle": self.take(self.cycle),
            "chamber_pressures": self.take(self.chambers, set(self.tree.get("columns", {})), ambient),
            "stiffness_n_m": self.take(self.positive, "rig", "stiffness", "N/m"),
            "window_m": self.take(self.read, "window", "position", lambda text: parse_range(text, "m")),
        }
        return FileLayout(
            **self.common(columns, ambient, path),
            **rest,
            area_a_m2=area_a,
            area_b_m2=area_b,
            incline_rad=incline,
            mass_beyond_sensor_kg=mass,
            geometry_accuracy=accuracy if alignment is None else {**accuracy, "alignment_rad": alignment},
        )

    def common(self, columns: dict[str, Column], ambient: float, path: Path | None) -> dict[str, Any]:
        """Read what every layout says of a file, and tell what is wrong with all that was read.

        Raises
        ------
        LayoutError
            With everything that is wrong.
        """
        found = {
            "format": self.take(self.form),
            "text": self.take(self.text_form),
            "skip_samples": self.tree.get("skip_samples", 0),
            "columns": columns,
            "ambient_pressure_pa": ambient,
            "labels": self.take(self.labels, path),
        }
        self.problems.tell()
        return found

    def drive_layout(self, path: Path | None) -> SampledLayout:
        """Put together what a recording of a drive needs."""
        needed = ("time", "command", "position", "pressure_a", "pressure_b")
        return self.sampled({**CHANNEL_UNITS, **DRIVE_UNITS}, needed, path)

    def volume_layout(self, path: Path | None) -> SampledLayout:
        """Put together what a recording of a fixed volume needs."""
        return self.sampled(VOLUME_UNITS, ("time", "pressure"), path)

    def sampled(self, units: dict[str, str], needed: tuple[str, ...], path: Path | None) -> SampledLayout:
        """Put together what is read of a file whose geometry is described elsewhere."""
        ambient = self.take(self.ambient, otherwise=STANDARD_ATMOSPHERE_PA)
        return SampledLayout(**self.common(self.columns(units, needed, ambient), ambient, path))

    def form(self) -> str:
        """Give the format of the file, with what goes before its samples checked."""
        form = self.tree.get("format", "csv")
        if form != "csv" and form not in FORMATS:
            raise self.fail(f"format = '{form}' is not known", "format", remedy=nearest(form, ["csv", *FORMATS]))
        for key in ("skip_samples", "skip_lines"):
            if self.tree.get(key, 0) < 0:
                raise self.fail(f"{key} must not be negative", key)
        return form

    def columns(self, units: dict[str, str], needed: tuple[str, ...], ambient: float) -> dict[str, Column]:
        """Give the channels that the layout names; those that are needed must be among them."""
        said = self.tree.get("columns", {})
        columns = {}
        for name in units:
            if name in said and self.is_whole(name):
                with self.problems.caught():
                    columns[name] = self.column(name, ambient)
        for channel in needed:
            if channel not in said and not self.is_part:
                unit = f', unit = "{EXAMPLES[units[channel]]}"' if units[channel] else ""
                example = f"{channel} = {{ column = 0{unit} }}"
                self.problems.add(
                    self.fail(f"[columns] does not say where the {channel} is", "columns", remedy=example)
                )
        read: dict[int | str, str] = {}
        for channel, column in columns.items():
            other = read.setdefault(column.column, channel)
            if other != channel and units[other] != units[channel]:  # both chambers may share a transducer
                what = f"columns.{other} and columns.{channel} read one column: {column.column!r}"
                self.problems.add(self.fail(what, "columns", channel, rule="a column is one quantity"))
        return columns

    def is_whole(self, name: str) -> bool:
        """Whether a column can be judged: in a part, what one [[for]] begins another may end."""
        return not self.is_part or ({"column", "unit"} - {"unit" if name == "command" else ""}) <= set(
            self.tree["columns"][name]
        )

    def posture(self) -> tuple[float, float]:
        """Incline in rad and mass beyond the sensor in kg."""
        incline = self.take(self.read, "rig", "incline", lambda text: parse(text, "rad")) or 0.0
        mass = self.take(self.read, "rig", "mass_beyond_sensor", lambda text: parse(text, "kg")) or 0.0
        if abs(incline) > math.pi / 2:
            self.problems.add(self.fail("rig.incline must lie between -90 deg and 90 deg", "rig", "incline"))
        if mass < 0:
            what = "rig.mass_beyond_sensor must not be negative"
            self.problems.add(self.fail(what, "rig", "mass_beyond_sensor"))
        return incline, mass

    def text_form(self) -> TextForm:
        """How a text table is written."""
        tree = self.tree
        delimiter, decimal = tree.get("delimiter", "whitespace"), tree.get("decimal", ".")
        thousands = tree.get("thousands")
        if decimal not in (".", ","):
            raise self.fail(f"decimal = '{decimal}' must be '.' or ','", "decimal")
        if thousands is not None and len(thousands) != 1:
            raise self.fail(f"thousands = '{thousands}' must be one character", "thousands")
        if delimiter not in DELIMITERS and len(delimiter) != 1:
            rule = f"one character, or one of {', '.join(DELIMITERS)}"
            raise self.fail(f"delimiter = '{delimiter}' is not known", "delimiter", rule=rule)
        delimiter = DELIMITERS.get(delimiter, delimiter)
        if delimiter == decimal:
            raise self.fail(f"'{decimal}' cannot be delimiter and decimal sign at once", "delimiter")
        return TextForm(
            delimiter=delimiter,
            header=tree.get("header", False),
            decimal=decimal,
            thousands=thousands,
            skip_lines=tree.get("skip_lines", 0),
            comment=tree.get("comment", "#") or "\0",  # none: what no text holds
        )

    def column(self, name: str, ambient: float) -> Column:
        """One channel."""
        table, path = self.tree["columns"][name], ("columns", name)
        si_unit = {**CHANNEL_UNITS, **DRIVE_UNITS, **VOLUME_UNITS}[name]
        place = table.get("column")
        if isinstance(place, bool) or not isinstance(place, int | str):
            remedy = 'column = 0, or a name of the header in quotes: column = "Force"'
            raise self.fail(f"columns.{name} does not say its column", *path, remedy=remedy)
        if name == "command" and ("unit" in table) != ("range" in table):
            rule = "a command is the share of full opening, -1 to 1: scale and offset bring it there, or unit and range"
            remedy = 'command = { column = 0, unit = "V", range = "0 V .. 10 V" }: full opening to either side'
            raise self.fail("columns.command has a unit or a range, not both", *path, rule=rule, remedy=remedy)
        if name != "command" and not isinstance(table.get("unit"), str):
            raise self.fail(f"columns.{name} has no unit", *path, remedy=f'unit = "{EXAMPLES[si_unit]}"')
        limits: Callable[[Any], Any] = lambda text: parse_range(text, si_unit or table["unit"])  # noqa: E731
        if si_unit == "Pa":
            limits = lambda text: pressure_range(text, ambient)  # noqa: E731
        direction = table.get("positive", "+x")
        if direction not in SIGNS or ("positive" in table and name not in ("force", "position", "velocity", "command")):
            rule = 'positive is "+x" or "-x", for force, position, velocity and command only'
            raise self.fail(f"columns.{name}.positive = {direction!r}", *path, rule=rule)

        def optional(key: str, how: Callable[[Any], Any]) -> Any:  # noqa: ANN401
            return self.said(how, table[key], *path, key) if key in table else None

        is_date = name == "time" and table["unit"] == date_times.UNIT
        is_plain = is_date or name == "command"
        form = table.get("format", date_times.ISO)
        if not isinstance(form, str) or ("format" in table and not is_date):
            rule = f'a format is a text, for a time with unit = "{date_times.UNIT}" only'
            raise self.fail(f"columns.{name}.format = {form!r}", *path, "format", rule=rule)
        scale, offset, ends = (
            self.number(name, "scale", 1.0),
            self.number(name, "offset", 0.0),
            optional("range", limits),
        )
        if (
            name == "command" and ends is not None
        ):  # the ends of the signal are -1 and 1, of the line of a volume 0 and 1
            lowest = 0.0 if self.layout.kind == "fixed-volume" else -1.0
            scale = (1.0 - lowest) / (ends[1] - ends[0])
            offset = lowest - ends[0] * scale
        return Column(
            column=place,
            unit=ColumnUnit(1.0)
            if is_plain
            else self.said(lambda text: column_unit(text, si_unit), table["unit"], *path, "unit"),
            sign=SIGNS[direction],
            scale=scale,
            offset=offset,
            delay_s=optional("delay", lambda text: parse(text, "s")) or 0.0,
            accuracy_si=optional("accuracy", lambda text: uncertainty(text, si_unit)),
            range_si=ends,
            calibration=str(table.get("calibration", "")),
            curve=self.force_curve() if name == "force" else None,
            date_form=form if is_date else None,
        )

    def force_curve(self) -> ForceCalibration | None:
        """Give the calibration of the force sensor, where there is one."""
        table = self.tree.get("force_calibration")
        return None if table is None else self.said(of_quantities, table, "force_calibration")

    def number(self, name: str, key: str, default: float) -> float:
        """Read a pure number of a column."""
        value = self.tree["columns"][name].get(key, default)
        usable = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not usable or (key == "scale" and value == 0):
            what = f"columns.{name}.{key} = {value!r} must be a finite number"
            raise self.fail(what, "columns", name, key, rule="SI value = (raw * scale + offset) in the column's unit")
        return float(value)

    def cycle(self) -> int | str | None:
        """Give the column that numbers the cycles of a campaign."""
        value = self.tree.get("columns", {}).get("cycle")
        place = value.get("column") if isinstance(value, dict) else value
        if value is not None and (isinstance(place, bool) or not isinstance(place, int | str)):
            raise self.fail("columns.cycle must be a column's name or number", "columns", "cycle")
        return place

    def ambient(self) -> float:
        """Absolute pressure around the rig."""
        said = self.read("rig", "ambient_pressure", parse_pressure)
        if said is None:
            return STANDARD_ATMOSPHERE_PA
        if said.gauge or said.value_pa <= 0:
            what = "rig.ambient_pressure must be an absolute pressure above zero"
            raise self.fail(what, "rig", "ambient_pressure", remedy='"1.013 bar abs"')
        return said.value_pa

    def areas(self) -> tuple[float, float, dict[str, float]]:
        """Areas a and b, and the standard uncertainty that the layout gives for them."""
        geometry = self.tree.get("geometry", {})
        if "area_a" in geometry or "area_b" in geometry:
            return self.given_areas(geometry)
        bore = self.positive("geometry", "bore", "m")
        if bore is None and self.is_part:
            return 0.0, 0.0, {}
        if bore is None:
            raise self.fail("[geometry] gives no area", "geometry", remedy='bore = "25 mm", or area_a and area_b')
        kind = geometry.get("kind", "rodless")
        if kind not in KINDS:
            raise self.fail(
                f"geometry.kind = {kind!r} is not known", "geometry", "kind", remedy=nearest(str(kind), KINDS)
            )
        rod = self.positive("geometry", "rod_diameter", "m")
        if (rod is None) != (kind == "rodless"):
            rule = "a rodless cylinder has no rod_diameter" if rod else f"a {kind} cylinder needs rod_diameter"
            raise self.fail(f"geometry.kind = '{kind}' and rod_diameter do not fit", "geometry", rule=rule)
        if rod is not None and rod >= bore:
            what = f"geometry.rod_diameter = {geometry['rod_diameter']} must be smaller than bore = {geometry['bore']}"
            raise self.fail(what, "geometry", "rod_diameter", remedy="were bore and rod swapped?")
        said = self.read("geometry", "bore_accuracy", lambda text: uncertainty(text, "m"))
        return *piston_areas(kind, bore, rod or 0.0), ({} if said is None else {"bore_m": said})

    def given_areas(self, geometry: dict[str, Any]) -> tuple[float, float, dict[str, float]]:
        """Areas of a piston that is not round."""
        if {"bore", "rod_diameter"} & set(geometry):
            raise self.fail("[geometry] gives the area twice", "geometry", rule="either bore, or area_a and area_b")
        area_a, area_b = (self.positive("geometry", key, "m^2") for key in ("area_a", "area_b"))
        if area_a is None or area_b is None:
            raise self.fail("[geometry] gives only one of area_a and area_b", "geometry")
        said = self.read("geometry", "area_accuracy", share)
        return area_a, area_b, ({} if said is None else {"area": said})

    def chambers(self, measured: set[str], ambient: float) -> dict[str, float]:
        """Absolute pressures of chambers that are said rather than measured."""
        pressures: dict[str, float] = {}
        for side in ("a", "b"):
            table, column = f"chamber_{side}", f"pressure_{side}"
            opened = self.tree.get(table, {}).get("open_to_ambient", False)
            held = self.read(table, "pressure", parse_pressure)
            if not isinstance(opened, bool):
                raise self.fail(f"{table}.open_to_ambient must be true or false", table, "open_to_ambient")
            ways = (column in measured) + opened + (held is not None)
            if ways > 1 or (ways == 0 and not self.is_part):
                says = "says nothing of" if ways == 0 else "says more than once what is"
                rule = f"exactly one of columns.{column}, {table}.open_to_ambient = true, {table}.pressure"
                place = table if table in self.tree else "columns"
                raise self.fail(f"the layout {says} the pressure in chamber {side}", place, rule=rule)
            if opened:
                pressures[column] = ambient
            elif held is not None:
                pressures[column] = held.absolute_pa(ambient)
        return pressures

    def labels(self, path: Path | None) -> dict[str, str]:
        """Give the fixed labels and those of the file's name; None stands for no file in particular.

        Raises
        ------
        LayoutError
            The pattern is none, does not fit the file's name, or a label has the name of a column of the map.
        """
        said = self.tree.get("labels", {})
        labels = {key: str(value) for key, value in said.items() if key != "pattern"}
        pattern = said.get("pattern", "")
        names = re.findall(r"\{(\w+)\}", pattern) if isinstance(pattern, str) else []
        if pattern != "" and (not names or len(set(names)) != len(names) or any(name.isdigit() for name in names)):
            rule = 'a text with each {name} once, as in "{seal}_{pressure}bar"; "" for none'
            raise self.fail(f"labels.pattern = {pattern!r} is no pattern", "labels", "pattern", rule=rule)
        for name in (*labels, *names):
            if name in COLUMNS:
                what = f"a label cannot be called '{name}'"
                raise self.fail(what, "labels", rule="each label is a column of the friction map, which has that one")
        if pattern == "" or path is None:
            return labels
        found = labels_from_name(pattern, stem(path))
        if found is None:
            part, left = where_pattern_ends(pattern, stem(path))
            rest = f"'{left}' is left of the name" if left else "nothing is left of the name"
            example = f'[[for]] match = "{path.name}", labels.pattern = "..." (or "" for none)'
            raise self.fail(
                f"labels.pattern = {pattern!r} does not fit the file {path.name}",
                "labels",
                "pattern",
                rule=f"where {part} should stand, {rest}",
                remedy=f"mend the pattern, or give files of other names their own: {example}",
            )
        return {**labels, **found}
