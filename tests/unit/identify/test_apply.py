"""A fit put into a drive: determined parameters as exactly as they are known, everything else as it was."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest

from pneudrive.describe import Drive
from pneudrive.errors import FitError, PneudriveWarning
from pneudrive.identify import FrictionFit, fit_friction
from pneudrive.identify.identified import Identified, apply_identified

SPEED = np.geomspace(1e-3, 0.45, 20)


def test_kept_values_that_move_the_curve_are_told_with_both_forces(drive, noisy_fit):
    """Speeds above the fall of friction: breakaway and Stribeck speed stay those of the drive."""
    fit = noisy_fit(np.geomspace(0.05, 0.45, 20), 0.3, 31)
    assert "breakaway" not in fit.determined
    slow = drive.replace({"friction.stribeck_velocity": "200 mm/s", "friction.breakaway": "60 N"})
    with pytest.warns(PneudriveWarning, match=r"does not determine .*breakaway.*the drive keeps its value") as said:
        after = fit.apply(slow)
    (text,) = [str(w.message) for w in said if "keeps its value: at" in str(w.message)]
    pattern = r"at ([0-9.]+) mm/s the friction is ([0-9.]+) N in the drive, ([0-9.]+) N in the fit"
    at, drives, fits = map(float, re.findall(pattern, text)[0])
    p, v = after.friction.parameters, 1e-3 * at
    fall = np.exp(-((v / p["stribeck_velocity"]) ** p["stribeck_exponent"]))
    assert drives == pytest.approx(p["coulomb"] + (p["breakaway"] - p["coulomb"]) * fall + p["viscous"] * v, rel=1e-3)
    assert fits == pytest.approx(float(fit.predict(v).friction_n), rel=2e-2)


def test_a_force_that_no_law_can_have_becomes_the_least_one_of_its_digits(drive, make_map):
    friction = 80.0 * SPEED + 5.0 * np.exp(-((SPEED / 0.02) ** 2))
    fit = fit_friction(make_map(SPEED, friction + 0.3 * np.random.default_rng(3).standard_normal(20), 0.3))
    assert 0.0 <= fit.values["coulomb"] < 1e-9
    assert 0.0 < fit.apply(drive).friction.parameters["coulomb"] < 1e-2 * fit.intervals["coulomb"][1]


def test_determined_parameters_go_over_with_the_digits_that_their_intervals_carry(drive, good):
    changed = good.apply(drive)
    for name, (low, high) in good.intervals.items():
        assert abs(changed.friction.parameters[name] - good.parameters[name]) <= 1e-2 * (high - low), name
    text = changed.to_toml()
    for name in good.intervals:
        (number,) = re.findall(rf'\n{name} = "([0-9.]+) ', text)
        assert len(number.replace(".", "").strip("0")) <= 8, (name, number)
    assert changed.friction.law == drive.friction.law == "lugre"
    assert changed.friction.parameters["bristle_stiffness"] == drive.friction.parameters["bristle_stiffness"]
    assert changed.cylinder == drive.cylinder
    assert drive.friction.parameters["coulomb"] == 30.0


def test_fit_read_from_a_file_applies_as_well(drive, good, tmp_path):
    good.to_toml(tmp_path / "fit.toml")
    again = FrictionFit.from_toml(tmp_path / "fit.toml")
    assert again.apply(drive).core_json() == good.apply(drive).core_json()


@pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")
@pytest.mark.parametrize(("value", "ends"), [(5.0, (0.1, 2000.0)), (0.004, (0.0, 3.0)), (1.4, (-1e3, 600.0))])
def test_a_wide_interval_does_not_change_the_value(drive, value, ends):
    found = Identified({"friction.coulomb": value}, {"friction.coulomb": ends})
    assert apply_identified(found, drive).friction.parameters["coulomb"] == value


@pytest.mark.parametrize("level", [20.0, 60.0])
def test_a_level_that_is_not_determined_goes_no_further_than_the_limit_that_the_fit_sets(drive, make_map, level):
    fit = fit_friction(make_map([0.01, 0.01, 0.01], [level - 0.1, level, level + 0.1], 0.1))
    if level < 45.0:
        after = fit.apply(drive)
    else:
        with pytest.warns(PneudriveWarning, match="gets the limit, 60 N"):
            after = fit.apply(drive)
    assert after.friction.parameters["coulomb"] == pytest.approx(level, abs=0.05)
    assert after.friction.parameters["breakaway"] == pytest.approx(max(45.0, level), abs=0.05)
    assert "friction.breakaway" not in after.provenance
    for name in ("stribeck_velocity", "viscous"):
        assert after.friction.parameters[name] == drive.friction.parameters[name]


def test_half_of_a_sum_of_slopes_has_no_interval_anywhere(drive, make_map, friction_of, tmp_path):
    """Equal pressures in both chambers: 2.0 and 1.4 N/bar, of which the sum alone is known."""
    gauge = np.repeat([0.0, 1e5, 3e5], 20)
    slopes = dict.fromkeys(("coulomb_a", "breakaway_a"), 2.0e-5) | dict.fromkeys(("coulomb_b", "breakaway_b"), 1.4e-5)
    speed = np.tile(SPEED, 3)
    friction = friction_of(speed, gauge, gauge, slopes) + 0.05 * np.random.default_rng(8).standard_normal(60)
    data = make_map(speed, friction, 0.05, gauge_a=gauge, gauge_b=gauge, systematic=0.1)
    fit = fit_friction(data, pressure_dependence=True)
    assert fit.intervals["coulomb_ab"][0] < 1.7e-5 < fit.intervals["coulomb_ab"][1]
    assert "only their joint effect is known" in fit.undetermined[0].reason
    law = fit.predict(0.1, [3e5, 3e5, 0.0], [3e5, 0.0, 3e5])
    assert (law.upper_n - law.lower_n) / 2.0 == pytest.approx([0.1, 5.2, 5.2], abs=0.1)  # 1.7 N/bar by 3 bar, unknown
    fit.to_toml(tmp_path / "fit.toml")
    for found in (fit, FrictionFit.from_toml(tmp_path / "fit.toml")):
        assert {"coulomb_a", "coulomb_b", "breakaway_a", "breakaway_b"}.isdisjoint(found.intervals)
        with pytest.warns(PneudriveWarning, match="joint effect"):
            after = found.apply(drive)
        assert after.friction.pressure.coulomb.a == after.friction.pressure.coulomb.b == pytest.approx(1.7e-5, rel=0.05)
        assert not any("pressure" in name for name in after.provenance)
        assert "friction.coulomb" in after.provenance
    entries = tomllib.loads((tmp_path / "fit.toml").read_text())
    assert set(entries["parameters"]["coulomb_a"]) == {"value", "unit", "determined"}
    assert np.isfinite(entries["shared"]["coulomb_ab"]["interval"]).all()
    assert "N/Pa" not in fit.apply(drive).to_toml()
    assert re.search(r"\n +coulomb_ab +1\.\d+ ± \S+ N/bar", str(fit))
    assert not re.search(r"\n +coulomb_[ab] ", str(fit))


def test_pressure_slopes_go_over(drive, make_map, friction_of):
    slopes = {"coulomb_a": 5e-6, "coulomb_b": 8e-6, "breakaway_a": 1.5e-5, "breakaway_b": 2.0e-5}
    speed = np.tile(SPEED, 3)
    a, b = (np.repeat(p, 20) for p in ([0.0, 2e5, 1e5], [0.0, 0.0, 3e5]))
    noise = 0.05 * np.random.default_rng(33).standard_normal(60)
    data = make_map(speed, friction_of(speed, a, b, slopes) + noise, 0.05, gauge_a=a, gauge_b=b)
    fit = fit_friction(data, pressure_dependence=True)
    seals = fit.apply(drive).friction.pressure
    assert seals.coulomb.a == pytest.approx(fit.parameters["coulomb_a"], rel=1e-3)
    assert seals.breakaway.b == pytest.approx(fit.parameters["breakaway_b"], rel=1e-3)
    assert seals.breakaway.b == pytest.approx(2e-5, rel=0.1)


def test_drive_with_pressure_slopes_refuses_a_fit_without(drive, good):
    seals = {"coulomb": {"a": "1 N/bar", "b": "1 N/bar"}, "breakaway": {"a": "1 N/bar", "b": "1 N/bar"}}
    with pytest.raises(FitError, match=r"(?s)must not be counted twice.*pressure_dependence=True"):
        good.apply(drive.replace({"friction.pressure": seals}))


def test_coulomb_drive_takes_the_whole_law_or_nothing(drive, good, make_map, friction_of):
    plain = drive.replace({"friction": {"law": "coulomb", "coulomb": "30 N", "viscous": "40 N s/m"}})
    changed = good.apply(plain)
    assert changed.friction.law == "stribeck"
    assert changed.friction.parameters["breakaway"] == pytest.approx(good.parameters["breakaway"], rel=1e-4)
    tail = np.geomspace(0.001, 0.02, 20)
    noise = 0.05 * np.random.default_rng(34).standard_normal(20)
    with pytest.raises(FitError, match="has no Stribeck part"):
        fit_friction(make_map(tail, friction_of(tail) + noise, 0.05)).apply(plain)


def test_a_breakaway_force_that_stays_is_told(drive, make_map, recwarn):
    """A fit of one level knows no Stribeck part; that of the drive stays, and is not what was measured."""
    flat = fit_friction(make_map(SPEED, np.full(20, 10.0), 0.1), law="coulomb")
    with pytest.warns(PneudriveWarning, match=r"its breakaway force of 45 N. With the fitted Coulomb force of 10 N"):
        changed = flat.apply(drive)
    assert changed.friction.parameters["breakaway"] == 45.0
    recwarn.clear()
    flat.apply(Drive.load("catalogue:reference").replace({"friction": {"law": "coulomb", "coulomb": "20 N"}}))
    assert not any("breakaway" in str(one.message) for one in recwarn)
