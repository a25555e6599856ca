"""Simulated rig: true motion from the core, recordings from sensor models, and a session for campaigns."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from threading import Event, RLock
from time import monotonic
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.arrays import Array, Columns, NamedNumbers, Pair, Plain, attributes_of
from pneudrive.errors import CommandError, RigError, nearest
from pneudrive.repr_tables import Shown
from pneudrive.rig.description import DEFAULT, RIGID, AnalogSensor, RigDescription, read_description
from pneudrive.rig.interface import CHANNELS, SHARED, WORDS, Envelope, Hold, Identity, Move, RigState, Samples, Step
from pneudrive.rig.machine import CREEP_M_S, Machine, Past, core_friction, core_rig, drag, steady_friction_n, stream
from pneudrive.rig.motion import PART_S, Motion, cycles, in_parts, keep_pace, step_times
from pneudrive.signals.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from pneudrive.rig.interface import Sampling

    Gauges = float | Pair  # pressures of both chambers, or of a and b
    Observer = Callable[[Machine, Past, Step, Motion, dict[str, Array]], None]


@dataclass(frozen=True, repr=False)
class Trace(Shown):
    """True signals of the rig at the sample times, without errors of the sensors.

    Attributes
    ----------
    columns : dict
        Columns of the core: time_s, carriage_position_m, ..., sensor_force_n, friction_force_n.
    motion : Motion
        Motion of the servo carriage.
    speed_m_s : float
        Commanded speed.
    pressure_a_pa, pressure_b_pa : float
        Absolute pressures at which the chambers are held.
    """

    columns: dict[str, Array]
    motion: Motion
    speed_m_s: float
    pressure_a_pa: float
    pressure_b_pa: float


@dataclass(frozen=True)
class SimulatedRig:
    """Simulated rig: a linear servo drags the piston through a stiff force sensor at constant pressures.

    Parameters
    ----------
    description : RigDescription

    Examples
    --------
    >>> rig = SimulatedRig.default()
    >>> recording = rig.measure(0.05, gauge_pa=0.5e5, seed=1)
    >>> len(recording), recording.synthetic
    (5000, True)
    """

    description: RigDescription

    @classmethod
    def default(cls) -> SimulatedRig:
        """Return the rig with the default values of the package."""
        return cls(read_description(DEFAULT))

    @classmethod
    def load(cls, path: str | Path) -> SimulatedRig:
        """Return the rig of a TOML file."""
        return cls(read_description(path))

    def session(self, seed: int = 0, pace: float | None = None) -> RigSession:
        """Start a session with the methods that a campaign needs; see `RigSession`."""
        return RigSession(self, seed, pace)

    def identity(self) -> Identity:
        """Return the identity of the rig, with the stated accuracies."""
        d, tables = self.description, self.description.tables
        channels = {
            "force_n": (d.force_sensor, tables.force_sensor.accuracy),
            **dict.fromkeys(("pressure_a_pa", "pressure_b_pa"), (d.pressure_sensor, tables.pressure_sensor.accuracy)),
            "temperature_k": (d.thermometer, tables.temperature_sensor.accuracy),
        }
        (area_a, area_b), errors = d.areas_m2, WORDS["calibration"]
        return Identity(
            name=d.name,
            area_a_m2=area_a,
            area_b_m2=area_b,
            ambient_pressure_pa=d.ambient_pressure_pa,
            mass_beyond_sensor_kg=tables.cylinder.moving_mass,
            incline_rad=tables.cylinder.incline,
            stiffness_n_m=tables.force_sensor.stiffness,
            accuracy={name: accuracy for name, (_, accuracy) in channels.items()}
            | {"position_m": d.encoder.resolution_m / 12.0**0.5},
            limits={name: (sensor.low, sensor.high) for name, (sensor, _) in channels.items()},
            resolution={name: sensor.step for name, (sensor, _) in channels.items()}
            | {"position_m": d.encoder.resolution_m},
            calibration={name: errors["force" if name == "force_n" else "sensor"] for name in channels},
            labels={"rig": d.name},
            chambers=tables.chambers.kind,
            pressure_measured_at=tables.pressure_sensor.at,
            synthetic=True,
        )

    def drag(self, speed_m_s: float, gauge_pa: Gauges = 0.0, *, count: int = 1) -> Trace:
        """Drag the piston out and back, and return the true signals.

        Parameters
        ----------
        speed_m_s : float
            Speed between the ramps, > 0.
        gauge_pa : float or (float, float)
            Gauge pressure in both chambers, or in a and b.
        count : int
            Number of cycles (out and back).

        Returns
        -------
        Trace

        Raises
        ------
        CommandError
            The speed is not reached within the stroke, or a pressure is below vacuum.
        SimulationError
            The core rejects the rig or cannot finish.
        """
        d = self.description
        margin = d.tables.servo.margin
        motion = cycles(margin, d.tables.cylinder.stroke - margin, speed_m_s, d.limits, count=count)
        pressures = self._absolute(gauge_pa)
        times = np.linspace(0.0, motion.duration_s, count * int(d.tables.sampling.samples_per_cycle))
        result = drag(core_rig(d, pressures), motion, times, motion.start_m)
        return Trace(result.columns, motion, speed_m_s, *pressures)

    def record(self, trace: Trace, seed: int | Sequence[int] = 0) -> Recording:
        """Read a trace with the rig's sensors.

        Parameters
        ----------
        trace : Trace
        seed : int or sequence of int
            Seed of the noise; equal seeds give equal recordings.

        Returns
        -------
        Recording
            Recording with ``synthetic`` and ``truth``: friction law, parameters, sensor zeros, speed, true pressures.
        """
        d, identity = self.description, self.identity()
        rng = np.random.default_rng(seed)
        true = trace.columns
        gauges = [1e-5 * (p - d.ambient_pressure_pa) for p in (trace.pressure_a_pa, trace.pressure_b_pa)]
        shown = f"{gauges[0]:.3g} bar" if gauges[0] == gauges[1] else f"{gauges[0]:.3g} and {gauges[1]:.3g} bar"
        speed = f"{1e3 * trace.speed_m_s:.4g} mm/s"
        shared = attributes_of(identity, *SHARED)
        shared |= {"limits": {"force_n": identity.limits["force_n"]}, "calibration": {}}
        # Accuracies of all channels except time and temperature.
        shared["accuracy"] = {channel: identity.accuracy[channel] for channel in CHANNELS[1:-1]}
        return Recording(
            name=f"{speed}, {shown}",
            time_s=true["time_s"],
            position_m=d.encoder.read(true["carriage_position_m"]),
            force_n=d.force_sensor.read(true["sensor_force_n"], rng),
            pressure_a_pa=d.pressure_sensor.read(true["pressure_a_pa"], rng),
            pressure_b_pa=d.pressure_sensor.read(true["pressure_b_pa"], rng),
            **shared,
            labels={"rig": d.name, "speed": speed, "pressure": f"{shown} gauge"},
            truth={
                **{name: deepcopy(d.friction[name]) for name in ("law", "parameters", "pressure")},
                "speed_m_s": trace.speed_m_s,
                "pressure_a_pa": trace.pressure_a_pa,
                "pressure_b_pa": trace.pressure_b_pa,
                "force_zero_n": d.force_sensor.zero,
                "friction_n": float(self.true_friction(trace.speed_m_s, trace.pressure_a_pa, trace.pressure_b_pa)),
            },
        )

    def measure(
        self,
        speed_m_s: float,
        gauge_pa: Gauges = 0.0,
        *,
        count: int = 1,
        seed: int | Sequence[int] = 0,
    ) -> Recording:
        """Drag and record in one step; see :meth:`drag` and :meth:`record`."""
        return self.record(self.drag(speed_m_s, gauge_pa, count=count), seed)

    def true_friction(
        self, speed_m_s: float | Array, pressure_a_pa: float | None = None, pressure_b_pa: float | None = None
    ) -> Array:
        """Return the friction in N of steady sliding at mid stroke. Pressures are absolute, by default ambient."""
        d = self.description
        a, b = (0.0 if p is None else p - d.ambient_pressure_pa for p in (pressure_a_pa, pressure_b_pa))
        friction = steady_friction_n(core_friction(d), speed_m_s, (a, b), 0.5 * d.tables.cylinder.stroke)
        return friction if np.ndim(speed_m_s) else friction[0]

    def _absolute(self, gauge_pa: Gauges) -> Pair:
        pair = gauge_pa if isinstance(gauge_pa, tuple) else (gauge_pa, gauge_pa)
        absolute = tuple(float(p) + self.description.ambient_pressure_pa for p in pair)
        if len(absolute) != 2 or not all(0.0 < p < np.inf for p in absolute):
            raise CommandError.of("rig.vacuum", pair=pair)
        return absolute[0], absolute[1]


def sweep(
    rig: SimulatedRig,
    speeds_m_s: Iterable[float],
    gauges_pa: Iterable[Gauges] = (0.0,),
    *,
    count: int = 1,
    seed: int = 0,
) -> list[Recording]:
    """Measure every speed at every pressure.

    Parameters
    ----------
    rig : SimulatedRig
    speeds_m_s : iterable of float
    gauges_pa : iterable of float or (float, float)
        Gauge pressure in both chambers, or in a and b.
    count : int
        Cycles at each point; two or more show the scatter between strokes.
    seed : int
        Seed of the noise; each recording has an independent stream.

    Returns
    -------
    list of Recording
        Recordings in the given order: all speeds at the first pressure, then all speeds at the next one.
    """
    speeds = list(speeds_m_s)
    return [
        rig.measure(speed, gauge, count=count, seed=(seed, i, j))
        for i, gauge in enumerate(gauges_pa)
        for j, speed in enumerate(speeds)
    ]


def load_session(source: str, seed: int, pace: float | None) -> RigSession:
    """Return the session of a rig file; see `pneudrive.rig.load_rig`."""
    return SimulatedRig.load(source).session(seed, pace)


#: Fraction of a force sensor's accuracy that changes sign with the force, as in the uncertainty budget.
HYSTERESIS_SHARE = 1.0 / 3.0


class Instruments:
    """Sensors with calibration errors drawn once from the rig's seed.

    The stated accuracy is a standard uncertainty. It is the standard deviation of the gain error at full range, and of
    the zeros of pressure sensors and thermometer. The zero of the force sensor comes from the rig file. A third of the
    accuracy is an error that changes sign with the force (hysteresis).

    Parameters
    ----------
    d : RigDescription
    seed : int
    """

    def __init__(self, d: RigDescription, seed: int) -> None:
        self.d = d
        draw = stream(seed, "calibration").standard_normal(7)
        force = d.tables.force_sensor.accuracy
        self.force = replace(
            d.force_sensor,
            gain_error=force / d.force_sensor.high * draw[0],
            hysteresis=force * HYSTERESIS_SHARE / 2.0**0.5 * draw[1],
        )
        self.pressure_a = self._pressure(draw[2], draw[3])
        self.pressure_b = self._pressure(draw[4], draw[5])
        self.thermometer = replace(d.thermometer, zero=d.tables.temperature_sensor.accuracy * draw[6])

    def _pressure(self, zero: float, gain: float) -> AnalogSensor:
        sensor, ambient = self.d.pressure_sensor, self.d.ambient_pressure_pa
        accuracy = self.d.tables.pressure_sensor.accuracy
        relative = accuracy / (sensor.high - ambient) * gain
        # The error of the gain is proportional to the gauge pressure.
        shift = sensor.zero + accuracy * zero - relative * ambient
        return replace(sensor, gain_error=relative, zero=shift)

    def read(
        self,
        true: Columns,
        past: Past,
        rng: np.random.Generator | None,
        weight_n: float = 0.0,
    ) -> Columns:
        """Return the readings for true signals.

        Parameters
        ----------
        true : dict
            Columns of the core over one step.
        past : Past
            History at the beginning of the step.
        rng : numpy.random.Generator or None
            Generator of the noise; None: no noise.
        weight_n : float
            Weight in N that is on the force sensor instead of the drive.

        Returns
        -------
        dict
            position_m, force_n, pressure_a_pa, pressure_b_pa, temperature_k.
        """
        d, t = self.d, true["time_s"]
        where = "supply_pressure" if d.tables.pressure_sensor.at == "regulator" else "pressure"
        force = true["sensor_force_n"] if weight_n == 0.0 else np.full(t.shape, -weight_n)
        barrel_k = past.room_k(d, t) + d.tables.temperature_sensor.share * past.seal_rise_k  # at the thermometer
        return {
            "position_m": d.encoder.read(true["carriage_position_m"]),
            "force_n": self.force.read(force, rng, past.force_drift_n(d, t)),
            "pressure_a_pa": self.pressure_a.read(true[f"{where}_a_pa"], rng),
            "pressure_b_pa": self.pressure_b.read(true[f"{where}_b_pa"], rng),
            "temperature_k": self.thermometer.read(np.asarray(barrel_k), rng),
        }


#: Speed of moves without a stated speed, such as homing.
HOME_SPEED_M_S = 0.05
#: Default range of room temperature for measuring, K relative to that of the rig file (assumed).
USUAL_TEMPERATURES_K = (-10.0, 15.0)


@dataclass
class _Run:
    """Running motion of the axis, for threads that stop or display it.

    ``halted`` is set when the axis must stop. ``present`` has the present step, the history at its start, and its
    motion. ``reached_s`` is the time since the start of the step. ``seen`` has the last readings of the sensors.
    """

    halted: Event = field(default_factory=Event)
    present: tuple[Past, Step, Motion] | None = None
    reached_s: float = 0.0
    seen: dict[str, float] | None = None


class RigSession:
    """Session of a simulated rig, with the methods of `Rig`, `Reproducible` and `Changeable`.

    Noise depends only on the seed and the key of the cycle. Drifting quantities depend on the history, which `memory`
    returns: clock, distance and temperature of the seal, room temperature, zero of the force sensor, contact age, and
    pressures. Another thread may stop the rig.

    Parameters
    ----------
    rig : pneudrive.rig.SimulatedRig
    seed : int
        Seed of noise, calibration errors, and scatter between cycles, days, mountings and seals.
    pace : float, optional
        Speed relative to real time; None: as fast as possible.
    """

    def __init__(self, rig: SimulatedRig, seed: int, pace: float | None) -> None:
        if pace is not None and not pace > 0.0:
            raise RigError(f"pace = {pace} is not positive", rule="pace is the speed of the rig relative to real time")
        self.rig, self.seed, self.pace = rig, seed, pace
        self._d = d = rig.description
        self._machine, self._instruments = Machine(d, seed), Instruments(d, seed)
        self._rng = stream(seed, "noise", "")
        #: History of the rig. A step replaces it.
        self.past = self._machine.new()
        self._running: _Run | None = None
        #: Called after each step of a cycle with machine, history before the step, step, motion and true signals.
        self.observe: Observer | None = None
        self._lock = RLock()

    # --- what it is --------------------------------------------------------------------------

    def identity(self) -> Identity:
        """Return the identity of the rig."""
        return self.rig.identity()

    def limits(self) -> Envelope:
        """Return the limits of the rig."""
        d, tables = self._d, self._d.tables
        ambient = d.ambient_pressure_pa
        safety = tables.safety
        servo = tables.servo
        kind = tables.chambers.kind
        highest = ambient if kind == "open" else min(
            safety.pressure or d.pressure_sensor.high, tables.supply.pressure or np.inf
        )  # fmt: skip
        speed = servo.speed or d.limits.top_speed_m_s(d.tables.cylinder.stroke - 2.0 * servo.margin)
        room = tables.ambient.temperature
        least = safety.least_temperature or room + USUAL_TEMPERATURES_K[0]
        greatest = safety.greatest_temperature or room + USUAL_TEMPERATURES_K[1]
        friction = self.rig.true_friction(np.array([CREEP_M_S, speed]), highest, highest)
        return Envelope(
            position_m=(servo.margin, d.tables.cylinder.stroke - servo.margin),
            speed_m_s=speed,
            acceleration_m_s2=d.limits.acceleration_m_s2,
            jerk_m_s3=d.limits.jerk_m_s3,
            force_n=safety.force or d.force_sensor.high,
            pressure_pa=(ambient, highest),
            separate_pressures=kind in ("held", "separate"),
            temperature_k=(least, greatest),
            supply_pressure_pa=safety.least_supply or 0.0,
            expected_friction_n=float(np.max(friction)),
            home_m=servo.margin,
        )

    def state(self) -> RigState:
        """Return the state of the rig, with readings without noise."""
        with self._lock:
            past = self.past
            run = self._running or _Run()
            is_moving = self._running is not None
            supply = self._d.tables.supply.pressure or max(past.pressure_a_pa, past.pressure_b_pa)
            began = run.present[0] if run.present is not None else past
            seen: Plain = run.seen or self._at_rest(began)
            clock = began.clock_s + run.reached_s
            return RigState(**seen, supply_pressure_pa=supply, time_s=clock, moving=is_moving)

    def _at_rest(self, past: Past) -> NamedNumbers:
        a, b = past.pressure_a_pa, past.pressure_b_pa
        true = {"carriage_position_m": past.commanded_m, "sensor_force_n": 0.0, "pressure_a_pa": a, "pressure_b_pa": b}
        true |= {"supply_pressure_a_pa": a, "supply_pressure_b_pa": b, **past.shown, "time_s": 0.0}
        seen = self._instruments.read({name: np.array([value]) for name, value in true.items()}, past, None)
        return {name: float(values[0]) for name, values in seen.items()}

    # --- what it does ------------------------------------------------------------------------

    def home(self) -> None:
        """Bring the axis to its home position."""
        self.move(self.limits().home_m, HOME_SPEED_M_S)

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        """Bring the chambers to these absolute pressures in Pa. For ambient pressure, the chambers are vented."""
        limits = self.limits()
        low, high = limits.pressure_pa
        for name, value in (("a", a_pa), ("b", b_pa)):
            if not low * (1.0 - 1e-9) <= value <= high * (1.0 + 1e-9):
                raise RigError.of("rig.pressure", chamber=name, pressure=value, low=low, high=high)
        if a_pa != b_pa and not limits.separate_pressures:
            raise RigError.of("rig.one-regulator", a=a_pa, b=b_pa)
        self._idle()
        with self._lock:
            clock_s = self.past.clock_s
            self.past = self._machine.settle(self.past, a_pa, b_pa)
        keep_pace(self.pace, monotonic(), self.past.clock_s - clock_s, Event())

    def move(self, to_m: float, speed_m_s: float) -> None:
        """Move from rest to rest without recording."""
        self._quietly(Move(to_m, speed_m_s))

    def hold(self, duration_s: float, released: bool = False) -> None:
        """Rest for a time without recording."""
        self._quietly(Hold(duration_s, released))

    def acquire(self, steps: Sequence[Step], sampling: Sampling | None = None) -> Iterator[Samples]:
        """Run the steps in their order, and yield the samples in parts as they arrive.

        Closing the iterator early brings the axis to rest. The default of `sampling` is that of the rig file.
        """
        self._idle()
        self._check(steps)
        return self._acquire(list(steps), sampling or self._d.sampling)

    def stop(self) -> None:
        """Bring the axis to rest and release the pressure; safe to call at any time, also twice."""
        with self._lock:
            self._halt(self._running)
            ambient = self._d.ambient_pressure_pa
            if (self.past.pressure_a_pa, self.past.pressure_b_pa) != (ambient, ambient):
                self.past = self._machine.settle(self.past, ambient, ambient)

    # --- its past ----------------------------------------------------------------------------

    def begin_cycle(self, key: str) -> None:
        """Seed the noise of the next cycle from the rig's seed and this key."""
        self.past = replace(self.past, key=key)
        self._rng = stream(self.seed, "noise", key)

    def memory(self) -> Plain:
        """Return the saved state as plain data."""
        return asdict(self.past)

    def restore(self, memory: Plain) -> None:
        """Restore a saved state from `memory`."""
        self._idle()
        self.past = Past.from_dict(memory)

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Return the factors that can be changed, with their possible levels.

        Seal and drive accept any name.
        """
        return {"mounting": tuple({RIGID: None, **self._d.tables.mounting})}

    def change(self, levels: dict[str, str]) -> None:
        """Set the levels of mounted factors. A new seal or drive starts without run-in."""
        self._idle()
        known = self.levels()
        for factor, level in levels.items():
            if factor in known and level not in known[factor]:
                raise RigError(f"{factor} = {level!r} is not known to this rig", remedy=nearest(level, known[factor]))
        past, anew = self.past, {"seal", "drive"} & levels.keys()
        changes = past.changes | {factor: past.changes.get(factor, 0) + 1 for factor in levels}
        unworn = {"travel_m": 0.0, "seal_rise_k": 0.0} if anew else {}
        self.past = replace(past, levels=past.levels | levels, changes=changes, **unworn)

    # --- how ---------------------------------------------------------------------------------

    def _idle(self) -> None:
        if self._running is not None:
            raise RigError("the axis is busy", remedy="Finish or close the running acquisition, or call stop().")

    def _check(self, steps: Sequence[Step]) -> None:
        """Check that the axis can carry out the steps, before anything moves."""
        limits = self.limits()
        low, high = limits.position_m
        for step in steps:
            if isinstance(step, Hold):
                if not 0.0 <= step.duration_s < np.inf:
                    raise RigError(f"a hold of {step.duration_s} s is not possible", rule="0 s <= duration")
            elif not (low - 1e-6 <= step.to_m <= high + 1e-6 and 0.0 < step.speed_m_s <= limits.speed_m_s):
                rule = f"{1e3 * low:g} to {1e3 * high:g} mm, up to {1e3 * limits.speed_m_s:g} mm/s"
                raise RigError.of("rig.out-of-reach", to=1e3 * step.to_m, speed=1e3 * step.speed_m_s, rule=rule)

    def _quietly(self, step: Step) -> None:
        """Run one step without samples and without random noise."""
        self._idle()
        self._check([step])
        if self._machine.motion(self.past, step) is not None:
            for _ in self._acquire([step], None):
                pass

    def _acquire(self, steps: list[Step], sampling: Sampling | None) -> Iterator[Samples]:
        """Run steps. Without `sampling`, the readings have no noise."""
        with self._lock:  # reserve the axis
            self._idle()
            self._running = run = _Run()
        rng = None if sampling is None else self._rng
        began, done_s = monotonic(), 0.0
        last = max((i for i, step in enumerate(steps) if getattr(step, "duration_s", 1.0) > 0.0), default=-1)
        try:
            for i, step in enumerate(steps):
                motion = self._machine.motion(self.past, step)
                if motion is None:
                    continue
                times = self._times(motion.duration_s, isinstance(step, Move), sampling)
                before, true = self._ahead(run, step, motion, times)
                if sampling is not None and self.observe is not None:
                    self.observe(self._machine, before, step, motion, true)
                seen = self._instruments.read(true, before, rng, getattr(step, "weight_n", 0.0))
                count = times.size if i == last else times.size - 1
                for part in in_parts(count, motion.duration_s, self.pace):
                    end = part.stop - 1
                    reached_s = float(times[end])
                    keep_pace(self.pace, began, done_s + reached_s, run.halted)
                    self._alive(run)
                    run.reached_s = reached_s
                    run.seen = {name: float(values[end]) for name, values in seen.items()}
                    named = {name: seen[name][part] for name in CHANNELS if name != "time_s"}
                    index = np.full(part.stop - part.start, i, dtype=np.int64)
                    yield Samples(time_s=done_s + times[part], **named, step=index)
                run.present, run.reached_s = None, 0.0
                done_s += motion.duration_s
        finally:
            with self._lock:
                self._halt(run)

    def _times(self, duration_s: float, moving: bool, sampling: Sampling | None) -> Array:
        """Return the sample times of a step, including its end. Without `sampling`, return times for a display."""
        interval_s = PART_S * (self.pace or np.inf)  # with a pace, a user watches
        shown = np.arange(1, int(duration_s / interval_s) + 1) * interval_s
        times = shown if sampling is None else step_times(duration_s, moving, sampling)
        return np.append(times, duration_s)

    def _ahead(self, run: _Run, step: Step, motion: Motion, times: Array) -> tuple[Past, Columns]:
        """Run a step. Return the history before the step, and the true signals.

        During the step, no lock is held, so that other threads can stop or display the axis.
        """
        with self._lock:
            self._alive(run)
            before = self.past
            run.present = before, step, motion
        after, true = self._machine.run(before, step, motion, times, lambda _: self._alive(run))
        with self._lock:
            self._alive(run)
            self.past = after
        return before, true

    def _alive(self, run: _Run) -> None:
        if run.halted.is_set():
            raise RigError("the axis was stopped", remedy="Repeat the cycle.")

    def _halt(self, run: _Run | None) -> None:
        """End an acquisition, and brake from the present motion of the axis."""
        if run is None or run.halted.is_set():
            return
        run.halted.set()
        self._running = None
        if run.present is not None:
            self.past = self._machine.cut(*run.present, run.reached_s)
