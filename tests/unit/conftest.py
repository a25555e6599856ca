"""The drive file of the guide, for tests that change a line of it; recordings of a known truth."""

import pytest

from oracle.recordings import make_recording

DRIVE_FILE = """\
schema = 1
name = "Reference rodless drive"

[gas]
heat_capacity_ratio = 1.4
gas_constant = "287.05 J/(kg K)"

[ambient]
pressure = "1.013 bar abs"
temperature = "293.15 K"              # "20 degC" works too

[supply]
pressure = "7 bar abs"
temperature = "293.15 K"

[cylinder]
kind = "rodless"
bore = "25 mm"
stroke = "500 mm"
dead_volume = { a = "10 cm3", b = "10 cm3" }
moving_mass = "2 kg"
incline = "0 deg"
heat_transfer = "30 W/(m2 K)"
wall_temperature = "293.15 K"
end_stop = { stiffness = "1e6 N/m", damping = "2000 N s/m", damping_depth = "0.1 mm" }

[valve]
kind = "proportional-5/3"
conductance = "2 dm3/(s bar)"
critical_pressure_ratio = 0.3
subsonic_index = 0.5
linear_above = 0.999

[friction]
law = "lugre"
coulomb = "30 N"
breakaway = "45 N"
stribeck_velocity = "20 mm/s"
stribeck_exponent = 2
viscous = "40 N s/m"
bristle_stiffness = "1e5 N/m"
bristle_damping = "300 N s/m"

[friction.pressure]
coulomb = { a = "1.0 N/bar", b = "1.0 N/bar" }
breakaway = { a = "1.5 N/bar", b = "1.5 N/bar" }

[load]
mass = "3 kg"

[labels]
seal = "NBR"
"""


@pytest.fixture
def drive_file():
    return DRIVE_FILE


@pytest.fixture
def make():
    """Return the function that makes recordings whose truth is known."""
    return make_recording
