"""A simulated rig as a campaign drives it: stateful, in virtual time, with a past that can be kept and taken back."""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RigError, SimulationError
from pneudrive.rig.interface import Envelope, Hold, Identity, Move, RigState, Samples, Sampling, Step
from pneudrive.rig.motion import Motion, dwell, move
from pneudrive.rig.sampling import schedule

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pneudrive.rig.simulated import SimulatedRig

#: Tolerance of the core: errors of force far below the noise of any force sensor.
RTOL = 1e-6
#: Speed of moves that nobody chose: going home.
HOME_SPEED_M_S = 0.05
#: How long the chambers take to follow a new set pressure, s (assumed).
SETTLING_S = 2.0
#: Samples per part in which `acquire` yields them, s of the rig's time.
PART_S = 0.2


@dataclass
class _Past:
    """All that earlier cycles have left behind; plain data."""

    clock_s: float = 0.0
    travel_m: float = 0.0
    position_m: float = 0.0
    pressure_a_pa: float = 0.0
    pressure_b_pa: float = 0.0


class RigSession:
    """A simulated rig in use: the verbs of `Rig` and `Reproducible`.

    Parameters
    ----------
    rig : SimulatedRig
    seed : int
        Of all that is random.
    pace : float, optional
        Seconds of the rig per second on the wall; None: as fast as it goes.
    """

    def __init__(self, rig: SimulatedRig, seed: int = 0, pace: float | None = None) -> None:
        if pace is not None and not pace > 0.0:
            raise RigError(f"pace = {pace} is not positive", rule="seconds of the rig per second on the wall")
        self.rig, self.seed, self.pace = rig, seed, pace
        d = rig.description
        ambient = d.ambient_pressure_pa
        self._past = _Past(position_m=d.margin_m, pressure_a_pa=ambient, pressure_b_pa=ambient)
        self._key = ""
        self._rng = self._stream("")
        self._running: list[bool] | None = None
        self._truth: dict[str, Any] = {}

    def identity(self) -> Identity:
        """Tell which rig this is."""
        d = self.rig.description
        force, air = d.force_sensor, d.pressure_sensor
        channels = {"force_n": force, "pressure_a_pa": air, "pressure_b_pa": air}
        return Identity(
            name=d.name,
            area_a_m2=d.area_m2,
            area_b_m2=d.area_m2,
            ambient_pressure_pa=d.ambient_pressure_pa,
            mass_beyond_sensor_kg=d.moving_mass_kg,
            incline_rad=d.incline_rad,
            stiffness_n_m=d.stiffness_n_m,
            accuracy={
                "position_m": d.encoder.resolution_m / 12.0**0.5,
                "force_n": d.force_accuracy_n,
                "pressure_a_pa": d.pressure_accuracy_pa,
                "pressure_b_pa": d.pressure_accuracy_pa,
            },
            limits={name: (sensor.low, sensor.high) for name, sensor in channels.items()},
            resolution={name: sensor.step for name, sensor in channels.items()}
            | {"position_m": d.encoder.resolution_m},
            calibration=dict.fromkeys(channels, "assumed"),
            labels={"rig": d.name},
            synthetic=True,
        )

    def limits(self) -> Envelope:
        """Tell what it may be asked to do."""
        d = self.rig.description
        return Envelope(
            position_m=(d.margin_m, d.stroke_m - d.margin_m),
            speed_m_s=d.limits.top_speed_m_s(d.stroke_m - 2.0 * d.margin_m),
            acceleration_m_s2=d.limits.acceleration_m_s2,
            jerk_m_s3=d.limits.jerk_m_s3,
            force_n=d.force_sensor.high,
            pressure_pa=(d.ambient_pressure_pa, d.pressure_sensor.high),
            separate_pressures=True,
            temperature_k=(288.15, 303.15),
            expected_friction_n=float(self.rig.true_friction(1e-6)),
            home_m=d.margin_m,
        )

    def state(self) -> RigState:
        """Tell where it stands."""
        p = self._past
        return RigState(
            position_m=p.position_m,
            force_n=0.0,
            pressure_a_pa=p.pressure_a_pa,
            pressure_b_pa=p.pressure_b_pa,
            supply_pressure_pa=7e5,
            temperature_k=293.15,
            time_s=p.clock_s,
            moving=self._running is not None,
        )

    def home(self) -> None:
        """Bring the axis to its home position."""
        self.move(self.limits().home_m, HOME_SPEED_M_S)

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        """Bring the chambers to these absolute pressures, Pa; ambient pressure vents a chamber."""
        low, high = self.limits().pressure_pa
        for name, value in (("a", a_pa), ("b", b_pa)):
            if not low * (1.0 - 1e-9) <= value <= high:
                raise RigError(
                    f"chamber {name} cannot be brought to {value:g} Pa", rule=f"{low:g} to {high:g} Pa absolute"
                )
        self._idle()
        self._past.pressure_a_pa, self._past.pressure_b_pa = a_pa, b_pa
        self.hold(SETTLING_S)

    def move(self, to_m: float, speed_m_s: float) -> None:
        """Move from rest to rest without recording."""
        self._quietly(Move(to_m, speed_m_s))

    def hold(self, duration_s: float, released: bool = False) -> None:
        """Stand still without recording."""
        self._quietly(Hold(duration_s, released))

    def _quietly(self, step: Step) -> None:
        for _ in self.acquire([step], Sampling(2, 0.0, hold_rate_hz=2.0 / max(getattr(step, "duration_s", 1.0), 1e-3))):
            pass

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        """Run the steps one after the other and yield the samples in parts, as they come."""
        self._idle()
        motions = self._motions(steps)
        times, step = schedule(
            [m.duration_s if m else 0.0 for m in motions], [isinstance(s, Move) for s in steps], sampling
        )
        return self._run(motions, times, step)

    def _run(self, motions: list[Motion | None], times: Any, step: Any) -> Iterator[Samples]:  # noqa: ANN401
        running = self._running = [True]
        whole = [m for m in motions if m is not None]
        try:
            if not whole:
                return
            motion = whole[0]
            for other in whole[1:]:
                motion = motion.then(other)
            samples = self._measure(motion, times, step)
            began = time.monotonic()
            for part in np.array_split(np.arange(times.size), max(1, round(motion.duration_s / PART_S))):
                if not part.size:
                    continue
                if not running[0]:
                    raise RigError("the axis was stopped")
                self._wait(began, float(times[part[-1]]))
                self._past.position_m = float(motion.at(times[part[-1]])[0])
                yield Samples(**{name: getattr(samples, name)[part] for name in vars(samples)})
            self._past.clock_s += motion.duration_s
            self._past.travel_m += float(np.sum(np.abs(np.diff(motion.knots()[1]))))
        finally:
            if self._running is running:
                self._running = None

    def _measure(self, motion: Motion, times: Any, step: Any) -> Samples:  # noqa: ANN401
        from pneudrive import _core

        d, p, rng = self.rig.description, self._past, self._rng
        try:
            core = _core.Rig(json.dumps(self.rig._core_description(p.pressure_a_pa, p.pressure_b_pa)))
            true = core.run(motion.durations_s, motion.jerks_m_s3, times, motion.start_m, RTOL)["columns"]
        except (ValueError, RuntimeError) as error:
            raise SimulationError("the simulated rig cannot run", value=str(error)) from error
        one = np.ones_like(times)
        return Samples(
            time_s=times,
            position_m=d.encoder.read(true["carriage_position_m"]),
            force_n=d.force_sensor.read(true["sensor_force_n"], rng),
            pressure_a_pa=d.pressure_sensor.read(p.pressure_a_pa * one, rng),
            pressure_b_pa=d.pressure_sensor.read(p.pressure_b_pa * one, rng),
            temperature_k=293.15 * one,
            step=step,
        )

    def _motions(self, steps: Sequence[Step]) -> list[Motion | None]:
        limits, at, out = self.limits(), self._past.position_m, []
        for step in steps:
            if isinstance(step, Hold):
                out.append(dwell(step.duration_s, at) if step.duration_s > 0.0 else None)
                continue
            low, high = limits.position_m
            if not low - 1e-9 <= step.to_m <= high + 1e-9 or not 0.0 < step.speed_m_s <= limits.speed_m_s:
                raise RigError(
                    f"a move to {step.to_m:g} m at {step.speed_m_s:g} m/s is out of reach",
                    rule=f"{low:g} to {high:g} m, up to {limits.speed_m_s:g} m/s",
                )
            still = abs(step.to_m - at) < 1e-12
            out.append(None if still else move(step.to_m - at, step.speed_m_s, self.rig.description.limits, at))
            at = step.to_m
        return out

    def stop(self) -> None:
        """Bring the axis to rest and release the pressure; safe to call at any time, also twice."""
        if self._running is not None:
            self._running[0] = False
            self._running = None
        ambient = self.rig.description.ambient_pressure_pa
        self._past.pressure_a_pa = self._past.pressure_b_pa = ambient

    def begin_cycle(self, key: str) -> None:
        """Let the noise of the next cycle depend on the rig's seed and this key alone."""
        self._key, self._rng = key, self._stream(key)

    def memory(self) -> dict[str, Any]:
        """Give all that the past has left behind, as plain data."""
        return dict(vars(self._past))

    def restore(self, memory: dict[str, Any]) -> None:
        """Take a past back that `memory` gave."""
        try:
            self._past = _Past(**memory)
        except TypeError as error:
            raise RigError("this is not the memory of a simulated rig", value=str(error)) from None

    def truth(self) -> dict[str, Any]:
        """Give what was true of the last cycle, as plain data."""
        d, p = self.rig.description, self._past
        return {
            "law": d.law,
            "parameters": dict(d.parameters),
            "pressure_a_pa": p.pressure_a_pa,
            "pressure_b_pa": p.pressure_b_pa,
        }

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Give the factors that can be changed and the levels that each can take."""
        return {"mounting": ("rigid",)}

    def change(self, levels: dict[str, str]) -> None:
        """Take what has been mounted."""

    def _idle(self) -> None:
        if self._running is not None:
            raise RigError("the axis is busy", remedy="finish or close the running acquisition, or stop()")

    def _wait(self, began: float, until: float) -> None:
        if self.pace is not None:
            time.sleep(max(0.0, began + until / self.pace - time.monotonic()))

    def _stream(self, *words: str) -> np.random.Generator:
        digest = hashlib.sha256("\0".join(words).encode()).digest()
        return np.random.default_rng([self.seed, int.from_bytes(digest[:8], "little")])


def load_session(source: str, seed: int, pace: float | None) -> RigSession:
    """Make the session of a rig file; see `pneudrive.rig.load_rig`."""
    from pneudrive.rig.simulated import SimulatedRig

    return SimulatedRig.load(source).session(seed, pace)
