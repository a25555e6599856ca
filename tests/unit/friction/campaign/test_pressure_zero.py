"""Tares show the zeros of the pressure sensors: they are taken off, and what is left to say of a sensor is its gain."""

from __future__ import annotations

import json

import numpy as np
import pytest

from campaign.fake_rig import QUICK, protocol
from oracle.campaigns import BAR, hits
from pneudrive.campaign.run import run_campaign
from pneudrive.characteristics import campaign_friction
from pneudrive.rig import load_rig

ACCURACY_PA = 400.0
RANGE_PA = 2.5 * BAR  # the usual one that holds 2 bar
PLAN = {
    "gauges_pa": ((0.5 * BAR, 0.5 * BAR), (2.0 * BAR, 2.0 * BAR)),
    "pressure_accuracy_pa": ACCURACY_PA,
    "speeds_m_s": tuple(np.geomspace(2e-3, 0.4, 5)),
    "cycle_share": 0.002,
    "white_n": 0.05,
    "correlated_n": 0.05,
}


def half_widths(found, gauge_pa):
    """Half the width of the bands of one direction at this pressure in both chambers, N."""
    curves = [c for c in found.curves if c.direction and abs(c.condition.pressure_a_pa - 101325.0 - gauge_pa) < 200.0]
    return np.concatenate([(c.high_n - c.low_n)[c.measured] / 2.0 for c in curves])


def test_one_direction_is_known_better_and_its_band_still_holds_the_truth(measured, quick):
    draw = np.random.default_rng(7)
    inside = {1: [], -1: []}
    for seed in range(3):
        zeros, gains = ACCURACY_PA * draw.standard_normal((2, 2))
        world = quick(**PLAN, pressure_zeros_pa=tuple(zeros), pressure_gains=tuple(gains / RANGE_PA))
        found = measured(world, seed)
        for curve in found.curves:
            if curve.direction:
                inside[curve.direction] += hits(world, curve).tolist()
        rows = found.friction_map
        for side, gain in (("a", gains[0]), ("b", gains[1])):
            shown = rows[f"pressure_{side}_pa"].to_numpy() - 101325.0
            true = np.where(shown > 1.2 * BAR, 2.0 * BAR, 0.5 * BAR)
            assert shown == pytest.approx(true * (1.0 + gain / RANGE_PA), abs=50.0)
        assert found.zero.zero_n == pytest.approx(1.0, abs=0.05)  # of the force sensor alone
    assert all(np.mean(values) >= 0.90 for values in inside.values())
    # What is left of both sensors at a fifth of their range is a fifth of their accuracy.
    whole = 1.96 * np.sqrt(2.0) * ACCURACY_PA * 4.909e-4
    assert half_widths(found, 0.5 * BAR).min() < 0.5 * whole
    assert half_widths(found, 2.0 * BAR).min() > 0.8 * whole


def test_a_zero_that_no_accuracy_explains_is_said_and_not_taken_off(measured, quick):
    far = measured(quick(**PLAN, pressure_zeros_pa=(3000.0, 0.0)))
    said = [s for s in far.statements if s.topic == "zero" and not s.carried]
    assert len(said) == 1
    assert "chamber a" in said[0].text
    assert "tare-1: +3e+03 Pa" in said[0].text
    assert far.ranges.gauge_a_pa[1] == pytest.approx(2.0 * BAR + 3000.0, abs=50.0)
    without = measured(quick(**PLAN, pressure_zeros_pa=(300.0, 0.0), tare=False))
    assert not [s for s in without.statements if s.topic == "zero"]
    assert without.ranges.gauge_a_pa[1] == pytest.approx(2.0 * BAR + 300.0, abs=50.0)


def test_the_zeros_of_a_simulated_rig_are_told_apart(tmp_path):
    run_campaign(protocol(), load_rig("default", seed=3), tmp_path / "c", options=QUICK)
    true = {t["key"]: t for t in (json.loads(path.read_text()) for path in (tmp_path / "c/truth").iterdir())}
    found = campaign_friction(tmp_path / "c", processes=1)
    rows = found.friction_map
    for side in ("a", "b"):
        pressure = [true[key][f"pressure_{side}_pa"] for key in rows["recording"].to_numpy()]
        # At most 0.5 bar of the range of 4 bar: three standard deviations of the gain error are 150 Pa.
        assert rows[f"pressure_{side}_pa"].to_numpy() == pytest.approx(pressure, abs=150.0)
    tare = next(t for t in true.values() if t["key"].endswith("tare"))
    assert found.zero.zero_n == pytest.approx(tare["sensors"]["force_zero_n"], abs=0.02)
    shown = [s.text for s in found.statements if s.topic == "zero"]
    assert sum("subtracted from all cycles" in text for text in shown) == 2
