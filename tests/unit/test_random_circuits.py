"""Random circuits of all kinds of component keep the rules of `trials.random_circuits`.

A few here; 2,000 by ``python -m trials.random_circuits --count 2000``.
"""

from __future__ import annotations

from collections import Counter

from pneudrive.describe.kinds import component_kinds
from trials.random_circuits import NOT_DRAWN, case, outcome

SEED, COUNT = 20_000, 100


def test_random_circuits_keep_the_rules():
    kinds, broken = Counter[str](), {}
    for number in range(COUNT):
        drawn, circuit, _ = case(SEED, number)
        one = outcome(drawn, circuit)
        kinds.update(one.kinds)
        if one.broken:
            broken[number] = one.broken
    assert not broken, "\n".join(f"{number}: {what}" for number, what in broken.items())
    # A formula is its author's: test_component_formula holds some against the kinds that they repeat.
    drawn = {kind for kind in component_kinds() if not kind.endswith("/formula") and not kind.startswith(NOT_DRAWN)}
    assert set(kinds) == drawn
