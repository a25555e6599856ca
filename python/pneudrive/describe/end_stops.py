"""End stops that follow from a drive, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    #: Stiffness N/m, damping N s/m, damping depth m; and mass kg, speed m/s, force N that they take up in a depth m.
    Stops = tuple[Sequence[float], Sequence[float]]


def assumed(prefix: str, given: Collection[str], stops: Stops) -> list[str]:
    """Say which end stops were taken where a description leaves them open, and what they follow from.

    Parameters
    ----------
    prefix : str
        Of their keys, ``"cylinder.end_stop."``.
    given : collection of str
        Keys that the description gives: ``"stiffness"``, ``"damping"``, ``"damping_depth"``.
    stops : tuple
        Stops and what they take up, as the core returns them.

    Returns
    -------
    list of str
        ``key = value, reason``.
    """
    (stiffness, damping, damping_depth), (mass, speed, force, depth) = stops
    taken = f"{mass:.3g} kg at {speed:.3g} m/s, driven by {force:.3g} N, stop within {1e3 * depth:.3g} mm"
    still = f"that force alone holds the piston {1e3 * force / stiffness:.2g} mm beyond the stroke"
    lines = {
        "stiffness": f"{stiffness:.3g} N/m, so that {taken}, half of the shorter dead length; {still}",
        "damping": f"{damping:.3g} N s/m, half of the critical damping",
        "damping_depth": f"{1e3 * damping_depth:.3g} mm, a tenth of the depth in which the stop takes all",
    }
    return [f"{prefix}{key} = {line}".replace("e+0", "e") for key, line in lines.items() if key not in given]
