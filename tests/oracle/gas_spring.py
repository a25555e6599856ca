"""Recordings of a driven gas spring from the equations of closed chambers, integrated without the core."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from pneudrive.signals.recording import ParallelForce, Recording

R, GAMMA, AMBIENT_K, AMBIENT_PA = 296.8, 1.4, 293.15, 1.013e5
AREAS, STROKE = (0.0127, 0.0115), 2.0
CIRCUIT = (Path(__file__).parents[1] / "data" / "gas_spring_circuit.toml").read_text("utf-8")


@dataclass(frozen=True)
class Truth:
    """Numbers of a spring; both chambers hold nitrogen at the temperature of the wall at the start."""

    volumes: tuple[float, float] = (0.025, 0.05)
    heat: tuple[float, float] = (25.0, 70.0)
    capacity: float = np.inf  # of the wall of chamber a, J/K
    outer: float = 0.0
    leak: float = 0.0  # coefficient of a laminar gap past the piston
    pressures: tuple[float, float] = (8e5, 1.05e6)
    delay_s: float = 0.0
    ram_gain: float = 1.0


def positions(time_s: np.ndarray, speeds: np.ndarray, rest_s: float = 4.0) -> np.ndarray:
    """Return strokes from 0.1 to 1.9 m and back at these speeds, with rests at both ends."""
    times, places = [0.0, rest_s], [0.1, 0.1]
    for speed in speeds:
        for end in (1.9, 0.1):
            times += [times[-1] + 1.8 / speed, times[-1] + 1.8 / speed + rest_s]
            places += [end, end]
    return np.interp(time_s, times, places)


def pressures(truth: Truth, time_s: np.ndarray, position_m: np.ndarray, parts: int = 4) -> np.ndarray:
    """Integrate mass, energy and wall of both chambers by Runge-Kutta steps; return (2, n) pressures."""
    cv, cp = R / (GAMMA - 1.0), GAMMA * R / (GAMMA - 1.0)
    sign, ends = np.array([1.0, -1.0]), np.array([truth.volumes[0], truth.volumes[1] + AREAS[1] * STROKE])
    area, heat = np.array(AREAS), np.array(truth.heat)

    def volume(x: float) -> np.ndarray:
        return ends + sign * area * x

    def rates(state: np.ndarray, x: float, v: float) -> np.ndarray:
        mass, energy, wall = state[:2], state[2:4], state[4]
        space, kelvin = volume(x), energy / (mass * cv)
        p = (GAMMA - 1.0) * energy / space
        high = 0 if p[0] > p[1] else 1
        flow = truth.leak * (p[0] ** 2 - p[1] ** 2) / kelvin[high] * sign  # out of a, into b
        q = heat * (kelvin - np.array([wall, AMBIENT_K]))
        de = -p * sign * area * v - q - flow * cp * kelvin[high]
        dw = (q[0] - truth.outer * (wall - AMBIENT_K)) / truth.capacity
        return np.r_[-flow, de, dw]

    p0 = np.array(truth.pressures)
    mass = p0 * volume(position_m[0]) / (R * AMBIENT_K)
    state = np.r_[mass, mass * cv * AMBIENT_K, AMBIENT_K]
    out = [p0]
    for i in range(time_s.size - 1):
        h, v = (time_s[i + 1] - time_s[i]) / parts, (position_m[i + 1] - position_m[i]) / (time_s[i + 1] - time_s[i])
        for j in range(parts):
            x = position_m[i] + v * j * h
            k1 = rates(state, x, v)
            k2 = rates(state + h / 2 * k1, x + v * h / 2, v)
            k3 = rates(state + h / 2 * k2, x + v * h / 2, v)
            k4 = rates(state + h * k3, x + v * h, v)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        out.append((GAMMA - 1.0) * state[2:4] / volume(position_m[i + 1]))
    return np.array(out).T


@cache
def springs(truth: Truth, seconds: float, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, positions and pressures without noise; one integration serves all recordings of a truth."""
    time = np.arange(0.0, seconds, 1.0 / rate)
    x = positions(time, np.array([0.1, 0.25, 0.45, 0.6, 0.35, 0.55]))
    return time, x, pressures(truth, time, x)


def record(truth: Truth, seed: int = 0, seconds: float = 120.0, rate: float = 20.0, name: str = "spring") -> Recording:
    """Return a recording: noise, steps of 0.1 psi, pressures late by the delay, friction and a ram."""
    rng = np.random.default_rng(seed)
    time, x, true = springs(truth, seconds, rate)
    shown = np.array([np.interp(time - truth.delay_s, time, p) for p in true])
    shown = np.round((shown + rng.normal(0.0, 300.0, shown.shape)) / 689.5) * 689.5
    v = np.gradient(x, time)
    friction = np.sign(v) * np.where(np.abs(v) > 1e-3, 400.0, 0.0) + 900.0 * v
    ram = -9e-4 * (0.5e6 + 2e6 * v + 3e5 * np.sin(0.7 * time))
    gas = AREAS[1] * (true[1] - AMBIENT_PA) - AREAS[0] * (true[0] - AMBIENT_PA)
    force = gas + friction - truth.ram_gain * ram + rng.normal(0.0, 15.0, time.size)
    return Recording(
        name, time, x + rng.normal(0.0, 2e-5, x.size), force, *shown, *AREAS, AMBIENT_PA,
        parallel=(ParallelForce("ram", 9e-4, 0.05, ram),),
    )  # fmt: skip
