"""Stiffness of the air spring, natural frequency and damping, from exact linearisations with the valve shut."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.datasheet.characteristic import Axis, ResultValue, characteristic, number
from pneudrive.datasheet.linear import SIDE, gas_at, linear_model

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.datasheet.plant import HeldDrive
    from pneudrive.simulation.session import Linear

    Array = NDArray[np.float64]
    from pneudrive.datasheet.characteristic import Found

FAST, SLOW = 1e6, 1e-5  # rad/s: heat does not follow, heat follows
SHARES = (0.0, 0.02, 0.05, 0.1, 0.175, 0.25, 0.375, 0.5, 0.625, 0.75, 0.825, 0.9, 0.95, 0.98, 1.0)  # of the stroke
LEVELS = (2.0, 3.0, 4.0, 5.0)  # bar absolute, as far as the supply reaches
FREQUENCIES = tuple(float(f) for f in np.geomspace(0.01, 10.0, 61))  # Hz
MASSES = (0.5, 1.0, 2.0, 4.0)  # times the moving mass
CHAMBERS, ROUNDS = 2, 3  # gas nodes without lines; times the frequency is taken at which gas in lines follows
SLOWEST = 1e-4  # rad/s: slower pairs are masses of gas that stay the same, by rounding


def dynamic_stiffness(linear: Linear, piston: str, s: complex) -> complex:
    """Return the ratio of gas force to displacement at a complex frequency s, 1/s, without the mass, N/m.

    The rows and columns of the chambers are eliminated from A.
    """
    x, v = linear.states.index(f"{piston}.position_m"), linear.states.index(f"{piston}.velocity_m_s")
    rest = [k for k in range(len(linear.states)) if k not in (x, v)]
    a, by_force = linear.A, linear.B[v, 1]
    moved = a[rest, x] + s * a[rest, v]
    follows = np.linalg.solve(s * np.eye(len(rest)) - a[np.ix_(rest, rest)], moved)
    return complex(-(a[v, x] + s * a[v, v] + a[v, rest] @ follows) / by_force)


def _at(plant: HeldDrive, position: float, pressures: Any) -> Linear:  # noqa: ANN401 - one or two
    return linear_model(plant, SIDE, position, gas_at(plant, pressures))


def adiabatic_stiffness(plant: HeldDrive, position: float, pressures: Any, times: float = 1.0) -> float:  # noqa: ANN401
    """Return the stiffness of the gas without heat exchange, N/m, at the natural frequency of a multiple of the mass.

    Gas in lines contributes as far as the lines let it flow at this frequency.
    """
    found = dynamic_stiffness(_at(plant, position, pressures), plant.piston, 1j * FAST).real
    if len(plant.nodes) == CHAMBERS:
        return found
    without_heat = _at(plant.heatless, position, pressures)
    for _ in range(ROUNDS):
        found = dynamic_stiffness(without_heat, plant.piston, 1j * math.sqrt(found / (times * plant.mass))).real
    return found


def levels_of(plant: HeldDrive, pressures: Any) -> list[float]:  # noqa: ANN401 - a sequence, or None
    """Return the pressures of a map, Pa."""
    if pressures is not None:
        return [float(gas_at(plant, pressure)[0, 0]) for pressure in pressures]
    low, high = plant.ambient[0], plant.supply_pa
    return [1e5 * p for p in LEVELS if low < 1e5 * p < high] or [0.5 * (low + high)]


@characteristic(
    "stiffness",
    algorithm="exact linearisation by the core without friction; states of the chambers eliminated at a frequency",
    cites=("bejan2016",),
    x="position",
    y="adiabatic_stiffness",
)
def _stiffness(plant: HeldDrive, pressures: Any = None) -> Found:  # noqa: ANN401
    """Stiffness of the air spring.

    Force over displacement of the piston with a shut valve, both chambers at one pressure and at wall temperature.
    A fast motion is without heat exchange, a slow one at the temperature of the wall.

    Settings
    --------
    pressures
        absolute pressures; default: 2, 3, 4, 5 bar abs below the supply
    """
    positions = [share * plant.stroke_m for share in SHARES]
    levels = levels_of(plant, pressures)
    models = [[_at(plant, x, p) for p in levels] for x in positions]
    fast = [[adiabatic_stiffness(plant, x, p) for p in levels] for x in positions]
    slow = [[dynamic_stiffness(one, plant.piston, 1j * SLOW).real for one in row] for row in models]
    middle = _at(plant, 0.5 * plant.stroke_m, levels[min(1, len(levels) - 1)])
    over = np.asarray([dynamic_stiffness(middle, plant.piston, 2j * math.pi * f) for f in FREQUENCIES])
    loss = np.imag(over) / np.real(over)
    axes = {
        "position": Axis(positions, "m", "position of the piston"),
        "pressure": Axis(levels, "Pa", "absolute pressure in both chambers"),
        "frequency": Axis(FREQUENCIES, "Hz", "frequency"),
    }
    grid = ("position", "pressure")
    return axes, {
        "adiabatic_stiffness": ResultValue(grid, fast, "N/m", "fast: gas without heat exchange, valve shut"),
        "isothermal_stiffness": ResultValue(grid, slow, "N/m", "slow: gas at the temperature of the wall, valve shut"),
        "stiffness": ResultValue(
            ("frequency",),
            np.real(over),
            "N/m",
            f"real part at mid stroke, {1e-5 * levels[min(1, len(levels) - 1)]:g} bar",
        ),
        "loss_factor": ResultValue(("frequency",), loss, "1", "imaginary over real part of the stiffness"),
        "largest_loss_factor": number(loss.max(), "1", "its largest value"),
        "loss_frequency": number(FREQUENCIES[int(loss.argmax())], "Hz", "where it is largest"),
    }


@characteristic(
    "natural-frequency",
    algorithm="square root of adiabatic stiffness over mass; eigenvalues of the exact linearisation",
    x="position",
    y="natural_frequency",
)
def _frequency(plant: HeldDrive, pressures: Any = None) -> Found:  # noqa: ANN401
    """Natural frequency and damping.

    The moving mass is on the air spring with the valve shut and both chambers at one pressure. The damping
    includes the viscous part of the friction and the heat of the wall. Below breakaway the bristles add their
    stiffness.

    Settings
    --------
    pressures
        absolute pressures; default: 2, 3, 4, 5 bar abs below the supply
    """
    positions = [share * plant.stroke_m for share in SHARES]
    levels = levels_of(plant, pressures)
    bare = np.array([[adiabatic_stiffness(plant, x, p) for p in levels] for x in positions])
    modes = np.array(
        [[_mode(linear_model(plant, SIDE, x, gas_at(plant, p), friction="sliding")) for p in levels] for x in positions]
    )
    axes = {
        "position": Axis(positions, "m", "position of the piston"),
        "pressure": Axis(levels, "Pa", "absolute pressure in both chambers"),
        "mass": Axis([k * plant.mass for k in MASSES], "kg", "moving mass"),
    }
    grid = ("position", "pressure")
    half = 0.5 * plant.stroke_m
    by_mass = [
        [math.sqrt(adiabatic_stiffness(plant, half, p, m) / (m * plant.mass)) / (2.0 * math.pi) for p in levels]
        for m in MASSES
    ]
    return axes, {
        "natural_frequency": ResultValue(
            grid,
            np.sqrt(bare / plant.mass) / (2.0 * math.pi),
            "Hz",
            "natural frequency of the mass on the air spring without friction and heat exchange, valve shut",
        ),
        "mode_frequency": ResultValue(
            grid, modes[:, :, 0], "Hz", "size of the eigenvalue pair, with sliding friction and heat; 0 if overdamped"
        ),
        "damping_ratio": ResultValue(grid, modes[:, :, 1], "1", "of that pair"),
        "frequency_by_mass": ResultValue(
            ("mass", "pressure"), by_mass, "Hz", "natural frequency at mid stroke with other masses"
        ),
    }


def _mode(linear: Linear) -> tuple[float, float]:
    """Return frequency, Hz, and damping ratio of the slowest oscillating pair; zero and 1 if nothing oscillates."""
    pairs = [one for one in np.linalg.eigvals(linear.A) if one.imag > max(1e-6 * abs(one), SLOWEST)]
    if not pairs:
        return 0.0, 1.0
    slowest = min(pairs, key=abs)
    return abs(slowest) / (2.0 * math.pi), -slowest.real / abs(slowest)


_PRESSURES = {"pressures": (None, "absolute pressures; default: 2, 3, 4, 5 bar abs below the supply")}
