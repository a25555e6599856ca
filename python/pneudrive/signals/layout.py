"""The layout file: how a foreign recording is read."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.describe.files import toml
from pneudrive.describe.keys import wrong
from pneudrive.errors import LayoutError, Problems, nearest
from pneudrive.files.packed import COMPRESSIONS
from pneudrive.repr_tables import Shown
from pneudrive.signals.layout_tables import CHANNELS, ColumnTable, GeometryTable, LayoutTables, TimeTable

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


@dataclass(frozen=True)
class FileLayout:
    """The layout of one file, with the overrides that match its name.

    Attributes
    ----------
    tables : LayoutTables
        The tables of the layout, values in SI.
    kind : str
        Kind of recording.
    labels : dict
        Fixed labels, and those of the file's name.
    """

    tables: LayoutTables
    kind: str
    labels: dict[str, str]

    @cached_property
    def columns(self) -> dict[str, ColumnTable]:
        """Columns by channel; those of parallel forces are ``force 1: pressure`` and ``force 1: against``."""
        found = {name: self.tables.channel(name, self.kind) for name in CHANNELS[self.kind][0]}
        for number, force in enumerate(self.rig.force, 1):
            found |= {f"force {number}: pressure": force.pressure, f"force {number}: against": force.against}
        return {name: column for name, column in found.items() if column is not None}

    @cached_property
    def rig(self) -> LayoutTables:
        """Tables with geometry, masses and chambers of a rig. Empty for other kinds."""
        return self.tables if self.kind == "rig" else LayoutTables()

    @property
    def time(self) -> TimeTable:
        """Column of the time, or the rate of the samples."""
        return self.columns["time"]  # type: ignore[return-value]

    @property
    def format(self) -> str:
        """Format of the file."""
        return self.tables.format

    @property
    def cycle(self) -> int | str | None:
        """Column that numbers the cycles of a campaign file."""
        return self.rig.columns.cycle  # type: ignore[attr-defined]

    @property
    def skip_samples(self) -> int:
        """Number of samples at the beginning that are left out."""
        return self.tables.skip_samples

    @property
    def ambient_pressure_pa(self) -> float:
        """Absolute pressure around the rig."""
        return self.tables.ambient_pa

    @property
    def dates(self) -> dict[int | str, str]:
        """Columns of dates and times, with their format."""
        time = self.time
        clocks = [time.column, *(column.clock for column in self.columns.values())] if time.is_date else []
        found = {place: time.format for place in clocks if place is not None}
        return found if time.date is None else found | {time.date: time.date_format}

    @property
    def places(self) -> list[int | str]:
        """Columns of the file that are read: those of the channels, and of their dates and clocks."""
        columns = self.columns.values()
        places = [*(c.column for c in columns), self.time.date, *(c.clock for c in columns)]
        return list(dict.fromkeys(place for place in places if place is not None))

    @property
    def is_plain(self) -> bool:
        """Whether every channel is a column, and each of its rows can be read separately."""
        columns = self.columns.values()
        special = (self.time.rate_hz, self.time.date, *(c.clock for c in columns), *(c.wraps for c in columns))
        return all(value is None for value in special)


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
    >>> layout.for_file(Path("run.csv")).tables.chamber_pressures()["pressure_b"]
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
        """Apply the overrides that match the file's name, for a recording of a rig.

        Raises
        ------
        LayoutError
            If a value is wrong for this file, or the layout has another kind.
        """
        return self._for("rig", path, "friction needs time, position and force")

    def for_volume_file(self, path: Path) -> FileLayout:
        """Apply the overrides like `for_file`, for a recording of a fixed volume."""
        return self._for("fixed-volume", path, 'kind = "fixed-volume", with the columns time and pressure')

    def for_drive_file(self, path: Path) -> FileLayout:
        """Apply the overrides like `for_file`, for a recording of a drive."""
        return self._for("drive", path, "a drive needs time, command, position and both pressures")

    def for_any_file(self, path: Path) -> FileLayout:
        """Apply the overrides like `for_file`, for a recording of the layout's own kind."""
        return {"rig": self.for_file, "drive": self.for_drive_file}.get(self.kind, self.for_volume_file)(path)

    def _for(self, kind: str, path: Path, verb: str) -> FileLayout:
        self._needs(kind, verb)
        chosen = self._matching(path)
        tables = _read(self, tuple(chosen))
        return FileLayout(tables, kind, self._labels(tables, path, chosen))

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
