"""Steady motion and blocked piston: velocity against command and load, force against velocity, pressure gain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.datasheet.characteristic import DIRECTIONS, Axis, ResultValue, characteristic, number
from pneudrive.datasheet.equilibrium import at_velocity, under_load
from pneudrive.datasheet.plant import LEAST_VELOCITY
from pneudrive.errors import SimulationError

if TYPE_CHECKING:
    from pneudrive.datasheet.characteristic import Found
    from pneudrive.datasheet.plant import HeldDrive

SMALL = (0.05, 0.1)  # commands beyond the overlap between which the velocity gain is taken
SHARES = (0.0, 0.25, 0.5)  # of the stall force: loads against the motion
COMMANDS = (0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
BLOCKED = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1)
TINY = 1e-8  # command at whose both sides the slope of a leaking valve is taken: far below any leak


def full_force(plant: HeldDrive, direction: float) -> tuple[float, float]:
    """Return blocked and stall force at full command, N, positive in the direction.

    Blocked force: force of gas, weight and described load on a pinned piston. Stall force: blocked force minus
    breakaway, the largest load that a piston at rest can move.
    """
    x = 0.5 * plant.stroke_m
    rest = at_velocity(plant, direction, x, 0.0)
    pressures = (rest.pressure_a_pa, rest.pressure_b_pa)
    blocked = direction * rest.gas_force_n
    return blocked, blocked - abs(plant.sliding(direction * LEAST_VELOCITY, pressures, x))


@characteristic(
    "velocity",
    algorithm="all rates of the core are zero, by implicit steps that become Newton steps; steady friction",
    cites=("iso6358-2013",),
    x="command",
    y="velocity",
)
def _velocity(plant: HeldDrive, loads: Any = None) -> Found:  # noqa: ANN401 - a sequence of numbers
    """Steady velocity against command and load.

    Velocity at which pressures, temperatures and velocity are constant, at mid stroke; load against the motion.
    Velocity gain and dead zone: line through commands 0.05 and 0.1 beyond the overlap, without load.

    Settings
    --------
    loads
        forces against the motion, N; default: 0, 25 and 50 % of the stall force
    """
    x = 0.5 * plant.stroke_m
    sizes = plant.sizes(COMMANDS)
    commands = np.array([*(-u for u in reversed(sizes)), *sizes])
    try:
        stall = max(min(full_force(plant, direction)[1] for direction in (1.0, -1.0)), 0.0)
    except SimulationError:  # a blocked piston has no steady state, as behind a quick exhaust valve
        stall = math.nan
    usual = [share * stall for share in SHARES] if stall == stall else [0.0]
    against = np.array(usual if loads is None else list(loads), dtype=float)
    found = np.array([[_moving(plant, u, x, -math.copysign(1.0, u) * load) for load in against] for u in commands])
    axes = {
        "command": Axis(commands, "1", "command of the valve"),
        "load_force": Axis(against, "N", "constant force against the motion"),
        "direction": DIRECTIONS,
    }
    over = ("command", "load_force")
    values = {
        "velocity": ResultValue(over, found[:, :, 0], "m/s", "steady velocity of the piston"),
        "pressure_a": ResultValue(over, found[:, :, 1], "Pa", "absolute pressure in chamber a"),
        "pressure_b": ResultValue(over, found[:, :, 2], "Pa", "absolute pressure in chamber b"),
    }
    if len(sizes) == 1:  # a switching valve has no small commands
        return axes, values
    gains, zones = zip(*(velocity_gain(plant, u, x) for u in (1.0, -1.0)), strict=True)
    meaning = "slope of velocity over command, for small commands without load"
    return axes, values | {
        "velocity_gain": ResultValue(("direction",), gains, "m/s", meaning),
        "dead_zone": ResultValue(("direction",), zones, "1", "command at which that line crosses zero velocity"),
    }


def _moving(plant: HeldDrive, command: float, position: float, load: float) -> tuple[float, float, float]:
    try:
        found = under_load(plant, command, position, load)
    except SimulationError:
        return math.nan, math.nan, math.nan
    return found.velocity_m_s, found.pressure_a_pa, found.pressure_b_pa


def velocity_gain(plant: HeldDrive, direction: float, position: float) -> tuple[float, float]:
    """Return slope and dead zone of the line through two small commands at which the piston moves."""
    commands = [plant.edge(direction)[0] + small for small in SMALL]
    (low, slow), (high, fast) = ((u, abs(_moving(plant, direction * u, position, 0.0)[0])) for u in commands)
    if not slow > 0.0:
        return math.nan, math.nan
    slope = (fast - slow) / (high - low)
    return slope, low - slow / slope


@characteristic(
    "force-speed",
    algorithm="as for velocity",
    cites=("iso6358-2013",),
    x="load_force",
    y="speed",
)
def _force(plant: HeldDrive, points: int = 12) -> Found:
    """Force against speed at full command.

    Load against which a steady speed is reached at command 1 and -1. Blocked force: of gas, weight, springs and the
    described load on a pinned piston. Stall force: blocked force less breakaway.

    Settings
    --------
    points
        number of loads in each direction
    """
    x = 0.5 * plant.stroke_m
    directions = (1.0, -1.0)
    blocked, stall = zip(*(full_force(plant, direction) for direction in directions), strict=True)
    shares = np.linspace(0.0, 0.99, points)
    loads = np.array([[share * max(most, 0.0) for share in shares] for most in stall])
    speeds = np.array(
        [
            [abs(_moving(plant, direction, x, -direction * load)[0]) for load in row]
            for direction, row in zip(directions, loads, strict=True)
        ]
    )
    axes = {
        "direction": DIRECTIONS,
        "share": Axis(shares, "1", "load as a fraction of the stall force"),
    }
    return axes, {
        "load_force": ResultValue(("direction", "share"), loads, "N", "constant force against the motion"),
        "speed": ResultValue(("direction", "share"), speeds, "m/s", "steady speed at full command"),
        "blocked_force": ResultValue(("direction",), blocked, "N", "force on the pinned piston at full command"),
        "stall_force": ResultValue(
            ("direction",), stall, "N", "largest load that the resting piston can move: blocked force less breakaway"
        ),
    }


def _blocked(plant: HeldDrive, command: float, position: float) -> float:
    """Return the pressure difference with a blocked piston, Pa; NaN if no steady state exists."""
    try:
        found = at_velocity(plant, command, position, 0.0)
    except SimulationError:
        return math.nan
    return found.pressure_a_pa - found.pressure_b_pa


@characteristic(
    "pressure-gain",
    algorithm="pressures and temperatures at which the rates of the core are zero, piston pinned at mid stroke",
    standard="form of ISO 10041",
    cites=("iso6358-2013",),
    x="command",
    y="pressure_difference",
    needs_shares=True,
)
def _pressure_gain(plant: HeldDrive, position: float | None = None) -> Found:
    """Pressure gain.

    Pressure difference of the chambers against the command with a blocked piston, and its slope at the centre.

    Settings
    --------
    position
        of the blocked piston, m; default: mid stroke
    """
    x = 0.5 * plant.stroke_m if position is None else position
    commands = np.array([*(-u for u in reversed(BLOCKED)), *BLOCKED])
    difference = np.array([_blocked(plant, u, x) for u in commands])
    try:
        rest = at_velocity(plant, 0.0, x, 0.0)
        centre = (rest.pressure_a_pa, rest.pressure_b_pa)
        slope = (_blocked(plant, TINY, x) - _blocked(plant, -TINY, x)) / (2.0 * TINY)
    except SimulationError:  # no leak: any pressure holds at a shut valve
        centre, slope = (math.nan, math.nan), math.inf
    axes = {"command": Axis(commands, "1", "command of the valve")}
    return axes, {
        "pressure_difference": ResultValue(
            ("command",), difference, "Pa", "pressure a less pressure b, piston blocked"
        ),
        "pressure_gain": number(slope, "Pa", "its slope at a small command; infinite without leakage"),
        "centre_pressure_a": number(centre[0], "Pa", "absolute pressure in chamber a at the centre"),
        "centre_pressure_b": number(centre[1], "Pa", "absolute pressure in chamber b at the centre"),
    }
