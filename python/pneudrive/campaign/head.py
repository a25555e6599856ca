"""What a cycle's file says beside its samples, and how it is read where somebody else wrote it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any

from pneudrive.campaign.cycle import KINDS, Cycle
from pneudrive.characterise.force_calibration import ForceCalibration, of_json
from pneudrive.errors import CampaignError, DescriptionError, nearest
from pneudrive.files.content import parse_json
from pneudrive.rig.interface import Hold, Identity, Move, Sampling
from pneudrive.units import LARGEST

SCHEMA = 1


@dataclass(frozen=True)
class Head:
    """What a cycle's file says beside its samples.

    Attributes
    ----------
    index : int
        Place in the order in which the cycles were run, from 1.
    cycle : Cycle
    began_s : float
        The rig's own clock at time zero of the cycle, so that drift can be told.
    started : str
        Date and time of the computer, ISO 8601 with zone.
    flags : dict
        Counts of what was found in the samples on arrival, see `pneudrive.campaign.checks`.
    memory : dict
        What a simulated rig needs to go on from here.
    confirmed : dict
        Who confirmed what the operator was asked to do, and when: ``name``, ``time``, ``how``.
    attempts : int
        How often the cycle was begun; more than 1 where it was interrupted and repeated.
    reason : str
        Why a cycle was run that the protocol does not list.
    sha256 : str
        Of the columns, see `pneudrive.campaign.folder.digest`; empty where the writer did not give it.
    """

    index: int
    cycle: Cycle
    began_s: float = 0.0
    started: str = ""
    flags: dict[str, int] = field(default_factory=dict)
    memory: dict[str, Any] = field(default_factory=dict)
    confirmed: dict[str, str] = field(default_factory=dict)
    attempts: int = 1
    reason: str = ""
    sha256: str = ""

    def to_json(self) -> str:
        """Write the head as a file carries it."""
        return json.dumps({"schema": SCHEMA, **vars(self), "cycle": self.cycle.to_dict()}, default=plain)


def plain(value: Any) -> Any:  # noqa: ANN401 - whatever a rig remembers
    """Give numbers and arrays of numpy as JSON can hold them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not plain data")


#: Keys of `cycle` that must be there, and those that must be there for a kind.
REQUIRED = ("kind", "pressure_a_pa", "pressure_b_pa")
REQUIRED_FOR = {
    "sweep": ("speed_m_s",),
    "sentinel": ("speed_m_s",),
    "stop": ("speed_m_s", "stop_s"),
}
POSITIVE = ("pressure_a_pa", "pressure_b_pa", "speed_m_s")

_NUMBER, _WHOLE, _TEXT, _FLAG, _TABLE, _LIST = (
    "a number",
    "a whole number",
    "text",
    "true or false",
    "a table",
    "a list",
)
_CYCLE_TYPES = {
    "key": _TEXT,
    "kind": _TEXT,
    "steps": _LIST,
    "sampling": _TABLE,
    "pressure_a_pa": _NUMBER,
    "pressure_b_pa": _NUMBER,
    "block": _WHOLE,
    "repeat": _WHOLE,
    "speed_m_s": _NUMBER,
    "stop_s": _NUMBER,
    "released": _FLAG,
    "levels": _TABLE,
    "text": _TEXT,
    "start_m": _NUMBER,
    "weight_kg": _NUMBER,
}
_HEAD_TYPES = {
    "schema": _WHOLE,
    "index": _WHOLE,
    "cycle": _TABLE,
    "began_s": _NUMBER,
    "started": _TEXT,
    "flags": _TABLE,
    "memory": _TABLE,
    "confirmed": _TABLE,
    "attempts": _WHOLE,
    "reason": _TEXT,
    "sha256": _TEXT,
}
_HEAD_FIELDS = {f.name for f in fields(Head)} - {"cycle"}
_IDENTITY_TYPES = {
    "name": _TEXT,
    "area_a_m2": _NUMBER,
    "area_b_m2": _NUMBER,
    "ambient_pressure_pa": _NUMBER,
    "mass_beyond_sensor_kg": _NUMBER,
    "incline_rad": _NUMBER,
    "stiffness_n_m": _NUMBER,
    "accuracy": _TABLE,
    "limits": _TABLE,
    "resolution": _TABLE,
    "bandwidth_hz": _TABLE,
    "calibration": _TABLE,
    "force_calibration": _TABLE,
    "labels": _TABLE,
    "chambers": _TEXT,
    "pressure_measured_at": _TEXT,
    "synthetic": _FLAG,
}
_ENDLESS = (math.inf, -math.inf)  # a rigid rig, a sensor without limits
#: What JSON makes of a value that is right, where nothing else need be asked.
_USUAL = {_WHOLE: int, _TEXT: str, _FLAG: bool, _TABLE: dict, _LIST: list}
_IS = {
    _NUMBER: lambda v: isinstance(v, int | float) and not isinstance(v, bool) and (abs(v) <= LARGEST or v in _ENDLESS),
    _WHOLE: lambda v: isinstance(v, int) and not isinstance(v, bool),
    _TEXT: lambda v: isinstance(v, str),
    _FLAG: lambda v: isinstance(v, bool),
    _TABLE: lambda v: isinstance(v, dict),
    _LIST: lambda v: isinstance(v, list),
}


