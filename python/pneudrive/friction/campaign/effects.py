"""Effects of air, direction and stick-slip on friction, the zero of the sensor, and the sources of the band.

While the piston drags, it pumps air through ports, lines and regulators: pressure falls in the chamber that grows and
rises in the other one. The force opposes the motion like friction and rises with speed. If pressures are measured in
the chambers, the force of the air is known and subtracted. If they are measured at the regulator, it is unknown.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.estimate.mixed import MixedModel, RandomEffect
from pneudrive.friction.campaign.curves import CurveBand, Fits, by_chance, fit_response, in_newton, systematic
from pneudrive.friction.campaign.points import NAMES, STICK_SLIP
from pneudrive.friction.campaign.result import (
    AirShare,
    Asymmetry,
    SensorZero,
    StickSlipPoint,
    StickSlipThreshold,
    UncertaintySource,
)
from pneudrive.friction.campaign.sensors import GROWING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from pneudrive.estimate.estimates import Estimate
    from pneudrive.friction.campaign.cycles import CycleTable
    from pneudrive.friction.campaign.points import Points
    from pneudrive.friction.campaign.sensors import Gain
    from pneudrive.friction.conditions import Condition
    from pneudrive.signals.force_calibration import ForceCalibration

    Array = NDArray[np.float64]


def air_shares(fits: Fits, bands: Sequence[CurveBand], *, separated: bool) -> tuple[AirShare, ...]:
    """Divide the total drag at each condition; ``separated`` says whether pressures were measured in the chambers."""
    points, asked = fits.points, [band.at for band in bands]
    unknown = [np.full(at.speed_m_s.size, np.nan) for at in asked]
    here = [points.use & (points["curve"] == at.index) for at in asked]
    sensors = [np.full_like(nan, np.mean(points["u_air_n"][own])) for own, nan in zip(here, unknown, strict=True)]
    total, whole = fit_response(fits, points.total_n, points["total_stderr_n"], drift=True), []
    for at in asked:  # the whole drag drifts like friction
        value, low, high = by_chance(fits, total, at)
        whole.append(_with_u(value, low, high, systematic(fits, value, value, at.index).friction_n()))
    del total  # one model after the other: each needs much memory
    part = seal = [(nan, nan, nan) for nan in unknown]
    if separated:
        air = fit_response(fits, points["air_n"], points["air_stderr_n"], drift=False)
        part = [
            _with_u(*in_newton(air, air.at(at.number, at.speed_m_s)), u) for at, u in zip(asked, sensors, strict=True)
        ]
        seal = [_with_u(band.value_n, band.low_n, band.high_n, band.shared.friction_n()) for band in bands]
    least = [np.maximum(high - np.minimum.accumulate(low), 0.0) for _, low, high in whole]
    bounds = unknown if separated else least
    each = zip(asked, whole, part, seal, bounds, strict=True)
    return tuple(AirShare(at.condition, separated, at.speed_m_s, *w, *p, *s, bound) for at, w, p, s, bound in each)


def _with_u(value: Array, low: Array, high: Array, u: Array) -> tuple[Array, Array, Array]:
    """Return a value and its 95 % interval, widened by a standard uncertainty."""
    return value, value - np.hypot(value - low, NORMAL_95 * u), value + np.hypot(high - value, NORMAL_95 * u)


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
    assumed = bool(points["assumed"].any())
    stated = "data" if np.isfinite(gain.stderr) else "assumed" if assumed else "stated"
    chance = ", ".join(("noise within cycles", *fits.friction.sources))
    used, names = points.at(points.use), (*GROWING, *CONSTANT)  # parts of the force sensor that its calibration names
    named = {name: u for name in names if np.isfinite(used[name][0]) and (u := _rms([used[name]])) > 0.0}
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


def _without(total: float, named: dict[str, float], names: tuple[str, ...]) -> float:
    return float(np.sqrt(max(total**2 - sum(named.get(name, 0.0) ** 2 for name in names), 0.0)))


def _rms(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def stick_slip_points(points: Points) -> tuple[StickSlipPoint, ...]:
    """Return the conditions and speeds at which sliding was not steady."""
    found = []
    for index, condition in enumerate(points.conditions):
        for level, speed in enumerate(points.level_speeds_m_s.tolist()):
            here = points.at((points["curve"] == index) & (points["level"] == level))
            share = float(np.isin(here["reason"].tolist(), NAMES).mean()) if len(here) else 0.0
            if not share:
                continue
            slipping = here["stick_slip"] == 1.0
            ripple = np.nan_to_num([here["ripple"], here["piston_ripple"]]).max(axis=0)
            period, step = (
                float(np.median(here[name][slipping])) if slipping.any() else float("nan")
                for name in ("period_s", "step_m")
            )
            swing = float(np.median(here["swing_n"]))
            found.append(
                StickSlipPoint(condition, speed, share, ripple.size, float(np.median(ripple)), period, step, swing)
            )
    return tuple(found)


def thresholds(points: Points) -> tuple[StickSlipThreshold, ...]:
    """Return the speed below which stick-slip starts, as the interval between two measured speeds."""
    found = []
    for index, condition in enumerate(points.conditions):
        with_it, without = [], []
        for level, speed in enumerate(points.level_speeds_m_s.tolist()):
            reasons = points["reason"][(points["curve"] == index) & (points["level"] == level)].tolist()
            # An uneven speed may come from the axis or its encoder, and is therefore not sufficient evidence.
            if sum(reason in STICK_SLIP for reason in reasons) > 0.5 * len(reasons):
                with_it.append(speed)
            elif reasons and sum(reason not in NAMES for reason in reasons) >= 0.5 * len(reasons):
                without.append(speed)
        if with_it or without:
            found.append(_threshold(condition, with_it, without))
    return tuple(found)


def _threshold(condition: Condition, with_it: list[float], without: list[float]) -> StickSlipThreshold:
    if not with_it:
        lowest = min(without)
        return StickSlipThreshold(condition, 0.0, lowest, f"no stick-slip down to {1e3 * lowest:.3g} mm/s")
    top = max(with_it)
    above = [speed for speed in without if speed > top]
    if not above:
        return StickSlipThreshold(condition, top, float("inf"), f"stick-slip up to {1e3 * top:.3g} mm/s, the highest")
    text = f"stick-slip starts between {1e3 * top:.3g} and {1e3 * min(above):.3g} mm/s"
    mixed = [speed for speed in without if speed < top]
    if mixed:
        text += f"; none at the lower speed of {', '.join(f'{1e3 * v:.3g}' for v in sorted(mixed))} mm/s"
    return StickSlipThreshold(condition, top, min(above), text)


HOUR_S = 3600.0
FEWEST_TARES = 3  # least number of tares for a drift


def sensor_zero(tares: CycleTable) -> SensorZero:
    """Return the zero of each zero run and its drift."""
    time, zero, stderr = (tares[name] for name in ("elapsed_s", "standing_n", "standing_stderr_n"))
    drift: Estimate | None = None
    if len(tares) >= FEWEST_TARES and np.ptp(time) > 0:
        x = np.column_stack([np.ones(time.size), (time - time.mean()) / HOUR_S])
        scale = max(float(np.std(zero)), float(stderr.mean()), 1e-9)
        model = MixedModel(zero, x, stderr**2, (RandomEffect("tare", np.ones(time.size), scale),))
        drift = model.fit().contrast(np.array([0.0, 1.0]), "N/h")
    return SensorZero(time, zero, stderr, drift, "tare" if len(tares) else "not measured")


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
