"""Bias of a mean force over self-excited motion against the friction of steady sliding, by simulation of the rig.

The mean force over stick-slip is not the friction at the mean speed. With a law and the rig's stiffness, damping and
mass the difference can be computed and corrected: fit the law, subtract the difference from points in the self-excited
range, and repeat the fit until it converges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.dragged import Dragged
from pneudrive.errors import SimulationError
from pneudrive.rig.core import steady_friction_n

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Length of the motion in stretches of the spring under sliding friction, and in periods of the piston on the spring;
#: share left out at the beginning.
STRETCHES, PERIODS, LEFT_OUT = 60.0, 60.0, 1.0 / 3.0
#: Samples over the rest, and the tolerance of the core.
SAMPLES, RTOL = 20000, 1e-6
#: Time for the axis to reach its speed, in periods of the piston on the spring.
START_PERIODS = 2.0
#: Any value: the force of the air is subtracted again.
AREA_M2 = 1e-4


@dataclass(frozen=True)
class Swing:
    """Result of dragging a piston at one speed.

    Attributes
    ----------
    speed_m_s : float
    force_n : float
        Mean of the force of the spring.
    steady_n : float
        Friction of steady sliding at that speed.
    ripple : float
        Standard deviation of the piston's speed over its mean.
    """

    speed_m_s: float
    force_n: float
    steady_n: float
    ripple: float

    @property
    def bias_n(self) -> float:
        """Mean force minus the friction of steady sliding, N."""
        return self.force_n - self.steady_n


def drag_swinging(
    friction: dict[str, Any],
    speed_m_s: float,
    stiffness_n_m: float,
    damping_n_s_m: float,
    mass_kg: float,
    gauges_pa: tuple[float, float] = (0.0, 0.0),
) -> Swing:
    """Simulate a piston dragged through the spring of a rig, until its motion is periodic.

    Parameters
    ----------
    friction : dict
        As for `pneudrive.rig.stability.sliding_stability`.
    speed_m_s : float
        Speed of the axis, > 0.
    stiffness_n_m, damping_n_s_m, mass_kg : float
    gauges_pa : (float, float)
        Gauge pressures in the chambers.

    Returns
    -------
    Swing

    Raises
    ------
    SimulationError
        The core cannot go on.
    """
    steady = float(steady_friction_n(friction, speed_m_s, gauges_pa)[0])
    period = 2.0 * np.pi * (mass_kg / stiffness_n_m) ** 0.5
    start = START_PERIODS * period
    jerk = speed_m_s / (0.5 * start) ** 2
    cruise = max(STRETCHES * steady / stiffness_n_m / speed_m_s, PERIODS * period)
    pressures = [STANDARD_ATMOSPHERE_PA + gauge for gauge in gauges_pa]
    piston = {"area_a": AREA_M2, "area_b": AREA_M2, "stroke": 1.0, "moving_mass": mass_kg}
    rig = Dragged(friction, piston, {"stiffness": stiffness_n_m, "damping": damping_n_s_m})
    for side, pressure in zip("ab", pressures, strict=True):
        rig.hold(side, pressure)
    times = np.linspace(start + LEFT_OUT * cruise, start + cruise, SAMPLES)
    try:
        columns = rig.run([0.5 * start, 0.5 * start, cruise], [jerk, -jerk, 0.0], times, 0.0, RTOL).columns
    except (ValueError, RuntimeError) as error:
        raise SimulationError("the dragged piston cannot be simulated", value=str(error)) from error
    force = columns["sensor_force_n"] + AREA_M2 * (pressures[0] - pressures[1])
    speed = columns["velocity_m_s"]
    return Swing(speed_m_s, float(force.mean()), steady, float(speed.std() / speed_m_s))
