"""Designs: the values of the members of an ensemble."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from pneudrive.ensemble.distributions import Distribution, GridAxis, read_text
from pneudrive.ensemble.engine import SAMPLERS, Marginals, NormalCoordinates, Rows
from pneudrive.ensemble.variation import check_lengths
from pneudrive.errors import CommandError, nearest
from pneudrive.free.parameters import chosen
from pneudrive.identify.base import names_of
from pneudrive.identify.dynamic.fit import transforms_of
from pneudrive.identify.static.model import PRESSURE_NAMES
from pneudrive.identify.static.result import slope_key
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pneudrive.ensemble.variation import Variation
    from pneudrive.identify.base import Fit

#: Name -> distribution, or its text; pair of names -> correlation.
Distributions: TypeAlias = Mapping[str, Distribution | str]
Correlations: TypeAlias = Mapping[tuple[str, str], float]
#: Most members of a Latin hypercube, which is made as a whole.
MOST_HYPERCUBE = 10_000_000
#: Most members of a Sobol sequence: its points are multiples of 2^-30.
MOST_SOBOL = 1 << 30


@dataclass(frozen=True, repr=False)
class EnsembleDesign(Shown):
    """Values of the members of an ensemble.

    Made by `table`, `grid`, `sobol`, `latin_hypercube`, `random` and `posterior`. Quantities are as in the drive file
    (``"25 mm"``) or numbers in SI. Names are those that `pneudrive.identify` accepts as free, and ``initial.position``,
    ``initial.pressure_a`` and similar names for the start state.

    Examples
    --------
    >>> import pneudrive as pn
    >>> pn.EnsembleDesign.sobol({"cylinder.bore": "uniform(20 mm, 30 mm)", "friction.coulomb": "normal(30 N, 9 %)"}, 64)
    sobol design
      cylinder.bore     uniform(20 mm, 30 mm)
      friction.coulomb  normal(30 N, 9 %)
    """

    method: str
    each: Mapping[str, Any]
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
        """Members by explicit values: for each number, one value for each member.

        Parameters
        ----------
        columns : mapping
            Name -> values, all of one length.
        """
        return cls("table", dict(columns))

    @classmethod
    def grid(cls, axes: Mapping[str, Any]) -> EnsembleDesign:
        """All combinations of the values of each number. The last number varies fastest.

        Parameters
        ----------
        axes : mapping
            Name -> argument or result of `pneudrive.grid`.
        """
        return cls("grid", dict(axes))

    @classmethod
    def sobol(
        cls, distributions: Distributions, n: int, *, seed: int = 0, correlation: Correlations | None = None
    ) -> EnsembleDesign:
        """Points of a scrambled Sobol sequence: they fill the space evenly. `n` should be a power of 2.

        Parameters
        ----------
        distributions : mapping
            Name -> `Uniform`, `Triangular`, `Normal`, `Lognormal`, or a text such as ``"normal(30 N, 10 %)"``.
        n : int
            Members.
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
        """Draw a Latin hypercube: for each number, one member in each of n intervals of equal probability.

        Parameters
        ----------
        distributions, n, seed, correlation
            As for `sobol`, with n of at most 1e7. With a correlation, only the first number keeps its even intervals.
        """
        return cls("latin-hypercube", dict(distributions), n, seed, dict(correlation or {}))

    @classmethod
    def random(
        cls, distributions: Distributions, n: int, *, seed: int = 0, correlation: Correlations | None = None
    ) -> EnsembleDesign:
        """Members drawn independently.

        Parameters
        ----------
        distributions, n, seed, correlation
            As for `sobol`.
        """
        return cls("random", dict(distributions), n, seed, dict(correlation or {}))

    @classmethod
    def posterior(
        cls, fit: Fit, n: int, *, names: Sequence[str] | None = None, seed: int = 0, method: str = "sobol"
    ) -> EnsembleDesign:
        """Members with the uncertainty of a fit: jointly normal in the coordinates of its intervals.

        Values that the data do not determine, and values that were not free, keep the drive's value.

        Parameters
        ----------
        fit : Fit
            Any fit with a covariance, from `identify`, `fit_friction`, `fit_any_law` and others.
        n : int
            Members.
        names : sequence of str, optional
            Values that vary. Default: all that the data determine.
        seed : int
        method : str
            ``"sobol"``, ``"latin-hypercube"`` or ``"random"``.
        """
        determined = [name for name in fit.free if name in fit.values and name not in names_of(fit.undetermined)]
        for name in names or ():
            if name not in determined:
                raise CommandError(f"the fit has no covariance of {name}", remedy=nearest(name, determined))
        determined = [name for name in determined if names is None or name in names]
        if not determined or not fit.covariance.size:
            raise CommandError("the fit has no covariance of a value that the data determine")
        return cls(method, dict.fromkeys(determined, "as the fit"), n, seed, fit=fit)

    @property
    def names(self) -> list[str]:
        """Names of the numbers that vary, as in the drive file."""
        if self.fit is None:
            return list(self.each)
        return [_name_in_drive(name) for name in self.each]

    def rows(self, variation: Variation) -> Rows:
        """Return the rows in SI.

        Parameters
        ----------
        variation : Variation
            Variation of a drive, by `names`.

        Raises
        ------
        CommandError
            A quantity cannot be read, lengths are unequal, or the correlations contradict each other.
        """
        read = {name: variation.reader(name) for name in variation.names}
        if self.method == "table":
            columns = {name: _column(values, read[name].value) for name, values in self.each.items()}
            check_lengths(columns)
            return Rows.table(list(columns), np.column_stack(list(columns.values())))
        if self.method == "grid":
            return Rows.grid({name: axis.in_si(read[name].value) for name, axis in self.each.items()})
        size = self._size()
        if self.fit is not None:
            return Rows.sampled(self.method, size, self.seed, self._posterior(variation))
        each = {name: _distribution(name, one).in_si(read[name]) for name, one in self.each.items()}
        return Rows.sampled(self.method, size, self.seed, Marginals(each, self._correlations()))

    def _size(self) -> int:
        most = {"latin-hypercube": MOST_HYPERCUBE, "sobol": MOST_SOBOL}.get(self.method)
        if self.method not in SAMPLERS:
            raise CommandError(f'there is no design "{self.method}"', remedy=nearest(self.method, SAMPLERS))
        if self.members is None:
            raise CommandError("vary has distributions, and the number of members is missing", remedy="Give n.")
        if isinstance(self.members, bool) or not 1 <= self.members <= (most or self.members):
            raise CommandError(f"n = {self.members} members is out of bounds", rule=f"1 to {most or 'any number'}")
        return int(self.members)

    def _correlations(self) -> np.ndarray | None:
        if not self.correlation:
            return None
        names = list(self.each)
        matrix = np.eye(len(names))
        for pair, value in self.correlation.items():
            for name in pair:
                if name not in names:
                    raise CommandError(f"correlation: {name} does not vary", remedy=nearest(name, names))
            if not -1.0 < value < 1.0:
                raise CommandError(f"correlation of {' and '.join(pair)} = {value}", rule="between -1 and 1")
            i, j = (names.index(name) for name in pair)
            matrix[i, j] = matrix[j, i] = value
        if np.linalg.eigvalsh(matrix)[0] <= 0.0:
            raise CommandError("the correlations contradict each other", rule="their matrix is positive definite")
        return matrix

    def _posterior(self, variation: Variation) -> NormalCoordinates:
        assert self.fit is not None
        if variation.drive.system.names is None:
            raise CommandError("a fit is of a drive, and a circuit varies", remedy="Give distributions.")
        start = variation.drive.replace(
            {
                number.name: number.written(self.fit.values[name])
                for number, name in zip(variation.numbers, self.each, strict=True)
            }
        )
        # Next to zero, a value itself is normal and not its logarithm: it is folded at zero.
        errors = [self.fit.standard_errors.get(name, 0.0) for name in self.each]
        every = list(zip(chosen(start, self.names), errors, strict=True))
        folded = tuple(k for k, (p, error) in enumerate(every) if np.isfinite(p.lower) and error > p.value - p.lower)
        parameters = [replace(p, lower=-np.inf, size=e) if k in folded else p for k, (p, e) in enumerate(every)]
        scales = transforms_of(parameters, [], start)
        place = [self.fit.free.index(name) for name in self.each]
        centre = scales.internal([p.value for p in parameters])
        inverse = np.linalg.inv(scales.jacobian(centre))
        covariance = inverse @ self.fit.covariance[np.ix_(place, place)] @ inverse.T
        source = {"fit": self.fit.KIND, "values": [p.value for p in parameters]}
        return NormalCoordinates(tuple(self.names), scales, centre, covariance, source, folded)


