"""A cycle: the unit that a campaign plans, runs, stores and repeats, and the header of its file."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from typing import Any

from pneudrive.errors import CampaignError, nearest
from pneudrive.files.content import parse_json
from pneudrive.rig.interface import Hold, Move, Sampling, Step, plain, read_fields

#: Purposes of a cycle. The first three are points of a characteristic; the others prepare or check.
KINDS = {
    "sweep": "out and back at one speed",
    "stop": "a stop in the middle of a move, after preconditioning strokes",
    "sentinel": "the reference speed, repeated to show drift",
    "warm-up": "strokes that bring rig and seal to a steady state",
    "tare": "standing, force released: the zero of the force sensor",
    "blank": "a slow stroke before a block, to be compared with the slow stroke after it",
    "leak": "standing under pressure, supply shut: the fall of pressure",
    "weight": "at rest under a known weight: gives the gain of the force sensor",
    "operator": "a change by hand (mounting, seal, drive) and its confirmation",
}


@dataclass(frozen=True)
class Cycle:
    """One cycle as planned, or as run in the header of its file. SI units, absolute pressures.

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
        Set before the cycle, and held.
    block, repeat : int
        Counted from 1.
    speed_m_s : float or None
        The speed that the cycle is for: of a sweep, of the restart after a stop.
    stop_s : float or None
        Duration of the stop that the cycle is for.
    released : bool
        Whether the force is released during that stop.
    levels : dict
        Hard-to-change factors of the block: mounting, seal, drive.
    text : str
        Instruction to the operator.
    start_m : float or None
        Position of the axis before the first step. The axis moves there without recording.
    weight_kg : float or None
        The known weight that is applied.
    """

    key: str
    kind: str
    steps: tuple[Step, ...]
    sampling: Sampling
    pressure_a_pa: float
    pressure_b_pa: float
    block: int = 1
    repeat: int = 1
    speed_m_s: float | None = None
    stop_s: float | None = None
    released: bool = False
    levels: dict[str, str] = field(default_factory=dict)
    text: str = ""
    start_m: float | None = None
    weight_kg: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; the keys of a step show its kind."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any], where: str | None = None) -> Cycle:
        """Make a cycle from the data of `to_dict`.

        Parameters
        ----------
        data : dict
            Steps and sampling may be absent.
        where : str, optional
            File, for messages.

        Raises
        ------
        CampaignError
            If a key is missing or unknown.
        """

        def made(kind: type, table: Any, name: str) -> Any:  # noqa: ANN401 - JSON; a step or a sampling
            known, unknown = read_fields(table, kind, where or "", CampaignError, f"cycle.{name}.")
            if unknown:
                raise TypeError(unknown[0].replace("is ignored, as it is not", "is not"))
            return kind(**known)

        try:
            steps = tuple(made(Move if "to_m" in step else Hold, step, "steps") for step in data.get("steps", ()))
            return cls(**{**data, "steps": steps, "sampling": made(Sampling, data.get("sampling", {}), "sampling")})
        except TypeError as error:
            raise CampaignError(
                "cycle.steps or cycle.sampling is invalid",
                where=where,
                value=str(error),
                rule="a step has to_m and speed_m_s, or duration_s",
            ) from None


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
    if isinstance(data, dict):
        check_schema(data.pop("schema", None), where)
    head, notes = read_fields(data, Head, where, CampaignError)
    cycle, inner_notes = read_fields(head.get("cycle", {}), Cycle, where, CampaignError, "cycle.")
    head, cycle = {"index": index, **head}, {"key": key, **cycle}
    for name in ("key", *REQUIRED, *REQUIRED_FOR.get(cycle.get("kind", ""), ())):
        if cycle.get(name) in (None, ""):
            raise CampaignError(f"cycle.{name} is missing", where=where, rule="each cycle must state it")
    if cycle["kind"] not in KINDS:
        remedy = nearest(cycle["kind"], KINDS)
        raise CampaignError(f"cycle.kind = {cycle['kind']!r} is not known", where=where, remedy=remedy)
    for name in POSITIVE:
        if name in cycle and not 0.0 < cycle[name] < math.inf:
            rule = "must be positive; pressures are absolute"
            raise CampaignError(f"cycle.{name} = {cycle[name]:g}", where=where, rule=rule)
    if head["index"] is None or head["index"] < 1:
        raise CampaignError(f"index = {head['index']}", where=where, rule="cycles are counted from 1")
    return Head(**{**head, "cycle": Cycle.from_dict(cycle, where)}), notes + inner_notes


def check_schema(version: object, where: str) -> None:
    """Refuse a campaign file whose format this version of pneudrive cannot read.

    Raises
    ------
    CampaignError
    """
    if version is not None and (not isinstance(version, int) or version > SCHEMA):
        raise CampaignError(f"schema = {version!r} is not known", where=where, remedy="Update pneudrive.")
