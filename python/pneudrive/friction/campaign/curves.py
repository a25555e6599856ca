"""Curves of friction over speed from the cycles of a campaign, with a band for all observed and stated sources."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.friction.budget import CycleTerms, SharedTerms
from pneudrive.friction.campaign.points import (
    OUTLIER,
    CurveSpeeds,
    Points,
    block_shares,
    curve_speeds,
)
from pneudrive.friction.campaign.result import Curve
from pneudrive.friction.campaign.smooth import (
    CARRIED,
    WILD,
    WILD_SPREAD,
    CurveData,
    CurveFit,
    carried_drift,
    either_chance,
    fit_curves,
    wild_cycles,
    with_doubt,
)
from pneudrive.friction.conditions import BOTH

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.estimate.mixed import Predicted
    from pneudrive.friction.campaign.cycles import CycleTable

    Array = NDArray[np.float64]

POSITIVE_SHARE = 0.2  # of the median friction: least friction for relative scatter
FEWEST = 4  # cycles
#: Least standard error at a speed, share of the scatter of its cycles, even if neighbouring speeds and
#: other pressures seem to determine the curve better (assumed).
OWN_SHARE = 0.8


@dataclass(frozen=True, eq=False)
class Fits:
    """The models behind the curves.

    Attributes
    ----------
    points : Points
    speeds : tuple of CurveSpeeds
        Speeds of each curve.
    friction : CurveFit
        Standard uncertainty of half the difference of both directions.
    offset : CurveFit
        Standard uncertainty of half the sum, including the zero runs.
    drift_share : float
        Share of a steady drift that the design cannot separate from the curves.
    block_kind : str
        block, day, or "" without groups.
    doubtful : tuple of int
        Points that are possible outliers: curves average over both cases.
    """

    points: Points
    speeds: tuple[CurveSpeeds, ...]
    friction: CurveFit
    offset: CurveFit
    drift_share: float
    block_kind: str
    doubtful: tuple[int, ...] = ()

    def rest(self) -> Array:
        """Return the residuals of the used cycles without drift, in the response's unit, shape (used,)."""
        return self.friction.data.y - self.friction.drift - self.friction.steady()

    @property
    def blocks(self) -> Array | None:
        """Fraction of each block (or day) in the cycles of each point.

        None if the design does not determine their deviations.
        """
        return self.friction.data.blocks

    @property
    def level_n(self) -> float:
        """Mean friction of the points, N."""
        return float(self.points["friction_n"][self.points.use].mean())

    @property
    def scale_n(self) -> float:
        """Friction, N, at mean friction for one unit of the friction model's response."""
        return self.level_n if self.friction.logarithmic else 1.0

    @property
    def has_zero(self) -> bool:
        """Whether zero runs show the zero of the force sensor."""
        return bool((self.offset.data.curve < 0).any())


def fit_points(points: Points, tares: CycleTable, *, condensed: bool = False) -> Fits | None:
    """Fit the models; return None with too few points of F(v).

    A cycle that differs much from all others (a failed sensor) is removed, and the remaining ones are fitted again.
    In a large campaign, neighbouring repeats are merged into one point, and outliers among them are not sought.
    """
    fits = _fit_points(points, tares)
    if fits is None or condensed:
        return fits
    rows = np.flatnonzero(points.use)
    found, readings = wild_cycles(fits.friction.data)
    if found:
        wild = set(rows[found].tolist())
        reason = points["reason"].copy()
        reason[list(wild)] = OUTLIER
        fits = _fit_points(points.having(reason=reason), tares)
    if fits is None or not readings:
        return fits
    left = np.flatnonzero(fits.points.use)
    among = [np.searchsorted(left, rows[some]) for some in readings]
    both = with_doubt(fits.friction, among, WILD_SPREAD * fits.friction.data.level, WILD / (1.0 - WILD))
    return replace(fits, friction=both, doubtful=tuple(rows[readings[-1]].tolist()))


