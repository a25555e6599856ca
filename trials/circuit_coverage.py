"""Coverage of the truth by the intervals of numbers identified in a circuit.

    python -m trials.circuit_coverage --count 43 --seed 1

A valve with spool, dead time, hysteresis and overlap moves a piston under steps of the command, through tubes of either
model, with Stribeck or LuGre friction. Position and pressures carry noise. The search begins 10 to 30 % away from
the truth. The exit status is 1 if a search does not converge. It is also 1 unless 93 to 97 % of the determined values
are in their 95 % intervals.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

import pneudrive as pn
from pneudrive.free.parameters import numbers_of
from trials.shares import is_within, options

BASE = Path(__file__).parents[1] / "tests" / "data" / "servo_circuit.toml"
LUGRE = {"law": "lugre", "bristle_stiffness": "2e6 N/m", "bristle_damping": "400 N s/m"}
#: Number that is drawn and identified -> smallest and largest value, and unit.
FREE = {
    "supply.pressure": (6.0, 8.0, "bar abs"),
    "valve.frequency": (30.0, 130.0, "Hz"),
    "valve.delay": (1.0, 6.0, "ms"),
    "valve.hysteresis": (0.003, 0.02, ""),
    "valve.overlap": (-0.02, 0.05, ""),
    "axis.friction.coulomb": (9.0, 18.0, "N"),
    "axis.friction.viscous": (20.0, 80.0, "N s/m"),
    "axis.moving_mass": (1.0, 6.0, "kg"),
    "axis.dead_volume_a": (6.0, 20.0, "cm3"),
    "axis.dead_volume_b": (6.0, 20.0, "cm3"),
}
NOISE = {"axis.position_m": 5e-6, "axis.a.pressure_pa": 300.0, "axis.b.pressure_pa": 300.0}
START = {"axis.position": "140 mm", "axis.a": "3 bar abs", "axis.b": "3 bar abs"}


def trial(seed: int) -> tuple[bool, list[bool]]:
    """Return whether the search converged, and whether each determined value is in its interval."""
    rng, tables = np.random.default_rng(seed), tomllib.loads(BASE.read_text("utf-8"))
    tables["components"]["hose"]["kind"] = str(rng.choice(["tube", "tube/lumped"]))
    tables["components"]["axis"]["friction"] |= LUGRE if rng.random() < 0.5 else {}

    def with_numbers(values: dict[str, float]) -> pn.Circuit:
        units = {name: unit for name, (_, _, unit) in FREE.items() if unit}
        return pn.Circuit(**tables).replace(values | {name: f"{values[name]} {unit}" for name, unit in units.items()})

    true = {name: rng.uniform(low, high) for name, (low, high, _) in FREE.items()}
    steps = [(0.0, 0.0), *((round(0.1 + 0.33 * i, 2), (-1) ** i * rng.choice([0.1, 0.2, 0.35, 0.6])) for i in range(9))]
    truth = with_numbers(true)
    run = truth.simulate({"valve": steps}, 3.2, initial=START, rtol=1e-9)
    recording = {"time_s": run.time.to_numpy(), "valve.command": run["valve.command"].to_numpy()}
    for name, noise in NOISE.items():
        recording[name] = run[name.rpartition("_")[0]].to_numpy() + noise * rng.standard_normal(run.sizes["time"])
    begun = {name: value * (1.0 + rng.choice([-1, 1]) * rng.uniform(0.1, 0.3)) for name, value in true.items()}
    fit = pn.identify(with_numbers(begun), recording, list(FREE))
    exact = numbers_of(truth)
    inside = [low <= exact[name].value <= high for name, (low, high) in fit.intervals.items()]
    sys.stdout.write(f"{seed}: {sum(inside)} of {len(inside)} inside, converged: {fit.converged}\n")
    return fit.converged, inside


def main() -> None:
    """Print the fractions."""
    given = options(__doc__, 43)
    converged, inside = zip(*map(trial, range(given.seed, given.seed + given.count)), strict=True)
    sys.exit(not (is_within("values inside", np.concatenate(inside), 0.93, 0.97) and all(converged)))


if __name__ == "__main__":
    main()
