"""The yardstick itself: the oracle against another author's trajectory, its files against its cases."""

from __future__ import annotations

import numpy as np
import pytest

from oracle.cases import CASES, GOLDEN
from oracle.integrate import COLUMNS, run


def test_the_oracle_reproduces_an_independently_computed_trajectory():
    """Case A of another author's model (Radau at 1e-12): the same motion to a thousandth of a micrometre."""
    times, states, _ = run(CASES["case_a"], "Radau", 1e-9)
    with np.load(GOLDEN / "case_a_reference.npz") as reference:
        np.testing.assert_allclose(times, reference["time_s"], rtol=0, atol=1e-12)
        assert np.abs(states[:, 0] - reference["position_m"]).max() < 1e-9
        for i in (2, 3, 4, 5):
            np.testing.assert_allclose(states[:, i], reference[COLUMNS[i]], rtol=1e-8)


@pytest.mark.parametrize("name", CASES)
def test_a_golden_trajectory_has_the_samples_of_its_case_from_its_start_on(name):
    case = CASES[name]
    samples = round(case["duration_s"] * case["sample_rate_hz"]) + 1
    with np.load(GOLDEN / f"{name}.npz") as data:
        assert {c: data[c].shape for c in data.files} == dict.fromkeys(COLUMNS, (samples,))
        assert (data["pressure_a_pa"] > 0).all()
        for column in COLUMNS:
            assert data[column][0] == pytest.approx(case["initial"][column], rel=1e-10)
