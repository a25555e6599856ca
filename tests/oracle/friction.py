"""Friction of bristles as a textbook writes it: LuGre and elasto-plastic, with age and relaxation.

Plain Python with plain ``if``, from the equations of the sources (canudas1995, dupont2002, dieterich1979,
kato1972) and, for relaxation, of docs/theory/friction.md.
"""

from __future__ import annotations

import math
from typing import Any

Json = dict[str, Any]

# absolute tolerance = tol times this
SCALES = {"deflection": 1e-4, "relaxed": 1e-4, "age": 1e-3}


class Bristles:
    """Friction force and rates of the inner states: deflection z, then dashpot d, then age, as there are."""

    def __init__(self, friction: Json, p_amb: float) -> None:
        self.law, self.parameters, self.p_amb = friction["law"], friction["parameters"], p_amb
        tables = ("pressure", "dwell", "relaxation", "position", "direction", "side_load")
        self.pressure, self.dwell, self.relaxation, self.position, self.direction, self.side_load = (
            friction.get(table) for table in tables
        )
        self.states = ["deflection"]
        self.states += ["relaxed"] if self.relaxation else []
        self.states += ["age"] if self.dwell else []

    def initial(self, given: Json) -> list[float]:
        """Return the inner states at the start."""
        start = {"deflection": given.get("bristle_deflection_m", 0.0), "age": given.get("contact_age_s", 0.0)}
        return [start.get(state, 0.0) for state in self.states]

    def scales(self) -> list[float]:
        """Return the error scale of each inner state."""
        return [SCALES[state] for state in self.states]

    # -- levels -------------------------------------------------------------------------------
    def increment(self, age: float, gauge_a: float, gauge_b: float) -> float:
        """Return what age adds to both levels, N."""
        dwell = self.dwell
        ratio = max(age, 0.0) / dwell["time_s"]
        grown = {
            "saturating": lambda: 1.0 - math.exp(-(ratio ** dwell.get("exponent", 0.4))),
            "log": lambda: math.log(1.0 + ratio),
            "hyperbolic": lambda: ratio / (1.0 + ratio),
        }[dwell["growth"]]()
        pressed = 1.0 + dwell.get("pressure_a", 0.0) * gauge_a + dwell.get("pressure_b", 0.0) * gauge_b
        return dwell["increment_n"] * max(pressed, 0.0) * grown

    def factor(self, x: float, v: float) -> float:
        """Return by how much position and direction multiply the seals' levels."""
        factor = 1.0
        if self.position:
            s = x - self.position.get("reference_m", 0.0)
            factor += self.position.get("slope_per_m", 0.0) * s
            for wave in self.position.get("harmonics", []):
                angle = 2.0 * math.pi * s / wave["period_m"] + wave.get("phase_rad", 0.0)
                factor += wave["amplitude"] * math.cos(angle)
        if self.direction:
            factor *= self.direction["negative" if v < 0.0 else "positive"]
        return factor

    def levels(self, x: float, v: float, p_a: float, p_b: float, age: float) -> tuple[float, float, float]:
        """Return g, the level of sliding without its viscous part, its limit for v -> 0, and the part of age, N."""
        law, gauge_a, gauge_b = self.parameters, p_a - self.p_amb, p_b - self.p_amb
        coulomb, breakaway = law["coulomb"], law["breakaway"]
        if self.pressure:
            coulomb += self.pressure["coulomb_a"] * gauge_a + self.pressure["coulomb_b"] * gauge_b
            breakaway += self.pressure["breakaway_a"] * gauge_a + self.pressure["breakaway_b"] * gauge_b
        ratio = abs(v / law["stribeck_velocity"]) ** law["stribeck_exponent"]
        more = self.side_load["coefficient"] * abs(self.side_load["force_n"]) if self.side_load else 0.0
        aged = self.increment(age, gauge_a, gauge_b) if self.dwell else 0.0
        factor = self.factor(x, v)
        level = factor * (coulomb + (breakaway - coulomb) * math.exp(-ratio))
        return level + more + aged, factor * breakaway + more + aged, aged

    def ageing(self, age: float, v: float, slip: float, aged_share: float) -> float:
        """Return the rate of the age: an old contact grows younger only where nearly all of the motion is slip."""
        balance = 1.0 - age * abs(slip) / self.dwell["distance_m"]
        if balance >= 0.0:
            return balance
        missing, allowed = 1.0 - slip / v, max(0.04 * aged_share, 1.5e-3)
        if missing >= allowed:
            return 0.0
        whole = 1.0 - max(missing, 0.0) / allowed
        return balance * (3.0 * whole**2 - 2.0 * whole**3)

    # -- bristles -----------------------------------------------------------------------------
    def slip(self, v: float, z: float, level: float) -> float:
        """Return the plastic slip rate of bristles deflected by z, m/s."""
        q = self.parameters["bristle_stiffness"] * z / level
        if self.law == "lugre":
            return abs(v) * q
        begin = self.parameters.get("breakaway_share", 0.9)
        if v * z <= 0.0 or abs(q) <= begin:
            return 0.0
        if abs(q) >= 1.0:
            return abs(v) * q
        middle = 0.5 * (1.0 + begin)
        return (0.5 + 0.5 * math.sin(math.pi * (abs(q) - middle) / (1.0 - begin))) * abs(v) * q

    def __call__(self, x: float, v: float, p_a: float, p_b: float, inner: list[float]) -> tuple[float, list[float]]:
        """Return the friction force, N, and the rates of the inner states."""
        law, at = self.parameters, dict(zip(self.states, inner, strict=True))
        level, breakaway, aged = self.levels(x, v, p_a, p_b, at.get("age", 0.0))
        z, d = at["deflection"], at.get("relaxed", 0.0)
        seen = z - (self.relaxation["share"] * d if self.relaxation else 0.0)
        slip = self.slip(v, seen, level)
        damping = law["bristle_damping"]
        if "damping_fade_velocity" in law:
            damping *= math.exp(-((v / law["damping_fade_velocity"]) ** 2))
        force = law["bristle_stiffness"] * seen + damping * (v - slip) + law["viscous"] * v
        rates = [v - slip]
        if self.relaxation:
            yielding, renewed = (z - d) / self.relaxation["time_s"], d * abs(slip) / self.relaxation["distance_m"]
            sign = math.copysign(1.0, d)
            leaving = sign * max(0.0, sign * renewed - max(sign * yielding, 0.0))
            rates = [v - slip - self.relaxation["share"] * leaving, yielding - renewed]
        if self.dwell:
            rates.append(self.ageing(at["age"], v, slip, aged / breakaway))
        return force, rates
