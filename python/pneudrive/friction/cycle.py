"""One cycle over bins of position: force balance of each direction, means, sliding, uncertainties.

A cycle is a recording with a plan: one speed, set pressures. A speed level of a recording is a cycle without a plan.
Samples may be unevenly spaced: bins have equal weight, so a burst around a reversal has only the weight of its travel.
The selection of strokes, their means, scatter and breakaway are computed by ``strokes.py``, as for a speed level.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.estimate.autocorrelation import stderr_of_mean
from pneudrive.friction.bins import Grid, bin_means, grid_of, mean_profile
from pneudrive.friction.budget import stated_shares
from pneudrive.friction.motion import Motion
from pneudrive.friction.stick_slip import swing_of
from pneudrive.friction.strokes import Side, Strokes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pneudrive.friction.conditions import Condition

    Array = NDArray[np.float64]

SAME_SPEED = 0.1  # largest difference of the speeds of strokes in one cycle
MINIMUM_SAMPLES = 20


@dataclass(frozen=True)
class CyclePlan:
    """Place of a cycle in its measurement, and its set values. Without a plan, the measured values are used.

    Attributes
    ----------
    key, kind : str
    index, block, repeat, day : int
        ``index`` is the place in running order, ``day`` counts from 1.
    condition : Condition
    speed_m_s : float or None
        Set speed.
    pressures_pa : dict
        Chamber -> set absolute pressure.
    began_s, elapsed_s : float
        Beginning by the rig's clock, and since the first cycle of the campaign.
    order : float
        Place in the campaign, 0 to 1.
    travel_m : float
        Travel of the seal up to the middle of the cycle.
    rest_s : float
        Rest before the cycle; NaN if unknown.
    weight_n : float
        Known weight on the force sensor.
    """

    key: str
    kind: str
    index: int
    block: int
    repeat: int
    condition: Condition
    speed_m_s: float | None = None
    pressures_pa: dict[str, float] = field(default_factory=dict)
    began_s: float = 0.0
    elapsed_s: float = 0.0
    day: int = 1
    order: float = 0.0
    travel_m: float = 0.0
    rest_s: float = float("nan")
    weight_n: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class CycleSide(Side):
    """The strokes of one direction of a cycle, in bins of position.

    Attributes
    ----------
    balance_n : ndarray, shape (bins,)
        Force balance (see `Recording.balance_n`) in each bin of position, NaN without settled samples.
    air_n : ndarray, shape (bins,)
        Its part from the chamber pressures, p_a A_a - p_b A_b - p_ambient (A_a - A_b).
    scatter_n, swing_n : float
        Standard deviation of the balance within the bins, and its range in the middle of a stroke.
    """

    balance_n: Array
    air_n: Array
    scatter_n: float
    swing_n: float


@dataclass(frozen=True)
class OpenPressure:
    """A chamber's pressure in an open zero run, Pa: mean, standard error, and change between the halves."""

    mean_pa: float
    stderr_pa: float
    change_pa: float

    @classmethod
    def of(cls, values: Array) -> OpenPressure | None:
        """Summarise the samples; return None if the pressure was not measured."""
        if np.ptp(values) == 0:
            return None
        first, second = np.array_split(values, 2)
        return cls(float(values.mean()), stderr_of_mean(values), float(second.mean() - first.mean()))


@dataclass(frozen=True, eq=False)
class CycleData:
    """Data of a cycle for the campaign's models.

    Attributes
    ----------
    plan : CyclePlan
    sides : dict of CycleSide
        Values by direction +1/-1. Empty for a cycle that does not move.
    flags : dict
        Counts of damaged samples by kind.
    strokes_recorded : int
        All strokes of both directions.
    temperature_k : float
        NaN if not measured.
    duration_s : float
    standing_n, standing_stderr_n, standing_sd_n : float
        Mean of force (vented: of the balance), its standard error and standard deviation while standing released: the
        sensor's zero and noise.
    standing_pressures : dict
        Chamber -> reading of its transducer in an open zero run. Empty if not measured.
    u_gain_n, u_hysteresis_n : float
        Standard systematic uncertainty of friction: proportional to it, and equal in newton at all frictions, such as
        hysteresis and residuals of a calibration curve.
    u_offset_n, u_air_n : float
        The same for half the sum of both directions without zero, and for the chambers' force in half the difference.
    u_pressures_n : dict
        Chamber -> the part of its transducer in `u_offset_n`.
    u_force_n : dict
        Source -> the parts of the force sensor in both, if its calibration names them.
    assumed : bool
        Whether the accuracy of the force sensor is assumed.
    """

    plan: CyclePlan
    sides: dict[int, CycleSide] = field(default_factory=dict)
    flags: dict[str, int] = field(default_factory=dict)
    strokes_recorded: int = 0
    temperature_k: float = float("nan")
    duration_s: float = 0.0
    standing_n: float = float("nan")
    standing_stderr_n: float = float("nan")
    standing_sd_n: float = float("nan")
    standing_pressures: dict[str, OpenPressure] = field(default_factory=dict)
    u_gain_n: float = 0.0
    u_hysteresis_n: float = 0.0
    u_offset_n: float = 0.0
    u_air_n: float = 0.0
    u_pressures_n: dict[str, float] = field(default_factory=dict)
    u_force_n: dict[str, float] = field(default_factory=dict)
    assumed: bool = False

    @property
    def condition(self) -> Condition:
        """Condition of its curve."""
        return self.plan.condition

    @property
    def strokes_used(self) -> int:
        """Strokes of both directions that are used for the means."""
        return sum(side.strokes for side in self.sides.values())


