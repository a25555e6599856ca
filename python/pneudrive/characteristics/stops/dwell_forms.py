"""Laws of breakaway over stop duration, fitted side by side and compared by information criteria.

  y = a_c + B_c psi(t; shape)      at each condition c; the shape is common to all of them

  log           psi = ln(1 + t/t0)              grows without bound; rock friction [dieterich1979]
  kato          psi = 1 - exp(-(t/tau)^m)       saturates; m = 0.4 assumed; the form is that of slideways [kato1972]
  kato-free     the same with m free
  hyperbolic    psi = t/(t + gamma)             saturates [armstrong1994]
  exponential   psi = 1 - exp(-t/tau)           saturates: a lubricant film that is squeezed out
  none          psi = 0                         breakaway does not depend on the stop

At a given shape a law is linear, so the profile over the shape needs no repeated fits, and intervals are open where the
data set no bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.estimate.estimates import student
from pneudrive.estimate.separable import Scan, scan
from pneudrive.show import Shown

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pneudrive.characteristics.stops.dwell_curve import DwellCurve

    Array = NDArray[np.float64]

KATO_EXPONENT = 0.4  # assumed where it is not free: stops of a few decades do not determine it
EXPONENTS = tuple(np.round(np.linspace(0.15, 1.0, 18), 3))
PER_DECADE = 10  # points of the first profile over a time
FINE = 64  # and of the second one, over what the first leaves
#: A time is sought from the shortest stop, divided by the first factor, to the longest, times the second: beyond the
#: first the law is a straight line over log t, beyond the second a straight line over t (or a power of it).
REACH = {"log": (100.0, 10.0), "saturating": (30.0, 30.0), "kato": (100.0, 1e5)}
LEAST_DURATIONS = 3
CONCLUSIVE = 10.0  # difference of AICc beyond which a law has essentially no support [burnham2002]
UNCERTAIN = 2.0  # and below which two laws are equally good


@dataclass(frozen=True, repr=False)
class Form(Shown):
    """A law: name as shown, formula, shape parameters with their units, and psi with its derivative by log10 t."""

    name: str
    title: str
    formula: str
    shape: tuple[tuple[str, str], ...]
    saturates: bool
    source: str
    psi: Callable[..., Array]
    slope: Callable[..., Array]


def _log(t: Array, t0: Any) -> Array:  # noqa: ANN401 - scalar or array
    return np.log1p(t / t0)


def _log_slope(t: Array, t0: Any) -> Array:  # noqa: ANN401
    return np.log(10.0) * t / (t + t0)


def _kato(t: Array, tau: Any, m: Any) -> Array:  # noqa: ANN401
    return -np.expm1(-((t / tau) ** m))


def _kato_slope(t: Array, tau: Any, m: Any) -> Array:  # noqa: ANN401
    power = (t / tau) ** m
    return np.log(10.0) * m * power * np.exp(-power)


FORMS = (
    Form("log", "logarithmic", "a + B ln(1 + t/t0)", (("t0", "s"),), False, "dieterich1979", _log, _log_slope),
    Form(
        "kato",
        f"stretched exponential, m = {KATO_EXPONENT:g}",
        "a + B [1 − exp(−(t/τ)^m)]",
        (("tau", "s"),),
        True,
        "kato1972",
        lambda t, tau: _kato(t, tau, KATO_EXPONENT),
        lambda t, tau: _kato_slope(t, tau, KATO_EXPONENT),
    ),
    Form(
        "kato-free",
        "stretched exponential, m free",
        "a + B [1 − exp(−(t/τ)^m)]",
        (("tau", "s"), ("m", "")),
        True,
        "kato1972",
        _kato,
        _kato_slope,
    ),
    Form(
        "hyperbolic",
        "hyperbolic",
        "a + B t/(t + γ)",
        (("gamma", "s"),),
        True,
        "armstrong1994",
        lambda t, gamma: t / (t + gamma),
        lambda t, gamma: np.log(10.0) * t * gamma / (t + gamma) ** 2,
    ),
    Form(
        "exponential",
        "exponential",
        "a + B [1 − exp(−t/τ)]",
        (("tau", "s"),),
        True,
        "",
        lambda t, tau: _kato(t, tau, 1.0),
        lambda t, tau: _kato_slope(t, tau, 1.0),
    ),
    Form("none", "no dependence", "a", (), False, "", np.zeros_like, np.zeros_like),
)


@dataclass(frozen=True, eq=False, repr=False)
class LawFit(Shown):
    """One law, fitted.

    Attributes
    ----------
    form : Form
    shape : dict
        Shape parameter -> estimate; one whose interval is open on a side is not determined on that side.
    shape_intervals : dict
        Shape parameter -> (low, high), 95 %; 0 or inf where open.
    level_n, amplitude_n : ndarray, shape (C,)
        a and B at each condition.
    level_intervals_n, amplitude_intervals_n : ndarray, shape (C, 2)
    slope_n, slope_low_n, slope_high_n : float
        Slope per decade at the reference duration, mean over conditions, with its profile interval.
    aicc, bic : float
        NaN-free; inf where there are too few stops.
    delta : float
        AICc above that of the best law.
    weight : float
        Akaike weight among the laws.
    parameters : int
    """

    form: Form
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
    delta: float
    weight: float
    parameters: int

    @property
    def name(self) -> str:
        """Name of the law."""
        return self.form.name

    def increment_n(self, duration_s: Array, condition: int) -> Array:
        """Breakaway increment after stops of these durations."""
        psi = self.form.psi(np.asarray(duration_s, dtype=float), *self.shape.values())
        return self.level_n[condition] + self.amplitude_n[condition] * psi


def fit_forms(curve: DwellCurve, reference_s: float) -> tuple[LawFit, ...]:
    """Fit every law to the stops of a curve, with the scatter and blocks that the curve found.

    Parameters
    ----------
    curve : DwellCurve
    reference_s : float
        Where the slope is told.

    Returns
    -------
    tuple of LawFit
        Best first. Empty where fewer than three durations were run.
    """
    if curve.data.durations < LEAST_DURATIONS:
        return ()
    whitener = np.linalg.inv(np.linalg.cholesky(curve.scatter_covariance())).astype(np.float64)
    fits = [_fit(curve, form, whitener, reference_s) for form in FORMS]
    best = min(f["aicc"] for f in fits)
    raw = np.array([np.exp(-0.5 * (f["aicc"] - best)) if np.isfinite(best) else np.nan for f in fits])
    total = raw.sum()
    out = [
        LawFit(**f, delta=float(f["aicc"] - best) if np.isfinite(best) else float("nan"), weight=float(w / total))
        for f, w in zip(fits, raw, strict=True)
    ]
    return tuple(sorted(out, key=lambda f: f.aicc))


def _limits(form: Form, duration_s: Array) -> tuple[float, float]:
    below, above = REACH["log" if form.name == "log" else "kato" if form.name.startswith("kato") else "saturating"]
    return float(duration_s.min()) / below, float(duration_s.max()) * above


def _shapes(form: Form, low: float, high: float, count: int) -> list[tuple[float, ...]]:
    if not form.shape:
        return [()]
    times = np.geomspace(low, high, count)
    if len(form.shape) == 1:
        return [(float(t),) for t in times]
    return [(float(t), float(m)) for t in times for m in EXPONENTS]


def _profile(curve: DwellCurve, form: Form, whitener: Array, shapes: list[tuple[float, ...]]) -> Scan:
    data, conditions = curve.data, len(curve.data.conditions)
    own = np.zeros((len(data), conditions))
    own[np.arange(len(data)), data.condition] = 1.0
    common = np.broadcast_to(
        whitener @ np.c_[own, curve.extra], (len(shapes), len(data), conditions + curve.extra.shape[1])
    )
    designs = common
    if form.shape:
        psi = np.array([form.psi(data.duration_s, *shape) for shape in shapes])
        designs = np.concatenate([common, whitener @ (own[None, :, :] * psi[:, :, None])], axis=2)
    return scan(designs, whitener @ data.increment_n)


def _fit(curve: DwellCurve, form: Form, whitener: Array, reference_s: float) -> dict[str, Any]:
    data, conditions = curve.data, len(curve.data.conditions)
    limits = _limits(form, data.duration_s)
    shapes = _shapes(form, *limits, int(PER_DECADE * np.log10(limits[1] / limits[0])))
    profile = _profile(curve, form, whitener, shapes)
    n, linear = len(data), profile.coefficient.shape[1]
    allowed = _allowed(profile.cost.min(), n, linear + len(form.shape))
    if form.shape:
        times = np.array([s[0] for s in shapes])
        near = times[profile.cost <= profile.cost.min() + allowed]
        step = 10.0 ** (1.0 / PER_DECADE)
        fine = (max(near.min() / step, limits[0]), min(near.max() * step, limits[1]))
        shapes = _shapes(form, *fine, FINE)
        profile = _profile(curve, form, whitener, shapes)
    count = linear + len(form.shape) + 1
    at = profile.best
    deviance = n * np.log(max(profile.cost[at], 1e-300) / n) - 2.0 * float(np.log(np.diag(whitener)).sum())
    spare = n - count - 1
    allowed = _allowed(profile.cost[at], n, linear + len(form.shape))
    inside = np.flatnonzero(profile.cost <= profile.cost[at] + allowed)
    slack = np.sqrt(np.maximum(profile.cost[at] + allowed - profile.cost[inside], 0.0))
    slope = np.zeros((len(shapes), linear))
    if form.name != "none":
        gradient = np.array([float(form.slope(np.array([reference_s]), *s)[0]) for s in shapes])
        slope[:, -conditions:] = gradient[:, None] / conditions
    low, high = _union(profile, inside, slack, slope)
    levels = [_union(profile, inside, slack, np.eye(linear)[[c] * len(shapes)]) for c in range(conditions)]
    ages = range(linear - conditions, linear) if form.name != "none" else ()
    amplitudes = [_union(profile, inside, slack, np.eye(linear)[[c] * len(shapes)]) for c in ages]
    best = profile.coefficient[at]
    return {
        "form": form,
        "shape": {name: shapes[at][i] for i, (name, _) in enumerate(form.shape)},
        "shape_intervals": _shape_intervals(form, shapes, inside, limits),
        "level_n": best[:conditions],
        "amplitude_n": best[-conditions:] if form.name != "none" else np.zeros(conditions),
        "level_intervals_n": np.array(levels),
        "amplitude_intervals_n": np.array(amplitudes or [(0.0, 0.0)] * conditions),
        "slope_n": float(slope[at] @ best),
        "slope_low_n": low,
        "slope_high_n": high,
        "aicc": float(deviance + 2 * count + 2 * count * (count + 1) / spare) if spare > 0 else float("inf"),
        "bic": float(deviance + count * np.log(n)) if spare > 0 else float("inf"),
        "parameters": count,
    }


def _allowed(cost: float, n: int, parameters: int) -> float:
    """Rise of the cost at the ends of a 95 % interval of one quantity."""
    freedom = max(n - parameters, 1)
    return cost / freedom * student(freedom) ** 2


def _union(profile: Scan, inside: NDArray[np.intp], slack: Array, rows: Array) -> tuple[float, float]:
    """Give the ends of a linear quantity over all shapes that the data allow."""
    value = np.einsum("gi,gi->g", rows, profile.coefficient)[inside]
    reach = slack * np.sqrt(np.maximum(np.einsum("gi,gij,gj->g", rows, profile.covariance, rows), 0.0)[inside])
    return float((value - reach).min()), float((value + reach).max())


def _shape_intervals(
    form: Form, shapes: list[tuple[float, ...]], inside: NDArray[np.intp], limits: tuple[float, float]
) -> dict[str, tuple[float, float]]:
    """Give the ends of each shape parameter; open (0, inf) where they reach the end of what is sought."""
    out = {}
    for i, (name, unit) in enumerate(form.shape):
        allowed = np.array([shapes[g][i] for g in inside])
        low, high = float(allowed.min()), float(allowed.max())
        ends = limits if unit == "s" else (EXPONENTS[0], float("inf"))
        out[name] = (
            0.0 if low <= ends[0] * (1 + 1e-9) else low,
            float("inf") if high >= ends[1] * (1 - 1e-9) else high,
        )
    return out
