"""Distributions of single numbers, and designs, which give the values of these numbers for all members."""

from __future__ import annotations

import hashlib
import math
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache, partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr, ndtri
from scipy.stats import qmc
from typing_extensions import Self

from pneudrive.arrays import Array, Columns, Keyed, Plain
from pneudrive.ensemble.variation import QuantityReader, Variation
from pneudrive.errors import CommandError, nearest
from pneudrive.free.parameters import find
from pneudrive.identify.base import Fit, names_of
from pneudrive.identify.dynamic.fit import transforms_of
from pneudrive.identify.static.model import PRESSURE_NAMES
from pneudrive.identify.static.result import slope_key
from pneudrive.repr_tables import Shown
from pneudrive.simulation.simulate import MOST_WHOLE, whole_number

# --- Variation of one number of a drive: distributions and grid values, in SI or as written quantities.


@dataclass(frozen=True)
class Distribution:
    """Distribution of one number. Its parameters are quantities as in the drive file, or numbers in SI."""

    def in_si(self, read: QuantityReader) -> Self:
        """Return the distribution with all numbers in SI.

        Raises
        ------
        CommandError
            A quantity cannot be read, or the numbers do not define a distribution.
        """
        own = self._read(read)
        for rule, holds in own._rules().items():
            if not holds:
                raise CommandError(f"{own} is not a distribution", rule=rule)
        return own

    def quantile(self, share: Array) -> Array:
        """Return the quantiles at the probabilities `share`, in SI."""
        raise NotImplementedError

    def _read(self, read: QuantityReader) -> Self:
        """Return the distribution in SI, without a check."""
        return replace(self, **{field.name: read.value(getattr(self, field.name)) for field in fields(self)})

    def _rules(self) -> dict[str, bool]:
        """Return the rules for the numbers of the distribution, and whether each rule holds."""
        raise NotImplementedError

    def __str__(self) -> str:
        """Write the distribution as on the command line."""
        return f"{type(self).__name__.lower()}({', '.join(f'{getattr(self, field.name)}' for field in fields(self))})"


@dataclass(frozen=True)
class Uniform(Distribution):
    """Uniform distribution from `low` to `high`.

    Parameters
    ----------
    low, high : str or float
    """

    low: Any
    high: Any

    def _rules(self) -> dict[str, bool]:
        return {"low < high": -math.inf < self.low < self.high < math.inf}

    def quantile(self, share: Array) -> Array:
        """Return ``low + share (high - low)``."""
        return self.low + share * (self.high - self.low)


@dataclass(frozen=True)
class Triangular(Distribution):
    """Distribution whose density rises from `low` to `mode` and falls to `high`.

    Parameters
    ----------
    low, mode, high : str or float
    """

    low: Any
    mode: Any
    high: Any

    def _rules(self) -> dict[str, bool]:
        is_ordered = -math.inf < self.low <= self.mode <= self.high < math.inf
        return {"low <= mode <= high, low < high": is_ordered and self.low < self.high}

    def quantile(self, share: Array) -> Array:
        """Return the inverse of the distribution function, with one square root on each side of the mode."""
        whole = self.high - self.low
        below = self.low + np.sqrt(share * whole * (self.mode - self.low))
        above = self.high - np.sqrt((1.0 - share) * whole * (self.high - self.mode))
        return np.where(share * whole < self.mode - self.low, below, above)


@dataclass(frozen=True)
class Normal(Distribution):
    """Normal distribution.

    Parameters
    ----------
    mean : str or float
    sd : str or float
        Standard deviation. ``"10 %"`` is a fraction of the mean. The unit of the mean must then have a true zero: not
        degC or gauge pressure.
    """

    mean: Any
    sd: Any

    def _read(self, read: QuantityReader) -> Self:
        mean = read.value(self.mean)
        if "%" in str(self.sd) and _FROM_ELSEWHERE.search(str(self.mean)):
            raise CommandError.of("ensemble.share", distribution=self, mean=self.mean)
        return replace(self, mean=mean, sd=read.width(self.sd, mean))

    def _rules(self) -> dict[str, bool]:
        return {"sd > 0": math.isfinite(self.mean) and 0.0 < self.sd < math.inf}

    def quantile(self, share: Array) -> Array:
        """Return ``mean + sd z`` for the quantile z of the standard normal distribution."""
        return self.mean + self.sd * ndtri(share)


