"""Balances of force and of both pressures along a recording: the drive's equations at measured states, and residuals.

The core evaluates the equations (``Drive.along``). The residuals are in weak form, so that no measured signal is
differentiated. With a smooth kernel k of compact support, integration by parts moves derivatives to the kernel:

    e_F = k * (m a) - k * (sum of forces - friction)   with k * a = k'' * x            N
    e_p = k * dp/dt - k * (dp/dt of the energy balance) with k * dp/dt = k' * p        Pa/s

Each residual is the part of the measurement that the model does not explain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive import _core
from pneudrive.errors import SimulationError
from pneudrive.identify.dynamic.result import MODEL_SHARE
from pneudrive.signals.motion import noise_level

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]

Values = tuple["Array", "Array", "Array"]
BALANCES = ("force", "pressure a", "pressure b")
#: Half of the kernel's support, s, and its least number of samples (assumed: longer than the window of the velocity's
#: derivative, shorter than a motion).
HALF_SUPPORT_S, LEAST_SAMPLES = 0.02, 5
#: Command over which the leakage of a valve falls to 1/e, as in the core (assumed).
LEAKAGE_WIDTH = 0.05
#: Share of the terms below which errors are irrelevant (assumed).
FLOOR = MODEL_SHARE
#: Travel before steady friction, as a multiple of the bristles' deflection in sliding.
BENT = 4.0
MOST_BENDING_M, LEAST_BENDING_M = 5e-3, 2e-4
#: Largest relative change of speed while bristles adapt (assumed).
LAG = 0.2
#: Distance from an end, plus a number of standard deviations of noise, within which a contact is possible.
STOP_MARGIN_M, MARGIN_NOISE = 1e-4, 5.0


class Terms(NamedTuple):
    """Terms of the balances at each sample.

    Attributes
    ----------
    force_n : ndarray
        All forces in +x except friction: pressures, weight, load, spring, end stops.
    friction_n : ndarray
        Friction of steady sliding at the measured velocity, opposing v > 0.
    pressure_rate_a_pa_s, pressure_rate_b_pa_s : ndarray
        Pressure rates of the energy balance.
    mass_flow_a_kg_s, mass_flow_b_kg_s : ndarray
    """

    force_n: Array
    friction_n: Array
    pressure_rate_a_pa_s: Array
    pressure_rate_b_pa_s: Array
    mass_flow_a_kg_s: Array
    mass_flow_b_kg_s: Array


@dataclass(frozen=True, eq=False)
class Scene:
    """Input of the balances, which a cause may change, and their residuals. Derived quantities are evaluated once.

    Attributes
    ----------
    drive : Drive
    signals : Signals
        Signals of the recording.
    position : ndarray, shape (n,)
    pressures : tuple of ndarray, shape (n,)
    opened : ndarray, shape (n, 4)
        Open fraction of the full conductance of each edge of the valve.
    explained : tuple of ndarray or None
        Part of the residuals that a cause without a description explains.
    """

    drive: Drive
    signals: Signals
    position: Array
    pressures: tuple[Array, Array]
    opened: Array
    explained: Values | None = None

    @classmethod
    def of(cls, drive: Drive, signals: Signals) -> Scene:
        """Return the scene of an unchanged drive and its signals."""
        pressures = (signals.pressure_a_pa, signals.pressure_b_pa)
        return cls(drive, signals, signals.position_m, pressures, at_samples(openings(drive, signals.command)))

    def less(self, values: Values) -> Scene:
        """Return the scene with a further part of the residuals explained."""
        if self.explained is None:
            return replace(self, explained=values)
        (a, b, c), (x, y, z) = self.explained, values
        return replace(self, explained=(a + x, b + y, c + z))

    @cached_property
    def terms(self) -> Terms:
        """Terms of the balances at each sample: forces of the drive, flows and pressure rates without its lines."""
        signals, equations = self.signals, self.drive.plain.system.compiled()
        along = (signals.time_s, self.position, signals.velocity_m_s, *self.pressures, self.opened)
        temperatures = signals.start_temperatures(self.drive)
        try:
            out = equations.along(*map(np.ascontiguousarray, along), temperatures)  # pyright: ignore[reportCallIssue]
        except RuntimeError as error:
            raise SimulationError(str(error)) from None
        return Terms(*(out[name] for name in Terms._fields))

    @property
    def half(self) -> int:
        """Number of samples on each side of a kernel's middle."""
        return max(LEAST_SAMPLES, round(HALF_SUPPORT_S / self.signals.step_s))

    @property
    def kernel(self) -> tuple[Array, Array, Array]:
        """Kernel and its derivatives."""
        return kernel(self.half, self.signals.step_s)

    @property
    def time_s(self) -> Array:
        """Times of the residuals: those of the samples with a whole kernel around them."""
        return self.signals.time_s[self.half : self.signals.time_s.size - self.half]

    @cached_property
    def residuals(self) -> Values:
        """Residuals at `time_s`: force N, pressure rates Pa/s."""
        (k0, k1, k2), terms = self.kernel, self.terms
        inertia = moving_mass(self.drive) * np.convolve(self.position, k2, "valid")
        force = inertia - np.convolve(terms.force_n - terms.friction_n, k0, "valid")
        a, b = (
            np.convolve(p, k1, "valid") - np.convolve(rate, k0, "valid")
            for p, rate in zip(self.pressures, terms[2:4], strict=True)
        )
        if self.explained is None:
            return force, a, b
        x, y, z = self.explained
        return force - x, a - y, b - z

    @cached_property
    def used(self) -> tuple[NDArray[np.bool_], ...]:
        """Valid samples of each balance at `time_s`.

        The force balance is valid in sliding after presliding, away from end stops, and pressure rates except at
        impacts.
        """
        off_the_stops = ~near_stops(self.drive, self.signals)
        # At rest the pressures are as informative as in motion; an impact is too short.
        free = off_the_stops | ~_widened(self.signals.moving, self.signals.half)
        if self.drive.lines:  # the flow through tubes and flow controls is not measured
            free = np.zeros_like(free)
        width = 2 * self.half + 1
        masks = (_sliding(self.drive, self.signals) & off_the_stops, free, free)
        return tuple(np.convolve(mask.astype(float), np.ones(width), "valid") > width - 0.5 for mask in masks)

    @cached_property
    def scale(self) -> Values:
        """Standard deviations of the residuals, at least `FLOOR` of the terms.

        They contain the noise of the sensors and the finite time of velocities.
        """
        drive, signals, terms, (k0, k1, k2) = self.drive, self.signals, self.terms, self.kernel
        cylinder, x, unsure = drive.cylinder, signals.position_m, signals.velocity_unsure_m_s
        noise_p = [noise_level(p) for p in self.pressures]
        areas = (cylinder.area_a_m2, cylinder.area_b_m2)
        push = float(np.hypot(areas[0] * noise_p[0], areas[1] * noise_p[1]) * np.linalg.norm(k0))
        inertia = moving_mass(drive) * noise_level(x) * float(np.linalg.norm(k2))
        size = float(np.sqrt(np.mean(terms.friction_n**2) + np.mean((terms.force_n - terms.friction_n) ** 2)))
        force = np.full(x.size - k0.size + 1, float(np.sqrt(push**2 + inertia**2 + (FLOOR * size) ** 2)))
        # If pressures are nearly equal, flow changes steeply with them, and noise becomes flow.
        p_a, p_b = self.pressures
        noisy = (p_a + noise_p[0], p_b + noise_p[1])
        shaken = replace(self, pressures=noisy, opened=openings(drive, signals.command)).terms
        out = []
        for noise, rate, other, p, area, length, dead in zip(
            noise_p, terms[2:4], shaken[2:4], self.pressures, areas,
            (x, cylinder.stroke_m - x), cylinder.dead_volume_m3, strict=True,
        ):  # fmt: skip
            squeezed = drive.gas.heat_capacity_ratio * p * unsure / np.maximum(length + dead / area, dead / area)
            smeared = np.convolve(squeezed, k0, "valid")
            slope = noise * float(np.linalg.norm(k1))
            steep = np.convolve(np.abs(other - rate), k0, "valid")
            out.append(np.sqrt(slope**2 + steep**2 + FLOOR**2 * np.mean(rate**2) + smeared**2))
        return force, out[0], out[1]


