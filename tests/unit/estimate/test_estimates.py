"""Estimates against SciPy's tests and closed forms; the standard error of a mean whose values know their neighbours."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from pneudrive import _core
from pneudrive.estimate.autocorrelation import (
    cells,
    centred_walk,
    corrected_criterion,
    gaussian,
    integrated_wiener,
    levels,
    matern,
    stderr_of_mean,
)
from pneudrive.estimate.estimates import Estimate, Transforms, intervals, mean_estimate, profile_interval, student
from pneudrive.estimate.mixed import Scan, refined

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
    assert wide.high - wide.value == pytest.approx(0.5 * stats.norm.ppf(0.975), rel=1e-4)
    assert wide.p > plain.p
    assert plain.scaled(1e-5, "N/Pa").p == plain.p
    assert not Estimate.of(0.1, 0.3, 5).differs


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_standard_error_of_a_mean_that_remembers(memory):
    """AR(1) of unit noise: the mean of n values has the variance 1 / (1 - rho)^2 / n."""
    rows = lfilter([1.0], [1.0, -memory], RNG.standard_normal((60, 2300)), axis=1)[:, 300:]
    found = np.sqrt(np.mean([stderr_of_mean(row) ** 2 for row in rows]))
    assert found == pytest.approx(1.0 / (1.0 - memory) / np.sqrt(2000), rel=0.12)


# --- Kernels are covariances of what they are named after.

PLACES = np.linspace(0.05, 1.0, 12)


@pytest.mark.parametrize(
    "kernel", [integrated_wiener, lambda s, t: matern(s, t, 0.3), lambda s, t: gaussian(s, t, 0.2)]
)
def test_kernels_are_symmetric_and_not_negative(kernel):
    found = kernel(PLACES, PLACES)
    assert found == pytest.approx(found.T)
    assert np.linalg.eigvalsh(found).min() > -1e-12


def test_integrated_wiener_process_by_its_integral():
    """Cov = 3 times the integral of (s - u)(t - u) from 0 to the lower of both: variance 1 at 1."""
    u = np.linspace(0.0, 0.4, 4001)
    integral = np.trapezoid((0.4 - u) * (0.9 - u), u)
    assert integrated_wiener(np.array([0.4]), np.array([0.9]))[0, 0] == pytest.approx(3.0 * integral, rel=1e-6)


def test_a_centred_walk_has_mean_zero():
    assert centred_walk(PLACES).sum(axis=0) == pytest.approx(np.zeros(PLACES.size), abs=1e-12)


def test_levels_do_not_depend_on_the_order():
    values, order = np.array([1.0, 1.04, 2.0, 2.2, 1.06]), [3, 1, 4, 0, 2]
    assert levels(values, 0.05).tolist() == [0, 0, 2, 3, 1]
    assert levels(values[order], 0.05).tolist() == levels(values, 0.05)[order].tolist()
    assert cells(levels(values, 0.05), np.array([0, 1, 0, 0, 0])).max() == 4


# --- Coordinates without bounds: there and back, exact Jacobians, intervals that stay within the bounds.

LOWER, UPPER = [-np.inf, 0.0, 2.0, 0.0, 0.0], [np.inf, np.inf, 5.0, np.inf, np.inf]
VALUES = np.array([-3.0, 7.0, 4.5, 30.0, 40.0])


@pytest.mark.parametrize("over", [3, 25.0])
def test_there_and_back_with_the_derivatives_of_differences(over):
    scales = Transforms(LOWER, UPPER, [0.1, 1.0, 1.0, 1.0, 1.0], excess=4, over=over)
    q = scales.internal(VALUES)
    np.testing.assert_allclose(scales.natural(q), VALUES, rtol=1e-14)
    jacobian = scales.jacobian(q)
    for k, step in enumerate(1e-6 * np.eye(5)):
        slope = (scales.natural(q + step) - scales.natural(q - step)) / 2e-6
        np.testing.assert_allclose(jacobian[:, k], slope, rtol=1e-7, atol=1e-9)


def test_what_lies_at_a_bound_has_a_coordinate_and_any_coordinate_a_value_within_the_bounds():
    scales = Transforms(LOWER, UPPER, excess=4, over=3)
    assert np.isfinite(scales.internal([0.0, 1.0, 5.0, 30.0, 20.0])).all()
    for far in (-50.0, 50.0):
        assert (scales.natural(np.full(5, far))[1:] >= LOWER[1:]).all()
        assert (scales.natural(np.full(5, far)) <= UPPER).all()


def test_intervals_are_symmetric_on_the_scale_of_the_coordinate_and_first_order_when_narrow():
    low, high = intervals(VALUES, np.full(5, 0.1), LOWER, UPPER)
    np.testing.assert_allclose(low, VALUES - 0.1, rtol=3e-3)
    np.testing.assert_allclose(high, VALUES + 0.1, rtol=3e-3)
    low, high = intervals(VALUES, np.full(5, 100.0), LOWER, UPPER)
    assert low[1] * high[1] == pytest.approx(7.0**2)
    assert (low[1:] >= LOWER[1:]).all()
    assert 2.0 <= low[2] < 4.5 < high[2] <= 5.0


# --- Profile likelihood against closed forms: a linear model, a curved one, one whose side is open, a rough cost.


def test_a_linear_model_has_student_s_interval():
    x = np.array([0.0, 1.0, 2.0, 4.0, 7.0])
    y = np.array([1.1, 2.7, 5.2, 8.8, 15.3])
    design = np.column_stack([np.ones_like(x), x])
    (_, slope), rest, *_ = np.linalg.lstsq(design, y, rcond=None)
    variance = float(rest[0]) / 3.0
    half = student(3) * np.sqrt(variance / np.sum((x - x.mean()) ** 2))

    def held(value, _):
        left = y - value * x
        return float(np.sum((left - left.mean()) ** 2)), None

    ends = profile_interval(held, None, slope, 0.2 * half, float(rest[0]), student(3) ** 2 * variance)
    assert ends == pytest.approx((slope - half, slope + half), rel=1e-6)


def test_a_curved_model_has_unequal_sides_and_one_may_be_open():
    """(exp(q) - 1)^2 grows by a^2 at log(1 +- a), and never by more than one below."""
    for allowed, low in ((0.25, np.log(0.5)), (4.0, -np.inf)):
        ends = profile_interval(lambda q, _: ((np.exp(q) - 1.0) ** 2, None), None, 0.0, 0.5, 0.0, allowed)
        assert ends == pytest.approx((low, np.log(1.0 + np.sqrt(allowed))), abs=0.02)


def test_a_cost_that_falls_once_behind_the_limit_does_not_open_a_side():
    """Searches that end early return costs that scatter; points beyond the limit were seen all the same."""
    for sign in (-1.0, 1.0):
        seen = iter([2949.26, 353.2, 77.446, 76.348])

        def held(value, _, sign=sign, seen=seen):
            return (next(seen, 82.6), None) if sign * value > 0.0 else (76.3 + 4.0 * value**2, None)

        ends = profile_interval(held, None, 0.0, 5.0, 76.3, 4.0)
        assert np.isfinite(ends).all()
        assert 0.0 < max(ends, key=lambda end: sign * end) * sign < 5.0


def test_ends_of_a_rough_cost_are_those_of_the_smooth_one():
    """Of 200 costs with a tenth of their limit as scatter all ends lie within what the scatter explains."""
    random = np.random.default_rng(43)
    ends = []
    for _ in range(200):
        first = float(10.0 ** random.uniform(-2.0, 2.0))
        low, high = profile_interval(
            lambda x, _: (4.0 * x**2 + 0.4 * abs(random.standard_normal()), None), None, 0.0, first, 0.0, 4.0
        )
        ends += [-low, high]
    assert min(ends) > 0.8
    assert max(ends) < 1.05


# --- Laws that are linear but for a shape: coefficients, their interval and that of the shape, against closed forms.

LENGTHS = np.geomspace(0.05, 50.0, 60)


def decays(x, y, noise):
    return lambda k: Scan(k[:, None], np.exp(-x / k[:, None])[:, :, None] / noise, y / noise, 38, 0.25)


def test_shape_and_coefficient_of_a_decay_lie_in_their_intervals():
    rng, inside = np.random.default_rng(3), []
    x = np.linspace(0.0, 5.0, 40)
    for _ in range(60):
        at = decays(x, 4.0 * np.exp(-x / 1.5) + 0.1 * rng.standard_normal(x.size), 0.1)
        found = refined(at, LENGTHS, 60)
        low, high = found.shape_interval(0, (LENGTHS[0], LENGTHS[-1]))
        below, above = found.interval(np.array([1.0]))
        inside.append((low <= 1.5 <= high, below <= 4.0 <= above))
    assert np.mean(inside, axis=0) == pytest.approx([0.95, 0.95], abs=0.08)


def test_at_a_known_shape_the_interval_is_that_of_a_mean():
    y = np.array([1.0, 2.0, 3.0])
    found = Scan(np.zeros((1, 0)), np.ones((1, 3, 1)), y, 2)
    low, high = found.interval(np.array([1.0]))
    assert (low, high) == pytest.approx((2.0 - 4.302653 / np.sqrt(3.0), 2.0 + 4.302653 / np.sqrt(3.0)), abs=1e-6)


def test_a_shape_that_nothing_bounds_is_open():
    found = decays(np.linspace(0.0, 1.0, 20), np.ones(20), 1.0)(LENGTHS)
    assert found.shape_interval(0, (LENGTHS[0], LENGTHS[-1]))[1] == np.inf


def test_criterion_of_few_data():
    assert corrected_criterion(10.0, 2, 8) == pytest.approx(10.0 + 4.0 + 12.0 / 5.0)
    assert corrected_criterion(10.0, 2, 3) == np.inf


@pytest.mark.parametrize(
    ("growth", "psi"),
    [
        ("log", lambda t, tau, m: np.log1p(t / tau)),
        ("saturating", lambda t, tau, m: -np.expm1(-((t / tau) ** m))),
        ("hyperbolic", lambda t, tau, m: t / (t + tau)),
    ],
)
def test_growth_of_the_core_and_its_derivatives(growth, psi):
    t, at, h = np.geomspace(0.1, 1e3, 9), np.array([7.0, 0.6]), 1e-6
    found = _core.dwell_growth(growth, t, *at)
    assert found[:, 0] == pytest.approx(psi(t, *at), rel=1e-12)
    assert found[:, 1] == pytest.approx((psi(t * (1 + h), *at) - psi(t * (1 - h), *at)) / (2 * h * t), rel=1e-6)
    for k in range(2):
        step = h * at * (np.arange(2) == k)
        numeric = (psi(t, *(at + step)) - psi(t, *(at - step))) / (2.0 * h * at[k])
        assert found[:, 2 + k] == pytest.approx(numeric, rel=1e-5, abs=1e-9)


def test_a_growth_that_there_is_not():
    with pytest.raises(ValueError, match="no growth"):
        _core.dwell_growth("linear", np.ones(1), 1.0, 1.0)
