"""Response to a step and to a square command: times, speeds, impact energy."""

from __future__ import annotations

import math
import warnings
from functools import lru_cache
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.arrays import Columns, Pair, Plain, evenly, rows_of
from pneudrive.datasheet.characteristic import Found, ResultValue, characteristic
from pneudrive.datasheet.equilibrium import gas_at, moving_gas, steady_state
from pneudrive.datasheet.strokes import STROKE_MEANING, StrokeNumbers, first_passage, stroke_numbers
from pneudrive.describe.system import short_name
from pneudrive.errors import CommandError, PneudriveWarning, SimulationError
from pneudrive.simulation.simulate import simulate
from pneudrive.simulation.trajectory import columns as columns_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from pneudrive.datasheet.plant import HeldDrive
    from pneudrive.simulation.command import Commands


# --- Runs of a drive for its characteristics: one stroke, and a periodic cycle out and back.

SLOWER, LONGEST = 4.0, 256.0  # a piston that has not arrived is given this much more time, up to this multiple
EXPECTED = 4.0  # times the stroke over its steady speed
USUAL_SPEED = 0.5  # m/s, where no steady one is found
LEAST_S = 0.2  # of a half cycle
SAMPLES = 2000  # of a stroke
REPEATS = 3  # cycles after which a fast cycle repeats itself


class StrokeRun(NamedTuple):
    """Columns of a run under the names of a drive file, and the numbers of its strokes."""

    columns: Columns
    strokes: list[StrokeNumbers]
    half_s: float
    attrs: Plain

    def arrived(self) -> bool:
        """Return whether all strokes reached their end."""
        return all(stroke.stroke_time == stroke.stroke_time for stroke in self.strokes)


def simulate_plant(plant: HeldDrive, plans: Commands, duration: float, rate: float, **more: Any) -> xr.Dataset:  # noqa: ANN401
    """Simulate the circuit of a drive. Warnings are not shown, because only runs that the user requests need them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        return simulate(plant.circuit, plans, duration, sample_rate=rate, **more)


def short_columns(plant: HeldDrive, run: xr.Dataset) -> Columns:
    """Return the columns of a circuit's run under the names of a drive file."""
    return {short_name(name, plant.piston): values for name, values in columns_of(run).items()}


@lru_cache(maxsize=64)
def expected_time(plant: HeldDrive, command: float) -> float:
    """Return a time (s) that is sufficient for one stroke."""
    try:
        speed = min(abs(steady_state(plant.static, side * command, 0.0).velocity_m_s) for side in (1, -1))
    except (CommandError, SimulationError):
        speed = USUAL_SPEED
    return max(EXPECTED * plant.stroke_m / speed, LEAST_S) if speed > 0.0 else LONGEST * LEAST_S


def run_strokes(
    plant: HeldDrive,
    signals: Sequence[float],
    position: float,
    pressures: Pair,
    expected_s: float | None = None,
    **more: Any,  # noqa: ANN401 - of `simulate`
) -> StrokeRun:
    """Run a stroke for each signal. Return the stroke of a single signal, or the last two strokes of several signals.

    The first stroke starts from rest. All strokes have the same duration. If a stroke does not finish, the duration is
    increased.
    """
    expected = expected_s or expected_time(plant, abs(signals[0]))
    start, count = start_of(plant, position, pressures), min(len(signals), 2)
    times = 1.0
    while True:
        half = times * expected
        edges = [k * half for k in range(len(signals) + 1)]
        plans = plant.plans(list(zip(edges, signals, strict=False)))
        run = simulate_plant(plant, plans, edges[-1], SAMPLES / expected, initial=start, **more)
        columns = short_columns(plant, run)
        strokes = [
            stroke_numbers(columns, plant.stroke_m, plant.mass, *ends, run.attrs["impacts"], 1 if u > 0.0 else -1)
            for ends, u in list(zip(pairwise(edges), signals, strict=True))[-count:]
        ]
        begin = edges[-1 - count]
        last = rows_of(columns, columns["time_s"] >= begin)
        found = StrokeRun(last | {"time_s": last["time_s"] - begin}, strokes, half, run.attrs)
        # A cycle has two strokes: its half cycle ends one step earlier than a single stroke.
        if found.arrived() or times >= LONGEST or half > LONGEST / SLOWER ** (count - 1):
            return found
        times *= SLOWER


