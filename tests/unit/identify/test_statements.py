"""What the data cannot determine is said in words, with the remedy, and no number pretends otherwise."""

from __future__ import annotations

import numpy as np
import pytest

from pneudrive.identify import fit_friction


def lost(fit):
    return {s.parameter: s for s in fit.undetermined}


def test_two_speeds_cannot_give_a_stribeck_velocity(make_map, friction_of):
    speed = np.repeat([0.005, 0.015], 4)
    noise = 0.05 * np.random.default_rng(1).standard_normal(8)
    fit = fit_friction(make_map(speed, friction_of(speed) + noise, 0.05))
    assert np.isnan(fit.parameters["stribeck_velocity"])
    assert np.isnan(fit.parameters["breakaway"])
    statement = str(lost(fit)["stribeck_velocity"])
    assert "2 distinct speeds (5 mm/s, 15 mm/s)" in statement
    assert "measure at least 8 speeds" in statement
    assert "breakaway, stribeck_velocity cannot be determined: the map has 2 distinct speeds" in str(fit)
    assert set(fit.determined) <= {"coulomb", "viscous"}


def test_speeds_that_count_as_one_are_listed_as_one(make_map, friction_of):
    speed = np.array([0.0123, 0.0125, 0.0128, 0.0137, 0.0139, 0.0143])
    noise = 0.05 * np.random.default_rng(3).standard_normal(6)
    statement = str(lost(fit_friction(make_map(speed, friction_of(speed) + noise, 0.05)))["stribeck_velocity"])
    assert "2 distinct speeds (12.3 to 12.8 mm/s, 13.7 to 14.3 mm/s)" in statement


def test_one_speed_gives_the_friction_there_and_nothing_else(make_map, friction_of):
    speed = np.full(6, 0.01)
    noise = 0.05 * np.random.default_rng(2).standard_normal(6)
    fit = fit_friction(make_map(speed, friction_of(speed) + noise, 0.05))
    assert fit.determined == ("coulomb",)
    assert fit.parameters["coulomb"] == pytest.approx(friction_of([0.01])[0], abs=0.1)
    assert "the whole friction at that speed" in lost(fit)["viscous"].reason


def test_one_value_is_enough_for_one_number(make_map):
    fit = fit_friction(make_map([0.01], [12.0], 0.2))
    low, high = fit.intervals["coulomb"]
    assert (low, high) == pytest.approx((12.0 - 1.96 * 0.2, 12.0 + 1.96 * 0.2), rel=1e-3)
    assert any("only on the stated standard errors" in note for note in fit.notes)


def test_breakaway_and_stribeck_velocity_are_not_separable_from_the_tail(make_map, friction_of):
    speed = np.geomspace(0.026, 0.45, 20)  # slowest level above 2 vs = 24 mm/s
    noise = 0.002 * np.random.default_rng(3).standard_normal(20)
    fit = fit_friction(make_map(speed, friction_of(speed) + noise, 0.002))
    assert {"breakaway", "stribeck_velocity"} <= set(lost(fit))
    assert "lies above 2 vs" in lost(fit)["breakaway"].reason
    assert "add levels at and below" in lost(fit)["breakaway"].remedy
    assert {"coulomb", "viscous"} <= set(fit.determined)


def test_no_falling_part_means_no_stribeck_velocity(make_map, friction_of):
    speed = np.geomspace(1e-3, 0.45, 20)
    noise = 0.5 * np.random.default_rng(4).standard_normal(20)
    fit = fit_friction(make_map(speed, friction_of(speed, breakaway=30.0) + noise, 0.5))
    assert "does not fall with speed by more than chance" in lost(fit)["stribeck_velocity"].reason
    assert "stribeck_velocity" not in fit.determined
    assert "coulomb" in fit.determined


def test_plateau_that_is_not_reached(make_map, friction_of):
    speed = np.geomspace(1e-3, 0.02, 20)
    noise = 0.05 * np.random.default_rng(5).standard_normal(20)
    fit = fit_friction(make_map(speed, friction_of(speed) + noise, 0.05))
    assert "the plateau above the Stribeck part is not reached" in lost(fit)["coulomb"].reason
    assert "viscous" not in fit.determined


def test_good_data_leave_nothing_to_say(make_map, friction_of):
    speed = np.geomspace(1e-3, 0.45, 20)
    noise = 0.5 * np.random.default_rng(6).standard_normal(20)
    fit = fit_friction(make_map(speed, friction_of(speed) + noise, 0.5))
    assert fit.undetermined == ()
    assert fit.determined == ("coulomb", "breakaway", "stribeck_velocity", "viscous")


