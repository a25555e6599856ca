"""Design of the next measurement: speeds and pressures that best determine a friction law, with expected intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError, nearest
from pneudrive.estimate.design import DesignSpace, exchange, information, within_budget
from pneudrive.estimate.estimates import student
from pneudrive.identify.static.laws import CANDIDATES
from pneudrive.identify.static.model import FrictionModel, at_conditions, unit_of
from pneudrive.identify.static.result import FrictionFit
from pneudrive.repr_tables import Shown
from pneudrive.units import readable
from pneudrive.views import ShownTable, View, Viewed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pneudrive.identify.static.model import Observations

    Array = NDArray[np.float64]

#: Number of draws of the prior over which a criterion is averaged.
DRAWS = 32
#: Number of candidate speeds, in logarithmic steps, and digits of proposed speeds.
SPEEDS, DIGITS = 120, 3
#: Number of candidate speeds for a budget of time: each is chosen once, so close neighbours would be repeats.
SPEEDS_IN_TIME = 30
#: Largest standard deviation of ln vs (and ln n) in the prior from a fit: a factor of 2.7 either way.
WIDEST = 1.0


@dataclass(frozen=True, repr=False)
class Prior(Shown):
    """Prior distribution of a law's parameters before the next measurement.

    Attributes
    ----------
    model : FrictionModel
    draws : ndarray, shape (d, p)
        Draws of the internal coordinates.
    known : ndarray, shape (d, p, p)
        Information on them from measurements; zero without any.
    values : int
        Number of measured values.
    """

    model: FrictionModel
    draws: Array
    known: Array
    values: int = 0

    @classmethod
    def of_fit(cls, fit: FrictionFit, draws: int = DRAWS, seed: int = 1) -> Prior:
        """Return the prior from the estimates of a fit and their covariance.

        The measurements of the fit are counted.
        """
        centre = fit.coordinates
        to_internal = np.linalg.pinv(fit.model.natural_jacobian(centre))
        covariance = to_internal @ fit.covariance @ to_internal.T
        deviation = np.sqrt(np.diag(covariance))
        size = np.outer(deviation, deviation)
        known = np.asarray(np.linalg.pinv(covariance / size, rcond=1e-12, hermitian=True) / size, dtype=np.float64)
        share = np.ones(deviation.size)
        for k, name in enumerate(fit.free):
            if name.startswith("stribeck_") or name == "breakaway":  # logarithms
                share[k] = min(1.0, WIDEST / max(deviation[k], 1e-12))
        rng = np.random.default_rng(seed)
        spread = rng.multivariate_normal(
            np.zeros(centre.size), covariance * np.outer(share, share), draws, method="eigh"
        )
        points = _physical(fit.model, np.vstack([centre, centre + spread[1:]]))
        values = int(fit.statistics["values"])
        return cls(fit.model, points, np.broadcast_to(known, (draws, *known.shape)).copy(), values)

    @classmethod
    def of_law(
        cls,
        law: str,
        values: Mapping[str, float],
        deviations: Mapping[str, float] | None = None,
        *,
        chambers: tuple[str, ...] = (),
        draws: int = DRAWS,
        seed: int = 1,
    ) -> Prior:
        """Return the prior from guesses of the parameters, without measurements.

        Parameters
        ----------
        law : str
            Name as in :func:`select_friction_law`.
        values : mapping
            Parameter -> guess, SI.
        deviations : mapping, optional
            Parameter -> relative standard deviation of the guess (log-normal). Missing parameters have defaults.
        chambers : tuple of str
            Chambers whose gauge pressure acts on the forces, such as ``("a", "b")``.
        draws : int
            Draws of the guesses over which a design is averaged.
        seed : int
            Seed of the draws.
        """
        if law not in CANDIDATES:
            raise FitError(f"there is no law {law!r} to design for", remedy=nearest(law, CANDIDATES))
        base = CANDIDATES[law]
        model = FrictionModel(base.law, base.exponent, chambers, lorentzian=base.lorentzian)
        missing = [n for n in model.names if n not in values]
        if missing:
            raise FitError("the prior lacks " + ", ".join(missing), rule="a guess of each free parameter, SI")
        centre = np.array([float(values[n]) for n in model.names])
        relative = np.array([float((deviations or {}).get(n, 0.0)) for n in model.names])
        count = draws if relative.any() else 1
        noise = np.random.default_rng(seed).standard_normal((count, centre.size))
        noise[0] = 0.0
        theta = centre * np.exp(relative * noise)
        if model.stribeck:
            theta[:, 1] = np.maximum(theta[:, 1], 1.001 * theta[:, 0])
        points = np.array([model.internal(one) for one in theta])
        return cls(model, points, np.zeros((count, centre.size, centre.size)))


def _physical(model: FrictionModel, points: Array) -> Array:
    """Keep forces and the viscous coefficient positive, as in a fit."""
    for k, name in enumerate(model.names):
        if name in ("coulomb", "viscous"):
            points[:, k] = np.maximum(points[:, k], 0.05 * abs(points[0, k]))
    return points


@dataclass(frozen=True)
class Limits:
    """Limits and cost of measurements.

    Attributes
    ----------
    speed_m_s : (float, float)
    gauges_pa : tuple of (float, float)
        Pairs of gauge pressures in chambers a and b.
    stroke_m, acceleration_m_s2 : float
        Length and acceleration of a stroke.
    strokes : int
        Strokes in each direction for one point.
    settling_s : float
        Settling time before each point.
    """

    speed_m_s: tuple[float, float]
    gauges_pa: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    stroke_m: float = 0.1
    acceleration_m_s2: float = 5.0
    strokes: int = 1
    settling_s: float = 0.0

    def seconds(self, speed_m_s: Array) -> Array:
        """Return the time on the rig for one point at each speed: strokes out and back with ramps."""
        one = np.maximum(self.stroke_m / speed_m_s, speed_m_s / self.acceleration_m_s2)
        return 2.0 * self.strokes * (one + speed_m_s / self.acceleration_m_s2) + self.settling_s


@dataclass(frozen=True)
class Point:
    """Condition to measure `repeats` times."""

    speed_m_s: float
    gauge_a_pa: float
    gauge_b_pa: float
    repeats: int


@dataclass(frozen=True, repr=False)
class Design(Viewed):
    """Next points to measure.

    Attributes
    ----------
    points : tuple of Point
        Points, slowest first.
    criterion : str
        ``D`` or ``I``.
    half_widths_now, half_widths_then : dict
        Free parameter -> expected half-width of its 95 % interval before and after; infinite if unknown.
    seconds : float
        Time on the rig.
    limits : Limits
    """

    points: tuple[Point, ...]
    criterion: str
    half_widths_now: dict[str, float]
    half_widths_then: dict[str, float]
    seconds: float
    limits: Limits

    def view(self) -> View:
        """Return the points and the expected intervals."""
        points = tuple(
            (f"{1e3 * p.speed_m_s:.3g}", f"{1e-5 * p.gauge_a_pa:.3g}", f"{1e-5 * p.gauge_b_pa:.3g}", str(p.repeats))
            for p in self.points
        )
        widths = []
        for name, then in self.half_widths_then.items():
            size, unit = readable(unit_of(name))
            now = self.half_widths_now[name]
            widths.append((name, f"{now / size:.3g}" if np.isfinite(now) else "open", f"{then / size:.3g}", unit))
        words = "expected half-width of the 95 % interval, now and after a fit of old and new values together"
        return View(
            f"{self.criterion}-optimal: {sum(p.repeats for p in self.points)} points, {self.seconds / 60.0:.3g} min",
            tables=(
                ShownTable("points", ("speed mm/s", "a bar gauge", "b bar gauge", "times"), points),
                ShownTable(words, ("value", "now", "then", "unit"), tuple(widths)),
            ),
        )

    def protocol(self, name: str = "Next points") -> str:
        """Return a protocol for ``pneudrive campaign plan``: every proposed speed at every proposed pressure.

        All points have the same number of repeats, the mean of those of the design.
        """
        speeds = sorted({p.speed_m_s for p in self.points})
        gauges = sorted({(p.gauge_a_pa, p.gauge_b_pa) for p in self.points})
        repeats = max(1, round(sum(p.repeats for p in self.points) / len(self.points)))
        listed = ", ".join(f'"{1e3 * v:.6g} mm/s"' for v in speeds)
        pairs = ", ".join(f'{{ a = "{1e-5 * a:.6g} bar gauge", b = "{1e-5 * b:.6g} bar gauge" }}' for a, b in gauges)
        lines = ["schema = 1", f'name = "{name}"', f'about = "{self.criterion}-optimal points"', f"repeats = {repeats}"]
        lines += ["", "[speed]", f"list = [{listed}]", "", "[pressure]", f"pairs = [{pairs}]"]
        return "\n".join([*lines, "", "[order]", 'kind = "randomised"', ""])


def next_measurements(
    source: FrictionFit | Prior,
    limits: Limits,
    *,
    points: int | None = None,
    seconds: float | None = None,
    criterion: str = "D",
    over: Limits | None = None,
    noise_n: float | None = None,
) -> Design:
    """Choose the next points by Fedorov's exchange over a grid of speeds and the pressures of the limits.

    The criterion is averaged over the prior, because a design for one value of vs is poor for another value.

    Parameters
    ----------
    source : FrictionFit or Prior
        Prior knowledge; the values of a fit count as measured.
    limits : Limits
    points : int, optional
        Number of points, including repeats. The default, without `seconds`, is twice the number of free parameters.
    seconds : float, optional
        Time on the rig instead of a number of points: each next point has the largest gain for its time. All are
        repeated equally, as in a protocol.
    criterion : str
        ``D`` (all parameters) or ``I`` (the prediction over the range `over`).
    over : Limits, optional
        Range of prediction; by default `limits`.
    noise_n : float, optional
        Standard deviation of one point; by default that of the fit, including its scatter.

    Returns
    -------
    Design
    """
    prior = Prior.of_fit(source) if isinstance(source, FrictionFit) else source
    noise = _noise(source) if noise_n is None else noise_n
    _check(limits, criterion, points, seconds, noise)
    grid = _grid(limits, SPEEDS if seconds is None else SPEEDS_IN_TIME)
    candidates = DesignSpace(
        _gradients(prior, grid) / noise, prior.known, _region(prior, over or limits) if criterion == "I" else None
    )
    cost = limits.seconds(grid.speed_m_s)
    if seconds is not None:
        once, repeats = within_budget(candidates, cost, seconds, criterion)
        chosen = np.repeat(once, repeats)
        if not chosen.size:
            shortest = f"the shortest point takes {cost.min():.3g} s"
            raise FitError("no point fits into the time", value=f"{seconds:g} s", rule=shortest)
    else:
        chosen = exchange(candidates, points or 2 * len(prior.model.names), criterion)
    counts = np.bincount(chosen, minlength=len(grid)).astype(float)
    where = np.flatnonzero(counts)
    proposed = [
        Point(float(grid.speed_m_s[i]), float(grid.gauge_a_pa[i]), float(grid.gauge_b_pa[i]), int(counts[i]))
        for i in where
    ]
    return Design(
        tuple(sorted(proposed, key=lambda p: (p.speed_m_s, p.gauge_a_pa, p.gauge_b_pa))),
        criterion,
        _half_widths(prior, prior.known, prior.values),
        _half_widths(prior, information(candidates, counts), prior.values + chosen.size),
        float(cost @ counts),
        limits,
    )


def expected_half_widths(
    prior: Prior, speed_m_s: Array, gauge_a_pa: Array, gauge_b_pa: Array, noise_n: float
) -> dict[str, float]:
    """Return the expected half-width of each parameter's 95 % interval from points at conditions, (n,) each."""
    at = at_conditions(*np.broadcast_arrays(*(np.asarray(x, float) for x in (speed_m_s, gauge_a_pa, gauge_b_pa))))
    g = _gradients(prior, at) / noise_n
    matrix = prior.known + np.einsum("dci,dcj->dij", g, g)
    return _half_widths(prior, matrix, prior.values + len(at))


