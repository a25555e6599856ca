"""Results of a run as differentiable functions: Jacobian, SciPy."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import pneudrive as pn
from pneudrive.errors import CommandError, SimulationError

DRIVE = pn.Drive.load("catalogue:reference")
ASKED = {"command": "0.6", "duration": "0.15 s", "initial": {"position": "50 mm"}}


def test_each_kind_of_result_has_its_derivatives():
    outputs = [
        "final(position)", "max(velocity)", "min(pressure_b)", "mean(pressure_a)", "integral(mass_flow_a)",
        "time_when(position > 0.2 m)", "samples(position, 1 kHz)",
    ]  # fmt: skip
    of = pn.Differentiable(
        DRIVE, **ASKED, vary=["friction.coulomb", "cylinder.bore"], outputs=outputs, rtol=1e-12, sample_rate="1 kHz"
    )
    found = of.jacobian(of.start)
    assert found.shape == (6 + 151, 2)
    assert of.output_names[5:7] == ["time_position_above", "position[0]"]
    for k, value in enumerate(of.start):
        step = np.zeros(2)
        step[k] = 1e-4 * value
        wanted = (of(of.start + step) - of(of.start - step)) / (2.0 * step[k])
        # the smallest pressure is that of the start: what rounding makes of it is small beside pressure over number
        size = 1e-8 * np.abs(of(of.start)[:6]) / value
        assert (np.abs(found[:6, k] - wanted[:6]) <= 1e-6 * np.abs(wanted[:6]) + size).all()
        assert found[6:, k] == pytest.approx(wanted[6:], rel=1e-6, abs=1e-6 * np.abs(wanted[6:]).max())
    assert found[5, 0] > 0.0  # more friction, later


def test_scipy_finds_the_numbers_that_a_run_was_made_with():
    of = pn.Differentiable(
        DRIVE, **ASKED, vary=["friction.viscous", "valve.conductance"], outputs=["samples(position)"]
    )
    wanted = of(of.start)
    found = least_squares(
        lambda x: of(x) - wanted, 1.3 * of.start, jac=of.jacobian, x_scale=of.start, xtol=1e-12, ftol=1e-12
    )
    assert found.x == pytest.approx(of.start, rel=1e-5)


def test_what_has_no_derivative_is_said():
    with pytest.raises(CommandError, match="no derivative"):
        pn.Differentiable(DRIVE, **ASKED, vary=["friction.coulomb"], outputs=["settling(position, 1 mm)"])
    of = pn.Differentiable(DRIVE, **ASKED, vary=["friction.coulomb"], outputs=["time_when(position > 0.4999 m)"])
    with pytest.raises(SimulationError, match="never above"):
        of(of.start)


def test_a_default_start_is_held_here_and_follows_the_ambient_air_in_an_ensemble():
    asked, name = {"command": "0.6", "duration": "0.05 s"}, "ambient.pressure"
    old, new = (DRIVE.replace({name: f"{p} Pa abs"}) for p in (100_000, 90_000))
    held = {"pressure_a": "100000 Pa abs", "pressure_b": "100000 Pa abs"}
    here = pn.Differentiable(old, **asked, vary=[name], outputs=["final(position)"])([90_000.0])[0]
    there = pn.simulate_many(old, **asked, vary={name: np.array([90_000.0])}, outputs=["final(position)"])
    assert here == pytest.approx(float(pn.simulate(new, **asked, initial=held).position[-1]), abs=1e-7)
    assert float(there.final_position[0]) == pytest.approx(float(pn.simulate(new, **asked).position[-1]), abs=1e-7)
    assert abs(here - float(there.final_position[0])) > 1e-5
