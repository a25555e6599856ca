"""Tables of a drive description, one class each. Stored values are in SI, with the unit in their name."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, get_args

from pydantic import Field, model_validator

from pneudrive import _core, constants, units
from pneudrive.arrays import Array, ArrayPair, NamedNumbers, Pair, Plain
from pneudrive.constants import AIR_GAS_CONSTANT_J_KG_K, AIR_HEAT_CAPACITY_RATIO, ANR_TEMPERATURE_K
from pneudrive.describe import marks
from pneudrive.describe.base import Described
from pneudrive.describe.marks import NOT_NEGATIVE, POSITIVE, Bounds, MaybePressure, MaybeTemperature, Quantity
from pneudrive.describe.tables import valve_flow
from pneudrive.errors import invalid, package_table, warn, wrong

#: Bounds of a dew point, -80 to 60 degC: range of dryers and of the vapour pressure formula.
DEW_POINTS = Bounds(at_least=193.15, at_most=333.15)

_TABLE = package_table(__file__, "gases.toml")
#: Ratio of specific heats and specific gas constant, J/(kg K), of gases by name. Those of air are the core's.
GASES: dict[str, Sequence[float]] = {"air": (AIR_HEAT_CAPACITY_RATIO, AIR_GAS_CONSTANT_J_KG_K), **_TABLE["constants"]}
#: Coefficients of the second virial coefficient and of the heat capacity over temperature, see ``gases.toml``.
VIRIAL: dict[str, list[float]] = _TABLE["virial"]
CAPACITY_EXCESS: dict[str, list[float]] = _TABLE["capacity_excess"]
#: Temperatures of `CAPACITY_EXCESS`, degC.
CAPACITY_CELSIUS: list[float] = _TABLE["capacity_celsius"]


def anr_density_kg_m3(heat_capacity_ratio: float, gas_constant: float) -> float:
    """Return the density of a gas in kg/m3 at the standard reference atmosphere, in which air is humid.

    Conductances in the core refer to the same densities.
    """
    if (heat_capacity_ratio, gas_constant) == (AIR_HEAT_CAPACITY_RATIO, AIR_GAS_CONSTANT_J_KG_K):
        return constants.ANR_DENSITY_KG_M3
    return constants.ANR_PRESSURE_PA / (gas_constant * ANR_TEMPERATURE_K)


class Gas(Described):
    """Gas in the drive, by name or by numbers; the default is dry air.

    `model` is "ideal", or "virial" with the second virial coefficient.

    `dew_point` is the pressure dew point of the supplied gas; below 0 degC, it is the frost point. It refers to
    `dew_point_pressure`, by default the supply pressure. The dew point does not change the simulation: a run only warns
    if water may condense or freeze.
    """

    table_name: ClassVar[str] = "gas"
    name: Literal["air", "nitrogen", "argon", "helium", "carbon-dioxide"] | None = None
    heat_capacity_ratio: Annotated[float, Quantity("", bounds=Bounds(above=1.0, below=2.0))] = AIR_HEAT_CAPACITY_RATIO
    gas_constant_j_kg_k: Annotated[float, Quantity("J/(kg K)", "J/(kg K)", POSITIVE)] = AIR_GAS_CONSTANT_J_KG_K
    model: Literal["ideal", "virial"] = "ideal"
    dew_point_k: Annotated[float | None, Quantity("K", "degC", DEW_POINTS)] = None
    dew_point_pressure: MaybePressure = None

    @model_validator(mode="before")
    @classmethod
    def _of_name(cls, data: Any) -> Any:  # noqa: ANN401
        known = GASES.get(data["name"]) if isinstance(data, dict) and isinstance(data.get("name"), str) else None
        if known is None:
            return data
        ratio, constant = known
        return {"heat_capacity_ratio": ratio, "gas_constant": f"{constant!r} J/(kg K)"} | data

    @model_validator(mode="after")
    def _one_gas(self) -> Gas:
        if self.model == "virial" and self.name not in VIRIAL:
            what = f'gas.model = "virial" has no coefficients for {self.name or "a gas given by numbers"}'
            raise wrong("gas.model", what, rule=f"known for {', '.join(VIRIAL)}", remedy='Use gas.model = "ideal".')
        if self.name is None:
            return self
        numbers = {"heat_capacity_ratio": self.heat_capacity_ratio, "gas_constant": self.gas_constant_j_kg_k}
        for (key, value), known in zip(numbers.items(), GASES[self.name], strict=True):
            if value != known:
                raise invalid(f"gas.{key}", "describe.gas-twice", key=key, given=value, known=known, name=self.name)
        if self.name == "carbon-dioxide" and self.model == "ideal":
            warn(
                "the ideal gas model gives a pressure of carbon dioxide that is 3.7 % too high at 7 bar and 20 degC, "
                'and 5.3 % too high at 10 bar; gas.model = "virial" corrects this'
            )
        return self

    @property
    def anr_density_kg_m3(self) -> float:
        """Density in kg/m3 at the standard reference atmosphere."""
        return anr_density_kg_m3(self.heat_capacity_ratio, self.gas_constant_j_kg_k)

    def core(self) -> Plain:
        """Return the gas in the core's form, in SI."""
        out = {"heat_capacity_ratio": self.heat_capacity_ratio, "gas_constant_j_kg_k": self.gas_constant_j_kg_k}
        if self.model == "ideal" or self.name is None:
            return out
        a, b, c = VIRIAL[self.name]
        per_kg = 1e-6 * self.gas_constant_j_kg_k / constants.MOLAR_GAS_CONSTANT_J_MOL_K
        return out | {"virial": {"a_m3_kg": a * per_kg, "b_m3_kg": b * per_kg, "c_k": c}}

    def dew_point_pressure_pa(self, ambient_pa: float, supply_pa: float | None) -> float | None:
        """Return the absolute pressure in Pa to which the dew point refers; None without a dew point.

        Raises
        ------
        DescriptionError
            The pressure is missing or below vacuum.
        """
        key, stated = "gas.dew_point_pressure", self.dew_point_pressure
        if self.dew_point_k is None:
            if stated is not None:
                raise wrong(key, f"{key} = {stated} has no effect without gas.dew_point", remedy="Add gas.dew_point.")
            return None
        if stated is not None:
            return marks.absolute_above_vacuum(stated, ambient_pa, key, f"{key} = {stated}")
        if supply_pa is None:
            raise invalid("gas.dew_point", "describe.dew-point-alone")
        return supply_pa


