"""The friction map of a campaign: the columns of every friction map, the 95 % band, and the levels of the plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.conditions import LEVELS
from pneudrive.friction.friction_map import COLUMNS as MAP_COLUMNS
from pneudrive.friction.friction_map import Row, columns_to_dataset
from pneudrive.friction.strokes import row_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import xarray as xr

    from pneudrive.friction.budget import CycleTerms
    from pneudrive.friction.campaign.curves.curves import Fits
    from pneudrive.friction.campaign.curves.points import Points
    from pneudrive.friction.campaign.reading import CampaignData
    from pneudrive.friction.cycle import CycleData

#: Further columns -> (unit, meaning), after those of every friction map.
LEVEL_COLUMNS: dict[str, tuple[str, str]] = {
    "friction_low_n": ("N", "lower end of the 95 % band of the curve from this cycle alone"),
    "friction_high_n": ("N", "upper end of the 95 % band of the curve from this cycle alone"),
    "friction_direction_n": ("N", "friction of this direction alone, without the zero of the sensor if tares show it"),
    "friction_direction_low_n": ("N", "lower end of its 95 % band"),
    "friction_direction_high_n": ("N", "upper end of its 95 % band"),
    "air_n": ("N", "force of the air against the motion, half the difference of both directions"),
    "kind": ("", "kind of the cycle"),
    "mounting": ("", "level of the factor"),
    "seal": ("", "level of the factor"),
    "drive": ("", "level of the factor"),
    "block": ("1", "block of the plan"),
    "repeat": ("1", "repeat of the plan"),
    "began_s": ("s", "beginning of the cycle by the rig's clock"),
    "temperature_k": ("K", "mean temperature"),
}
COLUMNS = {**MAP_COLUMNS, **LEVEL_COLUMNS}
BANDS = tuple(name for name in LEVEL_COLUMNS if name.endswith("_n"))


def friction_map(
    reading: CampaignData, points: Points | None, fits: Fits | None, terms: CycleTerms | None, protocol: str
) -> xr.Dataset:
    """Return the map, one row per cycle and direction, in the order of the campaign."""
    paired = [] if points is None or terms is None else _paired(points, fits, terms, reading)
    single = reading.sliding if points is None else points.unpaired
    parts = [*paired, *_unpaired(single, reading)]
    rows = [_row(reading, *part) for part in parts]
    rows.sort(key=lambda row: (row["began_s"], row["recording"], -int(str(row["direction"]))))
    found = columns_to_dataset({name: [row[name] for row in rows] for name in COLUMNS}, COLUMNS)
    found.attrs |= {
        "title": "friction map of a campaign",
        "protocol": protocol,
        "ambient_pressure_pa": reading.identity.ambient_pressure_pa,
        "synthetic": reading.identity.synthetic,
    }
    return found


def _offsets(points: Points, fits: Fits) -> np.ndarray:
    """Return half the sum of each cycle minus the zero of the sensor, which is 0 without zero runs."""
    if not fits.has_zero:
        return np.zeros(len(points))
    zero = float(np.average([s.beta[0] for s in fits.offset.fit.states], weights=fits.offset.fit.weights))
    known = fits.offset.data
    at = np.argsort(known.order, kind="stable")
    drift = np.interp(points.order, known.order[at], fits.offset.drift[at])
    return points.reduced.offset_n - zero - drift


_Part = tuple["CycleData", int, tuple[float, float], str, dict[str, float]]
"""Cycle, direction, window, reason for which it is no point of F(v), and friction with its uncertainty and band."""
VALUES = ("balance_n", "friction_n", "offset_n", "stderr_n", "u_systematic_n")


def _paired(points: Points, fits: Fits | None, terms: CycleTerms, reading: CampaignData) -> Iterator[_Part]:
    reduced = points.reduced
    offsets = np.full(len(points), np.nan) if fits is None else _offsets(points, fits)
    known = np.flatnonzero(reduced.common)
    width = reading.edges_m[1] - reading.edges_m[0]
    window = (float(reduced.position_m[known[0]] - width / 2.0), float(reduced.position_m[known[-1]] + width / 2.0))
    columns = (reduced.friction_n, reduced.offset_n, terms.stderr_n, terms.u_systematic_n)
    bands = (terms.half_n, terms.half_direction_n, offsets, reduced.air_n)
    for d, reason, *numbers in zip(reduced.data, points.reasons, *columns, *bands, strict=True):
        friction, offset, stderr, u, half, half_direction, asymmetry, air = map(float, numbers)
        for direction in (1, -1):
            own = friction + direction * asymmetry
            ends = (friction - half, friction + half, own, own - half_direction, own + half_direction, air)
            values = (direction * friction + offset, friction, offset, stderr, u, *ends)
            yield d, direction, window, reason, dict(zip((*VALUES, *BANDS), values, strict=True))


def _unpaired(data: Iterable[CycleData], reading: CampaignData) -> Iterator[_Part]:
    nothing = float("nan")
    for d in data:
        for direction, side in d.sides.items():
            balance, known = float(np.nanmean(side.balance_n)), np.flatnonzero(np.isfinite(side.balance_n))
            values = dict.fromkeys((*VALUES, *BANDS), nothing) | {
                "balance_n": balance,
                "friction_n": direction * balance,
            }
            window = (float(reading.edges_m[known[0]]), float(reading.edges_m[known[-1] + 1]))
            yield d, direction, window, "unpaired", values


def _row(
    reading: CampaignData,
    d: CycleData,
    direction: int,
    window_m: tuple[float, float],
    reason: str,
    values: dict[str, float],
) -> Row:
    """Return the row of every friction map, its band, and the place of the cycle in the plan."""
    cycle, ambient = d.plan, reading.identity.ambient_pressure_pa
    flags = ",".join(dict.fromkeys([*d.flags, *([reason.replace("-", "_").replace(" ", "_")] if reason else [])]))
    plan = {name: getattr(cycle, name) for name in ("kind", "block", "repeat", "began_s")}
    levels = {name: getattr(d.condition, name) for name in LEVELS}
    others = {**plan, **levels, "temperature_k": d.temperature_k}
    return row_of(
        cycle.key, direction, d.sides[direction], window_m, flags=flags, ambient_pressure_pa=ambient, **values, **others
    )
