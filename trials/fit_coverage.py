"""Coverage of the truth by 95 % intervals of the static fit, over maps with noise drawn at random.

    python -m trials.fit_coverage --count 1000 --seed 1

The truth is that of the Fisher table of the theory: Fc 30 N, Fs 40 N, vs 12 mm/s, Fv 60 N s/m. A map has 20 speeds from
1 to 450 mm/s in logarithmic steps, with a noise of 0.5 N. The last case draws the truth too, with exponents of 0.5 to 2
and the Lorentzian: the fit does not know the shape of the curve. The data are simulated and contain no other effects
of real seals. The exit status is 1 if a fraction lies outside its bounds, or if the median half-width exceeds 1.5 times
the Cramer-Rao bound.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from oracle.friction_maps import TRUTH, make_map
from pneudrive import _core
from pneudrive.identify import fit_friction
from pneudrive.identify.static.result import FrictionFit
from trials.cramer_rao import half_widths
from trials.shares import is_within, options

SPEED = np.geomspace(1e-3, 0.45, 20)
NAMES = ("coulomb", "breakaway", "stribeck_velocity", "viscous")
FORCES = ("coulomb", "breakaway", "viscous")
AT = np.array([0.002, 0.01, 0.03, 0.3])  # speeds of predictions, m/s
EXPONENTS = (0.5, 1.0, 1.5, 2.0, None)  # None: the Lorentzian
WIDEST = 1.5  # median half-width over the Cramer-Rao bound


@dataclass(frozen=True)
class Case:
    """Noise of the mean friction at each speed, and options of the fit."""

    sigma: Callable[[np.ndarray], np.ndarray]
    options: dict[str, object]
    strokes: int | None = None  # from which the standard errors are; None: they are exact


CASES = {
    "exponent fixed": Case(lambda v: 0.5 + 0.0 * v, {"law": "stribeck gaussian"}),
    "exponent free": Case(lambda v: 0.5 + 0.0 * v, {"law": "stribeck free"}),
    "standard errors from six strokes, noise grows with speed": Case(
        lambda v: 0.2 + 2.0 * v, {"law": "stribeck gaussian"}, strokes=6
    ),
}


def fitted(case: Case, seed: int) -> tuple[FrictionFit, np.random.Generator]:
    """Return the fit of a map with noise, and its generator."""
    rng = np.random.default_rng([2018, seed])
    sigma, stated, count = case.sigma(SPEED), case.sigma(SPEED), 10**6
    if case.strokes is not None:
        degrees = case.strokes - 2
        stated, count = sigma * np.sqrt(rng.chisquare(degrees, SPEED.size) / degrees), case.strokes // 2
    friction = _core.steady_friction("stribeck", TRUTH, SPEED, 0.0, 0.0) + sigma * rng.standard_normal(SPEED.size)
    return fit_friction(make_map(SPEED, friction, stated, strokes=count), **case.options), rng


def hits(case: Case, seeds: range) -> tuple[dict[str, list[bool]], dict[str, float]]:
    """Return whether each interval contains its truth, and median half-widths over the Cramer-Rao bound.

    The intervals are those of the parameters, of the law at `AT`, and of a new value with 0.5 N of noise there. A
    parameter that is undetermined has no interval.
    """
    held, widths = defaultdict(list), defaultdict(list)
    law = _core.steady_friction("stribeck", TRUTH, AT, 0.0, 0.0)
    for seed in seeds:
        fit, rng = fitted(case, seed)
        for name, (low, high) in fit.intervals.items():
            held[name].append(bool(low <= TRUTH[name] <= high))
            widths[name].append(0.5 * (high - low))
        for what, noise in (("law", None), ("new value", 0.5)):
            band = fit.predict(AT, stderr_n=noise)
            value = law if noise is None else law + noise * rng.standard_normal(AT.size)
            for v, inside in zip(AT, (band.lower_n <= value) & (value <= band.upper_n), strict=True):
                held[f"{what} at {v:g} m/s"].append(bool(inside))
    least = half_widths(NAMES, TRUTH, SPEED, case.sigma(SPEED))
    return held, {name: float(np.median(widths[name])) / bound for name, bound in zip(NAMES, least, strict=True)}


def hits_of_shapes(seeds: range) -> dict[str, list[bool]]:
    """Return whether the intervals of forces contain the truth where the shape at low speed is not known."""
    held = {name: [] for name in FORCES}
    for seed in seeds:
        rng = np.random.default_rng([2019, seed])
        truth = {"coulomb": rng.uniform(10.0, 30.0), "viscous": rng.uniform(0.0, 80.0)}
        truth["breakaway"] = truth["coulomb"] * rng.uniform(1.2, 2.0)
        speed, knee = np.geomspace(2e-3, 0.4, 12), np.exp(rng.uniform(np.log(3e-3), np.log(4e-2)))
        exponent = EXPONENTS[seed % 5]
        excess = 1.0 / (1.0 + (speed / knee) ** 2) if exponent is None else np.exp(-((speed / knee) ** exponent))
        exact = truth["coulomb"] + (truth["breakaway"] - truth["coulomb"]) * excess + truth["viscous"] * speed
        noise = 0.01 * truth["coulomb"]
        fit = fit_friction(make_map(speed, exact + noise * rng.standard_normal(12), noise))
        for name in FORCES:
            low, high = fit.intervals.get(name, (-np.inf, np.inf))
            held[name].append(bool(low <= truth[name] <= high))
    return held


def main() -> None:
    """Print the fractions."""
    given = options(__doc__, 1000)
    seeds, fine = range(given.seed, given.seed + given.count), True
    for title, case in CASES.items():
        held, ratios = hits(case, seeds)
        for name, values in held.items():
            fine &= is_within(f"{title}, {name}", values, 0.92, 0.99)
        if title != "exponent free":
            sys.stdout.write(f"{title}, median half-width over the least one: {ratios}\n")
            fine &= max(ratios.values()) <= WIDEST
    for name, values in hits_of_shapes(seeds).items():
        fine &= is_within(f"unknown shape, {name}", values, 0.90)
    sys.exit(not fine)


if __name__ == "__main__":
    main()
