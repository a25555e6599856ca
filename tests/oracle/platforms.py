"""Rigid dynamics of platforms on legs, by Lagrange multipliers in redundant coordinates.

It shares no code and no coordinates with the product. A platform has its place and its angular velocity. Each leg has a
unit vector and a length, or the path of its carriage. Constraints close the legs:

    M x'' + h = Q + C' l,   C x'' = -g

Legs of 3-RPS have hinges. All places are in m, in the axes of the frame; joints of the platform in its own axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root
from scipy.spatial.transform import Rotation

GRAVITY = 9.80665
Array = NDArray[np.float64]


def cross(a: Array) -> Array:
    """Return the matrix of a vector product from the left."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@dataclass
class Machine:
    """A platform: kind, joints, hinge axes or directions of carriages, lengths at x = 0, and masses."""

    kind: str
    frame: Array
    platform: Array
    directions: Array | None
    lengths: Array
    mass: float
    centre: Array
    inertia: Array
    rods: Array
    payload: float = 0.0
    payload_at: Array | None = None
    rod_centre: float = 0.0
    barrel_mass: float = 0.0
    barrel_centre: float = 0.0
    leg_inertia: float = 0.0
    down: Array = field(default_factory=lambda: np.array([0.0, 0.0, -GRAVITY]))

    @property
    def turns(self) -> bool:
        """Whether the platform rotates."""
        return self.kind in ("platform/3-rps", "platform/6-ups")

    def joints(self, place: Array, turn: Array) -> Array:
        """Return the joints on the platform."""
        return place + self.platform @ turn.T

    def positions(self, place: Array, turn: Array) -> Array:
        """Return the positions x of the legs."""
        d = self.joints(place, turn) - self.frame
        if self.kind == "platform/linear-delta":
            along = np.sum(d * self.directions, axis=1)
            return along + np.sqrt(self.lengths**2 - np.sum(d * d, axis=1) + along**2)
        return np.linalg.norm(d, axis=1) - self.lengths

    def closed(self, place: Array, turn: Array, height: float, tilt: Array) -> tuple[Array, Array]:
        """Return a pose near the given one whose hinges hold, at this height and tilt (3-RPS)."""
        if self.kind != "platform/3-rps":
            return place, turn

        def off(x: Array) -> Array:
            own = Rotation.from_rotvec([*tilt, 0.0]).as_matrix() @ Rotation.from_rotvec([0.0, 0.0, x[2]]).as_matrix()
            d = self.joints(np.array([x[0], x[1], height]), own) - self.frame
            return np.sum(d * self.directions, axis=1)

        found = root(off, [*place[:2], 0.0], tol=1e-14, options={"xtol": 1e-15})
        x = found.x
        own = Rotation.from_rotvec([*tilt, 0.0]).as_matrix() @ Rotation.from_rotvec([0.0, 0.0, x[2]]).as_matrix()
        return np.array([x[0], x[1], height]), own

    def rate_rows(self, turn: Array) -> Array:
        """Return the rows of hinge constraints on (velocity, angular velocity)."""
        rows = []
        if self.kind == "platform/3-rps":
            for h, b in zip(self.directions, self.platform, strict=True):
                rows.append(np.concatenate([h, -h @ cross(turn @ b)]))
        if not self.turns:
            rows += [np.eye(6)[k] for k in (3, 4, 5)]
        return np.array(rows).reshape(-1, 6)

    def free_rates(self, turn: Array, wished: Array) -> Array:
        """Return the (velocity, angular velocity) nearest to a wish that the constraints allow."""
        rows = self.rate_rows(turn)
        return wished - np.linalg.pinv(rows) @ (rows @ wished) if len(rows) else wished

    def leg_rates(self, place: Array, turn: Array, rates: Array) -> Array:
        """Return the velocities of the legs."""
        speeds = rates[:3] + np.cross(rates[3:], self.platform @ turn.T)
        d = self.joints(place, turn) - self.frame
        if self.kind == "platform/linear-delta":
            arms = d - self.positions(place, turn)[:, None] * self.directions
            return np.sum(arms * speeds, axis=1) / np.sum(arms * self.directions, axis=1)
        return np.sum(d * speeds, axis=1) / np.linalg.norm(d, axis=1)

    def accelerations(self, place: Array, turn: Array, rates: Array, forces: Array) -> tuple[Array, Array]:
        """Return the accelerations of the platform, linear and angular, and of the legs, under forces in +x, N."""
        found, which, _, _ = self.solved(place, turn, rates, forces)
        return found[:6], found[which]

    def side_forces(self, place: Array, turn: Array, rates: Array, forces: Array) -> Array:
        """Return the forces across the legs at their joints on the platform, or across the guides of carriages, N."""
        found, which, multipliers, joints = self.solved(place, turn, rates, forces)
        up, out = -self.down, []
        first = len(self.rate_rows(turn))
        for i, (b, at) in enumerate(zip(self.platform, which, strict=True)):
            d = place + turn @ b - self.frame[i]
            if self.kind == "platform/linear-delta":
                axis, force = self.directions[i], multipliers[first + i] * joints[i][0]
                ends = found[at] * axis + up, joints[i][1] @ found[: joints[i][1].shape[1]] + joints[i][2] + up
                force = force - self.barrel_mass * (ends[0] / 3.0 + ends[1] / 6.0) - self.rods[i] * up
            else:
                axis, force = d / np.linalg.norm(d), -multipliers[first + 4 * i : first + 4 * i + 3]
                if self.kind == "platform/3-rps":
                    force = force - multipliers[i] * self.directions[i]
            out.append(np.linalg.norm(force - (force @ axis) * axis))
        return np.array(out)

    def solved(
        self, place: Array, turn: Array, rates: Array, forces: Array
    ) -> tuple[Array, list[int], Array, list[tuple[Array, Array, Array]]]:
        """Return accelerations, the places of the legs among them, multipliers, and arm and joint of each carriage."""
        arms: list[tuple[Array, Array, Array]] = []
        v, w = rates[:3], rates[3:]
        n, delta = len(self.frame), self.kind == "platform/linear-delta"
        size = 6 + (n if delta else 4 * n)
        mass, bias = np.zeros((size, size)), np.zeros(size)
        rows, gammas = [], []

        def point(m: float, a: Array, a0: Array, heavy: float | None = None) -> None:
            mass[:] += m * a.T @ a
            bias[:] += a.T @ (m * a0 - (m if heavy is None else heavy) * self.down)

        def on_platform(b: Array) -> tuple[Array, Array]:
            arm, a = turn @ b, np.zeros((3, size))
            a[:, :3], a[:, 3:6] = np.eye(3), -cross(arm)
            return a, np.cross(w, np.cross(w, arm))

        point(self.mass, *on_platform(self.centre if self.turns else np.zeros(3)))
        point(self.payload, *on_platform(self.payload_at if self.turns else np.zeros(3)))
        if self.turns:
            world = turn @ np.diag(self.inertia) @ turn.T
            mass[3:6, 3:6] += world
            bias[3:6] += np.cross(w, world @ w)
        rows += [np.concatenate([row, np.zeros(size - 6)]) for row in self.rate_rows(turn)]
        if self.kind == "platform/3-rps":
            gammas += [
                h @ np.cross(w, np.cross(w, turn @ b)) for h, b in zip(self.directions, self.platform, strict=True)
            ]
        elif not self.turns:
            gammas += [0.0] * 3
        moved, speeds = self.positions(place, turn), self.leg_rates(place, turn, rates)
        which = []
        for i, b in enumerate(self.platform):
            joint, joint0 = on_platform(b)
            d = place + turn @ b - self.frame[i]
            speed = v + np.cross(w, turn @ b)
            if delta:
                at = 6 + i
                direction = self.directions[i]
                carriage = np.zeros((3, size))
                carriage[:, at] = direction
                point(self.rods[i] + self.barrel_mass / 6.0, carriage, np.zeros(3))
                point(self.barrel_mass / 6.0, joint, joint0)
                point(self.barrel_mass * 2.0 / 3.0, 0.5 * (joint + carriage), 0.5 * joint0)
                arm, arm_rate = d - moved[i] * direction, speed - speeds[i] * direction
                rows.append(arm @ (joint - carriage))
                arms.append((arm, joint, joint0))
                gammas.append(arm @ joint0 + arm_rate @ arm_rate)
            else:
                length = moved[i] + self.lengths[i]
                unit = d / length
                unit_rate = (speed - speeds[i] * unit) / length
                at = 6 + 4 * i + 3
                own, long = np.zeros((3, size)), np.zeros((3, size))
                own[:, at - 3 : at] = np.eye(3)
                long[:, at] = unit
                moment = self.barrel_mass * self.barrel_centre
                point(moment * self.barrel_centre + self.leg_inertia, own, np.zeros(3), heavy=moment)
                rod = (length - self.rod_centre) * own + long
                point(self.rods[i], rod, 2.0 * speeds[i] * unit_rate)
                for k in range(3):
                    rows.append((joint - length * own - long)[k])
                    gammas.append((joint0 - 2.0 * speeds[i] * unit_rate)[k])
                rows.append(unit @ own)
                gammas.append(unit_rate @ unit_rate)
            which.append(at)
        bias[which] -= forces
        c = np.array(rows)
        kkt = np.block([[mass, c.T], [c, np.zeros((len(c), len(c)))]])
        right = np.concatenate([-bias, -np.array(gammas)])
        scale = 1.0 / np.sqrt(np.maximum(np.abs(kkt).max(axis=1), 1e-12))
        found = scale * np.linalg.solve(scale[:, None] * kkt * scale, scale * right)
        return found[:size], which, found[size:], arms


