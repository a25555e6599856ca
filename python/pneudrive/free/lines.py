"""Drives with tubes or flow controls: numbers and runs of their circuit, with the names of a drive."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe.components import component_kinds
from pneudrive.describe.derived import derived
from pneudrive.session import short_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from pneudrive._core import Circuit as CoreCircuit
    from pneudrive._core import Shooting, Shot
    from pneudrive.describe.derived import Derived
    from pneudrive.describe.drive import Drive

    Array = NDArray[np.float64]

#: First entries of a drive's start.
_STARTS = ("position_m", "velocity_m_s", "pressure_a_pa", "temperature_a_k", "pressure_b_pa", "temperature_b_k")
#: Component of a drive's circuit -> its table in the drive file.
_TABLES = {"spring": "load.spring"} | {
    f"{part}_{chamber}": f"{table}.{chamber}"
    for part, table in (("tube", "tubing"), ("flow_control", "flow_control"))
    for chamber in "ab"
}
#: Keys of a cylinder in a separate table of the drive file.
_KEYS = {
    "dead_volume_a": "dead_volume.a",
    "dead_volume_b": "dead_volume.b",
    "end_stop_stiffness": "end_stop.stiffness",
    "end_stop_damping": "end_stop.damping",
    "end_stop_damping_depth": "end_stop.damping_depth",
}
_FRICTION = "cylinder.friction."


def numbers(drive: Drive) -> Iterator[tuple[str, str, float, dict[str, Any]]]:
    """Yield name in the drive file, path in the core, value and the core's entry of each number except friction.

    The entry of a number without derivatives is marked ``discrete``.
    """
    for component in json.loads(drive.circuit.core_json())["components"]:
        own, kind = component["name"], component_kinds()[component["kind"]]
        rows = {row["key"]: row | {"discrete": row["key"] in kind["discrete"]} for row in kind["parameters"]}
        for key, value in component["numbers"].items():
            yield f"{_TABLES.get(own, own)}.{_KEYS.get(key, key)}", f"{own}.{key}", value, rows[key]


def circuit_path(path: str, keys: Sequence[str]) -> str | None:
    """Return the path in a drive's circuit for a path in the core's form of a drive; None if the circuit has none.

    Examples
    --------
    >>> circuit_path("cylinder.wall_temperature_k", ["cylinder.wall_temperature"])
    'cylinder.wall_temperature'
    >>> circuit_path("friction.parameters.coulomb", [])
    'cylinder.friction.parameters.coulomb'
    """
    if path.startswith("friction."):
        return f"cylinder.{path}"
    return next((key for key in keys if path.startswith(f"{key}_") or path == key), None)


def derived_in_circuit(drive: Drive) -> Iterator[Derived]:
    """Return the derived values by the paths of the circuit. The core derives missing values."""
    keys = ["ambient.pressure_pa", "ambient.temperature_k", *(path for _, path, *_ in numbers(drive))]
    for one in derived(drive):
        path, *sources = (circuit_path(path, keys) for path in (one.path, *one.sources))
        if path is not None and None not in sources:
            yield replace(one, path=path, sources=tuple(source for source in sources if source is not None))


def place(form: dict[str, Any], path: str) -> tuple[dict[str, Any], str]:
    """Return the table and the key of a path in a circuit's form."""
    own, _, key = path.partition(".")
    component = next((one for one in form["components"] if one["name"] == own), None)
    if component is None:
        return form[own], key
    if not path.startswith(_FRICTION):
        return component["numbers"], key
    *tables, key = key.split(".")
    for table in tables:
        component = component[table]
    return component, key


class Lines:
    """Drive with lines for multiple shooting, with the interface of the core's drive.

    A start has position, velocity, pressures and temperatures of the chambers and the inner states of friction, as for
    a drive, then the gas of tubes and joints.
    """

    def __init__(self, core: CoreCircuit) -> None:
        self._core = core
        names = core.segment_names
        short = [short_name(name) for name in names]
        own = [short.index(name) for name in _STARTS]
        inner = [i for i, name in enumerate(names) if name.startswith("cylinder.") and i not in own]
        self._order = np.array([*own, *inner, *sorted({*range(len(names))} - {*own, *inner})])
        self.start_names = [short[i] for i in self._order]
        self._columns = {short_name(name): name for name in core.columns}

    def shoot(self, asked: Shooting, look: Callable[[float], object] | None = None) -> Shot:
        """Run segments, as `_core.Drive.shoot`."""
        initial = np.empty_like(asked["initial"])
        initial[:, self._order] = asked["initial"]
        by_start = asked.get("with_initial", False)
        by_start = range(self._order.size) if by_start is True else by_start or ()
        own: Shooting = {
            **asked,
            "initial": initial,
            "with_initial": [int(self._order[i]) for i in by_start],
            "outputs": [self._columns[name] for name in asked["outputs"]],
        }
        found = self._core.shoot("valve.command", own, look)
        found["ends"] = found["ends"][:, self._order]
        found["end_sensitivities"] = found["end_sensitivities"][:, self._order]
        found["start_names"] = self.start_names
        return found


def at_rest(name: str, pressures: tuple[Array, Array] | tuple[float, float], temperature_k: float) -> Array | float:
    """Return the start value of an inner state of friction or of the gas of a tube, for pressures of the chambers, Pa.

    Examples
    --------
    >>> at_rest("tube_b.pressure_pa", (3e5, 2e5), 293.15), at_rest("presliding_deflection_m", (3e5, 2e5), 293.15)
    (200000.0, 0.0)
    """
    if name.endswith(".pressure_pa"):
        return pressures["ab".index(beside(name))]
    return temperature_k if name.endswith(".temperature_k") else 0.0


def beside(name: str) -> str:
    """Return the chamber on the side of a tube's or a joint's gas.

    Examples
    --------
    >>> beside("tube_a.cell_0.pressure_pa"), beside("valve.2.pressure_pa")
    ('a', 'b')
    """
    own = name.partition(".")[0]
    return "a" if own.endswith("_a") or name.startswith("valve.4.") else "b"
