"""Cycles as one table: plan, means and position bins of both directions, uncertainties, values at rest.

A cycle is a recording whose plan states one speed and the set pressures. A speed level of a recording is treated as a
cycle without a plan. Position bins have equal weight, so unevenly spaced samples, such as bursts around a reversal, do
not distort the means. ``strokes.py`` selects the strokes and computes their means, scatter and breakaway.

Cycles at rest give the gain of the force sensor (known weights) and the zeros of the pressures (zero runs). In an open
zero run, both chambers should show ambient pressure.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from pneudrive.arrays import Array, Bools, Row, by_name
from pneudrive.errors import RecordingError
from pneudrive.estimate.estimates import rms
from pneudrive.friction.bins import Grid, bin_means, grid_of, known_mean, mean_profile
from pneudrive.friction.budget import stated_shares, usual_range
from pneudrive.friction.friction_map import CYCLE_COLUMNS, TABLES
from pneudrive.friction.stick_slip import swing_of
from pneudrive.friction.strokes import RecordedMotion, Side, Strokes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.rig.interface import Identity


SAME_SPEED = 0.1  # largest difference of the speeds of strokes in one cycle
WAYS = np.array([1, -1])  # directions, in the order of the columns of both
#: Columns of both directions, shape (n, 2): those of `Side`, then those of `cycle_row`.
OF_SIDES: list[str] = TABLES["lists"]["sides"]
#: Columns over position bins, shape (n, 2, bins): force balance (see `Recording.balance_n`), and the part from the
#: chamber pressures, p_a A_a - p_b A_b - p_ambient (A_a - A_b). NaN without settled samples.
OF_BINS = ("balance_n", "air_n")


@dataclass(frozen=True, eq=False)
class CycleTable:
    """Cycles as a table with the columns `CYCLE_COLUMNS`, `OF_SIDES`, `OF_BINS`, and objects (condition, flags)."""

    columns: dict[str, NDArray]

    @classmethod
    def of(cls, rows: Sequence[Row], bins: int) -> CycleTable:
        """Make the table from rows, with `bins` position bins."""
        columns: dict[str, NDArray] = {}
        for name, default in {**CYCLE_COLUMNS, "condition": None, "flags": None}.items():
            kind = type(default) if isinstance(default, int | float) else object
            columns[name] = np.array([row.get(name, default) for row in rows], dtype=kind)
        both = [[row["sides"].get(way, {}) for way in WAYS] for row in rows]
        for name in OF_SIDES:
            values = [[side.get(name, np.nan) for side in pair] for pair in both]
            columns[name] = np.array(values, float).reshape(-1, 2)
        empty = np.full(bins, np.nan)
        for name in OF_BINS:
            curves = [[side.get(name, empty) for side in pair] for pair in both]
            columns[name] = np.array(curves).reshape(len(rows), 2, bins)
        return cls(columns)

    def __getitem__(self, name: str) -> NDArray:
        """Return a column."""
        return self.columns[name]

    def __len__(self) -> int:
        """Return the number of rows."""
        return self.columns["index"].size

    def at(self, rows: NDArray) -> Self:
        """Return the rows that a mask or indices select."""
        return self.having(**{name: values[rows] for name, values in self.columns.items()})

    def having(self, **columns: NDArray) -> Self:
        """Return the table with some columns replaced."""
        return replace(self, columns=self.columns | columns)

    @property
    def moves(self) -> Bools:
        """Mask of the directions in which each cycle moves (shape (n, 2))."""
        return np.isfinite(self["velocity_m_s"])

    def over_sides(self, name: str) -> Array:
        """Return the mean magnitude of a column over the directions; NaN without motion (shape (n,))."""
        return known_mean(np.abs(self[name]), axis=1)


def reduce_cycle(motion: RecordedMotion, edges_m: Array) -> Row:
    """Reduce the strokes of one speed to position bins.

    Parameters
    ----------
    motion : RecordedMotion
    edges_m : ndarray, shape (bins + 1,)
        Edges of the position bins common to all cycles.

    Raises
    ------
    RecordingError
        If the strokes have different speeds, or no stroke has settled in at least a quarter of its middle part.
    """
    name, speeds = motion.recording.name, np.abs([stroke.speed_m_s for stroke in motion.strokes])
    if speeds.max() - speeds.min() > SAME_SPEED * speeds.max():
        raise RecordingError.of("friction.speeds", where=name, slowest=1e3 * speeds.min(), fastest=1e3 * speeds.max())
    grid = grid_of(edges_m)
    table = Strokes.of(motion, motion.strokes, (edges_m[0], edges_m[-1]), grid)
    sides, _ = table.sides(uses_window=motion.choice.uses_window)
    if not sides:
        raise RecordingError.of("friction.settled", where=name, strokes=len(motion.strokes))
    return cycle_row(motion, grid, sides, {way: table.balance_n[rows] for way, rows in table.directions.items()})


def cycle_row(
    motion: RecordedMotion,
    grid: Grid,
    sides: Mapping[int, Side],
    rows: Mapping[int, Array],
) -> Row:
    """Return the row of a cycle, or of a speed level, from its reduced strokes.

    Parameters
    ----------
    motion : RecordedMotion
    grid : Grid
        Position bins common to all cycles.
    sides : mapping
        Direction -> its strokes.
    rows : mapping
        Direction -> force balance of its strokes, in N (shape (strokes, bins)).
    """
    recording, only = motion.recording, next(iter(sides.values()))
    ambient = recording.ambient_pressure_pa
    air_n = (recording.pressure_a_pa - ambient) * recording.area_a_m2
    air_n -= (recording.pressure_b_pa - ambient) * recording.area_b_m2
    sampled = (motion.balance_n, motion.balance_n**2, air_n)
    of_sides = {}
    for way, side in sides.items():
        bins = grid.edges_m, [stroke.samples for stroke in side.used], motion.settled
        balance, squares, air = (bin_means(motion.position_m, values, *bins) for values in sampled)
        profile = mean_profile(rows[way])
        covered = np.isfinite(profile)
        variances = (squares - balance**2)[covered]
        known = vars(side.spread) | vars(side)
        of_sides[way] = {
            **{name: known[name] for name in OF_SIDES if name in known},
            "balance_n": profile,
            "air_n": np.where(covered, air, np.nan),
            "scatter_n": np.sqrt(max(variances.mean(), 0.0)),
            "swing_n": swing_of(motion.position_m, motion.balance_n, side.used),
        }
    return {
        "sides": of_sides,
        "duration_s": recording.time_s[-1] - recording.time_s[0],
        **stated_shares(recording, *(sides.get(way, only) for way in WAYS), late_s=motion.late_s),
    }


# --- Sensors, from cycles at rest.

SURPRISE = 3.0  # standard uncertainties between stated accuracy and known weights
GROWING = ("force: gain", "force: creep")  # sources proportional to the force
PLAUSIBLE = 0.1  # a larger gain error is not the sensor's: the weight was wrong or supported
REACH = 5.0  # stated accuracies: a larger deviation from ambient is not the zero of a sound transducer (assumed)


@dataclass(frozen=True)
class Gain:
    """Relative error of the force sensor's gain.

    Attributes
    ----------
    error : float
        Relative gain error that is corrected: the measured error or, with a stated accuracy, its weighted mean with 0.
    stderr : float
        Standard uncertainty after correction; NaN without a weight.
    measured, measured_stderr : float
        Gain error from the weights only, and its standard error. NaN without weights.
    cycles : int
    sentence : str
        Key of the statement on the error. An implausibly large error is reported, and nothing is corrected. If the
        error exceeds stated accuracy and scatter, the stated accuracy is ignored.
    """

    error: float = 0.0
    stderr: float = np.nan
    measured: float = np.nan
    measured_stderr: float = np.nan
    cycles: int = 0
    sentence: str = "curve.gain"


def sensor_gain(identity: Identity, weights: CycleTable, tares: CycleTable) -> Gain:
    """Compare the readings of the sensor under known weights with its readings when released.

    If a weight pulls the piston in +x, the rig holds the piston, and the reading is lower by the weight.
    """
    weights = weights.at(weights["weight_n"] != 0.0)
    count = len(weights)
    if not count or not len(tares):
        return Gain()
    near = tares.at(np.abs(tares["index"] - weights["index"][:, None]).argmin(axis=1))
    values = (near["standing_n"] - weights["standing_n"]) / weights["weight_n"] - 1.0
    variances = (weights["standing_stderr_n"] ** 2 + near["standing_stderr_n"] ** 2) / weights["weight_n"] ** 2
    measured = float(np.mean(values))
    scatter = np.var(values, ddof=1) / count if count > 1 else 0.0
    stderr = float(np.sqrt(max(np.mean(variances) / count, scatter)))
    if abs(measured) > PLAUSIBLE:
        return Gain(0.0, np.nan, measured, stderr, count, "curve.gain_wrong")
    prior = stated_gain(identity)
    if prior is None:
        return Gain(measured, stderr, measured, stderr, count)
    total = float(np.hypot(prior, stderr))
    if abs(measured) > SURPRISE * total:
        return Gain(measured, stderr, measured, stderr, count, "curve.gain_surprising")
    share = prior**2 / total**2 if total > 0 else 0.0
    return Gain(share * measured, float(np.sqrt(share)) * stderr, measured, stderr, count)


def stated_gain(identity: Identity) -> float | None:
    """Return the relative gain error allowed by calibration or stated accuracy; None if neither is stated."""
    if identity.force_calibration is not None:
        return identity.force_calibration.u_gain
    if "force_n" not in identity.accuracy or "force_n" not in identity.limits:
        return None
    return identity.accuracy["force_n"] / max(abs(v) for v in identity.limits["force_n"])


def corrected(cycles: CycleTable, gain: Gain) -> CycleTable:
    """Correct the forces of cycles for the gain error, and replace the stated uncertainty by that of the correction."""
    if not np.isfinite(gain.stderr):
        return cycles
    force, factor, air = cycles["force_n"], 1.0 + gain.error, cycles["air_n"]
    single = np.abs(np.nan_to_num(force)).sum(axis=1)
    difference = np.abs(force[:, 0] - force[:, 1])
    half_difference = np.where(cycles.moves.all(axis=1), difference / 2.0, single)
    left = gain.stderr * half_difference
    growing = (left, np.nan_to_num(cycles["force: creep"]), cycles["u_air_n"])
    return cycles.having(
        balance_n=air + (cycles["balance_n"] - air) / factor,
        force_n=force / factor,
        standing_n=cycles["standing_n"] / factor,
        u_gain_n=np.sqrt(sum(u**2 for u in growing)),
        assumed=np.zeros(len(cycles), dtype=bool),
        **{"force: gain": np.where(np.isfinite(cycles["force: gain"]), left, np.nan)},
    )


@dataclass(frozen=True)
class PressureZero:
    """Zero of the transducer of one chamber.

    Attributes
    ----------
    blocks : dict
        Block -> zero, in Pa, that is subtracted from its cycles; empty if unknown.
    mean_pa, stderr_pa : float
        Mean over all usable zero runs. The standard uncertainty comes from noise and from the scatter of zero runs.
    tares : int
        Number of usable zero runs.
    unusable : dict
        Key of a statement -> key of the zero run with this fault -> deviation from ambient, or change, in Pa.
    """

    blocks: dict[int, float] = field(default_factory=dict)
    mean_pa: float = np.nan
    stderr_pa: float = np.nan
    tares: int = 0
    unusable: dict[str, dict[str, float]] = field(default_factory=dict)


def pressure_zeros(identity: Identity, tares: CycleTable) -> dict[str, PressureZero]:
    """Return chamber ("a", "b") -> zero of its transducer, for transducers with a stated accuracy."""
    found = {}
    for side in "ab":
        accuracy = identity.accuracy.get(f"pressure_{side}_pa", 0.0)
        seen = tares.at(np.isfinite(tares[f"open_{side}_pa"]))
        if not (accuracy > 0.0 and len(seen)):
            continue
        off, change = seen[f"open_{side}_pa"] - identity.ambient_pressure_pa, seen[f"open_{side}_change_pa"]
        unsteady = np.abs(change) > accuracy
        far = ~unsteady & (np.abs(off) > REACH * accuracy)
        faults = {"zero.pressure_far": (far, off), "zero.pressure_unsteady": (unsteady, change)}
        unusable = {name: by_name(seen["key"][some].tolist(), values[some]) for name, (some, values) in faults.items()}
        found[side], good = PressureZero(unusable=unusable), ~(far | unsteady)
        if good.any():
            block = seen["block"]
            offs = {b: off[good & (block == b)] for b in dict.fromkeys(block[good].tolist())}
            values = np.concatenate(list(offs.values()))
            scatter = np.std(values, ddof=1) if values.size > 1 else 0.0
            stderr = float(np.hypot(rms(seen[f"open_{side}_stderr_pa"][good]), scatter) / np.sqrt(values.size))
            means = {b: float(np.mean(some)) for b, some in offs.items()}
            found[side] = PressureZero(means, float(np.mean(values)), stderr, values.size, unusable)
    return found


def without_zeros(cycles: CycleTable, zeros: dict[str, PressureZero], identity: Identity) -> CycleTable:
    """Subtract the pressure zeros of the block, or otherwise their mean, from cycles and zero runs.

    After this correction, a zero run shows only the zero of the force sensor.

    The accuracy of a transducer then only contains its gain error, which grows with the reading. If the range is not
    stated, it is assumed to be the smallest usual range that contains the highest pressure of the campaign.
    """
    known = {side: zero for side, zero in zeros.items() if zero.tares}
    if not known or not len(cycles):
        return cycles
    area, ambient = {"a": identity.area_a_m2, "b": -identity.area_b_m2}, identity.ambient_pressure_pa
    blocks, variance = cycles["block"].tolist(), cycles["u_offset_n"] ** 2
    off = {}
    for side, zero in known.items():
        off[side] = np.array([zero.blocks.get(block, zero.mean_pa) for block in blocks])
    force = sum((area[side] * value for side, value in off.items()), np.zeros(len(cycles)))
    vented = np.isfinite(cycles["open_a_pa"]) | np.isfinite(cycles["open_b_pa"])
    shown = {f"pressure_{side}_pa": cycles[f"pressure_{side}_pa"] - value[:, None] for side, value in off.items()}
    for side in known:
        channel = f"pressure_{side}_pa"
        if channel in identity.limits or not cycles.moves.any():
            continue  # already counted by its reading
        span = usual_range(float(np.nanmax(np.abs(cycles[channel] - ambient))))
        share = np.minimum(np.abs(known_mean(shown[channel], axis=1) - ambient) / span, 1.0)
        left = identity.accuracy[channel] * abs(area[side]) * share
        variance = variance + (left**2 - cycles[f"u_pressure_{side}_n"] ** 2)
    u_offset = np.sqrt(np.maximum(variance, 0.0))
    return cycles.having(
        **shown,
        balance_n=cycles["balance_n"] - force[:, None, None],
        air_n=cycles["air_n"] - force[:, None, None],
        standing_n=np.where(vented, cycles["standing_n"] - force, cycles["standing_n"]),
        u_offset_n=np.where(cycles.moves.any(axis=1), u_offset, cycles["u_offset_n"]),
    )
