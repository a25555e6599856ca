"""The layout file: how a foreign recording is read."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pneudrive.describe.files import toml
from pneudrive.describe.keys import wrong
from pneudrive.errors import LayoutError, Problems, nearest
from pneudrive.files.packed import COMPRESSIONS
from pneudrive.repr_tables import Shown
from pneudrive.signals.layout_tables import CHANNELS, SIGNS, GeometryTable, LayoutTables

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from pneudrive.signals.force_calibration import ForceCalibration
    from pneudrive.signals.tables.column_units import ColumnUnit
    from pneudrive.signals.tables.text_table import TextForm


@dataclass(frozen=True)
class Column:
    """One channel: Reader of a column: SI value = sign * (raw * scale + offset) * factor, with a delay of ``delay_s``.

    ``scale`` and ``offset`` convert the raw number to the column's unit. ``accuracy_si`` is a standard uncertainty.
    ``range_si`` has the lowest and highest value of the sensor (pressures absolute). ``curve`` is the calibration of
    the force sensor, before the sign. ``date_form`` is the format of dates and times, if the column of the time has
    them.
    ``clock`` is the column of the channel's separate times. ``wraps`` is the number of counts until a counter restarts.
    ``guessed`` marks a unit that was guessed from the size of the numbers.
    A time has a column or ``rate_hz``. A time of day may have a column of dates, ``date``.
    """

    column: int | str | None
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
    clock: int | str | None = None
    wraps: float | None = None
    guessed: bool = False
    rate_hz: float | None = None
    date: int | str | None = None
    date_format: str = ""

    def in_unit(self, raw: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return raw numbers in the column's unit, towards +x, before a curve. Unchanged numbers are not copied."""
        value = raw if self.scale == 1.0 else raw * self.scale
        value = value if self.offset == 0.0 else value + self.offset
        return value if self.sign == 1 else self.sign * value

    def corrected(self, si: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return SI values through the curve of the sensor, if there is one."""
        return si if self.curve is None else self.sign * self.curve.force_n(self.sign * si)


@dataclass(frozen=True)
class SampledLayout:
    """A layout for one file of a drive or a fixed volume, in SI, with the overrides that match its name."""

    format: str
    text: TextForm
    skip_samples: int
    columns: dict[str, Column]
    ambient_pressure_pa: float
    labels: dict[str, str]

    @property
    def dates(self) -> dict[int | str, str]:
        """Columns of dates and times, with their format."""
        time = self.columns["time"]
        clocks = (
            [time.column, *(column.clock for column in self.columns.values())] if time.date_form is not None else []
        )
        found = {place: time.date_form or "" for place in clocks if place is not None}
        return found if time.date is None else found | {time.date: time.date_format}

    @property
    def places(self) -> list[int | str]:
        """Columns of the file that are read: those of the channels, and of their dates and clocks."""
        columns = self.columns.values()
        places = [*(c.column for c in columns), self.columns["time"].date, *(c.clock for c in columns)]
        return list(dict.fromkeys(place for place in places if place is not None))

    @property
    def is_plain(self) -> bool:
        """Whether every channel is a column, and each of its rows can be read separately."""
        time = self.columns["time"]
        special = (
            time.rate_hz,
            time.date,
            *(c.clock for c in self.columns.values()),
            *(c.wraps for c in self.columns.values()),
        )
        return all(value is None for value in special)


class Parallel(NamedTuple):
    """A parallel force of a layout: its pressures are the channels `plus` and, if given, `minus`."""

    name: str
    area_m2: float
    uncertainty: float
    sign: int
    plus: str
    minus: str | None


@dataclass(frozen=True)
class FileLayout(SampledLayout):
    """A layout for one file of a rig, with the geometry of the drive under test."""

    cycle: int | str | None
    area_a_m2: float
    area_b_m2: float
    chamber_pressures: dict[str, float]  # stated (not measured) pressures, absolute
    incline_rad: float
    mass_beyond_sensor_kg: float
    stiffness_n_m: float | None
    geometry_accuracy: dict[str, float]
    window_m: tuple[float, float] | None
    parallel: tuple[Parallel, ...] = ()


@dataclass(frozen=True, repr=False, eq=False)
class Layout(Shown):
    """A layout file before its overrides are applied to a file's name.

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
            If a value is wrong for this file.
        """
        said, common = self._common("rig", path, "friction needs time, position and force")
        area_a, area_b = said.geometry.areas()
        parallel = []
        for number, force in enumerate(said.force):
            names = {key: f"force {number + 1}: {key}" for key in force.columns()}
            for key, column in force.columns().items():
                common["columns"][names[key]] = Column(**said.column("pressure", "rig", column))
            sign, ends = SIGNS[force.positive], (names["pressure"], names.get("against"))
            parallel.append(Parallel(force.name, force.area_m2, force.area_accuracy, sign, *ends))
        return FileLayout(
            **common,
            cycle=said.columns.cycle,
            area_a_m2=area_a,
            area_b_m2=area_b,
            chamber_pressures=said.chamber_pressures(),
            incline_rad=said.rig.incline_rad,
            mass_beyond_sensor_kg=said.rig.mass_beyond_sensor_kg,
            stiffness_n_m=said.rig.stiffness_n_m,
            geometry_accuracy=said.geometry_accuracy(),
            window_m=said.window.position,
            parallel=tuple(parallel),
        )

    def for_volume_file(self, path: Path) -> SampledLayout:
        """Apply the overrides like `for_drive_file`, for a recording of a fixed volume."""
        verb = 'kind = "fixed-volume", with the columns time and pressure'
        return SampledLayout(**self._common("fixed-volume", path, verb)[1])

    def for_drive_file(self, path: Path) -> SampledLayout:
        """Apply the overrides that match the file's name, for a recording of a drive.

        Raises
        ------
        LayoutError
            If a value is wrong for this file, or the layout has another kind.
        """
        verb = "a drive needs time, command, position and both pressures"
        return SampledLayout(**self._common("drive", path, verb)[1])

    def _common(self, kind: str, path: Path, verb: str) -> tuple[LayoutTables, dict[str, Any]]:
        """Return the parts common to all layouts of a file."""
        self._needs(kind, verb)
        chosen = self._matching(path)
        said = _read(self, tuple(chosen))
        units = CHANNELS[kind][0]
        columns = {name: Column(**said.column(name, kind)) for name in units if getattr(said.columns, name) is not None}
        return said, {
            "format": said.format,
            "text": said.text_form,
            "skip_samples": said.skip_samples,
            "columns": columns,
            "ambient_pressure_pa": said.ambient_pa,
            "labels": self._labels(said, path, chosen),
        }

    def _labels(self, said: LayoutTables, path: Path, chosen: Sequence[int]) -> dict[str, str]:
        """Return the fixed labels and those of the file's name.

        Raises
        ------
        LayoutError
            If the pattern does not match the file's name.
        """
        labels = {key: text for key, text in said.labels.items() if key != "pattern"}
        pattern = said.labels.get("pattern", "")
        found = labels_from_name(pattern, stem(path)) if pattern else {}
        if found is None:
            part, left = where_pattern_ends(pattern, stem(path))
            rest = f"'{left}' is left of the name" if left else "the name ends"
            example = f'[[for]] match = "{path.name}", labels.pattern = "..." (or "" for none)'
            raise self.fail(
                f"labels.pattern = {pattern!r} does not match the file {path.name}",
                self._place("labels.pattern", chosen),
                rule=f"at {part}, {rest}",
                remedy=f"correct the pattern, or give files with other names their own: {example}",
            )
        return labels | found

    def _matching(self, path: Path) -> list[int]:
        names = (path.name, stem(path))
        return [
            index
            for index, override in enumerate(self.tree.get("for", []))
            if any(fnmatchcase(name, override["match"]) for name in names)
        ]

    @property
    def kind(self) -> str:
        """Kind of recording: a ``rig``, a ``drive`` (a layout with a command), or a ``fixed-volume``."""
        trees = [self.tree, *self.tree.get("for", [])]
        names_command = any(isinstance(tree.get("columns"), dict) and "command" in tree["columns"] for tree in trees)
        return self.tree.get("kind", "drive" if names_command else "rig")

    def _needs(self, kind: str, verb: str) -> None:
        """Refuse a recording of another kind than that of the layout."""
        if self.kind != kind and "fixed-volume" in (self.kind, kind):
            other = "a fixed volume" if kind == "fixed-volume" else f"a {kind}"
            raise self.fail(
                f"this layout is for recordings of a {self.kind.replace('-', ' ')}, not {other}",
                *(["kind"] if "kind" in self.tree else []),
                rule=f"{verb}",
                remedy='a fixed volume (kind = "fixed-volume") is for `pneudrive identify TANK.toml RECORDING`',
            )

    def fail(self, what: str, key: str = "", rule: str | None = None, remedy: str | None = None) -> LayoutError:
        """Build an error that points at a key's line."""
        return toml.located(wrong(key, what, rule=rule, remedy=remedy), self.origin, self.text).turned(LayoutError)

    def _place(self, key: str, chosen: Sequence[int]) -> str:
        """Return the location of a key in the file, also in an override. Otherwise return the location of its table."""
        while key:
            for at in (*(f"for.{index}." for index in reversed(chosen)), ""):
                found: Any = self.tree["for"][int(at.split(".")[1])] if at else self.tree
                for part in key.split("."):
                    found = found.get(part) if isinstance(found, dict) else None
                if found is not None:
                    return f"{at}{key}"
            key = key.rpartition(".")[0]
        return key

    def read(self, chosen: Sequence[int], *, is_part: bool = False) -> LayoutTables:
        """Read the layout with some of its overrides.

        Parameters
        ----------
        chosen : sequence of int
            The overrides, in their order.
        is_part : bool
            The layout may be incomplete.

        Raises
        ------
        LayoutError
            With all errors.
        """
        tree = {key: value for key, value in self.tree.items() if key != "for"}
        for index in chosen:
            rest = {key: value for key, value in self.tree["for"][index].items() if key != "match"}
            tree = toml.merge(_without(tree, rest), rest)
        problems, kind = Problems(), self.kind
        said: LayoutTables | None = problems.take(LayoutTables.model_validate, tree)
        if said is not None:
            for error in said.contradictions(kind):
                problems.add(error)
            if kind == "rig" and not (is_part and said.geometry == GeometryTable()):
                problems.take(said.geometry.areas)
            for error in () if is_part else said.missing(kind):
                problems.add(error)
        if is_part:  # another [[for]] may supply missing keys: only the layout of a file must be complete
            problems.found = {at: one for at, one in problems.found.items() if " is missing" not in one.what}
        for error in problems.found.values():
            error.key = self._place(getattr(error, "key", None) or "", chosen)  # type: ignore[attr-defined]
        with toml.locating(self.origin, self.text, LayoutError):
            problems.tell()
        return LayoutTables() if said is None else said

    def _checked(self) -> Layout:
        """Refuse unknown keys and wrong values before the first recording is opened, all at once."""
        overrides, problems = self.tree.get("for", []), Problems()
        if not isinstance(overrides, list) or not all(isinstance(one, dict) for one in overrides):
            raise self.fail("[for] must be written [[for]], one for each group of files", "for")
        for index, override in enumerate(overrides):
            if not isinstance(override.get("match"), str):
                what = "[[for]] does not say which files it is for"
                problems.add(self.fail(what, f"for.{index}", remedy='match = "*257*"'))
        if self.kind not in list(CHANNELS):
            remedy = nearest(str(self.kind), CHANNELS)
            raise self.fail(f"kind = {self.kind!r} is not known", "kind", remedy=remedy)  # of unknown needs
        for chosen in ([], *([index] for index in range(len(overrides)))):
            with problems.caught():
                self.read(chosen, is_part=bool(overrides))
        problems.tell()
        return self


@lru_cache(maxsize=256)
def _read(layout: Layout, chosen: tuple[int, ...]) -> LayoutTables:
    return layout.read(chosen)


def stem(path: Path) -> str:
    """Return the file name without its suffix and without that of a compression.

    Examples
    --------
    >>> stem(Path("NAPN_1bar.csv.xz"))
    'NAPN_1bar'
    """
    name = path.name
    for suffix in COMPRESSIONS:
        name = name.removesuffix(suffix)
    return Path(name).stem


# Field of a pattern of labels -> its expression, and its name in messages. Other fields take any text.
FIELDS = {"pressure": (r"[-+]?\d+(?:[.,]\d+)?(?: ?(?:mbar|bar|kPa|MPa|Pa|psi))?", "a number, with or without a unit")}


def labels_from_name(pattern: str, name: str) -> dict[str, str] | None:
    """Return the labels in a file name; None if it does not match.

    ``{pressure}`` takes a number, which a unit may follow: ``5``, ``0,5``, ``1bar``. Every other field takes any text,
    at least one character; fields are as short as possible, the first ones first.

    Examples
    --------
    >>> labels_from_name("{seal}_{pressure}bar", "O-ring_5bar")
    {'seal': 'O-ring', 'pressure': '5'}
    >>> labels_from_name("{seal}_{pressure}", "O-ring_5bar")
    {'seal': 'O-ring', 'pressure': '5bar'}
    """
    parts = _parts(pattern)
    ends = _ends(parts, name, whole=True)
    if ends is None:
        return None
    return {part[1:-1]: name[at:end] for part, at, end in zip(parts, (0, *ends), ends, strict=False) if _is_field(part)}


def where_pattern_ends(pattern: str, name: str) -> tuple[str, str]:
    """Return, for a name that does not match, the first part of the pattern that fails, and the rest of the name."""
    parts = _parts(pattern)
    for count in range(len(parts) - 1, -1, -1):
        ends = _ends(parts[:count], name, whole=False)
        if ends is not None:
            part = parts[count]
            about = FIELDS.get(part[1:-1], ("", "any text"))[1] if part.startswith("{") else None
            return (f"{part} ({about})" if about else f"'{part}'"), name[max(ends, default=0) :]
    return pattern, name


def _parts(pattern: str) -> list[str]:
    return [part for part in re.split(r"(\{\w+\})", pattern) if part]


def _is_field(part: str) -> bool:
    return re.fullmatch(r"\{\w+\}", part) is not None


def _ends(parts: list[str], name: str, *, whole: bool) -> tuple[int, ...] | None:
    """Return the end of each part in a name; None if the name does not match.

    If `whole`, the match must include the name's end.

    Each position is tried once for each part. A regular expression would try every possible division of the name, and
    the number of divisions grows exponentially with the number of fields.
    """

    @cache
    def rest(index: int, at: int) -> tuple[int, ...] | None:
        if index == len(parts):
            return () if at == len(name) or not whole else None
        part = parts[index]
        if not _is_field(part):
            ends: Iterable[int] = [at + len(part)] if name.startswith(part, at) else []
        elif (field := FIELDS.get(part[1:-1])) is None:
            ends = range(at + 1, len(name) + 1)
        else:
            ends = [end for end in range(len(name), at, -1) if re.fullmatch(field[0], name[at:end])]
        for end in ends:
            if (found := rest(index + 1, end)) is not None:
                return (end, *found)
        return None

    return rest(0, 0)


def _without(tree: dict[str, Any], rest: dict[str, Any]) -> dict[str, Any]:
    """Return a tree without the tables that an override replaces as a whole.

    These are a column given with place and unit, and the pressure of a chamber given in another
    way.
    """
    columns, said = tree.get("columns", {}), rest.get("columns", {})
    if not (isinstance(columns, dict) and isinstance(said, dict)):
        return tree
    replaced = {name for name, one in said.items() if isinstance(one, dict) and {"column", "unit"} <= set(one)}
    replaced |= {f"pressure_{side}" for side in "ab" if f"chamber_{side}" in rest}
    chambers = {f"chamber_{side}" for side in "ab" if f"pressure_{side}" in said or f"chamber_{side}" in rest}
    out = {key: value for key, value in tree.items() if key not in chambers}
    return out | {"columns": {name: one for name, one in columns.items() if name not in replaced}}
