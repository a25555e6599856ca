"""Session of a simulated rig for a campaign: in virtual time, with a history that can be saved and restored."""

from __future__ import annotations

import time
from dataclasses import dataclass
from threading import Event, RLock
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from pneudrive.errors import RigError, nearest
from pneudrive.rig.conditions import Past, stream
from pneudrive.rig.instruments import ERROR_MODEL, FORCE_ERROR_MODEL, Instruments
from pneudrive.rig.interface import CHANNELS, Envelope, Hold, Identity, Move, RigState, Samples, Step
from pneudrive.rig.machine import CREEP_M_S, Machine
from pneudrive.rig.sampling import step_times
from pneudrive.rig.truth import truth_of_cycle, truth_of_step

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from pneudrive.rig.description import RigDescription
    from pneudrive.rig.interface import Sampling
    from pneudrive.rig.motion import Motion

    Array = NDArray[np.float64]

#: Speed of moves without a chosen speed: going home.
HOME_SPEED_M_S = 0.05
#: Size of the parts of samples from `acquire`: in real time, s; otherwise number of samples.
PART_S, PART_SAMPLES = 0.1, 2000
#: Default range of room temperature for measuring, K about that of the rig file (assumed).
USUAL_TEMPERATURES_K = (-10.0, 15.0)


@dataclass
class _Run:
    """Running motion of the axis, for threads that end or display it.

    ``before`` is the history at the start of the present step, ``reached_s`` the time reached in it, and ``seen`` the
    last readings of the sensors.
    """

    alive: bool = True
    before: Past | None = None
    step: Step | None = None
    motion: Motion | None = None
    reached_s: float = 0.0
    seen: dict[str, float] | None = None


class Simulated(Protocol):
    """Protocol of `pneudrive.rig.simulated.SimulatedRig` for a session."""

    @property
    def description(self) -> RigDescription:
        """Description from the rig file."""
        ...

    def true_friction(self, speed_m_s: Array, pressure_a_pa: float, pressure_b_pa: float) -> Array:
        """Return the friction of steady sliding."""
        ...


