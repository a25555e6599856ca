"""Conversion of plain data from JSON to the classes of a rig, with a check of each value against its field."""

from __future__ import annotations

import math
from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING, Any

from pneudrive.errors import DescriptionError, PneudriveError, RigError, nearest
from pneudrive.rig.interface import Envelope, Identity
from pneudrive.signals.force_calibration import of_json
from pneudrive.units import LARGEST

if TYPE_CHECKING:
    from collections.abc import Callable


def plain(value: Any) -> Any:  # noqa: ANN401 - any plain data
    """Convert numbers and arrays of NumPy to plain data for JSON."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not plain data")


def is_number(value: object) -> bool:
    """Return whether a value is a number but not NaN. Infinity is valid for a rigid rig or a sensor without limits."""
    return type(value) in (int, float) and (abs(value) <= LARGEST or abs(value) == math.inf)  # type: ignore[arg-type]


def _is_pair(value: object) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


#: Annotation of a field -> rule of its JSON value in words, and its check; others are tables.
_RULES: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "float": ("a number", is_number),
    "int": ("a whole number", lambda value: type(value) is int),
    "str": ("text", lambda value: type(value) is str),
    "bool": ("true or false", lambda value: type(value) is bool),
    "tuple[float, float]": ("a list of two numbers", _is_pair),
    "tuple": ("a list", lambda value: type(value) is list),
    "list": ("a list", lambda value: type(value) is list),
}
_TABLE = ("a table", lambda value: type(value) is dict)


@cache
def _rules(cls: type) -> dict[str, tuple[str, Callable[[Any], bool]]]:
    """Return the rule of each field of a dataclass from its annotation."""
    kinds = {field.name: str(field.type).partition(" |")[0] for field in fields(cls)}
    return {name: _RULES.get(kind) or _RULES.get(kind.partition("[")[0], _TABLE) for name, kind in kinds.items()}


def read_fields(
    data: Any,  # noqa: ANN401 - JSON
    cls: type,
    where: str,
    kind: type[PneudriveError],
    path: str = "",
) -> tuple[dict[str, Any], list[str]]:
    """Check a table against the fields of its class.

    Parameters
    ----------
    data : dict
        Data from JSON; null counts as absent.
    cls : type
        Dataclass with annotations as texts.
    where : str
        File, for messages.
    kind : type of PneudriveError
    path : str
        Prefix of names in messages.

    Returns
    -------
    dict, list of str
        The known fields that are not null, and notes on unknown keys, which are ignored.

    Raises
    ------
    PneudriveError
        The data are not a table, or a value is of another type.
    """
    if not isinstance(data, dict):
        raise kind("this is not a JSON object", where=where)
    rules, known, notes = _rules(cls), dict[str, Any](), []
    for name, value in data.items():
        if name not in rules:
            notes.append(f"{path}{name} is ignored, as it is not a known key. {nearest(name, rules)}")
        elif value is not None:
            words, holds = rules[name]
            if not holds(value):
                raise kind(f"{path}{name} = {value!r:.80}", where=where, rule=f"the value is {words}")
            known[name] = value
    return known, notes


def identity_of(data: Any, where: str, kind: type[PneudriveError] = RigError) -> tuple[Identity, list[str]]:  # noqa: ANN401 - JSON
    """Return the identity of a rig from plain data.

    Returns
    -------
    Identity, list of str
        Identity, and notes as from `read_fields`.

    Raises
    ------
    PneudriveError
        A key is missing or its value is not valid.
    """
    known, notes = read_fields(data, Identity, where, kind)
    known = {"name": "unnamed rig", **known}
    for name in ("area_a_m2", "area_b_m2"):
        if name not in known:
            raise kind(f"{name} is missing", where=where, rule="the pistons' areas must be known")
        if not 0.0 < known[name] < math.inf:
            raise kind(f"{name} = {known[name]:g}", where=where, rule="an area is positive")
    for name, (rule, holds) in _CHANNELS.items():
        for channel, value in known.get(name, {}).items():
            if not holds(value):
                raise kind(f"{name}.{channel} = {value}", where=where, rule=rule)
    known["limits"] = {channel: (float(low), float(high)) for channel, (low, high) in known.get("limits", {}).items()}
    try:
        curve = known.get("force_calibration")
        known["force_calibration"] = None if curve is None else of_json(curve)
    except DescriptionError as error:
        raise kind(error.what, where=where, rule=error.rule, remedy=error.remedy) from None
    return Identity(**known), notes


#: Tables of an identity by channel: rule of their values, and its check.
_CHANNELS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "limits": ("[lowest, highest]", lambda value: _is_pair(value) and value[0] < value[1]),
    "accuracy": ("a number, not negative", lambda value: is_number(value) and value >= 0.0),
    "resolution": ("a number, not negative", lambda value: is_number(value) and value >= 0.0),
    "bandwidth_hz": ("a frequency is positive", lambda value: is_number(value) and 0.0 < value < math.inf),
}


def envelope_of(data: Any, where: str, kind: type[PneudriveError] = RigError) -> Envelope:  # noqa: ANN401 - JSON
    """Return the envelope of a rig from plain data.

    Raises
    ------
    PneudriveError
        The data are not an envelope.
    """
    if not isinstance(data, dict):
        raise kind("the rig's envelope is not valid", where=where, value=data, rule="a table")
    known, _ = read_fields(data, Envelope, where, kind)
    try:
        return Envelope(**{name: tuple(value) if isinstance(value, list) else value for name, value in known.items()})
    except TypeError as error:
        raise kind("the rig's envelope is not valid", where=where, value=str(error)) from None
