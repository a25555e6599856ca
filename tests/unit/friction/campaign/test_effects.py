"""Effects come out of a campaign with their intervals; what its plan does not carry is said, not given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from oracle.campaigns import BAR, Friction, gauges, hits, rewrite
from pneudrive.friction.campaign import characteristics

CROSSED = ((0.0, 0.0), (BAR, 0.0), (0.0, BAR), (BAR, BAR), (2.0 * BAR, BAR))
SPEEDS = tuple(np.geomspace(2e-3, 0.3, 6))


def said(found, topic: str) -> str:
    return " ".join(str(s) for s in found.statements if s.topic == topic)


def not_carried(found, topic: str) -> str:
    return " ".join(str(s) for s in found.statements if s.topic == topic and not s.carried)


def inside(estimate, true: float) -> bool:
    return estimate.low <= true <= estimate.high


def test_each_pressure_has_its_own_slope_and_an_interaction_shows_where_there_is_one(measured, quick):
    lips = {"lip_a": 1.0, "lip_b": 3.0}
    plain = measured(quick(friction=Friction(**lips), gauges_pa=CROSSED, speeds_m_s=SPEEDS, cycle_share=0.005), seed=4)
    (effect,) = plain.pressure
    assert inside(effect.means["a"], 1.0 / BAR)
    assert inside(effect.means["b"], 3.0 / BAR)
    assert effect.means["a"].high - effect.means["a"].low < 0.5 / BAR
    assert effect.interaction.p > 0.05
    assert "add" in effect.statement
    joint = Friction(**lips, joint=1.0)
    crossed = measured(quick(friction=joint, gauges_pa=CROSSED, speeds_m_s=SPEEDS, cycle_share=0.005), seed=4)
    (effect,) = crossed.pressure
    assert effect.interaction.p < 1e-3
    assert inside(effect.interaction_n_pa2, 1.0 / BAR**2)
    assert "interact" in effect.statement


GRID = tuple((a * BAR, b * BAR) for a in (0.0, 2.0, 4.0) for b in (0.0, 2.0, 4.0))


def product_in_rising_order(quick, **changes):
    """Lines of 3.4 and 2 N/bar and 0.8 N/bar2 of the product: at the middle of the grid 5 and 3.6 N/bar."""
    friction = Friction(coulomb=25.0, lip_a=3.4, lip_b=2.0, joint=0.8)
    plan = {"gauges_pa": GRID, "speeds_m_s": SPEEDS, "repeats": 1, "order": "ascending", "cycle_share": 0.005}
    return quick(friction=friction, **plan, **changes)


def test_a_product_of_pressures_in_rising_order_is_no_drift_and_no_curve(measured, quick):
    world = product_in_rising_order(quick, sentinel_every=8, run_in_share=0.15, run_in_m=4.0)
    (effect,) = measured(world, seed=1).pressure
    assert inside(effect.means["a"], 5.0 / BAR)
    assert inside(effect.means["b"], 3.6 / BAR)
    assert effect.means["a"].high - effect.means["a"].low < 0.6 / BAR
    assert inside(effect.interaction_n_pa2, 0.8 / BAR**2)
    assert effect.curvature.p > 0.01
    assert effect.hidden_n == 0.0
    assert "would have the same effect" not in effect.statement


@pytest.mark.parametrize("run_in", [-0.1, 0.0, 0.15])
def test_what_runs_in_while_pressure_only_rises_is_in_the_intervals(measured, quick, run_in):
    """Nothing tells the two apart: neither may a test of the product or of a curve."""
    world = product_in_rising_order(quick, sentinel_every=0, run_in_share=run_in, run_in_m=4.0)
    (effect,) = measured(world, seed=1).pressure
    assert inside(effect.means["a"], 5.0 / BAR)
    assert inside(effect.means["b"], 3.6 / BAR)
    assert all(inside(slope, 5.0 / BAR) for slope in effect.slopes["a"])
    assert effect.hidden_n == pytest.approx(0.1 * 50.0, rel=0.3)
    assert (effect.interaction, effect.curvature) == (None, None)
    assert "follows p_a and p_b" in effect.statement
    assert "would have the same effect" in effect.statement


def test_equal_pressures_tell_the_sum_and_no_more(measured, quick):
    both = tuple((p * BAR, p * BAR) for p in (0.0, 0.5, 1.0, 1.5))
    found = measured(quick(friction=Friction(lip_a=1.0, lip_b=3.0), gauges_pa=both, speeds_m_s=SPEEDS))
    (effect,) = found.pressure
    assert inside(effect.means["sum"], 4.0 / BAR)
    assert effect.means.keys() == {"sum"}
    assert effect.interaction is None
    assert "cannot be determined" in not_carried(found, "pressure")
    assert "one chamber only" in not_carried(found, "pressure")
    assert "below the usual service pressure of 3 to 10 bar" in not_carried(found, "range")


def test_pressure_is_told_where_blocks_differ_in_proportion_to_friction(measured, quick):
    """A block that scales friction must not be taken for friction itself, to which cycles that repeat well tempt."""
    levels = ({"mounting": "rigid"}, {"mounting": "floating"}) * 2
    friction = Friction(coulomb=9.0, breakaway=12.5, stribeck_m_s=0.004, viscous=3.0, lip_a=0.5, lip_b=0.5)
    chance = {"cycle_share": 0.003, "white_n": 0.02, "correlated_n": 0.02, "drift_share": 0.03, "block_share": 0.02}
    world = quick(friction=friction, gauges_pa=((0.0, 0.0), (BAR, BAR)), levels=levels, **chance)
    found = measured(world, seed=1)
    assert [effect.levels for effect in found.pressure] == ["floating", "rigid"]
    for effect in found.pressure:
        assert effect.means["sum"].value == pytest.approx(1.0 / BAR, rel=0.1)
        assert inside(effect.means["sum"], 1.0 / BAR)


def test_air_is_taken_out_where_it_was_measured_and_bounded_where_not(measured, quick):
    world = quick(air_pa_s_m=2e4, gauges_pa=((BAR, BAR),), speeds_m_s=SPEEDS, cycle_share=0.005)
    found = measured(world)
    (share,) = found.air
    true = world.air_n(share.speed_m_s)
    assert share.separated
    assert np.all((share.air_low_n <= true) & (true <= share.air_high_n))
    assert share.air_n[-1] == pytest.approx(true[-1], rel=0.01)
    assert share.total_n == pytest.approx(share.air_n + share.seal_n, rel=0.02)
    blind = measured(quick(air_pa_s_m=2e4, gauges_pa=((BAR, BAR),), speeds_m_s=SPEEDS, measured_at="regulator"))
    (share,) = blind.air
    assert not share.separated
    assert np.isnan(share.seal_n).all()
    assert share.air_bound_n[-1] >= world.air_n(share.speed_m_s[-1])
    assert "cannot be separated" in not_carried(blind, "air")
    assert all(curve.contains_air for curve in blind.curves)


def test_directions_need_a_tare(measured, quick):
    world = quick(friction=Friction(asymmetry=0.06), zero_n=3.0, speeds_m_s=SPEEDS, cycle_share=0.005)
    found = measured(world)
    (asymmetry,) = found.asymmetry
    true = 0.06 * world.truth(asymmetry.speed_m_s, (0.0, 0.0))
    assert inside(asymmetry.mean, true.mean())
    assert asymmetry.mean.p < 1e-6
    assert "differs between the directions" in said(found, "direction")
    symmetric = measured(quick(friction=Friction(), zero_n=3.0, speeds_m_s=SPEEDS, cycle_share=0.005))
    assert symmetric.asymmetry[0].mean.p > 0.01
    blind = measured(quick(friction=Friction(asymmetry=0.06), zero_n=3.0, speeds_m_s=SPEEDS, tare=False))
    assert blind.asymmetry[0].basis == "not separable"
    assert np.isnan(blind.asymmetry[0].mean.p)
    assert "tare" in not_carried(blind, "direction")
    for direction in (1, -1):  # the zero is in it as uncertainty: the truth still lies inside
        curve = next(c for c in blind.curves if c.direction == direction)
        true = world.truth(curve.speed_m_s, (0.0, 0.0), direction)
        assert np.all((curve.low_n <= true) & (true <= curve.high_n))


def test_the_zero_of_the_sensor_and_its_drift(measured, quick):
    levels = ({"seal": "A"}, {"seal": "B"}, {"seal": "A"})
    found = measured(quick(zero_n=1.0, zero_drift_n=2.0, levels=levels, repeats=1, correlated_n=0.05))
    last = len(found.cycles) - 1
    true = 1.0 + 2.0 * (found.cycles.filter(kind="tare")["index"].to_numpy() - 1) / last
    assert found.zero.zero_n == pytest.approx(true, abs=4.0 * found.zero.stderr_n.max())
    assert found.zero.per_hour.low > 0.0


def test_a_drift_is_told_by_sentinels_and_not_at_all_where_speed_and_time_went_together(measured, quick):
    world = quick(drift_share=-0.10, cycle_share=0.005, sentinel_every=4)
    found = measured(world)
    hours = (found.cycles["began_s"][-1] - found.cycles["began_s"][0]) / 3600.0
    level = np.nanmean(found.cycles["friction_n"])
    assert found.drift.basis == "sentinels"
    assert inside(found.drift.per_hour, -0.10 * level / hours)
    assert found.drift.per_hour.p < 0.05
    assert np.ptp(found.drift.drift_n) == pytest.approx(0.10 * level, rel=0.25)
    blind = measured(quick(drift_share=-0.10, repeats=1, order="ascending", sentinel_every=0))
    assert blind.drift.per_hour is None
    assert "cannot be separated from the curve" in not_carried(blind, "drift")
    assert "sentinels" in not_carried(blind, "drift")


def test_friction_still_changes_if_its_last_quarter_changes_by_more_than_half_of_the_band(measured, quick, monkeypatch):
    """From 30 h of 40 h on by 0.1 N/h, 1 N in all, after a jump that does not count; two cycles are too few."""
    asked = []
    say = characteristics.statements
    monkeypatch.setattr(characteristics, "statements", lambda *given: asked.append(given) or ())
    measured(quick())
    ((found, *rest),) = asked
    for cycles, half_n, is_said in ((41, 0.99, True), (41, 1.01, False), (9, 0.99, True), (5, 0.99, False)):
        hours = np.linspace(0.0, 40.0, cycles)
        course = np.where(hours < 30.0, -50.0, 0.1 * hours)
        band = {"time_s": 3600.0 * hours, "drift_n": course, "low_n": course - half_n, "high_n": course + half_n}
        own = replace(found, drift=replace(found.drift, **band))
        notes = [note.text for note in say(own, *rest) if "still changes" in note.text]
        assert len(notes) == is_said, (cycles, half_n)
        assert all("by +1 N over the last 25 % of time" in note for note in notes)


def test_repeatability_within_and_between_blocks(measured, quick):
    levels = ({"seal": "A"},) * 6
    found = measured(quick(levels=levels, cycle_share=0.02, block_share=0.04, repeats=1, white_n=0.1, correlated_n=0.1))
    level = np.nanmean(found.cycles["friction_n"])
    assert inside(found.repeatability.within, 0.02 * level)
    assert inside(found.repeatability.between, 0.04 * level)
    assert found.repeatability.total.value > found.repeatability.within.value
    alone = measured(quick(levels=({"seal": "A"},)))
    assert alone.repeatability.between is None
    assert "not in the band" in not_carried(alone, "repeatability")


def test_position_pattern_and_trend(measured, quick):
    found = measured(quick(ripple=((0.04, 3.0, 0.5),), slope_share=0.1, cycle_share=0.005))
    overall = found.position[0]
    away = overall.position_m / 0.2
    true = 1.0 + 0.04 * np.sin(6.0 * np.pi * away + 0.5) + 0.1 * (away - 0.5)
    assert overall.relative == pytest.approx(true / true.mean(), abs=0.006)
    assert np.mean((overall.low <= true / true.mean()) & (true / true.mean() <= overall.high)) > 0.8
    # three waves in the stroke do not fit a whole number of times into what all cycles cover: they are no trend
    assert overall.harmonics[0].wavelength_m == pytest.approx(0.2 / 3.0, rel=0.01)
    assert overall.harmonics[0].amplitude.value == pytest.approx(0.04 / true.mean(), rel=0.05)
    assert overall.trend_per_m.value == pytest.approx(0.1 / 0.2 / true.mean(), rel=0.04)
    assert overall.trend_per_m.p < 1e-6
    flat = measured(quick(cycle_share=0.005)).position[0]
    assert sum(h.amplitude.p < 0.01 for h in flat.harmonics) <= 1
    assert np.abs(flat.relative - 1.0).max() < 0.02


def test_a_known_weight_corrects_the_gain(measured, quick):
    world = quick(speeds_m_s=SPEEDS, cycle_share=0.002, sentinel_every=5)
    found = measured(world, seed=2, spoil=hang_a_weight(gain=1.02))
    curve = found.curves[0]
    true = world.truth(curve.speed_m_s, (0.0, 0.0))[curve.measured]
    assert curve.friction_n[curve.measured] == pytest.approx(true, rel=0.01)
    assert hits(world, curve).mean() > 0.7
    assert "Known weights" in said(found, "curve")


def hang_a_weight(gain: float):
    """Spoil a campaign: its force sensor has that gain, and a weight of 50 N shows it after the first tare."""
    import json

    import polars as pl

    def spoil(folder):
        for path in sorted((folder / "cycles").glob("*.parquet")):
            head = rewrite(path, lambda frame: frame.with_columns(pl.col("force_n") * gain))
            if head["cycle"]["kind"] == "tare":
                cycle = head["cycle"] | {"kind": "weight", "key": f"weight-{head['index']}"}
                cycle["steps"] = [{"duration_s": 5.0, "released": False, "weight_n": 50.0}]
                under = pl.read_parquet(path).with_columns(pl.col("force_n") - gain * 50.0)
                name = f"{head['index']:05d}-weight.parquet"
                data = json.dumps(head | {"cycle": cycle})
                under.write_parquet(path.with_name(name), metadata={"pneudrive": data})

    return spoil


def test_conditions_are_named_as_people_say_them(measured, quick):
    found = measured(quick(gauges_pa=((0.5 * BAR, 0.0),), levels=({"seal": "NBR"},), speeds_m_s=SPEEDS))
    assert found.curves[0].condition.label(101325.0) == "a 0.5 bar, b 0 bar, NBR"
    assert gauges(found.curves[0].condition) == (0.5 * BAR, 0.0)
