# Written by tools/stubs.py from pneudrive.describe.tables.parts: do not edit.
from collections.abc import Mapping as _Mapping, Sequence as _Sequence
from typing import Any as _Any, Literal as _Literal, TypeAlias as _TypeAlias

from pneudrive.describe.marks import PerChamber as _PerChamber
from pneudrive.units import Pressure as _Pressure, UnitFloat as _UnitFloat

_Given: _TypeAlias = str | float | _UnitFloat | _Mapping[str, _Any]
from _typeshed import Incomplete
from collections.abc import Collection, Mapping as Mapping, Sequence as Sequence
from pneudrive import _core as _core, constants as constants, units as units
from pneudrive.arrays import (
    Array as Array,
    ArrayPair as ArrayPair,
    NamedNumbers as NamedNumbers,
    Pair as Pair,
    Plain as Plain,
)
from pneudrive.constants import (
    AIR_GAS_CONSTANT_J_KG_K as AIR_GAS_CONSTANT_J_KG_K,
    AIR_HEAT_CAPACITY_RATIO as AIR_HEAT_CAPACITY_RATIO,
    ANR_TEMPERATURE_K as ANR_TEMPERATURE_K,
)
from pneudrive.describe import marks as marks
from pneudrive.describe.base import Described as Described
from pneudrive.describe.marks import (
    Bounds as Bounds,
    MaybePressure as MaybePressure,
    MaybeTemperature as MaybeTemperature,
    NOT_NEGATIVE as NOT_NEGATIVE,
    POSITIVE as POSITIVE,
    Quantity as Quantity,
)
from pneudrive.describe.tables import valve_flow as valve_flow
from pneudrive.errors import invalid as invalid, package_table as package_table, warn as warn, wrong as wrong
from typing import Annotated, Any, ClassVar, Literal

DEW_POINTS: Incomplete
_TABLE: Incomplete
GASES: dict[str, Sequence[float]]
VIRIAL: dict[str, list[float]]
CAPACITY_EXCESS: dict[str, list[float]]
CAPACITY_CELSIUS: list[float]

def anr_density_kg_m3(heat_capacity_ratio: float, gas_constant: float) -> float: ...

class Gas(Described):
    table_name: ClassVar[str]
    name: Literal["air", "nitrogen", "argon", "helium", "carbon-dioxide"] | None
    heat_capacity_ratio: float
    gas_constant_j_kg_k: float
    model: Literal["ideal", "virial"]
    dew_point_k: float | None
    dew_point_pressure: MaybePressure

    @property
    def anr_density_kg_m3(self) -> float: ...
    def core(self) -> Plain: ...
    def dew_point_pressure_pa(self, ambient_pa: float, supply_pa: float | None) -> float | None: ...
    @property
    def gas_constant(self) -> _UnitFloat: ...
    @property
    def dew_point(self) -> _UnitFloat | None: ...
    def __init__(
        self,
        *,
        name: _Literal["air", "nitrogen", "argon", "helium", "carbon-dioxide"] | None = ...,
        heat_capacity_ratio: _Given = ...,
        gas_constant: _Given = ...,
        model: _Literal["ideal", "virial"] = ...,
        dew_point: _Given | None = ...,
        dew_point_pressure: _Given | _Pressure | None = ...,
    ) -> None: ...

class Ambient(Described):
    table_name: ClassVar[str]
    pressure: units.Pressure
    temperature_k: marks.Temperature

    @property
    def pressure_pa(self) -> float: ...
    def core(self) -> NamedNumbers: ...
    @property
    def temperature(self) -> _UnitFloat: ...
    def __init__(self, *, pressure: _Given | _Pressure = ..., temperature: _Given = ...) -> None: ...

class Supply(Described):
    table_name: ClassVar[str]
    pressure: units.Pressure
    temperature_k: MaybeTemperature

    @property
    def temperature(self) -> _UnitFloat | None: ...
    def __init__(self, *, pressure: _Given | _Pressure, temperature: _Given | None = ...) -> None: ...

