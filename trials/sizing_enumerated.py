"""Random small tasks, each sized by the pruned search and by full enumeration: the winners have to be the same.

    python -m trials.sizing_enumerated --count 50 --seed 1

A task draws two cylinders, two valves, two tubes and a flow control of the catalogue, which may also be left out.
Enumeration tunes every combination and simulates 1,024 draws of it. The search prunes some by bounds of force and time,
and leaves others out at its end. A combination that fails the nominal case is not simulated further.
Both leave out combinations that a sheet forbids, because no simulation shows another stroke or a coupling that yields.
"""

from __future__ import annotations

import sys
from itertools import product
from typing import Any

import numpy as np

from pneudrive.describe.files.catalogue import entries
from pneudrive.sizing.candidate import SafeBounds, Shortage
from pneudrive.sizing.checks import PROBABILITY, SizedDrive, simulated
from pneudrive.sizing.search import size
from pneudrive.sizing.strokes import RTOL, DriveStrokes, Setting, points, tune
from pneudrive.sizing.task import SLOTS, DriveChoice, Parts, SizingTask, choices
from trials.shares import options

DRAWS, FIRST = 1024, 64
BOUNDS = ("force", "time")
TAKEN = {"cylinder": 2, "valve": 2, "tube": 2, "flow_control": 1}


def random_task(rng: np.random.Generator) -> SizingTask:
    """Return a task that some of its parts do, more often than not."""
    known = {name: one.kind for name, one in entries().items() if not one.is_drive}
    taken = set()
    for slot, kinds in SLOTS.items():
        names = sorted(name for name, kind in known.items() if kind in kinds)
        taken |= set(rng.choice(names, TAKEN[slot], replace=False))
    stroke = float(rng.choice([0.05, 0.1, 0.2, 0.4]))
    given: dict[str, Any] = {
        "mass": f"{10.0 ** rng.uniform(-0.3, 1.2):.3g} kg",
        "stroke": f"{stroke} m",
        "time": f"{stroke / 10.0 ** rng.uniform(-1.0, 0.0) + 0.05:.3g} s",
        "incline": f"{rng.choice([-90, 0, 0, 0, 30, 90])} deg",
        "tube_length": f"{rng.uniform(0.3, 3.0):.2g} m",
        "guide": str(rng.choice(["none", "ball"])),
        "supply": {"pressure": "6 bar gauge", "spread": f"{rng.uniform(0.0, 0.6):.2g} bar"},
        "exclude": sorted(set(known) - taken),
        "servo_valves": True,
    }
    if rng.random() < 0.5:
        given["end_speed"] = f"{rng.uniform(0.3, 1.5):.2g} m/s"
    if rng.random() < 0.3:
        given["holding_force"] = f"{rng.uniform(20.0, 300.0):.3g} N"
    return SizingTask(**given)


def enumerated(strokes: DriveStrokes, setting: Setting) -> SizedDrive | None:
    """Simulate all draws of a choice; None as soon as more of them fail than may fail of all."""
    first = simulated(strokes, setting, points(DRAWS)[:FIRST], RTOL)[0]
    if first.draws - first.met > (1.0 - PROBABILITY) * DRAWS:
        return None
    return simulated(strokes, setting, points(DRAWS), RTOL)[0]


def combined(parts: Parts) -> list[DriveChoice]:
    """Return all combinations of parts."""
    return [DriveChoice(*each) for each in product(*(parts[slot] for slot in SLOTS))]


def shortage(bounds: SafeBounds, choice: DriveChoice) -> Shortage | None:
    """Return the reason why a choice cannot do the task, or None."""
    found = bounds.part(choice.valve) or bounds.part(choice.tube) or bounds.part(choice.flow_control)
    return found or bounds.cylinder(choice.cylinder) or bounds.fits(choice)


def compared(task: SizingTask) -> tuple[bool, str]:
    """Return whether search and enumeration agree on a task, and what they found."""
    found = size(task)
    parts = choices(task)
    bounds = SafeBounds(task, parts["tube"])
    lacks = [(choice, shortage(bounds, choice)) for choice in combined(parts)]
    cut = {choice.name for choice, lack in lacks if lack is not None and lack.limit in BOUNDS}
    made = [DriveStrokes(one, task) for one, lack in lacks if lack is None or lack.limit in BOUNDS]
    tuned = [(one, tune(one)) for one in made]
    every = [
        one for strokes, own in tuned if own.nominal >= 0.0 if (one := enumerated(strokes, own.setting)) is not None
    ]
    feasible = [one for one in every if one.is_feasible]
    wrong = [one.name for one in feasible if one.name in cut]
    best = min(feasible, key=lambda one: one.rank, default=None)
    same = (found.best is None) == (best is None) and (best is None or found.best.rank == best.rank)  # type: ignore[union-attr]
    said = f"{len(feasible):2} of {len(made):2} feasible, {len(cut):2} pruned, {len(found.simulated):2} simulated"
    if best is not None:
        said += f", best {best.name}"
    if not same:
        said += f"; the search found {None if found.best is None else found.best.name}"
    return same and not wrong, said + (f"; pruned but feasible: {wrong}" if wrong else "")


def main() -> None:
    """Compare tasks; the exit status is 1 if one does not agree."""
    asked = options(__doc__, 50)
    rng, bad = np.random.default_rng(asked.seed), 0
    for number in range(asked.count):
        agrees, said = compared(random_task(rng))
        bad += not agrees
        sys.stdout.write(f"{number + 1:3} {'same ' if agrees else 'WRONG'} {said}\n")
        sys.stdout.flush()
    sys.stdout.write(f"{asked.count - bad} of {asked.count} tasks agree\n")
    sys.exit(bad > 0)


if __name__ == "__main__":
    main()