def _fit_points(points: Points, tares: CycleTable) -> Fits | None:
    use = points.use
    if use.sum() < FEWEST:
        return None
    curve = np.unique(points["curve"][use], return_inverse=True)[1].ravel()
    (blocks, kind), speeds = block_shares(points), curve_speeds(points)
    ones = np.ones(int(use.sum()))
    alike = (points["speed_m_s"][use], curve, points["order"][use], points.count[use], ones)
    friction = CurveData(points["friction_n"][use], points["friction_stderr_n"][use] ** 2, *alike, blocks)
    share = carried_drift(friction)
    fitted = _better(replace(friction, drift=share < CARRIED))
    offset = CurveData(points["offset_n"][use], points["offset_stderr_n"][use] ** 2, *alike)
    offset = _with_tares(tares, offset)
    carries = carried_drift(offset) < CARRIED or (offset.curve < 0).sum() > 1
    return Fits(points, speeds, fitted, fit_curves(replace(offset, drift=carries)), share, kind)


def fit_response(fits: Fits, y: Array, stderr: Array, *, drift: bool) -> CurveFit:
    """Fit curves to another result of the same cycles, shape (n,), with chance in N.

    Parameters
    ----------
    fits : Fits
        The models of friction, whose order, curves and blocks are used.
    y, stderr : ndarray, shape (n,)
        Number of cycles with both directions.
    drift : bool
        Whether it may drift like friction.
    """
    use, like = fits.points.use, fits.friction.data
    data = replace(like, y=y[use], noise=stderr[use] ** 2, logarithmic=False)
    return fit_curves(data if drift else replace(data, drift=False, blocks=None))


def _better(data: CurveData) -> CurveFit:
    """Fit friction or its logarithm, whichever is more likely, with both forms of scatter."""
    plain = fit_curves(data)
    if data.y.min() <= POSITIVE_SHARE * np.median(data.y):
        return plain
    relative = fit_curves(data.logarithms())
    # Densities of y and of ln y differ by a factor y for each degree of freedom of the restricted likelihood.
    freedom = len(data) - plain.fit.model.x.shape[1]
    likelier = relative.fit.log_likelihood() - freedom * float(np.mean(np.log(data.y)))
    better = relative if likelier > plain.fit.log_likelihood() else plain
    del plain, relative  # free the other one before a third: each takes much memory
    return either_chance(better)


def _with_tares(tares: CycleTable, data: CurveData) -> CurveData:
    """Add the zero runs: observations of only the zero, without a curve."""
    ones = np.ones(len(tares))
    columns = (tares["standing_n"], tares["standing_stderr_n"] ** 2, np.nan * ones, np.full(len(tares), -1))
    added = CurveData(*columns, tares["order"], ones, ones)
    names = [name for name, values in vars(added).items() if isinstance(values, np.ndarray)]
    return replace(data, **{name: np.concatenate([getattr(data, name), getattr(added, name)]) for name in names})


def systematic(fits: Fits, friction_n: Array, half_sum_n: Array, condition: int) -> SharedTerms:
    """Return the uncertainties that all points share, for these frictions and half sums.

    Without the zero if it is known.
    """
    points, pattern = fits.points, fits.points.pattern
    here = points.at(points.use & (points["curve"] == condition))
    gain = float(np.mean(here["u_gain_n"])) / max(abs(float(np.mean(here["friction_n"]))), 1e-12)
    spread, size = float(np.std(fits.friction.drift)), np.abs(friction_n)
    ones = np.ones(size.size)
    return SharedTerms(
        gain_n=gain * size,
        hysteresis_n=float(np.mean(here["u_hysteresis_n"])) * ones,
        position_n=pattern.u_friction * size,
        state_n=spread * (size if fits.friction.logarithmic else ones),
        zero_n=np.hypot(float(np.mean(here["u_offset_n"])), pattern.u_offset_n) * ones,
        half_sum_n=0.0 * ones if fits.has_zero else np.abs(half_sum_n),
    )


@dataclass(frozen=True, eq=False)
class CurveBand:
    """A curve of half the difference of both directions, with all parts of its band, shape (m,) each.

    Attributes
    ----------
    at : CurveSpeeds
    value_n, low_n, high_n, cycle_n : ndarray
        Curve, its 95 % interval by chance, and the standard deviation of a single cycle.
    offset : Predicted
        Half the sum of both directions.
    shared : SharedTerms
    """

    at: CurveSpeeds
    value_n: Array
    low_n: Array
    high_n: Array
    cycle_n: Array
    offset: Predicted
    shared: SharedTerms


