"""Laws of breakaway over stop duration, fitted side by side and compared by information criteria.

  y = a_c + B_c psi(t; shape) at each condition c; the shape is common to all conditions

psi is a growth of the core, named as in drive files, with a time and an exponent. The interval of the shape comes from
its profile, and is open if the data do not limit it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import _core
from pneudrive.estimate.separable import Scan, corrected_criterion, refined, scan
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.friction.campaign.stops.dwell_curve import DwellCurve

    Array = NDArray[np.float64]

KATO_EXPONENT = 0.4  # assumed if not free: stops of a few decades do not determine it
EXPONENTS = np.round(np.linspace(0.15, 1.0, 18), 3)
PER_DECADE = 10  # points of the first profile over a time
FINE = 64  # and of the second one, over the range of the first
#: A time is searched from the shortest stop divided by the first factor to the longest times the second: beyond the
#: first the law is a straight line over log t, beyond the second a straight line over t (or a power of it).
REACH = {"log": (100.0, 10.0), "kato": (100.0, 1e5), "kato-free": (100.0, 1e5)}
USUAL_REACH = (30.0, 30.0)
LEAST_DURATIONS = 3
CONCLUSIVE = 10.0  # difference of AICc beyond which a law has essentially no support [burnham2002]
EMPTY = np.zeros((1, 0))  # the shape of a law without parameters
UNCERTAIN = 2.0  # and difference below which two laws are equally good


@dataclass(frozen=True)
class DwellForm:
    """A law of breakaway over stop duration.

    Attributes
    ----------
    name, title, formula, source : str
        Texts for display.
    growth : str
        Growth of the core; "": breakaway does not depend on the stop.
    units : dict
        Parameters of its shape: time, and exponent if free, with their units.
    exponent : float
        Exponent if not free.
    """

    name: str
    title: str
    formula: str
    source: str
    growth: str
    units: dict[str, str]
    exponent: float = 1.0

    def __str__(self) -> str:
        """Return the title."""
        return self.title

    @property
    def saturates(self) -> bool:
        """Whether the growth has a limit."""
        return self.growth in {"saturating", "hyperbolic"}

    def derivatives(self, duration_s: Array, time_s: float, exponent: float | None = None) -> Array:
        """Return psi and its derivatives by duration, time and exponent, shape (n, 4)."""
        m = self.exponent if exponent is None else exponent
        return _core.dwell_growth(self.growth, np.asarray(duration_s, dtype=float), float(time_s), float(m))

    def psi(self, duration_s: Array, *shape: float) -> Array:
        """Return psi, shape (n,)."""
        return self.derivatives(duration_s, *shape)[:, 0] if self.growth else np.zeros(np.shape(duration_s))

    def slope(self, duration_s: float, *shape: float) -> float:
        """Differentiate psi by the decadic logarithm of the duration."""
        if not self.growth:
            return 0.0
        return float(np.log(10.0) * duration_s * self.derivatives(np.array([duration_s]), *shape)[0, 1])


STRETCHED = "a + B [1 − exp(−(t/τ)^m)]"
FORMS = (
    DwellForm("log", "logarithmic", "a + B ln(1 + t/t0)", "dieterich1979", "log", {"t0": "s"}),
    DwellForm(
        "kato",
        f"stretched exponential, m = {KATO_EXPONENT:g}",
        STRETCHED,
        "kato1972",  # the form is that of slideways
        "saturating",
        {"tau": "s"},
        KATO_EXPONENT,
    ),
    DwellForm(
        "kato-free",
        "stretched exponential, m free",
        STRETCHED,
        "kato1972",
        "saturating",
        {"tau": "s", "m": ""},
    ),
    DwellForm("hyperbolic", "hyperbolic", "a + B t/(t + γ)", "armstrong1994", "hyperbolic", {"gamma": "s"}),
    DwellForm("exponential", "exponential", "a + B [1 − exp(−t/τ)]", "", "saturating", {"tau": "s"}),
    DwellForm("none", "no dependence", "a", "", "", {}),
)


@dataclass(frozen=True, eq=False, repr=False)
class DwellLawFit(Shown):
    """One law, fitted.

    Attributes
    ----------
    form : DwellForm
    shape : dict
        Shape parameter -> estimate. A parameter with an open side of its interval is not determined on that side.
    shape_intervals : dict
        Shape parameter -> (low, high), 95 %; 0 or inf where open.
    level_n, amplitude_n : ndarray, shape (C,)
        a and B at each condition.
    level_intervals_n, amplitude_intervals_n : ndarray, shape (C, 2)
    slope_n, slope_low_n, slope_high_n : float
        Slope per decade at the reference duration, mean over conditions, with its profile interval.
    aicc, bic : float
        inf with too few stops.
    parameters : int
    delta : float
        AICc above that of the best law.
    weight : float
        Akaike weight among the laws.
    """

    form: DwellForm
    shape: dict[str, float]
    shape_intervals: dict[str, tuple[float, float]]
    level_n: Array
    amplitude_n: Array
    level_intervals_n: Array
    amplitude_intervals_n: Array
    slope_n: float
    slope_low_n: float
    slope_high_n: float
    aicc: float
    bic: float
    parameters: int
    delta: float = float("nan")
    weight: float = float("nan")

    @property
    def name(self) -> str:
        """Name of the law."""
        return self.form.name

    def increment_n(self, duration_s: Array, condition: int) -> Array:
        """Return the breakaway increment after stops of these durations."""
        psi = self.form.psi(np.asarray(duration_s, dtype=float), *self.shape.values())
        return self.level_n[condition] + self.amplitude_n[condition] * psi


def fit_forms(curve: DwellCurve, reference_s: float) -> tuple[DwellLawFit, ...]:
    """Fit every law to the stops of a curve, with the scatter and blocks that the curve found.

    Parameters
    ----------
    curve : DwellCurve
    reference_s : float
        Duration of the slope.

    Returns
    -------
    tuple of DwellLawFit
        Best first. Empty with fewer than three durations.
    """
    if curve.data.durations < LEAST_DURATIONS:
        return ()
    whitener = np.linalg.inv(np.linalg.cholesky(curve.scatter_covariance())).astype(np.float64)
    fits = sorted((_fit(curve, form, whitener, reference_s) for form in FORMS), key=lambda f: f.aicc)
    delta = [f.aicc - fits[0].aicc for f in fits]
    weight = np.exp(-0.5 * np.array(delta))
    weight /= weight.sum()
    return tuple(replace(f, delta=d, weight=float(w)) for f, d, w in zip(fits, delta, weight, strict=True))


def _fit(curve: DwellCurve, form: DwellForm, whitener: Array, reference_s: float) -> DwellLawFit:
    n, conditions = len(curve.data), len(curve.data.conditions)
    shortest, longest = float(curve.data.duration_s.min()), float(curve.data.duration_s.max())
    below, above = REACH.get(form.name, USUAL_REACH)
    limits = {"s": (shortest / below, longest * above), "": (EXPONENTS[0], np.inf)}
    linear = conditions + curve.extra.shape[1] + (conditions if form.growth else 0)
    count = linear + len(form.units) + 1
    freedom = max(n - count + 1, 1)
    low, high = limits["s"]
    times = np.geomspace(low, high, int(PER_DECADE * np.log10(high / low)))
    profile = _at(curve, form, whitener, times)
    if form.growth:
        profile = refined(lambda t: _at(curve, form, whitener, t), times, FINE, lambda s: s.rise(freedom))
    rise, best = profile.rise(freedom), profile.coefficient[profile.best]
    slope = np.zeros_like(profile.coefficient)
    slope[:, -conditions:] = np.array([[form.slope(reference_s, *s)] for s in profile.shape]) / conditions
    slope_low, slope_high = profile.interval(slope, rise)
    rows = np.eye(linear)
    ages = rows[-conditions:] if form.growth else np.zeros((conditions, linear))
    cost = max(float(profile.cost[profile.best]), 1e-300)
    deviance = n * np.log(cost / n) - 2.0 * float(np.log(np.diag(whitener)).sum())
    aicc = corrected_criterion(deviance, count, n)
    return DwellLawFit(
        form=form,
        shape=dict(zip(form.units, profile.shape[profile.best].tolist(), strict=True)),
        shape_intervals={
            name: profile.shape_interval(k, rise, limits[unit]) for k, (name, unit) in enumerate(form.units.items())
        },
        level_n=best[:conditions],
        amplitude_n=ages @ best,
        level_intervals_n=np.array([profile.interval(row, rise) for row in rows[:conditions]]),
        amplitude_intervals_n=np.array([profile.interval(row, rise) for row in ages]),
        slope_n=float(slope[profile.best] @ best),
        slope_low_n=slope_low,
        slope_high_n=slope_high,
        aicc=aicc,
        bic=float(deviance + count * np.log(n)) if np.isfinite(aicc) else float("inf"),
        parameters=count,
    )


def _at(curve: DwellCurve, form: DwellForm, whitener: Array, times: Array) -> Scan:
    """Fit a law at these times, and at all exponents if they are free."""
    data, conditions = curve.data, len(curve.data.conditions)
    own = (data.condition[:, None] == np.arange(conditions)[None, :]).astype(float)
    columns = [times, EXPONENTS][: len(form.units)]
    shapes = np.stack(np.meshgrid(*columns, indexing="ij"), axis=-1).reshape(-1, len(columns)) if columns else EMPTY
    designs = np.broadcast_to(np.c_[own, curve.extra], (len(shapes), len(data), conditions + curve.extra.shape[1]))
    if form.growth:
        psi = np.array([form.psi(data.duration_s, *shape) for shape in shapes])
        designs = np.concatenate([designs, own[None, :, :] * psi[:, :, None]], axis=2)
    return scan(shapes, whitener @ designs, whitener @ data.increment_n)
