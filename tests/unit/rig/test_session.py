"""A simulated rig in use: noise belongs to the cycle, the past is all in its memory, and it always comes to rest."""

from __future__ import annotations

import json
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from oracle.rig_faults import with_friction, with_tables
from oracle.rig_truth import telling
from pneudrive.errors import RigError
from pneudrive.rig import (
    Changeable,
    Hold,
    Move,
    Reproducible,
    Rig,
    Samples,
    Sampling,
    SimulatedRig,
    load_rig,
    shipped_rigs,
)
from pneudrive.rig.description import KEYS
from pneudrive.rig.motion import step_times

SPARSE = Sampling(samples_per_stroke=200, burst_rate_hz=0.0)
NAMES = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa", "temperature_k", "step")


def cycle(rig, key, steps, sampling=SPARSE):
    rig.begin_cycle(key)
    return Samples.join(list(rig.acquire(steps, sampling)))


def same(one, two):
    return all(np.array_equal(getattr(one, name), getattr(two, name)) for name in NAMES)


def out_and_back(speed, low=0.02, high=0.28):
    return [Move(high, speed), Move(low, speed)]


@pytest.mark.parametrize("name", shipped_rigs())
def test_every_shipped_rig_is_a_rig(name):
    rig = load_rig(name, seed=3)
    assert isinstance(rig, Rig)
    assert isinstance(rig, Reproducible)
    assert isinstance(rig, Changeable)
    high = rig.limits().pressure_pa[1]
    rig.home()
    rig.set_pressure(min(high, 2e5), min(high, 2e5))
    samples = cycle(rig, "1", [*out_and_back(0.1), Hold(1.0)])
    assert np.all(np.diff(samples.time_s) > 0.0)
    assert samples.step.tolist() == sorted(samples.step.tolist())
    assert rig.identity().synthetic
    assert all(source.reason for source in SimulatedRig.load(shipped_rigs()[name]).description.sources.values())
    json.dumps([rig.identity().to_dict(), rig.memory()])


def test_noise_is_that_of_the_cycle_whatever_was_before():
    steps = [Hold(5.0)]
    fresh = cycle(load_rig(seed=5), "a", steps)
    rig = load_rig(seed=5)
    rig.move(0.2, 0.1)
    cycle(rig, "z", out_and_back(0.1))
    rig.home()
    rig.state()
    used = cycle(rig, "a", steps)
    np.testing.assert_array_equal(used.pressure_a_pa, fresh.pressure_a_pa)  # nothing moved here but the noise
    assert not np.array_equal(used.pressure_b_pa - used.pressure_a_pa, np.zeros(len(used)))
    rig.state()
    assert not np.array_equal(cycle(rig, "b", steps).pressure_a_pa, fresh.pressure_a_pa)
    assert not np.array_equal(cycle(load_rig(seed=6), "a", steps).pressure_a_pa, fresh.pressure_a_pa)


@pytest.mark.parametrize("name", ["common-manifold", "soft"])
def test_restored_in_the_middle_it_goes_on_to_the_bit(name):
    plan = [
        ("1", (1.5e5, 1.5e5), out_and_back(0.2)),
        ("2", (1.2e5, 1.2e5), [Move(0.15, 0.05), Hold(3.0), Move(0.28, 0.05), Hold(1.0, released=True)]),
        ("3", (2e5, 2e5), out_and_back(0.05)),
        ("4", (2e5, 2e5), [Hold(5.0, shut=True), *out_and_back(0.3)]),
    ]

    def run(rig, cycles):
        out = []
        for key, pressures, steps in cycles:
            rig.set_pressure(*pressures)
            rig.move(0.02, 0.1)
            out.append(cycle(rig, key, steps))
        return out

    undisturbed = load_rig(name, seed=1)
    undisturbed.change({"mounting": "rigid", "seal": "A"})
    run(undisturbed, plan[:2])
    kept = json.loads(json.dumps(undisturbed.memory()))
    rest = run(undisturbed, plan[2:])
    resumed = load_rig(name, seed=1)
    resumed.restore(kept)
    assert all(same(one, two) for one, two in zip(rest, run(resumed, plan[2:]), strict=True))
    assert resumed.memory() == undisturbed.memory()
    with pytest.raises(RigError, match="not the saved state"):
        resumed.restore({"clock_s": 1.0})


