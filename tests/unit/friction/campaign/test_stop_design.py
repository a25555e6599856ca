"""Stops for a dwell law: at the known support, spread by what is not known, with intervals that come true."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from pneudrive.errors import FitError
from pneudrive.friction.campaign.stops.dwell_models import design_stops


def test_hyperbolic_law_of_a_known_time_has_its_known_support():
    """The law a + B t/(t + c): at both ends and, in u = t/(t + c), in their middle."""
    c, low, high = 5.0, 0.1, 1000.0
    plan = design_stops("hyperbolic", c, stops=12, range_s=(low, high), factor=1.0)
    share = np.array([low, high]) / (np.array([low, high]) + c)
    middle = share.mean()
    assert plan.durations_s[0] == low
    assert plan.durations_s[-1] == high
    assert np.median(plan.durations_s[1:-1]) == pytest.approx(c * middle / (1 - middle), rel=0.1)
    assert plan.repeats[0] == plan.repeats[-1] == 4


def test_a_time_that_is_not_known_spreads_the_stops():
    sure = design_stops("exponential", 5.0, stops=16, factor=1.0)
    unsure = design_stops("exponential", 5.0, stops=16, factor=10.0)
    assert len(unsure.durations_s) > len(sure.durations_s)


def test_expected_intervals_come_true():
    plan = design_stops("log", 1.0, stops=24, factor=1.0, increment_n=1.5, noise_n=0.2)
    t = np.repeat(plan.durations_s, plan.repeats)
    found = []
    for seed in range(200):
        y = 10.0 + 1.5 * np.log1p(t) + 0.2 * np.random.default_rng([3, seed]).standard_normal(t.size)
        fit = least_squares(lambda x, y=y: x[0] + x[1] * np.log1p(t / np.exp(x[2])) - y, [10.0, 1.5, 0.0])
        found.append(fit.x)
    spread = np.std(found, axis=0)
    t_quantile = 2.08  # 21 degrees of freedom
    assert t_quantile * spread[0] == pytest.approx(plan.half_widths["a_n"], rel=0.15)
    assert t_quantile * spread[1] == pytest.approx(plan.half_widths["increment_n"], rel=0.15)


@pytest.mark.parametrize(
    ("form", "options", "said"), [("logarithm", {}, "no dwell law"), ("log", {"range_s": (0.0, 10.0)}, "be positive")]
)
def test_messages(form, options, said):
    with pytest.raises(FitError, match=said):
        design_stops(form, 1.0, **options)
