"""A drive or a circuit that runs: its inputs are set, it is advanced and read, saved and put back, and linearised."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, NoReturn

from pneudrive.errors import CommandError, PneudriveError, SimulationError, nearest
from pneudrive.show import Shown
from pneudrive.trajectory import meaning
from pneudrive.watch import Watch

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import numpy as np

    from pneudrive._core import Session as CoreSession
    from pneudrive.watch import Flag

_DRIVE_INPUTS = ("command", "load_force_n", "supply_pressure_pa")  # by which a drive is linearised
#: What a drive calls inputs of its circuit that are not of the cylinder.
_OF_A_DRIVE = {
    "valve.command": "command",
    "supply.pressure_pa": "supply_pressure_pa",
    "supply.temperature_k": "supply_temperature_k",
}
_RULE, _ENDED = ": it must be ", "the session cannot go on"


class Variable(NamedTuple):
    """One variable of a session.

    Attributes
    ----------
    name : str
        As `Session.set` and `Session.read` take it.
    unit : str
    kind : str
        ``"input"``, ``"output"`` or ``"state"``.
    bounds : str
        Of an input, in words.
    meaning : str
    """

    name: str
    unit: str
    kind: str
    bounds: str
    meaning: str


@dataclass(frozen=True, repr=False)
class Linear(Shown):
    """A drive about one of its states x0 and inputs u0: ``x' = rates + A (x - x0) + B (u - u0)``, outputs by C and D.

    Attributes
    ----------
    A, B, C, D : numpy.ndarray
        Shapes (states, states), (states, inputs), (outputs, states), (outputs, inputs); exact derivatives, in SI.
    states, inputs, outputs : tuple of str
        Their names; a state is called as a column is, by the component and what it is of: ``"position_m"``,
        ``"mass_a_kg"``, of a circuit ``"left.position_m"``, ``"hose.cell_3.internal_energy_j"``.
    state, rates, output : numpy.ndarray
        The state, its rates and the outputs where the derivatives are taken.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    state: np.ndarray
    rates: np.ndarray
    output: np.ndarray


