"""One cycle over bins of position: force balance of each direction, means, sliding, uncertainties.

A cycle is a recording with a plan: one speed, set pressures. A speed level of a recording is a cycle without a plan.
Samples may be unevenly spaced: bins have equal weight, so a burst around a reversal has only the weight of its travel.
Means and breakaway of a direction are those of ``strokes.py``, as for a speed level.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.estimate.autocorrelation import stderr_of_mean
from pneudrive.friction.reduction.budget import stated_shares
from pneudrive.friction.reduction.motion import RecordedMotion
from pneudrive.friction.reduction.pairing import bin_means, pair
from pneudrive.friction.reduction.reversal import ReversalPeak, find_reversal_peaks
from pneudrive.friction.reduction.side import Side
from pneudrive.friction.reduction.stick_slip import ripple_of
from pneudrive.friction.reduction.strokes import by_direction, side_values, stroke_grid, stroke_rows, window_means

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.friction.reduction.condition import Condition
    from pneudrive.signals.motion import Stroke

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


@dataclass(frozen=True, eq=False)
class CycleSide(Side):
    """The strokes of one direction of a cycle, in bins of position.

    Attributes
    ----------
    balance_n : ndarray, shape (bins,)
        Force balance (see `Recording.balance_n`) in each bin of position, NaN without settled samples.
    air_n : ndarray, shape (bins,)
        Its part from the chamber pressures, p_a A_a - p_b A_b - p_ambient (A_a - A_b).
    ripple, period_s, step_m, swing_n : float
        Standard deviation of speed over its mean; period, travel and swing of the balance in stick-slip (NaN without).
    piston_ripple : float
        The same for the piston's speed behind the rig's spring. NaN if the stiffness of the spring is unknown.
    scatter_n : float
        Standard deviation of the balance within the bins.
    stick_slip : bool
    """

    balance_n: Array
    air_n: Array
    ripple: float
    period_s: float
    step_m: float
    swing_n: float
    piston_ripple: float
    scatter_n: float
    stick_slip: bool


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
        """Strokes of both directions that enter the means."""
        return sum(side.strokes for side in self.sides.values())


def reduce_cycle(motion: RecordedMotion, plan: CyclePlan, edges_m: Array) -> CycleData:
    """Reduce the strokes of one speed to bins of position.

    Parameters
    ----------
    motion : RecordedMotion
    plan : CyclePlan
    edges_m : ndarray, shape (bins + 1,)
        Edges of the bins of position that all cycles share.

    Raises
    ------
    RecordingError
        If no stroke has a settled part.
    """
    recording = motion.recording
    sides = {d: side for d in (1, -1) if (side := _side(motion, d, edges_m)) is not None}
    if not sides:
        value = f"{len(motion.strokes)} strokes"
        raise RecordingError("no stroke has a settled part", where=recording.name, value=value)
    only = next(iter(sides.values()))
    stated = stated_shares(recording, *(sides.get(d, only) for d in (1, -1)))
    return CycleData(
        plan=plan,
        sides=sides,
        strokes_recorded=len(motion.strokes),
        duration_s=float(recording.time_s[-1] - recording.time_s[0]),
        **stated,  # pyright: ignore[reportArgumentType] - names and kinds of the fields
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
            rule="a cycle must have one speed: it is one point of the characteristic",
        )


def _side(motion: RecordedMotion, direction: int, edges_m: Array) -> CycleSide | None:
    """Combine the strokes of one direction; return None without settled samples in a whole bin."""
    recording, settled, balance_n = motion.recording, motion.settled, motion.balance_n
    strokes = [s for s in motion.strokes if s.direction == direction and settled[s.samples].sum() >= MINIMUM_SAMPLES]
    window = (float(edges_m[0]), float(edges_m[-1]))
    found = [means for s in strokes if (means := window_means(recording, s, settled, window)) is not None]
    if not found:
        return None

    def binned(values: Array) -> Array:
        return bin_means(motion.position_m, values, edges_m, [s.samples for s in strokes], settled)

    means = binned(balance_n)
    reached = motion.position_m[np.concatenate([np.flatnonzero(settled[s.samples]) + s.start for s in strokes])]
    covered = _covered(reached, edges_m) & np.isfinite(means)
    if not covered.any():
        return None  # the settled part is shorter than a bin
    ambient = recording.ambient_pressure_pa
    air = (recording.pressure_a_pa - ambient) * recording.area_a_m2
    air -= (recording.pressure_b_pa - ambient) * recording.area_b_m2
    slipping, slips = ripple_of(recording, balance_n, strokes)
    squares = (binned(balance_n**2) - means**2)[covered]
    return CycleSide(
        **side_values(found, _peaks(motion, strokes), strokes),
        balance_n=np.where(covered, means, np.nan),
        air_n=np.where(covered, binned(air), np.nan),
        strokes_recorded=sum(s.direction == direction for s in motion.strokes),
        scatter_n=float(np.sqrt(max(squares.mean(), 0.0))),
        stick_slip=slipping,
        **slips,
    )


def _covered(position_m: Array, edges_m: Array) -> NDArray[np.bool_]:
    """Return the bins that lie entirely in the settled part: a cut bin has another mean position."""
    width = edges_m[1] - edges_m[0]
    slack = 0.1 * width
    return (edges_m[:-1] >= position_m.min() - slack) & (edges_m[1:] <= position_m.max() + slack)


def _peaks(motion: RecordedMotion, strokes: list[Stroke]) -> list[ReversalPeak]:
    """Return the peaks after the reversals before these strokes."""
    if not any(s.index > 0 for s in strokes):
        return []  # the first stroke has no reversal before it
    low, high = float(motion.position_m.min()), float(motion.position_m.max())
    window = (low + 0.2 * (high - low), high - 0.2 * (high - low))
    grid = stroke_grid(motion.position_m, motion.strokes, window)
    rows = stroke_rows(motion.position_m, motion.raw_balance_n, motion.settled, motion.strokes, grid)
    profile = pair(grid, by_direction(motion.strokes, rows))
    return find_reversal_peaks(motion.recording, strokes, motion.raw_balance_n, profile)
