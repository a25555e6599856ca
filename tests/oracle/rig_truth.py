"""Ground truth of a cycle on a simulated rig.

- ``clock_s``, ``travel_m``, ``room_temperature_k``, ``seal_temperature_k``: at the end of the cycle
- ``levels``: mounted factor levels
- ``sensors``: errors of the force sensor: zero, gain (relative), hysteresis
- ``steps``: one entry for each step with a motion or a hold

A move has its ``speed_m_s`` and ``direction``. ``friction`` is the law with its present values. ``friction_n`` is the
mean steady friction along the move at that speed and the set pressures. A part at constant speed has means of
the true friction force (``friction_mean_n``) and of both pressures. It also has the mean force of the air on the piston
in +x (``air_force_n``). A hold has its duration, whether it was released, and the force of the sensor at its beginning
and end. If friction depends on the age of the contact, every step has the age at its beginning and at its end. A move
also has the increase of friction by this age at its start (``dwell_increment_n``), before presliding reduces it.
``friction_peak_n`` is the largest friction over the first `RESTART_M` of a move.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.rig.interface import Hold, Move
from pneudrive.rig.machine import steady_friction_n

if TYPE_CHECKING:
    from pneudrive.arrays import Array
    from pneudrive.rig.description import AnalogSensor, RigDescription
    from pneudrive.rig.interface import Step
    from pneudrive.rig.machine import Machine, Past
    from pneudrive.rig.motion import Motion
    from pneudrive.rig.simulated import RigSession

#: Distance from the beginning of a move in which its peak is searched, m.
RESTART_M = 5e-3
#: Share within which the commanded speed counts as reached.
AT_SPEED = 1e-3
#: Number of positions for the mean of friction along a move.
PLACES = 32


def truth_of_step(machine: Machine, before: Past, step: Step, motion: Motion, true: dict[str, Array]) -> dict[str, Any]:
    """Return the ground truth of one step.

    Parameters
    ----------
    machine : Machine
        Machine after the step.
    before : Past
        History before the step.
    step : Move or Hold
    motion : Motion
    true : dict
        Columns of the core at the samples.
    """
    out: dict[str, Any] = {"duration_s": motion.duration_s, "began_s": before.clock_s}
    force = true["sensor_force_n"]
    if isinstance(step, Hold):
        ends = {"force_begin_n": float(force[0]), "force_end_n": float(force[-1])}
        return out | {"released": step.released, "shut": step.shut, "weight_n": step.weight_n} | ends | _ages(true)
    ages = _ages(true)
    return out | _of_move(machine, before, step, motion, true, ages.get("age_begin_s", 0.0)) | ages


def _of_move(
    machine: Machine, before: Past, step: Move, motion: Motion, true: dict[str, Array], age_s: float
) -> dict[str, Any]:
    friction = machine.friction(before)
    direction = 1.0 if step.to_m > motion.start_m else -1.0
    steady = _steady_n(machine, before, friction, direction * step.speed_m_s, (motion.start_m, step.to_m))
    increment = _dwell_increment_n(machine, before, friction, age_s)
    begins = np.abs(true["position_m"] - true["position_m"][0]) <= RESTART_M
    out: dict[str, Any] = {
        "speed_m_s": step.speed_m_s,
        "direction": int(direction),
        "friction": friction,
        "friction_n": steady,
        "friction_peak_n": float(np.max(direction * true["friction_force_n"][begins])),
        "dwell_increment_n": increment,
    }
    commanded = motion.at(true["time_s"])[1]
    cruise = np.abs(commanded * direction - step.speed_m_s) < AT_SPEED * step.speed_m_s
    if np.count_nonzero(cruise) < 2:
        return out
    time = true["time_s"][cruise]

    def mean(values: Array) -> float:
        inside = values[cruise]
        return float(np.sum(0.5 * (inside[1:] + inside[:-1]) * np.diff(time)) / (time[-1] - time[0]))

    area_a, area_b = machine.d.areas_m2
    ambient = machine.d.ambient_pressure_pa
    air = (true["pressure_a_pa"] - ambient) * area_a - (true["pressure_b_pa"] - ambient) * area_b
    return out | {
        "friction_mean_n": direction * mean(true["friction_force_n"]),
        "air_force_n": mean(air),
        "pressure_a_pa": mean(true["pressure_a_pa"]),
        "pressure_b_pa": mean(true["pressure_b_pa"]),
    }


def _steady_n(machine: Machine, past: Past, friction: Any, velocity_m_s: float, way_m: tuple[float, float]) -> float:
    """Return the steady friction at a velocity and the set pressures, its mean along a move if it depends on x."""
    if friction.get("position") is None:
        return machine.steady_n(past, friction, velocity_m_s)
    d = machine.d
    gauges = (past.pressure_a_pa - d.ambient_pressure_pa, past.pressure_b_pa - d.ambient_pressure_pa)
    borders = np.linspace(*way_m, PLACES + 1)
    places = 0.5 * (borders[1:] + borders[:-1])
    return float(np.mean([abs(steady_friction_n(friction, velocity_m_s, gauges, x)[0]) for x in places]))


def _dwell_increment_n(machine: Machine, past: Past, friction: dict[str, Any], age_s: float) -> float:
    """Return the increase of friction by the age of the contact at the set pressures, N."""
    dwell = friction.get("dwell")
    if dwell is None or not age_s > 0.0:
        return 0.0
    speed = dwell["distance_m"] / age_s  # age of the contact in steady sliding at this speed
    return machine.steady_n(past, friction, speed) - machine.steady_n(past, {**friction, "dwell": None}, speed)


def _ages(true: dict[str, Array]) -> dict[str, float]:
    """Return the age of the contact at both ends, if friction depends on it."""
    age = true.get("contact_age_s")
    return {} if age is None else {"age_begin_s": float(age[0]), "age_end_s": float(age[-1])}


def truth_of_cycle(d: RigDescription, past: Past, force: AnalogSensor, steps: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the ground truth of a cycle from that of its steps."""
    room = float(past.room_k(d))
    return {
        "rig": d.name,
        "key": past.key,
        "clock_s": past.clock_s,
        "travel_m": past.travel_m,
        "room_temperature_k": room,
        "seal_temperature_k": room + past.seal_rise_k,
        "levels": dict(past.levels),
        "pressure_a_pa": past.pressure_a_pa,
        "pressure_b_pa": past.pressure_b_pa,
        "sensors": {
            "force_zero_n": force.zero + float(past.force_drift_n(d)),
            "force_gain_error": force.gain_error,
            "force_hysteresis_n": force.hysteresis,
        },
        "steps": steps,
    }


def telling(session: RigSession) -> RigSession:
    """Return a session with the method ``truth``: the ground truth of its last cycle."""
    steps: list[dict[str, Any]] = []
    acquire, ahead = session.acquire, session._ahead

    def anew(*request: Any) -> Any:
        steps.clear()
        return acquire(*request)

    def observed(run: Any, step: Step, motion: Motion, times: Array) -> Any:
        before, true = ahead(run, step, motion, times)
        if times.size > 1:  # otherwise a move without recording
            steps.append(truth_of_step(session._machine, before, step, motion, true))
        return before, true

    session.acquire, session._ahead = anew, observed
    d = session.rig.description
    session.truth = lambda: truth_of_cycle(d, session.past, session._instruments.force, list(steps))
    return session
