"""Residuals of the three balances along a recording, with their valid samples and accuracy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.identify.dynamic.assemble import MODEL_SHARE
from pneudrive.signals.motion import noise_level
from pneudrive.validate.balance import Scene, Terms, Values, half_support, moving_mass, openings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]

#: Share of the terms below which errors are irrelevant (assumed).
FLOOR = MODEL_SHARE
#: Travel before steady friction, as a multiple of the bristles' deflection in sliding.
BENT = 4.0
MOST_BENDING_M, LEAST_BENDING_M = 5e-3, 2e-4
#: Largest relative change of speed while bristles adapt (assumed).
LAG = 0.2
#: Distance from an end, plus a number of standard deviations of noise, within which a contact is possible.
STOP_MARGIN_M, MARGIN_NOISE = 1e-4, 5.0
BALANCES = ("force", "pressure a", "pressure b")


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one recording at every `stride`-th sample.

    Attributes
    ----------
    values : tuple of ndarray, shape (n,)
        Force N, pressure rates Pa/s.
    used : tuple of ndarray of bool, shape (n,)
        Valid samples of each balance: the force balance in sliding after presliding, away from end stops; pressure
        rates except at impacts.
    scale : tuple of ndarray, shape (n,)
        Standard deviation from sensor noise, `FLOOR` of the terms, and velocities over a finite time.
    time_s : ndarray, shape (n,)
    terms : Terms
        Terms at all samples.
    """

    values: Values
    used: tuple[NDArray[np.bool_], ...]
    scale: Values
    time_s: Array
    terms: Terms


def residuals(drive: Drive, signals: Signals) -> Residuals:
    """Evaluate the balances along a recording, with their valid samples and accuracy."""
    scene = Scene.of(drive, signals)
    half = half_support(signals)
    inside = slice(half, signals.time_s.size - half)
    off_the_stops = ~near_stops(drive, signals)
    sliding = _whole(_sliding(drive, signals) & off_the_stops, half)
    # At rest the pressures are as informative as in motion; an impact is too short.
    free = _whole(off_the_stops | ~_widened(signals.moving, signals.half), half)
    if drive.lines:  # the flow through tubes and flow controls is not measured
        free = np.zeros_like(free)
    return Residuals(scene.residuals, (sliding, free, free), _scales(scene), signals.time_s[inside], scene.terms)


def near_stops(drive: Drive, signals: Signals) -> NDArray[np.bool_]:
    """Return a mask of samples at which the piston may touch an end stop, widened by the window of derivatives."""
    margin = STOP_MARGIN_M + MARGIN_NOISE * noise_level(signals.position_m)
    x = signals.position_m
    touching = (x < margin) | (x > drive.cylinder.stroke_m - margin)
    return _widened(touching, signals.half)


def _widened(mask: NDArray[np.bool_], by: int) -> NDArray[np.bool_]:
    """Return a mask widened by a number of samples before and after."""
    return np.convolve(mask.astype(float), np.ones(2 * by + 1), "same") > 0.5


def _whole(mask: NDArray[np.bool_], half: int) -> NDArray[np.bool_]:
    """Return a mask where all samples within a kernel are good."""
    good = np.convolve(mask.astype(float), np.ones(2 * half + 1), "valid")
    return good > 2 * half + 0.5


def _sliding(drive: Drive, signals: Signals) -> NDArray[np.bool_]:
    """Return a mask of samples at which the piston has slid beyond the deflection of bristles since a reversal."""
    v, x = signals.velocity_m_s, signals.position_m
    sign = np.where(signals.moving, np.sign(v), 0.0)
    turned = np.r_[True, np.diff(sign) != 0.0]
    since = np.maximum.accumulate(np.where(turned, np.arange(v.size), 0))
    bending = bending_m(drive)
    # The speed must change little over the travel in which bristles adapt: friction lags behind it.
    steady = np.abs(signals.acceleration_m_s2) * (bending / BENT) < LAG * v * v
    return (sign != 0.0) & (np.abs(x - x[since]) > bending) & steady


def bending_m(drive: Drive) -> float:
    """Return the travel after a reversal before friction is that of steady sliding, m."""
    known = drive.friction.parameters
    stiffness, level = known.get("bristle_stiffness"), known.get("breakaway", known.get("coulomb", 0.0))
    if not stiffness:
        return LEAST_BENDING_M
    return float(np.clip(BENT * level / stiffness, LEAST_BENDING_M, MOST_BENDING_M))


def _scales(scene: Scene) -> Values:
    """Estimate the standard deviations of the residuals from noise, at least a fraction of the terms."""
    drive, signals, terms, (k0, k1, k2) = scene.drive, scene.signals, scene.terms, scene.kernel
    cylinder, x, unsure = drive.cylinder, signals.position_m, signals.velocity_unsure_m_s
    noise_p = [noise_level(p) for p in scene.pressures]
    areas = (cylinder.area_a_m2, cylinder.area_b_m2)
    push = float(np.hypot(areas[0] * noise_p[0], areas[1] * noise_p[1]) * np.linalg.norm(k0))
    inertia = moving_mass(drive) * noise_level(x) * float(np.linalg.norm(k2))
    size = float(np.sqrt(np.mean(terms.friction_n**2) + np.mean((terms.force_n - terms.friction_n) ** 2)))
    force = np.full(x.size - k0.size + 1, float(np.sqrt(push**2 + inertia**2 + (FLOOR * size) ** 2)))
    # If pressures are nearly equal, flow changes steeply with them, and noise becomes flow.
    p_a, p_b = scene.pressures
    shaken = replace(
        scene, pressures=(p_a + noise_p[0], p_b + noise_p[1]), opened=openings(drive, signals.command)
    ).terms
    out = []
    for noise, rate, other, p, area, length, dead in zip(
        noise_p, terms.pressure_rates, shaken.pressure_rates, scene.pressures, areas,
        (x, cylinder.stroke_m - x), cylinder.dead_volume_m3, strict=True,
    ):  # fmt: skip
        squeezed = drive.gas.heat_capacity_ratio * p * unsure / np.maximum(length + dead / area, dead / area)
        smeared = np.convolve(squeezed, k0, "valid")
        slope = noise * float(np.linalg.norm(k1))
        steep = np.convolve(np.abs(other - rate), k0, "valid")
        out.append(np.sqrt(slope**2 + steep**2 + FLOOR**2 * np.mean(rate**2) + smeared**2))
    return force, out[0], out[1]
