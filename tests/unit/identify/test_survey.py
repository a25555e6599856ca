"""A survey of several seals: its intervals hold what they say on simulated seals, and it notices a curve."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneudrive import _core
from pneudrive.errors import FitError
from pneudrive.identify import fit_friction
from pneudrive.identify.static.model import FrictionModel, Observations, at_conditions
from pneudrive.identify.static.survey import survey, survey_values
from pneudrive.results import compare_results

LEVELS = np.array([1e5, 3e5, 5e5, 7e5])


def seals(seed, *, count=6, scatter=0.08, between=0.12, bend=0.0):
    """Seals with two runs each of the first two, one of the rest; returns values, runs and a further run of each."""
    rng = np.random.default_rng([11, seed])
    groups, runs, further = {}, {}, {}
    for k in range(count):
        base, slope = rng.uniform(2.0, 8.0), rng.uniform(0.3, 1.5) * 1e-5
        own = scatter * np.exp(0.3 * rng.standard_normal())

        def curve(p, base=base, slope=slope):
            return (base + slope * p) * (1.0 + bend * ((p - 4e5) / 3e5) ** 2)

        def values(p, own=own, curve=curve):
            return curve(p) * (1.0 + between * rng.standard_normal() + own * rng.standard_normal(p.size))

        names = ("1", "2") if k < 2 else ("1",)
        pressure = np.tile(LEVELS, len(names))
        friction = np.concatenate([values(LEVELS) for _ in names])
        empty = at_conditions(np.full(pressure.size, 0.01), 0.0 * pressure, pressure)
        groups[f"seal {k}"] = type(empty)(
            empty.speed_m_s, friction, 0.01 * friction, *(getattr(empty, n) for n in ("gauge_a_pa", "gauge_b_pa")),
            empty.u_systematic_n, np.arange(pressure.size),
        )  # fmt: skip
        runs[f"seal {k}"] = np.repeat(names, LEVELS.size).tolist()
        further[f"seal {k}"] = values
    return groups, runs, further


def test_intervals_hold_a_further_run_and_a_further_recording_as_often_as_stated():
    at = np.array([2e5, 6e5])
    inside, half = [], []
    for seed in range(20, 28):
        groups, runs, further = seals(seed)
        found = survey_values(groups, runs)
        for name, values in further.items():
            band = found.predict(name, speed_m_s=0.01, gauge_b_pa=at, probability=0.9)
            new = values(at)
            inside += ((band.lower_n <= new) & (new <= band.upper_n)).tolist()
            half += ((band.upper_n - band.lower_n) / 2.0 / band.friction_n).tolist()
    assert 0.86 <= np.mean(inside) <= 0.98, np.mean(inside)
    # 1.645 sqrt(2 between^2 + scatter^2 (1 + 1/4)) = 0.32 if all were known
    assert 0.32 < np.median(half) < 0.55


def test_a_straight_line_that_misses_is_noticed_and_one_that_holds_is_not():
    bent = [survey_values(*seals(seed, scatter=0.02, bend=0.25)[:2]) for seed in range(3)]
    assert all("does not hold" in " ".join(found.statements()) for found in bent)
    assert all(found.misses > 0.05 for found in bent)
    line = [survey_values(*seals(seed, scatter=0.02)[:2]) for seed in range(5)]
    assert sum("does not hold" in " ".join(found.statements()) for found in line) <= 1


def test_a_known_run_is_predicted_better_than_a_new_one():
    groups, runs, _ = seals(3)
    found = survey_values(groups, runs)
    known = found.predict("seal 0", speed_m_s=0.01, gauge_b_pa=4e5, run="1")
    new = found.predict("seal 0", speed_m_s=0.01, gauge_b_pa=4e5)
    assert known.upper_n - known.lower_n < 0.8 * (new.upper_n - new.lower_n)
    with pytest.raises(FitError, match=r"(?s)seal 0 has no run '3'.*Known: 1, 2\.$"):
        found.predict("seal 0", speed_m_s=0.01, run="3")


def test_messages_name_what_is_there(make_map):
    curves = make_map(np.full(6, 0.01), 3.0 + np.arange(6.0), 0.1, gauge_b=1e5 * np.arange(6))
    found = survey(curves, ["O-ring"] * 12)
    own = found.seals["O-ring"].fit  # the fit of one seal has the verbs of any other
    assert len(own.recordings) == 6
    assert own.coordinates.tolist() == found.seals["O-ring"].theta.tolist()
    assert own.profile(["coulomb"])["coulomb"] == own.intervals["coulomb"]
    with pytest.raises(FitError, match=r"(?s)no seal 'Oring'.*Did you mean 'O-ring'"):
        found.predict("Oring", speed_m_s=0.01)
    with pytest.raises(FitError, match="no run '2'"):
        found.predict("O-ring", speed_m_s=0.01, run="2")
    with pytest.raises(FitError, match=r"(?s)no column 'seal'.*Known: flags, recording"):
        survey(curves, "seal")
    with pytest.raises(FitError, match="too few recordings for the number of parameters"):
        survey(curves.isel(row=slice(0, 6)), ["O-ring"] * 6)


# --- The fitted function is the core's steady friction, and its Jacobian is its derivative.

SPEED = np.geomspace(1e-3, 0.45, 13)
ONE = np.ones_like(SPEED)
GAUGE_A = np.linspace(0.1e5, 1.5e5, 13)
GAUGE_B = GAUGE_A[::-1] ** 2 / 1.5e5
DATA = Observations(SPEED, ONE, ONE, GAUGE_A, GAUGE_B, 0.0 * ONE, np.zeros(13, np.int64))

MODELS = [
    FrictionModel("coulomb"),
    FrictionModel("coulomb", viscous=False),
    FrictionModel("coulomb", chambers=("a", "b")),
    FrictionModel("stribeck"),
    FrictionModel("stribeck", exponent=1.0),
    FrictionModel("stribeck", lorentzian=True),
    FrictionModel("stribeck", exponent=None),
    FrictionModel("stribeck", exponent=None, chambers=("a", "b")),
    FrictionModel("stribeck", chambers=("b",)),
    FrictionModel("stribeck", chambers=("ab",)),
]
NATURAL = {
    "coulomb": 9.0,
    "breakaway": 14.0,
    "stribeck_velocity": 0.02,
    "stribeck_exponent": 1.6,
    "viscous": 12.0,
    "coulomb_a": 4e-6,
    "coulomb_b": 7e-6,
    "coulomb_ab": 5e-6,
    "breakaway_a": 1.1e-5,
    "breakaway_b": 1.9e-5,
    "breakaway_ab": 1.5e-5,
}


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_internal_coordinates_and_back(model):
    theta = np.array([NATURAL[n] for n in model.names])
    np.testing.assert_allclose(model.transforms.natural(model.internal(theta)), theta, rtol=1e-14)


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_jacobian_is_the_derivative(model):
    q = model.internal(np.array([NATURAL[n] for n in model.names]))
    _, jac = model.value_and_jacobian(q, DATA)
    natural = model.transforms.jacobian(q)
    for k in range(q.size):
        h = 1e-6 * max(abs(q[k]), 1e-6)
        up, down = q.copy(), q.copy()
        up[k] += h
        down[k] -= h
        slope = (model.value(up, DATA) - model.value(down, DATA)) / (2.0 * h)
        np.testing.assert_allclose(jac[:, k], slope, rtol=2e-6, atol=2e-8 * np.abs(slope).max())
        slope = (model.transforms.natural(up) - model.transforms.natural(down)) / (2.0 * h)
        np.testing.assert_allclose(natural[:, k], slope, rtol=1e-6, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(
    coulomb=st.floats(0.1, 100.0),
    excess=st.floats(0.0, 100.0),
    velocity=st.floats(1e-4, 0.3),
    exponent=st.floats(0.4, 3.0),
    viscous=st.floats(0.0, 200.0),
    slope=st.floats(0.0, 2e-5),
)
def test_values_are_the_cores_at_any_force_and_pressure(coulomb, excess, velocity, exponent, viscous, slope):
    model = FrictionModel("stribeck", exponent=None, chambers=("a", "b"))
    theta = dict(NATURAL) | {
        "coulomb": coulomb,
        "breakaway": coulomb + excess + 1e-6,
        "stribeck_velocity": velocity,
        "stribeck_exponent": exponent,
        "viscous": viscous,
        "coulomb_a": slope,
        "breakaway_a": 2.0 * slope,
    }
    q = model.internal(np.array([theta[n] for n in model.names]))
    value = model.value(q, DATA)
    for i in range(SPEED.size):
        forces = {
            force: theta[force] + theta[f"{force}_a"] * GAUGE_A[i] + theta[f"{force}_b"] * GAUGE_B[i]
            for force in ("coulomb", "breakaway")
        }
        parameters = {n: theta[n] for n in ("stribeck_velocity", "stribeck_exponent", "viscous")} | forces
        expected = _core.steady_friction("stribeck", parameters, SPEED[i : i + 1], 0.0, 0.0)
        np.testing.assert_allclose(value[i], expected[0], rtol=1e-12)


def test_coulomb_and_lorentzian_values_are_the_cores():
    model, forces = FrictionModel("stribeck", lorentzian=True), {name: NATURAL[name] for name in MODELS[3].names}
    value = model.value(model.internal(np.array([NATURAL[name] for name in model.names])), DATA)
    expected = _core.steady_friction("stribeck", forces, SPEED, dependences={"stribeck_shape": "lorentzian"})
    np.testing.assert_allclose(value, expected, rtol=1e-12)
    model = FrictionModel("coulomb")
    expected = _core.steady_friction("coulomb", {"coulomb": 7.0, "viscous": 30.0}, SPEED, 0.0, 0.0)
    np.testing.assert_allclose(model.value(np.array([7.0, 30.0]), DATA), expected, rtol=1e-13)


# --- What the data cannot determine is said in words, with the remedy, and no number pretends otherwise.


def lost(fit):
    return {s.parameter: s for s in fit.undetermined}


def remedied(one, reason, remedy):
    """Return the numbers that patterns find in the reason and the remedy of a statement."""
    pairs = ((reason, one.reason), (remedy, one.remedy))
    return [float(number) for pattern, text in pairs for number in re.search(pattern, text.replace("\n", " ")).groups()]


def test_two_speeds_cannot_give_a_stribeck_velocity(noisy_fit):
    fit = noisy_fit(np.repeat([0.005, 0.015], 4), 0.05, 1)
    assert np.isnan(fit.parameters["breakaway"])
    statement = str(lost(fit)["stribeck_velocity"])
    assert "2 distinct speeds (5 mm/s, 15 mm/s)" in statement
    assert "measure at least 8 speeds" in statement
    assert "breakaway, stribeck_velocity cannot be determined: the map has 2 distinct speeds" in str(fit)
    assert set(fit.determined) <= {"coulomb", "viscous"}


def test_one_speed_gives_the_friction_there_and_nothing_else(noisy_fit, friction_of):
    fit = noisy_fit(np.full(6, 0.01), 0.05, 2)
    assert fit.determined == ("coulomb",)
    assert fit.parameters["coulomb"] == pytest.approx(friction_of([0.01])[0], abs=0.1)
    assert "the whole friction at that speed" in lost(fit)["viscous"].reason


def test_one_value_is_enough_for_one_number(make_map):
    fit = fit_friction(make_map([0.01], [12.0], 0.2))
    (ends,) = fit.intervals.values()  # that of the Coulomb force
    assert ends == pytest.approx((12.0 - 1.96 * 0.2, 12.0 + 1.96 * 0.2), rel=1e-3)
    assert any("only on the stated standard errors" in note for note in fit.notes)


def test_breakaway_and_stribeck_velocity_are_not_separable_from_the_tail(noisy_fit):
    fit = noisy_fit(np.geomspace(0.026, 0.45, 20), 0.002, 3)  # slowest level above 2 vs = 24 mm/s
    assert {"breakaway", "stribeck_velocity"} <= set(lost(fit))
    times, vs, level = remedied(lost(fit)["breakaway"], r"above (\S+) vs \(vs is near (\S+) mm/s", r"below (\S+) mm/s")
    assert (times, level) == (2.0, vs)
    assert {"coulomb", "viscous"} <= set(fit.determined)


def test_where_only_the_limit_at_zero_is_open_speeds_below_half_the_stribeck_velocity_are_needed(noisy_fit):
    fit = noisy_fit(np.geomspace(8e-3, 0.45, 12), 0.3, 3)
    slowest, level = remedied(lost(fit)["breakaway"], r"speed, (\S+) mm/s, is too high", r"below (\S+) mm/s")
    assert (slowest, level) == (8.0, pytest.approx(500.0 * fit.values["stribeck_velocity"], rel=0.01))


def test_no_falling_part_means_no_stribeck_velocity(noisy_fit):
    fit = noisy_fit(np.geomspace(1e-3, 0.45, 20), 0.5, 4, breakaway=30.0)
    assert "does not fall significantly with speed" in lost(fit)["stribeck_velocity"].reason


def test_one_speed_on_the_fall_shows_the_fall_and_no_breakaway_force(make_map, friction_of):
    """Friction falls by 2 N at one of five speeds, with a scatter of 0.3 N. Between speeds, the laws are not known."""
    speed, a, b = np.tile([0.015, 0.04, 0.1, 0.2, 0.45], 4), np.repeat([0.0, 1e5] * 2, 5), np.repeat([0.0, 1e5], 10)
    friction, fits = friction_of(speed, a, b, SLOPES), []
    for seed in (3, 4):
        values = friction * (1.0 + 0.01 * np.random.default_rng(seed).standard_normal(20))
        fits.append(fit_friction(make_map(speed, values, 0.3, gauge_a=a, gauge_b=b), pressure_dependence=True))
        assert {"breakaway", "stribeck_velocity", "breakaway_a", "breakaway_b"} <= set(lost(fits[-1]))
        assert fits[-1].model.stribeck
    for pair in compare_results(*fits).curves:
        np.testing.assert_allclose(pair.x, speed[:5], rtol=1e-12)


def test_an_excess_at_zero_is_not_known_as_well_as_the_coulomb_force(make_map):
    """Each speed at another pressure: the best excess without pressure is 0, the true one 4.7 N."""
    speed = np.geomspace(5.423e-3, 0.35737, 14)
    a = 1e5 * np.array([0, 2, 2, 2, 1, 1, 2, 0, 1, 0, 2, 2, 1, 1])
    b = 1e5 * np.array([2, 0, 0, 0, 2, 1, 0, 1, 0, 1, 2, 2, 2, 0])
    measured = [28.579, 28.443, 27.472, 26.565, 27.775, 26.134, 26.705]
    measured += [24.748, 25.631, 26.187, 33.127, 34.647, 34.751, 34.265]
    fit = fit_friction(make_map(speed, np.array(measured), 0.0273, gauge_a=a, gauge_b=b), pressure_dependence=True)
    assert fit.values["breakaway"] == pytest.approx(fit.values["coulomb"], abs=1e-3)
    for name, truth in {
        "coulomb": 21.507,
        "breakaway": 26.210,
        "breakaway_a": 2.062e-5,
        "breakaway_b": 1.759e-5,
    }.items():
        assert fit.intervals[name][0] < truth < fit.intervals[name][1], name


def test_plateau_that_is_not_reached(noisy_fit):
    fit = noisy_fit(np.geomspace(1e-3, 0.02, 20), 0.05, 5)
    plateau, vs, level = remedied(lost(fit)["coulomb"], r"below (\S+) vs \(vs is near (\S+) mm/s", r"above (\S+) mm/s")
    assert (level, vs) == (pytest.approx(plateau * vs, rel=0.02), pytest.approx(12.0, rel=0.5))
    assert "viscous" not in fit.determined


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
    assert "averages over this range" in notes


def test_friction_that_falls_between_two_speeds_is_no_viscous_part(make_map, friction_of):
    fit = fit_friction(make_map([0.005, 0.015], friction_of([0.005, 0.015]), 0.01))
    assert "between 5 mm/s and 15 mm/s, but viscous friction would rise" in lost(fit)["viscous"].reason
    assert "below 5 mm/s and above 45 mm/s" in lost(fit)["viscous"].remedy
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


def test_two_pressures_give_the_slope_and_leave_the_viscous_part_out(make_map):
    fit = fit_friction(
        make_map([0.011, 0.009], [3.0, 5.0], 0.2, gauge_b=np.array([1e5, 5e5])), law="coulomb", pressure_dependence=True
    )
    assert fit.parameters["coulomb"] == pytest.approx(2.5, abs=0.01)
    assert fit.parameters["coulomb_b"] == pytest.approx(0.5e-5, rel=0.01)
    assert "2 independent values, fewer than the law has parameters" in lost(fit)["viscous"].reason
    assert np.isfinite(fit.intervals["coulomb_b"]).all()
    assert any("a further run may be far outside" in note for note in fit.notes)
