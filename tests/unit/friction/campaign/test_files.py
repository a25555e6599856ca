"""A campaign's results as files: what was found is what is read back, by this package and by any other reader."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from oracle.campaigns import BAR, Friction, World, rewrite, write_campaign
from oracle.stop_campaigns import StopWorld, write_stops
from pneudrive.characterise import read_map
from pneudrive.characteristics import campaign_friction, fit_campaign, write_characteristics
from pneudrive.describe.files.toml import tomllib
from pneudrive.friction.campaign import points, reading

TRUE = Friction(coulomb=20.0, breakaway=32.0, stribeck_m_s=0.012, viscous=40.0, lip_a=2.0)
GAUGES = ((0.0, 0.0), (1.5 * BAR, 0.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    world = World(friction=TRUE, samples=300, gauges_pa=GAUGES, cycle_share=0.005, repeats=2)
    return write_campaign(tmp_path_factory.mktemp("files") / "campaign", world, 5)


@pytest.fixture(scope="module")
def found(folder):
    return campaign_friction(folder, processes=1)


def test_the_map_is_a_friction_map_with_its_band_and_its_levels(found, folder, tmp_path):
    write_characteristics(found, tmp_path)
    whole, text = pl.read_parquet(tmp_path / "map.parquet"), pl.read_csv(tmp_path / "map.csv")
    assert whole.columns == text.columns
    assert {"friction_low_n", "friction_high_n", "mounting", "seal", "block", "repeat"} < set(whole.columns)
    assert text["friction_n"].to_list() == pytest.approx(whole["friction_n"].to_list(), rel=1e-12)
    assert (whole["friction_low_n"] < whole["friction_n"]).all()
    again = read_map(tmp_path / "map.parquet")
    np.testing.assert_array_equal(again["friction_n"], found.friction_map["friction_n"])
    np.testing.assert_array_equal(pn.characterise(folder)["friction_high_n"], whole["friction_high_n"])
    balance, direction = whole["balance_n"].to_numpy(), whole["direction"].to_numpy()
    assert balance == pytest.approx(direction * whole["friction_n"].to_numpy() + whole["offset_n"].to_numpy())


def test_curves_and_effects_read_back(found, tmp_path):
    write_characteristics(found, tmp_path)
    curves = pl.read_parquet(tmp_path / "curves.parquet")
    one = curves.filter((pl.col("direction") == 0) & (pl.col("pressure_a_pa") > 2e5))
    curve = next(c for c in found.curves if c.direction == 0 and c.condition.pressure_a_pa > 2e5)
    assert one["high_n"].to_list() == curve.high_n.tolist()
    assert one["measured"].to_list() == curve.measured.tolist()
    effects = tomllib.loads((tmp_path / "effects.toml").read_text(encoding="utf-8"))
    assert effects["pressure"][0]["mean_a"]["value"] == found.pressure[0].means["a"].value
    assert effects["drift"]["basis"] == "sentinels"
    assert [s["text"] for s in effects["statement"]] == [s.text for s in found.statements]
    assert sum(s["standard_uncertainty_n"] for s in effects["source"]) > 0.0


def test_names_with_blanks_and_signs_stay_toml(found, tmp_path):
    flags = {"speed ripple": 1, 'a "b"\t\x1b\x7f': 2}
    write_characteristics(replace(found, flags=flags, name="seal \x01 \r\n B"), tmp_path)
    effects = tomllib.loads((tmp_path / "effects.toml").read_bytes().decode())
    assert effects["flags"] == flags
    assert effects["campaign"] == "seal \x01 \r\n B"


def test_a_law_is_fitted_to_the_map(found):
    fits, problems = fit_campaign(found)
    assert problems == []
    fit = fits["all cycles"]["stribeck"]
    for name, true in (("coulomb", 20.0), ("breakaway", 32.0), ("stribeck_velocity", 0.012), ("viscous", 40.0)):
        low, high = fit.intervals[name]
        reach = 1.5 * (high - low)
        assert abs(fit.parameters[name] - true) < reach, name
    assert fit.parameters["coulomb_a"] == pytest.approx(2.0 / BAR, rel=0.15)


def test_an_effect_of_temperature_is_in_the_fit(measured, quick):
    found = measured(quick(temperature_share_k=0.02, sentinel_every=4))
    assert found.drift.per_kelvin.differs
    fits, _ = fit_campaign(found)
    (by_law,) = fits.values()
    assert by_law["stribeck"].dependences.friction["temperature"]["reference"].endswith(" K")


def test_stops_without_any_flag_are_written(tmp_path):
    world = StopWorld(durations_s=(15.0,), repeats=3, samples=600)
    found = campaign_friction(write_stops(tmp_path / "stops", world, 4), processes=1)
    assert not any(found.stops["flags"].to_list())
    write_characteristics(found, tmp_path)
    assert pl.read_parquet(tmp_path / "stops.parquet")["flags"].to_list() == ["", "", ""]


def test_a_band_that_does_not_hold_the_drift_says_that_it_is_not_complete(found, tmp_path):
    plan = {"friction": TRUE, "samples": 300, "repeats": 1, "sentinel_every": 0, "drift_share": -0.1}
    blind = campaign_friction(write_campaign(tmp_path / "blind", World(order="ascending", **plan), 1), processes=1)
    for one, complete in ((found, True), (blind, False)):
        write_characteristics(one, tmp_path)
        table = pl.read_parquet(tmp_path / "curves.parquet")
        assert set(table.select("direction", "complete").unique().iter_rows()) == {(d, complete) for d in (0, 1, -1)}
        assert any("not in the band" in s.text for s in one.statements if s.topic == "drift") != complete


# --- Where samples lie changes nothing: bursts around reversals, and which protocol chooses the samples.

QUIET = {"white_n": 0.01, "correlated_n": 0.0, "cycle_share": 0.0, "sentinel_every": 0, "repeats": 1, "tare": False}


def test_bursts_do_not_bias_the_mean(measured, quick):
    """Friction lies 30 % higher at the ends of the stroke, where most samples are: a plain mean would be too high."""
    pattern = {"ripple": ((0.3, 1.0, 1.57),)}
    even = measured(quick(**QUIET, **pattern))
    burst = measured(quick(**QUIET, **pattern, burst_hz=5000.0))
    frictions = (found.cycles["friction_n"].to_numpy() for found in (even, burst))
    np.testing.assert_allclose(*frictions, rtol=0.01)


def test_cycles_of_different_settled_ways_are_brought_to_one(measured, quick):
    """At high speed half of the stroke goes into the ramps, where friction is another one."""
    world = quick(**QUIET, ripple=((0.1, 1.0, 0.0),), slope_share=0.2, acceleration_m_s2=2.0)
    cycles = measured(world).cycles
    error = cycles["friction_n"].to_numpy() / world.truth(cycles["speed_m_s"].to_numpy(), (0.0, 0.0)) - 1.0
    assert np.ptp(error) < 0.004


def test_worker_processes_give_the_same(quick, tmp_path, monkeypatch):

    folder = write_campaign(tmp_path / "campaign", quick(), 1)
    here = campaign_friction(folder, processes=1)
    monkeypatch.setattr(reading, "WORTH_WORKERS", 1)
    there = campaign_friction(folder, processes=2)
    for a, b in zip(here.curves, there.curves, strict=True):
        np.testing.assert_array_equal(a.friction_n, b.friction_n)
        np.testing.assert_array_equal(a.high_n, b.high_n)


def test_a_large_campaign_is_condensed_and_says_the_same(quick, tmp_path, monkeypatch):

    world = quick(repeats=6, cycle_share=0.01, drift_share=0.02)
    folder = write_campaign(tmp_path / "campaign", world, 3)
    whole = campaign_friction(folder, processes=1)
    monkeypatch.setattr(points, "MOST_CYCLES", 30)
    condensed = campaign_friction(folder, processes=1)
    assert condensed.friction_map.sizes == whole.friction_map.sizes
    for a, b in zip(whole.curves, condensed.curves, strict=True):
        reach = (a.high_n - a.low_n) / 2.0
        assert np.all(np.abs(b.friction_n - a.friction_n)[a.measured] < 0.5 * reach[a.measured])
        assert (b.high_n - b.low_n)[a.measured] / 2.0 == pytest.approx(reach[a.measured], rel=0.4)
        assert b.cycles.tolist() == a.cycles.tolist()
    assert condensed.repeatability.within.value == pytest.approx(whole.repeatability.within.value, rel=0.3)


def test_forces_in_another_unit_scale_all_of_a_result(quick, tmp_path, monkeypatch):
    """Eight times every force and its sensor make eight times each curve, band and scatter, condensed or not."""
    world = quick(repeats=4, cycle_share=1e-3, drift_share=0.02, gauges_pa=((0.0, 0.0),), zero_n=1.0)
    one, other = (write_campaign(tmp_path / name, world, 3) for name in ("one", "other"))
    for path in (other / "cycles").glob("*.parquet"):
        rewrite(path, lambda frame: frame.with_columns(pl.col("force_n") * 8.0))
    rig = json.loads((other / "rig.json").read_text())
    rig["limits"]["force_n"] = [8.0 * end for end in rig["limits"]["force_n"]]
    rig["accuracy"]["force_n"] *= 8.0
    (other / "rig.json").write_text(json.dumps(rig))
    kept, condensed = [], points.CurvePoints.condensed
    monkeypatch.setattr(points.CurvePoints, "condensed", lambda self: kept.append(condensed(self)) or kept[-1])
    for most in (points.MOST_CYCLES, 30):
        monkeypatch.setattr(points, "MOST_CYCLES", most)
        found, scaled = (campaign_friction(folder, processes=1) for folder in (one, other))
        for a, b in zip(found.curves, scaled.curves, strict=True):
            for name in ("friction_n", "low_n", "high_n"):
                assert getattr(b, name) / 8.0 == pytest.approx(getattr(a, name), rel=1e-3), (most, name)
        assert scaled.repeatability.within.value == pytest.approx(8.0 * found.repeatability.within.value, rel=0.01)
        assert scaled.zero.zero_n == pytest.approx(8.0 * found.zero.zero_n, rel=0.01)
    for name in ("friction_n", "friction_stderr_n"):
        assert kept[-1][name] == pytest.approx(8.0 * kept[-2][name], rel=0.06), name  # settled samples differ a little
