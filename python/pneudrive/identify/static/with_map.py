"""A fit that was read from a file, together with the friction map that it was fitted to."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from pneudrive.errors import FitError
from pneudrive.estimate.estimates import CONFIDENCE, student
from pneudrive.identify.static.fit import fingerprint, recordings_of
from pneudrive.identify.static.model_selection import estimated, interval_over_knees
from pneudrive.identify.static.observations import observations
from pneudrive.identify.static.result import FrictionFit
from pneudrive.identify.static.sliding_fit import SlidingFit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.identify.base import Fit
    from pneudrive.identify.static.model import Observations

    Array = NDArray[np.float64]

Sliding = TypeVar("Sliding", bound=SlidingFit)

#: Probabilities of the intervals that make a profile.
PROBABILITIES = (0.1, 0.25, 0.4, 0.5, 0.6, 0.7, 0.8, 0.875, 0.925, CONFIDENCE, 0.97, 0.985, 0.99)


def values_of_fit(friction_map: xr.Dataset, provenance: Mapping[str, Any]) -> Observations | None:
    """Return the values that a fit with this provenance takes from a map; None from a map of other recordings.

    Parameters
    ----------
    friction_map : xarray.Dataset
    provenance : mapping
        Points of a `SlidingFit`.

    Raises
    ------
    FitError
        No row of the map can be used.
    """
    names, of_row = list(provenance.get("recordings", ())), friction_map["recording"].to_numpy().astype(str)
    if names and recordings_of(friction_map) != names:
        if not set(names) <= set(of_row):
            return None
        friction_map = friction_map.isel(row=np.flatnonzero(np.isin(of_row, names)))
    direction = provenance["direction"]
    return observations(
        friction_map,
        direction=None if direction == "both" else int(direction),
        ambient_pressure_pa=float(provenance["ambient_pressure_pa"]),
        exclude_flags=provenance.get("exclude_flags", ()),
    )[0]


def with_map(fit: Sliding, friction_map: xr.Dataset) -> Sliding:
    """Return a fit with the values of its map, which gives its residuals (`Fit.compared`, `Fit.report`).

    Parameters
    ----------
    fit : FrictionFit or LawFit
        From a file.
    friction_map : xarray.Dataset
        The map that it was fitted to.

    Raises
    ------
    FitError
        The map is not that of the fit, by the hash in the fit's provenance.
    """
    return replace(fit, observations=_values(fit, friction_map))


def _values(fit: SlidingFit, friction_map: xr.Dataset) -> Observations:
    data = values_of_fit(friction_map, fit.provenance)
    if data is None or fingerprint(data) != fit.provenance["map_sha256"]:
        raise FitError(
            "the friction map is not the one of this fit",
            rule="the values have the hash map_sha256 of the fit's provenance",
            remedy="Name the map that was fitted, or fit again.",
        )
    return data


def profiles(
    fit: FrictionFit, friction_map: xr.Dataset, probabilities: Sequence[float] = PROBABILITIES
) -> dict[str, Array]:
    """Return intervals by profile likelihood for several probabilities.

    They show how well the data determine each value.

    Parameters
    ----------
    fit : FrictionFit
    friction_map : xarray.Dataset
        The map that it was fitted to.
    probabilities : sequence of float
        Probability of the intervals, shape (n,). At 0.95 they are the intervals of the fit.

    Returns
    -------
    dict
        Free value -> lower and upper ends, SI, shape (n, 2). Infinite if the data do not bound the value.

    Raises
    ------
    FitError
        The map is not that of the fit.
    """
    loss = str(fit.provenance["loss"])
    data, found, _, dof = estimated(fit.model, _values(fit, friction_map), loss)
    each = [interval_over_knees(fit.model, data, found, student(dof, share), loss) for share in probabilities]
    return {name: np.array([one[name] for one in each]) for name in fit.free}


class Ellipse(NamedTuple):
    """The first-order 95 % ellipse of two values. Its projections are value ± t times standard error.

    Attributes
    ----------
    x, y : str
        Names of the values.
    correlation : float
    points : ndarray, shape (n, 2)
        Its outline, closed, SI.
    """

    x: str
    y: str
    correlation: float
    points: Array


def ellipses(fit: Fit, count: int = 6, points: int = 73) -> list[Ellipse]:
    """Return the ellipses of the pairs of determined values with the largest correlations.

    Parameters
    ----------
    fit : Fit
        Fit of any kind, also from a file.
    count : int
        Largest number of pairs.
    points : int
        Points of an outline.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, points)
    circle = np.stack([np.cos(turn), np.sin(turn)])
    known = [k for k, name in enumerate(fit.free) if name in fit.standard_errors]
    pairs = [(i, j) for i in known for j in known if i < j]
    pairs.sort(key=lambda pair: -abs(fit.correlation[pair]))
    values = {name: value for table in fit.tables() for name, value in table.items()}
    out = []
    for i, j in pairs[:count]:
        names = fit.free[i], fit.free[j]
        part = fit.covariance[np.ix_([i, j], [i, j])]
        if not np.all(np.diag(part) > 0.0):
            continue
        size = np.sqrt(np.diag(part))
        rho = float(np.clip(fit.correlation[i, j], -1.0, 1.0))
        root = np.array([[1.0, 0.0], [rho, np.sqrt(1.0 - rho * rho)]])
        outline = np.array([values[name] for name in names])[:, None] + fit.reach * size[:, None] * (root @ circle)
        out.append(Ellipse(*names, rho, outline.T))
    return out
