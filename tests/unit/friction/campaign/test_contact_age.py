"""The age of a contact from peaks after stops: what its equations make is found again."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pneudrive.friction.campaign.stops.dwell_law import fit_contact_age
from pneudrive.friction.campaign.stops.dwell_models import FORMS

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
            condition = SimpleNamespace(pressure_a_pa=AMBIENT_PA + gauge, pressure_b_pa=AMBIENT_PA)
            peak = increment_n * (1.0 + share_a_pa * gauge) * float(psi(dwell) - psi(steady))
            recovery = SimpleNamespace(complete=True, distance=SimpleNamespace(value=float(back)))
            made.append(
                SimpleNamespace(
                    condition=condition, dwell_s=dwell, speed_m_s=speed, increment_n=peak, recovery=recovery
                )
            )
    return made


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
