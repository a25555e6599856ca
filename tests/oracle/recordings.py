"""Recordings whose truth is known, made from plain formulas: no solver, no rig."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pneudrive.characterise import Recording

AMBIENT = 101325.0
AREA = np.pi / 4 * 0.025**2


def forth_and_back(
    strokes: int, travel: float, speed: float, rate: float, dwell: float
) -> tuple[np.ndarray, np.ndarray]:
    """Time and position of strokes between 0 and ``travel``, with a rest at each end."""
    corners_t, corners_x = [0.0, dwell], [0.0, 0.0]
    for stroke in range(strokes):
        corners_t += [corners_t[-1] + travel / speed, corners_t[-1] + travel / speed + dwell]
        corners_x += [travel * (stroke % 2 == 0)] * 2
    time = np.arange(0.0, corners_t[-1], 1.0 / rate)
    return time, np.interp(time, corners_t, corners_x)


def make_recording(
    friction: float | Callable[[np.ndarray], np.ndarray] = 5.0,
    offset: float | Callable[[np.ndarray], np.ndarray] = 0.0,
    gauge_b: float = 3e5,
    swing: float = 0.0,
    strokes: int = 10,
    travel: float = 0.04,
    speed: float = 0.01,
    rate: float = 100.0,
    dwell: float = 0.1,
    noise: float = 0.05,
    position_noise: float = 2e-6,
    stroke_spread: float = 0.0,
    drift: float = 0.0,
    presliding: float = 2e-4,
    area: float = AREA,
    area_error: float = 0.0,
    zero: float = 0.0,
    seed: int = 1,
    **fields: object,
) -> Recording:
    """Make a recording: friction against the motion, an offset over position, one pressure per direction."""
    rng = np.random.default_rng(seed)
    time, x = forth_and_back(strokes, travel, speed, rate, dwell)
    velocity = np.gradient(x, time)
    direction = np.sign(velocity)
    for i in range(1, direction.size):  # at rest the last direction's friction stays
        if direction[i] == 0:
            direction[i] = direction[i - 1]
    direction[direction == 0] = 1
    number = np.cumsum(np.abs(np.diff(direction, prepend=direction[0])) > 0)
    per_stroke = rng.normal(0.0, stroke_spread, number.max() + 1) if stroke_spread else np.zeros(number.max() + 1)
    level = friction(x) if callable(friction) else friction
    lost = offset(x) if callable(offset) else offset
    away = np.where(direction > 0, x, travel - x)
    sign = direction * (1 - 2 * np.exp(-away / presliding)) if presliding else direction
    gauge = gauge_b + swing * direction
    force = sign * (level + per_stroke[number] + drift * number) + lost + zero + gauge * area * (1 + area_error)
    return Recording(
        time_s=time,
        position_m=x + rng.normal(0.0, position_noise, x.size),
        force_n=force + rng.normal(0.0, noise, x.size),
        pressure_a_pa=np.full(x.size, AMBIENT),
        pressure_b_pa=AMBIENT + gauge,
        area_a_m2=area,
        area_b_m2=area,
        ambient_pressure_pa=AMBIENT,
        **{"name": "made", "synthetic": True, **fields},
    )
