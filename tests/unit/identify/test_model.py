"""The fitted function is the core's steady friction, and its Jacobian is its derivative."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneudrive import _core
from pneudrive.identify.static.model import FrictionModel, Observations

SPEED = np.geomspace(1e-3, 0.45, 13)
ONE = np.ones_like(SPEED)
GAUGE_A = np.linspace(0.1e5, 1.5e5, 13)
GAUGE_B = GAUGE_A[::-1] ** 2 / 1.5e5
DATA = Observations(SPEED, ONE, ONE, GAUGE_A, GAUGE_B, 0.0 * ONE, np.zeros(13, np.int64))

MODELS = [
    FrictionModel("coulomb"),
    FrictionModel("coulomb", viscous=False),
    FrictionModel("coulomb", chambers=("a", "b")),
    FrictionModel("stribeck"),
    FrictionModel("stribeck", exponent=1.0),
    FrictionModel("stribeck", exponent=None),
    FrictionModel("stribeck", exponent=None, chambers=("a", "b")),
    FrictionModel("stribeck", chambers=("b",)),
    FrictionModel("stribeck", chambers=("ab",)),
]
NATURAL = {
    "coulomb": 9.0,
    "breakaway": 14.0,
    "stribeck_velocity": 0.02,
    "stribeck_exponent": 1.6,
    "viscous": 12.0,
    "coulomb_a": 4e-6,
    "coulomb_b": 7e-6,
    "coulomb_ab": 5e-6,
    "breakaway_a": 1.1e-5,
    "breakaway_b": 1.9e-5,
    "breakaway_ab": 1.5e-5,
}


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_internal_coordinates_and_back(model):
    theta = np.array([NATURAL[n] for n in model.names])
    np.testing.assert_allclose(model.natural(model.internal(theta)), theta, rtol=1e-14)


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_jacobian_is_the_derivative(model):
    q = model.internal(np.array([NATURAL[n] for n in model.names]))
    _, jac = model.value_and_jacobian(q, DATA)
    natural = model.natural_jacobian(q)
    for k in range(q.size):
        h = 1e-6 * max(abs(q[k]), 1e-6)
        up, down = q.copy(), q.copy()
        up[k] += h
        down[k] -= h
        slope = (model.value(up, DATA) - model.value(down, DATA)) / (2.0 * h)
        np.testing.assert_allclose(jac[:, k], slope, rtol=2e-6, atol=2e-8 * np.abs(slope).max())
        slope = (model.natural(up) - model.natural(down)) / (2.0 * h)
        np.testing.assert_allclose(natural[:, k], slope, rtol=1e-6, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(
    coulomb=st.floats(0.1, 100.0),
    excess=st.floats(0.0, 100.0),
    velocity=st.floats(1e-4, 0.3),
    exponent=st.floats(0.4, 3.0),
    viscous=st.floats(0.0, 200.0),
    slope=st.floats(0.0, 2e-5),
)
def test_values_are_the_cores_at_any_force_and_pressure(coulomb, excess, velocity, exponent, viscous, slope):
    model = FrictionModel("stribeck", exponent=None, chambers=("a", "b"))
    theta = dict(NATURAL) | {
        "coulomb": coulomb,
        "breakaway": coulomb + excess + 1e-6,
        "stribeck_velocity": velocity,
        "stribeck_exponent": exponent,
        "viscous": viscous,
        "coulomb_a": slope,
        "breakaway_a": 2.0 * slope,
    }
    q = model.internal(np.array([theta[n] for n in model.names]))
    value = model.value(q, DATA)
    for i in range(SPEED.size):
        forces = {
            force: theta[force] + theta[f"{force}_a"] * GAUGE_A[i] + theta[f"{force}_b"] * GAUGE_B[i]
            for force in ("coulomb", "breakaway")
        }
        parameters = {n: theta[n] for n in ("stribeck_velocity", "stribeck_exponent", "viscous")} | forces
        expected = _core.steady_friction("stribeck", parameters, SPEED[i : i + 1], 0.0, 0.0)
        np.testing.assert_allclose(value[i], expected[0], rtol=1e-12)


def test_coulomb_values_are_the_cores():
    model = FrictionModel("coulomb")
    expected = _core.steady_friction("coulomb", {"coulomb": 7.0, "viscous": 30.0}, SPEED, 0.0, 0.0)
    np.testing.assert_allclose(model.value(np.array([7.0, 30.0]), DATA), expected, rtol=1e-13)
