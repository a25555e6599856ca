"""Laws that are linear but for a shape: coefficients, their interval and that of the shape, against closed forms."""

import numpy as np
import pytest

from pneudrive import _core
from pneudrive.estimate.separable import corrected_criterion, refined, scan

LENGTHS = np.geomspace(0.05, 50.0, 60)


def decays(x, y, noise):
    return lambda lengths: scan(lengths[:, None], np.exp(-x / lengths[:, None])[:, :, None] / noise, y / noise)


def test_shape_and_coefficient_of_a_decay_lie_in_their_intervals():
    rng, inside = np.random.default_rng(3), []
    x = np.linspace(0.0, 5.0, 40)
    for _ in range(60):
        at = decays(x, 4.0 * np.exp(-x / 1.5) + 0.1 * rng.standard_normal(x.size), 0.1)
        found = refined(at, LENGTHS, 60, lambda one: one.rise(38))
        low, high = found.shape_interval(0, found.rise(38), (LENGTHS[0], LENGTHS[-1]))
        below, above = found.interval(np.array([1.0]), found.rise(38))
        inside.append((low <= 1.5 <= high, below <= 4.0 <= above))
    assert np.mean(inside, axis=0) == pytest.approx([0.95, 0.95], abs=0.08)


def test_at_a_known_shape_the_interval_is_that_of_a_mean():
    y = np.array([1.0, 2.0, 3.0])
    found = scan(np.zeros((1, 0)), np.ones((1, 3, 1)), y)
    low, high = found.interval(np.array([1.0]), found.rise(2))
    assert (low, high) == pytest.approx((2.0 - 4.302653 / np.sqrt(3.0), 2.0 + 4.302653 / np.sqrt(3.0)), abs=1e-6)


def test_a_shape_that_nothing_bounds_is_open():
    found = decays(np.linspace(0.0, 1.0, 20), np.ones(20), 1.0)(LENGTHS)
    assert found.shape_interval(0, 1.0, (LENGTHS[0], LENGTHS[-1]))[1] == np.inf


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
