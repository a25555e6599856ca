"""TOML files of users: reading with the lines of keys, errors with file and line, and writing."""

from __future__ import annotations

import re
from contextlib import contextmanager
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pneudrive.errors import DescriptionError, ErrorKind, together, tomllib
from pneudrive.files.content import check_depth, check_nesting, exists, read_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from pneudrive.arrays import Keyed, Plain

Made = TypeVar("Made")

_HEADER = re.compile(r"\s*+\[\[?([^\]]+)\]\]?\s*+(?:#.*)?$")
_KEY = r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'"""
_ASSIGNMENT = re.compile(rf"\s*((?:{_KEY})(?:\s*\.\s*(?:{_KEY}))*)\s*=\s*(.*)$")
LONGEST_LINE = 10_000  # characters of the longest line in which keys are searched
_INLINE = re.compile(rf"(?:^|[{{,])\s*({_KEY})\s*=")
_TEXTS = re.compile(r""""(?:\\.|[^"\\])*"|'[^']*'|(?P<end>[#\]{])""")  # the leading texts of an array


def read(
    path: str | Path,
    kind: ErrorKind = DescriptionError,
    start: str = "`pneudrive catalogue` lists example drives.",
) -> tuple[Plain, str]:
    """Read a TOML file.

    Parameters
    ----------
    path : path-like
        Path of the file.
    kind : type of PneudriveError
        Class of the errors.
    start : str
        Remedy for an empty file.

    Returns
    -------
    dict, str
        The tables and the text.

    Raises
    ------
    PneudriveError
        The file does not exist, or is not readable, empty, binary or not TOML; the message gives file and line.
    """
    path = Path(path)
    if not exists(path):
        first, more, _ = str(path).strip().partition("\n")
        if more:
            what = "the name of a file is needed, but this is a text of several lines"
            raise kind(what, value=first, remedy="Save the text, and name its file.")
        raise kind(f"there is no file {path}", remedy=beside(path))
    text = read_text(path, kind, folder="Name the TOML file inside it.")
    if not text.strip():
        raise kind(f"{path} is empty", remedy=start)
    return parse(text, str(path), kind), text


def tables_in(path: object, *how: Any) -> Plain:  # noqa: ANN401 - for `read`
    """Return the tables of a TOML file, or {} for any other path. Further arguments are those of `read`."""
    if not isinstance(path, str | Path) or Path(path).suffix != ".toml" or not Path(path).is_file():
        return {}
    return read(path, *how)[0]


def parse(text: str, origin: str, kind: ErrorKind = DescriptionError) -> Plain:
    """Read TOML text; `origin` is its name in messages.

    Raises
    ------
    PneudriveError
        The text is not TOML, or is nested too deeply; the message gives the line.
    """
    check_nesting(text, origin, kind)
    try:
        tables = tomllib.loads(text.replace("\r\n", "\n"))
    except tomllib.TOMLDecodeError as error:
        # The parser's message ends with the position. An error at the end of the document gets the last line.
        place = re.search(r"\s*\(at (?:line (\d+), column \d+|end of document)\)", str(error))
        line = max(int(place[1]) if place and place[1] else len(text.splitlines()), 1)
        what = re.sub(r"\s*\(at [^)]*\)", "", str(error))
        what = f"the file is not TOML: {what[:1].lower()}{what[1:]}"
        remedy = 'Write quantities in quotation marks, "25 mm", and each key once in its table.'
        raise kind(what, where=f"{origin}:{line}", value=_line(text, line), remedy=remedy) from None
    except ValueError as error:  # a whole number with thousands of digits
        raise kind(f"the file is not TOML: {error}", where=origin) from None
    check_depth(tables, origin, kind)
    return tables


def _is_dict(value: object) -> bool:
    return isinstance(value, dict)


def is_table(value: object) -> bool:
    """Return whether a value is a table of keys, not a value with its source."""
    return isinstance(value, dict) and not {"value", "source"} & set(value)


def merge(base: Keyed, changes: Keyed, is_inner: Callable[[object], bool] = _is_dict) -> Plain:
    """Merge changes into a base, table by table; a change that is not a table replaces the old value.

    Examples
    --------
    >>> merge({"valve": {"kind": "5/3", "kv": 1.0}}, {"valve": {"kv": 2.0}})
    {'valve': {'kind': '5/3', 'kv': 2.0}}
    """
    out = dict(base)
    for key, value in changes.items():
        old: Any = out.get(key)
        out[key] = merge(old, value, is_inner) if is_inner(old) and is_inner(value) else value
    return out


