"""Steady states of a drive, and its linear model about a state from exact derivatives of the core."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.optimize import brentq

from pneudrive import units
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.describe.system import short_name
from pneudrive.errors import CommandError, PneudriveError, SimulationError, naming, warn
from pneudrive.simulation.simulate import number_of
from pneudrive.views import ShownValue, View, Viewed

if TYPE_CHECKING:
    from control import StateSpace

    from pneudrive.arrays import Array, Pair
    from pneudrive.simulation.session import Linear, Session
    from pneudrive.simulation.start import DriveOrCircuit


# --- Steady states of a drive: constant gas states, with the piston pinned or at a constant velocity.

SETTLED = 1e-9  # rates of pressures and temperatures over their values, 1/s; of the velocity, m/s2; last step of both
QUOTIENT, MOST_STEPS = 1e-7, 200  # of difference quotients of the rates; of the search
FIRST_S, GROWTH = 1e-2, 6.0  # first time step of the search, and its growth after a full step
ROUNDED = 1e-8  # 1/s: rates that count as settled after such a step, as rounding leaves them
LASTING_S = 1e6  # a step after which rates that are settled count as such: gas that rests keeps any temperature
LONGEST = (0.5, 0.1, 1.0)  # steps of ln p, ln T and the velocity, m/s
HELD = 1e-3  # change of ln p that must act on a rate
DAMPED, SHORTER = 0.9, (1.0, 0.5, 0.2, 0.05)  # a step after which rates are not below this share is tried shorter
#: Relative cut-off of singular values. States without effect on the rates keep their start value.
LEAST = 1e-13
SLOWEST = 1e-5  # m/s: a piston that does not get faster rests
START_M_S = 0.5  # m/s: another start of the search
SLOWER = 0.7  # next speed over the last one in the search for a balance; finer than the range of falling friction
HIGHEST = 50.0  # times the supply: no steady state has such a pressure


@dataclass(frozen=True, repr=False)
class Equilibrium(Viewed):
    """A steady state, in which all pressures and temperatures are constant.

    Attributes
    ----------
    command, position_m, velocity_m_s : float
    pressure_a_pa, pressure_b_pa : float
        Pressures in the chambers, absolute.
    temperature_a_k, temperature_b_k : float
    gas_force_n : float
        Force of gas, weight, springs and described load on the piston in +x, without friction.
    friction_n : float
        Steady friction against the motion, with the sign of the velocity; 0 at rest.
    load_n : float
        External force in +x that balances the piston. The balance includes friction in motion, but not at rest.
    """

    command: float
    position_m: float
    velocity_m_s: float
    pressure_a_pa: float
    pressure_b_pa: float
    temperature_a_k: float
    temperature_b_k: float
    gas_force_n: float
    friction_n: float
    load_n: float

    def view(self) -> View:
        """Return the values of the state."""
        labels = ("command", "position", "velocity", "pressure a, absolute", "pressure b, absolute", "temperature a")
        labels += ("temperature b", "force without friction", "friction", "load that balances it")
        units_si = ("", "m", "m/s", "Pa", "Pa", "K", "K", "N", "N", "N")
        values = zip(vars(self).items(), labels, units_si, strict=True)
        return View("equilibrium", [ShownValue(name, label, "value", value, si) for (name, value), label, si in values])


def equilibrium(
    drive: DriveOrCircuit,
    command: float,
    *,
    load: str | float | None = None,
) -> Equilibrium:
    """Return the steady state of a drive under a command, with the piston at mid stroke.

    The core evaluates the rates at each trial state. The solver finds the state with zero rates by implicit Euler
    steps, which become Newton steps as they grow.

    Parameters
    ----------
    drive : Drive or Circuit
        Drive with one piston and one to four valves.
    command : float
        Command of the valve in [-1, 1].
    load : str or float, optional
        Force in +x: ``"-100 N"``, or a number in N. The piston moves at its steady velocity under this load. Default:
        a pinned piston.

    Returns
    -------
    Equilibrium

    Raises
    ------
    CommandError
        The command or the load is not valid.
    SimulationError
        No steady state exists, or it is not unique, as for a shut valve without leaks.

    Examples
    --------
    >>> import pneudrive as pn
    >>> drive = pn.Drive.load("catalogue:reference")
    >>> round(pn.equilibrium(drive, 0.6, load=0.0).velocity_m_s, 4)
    2.4249
    """
    whole = HeldDrive(drive)
    whole.actuation.commands(command)  # a switching valve has no commands between its positions
    return steady_state(whole.static, command, None if load is None else number_of(load, "N", "load"))


def steady_state(plant: HeldDrive, command: float, load: float | None = None) -> Equilibrium:
    """Return a steady state at mid stroke; see `equilibrium`."""
    gas, velocity = steady_gas(plant, command, load)
    position = plant.middle_m
    force, friction = _forces(plant, command, gas, velocity)
    (p_a, t_a), (p_b, t_b) = plant.chamber(gas, "a"), plant.chamber(gas, "b")
    return Equilibrium(command, position, velocity, p_a, p_b, t_a, t_b, force, friction, friction - force)


def _forces(plant: HeldDrive, command: float, gas: Array, velocity: float) -> Pair:
    """Return the force on the piston in +x without friction, and the sliding friction; see `Equilibrium`."""
    force = plant.force(plant.session(command, plant.middle_m, velocity, gas).linearise([]))
    return force, plant.sliding(velocity, plant.pressures(gas), plant.middle_m) if velocity else 0.0


def steady_gas(plant: HeldDrive, command: float, load: float | None) -> tuple[Array, float]:
    """Return pressures and temperatures of all nodes with the shape (nodes, 2), and the velocity, in a steady state.

    A drive that starts at rest reaches this state under a load (N) in +x. The velocity is 0 if the drive does not move.
    A load of None pins the piston.
    """
    if load is None:
        return _settled(plant, command, 0.0, None)
    try:
        return _settled(plant, command, SLOWEST, load)
    except SimulationError:  # near rest, friction that falls with speed leads away from the steady motion
        return _braked(plant, command, load) if command * load < 0.0 else _settled(plant, command, START_M_S, load)


def _braked(plant: HeldDrive, command: float, load: float) -> tuple[Array, float]:
    """Return the steady state under a load against the motion, at the highest speed at which the forces balance.

    If friction falls with speed, the forces also balance at a lower speed, but this motion is unstable.
    """
    toward = math.copysign(1.0, command)

    def excess(speed: float) -> float:
        """Return the sum of the forces at an imposed speed, in the direction of the motion."""
        gas = _settled(plant, command, speed, None)[0]
        force, friction = _forces(plant, command, gas, toward * speed)
        return toward * (force + load - friction)

    high = low = abs(_settled(plant, command, START_M_S, 0.0)[1])
    while low > SLOWEST and excess(low) < 0.0:
        high, low = low, SLOWER * low
    speed = 0.0
    if low > SLOWEST:
        speed = float(np.asarray(brentq(excess, low, high, xtol=SLOWEST * SETTLED))) if low < high else high
    return _settled(plant, command, speed, None)[0], toward * speed


#: Core's form of a drive -> its speeds, which take 0.1 s to compute. The page needs them for each change of a gain.
_SPEEDS: dict[str, Pair] = {}
MOST_KEPT = 64


def full_speeds(drive: DriveOrCircuit, otherwise: float) -> Pair:
    """Return the speeds (m/s) of steady motion in +x and in -x at full opening and mid-stroke.

    The search begins in motion, so static friction has no effect. `otherwise` replaces speeds that are not found.
    """
    key = drive.core_json()
    if key in _SPEEDS:
        return _SPEEDS[key]
    try:
        plant = HeldDrive(drive).static
        out, back = (abs(_settled(plant, way, START_M_S)[1]) for way in (1.0, -1.0))
    except (CommandError, SimulationError):
        out = back = otherwise
    if len(_SPEEDS) >= MOST_KEPT:
        _SPEEDS.clear()
    _SPEEDS[key] = out, back
    return out, back


def _settled(plant: HeldDrive, command: float, speed: float, load: float | None = 0.0) -> tuple[Array, float]:
    """Return the steady state that a search at mid stroke reaches from a speed in the direction of the command.

    The state has pressures and temperatures of all nodes with the shape (nodes, 2), and the velocity, 0 at rest.
    Unknowns are ln p and ln T of all nodes and, under a load in N, the velocity. Without a load, the piston is pinned.
    A step is an implicit Euler step. As it grows, it becomes a Newton step. The search therefore follows the motion of
    the drive and ends at the drive's final state.

    Raises
    ------
    SimulationError
        No steady state was found.
    """
    toward, is_free, nodes = math.copysign(1.0, command), load is not None, plant.nodes
    supply, (ambient, temperature) = plant.supply_pa, plant.ambient
    columns = [f"{node}.{quantity}" for quantity in ("pressure_pa", "temperature_k") for node in nodes]

    def gas_of(z: Array) -> Array:
        return np.exp(z[:-1].reshape(2, -1).T)

    def rates(z: Array) -> Array:
        """Return the relative rates (1/s) of all pressures, then of all temperatures, and the acceleration."""
        gas = gas_of(z)
        linear = plant.session(command, plant.middle_m, z[-1], gas).linearise([])
        rows = list(map(linear.outputs.index, columns))
        friction = plant.sliding(z[-1], plant.pressures(gas), plant.middle_m) if is_free else 0.0
        gas_rates = (linear.C @ linear.rates)[rows] / linear.output[rows]
        return np.append(gas_rates, (plant.force(linear) + (load or 0.0) - friction) / plant.mass)

    start = np.repeat(np.log([0.5 * (supply + ambient), temperature]), len(nodes))
    z, lasting, step = np.append(start, toward * speed), FIRST_S, np.inf
    longest, shifts = np.repeat(LONGEST, (len(nodes), len(nodes), 1)), np.eye(z.size)
    found = rates(z)
    for _ in range(MOST_STEPS):
        rests = is_free and toward * z[-1] <= SLOWEST and toward * found[-1] <= 0.0
        own = z.size if is_free and not rests else z.size - 1
        left, is_long = np.max(np.abs(found[:own])), lasting > LASTING_S
        if left < (ROUNDED if is_long else SETTLED) and (is_long or np.max(np.abs(step)) < SETTLED):
            for node, shift in zip(nodes, shifts, strict=False):  # a pressure without effect on any rate can be any
                if np.max(np.abs(rates(z + HELD * shift)[:own] - found[:own])) < SETTLED:
                    raise SimulationError.of("datasheet.any_pressure", node=node, command=command)
            return gas_of(z), 0.0 if rests else float(z[-1])
        # An implicit Euler step, shortened if necessary.
        slopes = [(rates(z + QUOTIENT * shift)[:own] - found[:own]) / QUOTIENT for shift in shifts[:own]]
        step = np.linalg.lstsq(np.eye(own) / lasting - np.transpose(slopes), found[:own], rcond=LEAST)[0]
        over = np.max(np.abs(step) / longest[:own])
        step = np.asarray(step / max(1.0, over), dtype=float)
        # The flow changes sharply near equal pressures, and full steps would jump over this region.
        tried: list[tuple[float, float, Array]] = []
        for share in SHORTER:
            after = rates(np.r_[z[:own] + share * step, z[own:]])
            tried.append((np.max(np.abs(after[:own])), share, after))
            if share == 1.0 and tried[-1][0] < DAMPED * left:
                break
        _, share, found = min(tried, key=lambda one: one[0])
        lasting *= 1.0 if over > 1.0 else max(GROWTH * share, 1.0)
        z[:own] += share * step
        if np.max(z[: len(nodes)]) > math.log(HIGHEST * supply):
            break
        if is_free and toward * z[-1] < SLOWEST:
            z[-1] = toward * SLOWEST
            found = rates(z)
    raise SimulationError.of("datasheet.no_state", command=command, velocity=float(z[-1]))


# --- Linear model of a drive from exact derivatives of the core.
#
# The caller chooses the friction model and the side of the valve opening.

FRICTIONS = ("presliding", "sliding", "none")
OPENINGS = {"+": 1.0, "-": -1.0}
SIDE = 1e-9  # of the command: one side of a shut valve
SMALL = 0.05  # of the command: beyond the edge of a valve whose flow begins without slope, and of slow motion
MOVING = 1e-9  # m/s: a contact that slips
FAST, STEP = 10.0, 1e-3  # m/s: where only viscous friction depends on velocity; share over which its slope is taken


def linearise(
    drive: DriveOrCircuit,
    *,
    position: str | float | None = None,
    pressures: tuple[str | float, str | float] | str | float | None = None,
    command: float = 0.0,
    opening: Literal["+", "-"] = "+",
    friction: Literal["presliding", "sliding", "none"] = "sliding",
) -> StateSpace:
    """Return the linear model of a drive about a state, as a `control.StateSpace` (extra ``linear``).

    ``x' = A x + B u`` for deviations from the state, with gas at ambient temperature. The derivatives are exact.

    Parameters
    ----------
    drive : Drive or Circuit
        Drive with one piston and one to four valves.
    position : str or float, optional
        ``"120 mm"``, or a number in m; by default mid stroke.
    pressures : pair of str or float, or one for both, optional
        Absolute pressures of chambers a and b: ``"3 bar abs"``, or numbers in Pa; default: mean of supply and ambient.
    command : float
        Command of the valve. The default, 0, means the command at which the valve begins to open.
    opening : {"+", "-"}
        Side to which the valve opens; the slope of the flow differs between the sides. Only for ``command = 0``.
    friction : {"presliding", "sliding", "none"}
        ``"presliding"``: the contact is at rest, and bristles are springs. A contact without bristles does not move.
        ``"sliding"``: the viscous slope of the steady friction over velocity, far above the Stribeck velocity.
        ``"none"``: without friction.

    Returns
    -------
    control.StateSpace
        States, inputs (command, load_force, supply_pressure) and outputs (position, velocity, pressures) by name, with
        units; in SI.

    Raises
    ------
    CommandError
        A value is not valid, the valve is shut at the command, or python-control is not installed.

    Examples
    --------
    >>> import pneudrive as pn
    >>> model = pn.linearise(pn.Drive.load("catalogue:reference"), pressures="3 bar abs", friction="none")
    >>> model.input_labels
    ['command', 'load_force_n', 'supply_pressure_pa']
    """
    try:
        import control
    except ImportError:
        raise CommandError("python-control is not installed", remedy="pip install pneudrive[linear]") from None
    whole = HeldDrive(drive)
    if whole.actuation.held:
        raise CommandError.of("datasheet.not_linear", name=whole.name, valves=" and ".join(whole.actuation.held))
    plant = whole.static
    x = plant.middle_m if position is None else number_of(position, "m", "position")
    if opening not in OPENINGS:
        raise CommandError(f'opening = "{opening}" is not known', remedy='"+" or "-"')
    at = open_command(plant, command, OPENINGS[opening])
    found = linear_model(plant, at, x, gas_at(plant, pressures), friction)
    short = {}  # names without dots, as python-control requires
    for name in (*found.states, *found.inputs, *found.outputs):
        alone = short_name(name, plant.piston).replace(f"{plant.valve}.command", "command")
        short[name] = alone.replace(".", "_")
    motion = ("position_m", "velocity_m_s")
    keep = [k for k, name in enumerate(found.outputs) if short[name] in motion or name.endswith("pressure_pa")]
    return control.StateSpace(
        *(found.A, found.B, found.C[keep], found.D[keep]),
        states=[short[name] for name in found.states],
        inputs=[short[name] for name in found.inputs],
        outputs=[short[found.outputs[k]] for k in keep],
        name=re.sub(r"\W", "_", plant.name),
    )


def open_command(plant: HeldDrive, command: float, side: float = 1.0) -> float:
    """Return a command unchanged; for 0, return the command at which the valve begins to open to a side.

    Raises
    ------
    CommandError
        The valve is shut at the command.
    """
    edge, is_smooth = plant.edge(command or side)
    if 0.0 < abs(command) <= edge:
        raise CommandError.of("datasheet.shut", command=command, edge=edge, open=math.copysign(edge + SMALL, command))
    return command or side * (edge + (SMALL if is_smooth else SIDE))


def gas_at(plant: HeldDrive, pressures: Any = None) -> Array:  # noqa: ANN401 - one or two quantities
    """Return pressure and temperature of all nodes from the pressures of chambers a and b; shape (nodes, 2)."""
    if pressures is None:
        pressures = 0.5 * (plant.supply_pa + plant.ambient[0])
    pair = [pressures] if isinstance(pressures, str | int | float) else list(pressures)
    if len(pair) not in (1, 2):
        raise CommandError(f"pressures = {pressures!r}: give one or two", remedy='("3 bar abs", "2 bar abs")')
    levels = []
    for given in pair:
        with naming("pressures", PneudriveError):
            is_text = isinstance(given, str)
            level = units.parse_pressure(given).absolute_pa(plant.ambient[0]) if is_text else float(given)
        if not (math.isfinite(level) and level > 0.0):
            raise CommandError(f"pressures: {given} is out of bounds", rule="absolute, greater than 0")
        levels.append(level)
    a, b = levels[0], levels[-1]
    sides = {f"{plant.piston}.a": a, f"{plant.piston}.b": b}
    values = [sides.get(node, b if plant.is_at_b(node) else a) for node in plant.nodes]
    return np.array([(value, plant.ambient[1]) for value in values])


def moving_gas(plant: HeldDrive) -> Array:
    """Return pressure and temperature of all nodes in slow steady motion in +x at mid stroke; shape (nodes, 2).

    This state, at ambient temperature, is the usual operating point.

    Warn if the drive does not move.
    """
    command = plant.sizes((plant.edge(1.0)[0] + SMALL,))[0]
    gas, velocity = steady_gas(plant, command, 0.0)
    if velocity == 0.0:
        warn(f"{plant.name} does not move in +x: the operating point is at rest instead of in slow motion")
    gas[:, 1] = plant.ambient[1]
    return gas


def linear_model(
    plant: HeldDrive,
    command: float,
    position: float,
    gas: Array,
    friction: str = "none",
) -> Linear:
    """Return the linear model about a state, with the requested friction. See `linearise`."""
    if friction not in FRICTIONS:
        raise CommandError(f'friction = "{friction}" is not known', remedy=" or ".join(f'"{one}"' for one in FRICTIONS))
    if friction == "presliding":
        return _linear(plant, plant.session(command, position, 0.0, gas), command)
    lags = {name: math.copysign(lag, command * lag) for name, lag in plant.lags.items()}
    session = plant.frictionless.session(command, position, MOVING, gas, lags=lags)
    bare = _linear(plant, session, command)
    ends = [FAST * (1.0 + sign * STEP) for sign in (-1.0, 1.0)]
    pressures = plant.pressures(gas)
    for name in lags if friction == "sliding" else ():
        row = bare.states.index(f"{name}.velocity_m_s")
        by_load = bare.B[row, 1] if name == plant.piston else 1.0 / plant.masses[name]
        low, high = (plant.sliding_of(name, velocity, pressures, position) for velocity in ends)
        bare.A[row, row] -= by_load * ((high - low) / (2.0 * STEP * FAST))
    return bare


def _linear(plant: HeldDrive, session: Session, command: float) -> Linear:
    """Return the linear model of a session. Its inputs are valve signal, load and supply pressure."""
    found = session.linearise((*(f"{name}.command" for name in plant.valves), plant.load, plant.supply))
    way = math.copysign(1.0, command)
    slopes = way * np.array([plant.actuation.commands(way)[name] for name in plant.valves])
    count = len(slopes)
    chained = ((matrix[:, :count] @ slopes, matrix[:, count:]) for matrix in (found.B, found.D))
    b, d = (np.c_[first, others] for first, others in chained)
    return replace(found, B=b, D=d, inputs=(found.inputs[0], *found.inputs[count:]))