def read_head(text: str, where: str, *, index: int | None = None, key: str = "") -> tuple[Head, list[str]]:
    """Read the head of a cycle, whoever wrote it.

    Parameters
    ----------
    text : str
        JSON.
    where : str
        File, for messages.
    index, key : int or None, str
        From the file's name: what holds where the head does not say.

    Returns
    -------
    Head, list of str
        The head and notes: keys that were not understood and are ignored.

    Raises
    ------
    CampaignError
        A key is missing or its value has no meaning.
    """
    data = _parse(text, where)
    notes = _check_types(data, _HEAD_TYPES, where, "")
    if (data.get("schema") or SCHEMA) > SCHEMA:
        raise CampaignError(
            f"schema = {data['schema']} is newer than this version reads", where=where, remedy="Update pneudrive."
        )
    inner = {k: v for k, v in (data.get("cycle") or {}).items() if v is not None}
    notes += _check_types(inner, _CYCLE_TYPES, where, "cycle.")
    inner.setdefault("key", key)
    data.setdefault("index", index)
    for name, table, path in (("index", data, ""), ("key", inner, "cycle."), *((n, inner, "cycle.") for n in REQUIRED)):
        if table.get(name) in (None, ""):
            raise CampaignError(f"{path}{name} is missing", where=where, rule="a cycle must say it")
    cycle = _cycle({k: v for k, v in inner.items() if k in _CYCLE_TYPES}, where)
    if data["index"] < 1:
        raise CampaignError(f"index = {data['index']}", where=where, rule="cycles are counted from 1")
    return Head(cycle=cycle, **{k: v for k, v in data.items() if k in _HEAD_FIELDS}), notes


def read_identity(text: str, where: str) -> tuple[Identity, list[str]]:
    """Read ``rig.json``, whoever wrote it; see `read_head`.

    Raises
    ------
    CampaignError
        A key is missing or its value has no meaning.
    """
    data = _parse(text, where)
    notes = _check_types(data, _IDENTITY_TYPES, where, "")
    for name in ("area_a_m2", "area_b_m2"):
        if data.get(name) is None:
            raise CampaignError(f"{name} is missing", where=where, rule="the pistons' areas must be known")
        if not 0.0 < data[name] < math.inf:
            raise CampaignError(f"{name} = {data[name]:g}", where=where, rule="an area is positive")
    known = {k: v for k, v in data.items() if k in _IDENTITY_TYPES and v is not None}
    ranges = known.get("limits", {})
    for channel, pair in ranges.items():
        if not (isinstance(pair, list) and len(pair) == 2 and all(map(_IS[_NUMBER], pair)) and pair[0] < pair[1]):
            raise CampaignError(f"limits.{channel} = {pair}", where=where, rule="[lowest, highest]")
    known["limits"] = {channel: (float(low), float(high)) for channel, (low, high) in ranges.items()}
    for name in ("accuracy", "resolution"):
        for channel, value in known.get(name, {}).items():
            if not _IS[_NUMBER](value) or value < 0.0:
                raise CampaignError(f"{name}.{channel} = {value}", where=where, rule="a number, not negative")
    for channel, value in known.get("bandwidth_hz", {}).items():
        if not _IS[_NUMBER](value) or not 0.0 < value < math.inf:
            raise CampaignError(f"bandwidth_hz.{channel} = {value}", where=where, rule="a frequency is positive")
    known["force_calibration"] = _force_calibration(known.get("force_calibration"), where)
    return Identity(**{"name": "unnamed rig", **known}), notes


