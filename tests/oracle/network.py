"""An independent model of circuits: volumes, masses and flow paths in lists, and what moves valves.

It shares no code with the product, which integrates mass and internal energy of each volume in Rust: here they are
pressures and temperatures in plain Python, and SciPy integrates them.

State vector (SI, absolute pressure)::

    y = [p, T of each volume] + [x, v, z of each mass] + [mass flow of each column of a line] + others

`others` are states of valves and regulators, whose rates a circuit gives as a function.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

K, GAS_CONSTANT = 1.4, 287.05  # -, J/(kg K)
CP, CV = K * GAS_CONSTANT / (K - 1.0), GAS_CONSTANT / (K - 1.0)
ANR_DENSITY, ANR_TEMPERATURE = 1.185, 293.15  # kg/m3, K: ISO 8778
LINEAR_ABOVE = 0.999
AMBIENT = (101325.0, 293.15)

#: Pressure, Pa absolute, and temperature, K.
Gas = tuple[float, float]


def flow_function(r: float, b: float, end: float = 1.0) -> float:
    """Return ISO 6358's phi at the pressure ratio r; `end` is the ratio at which nothing flows any more."""
    if r <= b:
        return 1.0
    r = b + (r - b) * (1.0 - b) / (end - b)
    if r >= 1.0:
        return 0.0
    ellipse = np.sqrt(1.0 - ((min(r, LINEAR_ABOVE) - b) / (1.0 - b)) ** 2)
    return float(ellipse if r <= LINEAR_ABOVE else ellipse * (1.0 - r) / (1.0 - LINEAR_ABOVE))


def path(conductance: float, b: float, one: Gas, two: Gas) -> float:
    """Return the mass flow, kg/s, from one to two through a path of sonic conductance C, m3/(s Pa)."""
    sign, (p, t), (behind, _) = (1.0, one, two) if one[0] >= two[0] else (-1.0, two, one)
    return sign * conductance * p * ANR_DENSITY * np.sqrt(ANR_TEMPERATURE / t) * flow_function(behind / p, b)


def check_valve(conductance: float, b: float, cracking: float, one: Gas, two: Gas) -> float:
    """Return the mass flow, kg/s, through a path that opens from one to two where p1 - p2 > p_c."""
    p, t = one
    choked = conductance * p * ANR_DENSITY * np.sqrt(ANR_TEMPERATURE / t)
    return choked * flow_function(two[0] / p, b, 1.0 - cracking / p)


def clip(share: float) -> float:
    """Return a share between 0 and 1."""
    return min(max(share, 0.0), 1.0)


@dataclass(frozen=True)
class Volume:
    """Rigid gas volume, m3, with a wall, m2, at a temperature."""

    dead: float
    wall: float = 0.0
    heat_transfer: float = 0.0
    wall_temperature: float = AMBIENT[1]


@dataclass(frozen=True)
class Friction:
    """LuGre's law: dz/dt = v - s0 |v| z/g, g = Fc + (Fs - Fc) exp(-(v/vs)^2), F = s0 z + s1 dz/dt + Fv v."""

    coulomb: float
    breakaway: float
    stribeck_velocity: float
    viscous: float
    stiffness: float
    damping: float

    def __call__(self, v: float, z: float) -> tuple[float, float]:
        """Return the force against v > 0, N, and the rate of the deflection, m/s."""
        level = self.coulomb + (self.breakaway - self.coulomb) * math.exp(-((v / self.stribeck_velocity) ** 2))
        rate = v - self.stiffness * abs(v) * z / level
        return self.stiffness * z + self.damping * rate + self.viscous * v, rate


@dataclass(frozen=True)
class Mass:
    """Mass, kg, on an axis."""

    mass: float
    friction: Friction | None = None


@dataclass(frozen=True)
class Face:
    """Side of a piston: what it leaves free belongs to a volume. `far` is the stroke for a chamber at the far end."""

    volume: int
    axis: int
    bore: float
    rod: float = 0.0
    far: float | None = None

    @property
    def area(self) -> float:
        """Area on which the pressure acts, m2."""
        return 0.25 * math.pi * (self.bore**2 - self.rod**2)

    @property
    def sign(self) -> float:
        """How the length of the chamber grows with x."""
        return 1.0 if self.far is None else -1.0


