"""Identification of a drive from recordings by output error with exact sensitivities."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import __version__
from pneudrive.characterise.drive_recording import read_drive_recordings
from pneudrive.characterise.plausible import check_plausible, time_gaps
from pneudrive.characterise.spread import robust_deviation, student
from pneudrive.errors import FitError
from pneudrive.identify.dynamic.files import fit_hash
from pneudrive.identify.dynamic.parameters import Candidates, Coordinates, Parameter, chosen
from pneudrive.identify.dynamic.problem import Experiment, Point, Problem, sensor_parameters
from pneudrive.identify.dynamic.recordings import CHANNELS, channels_in
from pneudrive.identify.dynamic.result import DriveFit, Series
from pneudrive.identify.dynamic.search import Joined, Progress, Watcher, join_segments, linearise, predict_segments
from pneudrive.identify.dynamic.sensors import Channel, Delay, Sensor, channels_of, command_delay
from pneudrive.identify.dynamic.shooting import Shooter, segment_starts
from pneudrive.identify.dynamic.states import measured_starts, observed, white_noise
from pneudrive.identify.dynamic.uncertainty import Information, bootstrap, information, intervals_of, profile
from pneudrive.identify.dynamic.undetermined import statements, unresolved_damping

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.characterise.drive_recording import DriveRecording
    from pneudrive.describe import Drive
    from pneudrive.identify.diagnose import Undetermined

    Array = NDArray[np.float64]

RTOL = 1e-6
#: Sizes of the outputs of which the solver's error is a share, by unit.
_SCALE = {"m": 0.1, "Pa": 1e5, "m/s": 0.1, "K": 300.0, "N": 10.0}
#: Rounds in which the noise of the sensors is taken from the residuals.
NOISE_ROUNDS = 4
#: Lengths of the segments of the first phase, s, and those of a second attempt; the shortest has so many samples.
LADDER_S, SECOND_LADDER_S, LEAST_SEGMENT_SAMPLES = (0.01, 0.04), (0.02, 0.08), 8
#: Change of the noise below which it counts as found.
NOISE_CHANGE = 0.02
#: Correlation of residuals, in samples, of which a note is made, unless their variance is that of the solver alone.
CORRELATED, SOLVER_SHARE = 10.0, 0.1
#: Residuals above this multiple of the noise from sample to sample are no noise (assumed).
MISFIT = 2.0
#: A fit below this, worse than the mean of the record, is no matter of parameters, %.
SENSELESS_PERCENT = 0.0
#: Huber's constant: 95 % efficient for normal errors [huber2009].
HUBER_K = 1.345


@dataclass
class Solved:
    """The problem with its solution: what profile and bootstrap go on from."""

    problem: Problem
    point: Point
    believed: list[Array]
    at: Joined
    information: Information
    freedom: int


@dataclass
class Options:
    """Checked options of `identify`."""

    segment_s: float | None
    robust: bool
    rtol: float
    threads: int
    notes: list[str] = field(default_factory=list)
    lost: list[Undetermined] = field(default_factory=list)
    interrupted: bool = False
    last_attempt: bool = False
    lengths_s: tuple[float, ...] = LADDER_S
    delay: Delay = field(default_factory=Delay)

    @property
    def ladder(self) -> tuple[float, ...]:
        """Lengths to which the segments of the first phase grow, s."""
        return tuple(length for length in self.lengths_s[1:] if self.segment_s is not None and length < self.segment_s)

    def first_segment_s(self, record: DriveRecording) -> float | None:
        """Length of the first segments; None where there is no first phase."""
        if self.segment_s is None:
            return None
        step = record.duration_s / (len(record) - 1)
        return min(self.segment_s, max(self.lengths_s[0], LEAST_SEGMENT_SAMPLES * step))


def identify(
    drive: Drive,
    recordings: Any,  # noqa: ANN401 - one or several, of several kinds
    free: Sequence[str],
    *,
    sensors: Mapping[str, Sensor | Mapping[str, Any]] | None = None,
    channels: Sequence[str] | None = None,
    segment: str | float | None = "0.4 s",
    robust: bool = False,
    layout: str | Path | None = None,
    rtol: float = RTOL,
    threads: int = 2,
    progress: Callable[[Progress], None] | None = None,
) -> DriveFit:
    """Identify numbers of a drive from recordings of its motion by output error.

    The drive is simulated under the recorded command; its free numbers, the free numbers of the sensors and the start
    of each recording are found such that position, pressures and whatever else was measured come out as recorded
    (weighted least squares). Derivatives are exact, from dual numbers through the integrator. The recordings are cut
    into segments whose starts are free and become continuous as the search converges (multiple shooting).

    Parameters
    ----------
    drive : Drive
        Start values of what is free; everything else is taken as known.
    recordings
        One or several of: a file as ``pneudrive simulate --out`` writes (.csv, .parquet, .nc) or any that a layout
        reads, what ``pn.simulate`` returns, a mapping of SI columns (``time_s``, ``command``, ``position_m``,
        ``pressure_a_pa``, ``pressure_b_pa``).
    free : sequence of str
        Names as in the drive file: ``friction.coulomb``, ``valve.conductance``, ``cylinder.dead_volume.a``, ...
    sensors : mapping, optional
        Channel -> `Sensor` or its keywords: what is known of noise, offset, gain, lag and resolution. With
        ``{"command": {"delay": "free"}}``, or a time, the valve follows the recorded command late.
    channels : sequence of str, optional
        What is compared with the model; position and pressures where nothing is said.
    segment : str, float or None
        Length of the segments, s; None is single shooting: one segment for each recording.
    robust : bool
        Huber's loss: outlying samples count less.
    layout : path, optional
        How foreign files are read.
    rtol : float
        Relative tolerance of the solver.
    threads : int
    progress : callable, optional
        Is told each step (`Progress`).

    Returns
    -------
    DriveFit
        Values, intervals, covariance, what is not determined. Ctrl-C ends the search with the best point so far.

    Raises
    ------
    FitError, RecordingError, LayoutError
        With what, value, rule and remedy.

    Examples
    --------
    >>> import pneudrive as pn
    >>> truth = pn.Drive.load("catalogue:reference")
    >>> run = pn.simulate(truth, "0 s: 0.2, 0.2 s: -0.2", "0.4 s")
    >>> fit = pn.identify(truth.replace({"friction.coulomb": "25 N"}), run, free=["friction.coulomb"])
    >>> round(fit.values["friction.coulomb"], 2)
    30.0
    """
    records = read_drive_recordings(recordings, layout, needed=("time_s", "command"), gaps=True)
    present = [channels_in(record, channels) for record in records]
    options = _options(segment, robust, rtol, threads)
    for record in records:
        check_plausible(record, drive)
    options.notes += time_gaps(records)
    names = [c for c in CHANNELS if any(c in p for p in present)]
    described = {c.name: c for c in channels_of(names, sensors)}
    options.delay = command_delay(sensors)
    parameters = _resolvable(drive, chosen(drive, free), records, described, options)
    watcher = Watcher(progress)
    problem, point = _problem(drive, parameters, records, present, described, options)
    stated = [np.array([np.isfinite(described[c].noise or np.nan) for c in p]) for p in present]
    solved, converged = _solve(problem, point, stated, options, watcher)
    if not (converged or options.interrupted) and options.segment_s is not None:
        options.lengths_s, options.last_attempt = SECOND_LADDER_S, True
        reached = solved.problem.values(solved.point.eta)[: len(parameters)]
        problem, point = _problem(drive, parameters, records, present, described, options, reached)
        again, converged = _solve(problem, point, stated, options, watcher)
        solved = again
    return _result(drive, parameters, records, solved, options, watcher, converged)


def _options(segment: str | float | None, robust: bool, rtol: float, threads: int) -> Options:
    from pneudrive.units import parse

    seconds = parse(segment, "s") if isinstance(segment, str) else segment
    if seconds is not None and not (np.isfinite(seconds) and seconds > 0.0):
        raise FitError(f"segment = {segment} is out of bounds", rule="a positive time, or None for single shooting")
    if not 1e-12 <= rtol <= 1e-2:
        raise FitError(f"rtol = {rtol} is out of bounds", rule="1e-12 <= rtol <= 0.01")
    return Options(seconds, robust, rtol, max(1, int(threads)))


def _resolvable(
    drive: Drive,
    parameters: list[Parameter],
    records: list[DriveRecording],
    described: dict[str, Channel],
    options: Options,
) -> list[Parameter]:
    """Hold the bristle damping where the encoder does not resolve the bristles."""
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
        raise FitError("nothing is left free", value=str(lost))
    return rest


def _problem(
    drive: Drive,
    parameters: list[Parameter],
    records: list[DriveRecording],
    present: list[list[str]],
    described: dict[str, Channel],
    options: Options,
    values: Array | None = None,
) -> tuple[Problem, Point]:
    """Cut the recordings, find where the segments begin, and put the problem together; `values` are the start's."""
    coordinates, candidates = Coordinates(parameters, drive), Candidates(drive, parameters)
    values = np.array([p.value for p in parameters]) if values is None else values
    experiments = []
    for record, names in zip(records, present, strict=True):
        own = [described[name] for name in names]
        starts = segment_starts(record.time_s, options.first_segment_s(record))
        outputs = [c.column for c in own]
        shooter = Shooter(record, outputs, starts, candidates, options.rtol, options.threads, options.delay.value_s)
        noise = np.array([_noise(c, record, options.rtol) for c in own])
        inner = shooter.inner_states(drive)
        state, spread = measured_starts(record, own, noise, starts, drive, len(inner))
        experiments.append(Experiment(shooter, own, observed(shooter, values, state, spread, inner), noise))
    free_sensors = sensor_parameters(
        list(described.values()), [r.name for r in records], [set(p) for p in present], delay=options.delay.free
    )
    problem = Problem(coordinates, free_sensors, experiments)
    if options.robust:
        problem.huber_k = HUBER_K
    sensor_start = [
        {"offset": 0.0, "delay": 0.0, "gain": 1.0}[s.kind] if s.kind != "lag" else np.log(described[s.channel].lag)
        for s in free_sensors
    ]
    eta = np.r_[coordinates.internal(values), sensor_start]
    return problem, Point(eta, [e.starts.state.copy() for e in experiments])


