"""Posterior distribution of a law's parameters by emcee [foremanmackey2013].

Needs the extra ``bayes``. Likelihood: normal, with one common factor on the stated standard errors. Priors, stated with
the result: flat in each force not below zero, in the excess Fs - Fc and in the coefficients of pressure; flat in ln vs
(within a factor 30 of the measured speeds) and in ln n (0.3 to 4); flat in the logarithm of the factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError
from pneudrive.estimate.estimates import intervals_of_draws
from pneudrive.identify.determined import Intervals
from pneudrive.show import Shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.model import FrictionModel, Observations
    from pneudrive.identify.result import FrictionFit

    Array = NDArray[np.float64]

#: Bounds of the factor on the standard errors.
FACTOR = (0.05, 20.0)
#: Least length of a chain in autocorrelation times, from emcee's documentation.
LENGTHS = 50.0
PRIORS = (
    "coulomb, viscous and breakaway - coulomb: flat, not below zero",
    "stribeck_velocity: flat in its logarithm, within a factor of 30 of the measured speeds",
    "stribeck_exponent, where free: flat in its logarithm, 0.3 to 4",
    "coefficients of pressure: flat",
    "factor on the standard errors: flat in its logarithm, 0.05 to 20",
)


@dataclass(frozen=True, repr=False)
class Posterior(Shown):
    """Samples of the posterior distribution.

    Attributes
    ----------
    names : tuple of str
    samples : ndarray, shape (m, p)
        Natural parameters, thinned by half an autocorrelation time.
    intervals : dict
        Name -> 95 % credible interval: quantiles.
    autocorrelation : float
        Longest integrated autocorrelation time, steps.
    acceptance : float
    priors : tuple of str
    statements : tuple of str
        Warnings on the chain.
    """

    names: tuple[str, ...]
    samples: Array
    intervals: dict[str, tuple[float, float]]
    autocorrelation: float
    acceptance: float
    priors: tuple[str, ...]
    statements: tuple[str, ...]


def posterior(fit: FrictionFit, steps: int = 3000, seed: int = 1) -> Posterior:
    """Sample the posterior distribution of the free parameters of a fit.

    Parameters
    ----------
    fit : FrictionFit
        Fit with its observations, not read from a file.
    steps : int
        Steps of each walker; the first third is left out.
    seed : int

    Returns
    -------
    Posterior

    Raises
    ------
    FitError
        emcee is not installed, or the fit has no values.
    """
    try:
        import emcee
    except ImportError:
        raise FitError(
            "posteriors need emcee, which is not installed", remedy='pip install "pneudrive[bayes]"'
        ) from None
    model, data = fit.model, fit.with_data()
    centre = np.append(fit.coordinates, 0.0)
    spread = np.append(_spread(fit, centre[:-1]), 0.1)
    rng = np.random.default_rng(seed)
    walkers = 4 * centre.size
    start = centre + spread * rng.standard_normal((walkers, centre.size))
    lower, upper = _bounds(model, data)
    start = np.clip(start, lower + 1e-6 * np.maximum(1.0, np.abs(lower)), upper)
    sampler = emcee.EnsembleSampler(walkers, centre.size, _log_density, args=(model, data, lower, upper))
    sampler.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(start, steps)
    time = float(np.max(sampler.get_autocorr_time(tol=0)))
    kept = sampler.get_chain(discard=steps // 3, thin=max(1, int(time / 2.0)), flat=True)
    assert kept is not None
    samples = np.array([model.natural(q) for q in kept[:, :-1]])
    said = []
    if steps < LENGTHS * time:
        said.append(
            f"the chain is {steps / time:.0f} autocorrelation times long, fewer than {LENGTHS:.0f}: its quantiles are "
            f"unreliable; use steps={int(2 * LENGTHS * time)}, unless the data do not bound a parameter"
        )
    intervals = Intervals(intervals_of_draws(fit.free, samples), fit.undetermined)
    return Posterior(
        fit.free, samples, intervals, time, float(np.mean(sampler.acceptance_fraction)), PRIORS, tuple(said)
    )


def _spread(fit: FrictionFit, q: Array) -> Array:
    """Return the initial spread of the walkers: a third of the standard errors, in internal coordinates."""
    inverse = np.linalg.pinv(fit.model.natural_jacobian(q))
    return np.clip(np.sqrt(np.diag(inverse @ fit.covariance @ inverse.T)) / 3.0, 1e-9, 0.3 * np.maximum(np.abs(q), 0.3))


def _bounds(model: FrictionModel, data: Observations) -> tuple[Array, Array]:
    lower, upper = model.bounds(data)
    return np.append(lower, np.log(FACTOR[0])), np.append(upper, np.log(FACTOR[1]))


def _log_density(x: Array, model: FrictionModel, data: Observations, lower: Array, upper: Array) -> float:
    if (x < lower).any() or (x > upper).any():
        return -np.inf
    q, log_factor = x[:-1], x[-1]
    residual = (data.friction_n - model.value(q, data)) / data.stderr_n
    out = -0.5 * float(residual @ residual) * np.exp(-2.0 * log_factor) - residual.size * log_factor
    return float(out + (q[1] if model.stribeck else 0.0))  # flat in Fs - Fc, of which q holds the logarithm
