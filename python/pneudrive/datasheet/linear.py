"""Linear model of a drive from exact derivatives of the core.

The caller chooses the friction model and the side of the valve opening.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pneudrive.datasheet.equilibrium import gas_under_load, number_of
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.units import parse_pressure

if TYPE_CHECKING:
    from control import StateSpace
    from numpy.typing import NDArray

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.simulation.session import Linear, Session

    Array = NDArray[np.float64]

FRICTIONS = ("presliding", "sliding", "none")
OPENINGS = {"+": 1.0, "-": -1.0}
SIDE = 1e-9  # of the command: one side of a shut valve
SMALL = 0.05  # of the command: beyond the edge of a valve whose flow begins without slope, and of slow motion
MOVING = 1e-9  # m/s: a contact that slips
STEP = 1e-3  # share of a velocity over which the slope of sliding friction is taken


def linearise(
    drive: Drive | Circuit,
    *,
    position: str | float | None = None,
    pressures: tuple[str | float, str | float] | str | float | None = None,
    command: float = 0.0,
    opening: Literal["+", "-"] = "+",
    friction: Literal["presliding", "sliding", "none"] = "sliding",
    velocity: str | float = 0.0,
) -> StateSpace:
    """Return the linear model of a drive about a state, as a `control.StateSpace` (extra ``linear``).

    ``x' = A x + B u`` of deviations from the state; gas at ambient temperature. A comes from the core's duals.

    Parameters
    ----------
    drive : Drive or Circuit
        One piston under one to four valves.
    position : str or float, optional
        ``"120 mm"`` or in m; by default mid stroke.
    pressures : pair of str or float, or one for both, optional
        Absolute pressures of chambers a and b, ``"3 bar abs"`` or in Pa; by default those between supply and ambient.
    command : float
        At which the valve stands. The default, 0, is the edge at which the valve opens: the end of its overlap.
    opening : {"+", "-"}
        Side of that edge: the flow has another slope to each side. Only for ``command = 0``.
    friction : {"presliding", "sliding", "none"}
        ``"presliding"``: the contact at rest, with bristles as springs. A contact that sticks does not move.
        ``"sliding"``: the slope of the steady friction over velocity, at `velocity`, or at rest its viscous part far
        above the Stribeck velocity. ``"none"``: without friction.
    velocity : str or float
        At which the piston moves.

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
    if whole.actuation.is_switched:
        raise CommandError(
            f"{whole.name}: {' and '.join(whole.actuation.held)} is on or off",
            rule="a linear model is about small commands, which a switching valve does not have",
            remedy="Simulate the drive, or use drive.start() and session.linearise().",
        )
    plant = whole.static
    x = 0.5 * plant.stroke_m if position is None else number_of(position, "m", "position")
    v = number_of(velocity, "m/s", "velocity")
    if opening not in OPENINGS:
        raise CommandError(f'opening = "{opening}" is not known', remedy='"+" or "-"')
    at = open_command(plant, command, OPENINGS[opening])
    found = linear_model(plant, at, x, gas_at(plant, pressures), v, friction)
    short = {name: _short(name, plant) for name in (*found.states, *found.inputs, *found.outputs)}
    keep = [k for k, name in enumerate(found.outputs) if short[name] in _SHOWN or name.endswith("pressure_pa")]
    return control.StateSpace(
        *(found.A, found.B, found.C[keep], found.D[keep]),
        states=[short[name] for name in found.states],
        inputs=[short[name] for name in found.inputs],
        outputs=[short[found.outputs[k]] for k in keep],
        name=_label(plant.name),
    )


def open_command(plant: HeldDrive, command: float, side: float = 1.0) -> float:
    """Return a command, or for 0 the edge at which the valve opens to a side.

    Raises
    ------
    CommandError
        The valve is shut at the command.
    """
    edge, is_smooth = plant.edge(command or side)
    if 0.0 < abs(command) <= edge:
        raise CommandError(
            f"command = {command:g}: the valve is shut up to {edge:g}",
            rule="a linear model needs a valve that is open",
            remedy=f"Set command = {math.copysign(edge + SMALL, command):.2g}, or leave it out for the edge.",
        )
    return command or side * (edge + (SMALL if is_smooth else SIDE))


_SHOWN = ("position_m", "velocity_m_s")


def _short(name: str, plant: HeldDrive) -> str:
    """Return a drive's name in a form for python-control: without dots."""
    from pneudrive.describe.system import short_name

    return short_name(name, plant.piston).replace(f"{plant.valve}.command", "command").replace(".", "_")


