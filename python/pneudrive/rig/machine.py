"""Simulated rig in virtual time: the rig in the core's form, its history, and the execution of steps.

The history affects friction by temperature, run-in, and scatter between cycles and days.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

import numpy as np
from pydantic import ConfigDict, TypeAdapter

from pneudrive import _core
from pneudrive.arrays import Array, Columns, Pair, Plain
from pneudrive.constants import LEAK_CRITICAL_RATIO, STANDARD_GRAVITY_M_S2
from pneudrive.errors import RigError, SimulationError
from pneudrive.rig.description import RIGID, RigDescription
from pneudrive.rig.interface import Hold, Move, Step, plain
from pneudrive.rig.motion import Motion, brake, dwell, move
from pneudrive.simulation.bench_circuit import AMBIENT, Dragged, MotionResult

Numbers = float | Array


def core_friction(d: RigDescription, mounting: str = RIGID) -> Plain:
    """Return the friction of the piston, including friction of the guide under a side load of the mounting."""
    table = {**d.friction}
    guide = d.tables.mounting.get(mounting)
    if guide is not None and guide.side_load > 0.0:
        table["side_load"] = {"force_n": guide.side_load, "coefficient": guide.coefficient}
    return table


def steady_friction_n(
    friction: Plain,
    velocity_m_s: float | Array,
    gauges_pa: Pair = (0.0, 0.0),
    position_m: float = 0.0,
) -> Array:
    """Return the friction of steady sliding in N, with the sign of the velocity.

    Parameters
    ----------
    friction : dict
        Result of `core_friction`.
    velocity_m_s : float or ndarray
    gauges_pa : (float, float)
        Gauge pressures in the chambers.
    position_m : float
        Position in m, for friction that depends on the position.

    Returns
    -------
    ndarray
        Friction in N, one-dimensional.
    """
    velocity = np.atleast_1d(np.asarray(velocity_m_s, dtype=float))
    others = dict(friction)
    law, parameters, pressure = (others.pop(name, None) for name in ("law", "parameters", "pressure"))
    return np.asarray(_core.steady_friction(law, parameters, velocity, *gauges_pa, pressure, others, position_m))


def core_rig(
    d: RigDescription,
    pressures_pa: Pair,
    friction: Plain | None = None,
    temperature_k: float | None = None,
) -> Dragged:
    """Return the rig with its chambers or regulators at these absolute pressures in Pa.

    Parameters
    ----------
    d : RigDescription
    pressures_pa : (float, float)
    friction : dict, optional
        Result of `core_friction`. Default: `core_friction` of the rigid mounting.
    temperature_k : float, optional
        Temperature of the room in K. Default: that of the rig file.
    """
    area_a, area_b = d.areas_m2
    servo = d.tables.servo
    cylinder = d.tables.cylinder
    sensor = d.tables.force_sensor
    rods = {"rodless": (0, 0), "single-rod": (0, 1), "through-rod": (1, 1)}[cylinder.kind]
    perimeter_a, perimeter_b = (math.pi * (cylinder.bore + rod * cylinder.rod_diameter) for rod in rods)
    carriage = {"release_time": servo.release_time}
    if servo.bandwidth is not None:
        carriage |= {"servo_bandwidth": servo.bandwidth, "servo_damping_ratio": servo.damping_ratio}
    if servo.ripple > 0.0:
        carriage |= {"ripple_velocity": servo.ripple, "ripple_pitch": servo.pitch}
    rig = Dragged(
        friction or core_friction(d),
        {
            "area_a": area_a,
            "area_b": area_b,
            "perimeter_a": perimeter_a,
            "perimeter_b": perimeter_b,
            "stroke": cylinder.stroke,
            "moving_mass": cylinder.moving_mass,
            "incline": cylinder.incline,
        },
        {"stiffness": sensor.stiffness, "damping": sensor.damping},
        carriage,
        d.ambient_pressure_pa,
        temperature_k or d.tables.ambient.temperature,
    )
    if d.tables.chambers.kind == "held":
        for name, pressure in zip("ab", pressures_pa, strict=True):
            rig.hold(name, pressure)
    else:
        _supply(rig, d, pressures_pa)
    return rig


def _supply(rig: Dragged, d: RigDescription, pressures_pa: Pair) -> None:
    """Add the air supply of the chambers: ports to the room, or regulators with shut-off, a volume and lines."""
    c = d.tables.chambers
    kind, ratio, heat = c.kind, c.critical_pressure_ratio, c.heat_transfer
    if kind == "common" and pressures_pa[0] != pressures_pa[1]:
        raise SimulationError.of("rig.common-manifold", a=pressures_pa[0], b=pressures_pa[1])

    def regulator(volume: str, pressure: float) -> None:
        source = f"source_{volume}"
        rig.hold(source, pressure)
        # A hose of the volume V and the diameter d has the wall area 4 V/d.
        wall = 4.0 * c.manifold_volume / c.hose_diameter
        rig.volume(volume, pressure, volume=c.manifold_volume, wall_area=wall, heat_transfer=heat)
        rig.path(f"regulator_{volume}", c.regulator_conductance, ratio, (source, volume))
        rig.shutters.append(f"regulator_{volume}")

    for side, pressure in zip("ab", pressures_pa, strict=True):
        rest = d.ambient_pressure_pa if kind == "open" else pressure
        rig.volume(side, rest, volume=c.dead_volume, heat_transfer=heat)
    for side, pressure in zip("ab", pressures_pa, strict=True):
        source = {"open": AMBIENT, "common": "manifold", "separate": f"hose_{side}"}[kind]
        if kind == "open":
            rig.shutters.append(f"line_{side}")
        elif source not in rig.sources.values():
            regulator(source, pressure)
        rig.sources[side] = source
        rig.path(f"line_{side}", c.line_conductance, ratio, (source, side))
    leaks = {("a", "b"): c.piston_leakage, ("a", AMBIENT): c.leakage, ("b", AMBIENT): c.leakage}
    for ends, conductance in leaks.items():
        if conductance > 0.0:
            rig.path("leak_" + "_".join(ends), conductance, LEAK_CRITICAL_RATIO, ends)


DAY_S = 86400.0


@dataclass
class Past:
    """History of a simulated rig, as plain data.

    Attributes
    ----------
    key : str
        Key of the last cycle. The random friction scale of the cycle depends on it.
    clock_s : float
        Clock of the rig.
    travel_m : float
        Distance slid by the present seal.
    seal_rise_k : float
        Temperature of the seal above that of the room.
    commanded_m : float
        Position of the axis.
    pressure_a_pa, pressure_b_pa : float
        Set pressures.
    state : list of float or None
        State of the core. None: at rest, with an unloaded sensor and the chambers at their set pressures.
    shown : dict
        Last true values of the channels.
    levels : dict
        Levels of the mounted factors.
    changes : dict
        Number of changes of each factor by hand.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", strict=True)
    key: str = ""
    clock_s: float = 0.0
    travel_m: float = 0.0
    seal_rise_k: float = 0.0
    commanded_m: float = 0.0
    pressure_a_pa: float = 0.0
    pressure_b_pa: float = 0.0
    state: list[float] | None = None
    shown: dict[str, float] = field(default_factory=dict)
    levels: dict[str, str] = field(default_factory=lambda: {"mounting": RIGID})
    changes: dict[str, int] = field(default_factory=dict)

    @classmethod
    def from_dict(cls, data: Plain) -> Past:
        """Return the history from plain data, with exactly the same numbers.

        Raises
        ------
        RigError
            The data are not a history of this kind.
        """
        with suppress(TypeError, ValueError):
            if len(data) == len(fields(cls)):
                return _PAST.validate_json(json.dumps(data, allow_nan=False, default=plain))
        raise RigError.of("rig.no-memory", value=data)

    def room_k(self, d: RigDescription, after_s: Numbers = 0.0) -> Numbers:
        """Return the temperature of the room in K, now or a number of seconds later."""
        turn = 2.0 * np.pi * (self.clock_s + after_s) / d.tables.thermal.room_period
        return d.tables.ambient.temperature + d.tables.thermal.room_amplitude * np.sin(turn)

    def force_drift_n(self, d: RigDescription, after_s: Numbers = 0.0) -> Numbers:
        """Return the drift in N of the force sensor's zero with temperature and time."""
        warmer = self.room_k(d, after_s) - d.tables.ambient.temperature
        sensor = d.tables.force_sensor
        return sensor.zero_drift_temperature * warmer + sensor.zero_drift_time * (self.clock_s + after_s)


