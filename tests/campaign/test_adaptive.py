"""What is measured next: bad cycles again, known points no more, speeds where they tell most about the curve."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.fake_rig import QUICK, FakeRig, protocol, stribeck_n
from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.planning.adaptive import Finished, QuickPoint, choose_speed, next_cycle
from pneudrive.campaign.planning.plan import lay_out
from pneudrive.campaign.run import resume_campaign, run_campaign
from pneudrive.campaign.status import status_of
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.identify.static.model import FrictionModel, Observations
from pneudrive.rig.interface import Sampling

#: D-optimal support of the Stribeck curve (exponent 2, vs = 12 mm/s) over 1 to 450 mm/s: the ends, vs, 2.8 vs.
SUPPORT_M_S = (0.001, 0.012, 0.0335, 0.45)


def sweep(speed_m_s, friction_n, stderr_n=0.1):
    cycle = Cycle(f"b1/sweep/v{speed_m_s}/r1", "sweep", (), Sampling(), 1e5, 1e5, speed_m_s=speed_m_s)
    return Finished(cycle, {}, QuickPoint(friction_n, stderr_n, 5.0))


def measured(speeds):
    return [sweep(v, float(stribeck_n(np.array(v)))) for v in speeds]


def information(speeds):
    """Log of the determinant of the information on Fc, Fs, vs, Fv at the truth."""
    model, v = FrictionModel("stribeck"), np.asarray(speeds, dtype=float)
    ones, zero = np.ones(v.size), np.zeros(v.size)
    data = Observations(v, ones, ones, zero, zero, zero, np.arange(v.size))
    jacobian = model.value_and_jacobian(model.internal(np.array([30.0, 40.0, 0.012, 60.0])), data)[1]
    return np.linalg.slogdet(jacobian.T @ jacobian)[1]


def test_added_speeds_go_to_the_d_optimal_support():
    speeds = list(np.geomspace(1e-3, 0.45, 8))
    for _ in range(12):
        chosen, why = choose_speed(measured(speeds))
        assert "D-optimal" in why
        assert min(max(chosen, v) / min(chosen, v) for v in speeds) > 1.04
        speeds.append(chosen)
    added = np.array(speeds[8:])
    nearest = np.min(np.abs(np.log(added[:, None] / np.array(SUPPORT_M_S))), axis=1)
    assert np.all(nearest < np.log(1.7))
    assert {int(np.argmin(np.abs(np.log(v / np.array(SUPPORT_M_S))))) for v in added} == {0, 1, 2, 3}
    even = list(np.geomspace(1e-3, 0.45, 20))
    assert information(speeds) > information(even) + np.log(1.3)


def test_where_no_curve_can_be_fitted_the_bend_is_halved():
    """A kink between 10 and 30 mm/s in five points: the first speed falls beside it."""
    points = [sweep(v, f) for v, f in [(0.001, 10.0), (0.003, 10.0), (0.01, 10.0), (0.03, 20.0), (0.1, 30.0)]]
    chosen, why = choose_speed(points)
    assert "bends most" in why
    assert chosen == pytest.approx((0.003 * 0.01) ** 0.5, rel=1e-3) or chosen == pytest.approx(
        (0.01 * 0.03) ** 0.5, rel=1e-3
    )
    assert choose_speed(points[:2]) is None


def plan(more, repeats=1):
    rig = FakeRig()
    return lay_out(protocol(more, repeats), rig.identity(), rig.limits())


def played(plan, point, flags=None):
    """Run a plan on paper: cycle -> what it says."""
    finished = []
    while (following := next_cycle(plan, finished)) is not None:
        cycle = following[0]
        assert len(finished) < 1000
        finished.append(Finished(cycle, dict((flags or {}).get(cycle.key, {})), point(cycle)))
    return finished


def test_without_rules_the_plan_is_run_as_it_is():
    asked = plan("", 2)
    assert [one.cycle for one in played(asked, lambda cycle: QuickPoint())] == list(asked.cycles)


def test_bad_cycles_are_repeated_but_not_for_ever():
    asked = plan('[adaptive]\nnoise = "1 N"\nsettled_time = "2 s"\nrepeats = 2\n')
    bad = {"b1/sweep/v2/a0/b0/r1": QuickPoint(30.0, 5.0, 9.0), "b1/sweep/v50/a0/b0/r1": QuickPoint(30.0, 0.1, 1.0)}
    good = QuickPoint(30.0, 0.1, 9.0)
    flags = {"b1/sweep/v200/a0/b0/r1": {"stuck": 40}, "b1/sweep/v10/a0/b0/r1": {"dropped": 1}}
    keys = [one.cycle.key for one in played(asked, lambda cycle: bad.get(cycle.key, good), flags)]
    extra = [key for key in keys if key not in {cycle.key for cycle in asked.cycles}]
    assert extra == ["b1/sweep/v2/a0/b0/again1", "b1/sweep/v50/a0/b0/again1", "b1/sweep/v200/a0/b0/again1"]
    assert keys.index(extra[0]) == keys.index("b1/sweep/v2/a0/b0/r1") + 1
    always = [one.cycle for one in played(asked, lambda cycle: QuickPoint(30.0, 5.0, 9.0))]
    sweeps = [cycle for cycle in always if cycle.kind == "sweep"]
    assert len(sweeps) == 8 * 3
    assert len({cycle.key for cycle in always}) == len(always)
    assert {cycle.repeat for cycle in sweeps} == {1, 2, 3}


def test_a_point_that_is_known_is_measured_no_more():
    asked = plan('[adaptive]\ninterval = "1 N"\nleast_repeats = 3\n', repeats=8)
    rng = np.random.default_rng(1)

    def point(cycle):
        spread = 0.1 if cycle.speed_m_s != 0.002 else 5.0
        return QuickPoint(30.0 + spread * rng.standard_normal(), 0.1, 9.0)

    done = played(asked, point)
    counts = {v: sum(one.cycle.speed_m_s == v for one in done) for v in (0.002, 0.01, 0.05, 0.2)}
    assert counts == {0.002: 16, 0.01: 6, 0.05: 6, 0.2: 6}


def test_a_campaign_that_knows_enough_is_done(tmp_path):
    asked = protocol('[adaptive]\ninterval = "9 N"\nleast_repeats = 2\n', repeats=4)
    result = run_campaign(asked, FakeRig(), tmp_path / "c", options=QUICK)
    assert (result.finished, result.planned) == (2 + 2 * 8, 2 + 2 * 8)
    found = status_of(tmp_path / "c")
    assert (found.planned, found.to_do, found.remaining_s) == (18, 0, 0.0)


def test_decisions_are_the_same_after_an_interruption(tmp_path):
    """From the files alone: what a second process decides equals what the first one would have."""
    more = '[adaptive]\nnoise = "15 mN"\nrepeats = 1\nadded_speeds = 2\n'

    def stop_at(number):
        def trouble(rig, word):
            if word == "acquire" and rig.calls.count("acquire") == number:
                raise OSError("unplugged")

        return trouble

    run_campaign(protocol(more), FakeRig(), tmp_path / "a", options=QUICK)
    whole = [file.head.cycle.key for file in Campaign.open(tmp_path / "a").cycles()]
    reasons = [file.head.reason for file in Campaign.open(tmp_path / "a").cycles() if file.head.reason]
    assert any(reason.startswith("repeats") for reason in reasons)
    assert sum(reason.startswith("adds") for reason in reasons) == 4
    with pytest.raises(Exception, match="unplugged"):
        run_campaign(protocol(more), FakeRig(trouble=stop_at(6)), tmp_path / "b", options=QUICK)
    with pytest.raises(Exception, match="unplugged"):
        resume_campaign(tmp_path / "b", FakeRig(trouble=stop_at(4)), options=QUICK)
    resume_campaign(tmp_path / "b", FakeRig(), options=QUICK)
    assert [file.head.cycle.key for file in Campaign.open(tmp_path / "b").cycles()] == whole