@dataclass(frozen=True)
class Lognormal(Normal):
    """Distribution of a positive number whose logarithm is normal.

    Parameters
    ----------
    mean, sd : str or float
        Mean and standard deviation of the number itself, not of its logarithm.
    """

    def _rules(self) -> dict[str, bool]:
        return super()._rules() | {"mean > 0": self.mean > 0.0}

    def quantile(self, share: Array) -> Array:
        """Return ``exp(mu + s z)`` for the quantile z.

        Here ``s^2 = ln(1 + sd^2 / mean^2)`` and ``mu = ln(mean) - s^2 / 2``.
        """
        s2 = math.log1p((self.sd / self.mean) ** 2)
        return np.exp(math.log(self.mean) - 0.5 * s2 + math.sqrt(s2) * ndtri(share))


@dataclass(frozen=True)
class GridAxis:
    """Values of one number in a grid of all combinations. See `grid`."""

    values: tuple[Any, ...]
    count: int | None = None

    def in_si(self, read: Callable[[object], float]) -> Array:
        """Return the values in SI.

        Raises
        ------
        CommandError
            A quantity cannot be read.
        """
        if self.count is None:
            return np.array([read(value) for value in self.values])
        low, high = map(read, self.values)
        return np.linspace(low, high, self.count)


def grid(*values: Any) -> GridAxis:  # noqa: ANN401 - quantities or numbers
    """Return the values of one number in a grid of all combinations.

    Parameters
    ----------
    *values : str or float
        Values as quantities of the drive file or in SI, or a range with its number of values, ``grid("20 mm .. 32 mm",
        7)``.

    Returns
    -------
    GridAxis
        For `vary` of `pneudrive.simulate_many`.

    Raises
    ------
    CommandError
        There is no value, or the number of values in a range is missing.

    Examples
    --------
    >>> grid("20 mm .. 32 mm", 7).count, grid("20 mm", "25 mm").values
    (7, ('20 mm', '25 mm'))
    """
    if len(values) == 1 and isinstance(values[0], Sequence | np.ndarray) and not isinstance(values[0], str):
        values = tuple(values[0])
    if values and isinstance(values[0], str) and ".." in values[0]:
        low, _, high = values[0].partition("..")
        try:
            (count,) = (int(str(value)) for value in values[1:])
        except ValueError:
            count = 0
        if not count >= 2:
            raise CommandError.of("ensemble.grid", text=values[0])
        return GridAxis((low.strip(), high.strip()), count)
    if not values:
        raise CommandError("the grid is empty", remedy='Write grid("20 mm", "25 mm") or grid("20 mm .. 32 mm", 7).')
    return GridAxis(values)


#: Word -> function that makes a distribution or a grid from the texts in brackets.
WORDS: dict[str, Callable[..., Any]] = {
    **{kind.__name__.lower(): kind for kind in (Uniform, Triangular, Normal, Lognormal)},
    "grid": grid,
}
#: Units whose zero is not the zero of the quantity.
_FROM_ELSEWHERE = re.compile(r"gauge|degC|degF|°C|°F|[Cc]elsius|[Ff]ahrenheit")
_CALL = re.compile(r"\s*([a-z][\w-]*)\s*\((.*)\)\s*", re.DOTALL)


def read_text(text: str) -> Any:  # noqa: ANN401 - a distribution, an axis or a list of texts
    """Read the variation of a number: ``normal(30 N, 10 %)``, ``grid(20 mm .. 32 mm, 7)``, ``20 mm, 25 mm``.

    Raises
    ------
    CommandError
        The name of the distribution is unknown, or the number of quantities is wrong.

    Examples
    --------
    >>> read_text("uniform(20 mm, 30 mm)"), read_text("20 mm, 25 mm")
    (Uniform(low='20 mm', high='30 mm'), ['20 mm', '25 mm'])
    """
    called = _CALL.fullmatch(text)
    entries = [entry.strip() for entry in (called[2] if called else text).split(",") if entry.strip()]
    if not called:
        return entries
    make = WORDS.get(called[1])
    if make is None:
        raise CommandError(f'"{text}" is not a distribution', remedy=nearest(called[1], WORDS))
    try:
        return make(*entries)
    except TypeError:
        takes = ", ".join(field.name for field in fields(make)) if isinstance(make, type) else "values"
        raise CommandError(f'"{text}" has {len(entries)} entries', rule=f"{called[1]}({takes})") from None


