"""Fit problem: recordings in segments, derivatives of the outputs, start states, sensors, and residuals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from pneudrive import _core
from pneudrive.arrays import Array, ArrayPair, Bools, Ints, NamedNumbers
from pneudrive.describe import Circuit, Drive
from pneudrive.errors import FitError
from pneudrive.estimate.estimates import Transforms, rms
from pneudrive.free.parameters import COMMAND_STEPS, DriveFamily, Parameter, at_rest
from pneudrive.identify.dynamic.sensors import Channel, SensorParameter, lagged
from pneudrive.identify.identified import stated
from pneudrive.progress import UNWATCHED, Watch
from pneudrive.signals.drive_recording import DriveRecording


@dataclass(frozen=True)
class Shot:
    """Result of a run of all segments.

    Attributes
    ----------
    outputs : ndarray, shape (n, o)
        Outputs at the samples. The first sample of a segment has the outputs of its start.
    by_parameter : ndarray, shape (n, o, p)
        Derivatives with respect to the free values of the drive, in SI; p = 0 without derivatives.
    by_start : ndarray, shape (n, o, s)
        Derivatives with respect to the start state of the sample's segment; s = 0 without derivatives.
    ends : ndarray, shape (k, s)
        State at the end of each segment.
    ends_by_parameter, ends_by_start : ndarray, shapes (k, s, p), (k, s, s)
    failures : dict
        Segment -> reason of its failure.
    """

    outputs: Array
    by_parameter: Array
    by_start: Array
    ends: Array
    ends_by_parameter: Array
    ends_by_start: Array
    failures: dict[int, str]


@dataclass
class FittedRecording:
    """Recording in the fit, with its segments and measured channels; `run` simulates the segments.

    Parameters
    ----------
    recording : DriveRecording
    channels : list of Channel
        Compared channels; c is their number.
    starts : ndarray of int, shape (k,)
        Samples at which segments begin.
    family : DriveFamily
    noise : ndarray, shape (c,)
        Standard deviations that weight the channels.
    rtol : float
    threads : int
    delay_s : float
        Delay of the valve after the command in s, unless `run` is given another delay.
    watch : Watch
        Can cancel a run.

    Attributes
    ----------
    measured, weight : ndarray, shape (n, c)
        Measurements, and their weights: 0 for a missing measurement, otherwise 1.
    belief, size : ndarray, shape (s,)
        Prior standard deviations and typical changes of the start states.
    hidden : ndarray of bool, shape (s,)
        Mask of unmeasured start states.
    limits : (ndarray, ndarray), shape (s,)
        Bounds of the start states; infinite for measured states.
    """

    recording: DriveRecording
    channels: list[Channel]
    starts: Ints
    family: DriveFamily
    noise: Array
    rtol: float
    threads: int
    delay_s: float = 0.0
    watch: Watch = UNWATCHED
    belief: Array = field(init=False)
    size: Array = field(init=False)
    hidden: Bools = field(init=False)
    limits: ArrayPair = field(init=False)

    def __post_init__(self) -> None:
        self.measured = np.stack([self.recording[c.column] for c in self.channels], axis=1)
        self.weight = np.isfinite(self.measured).astype(float)

    @property
    def segments(self) -> list[slice]:
        """Samples of each segment."""
        edges = [*self.starts.tolist(), self.measured.shape[0]]
        return [slice(a, b) for a, b in pairwise(edges)]

    def run(
        self,
        values: Array,
        initial: Array,
        *,
        derivatives: bool = True,
        by_start: Ints | None = None,
        delay_s: float | None = None,
        outputs: Sequence[str] = (),
    ) -> Shot:
        """Run all segments.

        Parameters
        ----------
        values : ndarray, shape (p,)
            Free values of the drive, in SI.
        initial : ndarray, shape (k, s)
            Starts of the segments.
        derivatives : bool
            Whether to compute derivatives with respect to values and starts.
        by_start : ndarray of int, optional
            Start states with derivatives. Default: all. Derivatives with respect to other states are zero.
        delay_s : float, optional
            Free delay of the command. Derivatives with respect to the delay follow those with respect to the values.
        outputs : sequence of str, optional
            Columns of the core; default: those of the channels.

        Raises
        ------
        FitError
            The core rejects the drive.
        """
        try:
            core = self.family.core(values)
            found = self._shoot(core, initial, delay_s, derivatives=derivatives, by_start=by_start, outputs=outputs)
            slopes = self._slopes_by_command(values, initial, delay_s) if derivatives else []
        except ValueError as error:
            raise FitError(f"the search tried values that the simulation rejects: {error}") from None
        p = self.family.size + (delay_s is not None) if derivatives else 0
        sensitivities, ends = found["sensitivities"], found["end_sensitivities"]
        if derivatives:
            exact, paths = len(self.family.exact), len(self.family.paths)
            if by_start is not None:
                sensitivities, ends = (_spread(d, exact, by_start, initial.shape[1]) for d in (sensitivities, ends))
            for k, by_values, by_ends in slopes:
                sensitivities = np.insert(sensitivities, k, by_values, axis=2)
                ends = np.insert(ends, k, by_ends, axis=2)
            if paths > self.family.size:
                by_free = self.family.by_free(values)
                sensitivities, ends = (
                    np.concatenate([d[..., :paths] @ by_free, d[..., paths:]], axis=-1) for d in (sensitivities, ends)
                )
        return Shot(
            outputs=found["values"],
            by_parameter=sensitivities[:, :, :p],
            by_start=sensitivities[:, :, p:],
            ends=found["ends"],
            ends_by_parameter=ends[:, :, :p],
            ends_by_start=ends[:, :, p:],
            failures={j: why for j, why in enumerate(found["failures"]) if why is not None},
        )

    def _slopes_by_command(
        self, values: Array, initial: Array, delay_s: float | None
    ) -> list[tuple[int, Array, Array]]:
        """Return derivatives with respect to each free number that acts on the command, from central differences.

        Such numbers are hysteresis and delay of the valve, and the delay of the recorded command. Each tuple belongs to
        one number: its index among the derivatives, and the derivatives of outputs and ends.
        """
        at, steps, out = np.r_[values, self.delay_s if delay_s is None else delay_s], {}, []
        for k, path in enumerate(self.family.paths):
            if path not in self.family.exact:
                steps[k] = min(COMMAND_STEPS[path.rpartition(".")[2]], 0.5 * values[k])
        if delay_s is not None:
            steps[values.size] = COMMAND_STEPS["delay"]
        for k, step in steps.items():
            change = step * (np.arange(at.size) == k)
            ends = at + change, at - change
            both = (self._shoot(self.family.core(x[:-1]), initial, x[-1]) for x in ends)
            after, before = ((run["values"], run["ends"]) for run in both)
            by_values, by_ends = ((b - a) / (2.0 * step) for a, b in zip(before, after, strict=True))
            out.append((k if k < values.size else len(self.family.paths), by_values, by_ends))
        return out

    def _shoot(
        self,
        core: Any,  # noqa: ANN401 - the core's drive
        initial: Array,
        delay_s: float | None,
        *,
        derivatives: bool = False,
        by_start: Ints | None = None,
        outputs: Sequence[str] = (),
    ) -> _core.Shot:
        times, commands = delayed(*self.recording.steps, self.delay_s if delay_s is None else delay_s)
        asked: _core.Shooting = {
            "times": times.tolist(),
            "commands": commands.tolist(),
            "sample_times": self.recording.time_s,
            "starts": self.starts.tolist(),
            "initial": np.ascontiguousarray(initial),
            "parameters": self.family.exact if derivatives else [],
            "with_initial": derivatives if by_start is None or not derivatives else by_start.tolist(),
            "outputs": list(outputs) or [c.column for c in self.channels],
            "rtol": self.rtol,
            "threads": self.threads,
        }
        return self.family.shoot(core, asked, lambda _: self.watch.look())


def delayed(times: Array, commands: Array, delay_s: float) -> ArrayPair:
    """Shift the steps of a command in time. The first step keeps its time."""
    if delay_s == 0.0:
        return times, commands
    shifted = times + delay_s
    first = max(int(np.searchsorted(shifted, times[0], side="right")) - 1, 0)
    return np.r_[times[0], shifted[first + 1 :]], commands[first:]


def _spread(derivatives: Array, p: int, columns: Ints, states: int) -> Array:
    """Expand derivatives with respect to some start states to all start states. The added derivatives are zero."""
    out = np.zeros((*derivatives.shape[:-1], p + states))
    out[..., :p] = derivatives[..., :p]
    out[..., p + columns] = derivatives[..., p:]
    return out


def segment_starts(time_s: Array, length_s: float | None) -> Ints:
    """Return the first sample of each segment of about `length_s`; None gives one segment.

    All segments have at least two samples and similar lengths (within a factor of 2).
    """
    total = float(time_s[-1] - time_s[0])
    count = 1 if length_s is None else max(1, round(total / length_s))
    wanted = time_s[0] + total * np.arange(count) / count
    starts = np.unique(np.searchsorted(time_s, wanted - 1e-9 * total))
    return starts[starts < time_s.size - 1].astype(np.int64)


@dataclass(frozen=True)
class Iterate:
    """Point of the search: global coordinates (drive, then sensors) and the starts of all segments."""

    eta: Array
    states: list[Array]


class FitProblem:
    """Constant data of a fit, and the noise and weights of the samples.

    Parameters
    ----------
    parameters : list of Parameter
        Free values of the drive.
    sensors : list of SensorParameter
        Free values of the sensors.
    transforms : Transforms
        Transformation of all free values to coordinates.
    experiments : list of FittedRecording
    """

    def __init__(
        self,
        parameters: list[Parameter],
        sensors: list[SensorParameter],
        transforms: Transforms,
        experiments: list[FittedRecording],
    ) -> None:
        self.parameters, self.sensors, self.transforms = parameters, sensors, transforms
        self.experiments = experiments
        self.drive_size = len(parameters)
        self.size = self.drive_size + len(sensors)
        #: Recording -> coordinate of its free command delay, as an index.
        self.delays = {s.recording: i for i, s in enumerate(sensors, self.drive_size) if s.kind == "delay"}
        #: Prior precision of the coordinates: 0 without prior knowledge.
        precision = [(s.size / s.uncertainty) ** 2 if s.uncertainty > 0.0 else 0.0 for s in sensors]
        self.prior = np.r_[np.zeros(self.drive_size), precision]
        #: Prior starts of the segments of each recording; only the first start is used.
        self.believed: list[Array] = []
        #: Whether segments start from measurements, so that only unmeasured states are carried over.
        self.is_separate = False
        #: Mask of temporarily held coordinates.
        self.held = np.zeros(self.size, dtype=bool)

    @property
    def records(self) -> list[DriveRecording]:
        """Recordings of the fit."""
        return [experiment.recording for experiment in self.experiments]

    @property
    def names(self) -> list[str]:
        """Names of the global coordinates."""
        return [p.name for p in (*self.parameters, *self.sensors)]

    def values(self, eta: Array) -> Array:
        """Return the free values of the drive and the sensors, in SI."""
        return self.transforms.natural(eta)

    def rms(self, residuals: list[Array]) -> NamedNumbers:
        """Return the root mean square of each channel's residuals, in SI."""
        parts: dict[str, list[Array]] = {}
        for i, c, residual in self.valid(residuals):
            experiment = self.experiments[i]
            parts.setdefault(experiment.channels[c].name, []).append(residual * experiment.noise[c])
        return {name: rms(np.concatenate(own)) for name, own in parts.items()}

    def valid(self, residuals: list[Array]) -> Iterator[tuple[int, int, Array]]:
        """Yield recording, channel and the residuals of its measured samples."""
        for i, (experiment, residual) in enumerate(zip(self.experiments, residuals, strict=True)):
            yield from ((i, c, residual[good, c]) for c, good in enumerate(experiment.weight.T > 0.0))

    def run(self, point: Iterate, stage: str, *, derivatives: bool = True) -> list[Shot]:
        """Run all recordings. In the first phase, derivatives with respect to starts cover only unmeasured states.

        Parameters
        ----------
        point : Iterate
        stage : str
            Part of the search that an error names, as a key of the sentences ``not_simulated``.
        derivatives : bool

        Raises
        ------
        FitError
            The core rejects the drive, or a segment fails.
        """
        values = self.values(point.eta)
        shots = []
        for i, (experiment, states) in enumerate(zip(self.experiments, point.states, strict=True)):
            delay_s = float(values[self.delays[i]]) if i in self.delays else None
            hidden = np.flatnonzero(experiment.hidden) if self.is_separate else None
            shot = experiment.run(
                values[: self.drive_size], states, derivatives=derivatives, by_start=hidden, delay_s=delay_s
            )
            if shot.failures:
                j, why = next(iter(shot.failures.items()))
                record = experiment.recording
                value = f"{record.name}, segment from {record.time_s[experiment.starts[j]]:g} s: {why}"
                raise FitError(value=value, **stated("not_simulated", stage))
            shots.append(shot)
        return shots

    def possible(self, point: Iterate) -> Iterate:
        """Project unmeasured states onto their bounds."""
        states = [np.clip(s, *e.limits) for s, e in zip(point.states, self.experiments, strict=True)]
        return Iterate(point.eta, states)

    def by_coordinates(self, index: int, shot_by_parameter: Array, eta: Array) -> Array:
        """Convert derivatives for drive values and delay (last axis) to derivatives for the global coordinates."""
        p = self.drive_size
        jacobian = self.transforms.jacobian(eta)[:p, :p]
        out = np.zeros((*shot_by_parameter.shape[:-1], self.size))
        out[..., :p] = shot_by_parameter[..., :p] @ jacobian
        if (place := self.delays.get(index)) is not None:
            out[..., place] = shot_by_parameter[..., p] * self.sensors[place - p].size
        return out

    def measure(self, index: int, eta: Array, outputs: Array, derivatives: Array | None = None) -> ArrayPair:
        """Pass outputs through the sensors and compare them with the measurements, in units of the noise.

        Parameters
        ----------
        index : int
        eta : ndarray, shape (P,)
        outputs : ndarray, shape (n, c)
        derivatives : ndarray, shape (n, c, P + more), optional
            Derivatives with respect to the global coordinates (zeros for the sensors), then to any further variables.

        Returns
        -------
        residual : ndarray, shape (n, c)
            (measured - model) / noise; 0 for missing measurements.
        derivatives : ndarray, shape (n, c, P + more)
            Derivatives of the model, divided by the noise; shape (n, c, 0) without `derivatives`.
        """
        experiment, values = self.experiments[index], self.values(eta)
        time = experiment.recording.time_s
        model, slopes = np.empty_like(outputs), np.empty((*outputs.shape, 0))
        slopes = slopes if derivatives is None else np.empty_like(derivatives)
        for c, channel in enumerate(experiment.channels):
            own = ((i, s) for i, s in enumerate(self.sensors, self.drive_size) if s.channel == channel.name)
            number = {s.kind: i for i, s in own if s.recording in (None, index)}
            gain, lag, offset = (
                float(values[number[k]]) if k in number else getattr(channel, k) for k in ("gain", "lag", "offset")
            )
            h = lagged(time, outputs[:, c], lag)
            model[:, c] = gain * h + offset
            if derivatives is None:
                continue
            slopes[:, c] = gain * lagged(time, derivatives[:, c], lag)
            if "offset" in number:
                slopes[:, c, number["offset"]] += self.sensors[number["offset"] - self.drive_size].size
            if "gain" in number:
                slopes[:, c, number["gain"]] += h
            if "lag" in number:  # differentiate lag h' + h = u by the lag
                slopes[:, c, number["lag"]] -= gain * lag * lagged(time, (outputs[:, c] - h) / lag, lag)
        weight = experiment.weight / experiment.noise
        residual = np.where(weight > 0.0, experiment.measured - model, 0.0) * weight
        return residual, slopes * weight[:, :, None]


