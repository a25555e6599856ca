"""Least squares fit of pressures along recorded motions: shared parameters, and start and delay of each recording.

Sensor noise is far below the model error, which is correlated in time. Residuals are therefore weighted by their size
and correlation time, and the covariance is a sandwich estimate over blocks of time.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError
from pneudrive.estimate.estimates import student
from pneudrive.identify.follow.driven import SIDES, DrivenCircuit, DrivenRecording, Number
from pneudrive.progress import UNWATCHED, Watch

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.arrays import Array, ArrayPair, Interval, NamedNumbers

#: Prior standard uncertainty of the gas temperature for a start at rest and in motion, K, and of the delay, s
#: (assumed).
AT_REST_K, IN_MOTION_K, DELAY_S = 2.0, 30.0, 1.0
LARGEST_DELAY_S = 3.0
LOCAL = 5  # numbers of each recording: both log pressures, both temperatures, delay
STEPS = np.array([1e-4, 1e-4, 0.5, 0.5, 0.01])  # steps of their finite differences
FARTHEST = np.array([0.5, 0.5, 120.0, 120.0, LARGEST_DELAY_S])  # bounds of their change
SHARED_STEP = 1e-3  # of the logarithm of a shared number
FIRST_ERROR = 0.005  # of the range: residuals before the first fit (assumed)
FIRST_TIME_S = 2.0  # their correlation time before the first fit
MOST_STEPS, CONVERGED = 25, 1e-4
BLOCK_S, LEAST_BLOCKS = 15.0, 12
WIDEST = 50.0  # a larger half width of an interval, also of a logarithm, says no more
LARGEST_STEP = 0.7  # of the logarithm of a shared number
REACH = np.log(1e4)  # a shared number stays within this factor of its start value
WITHOUT_EFFECT = 1e-10  # information of a number relative to the largest


@dataclass
class FollowPoint:
    """Point of a fit: logarithms of the shared parameters, and the parameters of each recording, shape (records, 5)."""

    shared: Array
    local: Array


@dataclass
class FollowProblem:
    """Free numbers of a driven circuit and its recordings.

    Parameters
    ----------
    driven : DrivenCircuit
    records : sequence of DrivenRecording
    numbers : sequence of Number
        Shared parameters. Empty: only start and delay of each recording are fitted.
    parts : sequence of (float, float)
        Time span of each recording with residuals, s.
    is_held : bool
        Whether each recording starts at wall temperature and has no delay; otherwise, both are free.
    model : str
        Name of the model in reports of progress.
    """

    driven: DrivenCircuit
    records: Sequence[DrivenRecording]
    numbers: Sequence[Number]
    parts: Sequence[Interval] = ()
    is_held: bool = False
    model: str = "requested model"
    watch: Watch = UNWATCHED
    weights: Sequence[Array] = ()

    def __post_init__(self) -> None:
        """Set the weights before the first fit, or copy those of another problem, because a fit updates its weights."""
        self.parts = self.parts or [(0.0, np.inf)] * len(self.records)
        self.weights = list(self.weights or map(_first_weights, self.records))

    def begin(self) -> FollowPoint:
        """Return the start point."""
        return FollowPoint(np.log([n.start for n in self.numbers]), np.zeros((len(self.records), LOCAL)))

    def raw(self, at: int, form: str, local: Array) -> Array:
        """Return the simulated pressures of a recording without its delay."""
        record, walls = self.records[at], self.driven.wall_k
        first = record.pressures_pa[:, :3].mean(axis=1)
        start = np.r_[first * np.exp(local[:2]), walls["a"] + local[2], walls["b"] + local[3]]
        until = min(float(record.grid_s[-1]), self.parts[at][1])
        return self.driven.run(form, record, start, until)

    def shown(self, at: int, raw: Array, delay_s: float) -> Array:
        """Return the simulated sensor readings, with the delay; NaN outside the run."""
        grid = self.records[at].grid_s
        times = grid - delay_s
        there = np.isfinite(raw[0])
        shown = np.array([np.interp(times, grid[there], one[there]) for one in raw])
        # Before its start, a recording at rest stays at rest. The past of a recording in motion is not known.
        early = times < (-LARGEST_DELAY_S if self.records[at].at_rest else 0.0)
        shown[:, early | (times > grid[there][-1] + 1e-9)] = np.nan
        return shown

    def residual(self, at: int, raw: Array, delay_s: float) -> Array:
        """Return the weighted residuals of a recording, shape (2, n); zero outside the compared span."""
        record = self.records[at]
        away = record.pressures_pa - self.shown(at, raw, delay_s)
        rest = np.where(record.within(self.parts[at]), away, 0.0)
        return np.nan_to_num(rest) * self.weights[at][:, None]

    def priors(self, at: int) -> Array:
        """Return the prior standard uncertainties of a recording's parameters; 0 if held, inf without a prior."""
        kelvin = AT_REST_K if self.records[at].at_rest else IN_MOTION_K
        return np.array([np.inf, np.inf, *([0.0, 0.0, 0.0] if self.is_held else [kelvin, kelvin, DELAY_S])])


