"""Kernels are covariances of what they are named after."""

import numpy as np
import pytest

from pneudrive.estimate.levels import cells, centred_walk, gaussian, integrated_wiener, levels, matern

PLACES = np.linspace(0.05, 1.0, 12)


@pytest.mark.parametrize(
    "kernel", [integrated_wiener, lambda s, t: matern(s, t, 0.3), lambda s, t: gaussian(s, t, 0.2)]
)
def test_kernels_are_symmetric_and_not_negative(kernel):
    found = kernel(PLACES, PLACES)
    assert found == pytest.approx(found.T)
    assert np.linalg.eigvalsh(found).min() > -1e-12


def test_integrated_wiener_process_by_its_integral():
    """Cov = 3 times the integral of (s - u)(t - u) from 0 to the lower of both: variance 1 at 1."""
    u = np.linspace(0.0, 0.4, 4001)
    integral = np.trapezoid((0.4 - u) * (0.9 - u), u)
    assert integrated_wiener(np.array([0.4]), np.array([0.9]))[0, 0] == pytest.approx(3.0 * integral, rel=1e-6)


def test_a_centred_walk_has_mean_zero():
    assert centred_walk(PLACES).sum(axis=0) == pytest.approx(np.zeros(PLACES.size), abs=1e-12)


def test_levels_do_not_depend_on_the_order():
    values, order = np.array([1.0, 1.04, 2.0, 2.2, 1.06]), [3, 1, 4, 0, 2]
    assert levels(values, 0.05).tolist() == [0, 0, 2, 3, 1]
    assert levels(values[order], 0.05).tolist() == levels(values, 0.05)[order].tolist()
    assert cells(levels(values, 0.05), np.array([0, 1, 0, 0, 0])).max() == 4
