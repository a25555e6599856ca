"""The rows of a design in SI: row k is a pure function of the design and k."""

from __future__ import annotations

import hashlib
import threading
import warnings
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from pneudrive.estimate.sensitivity import HALF_CELL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.ensemble.distributions import Distribution
    from pneudrive.estimate.transforms import Transforms

    Array = NDArray[np.float64]

#: Rows of a random design that one generator makes.
BLOCK = 4096
#: The nearest to 0 and to 1 that a share comes.
EDGE = 2.0**-53


class Rows(Protocol):
    """The values of all members, SI, in the order of `names`."""

    @property
    def names(self) -> tuple[str, ...]:
        """Numbers that vary, as in the drive file."""
        ...

    @property
    def size(self) -> int:
        """Number of members."""
        ...

    def take(self, first: int, last: int) -> Array:
        """Return the rows of the members from `first` to before `last`, shape (members, names)."""
        ...

    def part(self, first: int, last: int) -> Rows:
        """Return the source of these rows, without other data."""
        ...

    def about(self) -> dict[str, Any]:
        """Describe the design as plain data. Two designs with the same description have the same rows."""
        ...


@dataclass(frozen=True, eq=False)
class TableRows:
    """Rows as given. Rows before the member `begin` are left out."""

    names: tuple[str, ...]
    given: Array
    begin: int = 0

    @property
    def size(self) -> int:
        """Number of members."""
        return self.begin + len(self.given)

    def take(self, first: int, last: int) -> Array:
        """Return rows."""
        return self.given[first - self.begin : last - self.begin]

    def part(self, first: int, last: int) -> TableRows:
        """Return only these rows."""
        return TableRows(self.names, self.take(first, last), first)

    def about(self) -> dict[str, Any]:
        """Describe the design."""
        digest = hashlib.sha256(np.ascontiguousarray(self.given).tobytes()).hexdigest()
        return {"design": "table", "names": list(self.names), "members": self.size, "sha256": digest}


@dataclass(frozen=True, eq=False)
class WiderRows:
    """Rows of a design, each followed by the given values of its member."""

    design: Rows
    beside: TableRows

    @property
    def names(self) -> tuple[str, ...]:
        """Numbers that vary."""
        return (*self.design.names, *self.beside.names)

    @property
    def size(self) -> int:
        """Number of members."""
        return self.design.size

    def take(self, first: int, last: int) -> Array:
        """Return rows."""
        return np.column_stack([self.design.take(first, last), self.beside.take(first, last)])

    def part(self, first: int, last: int) -> WiderRows:
        """Return the source of these rows."""
        return WiderRows(self.design.part(first, last), self.beside.part(first, last))

    def about(self) -> dict[str, Any]:
        """Describe the design."""
        return {**self.design.about(), "beside": self.beside.about()}


@dataclass(frozen=True, eq=False)
class GridRows:
    """All combinations of the values of each number. The last number varies fastest."""

    axes: dict[str, Array]

    @property
    def names(self) -> tuple[str, ...]:
        """Numbers that vary."""
        return tuple(self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Values of each number."""
        return tuple(len(axis) for axis in self.axes.values())

    @property
    def size(self) -> int:
        """Number of members."""
        return int(np.prod(self.shape, dtype=object))

    def take(self, first: int, last: int) -> Array:
        """Return rows."""
        places = np.unravel_index(np.arange(first, min(last, self.size)), self.shape)
        return np.column_stack([axis[at] for axis, at in zip(self.axes.values(), places, strict=True)])

    def part(self, first: int, last: int) -> GridRows:
        """Return itself, because it needs little data."""
        del first, last
        return self

    def about(self) -> dict[str, Any]:
        """Describe the design."""
        return {"design": "grid", "axes": {name: axis.tolist() for name, axis in self.axes.items()}}


@dataclass(frozen=True, eq=False)
class SampledRows:
    """Points in the unit cube, by distributions or by the posterior of a fit.

    Attributes
    ----------
    method : str
        ``"sobol"`` (scrambled), ``"latin-hypercube"`` or ``"random"``.
    size : int
    seed : int
    shape : Marginals or NormalCoordinates
        Mapping from the cube to values.
    """

    method: str
    size: int
    seed: int
    shape: Marginals | NormalCoordinates

    @property
    def names(self) -> tuple[str, ...]:
        """Numbers that vary."""
        return self.shape.names

    def take(self, first: int, last: int) -> Array:
        """Return rows."""
        last = min(last, self.size)
        return self.shape.values(SAMPLERS[self.method](first, last, self.size, len(self.names), self.seed))

    def part(self, first: int, last: int) -> SampledRows:
        """Return itself, because it needs little data."""
        del first, last
        return self

    def about(self) -> dict[str, Any]:
        """Describe the design."""
        return {"design": self.method, "members": self.size, "seed": self.seed, **self.shape.about()}


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
    """Values whose coordinates (`pneudrive.estimate.transforms`) are jointly normal: the posterior of a fit.

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
