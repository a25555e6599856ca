"""The layout file: how a foreign recording is read."""

from __future__ import annotations

import copy
import re
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.characterise.force_calibration import KEYS as FORCE_CALIBRATION_KEYS
from pneudrive.characterise.text_table import TextForm
from pneudrive.describe import toml
from pneudrive.errors import LayoutError, Problems, nearest
from pneudrive.files.packed import COMPRESSIONS
from pneudrive.show import Shown

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from pneudrive.characterise.column_units import ColumnUnit
    from pneudrive.characterise.force_calibration import ForceCalibration
    from pneudrive.characterise.layout_values import LayoutValues

# Channel -> SI unit.
CHANNEL_UNITS = {"time": "s", "position": "m", "force": "N", "pressure_a": "Pa", "pressure_b": "Pa"}
# Channels that a recording of a drive has beside them; a layout that names the command is one of a drive.
DRIVE_UNITS = {"command": "", "velocity": "m/s", "temperature_a": "K", "temperature_b": "K"}
# Channels of a recording of a fixed volume: its command is the share of the line's opening, its inlet pressure that
# between line and tube.
VOLUME_UNITS = {"time": "s", "pressure": "Pa", "inlet_pressure": "Pa", "command": ""}
KINDS = ("rig", "drive", "fixed-volume")
COLUMN_KEYS = {"column", "unit", "positive", "scale", "offset", "delay", "accuracy", "range", "calibration", "format"}
TOP_KEYS: dict[str, tuple[type, str]] = {
    "kind": (str, "a text in quotes"),
    "format": (str, "a text in quotes"),
    "delimiter": (str, "a text in quotes"),
    "header": (bool, "true or false"),
    "decimal": (str, "a text in quotes"),
    "thousands": (str, "a text in quotes"),
    "comment": (str, "a text in quotes"),
    "skip_lines": (int, "a whole number"),
    "skip_samples": (int, "a whole number"),
}
TABLES: dict[str, set[str] | None] = {
    "columns": {*CHANNEL_UNITS, *DRIVE_UNITS, *VOLUME_UNITS, "cycle"},
    "geometry": {"kind", "bore", "rod_diameter", "area_a", "area_b", "bore_accuracy", "area_accuracy"},
    "chamber_a": {"open_to_ambient", "pressure"},
    "chamber_b": {"open_to_ambient", "pressure"},
    "rig": {"ambient_pressure", "incline", "mass_beyond_sensor", "stiffness", "alignment"},
    "window": {"position"},
    "force_calibration": set(FORCE_CALIBRATION_KEYS),
    "labels": None,  # any key
}


@dataclass(frozen=True)
class Column:
    """One channel: SI value = sign * (raw * scale + offset) * factor, read ``delay_s`` late.

    ``scale`` and ``offset`` bring the raw number to the column's unit; ``accuracy_si`` is a standard
    uncertainty; ``range_si`` the lowest and highest value that the sensor can give (pressures absolute);
    ``curve`` what the sensor shows of which force, before the sign;
    ``date_form`` how dates and times are written, where such stand in the column of the time.
    """

    column: int | str
    unit: ColumnUnit
    sign: int = 1
    scale: float = 1.0
    offset: float = 0.0
    delay_s: float = 0.0
    accuracy_si: float | None = None
    range_si: tuple[float, float] | None = None
    calibration: str = ""
    curve: ForceCalibration | None = None
    date_form: str | None = None


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

    @property
    def dates(self) -> dict[int | str, str]:
        """Columns that hold dates and times, with the form in which they are written."""
        return {column.column: column.date_form for column in self.columns.values() if column.date_form is not None}


@dataclass(frozen=True)
class SampledLayout:
    """What a layout says of a file that recorded a drive or a fixed volume: no geometry, which these have."""

    format: str
    text: TextForm
    skip_samples: int
    columns: dict[str, Column]
    ambient_pressure_pa: float
    labels: dict[str, str]

    @property
    def dates(self) -> dict[int | str, str]:
        """Columns that hold dates and times, with the form in which they are written."""
        return {column.column: column.date_form for column in self.columns.values() if column.date_form is not None}


