"""Circuits against an independent model of them, see tests/golden/README.md."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from oracle.circuit_cases import CASES, Case
from oracle.generate_circuits import GOLDEN, model_hash

#: m for positions of masses; of its range for any other column. Asked are 1 um and 1e-4.
POSITION, SHARE = 1e-8, 1e-5
ROOT = Path(__file__).parents[2]


def load(case: Case) -> pn.Circuit:
    return pn.Circuit.load(case.text if "\n" in case.text else ROOT / case.text)


@pytest.mark.parametrize("name", CASES)
def test_a_circuit_runs_as_an_independent_model_of_it_does(name):
    case, golden = CASES[name](), np.load(GOLDEN / f"{name}.npz")
    run = load(case).simulate(
        case.commands or None, case.duration, initial=case.initial, sample_rate=case.rate, rtol=1e-8
    )
    for column in case.columns:
        expected, own = golden[column], run[column]
        bound = POSITION if own.attrs["units"] == "m" else SHARE * np.ptp(expected)
        np.testing.assert_allclose(own, expected, rtol=0.0, atol=bound, err_msg=column)


@pytest.mark.parametrize("name", CASES)
def test_golden_runs_are_those_of_the_model_as_it_stands(name):
    made = json.loads(str(np.load(GOLDEN / f"{name}.npz")["made"]))
    assert made["model_sha256"] == model_hash(), "run python tests/oracle/generate_circuits.py"
    # Two unrelated methods agree, far within the bounds.
    assert max(list(made["greatest_difference_of_range"].values())[1:]) < 0.3 * SHARE
