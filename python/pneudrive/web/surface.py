"""A friction map as a surface over speed and pressure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.web.friction import SAME_PA, alike, bar, fit_beside, shown_map

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.identify.result import FrictionFit

    Array = NDArray[Any]

NODES_OF_SPEED, NODES_OF_PRESSURE = 49, 25
NEXT_TO = 1e-9  # of a logarithm of speed: rounding


def map_surface(path: Path, fit_name: str) -> dict[str, Any]:
    """Return the surfaces of a map's fit: friction over speed and the gauge pressure of the chamber that was varied.

    One surface for each pressure of the other chamber at which there is more than one of this one; where both were
    varied together, one along that line. Each reaches over all speeds and pressures of the map; it is ``inside`` what
    was measured between the lowest and the highest speed that were measured at the pressures beside.

    Parameters
    ----------
    path : Path
        Of the map.
    fit_name : str
        Of the fit beside it.

    Returns
    -------
    dict
        ``chamber``, ``fit`` (why there is none), ``speeds``, m/s, and ``gauges``, Pa, of the nodes, and ``levels``: of
        each its label, the numbers of its groups in `shown_map` with their ``at``, Pa, what the fit ``expected`` at
        each point, N, and ``friction``, N, and ``inside``, one row for each gauge; the last three None without a fit.

    Raises
    ------
    RecordingError
        The file is not a friction map.
    """
    groups, (fit, why) = shown_map(path, fit_name)["groups"], fit_beside(path, fit_name)
    speeds = np.array([one["speed"] for group in groups for one in group["points"]])
    gauges = np.array([one["gauges"] for one in groups]).reshape(-1, 2)
    about: dict[str, Any] = {"chamber": "a", "fit": why, "speeds": [], "gauges": [], "levels": []}
    if not len(speeds) or not 0.0 < speeds.min() < speeds.max():
        return about
    along = int(np.ptp(gauges[:, 1]) >= np.ptp(gauges[:, 0]))
    at, other = gauges[:, along], gauges[:, 1 - along]
    nodes = np.geomspace(speeds.min(), speeds.max(), NODES_OF_SPEED), np.linspace(at.min(), at.max(), NODES_OF_PRESSURE)
    about |= {"chamber": "ab"[along], "speeds": nodes[0].tolist(), "gauges": nodes[1].tolist()}
    levels = [one[np.argsort(at[one])] for one in alike(other[:, None]) if len(one) > 1]
    if not levels and len(at) > 1 and np.diff(np.sort(at)).min() >= SAME_PA:
        levels = [np.argsort(at)]
    for inside in levels:
        low, high = bar(other[inside].min()), bar(other[inside].max())
        level: dict[str, Any] = {
            "label": f"chamber {'ba'[along]} at {low} bar gauge"
            if np.ptp(other[inside]) < SAME_PA
            else f"chamber {'ba'[along]} from {low} to {high} bar gauge along with it",
            "groups": inside.tolist(),
            "at": at[inside].tolist(),
            "friction": None,
            "inside": None,
            "expected": None,
        }
        if fit is not None:
            own = [np.array([one["speed"] for one in groups[k]["points"]]) for k in inside]
            level |= _surface(fit, along, (at[inside], other[inside]), own, nodes)
        about["levels"].append(level)
    return about


def _surface(
    fit: FrictionFit, along: int, pressures: tuple[Array, Array], speeds: list[Array], nodes: tuple[Array, Array]
) -> dict[str, Any]:
    """Return the surface of a level: pressures of its groups rise, and so do the nodes of speed and of pressure."""
    at, other = pressures

    def said(speed: Array, gauge: Array, beside: Array) -> Array:
        return fit.predict(speed, *((gauge, beside) if along == 0 else (beside, gauge))).friction_n

    speed, gauge = np.meshgrid(*nodes)
    least, most = (np.interp(nodes[1], at, np.log([end(own) for own in speeds]))[:, None] for end in (np.min, np.max))
    inside = (gauge >= at[0]) & (gauge <= at[-1])
    inside &= (np.log(speed) >= least - NEXT_TO) & (np.log(speed) <= most + NEXT_TO)
    return {
        "friction": said(speed, gauge, np.interp(gauge, at, other)).tolist(),
        "inside": inside.tolist(),
        "expected": [said(own, one, two).tolist() for own, one, two in zip(speeds, at, other, strict=True)],
    }
