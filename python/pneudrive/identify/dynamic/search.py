"""Search: multiple shooting by Gauss-Newton steps with Levenberg-Marquardt damping.

There are two phases. In the first phase, segments are short and start from smoothed measurements. Only unmeasured
states, the gas temperatures and the bristles, are carried over from the previous segment. Predictions over some
hundredths of a second remain near the measurements even with wrong parameters. In the second phase, the starts are
free, and the search closes the gaps to the ends of the previous segments (multiple shooting). The linearised continuity
conditions express all starts by the first start of the recording. A single segment is single shooting.

At the end, the linearisation gives the covariance, and repeated searches give profile intervals.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError
from pneudrive.estimate.estimates import profile_interval, student
from pneudrive.identify.dynamic.problem import FitProblem, Iterate, Shot
from pneudrive.progress import Watch

if TYPE_CHECKING:
    from pneudrive.arrays import Array, ArrayPair, Interval, NamedNumbers, Pair
    from pneudrive.describe.system import ShortNames
    from pneudrive.identify.base import Undetermined

#: Fraction of the largest singular value of the scaled Jacobian below which a direction is ignored.
SINGULAR_SHARE = 1e-4
#: Largest change of a coordinate in a step (1 is a factor of 2.7 for a logarithm), and factors on this limit after a
#: failed and after a successful step.
LONGEST, SHORTER, LONGER = 1.0, 0.25, 4.0
#: Length of a step, in standard errors (metric of the information matrix), below which the search ends, ...
SHORT_STEP = 0.02
#: ... provided that gaps are below this multiple of the sizes of the states.
SMALL_GAP = 1e-3
#: Size of gaps below which the solver's error prevents further improvement by a short step.
SOLVER_GAP = 3e-3
#: Residuals below this fraction of the noise need no further search before the noise is estimated.
EXACT_SHARE = 0.1
#: Relative decrease of the cost below which the first phase ends.
SMALL_GAIN = 0.01
MOST_STEPS = 40
#: Fractions of a full step of coordinates and starts. They are tried if no shorter step of the coordinates alone lowers
#: the merit function.
SHARES = (0.5, 0.25, 0.1)
#: Smallest damping. A damping of 1 acts like a prior with standard deviation 1 about the present value of a coordinate.
DAMPING_LEAST = 1e-3
#: Largest number of steps that only update carried-over states before the first phase gives up.
MOST_CLOSINGS = 2
#: Relative rounding error of a floating-point number.
ROUNDING = float(np.finfo(np.float64).eps)
#: Shortest step of a search.
SHORTEST = 1e-6


def start_solution(information: Array, right: Array) -> Array:
    """Solve the normal equations of a recording's start, which are positive definite except for rounding errors.

    Directions below the rounding error of the scaled equations are left out.
    """
    n = information[-len(right) :, -len(right) :]
    scale = np.sqrt(np.diag(n))
    power, axes = np.linalg.eigh(n / np.outer(scale, scale))
    inverse = np.where(power > ROUNDING * len(n), 1.0 / np.maximum(power, ROUNDING), 0.0)
    scaled = (right.T / scale).T
    return ((axes @ ((axes.T @ scaled).T * inverse).T).T / scale).T


def bounded_step(information: Array, gradient: Array, longest: float) -> Array:
    """Return a step of at most `longest` in each coordinate, with as much damping as needed.

    The damping acts on the coordinates, mostly logarithms. Directions with little information then move little, without
    slowing down other directions.
    """
    power, axes = np.linalg.eigh(information)
    along = axes.T @ gradient
    damping = DAMPING_LEAST
    while True:
        step = axes @ (along / (np.maximum(power, 0.0) + damping))
        if np.abs(step).max(initial=0.0) <= longest:
            return step
        damping *= 2.0


@dataclass(frozen=True)
class Misfit:
    """Deviation of the model from the recordings at a point of the search, and its linearisation with joined segments.

    Attributes
    ----------
    point : Iterate
    cost : float
        Twice the negative log-likelihood, up to a constant.
    merit : float
        Merit function of a step: the cost, plus the gaps in the second phase.
    gap : float
        Largest gap, in units of the sizes of the states.
    residuals : list of ndarray, shape (n, c)
        Residuals in units of the noise, before the gaps are closed.
    blocks : list of (ndarray, ndarray), shapes (P + s, P + s) and (P + s,)
        Information and gradient of each recording, with respect to the global coordinates and its first start (in units
        of its prior). Without derivatives, `blocks`, `slopes` and `carried` are empty.
    slopes : list of ndarray, shape (n, c, P + s)
    carried : list of (ndarray, ndarray), shapes (k, s, P + s) and (k, s)
        Derivative of each start with respect to the unknowns, and the change of each start that closes the gaps.
    """

    point: Iterate
    cost: float
    merit: float
    gap: float
    residuals: list[Array]
    blocks: list[ArrayPair] = field(default_factory=list)
    slopes: list[Array] = field(default_factory=list)
    carried: list[ArrayPair] = field(default_factory=list)


def judge(problem: FitProblem, point: Iterate, shots: list[Shot]) -> Misfit:
    """Return the misfit of a point from the runs of each recording's segments."""
    residuals: list[Array] = []
    gap, cost = 0.0, float(problem.prior @ point.eta**2)
    penalty = 0.0
    for i, (experiment, shot) in enumerate(zip(problem.experiments, shots, strict=True)):
        r = problem.measure(i, point.eta, shot.outputs)[0]
        away = (problem.believed[i][0] - point.states[i][0]) / experiment.belief
        cost += float(np.sum(r**2)) + float(away @ away)
        scaled = _gaps(problem, point, shot, i) / experiment.size
        penalty += r.size / max(len(scaled), 1) * float(np.sum(scaled**2))
        gap = max(gap, float(np.abs(scaled).max(initial=0.0)))
        residuals.append(r)
    return Misfit(point, cost, cost if problem.is_separate else cost + penalty, gap, residuals)


