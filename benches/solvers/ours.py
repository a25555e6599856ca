"""The product's core: the solver's own states, and all columns of a trajectory file."""

from __future__ import annotations

from typing import Any

import numpy as np

from benches import servo
from benches.problem import COLUMNS, A, Case
from pneudrive.describe.system import System


class Pneudrive:
    """Timed as a bare solution, like the peers: the solver's states at the samples of the case."""

    name = "pneudrive"
    slow = False

    def __init__(self) -> None:
        self.drive = System.of_drive(A.data["drive"]).compiled()
        self.controllers: dict[str, Any] = {}

    def controller(self, *gains: float) -> Any:
        """Return the controller of a case in compiled code."""
        return servo.compiled(*gains)

    def solve(self, case: Case, tol: float) -> np.ndarray:
        """Return the states of a case at its samples, shape (n, 6)."""
        found = self.bare(case, tol)
        if case.servo is not None:
            return np.stack([found[name] for name in servo.READS], axis=1)
        return np.hstack([found[:, :2], self.drive.chambers(found)])

    def bare(self, case: Case, tol: float) -> Any:
        """Solve a case for the solver's own states: mass and energy of the gas in place of p and T.

        With a controller it is a session, as a user calls it, and reads all columns of the comparison.
        """
        if case.servo is None:
            return self.drive.sampled_states(*motion(case), tol)
        if case.name not in self.controllers:
            self.controllers[case.name] = self.controller(*case.servo.gains)
        sampling = case.data["duration_s"], case.servo.sample_rate_hz
        return servo.follow_sine(self.drive, self.controllers[case.name], *sampling, case.data["initial"], tol)


class Called(Pneudrive):
    """The same with a controller in Python, which the session calls at each sample."""

    name = "pneudrive, controller in Python"

    def controller(self, *gains: float) -> Any:
        """Return the controller of a case in Python."""
        return servo.controller(*gains)


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
