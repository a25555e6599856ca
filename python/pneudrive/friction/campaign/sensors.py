"""Sensors from cycles at rest: gain of the force sensor by known weights, zeros of the pressures by zero runs.

In an open zero run, both chambers should show ambient pressure.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.budget import USUAL_RANGES_PA
from pneudrive.friction.campaign.cycles import mean_of_sides

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.friction.campaign.cycles import CycleTable
    from pneudrive.rig.interface import Identity

    Array = NDArray[np.float64]

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


def sensor_gain(identity: Identity, weights: CycleTable, tares: CycleTable) -> Gain:
    """Compare the readings of the sensor under known weights with its readings when released.

    If a weight pulls the piston in +x, the rig holds it back, and the sensor shows less by this force.
    """
    weights = weights.at(weights["weight_n"] != 0.0)
    count = len(weights)
    if not count or not len(tares):
        return Gain()
    near = tares.at(np.abs(tares["index"] - weights["index"][:, None]).argmin(axis=1))
    values = (near["standing_n"] - weights["standing_n"]) / weights["weight_n"] - 1.0
    variances = (weights["standing_stderr_n"] ** 2 + near["standing_stderr_n"] ** 2) / weights["weight_n"] ** 2
    measured = float(np.mean(values))
    scatter = float(np.var(values, ddof=1)) / count if count > 1 else 0.0
    stderr = float(np.sqrt(max(float(np.mean(variances)) / count, scatter)))
    if abs(measured) > PLAUSIBLE:
        return Gain(0.0, float("nan"), measured, stderr, count, plausible=False)
    prior = stated_gain(identity)
    if prior is None:
        return Gain(measured, stderr, measured, stderr, count)
    total = float(np.hypot(prior, stderr))
    if abs(measured) > SURPRISE * total:
        return Gain(measured, stderr, measured, stderr, count, surprising=True)
    share = prior**2 / total**2 if total > 0 else 0.0
    return Gain(share * measured, float(np.sqrt(share)) * stderr, measured, stderr, count)


def stated_gain(identity: Identity) -> float | None:
    """Return the relative gain error that calibration or stated accuracy allow; None if nothing is stated."""
    if identity.force_calibration is not None:
        return identity.force_calibration.u_gain
    if "force_n" not in identity.accuracy or "force_n" not in identity.limits:
        return None
    return identity.accuracy["force_n"] / max(abs(v) for v in identity.limits["force_n"])


def corrected(cycles: CycleTable, gain: Gain) -> CycleTable:
    """Correct the gain of cycles, and replace the stated uncertainty by the remaining one."""
    if not np.isfinite(gain.stderr):
        return cycles
    force, factor, air = cycles["force_n"], 1.0 + gain.error, cycles["air_n"]
    single = np.abs(np.nan_to_num(force)).sum(axis=1)
    half_difference = np.where(cycles.moves.all(axis=1), np.abs(force[:, 0] - force[:, 1]) / 2.0, single)
    left = gain.stderr * half_difference
    growing = (left, np.nan_to_num(cycles["force: creep"]), cycles["u_air_n"])
    return cycles.having(
        balance_n=air + (cycles["balance_n"] - air) / factor,
        force_n=force / factor,
        standing_n=cycles["standing_n"] / factor,
        u_gain_n=np.sqrt(sum(u**2 for u in growing)),
        assumed=np.zeros(len(cycles), dtype=bool),
        **{"force: gain": np.where(np.isfinite(cycles["force: gain"]), left, np.nan)},
    )


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
        Number of usable zero runs.
    far, unsteady : dict
        Key of an unusable zero run -> its deviation from ambient, and its change, Pa.
    """

    blocks: dict[int, float] = field(default_factory=dict)
    mean_pa: float = float("nan")
    stderr_pa: float = float("nan")
    tares: int = 0
    far: dict[str, float] = field(default_factory=dict)
    unsteady: dict[str, float] = field(default_factory=dict)


