"""Recordings are a campaign without a plan: curves, effects and sentences, and two seals never share a curve."""

import numpy as np
import pytest

from oracle.recordings import AMBIENT
from pneudrive.characterise import characterise_recordings, write_map
from pneudrive.friction.campaign.characteristics import recorded_characteristics
from pneudrive.identify.static.fit import fit_characterisation, fit_file
from pneudrive.web.measured.friction import drawn_map

COULOMB_N = {"lip": 5.0, "cup": 9.0}
RISE_N_BAR = {"lip": 1.0, "cup": 2.0}
SPEEDS_M_S = (0.005, 0.015, 0.04, 0.1)


def friction_n(seal: str, speed_m_s, bar: float):
    return COULOMB_N[seal] * (1.0 + 0.5 * np.exp(-((speed_m_s / 0.02) ** 2))) + RISE_N_BAR[seal] * bar + 30 * speed_m_s


@pytest.fixture(scope="module")
def found():
    from oracle.recordings import make_recording

    cases = [(s, run, p, v) for s in COULOMB_N for run in "12" for p in (1.0, 3.0) for v in SPEEDS_M_S]
    recordings = [
        make_recording(
            friction=friction_n(seal, v, bar),
            gauge_b=bar * 1e5,
            speed=v,
            rate=v * 2.5e5,
            strokes=4,
            seed=i,
            name=f"{seal}{run}-{bar:g}-{v:g}",
            labels={"seal": seal, "run": run},
            window_m=(0.012, 0.028),
        )
        for i, (seal, run, bar, v) in enumerate(cases)
    ]
    return characterise_recordings(recordings)


def test_each_seal_has_its_own_curves_with_the_truth_in_their_bands(found):
    curves = [c for c in recorded_characteristics(found).curves if c.direction == 0]
    assert sorted({c.condition.seal for c in curves}) == ["cup", "lip"]
    assert len(curves) == 4
    for c in curves:
        truth = friction_n(c.condition.seal, c.speed_m_s, (c.condition.pressure_b_pa - AMBIENT) / 1e5)
        assert np.mean((c.low_n <= truth) & (truth <= c.high_n)) >= 0.9
        assert c.friction_n == pytest.approx(truth, rel=0.06)
        assert c.cycles.sum() == 8


def test_effects_and_sentences_are_those_of_a_campaign(found):
    result = recorded_characteristics(found)
    rise = {effect.levels: effect.mean_b.value * 1e5 for effect in result.pressure}
    assert rise == pytest.approx(RISE_N_BAR, abs=0.1)
    assert {pattern.levels for pattern in result.position} == set(RISE_N_BAR)  # each seal has its own pattern
    said = [statement.text for statement in result.statements]
    assert any(text.startswith("The order of the recordings in time is not known") for text in said)
    assert any(text.startswith("A cycle repeats within") for text in said)
    assert result.friction_map is found.friction_map


def test_no_fit_is_over_both_seals_and_the_page_draws_each_by_its_own(found, tmp_path):
    fits, problems = fit_characterisation(found)
    assert not problems
    assert sorted(fits) == ["cup", "lip"]
    for seal, by_law in fits.items():
        by_law["stribeck"].to_toml(tmp_path / fit_file(seal))
    path = write_map(found.friction_map, tmp_path / "map.parquet")
    groups = drawn_map(path)["groups"]
    assert [group["label"].partition(":")[0] for group in groups] == ["lip", "lip", "cup", "cup"]
    for group in groups:
        bar = group["gauges"][1] / 1e5
        speed = np.array(group["curve"]["speed"])
        truth = friction_n(group["assembly"], speed, bar)
        assert group["curve"]["friction"] == pytest.approx(truth, rel=0.06)
    one = drawn_map(path, "fit-cup.toml")["groups"]
    assert ["curve" in group for group in one] == [False, False, True, True]
    mixed = drawn_map(path, "own.toml")
    assert not any("curve" in group for group in mixed["groups"])
    assert "several seals" in mixed["fit"]
