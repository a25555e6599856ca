"""Static curves: steady speed over force, stiffness of enclosed air, and the start of motion."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from pneudrive.arrays import Pair
from pneudrive.datasheet.characteristic import Found, ResultValue, characteristic
from pneudrive.datasheet.equilibrium import SIDE, gas_at, linear_model, steady_state
from pneudrive.datasheet.plant import LEAST_VELOCITY, HeldDrive
from pneudrive.errors import CommandError, SimulationError
from pneudrive.numbers import plain
from pneudrive.simulation.session import Linear

# --- Steady motion and blocked piston: velocity against command and load, force against velocity, pressure gain.

SMALL = (0.05, 0.1)  # commands beyond the overlap between which the velocity gain is taken
LOAD_SHARES = (0.0, 0.25, 0.5)  # of the stall force: loads against the motion
COMMANDS = (0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
BLOCKED = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1)
TINY = 1e-8  # command at whose both sides the slope of a leaking valve is taken: far below any leak


def full_force(plant: HeldDrive, direction: float, velocity: float = LEAST_VELOCITY) -> Pair:
    """Return blocked and stall force (N) at full command, positive in the direction of the command.

    The blocked force is the force of gas, weight and described load on a pinned piston. The stall force is the blocked
    force minus the friction at a velocity. With the default velocity, the stall force is the largest load that a piston
    at rest can move.
    """
    rest = steady_state(plant, direction)
    pressures = (rest.pressure_a_pa, rest.pressure_b_pa)
    blocked = direction * rest.gas_force_n
    return blocked, blocked - abs(plant.sliding(direction * velocity, pressures, plant.middle_m))


@characteristic(
    "velocity",
    algorithm="all rates of the core are zero, by implicit steps that become Newton steps; steady friction",
    cites=("iso6358-2013",),
    x="command",
    y="velocity",
    held=True,
)
def _velocity(plant: HeldDrive) -> Found:
    """Steady velocity against command and load.

    Velocity at mid stroke at which pressures, temperatures and velocity are constant. The loads against the motion are
    0, 25 and 50 % of the stall force.
    Velocity gain and dead zone come from a line through two points without load. Their commands are 0.05 and 0.1 above
    the overlap, or above 0 if the overlap is negative.

    Results
    -------
    command : 1
        command of the valve
    load_force : N
        constant force against the motion
    velocity : m/s over command, load_force
        steady velocity of the piston
    pressure_a : Pa over command, load_force
        absolute pressure in chamber a
    pressure_b : Pa over command, load_force
        absolute pressure in chamber b
    velocity_gain : m/s over direction
        slope of velocity over command between the two commands of the definition
    dead_zone : 1 over direction
        command at which the line through these two points has zero velocity
    """
    sizes = plant.sizes(COMMANDS)
    commands = np.array([*(-u for u in reversed(sizes)), *sizes])
    try:
        stall = max(min(full_force(plant, direction)[1] for direction in (1.0, -1.0)), 0.0)
    except SimulationError:  # a blocked piston has no steady state, as behind a quick exhaust valve
        stall = math.nan
    against = np.array([share * stall for share in LOAD_SHARES] if stall == stall else [0.0])
    found = np.array([[_steady(plant, u, -math.copysign(1.0, u) * load) for load in against] for u in commands])
    values = {
        "command": commands,
        "load_force": against,
        "velocity": found[:, :, 0],
        "pressure_a": found[:, :, 1],
        "pressure_b": found[:, :, 2],
    }
    if len(sizes) == 1:  # a switching valve has no small commands
        return values
    gains, zones = zip(*(velocity_gain(plant, u) for u in (1.0, -1.0)), strict=True)
    return values | {"velocity_gain": gains, "dead_zone": zones}


def _steady(plant: HeldDrive, command: float, load: float | None = None) -> tuple[float, float, float]:
    """Return velocity and both pressures under a load, or with a blocked piston; NaN if no steady state exists."""
    try:
        found = steady_state(plant, command, load)
    except SimulationError:
        return math.nan, math.nan, math.nan
    return found.velocity_m_s, found.pressure_a_pa, found.pressure_b_pa


def velocity_gain(plant: HeldDrive, direction: float) -> Pair:
    """Return slope and dead zone of the straight line of velocity over command, from two small commands with motion."""
    commands = [plant.edge(direction)[0] + small for small in SMALL]
    low, high = commands
    slow, fast = (abs(_steady(plant, direction * u, 0.0)[0]) for u in commands)
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
    held=True,
)
def _force(plant: HeldDrive, points: int = 12) -> Found:
    """Force against speed at full command.

    Load against which a steady speed is reached at command 1 and -1. The blocked force is the force of gas, weight,
    springs and described load on a pinned piston. The stall force is the blocked force minus the breakaway force.

    Settings
    --------
    points
        number of loads in each direction

    Results
    -------
    share : 1
        load as a fraction of the stall force
    load_force : N over direction, share
        constant force against the motion
    speed : m/s over direction, share
        steady speed at full command
    blocked_force : N over direction
        force on the pinned piston at full command
    stall_force : N over direction
        largest load that the resting piston can move: blocked force minus breakaway force
    """
    directions = (1.0, -1.0)
    blocked, stall = zip(*(full_force(plant, direction) for direction in directions), strict=True)
    shares = np.linspace(0.0, 0.99, points)
    loads = np.outer(np.maximum(stall, 0.0), shares)
    pairs = zip(directions, loads, strict=True)
    speeds = [[abs(_steady(plant, way, -way * load)[0]) for load in row] for way, row in pairs]
    return shares, loads, speeds, blocked, stall


@characteristic(
    "pressure-gain",
    algorithm="pressures and temperatures at which the rates of the core are zero, piston pinned at mid stroke",
    standard="form of ISO 10041",
    cites=("iso6358-2013",),
    x="command",
    y="pressure_difference",
    needs_shares=True,
    held=True,
)
def _pressure_gain(plant: HeldDrive) -> Found:
    """Pressure gain.

    Pressure difference of the chambers as a function of the command, with a piston blocked at mid stroke, and its slope
    at the centre.

    Results
    -------
    command : 1
        command of the valve
    pressure_difference : Pa over command
        pressure a minus pressure b, piston blocked
    pressure_gain : Pa
        slope of the pressure difference at a small command; infinite without leakage
    centre_pressure_a : Pa
        absolute pressure in chamber a at the centre
    centre_pressure_b : Pa
        absolute pressure in chamber b at the centre
    """
    commands = np.array([*(-u for u in reversed(BLOCKED)), *BLOCKED])

    def difference(command: float) -> float:
        _, a, b = _steady(plant, command)
        return a - b

    _, *centre = _steady(plant, 0.0)
    is_held = not math.isnan(centre[0])  # without a leak, any pressure holds at a shut valve
    slope = (difference(TINY) - difference(-TINY)) / (2.0 * TINY) if is_held else math.inf
    return commands, list(map(difference, commands)), slope, *centre


# --- Stiffness of the air spring, natural frequency and damping, from exact linearisations with the valve shut.

FAST, SLOW = 1e6, 1e-5  # rad/s: heat does not follow, heat follows
_NEAR_END = (0.0, 0.02, 0.05, 0.1, 0.175, 0.25, 0.375)
STROKE_SHARES = (*_NEAR_END, 0.5, *(1.0 - share for share in reversed(_NEAR_END)))  # of the stroke
LEVELS = (2.0, 3.0, 4.0, 5.0)  # bar absolute, as far as the supply reaches
FREQUENCIES = np.geomspace(0.01, 10.0, 61).tolist()  # Hz
MASSES = (0.5, 1.0, 2.0, 4.0)  # times the moving mass
CHAMBERS, ROUNDS = 2, 3  # gas nodes without lines; times the frequency is taken at which gas in lines follows
SLOWEST = 1e-4  # rad/s: slower pairs are masses of gas that stay the same, by rounding


def dynamic_stiffness(plant: HeldDrive, linear: Linear, s: complex) -> complex:
    """Return the ratio (N/m) of gas force to displacement at a complex frequency s (1/s), without the masses.

    The states of the gas are eliminated from the linear model. Bodies that the piston moves are rigidly joined to it.
    """
    x, v = ([linear.states.index(f"{name}.{key}") for name in plant.moved] for key in ("position_m", "velocity_m_s"))
    rest = [k for k in range(len(linear.states)) if k not in (*x, *v)]
    a, own = linear.A, 1.0 / linear.B[v[0], 1]
    masses = [own, *(plant.masses[name] for name in plant.moved[1:])]
    moved = a[:, x].sum(axis=1) + s * a[:, v].sum(axis=1)
    follows = np.linalg.solve(s * np.eye(len(rest)) - a[np.ix_(rest, rest)], moved[rest])
    return complex(-(masses @ (moved[v] + a[np.ix_(v, rest)] @ follows)))


def _at(plant: HeldDrive, position: float, pressures: Any, friction: str = "none") -> Linear:  # noqa: ANN401 - one or two
    return linear_model(plant, SIDE, position, gas_at(plant, pressures), friction)


def adiabatic_stiffness(plant: HeldDrive, position: float, pressures: Any, times: float = 1.0) -> float:  # noqa: ANN401
    """Return the gas stiffness (N/m) without heat exchange, at the natural frequency with `times` the moving mass.

    Gas in the lines contributes only as far as it can flow at this frequency.
    """
    found = dynamic_stiffness(plant, _at(plant, position, pressures), 1j * FAST).real
    if len(plant.nodes) == CHAMBERS:
        return found
    without_heat = _at(plant.varied({plant.piston: {"heat_transfer": "0 W/(m2 K)"}}), position, pressures)
    for _ in range(ROUNDS):
        found = dynamic_stiffness(plant, without_heat, 1j * math.sqrt(found / (times * plant.mass))).real
    return found


def levels_of(plant: HeldDrive, pressures: Any) -> list[float]:  # noqa: ANN401 - a sequence, or None
    """Return the absolute pressures of a map in Pa: the given ones, or the default levels below the supply."""
    if pressures is not None:
        return [gas_at(plant, pressure)[0, 0] for pressure in pressures]
    low, high = plant.ambient[0], plant.supply_pa
    return [1e5 * p for p in LEVELS if low < 1e5 * p < high] or [0.5 * (low + high)]


@characteristic(
    "stiffness",
    algorithm="exact linearisation by the core without friction; states of the chambers eliminated at a frequency",
    cites=("bejan2016",),
    x="position",
    y="adiabatic_stiffness",
    held=True,
)
def _stiffness(plant: HeldDrive, pressures: Any = None) -> Found:  # noqa: ANN401
    """Stiffness of the air spring.

    Force over displacement of the piston with the valve at command 0, both chambers at one pressure and at wall
    temperature. The gas exchanges no heat in a fast motion, and keeps the temperature of the wall in a slow one. Gas
    that leaks through the valve, or flows through it with negative overlap, lowers the slow stiffness.

    Settings
    --------
    pressures
        absolute pressures; default: 2, 3, 4 and 5 bar abs, if below the supply pressure

    Results
    -------
    position : m
        position of the piston
    pressure : Pa
        absolute pressure in both chambers
    frequency : Hz
        frequency
    adiabatic_stiffness : N/m over position, pressure
        fast: gas without heat exchange and flow
    isothermal_stiffness : N/m over position, pressure
        slow, 1e-5 rad/s: gas at the temperature of the wall
    loss_factor : 1 over frequency
        imaginary over real part of the stiffness, by heat exchange and by flow through the valve
    largest_loss_factor : 1
        largest value of the loss factor
    loss_frequency : Hz
        frequency of the largest loss factor
    """
    positions = [share * plant.stroke_m for share in STROKE_SHARES]
    levels = levels_of(plant, pressures)
    models = [[_at(plant, x, p) for p in levels] for x in positions]
    fast = [[adiabatic_stiffness(plant, x, p) for p in levels] for x in positions]
    slow = [[dynamic_stiffness(plant, one, 1j * SLOW).real for one in row] for row in models]
    level = levels[:2][-1]
    middle = _at(plant, plant.middle_m, level)
    over = np.asarray([dynamic_stiffness(plant, middle, 2j * math.pi * f) for f in FREQUENCIES])
    loss = np.imag(over) / np.real(over)
    meaning = f"real part at mid stroke, {1e-5 * level:g} bar"
    return {
        "position": positions,
        "pressure": levels,
        "frequency": FREQUENCIES,
        "adiabatic_stiffness": fast,
        "isothermal_stiffness": slow,
        "stiffness": ResultValue(("frequency",), np.real(over), "N/m", meaning),
        "loss_factor": loss,
        "largest_loss_factor": loss.max(),
        "loss_frequency": FREQUENCIES[int(loss.argmax())],
    }


@characteristic(
    "natural-frequency",
    algorithm="square root of adiabatic stiffness over mass; eigenvalues of the exact linearisation",
    x="position",
    y="natural_frequency",
    held=True,
)
def _frequency(plant: HeldDrive, pressures: Any = None) -> Found:  # noqa: ANN401
    """Natural frequency and damping.

    The moving mass oscillates on the air spring. The valve is at command 0, and both chambers are at one pressure. The
    damping includes the viscous part of the friction, heat exchange with the wall and flow through the valve. Below
    breakaway, the bristles add their stiffness.

    Settings
    --------
    pressures
        absolute pressures; default: 2, 3, 4 and 5 bar abs, if below the supply pressure

    Results
    -------
    position : m
        position of the piston
    pressure : Pa
        absolute pressure in both chambers
    mass : kg
        moving mass
    drive_frequency : Hz
        natural frequency of this drive at mid stroke, both chambers at the mean of supply and ambient pressure
    drive_damping_ratio : 1
        damping ratio of this drive in that state, with sliding friction and heat; 1 if overdamped
    natural_frequency : Hz over position, pressure
        natural frequency of the mass on the air spring without friction, heat exchange and flow
    mode_frequency : Hz over position, pressure
        magnitude of the eigenvalue pair, with sliding friction and heat; 0 if overdamped
    damping_ratio : 1 over position, pressure
        damping ratio of that eigenvalue pair
    frequency_by_mass : Hz over mass, pressure
        natural frequency at mid stroke with other masses
    """
    positions = [share * plant.stroke_m for share in STROKE_SHARES]
    levels = levels_of(plant, pressures)
    bare = np.array([[adiabatic_stiffness(plant, x, p) for p in levels] for x in positions])
    modes = np.array([[_mode(_at(plant, x, p, "sliding")) for p in levels] for x in positions])
    half = plant.middle_m

    def at_half(pressure: float | None = None, times: float = 1.0) -> float:
        return math.sqrt(adiabatic_stiffness(plant, half, pressure, times) / (times * plant.mass)) / (2.0 * math.pi)

    own = at_half(), _mode(_at(plant, half, None, "sliding"))[1]
    by_mass = [[at_half(p, m) for p in levels] for m in MASSES]
    natural = np.sqrt(bare / plant.mass) / (2.0 * math.pi)
    masses = [k * plant.mass for k in MASSES]
    return positions, levels, masses, *own, natural, *np.moveaxis(modes, 2, 0), by_mass


def oscillations(linear: Linear) -> list[complex]:
    """Return the eigenvalues (1/s) of the oscillating modes, one of each conjugate pair."""
    return [one for one in np.linalg.eigvals(linear.A).tolist() if one.imag > max(1e-6 * abs(one), SLOWEST)]


def _mode(linear: Linear) -> Pair:
    """Return frequency (Hz) and damping ratio of the slowest oscillating mode; 0 and 1 without such a mode."""
    slowest = min(oscillations(linear), key=abs, default=None)
    if slowest is None:
        return 0.0, 1.0
    return abs(slowest) / (2.0 * math.pi), -slowest.real / abs(slowest)


# --- Least supply pressure that moves the piston, and breakaway.

# The pressure rises so slowly that bristles neither oscillate nor slide: in 10 s they deflect 1.1 % below breakaway, in
# 100 s 0.2 %.
RISING_S, RISES = 600.0, 1200
CLOSE = 2e-5  # of the interval between ambient and supply: where bisection ends
LASTING_S, LOOKS = 660.0, 60  # a piston that is not there then does not move; looks in between
DONE = 0.99  # of the stroke


def _reaches(plant: HeldDrive, pressure: float, direction: float) -> bool:
    """Return whether a slowly rising pressure moves the piston over 99 % of the stroke from rest."""
    start = 0.0 if direction > 0.0 else plant.stroke_m
    gas = np.tile(plant.ambient, (len(plant.nodes), 1))
    session = plant.session(direction, start, 0.0, gas)
    rise = np.linspace(plant.ambient[0], pressure, RISES + 1)
    session.schedule(plant.supply, list(zip(RISING_S * np.arange(RISES + 1) / RISES, rise.tolist(), strict=True)))
    for k in range(1, LOOKS + 1):
        session.advance(LASTING_S * k / LOOKS)
        if abs(session.read(f"{plant.piston}.position_m") - start) >= DONE * plant.stroke_m:
            return True
    return False


def least_pressure(plant: HeldDrive, direction: float) -> float:
    """Return the least absolute supply pressure (Pa) at which the piston moves, by bisection on runs.

    Raises
    ------
    SimulationError
        The piston does not move even at the described supply pressure.
    """
    low, high = plant.ambient[0], plant.supply_pa
    if not _reaches(plant, high, direction):
        raise SimulationError(f"the supply of {plain(1e-5 * high)} bar abs does not move the piston over its stroke")
    width = CLOSE * (high - low)
    while high - low > width:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _reaches(plant, middle, direction) else (middle, high)
    return high


@characteristic(
    "minimum-pressure",
    algorithm="bisection on simulated runs to 0.002 % of the span from ambient to supply",
    standard="form of ISO 10099",
)
def _minimum(plant: HeldDrive) -> Found:
    """Minimum pressure and breakaway.

    Least supply pressure, above ambient, at which the piston with its load moves over 99 % of the stroke within 660 s
    from rest at full command. The pressure rises from ambient over 600 s and is then held.

    Results
    -------
    minimum_pressure : Pa over direction
        least supply pressure above ambient that moves the piston, with its load, over its stroke
    breakaway_force : N over direction
        steady friction at the onset of sliding, both chambers at ambient pressure
    """
    ambient = plant.ambient[0]
    if plant.supply_pa <= ambient:
        raise CommandError(f"{plant.name}: the supply is not above ambient pressure")

    def of(direction: float) -> Pair:
        x = 0.0 if direction > 0.0 else plant.stroke_m
        breakaway = abs(plant.sliding(direction * LEAST_VELOCITY, (ambient, ambient), x))
        return least_pressure(plant, direction) - ambient, breakaway

    with ThreadPoolExecutor(2) as pool:  # both directions are simulated at the same time
        return tuple(zip(*pool.map(of, (1.0, -1.0)), strict=True))
