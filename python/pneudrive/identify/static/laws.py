"""Comparison of laws and dependences on pressure by cross-validation over conditions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError, nearest
from pneudrive.estimate.autocorrelation import distinct_levels
from pneudrive.friction.pressure import MINIMUM_RANGE_PA
from pneudrive.identify.static.diagnose import Support, choose_model, estimated, with_knee
from pneudrive.identify.static.fit import assembled, fit_values
from pneudrive.identify.static.model import PRESSURE_FORMS, FrictionModel
from pneudrive.identify.static.observations import ambient_of, observations
from pneudrive.identify.static.survey import SPEED_SPAN, pressure_levels, row_labels
from pneudrive.progress import Watch
from pneudrive.repr_tables import Shown
from pneudrive.views import ShownTable, View, Viewed

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.identify.static.model import Observations
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.progress import Flag

    Array = NDArray[np.float64]

#: Compared laws by name.
CANDIDATES = {
    "coulomb": FrictionModel("coulomb"),
    "stribeck gaussian": FrictionModel("stribeck"),
    "stribeck exponential": FrictionModel("stribeck", exponent=1.0),
    "stribeck lorentzian": FrictionModel("stribeck", lorentzian=True),
    "stribeck free": FrictionModel("stribeck", exponent=None),
}
#: Relative error of a straight line above which it is reported.
MISSED = 0.2
#: Error of a curve, as a share of that of the line, below which the line is blamed.
CURVED = 0.75


@dataclass(frozen=True, repr=False)
class Compared(Shown):
    """Result of one compared law.

    Attributes
    ----------
    name : str
    pressure : str or None
        Dependence on pressure.
    fit : FrictionFit
        Fit to all values.
    aicc, bic : float
    error_n, error : float
        Root mean square of predicted minus measured values of held-out conditions, N, and relative to the friction.
    coverage : float
        Share of the held-out values within their prediction interval.
    squares : ndarray, shape (folds,)
        Mean square of each held-out condition, N^2.
    worst : float
        Largest relative error of a held-out condition's mean.
    worst_at : str
        That condition in words.
    viscous : bool
        Whether a viscous part was fitted. It is not fitted if all speeds are within a factor of three.
    """

    name: str
    pressure: str | None
    fit: FrictionFit
    error_n: float
    error: float
    coverage: float
    squares: Array
    worst: float
    worst_at: str
    viscous: bool

    @property
    def free(self) -> int:
        """Number of free parameters, including the knee."""
        return len(self.fit.free) + self.fit.model.chosen

    @property
    def aicc(self) -> float:
        """Criterion of the fit."""
        return self.fit.statistics["aicc"]

    @property
    def bic(self) -> float:
        """Criterion of the fit."""
        return self.fit.statistics["bic"]

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
    probability : float
        Probability of the prediction intervals.
    recommended : Compared
        The simplest law whose held-out error is not larger than the smallest by more than one standard error of their
        difference.
    statements : tuple of str
        Sentences on the recommendation and on the error of a straight line in pressure.
    """

    rows: tuple[Compared, ...]
    held_out: str
    folds: int
    probability: float
    recommended: Compared
    statements: tuple[str, ...]

    def view(self) -> View:
        """Return the recommendation, the compared laws, and further sentences."""
        head = ("law", "free", "AICc", "BIC", "error N", "error %", f"in {100 * self.probability:.0f} %, %")
        rows = tuple(
            (row.title, str(row.free), f"{row.aicc:.1f}", f"{row.bic:.1f}", f"{row.error_n:.3g}",
             f"{100 * row.error:.1f}", f"{100 * row.coverage:.0f}")
            for row in self.rows
        )  # fmt: skip
        caption = f"held out in turn: each of {self.folds} conditions of {self.held_out}"
        title, *notes = self.statements
        return View(title, notes=tuple(notes), tables=(ShownTable(caption, head, rows),))


