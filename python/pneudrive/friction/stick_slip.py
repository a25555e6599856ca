"""Breakaway peaks after reversals, and stick-slip of a motion or of a piston that a rig moves through a spring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pneudrive.arrays import Array, Bools
from pneudrive.errors import RecordingError
from pneudrive.friction.bins import Profile
from pneudrive.repr_tables import Shown
from pneudrive.signals import motion
from pneudrive.signals.recording import Recording

# --- Breakaway peaks after reversals, with flags of their faults.

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
# Samples that noise may have made the largest one: those less than this number of its standard deviations lower.
NEAR_TOP = 3.0


@dataclass(frozen=True)
class ReversalPeak:
    """Largest friction after one reversal.

    ``friction_n`` is the peak minus the offset and minus the mean amount by which noise raises a maximum. ``flags``
    names faults of the peak: ``undersampled``, ``pressure_transient``, ``inertia``, ``gap``, ``no_peak``.
    """

    direction: int
    friction_n: float
    loading_rate_n_s: float
    flags: tuple[str, ...]


def find_reversal_peaks(
    recording: Recording, strokes: Sequence[motion.Stroke], balance_n: Array, profile: Profile
) -> dict[int, ReversalPeak]:
    """Return the peak of each reversal at which one of ``strokes`` begins, by index of the stroke.

    Parameters
    ----------
    recording
        Cleaned recording.
    strokes
        Strokes of one speed class. The first stroke of the recording has no reversal before it.
    balance_n
        Shape (n,).
    profile
        Profile of the same level. The offset of the profile is removed, see `offset_line`.
    """
    from scipy.special import ndtri

    after = [stroke for stroke in strokes if stroke.start != 0 and stroke.index != 0]
    if (np.isfinite(profile.offset_n) & profile.in_window).sum() < FEWEST_BINS or not after:
        return {}
    step, noise_n = motion.middle(np.diff(recording.time_s)), motion.noise_level(balance_n, quantisation=False)
    noise_pa = [motion.noise_level(p, quantisation=False) for p in (recording.pressure_a_pa, recording.pressure_b_pa)]
    position, time, peaks = recording.position_m, recording.time_s, dict[int, ReversalPeak]()
    for stroke in after:
        # The force rises while the piston still rests: go back from the first motion through the dwell.
        back = np.searchsorted(time, time[stroke.start] - stroke.dwell_s)
        begin = max(min(back, stroke.start), 0)
        travel = abs(stroke.to_m - stroke.from_m)
        travelled = np.abs(position[stroke.samples] - stroke.from_m)
        end = stroke.start + max(np.argmax(travelled > SOUGHT_SHARE * travel), 3)
        part = slice(begin, end)
        slope, intercept = offset_line(profile, stroke.from_m)
        friction = stroke.direction * (balance_n[part] - (slope * position[part] + intercept))
        top = int(np.argmax(friction))
        low, high = rise(friction[: top + 1])
        times = time[part]
        duration = float(times[high] - times[low])
        swing = float(friction[top] - friction[low])
        gap = np.diff(times[low : top + 1]).max(initial=0.0)
        moved = _pressure_moves_n(recording, slice(begin, begin + top + 1), noise_pa)
        seen = {
            "undersampled": high - low < NEEDED_RISE_SAMPLES,
            "pressure_transient": moved > TRANSIENT_SHARE * swing,
            "inertia": _inertia_n(recording, stroke) > INERTIA_SHARE * swing,
            "gap": gap > 5 * step,
            "no_peak": top >= friction.size - 2,  # still rising at the end of the search: no maximum
        }
        flags = tuple(name for name, is_so in seen.items() if is_so)
        rate_n_s = float(friction[high] - friction[low]) / duration if duration > 0 else np.nan
        near = max(np.sum(friction > friction[top] - NEAR_TOP * noise_n), 1)
        excess_n = noise_n * ndtri((near - 0.375) / (near + 0.25))  # mean maximum of normal values [blom1958]
        peaks[stroke.index] = ReversalPeak(stroke.direction, float(friction[top] - excess_n), rate_n_s, flags)
    return peaks


def offset_line(profile: Profile, turn_m: float) -> tuple[float, float]:
    """Fit a line to the offset near a turn. Return its slope in N/m and its intercept at x = 0 in N.

    At the turn, one direction is still in its transient, so that half the sum is not the offset. Far from the turn, the
    offset may differ. Bins between these regions are used, or the bins of the window if there are too few.
    """
    known = np.isfinite(profile.offset_n)
    away = np.abs(profile.position_m - turn_m) / np.ptp(profile.position_m)
    near = known & (away > OFFSET_FROM[0]) & (away < OFFSET_FROM[1])
    if near.sum() < FEWEST_BINS:
        near = known & profile.in_window
    return motion.straight_line(profile.position_m[near], profile.offset_n[near])


def _pressure_moves_n(recording: Recording, part: slice, noise_pa: Sequence[float]) -> float:
    """Return the change in pressure force between the stop before the stroke and the peak, less its noise, in N."""
    moved = 0.0
    for side, noise in zip("ab", noise_pa, strict=True):
        pressure = getattr(recording, f"pressure_{side}_pa")[part]
        # Noise spreads n samples over about 2 sqrt(2 ln n) deviations.
        by_noise = 2 * noise * np.sqrt(2 * np.log(max(pressure.size, 2)))
        moved += max(np.ptp(pressure) - by_noise, 0.0) * getattr(recording, f"area_{side}_m2")
    return moved


def _inertia_n(recording: Recording, stroke: motion.Stroke) -> float:
    """Return the mean force in N that the mass beyond the sensor needs to reach 80 % of the stroke's speed."""
    mass = recording.mass_beyond_sensor_kg
    if not mass:
        return 0.0
    time, speed = recording.time_s[stroke.samples], 0.8 * abs(stroke.speed_m_s)
    velocity = motion.local_slope(time, recording.position_m[stroke.samples])
    reached = max(np.argmax(np.abs(velocity) >= speed), 1)
    return mass * (speed / (time[reached] - time[0]))