# --- The rows of a design in SI: row k is a pure function of the design and k.

#: Half the spacing of scipy's Sobol points (2^-30). The offset keeps points away from the faces of the cube.
HALF_CELL = 2.0**-31
#: Number of rows of a random design that one generator draws.
BLOCK = 4096
#: Number of rows that are checked together.
CHECKED_ROWS = 65536
#: Smallest distance of a probability from 0 and 1.
EDGE = 2.0**-53


@dataclass(frozen=True, eq=False)
class Rows:
    """The values of all members in SI.

    Attributes
    ----------
    names : tuple of str
        Names of the numbers that vary, as in the drive file.
    size : int
        Number of members.
    about : dict
        Description of the design as plain data. Two designs with the same description have the same rows.
    take : callable
        Function of (first, last). It returns the values of members first to last - 1, shape (members, names).
    quantiles : callable, optional
        Function that maps points of the unit cube to values, for a sampled design.
    """

    names: tuple[str, ...]
    size: int
    about: Plain
    take: Callable[[int, int], Array]
    quantiles: Callable[[Array], Array] | None = None

    @classmethod
    def table(cls, names: Sequence[str], values: Array) -> Rows:
        """Return rows with these values, shape (members, names)."""
        digest = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
        about = {"design": "table", "names": list(names), "members": len(values), "sha256": digest}
        return cls(tuple(names), len(values), about, partial(_part, values))

    @classmethod
    def grid(cls, axes: Columns) -> Rows:
        """Return all combinations of the values of each number. The last number varies fastest."""
        shape = tuple(len(axis) for axis in axes.values())

        def points(first: int, last: int) -> Array:
            places = np.unravel_index(np.arange(first, last), shape)
            return np.column_stack([axis[at] for axis, at in zip(axes.values(), places, strict=True)])

        about = {"design": "grid", "axes": {name: axis.tolist() for name, axis in axes.items()}}
        return cls(tuple(axes), int(np.prod(shape, dtype=object)), about, points)

    def wider(self, other: Rows) -> Rows:
        """Extend each row by the row of another design with the same index."""

        def points(first: int, last: int) -> Array:
            return np.column_stack([self.take(first, last), other.take(first, last)])

        return Rows((*self.names, *other.names), self.size, {**self.about, "beside": other.about}, points)

    def check(self, variation: Variation) -> None:
        """Reject invalid rows; see `Variation.check`."""
        for first in range(0, self.size, CHECKED_ROWS):
            variation.check(self.take(first, min(first + CHECKED_ROWS, self.size)), first)


def _part(values: Array, first: int, last: int) -> Array:
    return values[first:last]


def _mixed(scores: Array, by: Array) -> Array:
    """Return ``scores @ by.T``, computed row by row. With BLAS, rounding would depend on the number of rows."""
    return sum(scores[:, k, None] * by[:, k] for k in range(scores.shape[1]))  # pyright: ignore[reportReturnType]


def _sobol(first: int, last: int, size: int, d: int, seed: int) -> Array:
    sequence = qmc.Sobol(d, scramble=True, rng=seed)
    if first:
        sequence.fast_forward(first)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # SciPy warns if a chunk is not a power of 2
        return sequence.random(last - first) + HALF_CELL


@lru_cache(maxsize=2)
def _hypercube(size: int, d: int, seed: int) -> Array:
    return np.clip(qmc.LatinHypercube(d, rng=seed).random(size), EDGE, 1.0 - EDGE)


