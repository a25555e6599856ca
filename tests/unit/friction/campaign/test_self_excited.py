"""On a soft rig the seal makes the piston swing at low speed: such means are shown, and are no points of F(v).

The axis runs evenly, its encoder shows nothing, samples are too far apart to show the swing: its force gives it away.
"""

from __future__ import annotations

import numpy as np
import pytest

from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.storage.folder import Head, create, write_cycle
from pneudrive.characteristics import campaign_friction
from pneudrive.rig import Hold, Move, Samples, Sampling, load_rig

SWINGING = (3e-3, 5e-3, 8e-3)  # inside the self-excited range of the rig "soft", from 2 to 13 mm/s
STEADY = (1.2e-3, 0.018, 0.03, 0.06, 0.12, 0.2)
SAMPLING = Sampling(samples_per_stroke=1500)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Write a campaign on the soft rig, without the engine."""
    rig = load_rig("soft", seed=3)
    campaign = create(tmp_path_factory.mktemp("soft") / "campaign", "", rig.identity(), {"name": "soft"})
    low, high = rig.limits().position_m
    span = (low + 0.01, min(low + 0.11, high))
    ambient = rig.identity().ambient_pressure_pa
    rig.move(span[0], 0.05)
    plan = [("tare", None), *((f"sweep-{i}", v) for i, v in enumerate((*SWINGING, *STEADY, *STEADY)))]
    for index, (key, speed) in enumerate(plan, start=1):
        steps = (Hold(3.0, released=True),) if speed is None else (Move(span[1], speed), Move(span[0], speed))
        cycle = Cycle(key, key.split("-")[0], steps, SAMPLING, ambient, ambient, speed_m_s=speed)
        rig.begin_cycle(key)
        began = rig.state().time_s
        samples = Samples.join(list(rig.acquire(steps, SAMPLING)))
        write_cycle(campaign.path, Head(index, cycle, began_s=began), samples)
    return campaign.path


@pytest.fixture(scope="module")
def found(folder):
    return campaign_friction(folder)


def test_swinging_points_are_shown_and_not_counted(found):
    (curve,) = [c for c in found.curves if c.direction == 0]
    assert curve.speed_m_s.min() == pytest.approx(min(STEADY), rel=0.01)
    assert sorted(p.speed_m_s for p in curve.excluded) == pytest.approx(SWINGING, rel=0.02)
    assert {round(1e3 * p.speed_m_s, 1) for p in found.stick_slip} == {round(1e3 * v, 1) for v in SWINGING}
    threshold = found.stick_slip_thresholds[0]
    assert (threshold.low_m_s, threshold.high_m_s) == pytest.approx((max(SWINGING), 0.018), rel=0.02)
    assert "not points of F(v)" in " ".join(s.text for s in found.statements if not s.carried)


def test_what_is_counted_is_the_friction_of_steady_sliding(found):
    rig = load_rig("soft")
    curve = found.curves[0]
    true = np.array([rig.rig.true_friction(v) for v in curve.speed_m_s[curve.measured]])
    inside = (curve.low_n[curve.measured] <= true) & (true <= curve.high_n[curve.measured])
    assert inside.mean() >= 0.75
    assert curve.friction_n[curve.measured] == pytest.approx(true, rel=0.02)