def design_of(
    vary: Mapping[str, Any] | EnsembleDesign, n: int | None = None, seed: int | None = None, method: str = "sobol"
) -> EnsembleDesign:
    """Return the design that a mapping describes: a table of values, a grid, or distributions.

    Raises
    ------
    CommandError
        It mixes these, or its number of members differs from that of the values.
    """
    if isinstance(vary, EnsembleDesign):
        given = (n is not None and n != vary.members) or (seed is not None and seed != vary.seed)
        if given:
            raise CommandError("a design has its own n and seed", remedy="Leave n and seed out.")
        return vary
    if not isinstance(vary, Mapping) or not vary:
        remedy = 'Give vary={"cylinder.bore": [...]}, a distribution for each number, or a pn.EnsembleDesign.'
        raise CommandError(f"vary is {type(vary).__name__ if vary else 'empty'}", remedy=remedy)
    each = {name: read_text(value) if isinstance(value, str) else value for name, value in vary.items()}
    for name, one in each.items():
        if not isinstance(one, Distribution | GridAxis) and not np.ndim(one):
            raise CommandError(f"vary: {name} = {one} is one value", rule="a list of values, a distribution or a grid")
    kinds = {
        "distributions" if isinstance(one, Distribution) else "a grid" if isinstance(one, GridAxis) else "values"
        for one in each.values()
    }
    if len(kinds) > 1:
        raise CommandError(
            f"vary mixes {' and '.join(sorted(kinds))}",
            rule="all numbers by distributions, all by grid(...), or one value of each for each member",
        )
    (kind,) = kinds
    if kind == "distributions":
        return EnsembleDesign(method, each, n, seed or 0)
    design = EnsembleDesign("grid" if kind == "a grid" else "table", each)
    sizes = {name: len(one) for name, one in each.items()} if kind == "values" else {}
    if n is not None and kind == "values" and set(sizes.values()) != {n}:
        raise CommandError(f"n = {n} does not fit the values of vary", rule="leave out n if values are given")
    if n is not None and kind == "a grid":
        raise CommandError("a grid has one member for each combination", remedy="Leave n out.")
    return design


def _name_in_drive(name: str) -> str:
    """Return the name of a fit's value in a drive file."""
    if name in PRESSURE_NAMES:
        return slope_key(name)
    return name if "." in name else f"friction.{name}"


def _distribution(name: str, one: Any) -> Distribution:  # noqa: ANN401
    made = read_text(one) if isinstance(one, str) else one
    if not isinstance(made, Distribution):
        raise CommandError(f"vary: {name} has no distribution", remedy='For instance "normal(30 N, 10 %)".')
    return made


def _column(values: Any, read: Any) -> np.ndarray:  # noqa: ANN401
    if isinstance(values, np.ndarray) and values.dtype.kind in "iuf" and values.ndim == 1:
        return values.astype(np.float64)
    if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray) or np.ndim(values) != 1:
        raise CommandError(f"vary has {type(values).__name__} in place of a list of values")
    return np.array([read(value) for value in values], dtype=np.float64)


def _said(value: object) -> str:
    if isinstance(value, str | Distribution):
        return str(value)
    count = value.count or len(value.values) if isinstance(value, GridAxis) else len(value)  # type: ignore[arg-type]
    return f"{count} values"