def reduce_cycle(motion: Motion, plan: CyclePlan, edges_m: Array, *, uses_window: bool = True) -> CycleData:
    """Reduce the strokes of one speed to bins of position.

    Parameters
    ----------
    motion : Motion
    plan : CyclePlan
    edges_m : ndarray, shape (bins + 1,)
        Edges of the bins of position that all cycles share.
    uses_window : bool
        Whether the means of strokes are over equal positions.

    Raises
    ------
    RecordingError
        If no stroke has settled in a quarter of the middle of the way.
    """
    grid = grid_of(edges_m)
    table = Strokes.of(motion, motion.strokes, (float(edges_m[0]), float(edges_m[-1])), grid)
    sides, _ = table.sides(uses_window=uses_window)
    if not sides:
        value = f"{len(motion.strokes)} strokes"
        rule = "a stroke counts if it has settled in a quarter of the middle of the way"
        raise RecordingError("no stroke has a settled part", where=motion.recording.name, value=value, rule=rule)
    return cycle_of(motion, plan, grid, sides, {way: table.balance_n[rows] for way, rows in table.directions.items()})


def cycle_of(
    motion: Motion, plan: CyclePlan, grid: Grid, sides: Mapping[int, Side], rows: Mapping[int, Array]
) -> CycleData:
    """Return the data of a cycle, or of a speed level, from its reduced strokes.

    Parameters
    ----------
    motion : Motion
    plan : CyclePlan
    grid : Grid
        Bins of position that all cycles share.
    sides : mapping
        Direction -> its strokes.
    rows : mapping
        Direction -> balance of its strokes, shape (strokes, bins).
    """
    recording, only = motion.recording, next(iter(sides.values()))
    return CycleData(
        plan=plan,
        sides={d: _cycle_side(motion, side, grid, rows[d]) for d, side in sides.items()},
        strokes_recorded=sum(side.strokes_recorded for side in sides.values()),
        duration_s=float(recording.time_s[-1] - recording.time_s[0]),
        **stated_shares(recording, *(sides.get(d, only) for d in (1, -1)), late_s=motion.late_s),
    )


def check_speed(motion: Motion) -> None:
    """Refuse a planned cycle whose strokes have different speeds.

    Raises
    ------
    RecordingError
    """
    speeds = np.abs([stroke.speed_m_s for stroke in motion.strokes])
    if speeds.max() - speeds.min() > SAME_SPEED * speeds.max():
        raise RecordingError(
            "the strokes of the cycle have different speeds",
            where=motion.recording.name,
            value=f"{1e3 * speeds.min():.4g} to {1e3 * speeds.max():.4g} mm/s",
            rule="a cycle must have one speed, because it is one point of the characteristic",
        )


def _cycle_side(motion: Motion, side: Side, grid: Grid, rows: Array) -> CycleSide:
    """Add the bins of position to the strokes of one direction."""
    recording, parts = motion.recording, [s.samples for s in side.used]

    def binned(values: Array) -> Array:
        return bin_means(motion.position_m, values, grid.edges_m, parts, motion.settled)

    ambient = recording.ambient_pressure_pa
    air = (recording.pressure_a_pa - ambient) * recording.area_a_m2
    air -= (recording.pressure_b_pa - ambient) * recording.area_b_m2
    means = mean_profile(rows)
    covered = np.isfinite(means)
    squares = (binned(motion.balance_n**2) - binned(motion.balance_n) ** 2)[covered]
    return CycleSide(
        **vars(side),
        balance_n=means,
        air_n=np.where(covered, binned(air), np.nan),
        scatter_n=float(np.sqrt(max(squares.mean(), 0.0))),
        swing_n=swing_of(motion.position_m, motion.balance_n, side.used),
    )
