"""Selection of the independent values of a friction map for a fit."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError
from pneudrive.estimate.losses import moderate
from pneudrive.identify.base import SIMULATED
from pneudrive.identify.static.model import Observations

if TYPE_CHECKING:
    from collections.abc import Collection

    import xarray as xr
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

REQUIRED = ("recording", "direction", "velocity_m_s", "pressure_a_pa", "pressure_b_pa", "balance_n", "friction_n")
#: Smallest friction of a map, N: smaller values in every row are rounding, and their squares would underflow.
NO_FRICTION_N = 1e-12


def observations(
    friction_map: xr.Dataset,
    *,
    direction: int | None,
    ambient_pressure_pa: float,
    exclude_flags: Collection[str],
) -> tuple[Observations, list[str]]:
    """Select and combine the rows of a friction map.

    Both rows of a pair have the same friction (half the difference of both directions) and count as one value. A fit of
    one direction uses ``direction * balance_n`` of its rows instead.

    Parameters
    ----------
    friction_map : xarray.Dataset
        One dimension ``row``, variables of the friction map format, SI.
    direction : int or None
        None for the paired friction, +1 or -1 for one direction.
    ambient_pressure_pa : float
        Reference of gauge pressures.
    exclude_flags : collection of str
        Rows with any of these flags are left out.

    Returns
    -------
    Observations, list of str
        Values, and notes on omissions and assumptions.

    Raises
    ------
    FitError
        A variable is missing, a value is not valid, or no row is left.
    """
    column = _columns(friction_map)
    notes: list[str] = []
    keep, note = _usable(column, direction, exclude_flags)
    notes += note
    pairs = _pairs(column, keep) if direction is None else np.repeat(np.flatnonzero(keep)[:, None], 2, axis=1)
    if not pairs.size:
        raise FitError(
            "no row of the friction map can be used",
            value="; ".join(notes) or "the map is empty",
            rule="a fit needs finite friction at non-zero speed",
            remedy="Check the column flags of the map, or pass exclude_flags=().",
        )
    friction = column["friction_n"] if direction is None else direction * column["balance_n"]
    mean = {name: column[name][pairs].mean(axis=1) for name in _AVERAGED}
    speed = np.abs(column["velocity_m_s"][pairs]).mean(axis=1)
    value = friction[pairs].mean(axis=1)
    if np.abs(value).max() < NO_FRICTION_N:
        raise FitError("friction is zero in every row of the map", rule="a fit needs measured friction")
    stderr, note = _standard_errors(column, pairs, value, speed)
    notes += note
    number = np.unique(column["recording"].astype(str), return_inverse=True)[1]
    return (
        Observations(
            speed_m_s=speed,
            friction_n=value,
            stderr_n=stderr,
            gauge_a_pa=mean["pressure_a_pa"] - ambient_pressure_pa,
            gauge_b_pa=mean["pressure_b_pa"] - ambient_pressure_pa,
            u_systematic_n=np.nan_to_num(mean["u_systematic_n"]),
            group=number[pairs[:, 0]].astype(np.int64),
        ),
        notes,
    )


_AVERAGED = ("pressure_a_pa", "pressure_b_pa", "u_systematic_n")


def _columns(friction_map: xr.Dataset) -> dict[str, NDArray]:
    missing = [name for name in REQUIRED if name not in friction_map]
    if missing:
        raise FitError(
            "the friction map lacks " + ", ".join(missing),
            where="friction map",
            rule="one row per recording, speed level and direction, with the columns " + ", ".join(REQUIRED),
            remedy="Make the map with pneudrive.characterise, or add the columns in SI units.",
        )
    rows = friction_map["friction_n"].shape
    if len(rows) != 1:
        raise FitError("the friction map must have one dimension, row", value=f"shape {rows}", where="friction map")
    column = {str(name): np.asarray(friction_map[name].values) for name in friction_map.data_vars}
    nothing = np.full(rows, np.nan)
    for name in ("stderr_n", "u_systematic_n", "strokes"):
        column.setdefault(name, nothing)
    column.setdefault("flags", np.full(rows, "", dtype=object))
    for name in (*REQUIRED[1:], "stderr_n", "u_systematic_n", "strokes"):
        column[name] = column[name].astype(float)
    bad = np.flatnonzero(~np.isin(column["direction"], (-1.0, 1.0)))
    if bad.size:
        raise FitError(
            "direction must be +1 or -1",
            where=f"friction map, row {bad[0]}",
            value=f"direction = {column['direction'][bad[0]]:g}",
        )
    negative = np.flatnonzero(column["stderr_n"] < 0.0)
    if negative.size:
        raise FitError(
            "a standard error is not negative",
            where=f"friction map, row {negative[0]}",
            value=f"stderr_n = {column['stderr_n'][negative[0]]:g} N",
        )
    return column


def _usable(
    column: dict[str, NDArray], direction: int | None, exclude_flags: Collection[str]
) -> tuple[NDArray[np.bool_], list[str]]:
    notes = []
    value = column["friction_n"] if direction is None else column["balance_n"]
    finite = np.isfinite(value) & np.isfinite(column["velocity_m_s"]) & (column["velocity_m_s"] != 0.0)
    finite &= np.isfinite(column["pressure_a_pa"]) & np.isfinite(column["pressure_b_pa"])
    if not finite.all():
        notes.append(f"{np.sum(~finite)} rows left out: a value is not finite or the speed is zero")
    unwanted = set(exclude_flags)
    flagged = np.array([bool(unwanted & {f.strip() for f in str(text).split(",")}) for text in column["flags"]], bool)
    if (flagged & finite).any():
        notes.append(f"{np.sum(flagged & finite)} rows left out for their flags ({', '.join(sorted(unwanted))})")
    keep = finite & ~flagged
    if direction is not None:
        keep &= column["direction"] == direction
    return keep, notes


def _pairs(column: dict[str, NDArray], keep: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return pairs of rows with one value, shape (m, 2): same recording, identical friction, opposite directions.

    A single row forms a pair with itself.
    """
    waiting: dict[tuple, int] = {}
    pairs: list[list[int]] = []
    for i in np.flatnonzero(keep).tolist():
        key = (str(column["recording"][i]), float(column["friction_n"][i]), -float(column["direction"][i]))
        partner = waiting.pop(key, None)
        if partner is not None:
            pairs[partner][1] = i
        else:
            waiting[(key[0], key[1], -key[2])] = len(pairs)
            pairs.append([i, i])
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _standard_errors(
    column: dict[str, NDArray], pairs: NDArray[np.int64], friction: Array, speed: Array
) -> tuple[Array, list[str]]:
    """Return the standard error of each value; both rows of a pair state the same error."""
    with np.errstate(invalid="ignore"):
        stated = np.sqrt(np.mean(column["stderr_n"][pairs] ** 2, axis=1))
    first, second = pairs.T
    strokes = column["strokes"][first] + np.where(first == second, 0.0, column["strokes"][second])
    known = np.isfinite(stated) & (stated > 0.0)
    if not known.any():
        typical = max(float(np.max(np.abs(friction))), 1e-12)
        return np.full(friction.size, 0.01 * typical), ["the map has no standard errors: all rows have the same weight"]
    notes = []
    if not known.all():
        stated = np.where(known, stated, np.median(stated[known]))
        notes.append(f"{np.sum(~known)} rows have no standard error: the median of the others is used")
    dof = np.where(np.isfinite(strokes), np.maximum(strokes - 2.0, 1.0), np.inf)
    return np.sqrt(moderate(stated**2, dof, speed)), notes


