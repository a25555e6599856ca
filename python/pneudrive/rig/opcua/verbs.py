"""Execution of a client's commands on a served rig."""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pneudrive.errors import PneudriveError, RigError
from pneudrive.files.content import parse_json
from pneudrive.rig.interface import Hold, Move, Samples, closed_after
from pneudrive.rig.opcua.nodes import Verb
from pneudrive.rig.opcua.program import check_size, first_step, program_of, sampling_of, simulated_argument
from pneudrive.rig.opcua.space import SIMULATED

if TYPE_CHECKING:
    from collections.abc import Callable

    from pneudrive.rig.interface import Rig
    from pneudrive.rig.opcua.session import Client

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Command:
    """Command of a client."""

    client: Client
    identity: int
    verb: int
    arguments: dict[str, Any]


class Interrupted(Exception):  # noqa: N818 - not an error: halt, stop or a silent client
    """The running verb must end now."""


class Verbs:
    """Verbs of a rig, called by commands.

    Parameters
    ----------
    rig : Rig
    simulated : bool
        Whether the map has nodes for the verbs of simulated rigs.
    chunk : int
        Largest number of samples of a chunk.
    put : callable
        Called with samples when there is room for them; raises `Interrupted`.
    answer : callable
        Called with a command and the result of a verb of simulated rigs, as JSON.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        simulated: bool,
        chunk: int,
        put: Callable[[Samples], None],
        answer: Callable[[Command, str], None],
    ) -> None:
        self._rig, self._chunk, self._put, self._answer = rig, chunk, put, answer
        low, high = rig.limits().position_m
        self._longest_m = high - low
        self._known: dict[int, Callable[[Command], object]] = {
            Verb.HOME: lambda _: rig.home(),
            Verb.MOVE: self._move,
            Verb.HOLD: self._hold,
            Verb.SET_PRESSURE: lambda c: rig.set_pressure(
                c.arguments["command.pressure_a"], c.arguments["command.pressure_b"]
            ),
            Verb.ACQUIRE: self._acquire,
        }
        for verb, ability in SIMULATED.items():
            if simulated and isinstance(rig, ability):
                self._known[verb] = self._simulate

    def run(self, command: Command) -> str:
        """Run a command; return its fault, empty without one.

        Raises
        ------
        Interrupted
            The command was interrupted.
        """
        try:
            if command.verb not in self._known:
                raise RigError(f"verb {command.verb} is not known to this rig")
            self._known[command.verb](command)
        except Interrupted:
            raise
        except PneudriveError as error:
            return str(error)
        except Exception as error:
            log.exception("a verb of the rig failed")
            return f"{type(error).__name__}: {error}"
        return ""

    def _move(self, command: Command) -> None:
        step: Move = first_step(command.arguments, Move, self._longest_m)
        self._rig.move(step.to_m, step.speed_m_s)

    def _hold(self, command: Command) -> None:
        step: Hold = first_step(command.arguments, Hold, self._longest_m)
        self._rig.hold(step.duration_s, step.released)

    def _simulate(self, command: Command) -> None:
        verb, text = Verb(command.verb), command.arguments["simulation.text"]
        argument = simulated_argument(verb, parse_json(text or "null", "simulation.text", RigError))
        self._answer(command, json.dumps(getattr(self._rig, verb.name.lower())(*argument)))

    def _acquire(self, command: Command) -> None:
        """Run the program and put its samples into the ring."""
        steps, sampling = program_of(command.arguments, self._longest_m), sampling_of(command.arguments)
        check_size(steps, sampling)
        with closed_after(self._rig.acquire(steps, sampling)) as parts:
            for given in parts:
                part = Samples.of(given)
                for start in range(0, len(part), self._chunk):
                    self._put(part.rows(slice(start, start + self._chunk)))
