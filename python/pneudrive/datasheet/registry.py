"""List of all characteristics by name, for command line, documentation and datasheet."""

from __future__ import annotations

from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import units
from pneudrive.datasheet.characteristic import Characteristic
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.describe.files.provenance import values
from pneudrive.describe.system import PISTON
from pneudrive.errors import CommandError, nearest
from pneudrive.progress import UNWATCHED, Flag, Progress, Watch
from pneudrive.simulation.simulate import number_of, positive

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from pneudrive.arrays import Array, Plain
    from pneudrive.simulation.start import DriveOrCircuit


# --- Intervals of identified values of a drive, propagated to results that are computed from it.

SAID = "each value with an interval moved to both its ends; effects added with the correlations of the values"
#: Interval bounds of the heat transfer factors in chambers and in tubes, relative to the law (docs: heat transfer).
HEAT_SPREAD, TUBE_SPREAD = (0.5, 2.0), (1.0 / 1.4, 1.4)
#: Confidence of these bounds.
HEAT_CONFIDENCE = 0.95


class UncertainDrive:
    """Drive, and its variants with one uncertain value at a bound. All characteristics use the same variants.

    Parameters
    ----------
    drive : Drive or Circuit
    """

    def __init__(self, drive: DriveOrCircuit) -> None:
        self.plant = HeldDrive(drive)
        #: Identified value of a drive -> its interval and correlations; empty for a circuit.
        self.origins: Plain = getattr(drive, "provenance", None) or {}

    @cached_property
    def variants(self) -> tuple[dict[str, list[HeldDrive]], list[str]]:
        """The drive at both bounds of each uncertain value, by name, and the names of values without usable bounds."""
        drive: Any = self.plant.described
        changes: dict[str, list[Plain]] = {}
        # The assumed factor of heat transfer, which is the same for all chambers that follow the law.
        prefix, spreads = drive.key_prefix, {}
        for name, one in drive.circuit.components.items():
            key, is_free = f"{prefix}{name}.heat_transfer_scale", one.has_heat_law and (prefix or name == PISTON)
            if is_free and key not in self.origins and one.fields["heat_transfer_scale"] not in one.model_fields_set:
                spreads[key] = TUBE_SPREAD if one.kind.startswith("tube") else HEAT_SPREAD
        if HEAT_SPREAD in spreads.values():
            changes["heat_transfer_scale"] = [{key: ends[side] for key, ends in spreads.items()} for side in (0, 1)]
        left_out = []
        known = values(drive) if self.origins else {}
        for name, origin in self.origins.items():
            mark = known[name].mark
            ends = origin.bounds_si(mark)
            unit, written = getattr(mark, "si_unit", None), getattr(mark, "written", "")
            if unit is None or not np.isfinite(ends).all():
                left_out.append(name)
                continue
            changes[name] = [{name: units.UnitFloat(end, unit, written) if unit else end} for end in ends]
        moved = {name: [HeldDrive(drive.replace(change)) for change in pair] for name, pair in changes.items()}
        return moved, left_out

    def characteristic(
        self,
        name: str,
        watch: Watch = UNWATCHED,
        *,
        intervals: bool = True,
        **settings: Any,  # noqa: ANN401 - of each characteristic its own
    ) -> xr.Dataset:
        """Return a characteristic; see `drive_characteristic`."""
        kind = characteristic_named(name)
        settings = {setting: _read_setting(kind, setting, value) for setting, value in settings.items()}
        watch.look()
        plain = kind.of(self.plant, **settings)
        if "frequencies" in kind.settings:  # those of the drive, also for its variants
            settings["frequencies"] = plain.frequency.values
        if not intervals:
            return plain
        variants, left_out = self.variants
        if left_out:
            plain.attrs["interval_left_out"] = left_out
        if not variants:
            plain.attrs["interval"] = "none: no value of the drive has an interval"
            return plain
        pairs = watch.each(list(variants.values()), "values")
        return self._with_intervals(plain, [[kind.of(one, **settings) for one in pair] for pair in pairs])

    def _with_intervals(self, plain: xr.Dataset, moved: Sequence[Sequence[xr.Dataset]]) -> xr.Dataset:
        """Add the lower and upper bound of each result, as variables ``NAME_low`` and ``NAME_high``.

        Let d_i be the change of the result if value i is at a bound of its interval. Upward changes give the upper
        bound of the result, downward changes the lower bound. If the values have the correlations r, their joint change
        d of the result is:

            d^2 = sum r_ij d_i d_j

        This is exact for results that are linear in the values.

        Parameters
        ----------
        plain : xarray.Dataset
        moved : sequence of pairs of xarray.Dataset
            Results with each of `variants` at its lower and at its upper bound.
        """
        names = list(self.variants[0])
        shared, confidences = np.eye(len(names)), []
        for i, name in enumerate(names):
            origin = self.origins.get(name)
            confidences.append(HEAT_CONFIDENCE if origin is None else origin.confidence)
            for other, correlation in origin.correlation.items() if origin else ():
                if other in names:
                    j = names.index(other)
                    shared[i, j] = shared[j, i] = correlation
        confidence = min(confidences)
        plain.attrs |= {"interval": SAID, "confidence": confidence, "interval_of": names}
        for name, value in list(plain.data_vars.items()):
            away = np.array([[np.asarray(other[name]) - np.asarray(value) for other in pair] for pair in moved])
            low, high = np.asarray(value) - together(-away, shared), np.asarray(value) + together(away, shared)
            for end, bound, word in (("low", low, "lower"), ("high", high, "upper")):
                meaning = f"{value.attrs['long_name']}, {word} end of the interval"
                plain[f"{name}_{end}"] = (value.dims, bound, {"units": value.attrs["units"], "long_name": meaning})
            plain[name].attrs |= {"interval": f"{name}_low, {name}_high", "confidence": confidence}
        return plain