#: Half widths of the windows in which parabolas are fitted, s.
WINDOW_S = 0.01
LEAST_HALF_WIDTH = 3  # samples
#: Multiple of the noise below which the residual of a parabola is accepted.
PARABOLA_NOISE = 1.5
#: Smallest number of samples for a parabola.
_LEAST_SAMPLES = 4
#: Largest number of window samples in memory at a time.
_AT_ONCE = 1_000_000
#: Number of runs until unmeasured states have settled. Each run starts from the end states of the previous one.
ROUNDS = 3
#: Quantity in the name of a start state -> its prior standard deviation, and its typical size, which scales the gaps
#: between segments. Gas that was compressed or expanded before the recording is within tens of kelvin of the wall
#: temperature (assumed).
USUAL = {"position": (1e-2, 1e-3), "velocity": (0.2, 1e-2), "pressure": (5e4, 1e4), "temperature": (20.0, 10.0)}
#: Number of start states that each drive has: position and velocity of the piston, gas of its two chambers.
OWN_STATES = 6
#: Bounds of unmeasured states, as a multiple of the prior standard deviation.
POSSIBLE = 4.0
#: States that grow throughout a recording. They have no upper limit, because short segments do not show their range.
GROWING = ("contact_age_s", "sliding_distance_m", "contact_warming_k")
#: Lower bound of pressure and temperature in a tube, as a fraction of the lowest simulated values.
LEAST_SHARE = 0.2
#: Unusual pressures of chambers a and b, Pa, as markers. Gas that gets one of these pressures by default starts like
#: the chamber with this pressure.
DISTINCT_PA = (110001.0, 130003.0)


