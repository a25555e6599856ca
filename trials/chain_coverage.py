"""Coverage of the truth of a simulated rig by the intervals of a fit to its noisy recordings.

    python -m trials.chain_coverage --count 100 --seed 1

Recordings with the noise of the sensors are characterised and fitted. Each of Fc, Fs, vs and Fv lies inside its 95 %
interval in at least 35 of 40 runs. The median half-width is at most 1.5 times the Cramer-Rao bound, which is computed
here from the sensors' noise alone. The exit status is 1 if one of both does not hold.
"""

from __future__ import annotations

import sys

import numpy as np

import pneudrive as pn
from pneudrive.rig import SimulatedRig
from trials.cramer_rao import half_widths
from trials.shares import is_within, options

NAMES = ("coulomb", "breakaway", "stribeck_velocity", "viscous")
SPEED = np.geomspace(1e-3, 0.45, 12)
GAUGE_PA, CYCLES = 0.5e5, 3
LEAST, WIDEST = 35 / 40, 1.5


def noise_of_one_sample(rig: SimulatedRig) -> float:
    """Return the noise of the force balance, N: of force and both pressures, each with the steps of its converter."""
    about = rig.description
    force = np.hypot(about.force_sensor.noise, about.force_sensor.step / 12**0.5)
    pressure = np.hypot(about.pressure_sensor.noise, about.pressure_sensor.step / 12**0.5) * about.areas_m2[0]
    return float(np.sqrt(force**2 + 2.0 * pressure**2))


def hits(seeds: range) -> tuple[dict[str, list[bool]], dict[str, float]]:
    """Return whether each interval contains the truth, and median half-widths over the Cramer-Rao bound."""
    rig = SimulatedRig.default()
    friction = rig.description.friction
    truth = dict(friction["parameters"])
    for force in ("coulomb", "breakaway"):
        truth[force] += (friction["pressure"][f"{force}_a"] + friction["pressure"][f"{force}_b"]) * GAUGE_PA
    traces = [rig.drag(speed, GAUGE_PA, count=CYCLES) for speed in SPEED]
    held, widths, samples = {name: [] for name in NAMES}, {name: [] for name in NAMES}, SPEED
    for seed in seeds:
        curves = pn.characterise([rig.record(trace, (seed, i)) for i, trace in enumerate(traces)])
        samples = curves["samples"].to_numpy().reshape(-1, 2).sum(axis=1)
        fit = pn.fit_friction(curves, law="stribeck")
        for name in NAMES:
            low, high = fit.intervals[name]
            held[name].append(bool(low <= truth[name] <= high))
            widths[name].append(0.5 * (high - low))
    bound = half_widths(NAMES, truth, SPEED, noise_of_one_sample(rig) / np.sqrt(samples))
    return held, {name: float(np.median(widths[name]) / least) for name, least in zip(NAMES, bound, strict=True)}


def main() -> None:
    """Print the fractions."""
    given = options(__doc__, 100)
    held, ratios = hits(range(given.seed, given.seed + given.count))
    sys.stdout.write(f"median half-width over the least one: {ratios}\n")
    fine = [is_within(name, values, LEAST) for name, values in held.items()]
    sys.exit(not all(fine) or max(ratios.values()) > WIDEST)


if __name__ == "__main__":
    main()
