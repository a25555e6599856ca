"""Platforms on legs: kinematics, statics, workspace, and outputs along a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive import units
from pneudrive.describe.tables import starts
from pneudrive.describe.tables.parts import piston_areas
from pneudrive.errors import CommandError, nearest
from pneudrive.lazy_names import upper
from pneudrive.simulation import trajectory
from pneudrive.views import View, Viewed

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

    from pneudrive._core import Platform as CorePlatform
    from pneudrive.arrays import Array, ArrayPair, Bools, Columns, Pair
    from pneudrive.describe import Circuit, Drive

    Pose = Mapping[str, str | float] | ArrayLike

#: Finite-difference step for second derivatives of leg positions, m and rad. Their relative error is 1e-9.
STEP = 1e-5
#: Largest searched distance from `home`, m and rad (assumed), and number of points of the scan.
REACH = {"m": 2.0, "rad": np.radians(89.0)}
POINTS = 400
#: Number of bisections to find a limit; the resolution is a millionth of a millimetre.
HALVINGS = 40
#: Singular value below which a pose counts as nearly singular (assumed).
LEAST_SINGULAR_VALUE = 0.1
#: Number of poses per coordinate in `Platform.reach`, for three legs and for more; and number of directions.
REACH_STEPS, REACH_POINTS = (11, 5), 80


@dataclass(frozen=True)
class Leg:
    """Cylinder of a leg.

    Attributes
    ----------
    name : str
    stroke_m : float
        NaN if the component has no stroke.
    areas_m2, dead_volumes_m3 : tuple of float
        Piston areas and dead volumes of chambers a and b; NaN if the component has no chambers.
    """

    name: str
    stroke_m: float
    areas_m2: Pair
    dead_volumes_m3: Pair

    @classmethod
    def of(cls, circuit: Circuit, name: str) -> Leg:
        """Return the leg that the component of this name moves."""
        own = vars(circuit.components[name]) if name in circuit.components else {}
        bore, rod = own.get("bore_m", np.nan), own.get("rod_diameter_m") or 0.0
        areas = piston_areas(own.get("kind", "").partition("/")[2], bore, rod)
        dead = tuple(own.get(f"dead_volume_{end}_m3", np.nan) for end in "ab")
        return cls(name, own.get("stroke_m", np.nan), areas, dead)


class LegDynamics(NamedTuple):
    """Motion, force and mass of each leg along a motion of the platform, in arrays of shape (m, n).

    Attributes
    ----------
    positions_m, velocities_m_s, accelerations_m_s2 : ndarray
    forces_n : ndarray
        Force of each leg in +x without friction.
    masses_kg : ndarray
        Mass that a force on the leg moves while the forces of the other legs stay constant.
    couplings : ndarray, shape (m, n, n)
        W_ij/W_ii: fraction of the force of leg j that acts on leg i.
    """

    positions_m: Array
    velocities_m_s: Array
    accelerations_m_s2: Array
    forces_n: Array
    masses_kg: Array
    couplings: Array


class Platform(Viewed):
    """A platform on legs, in the coordinates of its component, such as heave, tilt_1 and x.

    Displacements are in m. Tilts are the angles 2 asin(e) in rad, where e is the vector part of the unit quaternion.
    For a 3-RPS, e describes only the tilt, which is applied after a twist about the platform's z axis. The position of
    a leg is the position of its cylinder, in m. In an array of poses, each row is a pose.

    Attributes
    ----------
    name : str
    coordinates : tuple of str
    legs : tuple of Leg
    strokes_m : ndarray, shape (n,)
        Strokes of the legs; NaN if a component has no stroke.
    home : ndarray, shape (n,)
        Pose with every leg at half of its stroke.
    """

    def __init__(self, core: CorePlatform, circuit: Circuit) -> None:
        self.core = core
        self.name = core.name
        self.coordinates = tuple(starts.coordinate_keys(core))
        self.legs = tuple(Leg.of(circuit, name) for name in core.legs)
        self.ambient_pa = circuit.ambient.pressure_pa
        self.heat_capacity_ratio = circuit.gas.core()["heat_capacity_ratio"]
        parts = circuit.core_parts.values()
        supplies = [one["numbers"]["pressure"] for one in parts if one["kind"].startswith("reservoir")]
        self.supply_pa = max(supplies, default=np.nan)
        self.strokes_m = np.array([leg.stroke_m for leg in self.legs])
        middle = np.nan_to_num(0.5 * self.strokes_m)
        self.home = starts.angles(core, core.locate(middle[None])[0])[0]

    def view(self) -> View:
        """Return strokes and loads of the legs at mid stroke, limits of the coordinates, and a drawing."""
        return upper("platform_view")(self)

    @property
    def is_delta(self) -> bool:
        """Whether the legs are carriages with arms."""
        return self.core.coordinates[0] == "x_m" and len(self.core.joints[2]) > 0

    @property
    def force_limits(self) -> Array:
        """Static forces of each leg at supply pressure, towards -x and +x (N, shape (n, 2)); NaN without a supply."""
        areas = np.array([leg.areas_m2 for leg in self.legs])
        return (self.supply_pa - self.ambient_pa) * areas[:, ::-1] * [-1.0, 1.0]

    @property
    def normal_m(self) -> float:
        """Length in m of the normal whose tip `traced` returns: mean radius of the joints, or 0 without tilts."""
        places = np.asarray(self.core.joints[1], dtype=float).reshape(-1, 3)
        return float(np.linalg.norm(places, axis=1).mean()) if "rad" in self.units else 0.0

    def traced(self, pose: Pose) -> Array:
        """Return a point for each pose: tip of the platform's normal, or its origin without tilts (m, shape (m, 3))."""
        frame = self.evaluate(pose)["frame"]
        return frame[:, 0] + self.normal_m * frame[:, 3]

    def reach(self) -> Array:
        """Return the points of `traced` that are farthest in each direction in the workspace (m, shape (k, 3))."""
        limits = self.workspace().limits.values()
        steps = REACH_STEPS[len(self.legs) > 3]
        axes = np.meshgrid(*(np.linspace(low.value, high.value, steps) for low, high in limits), indexing="ij")
        poses = np.stack(axes, axis=-1).reshape(-1, len(self.legs))
        with np.errstate(invalid="ignore"):
            x = self.evaluate(poses)["positions"]
        poses = poses[np.all((x >= 0.0) & ~(x > self.strokes_m), axis=1)]
        points = self.traced(poses[self.singular_values(poses)[:, -1] >= LEAST_SINGULAR_VALUE])
        z = np.linspace(-1.0, 1.0, REACH_POINTS)
        turn = np.arange(REACH_POINTS) * np.pi * (3.0 - np.sqrt(5.0))
        around = np.sqrt(1.0 - z**2)
        directions = np.stack([around * np.cos(turn), around * np.sin(turn), z])
        return points[np.unique(np.argmax(points @ directions, axis=0))] if len(points) else points

    @cached_property
    def is_length(self) -> Bools:
        """Whether each coordinate is a displacement rather than a tilt."""
        return np.array(starts.is_length(self.core))

    @property
    def units(self) -> tuple[str, ...]:
        """SI unit of each coordinate."""
        return tuple("m" if is_long else "rad" for is_long in self.is_length)

    def pose(self, pose: Pose) -> Array:
        """Return poses as an array, shape (n,) or (m, n). Coordinates missing in a mapping are as in `home`.

        Parameters
        ----------
        pose : mapping or array

        Raises
        ------
        CommandError
            A key is unknown, or the number of coordinates is wrong.
        """
        if isinstance(pose, Mapping):
            out = self.home.copy()
            for key, value in pose.items():
                if key not in self.coordinates:
                    remedy = nearest(key, list(self.coordinates))
                    raise CommandError(f"{key} is not a coordinate of {self.name}", remedy=remedy)
                k = self.coordinates.index(key)
                out[k] = units.parse(value, self.units[k]) if isinstance(value, str) else float(value)
            return out
        out = np.asarray(pose, dtype=float)
        if out.ndim not in (1, 2) or out.shape[-1] != len(self.legs):
            what = f"a pose of {self.name} has {len(self.legs)} coordinates, not an array of shape {out.shape}"
            raise CommandError(what, remedy=f"Give {', '.join(self.coordinates)}.")
        return out

    def evaluate(self, pose: Pose, rates: ArrayLike | None = None) -> Columns:
        """Evaluate the mechanism at poses: positions, Jacobian, mass matrix and forces of the core, one row per pose.

        Parameters
        ----------
        pose : mapping or array
        rates : array, optional
            Rates of the coordinates in m/s and rad/s.
        """
        rows = np.atleast_2d(self.pose(pose))
        u = np.zeros_like(rows) if rates is None else np.array(rates, dtype=float, ndmin=2)
        slopes = self._slopes(rows)
        own = self.core.evaluate(starts.coordinates(self.core, rows), u * slopes)
        across = slopes[:, None, :]
        own |= {"jacobian": own["jacobian"] * across, "twist": own["twist"] * across}
        return own | {"forces": own["forces"] * slopes, "mass": own["mass"] * across * slopes[:, :, None]}

    def _slopes(self, rows: Array) -> Array:
        """Return the derivatives of the core's coordinates with respect to the coordinates of the pose."""
        return np.where(self.is_length, 1.0, 0.5 * np.cos(0.5 * rows))

    def inverse(self, pose: Pose) -> Array:
        """Return the positions of the legs in m.

        Raises
        ------
        CommandError
            An arm does not reach the pose.
        """
        pose = self.pose(pose)
        positions = self.evaluate(pose)["positions"].reshape(pose.shape)
        if not np.all(np.isfinite(positions)):
            row, leg = np.argwhere(~np.isfinite(np.atleast_2d(positions)))[0]
            where = self.text(np.atleast_2d(pose)[row])
            remedy = "Choose a pose nearer to the middle of the workspace."
            raise CommandError(f"leg {self.legs[leg].name} does not reach {where}", remedy=remedy)
        return positions

    def forward(self, positions: ArrayLike) -> Array:
        """Return the poses at which the legs have these positions in m.

        The search begins at a pose above the frame. For further rows of an array, it begins at the pose of the previous
        row.

        Parameters
        ----------
        positions : array, shape (n,) or (m, n)

        Raises
        ------
        CommandError
            No pose has these positions. The message names the leg and its position in the nearest pose.
        """
        x = np.asarray(positions, dtype=float)
        rows = np.atleast_2d(x)
        if rows.shape[-1] != len(self.legs):
            raise CommandError(f"{self.name} has {len(self.legs)} legs", rule="one position for each leg")
        q, residuals = self.core.locate(rows)
        poses = starts.angles(self.core, q)
        if not np.all(residuals < starts.CLOSED):
            row = int(np.argmax(~(residuals < starts.CLOSED)))
            at_rest = np.zeros((1, len(self.legs)))
            found = self.core.evaluate(q[row : row + 1], at_rest)["positions"][0]
            leg = int(np.argmax(np.abs(found - rows[row])))
            what = f"no pose of {self.name} fits {self.legs[leg].name}.position = {1e3 * rows[row, leg]:.6g} mm"
            raise CommandError(what, remedy=f"In the nearest pose, the position is {1e3 * found[leg]:.6g} mm.")
        return poses.reshape(x.shape)

    def jacobian(self, pose: Pose) -> Array:
        """Return the derivatives of leg positions with respect to the coordinates, shape (n, n) or (m, n, n)."""
        pose = self.pose(pose)
        return self.evaluate(pose)["jacobian"].reshape(*pose.shape, len(self.legs))

    def load(self, pose: Pose) -> Array:
        """Return the force in N of each leg in +x that holds the platform at rest."""
        pose = self.pose(pose)
        own = self.evaluate(pose)
        transposed = np.swapaxes(own["jacobian"], -1, -2)
        held = np.linalg.solve(transposed, own["forces"][..., None])
        return np.asarray(held, dtype=float).reshape(pose.shape)

    def dynamics(self, pose: Pose, rates: ArrayLike, accelerations: ArrayLike) -> LegDynamics:
        """Return motion, force and moving mass of each leg along a motion of the platform: the inverse dynamics.

        F = J^-T (M q'' + h), W = J M^-1 J^T, m_i = 1/W_ii. M contains rods and barrels. F does not contain friction.

        Parameters
        ----------
        pose : mapping or array
        rates, accelerations : array
            First and second time derivatives of the coordinates of the pose.
        """
        rows = np.atleast_2d(self.pose(pose))
        rates, accelerations = (np.array(one, dtype=float, ndmin=2) for one in (rates, accelerations))
        q, u, second = self.core_motion(rows, rates, accelerations)
        own = self.core.evaluate(q, u)
        jacobian = own["jacobian"]
        mobility = jacobian @ np.linalg.solve(own["mass"], np.swapaxes(jacobian, -1, -2))
        diagonal = np.einsum("nii->ni", mobility)
        needed = np.einsum("nab,nb->na", own["mass"], second) + own["forces"]
        return LegDynamics(
            own["positions"],
            own["velocities"],
            own["accelerations"] + np.einsum("nia,na->ni", jacobian, second),
            np.einsum("nai,na->ni", np.linalg.pinv(jacobian), needed),
            1.0 / diagonal,
            mobility / diagonal[..., None],
        )

    def core_motion(self, rows: Array, rates: Array, accelerations: Array) -> tuple[Array, Array, Array]:
        """Convert poses and two time derivatives to coordinates of the core and their derivatives, shape (m, n)."""
        slopes = self._slopes(rows)
        second = slopes * accelerations - np.where(self.is_length, 0.0, 0.25 * np.sin(0.5 * rows) * rates**2)
        return starts.coordinates(self.core, rows), slopes * rates, second

    def singular_values(self, pose: Pose) -> Array:
        """Return the singular values of the pose Jacobian, largest first, without a unit.

        The twist consists of the velocity of the platform's origin, and of its angular velocity times the mean radius
        of its joints. A small value means that a motion of the platform hardly moves the legs.
        """
        pose = self.pose(pose)
        return starts.singular_values(self.core, starts.coordinates(self.core, np.atleast_2d(pose))).reshape(pose.shape)

    def stiffness(self, pose: Pose, pressures: ArrayLike) -> Array:
        """Return the stiffness of the platform in its coordinates with closed valves, in N/m, N/rad and N m/rad.

        K = J' diag(k) J + sum F_i d2x_i/dq2, with k = kappa (p_a A_a2/V_a + p_b A_b2/V_b) of each leg. The second term
        is the effect of the load that the legs hold at rest.

        Parameters
        ----------
        pose : mapping or array, shape (n,)
        pressures : array, shape (2,) or (n, 2)
            Absolute pressures in Pa in chambers a and b.
        """
        pose = self.pose(pose)
        x = self.inverse(pose)
        jacobian = self.jacobian(pose)
        areas, dead = (np.array([getattr(leg, key) for leg in self.legs]) for key in ("areas_m2", "dead_volumes_m3"))
        volumes = dead + areas * np.column_stack([x, self.strokes_m - x])
        p = np.broadcast_to(np.asarray(pressures, dtype=float), (len(self.legs), 2))
        gas = self.heat_capacity_ratio * np.sum(p * areas**2 / volumes, axis=1)
        step = STEP * np.eye(len(x))
        above, below = self.jacobian(pose + step), self.jacobian(pose - step)
        bent = np.einsum("i,bia->ab", self.load(pose), above - below) / (2.0 * STEP)
        return jacobian.T @ (gas[:, None] * jacobian) + 0.5 * (bent + bent.T)

    def outputs(self, run: xr.Dataset) -> xr.Dataset:
        """Return a run with additional variables: smallest singular value, and force and side force of each leg.

        Parameters
        ----------
        run : xarray.Dataset
            Result of ``pneudrive.simulate``, in SI. It already contains poses, rates and accelerations of the platform.

        Returns
        -------
        xarray.Dataset
            Run with ``tripod.smallest_singular_value``, ``tripod.leg_1_force`` and ``tripod.leg_1_side_force``, see
            `platform_outputs`.

        Raises
        ------
        CommandError
            The run has no column of this platform.
        """
        out = {}
        for column, values in platform_outputs(self, trajectory.columns(run)).items():
            name, unit, what = trajectory.meaning(column)
            out[name] = ("time", values, {"units": unit, "long_name": what, "column": column})
        return run.assign(out)

    def workspace(self) -> PoseLimits:
        """Return the limits of each coordinate, starting at `home`: ends of strokes, reach, or singular poses."""
        each = enumerate(self.coordinates)
        return PoseLimits({key: (_limit(self, k, -1.0), _limit(self, k, 1.0)) for k, key in each})

    def text(self, pose: ArrayLike) -> str:
        """Return a pose as text, in mm and degrees."""
        return starts.pose_text(self.core, np.asarray(pose, dtype=float))


