"""The paper's sentences hold on the simulated data, and the checks say no where the physics is another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneudrive.paper import figure_1, figure_2, figure_3, figure_5, figure_6, figure_8, paper_figures
from pneudrive.paper import stick_slip as ss
from pneudrive.rig import SimulatedRig

RIG = SimulatedRig.default()


def test_all_figures_hold_and_are_marked_synthetic():
    figures = paper_figures(seed=3)
    assert list(figures) == [1, 2, 3, 5, 6, 8]
    for number, figure in figures.items():
        assert figure.number == number
        assert figure.holds, figure.measured
        assert figure.synthetic
        assert all(np.isfinite(values).all() for values in figure.columns.values())
        assert all(np.isfinite(value) for value in figure.quantities.values())


@pytest.mark.parametrize("figure", [figure_1(), figure_2(), figure_3()], ids=lambda f: f"figure-{f.number}")
def test_stick_slip_meets_its_numbers(figure):
    time, position, velocity = (figure.columns[k] for k in ("time_s", "position_m", "velocity_m_s"))
    # measured again from the arrays, without the package: mean between the first and last slip
    slips = np.flatnonzero((velocity[1:] > 0.03) & (velocity[:-1] <= 0.03))
    first, last = slips[0], slips[-1]
    mean = (position[last] - position[first]) / (time[last] - time[first])
    inside = velocity[first:last]
    assert mean == pytest.approx(9.34e-3, abs=0.5e-3)
    assert slips.size - 1 >= 5
    assert inside.max() >= 3.0 * mean
    assert np.mean(inside < 0.2 * mean) >= 0.3


def test_stribeck_rests_exactly_and_lugre_does_not():
    rest = figure_3()
    assert np.mean(rest.columns["velocity_m_s"] == 0.0) == rest.quantities["rest_share"] > 0.5
    assert np.mean(figure_2().columns["velocity_m_s"] == 0.0) < 0.01


def test_sensors_of_figure_1_show_counts_and_noise():
    one, two = figure_1(1), figure_1(2)
    counts = one.columns["position_m"] / 5e-6
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert np.std(one.columns["pressure_a_pa"] - two.columns["pressure_a_pa"]) == pytest.approx(
        2**0.5 * 200.0, rel=0.05
    )


def test_faster_drive_is_not_the_papers():
    quick = ss._figure(2, "", ss._columns(ss.creep("lugre", 0.003)))
    assert quick.quantities["mean_speed_m_s"] > 12e-3
    assert not quick.holds


def test_peak_after_the_turn_needs_a_breakaway_above_sliding():
    assert not figure_5(RIG.with_friction(breakaway=9.0)).holds
    assert not figure_5(RIG.with_friction(stribeck_velocity=0.5)).holds
    good = figure_5()
    assert good.quantities["peak_n"] < RIG.description.parameters["breakaway"] + 0.5
    assert good.columns["time_s"][0] == 0.0


def test_resistance_is_not_biggest_at_low_speed_where_grease_dominates():
    assert not figure_6(RIG.with_friction(viscous=60.0)).holds
    assert not figure_6(RIG.with_friction(breakaway=9.0)).holds


def test_protocol_and_settling_against_the_truth():
    figure = figure_6()
    settled, truth = figure.columns["friction_settled_n"], figure.columns["friction_true_n"]
    assert np.all(np.abs(settled - truth) <= figure.columns["expanded_uncertainty_n"])
    assert figure.quantities["settled_error_n"] < 0.03
    assert abs(figure.quantities["protocol_error_n"]) > 3.0 * figure.quantities["settled_error_n"]
    assert figure.quantities["protocol_error_at_m_s"] > 0.2  # where starting and stopping take longest


@pytest.mark.parametrize(
    "pressure",
    [
        {"coulomb_a": 0.0, "coulomb_b": 0.0, "breakaway_a": 0.0, "breakaway_b": 0.0},
        {"coulomb_a": 5e-6, "coulomb_b": 5e-6, "breakaway_a": 5e-6, "breakaway_b": 5e-6},
    ],
    ids=["no-pressure", "whole-curve-shifts"],
)
def test_curves_that_do_not_turn_into_stribecks(pressure):
    other = SimulatedRig(replace(RIG.description, pressure=pressure))
    assert not figure_8(other).holds


def test_curves_are_ordered_by_pressure():
    columns = figure_8().columns
    assert columns["friction_n"].shape == (15, 40)
    assert np.all(np.diff(columns["friction_n"], axis=0) > 0.0)
    assert np.all(np.diff(columns["dip"]) > 0.0)
    middle = columns["speed_m_s"] < 0.1
    np.testing.assert_allclose(columns["friction_n"][:, middle], columns["friction_true_n"][:, middle], atol=0.08)