def _first_weights(record: DrivenRecording) -> Array:
    """Return the weights of both pressures before the first fit."""
    size = np.maximum(FIRST_ERROR * record.ranges_pa, record.noise_pa)
    step = np.median(np.diff(record.grid_s))
    return 1.0 / (size * np.sqrt(max(FIRST_TIME_S / step, 1.0)))


@dataclass
class FollowSolution:
    """A solved problem.

    Attributes
    ----------
    problem : FollowProblem
    point : FollowPoint
    raws : list of ndarray
        Simulated pressures of each recording before its delay.
    covariance : ndarray
        Covariance of all parameters, shape (n, n), with shared parameters as logarithms.
    freedom : float
        Degrees of freedom of the intervals.
    """

    problem: FollowProblem
    point: FollowPoint
    raws: list[Array]
    covariance: Array
    freedom: float
    converged: bool

    def shown(self, at: int) -> Array:
        """Return the simulated readings of both pressures of a recording, Pa; NaN outside the run."""
        return self.problem.shown(at, self.raws[at], float(self.point.local[at, 4]))

    def rest(self, at: int) -> Array:
        """Return measured minus simulated pressures of a recording, Pa; NaN without a simulated value."""
        return self.problem.records[at].pressures_pa - self.shown(at)

    def rms(self, at: int, part: Interval = (0.0, np.inf)) -> Array:
        """Return the rms of both residuals of a recording, relative to the range of each pressure."""
        record = self.problem.records[at]
        rest = self.rest(at)[:, record.within(part)]
        return np.sqrt(np.nanmean(rest**2, axis=1)) / record.ranges_pa

    @property
    def every_rms(self) -> list[Array]:
        """RMS residuals of all recordings; see `rms`."""
        return [self.rms(at) for at in range(len(self.problem.records))]

    @property
    def values(self) -> NamedNumbers:
        """Shared parameters by name, SI."""
        shared = zip(self.problem.numbers, self.point.shared, strict=True)
        return {number.name: float(np.exp(log)) for number, log in shared}

    @property
    def intervals(self) -> dict[str, Interval]:
        """95 % intervals of the shared parameters, for the model of this solution."""
        halves = map(self.deviation, range(len(self.point.shared)))
        every = zip(self.problem.numbers, self.point.shared, halves, strict=True)
        ends = {number.name: (log - half, log + half) for number, log, half in every}
        return {name: (float(np.exp(low)), float(np.exp(high))) for name, (low, high) in ends.items()}

    def deviation(self, place: int) -> float:
        """Return the half width of the 95 % interval of a number, or of the logarithm of a shared number."""
        half = float(student(self.freedom) * np.sqrt(self.covariance[place, place]))
        return min(half, WIDEST)


def solve_follow(problem: FollowProblem, begin: FollowPoint | None = None, passes: int = 2) -> FollowSolution:
    """Fit all free numbers. Each pass uses weights from the residuals of the previous pass.

    Raises
    ------
    FitError
        The circuit cannot be simulated at the start values, or a number has no effect.
    """
    point = begin or problem.begin()
    with ThreadPoolExecutor(2) as pool:
        raws, converged = [], False
        for number in range(passes):
            point, raws, converged = _search(problem, point, pool, is_first=number == 0)
            problem.weights = [_weights(problem, at, raw, point.local[at, 4]) for at, raw in enumerate(raws)]
        residuals = [problem.residual(at, raw, point.local[at, 4]) for at, raw in enumerate(raws)]
        jacobians = _jacobians(problem, point, raws, residuals, pool)
    covariance, freedom = _covariance(problem, point, residuals, jacobians)
    return FollowSolution(problem, point, raws, covariance, freedom, converged)


