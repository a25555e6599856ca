"""Identification of a drive by output error with exact sensitivities, and of bristles from presliding loops."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.describe import Circuit, Drive
from pneudrive.describe.system import PISTON
from pneudrive.errors import FitError
from pneudrive.estimate.estimates import Transforms, rms, student
from pneudrive.files.inputs import origin
from pneudrive.free.parameters import Parameter, chosen, family_of, numbers_of, with_shape
from pneudrive.identify.base import SIMULATED, Fit, Undetermined
from pneudrive.identify.dynamic import search
from pneudrive.identify.dynamic import sensors as sensing
from pneudrive.identify.dynamic.problem import FitProblem, FittedRecording, Iterate, segment_starts, start_states
from pneudrive.identify.dynamic.result import LARGEST_REACH, DriveFit, assembled, unresolved_damping
from pneudrive.identify.follow.driven import check_follow
from pneudrive.identify.follow.fit import FollowFit, identify_motion
from pneudrive.identify.identified import FittedData, apply_identified
from pneudrive.progress import UNWATCHED, Flag, Progress, Watch
from pneudrive.signals.drive_recording import check_plausible, read_drive_recordings, refuse_standstill, time_gaps
from pneudrive.signals.motion import turning_points
from pneudrive.simulation.bench_circuit import Dragged

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from pneudrive.arrays import Array, Keyed, NamedIntervals, NamedNumbers, Pair
    from pneudrive.signals.drive_recording import DriveRecording, VolumeRecording
    from pneudrive.signals.recording import Recording


# --- Identification of a drive from recordings by output error with exact sensitivities.

#: Start value of the excess Fs - Fc for a drive without excess, as a fraction of Fc.
_LEAST_EXCESS = 0.02
FORCES = ("friction.coulomb", "friction.breakaway")


def transforms_of(
    parameters: Sequence[Parameter], sensors: Sequence[sensing.SensorParameter], drive: Drive | Circuit
) -> Transforms:
    """Return the coordinates of the free values: those of the drive or circuit, then those of the sensors.

    The breakaway force is the Coulomb force plus a positive excess. If one force is held, the held force limits the
    other force.
    """
    every, numbers = [*parameters, *sensors], numbers_of(drive)
    places = {p.name: k for k, p in enumerate(parameters)}
    upper = np.array([p.upper for p in every])
    of = next((name.rpartition(".")[0] for name in places if name.endswith(FORCES)), "friction")
    coulomb, breakaway = (f"{of}.{key}" for key in ("coulomb", "breakaway"))
    if coulomb in places and breakaway not in places and breakaway in numbers:
        upper[places[coulomb]] = numbers[breakaway].value
    for name, k in places.items():
        part, _, key = name.rpartition(".")
        if key == "critical_pressure_ratio":
            upper[k] = numbers[f"{part}.linear_above"].value
    held = numbers[coulomb].value if coulomb in numbers else 0.0
    return Transforms(
        [p.lower for p in every],
        upper,
        [p.size if np.isinf(p.lower) else 1.0 for p in every],
        excess=places.get(breakaway) if coulomb in numbers else None,
        over=places.get(coulomb, held),
        least_excess=_LEAST_EXCESS,
    )


RTOL = 1e-6
#: Typical size of an output by unit, to estimate the solver's error.
_SCALE = {"m": 0.1, "Pa": 1e5, "m/s": 0.1, "K": 300.0, "N": 10.0}
#: Rounds of estimating the noise of the sensors from the residuals.
NOISE_ROUNDS = 4
#: Relative change of the noise below which it counts as converged.
NOISE_CHANGE = 0.02
#: Multiple of the sample-to-sample noise above which residuals count as a misfit (assumed).
MISFIT = 2.0
#: Factors on the segment length for repeated searches.
SHORTER_SEGMENTS = (0.5, 0.25)
#: Factor on the solver's tolerance in the last attempt, because solver errors may stop the search.
LAST_RTOL = 1e-2
#: Smallest accepted improvement of the mean log residual by a repeated search.
GAIN = 0.02
#: Length of the segments, s, and number of threads that run the segments.
SEGMENT_S, THREADS = 0.4, 2


@overload
def identify(
    drive: Drive | Circuit,
    recordings: Any,  # noqa: ANN401 - one or several recordings of several types
    free: Sequence[str],
    *,
    follow: None = None,
    sensors: Mapping[str, sensing.Sensor | Keyed] | None = None,
    channels: Sequence[str] | None = None,
    layout: str | Path | None = None,
    progress: Progress | None = None,
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
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> FollowFit: ...
def identify(
    drive: Any,
    recordings: Any,
    free: Sequence[str] = ("volumes", "heat"),
    *,
    follow: str | None = None,
    sensors: Mapping[str, sensing.Sensor | Keyed] | None = None,
    channels: Sequence[str] | None = None,
    layout: str | Path | None = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> DriveFit | FollowFit:
    """Identify parameters of a drive or a circuit from recordings of its motion by output error.

    The drive is simulated under the recorded command. Free parameters of the drive and the sensors, and the start of
    each recording, are fitted to position, pressures and other measured channels by weighted least squares. Derivatives
    are exact, from dual numbers through the integrator. The recordings are cut into segments with free starts, which
    become continuous as the search converges (multiple shooting).

    Parameters
    ----------
    drive : Drive or Circuit
        Description with start values of free parameters; all other values are known. A circuit has one cylinder and one
        component with a command. Its search ends with one segment for each recording, because a valve has inner states.
    recordings
        One or several recordings. Each is a file of ``pneudrive simulate --out`` (.csv, .parquet, .nc), a foreign file
        with a layout, a result of ``pn.simulate``, or a mapping of SI columns (``time_s``, ``command``, ``position_m``,
        ``pressure_a_pa``, ``pressure_b_pa``).
    free : sequence of str
        Names in the drive file: ``friction.coulomb``, ``valve.conductance``, ``cylinder.dead_volume.a``, ... Those of a
        circuit begin with the component: ``valve.frequency``, ``valve.delay``, ``cylinder.friction.coulomb``, ...
    follow : {"motion"}, optional
        With ``"motion"``, the piston of a circuit follows the recorded position, see `pneudrive.identify_motion`. All
        other arguments except `layout`, `progress` and `cancel` are ignored.
    sensors : mapping, optional
        Channel -> `Sensor` or its keywords: known noise, offset, gain, lag and resolution.
        ``{"command": {"delay": "free"}}`` (or a time) delays the recorded command.
    channels : sequence of str, optional
        Channels to compare with the model; default: position and pressures.
    layout : path, optional
        Layout of foreign files.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.

    Returns
    -------
    DriveFit or FollowFit
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
    axis = drive.axis_names if isinstance(drive, Circuit) else None
    columns = {} if axis is None else {full: short for short, full in axis[1]}
    records = read_drive_recordings(recordings, layout, ("time_s", "command"), gaps=True, names=columns)
    present = [sensing.channels_in(record, channels) for record in records]
    options = search.SearchOptions(Watch(progress, cancel), SEGMENT_S, RTOL, axis=axis)
    numbers = numbers_of(drive)
    piston = PISTON if axis is None else axis[0]
    stroke_m = numbers[f"{piston}.stroke"].value
    highest_pa = max(p.value for name, p in numbers.items() if name.endswith(".pressure"))
    for record in records:
        check_plausible(record, stroke_m, drive.ambient.pressure_pa, highest_pa)
    refuse_standstill(records, free)
    options.notes += time_gaps(records)
    names = [c for c in sensing.CHANNELS if any(c in p for p in present)]
    if not isinstance(drive, Circuit):
        drive = with_shape(drive, free)
    described = sensing.channels_of(names, sensors)
    options.delay_s = sensing.command_delay(sensors)
    parameters = _resolvable(drive, chosen(drive, free), records, described, options)

    def attempt(values: Array | None) -> search.Solved:
        """Search from start values, with recordings cut into segments as set in `options`."""
        family = family_of(drive, parameters, options.axis)
        start = np.array([p.value for p in parameters]) if values is None else values[: len(parameters)]
        experiments, states = [], []
        for record, channels in zip(records, present, strict=True):
            own = [described[name] for name in channels]
            least_s = search.LEAST_SEGMENT_SAMPLES * (record.duration_s / (len(record) - 1))
            starts = segment_starts(record.time_s, min(options.segment_s, max(options.lengths_s[0], least_s)))
            noise = np.array([noise_of(c, record, options.rtol) for c in own])
            how = options.rtol, THREADS, options.delay_s or 0.0, options.watch
            experiments.append(FittedRecording(record, own, starts, family, noise, *how))
            states.append(start_states(experiments[-1], drive, start))
        recorded = [(one.recording.name, one.channels) for one in experiments]
        free_sensors = sensing.sensor_parameters(described.values(), recorded, delay=options.delay_s is None)
        transforms = transforms_of(parameters, free_sensors, drive)
        problem = FitProblem(parameters, free_sensors, transforms, experiments)
        first = transforms.internal(np.r_[start, [sensing.START[s.kind] for s in free_sensors]])
        return solve(problem, Iterate(first, states), options)

    best = _best_of_attempts(attempt, options)
    for experiment in best.problem.experiments:
        experiment.watch = UNWATCHED  # later calls on the fit have their own watch
    return assembled(drive, best, options)


