"""Numbers of a stroke from a trajectory and from its columns alone, as a recording has them."""

import math

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.datasheet.strokes import litres_anr, stroke_numbers, stroke_of
from pneudrive.simulation.trajectory import columns

START = pn.Initial(position="50 mm", pressure_a="3 bar abs", pressure_b="3 bar abs")


@pytest.fixture(scope="module")
def golden():
    drive = pn.Drive.load("catalogue:reference")
    return drive, pn.simulate(drive, "0 s: 0.6, 1 s: -0.6", "2 s", initial=START)


def test_both_strokes_of_the_reference_drive_have_the_known_numbers(golden):
    drive, run = golden
    out, back = stroke_of(run, drive, 0.0, 1.0), stroke_of(run, drive, 1.0, 2.0)
    assert (out.direction, back.direction) == (1, -1)
    assert f"{out.end_speed:.2f} {out.end_energy:.1f} {1e3 * out.overshoot:.2f}" == "2.39 5.7 1.59"
    assert f"{back.stroke_time:.3f} {back.end_speed:.2f}" == "0.329 2.24"
    assert out.dead_time < out.time_99 < out.stroke_time < 0.209  # 0.209 s is the first sample behind the contact


def test_columns_without_impacts_give_the_same_times(golden):
    drive, run = golden
    told, seen = stroke_of(run, drive, 0.0, 1.0), stroke_numbers(columns(run), drive.cylinder.stroke_m, 2.0, 0.0, 1.0)
    assert seen.stroke_time == pytest.approx(told.stroke_time, abs=1e-5)
    bare = stroke_numbers({k: columns(run)[k] for k in ("time_s", "position_m")}, 0.5, begin_s=1.0, end_s=2.0)
    assert bare.stroke_time == pytest.approx(0.32892, abs=5e-4)
    assert math.isnan(bare.end_energy)


def test_a_stop_within_the_stroke_has_overshoot_and_settling():
    t = np.linspace(0.0, 4.0, 4001)
    x = 0.1 + 0.2 * (1.0 - np.exp(-2.0 * t) * np.cos(8.0 * t))
    found = stroke_numbers({"time_s": t, "position_m": x}, 0.5)
    peak = (math.pi - math.atan(2.0 / 8.0)) / 8.0
    assert found.overshoot == pytest.approx(-0.2 * math.exp(-2.0 * peak) * math.cos(8.0 * peak), rel=0.01)
    assert math.isnan(found.stroke_time)
    assert found.settling_time == pytest.approx(math.log(100.0) / 2.0, abs=0.4)


def test_a_drive_draws_what_its_chambers_take(golden):
    drive = golden[0]
    start = {"cylinder.position": "0 mm"}
    run = pn.simulate(drive.circuit, {"valve": "0 s: 1, 10 s: -1"}, "20 s", initial=start, sample_rate="2 kHz")
    drawn = abs(float(np.trapezoid(run["supply.mass_flow"], run["time"])))
    assert litres_anr(drawn) == pytest.approx(3.566, rel=2e-3)  # soft end stops 0.04 %, samples 0.1 %


def test_a_piston_that_does_not_follow_its_command_has_no_numbers_of_a_stroke():
    t = np.linspace(0.0, 1.0, 1001)
    rests = {"time_s": t, "position_m": 0.5 + 1e-5 * t}  # pressed into the end that it should leave
    found = stroke_numbers(rests, 0.5, 2.0, direction=-1)
    assert found.direction == -1
    assert all(math.isnan(value) for name, value in found.to_dict().items() if name != "top_speed")
    assert [row.key for row in stroke_numbers(rests, 0.5).view().rows] == ["top_speed"]  # a recording tells no command


def test_a_drive_that_cannot_lift_its_load_says_so():
    drive = pn.Drive.load("catalogue:reference").replace({"cylinder.incline": "90 deg", "load.mass": "60 kg"})
    step = pn.drive_characteristic(drive, "step-response")
    assert math.isnan(step.stroke_time)
    assert math.isnan(step.end_energy)
    square = pn.drive_characteristic(drive, "square-response")
    assert np.isnan(square.stroke_time).all()
