"""Zeros of the pressure transducers from tares, in which both chambers are open: there they should show ambient."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.budget import USUAL_RANGES_PA
from pneudrive.estimate.autocorrelation import stderr_of_mean

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.characteristics.cycle import CycleData
    from pneudrive.rig.interface import Identity

    Array = NDArray[np.float64]

REACH = 5.0  # stated accuracies: what is further from ambient is no zero of a sound transducer (assumed)
SIDES = ("a", "b")


@dataclass(frozen=True)
class Standing:
    """A chamber's pressure in an open tare, Pa: mean, its standard error, and its change from one half to the other."""

    mean_pa: float
    stderr_pa: float
    change_pa: float

    @classmethod
    def of(cls, values: Array) -> Standing | None:
        """Sum the samples up; None where the pressure was not measured."""
        if np.ptp(values) == 0:
            return None
        first, second = np.array_split(values, 2)
        return cls(float(values.mean()), stderr_of_mean(values), float(second.mean() - first.mean()))


@dataclass(frozen=True)
class PressureZero:
    """Zero of the transducer of one chamber.

    Attributes
    ----------
    blocks : dict
        Block -> zero that is taken off its cycles, Pa; empty where none can be.
    mean_pa, stderr_pa : float
        Over all tares that count; standard uncertainty by noise and by how much tares differ.
    tares : int
        That count.
    far, unsteady : dict
        Key of a tare that does not count -> by how much it is off ambient, and changes, Pa.
    """

    blocks: dict[int, float] = field(default_factory=dict)
    mean_pa: float = float("nan")
    stderr_pa: float = float("nan")
    tares: int = 0
    far: dict[str, float] = field(default_factory=dict)
    unsteady: dict[str, float] = field(default_factory=dict)

    def at(self, block: int) -> float:
        """Give what is taken off a cycle of this block, Pa: the zero of its own tares, else of all."""
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


def _zero(seen: list[tuple[CycleData, Standing]], ambient_pa: float, accuracy_pa: float) -> PressureZero:
    far, unsteady = {}, {}
    blocks: dict[int, list[float]] = {}
    noise = []
    for tare, shown in seen:
        off = shown.mean_pa - ambient_pa
        if abs(shown.change_pa) > accuracy_pa:
            unsteady[tare.head.cycle.key] = shown.change_pa
        elif abs(off) > REACH * accuracy_pa:
            far[tare.head.cycle.key] = off
        else:
            blocks.setdefault(tare.head.cycle.block, []).append(off)
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
    """Take the zeros off cycles, tares as well: their zero is then that of the force sensor alone.

    Of the accuracy of a transducer, its gain is left, which grows with the reading. Where its range is not stated, it
    is the usual one that holds the highest pressure of the campaign.
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
    off = {side: zero.at(d.head.cycle.block) for side, zero in zeros.items()}
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
            continue  # counted by its reading already
        gauge = np.mean([getattr(s, channel) for s in sides.values()]) - identity.ambient_pressure_pa
        left = identity.accuracy[channel] * abs(area[side]) * min(abs(float(gauge)) / spans[side], 1.0)
        variance += left**2 - d.u_pressures_n[side] ** 2
    return replace(d, sides=sides, u_offset_n=float(np.sqrt(max(variance, 0.0))))
