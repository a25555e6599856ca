"""A rig that says all it can do, for plans that need no rig."""

from dataclasses import replace

import pytest

from pneudrive.campaign.planning.plan import lay_out
from pneudrive.campaign.planning.protocol import parse_protocol
from pneudrive.rig import Envelope, Identity

IDENTITY = Identity(
    name="bench",
    area_a_m2=4.9e-4,
    area_b_m2=4.9e-4,
    ambient_pressure_pa=1.0e5,
    mass_beyond_sensor_kg=0.8,
)
ENVELOPE = Envelope(
    position_m=(0.005, 0.295),
    speed_m_s=1.0,
    acceleration_m_s2=5.0,
    jerk_m_s3=200.0,
    force_n=200.0,
    pressure_pa=(0.9e5, 5.0e5),
    separate_pressures=True,
    temperature_k=(288.15, 303.15),
    expected_friction_n=20.0,
)


def lay(text, envelope=None, identity=None):
    """Lay out a protocol given as text; keywords replace values of the bench."""
    return lay_out(
        parse_protocol(text, "protocol.toml"), replace(IDENTITY, **identity or {}), replace(ENVELOPE, **envelope or {})
    )


@pytest.fixture(scope="session")
def planned():
    return lay
