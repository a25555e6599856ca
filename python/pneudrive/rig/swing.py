"""What a mean over self-excited motion differs from the friction of steady sliding by: the rig simulated.

A mean of the force over stick-slip is not the friction at the mean speed. With a law and the rig's stiffness, damping
and mass the difference can be computed, and taken off: fit the law, take the difference off the points that were
measured in the self-excited range, and fit again until nothing changes.
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

#: How long it is dragged: for so many stretches of the spring under the friction of sliding, and so many periods of the
#: piston on it; the part that is left out at the beginning.
STRETCHES, PERIODS, LEFT_OUT = 60.0, 60.0, 1.0 / 3.0
#: Samples over the rest, and the tolerance of the core.
SAMPLES, RTOL = 20000, 1e-6
#: Time in which the axis comes to its speed, in periods of the piston on the spring.
START_PERIODS = 2.0
#: Any will do: the force of the air is taken off again.
AREA_M2 = 1e-4


@dataclass(frozen=True)
class Swing:
    """A piston dragged at one speed.

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
        """What a mean differs by from the friction of steady sliding."""
        return self.force_n - self.steady_n


def drag_swinging(
    friction: dict[str, Any],
    speed_m_s: float,
    stiffness_n_m: float,
    damping_n_s_m: float,
    mass_kg: float,
    gauges_pa: tuple[float, float] = (0.0, 0.0),
) -> Swing:
    """Drag a piston through the spring of a rig in the simulation, long enough for its motion to repeat.

    Parameters
    ----------
    friction : dict
        As of `pneudrive.rig.stability.sliding_stability`.
    speed_m_s : float
        Of the axis, > 0.
    stiffness_n_m, damping_n_s_m, mass_kg : float
    gauges_pa : (float, float)
        Gauge pressures in the chambers.

    Returns
    -------
    Swing

    Raises
    ------
    SimulationError
        If the core cannot go on.
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