def _random(first: int, last: int, size: int, d: int, seed: int) -> Array:
    del size
    blocks = range(first // BLOCK, -(-last // BLOCK))
    every = [np.random.default_rng([seed, block]).random((BLOCK, d)) for block in blocks]
    start = blocks.start * BLOCK
    return np.clip(np.concatenate(every)[first - start : last - start], EDGE, 1.0 - EDGE)


#: Method -> function (first, last, size, dimensions, seed) that returns points in the unit cube.
SAMPLERS = {"sobol": _sobol, "latin-hypercube": lambda a, b, *of: _hypercube(*of)[a:b], "random": _random}


# --- Designs: the values of the members of an ensemble.

#: Name -> distribution, or its text; pair of names -> correlation.
Distributions: TypeAlias = Mapping[str, Distribution | str]
Correlations: TypeAlias = Mapping[tuple[str, str], float]
#: Largest number of members of a Latin hypercube, which must fit into memory.
MOST_HYPERCUBE = 10_000_000
#: Largest number of members of a Sobol sequence, whose points are multiples of 2^-30.
MOST_SOBOL = 1 << 30


@dataclass(frozen=True, repr=False)
class EnsembleDesign(Shown):
    """Values of the members of an ensemble.

    A design is made by `table`, `grid`, `sobol`, `latin_hypercube`, `random` or `posterior`. Quantities are as in the
    drive file (``"25 mm"``) or numbers in SI. Names are those of free values in `pneudrive.identify`, and
    ``initial.position``, ``initial.pressure_a`` and similar names for the start state.

    Examples
    --------
    >>> import pneudrive as pn
    >>> pn.EnsembleDesign.sobol({"cylinder.bore": "uniform(20 mm, 30 mm)", "friction.coulomb": "normal(30 N, 9 %)"}, 64)
    sobol design
      cylinder.bore     uniform(20 mm, 30 mm)
      friction.coulomb  normal(30 N, 9 %)
    """

    method: str
    each: Keyed
    members: int | None = None
    seed: int = 0
    correlation: Correlations = field(default_factory=dict)
    fit: Fit | None = None

    def __str__(self) -> str:
        """Return a line for each number that varies."""
        lines = [f"  {name}  {_said(value)}" for name, value in self.each.items()]
        return "\n".join([f"{self.method} design", *lines])

    @classmethod
    def table(cls, columns: Mapping[str, ArrayLike]) -> EnsembleDesign:
        """Return a design with explicit values: for each number, one value per member.

        Parameters
        ----------
        columns : mapping
            Name -> values. All names have the same number of values.
        """
        return cls("table", dict(columns))

    @classmethod
    def grid(cls, axes: Keyed) -> EnsembleDesign:
        """Return a design with all combinations of the values of each number. The last number varies fastest.

        Parameters
        ----------
        axes : mapping
            Name -> argument or result of `pneudrive.grid`.
        """
        return cls("grid", {name: axis if isinstance(axis, GridAxis) else grid(axis) for name, axis in axes.items()})

    @classmethod
    def sobol(
        cls, distributions: Distributions, n: int, *, seed: int = 0, correlation: Correlations | None = None
    ) -> EnsembleDesign:
        """Draw members by a scrambled Sobol sequence, which fills the space evenly. `n` should be a power of 2.

        Parameters
        ----------
        distributions : mapping
            Name -> `Uniform`, `Triangular`, `Normal`, `Lognormal`, or a text such as ``"normal(30 N, 10 %)"``.
        n : int
            Number of members.
        seed : int
            Random seed of the scrambling.
        correlation : mapping, optional
            Pair of names -> correlation of their normal scores. For normal distributions, this is the correlation of
            the values.
        """
        return cls("sobol", dict(distributions), n, seed, dict(correlation or {}))

    @classmethod
    def latin_hypercube(
        cls, distributions: Distributions, n: int, *, seed: int = 0, correlation: Correlations | None = None
    ) -> EnsembleDesign:
        """Draw a Latin hypercube: for each number, each of n intervals of equal probability contains one member.

        Parameters
        ----------
        distributions, n, seed, correlation
            As for `sobol`, with n of at most 1e7. With correlations, only the first number keeps one member per
            interval.
        """
        return replace(cls.sobol(distributions, n, seed=seed, correlation=correlation), method="latin-hypercube")

    @classmethod
    def random(
        cls, distributions: Distributions, n: int, *, seed: int = 0, correlation: Correlations | None = None
    ) -> EnsembleDesign:
        """Draw random members, independently of each other.

        Parameters
        ----------
        distributions, n, seed, correlation
            As for `sobol`.
        """
        return replace(cls.sobol(distributions, n, seed=seed, correlation=correlation), method="random")

    @classmethod
    def posterior(
        cls,
        fit: Fit,
        n: int,
        *,
        names: Sequence[str] | None = None,
        seed: int = 0,
    ) -> EnsembleDesign:
        """Draw correlated members from the posterior of a fit.

        The distribution is normal in the internal coordinates of the fit. Numbers that were not free, or that the data
        do not determine, keep the value of the drive.

        Parameters
        ----------
        fit : Fit
            Any fit with a covariance, from `identify`, `fit_friction`, `fit_any_law` and others.
        n : int
            Number of members.
        names : sequence of str, optional
            Names of the numbers that vary. Default: all numbers that the data determine.
        seed : int
        """
        determined = [name for name in fit.free if name in fit.values and name not in names_of(fit.undetermined)]
        for name in names or ():
            if name not in determined:
                raise CommandError(f"the fit has no covariance of {name}", remedy=nearest(name, determined))
        determined = [name for name in determined if names is None or name in names]
        if not determined or not fit.covariance.size:
            raise CommandError("this fit has no covariance of the determined values")
        return cls("sobol", dict.fromkeys(determined, "as the fit"), n, seed, fit=fit)

    @property
    def names(self) -> list[str]:
        """Names of the numbers that vary, as in the drive file."""
        if self.fit is None:
            return list(self.each)
        within = {name: name if "." in name else f"friction.{name}" for name in self.each}
        return [slope_key(name) if name in PRESSURE_NAMES else key for name, key in within.items()]

    def rows(self, variation: Variation) -> Rows:
        """Return the rows in SI.

        Parameters
        ----------
        variation : Variation
            Variation of a drive. Its first numbers are those in `names`.

        Raises
        ------
        CommandError
            A quantity cannot be read, numbers have different counts of values, or the correlation matrix is not
            positive definite.
        """
        if self.method == "table":
            columns = {name: _column(values, variation.reader(name).value) for name, values in self.each.items()}
            lengths = {name: len(column) for name, column in columns.items()}
            if len(set(lengths.values())) > 1:
                said = ", ".join(f"{name}: {length}" for name, length in lengths.items())
                what = f"the columns of vary have unequal lengths ({said})"
                raise CommandError(what, rule="one value for each member")
            if not all(lengths.values()):
                raise CommandError("vary gives no members", rule="at least one value of each number")
            return Rows.table(list(columns), np.column_stack(list(columns.values())))
        if self.method == "grid":
            return Rows.grid({name: axis.in_si(variation.reader(name).value) for name, axis in self.each.items()})
        if self.method not in SAMPLERS:
            raise CommandError(f'there is no design "{self.method}"', remedy=nearest(self.method, SAMPLERS))
        if self.members is None:
            raise CommandError("vary has distributions, but the number of members is missing", remedy="Give n.")
        whole_number("seed", self.seed, 0)
        most = {"latin-hypercube": MOST_HYPERCUBE, "sobol": MOST_SOBOL}.get(self.method, MOST_WHOLE)
        size, names = whole_number("n", self.members, 1, most), tuple(self.names)
        quantiles, of = self._marginals(variation) if self.fit is None else self._posterior(variation)

        def points(first: int, last: int) -> Array:
            return quantiles(SAMPLERS[self.method](first, last, size, len(names), self.seed))

        about = {"design": self.method, "members": size, "seed": self.seed, **of}
        return Rows(names, size, about, points, quantiles)

    def _marginals(self, variation: Variation) -> tuple[Callable[[Array], Array], Plain]:
        """Return a function from points of the unit cube to values, and the description of the distributions.

        The normal scores of the numbers may be correlated.
        """
        each: dict[str, Distribution] = {}
        for name, one in self.each.items():
            made = read_text(one) if isinstance(one, str) else one
            if not isinstance(made, Distribution):
                remedy = 'Write for instance "normal(30 N, 10 %)".'
                raise CommandError(f"vary: {name} has no distribution", remedy=remedy)
            each[name] = made.in_si(variation.reader(name))
        names = list(each)
        matrix = np.eye(len(names))
        for pair, value in self.correlation.items():
            for name in pair:
                if name not in names:
                    raise CommandError(f"correlation: {name} does not vary", remedy=nearest(name, names))
            if not -1.0 < value < 1.0:
                raise CommandError(f"the correlation of {' and '.join(pair)} is {value}", rule="between -1 and 1")
            i, j = (names.index(name) for name in pair)
            matrix[i, j] = matrix[j, i] = value
        if np.linalg.eigvalsh(matrix)[0] <= 0.0:
            raise CommandError("the correlations contradict each other", rule="the matrix must be positive definite")

        def values(cube: Array) -> Array:
            if self.correlation:
                scores = _mixed(ndtri(cube), np.linalg.cholesky(matrix).astype(float))
                cube = np.clip(ndtr(scores), EDGE, 1.0 - EDGE)
            return np.column_stack([one.quantile(share) for one, share in zip(each.values(), cube.T, strict=True)])

        texts = {name: str(one) for name, one in each.items()}
        return values, {"distributions": texts, "correlation": matrix.tolist() if self.correlation else None}

    def _posterior(self, variation: Variation) -> tuple[Callable[[Array], Array], Plain]:
        """Return a function from points of the unit cube to values, and the description of the posterior of a fit.

        The distribution is normal in the internal coordinates of the fit, so that positive values stay positive.
        """
        assert self.fit is not None
        if variation.drive.system.names is None:
            raise CommandError("a circuit cannot take its values from a fit of a drive", remedy="Give distributions.")
        start = variation.drive.replace(
            {
                number.name: number.written(self.fit.values[name])
                for number, name in zip(variation.numbers, self.each, strict=False)
            }
        )
        # Close to zero, the value is normal instead of its logarithm. Negative values are folded at zero.
        errors = [self.fit.standard_errors.get(name, 0.0) for name in self.each]
        every = list(zip(find(start, self.names, shifts=True), errors, strict=True))
        near_zero = [np.isfinite(p.lower) and error > p.value - p.lower for p, error in every]
        folded = [k for k, is_near in enumerate(near_zero) if is_near]
        parameters = [replace(p, lower=-np.inf, size=e) if k in folded else p for k, (p, e) in enumerate(every)]
        scales = transforms_of(parameters, [], start)
        place = [self.fit.free.index(name) for name in self.each]
        centre = scales.internal([p.value for p in parameters])
        inverse = np.linalg.inv(scales.jacobian(centre))
        covariance = inverse @ self.fit.covariance[np.ix_(place, place)] @ inverse.T
        variances, axes = np.linalg.eigh(covariance)
        by_score = (axes * np.sqrt(np.maximum(variances, 0.0))).astype(float)

        def values(cube: Array) -> Array:
            found = scales.natural(centre + _mixed(ndtri(cube), by_score))
            found[:, folded] = np.abs(found[:, folded])
            return found

        about = {"names": self.names, "covariance": covariance.tolist(), "fit": self.fit.KIND}
        return values, {"posterior": about | {"values": [p.value for p in parameters]}}


def design_of(vary: Keyed | EnsembleDesign, n: int | None = None, seed: int | None = None) -> EnsembleDesign:
    """Return the design that a mapping describes: a table of values, a grid, or distributions.

    Raises
    ------
    CommandError
        The mapping mixes these forms, or the number of members differs from the number of values.
    """
    if isinstance(vary, EnsembleDesign):
        if n not in (None, vary.members) or seed not in (None, vary.seed):
            raise CommandError("the design already has n and seed", remedy="Leave out n and seed.")
        return vary
    if not isinstance(vary, Mapping) or not vary:
        raise CommandError.of("ensemble.vary", kind=f"of type {type(vary).__name__}" if vary else "empty")
    each = {name: read_text(value) if isinstance(value, str) else value for name, value in vary.items()}
    for name, one in each.items():
        if not isinstance(one, Distribution | GridAxis) and not np.ndim(one):
            raise CommandError(f"vary: {name} = {one} is one value", rule="a list of values, a distribution or a grid")
    kinds = {
        "distributions" if isinstance(one, Distribution) else "a grid" if isinstance(one, GridAxis) else "values"
        for one in each.values()
    }
    if len(kinds) > 1:
        raise CommandError.of("ensemble.mixed", kinds=" and ".join(sorted(kinds)))
    if kinds == {"distributions"}:
        return EnsembleDesign("sobol", each, n, seed or 0)
    if kinds == {"a grid"}:
        if n is not None:
            raise CommandError("a grid has one member for each combination", remedy="Leave out n.")
        return EnsembleDesign("grid", each)
    if n is not None and {len(one) for one in each.values()} != {n}:
        raise CommandError(f"n = {n} is not the number of values in vary", rule="leave out n if values are given")
    return EnsembleDesign("table", each)


def _column(values: Any, read: Any) -> np.ndarray:  # noqa: ANN401
    if isinstance(values, np.ndarray) and values.dtype.kind in "iuf" and values.ndim == 1:
        return values.astype(float)
    if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray) or np.ndim(values) != 1:
        raise CommandError(f"vary has {type(values).__name__} instead of a list of values")
    return np.array([read(value) for value in values], dtype=float)


def _said(value: object) -> str:
    if isinstance(value, str | Distribution):
        return str(value)
    count = value.count or len(value.values) if isinstance(value, GridAxis) else len(value)  # type: ignore[arg-type]
    return f"{count} values"
