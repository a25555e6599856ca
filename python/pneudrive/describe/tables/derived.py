"""Derived defaults: values of a drive that follow from other values if they are not given.

Code that changes a value (a search, the application of a fit) must update the values derived from this value.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from pneudrive import units
from pneudrive.describe.kinds import FLOW, flow_keys
from pneudrive.describe.tables import valve_flow
from pneudrive.describe.tables.friction import ASSUMED_DIGITS, assumed_from

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive


_FRICTION = "cylinder.friction.parameters."


@dataclass(frozen=True)
class Derived:
    """Value derived from other values.

    Attributes
    ----------
    name : str
        Name in the drive file.
    path : str
        Path in the circuit of the drive.
    sources : tuple of str
        Paths of the values on which it depends. These may also be derived.
    value : callable
        Function that returns the derived value, from the values of `sources` in SI.
    digits : int or None
        Number of significant digits to which a description rounds the value. None: not rounded.
    """

    name: str
    path: str
    sources: tuple[str, ...]
    value: Callable[..., float]
    digits: int | None = None


def derived(drive: Drive) -> Iterator[Derived]:
    """Yield the derived values of a drive. Each value comes after the values on which it depends.

    Examples
    --------
    >>> from pneudrive.describe import Drive
    >>> [d.name for d in derived(Drive.load("catalogue:reference"))]
    ['supply.temperature', 'cylinder.wall_temperature']
    """
    for key, (sources, value) in assumed_from(drive.friction).items():
        paths = tuple(f"{_FRICTION}{source}" for source in sources)
        yield Derived(f"friction.{key}", f"{_FRICTION}{key}", paths, value, ASSUMED_DIGITS)
    ambient, supply, valve = "ambient.temperature_k", drive.supply, drive.valve
    if supply.temperature_k is None:
        yield Derived("supply.temperature", "supply.temperature", (ambient,), float)
    if drive.cylinder.wall_temperature_k is None:
        yield Derived("cylinder.wall_temperature", "cylinder.wall_temperature", (ambient,), float)
    if supply.pressure.gauge:
        yield Derived("supply.pressure", "supply.pressure", ("ambient.pressure_pa",), supply.pressure.absolute_pa)
    if valve.nominal_flow_m3_s_anr is not None:
        conductance = partial(valve_flow.conductance_from_nominal_flow, valve.nominal_flow_m3_s_anr)
        yield Derived("valve.conductance", "valve.conductance", tuple(f"valve.{key}" for key in FLOW), conductance)


def derived_in_circuit(circuit: Circuit) -> Iterator[Derived]:
    """Yield the derived numbers of a circuit: pressures given as gauge, and conductances given by other sizes."""
    for name, one in circuit.components.items():
        for key in (parameter["key"] for parameter in one.entry["parameters"]):
            value, *sizes = (getattr(one, one.fields[size]) for size in flow_keys(one.entry, key))
            if isinstance(value, units.Pressure) and value.gauge:
                yield Derived(f"{name}.{key}", f"{name}.{key}", ("ambient.pressure_pa",), value.absolute_pa)
            elif any(sizes):
                sources = tuple(f"{name}.{source}" for source in FLOW)
                conductance = partial(valve_flow.conductance_of, [None, *sizes])
                yield Derived(f"{name}.{key}", f"{name}.{key}", sources, conductance)
