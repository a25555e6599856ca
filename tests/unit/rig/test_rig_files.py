"""Rig files extend one another; what does not fit together is refused with one message."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneudrive.errors import CommandError, DescriptionError
from pneudrive.rig import (
    Limits,
    SimulatedRig,
    shipped_rigs,
)
from pneudrive.rig.description import DEFAULT, read_description
from pneudrive.rig.motion import cycles, move

ASSUMED = 'source = "assumed", reason = "for this test"'


def written(tmp_path, text, name="rig.toml"):
    path = tmp_path / name
    path.write_text("schema = 1\n" + text, encoding="utf-8")
    return path


def test_a_file_takes_what_it_does_not_say_from_the_one_that_it_extends(tmp_path):
    text = f'extends = "common-manifold"\nname = "Mine"\n[cylinder]\nbore = {{ value = "32 mm", {ASSUMED} }}\n'
    base = read_description(shipped_rigs()["common-manifold"])
    mine = read_description(written(tmp_path, text))
    assert mine.name == "Mine"
    assert mine.tables.cylinder.bore == 0.032
    assert mine.tables.chambers == base.tables.chambers
    assert mine.sources["cylinder.bore"].reason == "for this test"
    again = f'extends = "rig.toml"\n[cylinder]\nstroke = {{ value = "200 mm", {ASSUMED} }}\n'
    beside = read_description(written(tmp_path, again, "second.toml"))
    assert (beside.tables.cylinder.bore, beside.tables.cylinder.stroke) == (0.032, 0.2)


def test_another_law_takes_no_values_of_the_old_one(tmp_path):
    text = f'extends = "default"\n[friction]\nlaw = "coulomb"\ncoulomb = {{ value = "7 N", {ASSUMED} }}\n'
    mine = read_description(written(tmp_path, text))
    assert mine.friction["parameters"] == {"coulomb": 7.0, "viscous": 0.0}
    assert mine.friction["pressure"] == read_description(DEFAULT).friction["pressure"]
    assert SimulatedRig(mine).true_friction(0.1) == pytest.approx(7.0)


def test_a_list_of_the_friction_table_gives_its_source_once(tmp_path):
    values = {"coulomb": "20 N", "breakaway": "28 N", "stribeck_velocity": "20 mm/s", "attraction": "2000 N/s"}
    lines = [f'{key} = {{ value = "{value}", {ASSUMED} }}' for key, value in values.items()]
    elements = '[{ stiffness = "4e4 N/m", share = 0.15 }, { stiffness = "6e4 N/m", share = 0.85 }]'
    head = ['extends = "default"', "[friction]", 'law = "gms"', f"elements = {{ value = {elements}, {ASSUMED} }}"]
    mine = read_description(written(tmp_path, "\n".join([*head, *lines]) + "\n"))
    assert mine.friction["elements"] == [
        {"stiffness_n_m": 4e4, "share": 0.15},
        {"stiffness_n_m": 6e4, "share": 0.85},
    ]
    assert SimulatedRig(mine).true_friction(1e-4) == pytest.approx(28.0, abs=0.02)


def extending(table, key, value):
    return f'extends = "default"\n[{table}]\n{key} = {{ value = "{value}", {ASSUMED} }}\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('extends = "rig.toml"\n', "extends itself"),
        ('extends = "nothing"\n', "there is no file"),
        (extending("chambers", "kind", "common"), "chambers.dead_volume is missing"),
        (extending("servo", "bandwidth", "50 Hz"), "are needed together"),
        (extending("servo", "ripple", "1 %"), "needs servo.pitch"),
        (extending("servo", "ripple", "-1 %"), "(?s)servo.ripple: -0.01 is out of bounds.*not less than 0"),
        (extending("thermal", "room_amplitude", "1 degC"), "(?s)not a difference of temperatures.*in K"),
        (extending("cylinder", "rod_diameter", "25 mm"), "is not smaller than the bore"),
        (extending("mounting.odd", "side_lode", "5 N"), "side_lode is not a known key"),
        (extending("friction", "coulomb", "9 mm"), "friction.coulomb"),
        (extending("friction", "law", "gms"), "friction.law must be a name without a source"),
        (extending("encoder", "resolution", "1 um").replace(" }", ', sauce = "x" }'), "'sauce' is unknown"),
    ],
)
def test_files_that_do_not_fit_together(tmp_path, text, message):
    with pytest.raises(DescriptionError, match=message):
        read_description(written(tmp_path, text))


# --- Servo motion keeps its limits, is continuous, and ends exactly where it should.

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
    motion = cycles(0.01, 0.29, 0.1, Limits(5.0, 200.0), count=3)
    assert motion.at(motion.duration_s)[0] == pytest.approx(0.01, abs=1e-12)
    position = motion.at(np.linspace(0.0, motion.duration_s, 20001))[0]
    assert position.max() == pytest.approx(0.29, abs=1e-12)
    assert position.min() == pytest.approx(0.01, abs=1e-12)
    assert motion.duration_s == pytest.approx(3 * cycles(0.01, 0.29, 0.1, Limits(5.0, 200.0)).duration_s)


def test_speed_that_is_not_reached_says_what_is():
    with pytest.raises(CommandError, match=r"(?s)450 mm/s is not reached within 30 mm.*51\.75 mm.*at most 329\.8 mm/s"):
        cycles(0.0, 0.03, 0.45, Limits(5.0, 200.0))


@pytest.mark.parametrize(
    "call",
    [
        lambda: Limits(0.0, 1.0),
        lambda: Limits(1.0, np.inf),
        lambda: cycles(0.1, 0.2, np.nan, Limits(1.0, 1.0)),
    ],
)
def test_motions_that_make_no_sense(call):
    with pytest.raises(CommandError):
        call()
