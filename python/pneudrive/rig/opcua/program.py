"""Data exchanged through the nodes of a map: state, samples, steps and sampling.

Requests of a client are limited, so that no client can occupy a rig forever.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive.errors import RigError
from pneudrive.rig.interface import Hold, Move, Sampling, Step
from pneudrive.rig.opcua.nodes import HOLD, RELEASED, SHUT, Verb

if TYPE_CHECKING:
    from collections.abc import Sequence

LONGEST_STEP_S = 86400.0
MOST_SAMPLES = 10_000_000  # largest number of samples of an acquisition
#: Nodes and their fields in `RigState`, `Samples` and `Sampling`.
STATE = {
    "state.position": "position_m",
    "state.force": "force_n",
    "state.pressure_a": "pressure_a_pa",
    "state.pressure_b": "pressure_b_pa",
    "state.supply_pressure": "supply_pressure_pa",
    "state.temperature": "temperature_k",
    "state.time": "time_s",
    "state.moving": "moving",
}
SAMPLES = {
    "samples.time": "time_s",
    "samples.position": "position_m",
    "samples.force": "force_n",
    "samples.pressure_a": "pressure_a_pa",
    "samples.pressure_b": "pressure_b_pa",
    "samples.temperature": "temperature_k",
    "samples.step": "step",
}
SAMPLING = {
    "sampling.samples_per_stroke": "samples_per_stroke",
    "sampling.burst_rate": "burst_rate_hz",
    "sampling.burst_before": "burst_before_s",
    "sampling.burst_after": "burst_after_s",
    "sampling.hold_rate": "hold_rate_hz",
}


def steps_as_arrays(steps: Sequence[Step]) -> dict[str, Any]:
    """Write steps as the arrays of a command; `program_of` reads them."""
    moves = [step if isinstance(step, Move) else None for step in steps]
    return {
        "step.count": len(steps),
        "step.kind": [_kind(step) for step in steps],
        "step.position": [move.to_m if move else 0.0 for move in moves],
        "step.speed": [move.speed_m_s if move else 0.0 for move in moves],
        "step.duration": [step.duration_s if isinstance(step, Hold) else 0.0 for step in steps],
        "step.weight": [step.weight_n if isinstance(step, Hold) else 0.0 for step in steps],
    }


def _kind(step: Step) -> int:
    return (HOLD | RELEASED * step.released | SHUT * step.shut) if isinstance(step, Hold) else 0


def program_of(arguments: dict[str, Any], longest_m: float) -> list[Step]:
    """Read the steps from the arrays of a command.

    Parameters
    ----------
    arguments : dict
        Name of a node -> value in SI.
    longest_m : float
        Longest distance of a move.

    Raises
    ------
    RigError
        The number of steps is not valid, or a step takes longer than a day.
    """
    count = arguments["step.count"]
    weights = arguments.get("step.weight") or [0.0] * count
    names = ("step.kind", "step.position", "step.speed", "step.duration")
    rows = list(zip(*(arguments[name] for name in names), weights, strict=False))
    if not 0 <= count <= len(rows):
        raise RigError(f"a program of {count} steps is out of bounds", rule=f"0 to {len(rows)} steps")
    return [_step(row, longest_m) for row in rows[:count]]


def _step(row: tuple[int, float, float, float, float], longest_m: float) -> Step:
    kind, position, speed, duration, weight = row
    if kind & HOLD:
        if not 0.0 <= duration <= LONGEST_STEP_S:
            raise RigError(f"a hold of {duration:g} s is out of bounds", rule=f"0 to {LONGEST_STEP_S:g} s")
        return Hold(duration, bool(kind & RELEASED), bool(kind & SHUT), weight)
    least = longest_m / LONGEST_STEP_S
    if speed < least:
        raise RigError(
            f"a move at {1e3 * speed:g} mm/s is too slow",
            rule=f"at least {1e3 * least:.3g} mm/s, so that the travel takes at most a day",
        )
    return Move(position, speed)


def first_step(arguments: dict[str, Any], kind: type[Step], longest_m: float) -> Any:  # noqa: ANN401 - an instance of `kind`
    """Read the first step, which must be of this kind, a move or a hold.

    Raises
    ------
    RigError
        The value is not of this kind.
    """
    (step,) = program_of({**arguments, "step.count": 1}, longest_m)
    if not isinstance(step, kind):
        raise RigError(f"the first step is not a {kind.__name__.lower()}", rule="step.kind: 0 move, 1 hold")
    return step


def sampling_of(arguments: dict[str, Any]) -> Sampling:
    """Read the sampling of an acquisition; missing nodes have defaults."""
    said = {field: arguments[name] for name, field in SAMPLING.items() if name in arguments}
    return Sampling(**said)


def check_size(steps: list[Step], sampling: Sampling) -> None:
    """Raise an error for an acquisition of too many samples.

    Raises
    ------
    RigError
    """
    bursts = sampling.burst_rate_hz * (max(sampling.burst_before_s, 0.0) + max(sampling.burst_after_s, 0.0))
    asked = sum(
        bursts + (sampling.samples_per_stroke if isinstance(step, Move) else sampling.hold_rate_hz * step.duration_s)
        for step in steps
    )
    if not 0.0 <= asked <= MOST_SAMPLES:
        raise RigError(f"an acquisition of {asked:.3g} samples is out of bounds", rule=f"0 to {MOST_SAMPLES:,} samples")


def simulated_argument(verb: Verb, given: object) -> tuple[Any, ...]:
    """Return the argument of a verb of simulated rigs, checked for its type.

    Raises
    ------
    RigError
        The value is not of this kind.
    """
    texts = isinstance(given, dict) and all(isinstance(level, str) for level in given.values())
    rules = {
        Verb.BEGIN_CYCLE: (isinstance(given, str), "a text: the key of a cycle"),
        Verb.RESTORE: (isinstance(given, dict), "a saved state from `memory`"),
        Verb.CHANGE: (texts, "factors with their levels as texts"),
    }
    if verb not in rules:
        return ()
    good, rule = rules[verb]
    if not good:
        raise RigError(f"simulation.text = {given!r} is not an argument of {verb.name.lower()}", rule=rule)
    return (given,)
