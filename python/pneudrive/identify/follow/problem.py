"""Least squares fit of pressures along recorded motions: shared parameters, and start and delay of each recording.

Sensor noise is far below the model error, which is correlated in time. Residuals are therefore weighted by their size
and correlation time, and the covariance is a sandwich estimate over blocks of time.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pneudrive.arrays import Array, ArrayPair, Interval, NamedIntervals, NamedNumbers, by_name
from pneudrive.errors import FitError
from pneudrive.estimate.estimates import student
from pneudrive.identify.follow.driven import SIDES, DrivenCircuit, DrivenRecording, Number
from pneudrive.progress import UNWATCHED, Watch

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
        Compared time span of each recording, in s.
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
    weights: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Set the weights before the first fit. Given weights are copied, because a fit updates its weights."""
        self.parts = self.parts or [(0.0, np.inf)] * len(self.records)
        self.weights = list(self.weights)
        for record in self.records[len(self.weights) :]:
            size = np.maximum(FIRST_ERROR * record.ranges_pa, record.noise_pa)
            step = np.median(np.diff(record.grid_s))
            self.weights.append(1.0 / (size * np.sqrt(max(FIRST_TIME_S / step, 1.0))))

    def begin(self) -> FollowPoint:
        """Return the start point."""
        return FollowPoint(np.log([n.start for n in self.numbers]), np.zeros((len(self.records), LOCAL)))

    def raw(self, at: int, form: str, local: Array) -> Array:
        """Return the simulated pressures of a recording without its delay; NaN after its compared time span."""
        record, walls = self.records[at], self.driven.wall_k
        first = record.pressures_pa[:, :3].mean(axis=1)
        start = np.r_[first * np.exp(local[:2]), walls["a"] + local[2], walls["b"] + local[3]]
        until = min(float(record.grid_s[-1]), self.parts[at][1])
        columns = [f"{self.driven.piston}.{side}.pressure_pa" for side in SIDES]
        found = self.driven.run(form, record, start, until, columns)
        pressures = np.array([found[column] for column in columns])
        missing = record.grid_s.size - pressures.shape[1]
        return np.pad(pressures, ((0, 0), (0, missing)), constant_values=np.nan)

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
        """Return the prior standard uncertainties of a recording's parameters; inf without a prior."""
        kelvin = AT_REST_K if self.records[at].at_rest else IN_MOTION_K
        return np.array([np.inf, np.inf, kelvin, kelvin, DELAY_S])


@dataclass
class FollowSolution:
    """Simulation of a problem at a point, with its covariance if the problem is solved.

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
    converged : bool
        Whether the point is a minimum.
    """

    problem: FollowProblem
    point: FollowPoint
    raws: list[Array]
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    freedom: float = np.nan
    converged: bool = False

    @property
    def residuals(self) -> list[Array]:
        """Weighted residuals of all recordings, shape (2, n) each."""
        delays = self.point.local[:, 4]
        return [self.problem.residual(at, raw, delays[at]) for at, raw in enumerate(self.raws)]

    @property
    def cost(self) -> float:
        """Half the sum of squares of the residuals, and of the deviations of the parameters from their priors."""
        total = 0.0
        for at, residual in enumerate(self.residuals):
            total += np.sum(residual**2)
            total += np.sum((self.point.local[at] / self.problem.priors(at)) ** 2)
        return 0.5 * total

    def shown(self, at: int) -> Array:
        """Return the simulated readings of both pressures of a recording in Pa; NaN outside the run."""
        return self.problem.shown(at, self.raws[at], float(self.point.local[at, 4]))

    def rest(self, at: int) -> Array:
        """Return measured minus simulated pressures of a recording in Pa; NaN without a simulated value."""
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
        """Shared parameters by name, in SI."""
        return by_name((number.name for number in self.problem.numbers), np.exp(self.point.shared))

    @property
    def intervals(self) -> NamedIntervals:
        """95 % intervals of the shared parameters, for the model of this solution."""
        shared = self.point.shared
        half = np.array([self.deviation(place) for place in range(shared.size)])
        low, high = np.exp(shared - half).tolist(), np.exp(shared + half).tolist()
        return by_name(self.values, zip(low, high, strict=True))

    def deviation(self, place: int) -> float:
        """Return the half width of the 95 % interval of a parameter, or of the logarithm of a shared parameter."""
        half = float(student(self.freedom) * np.sqrt(self.covariance[place, place]))
        return min(half, WIDEST)


