"""A plan is deterministic, complete and honest about time and size."""

import itertools
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from pneudrive.campaign.cycle import KINDS, Head, read_head
from pneudrive.campaign.planning.protocol import ready_protocols
from pneudrive.rig import Hold, Limits, Move
from pneudrive.rig.motion import move

DATA = Path(__file__).parents[2] / "data"
SWEEP = """
seed = 7
repeats = 3
[speed]
list = ["2 mm/s", "5 mm/s", "20 mm/s", "50 mm/s", "200 mm/s"]
[pressure]
both = ["0 bar gauge", "1 bar gauge"]
"""
FULL = SWEEP.replace("200 mm/s", "500 mm/s") + (DATA / "full_protocol.toml").read_text("utf-8")
SCRIPT = """
import hashlib, runpy, sys
plan = runpy.run_path(sys.argv[1])["lay"](sys.stdin.read())
print(hashlib.sha256("\\n".join(map(repr, plan.cycles)).encode()).hexdigest())
"""


@pytest.fixture
def limits():
    return Limits(5.0, 200.0)


def points(plan):
    return [cycle for cycle in plan.cycles if cycle.kind in ("sweep", "stop")]


def test_keys_are_unique_and_readable(planned):
    plan = planned(FULL)
    keys = [cycle.key for cycle in plan.cycles]
    assert len(set(keys)) == len(keys)
    assert "b1/sweep/v500/a1/b1/r3" in keys
    assert "b8/stop/t15/a0/b0/v1/held/x50pc/-x/r2" in keys
    assert {cycle.kind for cycle in plan.cycles} == set(KINDS)


