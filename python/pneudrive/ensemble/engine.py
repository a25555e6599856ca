"""Interface to the core: members in, outputs of each run out. Only this module calls the core for ensembles."""

from __future__ import annotations

import hashlib
import os
import threading
import warnings
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from pneudrive.errors import CommandError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from pneudrive._core import Ensemble, Outcome
    from pneudrive._core import Output as CoreOutput
    from pneudrive.describe.system import System
    from pneudrive.ensemble.design import Distribution
    from pneudrive.ensemble.outputs import Alike, MemberPlans, Reduction
    from pneudrive.ensemble.variation import CoreMembers
    from pneudrive.estimate.profile import Transforms

    Array = NDArray[np.float64]


#: Status of a member that was simulated to the end.
DONE = 0


class Kept(NamedTuple):
    """Outputs of n members.

    Attributes
    ----------
    values : list of ndarray
        One for each reduction, shape (n,) or (n, samples); NaN where a member failed.
    status : ndarray of uint8, shape (n,)
        0 done, 1 the run failed, 2 the numbers are inconsistent.
    reasons : dict
        Index of a failed member -> reason.
    """

    values: list[Array]
    status: NDArray[np.uint8]
    reasons: dict[int, str]


def run(
    system: System,
    members: CoreMembers,
    plans: MemberPlans,
    rtol: float,
    kept: Sequence[Reduction],
    threads: int | None = None,
    look: Callable[[float], object] | None = None,
) -> Kept:
    """Run members and return the requested outputs.

    Parameters
    ----------
    system : System
    members : CoreMembers
        n members.
    plans : MemberPlans
        Commands of these members.
    rtol : float
    kept : sequence of Reduction
        Reductions without user functions.
    threads : int, optional
        Default: all processors.
    look : callable, optional
        Receives the number of finished members. An exception in it ends the run.

    Raises
    ------
    CommandError
        The core cannot vary one of the numbers, or a value is out of its bounds.
    """
    core, n, done = _ensemble(system, *members.paths), len(members.values), 0
    parts: list[tuple[NDArray[np.intp], Kept]] = []

    def tell(count: float) -> None:
        assert look is not None
        look(done + count)

    for alike in plans.alike():  # members whose commands change at the same times
        places = np.arange(n)[alike.places]
        part = members if len(places) == n else members.at(places)
        rates: list[float | None] = [*sorted({one.rate_hz for one in kept if one.word == "samples"})] or [None]
        found: dict[int, Array] = {}
        outcome: Any = None
        for rate in rates:  # the core samples at one rate in a run; unsampled outputs come with the first rate
            asked = [k for k, one in enumerate(kept) if (one.rate_hz if one.word == "samples" else rates[0]) == rate]
            outputs = [_output(kept[k]) for k in asked]
            options = {"outputs": outputs, "rtol": rtol, "threads": threads or processors()}
            outcome = _run(core, part, alike, options, None if look is None else tell)
            found |= dict(zip(asked, outcome["outputs"], strict=True))
        parts.append((places, Kept([found[k] for k in range(len(kept))], outcome["status"], outcome["reasons"])))
        done += len(places)
    if len(parts) == 1:
        return parts[0][1]
    status, reasons = np.zeros(n, np.uint8), {}
    values = [np.empty((n, *value.shape[1:])) for value in parts[0][1].values]
    for places, own in parts:
        for target, value in zip(values, own.values, strict=True):
            target[places] = value
        status[places] = own.status
        reasons |= {int(places[place]): why for place, why in own.reasons.items()}
    return Kept(values, status, reasons)


def _run(
    core: Ensemble, members: CoreMembers, alike: Alike, options: dict[str, Any], look: Callable[[float], object] | None
) -> Outcome:
    starts = [members.starts[name] for name in core.start_names]
    rows = 1 if all(np.ndim(start) == 0 for start in starts) else len(members.values)
    request: Any = {
        "values": members.values,
        "plans": alike.plans,
        "duration": alike.durations,
        "initial": np.column_stack([np.broadcast_to(start, rows) for start in starts]),
        "contact_age_s": float(members.starts.get("contact_age_s", 0.0)),
        **options,
    }
    try:
        return core.run(request, look)
    except ValueError as error:
        raise CommandError(str(error)) from None
    except RuntimeError as error:
        raise SimulationError(str(error)) from None


def processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@lru_cache(maxsize=8)
def _ensemble(system: System, *paths: str) -> Ensemble:
    """Return the core's ensemble for members that differ in the numbers at these paths. It is made once."""
    from pneudrive import _core

    try:
        return _core.Ensemble(system.json, list(paths), system.names)
    except ValueError as error:
        raise CommandError(
            f"vary: {error}",
            rule="numbers of the components, of the friction law and of the ambient air vary",
            remedy="Leave it out; for a fit, list the names: pn.EnsembleDesign.posterior(fit, n, names=[...]).",
        ) from None


def _output(one: Reduction) -> CoreOutput:
    """Return the outputs for the request to the core."""
    what: Any = ("time_above" if one.above else "time_below") if one.word == "time_when" else one.word
    value = {"time_when": one.level, "samples": one.rate_hz}.get(one.word)
    return {"column": one.columns[0], "what": what, "value": value}


# --- The rows of a design in SI: row k is a pure function of the design and k.

#: Half a cell of scipy's Sobol points, which are multiples of 2^-30: none lies on a face of the cube.
HALF_CELL = 2.0**-31
#: Rows of a random design that one generator makes.
BLOCK = 4096
#: The nearest to 0 and to 1 that a share comes.
EDGE = 2.0**-53


@dataclass(frozen=True, eq=False)
class Rows:
    """The values of all members, SI.

    Attributes
    ----------
    names : tuple of str
        Numbers that vary, as in the drive file.
    size : int
        Number of members.
    about : dict
        Description of the design as plain data. Two designs with the same description have the same rows.
    points : callable
        (first, last) -> rows of the members from first to before last, shape (members, names).
    shape : Marginals or NormalCoordinates, optional
        Of a sampled design: mapping from the unit cube to values.
    """

    names: tuple[str, ...]
    size: int
    about: dict[str, Any]
    points: Callable[[int, int], Array]
    shape: Marginals | NormalCoordinates | None = None

    @classmethod
    def table(cls, names: Sequence[str], values: Array) -> Rows:
        """Return rows with these values, shape (members, names)."""
        digest = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
        about = {"design": "table", "names": list(names), "members": len(values), "sha256": digest}
        return cls(tuple(names), len(values), about, partial(_part, values, 0))

    @classmethod
    def grid(cls, axes: dict[str, Array]) -> Rows:
        """Return all combinations of the values of each number. The last number varies fastest."""
        shape = tuple(len(axis) for axis in axes.values())

        def points(first: int, last: int) -> Array:
            places = np.unravel_index(np.arange(first, last), shape)
            return np.column_stack([axis[at] for axis, at in zip(axes.values(), places, strict=True)])

        about = {"design": "grid", "axes": {name: axis.tolist() for name, axis in axes.items()}}
        return cls(tuple(axes), int(np.prod(shape, dtype=object)), about, points)

    @classmethod
    def sampled(cls, method: str, size: int, seed: int, shape: Marginals | NormalCoordinates) -> Rows:
        """Return points in the unit cube, by distributions or by the posterior of a fit.

        Parameters
        ----------
        method : str
            ``"sobol"`` (scrambled), ``"latin-hypercube"`` or ``"random"``.
        size, seed : int
        shape : Marginals or NormalCoordinates
        """

        def points(first: int, last: int) -> Array:
            return shape.values(SAMPLERS[method](first, last, size, len(shape.names), seed))

        about = {"design": method, "members": size, "seed": seed, **shape.about()}
        return cls(shape.names, size, about, points, shape)

    def wider(self, other: Rows) -> Rows:
        """Return rows each of which is followed by that of another design."""

        def points(first: int, last: int) -> Array:
            return np.column_stack([self.take(first, last), other.take(first, last)])

        return Rows((*self.names, *other.names), self.size, {**self.about, "beside": other.about}, points)

    def take(self, first: int, last: int) -> Array:
        """Return the rows of the members from `first` to before `last`, shape (members, names)."""
        return self.points(first, min(last, self.size))

    def part(self, first: int, last: int) -> Rows:
        """Return these rows without the design, to be sent to another machine."""
        return replace(self, points=partial(_part, self.take(first, last), first), shape=None)


def _part(values: Array, begin: int, first: int, last: int) -> Array:
    return values[first - begin : last - begin]


