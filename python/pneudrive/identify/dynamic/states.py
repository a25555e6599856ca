"""Where segments begin: from what was measured, and from the model for what was not."""

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
    from pneudrive.signals.drive_recording import DriveRecording
    from pneudrive.watch import Watch

    Array = NDArray[np.float64]

POSITION, VELOCITY, PRESSURE_A, TEMPERATURE_A, PRESSURE_B, TEMPERATURE_B = range(6)
#: Columns of a start that a channel gives directly.
_MEASURED = {
    "position": POSITION,
    "velocity": VELOCITY,
    "pressure_a": PRESSURE_A,
    "temperature_a": TEMPERATURE_A,
    "pressure_b": PRESSURE_B,
    "temperature_b": TEMPERATURE_B,
}
#: Half width of the window in which a signal is a parabola, s.
WINDOW_S = 0.01
LEAST_HALF_WIDTH = 3  # samples
#: A signal is a parabola where what is left is below this multiple of its noise.
PARABOLA_NOISE = 1.5
#: What a parabola over the window misses of a velocity that changes, m/s (assumed).
SLOPE_ERROR_M_S = 2e-3
#: Runs in which what is not measured settles: each takes over the ends of the one before.
ROUNDS = 3
#: Standard deviations of what a start is believed to be before the fit, where nothing measured says more: position,
#: velocity, pressure, temperature, pressure, temperature. The temperature of a gas that was compressed or released
#: before the recording began is within tens of kelvin of the wall's (assumed).
BELIEF = np.array([1e-2, 0.2, 5e4, 20.0, 5e4, 20.0])
#: Multiple of the belief within which what nothing measures stays.
POSSIBLE = 4.0
#: States that go on growing through a record: what short segments show of them is no bound.
GROWING = ("contact_age_s", "sliding_distance_m", "contact_warming_k")
#: Share of the least pressure and temperature that a model shows in a tube, below which none is sought.
LEAST_SHARE = 0.2
#: Endings of names of the gas in a tube.
_PRESSURE, _TEMPERATURE = ".pressure_pa", ".temperature_k"
#: Sizes in which the continuity of states is judged, likewise.
SIZE = np.array([1e-3, 1e-2, 1e4, 10.0, 1e4, 10.0])


@dataclass(frozen=True)
class SegmentStarts:
    """Starts of the segments of one recording.

    Attributes
    ----------
    state : ndarray, shape (k, s)
    belief : ndarray, shape (s,)
        Standard deviations of what is believed before the fit.
    size : ndarray, shape (s,)
        Size of a change of each state that matters.
    measured : ndarray of bool, shape (s,)
        Columns that are known from the signals.
    limits : (ndarray, ndarray), shape (s,)
        What a start can be; infinite where it is measured.
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
    """Take starts from the signals, smoothed; the rest as a drive at rest has it.

    Parameters
    ----------
    recording : DriveRecording
    channels : list of Channel
        The c measured signals.
    noise : ndarray, shape (c,)
        Of the channels.
    starts : ndarray, shape (k,)
        Samples at which segments begin.
    drive : Drive
    inner : list of str
        Further states of the drive, which start at zero.
    watch : Watch

    Returns
    -------
    ndarray, shape (k, 6 + inner), ndarray, shape (6 + inner,)
        Starts, and the standard deviations of what was measured; NaN for the rest.
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
    """Let the model find what was not measured: the gas temperatures, the bristles, the gas of tubes.

    All segments are run, and each takes over from the end of the one before what was not measured; after a few rounds
    a wrong guess has died away. `names` are those of what a start has beside the piston and its chambers.
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
    belief = np.r_[BELIEF, most]  # wide also where it is measured: the samples say it better than their smoothed start
    reach = np.where(np.isnan(spread), POSSIBLE * belief, np.inf)
    grows = np.r_[np.zeros(BELIEF.size, dtype=bool), [name in GROWING for name in names]]
    is_gas = np.r_[np.zeros(BELIEF.size, dtype=bool), [name.endswith((_PRESSURE, _TEMPERATURE)) for name in names]]
    lowest = state.min(axis=0)
    limits = (
        np.where(is_gas, np.maximum(lowest - reach, LEAST_SHARE * lowest), lowest - reach),
        np.where(grows, np.inf, state.max(axis=0) + reach),
    )
    return SegmentStarts(state, belief, np.r_[SIZE, size], ~np.isnan(spread), limits)


def _smoothed(
    time_s: Array, values: Array, at: NDArray[np.int64], noise: float, watch: Watch
) -> tuple[Array, Array, float]:
    """Value and slope of a parabola through the samples around each of some samples.

    The window is the widest of a few over which the signal is a parabola within its noise. The third value times the
    noise is the standard error of a slope over the narrowest one that was used.
    """
    level, slope = np.empty(at.size), np.empty(at.size)
    good = np.isfinite(values)
    step = float(np.median(np.diff(time_s)))
    widest = max(LEAST_HALF_WIDTH, round(WINDOW_S / step))
    widths = sorted({max(LEAST_HALF_WIDTH, widest >> k) for k in range(6)}, reverse=True)
    narrowest = widest
    for j, i in enumerate(at):
        watch.look()
        for half in widths:
            near = slice(max(0, i - half), i + half + 1)
            t, y = time_s[near][good[near]] - time_s[i], values[near][good[near]]
            if y.size < 4:  # a gap in the signal: what stands nearest
                index = np.flatnonzero(good)
                level[j], slope[j] = values[index[np.argmin(np.abs(index - i))]], 0.0
                break
            scale = float(np.abs(t).max())
            design = np.stack([np.ones_like(t), t / scale, (t / scale) ** 2], axis=1)
            c = np.linalg.lstsq(design, y, rcond=None)[0]
            level[j], slope[j] = c[0], c[1] / scale
            off = np.sqrt(np.sum((y - design @ c) ** 2) / max(y.size - 3, 1))
            if off <= PARABOLA_NOISE * noise:
                narrowest = min(narrowest, half)
                break
            narrowest = LEAST_HALF_WIDTH
    return level, slope, 1.0 / (step * float(np.sqrt(2.0 * np.sum(np.arange(narrowest + 1.0) ** 2))))


def white_noise(values: Array) -> float:
    """Estimate the standard deviation of white noise on a smooth signal, from its third differences."""
    third = np.diff(values[np.isfinite(values)], 3)
    return float(np.sqrt(np.mean(third**2) / 20.0)) if third.size else 0.0