def solve_follow(problem: FollowProblem, begin: FollowPoint | None = None, passes: int = 2) -> FollowSolution:
    """Fit all free numbers. Each pass uses weights from the residuals of the previous pass.

    Raises
    ------
    FitError
        The circuit cannot be simulated at the start values, or a number has no effect.
    """
    found = FollowSolution(problem, begin or problem.begin(), [])
    with ThreadPoolExecutor(2) as pool:
        for number in range(passes):
            found = _search(problem, found.point, pool, is_first=number == 0)
            for at, record in enumerate(problem.records):  # weights from size and correlation time of the residuals
                rest = found.rest(at)
                rest = rest[:, record.within(problem.parts[at]) & np.isfinite(rest[0])]
                size = np.maximum(np.sqrt(np.mean(rest**2, axis=1)), record.noise_pa)
                problem.weights[at] = 1.0 / (size * np.sqrt([_correlation_time(one) for one in rest]))
        covariance, freedom = _covariance(found, _jacobians(found, pool))
    return replace(found, covariance=covariance, freedom=freedom)


def simulated(problem: FollowProblem, point: FollowPoint) -> FollowSolution:
    """Run all recordings at a point."""
    form = problem.driven.values_form(problem.numbers, np.exp(point.shared))
    return FollowSolution(problem, point, [problem.raw(at, form, local) for at, local in enumerate(point.local)])


def _jacobians(found: FollowSolution, pool: ThreadPoolExecutor) -> list[Array]:
    """Return the Jacobian of each recording's residuals: columns of shared parameters, then those of the recording."""
    problem, point, residuals = found.problem, found.point, found.residuals
    shared, groups = len(problem.numbers), _groups(problem)
    jobs, steps = [], np.r_[np.full(shared, SHARED_STEP), STEPS]
    for at, local in enumerate(point.local):
        for group in groups:
            moved = np.r_[point.shared, local]
            moved[[*group]] += steps[[*group]]
            form = problem.driven.values_form(problem.numbers, np.exp(moved[:shared]))
            jobs.append((at, group, pool.submit(problem.raw, at, form, moved[shared:])))
    out = [np.zeros((shared + LOCAL, *residual.shape)) for residual in residuals]
    for at, group, job in jobs:
        problem.watch.look()
        change = problem.residual(at, job.result(), point.local[at, 4]) - residuals[at]
        for column, rows in group.items():
            out[at][column][rows] = change[rows] / steps[column]
    for at, raw in enumerate(found.raws if not problem.is_held else ()):
        delay, step = point.local[at, 4], STEPS[4]
        ends = [problem.residual(at, raw, delay + sign * step) for sign in (1.0, -1.0)]
        out[at][-1] = (ends[0] - ends[1]) / (2.0 * step)
    return out


def _groups(problem: FollowProblem) -> list[dict[int, int | slice]]:
    """Return a dict for each run of the Jacobian: changed parameter -> rows of the residuals that it affects.

    If no gas passes between the chambers, one run changes one parameter of each chamber. The delay needs no run.
    """
    sides = [number.side for number in problem.numbers] + list("ab" if problem.is_held else "abab")
    chambers = ([column for column, own in enumerate(sides) if own == side] for side in SIDES)
    pairs = [] if problem.driven.is_coupled else list(zip(*chambers, strict=False))
    left = set(range(len(sides))).difference(*pairs)
    return [*({a: 0, b: 1} for a, b in pairs), *({column: slice(None)} for column in sorted(left))]


