"""A peer: a solver that continues from a state under a constant command."""

from __future__ import annotations

import numpy as np

from benches.problem import Case


class Peer:
    """A solver with one method to write, `segment`; loops over command steps and over samples are here."""

    name: str
    slow = False  # a Python right-hand side: not run where there are thousands of segments

    def segment(self, y: np.ndarray, u: float, times: np.ndarray, tol: float) -> np.ndarray:
        """Return the states at `times`, shape (n, 7), under the command `u`, from `y` at the first of them on."""
        raise NotImplementedError

    def solve(self, case: Case, tol: float) -> np.ndarray:
        """Return the states of a case at its samples, shape (n, 7)."""
        return self.steps(case, tol) if case.servo is None else self.control(case, tol)

    bare = solve  # what is timed; a peer with states of its own leaves out what turns them into p and T

    def steps(self, case: Case, tol: float) -> np.ndarray:
        """Solve a case of command steps."""
        y, parts = case.initial, [case.initial[None]]
        for u, times in case.segments:
            states = self.segment(y, u, times, tol)
            parts.append(states[1:])
            y = states[-1].copy()
        return np.concatenate(parts)

    def control(self, case: Case, tol: float) -> np.ndarray:
        """Solve a case with a controller."""
        servo = case.servo
        assert servo is not None
        states = np.empty((servo.samples + 1, 7))
        states[0] = y = case.initial
        for i in range(servo.samples):
            times = np.array([i * servo.period, (i + 1) * servo.period])
            states[i + 1] = y = self.segment(y, servo.command(i, y[0], y[1]), times, tol)[-1].copy()
        return states