class Ambient(Described):
    """Ambient air, into which the drive exhausts; the default is the standard atmosphere."""

    table_name: ClassVar[str] = "ambient"
    pressure: Annotated[units.Pressure, marks.StatedPressure(gauge_allowed=False)] = units.Pressure(
        constants.STANDARD_ATMOSPHERE_PA, gauge=False
    )
    temperature_k: marks.Temperature = ANR_TEMPERATURE_K

    @property
    def pressure_pa(self) -> float:
        """Absolute pressure in Pa."""
        return self.pressure.value_pa

    def core(self) -> NamedNumbers:
        """Return the table in the core's form, in SI."""
        return {"pressure_pa": self.pressure_pa, "temperature_k": self.temperature_k}


class Supply(Described):
    """Supply at the inlet of the valve. The default temperature is the ambient temperature."""

    table_name: ClassVar[str] = "supply"
    pressure: Annotated[units.Pressure, marks.StatedPressure()]
    temperature_k: MaybeTemperature = None


# --- Piston areas for each kind of cylinder, and chamber volumes.

KINDS = ("rodless", "through-rod", "single-rod")
MaybeArea = Annotated[float | None, Quantity("m^2", "cm2", POSITIVE)]


def piston_areas(kind: str, bore_m: float, rod_diameter_m: float) -> Pair:
    """Return the areas in m2 on which the pressures in chambers a and b act.

    Parameters
    ----------
    kind : str
        One of `KINDS`; the rod of a ``single-rod`` cylinder is in chamber b.
    bore_m, rod_diameter_m : float
        Diameters in m. For a kind without a rod, the rod diameter has no effect.

    Examples
    --------
    >>> [round(1e4 * area, 3) for area in piston_areas("single-rod", 0.032, 0.012)]
    [8.042, 6.912]
    """
    full = 0.25 * math.pi * bore_m**2
    ring = 0.25 * math.pi * (bore_m**2 - rod_diameter_m**2)
    return (ring if kind == "through-rod" else full), (full if kind == "rodless" else ring)


def double_acting(core_json: str) -> dict[str, Plain]:
    """Return the double-acting cylinders of a circuit in the core's form, by name."""
    kinds = {f"cylinder/{kind}" for kind in KINDS}
    return {one["name"]: one for one in json.loads(core_json)["components"] if one["kind"] in kinds}


