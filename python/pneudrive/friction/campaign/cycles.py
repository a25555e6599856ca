"""Cycles as one table: plan, means and bins of position of both directions, uncertainties, values at rest.

A cycle is a recording with a plan: one speed, set pressures. A speed level of a recording is a cycle without a plan.
Samples may be unevenly spaced: bins have equal weight, so a burst around a reversal has only the weight of its travel.
The selection of strokes, their means, scatter and breakaway are computed by ``strokes.py``, as for a speed level.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.friction.bins import Grid, bin_means, grid_of, mean_profile
from pneudrive.friction.budget import stated_shares
from pneudrive.friction.stick_slip import swing_of
from pneudrive.friction.strokes import Side, Strokes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.motion import RecordedMotion

    Array = NDArray[np.float64]
    Row = dict[str, Any]

NOTHING = float("nan")
SAME_SPEED = 0.1  # largest difference of the speeds of strokes in one cycle
WAYS = (1, -1)  # directions, in the order of the columns of both
#: Columns of a cycle -> value of a cycle without them. Uncertainties are standard ones of friction, N.
COLUMNS: dict[str, Any] = {
    "key": "",
    "kind": "sweep",
    "index": 0,  # in running order
    "block": 1,
    "repeat": 1,
    "day": 1,
    "set_speed_m_s": NOTHING,
    "set_a_pa": NOTHING,  # absolute
    "set_b_pa": NOTHING,
    "began_s": 0.0,  # by the rig's clock
    "elapsed_s": 0.0,  # since the first cycle of the campaign
    "order": 0.0,  # place in the campaign, 0 to 1
    "travel_m": 0.0,  # of the seal up to the middle of the cycle
    "rest_s": NOTHING,  # before the cycle
    "weight_n": 0.0,  # known weight on the force sensor
    "duration_s": 0.0,
    "temperature_k": NOTHING,
    "standing_n": NOTHING,  # mean force (vented: of the balance) while standing released: zero of the sensor
    "standing_stderr_n": NOTHING,
    "standing_sd_n": NOTHING,
    **{f"open_{side}_{name}pa": NOTHING for side in "ab" for name in ("", "stderr_", "change_")},  # of a zero run
    "u_gain_n": 0.0,  # proportional to friction
    "u_hysteresis_n": 0.0,  # equal at all frictions, such as hysteresis and residuals of a calibration curve
    "u_offset_n": 0.0,  # of half the sum of both directions without zero
    "u_pressure_a_n": 0.0,  # part of the transducer in it
    "u_pressure_b_n": 0.0,
    "u_air_n": 0.0,  # of the chambers' force in half the difference
    **{f"force: {name}": NOTHING for name in ("gain", "creep", "linearity", "hysteresis")},  # named by a calibration
    "assumed": False,  # accuracy of the force sensor
}
#: Columns of both directions, shape (n, 2): those of `Side`, then those of `_side_row`.
OF_SIDES = (
    *("force_n", "pressure_a_pa", "pressure_b_pa", "velocity_m_s", "samples", "strokes", "strokes_recorded"),
    *("breakaway_n", "dwell_s", "loading_rate_n_s", "ripple", "period_s", "step_m", "piston_ripple", "stick_slip"),
    *("deviation_n", "effective", "scatter_n", "swing_n"),
)
#: Columns over bins of position, shape (n, 2, bins): force balance (see `Recording.balance_n`), NaN without settled
#: samples, and its part from the chamber pressures, p_a A_a - p_b A_b - p_ambient (A_a - A_b).
OF_BINS = ("balance_n", "air_n")


@dataclass(frozen=True, eq=False)
class CycleTable:
    """Cycles by columns of equal length: `COLUMNS`, `OF_SIDES`, `OF_BINS`, and the objects ``condition``, ``flags``."""

    columns: dict[str, NDArray]

    @classmethod
    def of(cls, rows: Sequence[Row], bins: int) -> CycleTable:
        """Make the table of some rows, with this number of bins of position."""
        columns: dict[str, NDArray] = {}
        for name, default in {**COLUMNS, "condition": None, "flags": None}.items():
            kind = type(default) if isinstance(default, int | float) else object
            columns[name] = np.array([row.get(name, default) for row in rows], dtype=kind)
        both = [[row["sides"].get(way, {}) for way in WAYS] for row in rows]
        for name in OF_SIDES:
            columns[name] = np.array([[side.get(name, NOTHING) for side in p] for p in both], float).reshape(-1, 2)
        empty = np.full(bins, np.nan)
        for name in OF_BINS:
            columns[name] = np.array([[side.get(name, empty) for side in p] for p in both]).reshape(len(rows), 2, bins)
        return cls(columns)

    def __getitem__(self, name: str) -> NDArray:
        """Return a column."""
        return self.columns[name]

    def __len__(self) -> int:
        """Return the number of rows."""
        return self.columns["index"].size

    def at(self, rows: NDArray) -> Self:
        """Return some rows, by a mask or their numbers."""
        return self.having(**{name: values[rows] for name, values in self.columns.items()})

    def having(self, **columns: NDArray) -> Self:
        """Return the table with other values of some columns."""
        return replace(self, columns=self.columns | columns)

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Mark the directions that a cycle has, shape (n, 2)."""
        return np.isfinite(self["velocity_m_s"])

    def over_sides(self, name: str) -> Array:
        """Return the mean absolute value of a column over the directions, shape (n,); NaN without motion."""
        return mean_of_sides(np.abs(self[name]))


