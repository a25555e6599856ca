"""A cycle (the unit that a campaign plans, runs, stores and repeats) and the header of its file."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any

from pydantic import BeforeValidator, StrictBool, StrictInt

from pneudrive.arrays import Pair
from pneudrive.errors import CampaignError, nearest, package_table
from pneudrive.files.content import parse_json
from pneudrive.rig.interface import Number, Positive, Sampling, Texts, WrittenStep, holds, plain, present, read_table

WORDS: dict[str, dict[str, Any]] = package_table(__file__, "words.toml")
#: Purposes of a cycle. The first three are points of a characteristic; the others prepare or check.
KINDS: dict[str, str] = WORDS["kinds"]


@dataclass(frozen=True)
class Cycle:
    """One cycle as planned, or as run (in the header of its file). SI units, absolute pressures.

    Parameters
    ----------
    key : str
        Permanent name of the cycle within its campaign: file name, seed and resume depend on it.
    kind : str
        One of `KINDS`.
    steps : tuple of Move and Hold
        Steps of the axis, in order.
    sampling : Sampling
    pressure_a_pa, pressure_b_pa : float
        Pressures that are set before the cycle and held during it.
    block, repeat : int
        Numbers of the block and of the repeat, from 1.
    speed_m_s : float or None
        Speed of the sweep, or of the restart after the stop.
    stop_s : float or None
        Duration of the stop that the cycle measures.
    released : bool
        Whether the axis is released (moves until the force is zero) during the stop.
    levels : dict
        Hard-to-change factors of the block: mounting, seal, drive.
    text : str
        Instruction to the operator.
    start_m : float or None
        Position of the axis before the first step. The axis moves there without recording.
    weight_kg : float or None
        Mass of the known weight on the force sensor.
    """

    key: str
    kind: str
    steps: tuple[WrittenStep, ...]
    sampling: Annotated[Sampling, BeforeValidator(present)]
    pressure_a_pa: Positive
    pressure_b_pa: Positive
    block: StrictInt = 1
    repeat: StrictInt = 1
    speed_m_s: Positive | None = None
    stop_s: Number | None = None
    released: StrictBool = False
    levels: Texts = field(default_factory=dict)
    text: str = ""
    start_m: Number | None = None
    weight_kg: Number | None = None

    @property
    def pressures_pa(self) -> Pair:
        """Set pressures of chambers a and b."""
        return self.pressure_a_pa, self.pressure_b_pa


SCHEMA = 1


@dataclass(frozen=True)
class Head:
    """Header of a cycle's file: all data of the cycle except the samples.

    Attributes
    ----------
    index : int
        Running number of the cycle, from 1.
    cycle : Cycle
    began_s : float
        Time of the rig's clock at the start of the cycle, in s. The analysis of drift uses it.
    started : str
        Date and time of the computer, ISO 8601 with zone.
    flags : dict
        Counts of faults that were found when the samples arrived, see `pneudrive.campaign.running.attempt`.
    memory : dict
        Snapshot from which a simulated rig continues.
    confirmed : dict
        Person who confirmed the operator's step, and time: ``name``, ``time``, ``how``.
    attempts : int
        Number of starts of the cycle. More than 1 if it was interrupted and repeated.
    reason : str
        Reason for a cycle that an adaptive campaign added (earlier versions of pneudrive only).
    sha256 : str
        Hash of the columns, see `pneudrive.campaign.storage.folder.digest`. Empty if the file does not contain one.
    """

    index: Annotated[StrictInt, holds("cycles are counted from 1", lambda index: index >= 1)]
    cycle: Cycle
    began_s: Number = 0.0
    started: str = ""
    flags: dict[str, StrictInt] = field(default_factory=dict)
    memory: dict[str, Any] = field(default_factory=dict)
    confirmed: Texts = field(default_factory=dict)
    attempts: StrictInt = 1
    reason: str = ""
    sha256: str = ""

    def to_json(self) -> str:
        """Return the header as JSON."""
        return json.dumps({"schema": SCHEMA, **asdict(self)}, default=plain)


#: Keys required for each kind of cycle.
REQUIRED_FOR = {"sweep": ("speed_m_s",), "sentinel": ("speed_m_s",), "stop": ("speed_m_s", "stop_s")}


def read_head(text: str, where: str, index: int | None = None, key: str = "") -> tuple[Head, list[str]]:
    """Read the header of a cycle, written by pneudrive or by another program.

    Parameters
    ----------
    text : str
        JSON.
    where : str
        File, for messages.
    index, key : int or None, str
        Values from the file's name. They replace values that the header does not contain.

    Returns
    -------
    Head, list of str
        The header, and notes on unknown keys, which are ignored.

    Raises
    ------
    CampaignError
        If a key is missing or its value is invalid.
    """
    data = present(parse_json(text, where, CampaignError))
    if isinstance(data, dict):
        check_schema(data.pop("schema", None), where)
        usual = {"key": key, "steps": (), "sampling": Sampling()}
        data["cycle"], notes = read_table(data.get("cycle", {}), Cycle, where, CampaignError, "cycle.", **usual)
        cycle: Cycle = data["cycle"]
        for name in ("key", *REQUIRED_FOR.get(cycle.kind, ())):
            if getattr(cycle, name) in (None, ""):
                raise CampaignError(f"cycle.{name} is missing", where=where, rule="cycles of this kind need this key")
        if cycle.kind not in KINDS:
            remedy = nearest(cycle.kind, KINDS)
            raise CampaignError(f"cycle.kind = {cycle.kind!r} is not known", where=where, remedy=remedy)
    else:
        notes = []
    head, head_notes = read_table(data, Head, where, CampaignError, index=index)
    return head, head_notes + notes


def check_schema(version: object, where: str) -> None:
    """Reject a campaign file whose format this version of pneudrive cannot read.

    Raises
    ------
    CampaignError
    """
    if version is not None and (not isinstance(version, int) or version > SCHEMA):
        raise CampaignError(f"schema = {version!r} is not known", where=where, remedy="Update pneudrive.")
