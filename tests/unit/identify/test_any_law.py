"""Any law is fitted by the core's derivatives: a law of formulas gives its truth back, the usual one the usual fit."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import pneudrive as pn
from pneudrive import _core
from pneudrive.errors import FitError, PneudriveWarning
from pneudrive.identify import FrictionFit, fit_friction
from pneudrive.identify.files import read_fit
from pneudrive.identify.static.fit import fit_any_law
from pneudrive.identify.static.result import LawFit

LAWS = Path(__file__).resolve().parents[3] / "examples" / "laws"


GUESS = pn.Friction(law="stribeck", coulomb="20 N", breakaway="50 N", stribeck_velocity="5 mm/s", viscous="100 N s/m")
LIP = {"law": f"file:{LAWS / 'pressed_lip.toml'}", "coulomb": "12 N", "breakaway": "18 N", "pressed": 0.7}
LIP |= {"pressure_scale": "1.6 bar", "film_velocity": "20 mm/s", "viscous": "45 N s/m"}
SPEED, GAUGE = np.tile(np.geomspace(1e-3, 0.45, 5), 3), np.repeat([0.0, 2e5, 6e5], 5)


def lips(make_map, seed, **rest):
    """Return the values of the law LIP, its friction at SPEED and GAUGE, and a map of it with noise."""
    tables = {key: value for key, value in pn.Friction(**LIP).core().items() if value is not None}
    law, values, zero = tables.pop("law"), tables.pop("parameters"), 0.0 * SPEED
    exact, _ = _core.steady_friction_sensitivity(law, values, [], SPEED, GAUGE, zero, zero, tables)
    noise = 0.05 * np.random.default_rng(seed).standard_normal(SPEED.size)
    return values, exact, make_map(SPEED, exact + noise, 0.05, gauge_a=GAUGE, **rest)


@pytest.fixture(scope="module")
def pressed(make_map):
    """Fit of the law LIP from far off to a map of it, all of whose rows share an error of 1 N."""
    curves = lips(make_map, 2, systematic=1.0)[2]
    start = {"coulomb": "8 N", "breakaway": "20 N", "pressed": 0.4, "pressure_scale": "3 bar"}
    return fit_any_law(curves, pn.Friction(**LIP | start | {"film_velocity": "8 mm/s", "viscous": "30 N s/m"}))


def test_a_law_of_formulas_that_saturates_with_pressure_gives_its_truth_back(make_map, pressed):
    values, exact, _ = lips(make_map, 2)
    assert set(pressed.unseen) >= {"damping", "film_time"}
    assert not pressed.undetermined
    for name in ("coulomb", "breakaway", "pressed", "pressure_scale", "film_velocity", "viscous"):
        low, high = pressed.intervals[name]
        assert low < values[name] < high, name
        assert pressed.parameters[name] == pytest.approx(values[name], rel=0.06), name
    assert pressed.statistics["starts_agreeing"] >= 3
    np.testing.assert_allclose(pressed.predict(SPEED, GAUGE), exact, atol=0.1)


def test_the_usual_law_gives_the_usual_fit(make_map, friction_of):
    speed = np.geomspace(1e-3, 0.45, 20)
    noise = 0.2 * np.random.default_rng(3).standard_normal(20)
    curves = make_map(speed, friction_of(speed) + noise, 0.2)
    fit = fit_any_law(curves, GUESS, free=["coulomb", "breakaway", "stribeck_velocity", "viscous"])
    usual = fit_friction(curves)
    profiles, grid = fit.profile(), usual.profile()  # two searches for the same intervals
    for name, ends in profiles.items():
        assert ends == pytest.approx(grid[name], abs=0.03 * (grid[name][1] - grid[name][0])), name
    for name, value in fit.parameters.items():
        assert value == pytest.approx(usual.parameters[name], rel=1e-3), name
        low, high = usual.intervals[name]
        assert fit.intervals[name] == pytest.approx((low, high), abs=0.15 * (high - low)), name
    assert fit.statistics["aicc"] == pytest.approx(usual.statistics["aicc"], abs=0.05)


def test_a_drive_takes_the_law_with_intervals_that_hold_what_rows_share(pressed):
    drive = pn.Drive.load("catalogue:reference").replace({"friction": {"law": "coulomb", "coulomb": "1 N"}})
    after = pressed.apply(drive)
    assert after.friction.formula == pressed.model.friction.formula
    assert after.friction.parameters["film_time"] == pressed.model.friction.parameters["film_time"]
    assert set(after.provenance) == {f"friction.{name}" for name in pressed.parameters}
    origin = after.provenance["friction.coulomb"]
    assert "recording 0" in origin.source
    low, high = (float(end.split()[0]) for end in origin.interval)
    assert high - low > 2.0, "1 N that all rows share is 1.96 N each way"
    written = 0.01 * (high - low)  # digits that the interval carries
    assert after.friction.parameters["coulomb"] == pytest.approx(pressed.parameters["coulomb"], abs=written)
    again = pressed.apply(after)  # the same law: only what is determined changes
    assert again.friction == after.friction
    pn.simulate(after, "0 s: 0.6", duration="0.1 s")


def test_what_acts_on_the_law_must_be_what_acted_in_the_fit(pressed):
    drive = pn.Drive.load("catalogue:reference")
    drive = drive.replace({"friction.pressure": {"coulomb": {"a": "1 N/bar", "b": "1 N/bar"}}})
    with pytest.raises(FitError, match="of the drive differs from that of the fit"):
        pressed.apply(drive)


def test_a_fit_of_any_law_comes_back_from_its_file(pressed, tmp_path):
    pressed.to_toml(tmp_path / "fit.toml")
    again = LawFit.from_toml(tmp_path / "fit.toml")
    assert str(again) == str(pressed)
    assert again.identified() == pressed.identified()
    np.testing.assert_array_equal(again.covariance, pressed.covariance)
    np.testing.assert_array_equal(again.predict([0.01], 2e5), pressed.predict([0.01], 2e5))
    with pytest.raises(FitError, match="fit of a law, not of a friction map"):
        FrictionFit.from_toml(tmp_path / "fit.toml")
    (tmp_path / "fit.toml").write_text('schema = 1\nkind = "law"\n')
    with pytest.raises(FitError, match="not a complete fit of a law"):
        LawFit.from_toml(tmp_path / "fit.toml")


def test_a_guess_of_zero_is_no_end_of_the_search(make_map):
    law = pn.FrictionLaw(
        name="pressed-smooth",
        parameters={
            "coulomb": {"unit": "N", "above": 0},
            "v0": {"unit": "m/s", "above": 0, "default": "1 mm/s"},
            "pressed": {"unit": "1/Pa", "at_least": 0, "default": 0},
            "viscous": {"unit": "N s/m", "at_least": 0, "default": 0},
        },
        force="coulomb*(1 + pressed*max(pressure_a, 0))*tanh(v/v0) + viscous*v",
    )
    speed, gauge = np.tile(np.geomspace(1e-4, 0.45, 10), 3), np.repeat([0.0, 2e5, 4e5], 10)
    friction = 22.0 * (1.0 + 1.5e-6 * gauge) * np.tanh(speed / 0.002) + 30.0 * speed
    friction += 0.1 * np.random.default_rng(6).standard_normal(30)
    fit = fit_any_law(make_map(speed, friction, 0.1, gauge_a=gauge), pn.Friction(law=law, coulomb="30 N"))
    assert not fit.undetermined
    for name, truth in {"coulomb": 22.0, "v0": 0.002, "pressed": 1.5e-6, "viscous": 30.0}.items():
        assert fit.parameters[name] == pytest.approx(truth, rel=0.03), name
        assert np.isfinite(fit.intervals[name]).all(), name


def test_what_the_map_cannot_tell_has_no_interval(make_map, friction_of):
    speed = np.full(8, 0.4) * np.linspace(0.99, 1.01, 8)
    curves = make_map(speed, friction_of(speed), 0.2)
    fit = fit_any_law(curves, GUESS, free=["coulomb", "viscous", "breakaway"])
    assert "breakaway" in fit.undetermined
    assert "breakaway" not in fit.intervals
    assert re.search(r"breakaway +\S+ N +not determined", str(fit))


def test_messages(make_map, friction_of):
    speed = np.geomspace(1e-3, 0.45, 3)
    curves = make_map(speed, friction_of(speed))
    with pytest.raises(FitError, match="has no parameter 'columb'"):
        fit_any_law(curves, GUESS, free=["columb"])
    with pytest.raises(FitError, match="too few values"):
        fit_any_law(curves, GUESS)


# --- Whatever a map holds, a fit ends in a result whose parts fit together, or in one clear message.

FRICTION = st.one_of(st.floats(-100.0, 100.0), st.floats(1e-9, 1e6), st.just(0.0), st.just(float("nan")))
STDERR = st.one_of(st.floats(1e-9, 1e3), st.just(0.0), st.just(float("nan")))
ROW = st.tuples(st.floats(1e-4, 1.0), FRICTION, STDERR, st.sampled_from((0.0, 1e5, 3e5)), st.sampled_from((0.0, 1e5)))


@settings(max_examples=20, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.lists(ROW, min_size=1, max_size=14),
    law=st.sampled_from(("coulomb", "stribeck")),
    pressure=st.booleans(),
    strokes=st.integers(1, 20),
)
def test_fit_or_message(make_map, rows, law, pressure, strokes):
    speed, friction, stderr, gauge_a, gauge_b = (np.array(column) for column in zip(*rows, strict=True))
    data = make_map(speed, friction, stderr, gauge_a=gauge_a, gauge_b=gauge_b, strokes=strokes)
    try:
        fit = fit_friction(data, law, pressure_dependence=pressure)
    except FitError:
        return
    assert np.isfinite(fit.covariance).all()
    np.testing.assert_array_equal(fit.covariance, fit.covariance.T)
    for name, (low, high) in fit.intervals.items():
        assert low <= high
        if name in fit.parameters and np.isfinite(fit.parameters[name]):
            assert low <= fit.parameters[name] <= high
    assert set(fit.determined) <= set(fit.parameters)
    assert not set(fit.determined) & {statement.parameter for statement in fit.undetermined}
    assert np.isfinite(fit.predict([0.01, 0.1], 1e5, 1e5).friction_n).all()
    assert str(fit)


# --- What is applied beside start values: the fit says how far off a run of that mixture is, as a new run finds it too.

pytestmark = pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")
COMMAND, DURATION, START = "0 s: 0.3, 0.15 s: -0.4", "0.3 s", "position = 200 mm, pressure_a = 3 bar abs"


def test_values_that_only_their_sum_determines_are_kept_with_the_error_of_the_mixture(tmp_path):
    truth = pn.Drive.load("catalogue:reference").replace({"load.mass": "5 kg"})
    run = pn.simulate(truth, COMMAND, DURATION, initial=START)
    start = truth.replace({"load.mass": "8 kg", "cylinder.moving_mass": "3 kg", "valve.conductance": "2.5 dm3/(s bar)"})
    fit = pn.identify(start, run, ["load.mass", "cylinder.moving_mass", "valve.conductance"])
    assert {u.parameter for u in fit.undetermined} == {"load.mass", "cylinder.moving_mass"}
    assert fit.values["valve.conductance"] == pytest.approx(truth.valve.conductance_m3_s_pa, rel=1e-4)
    words = "apply keeps the start value of load.mass, cylinder.moving_mass together with the fitted values"
    with pytest.warns(PneudriveWarning, match=words) as said:
        mixed = fit.apply()
    again = pn.simulate(mixed, COMMAND, DURATION, initial=START)
    (note,) = [str(w.message) for w in said if str(w.message).startswith(words)]
    off_m = float(np.sqrt(np.mean((again.position - run.position).to_numpy() ** 2)))
    stated_mm, fitted_mm = map(float, re.findall(r"([0-9.e-]+) mm", note))
    assert stated_mm == pytest.approx(1e3 * off_m, rel=0.02)
    assert stated_mm > 1.0 > 100.0 * fitted_mm
    fit.to_toml(tmp_path / "fit.toml")
    with pytest.warns(PneudriveWarning, match=words):
        read_fit(tmp_path / "fit.toml").apply()
    with pytest.warns(PneudriveWarning, match="fitted values with other values of the drive: check it with"):
        read_fit(tmp_path / "fit.toml").apply(start.replace({"load.mass": "4 kg"}))


def test_a_search_that_tries_steep_stribeck_exponents_ends(make_map):
    speed = np.geomspace(0.003, 0.4, 15)
    exact = 30.0 + 15.0 * np.exp(-((speed / 0.02) ** 2)) + 40.0 * speed
    friction = pn.Drive.load("catalogue:reference").friction
    for draw in (0, 3, 4):
        noise = 0.5 * np.random.default_rng(draw).standard_normal(15)
        fit = fit_any_law(make_map(speed, exact + noise, 0.5), friction)
        np.testing.assert_allclose(fit.predict(speed), exact, atol=1.5)