def mean_of_sides(values: Array) -> Array:
    """Return the mean of the known ones of both directions, shape (n,); NaN without any."""
    known = np.isfinite(values)
    count = known.sum(axis=1)
    return np.where(count > 0, np.where(known, values, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)


def reduce_cycle(motion: RecordedMotion, edges_m: Array, *, uses_window: bool = True) -> Row:
    """Reduce the strokes of one speed to bins of position.

    Parameters
    ----------
    motion : RecordedMotion
    edges_m : ndarray, shape (bins + 1,)
        Edges of the bins of position that all cycles share.
    uses_window : bool
        Whether the means of strokes are over equal positions.

    Raises
    ------
    RecordingError
        If the strokes have different speeds, or none has settled in a quarter of the middle of the way.
    """
    name, speeds = motion.recording.name, np.abs([stroke.speed_m_s for stroke in motion.strokes])
    if speeds.max() - speeds.min() > SAME_SPEED * speeds.max():
        raise RecordingError(
            "the strokes of the cycle have different speeds",
            where=name,
            value=f"{1e3 * speeds.min():.4g} to {1e3 * speeds.max():.4g} mm/s",
            rule="a cycle must have one speed, because it is one point of the characteristic",
        )
    grid = grid_of(edges_m)
    table = Strokes.of(motion, motion.strokes, (float(edges_m[0]), float(edges_m[-1])), grid)
    sides, _ = table.sides(uses_window=uses_window)
    if not sides:
        value = f"{len(motion.strokes)} strokes"
        rule = "a stroke counts if it has settled in a quarter of the middle of the way"
        raise RecordingError("no stroke has a settled part", where=name, value=value, rule=rule)
    return cycle_row(motion, grid, sides, {way: table.balance_n[rows] for way, rows in table.directions.items()})


def cycle_row(motion: RecordedMotion, grid: Grid, sides: Mapping[int, Side], rows: Mapping[int, Array]) -> Row:
    """Return the row of a cycle, or of a speed level, from its reduced strokes.

    Parameters
    ----------
    motion : RecordedMotion
    grid : Grid
        Bins of position that all cycles share.
    sides : mapping
        Direction -> its strokes.
    rows : mapping
        Direction -> balance of its strokes, shape (strokes, bins).
    """
    recording, only = motion.recording, next(iter(sides.values()))
    return {
        "sides": {way: _side_row(motion, side, grid, rows[way]) for way, side in sides.items()},
        "duration_s": float(recording.time_s[-1] - recording.time_s[0]),
        **stated_shares(recording, *(sides.get(way, only) for way in WAYS), late_s=motion.late_s),
    }


def _side_row(motion: RecordedMotion, side: Side, grid: Grid, rows: Array) -> Row:
    """Add to the strokes of one direction: bins of position, scatter within them, range in the middle of a stroke."""
    recording, parts = motion.recording, [s.samples for s in side.used]

    def binned(values: Array) -> Array:
        return bin_means(motion.position_m, values, grid.edges_m, parts, motion.settled)

    ambient = recording.ambient_pressure_pa
    air = (recording.pressure_a_pa - ambient) * recording.area_a_m2
    air -= (recording.pressure_b_pa - ambient) * recording.area_b_m2
    means = mean_profile(rows)
    covered = np.isfinite(means)
    squares = (binned(motion.balance_n**2) - binned(motion.balance_n) ** 2)[covered]
    known = vars(side.spread) | vars(side)
    return {
        **{name: known[name] for name in OF_SIDES if name in known},
        "balance_n": means,
        "air_n": np.where(covered, binned(air), np.nan),
        "scatter_n": float(np.sqrt(max(squares.mean(), 0.0))),
        "swing_n": swing_of(motion.position_m, motion.balance_n, side.used),
    }
