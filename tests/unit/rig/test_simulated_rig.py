"""Recordings of the simulated rig close the force balance, keep their truth, and are the same for the same seed."""

from __future__ import annotations

import numpy as np
import pytest

from oracle.rig_faults import with_friction
from pneudrive.errors import CommandError, DescriptionError
from pneudrive.rig import SimulatedRig
from pneudrive.rig.description import DEFAULT

RIG = SimulatedRig.default()
D = RIG.description


@pytest.mark.parametrize(("law", "gauge"), [("stribeck", (1.5e5, 0.3e5)), ("lugre", (1.5e5, 0.3e5))])
def test_force_balance_closes_sample_by_sample(law, gauge):
    rig = with_friction(RIG, law, bristle_stiffness=1e6, bristle_damping=300.0) if law == "lugre" else RIG
    trace = rig.drag(0.05, gauge)
    c = trace.columns
    pressure = D.areas_m2[0] * (trace.pressure_a_pa - trace.pressure_b_pa)
    left = (
        c["sensor_force_n"] + pressure - c["friction_force_n"] - D.tables.cylinder.moving_mass * c["acceleration_m_s2"]
    )
    assert np.max(np.abs(left)) < 1e-6 * np.max(np.abs(c["sensor_force_n"]))


def test_carriage_follows_the_motion():
    trace = RIG.drag(0.2)
    position, velocity, _ = trace.motion.at(trace.columns["time_s"])
    np.testing.assert_allclose(trace.columns["carriage_position_m"], position, atol=1e-9)
    np.testing.assert_allclose(trace.columns["carriage_velocity_m_s"], velocity, atol=1e-8)
    bend = np.abs(trace.columns["position_m"] - position)
    assert bend.max() < 20.0 / D.tables.force_sensor.stiffness + 1e-5


@pytest.mark.parametrize(("speed", "gauge"), [(0.001, 0.0), (0.45, 1.0e5)])
def test_settled_force_is_the_true_friction(speed, gauge):
    trace = RIG.drag(speed, gauge)
    c = trace.columns
    stroke_m = D.tables.cylinder.stroke
    middle = np.abs(c["position_m"] - 0.5 * stroke_m) < 0.2 * stroke_m
    truth = float(RIG.true_friction(speed, trace.pressure_a_pa, trace.pressure_b_pa))
    out = c["sensor_force_n"][middle & (c["velocity_m_s"] > 0.0)]
    back = c["sensor_force_n"][middle & (c["velocity_m_s"] < 0.0)]
    np.testing.assert_allclose(out, truth, rtol=2e-4)
    np.testing.assert_allclose(back, -truth, rtol=2e-4)


def test_recording_is_of_the_form_of_a_real_one():
    recording = RIG.measure(0.05, 0.5e5, seed=1)
    assert len(recording) == 5000
    assert recording.synthetic
    assert recording.source is None
    assert recording.truth["parameters"] == D.friction["parameters"]
    assert recording.truth["friction_n"] == pytest.approx(float(RIG.true_friction(0.05, 151300.0, 151300.0)))
    assert recording.stiffness_n_m == D.tables.force_sensor.stiffness
    assert recording.mass_beyond_sensor_kg == D.tables.cylinder.moving_mass
    still = recording.pressure_a_pa - 151300.0
    assert still.mean() == pytest.approx(D.pressure_sensor.zero, abs=20.0)
    assert np.all(np.abs(recording.position_m / 1e-6 - np.round(recording.position_m / 1e-6)) < 1e-3)


def test_seed_decides_the_noise_and_nothing_else():
    trace = RIG.drag(0.1)
    one, same, other = RIG.record(trace, 1), RIG.record(trace, 1), RIG.record(trace, 2)
    np.testing.assert_array_equal(one.force_n, same.force_n)
    assert np.any(one.force_n != other.force_n)
    np.testing.assert_array_equal(one.position_m, other.position_m)
    spread = np.std(one.force_n - trace.columns["sensor_force_n"])
    assert spread == pytest.approx(D.force_sensor.noise, rel=0.05)


def test_every_value_of_the_default_rig_states_its_source():
    text = DEFAULT.read_text(encoding="utf-8")
    assert len(D.sources) >= 25
    for name, source in D.sources.items():
        assert source.source in {"assumed", "bracha"}, name
        assert len(source.reason) > 8, name
    assert text.count("value =") + 4 == len(D.sources)  # two slopes, each for two chambers


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('bore = { value = "25 mm", source = "assumed"', 'bore = { value = "25 mm"', "cylinder.bore has no source"),
        ("stroke =", "strok =", "(?s)cylinder.strok is not a known key.*Did you mean 'stroke'"),
        ("[encoder]", "[encoder]\ncolour = 1", "encoder.colour is not a known key"),
        ('value = "5 mm", source', 'value = "150 mm", source', "leaves no stroke for motion"),
        ('value = "time"', 'value = "tme"', "(?s)sampling.clock: 'tme' is not known.*Did you mean 'time'"),
        ("schema = 1", "schema = 2", "another schema"),
        ("schema = 1", "schema = ", "the file is not TOML"),
        ('value = "1.013 bar abs"', 'value = "1.013 bar gauge"', "absolute pressure"),
    ],
)
def test_rig_files_that_are_wrong(tmp_path, old, new, message):
    path = tmp_path / "rig.toml"
    text = DEFAULT.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(DescriptionError, match=message):
        SimulatedRig.load(path)


def test_commands_that_do_not_fit():
    with pytest.raises(CommandError, match=r"1500 mm/s is not reached within 290 mm"):
        RIG.measure(1.5)
    with pytest.raises(CommandError, match=r"the speed of a cycle, -10 mm/s, must be positive"):
        RIG.measure(-0.01)
    with pytest.raises(CommandError, match="cannot be held"):
        RIG.measure(0.1, -2e5)
    with pytest.raises(CommandError, match="cannot be held"):
        RIG.measure(0.1, (0.0, np.nan))
