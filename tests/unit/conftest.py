"""The drive file of the guide, for tests that change a line of it; recordings of a known truth."""

from pathlib import Path

import pytest

from oracle.recordings import make_recording

DRIVE_FILE = (Path(__file__).parents[1] / "data" / "reference_rodless.toml").read_text("utf-8")


@pytest.fixture
def drive_file():
    return DRIVE_FILE


@pytest.fixture
def make():
    """Return the function that makes recordings whose truth is known."""
    return make_recording
