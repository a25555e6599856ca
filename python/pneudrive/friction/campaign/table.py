"""The friction map of a campaign: the columns of every friction map, the 95 % band, and the levels of the plan."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.campaign.curves.curves import Fits, deviation_n, systematic
from pneudrive.friction.campaign.curves.points import Points
from pneudrive.friction.friction_map import COLUMNS as MAP_COLUMNS
from pneudrive.friction.friction_map import Row, columns_to_dataset
from pneudrive.friction.reduction.budget import CycleTerms
from pneudrive.friction.reduction.side import RowValue, row_of

if TYPE_CHECKING:
    import xarray as xr

    from pneudrive.friction.campaign.reading import CampaignData
    from pneudrive.friction.reduction.cycle import CycleData

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


def friction_map(reading: CampaignData, points: Points | None, fits: Fits | None, protocol: str) -> xr.Dataset:
    """Return the map, one row per cycle and direction, in the order of the campaign."""
    rows: list[Row] = []
    if points is not None:
        rows += _paired_rows(points, fits, reading)
        for d in points.unpaired:
            rows += _unpaired_rows(d, reading)
    else:
        for d in reading.sliding:
            rows += _unpaired_rows(d, reading)
    rows.sort(key=lambda row: (row["began_s"], row["recording"], -int(str(row["direction"]))))
    found = columns_to_dataset({name: [row[name] for row in rows] for name in COLUMNS}, COLUMNS)
    found.attrs |= {
        "title": "friction map of a campaign",
        "protocol": protocol,
        "ambient_pressure_pa": reading.identity.ambient_pressure_pa,
        "synthetic": reading.identity.synthetic,
    }
    return found


def _terms(points: Points, fits: Fits | None) -> CycleTerms:
    """Return the uncertainty budget of each cycle."""
    reduced, count = points.reduced, len(points)
    terms = {field.name: np.full(count, np.nan) for field in fields(CycleTerms)}
    terms |= {"noise_n": reduced.friction_stderr_n, "cycle_n": np.zeros(count)}
    if fits is None:
        return CycleTerms(**terms)
    terms["cycle_n"] = deviation_n(fits, "cycle", reduced.friction_n)
    terms["block_n"] = deviation_n(fits, "block", reduced.friction_n)
    own = fits.offset.fit.most_probable_sd("cycle")
    for condition in range(len(points.conditions)):
        members = points.condition == condition
        if not (members & points.use).any():
            continue  # no curve for its cycles
        shared = systematic(fits, reduced.friction_n[members], reduced.offset_n[members], condition)
        for name, values in vars(shared).items():
            terms[name][members] = values
        terms["offset_n"][members] = np.hypot(reduced.offset_stderr_n[members], own)
    return CycleTerms(**terms)


def _offsets(points: Points, fits: Fits) -> np.ndarray:
    """Return half the sum of each cycle without the zero of the sensor. 0 without zero runs."""
    if not fits.has_zero:
        return np.zeros(len(points))
    zero = float(np.average([s.beta[0] for s in fits.offset.fit.states], weights=fits.offset.fit.weights))
    known = fits.offset.data
    at = np.argsort(known.order, kind="stable")
    drift = np.interp(points.order, known.order[at], fits.offset.drift[at])
    return points.reduced.offset_n - zero - drift


def _paired_rows(points: Points, fits: Fits | None, reading: CampaignData) -> list[Row]:
    reduced, terms = points.reduced, _terms(points, fits)
    offsets = np.full(len(points), np.nan) if fits is None else _offsets(points, fits)
    known = np.flatnonzero(reduced.common)
    width = reading.edges_m[1] - reading.edges_m[0]
    window = (float(reduced.position_m[known[0]] - width / 2.0), float(reduced.position_m[known[-1]] + width / 2.0))
    columns = (reduced.friction_n, reduced.offset_n, terms.stderr_n, terms.u_systematic_n)
    bands = (terms.half_n, terms.half_direction_n, offsets, reduced.air_n)
    rows = []
    for i, (d, *numbers) in enumerate(zip(reduced.data, *columns, *bands, strict=True)):
        friction, offset, stderr, u, half, half_direction, asymmetry, air = map(float, numbers)
        for direction in (1, -1):
            own = friction + direction * asymmetry
            value = RowValue(direction * friction + offset, friction, offset, stderr, u)
            rows.append(
                _row(d, direction, value, window, points.reasons[i], reading)
                | {
                    "friction_low_n": friction - half,
                    "friction_high_n": friction + half,
                    "friction_direction_n": own,
                    "friction_direction_low_n": own - half_direction,
                    "friction_direction_high_n": own + half_direction,
                    "air_n": air,
                }
            )
    return rows


def _unpaired_rows(d: CycleData, reading: CampaignData) -> list[Row]:
    rows, nothing = [], float("nan")
    for direction, side in d.sides.items():
        balance = float(np.nanmean(side.balance_n))
        known = np.flatnonzero(np.isfinite(side.balance_n))
        value = RowValue(balance, direction * balance, nothing, nothing, nothing)
        window = (float(reading.edges_m[known[0]]), float(reading.edges_m[known[-1] + 1]))
        bands = dict.fromkeys((name for name in LEVEL_COLUMNS if name.endswith("_n")), nothing)
        rows.append(_row(d, direction, value, window, "unpaired", reading) | bands)
    return rows


def _row(
    d: CycleData, direction: int, value: RowValue, window_m: tuple[float, float], reason: str, reading: CampaignData
) -> Row:
    """Return the row of every friction map, and the place of the cycle in the plan."""
    cycle, side, ambient = d.plan, d.sides[direction], reading.identity.ambient_pressure_pa
    return row_of(cycle.key, direction, side, value, window_m, _flags(d, reason), ambient) | {
        "kind": cycle.kind,
        "mounting": d.condition.mounting,
        "seal": d.condition.seal,
        "drive": d.condition.drive,
        "block": cycle.block,
        "repeat": cycle.repeat,
        "began_s": cycle.began_s,
        "temperature_k": d.temperature_k,
    }


def _flags(d: CycleData, reason: str) -> str:
    names = [*d.flags, *([reason.replace("-", "_").replace(" ", "_")] if reason else [])]
    return ",".join(dict.fromkeys(names))
