# Written by tools/stubs.py from pneudrive.describe.tables.friction: do not edit.
from collections.abc import Mapping as _Mapping, Sequence as _Sequence
from typing import Any as _Any, Literal as _Literal, TypeAlias as _TypeAlias

from pneudrive.describe.marks import PerChamber as _PerChamber
from pneudrive.units import Pressure as _Pressure, UnitFloat as _UnitFloat

_Given: _TypeAlias = str | float | _UnitFloat | _Mapping[str, _Any]
from pneudrive.describe.tables.dependences import DirectionDependence
from pneudrive.describe.tables.dependences import Dwell
from pneudrive.describe.tables.dependences import PositionDependence
from pneudrive.describe.tables.dependences import Relaxation
from pneudrive.describe.tables.dependences import SealPressure
from pneudrive.describe.tables.dependences import SideLoad
from pneudrive.describe.tables.dependences import TemperatureDependence
from pneudrive.describe.tables.dependences import Wear
from _typeshed import Incomplete
from collections.abc import Callable as Callable, Iterable, Iterator, Mapping
from functools import cached_property
from pneudrive import _core as _core, units as units
from pneudrive.arrays import Keyed as Keyed, NamedNumbers as NamedNumbers, Plain as Plain
from pneudrive.describe import marks as marks
from pneudrive.describe.base import Described as Described
from pneudrive.describe.files import sourced as sourced
from pneudrive.describe.formulas import FILE_PREFIX as FILE_PREFIX, FrictionLaw as FrictionLaw, law_of as law_of
from pneudrive.describe.marks import (
    Quantity as Quantity,
    StatedPressure as StatedPressure,
    Stiffness as Stiffness,
    parameter_quantities as parameter_quantities,
    parameter_quantity as parameter_quantity,
)
from pneudrive.describe.tables import dependences as dependences
from pneudrive.describe.tables.dependences import Acting as Acting, DEPENDENCES as DEPENDENCES
from pneudrive.errors import (
    DescriptionError as DescriptionError,
    invalid as invalid,
    nearest as nearest,
    warn as warn,
    wrong as wrong,
)
from pydantic import ModelWrapValidatorHandler
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

def friction_laws() -> MappingProxyType[str, Plain]: ...
def options_of(entry: Keyed) -> dict[str, bool]: ...
def laws_with(key: str) -> list[str]: ...

StribeckShape: Incomplete
Evolution: Incomplete
MOST_ELEMENTS: int
SHARES_WITHIN: float
CHOICES: Incomplete

class SlipElement(Acting):
    table_name: ClassVar[str]
    stiffness_n_m: Stiffness
    share: float

    @property
    def stiffness(self) -> _UnitFloat: ...
    def __init__(self, *, stiffness: _Given, share: _Given) -> None: ...

DEFAULT_LAW: str
_BREAKAWAY_DISPLACEMENT_M: float
_DAMPING_TIME_S: float
_STRIBECK_VELOCITY_M_S: float
_PASSIVE_SHARE: float
_FOLLOWS: dict[str, tuple[tuple[str, ...], Callable[..., float]]]
ASSUMED_DIGITS: int

def _as_assumed(value: float) -> float: ...
def _following(known: NamedNumbers) -> NamedNumbers: ...
def assumed_from(friction: Friction) -> dict[str, tuple[tuple[str, ...], Callable[..., float]]]: ...
def assumed_with(friction: Friction, changed: NamedNumbers) -> NamedNumbers: ...
def by_default(data: Plain) -> tuple[Plain, Plain]: ...

