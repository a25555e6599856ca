"""The two timed cases, their yardstick, and the one tolerance convention of all solvers.

Case A is the full stroke of the reference drive (2 s, states at 1 kHz), case C is 10 s of position
control with the command sampled and held at 1 kHz.  Both are the golden cases of ``tests/golden``.
Every solver gets rtol = tol and atol_i = tol * SCALE_i; one that takes a single atol integrates the
states divided by SCALE.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

GOLDEN = Path(__file__).resolve().parent.parent / "tests" / "golden"
COLUMNS = ("position_m", "velocity_m_s", "pressure_a_pa", "temperature_a_k", "pressure_b_pa", "temperature_b_k")
POSITION, PRESSURE_A, PRESSURE_B = 0, 2, 4
STATES = ("x", "v", "p_a", "t_a", "p_b", "t_b", "z")
SCALE = np.array([0.1, 0.1, 1e5, 300.0, 1e5, 300.0, 1e-4])
GRID = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 3e-8, 1e-8)
DEFAULT = 1e-6  # the product's default tolerance
POSITION_BOUND_UM, PRESSURE_BOUND = 1.0, 1e-4
BEFORE_IMPACT_S, AFTER_IMPACT_S = 2e-3, 30e-3

CASE_A: dict[str, Any] = json.loads((GOLDEN / "case_a.json").read_text())
CASE_C: dict[str, Any] = json.loads((GOLDEN / "case_c.json").read_text())
SERVO: dict[str, float] = CASE_C["servo"]
STROKE: float = CASE_A["drive"]["cylinder"]["stroke_m"]


def golden(name: str) -> np.ndarray:
    """Return the golden states of a case, shape (n, 6), in the order of `COLUMNS`."""
    with np.load(GOLDEN / f"{name}.npz") as data:
        return np.stack([data[c] for c in COLUMNS], axis=1)


GOLDEN_A, GOLDEN_C = golden("case_a"), golden("case_c")
TIMES_A = np.arange(len(GOLDEN_A)) / CASE_A["sample_rate_hz"]
# command steps of case A with their sample times: [(u, times from the step's start to its end)]
SEGMENTS_A = [(u, TIMES_A[round(t0 * 1e3) : round(t0 * 1e3) + 1001]) for t0, u in CASE_A["commands"]]
SAMPLES_C = round(CASE_C["duration_s"] * SERVO["sample_rate_hz"])
KEPT_C = round(SERVO["sample_rate_hz"] / CASE_C["sample_rate_hz"])


def initial(case: dict[str, Any]) -> np.ndarray:
    """Return the initial state, shape (7,), bristle at rest."""
    return np.array([*(case["initial"][c] for c in COLUMNS), 0.0])


def command(i: int, x: float, v: float) -> float:
    """Return what the controller of case C says at its i-th sample."""
    t, w = i / SERVO["sample_rate_hz"], 2.0 * math.pi * SERVO["frequency_hz"]
    target = 0.5 * STROKE + SERVO["amplitude_m"] * math.sin(w * t)
    speed = SERVO["amplitude_m"] * w * math.cos(w * t)
    return min(1.0, max(-1.0, SERVO["kp"] * (target - x) + SERVO["kd"] * (speed - v)))


def outside_impact(times: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return a mask of the samples that are not around a first contact with an end stop."""
    beyond = (position < 0.0) | (position > STROKE)
    keep = np.ones(len(times), bool)
    for i in np.flatnonzero(beyond[1:] & ~beyond[:-1]):
        keep &= (times < times[i] - BEFORE_IMPACT_S) | (times > times[i + 1] + AFTER_IMPACT_S)
    return keep


KEEP_A = outside_impact(TIMES_A, GOLDEN_A[:, POSITION])


def errors(case: str, states: np.ndarray) -> tuple[float, float]:
    """Return (greatest position error in um, greatest relative pressure error) against the golden data.

    `states` has at least the columns of `COLUMNS`; shape (2001, >= 6) in case A, (10001, >= 6) in C.
    """
    if case == "A":
        got, want = states[KEEP_A], GOLDEN_A[KEEP_A]
    else:
        got, want = states[::KEPT_C], GOLDEN_C
    position = np.abs(got[:, POSITION] - want[:, POSITION]).max() * 1e6
    pressure = max(np.abs(got[:, i] / want[:, i] - 1.0).max() for i in (PRESSURE_A, PRESSURE_B))
    # NaN must not pass as a small error
    return (float(position), float(pressure)) if np.isfinite(got[:, : len(COLUMNS)]).all() else (math.inf, math.inf)


def meets(error: tuple[float, float]) -> bool:
    """Say whether an error is within both bounds."""
    return error[0] <= POSITION_BOUND_UM and error[1] <= PRESSURE_BOUND
