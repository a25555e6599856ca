"""Warnings for a run: states outside the stated range of the model, condensation of water, and ice in the silencer.

The warnings do not change the simulation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.constants import AIR_GAS_CONSTANT_J_KG_K, MOLAR_GAS_CONSTANT_J_MOL_K, ZERO_CELSIUS_K
from pneudrive.describe.tables.parts import CAPACITY_CELSIUS, CAPACITY_EXCESS, VIRIAL
from pneudrive.describe.tables.starts import angles, coordinates, pose_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.arrays import Array, Keyed
    from pneudrive.describe import Circuit
    from pneudrive.simulation.start import DriveOrCircuit

#: Largest absolute pressure of the model, Pa (assumed). Flow functions and cylinders are specified for less.
HIGHEST_PA = 20e5
#: Excess of the heat capacity over the model's value, as a fraction, above which a note is given (assumed).
CAPACITY_OFF = 0.02
#: Largest deviation from the gas law, as a fraction of the pressure: for an ideal gas, and for the law with the second
#: virial coefficient (assumed).
IDEAL_OFF, VIRIAL_OFF = 0.05, 0.1
#: Fraction of the stroke by which rounding may move a piston beyond its end.
ROUNDED = 1e-9


class GasVolume(NamedTuple):
    """Pressure and temperature of the gas in one volume during a run, and the name of the pressure column."""

    column: str
    name: str
    pressure_pa: Any
    temperature_k: Any


def warnings(described: DriveOrCircuit, columns: Keyed) -> list[str]:
    """Return one warning for each limit that a run exceeds, with time, place and limit.

    Parameters
    ----------
    described : Drive or Circuit
        Simulated drive or circuit.
    columns : mapping
        Columns of the trajectory.
    """
    places = list(gas_volumes(columns))
    found = [] if described.gas.dew_point_k is None else [*_water(described, columns, places)]
    found += _gas_limits(described, columns["time_s"], places)
    if hasattr(described, "components"):
        found += _mechanical_limits(described, columns)  # type: ignore[arg-type] - a circuit
    return [*found, *_ice(described, columns)]


def gas_volumes(columns: Keyed) -> Iterator[GasVolume]:
    """Yield the gas of each volume that has a pressure and a temperature."""
    for column, pressure in columns.items():
        temperature = columns.get(column.replace("pressure", "temperature").removesuffix("_pa") + "_k")
        if temperature is not None and "pressure" in column:
            chamber = column.removeprefix("pressure_").removesuffix("_pa")
            name = column.removesuffix(".pressure_pa") if "." in column else f"chamber {chamber}"
            yield GasVolume(column, name, pressure, temperature)


def _gas_limits(described: DriveOrCircuit, time_s: Any, places: list[GasVolume]) -> Iterator[str]:  # noqa: ANN401 - array or column
    """Yield a warning for a high pressure, for a hot gas, and for a gas that deviates from its gas law."""
    high = [place for place in places if place.pressure_pa.max() > HIGHEST_PA]
    if high:
        worst = max(high, key=lambda place: place.pressure_pa.max())
        when = time_s[int(worst.pressure_pa.argmax())]
        rest = [place.name for place in high if place is not worst]
        others = f" (also {', '.join(rest[:3])}{', ...' if len(rest) > 3 else ''})" if rest else ""
        yield (
            f"the pressure in {worst.name} reaches {1e-5 * worst.pressure_pa.max():.3g} bar abs at {when:.4g} s"
            f"{others}: the model is valid up to {1e-5 * HIGHEST_PA:g} bar abs (assumed)"
        )
    gas = described.gas  # air is recognised by its gas constant
    is_air = gas.name in (None, "air") and gas.gas_constant_j_kg_k == AIR_GAS_CONSTANT_J_KG_K
    name = "air" if is_air else gas.name or ""

    # Heat capacity of the hottest gas: the model has a constant one.
    excesses = CAPACITY_EXCESS.get(name)
    if excesses is not None and places:
        worst = max(places, key=lambda place: place.temperature_k.max())
        hottest = worst.temperature_k.max()
        excess = np.interp(hottest - ZERO_CELSIUS_K, CAPACITY_CELSIUS, excesses)
        if excess > CAPACITY_OFF:
            when = time_s[int(worst.temperature_k.argmax())]
            yield (
                f"the gas in {worst.name} reaches {_celsius(hottest)} at {when:.4g} s, "
                f"where its heat capacity is {100.0 * excess:.1f} % higher than in the model"
            )

    # Contribution of the second virial coefficient.
    is_ideal = gas.model == "ideal"
    most = IDEAL_OFF if is_ideal else VIRIAL_OFF
    a, b, c = VIRIAL.get("nitrogen" if is_air else name, (0.0, 0.0, 0.0))  # air is taken as nitrogen
    deviation, off = None, 0.0
    for place in places:
        for row in {int(place.pressure_pa.argmax()), int(place.temperature_k.argmin())}:
            pressure, temperature = place.pressure_pa[row], place.temperature_k[row]
            second = 1e-6 * (a - b * math.exp(c / max(temperature, 60.0)))  # coefficient B [libretexts-virial]
            share = second * pressure / (MOLAR_GAS_CONSTANT_J_MOL_K * temperature)
            if abs(share) > max(abs(off), most):
                deviation, off = (place.name, pressure, temperature, row), share
    if deviation is not None:
        name, pressure, temperature, row = deviation
        remedy = '; gas.model = "virial" includes this coefficient' if is_ideal and gas.name in VIRIAL else ""
        yield (
            f"the gas in {name} deviates from its law at {time_s[row]:.4g} s: at {1e-5 * pressure:.3g} bar abs and "
            f"{_celsius(temperature)}, the second virial coefficient adds {100.0 * abs(off):.2g} % of the pressure; "
            f"the {gas.model} gas law is valid up to {100.0 * most:g} % (assumed){remedy}"
        )


def _celsius(temperature_k: float, digits: int = 1) -> str:
    return f"{temperature_k - ZERO_CELSIUS_K:.{digits}f} degC"


def _mechanical_limits(circuit: Circuit, columns: Keyed) -> Iterator[str]:
    """Yield a warning for each piston that leaves its stroke, and for each platform that passes a singular pose."""
    for name, component in circuit.components.items():
        position = columns.get(f"{name}.position_m")
        if component.kind != "piston" or position is None:
            continue
        stroke = component.stroke_m  # type: ignore[attr-defined] - of this kind
        beyond = np.maximum(-position, position - stroke)
        row = int(beyond.argmax())
        if beyond[row] > ROUNDED * stroke:
            when = columns["time_s"][row]
            yield (
                f"{name} leaves its stroke: it is at {1e3 * position[row]:.6g} mm at {when:.4g} s, and its stroke is "
                f"0 to {1e3 * stroke:g} mm. A piston has no end stops: use a cylinder, or connect stops to the piston"
            )
    kinds = {one.kind for one in circuit.components.values() if one.kind.startswith("platform/")}
    for platform in circuit.system.compiled().platforms if kinds - {"platform/driven"} else ():
        names = [f"{platform.name}.{key}" + ("" if key.endswith("_m") else "_rad") for key in platform.coordinates]
        q = coordinates(platform, np.column_stack([np.fromiter(columns[name], float) for name in names]))
        # In a singular pose, the determinant of the Jacobian changes its sign.
        signs = np.linalg.slogdet(platform.evaluate(q, np.zeros_like(q))["jacobian"])[0]
        rows = np.flatnonzero(signs[1:] * signs[:-1] <= 0.0)
        if rows.size:
            pose = pose_text(platform, angles(platform, q)[rows[0]])
            yield (
                f"{platform.name} passes a singular pose at {columns['time_s'][rows[0]]:.4g} s, near {pose}: the legs "
                "do not hold the platform there, and a real platform may deviate. Keep away from this pose, or "
                "move the joints"
            )


# --- Water in the gas, which may condense or freeze.

#: Keys of the sources in references.bib.
SOURCES = ("wmo2008", "sonntag1990")
#: e_s = A exp(B t/(C + t)), Pa, with t in degC, over water and over ice: A, B, C. Source: [wmo2008], Annex 4.B.
WATER, ICE = (611.2, 17.62, 243.12), (611.2, 22.46, 272.62)
#: Ratio to saturation pressure up to which no warning is given, because the formula is not exact (assumed).
SATURATED = 1.01


def saturation_pressure(temperature_k: Array | float) -> Array:
    """Return the saturation pressure of water vapour in Pa: over water, or over ice below 0 degC.

    Parameters
    ----------
    temperature_k : array or float
        Temperatures in K, of any shape.

    Examples
    --------
    >>> float(saturation_pressure(293.15).round(1))
    2332.6
    """
    t = np.asarray(temperature_k, dtype=float) - ZERO_CELSIUS_K
    over_water, over_ice = (a * np.exp(b * t / (c + t)) for a, b, c in (WATER, ICE))
    return np.where(t >= 0.0, over_water, over_ice)


def dew_point(vapour_pressure_pa: float) -> float:
    """Return the dew point in K of a vapour pressure in Pa. Below 0 degC, return the frost point.

    Examples
    --------
    >>> round(dew_point(2332.6), 2)
    293.15
    """
    a, b, c = WATER if vapour_pressure_pa >= WATER[0] else ICE
    log = math.log(vapour_pressure_pa / a)
    return ZERO_CELSIUS_K + c * log / (b - log)


def _water(described: DriveOrCircuit, columns: Keyed, places: list[GasVolume]) -> Iterator[str]:
    """Yield warnings on condensation in a run: for each volume, at most one for the wall and one for the gas.

    All gas is assumed to come from the supply.
    """
    if (share := water_share(described)) is None:
        return
    for place in places:
        time_s = columns["time_s"]
        # Wall temperature: a column for a wall that stores heat, otherwise a number.
        own = place.column.partition(".")[0] if "." in place.column else "cylinder"
        wall_k = columns.get(f"{own}.wall_temperature_k")
        wall_k = getattr(described.circuit.components[own], "wall_temperature_k", None) if wall_k is None else wall_k
        wall_k = described.ambient.temperature_k if wall_k is None else wall_k
        vapour, saturated = share * place.pressure_pa, saturation_pressure(place.temperature_k)
        on_wall = vapour / saturation_pressure(wall_k)
        at = int(on_wall.argmax())
        if on_wall[at] > SATURATED:
            wall = np.broadcast_to(wall_k, vapour.shape)[at]
            what = "ice may form" if wall < ZERO_CELSIUS_K else "water may condense"
            yield (
                f"{what} on the wall of {place.name}: {_when(time_s[at], place.pressure_pa[at])}, the gas has the "
                f"{_point(vapour[at])}, and the wall is at {_celsius(wall)}"
            )
        in_gas = vapour / saturated
        at = int(in_gas.argmax())
        if in_gas[at] > SATURATED:
            gas, in_exhaust = place.temperature_k[at], share * described.ambient.pressure_pa / saturated
            what = "fog or ice" if gas < ZERO_CELSIUS_K else "fog"
            outside = " and in its exhaust" if in_exhaust.max() > SATURATED else ""
            yield (
                f"{what} may form in {place.name}{outside}: {_when(time_s[at], place.pressure_pa[at])}, the gas is at "
                f"{_celsius(gas)}, below its {_point(vapour[at])}"
            )


def water_share(drive: DriveOrCircuit) -> float | None:
    """Return the molar fraction of water vapour in the gas. None without a dew point."""
    pressure, dew = drive.dew_point_pressure_pa, drive.gas.dew_point_k
    return None if pressure is None or dew is None else float(saturation_pressure(dew)) / pressure


def _when(time_s: float, pressure_pa: float) -> str:
    return f"at {time_s:.3g} s and {pressure_pa / 1e5:.3g} bar abs"


def _point(vapour_pressure_pa: float) -> str:
    dew = dew_point(vapour_pressure_pa)
    return f"{'frost' if dew < ZERO_CELSIUS_K else 'dew'} point {_celsius(dew)}"


# --- Temperature of the exhaust air, and ice in the silencer.

#: Smallest number of exhausts for a note on ice (assumed): ice needs repeated strokes.
LEAST_EXHAUSTS = 10
#: An exhaust counts if the gauge pressure falls from above the first to below the second fraction of its highest value
#: (assumed).
FULL, EMPTY = 0.5, 0.25


@dataclass(frozen=True)
class ExhaustAir:
    """Gas that leaves the chambers of all cylinders.

    Attributes
    ----------
    mean_k : float
        Mean temperature in K, weighted by the mass flow.
    coldest_k : float
        Lowest temperature in K of gas that leaves.
    exhausts : int
        Number of times that the gauge pressure of a chamber falls from half of its highest value to a quarter.
    """

    mean_k: float
    coldest_k: float
    exhausts: int

    def frost_k(self, ambient_pa: float, supply_pa: float) -> float:
        """Return the pressure dew point of the supply in K above which ice can form in the silencer.

        Gas with this dew point at `supply_pa` is saturated over ice at `ambient_pa` and `mean_k`, or at 0 degC if
        `mean_k` is higher. Both pressures are absolute.
        """
        return dew_point(float(saturation_pressure(min(self.mean_k, ZERO_CELSIUS_K))) * supply_pa / ambient_pa)


def exhaust_air(columns: Keyed, ambient_pa: float) -> ExhaustAir | None:
    """Return the exhaust air of a run. None if no gas leaves a cylinder.

    Parameters
    ----------
    columns : mapping
        Columns of the trajectory in SI.
    ambient_pa : float
        Absolute ambient pressure in Pa.
    """
    mass, heat, coldest, exhausts = 0.0, 0.0, math.inf, 0
    time = columns["time_s"]
    for pressure, temperature, flow in _chambers(columns):
        leaving = np.maximum(-flow, 0.0)
        own = np.trapezoid(leaving, time)
        mass, heat = mass + own, heat + np.trapezoid(leaving * temperature, time)
        out = leaving > 1e-3 * leaving.max(initial=0.0)
        coldest = min(coldest, temperature[out].min(initial=math.inf))
        gauge = (pressure - ambient_pa) / max(pressure.max() - ambient_pa, 1.0)
        full = gauge[(gauge > FULL) | (gauge < EMPTY)] > FULL
        exhausts += int(np.sum(full[:-1] & ~full[1:]))
    return ExhaustAir(float(heat / mass), float(coldest), exhausts) if mass > 0.0 else None


def _ice(described: DriveOrCircuit, columns: Keyed) -> Iterator[str]:
    """Yield a note if ice can form in the silencer: exhaust air below 0 degC on average, and supply not dry enough."""
    if all(columns[name].min() >= ZERO_CELSIUS_K for name in columns if "temperature" in name):
        return
    air = exhaust_air(columns, described.ambient.pressure_pa)
    if air is None or air.exhausts < LEAST_EXHAUSTS or air.mean_k >= ZERO_CELSIUS_K:
        return
    reached = max(pressure.max() for pressure, *_ in _chambers(columns))
    supply = described.dew_point_pressure_pa or getattr(described, "supply_pressure_pa", reached)
    frost, share = air.frost_k(described.ambient.pressure_pa, supply), water_share(described)
    if share is not None and share * supply < saturation_pressure(frost):
        return
    mean, coldest, dry = (_celsius(kelvin, 0) for kelvin in (air.mean_k, air.coldest_k, frost))
    yield (
        f"exhaust air: {mean} on average, {coldest} at the lowest. The motion hardly changes. Ice can form in the "
        f"silencer if the pressure dew point of the supply is above {dry}"
    )


def _chambers(columns: Keyed) -> Iterator[tuple[Array, Array, Array]]:
    """Yield pressure in Pa, temperature in K and net inflow in kg/s of each chamber of a cylinder."""
    for place in gas_volumes(columns):
        flow = columns.get(place.column.replace("pressure", "mass_flow").removesuffix("_pa") + "_kg_s")
        if flow is not None and place.column.count(".") in (0, 2):
            yield place.pressure_pa, place.temperature_k, flow
