"""What is wrong with samples as they arrive is named and counted, to the sample; what is right is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneudrive.campaign.planning.plan import lay_out
from pneudrive.campaign.planning.protocol import read_protocol
from pneudrive.campaign.running.attempt import arrival_flags
from pneudrive.rig import load_rig
from pneudrive.rig.interface import Samples


def acquired(rig, cycle):
    rig.begin_cycle(cycle.key)
    rig.set_pressure(cycle.pressure_a_pa, cycle.pressure_b_pa)
    return Samples.join(list(rig.acquire(cycle.steps, cycle.sampling)))


@pytest.fixture(scope="module")
def bench():
    """Give a simulated rig, one sweep and its samples; bursts, ramps and coarse intervals are all in it."""
    rig = load_rig("default", seed=1)
    protocol = read_protocol("quick-look")
    plan = lay_out(protocol, rig.identity(), rig.limits())
    rig.home()
    rig.move(plan.cycles[0].start_m, 0.05)
    cycle = next(c for c in plan.cycles if c.kind == "sweep")
    return rig.identity(), cycle, acquired(rig, cycle)


@pytest.mark.parametrize("rig_name", ["default", "separate-regulators", "soft"])
def test_nothing_is_flagged_where_nothing_is_wrong(rig_name):
    rig = load_rig(rig_name, seed=2)
    plan = lay_out(read_protocol("quick-look"), rig.identity(), rig.limits())
    rig.home()
    rig.move(plan.cycles[0].start_m, 0.05)
    for cycle in plan.cycles[::3]:
        assert arrival_flags(acquired(rig, cycle), cycle, rig.identity()) == {}, cycle.key


def changed(samples, **columns):
    return replace(samples, **columns)


def set_part(samples, name, part, value):
    values = getattr(samples, name).copy()
    values[part] = value
    return changed(samples, **{name: values})


def taken(samples, index):
    return Samples(**{name: values[index] for name, values in vars(samples).items()})


def without(samples, part):
    keep = np.ones(len(samples), dtype=bool)
    keep[part] = False
    return taken(samples, keep)


def twice(samples, begin, end):
    return taken(samples, np.r_[0:end, begin : len(samples)])


def clock_back(samples, at, seconds):
    time = samples.time_s.copy()
    time[at:] -= seconds
    return changed(samples, time_s=time)


CASES = {
    "not a number": (lambda s: set_part(s, "force_n", slice(40, 50), np.nan), {"non_finite": 10}),
    "infinite": (lambda s: set_part(s, "pressure_a_pa", slice(7, 8), np.inf), {"non_finite": 1}),
    "lost samples": (lambda s: without(s, slice(2000, 2020)), {"dropped": 20}),
    "one lost sample": (lambda s: without(s, slice(3000, 3001)), {"dropped": 1}),
    "lost in a burst": (lambda s: without(s, slice(300, 310)), {"dropped": 10}),
    "a packet twice": (lambda s: twice(s, 2000, 2050), {"duplicated": 50}),
    "the clock jumps back": (lambda s: clock_back(s, 2500, 1.0), {"time_runs_back": 1}),
    "force stuck": (lambda s: set_part(s, "force_n", slice(2000, 2300), 3.25), {"stuck": 300}),
    "position stuck": (lambda s: set_part(s, "position_m", slice(2000, 2400), s.position_m[2000]), {"stuck": 400}),
    "pressure stuck": (lambda s: set_part(s, "pressure_b_pa", slice(900, 1900), s.pressure_b_pa[900]), {"stuck": 1000}),
    "force saturated": (lambda s: set_part(s, "force_n", slice(200, 230), 200.0), {"saturated": 30}),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_wrong_is_counted(bench, name):
    identity, cycle, samples = bench
    spoil, flags = CASES[name]
    assert arrival_flags(spoil(samples), cycle, identity) == flags


def test_a_sensor_that_never_moves_is_stuck_all_along(bench):
    identity, cycle, samples = bench
    flags = arrival_flags(set_part(samples, "force_n", slice(None), 1.0), cycle, identity)
    assert flags == {"stuck": len(samples)}


def test_a_cycle_that_ends_early_lacks_steps_and_samples(bench):
    identity, cycle, samples = bench
    flags = arrival_flags(taken(samples, slice(0, 300)), cycle, identity)
    assert flags["steps_missing"] == len(cycle.steps) - 1
    assert flags["target_missed"] == 1
    assert flags["too_few_samples"] > 0
    assert arrival_flags(taken(samples, slice(0, 0)), cycle, identity)["steps_missing"] == len(cycle.steps)


def test_a_clock_that_runs_back_most_of_the_time_is_flagged(bench):
    """Buffers that come with their newest sample first: between two samples the usual interval is none."""
    identity, cycle, samples = bench
    order = np.arange(len(samples))
    blocks = np.concatenate([part[::-1] for part in np.array_split(order, len(samples) // 100)])
    flags = arrival_flags(changed(samples, time_s=samples.time_s[blocks]), cycle, identity)
    assert flags["time_runs_back"] > 0.9 * len(samples)
