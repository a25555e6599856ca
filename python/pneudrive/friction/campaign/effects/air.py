"""The reading of the force sensor, divided into the force of the air and the friction of the seal.

While the piston drags, it pumps air through ports, lines and regulators: pressure falls in the chamber that grows and
rises in the other one. The force opposes the motion like friction and rises with speed. If pressures are measured in
the chambers, it is known and subtracted; if they are measured at the regulator, it is unknown.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.friction.campaign.curves.curves import Fits, by_chance, fit_response, in_newton, systematic
from pneudrive.friction.campaign.curves.points import CurveSpeeds, curve_speeds
from pneudrive.friction.campaign.effects.effect import AirShare

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.friction.campaign.curves.smooth import CurveFit

    Array = NDArray[np.float64]


def air_shares(fits: Fits, *, separated: bool) -> tuple[AirShare, ...]:
    """Divide the total drag at each condition. ``separated`` is true if pressures were measured in the chambers."""
    reduced, asked = fits.points.reduced, curve_speeds(fits.points)
    unknown = [np.full(at.speed_m_s.size, np.nan) for at in asked]

    def drag(fit: CurveFit) -> list[tuple[Array, Array, Array]]:
        return [_drag(fits, fit, at) for at in asked]

    # One model after the other: each needs much memory.
    whole = drag(fit_response(fits, reduced.total_n, reduced.total_stderr_n, drift=True))
    part = seal = [(nan, nan, nan) for nan in unknown]
    if separated:
        air = fit_response(fits, reduced.air_n, reduced.air_stderr_n, drift=False)
        part = [
            _band(*in_newton(air, air.at(at.number, at.speed_m_s)), np.full_like(nan, _pressure_part(fits, at.index)))
            for at, nan in zip(asked, unknown, strict=True)
        ]
        seal = drag(fits.friction)
    least = [np.maximum(high - np.minimum.accumulate(low), 0.0) for _, low, high in whole]
    bounds = unknown if separated else least
    each = zip(asked, whole, part, seal, bounds, strict=True)
    return tuple(AirShare(at.condition, separated, at.speed_m_s, *w, *p, *s, bound) for at, w, p, s, bound in each)


def _drag(fits: Fits, fit: CurveFit, at: CurveSpeeds) -> tuple[Array, Array, Array]:
    value, low, high = by_chance(fits, fit, at)
    return _band(value, low, high, systematic(fits, value, np.zeros(value.size), at.index).friction_n())


def _pressure_part(fits: Fits, index: int) -> float:
    """Return the standard uncertainty of the chambers' force by the accuracy of their sensors, N."""
    points = fits.points
    return float(np.mean([d.u_air_n for d in points.cycles(points.use & (points.condition == index))]))


def _band(value: Array, low: Array, high: Array, u: Array) -> tuple[Array, Array, Array]:
    return value, value - np.hypot(value - low, NORMAL_95 * u), value + np.hypot(high - value, NORMAL_95 * u)