def bands_of(fits: Fits) -> tuple[CurveBand, ...]:
    """Return the bands of all curves, in the order of the conditions."""
    found = []
    for at in fits.speeds:
        value, low, high = by_chance(fits, fits.friction, at)
        offset = fits.offset.at(at.number, at.speed_m_s)
        cycle = deviation_n(fits, "cycle", value)
        found.append(CurveBand(at, value, low, high, cycle, offset, systematic(fits, value, offset.mean, at.index)))
    return tuple(found)


def curves_of(fits: Fits, bands: Sequence[CurveBand], *, contains_air: bool) -> tuple[Curve, ...]:
    """Return the curves of all conditions: half the difference of both directions, then +x and -x."""
    curves: list[Curve] = []
    for band in bands:
        at, value, shared = band.at, band.value_n, band.shared
        for direction in (BOTH, 1, -1):
            centre, below, above = value, value - band.low_n, band.high_n - value
            u = shared.friction_n() if direction == BOTH else shared.direction_n()
            if direction != BOTH:
                if fits.has_zero:
                    centre = value + direction * band.offset.mean
                reach = band.offset.half_width()
                below, above = np.hypot(below, reach), np.hypot(above, reach)
            curves.append(
                Curve(
                    condition=at.condition,
                    direction=direction,
                    speed_m_s=at.speed_m_s,
                    friction_n=centre,
                    low_n=centre - np.hypot(below, NORMAL_95 * u),
                    high_n=centre + np.hypot(above, NORMAL_95 * u),
                    stderr_n=(below + above) / (2.0 * NORMAL_95),
                    u_systematic_n=u,
                    measured=at.measured,
                    cycles=at.cycles,
                    excluded=at.excluded,
                    contains_air=contains_air,
                    complete=fits.drift_share < CARRIED,
                )
            )
    return tuple(curves)


def cycle_terms(points: Points, fits: Fits | None) -> CycleTerms:
    """Return the uncertainty budget of each cycle."""
    terms = {field.name: np.full(len(points), np.nan) for field in fields(CycleTerms)}
    terms |= {"noise_n": points["friction_stderr_n"], "cycle_n": np.zeros(len(points))}
    if fits is None:
        return CycleTerms(**terms)
    terms |= {f"{name}_n": deviation_n(fits, name, points["friction_n"]) for name in ("cycle", "block")}
    for number in set(points["curve"][points.use].tolist()):  # others have no curve for their cycles
        members = points["curve"] == number
        shared = systematic(fits, points["friction_n"][members], points["offset_n"][members], number)
        offset = np.hypot(points["offset_stderr_n"][members], fits.offset.sd["cycle"])
        for name, values in (*vars(shared).items(), ("offset_n", offset)):
            terms[name][members] = values
    return CycleTerms(**terms)


def in_newton(fit: CurveFit, found: Predicted) -> tuple[Array, Array, Array]:
    """Return the value, low and high of the statistical 95 % interval, N."""
    half = found.half_width()
    if fit.logarithmic:
        return np.exp(found.mean), np.exp(found.mean - half), np.exp(found.mean + half)
    return found.mean, found.mean - half, found.mean + half


def by_chance(fits: Fits, fit: CurveFit, at: CurveSpeeds) -> tuple[Array, Array, Array]:
    """Return value, low and high end of the 95 % interval from chance, N.

    The scatter at the point gives a lower limit of its width.

    Neighbouring speeds and other pressures contribute. The model may therefore be more certain of a point than the
    cycles at this point alone. This is accepted down to `OWN_SHARE`. Between the measured speeds the number of cycles
    is interpolated.
    """
    value, low, high = in_newton(fit, fit.at(at.number, at.speed_m_s))
    known, u = at.cycles > 0, np.log(at.speed_m_s)
    among = np.interp(u, u[known], at.cycles[known])
    least = OWN_SHARE * NORMAL_95 * deviation_n(fits, "cycle", value) / np.sqrt(among)
    return value, np.minimum(low, value - least), np.maximum(high, value + least)


def deviation_n(fits: Fits, source: str, friction_n: Array) -> Array:
    """Return the standard deviation that a random source adds to a single cycle, at these frictions, N."""
    fit = fits.friction
    sd = fit.sd[source] * fits.scale_n
    relative = fit.relative if source == "cycle" else float(fit.logarithmic)
    return sd * np.sqrt(relative * (friction_n / fits.level_n) ** 2 + 1.0 - relative)
