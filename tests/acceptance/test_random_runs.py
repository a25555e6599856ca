"""Random drives of every law, sensible ones and corners, keep the rules of `trials.random_runs`.

Some of each kind here; 10,000 by ``make trials``.
"""

from __future__ import annotations

import json
from importlib import import_module

import numpy as np
import pytest

from benches import counts
from oracle.compare import difference, simulated
from oracle.integrate import run
from trials.random_drives import random_case, remembering_case
from trials.random_runs import ENERGY_CLOSES, ENERGY_RTOL, LAWS, MOST_SECONDS, broken, case, outcome

SEED = 20_000
#: Corners that may stop: of this few, three times the share of the whole sweep.
MOST_STOPPED = 2


@pytest.mark.parametrize("kind", ["sensible", "corners"])
def test_random_drives_keep_the_rules(kind):
    numbers = range(0, 64, 2) if kind == "sensible" else range(1, 96, 2)  # as many as it takes to meet every law
    outcomes = {number: outcome(case(SEED, number)) for number in numbers}
    # A loaded machine is slow: the time is held to its rule by the sweep alone, work by the budget of each run.
    wrong = {
        number: what
        for number, one in outcomes.items()
        if (what := [line for line in one.broken if "of processor" not in line])
    }
    assert not wrong, "\n".join(f"{number}: {what}" for number, what in wrong.items())
    assert sum(bool(one.stopped) for one in outcomes.values()) <= (0 if kind == "sensible" else MOST_STOPPED)
    assert {one.law for one in outcomes.values()} == set(LAWS)
    assert sum(one.seconds for one in outcomes.values()) < len(numbers) * MOST_SECONDS


def test_the_ledger_changes_no_bit_and_no_step_of_a_corner():
    """Trial stages outside the physics, whose accounts are no numbers, are rejected by the states alone."""
    for number in range(1, 24, 2):
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
        pytest.param(9391, 6013, id="a mass that brings more energy than is turned over"),
        pytest.param(9091, 4501, id="a fast start, braked by waves of friction"),
        pytest.param(9777, 1435, id="microjoules: a piston that trembles on its stop"),
        pytest.param(9091, 15895, id="the same with bristles"),
    ],
)
def test_energy_closes(seed, number):
    """What bristle damping takes is the integral of its force over the deflection, however fast that follows.

    What swings between mass, gas and stop is in no account, and a gas is known to its tolerance.
    """
    assert not [what for what in outcome(case(seed, number)).broken if "energy" in what]


@pytest.mark.parametrize(("seed", "number"), [(9091, 3817), (9391, 6079)])
def test_a_piston_that_bounces_on_and_on_keeps_its_energy(seed, number):
    """Thousands of bounces between two cushions of gas, also at a finer tolerance.

    Errors of steps have one sign there: without a share of the tolerance that falls they add up beyond the rule.
    """
    drawn = case(seed, number)
    done = drawn.run()
    assert done.provenance["statistics"]["events"] > 1000
    assert not [what for what in broken(drawn, done) if "energy" in what]


@pytest.mark.parametrize(("seed", "number"), [(777, 1635), (31, 253)])
def test_an_element_that_slips_within_nanometres_is_resolved(seed, number):
    """An error of a deflection at its tolerance must not carry an element of gms far beyond its limit."""
    assert not outcome(case(seed, number)).stopped


def test_energy_that_does_not_close_is_told(monkeypatch):
    """No run of these tests is as far off as the rule, so that the rule is taken nearer."""
    drawn, simulate = case(9091, 3817), import_module("pneudrive.simulation.simulate")
    for closes, told in ((1e-3, False), (1e-9, True)):
        monkeypatch.setattr(simulate, "ENERGY_CLOSES", closes)
        monkeypatch.setattr(simulate, "ENERGY_RTOL", closes / ENERGY_CLOSES * ENERGY_RTOL)
        warnings = drawn.run().provenance["warnings"]
        assert any("the energy balance has an error of" in warning for warning in warnings) == told


# --- The core at its default tolerance against the independent model on random drives (seeded).
#
# More of them: ``make trials``.

DEFAULT_RTOL = 1e-6
# Every kind and both families of laws; 3 reverses without a pause where a switch once was missed by rounding.
SEEDS = (2, 3, 6, 15, 23)


@pytest.mark.parametrize(("draw", "seed"), [*((random_case, seed) for seed in SEEDS), (remembering_case, 6)])
def test_a_random_drive_moves_as_the_independent_model_says(draw, seed):
    """Also with bristles whose contact ages and which relax while they are held."""
    case = draw(seed)
    want = run(case, "DOP853" if case["drive"]["friction"]["law"] == "stribeck" else "Radau", 1e-9)[1]
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


# --- The solver's work, exactly: a performance test that no busy machine can upset.


def test_the_solver_takes_exactly_the_steps_that_it_took():
    """Not a bound but a snapshot: fewer steps are a change of the output as well, and belong in the changelog."""
    assert counts.counts() == json.loads(counts.SNAPSHOT.read_text()), "python -m benches.counts, and say why"
