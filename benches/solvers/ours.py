"""The product's core: the solver's own states, and all columns of a trajectory file."""

from __future__ import annotations

import json

import numpy as np

from benches.problem import CASE_A, CASE_C, COLUMNS, SERVO
from pneudrive import _core


class Pneudrive:
    """Timed as a bare solution, as the peers are: the solver's own states at 1 kHz."""

    name = "pneudrive"

    def __init__(self) -> None:
        self.drive = _core.Drive(json.dumps(CASE_A["drive"]))
        times, commands = (list(column) for column in zip(*CASE_A["commands"], strict=True))
        self.motion = (times, commands, CASE_A["duration_s"], CASE_A["sample_rate_hz"], CASE_A["initial"])
        servo = (SERVO[name] for name in ("kp", "kd", "amplitude_m", "frequency_hz"))
        self.control = (*servo, CASE_C["duration_s"], SERVO["sample_rate_hz"], CASE_C["initial"])

    def case_a(self, tol: float) -> np.ndarray:
        """Return the states of case A at 1 kHz, shape (2001, 6)."""
        return self._with_pressures(self.bare_a(tol))

    def case_c(self, tol: float) -> np.ndarray:
        """Return the states of case C at its samples, shape (10001, 6)."""
        return self._with_pressures(self.bare_c(tol))

    def bare_a(self, tol: float) -> np.ndarray:
        """Solve case A for the solver's own states: mass and energy of the gas in place of p and T."""
        return self.drive.states(*self.motion, tol)

    def bare_c(self, tol: float) -> np.ndarray:
        """Solve case C for the solver's own states."""
        return self.drive.servo(*self.control, tol)["states"]

    def _with_pressures(self, states: np.ndarray) -> np.ndarray:
        return np.hstack([states[:, :2], self.drive.chambers(states)])


class Columns(Pneudrive):
    """The same with everything that a trajectory file holds: forces, flows, acceleration."""

    name = "pneudrive, with all columns"

    def case_a(self, tol: float) -> np.ndarray:
        """Return the states of case A at 1 kHz, shape (2001, 6)."""
        columns = self.bare_a(tol)["columns"]
        return np.stack([columns[c] for c in COLUMNS], axis=1)

    def bare_a(self, tol: float) -> dict:
        """Solve case A; the columns of a trajectory file, 2001 samples each."""
        return self.drive.simulate(*self.motion, tol)