def _best_of_attempts(attempt: Callable[[Array | None], search.Solved], options: search.SearchOptions) -> search.Solved:
    """Search; if the result does not fit the motion, repeat with shorter segments as long as that helps.

    Errors of short segments are small even for wrong values. A search with short segments therefore avoids local
    minima, and gives a better start for long segments. An incomplete model deviates with segments of any length; the
    first result is then kept.
    """
    tried = [attempt(None)]
    for share in SHORTER_SEGMENTS:
        if options.interrupted or tried[-1].good:
            break
        options.segment_s = share * SEGMENT_S
        try:
            tried.append(attempt(None))
        except FitError:  # the first search has a result
            break
        if tried[0].converged and tried[-1].score > tried[0].score - GAIN:
            break
    options.segment_s = SEGMENT_S
    for lengths_s in (search.LADDER_S, search.SECOND_LADDER_S):
        best = min(tried, key=search.Solved.rank)
        nearest = min(tried, key=lambda one: one.score)
        helped = not best.converged or nearest.score < best.score - GAIN
        if options.interrupted or best.good or not helped:
            break
        options.lengths_s = lengths_s
        if options.is_last:
            options.rtol *= LAST_RTOL
        try:
            tried.append(attempt(nearest.values))
        except FitError:
            break
    return min(tried, key=search.Solved.rank)


