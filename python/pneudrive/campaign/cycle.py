"""A cycle: the unit that a campaign plans, runs, stores and repeats."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from pneudrive.errors import CampaignError
from pneudrive.rig.interface import Hold, Move, Sampling, Step

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
        try:
            steps = tuple(Move(**step) if "to_m" in step else Hold(**step) for step in data.get("steps", ()))
            return cls(**{**data, "steps": steps, "sampling": Sampling(**data.get("sampling", {}))})
        except TypeError as error:
            raise CampaignError(
                "cycle.steps or cycle.sampling is invalid",
                where=where,
                value=str(error),
                rule="a step has to_m and speed_m_s, or duration_s",
            ) from None