@dataclass(frozen=True)
class Cushion:
    """Plunger that enters the bore of a cover at `length` from it, and leaves its volume to the port behind."""

    chamber: int
    port: int
    axis: int
    diameter: float
    length: float
    width: float
    far: float | None = None

    def out(self, x: float) -> tuple[float, float, float]:
        """Return s, how far the plunger is out of its bore, m, and the slope of that."""
        s = x if self.far is None else self.far - x
        over = s - self.length
        if over <= -0.5 * self.width:
            return s, 0.0, 0.0
        if over >= 0.5 * self.width:
            return s, over, 1.0
        u = over / self.width + 0.5
        return s, 0.5 * self.width * u * u, u


@dataclass(frozen=True)
class Column:
    """Gas with inertia and friction between two cells of a line, over a length of the bore."""

    one: int
    two: int
    length: float
    diameter: float
    viscosity: float = 1.82e-5


@dataclass
class At:
    """The variables of a network at a time."""

    t: float
    gas: list[Gas]
    x: list[float]
    v: list[float]
    z: list[float]
    columns: list[float]
    others: list[float]
    commands: dict[str, float]


End = int | Gas
Path = tuple[Callable[[At], float], End, End]


@dataclass(frozen=True)
class Network:
    """Volumes, masses and what is between them.

    `paths` give (mass flow, from, to); `forces` give (axis, force in +x); `rates` those of the other states.
    """

    volumes: Sequence[Volume]
    paths: Sequence[Path]
    masses: Sequence[Mass] = ()
    faces: Sequence[Face] = ()
    cushions: Sequence[Cushion] = ()
    columns: Sequence[Column] = ()
    forces: Sequence[tuple[int, Callable[[At], float]]] = ()
    others: Sequence[float] = ()
    rates: Callable[[At], list[float]] = field(default=lambda _: [])

    def at(self, t: float, y: Sequence[float], commands: dict[str, float]) -> At:
        """Name the states."""
        n, m, c = 2 * len(self.volumes), len(self.masses), len(self.columns)
        # A trial of the solver may lie outside the physics.
        gas = [(max(p, 1.0), max(t, 1.0)) for p, t in zip(y[0:n:2], y[1:n:2], strict=True)]
        each = [list(y[n + i : n + 3 * m : 3]) for i in range(3)]
        k = n + 3 * m
        return At(t, gas, *each, list(y[k : k + c]), list(y[k + c :]), commands)

    def derivatives(self, t: float, y: np.ndarray, commands: dict[str, float]) -> list[float]:
        """Return the rates of all states."""
        at = self.at(t, y.tolist(), commands)
        volume, growth, heat = self._rooms(at)
        flow, power, acceleration = self._flows(at, volume)
        out = []
        for (p, temperature), v, dv, q, w, h in zip(at.gas, volume, growth, heat, flow, power, strict=True):
            energy = h + q - p * dv
            mass = p * v / (GAS_CONSTANT * temperature)
            out += [((K - 1.0) * energy - p * dv) / v, (energy / CV - temperature * w) / mass]
        force = self._gas_forces(at)
        for axis, of in self.forces:
            force[axis] += of(at)
        for one, f, v, z in zip(self.masses, force, at.v, at.z, strict=True):
            resists, rate = one.friction(v, z) if one.friction else (0.0, 0.0)
            out += [v, (f - resists) / one.mass, rate]
        return [*out, *acceleration, *self.rates(at)]

    def _rooms(self, at: At) -> tuple[list[float], list[float], list[float]]:
        """Return volumes, their rates, and the heat into them."""
        volume = [one.dead for one in self.volumes]
        wall, growth = [one.wall for one in self.volumes], [0.0] * len(volume)
        for face in self.faces:
            x = at.x[face.axis]
            length = x if face.far is None else face.far - x
            volume[face.volume] += face.area * length
            growth[face.volume] += face.sign * face.area * at.v[face.axis]
            wall[face.volume] += math.pi * (face.bore + face.rod) * length + 2.0 * face.area
        for one in self.cushions:
            s, out, slope = one.out(at.x[one.axis])
            area = 0.25 * math.pi * one.diameter**2
            rate = area * (1.0 - slope) * (at.v[one.axis] if one.far is None else -at.v[one.axis])
            volume[one.chamber] -= area * (s - out)
            volume[one.port] += area * (s - out)
            growth[one.chamber] -= rate
            growth[one.port] += rate
        heat = [
            one.heat_transfer * area * (one.wall_temperature - t)
            for one, area, (_, t) in zip(self.volumes, wall, at.gas, strict=True)
        ]
        return volume, growth, heat

    def _flows(self, at: At, volume: list[float]) -> tuple[list[float], list[float], list[float]]:
        """Return mass flow and enthalpy into each volume, and the rates of the columns' mass flows."""
        flow, power = [0.0] * len(volume), [0.0] * len(volume)
        through = [(of(at), one, two) for of, one, two in self.paths]
        through += [(w, one.one, one.two) for w, one in zip(at.columns, self.columns, strict=True)]
        for w, one, two in through:
            donor = one if w >= 0.0 else two
            t = at.gas[donor][1] if isinstance(donor, int) else donor[1]
            for end, sign in ((one, -1.0), (two, 1.0)):
                if isinstance(end, int):
                    flow[end] += sign * w
                    power[end] += sign * w * CP * t
        acceleration, density = [], [p / (GAS_CONSTANT * t) for p, t in at.gas]
        for w, column in zip(at.columns, self.columns, strict=True):
            one, two, length = column.one, column.two, column.length
            area = 0.25 * math.pi * column.diameter**2
            mean = 0.5 * (density[one] + density[two])
            speed = w / (mean * area)
            reynolds = abs(w) * column.diameter / (area * column.viscosity)
            # Of a smooth pipe: f |w| w/(2 rho A^2) l/d, with f Re at hand as it is finite at rest.
            drop = _friction_times_reynolds(reynolds) * column.viscosity * length * speed / (2.0 * column.diameter**2)
            rate = (at.gas[one][0] - at.gas[two][0] - drop) * area / length
            denser = 0.5 * (flow[one] / volume[one] + flow[two] / volume[two])
            # Kinetic energy E = l w^2/(2 rho A), taken from the cell to which it flows.
            kinetic = length / (mean * area) * (w * rate - 0.5 * w * w * denser / mean)
            power[two if w >= 0.0 else one] -= kinetic
            acceleration.append(rate)
        return flow, power, acceleration

    def _gas_forces(self, at: At) -> list[float]:
        force = [0.0] * len(self.masses)
        for face in self.faces:
            force[face.axis] += face.sign * face.area * (at.gas[face.volume][0] - AMBIENT[0])
        for one in self.cushions:
            _, _, slope = one.out(at.x[one.axis])
            push = (at.gas[one.port][0] - at.gas[one.chamber][0]) * 0.25 * math.pi * one.diameter**2 * (1.0 - slope)
            force[one.axis] += push if one.far is None else -push
        return force

    def run(
        self,
        gas: Sequence[Gas],
        positions: Sequence[float],
        commands: Sequence[tuple[float, dict[str, float]]],
        times: np.ndarray,
        method: str,
        rtol: float,
    ) -> list[At]:
        """Integrate from rest; each entry of `commands` holds from its time on, and starts a new integration."""
        y = [number for pair in gas for number in pair]
        for x in positions:
            y += [x, 0.0, 0.0]
        y += [0.0] * len(self.columns) + list(self.others)
        scale = [1e5, 300.0] * len(gas) + [0.1, 0.1, 1e-5] * len(positions)
        scale += [1e-3] * len(self.columns) + [1.0] * len(self.others)
        out, state = [], np.array(y)
        now: dict[str, float] = {}
        for (start, values), (end, _) in itertools.pairwise([*commands, (times[-1], {})]):
            now = now | values
            inside = times[(times >= start) & (times < end)] if end < times[-1] else times[times >= start]
            if end <= start:
                continue
            asked = np.unique([*inside, end])
            done: Any = solve_ivp(
                self.derivatives,
                (start, end),
                state,
                method,
                asked,
                args=(now,),
                rtol=rtol,
                atol=rtol * np.array(scale),
            )
            if not done.success:
                raise RuntimeError(done.message)
            out += [self.at(t, one.tolist(), now) for t, one in zip(asked, done.y.T, strict=True) if t in inside]
            state = done.y[:, -1]
        return out


def _friction_times_reynolds(reynolds: float) -> float:
    """Friction factor of a smooth pipe times the Reynolds number: 64, Blasius from 4000 on, a cubic between."""
    share = min(max((reynolds - 2000.0) / 2000.0, 0.0), 1.0)
    share *= share * (3.0 - 2.0 * share)
    return 64.0 * (1.0 - share) + share * 0.3164 * max(reynolds, 2000.0) ** 0.75


def travels(times: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the breakpoints (time, position) of an armature from its travels (start, end), first to 1, then to 0."""
    out = []
    for i, (start, end) in enumerate(times):
        out += [(start, float(i % 2)), (end, float(1 - i % 2))]
    return out


def position(breakpoints: Sequence[tuple[float, float]], t: float) -> float:
    """Return the position of an armature at a time, linear between breakpoints."""
    return float(np.interp(t, *zip(*breakpoints, strict=True)))