def test_bursts_resolve_every_restart_and_reversal():
    steps = [Move(0.1, 0.002), Hold(15.0), Move(0.2, 0.002), Move(0.1, 0.002)]
    samples = cycle(load_rig(), "1", steps, None)  # that of the rig file
    step = np.flatnonzero(np.diff(samples.step)) + 1
    assert samples.step[step].tolist() == [1, 2, 3]
    for first in step:
        begins = samples.time_s[first]
        near = (samples.time_s > begins - 0.0499) & (samples.time_s < begins + 0.1999)
        assert np.diff(samples.time_s[near]).max() <= 1.0001 / 5000.0
    # As many as the plan counts on, at the same times.
    edges = [samples.time_s[0], *samples.time_s[step], samples.time_s[-1]]
    parts = zip(edges[:-1], np.diff(edges).tolist(), [True, False, True, True], strict=True)
    times = [begin + step_times(duration_s, moving, Sampling()) for begin, duration_s, moving in parts]
    np.testing.assert_allclose(samples.time_s, [*np.concatenate(times), edges[-1]], atol=1e-9)
    slow = np.diff(samples.time_s[(samples.step == 0)])
    assert np.median(slow) == pytest.approx((0.1 - 0.005) / 0.002 / 5000.0, rel=0.01)


def test_closed_early_it_brakes_within_its_limits_and_goes_on():
    for parts in (1, 3):
        rig = load_rig(seed=2)
        d = rig.rig.description
        running = rig.acquire([Move(0.29, 0.4)], Sampling(20000, 0.0))
        got = Samples.join([next(running) for _ in range(parts)])
        assert rig.state().moving
        with pytest.raises(RigError, match="busy"):
            rig.home()
        running.close()
        after = rig.state()
        assert not after.moving
        braking = after.position_m - got.position_m[-1]
        speed = (got.position_m[-1] - got.position_m[-200]) / (got.time_s[-1] - got.time_s[-200])
        a, j = d.limits.acceleration_m_s2, d.limits.jerk_m_s3
        fastest = speed + 0.5 * a * a / j + 0.02  # while the acceleration that it had is taken away
        assert 0.0 <= braking <= fastest * (0.5 * fastest / a + 2.0 * a / j)
        assert got.time_s[-1] < after.time_s < got.time_s[-1] + fastest / a + 3.0 * a / j
        samples = cycle(rig, "2", [Hold(0.5)])
        assert np.ptp(samples.position_m) == 0.0
        rig.home()
        assert rig.state().position_m == pytest.approx(0.005, abs=2e-6)


def test_stopped_from_outside_it_stands_at_once_without_pressure():
    rig = load_rig("common-manifold", seed=2, pace=1.0)
    rig.pace = None
    rig.set_pressure(2e5, 2e5)
    rig.pace = 1.0
    threading.Timer(0.3, rig.stop).start()
    began = time.monotonic()
    with pytest.raises(RigError, match="stopped"):
        for _ in rig.acquire([Move(0.29, 0.02)], SPARSE):
            pass
    assert time.monotonic() - began < 5.0  # the move takes 14 s
    state = rig.state()
    assert not state.moving
    assert state.position_m < 0.1
    assert state.pressure_a_pa == pytest.approx(101300.0, abs=2000.0)
    rig.stop()
    assert rig.state() == replace(state, time_s=rig.state().time_s)


def test_what_it_cannot_do_is_refused_before_anything_moves():
    rig = load_rig("common-manifold")
    with pytest.raises(RigError, match="out of reach"):
        rig.acquire([Move(0.1, 0.1), Move(0.4, 0.1)], SPARSE)
    with pytest.raises(RigError, match="out of reach"):
        rig.move(0.1, 2.0)
    with pytest.raises(RigError, match="one regulator sets"):
        rig.set_pressure(2e5, 1.5e5)
    with pytest.raises(RigError, match="cannot be brought"):
        rig.set_pressure(9e5, 9e5)
    with pytest.raises(RigError, match="cannot be brought"):
        load_rig("open-chambers").set_pressure(2e5, 2e5)
    with pytest.raises(RigError, match=r"(?s)'rigd' is not known.*Did you mean 'rigid'"):
        rig.change({"mounting": "rigd"})
    with pytest.raises(RigError, match=r"(?s)'common-manifol' is not a rig.*Did you mean 'common-manifold'"):
        load_rig("common-manifol")
    assert rig.past.clock_s == 0.0
    separate = load_rig("separate-regulators")
    separate.set_pressure(3e5, 1.5e5)
    with pytest.raises(RigError, match="move a released axis away"):
        separate.hold(1.0, released=True)


def test_released_the_sensor_shows_its_zero_and_the_axis_has_given_way():
    rig = load_rig("soft", seed=4)
    rig.move(0.2, 0.05)
    before = rig.past.commanded_m
    held = cycle(rig, "held", [Hold(3.0)])
    freed = cycle(rig, "freed", [Hold(3.0, released=True)])
    zero = rig.rig.description.force_sensor.zero
    assert held.force_n[-20:].mean() > zero + 5.0
    assert freed.force_n[-20:].mean() == pytest.approx(zero, abs=0.1)
    # Both springs, that of the sensor and that of the bristles, let go.
    assert before - rig.past.commanded_m == pytest.approx(held.force_n[-20:].mean() / 2e4, rel=0.3)
    on = cycle(rig, "on", [Hold(1.0)])
    assert on.force_n.mean() == pytest.approx(zero, abs=0.05)
    weight = cycle(rig, "weight", [Hold(2.0, weight_n=20.0)])
    assert weight.force_n.mean() == pytest.approx(zero - 20.0, abs=0.05)


