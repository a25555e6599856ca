"""Kinematics of platforms: closed forms, forward of inverse, virtual work, starts and messages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from oracle.platforms import described

TRIPOD = Path(__file__).parents[3] / "examples" / "tripod.toml"
KINDS = ["platform/3-rps", "platform/3-upu", "platform/6-ups", "platform/linear-delta"]
POSES = 2000


def machine(kind):
    """Return a circuit with slides at the legs."""
    return pn.Circuit(**described(kind, 250.0, 200.0, 350.0, 12.0, 14.0))


def poses(own, rng):
    """Return random poses around one above the frame."""
    height = -0.25 if own.core.joints[2] and own.coordinates[0] == "x" else 0.42
    middle = [height if key in ("heave", "z") else 0.0 for key in own.coordinates]
    size = [0.05 if unit == "m" else 0.3 for unit in own.units]
    return middle + rng.uniform(-1.0, 1.0, (POSES, len(middle))) * size


@pytest.mark.parametrize("kind", KINDS)
def test_forward_of_inverse_and_jacobian(kind):
    own, rng = pn.platform(machine(kind)), np.random.default_rng(7)
    each = poses(own, rng)
    found = own.forward(own.inverse(each))
    assert np.max(np.abs(found - each)) < 1e-12
    # Virtual work: the work of leg forces in a small motion is that of the generalised forces.
    step = 1e-5 * rng.standard_normal(each.shape)
    moved = (own.inverse(each + step) - own.inverse(each - step)) / 2.0
    slopes = np.einsum("mij,mj->mi", own.jacobian(each), step)
    assert np.max(np.abs(moved - slopes)) < 1e-12


def test_a_symmetric_tripod_has_the_singular_values_of_its_closed_form():
    """h/l (sqrt 3, sqrt 1.5, sqrt 1.5) at no tilt, with the angular velocity times the radius of the platform."""
    own = pn.platform(machine("platform/3-rps"))
    height = 0.43
    length = np.hypot(height, 0.05)
    pose = {"heave": height}
    assert own.inverse(pose) == pytest.approx(3 * [length - 0.35], abs=1e-14)
    expected = height / length * np.sqrt([3.0, 1.5, 1.5])
    assert own.singular_values(pose) == pytest.approx(expected, rel=1e-12)
    assert own.load(pose) == pytest.approx(3 * [(6.0 + 1.8) * 9.80665 / 3.0 * length / height], rel=1e-12)


def test_stiffness_is_the_slope_of_the_forces_of_the_legs():
    """Legs as springs of the gas, at forces that carry a load: differences of J' F over the pose."""
    own = pn.platform(pn.Circuit.load(TRIPOD))
    pose, pressures = own.pose({"heave": "440 mm", "tilt_1": "6 deg"}), (4e5, 3.5e5)
    x, force = own.inverse(pose), own.load(pose)
    areas = 0.25 * np.pi * np.array([0.032**2, 0.032**2 - 0.012**2])
    volumes = 5e-6 + areas * np.column_stack([x, 0.2 - x])
    gas = 1.4 * np.sum(pressures * areas**2 / volumes, axis=1)

    def work(at):
        return own.jacobian(at).T @ (force + gas * (own.inverse(at) - x))

    step = 1e-5 * np.eye(3)
    slopes = np.column_stack([(work(pose + one) - work(pose - one)) / 2e-5 for one in step])
    assert own.stiffness(pose, pressures) == pytest.approx(slopes, rel=1e-6)


def test_a_run_starts_from_a_pose():
    circuit = pn.Circuit.load(TRIPOD)
    run = circuit.simulate(None, "1 ms", initial={"tripod.heave": "445 mm", "tripod.tilt_2": "-4 deg"})
    assert float(run["tripod.heave"][0]) == pytest.approx(0.445, abs=1e-12)
    assert float(run["tripod.tilt_1"][0]) == pytest.approx(0.0, abs=1e-12)
    assert float(run["tripod.tilt_2"][0]) == pytest.approx(np.radians(-4.0), abs=1e-12)


def test_forward_names_the_leg_that_no_pose_reaches():
    own = pn.platform(pn.Circuit.load(TRIPOD))
    with pytest.raises(pn.PneudriveError, match=r"leg_\d.position = .* mm.\n.*In the nearest pose"):
        own.forward([-0.3, 0.4, 0.1])
