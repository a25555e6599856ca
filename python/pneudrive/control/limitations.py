"""What limits a controller on a drive, in words."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from pneudrive.control.axis import supply_of
from pneudrive.errors import warn

if TYPE_CHECKING:
    from pneudrive.control.setup import Setup
    from pneudrive.control.tuning import Tuning

#: Samples of a law in a period of the mass on its air, below which it is told to be slow (assumed).
LEAST_SAMPLES = 40
MOST_OF_FORCE = 0.85  # of the supply that weight and friction may take, beyond which it is said (assumed)
#: Rates that differ by a smaller share are equal.
EQUAL_DECAY = 0.01


def limited(tuning: Tuning, setup: Setup) -> Tuning:
    """Add what limits a controller, in words."""
    plant, said = tuning.plant, []
    bandwidth = next((gain.value for gain in tuning.gains if gain.key == "bandwidth"), plant.natural_frequency_rad_s)
    late = bandwidth * plant.lag_s
    said.append(
        f"A command acts {1e3 * plant.lag_s:.3g} ms late (dead time of the valve, spool, half a period): "
        f"{late:.2g} rad at {bandwidth:.3g} rad/s. A faster valve or a shorter period allows a larger bandwidth."
    )
    of_valve = plant.lag_s - 0.5 * tuning.period_s
    longest = max(of_valve, 2.0 * math.pi / plant.natural_frequency_rad_s / LEAST_SAMPLES)
    needs = max(plant.least_force_shares)
    if needs > MOST_OF_FORCE:
        warn(
            f"weight and friction take {100.0 * needs:.0f} % of the force of the supply: "
            f"{'the drive cannot move' if needs > 1.0 else 'little is left to move it'} at least one way"
        )
    if tuning.period_s > longest:
        slow = f"period = {1e3 * tuning.period_s:g} ms: a law follows badly or loses the drive"
        of = f"the lag of its valve or 1/{LEAST_SAMPLES} (assumed) of a period of its mass on the air"
        warn(f"{slow} beyond {1e3 * longest:.3g} ms, {of}")
    if setup.computer.time_s > 0.0:
        said.append(f"The computer of the setup adds {1e3 * setup.computer.time_s:.3g} ms that the law does not know.")
    if setup.sensors.pressure_a is None:
        said.append("The setup has no pressure sensors: the law follows the pressures by its model of the drive.")
    said += _unobservable(tuning, measured=setup.sensors.pressure_a is not None)
    supply_pa, _ = supply_of(tuning.belief.core_json())
    said += [f"{short}." for short in setup.short_of(supply_pa, tuning.belief.ambient.pressure_pa)]
    if plant.left_out:
        said.append(
            f"The law knows nothing of {', '.join(plant.left_out)} but the volume of tubes at the chambers: it takes "
            "the valve to stand at the cylinder, at a supply of constant pressure; speed and lag leave them out."
        )
    said.append(f"References up to {plant.speed_m_s:.3g} m/s and within {1e3 * plant.stroke_m:g} mm are accepted.")
    assumed = [gain.key for gain in tuning.numbers if "assumed" in gain.rule and not gain.given]
    if assumed:
        said.append(f"Assumed, not derived from this drive: {', '.join(assumed)}.")
    return replace(tuning, limits=tuple(said))


def _unobservable(tuning: Tuning, *, measured: bool) -> list[str]:
    """Return what no observer can find out about this drive, in words."""
    said = [
        "Not told apart by any observer: a force on the piston, friction that differs between the directions, and "
        "zeros of the sensors; conductance of the valve and supply pressure; mass and force, while nothing "
        "accelerates."
    ]
    if not measured:
        rates = sorted(tuning.plant.pressure_decay_1_s)
        apart = rates[1] - rates[0]
        if apart <= EQUAL_DECAY * rates[1]:
            why = f"both shut chambers return at {rates[1]:.2g} 1/s by leakage and heat"
        else:
            why = f"only their return by leakage and heat, at {rates[0]:.2g} and {rates[1]:.2g} 1/s, tells them apart"
        said.append(f"At rest the position tells the force of the gas, not both pressures: {why}.")
    return said
