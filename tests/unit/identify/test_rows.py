"""Which rows count, and for how much: pairs once, outliers less, common errors apart."""

from __future__ import annotations

import numpy as np
import pytest

from pneudrive.errors import FitError
from pneudrive.estimate.autocorrelation import distinct_levels, moderate
from pneudrive.identify import fit_any_law, fit_friction
from pneudrive.results import compare_results

SPEED = np.geomspace(1e-3, 0.45, 20)


@pytest.fixture
def data(make_map, friction_of):
    noise = 0.3 * np.random.default_rng(12).standard_normal(20)
    return make_map(SPEED, friction_of(SPEED) + noise, 0.3)


def test_both_rows_of_a_pair_are_one_value(data):
    paired = fit_friction(data)
    single = fit_friction(data.isel(row=slice(0, None, 2)))
    assert paired.statistics["values"] == single.statistics["values"] == 20
    np.testing.assert_allclose(paired.covariance, single.covariance, rtol=1e-6)


def test_equal_friction_of_two_recordings_is_two_values(make_map):
    fit = fit_friction(make_map([0.01, 0.01, 0.3], [5.0, 5.0, 6.0], 0.1), law="coulomb")
    assert fit.statistics["values"] == 3


def test_outliers_do_not_move_the_fit(make_map, friction_of, truth):
    noise = 0.3 * np.random.default_rng(13).standard_normal(20)
    friction = friction_of(SPEED) + noise
    friction[[4, 15]] += [15.0, -12.0]
    robust = fit_friction(make_map(SPEED, friction, 0.3))
    for name in ("coulomb", "breakaway", "viscous"):
        low, high = robust.intervals[name]
        assert low <= truth[name] <= high
    assert set(np.argsort(robust.weights)[:2]) == {4, 15}
    assert np.all(robust.weights[[4, 15]] < 0.15)


def test_scale_says_how_far_the_stated_errors_are_off(make_map, friction_of):
    noise = 0.6 * np.random.default_rng(14).standard_normal(20)
    right = fit_friction(make_map(SPEED, friction_of(SPEED) + noise, 0.6))
    small = fit_friction(make_map(SPEED, friction_of(SPEED) + noise, 0.06))
    assert small.statistics["scale"] == pytest.approx(10.0 * right.statistics["scale"], rel=1e-3)
    np.testing.assert_allclose(small.covariance, right.covariance, rtol=1e-3)


def test_systematic_error_shifts_parameters_as_stated(make_map, friction_of):
    exact = friction_of(SPEED)
    stated = fit_friction(make_map(SPEED, exact, 0.3, systematic=0.4))
    shifted = fit_friction(make_map(SPEED, exact + 0.4, 0.3))
    for name in stated.free:
        shift = shifted.parameters[name] - stated.parameters[name]
        assert stated.systematic[name] == pytest.approx(abs(shift), abs=1e-6)
    assert stated.systematic["coulomb"] == pytest.approx(0.4, rel=1e-6)
    assert stated.expanded_uncertainty("coulomb") == pytest.approx(0.8, rel=1e-3)


def test_directions_share_the_offset_between_them(make_map, friction_of):
    noise = 0.05 * np.random.default_rng(15).standard_normal(20)
    data = make_map(SPEED, friction_of(SPEED) + noise, 0.05, offset=2.0)
    both, fits = fit_friction(data), {way: fit_friction(data, direction=way) for way in (1, -1)}
    assert fits[1].parameters["coulomb"] - both.parameters["coulomb"] == pytest.approx(2.0, abs=1e-3)
    assert fits[-1].parameters["coulomb"] - both.parameters["coulomb"] == pytest.approx(-2.0, abs=1e-3)
    compared = compare_results(fits[1], fits[-1])  # the zero of the force explains the whole difference
    assert "no difference in friction" in compared.sentence
    assert "zero error" in compared.sentence
    for fit in fits.values():
        assert fit.expanded_uncertainty("coulomb") == pytest.approx(4.0, rel=1e-3)


@pytest.mark.parametrize("speeds", [(0.01, 0.1), (0.0125, 0.125)])
def test_laws_without_a_common_speed_are_not_compared_in_silence(noisy_fit, speeds):
    """Neither fit determines the Stribeck velocity: between measured speeds their laws may differ without meaning."""
    first, second = (noisy_fit(np.geomspace(*ends, 6), 0.3, 5) for ends in ((0.01, 0.1), speeds))
    compared = compare_results(first, second)
    assert len(compared.curves) == (speeds[0] == 0.01)
    assert ("The laws are not compared" in compared.sentence) == (not compared.curves)


