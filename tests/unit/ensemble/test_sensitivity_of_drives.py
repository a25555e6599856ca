"""Sensitivities through members of a drive: the Ishigami function of its start state, and what physics says."""

from __future__ import annotations

import numpy as np
import pytest

import pneudrive as pn
from pneudrive import ensemble
from pneudrive.errors import CommandError, PneudriveWarning

DRIVE = pn.Drive.load("catalogue:reference")
A, B = 7.0, 0.1
START = {
    "initial.temperature_a": "uniform(296.8584073464102 K, 303.1415926535898 K)",
    "initial.temperature_b": "uniform(296.8584073464102 K, 303.1415926535898 K)",
    "initial.position": "uniform(196.8584073464102 mm, 203.1415926535898 mm)",
}


def ishigami(seen, t):
    x1, x2, x3 = (seen[name][:, 0] for name in ("temperature_a", "temperature_b", "position"))
    x1, x2, x3 = x1 - 300.0, x2 - 300.0, 1e3 * (x3 - 0.2)
    return np.sin(x1) + A * np.sin(x2) ** 2 + B * x3**4 * np.sin(x1)


KNOWN = ensemble.own(ishigami, ["temperature_a", "temperature_b", "position"], "ishigami")


def test_ishigami_has_the_indices_of_its_closed_form():
    v = 0.5 + A**2 / 8 + B * np.pi**4 / 5 + B**2 * np.pi**8 / 18
    v1, v2, v13 = 0.5 * (1 + B * np.pi**4 / 5) ** 2, A**2 / 8, B**2 * np.pi**8 * (1 / 18 - 1 / 50)
    first, total = np.array([v1, v2, 0.0]) / v, np.array([v1 + v13, v2, v13]) / v
    outputs = [KNOWN, "final(position)", "final(command)"]
    found = pn.sensitivity(DRIVE, 0.0, "1 ms", vary=START, outputs=outputs, n=2048, rtol=1e-3)
    assert found.number.values.tolist() == list(START)
    own = found.sel(output="ishigami")
    assert own.first.values == pytest.approx(first, abs=0.04)
    assert own.total.values == pytest.approx(total, abs=0.04)
    assert (own.total_interval.sel(end="lower") <= total).all()
    assert (total <= own.total_interval.sel(end="upper")).all()
    assert found.first.sel(output="final_position").values == pytest.approx([0.0, 0.0, 1.0], abs=0.05)
    assert np.isnan(found.first.sel(output="final_command")).all()  # it does not vary
    assert found.used.values.tolist() == [2048] * 3


def test_morris_finds_what_moves_a_drive_and_what_does_not():
    vary = {
        "load.mass": "uniform(1 kg, 5 kg)",
        "friction.viscous": "normal(40 N s/m, 1 %)",
        "cylinder.end_stop.stiffness": "uniform(0.5 kN/mm, 2 kN/mm)",
    }
    found = pn.sensitivity(DRIVE, 1.0, "0.05 s", vary=vary, outputs=["max(velocity)"], method="morris", n=10)
    star = found.mu_star.sel(output="max_velocity")
    assert star.sel(number="load.mass") > 20 * star.sel(number="friction.viscous") > 0.0
    assert star.sel(number="cylinder.end_stop.stiffness") == 0.0  # the stop is not reached
    assert found.mu.sel(output="max_velocity", number="load.mass") < 0.0
    assert found.unit.values.tolist() == ["m/s"]


def test_points_with_a_failed_member_are_left_out_and_told():
    vary = {"load.force": "uniform(-100 N, 1e6 N)", "load.mass": "uniform(1 kg, 2 kg)"}
    with pytest.warns(PneudriveWarning, match="members failed; some members have no final_position"):
        found = pn.sensitivity(DRIVE, 1.0, "2 ms", vary=vary, outputs=["final(position)"], n=64, rtol=1e-3)
    assert 0 <= found.used.item() < 64


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"method": "fast"}, 'no method "fast"'),
        ({"vary": {"load.mass": [1.0, 2.0]}, "n": None}, "a distribution of each number"),
        ({"outputs": ["samples(position)"]}, "is sampled"),
        ({"n": 1}, "too few"),
        ({"confidence": 95}, "confidence"),
    ],
)
def test_what_has_no_sensitivity_is_refused(options, said):
    with pytest.raises(CommandError) as told:
        pn.sensitivity(DRIVE, 1.0, "1 ms", **{"vary": {"load.mass": "uniform(1 kg, 2 kg)"}, "n": 4, **options})
    assert said in str(told.value)
