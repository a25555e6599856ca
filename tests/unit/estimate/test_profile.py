"""Profile likelihood against closed forms: a linear model, a curved one, one whose side is open, a rough cost."""

import numpy as np
import pytest

from pneudrive.estimate.estimates import student
from pneudrive.estimate.profile import profile_interval


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
