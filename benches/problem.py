"""The timed cases of the reference drive, their reference solutions, and the tolerance convention of all solvers.

Case A is the full stroke (2 s, states at 1 kHz). Case B creeps at 5 mm/s with stick-slip (5 s, 500 Hz). Case C is 10 s
of position control with the command sampled and held at 1 kHz. All are golden cases of ``tests/golden``. Every solver
gets rtol = tol and atol_i = tol * SCALE_i. One that takes a single atol integrates the states divided by SCALE.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import cached_property
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


@dataclass(frozen=True)
class Servo:
    """A sampled controller: the target is a sine about mid stroke, the command is held for one period."""

    kp: float
    kd: float
    amplitude_m: float
    frequency_hz: float
    sample_rate_hz: float
    centre_m: float
    samples: int

    @property
    def period(self) -> float:
        """Time for which a command is held, s."""
        return 1.0 / self.sample_rate_hz

    @property
    def gains(self) -> tuple[float, ...]:
        """Gains, amplitude, frequency and centre, as the controllers of `benches.servo` take them."""
        return self.kp, self.kd, self.amplitude_m, self.frequency_hz, self.centre_m

    def command(self, i: int, x: float, v: float) -> float:
        """Return the command at the i-th sample."""
        w = 2.0 * math.pi * self.frequency_hz
        phase = w * i / self.sample_rate_hz
        target = self.centre_m + self.amplitude_m * math.sin(phase)
        speed = self.amplitude_m * w * math.cos(phase)
        return min(1.0, max(-1.0, self.kp * (target - x) + self.kd * (speed - v)))


@dataclass(frozen=True)
class Case:
    """A golden case: description, commands or controller, and the states that every solver must reproduce."""

    name: str
    title: str
    file: str

    @cached_property
    def data(self) -> dict[str, Any]:
        """Content of the case's file."""
        return json.loads((GOLDEN / f"{self.file}.json").read_text())

    @cached_property
    def golden(self) -> np.ndarray:
        """Golden states, shape (n, 6), in the order of `COLUMNS`."""
        with np.load(GOLDEN / f"{self.file}.npz") as data:
            return np.stack([data[c] for c in COLUMNS], axis=1)

    @cached_property
    def initial(self) -> np.ndarray:
        """Initial state, shape (7,), bristle at rest."""
        return np.array([*(self.data["initial"][c] for c in COLUMNS), 0.0])

    @cached_property
    def servo(self) -> Servo | None:
        """Controller, if the case has one."""
        if "servo" not in self.data:
            return None
        servo = self.data["servo"]
        samples = round(self.data["duration_s"] * servo["sample_rate_hz"])
        return Servo(**servo, centre_m=0.5 * self.stroke, samples=samples)

    @cached_property
    def segments(self) -> list[tuple[float, np.ndarray]]:
        """Command steps, each with its sample times from its start to its end."""
        times, commands = self.times, self.data["commands"]
        ends = [*(t for t, _ in commands[1:]), times[-1]]
        return [
            (u, times[(times >= begin - 1e-9) & (times <= end + 1e-9)])
            for (begin, u), end in zip(commands, ends, strict=True)
        ]

    @cached_property
    def times(self) -> np.ndarray:
        """Times of the golden states, s."""
        return np.arange(len(self.golden)) / self.data["sample_rate_hz"]

    @property
    def stroke(self) -> float:
        """Stroke, m."""
        return self.data["drive"]["cylinder"]["stroke_m"]

    @cached_property
    def compared(self) -> np.ndarray:
        """Golden samples that count: those that are not around a first contact with an end stop."""
        position = self.golden[:, POSITION]
        beyond = (position < 0.0) | (position > self.stroke)
        keep = np.ones(len(position), bool)
        for i in np.flatnonzero(beyond[1:] & ~beyond[:-1]):
            keep &= (self.times < self.times[i] - BEFORE_IMPACT_S) | (self.times > self.times[i + 1] + AFTER_IMPACT_S)
        return keep

    def errors(self, states: np.ndarray) -> tuple[float, float]:
        """Return (greatest position error in um, greatest relative pressure error) against the golden states.

        `states` has at least the columns of `COLUMNS`, and a row for each golden sample, or for each of the controller.
        """
        stride = (len(states) - 1) // (len(self.golden) - 1)
        got, want = states[::stride][self.compared], self.golden[self.compared]
        if not np.isfinite(got[:, : len(COLUMNS)]).all():  # NaN must not pass as a small error
            return math.inf, math.inf
        position = np.abs(got[:, POSITION] - want[:, POSITION]).max() * 1e6
        pressure = max(np.abs(got[:, i] / want[:, i] - 1.0).max() for i in (PRESSURE_A, PRESSURE_B))
        return float(position), float(pressure)


A = Case("A", "Case A: full stroke of the reference drive, 2 s, states at 1 kHz", "case_a")
B = Case("B", "Case B: creeping with stick-slip at 5 mm/s, 5 s, states at 500 Hz", "creeps")
C = Case("C", "Case C: 10 s of position control, command sampled and held at 1 kHz", "case_c")
CASES = (A, B, C)


def meets(error: tuple[float, float]) -> bool:
    """Say whether an error is within both bounds."""
    return error[0] <= POSITION_BOUND_UM and error[1] <= PRESSURE_BOUND
