"""Read bytes, text, JSON and pneudrive's CSV, and recognise kinds of files, with one clear message for each error."""

from __future__ import annotations

import bz2
import contextlib
import gzip
import json
import lzma
import math
import os
import re
import stat
import zlib
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from pneudrive.errors import ErrorKind, PneudriveError, package_table
from pneudrive.files.bounds import bound, within

if TYPE_CHECKING:
    import polars as pl


def rendered(
    template: Path,
    filters: Mapping[str, Any],
    clean: Callable | None = None,
    /,
    **values: object,
) -> str:
    """Return the rendered text of a jinja2 template, without the lines of its block tags.

    With `clean`, each value passes through this function, and is then escaped for HTML.
    """
    import jinja2

    options = {"autoescape": clean is not None, "finalize": clean, "keep_trailing_newline": True}
    environment = jinja2.Environment(trim_blocks=True, lstrip_blocks=True, **options)
    environment.filters |= filters
    return environment.from_string(template.read_text(encoding="utf-8")).render(values)


#: Pattern that matches strings and comments of TOML and JSON, to skip them, then nesting characters. An unclosed string
#: ends at the end of the line or of the file, so that each character is read once.
_TOKENS = re.compile(
    r'''"""(?:\\.|[^\\])*?(?:"""|\Z)|"(?:\\.|[^"\\\n])*"?'''
    r"""|'''.*?(?:'''|\Z)|'[^'\n]*'?|\#[^\n]*|[\[\]{}.=,\n]""",
    re.DOTALL,
)
_JSON_TOKENS = re.compile(r'"(?:\\.|[^"\\])*"?|[\[\]{}]', re.DOTALL)

LARGEST_WHOLE = 2**63 - 1  # largest integer in TOML
#: Suffix of a file -> its unpacking function.
COMPRESSIONS: dict[str, Callable[[Path], object]] = {".gz": gzip.open, ".xz": lzma.open, ".bz2": bz2.open}
PIECE = 1 << 22
SMALL = 1e8  # bytes that every machine has; a small file of constants may exceed the usual unpacking factor
#: Whether a file or folder has this name. Unlike `Path.exists`, the result is False for an invalid name.
exists = os.path.exists


