"""All characteristics by name: the list that command line, documentation and datasheet use."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from pneudrive.datasheet.characteristic import characteristics_in
from pneudrive.datasheet.equilibrium import number_of
from pneudrive.datasheet.intervals import with_intervals
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.errors import CommandError, nearest
from pneudrive.progress import Watch

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr

    from pneudrive.datasheet.characteristic import Characteristic
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.progress import Flag


@cache
def characteristics() -> dict[str, Characteristic]:
    """Return all characteristics by name."""
    from pneudrive.datasheet import published, stands
    from pneudrive.datasheet.characteristics import (
        air,
        cushion,
        frequency,
        line_study,
        response,
        steady,
        stiffness,
        threshold,
        tornado,
        valve_times,
    )

    # in the order of the datasheet
    families = (steady, stiffness, threshold, response, air, stands)
    families += (cushion, frequency, tornado, line_study, valve_times, published)
    return {one.name: one for family in families for one in characteristics_in(family)}


def drive_characteristic(
    drive: Drive | Circuit,
    name: str,
    *,
    intervals: bool = True,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
    **settings: Any,  # noqa: ANN401 - of each characteristic its own
) -> xr.Dataset:
    """Return a characteristic of a drive.

    Parameters
    ----------
    drive : Drive or Circuit
        One piston under one to four valves.
    name : str
        ``"velocity"``, ``"force-speed"``, ...; `pneudrive characteristic DRIVE` lists them.
    intervals : bool
        Whether intervals of identified values of the drive go through to the results.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.
    **settings
        Settings of the characteristic, such as ``pressures=["3 bar abs"]``.

    Returns
    -------
    xarray.Dataset
        Results with ``units`` and ``long_name``. If values of the drive have intervals, they have ``interval`` (the
        names of two variables, lower and upper end). Its ``attrs`` hold definition, algorithm, standard, citations,
        description_hash, assumed, and the source of the intervals.

    Raises
    ------
    CommandError
        The characteristic or the setting does not exist, or the drive does not have it.
    SimulationError
        A state or a run that it needs does not exist.
    Cancelled
        `cancel` was set.

    Examples
    --------
    >>> import pneudrive as pn
    >>> found = pn.drive_characteristic(pn.Drive.load("catalogue:reference"), "force-speed", points=2)
    >>> found.stall_force.attrs["units"], round(float(found.stall_force[0]), 1)
    ('N', 248.9)
    """
    return found_under(drive, name, Watch(progress, cancel), intervals=intervals, **settings)


def found_under(
    drive: Drive | Circuit,
    name: str,
    watch: Watch,
    *,
    intervals: bool = True,
    **settings: Any,  # noqa: ANN401
) -> xr.Dataset:
    """Return a characteristic like `characteristic`, under a watch."""
    one = characteristic_named(name)
    for setting in settings:
        if setting not in one.settings:
            raise CommandError(f"{name} has no setting {setting!r}", remedy=nearest(setting, one.settings))
    settings = {setting: _read_setting(one, setting, value) for setting, value in settings.items()}
    watch.look()
    plain = _seen(drive, one, settings)
    if not intervals:
        return plain
    return with_intervals(drive, plain, lambda other: _seen(other, one, settings), watch)


def characteristic_named(name: str) -> Characteristic:
    """Return a characteristic by its name.

    Raises
    ------
    CommandError
        It does not exist; the message gives the nearest name or title.
    """
    known = characteristics()
    if name in known:
        return known[name]
    titled = {one.title.lower().replace(" ", "-"): one.name for one in known.values()}
    remedy = f"Did you mean '{titled[name]}'?" if name in titled else nearest(name, known)
    raise CommandError(f"there is no characteristic {name!r}", remedy=remedy)


#: Settings that are quantities, and their unit.
_UNITS = {"position": "m", "half_period": "s", "duration": "s", "speed": "m/s", "end_speed": "m/s", "volume": "m3"}


def _read_setting(one: Characteristic, name: str, value: Any) -> Any:  # noqa: ANN401 - of each setting its own
    """Return a setting in SI: a quantity with or without its unit, or a number.

    Raises
    ------
    CommandError
        It is neither.
    """
    default = one.settings[name][0]
    if value is None or (name not in _UNITS and not isinstance(default, float)):
        return value
    if isinstance(value, str) and name not in _UNITS:
        raise CommandError(f"{name} = {value} is not a number", remedy=f"{name}: {one.settings[name][1]}")
    return number_of(value, _UNITS.get(name, ""), name)


def _seen(drive: Drive | Circuit, one: Characteristic, settings: dict[str, Any]) -> xr.Dataset:
    plant = HeldDrive(drive)
    if plant.actuation.is_switched and one.needs_shares:
        raise CommandError(
            f"{plant.name}: {' and '.join(plant.actuation.held)} is on or off",
            rule=f"{one.name} is about small and partial commands, which a switching valve does not have",
        )
    return one.of(plant.static if one.held else plant, **settings)
