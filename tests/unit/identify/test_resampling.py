"""Correlations in words and the block bootstrap, on simulated maps."""

from __future__ import annotations

import numpy as np
import pytest

from oracle.bootstrap import bootstrap
from pneudrive.errors import FitError
from pneudrive.identify import FrictionFit, fit_friction

SPEED = np.geomspace(1e-3, 0.45, 20)


def simulated(make_map, friction_of, speed=SPEED, noise=0.3, seed=1, **options):
    error = noise * np.random.default_rng(seed).standard_normal(speed.size)
    return fit_friction(make_map(speed, friction_of(speed) + error, noise), **options)


def test_the_correlation_that_stick_slip_leaves_is_said_with_its_remedy(make_map, friction_of):
    fit = simulated(make_map, friction_of, speed=np.geomspace(9e-3, 0.45, 20), noise=0.1)
    i, j = fit.free.index("breakaway"), fit.free.index("stribeck_velocity")
    # design study: -0.90 from 9 to 450 mm/s, -0.48 from 1 to 450 mm/s
    assert fit.correlation[i, j] == pytest.approx(-0.9, abs=0.06)
    dense = simulated(make_map, friction_of)
    assert dense.correlation[i, j] == pytest.approx(-0.48, abs=0.08)
    assert not dense.correlated()
    said = " ".join(simulated(make_map, friction_of, speed=np.geomspace(11e-3, 0.45, 20), noise=0.05).correlated())
    assert "breakaway and stribeck_velocity change together" in said
    assert "speeds below 11 mm/s would separate them" in said


def test_block_bootstrap_sees_what_recordings_share(make_map, friction_of):
    rng = np.random.default_rng(5)
    speed = np.tile(np.geomspace(2e-3, 0.4, 8), 12)
    recording = np.repeat(np.arange(12), 8)
    shared = 0.8 * rng.standard_normal(12)[recording]
    curves = make_map(speed, friction_of(speed) + shared + 0.2 * rng.standard_normal(96), 0.2)
    curves["recording"] = ("row", np.repeat([f"run {k}" for k in recording], 2).astype(object))
    fit = fit_friction(curves)
    again = bootstrap(fit, draws=100)
    assert again.kind == "cases"
    assert again.blocks == 12
    naive = np.diff(fit.intervals["coulomb"])[0]
    low, high = again.intervals["coulomb"]
    # the mean of twelve shared shifts of 0.8 N: +-0.45 N; single values would say +-0.25 N
    assert 1.15 * naive < high - low
    assert (high - low) / 2.0 == pytest.approx(1.96 * 0.8 / np.sqrt(12), rel=0.45)


def test_wild_bootstrap_agrees_with_the_profile_where_values_are_independent(make_map, friction_of):
    fit = simulated(make_map, friction_of)
    again = bootstrap(fit, draws=150)
    assert again.kind == "wild"
    for name in fit.free:
        assert np.diff(again.intervals[name])[0] == pytest.approx(np.diff(fit.intervals[name])[0], rel=0.45), name


def test_messages(make_map, friction_of, tmp_path):
    fit = simulated(make_map, friction_of)
    fit.to_toml(tmp_path / "fit.toml")
    read = FrictionFit.from_toml(tmp_path / "fit.toml")
    with pytest.raises(FitError, match=r"(?s)without its data.*Fit again"):
        bootstrap(read)
    with pytest.raises(FitError, match="too few for a bootstrap"):
        bootstrap(simulated(make_map, friction_of, speed=np.geomspace(1e-3, 0.4, 5)))
