"""Delay between the pressures of closed chambers and the recorded motion.

The gas of a closed chamber of volume V exchanges heat with a wall of constant temperature. With p = m R T / V, its
energy balance is linear in p. In y = p V^gamma, the balance is a first-order lag. Each time step has the exact decay:

    dp/dt = -gamma p (dV/dt)/V - k (p - c/V)      k = (gamma - 1) H / (m R)      c = m R T_wall
    y = p V^gamma      dy/dt = k (c V^(gamma - 1) - y)

The error of this model changes slowly. The fit therefore minimises the change of the residual from sample to sample.
Reversals and stops then determine the delay, and the slow heat exchange does not bias the delay.

Areas cancel, because only the ratio of volumes matters: V/A = distance of the piston from its reversal + L. The free
parameters of each chamber are L (volume at the reversal over area), k, initial pressure, initial temperature and delay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pneudrive.arrays import Array
from pneudrive.constants import ANR_TEMPERATURE_K
from pneudrive.estimate.estimates import student
from pneudrive.signals.recording import Recording

PRESSURES = ("pressure_a_pa", "pressure_b_pa")
GAMMA = 1.4  # ratio of specific heats of air and nitrogen
STEP_S, MOST_SAMPLES = 0.1, 5000  # step and largest number of compared times, s
LEAST_CHANGE = 0.1  # least range of a pressure relative to its mean: a smaller one belongs to an open chamber (assumed)
LARGEST_RMS = 0.02  # of the range: with larger residuals a chamber is not closed (assumed)
AT_REST_K, REST_S, REST = 2.0, 0.5, 0.002  # spread of the first temperature; a start at rest: first seconds, of travel
IN_MOTION_K = 30.0  # the same for a start in motion (assumed); the wall has the temperature of the reference atmosphere
MODEL_RMS = 0.005  # of the range: residuals of a good model, with which the first temperature is weighted (assumed)
LARGEST_S = 3.0  # largest delay that is sought
BLOCK_S, LEAST_BLOCKS = 15.0, 8  # blocks of time of the standard error
LATE_S = 0.05  # smaller delays are within the error of the model and of usual clocks (assumed)


@dataclass(frozen=True)
class PressureDelay:
    """Delay of the pressures relative to the motion: value and half width of its 95 % interval, in s.

    Attributes
    ----------
    value_s : float
        Positive if the pressures lag behind the position.
    half_width_s : float
        Half width of the interval. It includes the correlation of residuals, the difference between both chambers, and
        the sampling interval.
    """

    value_s: float
    half_width_s: float

    @property
    def is_clear(self) -> bool:
        """Whether the delay exceeds 50 ms and its own uncertainty."""
        return abs(self.value_s) > max(LATE_S, self.half_width_s)

    def removed(self, recording: Recording) -> Recording:
        """Return the recording with its pressures shifted by the delay. Samples without shifted pressures are cut."""
        shifted = recording.time_s + self.value_s
        there = (shifted >= recording.time_s[0]) & (shifted <= recording.time_s[-1])
        pressures = {name: np.interp(shifted, recording.time_s, getattr(recording, name)) for name in PRESSURES}
        return replace(recording, **pressures).at(there)

    def __str__(self) -> str:
        """Return a sentence with the delay."""
        words = "lag behind" if self.value_s >= 0.0 else "lead"
        return f"the pressures {words} the position by {abs(self.value_s):.3f} ± {self.half_width_s:.3f} s"


def pressure_delay(recording: Recording) -> PressureDelay | None:
    """Estimate the delay of the pressures relative to the motion from the closed chambers.

    Parameters
    ----------
    recording : Recording
        Only time, position and pressures are used.

    Returns
    -------
    PressureDelay or None
        None if no chamber is closed: its pressure is nearly constant, or does not follow the position.
    """
    good = np.all([np.isfinite(getattr(recording, name)) for name in ("time_s", "position_m", *PRESSURES)], axis=0)
    time, position = recording.time_s[good], recording.position_m[good]
    if time.size < 100 or np.ptp(position) <= 0.0:
        return None
    span = time[-1] - time[0]
    count = int(min(max(span / STEP_S, 200.0), MOST_SAMPLES, time.size))
    grid = np.linspace(time[0], time[-1], count)
    x = np.interp(grid, time, position)
    chambers = []
    for name, distance in zip(PRESSURES, (x - x.min(), x.max() - x), strict=True):
        pressure = np.interp(grid, time, getattr(recording, name)[good])
        if np.ptp(pressure) > LEAST_CHANGE * pressure.mean() and pressure.min() > 0.0:
            found = _chamber_delay(grid - grid[0], distance, pressure)
            chambers += [] if found is None else [found]
    if not chambers:
        return None
    values, errors, freedom = np.array(chambers).T
    weights = errors**-2 / np.sum(errors**-2)
    value = float(weights @ values)
    inside, between = np.sum(errors**-2) ** -0.5, np.sqrt(weights @ (values - value) ** 2)
    error = max(inside, between)
    resolution = 0.5 * span / (time.size - 1)  # an instant lies within one sampling interval
    return PressureDelay(value, float(np.hypot(student(freedom.min()) * error, resolution)))


def _simulated(time_s: Array, distance_m: Array, point: Array) -> Array:
    """Return the pressure of a closed chamber at the parameters `point`.

    These are ln L, ln k, initial pressure, relative deviation of the initial temperature from the wall, and delay.
    """
    from scipy.signal import lfilter

    volume = distance_m + np.exp(point[0])
    volume = volume / volume[0]
    decay = np.exp(-np.exp(point[1]) * time_s[1])
    power = volume ** (GAMMA - 1.0)
    warming = (1.0 - decay) * point[2] / (1.0 + point[3])
    source = np.r_[point[2], warming * 0.5 * (power[1:] + power[:-1])]
    pressure = lfilter([1.0], [1.0, -decay], source) / volume**GAMMA
    return np.interp(time_s - point[4], time_s, pressure)


def _chamber_delay(time_s: Array, distance_m: Array, pressure_pa: Array) -> tuple[float, float, float] | None:
    """Return delay, standard error and degrees of freedom of one chamber; None if it is not closed."""
    from scipy.optimize import least_squares

    travel, unit = np.ptp(distance_m), np.ptp(pressure_pa)
    begins = distance_m[time_s <= REST_S]
    kelvin = AT_REST_K if np.ptp(begins) < REST * travel else IN_MOTION_K
    first = pressure_pa[: max(begins.size, 1)].mean() if kelvin == AT_REST_K else pressure_pa[0]
    scale = np.array([1.0, 1.0, unit, kelvin / ANR_TEMPERATURE_K, 0.1])

    def residual(point: Array) -> Array:
        rest = np.diff(pressure_pa - _simulated(time_s, distance_m, point)) / unit
        return np.r_[rest, MODEL_RMS * np.sqrt(rest.size) * 0.05 * point[3] * ANR_TEMPERATURE_K / kelvin]

    low = np.array([np.log(1e-3 * travel), np.log(1e-6), 0.0, -0.3, -LARGEST_S])
    high = np.array([np.log(1e3 * travel), np.log(1e3), np.inf, 0.3, LARGEST_S])
    begin = np.array([np.log(travel), np.log(0.1), first, 0.0, 0.0])
    found = least_squares(residual, begin, bounds=(low, high), x_scale=scale)
    rest, jacobian = found.fun[:-1], found.jac
    level = (pressure_pa - _simulated(time_s, distance_m, found.x)) / unit
    if level.std() > LARGEST_RMS or found.active_mask[[0, 4]].any():
        return None
    jacobian = jacobian * scale
    blocks = max(int(time_s[-1] / BLOCK_S), LEAST_BLOCKS)
    edges = np.unique(np.linspace(0, rest.size, blocks + 1).astype(int))[:-1]
    scores = np.add.reduceat(jacobian[:-1] * rest[:, None], edges, axis=0)
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    freedom = max(len(edges) - begin.size, 3)
    variance = (inverse @ (scores.T @ scores) @ inverse)[4, 4] * len(edges) / freedom
    return found.x[4], np.sqrt(variance) * scale[4], freedom