def leaves(
    table: Any,  # noqa: ANN401 - nested tables, or lists of them
    before: str = "",
    is_inner: Callable[[object], bool] = _is_dict,
) -> Iterator[tuple[str, Any]]:
    """Yield the dotted key and the value of each leaf of nested tables.

    Examples
    --------
    >>> dict(leaves({"valve": {"kv": 2.0}, "name": "x"}))
    {'valve.kv': 2.0, 'name': 'x'}
    """
    for key, value in table.items() if isinstance(table, dict) else enumerate(table):
        if is_inner(value):
            yield from leaves(value, f"{before}{key}.", is_inner)
        else:
            yield f"{before}{key}", value


def above(key: str) -> list[str]:
    """Return a dotted key and the keys of the tables above it, from the inside out."""
    return [key.rsplit(".", depth)[0] for depth in range(key.count(".") + 1)]


def put(tables: Plain, key: str, value: object) -> None:
    """Set the value of a dotted key; missing tables are created."""
    *path, last = key.split(".")
    for table in path:
        tables = tables.setdefault(table, {})
    tables[last] = value


def nested(values: Iterable[tuple[str, Any]]) -> Plain:
    """Return nested tables from values by dotted keys.

    Examples
    --------
    >>> nested([("valve.kv", 1.0), ("name", "x")])
    {'valve': {'kv': 1.0}, 'name': 'x'}
    """
    tables: Plain = {}
    for key, value in values:
        put(tables, key, value)
    return tables


@contextmanager
def locating(path: str | Path, text: str | None, kind: ErrorKind = DescriptionError) -> Iterator[None]:
    """Add the lines of a file to errors raised in the block, and raise them as errors of `kind`; see `located`.

    Without `text`, the errors get no file and no lines.
    """
    try:
        yield
    except DescriptionError as error:
        found = error if text is None else located(error, path, text)
        raise found if kind is DescriptionError else found.turned(kind) from None


def load(
    of: Callable[[Plain], Made],
    path: str | Path,
    kind: ErrorKind = DescriptionError,
    **start: str,
) -> Made:
    """Return ``of(tables)`` for the tables of a TOML file. Errors of `of` also show file and line."""
    tables, text = read(path, kind, **start)
    with locating(path, text, kind):
        return of(tables)


def located(error: DescriptionError, path: str | Path, text: str) -> DescriptionError:
    """Add file and line to an error with a key. An error without a value also gets the text of the line.

    Sub-errors also get their lines, and all errors are sorted by line.
    """
    found: list[tuple[int, DescriptionError]] = []
    for one in (one for one in error.each() if isinstance(one, DescriptionError)):
        if one.where:  # already located in another file
            found.append((0, one))
            continue
        line = line_of(text, one.key) if one.key else None
        value = _line(text, line) if line and one.value is None else one.value
        where = f"{path}:{line}" if line else str(path)
        out = type(one)(one.what, where=where, value=value, rule=one.rule, remedy=one.remedy)
        out.key = one.key
        found.append((line or 0, out))
    return together([one for _, one in sorted(found, key=lambda pair: pair[0])])


def line_of(text: str, key: str) -> int | None:
    r"""Return the line (from 1) of a dotted key, or of its nearest table.

    For an entry of a list of texts, the key ends with the number of the entry, from 0.

    Examples
    --------
    >>> line_of('[cylinder]\nbore = "25 mm"', "cylinder.bore")
    2
    """
    lines = line_numbers(text)
    while key:
        if key in lines:
            return lines[key]
        key = key.rpartition(".")[0]
    return None


def line_numbers(text: str) -> dict[str, int]:
    """Return the line of each key, of each table, and of each text in a list."""
    lines: dict[str, int] = {}
    counts: dict[str, int] = {}
    table = ""
    fence = None  # a multi-line string contains no keys
    texts: tuple[str, int] | None = None  # name of an open list of texts, and the number of its texts so far
    for number, whole in enumerate(text.splitlines(), start=1):
        line = whole[:LONGEST_LINE]
        if fence is not None:
            fence = None if fence in line else fence
            continue
        if texts is not None:
            texts = _texts(line, *texts, number, lines)
            continue
        header, assignment = _HEADER.match(line), _ASSIGNMENT.match(line)
        if header and not assignment:
            table = _dotted(header[1])
            if line.lstrip().startswith("[["):  # entry of an array of tables, with its number
                counts[table] = counts.get(table, -1) + 1
                table = f"{table}.{counts[table]}"
            lines.setdefault(table, number)
        elif assignment:
            name = ".".join(part for part in (table, _dotted(assignment[1])) if part)
            value = assignment[2]
            lines.setdefault(name, number)
            fence = next((mark for mark in ('"""', "'''") if value.count(mark) % 2), None)
            for inner in _INLINE.finditer(value) if value.startswith("{") else ():
                lines.setdefault(f"{name}.{_dotted(inner[1])}", number)
            texts = _texts(value[1:], name, 0, number, lines) if value.startswith("[") else None
    return lines


