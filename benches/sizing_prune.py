"""Effect of pruning before a sizing, on random tasks: the removed choices nearest to their bounds are simulated.

    python -m benches.sizing_prune [TASKS]

Each is run fully open at the favourable end of every spread. A choice that keeps its times there would show an unsafe
bound. It is then also tuned and simulated over the spreads. Run it by hand: it is too slow for the tests.
"""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np

from pneudrive.errors import DescriptionError
from pneudrive.sizing.candidate import SafeBounds
from pneudrive.sizing.checks import simulated
from pneudrive.sizing.strokes import DRAWN, DriveStrokes, points, tune
from pneudrive.sizing.task import SizingTask, choices
from trials.sizing_enumerated import combined, shortage

NEAREST = 5
SEED = 5
LOW = ("friction", "load", "mass of the piston", "valve time", "dead volume")


def random_task(rng: np.random.Generator) -> SizingTask:
    """Draw a task."""
    stroke = float(rng.choice([0.05, 0.1, 0.2, 0.4, 0.8]))
    return SizingTask.model_validate(
        {
            "mass": f"{float(np.exp(rng.uniform(np.log(0.3), np.log(40.0)))):.3g} kg",
            "stroke": f"{1e3 * stroke:g} mm",
            "speed": f"{float(np.exp(rng.uniform(np.log(0.15), np.log(2.5)))):.3g} m/s",
            "incline": f"{rng.choice([-90, -30, 0, 0, 0, 45, 90])} deg",
            "external_force": f"{float(rng.choice([0.0, 0.0, 50.0, -50.0])):g} N",
            "tube_length": f"{float(rng.choice([0.3, 1.0, 4.0, 8.0])):g} m",
            "supply": {"pressure": f"{rng.choice([4, 6, 7])} bar gauge"},
        }
    )


def favourable() -> np.ndarray:
    """Return draws at the favourable end: light and heavy, small and large volumes."""
    rows = np.ones((4, len(DRAWN)))
    rows[:, [DRAWN.index(name) for name in LOW]] = 0.0
    rows[1, DRAWN.index("dead volume")] = 1.0
    rows[2, DRAWN.index("load")] = 1.0
    rows[3, [DRAWN.index("dead volume"), DRAWN.index("load")]] = 1.0
    return rows


def main(tasks: int) -> None:
    """Simulate the removed choices that come nearest to their bounds."""
    rng, rows, looked, kept, met = np.random.default_rng(SEED), favourable(), Counter[str](), [], []
    for number in range(tasks):
        try:
            task = random_task(rng)
            found = choices(task)
        except DescriptionError as error:
            print(number, error)
            continue
        bounds = SafeBounds(task, found["tube"])
        pruned = [(one, lacks) for one in combined(found) if (lacks := shortage(bounds, one)) is not None]
        pruned.sort(key=lambda one: -one[1].share)
        near = [[one for one in pruned if one[1].limit == limit][:NEAREST] for limit in ("force", "time")]
        for choice, lacks in near[0] + near[1]:
            strokes = DriveStrokes(choice, task)
            limits = ((True, task.outward_s), (False, task.back_s))
            shares = [(strokes.run(way, rows, np.ones((4, 4))).time / limit).min() for way, limit in limits]
            looked[lacks.limit] += 1
            if max(shares) <= 1.0:
                kept.append((max(shares), choice.name, lacks))
                if simulated(strokes, tune(strokes).setting, points(64))[0].is_feasible:
                    met.append((choice.name, lacks))
        print(number, len(pruned), dict(looked), len(kept), len(met), flush=True)
    print("kept their times at the favourable end:", *kept, sep="\n  ")
    print("met their task:", *met, sep="\n  ")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
