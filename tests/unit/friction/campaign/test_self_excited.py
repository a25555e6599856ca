"""On a soft rig the seal makes the piston swing at low speed: such means are shown, and are no points of F(v).

The axis runs evenly, its encoder shows nothing, samples are too far apart to show the swing: its force gives it away.
"""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest
from scipy.optimize import least_squares

from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.planning.protocol import parse_protocol
from pneudrive.campaign.storage.folder import Head, create, write_cycle
from pneudrive.characteristics import campaign_friction
from pneudrive.errors import FitError
from pneudrive.friction.campaign.stops.dwell_law import fit_contact_age
from pneudrive.friction.campaign.stops.dwell_models import FORMS, design_stops
from pneudrive.rig import Hold, Move, Samples, Sampling, load_rig

SWINGING = (3e-3, 5e-3, 8e-3)  # inside the self-excited range of the rig "soft", from 2 to 13 mm/s
STEADY = (1.2e-3, 0.018, 0.03, 0.06, 0.12, 0.2)
SAMPLING = Sampling(samples_per_stroke=1500)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Write a campaign on the soft rig, without the engine."""
    rig = load_rig("soft", seed=3)
    campaign = create(tmp_path_factory.mktemp("soft") / "campaign", "", rig.identity(), {"name": "soft"})
    low, high = rig.limits().position_m
    span = (low + 0.01, min(low + 0.11, high))
    ambient = rig.identity().ambient_pressure_pa
    rig.move(span[0], 0.05)
    plan = [("tare", None), *((f"sweep-{i}", v) for i, v in enumerate((*SWINGING, *STEADY, *STEADY)))]
    for index, (key, speed) in enumerate(plan, start=1):
        steps = (Hold(3.0, released=True),) if speed is None else (Move(span[1], speed), Move(span[0], speed))
        cycle = Cycle(key, key.split("-")[0], steps, SAMPLING, ambient, ambient, speed_m_s=speed)
        rig.begin_cycle(key)
        began = rig.state().time_s
        samples = Samples.join(list(rig.acquire(steps, SAMPLING)))
        write_cycle(campaign.path, Head(index, cycle, began_s=began), samples)
    return campaign.path


@pytest.fixture(scope="module")
def found(folder):
    return campaign_friction(folder)


def test_swinging_points_are_shown_and_not_counted(found):
    (curve,) = [c for c in found.curves if c.direction == 0]
    assert curve.speed_m_s.min() == pytest.approx(min(STEADY), rel=0.01)
    assert curve.excluded["speed_m_s"].to_list() == pytest.approx(SWINGING, rel=0.02)
    assert {round(1e3 * p.speed_m_s, 1) for p in found.stick_slip} == {round(1e3 * v, 1) for v in SWINGING}
    threshold = found.stick_slip_thresholds[0]
    assert (threshold.low_m_s, threshold.high_m_s) == pytest.approx((max(SWINGING), 0.018), rel=0.02)
    assert "not points of F(v)" in " ".join(s.text for s in found.statements if not s.carried)


def test_what_is_counted_is_the_friction_of_steady_sliding(found):
    rig = load_rig("soft")
    curve = found.curves[0]
    true = np.array([rig.rig.true_friction(v) for v in curve.speed_m_s[curve.measured]])
    inside = (curve.low_n[curve.measured] <= true) & (true <= curve.high_n[curve.measured])
    assert inside.mean() >= 0.75
    assert curve.friction_n[curve.measured] == pytest.approx(true, rel=0.02)


# --- Stops for a dwell law: at the known support, spread by what is not known, with intervals that come true.


def test_hyperbolic_law_of_a_known_time_has_its_known_support():
    """The law a + B t/(t + c): at both ends and, in u = t/(t + c), in their middle."""
    c, low, high = 5.0, 0.1, 1000.0
    plan = design_stops("hyperbolic", c, stops=12, factor=1.0)
    share = np.array([low, high]) / (np.array([low, high]) + c)
    middle = share.mean()
    assert plan.durations_s[0] == low
    assert plan.durations_s[-1] == high
    assert np.median(plan.durations_s[1:-1]) == pytest.approx(c * middle / (1 - middle), rel=0.1)
    assert plan.repeats[0] == plan.repeats[-1] == 4
    read = parse_protocol(plan.protocol(), "stops.toml")
    assert (read.stop.durations_s, read.repeats, read.order.kind) == (plan.durations_s, 4, "randomised")


def test_a_time_that_is_not_known_spreads_the_stops():
    sure = design_stops("exponential", 5.0, stops=16, factor=1.0)
    unsure = design_stops("exponential", 5.0, stops=16, factor=10.0)
    assert len(unsure.durations_s) > len(sure.durations_s)


def test_expected_intervals_come_true():
    plan = design_stops("log", 1.0, stops=24, factor=1.0, noise_n=0.2)
    t = np.repeat(plan.durations_s, plan.repeats)
    found = []
    for seed in range(200):
        y = 10.0 + np.log1p(t) + 0.2 * np.random.default_rng([3, seed]).standard_normal(t.size)
        fit = least_squares(lambda x, y=y: x[0] + x[1] * np.log1p(t / np.exp(x[2])) - y, [10.0, 1.0, 0.0])
        found.append(fit.x)
    spread = np.std(found, axis=0)
    t_quantile = 2.08  # 21 degrees of freedom
    assert t_quantile * spread[0] == pytest.approx(plan.half_widths["a_n"], rel=0.15)
    assert t_quantile * spread[1] == pytest.approx(plan.half_widths["increment_n"], rel=0.15)


def test_a_law_that_is_unknown_is_named():
    with pytest.raises(FitError, match="no dwell law"):
        design_stops("logarithm", 1.0)


# --- The age of a contact from peaks after stops: what its equations make is found again.

AMBIENT_PA = 101325.0
PSI = {
    "log": lambda ratio, _: np.log(1.0 + ratio),
    "hyperbolic": lambda ratio, _: ratio / (1.0 + ratio),
    "saturating": lambda ratio, m: 1.0 - np.exp(-(ratio**m)),
}


def stops(growth: str, exponent: float, increment_n: float, time_s: float, distance_m: float, share_a_pa: float):
    """Make stops at a speed of 1 mm/s; the way back is found on a fine grid of travel."""
    made = []
    travel, speed = np.geomspace(1e-7, 1e-1, 200_001), 1e-3
    for dwell in (0.3, 1.0, 4.0, 15.0, 60.0):
        for gauge in (0.0, 1e5, 3e5):
            steady = distance_m / speed

            def psi(age):
                return PSI[growth](np.asarray(age) / time_s, exponent)

            excess = psi(steady + (dwell - steady) * np.exp(-travel / distance_m)) - psi(steady)
            back = travel[np.argmax(excess < 0.05 * (psi(dwell) - psi(steady)))]
            peak = increment_n * (1.0 + share_a_pa * gauge) * float(psi(dwell) - psi(steady))
            row = {"pressure_a_pa": AMBIENT_PA + gauge, "pressure_b_pa": AMBIENT_PA, "dwell_s": dwell}
            row |= {"speed_m_s": speed, "increment_n": peak, "recovery_m": float(back), "recovery_complete": True}
            made.append(row)
    return pl.DataFrame(made)


@pytest.mark.parametrize(
    ("name", "exponent", "time_s"), [("log", 1.0, 0.3), ("hyperbolic", 1.0, 8.0), ("kato", 0.4, 20.0)]
)
def test_its_equations_are_found_again(name, exponent, time_s):
    form = next(form for form in FORMS if form.name == name)
    age = fit_contact_age(stops(form.growth, exponent, 0.8, time_s, 1.5e-4, 2e-6), form, exponent, AMBIENT_PA)
    assert age is not None
    assert age.time.value == pytest.approx(time_s, rel=0.02)
    assert age.increment.value == pytest.approx(0.8, rel=0.01)
    assert age.distance_m == pytest.approx(1.5e-4, rel=0.02)
    assert (age.share_a_pa, age.share_b_pa) == (pytest.approx(2e-6, rel=0.02), 0.0)
    steady = 0.8 * PSI[form.growth](np.array([1.5e-4 / 2e-3 / time_s]), exponent)[0]
    assert age.sliding_n(2e-3) == pytest.approx(steady, rel=0.03)


def test_friction_that_falls_with_the_stop_has_no_age():
    form = next(form for form in FORMS if form.name == "log")
    assert fit_contact_age(stops("log", 1.0, -0.8, 0.3, 1.5e-4, 0.0), form, 1.0, AMBIENT_PA) is None
