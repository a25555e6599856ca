"""Conditions for measuring, and the check of a running cycle against them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.constants import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from pneudrive.campaign.planning.protocol import Protocol
    from pneudrive.rig.interface import Envelope, Rig, RigState, Samples

#: Samples in a row with a force near its limit after which a cycle is given up: a single one is a disturbance.
IN_A_ROW = 3
#: Messages for a fault and for a rig that does not answer.
FAULT, NO_ANSWER = "fault of the rig", "the rig does not answer"


@dataclass(frozen=True)
class MeasuringBounds:
    """Conditions for measuring.

    Parameters
    ----------
    supply_pressure_pa : float
        Least absolute supply pressure; 0: not watched.
    temperature_k : (float, float)
    force_n : float
        Magnitude at which a cycle is given up, to protect sensor and rig.
    resume_force_n : float
        Magnitude below which the next attempt begins.
    """

    supply_pressure_pa: float
    temperature_k: tuple[float, float]
    force_n: float
    resume_force_n: float

    @classmethod
    def of(cls, protocol: Protocol, envelope: Envelope, ambient_pa: float) -> MeasuringBounds:
        """Return the tighter bounds of protocol and rig."""
        asked = protocol.conditions
        supply = asked.supply_pressure.absolute_pa(ambient_pa) if asked.supply_pressure is not None else 0.0
        low, high = envelope.temperature_k
        if asked.temperature_k is not None:
            low, high = max(low, asked.temperature_k[0]), min(high, asked.temperature_k[1])
        force = asked.force_share * min(envelope.force_n, protocol.limits.force_n or math.inf)
        return cls(max(supply, envelope.supply_pressure_pa), (low, high), force, 0.9 * force)

    def broken_by(self, state: RigState) -> str:
        """Return the condition that is not met, in words; empty if all are met. NaN meets none."""
        if state.fault:
            return f"{FAULT}: {state.fault}"
        if self.supply_pressure_pa > 0.0 and not state.supply_pressure_pa >= self.supply_pressure_pa:
            return (
                f"the supply pressure is {state.supply_pressure_pa / 1e5:.3g} bar absolute, "
                f"less than {self.supply_pressure_pa / 1e5:.3g} bar"
            )
        low, high = self.temperature_k
        if math.isfinite(high - low) and not low <= state.temperature_k <= high:
            return f"the temperature is {_celsius(state.temperature_k)}, not {_celsius(low)} to {_celsius(high)}"
        if not abs(state.force_n) < self.resume_force_n:
            return f"the force is {state.force_n:.4g} N, near the limit of {self.force_n:.4g} N"
        return ""

    def broken_by_samples(self, samples: Samples) -> str:
        """Return the condition that the samples of a running cycle violate; NaN is not checked."""
        with np.errstate(invalid="ignore"):
            force = np.abs(samples.force_n)
            high = force >= self.force_n
            if np.convolve(high, np.ones(IN_A_ROW), "valid").max(initial=0.0) >= IN_A_ROW:
                return f"the force reached {float(force[high].max()):.4g} N, near the limit of {self.force_n:.4g} N"
            temperature = samples.temperature_k
            outside = (temperature < self.temperature_k[0]) | (temperature > self.temperature_k[1])
            if outside.any():
                low, top = (_celsius(limit) for limit in self.temperature_k)
                return f"the temperature reached {_celsius(float(temperature[outside][0]))}, not {low} to {top}"
        return ""

    def during(self, samples: Samples, rig: Rig) -> str:
        """Check a running cycle by its latest samples and by the rig's state."""
        state = rig.state()
        if state.fault:
            return f"{FAULT}: {state.fault}"
        if self.supply_pressure_pa > 0.0 and state.supply_pressure_pa < self.supply_pressure_pa:
            return self.broken_by(state)
        return self.broken_by_samples(samples)


def look(rig: Rig, bounds: MeasuringBounds) -> str:
    """Query the state of the rig, and return the reason why measuring cannot continue, in words."""
    try:
        return bounds.broken_by(rig.state())
    except Exception as error:  # a laboratory's code may raise anything if the connection is lost
        return f"{NO_ANSWER}: {str(error).splitlines()[0] if str(error) else type(error).__name__}"


def _celsius(kelvin: float) -> str:
    return f"{kelvin - ZERO_CELSIUS_K:.4g} degC"
