"""Stability of a piston dragged through a spring: steady sliding or self-excited oscillation (stick-slip).

The spring of the rig keeps the piston at its speed unless friction falls too steeply with speed. Then rig and seal
oscillate together, and the mean force is not the friction of steady sliding. The analysis is for small disturbances;
slightly above the range, a large oscillation, once started, can persist too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.rig.core import steady_friction_n

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.rig.description import RigDescription

    Array = NDArray[np.float64]

#: Relative step of the differences that give slopes of the steady curve.
STEP = 1e-4
#: Decay, 1/s, of a state that a law lacks: too fast to be the least stable one.
ABSENT_1_S = 1e9
#: Limits of the search for a self-excited range, m/s, and number of speeds.
SEARCHED_M_S, SEARCHED = (1e-5, 1.0), 241


@dataclass(frozen=True, eq=False)  # with arrays: equal only to itself
class SlidingStability:
    """Growth and frequency of a small disturbance of steady sliding.

    Attributes
    ----------
    speed_m_s : ndarray, shape (n,)
    growth_1_s : ndarray, shape (n,)
        Growth rate; negative: the disturbance decays.
    frequency_hz : ndarray, shape (n,)
        Frequency; 0: no oscillation.
    """

    speed_m_s: Array
    growth_1_s: Array
    frequency_hz: Array

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Mask of speeds with steady sliding."""
        return self.growth_1_s < 0.0


def sliding_stability(
    friction: dict[str, Any],
    speed_m_s: float | Array,
    stiffness_n_m: float,
    damping_n_s_m: float,
    mass_kg: float,
    gauges_pa: tuple[float, float] = (0.0, 0.0),
) -> SlidingStability:
    """Linearise a dragged piston about steady sliding, and return its least stable mode.

    With u, s and z the deviations of speed, stretch of the spring and deflection of the bristles, phi that of the age
    of the contact, g(v, phi) the level of friction without its viscous part, and partial derivatives g_v, g_phi:

        ds/dt = -u,   m du/dt = K s - c u - F
        dz/dt = v/g (g_v u + g_phi phi - sigma0 z),   F = sigma0 z + sigma1(v) dz/dt + Fv u
        dphi/dt = -v/L phi - (u - dz/dt)/v

    A law without bristles has F = (g_v + Fv) u + g_phi phi. Slopes come from the core's steady curve. The air of the
    chambers is left out: its spring is soft against that of a force sensor.

    Parameters
    ----------
    friction : dict
        law, parameters (SI, names as in a drive file) and optionally pressure, dwell, ... in the core's form.
    speed_m_s : float or ndarray, shape (n,)
        > 0.
    stiffness_n_m, damping_n_s_m : float
        Stiffness and damping between the axis and the piston.
    mass_kg : float
        Mass of the piston and the parts that move with it.
    gauges_pa : (float, float)
        Gauge pressures in the chambers.

    Returns
    -------
    SlidingStability

    Examples
    --------
    >>> law = {"law": "stribeck", "parameters": {"coulomb": 30, "breakaway": 40, "stribeck_velocity": 0.012,
    ...                                          "viscous": 60}}
    >>> sliding_stability(law, [1e-4, 5e-3, 5e-2], 2e5, 0.0, 1.0).stable.tolist()
    [True, False, True]
    """
    speeds = np.atleast_1d(np.asarray(speed_m_s, dtype=np.float64))
    slopes = _Slopes.of(friction, speeds, gauges_pa)
    matrices = np.zeros((speeds.size, 4, 4))
    for i, v in enumerate(speeds):
        matrices[i] = _matrix(v, slopes, i, stiffness_n_m, damping_n_s_m, mass_kg)
    values = np.linalg.eigvals(matrices)
    worst = np.argmax(values.real, axis=1)
    chosen = values[np.arange(speeds.size), worst]
    growth = np.asarray(chosen.real, dtype=np.float64)
    return SlidingStability(speeds, growth, np.abs(chosen.imag).astype(np.float64) / (2.0 * np.pi))