def together(away: Array, shared: Array) -> Array:
    """Combine the deviations of a result at the interval bounds of all values into one upward deviation.

    Parameters
    ----------
    away : ndarray, shape (n, 2, ...)
        Deviations at the lower and the upper bound of n values; NaN counts as 0.
    shared : ndarray, shape (n, n)
        Correlations.

    Examples
    --------
    >>> float(together(np.array([[-3.0, 3.0], [-4.0, 4.0]]), np.eye(2)))
    5.0
    >>> float(together(np.array([[-3.0, 3.0], [-4.0, 4.0]]), np.array([[1.0, -1.0], [-1.0, 1.0]])))
    1.0
    """
    low, high = np.nan_to_num(np.moveaxis(away, 1, 0))
    up = np.where(high > low, 1.0, -1.0) * np.maximum(np.maximum(low, high), 0.0)
    return np.sqrt(np.maximum(np.einsum("i...,ij,j...->...", up, shared, up), 0.0))


@cache
def characteristics() -> dict[str, Characteristic]:
    """Return all characteristics by name."""
    from pneudrive.datasheet import stands
    from pneudrive.datasheet.characteristics import air, frequency, response, steady

    # in the order of the datasheet, and of each module
    families = (steady, response, air, stands, frequency)
    found = [one for family in families for one in vars(family).values()]
    return {one.name: one for one in found if isinstance(one, Characteristic)}


def drive_characteristic(
    drive: DriveOrCircuit,
    name: str,
    *,
    intervals: bool = True,
    progress: Progress | None = None,
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
        Whether intervals of identified values of the drive are propagated to the results.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.
    **settings
        Settings of the characteristic, such as ``pressures=["3 bar abs"]``.

    Returns
    -------
    xarray.Dataset
        Results with ``units`` and ``long_name``. If values of the drive have intervals, each result has ``interval``
        (the names of two variables, lower and upper bound). ``attrs`` hold definition, algorithm, standard, citations,
        description_hash, assumed, and the source of the intervals.

    Raises
    ------
    CommandError
        The characteristic or the setting does not exist, or the drive does not have this characteristic.
    SimulationError
        A state that the characteristic needs does not exist, or a run fails.
    Cancelled
        `cancel` was set.

    Examples
    --------
    >>> import pneudrive as pn
    >>> found = pn.drive_characteristic(pn.Drive.load("catalogue:reference"), "force-speed", points=2)
    >>> found.stall_force.attrs["units"], round(float(found.stall_force[0]), 1)
    ('N', 248.9)
    """
    watch = Watch(progress, cancel)
    return UncertainDrive(drive).characteristic(name, watch, intervals=intervals, **settings)


def characteristic_named(name: str) -> Characteristic:
    """Return a characteristic by its name.

    Raises
    ------
    CommandError
        The characteristic does not exist. The message gives the nearest name or title.
    """
    known = characteristics()
    if name in known:
        return known[name]
    titled = {one.title.lower().replace(" ", "-"): one.name for one in known.values()}
    remedy = f"Did you mean '{titled[name]}'?" if name in titled else nearest(name, known)
    raise CommandError(f"there is no characteristic {name!r}", remedy=remedy)


#: Unit of each setting that is a quantity.
_UNITS = {"position": "m", "half_period": "s", "end_speed": "m/s"}
_SIGNED = ("position", "command")  # other settings are greater than 0


def _read_setting(one: Characteristic, name: str, value: Any) -> Any:  # noqa: ANN401 - of each setting its own
    """Return a setting in SI. The value is a number, or a quantity with or without its unit.

    Raises
    ------
    CommandError
        The setting does not exist, its value has the wrong form, or the value must be positive and is not.
    """
    if name not in one.settings:
        raise CommandError(f"{one.name} has no setting {name!r}", remedy=nearest(name, one.settings))
    default, meaning = one.settings[name]
    if value is None or (name not in _UNITS and not isinstance(default, int | float)):
        return value
    if isinstance(value, str) and name not in _UNITS:
        raise CommandError(f"{name} = {value} is not a number", remedy=f"{name}: {meaning}")
    number = (number_of if name in _SIGNED else positive)(value, _UNITS.get(name, ""), name)
    if not isinstance(default, int):
        return number
    if not number.is_integer():
        raise CommandError(f"{name} = {value} is out of bounds", rule="a whole number, at least 1")
    return int(number)
