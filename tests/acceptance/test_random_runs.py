"""Random drives of every law, sensible ones and corners, keep the rules of `oracle.random_runs`.

Two hundred of each kind here; 20,000 by ``python tests/oracle/random_runs.py --count 20000``.
"""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from oracle.random_runs import MOST_SECONDS, case, outcome

SEED = 20_000
#: Corners that may stop: of this few, three times the share of the whole sweep.
MOST_STOPPED = 6


@pytest.mark.parametrize("kind", ["sensible", "corners"])
def test_random_drives_keep_the_rules(kind):
    numbers = range(0 if kind == "sensible" else 1, 400, 2)
    outcomes = {number: outcome(case(SEED, number)) for number in numbers}
    # A loaded machine is slow: the time is held to its rule by the sweep alone, work by the budget of each run.
    broken = {
        number: what
        for number, one in outcomes.items()
        if (what := [line for line in one.broken if "of processor" not in line])
    }
    assert not broken, "\n".join(f"{number}: {what}" for number, what in broken.items())
    assert sum(bool(one.stopped) for one in outcomes.values()) <= (0 if kind == "sensible" else MOST_STOPPED)
    assert min(Counter(one.law for one in outcomes.values()).values()) >= 5
    assert sum(one.seconds for one in outcomes.values()) < 200 * MOST_SECONDS


def test_the_ledger_changes_no_bit_and_no_step_of_a_corner():
    """Trial stages outside the physics, whose accounts are no numbers, are rejected by the states alone."""
    for number in range(1, 80, 2):
        drawn = case(SEED, number)
        try:
            runs = [drawn.run(ledger=ledger) for ledger in (False, True)]
        except Exception:
            continue
        plain, kept = (one.columns for one in runs)
        assert runs[0].provenance["statistics"] == runs[1].provenance["statistics"]
        assert all(np.array_equal(plain[name], kept[name]) for name in plain)


@pytest.mark.parametrize(
    ("seed", "number"),
    [
        pytest.param(9091, 10985, id="lugre, with relaxation"),
        pytest.param(9091, 14551, id="lugre, levels that follow the pressure"),
        pytest.param(9091, 4621, id="elasto-plastic, reversals within a step"),
        pytest.param(777, 367, id="elasto-plastic, hardly any energy"),
        pytest.param(9091, 10955, id="hardly any energy beside what is stored"),
    ],
)
def test_energy_closes_where_bristles_are_far_steeper_than_the_step(seed, number):
    """What bristle damping takes is the integral of its force over the deflection, however fast that follows."""
    assert not [what for what in outcome(case(seed, number)).broken if "energy" in what]


@pytest.mark.parametrize(("seed", "number"), [(777, 1635), (31, 253)])
def test_an_element_that_slips_within_nanometres_is_resolved(seed, number):
    """An error of a deflection at its tolerance must not carry an element of gms far beyond its limit."""
    assert not outcome(case(seed, number)).stopped


def test_energy_that_does_not_close_is_told():
    """Thousands of bounces between two cushions of gas: at a coarse tolerance their energy is lost step by step."""
    drawn = case(9091, 3817)
    for rtol, told in ((drawn.rtol, True), (1e-8, False)):
        warnings = replace(drawn, rtol=rtol).run().provenance["warnings"]
        assert any("energy closes only to" in warning for warning in warnings) == told
