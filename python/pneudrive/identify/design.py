"""Choice of a law by cross-validation, and design of the next measurement."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import starmap

import numpy as np

from pneudrive.arrays import Array, Interval, Ints, NamedNumbers, Pair, Plain, by_name
from pneudrive.describe.files import toml
from pneudrive.errors import FitError, nearest
from pneudrive.estimate.autocorrelation import distinct_levels
from pneudrive.estimate.design import DesignSpace, exchange, information, within_budget
from pneudrive.estimate.estimates import rms, student
from pneudrive.friction.characterisation import MINIMUM_RANGE_PA
from pneudrive.identify.identified import sentence
from pneudrive.identify.static import model as sliding
from pneudrive.identify.static.fit import assembled, choose_model, fit_values
from pneudrive.identify.static.result import FrictionFit
from pneudrive.identify.static.robust import estimated, with_knee
from pneudrive.identify.static.survey import SPEED_SPAN, of_values, pressure_levels, row_labels
from pneudrive.progress import Flag, Watch
from pneudrive.repr_tables import Shown
from pneudrive.units import readable
from pneudrive.views import ShownTable, View, Viewed

# --- Comparison of laws, and of dependences on pressure, by cross-validation over conditions.

#: Probability of the prediction intervals of held-out values.
PROBABILITY = 0.9
#: Relative error above which a straight line in pressure is reported as wrong.
MISSED = 0.2
#: A curved pressure effect is reported if the curve's error divided by the line's error is below this ratio.
CURVED = 0.75


@dataclass(frozen=True, repr=False)
class Compared(Shown):
    """Result of one law in a comparison.

    Attributes
    ----------
    name : str
    pressure : str or None
        Dependence on pressure.
    fit : FrictionFit
        Fit to all values. It has no viscous part if all speeds are within a factor of three.
    error_n, error : float
        Root mean square of predicted minus measured values of held-out conditions, in N and relative to the friction.
    coverage : float
        Fraction of the held-out values within their prediction interval.
    squares : ndarray, shape (folds,)
        Mean squared error of prediction for each held-out condition, in N^2.
    worst : float
        Largest relative error of the predicted mean friction of a held-out condition.
    worst_at : str
        Condition with this error, as text.

    The errors are infinite if the values without a held-out condition do not determine the law.
    """

    name: str
    pressure: str | None
    fit: FrictionFit
    error_n: float = np.inf
    error: float = np.inf
    coverage: float = np.nan
    squares: Array = field(default_factory=lambda: np.full(1, np.inf))
    worst: float = np.nan
    worst_at: str = ""

    @property
    def free(self) -> int:
        """Number of free parameters, including the knee of a saturating dependence on pressure."""
        return len(self.fit.free) + self.fit.model.chosen

    @property
    def title(self) -> str:
        """Law and dependence on pressure."""
        return self.name + (f", {self.pressure} in pressure" if self.pressure else "")


@dataclass(frozen=True, repr=False)
class LawComparison(Viewed):
    """Comparison of laws on one friction map, sorted by the error of held-out values.

    Attributes
    ----------
    rows : tuple of Compared
    held_out : str
        Kind of the held-out conditions.
    folds : int
        Number of held-out conditions.
    recommended : Compared
        Simplest law whose held-out error exceeds the smallest error by at most one standard error of the difference.
        If this law does not fit all values (`FrictionFit.fits`) but other laws do: the other law with the smallest
        held-out error.
    statements : tuple of str
        Sentences on the recommendation and on the error of a straight line in pressure.
    """

    rows: tuple[Compared, ...]
    held_out: str
    folds: int
    recommended: Compared
    statements: tuple[str, ...]

    def view(self) -> View:
        """Return the recommendation, the compared laws, and further sentences."""
        head = ("law", "free", "AICc", "BIC", "error N", "error %", f"in {100 * PROBABILITY:.0f} %, %")
        rows = []
        for row in self.rows:
            criteria = (f"{row.fit.statistics[name]:.1f}" for name in ("aicc", "bic"))
            errors = (f"{row.error_n:.3g}", f"{100 * row.error:.1f}", f"{100 * row.coverage:.0f}")
            rows.append((row.title, str(row.free), *criteria, *(errors if row.error < np.inf else ("–",) * 3)))
        caption = f"held out in turn: each of {self.folds} conditions of {self.held_out}"
        title, *notes = self.statements
        return View(title, notes=tuple(notes), tables=(ShownTable(caption, head, tuple(rows)),))


def select_friction_law(
    friction_map: sliding.AnyMap,
    laws: Sequence[str] = tuple(sliding.CANDIDATES),
    *,
    pressure: Sequence[str] | None = None,
    hold_out: str | Sequence[str] | None = None,
    exclude_flags: Collection[str] = sliding.NOT_SLIDING,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> LawComparison:
    """Compare friction laws by AICc, BIC, and by cross-validation over conditions.

    Parameters
    ----------
    friction_map : xarray.Dataset, path-like or Characterisation
        As for :func:`fit_friction`.
    laws : sequence of str
        ``coulomb``, ``stribeck`` or ``stribeck gaussian``, ``stribeck exponential``, ``stribeck lorentzian``,
        ``stribeck free``.
    pressure : sequence of str, optional
        Dependences on pressure; each is combined with each law. Empty: laws without pressure. Default: with and without
        pressure, if pressure was varied.
    hold_out : str or sequence of str, optional
        Groups held out together: ``pressure``, ``speed``, ``recording``, a column of the map (``seal``, ``day``,
        ``mounting``), or a label for each row. The default is ``pressure`` for three or more pressures, else ``speed``.
        Holding out single values would be too optimistic, because values at the same condition predict them.
    exclude_flags
        As for :func:`fit_friction`.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.

    Returns
    -------
    LawComparison

    Raises
    ------
    FitError
        A name is unknown, there are fewer than three conditions to hold out, or no law can be tested.
    """
    for name in laws:
        if name not in sliding.NAMES:
            raise FitError(f"the law {name!r} cannot be compared", remedy=nearest(name, sliding.NAMES))
    friction_map = sliding.map_of(friction_map)
    data, notes, selected = sliding.selected(friction_map, exclude_flags=exclude_flags)
    forms, levels = _forms(data, pressure), pressure_levels(data)
    if hold_out is None:
        hold_out = "pressure" if levels.max() >= 2 else "speed"
    held_out = hold_out if isinstance(hold_out, str) else "label"
    if hold_out == "pressure":
        folds = levels
    elif hold_out == "speed":
        folds = np.searchsorted([high for _, high in distinct_levels(data.speed_m_s)], data.speed_m_s)
    else:
        labels = of_values(friction_map, row_labels(friction_map, hold_out), data)
        folds = np.unique(labels, return_inverse=True)[1]
    if folds.max() < 2:
        raise FitError.of("identify.few_conditions", name=held_out, count=int(folds.max()) + 1)
    wanted = [(name, form) for name in dict.fromkeys(sliding.NAMES[law] for law in laws) for form in forms]
    each = Watch(progress, cancel).each(wanted, "laws fitted, each with every condition left out once")
    tried = [_compared(name, form, data, folds, notes, selected) for name, form in each]
    rows = [row for row in tried if isinstance(row, Compared)]
    if not rows:
        raise FitError("no law can be compared on this map", value="; ".join(str(row) for row in tried))
    rows, same = _distinct(rows)
    tried += same
    best = min(rows, key=lambda row: row.error_n)
    if not best.error < np.inf:
        raise FitError.of("identify.needs_conditions", name=best.title, held_out=held_out)

    def is_as_good(row: Compared) -> bool:
        excess = row.squares - best.squares
        return excess.mean() <= excess.std(ddof=1) / np.sqrt(excess.size)

    tested = [row for row in rows if row.error < np.inf]
    simple = min(filter(is_as_good, tested), key=lambda row: (row.free, row.error_n))
    follow = [row for row in rows if row.fit.fits and not simple.fit.fits]
    # Criteria of laws that follow all values exactly differ only by rounding.
    recommended = min(follow, key=lambda row: (row.error_n, round(row.fit.statistics["bic"], 1)), default=simple)
    said = [*_statements(rows, best, simple, recommended, held_out), *(row for row in tried if isinstance(row, str))]
    if untested := "; ".join(row.title for row in rows if not row.error < np.inf):
        said.append(sentence("laws", "untested", titles=untested, held_out=held_out))
    ordered = tuple(sorted(rows, key=lambda row: row.error_n))
    return LawComparison(ordered, held_out, int(folds.max()) + 1, recommended, tuple(said))


def _distinct(rows: list[Compared]) -> tuple[list[Compared], list[str]]:
    """Remove laws that the data cannot distinguish from a simpler compared law. Return the other laws, and notes."""
    asked = {(row.name, row.pressure) for row in rows}
    kept = []
    for row in rows:
        form = row.pressure and row.fit.model.pressure
        name = row.name if row.fit.model.stribeck else "coulomb"
        if (name, form) == (row.name, row.pressure) or (name, form) not in asked:
            kept.append(row)
    notes = []
    for key in ("name", "pressure"):
        every, shown = (dict.fromkeys(str(getattr(row, key)) for row in some) for some in (rows, kept))
        if lost := ", ".join(name for name in every if name not in shown):
            notes.append(sentence("laws", f"same_{key}", lost=lost))
    return kept, notes


def _forms(data: sliding.Observations, wanted: Sequence[str] | None) -> tuple[str | None, ...]:
    if wanted is not None:
        for form in wanted:
            if form not in sliding.PRESSURE_FORMS:
                raise FitError(
                    f"the dependence on pressure {form!r} is not known", remedy=nearest(form, sliding.PRESSURE_FORMS)
                )
        return tuple(wanted) or (None,)
    varied = [np.ptp(gauge) > MINIMUM_RANGE_PA for gauge in data.gauges_pa]
    forms = sliding.PRESSURE_FORMS if all(varied) else sliding.PRESSURE_FORMS[:3]
    return (None, *(forms if any(varied) else ()))


def _compared(
    name: str,
    form: str | None,
    data: sliding.Observations,
    folds: Ints,
    notes: list[str],
    selected: Plain,
) -> Compared | str:
    """Fit a law and predict the held-out conditions, or return the reason why this is not possible."""
    wide = float(data.speed_m_s.max() / data.speed_m_s.min()) >= SPEED_SPAN
    try:
        wanted = replace(sliding.CANDIDATES[name], viscous=wide)
        options = {"pressure_dependence": form is not None} | selected
        fit = fit_values(wanted, data, pressure=form, notes=notes, options=options)
    except FitError as problem:
        return f"{name} is not compared: {problem.what}"
    error, inside = np.empty(len(data)), np.empty(len(data), dtype=bool)
    squares, means = np.empty((2, int(folds.max()) + 1))
    plain = replace(fit.model, chambers=(), pressure="linear", knee_pa=None)
    for fold in range(squares.size):
        left = folds == fold
        at, rest = data.take(left), data.take(~left)
        try:  # with the model that all values together determine
            chosen, lost = choose_model(plain, rest, pressure=form)
        except FitError:  # fewer values are left than this model has parameters
            return Compared(name, form, fit)
        if chosen != replace(fit.model, knee_pa=None):
            return Compared(name, form, fit)
        found = estimated(with_knee(chosen, rest), rest)
        without = assembled(fit.model.law, found, {}, lost, [], {"direction": "both"})
        band = without.predict(at.speed_m_s, *at.gauges_pa, stderr_n=at.stderr_n, probability=PROBABILITY)
        error[left] = band.friction_n - at.friction_n
        inside[left] = (band.lower_n <= at.friction_n) & (at.friction_n <= band.upper_n)
        squares[fold] = np.mean(error[left] ** 2)
        means[fold] = np.mean(error[left]) / np.mean(np.abs(at.friction_n))
    worst = int(np.argmax(np.abs(means)))
    size_n = rms(error)
    return Compared(
        name,
        form,
        fit,
        error_n=size_n,
        error=size_n / rms(data.friction_n),
        coverage=float(np.mean(inside)),
        squares=squares,
        worst=float(means[worst]),
        worst_at=_condition(data.take(folds == worst)),
    )


def _condition(at: sliding.Observations) -> str:
    def span(values: Array, factor: float, unit: str) -> str:
        low, high = factor * float(values.min()), factor * float(values.max())
        return f"{low:.3g} {unit}" if f"{low:.3g}" == f"{high:.3g}" else f"{low:.3g} to {high:.3g} {unit}"

    a, b = (span(gauge, 1e-5, "bar") for gauge in at.gauges_pa)
    return f"{span(at.speed_m_s, 1e3, 'mm/s')}, chamber a {a}, b {b} gauge"


def _statements(
    rows: list[Compared], best: Compared, simple: Compared, recommended: Compared, held_out: str
) -> Iterator[str]:
    if recommended is simple:
        yield _sentence("recommended", recommended, held_out=held_out, coverage=100 * recommended.coverage)
        yield from [_sentence("no_better", best)] if recommended is not best else []
    else:
        yield _sentence("follows", recommended, simple=simple.title, scale=simple.fit.statistics["scale"])
    lines = [row for row in rows if row.pressure == "linear" and row.name == recommended.name]
    gained = bool(lines) and abs(recommended.worst) < CURVED * abs(lines[0].worst)
    if gained and recommended.pressure != "linear" and abs(lines[0].worst) > MISSED:
        yield _sentence("line_misses", lines[0], held_out=held_out)
    elif abs(recommended.worst) > MISSED:
        yield _sentence("none_holds", recommended, held_out=held_out)


def _sentence(key: str, row: Compared, **values: object) -> str:
    """Return a sentence on a compared law."""
    errors = {"error": 100 * row.error, "worst": 100 * abs(row.worst), "at": row.worst_at}
    return sentence("laws", key, title=row.title, **errors, **values)


# --- Design of the next measurement: speeds and pressures that best determine a friction law, with expected
# intervals.

#: Number of prior samples over which a criterion is averaged.
DRAWS = 32
#: Number of candidate speeds, in logarithmic steps, and digits of proposed speeds.
SPEEDS, DIGITS = 120, 3
#: Number of candidate speeds if the time is given. Each is chosen at most once, so closer speeds would act as repeats.
SPEEDS_IN_TIME = 30
#: Largest standard deviation of ln vs (and ln n) in the prior from a fit; 1 is a factor of 2.7.
WIDEST = 1.0


@dataclass(frozen=True, repr=False)
class Prior(Shown):
    """Prior distribution of a law's parameters before the next measurement.

    Attributes
    ----------
    model : FrictionModel
    draws : ndarray, shape (d, p)
        Random samples of the internal coordinates.
    known : ndarray, shape (d, p, p)
        Information matrix of the coordinates from earlier measurements; zero without measurements.
    values : int
        Number of measured values.
    noise_n : float
        Standard deviation of a further measured value, N; NaN if unknown.
    """

    model: sliding.FrictionModel
    draws: Array
    known: Array
    values: int = 0
    noise_n: float = np.nan

    @classmethod
    def of_fit(cls, fit: FrictionFit) -> Prior:
        """Return the prior from the estimates of a fit and their covariance.

        The values of the fit count as earlier measurements.
        """
        centre = fit.coordinates
        to_internal = np.linalg.pinv(fit.model.transforms.jacobian(centre))
        covariance = to_internal @ fit.covariance @ to_internal.T
        deviation = np.sqrt(np.diag(covariance))
        size = np.outer(deviation, deviation)
        known = np.linalg.pinv(covariance / size, rcond=1e-12, hermitian=True) / size
        is_log = [name.startswith("stribeck_") or name == "breakaway" for name in fit.free]
        share = np.where(is_log, np.minimum(1.0, WIDEST / np.maximum(deviation, 1e-12)), 1.0)
        rng = np.random.default_rng(1)
        spread = rng.multivariate_normal(
            np.zeros(centre.size), covariance * np.outer(share, share), DRAWS, method="eigh"
        )
        points = np.vstack([centre, centre + spread[1:]])
        for k, name in enumerate(fit.model.names):
            if name in ("coulomb", "viscous"):  # positive, as in a fit
                points[:, k] = np.maximum(points[:, k], 0.05 * abs(points[0, k]))
        values = int(fit.statistics["values"])
        noise_n = fit.statistics.get("noise_n", fit.statistics["rms_n"])  # older files lack the noise
        return cls(fit.model, points, np.broadcast_to(known, (DRAWS, *known.shape)).copy(), values, noise_n)

    def with_separate_slopes(self) -> Prior:
        """Return the prior with separate slopes instead of one slope for both chambers. Only their mean is known."""
        separate, shared = replace(self.model, chambers=("a", "b")), self.model.names
        source = [shared.index(name if name in shared else f"{name[:-1]}ab") for name in separate.names]
        mean = np.eye(len(shared))[:, source]
        mean /= mean.sum(axis=1, keepdims=True)
        return replace(self, model=separate, draws=self.draws[:, source], known=mean.T @ self.known @ mean)


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

    speed_m_s: Interval
    gauges_pa: tuple[Pair, ...] = ((0.0, 0.0),)
    stroke_m: float = 0.1
    acceleration_m_s2: float = 5.0
    strokes: int = 1
    settling_s: float = 0.0

    def seconds(self, speed_m_s: Array) -> Array:
        """Return the time on the rig for one point at each speed: strokes out and back with ramps."""
        one = np.maximum(self.stroke_m / speed_m_s, speed_m_s / self.acceleration_m_s2)
        return 2.0 * self.strokes * (one + speed_m_s / self.acceleration_m_s2) + self.settling_s


@dataclass(frozen=True, order=True)
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
    """

    points: tuple[Point, ...]
    criterion: str
    half_widths_now: NamedNumbers
    half_widths_then: NamedNumbers
    seconds: float

    def view(self) -> View:
        """Return the points and the expected intervals."""
        points = tuple(
            (f"{1e3 * p.speed_m_s:.3g}", f"{1e-5 * p.gauge_a_pa:.3g}", f"{1e-5 * p.gauge_b_pa:.3g}", str(p.repeats))
            for p in self.points
        )
        widths = []
        for name, then in self.half_widths_then.items():
            size, unit = readable(sliding.unit_of(name))
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

    def protocol(self) -> str:
        """Return a protocol for ``pneudrive campaign plan``: every proposed speed at every proposed pressure.

        All points have the same number of repeats: the mean number in the design.
        """
        speeds = sorted({p.speed_m_s for p in self.points})
        gauges = sorted({(p.gauge_a_pa, p.gauge_b_pa) for p in self.points})
        repeats = max(1, round(sum(p.repeats for p in self.points) / len(self.points)))
        pairs = [{"a": f"{1e-5 * a:.6g} bar gauge", "b": f"{1e-5 * b:.6g} bar gauge"} for a, b in gauges]
        tables = {
            "schema": 1,
            "name": "Next points",
            "about": f"{self.criterion}-optimal points",
            "repeats": repeats,
            "speed": {"list": [f"{1e3 * v:.6g} mm/s" for v in speeds]},
            "pressure": {"pairs": pairs},
            "order": {"kind": "randomised"},
        }
        return toml.write(tables)


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
    """Choose the next points to measure by Fedorov's exchange, from a grid of speeds and the pressures in `limits`.

    The criterion is averaged over the prior, because a design for one Stribeck velocity is poor for another.

    Parameters
    ----------
    source : FrictionFit or Prior
        Prior knowledge. The data of a fit count as earlier measurements.
    limits : Limits
    points : int, optional
        Number of points, including repeats. The default, without `seconds`, is twice the number of free parameters.
    seconds : float, optional
        Time on the rig instead of a number of points. Points are added in the order of their gain per time. All
        points have the same number of repeats, as in a protocol.
    criterion : str
        ``D`` (all parameters) or ``I`` (the prediction over the range `over`).
    over : Limits, optional
        Range of prediction; by default `limits`.
    noise_n : float, optional
        Standard deviation of the friction at one point. Default: value from the fit, including the scatter.

    Returns
    -------
    Design
    """
    prior = Prior.of_fit(source) if isinstance(source, FrictionFit) else source
    now = _half_widths(prior, prior.known, prior.values)
    if prior.model.chambers == ("ab",) and any(a != b for a, b in limits.gauges_pa):
        prior = prior.with_separate_slopes()
        now = dict.fromkeys(prior.model.names, np.inf) | now
    noise = prior.noise_n if noise_n is None else noise_n
    low, high = limits.speed_m_s
    if not 0.0 < low < high:
        raise FitError(
            "the lowest speed of the limits must be above 0 and below the highest", value=f"{low:g} .. {high:g} m/s"
        )
    if criterion not in ("D", "I"):
        raise FitError(f"there is no criterion {criterion!r}", rule="D: all parameters; I: the prediction over a range")
    if points is not None and (points < 1 or seconds is not None):
        raise FitError("points must be at least 1, and cannot be combined with seconds", value=f"points = {points}")
    if not np.isfinite(noise) or noise <= 0.0:
        raise FitError.of("identify.no_noise", noise=noise)
    grid = _grid(limits, SPEEDS if seconds is None else SPEEDS_IN_TIME)
    region = None
    if criterion == "I":
        g = _gradients(prior, _grid(over or limits))
        region = np.einsum("dci,dcj->dij", g, g) / g.shape[1]
    candidates = DesignSpace(_gradients(prior, grid) / noise, prior.known, region)
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
    columns = (grid.speed_m_s, *grid.gauges_pa, counts.astype(int))
    proposed = zip(*(column[counts > 0.0].tolist() for column in columns), strict=True)
    return Design(
        tuple(sorted(starmap(Point, proposed))),
        criterion,
        now,
        _half_widths(prior, information(candidates, counts), prior.values + chosen.size),
        float(cost @ counts),
    )


