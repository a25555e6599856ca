"""Residuals of the three balances along a recording, in their weak form: no measured signal is differentiated.

With a smooth kernel k of compact support, integration by parts moves derivatives from signals to the kernel:

    e_F = k * (m a) - k * (sum of forces - friction)   with k * a = k'' * x            N
    e_p = k * dp/dt - k * (dp/dt of the energy balance) with k * dp/dt = k' * p        Pa/s

Each is what the model lacks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.motion import noise_level
from pneudrive.validate.balance import Terms, evaluate, openings
from pneudrive.validate.breakaway import moving_mass

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe import Drive
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]

#: Half of the kernel's support, s, and the least number of samples in it (assumed: longer than the derivative of the
#: velocity takes, shorter than a motion).
HALF_SUPPORT_S, LEAST_SAMPLES = 0.02, 5
#: Errors below this share of the terms themselves are not worth a name (assumed).
FLOOR = 0.01
#: Steady friction is there once bristles have bent for this many times their deflection in sliding.
BENT = 4.0
MOST_BENDING_M, LEAST_BENDING_M = 5e-3, 2e-4
#: Largest relative change of speed while bristles adapt (assumed).
LAG = 0.2
BALANCES = ("force", "pressure a", "pressure b")


@dataclass(frozen=True, eq=False)
class Scene:
    """What a candidate may change before the balances are evaluated."""

    drive: Drive
    position: Array
    pressures: tuple[Array, Array]
    opened: Array

    @classmethod
    def of(cls, drive: Drive, signals: Signals) -> Scene:
        """Take drive and signals as they are."""
        pressures = (signals.pressure_a_pa, signals.pressure_b_pa)
        return cls(drive, signals.position_m, pressures, at_samples(openings(signals.command)))


def at_samples(held: Array) -> Array:
    """Mean of before and after each sample: sums over samples are then right where the command steps."""
    return 0.5 * (held + np.vstack([held[:1], held[:-1]]))


@lru_cache(maxsize=32)
def kernel(half: int, step_s: float) -> tuple[Array, Array, Array]:
    """Give (1 - s^2)^4 on 2 half + 1 samples with unit sum, and its first and second derivative by time."""
    s = np.arange(-half, half + 1) / (half + 1)
    width = (half + 1) * step_s
    inside = 1.0 - s * s
    value, first = inside**4, -8.0 * s * inside**3
    second = -8.0 * inside**3 + 48.0 * s * s * inside**2
    total = value.sum()
    return value / total, first / (total * width), second / (total * width**2)


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one recording at every `stride`-th sample.

    Attributes
    ----------
    values : tuple of ndarray, shape (n,)
        Force N, pressure rates Pa/s.
    used : tuple of ndarray of bool, shape (n,)
        Where each balance holds: the force balance in sliding that is past presliding, off the end stops.
    scale : tuple of float
        Standard deviation that sensor noise and `FLOOR` of the terms leave to each.
    time_s : ndarray, shape (n,)
    terms : Terms
        At all samples.
    """

    values: tuple[Array, Array, Array]
    used: tuple[NDArray[np.bool_], ...]
    scale: tuple[float, float, float]
    time_s: Array
    terms: Terms


def half_support(signals: Signals) -> int:
    """Count the samples on each side of a kernel's middle."""
    return max(LEAST_SAMPLES, round(HALF_SUPPORT_S / signals.step_s))


def raw_residuals(scene: Scene, signals: Signals) -> tuple[tuple[Array, Array, Array], Terms]:
    """Residuals at all samples that a whole kernel surrounds."""
    half = half_support(signals)
    k0, k1, k2 = kernel(half, signals.step_s)
    terms = evaluate(scene.drive, signals, position=scene.position, pressures=scene.pressures, opened=scene.opened)
    inertia = moving_mass(scene.drive) * np.convolve(scene.position, k2, "valid")
    force = inertia - np.convolve(terms.force_n - terms.friction_n, k0, "valid")
    rates = [
        np.convolve(p, k1, "valid") - np.convolve(rate, k0, "valid")
        for p, rate in zip(scene.pressures, (terms.pressure_rate_a_pa_s, terms.pressure_rate_b_pa_s), strict=True)
    ]
    return (force, rates[0], rates[1]), terms


def residuals(drive: Drive, signals: Signals) -> Residuals:
    """Evaluate the balances along a recording, with where they hold and how exact they can be."""
    values, terms = raw_residuals(Scene.of(drive, signals), signals)
    half = half_support(signals)
    inside = slice(half, signals.time_s.size - half)
    sliding = _whole(_sliding(drive, signals) & (terms.end_stop_n == 0.0), half)
    free = _whole(terms.end_stop_n == 0.0, half)
    return Residuals(values, (sliding, free, free), _scales(drive, signals, terms), signals.time_s[inside], terms)


def _whole(mask: NDArray[np.bool_], half: int) -> NDArray[np.bool_]:
    """Where all samples within a kernel are good."""
    good = np.convolve(mask.astype(float), np.ones(2 * half + 1), "valid")
    return good > 2 * half + 0.5


def _sliding(drive: Drive, signals: Signals) -> NDArray[np.bool_]:
    """Where the piston has slid, since it last turned, for longer than bristles take to bend."""
    v, x = signals.velocity_m_s, signals.position_m
    sign = np.where(signals.moving, np.sign(v), 0.0)
    turned = np.r_[True, np.diff(sign) != 0.0]
    since = np.maximum.accumulate(np.where(turned, np.arange(v.size), 0))
    bending = bending_m(drive)
    # Over the travel in which bristles adapt, the speed must not change by much, or friction lags behind it.
    steady = np.abs(signals.acceleration_m_s2) * (bending / BENT) < LAG * v * v
    return (sign != 0.0) & (np.abs(x - x[since]) > bending) & steady


def bending_m(drive: Drive) -> float:
    """Travel after a turn within which friction is not yet that of steady sliding, m."""
    known = drive.friction.parameters
    stiffness, level = known.get("bristle_stiffness"), known.get("breakaway", known.get("coulomb", 0.0))
    if not stiffness:
        return LEAST_BENDING_M
    return float(np.clip(BENT * level / stiffness, LEAST_BENDING_M, MOST_BENDING_M))


def _scales(drive: Drive, signals: Signals, terms: Terms) -> tuple[float, float, float]:
    """Estimate the standard deviations that noise leaves to the residuals, with the floor."""
    k0, k1, k2 = kernel(half_support(signals), signals.step_s)
    noise_x = noise_level(signals.position_m)
    noise_p = [noise_level(p) for p in (signals.pressure_a_pa, signals.pressure_b_pa)]
    areas = (drive.cylinder.area_a_m2, drive.cylinder.area_b_m2)
    push = float(np.hypot(areas[0] * noise_p[0], areas[1] * noise_p[1]) * np.linalg.norm(k0))
    inertia = moving_mass(drive) * noise_x * float(np.linalg.norm(k2))
    size = float(np.sqrt(np.mean(terms.friction_n**2) + np.mean((terms.force_n - terms.friction_n) ** 2)))
    rates = (terms.pressure_rate_a_pa_s, terms.pressure_rate_b_pa_s)
    out = [float(np.sqrt(push**2 + inertia**2 + (FLOOR * size) ** 2))]
    for noise, rate in zip(noise_p, rates, strict=True):
        slope = noise * float(np.linalg.norm(k1))
        out.append(float(np.hypot(slope, FLOOR * np.sqrt(np.mean(rate**2)))))
    return out[0], out[1], out[2]
