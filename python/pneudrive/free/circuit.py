"""Numbers of a circuit by name, and circuits for any values of some of them."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe.parameters import parameter_quantities
from pneudrive.describe.system import compiled
from pneudrive.describe.tables.starts import start_mark
from pneudrive.errors import CommandError, DescriptionError, nearest
from pneudrive.free.parameters import INITIAL, Parameter, Varied, field_marks, mark_unit

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from pneudrive._core import Circuit as CoreCircuit
    from pneudrive.describe.circuit import Circuit

    Array = NDArray[np.float64]

#: Path of a parameter of a friction law in a component of the core's form.
FRICTION = "friction.parameters."
#: Names in a design -> keys of the circuit file.
AMBIENT = {"ambient.pressure": "ambient.pressure_pa", "ambient.temperature": "ambient.temperature_k"}
#: Relative step of the differences that give what follows from a number.
STEP = 1e-5


def circuit_numbers(circuit: Circuit) -> dict[str, Varied]:
    """Return every number of a circuit and of its start state that may vary, by name.

    Names are those of components and their keys, ``left.bore``, ``left.friction.coulomb``. Further names are
    ``ambient.pressure``, ``ambient.temperature`` and ``initial.left.position``.
    """
    found = {}
    for name, one in circuit.components.items():
        written = field_marks(type(one))
        for key in one.numbers(circuit.ambient.pressure_pa):
            found[f"{name}.{key}"] = written[key]
        friction = getattr(one, "friction", None)
        if friction is not None:
            quantities = parameter_quantities(friction.entry)
            found |= {f"{name}.friction.{key}": quantities[key] for key in friction.parameters}
    ambient = field_marks(type(circuit.ambient))
    found |= {name: ambient[name.partition(".")[2]] for name in AMBIENT}
    starts = {key: name.rpartition(".")[2] for key, name in circuit.start_names.items()}
    found |= {f"{INITIAL}{key}": start_mark(last)[1] for key, last in starts.items() if last != "contact_age_s"}
    return {name: Varied(name, mark_unit(mark), mark) for name, mark in found.items()}


class CircuitFamily:
    """Circuits for any values of some numbers, with the numbers that follow from them.

    Parameters
    ----------
    circuit : Circuit
    names : sequence of str
        See `circuit_numbers`, without the start state.

    Attributes
    ----------
    parameters : list of Parameter
    paths : list of str
        Numbers of the core's form: the named ones, then those that follow from them.

    Raises
    ------
    CommandError
        A name is unknown or repeated.
    """

    def __init__(self, circuit: Circuit, names: Sequence[str]) -> None:
        self.circuit = circuit
        known = {name: one for name, one in circuit_numbers(circuit).items() if not name.startswith(INITIAL)}
        for name in names:
            if name not in known:
                raise CommandError(f"{name} is not a number of this circuit", remedy=nearest(name, known))
        if len(set(names)) < len(names):
            raise CommandError("a parameter is given twice", value=", ".join(names))
        self.numbers = [known[name] for name in names]
        values = self._at(circuit)
        self.parameters = [
            Parameter(number.name, path, number.unit, values[path], -np.inf, np.inf, abs(values[path]) or 1.0)
            for number in self.numbers
            if (path := core_path(number.name))
        ]
        self.paths = [parameter.core for parameter in self.parameters]
        start = np.array([parameter.value for parameter in self.parameters])
        for place in range(len(start)):
            low, high = self._ends(start, place)
            self.paths += [path for path, value in high.items() if value != low[path] and path not in self.paths]

    @staticmethod
    def _at(circuit: Circuit) -> dict[str, float]:
        return dict(core_numbers(json.loads(circuit.core_json())))

    def _with(self, values: Array) -> Circuit:
        changes = {
            one.name if one.name in AMBIENT else f"components.{one.name}": one.written(float(value))
            for one, begun, value in zip(self.numbers, self.parameters, values, strict=True)
            if value != begun.value
        }
        return self.circuit.replace(changes) if changes else self.circuit

    def _ends(self, values: Array, place: int) -> tuple[dict[str, float], dict[str, float]]:
        """Return the numbers of the core's form a step below and a step above a value, or at it where it is a bound."""
        step = np.zeros_like(values)
        step[place] = STEP * self.parameters[place].size

        def end(sign: float) -> dict[str, float]:
            try:
                return self._at(self._with(values + sign * step))
            except DescriptionError:
                return self._at(self._with(values))

        return end(-1.0), end(1.0)

    def core(self, values: Array) -> CoreCircuit:
        """Return the core's circuit with these values.

        Raises
        ------
        DescriptionError
            The values are not valid.
        """
        return compiled(self._with(values).core_json())

    def by_free(self, values: Array) -> Array:
        """Return the derivatives of the numbers at `paths` by the named numbers, shape (paths, names)."""
        count = len(self.parameters)
        out = np.zeros((len(self.paths), count))
        out[:count] = np.eye(count)
        for place in range(count) if len(self.paths) > count else ():
            low, high = self._ends(values, place)
            width = high[self.paths[place]] - low[self.paths[place]]
            out[count:, place] = [(high[path] - low[path]) / width for path in self.paths[count:]]
        return out


def core_path(name: str) -> str:
    """Return the path of a number in the core's form.

    Examples
    --------
    >>> core_path("left.friction.coulomb"), core_path("left.bore"), core_path("ambient.pressure")
    ('left.friction.parameters.coulomb', 'left.bore', 'ambient.pressure_pa')
    """
    of, _, key = name.partition(".")
    if name in AMBIENT:
        return AMBIENT[name]
    return f"{of}.{FRICTION}{key.removeprefix('friction.')}" if key.startswith("friction.") else name


def core_numbers(form: dict[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield the numbers of the core's form in which members may differ, by their paths."""
    yield from ((path, form["ambient"][path.partition(".")[2]]) for path in AMBIENT.values())
    for one in form["components"]:
        yield from ((f"{one['name']}.{key}", value) for key, value in one["numbers"].items() if math.isfinite(value))
        for key, value in ((one["friction"] or {}).get("parameters") or {}).items():
            yield f"{one['name']}.{FRICTION}{key}", value
