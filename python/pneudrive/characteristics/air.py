"""What the force sensor shows, divided into the force of the air and the friction of the seal.

While the piston drags, it pumps air through ports, lines and regulators: pressure falls in the chamber that grows and
rises in the other one. That force opposes the motion as friction does and rises with speed. Where pressures are
measured in the chambers it is known and taken out; where they are measured at the regulator it is not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.spread import NORMAL_95
from pneudrive.characteristics.curves import Fits, curve_speeds, fit_response, in_newton, kept_conditions
from pneudrive.characteristics.curves import systematic as systematic_of
from pneudrive.characteristics.effects import AirShare

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characteristics.reading import Reading
    from pneudrive.characteristics.smooth import CurveFit

    Array = NDArray[np.float64]


def air_shares(reading: Reading, fits: Fits) -> tuple[AirShare, ...]:
    """Divide the total drag at each condition."""
    separated = reading.identity.pressure_measured_at == "chamber"
    reduced = fits.points.reduced
    total = fit_response(reading, fits, reduced.total_n, reduced.total_stderr_n, drift=True)
    air = fit_response(reading, fits, reduced.air_n, reduced.air_stderr_n, drift=False)
    found = []
    for number, condition in enumerate(kept_conditions(fits.points)):
        index = fits.points.conditions.index(condition)
        speeds, _, _ = curve_speeds(fits.points, index)
        whole = _band(total, number, speeds, _shared(fits, total, number, speeds, index))
        if separated:
            part = _band(air, number, speeds, np.full(speeds.size, _pressure_part(fits, index)))
            seal = _band(fits.friction, number, speeds, _shared(fits, fits.friction, number, speeds, index))
            bound = np.full(speeds.size, np.nan)
        else:
            nothing = np.full(speeds.size, np.nan)
            part = seal = (nothing, nothing, nothing)
            bound = np.maximum(whole[2] - np.minimum.accumulate(whole[1]), 0.0)
        found.append(AirShare(condition, separated, speeds, *whole, *part, *seal, bound))
    return tuple(found)


def _shared(fits: Fits, fit: CurveFit, number: int, speeds: Array, index: int) -> Array:
    value = in_newton(fit, fit.at(number, speeds))[0]
    return systematic_of(fits, value, np.zeros(speeds.size), index).friction_n()


def _pressure_part(fits: Fits, index: int) -> float:
    """Give the standard uncertainty of the chambers' force by the accuracy of their sensors, N."""
    points = fits.points
    members = points.use & (points.condition == index)
    return float(np.mean([d.u_air_n for d, m in zip(points.reduced.data, members, strict=True) if m]))


def _band(fit: CurveFit, number: int, speeds: Array, u: Array) -> tuple[Array, Array, Array]:
    value, low, high = in_newton(fit, fit.at(number, speeds))
    return value, value - np.hypot(value - low, NORMAL_95 * u), value + np.hypot(high - value, NORMAL_95 * u)