def select_friction_law(
    friction_map: xr.Dataset,
    laws: Sequence[str] = tuple(CANDIDATES),
    *,
    pressure: Sequence[str] | None = None,
    hold_out: str | Sequence[str] | None = None,
    direction: int | None = None,
    ambient_pressure_pa: float | None = None,
    exclude_flags: Collection[str] = (),
    loss: str = "huber",
    probability: float = 0.9,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> LawComparison:
    """Compare friction laws by AICc, BIC, and by cross-validation over conditions.

    Parameters
    ----------
    friction_map : xarray.Dataset
        As for :func:`fit_friction`.
    laws : sequence of str
        ``coulomb``, ``stribeck gaussian``, ``stribeck exponential``, ``stribeck lorentzian``, ``stribeck free``.
    pressure : sequence of str, optional
        Dependences on pressure, each combined with each law; by default all if the pressure was varied. Empty: none.
    hold_out : str or sequence of str, optional
        Groups held out together: ``pressure``, ``speed``, ``recording``, a column of the map (``seal``, ``day``,
        ``mounting``), or a label for each row. The default is ``pressure`` if there are three or more, else ``speed``.
        Single values at random are not held out, because neighbours of the same condition would predict them.
    direction, ambient_pressure_pa, exclude_flags, loss
        As for :func:`fit_friction`.
    probability : float
        Probability of the prediction intervals.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.

    Returns
    -------
    LawComparison

    Raises
    ------
    FitError
        A name is unknown, or there are fewer than three conditions to hold out.
    """
    for name in laws:
        if name not in CANDIDATES:
            raise FitError(f"the law {name!r} cannot be compared", remedy=nearest(name, CANDIDATES))
    ambient = ambient_of(friction_map, ambient_pressure_pa, needed=True)
    data, _ = observations(friction_map, direction=direction, ambient_pressure_pa=ambient, exclude_flags=exclude_flags)
    forms = _forms(data, pressure)
    held_out, folds = _folds(friction_map, data, hold_out)
    wanted = [(name, form) for name in laws for form in forms]
    each = Watch(progress, cancel).each(wanted, "laws fitted, each with every condition left out once")
    tried = [_compared(name, form, data, folds, loss, probability) for name, form in each]
    rows = [row for row in tried if isinstance(row, Compared)]
    if not rows:
        raise FitError("no law can be compared on this map", value="; ".join(str(row) for row in tried))
    rows, same = _distinct(rows)
    tried += same
    best = min(rows, key=lambda row: row.error_n)
    recommended = min((row for row in rows if _as_good(row, best)), key=lambda row: (row.free, row.error_n))
    said = (*_statements(rows, best, recommended, held_out), *(row for row in tried if isinstance(row, str)))
    ordered = tuple(sorted(rows, key=lambda row: row.error_n))
    return LawComparison(ordered, held_out, int(folds.max()) + 1, probability, recommended, said)


def _distinct(rows: list[Compared]) -> tuple[list[Compared], list[str]]:
    """Remove laws that the values cannot distinguish from a simpler compared law; return notes on them."""
    asked = {(row.name, row.pressure) for row in rows}
    kept, plainer = [], {"curve": dict[str, None](), "line": dict[str, None]()}
    for row in rows:
        form = row.pressure and row.fit.model.pressure
        name = row.name if row.fit.model.stribeck else "coulomb"
        if (name, form) == (row.name, row.pressure) or (name, form) not in asked:
            kept.append(row)
            continue
        plainer["curve"] |= {row.name: None} if name != row.name else {}
        plainer["line"] |= {str(row.pressure): None} if form != row.pressure else {}
    words = {
        "curve": "these values do not determine a Stribeck curve: coulomb represents {}",
        "line": "these pressures determine only a straight line: linear represents {} in pressure",
    }
    return kept, [words[what].format(", ".join(names)) for what, names in plainer.items() if names]


def _forms(data: Observations, wanted: Sequence[str] | None) -> tuple[str | None, ...]:
    if wanted is not None:
        for form in wanted:
            if form not in PRESSURE_FORMS:
                raise FitError(
                    f"the dependence on pressure {form!r} is not known", remedy=nearest(form, PRESSURE_FORMS)
                )
        return tuple(wanted) or (None,)
    varied = [np.ptp(g) > MINIMUM_RANGE_PA for g in (data.gauge_a_pa, data.gauge_b_pa)]
    return (None,) if not any(varied) else PRESSURE_FORMS if all(varied) else PRESSURE_FORMS[:3]


def _folds(
    friction_map: xr.Dataset, data: Observations, wanted: str | Sequence[str] | None
) -> tuple[str, NDArray[np.int64]]:
    """Return the kind of held-out conditions, and for each value the number of the group that is held out together."""
    if wanted is None:
        wanted = "pressure" if pressure_levels(data).max() >= 2 else "speed"
    name = wanted if isinstance(wanted, str) else "label"
    if wanted == "pressure":
        folds = pressure_levels(data)
    elif wanted == "speed":
        tops = np.array([high for _, high in distinct_levels(data.speed_m_s)])
        folds = np.searchsorted(tops, data.speed_m_s)
    elif wanted == "recording":
        folds = np.unique(data.group, return_inverse=True)[1]
    else:
        labels = row_labels(friction_map, wanted)
        recordings = friction_map["recording"].to_numpy().astype(str)
        of_recording = dict(zip(recordings.tolist(), labels.tolist(), strict=True))
        names = np.unique(recordings)
        folds = np.unique([of_recording[names[g]] for g in data.group], return_inverse=True)[1]
    if folds.max() < 2:
        raise FitError(
            f"there are fewer than three conditions to hold out by {name}",
            value=f"{int(folds.max()) + 1}",
            remedy="Measure more conditions, or hold out by speed or by recording.",
        )
    return name, np.asarray(folds, dtype=np.int64)


def _compared(
    name: str,
    form: str | None,
    data: Observations,
    folds: NDArray[np.int64],
    loss: str,
    probability: float,
) -> Compared | str:
    """Fit and predict, or return the reason why this is not possible."""
    wide = float(data.speed_m_s.max() / data.speed_m_s.min()) >= SPEED_SPAN
    try:
        fit = fit_values(replace(CANDIDATES[name], viscous=wide), data, pressure=form, loss=loss, any_shape=True)
    except FitError as problem:
        return f"{name} is not compared: {problem.what}"
    error, inside = np.empty(len(data)), np.empty(len(data), dtype=bool)
    squares, means = np.empty((2, int(folds.max()) + 1))
    for fold in range(squares.size):
        left = folds == fold
        at = data.take(left)
        try:
            without = _without(fit.model, form, data.take(~left), loss)
        except FitError as problem:
            raise FitError(
                f"{name} cannot be fitted without one of the held-out conditions",
                value=_condition(at),
                remedy=problem.what,
            ) from problem
        band = without.predict(
            at.speed_m_s, at.gauge_a_pa, at.gauge_b_pa, stderr_n=at.stderr_n, probability=probability
        )
        error[left] = band.friction_n - at.friction_n
        inside[left] = (band.lower_n <= at.friction_n) & (at.friction_n <= band.upper_n)
        squares[fold] = np.mean(error[left] ** 2)
        means[fold] = np.mean(error[left]) / np.mean(np.abs(at.friction_n))
    worst = int(np.argmax(np.abs(means)))
    rms = float(np.sqrt(np.mean(error**2)))
    return Compared(
        name=name,
        pressure=form,
        fit=fit,
        error_n=rms,
        error=rms / float(np.sqrt(np.mean(data.friction_n**2))),
        coverage=float(np.mean(inside)),
        squares=squares,
        worst=float(means[worst]),
        worst_at=_condition(data.take(folds == worst)),
        viscous=wide,
    )


def _without(model: FrictionModel, form: str | None, rest: Observations, loss: str) -> FrictionFit:
    """Fit some of the values by the part of the law that all values determine."""
    plain = replace(model, chambers=(), pressure="linear", knee_pa=None)
    chosen, lost = choose_model(plain, rest, pressure=form)
    found, scatter = estimated(with_knee(chosen, rest, loss), rest, loss)
    return assembled(model.law, Support(found, scatter, {}, []), lost, [], {"direction": "both"})


def _condition(at: Observations) -> str:
    def span(values: Array, factor: float, unit: str) -> str:
        low, high = factor * float(values.min()), factor * float(values.max())
        return f"{low:.3g} {unit}" if f"{low:.3g}" == f"{high:.3g}" else f"{low:.3g} to {high:.3g} {unit}"

    a, b = span(at.gauge_a_pa, 1e-5, "bar"), span(at.gauge_b_pa, 1e-5, "bar")
    return f"{span(at.speed_m_s, 1e3, 'mm/s')}, chamber a {a}, b {b} gauge"


def _as_good(row: Compared, best: Compared) -> bool:
    difference = row.squares - best.squares
    return bool(difference.mean() <= difference.std(ddof=1) / np.sqrt(difference.size))


def _statements(rows: list[Compared], best: Compared, recommended: Compared, held_out: str) -> Iterator[str]:
    yield (
        f"recommended: {recommended.title}; it predicts a held-out {held_out} with an error of "
        f"{100 * recommended.error:.2g} %, and {100 * recommended.coverage:.0f} % of the values are in their interval"
    )
    if recommended is not best:
        yield f"{best.title} predicts no better beyond chance ({100 * best.error:.2g} %) and has more parameters"
    smallest = min(rows, key=lambda row: row.aicc)
    if smallest is not recommended and all(np.isfinite(row.aicc) for row in rows):
        yield (
            f"AICc would choose {smallest.title}: it describes these values best, "
            f"but predicts held-out conditions with an error of {100 * smallest.error:.2g} %"
        )
    lines = [row for row in rows if row.pressure == "linear" and row.name == recommended.name]
    gained = bool(lines) and abs(recommended.worst) < CURVED * abs(lines[0].worst)
    if gained and recommended.pressure != "linear" and abs(lines[0].worst) > MISSED:
        yield (
            f"a straight line in pressure does not hold: its error for a held-out {held_out} is up to "
            f"{100 * abs(lines[0].worst):.0f} % ({lines[0].worst_at})"
        )
    elif abs(recommended.worst) > MISSED:
        yield (
            f"no compared law holds everywhere: the error of {recommended.title} for a held-out {held_out} is up to "
            f"{100 * abs(recommended.worst):.0f} % ({recommended.worst_at}); do not extrapolate, measure there"
        )
