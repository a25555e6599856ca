"""Fraction of pairs of campaigns of one contact that are called different: 3 to 7 %.

    python -m trials.campaign_comparisons --count 200 --seed 1

The pairs have drift, more scatter, fewer cycles, or two pressures. The exit status is 1 if the fraction lies outside.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from oracle.campaigns import BAR, World, write_campaign
from pneudrive.characteristics import campaign_friction
from pneudrive.friction.campaign.compare import compare_campaigns
from trials.shares import is_within, options

SMALL = World(speeds_m_s=tuple(np.geomspace(2e-3, 0.3, 6)), samples=300, repeats=3, sentinel_every=6, correlated_n=0.2)
KINDS = (
    SMALL,
    replace(SMALL, drift_share=0.02),
    replace(SMALL, cycle_share=0.02),
    replace(SMALL, repeats=2),
    replace(SMALL, gauges_pa=((0.0, 0.0), (BAR, BAR))),
)


def is_called_different(world: World, seed: int) -> bool:
    """Return whether two campaigns of one world are called different."""
    with tempfile.TemporaryDirectory() as folder:
        pair = [
            campaign_friction(write_campaign(Path(folder) / f"c{i}", world, 2 * seed + i), processes=1) for i in (0, 1)
        ]
    return compare_campaigns(*pair).different


def main() -> None:
    """Print the fraction."""
    given = options(__doc__, 200)
    called = [is_called_different(KINDS[n % len(KINDS)], n) for n in range(given.seed, given.seed + given.count)]
    sys.exit(not is_within("equal campaigns called different", called, 0.03, 0.07))


if __name__ == "__main__":
    main()
