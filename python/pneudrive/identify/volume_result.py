"""Result of an identification of a fixed volume."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from pneudrive import units
from pneudrive.describe.tank import Tank
from pneudrive.errors import FitError
from pneudrive.identify.base import Fit
from pneudrive.identify.determined import FittedData
from pneudrive.identify.dynamic.mixture import warn_of_mixture

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: SI unit -> unit in the file of a tank.
_WRITTEN = {"m^3/(s Pa)": "dm3/(s bar)", "m^3": "dm3", "Pa": "bar", "W/K": "W/K"}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class VolumeFit(Fit):
    """Values of a tank with their uncertainty.

    Attributes
    ----------
    values : dict
        Name in the file -> value, SI, pressures absolute.
    units : dict
        Name -> SI unit.
    intervals : dict
        Name -> (lower, upper), 95 %, by profile, of determined values. Empty if the search did not converge.
    undetermined : tuple of Undetermined
        Undetermined values, each with reason and remedy.
    notes : tuple of str
    statistics : dict
        ``samples``. ``rms.pressure`` and ``noise.pressure``, Pa. ``rms_share.pressure``: relative to the range of the
        pressure, of the worst recording. ``correlation_time.samples``.
    converged : bool
    starts_pa : dict
        Recording -> pressure at its start, Pa; empty if read from a file.
    provenance : dict
    start : Tank or None
        Tank at the start of the search; None if read from a file without it.
    series : dict
        Recording -> (time s, measured pressure Pa, pressure of the model Pa), shape (n,) each.
    """

    KIND: ClassVar[str] = "volume"
    TITLE: ClassVar[str] = "fit of a volume"
    HEAD: ClassVar[str] = "# Identified fixed volume. SI units, pressures absolute; intervals are 95 %, by profile."

    start: Tank | None = field(repr=False)
    starts_pa: dict[str, float] = field(default_factory=dict)
    series: dict[str, tuple[Array, Array, Array]] = field(repr=False, default_factory=dict)

    def _is_determined(self, name: str, value: float) -> bool:
        """Return whether the recordings determine a value; False if the search did not converge."""
        del value
        return name in self.intervals

    def apply(self, tank: Tank | None = None) -> Tank:
        """Return a tank with the determined values.

        Parameters
        ----------
        tank : Tank, optional
            Default: the tank of the start of the search.

        Raises
        ------
        FitError
            The fit was read from a file without the tank.

        Warns
        -----
        PneudriveWarning
            Undetermined values keep those of the tank, with what this mixture predicts.
        """
        start = self.start if tank is None else tank
        if start is None:
            raise FitError("the file of this fit has no tank", remedy="Fit again.")
        changes = {}
        if self.determined:
            kept = set(self.free) - {*self.determined}
            warn_of_mixture(self.notes, kept, same_start=tank is None or tank == self.start)
        for name in self.determined:
            value, unit = self.values[name], self.units[name]
            text = value if unit == "1" else units.write(value, unit, _WRITTEN.get(unit))
            changes[name] = f"{text} abs" if unit == "Pa" else text
        return start.replace(changes)

    def compared(self) -> dict[str, FittedData]:
        """Return the pressures of each recording and those of the model. Empty if read from a file."""
        return {name: FittedData("time_s", "pressure_pa", *three) for name, three in self.series.items()}

    def _last(self) -> dict[str, Any]:
        return {} if self.start is None else {"tank": self.start.to_dict()}

    @classmethod
    def _from_content(cls, content: dict[str, Any]) -> dict[str, Any]:
        tank = content.get("tank")
        return super()._from_content(content) | {"start": None if tank is None else Tank.model_validate(tank)}

    def _title(self) -> str:
        name = self.provenance["tank"]
        return f"fixed volume {name}: {self.statistics['samples']:.0f} samples"

    def _residual_lines(self) -> list[str]:
        rms, share = self.statistics["rms.pressure"], self.statistics["rms_share.pressure"]
        return [f"residuals of the pressure: {rms / 1e5:.3g} bar rms, {100 * share:.2g} % of its range"]
