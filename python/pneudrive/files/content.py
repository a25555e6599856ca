"""Bytes and text of a file, and JSON: each with its bounds and with one clear message where it is wrong."""

from __future__ import annotations

import contextlib
import json
import re
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.files.bounds import bound, within

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pneudrive.errors import PneudriveError

#: Texts and comments of TOML and texts of JSON, in which no sign has a meaning; then the signs that nest.
#: A text without its end goes to the end of the line, or of the file: nothing is looked at twice.
_TOKENS = re.compile(
    r'''"""(?:\\.|[^\\])*?(?:"""|\Z)|"(?:\\.|[^"\\\n])*"?'''
    r"""|'''.*?(?:'''|\Z)|'[^'\n]*'?|\#[^\n]*|[\[\]{}.=,\n]""",
    re.DOTALL,
)
_JSON_TOKENS = re.compile(r'"(?:\\.|[^"\\])*"?|[\[\]{}]', re.DOTALL)


def read_bytes(path: Path, kind: type[PneudriveError], most: str = "text_bytes", folder: str | None = None) -> bytes:
    """Read a whole file.

    Parameters
    ----------
    path : Path
    kind : type of PneudriveError
        What to raise.
    most : str
        The bound of its size.
    folder : str, optional
        What to do where the path is a folder.

    Raises
    ------
    PneudriveError
        There is no such file, it is a folder, a pipe or a device, may not be read, or is too large.
    """
    try:
        size = check_file(path, kind, most, folder)
        with path.open("rb") as file:
            data = file.read(size + 1)
    except OSError as error:
        raise unreadable(path, error, kind) from None
    if len(data) > size:
        raise kind("the file grows while it is read", where=str(path), remedy="Copy it, then read the copy.")
    return data


def check_file(path: Path, kind: type[PneudriveError], most: str = "file_bytes", folder: str | None = None) -> int:
    """Refuse what is no file or too large, before anything is read; return the size in bytes.

    Raises
    ------
    PneudriveError
        As `read_bytes`.
    """
    try:
        about = path.stat()
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise unreadable(path, error, kind) from None
    if stat.S_ISDIR(about.st_mode):
        raise kind("a folder stands where a file is needed", where=str(path), remedy=folder or "Name a file inside it.")
    if not stat.S_ISREG(about.st_mode):
        raise kind("this is a pipe or a device, not a file", where=str(path), remedy="Write it to a file first.")
    within(most, about.st_size, f"the file has {about.st_size:,} bytes", kind, str(path))
    return about.st_size


def exists(path: Path) -> bool:
    """Whether anything has this name; a name that the system does not take is none."""
    try:
        return path.exists()
    except (OSError, ValueError):  # longer than names can be; a null character
        return False


def unreadable(path: Path, error: OSError | ValueError, kind: type[PneudriveError]) -> PneudriveError:
    """Make the message of what the operating system refuses."""
    if isinstance(error, FileNotFoundError):
        return kind("there is no such file", where=str(path))
    if isinstance(error, PermissionError):
        return kind("the file may not be read", where=str(path))
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return kind(f"the file cannot be read: {reason}", where=str(path))


def text_of(data: bytes, where: str, kind: type[PneudriveError]) -> str:
    """Give the text of a file in UTF-8, without the mark that Windows puts in front.

    Raises
    ------
    PneudriveError
        It is binary, or in another encoding; the message names the line.
    """
    if b"\0" in data:
        raise kind("the file is binary, not text", where=where, rule="text in UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise kind("the file is not text in UTF-8", where=f"{where}:{line}") from None


def read_text(path: Path, kind: type[PneudriveError], most: str = "text_bytes", folder: str | None = None) -> str:
    """Read a text file in UTF-8; see `read_bytes` and `text_of`."""
    return text_of(read_bytes(path, kind, most, folder), str(path), kind)


def read_json(path: Path, kind: type[PneudriveError]) -> Any:  # noqa: ANN401 - whatever the file holds
    """Read a JSON file; see `read_text` and `parse_json`."""
    return parse_json(read_text(path, kind), str(path), kind)


def parse_json(text: str, where: str, kind: type[PneudriveError]) -> Any:  # noqa: ANN401 - whatever it holds
    """Read JSON.

    Raises
    ------
    PneudriveError
        It is not JSON, nested too deep, or too long.
    """
    within("text_bytes", len(text), f"the text has {len(text):,} characters", kind, where)
    if text.count("[") + text.count("{") > bound("nesting"):
        _check_depth(_depths(_JSON_TOKENS.finditer(text)), kind, where)
    from pydantic_core import from_json

    with contextlib.suppress(ValueError):  # it is faster, and refuses a little more: the other one decides
        return from_json(text)
    try:
        return json.loads(text)
    except ValueError as error:
        raise kind(f"this is not JSON: {error}", where=where) from None


def check_nesting(text: str, where: str, kind: type[PneudriveError]) -> None:
    """Refuse TOML whose brackets nest too deep or whose keys have too many parts, before it is parsed.

    Raises
    ------
    PneudriveError
    """
    _check_depth(_depths(_TOKENS.finditer(text)), kind, where)


def _depths(tokens: Iterable[re.Match[str]]) -> Iterable[tuple[int, int]]:
    """Give depth and place of each sign: open brackets, and the parts of the key before it."""
    brackets = parts = 0
    for token in tokens:
        sign = token[0]
        if sign == ".":
            parts += 1
        elif sign in "=,\n":
            parts = 0
        elif sign in "[{":
            brackets += 1
        elif sign in "]}":
            brackets = max(brackets - 1, 0)
        yield brackets + parts, token.start()


def _check_depth(depths: Iterable[tuple[int, int]], kind: type[PneudriveError], where: str) -> None:
    most = bound("nesting")
    deep = next((place for depth, place in depths if depth > most), None)
    if deep is not None:
        what = f"the file is nested deeper than {most:g} levels, at character {deep + 1}"
        within("nesting", most + 1, what, kind, where)


def check_depth(value: object, where: str, kind: type[PneudriveError]) -> None:
    """Refuse parsed tables and lists that nest too deep: keys with many parts multiply with brackets.

    Raises
    ------
    PneudriveError
    """
    level, depth = [value], 0
    while level:
        depth += 1
        within("nesting", depth - 1, "the file is nested too deep", kind, where)
        inner = [v.values() if isinstance(v, dict) else v for v in level if isinstance(v, dict | list)]
        level = [v for values in inner for v in values]
