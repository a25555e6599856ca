"""Sources of the width of the band: one entry per source, over all points of all curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.friction.campaign.result import UncertaintySource
from pneudrive.friction.campaign.sensors import GROWING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.campaign.curves.curves import CurveBand, Fits
    from pneudrive.friction.campaign.sensors import Gain
    from pneudrive.signals.force_calibration import ForceCalibration

    Array = NDArray[np.float64]

CONSTANT = ("force: linearity", "force: hysteresis")  # sources of the force sensor that are equal at all forces


def sources(
    fits: Fits, bands: Sequence[CurveBand], gain: Gain, known: ForceCalibration | None
) -> tuple[UncertaintySource, ...]:
    """List the sources: root mean square over the measured points of all curves, N."""
    points = fits.points

    def over(part: Callable[[CurveBand], Array]) -> list[Array]:
        return [part(band)[band.at.measured] for band in bands]

    scatter = over(lambda band: (band.high_n - band.low_n) / (2.0 * NORMAL_95))
    gains, turns = over(lambda band: band.shared.gain_n), over(lambda band: band.shared.hysteresis_n)
    zeros = over(
        lambda band: np.hypot(
            np.hypot(band.shared.zero_n, band.shared.half_sum_n), band.offset.half_width() / NORMAL_95
        )
    )
    places = over(lambda band: band.shared.position_n)
    assumed = any(d.assumed for d in points.reduced.data)
    stated = "data" if np.isfinite(gain.stderr) else "assumed" if assumed else "stated"
    chance = ", ".join(("noise within cycles", *fits.friction.sources))
    named = _named(fits)
    grow, turn = (_without(_rms(parts), named, names) for parts, names in ((gains, GROWING), (turns, CONSTANT)))
    words = "" if known is None else f"{known.words()}: equal in all cycles"
    other, turning = ("force sensor", "sensors") if known is None else ("other sensors", "other sensors")
    return (
        UncertaintySource("scatter of the cycles", _rms(scatter), "A", "data", f"{chance}; from the mixed model"),
        *(
            UncertaintySource(f"force sensor, {name.removeprefix('force: ')}", u, "B", "stated", words)
            for name, u in named.items()
        ),
        UncertaintySource(f"gain of the {other}", grow, "A" if stated == "data" else "B", stated),
        UncertaintySource(f"hysteresis of the {turning}", turn, "B", "assumed", "a third of the accuracy"),
        UncertaintySource(
            "mean over position", _rms(places), "B", "assumed", "pattern over the part of the stroke not covered"
        ),
        UncertaintySource("zero and asymmetry", _rms(zeros), "A", "data", "curves of one direction only"),
    )


def _named(fits: Fits) -> dict[str, float]:
    """Return the parts of the force sensor that its calibration names, root mean square over the cycles, N."""
    data = fits.points.cycles(fits.points.use)
    names = (name for name in (*GROWING, *CONSTANT) if name in data[0].u_force_n)
    found = {name: _rms([np.array([d.u_force_n[name] for d in data])]) for name in names}
    return {name: u for name, u in found.items() if u > 0.0}


def _without(total: float, named: dict[str, float], names: tuple[str, ...]) -> float:
    return float(np.sqrt(max(total**2 - sum(named.get(name, 0.0) ** 2 for name in names), 0.0)))


def _rms(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
