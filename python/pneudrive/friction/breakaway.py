"""Breakaway peaks after reversals, with flags of their faults."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.signals.motion import local_slope, middle_step, noise_level, straight_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.bins import Profile
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
    search = _PeakSearch(recording, balance_n, profile)
    return [search.peak(stroke) for stroke in strokes if stroke.start != 0 and stroke.index != 0]


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


@dataclass(frozen=True, eq=False)
class _PeakSearch:
    """The samples of a level, with its sliding friction, time step, and noise of balance and pressures."""

    recording: Recording
    balance_n: NDArray[np.float64]
    profile: Profile

    @cached_property
    def sliding_n(self) -> float:
        """Mean friction in the window."""
        return float(np.nanmean(self.profile.friction_n[self.profile.in_window]))

    @cached_property
    def step_s(self) -> float:
        """Usual time step."""
        return middle_step(self.recording.time_s)

    @cached_property
    def noise_n(self) -> float:
        """Noise of the balance."""
        return noise_level(self.balance_n)

    @cached_property
    def pressures(self) -> list[tuple[NDArray[np.float64], float, float]]:
        """Pressure, area and noise of both chambers."""
        r = self.recording
        sides = ((r.pressure_a_pa, r.area_a_m2), (r.pressure_b_pa, r.area_b_m2))
        return [(pressure, area, noise_level(pressure, quantisation=False)) for pressure, area in sides]

    def peak(self, stroke: Stroke) -> ReversalPeak:
        """Return the peak after the reversal at which a stroke begins."""
        # The force rises while the piston still rests: go back from the first motion through the dwell.
        position, time = self.recording.position_m, self.recording.time_s
        back = int(np.searchsorted(time, time[stroke.start] - stroke.dwell_s))
        begin = max(min(back, stroke.start), 0)
        travel = abs(stroke.to_m - stroke.from_m)
        travelled = np.abs(position[stroke.samples] - stroke.from_m)
        end = stroke.start + max(int(np.argmax(travelled > SOUGHT_SHARE * travel)), 3)
        part = slice(begin, end)
        slope, intercept = offset_line(self.profile, stroke.from_m)
        friction = stroke.direction * (self.balance_n[part] - (slope * position[part] + intercept))
        low, high, top = _rise(friction)
        times = time[part]
        duration = float(times[high] - times[low])
        swing, excess = float(friction[top] - friction[low]), float(friction[top] - self.sliding_n)
        gap = np.diff(times[low : top + 1]).max(initial=0.0)
        seen = {
            "undersampled": high - low < NEEDED_RISE_SAMPLES,
            "pressure_transient": self._pressure_moves_n(slice(begin, begin + top + 1)) > TRANSIENT_SHARE * swing,
            "inertia": self._inertia_n(stroke) > INERTIA_SHARE * swing,
            "gap": gap > 5 * self.step_s,
            "no_peak": top >= friction.size - 2,  # still rising at the end of the search: no maximum
        }
        return ReversalPeak(
            recording=self.recording.name,
            stroke=stroke.index,
            direction=stroke.direction,
            time_s=float(times[top]),
            position_m=float(position[part][top]),
            friction_n=float(friction[top]),
            sliding_n=self.sliding_n,
            excess_n=excess,
            # The largest of m noisy samples is sqrt(2 ln m) deviations too high by chance.
            significant=excess > self.noise_n * (np.sqrt(2 * np.log(max(friction.size, 2))) + 1),
            dwell_s=stroke.dwell_s,
            loading_rate_n_s=float(friction[high] - friction[low]) / duration if duration > 0 else float("nan"),
            rise_samples=high - low,
            flags=tuple(name for name, is_so in seen.items() if is_so),
        )

    def _pressure_moves_n(self, part: slice) -> float:
        """Return the change of the pressure force until the peak, also during the rest before it, beyond noise, N."""
        moved = 0.0
        for channel, area, noise in self.pressures:
            pressure = channel[part]
            # Noise spreads n samples over about 2 sqrt(2 ln n) deviations.
            by_noise = 2 * noise * np.sqrt(2 * np.log(max(pressure.size, 2)))
            moved += max(float(np.ptp(pressure)) - by_noise, 0.0) * area
        return moved

    def _inertia_n(self, stroke: Stroke) -> float:
        """Return the force that accelerates the mass beyond the sensor to 80 % of the speed, in one sample or more."""
        mass = self.recording.mass_beyond_sensor_kg
        if not mass:
            return 0.0
        time, speed = self.recording.time_s[stroke.samples], 0.8 * abs(stroke.speed_m_s)
        velocity = local_slope(time, self.recording.position_m[stroke.samples])
        reached = max(int(np.argmax(np.abs(velocity) >= speed)), 1)
        return mass * (speed / float(time[reached] - time[0]))


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


def median(values: Sequence[float]) -> float:
    """Return the median of a few values, or NaN. A single value is the usual case, for which NumPy is slow."""
    return float(np.median(values)) if len(values) > 1 else values[0] if values else float("nan")
