"""Sensors from cycles at rest: gain of the force sensor by known weights, zeros of the pressures by zero runs.

In an open zero run, both chambers should show ambient pressure.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.budget import USUAL_RANGES_PA

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.cycle import CycleData, CycleSide, OpenPressure
    from pneudrive.rig.interface import Identity

    Array = NDArray[np.float64]

SIDES = ("a", "b")
SURPRISE = 3.0  # standard uncertainties between stated accuracy and known weights
GROWING = ("force: gain", "force: creep")  # sources proportional to the force
PLAUSIBLE = 0.1  # a larger gain error is not the sensor's: the weight was wrong or supported
REACH = 5.0  # stated accuracies: a larger deviation from ambient is not the zero of a sound transducer (assumed)


@dataclass(frozen=True)
class Gain:
    """Relative error of the force sensor's gain.

    Attributes
    ----------
    error : float
        Correction of the force: measured error, weighted against the stated accuracy.
    stderr : float
        Standard uncertainty after correction; NaN without a weight.
    measured, measured_stderr : float
        Gain from the weights only. NaN without weights.
    cycles : int
    plausible : bool
    surprising : bool
        The error exceeds stated accuracy and scatter: then only the weights count.
    """

    error: float = 0.0
    stderr: float = float("nan")
    measured: float = float("nan")
    measured_stderr: float = float("nan")
    cycles: int = 0
    plausible: bool = True
    surprising: bool = False


def sensor_gain(identity: Identity, weights: Sequence[CycleData], tares: Sequence[CycleData]) -> Gain:
    """Compare the readings of the sensor under known weights with its readings when released.

    If a weight pulls the piston in +x, the rig holds it back, and the sensor shows less by this force.
    """
    if not weights or not tares:
        return Gain()
    values, variances = [], []
    for d in weights:
        force = d.plan.weight_n
        if force == 0.0:
            continue
        tare = min(tares, key=lambda t: abs(t.plan.index - d.plan.index))
        values.append((tare.standing_n - d.standing_n) / force - 1.0)
        variances.append((d.standing_stderr_n**2 + tare.standing_stderr_n**2) / force**2)
    if not values:
        return Gain()
    measured = float(np.mean(values))
    scatter = float(np.var(values, ddof=1)) / len(values) if len(values) > 1 else 0.0
    stderr = float(np.sqrt(max(float(np.mean(variances)) / len(values), scatter)))
    if abs(measured) > PLAUSIBLE:
        return Gain(0.0, float("nan"), measured, stderr, len(values), plausible=False)
    prior = stated_gain(identity)
    if prior is None:
        return Gain(measured, stderr, measured, stderr, len(values))
    total = float(np.hypot(prior, stderr))
    if abs(measured) > SURPRISE * total:
        return Gain(measured, stderr, measured, stderr, len(values), surprising=True)
    share = prior**2 / total**2 if total > 0 else 0.0
    return Gain(share * measured, float(np.sqrt(share)) * stderr, measured, stderr, len(values))


def stated_gain(identity: Identity) -> float | None:
    """Return the relative gain error that calibration or stated accuracy allow; None if nothing is stated."""
    if identity.force_calibration is not None:
        return identity.force_calibration.u_gain
    if "force_n" not in identity.accuracy or "force_n" not in identity.limits:
        return None
    return identity.accuracy["force_n"] / max(abs(v) for v in identity.limits["force_n"])


def corrected(data: Sequence[CycleData], gain: Gain) -> tuple[CycleData, ...]:
    """Correct the gain of cycles, and replace the stated uncertainty by the remaining one."""
    if not np.isfinite(gain.stderr):
        return tuple(data)
    return tuple(_corrected(d, gain) for d in data)


def _corrected(d: CycleData, gain: Gain) -> CycleData:
    known = {**d.u_force_n, "force: gain": gain.stderr * _half_difference(d)}
    growing = (*(known[name] for name in GROWING if name in known), d.u_air_n)
    return replace(
        d,
        sides={direction: _side(side, gain.error) for direction, side in d.sides.items()},
        standing_n=d.standing_n / (1.0 + gain.error),
        u_gain_n=float(np.sqrt(sum(u**2 for u in growing))),
        u_force_n=known if d.u_force_n else {},
        assumed=False,
    )


def _side(side: CycleSide, error: float) -> CycleSide:
    force = side.balance_n - side.air_n
    return replace(side, balance_n=side.air_n + force / (1.0 + error), force_n=side.force_n / (1.0 + error))


def _half_difference(d: CycleData) -> float:
    forces = [side.force_n for side in d.sides.values()]
    return abs(forces[0] - forces[-1]) / 2.0 if len(forces) == 2 else abs(forces[0]) if forces else 0.0


@dataclass(frozen=True)
class PressureZero:
    """Zero of the transducer of one chamber.

    Attributes
    ----------
    blocks : dict
        Block -> zero that is subtracted from its cycles, Pa; empty if unknown.
    mean_pa, stderr_pa : float
        Mean over all usable zero runs. The standard uncertainty comes from noise and from differences of zero runs.
    tares : int
        That count.
    far, unsteady : dict
        Key of an unusable zero run -> its deviation from ambient, and its change, Pa.
    """

    blocks: dict[int, float] = field(default_factory=dict)
    mean_pa: float = float("nan")
    stderr_pa: float = float("nan")
    tares: int = 0
    far: dict[str, float] = field(default_factory=dict)
    unsteady: dict[str, float] = field(default_factory=dict)

    def at(self, block: int) -> float:
        """Return the zero for a cycle of this block, Pa: from the zero runs of the block, otherwise from all."""
        return self.blocks.get(block, self.mean_pa if self.tares else 0.0)


def pressure_zeros(identity: Identity, tares: Sequence[CycleData]) -> dict[str, PressureZero]:
    """Find the zero of each transducer whose accuracy is stated, by chamber ("a", "b")."""
    found = {}
    for side in SIDES:
        accuracy = identity.accuracy.get(f"pressure_{side}_pa", 0.0)
        seen = [(tare, shown) for tare in tares if (shown := tare.standing_pressures.get(side)) is not None]
        if accuracy > 0.0 and seen:
            found[side] = _zero(seen, identity.ambient_pressure_pa, accuracy)
    return found


def _zero(seen: list[tuple[CycleData, OpenPressure]], ambient_pa: float, accuracy_pa: float) -> PressureZero:
    far, unsteady = {}, {}
    blocks: dict[int, list[float]] = {}
    noise = []
    for tare, shown in seen:
        off = shown.mean_pa - ambient_pa
        if abs(shown.change_pa) > accuracy_pa:
            unsteady[tare.plan.key] = shown.change_pa
        elif abs(off) > REACH * accuracy_pa:
            far[tare.plan.key] = off
        else:
            blocks.setdefault(tare.plan.block, []).append(off)
            noise.append(shown.stderr_pa)
    values = [off for offs in blocks.values() for off in offs]
    if not values:
        return PressureZero(far=far, unsteady=unsteady)
    scatter = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
    stderr = float(np.hypot(np.sqrt(np.mean(np.square(noise))), scatter) / np.sqrt(len(values)))
    means = {block: float(np.mean(offs)) for block, offs in blocks.items()}
    return PressureZero(means, float(np.mean(values)), stderr, len(values), far, unsteady)


def without_zeros(
    data: Sequence[CycleData], zeros: dict[str, PressureZero], identity: Identity
) -> tuple[CycleData, ...]:
    """Subtract the zeros from cycles and zero runs.

    After this correction, a zero run shows only the zero of the force sensor.

    The accuracy of a transducer is then that of its gain, which grows with the reading. If the range is not stated, the
    smallest usual range that contains the highest pressure of the campaign is assumed.
    """
    known = {side: zero for side, zero in zeros.items() if zero.tares}
    if not known:
        return tuple(data)
    ambient = identity.ambient_pressure_pa
    pressures = {side: [getattr(s, f"pressure_{side}_pa") for d in data for s in d.sides.values()] for side in known}
    spans = {side: _span(np.abs(np.array(values) - ambient)) for side, values in pressures.items() if values}
    return tuple(_without(d, known, identity, spans) for d in data)


def _span(gauge_pa: Array) -> float:
    largest = float(gauge_pa.max())
    return float(USUAL_RANGES_PA[np.searchsorted(USUAL_RANGES_PA, largest)]) if largest <= 1e7 else largest


def _without(d: CycleData, zeros: dict[str, PressureZero], identity: Identity, spans: dict[str, float]) -> CycleData:
    area = {"a": identity.area_a_m2, "b": -identity.area_b_m2}
    off = {side: zero.at(d.plan.block) for side, zero in zeros.items()}
    force = sum(area[side] * value for side, value in off.items())
    if not d.sides:
        return replace(d, standing_n=d.standing_n - force) if d.standing_pressures else d
    shown = {f"pressure_{side}_pa": value for side, value in off.items()}
    sides = {
        direction: replace(
            side,
            balance_n=side.balance_n - force,
            air_n=side.air_n - force,
            **{name: getattr(side, name) - value for name, value in shown.items()},
        )
        for direction, side in d.sides.items()
    }
    variance = d.u_offset_n**2
    for side in zeros:
        channel = f"pressure_{side}_pa"
        if channel in identity.limits:
            continue  # already counted by its reading
        gauge = np.mean([getattr(s, channel) for s in sides.values()]) - identity.ambient_pressure_pa
        left = identity.accuracy[channel] * abs(area[side]) * min(abs(float(gauge)) / spans[side], 1.0)
        variance += left**2 - d.u_pressures_n[side] ** 2
    return replace(d, sides=sides, u_offset_n=float(np.sqrt(max(variance, 0.0))))
