"""Kinds of components as the core lists them, and conditions on their parameters."""

from __future__ import annotations

from functools import lru_cache
from types import MappingProxyType

from pneudrive import _core
from pneudrive.arrays import Keyed, Plain
from pneudrive.describe.tables import valve_flow

#: Unit of an absolute or gauge pressure in the core's list; a pressure difference has the plain unit.
STATED = "Pa abs"
#: Input of a component for a command in -1 .. 1.
COMMAND = "command"
#: Key of the critical pressure ratio of a flow path.
RATIO = "critical_pressure_ratio"
FLOW = (RATIO, "subsonic_index")


@lru_cache(maxsize=1)
def component_kinds() -> MappingProxyType[str, Plain]:
    """Return the core's entry of each kind of component, by name.

    Each entry is a dict with title, doc, sources, ports, parameters, choices, friction, inputs and outputs.
    """
    return MappingProxyType({entry["kind"]: dict(entry) for entry in _core.components()})


def is_needed(parameter: Keyed, given: Keyed | None = None) -> bool:
    """Return whether a description must give a parameter: it has no default and is not derived from other parameters.

    Some parameters are needed unless another key or choice is given. Without `given`, the result for them is False.
    """
    if parameter["within"] or not is_bare(parameter):
        return False
    key, equals, option = parameter["unless"].partition(" = ")
    if not key or given is None:
        return not key
    return given.get(key) != option if equals else given.get(key) is None


def acts(parameter: Keyed, given: Keyed) -> bool:
    """Return whether a parameter has an effect, if `given` has the other numbers and the choices."""
    key, equals, option = parameter["only"].partition(" = ")
    if key.startswith("no "):
        return given.get(key.removeprefix("no ")) is None
    return not key or (given.get(key) == option if equals else bool(given.get(key)))


def is_bare(parameter: Keyed) -> bool:
    """Return whether a parameter has no default and is not derived from other parameters."""
    return parameter["default"] is None and not parameter["follows"]


def flow_keys(entry: Keyed, key: str) -> tuple[str, ...]:
    """Return the alternative keys for the size of a flow path. For other parameters, return the key itself."""
    keys = {p["key"] for p in entry["parameters"]}
    if key.endswith("conductance") and keys.issuperset(FLOW):
        return tuple(key.removesuffix("conductance") + name for name in valve_flow.FLOW_KEYS)
    return (key,)
