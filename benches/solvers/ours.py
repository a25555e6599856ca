"""The product: the call that `pneudrive.simulate` makes, without description, units and labels."""

from __future__ import annotations

import json

import numpy as np

from benches.problem import CASE_A, CASE_C, COLUMNS, SERVO
from pneudrive import _core


class Pneudrive:
    """States at 1 kHz, and with them all that a trajectory file holds: forces, flows, acceleration."""

    name = "pneudrive"

    def __init__(self) -> None:
        self.drive = _core.Drive(json.dumps(CASE_A["drive"]))
        self.times, self.commands = (list(column) for column in zip(*CASE_A["commands"], strict=True))

    def solve_a(self, tol: float) -> dict[str, np.ndarray]:
        """Solve case A; the columns of a trajectory file, 2001 samples each."""
        case = CASE_A
        return self.drive.simulate(
            self.times, self.commands, case["duration_s"], case["sample_rate_hz"], case["initial"], tol
        )["columns"]

    def solve_c(self, tol: float) -> dict[str, np.ndarray]:
        """Solve case C; the columns of a trajectory file, 10001 samples each."""
        s, case = SERVO, CASE_C
        return self.drive.servo(
            s["kp"],
            s["kd"],
            s["amplitude_m"],
            s["frequency_hz"],
            case["duration_s"],
            s["sample_rate_hz"],
            case["initial"],
            tol,
        )["columns"]

    def case_a(self, tol: float) -> np.ndarray:
        """Return the states of case A at 1 kHz, shape (2001, 6)."""
        columns = self.solve_a(tol)
        return np.stack([columns[c] for c in COLUMNS], axis=1)

    def case_c(self, tol: float) -> np.ndarray:
        """Return the states of case C at its samples, shape (10001, 6)."""
        columns = self.solve_c(tol)
        return np.stack([columns[c] for c in COLUMNS], axis=1)