def _resolvable(
    drive: Drive | Circuit,
    parameters: list[Parameter],
    records: list[DriveRecording],
    described: dict[str, sensing.Channel],
    options: search.SearchOptions,
) -> list[Parameter]:
    """Hold the bristle damping if the encoder does not resolve the deflection of the bristles."""
    damping = [p for p in parameters if p.name.endswith("friction.bristle_damping")]
    if not damping or "position" not in described:
        return parameters
    of = damping[0].name.rpartition(".")[0]
    numbers = numbers_of(drive)
    force = numbers.get(f"{of}.breakaway", numbers[f"{of}.coulomb"]).value
    position = described["position"]
    noise = [sensing.white_noise(r["position_m"]) for r in records if "position_m" in r]
    step = max(position.resolution, np.median(noise) if noise else 0.0)
    lost = unresolved_damping(step, force, numbers[f"{of}.bristle_stiffness"].value)
    if lost is None:
        return parameters
    options.lost.append(replace(lost, parameter=damping[0].name))
    options.notes.append(f"{damping[0].name} is held at {damping[0].value:g} N s/m")
    rest = [p for p in parameters if p is not damping[0]]
    if not rest:
        raise FitError("no parameter is left free", value=str(lost))
    return rest


def _least_noise(channel: sensing.Channel, rtol: float) -> float:
    """Return the lower limit of a channel's noise, from the resolution of the sensor and the error of the solver."""
    return float(np.hypot(channel.resolution / np.sqrt(12.0), rtol * _SCALE.get(channel.unit, 1.0)))


def noise_of(channel: sensing.Channel, record: DriveRecording | VolumeRecording, rtol: float) -> float:
    """Return the standard deviation of a channel's noise at the start: stated, or from sample-to-sample differences."""
    white = sensing.white_noise(record[channel.column]) if channel.noise is None else channel.noise
    return float(np.hypot(white, _least_noise(channel, rtol)))


