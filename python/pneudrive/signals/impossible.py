"""Impossible values, from wrong units, columns or signs.

They are refused, so that they cannot be taken for real effects.

Impossible numbers are refused here. Unusual numbers become flags of the friction map.
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

#: Quantiles by which a channel is judged, without outliers.
QUANTILES = (0.01, 0.99)
# Limits of any rig (all assumed): beyond the first of each pair a recording is refused, beyond the second doubted.
LOWEST_PA = -5e3  # absolute: largest error of a transducer's zero at vacuum
PRESSURES_PA = (100e5, 20e5)
SPEEDS_M_S = (50.0, 10.0)
SLOWEST_M_S = 5e-5  # a stroke of 50 mm in a quarter of an hour: slower ones are doubted, too
FORCES_N = (1e7, 1e6)
LONGEST_M = 100.0


def refuse_pressure(name: str, pressure_pa: NDArray[np.float64], where: str) -> None:
    """Refuse an absolute pressure below vacuum or beyond the range of any rig. Single outliers are ignored.

    Raises
    ------
    RecordingError
        If it does.
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
            remedy="check the column, its unit, its decimal sign, and whether it is gauge or absolute: in the "
            "layout, or in the program that wrote the file",
        )


def refuse_channels(recording: Recording) -> None:
    """Refuse a recording of a rig with impossible pressures or forces.

    Raises
    ------
    RecordingError
        If a pressure is below vacuum, or pressures or forces exceed those of any rig.
    """
    where = str(recording.source or recording.name)
    for channel in ("pressure_a_pa", "pressure_b_pa"):
        refuse_pressure(channel.removesuffix("_pa"), getattr(recording, channel), where)
    if recording.force_n.size and not _all_within(recording.force_n, -FORCES_N[0], FORCES_N[0]):
        strongest = float(np.quantile(np.abs(thinned(recording.force_n)), QUANTILES[1]))
        _no_more("the force reaches", strongest, FORCES_N[0], "N", "force", where)


def refuse_impossible(recording: Recording, strokes: Sequence[Stroke]) -> None:
    """Refuse a recording of a rig with impossible values.

    Raises
    ------
    RecordingError
        If a pressure is below vacuum, or pressures, speeds, travels or forces exceed those of any rig.
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
            f"{what} {value:.4g} {unit}, more than any pneumatic rig",
            where=where,
            rule=f"at most {limit:g} {unit}",
            remedy=f"check the unit of the {column}: in the layout, or in the program that wrote the file",
        )


def _all_within(values: NDArray[np.float64], low: float, high: float) -> bool:
    """Return whether all values are within; then the slow quantiles are not needed."""
    return bool(low <= values.min() and values.max() <= high)
