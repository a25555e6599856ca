"""Intervals of estimates: only what is determined can carry one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pneudrive.identify.diagnose import Undetermined


class Intervals(dict[str, tuple[float, float]]):
    """95 % intervals by name, SI; what the data do not determine has none.

    Every result of a fit holds its intervals in this type, so that nothing that prints, writes or applies a result can
    give an interval to a value that the data do not determine.

    Parameters
    ----------
    ends : mapping
        Name -> (lower, upper).
    undetermined : iterable of str or Undetermined
        What the data do not determine, by name.
    converged : bool
        False where the search did not converge: then nothing has an interval.

    Examples
    --------
    >>> Intervals({"coulomb": (29.0, 31.0), "viscous": (0.0, 900.0)}, ["viscous"])
    {'coulomb': (29.0, 31.0)}
    """

    def __init__(
        self,
        ends: Mapping[str, tuple[float, float]],
        undetermined: Iterable[str | Undetermined] = (),
        *,
        converged: bool = True,
    ) -> None:
        lost = {str(getattr(one, "parameter", one)) for one in undetermined}
        kept = {n: (float(a), float(b)) for n, (a, b) in ends.items() if converged and n not in lost}
        super().__init__(kept)

    def __missing__(self, name: str) -> tuple[float, float]:
        raise KeyError(f"{name} has no interval: the data do not determine it, or the search has not converged")


class WithIntervals:
    """A result with `intervals` and `undetermined`; however it is made, its intervals are `Intervals`."""

    def __post_init__(self) -> None:
        """Leave out the intervals of what is not determined."""
        result: Any = self
        kept = Intervals(result.intervals, result.undetermined, converged=getattr(result, "converged", True))
        object.__setattr__(self, "intervals", kept)
