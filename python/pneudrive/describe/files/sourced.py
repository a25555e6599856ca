"""Values with their origin: ``{ value = "25 mm", source = "..." }``, or ``assumed = "reason"``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pneudrive.describe.files import toml
from pneudrive.errors import invalid

if TYPE_CHECKING:
    from collections.abc import Mapping

    from typing_extensions import TypeIs

    from pneudrive.arrays import Keyed, Plain

_KEYS = ("value", "source", "assumed", "note")


@dataclass(frozen=True)
class Value:
    """Value with its origin.

    Parameters
    ----------
    key : str
        Dotted key in its table.
    value : object
        Value as written in a description.
    source : str or None
        Key of references.bib, or the source in words.
    assumed : str or None
        Reason for an assumed value, which has no source.
    note : str
        Derivation of the value, if the source does not state it directly.
    """

    key: str
    value: Any
    source: str | None
    assumed: str | None
    note: str = ""

    @property
    def origin(self) -> dict[str, str]:
        """Origin of the value as a table."""
        said = {"source": self.source, "assumed": self.assumed, "note": self.note}
        return {key: text for key, text in said.items() if text}

    @property
    def said(self) -> str:
        """Origin of the value in words."""
        if self.source is None:
            return f"assumed: {self.assumed}"
        return f"[{self.source}]" + (f" {self.note}" if self.note else "")


def has_origin(given: Any) -> TypeIs[Plain]:  # noqa: ANN401
    """Return whether a table is a value with its origin."""
    return isinstance(given, dict) and "value" in given and set(given) <= set(_KEYS)


def is_inner(given: Any) -> TypeIs[Plain]:  # noqa: ANN401
    """Return whether a value is a table, but not a value with its origin."""
    return isinstance(given, dict) and not has_origin(given)


def read(key: str, given: object) -> Value:
    """Read a table ``{ value, source | assumed, note }``.

    Raises
    ------
    DescriptionError
        The value has neither a source nor a reason, or both.
    """
    table = given if isinstance(given, dict) else {}
    origins = [word for word in ("source", "assumed") if word in table]
    are_texts = all(isinstance(table.get(word, ""), str) for word in _KEYS[1:])
    if not has_origin(given) or len(origins) != 1 or not are_texts:
        how = "both a source and a reason" if len(origins) == 2 else "neither a source nor a reason"
        raise invalid(key, "describe.origin", key=key, how=how)
    return Value(key, table["value"], table.get("source"), table.get("assumed"), table.get("note", ""))


def parted(table: Keyed) -> tuple[Plain, dict[str, Value]]:
    """Return the plain values of a table, and a dict from dotted keys to the values that have an origin.

    Raises
    ------
    DescriptionError
        A value has both a source and a reason, or neither.

    Examples
    --------
    >>> values, origins = parted({"friction": {"coulomb": {"value": "9 N", "assumed": "a guess"}}, "bore": "25 mm"})
    >>> values, origins["friction.coulomb"].assumed
    ({'friction': {'coulomb': '9 N'}, 'bore': '25 mm'}, 'a guess')
    """
    leaves = toml.leaves(table, is_inner=is_inner)
    return plain(table), {key: read(key, given) for key, given in leaves if has_origin(given)}


def plain(given: Any) -> Any:  # noqa: ANN401 - any kind of value
    """Return a value or a table without origins."""
    if has_origin(given):
        return given["value"]
    return {key: plain(one) for key, one in given.items()} if isinstance(given, dict) else given


def put_back(table: Plain, origins: Mapping[str, Value]) -> Plain:
    """Add origins to the values of a table. Origins without a value in the table are dropped."""
    for dotted, value in origins.items():
        *path, last = dotted.split(".")
        at: Any = table
        for key in path:
            at = at.get(key) if isinstance(at, dict) else None
        if isinstance(at, dict) and last in at and last != "kind":
            at[last] = {"value": at[last]} | value.origin
    return table