@dataclass(frozen=True)
class Limit:
    """Limit of one coordinate.

    Attributes
    ----------
    value : float
        Coordinate at the limit, in m or rad.
    reason : str
        Leg that reaches the end of its stroke, "singular pose", "out of reach" or "none found".
    """

    value: float
    reason: str


@dataclass(frozen=True)
class PoseLimits:
    """Limits of each coordinate, while the other coordinates stay as in the pose `home`.

    Attributes
    ----------
    limits : dict
        Lower and upper `Limit` of each coordinate.
    """

    limits: dict[str, tuple[Limit, Limit]]


def _limit(platform: Platform, k: int, sign: float) -> Limit:
    reach = sign * np.linspace(0.0, REACH[platform.units[k]], POINTS)
    if platform.units[k] == "rad":
        reach = reach[np.abs(platform.home[k] + reach) < np.pi - 1e-6]
    poses = np.tile(platform.home, (len(reach), 1))
    poses[:, k] += reach
    wrong = next((i for i, pose in enumerate(poses) if _reason(platform, pose)), None)
    if wrong is None:
        return Limit(float(poses[-1, k]), "none found")
    inside, outside = poses[max(wrong - 1, 0)], poses[wrong]
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        inside, outside = (inside, middle) if _reason(platform, middle) else (middle, outside)
    return Limit(float(inside[k]), _reason(platform, outside))


