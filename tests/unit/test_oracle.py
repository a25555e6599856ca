"""The yardstick itself: the oracle against another author's trajectory, its files against its cases."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from oracle.cases import CASES
from oracle.integrate import COLUMNS, run

GOLDEN = Path(__file__).resolve().parent.parent / "golden"


def test_the_oracle_reproduces_an_independently_computed_trajectory():
    """Case A of another author's model (Radau at 1e-12): the same motion to a thousandth of a micrometre."""
    case = json.loads((GOLDEN / "case_a.json").read_text())
    times, states, _ = run(case, "Radau", 1e-9)
    with np.load(GOLDEN / "case_a_reference.npz") as reference:
        np.testing.assert_allclose(times, reference["time_s"], rtol=0, atol=1e-12)
        assert np.abs(states[:, 0] - reference["position_m"]).max() < 1e-9
        for i in (2, 3, 4, 5):
            np.testing.assert_allclose(states[:, i], reference[COLUMNS[i]], rtol=1e-8)


@pytest.mark.parametrize("name", sorted(CASES))
def test_a_golden_file_belongs_to_the_case_that_the_code_describes(name):
    """A case that was edited without writing its trajectory again would compare nothing."""
    stored = json.loads((GOLDEN / f"{name}.json").read_text())
    case = CASES[name]()
    assert {key: stored[key] for key in case} == json.loads(json.dumps(case))
    with np.load(GOLDEN / f"{name}.npz") as data:
        samples = round(case["duration_s"] * case["sample_rate_hz"]) + 1
        assert {c: data[c].shape for c in data.files} == dict.fromkeys(COLUMNS, (samples,))
        assert (data["pressure_a_pa"] > 0).all()
        # the columns are where their names say: the file starts in the initial state
        for column in COLUMNS:
            assert data[column][0] == pytest.approx(case["initial"][column], rel=1e-10)
