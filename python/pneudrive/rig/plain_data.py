"""Plain data, as JSON holds them, become the classes of a rig again: each value is held against its field."""

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


def plain(value: Any) -> Any:  # noqa: ANN401 - whatever a rig remembers
    """Give numbers and arrays of numpy as JSON can hold them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not plain data")


def is_number(value: object) -> bool:
    """Whether it is a number that calculations can take; a rigid rig and a sensor without limits have endless ones."""
    return type(value) in (int, float) and (abs(value) <= LARGEST or math.isinf(value))  # type: ignore[arg-type]


class Rule(NamedTuple):
    """What JSON must make of a field."""

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
    """Give the rule of each field of a dataclass by its annotation: a table where nothing else is said."""
    return {
        field.name: _RULES.get(str(field.type).partition("[")[0].partition(" |")[0], _TABLE) for field in fields(cls)
    }


def check_fields(data: dict[str, Any], cls: type, where: str, kind: type[PneudriveError], path: str = "") -> list[str]:
    """Hold a table against the fields of the class that it is to become.

    Parameters
    ----------
    data : dict
        From JSON; a value that is null counts as absent.
    cls : type
        A dataclass whose annotations are texts.
    where : str
        File, for messages.
    kind : type of PneudriveError
    path : str
        What stands before the names in messages.

    Returns
    -------
    list of str
        Notes: keys that were not understood and are ignored.

    Raises
    ------
    PneudriveError
        A value is of another type.
    """
    rules, notes = _rules(cls), []
    for name, value in data.items():
        rule = rules.get(name)
        if rule is None:
            notes.append(f"{path}{name} is ignored: there is no such key. {nearest(name, rules)}")
        elif value is not None and not rule.holds(value):
            raise kind(f"{path}{name} = {value!r:.80}", where=where, rule=f"it is {rule.words}")
    return notes


def known_fields(data: dict[str, Any], cls: type) -> dict[str, Any]:
    """Leave out what is null, and what is no field of the class."""
    rules = _rules(cls)
    return {name: value for name, value in data.items() if name in rules and value is not None}


def identity_of(data: Any, where: str, kind: type[PneudriveError] = RigError) -> tuple[Identity, list[str]]:  # noqa: ANN401 - JSON
    """Take back the identity of a rig, whoever wrote it.

    Returns
    -------
    Identity, list of str
        And notes, see `check_fields`.

    Raises
    ------
    PneudriveError
        A key is missing or its value has no meaning.
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


#: Tables of an identity by channel: the rule of their values, and whether one keeps it.
_CHANNELS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "limits": ("[lowest, highest]", _is_range),
    "accuracy": ("a number, not negative", lambda value: is_number(value) and value >= 0.0),
    "resolution": ("a number, not negative", lambda value: is_number(value) and value >= 0.0),
    "bandwidth_hz": ("a frequency is positive", lambda value: is_number(value) and 0.0 < value < math.inf),
}


def envelope_of(data: Any, where: str, kind: type[PneudriveError] = RigError) -> Envelope:  # noqa: ANN401 - JSON
    """Take back the envelope of a rig.

    Raises
    ------
    PneudriveError
        It is something else.
    """
    if not isinstance(data, dict):
        raise kind("the rig's envelope is not one", where=where, value=data, rule="a table")
    check_fields(data, Envelope, where, kind)
    known: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in known_fields(data, Envelope).items()}
    try:
        return Envelope(**known)
    except TypeError as error:
        raise kind("the rig's envelope is not one", where=where, value=str(error)) from None
