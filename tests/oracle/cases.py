"""The drives of the golden trajectories: what they stress is said beside each.

All values are chosen for the tests ("assumed"): they are typical of their size, and of no product.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable

from oracle.model import Json

AMBIENT_PA = 1.013e5
ROOM_K = 293.15
CASES: dict[str, Callable[[], Json]] = {}


def case(build: Callable[[], Json]) -> Callable[[], Json]:
    """Register a case under its function's name."""
    CASES[build.__name__] = build
    return build


def reference_drive() -> Json:
    """Return the rodless reference drive: 25 mm bore, 500 mm stroke, LuGre friction."""
    return copy.deepcopy(
        {
            "gas": {"heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": 287.05},
            "ambient": {"pressure_pa": AMBIENT_PA, "temperature_k": ROOM_K},
            "supply": {"pressure_pa": 7.0e5, "temperature_k": ROOM_K},
            "cylinder": {
                **cylinder("rodless", 0.025, 0.0, 0.5, (1e-5, 1e-5), 2.0),
                "incline_rad": 0.0,
                "heat_transfer_w_m2_k": 30.0,
                "wall_temperature_k": ROOM_K,
                "end_stop": end_stop(1e6, 2e3, 1e-4),
                "chamber_law": "energy-balance",
            },
            "valve": {
                "kind": "proportional-5/3",
                "conductance_m3_s_pa": 2.0e-8,
                "critical_pressure_ratio": 0.3,
                "subsonic_index": 0.5,
                "linear_above": 0.999,
            },
            "friction": {"law": "lugre", "parameters": lugre(30.0, 45.0, 0.02, 40.0, 1e5, 300.0), "pressure": None},
            "load": {"mass_kg": 0.0, "force_n": 0.0, "spring": None},
        }
    )


def cylinder(kind: str, bore: float, rod: float, stroke: float, dead: tuple[float, float], mass: float) -> Json:
    """Return kind, bore, rod diameter and stroke (m), dead volumes of both chambers (m3) and moving mass (kg)."""
    table = {"kind": kind, "bore_m": bore, "rod_diameter_m": rod, "stroke_m": stroke}
    return table | {"dead_volume_a_m3": dead[0], "dead_volume_b_m3": dead[1], "moving_mass_kg": mass}


def end_stop(stiffness: float, damping: float, depth: float) -> Json:
    """Return the table of an end stop (SI)."""
    return {"stiffness_n_m": stiffness, "damping_n_s_m": damping, "damping_depth_m": depth}


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


def changed(**tables: Json) -> Json:
    """Return the reference drive with these entries of its tables replaced."""
    drive = reference_drive()
    for table, entries in tables.items():
        drive[table].update(entries)
    return drive


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


@case
def small_bore_slams() -> Json:
    """12 mm bore, 50 mm stroke: four blows at up to full opening, little dead volume."""
    drive = changed(
        cylinder=cylinder("rodless", 0.012, 0.0, 0.05, (1.5e-6, 1.2e-6), 0.25)
        | {"end_stop": end_stop(4e5, 250.0, 1e-4)},
        valve={"conductance_m3_s_pa": 2e-9, "critical_pressure_ratio": 0.35},
        friction={"parameters": lugre(4.0, 7.0, 0.015, 12.0, 3e4, 60.0)},
    )
    return motion(drive, [(0.0, 1.0), (0.25, -1.0), (0.5, 0.5), (0.75, -0.7)], 1.0, at(0.01, 2e5, 2.5e5))


@case
def single_rod_horizontal() -> Json:
    """32/12 mm single-rod cylinder with a load mass; extends, retracts, is stopped halfway by the valve."""
    drive = changed(
        cylinder=cylinder("single-rod", 0.032, 0.012, 0.2, (8e-6, 6e-6), 1.2) | {"heat_transfer_w_m2_k": 60.0},
        valve={"conductance_m3_s_pa": 8e-9, "critical_pressure_ratio": 0.28},
        friction={"parameters": lugre(35.0, 55.0, 0.012, 60.0, 3e5, 500.0)},
        load={"mass_kg": 3.8},
    )
    return motion(drive, [(0.0, 0.8), (0.6, -0.6), (1.0, 0.0), (1.4, -0.3)], 2.0, at(0.02, 1.5e5, 4e5))