def _label(name: str) -> str:
    return "".join(letter if letter.isalnum() else "_" for letter in name)


def gas_at(plant: HeldDrive, pressures: Any = None) -> Array:  # noqa: ANN401 - one or two quantities
    """Return pressures of both chambers and of the upstream nodes, at ambient temperature. The shape is (nodes, 2)."""
    if pressures is None:
        pressures = 0.5 * (plant.supply_pa + plant.ambient[0])
    pair = (pressures, pressures) if isinstance(pressures, str | int | float) else tuple(pressures)
    pair = pair * 2 if len(pair) == 1 else pair
    if len(pair) != 2:
        raise CommandError(f"pressures = {pressures!r} are not two", remedy='("3 bar abs", "2 bar abs")')
    a, b = (_pressure(one, plant) for one in pair)
    sides = {f"{plant.piston}.a": a, f"{plant.piston}.b": b}
    values = [sides.get(node, b if plant.is_at_b(node) else a) for node in plant.nodes]
    return np.array([(value, plant.ambient[1]) for value in values])


def moving_gas(plant: HeldDrive, position: float) -> Array:
    """Return pressures of slow steady motion at ambient temperature, shape (nodes, 2): the usual operating point."""
    command = plant.sizes((plant.edge(1.0)[0] + SMALL,))[0]
    gas, _ = gas_under_load(plant, command, position)
    gas[:, 1] = plant.ambient[1]
    return gas


def _pressure(given: str | float, plant: HeldDrive) -> float:
    if not isinstance(given, str):
        value = float(given)
    else:
        try:
            value = parse_pressure(given).absolute_pa(plant.ambient[0])
        except PneudriveError as error:
            raise CommandError(f"pressures: {error.what}", rule=error.rule, remedy=error.remedy) from None
    if not (math.isfinite(value) and value > 0.0):
        raise CommandError(f"pressures: {given} is out of bounds", rule="absolute, greater than 0")
    return value


def linear_model(
    plant: HeldDrive, command: float, position: float, gas: Array, velocity: float = 0.0, friction: str = "none"
) -> Linear:
    """Return the linear model about a state, with the requested friction. See `linearise`."""
    if friction not in FRICTIONS:
        raise CommandError(f'friction = "{friction}" is not known', remedy=" or ".join(f'"{one}"' for one in FRICTIONS))
    if friction == "presliding":
        return _linear(plant, plant.session(command, position, velocity, gas), command)
    lags = {name: math.copysign(lag, command * lag) for name, lag in plant.lags.items()}
    session = plant.frictionless.session(command, position, velocity or MOVING, gas, lags=lags)
    bare = _linear(plant, session, command)
    for name in lags if friction == "sliding" else ():
        row = bare.states.index(f"{name}.velocity_m_s")
        by_load = bare.B[row, 1] if name == plant.piston else 1.0 / plant.masses[name]
        bare.A[row, row] -= by_load * friction_slope(plant, name, gas, position, velocity)
    return bare


def _linear(plant: HeldDrive, session: Session, command: float) -> Linear:
    """Return the linear model of a session with the inputs signal of the valves, load and pressure of the supply."""
    found = session.linearise((*plant.commands, plant.load, plant.supply))
    full = plant.actuation.out if command >= 0.0 else plant.actuation.back
    slopes = np.array([math.copysign(1.0, command) * full[name] for name in plant.valves])
    if len(slopes) == 1 and slopes[0] == 1.0:
        return found
    count = len(slopes)
    b, d = (np.c_[matrix[:, :count] @ slopes, matrix[:, count:]] for matrix in (found.B, found.D))
    return replace(found, B=b, D=d, inputs=(plant.commands[0], *found.inputs[count:]))


def friction_slope(plant: HeldDrive, name: str, gas: Array, position: float, velocity: float) -> float:
    """Return the slope of a component's steady friction over velocity, N s/m.

    At zero velocity, the slope far above the Stribeck velocity.
    """
    fast, pressures = abs(velocity) or FAST, plant.pressures(gas)
    low, high = (plant.sliding_of(name, fast * (1.0 + sign * STEP), pressures, position) for sign in (-1.0, 1.0))
    return (high - low) / (2.0 * STEP * fast)


FAST = 10.0  # m/s: where nothing but viscous friction depends on velocity
