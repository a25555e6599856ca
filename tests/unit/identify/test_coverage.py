"""Intervals mean what they say: 95 % of them hold the truth, and they are hardly wider than any fit could make them.

The Cramer-Rao bound is computed here from finite differences of the core's friction, independent of the fit.
"""

from __future__ import annotations

import numpy as np
import pytest

from oracle.cramer_rao import half_widths
from oracle.fit_coverage import CASES as COVERED
from oracle.fit_coverage import coverage
from pneudrive import _core
from pneudrive.identify import fit_friction

RUNS = 200
NAMES = ("coulomb", "breakaway", "stribeck_velocity", "viscous")
EXACT = "exact standard errors"
CASES = {
    EXACT: {"levels": 20, "sigma": lambda v: 0.5 + 0.0 * v, "strokes": None},
    "standard errors from six strokes, noise grows with speed": {
        "levels": 20,
        "sigma": lambda v: 0.2 + 2.0 * v,
        "strokes": 6,
    },
    "few levels": {"levels": 10, "sigma": lambda v: 0.3 + 0.0 * v, "strokes": None},
}


def drawn(make_map, truth, case):
    """Yield fits of maps with noise, and the generator of each."""
    levels, strokes = CASES[case]["levels"], CASES[case]["strokes"]
    speed = np.geomspace(1e-3, 0.45, levels)
    sigma = CASES[case]["sigma"](speed)
    exact = _core.steady_friction("stribeck", truth, speed, 0.0, 0.0)
    for seed in range(RUNS):
        rng = np.random.default_rng([2018, seed])
        stated, count = sigma, 10**6
        if strokes is not None:
            stated, count = sigma * np.sqrt(rng.chisquare(strokes - 2, levels) / (strokes - 2)), strokes // 2
        yield (
            fit_friction(
                make_map(speed, exact + sigma * rng.standard_normal(levels), stated, strokes=count),
                stribeck_shape="gaussian",
            ),
            rng,
        )


def hold_the_truth(fits, truth, case):
    """Assert that intervals hold the truth as often as they say, and are hardly wider than the bound."""
    half_width = {name: [0.5 * float(np.ptp(fit.intervals[name])) for fit in fits] for name in NAMES}
    inside = {
        name: sum(fit.intervals[name][0] <= truth[name] <= fit.intervals[name][1] for fit in fits) for name in NAMES
    }
    speed = np.geomspace(1e-3, 0.45, CASES[case]["levels"])
    bound = half_widths(NAMES, truth, speed, CASES[case]["sigma"](speed))
    assert len(fits) == RUNS
    for name, least in zip(NAMES, bound, strict=True):
        assert 180 <= inside[name] <= 198, (name, inside)
        assert np.median(half_width[name]) <= 1.5 * least, name


@pytest.mark.parametrize("case", [*CASES][1:], ids=lambda c: c.replace(" ", "-"))
def test_intervals_hold_the_truth_as_often_as_stated(make_map, truth, case):
    hold_the_truth([fit for fit, _ in drawn(make_map, truth, case)], truth, case)


def test_intervals_and_predictions_hold_the_truth_as_often_as_stated(make_map, truth):
    at = np.array([0.002, 0.01, 0.03, 0.3])
    wanted = _core.steady_friction("stribeck", truth, at, 0.0, 0.0)
    law, new, fits = np.zeros(4), np.zeros(4), []
    for fit, rng in drawn(make_map, truth, EXACT):
        fits.append(fit)
        if len(fits) > 100:
            continue
        band = fit.predict(at)
        law += (band.lower_n <= wanted) & (wanted <= band.upper_n)
        band = fit.predict(at, stderr_n=0.5)
        value = wanted + 0.5 * rng.standard_normal(4)
        new += (band.lower_n <= value) & (value <= band.upper_n)
    assert np.all((law >= 87) & (law <= 100)), law
    assert np.all((new >= 87) & (new <= 100)), new
    hold_the_truth(fits, truth, EXACT)


def test_free_exponent_holds_its_truth():
    """The bar is 92 to 98 % of 1000 runs (``python -m oracle.fit_coverage``); of 120 at 95 % these are 107 to 120."""
    for name, share in coverage(COVERED["exponent free"], 120).items():
        assert 107 / 120 <= share <= 1.0, name


def test_intervals_of_forces_cover_the_choice_among_shapes_that_fit_as_well(make_map):
    """The shape of the curve at low speed is not known: exponents of 0.5 to 2 and the Lorentzian are drawn.

    With the Gaussian curve held, the breakaway force was inside in 41 % of such maps.
    """
    inside, count = dict.fromkeys(("coulomb", "breakaway", "viscous"), 0), 60
    for seed in range(count):
        rng = np.random.default_rng([2019, seed])
        truth = {"coulomb": rng.uniform(10.0, 30.0), "viscous": rng.uniform(0.0, 80.0)}
        truth["breakaway"] = truth["coulomb"] * rng.uniform(1.2, 2.0)
        speed, knee = np.geomspace(2e-3, 0.4, 12), np.exp(rng.uniform(np.log(3e-3), np.log(4e-2)))
        exponent = (0.5, 1.0, 1.5, 2.0, None)[seed % 5]
        excess = 1.0 / (1.0 + (speed / knee) ** 2) if exponent is None else np.exp(-((speed / knee) ** exponent))
        exact = truth["coulomb"] + (truth["breakaway"] - truth["coulomb"]) * excess + truth["viscous"] * speed
        noise = 0.01 * truth["coulomb"]
        fit = fit_friction(make_map(speed, exact + noise * rng.standard_normal(12), noise))
        for name in inside:
            low, high = fit.intervals.get(name, (-np.inf, np.inf))
            inside[name] += low <= truth[name] <= high
    assert min(inside.values()) >= 0.93 * count, inside
