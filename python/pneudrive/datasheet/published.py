"""Published figures of the catalogue's parts, compared with the results of the drive's simulated test stands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive import units
from pneudrive.constants import ANR_DENSITY_KG_M3
from pneudrive.datasheet.characteristic import characteristic
from pneudrive.datasheet.characteristics.steady import least_pressure
from pneudrive.datasheet.equilibrium import at_velocity
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.datasheet.stands import flow_through
from pneudrive.describe.files.catalogue import entries
from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pneudrive.datasheet.characteristic import Found
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.files.catalogue import Entry

BEFORE_PA, RATIO = 7e5, 6.0 / 7.0  # nominal flow: from 6 to 5 bar above the 100 kPa of the reference atmosphere
SLOW = 0.05  # m/s: an effective force is one in slow motion


def _alone(drive: Drive) -> Drive:
    """Return a drive in the makers' test conditions: level, with air, without lines and load."""
    beside = ("tubing", "flow_control", "load", "gas", "provenance")
    tables = {name: one for name, one in drive.to_dict().items() if name not in beside}
    return type(drive).model_validate(tables | {"cylinder": tables["cylinder"] | {"incline": "0 deg"}})


def _nominal_flow(drive: Drive) -> float:
    ratios = np.array([RATIO])
    flow = flow_through(HeldDrive(_alone(drive)), "a", inward=True, upstream=BEFORE_PA, ratios=ratios)
    return float(flow[0]) / ANR_DENSITY_KG_M3


def _at_6_bar(drive: Drive) -> HeldDrive:
    return HeldDrive(_alone(drive).replace({"supply.pressure": "6 bar gauge"})).static


def _theoretical(drive: Drive) -> float:
    plant = _at_6_bar(drive)
    return at_velocity(plant, 1.0, 0.5 * plant.stroke_m, 0.0).gas_force_n


def _effective(drive: Drive) -> float:
    plant = _at_6_bar(drive)
    found = at_velocity(plant, 1.0, 0.5 * plant.stroke_m, 0.0)
    pressures = (found.pressure_a_pa, found.pressure_b_pa)
    return found.gas_force_n - abs(plant.sliding(SLOW, pressures, 0.5 * plant.stroke_m))


def _minimum(drive: Drive) -> float:
    plant = HeldDrive(_alone(drive))
    return least_pressure(plant, 1.0) - plant.ambient[0]


class SheetFigure(NamedTuple):
    """A printed figure: SI unit (empty for a gauge pressure), calculation from the drive, meaning."""

    unit: str
    of: Callable[[Drive], float]
    meaning: str


FIGURES = {
    "nominal_flow": SheetFigure("m^3/s ANR", _nominal_flow, "flow from 6 to 5 bar gauge, virtual test stand"),
    "theoretical_force_6bar": SheetFigure("N", _theoretical, "blocked force at 6 bar gauge"),
    "effective_force_6bar": SheetFigure("N", _effective, "blocked force minus friction at 50 mm/s, 6 bar gauge"),
    "minimum_operating_pressure": SheetFigure("", _minimum, "minimum pressure, above ambient"),
}


def parts_of(drive: Drive) -> Iterator[Entry]:
    """Yield the parts of the catalogue whose sourced values are all values of the drive."""
    own = {origin.key: origin.value for origin in drive.origins}
    for part in entries().values():
        table = part.kind.partition("/")[0]
        sourced = [value for value in part.values if value.source is not None]
        if part.is_drive or table not in ("valve", "cylinder") or not sourced:
            continue
        if part.kind.partition("/")[2] != getattr(drive, table).kind:
            continue
        if all(own.get(_key(table, one.key)) in (one.value, str(one.value).partition("/")[2]) for one in sourced):
            yield part


def _key(table: str, key: str) -> str:
    return key if key.startswith("friction.") else f"{table}.{key}"


def _printed(text: str, unit: str) -> float:
    return units.parse(text, unit) if unit else units.parse_pressure(text).value_pa


@characteristic(
    "published",
    definition="Published figures of the parts of this drive, and the figures of the drive: "
    + "; ".join(f"{key.replace('_', ' ')}: {one.meaning}" for key, one in FIGURES.items())
    + ".",
    algorithm="the characteristics of this list, under the conditions of the print",
    slow=True,
    held=False,
)
def _published(plant: HeldDrive) -> Found:
    """Printed figures of the parts.

    Results
    -------
    figure : 1
        part, figure and source
    printed : SI over figure
        value printed by the maker, in SI
    computed : SI over figure
        of this drive, in SI
    difference : 1 over figure
        computed over printed value, minus 1
    """  # noqa: D401 - a title
    drive: Any = plant.described
    rows = []
    for part in parts_of(drive) if hasattr(drive, "origins") else ():
        for figure in part.printed:
            if figure.key in FIGURES:
                one = FIGURES[figure.key]
                title = f"{part.name}: {figure.key.replace('_', ' ')} {figure.value} [{figure.source}]"
                rows.append((title, _printed(figure.value, one.unit), one))
    if not rows:
        raise CommandError(f"{plant.name}: no part of the catalogue with a printed figure is in this drive")
    printed, computed = np.array([row[1] for row in rows]), np.array([row[2].of(drive) for row in rows])
    return {
        "figure": [row[0] for row in rows],
        "printed": printed,
        "computed": computed,
        "difference": computed / printed - 1.0,
    }