def start_of(plant: HeldDrive, position: float, pressures: Pair) -> dict[str, str]:
    """Return a start state at ambient temperature. Lines start at the pressure of their chamber."""
    plant.check_position(position)
    own = plant.piston
    start = {f"{own}.position": f"{position!r} m"}
    sides = [(side, p) for side, p in zip("ab", pressures, strict=True) if f"{own}.{side}" in plant.nodes]
    return start | {f"{own}.{side}": f"{p!r} Pa abs" for side, p in sides}


def square(half_s: float, repeats: int) -> list[Pair]:
    """Return time (s) and signal at each change of a square command."""
    return [(k * half_s, 1.0 if k % 2 == 0 else -1.0) for k in range(2 * repeats)]


@lru_cache(maxsize=16)  # characteristics of one drive share runs
def cycle(plant: HeldDrive) -> StrokeRun:
    """Run out and back until the cycle is periodic; return columns and strokes of the last cycle."""
    return run_strokes(plant, [1.0, -1.0] * REPEATS, 0.0, plant.before(1.0))


COMMANDS = (0.2, 0.4, 0.6, 0.8, 1.0)
SHOWN = 400  # samples of a trace
_TRACE = {
    "time": ("time_s", "s", "time from the command"),
    "position": ("position_m", "m", "position of the piston"),
    "velocity": ("velocity_m_s", "m/s", "velocity of the piston"),
    "pressure_a": ("pressure_a_pa", "Pa", "absolute pressure in chamber a"),
    "pressure_b": ("pressure_b_pa", "Pa", "absolute pressure in chamber b"),
}


def trace(motion: StrokeRun) -> dict[str, ResultValue]:
    """Return position, velocity and pressures over time, thinned for a figure."""
    time = motion.columns["time_s"]
    shown = np.linspace(time[0], time[-1], SHOWN)
    return {
        name: ResultValue(("time",), np.interp(shown, time, motion.columns[column]), unit, meaning)
        for name, (column, unit, meaning) in _TRACE.items()
    }


def _numbers(motion: StrokeRun, dims: tuple[str, ...]) -> dict[str, ResultValue]:
    rows = [stroke.to_dict() for stroke in motion.strokes]
    values = {name: [row[name] for row in rows] if dims else rows[0][name] for name in STROKE_MEANING}
    return {name: ResultValue(dims, values[name], unit, meaning) for name, (unit, meaning) in STROKE_MEANING.items()}


@characteristic(
    "step-response",
    algorithm="simulated with default tolerance; contacts located by the solver",
    cites=("iso6358-2013", "steinebach2023"),
    x="time",
    y="position",
)
def _step(plant: HeldDrive, command: float = 1.0, position: float | None = None, pressures: Any = None) -> Found:  # noqa: ANN401
    """Response to a step.

    One stroke from rest. The stroke time runs from the command to the first contact with the end, the dead time from
    the command to 0.2 % of the distance. The rise time runs from 10 % to 90 % of the distance. The settling time ends
    when the position stays within 1 % of the distance.

    Settings
    --------
    command
        command of the valve
    position
        start position, in m; default: the end from which the piston moves away
    pressures
        start pressures; default: ambient, and supply in the emptying chamber
    """
    x = (0.0 if command > 0.0 else plant.stroke_m) if position is None else position
    at_rest = plant.before(command) if pressures is None else plant.pressures(gas_at(plant, pressures))
    motion = run_strokes(plant, [command], x, at_rest)
    return trace(motion) | _numbers(motion, ())


@characteristic(
    "square-response",
    algorithm="three simulated cycles, of which the last is evaluated; half a period suffices for a stroke",
    cites=("iso6358-2013", "steinebach2023"),
    x="time",
    y="position",
)
def _square(plant: HeldDrive) -> Found:
    """Response to a square command.

    Periodic strokes out and back under a square command, whose period is long enough to reach both ends. The results
    are defined as for a step.

    Results
    -------
    both_strokes : s
        both stroke times
    half_period : s
        half of the period of the command
    """
    motion = cycle(plant)
    both = sum(stroke.stroke_time for stroke in motion.strokes)
    return trace(motion) | _numbers(motion, ("direction",)) | {"both_strokes": both, "half_period": motion.half_s}


