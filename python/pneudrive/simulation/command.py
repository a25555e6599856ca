"""The command of a valve over time, as steps that hold until the next entry."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from pneudrive import units
from pneudrive.describe.marks import Positions, Signal
from pneudrive.errors import CommandError, naming, nearest
from pneudrive.files.content import exists, read_text

if TYPE_CHECKING:
    import numpy as np

    CommandInput: TypeAlias = Signal | Positions | None

Pairs: TypeAlias = Sequence[tuple[float | str, float | str]]
Steps: TypeAlias = tuple[tuple[float, ...], tuple[float, ...]]
#: Forms of a command that `steps` reads.
Command: TypeAlias = "str | Path | float | Callable[[float], float] | Pairs | np.ndarray"
_NAMED = re.compile(r"\s*([A-Za-z_][\w-]*)(?:\.command)?\s*:(.*)", re.DOTALL)  # a time begins with a digit
#: Forms of commands that `plans` reads.
Commands: TypeAlias = "Command | Mapping[str, Command] | Sequence[str] | None"
FORMS = 'a number (0.5), "0 s: 0.6, 1 s: -0.6", pairs [(0.0, 0.6), (1.0, -0.6)], a CSV file or a function of time'


def steps(command: Command, times: Sequence[float] | None = None, signal: CommandInput = None) -> Steps:
    """Read a command as steps: times and values.

    Parameters
    ----------
    command : number, str, path, sequence of pairs or callable
        A number holds for the whole run. Other forms are ``"0 s: 0.6, 1 s: -0.6"``, a CSV file with the columns time_s
        and command, or pairs of time and command. A time is in s, or a quantity such as ``"20 ms"``. A function of the
        time in s is evaluated at `times`, and each value holds until the next time, as with a digital controller.
    times : sequence of float, optional
        Times in s, increasing from 0, at which a function is evaluated.
    signal : Signal, optional
        Electrical input of the valve (``drive.valve.command``), for commands such as ``"0 s: 7.5 V"``.

    Returns
    -------
    times, commands : tuple of float
        Times in s, increasing from 0, and the command at each time.

    Raises
    ------
    CommandError
        Times are missing, do not increase or do not begin at 0 s, or a command is not a number in [-1, 1].

    Examples
    --------
    >>> steps("0 s: 0.6, 1 s: -0.6")
    ((0.0, 1.0), (0.6, -0.6))
    """
    if isinstance(command, str):
        # `isfile` is False for a text that is not the name of a file.
        is_file = command.lower().endswith(".csv") or (":" not in command and os.path.isfile(command))  # noqa: PTH113
        command = Path(command) if is_file else _entries(command)
    if isinstance(command, Real):
        command = [(0.0, float(command))]
    elif callable(command):
        command = [(time, command(time)) for time in times or (0.0,)]
    elif not isinstance(command, Iterable | Path):
        raise CommandError(f"the command has the type {type(command).__name__}", remedy=f"Give {FORMS}.")
    pairs: list[tuple[float, float]] = []
    entries: Iterable[Any] = _lines(command) if isinstance(command, Path) else ((None, pair) for pair in command)
    for where, pair in entries:
        try:
            time, value = pair
        except (TypeError, ValueError):
            entry = {"number": len(pairs) + 1, "pair": pair, "forms": FORMS}
            raise CommandError.of("simulation.command-entry", where=where, **entry) from None
        at, value = _entry(time, value, where, signal)
        if not pairs and at != 0.0:
            raise CommandError(f"the command begins at {at:g} s", where=where, rule="the first entry must be at 0 s")
        if pairs and not at > (before := pairs[-1][0]):
            raise CommandError(f"in the command, {at:g} s follows {before:g} s", where=where, rule="times must rise")
        pairs.append((at, value))
    if not pairs:
        raise CommandError("the command is empty", rule="the first entry must be at 0 s")
    return tuple(at for at, _ in pairs), tuple(value for _, value in pairs)


def _entry(time: float | str, value: float | str, where: str | None, signal: CommandInput) -> tuple[float, float]:
    """Return time in s and command of an entry. `where` is the line of a file, in which numbers have no units."""
    if isinstance(time, str) and not where:
        with naming("a time of the command"):
            time = units.parse(time, "s")
    if isinstance(value, str) and value.split()[1:] and not where:  # a voltage or a current
        electrical = signal.signal if isinstance(signal, Positions) else signal
        if electrical is None:
            raise CommandError.of("simulation.no-electrical-input", given=value)
        value = electrical.opening(value)
    at = _number(time, "time", where)
    opening = _number(value, f"command at {at:g} s:", where)
    if not abs(opening) <= 1.0:
        raise CommandError.of("simulation.command-out-of-range", where=where, given=opening, time=at)
    if isinstance(signal, Positions):
        signal.check(opening, f"command = {opening:g} at {at:g} s", where)
    return at, opening


def plans(
    given: Commands, commandable: Mapping[str, CommandInput], times: Sequence[float] | None = None
) -> list[tuple[str, Steps]]:
    """Read the commands of a circuit.

    Parameters
    ----------
    given : mapping, str, sequence of str, None, or any form that `steps` reads
        Commands by component, or texts that begin with the component, ``"valve_l: 0 s: 1, 0.5 s: -1"``. The name is
        optional if only one component has a command.
    commandable : mapping
        Component that takes a command -> its electrical input, if one is described.
    times : sequence of float, optional
        As for `steps`.

    Returns
    -------
    list of (str, Steps)
        Component and its steps.

    Raises
    ------
    CommandError
        A component does not exist, a name is missing although several components have commands, or a command is not
        valid.

    Examples
    --------
    >>> plans(["left: 0 s: 1, 0.5 s: -1", "right: 0.4"], {"left": None, "right": None})
    [('left', ((0.0, 0.5), (1.0, -1.0))), ('right', ((0.0,), (0.4,)))]
    """
    if "" in commandable and not (isinstance(given, Mapping) and given):
        return [("", steps(cast("Command", given), times, commandable[""]))]
    if given is None:
        return []
    if isinstance(given, Mapping):
        named = [(str(name).removesuffix(".command"), command) for name, command in given.items()]
    elif isinstance(given, list | tuple) and given and all(isinstance(one, str) for one in given):
        named = [_named(str(one)) for one in given]
    else:
        named = [_named(cast("Command", given))]
    out: dict[str, Steps] = {}
    known = list(commandable)
    for name, command in named:
        if not known:
            raise CommandError("no component of the circuit takes a command", remedy="Leave the command out.")
        if not name and len(known) > 1:
            remedy = f'Name one: "{known[0]}: 0 s: 1".'
            raise CommandError(f"the command must name one of: {', '.join(known)}", remedy=remedy)
        if name and name not in commandable:
            remedy = nearest(name, known) if any(known) else "A drive has one command: give it without a name."
            raise CommandError(f'no component "{name}" takes a command', remedy=remedy)
        own = name or known[0]
        if own in out:
            raise CommandError(f"two commands are given for {own}", remedy="Keep one of them.")
        with naming(own, CommandError):
            out[own] = steps(command, times, commandable[own])
    return list(out.items())


def inputs(
    given: Commands, commandable: Mapping[str, CommandInput], times: Sequence[float] | None = None
) -> list[tuple[str, Steps]]:
    """Read commands as `plans` does, and return the name of the input instead of the component.

    Examples
    --------
    >>> inputs(0.5, {"": None}), inputs({"left": 0.5}, {"left": None})
    ([('command', ((0.0,), (0.5,)))], [('left.command', ((0.0,), (0.5,)))])
    """
    return [(input_of(name), own) for name, own in plans(given, commandable, times)]


def input_of(component: str) -> str:
    """Return the name of the command input of a component.

    An empty name means the valve of a drive.
    """
    return f"{component}.command" if component else "command"


def are_named(given: object) -> bool:
    """Return whether the argument is a list of texts, and one of them begins with the name of a component.

    Examples
    --------
    >>> are_named(["left: 0.4", "right: 0 s: 1"]), are_named(["0.4", "0 s: 1"])
    (True, False)
    """
    return isinstance(given, list | tuple) and any(isinstance(one, str) and _NAMED.fullmatch(one) for one in given)


def _named(given: Command) -> tuple[str, Command]:
    """Split the name of a component from a command; the name is empty if the command has none."""
    found = _NAMED.fullmatch(given) if isinstance(given, str) else None
    return (found[1], found[2].strip()) if found else ("", given)


def _entries(text: str) -> list[tuple[str, str]]:
    """Return times and values of a command as texts. A single value without a time holds for the whole run."""
    if not text.strip():
        raise CommandError("the command is empty", remedy='Write for instance "0 s: 0.6, 1 s: -0.6".')
    if not re.search("[,;:]", text):
        return [("0 s", text.strip())]
    pairs = []
    for entry in map(str.strip, re.split("[,;]", text)):
        time, colon, value = entry.rpartition(":")
        if not colon or not time.strip():
            raise CommandError.of("simulation.entry-without-time", entry=entry)
        pairs.append((time.strip(), value.strip()))
    return pairs


def _lines(path: Path) -> list[tuple[str, list[str]]]:
    """Return the lines of a command file: file and line number, and time and value as texts."""
    if not exists(path):
        raise CommandError(f"there is no command file {path}")
    text = read_text(path, CommandError)
    lines = [(f"{path}:{number}", line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if not lines:
        raise CommandError(f"{path} is empty", rule="a command file is CSV: time_s,command")
    (where, first), *entries = lines
    if [name.strip().strip('"') for name in first.split(",")] != ["time_s", "command"]:
        raise CommandError.of("simulation.command-header", where=where, lines=first.strip())
    if not entries:
        raise CommandError(f"{path} has no entries", rule="the first entry must be at 0 s")
    return [(where, line.strip().split(",")) for where, line in entries]


def _number(given: object, what: str, where: str | None = None) -> float:
    try:
        value = float(given)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise CommandError(f"{what} {str(given).strip()!r} is not a number", where=where)
    return value
