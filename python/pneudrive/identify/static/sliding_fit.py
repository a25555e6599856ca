"""Common parts of fits of steady sliding: a law, and the values of the friction map to which it was fitted."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.identify.base import Fit
from pneudrive.identify.determined import FittedData

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.static.model import Observations, StaticLaw

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SlidingFit(Fit):
    """Fit of a law of steady sliding to a friction map. A fit from a file has `observations=None`."""

    model: StaticLaw
    observations: Observations | None = field(default=None, repr=False)

    def free_values(self) -> dict[str, float]:
        """Return the values, with all names in `free`."""
        return self.values

    @property
    def coordinates(self) -> Array:
        """Internal coordinates of the model at the estimates, shape (p,)."""
        values = self.free_values()
        return self.model.internal(np.array([values[n] for n in self.free]))

    def with_data(self) -> Observations:
        """Return the fitted values.

        Raises
        ------
        FitError
            The fit was read from a file, without them.
        """
        return self._with_data(self.observations)

    def compared(self) -> dict[str, FittedData]:
        """Return the fitted values and those of the law. Empty if the fit was read from a file."""
        data = self.observations
        if data is None:
            return {}
        model = self.model.value(self.coordinates, data)
        return {"friction": FittedData("speed_m_s", "friction_n", data.speed_m_s, data.friction_n, model)}
