"""Virtual test stands: flow of each path, leakage of shut chambers, published figures of catalogue parts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import product
from typing import Any

import numpy as np

from pneudrive import _core, units
from pneudrive.arrays import Array
from pneudrive.constants import ANR_DENSITY_KG_M3
from pneudrive.datasheet.characteristic import Found, ResultValue, characteristic
from pneudrive.datasheet.characteristics.steady import full_force, least_pressure
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.describe.drive import Drive
from pneudrive.describe.files.catalogue import Entry, entries
from pneudrive.describe.tables.valve_flow import path_of
from pneudrive.errors import CommandError
from pneudrive.simulation.bench_circuit import steady_flow

# --- Virtual test stands: flow of the paths (C and b), leakage of shut chambers, times of a valve.

RATIOS = (1e-4, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)  # of the pressures behind and before
ISOTHERMAL_S = 60.0


def flow_through(
    plant: HeldDrive,
    side: str,
    *,
    inward: bool,
    upstream: float,
    ratios: Iterable[float],
) -> Array:
    """Return the steady mass flow (kg/s) of a path between supply or exhaust and a chamber, for each pressure ratio.

    The valve is fully open; gas enters at the reference temperature.

    Raises
    ------
    CommandError
        No single line leads from a valve to the chamber, or the valve does not have one flow for each direction.
    """
    path = plant.line(side)
    if path is None:
        raise CommandError.of("datasheet.line", name=plant.name, side=side)
    port, line = path
    name = port.partition(".")[0]
    valve = plant.table(name)
    edge = path_of(valve, exhaust=not inward)
    if "flow_table" in valve or not edge:
        raise CommandError.of("datasheet.no_single_flow", valve=name)
    parts = {"edge": {"kind": "fitting"} | edge} | {name: plant.parts[name] for name, *_ in line}
    way = [("edge", "1", "2"), *line]
    if not inward:
        way = [*((n, out, near) for n, near, out in line[::-1]), way[0]]
    return np.array([steady_flow(parts, way, upstream, ratio * upstream, plant.circuit.gas) for ratio in ratios])


def reduce_flow(
    upstream: float, ratios: Array, flows: Array, index: float, density: float
) -> tuple[float, float, float]:
    """Return sonic conductance, critical pressure ratio and largest relative misfit of measured flows.

    The start value of C follows from the choked flow. Then b and C are fitted to all points by least squares on the
    core's flow function.
    """
    from scipy.optimize import least_squares

    first = flows[np.argmin(ratios)] / (density * upstream)

    def misfit(z: Array) -> Array:
        model = [_core.flow_ratio(r, z[1], index) for r in ratios]
        return z[0] * np.array(model) * first * density * upstream / flows - 1.0

    bounds = ([0.1, 0.0], [10.0, 0.99])
    found = least_squares(misfit, [1.0, 0.3], bounds=bounds, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return found.x[0] * first, found.x[1], np.max(np.abs(found.fun))


@characteristic(
    "flow",
    algorithm="virtual test stand: reservoirs at both ends of the path; least squares by the core's flow law",
    standard="ISO 6358-1; with lines ISO 6358-3",
    cites=("iso6358-2013",),
    x="ratio",
    y="flow",
)
def _flows(plant: HeldDrive) -> Found:
    """Flow of the paths (C and b).

    Sonic conductance and critical pressure ratio of each path between valve port and chamber, including lines. They
    are fitted to steady flows over the pressure ratio, with the supply pressure upstream.

    Results
    -------
    path : 1
        valve edge with the lines to the chamber
    ratio : 1
        absolute pressure after the path divided by that before it
    conductance : m3/(s Pa) over path
        sonic conductance C for the drive's gas
    critical_ratio : 1 over path
        critical back-pressure ratio b
    misfit : 1 over path
        largest relative difference of a flow from the fitted function
    """
    before = plant.supply_pa
    ratios, density = np.array(RATIOS), plant.circuit.gas.anr_density_kg_m3
    index = float(getattr(plant.parts[plant.valve], "subsonic_index", 0.5))
    fed = [side for side in plant.sides if plant.line(side)] or plant.sides[:1]  # without chambers open to the ambient
    paths = list(product(fed, (True, False)))
    flows = [flow_through(plant, side, inward=inward, upstream=before, ratios=ratios) for side, inward in paths]
    rows = [reduce_flow(before, ratios, flow, index, density) for flow in flows]
    meaning = f"steady flow, {1e-5 * before:g} bar abs before the path"
    found = {
        "path": [f"{'supply to' if inward else 'exhaust of'} {side}" for side, inward in paths],
        "ratio": ratios,
        "flow": ResultValue(("path", "ratio"), np.array(flows) / density * 6e4, "l/min ANR", meaning),
    }
    return found | dict(zip(("conductance", "critical_ratio", "misfit"), np.array(rows).T, strict=True))


@characteristic(
    "leakage",
    algorithm="simulated with the valve shut",
    standard="form of ISO 10099",
    x="time",
    y="pressure",
)
def _leakage(plant: HeldDrive) -> Found:
    """Leakage of shut chambers.

    Pressure decay of a chamber that was filled from the supply and shut with its line. The piston is at its end, and
    the other chamber at ambient pressure. The gas starts at ambient temperature.

    Results
    -------
    chamber : 1
        the filled chamber; the other one is at ambient pressure
    time : s
        time from shutting the valve
    pressure : Pa over chamber, time
        absolute pressure of the shut chamber
    decay_rate : 1/s over chamber
        relative fall of the pressure in the second half
    fall : Pa over chamber
        fall of the pressure in 60 s
    """
    ambient, kelvin = plant.ambient
    times = np.linspace(0.0, ISOTHERMAL_S, 61)
    curves, plant = [], plant.with_held_valves
    for side in plant.sides:
        levels = {one: plant.supply_pa if one == side else ambient for one in plant.sides}
        given = {f"{plant.piston}.{one}": f"{level!r} Pa abs" for one, level in levels.items()}
        start = plant.circuit.core_initial(given)  # lines start at the pressure of their chamber
        at = plant.stroke_m if side == "a" else 0.0  # pressed against its end
        gas = np.array([(start[f"{node}.pressure_pa"], kelvin) for node in plant.nodes])
        session = plant.session(0.0, at, 0.0, gas)
        found = [session.read(f"{plant.piston}.{side}.pressure_pa")]
        for t in times[1:]:
            session.advance(t)
            found.append(session.read(f"{plant.piston}.{side}.pressure_pa"))
        curves.append(found)
    values = np.array(curves)
    half = times.size // 2  # until then the gas and the piston have settled
    rate = np.log(values[:, half] / values[:, -1]) / (times[-1] - times[half])
    return list(plant.sides), times, values, rate, values[:, 0] - values[:, -1]


# --- Published figures of the catalogue's parts, compared with the results of the drive's simulated test stands.

BEFORE_PA, RATIO = 7e5, 6.0 / 7.0  # nominal flow: from 6 to 5 bar above the 100 kPa of the reference atmosphere
SLOW = 0.05  # m/s: an effective force is one in slow motion


def _alone(drive: Drive) -> Drive:
    """Return a drive under the makers' test conditions: horizontal, with air, without lines and load."""
    beside = ("tubing", "flow_control", "load", "gas", "provenance")
    tables = {name: one for name, one in drive.to_dict().items() if name not in beside}
    return type(drive).model_validate(tables | {"cylinder": tables["cylinder"] | {"incline": "0 deg"}})


