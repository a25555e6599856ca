"""Estimates against SciPy's tests and closed forms; the standard error of a mean whose values know their neighbours."""

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from pneudrive.estimate.autocorrelation import stderr_of_mean
from pneudrive.estimate.estimates import NORMAL_95, Estimate, mean_estimate

RNG = np.random.default_rng(4)
ONE, TWO = RNG.normal(0.4, 1.0, 9), RNG.normal(0.0, 2.0, 14)


def test_mean_and_its_probability_are_those_of_the_t_test():
    found, known = mean_estimate(ONE), stats.ttest_1samp(ONE, 0.0)
    assert (found.low, found.high) == pytest.approx(tuple(known.confidence_interval(0.95)))
    assert found.p == pytest.approx(known.pvalue)


def test_difference_is_welchs():
    found, known = mean_estimate(ONE) - mean_estimate(TWO), stats.ttest_ind(ONE, TWO, equal_var=False)
    assert (found.low, found.high) == pytest.approx(tuple(known.confidence_interval(0.95)))
    assert (found.p, found.degrees_of_freedom) == pytest.approx((known.pvalue, known.df))


def test_widening_adds_variances_and_scaling_changes_no_probability():
    plain = Estimate.of(2.0, 0.3, 1e9)
    wide = plain.widened(0.4)
    assert wide.stderr == pytest.approx(0.5)
    assert wide.high - wide.value == pytest.approx(0.5 * NORMAL_95, rel=1e-4)
    assert wide.p > plain.p
    assert plain.scaled(1e-5, "N/Pa").p == plain.p
    assert not Estimate.of(0.1, 0.3, 5).differs


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_standard_error_of_a_mean_that_remembers(memory):
    """AR(1) of unit noise: the mean of n values has the variance 1 / (1 - rho)^2 / n."""
    rows = lfilter([1.0], [1.0, -memory], RNG.standard_normal((60, 2300)), axis=1)[:, 300:]
    found = np.sqrt(np.mean([stderr_of_mean(row) ** 2 for row in rows]))
    assert found == pytest.approx(1.0 / (1.0 - memory) / np.sqrt(2000), rel=0.12)
