"""Warnings for runs outside the stated range of the model. They do not change the simulation."""

from __future__ import annotations

import math
from bisect import bisect
from typing import TYPE_CHECKING, Any, NamedTuple

from pneudrive.constants import AIR_GAS_CONSTANT_J_KG_K, MOLAR_GAS_CONSTANT_J_MOL_K, ZERO_CELSIUS_K
from pneudrive.describe.system import compiled
from pneudrive.describe.tables.parts import VIRIAL
from pneudrive.describe.tables.starts import angles, coordinates, pose_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pneudrive.describe import Drive
    from pneudrive.describe.circuit import Circuit

#: Largest absolute pressure of the model, Pa: flow functions and cylinders are stated for less (assumed).
HIGHEST_PA = 20e5
#: Excess of the heat capacity over that of the model, -, which gives a note (assumed).
CAPACITY_OFF = 0.02
#: Heat capacity cp of an ideal gas over the model's constant, less 1, at `CAPACITY_CELSIUS`. Source: coolprop2014.
CAPACITY_CELSIUS = (20.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0, 400.0, 500.0)
CAPACITY_EXCESS = {
    "air": (-0.0002, 0.0014, 0.0056, 0.0117, 0.0196, 0.0292, 0.0399, 0.0633, 0.0872),
    "nitrogen": (0.0008, 0.0014, 0.0034, 0.0071, 0.0127, 0.0202, 0.0293, 0.0507, 0.0739),
    "carbon-dioxide": (-0.0047, 0.0317, 0.0873, 0.1369, 0.1815, 0.2217, 0.2581, 0.3216, 0.3745),
}
#: Part of the pressure by which a gas may differ from its law, ideal or with a second coefficient (assumed).
IDEAL_OFF, VIRIAL_OFF = 0.05, 0.1
#: Largest acceleration of a piston by the pressure on one side, m/s2: a piston of 6 mm bore and 5 g has 4e3 (assumed).
FASTEST_M_S2 = 1e5
#: Part of the stroke by which rounding may move a piston beyond it.
ROUNDED = 1e-9


class _GasVolume(NamedTuple):
    """Gas of one volume over a run. Columns are arrays, or `pneudrive._core.Column`."""

    name: str
    pressure_pa: Any
    temperature_k: Any


def warnings(described: Drive | Circuit, columns: Mapping[str, Any]) -> list[str]:
    """Return one warning for each limit that a run leaves, with time, place and limit.

    Parameters
    ----------
    described : Drive or Circuit
        The simulated object.
    columns : mapping
        Columns of the trajectory.
    """
    time = columns["time_s"]
    places = list(_places(described, columns))
    found = [*_pressures(places, time), *_hot(described, places, time), *_gas(described, places, time)]
    found += _masses(described, places, time)
    return [*found, *_pistons(described, columns), *_singular_poses(described, columns)]


def _places(described: Drive | Circuit, columns: Mapping[str, Any]) -> Iterator[_GasVolume]:
    for column, pressure in columns.items():
        temperature = columns.get(column.replace("pressure", "temperature").removesuffix("_pa") + "_k")
        if temperature is not None and "pressure" in column:
            chamber = column.removeprefix("pressure_").removesuffix("_pa")
            name = column.removesuffix(".pressure_pa") if "." in column else f"chamber {chamber}"
            yield _GasVolume(name, pressure, temperature)


def _pressures(places: list[_GasVolume], time_s: Any) -> Iterator[str]:  # noqa: ANN401 - array or column
    high = [place for place in places if place.pressure_pa.max() > HIGHEST_PA]
    if high:
        worst = max(high, key=lambda place: float(place.pressure_pa.max()))
        when = time_s[int(worst.pressure_pa.argmax())]
        yield (
            f"the pressure in {worst.name} reaches {1e-5 * worst.pressure_pa.max():.3g} bar abs at {when:.4g} s"
            f"{_others(high, worst)}: the model is stated for up to {1e-5 * HIGHEST_PA:g} bar abs (assumed)"
        )


def _hot(described: Drive | Circuit, places: list[_GasVolume], time_s: Any) -> Iterator[str]:  # noqa: ANN401 - array or column
    """Yield a note if the heat capacity of the hottest gas is far from the constant of the model."""
    excesses = CAPACITY_EXCESS.get(_gas_name(described))
    worst = max(places, key=lambda place: float(place.temperature_k.max()), default=None)
    if excesses is None or worst is None:
        return
    hottest = float(worst.temperature_k.max())
    k = min(bisect(CAPACITY_CELSIUS, hottest - ZERO_CELSIUS_K), len(excesses) - 1)
    if k == 0:
        return  # colder than the table
    (low, high), (before, after) = CAPACITY_CELSIUS[k - 1 : k + 1], excesses[k - 1 : k + 1]
    excess = before + (after - before) * (hottest - ZERO_CELSIUS_K - low) / (high - low)
    if excess > CAPACITY_OFF:
        when = time_s[int(worst.temperature_k.argmax())]
        yield (
            f"the gas in {worst.name} reaches {_celsius(hottest)} at {when:.4g} s, "
            f"where its heat capacity is {100.0 * excess:.1f} % higher than the model's"
        )


def _gas_name(described: Drive | Circuit) -> str:
    """Return the name of the gas: air by its gas constant, empty for an unknown gas."""
    gas = described.gas
    is_air = gas.name in (None, "air") and gas.gas_constant_j_kg_k == AIR_GAS_CONSTANT_J_KG_K
    return "air" if is_air else gas.name or ""


