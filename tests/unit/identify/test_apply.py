"""A fit put into a drive: determined parameters to the last bit, everything else as it was."""

from __future__ import annotations

import numpy as np
import pytest

from pneudrive.describe import Drive
from pneudrive.errors import FitError
from pneudrive.identify import FrictionFit, fit_friction

SPEED = np.geomspace(1e-3, 0.45, 20)


@pytest.fixture
def drive():
    return Drive.load("catalogue:reference")


@pytest.fixture
def good(make_map, friction_of):
    noise = 0.3 * np.random.default_rng(31).standard_normal(20)
    return fit_friction(make_map(SPEED, friction_of(SPEED) + noise, 0.3))


def test_determined_parameters_go_over_exactly(drive, good):
    changed = good.apply(drive)
    for name, value in good.parameters.items():
        assert changed.friction.parameters[name] == value
    assert changed.friction.law == drive.friction.law == "lugre"
    assert changed.friction.parameters["bristle_stiffness"] == drive.friction.parameters["bristle_stiffness"]
    assert changed.cylinder == drive.cylinder
    assert drive.friction.parameters["coulomb"] == 30.0


def test_fit_read_from_a_file_applies_as_well(drive, good, tmp_path):
    good.to_toml(tmp_path / "fit.toml")
    again = FrictionFit.from_toml(tmp_path / "fit.toml")
    assert again.apply(drive).core_json() == good.apply(drive).core_json()


def test_what_is_not_determined_stays(drive, make_map, friction_of):
    speed = np.full(5, 0.01)
    noise = 0.1 * np.random.default_rng(32).standard_normal(5)
    changed = fit_friction(make_map(speed, friction_of(speed) + noise, 0.1)).apply(drive)
    assert changed.friction.parameters["coulomb"] == pytest.approx(friction_of([0.01])[0], abs=0.2)
    for name in ("breakaway", "stribeck_velocity", "viscous"):
        assert changed.friction.parameters[name] == drive.friction.parameters[name]


def test_mixture_that_breaks_the_order_of_levels_is_refused(drive, make_map):
    fit = fit_friction(make_map([0.01, 0.01, 0.01], [59.9, 60.0, 60.1], 0.1))
    with pytest.raises(
        FitError, match=r"(?s)break away at 45 N, below its Coulomb force of 60 N.*breakaway >= coulomb"
    ):
        fit.apply(drive)


def test_pressure_slopes_go_over(drive, make_map, friction_of):
    slopes = {"coulomb_a": 5e-6, "coulomb_b": 8e-6, "breakaway_a": 1.5e-5, "breakaway_b": 2.0e-5}
    speed = np.tile(SPEED, 3)
    a, b = (np.repeat(p, 20) for p in ([0.0, 2e5, 1e5], [0.0, 0.0, 3e5]))
    noise = 0.05 * np.random.default_rng(33).standard_normal(60)
    data = make_map(speed, friction_of(speed, a, b, slopes) + noise, 0.05, gauge_a=a, gauge_b=b)
    fit = fit_friction(data, pressure_dependence=True)
    seals = fit.apply(drive).friction.pressure
    assert seals.coulomb.a == fit.parameters["coulomb_a"]
    assert seals.breakaway.b == fit.parameters["breakaway_b"]
    assert seals.breakaway.b == pytest.approx(2e-5, rel=0.1)


def test_drive_with_pressure_slopes_refuses_a_fit_without(drive, good):
    seals = {"coulomb": {"a": "1 N/bar", "b": "1 N/bar"}, "breakaway": {"a": "1 N/bar", "b": "1 N/bar"}}
    with pytest.raises(FitError, match=r"(?s)would count twice.*pressure_dependence=True"):
        good.apply(drive.replace({"friction.pressure": seals}))


def test_coulomb_drive_takes_the_whole_law_or_nothing(drive, good, make_map, friction_of):
    plain = drive.replace({"friction": {"law": "coulomb", "coulomb": "30 N", "viscous": "40 N s/m"}})
    changed = good.apply(plain)
    assert changed.friction.law == "stribeck"
    assert changed.friction.parameters["breakaway"] == good.parameters["breakaway"]
    tail = np.geomspace(0.001, 0.02, 20)
    noise = 0.05 * np.random.default_rng(34).standard_normal(20)
    with pytest.raises(FitError, match="has no Stribeck part"):
        fit_friction(make_map(tail, friction_of(tail) + noise, 0.05)).apply(plain)
