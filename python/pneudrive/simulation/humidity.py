"""Warnings for water in the gas of a run that may condense or freeze. They do not change the simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pneudrive.constants import ZERO_CELSIUS_K as FREEZING_K

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy as np

    from pneudrive.describe import Drive
    from pneudrive.describe.circuit import Circuit

#: Keys of the sources in references.bib.
SOURCES = ("wmo2008", "sonntag1990")
#: e_s = A exp(B t/(C + t)), Pa, with t in degC, over water and over ice: A, B, C. Source: [wmo2008], Annex 4.B.
WATER, ICE = (611.2, 17.62, 243.12), (611.2, 22.46, 272.62)
#: Ratio to saturation below which there is no warning: the accuracy of the formula (assumed).
SATURATED = 1.01


def saturation_pressure(temperature_k: np.ndarray | float) -> np.ndarray:
    """Return the saturation pressure of water vapour, Pa: over water, below 0 degC over ice.

    Parameters
    ----------
    temperature_k : array or float
        Any shape.

    Examples
    --------
    >>> float(saturation_pressure(293.15).round(1))
    2332.6
    """
    import numpy as np

    t = np.asarray(temperature_k, dtype=float) - FREEZING_K
    over_water, over_ice = (a * np.exp(b * t / (c + t)) for a, b, c in (WATER, ICE))
    return np.where(t >= 0.0, over_water, over_ice)


def dew_point(vapour_pressure_pa: float) -> float:
    """Return the dew point, K, of a vapour pressure in Pa. Below 0 degC, return the frost point.

    Examples
    --------
    >>> round(dew_point(2332.6), 2)
    293.15
    """
    a, b, c = WATER if vapour_pressure_pa >= WATER[0] else ICE
    log = math.log(vapour_pressure_pa / a)
    return FREEZING_K + c * log / (b - log)


@dataclass(frozen=True)
class _Place:
    """Gas of one volume over a run, and its wall."""

    name: str
    pressure_pa: np.ndarray
    temperature_k: np.ndarray
    wall_k: np.ndarray | float


def warnings(drive: Drive | Circuit, columns: Mapping[str, np.ndarray]) -> list[str]:
    """Return the warnings on water in a run: for each volume, at most one for the wall and one for the gas.

    Parameters
    ----------
    drive : Drive or Circuit
        Simulated object. A gas without a dew point gives no warnings. All gas counts as gas from the supply.
    columns : mapping
        Columns of the trajectory.
    """
    share = water_share(drive)
    if share is None:
        return []
    ambient = drive.ambient.pressure_pa
    return [
        line for place in _places(drive, columns) for line in _warnings_of(place, share, ambient, columns["time_s"])
    ]


def water_share(drive: Drive | Circuit) -> float | None:
    """Return the molar fraction of water vapour in the gas. None without a dew point."""
    pressure, dew = drive.dew_point_pressure_pa, drive.gas.dew_point_k
    return None if pressure is None or dew is None else float(saturation_pressure(dew)) / pressure


def _places(drive: Drive | Circuit, columns: Mapping[str, np.ndarray]) -> Iterator[_Place]:
    for column, pressure in columns.items():
        temperature = columns.get(column.replace("pressure", "temperature").removesuffix("_pa") + "_k")
        if temperature is None or "pressure" not in column:
            continue
        wall: Any
        if "." in column:
            name, own = column.removesuffix(".pressure_pa"), column.partition(".")[0]
            wall = columns.get(f"{own}.wall_temperature_k")  # of a wall that stores heat
            wall = getattr(drive.circuit.components[own], "wall_temperature_k", None) if wall is None else wall
        else:
            name = f"chamber {column.removeprefix('pressure_').removesuffix('_pa')}"
            wall = drive.circuit.components["cylinder"].wall_temperature_k  # type: ignore[attr-defined] - a cylinder
        yield _Place(name, pressure, temperature, drive.ambient.temperature_k if wall is None else wall)


def _warnings_of(place: _Place, share: float, ambient_pa: float, time_s: np.ndarray) -> Iterator[str]:
    import numpy as np

    vapour = share * place.pressure_pa
    saturated = saturation_pressure(place.temperature_k)
    on_wall = vapour / saturation_pressure(place.wall_k)
    at = int(on_wall.argmax())
    if on_wall[at] > SATURATED:
        wall = float(np.broadcast_to(place.wall_k, vapour.shape)[at])
        what = "ice may form" if wall < FREEZING_K else "water may condense"
        yield (
            f"{what} on the wall of {place.name}: {_when(time_s[at], place.pressure_pa[at])} the gas has its "
            f"{_point(vapour[at])}, the wall is at {_celsius(wall)}"
        )
    in_gas = vapour / saturated
    at = int(in_gas.argmax())
    if in_gas[at] > SATURATED:
        gas = float(place.temperature_k[at])
        what = "fog or ice" if gas < FREEZING_K else "fog"
        outside = " and in its exhaust" if (share * ambient_pa / saturated).max() > SATURATED else ""
        yield (
            f"{what} may form in {place.name}{outside}: {_when(time_s[at], place.pressure_pa[at])} the gas is at "
            f"{_celsius(gas)}, below its {_point(vapour[at])}"
        )


def _when(time_s: float, pressure_pa: float) -> str:
    return f"at {time_s:.3g} s and {pressure_pa / 1e5:.3g} bar abs"


def _point(vapour_pressure_pa: float) -> str:
    dew = dew_point(float(vapour_pressure_pa))
    return f"{'frost' if dew < FREEZING_K else 'dew'} point {_celsius(dew)}"


def _celsius(temperature_k: float) -> str:
    return f"{temperature_k - FREEZING_K:.1f} degC"