def read_bytes(path: Path, kind: ErrorKind, most: str = "text_bytes", folder: str | None = None) -> bytes:
    """Read a whole file, unpacked according to its suffix.

    Parameters
    ----------
    path : Path
    kind : type of PneudriveError
        Class of the errors.
    most : str
        Name of the bound on the size of the file, also when unpacked.
    folder : str, optional
        Text of the remedy if the path is a folder.

    Raises
    ------
    PneudriveError
        The file does not exist, is a folder, a pipe or a device, is not readable, too large, damaged or incomplete.
    """
    size, data = check_file(path, kind, most, folder), bytearray()
    try:
        if path.suffix not in COMPRESSIONS or size == 0:
            with path.open("rb") as file:
                return file.read(size)  # if the file grows meanwhile, only its earlier size is read
        with cast("BinaryIO", COMPRESSIONS[path.suffix](path)) as file:
            while piece := file.read(PIECE):  # a file that unpacks to too much is rejected before it fills the memory
                data += piece
                check_unpacked(len(data), size, kind, str(path))
                within(most, len(data), f"the file unpacks to {len(data):,} bytes or more", kind, str(path))
    except (EOFError, OSError, zlib.error, lzma.LZMAError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise unreadable(path, error, kind) from None
        raise kind(f"the file cannot be decompressed: {error}", where=str(path)) from None
    return bytes(data)


def check_file(path: Path, kind: ErrorKind, most: str = "file_bytes", folder: str | None = None) -> int:
    """Check that a path is a regular file and not too large. Return its size in bytes.

    Raises
    ------
    PneudriveError
        As for `read_bytes`.
    """
    try:
        about = path.stat()
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise unreadable(path, error, kind) from None
    if stat.S_ISDIR(about.st_mode):
        raise kind("this is a folder, but a file is needed", where=str(path), remedy=folder or "Name a file inside it.")
    if not stat.S_ISREG(about.st_mode):
        raise kind("this is a pipe or a device, not a file", where=str(path), remedy="Write its data to a file.")
    within(most, about.st_size, f"the file has {about.st_size:,} bytes", kind, str(path))
    return about.st_size


def unreadable(path: Path, error: OSError | ValueError, kind: ErrorKind) -> PneudriveError:
    """Return the error for an exception of the operating system."""
    if isinstance(error, FileNotFoundError):
        return kind("there is no such file", where=str(path), remedy=similar(path))
    if isinstance(error, PermissionError):
        return kind("the file is not readable: permission denied", where=str(path))
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return kind(f"the file cannot be read: {reason}", where=str(path))


def similar(path: Path) -> str | None:
    """Return a question that proposes the most similar name in the folder of a missing file; None without one."""
    close = get_close_matches(path.name, [one.name for one in path.parent.glob("*")], n=1, cutoff=0.8)
    return f"Did you mean {path.with_name(close[0])}?" if close else None


def read_text(path: Path, kind: ErrorKind, most: str = "text_bytes", folder: str | None = None) -> str:
    """Read a text file in UTF-8 and drop a byte order mark; see `read_bytes`.

    Raises
    ------
    PneudriveError
        As for `read_bytes`; also if the file is binary, or has another encoding (the message gives the line).
    """
    data = read_bytes(path, kind, most, folder)
    if b"\0" in data:
        raise kind("the file is binary, not text", where=str(path), rule="the file must be text in UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise kind("the file is not text in UTF-8", where=f"{path}:{line}") from None


def read_json(path: Path, kind: ErrorKind) -> Any:  # noqa: ANN401 - any content
    """Read a JSON file; see `read_text` and `parse_json`."""
    return parse_json(read_text(path, kind), str(path), kind)


def parse_json(text: str, where: str, kind: ErrorKind) -> Any:  # noqa: ANN401 - any content
    r"""Parse a JSON text.

    Raises
    ------
    PneudriveError
        The text is not JSON, too deeply nested, or too long.

    Examples
    --------
    >>> from pneudrive.errors import CampaignError
    >>> parse_json(r'["\udcff.csv"]', "head", CampaignError)  # the name of a file that is not UTF-8
    ['\udcff.csv']
    """
    within("text_bytes", len(text), f"the text has {len(text):,} characters", kind, where)
    if text.count("[") + text.count("{") > bound("nesting"):
        check_nesting(text, where, kind, _JSON_TOKENS)
    from pydantic_core import from_json

    with contextlib.suppress(ValueError):  # faster, but refuses the names of files that are not UTF-8
        return from_json(text)
    try:
        return json.loads(text)
    except ValueError as error:
        raise kind(f"this is not JSON: {error}", where=where) from None


def check_nesting(text: str, where: str, kind: ErrorKind, tokens: re.Pattern[str] = _TOKENS) -> None:
    """Check the nesting of brackets and dotted keys of a text, TOML by default, before the text is parsed.

    The depth is the number of open brackets plus the number of parts of the dotted key.

    Raises
    ------
    PneudriveError
    """
    most, brackets, parts = bound("nesting"), 0, 0
    for token in tokens.finditer(text):
        sign = token[0]
        if sign == ".":
            parts += 1
        elif sign in "=,\n":
            parts = 0
        elif sign in "[{":
            brackets += 1
        elif sign in "]}":
            brackets = max(brackets - 1, 0)
        if brackets + parts > most:
            what = f"the file is nested deeper than {most:g} levels, at character {token.start() + 1}"
            within("nesting", most + 1, what, kind, where)


def check_depth(value: object, where: str, kind: ErrorKind) -> None:
    """Check the nesting of parsed tables and lists, and the size of their whole numbers.

    Dotted keys add to the depth of brackets. Integers of TOML are limited to 64 bits, but Python's parser accepts
    longer ones.

    Raises
    ------
    PneudriveError
    """
    level, depth = [value], 0
    while level:
        depth += 1
        within("nesting", depth - 1, "the file is nested too deeply", kind, where)
        tables = [value for value in level if isinstance(value, dict | list)]
        for table in tables:
            for key, number in table.items() if isinstance(table, dict) else enumerate(table, start=1):
                if type(number) is int and abs(number) > LARGEST_WHOLE:
                    name = key if isinstance(table, dict) else f"number {key} of a list"
                    digits = round(number.bit_length() * math.log10(2.0))
                    raise kind.of("files.whole-number", where=where, name=name, digits=digits)
        level = [value for table in tables for value in (table.values() if isinstance(table, dict) else table)]


# --- Kinds of folders by the files in them, and of TOML files by their tables.

_TABLE = package_table(__file__, "kinds.toml")
#: Kind of a result folder -> its characteristic files.
FOLDERS: dict[str, list[str]] = _TABLE["folders"]
HEAD = 1 << 16  # bytes of a TOML file that are read to find its kind
#: Kind of a TOML file -> pattern at the beginning of a line.
_KINDS = {kind: re.compile(rf"^[ \t]*(?:{mark})", re.MULTILINE) for kind, mark in _TABLE["files"].items()}


def kind_of_folder(path: Path) -> str:
    """Return the kind of a result folder, such as ``"campaign"``, or an empty text for other folders."""
    return next((kind for kind, names in FOLDERS.items() if all((path / name).is_file() for name in names)), "")


def kind_of_toml(path: Path) -> str:
    """Return the kind of a TOML file: ``"other"`` if it has no known table, ``"unreadable"`` if it cannot be read."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD).decode("utf-8", "replace")
    except OSError:
        return "unreadable"
    return next((kind for kind, mark in _KINDS.items() if mark.search(head)), "other")


# --- Sizes of files after unpacking.


def most_unpacked(packed: int) -> float:
    """Return the largest allowed size after unpacking, in bytes, of a file of `packed` bytes."""
    return min(bound("unpacked_bytes"), max(bound("unpacking_factor") * packed, SMALL))


def check_unpacked(size: int, packed: int, kind: ErrorKind, where: str | None = None) -> None:
    """Reject a file that unpacks to too many bytes.

    Raises
    ------
    PneudriveError
    """
    what = f"the file of {packed:,} bytes unpacks to {size:,} bytes or more"
    within("unpacked_bytes", size, what, kind, where)
    if size > SMALL:
        within("unpacking_factor", size / max(packed, 1), what, kind, where)


# --- CSV files written by pneudrive: names in the first line, commas, decimal points. Foreign CSV needs a layout.

LONGEST_HEADER = 1_000_000  # bytes of the first line: 50,000 names


def spreadsheet_text(text: str) -> str:
    """Return the text of a CSV cell. If a spreadsheet would run the text as a formula ("=A1"), prefix it with '.

    Examples
    --------
    >>> spreadsheet_text("=HYPERLINK(1)"), spreadsheet_text("-1.5"), spreadsheet_text("-1+A1")
    ("'=HYPERLINK(1)", '-1.5', "'-1+A1")
    """
    if not text.startswith(("=", "+", "-", "@", "\t", "\r")):
        return text
    with contextlib.suppress(ValueError):
        float(text)
        return text
    return f"'{text}"


def csv_names(path: Path, kind: ErrorKind) -> list[str]:
    """Return the fields of the first line of a file. They are meaningless for a binary file.

    Raises
    ------
    PneudriveError
        The file does not exist or is too large.
    """
    check_file(path, kind)
    try:
        with path.open("rb") as file:
            line = file.readline(LONGEST_HEADER)
    except OSError as error:
        raise unreadable(path, error, kind) from None
    return [name.strip().strip('"') for name in line.decode("utf-8-sig", errors="replace").split(",")]


def read_csv(
    path: Path, types: Mapping[str, type[pl.DataType]], kind: ErrorKind, wanted: Sequence[str] | None = None
) -> pl.DataFrame:
    """Read columns of a CSV file.

    Parameters
    ----------
    path : Path
    types : mapping
        Types of some columns; polars guesses the others.
    kind : type of PneudriveError
    wanted : sequence of str, optional
        Names of the columns; None: all.

    Raises
    ------
    PneudriveError
        The file or a column does not exist, or fields are not of the column's type.
    """
    import polars as pl

    check_file(path, kind)
    columns = None if wanted is None else list(wanted)
    try:
        return pl.read_csv(path, columns=columns, schema_overrides=dict(types))
    except (OSError, ValueError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise kind("the file cannot be read as CSV", where=str(path), value=reason) from None