def solve(
    problem: FitProblem,
    point: Iterate,
    options: search.SearchOptions,
) -> search.Solved:
    """Search, and estimate the noise of the sensors from the residuals, until the noise converges.

    The residuals of a search that stops early are used as noise only in the last attempt.
    """
    converged = False
    options.point, at = point, None
    family = problem.experiments[0].family
    believed = [s.copy() for s in point.states]
    try:
        if options.segment_s:
            for length_s in (*options.lengths_s[1:], options.segment_s):
                point = _regrouped(problem, search.predict_segments(problem, point, options), length_s)
                options.point = point
        problem.believed = believed
        stages = (False,) if options.axis is None else (False, True)
        for is_whole in stages:
            if is_whole:
                point = _regrouped(problem, point, None)
                for experiment in problem.experiments:  # the solver's error adds up over a long segment
                    experiment.rtol = max(LAST_RTOL * options.rtol, 1e-12)
            for _ in range(NOISE_ROUNDS):
                at, converged = search.join_segments(problem, point, options)
                point = at.point
                if not (converged or options.is_last) or not _renew_noise(problem, at, options.rtol):
                    break
        if converged and family.settle(problem.values(point.eta)[: problem.drive_size]):
            at, converged = search.join_segments(problem, point, options)
    except KeyboardInterrupt:
        options.interrupted = True
        problem.held[:], problem.is_separate, problem.believed = False, False, believed
        options.notes.append("the search was interrupted: these are the best values so far")
        point, at, converged = options.point, None, False
    if at is None:
        at = search.linearise(problem, point, problem.run(point, "end"))
    over: NamedNumbers = {}  # residuals of each channel in the worst recording, relative to sample-to-sample noise
    for i, c, residual in problem.valid(at.residuals):
        experiment = problem.experiments[i]
        channel, own = experiment.channels[c], experiment.noise[c] * rms(residual)
        white = max(sensing.white_noise(experiment.measured[:, c]), _least_noise(channel, RTOL))
        over[channel.name] = max(over.get(channel.name, 0.0), own / white)
    missed = {name: ratio for name, ratio in over.items() if ratio > MISFIT and not options.interrupted}
    score = float(np.mean(np.log([max(ratio, 1e-9) for ratio in over.values()])))
    found = search.solution(problem, at)
    return replace(found, converged=converged, missed=missed, score=score, segment_s=options.segment_s)


def _regrouped(problem: FitProblem, point: Iterate, length_s: float | None) -> Iterate:
    """Join the short segments of the first phase. A joined segment keeps the start of its first short segment."""
    states = []
    for experiment, state in zip(problem.experiments, point.states, strict=True):
        old = experiment.starts
        wanted = segment_starts(experiment.recording.time_s, length_s)
        kept = np.unique(np.abs(old[:, None] - wanted).argmin(axis=0))
        experiment.starts = old[kept]
        states.append(state[kept])
    return Iterate(point.eta, states)


def _renew_noise(problem: FitProblem, at: search.Misfit, rtol: float) -> bool:
    """Estimate the unstated noise from the residuals; return whether it changed."""
    changed = False
    for i, c, residual in problem.valid(at.residuals):
        channel, noise = problem.experiments[i].channels[c], problem.experiments[i].noise
        new = max(rms(residual) * noise[c], _least_noise(channel, rtol))
        if not channel.noise and abs(new / noise[c] - 1.0) > NOISE_CHANGE:
            noise[c], changed = new, True
    return changed


# --- Bristle stiffness and damping from presliding: force over displacement right after slow reversals.
#
# After a reversal the contact is elastic before it slips: friction grows from -F to +F over a few bristle
# deflections. The slope there is the bristle stiffness times a factor of the law. The factor is 2 for LuGre,
# whose bristles have slipped before, and 1 for bristles that are elastic below breakaway. The factor is computed
# from a simulated loop with known stiffness.

STIFFNESS, DAMPING = "friction.bristle_stiffness", "friction.bristle_damping"
#: Fraction of the friction swing over which the slope is evaluated.
SWING_SHARE = 0.35
#: Smallest number of samples of a reversal within the fraction `SWING_SHARE` of the swing.
LEAST_SAMPLES = 6
#: Smallest friction swing of a reversal, as a fraction of the largest swing.
WHOLE_SWING = 0.6
#: Number of steps in the search for the stiffness whose simulated loop has the measured slope.
ROUNDS = 3


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Presliding(Fit, kind="presliding"):
    """Bristle parameters from reversals, in SI.

    Attributes
    ----------
    values, intervals : dict
        ``friction.bristle_stiffness`` (sigma0) and ``friction.bristle_damping`` (sigma1); intervals are 95 %, from the
        scatter between reversals.
    statistics : dict
        ``reversals``: number of reversals. ``breakaway_n``: breakaway force, half the change of friction between both
        directions. ``slope_factor``: measured slope divided by the stiffness.
    """

    def apply(self, drive: Drive) -> Drive:
        """Return a drive with the determined values, each with its interval and its recordings.

        Raises
        ------
        FitError
            The drive's law has no bristles.
        """
        return apply_identified(self.identified_as({name: name for name in self.determined}), drive)