def self_excited_range(
    friction: dict[str, Any],
    stiffness_n_m: float,
    damping_n_s_m: float,
    mass_kg: float,
    gauges_pa: tuple[float, float] = (0.0, 0.0),
) -> tuple[float, float] | None:
    """Return the lowest and the highest speed of unsteady sliding, m/s; None if sliding is always steady.

    The search covers 0.01 mm/s to 1 m/s and bisects the ends; parameters as for `sliding_stability`.
    """
    grid = np.geomspace(*SEARCHED_M_S, SEARCHED)

    def unstable(speeds: Array) -> NDArray[np.bool_]:
        return ~sliding_stability(friction, speeds, stiffness_n_m, damping_n_s_m, mass_kg, gauges_pa).stable

    inside = np.flatnonzero(unstable(grid))
    if not inside.size:
        return None
    ends = []
    for border, step in ((inside[0], -1), (inside[-1], 1)):
        beyond = border + step
        if not 0 <= beyond < grid.size:
            ends.append(float(grid[border]))
            continue
        within, outside = grid[border], grid[beyond]
        for _ in range(40):
            middle = np.sqrt(within * outside)
            within, outside = (middle, outside) if unstable(np.array([middle]))[0] else (within, middle)
        ends.append(float(within))
    return ends[0], ends[1]


def rig_stability(
    d: RigDescription, speed_m_s: float | Array, gauges_pa: tuple[float, float] = (0.0, 0.0)
) -> SlidingStability:
    """Apply `sliding_stability` to a simulated rig."""
    from pneudrive.rig.core import core_friction

    return sliding_stability(core_friction(d), speed_m_s, d.stiffness_n_m, d.damping_n_s_m, d.moving_mass_kg, gauges_pa)


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Friction level g, its partial derivatives, and other terms of the matrix."""

    level: Array
    by_speed: Array
    by_age: Array
    viscous: float
    bristle_stiffness: float | None
    bristle_damping: Array
    distance_m: float | None

    @classmethod
    def of(cls, friction: dict[str, Any], speeds: Array, gauges_pa: tuple[float, float]) -> _Slopes:
        parameters, dwell = friction["parameters"], friction.get("dwell")
        viscous = parameters.get("viscous", 0.0)
        young = {**friction, "dwell": None}

        def slope(table: dict[str, Any]) -> Array:
            low, high = (steady_friction_n(table, speeds * (1.0 + sign * STEP), gauges_pa) for sign in (-1.0, 1.0))
            return (high - low) / (2.0 * STEP * speeds)

        by_speed = slope(young)
        by_age = np.zeros_like(speeds)
        if dwell is not None:
            # In steady sliding the age is L/v: dF/dphi = dF/dv dv/dphi.
            by_age = -(slope(friction) - by_speed) * speeds**2 / dwell["distance_m"]
        fade = parameters.get("damping_fade_velocity", np.inf)
        return cls(
            level=steady_friction_n(friction, speeds, gauges_pa) - viscous * speeds,
            by_speed=by_speed - viscous,
            by_age=by_age,
            viscous=viscous,
            bristle_stiffness=parameters.get("bristle_stiffness"),
            bristle_damping=parameters.get("bristle_damping", 0.0) * np.exp(-((speeds / fade) ** 2)),
            distance_m=None if dwell is None else dwell["distance_m"],
        )


def _matrix(v: float, slopes: _Slopes, i: int, stiffness: float, damping: float, mass: float) -> Array:
    """Return the matrix of the states stretch, speed, bristles, age; a state that the law lacks decays."""
    force, bristle = np.zeros(4), np.zeros(4)
    level = np.array([0.0, slopes.by_speed[i], 0.0, slopes.by_age[i]])
    sigma = slopes.bristle_stiffness
    if sigma is None:
        force += level
        bristle[2] = -ABSENT_1_S
        slip = np.array([0.0, 1.0, 0.0, 0.0])
    else:
        bristle += v / slopes.level[i] * (level - np.array([0.0, 0.0, sigma, 0.0]))
        force += np.array([0.0, 0.0, sigma, 0.0]) + slopes.bristle_damping[i] * bristle
        slip = np.array([0.0, 1.0, 0.0, 0.0]) - bristle
    force[1] += slopes.viscous
    out = np.zeros((4, 4))
    out[0, 1] = -1.0
    out[1] = -force / mass
    out[1, 0] += stiffness / mass
    out[1, 1] -= damping / mass
    out[2] = bristle
    if slopes.distance_m is None:
        out[3, 3] = -ABSENT_1_S
    else:
        out[3] = -slip / v
        out[3, 3] -= v / slopes.distance_m
    return out
