"""Signals of a recording, its force and pressure balances, simulations of its command, and metrics of residuals.

A residual is measurement minus model. The 95 % bounds of the correlations hold for white residuals. If the model is
wrong, the residuals of its free run are not white. Sources of the tests: [ljung1978], [mathworks-residuals].
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

from pneudrive import _core
from pneudrive.arrays import Array, ArrayPair, Bools, Columns, Keyed, NamedNumbers
from pneudrive.describe.drive import Drive
from pneudrive.errors import FitError, SimulationError
from pneudrive.estimate.estimates import NORMAL_95, rms
from pneudrive.free.parameters import at_rest
from pneudrive.identify.dynamic.result import MODEL_SHARE
from pneudrive.identify.dynamic.sensors import CHANNELS, Sensor, channels_of, command_delay
from pneudrive.numbers import plain
from pneudrive.signals.drive_recording import DriveRecording
from pneudrive.signals.motion import noise_level
from pneudrive.units import readable

# --- Metrics of the residual between measurement and model, and tests whether it is noise.

LAGS = 25


@dataclass(frozen=True)
class Metrics:
    """Metrics of the residual of one channel.

    Attributes
    ----------
    rms : float
        Root mean square, in SI.
    largest : float
        Greatest absolute residual, in SI.
    nrmse : float
        rms / (max - min of the measurement).
    fit_percent : float
        100 (1 - ||e|| / ||y - mean y||); negative if the mean would fit better.
    samples : int
    """

    rms: float
    largest: float
    nrmse: float
    fit_percent: float
    samples: int


def metrics(measured: Array, model: Array) -> Metrics:
    """Return the metrics of a model compared with a measurement. Samples at which the model is NaN do not count.

    Examples
    --------
    >>> found = metrics(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 2.2]))
    >>> round(found.nrmse, 4), round(found.fit_percent, 2)
    (0.0577, 85.86)
    """
    there = np.isfinite(model)
    y, e = measured[there], (measured - model)[there]
    if not e.size:
        return Metrics(np.nan, np.nan, np.nan, np.nan, 0)
    size = rms(e)
    span = float(np.ptp(y))
    spread = float(np.linalg.norm(y - y.mean()))
    return Metrics(
        rms=size,
        largest=float(np.abs(e).max()),
        nrmse=size / span if span > 0.0 else np.nan,
        fit_percent=100.0 * (1.0 - float(np.linalg.norm(e)) / spread) if spread > 0.0 else np.nan,
        samples=int(e.size),
    )


def whiteness(residual: Array) -> NamedNumbers:
    """Test a residual for whiteness with its first LAGS autocorrelations.

    Returns
    -------
    dict
        ``outside``: fraction of the autocorrelations beyond 1.96 / sqrt(N), their 95 % bound for white noise.
        ``ljung_box`` and ``p``: statistic of Ljung and Box over all lags, and its p-value for white noise.
    """
    from scipy.stats import chi2

    e = residual[np.isfinite(residual)]
    e = e - e.mean() if e.size else e
    n, power = e.size, e @ e
    lags = np.arange(1, min(LAGS, n - 1) + 1)
    if power == 0.0 or lags.size < 1:
        return {"outside": 0.0, "ljung_box": 0.0, "p": 1.0}
    r = np.array([e[k:] @ e[:-k] / power for k in lags])
    statistic = float(n * (n + 2) * np.sum(r * r / (n - lags)))
    outside = float(np.mean(np.abs(r) > NORMAL_95 / np.sqrt(n)))
    return {"outside": outside, "ljung_box": statistic, "p": float(chi2.sf(statistic, lags.size))}


def cross_correlations(residual: Array, signals: Mapping[str, Array]) -> NamedNumbers:
    """Return the strongest correlation of a residual with each varying signal over all lags up to +/- `LAGS` samples.

    The signal with the strongest correlation comes first. If all values of the residual are NaN, the result is empty.
    """
    there = np.isfinite(residual)
    if not there.any():
        return {}
    e = np.where(there, residual - residual[there].mean(), 0.0)
    out = {}
    for name, values in signals.items():
        s = np.where(there, values - values[there].mean(), 0.0)
        scale = np.linalg.norm(e) * np.linalg.norm(s)
        if scale > 0.0:
            out[name] = max(np.correlate(np.pad(e, LAGS), s, "valid") / scale, key=abs)
    return dict(sorted(out.items(), key=lambda pair: -abs(pair[1])))


# --- Recordings that made a fit, and recordings that were held out: only the latter test the fit.

MADE, HELD_OUT = "made the fit", "held out"  # badges of a recording
NONE_HELD_OUT = "no recording was held out: all were used for the fit, so nothing tests its predictions"


def badge_of(name: str, sha256: str, fitted: Mapping[str, str]) -> str:
    """Return whether a recording ``made the fit`` or was ``held out``; empty if the recordings of the fit are unknown.

    Parameters
    ----------
    name, sha256 : str
        Name and hash of the recording.
    fitted : mapping
        Name of each recording of the fit -> its hash, empty if unknown. Recordings are compared by hash, if known.
    """
    if not fitted:
        return ""
    hashes = set(fitted.values()) - {""}
    return MADE if (sha256 in hashes if hashes else name in fitted) else HELD_OUT


def held_out_notes(badges: Iterable[str]) -> list[str]:
    """Return a note if no recording was held out, or if the verdicts ignore recordings of the fit."""
    found = list(badges)
    if MADE not in found:
        return []
    if HELD_OUT not in found:
        return [NONE_HELD_OUT]
    return [f"recordings held out of the fit: {found.count(HELD_OUT)} of {len(found)}. The verdicts use only these"]


# --- Signals derived from a recording: velocity, acceleration, start states of a model.

#: Half width of the polynomial window for velocity and acceleration, s (assumed: shorter than changes of acceleration
#: of a servo drive).
HALF_WINDOW_S = 8e-3
LEAST_HALF = 3
#: Samples on each side over which a pressure is averaged.
PRESSURE_HALF = 2
#: Multiple of the noise of speed above which the piston counts as moving.
MOVES = 4.0


@dataclass(frozen=True, eq=False)
class Signals:
    """Recording on a uniform time base, with derivatives.

    Attributes
    ----------
    recording : DriveRecording
    time_s, command, position_m, pressure_a_pa, pressure_b_pa : ndarray, shape (n,)
        Values on the uniform time base with `step_s`.
    """

    recording: DriveRecording
    step_s: float
    time_s: Array
    command: Array
    position_m: Array
    pressure_a_pa: Array
    pressure_b_pa: Array

    @classmethod
    def of(cls, recording: DriveRecording) -> Signals:
        """Resample a recording to a uniform time base; a uniform recording keeps its samples."""
        time = even = recording.time_s
        steps, step = np.diff(time), recording.duration_s / (time.size - 1)
        if np.abs(steps - step).max() > 1e-3 * step:
            step = np.median(steps)
            even = np.arange(round(recording.duration_s / step) + 1, dtype=float) * step
        held = recording["command"][np.searchsorted(time, even, side="right") - 1]
        channels = ("position_m", "pressure_a_pa", "pressure_b_pa")
        return cls(recording, step, even, held, *(np.interp(even, time, recording[c]) for c in channels))

    @property
    def half(self) -> int:
        """Number of samples on each side of the middle of the window for derivatives."""
        return max(LEAST_HALF, round(HALF_WINDOW_S / self.step_s))

    def smooth(self, values: Array, order: int = 0, half: int | None = None) -> Array:
        """Return values smoothed by local cubics, or their time derivative of this order; NaN near NaN values."""
        width = min(2 * (half or self.half) + 1, (values.size - 1) // 2 * 2 - 1)
        return np.asarray(savgol_filter(values, width, 3, deriv=order, delta=self.step_s), dtype=float)

    @cached_property
    def velocity_unsure_m_s(self) -> Array:
        """Uncertainty of the smoothed velocity at each sample: its change if the window is halved."""
        if "velocity_m_s" in self.recording:
            return np.zeros_like(self.position_m)
        halved = self.smooth(self.position_m, 1, max(self.half // 2, LEAST_HALF - 1))
        return np.abs(self.smooth(self.position_m, 1) - halved)

    @cached_property
    def velocity_m_s(self) -> Array:
        """Measured velocity, or, if it was not measured, slope of a local cubic of the position."""
        if "velocity_m_s" in self.recording:
            return np.interp(self.time_s, self.recording.time_s, self.recording["velocity_m_s"])
        return self.smooth(self.position_m, 1)

    @cached_property
    def acceleration_m_s2(self) -> Array:
        """Acceleration from a local cubic of the position."""
        return self.smooth(self.position_m, 2)

    @property
    def direction(self) -> Array:
        """Sign of the velocity, 0 at rest."""
        return np.where(self.moving, np.sign(self.velocity_m_s), 0.0)

    @cached_property
    def moving(self) -> Bools:
        """Mask of samples with a speed above its noise. The noise of a derived velocity follows from the position."""
        if "velocity_m_s" in self.recording:
            noise_m_s = noise_level(self.velocity_m_s)
        else:
            weights = savgol_coeffs(2 * self.half + 1, 3, deriv=1, delta=self.step_s)
            noise_m_s = np.sqrt(weights @ weights) * noise_level(self.position_m)
        return np.abs(self.velocity_m_s) > max(MOVES * noise_m_s, 1e-4)

    def start_temperatures(self, drive: Drive) -> list[float]:
        """Return the measured temperatures at the first sample, or the ambient temperature, in K."""
        names = ("temperature_a_k", "temperature_b_k")
        return [self.recording[n][0] if n in self.recording else drive.ambient.temperature_k for n in names]

    def state(self, i: int) -> Array:
        """Return time, position, velocity and both pressures at sample `i`, smoothed."""
        around = slice(max(i - PRESSURE_HALF, 0), i + PRESSURE_HALF + 1)
        near = slice(max(i - self.half, 0), i + self.half + 1)
        t = self.time_s[near] - self.time_s[i]
        x = np.polyfit(t, self.position_m[near], min(2, t.size - 1))[-1]
        v = self.velocity_m_s[i] if self.moving[i] else 0.0
        pressures = np.column_stack([self.pressure_a_pa[around], self.pressure_b_pa[around]])
        return np.r_[self.time_s[i], x, v, np.polyfit(self.time_s[around] - self.time_s[i], pressures, 1)[-1]]


# --- Correction of a recording for known errors of its sensors, before it is compared with a model.


def corrected(
    recording: DriveRecording, sensors: Mapping[str, Sensor | Keyed] | None
) -> tuple[DriveRecording, list[str]]:
    """Correct a recording for offsets, gains and the delay of the command; return the result with a note.

    Parameters
    ----------
    recording : DriveRecording
    sensors : mapping or None
        Channel -> `Sensor` or its keywords, as for `identify`; offset, gain and lag must be numbers.

    Raises
    ------
    FitError
        The recording does not have a channel, or a property is free.
    """
    if not sensors:
        return recording, []
    delay_s = command_delay(sensors)
    present = [name for name, column in CHANNELS.items() if column in recording]
    columns, said, channels = dict(recording.columns), [], channels_of(present, sensors).values()
    if delay_s is None or any(channel.free for channel in channels):
        raise FitError(
            "validate does not fit sensor values", remedy="Fit them with identify, and pass the fit to validate."
        )
    for channel in channels:
        if channel.offset != 0.0 or channel.gain != 1.0:
            columns[channel.column] = (columns[channel.column] - channel.offset) / channel.gain
            factor, unit = readable(channel.unit)
            gain = f", gain {plain(channel.gain, 5)}" if channel.gain != 1.0 else ""
            said.append(f"{channel.name} offset {plain(channel.offset / factor)} {unit}{gain}")
        if channel.lag > 0.0:
            said.append(f"{channel.name} lag of {plain(1e3 * channel.lag)} ms, which is not corrected")
    if delay_s != 0.0:
        time, command = recording.time_s, recording["command"]
        held = np.searchsorted(time, time - delay_s + 1e-9 * recording.duration_s, side="right") - 1
        columns["command"] = command[np.clip(held, 0, time.size - 1)]
        said.append(f"command delay of {plain(1e3 * delay_s)} ms")
    if not said:
        return recording, []
    note = f"{recording.name}: corrected for known errors of its sensors: {'; '.join(said)}"
    return replace(recording, columns=columns), [note]


# --- Balances of force and of both pressures along a recording: the drive's equations at measured states, and
# residuals.
#
# The core evaluates the equations (``Drive.along``). The residuals are in weak form, so that no measured signal
# is differentiated. With a smooth kernel k of compact support, integration by parts moves derivatives to the
# kernel:
#
#     e_F = k * (m a) - k * (sum of forces - friction)   with k * a = k'' * x            N
#     e_p = k * dp/dt - k * (dp/dt of the energy balance) with k * dp/dt = k' * p        Pa/s
#
# Each residual is the part of the measurement that the model does not explain.

BALANCES = ("force", "pressure a", "pressure b")
#: Pressure rates of the energy balance, columns of the core.
RATES = ("pressure_rate_a_pa_s", "pressure_rate_b_pa_s")
#: Half width of the kernel, s, and its smallest number of samples (assumed: longer than the window for derivatives,
#: shorter than a motion).
HALF_SUPPORT_S, LEAST_SAMPLES = 0.02, 5
#: Change of the command over which the leakage of a valve falls to 1/e, as in the core (assumed).
LEAKAGE_WIDTH = 0.05
#: Errors below this fraction of the terms of a balance are irrelevant (assumed).
FLOOR = MODEL_SHARE
#: Travel after a reversal until friction is steady, as a multiple of the bristle deflection in sliding.
BENT = 4.0
MOST_BENDING_M, LEAST_BENDING_M = 5e-3, 2e-4
#: Largest relative change of speed while bristles adapt (assumed).
LAG = 0.2
#: Distance from an end, plus a number of standard deviations of noise, within which a contact is possible.
STOP_MARGIN_M, MARGIN_NOISE = 1e-4, 5.0


@dataclass(frozen=True, eq=False)
class Scene:
    """Inputs of the balances, which a cause may change, and the resulting residuals. Derived quantities are cached.

    Attributes
    ----------
    drive : Drive
    signals : Signals
        Signals of the recording.
    position : ndarray, shape (n,)
    pressures : tuple of ndarray, shape (n,)
    opened : ndarray, shape (n, 4)
        Opening of each valve edge, as a fraction of its full conductance.
    explained : ndarray, shape (3, n), or 0.0
        Part of the residuals explained by causes that a description cannot contain.
    """

    drive: Drive
    signals: Signals
    position: Array
    pressures: ArrayPair
    opened: Array
    explained: Array | float = 0.0

    @classmethod
    def of(cls, drive: Drive, signals: Signals) -> Scene:
        """Return the scene of an unchanged drive and its signals."""
        pressures = (signals.pressure_a_pa, signals.pressure_b_pa)
        return cls(drive, signals, signals.position_m, pressures, at_samples(openings(drive, signals.command)))

    def less(self, values: Array) -> Scene:
        """Return the scene with further residuals marked as explained (`values`, shape (3, n))."""
        return replace(self, explained=self.explained + values)

    @cached_property
    def terms(self) -> Columns:
        """Forces, flows and pressure rates in the balances at each sample, without tubes and flow controls.

        ``force_n`` has all forces in +x except friction: pressures, weight, load, spring, end stops. ``friction_n`` is
        the friction of steady sliding at the measured velocity; it opposes v > 0.
        """
        signals, equations = self.signals, self.drive.plain.system.compiled()
        along = (signals.time_s, self.position, signals.velocity_m_s, *self.pressures, self.opened)
        temperatures = signals.start_temperatures(self.drive)
        try:
            return equations.along(*map(np.ascontiguousarray, along), temperatures)  # pyright: ignore[reportCallIssue]
        except RuntimeError as error:
            raise SimulationError(str(error)) from None

    @property
    def half(self) -> int:
        """Number of samples on each side of the middle of the kernel."""
        return max(LEAST_SAMPLES, round(HALF_SUPPORT_S / self.signals.step_s))

    @property
    def kernel(self) -> tuple[Array, Array, Array]:
        """Smoothing kernel, and its first and second time derivative."""
        return kernel(self.half, self.signals.step_s)

    @property
    def time_s(self) -> Array:
        """Times of the residuals, at samples with a complete kernel around them."""
        return self.signals.time_s[self.half : self.signals.time_s.size - self.half]

    @cached_property
    def residuals(self) -> Array:
        """Residuals of the force in N and of both pressure rates in Pa/s, at `time_s`; shape (3, n)."""
        (k0, k1, k2), terms = self.kernel, self.terms
        inertia = moving_mass(self.drive) * np.convolve(self.position, k2, "valid")
        force = inertia - np.convolve(terms["force_n"] - terms["friction_n"], k0, "valid")
        rates = (
            np.convolve(p, k1, "valid") - np.convolve(terms[rate], k0, "valid")
            for p, rate in zip(self.pressures, RATES, strict=True)
        )
        return np.stack([force, *rates]) - self.explained

    @cached_property
    def used(self) -> Bools:
        """Mask of the samples at `time_s` at which each balance is valid; shape (3, n).

        The force balance is valid in sliding after presliding, away from end stops. Pressure rates are valid except at
        impacts.
        """
        off_the_stops = ~near_stops(self.drive, self.signals)
        # At rest the pressures are as informative as in motion; an impact is too short.
        free = off_the_stops | ~_widened(self.signals.moving, self.signals.half)
        if self.drive.tubing or self.drive.flow_control:  # the flow through tubes and flow controls is not measured
            free = np.zeros_like(free)
        width = 2 * self.half + 1
        masks = (_sliding(self.drive, self.signals) & off_the_stops, free, free)
        return np.stack([np.convolve(mask.astype(float), np.ones(width), "valid") > width - 0.5 for mask in masks])

    @cached_property
    def scale(self) -> Array:
        """Standard deviation of each residual, but at least the fraction `FLOOR` of the balance's terms; shape (3, n).

        It contains sensor noise and the effect of the finite window for velocities.
        """
        drive, signals, terms, (k0, k1, k2) = self.drive, self.signals, self.terms, self.kernel
        cylinder, x, unsure = drive.cylinder, signals.position_m, signals.velocity_unsure_m_s
        noise_p = [noise_level(p) for p in self.pressures]
        areas = (cylinder.area_a_m2, cylinder.area_b_m2)
        push = np.hypot(areas[0] * noise_p[0], areas[1] * noise_p[1]) * np.linalg.norm(k0)
        inertia = moving_mass(drive) * noise_level(x) * np.linalg.norm(k2)
        friction = terms["friction_n"]
        size = np.sqrt(np.mean(friction**2) + np.mean((terms["force_n"] - friction) ** 2))
        error_n = np.sqrt(push**2 + inertia**2 + (FLOOR * size) ** 2)
        force = np.full(x.size - k0.size + 1, error_n)
        # If pressures are nearly equal, flow changes steeply with them, and noise becomes flow.
        p_a, p_b = self.pressures
        noisy = (p_a + noise_p[0], p_b + noise_p[1])
        shaken = replace(self, pressures=noisy, opened=openings(drive, signals.command)).terms
        out = [force]
        for noise, rate, p, area, length, dead in zip(
            noise_p, RATES, self.pressures, areas, (x, cylinder.stroke_m - x), cylinder.dead_volume_m3, strict=True
        ):
            squeezed = drive.gas.heat_capacity_ratio * p * unsure / np.maximum(length + dead / area, dead / area)
            smeared = np.convolve(squeezed, k0, "valid")
            slope = noise * np.linalg.norm(k1)
            steep = np.convolve(np.abs(shaken[rate] - terms[rate]), k0, "valid")
            floor = FLOOR**2 * np.mean(terms[rate] ** 2)
            out.append(np.sqrt(slope**2 + steep**2 + floor + smeared**2))
        return np.stack(out)


def openings(drive: Drive, command: Array) -> Array:
    """Return the opening of each valve edge for a command, as a fraction of its conductance, shape (n, 4).

    An edge opens by clip((u - overlap) / (1 - overlap), 0, 1) + leakage exp(-|u| / leakage_width).
    """
    if not drive.valve.has_shape:
        return _core.valve_openings(command)
    overlap, leakage = drive.valve.overlap or 0.0, drive.valve.leakage or 0.0
    towards = command[:, None] * np.array([1.0, -1.0, -1.0, 1.0])
    leaks = leakage * np.exp(-np.abs(command) / LEAKAGE_WIDTH)
    return np.clip((towards - overlap) / (1.0 - overlap), 0.0, 1.0) + leaks[:, None]


def moving_mass(drive: Drive) -> float:
    """Return the mass of piston and load in kg."""
    return drive.cylinder.moving_mass_kg + drive.carried.mass_kg


def at_samples(held: Array) -> Array:
    """Return the mean of the values before and after each sample, so that sums over time are correct at steps."""
    return 0.5 * (held + np.vstack([held[:1], held[:-1]]))


@lru_cache(maxsize=32)
def kernel(half: int, step_s: float) -> tuple[Array, Array, Array]:
    """Return (1 - s^2)^4 on 2 half + 1 samples with unit sum, and its first and second time derivatives.

    Sums are corrected to equal the integrals: the first derivative of a constant is 0 and that of t is 1; the second
    derivative of t^2/2 is 1. Without this correction, a constant position would appear as a force.
    """
    s = np.arange(-half, half + 1) / (half + 1)
    width = (half + 1) * step_s
    inside = 1.0 - s * s
    value, first = inside**4, -8.0 * s * inside**3
    second = -8.0 * inside**3 + 48.0 * s * s * inside**2
    value = value / value.sum()
    first = first / (-width * (s @ first))
    second = second - value * second.sum()
    return value, first, second / (0.5 * width**2 * (s * s @ second))


def near_stops(drive: Drive, signals: Signals) -> Bools:
    """Return a mask of samples with possible contact with an end stop, widened by the window of derivatives."""
    margin = STOP_MARGIN_M + MARGIN_NOISE * noise_level(signals.position_m)
    x = signals.position_m
    return _widened((x < margin) | (x > drive.cylinder.stroke_m - margin), signals.half)


def _widened(mask: Bools, by: int) -> Bools:
    """Return a mask widened by a number of samples before and after."""
    return np.convolve(mask.astype(float), np.ones(2 * by + 1), "same") > 0.5


def _sliding(drive: Drive, signals: Signals) -> Bools:
    """Return a mask of samples at which the piston has moved beyond the deflection of bristles since a reversal."""
    v, x, bending = signals.velocity_m_s, signals.position_m, bending_m(drive)
    sign = signals.direction
    turned = np.r_[True, np.diff(sign) != 0.0]
    since = np.maximum.accumulate(np.where(turned, np.arange(v.size), 0))
    # The speed must change little over the travel in which bristles adapt: friction lags behind it.
    steady = np.abs(signals.acceleration_m_s2) * (bending / BENT) < LAG * v * v
    return (sign != 0.0) & (np.abs(x - x[since]) > bending) & steady


def bending_m(drive: Drive) -> float:
    """Return the travel in m from a reversal until friction is that of steady sliding."""
    known = drive.friction.parameters
    stiffness = known.get("bristle_stiffness")
    level = known.get("breakaway", known.get("coulomb", 0.0))
    if not stiffness:
        return LEAST_BENDING_M
    return min(max(BENT * level / stiffness, LEAST_BENDING_M), MOST_BENDING_M)


# --- Simulation of a recorded command: free runs, runs with resets to measured states, and breakaway after stops.

RTOL = 1e-6
#: Number and duration, s, of runs with shut valve in which the unmeasured bristles settle.
SETTLING_RUNS, SETTLING_S = 200, 5e-3
#: Columns of a run.
RUN_COLUMNS = ["position_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa", "friction_force_n"]
#: Shortest stop, s; shorter rests are reversals.
LEAST_STOP_S = 0.05
#: Longest part of a rest that is simulated, up to the end of the rest, s.
MOST_STOP_S = 1.0


@dataclass(frozen=True, eq=False)
class ModelRun:
    """Simulation of a drive under a recorded command.

    Attributes
    ----------
    columns : dict
        `RUN_COLUMNS` at the samples of `Signals`; NaN after a failure.
    failures : tuple of str
        Messages of failed segments.
    """

    columns: dict[str, Array]
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
        Peak of the friction force in the direction of motion, in N.
    model_moved : bool
        Whether the model broke away before the next stop. If not, `model_n` is its largest force at rest.
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


def run_model(drive: Drive, signals: Signals, restarts: Sequence[int] = (0,)) -> ModelRun:
    """Simulate the recorded command with resets to the measured state at given samples, which include the first sample.

    A reset sets position, velocity and pressures. Temperatures, inner states of friction and the gas of tubes and
    joints continue. At the start, temperatures are measured or ambient. In a drive without tubes, the bristles start
    with a deflection that balances the pressures; otherwise they start undeflected. In a drive with tubes, a failed
    segment ends the run, because the state of the gas in the tubes is then unknown.
    """
    states = np.array([signals.state(i) for i in restarts])
    # A noisy position is limited to the stroke plus the possible depth in the end stops.
    states[:, 1] = np.clip(states[:, 1], -1e-3, drive.cylinder.stroke_m + 1e-3)
    steps = signals.recording.steps
    core = drive.system.compiled()
    t_a, t_b = signals.start_temperatures(drive)
    _, x, v, p_a, p_b = states[0]
    inner = [at_rest(name, (p_a, p_b), drive.ambient.temperature_k) for name in core.segment_names[6:]]
    state = np.array([[x, v, p_a, t_a, p_b, t_b, *inner]])

    def segment(times: Array, commands: Array, sample_times: Array) -> _core.Shot:
        request: _core.Shooting = {
            "times": times,
            "commands": commands,
            "sample_times": sample_times,
            "starts": [0],
            "initial": state,
            "outputs": RUN_COLUMNS,
            "rtol": RTOL,
        }
        return core.shoot("command", request)

    if drive.is_plain and inner:  # friction with inner states begins at rest
        rest = states[0, 0] + np.array([0.0, SETTLING_S])
        for _ in range(SETTLING_RUNS):
            settled = segment(rest[:1], np.zeros(1), rest)
            if settled["failures"][0] is not None:
                break
            state[0, 6:] = settled["ends"][0, 6:]
    values = np.full((signals.time_s.size, len(RUN_COLUMNS)), np.nan)
    failures: list[str] = []
    ends = [*restarts[1:], signals.time_s.size - 1]
    for measured, begin, end in zip(states, restarts, ends, strict=True):
        state[0, [0, 1, 2, 4]] = measured[1:]
        run = segment(*steps, signals.time_s[begin : end + 1])
        values[begin : end + 1] = run["values"]
        if run["failures"][0] is None:
            state = run["ends"].copy()
            continue
        failures.append(run["failures"][0])
        if not drive.is_plain:
            break
    return ModelRun(dict(zip(RUN_COLUMNS, np.ascontiguousarray(values.T), strict=True)), tuple(failures))


def breakaways(drive: Drive, signals: Signals) -> tuple[RecordedBreakaway, ...]:
    """Compare modelled and measured breakaway after each stop. The model starts from the measured state.

    Breakaway is the peak of friction before the piston has moved by the bristle deflection. Forces and positions are
    smoothed in the same way. The first samples of a stop are left out, because smoothing mixes them with the motion
    before the stop.
    """
    still, touching = ~signals.moving, near_stops(drive, signals)
    edges = np.flatnonzero(np.diff(still, prepend=False, append=False))
    least = round(LEAST_STOP_S / signals.step_s)
    rests = [
        (start, onset)
        for start, onset in edges.reshape(-1, 2).tolist()
        if onset - start >= least and onset < still.size and not touching[start:onset].any()
    ]
    if not rests:
        return ()
    starts = [max(start, onset - round(MOST_STOP_S / signals.step_s)) for start, onset in rests]
    run = run_model(drive, signals, sorted({0, *starts}))
    # All forces on the moving mass except friction, minus m a, N in -x.
    others = signals.smooth(Scene.of(drive, signals).terms["force_n"])
    measured = others - moving_mass(drive) * signals.acceleration_m_s2
    model = signals.smooth(run["friction_force_n"])
    position = signals.smooth(signals.position_m)
    model_position, bend, out = signals.smooth(run["position_m"]), bending_m(drive), []
    for (start, onset), begin, end in zip(rests, starts, [*starts[1:], still.size], strict=True):
        part, sign = slice(begin + signals.half, end), np.sign(signals.velocity_m_s[onset])
        peak, moved = _peak(sign * measured[part], position[part], bend)
        model_peak, model_moved = _peak(sign * model[part], model_position[part], bend)
        if moved and peak > 0.0 and np.isfinite(model_peak):
            times = (float(signals.time_s[start]), float(signals.time_s[onset]))
            out.append(RecordedBreakaway(*times, peak, model_peak, model_moved))
    return tuple(out)


def _peak(force: Array, position: Array, bend: float) -> tuple[float, bool]:
    """Return the largest force before the piston has moved by `bend`, and whether the piston has moved that far."""
    beyond = np.flatnonzero(np.abs(position - position[0]) > bend)
    return float(np.max(force[: int(beyond[0]) + 1] if beyond.size else force)), bool(beyond.size)