def linearise(problem: FitProblem, point: Iterate, shots: list[Shot]) -> Misfit:
    """Return the misfit of a point with the normal equations of all recordings, from runs with derivatives.

    Raises
    ------
    FitError
        Derivatives overflow; the message names the recording and the values.
    """
    blocks, slopes, carried = [], [], []
    size = problem.size
    for i, (experiment, shot) in enumerate(zip(problem.experiments, shots, strict=True)):
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is named below
            by_unknown, closing = _condense(problem, point, shot, i)
            outputs = shot.outputs.copy()  # with gaps closed to first order, and their Jacobian
            jac = np.empty((*outputs.shape, by_unknown.shape[2]))
            for j, where in enumerate(experiment.segments):
                outputs[where] += shot.by_start[where] @ closing[j]
                jac[where] = shot.by_start[where] @ by_unknown[j]
            jac[:, :, :size] += problem.by_coordinates(i, shot.by_parameter, point.eta)
            closed, jac = problem.measure(i, point.eta, outputs, jac)
            flat, rest = jac.reshape(closed.size, -1), closed.ravel()
            information, gradient = flat.T @ flat, flat.T @ rest
        if not (np.isfinite(information).all() and np.isfinite(gradient).all()):
            lost = ~np.isfinite(np.diag(information))
            names = [name for name, is_lost in zip(problem.names, lost, strict=False) if is_lost]
            by = ", ".join(names) or "its start"
            raise FitError.of("identify.overflow", name=experiment.recording.name, by=by)
        information[size:, size:] += np.eye(len(information) - size)
        gradient[size:] += (problem.believed[i][0] - point.states[i][0]) / experiment.belief
        blocks.append((information, gradient))
        slopes.append(jac)
        carried.append((by_unknown, closing))
    return replace(judge(problem, point, shots), blocks=blocks, slopes=slopes, carried=carried)


def _gaps(problem: FitProblem, point: Iterate, shot: Shot, i: int) -> Array:
    """Return the difference between each segment's end and the start of the next segment, shape (k - 1, s)."""
    gaps = shot.ends[:-1] - point.states[i][1:]
    if problem.is_separate:
        gaps[:, ~problem.experiments[i].hidden] = 0.0
    return gaps


def _condense(problem: FitProblem, point: Iterate, shot: Shot, i: int) -> ArrayPair:
    """Express the starts of all segments by the first start and the coordinates, with linearised continuity conditions.

    Returns
    -------
    ndarray (k, s, P + s), ndarray (k, s)
        Derivatives of each start with respect to the coordinates and the first start (in units of its prior), and the
        change of each start that closes all gaps.
    """
    k, s = point.states[i].shape
    size = problem.size
    by_eta = problem.by_coordinates(i, shot.ends_by_parameter, point.eta)
    gaps = _gaps(problem, point, shot, i)
    by_unknown, closing = np.zeros((k, s, size + s)), np.zeros((k, s))
    carried = problem.experiments[i].hidden if problem.is_separate else np.ones(s, dtype=bool)
    by_unknown[0, carried, size:] = np.diag(problem.experiments[i].belief)[carried]
    for j in range(k - 1):
        onward = shot.ends_by_start[j] @ by_unknown[j]
        onward[:, :size] += by_eta[j]
        by_unknown[j + 1, carried] = onward[carried]
        closing[j + 1, carried] = (shot.ends_by_start[j] @ closing[j] + gaps[j])[carried]
    return by_unknown, closing


