"""The product's core: the solver's own states, and all columns of a trajectory file."""

from __future__ import annotations

from typing import Any

import numpy as np

from benches.problem import COLUMNS, A, Case
from pneudrive.describe.system import System


class Pneudrive:
    """Timed as a bare solution, like the peers: the solver's states at the samples of the case."""

    name = "pneudrive"
    slow = False

    def __init__(self) -> None:
        self.drive = System.of_drive(A.data["drive"]).compiled()

    def solve(self, case: Case, tol: float) -> np.ndarray:
        """Return the states of a case at its samples, shape (n, 6)."""
        states = self.bare(case, tol)
        return np.hstack([states[:, :2], self.drive.chambers(states)])

    def bare(self, case: Case, tol: float) -> Any:
        """Solve a case for the solver's own states: mass and energy of the gas in place of p and T."""
        if case.servo is None:
            return self.drive.sampled_states(*motion(case), tol)
        servo = case.servo
        gains = (servo.kp, servo.kd, servo.amplitude_m, servo.frequency_hz)
        return self.drive.servo(*gains, case.data["duration_s"], servo.sample_rate_hz, case.data["initial"], tol)[
            "states"
        ]


class Columns(Pneudrive):
    """The same with all columns of a trajectory file: forces, flows, acceleration."""

    name = "pneudrive, with all columns"
    slow = True  # case C has no columns

    def solve(self, case: Case, tol: float) -> np.ndarray:
        """Return the states of a case at its samples, shape (n, 6)."""
        columns = self.bare(case, tol)["columns"]
        return np.stack([columns[c] for c in COLUMNS], axis=1)

    def bare(self, case: Case, tol: float) -> Any:
        """Solve a case, and return the columns of a trajectory file."""
        return self.drive.simulate(*motion(case), tol)


def motion(case: Case) -> tuple[Any, ...]:
    """Return the plan of the command, duration, sample rate and start of a case of command steps."""
    times, commands = (list(column) for column in zip(*case.data["commands"], strict=True))
    return [("command", times, commands)], case.data["duration_s"], case.data["sample_rate_hz"], case.data["initial"]