def _grid(limits: Limits, count: int = SPEEDS) -> sliding.Observations:
    speeds = np.geomspace(*limits.speed_m_s, count)
    speeds[1:-1] = [float(f"{v:.{DIGITS}g}") for v in speeds[1:-1]]
    pairs = np.array(limits.gauges_pa, dtype=float).reshape(-1, 2)
    gauge_a, gauge_b = np.repeat(pairs, count, axis=0).T
    return sliding.at_conditions(np.tile(speeds, len(pairs)), gauge_a, gauge_b)


def _gradients(prior: Prior, at: sliding.Observations) -> Array:
    return np.array([prior.model.value_and_jacobian(q, at)[1] for q in prior.draws])


def _half_widths(prior: Prior, matrix: Array, values: int) -> NamedNumbers:
    """Return the half-width of each parameter's 95 % interval in SI: the median over the prior samples.

    `values` is the number of values, for Student's t.
    """
    free = values - len(prior.model.names)
    found = []
    for q, m in zip(prior.draws, matrix, strict=True):
        size = np.sqrt(np.diag(m))
        if not (size > 0.0).all() or np.linalg.cond(m / np.outer(size, size)) > 1e12:
            found.append(np.full(q.size, np.inf))
            continue
        jac = prior.model.transforms.jacobian(q)
        inner = np.linalg.inv(m / np.outer(size, size)) / np.outer(size, size)
        found.append(np.sqrt(np.diag(jac @ inner @ jac.T)))
    reach = student(free) if free > 0 else np.inf
    middle = reach * np.median(found, axis=0)
    return by_name(prior.model.names, middle)