def test_the_plan_is_the_same_in_every_process():
    out = {
        subprocess.run(
            [sys.executable, "-c", SCRIPT, str(Path(__file__).with_name("conftest.py"))],
            input=FULL,
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    }
    assert len(out) == 1


def test_a_cycle_survives_json(planned):
    for cycle in planned(FULL).cycles[:200]:
        assert read_head(Head(1, cycle).to_json(), "")[0].cycle == cycle


def test_each_repeat_of_a_randomised_block_is_complete_and_follows_the_seed(planned):
    text = SWEEP + '[order]\nkind = "randomised"\n'
    cycles = points(planned(text))
    halves = [[c.key.rpartition("/")[0] for c in cycles[i : i + 10]] for i in (0, 10, 20)]
    for repeat, half in enumerate(halves, start=1):
        assert len(set(half)) == 10  # every cell once before any comes again: drift meets all alike
        assert {c.repeat for c in cycles[10 * repeat - 10 : 10 * repeat]} == {repeat}
    assert halves[0] != halves[1] != halves[2]
    assert [c.key for c in points(planned(text))] == [c.key for c in cycles]
    other = points(planned(text.replace("seed = 7", "seed = 8")))
    assert [c.key for c in other] != [c.key for c in cycles]
    assert Counter(c.key for c in other) == Counter(c.key for c in cycles)


def test_randomised_order_spreads_every_speed_over_the_block(planned):
    """Mean place of each speed over many seeds: no speed is favoured."""
    mean = Counter()
    for seed in range(200):
        text = SWEEP.replace("seed = 7", f"seed = {seed}").replace("repeats = 3", "repeats = 1")
        for place, cycle in enumerate(points(planned(text + '[order]\nkind = "randomised"\n'))):
            mean[cycle.speed_m_s] += place / 400
    spread = np.sqrt((10**2 - 1) / 12 * (10 - 2) / (10 - 1) / 400)  # of a mean of 2 of 10 places, 200 times
    assert all(abs(place - 4.5) < 4.0 * spread for place in mean.values())


def test_interleaved_runs_neighbouring_levels_far_apart(planned):
    cycles = points(planned(SWEEP.replace("repeats = 3", "repeats = 1") + '[order]\nkind = "interleaved"\n'))
    assert [round(1e3 * c.speed_m_s) for c in cycles] == [2, 2, 50, 50, 5, 5, 200, 200, 20, 20]
    assert all(a.pressure_a_pa != b.pressure_a_pa for a, b in itertools.pairwise(cycles))


@pytest.mark.parametrize(
    ("order", "speeds"),
    [
        ("ascending", [2, 5, 20, 50, 200]),
        ("descending", [200, 50, 20, 5, 2]),
        ("up-and-down", [2, 5, 20, 50, 200, 200, 50, 20, 5, 2]),
    ],
)
def test_as_given_changes_the_pressure_least(order, speeds, planned):
    text = SWEEP.replace("[pressure]", f'order = "{order}"\n[pressure]')
    cycles = points(planned(text))
    assert [round(1e3 * c.speed_m_s) for c in cycles] == speeds * 6
    assert sum(a.pressure_a_pa != b.pressure_a_pa for a, b in itertools.pairwise(cycles)) == 1


def test_times_are_those_of_the_motion(planned, limits):
    plan = planned(FULL)
    for one in plan.planned:
        at, total = one.cycle.start_m, 0.0
        for step in one.cycle.steps:
            if isinstance(step, Hold):
                total += step.duration_s
            else:
                total += move(step.to_m - at, step.speed_m_s, limits).duration_s
                at = step.to_m
        assert one.axis_s == pytest.approx(total, rel=1e-12)
        assert at == one.cycle.start_m  # so that the next cycle begins there
    pressures = [(1e5, 1e5)] + [(c.pressure_a_pa, c.pressure_b_pa) for c in plan.cycles]
    changes = sum(a != b for a, b in itertools.pairwise(pressures))
    by_hand = Counter(c.key.split("/")[-1] for c in plan.cycles if c.kind == "operator")
    hands = (
        600.0 * by_hand["mounting"] + 1200.0 * by_hand["seal"] + 120.0 * (by_hand["weight-on"] + by_hand["weight-off"])
    )
    assert plan.time_s == pytest.approx(sum(one.axis_s for one in plan.planned) + 7.0 * changes + hands)
    assert plan.remaining_s({c.key for c in plan.cycles[:-1]}) == pytest.approx(plan.planned[-1].time_s)


def test_constant_speed_lasts_as_long_as_asked_for(planned, limits):
    plan = planned('[speed]\nlist = ["5 mm/s", "500 mm/s"]\nsettled_time = "2 s"\n')
    slow, fast = points(plan)
    assert len(slow.steps) == 2
    cruise = 0.288 / 0.5 - limits.ramp_time_s(0.5)
    assert len(fast.steps) / 2 * cruise >= 2.0 > (len(fast.steps) / 2 - 1) * cruise


def test_a_stop_interrupts_the_way_of_its_reference_in_either_direction(planned):
    text = '[stop]\ndurations = "15 s"\naxis = "released"\napproach = "20 mm"\nrecovery = "40 mm"\n'
    forth, back = points(planned(text))
    for cycle, sign in ((forth, 1.0), (back, -1.0)):
        ends = [step.to_m if isinstance(step, Move) else step for step in cycle.steps]
        hold = ends.index(Hold(15.0, released=True))
        begin, stop, end = ends[hold - 2], ends[hold - 1], ends[hold + 1]
        assert stop == pytest.approx(0.15)
        assert sign * (stop - begin) == pytest.approx(0.02)
        assert sign * (end - stop) == pytest.approx(0.04)
        reference = ends.index(end)
        assert reference < hold
        assert ends[reference - 1] == begin
        assert cycle.steps[reference].speed_m_s == cycle.steps[hold + 1].speed_m_s == cycle.speed_m_s
        assert sum(isinstance(step, Hold) for step in cycle.steps) == 1


def test_a_block_prepares_what_its_set_up_needs(planned):
    plan = planned(FULL)
    blocks = {b: [c for c in plan.cycles if c.block == b] for b in {c.block for c in plan.cycles}}
    assert len(blocks) == 2 * 2 * 2
    before = {}
    for number, cycles in sorted(blocks.items()):
        levels = cycles[0].levels
        asked = {c.key.split("/")[-1] for c in cycles if c.kind == "operator"} - {"weight-on", "weight-off"}
        assert asked == {name for name in levels if before.get(name) != levels[name]}
        assert (f"b{number}/run-in" in [c.key for c in cycles]) == (before.get("seal") != levels["seal"])
        order = [c.kind for c in cycles if c.kind not in ("sweep", "stop", "operator")]
        assert order[-3:] == ["sentinel", "sentinel", "blank"]
        assert [k for k in order if k not in ("warm-up", "sentinel")] == ["tare", "weight", "leak", "blank", "blank"]
        before = levels


def test_a_sentinel_stands_at_both_ends_and_every_n_points(planned):
    plan = planned(SWEEP + '[sentinel]\nspeed = "50 mm/s"\nevery = 7\n')
    kinds = [c.kind for c in plan.cycles]
    places = [i for i, kind in enumerate(kinds) if kind == "sentinel"]
    assert places == [0, 8, 16, 24, 32, len(kinds) - 1]


def test_ready_protocols_ship():
    assert set(ready_protocols()) >= {
        *("quick-look", "paper-speed", "paper-pressure", "paper-stops", "stops-pressure"),
        *("asymmetric-pressures", "mountings", "stops-pressure-mounting"),
    }
