"""Commands and duration of each member, one for all members or one for each."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.describe.tables.starts import start_table
from pneudrive.errors import CommandError
from pneudrive.simulation import command as commands
from pneudrive.simulation.simulate import positive

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from pneudrive.simulation.command import CommandInput, Steps

    Array = NDArray[np.float64]
    #: Of an input of the core: its steps, one for all members or one for each.
    EachSteps = list[Steps]

#: Row of all members if one command is for all.
_ALL = slice(None)


class Alike(NamedTuple):
    """Members whose commands change at the same times.

    Attributes
    ----------
    places : ndarray of int, or slice
        Indices of the members.
    plans : list
        Input, its times in s, and its values with shape (times,) or (members, times).
    durations : ndarray
        s, shape (1,) or (members,).
    """

    places: NDArray[np.intp] | slice
    plans: list[tuple[str, list[float], Array]]
    durations: Array


@dataclass(frozen=True, eq=False)
class MemberPlans:
    """Commands and durations of the members.

    Attributes
    ----------
    steps : dict
        Input of the core -> its steps, one for all or one for each member.
    durations : ndarray
        s, shape (1,) or (n,).
    """

    steps: dict[str, EachSteps]
    durations: Array

    @property
    def duration_s(self) -> float:
        """The longest duration, s."""
        return float(self.durations.max())

    @property
    def moves_up(self) -> bool | None:
        """Whether the first command other than 0 is positive. None if members differ or no command has this form."""
        every = (values for each in self.steps.values() for _, values in each)
        signs = {next((value > 0.0 for value in values if value), None) for values in every}
        return signs.pop() if len(signs) == 1 else None

    def check(self, size: int) -> None:
        """Refuse commands or durations whose number differs from the number of members.

        Raises
        ------
        CommandError
            The numbers differ.
        """
        of = {name: name.rpartition(".")[0] for name in self.steps}
        found = {f"the command of {of[name]}" if of[name] else "the command": len(x) for name, x in self.steps.items()}
        for what, length in {**found, "duration": len(self.durations)}.items():
            if length not in (1, size):
                raise CommandError(
                    f"{what} has {length} rows, and there are {size} members",
                    rule="one for all, or one for each member",
                )

    def part(self, first: int, last: int) -> MemberPlans:
        """Return the commands and durations of the members from `first` to before `last`."""
        own = {name: each if len(each) == 1 else each[first:last] for name, each in self.steps.items()}
        return MemberPlans(own, self.durations if len(self.durations) == 1 else self.durations[first:last])

    def alike(self) -> Iterator[Alike]:
        """Yield the members by the times of their commands. Members with equal times are computed together."""
        longest = max((len(each) for each in self.steps.values()), default=1)
        if longest == 1:
            plans = [(name, list(each[0][0]), np.array(each[0][1])) for name, each in self.steps.items()]
            yield Alike(_ALL, plans, self.durations)
            return
        every = {name: each * longest if len(each) == 1 else each for name, each in self.steps.items()}
        groups: dict[tuple[tuple[float, ...], ...], list[int]] = {}
        for place in range(longest):
            groups.setdefault(tuple(each[place][0] for each in every.values()), []).append(place)
        for times, own in groups.items():
            plans = [
                (name, list(at), np.array([each[place][1] for place in own]))
                for (name, each), at in zip(every.items(), times, strict=True)
            ]
            yield Alike(np.array(own), plans, self.durations if len(self.durations) == 1 else self.durations[own])

    def about(self) -> dict[str, Any]:
        """Describe them as plain data. Long data are represented by their SHA-256."""
        said = {name: _said(each) for name, each in self.steps.items()}
        command = next(iter(said.values())) if list(said) == ["command"] else said
        durations = self.durations.tolist()
        return {"command": command, "duration_s": durations[0] if len(durations) == 1 else _digest(durations)}


def _said(each: EachSteps) -> Any:  # noqa: ANN401 - plain data
    return [list(one) for one in each[0]] if len(each) == 1 else _digest(each)


def _digest(given: Any) -> dict[str, Any]:  # noqa: ANN401 - plain data
    return {"members": len(given), "sha256": hashlib.sha256(json.dumps(given).encode()).hexdigest()}


def member_plans(command: Any, duration: Any, commandable: Mapping[str, CommandInput]) -> MemberPlans:  # noqa: ANN401
    """Read the commands of the members of a drive or a circuit.

    Parameters
    ----------
    command : as for `pneudrive.ensemble.simulate_many`
    duration : as for `pneudrive.ensemble.simulate_many`
    commandable : mapping
        Component that takes a command -> its electrical input.
    """
    rows: dict[str, EachSteps] = {}
    if "" in commandable and not isinstance(command, Mapping):
        rows[""] = read_rows(command, commandable[""])
    elif isinstance(command, Mapping):
        for name, given in command.items():
            # Check with a placeholder for the steps that the component exists and does not have two commands.
            ((own, _),) = commands.plans({name: 0.0}, commandable)
            if own in rows:
                raise CommandError(f"two commands are given for {own}", remedy="Keep one of them.")
            with _naming(own):
                rows[own] = read_rows(given, commandable[own])
    elif isinstance(command, list | tuple) and command and all(isinstance(one, Mapping) for one in command):
        each = [dict(_member(place, commands.plans, one, commandable)) for place, one in enumerate(command)]
        if any(set(one) != set(each[0]) for one in each):
            raise CommandError("the members have commands of different components", rule="the same in each member")
        rows = {name: [one[name] for one in each] for name in each[0]}
    elif _is_many(command) and not commands.are_named(command):
        ((own, _),) = commands.plans(0.0, commandable)
        rows[own] = read_rows(command, commandable[own])
    else:
        rows = {name: [steps] for name, steps in commands.plans(command, commandable)}
    return MemberPlans({commands.input_of(name): each for name, each in rows.items()}, _durations(duration))


def read_rows(given: Any, signal: CommandInput) -> EachSteps:  # noqa: ANN401
    """Read one command for all members, or a list of commands, one for each.

    Raises
    ------
    CommandError
        One of them is not valid. The message names the member.

    Examples
    --------
    >>> read_rows("0 s: 1", None)
    [((0.0,), (1.0,))]
    >>> read_rows([0.5, "0 s: 1, 20 ms: -1"], None)
    [((0.0,), (0.5,)), ((0.0, 0.02), (1.0, -1.0))]
    """
    if callable(given):
        raise CommandError("the command of many members is a function", remedy="Give its steps, (time, command).")
    if not _is_many(given):
        return [commands.steps(given, None, signal)]
    return [_member(place, commands.steps, one, None, signal) for place, one in enumerate(given)]


def _is_many(given: Any) -> bool:  # noqa: ANN401
    """Return whether a value is a list of commands: its entries are then not pairs of time and value."""
    if isinstance(given, np.ndarray):
        return given.ndim in (1, 3) and len(given) > 0
    if isinstance(given, str) or not isinstance(given, Sequence):
        return False
    return len(given) > 0 and not all(_is_pair(one) for one in given)


def _is_pair(given: object) -> bool:
    """Return whether an entry is a pair of time and value."""
    return (
        isinstance(given, list | tuple | np.ndarray)
        and len(given) == 2
        and all(isinstance(one, str | Real) for one in given)
    )


def _member(place: int, read: Any, *given: Any) -> Any:  # noqa: ANN401
    with _naming(f"member {place}"):
        if callable(given[0]):
            raise CommandError("the command is a function", remedy="Give its steps, (time, command).")
        return read(*given)


@contextmanager
def _naming(whom: str) -> Iterator[None]:
    """Add the member to an error in a command."""
    try:
        yield
    except CommandError as error:
        what = f"{whom}: {error.what}"
        raise CommandError(what, where=error.where, rule=error.rule, remedy=error.remedy) from None


def _durations(given: Any) -> Array:  # noqa: ANN401
    if isinstance(given, str) or not np.ndim(given):
        return np.array([positive(given, "s", "duration")])
    if np.ndim(given) != 1 or not len(given):
        raise CommandError(f"duration has the shape {np.shape(given)}", rule="one for all, or one for each member")
    return np.array([positive(one, "s", f"duration of member {place}") for place, one in enumerate(given)])


def parted_starts(given: Any) -> tuple[Any, dict[str, list[Any]]]:  # noqa: ANN401
    """Split a start state into the part for all members, and a column for each key with one value for each member.

    Raises
    ------
    CommandError
        The start states of the members have different keys.

    Examples
    --------
    >>> parted_starts([{"position": "5 mm"}, {"position": "9 mm"}])
    (None, {'position': ['5 mm', '9 mm']})
    """
    if not isinstance(given, list | tuple):
        return given, {}
    each = [start_table(one) for one in given]
    if not each or not each[0] or any(set(one) != set(each[0]) for one in each):
        raise CommandError("the start states of the members have different keys", rule="the same keys in each")
    return None, {key: [one[key] for one in each] for key in each[0]}
