"""Optimal stops for a dwell law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError, nearest
from pneudrive.estimate.design import DesignSpace, exchange, information
from pneudrive.estimate.estimates import student
from pneudrive.friction.campaign.stops.dwell_forms import FORMS, DwellForm
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Number of candidate durations, in logarithmic steps, and digits of the proposed ones.
DURATIONS, DIGITS = 120, 2
#: Draws of the time constant over which the criterion is averaged, in standard deviations of its logarithm.
DRAWS = np.linspace(-1.5, 1.5, 9)
#: Kato's exponent if it is a parameter: the middle of the values for slideways [kato1972].
KATO_M = 0.4


@dataclass(frozen=True, repr=False)
class StopDesign(Shown):
    """Proposed stops.

    Attributes
    ----------
    form : str
        Dwell law.
    durations_s : tuple of float
        Shortest first, each with its number in `repeats`.
    repeats : tuple of int
    half_widths : dict
        Parameter -> expected half-width of its 95 % interval: ``a_n`` and ``increment_n`` in N for an increment of 1 N,
        and the relative one of the time constant.
    seconds : float
        Time of the stops alone.
    """

    form: str
    durations_s: tuple[float, ...]
    repeats: tuple[int, ...]
    half_widths: dict[str, float]
    seconds: float

    def __str__(self) -> str:
        """Return the stops and the expected intervals."""
        times = ", ".join(f"{t:g} s x {n}" for t, n in zip(self.durations_s, self.repeats, strict=True))
        lines = [f"stops for the {self.form} law: {times}; {self.seconds / 60.0:.3g} min at rest"]
        lines.append("expected half-width of the 95 % interval, for an increment of 1 N and the given noise:")
        lines += [f"  {name:<18} {value:.3g}" for name, value in self.half_widths.items()]
        return "\n".join(lines)

    def protocol(self, name: str = "Next stops") -> str:
        """Return a protocol for ``pneudrive campaign plan``; every stop has the largest number of repeats."""
        listed = ", ".join(f'"{t:g} s"' for t in self.durations_s)
        lines = ["schema = 1", f'name = "{name}"', f'about = "optimal stops for the {self.form} dwell law"']
        lines += [f"repeats = {max(self.repeats)}", "", "[stop]", f"durations = [{listed}]"]
        return "\n".join([*lines, "", "[order]", 'kind = "randomised"', ""])


def design_stops(
    form: str,
    scale_s: float,
    *,
    stops: int = 12,
    range_s: tuple[float, float] = (0.1, 1000.0),
    factor: float = 3.0,
    increment_n: float = 1.0,
    noise_n: float = 0.3,
) -> StopDesign:
    """Choose durations of stops that determine level, increment and time constant of a dwell law.

    The design is D-optimal by exchange, averaged over a time constant that is known only within a factor. The model is
    linear in the increment, so the size of the increment affects only the expected interval of the time constant.

    Parameters
    ----------
    form : str
        ``log``, ``kato``, ``kato-free``, ``hyperbolic`` or ``exponential``.
    scale_s : float
        Guess of the time constant.
    stops : int
        Number of stops, repeats counted.
    range_s : (float, float)
        Shortest and longest stop.
    factor : float
        Standard deviation of the guess, as a factor either way.
    increment_n, noise_n : float
        Guess of the increment, and standard deviation of one breakaway force.

    Returns
    -------
    StopDesign
    """
    laws = {one.name: one for one in FORMS if one.growth}
    if form not in laws:
        raise FitError(f"there is no dwell law {form!r}", remedy=nearest(form, laws))
    if not (0.0 < range_s[0] < range_s[1] and scale_s > 0.0 and factor >= 1.0 and noise_n > 0.0):
        raise FitError("durations, time constant and noise must be positive, and a factor 1 or more")
    t = np.geomspace(*range_s, DURATIONS)
    t = np.array([float(f"{v:.{DIGITS}g}") for v in t])
    gradients = np.array([_gradient(laws[form], t, scale_s * factor**z, increment_n) for z in DRAWS]) / noise_n
    size = gradients.shape[2]
    candidates = DesignSpace(gradients, np.zeros((DRAWS.size, size, size)))
    chosen = exchange(candidates, max(stops, size))
    counts = np.bincount(chosen, minlength=t.size).astype(float)
    covariance = np.linalg.inv(information(candidates, counts))
    deviation = np.median(np.sqrt(np.einsum("dii->di", covariance)), axis=0)
    names = ("a_n", "increment_n", "time constant", "exponent")[:size]
    reach = student(len(chosen) - size)
    where = np.flatnonzero(counts)
    return StopDesign(
        form,
        tuple(t[where].tolist()),
        tuple(counts[where].astype(int).tolist()),
        {name: float(reach * d) for name, d in zip(names, deviation, strict=True)},
        float(counts @ t),
    )


def _gradient(form: DwellForm, t: Array, scale: float, increment: float) -> Array:
    """Differentiate by level, increment, ln of the time constant and ln of the exponent, shape (c, p)."""
    shape = (scale, KATO_M)[: len(form.units)]
    psi, _, by_time, by_exponent = form.derivatives(t, *shape).T
    logarithmic = [increment * d * s for d, s in zip((by_time, by_exponent), shape, strict=False)]
    return np.column_stack([np.ones(t.size), psi, *logarithmic])
