"""Start states of segments: from measurements, and from the model for unmeasured states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.free.lines import at_rest

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.identify.dynamic.sensors import Channel
    from pneudrive.identify.dynamic.shooting import Shooter
    from pneudrive.progress import Watch
    from pneudrive.signals.drive_recording import DriveRecording

    Array = NDArray[np.float64]

POSITION, VELOCITY, PRESSURE_A, TEMPERATURE_A, PRESSURE_B, TEMPERATURE_B = range(6)
#: Columns of a start that are measured channels.
_MEASURED = {
    "position": POSITION,
    "velocity": VELOCITY,
    "pressure_a": PRESSURE_A,
    "temperature_a": TEMPERATURE_A,
    "pressure_b": PRESSURE_B,
    "temperature_b": TEMPERATURE_B,
}
#: Half widths of windows for parabolas, s.
WINDOW_S = 0.01
LEAST_HALF_WIDTH = 3  # samples
#: Multiple of its noise below which the residual of a parabola is accepted.
PARABOLA_NOISE = 1.5
#: Samples that a parabola needs.
_LEAST_SAMPLES = 4
#: Samples of windows in memory at a time.
_AT_ONCE = 1_000_000
#: Error of a parabola for a changing velocity, m/s (assumed).
SLOPE_ERROR_M_S = 2e-3
#: Number of runs for unmeasured states to settle: each starts from the ends of the one before.
ROUNDS = 3
#: Prior standard deviations of a start without more accurate measurements: position,
#: velocity, pressure, temperature, pressure, temperature. The temperature of a gas that was compressed or released
#: before the recording began is within tens of kelvin of the wall's (assumed).
BELIEF = np.array([1e-2, 0.2, 5e4, 20.0, 5e4, 20.0])
#: Bounds of unmeasured states, as a multiple of the prior standard deviation.
POSSIBLE = 4.0
#: States that grow throughout a recording, so that short segments set no bound.
GROWING = ("contact_age_s", "sliding_distance_m", "contact_warming_k")
#: Lower bound of pressure and temperature in a tube, as a share of the least simulated ones.
LEAST_SHARE = 0.2
#: Endings of names of the gas in a tube.
_PRESSURE, _TEMPERATURE = ".pressure_pa", ".temperature_k"
#: Sizes of states for the continuity, in the same order.
SIZE = np.array([1e-3, 1e-2, 1e4, 10.0, 1e4, 10.0])


@dataclass(frozen=True)
class SegmentStarts:
    """Starts of the segments of one recording.

    Attributes
    ----------
    state : ndarray, shape (k, s)
    belief : ndarray, shape (s,)
        Prior standard deviations.
    size : ndarray, shape (s,)
        Relevant change of each state.
    measured : ndarray of bool, shape (s,)
        Mask of measured columns.
    limits : (ndarray, ndarray), shape (s,)
        Bounds of a start; infinite for measured columns.
    """

    state: Array
    belief: Array
    size: Array
    measured: NDArray[np.bool_]
    limits: tuple[Array, Array]


def measured_starts(
    recording: DriveRecording,
    channels: list[Channel],
    noise: Array,
    starts: NDArray[np.int64],
    drive: Drive,
    inner: list[str],
    watch: Watch,
) -> tuple[Array, Array]:
    """Return starts from the smoothed signals; unmeasured states have the values of a drive at rest.

    Parameters
    ----------
    recording : DriveRecording
    channels : list of Channel
        Measured channels, c in number.
    noise : ndarray, shape (c,)
        Noise of the channels.
    starts : ndarray, shape (k,)
        Samples at which segments begin.
    drive : Drive
    inner : list of str
        Further states of the drive, which start at zero.
    watch : Watch

    Returns
    -------
    ndarray, shape (k, 6 + inner), ndarray, shape (6 + inner,)
        Starts, and standard deviations of measured columns; NaN for others.
    """
    ambient = drive.ambient
    usual = [0.5 * drive.cylinder.stroke_m, 0.0]
    usual += [ambient.pressure_pa, ambient.temperature_k] * 2
    usual += [0.0] * len(inner)
    state = np.tile(np.array(usual), (starts.size, 1))
    spread = np.full(state.shape[1], np.nan)
    for channel, white in zip(channels, noise, strict=True):
        column = _MEASURED.get(channel.name)
        if column is None:
            continue
        values = (recording[channel.column] - channel.offset) / channel.gain
        state[:, column], slope, sloping = _smoothed(recording.time_s, values, starts, float(white), watch)
        spread[column] = np.hypot(white, channel.offset_spread)
        if channel.name == "position" and "velocity_m_s" not in recording:
            state[:, VELOCITY] = slope
            spread[VELOCITY] = np.hypot(white * sloping, SLOPE_ERROR_M_S)
    for column in (PRESSURE_A, PRESSURE_B):
        state[:, column] = np.maximum(state[:, column], 0.1 * ambient.pressure_pa)
    for column, name in enumerate(inner, start=BELIEF.size):
        state[:, column] = at_rest(name, (state[:, PRESSURE_A], state[:, PRESSURE_B]), ambient.temperature_k)
    return state, spread


def observed(shooter: Shooter, values: Array, state: Array, spread: Array, names: list[str]) -> SegmentStarts:
    """Return starts with unmeasured states from the model: gas temperatures, bristles, gas of tubes.

    All segments are run, and each takes unmeasured states from the end of the previous one. A wrong guess decays after
    a few rounds. `names` are the start states other than piston and chambers.
    """
    hidden = np.flatnonzero(np.isnan(spread))
    inner = state.shape[1] - BELIEF.size
    most = np.zeros(inner)
    for _ in range(ROUNDS):
        shot = shooter.run(values, state, derivatives=False)
        good = [j for j in range(len(state) - 1) if j not in shot.failures]
        for j in good:
            state[j + 1, hidden] = shot.ends[j, hidden]
        ends = np.delete(shot.ends, list(shot.failures), axis=0)
        if inner and ends.size:
            most = np.maximum(most, np.abs(ends[:, BELIEF.size :]).max(axis=0))
    most = np.where(most > 0.0, most, 1e-6)
    size = 0.1 * most
    for i, name in enumerate(names):  # gas of tubes
        if name.endswith((_PRESSURE, _TEMPERATURE)):
            of = PRESSURE_A if name.endswith(_PRESSURE) else TEMPERATURE_A
            most[i], size[i] = BELIEF[of], SIZE[of]
    belief = np.r_[
        BELIEF, most
    ]  # wide also for measured columns, as the samples are more accurate than their smoothed start
    reach = np.where(np.isnan(spread), POSSIBLE * belief, np.inf)
    grows, is_gas = np.zeros(belief.size, dtype=bool), np.arange(belief.size) > VELOCITY
    grows[BELIEF.size :] = [name in GROWING for name in names]
    is_gas[BELIEF.size :] = [name.endswith((_PRESSURE, _TEMPERATURE)) for name in names]
    lowest = state.min(axis=0)
    limits = (
        np.where(is_gas & np.isnan(spread), np.maximum(lowest - reach, LEAST_SHARE * lowest), lowest - reach),
        np.where(grows, np.inf, state.max(axis=0) + reach),
    )
    return SegmentStarts(state, belief, np.r_[SIZE, size], ~np.isnan(spread), limits)


def _smoothed(
    time_s: Array, values: Array, at: NDArray[np.int64], noise: float, watch: Watch
) -> tuple[Array, Array, float]:
    """Return value and slope of a parabola through the samples around each of some samples.

    The window is the widest of a few over which the signal is a parabola within its noise. The third value times the
    noise is the standard error of a slope over the narrowest used window.
    """
    good = np.isfinite(values)
    step = float(np.median(np.diff(time_s)))
    widest = max(LEAST_HALF_WIDTH, round(WINDOW_S / step))
    widths = sorted({max(LEAST_HALF_WIDTH, widest >> k) for k in range(6)}, reverse=True)
    level, slope = np.empty(at.size), np.zeros(at.size)
    left, narrowest = np.arange(at.size), widest
    for half in widths:
        fits = []
        for some in np.array_split(left, max(1, left.size * (2 * half + 1) // _AT_ONCE)):
            watch.look()
            level[some], slope[some], fit = _parabolas(time_s, values, good, at[some], half, PARABOLA_NOISE * noise)
            fits.append(fit)
        left = left[~np.concatenate(fits)]
        if not left.size:
            break
        narrowest = LEAST_HALF_WIDTH
    return level, slope, 1.0 / (step * float(np.sqrt(2.0 * np.sum(np.arange(narrowest + 1.0) ** 2))))


def _parabolas(
    time_s: Array, values: Array, good: NDArray[np.bool_], at: NDArray[np.int64], half: int, most: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return value and slope of the parabola around each sample, and a mask of samples with a small residual.

    In a gap of the signal, with fewer than four samples in a window, the nearest value is used.
    """
    index = at[:, None] + np.arange(-half, half + 1)
    used = (index >= 0) & (index < time_s.size)
    index = index.clip(0, time_s.size - 1)
    used &= good[index]
    fits = used.sum(axis=1) >= _LEAST_SAMPLES
    level, slope = np.empty(at.size), np.zeros(at.size)
    present = np.flatnonzero(good)
    for j in np.flatnonzero(~fits):
        level[j] = values[present[np.argmin(np.abs(present - at[j]))]]
    used, index, at = used[fits], index[fits], at[fits]
    count = used.sum(axis=1)
    t = np.where(used, time_s[index] - time_s[at, None], 0.0)
    scale = np.abs(t).max(axis=1)
    t /= scale[:, None]
    mean = np.where(used, values[index], 0.0).sum(axis=1) / count
    y = np.where(used, values[index] - mean[:, None], 0.0)
    design = np.stack([used, t, t * t], axis=2)
    across = design.transpose(0, 2, 1)
    c = np.linalg.solve(across @ design, across @ y[:, :, None])
    off = np.sqrt(np.sum((y - (design @ c)[:, :, 0]) ** 2, axis=1) / np.maximum(count - 3, 1))
    level[fits], slope[fits] = c[:, 0, 0] + mean, c[:, 1, 0] / scale
    done = ~fits
    done[fits] = off <= most
    return level, slope, done


def white_noise(values: Array) -> float:
    """Estimate the standard deviation of white noise on a smooth signal, from its third differences."""
    third = np.diff(values[np.isfinite(values)], 3)
    return float(np.sqrt(np.mean(third**2) / 20.0)) if third.size else 0.0