def _least_noise(channel: Channel, rtol: float) -> float:
    """Below this no channel is trusted: rounding of the sensor, error of the solver."""
    return float(np.hypot(channel.resolution / np.sqrt(12.0), rtol * _SCALE.get(channel.unit, 1.0)))


def _noise(channel: Channel, record: DriveRecording, rtol: float) -> float:
    white = white_noise(record[channel.column]) if channel.noise is None else channel.noise
    return float(np.hypot(white, _least_noise(channel, rtol)))


def _solve(
    problem: Problem, point: Point, stated: list[NDArray[np.bool_]], options: Options, watcher: Watcher
) -> tuple[Solved, bool]:
    """Search, and take the noise of the sensors from the residuals until it stays.

    Where the search sticks, the misfit is not taken for noise before the last attempt.
    """
    converged = False
    watcher.point, at = point, None
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
    except KeyboardInterrupt:
        options.interrupted = True
        problem.held[:] = False
        options.notes.append("the search was interrupted: these are the best values so far")
        point, at, converged = watcher.point, None, False
    if at is None:
        shots = problem.run(point)
        if isinstance(shots, str):
            raise FitError("the search ended where the drive cannot be simulated", value=shots)
        at = linearise(problem, point, believed, shots)
    found = information(problem, at)
    measured = int(sum(e.weight.sum() for e in problem.experiments))
    freedom = measured - problem.size - sum(s.shape[1] for s in point.states)
    return Solved(problem, point, believed, at, found, max(freedom, 1)), converged


