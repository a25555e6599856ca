"""Friction of the law of Karnopp at rest is at most the breakaway force, in each sample.

A mass that stops in its band loses its velocity at once, and with it the damping force of an end stop. If the other
forces exceed breakaway then, it moves on.
"""

import numpy as np
import pytest

import pneudrive as pn

DRIVE = {
    "ambient": {"pressure": "0.52318996368563164 bar abs"},
    "supply": {"pressure": "10.496513254617923 bar abs", "temperature": "353 K"},
    "cylinder": {
        "kind": "single-rod",
        "bore": "63 mm",
        "rod_diameter": "15.536162778013311 mm",
        "stroke": "74.742263293787047 mm",
        "dead_volume": {"a": "10.8581451372245 cm3", "b": "27.388425417271559 cm3"},
        "moving_mass": "14.507876926326317 kg",
        "heat_transfer": "100 W/(m2 K)",
        "leakage": "0.00077786481694282455 dm3/(s bar)",
        "end_stop": {
            "stiffness": "10906735.573271897 N/m",
            "damping": "7547.455720400415 N s/m",
            "damping_depth": "0.1 mm",
        },
    },
    "valve": {
        "kind": "proportional-5/3",
        "conductance": "0.825441600080398 dm3/(s bar)",
        "critical_pressure_ratio": 0.4133938745346163,
    },
    "friction": {
        "law": "karnopp",
        "coulomb": "127.02983974912138 N",
        "breakaway": "159.79923461069782 N",
        "stribeck_velocity": "24.556301902863904 mm/s",
        "viscous": "936.99036968742462 N s/m",
        "dead_zone": "0.68185496410657731 mm/s",
    },
}
COMMANDS = [
    (0.0, 0.1672355208479186),
    (0.10887548739900961, -0.12555445036876467),
    (0.11585810546979826, -0.5134147995428044),
    (0.1238313275270491, -0.026841432737316318),
    (0.16975292021702468, 0.45044283758426995),
]
START = {
    "position": "0.07474226329378705 m",
    "pressure_a": "911294.9041896974 Pa abs",
    "pressure_b": "639439.0174072883 Pa abs",
}


@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-5, 1e-6, 1e-8])
def test_friction_at_rest_is_at_most_breakaway(rtol):
    drive = pn.Drive.model_validate(DRIVE)
    run = pn.simulate(drive, COMMANDS, 0.289, initial=START, sample_rate=2000.0, rtol=rtol)
    resting = run.velocity.to_numpy() == 0.0
    most = np.abs(run.friction_force.to_numpy()[resting]).max()
    assert most <= float(drive.friction.breakaway) * (1.0 + 1e-9)
    assert resting.sum() > 100