KINDS: Incomplete
MaybeArea: Incomplete

def piston_areas(kind: str, bore_m: float, rod_diameter_m: float) -> Pair: ...
def double_acting(core_json: str) -> dict[str, Plain]: ...
def chamber_volumes(cylinder: Plain, position_m: Array) -> ArrayPair: ...
def check_rod(table: str, kind: str, bore_m: float, rod_diameter_m: float | None) -> None: ...

class PistonTable(Described):
    kind: Literal["rodless", "through-rod", "single-rod"]
    bore_m: marks.MaybeLength
    rod_diameter_m: marks.MaybeLength
    area_a_m2: MaybeArea
    area_b_m2: MaybeArea

    def areas(self) -> Pair: ...
    @property
    def bore(self) -> _UnitFloat | None: ...
    @property
    def rod_diameter(self) -> _UnitFloat | None: ...
    @property
    def area_a(self) -> _UnitFloat | None: ...
    @property
    def area_b(self) -> _UnitFloat | None: ...
    def __init__(
        self,
        *,
        kind: _Literal["rodless", "through-rod", "single-rod"] = ...,
        bore: _Given | None = ...,
        rod_diameter: _Given | None = ...,
        area_a: _Given | None = ...,
        area_b: _Given | None = ...,
    ) -> None: ...

class _DrivePart(Described):
    @classmethod
    def refuse_kind_of_circuits(cls, data: Any) -> Any: ...

class EndStop(Described):
    table_name: ClassVar[str]
    stiffness_n_m: float | None
    damping_n_s_m: float | None
    damping_depth_m: marks.MaybeLength

    @property
    def stiffness(self) -> _UnitFloat | None: ...
    @property
    def damping(self) -> _UnitFloat | None: ...
    @property
    def damping_depth(self) -> _UnitFloat | None: ...
    def __init__(
        self, *, stiffness: _Given | None = ..., damping: _Given | None = ..., damping_depth: _Given | None = ...
    ) -> None: ...

def assumed_stops(prefix: str, given: Collection[str], stops: tuple[Sequence[float], Sequence[float]]) -> list[str]: ...

_ELSEWHERE: Incomplete

def _elsewhere(table: str) -> dict[str, str]: ...

class Cylinder(_DrivePart):
    table_name: ClassVar[str]
    elsewhere: ClassVar[Mapping[str, str]]
    kind: Literal["rodless", "through-rod", "single-rod"]
    bore_m: marks.Length
    rod_diameter_m: marks.MaybeLength
    stroke_m: marks.Length
    dead_volume_m3: marks.PerChamber
    moving_mass_kg: marks.Mass
    incline_rad: marks.Angle
    heat_transfer_w_m2_k: float | None
    heat_transfer_scale: float
    port_diameter_m: marks.MaybeLength
    wall_temperature_k: MaybeTemperature
    leakage_m3_s_pa: float
    end_stop: EndStop
    chamber_law: Literal["energy-balance", "as-printed"]

    @property
    def area_a_m2(self) -> float: ...
    @property
    def area_b_m2(self) -> float: ...
    @property
    def bore(self) -> _UnitFloat: ...
    @property
    def rod_diameter(self) -> _UnitFloat | None: ...
    @property
    def stroke(self) -> _UnitFloat: ...
    @property
    def dead_volume(self) -> _PerChamber: ...
    @property
    def moving_mass(self) -> _UnitFloat: ...
    @property
    def incline(self) -> _UnitFloat: ...
    @property
    def heat_transfer(self) -> _UnitFloat | None: ...
    @property
    def port_diameter(self) -> _UnitFloat | None: ...
    @property
    def wall_temperature(self) -> _UnitFloat | None: ...
    @property
    def leakage(self) -> _UnitFloat: ...
    def __init__(
        self,
        *,
        kind: _Literal["rodless", "through-rod", "single-rod"],
        bore: _Given,
        rod_diameter: _Given | None = ...,
        stroke: _Given,
        dead_volume: _Given | _Sequence[_Any],
        moving_mass: _Given,
        incline: _Given = ...,
        heat_transfer: _Given | None = ...,
        heat_transfer_scale: _Given = ...,
        port_diameter: _Given | None = ...,
        wall_temperature: _Given | None = ...,
        leakage: _Given = ...,
        end_stop: EndStop | _Mapping[str, _Any] = ...,
        chamber_law: _Literal["energy-balance", "as-printed"] = ...,
    ) -> None: ...

