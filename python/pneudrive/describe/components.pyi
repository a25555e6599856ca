# Written by tools/stubs.py from pneudrive.describe.components: do not edit.
from collections.abc import Mapping as _Mapping, Sequence as _Sequence
from typing import Any as _Any, Literal as _Literal, TypeAlias as _TypeAlias

from pneudrive.describe.marks import PerChamber as _PerChamber
from pneudrive.units import Pressure as _Pressure, UnitFloat as _UnitFloat

_Given: _TypeAlias = str | float | _UnitFloat | _Mapping[str, _Any]
from _typeshed import Incomplete
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pneudrive.arrays import Interval as Interval, Keyed as Keyed, NamedNumbers as NamedNumbers, Plain as Plain
from pneudrive.describe import marks as marks
from pneudrive.describe.base import Described as Described, inline as inline
from pneudrive.describe.files import sourced as sourced
from pneudrive.describe.formulas import ComponentFormula as ComponentFormula, formula_of as formula_of, law_of as law_of
from pneudrive.describe.kinds import (
    COMMAND as COMMAND,
    FLOW as FLOW,
    RATIO as RATIO,
    STATED as STATED,
    acts as acts,
    component_kinds as component_kinds,
    flow_keys as flow_keys,
    is_bare as is_bare,
    is_needed as is_needed,
)
from pneudrive.describe.marks import (
    Positions as Positions,
    Quantity as Quantity,
    Signal as Signal,
    StatedPressure as StatedPressure,
    parameter_quantity as parameter_quantity,
)
from pneudrive.describe.tables import valve_flow as valve_flow
from pneudrive.describe.tables.dependences import DEPENDENCES as DEPENDENCES
from pneudrive.describe.tables.friction import Friction as Friction, friction_laws as friction_laws
from pneudrive.errors import (
    DescriptionError as DescriptionError,
    invalid as invalid,
    nearest as nearest,
    package_table as package_table,
    within as within,
    wrong as wrong,
)
from pneudrive.units import Pressure as Pressure, UnitFloat as UnitFloat, column_name as column_name
from typing import Annotated, Any, ClassVar

USUAL: Incomplete

class Component(Described):
    model_config: Incomplete
    entry: ClassVar[Mapping[str, Any]]
    fields: ClassVar[Mapping[str, str]]
    renamed: ClassVar[Mapping[str, str]]
    kind: str
    at: tuple[float, float] | None = ...

    @cached_property
    def origins(self) -> Mapping[str, sourced.Value]: ...
    @classmethod
    def flat(cls, table: Keyed) -> Plain: ...
    @classmethod
    def over(cls, base: Keyed, own: Keyed) -> Plain: ...
    def numbers(self, ambient_pa: float) -> NamedNumbers: ...
    def pressures(self) -> list[Pressure]: ...
    def core(self, ambient_pa: float) -> Plain: ...
    @property
    def command_input(self) -> Signal | Positions | None: ...
    def to_dict(self) -> Plain: ...
    def plain(self) -> Plain: ...
    @property
    def has_heat_law(self) -> bool: ...
    def assumed(self) -> Iterator[str]: ...
    @property
    def idle(self) -> Iterator[str]: ...
    def __reduce__(self) -> tuple[object, ...]: ...
    def __getattr__(self, name: str) -> _Any: ...
    def __init__(self, *, kind: str, at: _Given | _Sequence[_Any] | None = ..., **keys: _Any) -> None: ...

def merge(base: Keyed, changes: Keyed, optional: str = "") -> Plain: ...
def unusual_sizes(
    description: Described, usual: Mapping[str, Interval]
) -> Iterator[tuple[str, UnitFloat, float, str]]: ...
def unusual(name: str, description: Described) -> list[str]: ...
def component(table: Keyed) -> Component: ...
@contextmanager
def within_component(name: str, table: Keyed, above: str = "components.") -> Iterator[None]: ...
def _nested(key: str, table: Keyed) -> str: ...
def rows(entry: Keyed) -> list[tuple[str, str, str, str]]: ...
def _unless(parameter: Keyed) -> str: ...
def _mark(parameter: Keyed) -> Quantity | StatedPressure: ...
def _size(key: str) -> Quantity: ...
def component_class(kind: str, formula: ComponentFormula | None = None) -> type[Component]: ...

_TRUE_OR_FALSE: Incomplete
SWITCHED: dict[str, list[float]]
_PULSES: str
_SPOOL: Incomplete
_SWITCHES: str
