"""Page of results of control: measure random axes and the axes of the examples, or write the page from stored values.

    python -m benches.control_results [--measure random|examples] [--axes 28] [--seeds 5]

With `random` it measures all laws on random axes, and with `examples` `nmpc` on P1, P2, P3 and P3h. All is simulated.
`benches/control_results.json` has the measured values, `docs/guide/control-results.md` shows them.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import pneudrive as pn
from benches.control_goals import AXES, EXAMPLES

VALUES = Path(__file__).with_suffix(".json")
PAGE = Path(__file__).parents[1] / "docs/guide/control-results.md"
ALONG = ("R1", "R2", "R3")
#: Name of a study -> mismatch of the drive from its description.
STUDIES = {"as described": None, "all": "all", "mass 0.5": "mass-50", "mass 1.6": "mass+60"}
#: Laws of friction of the true drives; the controllers know a LuGre law.
FRICTION = ("lugre", "elasto-plastic", "stribeck", "dahl", "bouc-wen", "coulomb")
#: An error within this factor of the smallest one counts as equally good.
NEAR = 1.3
HEAD = """# Errors of the controllers

With this page you can look up how closely the controllers follow a reference. **All of it is simulated.**
`python -m benches.control_results` writes this page. [](control.md) explains the controllers and the references.

## Random axes

{count} axes are drawn at random: bore 16 to 80 mm, stroke 200 to 600 mm, spool 19 to 124 Hz, dead time 0.5 to 3 ms.
A controller gets a description that differs from the true drive in all of these values at once:

| | described value / true value |
|---|---|
| mass | 0.5 to 1.6 |
| friction | 0.5 to 2 |
| conductance of the valve | 0.8 to 1.2 |
| supply pressure | 0.8 to 1.1 |
| dead time | 0.8 to 1.4 |
| frequency of the spool | 0.75 to 1.2 |

The friction law differs, too: the description has a LuGre law, and the drives have one of {laws}.
The instrumentation is `real`. The references are R1, R2, R3 and S1. S1 is a sine like R1, with 0.3 Hz. References that
the described valve cannot follow are left out.
"""
EXAMPLE_HEAD = """
## Axes of the examples

The table has the largest errors of `nmpc` in µm with the instrumentation `real`. Along the sines R1 and R2 they are the
errors in the last 4 s, along R3 the errors in the whole run. The values are medians of {seeds} seeds. Peaks of fast
moves differ by 30 % between seeds. The axes are files of `examples`:

- P1 is `controlled_axis.toml`, and P2 is `axes/bench.toml`.
- P3 is `axes/starter.toml`, a light piston with a sticky seal. P3h is `axes/starter_heavy.toml` with 4 kg more.

| axis | drive | R1 | R2 | R3 |
|---|---|---|---|---|
"""


def random_axis(seed: int) -> tuple[str, dict[str, object]]:
    """Return the circuit file of an axis with assumed values, and the values of the true drive as a mismatch."""
    generator = np.random.default_rng(seed)

    def even(low: float, high: float) -> float:
        return float(generator.uniform(low, high))

    def by_ratio(low: float, high: float) -> float:
        return math.exp(even(math.log(low), math.log(high)))

    bore = by_ratio(0.016, 0.08)
    area = math.pi / 4.0 * bore**2
    force = 6e5 * area  # of 6 bar
    stroke, mass, speed = even(0.2, 0.6), force / by_ratio(40.0, 200.0), even(1.2, 3.5)
    # Steady speed at full opening with choked exhaust, C rho_0 R T/A.
    conductance = speed * area / (1.185 * 287.0 * 293.15)
    coulomb = even(0.03, 0.1) * force
    breakaway = even(1.1, 1.8) * coulomb
    stribeck, viscous = by_ratio(5.0, 40.0), even(0.03, 0.15) * force
    spool, delay = by_ratio(19.0, 124.0), by_ratio(0.5, 3.0)
    overlap, leakage, hysteresis = even(0.005, 0.03), even(0.001, 0.005), even(0.0, 0.006)
    dead = even(0.03, 0.1) * area * stroke
    text = f"""schema = 1
name = "random axis {seed}"
connections = ["supply -> valve.1", "valve.4 -> cylinder.a", "valve.2 -> cylinder.b"]

[components.supply]
kind = "reservoir"
pressure = "7 bar abs"

[components.valve]
kind = "valve/proportional-5/3"
conductance = "{1e8 * conductance:.4g} dm3/(s bar)"
critical_pressure_ratio = 0.3
frequency = "{spool:.4g} Hz"
damping_ratio = 0.7
delay = "{delay:.4g} ms"
overlap = {overlap:.4g}
leakage = {leakage:.4g}
hysteresis = {hysteresis:.4g}

[components.cylinder]
kind = "cylinder/rodless"
bore = "{1e3 * bore:.4g} mm"
stroke = "{1e3 * stroke:.4g} mm"
dead_volume_a = "{1e6 * dead:.4g} cm3"
dead_volume_b = "{1e6 * dead:.4g} cm3"
moving_mass = "{mass:.4g} kg"
heat_transfer = "30 W/(m2 K)"