def _normal(found: FollowSolution, jac: list[Array]) -> ArrayPair:
    """Return the normal matrix and the gradient over all numbers."""
    problem, local = found.problem, found.point.local
    shared, n = len(problem.numbers), len(problem.numbers) + local.size
    matrix, gradient = np.zeros((n, n)), np.zeros(n)
    for at, (rest, columns) in enumerate(zip(found.residuals, jac, strict=True)):
        places, spread = _places(shared, at), problem.priors(at)
        flat, own = columns.reshape(columns.shape[0], -1), places[shared:]
        matrix[np.ix_(places, places)] += flat @ flat.T
        gradient[places] += flat @ rest.ravel()
        matrix[own, own] += 1.0 / spread**2
        gradient[own] += local[at] / spread**2
        if problem.is_held:
            matrix[own[2:], own[2:]] = 1.0
    return matrix, gradient


def _places(shared: int, at: int) -> NDArray[np.intp]:
    own = shared + LOCAL * at
    return np.r_[np.arange(shared), np.arange(own, own + LOCAL)].astype(np.intp)


def _search(
    problem: FollowProblem,
    point: FollowPoint,
    pool: ThreadPoolExecutor,
    *,
    is_first: bool,
) -> FollowSolution:
    """Return the minimum by damped Gauss-Newton steps."""
    try:
        found = simulated(problem, point)
        cost = found.cost
    except (ValueError, RuntimeError) as error:
        raise FitError(f"the circuit cannot be simulated at the start values: {error}") from None
    damping, small, start = 1e-3, 0, problem.begin().shared
    for step in range(MOST_STEPS):
        problem.watch.tell(step, MOST_STEPS, f"{problem.model}: steps of the search, at most")
        matrix, gradient = _normal(found, _jacobians(found, pool))
        diagonal = np.diag(matrix).copy()
        if is_first and step == 0:  # no shared number may be without an effect on the pressures
            own = diagonal[: start.size]
            idle = [n.name for n, v in zip(problem.numbers, own, strict=True) if v <= WITHOUT_EFFECT * own.max()]
            if idle:
                names = ", ".join(r.name for r in problem.records)
                raise FitError.of("identify.no_effect", name=idle[0], recordings=names)
        trial, lower = found, np.inf
        for _ in range(8):
            scaled = matrix + np.diag(damping * np.maximum(diagonal, 1e-12))
            move = np.linalg.solve(scaled, -gradient)
            shared = found.point.shared + np.clip(move[: start.size], -LARGEST_STEP, LARGEST_STEP)
            local = found.point.local + move[start.size :].reshape(found.point.local.shape)
            point = FollowPoint(np.clip(shared, start - REACH, start + REACH), np.clip(local, -FARTHEST, FARTHEST))
            with suppress(ValueError, RuntimeError):
                trial = simulated(problem, point)
                lower = trial.cost
                if lower < cost:
                    break
            damping = min(damping * 5.0, 1e6)
        else:
            return replace(found, converged=True)
        gain, found, cost, damping = (cost - lower) / cost, trial, lower, max(damping / 5.0, 1e-9)
        small = small + 1 if gain < CONVERGED else 0
        if small >= 2 or gain < 1e-3 * CONVERGED:
            return replace(found, converged=True)
    return found


def _correlation_time(rest: Array) -> float:
    """Return the correlation time of residuals in samples: at least 1, summed up to the first negative value."""
    centred = rest - rest.mean()
    n = centred.size
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[:n]
    correlation = correlation / correlation[0]
    negative = np.flatnonzero(correlation < 0.0)
    end = int(negative[0]) if negative.size else n
    return float(max(1.0 + 2.0 * correlation[1:end].sum(), 1.0))


def _covariance(found: FollowSolution, jac: list[Array]) -> tuple[Array, float]:
    """Return the covariance: the larger of the weighted estimate and the sandwich estimate over blocks of time."""
    problem, shared = found.problem, len(found.problem.numbers)
    matrix, _ = _normal(found, jac)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = scale[:, None] * np.linalg.pinv(matrix * np.outer(scale, scale), rcond=1e-12) * scale[None, :]
    meat, blocks = np.zeros_like(matrix), 0
    for at, (rest, columns) in enumerate(zip(found.residuals, jac, strict=True)):
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
