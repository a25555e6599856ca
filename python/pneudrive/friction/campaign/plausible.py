"""Plausibility of cycles: uneven sliding, impossible friction, speeds and pressures that differ from the plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.conditions import PA_PER_BAR
from pneudrive.friction.level import BELOW_AMBIENT
from pneudrive.friction.sentences import Said, named
from pneudrive.friction.stick_slip import RIPPLE_LIMIT

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.cycle import CycleData


SWING_SHARE = 0.05  # of the friction: smaller swings are roughness or noise
SWING_FLOOR = 3.0  # times the noise while standing
UNRESOLVED = 0.4  # worst-case ripple of the piston's speed for a swing at the natural frequency
UNNAMED = "speed ripple"
STICK_SLIP = ("stick-slip", "force swing")
NAMES = (*STICK_SLIP, UNNAMED)


def unsteady(
    data: Sequence[CycleData], tares: Sequence[CycleData], stiffness_n_m: float | None, mass_kg: float
) -> tuple[str, ...]:
    """Return for each cycle the reason why sliding on the rig's spring was not steady; "" if it was steady.

    There are three signs. (1) The axis itself runs unevenly. (2) The piston's position, which is the axis
    position minus the deflection of the force sensor, is uneven. (3) If samples are too far apart for both, the force
    oscillates by much more than the sensor's noise. An oscillation of this size at the natural frequency of the rig
    would change the speed of the piston by 40 %.
    """
    floor = _noise(data, tares)
    return tuple(_reason(d, floor, stiffness_n_m, mass_kg) for d in data)


def _reason(d: CycleData, floor: float, stiffness_n_m: float | None, mass_kg: float) -> str:
    sides = list(d.sides.values())
    if any(s.ripple > RIPPLE_LIMIT for s in sides):
        return "stick-slip" if any(s.stick_slip for s in sides) else UNNAMED
    scatter = max(0.0 if np.isnan(s.scatter_n) else s.scatter_n for s in sides)
    if scatter < SWING_FLOOR * floor:
        return ""
    level = float(np.nanmean([abs(np.nanmean(s.balance_n)) for s in sides]))
    if scatter < SWING_SHARE * level:
        return ""
    if any(s.piston_ripple > RIPPLE_LIMIT for s in sides):
        return "stick-slip" if any(s.stick_slip for s in sides) else UNNAMED
    if stiffness_n_m and mass_kg:
        swing = scatter / np.sqrt(stiffness_n_m * mass_kg)
        if swing > UNRESOLVED * np.mean([abs(s.velocity_m_s) for s in sides]):
            return "force swing"
    return ""


def _noise(data: Sequence[CycleData], tares: Sequence[CycleData]) -> float:
    """Return the noise of the force at rest.

    Without zero runs, return the lower quartile of the slower half of the cycles.

    Slow noise is visible within a bin of a slow cycle, but not within a bin of a fast cycle.
    """
    if tares:
        return float(np.median([t.standing_sd_n for t in tares]))
    speeds = np.array([np.mean([abs(s.velocity_m_s) for s in d.sides.values()]) for d in data])
    scatters = np.array([max(float(np.nan_to_num(s.scatter_n)) for s in d.sides.values()) for d in data])
    slow = speeds <= np.median(speeds)
    return float(np.quantile(scatters[slow], 0.25))


NEGATIVE = "negative friction"
OUTLIER = "outlier"
SURE = 3.0  # standard errors below zero: negative beyond noise
NEIGHBOURS = 6  # nearest cycles in speed for the comparison of a cycle's friction
ENOUGH = 4
FAR = 10.0  # factor of friction to neighbouring speeds: an error of sensor, unit or range, not a seal


def implausible_friction(
    condition: NDArray[np.int64],
    speed_m_s: NDArray[np.float64],
    friction_n: NDArray[np.float64],
    stderr_n: NDArray[np.float64],
) -> tuple[str, ...]:
    """Return for each cycle of a campaign, shape (n,), the reason why its friction is impossible.

    "" if it is possible.
    """
    pace = np.log(np.maximum(speed_m_s, 1e-12))
    found: list[str] = [""] * friction_n.size
    for here in (np.flatnonzero(condition == k) for k in np.unique(condition)):
        order = here[np.argsort(pace[here], kind="stable")]
        for at, i in enumerate(order.tolist()):
            near = order[max(at - NEIGHBOURS, 0) : at + NEIGHBOURS + 1]
            near = near[near != i]
            near = near[np.argsort(np.abs(pace[near] - pace[i]), kind="stable")][:NEIGHBOURS]
            usual = float(np.median(np.abs(friction_n[near]))) if near.size >= ENOUGH else 0.0
            if friction_n[i] < -SURE * stderr_n[i]:
                found[i] = NEGATIVE
            elif usual > 0 and not usual / FAR <= abs(friction_n[i]) <= usual * FAR:
                found[i] = OUTLIER
    return tuple(found)


OTHER_SPEED = 1.5  # ratio of measured speed to that in the header, either way
#: A measured pressure that differs from the set one by more than this, or than this share of the gauge pressure,
#: or so many standard uncertainties of the sensor, whichever is most, is not an error of the regulator (assumed).
SET_PA, SET_SHARE, PRESSURE_ACCURACIES = 1e4, 0.1, 4.0


def suspicions(data: Sequence[CycleData], accuracy: Mapping[str, float], ambient_pa: float) -> Iterator[Said]:
    """Return sentences on cycles whose speeds or pressures differ from those of their plan.

    Parameters
    ----------
    data : sequence of CycleData
    accuracy : mapping
        Channel -> standard uncertainty, SI.
    ambient_pa : float
    """
    off = []
    for d in data:
        stated = d.plan.speed_m_s
        measured = float(np.mean([abs(s.velocity_m_s) for s in d.sides.values()])) if d.sides else float("nan")
        if stated and measured > 0 and not 1.0 / OTHER_SPEED <= measured / stated <= OTHER_SPEED:
            off.append((d.plan.key, measured / stated))
    if off:
        ratio = float(np.median([r for _, r in off]))
        yield "data.other_speed", {"count": len(off), "keys": named(key for key, _ in off), "ratio": ratio}
    yield from _set_and_measured(data, accuracy, ambient_pa)
    low = {
        d.plan.key: min(d.condition.pressure_a_pa, d.condition.pressure_b_pa)
        for d in data
        if min(d.condition.pressure_a_pa, d.condition.pressure_b_pa) < (1.0 - BELOW_AMBIENT) * ambient_pa
    }
    if low:
        lowest = min(low.values()) / PA_PER_BAR
        yield "data.below_ambient", {"count": len(low), "lowest": lowest, "ambient": ambient_pa / PA_PER_BAR}


def _set_and_measured(data: Sequence[CycleData], accuracy: Mapping[str, float], ambient_pa: float) -> Iterator[Said]:
    """Compare the pressures of the samples with the set ones in the headers.

    The mean of both directions is compared, because the moving air raises the pressure in one direction and lowers it
    in the other.
    """
    for side in ("a", "b"):
        name = f"pressure_{side}_pa"
        sure = PRESSURE_ACCURACIES * accuracy.get(name, 0.0)
        off, low = {}, {}
        for d in data:
            if not d.sides:
                continue
            planned = d.plan.pressures_pa.get(side, float("nan"))
            measured = float(np.mean([getattr(s, name) for s in d.sides.values()]))
            if abs(measured - planned) > max(SET_PA, SET_SHARE * abs(planned - ambient_pa), sure):
                off[d.plan.key] = measured - planned
            if measured < ambient_pa - max(SET_PA, sure) and planned >= (1.0 - BELOW_AMBIENT) * ambient_pa:
                low[d.plan.key] = measured
        if off:
            mean = float(np.median(list(off.values())))
            kind = "one_is_gauge" if abs(abs(mean) - ambient_pa) < 0.1 * ambient_pa else "not_as_set"
            values = {"mean": mean / PA_PER_BAR, "off": len(off), "count": len(data), "keys": named(off)}
            yield f"data.{kind}", dict(side=side, **values)
        if low:
            lowest = min(low.values()) / PA_PER_BAR
            values = {"count": len(low), "keys": named(low), "lowest": lowest, "ambient": ambient_pa / PA_PER_BAR}
            yield "data.vacuum", dict(side=side, **values)
