"""The core at its default tolerance against the independent model on random drives (seeded).

More of them: ``python tests/oracle/random_drives.py --count 100``.
"""

import pytest

from oracle.compare import difference, simulated
from oracle.integrate import run
from oracle.random_drives import random_case, remembering_case

DEFAULT_RTOL = 1e-6
# Every kind and both families of laws; 3 reverses without a pause where a switch once was missed by rounding.
SEEDS = (2, 3, 6, 12, 15, 23)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_drive_moves_as_the_independent_model_says(seed):
    case = random_case(seed)
    law = case["drive"]["friction"]["law"]
    want = run(case, "Radau" if law == "lugre" else "DOP853", 1e-9)[1]
    states, _ = simulated(case, DEFAULT_RTOL)
    found = difference(case, states, want)
    assert found.meets(case), found


@pytest.mark.parametrize("seed", [3, 6])
def test_friction_that_remembers_moves_as_the_independent_model_says(seed):
    """Elasto-plastic and LuGre bristles whose contact ages and which relax while they are held."""
    case = remembering_case(seed)
    want = run(case, "Radau", 1e-9)[1]
    states, _ = simulated(case, DEFAULT_RTOL)
    found = difference(case, states, want)
    assert found.meets(case), found


@pytest.mark.parametrize("rtol", [1e-2, 1e-3, 1e-4, 1e-5, 1e-7, 1e-8, 1e-9])
def test_exact_sticking_ends_at_every_tolerance(rtol):
    """As many switches as the motion has, whatever the tolerance: no chatter, and no switch sought for ever."""
    _, statistics = simulated(random_case(3), rtol)
    assert 9 <= statistics["events"] <= 14


def test_the_seeds_cover_every_kind():
    drives = [random_case(seed)["drive"] for seed in SEEDS]
    assert {d["cylinder"]["kind"] for d in drives} == {"rodless", "single-rod", "through-rod"}
    assert {d["friction"]["law"] for d in drives} == {"lugre", "stribeck"}