def identify_presliding(
    drive: Drive,
    loops: Recording | Keyed | Sequence[Recording | Keyed],
) -> Presliding:
    """Identify the bristle stiffness from force-displacement loops, and the damping if the encoder resolves it.

    Parameters
    ----------
    drive : Drive
        Drive with the friction law and its other parameters.
    loops
        Recordings of a rig with slow reversals, or mappings with ``time_s``, ``position_m`` and ``friction_n`` (the
        force that opposes motion in +x), shape (n,).

    Returns
    -------
    Presliding

    Raises
    ------
    FitError
        The law has no bristles, or no reversal can be evaluated.
    """
    if "bristle_stiffness" not in drive.friction.parameters:
        raise FitError(f"law {drive.friction.law} has no bristle stiffness", remedy="Choose lugre or elasto-plastic.")
    every = loops if isinstance(loops, (list, tuple)) else [loops]
    columns = [_columns(loop) for loop in every]
    step = max(sensing.white_noise(position) for _, position, _ in columns)
    found = [reversal for loop in columns for reversal in _reversals(*loop, step)]
    most = max((_swing(reversal) for reversal in found), default=0.0)
    found = [reversal for reversal in found if _swing(reversal) >= WHOLE_SWING * most]
    slopes = [slope for reversal in found if (slope := _slope(reversal, step)) is not None]
    if not slopes:
        limits = {"samples": LEAST_SAMPLES, "share": 100 * SWING_SHARE}
        raise FitError.of("identify.no_bristles", count=len(found), step=1e6 * step, **limits)
    stiffness, damping = np.array(slopes).T
    level = 0.5 * float(np.median([_swing(reversal) for reversal in found]))
    top = float(np.median([speed.max() for _, _, speed in found]))
    factor = _factor(drive, float(stiffness.mean()), level, top)
    each, count = {STIFFNESS: stiffness / factor, DAMPING: damping / factor}, len(slopes)
    values = {name: float(own.mean()) for name, own in each.items()}
    ends = {}  # 95 % interval of the mean over reversals; infinite for a single reversal
    for name, own in each.items():
        reach = float(student(count - 1) * own.std(ddof=1) / np.sqrt(count)) if count > 1 else np.inf
        ends[name] = values[name] - reach, values[name] + reach
    return Presliding(
        values=values,
        units={STIFFNESS: "N/m", DAMPING: "N s/m"},
        free=tuple(each),
        covariance=np.cov([*each.values()]) / count if count > 1 else np.zeros((2, 2)),
        intervals=ends,
        undetermined=_lost(step, level, values, ends),
        notes=(SIMULATED,) if any(getattr(loop, "synthetic", False) for loop in every) else (),
        statistics={"reversals": float(count), "breakaway_n": level, "slope_factor": factor},
        provenance=origin(
            drive,
            drive=drive.name,
            description_hash=drive.description_hash,
            recordings=[str(getattr(loop, "name", f"loop {i}")) for i, loop in enumerate(every, 1)],
        ),
        profiler=ends.__getitem__,
        fitted={
            name: FittedData("reversal", column, np.arange(1.0, count + 1.0), own, 0.0 * own + own.mean())
            for (name, own), column in zip(each.items(), ("stiffness_n_m", "damping_n_s_m"), strict=True)
        },
    )


def _lost(step: float, level: float, values: NamedNumbers, ends: NamedIntervals) -> tuple[Undetermined, ...]:
    unresolved = unresolved_damping(step, level, values[STIFFNESS])
    remedies = {STIFFNESS: "reverse more slowly and more often, with a finer encoder"}
    remedies |= {} if unresolved else {DAMPING: "reverse at several speeds, some of them ten times faster"}
    out = []
    for name, remedy in remedies.items():
        low, high = ends[name]
        if not (values[name] > 0.0 and 0.5 * (high - low) <= LARGEST_REACH * values[name]):
            reason = f"its 95 % interval over the reversals reaches from {low:.3g} to {high:.3g}"
            out.append(Undetermined(name, reason, remedy))
    return (*out, unresolved) if unresolved else tuple(out)


