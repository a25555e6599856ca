"""Response to a step and to a square command: times, speeds, impact energy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.datasheet.characteristic import DIRECTIONS, Axis, ResultValue, characteristic, number
from pneudrive.datasheet.characteristics.motion import StrokeRun, cycle, one_stroke
from pneudrive.datasheet.linear import gas_at
from pneudrive.datasheet.strokes import STROKE_MEANING

if TYPE_CHECKING:
    from pneudrive.datasheet.characteristic import DIRECTIONS, Found
    from pneudrive.datasheet.plant import HeldDrive

COMMANDS = (0.2, 0.4, 0.6, 0.8, 1.0)
SHOWN = 400  # samples of a trace
_TRACE = {
    "position": ("position_m", "m", "position of the piston"),
    "velocity": ("velocity_m_s", "m/s", "velocity of the piston"),
    "pressure_a": ("pressure_a_pa", "Pa", "absolute pressure in chamber a"),
    "pressure_b": ("pressure_b_pa", "Pa", "absolute pressure in chamber b"),
}


def trace(motion: StrokeRun) -> Found:
    """Return position, velocity and pressures over time, thinned for a figure."""
    time = motion.columns["time_s"]
    shown = np.linspace(time[0], time[-1], SHOWN)
    values = {
        name: ResultValue(("time",), np.interp(shown, time, motion.columns[column]), unit, meaning)
        for name, (column, unit, meaning) in _TRACE.items()
    }
    return {"time": Axis(shown, "s", "time from the command")}, values


def _numbers(motion: StrokeRun, dims: tuple[str, ...]) -> dict[str, ResultValue]:
    rows = [stroke.to_dict() for stroke in motion.strokes]
    pick = (lambda name: [row[name] for row in rows]) if dims else (lambda name: rows[0][name])
    return {name: ResultValue(dims, pick(name), unit, meaning) for name, (unit, meaning) in STROKE_MEANING.items()}


@characteristic(
    "step-response",
    algorithm="simulated with default tolerance; contacts located by the solver",
    cites=("iso6358-2013", "steinebach2023"),
    x="time",
    y="position",
    held=False,
)
def _step(plant: HeldDrive, command: float = 1.0, position: float | None = None, pressures: Any = None) -> Found:  # noqa: ANN401
    """Response to a step.

    One stroke from rest. The stroke time runs from the command to the first contact with the end, the dead time
    until 0.2 % of the way. The rise time runs from 10 % to 90 % of the way. The settling time ends where the
    position stays within 1 % of the way.

    Settings
    --------
    command
        of the valve
    position
        start position, m; default: the end from which the piston moves away
    pressures
        start pressures; default: ambient, and supply in the emptying chamber
    """
    x = (0.0 if command > 0.0 else plant.stroke_m) if position is None else position
    at_rest = plant.before(command) if pressures is None else plant.pressures(gas_at(plant, pressures))
    motion = one_stroke(plant, command, x, at_rest)
    axes, values = trace(motion)
    return axes, values | _numbers(motion, ())


@characteristic(
    "square-response",
    algorithm="three simulated cycles, of which the last is evaluated; half a period suffices for a stroke",
    cites=("iso6358-2013", "steinebach2023"),
    x="time",
    y="position",
    held=False,
)
def _square(plant: HeldDrive, command: float = 1.0, half_period: float | None = None) -> Found:
    """Response to a square command.

    Periodic strokes out and back under a square command. Results as for a step.

    Settings
    --------
    command
        size of the command
    half_period
        half period, s; default: long enough to reach both ends
    """
    motion = cycle(plant, command, half_period)
    axes, values = trace(motion)
    cycle_time = number(sum(stroke.stroke_time for stroke in motion.strokes), "s", "both stroke times")
    half = number(motion.half_s, "s", "half of the period of the command")
    return axes | {"direction": DIRECTIONS}, values | _numbers(motion, ("direction",)) | {
        "both_strokes": cycle_time,
        "half_period": half,
    }


@characteristic(
    "impact",
    algorithm="one simulated stroke for each command and direction, with ledger",
    x="command",
    y="end_energy",
    slow=True,
    held=False,
)
def _impact(plant: HeldDrive) -> Found:
    """Impact at the ends.

    Speed and kinetic energy of the moving mass at the first contact with the end, and the total energy that the
    end stop absorbs. Each is that of a full stroke from rest with the emptying chamber at supply pressure.
    """
    rows, commands = [], plant.sizes(COMMANDS)
    for command in commands:
        out = one_stroke(plant, command, 0.0, plant.before(1.0), ledger=True)
        back = one_stroke(plant, -command, plant.stroke_m, plant.before(-1.0), ledger=True)
        rows.append([(_hit(motion), motion.strokes[0]) for motion in (out, back)])
    values = np.array(
        [
            [
                (
                    one["speed_m_s"],
                    one["energy_j"],
                    one["absorbed_j"],
                    one["peak_force_n"],
                    one["depth_m"],
                    stroke.mean_speed,
                    stroke.stroke_time,
                )
                for one, stroke in row
            ]
            for row in rows
        ]
    )
    said = (
        ("end_speed", "m/s", "speed at the first contact with the end"),
        ("end_energy", "J", "kinetic energy of the moving mass at the first contact with the end"),
        ("absorbed_energy", "J", "absorbed by the end stop until rest: kinetic energy and work of the gas"),
        ("peak_force", "N", "largest force of the end stop"),
        ("depth", "m", "into the end stop"),
        ("mean_speed", "m/s", "stroke over stroke time"),
        ("stroke_time", "s", "from the command, from rest, to the first contact with the end"),
    )
    over = ("command", "direction")
    found = {name: ResultValue(over, values[:, :, k], unit, what) for k, (name, unit, what) in enumerate(said)}
    ratio = values[:, :, 0] / values[:, :, 5]
    found["end_over_mean_speed"] = ResultValue(
        over, ratio, "1", "end speed divided by mean speed (makers assume 1.4 to 1.5)"
    )
    return {"command": Axis(commands, "1", "size of the command"), "direction": DIRECTIONS}, found


def _hit(motion: StrokeRun) -> dict[str, float]:
    """Return the first impact of a stroke with the total energy that the stop absorbed. NaN without an impact."""
    stroke = motion.strokes[0]
    end = "b" if stroke.direction > 0 else "a"
    first = next((one for one in motion.attrs["impacts"] if one["end"] == end), None)
    taken = -sum(v for name, v in motion.attrs["ledger"]["accounts"].items() if name.endswith("damper heat [J]"))
    if first is None:
        taken = taken if motion.arrived() else math.nan
        nothing = dict.fromkeys(("peak_force_n", "depth_m"), math.nan)
        return nothing | {"speed_m_s": stroke.end_speed, "energy_j": stroke.end_energy, "absorbed_j": taken}
    return {**first, "absorbed_j": taken}
