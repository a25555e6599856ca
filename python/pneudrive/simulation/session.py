"""Sessions of drives and circuits: set inputs, advance in time, read outputs, save, restore, linearise."""

from __future__ import annotations

import ctypes
import math
from _ctypes import CFuncPtr
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, NoReturn

from pneudrive.errors import CommandError, ErrorKind, PneudriveError, SimulationError, nearest
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.repr_tables import Shown
from pneudrive.simulation.trajectory import MOST_SAMPLES, meaning

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    import numpy as np

    from pneudrive._core import Session as CoreSession
    from pneudrive.arrays import Array, Pair

LEAST_PART = 1e-6  # fraction of a period that is not only rounding
#: Types of a compiled controller: result, then time and outputs.
_COMPILED = (ctypes.c_double, (ctypes.c_double, ctypes.POINTER(ctypes.c_double)))
_DRIVE_INPUTS = ("command", "load_force_n", "supply_pressure_pa")  # inputs of a linearised drive
_RULE, _REMEDY, _ENDED = ": it must be ", ". Take ", "the session cannot continue"


class Variable(NamedTuple):
    """One variable of a session.

    Attributes
    ----------
    name : str
        Name for `Session.set` and `Session.read`.
    unit : str
    kind : str
        ``"input"``, ``"output"`` or ``"state"``.
    bounds : str
        Bounds of an input, in words.
    meaning : str
    """

    name: str
    unit: str
    kind: str
    bounds: str
    meaning: str


