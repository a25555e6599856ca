"""Recording of a rig while a piston moves; detection of faulty or impossible values and of late pressures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneudrive.arrays import Array, Bools, Interval
from pneudrive.constants import ANR_TEMPERATURE_K, STANDARD_ATMOSPHERE_PA, STANDARD_GRAVITY_M_S2
from pneudrive.errors import RecordingError
from pneudrive.estimate.estimates import student
from pneudrive.lazy_names import upper
from pneudrive.signals.force_calibration import ForceCalibration
from pneudrive.signals.motion import NOISE_FACTOR, Stroke, local_slope, middle, noise_level, thinned
from pneudrive.views import View, Viewed

Runs = tuple[NDArray[np.intp], NDArray[np.intp]]  # first sample and length of each run of equal samples

CHANNELS = ("position_m", "force_n", "pressure_a_pa", "pressure_b_pa")


class ParallelForce(NamedTuple):
    """A force in parallel with that of the rig, computed from measured pressures.

    Attributes
    ----------
    name : str
    area_m2 : float
        Area on which the pressures act.
    uncertainty : float
        Relative standard uncertainty of the area.
    force_n : ndarray
        Force on the piston at each sample, positive in +x, shape (n,).
    """

    name: str
    area_m2: float
    uncertainty: float
    force_n: Array


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class Recording(Viewed):
    """One measured run: synchronous samples in SI with absolute pressures.

    Parameters
    ----------
    name
        Unique name within a set; for a file, its name without suffix.
    time_s, position_m, force_n, pressure_a_pa, pressure_b_pa
        float64 arrays of one length n. Position grows as chamber a grows. ``force_n`` is the force of the rig on the
        piston, positive in +x. A pressure that was not measured is constant.
    area_a_m2, area_b_m2
        Piston areas on which the chamber pressures act.
    ambient_pressure_pa
        Absolute pressure around the rod.
    mass_beyond_sensor_kg
        Mass that moves between the force sensor and the piston, piston included.
    incline_rad
        Incline of the axis; positive if +x points up.
    accuracy
        Standard uncertainty of each channel in SI (``position_m``, ``force_n``, ``pressure_a_pa``, ``pressure_b_pa``),
        and of ``bore_m`` or ``area`` (relative). A missing key is replaced by an assumed value, which the uncertainty
        budget marks as assumed.
    labels
        Free text such as seal, run, pressure.
    window_m
        Positions between which friction is averaged; None: the middle 60 % of the stroke.
    source, sha256
        File and hash of its bytes, if there is one.
    synthetic, truth
        Whether the recording comes from a simulated rig, and its true parameters.
    stiffness_n_m
        Stiffness of the rig between its carriage and the piston, if known.
    flags
        Counts of faults on reading: unreadable rows, repeated times, ...
    limits
        Channel -> (lowest, highest) value of the sensor, if known.
    calibration
        Channel -> free text. A text that starts with "assumed" marks the accuracy as assumed in the budget.
    force_calibration
        Calibration of the force sensor, already applied to ``force_n``. Its uncertainties are part of the budget.
    parallel
        Forces in parallel with that of the rig, such as from a hydraulic ram; `balance_n` contains them.
    """

    name: str
    time_s: Array
    position_m: Array
    force_n: Array
    pressure_a_pa: Array
    pressure_b_pa: Array
    area_a_m2: float
    area_b_m2: float
    ambient_pressure_pa: float = STANDARD_ATMOSPHERE_PA
    mass_beyond_sensor_kg: float = 0.0
    incline_rad: float = 0.0
    accuracy: dict[str, float] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)
    window_m: Interval | None = None
    source: Path | None = None
    sha256: str | None = None
    synthetic: bool = False
    truth: dict | None = None
    stiffness_n_m: float | None = None
    flags: dict[str, int] = field(default_factory=dict)
    limits: dict[str, Interval] = field(default_factory=dict)
    calibration: dict[str, str] = field(default_factory=dict)
    force_calibration: ForceCalibration | None = None
    parallel: tuple[ParallelForce, ...] = ()

    def __post_init__(self) -> None:
        """Convert the channels to float64 and reject an invalid recording."""
        size = np.size(self.time_s)
        for channel in ("time_s", *CHANNELS):
            values = np.asarray(getattr(self, channel), dtype=float)
            if values.ndim == 0:
                values = np.full(size, float(values))
            if values.shape != (size,):
                sizes = {"size": values.size, "times": size}
                raise RecordingError.of("signals.lengths-differ", where=self.name, channel=channel, **sizes)
            object.__setattr__(self, channel, values)
        with np.errstate(invalid="ignore"):  # times that are not finite are counted later
            backwards = np.flatnonzero(np.diff(self.time_s) < 0)
        if backwards.size:
            at = int(backwards[0]) + 1
            both = {"later": self.time_s[at], "earlier": self.time_s[at - 1]}
            raise RecordingError.of("signals.time-backwards", where=f"{self.name}, sample {at}", **both)
        for area in ("area_a_m2", "area_b_m2"):
            if not (np.isfinite(getattr(self, area)) and getattr(self, area) >= 0):
                raise RecordingError(f"{area} must not be negative", where=self.name, value=getattr(self, area))

    def __len__(self) -> int:
        """Return the number of samples."""
        return self.time_s.size

    def view(self) -> View:
        """Return ranges and accuracies of the channels, faults of samples with remedies, and two figures."""
        return upper("recording_view")(self)

    def at(self, keep: Bools) -> Recording:
        """Return the recording with only these samples."""
        if keep.all():
            return self
        channels = {name: getattr(self, name)[keep] for name in ("time_s", *CHANNELS)}
        forces = tuple(force._replace(force_n=force.force_n[keep]) for force in self.parallel)
        return replace(self, **channels, parallel=forces)

    @property
    def weight_n(self) -> float:
        """Weight of the mass beyond the sensor along the axis, positive if it pulls towards -x."""
        return self.mass_beyond_sensor_kg * STANDARD_GRAVITY_M_S2 * float(np.sin(self.incline_rad))

    def balance_n(self, acceleration_m_s2: Array | float | None = 0.0) -> Array:
        """Return the force balance: friction and errors together, positive if they oppose motion in +x.

          balance = F + F_parallel + p_a A_a - p_b A_b - p_ambient (A_a - A_b) - m a - m g sin(incline)

        Parameters
        ----------
        acceleration_m_s2
            Acceleration of the piston, shape (n,) or a scalar. None: second derivative of the positions, or zero
            without a mass beyond the sensor.

        Returns
        -------
        ndarray
            Force in N, shape (n,).
        """
        ambient = self.ambient_pressure_pa
        if acceleration_m_s2 is None:
            acceleration_m_s2 = 0.0
            if self.mass_beyond_sensor_kg:
                acceleration_m_s2 = local_slope(self.time_s, local_slope(self.time_s, self.position_m))
        # In place, term by term: fresh memory for each would take longer than the sum.
        balance = self.pressure_a_pa - ambient
        balance *= self.area_a_m2
        balance += self.force_n
        for force in self.parallel:
            balance += force.force_n
        side_b = self.pressure_b_pa - ambient
        side_b *= self.area_b_m2
        balance -= side_b
        balance -= self.mass_beyond_sensor_kg * acceleration_m_s2
        balance -= self.weight_n
        return balance


GAP_FACTOR = 5.0  # a gap is longer than this many usual intervals
SPIKE_FACTOR = 12.0  # a spike stands out of both neighbours by this many noise deviations
STEP_FACTOR = 3.0  # and stands out by this many of the channel's own steps:
FEW_SPIKES = 0.95  # those below this quantile, which spikes do not reach,
OWN_STEPS = 0.99  # and, without the spikes, below this one
AGREEMENT = 0.5  # neighbours of a spike differ by less than this share of its height
JUMP_SHARE = 0.5  # least jump of a position, of the travel
JUMP_NEIGHBOURS, JUMP_FACTOR = 3, 10.0  # steps on each side that show the motion; least ratio of the jump to them
SATURATED_RUN = 5  # equal samples in a row at a channel's extreme
CLIPPED_SHARE = 0.5  # share of the samples at the extremes above which a signal is smooth
STUCK_RUN = 20  # equal samples in a row while the piston travels
STUCK_TRAVEL_SHARE = 0.02


def clean(recording: Recording, places: dict[str, list[Interval]] | None = None) -> Recording:
    """Drop unusable samples and count them by kind.

    Parameters
    ----------
    recording
        Recording that may contain unusable samples.
    places
        Filled with: kind of fault -> first and last time of each occurrence, in s. Neighbouring samples are one
        occurrence, and a gap extends to the next sample. Faults on reading are left out, because they have no time.

    Returns
    -------
    Recording
        Only usable samples. ``flags`` counts ``non_finite``, ``repeated_time``, ``spike``, ``saturated``, ``stuck``
        samples and ``gap`` intervals (kinds with count 0 are absent).

    Raises
    ------
    RecordingError
        No finite sample is left.
    """
    counts = dict(recording.flags)

    def count(kind: str, mask: Bools) -> None:
        if number := int(mask.sum()):
            counts[kind] = counts.get(kind, 0) + number
        if places is not None:
            edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
            first, last = edges[::2], edges[1::2] - (kind != "gap")
            ends = zip(recording.time_s[first], recording.time_s[last], strict=True)
            places[kind] = [(float(begin), float(end)) for begin, end in ends if np.isfinite(begin + end)]

    channels = [getattr(recording, name) for name in ("time_s", *CHANNELS)]
    channels += [force.force_n for force in recording.parallel]
    finite = np.all([np.isfinite(values) for values in channels], axis=0)
    count("non_finite", ~finite)
    if not finite.any():
        raise RecordingError.of("signals.no-finite-sample", where=recording.name, count=len(recording))
    recording = recording.at(finite)
    fresh = np.diff(recording.time_s, prepend=-np.inf) > 0.0
    count("repeated_time", ~fresh)
    recording = recording.at(fresh)

    good = np.ones(len(recording), dtype=bool)
    for kind, mask in _bad_samples(recording).items():
        count(kind, mask & good)
        good &= ~mask
    if good.any():
        recording = recording.at(good)
    count("position_jump", jumps_back(recording.position_m))
    steps = np.diff(recording.time_s)
    if steps.size:
        count("gap", steps > GAP_FACTOR * middle(steps))
    return replace(recording, flags=counts) if counts != recording.flags else recording


def _bad_samples(recording: Recording) -> dict[str, Bools]:
    """Return a mask for each kind of bad sample."""
    n = len(recording)
    masks = {kind: np.zeros(n, dtype=bool) for kind in ("spike", "saturated", "stuck")}
    if n < 2 * STUCK_RUN:
        return masks
    position = recording.position_m
    moves = np.ptp(position) > NOISE_FACTOR * noise_level(position)
    for channel in CHANNELS:
        values = getattr(recording, channel)
        if np.ptp(values) == 0 or recording.accuracy.get(channel) == 0.0:
            continue  # an unmeasured pressure or an exact channel has no sensor that could fail
        masks["spike"] |= spikes(values)
        if channel in recording.limits:
            low, high = recording.limits[channel]
            masks["saturated"] |= (values <= low) | (values >= high)
        runs = equal_runs(values)
        if runs[1].max() < SATURATED_RUN:
            continue
        if channel != "position_m":
            masks["saturated"] |= clipped(values, runs)
        if moves:  # a piston at rest makes every sensor look stuck
            masks["stuck"] |= stuck_position(position, runs) if channel == "position_m" else stuck_runs(position, runs)
    return masks


def spikes(values: Array) -> Bools:
    """Mark single samples that differ from both neighbours by much more than the noise, while the neighbours agree.

    If the neighbours differ, or the channel changes just before or after, the sample is part of a step. Its
    overshoot may be real, for example breakaway after a reversal.
    """
    mask = np.zeros(values.size, dtype=bool)
    steps = np.diff(values)
    threshold = max(SPIKE_FACTOR * noise_level(values), STEP_FACTOR * _upper(steps, FEW_SPIKES))
    large = np.flatnonzero(np.abs(steps[:-1]) > threshold)  # few, usually none
    there, back = steps[large], steps[large + 1]
    height = np.minimum(np.abs(there), np.abs(back))
    alone = (there * back < 0) & (height > threshold) & (np.abs(there + back) < AGREEMENT * height)
    for neighbour in (np.maximum(large - 1, 0), np.minimum(large + 2, steps.size - 1)):
        alone &= (np.abs(steps[neighbour]) < AGREEMENT * height) | (neighbour == large) | (neighbour == large + 1)
    if alone.any():  # exclude spikes from the channel's largest steps (reversals): many spikes would hide otherwise
        rest = np.ones(steps.size, dtype=bool)
        rest[large[alone]] = rest[large[alone] + 1] = False
        alone &= height > STEP_FACTOR * _upper(steps[rest], OWN_STEPS)
    mask[large[alone] + 1] = True
    return mask


def jumps_back(position: Array) -> Bools:
    """Mark the samples before jumps over most of the travel, opposite to the motion before and after.

    Such jumps come from a counter that wraps or is reset.
    """
    mask = np.zeros(position.size, dtype=bool)
    steps = np.diff(position)
    if steps.size < 2 * JUMP_NEIGHBOURS + 1:
        return mask
    for at in np.flatnonzero(np.abs(steps) > JUMP_SHARE * np.ptp(position)):
        before, behind = steps[max(at - JUMP_NEIGHBOURS, 0) : at], steps[at + 1 : at + 1 + JUMP_NEIGHBOURS]
        if not before.size or not behind.size:
            continue
        moved = [np.sum(part) / part.size * np.sign(steps[at]) for part in (before, behind)]
        mask[at] = all(abs(steps[at]) > -JUMP_FACTOR * step > 0 for step in moved)
    return mask


def _upper(steps: Array, share: float) -> float:
    """Return the quantile of the steps at this probability."""
    some = np.abs(thinned(steps))
    rank = int(share * (some.size - 1))
    return np.partition(some, rank)[rank]


def equal_runs(values: Array) -> Runs:
    """Return start and length of each run of equal samples."""
    starts = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    return starts, np.diff(starts, append=values.size)


def _usual_run(lengths: NDArray[np.intp]) -> np.intp | int:
    """Return the usual length of runs of equal samples: 90 % of the samples are in runs of at most this length.

    The longest run is excluded, so that a stuck sensor is not mistaken for a coarse sensor.
    """
    if lengths.size <= 1:
        return 0
    numbers = np.bincount(lengths)
    numbers[-1] -= 1
    covered = np.cumsum(numbers * np.arange(numbers.size))
    return np.searchsorted(covered, 0.9 * covered[-1])


def clipped(values: Array, runs: Runs) -> Bools:
    """Mark samples at the largest or smallest value of a noisy channel, if long runs have this value.

    A channel near its limit may also reach the limit for single samples. These samples are marked, too.

    A channel that is at its extremes most of the time is a smooth signal (a simulation), not a clipped signal.
    """
    starts, lengths = runs
    extreme = (values[starts] == values.max()) | (values[starts] == values.min())
    needed = max(SATURATED_RUN, 4 * _usual_run(lengths[~extreme]))
    hit = extreme & (lengths >= needed)
    if lengths[hit].sum() > CLIPPED_SHARE * values.size:
        return np.zeros(values.size, dtype=bool)
    return np.isin(values, np.unique(values[starts[hit]]))


def stuck_runs(position: Array, runs: Runs) -> Bools:
    """Mark runs of one value while the piston moves."""
    starts, lengths = runs
    stuck = lengths >= max(STUCK_RUN, 4 * _usual_run(lengths))
    for run in np.flatnonzero(stuck):  # out and back ends at its start: the whole way counts, not its ends
        way = np.ptp(position[starts[run] : starts[run] + lengths[run]])
        stuck[run] = way > STUCK_TRAVEL_SHARE * np.ptp(position)
    return np.repeat(stuck, lengths)


def stuck_position(position: Array, runs: Runs) -> Bools:
    """Mark runs of one position that end in a jump, because a real piston starts without a jump."""
    starts, lengths = runs
    jump = np.abs(np.diff(position[starts], append=position[-1:]))
    return np.repeat((lengths >= STUCK_RUN) & (jump > STUCK_TRAVEL_SHARE * np.ptp(position)), lengths)


#: Quantiles for the plausibility check of a channel, to ignore outliers.
QUANTILES = (0.01, 0.99)
# Impossible values are refused. Unusual values become flags of the friction map.
# Limits of any rig (all assumed): beyond the first of each pair a recording is refused, beyond the second doubted.
LOWEST_PA = -5e3  # absolute: largest error of a transducer's zero at vacuum
PRESSURES_PA = (100e5, 20e5)
SPEEDS_M_S = (50.0, 10.0)
SLOWEST_M_S = 5e-5  # a stroke of 50 mm in a quarter of an hour: slower ones are doubted, too
FORCES_N = (1e7, 1e6)
LONGEST_M = 100.0


def refuse_pressure(name: str, pressure_pa: Array, where: str) -> None:
    """Reject an absolute pressure below vacuum or beyond the range of any rig. Single outliers are ignored.

    Raises
    ------
    RecordingError
        The pressure is below vacuum or beyond the range.
    """
    if pressure_pa.size == 0:
        return
    low, high = np.nanquantile(thinned(pressure_pa), QUANTILES)
    if low < LOWEST_PA or high > PRESSURES_PA[0]:
        worst, why = (low, "is below vacuum") if low < LOWEST_PA else (high, "no pneumatic rig has")
        ends = {"bar": worst / 1e5, "most": PRESSURES_PA[0] / 1e5}
        raise RecordingError.of("signals.impossible-pressure", where=where, name=name, why=why, **ends)


def refuse_channels(recording: Recording, strokes: Sequence[Stroke] = ()) -> None:
    """Reject a recording of a rig with impossible values.

    Raises
    ------
    RecordingError
        A pressure is below vacuum, or pressures, forces, or speeds and travels of the strokes exceed those of any rig.
    """
    where = str(recording.source or recording.name)
    for channel in ("pressure_a_pa", "pressure_b_pa"):
        refuse_pressure(channel.removesuffix("_pa"), getattr(recording, channel), where)
    strongest = np.nanquantile(np.abs(thinned(recording.force_n)), QUANTILES[1]) if recording.force_n.size else 0.0
    fastest = max((stroke.pace_m_s for stroke in strokes), default=0.0)
    longest = max((abs(stroke.to_m - stroke.from_m) for stroke in strokes), default=0.0)
    for what, value, limit, unit, column in (
        ("the force reaches", strongest, FORCES_N[0], "N", "force"),
        ("the piston moves at", fastest, SPEEDS_M_S[0], "m/s", "time and the position"),
        ("the strokes are", longest, LONGEST_M, "m long", "position"),
    ):
        if value > limit:
            names = {"what": f"{what} {value:.4g} {unit}", "most": f"{limit:g} {unit}", "column": column}
            raise RecordingError.of("signals.more-than-any", where=where, **names)


# --- Delay between the pressures of closed chambers and the recorded motion.
#
# The gas of a closed chamber of volume V exchanges heat with a wall of constant temperature. With p = m R T / V, its
# energy balance is linear in p. In y = p V^gamma, the balance is a first-order lag. Each time step has the exact decay:
#
#     dp/dt = -gamma p (dV/dt)/V - k (p - c/V)      k = (gamma - 1) H / (m R)      c = m R T_wall
#     y = p V^gamma      dy/dt = k (c V^(gamma - 1) - y)
#
# The error of this model changes slowly. The fit therefore minimises the change of the residual from sample to sample.
# Reversals and stops then determine the delay, and the slow heat exchange does not bias the delay.
#
# Areas cancel, because only the ratio of volumes matters: V/A = distance of the piston from its reversal + L. The free
# parameters of each chamber are L (volume at the reversal over area), k, initial pressure, initial temperature and
# delay.

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
        None if no chamber is closed. The pressure of an open chamber is nearly constant, or does not follow the
        position.
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
