"""The layout file: how a foreign recording is read."""

from __future__ import annotations

import copy
import math
import re
import sys
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from pneudrive.characterise.column_units import ColumnUnit, UnitProblem, parse_quantity, parse_range, parse_unit
from pneudrive.characterise.readers import COMPRESSIONS, READERS, TextForm
from pneudrive.characterise.toml_lines import key_lines, line_of
from pneudrive.errors import LayoutError, nearest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

STANDARD_ATMOSPHERE_PA = 101325.0
DIMENSIONS = {
    "time": "time",
    "position": "length",
    "force": "force",
    "pressure_a": "pressure",
    "pressure_b": "pressure",
}
COLUMN_KEYS = {"column", "unit", "positive", "scale", "offset", "delay", "accuracy", "range", "calibration"}
TOP_KEYS = {
    "format": str,
    "delimiter": str,
    "header": bool,
    "decimal": str,
    "thousands": str,
    "comment": str,
    "skip_lines": int,
    "skip_samples": int,
}
TABLES = {
    "columns": {*DIMENSIONS, "cycle"},
    "geometry": {"kind", "bore", "rod_diameter", "area_a", "area_b", "bore_accuracy", "area_accuracy"},
    "chamber_a": {"open_to_ambient", "pressure"},
    "chamber_b": {"open_to_ambient", "pressure"},
    "rig": {"ambient_pressure", "incline", "mass_beyond_sensor", "stiffness", "alignment"},
    "window": {"position"},
    "labels": None,  # any key
}
KINDS = ("rodless", "through-rod", "single-rod")
DELIMITERS = {"whitespace": None, "tab": "\t", "comma": ",", "semicolon": ";", "space": " "}


@dataclass(frozen=True)
class Column:
    """One channel: SI value = sign * (raw * scale + offset) * factor, read ``delay_s`` late."""

    column: int | str
    unit: ColumnUnit
    sign: int = 1
    scale: float = 1.0
    offset: float = 0.0
    delay_s: float = 0.0
    accuracy_si: float | None = None
    range_si: tuple[float, float] | None = None


@dataclass(frozen=True)
class FileLayout:
    """Everything that is said about one file, in SI, after the overrides that match its name."""

    format: str
    text: TextForm
    skip_samples: int
    columns: dict[str, Column]
    cycle: int | str | None
    area_a_m2: float
    area_b_m2: float
    chamber_pressures: dict[str, float]  # pressures that are said rather than measured, absolute
    ambient_pressure_pa: float
    incline_rad: float
    mass_beyond_sensor_kg: float
    stiffness_n_m: float | None
    geometry_accuracy: dict[str, float]
    window_m: tuple[float, float] | None
    labels: dict[str, str]


