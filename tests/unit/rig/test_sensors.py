"""Sensors add what they say: noise, zero, steps, saturation; the same seed gives the same samples."""

from __future__ import annotations

import numpy as np
import pytest

from pneudrive.errors import DescriptionError
from pneudrive.rig import AnalogSensor, Encoder


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


def test_seed_decides():
    sensor = AnalogSensor(-10.0, 10.0, 16, 0.1)
    signal = np.zeros(100)
    np.testing.assert_array_equal(read(sensor, signal, 5), read(sensor, signal, 5))
    assert np.any(read(sensor, signal, 5) != read(sensor, signal, 6))


def test_encoder_shows_the_last_full_count():
    seen = Encoder(1e-6).read(np.array([0.0, 0.4e-6, 1.6e-6, -0.4e-6]))
    np.testing.assert_allclose(seen, [0.0, 0.0, 1e-6, -1e-6], atol=1e-15)


@pytest.mark.parametrize(
    "make",
    [
        lambda: AnalogSensor(1.0, 1.0, 16, 0.1),
        lambda: AnalogSensor(-1.0, np.inf, 16, 0.1),
        lambda: AnalogSensor(-1.0, 1.0, 2, 0.1),
        lambda: AnalogSensor(-1.0, 1.0, 16, -0.1),
        lambda: AnalogSensor(-1.0, 1.0, 16, 0.1, zero=np.nan),
        lambda: Encoder(0.0),
    ],
)
def test_sensors_that_cannot_be(make):
    with pytest.raises(DescriptionError):
        make()
