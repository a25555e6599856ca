"""Importance of the numbers of a drive: relative sensitivities of its characteristics."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import units
from pneudrive.datasheet.characteristic import ResultValue, characteristic
from pneudrive.datasheet.characteristics.response import one_stroke
from pneudrive.datasheet.characteristics.steady import adiabatic_stiffness, full_force
from pneudrive.datasheet.equilibrium import under_load
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.describe.files.provenance import values
from pneudrive.describe.marks import StatedPressure
from pneudrive.errors import CommandError, PneudriveError, nearest
from pneudrive.simulation.tube_study import DIAMETERS, LENGTHS, lines

if TYPE_CHECKING:
    from pneudrive.datasheet.characteristic import Found
    from pneudrive.describe.drive import Drive


SHARE = 1e-3  # of a number, to both sides
_RESULTS = {
    "steady_speed": "steady speed at full command",
    "stall_force": "largest load that the resting piston can move",
    "natural_frequency": "natural frequency at mid stroke",
    "stroke_time": "time of a full stroke from rest",
    "end_speed": "speed at the end of that stroke",
}


def moved(drive: Drive, name: str, factor: float) -> Drive:
    """Return a drive with one of its numbers multiplied by a factor."""
    given = values(drive)[name]
    if isinstance(given.mark, StatedPressure):
        pressure = _part(drive, name)
        text = f"{factor * pressure.value_pa!r} Pa {'gauge' if pressure.gauge else 'abs'}"
        return drive.replace({name: text})
    unit = given.mark.si_unit if given.mark is not None else ""
    value = factor * given.si
    return drive.replace({name: units.UnitFloat(value, unit, given.mark.written) if unit else value})  # type: ignore[union-attr]


def _part(drive: Drive, name: str) -> units.Pressure:
    found: Any = drive
    for key in name.split("."):
        found = getattr(found, key)
    return found


def _of(plant: HeldDrive) -> dict[str, float]:
    """Return the results of one drive."""
    x = 0.5 * plant.stroke_m
    spring = adiabatic_stiffness(plant.static, x, "3 bar abs")
    stroke = one_stroke(plant, 1.0, 0.0, plant.before(1.0)).strokes[0]
    return {
        "steady_speed": under_load(plant.static, 1.0, x, 0.0).velocity_m_s,
        "stall_force": full_force(plant.static, 1.0)[1],
        "natural_frequency": math.sqrt(spring / plant.mass) / (2.0 * math.pi),
        "stroke_time": stroke.stroke_time,
        "end_speed": stroke.end_speed,
    }


@characteristic(
    "sensitivity",
    algorithm="central differences of 0.1 % of the number",
    x="parameter",
    y="stroke_time_sensitivity",
    slow=True,
    held=False,
)
def _tornado(plant: HeldDrive, numbers: Any = None) -> Found:  # noqa: ANN401 - a sequence of names
    """Sensitivity to each number of the drive.

    Relative change of a result over the relative change of one number of the drive file.

    Settings
    --------
    numbers
        of the drive file; default: all
    """
    drive: Any = plant.described
    if not hasattr(drive, "cylinder"):
        raise CommandError(f"{plant.name} is a circuit", rule="sensitivities are those of a drive file")
    names, rows = [], []
    known = values(drive)
    for name in numbers or ():
        if name not in known:
            raise CommandError(f"{name} is not a number of this drive", remedy=nearest(name, known))
    for name in known if numbers is None else numbers:
        if known[name].si == 0.0:
            continue
        try:
            low, high = (_of(HeldDrive(moved(drive, name, 1.0 + sign * SHARE))) for sign in (-1.0, 1.0))
        except PneudriveError:  # at a bound, or tied to another number
            continue
        width = math.log1p(SHARE) - math.log1p(-SHARE)
        names.append(name)
        rows.append([math.log(high[key] / low[key]) / width for key in _RESULTS])
    table = np.array(rows)
    order = np.argsort(-np.nanmax(np.abs(table), axis=1))
    over, relative = ("parameter",), "relative change of the {}, over that of the number"
    found = {
        f"{key}_sensitivity": ResultValue(over, table[order, number], "1", relative.format(words))
        for number, (key, words) in enumerate(_RESULTS.items())
    }
    return found | {"parameter": ResultValue(over, [names[k] for k in order], "1", "number of the drive file")}


# --- Speed and stroke time of a drive against its tubes, as a characteristic.


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
    return {str(name): ResultValue((str(name),), *said[name]) for name in study.coords} | found
