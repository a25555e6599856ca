"""The core's runs with derivatives, as Python sees them: shapes, values of the plain run, derivatives, refusals."""

import numpy as np
import pytest

import pneudrive as pn
from pneudrive import _core

NAMES = ["cylinder.friction.parameters.coulomb", "valve.conductance", "cylinder.friction.pressure.coulomb_a"]
OUTPUTS = ["position_m", "pressure_a_pa"]


@pytest.fixture(scope="module")
def drive() -> pn.Drive:
    return pn.Drive.load("catalogue:reference")


def shoot(drive: pn.Drive, names: list[str], with_initial: bool = False, coulomb: float = 30.0):
    drive = drive.replace({"friction.coulomb": f"{coulomb!r} N"})
    core = drive.system.compiled()
    t = np.arange(201) / 1000.0
    start = np.tile([0.25, 0.0, 3e5, 293.15, 3e5, 293.15, 0.0], (2, 1))
    asked = {"times": t, "commands": 0.3 * np.sin(20.0 * t), "sample_times": t, "starts": [0, 120]}
    asked |= {"initial": start, "parameters": names, "with_initial": with_initial}
    return core.shoot("command", asked | {"outputs": OUTPUTS, "rtol": 1e-8})


def test_derivatives_come_beside_the_values_of_the_plain_run(drive):
    plain, shot = shoot(drive, []), shoot(drive, NAMES, with_initial=True)
    assert shot["failures"] == [None, None]
    assert shot["start_names"][-1] == "bristle_deflection_m"
    # To rounding only: lips that may press change the order of elimination.
    np.testing.assert_allclose(shot["values"], plain["values"], rtol=1e-11)
    assert shot["sensitivities"].shape == (201, 2, 10)
    assert shot["end_sensitivities"].shape == (2, 7, 10)
    assert np.isfinite(shot["sensitivities"]).all()
    step = 1e-3
    difference = (shoot(drive, [], coulomb=30.0 + step)["values"] - shoot(drive, [], coulomb=30.0 - step)["values"]) / (
        2 * step
    )
    scale = np.abs(difference).max(axis=0)
    assert np.abs((shot["sensitivities"][:, :, 0] - difference) / scale).max() < 1e-4
    # At its first sample a segment is its start.
    np.testing.assert_array_equal(shot["sensitivities"][120, 0, 3:], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_steady_friction_with_derivatives():
    parameters = {"coulomb": 20.0, "breakaway": 30.0, "stribeck_velocity": 0.02, "viscous": 40.0}
    v, zero = np.array([-0.05, 0.01, 0.1]), np.zeros(3)
    names = [f"friction.parameters.{key}" for key in ("coulomb", "viscous")] + ["friction.pressure.coulomb_b"]
    force, by = _core.steady_friction_sensitivity("stribeck", parameters, names, v, zero, zero + 1e5, zero)
    np.testing.assert_array_equal(force, _core.steady_friction("stribeck", parameters, v, 0.0, 1e5))
    left = 1.0 - np.exp(-((v / 0.02) ** 2))
    np.testing.assert_allclose(by, np.column_stack((np.sign(v) * left, v, np.sign(v) * left * 1e5)), rtol=1e-12)


def test_what_is_no_number_is_refused_with_the_choices(drive):
    with pytest.raises(ValueError, match=r'has no parameter "conductance_m3_s_pa"; it has conductance'):
        shoot(drive, ["valve.conductance_m3_s_pa"])


def test_a_leak_past_the_piston_evens_the_pressures_out():
    drive = pn.Drive.load("catalogue:reference")
    leaky = drive.replace({"cylinder.leakage": "0.01 dm3/(s bar)"})
    assert leaky.to_dict()["cylinder"]["leakage"] == "0.01 dm3/(s bar)"
    assert drive.description_hash != leaky.description_hash
    apart = [
        float((run.pressure_a - run.pressure_b)[-1])
        for run in (
            pn.simulate(d, "0 s: 0", "20 s", initial="pressure_a = 3.5 bar abs, pressure_b = 3 bar abs")
            for d in (drive, leaky)
        )
    ]
    assert apart[0] > 0.45e5
    assert abs(apart[1]) < 0.5 * apart[0]