def random_machine(kind: str, rng: np.random.Generator) -> Machine:
    """Return a machine with unequal joints, hinges, lengths and masses, and gravity in any direction."""
    n = 6 if kind == "platform/6-ups" else 3
    third = 2.0 * np.pi / 3.0
    if n == 3:
        base, top = np.arange(3) * third, np.arange(3) * third
    else:
        middle, sign = (np.arange(6) // 2) * third, np.where(np.arange(6) % 2, 1.0, -1.0)
        base, top = middle + 0.2 * sign, middle + sign * (0.5 * third - 0.25)
    base, top = base + rng.uniform(-0.2, 0.2, n), top + rng.uniform(-0.2, 0.2, n)

    def places(radius: float, angles: Array) -> Array:
        own = radius * rng.uniform(0.85, 1.15, n)
        return np.column_stack([own * np.cos(angles), own * np.sin(angles), rng.uniform(-0.02, 0.02, n)])

    frame, platform = places(0.3, base), places(0.18, top)
    directions = None
    lengths = rng.uniform(0.33, 0.37, n)
    if kind == "platform/3-rps":
        angles = base + 0.5 * np.pi + rng.uniform(-0.25, 0.25, 3)
        directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
    if kind == "platform/linear-delta":
        directions = np.column_stack([rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.3, 0.3, 3), np.ones(3)])
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        lengths = rng.uniform(0.43, 0.47, 3)
    inertia = np.array([0.08, 0.09, 0.15]) * rng.uniform(0.9, 1.1, 3)
    is_body = kind in ("platform/3-rps", "platform/6-ups")
    is_leg = kind != "platform/linear-delta"
    machine = Machine(
        kind, frame, platform, directions, lengths, rng.uniform(3.0, 9.0),
        rng.uniform(-0.05, 0.05, 3) * is_body, inertia, rng.uniform(0.4, 0.9, n),
        payload=rng.uniform(0.0, 3.0), payload_at=rng.uniform(-0.1, 0.1, 3) * is_body,
        rod_centre=rng.uniform(0.05, 0.2) * is_leg, barrel_mass=rng.uniform(0.3, 0.8),
        barrel_centre=rng.uniform(0.05, 0.15) * is_leg, leg_inertia=rng.uniform(0.0, 0.01) * is_leg,
    )  # fmt: skip
    machine.down = GRAVITY * Rotation.random(random_state=rng).as_matrix()[0]
    return machine