def measured_starts(experiment: FittedRecording, drive: Drive | Circuit, names: list[str]) -> Array:
    """Return the starts of the segments from smoothed signals, and set the mask of unmeasured states.

    Unmeasured states have the values of a drive at rest: states of friction are zero, and gas of tubes has the pressure
    of its chamber.

    Parameters
    ----------
    experiment : FittedRecording
        Recording in k segments.
    drive : Drive or Circuit
    names : list of str
        Names of the s states.

    Returns
    -------
    ndarray, shape (k, s)
    """
    recording, starts, ambient = experiment.recording, experiment.starts, drive.ambient
    piston, measured = experiment.family.piston, dict[str, Array]()
    for channel, noise in zip(experiment.channels, experiment.noise.tolist(), strict=True):
        if channel.column not in names:
            continue
        values = (recording[channel.column] - channel.offset) / channel.gain
        measured[channel.column], slope = _smoothed(recording.time_s, values, starts, noise, experiment.watch)
        if channel.name == "position" and "velocity_m_s" not in recording:
            measured["velocity_m_s"] = slope
    experiment.hidden = np.array([name not in measured for name in names])
    pressures = (measured.get(f"pressure_{side}_pa", ambient.pressure_pa) for side in "ab")
    a, b = chambers = [np.maximum(pressure, 0.1 * ambient.pressure_pa) for pressure in pressures]
    state = {name: at_rest(name, (a, b), ambient.temperature_k) for name in names}
    if isinstance(drive, Circuit):
        distinct = {f"{piston}.{side}": f"{value} Pa abs" for side, value in zip("ab", DISTINCT_PA, strict=True)}
        for name, value in drive.core_initial(distinct).items():
            state[name] = chambers[DISTINCT_PA.index(value)] if value in DISTINCT_PA else value
    state["position_m"] = 0.5 * experiment.family.get(f"{piston}.stroke")
    state |= dict.fromkeys(("temperature_a_k", "temperature_b_k"), ambient.temperature_k)
    state |= measured | {"pressure_a_pa": a, "pressure_b_pa": b}
    return np.column_stack([np.broadcast_to(state[name], starts.size) for name in names])


