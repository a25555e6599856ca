"""Sensors add what they say: noise, zero, steps, saturation; the same seed gives the same samples."""

from __future__ import annotations

import numpy as np
import pytest

from oracle.rig_faults import with_friction, with_tables
from pneudrive.errors import DescriptionError
from pneudrive.rig import AnalogSensor, Encoder
from pneudrive.rig.machine import core_rig
from pneudrive.rig.motion import Limits, Motion, dwell, move
from pneudrive.rig.rig_file import shipped_rigs
from pneudrive.rig.simulated import SimulatedRig


def read(sensor, signal, seed=3):
    return sensor.read(np.asarray(signal, dtype=float), np.random.default_rng(seed))


def test_noise_zero_and_gain():
    sensor = AnalogSensor(-100.0, 100.0, 24, noise=0.5, zero=2.0, gain_error=0.01)
    seen = read(sensor, np.full(40000, 30.0))
    assert seen.mean() == pytest.approx(30.3 + 2.0, abs=5 * 0.5 / 200)
    assert seen.std() == pytest.approx(0.5, rel=0.02)
    assert abs(np.corrcoef(seen[1:], seen[:-1])[0, 1]) < 0.02


def test_steps_are_even_and_within_half_a_step():
    sensor = AnalogSensor(-10.0, 10.0, 8, noise=0.0)
    signal = np.linspace(-9.9, 9.9, 3001)
    seen = read(sensor, signal)
    assert sensor.step == pytest.approx(20.0 / 255.0)
    assert np.max(np.abs(seen - signal)) <= 0.5 * sensor.step * (1.0 + 1e-9)
    steps = np.diff(np.unique(seen))
    np.testing.assert_allclose(steps, sensor.step, rtol=1e-9)


def test_range_saturates():
    np.testing.assert_array_equal(read(AnalogSensor(-10.0, 10.0, 12, 0.0), [-50.0, 50.0]), [-10.0, 10.0])


def test_encoder_shows_the_last_full_count():
    seen = Encoder(1e-6).read(np.array([0.0, 0.4e-6, 1.6e-6, -0.4e-6]))
    np.testing.assert_allclose(seen, [0.0, 0.0, 1e-6, -1e-6], atol=1e-15)


def test_a_converter_that_cannot_be():
    with pytest.raises(DescriptionError):
        AnalogSensor(-1.0, 1.0, 2, 0.1)


# --- What a motion of a dragged piston leaves for the next: its state, and where the command stands.

LUGRE = with_friction(SimulatedRig.default(), "lugre", bristle_stiffness=1e6, bristle_damping=300.0).description
SEPARATE = SimulatedRig.load(shipped_rigs()["separate-regulators"]).description
RTOL = 1e-9


def run(rig, motion, begin, **how):
    times = np.linspace(0.0, motion.duration_s, 501)
    return rig.run(motion.durations_s, motion.jerks_m_s3, times, begin, RTOL, **how)


@pytest.mark.parametrize("bandwidth", [None, 50.0])
def test_released_it_shows_no_force_and_goes_on_from_where_it_stands(bandwidth):
    servo = {"bandwidth": bandwidth, "damping_ratio": bandwidth and 0.7}
    rig = core_rig(with_tables(LUGRE, servo=servo), (2e5, 2e5))
    moved = run(rig, move(0.1, 0.05, Limits(2.0, 80.0), 0.02), 0.02)
    wait = dwell(2.0, moved.commanded_m)
    kept, freed = run(rig, wait, moved.state), run(rig, wait, moved.state, released=True)
    # Held, the bristles keep most of the force of sliding; released, nothing is left of it.
    assert kept.columns["sensor_force_n"][-1] > 5.0
    assert abs(freed.columns["sensor_force_n"][-1]) < 1e-6
    assert abs(freed.columns["bristle_deflection_m"][-1]) < 1e-10
    assert freed.commanded_m == pytest.approx(freed.columns["position_m"][-1], abs=1e-9)
    # It sprang back by what sensor and bristles had been bent: some 10 N over 1 N/um.
    assert 1e-6 < kept.columns["carriage_position_m"][-1] - freed.commanded_m < 1e-4
    assert np.abs(run(rig, wait, freed.state).columns["sensor_force_n"]).max() < 1e-3


def test_cut_in_two_it_is_the_same_run():
    rig = core_rig(SEPARATE, (2e5, 1.5e5))
    whole = move(0.2, 0.1, SEPARATE.limits, 0.02)
    first, rest = (Motion(whole.durations_s[part], whole.jerks_m_s3[part], 0.02) for part in (slice(4), slice(4, None)))
    ended, half, again = run(rig, whole, 0.02), run(rig, first, 0.02), run(rig, first, 0.02)
    assert half.state == again.state
    resumed = run(rig, rest, half.state)
    np.testing.assert_allclose(resumed.state, ended.state, rtol=1e-6, atol=1e-9)
    assert resumed.commanded_m == pytest.approx(0.22, abs=1e-12)


def test_what_no_motion_begins_with_is_refused():
    rig = core_rig(LUGRE, (2e5, 2e5))
    with pytest.raises(ValueError, match="1 values and belongs to another circuit: this one has"):
        run(rig, dwell(1.0), [0.0])
    with pytest.raises(ValueError, match="samples must ascend"):
        rig.run([1.0], [0.0], [0.5, 0.2], 0.1, RTOL)