@dataclass(frozen=True, eq=False)
class Marginals:
    """A distribution of each number, SI. Their normal scores may be correlated."""

    each: dict[str, Distribution]
    correlation: Array | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Numbers that vary."""
        return tuple(self.each)

    def values(self, cube: Array) -> Array:
        """Return the values at points of the unit cube."""
        if self.correlation is not None:
            scores = _mixed(ndtri(cube), np.linalg.cholesky(self.correlation).astype(np.float64))
            cube = np.clip(ndtr(scores), EDGE, 1.0 - EDGE)
        return np.column_stack([one.quantile(share) for one, share in zip(self.each.values(), cube.T, strict=True)])

    def about(self) -> dict[str, Any]:
        """Describe the distributions."""
        return {
            "distributions": {name: str(one) for name, one in self.each.items()},
            "correlation": None if self.correlation is None else self.correlation.tolist(),
        }


@dataclass(frozen=True, eq=False)
class NormalCoordinates:
    """Values whose coordinates (`pneudrive.estimate.profile`) are jointly normal: the posterior of a fit.

    The distribution is normal on the scale of the coordinates, as for intervals of a fit. A positive value stays
    positive. A `folded` value is nearly zero, and its absolute value is used.
    """

    names: tuple[str, ...]
    scales: Transforms
    centre: Array
    covariance: Array
    source: dict[str, Any] = field(default_factory=dict)
    folded: tuple[int, ...] = ()

    def values(self, cube: Array) -> Array:
        """Return the values at points of the unit cube."""
        variances, axes = np.linalg.eigh(self.covariance)
        by_score = (axes * np.sqrt(np.maximum(variances, 0.0))).astype(np.float64)
        found = self.scales.natural(self.centre + _mixed(ndtri(cube), by_score))
        found[:, list(self.folded)] = np.abs(found[:, list(self.folded)])
        return found

    def about(self) -> dict[str, Any]:
        """Describe the distributions."""
        return {"posterior": {"names": list(self.names), "covariance": self.covariance.tolist(), **self.source}}


def _mixed(scores: Array, by: Array) -> Array:
    """Return ``scores by'`` row by row. The bits of a row do not depend on the number of rows, unlike those of BLAS."""
    return sum(scores[:, k, None] * by[:, k] for k in range(scores.shape[1]))  # pyright: ignore[reportReturnType]


def _sobol(first: int, last: int, size: int, d: int, seed: int) -> Array:
    if first == 0 and size <= BLOCK:
        return _few_sobol(size, d, seed)[:last]
    key, own = getattr(_last, "sequence", ((0, 0), None))
    if own is None or key != (d, seed) or own.num_generated > first:
        own = qmc.Sobol(d, scramble=True, rng=seed)
    if first > own.num_generated:
        own.fast_forward(first - own.num_generated)
    points = _next(own, last - first)
    _last.sequence = ((d, seed), own)
    return points


@lru_cache(maxsize=4)
def _few_sobol(size: int, d: int, seed: int) -> Array:
    """Return all points of a few members in one call, because a slider requests them again and again."""
    points = _next(qmc.Sobol(d, scramble=True, rng=seed), size)
    points.setflags(write=False)
    return points


def _next(own: qmc.Sobol, count: int) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # SciPy warns if a chunk is not a power of 2
        return own.random(count) + HALF_CELL


#: Chunks mostly come in order: the sequence goes on from the last one, in each thread its own.
_last = threading.local()


@lru_cache(maxsize=2)
def _hypercube(size: int, d: int, seed: int) -> Array:
    return qmc.LatinHypercube(d, rng=seed).random(size)


def _latin_hypercube(first: int, last: int, size: int, d: int, seed: int) -> Array:
    return np.clip(_hypercube(size, d, seed)[first:last], EDGE, 1.0 - EDGE)


def _random(first: int, last: int, size: int, d: int, seed: int) -> Array:
    del size
    blocks = range(first // BLOCK, -(-last // BLOCK))
    every = [np.random.default_rng([seed, block]).random((BLOCK, d)) for block in blocks]
    start = blocks.start * BLOCK
    return np.clip(np.concatenate(every)[first - start : last - start], EDGE, 1.0 - EDGE)


#: Method -> points of the unit cube from first to before last, of so many in so many dimensions, by a seed.
SAMPLERS = {"sobol": _sobol, "latin-hypercube": _latin_hypercube, "random": _random}
