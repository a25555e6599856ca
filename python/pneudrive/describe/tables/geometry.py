"""Piston areas for each kind of cylinder, and chamber volumes."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Annotated, Literal

from pneudrive import units
from pneudrive.describe.base import Described
from pneudrive.describe.marks import POSITIVE, MaybeLength, Quantity
from pneudrive.errors import invalid

if TYPE_CHECKING:
    from pneudrive.arrays import Array, ArrayPair, Pair, Plain

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
    bore_m: MaybeLength = None
    rod_diameter_m: MaybeLength = None
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
