"""What no rig can have measured: friction that drives, and heads whose units are not those of the format."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.plausible import BELOW_AMBIENT
from pneudrive.characteristics.basics import PA_PER_BAR, Statement

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from pneudrive.characteristics.curves import Points
    from pneudrive.characteristics.reading import Reading
    from pneudrive.characteristics.reduction import Reduced

NEGATIVE = "negative friction"
OUTLIER = "outlier"
SURE = 3.0  # standard errors below zero: no friction that noise made negative
NEIGHBOURS = 6  # nearest cycles in speed, with which a cycle's friction is held
ENOUGH = 4
FAR = 10.0  # times more or less friction than at neighbouring speeds: a sensor, a unit or a range, no seal
OTHER_SPEED = 1.5  # measured speed over that of the head, either way
NAMED = 3
#: A pressure that was measured further than this from the one that was set, or than this share of the gauge pressure,
#: or so many standard uncertainties of the sensor, whichever is most, is no regulator's error (assumed).
SET_PA, SET_SHARE, PRESSURE_ACCURACIES = 1e4, 0.1, 4.0


def implausible(condition: NDArray[np.int64], reduced: Reduced) -> tuple[str, ...]:
    """Say of each cycle whether its friction cannot be; "" where it can."""
    friction, pace = np.asarray(reduced.friction_n), np.log(np.maximum(reduced.speed_m_s, 1e-12))
    found: list[str] = [""] * friction.size
    for here in (np.flatnonzero(condition == k) for k in np.unique(condition)):
        order = here[np.argsort(pace[here], kind="stable")]
        for at, i in enumerate(order.tolist()):
            near = order[max(at - NEIGHBOURS, 0) : at + NEIGHBOURS + 1]
            near = near[near != i]
            near = near[np.argsort(np.abs(pace[near] - pace[i]), kind="stable")][:NEIGHBOURS]
            usual = float(np.median(np.abs(friction[near]))) if near.size >= ENOUGH else 0.0
            if friction[i] < -SURE * reduced.friction_stderr_n[i]:
                found[i] = NEGATIVE
            elif usual > 0 and not usual / FAR <= abs(friction[i]) <= usual * FAR:
                found[i] = OUTLIER
    return tuple(found)


def suspicions(reading: Reading, points: Points | None) -> Iterator[Statement]:
    """Name cycles whose signs, speeds or pressures look like another convention than that of the folder's format."""
    if points is not None and (negative := [i for i, r in enumerate(points.reasons) if r == NEGATIVE]):
        keys = _keys([points.reduced.data[i].head.cycle.key for i in negative])
        text = (
            f"Friction comes out negative in {len(negative)} of {len(points)} cycles ({keys}): it would drive the "
            "piston. They are in no curve."
        )
        remedy = "Check the sign of force_n (positive where the rig pushes towards +x) and of position_m."
        yield Statement("data", text, carried=False, remedy=remedy)
    off = []
    for d in reading.sliding:
        stated = d.head.cycle.speed_m_s
        measured = float(np.mean([abs(s.velocity_m_s) for s in d.sides.values()])) if d.sides else float("nan")
        if stated and measured > 0 and not 1.0 / OTHER_SPEED <= measured / stated <= OTHER_SPEED:
            off.append((d.head.cycle.key, measured / stated))
    if off:
        ratio = float(np.median([r for _, r in off]))
        text = (
            f"{len(off)} cycle(s) ran at another speed than their heads say ({_keys([k for k, _ in off])}): "
            f"{ratio:.3g} times it. The curves take the speed of the samples."
        )
        remedy = "Check the units: position_m in m, time_s in s, speed_m_s in m/s."
        yield Statement("data", text, carried=False, remedy=remedy)
    yield from _set_and_measured(reading)
    ambient = reading.identity.ambient_pressure_pa
    low = [
        (d.head.cycle.key, p)
        for d in reading.sliding
        for p in (d.condition.pressure_a_pa, d.condition.pressure_b_pa)
        if p < (1.0 - BELOW_AMBIENT) * ambient
    ]
    if low:
        text = (
            f"Chambers of {len({k for k, _ in low})} cycle(s) are below ambient pressure "
            f"({min(p for _, p in low) / PA_PER_BAR:.3g} bar abs, ambient {ambient / PA_PER_BAR:.3g} bar): "
            "either a vacuum, or gauge pressures where absolute ones belong."
        )
        yield Statement("data", text, carried=False, remedy="State all pressures as absolute, in Pa.")


def _set_and_measured(reading: Reading) -> Iterator[Statement]:
    """Hold the pressures of the samples against those that the heads say were set.

    Both directions together: what the air does in motion raises one of them and lowers the other.
    """
    ambient = reading.identity.ambient_pressure_pa
    for side in ("a", "b"):
        name = f"pressure_{side}_pa"
        sure = PRESSURE_ACCURACIES * reading.identity.accuracy.get(name, 0.0)
        off, low = [], []
        for d in reading.sliding:
            if not d.sides:
                continue
            planned = getattr(d.head.cycle, name)
            measured = float(np.mean([getattr(s, name) for s in d.sides.values()]))
            if abs(measured - planned) > max(SET_PA, SET_SHARE * abs(planned - ambient), sure):
                off.append((d.head.cycle.key, measured - planned))
            if measured < ambient - max(SET_PA, sure) and planned >= (1.0 - BELOW_AMBIENT) * ambient:
                low.append((d.head.cycle.key, measured))
        if off:
            mean = float(np.median([change for _, change in off]))
            text = (
                f"The measured pressure of chamber {side} lies {mean / PA_PER_BAR:+.2g} bar from the set one in "
                f"{len(off)} of {len(reading.sliding)} cycles ({_keys([key for key, _ in off])}): forces are taken "
                "from the measured one, curves are named by the set one."
            )
            remedy = "Check the transducer's zero, the regulator, and which of them writes pressures above ambient"
            unit = " (the difference is one ambient pressure: one of them is a gauge pressure)"
            alike = abs(abs(mean) - ambient) < 0.1 * ambient
            yield Statement("data", text, carried=False, remedy=f"{remedy}{unit if alike else ''}.")
        if low:
            text = (
                f"Chamber {side} was measured below ambient pressure in {len(low)} cycle(s) "
                f"({_keys([k for k, _ in low])}; {min(p for _, p in low) / PA_PER_BAR:.3g} bar abs, ambient "
                f"{ambient / PA_PER_BAR:.3g} bar): a regulator makes no vacuum."
            )
            yield Statement("data", text, carried=False, remedy="State all pressures as absolute, in Pa.")


def _keys(keys: list[str]) -> str:
    return ", ".join(keys[:NAMED]) + (", ..." if len(keys) > NAMED else "")
