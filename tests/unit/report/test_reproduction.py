"""The paper's sentences are checked, not asserted: where the data say no, the report says no."""

from dataclasses import replace

import pytest

from pneudrive.report import write_report
from pneudrive.report.verdict import verdict


def test_sentences_hold_for_the_packages_own_rigs(made, tmp_path, loads_from_elsewhere):
    assert sorted(made.figures) == list(range(1, 10))
    page = write_report(None, {}, tmp_path, made).read_text(encoding="utf-8")
    assert loads_from_elsewhere(page) == []
    assert "9 of 9 sentences hold" in page
    assert "DOES NOT HOLD" not in page
    positions = [page.index(f'<section id="{key}">') for key in ("recovered", "paper", "stick-slip", "chambers")]
    assert positions == sorted(positions)
    assert 'class="synthetic"' in page
    for rig in made.rigs.values():  # whose values are listed, each with its source
        assert rig.name[1:] in page


def test_a_sentence_that_does_not_hold_is_shown(made, tmp_path):
    planted = dict(made.figures)
    planted[8] = replace(planted[8], holds=False, measured="the lower line is the higher pressure")
    other = replace(made, figures=planted)
    page = write_report(None, {}, tmp_path, other).read_text(encoding="utf-8")
    assert "DOES NOT HOLD" in page
    assert "8 of 9 sentences hold; those that do not: figure 8" in page
    assert "The lower line is the higher pressure." in page
    assert "not: figure 8" in verdict(None, {}, other)[0]


def test_printed_chambers_lose_energy_and_the_balance_does_not(made):
    residual = made.chambers.energy_residual_j
    assert residual["energy-balance"] < 1e-3 * made.chambers.stroke_work_j
    assert residual["as-printed"] > 0.05 * made.chambers.stroke_work_j
    assert made.chambers.stroke_time_s["as-printed"] == pytest.approx(
        made.chambers.stroke_time_s["energy-balance"], 0.02
    )