@case
def single_rod_lifts() -> Json:
    """63/20 mm, standing upright (incline 90 deg) under 25 kg: lifts, lowers, hangs on a shut valve."""
    drive = changed(
        cylinder=cylinder("single-rod", 0.063, 0.02, 0.3, (4e-5, 3.5e-5), 3.0) | {"incline_rad": 0.5 * math.pi},
        valve={"conductance_m3_s_pa": 2.5e-8, "critical_pressure_ratio": 0.33},
        friction={"parameters": lugre(70.0, 105.0, 0.02, 90.0, 4e5, 900.0)},
        load={"mass_kg": 25.0},
    )
    return motion(drive, [(0.0, 0.7), (1.0, -0.35), (1.6, 0.0), (2.0, 0.5)], 2.6, at(0.05, 2.6e5, 1.6e5))


@case
def single_rod_hangs() -> Json:
    """25/10 mm, rod downwards (incline -90 deg), a constant load force, from ambient pressure."""
    drive = changed(
        cylinder=cylinder("single-rod", 0.025, 0.01, 0.16, (5e-6, 5e-6), 6.0) | {"incline_rad": -0.5 * math.pi},
        valve={"conductance_m3_s_pa": 7e-9, "critical_pressure_ratio": 0.2},
        friction={"parameters": lugre(18.0, 30.0, 0.03, 45.0, 2e5, 400.0)},
        load={"force_n": -25.0},
    )
    return motion(drive, [(0.0, -0.9), (0.7, 0.4), (1.3, -0.5)], 2.0, at(0.08, AMBIENT_PA, AMBIENT_PA))


@case
def through_rod_spring() -> Json:
    """40/16 mm through-rod on a slope of 30 deg against a spring, warm wall."""
    drive = changed(
        cylinder={
            **cylinder("through-rod", 0.04, 0.016, 0.25, (1.2e-5, 1.5e-5), 4.0),
            "incline_rad": math.radians(30.0),
            "wall_temperature_k": 330.0,
            "heat_transfer_w_m2_k": 80.0,
        },
        valve={"conductance_m3_s_pa": 1.2e-8, "critical_pressure_ratio": 0.4},
        friction={"parameters": lugre(45.0, 70.0, 0.025, 70.0, 2.5e5, 500.0)},
        load={"mass_kg": 2.0, "spring": {"stiffness_n_m": 800.0, "rest_position_m": 0.1}},
    )
    return motion(drive, [(0.0, 0.5), (0.8, -0.8), (1.6, 0.25)], 2.4, at(0.12, 3e5, 3.2e5, 300.0, 310.0))


@case
def long_stroke() -> Json:
    """40 mm bore, 1 m stroke: a long free stroke at full opening and back."""
    drive = changed(
        cylinder=cylinder("rodless", 0.04, 0.0, 1.0, (3e-5, 3e-5), 5.0),
        valve={"conductance_m3_s_pa": 2.2e-8, "critical_pressure_ratio": 0.25},
        friction={"parameters": lugre(50.0, 80.0, 0.02, 80.0, 2e5, 500.0)},
        load={"mass_kg": 5.0},
    )
    return motion(drive, [(0.0, 1.0), (1.2, -0.7)], 3.0, at(0.1, 3e5, 3e5))


@case
def hot_supply_and_wall() -> Json:
    """Supply at 370 K, wall at 350 K, surroundings at 280 K: three temperatures meet in a slamming drive."""
    drive = changed(
        ambient={"temperature_k": 280.0},
        supply={"pressure_pa": 8.0e5, "temperature_k": 370.0},
        cylinder={"heat_transfer_w_m2_k": 100.0, "wall_temperature_k": 350.0, "stroke_m": 0.3, "moving_mass_kg": 1.5},
        valve={"conductance_m3_s_pa": 1.5e-8},
    )
    return motion(drive, [(0.0, 0.9), (0.5, -0.9), (1.0, 0.4), (1.5, -0.4)], 2.0, at(0.05, 3e5, 3e5, 350.0, 350.0))