def simulated(problem: FollowProblem, point: FollowPoint) -> tuple[list[Array], list[Array], float]:
    """Return simulated pressures, weighted residuals, and half the sum of their squares and those of the priors."""
    form, total = problem.driven.values_form(problem.numbers, np.exp(point.shared)), 0.0
    raws = [problem.raw(at, form, local) for at, local in enumerate(point.local)]
    residuals = [problem.residual(at, raw, point.local[at, 4]) for at, raw in enumerate(raws)]
    for at, residual in enumerate(residuals):
        spread = problem.priors(at)
        there = spread > 0.0
        total += np.sum(residual**2)
        total += np.sum((point.local[at][there] / spread[there]) ** 2)
    return raws, residuals, 0.5 * total


def _jacobians(
    problem: FollowProblem, point: FollowPoint, raws: list[Array], residuals: list[Array], pool: ThreadPoolExecutor
) -> list[Array]:
    """Return the Jacobian of each recording's residuals: shared parameters, then separate ones."""
    shared = len(problem.numbers)
    jobs, steps = [], np.r_[np.full(shared, SHARED_STEP), STEPS]
    for at, local in enumerate(point.local):
        free = np.flatnonzero(np.r_[np.ones(shared), problem.priors(at)[:-1]] > 0.0).tolist()  # the delay needs no run
        for columns in _together(problem, free):
            moved = np.r_[point.shared, local]
            moved[columns] += steps[columns]
            form = problem.driven.values_form(problem.numbers, np.exp(moved[:shared]))
            jobs.append((at, columns, pool.submit(problem.raw, at, form, moved[shared:])))
    out = [np.zeros((shared + LOCAL, *residual.shape)) for residual in residuals]
    for at, columns, job in jobs:
        problem.watch.look()
        change = problem.residual(at, job.result(), point.local[at, 4]) - residuals[at]
        for column in columns:
            rows = slice(None) if len(columns) == 1 else SIDES.index(_side(problem, column))
            out[at][column][rows] = change[rows] / steps[column]
    for at, raw in enumerate(raws):
        if not problem.is_held:
            delay, step = point.local[at, 4], STEPS[4]
            ends = [problem.residual(at, raw, delay + sign * step) for sign in (1.0, -1.0)]
            out[at][-1] = (ends[0] - ends[1]) / (2.0 * step)
    return out


def _side(problem: FollowProblem, column: int) -> str:
    """Return the chamber affected by a parameter; empty if both may be affected."""
    own = column - len(problem.numbers)
    return problem.numbers[column].side if own < 0 else SIDES[own % 2]


def _together(problem: FollowProblem, columns: list[int]) -> list[list[int]]:
    """Group parameters that share one run: one for each chamber, if no gas passes between the chambers."""
    if problem.driven.is_coupled:
        return [[column] for column in columns]
    sides = {side: [c for c in columns if _side(problem, c) == side] for side in ("", *SIDES)}
    pairs = [list(pair) for pair in zip(sides["a"], sides["b"], strict=False)]
    left = [c for c in columns if c not in [c for pair in pairs for c in pair]]
    return [*pairs, *([column] for column in left)]


def _normal(problem: FollowProblem, point: FollowPoint, residuals: list[Array], jac: list[Array]) -> ArrayPair:
    """Return the normal matrix and the gradient over all numbers."""
    shared, n = len(problem.numbers), len(problem.numbers) + LOCAL * len(residuals)
    matrix, gradient = np.zeros((n, n)), np.zeros(n)
    for at, (rest, columns) in enumerate(zip(residuals, jac, strict=True)):
        places = _places(shared, at)
        flat = columns.reshape(columns.shape[0], -1)
        matrix[np.ix_(places, places)] += flat @ flat.T
        gradient[places] += flat @ rest.ravel()
        spread, own = problem.priors(at), places[shared:]
        there = spread > 0.0
        matrix[own[there], own[there]] += 1.0 / spread[there] ** 2
        gradient[own[there]] += point.local[at][there] / spread[there] ** 2
        held = own[spread == 0.0]
        matrix[held, held] += 1.0
    return matrix, gradient


def _places(shared: int, at: int) -> NDArray[np.intp]:
    own = shared + LOCAL * at
    return np.r_[np.arange(shared), np.arange(own, own + LOCAL)].astype(np.intp)