SLOPES = {"coulomb_a": 5e-6, "coulomb_b": 8e-6, "breakaway_a": 1.5e-5, "breakaway_b": 2.0e-5}


def pressure_data(make_map, friction_of, pairs, seed, noise=0.05):
    speed = np.tile(np.geomspace(1e-3, 0.45, 16), len(pairs))
    a, b = (np.repeat([p[k] for p in pairs], 16) for k in (0, 1))
    friction = friction_of(speed, a, b, SLOPES) + noise * np.random.default_rng(seed).standard_normal(speed.size)
    return make_map(speed, friction, noise, gauge_a=a, gauge_b=b)


def test_pressure_slopes_of_both_chambers(make_map, friction_of):
    pairs = [(0.0, 0.0), (2e5, 0.0), (0.0, 2e5), (4e5, 2e5)]
    fit = fit_friction(pressure_data(make_map, friction_of, pairs, 7), pressure_dependence=True)
    assert fit.undetermined == ()
    for name, value in SLOPES.items():
        low, high = fit.intervals[name]
        assert low <= value <= high
        assert high - low < 0.2 * value


def test_equal_pressures_give_the_sum_of_the_slopes_only(make_map, friction_of):
    pairs = [(p, p) for p in (0.0, 0.5e5, 1.5e5)]
    fit = fit_friction(pressure_data(make_map, friction_of, pairs, 8), pressure_dependence=True)
    assert fit.parameters["coulomb_a"] == fit.parameters["coulomb_b"] == pytest.approx(6.5e-6, rel=0.2)
    assert fit.parameters["breakaway_a"] == pytest.approx(1.75e-5, rel=0.2)
    assert "only the sum of both slopes is known" in lost(fit)["coulomb_a"].reason
    assert "different pressures" in lost(fit)["coulomb_b"].remedy


def test_chamber_that_never_changed(make_map, friction_of):
    pairs = [(0.0, 0.0), (0.0, 2e5), (0.0, 4e5)]
    fit = fit_friction(pressure_data(make_map, friction_of, pairs, 9), pressure_dependence=True)
    assert "the pressure in chamber a is the same in all rows (0 bar gauge)" in lost(fit)["coulomb_a"].reason
    assert fit.parameters["coulomb_b"] == pytest.approx(8e-6, rel=0.1)
    assert "coulomb_a" not in fit.parameters


def test_speed_and_pressure_that_change_together_are_named(make_map, friction_of):
    speed = np.geomspace(1e-3, 0.45, 16)
    gauge = np.linspace(6e5, 0.0, 16)
    data = make_map(speed, friction_of(speed, gauge, 0.0, SLOPES), 0.1, gauge_a=gauge)
    notes = " ".join(fit_friction(data).notes)
    assert "speed and pressure change together" in notes
    assert "averages over them" in notes


def test_friction_that_falls_between_two_speeds_is_no_viscous_part(make_map, friction_of):
    fit = fit_friction(make_map([0.005, 0.015], friction_of([0.005, 0.015]), 0.01))
    assert "unlike a viscous part" in lost(fit)["viscous"].reason
    assert fit.determined == ("coulomb",)
    low, high = fit.intervals["coulomb"]
    assert low < min(friction_of([0.005, 0.015]))
    assert high > max(friction_of([0.005, 0.015]))


def test_four_good_speeds_are_enough(make_map, friction_of, truth):
    speed = np.array([0.001, 0.012, 0.0335, 0.45])  # support of the optimal design
    fit = fit_friction(make_map(speed, friction_of(speed), 0.05))
    assert fit.undetermined == ()
    for name in fit.free:
        assert fit.parameters[name] == pytest.approx(truth[name], rel=1e-4)


@pytest.mark.parametrize("name", ["coulomb", "breakaway", "stribeck_velocity", "stribeck_exponent", "viscous"])
def test_what_is_not_determined_has_no_interval(make_map, name):
    fit = fit_friction(make_map([0.01], [12.0], 0.2))
    assert (name in fit.intervals) == (name == "coulomb")


def test_two_pressures_give_the_slope_and_leave_the_viscous_part_out(make_map):
    fit = fit_friction(
        make_map([0.011, 0.009], [3.0, 5.0], 0.2, gauge_b=np.array([1e5, 5e5])), law="coulomb", pressure_dependence=True
    )
    assert fit.parameters["coulomb"] == pytest.approx(2.5, abs=0.01)
    assert fit.parameters["coulomb_b"] == pytest.approx(0.5e-5, rel=0.01)
    assert "2 independent values, fewer than the law has parameters" in lost(fit)["viscous"].reason
    assert np.isfinite(fit.intervals["coulomb_b"]).all()
    assert any("a further run may lie far outside" in note for note in fit.notes)
