"""A described system: its circuit in the core's form, and the names of the circuit's variables in its file."""

from __future__ import annotations

import json
import re
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from pneudrive.errors import DescriptionError, package_table

if TYPE_CHECKING:
    from pneudrive._core import Circuit as CoreCircuit
    from pneudrive.arrays import Plain

    ShortNames = tuple[str, tuple[tuple[str, str], ...], bool]

#: Component of a drive whose name is left out.
PISTON = "cylinder"
#: Names of a drive -> names of its circuit.
DRIVE_NAMES = package_table(__file__, "drive_names.toml")
#: Name in the circuit -> name of the drive, for components other than the cylinder.
_OUTSIDE = {full: short for short, full in DRIVE_NAMES.items() if not full.startswith(f"{PISTON}.")}
#: Units that end the keys of a drive in SI, longest first.
_UNITS = ("_m3_s_pa", "_w_m2_k", "_n_s_m", "_n_m", "_rad", "_m3", "_kg", "_pa", "_k", "_m", "_n")


class System(NamedTuple):
    """A described system.

    Attributes
    ----------
    json : str
        Circuit in the core's form, in SI.
    names : tuple, optional
        Component whose name is omitted, pairs of short and full name, and whether columns without a short name are
        omitted.
    """

    json: str
    names: ShortNames | None = None

    @classmethod
    def of_drive(cls, form: Plain) -> System:
        """Return the system of a drive without lines, from its tables in SI (`Drive.short_form`)."""
        return cls(json.dumps(expanded_drive(form), sort_keys=True), drive_names(only=True))

    def compiled(self) -> CoreCircuit:
        """Return the core's circuit; each system is compiled once.

        Raises
        ------
        DescriptionError
            The core rejects the system.
        """
        return compiled(self.json, self.names)


def drive_names(*, only: bool) -> ShortNames:
    """Return the table of names of a drive; `only` leaves out columns without a short name."""
    return PISTON, tuple(DRIVE_NAMES.items()), only


@lru_cache(maxsize=256)
def compiled(core_json: str, names: ShortNames | None = None) -> CoreCircuit:
    """Return the core's form of a circuit; each description is compiled once.

    Raises
    ------
    DescriptionError
        The core rejects the circuit.
    """
    from pneudrive import _core

    try:
        return _core.Circuit(core_json, names)
    except ValueError as error:
        refusal = DescriptionError(str(error))
        known = [one["name"] for one in json.loads(core_json)["components"]]
        named = re.match(rf"({'|'.join(map(re.escape, known))})\b(?:\.(\w+))?", str(error))
        if named and named[1]:
            refusal.key = f"components.{named[1]}.{named[2] or ''}".rstrip(".")
        raise refusal from None


def expanded_drive(form: Plain) -> Plain:
    """Return the circuit of a drive without lines, both in the core's form.

    Parameters
    ----------
    form : dict
        Tables of the drive file in SI: keys carry units, ``{"cylinder": {"bore_m": 0.025, ...}, ...}``.
    """
    cylinder, valve, load = dict(form["cylinder"]), dict(form["valve"]), dict(form.get("load", {}))
    choices = {"chamber_law": cylinder.pop("chamber_law", "energy-balance")}
    stops = {f"end_stop_{key}": value for key, value in cylinder.pop("end_stop", {}).items()}
    kind, spring = cylinder.pop("kind"), load.pop("spring", None)
    components: list[Plain] = [
        {"name": "supply", "kind": "reservoir", "numbers": _numbers(form["supply"])},
        {"name": "valve", "kind": f"valve/{valve.pop('kind')}", "numbers": _numbers(valve)},
        {
            "name": PISTON,
            "kind": f"cylinder/{kind}",
            "numbers": _numbers(cylinder | stops),
            "choices": choices,
            "friction": form["friction"],
        },
        {"name": "load", "kind": "load", "numbers": _numbers(load)},
    ]
    rod = [f"{PISTON}.rod", "load.1"]
    if spring is not None:
        components.append({"name": "spring", "kind": "spring", "numbers": _numbers(spring)})
        rod.append("spring.1")
    joints = [["supply.1", "valve.1"], ["valve.4", f"{PISTON}.a"], ["valve.2", f"{PISTON}.b"], rod]
    return {"gas": form["gas"], "ambient": form["ambient"], "components": components, "joints": joints}


def _numbers(table: Plain) -> dict[str, float]:
    return {without_unit(key): value for key, value in table.items() if value is not None}


@lru_cache(maxsize=256)
def without_unit(key: str) -> str:
    """Return a key of a drive in SI without its unit."""
    return next((key.removesuffix(unit) for unit in _UNITS if key.endswith(unit)), key)


def short_name(name: str, piston: str = PISTON) -> str:
    """Return the drive's name of a variable of its circuit. Other names stay unchanged.

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
    return _OUTSIDE.get(name, name)
