"""What a cycle's file says beside its samples, and how it is read where somebody else wrote it."""

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


#: Keys of `cycle` that must be there, and those that must be there for a kind.
REQUIRED = ("kind", "pressure_a_pa", "pressure_b_pa")
REQUIRED_FOR = {
    "sweep": ("speed_m_s",),
    "sentinel": ("speed_m_s",),
    "stop": ("speed_m_s", "stop_s"),
}
POSITIVE = ("pressure_a_pa", "pressure_b_pa", "speed_m_s")


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
            raise CampaignError(f"cycle.{name} is missing", where=where, rule="a cycle must say it")
    if cycle["kind"] not in KINDS:
        raise CampaignError(
            f"cycle.kind = {cycle['kind']!r} is not known", where=where, remedy=nearest(cycle["kind"], KINDS)
        )
    for name in POSITIVE:
        if name in cycle and not 0.0 < cycle[name] < math.inf:
            rule = "it is positive; pressures absolute"
            raise CampaignError(f"cycle.{name} = {cycle[name]:g}", where=where, rule=rule)
    if head["index"] is None or head["index"] < 1:
        raise CampaignError(f"index = {head['index']}", where=where, rule="cycles are counted from 1")
    return Head(**{**head, "cycle": Cycle.from_dict(cycle, where)}), notes


def check_schema(version: object, where: str) -> None:
    """Refuse a file of a campaign that is in a format which this version of pneudrive does not read.

    Raises
    ------
    CampaignError
    """
    if version is not None and (not isinstance(version, int) or version > SCHEMA):
        raise CampaignError(f"schema = {version!r} is not known", where=where, remedy="Update pneudrive.")
