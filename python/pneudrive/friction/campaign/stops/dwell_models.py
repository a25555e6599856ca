"""Breakaway over stop duration: laws, a curve without a law, and optimal stop durations for a law.

The laws are fitted side by side and compared by information criteria:

  y = a_c + B_c psi(t; shape) at each condition c; the shape is common to all conditions

psi is a growth function of the core, named as in drive files, with a time constant and an exponent. Both have
profile intervals. A side of an interval is open if the data do not limit it.

The curve without a law is a function of the logarithm of the duration:

  y = level_c + slope_c u + bend + place + drift + block + block slope + scatter,   u = log10(stop duration)

at each condition c. The bend is a smooth function of u (a slow and a quick part), and partly common to all conditions.
The bend, the blocks, their slopes and the scatter between cycles are random effects. Results are averaged over the
possible sizes of these effects (`pneudrive.estimate.mixed`). Intervals therefore cover the choice of the law as well as
the scatter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pneudrive import _core
from pneudrive.arrays import Array, Interval, by_name
from pneudrive.describe.files import toml
from pneudrive.errors import FitError, nearest, package_table
from pneudrive.estimate import mixed
from pneudrive.estimate.autocorrelation import cells, corrected_criterion, gaussian, levels, means, projection
from pneudrive.estimate.design import DesignSpace, exchange, information
from pneudrive.estimate.estimates import student
from pneudrive.friction.friction_map import Condition, conditions_of
from pneudrive.repr_tables import Shown

EXPONENTS = np.round(np.linspace(0.15, 1.0, 18), 3)
PER_DECADE = 10  # points of the first profile over a time
FINE = 64  # and of the second one, over the range of the first
LEAST_DURATIONS = 3
CONCLUSIVE = 10.0  # difference of AICc beyond which a law has essentially no support [burnham2002]
UNCERTAIN = 2.0  # and difference below which two laws are equally good


@dataclass(frozen=True)
class DwellForm:
    """A law of breakaway over stop duration.

    Attributes
    ----------
    name, title, formula, source : str
        Texts for display.
    growth : str
        Growth function of the core; "" if breakaway does not depend on the stop.
    units : dict
        Shape parameters (time constant, and exponent if free) -> unit.
    exponent : float
        Exponent if not free.
    reach : tuple of float
        Two factors. A time constant is searched from the shortest stop divided by the first factor to the longest stop
        times the second factor.
    """

    name: str
    title: str
    formula: str
    source: str
    growth: str
    units: dict[str, str]
    exponent: float = 1.0
    reach: Interval = (30.0, 30.0)

    @property
    def saturates(self) -> bool:
        """Whether the growth has a limit."""
        return self.growth in {"saturating", "hyperbolic"}

    def derivatives(self, duration_s: Array, time_s: float, exponent: float | None = None) -> Array:
        """Return psi and its derivatives with respect to duration, time constant and exponent (shape (n, 4))."""
        m = self.exponent if exponent is None else exponent
        return _core.dwell_growth(self.growth, np.asarray(duration_s, dtype=float), time_s, m)

    def psi(self, duration_s: Array, *shape: float) -> Array:
        """Return the growth psi at these durations (shape (n,))."""
        return self.derivatives(duration_s, *shape)[:, 0] if self.growth else np.zeros(np.shape(duration_s))

    def slope(self, duration_s: float, *shape: float) -> float:
        """Return the derivative of psi with respect to the decadic logarithm of the duration."""
        if not self.growth:
            return 0.0
        return float(np.log(10.0) * duration_s * self.derivatives(np.array([duration_s]), *shape)[0, 1])


FORMS = tuple(DwellForm(name, **row) for name, row in package_table(__file__, "dwell_laws.toml").items())


@dataclass(frozen=True, eq=False, repr=False)
class DwellLawFit(Shown):
    """A law of breakaway over stop duration, fitted to stops.

    Attributes
    ----------
    form : DwellForm
    shape : dict
        Shape parameter -> estimate. An open side of its interval means that the data do not determine this bound.
    shape_intervals : dict
        Shape parameter -> 95 % interval (low, high); an open side is 0 or inf.
    level_n, amplitude_n : ndarray, shape (C,)
        a and B at each condition.
    slope_n, slope_low_n, slope_high_n : float
        Slope per decade at the reference duration, mean over conditions, with its profile interval.
    aicc, bic : float
        inf with too few stops.
    delta : float
        AICc minus that of the best law.
    """

    form: DwellForm
    shape: dict[str, float]
    shape_intervals: dict[str, Interval]
    level_n: Array
    amplitude_n: Array
    slope_n: float
    slope_low_n: float
    slope_high_n: float
    aicc: float
    bic: float
    delta: float = np.nan

    @property
    def name(self) -> str:
        """Name of the law."""
        return self.form.name

    def increment_n(self, duration_s: Array, condition: int) -> Array:
        """Return the breakaway increment after stops of these durations."""
        psi = self.form.psi(duration_s, *self.shape.values())
        return self.level_n[condition] + self.amplitude_n[condition] * psi


def fit_forms(curve: DwellCurve, reference_s: float) -> tuple[DwellLawFit, ...]:
    """Fit every law to the stops of a curve, with scatter and block effects taken from the curve.

    Parameters
    ----------
    curve : DwellCurve
    reference_s : float
        Duration at which the slope is evaluated.

    Returns
    -------
    tuple of DwellLawFit
        Best first. Empty with fewer than three durations.
    """
    if most_durations(curve.data) < LEAST_DURATIONS:
        return ()
    # The covariance of the stops without the bends, which the laws replace.
    model = curve.fit.model
    kept = [i for i, c in enumerate(model.components) if c.name not in BENDS]
    scatter = replace(model, components=tuple(model.components[i] for i in kept)).covariance(curve.fit.sd[kept])
    whitener = np.linalg.inv(np.linalg.cholesky(scatter)).astype(float)
    fits = sorted((_fit(curve, form, whitener, reference_s) for form in FORMS), key=lambda f: f.aicc)
    return tuple(replace(f, delta=f.aicc - fits[0].aicc) for f in fits)


def _fit(curve: DwellCurve, form: DwellForm, whitener: Array, reference_s: float) -> DwellLawFit:
    dwell, increment, conditions = curve.data["dwell_s"], curve.data["increment_n"], len(curve.conditions)
    own = np.eye(conditions)[curve.data["condition"]]
    fixed, n = np.c_[own, curve.extra], dwell.size

    def at(times: Array) -> mixed.Scan:
        """Fit the law at these time constants, and at all exponents if the exponent is free."""
        every = list(product(*(times, EXPONENTS)[: len(form.units)]))
        shapes = np.array(every).reshape(len(every), -1 if form.units else 0)
        designs = np.broadcast_to(fixed, (len(shapes), *fixed.shape))
        if form.growth:
            psi = np.array([form.psi(dwell, *shape) for shape in shapes])
            designs = np.concatenate([designs, own * psi[:, :, None]], axis=2)
        return mixed.Scan(shapes, whitener @ designs, whitener @ increment, freedom)

    limits = {
        "s": (dwell.min() / form.reach[0], dwell.max() * form.reach[1]),
        "": (EXPONENTS[0], np.inf),
    }
    count = fixed.shape[1] + (conditions if form.growth else 0) + len(form.units) + 1
    freedom = max(n - count + 1, 1)
    low, high = limits["s"]
    times = np.geomspace(low, high, int(PER_DECADE * np.log10(high / low)))
    profile = mixed.refined(at, times, FINE) if form.growth else at(times)
    best = profile.coefficient[profile.best]
    slope = np.zeros_like(profile.coefficient)
    slope[:, -conditions:] = np.array([[form.slope(reference_s, *s)] for s in profile.shape]) / conditions
    slope_low, slope_high = profile.interval(slope)
    cost = max(profile.cost[profile.best], 1e-300)
    deviance = n * np.log(cost / n) - 2.0 * np.log(np.diag(whitener)).sum()
    aicc = corrected_criterion(deviance, count, n)
    return DwellLawFit(
        form=form,
        shape=by_name(form.units, profile.shape[profile.best]),
        shape_intervals={
            name: profile.shape_interval(k, limits[unit]) for k, (name, unit) in enumerate(form.units.items())
        },
        level_n=best[:conditions],
        amplitude_n=best[-conditions:] if form.growth else np.zeros(conditions),
        slope_n=float(slope[profile.best] @ best),
        slope_low_n=slope_low,
        slope_high_n=slope_high,
        aicc=aicc,
        bic=float(deviance + count * np.log(n)) if np.isfinite(aicc) else np.inf,
    )


#: Correlation length of each bend in decades (known laws bend within one or two), and prior size of a bend relative to
#: the range of the increments (assumed; chosen by the coverage of intervals in campaigns simulated with six laws).
BENDS = {"quick bend": (0.6, 0.05), "slow bend": (1.5, 0.2)}
#: Fraction of the bend common to all conditions (assumed), because ageing is similar at different pressures.
COMMON_BEND = 0.8
#: Bounds of the variance of the scatter, relative to its mean. The variance grows with the increment.
GROWTH_RANGE = (0.25, 4.0)
#: Smallest number of blocks for estimating the scatter of their slopes.
BLOCKS_FOR_SLOPES = 3
#: Variance inflation of the slope above which slope and drift cannot be separated.
CONFOUNDED = 5.0
SAME_AS_OTHERS = 1e-20  # share of a column's square below which the other columns explain it
#: Durations within this many decades (2 %) count as one.
SAME_DURATION = 0.0086
SAME_PLACE_M = 1e-3  # stops in one direction whose positions differ by less: other places differ by a constant
#: Huber's constant for outlying stops, and number of updates of their weights.
HUBER_K, ROUNDS = 2.5, 3
LEAST_FREEDOM = 2
#: Required excess of stops over unknowns: to add positions as unknowns, and to add drift as an unknown.
SPARE_FOR_PLACES, SPARE_FOR_DRIFT = 4, 6


def durations_of(dwell_s: Array) -> int:
    """Count the different durations of stops."""
    return np.unique(levels(np.log10(np.maximum(dwell_s, 1e-6)), SAME_DURATION)).size


def most_durations(data: dict[str, NDArray]) -> int:
    """Return the largest number of different durations at a condition."""
    return max(durations_of(data["dwell_s"][data["condition"] == c]) for c in np.unique(data["condition"]))


@dataclass(frozen=True, eq=False)
class DwellCurve:
    """Fitted curve of breakaway over stop duration, without a law.

    Attributes
    ----------
    data : dict of ndarray, shape (n,)
        Columns of the stops, decadic logarithm of the duration (``log_s``), and index of the ``condition``.
    conditions : tuple of Condition
    fit : MixedFit
    centre : float
        log10 duration to which the levels refer.
    extra : ndarray, shape (n, .)
        Fixed columns in addition to levels and slopes: positions, drift.
    inflation : float
        Variance inflation of the slope by drift.
    weight : ndarray, shape (n,)
        Huber's weight of each stop; below 1 for an outlying stop.
    """

    data: dict[str, NDArray]
    conditions: tuple[Condition, ...]
    fit: mixed.MixedFit
    centre: float
    extra: Array
    inflation: float
    weight: Array

    def slopes(self, log_s: Array) -> mixed.Functionals:
        """Return the slope in N per decade at log10 durations, condition by condition."""
        return self.values(log_s, derivative=True)

    def gains(self, low: float, high: float) -> mixed.Functionals:
        """Return the mean slope per decade between two log10 durations, at each condition."""
        row = np.array([[-1.0, 1.0]]) / (high - low)
        rows = np.kron(np.eye(len(self.conditions)), row)
        return self.values(np.array([low, high])).combine(rows.astype(float))

    def values(self, log_s: Array, *, derivative: bool = False) -> mixed.Functionals:
        """Return the increment in N at log10 durations, or its derivative, condition by condition."""
        conditions, log_stop_s = len(self.conditions), self.data["log_s"]
        of, at = np.repeat(np.arange(conditions), log_s.size), np.tile(log_s, conditions)
        rows = np.arange(of.size)
        fixed = np.zeros((of.size, self.fit.model.x.shape[1]))
        fixed[rows, of] = 0.0 if derivative else 1.0
        fixed[rows, conditions + of] = 1.0 if derivative else at - self.centre
        with_stops = np.where(of[:, None] == self.data["condition"], 1.0, COMMON_BEND)
        with_each = np.where(of[:, None] == of, 1.0, COMMON_BEND)
        cross, own = {}, {}
        for name, (length, _) in BENDS.items():
            k, z = gaussian(at, log_stop_s, length), gaussian(at, at, length)
            if derivative:
                away = (at[:, None] - at) / length
                k = -k * (at[:, None] - log_stop_s) / length**2
                z = z * (1.0 - away * away) / length**2
            cross[name], own[name] = k * with_stops, z * with_each
        return mixed.Functionals(self.fit, fixed, cross, own)


def fit_curve(stops: pl.DataFrame, conditions: tuple[Condition, ...], drift_prior_n: float) -> DwellCurve | None:
    """Fit the curve without a law. Return None if too few stops are left to estimate the scatter.

    Parameters
    ----------
    stops : polars.DataFrame
        Stops of one series, at least two durations at each condition.
    conditions : tuple of Condition
    drift_prior_n : float
        Standard deviation of the drift of increments over half the campaign. It is used if the order of the stops hides
        the drift.
    """
    condition = np.array([conditions.index(c) for c in conditions_of(stops)], dtype=np.int64)
    data: dict[str, NDArray] = {name: stops[name].to_numpy() for name in stops.columns}
    data |= {"condition": condition, "log_s": np.log10(data["dwell_s"])}
    n, u, own = len(stops), data["log_s"], np.eye(len(conditions))[condition]
    centre = float(u.mean())
    x = np.c_[own, np.where(own > 0.0, (u - centre)[:, None], 0.0)]
    if n - x.shape[1] < LEAST_FREEDOM:
        return None
    extra, hidden, inflation = _places_and_drift(data, x, drift_prior_n)
    x = np.c_[x, extra]
    # Sources of scatter; the scatter from stop to stop comes first.
    line = np.abs(projection(data["increment_n"], x))
    size = np.clip(line / max(line.mean(), 1e-300), *GROWTH_RANGE)
    tau = _first_scatter(data, x)
    swing = max(np.ptp(line), tau)
    components = [mixed.RandomEffect("scatter", np.diag(size / size.mean()), tau)]
    if most_durations(data) > 2:
        share = np.where(condition[:, None] == condition, 1.0, COMMON_BEND)
        bends = ((name, gaussian(u, u, length) * share, swing * part) for name, (length, part) in BENDS.items())
        components += [mixed.RandomEffect(*bend) for bend in bends]
    block = data["block"]
    if (names := np.unique(block)).size > 1:
        same = (block[:, None] == block).astype(float)
        components.append(mixed.RandomEffect("block", same, tau))
        if names.size >= BLOCKS_FOR_SLOPES:
            away = (u - u.mean()) / max(u.std(), 1e-9)
            components.append(mixed.RandomEffect("block slope", same * np.outer(away, away), tau))
    if hidden.shape[1]:
        components.append(mixed.RandomEffect("drift", hidden @ hidden.T, 1.0))
    weight = np.ones(n)
    curve = None
    for _ in range(ROUNDS):
        scatter = replace(components[0], kernel=components[0].kernel / weight)
        model = mixed.MixedModel(
            data["increment_n"], x, data["increment_stderr_n"] ** 2 / weight, (scatter, *components[1:])
        )
        curve = DwellCurve(data, conditions, model.fit(), centre, extra, inflation, weight)
        # Residual of each stop from curve and blocks, in standard deviations.
        variance = (model.noise + curve.fit.sd[0] ** 2 * np.diag(scatter.kernel)) * weight
        solved = np.linalg.solve(model.covariance(curve.fit.sd), model.y - x @ curve.fit.states[0].beta)
        away = np.abs(variance / weight * solved) / np.sqrt(np.maximum(variance, 1e-300))
        updated = np.minimum(1.0, HUBER_K / np.maximum(away, 1e-12))
        if np.allclose(updated, weight, atol=0.02):
            break
        weight = updated
    return curve


def _places_and_drift(data: dict[str, NDArray], x: Array, drift_prior_n: float) -> tuple[Array, Array, float]:
    """Return fixed columns of positions and drift, the column of an undetermined drift, and the variance inflation."""
    n = len(x)
    at = np.round(data["position_m"] / SAME_PLACE_M).astype(np.int64)
    names, member = np.unique(cells(data["direction"], at), return_inverse=True)
    extra = np.eye(names.size)[member] - 1.0 / names.size
    extra = extra[:, mixed.independent(np.c_[x, extra])[x.shape[1] :] - x.shape[1]]
    if n - x.shape[1] - extra.shape[1] < SPARE_FOR_PLACES:
        extra = np.zeros((n, 0))
    spare = n - x.shape[1] - extra.shape[1]
    time = data["began_s"]
    time = time - time.mean()
    if np.ptp(time) == 0:
        return extra, np.zeros((n, 0)), 1.0
    drift = time / np.abs(time).max()
    inflation = _inflation(np.c_[x, extra], x.shape[1] // 2, drift)
    if inflation < CONFOUNDED and spare > SPARE_FOR_DRIFT:
        return np.c_[extra, drift], np.zeros((n, 0)), inflation
    return extra, drift[:, None] * drift_prior_n if drift_prior_n > 0 else np.zeros((n, 0)), inflation


def _inflation(x: Array, conditions: int, drift: Array) -> float:
    """Return the factor by which drift as a further unknown increases the variance of the mean slope."""
    coefficients = np.linalg.lstsq(x, drift, rcond=None)[0]
    rest, slope = drift - x @ coefficients, slice(conditions, 2 * conditions)
    if rest @ rest < SAME_AS_OTHERS * (drift @ drift):
        return np.inf
    before = np.linalg.pinv(x.T @ x)[slope, slope].mean()
    return 1.0 + coefficients[slope].mean() ** 2 / (rest @ rest) / before


def _first_scatter(data: dict[str, NDArray], x: Array) -> float:
    """Return a first estimate of the scatter beyond noise, from repeated stops or else from a linear fit."""
    y = data["increment_n"]
    cell = cells(data["condition"], levels(data["log_s"], SAME_DURATION))
    repeats = y.size - cell.max() - 1
    if repeats >= 3:
        total = ((y - means(cell, y)[0][cell]) ** 2).sum() / repeats
    else:
        rest = y - projection(y, x)
        total = rest @ rest / max(y.size - x.shape[1], 1)
    noise = np.mean(data["increment_stderr_n"] ** 2)
    return float(np.sqrt(max(total - noise, 0.05 * total, 0.05 * noise, 1e-18 * (y @ y), 1e-300)))


#: Shortest and longest stop, s; number of candidate durations, in logarithmic steps; digits of the proposed ones.
RANGE_S, DURATIONS, DIGITS = (0.1, 1000.0), 120, 2
#: Samples of the log time constant over which the criterion is averaged, in standard deviations.
DRAWS = np.linspace(-1.5, 1.5, 9)
#: Assumed value of a free exponent: the middle of the values for slideways [kato1972].
KATO_M = 0.4


@dataclass(frozen=True, repr=False)
class StopDesign(Shown):
    """Proposed durations and repeats of stops.

    Attributes
    ----------
    form : str
        Dwell law.
    durations_s : tuple of float
        Shortest first, each with its number in `repeats`.
    repeats : tuple of int
    half_widths : dict
        Parameter -> expected half-width of its 95 % interval: ``a_n`` and ``increment_n`` in N for an increment of 1 N,
        and the time constant relative to its value.
    """

    form: str
    durations_s: tuple[float, ...]
    repeats: tuple[int, ...]
    half_widths: dict[str, float]

    def __str__(self) -> str:
        """Return the stops and the expected intervals."""
        times = ", ".join(f"{t:g} s x {n}" for t, n in zip(self.durations_s, self.repeats, strict=True))
        minutes = np.dot(self.durations_s, self.repeats) / 60.0
        lines = [f"stops for the {self.form} law: {times}; {minutes:.3g} min at rest"]
        lines.append("expected half-width of the 95 % interval, for an increment of 1 N and the given noise:")
        lines += [f"  {name:<18} {value:.3g}" for name, value in self.half_widths.items()]
        return "\n".join(lines)

    def protocol(self) -> str:
        """Return a protocol for ``pneudrive campaign plan``; every stop has the largest number of repeats."""
        head = {"schema": 1, "name": "Next stops", "about": f"optimal stops for the {self.form} dwell law"}
        stops = {"durations": [f"{t:g} s" for t in self.durations_s]}
        return toml.write({**head, "repeats": max(self.repeats), "stop": stops, "order": {"kind": "randomised"}})


def design_stops(
    form: str,
    scale_s: float,
    stops: int = 12,
    factor: float = 3.0,
    noise_n: float = 0.3,
) -> StopDesign:
    """Choose durations of stops that determine level, increment and time constant of a dwell law.

    The design is D-optimal by exchange, averaged over a log-normal prior of the time constant. The expected intervals
    hold for an increment of 1 N.

    Parameters
    ----------
    form : str
        ``log``, ``kato``, ``kato-free``, ``hyperbolic`` or ``exponential``.
    scale_s : float
        Guess of the time constant.
    stops : int
        Number of stops, including repeats.
    factor : float
        Standard deviation of the guess, as a factor above 1.
    noise_n : float
        Standard deviation of one breakaway force.

    Returns
    -------
    StopDesign

    Raises
    ------
    FitError
        If there is no such law, or a number is out of range.
    """
    laws = {one.name: one for one in FORMS if one.growth}
    if form not in laws:
        raise FitError(f"there is no dwell law {form!r}", remedy=nearest(form, laws))
    if min(scale_s, noise_n) <= 0.0 or factor < 1.0:
        raise FitError("time constant and noise must be positive, and the factor at least 1")
    t = np.array([float(f"{v:.{DIGITS}g}") for v in np.geomspace(*RANGE_S, DURATIONS)])
    # Derivatives with respect to level, increment, ln time constant and ln exponent, for each sample of the prior.
    gradients = []
    names = ["a_n", "increment_n", "time constant", "exponent"][: 2 + len(laws[form].units)]
    for z in DRAWS:
        shape = (scale_s * factor**z, KATO_M)[: len(laws[form].units)]
        psi, _, *by_shape = laws[form].derivatives(t, *shape).T
        logarithmic = [d * s for d, s in zip(by_shape, shape, strict=False)]
        gradients.append(np.column_stack([np.ones(t.size), psi, *logarithmic]) / noise_n)
    size = len(names)
    candidates = DesignSpace(np.array(gradients), np.zeros((DRAWS.size, size, size)))
    counts = np.bincount(exchange(candidates, max(stops, size)), minlength=t.size)
    covariance = np.linalg.inv(information(candidates, counts.astype(float)))
    deviation = np.median(np.sqrt(np.einsum("dii->di", covariance)), axis=0)
    half_widths = by_name(names, student(counts.sum() - size) * deviation)
    return StopDesign(form, tuple(t[counts > 0].tolist()), tuple(counts[counts > 0].tolist()), half_widths)