def openings(drive: Drive, command: Array) -> Array:
    """Return the open fraction of the conductance of each edge of the valve for a command, shape (n, 4).

    An edge opens by clip((u - overlap) / (1 - overlap), 0, 1) + leakage exp(-|u| / leakage_width).
    """
    if not drive.valve.has_shape:
        return _core.valve_openings(command)
    overlap, leakage = drive.valve.overlap or 0.0, drive.valve.leakage or 0.0
    towards = command[:, None] * np.array([1.0, -1.0, -1.0, 1.0])
    leaks = leakage * np.exp(-np.abs(command) / LEAKAGE_WIDTH)
    return np.clip((towards - overlap) / (1.0 - overlap), 0.0, 1.0) + leaks[:, None]


def moving_mass(drive: Drive) -> float:
    """Mass of piston and load, kg."""
    return drive.cylinder.moving_mass_kg + drive.carried.mass_kg


def at_samples(held: Array) -> Array:
    """Return the mean before and after each sample, so that sums over samples are right at steps of the command."""
    return 0.5 * (held + np.vstack([held[:1], held[:-1]]))


@lru_cache(maxsize=32)
def kernel(half: int, step_s: float) -> tuple[Array, Array, Array]:
    """Return (1 - s^2)^4 on 2 half + 1 samples with unit sum, and its first and second derivative by time.

    Sums are corrected to equal the integrals: the first derivative of a constant is 0 and of a ramp 1, the second
    derivative of t^2/2 is 1. Without this correction, a position of 0.3 m at 500 Hz would act like a force.
    """
    s = np.arange(-half, half + 1) / (half + 1)
    width = (half + 1) * step_s
    inside = 1.0 - s * s
    value, first = inside**4, -8.0 * s * inside**3
    second = -8.0 * inside**3 + 48.0 * s * s * inside**2
    value = value / value.sum()
    first = first / (-width * (s @ first))
    second = second - value * second.sum()
    return value, first, second / (0.5 * width**2 * (s * s @ second))


def near_stops(drive: Drive, signals: Signals) -> NDArray[np.bool_]:
    """Return a mask of samples at which the piston may touch an end stop, widened by the window of derivatives."""
    margin = STOP_MARGIN_M + MARGIN_NOISE * noise_level(signals.position_m)
    x = signals.position_m
    return _widened((x < margin) | (x > drive.cylinder.stroke_m - margin), signals.half)


def _widened(mask: NDArray[np.bool_], by: int) -> NDArray[np.bool_]:
    """Return a mask widened by a number of samples before and after."""
    return np.convolve(mask.astype(float), np.ones(2 * by + 1), "same") > 0.5


def _sliding(drive: Drive, signals: Signals) -> NDArray[np.bool_]:
    """Return a mask of samples at which the piston has slid beyond the deflection of bristles since a reversal."""
    v, x, bending = signals.velocity_m_s, signals.position_m, bending_m(drive)
    sign = signals.direction
    turned = np.r_[True, np.diff(sign) != 0.0]
    since = np.maximum.accumulate(np.where(turned, np.arange(v.size), 0))
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
