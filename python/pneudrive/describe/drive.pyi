# Written by tools/stubs.py from pneudrive.describe.drive: do not edit.
from collections.abc import Mapping as _Mapping, Sequence as _Sequence
from typing import Any as _Any, Literal as _Literal, TypeAlias as _TypeAlias

from pneudrive.describe.marks import PerChamber as _PerChamber
from pneudrive.units import Pressure as _Pressure, UnitFloat as _UnitFloat

_Given: _TypeAlias = str | float | _UnitFloat | _Mapping[str, _Any]
from pneudrive.describe.tables.parts import Ambient
from pneudrive.describe.tables.parts import Gas
from _typeshed import Incomplete
from collections.abc import Callable, Iterable
from functools import cached_property
from pathlib import Path
from pneudrive.arrays import Keyed as Keyed, NamedNumbers as NamedNumbers, Plain as Plain
from pneudrive.describe.base import as_tables as as_tables, inline as inline, key_of as key_of
from pneudrive.describe.circuit import Circuit as Circuit, Short as Short, TABLES as TABLES
from pneudrive.describe.components import merge as merge, unusual as unusual
from pneudrive.describe.files import catalogue as catalogue, provenance as provenance, sourced as sourced, toml as toml
from pneudrive.describe.files.provenance import Origin as Origin
from pneudrive.describe.formulas import law_of as law_of, read_file as read_file
from pneudrive.describe.marks import (
    Positions as Positions,
    Signal as Signal,
    absolute_above_vacuum as absolute_above_vacuum,
)
from pneudrive.describe.system import (
    DRIVE_NAMES as DRIVE_NAMES,
    DescribedSystem as DescribedSystem,
    PISTON as PISTON,
    System as System,
    short_name as short_name,
)
from pneudrive.describe.tables.friction import Friction as Friction
from pneudrive.describe.tables.parts import (
    Cylinder as Cylinder,
    EndStop as EndStop,
    Initial as Initial,
    Load as Load,
    Supply as Supply,
    Valve as Valve,
    assumed_stops as assumed_stops,
)
from pneudrive.describe.tables.starts import (
    StartState as StartState,
    read_initial as read_initial,
    start_state as start_state,
)
from pneudrive.describe.tables.valve_flow import NEEDLE as NEEDLE, conductance_key as conductance_key
from pneudrive.errors import Problems as Problems, invalid as invalid, wrong as wrong
from pneudrive.repr_tables import Card as Card
from typing import Any, ClassVar

_FLOW_SHAPE: Incomplete
_ASSUMED: Incomplete

class _FileOrTable(classmethod):
    def __get__(self, instance: Any, owner: Any = None) -> Any: ...

class Drive(DescribedSystem):
    file_kind: ClassVar[str]
    derived: ClassVar[tuple[str, ...]]
    name: str = ...
    supply: Supply
    cylinder: Cylinder
    valve: Valve
    friction: Friction
    carried: Load = ...
    tubing: dict[str, Any] = ...
    flow_control: dict[str, Any] = ...
    labels: dict[str, str] = ...
    provenance: dict[str, Origin] = ...

    @classmethod
    def load(cls, source: str | Path) -> Drive: ...
    @classmethod
    def from_tables(cls, tables: Plain, text: str, path: Path) -> Drive: ...
    def replace(self, changes: Plain) -> Drive: ...
    def with_origins(self) -> Plain: ...
    @property
    def supply_pressure_pa(self) -> float: ...
    @property
    def dew_point_pressure_pa(self) -> float | None: ...
    @property
    def component_places(self) -> list[tuple[str, str]]: ...
    @property
    def is_plain(self) -> bool: ...
    @property
    def plain(self) -> Drive: ...
    @cached_property
    def circuit(self) -> Circuit: ...
    @cached_property
    def system(self) -> System: ...
    @property
    def commandable(self) -> dict[str, Signal | Positions | None]: ...
    @property
    def meanings(self) -> dict[str, str]: ...
    @cached_property
    def description_hash(self) -> str: ...
    def short_form(self) -> Plain: ...
    def core_initial(self, initial: StartState = None) -> NamedNumbers: ...
    def circuit_values(self, given: StartState) -> Plain: ...
    @property
    def end_stop(self) -> NamedNumbers: ...
    @cached_property
    def assumptions(self) -> list[tuple[str, str]]: ...
    @property
    def notes(self) -> list[str]: ...
    def __init__(
        self,
        *,
        schema: _Literal[1] = ...,
        name: str = ...,
        gas: Gas | _Mapping[str, _Any] = ...,
        ambient: Ambient | _Mapping[str, _Any] = ...,
        supply: Supply | _Mapping[str, _Any],
        cylinder: Cylinder | _Mapping[str, _Any],
        valve: Valve | _Mapping[str, _Any],
        friction: Friction | _Mapping[str, _Any],
        load: Load | _Mapping[str, _Any] = ...,
        tubing: _Mapping[str, _Any] = ...,
        flow_control: _Mapping[str, _Any] = ...,
        labels: _Mapping[str, _Any] = ...,
        provenance: _Mapping[str, _Any] = ...,
    ) -> None: ...

def _untouched(values: Iterable[sourced.Value], changes: Keyed) -> dict[str, sourced.Value]: ...
