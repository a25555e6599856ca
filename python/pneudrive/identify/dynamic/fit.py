"""Identification of a drive from recordings by output error with exact sensitivities."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from pneudrive.errors import FitError
from pneudrive.estimate.estimates import robust_deviation
from pneudrive.estimate.transforms import Transforms
from pneudrive.free.parameters import Parameter, chosen, family_of, with_shape
from pneudrive.identify.dynamic.problem import (
    FitProblem,
    FittedRecording,
    Iterate,
    Shooter,
    measured_starts,
    observed,
    segment_starts,
    white_noise,
)
from pneudrive.identify.dynamic.result import assembled, unresolved_damping
from pneudrive.identify.dynamic.search import (
    LADDER_S,
    SECOND_LADDER_S,
    Attempt,
    Joined,
    Progress,
    SearchOptions,
    Solved,
    Watcher,
    information,
    join_segments,
    linearise,
    predict_segments,
)
from pneudrive.identify.dynamic.sensors import (
    CHANNELS,
    Channel,
    Sensor,
    channels_in,
    channels_of,
    command_delay,
    sensor_parameters,
)
from pneudrive.identify.follow.driven import check_follow, refuse_circuit
from pneudrive.identify.follow.fit import identify_motion
from pneudrive.progress import UNWATCHED, Watch
from pneudrive.signals.drive_recording import check_plausible, read_drive_recordings, refuse_standstill, time_gaps

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.identify.dynamic.result import DriveFit
    from pneudrive.identify.dynamic.sensors import SensorParameter
    from pneudrive.identify.follow.fit import FollowFit
    from pneudrive.progress import Flag
    from pneudrive.signals.drive_recording import DriveRecording, VolumeRecording

    Array = NDArray[np.float64]

#: Start value of the excess Fs - Fc for a drive without excess, as a share of Fc.
_LEAST_EXCESS = 0.02


def transforms_of(parameters: Sequence[Parameter], sensors: Sequence[SensorParameter], drive: Drive) -> Transforms:
    """Return the coordinates of free values of a drive and its sensors.

    The breakaway force is the Coulomb force plus an excess, so it is never lower. If one of these forces is held, it
    limits the other.
    """
    names, held = [p.name for p in parameters], drive.friction.parameters
    every = [*parameters, *sensors]
    upper = np.array([p.upper for p in every])
    place = {name: names.index(f"friction.{name}") for name in ("coulomb", "breakaway") if f"friction.{name}" in names}
    if "coulomb" in place and "breakaway" not in place and "breakaway" in held:
        upper[place["coulomb"]] = held["breakaway"]
    if "valve.critical_pressure_ratio" in names:
        upper[names.index("valve.critical_pressure_ratio")] = drive.valve.linear_above
    return Transforms(
        [p.lower for p in every],
        upper,
        [p.size if np.isinf(p.lower) else 1.0 for p in every],
        excess=place.get("breakaway") if "coulomb" in held else None,
        over=place.get("coulomb", held.get("coulomb", 0.0)),
        least_excess=_LEAST_EXCESS,
    )


RTOL = 1e-6
#: Sizes of the outputs for the solver's error, by unit.
_SCALE = {"m": 0.1, "Pa": 1e5, "m/s": 0.1, "K": 300.0, "N": 10.0}
#: Rounds of estimating the noise of the sensors from the residuals.
NOISE_ROUNDS = 4
#: Relative change of the noise below which it counts as converged.
NOISE_CHANGE = 0.02
#: Multiple of the noise from sample to sample above which residuals are a misfit (assumed).
MISFIT = 2.0
#: Factors on the segments' length for repeated searches, and the shortest segment, s.
SHORTER_SEGMENTS, SHORTEST_SEGMENT_S = (0.5, 0.25), 0.02
#: Factor on the solver's tolerance in the last attempt, as its error may stop the search.
LAST_RTOL = 1e-2
#: Least improvement of the mean logarithm of the residuals by a repeated search.
GAIN = 0.02
#: Huber's constant: 95 % efficient for normal errors [huber2009].
HUBER_K = 1.345


@overload
def identify(
    drive: Drive,
    recordings: Any,  # noqa: ANN401 - one or several recordings of several types
    free: Sequence[str],
    *,
    follow: None = None,
    sensors: Mapping[str, Sensor | Mapping[str, Any]] | None = None,
    channels: Sequence[str] | None = None,
    segment: str | float | None = "0.4 s",
    robust: bool = False,
    layout: str | Path | None = None,
    rtol: float = RTOL,
    threads: int = 2,
    progress: Callable[[Progress], None] | None = None,
    cancel: Flag | None = None,
) -> DriveFit: ...
@overload
def identify(
    drive: Circuit | str | Path,
    recordings: Any,  # noqa: ANN401
    free: Sequence[str] = ("volumes", "heat"),
    *,
    follow: Literal["motion"],
    layout: str | Path | None = None,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> FollowFit: ...
def identify(
    drive: Any,
    recordings: Any,
    free: Sequence[str] = ("volumes", "heat"),
    *,
    follow: str | None = None,
    sensors: Mapping[str, Sensor | Mapping[str, Any]] | None = None,
    channels: Sequence[str] | None = None,
    segment: str | float | None = "0.4 s",
    robust: bool = False,
    layout: str | Path | None = None,
    rtol: float = RTOL,
    threads: int = 2,
    progress: Any = None,
    cancel: Flag | None = None,
) -> DriveFit | FollowFit:
    """Identify parameters of a drive from recordings of its motion by output error.

    The drive is simulated under the recorded command. Free parameters of the drive and the sensors, and the start of
    each recording, are fitted to position, pressures and other measured channels by weighted least squares. Derivatives
    are exact, from dual numbers through the integrator. The recordings are cut into segments with free starts, which
    become continuous as the search converges (multiple shooting).

    Parameters
    ----------
    drive : Drive
        Drive with start values of free parameters; all other values are known.
    recordings
        One or several recordings. Each is a file of ``pneudrive simulate --out`` (.csv, .parquet, .nc), a foreign file
        with a layout, a result of ``pn.simulate``, or a mapping of SI columns (``time_s``, ``command``, ``position_m``,
        ``pressure_a_pa``, ``pressure_b_pa``).
    free : sequence of str
        Names in the drive file: ``friction.coulomb``, ``valve.conductance``, ``cylinder.dead_volume.a``, ...
    follow : {"motion"}, optional
        The piston of a circuit follows the recorded position, see `pneudrive.identify_motion`. Of the other arguments,
        only `layout`, `progress` and `cancel` count.
    sensors : mapping, optional
        Channel -> `Sensor` or its keywords: known noise, offset, gain, lag and resolution.
        ``{"command": {"delay": "free"}}``, or a time, delays the recorded command.
    channels : sequence of str, optional
        Channels to compare with the model; default: position and pressures.
    segment : str, float or None
        Length of the segments, s; None is single shooting: one segment for each recording.
    robust : bool
        Huber's loss, which reduces the weight of outliers.
    layout : path, optional
        Layout of foreign files.
    rtol : float
        Relative tolerance of the solver.
    threads : int
    progress : callable, optional
        Called with each step (`Progress`).
    cancel : object with ``is_set()``, optional
        A `threading.Event`, for instance: once set, the search ends with `Cancelled` at its next step.

    Returns
    -------
    DriveFit
        Values, intervals, covariance, undetermined values. Ctrl-C ends the search with the best point so far.

    Raises
    ------
    FitError, RecordingError, LayoutError
        Input is not valid; the message gives value, rule and remedy.

    Examples
    --------
    >>> import pneudrive as pn
    >>> truth = pn.Drive.load("catalogue:reference")
    >>> run = pn.simulate(truth, "0 s: 0.2, 0.2 s: -0.2", "0.4 s")
    >>> fit = pn.identify(truth.replace({"friction.coulomb": "25 N"}), run, free=["friction.coulomb"])
    >>> round(fit.values["friction.coulomb"], 2)
    30.0
    """
    if follow is not None:
        check_follow(follow)
        return identify_motion(drive, recordings, free, layout=layout, progress=progress, cancel=cancel)
    refuse_circuit(drive)
    records = read_drive_recordings(recordings, layout, needed=("time_s", "command"), gaps=True)
    present = [channels_in(record, channels) for record in records]
    options = _options(segment, robust, rtol, threads)
    for record in records:
        check_plausible(record, drive)
    refuse_standstill(records, free)
    options.notes += time_gaps(records)
    names = [c for c in CHANNELS if any(c in p for p in present)]
    drive = with_shape(drive, free)
    described = {c.name: c for c in channels_of(names, sensors)}
    options.delay = command_delay(sensors)
    parameters = _resolvable(drive, chosen(drive, free), records, described, options)
    watcher = Watcher(progress, Watch(cancel=cancel))
    stated = [np.array([np.isfinite(described[c].noise or np.nan) for c in p]) for p in present]

    def attempt(values: Array | None) -> Attempt:
        start = None if values is None else values[: len(parameters)]
        problem, point = _problem(drive, parameters, records, present, described, options, watcher.watch, start)
        return solve(problem, point, stated, options, watcher)

    best = _best_of_attempts(attempt, options)
    for experiment in best.solved.problem.experiments:
        experiment.shooter.watch = UNWATCHED  # later calls on the fit have their own watch
    return assembled(drive, parameters, records, best, options, watcher)


def _best_of_attempts(attempt: Callable[[Array | None], Attempt], options: SearchOptions) -> Attempt:
    """Repeat the search with shorter segments, while that helps, if the first one does not reach the measured motion.

    The error of a short segment is small even for wrong values. A search with short segments therefore passes local
    minima, and its result is a better start for long segments. An incomplete model deviates with segments of any
    length. Then the first result is kept.
    """
    tried = [attempt(None)]
    whole = options.segment_s
    for share in SHORTER_SEGMENTS:
        if whole is None or options.interrupted or tried[-1].good or share * whole < SHORTEST_SEGMENT_S:
            break
        options.segment_s = share * whole
        try:
            tried.append(attempt(None))
        except FitError:  # the first search has a result
            break
        if tried[0].converged and tried[-1].score > tried[0].score - GAIN:
            break
    options.segment_s = whole
    for lengths_s in (LADDER_S, SECOND_LADDER_S):
        best = min(tried, key=Attempt.rank)
        nearest = min(tried, key=lambda one: one.score)
        helped = not best.converged or nearest.score < best.score - GAIN
        if whole is None or options.interrupted or best.good or not helped:
            break
        options.lengths_s, options.last_attempt = lengths_s, lengths_s == SECOND_LADDER_S
        if options.last_attempt:
            options.rtol *= LAST_RTOL
        try:
            tried.append(attempt(nearest.solved.problem.values(nearest.solved.point.eta)))
        except FitError:
            break
    return min(tried, key=Attempt.rank)


def _options(segment: str | float | None, robust: bool, rtol: float, threads: int) -> SearchOptions:
    from pneudrive.units import parse

    seconds = parse(segment, "s") if isinstance(segment, str) else segment
    if seconds is not None and not (np.isfinite(seconds) and seconds > 0.0):
        raise FitError(f"segment = {segment} is out of bounds", rule="a positive time, or None for single shooting")
    if not 1e-12 <= rtol <= 1e-2:
        raise FitError(f"rtol = {rtol} is out of bounds", rule="1e-12 <= rtol <= 0.01")
    return SearchOptions(seconds, robust, rtol, max(1, int(threads)))


def _resolvable(
    drive: Drive,
    parameters: list[Parameter],
    records: list[DriveRecording],
    described: dict[str, Channel],
    options: SearchOptions,
) -> list[Parameter]:
    """Hold the bristle damping if the encoder does not resolve the bristles."""
    levels = dict(drive.friction.parameters)
    damping = [p for p in parameters if p.name == "friction.bristle_damping"]
    if not damping or "position" not in described or "bristle_stiffness" not in levels:
        return parameters
    position = described["position"]
    noise = [white_noise(r["position_m"]) for r in records if "position_m" in r]
    step = max(position.resolution, float(np.median(noise)) if noise else 0.0)
    force = levels.get("breakaway", levels.get("coulomb", 0.0))
    lost = unresolved_damping(step, force, levels["bristle_stiffness"])
    if lost is None:
        return parameters
    options.lost.append(lost)
    options.notes.append(f"friction.bristle_damping is held at {damping[0].value:g} N s/m")
    rest = [p for p in parameters if p is not damping[0]]
    if not rest:
        raise FitError("no parameter is left free", value=str(lost))
    return rest


def _problem(
    drive: Drive,
    parameters: list[Parameter],
    records: list[DriveRecording],
    present: list[list[str]],
    described: dict[str, Channel],
    options: SearchOptions,
    watch: Watch,
    values: Array | None = None,
) -> tuple[FitProblem, Iterate]:
    """Return the fit problem: cut recordings and starts of segments; `values` are the start values."""
    family = family_of(drive, parameters)
    values = np.array([p.value for p in parameters]) if values is None else values
    experiments = []
    for record, names in zip(records, present, strict=True):
        own = [described[name] for name in names]
        starts = segment_starts(record.time_s, options.first_segment_s(record))
        outputs = [c.column for c in own]
        delay_s, threads = options.delay.value_s, options.threads
        shooter = Shooter(record, outputs, starts, family, options.rtol, threads, delay_s, watch)
        noise = np.array([noise_of(c, record, options.rtol) for c in own])
        inner = shooter.inner_states(values)
        state, spread = measured_starts(record, own, noise, starts, drive, inner, watch)
        experiments.append(FittedRecording(shooter, own, observed(shooter, values, state, spread, inner), noise))
    free_sensors = sensor_parameters(
        list(described.values()), [r.name for r in records], [set(p) for p in present], delay=options.delay.free
    )
    transforms = transforms_of(parameters, free_sensors, drive)
    problem = FitProblem(parameters, free_sensors, transforms, experiments)
    if options.robust:
        problem.huber_k = HUBER_K
    sensor_start = [
        described[s.channel].lag if s.kind == "lag" else {"offset": 0.0, "delay": 0.0, "gain": 1.0}[s.kind]
        for s in free_sensors
    ]
    return problem, Iterate(
        transforms.internal(np.r_[values, sensor_start]), [e.starts.state.copy() for e in experiments]
    )


def _least_noise(channel: Channel, rtol: float) -> float:
    """Return the lower limit of the noise of a channel: resolution of the sensor, error of the solver."""
    return float(np.hypot(channel.resolution / np.sqrt(12.0), rtol * _SCALE.get(channel.unit, 1.0)))


def noise_of(channel: Channel, record: DriveRecording | VolumeRecording, rtol: float) -> float:
    """Return the initial standard deviation of a channel: the stated value, or the one from sample to sample."""
    white = white_noise(record[channel.column]) if channel.noise is None else channel.noise
    return float(np.hypot(white, _least_noise(channel, rtol)))


def solve(
    problem: FitProblem,
    point: Iterate,
    stated: list[NDArray[np.bool_]],
    options: SearchOptions,
    watcher: Watcher,
) -> Attempt:
    """Search, and estimate the noise of the sensors from the residuals until it converges.

    If the search stops early, the misfit is not taken as noise before the last attempt.
    """
    converged = False
    watcher.point, at = point, None
    family = problem.experiments[0].shooter.family
    believed = [s.copy() for s in point.states]
    try:
        if options.segment_s is not None:
            for length_s in (*options.ladder, options.segment_s):
                point = _regrouped(problem, predict_segments(problem, point, watcher), length_s)
                watcher.point = point
        for _ in range(NOISE_ROUNDS):
            point, at, converged = join_segments(problem, point, believed, watcher)
            if not (converged or options.last_attempt) or not _renew_noise(problem, at, stated, options.rtol):
                break
        if converged and family.settle(problem.values(point.eta)[: problem.drive_size]):
            point, at, converged = join_segments(problem, point, believed, watcher)
    except KeyboardInterrupt:
        options.interrupted = True
        problem.held[:] = False
        options.notes.append("the search was interrupted: these are the best values so far")
        point, at, converged = watcher.point, None, False
    if at is None:
        shots = problem.run(point)
        if isinstance(shots, str):
            raise FitError("the search ended at values for which the drive cannot be simulated", value=shots)
        at = linearise(problem, point, believed, shots)
    found = information(problem, at)
    measured = int(sum(e.weight.sum() for e in problem.experiments))
    freedom = measured - problem.size - sum(s.shape[1] for s in point.states)
    solved = Solved(problem, point, believed, at, found, max(freedom, 1))
    over = over_noise(solved)
    missed = {name: ratio for name, ratio in over.items() if ratio > MISFIT}
    score = float(np.mean(np.log([max(ratio, 1e-9) for ratio in over.values()])))
    return Attempt(solved, converged, missed, score, options.segment_s)


def over_noise(solved: Solved) -> dict[str, float]:
    """Return the residuals of each channel relative to its noise from sample to sample, in the worst recording."""
    worst: dict[str, float] = {}
    for experiment, residual in zip(solved.problem.experiments, solved.at.residuals, strict=True):
        for c, channel in enumerate(experiment.channels):
            used = experiment.weight[:, c] > 0.0
            own = experiment.noise[c] * float(np.sqrt(np.mean(residual[used, c] ** 2)))
            white = max(white_noise(experiment.measured[:, c]), _least_noise(channel, RTOL))
            worst[channel.name] = max(worst.get(channel.name, 0.0), own / white)
    return worst


def _regrouped(problem: FitProblem, point: Iterate, length_s: float) -> Iterate:
    """Join the short segments of the first phase to longer ones with the same starts."""
    states = []
    for experiment, state in zip(problem.experiments, point.states, strict=True):
        old = experiment.shooter.starts
        wanted = segment_starts(experiment.shooter.recording.time_s, length_s)
        kept = np.unique(np.abs(old[:, None] - wanted).argmin(axis=0))
        experiment.shooter = replace(experiment.shooter, starts=old[kept])
        states.append(state[kept])
    return Iterate(point.eta, states)


def _renew_noise(problem: FitProblem, at: Joined, stated: list[NDArray[np.bool_]], rtol: float) -> bool:
    """Estimate unstated noise from the residuals; return whether it changed."""
    changed = False
    for experiment, residual, known in zip(problem.experiments, at.residuals, stated, strict=True):
        for c, channel in enumerate(experiment.channels):
            if known[c]:
                continue
            r = residual[experiment.weight[:, c] > 0.0, c]
            size = float(np.sqrt(np.mean(r**2)))
            if np.isfinite(problem.huber_k):
                size = robust_deviation(r)
            new = max(size * experiment.noise[c], _least_noise(channel, rtol))
            if abs(new / experiment.noise[c] - 1.0) > NOISE_CHANGE:
                experiment.noise[c], changed = new, True
    return changed
