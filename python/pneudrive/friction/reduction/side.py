"""The strokes of one direction at one speed, and their row of the friction map."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from pneudrive.friction.friction_map import Row
    from pneudrive.friction.reduction.spread import Spread
    from pneudrive.signals.motion import Stroke


@dataclass(frozen=True)
class DirectionMeans:
    """Means over the settled samples in one direction."""

    force_n: float
    pressure_a_pa: float
    pressure_b_pa: float
    velocity_m_s: float
    parallel_n: float = field(default=0.0, kw_only=True)  # error of parallel forces by their areas, one sigma
    late_n: float = field(default=0.0, kw_only=True)  # error of the gas force by the clock of its logger, one sigma


@dataclass(frozen=True, eq=False)
class Side(DirectionMeans):
    """The strokes of one direction of a speed level or a cycle.

    Attributes
    ----------
    samples, strokes, strokes_recorded : int
        Used samples, used strokes, and all strokes of the direction.
    used : tuple of Stroke
    spread : Spread
        Of the means of the used strokes at equal positions.
    pressure_moves_n : float
        Usual range of the pressure force within a stroke.
    breakaway_n, dwell_s, loading_rate_n_s : float
        Excess of the preceding reversals. NaN without a usable peak.
    ripple, period_s, step_m : float
        Standard deviation of speed over its mean; period and travel in stick-slip (NaN without).
    piston_ripple : float
        The same for the piston's speed behind the rig's spring. NaN if the stiffness of the spring is unknown.
    stick_slip : bool
    """

    samples: int
    strokes: int
    strokes_recorded: int
    used: tuple[Stroke, ...]
    spread: Spread
    pressure_moves_n: float
    breakaway_n: float
    dwell_s: float
    loading_rate_n_s: float
    ripple: float
    period_s: float
    step_m: float
    piston_ripple: float
    stick_slip: bool


class RowValue(NamedTuple):
    """Friction of one row with its uncertainty: the columns of the map of these names."""

    balance_n: float
    friction_n: float
    offset_n: float
    stderr_n: float
    u_systematic_n: float


def row_of(
    name: str,
    direction: int,
    side: Side,
    value: RowValue,
    window_m: tuple[float, float],
    flags: str,
    ambient_pressure_pa: float,
) -> Row:
    """Return the row of one direction of a recording's speed level, or of a cycle.

    Parameters
    ----------
    name : str
        Index of the recording, or of the cycle.
    direction : int
    side : Side
    value : RowValue
    window_m : tuple of float
        Positions between which friction is averaged.
    flags : str
        Names, separated by commas.
    ambient_pressure_pa : float
    """
    columns = ("velocity_m_s", "pressure_a_pa", "pressure_b_pa", "samples", "strokes", "strokes_recorded")
    breakaway = ("breakaway_n", "dwell_s", "loading_rate_n_s")
    return {
        "recording": name,
        "direction": direction,
        **{column: getattr(side, column) for column in (*columns, *breakaway)},
        **value._asdict(),
        "position_from_m": window_m[0],
        "position_to_m": window_m[1],
        "flags": flags,
        "ambient_pressure_pa": ambient_pressure_pa,
    }
