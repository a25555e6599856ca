"""References and scores against numbers by hand, without a run: derivatives, time in another unit, known errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.control.motion import NAMES, named_or_read
from pneudrive.control.scores import SCORED, score_of

FAST = (50.0, 50.0)
TIME = np.arange(0.0, 2.0 + 5e-4, 1e-3)


def standard_references(stroke_m, speeds_m_s):
    return {name: named_or_read(name, stroke_m, speeds_m_s) for name in NAMES}


def places(of, times):
    return of.at(np.array(times))[:, 0]


def test_standard_references_are_those_of_their_description():
    """Of a stroke of 0.5 m: about 250 mm, from 230 mm by 60 mm, then to 400 and 100 mm."""
    made = standard_references(0.5, FAST)
    assert places(made["R1"], [20.0, 20.5, 21.0, 21.5]) == pytest.approx([0.25, 0.31, 0.25, 0.19], abs=1e-9)
    assert places(made["R2"], [20.0, 20.25, 20.5]) == pytest.approx([0.25, 0.31, 0.25], abs=1e-9)
    stairs = [1.0, 1.15, 1.3, 3.0, 3.3, 5.0, 5.5, 7.0, 7.6, 9.6]
    assert places(made["R3"], stairs) == pytest.approx([0.23, 0.26, 0.29, 0.29, 0.23, 0.23, 0.4, 0.4, 0.1, 0.1])
    assert places(made["R5"], [1.0, 1.15, 1.3, 41.0]) == pytest.approx([0.23, 0.26, 0.29, 0.29])
    assert places(made["R6"], [1.0, 1.125, 1.25]) == pytest.approx([0.1, 0.25, 0.4])
    assert [made[name].duration_s for name in ("R3", "R5", "R6")] == pytest.approx([9.6, 41.3, 3.25])
    ramps, time = made["R4"], np.arange(0.0, made["R4"].duration_s, 1e-3)
    x, v = ramps.at(time).T[:2]
    assert (x[0], x[-1]) == pytest.approx((0.25, 0.25))
    for speed, way, after in ((0.001, 0.005, 3.5), (0.01, 0.03, 15.0), (0.1, 0.1, 22.5)):
        steady = np.isclose(np.abs(v), speed, rtol=1e-6)
        assert steady.sum() * 1e-3 == pytest.approx(2.0 * (way / speed - 0.1), rel=0.01)
        assert np.ptp(x[steady]) == pytest.approx(way - 0.1 * speed, rel=0.01)
        assert time[steady].min() < after + 1.0
    short = standard_references(0.1, FAST)
    assert places(short["R2"], [20.25]) == pytest.approx([0.05 + 0.03])
    slow = standard_references(0.5, (0.1, 0.1))
    assert max(one.reach((0.1, 0.1)).share for one in slow.values()) == pytest.approx(0.85, rel=2e-3)


@pytest.mark.parametrize("name", ["R1", "R3", "R4", "R6"])
def test_a_reference_and_its_derivatives_in_twice_the_time(name):
    own = standard_references(0.5, FAST)[name]
    time = np.arange(0.0, min(own.duration_s, 20.0), 2e-4)
    rows, slow = own.at(time), own.stretched(2.0).at(2.0 * time)
    size = np.abs(rows).max(axis=0)
    assert np.abs(slow * [1.0, 2.0, 4.0, 8.0] - rows).max(axis=0) == pytest.approx(np.zeros(4), abs=2e-3 * size.max())
    slopes = np.gradient(rows, 2e-4, axis=0)[1:-1, :3]
    assert np.abs(slopes - rows[1:-1, 1:]).max(axis=0) / size[1:] == pytest.approx(np.zeros(3), abs=5e-3)


PATHS = {
    "sine": "sine 4 deg 0.5 Hz",
    "circle": "circle 4 deg 0.5 Hz",
    "square": "square 4 deg 0.5 Hz in 0.3 s",
    "moves": "0 deg; 0.5 s: 4 deg in 0.4 s; 1.5 s: -4 deg in 0.2 s; 2.2 s: 0 deg in 0.3 s; every 3 s",
}


@pytest.mark.parametrize("kind", PATHS)
def test_a_path_of_a_pose_has_the_derivatives_of_its_places(kind):
    tilts = dict.fromkeys(("tilt_1", "tilt_2"), PATHS[kind])
    path = pn.control.pose_path({"heave": "450 mm"} | tilts, pn.platform(pn.Circuit.load(TRIPOD)))
    time, size = np.arange(0.0, 8.0, 1e-4), math.radians(4.0)
    late = time > 2.0  # after one period a sine has its full size
    for number, (x, v, a) in enumerate(path.at(time).transpose(2, 0, 1)[1:]):
        for slopes, rates in ((np.gradient(x, time), v), (np.gradient(v, time), a)):
            assert np.abs(slopes - rates)[1:-1].max() < 5e-3 * np.abs(rates).max()
        assert (x[late].min(), x[late].max()) == pytest.approx((-size, size), abs=1e-6)
        if kind in ("sine", "circle"):
            ahead = 0.5 * math.pi if kind == "circle" and number == 0 else 0.0
            assert x[late] == pytest.approx(size * np.sin(math.pi * time[late] + ahead), abs=1e-9)


TRIPOD = "examples/controlled_tripod.toml"


def scored(error, motion, **columns):
    """Score a run of a known error along no motion: the position is minus the error."""
    named = dict.fromkeys(SCORED, 0.0 * TIME) | {"position": -error} | columns
    return score_of(TIME, named, motion, {"anr_m3": 4e-3, "exergy_j": 10.0})


def test_measures_of_an_error_that_decays_after_its_move():
    """1 mm times exp(-t/0.1 s) from the end of a move at 0.4 s on; a command of full size for half of the time."""
    error = np.where(TIME >= 0.4, 1e-3 * np.exp(-(TIME - 0.4) / 0.1), 0.0)
    motion = {"kind": "moves", "start_m": 0.0, "moves": [[0.1, 0.3, 0.0]]}
    command = np.where(TIME % 0.2 < 0.1 - 1e-9, 1.0, 0.5)
    pressures = {"pressure_a": 2e5 * TIME, "pressure_b": -3e5 * TIME}
    steps = {"step_time": np.where(TIME == 1.0, 5e-4, 1e-4), "least_step_time": 0.0 * TIME + 9e-5}
    found = scored(error, motion, command=command, **pressures, **steps)
    assert (found.rmse_m, found.max_error_m) == pytest.approx((1e-3 * math.sqrt(0.05 / 2.0), 1e-3), rel=0.01)
    assert found.first_rmse_m == found.rmse_m
    settled = [found.settling_100_um_s, found.settling_500_um_s, found.settling_1000_um_s]
    assert settled == pytest.approx([0.1 * math.log(10.0), 0.1 * math.log(2.0), 0.0], abs=1.1e-3)
    assert (found.iae_m_s, found.itae_m_s2) == pytest.approx((1e-4, 1e-4 * (0.4 + 0.1)), rel=0.01)
    assert found.rest_error_m == pytest.approx(1e-3 * 0.1 / 0.2 * math.exp(-14.0) * (1.0 - math.exp(-2.0)), rel=0.5)
    assert found.valve_travel_per_s == pytest.approx(20 * 0.5 / 2.0, rel=0.06)
    assert found.saturated_share == pytest.approx(0.5, abs=0.02)
    assert found.peak_pressure_rate_pa_s == pytest.approx(3e5)
    assert (found.air_anr_m3_s, found.exergy_w) == pytest.approx((2e-3, 5.0))
    assert (found.step_median_s, found.step_worst_s, found.step_undisturbed_s) == pytest.approx((1e-4, 5e-4, 9e-5))
    assert (found.lost, found.slips, found.overshoot_m) == (False, 0, 0.0)


def test_slips_hunting_and_overshoot_are_those_of_the_dwell():
    """A swing by 2 mm peak to peak at 5 Hz for the last 0.6 s; 3 mm beyond the end before."""
    late = TIME > 1.4 - 1e-9
    swing = np.where(late, 1e-3 * np.sin(10.0 * math.pi * (TIME - 1.4)), np.where(TIME > 0.4, 3e-3, 0.0))
    speed = np.where(late, 1e-2 * math.pi * np.cos(10.0 * math.pi * (TIME - 1.4)), 0.0)
    found = scored(-swing, {"kind": "moves", "start_m": -0.1, "moves": [[0.1, 0.3, 0.0]]}, velocity=speed)
    assert found.hunting_m == pytest.approx(2e-3, rel=1e-3)
    assert found.slips == 7
    assert found.overshoot_m == pytest.approx(3e-3)
    back = scored(swing, {"kind": "moves", "start_m": 0.1, "moves": [[0.1, 0.3, 0.0]]}, velocity=-speed)
    assert back == found  # the mirrored run
    assert scored(0.0 * TIME + 0.021, {"kind": "sine", "frequency_hz": 0.1}).lost
