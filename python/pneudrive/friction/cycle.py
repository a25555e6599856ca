"""One cycle over bins of position: force balance of each direction, means, sliding, uncertainties, hysteresis loop.

A cycle is a recording with a plan: one speed, set pressures. A speed level of a recording is a cycle without a plan.
Samples may be unevenly spaced: bins have equal weight, so a burst around a reversal has only the weight of its travel.
The selection of strokes, their means, scatter and breakaway are computed by ``strokes.py``, as for a speed level.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.estimate.autocorrelation import stderr_of_mean
from pneudrive.estimate.groups import levels
from pneudrive.friction.bins import Grid, bin_means, grid_of, mean_profile
from pneudrive.friction.budget import stated_shares
from pneudrive.friction.motion import RecordedMotion, balance_of
from pneudrive.friction.stick_slip import swing_of
from pneudrive.friction.strokes import Side, Strokes
from pneudrive.repr_tables import Card, Shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.conditions import Condition
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

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


def reduce_cycle(motion: RecordedMotion, plan: CyclePlan, edges_m: Array, *, uses_window: bool = True) -> CycleData:
    """Reduce the strokes of one speed to bins of position.

    Parameters
    ----------
    motion : RecordedMotion
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
    motion: RecordedMotion, plan: CyclePlan, grid: Grid, sides: Mapping[int, Side], rows: Mapping[int, Array]
) -> CycleData:
    """Return the data of a cycle, or of a speed level, from its reduced strokes.

    Parameters
    ----------
    motion : RecordedMotion
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


def check_speed(motion: RecordedMotion) -> None:
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


def _cycle_side(motion: RecordedMotion, side: Side, grid: Grid, rows: Array) -> CycleSide:
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


SHOWN_CONDITIONS = 2
SHOWN_SPEEDS = 3
SHOWN_SAMPLES = 400
BEFORE, AFTER = 0.05, 0.1  # of the stroke, shown before and after the reversal
SPEED_BINS = 8  # between 20 % and 80 % of the speed, range for comparing speeding up and slowing down
PRESLIDINGS = 5.0  # least travel after the reversal: before it, the difference is presliding
SAME_LEVEL = 0.05  # set speeds closer than this are one level
CANDIDATES = 3  # cycles of each shown condition and speed, as one may be unreadable


@dataclass(frozen=True, eq=False, repr=False)
class Loop(Shown):
    """Friction around one reversal, raw samples (thinned).

    Attributes
    ----------
    key : str
        Index of the cycle.
    condition : Condition
    speed_m_s : float
    time_s, position_m, velocity_m_s, friction_n : ndarray, shape (m,)
        friction_n has the sign of the balance, positive if it opposes +x, without the offset.
    presliding_m : float
        Travel in which it goes from 10 % to 90 % of its swing.
    width_n : float
        Mean difference between deceleration and acceleration at equal speeds: frictional memory. NaN if the ramps have
        too few samples.
    """

    key: str
    condition: Condition
    speed_m_s: float
    time_s: Array
    position_m: Array
    velocity_m_s: Array
    friction_n: Array
    presliding_m: float
    width_n: float

    def _card(self) -> Card:
        rows = [
            ("speed", f"{1e3 * self.speed_m_s:.3g} mm/s"),
            ("presliding", f"{1e3 * self.presliding_m:.3g} mm"),
            ("width", f"{self.width_n:.3g} N"),
        ]
        return Card(f"loop of cycle {self.key}", ("quantity", "value"), rows)


def chosen_loops(plans: Sequence[CyclePlan]) -> frozenset[str]:
    """Return the keys of the slowest, middle and fastest cycles of the first conditions."""
    keys: list[str] = []
    for condition in sorted({plan.condition for plan in plans})[:SHOWN_CONDITIONS]:
        members = [plan for plan in plans if plan.condition == condition and plan.speed_m_s]
        level = levels(np.log([plan.speed_m_s or 1.0 for plan in members]), float(np.log1p(SAME_LEVEL)))
        known = np.unique(level)
        for one in known[np.unique(np.linspace(0, known.size - 1, SHOWN_SPEEDS).astype(int))] if known.size else ():
            keys += [members[i].key for i in np.flatnonzero(level == one)[:CANDIDATES].tolist()]
    return frozenset(keys)


def reversal_loop(motion: RecordedMotion, plan: CyclePlan) -> Loop | None:
    """Return the force balance around the first reversal of a cycle; None if it has no reversal.

    `Loop.friction_n` still contains the offset (half the sum of both directions).
    """
    recording = motion.recording
    turns = [(a, b) for a, b in pairwise(motion.strokes) if a.direction != b.direction]
    if not turns:
        return None
    before, after = turns[0]
    velocity, friction = motion.velocity_m_s, balance_of(recording)
    turn = after.from_m
    travel = abs(after.to_m - after.from_m)
    away = np.abs(recording.position_m - turn)
    index = np.arange(before.start, after.stop)
    near = np.where(index < after.start, away[index] <= BEFORE * travel, away[index] <= AFTER * travel)
    index = index[near]
    if index.size < 10:
        return None
    presliding = _presliding(recording, friction, before, after)
    shown = index[np.unique(np.linspace(0, index.size - 1, SHOWN_SAMPLES).astype(int))]
    return Loop(
        key=plan.key,
        condition=plan.condition,
        speed_m_s=abs(after.speed_m_s),
        time_s=recording.time_s[shown],
        position_m=recording.position_m[shown],
        velocity_m_s=velocity[shown],
        friction_n=friction[shown],
        presliding_m=presliding,
        width_n=_width(recording, friction, velocity, after, presliding),
    )


def _presliding(recording: Recording, friction: Array, before: Stroke, after: Stroke) -> float:
    """Return the travel after the reversal in which friction goes from 10 % to 90 % of its change."""
    part = slice(before.stop - 1, after.stop)
    start = float(np.median(friction[max(before.stop - 20, before.start) : before.stop]))
    middle = slice(after.start + (after.stop - after.start) // 3, after.start + 2 * (after.stop - after.start) // 3)
    end = float(np.median(friction[middle]))
    if start == end:
        return float("nan")
    share = (friction[part] - start) / (end - start)
    low, high = int(np.argmax(share >= 0.1)), int(np.argmax(share >= 0.9))
    if high <= low:
        return float("nan")
    return float(abs(recording.position_m[part][high] - recording.position_m[part][low]))


def _width(recording: Recording, friction: Array, velocity: Array, stroke: Stroke, presliding: float) -> float:
    """Return the mean difference of friction between slowing down and speeding up, at equal speeds of one stroke."""
    part = stroke.samples
    speed = np.abs(velocity[part]) / abs(stroke.speed_m_s)
    travel = np.abs(recording.position_m[part] - stroke.from_m)
    fast = np.flatnonzero(speed >= 0.9)
    if not fast.size or not np.isfinite(presliding):
        return float("nan")
    number = np.arange(speed.size)
    rising = (number < fast[0]) & (travel > PRESLIDINGS * presliding)
    falling = number > fast[-1]
    edges = np.linspace(0.2, 0.8, SPEED_BINS + 1)
    differences = []
    for low, high in pairwise(edges):
        inside = (speed >= low) & (speed < high)
        if (inside & rising).any() and (inside & falling).any():
            own = stroke.direction * friction[part]
            differences.append(float(own[inside & falling].mean() - own[inside & rising].mean()))
    return float(np.mean(differences)) if len(differences) >= SPEED_BINS // 2 else float("nan")
