"""Friction maps made from a known law, as arrays."""

from __future__ import annotations

import pytest

from oracle import friction_maps


@pytest.fixture
def truth():
    return dict(friction_maps.TRUTH)


@pytest.fixture(scope="session")
def make_map():
    return friction_maps.make_map


@pytest.fixture(scope="session")
def friction_of():
    return friction_maps.steady
