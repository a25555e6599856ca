"""Numbers of a circuit that vary, named as in its trajectory, and the members in the core's form."""

from __future__ import annotations

import json
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe.tables.starts import start_values
from pneudrive.ensemble.variation import COUPLED, CoreMembers, Variation, chosen_numbers
from pneudrive.errors import DescriptionError
from pneudrive.free.circuit import AMBIENT, circuit_numbers, core_numbers, core_path
from pneudrive.free.varied import INITIAL

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.describe.circuit import Circuit

    Array = NDArray[np.float64]

#: What follows from a number is found by moving it by this share, or by so much if it is 0.
NUDGE = 1e-3


class CircuitVariation(Variation):
    """The numbers of a circuit, and of its start state, that a design sets.

    Parameters
    ----------
    circuit : Circuit
    names : sequence of str
        See `circuit_numbers`.
    initial : mapping or str, optional
        Start values of all members that differ from those of the circuit.

    Raises
    ------
    CommandError
        A name is unknown or repeated.
    """

    def __init__(self, circuit: Circuit, names: Sequence[str], initial: Any = None) -> None:  # noqa: ANN401
        self.drive: Circuit = circuit
        self.initial: Mapping[str, Any] | None = start_values(initial) or None
        self.numbers = chosen_numbers("circuit", circuit_numbers(circuit), names)

    def start_said(self) -> dict[str, str]:
        """Return the start state of all members in words, including that of the circuit file."""
        return {name: repr(value) for name, value in self.drive.core_initial(self.initial).items()}

    def changes(self, row: Array) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the changes of a member to the circuit (see `Circuit.replace`) and to its start state."""
        changes, start = {}, dict(self.initial or {})
        for number, value in zip(self.numbers, row, strict=True):
            written = number.written(float(value))
            if number.name.startswith(INITIAL):
                start[number.name.removeprefix(INITIAL)] = written
            else:
                changes[number.name if number.name in AMBIENT else f"components.{number.name}"] = written
        return changes, start

    def single(self, row: Array) -> tuple[Circuit, dict[str, Any]]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the circuit and the start state of a member.

        Raises
        ------
        DescriptionError
            They are not valid.
        """
        changes, start = self.changes(row)
        return self.drive.replace(changes) if changes else self.drive, start

    def try_row(self, row: Array) -> None:
        """Read a member.

        Raises
        ------
        DescriptionError
            It is not valid.
        """
        self._leaves(row)

    def coupled(self) -> Iterator[tuple[str, str]]:
        """Yield the pairs of numbers of one component of which the first must not exceed the second."""
        ends = [(low.partition(".")[2], high.partition(".")[2], low) for low, high in COUPLED]
        for name in self.names:
            for low, high, whole in ends:
                of = name.removesuffix(low)
                high_key = (
                    f"{of.removesuffix('friction.')}friction.{high}" if whole.startswith("friction.") else of + high
                )
                if name.endswith(f".{low}") and high_key in self.names:
                    yield name, high_key

    def _leaves(self, row: Array) -> tuple[dict[str, float], dict[str, float]]:
        """Return the numbers of a member in the core's form by their paths, and its start values."""
        circuit, start = self.single(row)
        return dict(core_numbers(json.loads(circuit.core_json()))), circuit.core_initial(start)

    @cached_property
    def _nominal(self) -> Array:
        numbers, starts = dict(core_numbers(json.loads(self.drive.core_json()))), self.drive.core_initial(self.initial)
        names = self.drive.start_names
        return np.array(
            [
                starts[names[number.name.removeprefix(INITIAL)]]
                if number.name.startswith(INITIAL)
                else numbers[core_path(number.name)]
                for number in self.numbers
            ]
        )

    @cached_property
    def _moved(self) -> tuple[list[str], list[str], bool]:
        """Return the paths and start values that the numbers change, and whether each changes only its own path."""
        base, starts = self._leaves(self._nominal)
        paths = [core_path(number.name) for number in self.numbers if not number.name.startswith(INITIAL)]
        names = self.drive.start_names
        begun = [names[number.name.removeprefix(INITIAL)] for number in self.numbers if number.name.startswith(INITIAL)]
        own = {*paths, *begun}
        alone = True
        for place in range(len(self.numbers)):
            nudged = self._nudged(place)
            if nudged is None:  # numbers at a bound are set member by member
                alone = False
                continue
            paths += [path for path, value in nudged[0].items() if path not in paths and value != base[path]]
            begun += [name for name, value in nudged[1].items() if name not in begun and value != starts[name]]
        return paths, begun, alone and own == {*paths, *begun}

    def _nudged(self, place: int) -> tuple[dict[str, float], dict[str, float]] | None:
        for sign in (1.0, -1.0):
            row = self._nominal.copy()
            row[place] += sign * NUDGE * (abs(row[place]) or 1.0)
            try:
                return self._leaves(row)
            except DescriptionError:
                continue
        return None

    def members(self, rows: Array) -> CoreMembers:
        """Return members for the core: column by column, or one by one if other numbers follow from them.

        Parameters
        ----------
        rows : ndarray, shape (n, names)
            SI.
        """
        paths, begun, alone = self._moved
        starts: dict[str, float | Array] = dict(self.drive.core_initial(self.initial))
        if alone:
            names = self.drive.start_names
            columns = {one.name: column for one, column in zip(self.numbers, rows.T, strict=True)}
            starts |= {names[n.removeprefix(INITIAL)]: x for n, x in columns.items() if n.startswith(INITIAL)}
            values = [column for name, column in columns.items() if not name.startswith(INITIAL)]
            return CoreMembers(paths, np.array(values).reshape(len(paths), len(rows)).T.copy(), starts)
        each = [self._leaves(row) for row in rows]
        values = np.array([[numbers[path] for path in paths] for numbers, _ in each]).reshape(len(rows), len(paths))
        starts |= {name: np.array([own[name] for _, own in each], dtype=np.float64) for name in begun}
        return CoreMembers(paths, values, starts)
