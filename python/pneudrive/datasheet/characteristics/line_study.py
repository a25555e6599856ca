"""Speed and stroke time of a drive against its tubes, as a characteristic."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive.datasheet.characteristic import Axis, ResultValue, characteristic
from pneudrive.simulation.tube_study import DIAMETERS, LENGTHS, lines

if TYPE_CHECKING:
    from pneudrive.datasheet.characteristic import Found
    from pneudrive.datasheet.plant import HeldDrive


@characteristic(
    "lines",
    algorithm="`pneudrive lines`: steady flow through the exhaust path, and simulated strokes",
    x="length",
    y="mean_speed",
    slow=True,
    held=False,
)
def _lines(plant: HeldDrive, lengths: Any = LENGTHS, diameters: Any = DIAMETERS) -> Found:  # noqa: ANN401 - sequences
    """Speed against the tubes.

    Choked speed, stroke times, mean and end speed with steady tubes of equal length and bore at both chambers, from
    rest, emptying chamber at supply pressure.

    Settings
    --------
    lengths
        of each tube
    diameters
        inner diameters
    """
    study = lines(plant.described, list(lengths), list(diameters))  # type: ignore[arg-type]
    said = {name: (one.to_numpy(), one.attrs["units"], one.attrs["long_name"]) for name, one in study.variables.items()}
    found = {str(name): ResultValue(tuple(map(str, one.dims)), *said[name]) for name, one in study.data_vars.items()}
    return {str(name): Axis(*said[name]) for name in study.coords}, found
