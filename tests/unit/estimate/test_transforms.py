"""Coordinates without bounds: there and back, exact Jacobians, intervals that stay within the bounds."""

from __future__ import annotations

import numpy as np
import pytest

from pneudrive.estimate.transforms import Transforms, intervals

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
