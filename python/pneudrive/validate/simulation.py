"""Simulation of a recorded command: free runs from the first measured state, runs with resets to measured ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.free.lines import at_rest

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive._core import Shooting
    from pneudrive.describe.drive import Drive
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]

RTOL = 1e-6
#: Result of a run of a drive as its circuit.
LINES_COLUMNS = ["position_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa", "friction_force_n"]


@dataclass(frozen=True, eq=False)
class ModelRun:
    """Simulation of a recorded command.

    Attributes
    ----------
    columns : dict
        Columns of a trajectory file at the samples of `Signals`; NaN after a failure.
    restarts : ndarray of int
        Samples with a reset to the measured state; the first is 0.
    failures : tuple of str
        Messages of failed segments.
    """

    columns: dict[str, Array]
    restarts: NDArray[np.int64]
    failures: tuple[str, ...]

    def __getitem__(self, column: str) -> Array:
        return self.columns[column]


def run_model(drive: Drive, signals: Signals, restarts: NDArray[np.int64] | None = None) -> ModelRun:
    """Simulate the recorded command with resets to the measured state at the given samples; None: only at the first.

    A reset sets position, velocity and pressures; temperatures and inner states of friction continue. At the start,
    temperatures are measured or ambient, and the bristles balance the force of the pressures.
    """
    at = np.zeros(1, dtype=np.int64) if restarts is None else np.asarray(restarts, dtype=np.int64)
    states = np.array([_inside(drive, signals.state(int(i))) for i in at])
    if not drive.is_plain:
        return _run_as_circuit(drive, signals, at, states)
    times, commands = command_steps(signals)
    columns, failures = drive.system.compiled().restarted(
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


def _run_as_circuit(drive: Drive, signals: Signals, at: NDArray[np.int64], states: Array) -> ModelRun:
    """Simulate the segments one after the other; the gas in tubes and joints continues from segment to segment.

    Bristles start undeflected. A failed segment ends the run: the state of the gas in the tubes is unknown after it.
    """
    core = drive.system.compiled()
    t_a, t_b = start_temperatures(drive, signals)
    _, x, v, p_a, p_b = states[0]
    inner = [at_rest(name, (p_a, p_b), drive.ambient.temperature_k) for name in core.segment_names[6:]]
    state = np.array([[x, v, p_a, t_a, p_b, t_b, *inner]])
    times, commands = command_steps(signals)
    columns = {name: np.full(signals.time_s.size, np.nan) for name in LINES_COLUMNS}
    ends = [*at[1:].tolist(), signals.time_s.size - 1]
    for k, (begin, end) in enumerate(zip(at.tolist(), ends, strict=True)):
        if k:
            state[0, [0, 1, 2, 4]] = states[k][1:]
        asked: Shooting = {
            "times": times,
            "commands": commands,
            "sample_times": signals.time_s[begin : end + 1],
            "starts": [0],
            "initial": state,
            "outputs": LINES_COLUMNS,
            "rtol": RTOL,
        }
        shot = core.shoot("command", asked)
        for name, values in zip(LINES_COLUMNS, shot["values"].T, strict=True):
            columns[name][begin : end + 1] = values
        if shot["failures"][0] is not None:
            return ModelRun(columns, at, (shot["failures"][0],))
        state = shot["ends"].copy()
    return ModelRun(columns, at, ())


def _inside(drive: Drive, state: tuple[float, ...]) -> tuple[float, ...]:
    """Limit a noisy position to the stroke plus the possible depth in the end stops."""
    t, x, v, p_a, p_b = state
    return (t, float(np.clip(x, -1e-3, drive.cylinder.stroke_m + 1e-3)), v, p_a, p_b)


def command_steps(signals: Signals) -> tuple[Array, Array]:
    """Return the times at which the recorded command changes, and its new values."""
    change = np.r_[True, np.diff(signals.command) != 0.0]
    return signals.time_s[change], signals.command[change]


def start_temperatures(drive: Drive, signals: Signals) -> list[float]:
    """Return the measured temperatures at the first sample, or the ambient one, K."""
    recording = signals.recording
    names = ("temperature_a_k", "temperature_b_k")
    return [float(recording[n][0]) if n in recording else drive.ambient.temperature_k for n in names]
