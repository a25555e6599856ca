"""The paper's sentences are checked, not asserted: where the data say no, the report says no."""

import html
from dataclasses import replace

import pytest

from pneudrive.report import write_report
from pneudrive.report.speed import verdict
from pneudrive.studies.bracha import Claim


def test_every_sentence_stands_with_its_verdict(made, reproduced, loads_from_elsewhere):
    assert sorted(made.figures) == list(range(1, 10))
    page = (reproduced.folder / "report.html").read_text(encoding="utf-8")
    assert loads_from_elsewhere(page) == []
    for claim in made.claims:
        assert html.escape(claim.said).replace("&#x27;", "&#39;") in page
        assert f">{claim.verdict}<" in page
    assert {"holds", "holds in part", "does not hold"} == {claim.verdict for claim in made.claims}
    positions = [page.index(f'<section id="{key}">') for key in ("recovered", "paper", "stick-slip", "chambers")]
    assert positions == sorted(positions)
    assert 'class="synthetic"' in page
    for rig in made.rigs.values():  # whose values are listed, each with its source
        assert rig.name[1:] in page


def test_the_conclusions_are_checked_by_simulation(made):
    verdicts = {claim.said[:30]: claim.verdict for claim in made.claims}
    assert verdicts["The performance of this drive "] == "holds"
    assert verdicts["size of connectors and length "] == "holds"
    assert verdicts["it is possible to use the pred"] == "holds"
    assert verdicts["A common mathematical model of"] == "holds in part"  # printed equations lose energy


def test_a_verdict_reaches_page_and_summary(made, tmp_path):
    planted = Claim(
        "figure 8", "Lower line is lower pressure", "does not hold", "the lower line is the higher pressure"
    )
    other = replace(made, claims=(planted,), figures={8: made.figures[8]})
    page = write_report(None, {}, tmp_path, other).read_text(encoding="utf-8")
    assert "0 of 1 sentence that can be checked hold, 0 hold in part, 1 does not hold" in page
    assert "The lower line is the higher pressure." in page
    assert "1 does not hold" in verdict(None, {}, other)[0]


def test_printed_chambers_lose_energy_and_the_balance_does_not(made):
    residual = made.chambers.energy_residual_j
    assert residual["energy-balance"] < 1e-3 * made.chambers.stroke_work_j
    assert residual["as-printed"] > 0.05 * made.chambers.stroke_work_j
    assert made.chambers.stroke_time_s["as-printed"] == pytest.approx(
        made.chambers.stroke_time_s["energy-balance"], 0.02
    )
