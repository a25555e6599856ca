"""Every value of a drive or a circuit in one list, each with its source."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from pneudrive.describe.base import inline
from pneudrive.describe.files.toml import above, leaves

if TYPE_CHECKING:
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive

_BESIDE = ("schema", "name", "labels", "provenance", "connections", "plugged", "junctions", "initial")


class DescribedValue(NamedTuple):
    """One value of a description.

    Attributes
    ----------
    key : str
        Dotted key, in the form for `replace`.
    value : object
        Value as users write it: ``"25 mm"``, a number or a word.
    origin : str
        Source in words. Empty if the user gave the value without a source.
    kind : str
        ``"given"``, ``"source"``, ``"identified"``, ``"assumed"`` or ``"default"``.
    """

    key: str
    value: Any
    origin: str
    kind: str


def values_of(described: Drive | Circuit) -> list[DescribedValue]:
    """Return every value of a drive or a circuit, including defaults, in the order of the file.

    Examples
    --------
    >>> from pneudrive.describe.drive import Drive
    >>> found = {one.key: one for one in values_of(Drive.load("catalogue:starter"))}
    >>> found["cylinder.bore"].value, found["cylinder.bore"].kind, found["load.mass"].kind
    ('25 mm', 'source', 'default')
    """
    lines = (line.partition(" = ") for line in described.assumed())
    assumed = {
        described.key_prefix + key: reason.partition(", ")[2] or "usual"
        for key, equals, reason in lines
        if equals and " " not in key
    }
    origins = described.origin_of
    identified = getattr(described, "provenance", None) or {}
    # With the tables above each one. A custom law is a table where the defaults have its name.
    given = {one for key, _ in leaves(described.to_dict()) for one in above(key)}
    out = []
    for key, value in leaves(described.with_defaults()):
        if key.partition(".")[0] in _BESIDE:
            continue
        source = next((origins[one] for one in above(key) if one in origins), None)
        if key in identified:
            origin, kind = f"identified: {inline(identified[key].to_dict())}", "identified"
        elif source is not None:
            origin, kind = source.said, "assumed" if source.source is None else "source"
        elif key in assumed:
            origin, kind = assumed[key], "assumed"
        else:
            origin, kind = "", "given" if key in given else "default"
        out.append(DescribedValue(key, value, origin, kind))
    return out
