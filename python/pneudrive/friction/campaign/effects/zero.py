"""Zero of the force sensor from zero runs, and the difference between the directions without it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.estimate.mixed import MixedModel, RandomEffect
from pneudrive.friction.campaign.effects.effect import Asymmetry, SensorZero

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.estimate.estimates import Estimate
    from pneudrive.friction.campaign.curves.curves import CurveBand, Fits
    from pneudrive.friction.cycle import CycleData

HOUR_S = 3600.0
FEWEST_TARES = 3  # least number of tares for a drift


def sensor_zero(tares: Sequence[CycleData]) -> SensorZero:
    """Return the zero of each zero run and its drift."""
    if not tares:
        return SensorZero(np.zeros(0), np.zeros(0), np.zeros(0), None, "not measured")
    time = np.array([t.plan.elapsed_s for t in tares])
    zero = np.array([t.standing_n for t in tares])
    stderr = np.array([t.standing_stderr_n for t in tares])
    drift: Estimate | None = None
    if len(tares) >= FEWEST_TARES and np.ptp(time) > 0:
        x = np.column_stack([np.ones(time.size), (time - time.mean()) / HOUR_S])
        scale = max(float(np.std(zero)), float(stderr.mean()), 1e-9)
        model = MixedModel(zero, x, stderr**2, (RandomEffect("tare", np.ones(time.size), scale),))
        drift = model.fit().contrast(np.array([0.0, 1.0]), "N/h")
    return SensorZero(time, zero, stderr, drift, "tare")


def asymmetries(fits: Fits, bands: Sequence[CurveBand]) -> tuple[Asymmetry, ...]:
    """Return half the difference of friction between the directions at each condition."""
    found = []
    for band in bands:
        at, measured = band.at, band.at.measured
        speeds, value = at.speed_m_s[measured], band.offset.mean[measured]
        # Without zero runs it includes the zero, and no statement on symmetry is possible.
        u = band.shared.zero_n[measured]
        half = np.hypot(band.offset.half_width()[measured], NORMAL_95 * u)
        mean = fits.offset.over(at.number, speeds).mean().estimates()[0].widened(float(np.mean(u)))
        found.append(
            Asymmetry(
                condition=at.condition,
                speed_m_s=speeds,
                half_difference_n=value,
                low_n=value - half,
                high_n=value + half,
                mean=mean if fits.has_zero else replace(mean, p=float("nan")),
                basis="tare" if fits.has_zero else "not separable",
            )
        )
    return tuple(found)
