"""Stops on a simulated rig: the held force relaxes, breakaway grows with the stop and with pressure, mounting adds."""

from __future__ import annotations

import numpy as np
import pytest

from oracle.rig_truth import telling
from pneudrive.errors import DescriptionError
from pneudrive.rig import Hold, Move, Samples, Sampling, load_rig
from pneudrive.rig.description import read_description

ASSUMED = 'source = "assumed", reason = "for this test"'


def stop(rig, duration, speed=0.01, released=False):
    """Make a stop in the middle of a move after two strokes; give its samples and its truth."""
    rig.move(0.02, 0.1)
    for to in (0.28, 0.02):
        rig.move(to, 0.1)
    rig.begin_cycle(f"stop {duration} {released}")
    steps = [Move(0.15, speed), Hold(duration, released), Move(0.28, speed)]
    return Samples.join(list(rig.acquire(steps, Sampling()))), rig.truth()["steps"]


@pytest.fixture
def rig():
    return telling(load_rig("open-chambers", seed=1))


def test_the_held_force_relaxes_by_what_the_springs_in_series_let_it(rig):
    samples, (_, held, _) = stop(rig, 60.0)
    d = rig.rig.description
    time, seen = (values[samples.step == 1] for values in (samples.time_s, samples.force_n))
    time = time - time[0]
    zero = d.force_sensor.zero

    def at(t, width):
        return seen[(time > t - width) & (time < t + width)].mean() - zero

    # A share rho of the bristles lets go; the sensor and the bristles that are left share its force by stiffness.
    rho, bristles = d.friction["relaxation"]["share"], d.friction["parameters"]["bristle_stiffness"]
    lost = rho * d.tables.force_sensor.stiffness / (d.tables.force_sensor.stiffness + (1.0 - rho) * bristles)
    settled = at(0.1, 0.05)  # the axis has come to rest
    assert at(59.0, 0.9) == pytest.approx(settled * (1.0 - lost), abs=0.1)
    assert settled - 0.2 > at(4.0, 0.5) > at(12.0, 0.5) > at(59.0, 0.9)
    assert held["force_end_n"] == pytest.approx(at(59.0, 0.9), abs=0.1)


def test_breakaway_grows_with_the_stop_by_what_the_age_adds(rig):
    durations = (0.1, 1.0, 10.0, 100.0, 1000.0)
    told = [stop(rig, duration)[1][2] for duration in durations]
    peaks = np.array([step["friction_peak_n"] for step in told])
    ages = [step["age_begin_s"] for step in told]
    added = np.array([step["dwell_increment_n"] for step in told])
    assert np.all(np.diff(peaks) > 0.0)
    assert np.all(np.array(ages) - np.array(durations) < 0.1)
    # Creep before breakaway takes a little of the age, relaxation of the force a little of the creep.
    assert np.all(np.abs(np.diff(added) - np.diff(peaks)) < 0.1 * np.diff(added) + 0.15)
    assert peaks[-1] - peaks[0] == pytest.approx(added[-1] - added[0], rel=0.1)


def test_a_released_contact_ages_as_a_held_one_does(rig):
    held = stop(rig, 100.0)[1]
    released = stop(rig, 100.0, released=True)[1]
    assert abs(released[1]["force_end_n"]) < 1e-3
    assert released[2]["dwell_increment_n"] == pytest.approx(held[2]["dwell_increment_n"], rel=0.01)


def test_age_weighs_more_under_pressure():
    rig = telling(load_rig("common-manifold", seed=1))
    added = []
    for pressure in (101300.0, 251300.0):
        rig.set_pressure(pressure, pressure)
        added.append(stop(rig, 10.0)[1][2]["dwell_increment_n"])
    # 0.1 per bar in each chamber
    assert added[1] / added[0] == pytest.approx(1.3, rel=0.01)