def _columns(loop: Any) -> tuple[Array, Array, Array]:  # noqa: ANN401 - a recording or a mapping, distinguished here
    """Return time, position and friction."""
    if hasattr(loop, "balance_n"):
        return loop.time_s, loop.position_m, loop.balance_n()
    names = ("time_s", "position_m", "friction_n")
    missing = [c for c in names if c not in loop]
    if missing:
        raise FitError(f"a loop has no {', '.join(missing)}", rule="time_s, position_m, friction_n of equal length")
    time, position, friction = (np.asarray(loop[c], dtype=float) for c in names)
    return time, position, friction


def _reversals(time: Array, position: Array, friction: Array, step: float) -> list[Array]:
    """Return arrays (3, n) of displacement, friction increase and speed after each reversal, in the new direction."""
    out = []
    for begin, end in pairwise(turning_points(position, max(5.0 * step, 1e-9)).tolist()):
        part, sign = slice(begin, end + 1), np.sign(position[end] - position[begin])
        if end - begin >= LEAST_SAMPLES:
            x, f = position[part] - position[begin], friction[part] - friction[begin]
            out.append(sign * np.stack([x, f, np.gradient(position[part], time[part])]))
    return [reversal for reversal in out if _swing(reversal) > 0.0]


def _swing(reversal: Array) -> float:
    """Return the change of friction after a reversal: the median over the last quarter of its samples."""
    return float(np.median(reversal[1, reversal.shape[1] * 3 // 4 :]))


def _slope(reversal: Array, step: float) -> Pair | None:
    """Return the slopes of friction over displacement (at the reversal) and over speed, by least squares.

    The fit is x = b (F - s v) + c F^2, because a displacement x of a few encoder steps is less accurate than F.
    """
    begin = reversal[1] <= SWING_SHARE * _swing(reversal)
    stop = int(np.argmin(begin)) if not begin.all() else begin.size
    if stop < LEAST_SAMPLES or reversal[0, stop - 1] < 2.0 * step:
        return None
    x, f, v = reversal[:, :stop]
    force, speed = f.max(), max(np.abs(v).max(), 1e-12)
    sizes = np.array([force, force**2, speed, 1.0])
    design = np.stack([f, f**2, v, np.ones_like(f)], axis=1) / sizes
    b, _, d, _ = np.linalg.lstsq(design, x, rcond=1e-8)[0] / sizes
    return (1.0 / b, -d / b) if b > 0.0 else None


def _factor(drive: Drive, slope: float, level: float, speed: float) -> float:
    """Simulate a loop of the drive's law. Return the slope at a reversal divided by the bristle stiffness.

    The simulated loop is evaluated like a measured loop.
    """
    factor = 1.0
    for _ in range(ROUNDS):
        loops = _reversals(*_simulated_loop(drive, slope / factor, level, speed), 0.0)
        slopes = [found[0] for loop in loops[1:] if (found := _slope(loop, 0.0)) is not None]
        if not slopes:
            break
        factor = float(np.mean(slopes)) / (slope / factor)
    return factor


def _simulated_loop(
    drive: Drive,
    stiffness: float,
    level: float,
    speed: float,
) -> tuple[Array, Array, Array]:
    """Simulate the law in a reversing motion over many bristle deflections, on a stiff rig without air."""
    law = drive.friction.core()
    parameters = dict(law["parameters"])
    ratio = level / max(parameters.get("breakaway", parameters.get("coulomb", level)), 1e-12)
    for name in ("coulomb", "breakaway"):
        if name in parameters:
            parameters[name] *= ratio
    parameters["bristle_stiffness"] = stiffness
    travel = 12.0 * level / stiffness
    piston = {"area_a": 1e-9, "area_b": 1e-9, "stroke": 10.0 * travel, "moving_mass": 1e-2}
    friction = {**law, "parameters": parameters, "pressure": None}
    rig = Dragged(friction, piston, {"stiffness": 1e3 * stiffness, "damping": 1e2})
    for side in "ab":
        rig.hold(side, STANDARD_ATMOSPHERE_PA)
    cruise, turn = travel / speed, 0.02 * travel / speed
    jerk = 4.0 * speed / turn**2
    changes = (1.0, -2.0, 2.0, -2.0)
    durations = [0.5 * turn, 0.5 * turn, cruise] * len(changes)
    jerks = [change * jerk * sign for change in changes for sign in (1.0, -1.0, 0.0)]
    times = np.linspace(0.0, sum(durations), 20000, endpoint=False)
    columns = rig.run(durations, jerks, times, 5.0 * travel, 1e-8).columns
    return columns["time_s"], columns["position_m"], columns["friction_force_n"]
