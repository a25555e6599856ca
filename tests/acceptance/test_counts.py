"""The solver's work, exactly: a performance test that no busy machine can upset."""

import importlib
import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def benches():
    sys.path.insert(0, str(ROOT))
    try:
        yield importlib.import_module("benches.counts")
    finally:
        sys.path.remove(str(ROOT))


def test_the_solver_takes_exactly_the_steps_that_it_took(benches):
    """Not a bound but a snapshot: fewer steps are a change of the output as well, and belong in the changelog."""
    assert benches.counts() == json.loads(benches.SNAPSHOT.read_text()), "python -m benches.counts, and say why"


def test_an_open_loop_takes_few_attempts(benches):
    """A bound beside the snapshot: case A in fewer than 700 attempts at the default tolerance."""
    found = benches.count("case_a", 1e-6)
    assert found["steps"] + found["rejected"] < 700
    assert found["right_hand_sides"] <= 8 * (found["steps"] + found["rejected"])


def test_sampled_control_takes_one_step_a_sample(benches):
    """The step size is kept over the command steps: no start-up at each of 10,000 samples."""
    found = benches.count("case_c", 1e-4)
    assert 10_000 <= found["steps"] < 10_100
    assert found["rejected"] < 100
    # Two beside the one that comes with the Jacobian, where the method of low order takes the step.
    assert found["right_hand_sides"] < 2.5 * found["steps"]