def test_mounting_direction_and_place_are_in_the_friction():
    rig = telling(load_rig("open-chambers", seed=1))
    d = rig.rig.description

    def friction(mounting):
        rig.change({"mounting": mounting})
        table = rig._machine.friction(rig.past)
        scale = table["parameters"]["coulomb"] / d.friction["parameters"]["coulomb"]  # each mounting has its own level
        return [rig._machine.steady_n(rig.past, table, v) / scale for v in (0.1, -0.1)], scale

    (out, back), _ = friction("rigid")
    (out_offset, back_offset), scale = friction("offset")
    assert out_offset - out == pytest.approx(25.0 * 0.1 / scale, rel=2e-3)
    assert back_offset - back == pytest.approx(25.0 * 0.1 / scale, rel=2e-3)
    assert (out - 0.3) / (back - 0.3) == pytest.approx(1.02 / 0.98, rel=1e-3)  # but for 3 N s/m at 0.1 m/s
    rig.change({"mounting": "rigid"})
    rig.begin_cycle("place")
    steps = [Move(0.02, 0.1), Move(0.28, 0.1)]
    samples = Samples.join(list(rig.acquire(steps, Sampling())))
    there = samples.step == 1
    ends = [samples.force_n[there & (np.abs(samples.position_m - at) < 0.02)].mean() for at in (0.08, 0.22)]
    assert (ends[1] - ends[0]) / np.mean(ends) == pytest.approx(0.05 * 0.14, abs=0.006)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (f'[friction.dwell]\ngrowth = {{ value = "log", {ASSUMED} }}\n', "friction.dwell.increment"),
        (
            f'[friction.dwell]\ngrowth = {{ value = "logg", {ASSUMED} }}\n',
            "(?s)'logg' is not known.*Did you mean 'log'",
        ),
        (f'[friction.direction]\nup = {{ value = "1", {ASSUMED} }}\n', "friction.direction.up is not a known key"),
        ('[friction.direction]\npositive = "1.1"\n', "friction.direction.positive = '1.1' has no source"),
    ],
)
def test_tables_of_what_acts_on_friction_are_checked(tmp_path, table, message):
    path = tmp_path / "rig.toml"
    path.write_text('schema = 1\nextends = "default"\n' + table, encoding="utf-8")
    with pytest.raises(DescriptionError, match=message):
        read_description(path)


def test_a_rig_file_takes_temperature_wear_and_the_shape_of_the_curve(tmp_path):
    """Each value with its source, as all of a rig file; the tables reach the core, and the contact warms."""
    file = tmp_path / "rig.toml"
    value = "{{ value = {}, {} }}".format
    tables = {
        "temperature": {"reference": '"20 degC"', "viscous": '"2 %/K"', "resistance": '"0.5 K/W"', "time": '"3 min"'},
        "wear": {"run_in": "0.2", "run_in_distance": '"2 km"', "rate": '"0.5 %/km"'},
    }
    friction = {"coulomb": '"30 N"', "breakaway": '"40 N"', "stribeck_velocity": '"12 mm/s"'}
    friction |= {"bristle_stiffness": '"2e5 N/m"', "bristle_damping": '"100 N s/m"', "viscous": '"60 N s/m"'}
    friction |= {"stribeck_shape": '"free"'}
    lines = ["schema = 1", 'extends = "open-chambers"', "[friction]", 'law = "elasto-plastic"']
    lines += [*(f"{key} = {value(given, ASSUMED)}" for key, given in friction.items())]
    for name, table in tables.items():
        lines += [f"[friction.{name}]", *(f"{key} = {value(given, ASSUMED)}" for key, given in table.items())]
    file.write_text("\n".join(lines))
    d = read_description(file)
    assert d.friction["temperature"]["viscous_per_k"] == 0.02
    assert d.friction["wear"]["rate_per_m"] == 5e-6
    assert d.friction["stribeck_shape"] == "free"
    _, told = stop(telling(load_rig(str(file), seed=1)), 1.0)
    assert told
