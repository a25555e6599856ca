"""Random sensible drives, and the core against the oracle on them.

``python -m trials.random_drives [--count 20] [--seed 1]`` prints one line a drive and the worst.
"""

from __future__ import annotations

import argparse
import math
import sys
import time

import numpy as np

from oracle.cases import AMBIENT_PA, ROOM_K, at, lugre, motion, reference_drive, stribeck
from oracle.compare import difference, simulated
from oracle.integrate import run
from oracle.model import Json

BORES_M = (0.012, 0.016, 0.02, 0.025, 0.032, 0.04, 0.05, 0.063)
STANDARD_AREA = 0.25 * math.pi * 0.025**2
# A choked edge passes C rho0 R T0 of the donor's volume a second and unit of pressure, m3/(s) / (m3/(s Pa)):
# the speed of a piston is about u C times this over its area.
SPEED_FACTOR = 1.185 * 287.05 * 293.15


def random_case(seed: int) -> Json:
    """Return a drive that somebody could own, with some command steps, from a seed."""
    draw = np.random.default_rng(seed)
    drive = reference_drive()
    bore = float(draw.choice(BORES_M))
    area = 0.25 * math.pi * bore**2
    stroke = float(np.exp(draw.uniform(np.log(0.05), np.log(1.0))))
    kind = str(draw.choice(["rodless", "single-rod", "through-rod"]))
    cylinder = drive["cylinder"]
    cylinder.update(
        kind=kind,
        bore_m=bore,
        rod_diameter_m=0.0 if kind == "rodless" else bore * float(draw.uniform(0.25, 0.5)),
        stroke_m=stroke,
        dead_volume_a_m3=area * float(draw.uniform(0.01, 0.04)),
        dead_volume_b_m3=area * float(draw.uniform(0.01, 0.04)),
        moving_mass_kg=float(draw.uniform(0.5, 4.0)) * area / STANDARD_AREA,
        incline_rad=float(draw.choice([0.0, 0.0, math.radians(30), math.radians(-20), math.pi / 2, -math.pi / 2])),
        heat_transfer_w_m2_k=float(draw.uniform(0.0, 100.0)),
        wall_temperature_k=ROOM_K + float(draw.choice([0.0, 0.0, 40.0, -20.0])),
    )
    _end_stops(cylinder, area)
    drive["supply"] = {
        "pressure_pa": float(draw.uniform(4e5, 9e5)),
        "temperature_k": ROOM_K + float(draw.choice([0.0, 0.0, 60.0])),
    }
    speed = float(np.exp(draw.uniform(np.log(0.3), np.log(2.5))))
    drive["valve"].update(
        conductance_m3_s_pa=speed * area / SPEED_FACTOR,
        critical_pressure_ratio=float(draw.uniform(0.15, 0.5)),
        subsonic_index=float(draw.choice([0.5, 0.5, 0.5, 0.58])),
    )
    drive["friction"] = _friction(draw, bore)
    force = float(draw.choice([0.0, 0.0, 1.0, -1.0])) * 5e4 * area
    spring = {"stiffness_n_m": 1e5 * area / stroke, "rest_position_m": 0.5 * stroke} if draw.random() < 0.2 else None
    drive["load"] = {
        "mass_kg": float(draw.choice([0.0, 1.0, 4.0])) * area / STANDARD_AREA,
        "force_n": force,
        "spring": spring,
    }
    commands = [(0.4 * i, round(float(draw.uniform(-1, 1)), 2)) for i in range(4)]
    initial = at(
        stroke * float(draw.uniform(0.1, 0.9)),
        float(draw.uniform(AMBIENT_PA, 5e5)),
        float(draw.uniform(AMBIENT_PA, 5e5)),
    )
    return motion(drive, commands, 1.6, initial)


def _end_stops(cylinder: Json, area: float) -> None:
    """Scale the stops of the reference drive with the force on the piston."""
    for name in ("stiffness_n_m", "damping_n_s_m"):
        cylinder["end_stop"][name] *= area / STANDARD_AREA