def predict_segments(problem: FitProblem, point: Iterate, search: SearchOptions) -> Iterate:
    """Run the first phase, until the point is near enough for the second phase.

    The noise is set to the present error of the model, but not below the noise of the sensors. Offsets are held,
    because segments start from the measurements: offsets then act only through volumes and flows.
    """
    problem.is_separate = True
    problem.held = np.array([False] * problem.drive_size + [s.kind == "offset" for s in problem.sensors])
    least = [e.noise.copy() for e in problem.experiments]
    problem.believed = [s.copy() for s in point.states]
    shots = problem.run(point, "start")
    longest, closings = LONGEST, 0
    for _ in range(MOST_STEPS):
        residuals = judge(problem, point, shots).residuals
        for experiment, residual, floor in zip(problem.experiments, residuals, least, strict=True):
            count = np.maximum(experiment.weight.sum(axis=0), 1.0)
            off = experiment.noise * np.sqrt(np.sum(residual**2, axis=0) / count)
            experiment.noise = np.maximum(floor, off)
        at = linearise(problem, point, shots)
        found = _shortened(problem, at, longest)
        if found is None:  # carried states may be far off: first move only these
            if closings == MOST_CLOSINGS:
                break
            states = [s + closing for s, (_, closing) in zip(point.states, at.carried, strict=True)]
            point = problem.possible(replace(point, states=states))
            longest, closings = LONGEST, closings + 1
            shots = problem.run(point, "reached")
            continue
        standing, longest = found
        point, closings = standing.point, 0
        search.step("steps with separate segments", point)
        if 1.0 - standing.cost / at.cost < SMALL_GAIN:
            break
        shots = problem.run(point, "reached")
    for experiment, noise in zip(problem.experiments, least, strict=True):
        experiment.noise = noise
    problem.held, problem.is_separate = np.zeros(problem.size, dtype=bool), False
    return point


def _shortened(
    problem: FitProblem,
    at: Misfit,
    longest: float,
    share: float = 1.0,
) -> tuple[Misfit, float] | None:
    """Shorten the step until it lowers the merit function. The trial runs have no derivatives.

    The bound on the step of the coordinates is lowered, and the step of the starts follows from the shorter step.
    `share` scales both steps. Return the misfit of the new point, and the bound for the next step; None if no step
    lowers the merit.
    """
    information, gradient = equations(problem, at)
    while longest >= SHORTEST:
        step = bounded_step(information, gradient, longest)
        states = []
        for state, (n, g), (by_unknown, closing) in zip(at.point.states, at.blocks, at.carried, strict=True):
            right = g[step.size :] - n[step.size :, : step.size] @ step
            states.append(state + share * (by_unknown @ np.r_[step, start_solution(n, right)] + closing))
        trial = problem.possible(Iterate(at.point.eta + share * step, states))
        with suppress(FitError):  # such a drive is rejected, or cannot be simulated
            standing = judge(problem, trial, problem.run(trial, "drive", derivatives=False))
            if standing.merit < at.merit:
                return standing, min(LONGER * longest, LONGEST)
        longest = SHORTER * min(longest, float(np.abs(step).max(initial=0.0)))
    return None


def equations(problem: FitProblem, at: Misfit) -> ArrayPair:
    """Return information and gradient of the global coordinates, with prior knowledge of the sensors.

    The start of each recording is eliminated.
    """
    size = problem.size
    information, gradient = np.zeros((size, size)), np.zeros(size)
    for n, b in at.blocks:
        gain = start_solution(n, np.c_[n[size:, :size], b[size:]])
        information += n[:size, :size] - n[:size, size:] @ gain[:, :-1]
        gradient += b[:size] - n[:size, size:] @ gain[:, -1]
    information = 0.5 * (information + information.T) + np.diag(problem.prior)
    gradient -= problem.prior * at.point.eta
    held = problem.held
    information[held], information[:, held], gradient[held] = 0.0, 0.0, 0.0
    information[held, held] = 1.0
    return information, gradient


