"""What a rig's past does to its friction: temperature, run-in, and what differs from cycle to cycle and day to day."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RigError
from pneudrive.rig.core import core_friction
from pneudrive.rig.keys import RIGID
from pneudrive.rig.plain_data import check_fields, is_number, plain

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.rig.description import RigDescription

    Numbers = float | NDArray[np.float64]

DAY_S = 86400.0


@dataclass
class Past:
    """All that earlier cycles have left behind; plain data.

    Attributes
    ----------
    key : str
        Of the last cycle: the level of friction is drawn from it.
    clock_s : float
        The rig's own clock.
    travel_m : float
        Way of the present seal.
    seal_rise_k : float
        Temperature of the seal above that of the room.
    commanded_m : float
        Where the axis stands.
    pressure_a_pa, pressure_b_pa : float
        Set pressures.
    state : list of float or None
        Of the core; None: at rest, the sensor unstressed, the chambers at their set pressures.
    shown : dict
        Last true values of the channels.
    levels : dict
        What is mounted.
    changes : dict
        How often each factor was changed by hand.
    """

    key: str = ""
    clock_s: float = 0.0
    travel_m: float = 0.0
    seal_rise_k: float = 0.0
    commanded_m: float = 0.0
    pressure_a_pa: float = 0.0
    pressure_b_pa: float = 0.0
    state: list[float] | None = None
    shown: dict[str, float] = field(default_factory=dict)
    levels: dict[str, str] = field(default_factory=lambda: {"mounting": RIGID})
    changes: dict[str, int] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Give plain data that JSON can hold, to the bit."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Past:
        """Take back what `to_dict` gave.

        Raises
        ------
        RigError
            If it is something else.
        """
        wrong = RigError(
            "this is not the memory of a simulated rig",
            value=data,
            rule="finite numbers, a key and levels that are texts",
        )
        try:
            copy: dict[str, Any] = json.loads(json.dumps(data, allow_nan=False, default=plain))
            good = not check_fields(copy, cls, "its memory", RigError) and len(copy) == len(fields(cls))
            good = good and all(map(is_number, [*(copy["state"] or []), *copy["shown"].values()]))
            good = good and all(isinstance(level, str) for level in copy["levels"].values())
            good = good and all(isinstance(count, int) for count in copy["changes"].values())
        except (AttributeError, RigError, TypeError, ValueError):
            raise wrong from None
        if not good:
            raise wrong
        return cls(**copy)

    def pass_time(self, d: RigDescription, duration_s: float, power_w: float) -> None:
        """Let time pass in which friction heats the seal with this power."""
        from pneudrive import _core

        thermal = d.thermal
        self.seal_rise_k = _core.seal_warming(
            thermal["seal_rise"], thermal["seal_time"], self.seal_rise_k, power_w, duration_s
        )
        self.clock_s += duration_s

    def room_k(self, d: RigDescription, after_s: Numbers = 0.0) -> Numbers:
        """Temperature of the room, now or some seconds later."""
        thermal = d.thermal
        turn = 2.0 * np.pi * (self.clock_s + after_s) / thermal["room_period"]
        return d.ambient_temperature_k + thermal["room_amplitude"] * np.sin(turn)

    def barrel_k(self, d: RigDescription, after_s: Numbers = 0.0) -> Numbers:
        """Temperature of the barrel, where the thermometer is."""
        return self.room_k(d, after_s) + d.barrel_share * self.seal_rise_k

    def force_drift_n(self, d: RigDescription, after_s: Numbers = 0.0) -> Numbers:
        """Drift of the force sensor's zero with temperature and time."""
        warmer = self.room_k(d, after_s) - d.ambient_temperature_k
        return d.drift["per_k"] * warmer + d.drift["per_s"] * (self.clock_s + after_s)


def stream(seed: int, *words: str) -> np.random.Generator:
    """Make the random numbers that belong to some words and nothing else."""
    digest = hashlib.sha256("\0".join(words).encode()).digest()
    return np.random.default_rng([seed, int.from_bytes(digest[:8], "little")])


def friction_scale(d: RigDescription, past: Past, seed: int) -> float:
    """Draw what cycle, day, mounting and seal make of the friction: relative to the rig file, of all its forces.

    The factors are lognormal, each drawn from the seed and what it belongs to.
    """
    changed = {factor: past.changes.get(factor, 0) for factor in ("mounting", "seal")}
    drawn = {
        "cycle": past.key,
        "day": str(int(past.clock_s // DAY_S)),
        "mounting": f"{past.levels.get('mounting', RIGID)} {changed['mounting']}",
        "seal": f"{past.levels.get('seal', '')} {changed['seal']}",
    }
    exponent = 0.0
    for factor, words in drawn.items():
        if d.repeatability[factor] > 0.0:
            exponent += d.repeatability[factor] * float(stream(seed, factor, words).standard_normal())
    return math.exp(exponent)


def friction_in_force(d: RigDescription, past: Past, seed: int) -> dict[str, Any]:
    """Return the friction of the present step, as the core takes it.

    Run-in and temperature act as on a drive: on Coulomb and breakaway force, and on viscous friction by temperature
    alone. Both are those at the beginning of the step (assumed: a step is short against the time of warming).
    """
    from pneudrive import _core

    table, thermal, run_in = core_friction(d, d.mountings[past.levels.get("mounting", RIGID)]), d.thermal, d.run_in
    warmer = float(past.room_k(d)) - d.ambient_temperature_k + past.seal_rise_k
    levels, viscous = _core.seal_factors(
        thermal["coulomb"], -thermal["viscous"], warmer, run_in["excess"], run_in["distance"], past.travel_m
    )
    scale = friction_scale(d, past, seed)
    factor = {"coulomb": scale * levels, "breakaway": scale * levels, "viscous": scale * viscous}
    out = dict(table)
    out["parameters"] = {name: value * factor.get(name, 1.0) for name, value in d.parameters.items()}
    if d.pressure is not None:
        out["pressure"] = {name: value * scale * levels for name, value in d.pressure.items()}
    if table.get("dwell") is not None:
        out["dwell"] = table["dwell"] | {"increment_n": table["dwell"]["increment_n"] * scale}
    return out