@dataclass(frozen=True)
class Layout:
    """A layout file as it was written, ready to be applied to a file's name.

    Use ``Layout.load(path)``, then ``layout.for_file(path)``.
    """

    tree: dict[str, Any]
    origin: str = "layout"
    lines: dict[tuple, int] = field(default_factory=dict, repr=False)

    @classmethod
    def load(cls, path: str | Path) -> Layout:
        """Read and check a layout file.

        Raises
        ------
        LayoutError
            With file, line, value, rule and remedy.
        """
        path = Path(path)
        try:
            text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            raise LayoutError("there is no such layout file", where=str(path)) from None
        except (OSError, UnicodeDecodeError) as error:
            raise LayoutError(f"the layout file cannot be read as text: {error}", where=str(path)) from None
        return cls.loads(text, origin=str(path))

    @classmethod
    def loads(cls, text: str, origin: str = "layout") -> Layout:
        """Read and check a layout from TOML text."""
        if not text.strip():
            raise LayoutError("the layout file is empty", where=origin, remedy="pneudrive layout FILE proposes one")
        try:
            tree = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            found = re.search(r"line (\d+)", str(error))
            where = f"{origin}:{found.group(1)}" if found else origin
            raise LayoutError(f"not valid TOML: {error}", where=where) from None
        layout = cls(tree=tree, origin=origin, lines=key_lines(text))
        layout._check_keys()
        layout.for_file(Path("any"))  # refuses wrong values before the first recording is opened
        for override in tree.get("for", []):
            layout.for_file(Path(override["match"].replace("*", "").replace("?", "")), force=override["match"])
        return layout

    def for_file(self, path: Path, force: str | None = None) -> FileLayout:
        """Apply the overrides that match the file's name and bring all values to SI."""
        tree = copy.deepcopy({key: value for key, value in self.tree.items() if key != "for"})
        sources: dict[tuple, tuple] = {}
        for index, override in enumerate(self.tree.get("for", [])):
            pattern = override["match"]
            if pattern == force or fnmatchcase(path.name, pattern) or fnmatchcase(stem(path), pattern):
                rest = {key: value for key, value in override.items() if key != "match"}
                _merge(tree, rest, (), ("for", index), sources)
        return _Reader(self, tree, sources).file_layout(path)

    def fail(self, what: str, path: tuple, **details: object) -> LayoutError:
        """Build an error that points at a key."""
        line = line_of(self.lines, path)
        where = f"{self.origin}:{line}" if line else self.origin
        return LayoutError(what, where=where, **details)  # type: ignore[arg-type]

    def _check_keys(self) -> None:
        self._check_tree(self.tree, ())
        for index, override in enumerate(self.tree.get("for", [])):
            if not isinstance(override.get("match"), str):
                raise self.fail(
                    "[[for]] does not say which files it is for",
                    ("for", index),
                    remedy='match = "*257*"',
                )
            self._check_tree({k: v for k, v in override.items() if k != "match"}, ("for", index))

    def _check_tree(self, tree: dict[str, Any], prefix: tuple) -> None:
        known = {*TOP_KEYS, *TABLES, *(() if prefix else ("for", "schema"))}
        for key, value in tree.items():
            path = (*prefix, key)
            if key not in known:
                raise self.fail(f"unknown key '{key}'", path, remedy=nearest(key, known))
            if key in TOP_KEYS and (
                not isinstance(value, TOP_KEYS[key]) or isinstance(value, bool) != (TOP_KEYS[key] is bool)
            ):
                kind = {str: "a text in quotes", bool: "true or false", int: "a whole number"}[TOP_KEYS[key]]
                raise self.fail(f"{key} = {value!r} must be {kind}", path)
            if key in TABLES:
                self._check_table(key, value, path)

    def _check_table(self, name: str, table: object, path: tuple) -> None:
        if not isinstance(table, dict):
            raise self.fail(f"[{name}] must be a table", path, value=repr(table))
        known = TABLES[name]
        for key, value in table.items():
            if known is not None and key not in known:
                raise self.fail(f"unknown key '{name}.{key}'", (*path, key), remedy=nearest(key, known))
            if name == "columns" and key != "cycle":
                if not isinstance(value, dict):
                    raise self.fail(
                        f"columns.{key} must be a table", (*path, key), remedy=f'{key} = {{ column = 0, unit = "..." }}'
                    )
                for inner in value:
                    if inner not in COLUMN_KEYS:
                        raise self.fail(
                            f"unknown key 'columns.{key}.{inner}'",
                            (*path, key, inner),
                            remedy=nearest(inner, COLUMN_KEYS),
                        )


def stem(path: Path) -> str:
    """File name without its suffix and without that of a compression."""
    name = path.name
    for suffix in COMPRESSIONS:
        name = name.removesuffix(suffix)
    return Path(name).stem if Path(name).suffix else name


def labels_from_name(pattern: str, name: str) -> dict[str, str]:
    """Read labels out of a file name; empty where it does not fit. A pressure is a number.

    Examples
    --------
    >>> labels_from_name("{seal}_{pressure}bar", "O-ring_5bar")
    {'seal': 'O-ring', 'pressure': '5'}
    """
    parts = re.split(r"\{(\w+)\}", pattern)
    shapes = {"pressure": r"\d+(?:[.,]\d+)?"}  # a number; everything else takes what is left
    expression = "".join(
        re.escape(p) if i % 2 == 0 else f"(?P<{p}>{shapes.get(p, '.+?')})" for i, p in enumerate(parts)
    )
    match = re.fullmatch(expression, name)
    return dict(match.groupdict()) if match else {}


