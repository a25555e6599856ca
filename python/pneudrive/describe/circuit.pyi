# Written by tools/stubs.py from pneudrive.describe.circuit: do not edit.
from collections.abc import Mapping as _Mapping, Sequence as _Sequence
from typing import Any as _Any, Literal as _Literal, TypeAlias as _TypeAlias

from pneudrive.describe.marks import PerChamber as _PerChamber
from pneudrive.units import Pressure as _Pressure, UnitFloat as _UnitFloat

_Given: _TypeAlias = str | float | _UnitFloat | _Mapping[str, _Any]
from pneudrive.describe.tables.parts import Ambient
from pneudrive.describe.tables.parts import Gas
import xarray as xr
from _typeshed import Incomplete
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from pneudrive.arrays import Keyed as Keyed, NamedNumbers as NamedNumbers, Plain as Plain
from pneudrive.describe.base import as_tables as as_tables, inline as inline
from pneudrive.describe.components import (
    Component as Component,
    component as component,
    component_class as component_class,
    unusual as unusual,
    within_component as within_component,
)
from pneudrive.describe.connections import AMBIENT as AMBIENT, ARROW as ARROW, Part as Part, Wiring as Wiring
from pneudrive.describe.files import catalogue as catalogue, toml as toml
from pneudrive.describe.files.sourced import Value as Value
from pneudrive.describe.formulas import formula_of as formula_of, law_of as law_of, read_file as read_file
from pneudrive.describe.kinds import COMMAND as COMMAND, component_kinds as component_kinds
from pneudrive.describe.marks import Positions as Positions, Signal as Signal
from pneudrive.describe.system import (
    DRIVE_NAMES as DRIVE_NAMES,
    DescribedSystem as DescribedSystem,
    PISTON as PISTON,
    ShortNames as ShortNames,
    System as System,
)
from pneudrive.describe.tables.parts import assumed_stops as assumed_stops
from pneudrive.describe.tables.starts import (
    PRESSURE as PRESSURE,
    Starts as Starts,
    check_platforms as check_platforms,
    start_place as start_place,
    start_values as start_values,
)
from pneudrive.describe.tables.valve_flow import (
    FLOW_KEYS as FLOW_KEYS,
    NEEDLE as NEEDLE,
    without_other_sizes as without_other_sizes,
)
from pneudrive.errors import (
    DescriptionError as DescriptionError,
    Problems as Problems,
    invalid as invalid,
    nearest as nearest,
    together as together,
    warn as warn,
    wrong as wrong,
)
from pneudrive.lazy_names import upper as upper
from pneudrive.progress import Flag as Flag, Progress as Progress
from pneudrive.repr_tables import Card as Card
from pneudrive.simulation.command import Commands as Commands
from typing import Any, ClassVar, Literal

_NAME: Incomplete
STOP_KEYS: Incomplete
TABLES: Incomplete
CHAMBERS: Incomplete
_CHECK: str
_SAME: str

class Short:
    components: dict[str, dict[str, Any]]
    places: dict[str, str]
    chains: Incomplete
    _given: Incomplete

    def __init__(self, data: Keyed, problems: Problems) -> None: ...
    def _add(self, name: str, place: str, table: Plain) -> None: ...
    def located(self, key: str | None) -> str | None: ...

def _tables(data: Keyed, problems: Problems) -> Plain: ...
def _flow_control(table: Keyed, where: str) -> Plain: ...
def _tube(table: Keyed, where: str) -> Plain: ...

_ENDS: Incomplete
TUBES: Incomplete
_LINES: dict[str, tuple[str, str, Any]]

def _chains(has: Keyed, data: Keyed) -> list[str]: ...
def _has_ports(table: Keyed, *names: str) -> bool: ...

class Circuit(DescribedSystem):
    file_kind: ClassVar[str]
    key_prefix: ClassVar[str]
    derived: ClassVar[tuple[str, ...]]
    name: str = ...
    components: dict[str, Component]
    connections: tuple[str, ...] = ...
    plugged: tuple[str, ...] = ...
    junctions: Literal["volume", "series"] = ...
    initial: dict[str, Any] = ...
    labels: dict[str, str] = ...

    @property
    def dew_point_pressure_pa(self) -> float | None: ...
    @classmethod
    def load(cls, source: str | Path) -> Circuit: ...
    @classmethod
    def from_tables(cls, tables: Plain, text: str, path: Path) -> Circuit: ...
    def replace(self, changes: Plain) -> Circuit: ...
    @cached_property
    def wiring(self) -> Wiring: ...
    @property
    def commandable(self) -> dict[str, Signal | Positions | None]: ...
    is_plain: ClassVar[bool]

    @property
    def axis_names(self) -> ShortNames: ...
    @property
    def meanings(self) -> dict[str, str]: ...
    @cached_property
    def system(self) -> System: ...
    @property
    def core_parts(self) -> dict[str, Plain]: ...
    @property
    def circuit(self) -> Circuit: ...
    def circuit_values(self, given: object) -> Keyed: ...
    @cached_property
    def origin_of(self) -> dict[str, Value]: ...
    @property
    def component_places(self) -> list[tuple[str, str]]: ...
    @property
    def description_hash(self) -> str: ...
    def core_initial(self, initial: object = None) -> NamedNumbers: ...
    @cached_property
    def start_names(self) -> dict[str, str]: ...
    def simulate(
        self,
        commands: Commands,
        duration: str | float,
        *,
        initial: Keyed | str | None = None,
        sample_rate: str | float = "1 kHz",
        rtol: float = 1e-06,
        ledger: bool = False,
        budget: int | None = None,
        progress: Progress | None = None,
        cancel: Flag | None = None,
    ) -> xr.Dataset: ...
    @cached_property
    def assumptions(self) -> list[tuple[str, str]]: ...
    @property
    def joint_volumes(self) -> list[tuple[str, float]]: ...
    @property
    def notes(self) -> list[str]: ...
    @property
    def unusual(self) -> list[str]: ...
    def to_toml(self) -> str: ...
    def __init__(
        self,
        *,
        schema: _Literal[1] = ...,
        name: str = ...,
        gas: Gas | _Mapping[str, _Any] = ...,
        ambient: Ambient | _Mapping[str, _Any] = ...,
        components: _Mapping[str, _Any],
        connections: _Sequence[_Any] = ...,
        plugged: _Sequence[_Any] = ...,
        junctions: _Literal["volume", "series"] = ...,
        initial: _Mapping[str, _Any] = ...,
        labels: _Mapping[str, _Any] = ...,
        **keys: _Any,
    ) -> None: ...

def _completed(data: Plain, short: Short, problems: Problems) -> Plain: ...
def _read_components(
    given: object, problems: Problems
) -> tuple[dict[str, Component], dict[str, Part], dict[str, list[str]]]: ...
def _used(name: str, table: Plain) -> Plain: ...
def _component(name: str, table: object) -> Component: ...
def _relocate(error: Any, short: Short, parts: Mapping[str, Part]) -> Any: ...