def _check(limits: Limits, criterion: str, points: int | None, seconds: float | None, noise: float) -> None:
    low, high = limits.speed_m_s
    if not 0.0 < low < high:
        raise FitError("speeds to choose from must be positive and span a range", value=f"{low:g} .. {high:g} m/s")
    if criterion not in ("D", "I"):
        raise FitError(f"there is no criterion {criterion!r}", rule="D: all parameters; I: the prediction over a range")
    if points is not None and (points < 1 or seconds is not None):
        raise FitError("points is at least 1, and cannot be combined with seconds", value=f"points = {points}")
    if not np.isfinite(noise) or noise <= 0.0:
        raise FitError(
            "the standard deviation of one point is not known",
            value=f"noise_n = {noise}",
            remedy="Pass noise_n, for example 0.5.",
        )


def _noise(source: FrictionFit | Prior) -> float:
    """Return the standard deviation of a further measured value, N, from the fit."""
    if isinstance(source, Prior) or source.observations is None:
        return float("nan") if isinstance(source, Prior) else source.statistics["rms_n"]
    typical = float(np.median(source.observations.stderr_n))
    return float(np.sqrt(source.statistics["variance"])) * typical


def _grid(limits: Limits, count: int = SPEEDS) -> Observations:
    speeds = np.geomspace(*limits.speed_m_s, count)
    speeds[1:-1] = [float(f"{v:.{DIGITS}g}") for v in speeds[1:-1]]
    pairs = np.array(limits.gauges_pa, dtype=float).reshape(-1, 2)
    return at_conditions(np.tile(speeds, len(pairs)), np.repeat(pairs[:, 0], count), np.repeat(pairs[:, 1], count))


def _gradients(prior: Prior, at: Observations) -> Array:
    return np.array([prior.model.value_and_jacobian(q, at)[1] for q in prior.draws])


def _region(prior: Prior, over: Limits) -> Array:
    g = _gradients(prior, _grid(over))
    return np.einsum("dci,dcj->dij", g, g) / g.shape[1]


def _half_widths(prior: Prior, matrix: Array, values: int) -> dict[str, float]:
    """Return half-widths in natural units: the median over the prior samples.

    Student's t is taken for the number of values after the measurement.
    """
    free = values - len(prior.model.names)
    found = []
    for q, m in zip(prior.draws, matrix, strict=True):
        size = np.sqrt(np.diag(m))
        if not (size > 0.0).all() or np.linalg.cond(m / np.outer(size, size)) > 1e12:
            found.append(np.full(q.size, np.inf))
            continue
        jac = prior.model.natural_jacobian(q)
        inner = np.linalg.inv(m / np.outer(size, size)) / np.outer(size, size)
        found.append(np.sqrt(np.diag(jac @ inner @ jac.T)))
    reach = student(free) if free > 0 else np.inf
    middle = reach * np.median(found, axis=0)
    return dict(zip(prior.model.names, middle.tolist(), strict=True))
