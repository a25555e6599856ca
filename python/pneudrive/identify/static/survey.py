"""Prediction of friction at a pressure or in a run that was not measured, with an interval.

A fit of one seal gives the uncertainty of its parameters, but not the scatter between mountings, nor the error of a
straight line over pressure. A few recordings of one seal do not determine these two effects, but several seals together
do. The model of friction F of seal s in run r and recording i at gauge pressures p is

    F_sri = L_s(v, p) [1 + d_s(p) + m_sr + e_sri],   e ~ N(0, sigma_s^2),   sigma_s^2 ~ nu tau^2 / chi2(nu)

Here L_s is the law, linear in pressure, with separate parameters for each seal. The deviation d_s from a straight
line is an integrated Wiener process over pressure, which equals a smoothing spline [wahba1983]. Its roughness gamma is
shared by all seals. m ~ N(0, omega^2) shifts all recordings of one run (one mounting). The relative scatter sigma_s of
the seals is distributed around a common value tau [smyth2004]. The parameters of the laws are removed by restricted
likelihood
[patterson1971]. The other parameters are integrated on grids, with priors flat in gamma and omega [gelman2006], ln tau
and 1/nu. A prediction is universal kriging from the recordings of one seal, averaged over the posterior of gamma, omega
and sigma_s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.arrays import Array, ArrayPair, Columns, Interval, Ints, Plain, by_name
from pneudrive.errors import FitError, nearest
from pneudrive.estimate.autocorrelation import integrated_wiener
from pneudrive.identify.identified import sentence
from pneudrive.identify.static.fit import SAME_PRESSURE_PA, fit_values
from pneudrive.identify.static.model import FrictionModel, Observations, at_conditions, map_of, selected
from pneudrive.identify.static.result import FrictionFit, Prediction
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from pneudrive.identify.static.model import AnyMap


#: Grid of the roughness gamma. At 1.5, a straight line misses the middle of the range by 22 % of the friction.
ROUGHNESS = np.linspace(0.0, 1.5, 11)
#: Grid of the relative scatter between runs, omega. Larger differences do not come from one seal.
BETWEEN_RUNS = np.linspace(0.0, 0.4, 9)
#: Grid of the relative scatter of a seal's recordings, sigma_s, and of its common value tau.
SCATTER = np.geomspace(0.008, 0.6, 20)
COMMON = np.geomspace(0.01, 0.5, 12)
#: Grid of 1/nu, which states how much the scatter differs from seal to seal: from little to very much.
DIVERSITY = np.linspace(0.02, 0.5, 7)
#: Start of the Wiener process, below all gauge pressures; its exact value has no effect.
VACUUM_PA = -1.1e5
#: Ratio of highest to lowest speed of a seal below which its friction is modelled without dependence on speed.
SPEED_SPAN = 3.0
#: Smallest number of recordings minus parameters, over all seals, from which a scatter is estimated.
LEAST_FREEDOM = 3
#: Standard deviation of an integrated Wiener process of unit roughness from its chord, in the middle of a unit range.
MIDDLE = 48.0**-0.5


@dataclass(frozen=True)
class Surveyed:
    """Data of one seal: values, law, and the Jacobian of its friction with respect to the parameters.

    ``columns`` are derivatives, shape (n, p), and ``rest`` are residuals, shape (n,), relative to the law's friction.
    ``theta`` are internal coordinates, shape (p,). ``fit`` is the fit of this seal alone, for example
    ``survey.seals["PK"].fit.apply(drive)``.
    """

    name: str
    data: Observations
    runs: tuple[str, ...]
    fit: FrictionFit
    theta: Array
    columns: Array
    rest: Array


@dataclass(frozen=True, repr=False)
class Survey(Shown):
    """Fits of several seals, and their common statistics.

    Attributes
    ----------
    seals : dict
        Name -> values and law.
    unused : dict
        Name -> reason why a seal is left out, or does not contribute to scatter and roughness.
    freedom : int
        Number of recordings minus number of parameters, over all seals.
    scatter, between_runs : float
        Relative standard deviation between recordings of a run (root mean square over the seals), and between runs.
    repeated : int
        Number of repeated runs, over all seals, from which `between_runs` is estimated.
    misses : float
        Relative standard error of a straight line over the whole pressure range, at the middle of this range.
    straight : float
        Likelihood ratio of zero roughness to the most likely roughness.
    span_pa : float
        Largest range of gauge pressure of one seal: the unit of the roughness.
    weights : dict
        Seal -> joint posterior probability of roughness, scatter between runs and scatter between recordings on their
        grids, shape (11, 9, 20).
    """

    seals: dict[str, Surveyed]
    unused: dict[str, str]
    freedom: int
    scatter: float
    between_runs: float
    repeated: int
    misses: float
    straight: float
    span_pa: float
    weights: Columns

    def predict(
        self,
        seal: str,
        *,
        speed_m_s: ArrayLike,
        gauge_a_pa: ArrayLike = 0.0,
        gauge_b_pa: ArrayLike = 0.0,
        run: str | None = None,
        probability: float = 0.95,
    ) -> Prediction:
        """Predict the friction of a further recording of one seal.

        Parameters
        ----------
        seal : str
        speed_m_s, gauge_a_pa, gauge_b_pa : array_like or str
            Conditions, broadcast against each other: numbers in SI or quantities, such as "3 bar gauge".
        run : str or None
            Measured run that contains the further recording. None: a new run.
        probability : float
            Probability of the interval.

        Returns
        -------
        Prediction
            The interval contains the mean of a new recording with that probability. It covers uncertainty of the
            parameters, scatter between recordings, and deviation from a straight line.
        """
        if seal not in self.seals:
            raise FitError(f"the survey has no seal {seal!r}", remedy=nearest(seal, self.seals))
        if not 0.0 < probability < 1.0:
            raise FitError("a probability lies between 0 and 1", value=f"probability = {probability}")
        if run is not None and run not in self.seals[seal].runs:
            raise FitError(f"{seal} has no run {run!r}", remedy=nearest(run, set(self.seals[seal].runs)))
        at, one = at_conditions(speed_m_s, gauge_a_pa, gauge_b_pa), self.seals[seal]
        shape = np.broadcast(speed_m_s, gauge_a_pa, gauge_b_pa).shape
        off = [np.abs(there - here.mean()) for there, here in zip(at.gauges_pa, one.data.gauges_pa, strict=True)]
        if not one.fit.model.chambers and (np.array(off) > 4.0 * SAME_PRESSURE_PA).any():
            value, variance = self._borrowed(one, at)
        else:
            value, variance = self._kriged(one, at, run)
        weight = self.weights[seal].ravel()
        value, variance = value.reshape(weight.size, -1), variance.reshape(weight.size, -1)
        mean = weight @ value
        lower, upper = _quantiles(value, np.sqrt(variance), weight, probability)
        stderr = np.sqrt(weight @ (variance + (value - mean) ** 2))
        return Prediction(*(x.reshape(shape) for x in (mean, lower, upper, stderr)))

    def statements(self) -> list[str]:
        """Return the findings in sentences."""
        numbers = {"scatter": 100 * self.scatter, "freedom": self.freedom, "seals": len(self.seals)}
        numbers |= {"between": 100 * self.between_runs, "runs": self.repeated, "misses": 100 * self.misses}
        numbers |= {"s": "s" * (self.repeated != 1)}
        # likelihood ratio of one parameter at p = 0.05: exp(-3.84 / 2)
        keys = ("scatter", "runs" if self.repeated else "no_runs", "bent" if self.straight < 0.15 else "straight")
        lines = [sentence("seals", key, **numbers) for key in keys]
        return lines + [f"{name}: {why}" for name, why in self.unused.items()]

    def _kriged(self, one: Surveyed, at: Observations, run: str | None = None) -> ArrayPair:
        """Return predictions and their variances for each roughness and both scatters, shape (11, 9, 20, n)."""
        mean, jac = one.fit.model.value_and_jacobian(one.theta, at)
        drift = jac / mean[:, None]
        inside = _kernel(one.fit.model, one.data, one.data, self.span_pa)
        across = _kernel(one.fit.model, at, one.data, self.span_pa)
        own = np.diag(_kernel(one.fit.model, at, at, self.span_pa))
        with_it = np.array([r == run for r in one.runs], dtype=float)
        value, variance = np.empty((2, ROUGHNESS.size, BETWEEN_RUNS.size, SCATTER.size, len(at)))
        for i, roughness in enumerate(ROUGHNESS):
            weight, inverse, change = _least_squares(one, inside, roughness)
            link = roughness**2 * across + (BETWEEN_RUNS**2)[:, None, None] * with_it
            near = link[:, None] @ weight
            away = drift - near @ one.columns
            off = away @ change[..., None] + (near @ one.rest)[..., None]
            value[i] = mean * (1.0 + off[..., 0])
            explained = np.sum(near * link[:, None], axis=-1)
            spread = roughness**2 * own + (BETWEEN_RUNS**2)[:, None, None] - explained
            spread = spread + np.sum((away @ inverse) * away, axis=-1)
            variance[i] = mean**2 * ((SCATTER**2)[:, None] + np.maximum(spread, 0.0))
        return value, variance

    def _borrowed(self, one: Surveyed, at: Observations) -> ArrayPair:
        """Predict the friction of a seal measured at only one pressure, from the friction ratios of other seals."""
        here = at_conditions(at.speed_m_s, *(gauge.mean() for gauge in one.data.gauges_pa))
        dependent = (seal for seal in self.seals.values() if seal.fit.model.chambers)
        ratios = [self._most_likely(seal, at) / self._most_likely(seal, here) for seal in dependent]
        others = [ratio for ratio in ratios if (ratio > 0.0).all()]
        if len(others) < LEAST_FREEDOM:
            raise FitError.of("identify.one_pressure", name=one.name, least=LEAST_FREEDOM)
        ratio = np.log(others)
        value = one.fit.model.value(one.theta, at) * np.exp(ratio.mean(axis=0))
        between = ratio.var(axis=0, ddof=1) * (1.0 + 1.0 / len(others))
        runs = (BETWEEN_RUNS**2)[:, None] + (SCATTER**2)[None, :]
        variance = between + runs[..., None] * (1.0 + 1.0 / len(one.data))
        shape = (ROUGHNESS.size, BETWEEN_RUNS.size, SCATTER.size, len(at))
        return np.broadcast_to(value, shape), np.broadcast_to(value**2 * variance, shape)

    def _most_likely(self, one: Surveyed, at: Observations) -> Array:
        value, _ = self._kriged(one, at)
        return np.einsum("ijk,ijkn->n", self.weights[one.name], value)


def survey_values(
    groups: Mapping[str, Observations],
    runs: Mapping[str, Sequence[str]] | None = None,
    options: Mapping[str, Mapping[str, object]] | None = None,
) -> Survey:
    """Survey several seals; see the docstring of this module.

    Parameters
    ----------
    groups : mapping
        Seal -> values.
    runs : mapping, optional
        Seal -> name of the run (mounting) of each value; the default is one run for each seal.
    options : mapping, optional
        Seal -> entries for the provenance of its fit: direction, recordings.

    Raises
    ------
    FitError
        All seals together have too few recordings.
    """
    seals: dict[str, Surveyed] = {}
    unused: dict[str, str] = {}
    for name, data in groups.items():
        wide = float(data.speed_m_s.max() / data.speed_m_s.min()) >= SPEED_SPAN
        wanted = FrictionModel("stribeck" if wide else "coulomb", viscous=wide)
        own: Plain = {"direction": "both", **(options or {}).get(name, {})}
        fit = fit_values(wanted, data, pressure="linear", options=own)
        theta = fit.coordinates
        value, jac = fit.model.value_and_jacobian(theta, data)
        if not (value > 0.0).all():
            unused[name] = (
                "left out: the fitted friction, to which the scatter is relative, is not positive in all rows"
            )
            continue
        run = tuple(runs[name]) if runs else ("",) * len(data)
        seals[name] = Surveyed(name, data, run, fit, theta, jac / value[:, None], data.friction_n / value - 1.0)
        if len(data) <= theta.size:
            unused[name] = "as many parameters as recordings: the seal does not contribute to the scatter"
    freedom = sum(len(s.data) - s.theta.size for s in seals.values())
    if freedom < LEAST_FREEDOM:
        raise FitError.of("identify.few_recordings", freedom=freedom, seals=len(seals), least=LEAST_FREEDOM)
    span = max(float(np.ptp(gauge)) for s in seals.values() for gauge in s.data.gauges_pa)
    span = span if span > 0.0 else 1e5
    logs = {name: _restricted(one, span) for name, one in seals.items()}
    weights, shared = _posterior(logs)
    mean_square = np.mean([weights[n].sum(axis=(0, 1)) @ SCATTER**2 for n in seals])
    roughness = shared.sum(axis=1)
    return Survey(
        seals,
        unused,
        freedom,
        scatter=float(np.sqrt(mean_square)),
        between_runs=float(np.sqrt(shared.sum(axis=0) @ BETWEEN_RUNS**2)),
        repeated=sum(len(set(s.runs)) - 1 for s in seals.values()),
        misses=float(ROUGHNESS[np.argmax(roughness)]) * MIDDLE,
        straight=float(roughness[0] / roughness.max()),
        span_pa=span,
        weights=weights,
    )


def _posterior(logs: Columns) -> tuple[Columns, Array]:
    """Return the posterior of each seal, shape (11, 9, 20), and of all seals, shape (11, 9).

    The arguments are log likelihoods of shape (11, 9, 20).

    The squared scatter of a seal is distributed as nu tau^2 / chi2(nu): the density in ln sigma is proportional to
    sigma^-nu exp(-nu tau^2 / (2 sigma^2)).
    """
    nu, tau = 1.0 / DIVERSITY[:, None, None], COMMON[None, :, None]
    log_prior = -nu * np.log(SCATTER / tau) - nu * tau**2 / (2.0 * SCATTER**2)
    prior = np.exp(log_prior - log_prior.max(axis=-1, keepdims=True))
    prior = (prior / prior.sum(axis=-1, keepdims=True)).reshape(-1, SCATTER.size)
    likelihood = {name: np.exp(log - log.max()) for name, log in logs.items()}
    given = {name: part @ prior.T for name, part in likelihood.items()}  # common posterior, (11, 9, m)
    joint = np.prod(list(given.values()), axis=0)
    joint /= joint.sum()
    weights = {name: ((joint / np.maximum(given[name], 1e-300)) @ prior) * part for name, part in likelihood.items()}
    return weights, joint.sum(axis=-1)


def _kernel(model: FrictionModel, first: Observations, second: Observations, span: float) -> Array:
    """Return the covariance of the integrated Wiener processes, summed over chambers with varied pressure."""
    total = np.zeros((len(first), len(second)))
    for chamber in "".join(model.chambers):
        s, t = (getattr(x, f"gauge_{chamber}_pa") - VACUUM_PA for x in (first, second))
        total += integrated_wiener(s / span, t / span) / 3.0  # of white noise of unit density
    return total


def _least_squares(one: Surveyed, kernel: Array, roughness: float) -> tuple[Array, Array, Array]:
    """Return inverse covariance of values, covariance and change of parameters, for all scatters, (9, 20, ...)."""
    same_run = np.array([[r == s for s in one.runs] for r in one.runs], dtype=float)
    between = (BETWEEN_RUNS**2)[:, None, None, None] * same_run
    scatter = (SCATTER**2)[:, None, None] * np.eye(len(one.data))
    weight = np.linalg.inv(scatter + between + roughness**2 * kernel)
    inverse = np.linalg.pinv(one.columns.T @ weight @ one.columns, rcond=1e-12, hermitian=True)
    change = (inverse @ (one.columns.T @ (weight @ one.rest)[..., None]))[..., 0]
    return weight.astype(float), inverse.astype(float), change


def _restricted(one: Surveyed, span: float) -> Array:
    """Return the logarithm of the restricted likelihood of one seal on the grids, shape (11, 9, 20)."""
    kernel = _kernel(one.fit.model, one.data, one.data, span)
    size = np.linalg.norm(one.columns, axis=0)
    scaled = one.columns / np.where(size > 0.0, size, 1.0)
    out = np.empty((ROUGHNESS.size, BETWEEN_RUNS.size, SCATTER.size))
    for i, roughness in enumerate(ROUGHNESS):
        weight, _, change = _least_squares(one, kernel, roughness)
        rest = one.rest - change @ one.columns.T
        logs = np.linalg.slogdet(weight)[1] - np.linalg.slogdet(scaled.T @ weight @ scaled)[1]
        out[i] = 0.5 * (logs - np.einsum("...i,...ij,...j->...", rest, weight, rest))
    return out


def _quantiles(value: Array, deviation: Array, weight: Array, probability: float) -> ArrayPair:
    """Return the interval of each of n mixtures of m normal distributions, by bisection."""
    from scipy.special import ndtr

    keep = weight > 1e-6 * weight.max()
    value, deviation, weight = value[keep], deviation[keep], weight[keep] / weight[keep].sum()
    reach = 10.0 * deviation.max(axis=0)
    out = []
    for share in (0.5 * (1.0 - probability), 0.5 * (1.0 + probability)):
        low, high = value.min(axis=0) - reach, value.max(axis=0) + reach
        for _ in range(40):
            middle = 0.5 * (low + high)
            below = weight @ ndtr((middle - value) / deviation) < share
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        out.append(0.5 * (low + high))
    return out[0], out[1]


def survey(friction_map: AnyMap, seals: str | Sequence[str], runs: str | Sequence[str] | None = None) -> Survey:
    """Fit each seal of a friction map.

    All seals share one set of statistics: scatter, differences between runs, and deviation from a straight line.

    Parameters
    ----------
    friction_map : xarray.Dataset, path-like or Characterisation
        As for :func:`fit_friction`.
    seals, runs : str or sequence of str
        Label of each row, or the name of a column of labels. Rows with equal seal and run were measured without
        remounting the seal.

    Returns
    -------
    Survey
        Its ``predict`` returns the friction of a further recording, in the same run or another; ``seals[name].fit`` is
        the fit of one seal.
    """
    friction_map = map_of(friction_map)
    seal_of, run_of = row_labels(friction_map, seals), row_labels(friction_map, "" if runs is None else runs)
    groups: dict[str, Observations] = {}
    of_run: dict[str, list[str]] = {}
    origins: dict[str, Plain] = {}
    for seal in dict.fromkeys(seal_of.tolist()):
        rows = np.flatnonzero(seal_of == seal)
        part = friction_map.isel(row=rows)
        groups[seal], _, provenance = selected(part)
        of_run[seal] = of_values(part, run_of[rows], groups[seal])
        origins[seal] = {key: provenance[key] for key in ("direction", "ambient_pressure_pa", "recordings")}
    return survey_values(groups, of_run, origins)


def pressure_levels(data: Observations) -> Ints:
    """Return the index of the pressure level of each value.

    Values within 10 % or 0.1 bar of the first value of a level belong to this level.
    """
    levels: list[Interval] = []
    out = np.empty(len(data), dtype=np.int64)
    for i, (a, b) in enumerate(zip(*data.gauges_pa, strict=True)):
        width = max(2.0 * SAME_PRESSURE_PA, 0.1 * max(abs(a), abs(b)))
        near = [k for k, (c, d) in enumerate(levels) if max(abs(a - c), abs(b - d)) < width]
        if not near:
            levels.append((float(a), float(b)))
        out[i] = near[0] if near else len(levels) - 1
    return out


def of_values(friction_map: xr.Dataset, labels: NDArray[np.str_], data: Observations) -> list[str]:
    """Return the label of each value of a fit, from the labels of the rows of its map."""
    of_recording = by_name(friction_map["recording"].to_numpy().astype(str).tolist(), labels.tolist())
    return [of_recording[name] for name in data.recording]


def row_labels(friction_map: xr.Dataset, labels: str | Sequence[str]) -> NDArray[np.str_]:
    """Return the label of each row, from a sequence or the name of a column.

    An empty name gives all rows the same label.
    """
    rows = friction_map.sizes["row"]
    if isinstance(labels, str):
        if not labels:
            return np.full(rows, "")
        if labels not in friction_map:
            known = [str(n) for n, v in friction_map.data_vars.items() if v.dtype.kind in "OUS"]
            raise FitError(f"the friction map has no column {labels!r}", remedy=nearest(labels, known))
        return friction_map[labels].to_numpy().astype(str)
    if len(labels) != rows:
        raise FitError("each row needs one label", value=f"{len(labels)} labels, {rows} rows")
    return np.array([str(label) for label in labels])
