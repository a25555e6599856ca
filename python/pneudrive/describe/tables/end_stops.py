"""Sentences on end stops that are derived from a drive."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    #: Stiffness N/m, damping N s/m, damping depth m; load case: mass kg, speed m/s, force N, and its depth m.
    Stops = tuple[Sequence[float], Sequence[float]]


def assumed(prefix: str, given: Collection[str], stops: Stops) -> list[str]:
    """Return the assumed values of end stops that a description leaves open, each with its reason.

    Parameters
    ----------
    prefix : str
        Prefix of their keys, ``"cylinder.end_stop."``.
    given : collection of str
        Keys that the description gives: ``"stiffness"``, ``"damping"``, ``"damping_depth"``.
    stops : tuple
        End stops and their load cases, as the core returns them.

    Returns
    -------
    list of str
        ``key = value, reason``.
    """
    (stiffness, damping, damping_depth), (mass, speed, force, depth) = stops
    taken = f"a mass of {mass:.3g} kg at {speed:.3g} m/s, driven by {force:.3g} N, stops in {1e3 * depth:.3g} mm"
    still = f"at rest, this force presses the piston {1e3 * force / stiffness:.2g} mm beyond the stroke"
    lines = {
        "stiffness": f"{stiffness:.3g} N/m, so that {taken} (at most half of the shorter dead length); {still}",
        "damping": f"{damping:.3g} N s/m, half of the critical damping",
        "damping_depth": f"{1e3 * damping_depth:.3g} mm, a tenth of that depth",
    }
    return [f"{prefix}{key} = {line}".replace("e+0", "e") for key, line in lines.items() if key not in given]