def test_the_air_of_open_chambers_is_in_the_force_and_in_the_pressures():
    d = SimulatedRig.load(shipped_rigs()["open-chambers"]).description
    rig = SimulatedRig(with_tables(d, chambers={"line_conductance": 0.8e-8})).session(seed=4)
    telling(rig)
    rig.move(0.02, 0.1)
    samples = cycle(rig, "1", out_and_back(0.45), Sampling())
    air, left = [], []
    for i, direction in ((0, 1.0), (1, -1.0)):
        middle = (samples.step == i) & (np.abs(samples.position_m - 0.15) < 0.05)
        air.append(d.areas_m2[0] * (samples.pressure_a_pa[middle] - samples.pressure_b_pa[middle]).mean())
        left.append(samples.force_n[middle].mean() + air[i])
        told = rig.truth()["steps"][i]
        assert told["direction"] == direction
        assert direction * told["air_force_n"] < -2.0
    # Half the difference of the directions is free of the zeros of all sensors.
    there, back = rig.truth()["steps"]
    half = 0.5 * (there["air_force_n"] - back["air_force_n"])
    assert 0.5 * (air[0] - air[1]) == pytest.approx(half, rel=0.03)
    friction = 0.5 * (there["friction_mean_n"] + back["friction_mean_n"])
    assert 0.5 * (left[0] - left[1]) == pytest.approx(friction, abs=0.1)
    assert friction < 0.95 * 0.5 * (samples.force_n[samples.step == 0].max() - samples.force_n[samples.step == 1].min())


def test_the_leak_check_finds_the_leak_and_nothing_else():
    def fall(rig):
        rig.set_pressure(3e5, 3e5)
        held, shut = cycle(rig, "held", [Hold(60.0)]), cycle(rig, "shut", [Hold(60.0, shut=True)])
        return [part.pressure_a_pa[:50].mean() - part.pressure_a_pa[-50:].mean() for part in (held, shut)]

    description = SimulatedRig.load(shipped_rigs()["common-manifold"]).description
    tight = with_tables(description, chambers={"leakage": 0.0, "piston_leakage": 0.0})
    held, shut = fall(load_rig("common-manifold"))
    assert abs(held) < 100.0
    assert shut > 2000.0
    assert np.max(np.abs(fall(SimulatedRig(tight).session()))) < 100.0


def test_slow_changes_follow_from_what_was_done():
    d = SimulatedRig.load(shipped_rigs()["open-chambers"]).description
    calm = dict.fromkeys(KEYS["repeatability"], 0.0)
    rig = telling(SimulatedRig(with_tables(d, repeatability=calm)).session(seed=1))

    def point(key):
        rig.move(0.02, 0.3)
        cycle(rig, key, out_and_back(0.4))
        return rig.truth()["steps"][0]["friction"]["parameters"]

    first = point("first")
    assert first["coulomb"] == pytest.approx(9.0 * 1.04, rel=2e-3)  # the excess of a new seal
    for _ in range(150):
        rig.move(0.28, 0.4)
        rig.move(0.02, 0.4)
    worn = point("worn")
    truth = rig.truth()
    assert truth["travel_m"] > 75.0
    rise = truth["seal_temperature_k"] - truth["room_temperature_k"]
    assert 1.0 < rise < 10.0
    # Run in and warm, as on a drive: what is left of the excess, and what the temperature makes of it.
    left = 1.0 + 0.04 * np.exp(-truth["travel_m"] / 60.0)
    warmer = truth["seal_temperature_k"] - 293.15
    assert worn["coulomb"] == pytest.approx(9.0 * left * (1.0 - 0.003 * warmer), rel=1e-3)
    assert worn["viscous"] == pytest.approx(3.0 * np.exp(-0.03 * warmer), rel=5e-3)
    # A quarter of a day later the room is an amplitude warmer, the seal as warm as the room, the zero has drifted.
    rig.hold(21600.0 - rig.past.clock_s)
    assert rig.past.seal_rise_k < 1e-3
    assert rig.past.room_k(d) == pytest.approx(294.15, abs=0.01)
    assert rig.past.force_drift_n(d) == pytest.approx(0.02 * 1.0 + 0.01 * 6.0, rel=0.01)
    rig.change({"seal": "B"})
    assert rig.past.travel_m == 0.0


