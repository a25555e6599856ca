"""Checks for a campaign that no rig can have measured: negative friction, and headers in other units."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.campaign.basics import PA_PER_BAR, Statement
from pneudrive.friction.campaign.sentences import named, say
from pneudrive.friction.reduction.plausible import BELOW_AMBIENT, NEGATIVE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.friction.campaign.curves.curves import Points
    from pneudrive.friction.campaign.cycles.reading import CampaignData

OTHER_SPEED = 1.5  # ratio of measured speed to that in the header, either way
#: A measured pressure that differs from the set one by more than this, or than this share of the gauge pressure,
#: or so many standard uncertainties of the sensor, whichever is most, is not an error of the regulator (assumed).
SET_PA, SET_SHARE, PRESSURE_ACCURACIES = 1e4, 0.1, 4.0


def suspicions(reading: CampaignData, points: Points | None) -> Iterator[Statement]:
    """Return statements on cycles whose signs, speeds or pressures do not follow the conventions of the folder."""
    if points is not None and (negative := [i for i, r in enumerate(points.reasons) if r == NEGATIVE]):
        keys = named(points.reduced.data[i].head.cycle.key for i in negative)
        yield say("data.negative", negative=len(negative), count=len(points), keys=keys)
    off = []
    for d in reading.sliding:
        stated = d.head.cycle.speed_m_s
        measured = float(np.mean([abs(s.velocity_m_s) for s in d.sides.values()])) if d.sides else float("nan")
        if stated and measured > 0 and not 1.0 / OTHER_SPEED <= measured / stated <= OTHER_SPEED:
            off.append((d.head.cycle.key, measured / stated))
    if off:
        ratio = float(np.median([r for _, r in off]))
        yield say("data.other_speed", count=len(off), keys=named(key for key, _ in off), ratio=ratio)
    yield from _set_and_measured(reading)
    ambient = reading.identity.ambient_pressure_pa
    low = {
        d.head.cycle.key: min(d.condition.pressure_a_pa, d.condition.pressure_b_pa)
        for d in reading.sliding
        if min(d.condition.pressure_a_pa, d.condition.pressure_b_pa) < (1.0 - BELOW_AMBIENT) * ambient
    }
    if low:
        lowest = min(low.values()) / PA_PER_BAR
        yield say("data.below_ambient", count=len(low), lowest=lowest, ambient=ambient / PA_PER_BAR)


def _set_and_measured(reading: CampaignData) -> Iterator[Statement]:
    """Compare the pressures of the samples with the set ones in the headers.

    Both directions together: motion of the air raises one of them and lowers the other.
    """
    ambient = reading.identity.ambient_pressure_pa
    for side in ("a", "b"):
        name = f"pressure_{side}_pa"
        sure = PRESSURE_ACCURACIES * reading.identity.accuracy.get(name, 0.0)
        off, low = {}, {}
        for d in reading.sliding:
            if not d.sides:
                continue
            planned = getattr(d.head.cycle, name)
            measured = float(np.mean([getattr(s, name) for s in d.sides.values()]))
            if abs(measured - planned) > max(SET_PA, SET_SHARE * abs(planned - ambient), sure):
                off[d.head.cycle.key] = measured - planned
            if measured < ambient - max(SET_PA, sure) and planned >= (1.0 - BELOW_AMBIENT) * ambient:
                low[d.head.cycle.key] = measured
        if off:
            mean = float(np.median(list(off.values())))
            kind = "one_is_gauge" if abs(abs(mean) - ambient) < 0.1 * ambient else "not_as_set"
            values = {"mean": mean / PA_PER_BAR, "off": len(off), "count": len(reading.sliding), "keys": named(off)}
            yield say(f"data.{kind}", side=side, **values)
        if low:
            lowest = min(low.values()) / PA_PER_BAR
            values = {"count": len(low), "keys": named(low), "lowest": lowest, "ambient": ambient / PA_PER_BAR}
            yield say("data.vacuum", side=side, **values)
