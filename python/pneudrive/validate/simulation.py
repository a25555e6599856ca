"""The model under a recorded command: a free run from the first measured state, and runs put back to measured ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.simulate import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe import Drive
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]

RTOL = 1e-6


@dataclass(frozen=True, eq=False)
class ModelRun:
    """What the model does under a recorded command.

    Attributes
    ----------
    columns : dict
        As a trajectory file has them, at the samples of `Signals`; NaN where the model could not go on.
    restarts : ndarray of int
        Samples at which it was put back to the measured state; the first is 0.
    failures : tuple of str
        What could not go on.
    """

    columns: dict[str, Array]
    restarts: NDArray[np.int64]
    failures: tuple[str, ...]

    def __getitem__(self, column: str) -> Array:
        return self.columns[column]


def run_model(drive: Drive, signals: Signals, restarts: NDArray[np.int64] | None = None) -> ModelRun:
    """Simulate the recorded command, put back to the measured state at the given samples; None: only at the first.

    Position, velocity and pressures are set; temperatures and the inner states of friction go on. At the start,
    temperatures are measured ones or those of the surroundings, and bristles carry what the pressures leave to them.
    """
    at = np.zeros(1, dtype=np.int64) if restarts is None else np.asarray(restarts, dtype=np.int64)
    states = np.array([_inside(drive, signals.state(int(i))) for i in at])
    times, commands = command_steps(signals)
    columns, failures = compiled(drive.core_json()).restarted(
        times,
        commands,
        float(signals.time_s[-1]),
        1.0 / signals.step_s,
        states,
        start_temperatures(drive, signals),
        RTOL,
    )
    n = signals.time_s.size
    even = {name: values[:n] for name, values in columns.items()}
    if next(iter(even.values())).size < n:  # rounding of duration times rate
        even = {name: np.interp(signals.time_s, columns["time_s"], values) for name, values in even.items()}
    return ModelRun(even, at, tuple(failures))


def _inside(drive: Drive, state: tuple[float, ...]) -> tuple[float, ...]:
    """Keep a noisy position inside the stroke by as much as a piston can go into its stops."""
    t, x, v, p_a, p_b = state
    return (t, float(np.clip(x, -1e-3, drive.cylinder.stroke_m + 1e-3)), v, p_a, p_b)


def command_steps(signals: Signals) -> tuple[Array, Array]:
    """Return the times at which the recorded command changes, and what it changes to."""
    change = np.r_[True, np.diff(signals.command) != 0.0]
    return signals.time_s[change], signals.command[change]


def start_temperatures(drive: Drive, signals: Signals) -> list[float]:
    """Measured temperatures at the first sample, else that of the surroundings, K."""
    recording = signals.recording
    names = ("temperature_a_k", "temperature_b_k")
    return [float(recording[n][0]) if n in recording else drive.ambient.temperature_k for n in names]