def _others(places: list[_GasVolume], worst: _GasVolume) -> str:
    rest = [place.name for place in places if place is not worst]
    return f" (also {', '.join(rest[:3])}{', ...' if len(rest) > 3 else ''})" if rest else ""


def _celsius(temperature_k: float) -> str:
    return f"{temperature_k - ZERO_CELSIUS_K:.1f} degC"


def _gas(described: Drive | Circuit, places: list[_GasVolume], time_s: Any) -> Iterator[str]:  # noqa: ANN401 - array or column
    """Yield a warning if the second virial coefficient contributes more to the pressure than the gas law allows."""
    gas, name = described.gas, _gas_name(described)
    coefficients = VIRIAL.get("nitrogen" if name == "air" else name)  # air is taken as nitrogen
    if coefficients is None:
        return
    most = IDEAL_OFF if gas.model == "ideal" else VIRIAL_OFF
    worst, off = None, 0.0
    for place in places:
        for row in {int(place.pressure_pa.argmax()), int(place.temperature_k.argmin())}:
            pressure, temperature = float(place.pressure_pa[row]), float(place.temperature_k[row])
            share = _second_share(coefficients, pressure, temperature)
            if abs(share) > max(abs(off), most):
                worst, off = (place.name, pressure, temperature, row), share
    if worst is not None:
        name, pressure, temperature, row = worst
        law = "the ideal gas" if gas.model == "ideal" else "the gas law without a third virial coefficient"
        remedy = (
            '; gas.model = "virial" has the second virial coefficient'
            if gas.model == "ideal" and gas.name in VIRIAL
            else ""
        )
        yield (
            f"the gas in {name} is far from its law at {time_s[row]:.4g} s: at {1e-5 * pressure:.3g} bar abs and "
            f"{_celsius(temperature)} the second virial coefficient is {100.0 * abs(off):.2g} % of the pressure, and "
            f"{law} is taken for up to {100.0 * most:g} % (assumed){remedy}"
        )


def _second_share(coefficients: tuple[float, float, float], pressure_pa: float, temperature_k: float) -> float:
    """Return B p/(R T): the part of the pressure that the second virial coefficient adds. Source: libretexts-virial."""
    a, b, c = coefficients
    second = 1e-6 * (a - b * math.exp(c / max(temperature_k, 60.0)))
    return second * pressure_pa / (MOLAR_GAS_CONSTANT_J_MOL_K * temperature_k)


def _masses(described: Drive | Circuit, places: list[_GasVolume], time_s: Any) -> Iterator[str]:  # noqa: ANN401 - array or column
    """Yield a warning for each piston whose mass is negligible compared with the pressure on it."""
    for key, mass, area in described.movers:
        place = max(places, key=lambda place: float(place.pressure_pa.max()), default=None)
        if place is not None and area * float(place.pressure_pa.max()) > mass * FASTEST_M_S2:
            row = int(place.pressure_pa.argmax())
            yield (
                f"{key} with its load is {mass:.3g} kg, as good as zero: {1e-5 * place.pressure_pa[row]:.3g} bar abs "
                f"in {place.name} at {time_s[row]:.4g} s is {area * place.pressure_pa[row] / mass:.1e} m/s2. "
                f"The model is stated for up to {FASTEST_M_S2:.0e} m/s2 (assumed)"
            )


def _pistons(described: Drive | Circuit, columns: Mapping[str, Any]) -> Iterator[str]:
    """Yield a warning for each piston without end stops that leaves its stroke."""
    for name, component in getattr(described, "components", {}).items():
        position = columns.get(f"{name}.position_m")
        if component.kind != "piston" or position is None:
            continue
        stroke, row = float(component.stroke_m), None  # type: ignore[attr-defined] - of this kind
        if position.min() < -ROUNDED * stroke:
            row = int(position.argmin())
        if position.max() > (1.0 + ROUNDED) * stroke and (row is None or position.max() - stroke > -position[row]):
            row = int(position.argmax())
        if row is not None:
            when = columns["time_s"][row]
            yield (
                f"{name} leaves its stroke: it is at {1e3 * position[row]:.6g} mm at {when:.4g} s, and its stroke is "
                f"0 to {1e3 * stroke:g} mm. A piston has no end stops: take a cylinder, or join stops to it"
            )


def _singular_poses(described: Drive | Circuit, columns: Mapping[str, Any]) -> Iterator[str]:
    """Yield a warning for each platform that passes a singular pose: the determinant of its Jacobian changes sign."""
    kinds = {name: one.kind for name, one in getattr(described, "components", {}).items()}
    if not any(kind.startswith("platform/") and kind != "platform/driven" for kind in kinds.values()):
        return
    import numpy as np

    for platform in compiled(described.circuit.core_json()).platforms:
        names = [f"{platform.name}.{key}" + ("" if key.endswith("_m") else "_rad") for key in platform.coordinates]
        q = coordinates(platform, np.column_stack([np.fromiter(columns[name], float) for name in names]))
        signs = np.linalg.slogdet(platform.evaluate(q, np.zeros_like(q))["jacobian"])[0]
        rows = np.flatnonzero(signs[1:] * signs[:-1] <= 0.0)
        if rows.size:
            pose = pose_text(platform, angles(platform, q)[rows[0]])
            yield (
                f"{platform.name} passes a singular pose at {columns['time_s'][rows[0]]:.4g} s, near {pose}: its legs "
                "do not hold it there, and a real platform may continue in another way. Keep away from this pose, or "
                "move the joints"
            )
