"""Optimal designs: the known support, the equivalence theorem, and intervals that come true."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneudrive.errors import FitError
from pneudrive.estimate.design import DesignSpace, exchange, information
from pneudrive.identify import fit_friction
from pneudrive.identify.design import Limits, Prior, next_measurements
from pneudrive.identify.static.model import CANDIDATES, at_conditions

RANGE = (1e-3, 0.45)


def prediction_variance(candidates: DesignSpace, matrix: np.ndarray) -> np.ndarray:
    """Return the mean over the prior samples of g' M^-1 g at each candidate, shape (c,)."""
    g = candidates.gradients
    solved = np.linalg.solve(matrix, np.swapaxes(g, 1, 2))
    return np.mean(np.einsum("dci,dic->dc", g, solved), axis=0)


def prior_of(law, values, deviations=None, chambers=()):
    """Prior from guesses of the parameters, without measurements; deviations are relative (log-normal)."""
    model = replace(CANDIDATES[law], chambers=chambers)
    centre = np.array([values[name] for name in model.names])
    relative = np.array([(deviations or {}).get(name, 0.0) for name in model.names])
    noise = np.random.default_rng(1).standard_normal((32 if relative.any() else 1, centre.size))
    noise[0] = 0.0
    theta = centre * np.exp(relative * noise)
    theta[:, 1] = np.maximum(theta[:, 1], 1.001 * theta[:, 0])
    points = np.array([model.internal(one) for one in theta])
    return Prior(model, points, np.zeros((len(points), centre.size, centre.size)))


def candidates(truth, law, speeds):
    prior = prior_of(law, truth)
    gradients = prior.model.value_and_jacobian(prior.draws[0], at_conditions(speeds, 0 * speeds, 0 * speeds))[1]
    size = gradients.shape[1]
    return DesignSpace(gradients[None] / 0.5, np.zeros((1, size, size)))


def d_optimal_weights(candidates):
    """Weights of sum one that are D-optimal: each times its variance over p, until none has a variance above p."""
    gradients = candidates.scaled().gradients
    tried = DesignSpace(gradients, np.zeros_like(candidates.known))
    size = gradients.shape[2]
    weight = np.full(gradients.shape[1], 1.0 / gradients.shape[1])
    while (variance := prediction_variance(tried, information(tried, weight))).max() > size * 1.001:
        weight *= variance / size
        weight /= weight.sum()
    return weight


@pytest.mark.parametrize(
    ("law", "support"),
    [("stribeck gaussian", [0.001, 0.012, 0.0335, 0.45]), ("stribeck free", [0.001, 0.0073, 0.0155, 0.036, 0.45])],
)
def test_d_optimal_weights_have_the_known_support_and_satisfy_the_equivalence_theorem(truth, law, support):
    speeds = np.geomspace(*RANGE, 300)
    tried = candidates(truth, law, speeds)
    weight = d_optimal_weights(tried)
    size = len(support)
    variance = prediction_variance(tried, information(tried, weight))
    assert variance.max() <= size * 1.001, "no point would tell more (Kiefer and Wolfowitz)"
    for speed in support:
        near = np.abs(np.log(speeds / speed)) < 0.12
        assert weight[near].sum() == pytest.approx(1.0 / size, rel=0.05), speed
    fine = candidates(truth, law, np.geomspace(*RANGE, 5000))
    assert prediction_variance(fine, information(tried, weight)).max() <= size * 1.002


def test_exchange_finds_the_support_and_repeats_it(truth):
    speeds = np.geomspace(*RANGE, 300)
    chosen = speeds[exchange(candidates(truth, "stribeck gaussian", speeds), 8)]
    np.testing.assert_allclose(
        np.log(chosen.reshape(4, 2) / np.array([[0.001], [0.012], [0.0335], [0.45]])), 0.0, atol=0.05
    )


def test_exchange_is_as_good_as_the_optimal_weights(truth):
    tried = candidates(truth, "stribeck free", np.geomspace(*RANGE, 300))
    counts = np.bincount(exchange(tried, 20), minlength=300) / 20.0
    volumes = [np.linalg.slogdet(information(tried, w)[0])[1] for w in (counts, d_optimal_weights(tried))]
    # The weights end within p 0.001 of the greatest ln det: nothing can be better than them by more.
    assert -0.005 < (volumes[0] - volumes[1]) / 5 < 0.001