def join_segments(
    problem: FitProblem, point: Iterate, search: SearchOptions | None, most: int = MOST_STEPS
) -> tuple[Misfit, bool]:
    """Run the second phase to its end.

    Returns
    -------
    Misfit, bool
        Linearisation at the last accepted point, and whether the search converged.
    """
    at, longest = linearise(problem, point, problem.run(point, "segment")), LONGEST
    for _ in range(most):
        information, gradient = equations(problem, at)
        step = bounded_step(information, gradient, LONGEST)
        # The Newton decrement: of the global coordinates, and of the starts.
        starts = [(n, g[problem.size :]) for n, g in at.blocks]
        gain = float(step @ information @ step) + sum(float(g @ start_solution(n, g)) for n, g in starts)
        unknowns = problem.size + sum(gradient.size for _, gradient in starts)
        length = float(np.sqrt(max(gain, 0.0) / unknowns))
        short = length < SHORT_STEP and at.gap < SMALL_GAP
        # residuals far below the noise: the error of the solver is a lower limit of the noise
        exact = at.cost < EXACT_SHARE**2 * sum(r.size for r in at.residuals)
        if short or (exact and at.gap < SOLVER_GAP):
            return at, True
        found = _shortened(problem, at, longest)
        if found is None and at.gap < SOLVER_GAP and length >= 1.0:  # the starts move too far
            shares = (_shortened(problem, at, LONGEST, share) for share in SHARES)
            found = next(filter(None, shares), None)
        if found is None:
            return at, length < 1.0 and at.gap < SOLVER_GAP
        standing, longest = found
        at = linearise(problem, standing.point, problem.run(standing.point, "drive"))
        if search is not None:
            search.step("steps with joined segments", at.point)
    return at, False


#: Largest lag for the correlation of residuals, as a fraction of a recording.
LAG_SHARE = 0.1
PROFILE_FITS = 12


@dataclass(frozen=True)
class Solved:
    """End point of a search, with its linearisation after elimination of the starts.

    Attributes
    ----------
    problem : FitProblem
    at : Misfit
    freedom : int
        Degrees of freedom.
    slopes : list of ndarray, shape (n, c, P)
        Derivatives of the outputs of each recording, in units of the noise, minus the part that starts can compensate.
    inverse : ndarray, shape (P, P)
        Inverse of the information matrix of the coordinates, in determined directions, including the prior of sensors.
    weak : ndarray, shape (w, P)
        Undetermined unit directions in scaled coordinates.
    inflation : dict
        (recording, channel number) -> (variance of the residuals, sum of their correlations over all lags).
    converged : bool
    missed : dict
        Channel -> residuals relative to its sample-to-sample noise, if larger than `MISFIT`.
    score : float
        Mean logarithm of the residuals relative to the sample-to-sample noise of each channel.
    segment_s : float
        Length of the segments, s.
    """

    problem: FitProblem
    at: Misfit
    freedom: int
    slopes: list[Array]
    inverse: Array
    weak: Array
    inflation: dict[tuple[int, int], Pair]
    converged: bool = True
    missed: NamedNumbers = field(default_factory=dict)
    score: float = np.nan
    segment_s: float = np.nan

    @property
    def values(self) -> Array:
        """Values of the drive, then of the sensors, in SI."""
        return self.problem.values(self.at.point.eta)

    @property
    def good(self) -> bool:
        """Whether the search converged and the model follows the measurements."""
        return self.converged and not self.missed

    def rank(self) -> tuple[bool, bool, float]:
        """Rank among several searches; a smaller value is better."""
        return not self.good, not self.converged, self.score

    @property
    def internal_covariance(self) -> Array:
        """Covariance of the coordinates [bates1988], with variance and autocorrelation of the residuals.

        inverse (sum over channels of s^2 tau J^T J + prior) inverse,  tau = 1 + 2 sum of autocorrelations.
        """
        middle = np.diag(self.problem.prior)
        for (i, c), (variance, tau) in self.inflation.items():
            jac = self.slopes[i][:, c]
            middle = middle + variance * tau * (jac.T @ jac)
        return self.inverse @ middle @ self.inverse

    @property
    def covariance(self) -> Array:
        """Covariance of the values, in SI."""
        by_coordinate = self.problem.transforms.jacobian(self.at.point.eta)
        return by_coordinate @ self.internal_covariance @ by_coordinate.T


