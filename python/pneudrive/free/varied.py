"""Numbers of a description that vary: name, unit and written form."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from pneudrive import units
from pneudrive.describe.marks import Quantity, StatedPressure

if TYPE_CHECKING:
    from pneudrive.describe.base import Described

#: Names of the start state in a design begin so.
INITIAL = "initial."


class Varied(NamedTuple):
    """A number that varies: its name in the drive file, its SI unit, and its written form."""

    name: str
    unit: str
    mark: Quantity | StatedPressure | None

    @property
    def file_name(self) -> str:
        """Name of its column in a file, which carries the unit."""
        return units.column_name(self.name, self.unit)

    def written(self, si: float) -> str | float:
        """Write a value in the form of the drive file."""
        if self.unit == "Pa" and isinstance(self.mark, StatedPressure):
            return f"{si!r} Pa abs"
        return si if self.unit in ("1", "") else units.write(si, self.unit)


def field_marks(kind: type[Described]) -> dict[str, Quantity | StatedPressure]:
    """Return the written form of each quantity of a table, by its key."""
    fields = zip(kind.keys(), kind.model_fields.values(), strict=True)
    marked = ((key, mark) for key, field in fields for mark in field.metadata)
    return {key: mark for key, mark in marked if isinstance(mark, Quantity | StatedPressure)}


def mark_unit(mark: Quantity | StatedPressure) -> str:
    """Return the SI unit for a written form."""
    return "Pa" if isinstance(mark, StatedPressure) else mark.si_unit or "1"