def _reason(platform: Platform, pose: Array) -> str:
    """Return the reason why a pose is outside the workspace, or an empty text if it is inside."""
    with np.errstate(invalid="ignore"):
        positions = platform.evaluate(pose)["positions"][0]
    if not np.all(np.isfinite(positions)):
        return "out of reach"
    for leg, x in zip(platform.legs, positions, strict=True):
        if x < 0.0 or x > leg.stroke_m:
            return f"{leg.name} {'in' if x < 0.0 else 'out'}"
    return "singular pose" if platform.singular_values(pose)[-1] < LEAST_SINGULAR_VALUE else ""


def is_platform(circuit: Circuit) -> bool:
    """Return whether a circuit has a platform."""
    return any(str(one.entry["kind"]).startswith("platform/") for one in circuit.components.values())


def platform(circuit: Circuit, name: str | None = None) -> Platform:
    """Return a platform of a circuit.

    Parameters
    ----------
    circuit : Circuit
    name : str, optional
        Name of the component, if the circuit has several platforms.

    Raises
    ------
    CommandError
        The circuit has no platform, or has several and no name is given.

    Examples
    --------
    >>> import pneudrive as pn
    >>> circuit = pn.Circuit.load("examples/tripod.toml")
    >>> tripod = pn.platform(circuit)
    >>> (1e3 * tripod.inverse({"tilt_1": "5 deg"})).round(1).tolist()
    [100.0, 115.1, 85.1]
    """
    each = {own.name: own for own in platforms(circuit)}
    if not each:
        raise CommandError("the circuit has no platform", remedy='Add a component with kind = "platform/3-rps".')
    if name is None and len(each) > 1:
        raise CommandError("the circuit has several platforms", remedy=f"Name one of {', '.join(each)}.")
    if name is not None and name not in each:
        raise CommandError(f"{name} is not a platform", remedy=nearest(name, list(each)))
    return each[name or next(iter(each))]