@dataclass(frozen=True, repr=False)
class Layout(Shown):
    """A layout file as it was written, ready to be applied to a file's name.

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
    >>> layout.for_file(Path("run.csv")).chamber_pressures["pressure_b"]
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
            With file, line, value, rule and remedy.
        """
        tree, text = toml.read(path, LayoutError, "`pneudrive layout FILE` proposes one.")
        return cls(tree, str(path), text)._checked()

    @classmethod
    def loads(cls, text: str, origin: str = "layout") -> Layout:
        """Read and check a layout from TOML text."""
        return cls(toml.parse(text, origin, LayoutError), origin, text)._checked()

    def for_file(self, path: Path) -> FileLayout:
        """Apply the overrides that match the file's name and bring all values to SI.

        Raises
        ------
        LayoutError
            A value that is wrong for this file.
        """
        self._needs("rig", "friction needs time, position and force")
        return self._with_overrides(self._matching(path)).file_layout(path)

    def for_volume_file(self, path: Path) -> SampledLayout:
        """Apply the overrides that match the file's name, for a recording of a fixed volume.

        Raises
        ------
        LayoutError
            A value that is wrong for this file, or a layout of another kind.
        """
        self._needs("fixed-volume", 'kind = "fixed-volume", with the columns time and pressure')
        return self._with_overrides(self._matching(path)).volume_layout(path)

    def _matching(self, path: Path) -> list[int]:
        names = (path.name, stem(path))
        return [
            index
            for index, override in enumerate(self.tree.get("for", []))
            if any(fnmatchcase(name, override["match"]) for name in names)
        ]

    @property
    def kind(self) -> str:
        """What was recorded: a ``rig``, a ``drive`` (a layout that names a command), or a ``fixed-volume``."""
        trees = [self.tree, *self.tree.get("for", [])]
        names_command = any(isinstance(tree.get("columns"), dict) and "command" in tree["columns"] for tree in trees)
        return self.tree.get("kind", "drive" if names_command else "rig")

    def _needs(self, kind: str, verb: str) -> None:
        """Refuse to read another kind of recording than the layout is for."""
        if self.kind != kind and "fixed-volume" in (self.kind, kind):
            other = "a fixed volume" if kind == "fixed-volume" else f"a {kind}"
            raise self.fail(
                f"this layout is for recordings of a {self.kind.replace('-', ' ')}, and those of {other} are needed",
                *(["kind"] if "kind" in self.tree else []),
                rule=f"{verb}",
                remedy='a fixed volume (kind = "fixed-volume") goes with `pneudrive identify TANK.toml RECORDING`',
            )

    def for_drive_file(self, path: Path) -> SampledLayout:
        """Apply the overrides that match the file's name, for a recording of a drive.

        Raises
        ------
        LayoutError
            A value that is wrong for this file, or no command.
        """
        self._needs("drive", "a drive needs time, command, position and both pressures")
        return self._with_overrides(self._matching(path)).drive_layout(path)

    def fail(self, what: str, *keys: str, rule: str | None = None, remedy: str | None = None) -> LayoutError:
        """Build an error that points at a key's line."""
        line = toml.line_of(self.text, ".".join(keys)) if keys else None
        shown = self.text.splitlines()[line - 1].strip() if line else None
        where = f"{self.origin}:{line}" if line else self.origin
        return LayoutError(what, where=where, value=shown, rule=rule, remedy=remedy)

    def _with_overrides(self, chosen: list[int], *, is_part: bool = False) -> LayoutValues:
        from pneudrive.characterise.layout_values import LayoutValues

        tree = copy.deepcopy({key: value for key, value in self.tree.items() if key != "for"})
        sources: dict[tuple[str, ...], tuple[str, ...]] = {}
        for index in chosen:
            rest = {key: value for key, value in self.tree["for"][index].items() if key != "match"}
            _make_way(tree, rest)
            _merge(tree, rest, (), ("for", str(index)), sources)
        return LayoutValues(self, tree, sources, is_part=is_part)

    def _checked(self) -> Layout:
        """Refuse unknown keys and wrong values before the first recording is opened, all at once."""
        overrides, problems = self.tree.get("for", []), Problems()
        if not isinstance(overrides, list) or not all(isinstance(one, dict) for one in overrides):
            raise self.fail("[for] must be written [[for]], one for each group of files", "for")
        trees: list[tuple[dict[str, Any], tuple[str, ...]]] = [
            ({k: v for k, v in self.tree.items() if k not in ("for", "schema")}, ())
        ]
        for index, override in enumerate(overrides):
            trees.append(({k: v for k, v in override.items() if k != "match"}, ("for", str(index))))
        for tree, place in trees:
            with problems.caught():
                self._check_kinds(tree, place)
        problems.tell()  # what is no table cannot be looked into
        for index, override in enumerate(overrides):
            if not isinstance(override.get("match"), str):
                what = "[[for]] does not say which files it is for"
                problems.add(self.fail(what, "for", str(index), remedy='match = "*257*"'))
        for tree, place in trees:
            for error in self._unknown(tree, place):
                problems.add(error)
        if self.kind not in KINDS:
            problems.add(self.fail(f"kind = '{self.kind}' is not known", "kind", remedy=nearest(self.kind, KINDS)))
            problems.tell()  # which columns are needed is not known
        for chosen in ([], *([index] for index in range(len(overrides)))):
            # What is missing here, another [[for]] may give: only the layout of a file has to be whole.
            values = self._with_overrides(chosen, is_part=bool(overrides))
            readers = {"drive": values.drive_layout, "fixed-volume": values.volume_layout}
            with problems.caught():
                readers.get(self.kind, values.file_layout)(None)
        problems.tell()
        return self

    def _check_kinds(self, tree: dict[str, Any], prefix: tuple[str, ...]) -> None:
        """Refuse what is a table and should be a value, and the other way round."""
        problems = Problems()
        for key, value in tree.items():
            path = (*prefix, key)
            if key in TABLES and not isinstance(value, dict):
                problems.add(self.fail(f"[{key}] must be a table", *path))
            elif key == "columns":
                for name, column in value.items():
                    if name != "cycle" and name in (TABLES[key] or ()) and not isinstance(column, dict):
                        what, example = f"columns.{name} must be a table", f'{name} = {{ column = 0, unit = "..." }}'
                        problems.add(self.fail(what, *path, name, remedy=example))
            elif key in TOP_KEYS:
                kind, words = TOP_KEYS[key]
                if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
                    problems.add(self.fail(f"{key} = {value!r} must be {words}", *path))
        problems.tell()

    def _unknown(self, tree: dict[str, Any], prefix: tuple[str, ...]) -> Iterator[LayoutError]:
        """Give an error for each key that is not known."""

        def unknown(known: Collection[str], *keys: str) -> LayoutError:
            return self.fail(f"unknown key '{'.'.join(keys)}'", *prefix, *keys, remedy=nearest(keys[-1], known))

        for key, value in tree.items():
            if key not in TABLES:
                if key not in TOP_KEYS:
                    yield unknown({*TOP_KEYS, *TABLES}, key)
                continue
            known = TABLES[key]
            for name, column in value.items():
                if known is not None and name not in known:
                    yield unknown(known, key, name)
                elif key == "columns" and isinstance(column, dict) and name != "cycle":
                    for inner in column:
                        if inner not in COLUMN_KEYS:
                            yield unknown(COLUMN_KEYS, key, name, inner)


