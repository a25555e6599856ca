"""Where steady sliding is predicted to be unstable a simulated rig swings; where it is predicted stable, it slides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneudrive.rig import SimulatedRig, TimeClock, shipped_rigs
from pneudrive.rig.core import core_friction, core_rig
from pneudrive.rig.stability import rig_stability, self_excited_range, sliding_stability
from pneudrive.rig.swing import drag_swinging

SOFT = SimulatedRig.load(shipped_rigs()["soft"])


def ripple(rig, speed):
    """Give the standard deviation of the piston's speed over its mean, far from the turn."""
    c = rig.drag(speed, clock=TimeClock(20000)).columns
    late = (c["carriage_velocity_m_s"] > 0.0) & (np.abs(c["position_m"] - 0.25) < 0.03)
    return c["velocity_m_s"][late].std() / speed


def range_of(rig):
    d = rig.description
    return self_excited_range(core_friction(d), d.stiffness_n_m, d.damping_n_s_m, d.moving_mass_kg)


def test_the_soft_rig_swings_where_it_is_said_to():
    low, high = range_of(SOFT)
    assert 1e-3 < low < 2e-3
    assert 9e-3 < high < 11e-3
    for speed in (0.9 * low, 1.3 * high):  # above the range a swing that has begun can go on for a little
        assert ripple(SOFT, speed) < 1e-3
    for speed in (1.1 * low, 0.9 * high):
        assert ripple(SOFT, speed) > 0.2


AGEING = {"growth": "log", "increment_n": 1.0, "time_s": 0.01, "exponent": 0.4, "distance_m": 2e-4}


@pytest.mark.parametrize(("damping", "dwell"), [(30.0, None), (60.0, None), (30.0, AGEING), (60.0, AGEING)])
def test_growth_and_frequency_are_those_of_the_simulation(damping, dwell):
    # From steady sliding at 20 mm/s gently down to 9 mm/s: what is left of that swings up or dies away as predicted.
    acting = {} if dwell is None else {"dwell": dwell}
    d = replace(SOFT.description, damping_n_s_m=damping, dependences=acting)
    told = rig_stability(d, 0.009)
    assert told.stable[0] == (damping > 50.0)
    rig = core_rig(d, (101300.0, 101300.0))
    up, down = 0.02 / 0.1**2, -0.011 / 0.4**2
    durations, jerks = [0.1, 0.1, 0.7, 0.4, 0.4, 1.2], [up, -up, 0.0, down, -down, 0.0]
    times = np.linspace(1.7, 2.9, 50000)
    c = rig.run(durations, jerks, times, 0.02, 1e-10).columns
    swing = c["velocity_m_s"] / 0.009 - 1.0
    tops = np.flatnonzero((swing[1:-1] > swing[:-2]) & (swing[1:-1] >= swing[2:])) + 1
    small = tops[(swing[tops] > 1e-6) & (swing[tops] < 0.05)][1:]
    assert small.size > 5
    growth = np.polyfit(times[small], np.log(swing[small]), 1)[0]
    assert growth == pytest.approx(told.growth_1_s[0], rel=0.05)
    assert 1.0 / np.diff(times[small]).mean() == pytest.approx(told.frequency_hz[0], rel=0.02)


def test_a_stiff_damped_rig_slides_steadily_and_a_soft_one_does_not():
    assert range_of(SimulatedRig.default()) is None
    assert rig_stability(SOFT.description, np.array([0.003, 0.1])).stable.tolist() == [False, True]


def test_memory_of_the_contact_steadies_it():
    # Exact criterion for friction that lags by tau behind the speed: stable above K = -(F')(m + Fv tau)/(Fv tau^2),
    # which a bristle law gives with tau = g/(sigma0 v) and friction falling with slope F'.
    speed, mass = 0.005, 1.0
    law = {
        "law": "lugre",
        "parameters": {
            "coulomb": 30.0,
            "breakaway": 40.0,
            "stribeck_velocity": 0.012,
            "stribeck_exponent": 2.0,
            "viscous": 60.0,
            "bristle_stiffness": 2e5,
            "bristle_damping": 0.0,
        },
    }
    weight = np.exp(-((speed / 0.012) ** 2))
    level, slope = 30.0 + 10.0 * weight, -2.0 * speed / 0.012**2 * 10.0 * weight
    tau = level / (2e5 * speed)
    critical = -(60.0 + slope) * (mass + 60.0 * tau) / (60.0 * tau**2)
    for factor, stable in ((0.98, False), (1.02, True)):
        assert sliding_stability(law, speed, factor * critical, 0.0, mass).stable[0] == stable


def test_means_over_swings_less_their_simulated_bias_are_the_friction_of_sliding():
    d = SOFT.description
    for speed in (0.003, 0.006, 0.009):
        c = SOFT.drag(speed, clock=TimeClock(40000)).columns
        middle = (c["carriage_velocity_m_s"] > 0.0) & (np.abs(c["position_m"] - 0.15) < 0.1)
        mean, truth = c["sensor_force_n"][middle].mean(), float(SOFT.true_friction(speed))
        swing = drag_swinging(core_friction(d), speed, d.stiffness_n_m, d.damping_n_s_m, d.moving_mass_kg)
        assert swing.ripple > 0.2
        assert abs(mean - truth) > 0.1
        assert mean - swing.bias_n == pytest.approx(truth, abs=0.03)
    calm = drag_swinging(core_friction(d), 0.05, d.stiffness_n_m, d.damping_n_s_m, d.moving_mass_kg, (1e5, 0.5e5))
    assert calm.ripple < 1e-5
    assert abs(calm.bias_n) < 1e-4