def test_levels_vary_between_cycles_days_and_mountings_as_the_file_says():
    d = SimulatedRig.load(shipped_rigs()["open-chambers"]).description
    quiet = with_tables(d, run_in={"excess": 0.0}, thermal={"seal_rise": 0.0, "coulomb": 0.0, "viscous": 0.0})

    def levels(change, count=300):
        rig = SimulatedRig(quiet).session(seed=9)
        out = []
        for i in range(count):
            change(rig, i)
            out.append(np.log(rig._machine.friction(rig.past)["parameters"]["coulomb"] / 9.0))
        return np.std(out)

    def day(rig, i):
        rig.past.clock_s = 86400.0 * i

    assert levels(lambda rig, i: rig.begin_cycle(str(i))) == pytest.approx(0.003, rel=0.15)
    assert levels(day) == pytest.approx(0.01, rel=0.15)
    assert levels(lambda rig, i: rig.change({"mounting": "rigid"})) == pytest.approx(0.015, rel=0.15)
    assert levels(lambda rig, i: rig.change({"seal": f"seal {i}"})) == pytest.approx(0.04, rel=0.15)
    assert levels(lambda rig, i: None) == 0.0


def test_calibration_errors_are_as_large_as_the_stated_accuracy():
    rig = SimulatedRig.default()
    rigs = [rig.session(seed) for seed in range(300)]
    d = rigs[0].rig.description
    sensors = [rig._instruments for rig in rigs]
    full, accuracy = d.force_sensor.high, d.tables.force_sensor.accuracy
    assert np.std([s.force.gain_error * full for s in sensors]) == pytest.approx(
        d.tables.force_sensor.accuracy, rel=0.15
    )
    shown = [s.pressure_a.zero + s.pressure_a.gain_error * d.ambient_pressure_pa for s in sensors]
    assert np.std(shown) == pytest.approx(d.tables.pressure_sensor.accuracy, rel=0.15)
    assert np.mean(shown) == pytest.approx(d.pressure_sensor.zero, abs=100.0)
    warm = np.std([s.thermometer.zero for s in sensors])
    assert warm == pytest.approx(d.tables.temperature_sensor.accuracy, rel=0.15)
    accuracy = rigs[0].identity().accuracy
    assert accuracy["force_n"] == d.tables.force_sensor.accuracy
    assert accuracy["temperature_k"] == d.tables.temperature_sensor.accuracy


def test_paced_it_keeps_the_time_of_the_wall_and_gives_the_same_samples():
    steps = [Move(0.1, 0.2), Hold(0.2)]
    fast = cycle(load_rig(seed=3), "1", steps)
    rig = load_rig(seed=3, pace=4.0)
    rig.begin_cycle("1")
    began, parts = time.monotonic(), []
    for part in rig.acquire(steps, SPARSE):
        state = rig.state()
        assert state.moving
        assert state.time_s == pytest.approx(part.time_s[-1])
        assert state.position_m == part.position_m[-1]
        parts.append(part)
    assert time.monotonic() - began == pytest.approx(fast.time_s[-1] / 4.0, abs=0.15)
    assert len(parts) > 2
    assert same(Samples.join(parts), fast)


def test_gauges_at_the_regulator_do_not_see_what_the_piston_does_to_the_air():
    seen = {}
    for name in ("common-manifold", "regulator-gauges"):
        rig = telling(load_rig(name, seed=4))
        rig.set_pressure(2e5, 2e5)
        rig.move(0.02, 0.1)
        samples = cycle(rig, "1", [Move(0.28, 0.45)])
        middle = np.abs(samples.position_m - 0.15) < 0.05
        seen[rig.identity().pressure_measured_at] = (samples.pressure_b_pa - samples.pressure_a_pa)[middle].mean()
        air = rig.truth()["steps"][0]["air_force_n"]
        assert air < -5.0
    assert seen["chamber"] > 1e4
    assert abs(seen["regulator"]) < 1.5e3


def test_who_stops_the_axis_ends_what_the_core_computes():
    """Stick-slip at 1 mm/s takes a million steps; the run is left in the middle, where the axis is told to stop."""
    rig = with_friction(SimulatedRig.default(), breakaway=60.0).session()
    reached = []

    class Stops:
        """Looks at the clock of the core, and stops the axis at its second look."""

        def __call__(self, run):
            reached.append(run)
            if len(reached) == 3:  # the first one asks before the core begins
                rig.stop()
            plain(run)

    plain, rig._alive = rig._alive, Stops()
    with pytest.raises(RigError, match="the axis was stopped"):
        rig.move(0.25, 1e-3)
    assert len(reached) == 3
    assert not rig.state().moving
    rig._alive = plain
    rig.move(0.05, 0.1)
    assert rig.state().position_m == pytest.approx(0.05, abs=1e-4)