@characteristic(
    "impact",
    algorithm="one simulated stroke for each command and direction, with ledger",
    x="command",
    y="end_energy",
)
def _impact(plant: HeldDrive) -> Found:
    """Impact at the ends.

    Speed and kinetic energy of the moving mass at the fastest contact with the end, and the total energy that the
    end stop absorbs. The stroke is a full one from rest, with the emptying chamber at supply pressure.

    Results
    -------
    command : 1
        size of the command
    end_speed : m/s over command, direction
        speed at the fastest contact with the end
    end_energy : J over command, direction
        kinetic energy of the moving mass at the fastest contact with the end
    absorbed_energy : J over command, direction
        energy that the end stop absorbs until rest: kinetic energy and work of the gas
    peak_force : N over command, direction
        largest force of the end stop
    depth : m over command, direction
        largest penetration of the piston into the end stop
    mean_speed : m/s over command, direction
        stroke over stroke time
    stroke_time : s over command, direction
        time of a stroke from rest, from the command to the first contact with the end
    end_over_mean_speed : 1 over command, direction
        end speed divided by mean speed (makers assume 1.4 to 1.5)
    """
    commands = plant.sizes(COMMANDS)
    rows = []
    for command, (way, end) in product(commands, ((1.0, "b"), (-1.0, "a"))):
        start = 0.0 if way > 0.0 else plant.stroke_m
        motion = run_strokes(plant, [way * command], start, plant.before(way), ledger=True)
        (one,) = motion.strokes
        first = next((hit for hit in motion.attrs["impacts"] if hit["end"] == end), {})
        contact = first.get("peak_force_n", math.nan), first.get("depth_m", math.nan)
        taken = -sum(v for name, v in motion.attrs["ledger"]["accounts"].items() if name.endswith("damper heat [J]"))
        absorbed = taken if motion.arrived() else math.nan
        rows.append((one.end_speed, one.end_energy, absorbed, *contact, one.mean_speed, one.stroke_time))
    speed, *others, mean, time = np.array(rows).reshape(len(commands), 2, -1).transpose(2, 0, 1)
    return commands, speed, *others, mean, time, speed / mean


# --- Capacity of a cushion: end speed and peak pressure over mass and speed, and over the opening of its needle.

END_SPEED, PRESSURE_SHARE = 0.1, 2.0  # m/s; times the supply (assumed limits)
BEFORE_M = 1e-3  # ahead of the cushion
SPEEDS, MASSES = (0.2, 0.5, 1.0, 1.5, 2.0, 3.0), (0.5, 1.0, 2.0, 4.0)
NEEDLES = np.geomspace(0.1, 10.0, 13).tolist()  # times the described opening
ENTRY_S, ENTRY_RATE_HZ = 1.0, 5e3


@characteristic(
    "cushion",
    algorithm="one simulated stroke into the cushion for each point",
    x="speed",
    y="end_speed",
)
def _cushion(plant: HeldDrive, end_speed: float = END_SPEED) -> Found:
    """Capacity of the cushion.

    End speed and peak pressure of a piston that enters its cushion at a given speed, over mass, entry speed and
    needle opening. The valve is fully open, and the pressures at entry are those of slow steady motion. The largest
    admissible pressure is twice the supply pressure (assumed).

    Settings
    --------
    end_speed
        largest admissible end speed, in m/s (assumed)

    Results
    -------
    mass : kg
        moving mass
    speed : m/s
        speed at the beginning of the cushion
    needle : 1
        opening of the needle, relative to the described opening
    peak_pressure : Pa over mass, speed
        largest absolute pressure in the cushion
    end_speed_by_needle : m/s over needle
        end speed from 1 m/s with the described mass
    best_needle : 1
        opening with the lowest end speed; none if the piston never reaches the end
    """
    side = next((side for side in "ba" if f"cushion_{side}_length" in plant.table(plant.piston)), "")
    if not side:
        raise CommandError(f"{plant.piston} has no cushion", remedy='Add cushion_b = { length = "17 mm", ... }.')
    most = PRESSURE_SHARE * plant.supply_pa
    masses, speeds = [share * plant.mass for share in MASSES], list(SPEEDS)
    keys = {name: "moving_mass" if name == plant.piston else "mass" for name in plant.parts}
    bodies = [(name, key, getattr(plant.parts[name], key, None)) for name, key in keys.items()]
    grid = []  # the masses of piston, loads and slides multiplied by a factor
    for share in MASSES:
        heavier = plant.varied({name: {key: f"{share * kg!r} kg"} for name, key, kg in bodies if kg is not None})
        grid.append([_end(heavier, side, v) for v in speeds])
    ends_m_s, peaks_pa = np.array(grid).transpose(2, 0, 1)
    key = f"cushion_{side}_needle_conductance"
    described = getattr(plant.parts[plant.piston], f"{key}_m3_s_pa")
    opened = (plant.varied({plant.piston: {key: f"{share * described!r} m3/(s Pa)"}}) for share in NEEDLES)
    needles = np.array([_end(one, side, 1.0) for one in opened])
    best = np.argsort(needles[:, 0])[0]  # speeds of a piston that does not arrive are last
    over = ("mass", "speed")
    allowed = (ends_m_s <= end_speed) & (peaks_pa <= most)
    limits = f"1 if the end speed is at most {end_speed:g} m/s and the pressure at most {1e-5 * most:g} bar (assumed)"
    ends = f"speed at the end of chamber {side}; none if it does not arrive within {ENTRY_S:g} s"
    return {
        "mass": masses,
        "speed": speeds,
        "needle": NEEDLES,
        "end_speed": ResultValue(over, ends_m_s, "m/s", ends),
        "peak_pressure": peaks_pa,
        "admissible": ResultValue(over, allowed, "1", limits),
        "end_speed_by_needle": needles[:, 0],
        "best_needle": math.nan if math.isnan(needles[best, 0]) else NEEDLES[best],
    }