#: Largest number of listed recordings; more are given by their number, the first and the last one.
MOST_RECORDINGS = 50


def recordings_of(friction_map: xr.Dataset) -> list[str]:
    """Return the names of the recordings of a map."""
    if "recording" not in friction_map:
        return []
    names = list(dict.fromkeys(str(name) for name in friction_map["recording"].to_numpy()))
    return names if len(names) <= MOST_RECORDINGS else [f"{len(names)} recordings from {names[0]} to {names[-1]}"]


def simulated(friction_map: xr.Dataset) -> list[str]:
    """Return a note if the map is known to be of simulated recordings."""
    return [SIMULATED] if friction_map.attrs.get("synthetic", False) else []


def fingerprint(data: Observations) -> str:
    """Return the SHA-256 of the values of the fit."""
    columns = (data.speed_m_s, data.friction_n, data.stderr_n, data.gauge_a_pa, data.gauge_b_pa)
    return hashlib.sha256(np.ascontiguousarray(np.stack(columns), dtype="<f8").tobytes()).hexdigest()


def ambient_of(friction_map: xr.Dataset, given: float | None, needed: bool) -> float:
    """Return the ambient pressure as reference of gauge pressures, Pa; 0 if it is unknown and not needed."""
    value = given if given is not None else friction_map.attrs.get("ambient_pressure_pa")
    if value is None:
        if needed:
            raise FitError(
                "the friction map has no ambient pressure",
                rule="pressure_dependence needs gauge pressures",
                remedy="Pass ambient_pressure_pa, for example 101300.0.",
            )
        return 0.0
    if not np.isfinite(value) or value <= 0.0:
        raise FitError("the ambient pressure must be positive", value=f"ambient_pressure_pa = {value}")
    return float(value)