@dataclass(frozen=True, repr=False)
class Linear(Shown):
    """Drive or circuit, linearised about a state x0 and inputs u0.

    The rates are ``rates + A (x - x0) + B (u - u0)``. The outputs are ``output + C (x - x0) + D (u - u0)``.

    Attributes
    ----------
    A, B, C, D : numpy.ndarray
        Exact derivatives in SI. The shapes are (states, states), (states, inputs), (outputs, states), (outputs,
        inputs).
    states, inputs, outputs : tuple of str
        Names. A state has the name of its column: ``"position_m"``, ``"mass_a_kg"``; in a circuit, the name begins with
        the component: ``"left.position_m"``, ``"hose.cell_3.internal_energy_j"``.
    state, rates, output : numpy.ndarray
        State x0, and the rates and outputs at x0 and u0.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    state: Array
    rates: Array
    output: Array


class Session:
    """Running simulation of a drive or circuit, as `Drive.start` and `Circuit.start` return it.

    An input is set by name, and holds until it is set again. The integration ends exactly at the times of `advance` and
    `schedule`, and then continues with the same step size. Short calls use a method of lower order, which needs less
    work at the same tolerance. An invalid call raises an error and leaves the session unchanged.

    Examples
    --------
    >>> import pneudrive as pn
    >>> session = pn.Drive.load("catalogue:parker-osp-p25-mpye").start({"position": "50 mm"})
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
        # Bound once, for speed: a control loop calls them a thousand times a second.
        self._set, self._read, self._advance = core.set, core.read, core.advance

    @property
    def time(self) -> float:
        """Present time in s."""
        return self._core.time

    @property
    def statistics(self) -> dict[str, int]:
        """Counts since the start: steps, rejected, right_hand_sides, jacobians, factorisations, events."""
        return self._core.statistics

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All inputs, then all outputs, then all states."""
        inputs = [Variable(name, unit, "input", bounds, what) for name, unit, bounds, what in self._core.inputs]
        outputs = [(name, *meaning(name)[1:]) for name in self._core.columns]
        return (
            *inputs,
            *(Variable(name, unit, "output", "", what) for name, unit, what in outputs),
            *(Variable(name, unit, "state", "", meaning(name)[2]) for name, unit in self._core.states),
        )

    def set(self, name: str, value: float) -> None:
        """Set an input from the present time on.

        Parameters
        ----------
        name : str
            Name of an input in `variables`: ``"command"``, ``"load_force_n"``, ``"supply_pressure_pa"`` (absolute),
            ``"opening_supply_a"``, ... An opening of the valve that is set directly holds until the next command.
        value : float
            Value in the unit of the input.

        Raises
        ------
        CommandError
            The input does not exist, or the value is not a number or out of bounds.
        SimulationError
            The session cannot continue.
        """
        try:
            self._set(name, value)
        except (TypeError, ValueError, RuntimeError) as error:
            self._refuse(error, [name], value)

    def schedule(self, name: str, entries: Iterable[Pair]) -> None:
        """Set an input at future times. The integration ends exactly at each of these times.

        Parameters
        ----------
        name : str
            Name of an input.
        entries : iterable of (float, float)
            Pairs of a time in s and a value, with no time before the present time. If several entries have the same
            time, the last one holds.

        Raises
        ------
        CommandError, SimulationError
            As for `set`, or a time has passed.
        """
        try:
            times, values = zip(*entries, strict=True)
        except (TypeError, ValueError):
            raise CommandError.of("simulation.schedule", name=name) from None
        with self._refusing([name], values):
            self._core.schedule(name, times, values)

    def advance(
        self,
        until: float,
        *,
        progress: Progress | None = None,
        cancel: Flag | None = None,
    ) -> None:
        """Integrate until a time, with the inputs as set and scheduled. Then `read` the outputs.

        The integration ends exactly at `until` and keeps its step size. A call takes less than 2 us in addition to the
        integration. The integration takes 0.3 to 1 us of processor time for each attempted step of a drive, and more
        for circuits. `statistics` counts the attempts. `control` is faster for a sampled controller.

        Parameters
        ----------
        until : float
            Time of the session in s (not a duration), not before the present `time`.
        progress, cancel : optional
            See `pneudrive.progress.Watch`. A cancelled session has a time before `until` and can continue.

        Raises
        ------
        CommandError
            The time is not a number or has passed.
        SimulationError
            The solver cannot continue. The session ends, unless `restore` is called.
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

    def control(
        self,
        controller: Callable[..., float],
        period: float,
        until: float,
        *,
        reads: Sequence[str] = ("position_m", "velocity_m_s"),
        command: str = "command",
        progress: Progress | None = None,
        cancel: Flag | None = None,
    ) -> dict[str, np.ndarray]:
        """Run a sampled controller. Each command holds for one period.

        Parameters
        ----------
        controller : callable
            ``controller(t, *values)`` receives the time in s and the outputs `reads`, and returns the command. A
            function compiled by ``numba.cfunc("float64(float64, CPointer(float64))")``, or a `ctypes` function with
            these types, is called without Python.
        period : float
            Time between two samples in s.
        until : float
            Time of the last sample in s: the present time plus a whole number of periods.
        reads : sequence of str
            Names of outputs, for instance ``"cylinder.position_m"`` in a circuit.
        command : str
            Name of the input that the controller sets.
        progress, cancel : optional
            See `pneudrive.progress.Watch`.

        Returns
        -------
        dict
            ``"time_s"``, the outputs and the command by name: one value for each sample.

        Raises
        ------
        CommandError
            A name does not exist, the controller cannot be called, the times are not valid, or a command is out of
            bounds.
        SimulationError
            The solver cannot continue.
        Exception
            Any exception that the controller raises. The session stays at the time of that sample.

        Examples
        --------
        >>> import pneudrive as pn
        >>> session = pn.Drive.load("catalogue:reference").start({"position": "250 mm"})
        >>> run = session.control(lambda t, x, v: 8.0 * (0.3 - x) - 0.25 * v, 1e-3, 0.5)
        >>> len(run["time_s"]), abs(float(run["position_m"][-1]) - 0.3) < 5e-3
        (501, True)
        """
        import numpy as np

        begin, address = self.time, _address(controller)
        periods = (until - begin) / period if period > 0.0 else math.nan
        if not (0.5 < periods < MOST_SAMPLES and abs(periods - round(periods)) < LEAST_PART):
            raise CommandError.of("simulation.periods", until=until, period=period, begin=begin, most=MOST_SAMPLES)
        watch = Watch(progress, cancel)
        watch.look()
        told = None if progress is None and cancel is None else lambda t: watch.tell(t, until, "seconds simulated")
        plan = (address, period, round(periods), list(reads), command)
        with self._refusing([*reads, command], until, readable=True):
            rows, raised = self._core.control(controller, *plan, told)
        if raised is not None:
            raise raised
        times = begin + period * np.arange(len(rows))
        return {"time_s": times} | dict(zip([*reads, command], rows.T, strict=True))

    def read(self, name: str) -> float:
        """Return the present value of an output or an input.

        Parameters
        ----------
        name : str
            Name of an output or an input. ``"command"`` is NaN while the openings of the valve do not correspond to a
            command.

        Raises
        ------
        CommandError
            The variable does not exist.
        """
        try:
            return self._read(name)
        except (TypeError, ValueError, RuntimeError) as error:
            self._refuse(error, [name], name, readable=True)

    def save(self) -> bytes:
        """Return the session as bytes: state, inputs, schedule and the solver's history.

        Raises
        ------
        SimulationError
            The session cannot continue.
        """
        with self._refusing([], None):
            return self._core.save()

    def restore(self, saved: bytes) -> None:
        """Return to the state at `save`. The session then continues with exactly the same results.

        Parameters
        ----------
        saved : bytes
            Result of `save` of this session, or of another session with the same drive, tolerance and version of
            pneudrive.

        Raises
        ------
        CommandError
            The bytes are not from such a session, or are damaged.
        """
        if not isinstance(saved, bytes):
            raise CommandError(f"a {type(saved).__name__} is not a saved session", rule="bytes, as `save` returns them")
        with self._refusing([], saved):
            self._core.restore(saved)

    def linearise(self, inputs: Sequence[str] | None = None) -> Linear:
        """Return the exact derivatives of the rates and outputs at the present state.

        Friction keeps its present mode: a sticking contact does not move, and bristles are springs.

        Parameters
        ----------
        inputs : sequence of str, optional
            Inputs for B and D. Default for a circuit: all inputs except commands. Default for a drive: command, load
            force and supply pressure. A always covers all states.

        Raises
        ------
        CommandError
            The input does not exist, or the command is 0: a closed valve has different slopes for u < 0 and u > 0.
        SimulationError
            The session cannot continue.
        """
        known = [name for name, *_ in self._core.inputs]
        of_circuit = tuple(name for name in known if "." in name and not name.endswith(".command"))
        names = tuple(inputs) if inputs is not None else of_circuit or _DRIVE_INPUTS
        with self._refusing(names, inputs):
            found = self._core.linearise(names)
        states, columns = tuple(name for name, _ in self._core.states), self._core.columns
        return Linear(
            *(found["a"], found["b"], found["c"], found["d"]),
            *(states, names, tuple(columns[place] for place in found["columns"])),
            *(found["state"], found["rates"], found["outputs"]),
        )

    @contextmanager
    def _refusing(self, names: Sequence[object], value: object, *, readable: bool = False) -> Iterator[None]:
        """Convert errors of the core that the block raises, as `_refuse` does."""
        try:
            yield
        except (TypeError, ValueError, RuntimeError) as error:
            self._refuse(error, names, value, readable=readable)

    def _refuse(
        self,
        error: Exception,
        names: Sequence[object],
        value: object,
        *,
        readable: bool = False,
    ) -> NoReturn:
        """Raise an error of the core as an error of pneudrive, with the names that users know.

        `readable` states whether names of outputs are also valid.
        """
        if "borrowed" in str(error):  # the core lends a session to one call at a time
            raise SimulationError("another thread advances the session", remedy="Use one thread only.") from None
        known = {own for own, *_ in self._core.inputs}.union(self._core.columns if readable else ())
        for name in names:
            if name not in known:
                what = "variable" if readable else "input"
                raise CommandError(f"the session has no {what} {name!r}", remedy=nearest(str(name), known)) from None
        if isinstance(error, TypeError):
            raise CommandError(
                f"{names[0] if names else 'until'} = {value!r} is a {type(value).__name__}", rule="a number"
            ) from None
        if str(error).startswith(_ENDED):
            raise SimulationError(str(error), remedy="Restore a saved state, or start another session.") from None
        raise core_error(error, CommandError if isinstance(error, ValueError) else SimulationError) from None


def _address(controller: object) -> int:
    """Return the address of a compiled controller, or 0 for a controller in Python."""
    code = getattr(controller, "ctypes", controller)  # for a function that Numba compiled
    if not isinstance(code, CFuncPtr):
        if not callable(controller):
            raise CommandError.of("simulation.controller", controller=type(controller).__name__)
        return 0
    if (code.restype, tuple(code.argtypes or ())) != _COMPILED:
        raise CommandError.of("simulation.compiled")
    return ctypes.cast(code, ctypes.c_void_p).value or 0


def core_error(error: Exception, kind: ErrorKind) -> PneudriveError:
    """Convert an error of the core. An error text with a rule becomes a CommandError with this rule and its remedy."""
    what, _, rest = str(error).partition(_RULE)
    rule, _, remedy = rest.partition(_REMEDY)
    if not rule:
        return kind(what)
    return CommandError(what, rule=rule, remedy=f"{_REMEDY[2:]}{remedy}." if remedy else None)
