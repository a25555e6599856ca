"""Any law is fitted by the core's derivatives: a law of formulas gives its truth back, the usual one the usual fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive import _core
from pneudrive.errors import FitError
from pneudrive.identify import fit_friction
from pneudrive.identify.any_law import fit_any_law

LAWS = Path(__file__).resolve().parents[3] / "examples" / "laws"


def test_a_law_of_formulas_that_saturates_with_pressure_gives_its_truth_back(make_map):
    def lip(coulomb, breakaway, pressed, scale, film, viscous):
        return pn.Friction(
            law=f"file:{LAWS / 'pressed_lip.toml'}",
            coulomb=f"{coulomb} N", breakaway=f"{breakaway} N", pressed=pressed,
            pressure_scale=f"{scale} bar", film_velocity=f"{film} mm/s", viscous=f"{viscous} N s/m",
        )  # fmt: skip

    truth = lip(12.0, 18.0, 0.7, 1.6, 20.0, 45.0)
    tables = truth.core()
    law, values = tables.pop("law"), tables.pop("parameters")
    tables = {key: value for key, value in tables.items() if value is not None}
    gauges = np.repeat([0.0, 1e5, 2e5, 4e5, 6e5], 8)
    speed = np.tile(np.geomspace(1e-3, 0.45, 8), 5)
    zero = np.zeros(speed.size)
    exact, _ = _core.steady_friction_sensitivity(law, values, [], speed, gauges, zero, zero, tables)
    noise = 0.05 * np.random.default_rng(2).standard_normal(speed.size)
    fit = fit_any_law(make_map(speed, exact + noise, 0.05, gauge_a=gauges), lip(8.0, 20.0, 0.4, 3.0, 8.0, 30.0))
    assert set(fit.unseen) >= {"damping", "film_time"}
    assert not fit.undetermined
    for name in ("coulomb", "breakaway", "pressed", "pressure_scale", "film_velocity", "viscous"):
        low, high = fit.intervals[name]
        assert low < values[name] < high, name
        assert fit.parameters[name] == pytest.approx(values[name], rel=0.06), name
    assert fit.statistics["starts_agreeing"] >= 3
    np.testing.assert_allclose(fit.predict(speed, gauges), exact, atol=0.1)


def test_the_usual_law_gives_the_usual_fit(make_map, friction_of):
    speed = np.geomspace(1e-3, 0.45, 20)
    noise = 0.2 * np.random.default_rng(3).standard_normal(20)
    curves = make_map(speed, friction_of(speed) + noise, 0.2)
    guess = pn.Friction(
        law="stribeck", coulomb="20 N", breakaway="50 N", stribeck_velocity="5 mm/s", viscous="100 N s/m"
    )
    fit = fit_any_law(curves, guess, free=["coulomb", "breakaway", "stribeck_velocity", "viscous"])
    usual = fit_friction(curves)
    for name, value in fit.parameters.items():
        assert value == pytest.approx(usual.parameters[name], rel=1e-3), name
        low, high = usual.intervals[name]
        assert fit.intervals[name] == pytest.approx((low, high), abs=0.15 * (high - low)), name
    assert fit.statistics["aicc"] == pytest.approx(usual.statistics["aicc"], abs=0.05)


def test_what_the_map_cannot_tell_is_open(make_map, friction_of):
    speed = np.full(8, 0.4) * np.linspace(0.99, 1.01, 8)
    curves = make_map(speed, friction_of(speed), 0.2)
    guess = pn.Friction(
        law="stribeck", coulomb="20 N", breakaway="50 N", stribeck_velocity="5 mm/s", viscous="100 N s/m"
    )
    fit = fit_any_law(curves, guess, free=["coulomb", "viscous", "breakaway"])
    assert "breakaway" in fit.undetermined
    assert fit.intervals["breakaway"] == (0.0, np.inf)


def test_messages(make_map, friction_of):
    speed = np.geomspace(1e-3, 0.45, 3)
    curves = make_map(speed, friction_of(speed))
    guess = pn.Friction(
        law="stribeck", coulomb="20 N", breakaway="50 N", stribeck_velocity="5 mm/s", viscous="100 N s/m"
    )
    with pytest.raises(FitError, match="has no parameter 'columb'"):
        fit_any_law(curves, guess, free=["columb"])
    with pytest.raises(FitError, match="too few values"):
        fit_any_law(curves, guess)
