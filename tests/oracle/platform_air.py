"""Platforms on pneumatic legs: multipliers in redundant coordinates, with chambers, valves and LuGre friction.

The state is place and unit quaternion of the platform, its velocity and angular velocity, pressure and temperature of
each chamber, and the bristle deflection of each leg. SciPy integrates it with DOP853.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from oracle import network, platforms

Array = NDArray[np.float64]

SUPPLY, AMBIENT = (7e5, 293.15), network.AMBIENT
CONDUCTANCE, RATIO = 1.4e-8, 0.3
BORE, ROD, STROKE, DEAD, HEAT = 0.032, 0.012, 0.2, 5e-6, 30.0
FRICTION = network.Friction(25.0, 35.0, 0.02, 60.0, 2e5, 300.0)
AREAS = np.array([0.25 * np.pi * BORE**2, 0.25 * np.pi * (BORE**2 - ROD**2)])
PERIMETERS = np.pi * np.array([BORE, BORE + ROD])
TIMES = (0.0, 0.015, 0.03, 0.045)
COMMANDS = np.array([
    [0.30, -0.20, 0.0], [0.20, -0.05, 0.0], [0.25, -0.25, 0.0], [0.22, -0.1, 0.0], [0.28, -0.15, 0.0], [0.24, -0.2, 0.0]
])  # fmt: skip
START = (4e5, 3.5e5)
SAMPLES = np.linspace(0.0, TIMES[-1], 10)


def machine(kind: str) -> platforms.Machine:
    """Return the machine of a run."""
    return platforms.random_machine(kind, np.random.default_rng(2026))


def first_pose(own: platforms.Machine) -> tuple[Array, Array]:
    """Return place and rotation at the start: level, near half strokes."""
    height = 0.42 if own.kind != "platform/linear-delta" else -0.28
    return own.closed(np.array([0.0, 0.0, height]), np.eye(3), height, np.zeros(2))


def circuit(kind: str) -> dict[str, object]:
    """Return the product's description, with a cylinder and a valve for each leg."""
    own = machine(kind)
    form = platforms.circuit(own)
    n = len(own.frame)
    components = [{"name": "mains", "kind": "reservoir", "numbers": {"pressure": SUPPLY[0]}}, form["components"][-1]]
    joints = [["mains.1", *(f"valve_{i}.1" for i in range(1, n + 1))]]
    for i in range(1, n + 1):
        components += [
            {
                "name": f"valve_{i}",
                "kind": "valve/proportional-5/3",
                "numbers": {"conductance": CONDUCTANCE, "critical_pressure_ratio": RATIO},
            },
            {
                "name": f"leg_{i}",
                "kind": "cylinder/single-rod",
                "numbers": {
                    "bore": BORE, "rod_diameter": ROD, "stroke": STROKE, "dead_volume_a": DEAD, "dead_volume_b": DEAD,
                    "moving_mass": float(own.rods[i - 1]), "heat_transfer": HEAT,
                },
                "friction": {
                    "law": "lugre",
                    "parameters": {
                        "coulomb": FRICTION.coulomb, "breakaway": FRICTION.breakaway,
                        "stribeck_velocity": FRICTION.stribeck_velocity, "viscous": FRICTION.viscous,
                        "bristle_stiffness": FRICTION.stiffness, "bristle_damping": FRICTION.damping,
                        "stribeck_exponent": 2.0,
                    },
                },
            },
        ]  # fmt: skip
        joints += [
            [f"valve_{i}.4", f"leg_{i}.a"], [f"valve_{i}.2", f"leg_{i}.b"], [f"leg_{i}.rod", f"platform.{i}"],
        ]  # fmt: skip
    return form | {"components": components, "joints": joints}


