"""A drawing of a rig from its identity: axis, force sensor, piston in its barrel, air."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pneudrive.report.sketch import draw_sketch

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.rig.interface import Envelope, Identity


def rig_diagram(identity: Identity, envelope: Envelope) -> Figure:
    """Draw a rig with its stated values.

    Parameters
    ----------
    identity, envelope
        Description and limits of the rig.

    Returns
    -------
    matplotlib.figure.Figure
    """
    sensor = []
    if "force_n" in identity.limits:
        sensor.append(f"±{max(abs(v) for v in identity.limits['force_n']):.0f} N")
    if "force_n" in identity.accuracy:
        sensor.append(f"u = {identity.accuracy['force_n']:.2g} N")
    if identity.stiffness_n_m is not None:
        sensor.append(f"{1e-6 * identity.stiffness_n_m:.3g} N/µm")
    low, high = (1e-5 * (p - identity.ambient_pressure_pa) for p in envelope.pressure_pa)
    return draw_sketch(
        "rig",
        [identity.chambers if identity.chambers in ("open", "common") else "separate"],
        low_mm=1e3 * envelope.position_m[0],
        high_mm=1e3 * envelope.position_m[1],
        speed_mm_s=1e3 * envelope.speed_m_s,
        acceleration=envelope.acceleration_m_s2,
        jerk=envelope.jerk_m_s3,
        sensor=", ".join(sensor),
        bore_mm=2e3 * math.sqrt(identity.area_a_m2 / math.pi),
        mass=identity.mass_beyond_sensor_kg,
        held="pressures held" if identity.chambers == "held" else "a regulator for each chamber",
        served=f"{max(low, 0.0):.2g} to {high:.3g} bar gauge",
    )
