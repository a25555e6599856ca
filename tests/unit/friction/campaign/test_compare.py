"""Two campaigns against each other: a true difference is found with its size, equal ones are not called different."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from oracle.campaigns import BAR, Friction, World, write_campaign
from oracle.stop_campaigns import StopWorld, write_stops
from pneudrive.characteristics import campaign_friction
from pneudrive.cli.main import run
from pneudrive.friction.campaign import compare
from pneudrive.friction.campaign.compare import compare_campaigns, compare_curves
from trials.campaign_comparisons import SMALL
from trials.campaign_coverage import RIGS, Tally, rig_world, tally


def campaign(folder, world, seed):
    return campaign_friction(write_campaign(folder / f"c{seed}", world, seed), processes=1)


def test_a_difference_is_found_with_its_size_and_where_it_is(tmp_path):
    other = replace(SMALL, friction=Friction(coulomb=28.0, breakaway=42.0))
    found = compare_campaigns(campaign(tmp_path, SMALL, 3), campaign(tmp_path, other, 4))
    assert found.different
    assert next(t for t in found.tests if t.what == "friction over speed").different
    assert "friction over speed" in repr(found)  # the name alone shows the tests, and not every sample
    assert max(len(repr(found)), len(repr(found.first))) < 6000
    curves = found.curves
    true = [float(other.truth(v, (0.0, 0.0)) / SMALL.truth(v, (0.0, 0.0))) - 1.0 for v in curves.points["speed_m_s"]]
    inside = [e.low <= t <= e.high for e, t in zip(curves.difference, np.log1p(true), strict=True)]
    assert np.mean(inside) >= 0.8
    by_speed = curves.points.sort("speed_m_s")["corrected_p"]
    assert by_speed[0] > 0.05  # breakaway is the same
    assert by_speed[-1] < 0.05
    assert any("single block" in s.text for s in found.statements)


def test_large_campaigns_are_condensed_and_say_the_same(tmp_path, monkeypatch):
    """Of 20,000 cycles each, a matrix of their covariance alone would take 13 GB."""
    plan = replace(SMALL, levels=({}, {}, {}), block_share=0.01, repeats=4)  # three blocks
    both = [
        campaign(tmp_path, replace(plan, friction=Friction(coulomb=c, breakaway=42.0)), n)
        for n, c in ((5, 30), (6, 29))
    ]
    whole = compare_curves(*both)
    gains = compare_curves(*both, 0.01)  # of two sensors, each with its own error of 1 %
    assert gains.mean.stderr == pytest.approx(np.hypot(whole.mean.stderr, np.sqrt(2.0) * 0.01))
    assert whole.mean.stderr < 0.01
    monkeypatch.setattr(compare, "MOST_CELLS", 45)
    monkeypatch.setattr(compare, "MOST_CYCLES", 30)
    found = compare_curves(*both)
    cycles = found.cycles
    assert cycles.height <= 45 < whole.cycles.height
    assert cycles["count"].sum() == whole.cycles.height
    assert found.several_blocks
    assert np.allclose(found.friction_n, whole.friction_n)
    assert abs(found.mean.value - whole.mean.value) < 0.2 * whole.mean.stderr
    assert 0.7 < found.mean.stderr / whole.mean.stderr < 1.4
    monkeypatch.setattr(compare, "MOST_POINTS", 4)
    few = compare_curves(*both)
    assert (few.points.height, few.left_out) == (4, 3)
    assert few.points["speed_m_s"][0] == found.points["speed_m_s"][0]
    assert few.points["speed_m_s"][-1] == found.points["speed_m_s"][-1]


def test_an_effect_of_pressure_that_changed_is_found(tmp_path):
    pressures = ((0.0, 0.0), (1.0 * BAR, 1.0 * BAR))
    worlds = [
        replace(SMALL, gauges_pa=pressures, repeats=2, friction=Friction(lip_a=lip, lip_b=lip)) for lip in (0.5, 2.5)
    ]
    found = compare_campaigns(*(campaign(tmp_path, w, i) for i, w in enumerate(worlds)))
    assert next(t for t in found.tests if t.what == "relative effect of pressure").different


def test_slopes_of_breakaway_are_compared(tmp_path):
    durations = (1.0, 10.0, 100.0)
    worlds = [StopWorld(law=law, durations_s=durations, repeats=3, samples=400) for law in ("log", "stretched", "log")]
    seeds = (0, 1, 3)  # of equal pairs one in twenty differs by chance: 0 and 2 is one
    found = [
        campaign_friction(write_stops(tmp_path / f"s{i}", w, i), processes=1)
        for i, w in zip(seeds, worlds, strict=True)
    ]
    differ = {t.what: t for t in compare_campaigns(found[0], found[1]).tests}
    slope = differ["slope of breakaway per decade of stop"]
    assert slope.different
    assert slope.difference.low <= worlds[1].mean_slope((0, 0)) - worlds[0].mean_slope((0, 0)) <= slope.difference.high
    assert not compare_campaigns(found[0], found[2]).different


def test_what_cannot_be_compared_is_said(tmp_path):
    folder = write_campaign(tmp_path / "soft", replace(SMALL, repeats=1), 5)
    identity = json.loads((folder / "rig.json").read_text())
    (folder / "rig.json").write_text(json.dumps(identity | {"stiffness_n_m": 2e4, "chambers": "open"}))
    found = compare_campaigns(campaign(tmp_path, replace(SMALL, repeats=1), 6), campaign_friction(folder, processes=1))
    unlike = {check.what for check in found.checks if not check.comparable}
    assert unlike == {"stiffness", "chambers"}
    assert any("Stiffness differs" in s.text and not s.carried for s in found.statements)
    slower = replace(SMALL, repeats=1, speeds_m_s=(1e-3, 3.3e-3), sentinel_every=0)
    nothing = compare_campaigns(campaign(tmp_path, SMALL, 7), campaign(tmp_path, slower, 8))
    assert nothing.curves is None
    assert any("cannot be compared" in s.text for s in nothing.statements)


def test_from_the_command_line(tmp_path, printed, refusal):
    worlds = (SMALL, replace(SMALL, friction=Friction(coulomb=25.0)))
    a, b = (str(write_campaign(tmp_path / f"c{i}", w, i)) for i, w in enumerate(worlds))
    said = printed(["compare", a, b, "--out", tmp_path / "out"])
    assert "differ by more than their cycles scatter" in " ".join(said.split())
    assert "may be the mounting or the day" in " ".join(said.split())
    assert all(name in said.replace("\n", "") for name in ("A: ", "B: ", "c0", "c1"))
    table = tomllib.loads((tmp_path / "out" / "comparison.toml").read_text())
    assert table["different"] is True
    assert table["synthetic"] is True
    page = (tmp_path / "out" / "report.html").read_text()
    assert "figures/compare-curves.png" in page
    assert "Synthetic" in page.split("<nav")[0]
    refusal(["compare", a, a, "--out", tmp_path / "out"], "with itself")
    assert run(["compare", a, str(tmp_path / "none"), "--out", str(tmp_path / "out")]) == 2


@pytest.mark.parametrize("cycles", [0, 1])
def test_campaigns_of_almost_nothing_end_in_a_sentence(tmp_path, cycles):
    few = World(speeds_m_s=(1e-2, 1e-1)[: cycles + 1], repeats=1, sentinel_every=0, tare=False, samples=200)
    found = compare_campaigns(campaign(tmp_path, few, 1), campaign(tmp_path, few, 2))
    assert not found.different
    assert found.statements


# --- The band of a curve holds the true curve as often as it says, for laws and rigs that it does not know.
#
# Where it held it always, it would be wider than what is known; where it held it seldom, narrower. A sample: `make
# trials` draws many.


@pytest.fixture(scope="module")
def tallies():
    """Hits of the true curve and of the rows of the map, and errors, by rig."""
    return {kind: tally(rig_world(kind, number), number) for number, kind in enumerate(RIGS)}


def test_of_all_points_as_many_are_inside_as_it_says(tallies):
    whole = sum(tallies.values(), Tally())
    for hits in (whole.measured, whole.direction, whole.rows):
        assert 0.90 <= np.mean(hits) <= 0.99
    # Errors as a share of what the band says they are: 1 where it is as wide as it has to be.
    assert 0.6 <= np.sqrt(np.mean(np.square(whole.scores))) <= 1.15


@pytest.mark.parametrize("kind", RIGS)
def test_no_kind_of_rig_is_left_out(tallies, kind):
    assert np.mean(tallies[kind].measured + tallies[kind].direction) >= 0.80