class Session:
    """A running drive or circuit. `Drive.start` and `Circuit.start` make it.

    What it feels is set by name and holds until it is set again; the integration goes exactly to the times of
    `advance` and `schedule`, with the step size kept. Driven with the command of a simulation it gives its bits. A call
    that is wrong raises and leaves the session as it was.

    Examples
    --------
    >>> import pneudrive as pn
    >>> session = pn.Drive.load("catalogue:parker-osp-p25-sy5000").start({"position": "50 mm"})
    >>> session.set("command", 0.4)
    >>> session.advance(0.05)
    >>> before = session.save()
    >>> session.advance(0.1)
    >>> x = session.read("position_m")
    >>> session.restore(before)
    >>> session.advance(0.1)
    >>> session.time, session.read("position_m") == x
    (0.1, True)
    """

    def __init__(self, core: CoreSession) -> None:
        self._core = core
        # Bound once: a control loop calls them a thousand times a second.
        self._set, self._read, self._advance = core.set, core.read, core.advance

    @property
    def time(self) -> float:
        """Present time, s."""
        return self._core.time

    @property
    def statistics(self) -> dict[str, int]:
        """Work done since the start: steps, rejected, right_hand_sides, jacobians, factorisations, events."""
        return self._core.statistics

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All inputs, outputs and states, in their order."""
        inputs = [Variable(name, unit, "input", bounds, what) for name, unit, bounds, what in self._core.inputs]
        outputs = [(name, *meaning(name)[1:]) for name in self._core.columns]
        return (
            *inputs,
            *(Variable(name, unit, "output", "", what) for name, unit, what in outputs),
            *(Variable(name, unit, "state", "", meaning(name)[2]) for name, unit in self._core.states),
        )

    def set(self, name: str, value: float) -> None:
        """Set an input from now on.

        Parameters
        ----------
        name : str
            Of an input in `variables`: ``"command"``, ``"load_force_n"``, ``"supply_pressure_pa"`` (absolute),
            ``"opening_supply_a"``, ... Edges of the valve that are set by themselves stay so until the next command.
        value : float
            In the unit of the input.

        Raises
        ------
        CommandError
            There is no such input, or the value is no number or out of bounds.
        SimulationError
            The session cannot go on.
        """
        try:
            self._set(name, value)
        except (TypeError, ValueError, RuntimeError) as error:
            self._refuse(error, [name], value)

    def schedule(self, name: str, entries: Iterable[tuple[float, float]]) -> None:
        """Set an input at times to come; the integration ends on each of them exactly.

        Parameters
        ----------
        name : str
            Of an input.
        entries : iterable of (float, float)
            Time in s, not before the present, and value. Of entries at one time the one given last holds.

        Raises
        ------
        CommandError, SimulationError
            As for `set`; a time has passed.
        """
        try:
            times, values = zip(*entries, strict=True)
        except (TypeError, ValueError):
            raise CommandError(
                f"the schedule of {name} is no list of (time, value)", remedy="For instance [(0.1, 0.5), (0.2, 0.0)]."
            ) from None
        try:
            self._core.schedule(name, times, values)
        except (TypeError, ValueError, RuntimeError) as error:
            self._refuse(error, [name], values)

    def advance(
        self,
        until: float,
        *,
        progress: Callable[[float, float, str], None] | None = None,
        cancel: Flag | None = None,
    ) -> None:
        """Go on until a time, under the inputs as they are set and scheduled; `read` tells what came of it.

        The integration ends on `until` exactly and keeps its step size, so that many short calls give the bits of one
        long one. Nothing is returned. A call costs under 2 us beside the integration, which takes about 1 us of a
        processor for each attempt at a step of a drive, more for circuits; `statistics` counts the attempts.

        Parameters
        ----------
        until : float
            A time of the session in s, not a duration, and not before the present one (`time`).
        progress, cancel : optional
            See `pneudrive.watch.Watch`. A session that was cancelled stands somewhere before `until` and can go on.

        Raises
        ------
        CommandError
            The time is no number or has passed.
        SimulationError
            The solver cannot go on; the session ends here, and `restore` alone brings it back.
        Cancelled
            `cancel` was set.
        """
        try:
            if progress is None and cancel is None:
                self._advance(until)
            else:
                watch = Watch(progress, cancel)
                watch.look()
                self._advance(until, lambda t: watch.tell(t, until, "seconds simulated"))
        except (TypeError, ValueError, RuntimeError) as error:
            self._refuse(error, [], until)

    def read(self, name: str) -> float:
        """Return an output, or what an input is set to, at the present time.

        Parameters
        ----------
        name : str
            Of a variable that is an output or an input. ``"command"`` is not a number while the edges of the valve
            stand as no command puts them.

        Raises
        ------
        CommandError
            There is no such variable.
        """
        try:
            return self._read(name)
        except (TypeError, ValueError, RuntimeError) as error:
            self._refuse(error, [name], name, readable=True)

    def save(self) -> bytes:
        """Return the session as bytes: state, inputs, schedule, and what the solver remembers.

        Raises
        ------
        SimulationError
            The session cannot go on.
        """
        try:
            return self._core.save()
        except (ValueError, RuntimeError) as error:
            self._refuse(error, [], None)

    def restore(self, saved: bytes) -> None:
        """Go back to where `save` was called; what follows has the same bits as it had then.

        Parameters
        ----------
        saved : bytes
            Of this session, or of another one of the same drive, tolerance and version of pneudrive.

        Raises
        ------
        CommandError
            The bytes are of something else, or damaged.
        """
        if not isinstance(saved, bytes):
            raise CommandError(f"a {type(saved).__name__} is no saved session", rule="bytes, as `save` returns them")
        try:
            self._core.restore(saved)
        except (TypeError, ValueError, RuntimeError) as error:
            self._refuse(error, [], saved)

    def linearise(self, inputs: Sequence[str] | None = None) -> Linear:
        """Return the exact derivatives of the drive's rates and outputs about the present state.

        Friction is taken in its present mode: what sticks does not move, bristles are springs.

        Parameters
        ----------
        inputs : sequence of str, optional
            By which inputs; all states are taken. Where nothing is said, those of a circuit but its commands, and of
            a drive command, force of the load and pressure of the supply.

        Raises
        ------
        CommandError
            There is no such input. The command is 0: a shut valve has one slope to each side.
        SimulationError
            The session cannot go on.
        """
        known = [name for name, *_ in self._core.inputs]
        of_circuit = tuple(name for name in known if "." in name and not name.endswith(".command"))
        names = tuple(inputs) if inputs is not None else of_circuit or _DRIVE_INPUTS
        try:
            found = self._core.linearise(names)
        except (TypeError, ValueError, RuntimeError) as error:
            self._refuse(error, names, inputs)
        outputs = (name for name in self._core.columns if name.rpartition(".")[2] not in ("time_s", "command"))
        return Linear(
            *(found["a"], found["b"], found["c"], found["d"]),
            *(tuple(name for name, _ in self._core.states), names, tuple(outputs)),
            *(found["state"], found["rates"], found["outputs"]),
        )

    def _refuse(self, error: Exception, names: Sequence[object], value: object, *, readable: bool = False) -> NoReturn:
        """Raise what the core refused, in words of a user; outputs too are known where they are `readable`."""
        if "borrowed" in str(error):  # the core lends a session to one call at a time
            raise SimulationError("another thread advances the session", remedy="Let one thread hold it.") from None
        known = list(
            dict.fromkeys([*(own for own, *_ in self._core.inputs), *(self._core.columns if readable else ())])
        )
        for name in names:
            if name not in known:
                what = "variable" if readable else "input"
                raise CommandError(f"a session has no {what} {name!r}", remedy=nearest(str(name), known)) from None
        if isinstance(error, TypeError):
            raise CommandError(
                f"{names[0] if names else 'until'} = {value!r} is a {type(value).__name__}", rule="a number"
            ) from None
        what, _, rule = str(error).partition(_RULE)
        if what.startswith(_ENDED):
            raise SimulationError(what, remedy="Restore what it saved before, or start another.") from None
        kind: type[PneudriveError] = CommandError if isinstance(error, ValueError) else SimulationError
        raise kind(what, rule=rule or None) from None


def short_name(name: str, piston: str = "cylinder") -> str:
    """Return the name that a drive has for a variable of its circuit; of what a drive has not, the same.

    Examples
    --------
    >>> short_name("cylinder.a.pressure_pa"), short_name("valve.command"), short_name("tube_a.mass_flow_kg_s")
    ('pressure_a_pa', 'command', 'tube_a.mass_flow_kg_s')
    """
    of, _, last = name.partition(".")
    if of == piston:
        chamber, dot, rest = last.partition(".")
        if not dot:
            return last
        quantity, _, unit = rest.rpartition("_") if not rest.endswith("_kg_s") else (rest[:-5], "", "kg_s")
        return f"{quantity}_{chamber}_{unit}"
    return _OF_A_DRIVE.get(name, name)
