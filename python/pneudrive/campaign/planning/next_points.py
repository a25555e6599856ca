"""Next points of a fit on a rig: the points that the rig can hold, and the protocol that measures them."""

from __future__ import annotations

from math import isclose
from typing import TYPE_CHECKING

from pneudrive.campaign.planning.plan import cell_name, lay_out
from pneudrive.campaign.planning.protocol import parse_protocol
from pneudrive.describe.files.toml import value_text
from pneudrive.identify.design import Limits

if TYPE_CHECKING:
    from pneudrive.identify.design import Design
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.rig.interface import Envelope, Identity

#: Lowest proposed speed by default, m/s.
SLOWEST_M_S = 1e-3
#: Highest proposed gauge pressure by default, Pa, within the range of the rig; and number of levels.
HIGHEST_PA, LEVELS = 6e5, 4
#: Share of the force range for the difference of the pressure forces; the rest is for friction and inertia.
FORCE_SHARE = 0.5
#: Protocol with the default settling times.
ANY_PROTOCOL = 'schema = 1\nname = "any"\n[speed]\nlist = ["1 mm/s"]\n'


def limits_of(fit: FrictionFit, identity: Identity, envelope: Envelope, strokes: int = 1) -> Limits:
    """Return the speeds that a rig can hold, and its pressures on a grid, for `pn.next_measurements`.

    Parameters
    ----------
    fit : FrictionFit
        Its law says which pressures matter.
    identity, envelope : Identity, Envelope
        Limits of the rig.
    strokes : int
        In each direction for one point.
    """
    low_m, high_m = envelope.position_m
    stroke, acceleration = high_m - low_m, envelope.acceleration_m_s2
    # starting and stopping take at most half of the stroke
    fastest = min(envelope.speed_m_s, (0.5 * stroke * acceleration) ** 0.5)
    slowest = min(SLOWEST_M_S, fastest / 10.0)
    settling = parse_protocol(ANY_PROTOCOL).pressure.settling_s
    return Limits((slowest, fastest), _gauges(fit, identity, envelope), stroke, acceleration, strokes, settling)


def protocol_of(plan: Design, identity: Identity, envelope: Envelope) -> str:
    """Return the protocol of a design, with only the proposed cells of the crossed table.

    Parameters
    ----------
    plan : Design
    identity, envelope : Identity, Envelope
        Limits of the rig.
    """
    text = plan.protocol()
    wanted = [(p.speed_m_s, p.gauge_a_pa, p.gauge_b_pa) for p in plan.points]
    cells: dict[str, bool] = {}
    for one in lay_out(parse_protocol(text), identity, envelope).planned:
        if one.cell is not None and one.cell.speed_m_s is not None:
            pair = one.cell.pressures
            at = (one.cell.speed_m_s, pair.a.value_pa, pair.b.value_pa)
            near = any(isclose(at[0], v, rel_tol=1e-4) and abs(at[1] - a) + abs(at[2] - b) < 1.0 for v, a, b in wanted)
            cells[cell_name(one.cycle.levels, one.cell)] = near
    chosen = [name for name, near in cells.items() if near]
    if len(chosen) == len(cells):
        return text
    listed = "".join(f"    {value_text(name)},\n" for name in sorted(chosen))
    return f"{text.rstrip()}\n\n[fraction]  # proposed points\ncells = [\n{listed}]\n"


def _gauges(fit: FrictionFit, identity: Identity, envelope: Envelope) -> tuple[tuple[float, float], ...]:
    """Return the pairs of pressures whose force takes at most half of the rig's force range."""
    top = min(HIGHEST_PA, 1e4 * ((envelope.pressure_pa[1] - identity.ambient_pressure_pa) // 1e4))
    if not fit.model.chambers or top <= 0.0:
        return ((0.0, 0.0),)
    levels = [top * k / (LEVELS - 1) for k in range(LEVELS)]
    pairs = [(a, a) for a in levels]
    if envelope.separate_pressures and fit.model.chambers != ("ab",):
        both = len(fit.model.chambers) > 1
        pairs = [(a, b) for a in levels for b in levels if both or (b if "a" in fit.model.chambers else a) == 0.0]
    areas = (identity.area_a_m2, identity.area_b_m2)
    kept = [(a, b) for a, b in pairs if abs(a * areas[0] - b * areas[1]) <= FORCE_SHARE * envelope.force_n]
    return tuple(kept) or ((0.0, 0.0),)
