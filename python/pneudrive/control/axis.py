"""Checks whether the controllers can model a drive."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.describe.files import toml
from pneudrive.errors import DescriptionError, invalid

if TYPE_CHECKING:
    from pneudrive.arrays import Keyed, Pair
    from pneudrive.describe.circuit import Circuit

#: Longest lag of a command that a controller predicts, s (assumed: slow valves need 0.1 s).
MOST_LAG_S = 0.2
_DOUBLE_ACTING = ("cylinder/rodless", "cylinder/through-rod", "cylinder/single-rod")
_CROSSED = ("valve/proportional-5/3", "valve/switching-5/3")
#: Parameters that change the motion but that no controller models: kind of component -> prefix of a key -> effect.
_UNKNOWN = {
    "cylinder/": {"cushion_": "cushion", "leakage": "leakage"},
    "valve/proportional": {"stroke_time": "stroke_time"},
    "reservoir/": {"amplitude": "amplitude"},
}


def check_axis(belief: Circuit, plant: Keyed) -> list[str]:
    """Reject a circuit that the controllers cannot model.

    Parameters
    ----------
    belief : Circuit
    plant : dict
        The core's model of the drive; ``cylinder`` and ``valves`` are names of components.

    Returns
    -------
    list of str
        Parts of cylinder, valves and supply that controllers do not model, such as ``cylinder.cushion``.

    Raises
    ------
    DescriptionError
        The cylinder is single-acting or a tandem, or ports 4 and 2 of its 5/3 valve do not lead to chambers a and b.
    """
    kinds = {name: one["kind"] for name, one in belief.core_parts.items()}
    joints = belief.wiring.core()
    cylinder, valves = plant["cylinder"], plant["valves"]
    ends = {cylinder, *valves, *(name for name, kind in kinds.items() if kind.startswith("reservoir"))}
    if kinds[cylinder] not in _DOUBLE_ACTING:
        raise refused(belief, f"{cylinder}.kind", "control.no-model", name=cylinder, kind=kinds[cylinder])
    if plant["lag_s"] > MOST_LAG_S:
        raise refused(belief, f"{valves[0]}.delay", "control.late", lag=plant["lag_s"], most=MOST_LAG_S)
    for port, chamber in (("4", "a"), ("2", "b")) if kinds[valves[0]] in _CROSSED else ():
        found = _chambers(joints, f"{valves[0]}.{port}", cylinder, ends)
        if f"{cylinder}.{chamber}" not in found:
            to = " and ".join(sorted(found)) or "no chamber"
            names = {"valve": valves[0], "port": port, "to": to, "cylinder": cylinder}
            raise refused(belief, "", "control.crossed", **names)
    return [
        f"{name}.{what}"
        for name, one in belief.core_parts.items()
        for kind, known in _UNKNOWN.items()
        for begin, what in known.items()
        if one["kind"].startswith(kind)
        and any(key.startswith(begin) and value > 0.0 for key, value in one["numbers"].items())
    ]


def refused(belief: Circuit, key: str, message: str, **values: object) -> DescriptionError:
    """Return an error with the line of a component's key, or of the connections, in the file of a drive or circuit."""
    file = belief.source_file
    if not Path(file).is_file():
        return DescriptionError.of(message, where=belief.name, **values)
    tables, text = toml.read(file)
    place = f"components.{key}" if "components" in tables else key
    return toml.located(invalid(place if key else "connections", message, **values), file, text)


def _chambers(joints: list[list[str]], port: str, cylinder: str, ends: set[str]) -> set[str]:
    """Return the chambers to which a port leads. The search does not pass through `ends` and the ambient."""
    front, reached = [joint for joint in joints if port in joint], list[list[str]]()
    while front := [joint for joint in front if "ambient" not in joint and joint not in reached]:
        reached += front
        through = {_component(one) for joint in front for one in joint} - ends
        front = [joint for joint in joints if any(_component(one) in through for one in joint)]
    return {one for joint in reached for one in joint if _component(one) == cylinder}


def _component(port: str) -> str:
    return port.rpartition(".")[0]


def supply_of(core_json: str) -> Pair:
    """Return absolute pressure (Pa) and temperature (K) of the supply of a circuit in the core's form."""
    form = json.loads(core_json)
    numbers = next(one["numbers"] for one in form["components"] if one["kind"].startswith("reservoir"))
    return numbers["pressure"], numbers.get("temperature", form["ambient"]["temperature_k"])
