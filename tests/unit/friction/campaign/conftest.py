"""Campaigns whose truth is known, written by formulas that know nothing of the product."""

from __future__ import annotations

import pytest

from oracle.campaigns import Friction, World, write_campaign
from pneudrive.characteristics import campaign_friction


@pytest.fixture
def measured(tmp_path):
    """Give a function that writes a world's campaign and characterises it."""

    def run(world: World, seed: int = 1, spoil=None):
        folder = write_campaign(tmp_path / f"campaign-{len(list(tmp_path.iterdir()))}", world, seed)
        if spoil is not None:
            spoil(folder)
        return campaign_friction(folder, processes=1)

    return run


@pytest.fixture
def quick():
    """Give a function that makes a world with few samples a stroke, the rest as it is told."""

    def make(**changes) -> World:
        return World(**({"samples": 300, "friction": Friction(asymmetry=0.03)} | changes))

    return make
