"""What no rig and no drive can have measured: wrong units, columns and signs, before they come out as strange physics.

Impossible numbers are refused; numbers that are possible and unusual are doubts, which the friction map carries as
flags and the notes as sentences.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.motion import thinned
from pneudrive.errors import RecordingError
from pneudrive.friction.sentences import sentence

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.characterise.motion import Stroke
    from pneudrive.characterise.recording import Recording

#: Values by which a channel is judged: outliers do not count.
QUANTILES = (0.01, 0.99)
# What any rig can do (all assumed): beyond the first of each pair a recording is refused, beyond the second doubted.
LOWEST_PA = -5e3  # absolute: the zero of a transducer at vacuum may be this far off
PRESSURES_PA = (100e5, 20e5)
SPEEDS_M_S = (50.0, 10.0)
FORCES_N = (1e7, 1e6)
LONGEST_M = 100.0
BELOW_AMBIENT = 0.1  # of ambient pressure: lower ones are a vacuum, or gauge pressures written as absolute
UNFOLLOWED = 0.25  # of pressure times area: the force misses that much of it
SMALLEST_N = 1e-3  # friction that no force sensor of a piston drive sees
FULL_PRESSURE_PA = 10e5  # friction above what this pressure pushes on the piston would stop any drive


def refuse_pressure(name: str, pressure_pa: NDArray[np.float64], where: str) -> None:
    """Refuse an absolute pressure that lies below vacuum or beyond any rig; single outliers do not count.

    Raises
    ------
    RecordingError
        It does.
    """
    if pressure_pa.size == 0 or _all_within(pressure_pa, LOWEST_PA, PRESSURES_PA[0]):
        return
    low, high = np.quantile(thinned(pressure_pa), QUANTILES)
    if low < LOWEST_PA or high > PRESSURES_PA[0]:
        worst, why = (low, "lies below vacuum") if low < LOWEST_PA else (high, "no pneumatic rig has")
        raise RecordingError(
            f"{name} is {worst / 1e5:.4g} bar absolute, which {why}",
            where=where,
            rule=f"from 0 to {PRESSURES_PA[0] / 1e5:g} bar absolute",
            remedy="look at the column, its unit, its decimal sign, and whether it is gauge or absolute: in the "
            "layout, or in what wrote the file",
        )


def refuse_channels(recording: Recording) -> None:
    """Refuse a recording of a rig whose pressures or forces no rig can have.

    Raises
    ------
    RecordingError
        A pressure below vacuum, or pressures or forces beyond any rig.
    """
    where = str(recording.source or recording.name)
    for channel in ("pressure_a_pa", "pressure_b_pa"):
        refuse_pressure(channel.removesuffix("_pa"), getattr(recording, channel), where)
    if recording.force_n.size and not _all_within(recording.force_n, -FORCES_N[0], FORCES_N[0]):
        strongest = float(np.quantile(np.abs(thinned(recording.force_n)), QUANTILES[1]))
        _no_more("the force reaches", strongest, FORCES_N[0], "N", "force", where)


def refuse_impossible(recording: Recording, strokes: Sequence[Stroke]) -> None:
    """Refuse a recording of a rig that holds what no rig can do.

    Raises
    ------
    RecordingError
        A pressure below vacuum, or pressures, speeds, travels or forces beyond any rig.
    """
    refuse_channels(recording)
    where = str(recording.source or recording.name)
    fastest = max(abs(stroke.speed_m_s) for stroke in strokes)
    longest = max(abs(stroke.to_m - stroke.from_m) for stroke in strokes)
    _no_more("the piston moves at", fastest, SPEEDS_M_S[0], "m/s", "time and the position", where)
    _no_more("the strokes are", longest, LONGEST_M, "m long", "position", where)


def _no_more(what: str, value: float, limit: float, unit: str, column: str, where: str) -> None:
    if value > limit:
        raise RecordingError(
            f"{what} {value:.4g} {unit}, which no pneumatic rig does",
            where=where,
            rule=f"at most {limit:g} {unit}",
            remedy=f"look at the unit of the {column}: in the layout, or in what wrote the file",
        )


def _all_within(values: NDArray[np.float64], low: float, high: float) -> bool:
    """Whether not even a single outlier is outside: the quantiles, which take long, are not asked for then."""
    return bool(low <= values.min() and values.max() <= high)


def doubts_of(
    recording: Recording,
    gauge_pa: dict[str, float],
    speed_m_s: float,
    friction_n: float,
    offset_n: float,
    u_offset_n: float,
) -> dict[str, str]:
    """Say what about a speed level is possible, and hardly so: flag -> what to look at, in a sentence.

    A recording whose areas are zero has no pressure to be held against: its force is the friction itself.
    """
    ambient, areas = recording.ambient_pressure_pa, (recording.area_a_m2, recording.area_b_m2)
    lowest, highest = min(gauge_pa.values()) + ambient, max(gauge_pa.values()) + ambient
    pushed = gauge_pa["b"] * areas[1] - gauge_pa["a"] * areas[0] + recording.weight_n
    friction, missed = abs(friction_n), abs(offset_n)  # the offset is NaN where one direction is missing
    unfollowed = missed > max(UNFOLLOWED * abs(pushed), friction, 3.0 * u_offset_n) and abs(pushed) > friction
    full = FULL_PRESSURE_PA * max(areas)
    seen = {
        "below_ambient": lowest < (1.0 - BELOW_AMBIENT) * ambient,
        "beyond_usual": highest > PRESSURES_PA[1] or speed_m_s > SPEEDS_M_S[1],
        "force_not_pressure": any(areas) and unfollowed,
        "friction_beyond_piston": any(areas) and friction > full,
        "no_friction": any(areas) and friction < SMALLEST_N,
    }
    values = {
        "lowest": lowest / 1e5,
        "highest": highest / 1e5,
        "speed_m_s": speed_m_s,
        "force_n": pushed + offset_n,
        "pushed_n": pushed,
        "friction_n": friction,
        "full_n": full,
    }
    return {flag: sentence(f"doubt.{flag}", **values) for flag, is_so in seen.items() if is_so}


NEGATIVE = "negative friction"
OUTLIER = "outlier"
SURE = 3.0  # standard errors below zero: no friction that noise made negative
NEIGHBOURS = 6  # nearest cycles in speed, with which a cycle's friction is held
ENOUGH = 4
FAR = 10.0  # times more or less friction than at neighbouring speeds: a sensor, a unit or a range, no seal


def implausible_friction(
    condition: NDArray[np.int64],
    speed_m_s: NDArray[np.float64],
    friction_n: NDArray[np.float64],
    stderr_n: NDArray[np.float64],
) -> tuple[str, ...]:
    """Say of each cycle of a campaign, shape (n,), whether its friction cannot be; "" where it can."""
    pace = np.log(np.maximum(speed_m_s, 1e-12))
    found: list[str] = [""] * friction_n.size
    for here in (np.flatnonzero(condition == k) for k in np.unique(condition)):
        order = here[np.argsort(pace[here], kind="stable")]
        for at, i in enumerate(order.tolist()):
            near = order[max(at - NEIGHBOURS, 0) : at + NEIGHBOURS + 1]
            near = near[near != i]
            near = near[np.argsort(np.abs(pace[near] - pace[i]), kind="stable")][:NEIGHBOURS]
            usual = float(np.median(np.abs(friction_n[near]))) if near.size >= ENOUGH else 0.0
            if friction_n[i] < -SURE * stderr_n[i]:
                found[i] = NEGATIVE
            elif usual > 0 and not usual / FAR <= abs(friction_n[i]) <= usual * FAR:
                found[i] = OUTLIER
    return tuple(found)