@case
def argon() -> Json:
    """Argon, a monatomic gas, through a valve whose conductance was measured with air."""
    drive = changed(
        gas={"heat_capacity_ratio": 5.0 / 3.0, "gas_constant_j_kg_k": 208.13},
        supply={"pressure_pa": 5.0e5},
        cylinder=cylinder("rodless", 0.02, 0.0, 0.25, (6e-6, 6e-6), 1.0),
        valve={"conductance_m3_s_pa": 6e-9},
        friction={"parameters": lugre(12.0, 20.0, 0.02, 25.0, 8e4, 200.0)},
    )
    return motion(drive, [(0.0, 0.8), (0.6, -0.8)], 1.4, at(0.05, 2e5, 2e5))


@case
def seal_pressure() -> Json:
    """Friction that grows with both chamber pressures, subsonic index 0.62, Stribeck exponent 1.3."""
    drive = changed(
        cylinder={"bore_m": 0.032, "stroke_m": 0.32, "moving_mass_kg": 2.5},
        valve={
            "conductance_m3_s_pa": 1e-8,
            "critical_pressure_ratio": 0.45,
            "subsonic_index": 0.62,
            "linear_above": 0.998,
        },
        friction={
            "parameters": lugre(14.0, 20.0, 0.03, 50.0, 1.5e5, 350.0, exponent=1.3),
            "pressure": {"coulomb_a": 1.6e-5, "coulomb_b": 1.1e-5, "breakaway_a": 3.0e-5, "breakaway_b": 2.2e-5},
        },
    )
    return motion(drive, [(0.0, 0.3), (0.9, -0.5), (1.6, 0.1)], 2.2, at(0.06, 3e5, 2.5e5))


@case
def faded_bristles() -> Json:
    """16/6 mm single-rod: a passive LuGre set through the fade of its bristle damping."""
    drive = changed(
        cylinder={
            **cylinder("single-rod", 0.016, 0.006, 0.1, (2.5e-6, 2e-6), 0.8),
            "end_stop": end_stop(5e5, 500.0, 2e-4),
        },
        valve={"conductance_m3_s_pa": 2.2e-9},
        friction={"parameters": lugre(7.0, 11.0, 0.01, 20.0, 6e4, 120.0) | {"damping_fade_velocity": 0.05}},
    )
    return motion(drive, [(0.0, 0.4), (0.5, -0.25), (1.1, 0.8)], 1.6, at(0.03, 2.5e5, 3e5))


@case
def creeps_and_remembers() -> Json:
    """16 mm rodless on elasto-plastic bristles that age, relax, and feel pressure, place and direction; it stops."""
    drive = changed(
        cylinder=cylinder("rodless", 0.016, 0.0, 0.2, (3e-6, 3e-6), 0.9),
        valve={"conductance_m3_s_pa": 4e-9},
        friction={
            "law": "elasto-plastic",
            "parameters": lugre(8.0, 12.0, 0.01, 25.0, 1e5, 120.0) | {"breakaway_share": 0.85},
            "pressure": {"coulomb_a": 4e-6, "coulomb_b": 3e-6, "breakaway_a": 6e-6, "breakaway_b": 5e-6},
            "dwell": {
                "growth": "saturating",
                "increment_n": 3.0,
                "time_s": 2.0,
                "exponent": 0.4,
                "distance_m": 5e-5,
                "pressure_a": 1e-6,
                "pressure_b": 2e-6,
            },
            "relaxation": {"share": 0.25, "time_s": 0.4, "distance_m": 2e-4},
            "position": {
                "harmonics": [{"period_m": 0.03, "amplitude": 0.05, "phase_rad": 0.7}],
                "slope_per_m": 0.4,
                "reference_m": 0.1,
            },
            "direction": {"positive": 1.1, "negative": 0.9},
            "side_load": {"force_n": 12.0, "coefficient": 0.08},
        },
    )
    steps = [(0.0, 0.02), (0.6, 0.0), (1.4, 0.02), (2.0, -0.03), (2.6, 0.0), (3.2, 0.6)]
    initial = at(0.05, 3e5, 3e5) | {"contact_age_s": 5.0}
    return motion(drive, steps, 3.6, initial)


