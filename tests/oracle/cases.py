"""The drives of the golden trajectories, and the tables from which trials draw others.

Each file of `tests/golden` is a case: its description says what it stresses. All values are chosen for the tests
("assumed"): they are typical of their size, and of no product.
"""

from __future__ import annotations

import copy
import json
from pathlib import Path

from oracle.model import Json

GOLDEN = Path(__file__).resolve().parent.parent / "golden"
CASES: dict[str, Json] = {path.stem: json.loads(path.read_text("utf-8")) for path in sorted(GOLDEN.glob("*.json"))}
AMBIENT_PA = 1.013e5
ROOM_K = 293.15


def reference_drive() -> Json:
    """Return the rodless reference drive: 25 mm bore, 500 mm stroke, LuGre friction."""
    return copy.deepcopy(CASES["case_a"]["drive"])


def lugre(
    coulomb: float,
    breakaway: float,
    velocity: float,
    viscous: float,
    stiffness: float,
    damping: float,
    exponent: float = 2.0,
) -> Json:
    """Return the parameter table of `lugre` (SI)."""
    return {
        "coulomb": coulomb,
        "breakaway": breakaway,
        "stribeck_velocity": velocity,
        "stribeck_exponent": exponent,
        "viscous": viscous,
        "bristle_stiffness": stiffness,
        "bristle_damping": damping,
    }


def stribeck(coulomb: float, breakaway: float, velocity: float, viscous: float, exponent: float = 2.0) -> Json:
    """Return the parameter table of `stribeck` (SI)."""
    table = lugre(coulomb, breakaway, velocity, viscous, 0.0, 0.0, exponent)
    return {name: value for name, value in table.items() if not name.startswith("bristle")}


def at(position_m: float, pressure_a: float, pressure_b: float, t_a: float = ROOM_K, t_b: float = ROOM_K) -> Json:
    """Return an initial state at rest."""
    return {
        "position_m": position_m,
        "velocity_m_s": 0.0,
        "pressure_a_pa": pressure_a,
        "temperature_a_k": t_a,
        "pressure_b_pa": pressure_b,
        "temperature_b_k": t_b,
    }


def motion(
    drive: Json,
    commands: list[tuple[float, float]],
    duration: float,
    initial: Json,
    rate: float = 1000.0,
    bound_um: float = 1.0,
) -> Json:
    """Return one case; `bound_um` is the position error that the product may have."""
    return {
        "drive": drive,
        "commands": [list(entry) for entry in commands],
        "duration_s": duration,
        "sample_rate_hz": rate,
        "initial": initial,
        "position_bound_um": bound_um,
        "pressure_bound": 1e-4,
    }
