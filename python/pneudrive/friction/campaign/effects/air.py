"""The reading of the force sensor, divided into the force of the air and the friction of the seal.

While the piston drags, it pumps air through ports, lines and regulators: pressure falls in the chamber that grows and
rises in the other one. The force opposes the motion like friction and rises with speed. If pressures are measured in
the chambers, the force of the air is known and subtracted. If they are measured at the regulator, it is unknown.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.friction.campaign.curves.curves import CurveBand, Fits, drag, fit_response, in_newton
from pneudrive.friction.campaign.effects.effect import AirShare

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def air_shares(fits: Fits, bands: Sequence[CurveBand], *, separated: bool) -> tuple[AirShare, ...]:
    """Divide the total drag at each condition; ``separated`` says whether pressures were measured in the chambers."""
    reduced, asked = fits.points.reduced, [band.at for band in bands]
    unknown = [np.full(at.speed_m_s.size, np.nan) for at in asked]
    sensors = [np.full_like(nan, _pressure_part(fits, at.index)) for at, nan in zip(asked, unknown, strict=True)]
    # One model after the other: each needs much memory.
    whole = [_with_u(*one) for one in drag(fits, bands, reduced.total_n, reduced.total_stderr_n)]
    part = seal = [(nan, nan, nan) for nan in unknown]
    if separated:
        air = fit_response(fits, reduced.air_n, reduced.air_stderr_n, drift=False)
        part = [
            _with_u(*in_newton(air, air.at(at.number, at.speed_m_s)), u) for at, u in zip(asked, sensors, strict=True)
        ]
        seal = [_with_u(band.value_n, band.low_n, band.high_n, band.shared.friction_n()) for band in bands]
    least = [np.maximum(high - np.minimum.accumulate(low), 0.0) for _, low, high in whole]
    bounds = unknown if separated else least
    each = zip(asked, whole, part, seal, bounds, strict=True)
    return tuple(AirShare(at.condition, separated, at.speed_m_s, *w, *p, *s, bound) for at, w, p, s, bound in each)


def _pressure_part(fits: Fits, index: int) -> float:
    """Return the standard uncertainty of the chambers' force by the accuracy of their sensors, N."""
    points = fits.points
    return float(np.mean([d.u_air_n for d in points.cycles(points.use & (points.condition == index))]))


def _with_u(value: Array, low: Array, high: Array, u: Array) -> tuple[Array, Array, Array]:
    """Return a value and its 95 % interval, widened by a standard uncertainty."""
    return value, value - np.hypot(value - low, NORMAL_95 * u), value + np.hypot(high - value, NORMAL_95 * u)