_PAST = TypeAdapter(Past)


def stream(seed: int, *words: str) -> np.random.Generator:
    """Return a generator of random numbers that depends only on the seed and the words."""
    digest = hashlib.sha256("\0".join(words).encode()).digest()
    return np.random.default_rng([seed, int.from_bytes(digest[:8], "little")])


def friction_scale(d: RigDescription, past: Past, seed: int) -> float:
    """Return the friction scale of cycle, day, mounting and seal: a factor on all friction forces of the rig file.

    The factors are lognormal. Each factor depends only on the seed and the name of its cycle, day, mounting or seal.
    """
    changed = {factor: past.changes.get(factor, 0) for factor in ("mounting", "seal")}
    drawn = {
        "cycle": past.key,
        "day": str(int(past.clock_s // DAY_S)),
        "mounting": f"{past.levels.get('mounting', RIGID)} {changed['mounting']}",
        "seal": f"{past.levels.get('seal', '')} {changed['seal']}",
    }
    exponent = 0.0
    for factor, words in drawn.items():
        exponent += getattr(d.tables.repeatability, factor) * float(stream(seed, factor, words).standard_normal())
    return math.exp(exponent)


#: Tolerance of the core: force errors are far below the noise of any force sensor.
RTOL = 1e-6


def drag(rig: Dragged, motion: Motion, times: Array, begin: float | list[float], **options: Any) -> MotionResult:  # noqa: ANN401
    """Run a rig along a motion from a position or a state; see `pneudrive.simulation.bench_circuit.Dragged.run`.

    Raises
    ------
    SimulationError
        The core rejects the rig or cannot continue.
    """
    try:
        return rig.run(motion.durations_s, motion.jerks_m_s3, times, begin, RTOL, **options)
    except (ValueError, RuntimeError) as error:
        raise SimulationError("the simulated rig cannot run", value=str(error)) from error


#: Shortest move, m.
SHORTEST_M = 1e-9
#: Fraction of the set pressure within which chambers count as settled; longest settling time, s; interval of checks, s.
SETTLED, LONGEST_S, LOOK_S = 1e-3, 60.0, 0.5
#: Speed at which friction counts as breakaway, m/s, to check whether a released axis stays at rest.
CREEP_M_S = 1e-9


class Machine:
    """Axis, drive and chambers of a simulated rig. Each step takes a history and returns the next one.

    Parameters
    ----------
    d : RigDescription
    seed : int
    """

    def __init__(self, d: RigDescription, seed: int) -> None:
        self.d, self.seed = d, seed

    def new(self) -> Past:
        """Return the history of a new rig."""
        ambient = self.d.ambient_pressure_pa
        return Past(commanded_m=self.d.tables.servo.margin, pressure_a_pa=ambient, pressure_b_pa=ambient)

    def motion(self, past: Past, step: Step) -> Motion | None:
        """Plan the motion of a step from the present position. Return None if the step has no motion."""
        at = past.commanded_m
        if isinstance(step, Hold):
            return dwell(step.duration_s, at) if step.duration_s > 0.0 else None
        if abs(step.to_m - at) < SHORTEST_M:
            return None
        return move(step.to_m - at, step.speed_m_s, self.d.limits, at)

    def friction(self, past: Past) -> Plain:
        """Return the friction of the present step in the core's form.

        As in a drive, Coulomb and breakaway force depend on run-in and temperature. Viscous friction depends on
        temperature only. Both effects are evaluated at the beginning of the step, which is assumed to be short
        compared with the warming.
        """
        d, thermal = self.d, self.d.tables.thermal
        table = core_friction(d, past.levels.get("mounting", RIGID))
        excess, distance = d.tables.run_in.excess, d.tables.run_in.distance
        warmer = float(past.room_k(d)) - d.tables.ambient.temperature + past.seal_rise_k
        levels, viscous = _core.seal_factors(thermal.coulomb, -thermal.viscous, warmer, excess, distance, past.travel_m)
        scale = friction_scale(d, past, self.seed)
        factor = {"coulomb": scale * levels, "breakaway": scale * levels, "viscous": scale * viscous}
        table["parameters"] = {name: value * factor.get(name, 1.0) for name, value in table["parameters"].items()}
        if table["pressure"] is not None:
            table["pressure"] = {name: value * scale * levels for name, value in table["pressure"].items()}
        if table.get("dwell") is not None:
            table["dwell"] = table["dwell"] | {"increment_n": table["dwell"]["increment_n"] * scale}
        return table

    def steady_n(self, past: Past, friction: Plain, velocity_m_s: float) -> float:
        """Return the absolute steady friction in N at a velocity, the set pressures and the present position."""
        ambient = self.d.ambient_pressure_pa
        gauges = (past.pressure_a_pa - ambient, past.pressure_b_pa - ambient)
        return float(abs(steady_friction_n(friction, velocity_m_s, gauges, past.commanded_m)[0]))

    def run(
        self,
        past: Past,
        step: Step,
        motion: Motion,
        times: Array,
        look: Callable[[float], object] | None = None,
    ) -> tuple[Past, Columns]:
        """Return the history after one step, and the true signals.

        `look` is called regularly and may raise an error to end the step.

        Raises
        ------
        RigError
            The axis is to be released, but the pressures would move the piston away.
        SimulationError
            The core cannot continue.
        """
        d, friction = self.d, self.friction(past)
        hold = step if isinstance(step, Hold) else Hold(0.0)
        if hold.released:  # pressure and weight must not move a released piston away
            ambient, (area_a, area_b) = d.ambient_pressure_pa, d.areas_m2
            push = (past.pressure_a_pa - ambient) * area_a - (past.pressure_b_pa - ambient) * area_b
            push -= d.tables.cylinder.moving_mass * STANDARD_GRAVITY_M_S2 * np.sin(d.tables.cylinder.incline)
            if abs(push) > (holds := self.steady_n(past, friction, CREEP_M_S)):
                raise RigError.of("rig.moves-away", push=push, holds=holds)
        begin = past.commanded_m if past.state is None else past.state
        rig = core_rig(d, (past.pressure_a_pa, past.pressure_b_pa), friction, float(past.room_k(d)))
        columns, _, state, at = drag(rig, motion, times, begin, released=hold.released, shut=hold.shut, look=look)
        shown = {name: float(column[-1]) for name, column in columns.items()} if times.size else past.shown
        after = replace(past, state=state, commanded_m=at, shown=shown)
        power = 0.0
        if isinstance(step, Move):
            way = abs(at - motion.start_m)
            after.travel_m += way
            speed = float(np.copysign(step.speed_m_s, step.to_m - motion.start_m))
            power = self.steady_n(after, friction, speed) * way / motion.duration_s
        heat, lasts_s = d.tables.thermal, motion.duration_s  # of friction, in the seal
        after.seal_rise_k = _core.seal_warming(heat.seal_rise, heat.seal_time, past.seal_rise_k, power, lasts_s)
        after.clock_s += lasts_s
        return after, columns

    def cut(self, before: Past, step: Step, motion: Motion, time_s: float) -> Past:
        """Run a step from its beginning up to `time_s`, and brake."""
        begun = motion.until(time_s)
        position, speed, acceleration = map(float, motion.at(time_s))
        rest = begun.then(brake(position, speed, acceleration, self.d.limits))
        return self.run(before, step, rest, np.array([rest.duration_s]))[0] if rest.durations_s.size else before

    def settle(self, past: Past, a_pa: float, b_pa: float) -> Past:
        """Set the pressures, and wait at rest until the chambers have settled.

        Raises
        ------
        RigError
            The chambers do not reach the pressures.
        """
        a, b = 0.0, 0.0

        def rest(past: Past) -> Past:
            return self.run(past, Hold(LOOK_S), dwell(LOOK_S, past.commanded_m), np.array([LOOK_S]))[0]

        if past.state is None:  # start state, at the old pressures
            past = rest(past)
        past = replace(past, pressure_a_pa=a_pa, pressure_b_pa=b_pa)
        for _ in range(round(LONGEST_S / LOOK_S)):
            past = rest(past)
            a, b = past.shown["pressure_a_pa"], past.shown["pressure_b_pa"]
            if max(abs(a / a_pa - 1.0), abs(b / b_pa - 1.0)) < SETTLED:
                return past
        raise RigError.of("rig.not-settled", a=a_pa, b=b_pa, seconds=LONGEST_S, value=f"{a:g} and {b:g} Pa")