class Friction(Described):
    table_name: ClassVar[str]
    law: str
    formula: FrictionLaw | _Any = ...
    values: tuple[tuple[str, float], ...] = ...
    given: frozenset[str] = ...
    stribeck_shape: StribeckShape | None = ...
    elements: tuple[SlipElement, ...] = ...
    evolution: Evolution | None = ...
    pressure: SealPressure | _Any = ...
    dwell: Dwell | _Any = ...
    relaxation: Relaxation | _Any = ...
    position: PositionDependence | _Any = ...
    direction: DirectionDependence | _Any = ...
    side_load: SideLoad | _Any = ...
    temperature: TemperatureDependence | _Any = ...
    wear: Wear | _Any = ...

    @property
    def parameters(self) -> Mapping[str, float]: ...
    @cached_property
    def assumed(self) -> tuple[tuple[str, str], ...]: ...
    @property
    def origins(self) -> dict[str, sourced.Value]: ...
    @property
    def note(self) -> str: ...
    def __getattr__(self, name: str) -> units.UnitFloat | float: ...
    def __dir__(self) -> list[str]: ...
    @property
    def entry(self) -> Plain: ...
    def core(self) -> Plain: ...
    def to_dict(self) -> Plain: ...
    def entries(self, *, given: bool = False) -> Iterator[tuple[str, Any, Quantity | StatedPressure | None]]: ...
    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> Plain: ...
    @property
    def attraction(self) -> _UnitFloat: ...
    @property
    def bouc_wen_exponent(self) -> _UnitFloat: ...
    @property
    def breakaway(self) -> _UnitFloat: ...
    @property
    def breakaway_share(self) -> _UnitFloat: ...
    @property
    def bristle_damping(self) -> _UnitFloat: ...
    @property
    def bristle_stiffness(self) -> _UnitFloat: ...
    @property
    def coulomb(self) -> _UnitFloat: ...
    @property
    def dahl_exponent(self) -> _UnitFloat: ...
    @property
    def damping_fade_velocity(self) -> _UnitFloat: ...
    @property
    def dead_zone(self) -> _UnitFloat: ...
    @property
    def direct_effect(self) -> _UnitFloat: ...
    @property
    def distance(self) -> _UnitFloat: ...
    @property
    def evolution_effect(self) -> _UnitFloat: ...
    @property
    def film_decay_time(self) -> _UnitFloat: ...
    @property
    def film_growth_time(self) -> _UnitFloat: ...
    @property
    def film_rest_time(self) -> _UnitFloat: ...
    @property
    def film_rest_velocity(self) -> _UnitFloat: ...
    @property
    def film_velocity(self) -> _UnitFloat: ...
    @property
    def fluid_lead_time(self) -> _UnitFloat: ...
    @property
    def loop_shape(self) -> _UnitFloat: ...
    @property
    def memory_time(self) -> _UnitFloat: ...
    @property
    def recovery_time(self) -> _UnitFloat: ...
    @property
    def reference_velocity(self) -> _UnitFloat: ...
    @property
    def slip_velocity(self) -> _UnitFloat: ...
    @property
    def stribeck_exponent(self) -> _UnitFloat: ...
    @property
    def stribeck_velocity(self) -> _UnitFloat: ...
    @property
    def stribeck_velocity_a(self) -> _UnitFloat: ...
    @property
    def stribeck_velocity_b(self) -> _UnitFloat: ...
    @property
    def viscous(self) -> _UnitFloat: ...
    def __init__(
        self,
        *,
        law: str = ...,
        stribeck_shape: _Literal["gaussian", "exponential", "lorentzian", "free"] | None = ...,
        elements: _Sequence[_Any] = ...,
        evolution: _Literal["ageing", "slip"] | None = ...,
        pressure: SealPressure | _Mapping[str, _Any] | None = ...,
        dwell: Dwell | _Mapping[str, _Any] | None = ...,
        relaxation: Relaxation | _Mapping[str, _Any] | None = ...,
        position: PositionDependence | _Mapping[str, _Any] | None = ...,
        direction: DirectionDependence | _Mapping[str, _Any] | None = ...,
        side_load: SideLoad | _Mapping[str, _Any] | None = ...,
        temperature: TemperatureDependence | _Mapping[str, _Any] | None = ...,
        wear: Wear | _Mapping[str, _Any] | None = ...,
        attraction: _Given = ...,
        bouc_wen_exponent: _Given = ...,
        breakaway: _Given = ...,
        breakaway_share: _Given = ...,
        bristle_damping: _Given = ...,
        bristle_stiffness: _Given = ...,
        coulomb: _Given = ...,
        dahl_exponent: _Given = ...,
        damping_fade_velocity: _Given = ...,
        dead_zone: _Given = ...,
        direct_effect: _Given = ...,
        distance: _Given = ...,
        evolution_effect: _Given = ...,
        film_decay_time: _Given = ...,
        film_growth_time: _Given = ...,
        film_rest_time: _Given = ...,
        film_rest_velocity: _Given = ...,
        film_velocity: _Given = ...,
        fluid_lead_time: _Given = ...,
        loop_shape: _Given = ...,
        memory_time: _Given = ...,
        recovery_time: _Given = ...,
        reference_velocity: _Given = ...,
        slip_velocity: _Given = ...,
        stribeck_exponent: _Given = ...,
        stribeck_velocity: _Given = ...,
        stribeck_velocity_a: _Given = ...,
        stribeck_velocity_b: _Given = ...,
        viscous: _Given = ...,
        **keys: _Any,
    ) -> None: ...
