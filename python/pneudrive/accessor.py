"""Accessor ``run.pneu`` of xarray: unit conversion, plot, key figures, strokes and energy of a run."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from pneudrive import units
from pneudrive.datasheet.strokes import StrokeNumbers, stroke_of
from pneudrive.errors import CommandError, DescriptionError
from pneudrive.lazy_names import upper
from pneudrive.simulation.run_limits import ExhaustAir, exhaust_air
from pneudrive.simulation.trajectory import attributes, columns

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from pneudrive.describe import Circuit, Drive
    from pneudrive.views import View

_JOULE = " [J]"


@xr.register_dataset_accessor("pneu")
class Pneu:
    """Methods of a run, available as ``run.pneu``.

    Parameters
    ----------
    run : xarray.Dataset
        Run of `pneudrive.simulate`, or run read from a file.
    """

    def __init__(self, run: xr.Dataset) -> None:
        self._run = run.assign_attrs(attributes(run))

    def to(self, *wanted: str) -> xr.Dataset:
        """Return the run in other units. Each unit applies to all columns and coordinates of its quantity.

        Parameters
        ----------
        *wanted : str
            Units, such as ``"bar"``, ``"mm"``, ``"degC"``. Pressures stay absolute.

        Returns
        -------
        xarray.Dataset
            A new data set. Its variables have their unit in ``attrs["units"]``. `strokes`, and functions that
            write files or reports, require a run in SI.

        Raises
        ------
        CommandError
            If no column can be converted to one of the units.

        Examples
        --------
        >>> import pneudrive as pn
        >>> run = pn.simulate(pn.Drive.load("catalogue:reference"), 0.6, "0.1 s")
        >>> shown = run.pneu.to("bar", "mm")
        >>> float(run.position[0]), float(shown.position[0]), shown.position.units, shown.pressure_a.units
        (0.25, 250.0, 'mm', 'bar')
        """
        changed: dict[str, xr.DataArray] = {}
        columns = {name: values for name, values in self._run.variables.items() if values.dtype.kind in "iuf"}
        for unit in wanted:
            if not isinstance(unit, str):
                remedy = 'Write for instance run.pneu.to("bar", "mm").'
                raise CommandError(f"the unit {unit!r} is not a string", remedy=remedy)
            found: dict[str, xr.DataArray] = {}
            for name, values in columns.items():
                with suppress(DescriptionError):  # the column has another quantity
                    factor, offset = units.converter(unit, _si(values))
                    shown = (np.asarray(values) - offset) / factor
                    found[str(name)] = xr.DataArray(shown, dims=values.dims, attrs={**values.attrs, "units": unit})
            if not found:
                raise CommandError(
                    f'no column of this run can be converted to "{unit}"',
                    rule=f"a unit that converts to {', '.join(sorted({_si(column) for column in columns.values()}))}",
                )
            changed |= found
        return self._run.assign(changed)

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the run over time, see `pneudrive.report.plot`.

        Parameters
        ----------
        path : path-like, optional
            Picture to write: .png, .svg or .pdf.

        Returns
        -------
        matplotlib.figure.Figure

        Examples
        --------
        >>> import pneudrive as pn
        >>> run = pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 1", "0.1 s")
        >>> len(run.pneu.plot().axes)
        6
        """
        return upper("plot")(self._run, path)

    def view(self, drive: Drive | Circuit | None = None) -> View:
        """Return plot and key figures of a run: stroke times, impacts, air consumption, peak pressures, warnings.

        The content depends on the data set. A controlled run has a score, a characteristic has results, and an
        ensemble has the spread of its outputs. A sensitivity has the effect of each input. A friction map has curves
        and flags.

        Parameters
        ----------
        drive : Drive or Circuit, optional
            Simulated drive or circuit. Air volumes (ANR) are computed from its gas. Default: air.

        Returns
        -------
        View
            ``rows`` has the values in SI. A stroke time is the time from the command to the impact at the end. Stroke
            times require ``attrs["command_steps"]``.

        Raises
        ------
        CommandError
            If the run is not in SI.

        Examples
        --------
        >>> import pneudrive as pn
        >>> run = pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 0.6, 1 s: -0.6", "2 s")
        >>> [value.sentence for value in run.pneu.view().leading if "stroke" in value.quantity]
        ['stroke time, to the end of chamber b 0.136 s', 'stroke time, to the end of chamber a 0.324 s']
        """
        if "characteristic" in self._run.attrs:
            return upper("characteristic_view")(self._run)
        for dimension, view in (("member", "ensemble_view"), ("number", "sensitivity_view"), ("row", "map_view")):
            if dimension in self._run.dims:
                return upper(view)(self._run)
        return upper("view_of_run")(self._run, drive)

    def info(self, drive: Drive | Circuit | None = None) -> View:
        """Return the same view as `view`.

        Examples
        --------
        >>> import pneudrive as pn
        >>> run = pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 0.6, 1 s: -0.6", "2 s")
        >>> [(row.key, row.text, row.usual_unit) for row in run.pneu.info().rows if row.key == "impact 1.stroke time"]
        [('impact 1.stroke time', '0.136', 's')]
        """
        return self.view(drive)

    def strokes(self, drive: Drive) -> list[StrokeNumbers]:
        """Return times, speeds and peak pressures of each stroke, from one change of the command to the next.

        Parameters
        ----------
        drive : Drive
            Drive that was simulated. Its stroke and its masses are needed.

        Returns
        -------
        list of StrokeNumbers
            In the order of time; see `pneudrive.datasheet.strokes`. Without ``attrs["command_steps"]``, the time of a
            command step is uncertain by one sampling interval (`begin_within`).

        Raises
        ------
        CommandError
            If the run belongs to another drive, or is not in SI.

        Examples
        --------
        >>> import pneudrive as pn
        >>> drive = pn.Drive.load("catalogue:reference")
        >>> run = pn.simulate(drive, "0 s: 0.6, 1 s: -0.6", "2 s")
        >>> [(one.direction, f"{one.stroke_time:.3f} s") for one in run.pneu.strokes(drive)]
        [(1, '0.136 s'), (-1, '0.324 s')]
        """
        if not hasattr(drive, "cylinder"):
            raise CommandError(
                f'"{drive.name}" is a circuit',
                rule="strokes are defined only for one drive with one command",
                remedy="run.pneu.info(circuit) shows impacts, peak pressures and air.",
            )
        if self._run.attrs.get("description_hash") != drive.description_hash or "command" not in self._run:
            raise CommandError(
                f'this run was made with another description of "{drive.name}"',
                remedy="Give the drive that was simulated.",
            )
        time, command = (self._run[name].to_numpy() for name in ("time", "command"))
        steps = self._run.attrs.get("command_steps")
        if steps is None:
            before = np.flatnonzero(np.diff(command))
            changes = [(float(time[k + 1]), float(time[k + 1] - time[k])) for k in before]
        else:
            changes = [(at, 0.0) for at, _ in steps if time[0] < at < time[-1]]
        begins, within = zip((float(time[0]), 0.0), *changes, strict=True)
        ends = [*begins[1:], math.inf]
        return [stroke_of(self._run, drive, *span) for span in zip(begins, ends, within, strict=True)]

    def exhaust_air(self, drive: Drive | Circuit) -> ExhaustAir | None:
        """Return the temperature of the air that leaves the cylinders, and how often a chamber exhausts.

        Parameters
        ----------
        drive : Drive or Circuit
            Drive or circuit that was simulated. Its ambient pressure is needed.

        Returns
        -------
        ExhaustAir or None
            None if no gas leaves a cylinder.

        Examples
        --------
        >>> import pneudrive as pn
        >>> drive = pn.Drive.load("catalogue:reference")
        >>> air = pn.simulate(drive, "0 s: 0.6, 1 s: -0.6", "2 s").pneu.exhaust_air(drive)
        >>> air.exhausts, air.mean_k < 273.15
        (1, False)
        """
        return exhaust_air(columns(self._run), drive.ambient.pressure_pa)

    def energy(self) -> dict[str, units.UnitFloat]:
        """Return the energy balance of the run: heat, work and enthalpy across the system boundary, positive inward.

        Returns
        -------
        dict of str to UnitFloat
            Energies in J by name, such as ``"cylinder: friction heat"``, integrated together with the motion.

        Raises
        ------
        CommandError
            If the run was simulated without ``ledger=True``.

        Examples
        --------
        >>> import pneudrive as pn
        >>> run = pn.simulate(pn.Drive.load("catalogue:reference"), 0.6, "1 s", ledger=True)
        >>> print(run.pneu.energy()["cylinder: friction heat"] < 0)  # it leaves the drive
        True
        """
        ledger = self._run.attrs.get("ledger")
        if not ledger:
            raise CommandError("this run has no energy balance", remedy="Simulate with ledger=True.")
        accounts = ledger["accounts"].items()
        return {
            name.removesuffix(_JOULE): units.UnitFloat(value, "J", "J")
            for name, value in accounts
            if name.endswith(_JOULE)
        }


def _si(values: xr.Variable) -> str:
    return str(values.attrs.get("units", "1"))