def _search(
    problem: FollowProblem, point: FollowPoint, pool: ThreadPoolExecutor, *, is_first: bool
) -> tuple[FollowPoint, list[Array], bool]:
    """Return the minimum by damped Gauss-Newton steps."""
    try:
        raws, residuals, cost = found = simulated(problem, point)
    except (ValueError, RuntimeError) as error:
        raise FitError(f"the circuit cannot be simulated at the start values: {error}") from None
    damping, small = 1e-3, 0
    low, high = problem.begin().shared - REACH, problem.begin().shared + REACH
    for step in range(MOST_STEPS):
        problem.watch.tell(step, MOST_STEPS, f"{problem.model}: steps of a search, most")
        matrix, gradient = _normal(problem, point, residuals, _jacobians(problem, point, raws, residuals, pool))
        diagonal = np.diag(matrix).copy()
        if is_first and step == 0:  # no shared number may be without an effect on the pressures
            own = diagonal[: low.size]
            idle = [n.name for n, v in zip(problem.numbers, own, strict=True) if v <= WITHOUT_EFFECT * own.max()]
            if idle:
                names = ", ".join(r.name for r in problem.records)
                raise FitError.of("identify.no_effect", name=idle[0], recordings=names)
        for _ in range(8):
            scaled = matrix + np.diag(damping * np.maximum(diagonal, 1e-12))
            move = np.asarray(np.linalg.solve(scaled, -gradient), float)
            shared = point.shared + np.clip(move[: low.size], -LARGEST_STEP, LARGEST_STEP)
            local = point.local + move[low.size :].reshape(point.local.shape)
            trial = FollowPoint(np.clip(shared, low, high), np.clip(local, -FARTHEST, FARTHEST))
            try:
                found = simulated(problem, trial)
            except (ValueError, RuntimeError):
                found = [], [], np.inf
            if found[2] < cost:
                break
            damping = min(damping * 5.0, 1e6)
        else:
            return point, raws, True
        gain, point, damping = (cost - found[2]) / cost, trial, max(damping / 5.0, 1e-9)
        raws, residuals, cost = found
        small = small + 1 if gain < CONVERGED else 0
        if small >= 2 or gain < 1e-3 * CONVERGED:
            return point, raws, True
    return point, raws, False


def _weights(problem: FollowProblem, at: int, raw: Array, delay_s: float) -> Array:
    """Return the weights of both residuals of a recording, from their size and correlation time."""
    record = problem.records[at]
    rest = record.pressures_pa - problem.shown(at, raw, delay_s)
    rest = rest[:, record.within(problem.parts[at]) & np.isfinite(rest[0])]
    size = np.maximum(np.sqrt(np.mean(rest**2, axis=1)), record.noise_pa)
    return 1.0 / (size * np.sqrt([_correlation_time(one) for one in rest]))


def _correlation_time(rest: Array) -> float:
    """Return the integral correlation time of residuals, samples: at least 1, summed up to the first negative value."""
    centred = rest - rest.mean()
    n = centred.size
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[:n]
    correlation = correlation / correlation[0]
    negative = np.flatnonzero(correlation < 0.0)
    end = int(negative[0]) if negative.size else n
    return float(max(1.0 + 2.0 * correlation[1:end].sum(), 1.0))


def _covariance(
    problem: FollowProblem, point: FollowPoint, residuals: list[Array], jac: list[Array]
) -> tuple[Array, float]:
    """Return the covariance: the larger of the weighted estimate and the sandwich estimate over blocks of time."""
    shared, n = len(problem.numbers), len(problem.numbers) + LOCAL * len(residuals)
    matrix, _ = _normal(problem, point, residuals, jac)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = scale[:, None] * np.linalg.pinv(matrix * np.outer(scale, scale), rcond=1e-12) * scale[None, :]
    meat, blocks = np.zeros((n, n)), 0
    for at, (rest, columns) in enumerate(zip(residuals, jac, strict=True)):
        grid, places = problem.records[at].grid_s, _places(shared, at)
        begin = max(problem.parts[at][0], 0.0)
        end = min(problem.parts[at][1], float(grid[-1]))
        count = max(int((end - begin) / BLOCK_S), LEAST_BLOCKS)
        edges = np.searchsorted(grid, np.linspace(begin, end, count + 1))
        for a, b in pairwise(edges):
            score = np.einsum("kcn,cn->k", columns[:, :, a:b], rest[:, a:b])
            meat[np.ix_(places, places)] += np.outer(score, score)
        blocks += count
    sandwich = inverse @ meat @ inverse * blocks / max(blocks - shared, 1)
    grow = np.sqrt(np.maximum(np.diag(sandwich) / np.maximum(np.diag(inverse), 1e-300), 1.0))
    return inverse * np.outer(grow, grow), float(max(blocks - shared - 2, 3))