def _end(plant: HeldDrive, side: str, speed: float) -> Pair:
    """Return end speed (m/s) and peak pressure (Pa) of a piston that enters a cushion at a given speed."""
    toward = 1.0 if side == "b" else -1.0
    length = getattr(plant.parts[plant.piston], f"cushion_{side}_length_m")
    x = plant.stroke_m - length - BEFORE_M if side == "b" else length + BEFORE_M
    a, b = plant.pressures(moving_gas(plant.static))
    start = start_of(plant, x, (a, b) if side == "b" else (b, a))
    start[f"{plant.piston}.velocity"] = f"{toward * speed!r} m/s"
    plant = plant.with_held_valves  # the valve has opened long before
    run = simulate_plant(plant, plant.plans([(0.0, toward)]), ENTRY_S, ENTRY_RATE_HZ, initial=start)
    end_speed = next((one["speed_m_s"] for one in run.attrs["impacts"] if one["end"] == side), math.nan)
    peak = float(run[f"{plant.piston}.{side}.pressure"].max())
    return end_speed, peak if math.isfinite(peak) else math.nan


# --- Times of a switching valve, on a virtual test stand with a small volume at its outlet.

SHARE = 0.1  # of the change of the pressure at the outlet
VOLUME_M3 = 1e-5
REST_S, SWITCHING_RATE_HZ = 0.5, 1e5  # between the commands; samples


@characteristic(
    "valve-times",
    algorithm="virtual test stand: reservoir, valve, volume",
    standard="form of ISO 12238",
    x="time",
    y="outlet_pressure",
)
def _times(plant: HeldDrive) -> Found:
    """Times of the valve.

    Time from a switch-on or switch-off command to 10 % of the pressure change in a volume of 10 cm3 at the outlet.

    Results
    -------
    time : s
        time from the switch-on command
    outlet_pressure : Pa over time
        absolute pressure at the outlet
    time_on : s
        time from the switch-on command to 10 % of the rise at the outlet
    time_off : s
        time from the switch-off command to 10 % of the fall at the outlet
    """  # noqa: D401 - a title
    table = plant.table(plant.valve)
    if "time_on" not in table:
        raise CommandError.of("datasheet.no_times", valve=plant.valve, kind_of_valve=table["kind"])
    ports = [port["name"] for port in plant.parts[plant.valve].entry["ports"]]
    outlet = "4" if "4" in ports else "2"
    other = [f"valve.{port}" for port in ports if port in ("2", "4") and port != outlet]
    circuit = type(plant.circuit).model_validate(
        {
            "name": "times of a valve",
            "ambient": plant.circuit.to_dict().get("ambient", {}),
            "components": {
                "supply": {"kind": "reservoir", "pressure": f"{plant.supply_pa!r} Pa abs"},
                "valve": table,
                "volume": {"kind": "tank", "volume": f"{VOLUME_M3!r} m3"},
            },
            "connections": ["supply -> valve.1", f"valve.{outlet} -> volume"],
            "plugged": other,
        }
    )
    run = circuit.simulate({"valve": f"0 s: 1, {REST_S} s: 0"}, 2.0 * REST_S, sample_rate=SWITCHING_RATE_HZ)
    time, pressure = run.time.values, run["volume.pressure"].values
    on, off = time < REST_S, time >= REST_S
    rise, fall = pressure[on], pressure[off]
    up = first_passage(time[on], rise, rise[0] + SHARE * (rise[-1] - rise[0]))
    down = first_passage(time[off], -fall, -fall[0] + SHARE * (fall[0] - fall[-1])) - REST_S
    shown = evenly(time.size, 800)
    return time[shown], pressure[shown], up, down
