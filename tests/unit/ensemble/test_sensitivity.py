"""Sensitivity indices against the Ishigami function, whose indices are known in closed form, and against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import sobol_indices as scipy_indices
from scipy.stats import uniform

from pneudrive.ensemble.sensitivity import sobol_indices, sobol_points

A, B = 7.0, 0.1


def ishigami(u):
    x = np.pi * (2.0 * u - 1.0)
    return np.sin(x[:, 0]) + A * np.sin(x[:, 1]) ** 2 + B * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_ishigami_has_the_indices_of_its_closed_form():
    v = 0.5 + A**2 / 8 + B * np.pi**4 / 5 + B**2 * np.pi**8 / 18
    v1, v2, v13 = 0.5 * (1 + B * np.pi**4 / 5) ** 2, A**2 / 8, B**2 * np.pi**8 * (1 / 18 - 1 / 50)
    first, total = np.array([v1, v2, 0.0]) / v, np.array([v1 + v13, v2, v13]) / v
    points = sobol_points(4096, 3, seed=1)
    both = np.column_stack([ishigami(points), points[:, 2] ** 2])
    found = sobol_indices(points, both, resamples=200)
    assert found["first"][:, 0] == pytest.approx(first, abs=0.02)
    assert found["total"][:, 0] == pytest.approx(total, abs=0.02)
    assert (found["first_interval"][0, :, 0] <= first).all()
    assert (first <= found["first_interval"][1, :, 0]).all()
    assert np.ptp(found["total_interval"][:, 0, 0]) < 0.1
    assert found["first"][:, 1] == pytest.approx([0.0, 0.0, 1.0], abs=0.01)


def test_indices_are_those_of_scipy():
    points = sobol_points(256, 3, seed=2)
    f = ishigami(points).reshape(5, 256)
    f += 100.0  # a mean must not matter
    theirs = scipy_indices(func={"f_A": f[:1], "f_B": f[1:2], "f_AB": f[2:, None]}, n=256, dists=[uniform()] * 3)
    ours = sobol_indices(points, f.reshape(-1, 1), resamples=2)
    assert ours["first"][:, 0] == pytest.approx(theirs.first_order, rel=1e-9, abs=1e-12)
    assert ours["total"][:, 0] == pytest.approx(theirs.total_order, rel=1e-9)


def test_base_points_with_a_failed_member_are_left_out():
    points = sobol_points(1024, 3, seed=3)
    values = np.column_stack([ishigami(points)] * 2)
    values[[5, 1024 + 9, 4 * 1024 + 9], 0] = np.nan  # two base points
    found = sobol_indices(points, values, resamples=2)
    assert found["used"].tolist() == [1022, 1024]
    assert found["total"][:, 0] == pytest.approx(found["total"][:, 1], abs=0.02)
    constant = sobol_indices(points[:40], np.ones((5 * 8, 1)), resamples=2)
    assert np.isnan(constant["first"]).all()
