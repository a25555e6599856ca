"""Motion of a simulated rig in virtual time: one step after the other on the core, with its history."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.constants import STANDARD_GRAVITY_M_S2
from pneudrive.errors import RigError, SimulationError
from pneudrive.rig.conditions import Past, friction_in_force
from pneudrive.rig.core import core_rig, steady_friction_n
from pneudrive.rig.interface import Hold, Move, Step
from pneudrive.rig.motion import Motion, brake, dwell, move

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pneudrive.rig.description import RigDescription

    Array = NDArray[np.float64]

#: Tolerance of the core: errors of force far below the noise of any force sensor.
RTOL = 1e-6
#: Shortest move, m.
SHORTEST_M = 1e-9
#: Share of the set pressure within which chambers count as settled; longest time of settling, s.
SETTLED, LONGEST_S, LOOK_S = 1e-3, 60.0, 0.5
#: Number of positions for the mean of friction along a move.
PLACES = 32
#: Speed at which friction counts as breakaway, to check whether a released axis stays.
CREEP_M_S = 1e-9


class Machine:
    """Axis, drive and chambers with their history.

    Parameters
    ----------
    d : RigDescription
    seed : int
    """

    def __init__(self, d: RigDescription, seed: int) -> None:
        self.d, self.seed = d, seed
        ambient = d.ambient_pressure_pa
        self.past = Past(commanded_m=d.margin_m, pressure_a_pa=ambient, pressure_b_pa=ambient)

    def motion(self, step: Step) -> Motion | None:
        """Plan the motion of a step from the present position; None without a motion."""
        at = self.past.commanded_m
        if isinstance(step, Hold):
            return dwell(step.duration_s, at) if step.duration_s > 0.0 else None
        if abs(step.to_m - at) < SHORTEST_M:
            return None
        return move(step.to_m - at, step.speed_m_s, self.d.limits, at)

    def friction(self) -> dict[str, Any]:
        """Return the present friction in the core's form."""
        return friction_in_force(self.d, self.past, self.seed)

    def steady_n(
        self, friction: dict[str, Any], velocity_m_s: float, way_m: tuple[float, float] | None = None
    ) -> float:
        """Return the steady friction at a velocity and the set pressures, N, positive against the motion.

        For friction that depends on position: its mean along a move, or its value at the present position.
        """
        d, past = self.d, self.past
        gauges = (past.pressure_a_pa - d.ambient_pressure_pa, past.pressure_b_pa - d.ambient_pressure_pa)
        if way_m is None or friction.get("position") is None:
            return float(abs(steady_friction_n(friction, velocity_m_s, gauges, past.commanded_m)[0]))
        borders = np.linspace(*way_m, PLACES + 1)
        places = 0.5 * (borders[1:] + borders[:-1])
        return float(np.mean([abs(steady_friction_n(friction, velocity_m_s, gauges, x)[0]) for x in places]))

    def dwell_increment_n(self, friction: dict[str, Any], age_s: float) -> float:
        """Return the increase of friction by the age of the contact at the set pressures, N."""
        dwell = friction.get("dwell")
        if dwell is None or not age_s > 0.0:
            return 0.0
        # age of the contact in steady sliding at this speed
        speed = dwell["distance_m"] / age_s
        return self.steady_n(friction, speed) - self.steady_n({**friction, "dwell": None}, speed)

    def run(
        self, step: Step, motion: Motion, times: Array, look: Callable[[], object] | None = None
    ) -> dict[str, Array]:
        """Run one step and update `past`. `look` is called regularly. An exception in `look` ends the step.

        Raises
        ------
        RigError
            The axis is to be released, but the pressures would move it away.
        SimulationError
            The core cannot continue.
        """
        friction = self.friction()
        hold = step if isinstance(step, Hold) else Hold(0.0)
        if hold.released:
            self._stays(friction)
        columns = self._core(friction, motion, times, released=hold.released, shut=hold.shut, look=look)
        power = 0.0
        if isinstance(step, Move):
            way = abs(self.past.commanded_m - motion.start_m)
            self.past.travel_m += way
            power = (
                self.steady_n(friction, float(np.copysign(step.speed_m_s, step.to_m - motion.start_m)))
                * way
                / motion.duration_s
            )
        self.past.pass_time(self.d, motion.duration_s, power)
        return columns

    def cut(self, before: Past, step: Step, motion: Motion, time_s: float) -> None:
        """Return to the beginning of a step, run it up to `time_s`, and brake."""
        self.past = before
        begun = motion.until(time_s)
        position, speed, acceleration = (float(value) for value in motion.at(time_s))
        stopping = brake(position, speed, acceleration, self.d.limits)
        rest = Motion(
            np.r_[begun.durations_s, stopping.durations_s], np.r_[begun.jerks_m_s3, stopping.jerks_m_s3], motion.start_m
        )
        if rest.durations_s.size:
            self.run(step, rest, np.array([rest.duration_s]))

    def settle(self, a_pa: float, b_pa: float) -> None:
        """Set the pressures, and wait at rest until the chambers have settled.

        Raises
        ------
        RigError
            The chambers do not reach the pressures.
        """
        past, columns = self.past, {}
        if past.state is None:  # start state, at the old pressures
            self.run(Hold(LOOK_S), dwell(LOOK_S, past.commanded_m), np.array([LOOK_S]))
        past.pressure_a_pa, past.pressure_b_pa = a_pa, b_pa
        for _ in range(round(LONGEST_S / LOOK_S)):
            step = Hold(LOOK_S)
            columns = self.run(step, dwell(LOOK_S, past.commanded_m), np.array([LOOK_S]))
            reached = [columns[f"pressure_{side}_pa"][-1] / p for side, p in (("a", a_pa), ("b", b_pa))]
            if all(abs(share - 1.0) < SETTLED for share in reached):
                return
        raise RigError(
            f"the chambers do not reach {a_pa:g} and {b_pa:g} Pa within {LONGEST_S:g} s",
            value=f"{columns['pressure_a_pa'][-1]:g} and {columns['pressure_b_pa'][-1]:g} Pa",
            remedy="Check for a leak, and the conductance of the regulator.",
        )

    def _stays(self, friction: dict[str, Any]) -> None:
        """Check that pressure and weight would not move a released piston away."""
        d, past = self.d, self.past
        area_a, area_b = d.areas_m2
        ambient = d.ambient_pressure_pa
        push = (past.pressure_a_pa - ambient) * area_a - (past.pressure_b_pa - ambient) * area_b
        push -= d.moving_mass_kg * STANDARD_GRAVITY_M_S2 * np.sin(d.incline_rad)
        holds = self.steady_n(friction, CREEP_M_S)
        if abs(push) > holds:
            raise RigError(
                "the pressure would move a released axis away",
                value=f"force {push:.3g} N, friction {holds:.3g} N",
                remedy="Release only with equal pressures, or hold the axis.",
            )

    def _core(
        self,
        friction: dict[str, Any],
        motion: Motion,
        times: Array,
        *,
        released: bool,
        shut: bool,
        look: Callable[[], object] | None,
    ) -> dict[str, Array]:
        d, past = self.d, self.past
        room = float(past.room_k(d))
        pressures = (past.pressure_a_pa, past.pressure_b_pa)
        begin = past.commanded_m if past.state is None else past.state
        on_look = None if look is None else lambda _: look()
        try:
            rig = core_rig(d, pressures, friction, room)
            plan = (motion.durations_s, motion.jerks_m_s3, times)
            result = rig.run(*plan, begin, RTOL, released=released, shut=shut, look=on_look)
        except (ValueError, RuntimeError) as error:
            raise SimulationError("the simulated rig cannot run", value=str(error)) from error
        columns, _, past.state, past.commanded_m = result
        past.shown = {name: float(column[-1]) for name, column in columns.items()} if times.size else past.shown
        return columns

    def copy(self) -> Machine:
        """Return a machine with a copy of the history."""
        other = Machine(self.d, self.seed)
        other.past = self.snapshot()
        return other

    def snapshot(self) -> Past:
        """Return a copy of the history."""
        return deepcopy(self.past)