def _texts(line: str, name: str, count: int, number: int, lines: dict[str, int]) -> tuple[str, int] | None:
    """Store the line of each text in a list; return name and count if the list continues on the next line."""
    for found in _TEXTS.finditer(line):
        if found["end"]:
            return (name, count) if found["end"] == "#" else None
        lines.setdefault(f"{name}.{count}", number)
        count += 1
    return name, count


def write(tables: Plain) -> str:
    """Write plain values and nested tables as TOML; a small inner table of plain values takes one line.

    Examples
    --------
    >>> print(write({"name": "x", "cylinder": {"bore": "25 mm", "dead_volume": {"a": "1 cm3", "b": "1 cm3"}}}))
    name = "x"
    <BLANKLINE>
    [cylinder]
    bore = "25 mm"
    dead_volume = { a = "1 cm3", b = "1 cm3" }
    <BLANKLINE>
    """
    return "\n\n".join(blocks(tables)) + "\n"


def blocks(tables: Plain, name: str = "", inline: int = 0) -> list[str]:
    """Return a table as blocks of TOML text. Inner tables with more than `inline` levels become separate blocks.

    If `inline` is 0, a separate block contains its inner tables of at most two levels inline.
    """
    deep = {key: value for key, value in tables.items() if _depth(value) > inline}
    body = [f"{key_text(key)} = {value_text(value)}" for key, value in tables.items() if key not in deep]
    out = ["\n".join([f"[{name}]", *body] if name else body)] if name or body else []
    for key, value in deep.items():
        out += blocks(value, f"{name}.{key_text(key)}".lstrip("."), 0 if inline else 2)
    return out


def sections(tables: Keyed, name: str = "") -> list[str]:
    """Write tables as lines of TOML, each inner table under a separate header; `name` is already in the form of a key.

    None values are left out.

    Examples
    --------
    >>> print(chr(10).join(sections({"a": 1.0, "b": {"c": True}, "d": [{"e": "f"}]})))
    a = 1.0
    <BLANKLINE>
    [b]
    c = true
    <BLANKLINE>
    [[d]]
    e = "f"
    """

    def is_table(value: object) -> bool:
        return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))

    plain = {key: value for key, value in tables.items() if value is not None and not is_table(value)}
    lines = [f"{key_text(key)} = {value_text(value)}" for key, value in plain.items()]
    for key, value in tables.items():
        if not is_table(value):
            continue
        own = key if not name else f"{name}.{key_text(key)}"
        for table in [value] if isinstance(value, dict) else value:
            lines += ["", f"[{own}]" if isinstance(value, dict) else f"[[{own}]]", *sections(table, own)]
    return lines


def _depth(value: object) -> int:
    return 1 + max(map(_depth, value.values()), default=0) if isinstance(value, dict) else 0


def value_text(value: Any) -> str:  # noqa: ANN401 - any value of TOML
    """Write one value: a boolean, a number (also of NumPy), a text, a list or an inline table."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Integral):
        return str(int(value))
    if isinstance(value, Real):
        return repr(float(value))  # repr: all digits, and nan, inf and -inf as in TOML
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        escaped = re.sub(r"[\x00-\x1f\x7f]", lambda m: f"\\u{ord(m[0]):04x}", escaped)
        return f'"{escaped}"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key_text(k)} = {value_text(v)}" for k, v in value.items()) + " }"
    return "[" + ", ".join(map(value_text, value)) + "]"


def key_text(key: str) -> str:
    """Write a key, in quotes if it needs them."""
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else value_text(key)


def _dotted(name: str) -> str:
    return ".".join(part.strip().strip("\"'") for part in name.split("."))


def _line(text: str, number: int) -> str:
    lines = text.splitlines()
    return lines[number - 1].strip() if 0 < number <= len(lines) else ""


def beside(path: Path) -> str:
    """Return a remedy for a missing file: the TOML files in its folder."""
    folder = path.parent
    if not exists(folder) or not folder.is_dir():
        return f"The folder {folder} does not exist either."
    found = sorted(p.name for p in folder.glob("*.toml"))[:6]
    return f"TOML files in {folder}: {', '.join(found)}." if found else f"There is no TOML file in {folder}."