def _regrouped(problem: Problem, point: Point, length_s: float) -> Point:
    """Join the short segments of the first phase to longer ones; their starts stay."""
    states = []
    for experiment, state in zip(problem.experiments, point.states, strict=True):
        old = experiment.shooter.starts
        wanted = segment_starts(experiment.shooter.recording.time_s, length_s)
        kept = np.unique(np.abs(old[:, None] - wanted).argmin(axis=0))
        experiment.shooter = experiment.shooter.with_starts(old[kept])
        states.append(state[kept])
    return Point(point.eta, states)


def _renew_noise(problem: Problem, at: Joined, stated: list[NDArray[np.bool_]], rtol: float) -> bool:
    """Take the noise from the residuals where none is stated; whether it has changed."""
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


def _result(
    drive: Drive,
    parameters: list[Parameter],
    records: list[DriveRecording],
    solved: Solved,
    options: Options,
    watcher: Watcher,
    converged: bool,
) -> DriveFit:
    problem, point, found = solved.problem, solved.point, solved.information
    values = problem.values(point.eta)
    names = problem.names
    by_coordinate = problem.natural_jacobian(point.eta)
    covariance = by_coordinate @ found.covariance(problem) @ by_coordinate.T
    reach = student(solved.freedom)
    intervals = intervals_of(parameters, problem, values, reach * np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    fit = DriveFit(
        values=dict(zip(names[: problem.drive_size], values.tolist(), strict=False)),
        units={**{p.name: p.unit for p in parameters}, **{s.name: s.unit for s in problem.sensors}},
        sensors=dict(zip(names[problem.drive_size :], values[problem.drive_size :].tolist(), strict=True)),
        free=tuple(names),
        covariance=covariance,
        intervals=intervals,
        sources={n: tuple(r.name for r in records) for n in names[: problem.drive_size]},
        undetermined=(),
        notes=tuple(_notes(options, problem, solved, converged, records)),
        statistics=_statistics(problem, solved, watcher),
        converged=converged,
        provenance=_provenance(drive, records, options, parameters),
        start=drive,
        series=_series(problem, solved, records),
        solved=solved,
    )
    fit.units.update({c.name: c.unit for e in problem.experiments for c in e.channels})
    sizes = np.array([max(abs(v), s) for v, s in zip(values, _sizes(parameters, problem), strict=True)])
    lost = statements(names, values, sizes, intervals, fit.correlation, found.weak)
    fit.provenance["fit_hash"] = fit_hash(fit.provenance, fit.values)
    return replace(fit, undetermined=(*options.lost, *lost))


def _sizes(parameters: list[Parameter], problem: Problem) -> list[float]:
    return [p.size if np.isinf(p.lower) else 0.0 for p in parameters] + [s.size for s in problem.sensors]


def _notes(
    options: Options, problem: Problem, solved: Solved, converged: bool, records: list[DriveRecording]
) -> list[str]:
    notes = list(options.notes)
    if not converged and not any("interrupted" in n for n in notes):
        notes.append("the search has not converged: look at the residuals, or try shorter segments")
    coloured = [
        f"{problem.experiments[i].channels[c].name} of {records[i].name} ({tau:.0f} samples)"
        for (i, c), (variance, tau) in solved.information.inflation.items()
        if tau > CORRELATED and variance > SOLVER_SHARE
    ]
    if coloured:
        notes.append(f"residuals are correlated over time: {', '.join(coloured)}; intervals are widened for it")
    missed = _missed(problem, solved)
    if missed:
        fits = {k: v for k, v in _statistics(problem, solved, Watcher()).items() if k.startswith("fit_percent.")}
        worst = min(fits, key=lambda k: fits[k])
        if fits[worst] < SENSELESS_PERCENT:
            notes.append(
                f"the model does not follow what was recorded ({worst.removeprefix('fit_percent.')}: fit "
                f"{fits[worst]:.0f} %). Look whether a sign is reversed or chambers are swapped: a command above "
                "0 fills chamber a, which moves the piston towards greater positions"
            )
        notes.append(
            f"the model does not fit: {', '.join(missed)}. Values and intervals make up for what it lacks, so the "
            "truth may lie outside them: put the fit into the drive and ask `pneudrive validate` what is missing"
        )
    if any(r.synthetic for r in records):
        notes.append("from simulated recordings")
    return notes


def _missed(problem: Problem, solved: Solved) -> list[str]:
    """Say where residuals are larger than the noise from sample to sample."""
    worst: dict[str, float] = {}
    for experiment, residual in zip(problem.experiments, solved.at.residuals, strict=True):
        for c, channel in enumerate(experiment.channels):
            used = experiment.weight[:, c] > 0.0
            own = experiment.noise[c] * float(np.sqrt(np.mean(residual[used, c] ** 2)))
            white = max(white_noise(experiment.measured[:, c]), _least_noise(channel, RTOL))
            worst[channel.name] = max(worst.get(channel.name, 0.0), own / white)
    return [f"{name} is off by {ratio:.2g} times its noise" for name, ratio in worst.items() if ratio > MISFIT]


def _statistics(problem: Problem, solved: Solved, watcher: Watcher) -> dict[str, float]:
    out = {
        "samples": float(sum(len(e.measured) for e in problem.experiments)),
        "iterations": float(watcher.count),
        "cost": solved.at.cost,
        "gap": solved.at.standing.gap,
    }
    for name, rms in problem.rms(solved.at.residuals).items():
        out[f"rms.{name}"] = rms
        own = [(e, i) for e in problem.experiments for i, c in enumerate(e.channels) if c.name == name]
        out[f"noise.{name}"] = float(np.sqrt(np.mean([e.noise[i] ** 2 for e, i in own])))
        power = np.mean([np.nanvar(e.measured[:, i]) for e, i in own])
        out[f"fit_percent.{name}"] = float(100.0 * (1.0 - rms / np.sqrt(power))) if power > 0.0 else np.nan
    return out


def _series(problem: Problem, solved: Solved, records: list[DriveRecording]) -> dict[str, dict[str, Series]]:
    out: dict[str, dict[str, Series]] = {}
    for experiment, residual, record in zip(problem.experiments, solved.at.residuals, records, strict=True):
        out[record.name] = {
            channel.name: Series(
                record.time_s,
                experiment.measured[:, c],
                experiment.measured[:, c] - residual[:, c] * experiment.noise[c],
            )
            for c, channel in enumerate(experiment.channels)
        }
    return out


def _provenance(
    drive: Drive, records: list[DriveRecording], options: Options, parameters: list[Parameter]
) -> dict[str, Any]:
    return {
        "version": __version__,
        "method": "output error",
        "drive": drive.name,
        "description_hash": drive.description_hash,
        "recordings": [
            {"name": r.name, "sha256": r.sha256, "file": str(r.source or ""), "seconds": r.duration_s} for r in records
        ],
        "start": {p.name: p.value for p in parameters},
        "segment_s": options.segment_s if options.segment_s is not None else "one",
        "robust": options.robust,
        "rtol": options.rtol,
    }


def profile_of(solved: Solved, names: list[str]) -> dict[str, tuple[float, float]]:
    """Intervals by profile likelihood, SI; see `DriveFit.profile`."""
    out = {}
    problem = solved.problem
    for name in names:
        index = problem.names.index(name)
        ends = profile(
            problem, solved.point, solved.believed, solved.at, solved.information, index, student(solved.freedom)
        )
        both = []
        for end in ends:
            if not np.isfinite(end):
                signed = index < problem.drive_size and np.isinf(problem.coordinates.parameters[index].lower)
                both.append(end if signed or end > 0.0 else 0.0)
                continue
            eta = solved.point.eta.copy()
            eta[index] = end
            both.append(float(problem.values(eta)[index]))
        out[name] = (min(both), max(both))
    return out


def bootstrap_of(solved: Solved, count: int, seed: int) -> Array:
    """Draws of all free values; see `DriveFit.bootstrap`."""
    return bootstrap(solved.problem, solved.point, solved.information, count, seed)
