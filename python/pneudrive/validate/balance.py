"""Force balance and pressure rates along a recording: what the drive's equations say at measured states.

The equations are the core's (``Drive.along``); nothing here repeats one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.describe.valve_flow import openings
from pneudrive.errors import SimulationError
from pneudrive.simulate import compiled
from pneudrive.validate.simulation import start_temperatures

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe import Drive
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Terms:
    """Terms of the balances at each sample.

    Attributes
    ----------
    force_n : ndarray
        All forces in +x but friction: pressures, weight, load, spring, end stops.
    friction_n : ndarray
        Of steady sliding at the measured velocity, opposing v > 0.
    end_stop_n : ndarray
    pressure_rate_a_pa_s, pressure_rate_b_pa_s : ndarray
        Of the energy balance.
    temperature_a_k, temperature_b_k : ndarray
        That follow the energy balance at measured position and pressure.
    mass_flow_a_kg_s, mass_flow_b_kg_s : ndarray
    """

    force_n: Array
    friction_n: Array
    end_stop_n: Array
    pressure_rate_a_pa_s: Array
    pressure_rate_b_pa_s: Array
    temperature_a_k: Array
    temperature_b_k: Array
    mass_flow_a_kg_s: Array
    mass_flow_b_kg_s: Array


def _without_lines(drive: Drive) -> Drive:
    """Leave out what lies between valve and cylinder: forces are the same, flows and rates of pressures are not."""
    return drive.model_copy(update={"tubing": {}, "flow_control": {}}) if drive.has_lines else drive


def evaluate(
    drive: Drive,
    signals: Signals,
    *,
    position: Array | None = None,
    pressures: tuple[Array, Array] | None = None,
    opened: Array | None = None,
) -> Terms:
    """Evaluate the terms of the balances along a recording, with some signals replaced where they are given."""
    x = signals.position_m if position is None else position
    p_a, p_b = (signals.pressure_a_pa, signals.pressure_b_pa) if pressures is None else pressures
    shares = openings(signals.command) if opened is None else opened
    try:
        out = compiled(_without_lines(drive).core_json()).along(
            np.ascontiguousarray(signals.time_s),
            np.ascontiguousarray(x),
            np.ascontiguousarray(signals.velocity_m_s),
            np.ascontiguousarray(p_a),
            np.ascontiguousarray(p_b),
            np.ascontiguousarray(shares),
            start_temperatures(drive, signals),
        )
    except RuntimeError as error:
        raise SimulationError(str(error)) from None
    return Terms(
        out["force_n"],
        out["friction_n"],
        out["end_stop_force_n"],
        out["pressure_rate_a_pa_s"],
        out["pressure_rate_b_pa_s"],
        out["temperature_a_k"],
        out["temperature_b_k"],
        out["mass_flow_a_kg_s"],
        out["mass_flow_b_kg_s"],
    )