def test_u_contains_the_shape_of_the_curve(make_map, friction_of):
    """The values have an exponential curve and the law a Gaussian one: the interval covers both."""
    speed = np.geomspace(1e-3, 0.4, 12)
    noise = 0.3 * np.random.default_rng(3).standard_normal(speed.size)
    fit = fit_friction(make_map(speed, friction_of(speed, stribeck_exponent=1.0) + noise, 0.3))
    off = abs(fit.values["breakaway"] - 40.0)
    assert 2.0 * fit.standard_errors["breakaway"] < off < fit.expanded_uncertainty("breakaway")


def test_flagged_and_broken_rows_are_left_out_and_counted(make_map, friction_of, drive):
    friction = friction_of(SPEED)
    flags = np.array([""] * 20, dtype=object)
    flags[:2] = "stick_slip, ripple"
    friction[:2] += 50.0
    friction[19] = np.nan
    curves = make_map(SPEED, friction, 0.3, flags=flags)
    for fit in (fit_friction(curves), fit_any_law(curves, drive.friction)):
        assert fit.statistics["values"] == 17
        assert [note[:20] for note in fit.notes[:2]] == ["2 rows left out: a v", "4 rows left out for "]
        assert "stick_slip" in fit.notes[1]


def test_variances_of_few_strokes_shrink_to_their_trend():
    rng = np.random.default_rng(16)
    true = (0.2 + 2.0 * SPEED) ** 2
    raw = true * rng.chisquare(3, 20) / 3
    better = moderate(raw, np.full(20, 3.0), SPEED)
    assert np.std(np.log(better / true)) < 0.5 * np.std(np.log(raw / true))
    exact = moderate(raw, np.full(20, np.inf), SPEED)
    np.testing.assert_array_equal(exact, raw)


def test_variances_that_differ_beyond_chance_shrink_by_the_weight_of_their_prior():
    """Variances s0 d0 / chi2(d0) from d degrees of freedom: the best estimate has the slope d / (d0 + d) on s^2."""
    rng = np.random.default_rng(3)
    true = 8.0 / rng.chisquare(8, 4000)
    raw = true * rng.chisquare(4, 4000) / 4
    better = moderate(raw, np.full(4000, 4.0), np.geomspace(0.01, 0.02, 4000))
    assert np.polyfit(raw, better, 1)[0] == pytest.approx(4 / (8 + 4), rel=0.15)
    assert np.mean((better - true) ** 2) < 0.6 * np.mean((raw - true) ** 2)


def test_levels_of_speed():
    assert distinct_levels(np.array([0.01, 0.0101, 0.0103, 0.02])) == [(0.01, 0.0103), (0.02, 0.02)]
    assert distinct_levels(np.array([0.01])) == [(0.01, 0.01)]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m.drop_vars("friction_n"), "the friction map has no friction_n"),
        (lambda m: m.assign(friction_n=m.friction_n * np.nan), "no row of the friction map can be used"),
        (lambda m: m.assign(direction=m.direction * 2), "direction must be +1 or -1"),
        (lambda m: m.assign(stderr_n=-m.stderr_n), "a standard error must not be negative"),
        (lambda m: m.assign(friction_n=m.friction_n * 0.0), "friction is zero in every row"),
        (lambda m: m.isel(row=[]), "no row of the friction map can be used"),
    ],
)
def test_maps_that_cannot_be_fitted(data, change, message):
    with pytest.raises(FitError, match="(?s)" + message.replace("+", r"\+")):
        fit_friction(change(data))


def test_pressure_dependence_needs_the_ambient_pressure(data):
    data = data.drop_attrs()
    with pytest.raises(FitError, match="has no ambient pressure"):
        fit_friction(data, pressure_dependence=True)


def test_runs_that_differ_are_not_decided_by_the_quietest(make_map):
    """Ten runs scatter by 2 N; their strokes by 0.01 to 0.3 N. The quietest must not stand for all."""
    rng = np.random.default_rng(17)
    inside, widths = 0, []
    for _ in range(12):
        runs = 8.0 + 2.0 * rng.standard_normal(10)
        stderr = np.geomspace(0.01, 0.3, 10)
        fit = fit_friction(make_map(np.full(10, 0.01), runs, stderr), law="coulomb")
        low, high = fit.intervals["coulomb"]
        inside += low <= 8.0 <= high
        assert 0.4 < fit.statistics["scatter_n"] < 5.0
        widths.append(high - low)
    assert np.median(widths) == pytest.approx(2 * 2.26 * 2.0 / np.sqrt(10), rel=0.2)
    assert inside >= 10


def test_no_scatter_where_the_standard_errors_explain_the_residuals(make_map, friction_of):
    found = []
    for seed in range(8):
        rng = np.random.default_rng([18, seed])
        sigma = 0.1 + SPEED
        fit = fit_friction(make_map(SPEED, friction_of(SPEED) + sigma * rng.standard_normal(20), sigma))
        found.append(fit.statistics["scatter_n"])
    assert np.sum(np.array(found) > 0.0) <= 1
