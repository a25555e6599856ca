"""Breakaway after stops, measured and modelled: peak of the friction force before the piston moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.validate.balance import Scene, moving_mass
from pneudrive.validate.residuals import bending_m, near_stops
from pneudrive.validate.simulation import run_model

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]

#: Shortest stop, s; shorter rests are reversals.
LEAST_STOP_S = 0.05
#: Longest simulated part of a rest before its end, s.
MOST_STOP_S = 1.0


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


def breakaways(drive: Drive, signals: Signals) -> tuple[RecordedBreakaway, ...]:
    """Compare the model's breakaway with the measured one at each stop, from the measured state in the stop.

    The peak occurs before the piston has moved by the deflection of bristles. Both forces are smoothed in the same way.
    """
    touching = near_stops(drive, signals)
    rests = [(start, onset) for start, onset in _rests(signals) if not touching[start:onset].any()]
    if not rests:
        return ()
    starts = [max(start, onset - round(MOST_STOP_S / signals.step_s)) for start, onset in rests]
    run = run_model(drive, signals, np.unique(np.r_[0, starts]))
    measured = carried_friction(drive, signals)
    model = signals.smooth(run["friction_force_n"])
    bend = bending_m(drive)
    out = []
    for k, ((start, onset), begun) in enumerate(zip(rests, starts, strict=True)):
        end = starts[k + 1] if k + 1 < len(starts) else signals.time_s.size
        sign = float(np.sign(signals.velocity_m_s[onset]))
        first, first_model = (
            _peak(sign * force[begun:end], np.abs(x[begun:end] - x[begun]), bend)
            for force, x in ((measured, signals.smooth(signals.position_m)), (model, run["position_m"]))
        )
        if first[1] and first[0] > 0.0 and np.isfinite(first_model[0]):
            times = (float(signals.time_s[start]), float(signals.time_s[onset]))
            out.append(RecordedBreakaway(*times, first[0], first_model[0], first_model[1]))
    return tuple(out)


def _peak(force: Array, moved: Array, bend: float) -> tuple[float, bool]:
    """Return the largest force before the piston has moved by `bend`, and whether it has moved by `bend`."""
    beyond = np.flatnonzero(moved > bend)
    return float(np.max(force[: int(beyond[0]) + 1] if beyond.size else force)), bool(beyond.size)


def carried_friction(drive: Drive, signals: Signals) -> Array:
    """Return the friction force, N in -x, from the core: all other forces on the moving mass minus m a."""
    force = signals.smooth(Scene.of(drive, signals).terms.force_n)
    return force - moving_mass(drive) * signals.acceleration_m_s2


def _rests(signals: Signals) -> list[tuple[int, int]]:
    """Yield first sample and onset of each rest that is long enough and ends in motion."""
    still = ~signals.moving
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    least = round(LEAST_STOP_S / signals.step_s)
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= least and b < still.size]
