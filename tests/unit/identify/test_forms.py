"""Shapes of the Stribeck curve, forms of the dependence on pressure, losses: each finds the truth that has its form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import least_squares

from pneudrive import Drive, _core
from pneudrive.characterise import write_map
from pneudrive.errors import FitError, PneudriveError, PneudriveWarning
from pneudrive.estimate.autocorrelation import HUBER, LINEAR
from pneudrive.friction.friction_map import AMBIENT, COLUMNS
from pneudrive.identify import FrictionFit, fit_friction
from pneudrive.identify.design import select_friction_law

SPEED = np.geomspace(1e-3, 0.45, 20)
GRID = [(a, b) for a in (0.0, 2e5, 4e5, 6e5) for b in (0.0, 2e5, 4e5, 6e5)]


def at_pressures(make_map, law, noise=0.1, seed=1, grid=GRID, speeds=6):
    """Map over a grid of pressures; `law(a, b)` gives Coulomb and breakaway force."""
    at = [(v, *pair) for pair in grid for v in np.geomspace(1e-3, 0.45, speeds)]
    speed, a, b = (np.array(x) for x in zip(*at, strict=True))
    friction = np.empty(speed.size)
    for i, v in enumerate(speed):
        coulomb = law(a[i], b[i])
        values = {"coulomb": coulomb, "breakaway": 1.3 * coulomb, "stribeck_velocity": 0.012, "viscous": 60.0}
        friction[i] = _core.steady_friction("stribeck", values, np.array([v]))[0]
    friction += noise * np.random.default_rng(seed).standard_normal(speed.size)
    return make_map(speed, friction, noise, gauge_a=a, gauge_b=b)


@pytest.mark.parametrize("shape", ["gaussian", "exponential", "lorentzian"])
def test_the_shape_that_made_the_values_has_the_smallest_aicc(make_map, truth, shape):
    del truth["stribeck_exponent"]
    exact = _core.steady_friction("stribeck", truth, SPEED, dependences={"stribeck_shape": shape})
    noisy = make_map(SPEED, exact + 0.1 * np.random.default_rng(4).standard_normal(20), 0.1)
    fits = {s: fit_friction(noisy, f"stribeck {s}") for s in ("gaussian", "exponential", "lorentzian")}
    assert min(fits, key=lambda s: fits[s].statistics["aicc"]) == shape
    low, high = fits[shape].intervals["stribeck_velocity"]
    assert low < truth["stribeck_velocity"] < high


FORMS = {
    "quadratic": (lambda a, b: 20.0 + 3e-5 * a - 2e-11 * a**2 + 1e-5 * b, {"coulomb_curve_a": -2e-11}),
    "interaction": (lambda a, b: 20.0 + 1e-5 * a + 1e-5 * b + 2e-11 * a * b, {"coulomb_product": 2e-11}),
    "saturating": (lambda a, b: 20.0 + 4e-5 * a / (1 + a / 2.1e5) + 4e-5 * b / (1 + b / 2.1e5), {"coulomb_a": 4e-5}),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_dependence_that_is_no_straight_line_is_found(make_map, form, tmp_path):
    law, coefficient = FORMS[form]
    curves = at_pressures(make_map, law)
    fit = fit_friction(curves, pressure_dependence=True, pressure=form)
    line = fit_friction(curves, pressure_dependence=True)
    assert fit.statistics["aicc"] < line.statistics["aicc"] - 10.0
    for name, value in coefficient.items():
        low, high = fit.intervals[name]
        assert low < value < high
    fit.to_toml(tmp_path / "fit.toml")
    again = FrictionFit.from_toml(tmp_path / "fit.toml")
    at = (np.array([0.01, 0.1]), 3e5, 5e5)
    np.testing.assert_allclose(again.predict(*at).upper_n, fit.predict(*at).upper_n, rtol=1e-12)
    with pytest.raises(FitError, match="linearly on the chamber pressures"):
        fit.apply(Drive.load("catalogue:reference"))


def test_a_curve_over_two_pressures_is_refused_in_words(make_map, friction_of):
    speed, gauge = np.tile(SPEED, 2), np.repeat([0.0, 4e5], 20)
    exact = friction_of(speed, gauge, 0.0, {"coulomb_a": 1e-5, "breakaway_a": 1e-5})
    noise = 0.1 * np.random.default_rng(1).standard_normal(40)
    fit = fit_friction(
        make_map(speed, exact + noise, 0.1, gauge_a=gauge), pressure_dependence=True, pressure="quadratic"
    )
    assert "coulomb_curve_a" not in fit.free
    assert any("fewer than three pressures" in s for s in fit.statements())


def test_hubers_loss_has_an_efficiency_of_99_percent_on_normal_errors():
    def mean(f):
        return (
            2.0 * quad(lambda u: f(np.array([u]))[0] * np.exp(-0.5 * u * u) / np.sqrt(2 * np.pi), 0, 9, points=[2])[0]
        )

    assert mean(HUBER.slope) ** 2 / mean(lambda u: HUBER.psi(u) ** 2) == pytest.approx(0.99, abs=0.001)


@pytest.mark.parametrize("loss", [LINEAR, HUBER], ids=["linear", "huber"])
def test_derivatives_of_a_loss_and_its_form_for_scipy_agree(loss):
    u, h = np.array([-2.6, 0.3, 1.9, 2.5, 6.0, 9.0]), 1e-6
    np.testing.assert_allclose((loss.rho(u + h) - loss.rho(u - h)) / (2 * h), loss.psi(u), atol=1e-8)
    np.testing.assert_allclose((loss.psi(u + h) - loss.psi(u - h)) / (2 * h), loss.slope(u), atol=1e-6)
    scale = loss.tuning if np.isfinite(loss.tuning) else 1.0
    start = least_squares(lambda x: u + x, [0.0], loss=loss.name, f_scale=scale, max_nfev=1)
    assert start.cost == pytest.approx(loss.rho(u).sum())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"law": "stribek"}, "no sliding law 'stribek'.*Did you mean 'stribeck'"),
        ({"law": "stribeck gauss"}, "no sliding law 'stribeck gauss'.*Did you mean 'stribeck gaussian'"),
        ({"pressure": "cubic"}, "no dependence on pressure 'cubic'.*Known: interaction, linear"),
    ],
)
def test_unknown_choices_are_named(make_map, friction_of, options, said):
    with pytest.raises(FitError, match=f"(?s){said}"):
        fit_friction(make_map(SPEED, friction_of(SPEED)), **options)


@pytest.mark.parametrize("form", ["linear", "quadratic"])
def test_profile_and_first_order_agree_where_values_are_many(make_map, form):
    """Squares of pressures are 1e10 times newtons: their columns once hid how well vs is known (half its interval)."""
    fit = fit_friction(
        at_pressures(make_map, lambda a, b: 20.0 + 1e-5 * a + 1e-5 * b), pressure_dependence=True, pressure=form
    )
    for name in fit.free:
        low, high = fit.intervals[name]
        assert 0.85 < (high - low) / (2.0 * 1.99 * fit.standard_errors[name]) < 1.2, name


def test_a_law_that_is_a_plainer_one_for_these_values_is_not_listed_twice(make_map):
    """Two pressures in chamber b carry no curve, and one speed no Stribeck part: it is said, not shown as five rows."""
    gauge_a, gauge_b = np.repeat([0.0, 2e5, 4e5], 2), np.tile([0.0, 3e5], 3)
    friction = 20.0 + 1e-5 * gauge_a + 1e-5 * gauge_b + 0.1 * np.random.default_rng(2).standard_normal(6)
    curves = make_map(np.full(6, 0.01), friction, 0.1, gauge_a=gauge_a, gauge_b=gauge_b)
    found = select_friction_law(curves, hold_out="pressure", pressure=["linear", "quadratic"])
    assert [row.title for row in found.rows] == ["coulomb, linear in pressure"]
    assert any("coulomb is listed instead of stribeck gaussian" in said for said in found.statements)
    assert any("linear is listed instead of quadratic" in said for said in found.statements)
    assert "coulomb friction from 6 values" in repr(found.rows[0])


@pytest.mark.parametrize(("slope", "form"), [(0.0, None), (2e-5, "linear")])
def test_a_law_without_pressure_is_compared_too(make_map, slope, form):
    corners = [(a, b) for a in (0.0, 4e5) for b in (0.0, 4e5)]
    curves = at_pressures(make_map, lambda a, b: 20.0 + slope * (a + b), seed=3, grid=corners, speeds=4)
    assert select_friction_law(curves, ["stribeck gaussian"]).recommended.pressure == form


def test_slopes_of_a_saturating_dependence_know_that_the_knee_was_sought(make_map):
    """At the best knee alone the intervals of the slopes held the truth in one of ten maps."""

    def law(a, b):
        return 20.0 + 4e-5 * a / (1 + a / 2.6e5) + 2e-5 * b / (1 + b / 2.6e5)

    inside = np.zeros(2)
    for seed in range(3):
        curves = at_pressures(make_map, law, noise=0.3, seed=seed)
        fit = fit_friction(curves, pressure_dependence=True, pressure="saturating")
        ends = [fit.intervals["coulomb_a"], fit.intervals["coulomb_b"]]
        inside += [low <= value <= high for value, (low, high) in zip((4e-5, 2e-5), ends, strict=True)]
    assert (inside >= 2).all(), inside


# --- Four values at four speeds: a Stribeck curve of any shape follows them exactly, and nothing is left to test it.

FOUR = np.array([0.02, 0.05, 0.1, 0.2])


@pytest.fixture
def four(make_map):
    """Return the map of a curve that falls by 4 N from 20 to 100 mm/s, with 0.03 N for the mean of the strokes."""
    law = {"coulomb": 25.0, "breakaway": 34.0, "stribeck_velocity": 0.04, "viscous": 30.0}
    return make_map(FOUR, _core.steady_friction("stribeck", law, FOUR), 0.03)


def test_the_intervals_of_four_values_cover_all_shapes(four):
    fit = fit_friction(four)
    exact = {shape: fit_friction(four, f"stribeck {shape}") for shape in ("exponential", "lorentzian")}
    low, high = fit.intervals["breakaway"]
    assert all(low < one.values["breakaway"] < high for one in (fit, *exact.values()))
    assert high > 60.0  # of the exponent 0.5
    assert fit.expanded_uncertainty("breakaway") >= high - fit.values["breakaway"]
    title = fit.view().title
    assert "no value is left to test the law" in title
    assert "100" not in title
    assert "standard errors" not in title
    assert fit.statistics["rms_n"] == 0.0


def test_a_law_that_contradicts_four_values_is_neither_recommended_nor_calm(four):
    found = select_friction_law(four)
    assert found.recommended.title == "stribeck gaussian"  # as `characterise` fits
    assert "but the residuals of coulomb are" in found.statements[0]
    assert "not tested, because they are not determined if one speed" in found.statements[-1]
    assert [row[-1] for row in found.view().tables[0].rows if row[0].startswith("stribeck")] == ["–"] * 3
    constant = fit_friction(four, "coulomb")
    assert constant.view().state == "bad"
    assert [f.state for f in constant.findings()] == ["bad", "open"]
    assert "the law does not follow the values" in constant.findings()[0].text
    with pytest.raises(FitError, match="cannot be tested"):
        select_friction_law(four, ["stribeck"])


def test_friction_that_only_falls_has_a_viscous_part_of_exactly_zero(make_map):
    noise = 0.5 * np.random.default_rng(0).standard_normal(8)
    fit = fit_friction(make_map(np.geomspace(0.01, 0.4, 8), 30.0 - 2.0 * np.linspace(0, 1, 8) + noise, 0.5), "coulomb")
    assert fit.model.viscous
    assert fit.values["viscous"] == 0.0


def test_a_prediction_takes_quantities_and_warns_beyond_the_measured_speeds(four):
    fit = fit_friction(four)
    at = fit.predict(0.1).friction_n
    assert fit.predict("100 mm/s", "3 bar gauge", "4 bar abs").friction_n == at
    with pytest.warns(PneudriveWarning, match=r"a speed of 1e\+05 mm/s is extrapolation.*from 20 to 200 mm/s"):
        fit.predict([0.1, 100.0])
    for wrong, words in (("0.1 bar", "a velocity is needed"), ("fast", "not a quantity"), (0.0, "finite and not zero")):
        with pytest.raises(PneudriveError, match=words):
            fit.predict(wrong)
    with pytest.raises(PneudriveError, match="does not state abs or gauge"):
        fit.predict(0.1, "3 bar")


def test_a_fit_takes_a_file_or_a_result_with_a_map(four, tmp_path):
    further = {name: 0.0 * four["stderr_n"] for name in COLUMNS if name not in four}
    file = write_map(four.assign(further).drop_vars(AMBIENT), tmp_path / "map.parquet")
    exact = fit_friction(four).values
    assert fit_friction(file).values == fit_friction(SimpleNamespace(friction_map=four)).values == exact
    with pytest.raises(FitError, match="the friction map has no recording"):
        select_friction_law(3)
