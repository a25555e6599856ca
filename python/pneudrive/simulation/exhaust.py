"""Temperature of the exhaust air of a run, and whether ice can form in the silencer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.simulation.humidity import FREEZING_K, dew_point, saturation_pressure, water_share

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from pneudrive.describe import Drive
    from pneudrive.describe.circuit import Circuit

    Array = NDArray[np.float64]

#: Exhausts from which the mean temperature counts for ice (assumed): ice needs repeated strokes.
LEAST_EXHAUSTS = 10
#: An exhaust leads from above the first of these fractions of the highest gauge pressure to below the second (assumed).
FULL, EMPTY = 0.5, 0.25


@dataclass(frozen=True)
class ExhaustAir:
    """Gas that leaves the chambers of all cylinders.

    Attributes
    ----------
    mean_k : float
        Mean temperature, weighted by the mass flow, K.
    coldest_k : float
        Lowest temperature of gas that leaves, K.
    exhausts : int
        Number of exhausts: the gauge pressure of a chamber falls from half of its highest value to a quarter.
    """

    mean_k: float
    coldest_k: float
    exhausts: int

    def frost_k(self, ambient_pa: float, supply_pa: float) -> float:
        """Return the pressure dew point of the supply, K, above which ice can form in the silencer.

        Gas with this dew point at `supply_pa` is saturated over ice at the mean temperature and at `ambient_pa`, both
        absolute.
        """
        return dew_point(float(saturation_pressure(min(self.mean_k, FREEZING_K))) * supply_pa / ambient_pa)


def exhaust_air(columns: Mapping[str, Any], ambient_pa: float) -> ExhaustAir | None:
    """Return the exhaust air of a run. None if no gas leaves a cylinder.

    Parameters
    ----------
    columns : mapping
        Columns of the trajectory, SI.
    ambient_pa : float
        Ambient pressure, absolute.
    """
    import numpy as np

    mass, heat, coldest, exhausts = 0.0, 0.0, math.inf, 0
    time = _array(columns["time_s"])
    for pressure, temperature, flow in _chambers(columns):
        leaving = np.maximum(-flow, 0.0)
        own = np.trapezoid(leaving, time)
        mass, heat = mass + own, heat + np.trapezoid(leaving * temperature, time)
        out = leaving > 1e-3 * leaving.max(initial=0.0)
        coldest = min(coldest, temperature[out].min(initial=math.inf))
        gauge = (pressure - ambient_pa) / max(float(pressure.max()) - ambient_pa, 1.0)
        full = gauge[(gauge > FULL) | (gauge < EMPTY)] > FULL
        exhausts += int(np.sum(full[:-1] & ~full[1:]))
    return ExhaustAir(float(heat / mass), float(coldest), exhausts) if mass > 0.0 else None


def notes(described: Drive | Circuit, columns: Mapping[str, Any]) -> Iterator[str]:
    """Yield a note if ice can form in the silencer: a mean below 0 degC, and a supply that is not dry enough."""
    if all(float(columns[name].min()) >= FREEZING_K for name in columns if "temperature" in name):
        return
    air = exhaust_air(columns, described.ambient.pressure_pa)
    if air is None or air.exhausts < LEAST_EXHAUSTS or air.mean_k >= FREEZING_K:
        return
    reached = max(float(pressure.max()) for pressure, *_ in _chambers(columns))
    supply = described.dew_point_pressure_pa or getattr(described, "supply_pressure_pa", reached)
    frost, share = air.frost_k(described.ambient.pressure_pa, supply), water_share(described)
    if share is not None and share * supply < float(saturation_pressure(frost)):
        return
    yield (
        f"exhaust air: {_celsius(air.mean_k)} on average, {_celsius(air.coldest_k)} for a moment. The motion hardly "
        f"changes. Ice can form in the silencer if the pressure dew point of the supply is above {_celsius(frost)}"
    )


def _chambers(columns: Mapping[str, Any]) -> Iterator[tuple[Array, Array, Array]]:
    """Yield pressure, Pa, temperature, K, and net inflow, kg/s, of each chamber of a cylinder."""
    for name, flow in columns.items():
        short, full = name.startswith("mass_flow_"), name.endswith(".mass_flow_kg_s") and name.count(".") == 2
        if not short and not full:
            continue
        stem = name.removesuffix("_kg_s")
        pressure = columns.get(stem.replace("mass_flow", "pressure") + "_pa")
        temperature = columns.get(stem.replace("mass_flow", "temperature") + "_k")
        if pressure is not None and temperature is not None:
            yield _array(pressure), _array(temperature), _array(flow)


def _array(column: Any) -> Array:  # noqa: ANN401 - array or column of the core
    import numpy as np

    if isinstance(column, np.ndarray):
        return column
    return np.fromiter((column[k] for k in range(len(column))), dtype=np.float64, count=len(column))


def _celsius(temperature_k: float) -> str:
    return f"{temperature_k - ZERO_CELSIUS_K:.0f} degC"
