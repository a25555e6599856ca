"""Effects on friction: pressure, air, position, direction, time; each with its interval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pneudrive.estimate.estimates import Estimate, FTest
    from pneudrive.friction.conditions import Condition

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PressureEffects:
    """Effects of the chamber pressures on friction, for one set of levels.

    Attributes
    ----------
    levels : str
        Mounting, seal, drive.
    speed_m_s : ndarray, shape (m,)
        Speeds that were measured at all pressure pairs used.
    slope_a, slope_b, slope_sum : tuple of Estimate
        N/Pa at each speed; slope_a and slope_b are empty if only their sum is determined, slope_sum if they are
        separate.
    mean_a, mean_b, mean_sum : Estimate or None
        Over all speeds.
    interaction : FTest or None
        Effect of p_a p_b: its mean and its change with log speed. None if the design does not determine it.
    interaction_n_pa2 : Estimate or None
        Mean over speeds, N/Pa2.
    curvature : FTest or None
        Effects of the squares of both pressures.
    gauge_pa : tuple of (float, float)
        Pressure pairs used, gauge.
    hidden_n : float
        Change of friction over the campaign that the plan does not separate from the change with pressure, N. Its
        standard uncertainty is in the intervals. 0 if the plan separates them.
    statement : str
    """

    levels: str
    speed_m_s: Array
    gauge_pa: tuple[tuple[float, float], ...]
    hidden_n: float
    statement: str
    slope_a: tuple[Estimate, ...] = ()
    slope_b: tuple[Estimate, ...] = ()
    slope_sum: tuple[Estimate, ...] = ()
    mean_a: Estimate | None = None
    mean_b: Estimate | None = None
    mean_sum: Estimate | None = None
    interaction: FTest | None = None
    interaction_n_pa2: Estimate | None = None
    curvature: FTest | None = None


@dataclass(frozen=True, eq=False)
class AirShare:
    """The reading of the force sensor, divided into air and seal, at one condition; half the difference of directions.

    Attributes
    ----------
    condition : Condition
    separated : bool
        Pressures were measured in the chambers.
    speed_m_s : ndarray, shape (m,)
    total_n, total_low_n, total_high_n : ndarray, shape (m,)
        Reading of the force sensor without inertia and weight.
    air_n, air_low_n, air_high_n : ndarray, shape (m,)
        NaN if not separated.
    seal_n, seal_low_n, seal_high_n : ndarray, shape (m,)
        NaN if not separated.
    air_bound_n : ndarray, shape (m,)
        Largest force of the air that the total allows if the seal's friction does not fall below its least value
        as speed rises; NaN where separated.
    """

    condition: Condition
    separated: bool
    speed_m_s: Array
    total_n: Array
    total_low_n: Array
    total_high_n: Array
    air_n: Array
    air_low_n: Array
    air_high_n: Array
    seal_n: Array
    seal_low_n: Array
    seal_high_n: Array
    air_bound_n: Array


@dataclass(frozen=True)
class PositionWave:
    """A wave of friction over position. The range contains `order` periods, rarely a whole number.

    Cosine, sine (about the middle of the range) and amplitude are relative to the mean friction.
    """

    order: float
    wavelength_m: float
    cosine: Estimate
    sine: Estimate
    amplitude: Estimate


@dataclass(frozen=True, eq=False)
class PositionPattern:
    """Friction against position at one set of levels, relative to its mean over the range.

    Attributes
    ----------
    condition : Condition or None
        None: all cycles of the mounting, seal and drive.
    position_m : ndarray, shape (m,)
        Centres of the bins.
    relative, low, high : ndarray, shape (m,)
        Friction over its mean, 95 % interval.
    trend_per_m : Estimate
        Relative change along x.
    harmonics : tuple of PositionWave
        Waves that the pattern has beyond chance, the strongest first.
    cycles : int
    levels : str
        Mounting, seal, drive.
    """

    condition: Condition | None
    position_m: Array
    relative: Array
    low: Array
    high: Array
    trend_per_m: Estimate
    harmonics: tuple[PositionWave, ...]
    cycles: int
    levels: str = ""


@dataclass(frozen=True, eq=False)
class Asymmetry:
    """Half the difference of friction between +x and -x at one condition.

    Attributes
    ----------
    condition : Condition
    speed_m_s, half_difference_n, low_n, high_n : ndarray, shape (m,)
        (F(+x) - F(-x)) / 2, without the zero of the sensor if there are zero runs.
    mean : Estimate
        Over all speeds; its p tests symmetry.
    basis : str
        "tare", or "not separable": without zero runs it includes the zero of the sensor.
    """

    condition: Condition
    speed_m_s: Array
    half_difference_n: Array
    low_n: Array
    high_n: Array
    mean: Estimate
    basis: str


@dataclass(frozen=True)
class StickSlipPoint:
    """Stick-slip at one condition and speed: medians over strokes.

    ``share`` of the strokes show it. ``amplitude_n`` is the range of the force over a period.
    """

    condition: Condition
    speed_m_s: float
    share: float
    strokes: int
    ripple: float
    period_s: float
    step_m: float
    amplitude_n: float


@dataclass(frozen=True)
class StickSlipThreshold:
    """Speed below which stick-slip starts: between the highest speed with and the lowest speed without it."""

    condition: Condition
    low_m_s: float
    high_m_s: float
    text: str


@dataclass(frozen=True, eq=False)
class Drift:
    """Change of friction over the campaign that is not the effect of speed, pressure or levels.

    Attributes
    ----------
    time_s, drift_n, low_n, high_n : ndarray, shape (m,)
        At the cycles, relative to the mean of the campaign.
    sentinel_time_s, sentinel_n : ndarray, shape (k,)
        Friction of each sentinel.
    per_hour, per_decade_of_travel, per_kelvin : Estimate or None
        Linear in time, in the logarithm of the travel, in temperature; None if the design does not determine it.
    interrupted : Estimate or None
        Friction after an interruption less that of continuous operation.
    basis : str
        sentinels, repeats, smooth curve, not determined.
    spread_n : float
        Standard deviation of the drift over the cycles. It shows how friction in other states of this campaign differs
        from the curves, which belong to its mean state. The bands of the curves do not cover it.
    """

    time_s: Array
    drift_n: Array
    low_n: Array
    high_n: Array
    sentinel_time_s: Array
    sentinel_n: Array
    per_hour: Estimate | None
    per_decade_of_travel: Estimate | None
    per_kelvin: Estimate | None
    interrupted: Estimate | None
    basis: str
    spread_n: float


@dataclass(frozen=True)
class Repeatability:
    """Standard deviations of the friction of one cycle, as ISO 5725 divides them, N.

    ``within`` a block at equal conditions, ``between`` blocks and days, and ``total`` of both, at the mean friction of
    the repeated cycles. ``relative`` states whether they are proportional to friction. ``basis`` is the source:
    repeats,
    sentinels, or both. ``basis`` is "smooth curve" (residuals of the curves) if no cycle was repeated.
    """

    within: Estimate | None
    between: Estimate | None
    total: Estimate | None
    relative: bool
    basis: str


@dataclass(frozen=True, eq=False)
class SensorZero:
    """Zero of the force sensor.

    Attributes
    ----------
    time_s, zero_n, stderr_n : ndarray, shape (k,)
        Zero of each zero run.
    per_hour : Estimate or None
    basis : str
        "tare" or "not measured".
    """

    time_s: Array
    zero_n: Array
    stderr_n: Array
    per_hour: Estimate | None
    basis: str
