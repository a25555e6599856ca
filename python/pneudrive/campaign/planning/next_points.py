"""Limits of a rig for the proposal of next measurements."""

from __future__ import annotations

from itertools import product

from pneudrive.campaign.planning.protocol import Pressures
from pneudrive.identify.design import Limits
from pneudrive.identify.static.result import FrictionFit
from pneudrive.rig.interface import Envelope, Identity

#: Lowest proposed speed by default, m/s.
SLOWEST_M_S = 1e-3
#: Highest proposed gauge pressure by default, Pa, within the range of the rig; and number of levels.
HIGHEST_PA, LEVELS = 6e5, 4
#: Fraction of the force range for the difference of the pressure forces. The rest is for friction and inertia.
FORCE_SHARE = 0.5


def limits_of(fit: FrictionFit, identity: Identity, envelope: Envelope) -> Limits:
    """Return the feasible speeds of a rig and a grid of feasible pressures, for `pn.next_measurements`.

    Parameters
    ----------
    fit : FrictionFit
        Fit of a friction law. The grid varies the pressures on which the law depends.
    identity, envelope : Identity, Envelope
        Limits of the rig.
    """
    low_m, high_m = envelope.position_m
    stroke, acceleration = high_m - low_m, envelope.acceleration_m_s2
    # starting and stopping take at most half of the stroke
    fastest = min(envelope.speed_m_s, (0.5 * stroke * acceleration) ** 0.5)
    slowest = min(SLOWEST_M_S, fastest / 10.0)
    # Pairs of gauge pressures whose force is at most half of the rig's force range.
    top = min(HIGHEST_PA, 1e4 * ((envelope.pressure_pa[1] - identity.ambient_pressure_pa) // 1e4))
    chambers, highest_n = "".join(fit.model.chambers), FORCE_SHARE * envelope.force_n
    levels = [top * k / (LEVELS - 1) for k in range(LEVELS)] if chambers and top > 0.0 else [0.0]
    each = [levels if chamber in chambers else [0.0] for chamber in "ab"]
    pairs = product(*each) if envelope.separate_pressures else zip(levels, levels, strict=True)
    gauges = tuple((a, b) for a, b in pairs if abs(a * identity.area_a_m2 - b * identity.area_b_m2) <= highest_n)
    settling_s = Pressures().settling_s  # by default
    return Limits((slowest, fastest), gauges, stroke, acceleration, settling_s=settling_s)
