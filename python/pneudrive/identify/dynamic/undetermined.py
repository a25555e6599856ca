"""Statements on values that recordings do not determine, with remedies."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.identify.determined import Undetermined
from pneudrive.numbers import plain
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Largest distance of a 95 % interval's end, as a share of the value, for a determined value.
LARGEST_REACH = 0.5
#: Ratio of the ends of an interval beyond which a value has no effect.
NO_EFFECT = 1e6
#: Component of a vanishing direction from which a parameter counts as part of it.
TAKES_PART = 0.3
#: Correlation above which two values are only determined together.
TOGETHER = 0.95
#: An encoder resolves bristles whose deflection before breakaway, Fs/sigma0, is at least ten of its steps.
RESOLVED_SHARE = 0.1

_REMEDIES = {
    "friction.coulomb": "record steady sliding in both directions at two speeds or more",
    "friction.viscous": "record faster sliding, and at two speeds at least",
    "friction.breakaway": "record starts from rest and speeds below the Stribeck velocity",
    "friction.stribeck_velocity": "record slow sliding, from half to three times the Stribeck velocity",
    "friction.stribeck_exponent": "record slow sliding at five speeds about the Stribeck velocity, or fix it at 2",
    "friction.bristle_stiffness": "record slow reversals with an encoder that resolves a tenth of Fs/sigma0",
    "friction.bristle_damping": "record a tap on the resting piston, or fix it",
    "friction.damping_fade_velocity": "fix it: only fast motion out of stick depends on it",
    "friction.breakaway_share": "record loads that come and go below breakaway",
    "friction.pressure.*": "change the pressure of this chamber by 1 bar, independently of the other chamber",
    "friction.direction.*": "record both directions",
    "friction.dwell.*": "record starts after stops of different length, from 0.1 s to the longest that matters",
    "friction.relaxation.*": "record holds under load after motion",
    "friction.position.*": "record over the whole stroke",
    "friction.side_load.*": "fix it: a side load has the same effect as the Coulomb force",
    "valve.conductance": "record fast motion with choked flow at a known supply pressure",
    "valve.overlap": "record motion at small and at large commands",
    "valve.critical_pressure_ratio": "record fills and releases that end near supply and ambient pressure",
    "valve.*": "measure the valve by itself (ISO 6358)",
    "cylinder.dead_volume.a": "record motion near the end of chamber a",
    "cylinder.dead_volume.b": "record motion near the end of chamber b",
    "cylinder.heat_transfer*": "record a pressure that settles with the valve shut after a fast fill",
    "cylinder.wall_temperature": "measure it",
    "cylinder.moving_mass": "record fast reversals, or weigh it",
    "load.mass": "record fast reversals, or weigh it",
    "load.force": "record both directions, slowly",
    "cylinder.incline": "measure it, or record both directions, slowly",
    "*leak*": "record pressures with the valve shut for tens of seconds",
    "supply.*": "measure it",
    "ambient.*": "measure it",
    "*.offset": "read the sensor at a known position or at ambient pressure",
    "*.gain": "calibrate the sensor",
    "*.lag": "record fast changes of this channel",
    "command.delay": "record steps of the command",
}
_ANY = "record motion that depends on it, or fix it"


def remedy_for(name: str) -> str:
    """Return the recording that would determine a value, in words."""
    plain = name.partition(" [")[0]
    return next((text for pattern, text in _REMEDIES.items() if fnmatchcase(plain, pattern)), _ANY)


def statements(
    names: list[str],
    values: Array,
    sizes: Array,
    intervals: dict[str, tuple[float, float]],
    units: Mapping[str, str],
    correlation: Array,
    weak: Array,
) -> list[Undetermined]:
    """Return statements on values that the recordings do not determine.

    Parameters
    ----------
    names, values
        Names and values of the free numbers, SI, shape (P,).
    sizes : ndarray, shape (P,)
        Reference for the width of an interval: the value, or a usual change of a value that may be zero.
    intervals : dict
        95 % intervals.
    units : mapping
        SI units.
    correlation : ndarray, shape (P, P)
    weak : ndarray, shape (w, P)
        Directions of the scaled coordinates that vanish.
    """
    out: dict[str, Undetermined] = {}
    for direction in weak:
        part = [n for n, share in zip(names, direction, strict=True) if abs(share) > TAKES_PART]
        others = {n: [m for m in part if m != n] for n in part}
        for n in part:
            if others[n]:
                reason = f"it can change together with {', '.join(others[n])} without an effect on the recordings"
                rest = f"{remedy_for(n)}; or fix {' or '.join(others[n])}"
            else:
                reason, rest = "the recordings do not depend on it", remedy_for(n)
            out.setdefault(n, Undetermined(n, reason, rest))
    for i, n in enumerate(names):
        lower, upper = intervals[n]
        if n in out or _is_sensor(n) or not max(values[i] - lower, upper - values[i]) > LARGEST_REACH * sizes[i]:
            continue
        factor, unit = readable(units[n])
        reason = f"anything from {plain(lower / factor)} to {plain(upper / factor)} {unit}".rstrip() + " fits"
        if upper > NO_EFFECT * lower > 0.0:
            reason = "the recordings do not depend on it"
        partners = [m for j, m in enumerate(names) if j != i and abs(correlation[i, j]) > TOGETHER]
        if partners:
            reason += f", which is determined only together with {', '.join(partners)}"
        out[n] = Undetermined(n, reason, remedy_for(n))
    return [out[n] for n in names if n in out]


def _is_sensor(name: str) -> bool:
    """Return whether a value is an offset or similar, which has no relative width.

    Such a value is undetermined only if its direction vanishes.
    """
    return name.partition(" [")[0].endswith((".offset", ".lag", ".gain", ".delay"))


def unresolved_damping(step_m: float, breakaway_n: float, stiffness_n_m: float) -> Undetermined | None:
    """Return a statement if the encoder does not resolve the bristles, and the damping is not determined.

    Parameters
    ----------
    step_m : float
        Resolution of the position sensor: the larger of its step and its noise.
    breakaway_n, stiffness_n_m : float
        Fs and sigma0.
    """
    deflection = breakaway_n / stiffness_n_m
    if step_m <= RESOLVED_SHARE * deflection:
        return None
    return Undetermined(
        "friction.bristle_damping",
        f"the position is known to {1e6 * step_m:.3g} um, but the bristles deflect only {1e6 * deflection:.3g} um "
        "before breakaway: the sensor must resolve a tenth of this deflection",
        f"measure the position to {1e6 * RESOLVED_SHARE * deflection:.2g} um; it is held at its start value",
    )
