"""Gain of the force sensor from cycles in which a known weight hangs on it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.rig.interface import Hold

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.characteristics.cycle import CycleData, Side
    from pneudrive.rig.interface import Identity

SURPRISE = 3.0  # standard uncertainties between what is stated and what weights show
GROWING = ("force: gain", "force: creep")  # sources in proportion to the force
PLAUSIBLE = 0.1  # a gain that is off by more was not the sensor's: the weight was another one, or was carried


@dataclass(frozen=True)
class Gain:
    """Relative error of the force sensor's gain.

    Attributes
    ----------
    error : float
        What is taken out of the force: measured error, weighted against the stated accuracy.
    stderr : float
        Standard uncertainty of what is left; NaN where no weight was hung on.
    measured, measured_stderr : float
        From the weights alone; NaN where there are none.
    cycles : int
    plausible : bool
    surprising : bool
        Further off than the stated accuracy and the scatter allow: the weights are then believed alone.
    """

    error: float = 0.0
    stderr: float = float("nan")
    measured: float = float("nan")
    measured_stderr: float = float("nan")
    cycles: int = 0
    plausible: bool = True
    surprising: bool = False


def sensor_gain(identity: Identity, weights: Sequence[CycleData], tares: Sequence[CycleData]) -> Gain:
    """Compare what the sensor shows under known weights with what it shows released.

    A weight that pulls the piston in +x makes the rig hold it back: the sensor shows less by that force.
    """
    if not weights or not tares:
        return Gain()
    values, variances = [], []
    for d in weights:
        force = next((s.weight_n for s in d.head.cycle.steps if isinstance(s, Hold) and s.weight_n), 0.0)
        if force == 0.0:
            continue
        tare = min(tares, key=lambda t: abs(t.head.index - d.head.index))
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
    """Relative gain error that calibration or stated accuracy allow; None where nothing is stated."""
    if identity.force_calibration is not None:
        return identity.force_calibration.u_gain
    if "force_n" not in identity.accuracy or "force_n" not in identity.limits:
        return None
    return identity.accuracy["force_n"] / max(abs(v) for v in identity.limits["force_n"])


def corrected(data: Sequence[CycleData], gain: Gain) -> tuple[CycleData, ...]:
    """Take the gain's error out of cycles, and put its remaining uncertainty in the place of the stated one."""
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


def _side(side: Side, error: float) -> Side:
    force = side.balance_n - side.air_n
    return replace(side, balance_n=side.air_n + force / (1.0 + error), force_n=side.force_n / (1.0 + error))


def _half_difference(d: CycleData) -> float:
    forces = [side.force_n for side in d.sides.values()]
    return abs(forces[0] - forces[-1]) / 2.0 if len(forces) == 2 else abs(forces[0]) if forces else 0.0