def solution(problem: FitProblem, at: Misfit) -> Solved:
    """Return the end point of a search from its linearisation."""
    size, (matrix, _) = problem.size, equations(problem, at)
    slopes = [
        jac[..., :size] - jac[..., size:] @ start_solution(n, n[size:, :size])
        for (n, _), jac in zip(at.blocks, at.slopes, strict=True)
    ]
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))  # what rounding makes negative is zero
    scale[scale == 0.0] = 1.0
    power, axes = np.linalg.eigh(matrix / np.outer(scale, scale))
    good = power > SINGULAR_SHARE**2 * max(power[-1], 1e-300)
    inverse = (axes[:, good] / power[good]) @ axes[:, good].T / np.outer(scale, scale)
    inflation = {}
    for i, channel, residual in problem.valid(at.residuals):
        inflation[i, channel] = float(np.mean(residual**2)), correlation_time(residual)
    measured = int(sum(e.weight.sum() for e in problem.experiments))
    freedom = max(measured - size - sum(s.shape[1] for s in at.point.states), 1)
    return Solved(problem, at, freedom, slopes, inverse, axes[:, ~good].T, inflation)


def correlation_time(residual: Array) -> float:
    """Return the sum of the autocorrelations over all lags of both signs, in samples; 1 for white residuals.

    Neighbouring lags are added in pairs until a pair is not positive.
    """
    n = residual.size
    most = max(2, int(LAG_SHARE * n))
    size = 1 << (n + most).bit_length()
    power = np.abs(np.fft.rfft(residual, size)) ** 2
    r = np.fft.irfft(power, size)[: most + 1]
    if r[0] <= 0.0:
        return 1.0
    r = r / r[0]
    pairs = r[1:most:2] + r[2 : most + 1 : 2]
    stop = np.flatnonzero(pairs <= 2.0 / np.sqrt(n))
    return max(1.0, 1.0 + 2.0 * float(pairs[: stop[0] if stop.size else None].sum()))


def profile(solved: Solved, name: str, least: float | None = None) -> Interval:
    """Return the interval of one value by profile likelihood, in SI.

    Within the interval, the cost with all other values refitted increases by at most Student's t squared times the
    inflation of the residuals. If the cost never increases that much, the end of the interval is the bound of the
    value.

    Parameters
    ----------
    solved : Solved
        End of the search.
    name : str
        Name of the value, as in `FitProblem.names`.
    least : float, optional
        Lowest cost of all minima. Default: cost of this solution.
    """
    problem, point, reach = solved.problem, solved.at.point, student(solved.freedom)
    index = problem.names.index(name)
    spread = np.sqrt(solved.internal_covariance[index, index])
    plain = np.sqrt(solved.inverse[index, index])
    allowed = reach**2 * (spread / plain) ** 2 if plain > 0.0 else reach**2

    def held(value: float, start: Iterate) -> tuple[float, Iterate]:
        """Return the lowest cost with the coordinate held at a value, and the point of this cost."""
        eta = start.eta.copy()
        eta[index] = value
        problem.held = np.arange(problem.size) == index
        try:
            found, _ = join_segments(problem, replace(start, eta=eta), None, most=PROFILE_FITS)
        except FitError:
            return np.inf, start
        finally:
            problem.held = np.zeros(problem.size, dtype=bool)
        return found.cost, found.point

    least = solved.at.cost if least is None else least
    at, ends = point.eta[index], []
    for end in profile_interval(held, point, at, reach * spread, least, allowed):
        eta = point.eta.copy()
        eta[index] = end
        ends.append(float(problem.values(eta)[index]))
    return min(ends), max(ends)


#: Segment lengths in the first phase, s, and in a second attempt; smallest number of samples of a segment.
LADDER_S, SECOND_LADDER_S, LEAST_SEGMENT_SAMPLES = (0.01, 0.04), (0.02, 0.08), 8


@dataclass
class SearchOptions:
    """Options of a search, its progress, and its best point in case of an interruption."""

    watch: Watch
    #: Length of the segments after the first phase, s; 0 without a first phase.
    segment_s: float
    rtol: float
    notes: list[str] = field(default_factory=list)
    lost: list[Undetermined] = field(default_factory=list)
    interrupted: bool = False
    #: Lengths of the segments of the first phase, s, before `segment_s`.
    lengths_s: tuple[float, ...] = LADDER_S
    #: Delay of the valve after the recorded command, s; None: free.
    delay_s: float | None = 0.0
    #: Names of a circuit's axis. The search of a circuit ends with one segment, because a start does not contain the
    #: spool's position.
    axis: ShortNames | None = None
    point: Iterate | None = None
    #: Number of accepted steps.
    count: int = 0

    def step(self, phase: str, point: Iterate) -> None:
        """Register an accepted step; end the search if the user cancelled it."""
        self.point = point
        self.count += 1
        self.watch.tell(self.count, 0, phase)

    @property
    def is_last(self) -> bool:
        """Whether the segments are those of the last attempt."""
        return self.lengths_s == SECOND_LADDER_S
