"""Variation of one number of a drive: distributions and grid values, in SI or as written quantities."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.special import ndtri

from pneudrive.errors import CommandError, nearest

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray
    from typing_extensions import Self

    from pneudrive.ensemble.variation import QuantityReader

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Distribution:
    """A distribution of one number. Its parameters are quantities as in the drive file, or numbers in SI."""

    WORD: ClassVar[str]

    def in_si(self, read: QuantityReader) -> Self:
        """Return the same with all numbers in SI.

        Raises
        ------
        CommandError
            A quantity cannot be read, or the numbers do not make a distribution.
        """
        own = self._read(read)
        for rule, holds in own._rules().items():
            if not holds:
                raise CommandError(f"{own} is not a distribution", rule=rule)
        return own

    def quantile(self, share: Array) -> Array:
        """Return the quantiles at these probabilities, SI."""
        raise NotImplementedError

    def _read(self, read: QuantityReader) -> Self:
        """Return the same in SI, unchecked."""
        return replace(self, **{field.name: read.value(getattr(self, field.name)) for field in fields(self)})

    def _rules(self) -> dict[str, bool]:
        """Return the rules that the numbers must follow, and whether each holds."""
        raise NotImplementedError

    def __str__(self) -> str:
        """Write the distribution as on the command line."""
        return f"{self.WORD}({', '.join(f'{getattr(self, field.name)}' for field in fields(self))})"


@dataclass(frozen=True)
class Uniform(Distribution):
    """Uniform distribution from `low` to `high`.

    Parameters
    ----------
    low, high : str or float
    """

    WORD: ClassVar[str] = "uniform"
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

    WORD: ClassVar[str] = "triangular"
    low: Any
    mode: Any
    high: Any

    def _rules(self) -> dict[str, bool]:
        is_ordered = -math.inf < self.low <= self.mode <= self.high < math.inf
        return {"low <= mode <= high, low < high": is_ordered and self.low < self.high}

    def quantile(self, share: Array) -> Array:
        """Return the inverse of the distribution function, a root on either side of the mode."""
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
        Standard deviation. ``"10 %"`` refers to the mean, which must then count from zero: neither degC nor gauge
        pressure.
    """

    WORD: ClassVar[str] = "normal"
    mean: Any
    sd: Any

    def _read(self, read: QuantityReader) -> Self:
        mean = read.value(self.mean)
        if "%" in str(self.sd) and _FROM_ELSEWHERE.search(str(self.mean)):
            what = f"{self}: a share of {self.mean} depends on where its scale begins"
            raise CommandError(what, remedy='Give the standard deviation with a unit, as "0.5 bar" or "5 K".')
        return replace(self, mean=mean, sd=read.width(self.sd, mean))

    def _rules(self) -> dict[str, bool]:
        return {"sd > 0": math.isfinite(self.mean) and 0.0 < self.sd < math.inf}

    def quantile(self, share: Array) -> Array:
        """Return ``mean + sd z``, z the quantile of the standard normal distribution."""
        return self.mean + self.sd * ndtri(share)


@dataclass(frozen=True)
class Lognormal(Normal):
    """Distribution of a positive number whose logarithm is normal.

    Parameters
    ----------
    mean, sd : str or float
        Mean and standard deviation of the number itself, not of its logarithm.
    """

    WORD: ClassVar[str] = "lognormal"

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
            raise CommandError(
                f'the grid "{values[0]}" does not say how many values it has', remedy='Write grid("20 mm .. 32 mm", 7).'
            )
        return GridAxis((low.strip(), high.strip()), count)
    if not values:
        raise CommandError("a grid has no value", remedy='Write grid("20 mm", "25 mm") or grid("20 mm .. 32 mm", 7).')
    return GridAxis(values)


#: Word -> what it makes of the texts in its brackets.
WORDS: dict[str, Callable[..., Any]] = {
    **{kind.WORD: kind for kind in (Uniform, Triangular, Normal, Lognormal)},
    "grid": grid,
}
#: Quantities whose scale does not begin at zero.
_FROM_ELSEWHERE = re.compile(r"gauge|degC|degF|°C|°F|[Cc]elsius|[Ff]ahrenheit")
_CALL = re.compile(r"\s*([a-z][\w-]*)\s*\((.*)\)\s*", re.DOTALL)


def read_text(text: str) -> Any:  # noqa: ANN401 - a distribution, an axis or a list of texts
    """Read the variation of a number: ``normal(30 N, 10 %)``, ``grid(20 mm .. 32 mm, 7)``, ``20 mm, 25 mm``.

    Raises
    ------
    CommandError
        Unknown word, or a wrong number of quantities.

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
