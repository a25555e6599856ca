"""The result of an identification of a fixed volume."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive import units
from pneudrive.identify.intervals import WithIntervals
from pneudrive.show import Shown
from pneudrive.trajectory import whole

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pneudrive.describe.tank import Tank
    from pneudrive.identify.diagnose import Undetermined

    Array = NDArray[np.float64]

#: SI unit -> the unit in which people write it, for messages and files of tanks.
_WRITTEN = {"m^3/(s Pa)": "dm3/(s bar)", "m^3": "dm3", "Pa": "bar", "W/K": "W/K", "1": ""}


@dataclass(frozen=True, eq=False, repr=False)
class VolumeFit(WithIntervals, Shown):
    """Values of a tank with their uncertainty.

    Attributes
    ----------
    values : dict
        Name as in the file -> value, SI, pressures absolute.
    units : dict
        Name -> SI unit.
    intervals : dict
        Name -> (lower, upper), 95 %, by profile, of what the recordings determine. Empty where the search has not
        converged.
    undetermined : tuple of Undetermined
        What the recordings do not determine, why, and what to record.
    notes : tuple of str
    statistics : dict
        ``samples``; ``rms.pressure`` and ``noise.pressure``, Pa; ``rms_share.pressure``: over the range of the
        pressure, of the worst recording; ``correlation_time.samples``.
    converged : bool
    starts_pa : dict
        Recording -> pressure at its start, Pa.
    provenance : dict
    start : Tank
        The tank that the search started from.
    series : dict
        Recording -> (time s, measured pressure Pa, that of the model Pa), shape (n,) each.
    """

    values: dict[str, float]
    units: dict[str, str]
    intervals: dict[str, tuple[float, float]]
    undetermined: tuple[Undetermined, ...]
    notes: tuple[str, ...]
    statistics: dict[str, float]
    converged: bool
    starts_pa: dict[str, float]
    provenance: dict[str, Any]
    start: Tank = field(repr=False)
    series: dict[str, tuple[Array, Array, Array]] = field(repr=False, default_factory=dict)

    @property
    def determined(self) -> tuple[str, ...]:
        """Names of `values` that the recordings determine; none where the search has not converged."""
        lost = {u.parameter for u in self.undetermined}
        return tuple(name for name in self.values if name not in lost and name in self.intervals)

    def statements(self) -> list[str]:
        """Return what is not determined, in sentences."""
        return [str(u) for u in self.undetermined]

    def apply(self) -> Tank:
        """Return the tank with what was determined."""
        changes = {}
        for name in self.determined:
            value, unit = self.values[name], self.units[name]
            text = units.write(value, unit, _WRITTEN[unit]) if unit != "1" else value
            changes[name] = f"{text} abs" if unit == "Pa" else text
        return self.start.replace(changes)

    def __str__(self) -> str:
        """Values with their intervals in units of daily use, then what is not determined, then notes."""
        rms, share = self.statistics["rms.pressure"], self.statistics["rms_share.pressure"]
        lines = [f"fixed volume {self.start.name}: {self.statistics['samples']:.0f} samples"]
        for name, value in self.values.items():
            unit = _WRITTEN[self.units[name]]
            factor = units.converter(unit, self.units[name])[0] if unit else 1.0
            shown = f"{value / factor:.5g}"
            if name in self.intervals:
                low, high = (end / factor for end in self.intervals[name])
                shown += f"  (95 %: {low:.4g} to {high:.4g})"
            mark = "" if name in self.determined else "  not determined"
            lines.append(f"  {name:<30} {shown} {unit}{mark}".rstrip())
        lines.append(f"  residuals of the pressure: {rms / 1e5:.3g} bar rms, {100 * share:.2g} % of its range")
        return "\n".join([*lines, *(f"- {s}" for s in (*self.statements(), *self.notes))])

    def to_toml(self, path: str | Path) -> None:
        """Write the fit: SI values, intervals, what is not determined, provenance.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        q = json.dumps  # a TOML basic string
        out = ['kind = "volume"', f"converged = {str(self.converged).lower()}", f"notes = {q(list(self.notes))}", ""]
        for name, value in self.values.items():
            out += [f"[values.{q(name)}]", f"value = {value!r}", f"unit = {q(self.units[name])}"]
            out.append(f"determined = {str(name in self.determined).lower()}")
            if name in self.intervals:
                out.append(f"interval = [{', '.join(map(repr, self.intervals[name]))}]")
            out.append("")
        for u in self.undetermined:
            out += ["[[undetermined]]", f"parameter = {q(u.parameter)}", f"reason = {q(u.reason)}"]
            out += [f"remedy = {q(u.remedy)}", ""]
        out += ["[statistics]", *(f"{q(key)} = {value!r}" for key, value in self.statistics.items()), ""]
        out += ["[provenance]", *(f"{k} = {q(v)}" for k, v in self.provenance.items() if k != "recordings"), ""]
        for record in self.provenance["recordings"]:
            out += ["[[provenance.recordings]]", *(f"{k} = {q(v)}" for k, v in record.items()), ""]
        with whole(Path(path)) as temporary:
            temporary.write_text("\n".join(out), encoding="utf-8")