def chamber_volumes(cylinder: Plain, position_m: Array) -> ArrayPair:
    """Return the volumes of chambers a and b in m3: dead volume plus swept volume.

    Parameters
    ----------
    cylinder : dict
        Cylinder in the core's form.
    position_m : ndarray
        Position of the piston in m. Chamber a grows with the position.
    """
    of = cylinder["numbers"]
    a, b = piston_areas(cylinder["kind"].partition("/")[2], of["bore"], of["rod_diameter"])
    return of["dead_volume_a"] + a * position_m, of["dead_volume_b"] + b * (of["stroke"] - position_m)


def check_rod(table: str, kind: str, bore_m: float, rod_diameter_m: float | None) -> None:
    """Check that a rodless cylinder has no rod, and that the rod of any other cylinder is smaller than the bore.

    Raises
    ------
    DescriptionError
    """
    key = f"{table}.rod_diameter"
    if kind == "rodless":
        if rod_diameter_m is not None:
            raise invalid(key, "describe.rod-of-rodless", key=key, table=table)
    elif rod_diameter_m is None:
        raise invalid(key, "describe.no-rod", key=key, table=table, kind=kind)
    elif not rod_diameter_m < bore_m:
        rod, bore = (units.write(d, "m", "mm") for d in (rod_diameter_m, bore_m))
        raise invalid(key, "describe.rod-too-thick", key=key, rod=rod, table=table, bore=bore)


class PistonTable(Described):
    """Table with the piston areas, given by the bore, or directly for a non-circular piston."""

    kind: Literal["rodless", "through-rod", "single-rod"] = "rodless"
    bore_m: marks.MaybeLength = None
    rod_diameter_m: marks.MaybeLength = None
    area_a_m2: MaybeArea = None
    area_b_m2: MaybeArea = None

    def areas(self) -> Pair:
        """Return the areas in m2 on which the pressures in chambers a and b act.

        Raises
        ------
        DescriptionError
            The areas are missing, or given more than once.
        """
        a, b, bore, rod, table = self.area_a_m2, self.area_b_m2, self.bore_m, self.rod_diameter_m, self.table_name
        if bore is not None and (a, b) == (None, None):
            check_rod(table, self.kind, bore, rod)
            return piston_areas(self.kind, bore, rod or 0.0)
        if a is None or b is None or (bore, rod) != (None, None):
            raise invalid(table, "describe.piston-areas", table=table)
        return a, b


# --- Tables of the components of a drive.


class _DrivePart(Described):
    """Table of a drive file that accepts fewer kinds than the same component of a circuit."""

    @model_validator(mode="before")
    @classmethod
    def refuse_kind_of_circuits(cls, data: Any) -> Any:  # noqa: ANN401
        """Reject a kind that exists in circuits, but not in drive files."""
        table, known = cls.table_name, get_args(cls.model_fields["kind"].annotation)
        kind = data.get("kind") if isinstance(data, dict) else None
        short = kind.removeprefix(f"{table}/") if isinstance(kind, str) else ""
        if short and short not in known and any(entry["kind"] == f"{table}/{short}" for entry in _core.components()):
            names = {"table": table, "kind": kind, "short": short, "known": " or ".join(known)}
            raise invalid(f"{table}.kind", "describe.of-circuits", **names)
        return data


class EndStop(Described):
    """Contact with the end cover.

    force = stiffness * depth + damping * min(depth / damping_depth, 1) * closing speed. The force never pulls.
    Missing values follow from the drive (docs/theory/end_stops.md), and `Drive.end_stop` shows them. The contact is so
    stiff that the piston of a usual drive does not penetrate a cover.
    """

    table_name: ClassVar[str] = "cylinder.end_stop"
    stiffness_n_m: Annotated[float | None, Quantity("N/m", "N/m", POSITIVE)] = None
    damping_n_s_m: Annotated[float | None, Quantity("N s/m", "N s/m", NOT_NEGATIVE)] = None
    damping_depth_m: marks.MaybeLength = None


def assumed_stops(prefix: str, given: Collection[str], stops: tuple[Sequence[float], Sequence[float]]) -> list[str]:
    """Return the assumed values of end stops that a description does not give, each with its reason.

    Parameters
    ----------
    prefix : str
        Prefix of the keys, ``"cylinder.end_stop."``.
    given : collection of str
        Keys that the description gives: ``"stiffness"``, ``"damping"``, ``"damping_depth"``.
    stops : tuple
        End stop (stiffness N/m, damping N s/m, damping depth m), and the load for which the core designs it (mass kg,
        speed m/s, force N, stopping distance m), as the core returns them.

    Returns
    -------
    list of str
        Lines ``key = value, reason``.
    """
    (stiffness, damping, damping_depth), (mass, speed, force, depth) = stops
    taken = f"a mass of {mass:.3g} kg at {speed:.3g} m/s, driven by {force:.3g} N, stops in {1e3 * depth:.3g} mm"
    still = f"at rest, this force presses the piston {1e3 * force / stiffness:.2g} mm beyond the stroke"
    lines = {
        "stiffness": f"{stiffness:.3g} N/m, so that {taken} (at most half of the shorter dead length); {still}",
        "damping": f"{damping:.3g} N s/m, half of the critical damping",
        "damping_depth": f"{1e3 * damping_depth:.3g} mm, a tenth of that depth",
    }
    return [f"{prefix}{key} = {line}".replace("e+0", "e") for key, line in lines.items() if key not in given]


