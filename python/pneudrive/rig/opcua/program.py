"""What a client of a served rig asks to be done, as steps: within bounds, so that nobody can keep a rig for ever."""

from __future__ import annotations

from typing import Any

from pneudrive.errors import RigError
from pneudrive.rig.interface import Hold, Move, Sampling, Step
from pneudrive.rig.opcua.nodes import HOLD, RELEASED, SHUT, Verb

LONGEST_STEP_S = 86400.0
MOST_SAMPLES = 10_000_000  # of an acquisition


def program_of(arguments: dict[str, Any], longest_m: float) -> list[Step]:
    """Read the steps from the arrays of a command.

    Parameters
    ----------
    arguments : dict
        Name of a node -> value in SI.
    longest_m : float
        Longest way of a move.

    Raises
    ------
    RigError
        There are not so many steps, or one takes longer than a day.
    """
    count = arguments["step.count"]
    weights = arguments.get("step.weight") or [0.0] * count
    names = ("step.kind", "step.position", "step.speed", "step.duration")
    rows = list(zip(*(arguments[name] for name in names), weights, strict=False))
    if not 0 <= count <= len(rows):
        raise RigError(f"a program of {count} steps", rule=f"0 to {len(rows)} steps")
    return [_step(row, longest_m) for row in rows[:count]]


def _step(row: tuple[int, float, float, float, float], longest_m: float) -> Step:
    kind, position, speed, duration, weight = row
    if kind & HOLD:
        if not 0.0 <= duration <= LONGEST_STEP_S:
            raise RigError(f"a hold of {duration:g} s", rule=f"0 to {LONGEST_STEP_S:g} s")
        return Hold(duration, bool(kind & RELEASED), bool(kind & SHUT), weight)
    least = longest_m / LONGEST_STEP_S
    if speed < least:
        raise RigError(f"a move at {1e3 * speed:g} mm/s", rule=f"at least {1e3 * least:.3g} mm/s: a day for the travel")
    return Move(position, speed)


def first_step(arguments: dict[str, Any], kind: type[Step], longest_m: float) -> Any:  # noqa: ANN401 - of that kind
    """Read the first step, which must be a move, or a hold.

    Raises
    ------
    RigError
        It is not.
    """
    (step,) = program_of({**arguments, "step.count": 1}, longest_m)
    if not isinstance(step, kind):
        raise RigError(f"the first step is no {kind.__name__.lower()}", rule="step.kind: 0 move, 1 hold")
    return step


def sampling_of(arguments: dict[str, Any]) -> Sampling:
    """Read how an acquisition is sampled."""
    default = Sampling()
    return Sampling(
        int(arguments.get("sampling.samples_per_stroke", default.samples_per_stroke)),
        arguments.get("sampling.burst_rate", default.burst_rate_hz),
        arguments.get("sampling.burst_before", default.burst_before_s),
        arguments.get("sampling.burst_after", default.burst_after_s),
        arguments.get("sampling.hold_rate", default.hold_rate_hz),
    )


def check_size(steps: list[Step], sampling: Sampling) -> None:
    """Refuse an acquisition of more samples than anybody wants.

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
        raise RigError(f"an acquisition of {asked:.3g} samples", rule=f"0 to {MOST_SAMPLES:,} samples")


def simulated_argument(verb: Verb, given: object) -> tuple[Any, ...]:
    """Give the argument of a verb of simulated rigs, where it is of the right kind.

    Raises
    ------
    RigError
        It is not.
    """
    texts = isinstance(given, dict) and all(isinstance(level, str) for level in given.values())
    rules = {
        Verb.BEGIN_CYCLE: (isinstance(given, str), "a text: the key of a cycle"),
        Verb.RESTORE: (isinstance(given, dict), "what `memory` gave"),
        Verb.CHANGE: (texts, "factors with their levels, which are texts"),
    }
    if verb not in rules:
        return ()
    good, rule = rules[verb]
    if not good:
        raise RigError(f"simulation.text = {given!r} is nothing for {verb.name.lower()}", rule=rule)
    return (given,)
