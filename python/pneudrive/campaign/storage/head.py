"""The header of a cycle's file, also of a file from another program."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Any

from pneudrive.campaign.cycle import KINDS, Cycle
from pneudrive.errors import CampaignError, nearest
from pneudrive.files.content import parse_json
from pneudrive.rig.plain_data import check_fields, known_fields, plain

SCHEMA = 1


@dataclass(frozen=True)
class Head:
    """Header of a cycle's file: its data other than the samples.

    Attributes
    ----------
    index : int
        Place in the order in which the cycles were run, from 1.
    cycle : Cycle
    began_s : float
        The rig's clock at time zero of the cycle; it shows drift.
    started : str
        Date and time of the computer, ISO 8601 with zone.
    flags : dict
        Counts of faults in the samples on arrival, see `pneudrive.campaign.running.checks`.
    memory : dict
        Snapshot from which a simulated rig continues.
    confirmed : dict
        Person who confirmed the operator's step, and time: ``name``, ``time``, ``how``.
    attempts : int
        Number of starts of the cycle. More than 1 if it was interrupted and repeated.
    reason : str
        Why an adaptive campaign of an earlier version added the cycle.
    sha256 : str
        Hash of the columns, see `pneudrive.campaign.storage.folder.digest`. Empty if the file does not contain one.
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
        """Return the header as JSON."""
        return json.dumps({"schema": SCHEMA, **vars(self), "cycle": self.cycle.to_dict()}, default=plain)


#: Required keys of `cycle`, and those that a kind requires.
REQUIRED = ("kind", "pressure_a_pa", "pressure_b_pa")
REQUIRED_FOR = {
    "sweep": ("speed_m_s",),
    "sentinel": ("speed_m_s",),
    "stop": ("speed_m_s", "stop_s"),
}
POSITIVE = ("pressure_a_pa", "pressure_b_pa", "speed_m_s")


def read_head(text: str, where: str, *, index: int | None = None, key: str = "") -> tuple[Head, list[str]]:
    """Read the header of a cycle, from any program.

    Parameters
    ----------
    text : str
        JSON.
    where : str
        File, for messages.
    index, key : int or None, str
        Values from the file's name, used if the header lacks them.

    Returns
    -------
    Head, list of str
        The header, and notes on unknown keys, which are ignored.

    Raises
    ------
    CampaignError
        If a key is missing or its value is invalid.
    """
    data = parse_json(text, where, CampaignError)
    if not isinstance(data, dict):
        raise CampaignError("this is not a JSON object", where=where)
    check_schema(data.pop("schema", None), where)
    notes = check_fields(data, Head, where, CampaignError)
    inner = data.get("cycle") or {}
    notes += check_fields(inner, Cycle, where, CampaignError, "cycle.")
    head = {"index": index, **known_fields(data, Head)}
    cycle = {"key": key, **known_fields(inner, Cycle)}
    for name in ("key", *REQUIRED, *REQUIRED_FOR.get(cycle.get("kind", ""), ())):
        if cycle.get(name) in (None, ""):
            raise CampaignError(f"cycle.{name} is missing", where=where, rule="each cycle must state it")
    if cycle["kind"] not in KINDS:
        raise CampaignError(
            f"cycle.kind = {cycle['kind']!r} is not known", where=where, remedy=nearest(cycle["kind"], KINDS)
        )
    for name in POSITIVE:
        if name in cycle and not 0.0 < cycle[name] < math.inf:
            rule = "must be positive; pressures are absolute"
            raise CampaignError(f"cycle.{name} = {cycle[name]:g}", where=where, rule=rule)
    if head["index"] is None or head["index"] < 1:
        raise CampaignError(f"index = {head['index']}", where=where, rule="cycles are counted from 1")
    return Head(**{**head, "cycle": Cycle.from_dict(cycle, where)}), notes


def check_schema(version: object, where: str) -> None:
    """Refuse a campaign file whose format this version of pneudrive cannot read.

    Raises
    ------
    CampaignError
    """
    if version is not None and (not isinstance(version, int) or version > SCHEMA):
        raise CampaignError(f"schema = {version!r} is not known", where=where, remedy="Update pneudrive.")
