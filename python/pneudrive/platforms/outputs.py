"""Outputs of a platform along a run: poses, singular values, and the forces at its legs."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive.constants import STANDARD_GRAVITY_M_S2
from pneudrive.errors import CommandError
from pneudrive.simulation.trajectory import columns as columns_of
from pneudrive.simulation.trajectory import meaning

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.platforms.kinematics import Platform

    Array = NDArray[np.float64]

#: Step of the differences that give the rate of the twist along the motion, s.
STEP_S = 1e-5
#: Samples that are evaluated together.
AT_ONCE = 20_000
UP = np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])


def pose_columns(platform: Platform) -> list[list[str]]:
    """Return the columns of a run with the coordinates, their rates and their accelerations."""
    out = []
    for lengths, angles in (("m", "rad"), ("rate_m_s", "rate_rad_s"), ("acceleration_m_s2", "acceleration_rad_s2")):
        ends = [lengths if unit == "m" else angles for unit in platform.units]
        names = [f"{platform.name}.{key}_{end}" for key, end in zip(platform.coordinates, ends, strict=True)]
        out.append(names)
    return out


def motion_of(platform: Platform, columns: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    """Return the poses of a run, their rates and their accelerations, each of shape (m, n), in m, rad and s.

    Raises
    ------
    CommandError
        The run has no such columns.
    """
    names = pose_columns(platform)
    missing = next((name for row in names for name in row if name not in columns), None)
    if missing is not None:
        what = f"the run has no column {missing}"
        remedy = f"Simulate the circuit with {platform.name}, and choose a file of that run."
        raise CommandError(what, rule=f"a run with the platform {platform.name}", remedy=remedy)
    pose, rate, acceleration = (np.column_stack([np.asarray(columns[name]) for name in row]) for row in names)
    return pose, rate, acceleration


def platform_outputs(platform: Platform, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return outputs of a platform along a run that are not among its columns.

    ``tripod.smallest_singular_value`` has no unit. ``tripod.leg_1_force_n`` is the force along leg 1 that carries and
    accelerates platform, payload, rods and barrels, in +x: pressures, end stop and external force, less friction.
    ``tripod.leg_1_side_force_n`` is the magnitude of the force across leg 1 at its joint on the platform. For a delta
    it is the force across the guide of the carriage, with the weight of the carriage.

    The forces along the legs follow from the mass matrix and the forces of the mechanism. The side forces follow from
    the balances of momentum of the platform and of each leg.

    Parameters
    ----------
    platform : Platform
    columns : mapping
        Columns of a run, SI, with the names of a file.

    Returns
    -------
    dict
        Column -> values, shape (m,).

    Raises
    ------
    CommandError
        The run has no column of this platform.
    """
    motion = motion_of(platform, columns)
    parts = [
        _outputs(platform, *(one[first : first + AT_ONCE] for one in motion))
        for first in range(0, len(motion[0]), AT_ONCE)
    ]
    values = np.concatenate(parts)
    legs = range(1, len(platform.legs) + 1)
    names = ["smallest_singular_value", *(f"leg_{i}_force_n" for i in legs), *(f"leg_{i}_side_force_n" for i in legs)]
    return {f"{platform.name}.{name}": values[:, k].copy() for k, name in enumerate(names)}


def with_platform_outputs(platform: Platform, run: xr.Dataset) -> xr.Dataset:
    """Return a run with `platform_outputs`, see `Platform.outputs`."""
    out = {}
    for column, values in platform_outputs(platform, columns_of(run)).items():
        name, unit, what = meaning(column)
        out[name] = ("time", values, {"units": unit, "long_name": what, "column": column})
    return run.assign(out)


def _outputs(platform: Platform, pose: Array, rate: Array, acceleration: Array) -> Array:
    own = platform.dynamics(pose, rate, acceleration)
    x, moved, force = own.positions_m, own.accelerations_m_s2, own.forces_n
    body = MovingPlatform.of(platform, *platform.core_motion(pose, rate, acceleration))
    side = _guides(body, x, moved, force) if platform.is_delta else _legs(body)
    return np.column_stack([platform.singular_values(pose)[:, -1], force, np.linalg.norm(side, axis=2)])


