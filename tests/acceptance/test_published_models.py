"""Two published models with all their parameters: our circuits give their results, also with our default end stop."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

import pneudrive as pn

ROOT = Path(__file__).parents[2]
MODELS = runpy.run_path(str(ROOT / "tools" / "published_models.py"))


def test_published_results():
    rows = MODELS["rows"]()
    assert len(rows) == 20
    assert {f"{row.model}, {row.quantity}": row.off for row in rows if abs(row.off) > 1.2} == {}


def test_a_default_end_stop_does_not_follow_large_dead_volumes():
    """Behind 100 mm of dead length, 45 kN pressed the piston 20 mm through the end: 0.62 s instead of 0.59 s."""
    text = (ROOT / "data/published-models/valve_actuator.toml").read_text("utf-8")
    circuit = pn.Circuit.load(text.replace('end_stop = { stiffness = "1e9 N/m" }\n', ""))
    published = [value for _, _, value in MODELS["VALVE"]]
    assert MODELS["valve"](circuit) == pytest.approx(published, rel=0.012)
    run = pn.simulate(circuit, None, "1.2 s", initial=MODELS["VALVE_START"], sample_rate="2 kHz")
    assert run["cyl.position"].min() > -1e-3
    assert run["cyl.position"][-1] < 38.1e-3 + 1e-3
