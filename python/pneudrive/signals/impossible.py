"""What no rig and no drive can have measured: wrong units, columns and signs, before they come out as strange physics.

Impossible numbers are refused here; numbers that are possible and unusual are doubts, which the friction map carries.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.signals.motion import thinned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

#: Values by which a channel is judged: outliers do not count.
QUANTILES = (0.01, 0.99)
# What any rig can do (all assumed): beyond the first of each pair a recording is refused, beyond the second doubted.
LOWEST_PA = -5e3  # absolute: the zero of a transducer at vacuum may be this far off
PRESSURES_PA = (100e5, 20e5)
SPEEDS_M_S = (50.0, 10.0)
FORCES_N = (1e7, 1e6)
LONGEST_M = 100.0


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
