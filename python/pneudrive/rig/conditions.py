"""Effect of a rig's history on its friction: temperature, run-in, and scatter between cycles and days."""

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
    """History of a simulated rig, as plain data.

    Attributes
    ----------
    key : str
        Key of the last cycle, from which its friction scale is drawn.
    clock_s : float
        Clock of the rig.
    travel_m : float
        Distance slid by the present seal.
    seal_rise_k : float
        Temperature of the seal above that of the room.
    commanded_m : float
        Position of the axis.
    pressure_a_pa, pressure_b_pa : float
        Set pressures.
    state : list of float or None
        State of the core; None: at rest, the sensor unstressed, the chambers at their set pressures.
    shown : dict
        Last true values of the channels.
    levels : dict
        Mounted factor levels.
    changes : dict
        Number of changes of each factor by hand.
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
        """Return plain data for JSON, exact to the bit."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Past:
        """Return the history from the data of `to_dict`.

        Raises
        ------
        RigError
            The data are not a history of this kind.
        """
        wrong = RigError(
            "this is not the saved state of a simulated rig",
            value=data,
            rule="finite numbers, a key and levels that are texts",
        )
        try:
            copy: dict[str, Any] = json.loads(json.dumps(data, allow_nan=False, default=plain))
            good = not check_fields(copy, cls, "the saved state", RigError) and len(copy) == len(fields(cls))
            good = good and all(map(is_number, [*(copy["state"] or []), *copy["shown"].values()]))
            good = good and all(isinstance(level, str) for level in copy["levels"].values())
            good = good and all(isinstance(count, int) for count in copy["changes"].values())
        except (AttributeError, RigError, TypeError, ValueError):
            raise wrong from None
        if not good:
            raise wrong
        return cls(**copy)

    def pass_time(self, d: RigDescription, duration_s: float, power_w: float) -> None:
        """Advance the time, with this power of friction heating the seal."""
        from pneudrive import _core

        thermal = d.thermal
        self.seal_rise_k = _core.seal_warming(
            thermal["seal_rise"], thermal["seal_time"], self.seal_rise_k, power_w, duration_s
        )
        self.clock_s += duration_s

    def room_k(self, d: RigDescription, after_s: Numbers = 0.0) -> Numbers:
        """Return the temperature of the room, K, now or some seconds later."""
        thermal = d.thermal
        turn = 2.0 * np.pi * (self.clock_s + after_s) / thermal["room_period"]
        return d.ambient_temperature_k + thermal["room_amplitude"] * np.sin(turn)

    def barrel_k(self, d: RigDescription, after_s: Numbers = 0.0) -> Numbers:
        """Return the temperature of the barrel, K, at the thermometer."""
        return self.room_k(d, after_s) + d.barrel_share * self.seal_rise_k

    def force_drift_n(self, d: RigDescription, after_s: Numbers = 0.0) -> Numbers:
        """Return the drift of the force sensor's zero, N, with temperature and time."""
        warmer = self.room_k(d, after_s) - d.ambient_temperature_k
        return d.drift["per_k"] * warmer + d.drift["per_s"] * (self.clock_s + after_s)


def stream(seed: int, *words: str) -> np.random.Generator:
    """Return a generator of random numbers that depends only on the given words."""
    digest = hashlib.sha256("\0".join(words).encode()).digest()
    return np.random.default_rng([seed, int.from_bytes(digest[:8], "little")])


def friction_scale(d: RigDescription, past: Past, seed: int) -> float:
    """Return the friction scale of cycle, day, mounting and seal: a factor on all friction forces of the rig file.

    The factors are lognormal. Each factor depends only on the seed and the name of its cycle, day, mounting or seal.
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
    """Return the friction of the present step in the core's form.

    Run-in and temperature act as on a drive: both on Coulomb and breakaway force, only temperature on viscous friction.
    They are evaluated at the beginning of the step (assumed: a step is short against the time constant of warming).
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