class RigSession:
    """Session of a simulated rig: `Rig`, `Reproducible` and `Changeable`.

    Noise depends only on the seed and the key of the cycle. Drifting quantities depend on the history, which `memory`
    returns. The saved values are clock, distance and temperature of the seal, room temperature, zero of the force
    sensor, age of the contact, and pressures. Another thread may stop the rig.

    Parameters
    ----------
    rig : pneudrive.rig.SimulatedRig
    seed : int
        Seed of noise, calibration errors, and scatter between cycles, days, mountings and seals.
    pace : float, optional
        Speed relative to real time; None: as fast as possible.
    """

    def __init__(self, rig: Simulated, seed: int = 0, pace: float | None = None) -> None:
        if pace is not None and not pace > 0.0:
            raise RigError(f"pace = {pace} is not positive", rule="pace is the speed of the rig relative to real time")
        self.rig, self.seed, self.pace = rig, seed, pace
        self._machine = Machine(rig.description, seed)
        self._instruments = Instruments(rig.description, seed)
        self._rng = stream(seed, "noise", "")
        self._running: _Run | None = None
        self._truth: dict[str, Any] = {}
        self._lock, self._halted = RLock(), Event()

    @property
    def past(self) -> Past:
        """History of the rig."""
        return self._machine.past

    # --- what it is --------------------------------------------------------------------------

    def identity(self) -> Identity:
        """Return the identity of the rig."""
        d, sensors = self.rig.description, self._instruments
        channels = {
            "force_n": (sensors.force, d.force_accuracy_n),
            "pressure_a_pa": (sensors.pressure_a, d.pressure_accuracy_pa),
            "pressure_b_pa": (sensors.pressure_b, d.pressure_accuracy_pa),
            "temperature_k": (sensors.thermometer, d.temperature_accuracy_k),
        }
        area_a, area_b = d.areas_m2
        return Identity(
            name=d.name,
            area_a_m2=area_a,
            area_b_m2=area_b,
            ambient_pressure_pa=d.ambient_pressure_pa,
            mass_beyond_sensor_kg=d.moving_mass_kg,
            incline_rad=d.incline_rad,
            stiffness_n_m=d.stiffness_n_m,
            accuracy={name: accuracy for name, (_, accuracy) in channels.items()}
            | {"position_m": d.encoder.resolution_m / 12.0**0.5},
            limits={name: (sensor.low, sensor.high) for name, (sensor, _) in channels.items()},
            resolution={name: sensor.step for name, (sensor, _) in channels.items()}
            | {"position_m": d.encoder.resolution_m},
            calibration=dict.fromkeys(channels, ERROR_MODEL) | {"force_n": FORCE_ERROR_MODEL},
            labels={"rig": d.name},
            chambers=d.chambers["kind"],
            pressure_measured_at=d.pressure_measured_at,
            synthetic=True,
        )

    def limits(self) -> Envelope:
        """Return the limits of the rig."""
        d = self.rig.description
        ambient, safety, kind = d.ambient_pressure_pa, d.safety, d.chambers["kind"]
        highest = ambient if kind == "open" else min(
            safety["pressure"] or d.pressure_sensor.high, d.supply_pressure_pa or np.inf
        )  # fmt: skip
        speed = d.servo["speed"] or d.limits.top_speed_m_s(d.stroke_m - 2.0 * d.margin_m)
        room = d.ambient_temperature_k
        least, greatest = (
            safety[f"{which}_temperature"] or room + usual
            for which, usual in zip(("least", "greatest"), USUAL_TEMPERATURES_K, strict=True)
        )
        friction = self.rig.true_friction(np.array([CREEP_M_S, speed]), highest, highest)
        return Envelope(
            position_m=(d.margin_m, d.stroke_m - d.margin_m),
            speed_m_s=speed,
            acceleration_m_s2=d.limits.acceleration_m_s2,
            jerk_m_s3=d.limits.jerk_m_s3,
            force_n=safety["force"] or d.force_sensor.high,
            pressure_pa=(ambient, highest),
            separate_pressures=kind in ("held", "separate"),
            temperature_k=(least, greatest),
            supply_pressure_pa=safety["least_supply"] or 0.0,
            expected_friction_n=float(np.max(friction)),
            home_m=d.margin_m,
        )

    def state(self) -> RigState:
        """Return the state of the rig, with readings without noise."""
        with self._lock:
            past, run = self.past, self._running
            supply = self.rig.description.supply_pressure_pa or max(past.pressure_a_pa, past.pressure_b_pa)
            began = past if run is None or run.before is None else run.before
            clock = began.clock_s + (0.0 if run is None else run.reached_s)
            seen = self._at_rest(began) if run is None or run.seen is None else run.seen
            return RigState(
                position_m=seen["position_m"],
                force_n=seen["force_n"],
                pressure_a_pa=seen["pressure_a_pa"],
                pressure_b_pa=seen["pressure_b_pa"],
                supply_pressure_pa=supply,
                temperature_k=seen["temperature_k"],
                time_s=clock,
                moving=run is not None,
            )

    def _at_rest(self, past: Past) -> dict[str, float]:
        true = {"carriage_position_m": past.commanded_m, "sensor_force_n": 0.0}
        for side, pressure in (("a", past.pressure_a_pa), ("b", past.pressure_b_pa)):
            true |= {f"pressure_{side}_pa": pressure, f"supply_pressure_{side}_pa": pressure}
        columns = {name: np.array([value]) for name, value in {**true, **past.shown, "time_s": 0.0}.items()}
        return {name: float(values[0]) for name, values in self._instruments.read(columns, past, None).items()}

    # --- what it does ------------------------------------------------------------------------

    def home(self) -> None:
        """Bring the axis to its home position."""
        self.move(self.limits().home_m, HOME_SPEED_M_S)

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        """Bring the chambers to these absolute pressures, Pa; ambient pressure vents a chamber."""
        limits = self.limits()
        low, high = limits.pressure_pa
        for name, value in (("a", a_pa), ("b", b_pa)):
            if not low * (1.0 - 1e-9) <= value <= high * (1.0 + 1e-9):
                raise RigError(
                    f"chamber {name} cannot be brought to {value:g} Pa", rule=f"{low:g} to {high:g} Pa absolute"
                )
        if a_pa != b_pa and not limits.separate_pressures:
            raise RigError(
                f"the chambers cannot have {a_pa:g} and {b_pa:g} Pa",
                rule="one regulator sets the pressure of both chambers",
            )
        self._idle()
        with self._lock:
            began = self.past.clock_s
            self._machine.settle(a_pa, b_pa)
            duration = self.past.clock_s - began
        self._wait(time.monotonic(), duration)

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
        return self._acquire(list(steps), sampling or self.rig.description.sampling)

    def stop(self) -> None:
        """Bring the axis to rest and release the pressure; safe to call at any time, also twice."""
        with self._lock:
            self._halt(self._running)
            ambient = self.rig.description.ambient_pressure_pa
            if (self.past.pressure_a_pa, self.past.pressure_b_pa) != (ambient, ambient):
                self._machine.settle(ambient, ambient)

    # --- its past ----------------------------------------------------------------------------

    def begin_cycle(self, key: str) -> None:
        """Seed the noise of the next cycle from the rig's seed and this key."""
        self.past.key = key
        self._rng = stream(self.seed, "noise", key)
        self._truth = {}

    def memory(self) -> dict[str, Any]:
        """Return the saved state as plain data."""
        return self._machine.snapshot().to_dict()

    def restore(self, memory: dict[str, Any]) -> None:
        """Restore a saved state from `memory`."""
        self._idle()
        self._machine.past = Past.from_dict(memory)

    def truth(self) -> dict[str, Any]:
        """Return the ground truth of the last cycle as plain data; see `pneudrive.rig.truth`."""
        return self._truth

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Return the factors that can be changed, with their possible levels.

        For seal and drive any name is possible.
        """
        return {"mounting": tuple(self.rig.description.mountings)}

    def change(self, levels: dict[str, str]) -> None:
        """Set mounted factor levels; a new seal or drive starts without run-in."""
        self._idle()
        past = self.past
        known = self.levels()
        for factor, level in levels.items():
            if factor in known and level not in known[factor]:
                raise RigError(f"{factor} = {level!r} is not known to this rig", remedy=nearest(level, known[factor]))
        for factor, level in levels.items():
            past.levels[factor] = level
            past.changes[factor] = past.changes.get(factor, 0) + 1
            if factor in ("seal", "drive"):
                past.travel_m = past.seal_rise_k = 0.0

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
                raise RigError(
                    f"a move to {1e3 * step.to_m:g} mm at {1e3 * step.speed_m_s:g} mm/s is out of reach",
                    rule=f"{1e3 * low:g} to {1e3 * high:g} mm, up to {1e3 * limits.speed_m_s:g} mm/s",
                )

    def _quietly(self, step: Step) -> None:
        """Run one step without samples and without drawing noise."""
        self._idle()
        self._check([step])
        motion = self._machine.motion(step)
        if motion is None:
            return
        run = self._begin()
        began, end = time.monotonic(), motion.duration_s
        # With a pace, a user watches: the motion of the axis is shown.
        part = PART_S * (self.pace or 1.0)
        times = np.array([end]) if self.pace is None else np.append(np.arange(1, int(end / part) + 1) * part, end)
        try:
            _, true = self._ahead(run, step, motion, times)
            assert run.before is not None
            seen = self._instruments.read(true, run.before, None)
            for i, until in enumerate(times):
                self._wait(began, float(until))
                self._alive(run)
                run.reached_s, run.seen = float(until), {name: float(values[i]) for name, values in seen.items()}
            run.motion = None
        finally:
            with self._lock:
                self._halt(run)

    def _begin(self) -> _Run:
        """Reserve the axis."""
        with self._lock:
            self._idle()
            self._running = run = _Run()
            self._halted.clear()
            return run

    def _acquire(self, steps: list[Step], sampling: Sampling) -> Iterator[Samples]:
        run = self._begin()
        began, done_s = time.monotonic(), 0.0
        kept: list[dict[str, Any]] = []
        last = max((i for i, step in enumerate(steps) if getattr(step, "duration_s", 1.0) > 0.0), default=-1)
        try:
            for i, step in enumerate(steps):
                motion = self._machine.motion(step)
                if motion is None:
                    continue
                times = step_times(motion.duration_s, isinstance(step, Move), sampling)
                times = np.append(times, motion.duration_s)  # the last sample of a step shows its end
                machine, true = self._ahead(run, step, motion, times)
                before = run.before
                assert before is not None
                kept.append(truth_of_step(machine, before, step, motion, true))
                seen = self._instruments.read(true, before, self._rng, getattr(step, "weight_n", 0.0))
                keep = times.size if i == last else times.size - 1
                for part in self._parts(times[:keep], motion.duration_s):
                    self._wait(began, done_s + float(times[part.stop - 1]))
                    self._alive(run)
                    run.reached_s = float(times[part.stop - 1])
                    run.seen = {name: float(values[part.stop - 1]) for name, values in seen.items()}
                    named = {name: seen[name][part] for name in CHANNELS if name != "time_s"}
                    index = np.full(part.stop - part.start, i, dtype=np.int64)
                    yield Samples(time_s=done_s + times[part], **named, step=index)
                run.motion = None
                done_s += motion.duration_s
            self._truth = truth_of_cycle(self._machine, self._instruments, kept)
        finally:
            with self._lock:
                self._halt(run)

    def _ahead(self, run: _Run, step: Step, motion: Motion, times: Array) -> tuple[Machine, dict[str, Array]]:
        """Run a step on a copy of the machine, and use the copy at the end unless the axis was stopped.

        Threads that stop or display the axis do not wait for this lock.
        """
        with self._lock:
            self._alive(run)
            run.before, run.step, run.motion, run.reached_s = self._machine.snapshot(), step, motion, 0.0
            machine = self._machine.copy()
        true = machine.run(step, motion, times, lambda: self._alive(run))
        with self._lock:
            self._alive(run)
            self._machine = machine
        return machine, true

    def _parts(self, times: Array, duration_s: float) -> Iterator[slice]:
        """Cut the samples of a step into parts: by time with a pace, otherwise by number."""
        if self.pace is None:
            borders = list(range(0, times.size, PART_SAMPLES))
        else:
            ends = np.arange(0.0, duration_s, PART_S * self.pace)
            borders = sorted(set(np.searchsorted(times, ends).tolist()))
        for start, stop in zip(borders, [*borders[1:], times.size], strict=True):
            if stop > start:
                yield slice(start, stop)

    def _alive(self, run: _Run) -> None:
        if not run.alive:
            raise RigError("the axis was stopped", remedy="Repeat the cycle.")

    def _halt(self, run: _Run | None) -> None:
        """End an acquisition: brake from the present motion of the axis."""
        if run is None or not run.alive:
            return
        run.alive = False
        self._halted.set()
        if self._running is run:
            self._running = None
        if run.motion is not None and run.before is not None and run.step is not None:
            self._machine.cut(run.before, run.step, run.motion, run.reached_s)

    def _wait(self, began: float, until_s: float) -> None:
        """Wait for a time of the rig at its pace, or until the rig is stopped."""
        if self.pace is not None:
            self._halted.wait(max(0.0, began + until_s / self.pace - time.monotonic()))
