"""The three balances along a recording: what the drive's equations say at measured states, and what is left.

The equations are the core's (``Drive.along``); nothing here repeats one. The residuals have their weak form, in which
no measured signal is differentiated: with a smooth kernel k of compact support, integration by parts moves derivatives
to it,

    e_F = k * (m a) - k * (sum of forces - friction)   with k * a = k'' * x            N
    e_p = k * dp/dt - k * (dp/dt of the energy balance) with k * dp/dt = k' * p        Pa/s

Each is what the model lacks.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe.valve_flow import openings
from pneudrive.errors import SimulationError
from pneudrive.simulate import compiled
from pneudrive.validate.simulation import start_temperatures

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]

Values = tuple["Array", "Array", "Array"]
#: Half of the kernel's support, s, and the least number of samples in it (assumed: longer than the derivative of the
#: velocity takes, shorter than a motion).
HALF_SUPPORT_S, LEAST_SAMPLES = 0.02, 5


@dataclass(frozen=True, eq=False)
class Terms:
    """Terms of the balances at each sample.

    Attributes
    ----------
    force_n : ndarray
        All forces in +x but friction: pressures, weight, load, spring, end stops.
    friction_n : ndarray
        Of steady sliding at the measured velocity, opposing v > 0.
    pressure_rate_a_pa_s, pressure_rate_b_pa_s : ndarray
        Of the energy balance.
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
        """Of both chambers."""
        return self.pressure_rate_a_pa_s, self.pressure_rate_b_pa_s


@dataclass(frozen=True, eq=False)
class Scene:
    """What a cause may change before the balances are evaluated; what follows from it is evaluated once.

    Attributes
    ----------
    drive : Drive
    equations : Any
        Those of the drive without its lines: forces are the same, flows and rates of pressures are not.
    signals : Signals
        The recording.
    position : ndarray, shape (n,)
    pressures : tuple of ndarray, shape (n,)
    opened : ndarray, shape (n, 4)
        Share of the full conductance of each edge of the valve.
    """

    drive: Drive
    equations: Any
    signals: Signals
    position: Array
    pressures: tuple[Array, Array]
    opened: Array

    @classmethod
    def of(cls, drive: Drive, signals: Signals) -> Scene:
        """Take drive and signals as they are."""
        pressures = (signals.pressure_a_pa, signals.pressure_b_pa)
        opened = at_samples(openings(signals.command))
        return cls(drive, _equations(drive), signals, signals.position_m, pressures, opened)

    def with_drive(self, drive: Drive) -> Scene:
        """Return the same with another drive."""
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
        """The kernel and its derivatives."""
        return kernel(half_support(self.signals), self.signals.step_s)

    @cached_property
    def residuals(self) -> Values:
        """Residuals at all samples that a whole kernel surrounds: force N, pressure rates Pa/s."""
        (k0, k1, k2), terms = self.kernel, self.terms
        inertia = moving_mass(self.drive) * np.convolve(self.position, k2, "valid")
        force = inertia - np.convolve(terms.force_n - terms.friction_n, k0, "valid")
        a, b = (
            np.convolve(p, k1, "valid") - np.convolve(rate, k0, "valid")
            for p, rate in zip(self.pressures, terms.pressure_rates, strict=True)
        )
        return force, a, b


def _equations(drive: Drive) -> Any:  # noqa: ANN401 - the core's
    plain = drive.model_copy(update={"tubing": {}, "flow_control": {}}) if drive.has_lines else drive
    return compiled(plain.core_json())


def moving_mass(drive: Drive) -> float:
    """Piston and load, kg."""
    return drive.cylinder.moving_mass_kg + drive.carried.mass_kg


def half_support(signals: Signals) -> int:
    """Count the samples on each side of a kernel's middle."""
    return max(LEAST_SAMPLES, round(HALF_SUPPORT_S / signals.step_s))


def at_samples(held: Array) -> Array:
    """Mean of before and after each sample: sums over samples are then right where the command steps."""
    return 0.5 * (held + np.vstack([held[:1], held[:-1]]))


@lru_cache(maxsize=32)
def kernel(half: int, step_s: float) -> tuple[Array, Array, Array]:
    """Give (1 - s^2)^4 on 2 half + 1 samples with unit sum, and its first and second derivative by time.

    The sums are those of the integrals: a constant has no derivative, a ramp of slope 1 has 1, and so has t^2/2 in the
    second. Samples alone miss that by so much that at 500 Hz a position of 0.3 m looked like a force.
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
