# Written by tools/stubs.py from pneudrive.describe.tables.dependences: do not edit.
from collections.abc import Mapping as _Mapping, Sequence as _Sequence
from typing import Any as _Any, Literal as _Literal, TypeAlias as _TypeAlias

from pneudrive.describe.marks import PerChamber as _PerChamber
from pneudrive.units import Pressure as _Pressure, UnitFloat as _UnitFloat

_Given: _TypeAlias = str | float | _UnitFloat | _Mapping[str, _Any]
from _typeshed import Incomplete
from pneudrive.arrays import Plain as Plain
from pneudrive.describe import marks as marks
from pneudrive.describe.base import Described as Described
from pneudrive.describe.marks import (
    Bounds as Bounds,
    EachChamber as EachChamber,
    Length as Length,
    NOT_NEGATIVE as NOT_NEGATIVE,
    POSITIVE as POSITIVE,
    PerChamber as PerChamber,
    Position as Position,
    Quantity as Quantity,
)
from pneudrive.errors import invalid as invalid, wrong as wrong
from typing import Annotated, Any, ClassVar, Literal

Duration: Incomplete
_Factor: Incomplete
MOST_HARMONICS: int
MOST_POINTS: int

class Acting(Described):
    def core(self) -> Plain: ...

class SealPressure(Acting):
    table_name: ClassVar[str]
    coulomb_n_pa: PerChamber = ...
    breakaway_n_pa: PerChamber = ...

    @property
    def coulomb(self) -> _PerChamber: ...
    @property
    def breakaway(self) -> _PerChamber: ...
    def __init__(
        self, *, coulomb: _Given | _Sequence[_Any] = ..., breakaway: _Given | _Sequence[_Any] = ...
    ) -> None: ...

class Dwell(Acting):
    table_name: ClassVar[str]
    growth: Literal["saturating", "log", "hyperbolic"]
    increment_n: float
    time_s: Duration
    exponent: float = ...
    distance_m: Length
    pressure_per_pa: PerChamber = ...

    @property
    def increment(self) -> _UnitFloat: ...
    @property
    def time(self) -> _UnitFloat: ...
    @property
    def distance(self) -> _UnitFloat: ...
    @property
    def pressure(self) -> _PerChamber: ...
    def __init__(
        self,
        *,
        growth: _Literal["saturating", "log", "hyperbolic"],
        increment: _Given,
        time: _Given,
        exponent: _Given = ...,
        distance: _Given,
        pressure: _Given | _Sequence[_Any] = ...,
    ) -> None: ...

class Relaxation(Acting):
    table_name: ClassVar[str]
    share: marks.Fraction
    time_s: Duration
    distance_m: Length

    @property
    def time(self) -> _UnitFloat: ...
    @property
    def distance(self) -> _UnitFloat: ...
    def __init__(self, *, share: _Given, time: _Given, distance: _Given) -> None: ...

class Harmonic(Acting):
    table_name: ClassVar[str]
    period_m: Length
    amplitude: float
    phase_rad: float = ...

    @property
    def period(self) -> _UnitFloat: ...
    @property
    def phase(self) -> _UnitFloat: ...
    def __init__(self, *, period: _Given, amplitude: _Given, phase: _Given = ...) -> None: ...

class PositionPoint(Acting):
    table_name: ClassVar[str]
    position_m: Position
    factor: _Factor

    @property
    def position(self) -> _UnitFloat: ...
    def __init__(self, *, position: _Given, factor: _Given) -> None: ...

class PositionDependence(Acting):
    table_name: ClassVar[str]
    points: tuple[PositionPoint, ...] = ...
    harmonics: tuple[Harmonic, ...] = ...
    slope_per_m: float = ...
    reference_m: Position = ...

    def core(self) -> Plain: ...
    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> Plain: ...
    @property
    def table(self) -> _Any: ...
    @property
    def slope(self) -> _UnitFloat: ...
    @property
    def reference(self) -> _UnitFloat: ...
    def __init__(
        self,
        *,
        table: _Sequence[_Any] = ...,
        harmonics: _Sequence[_Any] = ...,
        slope: _Given = ...,
        reference: _Given = ...,
    ) -> None: ...

class DirectionDependence(Acting):
    table_name: ClassVar[str]
    positive: _Factor = ...
    negative: _Factor = ...

    def __init__(self, *, positive: _Given = ..., negative: _Given = ...) -> None: ...

class SideLoad(Acting):
    table_name: ClassVar[str]
    force_n: marks.Force
    coefficient: float

    @property
    def force(self) -> _UnitFloat: ...
    def __init__(self, *, force: _Given, coefficient: _Given) -> None: ...

class TemperatureDependence(Acting):
    table_name: ClassVar[str]
    reference_k: marks.Temperature
    viscous_per_k: float = ...
    levels_per_k: float = ...
    resistance_k_w: float = ...
    time_s: Duration = ...

    @property
    def reference(self) -> _UnitFloat: ...
    @property
    def viscous(self) -> _UnitFloat: ...
    @property
    def levels(self) -> _UnitFloat: ...
    @property
    def resistance(self) -> _UnitFloat: ...
    @property
    def time(self) -> _UnitFloat: ...
    def __init__(
        self,
        *,
        reference: _Given,
        viscous: _Given = ...,
        levels: _Given = ...,
        resistance: _Given = ...,
        time: _Given = ...,
    ) -> None: ...

class Wear(Acting):
    table_name: ClassVar[str]
    run_in: float = ...
    run_in_distance_m: Length = ...
    rate_per_m: float = ...
    slid_m: float = ...

    @property
    def run_in_distance(self) -> _UnitFloat: ...
    @property
    def rate(self) -> _UnitFloat: ...
    @property
    def slid(self) -> _UnitFloat: ...
    def __init__(
        self, *, run_in: _Given = ..., run_in_distance: _Given = ..., rate: _Given = ..., slid: _Given = ...
    ) -> None: ...

DEPENDENCES: dict[str, type[Described]]