@case
def valve_shut_rings() -> Json:
    """Shut valve: the piston rings on two air springs and comes to rest, sinking heat into the wall."""
    drive = changed(
        cylinder={"stroke_m": 0.4, "moving_mass_kg": 8.0, "bore_m": 0.04},
        friction={"parameters": lugre(12.0, 20.0, 0.02, 15.0, 1e5, 250.0)},
    )
    return motion(drive, [(0.0, 0.0)], 2.0, at(0.12, 6e5, 2.5e5))


@case
def many_steps() -> Json:
    """50 mm bore under thirty command steps of both signs, some of them tiny or zero."""
    drive = changed(
        cylinder=cylinder("rodless", 0.05, 0.0, 0.3, (2.5e-5, 2e-5), 6.0),
        valve={"conductance_m3_s_pa": 2e-8},
        friction={"parameters": lugre(60.0, 85.0, 0.02, 100.0, 3e5, 800.0)},
    )
    steps = [(0.1 * i, round(0.5 * math.sin(1.7 * i) * math.sin(0.37 * i), 2)) for i in range(30)]
    return motion(drive, steps, 3.0, at(0.15, 3e5, 3e5))


@case
def creeps() -> Json:
    """Stick-slip of the reference drive (LuGre) at u = 0.001: about 5 mm/s on average."""
    return motion(reference_drive(), [(0.0, 0.001)], 5.0, at(0.05, 3e5, 3e5), rate=500.0, bound_um=20.0)


@case
def stribeck_strokes() -> Json:
    """Full strokes of the reference drive with exact sticking: slams into both stops and is held there."""
    drive = changed(friction={"law": "stribeck", "parameters": stribeck(30.0, 45.0, 0.02, 40.0)})
    return motion(drive, [(0.0, 0.6), (1.0, -0.6)], 2.0, at(0.05, 3e5, 3e5))


@case
def stribeck_creeps() -> Json:
    """32/12 mm single-rod creeping with exact sticking, friction growing with pressure."""
    drive = changed(
        cylinder=cylinder("single-rod", 0.032, 0.012, 0.2, (3e-5, 3e-5), 3.0) | {"heat_transfer_w_m2_k": 50.0},
        valve={"conductance_m3_s_pa": 5e-9},
        friction={
            "law": "stribeck",
            "parameters": stribeck(20.0, 36.0, 0.015, 60.0),
            "pressure": {"coulomb_a": 1e-5, "coulomb_b": 1e-5, "breakaway_a": 1.5e-5, "breakaway_b": 1.5e-5},
        },
    )
    return motion(drive, [(0.0, 0.015), (3.0, -0.015)], 5.0, at(0.05, 3e5, 3e5), rate=500.0, bound_um=20.0)


@case
def stribeck_rings() -> Json:
    """Vertical through-rod drive on shut chambers: rings, reverses without a pause, then sticks for good."""
    drive = changed(
        cylinder=cylinder("through-rod", 0.032, 0.01, 0.3, (1e-5, 1e-5), 4.0) | {"incline_rad": 0.5 * math.pi},
        friction={"law": "stribeck", "parameters": stribeck(9.0, 14.0, 0.03, 8.0, exponent=1.0)},
    )
    return motion(drive, [(0.0, 0.0), (1.5, 0.02)], 2.5, at(0.1, 5e5, 3e5))


@case
def case_a() -> Json:
    """Full strokes of the reference drive, one second each way (case A)."""
    return motion(reference_drive(), [(0.0, 0.6), (1.0, -0.6)], 2.0, at(0.05, 3e5, 3e5))


@case
def case_c() -> Json:
    """Position control of the reference drive for 10 s, the command sampled and held at 1 kHz (case C)."""
    servo = motion(reference_drive(), [], 10.0, at(0.25, 3e5, 3e5), rate=100.0)
    del servo["commands"]
    servo["servo"] = {"kp": 8.0, "kd": 0.25, "amplitude_m": 0.1, "frequency_hz": 0.5, "sample_rate_hz": 1000.0}
    return servo
