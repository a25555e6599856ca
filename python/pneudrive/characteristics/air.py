"""What the force sensor shows, divided into the force of the air and the friction of the seal.

While the piston drags, it pumps air through ports, lines and regulators: pressure falls in the chamber that grows and
rises in the other one. That force opposes the motion as friction does and rises with speed. Where pressures are
measured in the chambers it is known and taken out; where they are measured at the regulator it is not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characteristics.curves import Fits, by_chance, curve_speeds, fit_response, in_newton, kept_conditions
from pneudrive.characteristics.curves import systematic as systematic_of
from pneudrive.characteristics.effects import AirShare
from pneudrive.estimate.estimates import NORMAL_95

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characteristics.reading import Reading
    from pneudrive.characteristics.smooth import CurveFit

    Array = NDArray[np.float64]


def air_shares(reading: Reading, fits: Fits) -> tuple[AirShare, ...]:
    """Divide the total drag at each condition."""
    points, reduced = fits.points, fits.points.reduced
    separated = reading.identity.pressure_measured_at == "chamber"
    places = [(i, points.conditions.index(condition)) for i, condition in enumerate(kept_conditions(points))]
    asked = [curve_speeds(points, index) for _, index in places]
    every = [speeds for speeds, _, _ in asked]
    unknown = [np.full(speeds.size, np.nan) for speeds in every]

    def drag(fit: CurveFit) -> list[tuple[Array, Array, Array]]:
        return [_drag(fits, fit, i, index, speeds, n) for (i, index), (speeds, _, n) in zip(places, asked, strict=True)]

    # One model after the other, each of which takes much memory.
    whole = drag(fit_response(reading, fits, reduced.total_n, reduced.total_stderr_n, drift=True))
    part = seal = [(nan, nan, nan) for nan in unknown]
    if separated:
        air = fit_response(reading, fits, reduced.air_n, reduced.air_stderr_n, drift=False)
        u_air = [np.full(speeds.size, _pressure_part(fits, i)) for (_, i), speeds in zip(places, every, strict=True)]
        part = [
            _band(*in_newton(air, air.at(i, speeds)), u) for (i, _), speeds, u in zip(places, every, u_air, strict=True)
        ]
        seal = drag(fits.friction)
    least = [np.maximum(high - np.minimum.accumulate(low), 0.0) for _, low, high in whole]
    bounds = unknown if separated else least
    return tuple(
        AirShare(points.conditions[index], separated, every[i], *whole[i], *part[i], *seal[i], bounds[i])
        for i, index in places
    )


def _drag(
    fits: Fits, fit: CurveFit, number: int, index: int, speeds: Array, cycles: NDArray[np.int64]
) -> tuple[Array, Array, Array]:
    value, low, high = by_chance(fits, fit, number, speeds, cycles)
    return _band(value, low, high, systematic_of(fits, value, np.zeros(speeds.size), index).friction_n())


def _pressure_part(fits: Fits, index: int) -> float:
    """Give the standard uncertainty of the chambers' force by the accuracy of their sensors, N."""
    points = fits.points
    members = points.use & (points.condition == index)
    return float(np.mean([d.u_air_n for d, m in zip(points.reduced.data, members, strict=True) if m]))


def _band(value: Array, low: Array, high: Array, u: Array) -> tuple[Array, Array, Array]:
    return value, value - np.hypot(value - low, NORMAL_95 * u), value + np.hypot(high - value, NORMAL_95 * u)