def _force_calibration(data: dict[str, Any] | None, where: str) -> ForceCalibration | None:
    try:
        return None if data is None else of_json(data)
    except DescriptionError as error:
        raise CampaignError(error.what, where=where, rule=error.rule, remedy=error.remedy) from None


def _parse(text: str, where: str) -> dict[str, Any]:
    data = parse_json(text, where, CampaignError)
    if not isinstance(data, dict):
        raise CampaignError("this is not a JSON object", where=where)
    return data


def _check_types(data: dict[str, Any], types: dict[str, str], where: str, path: str) -> list[str]:
    numbers = _numbers(path, tuple(data), tuple(map(type, data.values()))) if types is not _IDENTITY_TYPES else None
    if numbers is not None and all(abs(data[name]) <= LARGEST for name in numbers):
        return []
    notes = []
    for name, value in data.items():
        if name not in types:
            notes.append(f"{path}{name} is ignored: there is no such key. {nearest(name, types)}")
        elif value is not None and type(value) is not _USUAL.get(types[name]) and not _IS[types[name]](value):
            raise CampaignError(f"{path}{name} = {json.dumps(value)[:80]}", where=where, rule=f"it is {types[name]}")
    return notes


@lru_cache(maxsize=256)
def _numbers(path: str, names: tuple[str, ...], kinds: tuple[type, ...]) -> tuple[str, ...] | None:
    """Give the names of the numbers in a table of a head, which have a range; None where the table is not as usual.

    The heads of a campaign are alike, and there are many of them: what their types say is asked once.
    """
    types = _CYCLE_TYPES if path else _HEAD_TYPES
    of_number = []
    for name, kind in zip(names, kinds, strict=True):
        if name not in types:
            return None
        if types[name] == _NUMBER and kind in (int, float):
            of_number.append(name)
        elif kind not in (type(None), _USUAL.get(types[name])):
            return None
    return tuple(of_number)


def _cycle(data: dict[str, Any], where: str) -> Cycle:
    kind = data["kind"]
    if kind not in KINDS:
        raise CampaignError(f"cycle.kind = {kind!r} is not known", where=where, remedy=nearest(kind, KINDS))
    for name in REQUIRED_FOR.get(kind, ()):
        if data.get(name) is None:
            raise CampaignError(f"cycle.{name} is missing", where=where, rule=f"a cycle of kind {kind} must say it")
    for name in POSITIVE:
        if name in data and not 0.0 < data[name] < math.inf:
            raise CampaignError(
                f"cycle.{name} = {data[name]:g}", where=where, rule="it is positive; pressures absolute"
            )
    try:
        steps = tuple(Move(**step) if "to_m" in step else Hold(**step) for step in data.pop("steps", []))
        sampling = Sampling(**data.pop("sampling", {}))
    except TypeError as error:
        raise CampaignError(
            "cycle.steps or cycle.sampling has no meaning",
            where=where,
            value=str(error),
            rule="a step has to_m and speed_m_s, or duration_s",
        ) from None
    return Cycle(**{"steps": steps, "sampling": sampling, **data})