def random_state(machine: Machine, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Return place, rotation, and (velocity, angular velocity) of a pose well inside the workspace."""
    tilt = rng.uniform(-0.2, 0.2, 2)
    place = np.array([*rng.uniform(-0.04, 0.04, 2), rng.uniform(0.38, 0.46)])
    if machine.kind == "platform/linear-delta":
        place[2] -= 0.7
    turn = np.eye(3)
    if machine.turns:
        turn = Rotation.from_rotvec([*tilt, rng.uniform(-0.2, 0.2)]).as_matrix()
    place, turn = machine.closed(place, turn, place[2], tilt)
    wished = np.concatenate([rng.uniform(-0.5, 0.5, 3), rng.uniform(-2.0, 2.0, 3)])
    return place, turn, machine.free_rates(turn, wished)


def numbers(machine: Machine) -> dict[str, float]:
    """Return the numbers of the product's component."""
    out: dict[str, float] = {"mass": machine.mass, "payload": machine.payload, "length": 0.4}
    out |= {f"gravity_{axis}": machine.down[k] for k, axis in enumerate("xyz")}
    for i in range(len(machine.frame)):
        for what, of in (("frame", machine.frame), ("platform", machine.platform)):
            out |= {f"{what}_{i + 1}_{axis}": of[i][k] for k, axis in enumerate("xyz")}
        out[f"length_{i + 1}"] = machine.lengths[i]
        if machine.kind == "platform/3-rps":
            out[f"hinge_{i + 1}"] = float(np.arctan2(machine.directions[i][1], machine.directions[i][0]))
        if machine.kind == "platform/linear-delta":
            out |= {f"direction_{i + 1}_{axis}": machine.directions[i][k] for k, axis in enumerate("xyz")}
    if machine.turns:
        for what, of in (("inertia", machine.inertia), ("centre", machine.centre), ("payload_at", machine.payload_at)):
            out |= {f"{what}_{axis}": of[k] for k, axis in enumerate("xyz")}
    if machine.kind == "platform/linear-delta":
        out["arm_mass"] = machine.barrel_mass
    else:
        out |= {key: getattr(machine, key) for key in ("rod_centre", "barrel_mass", "barrel_centre", "leg_inertia")}
    return {key: float(value) for key, value in out.items()}


def described(kind: str, base: float, top: float, length: float, *angles: float) -> dict[str, object]:
    """Return tables of a platform, lengths in mm and angles of the six legs in degrees, on slides at its legs."""
    n = 6 if kind == "platform/6-ups" else 3
    table = {"kind": kind, "base_radius": f"{base} mm", "platform_radius": f"{top} mm", "mass": "6 kg"}
    table["length"] = f"{length} mm"
    if kind in ("platform/3-rps", "platform/6-ups"):
        table["inertia"] = {"x": "0.09 kg m2", "y": "0.09 kg m2", "z": "0.17 kg m2"}
    if n == 6:
        table |= dict(zip(("base_angle", "platform_angle"), (f"{angle} deg" for angle in angles), strict=True))
    slides = {f"leg_{i}": {"kind": "slide", "mass": "0.6 kg"} for i in range(1, n + 1)}
    return {
        "components": slides | {"own": table},
        "connections": [f"leg_{i}.1 -> own.{i}" for i in range(1, n + 1)],
    }


def circuit(machine: Machine) -> dict[str, object]:
    """Return the product's description of the machine, with a slide at each leg."""
    n = len(machine.frame)
    slides = [
        {"name": f"leg_{i + 1}", "kind": "slide", "numbers": {"mass": float(machine.rods[i]), "incline": 0.0}}
        for i in range(n)
    ]
    return {
        "gas": {"heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": 287.05},
        "ambient": {"pressure_pa": 101325.0, "temperature_k": 293.15},
        "components": [*slides, {"name": "platform", "kind": machine.kind, "numbers": numbers(machine)}],
        "joints": [[f"leg_{i + 1}.1", f"platform.{i + 1}"] for i in range(n)],
    }