def start_states(experiment: FittedRecording, drive: Drive | Circuit, values: Array) -> Array:
    """Return the starts of the segments, shape (k, s), and set their priors, sizes and limits.

    Unmeasured states come from the model: gas temperatures, bristles, gas of tubes. All segments are run repeatedly,
    and each takes unmeasured states from the end of the previous segment. A wrong guess decays after a few rounds.
    """
    names = experiment.family.core(values).segment_names
    state, most = measured_starts(experiment, drive, names), np.zeros(len(names))
    hidden = np.flatnonzero(experiment.hidden)
    for _ in range(ROUNDS):
        shot = experiment.run(values, state, derivatives=False)
        good = [j for j in range(len(state) - 1) if j not in shot.failures]
        for j in good:
            state[j + 1, hidden] = shot.ends[j, hidden]
        ends = np.delete(shot.ends, list(shot.failures), axis=0)
        most = np.maximum(most, np.abs(ends).max(axis=0, initial=0.0))
    # of the piston and its chambers, and of the gas in tubes and joints; other states have the scale of their range
    usual = [i < OWN_STATES or name.endswith((".pressure_pa", ".temperature_k")) for i, name in enumerate(names)]
    kinds = [n.rpartition(".")[2].split("_")[0] if known else n for n, known in zip(names, usual, strict=True)]
    # wide also for measured columns, as the samples are more accurate than their smoothed start
    reached = np.where(most > 0.0, most, 1e-6).tolist()
    scales = [USUAL.get(kind, (own, 0.1 * own)) for kind, own in zip(kinds, reached, strict=True)]
    experiment.belief, experiment.size = np.array(scales).T
    reach = np.where(experiment.hidden, POSSIBLE * experiment.belief, np.inf)
    is_gas, lowest = np.isin(kinds, ("pressure", "temperature")), state.min(axis=0)
    experiment.limits = (
        np.where(is_gas & experiment.hidden, np.maximum(lowest - reach, LEAST_SHARE * lowest), lowest - reach),
        np.where(np.isin(names, GROWING), np.inf, state.max(axis=0) + reach),
    )
    return state