class MovingPlatform(NamedTuple):
    """A moving platform: positions, m, velocities and accelerations of its points, each of shape (m, 3) or (m, n, 3).

    Attributes
    ----------
    masses : dict
        Of the core.
    frame, directions : ndarray, shape (n, 3)
        Joints on the frame; axes of hinges or guides.
    origin, axes : ndarray
        Place and acceleration of the origin, shape (2, m, 3), and unit vectors of the axes, shape (m, 3, 3).
    turn : ndarray, shape (2, m, 3)
        Angular velocity and acceleration.
    joints : ndarray, shape (3, m, n, 3)
        Place, velocity and acceleration of the joints on the platform.
    """

    masses: dict[str, Array]
    frame: Array
    directions: Array
    origin: Array
    axes: Array
    turn: Array
    joints: Array

    @classmethod
    def of(cls, platform: Platform, q: Array, u: Array, du: Array) -> MovingPlatform:
        """Return the platform at coordinates of the core, with their first and second rates."""
        core = platform.core
        frame, places, directions = (np.asarray(one, dtype=float).reshape(-1, 3) for one in core.joints)
        own = core.evaluate(q, u)
        ahead, behind = (core.evaluate(q + sign * STEP_S * u, u)["twist"] for sign in (1.0, -1.0))
        twist = np.einsum("mik,mk->mi", own["twist"], u)
        rate = np.einsum("mik,mk->mi", own["twist"], du)
        rate += np.einsum("mik,mk->mi", (ahead - behind) / (2.0 * STEP_S), u)
        axes, turn = own["frame"][:, 1:], np.stack([twist[:, 3:], rate[:, 3:]])
        origin = np.stack([own["frame"][:, 0], rate[:, :3]])
        arms = places @ axes
        speeds = twist[:, None, :3] + np.cross(turn[0][:, None], arms)
        masses = {name: np.asarray(one) for name, one in core.masses}
        body = cls(masses, frame, directions, origin, axes, turn, np.zeros(0))
        joints = np.stack([origin[0][:, None] + arms, speeds, body.acceleration(arms)])
        return body._replace(joints=joints)

    def acceleration(self, arms: Array) -> Array:
        """Return the accelerations of points at these arms from the origin, shape (m, n, 3)."""
        velocity, rate = self.turn[:, :, None]
        return self.origin[1][:, None] + np.cross(rate, arms) + np.cross(velocity, np.cross(velocity, arms))

    def needed(self) -> tuple[Array, Array]:
        """Return the force, N, and the moment about the origin, N m, that move platform and payload."""
        masses = self.masses
        arms = np.stack([masses["centre"] @ self.axes, masses["payload_at"] @ self.axes], axis=1)
        forces = np.array([masses["mass"], masses["payload"]]) * (self.acceleration(arms) + UP)
        inertia = np.einsum("mki,k,mkj->mij", self.axes, masses["inertia"], self.axes)
        velocity, rate = self.turn
        spin = np.einsum("mij,mj->mi", inertia, velocity)
        moment = np.einsum("mij,mj->mi", inertia, rate) + np.cross(velocity, spin)
        return forces.sum(axis=1), moment + np.cross(arms, forces).sum(axis=1)


def _legs(body: MovingPlatform) -> Array:
    """Return the forces of legs on the platform across them, N, shape (m, n, 3).

    A leg has the unit vector n, the length l, and about its joint on the frame the moment of inertia j and the mass
    moment m. Then l n x f = -d(j n x n')/dt - g m n x e_z. A hinge adds a force along its axis. This force is found
    from the balance of the platform.
    """
    place, velocity, acceleration = body.joints
    masses = body.masses
    along = place - body.frame
    length = np.linalg.norm(along, axis=2, keepdims=True)
    n = along / length
    speed = np.sum(velocity * n, axis=2, keepdims=True)
    n1 = (velocity - speed * n) / length
    n2 = (acceleration - 2.0 * speed * n1) / length
    to_rod, rods = length - masses["rod_centre"], masses["rods"][:, None]
    moment = masses["barrel"] * masses["barrel_centre"] + rods * to_rod
    inertia = masses["barrel"] * masses["barrel_centre"] ** 2 + rods * to_rod**2 + masses["leg_inertia"]
    across = -(inertia * n2 + 2.0 * rods * to_rod * speed * n1 + moment * UP) / length
    if not len(body.directions):
        return across - np.sum(across * n, axis=2, keepdims=True) * n
    hinge = np.broadcast_to(body.directions, n.shape)
    in_plane = np.cross(hinge, n)
    across = np.sum(across * in_plane, axis=2, keepdims=True) * in_plane
    force, torque = body.needed()
    arms = place - body.origin[0][:, None]
    known = np.concatenate([force - across.sum(axis=1), torque - np.cross(arms, across).sum(axis=1)], axis=1)
    units = np.concatenate([n, hinge], axis=1)
    wrenches = np.concatenate([units, np.cross(np.tile(arms, (1, 2, 1)), units)], axis=2)
    solved = np.einsum("mij,mj->mi", np.linalg.pinv(np.swapaxes(wrenches, 1, 2)), known)
    return across + solved[:, len(body.frame) :, None] * hinge


def _guides(body: MovingPlatform, x: Array, acceleration: Array, force: Array) -> Array:
    """Return the forces of carriages on their guides across them, N, shape (m, n, 3).

    An arm is a uniform rod of mass m along the unit vector n. Its ends at carriage and platform have the accelerations
    g_1 and g_2, less that of gravity. Its force on the carriage is t n, and -m (g_1/3 + g_2/6) across n. The balance of
    forces along the guide gives t.

    Parameters
    ----------
    body : MovingPlatform
    x, acceleration, force : ndarray, shape (m, n)
        Position, m, acceleration, m/s2, and drive force, N, of each carriage.
    """
    guide, carriages = body.directions, body.masses["rods"][:, None]
    arm = body.joints[0] - body.frame - x[..., None] * guide
    n = arm / np.linalg.norm(arm, axis=2, keepdims=True)
    of_carriage, of_platform = acceleration[..., None] * guide + UP, body.joints[2] + UP
    across = -body.masses["barrel"] * (of_carriage / 3.0 + of_platform / 6.0)
    across -= np.sum(across * n, axis=2, keepdims=True) * n
    along = np.sum((carriages * of_carriage - across) * guide, axis=2) - force
    total = across + (along / np.sum(n * guide, axis=2))[..., None] * n - carriages * UP
    return total - np.sum(total * guide, axis=2, keepdims=True) * guide