def platforms(described: Circuit | Drive) -> list[Platform]:
    """Return all platforms of a circuit; a drive has none."""
    circuit = described.circuit
    return [Platform(own, circuit) for own in circuit.system.compiled().platforms]


#: Finite-difference step for the rate of the twist along the motion, s.
STEP_S = 1e-5
#: Samples that are evaluated together.
AT_ONCE = 20_000


def pose_columns(platform: Platform) -> list[list[str]]:
    """Return the names of the columns in a run for the coordinates, for their rates and for their accelerations."""
    out = []
    for lengths, tilts in (("m", "rad"), ("rate_m_s", "rate_rad_s"), ("acceleration_m_s2", "acceleration_rad_s2")):
        ends = np.where(platform.is_length, lengths, tilts)
        out.append([f"{platform.name}.{key}_{end}" for key, end in zip(platform.coordinates, ends, strict=True)])
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
        raise CommandError.of("platforms.missing-column", missing=missing, platform=platform)
    pose, rate, acceleration = (np.column_stack([columns[name] for name in row]) for row in names)
    return pose, rate, acceleration


def platform_outputs(platform: Platform, columns: Mapping[str, Array]) -> Columns:
    """Return outputs of a platform along a run that the run itself does not contain.

    ``tripod.smallest_singular_value`` has no unit. ``tripod.leg_1_force_n`` is the force in +x along leg 1 that carries
    and accelerates platform, payload, rods and barrels. It is the sum of pressure forces, end stop force and external
    force, minus friction. ``tripod.leg_1_side_force_n`` is the magnitude of the force across leg 1 at its joint on the
    platform. For a delta, it is the force across the guide of the carriage, including the weight of the carriage.

    The forces along the legs follow from the mass matrix and the forces of the mechanism. The side forces follow from
    the momentum balances of the platform and of each leg.

    Parameters
    ----------
    platform : Platform
    columns : mapping
        Columns of a run in SI, with the names that they have in a file.

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


def _outputs(platform: Platform, pose: Array, rate: Array, acceleration: Array) -> Array:
    own = platform.dynamics(pose, rate, acceleration)
    x, moved, force = own.positions_m, own.accelerations_m_s2, own.forces_n
    body = MovingPlatform.of(platform, *platform.core_motion(pose, rate, acceleration))
    side = _guides(body, x, moved, force) if platform.is_delta else _legs(body)
    return np.column_stack([platform.singular_values(pose)[:, -1], force, np.linalg.norm(side, axis=2)])


class MovingPlatform(NamedTuple):
    """Positions, velocities and accelerations of points of a platform in SI, of shape (m, 3) or (m, n, 3).

    Attributes
    ----------
    masses : dict
        Masses from the core, and ``lift``, the acceleration of gravity with opposite sign.
    frame, directions : ndarray, shape (n, 3)
        Positions of the joints on the frame, and directions of the axes of hinges or guides.
    origin, axes : ndarray
        Position and acceleration of the origin, shape (2, m, 3), and unit vectors of the axes, shape (m, 3, 3).
    turn : ndarray, shape (2, m, 3)
        Angular velocity and acceleration.
    joints : ndarray, shape (3, m, n, 3)
        Position, velocity and acceleration of the joints on the platform.
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
        """Return the platform at coordinates `q` of the core, with first and second derivatives `u` and `du`."""
        core = platform.core
        frame, places, directions = (np.asarray(one, dtype=float).reshape(-1, 3) for one in core.joints)
        own = core.evaluate(q, u)
        ahead, behind = (core.evaluate(q + sign * STEP_S * u, u)["twist"] for sign in (1.0, -1.0))
        twist = np.einsum("mik,mk->mi", own["twist"], u)
        rate = np.einsum("mik,mk->mi", own["twist"], du)
        rate += np.einsum("mik,mk->mi", (ahead - behind) / (2.0 * STEP_S), u)
        axes = own["frame"][:, 1:]
        turn = np.stack([twist[:, 3:], rate[:, 3:]])
        origin = np.stack([own["frame"][:, 0], rate[:, :3]])
        arms = places @ axes
        speeds = twist[:, None, :3] + np.cross(turn[0][:, None], arms)
        masses = {name: np.asarray(one) for name, one in core.masses}
        body = cls(masses, frame, directions, origin, axes, turn, np.zeros(0))
        joints = np.stack([origin[0][:, None] + arms, speeds, body.acceleration(arms)])
        return body._replace(joints=joints)

    def acceleration(self, arms: Array) -> Array:
        """Return the accelerations of points, from their positions `arms` relative to the origin (shape (m, n, 3))."""
        velocity, rate = self.turn[:, :, None]
        return self.origin[1][:, None] + np.cross(rate, arms) + np.cross(velocity, np.cross(velocity, arms))

    def needed(self) -> ArrayPair:
        """Return force (N) and moment about the origin (N m) that accelerate and carry platform and payload."""
        masses = self.masses
        arms = np.stack([masses["centre"] @ self.axes, masses["payload_at"] @ self.axes], axis=1)
        forces = np.array([masses["mass"], masses["payload"]]) * (self.acceleration(arms) + masses["lift"])
        inertia = np.einsum("mki,k,mkj->mij", self.axes, masses["inertia"], self.axes)
        velocity, rate = self.turn
        spin = np.einsum("mij,mj->mi", inertia, velocity)
        moment = np.einsum("mij,mj->mi", inertia, rate) + np.cross(velocity, spin)
        return forces.sum(axis=1), moment + np.cross(arms, forces).sum(axis=1)


