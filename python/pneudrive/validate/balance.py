"""Balances of force and of both pressures along a recording: the drive's equations at measured states, and residuals.

The core evaluates the equations (``Drive.along``). The residuals are in weak form, so that no measured signal is
differentiated. With a smooth kernel k of compact support, integration by parts moves derivatives to the kernel:

    e_F = k * (m a) - k * (sum of forces - friction)   with k * a = k'' * x            N
    e_p = k * dp/dt - k * (dp/dt of the energy balance) with k * dp/dt = k' * p        Pa/s

Each residual is the part of the measurement that the model does not explain.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import _core
from pneudrive.errors import SimulationError
from pneudrive.validate.simulation import start_temperatures

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]

Values = tuple["Array", "Array", "Array"]
#: Half of the kernel's support, s, and its least number of samples (assumed: longer than the window of the velocity's
#: derivative, shorter than a motion).
HALF_SUPPORT_S, LEAST_SAMPLES = 0.02, 5
#: Command over which the leakage of a valve falls to 1/e, as in the core (assumed).
LEAKAGE_WIDTH = 0.05


@dataclass(frozen=True, eq=False)
class Terms:
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

    @property
    def pressure_rates(self) -> tuple[Array, Array]:
        """Pressure rates of both chambers, Pa/s."""
        return self.pressure_rate_a_pa_s, self.pressure_rate_b_pa_s


@dataclass(frozen=True, eq=False)
class Scene:
    """Input of the balances, which a cause may change; derived quantities are evaluated once.

    Attributes
    ----------
    drive : Drive
    equations : Any
        Equations of the drive without its lines: forces are the same, flows and pressure rates differ.
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
    equations: Any
    signals: Signals
    position: Array
    pressures: tuple[Array, Array]
    opened: Array
    explained: Values | None = None

    @classmethod
    def of(cls, drive: Drive, signals: Signals) -> Scene:
        """Return the scene of an unchanged drive and its signals."""
        pressures = (signals.pressure_a_pa, signals.pressure_b_pa)
        opened = at_samples(openings(drive, signals.command))
        return cls(drive, _equations(drive), signals, signals.position_m, pressures, opened)

    def with_drive(self, drive: Drive) -> Scene:
        """Return the scene with another drive."""
        return replace(self, drive=drive, equations=_equations(drive))

    @cached_property
    def terms(self) -> Terms:
        """Terms of the balances at each sample."""
        signals = self.signals
        along = (signals.time_s, self.position, signals.velocity_m_s, *self.pressures, self.opened)
        try:
            out = self.equations.along(*map(np.ascontiguousarray, along), start_temperatures(self.drive, signals))
        except RuntimeError as error:
            raise SimulationError(str(error)) from None
        return Terms(*(out[field.name] for field in fields(Terms)))

    @cached_property
    def kernel(self) -> tuple[Array, Array, Array]:
        """Kernel and its derivatives."""
        return kernel(half_support(self.signals), self.signals.step_s)

    @cached_property
    def residuals(self) -> Values:
        """Residuals at all samples with a whole kernel around them: force N, pressure rates Pa/s."""
        (k0, k1, k2), terms = self.kernel, self.terms
        inertia = moving_mass(self.drive) * np.convolve(self.position, k2, "valid")
        force = inertia - np.convolve(terms.force_n - terms.friction_n, k0, "valid")
        a, b = (
            np.convolve(p, k1, "valid") - np.convolve(rate, k0, "valid")
            for p, rate in zip(self.pressures, terms.pressure_rates, strict=True)
        )
        if self.explained is None:
            return force, a, b
        x, y, z = self.explained
        return force - x, a - y, b - z


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


def _equations(drive: Drive) -> Any:  # noqa: ANN401 - the core's
    return drive.plain.system.compiled()


def moving_mass(drive: Drive) -> float:
    """Mass of piston and load, kg."""
    return drive.cylinder.moving_mass_kg + drive.carried.mass_kg


def half_support(signals: Signals) -> int:
    """Return the number of samples on each side of a kernel's middle."""
    return max(LEAST_SAMPLES, round(HALF_SUPPORT_S / signals.step_s))


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
