"""A campaign's results as files: what was found is what is read back, by this package and by any other reader."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from oracle.campaigns import BAR, Friction, World, write_campaign
from pneudrive.characterise import read_map
from pneudrive.characteristics import campaign_friction, fit_campaign, write_characteristics
from pneudrive.describe.files.toml import tomllib

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
    assert effects["pressure"][0]["mean_a"]["value"] == found.pressure[0].mean_a.value
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


def test_a_band_that_does_not_hold_the_drift_says_that_it_is_not_complete(found, tmp_path):
    plan = {"friction": TRUE, "samples": 300, "repeats": 1, "sentinel_every": 0, "drift_share": -0.1}
    blind = campaign_friction(write_campaign(tmp_path / "blind", World(order="ascending", **plan), 1), processes=1)
    for one, complete in ((found, True), (blind, False)):
        write_characteristics(one, tmp_path)
        table = pl.read_parquet(tmp_path / "curves.parquet")
        assert set(table.select("direction", "complete").unique().iter_rows()) == {(d, complete) for d in (0, 1, -1)}
        assert any("not in the band" in s.text for s in one.statements if s.topic == "drift") != complete