def _legs(body: MovingPlatform) -> Array:
    """Return the forces in N of the legs on the platform, perpendicular to the legs, shape (m, n, 3).

    A leg has the unit vector n and the length l. About its joint on the frame, it has the moment of inertia j and the
    mass moment m. Then l n x f = -d(j n x n')/dt - m n x g, where -g is the acceleration of gravity. A hinge adds a
    force along its axis, which is found from the balance of the platform.
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
    across = -(inertia * n2 + 2.0 * rods * to_rod * speed * n1 + moment * masses["lift"]) / length
    if not len(body.directions):
        return across - np.sum(across * n, axis=2, keepdims=True) * n
    hinge = np.broadcast_to(body.directions, n.shape)
    in_plane = np.cross(hinge, n)
    across = np.sum(across * in_plane, axis=2, keepdims=True) * in_plane
    force, torque = body.needed()
    arms = place - body.origin[0][:, None]
    turning = np.cross(arms, across).sum(axis=1)
    known = np.concatenate([force - across.sum(axis=1), torque - turning], axis=1)
    units = np.concatenate([n, hinge], axis=1)
    wrenches = np.concatenate([units, np.cross(np.tile(arms, (1, 2, 1)), units)], axis=2)
    solved = np.einsum("mij,mj->mi", np.linalg.pinv(np.swapaxes(wrenches, 1, 2)), known)
    return across + solved[:, len(body.frame) :, None] * hinge


def _guides(body: MovingPlatform, x: Array, acceleration: Array, force: Array) -> Array:
    """Return the forces in N of the carriages on their guides, perpendicular to the guides, shape (m, n, 3).

    An arm is a uniform rod of mass m along the unit vector n. Its ends at carriage and platform have the accelerations
    g_1 and g_2 minus gravity. Its force on the carriage is t n along n, and -m (g_1/3 + g_2/6) perpendicular to n. The
    balance of forces along the guide gives t.

    Parameters
    ----------
    body : MovingPlatform
    x, acceleration, force : ndarray, shape (m, n)
        Position in m, acceleration in m/s2 and drive force in N of each carriage.
    """
    guide, carriages, lift = body.directions, body.masses["rods"][:, None], body.masses["lift"]
    arm = body.joints[0] - body.frame - x[..., None] * guide
    n = arm / np.linalg.norm(arm, axis=2, keepdims=True)
    of_carriage, of_platform = acceleration[..., None] * guide + lift, body.joints[2] + lift
    across = -body.masses["barrel"] * (of_carriage / 3.0 + of_platform / 6.0)
    across -= np.sum(across * n, axis=2, keepdims=True) * n
    along = np.sum((carriages * of_carriage - across) * guide, axis=2) - force
    total = across + (along / np.sum(n * guide, axis=2))[..., None] * n - carriages * lift
    return total - np.sum(total * guide, axis=2, keepdims=True) * guide
