"""The band of a curve holds the true curve as often as it says, for laws and rigs that it does not know.

Where it held it always, it would be wider than what is known; where it held it seldom, narrower.
"""

from __future__ import annotations

import numpy as np
import pytest

from oracle.campaigns import AMBIENT_PA, BAR, LAWS, Friction, World, gauges, hits, write_campaign
from pneudrive.characteristics import campaign_friction

CAMPAIGNS = 8
RIGS = {
    "repeats and sentinels in random order, drift, zero that drifts": {"drift_share": 0.02, "zero_drift_n": 1.0},
    "one pass upwards, nothing repeated": {
        "repeats": 1,
        "order": "ascending",
        "sentinel_every": 0,
        "cycle_share": 0.005,
    },
    "three pressure pairs, scatter in newton": {
        "gauges_pa": ((0.0, 0.0), (2.0 * BAR, 0.0), (0.0, 2.0 * BAR)),
        "cycle_share": 0.0,
        "cycle_n": 0.4,
        "repeats": 1,
        "sentinel_every": 6,
    },
    "seals in two blocks each": {
        "levels": ({"seal": "A"}, {"seal": "B"}, {"seal": "A"}, {"seal": "B"}),
        "block_share": 0.01,
        "repeats": 1,
    },
    "slow noise, bursts, friction that varies over position": {
        "correlated_n": 1.0,
        "correlation_s": 0.1,
        "burst_hz": 1000.0,
        "ripple": ((0.02, 3.0, 1.0),),
        "slope_share": 0.03,
    },
    "gain error, air": {"gain_share": 0.003, "air_pa_s_m": 2e4, "cycle_share": 0.005},
}


def drawn(kind: str, number: int) -> Friction:
    """Draw a friction law that somebody's seal could have."""
    draw = np.random.default_rng([number, list(RIGS).index(kind)])
    coulomb = float(draw.uniform(10.0, 60.0))
    return Friction(
        law=LAWS[number % len(LAWS)],
        coulomb=coulomb,
        breakaway=coulomb * float(draw.uniform(1.1, 1.8)),
        stribeck_m_s=float(np.exp(draw.uniform(np.log(0.004), np.log(0.04)))),
        viscous=coulomb * float(draw.uniform(0.3, 2.5)),
        asymmetry=0.05 * float(draw.integers(2)),
        lip_a=1.5,
        lip_b=1.0,
    )


@pytest.fixture(scope="module")
def tally(tmp_path_factory):
    """Hits of the true curve, by direction and rig, and of the true friction by each row of the map."""
    curves = {(kind, d): [] for kind in RIGS for d in (0, 1, -1)}
    rows, scores = [], []
    for kind, changes in RIGS.items():
        for number in range(CAMPAIGNS):
            world = World(friction=drawn(kind, number), **({"samples": 300} | changes))
            folder = write_campaign(tmp_path_factory.mktemp("world") / "campaign", world, number)
            found = campaign_friction(folder, processes=1)
            for curve in found.curves:
                curves[kind, curve.direction] += hits(world, curve).tolist()
                if curve.direction == 0:
                    true = world.truth(curve.speed_m_s, gauges(curve.condition))
                    reach = (curve.high_n - curve.low_n) / 2.0 / 1.96
                    scores += ((curve.friction_n - true) / reach)[curve.measured].tolist()
            table = found.friction_map
            known = {gauges(c.condition) for c in found.curves}
            for v, a, b, low, high in zip(
                *(table[n].to_numpy() for n in ("velocity_m_s", "pressure_a_pa", "pressure_b_pa")),
                *(table[n].to_numpy() for n in ("friction_low_n", "friction_high_n")),
                strict=True,
            ):
                near = min(known, key=lambda g: abs(g[0] + AMBIENT_PA - a) + abs(g[1] + AMBIENT_PA - b))
                true = float(world.truth(abs(v), near))
                rows.append(low <= true <= high)
    return curves, rows, scores


def test_of_all_points_as_many_are_inside_as_it_says(tally):
    curves, rows, scores = tally
    for direction in (0, 1, -1):
        share = np.mean([hit for kind in RIGS for hit in curves[kind, direction]])
        assert 0.90 <= share <= 0.99, direction
    assert 0.90 <= np.mean(rows) <= 0.99
    # Errors as a share of what the band says they are: 1 where it is as wide as it has to be.
    assert 0.6 <= np.sqrt(np.mean(np.square(scores))) <= 1.15


@pytest.mark.parametrize("kind", RIGS)
def test_no_kind_of_rig_is_left_out(tally, kind):
    curves, _, _ = tally
    assert np.mean([hit for d in (0, 1, -1) for hit in curves[kind, d]]) >= 0.80