SWITCHING: str

class Valve(_DrivePart):
    table_name: ClassVar[str]
    elsewhere: ClassVar[Mapping[str, str]]
    kind: Literal["proportional-5/3", "switching-5/3"]
    conductance_given: float | None
    nominal_flow_m3_s_anr: float | None
    kv: float | None
    cv: float | None
    critical_pressure_ratio: marks.Fraction
    subsonic_index: float
    linear_above: marks.Fraction
    overlap: float | None
    leakage: float | None
    command: marks.Signal | None
    time_on_s: float | None
    time_off_s: float | None

    @property
    def is_switching(self) -> bool: ...
    @property
    def has_shape(self) -> bool: ...
    @property
    def conductance(self) -> units.UnitFloat: ...
    @property
    def conductance_m3_s_pa(self) -> float: ...
    @property
    def nominal_flow(self) -> _UnitFloat | None: ...
    @property
    def time_on(self) -> _UnitFloat | None: ...
    @property
    def time_off(self) -> _UnitFloat | None: ...
    def __init__(
        self,
        *,
        kind: _Literal["proportional-5/3", "switching-5/3"],
        conductance: _Given | None = ...,
        nominal_flow: _Given | None = ...,
        kv: _Given | _Sequence[_Any] | None = ...,
        cv: _Given | _Sequence[_Any] | None = ...,
        critical_pressure_ratio: _Given = ...,
        subsonic_index: _Given = ...,
        linear_above: _Given = ...,
        overlap: _Given | None = ...,
        leakage: _Given | None = ...,
        command: _Given | _Sequence[_Any] | None = ...,
        time_on: _Given | None = ...,
        time_off: _Given | None = ...,
    ) -> None: ...

class Spring(Described):
    table_name: ClassVar[str]
    stiffness_n_m: marks.Stiffness
    rest_position_m: marks.Position

    @property
    def stiffness(self) -> _UnitFloat: ...
    @property
    def rest_position(self) -> _UnitFloat: ...
    def __init__(self, *, stiffness: _Given, rest_position: _Given = ...) -> None: ...

class Load(Described):
    table_name: ClassVar[str]
    elsewhere: ClassVar[Mapping[str, str]]
    mass_kg: float
    force_n: marks.Force
    spring: Spring | _Any

    @property
    def mass(self) -> _UnitFloat: ...
    @property
    def force(self) -> _UnitFloat: ...
    def __init__(
        self, *, mass: _Given = ..., force: _Given = ..., spring: Spring | _Mapping[str, _Any] | None = ...
    ) -> None: ...

class Initial(Described):
    table_name: ClassVar[str]
    position_m: float | None
    velocity_m_s: marks.Velocity
    contact_age_s: float
    pressure_a: MaybePressure
    pressure_b: MaybePressure
    temperature_a_k: MaybeTemperature
    temperature_b_k: MaybeTemperature

    @property
    def position(self) -> _UnitFloat | None: ...
    @property
    def velocity(self) -> _UnitFloat: ...
    @property
    def contact_age(self) -> _UnitFloat: ...
    @property
    def temperature_a(self) -> _UnitFloat | None: ...
    @property
    def temperature_b(self) -> _UnitFloat | None: ...
    def __init__(
        self,
        *,
        position: _Given | None = ...,
        velocity: _Given = ...,
        contact_age: _Given = ...,
        pressure_a: _Given | _Pressure | None = ...,
        pressure_b: _Given | _Pressure | None = ...,
        temperature_a: _Given | None = ...,
        temperature_b: _Given | None = ...,
    ) -> None: ...
