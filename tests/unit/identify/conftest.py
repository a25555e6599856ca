"""Friction maps made from a known law, as arrays."""

from __future__ import annotations

import numpy as np
import pytest

from oracle import friction_maps
from pneudrive.describe import Drive
from pneudrive.identify import fit_friction


@pytest.fixture
def truth():
    return dict(friction_maps.TRUTH)


@pytest.fixture(scope="session")
def make_map():
    return friction_maps.make_map


@pytest.fixture(scope="session")
def friction_of():
    return friction_maps.steady


@pytest.fixture(scope="session")
def noisy_fit(make_map, friction_of):
    """Return the fit of a map of the true friction at these speeds, with white noise."""

    def fit(speed, noise, seed, **parameters):
        drawn = noise * np.random.default_rng(seed).standard_normal(speed.size)
        return fit_friction(make_map(speed, friction_of(speed, **parameters) + drawn, noise))

    return fit


@pytest.fixture(scope="session")
def good(noisy_fit):
    """Return a fit that determines all parameters."""
    return noisy_fit(np.geomspace(1e-3, 0.45, 20), 0.3, 31)


@pytest.fixture
def drive():
    return Drive.load("catalogue:reference")