def _nominal_flow(drive: Drive) -> float:
    (flow,) = flow_through(HeldDrive(_alone(drive)), "a", inward=True, upstream=BEFORE_PA, ratios=[RATIO])
    return float(flow) / ANR_DENSITY_KG_M3


def _at_6_bar(drive: Drive) -> HeldDrive:
    return HeldDrive(_alone(drive).replace({"supply.pressure": "6 bar gauge"})).static


def _minimum(drive: Drive) -> float:
    plant = HeldDrive(_alone(drive))
    return least_pressure(plant, 1.0) - plant.ambient[0]


#: Printed figure -> its meaning, SI unit (empty for a gauge pressure), and calculation from the drive.
FIGURES: dict[str, tuple[str, str, Callable[[Drive], float]]] = {
    "nominal_flow": ("flow from 6 to 5 bar gauge, virtual test stand", "m^3/s ANR", _nominal_flow),
    "theoretical_force_6bar": ("blocked force at 6 bar gauge", "N", lambda drive: full_force(_at_6_bar(drive), 1.0)[0]),
    "effective_force_6bar": (
        "blocked force minus friction at 50 mm/s, 6 bar gauge",
        "N",
        lambda drive: full_force(_at_6_bar(drive), 1.0, SLOW)[1],
    ),
    "minimum_operating_pressure": ("minimum pressure, above ambient", "", _minimum),
}


def parts_of(drive: Drive) -> Iterator[Entry]:
    """Yield valves and cylinders of the catalogue whose sourced values all equal the values of the drive."""
    own = {key: origin.value for key, origin in drive.origin_of.items()}
    for part in entries().values():
        table = part.kind.partition("/")[0]
        sourced = [value for value in part.values if value.source is not None and value.key != "kind"]
        if part.is_drive or table not in ("valve", "cylinder") or not sourced:
            continue
        if part.kind.partition("/")[2] != getattr(drive, table).kind:
            continue
        keys = (one.key if one.key.startswith("friction.") else f"{table}.{one.key}" for one in sourced)
        pairs = ((own.get(key), one.value) for key, one in zip(keys, sourced, strict=True))
        if all(value in (printed, str(printed).partition("/")[2]) for value, printed in pairs):
            yield part


@characteristic(
    "published",
    definition="Published figures of the parts of this drive, and the figures of the drive: "
    + "; ".join(f"{key.replace('_', ' ')}: {meaning}" for key, (meaning, *_) in FIGURES.items())
    + ".",
    algorithm="the characteristics of this list, under the conditions of the print",
)
def _published(plant: HeldDrive) -> Found:
    """Printed figures of the parts.

    Results
    -------
    figure : 1
        part, figure and source
    printed : SI over figure
        value printed by the maker, in SI
    computed : SI over figure
        value computed for this drive, in SI
    difference : 1 over figure
        computed over printed value, minus 1
    """  # noqa: D401 - a title
    drive: Any = plant.described
    rows = []
    for part in parts_of(drive) if isinstance(drive, Drive) else ():
        for figure in part.printed:
            if figure.key in FIGURES:
                (_, unit, compute), printed = FIGURES[figure.key], figure.value
                title = f"{part.name}: {figure.key.replace('_', ' ')} {printed} [{figure.source}]"
                value = units.parse(printed, unit) if unit else units.parse_pressure(printed).value_pa
                rows.append((title, value, compute(drive)))
    if not rows:
        raise CommandError(f"the catalogue has no printed figure of a part of {plant.name}")
    titles, printed, computed = zip(*rows, strict=True)
    return titles, printed, computed, np.array(computed) / printed - 1.0
