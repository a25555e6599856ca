"""How often 95 % intervals of the static fit hold the truth: 1000 seeded simulated maps.

Run ``python -m oracle.fit_coverage [runs]`` in ``tests``. The truth and the noise are those of the Fisher table of the
theory: Fc 30 N, Fs 40 N, vs 12 mm/s, Fv 60 N s/m; 20 speeds from 1 to 450 mm/s in logarithmic steps; 0.5 N. Simulated
data only: what a real seal does besides is not in it.
"""

from __future__ import annotations

import sys

import numpy as np

from pneudrive import _core
from pneudrive.identify.static.fit import fit_values
from pneudrive.identify.static.model import FrictionModel, Observations

TRUTH = {"coulomb": 30.0, "breakaway": 40.0, "stribeck_velocity": 0.012, "stribeck_exponent": 2.0, "viscous": 60.0}
SPEED = np.geomspace(1e-3, 0.45, 20)
NOISE_N = 0.5
CASES = {
    "exponent fixed": FrictionModel("stribeck"),
    "exponent free": FrictionModel("stribeck", exponent=None),
}


def holds(model: FrictionModel, seed: int) -> dict[str, bool]:
    """Whether each free parameter's interval holds the truth in one simulated map; what is undetermined has none."""
    rng = np.random.default_rng([2018, 5, seed])
    exact = _core.steady_friction("stribeck", TRUTH, SPEED)
    zero, one = np.zeros(SPEED.size), np.ones(SPEED.size)
    friction = exact + NOISE_N * rng.standard_normal(SPEED.size)
    data = Observations(SPEED, friction, NOISE_N * one, zero, zero, zero, np.arange(SPEED.size))
    fit = fit_values(model, data)
    return {n: low <= TRUTH[n] <= high for n, (low, high) in fit.intervals.items()}


def coverage(model: FrictionModel, runs: int, first: int = 0) -> dict[str, float]:
    """Share of the intervals of each parameter in `runs` that hold the truth."""
    found = [holds(model, seed) for seed in range(first, first + runs)]
    return {n: float(np.mean([one[n] for one in found if n in one])) for n in model.names}


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    for title, law in CASES.items():
        shares = ", ".join(f"{n} {100 * share:.1f} %" for n, share in coverage(law, count).items())
        sys.stdout.write(f"{title}, {count} runs: {shares}\n")
