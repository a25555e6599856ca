"""Conversion of plain data from JSON to the classes of a rig, with a check of each value against its field."""

from __future__ import annotations

import math
from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

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
    return type(value) in (int, float) and (abs(value) <= LARGEST or math.isinf(value))  # type: ignore[arg-type]


class Rule(NamedTuple):
    """Rule for the JSON value of a field."""

    words: str
    holds: Callable[[object], bool]


_TABLE = Rule("a table", lambda value: type(value) is dict)
_RULES = {
    "float": Rule("a number", is_number),
    "int": Rule("a whole number", lambda value: type(value) is int),
    "str": Rule("text", lambda value: type(value) is str),
    "bool": Rule("true or false", lambda value: type(value) is bool),
    "tuple": Rule("a list", lambda value: type(value) is list),
    "list": Rule("a list", lambda value: type(value) is list),
}


@cache
def _rules(cls: type) -> dict[str, Rule]:
    """Return the rule of each field of a dataclass from its annotation; the default is a table."""
    return {
        field.name: _RULES.get(str(field.type).partition("[")[0].partition(" |")[0], _TABLE) for field in fields(cls)
    }


def check_fields(data: dict[str, Any], cls: type, where: str, kind: type[PneudriveError], path: str = "") -> list[str]:
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
    list of str
        Notes on unknown keys, which are ignored.

    Raises
    ------
    PneudriveError
        A value is of another type.
    """
    rules, notes = _rules(cls), []
    for name, value in data.items():
        rule = rules.get(name)
        if rule is None:
            notes.append(f"{path}{name} is ignored, as it is not a known key. {nearest(name, rules)}")
        elif value is not None and not rule.holds(value):
            raise kind(f"{path}{name} = {value!r:.80}", where=where, rule=f"the value is {rule.words}")
    return notes


def known_fields(data: dict[str, Any], cls: type) -> dict[str, Any]:
    """Return the table without null values and unknown keys."""
    rules = _rules(cls)
    return {name: value for name, value in data.items() if name in rules and value is not None}


def identity_of(data: Any, where: str, kind: type[PneudriveError] = RigError) -> tuple[Identity, list[str]]:  # noqa: ANN401 - JSON
    """Return the identity of a rig from plain data.

    Returns
    -------
    Identity, list of str
        Identity, and notes as from `check_fields`.

    Raises
    ------
    PneudriveError
        A key is missing or its value is not valid.
    """
    if not isinstance(data, dict):
        raise kind("this is not a JSON object", where=where)
    notes = check_fields(data, Identity, where, kind)
    known: dict[str, Any] = {"name": "unnamed rig", **known_fields(data, Identity)}
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


def _is_range(value: object) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value)) and value[0] < value[1]


#: Tables of an identity by channel: rule of their values, and its check.
_CHANNELS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "limits": ("[lowest, highest]", _is_range),
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
    check_fields(data, Envelope, where, kind)
    known: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in known_fields(data, Envelope).items()}
    try:
        return Envelope(**known)
    except TypeError as error:
        raise kind("the rig's envelope is not valid", where=where, value=str(error)) from None
