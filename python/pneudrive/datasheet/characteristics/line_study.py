"""Speed and stroke time of a drive against its tubes, as a characteristic."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive.datasheet.characteristic import Characteristic, ResultValue
from pneudrive.simulation.tube_study import DIAMETERS, LENGTHS, lines

if TYPE_CHECKING:
    from pneudrive.datasheet.plant import HeldDrive

    Found = tuple[dict[str, ResultValue], dict[str, ResultValue]]


def _lines(plant: HeldDrive, lengths: Any = LENGTHS, diameters: Any = DIAMETERS) -> Found:  # noqa: ANN401 - sequences
    study = lines(plant.described, list(lengths), list(diameters))  # type: ignore[arg-type]
    tables = ({str(name): _labelled(one) for name, one in table.items()} for table in (study.coords, study.data_vars))
    given, found = tables
    return given, found


def _labelled(one: Any) -> ResultValue:  # noqa: ANN401 - a variable of a data set
    return ResultValue(tuple(map(str, one.dims)), one.to_numpy(), one.attrs["units"], one.attrs["long_name"])


CHARACTERISTICS = (
    Characteristic(
        name="lines",
        title="Speed against the tubes",
        definition="Choked speed, stroke times, mean and end speed with steady tubes of equal length and bore at both "
        "chambers, from rest, emptying chamber at supply pressure.",
        algorithm="`pneudrive lines`: steady flow through the exhaust path, and simulated strokes",
        find=_lines,
        x="length",
        y="mean_speed",
        settings={"lengths": (LENGTHS, "of each tube"), "diameters": (DIAMETERS, "inner diameters")},
        slow=True,
        held=False,
    ),
)
