"""Numbers of a drive's circuit by their names in the drive file, and the gas of its tubes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe.kinds import component_kinds

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

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
FRICTION = "cylinder.friction."


def numbers(form: dict[str, Any]) -> Iterator[tuple[str, str, float, dict[str, Any]]]:
    """Yield name in the drive file, path, value and the core's entry of each number of a form except friction.

    The entry of a number without derivatives is marked ``discrete``.
    """
    for component in form["components"]:
        own, kind = component["name"], component_kinds()[component["kind"]]
        rows = {row["key"]: row | {"discrete": row["key"] in kind["discrete"]} for row in kind["parameters"]}
        for key, value in component["numbers"].items():
            yield f"{_TABLES.get(own, own)}.{_KEYS.get(key, key)}", f"{own}.{key}", value, rows[key]


def place(form: dict[str, Any], path: str) -> tuple[dict[str, Any], str]:
    """Return the table and the key of a path in a circuit's form."""
    own, _, key = path.partition(".")
    component = next((one for one in form["components"] if one["name"] == own), None)
    if component is None:
        return form[own], key
    if not path.startswith(FRICTION):
        return component["numbers"], key
    *tables, key = key.split(".")
    for table in tables:
        component = component[table]
    return component, key


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
