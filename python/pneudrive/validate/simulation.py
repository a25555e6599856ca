"""Simulation of a recorded command: free runs, runs with resets to measured states, and breakaway after stops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.free.lines import at_rest
from pneudrive.validate.balance import Scene, bending_m, moving_mass, near_stops

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive._core import Shooting
    from pneudrive.describe.drive import Drive
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]

RTOL = 1e-6
#: Result of a run of a drive as its circuit.
LINES_COLUMNS = ["position_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa", "friction_force_n"]
#: Shortest stop, s; shorter rests are reversals.
LEAST_STOP_S = 0.05
#: Longest simulated part of a rest before its end, s.
MOST_STOP_S = 1.0


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


@dataclass(frozen=True)
class RecordedBreakaway:
    """A stop that is followed by motion.

    Attributes
    ----------
    start_s, onset_s : float
        Times at which the piston came to rest, and started to move.
    measured_n, model_n : float
        Peak of the friction force in the direction of motion, N.
    model_moved : bool
        Whether the model broke away before the next stop; if not, its peak is its largest force at rest.
    """

    start_s: float
    onset_s: float
    measured_n: float
    model_n: float
    model_moved: bool

    @property
    def error(self) -> float:
        """Relative error of the model."""
        return (self.model_n - self.measured_n) / abs(self.measured_n)


def run_model(drive: Drive, signals: Signals, restarts: NDArray[np.int64] | None = None) -> ModelRun:
    """Simulate the recorded command with resets to the measured state at the given samples; None: only at the first.

    A reset sets position, velocity and pressures; temperatures and inner states of friction continue. At the start,
    temperatures are measured or ambient, and the bristles balance the force of the pressures.
    """
    at = np.zeros(1, dtype=np.int64) if restarts is None else np.asarray(restarts, dtype=np.int64)
    states = np.array([signals.state(int(i)) for i in at])
    # A noisy position is limited to the stroke plus the possible depth in the end stops.
    states[:, 1] = np.clip(states[:, 1], -1e-3, drive.cylinder.stroke_m + 1e-3)
    change = np.r_[True, np.diff(signals.command) != 0.0]
    steps = (signals.time_s[change], signals.command[change])
    if not drive.is_plain:
        return _run_as_circuit(drive, signals, at, states, steps)
    end_s, rate = float(signals.time_s[-1]), 1.0 / signals.step_s
    columns, failures = drive.system.compiled().restarted(
        *steps, end_s, rate, states, signals.start_temperatures(drive), RTOL
    )
    n = signals.time_s.size
    even = {name: values[:n] for name, values in columns.items()}
    if next(iter(even.values())).size < n:  # rounding of duration times rate
        even = {name: np.interp(signals.time_s, columns["time_s"], values) for name, values in even.items()}
    return ModelRun(even, at, tuple(failures))


def _run_as_circuit(
    drive: Drive, signals: Signals, at: NDArray[np.int64], states: Array, steps: tuple[Array, Array]
) -> ModelRun:
    """Simulate the segments one after the other; the gas in tubes and joints continues from segment to segment.

    Bristles start undeflected. A failed segment ends the run: the state of the gas in the tubes is unknown after it.
    """
    core = drive.system.compiled()
    t_a, t_b = signals.start_temperatures(drive)
    _, x, v, p_a, p_b = states[0]
    inner = [at_rest(name, (p_a, p_b), drive.ambient.temperature_k) for name in core.segment_names[6:]]
    state = np.array([[x, v, p_a, t_a, p_b, t_b, *inner]])
    columns = {name: np.full(signals.time_s.size, np.nan) for name in LINES_COLUMNS}
    ends = [*at[1:].tolist(), signals.time_s.size - 1]
    for k, (begin, end) in enumerate(zip(at.tolist(), ends, strict=True)):
        if k:
            state[0, [0, 1, 2, 4]] = states[k][1:]
        request: Shooting = {
            "times": steps[0],
            "commands": steps[1],
            "sample_times": signals.time_s[begin : end + 1],
            "starts": [0],
            "initial": state,
            "outputs": LINES_COLUMNS,
            "rtol": RTOL,
        }
        segment = core.shoot("command", request)
        for name, values in zip(LINES_COLUMNS, segment["values"].T, strict=True):
            columns[name][begin : end + 1] = values
        if segment["failures"][0] is not None:
            return ModelRun(columns, at, (segment["failures"][0],))
        state = segment["ends"].copy()
    return ModelRun(columns, at, ())


def breakaways(drive: Drive, signals: Signals) -> tuple[RecordedBreakaway, ...]:
    """Compare the model's breakaway with the measured one at each stop, from the measured state in the stop.

    The peak occurs before the piston has moved by the deflection of bristles. Both forces are smoothed in the same way.
    """
    still, touching = ~signals.moving, near_stops(drive, signals)
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    least = round(LEAST_STOP_S / signals.step_s)
    rests = [
        (start, onset)
        for start, onset in edges.reshape(-1, 2).tolist()
        if onset - start >= least and onset < still.size and not touching[start:onset].any()
    ]
    if not rests:
        return ()
    starts = [max(start, onset - round(MOST_STOP_S / signals.step_s)) for start, onset in rests]
    run = run_model(drive, signals, np.unique(np.r_[0, starts]))
    # All forces on the moving mass except friction, minus m a, N in -x.
    others = signals.smooth(Scene.of(drive, signals).terms.force_n)
    measured = others - moving_mass(drive) * signals.acceleration_m_s2
    model, position = signals.smooth(run["friction_force_n"]), signals.smooth(signals.position_m)
    bend, out = bending_m(drive), []
    for (start, onset), begin, end in zip(rests, starts, [*starts[1:], still.size], strict=True):
        part, sign = slice(begin, end), float(np.sign(signals.velocity_m_s[onset]))
        peak, moved = _peak(sign * measured[part], position[part], bend)
        model_peak, model_moved = _peak(sign * model[part], run["position_m"][part], bend)
        if moved and peak > 0.0 and np.isfinite(model_peak):
            times = (float(signals.time_s[start]), float(signals.time_s[onset]))
            out.append(RecordedBreakaway(*times, peak, model_peak, model_moved))
    return tuple(out)


def _peak(force: Array, position: Array, bend: float) -> tuple[float, bool]:
    """Return the largest force before the piston has moved by `bend`, and whether it has moved by `bend`."""
    beyond = np.flatnonzero(np.abs(position - position[0]) > bend)
    return float(np.max(force[: int(beyond[0]) + 1] if beyond.size else force)), bool(beyond.size)
