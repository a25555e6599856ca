"""Piston areas of the kinds of cylinder."""

from __future__ import annotations

import math

KINDS = ("rodless", "through-rod", "single-rod")


def piston_areas(kind: str, bore_m: float, rod_diameter_m: float = 0.0) -> tuple[float, float]:
    """Return the areas in m2 on which the pressures in chambers a and b act.

    Parameters
    ----------
    kind : str
        One of `KINDS`; the rod of a ``single-rod`` cylinder is in chamber b.
    bore_m, rod_diameter_m : float
        m; the rod does not count where there is none.

    Examples
    --------
    >>> [round(1e4 * area, 3) for area in piston_areas("single-rod", 0.032, 0.012)]
    [8.042, 6.912]
    """
    full = 0.25 * math.pi * bore_m**2
    ring = 0.25 * math.pi * (bore_m**2 - rod_diameter_m**2)
    return (ring if kind == "through-rod" else full), (full if kind == "rodless" else ring)
