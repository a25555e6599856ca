"""The report of a campaign: every part that the data carry, marked where it is synthetic, and nothing else."""

from __future__ import annotations

import html
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from oracle.campaigns import BAR, World, write_campaign
from oracle.stop_campaigns import StopWorld, write_stops
from pneudrive.characteristics import campaign_friction
from pneudrive.report.campaign import write_campaign_report
from pneudrive.studies.bracha.figure import Claim

PRESSURES = ((0.0, 0.0), (1.0 * BAR, 1.0 * BAR))


def append(folder: Path, other: Path) -> None:
    """Put the cycles of one campaign behind those of another."""
    first = len(list((folder / "cycles").glob("*.parquet")))
    for path in sorted((other / "cycles").glob("*.parquet")):
        head = json.loads(pl.read_parquet_metadata(path)["pneudrive"])
        head["index"] += first
        name = f"{head['index']:05d}-{path.stem[6:]}.parquet"
        pl.read_parquet(path).write_parquet(folder / "cycles" / name, metadata={"pneudrive": json.dumps(head)})


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a campaign of sweeps and stops, and its page."""
    folder = tmp_path_factory.mktemp("report")
    world = World(gauges_pa=PRESSURES, air_pa_s_m=4000.0, speeds_m_s=(2e-3, 1e-2, 3e-2, 0.1, 0.3), samples=300)
    write_campaign(folder / "c", world, 1)
    durations = (1.0, 10.0, 100.0)
    write_stops(folder / "s", StopWorld(gauges_pa=PRESSURES, durations_s=durations, repeats=3, samples=400), 1)
    append(folder / "c", folder / "s")
    found = campaign_friction(folder / "c", processes=1)
    (folder / "out").mkdir()
    return found, write_campaign_report(found, folder / "out")


def text_of(page: str) -> str:
    page = re.sub(r"<svg.*?</svg>|<style>.*?</style>|<pre>.*?</pre>", " ", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]+>", " ", page))


def test_every_part_has_its_section_and_its_picture(whole, loads_from_elsewhere):
    found, path = whole
    page = path.read_text(encoding="utf-8")
    keys = set(re.findall(r'<section id="([^"]+)">', page))
    assert {"run", "curves", "air", "pressure", "position", "stops", "drift"} <= keys
    assert {"result", "flags", "budget", "provenance"} <= keys
    assert not loads_from_elsewhere(page)
    pictures = set(re.findall(r'href="(figures/[^"]+\.png)"', page))
    assert {f"figures/campaign-{n}.png" for n in ("curves", "air", "dwell", "stop-traces", "drift")} <= pictures
    assert all((path.parent / name).stat().st_size > 5000 for name in pictures)
    assert "synthetic" in page.split("<nav")[0]  # the verdict says so, not a footnote
    said = text_of(page)
    assert not re.search(r"\bnan\b|\bNone\b|Estimate\(", said)
    for statement in found.statements:
        assert " ".join(str(statement).split()) in " ".join(said.split())


def test_numbers_on_the_page_are_those_of_the_result(whole):
    found, path = whole
    said = text_of(path.read_text(encoding="utf-8"))
    slope = found.dwell[0].slope
    digits = re.search(r"breakaway per decade of stop at 15 s: (-?[\d.]+) ± ([\d.]+) N", said)
    assert [float(x) for x in digits.groups()] == pytest.approx([slope.value, (slope.high - slope.low) / 2], abs=0.06)
    view = found.view()
    effects = {row.key: row for row in view.rows}
    for name, effect in found.effects().items():
        assert name in " ".join(said.split())
        assert np.isclose(effects[name].value, getattr(effect, "value", np.nan), equal_nan=True)
    assert view.state == "open"
    assert {figure.name for figure in view.figures} >= {"campaign-curves", "campaign-dwell", "campaign-drift"}
    for law in found.dwell[0].laws:
        assert law.form.title in said
    air = max(found.air, key=lambda a: a.air_n[-1])
    assert f"{round(float(air.air_n[-1]), 2):.2f} N" in said


def test_campaigns_without_some_parts_are_reported_too(tmp_path):
    sweeps = write_campaign(tmp_path / "sweeps", World(speeds_m_s=(5e-3, 5e-2, 0.2), samples=400, repeats=2), 2)
    identity = json.loads((sweeps / "rig.json").read_text())
    (sweeps / "rig.json").write_text(json.dumps(identity | {"synthetic": False, "pressure_measured_at": "regulator"}))
    stops = write_stops(tmp_path / "stops", StopWorld(durations_s=(1.0,), repeats=1, samples=400), 2)
    for folder in (sweeps, stops):
        out = tmp_path / f"{folder.name}-out"
        out.mkdir()
        page = write_campaign_report(campaign_friction(folder, processes=1), out).read_text(encoding="utf-8")
        if folder is sweeps:
            assert "synthetic" not in text_of(page).lower().replace("friction of", "")
            assert 'id="stops"' not in page
            assert "cannot be separated" in page
        else:
            assert 'id="curves"' not in page
            assert "do not determine" in page


# --- The paper's sentences are checked, not asserted: where the data say no, the report says no.


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
    for rig in made.rigs:  # whose values are listed, each with its source
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
    other = replace(made, claims=(planted,))
    page = other.report().write(tmp_path).read_text(encoding="utf-8")
    assert "0 of 1 sentence that can be checked hold, 0 hold in part, 1 does not hold" in page
    assert "The lower line is the higher pressure." in page
    assert "1 does not hold" in other.report().lines[0].text


def test_printed_chambers_lose_energy_and_the_balance_does_not(made):
    residual = made.chambers.energy_residual_j
    assert residual["energy-balance"] < 1e-3 * made.chambers.stroke_work_j
    assert residual["as-printed"] > 0.05 * made.chambers.stroke_work_j
    assert made.chambers.stroke_time_s["as-printed"] == pytest.approx(
        made.chambers.stroke_time_s["energy-balance"], 0.02
    )
