"""Errors that carry the key of a wrong value, from which the reader of a file finds its line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.errors import DescriptionError, together

if TYPE_CHECKING:
    from collections.abc import Callable


class WrongValueError(DescriptionError):
    """Invalid value of a field; `Described` adds the field's name."""

    def __init__(self, what: str, rule: str | None = None, remedy: str | None = None, sub: str = "") -> None:
        super().__init__(what, rule=rule, remedy=remedy)
        self.key = sub or None


def wrong(key: str, what: str, *, rule: str | None = None, remedy: str | None = None) -> DescriptionError:
    """Return an error for one key; the reader of the file finds the line by ``error.key``."""
    error = DescriptionError(what, rule=rule, remedy=remedy)
    error.key = key
    return error


def invalid(key: str, message: str, /, **values: object) -> DescriptionError:
    """Return an error for one key with a message of ``messages.toml``; see `PneudriveError.of`."""
    error = DescriptionError.of(message, **values)
    error.key = key
    return error


def within(
    error: DescriptionError, name: str, above: str = "", written: Callable[[str], str] = str
) -> DescriptionError:
    """Return errors of a table as errors of the table that contains it.

    Parameters
    ----------
    error : DescriptionError
        Error, with those that it carries.
    name : str
        Key of the table, and its name in messages.
    above : str
        Prefix of the key, but not of the message: a table that messages need not name.
    written : callable
        Key of an error -> key as the user wrote it.
    """
    out = []
    for one in error.each():
        key = getattr(one, "key", None) or ""
        what = f"{name}.{one.what}" if key and one.what.startswith(key) else f"{name}: {one.what}"
        out.append(wrong(f"{above}{name}.{written(key)}".rstrip("."), what, rule=one.rule, remedy=one.remedy))
    return together(out)