def _smoothed(time_s: Array, values: Array, at: Ints, noise: float, watch: Watch) -> ArrayPair:
    """Return value and slope of a local parabola at the samples `at`.

    The window is the widest in which a parabola follows the signal within its noise.
    """
    good = np.isfinite(values)
    step = np.median(np.diff(time_s))
    widest = max(LEAST_HALF_WIDTH, round(WINDOW_S / step))
    widths = sorted({max(LEAST_HALF_WIDTH, widest >> k) for k in range(6)}, reverse=True)
    level, slope = np.empty(at.size), np.zeros(at.size)
    left = np.arange(at.size)
    for half in widths:
        fits = []
        for some in np.array_split(left, max(1, left.size * (2 * half + 1) // _AT_ONCE)):
            watch.look()
            level[some], slope[some], fit = _parabolas(time_s, values, good, at[some], half, PARABOLA_NOISE * noise)
            fits.append(fit)
        left = left[~np.concatenate(fits)]
        if not left.size:
            break
    return level, slope


def _parabolas(
    time_s: Array,
    values: Array,
    good: Bools,
    at: Ints,
    half: int,
    most: float,
) -> tuple[Array, Array, Bools]:
    """Return value and slope of the parabola around each sample, and a mask of samples with a small residual.

    If a window has fewer than four samples (a gap of the signal), the nearest value is used.
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
    rest = y - (design @ c)[:, :, 0]
    off = np.sqrt(np.sum(rest**2, axis=1) / np.maximum(count - 3, 1))
    level[fits], slope[fits] = c[:, 0, 0] + mean, c[:, 1, 0] / scale
    done = ~fits
    done[fits] = off <= most
    return level, slope, done
