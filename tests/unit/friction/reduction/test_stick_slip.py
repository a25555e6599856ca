"""Stick-slip is found and measured in any motion."""

import numpy as np
import pytest

from pneudrive.characterise import find_stick_slip
from pneudrive.errors import RecordingError
from pneudrive.friction.characterisation import characterise_recordings
from pneudrive.friction.stick_slip import measure_stick_slip
from pneudrive.signals.recording import Recording

PERIOD, STEP, STUCK = 0.5, 0.005, 0.6  # s, m, share of time


def staircase(time: np.ndarray, stuck: float = STUCK) -> np.ndarray:
    """Rest for a share of each period (60 %), then move by 5 mm along half a cosine: peak speed pi/2 * 5 mm / 0.2 s."""
    phase = np.mod(time, PERIOD) / PERIOD
    move = np.clip((phase - stuck) / (1 - stuck), 0.0, 1.0)
    return STEP * (np.floor(time / PERIOD) + (1 - np.cos(np.pi * move)) / 2)


@pytest.mark.parametrize("noise", [0.0, 5e-6])
@pytest.mark.parametrize("direction", [1, -1])
def test_period_step_peak_and_share_of_time(noise, direction):
    time = np.arange(0.0, 10.0, 0.002)
    position = direction * staircase(time) + np.random.default_rng(1).normal(0.0, noise, time.size)
    (found,) = find_stick_slip(time, position)
    assert found.found
    assert found.direction == direction
    assert found.period_s == pytest.approx(PERIOD, rel=0.01)
    assert found.step_m == pytest.approx(STEP, rel=0.01)
    assert found.mean_speed_m_s == pytest.approx(STEP / PERIOD, rel=0.05)
    assert found.peak_speed_m_s == pytest.approx(np.pi / 2 * STEP / (PERIOD * (1 - STUCK)), rel=0.05)
    # Also slow: the parts of each slip below 20 % of the mean speed.
    slow = 2 * np.arcsin(0.2 * (1 - STUCK) * 2 / np.pi) / np.pi * (1 - STUCK)
    assert found.stuck_share == pytest.approx(STUCK + slow, abs=0.03)


def test_a_known_velocity_is_used():
    time = np.arange(0.0, 5.0, 0.01)
    position = staircase(time)
    velocity = np.gradient(position, time)
    velocity[100] = 99.0
    assert measure_stick_slip(time, position, velocity).ripple > 5


@pytest.mark.parametrize("ripple", [0.0, 0.5])
def test_smooth_motion_and_a_ripple_that_never_rests_are_no_stick_slip(ripple):
    time = np.arange(0.0, 10.0, 0.005)
    position = 0.01 * (time + ripple * np.sin(2 * np.pi * time) / (2 * np.pi))
    position += np.random.default_rng(2).normal(0.0, 5e-6, time.size)
    (found,) = find_stick_slip(time, position)
    assert not found.found
    assert found.stuck_share < 0.02
    assert found.ripple == pytest.approx(np.hypot(ripple / np.sqrt(2), 0.03), abs=0.03)


@pytest.mark.parametrize("glitch", ["held", "spike"])
def test_glitches_of_the_position_are_no_stick_slip(glitch):
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 4.0, 1 / 80)
    position = 0.01 * time
    for first in range(20, 300, 20):
        if glitch == "held":
            position[first : first + 6] = position[first]
        else:
            position[first] += 1e-3
    position += rng.normal(0.0, 5e-6, time.size)
    (found,) = find_stick_slip(time, position)
    assert found.periods >= 3, "they look like rests and jumps"
    assert found.stuck_share > 0.01
    assert not found.found


@pytest.mark.parametrize("stuck", [0.2, 0.9])
def test_short_and_long_rests_are_found_at_80_samples_a_second(stuck):
    time = np.arange(0.0, 8.0, 1 / 80)
    position = staircase(time, stuck) + np.random.default_rng(5).normal(0.0, 5e-6, time.size)
    (found,) = find_stick_slip(time, position)
    assert found.found
    assert found.period_s == pytest.approx(PERIOD, rel=0.03)


def test_each_stroke_is_measured():
    time = np.arange(0.0, 20.0, 0.002)
    position = np.where(time < 10.0, staircase(time), staircase(10.0 - 1e-9) - staircase(time - 10.0))
    assert [s.direction for s in find_stick_slip(time, position) if s.found] == [1, -1]


def test_no_motion_is_refused():
    with pytest.raises(RecordingError, match="no motion"):
        find_stick_slip(np.arange(100.0), np.zeros(100))
    with pytest.raises(RecordingError, match="equal length"):
        find_stick_slip(np.arange(100.0), np.zeros(99))


@pytest.mark.parametrize("counts_per_sample", [0.5, 1.12, 2.16, 7.3])
def test_even_motion_seen_by_a_coarse_encoder_has_no_ripple(counts_per_sample):
    """Steps of 10 um have no finite binary fraction: they differ by rounding, which is no noise of the position."""
    time = np.arange(5000) * 1e-3
    position = np.round(counts_per_sample * np.arange(5000)) * 1e-5
    (slip,) = find_stick_slip(time, position)
    assert slip.ripple < 0.1
    assert not slip.found


def test_a_piston_that_slips_behind_a_soft_sensor_is_told_with_its_numbers():
    """The axis moves evenly, and the force is a sawtooth: each period the piston stays behind by v T, then follows."""
    rng, speed, length, stiffness = np.random.default_rng(0), 2e-3, 0.1, 2e4
    time = np.arange(0.0, 4 * length / speed, 0.002)
    way = np.mod(time * speed, 2 * length)
    sawtooth = 30.0 + stiffness * speed * PERIOD * (np.mod(time, PERIOD) / PERIOD - 0.5)
    pressures = {f"pressure_{side}_pa": np.full(time.size, 101325.0) for side in "ab"}
    recording = Recording(
        "soft",
        time,
        length - np.abs(length - way) + 1e-7 * rng.standard_normal(time.size),
        np.where(way < length, sawtooth, -sawtooth) + 0.05 * rng.standard_normal(time.size),
        **pressures | {"area_a_m2": 3e-4, "area_b_m2": 3e-4, "stiffness_n_m": stiffness},
    )
    found = characterise_recordings(recording)
    assert any("Stick-slip in soft: period 0.5 s, step 1 mm" in note for note in found.notes)
