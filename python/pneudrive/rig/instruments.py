"""Sensors of a simulated rig, each with a calibration error within its stated accuracy."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.rig.conditions import stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.rig.conditions import Past
    from pneudrive.rig.description import RigDescription
    from pneudrive.rig.sensors import AnalogSensor

    Array = NDArray[np.float64]

#: Share of a force sensor's accuracy that changes sign with the force, as in the uncertainty budget.
HYSTERESIS_SHARE = 1.0 / 3.0

#: Calibration texts of a simulated rig; force_calibration and bandwidth_hz are missing, as nothing was calibrated.
ERROR_MODEL = "assumed: drawn by the simulated rig within its accuracy (zero, gain); white noise, converter, no lag"
FORCE_ERROR_MODEL = (
    "assumed: drawn by the simulated rig within its accuracy (gain, and a third of it that turns with the force); zero "
    "and its drift as the rig file says; white noise, steps of the converter, no lag, no creep"
)


class Instruments:
    """Sensors with calibration errors drawn once from the rig's seed.

    The stated accuracy is a standard uncertainty. It is the standard deviation of the gain's error at the end of the
    range, and of the zeros of pressure sensors and thermometer. The zero of the force sensor, which is tared, comes
    from the rig file. A third of the accuracy, shared by both directions, changes sign with the force.

    Parameters
    ----------
    d : RigDescription
    seed : int
    """

    def __init__(self, d: RigDescription, seed: int) -> None:
        self.d = d
        draw = stream(seed, "calibration").standard_normal(7)
        force, air, warm = d.force_accuracy_n, d.pressure_accuracy_pa, d.temperature_accuracy_k
        self.force = replace(
            d.force_sensor,
            gain_error=force / d.force_sensor.high * draw[0],
            hysteresis=force * HYSTERESIS_SHARE / 2.0**0.5 * draw[1],
        )
        self.pressure_a = self._pressure(air, draw[2], draw[3])
        self.pressure_b = self._pressure(air, draw[4], draw[5])
        self.thermometer = replace(d.thermometer, zero=warm * draw[6])

    def _pressure(self, accuracy: float, zero: float, gain: float) -> AnalogSensor:
        sensor, ambient = self.d.pressure_sensor, self.d.ambient_pressure_pa
        relative = accuracy / (sensor.high - ambient) * gain
        # The error of the gain is proportional to the gauge pressure.
        shift = sensor.zero + accuracy * zero - relative * ambient
        return replace(sensor, gain_error=relative, zero=shift)

    def read(
        self, true: dict[str, Array], past: Past, rng: np.random.Generator | None, weight_n: float = 0.0
    ) -> dict[str, Array]:
        """Return the readings for true signals.

        Parameters
        ----------
        true : dict
            Columns of the core over one step.
        past : Past
            History at the beginning of the step.
        rng : numpy.random.Generator or None
            Generator of the noise; None: no noise.
        weight_n : float
            Weight on the force sensor in place of the drive, N.

        Returns
        -------
        dict
            position_m, force_n, pressure_a_pa, pressure_b_pa, temperature_k.
        """
        d, t = self.d, true["time_s"]
        where = "supply_pressure" if d.pressure_measured_at == "regulator" else "pressure"
        force = true["sensor_force_n"] if weight_n == 0.0 else np.full(t.shape, -weight_n)
        return {
            "position_m": d.encoder.read(true["carriage_position_m"]),
            "force_n": self.force.read(force, rng, past.force_drift_n(d, t)),
            "pressure_a_pa": self.pressure_a.read(true[f"{where}_a_pa"], rng),
            "pressure_b_pa": self.pressure_b.read(true[f"{where}_b_pa"], rng),
            "temperature_k": self.thermometer.read(np.asarray(past.barrel_k(d, t)), rng),
        }