#: Key that exists only in circuits -> remedy.
_ELSEWHERE = package_table(__file__, "elsewhere.toml")


def _elsewhere(table: str) -> dict[str, str]:
    """Return the keys that a table of a drive file does not accept, each with a remedy."""
    return {key: text.format(opened=_ELSEWHERE["opened"]) for key, text in _ELSEWHERE[table].items()}


class Cylinder(_DrivePart):
    """Double-acting cylinder; x grows towards the end of chamber b, and chamber a grows with x.

    `leakage` is the sonic conductance of the gap past the piston, between the chambers; its critical pressure ratio
    is assumed to be 0.2.

    The heat transfer to the walls follows from a law [woodfield2007, geankoplis1993]. `heat_transfer_scale` multiplies
    the law, which is accurate to a factor of 2. `port_diameter` is the bore of the ports. The default is the bore of
    a nozzle with the conductance of the valve. A stated `heat_transfer` is a constant coefficient that replaces the
    law. With a stated coefficient, the dead volumes have no wall.
    """

    table_name: ClassVar[str] = "cylinder"
    elsewhere: ClassVar[Mapping[str, str]] = _elsewhere("cylinder")
    kind: Literal["rodless", "through-rod", "single-rod"]
    bore_m: marks.Length
    rod_diameter_m: marks.MaybeLength = None
    stroke_m: marks.Length
    dead_volume_m3: Annotated[marks.PerChamber, marks.EachChamber("m^3", "cm3", POSITIVE)]
    moving_mass_kg: marks.Mass
    incline_rad: marks.Angle = 0.0
    heat_transfer_w_m2_k: Annotated[float | None, Quantity("W/(m^2 K)", "W/(m2 K)", NOT_NEGATIVE)] = None
    heat_transfer_scale: Annotated[float, Quantity("", bounds=NOT_NEGATIVE)] = 1.0
    port_diameter_m: marks.MaybeLength = None
    wall_temperature_k: MaybeTemperature = None
    leakage_m3_s_pa: Annotated[float, Quantity("m^3/(s Pa)", "dm3/(s bar)", NOT_NEGATIVE)] = 0.0
    end_stop: EndStop = EndStop()
    chamber_law: Literal["energy-balance", "as-printed"] = "energy-balance"

    @model_validator(mode="after")
    def _rod_fits(self) -> Cylinder:
        check_rod("cylinder", self.kind, self.bore_m, self.rod_diameter_m)
        return self

    @property
    def area_a_m2(self) -> float:
        """Piston area in m2 on the side of chamber a."""
        return self._areas[0]

    @property
    def area_b_m2(self) -> float:
        """Piston area in m2 on the side of chamber b."""
        return self._areas[1]

    @property
    def _areas(self) -> Pair:
        return piston_areas(self.kind, self.bore_m, self.rod_diameter_m or 0.0)


SWITCHING = "switching-5/3"