def start(own: platforms.Machine) -> dict[str, float]:
    """Return the start of the product."""
    out = {}
    for i, x in enumerate(own.positions(*first_pose(own)), start=1):
        out |= {f"leg_{i}.position_m": float(x), f"leg_{i}.velocity_m_s": 0.0}
        for end, p in zip("ab", START, strict=True):
            out |= {f"leg_{i}.{end}.pressure_pa": p, f"leg_{i}.{end}.temperature_k": AMBIENT[1]}
    return out


def rates(own: platforms.Machine, commands: Array, y: Array) -> Array:
    """Return the rates of the state."""
    n = len(own.frame)
    place, quaternion, twist = y[:3], y[3:7], y[7:13]
    p, t = y[13 : 13 + 2 * n].reshape(n, 2), y[13 + 2 * n : 13 + 4 * n].reshape(n, 2)
    turn = Rotation.from_quat(quaternion).as_matrix()
    x, v = own.positions(place, turn), own.leg_rates(place, turn, twist)
    forces, dz = np.zeros(n), np.zeros(n)
    dp, dt = np.zeros_like(p), np.zeros_like(t)
    for i in range(n):
        friction, dz[i] = FRICTION(v[i], y[13 + 4 * n + i])
        forces[i] = (p[i] - AMBIENT[0]) @ (AREAS * [1.0, -1.0]) - friction
        u = commands[i]
        for k, (sign, length) in enumerate(((1.0, x[i]), (-1.0, STROKE - x[i]))):
            gas, opening = (p[i, k], t[i, k]), CONDUCTANCE * abs(u)
            outside = SUPPLY if sign * u > 0.0 else AMBIENT
            flow = network.path(opening, RATIO, outside, gas) if u else 0.0
            volume, change = DEAD + AREAS[k] * length, sign * AREAS[k] * v[i]
            wall = PERIMETERS[k] * length + 2.0 * AREAS[k]
            heat = HEAT * wall * (AMBIENT[1] - gas[1])
            enthalpy = network.CP * flow * (outside[1] if flow > 0.0 else gas[1])
            inner = enthalpy + heat - gas[0] * change  # rate of m c_v T = p V c_v/R
            dp[i, k] = (inner * network.GAS_CONSTANT / network.CV - gas[0] * change) / volume
            mass = gas[0] * volume / (network.GAS_CONSTANT * gas[1])
            dt[i, k] = gas[1] * (dp[i, k] / gas[0] + change / volume - flow / mass)
    acceleration, _ = own.accelerations(place, turn, twist, forces)
    w = twist[3:]
    vector, scalar = quaternion[:3], quaternion[3]
    turning = 0.5 * np.r_[scalar * w + np.cross(w, vector), -w @ vector]
    return np.concatenate([twist[:3], turning, acceleration, dp.ravel(), dt.ravel(), dz])


def positions(kind: str, rtol: float) -> Array:
    """Return the positions of the legs at the samples."""
    own = machine(kind)
    n = len(own.frame)
    place, turn = first_pose(own)
    y = np.concatenate([
        place, Rotation.from_matrix(turn).as_quat(), np.zeros(6), np.tile(START, n), np.full(2 * n, AMBIENT[1]),
        np.zeros(n),
    ])  # fmt: skip
    scale = np.concatenate(
        [np.full(7, 1e-2), np.full(6, 1e-1), np.full(2 * n, 1e5), np.full(2 * n, 300.0), np.full(n, 1e-5)]
    )
    out = [own.positions(place, turn)]
    for k, (begin, end) in enumerate(pairwise(TIMES)):
        every = SAMPLES.copy()
        times = every[(every > begin + 1e-9) & (every < end + 1e-9)]
        times[-1] = end

        def rhs(_: float, state: Array, k: int = k) -> Array:
            return rates(own, COMMANDS[:n, k], state)

        run = solve_ivp(rhs, (begin, end), y, "DOP853", rtol=rtol, atol=rtol * scale, t_eval=times)
        out += [own.positions(row[:3], Rotation.from_quat(row[3:7]).as_matrix()) for row in run.y.T]
        y = run.y[:, -1]
    return np.array(out)