def stem(path: Path) -> str:
    """File name without its suffix and without that of a compression.

    Examples
    --------
    >>> stem(Path("NAPN_1bar.csv.xz"))
    'NAPN_1bar'
    """
    name = path.name
    for suffix in COMPRESSIONS:
        name = name.removesuffix(suffix)
    return Path(name).stem


# Field of a pattern of labels -> what it takes, and how a message calls that. Every other field takes any text.
FIELDS = {"pressure": (r"[-+]?\d+(?:[.,]\d+)?(?: ?(?:mbar|bar|kPa|MPa|Pa|psi))?", "a number, with or without a unit")}


def labels_from_name(pattern: str, name: str) -> dict[str, str] | None:
    """Read labels out of a file name; None where it does not fit.

    ``{pressure}`` takes a number, which a unit may follow: ``5``, ``0,5``, ``1bar``. Every other field takes any text,
    at least one character, and of several ways to divide a name the one that keeps the earlier fields short.

    Examples
    --------
    >>> labels_from_name("{seal}_{pressure}bar", "O-ring_5bar")
    {'seal': 'O-ring', 'pressure': '5'}
    >>> labels_from_name("{seal}_{pressure}", "O-ring_5bar")
    {'seal': 'O-ring', 'pressure': '5bar'}
    """
    match = re.fullmatch(_expression(_parts(pattern)), name)
    return dict(match.groupdict()) if match else None


def where_pattern_ends(pattern: str, name: str) -> tuple[str, str]:
    """For a name that does not fit: the part of the pattern that finds nothing, and what of the name is left for it."""
    parts = _parts(pattern)
    for count in range(len(parts) - 1, -1, -1):
        match = re.match(_expression(parts[:count]), name)
        if match:
            part = parts[count]
            about = FIELDS.get(part[1:-1], ("", "any text"))[1] if part.startswith("{") else None
            return (f"{part} ({about})" if about else f"'{part}'"), name[match.end() :]
    return pattern, name


def _parts(pattern: str) -> list[str]:
    return [part for part in re.split(r"(\{\w+\})", pattern) if part]


def _expression(parts: list[str]) -> str:
    return "".join(
        f"(?P<{part[1:-1]}>{FIELDS.get(part[1:-1], ('.+?', ''))[0]})" if part.startswith("{") else re.escape(part)
        for part in parts
    )


def _make_way(tree: dict, rest: dict) -> None:
    """Take out of a tree what an override says anew as a whole.

    A column that an override gives with its place and its unit, and the pressure of a chamber that it gives in another
    way.
    """
    columns, said = tree.get("columns", {}), rest.get("columns", {})
    for name, column in said.items():
        if isinstance(column, dict) and {"column", "unit"} <= set(column):
            columns.pop(name, None)
    for side in "ab":
        if f"pressure_{side}" in said:
            tree.pop(f"chamber_{side}", None)
        elif f"chamber_{side}" in rest:
            columns.pop(f"pressure_{side}", None)
            tree.pop(f"chamber_{side}", None)


def _merge(tree: dict, rest: dict, path: tuple[str, ...], source: tuple[str, ...], sources: dict) -> None:
    """Put an override's values into the tree and remember where each was written."""
    for key, value in rest.items():
        here = (*path, key)
        sources[here] = (*source, *here)
        if isinstance(value, dict) and isinstance(tree.get(key), dict):
            _merge(tree[key], value, here, source, sources)
        else:
            tree[key] = copy.deepcopy(value)