def rise(friction_n: Array) -> tuple[int, int]:
    """Return the last sample below 10 % and the first sample above 90 % of a rise.

    The last value is the peak. A slow drift between rise and peak is not part of the rise.
    """
    bottom = friction_n.min()
    swing = friction_n[-1] - bottom
    high = int(np.argmax(friction_n >= bottom + 0.9 * swing))
    below = np.flatnonzero(friction_n[: high + 1] <= bottom + 0.1 * swing)
    return (int(below[-1]) if below.size else 0), high


def median(values: Sequence[float]) -> float:
    """Return the median of a few values, or NaN. Faster than NumPy for the usual case of a single value."""
    return float(np.median(values)) if len(values) > 1 else values[0] if values else np.nan


# --- Stick-slip in any motion, and in the strokes of a piston that a rig moves through a spring.

STUCK_SHARE = 0.2  # below this share of the mean speed the piston counts as stuck
SLIP_SHARE = 1.2  # above it a slip has begun; the gap between the two suppresses noise
MINIMUM_PERIODS = 3
FEWEST_SAMPLES = 20  # of a section
TRIMMED = 0.1  # share of the travel of a stroke that is left out at each end
# Glitches of a position sensor look like short rests followed by jumps, but most of the travel is between them.
SLIPPED_SHARE = 0.5  # least share of the travel in slips
RESTED_SHARE = 0.05  # least share of the time stuck
EVEN_SAMPLES = 2000  # evenly spaced samples for the ripple of the speed
RIPPLE_LIMIT = 0.2  # of the mean speed: above it the mean friction is not a point of F(v)


@dataclass(frozen=True, repr=False)
class StickSlip(Shown):
    """Stick-slip within one stroke or section.

    ``found`` states whether the motion is stick-slip. Stick-slip has at least three periods. Slips cover at least half
    of the travel, and the piston is stuck for at least 5 % of the time. ``period_s`` and ``step_m`` are medians over
    periods. ``peak_speed_m_s`` is the median of the peak speeds of the slips. ``stuck_share`` is the fraction of time
    below 20 % of the mean speed. ``mean_speed_m_s`` is the mean over the section. ``ripple`` is the standard deviation
    of speed divided by the mean speed. ``resolution_s`` is the shortest period that sampling and noise resolve.
    """

    found: bool
    direction: int
    start_s: float
    stop_s: float
    periods: int
    period_s: float
    step_m: float
    peak_speed_m_s: float
    stuck_share: float
    mean_speed_m_s: float
    ripple: float
    resolution_s: float


def find_stick_slip(time_s: Array, position_m: Array) -> list[StickSlip]:
    """Measure stick-slip in every stroke of a motion.

    Parameters
    ----------
    time_s, position_m
        Shape (n,), SI, time increasing. The velocity follows from the position, smoothed according to its noise.

    Returns
    -------
    list of StickSlip
        One per stroke, also without stick-slip.

    Raises
    ------
    RecordingError
        There are fewer than 20 samples, or there is no motion.
    """
    time_s, position_m = np.asarray(time_s, dtype=float), np.asarray(position_m, dtype=float)
    if time_s.shape != position_m.shape or time_s.ndim != 1:
        raise RecordingError("time and position must be one-dimensional, of equal length", where="find_stick_slip")
    strokes = motion.find_strokes("motion", time_s, position_m)
    parts = [part for stroke in strokes if (part := middle_of(stroke, position_m)) is not None]
    return [measure_stick_slip(time_s[part], position_m[part]) for part in parts]


