"""The paper's sentences are checked, not asserted: where the simulated rig is another, the report says no."""

from dataclasses import replace

import pytest

from pneudrive.report import reproduce, write_report
from pneudrive.report.verdict import verdict
from pneudrive.rig import SimulatedRig


@pytest.fixture(scope="module")
def made():
    return reproduce()


def test_sentences_hold_for_the_packages_own_rig(made, tmp_path, loads_from_elsewhere):
    assert sorted(made.figures) == [1, 2, 3, 5, 6, 8]
    page = write_report(None, {}, tmp_path, made).read_text(encoding="utf-8")
    assert loads_from_elsewhere(page) == []
    assert "6 of 6 sentences hold" in page
    assert "DOES NOT HOLD" not in page
    assert page.count("not checked") >= 2  # figures 4, 7 and 9 are named, and why
    positions = [page.index(f'<section id="{key}">') for key in ("recovered", "paper", "stick-slip", "chambers")]
    assert positions == sorted(positions)
    assert 'class="synthetic"' in page


def test_friction_that_does_not_fall_with_speed_does_not_hold():
    """Breakaway as low as Coulomb friction, at every pressure: no Stribeck curve anywhere."""
    rig = SimulatedRig.default()
    level = replace(rig.description, pressure=dict.fromkeys(rig.description.pressure, 0.0))
    flat = SimulatedRig(level).with_friction(breakaway=rig.description.parameters["coulomb"])
    made = reproduce(flat)
    assert not made.figures[6].holds
    assert not made.figures[8].holds
    assert "not: figure 5, 6, 8" in verdict(None, {}, made)[0]


def test_a_sentence_that_does_not_hold_is_shown(made, tmp_path):
    planted = dict(made.figures)
    planted[8] = replace(planted[8], holds=False, measured="the lower line is the higher pressure")
    page = write_report(None, {}, tmp_path, replace(made, figures=planted)).read_text(encoding="utf-8")
    assert "DOES NOT HOLD" in page
    assert "5 of 6 sentences hold; those that do not: figure 8" in page
    assert "The lower line is the higher pressure." in page


def test_printed_chambers_lose_energy_and_the_balance_does_not(made):
    residual = made.chambers.energy_residual_j
    assert residual["energy-balance"] < 1e-3 * made.chambers.stroke_work_j
    assert residual["as-printed"] > 0.05 * made.chambers.stroke_work_j
    assert made.chambers.stroke_time_s["as-printed"] == pytest.approx(
        made.chambers.stroke_time_s["energy-balance"], 0.02
    )
