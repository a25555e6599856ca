"""Elements of generalised Maxwell slip and the evolution of rate and state: as users write them, kept and refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive import _core
from pneudrive.errors import DescriptionError

COMMON = {
    "law": "gms",
    "coulomb": "30 N",
    "breakaway": "40 N",
    "stribeck_velocity": "20 mm/s",
    "attraction": "2000 N/s",
}
ELEMENTS = [{"stiffness": "40000 N/m", "share": 0.15}, {"stiffness": "60000 N/m", "share": 0.85}]
ROCK = {
    "law": "rate-and-state",
    "coulomb": "30 N",
    "direct_effect": 0.04,
    "evolution_effect": 0.05,
    "distance": "50 um",
    "reference_velocity": "1 mm/s",
    "bristle_stiffness": "100000 N/m",
}


def test_elements_go_through_the_drive_file_to_the_states_of_a_run(tmp_path):
    drive = pn.Drive.load("catalogue:reference").replace({"friction": COMMON | {"elements": ELEMENTS}})
    path = tmp_path / "drive.toml"
    path.write_text(drive.to_toml())
    assert pn.Drive.load(path).core_json() == drive.core_json()
    assert drive.to_dict()["friction"]["elements"] == ELEMENTS
    run = pn.simulate(drive, "0 s: 0.3", "0.1 s")
    springs = run.element_1_deflection.to_numpy() * 4e4, run.element_2_deflection.to_numpy() * 6e4
    # The two slide with 15 and 85 % of the level: without viscous friction their sum is all there is.
    sliding = np.abs(run.velocity.to_numpy()) > 0.1
    assert sliding.any()
    np.testing.assert_allclose(springs[0][sliding] / springs[1][sliding], 15 / 85, rtol=1e-3)
    np.testing.assert_allclose(sum(springs), run.friction_force.to_numpy(), rtol=1e-6, atol=1e-6)
    assert "element_3_deflection" not in run


def test_both_evolutions_of_rate_and_state_slide_alike():
    ageing, slip = (pn.Friction(**ROCK, evolution=word) for word in ("ageing", "slip"))
    assert ageing != slip
    assert slip.to_dict()["evolution"] == "slip"
    v = np.array([1e-4, 1e-3, 1e-2])
    steady = [_core.steady_friction(f.law, dict(f.parameters), v) for f in (ageing, slip)]
    np.testing.assert_array_equal(steady[0], steady[1])
    # (a - b) F0 for each e-fold of the velocity.
    np.testing.assert_allclose(np.diff(steady[0]), (0.04 - 0.05) * 30.0 * np.log(10.0), rtol=1e-3)


@pytest.mark.parametrize(
    ("friction", "message"),
    [
        (COMMON, "bristle_stiffness is missing.*or friction.elements"),
        (COMMON | {"elements": ELEMENTS, "bristle_stiffness": "1e5 N/m"}, "bristle_stiffness already follows from"),
        (COMMON | {"elements": ELEMENTS[:1]}, "has 1 entries.*\n?.*2 to 10"),
        (COMMON | {"elements": [ELEMENTS[0], ELEMENTS[0]]}, "add up to 0.3"),
        (COMMON | {"elements": [{"stiffness": "1 mm", "share": 0.5}, ELEMENTS[0]]}, "stiffness"),
        (ROCK | {"elements": ELEMENTS}, "elements is not a known key.*\n?.*Laws with this key: gms"),
        (
            COMMON | {"bristle_stiffness": "1e5 N/m", "evolution": "slip"},
            "not a known key.*\n?.*: rate-and-state",
        ),
        (ROCK | {"evolution": "healing"}, "evolution"),
        (ROCK | {"attraction": "2000 N/s"}, "not a known key.*\n?.*Laws with this key: gms"),
        (COMMON | {"elements": 4}, r"is not a list.*\n?.*elements = \[...\]"),
    ],
)
def test_what_does_not_fit_is_refused(friction, message):
    with pytest.raises(DescriptionError, match=message):
        pn.Friction(**friction)


# --- Friction of the law of Karnopp at rest is at most the breakaway force, in each sample.
#
# A mass that stops in its band loses its velocity at once, and with it the damping force of an end stop. If the other
# forces exceed breakaway then, it moves on.

DRIVE = Path(__file__).parents[1] / "data/karnopp_in_its_end_stop.toml"
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
    drive = pn.Drive.load(DRIVE)
    run = pn.simulate(drive, COMMANDS, 0.289, initial=START, sample_rate=2000.0, rtol=rtol)
    resting = run.velocity.to_numpy() == 0.0
    most = np.abs(run.friction_force.to_numpy()[resting]).max()
    assert most <= float(drive.friction.breakaway) * (1.0 + 1e-9)
    assert resting.sum() > 100
