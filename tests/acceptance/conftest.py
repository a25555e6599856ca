"""What the tests of control share."""

from pathlib import Path

import pytest

import pneudrive as pn


@pytest.fixture(scope="session")
def axis():
    """Return the controlled axis of the examples."""
    return pn.Circuit.load(Path(__file__).parents[2] / "examples" / "controlled_axis.toml")
