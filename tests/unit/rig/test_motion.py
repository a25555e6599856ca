"""Servo motion keeps its limits, is continuous, and ends exactly where it should."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneudrive.errors import CommandError
from pneudrive.rig import Limits, cycles, dwell, move, uniform_in_position

DISTANCE = st.floats(1e-4, 3.0)
SPEED = st.floats(1e-4, 4.0)
LIMITS = st.builds(Limits, st.floats(0.05, 50.0), st.floats(0.5, 5e4))
CASE = {"distance": DISTANCE, "speed": SPEED, "limits": LIMITS, "sign": st.sampled_from((1.0, -1.0))}


@settings(max_examples=300, deadline=None)
@given(**CASE)
def test_limits_and_end_state(distance, speed, limits, sign):
    motion = move(sign * distance, speed, limits, start_m=0.25)
    _, position, velocity, acceleration = motion.knots()
    tiny = 1e-12
    assert np.all(motion.durations_s > 0.0)
    assert abs(position[-1] - 0.25 - sign * distance) <= tiny * max(distance, 0.25)
    assert abs(velocity[-1]) <= tiny * speed
    assert abs(acceleration[-1]) <= tiny * limits.acceleration_m_s2
    assert np.max(np.abs(motion.jerks_m_s3)) <= limits.jerk_m_s3 * (1.0 + tiny)
    # acceleration is linear between knots, and velocity extreme where it vanishes: at knots only
    assert np.max(np.abs(acceleration)) <= limits.acceleration_m_s2 * (1.0 + tiny)
    assert np.max(np.abs(velocity)) <= speed * (1.0 + tiny)
    assert np.all(sign * velocity >= -tiny * speed)


@settings(max_examples=100, deadline=None)
@given(**CASE)
def test_continuity(distance, speed, limits, sign):
    motion = move(sign * distance, speed, limits)
    knots = motion.knots()
    inner = knots[0, 1:-1]
    before, after = motion.at(inner * (1.0 - 1e-12)), motion.at(inner * (1.0 + 1e-12))
    reach = 4e-12 * motion.duration_s  # what each may change by over the gap between both times
    slopes = (speed, limits.acceleration_m_s2, limits.jerk_m_s3)
    scales = (distance, speed, limits.acceleration_m_s2)
    for low, high, slope, scale in zip(before, after, slopes, scales, strict=True):
        np.testing.assert_allclose(low, high, rtol=0.0, atol=reach * slope + 1e-12 * scale)


@settings(max_examples=100, deadline=None)
@given(**CASE)
def test_time_reversal_mirrors_the_move(distance, speed, limits, sign):
    motion = move(sign * distance, speed, limits)
    time = np.linspace(0.0, motion.duration_s, 41)
    position, velocity, _ = motion.at(time)
    back, velocity_back, _ = motion.at(motion.duration_s - time)
    np.testing.assert_allclose(position + back, sign * distance, atol=1e-9 * distance)
    np.testing.assert_allclose(velocity, velocity_back, atol=1e-7 * speed)


@settings(max_examples=100, deadline=None)
@given(distance=DISTANCE, limits=LIMITS)
def test_top_speed_is_just_reached(distance, limits):
    top = limits.top_speed_m_s(distance)
    assert 2.0 * limits.ramp_distance_m(top) == pytest.approx(distance, rel=1e-9)
    _, _, velocity, _ = move(distance, 10.0 * top, limits).knots()
    assert velocity.max() == pytest.approx(top, rel=1e-9)


def test_known_move():
    # 5 m/s2 and 50 m/s3: 0.1 s up and down with jerk; 0.5 m/s takes 0.2 s and 0.05 m
    limits = Limits(5.0, 50.0)
    assert limits.ramp_time_s(0.5) == pytest.approx(0.2)
    assert limits.ramp_distance_m(0.5) == pytest.approx(0.05)
    motion = move(0.6, 0.5, limits)
    assert motion.duration_s == pytest.approx(0.2 + 1.0 + 0.2)
    assert motion.at(0.7)[0] == pytest.approx(0.3)
    assert motion.at(0.7)[1] == pytest.approx(0.5)


def test_cycles_return_and_count():
    motion = cycles(0.01, 0.29, 0.1, Limits(5.0, 200.0), count=3, dwell_s=0.5)
    assert motion.at(motion.duration_s)[0] == pytest.approx(0.01, abs=1e-12)
    position = motion.at(np.linspace(0.0, motion.duration_s, 20001))[0]
    assert position.max() == pytest.approx(0.29, abs=1e-12)
    assert position.min() == pytest.approx(0.01, abs=1e-12)
    still = cycles(0.01, 0.29, 0.1, Limits(5.0, 200.0), count=3)
    assert motion.duration_s == pytest.approx(still.duration_s + 6 * 0.5)


@pytest.mark.parametrize("dwell_s", [0.0, 1.0])
def test_encoder_clock_is_even_along_the_path(dwell_s):
    motion = cycles(0.005, 0.295, 0.45, Limits(5.0, 200.0), count=2, dwell_s=dwell_s)
    time = uniform_in_position(motion, 10001)
    assert np.all(np.diff(time) > 0.0)
    position = motion.at(time)[0]
    np.testing.assert_allclose(np.abs(np.diff(position)), 4 * 0.29 / 10000, rtol=1e-6)


def test_speed_that_is_not_reached_says_what_is():
    with pytest.raises(CommandError, match=r"(?s)450 mm/s is not reached within 30 mm.*51\.75 mm.*at most 329\.8 mm/s"):
        cycles(0.0, 0.03, 0.45, Limits(5.0, 200.0))


@pytest.mark.parametrize(
    "call",
    [
        lambda: move(0.0, 0.1, Limits(1.0, 1.0)),
        lambda: move(np.nan, 0.1, Limits(1.0, 1.0)),
        lambda: move(0.1, -0.1, Limits(1.0, 1.0)),
        lambda: dwell(-1.0),
        lambda: Limits(0.0, 1.0),
        lambda: Limits(1.0, np.inf),
        lambda: cycles(0.2, 0.1, 0.1, Limits(1.0, 1.0)),
        lambda: cycles(0.1, 0.2, 0.1, Limits(1.0, 1.0), count=0),
        lambda: cycles(0.1, 0.2, np.nan, Limits(1.0, 1.0)),
    ],
)
def test_motions_that_make_no_sense(call):
    with pytest.raises(CommandError):
        call()