def test_next_points_of_a_fit_narrow_what_is_open(make_map, truth, friction_of):
    speeds = np.geomspace(0.015, 0.45, 14)  # nothing below vs: Fs and vs are not separable
    noise = 0.3 * np.random.default_rng(1).standard_normal(14)
    fit = fit_friction(make_map(speeds, friction_of(speeds) + noise, 0.3))
    proposed = next_measurements(fit, Limits(RANGE), points=6)
    slow = sum(p.repeats for p in proposed.points if p.speed_m_s < 0.012)
    assert slow >= 3, "the remedy that the fit states in words, in numbers"
    assert proposed.half_widths_then["breakaway"] < 0.3 * proposed.half_widths_now["breakaway"]
    # what is expected comes true when these points are measured
    added = np.repeat([p.speed_m_s for p in proposed.points], [p.repeats for p in proposed.points])
    both = np.r_[speeds, added]
    expected, found = proposed.half_widths_then, []
    scale = np.sqrt(fit.statistics["variance"])  # of the noise that the fit saw, over the true one
    for seed in range(12):
        noise = 0.3 * np.random.default_rng([2, seed]).standard_normal(both.size)
        again = fit_friction(make_map(both, friction_of(both) + noise, 0.3))
        found.append([np.diff(again.intervals[name])[0] / 2.0 for name in expected])
    assert scale * np.median(found, axis=0) == pytest.approx([*expected.values()], rel=0.25)


def test_slopes_that_equal_pressures_leave_open_are_proposed_apart(make_map, friction_of):
    """The measured pressures of the chambers were equal: only points with different pressures separate the slopes."""
    gauge, speeds = np.repeat([0.0, 3e5], 14), np.tile(np.geomspace(0.001, 0.45, 14), 2)
    slopes = dict.fromkeys(("coulomb_a", "coulomb_b", "breakaway_a", "breakaway_b"), 2e-5)
    noise = 0.3 * np.random.default_rng(1).standard_normal(28)
    friction = friction_of(speeds, gauge, gauge, slopes) + noise
    fit = fit_friction(make_map(speeds, friction, 0.3, gauge_a=gauge, gauge_b=gauge), pressure_dependence=True)
    pairs = tuple((a, b) for a in (0.0, 3e5) for b in (0.0, 3e5))
    apart = next_measurements(fit, Limits(RANGE, pairs), points=8)
    assert {(p.gauge_a_pa, p.gauge_b_pa) for p in apart.points} >= {(0.0, 3e5), (3e5, 0.0)}
    assert np.isinf(apart.half_widths_now["coulomb_a"])
    assert apart.half_widths_then["coulomb_a"] < 0.2e-5
    assert apart.half_widths_now["coulomb"] == pytest.approx(fit.standard_errors["coulomb"] * 2.08, rel=0.1)


def test_a_prior_spreads_the_points(truth):
    sure = next_measurements(prior_of("stribeck gaussian", truth), Limits(RANGE), points=12, noise_n=0.5)
    unsure = next_measurements(
        prior_of("stribeck gaussian", truth, {"stribeck_velocity": 0.7}), Limits(RANGE), points=12, noise_n=0.5
    )
    assert len(unsure.points) > len(sure.points)


def test_i_optimal_predicts_its_range_better(truth):
    prior = prior_of("stribeck gaussian", truth)
    range_of_use = Limits((0.1, 0.45))
    plans = {
        c: next_measurements(prior, Limits(RANGE), points=8, criterion=c, over=range_of_use, noise_n=0.5) for c in "DI"
    }
    at = np.geomspace(0.1, 0.45, 50)
    g = prior.model.value_and_jacobian(prior.draws[0], at_conditions(at, 0 * at, 0 * at))[1]

    def variance(plan):
        v = np.repeat([p.speed_m_s for p in plan.points], [p.repeats for p in plan.points])
        j = prior.model.value_and_jacobian(prior.draws[0], at_conditions(v, 0 * v, 0 * v))[1] / 0.5
        return np.mean(np.einsum("ij,jk,ik->i", g, np.linalg.pinv(j.T @ j), g))

    assert variance(plans["I"]) < 0.8 * variance(plans["D"])


def test_pressures_are_taken_at_the_corners(truth):
    slopes = {f"{f}_{c}": 1e-5 for f in ("coulomb", "breakaway") for c in "ab"}
    gauges = tuple((a, b) for a in (0.0, 2e5, 4e5, 6e5) for b in (0.0, 2e5, 4e5, 6e5))
    plan = next_measurements(
        prior_of("stribeck gaussian", truth | slopes, chambers=("a", "b")),
        Limits(RANGE, gauges),
        points=24,
        noise_n=0.5,
    )
    assert {p.gauge_a_pa for p in plan.points} | {p.gauge_b_pa for p in plan.points} == {0.0, 6e5}


def test_time_counts(truth):
    prior, limits = prior_of("stribeck gaussian", truth), Limits(RANGE, stroke_m=0.1, strokes=2)
    plan = next_measurements(prior, limits, seconds=1800.0, noise_n=0.5)
    assert 900.0 < plan.seconds <= 1800.0
    free = next_measurements(prior, limits, points=sum(p.repeats for p in plan.points), noise_n=0.5)
    assert free.seconds > plan.seconds, "a slow point takes 400 s and is taken less often where time counts"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"criterion": "A"}, "no criterion 'A'"),
        ({"noise_n": None}, "Pass noise_n"),
        ({"seconds": 0.1}, "no point fits into the time"),
        ({"points": 0}, "at least 1"),
    ],
)
def test_messages(truth, change, said):
    with pytest.raises(FitError, match=said):
        next_measurements(prior_of("stribeck gaussian", truth), Limits(RANGE), **({"noise_n": 0.5} | change))