def pressure_zeros(identity: Identity, tares: CycleTable) -> dict[str, PressureZero]:
    """Find the zero of each transducer whose accuracy is stated, by chamber ("a", "b")."""
    found = {}
    for side in "ab":
        accuracy = identity.accuracy.get(f"pressure_{side}_pa", 0.0)
        seen = tares.at(np.isfinite(tares[f"open_{side}_pa"]))
        if accuracy > 0.0 and len(seen):
            found[side] = _zero(seen, side, identity.ambient_pressure_pa, accuracy)
    return found


def _zero(seen: CycleTable, side: str, ambient_pa: float, accuracy_pa: float) -> PressureZero:
    off, change = seen[f"open_{side}_pa"] - ambient_pa, seen[f"open_{side}_change_pa"]
    unsteady = np.abs(change) > accuracy_pa
    far = ~unsteady & (np.abs(off) > REACH * accuracy_pa)
    bad = [dict(zip(seen["key"][m].tolist(), v[m].tolist(), strict=True)) for m, v in ((far, off), (unsteady, change))]
    good = ~(far | unsteady)
    if not good.any():
        return PressureZero(far=bad[0], unsteady=bad[1])
    block = seen["block"]
    offs = {b: off[good & (block == b)] for b in dict.fromkeys(block[good].tolist())}
    values = np.concatenate(list(offs.values()))
    scatter = float(np.std(values, ddof=1)) if values.size > 1 else 0.0
    noise = np.sqrt(np.mean(np.square(seen[f"open_{side}_stderr_pa"][good])))
    stderr = float(np.hypot(noise, scatter) / np.sqrt(values.size))
    means = {b: float(np.mean(some)) for b, some in offs.items()}
    return PressureZero(means, float(np.mean(values)), stderr, values.size, *bad)


def without_zeros(cycles: CycleTable, zeros: dict[str, PressureZero], identity: Identity) -> CycleTable:
    """Subtract the zeros from cycles and zero runs: those of the block, otherwise the mean of all.

    After this correction, a zero run shows only the zero of the force sensor.

    The accuracy of a transducer is then that of its gain, which grows with the reading. If the range is not stated, the
    smallest usual range that contains the highest pressure of the campaign is assumed.
    """
    known = {side: zero for side, zero in zeros.items() if zero.tares}
    if not known or not len(cycles):
        return cycles
    area, ambient = {"a": identity.area_a_m2, "b": -identity.area_b_m2}, identity.ambient_pressure_pa
    blocks, variance = cycles["block"].tolist(), cycles["u_offset_n"] ** 2
    off = {side: np.array([zero.blocks.get(b, zero.mean_pa) for b in blocks]) for side, zero in known.items()}
    force = sum((area[side] * value for side, value in off.items()), np.zeros(len(cycles)))
    vented = np.isfinite(cycles["open_a_pa"]) | np.isfinite(cycles["open_b_pa"])
    shown = {f"pressure_{side}_pa": cycles[f"pressure_{side}_pa"] - value[:, None] for side, value in off.items()}
    for side in known:
        channel = f"pressure_{side}_pa"
        if channel in identity.limits or not cycles.moves.any():
            continue  # already counted by its reading
        span = _span(np.nanmax(np.abs(cycles[channel] - ambient)))
        share = np.minimum(np.abs(mean_of_sides(shown[channel]) - ambient) / span, 1.0)
        left = identity.accuracy[channel] * abs(area[side]) * share
        variance = variance + (left**2 - cycles[f"u_pressure_{side}_n"] ** 2)
    u_offset = np.sqrt(np.maximum(variance, 0.0))
    return cycles.having(
        **shown,
        balance_n=cycles["balance_n"] - force[:, None, None],
        air_n=cycles["air_n"] - force[:, None, None],
        standing_n=np.where(vented, cycles["standing_n"] - force, cycles["standing_n"]),
        u_offset_n=np.where(cycles.moves.any(axis=1), u_offset, cycles["u_offset_n"]),
    )


def _span(largest_pa: float) -> float:
    return float(USUAL_RANGES_PA[np.searchsorted(USUAL_RANGES_PA, largest_pa)]) if largest_pa <= 1e7 else largest_pa