[components.cylinder.friction]
law = "lugre"
coulomb = "{coulomb:.4g} N"
breakaway = "{breakaway:.4g} N"
stribeck_velocity = "{stribeck:.4g} mm/s"
viscous = "{viscous:.4g} N s/m"
bristle_stiffness = "{3e3 * breakaway:.4g} N/m"
bristle_damping = "{8.0 * breakaway:.4g} N s/m"
"""
    truth: dict[str, object] = {
        "moving_mass": 1.0 / even(0.5, 1.6),
        "friction_level": 1.0 / even(0.5, 2.0),
        "conductance": 1.0 / even(0.8, 1.2),
        "supply_pressure": 1.0 / even(0.8, 1.1),
        "delay": f"{delay / even(0.8, 1.4):.4g} ms",
        "spool_frequency": f"{spool / even(0.75, 1.2):.4g} Hz",
    }
    law = FRICTION[seed % len(FRICTION)]
    return text, truth if law == FRICTION[0] else truth | {"friction_law": law}


def cells(count: int) -> Iterator[dict[str, Any]]:
    """Yield the largest error, mm, of each law on each random axis along each reference; None if a run is lost."""
    for seed in range(1, count + 1):
        text, truth = random_axis(seed)
        drive = pn.Circuit.load(text)
        tuning, standard = pn.control.tune(drive), pn.control.standard(drive)
        slow = standard["R1"].text.replace("0.5 Hz", "0.3 Hz")
        for name, along in [*((name, standard[name]) for name in ALONG), ("S1", pn.control.reference(slow))]:
            if not pn.control.feasibility(tuning, along).is_feasible:
                continue
            for kind, mismatch in (("described", None), ("different", pn.control.Mismatch.model_validate(truth))):
                errors = {}
                for law in pn.control.laws():
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")
                        score = pn.control.run(drive, law, reference=along, mismatch=mismatch).attrs["score"]
                    errors[law] = None if score["lost"] else 1e3 * score["max_error_m"]
                yield {"seed": seed, "along": name, "drive": kind, "errors_mm": errors}


def random_table(found: list[dict[str, Any]]) -> Iterator[str]:
    """Yield the rows of the tables of random axes."""
    for kind, title in (
        ("different", "if description and drive differ"),
        ("described", "if the drive is as described"),
    ):
        rows = [own for own in found if own["drive"] == kind]
        errors = {law: [own["errors_mm"][law] or math.inf for own in rows] for law in pn.control.laws()}
        best = [min(each) for each in zip(*errors.values(), strict=True)]
        yield f"\nLargest errors in mm {title}, from {len(rows)} runs of each controller:\n"
        names = sorted({own["along"] for own in rows})
        heads = [f"{name}, median" for name in names] + ["95 % of all below", f"within {NEAR:g} of the best", "lost"]
        yield f"| controller | {' | '.join(heads)} |\n|---|{'---|' * len(heads)}"
        for law, own in errors.items():
            middle = [
                statistics.median(e for e, row in zip(own, rows, strict=True) if row["along"] == a) for a in names
            ]
            near = sum(e <= NEAR * least for e, least in zip(own, best, strict=True)) / len(own)
            high = float(np.quantile(own, 0.95, method="higher"))
            numbers = [f"{value:.2g}" if math.isfinite(value) else "lost" for value in (*middle, high)]
            yield f"| `{law}` | {' | '.join(numbers)} | {100.0 * near:.0f} % | {own.count(math.inf)} |"


def measure(axis: str, seeds: int) -> dict[str, dict[str, float]]:
    """Return the median error, um, of each study and reference."""
    drive = pn.Circuit.load(EXAMPLES / f"{AXES[axis]}.toml")
    along = pn.control.standard(drive)

    def error_um(mismatch: str | None, reference: str, seed: int) -> float:
        run = pn.control.run(drive, "nmpc", reference=along[reference], mismatch=mismatch, seed=seed)
        return 1e6 * float(run.attrs["score"]["max_error_m"])

    return {
        name: {
            reference: round(statistics.median(error_um(mismatch, reference, 1 + i) for i in range(seeds)))
            for reference in ALONG
        }
        for name, mismatch in STUDIES.items()
    }


def page(values: dict[str, Any]) -> str:
    """Return the page."""
    head = HEAD.format(count=values["count"], laws=", ".join(f"`{law}`" for law in FRICTION))
    rows = [
        f"| {axis} | {study} | " + " | ".join(f"{errors[reference]:g}" for reference in ALONG) + " |"
        for axis, studies in values["axes"].items()
        for study, errors in studies.items()
    ]
    random = "\n".join(random_table(values["random"]))
    return f"{head}{random}\n{EXAMPLE_HEAD.format(seeds=values['seeds'])}" + "\n".join(rows) + "\n"


def main() -> None:
    """Measure if asked to, and write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--measure", choices=("random", "examples"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--axes", type=int, default=28, help="number of random axes")
    asked = parser.parse_args()
    values = json.loads(VALUES.read_text(encoding="utf-8"))
    if asked.measure == "random":
        values |= {"count": asked.axes, "random": list(cells(asked.axes))}
    elif asked.measure == "examples":
        values |= {
            "seeds": asked.seeds,
            "axes": {axis: measure(axis, asked.seeds) for axis in ("P1", "P2", "P3", "P3h")},
        }
    VALUES.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(page(values), encoding="utf-8")


if __name__ == "__main__":
    main()
