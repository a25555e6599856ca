"""The mixed model against what can be worked out by hand: balanced classes, and probabilities that are uniform."""

from __future__ import annotations

import numpy as np
import pytest

from pneudrive.estimate.estimates import one_thread
from pneudrive.estimate.mixed import MixedModel, RandomEffect, _mixed, independent

GROUPS, REPEATS = 12, 6


@pytest.fixture(autouse=True)
def single():
    with one_thread():
        yield


def balanced(seed: int, between: float, within: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    group = np.repeat(np.arange(GROUPS), REPEATS)
    return group, 10.0 + between * rng.standard_normal(GROUPS)[group] + within * rng.standard_normal(group.size)


def model(group: np.ndarray, y: np.ndarray, x: np.ndarray | None = None) -> MixedModel:
    parts = (
        RandomEffect("group", (group[:, None] == group[None, :]).astype(float), 1.0),
        RandomEffect("cycle", np.eye(y.size), 1.0),
    )
    return MixedModel(y, np.ones((y.size, 1)) if x is None else x, np.zeros(y.size), parts)


def test_variances_of_balanced_groups_are_those_of_the_analysis_of_variance():
    """Restricted likelihood of balanced data has a closed form; the weak prior moves it by a few percent."""
    group, y = balanced(3, 2.0, 0.7)
    means = y.reshape(GROUPS, REPEATS).mean(axis=1)
    within = np.sqrt(np.sum((y - means[group]) ** 2) / (GROUPS * (REPEATS - 1)))
    between = np.sqrt(np.var(means, ddof=1) - within**2 / REPEATS)
    fit = model(group, y).fit()
    assert fit.sd == pytest.approx([between, within], rel=0.08)
    found = fit.contrast(np.array([1.0]))
    assert found.value == pytest.approx(y.mean(), rel=1e-9)
    # Student's t of the group means.
    half = 2.201 * np.std(means, ddof=1) / np.sqrt(GROUPS)
    assert (found.high - found.low) / 2.0 == pytest.approx(half, rel=0.15)


def test_intervals_of_few_groups_hold_the_truth_as_often_as_they_say():
    inside = 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        group = np.repeat(np.arange(4), 3)
        y = 5.0 + rng.standard_normal(4)[group] + 0.5 * rng.standard_normal(12)
        found = model(group, y).fit().contrast(np.array([1.0]))
        inside += found.low <= 5.0 <= found.high
    assert 90 <= inside <= 99


def test_a_test_of_nothing_is_significant_by_chance_alone():
    """Columns without effect, cycles in groups: probabilities below 5 % and 20 % come in 5 % and 20 % of the cases."""
    found = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        group = np.repeat(np.arange(6), 5)
        x = np.column_stack([np.ones(30), rng.standard_normal((30, 2))])
        y = rng.standard_normal(6)[group] + rng.standard_normal(30)
        found.append(model(group, y, x).fit().f_test(np.eye(3)[1:]).p)
    assert 0.01 <= np.mean(np.array(found) < 0.05) <= 0.10
    assert 0.13 <= np.mean(np.array(found) < 0.20) <= 0.28


def test_a_mixture_of_variances_has_the_degrees_of_freedom_of_its_kurtosis():
    found = _mixed(np.zeros((2, 1)), np.array([[1.0], [3.0]]), np.array([0.5, 0.5]))
    assert (found.variance[0] * 12.0 / 10.0, found.freedom[0]) == pytest.approx((2.0, 12.0))  # kurtosis 5/4 of 3


def test_columns_that_are_sums_of_others_are_left_out():
    x = np.column_stack([np.ones(5), np.arange(5.0), 2.0 + 3.0 * np.arange(5.0), np.arange(5.0) ** 2])
    assert independent(x).tolist() == [0, 1, 3]