class Valve(_DrivePart):
    """5/3 valve, proportional or switching.

    A command u > 0 connects the supply to a and b to the exhaust, with the fraction u of the conductance. A command u <
    0 connects the supply to b and a to the exhaust. A valve of kind "switching-5/3" has the commands -1, 0 and 1 only.
    `time_on` and `time_off` are its times from the command to the middle of the spool's travel. `command` is the range
    of the electrical input, for commands in V or mA; its ends are u = -1 and 1. `overlap` is the magnitude of u up to
    which an edge stays closed. It is negative if the edges are open in the centre. `leakage` is the conductance of each
    edge in the centre, as a fraction of the conductance at full opening. The size is given in exactly one way:
    conductance C (ISO 6358), nominal_flow (6 to 5 bar gauge), kv or cv. `pneudrive.describe.tables.valve_flow` states
    the assumptions of each conversion.
    """

    table_name: ClassVar[str] = "valve"
    elsewhere: ClassVar[Mapping[str, str]] = _elsewhere("valve")
    kind: Literal["proportional-5/3", "switching-5/3"]
    conductance_given: Annotated[float | None, marks.CONDUCTANCE] = Field(default=None, alias="conductance")
    nominal_flow_m3_s_anr: Annotated[float | None, marks.NOMINAL_FLOW] = None
    kv: Annotated[float | None, marks.KV] = None
    cv: Annotated[float | None, marks.CV] = None
    critical_pressure_ratio: marks.Fraction = valve_flow.USUAL_RATIO
    subsonic_index: Annotated[float, Quantity("", bounds=Bounds(above=0.0, at_most=2.0))] = 0.5
    linear_above: marks.Fraction = 0.999
    overlap: Annotated[float | None, Quantity("", bounds=Bounds(above=-1.0, below=1.0))] = None
    leakage: Annotated[float | None, Quantity("", bounds=Bounds(at_least=0.0, at_most=1.0))] = None
    command: Annotated[marks.Signal | None, marks.SIGNAL_RANGE] = None
    time_on_s: Annotated[float | None, Quantity("s", "ms", POSITIVE)] = None
    time_off_s: Annotated[float | None, Quantity("s", "ms", POSITIVE)] = None

    @model_validator(mode="after")
    def _fits_together(self) -> Valve:
        valve_flow.size_given(self._sizes(), valve_flow.FLOW_KEYS, "valve.")
        if self.conductance_given is not None and "critical_pressure_ratio" not in self.model_fields_set:
            key, rule = "valve.critical_pressure_ratio", "a valve is given by C and b, or by a nominal flow, kv or cv"
            raise wrong(key, f"{key} is missing", rule=rule, remedy="Write critical_pressure_ratio = 0.3.")
        valve_flow.check_shape("valve", self.critical_pressure_ratio, self.linear_above)
        times = {"time_on": self.time_on_s, "time_off": self.time_off_s}
        shape = {"overlap": self.overlap, "leakage": self.leakage, "command": self.command}
        other = "proportional" if self.is_switching else "switching"
        for key, value in (shape if self.is_switching else times).items():
            if value is not None:
                raise invalid(f"valve.{key}", "describe.of-other-valve", key=key, other=other, kind=self.kind)
        for key, value in times.items() if self.is_switching else ():
            if value is None:
                raise invalid(f"valve.{key}", "describe.no-switching-time", key=key)
        return self

    @property
    def is_switching(self) -> bool:
        """Whether the valve has the commands -1, 0 and 1 only."""
        return self.kind == SWITCHING

    @property
    def has_shape(self) -> bool:
        """Whether overlap or leakage of the edges is given."""
        return self.overlap is not None or self.leakage is not None

    def _sizes(self) -> tuple[float | None, ...]:
        return self.conductance_given, self.nominal_flow_m3_s_anr, self.kv, self.cv

    @property
    def conductance(self) -> units.UnitFloat:
        """Sonic conductance C for air at full opening, converted from the given size."""
        return units.UnitFloat(self.conductance_m3_s_pa, "m^3/(s Pa)", "dm3/(s bar)")

    @property
    def conductance_m3_s_pa(self) -> float:
        """Sonic conductance C in m3/(s Pa) for air at full opening."""
        return valve_flow.conductance_of(self._sizes(), self.critical_pressure_ratio, self.subsonic_index)


class Spring(Described):
    """Linear spring between load and ground. Below its rest position, it pushes the load in +x."""

    table_name: ClassVar[str] = "load.spring"
    stiffness_n_m: marks.Stiffness
    rest_position_m: marks.Position = 0.0


class Load(Described):
    """Load of the piston, in addition to its moving mass. `force` acts in +x."""

    table_name: ClassVar[str] = "load"
    elsewhere: ClassVar[Mapping[str, str]] = _elsewhere("load")
    mass_kg: Annotated[float, Quantity("kg", "kg", NOT_NEGATIVE)] = 0.0
    force_n: marks.Force = 0.0
    spring: Spring | None = None


class Initial(Described):
    """State at the start of a run.

    The defaults are mid stroke, rest, ambient pressure and temperature, undeflected bristles, and contact age zero.
    `contact_age` is the age of the contact, for friction that grows with this age.
    """

    table_name: ClassVar[str] = "initial"
    position_m: Annotated[float | None, Quantity("m", "mm")] = None
    velocity_m_s: marks.Velocity = 0.0
    contact_age_s: Annotated[float, Quantity("s", "s", NOT_NEGATIVE)] = 0.0
    pressure_a: MaybePressure = None
    pressure_b: MaybePressure = None
    temperature_a_k: MaybeTemperature = None
    temperature_b_k: MaybeTemperature = None