def middle_of(stroke: motion.Stroke, position_m: Array) -> slice | None:
    """Return the samples of a stroke without a tenth of its travel at each end. None if too few remain."""
    share = (position_m[stroke.samples] - stroke.from_m) / (stroke.to_m - stroke.from_m)
    inside = np.flatnonzero((share >= TRIMMED) & (share <= 1 - TRIMMED))
    if inside.size < FEWEST_SAMPLES:
        return None
    return slice(stroke.start + int(inside[0]), stroke.start + int(inside[-1]) + 1)


def measure_stick_slip(time_s: Array, position_m: Array, velocity_m_s: Array | None = None) -> StickSlip:
    """Measure stick-slip in one section of a motion in one direction.

    Parameters
    ----------
    time_s, position_m, velocity_m_s : ndarray, shape (n,)
        At least three samples. If no velocity is given, it is derived from the positions.
    """
    duration = float(time_s[-1] - time_s[0])
    distance = float(position_m[-1] - position_m[0])
    direction = 1 if distance >= 0 else -1
    mean = abs(distance) / duration if duration > 0 else 0.0
    step, half_width = duration / max(time_s.size - 1, 1), 0
    if velocity_m_s is None:
        # Noise of the position causes at most 5 % of the mean speed. The variance of the slope of a line through
        # 2 h + 1 points is 3 noise^2 / (h (h + 1) (2 h + 1) step^2).
        half_width, widths = 1, np.arange(1.0, max(position_m.size // 20, 2))
        if mean > 0 and step > 0:
            spread = motion.noise_level(position_m) * np.sqrt(3.0 / (widths * (widths + 1) * (2 * widths + 1))) / step
            enough = widths[spread <= 0.05 * mean]
            half_width = int(enough[0]) if enough.size else max(position_m.size // 20, 1)
        velocity_m_s = motion.local_slope(time_s, position_m, half_width)
    speed = direction * velocity_m_s
    weights = np.gradient(time_s)  # duration that each sample represents
    total = weights.sum()
    stuck, slipping = speed < STUCK_SHARE * mean, speed > SLIP_SHARE * mean
    stuck_share = float(weights[stuck].sum() / total) if mean > 0 else 0.0
    ripple = float(np.sqrt((weights * (speed - mean) ** 2).sum() / total) / mean) if mean > 0 else 0.0
    travel = float((np.abs(speed) * weights).sum())
    slipped = float((speed * weights)[slipping].sum()) / travel if travel > 0 else 0.0
    onsets = slip_onsets(stuck, slipping) if mean > 0 else []
    peaks = [speed[a:b].max() for a, b in pairwise([*onsets, speed.size])]
    periods = max(len(onsets) - 1, 0)
    return StickSlip(
        found=periods >= MINIMUM_PERIODS and slipped >= SLIPPED_SHARE and stuck_share >= RESTED_SHARE,
        direction=direction,
        start_s=float(time_s[0]),
        stop_s=float(time_s[-1]),
        periods=periods,
        period_s=float(np.median(np.diff(time_s[onsets]))) if periods else np.nan,
        step_m=float(np.median(np.abs(np.diff(position_m[onsets])))) if periods else np.nan,
        peak_speed_m_s=float(np.median(peaks)) if peaks else float(speed.max()),
        stuck_share=stuck_share,
        mean_speed_m_s=mean,
        ripple=ripple,
        resolution_s=2 * (2 * half_width + 1) * step,
    )


def slip_onsets(stuck: Bools, slipping: Bools) -> list[int]:
    """Return the first sample of each slip after a stick. Samples with neither are ignored."""
    decided = np.flatnonzero(stuck | slipping)
    slips = slipping[decided]
    return decided[1:][slips[1:] & ~slips[:-1]].tolist()


def swing_of(position_m: Array, balance_n: Array, strokes: Sequence[motion.Stroke]) -> float:
    """Return the usual range of the balance in mid stroke, in N, without its lowest and highest 2 %."""
    parts = [part for stroke in strokes if (part := middle_of(stroke, position_m)) is not None]
    return median([float(np.ptp(np.quantile(balance_n[part], (0.02, 0.98)))) for part in parts])


def evenly_spaced(time_s: Array, *values: Array) -> tuple[Array, ...]:
    """Return evenly spaced values from uneven samples, as means over equal intervals."""
    steps = np.diff(time_s)
    if steps.max() <= 2.0 * steps.min() or steps.max() <= 2.0 * motion.middle(steps):  # the first one is quick
        return time_s, *values
    count = min(EVEN_SAMPLES, max(int((time_s[-1] - time_s[0]) / steps.max()), FEWEST_SAMPLES))
    edges = np.linspace(time_s[0], time_s[-1], count + 1)
    place = np.minimum(np.searchsorted(edges, time_s, side="right") - 1, count - 1)
    number = np.bincount(place, minlength=count)
    known = number > 0
    return tuple(np.bincount(place, weights=v, minlength=count)[known] / number[known] for v in (time_s, *values))