def _friction(draw: np.random.Generator, bore: float) -> Json:
    coulomb = 1e3 * bore * float(draw.uniform(0.3, 1.3))  # N: about one a millimetre of bore
    breakaway = coulomb * float(draw.uniform(1.1, 1.9))
    velocity, exponent = float(draw.uniform(0.008, 0.05)), float(draw.choice([2.0, 2.0, 1.0, 1.4]))
    viscous = 1e3 * bore * float(draw.uniform(0.8, 3.0))
    law = str(draw.choice(["lugre", "lugre", "stribeck"]))
    if law == "lugre":
        stiffness = float(np.exp(draw.uniform(np.log(3e4), np.log(6e5))))
        damping = float(draw.uniform(0.3, 1.0)) * math.sqrt(stiffness)
        parameters = lugre(coulomb, breakaway, velocity, viscous, stiffness, damping, exponent)
    else:
        parameters = stribeck(coulomb, breakaway, velocity, viscous, exponent)
    pressure = None
    if draw.random() < 0.4:
        per_pascal = 4e-4 * bore  # 1 N/bar at 25 mm
        pressure = {"coulomb_a": per_pascal, "coulomb_b": 0.8 * per_pascal}
        pressure |= {"breakaway_a": 1.5 * per_pascal, "breakaway_b": 1.4 * per_pascal}
    return {"law": law, "parameters": parameters, "pressure": pressure}


def remembering_case(seed: int) -> Json:
    """Return the drive of a seed with elasto-plastic or LuGre friction that remembers, and slower commands."""
    case, draw = random_case(seed), np.random.default_rng([seed, 1])
    bore = case["drive"]["cylinder"]["bore_m"]
    coulomb = 1e3 * bore * float(draw.uniform(0.3, 1.0))
    stiffness = float(np.exp(draw.uniform(np.log(5e4), np.log(6e5))))
    law = str(draw.choice(["elasto-plastic", "elasto-plastic", "lugre"]))
    parameters = lugre(
        coulomb,
        coulomb * float(draw.uniform(1.1, 1.6)),
        float(draw.uniform(0.008, 0.05)),
        1e3 * bore * float(draw.uniform(0.8, 3.0)),
        stiffness,
        float(draw.uniform(0.3, 1.0)) * math.sqrt(stiffness),
    )
    if law == "elasto-plastic":
        parameters["breakaway_share"] = float(draw.uniform(0.7, 0.95))
    reach = coulomb / stiffness  # about the greatest deflection
    dwell = {
        "growth": str(draw.choice(["saturating", "log", "hyperbolic"])),
        "increment_n": coulomb * float(draw.uniform(0.05, 0.3)),
        "time_s": float(np.exp(draw.uniform(np.log(0.01), np.log(10.0)))),
        "distance_m": reach * float(draw.uniform(0.1, 2.0)),
    }
    relaxation = {
        "share": float(draw.uniform(0.1, 0.6)),
        "time_s": float(np.exp(draw.uniform(np.log(0.05), np.log(5.0)))),
        "distance_m": reach * float(draw.uniform(0.5, 5.0)),
    }
    case["drive"]["friction"] = {"law": law, "parameters": parameters, "dwell": dwell, "relaxation": relaxation}
    speeds = [1.0, 0.05, 0.0, 0.2]  # of what the seed drew
    case["commands"] = [[t, u * factor] for (t, u), factor in zip(case["commands"], speeds, strict=True)]
    case["initial"]["contact_age_s"] = float(np.exp(draw.uniform(np.log(0.01), np.log(1000.0))))
    return case


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rtol", type=float, default=1e-6)
    parser.add_argument("--remembers", action="store_true", help="with friction that ages and relaxes")
    arguments = parser.parse_args()
    worst, far = 0.0, 0
    for seed in range(arguments.seed, arguments.seed + arguments.count):
        case = remembering_case(seed) if arguments.remembers else random_case(seed)
        law, cylinder = case["drive"]["friction"]["law"], case["drive"]["cylinder"]
        started = time.perf_counter()
        want = run(case, "DOP853" if law == "stribeck" else "Radau", 1e-10)[1]
        took = time.perf_counter() - started
        got, statistics = simulated(case, arguments.rtol)
        found = difference(case, got, want)
        worst, far = max(worst, found.position_um), far + (not found.meets(case))
        size = f"{1e3 * cylinder['bore_m']:.0f}/{1e3 * cylinder['stroke_m']:.0f} mm"
        errors = f"x {found.position_um:8.3g} um, p {found.pressure:.2g}, T {found.temperature:.2g}"
        line = f"{seed:4d} {cylinder['kind']:12s} {size:12s} {law:14s} {errors}, oracle {took:.1f} s, {statistics}"
        sys.stdout.write(line + ("" if found.meets(case) else "   <-- beyond its bounds") + "\n")
        sys.stdout.flush()
    sys.stdout.write(f"worst position {worst:.3g} um, {far} of {arguments.count} beyond their bounds\n")
    sys.exit(far > 0)


if __name__ == "__main__":
    main()