def _merge(tree: dict, rest: dict, path: tuple, source: tuple, sources: dict[tuple, tuple]) -> None:
    for key, value in rest.items():
        here = (*path, key)
        sources[here] = (*source, *here)
        if isinstance(value, dict) and isinstance(tree.get(key), dict):
            _merge(tree[key], value, here, source, sources)
        else:
            tree[key] = copy.deepcopy(value)


class _Reader:
    """Turns the merged tree of one file into SI, pointing errors at the key's line."""

    def __init__(self, layout: Layout, tree: dict[str, Any], sources: dict[tuple, tuple]) -> None:
        self.layout, self.tree, self.sources = layout, tree, sources

    def fail(self, what: str, *path: str, **details: object) -> LayoutError:
        return self.layout.fail(what, self.sources.get(path, path), **details)

    def quantity(
        self, table: str, key: str, dimension: str, *, difference: bool = False
    ) -> tuple[float, ColumnUnit] | None:
        """Value of an optional key with a unit."""
        value = self.tree.get(table, {}).get(key)
        if value is None:
            return None
        try:
            return parse_quantity(value, dimension, difference=difference)
        except UnitProblem as problem:
            raise self.fail(f"{table}.{key}: {problem}", table, key) from None

    def positive(self, table: str, key: str, dimension: str) -> float | None:
        """Value in SI of an optional key that must be above zero."""
        found = self.quantity(table, key, dimension)
        if found is not None and found[0] <= 0:
            raise self.fail(f"{table}.{key} must be greater than zero", table, key, value=self.tree[table][key])
        return found[0] if found else None

    def file_layout(self, path: Path) -> FileLayout:
        tree = self.tree
        format_name = tree.get("format", "csv")
        if format_name != "csv" and format_name not in READERS:
            raise self.fail(
                f"format = '{format_name}' is not known", "format", remedy=nearest(format_name, ["csv", *READERS])
            )
        skip = tree.get("skip_samples", 0)
        if skip < 0:
            raise self.fail("skip_samples must not be negative", "skip_samples", value=skip)
        ambient = self.ambient()
        area_a, area_b, accuracy = self.areas()
        columns = {name: self.column(name) for name in DIMENSIONS if name in tree.get("columns", {})}
        for needed in ("time", "position", "force"):
            if needed not in columns:
                raise self.fail(
                    f"[columns] does not say where the {needed} is",
                    "columns",
                    remedy=f'{needed} = {{ column = 0, unit = "..." }}',
                )
        incline = self.quantity("rig", "incline", "angle")
        alignment = self.quantity("rig", "alignment", "angle")
        mass = self.quantity("rig", "mass_beyond_sensor", "mass")
        if alignment:
            accuracy["alignment_rad"] = alignment[0]
        if mass and mass[0] < 0:
            raise self.fail("rig.mass_beyond_sensor must not be negative", "rig", "mass_beyond_sensor")
        if incline and abs(incline[0]) > math.pi / 2:
            raise self.fail("rig.incline must lie between -90 deg and 90 deg", "rig", "incline")
        return FileLayout(
            format=format_name,
            text=self.text_form(),
            skip_samples=skip,
            columns=columns,
            cycle=self.cycle(),
            area_a_m2=area_a,
            area_b_m2=area_b,
            chamber_pressures=self.chambers(columns, ambient),
            ambient_pressure_pa=ambient,
            incline_rad=incline[0] if incline else 0.0,
            mass_beyond_sensor_kg=mass[0] if mass else 0.0,
            stiffness_n_m=self.positive("rig", "stiffness", "stiffness"),
            geometry_accuracy=accuracy,
            window_m=self.window(),
            labels=self.labels(path),
        )

    def text_form(self) -> TextForm:
        tree = self.tree
        delimiter = tree.get("delimiter", "whitespace")
        decimal = tree.get("decimal", ".")
        thousands = tree.get("thousands")
        if len(decimal) != 1 or decimal not in ".,":
            raise self.fail(f"decimal = '{decimal}' must be '.' or ','", "decimal")
        if thousands is not None and len(thousands) != 1:
            raise self.fail(f"thousands = '{thousands}' must be one character", "thousands")
        if delimiter not in DELIMITERS and len(delimiter) != 1:
            raise self.fail(
                f"delimiter = '{delimiter}' must be one character or one of {', '.join(DELIMITERS)}", "delimiter"
            )
        delimiter = DELIMITERS.get(delimiter, delimiter)
        if delimiter == decimal:
            raise self.fail(f"'{decimal}' cannot be delimiter and decimal sign at once", "delimiter")
        return TextForm(
            delimiter=delimiter,
            header=tree.get("header", False),
            decimal=decimal,
            thousands=thousands,
            skip_lines=tree.get("skip_lines", 0),
            comment=tree.get("comment", "#"),
        )

    def column(self, name: str) -> Column:
        table = self.tree["columns"][name]
        path = ("columns", name)
        if "column" not in table or isinstance(table["column"], bool) or not isinstance(table["column"], int | str):
            raise self.fail(
                f"columns.{name} does not say its column", *path, remedy="column = 0, or a header name in quotes"
            )
        if not isinstance(table.get("unit"), str):
            raise self.fail(
                f"columns.{name} has no unit",
                *path,
                rule=f"every column says its unit, here a {DIMENSIONS[name]}",
                remedy='unit = "..."',
            )
        dimension = DIMENSIONS[name]
        accuracy = delay = limits = None
        try:
            unit = parse_unit(table["unit"], dimension)
            if "accuracy" in table:
                accuracy = parse_quantity(table["accuracy"], dimension, difference=True)[0]
            if "delay" in table:
                delay = parse_quantity(table["delay"], "time")[0]
            if "range" in table:
                limits = parse_range(table["range"], dimension)
        except UnitProblem as problem:
            raise self.fail(f"columns.{name}: {problem}", *path) from None
        if accuracy is not None and accuracy < 0:
            raise self.fail(f"columns.{name}.accuracy must not be negative", *path)
        sign = {"+x": 1, "-x": -1}.get(table.get("positive", "+x"))
        if sign is None or ("positive" in table and name not in ("force", "position")):
            raise self.fail(
                f"columns.{name}.positive = {table['positive']!r}",
                *path,
                rule='"+x" or "-x", for force and position only',
            )
        numbers = {key: table.get(key, default) for key, default in (("scale", 1.0), ("offset", 0.0))}
        for key, value in numbers.items():
            if (
                isinstance(value, bool)
                or not isinstance(value, int | float)
                or not math.isfinite(value)
                or (key == "scale" and value == 0)
            ):
                raise self.fail(f"columns.{name}.{key} = {value!r} must be a finite number in the column's unit", *path)
        return Column(
            table["column"],
            unit,
            sign,
            float(numbers["scale"]),
            float(numbers["offset"]),
            delay or 0.0,
            accuracy,
            limits,
        )

    def cycle(self) -> int | str | None:
        value = self.tree.get("columns", {}).get("cycle")
        column = value.get("column") if isinstance(value, dict) else value
        if column is not None and (isinstance(column, bool) or not isinstance(column, int | str)):
            raise self.fail(f"columns.cycle = {column!r} must be a column's name or number", "columns", "cycle")
        return column

    def ambient(self) -> float:
        found = self.quantity("rig", "ambient_pressure", "pressure")
        if found is None:
            return STANDARD_ATMOSPHERE_PA
        if found[1].kind != "abs" or found[0] <= 0:
            raise self.fail(
                "rig.ambient_pressure must be an absolute pressure above zero",
                "rig",
                "ambient_pressure",
                remedy='"1.013 bar abs"',
            )
        return found[0]

    def areas(self) -> tuple[float, float, dict[str, float]]:
        geometry = self.tree.get("geometry", {})
        if "area_a" in geometry or "area_b" in geometry:
            return self.given_areas(geometry)
        bore = self.positive("geometry", "bore", "length")
        if bore is None:
            raise self.fail("[geometry] gives no area", "geometry", remedy='bore = "25 mm", or area_a and area_b')
        kind = geometry.get("kind", "rodless")
        if kind not in KINDS:
            raise self.fail(
                f"geometry.kind = '{kind}' is not known", "geometry", "kind", remedy=nearest(str(kind), KINDS)
            )
        rod = self.positive("geometry", "rod_diameter", "length")
        if (rod is None) != (kind == "rodless"):
            rule = "a rodless cylinder has no rod_diameter" if rod else f"a {kind} cylinder needs rod_diameter"
            raise self.fail(f"geometry.kind = '{kind}' and rod_diameter do not fit", "geometry", rule=rule)
        if rod is not None and rod >= bore:
            raise self.fail(
                f"geometry.rod_diameter = {geometry['rod_diameter']} must be smaller than bore = {geometry['bore']}",
                "geometry",
                "rod_diameter",
                remedy="were bore and rod swapped?",
            )
        full = math.pi / 4 * bore**2
        ring = full - math.pi / 4 * (rod or 0.0) ** 2
        uncertainty = self.quantity("geometry", "bore_accuracy", "length")
        accuracy = {"bore_m": uncertainty[0]} if uncertainty else {}
        return (ring if kind == "through-rod" else full), ring, accuracy

    def given_areas(self, geometry: dict[str, Any]) -> tuple[float, float, dict[str, float]]:
        if {"bore", "rod_diameter"} & set(geometry):
            raise self.fail("[geometry] gives the area twice", "geometry", rule="either bore or area_a and area_b")
        areas = [self.positive("geometry", key, "area") for key in ("area_a", "area_b")]
        if None in areas:
            raise self.fail("[geometry] gives only one of area_a and area_b", "geometry")
        uncertainty = self.quantity("geometry", "area_accuracy", "ratio")
        return float(areas[0] or 0), float(areas[1] or 0), ({"area": uncertainty[0]} if uncertainty else {})

    def chambers(self, columns: dict[str, Column], ambient: float) -> dict[str, float]:
        """Pressures of chambers that are said rather than measured."""
        said: dict[str, float] = {}
        for side in ("a", "b"):
            table = f"chamber_{side}"
            opened = self.tree.get(table, {}).get("open_to_ambient", False)
            held = self.quantity(table, "pressure", "pressure")
            measured = f"pressure_{side}" in columns
            if not isinstance(opened, bool):
                raise self.fail(f"{table}.open_to_ambient must be true or false", table, "open_to_ambient")
            if sum((measured, opened, held is not None)) != 1:
                what = "says nothing of" if not (measured or opened or held) else "says twice what is"
                raise self.fail(
                    f"the layout {what} the pressure in chamber {side}",
                    table if table in self.tree else "columns",
                    rule=f"exactly one of columns.pressure_{side}, {table}.open_to_ambient = true, {table}.pressure",
                )
            if opened:
                said[f"pressure_{side}"] = ambient
            elif held:
                said[f"pressure_{side}"] = held[0] + (ambient if held[1].kind == "gauge" else 0.0)
        return said

    def window(self) -> tuple[float, float] | None:
        text = self.tree.get("window", {}).get("position")
        if text is None:
            return None
        try:
            return parse_range(text, "length")
        except UnitProblem as problem:
            raise self.fail(f"window.position: {problem}", "window", "position") from None

    def labels(self, path: Path) -> dict[str, str]:
        labels = {key: str(value) for key, value in self.tree.get("labels", {}).items() if key != "pattern"}
        pattern = self.tree.get("labels", {}).get("pattern")
        if pattern is None:
            return labels
        if not isinstance(pattern, str) or len(set(re.findall(r"\{(\w+)\}", pattern))) != pattern.count("{"):
            raise self.fail(
                f"labels.pattern = {pattern!r}",
                "labels",
                "pattern",
                rule='a text with {name}, each name once, as in "{seal}_{pressure}bar"',
            )
        return {**labels, **labels_from_name(pattern, stem(path))}
