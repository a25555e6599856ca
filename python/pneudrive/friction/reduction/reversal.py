"""Breakaway peaks after reversals, with flags of their faults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.signals.motion import local_slope, middle_step, noise_level, straight_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.reduction.pairing import Profile
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

NEEDED_RISE_SAMPLES = 10
# A pressure change during the rise spoils the peak if it changes the force by this fraction of the peak.
TRANSIENT_SHARE = 0.1
# Inertia of the mass beyond the sensor does so too: acceleration from positions is late, smoothed and noisy.
INERTIA_SHARE = 0.1
# Share of a stroke's travel, from its start, in which the peak is searched.
SOUGHT_SHARE = 0.25
# The offset at the turn is extrapolated from a line between these fractions of the travel.
OFFSET_FROM = (0.1, 0.35)
FEWEST_BINS = 3


@dataclass(frozen=True)
class ReversalPeak:
    """Largest friction after one reversal.

    ``friction_n`` is the peak without the offset; ``sliding_n`` the friction level of the window.
    ``excess_n`` is their difference, ``significant`` whether it exceeds the noise of a single peak.
    ``rise_samples`` counts samples while it rises from 10 % to 90 %; ``flags`` names its faults:
    ``undersampled``, ``pressure_transient``, ``inertia``, ``gap``, ``no_peak``.
    """

    recording: str
    stroke: int
    direction: int
    time_s: float
    position_m: float
    friction_n: float
    sliding_n: float
    excess_n: float
    significant: bool
    dwell_s: float
    loading_rate_n_s: float
    rise_samples: int
    flags: tuple[str, ...]


def find_reversal_peaks(
    recording: Recording, strokes: Sequence[Stroke], balance_n: NDArray[np.float64], profile: Profile
) -> list[ReversalPeak]:
    """Find the peak after each reversal at which one of ``strokes`` begins.

    Parameters
    ----------
    recording
        Cleaned recording.
    strokes
        Strokes of one speed class; the recording's first one has no reversal before it.
    balance_n
        Shape (n,).
    profile
        Reversals of the same level. Its offset is removed, see `offset_line`.
    """
    if (np.isfinite(profile.offset_n) & profile.in_window).sum() < FEWEST_BINS:
        return []
    sides = {side: getattr(recording, f"pressure_{side}_pa") for side in "ab"}
    usual = _Usual(
        sliding_n=float(np.nanmean(profile.friction_n[profile.in_window])),
        step_s=middle_step(recording.time_s),
        noise_n=noise_level(balance_n),
        pressure_noise_pa={side: noise_level(pressure, quantisation=False) for side, pressure in sides.items()},
    )
    return [
        _peak(recording, stroke, balance_n, profile, usual)
        for stroke in strokes
        if stroke.start != 0 and stroke.index != 0
    ]


@dataclass(frozen=True)
class _Usual:
    """References for the peaks of a level: sliding friction, time step, noise of balance and pressures."""

    sliding_n: float
    step_s: float
    noise_n: float
    pressure_noise_pa: dict[str, float]


def offset_line(profile: Profile, turn_m: float) -> tuple[float, float]:
    """Fit a line through the offset near a turn: slope, N/m, and intercept at x = 0, N.

    At the turn, one direction is still in its transient, so half the sum is not the offset. Far from the turn, the
    offset may differ. If there are too few bins in between, the bins of the window are used.
    """
    known = np.isfinite(profile.offset_n)
    away = np.abs(profile.position_m - turn_m) / float(np.ptp(profile.position_m))
    near = known & (away > OFFSET_FROM[0]) & (away < OFFSET_FROM[1])
    if near.sum() < FEWEST_BINS:
        near = known & profile.in_window
    return straight_line(profile.position_m[near], profile.offset_n[near])


def _peak(
    recording: Recording,
    stroke: Stroke,
    balance_n: NDArray[np.float64],
    profile: Profile,
    usual: _Usual,
) -> ReversalPeak:
    # The force rises while the piston still rests: go back from the first motion through the dwell.
    position = recording.position_m
    back = int(np.searchsorted(recording.time_s, recording.time_s[stroke.start] - stroke.dwell_s))
    begin = max(min(back, stroke.start), 0)
    travel = abs(stroke.to_m - stroke.from_m)
    travelled = np.abs(position[stroke.samples] - stroke.from_m)
    end = stroke.start + max(int(np.argmax(travelled > SOUGHT_SHARE * travel)), 3)
    part = slice(begin, end)
    slope, intercept = offset_line(profile, stroke.from_m)
    friction = stroke.direction * (balance_n[part] - (slope * position[part] + intercept))
    low, high, top = _rise(friction)
    times = recording.time_s[part]
    duration = float(times[high] - times[low])
    rate = float(friction[high] - friction[low]) / duration if duration > 0 else float("nan")
    flags = _peak_flags(recording, stroke, part, (low, high, top), float(friction[top] - friction[low]), usual)
    excess = float(friction[top] - usual.sliding_n)
    if top >= friction.size - 2:
        flags.append("no_peak")  # still rising at the end of the search: no maximum
    return ReversalPeak(
        recording=recording.name,
        stroke=stroke.index,
        direction=stroke.direction,
        time_s=float(times[top]),
        position_m=float(position[part][top]),
        friction_n=float(friction[top]),
        sliding_n=usual.sliding_n,
        excess_n=excess,
        # The largest of m noisy samples is sqrt(2 ln m) deviations too high by chance.
        significant=excess > usual.noise_n * (np.sqrt(2 * np.log(max(friction.size, 2))) + 1),
        dwell_s=stroke.dwell_s,
        loading_rate_n_s=rate,
        rise_samples=high - low,
        flags=tuple(flags),
    )


def _rise(friction_n: NDArray[np.float64]) -> tuple[int, int, int]:
    """Find a peak and its rise: last sample below 10 % of the change of force, first sample above 90 %, and the peak.

    A slow drift between the rise and the peak does not belong to the rise.
    """
    top = int(np.argmax(friction_n))
    bottom = float(friction_n[: top + 1].min())
    swing = float(friction_n[top]) - bottom
    high = int(np.argmax(friction_n >= bottom + 0.9 * swing))
    below = np.flatnonzero(friction_n[: high + 1] <= bottom + 0.1 * swing)
    return (int(below[-1]) if below.size else 0), high, top


def _run_up(recording: Recording, stroke: Stroke) -> float:
    """Return the mean acceleration until the stroke has 80 % of its speed, at least one sample, m/s2."""
    time = recording.time_s[stroke.samples]
    velocity = local_slope(time, recording.position_m[stroke.samples])
    reached = max(int(np.argmax(np.abs(velocity) >= 0.8 * abs(stroke.speed_m_s))), 1)
    return 0.8 * abs(stroke.speed_m_s) / float(time[reached] - time[0])


def _peak_flags(
    recording: Recording, stroke: Stroke, part: slice, rise: tuple[int, int, int], swing: float, usual: _Usual
) -> list[str]:
    flags = []
    low, high, top = rise
    if high - low < NEEDED_RISE_SAMPLES:
        flags.append("undersampled")
    moved = 0.0
    for side in ("a", "b"):
        channel = getattr(recording, f"pressure_{side}_pa")
        pressure = channel[part][: top + 1]  # motion in the rest before it counts too
        # Noise spreads n samples over about 2 sqrt(2 ln n) deviations.
        by_noise = 2 * usual.pressure_noise_pa[side] * np.sqrt(2 * np.log(max(pressure.size, 2)))
        moved += max(float(np.ptp(pressure)) - by_noise, 0.0) * getattr(recording, f"area_{side}_m2")
    if moved > TRANSIENT_SHARE * swing:
        flags.append("pressure_transient")
    mass = recording.mass_beyond_sensor_kg
    if mass and mass * _run_up(recording, stroke) > INERTIA_SHARE * swing:
        flags.append("inertia")
    steps = np.diff(recording.time_s[part][low : top + 1])
    if steps.size and steps.max() > 5 * usual.step_s:
        flags.append("gap")
    return flags


def breakaway(peaks: Sequence[ReversalPeak], strokes: Sequence[Stroke]) -> dict[str, float]:
    """Return the breakaway of one direction: medians over the reversals before its strokes, or NaN.

    Returns
    -------
    dict
        ``breakaway_n`` of the usable peaks, ``dwell_s``, ``loading_rate_n_s``.
    """
    return {
        "breakaway_n": median([p.friction_n for p in peaks if not p.flags]),
        "dwell_s": median([s.dwell_s for s in strokes if s.index > 0]),
        "loading_rate_n_s": median([p.loading_rate_n_s for p in peaks if np.isfinite(p.loading_rate_n_s)]),
    }


def median(values: Sequence[float]) -> float:
    """Return the median of a few values, or NaN. A single value is the usual case, for which NumPy is slow."""
    return float(np.median(values)) if len(values) > 1 else values[0] if values else float("nan")
