"""Random drives of every law, sensible ones and corners, and what each run of them must keep.

``python -m trials.random_runs [--count 20000] [--seed 1] [--first 0]`` runs them through `pneudrive.simulate`,
prints what broke a rule and a table by law. A run is given by (seed, number): the odd numbers are corners.
``--lines`` gives a third of the drives tubes or flow controls. ``--compared 20`` runs every 20th sensible drive at a
hundredth of its tolerance too; the runs differ by at most `MOST_APART`.

Rules: a sensible drive runs to its end. A corner may stop, with a reason. No run raises another exception than
`SimulationError`. Every sample is finite and inside the physics. Friction at rest is at most the breakaway force,
within the error of the run. Mass closes to 1e-9, and energy to 1e-3 or to 300 times the tolerance of the run, whichever
is more. No run takes more than 2 s of processor.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
import warnings
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pneudrive import Drive, Initial
from pneudrive.errors import PneudriveWarning, SimulationError
from pneudrive.simulation.simulate import Run, run

AMBIENT_PA, ROOM_K, AIR = 1.013e5, 293.15, 287.05
# A choked exhaust lets a piston go at C times this over its area, m/s.
SPEED_FACTOR = 1.185 * AIR * ROOM_K
MASS_CLOSES, ENERGY_CLOSES, ENERGY_RTOL = 1e-9, 1e-3, 300.0
MOST_SECONDS, MOST_STOPPED = 2.0, 0.01
#: Largest mean distance of two runs that differ in tolerance: of the stroke, and of the highest pressure.
MOST_APART = 2e-3
#: Rounding of a sum of forces, relative to the breakaway force.
ROUNDED = 1e-9

LAWS = ("coulomb", "stribeck", "karnopp", "dahl", "bouc-wen", "lugre", "elasto-plastic")
LAWS += ("armstrong", "gms", "rate-and-state", "film-lugre", "own")
BRISTLES = ("dahl", "bouc-wen", "lugre", "elasto-plastic")
OWN_LAW = {
    "name": "smooth",
    "title": "Stribeck friction without a jump",
    "parameters": {
        "Fc": {"unit": "N", "above": 0},
        "Fs": {"unit": "N", "above": 0},
        "vs": {"unit": "m/s", "above": 0},
        "v0": {"unit": "m/s", "above": 0},
        "Fv": {"unit": "N s/m", "at_least": 0},
    },
    "output": {"force": "(Fc + (Fs - Fc)*exp(-(v/vs)^2))*tanh(v/v0) + Fv*v"},
}


@dataclass
class Case:
    """One run: the drive file's tables, the command, the start, and how it is solved."""

    sensible: bool
    drive: dict[str, Any]
    commands: list[tuple[float, float]]
    duration: float
    initial: dict[str, Any]
    rtol: float
    rate: float

    def run(self, *, ledger: bool = True) -> Run:
        """Simulate the drive without warnings."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PneudriveWarning)
            drive = Drive.model_validate(self.drive)
            start = Initial.model_validate(self.initial)
            return run(
                drive, self.commands, self.duration, initial=start, sample_rate=self.rate, rtol=self.rtol, ledger=ledger
            )


class Draw:
    """Random numbers of one case."""

    def __init__(self, seed: int, number: int) -> None:
        self.rng = np.random.default_rng([seed, number])

    def linear(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def log(self, low: float, high: float) -> float:
        return float(np.exp(self.rng.uniform(math.log(low), math.log(high))))

    def one(self, *of: Any) -> Any:
        return of[int(self.rng.integers(len(of)))]

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)


def q(value: float, unit: str) -> str:
    return f"{value!r} {unit}"


def case(seed: int, number: int) -> Case:
    """Draw case `number`; the odd ones are corners."""
    draw, sensible = Draw(seed, number), number % 2 == 0
    bore = draw.log(0.006, 0.32)
    area = 0.25 * math.pi * bore**2
    kind = draw.one("rodless", "single-rod", "through-rod")
    rod = bore * draw.linear(0.2, 0.55) if sensible else bore * draw.log(1e-3, 0.97)
    ring = area - (0.0 if kind == "rodless" else 0.25 * math.pi * rod**2)
    stroke = draw.log(max(0.005, 0.3 * bore), min(3.0, 100.0 * bore)) if sensible else draw.log(0.005, 3.0)
    supply = draw.linear(2.5e5, 11e5) if sensible else draw.log(0.2e5, 40e5)
    ambient = AMBIENT_PA if sensible or draw.chance(0.5) else draw.log(0.5e5, 1.5e5)
    push = area * abs(supply - ambient) if sensible else area * max(supply, ambient)
    speed = draw.log(0.05, 3.0) if sensible else draw.log(1e-4, 30.0)
    mass = min(max(push * draw.log(2e-4, 2e-2), 0.01), 250.0) if sensible else draw.log(0.01, 500.0)
    load = draw.one(0.0, 1.0) * min(push * draw.log(1e-3, 0.1), 500.0 - mass)
    incline = draw.one(0.0, 0.0, 0.0, 30.0, -20.0, 90.0, -90.0)
    if sensible and incline:  # what a vertical drive lifts: 70 % of its force
        load = min(load, max(0.7 * push / 9.81 - mass, 0.0))
    dead = [area * (draw.log(3e-4, 1e-2) + stroke * draw.log(3e-3, 0.2)) for _ in "ab"]
    if not sensible and draw.chance(0.5):
        dead = [area * draw.log(1e-5, 1.0) for _ in "ab"]
    gas = (
        {}
        if draw.chance(0.9)
        else draw.one(
            {"heat_capacity_ratio": 1.667, "gas_constant": "2077.1 J/(kg K)"},
            {"heat_capacity_ratio": 1.3, "gas_constant": "188.9 J/(kg K)"},
        )
    )
    cylinder: dict[str, Any] = {
        "kind": kind,
        "bore": q(bore, "m"),
        "stroke": q(stroke, "m"),
        "dead_volume": {"a": q(dead[0], "m^3"), "b": q(dead[1], "m^3")},
        "moving_mass": q(mass, "kg"),
        "incline": q(incline, "deg"),
        "heat_transfer": q(draw.one(0.0, draw.log(5.0, 200.0)), "W/(m2 K)"),
        "wall_temperature": q(draw.linear(253.0, 353.0), "K"),
    }
    if kind != "rodless":
        cylinder["rod_diameter"] = q(rod, "m")
    if draw.chance(0.1):
        cylinder["leakage"] = q(draw.log(1e-4, 0.05) * speed * area / SPEED_FACTOR, "m^3/(s Pa)")
    if not sensible and draw.chance(0.7):
        cylinder["end_stop"] = _stop(draw, push, mass + load, min(dead) / area)
    duration = draw.linear(0.5, 2.0)
    force = draw.one(0.0, 0.0, 1.0) * push * draw.linear(-0.3, 0.3) * (1.0 if sensible else draw.log(0.1, 10.0))
    drive = {
        "gas": gas,
        "ambient": {"pressure": q(ambient, "Pa abs"), "temperature": q(draw.linear(263.0, 323.0), "K")},
        "supply": {"pressure": q(supply, "Pa abs"), "temperature": q(draw.linear(263.0, 343.0), "K")},
        "cylinder": cylinder,
        "valve": {
            "kind": "proportional-5/3",
            "conductance": q(speed * ring / SPEED_FACTOR, "m^3/(s Pa)"),
            "critical_pressure_ratio": draw.linear(0.1, 0.55) if sensible else draw.log(1e-6, 0.9),
            "subsonic_index": draw.one(0.5, 0.5, draw.linear(0.4, 0.6)),
            "linear_above": draw.one(0.99, 0.999, 0.9999),
        },
        "friction": _friction(draw, push, bore, sensible=sensible),
        "load": {"mass": q(load, "kg"), "force": q(force, "N")},
    }
    if draw.chance(0.15):
        stiffness = push / stroke * (draw.log(0.05, 0.5) if sensible else draw.log(0.01, 1e3))
        drive["load"]["spring"] = {
            "stiffness": q(stiffness, "N/m"),
            "rest_position": q(draw.linear(0.0, 1.0) * stroke, "m"),
        }
    high = max(supply, 1.02 * ambient)
    initial = {
        "position": q(min(stroke * draw.one(0.0, 1.0, draw.linear(0.0, 1.0), draw.linear(0.05, 0.95)), stroke), "m"),
        "pressure_a": q(draw.linear(min(ambient, supply), high), "Pa abs"),
        "pressure_b": q(draw.linear(min(ambient, supply), high), "Pa abs"),
        "contact_age": q(draw.one(0.0, draw.log(0.01, 1e4)), "s"),
    }
    if draw.chance(0.2):
        fast = min(speed, 1.0) if sensible else draw.log(1e-9, 10.0)
        initial["velocity"] = q(draw.linear(-1.0, 1.0) * fast, "m/s")
    rtol = draw.one(1e-6, 1e-6, 1e-6, 1e-5, 1e-4, 1e-8) if sensible else draw.log(1e-9, 1e-2)
    return Case(
        sensible, drive, _commands(draw, duration), duration, initial, rtol, draw.one(200.0, 1e3, draw.log(10.0, 1e4))
    )


def with_lines(drawn: Case, seed: int, number: int) -> Case:
    """Give a third of the cases tubes or flow controls. Separate random numbers leave the drive unchanged."""
    draw, tables = Draw(seed, 10**9 + number), {}
    conductance = float(drawn.drive["valve"]["conductance"].split()[0])
    if draw.chance(1 / 3):
        bore = draw.linear(1.0, 4.0) * math.sqrt(conductance / 1e-8) * 1e-3
        tables["tubing"] = {
            side: {
                "length": q(draw.log(0.1, 5.0), "m"),
                "diameter": q(bore, "m"),
                "model": draw.one("steady", "lumped", "auto"),
            }
            for side in draw.one("a", "b", "ab")
        }
    if draw.chance(0.1):
        needle = q(conductance * draw.log(0.05, 1.0), "m^3/(s Pa)")
        tables["flow_control"] = {
            side: {"conductance": needle, "throttles": "out"} for side in draw.one("a", "b", "ab")
        }
    initial = {key: value for key, value in drawn.initial.items() if not tables or key != "contact_age"}
    return replace(drawn, drive=drawn.drive | tables, initial=initial)


def apart(drawn: Case) -> float:
    """Return the mean distance from a run at a hundredth of the tolerance, over stroke and highest pressure."""
    far, near = (replace(drawn, rtol=rtol).run(ledger=False).columns for rtol in (drawn.rtol, 0.01 * drawn.rtol))
    stroke = Drive.model_validate(drawn.drive).cylinder.stroke_m
    return max(
        float(np.mean(np.abs(far[name] - near[name]))) / (stroke if name == "position_m" else float(near[name].max()))
        for name in ("position_m", "pressure_a_pa", "pressure_b_pa")
    )


def _stop(draw: Draw, push: float, mass: float, room: float) -> dict[str, str]:
    stiffness = 10.0 * push / room * draw.log(0.5, 1e4)
    return {
        "stiffness": q(stiffness, "N/m"),
        "damping": q(2.0 * math.sqrt(stiffness * mass) * draw.log(1e-3, 10.0), "N s/m"),
        "damping_depth": q(room * draw.log(1e-4, 1.0), "m"),
    }


def _commands(draw: Draw, duration: float) -> list[tuple[float, float]]:
    """On and off, some creeping, now and then a train of short pulses, or two changes within microseconds."""
    shortest = draw.one(0.02, 0.05, 0.1, 0.002)
    steps = [0.0]
    while len(steps) < 150:
        following = steps[-1] + draw.log(shortest, 1.0 if shortest > 0.01 else 0.05)
        if following >= duration:
            break
        steps.append(following)
        if draw.chance(0.05):
            steps.append(min(following + draw.log(1e-7, 1e-4), duration))

    def size() -> float:
        return draw.one(1.0, draw.linear(-1.0, 1.0), draw.linear(-1.0, 1.0), 0.0, 0.02, 0.003, -1.0)

    return [(t, size()) for t in steps]


def _friction(draw: Draw, push: float, bore: float, *, sensible: bool) -> dict[str, Any]:
    """Draw a friction law with forces that suit the piston, and its modifiers."""
    law = draw.one(*LAWS)
    wide = 1.0 if sensible else draw.log(0.01, 100.0)
    coulomb = min(push * draw.log(0.01, 0.15), 1e4 * bore) * (1.0 if sensible else draw.log(1e-3, 5.0))
    viscous = draw.one(0.0, push * draw.log(0.02, 0.5)) * (1.0 if sensible else draw.log(1e-2, 10.0))
    breakaway = coulomb * draw.linear(1.0, 2.0 if sensible else 5.0)
    deflection = draw.log(1e-5, 3e-4) if sensible else draw.log(1e-7, 1e-2)
    stiffness = breakaway / deflection
    speed = draw.log(2e-3, 0.1) if sensible else draw.log(1e-5, 1.0)
    shared = {
        "coulomb": q(coulomb, "N"),
        "viscous": q(viscous, "N s/m"),
        "breakaway": q(breakaway, "N"),
        "stribeck_velocity": q(speed, "m/s"),
        "stribeck_exponent": draw.one(2.0, 2.0, 1.0, draw.linear(0.5, 2.0)),
        "bristle_stiffness": q(stiffness, "N/m"),
        "bristle_damping": q(stiffness * draw.log(3e-4, 3e-3) * wide, "N s/m"),
        "damping_fade_velocity": q(draw.log(0.01, 1.0), "m/s"),
        "breakaway_share": draw.linear(0.5, 0.95),
        "dead_zone": q(draw.log(1e-4, 5e-3) * (1.0 if sensible else draw.log(0.01, 10.0)), "m/s"),
        "dahl_exponent": draw.one(1.0, draw.linear(1.0, 2.0)),
        "bouc_wen_exponent": draw.one(1.0, 2.0, draw.linear(1.0, 5.0)),
        "loop_shape": draw.one(0.5, draw.linear(0.5, 1.0)),
        "memory_time": q(draw.log(1e-3, 0.1), "s"),
        "recovery_time": q(draw.log(0.01, 100.0), "s"),
        "attraction": q(coulomb * draw.log(3.0, 100.0) * wide, "N/s"),
        "direct_effect": draw.log(0.01, 0.05 if sensible else 0.5),
        "evolution_effect": draw.log(0.01, 0.1 if sensible else 0.5),
        "distance": q(deflection * draw.log(0.1, 10.0), "m"),
        "reference_velocity": q(draw.log(1e-4, 1e-2) * wide, "m/s"),
        "film_velocity": q(draw.log(5e-3, 0.2), "m/s"),
        "film_growth_time": q(draw.log(5e-3, 0.1), "s"),
        "film_decay_time": q(draw.log(0.05, 0.5), "s"),
        "film_rest_time": q(draw.log(1.0, 50.0), "s"),
        "fluid_lead_time": q(draw.one(0.0, draw.log(1e-3, 0.05)), "s"),
    }
    if law == "own":
        return {
            "law": OWN_LAW,
            "Fc": q(coulomb, "N"),
            "Fs": q(breakaway, "N"),
            "Fv": q(viscous, "N s/m"),
            "vs": q(speed, "m/s"),
            "v0": q(draw.log(1e-4, 1e-2), "m/s"),
        }
    names = KEYS[law]
    optional = ("viscous", "stribeck_exponent", "damping_fade_velocity", "breakaway_share", "fluid_lead_time")
    friction: dict[str, Any] = {"law": law} | {
        key: value for key, value in shared.items() if key in names and (key not in optional or draw.chance(0.6))
    }
    if law == "gms" and draw.chance(0.5):
        count = int(draw.linear(2, 11))
        shares = draw.rng.dirichlet(np.full(count, draw.log(0.3, 10.0)))
        each = [stiffness * draw.log(0.1, 10.0) / count for _ in shares]
        shares[-1] = 1.0 - shares[:-1].sum()
        if min(shares) > 1e-6:
            del friction["bristle_stiffness"]
            friction["elements"] = [
                {"stiffness": q(k, "N/m"), "share": s} for k, s in zip(each, shares.tolist(), strict=True)
            ]
    if law == "rate-and-state" and draw.chance(0.5):
        friction["evolution"] = draw.one("ageing", "slip")
    return friction | _dependences(draw, law, coulomb, deflection)


def _dependences(draw: Draw, law: str, coulomb: float, deflection: float) -> dict[str, Any]:
    out: dict[str, Any] = {}
    per_bar = coulomb / 8.0
    if draw.chance(0.3):
        out["pressure"] = {"coulomb": {c: q(per_bar * draw.linear(-0.1, 1.0), "N/bar") for c in "ab"}}
        if "breakaway" in KEYS[law]:
            out["pressure"]["breakaway"] = {c: q(per_bar * draw.linear(0.0, 1.5), "N/bar") for c in "ab"}
    if "breakaway" in KEYS[law] and law != "armstrong" and draw.chance(0.25):
        out["dwell"] = {
            "growth": draw.one("saturating", "log", "hyperbolic"),
            "increment": q(coulomb * draw.log(0.01, 0.5), "N"),
            "time": q(draw.log(0.01, 1e3), "s"),
            "distance": q(draw.log(5e-6, 5e-4), "m"),
        }
    if law in BRISTLES and draw.chance(0.2):
        out["relaxation"] = {
            "share": draw.linear(0.05, 0.8),
            "time": q(draw.log(0.02, 10.0), "s"),
            "distance": q(deflection * draw.log(0.3, 5.0), "m"),
        }
    if draw.chance(0.1):
        wave = {"period": q(draw.log(5e-3, 0.3), "m"), "amplitude": draw.linear(0.0, 0.2)}
        out["position"] = {"harmonics": [wave]}
        out["direction"] = {"positive": draw.linear(0.5, 1.7), "negative": draw.linear(0.5, 1.7)}
        out["side_load"] = {"force": q(coulomb, "N"), "coefficient": draw.linear(0.0, 0.2)}
    return out


def _keys() -> dict[str, set[str]]:
    from pneudrive import _core

    return {law["name"]: {p["key"] for p in law["parameters"]} for law in _core.friction_laws()} | {"own": set()}


KEYS = _keys()


@dataclass
class Outcome:
    """Result of one case: the rules that it broke, whether it stopped with a reason, and its work."""

    sensible: bool
    law: str
    broken: list[str] = field(default_factory=list)
    stopped: str = ""
    seconds: float = 0.0
    attempts: int = 0


def outcome(drawn: Case, *, compared: bool = False) -> Outcome:
    """Run a case and hold it to the rules; `compared` runs it at a tighter tolerance too."""
    law = drawn.drive["friction"]["law"]
    out = Outcome(drawn.sensible, law if isinstance(law, str) else "own")
    started = time.process_time()
    try:
        done = drawn.run()
    except SimulationError as error:
        out.stopped = str(error)
        if drawn.sensible:
            out.broken.append(f"a sensible drive stopped: {error}")
    except Exception as error:
        out.broken.append(f"{type(error).__name__}: {error}")
    else:
        out.attempts = done.provenance["statistics"]["factorisations"]
        out.broken += broken(drawn, done)
        if compared and (far := apart(drawn)) > MOST_APART:
            out.broken.append(f"{far:.1e} from the run at a hundredth of rtol = {drawn.rtol:.0e}")
    out.seconds = time.process_time() - started
    if out.seconds > MOST_SECONDS:
        out.broken.append(f"{out.seconds:.1f} s of processor")
    return out


def broken(drawn: Case, done: Run) -> list[str]:
    """Return the rules that a finished run breaks."""
    columns, out = done.columns, []
    out += [f"{name} is not finite" for name, values in columns.items() if not np.isfinite(values).all()]
    cylinder = Drive.model_validate(drawn.drive).cylinder
    x = columns["position_m"]
    if not (np.diff(columns["time_s"]) > 0.0).all() or columns["time_s"][-1] != drawn.duration:
        out.append("time does not run to the end")
    for name in ("pressure_a_pa", "pressure_b_pa", "temperature_a_k", "temperature_b_k"):
        if not columns[name].min() > 0.0:
            out.append(f"{name} = {columns[name].min():g}")
    told = "tubing" in drawn.drive and any(
        "pressed the end stop through" in line for line in done.provenance["warnings"]
    )
    if not told and not x.min() > -cylinder.dead_volume_m3.a / cylinder.area_a_m2:
        out.append(f"the piston is behind cover a: {x.min():g} m")
    if not told and not x.max() < cylinder.stroke_m + cylinder.dead_volume_m3.b / cylinder.area_b_m2:
        out.append(f"the piston is behind cover b: {x.max():g} m")
    if (
        drawn.drive["friction"]["law"] in ("coulomb", "stribeck")
        and (columns["friction_force_n"] * columns["velocity_m_s"] < 0.0).any()
    ):
        out.append("friction pushes")
    if (over := beyond_breakaway(drawn, columns)) > 0.0:
        out.append(f"friction at rest exceeds breakaway by {over:.6f} of it")
    ledger = done.provenance["ledger"]
    if not abs(ledger["mass_error"]) <= MASS_CLOSES:
        out.append(f"mass closes to {ledger['mass_error']:.1e}")
    if not abs(ledger["energy_error"]) <= max(ENERGY_CLOSES, ENERGY_RTOL * drawn.rtol):
        out.append(f"energy closes to {ledger['energy_error']:.1e} at rtol {drawn.rtol:.1e}")
    return out


def beyond_breakaway(drawn: Case, columns: Any) -> float:
    """Return by how much friction at rest exceeds the breakaway force, as a share of it, beyond the run's own error.

    Friction at rest balances the pressures, and a sample between the ends of a step has their error. Only laws that
    stick at one level are held to this rule.
    """
    friction = drawn.drive["friction"]
    acting = ("pressure", "dwell", "position", "direction", "side_load")
    if friction["law"] not in ("coulomb", "stribeck", "karnopp") or any(key in friction for key in acting):
        return 0.0
    level = float(friction.get("breakaway", friction["coulomb"]).split()[0])
    area = Drive.model_validate(drawn.drive).cylinder.area_a_m2
    push = area * max(float(columns[name].max()) for name in ("pressure_a_pa", "pressure_b_pa"))
    resting = columns["velocity_m_s"] == 0.0
    largest = float(np.abs(columns["friction_force_n"][resting]).max(initial=0.0))
    return max(largest - level * (1.0 + ROUNDED) - drawn.rtol * push, 0.0) / level


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lines", action="store_true", help="give a third of the drives tubes or flow controls")
    parser.add_argument("--compared", type=int, default=0, help="compare every Nth sensible one with a tighter run")
    parser.add_argument("--show", action="store_true", help="print the drive of each case that breaks a rule")
    arguments = parser.parse_args()
    outcomes: list[Outcome] = []
    for number in range(arguments.first, arguments.first + arguments.count):
        drawn = case(arguments.seed, number)
        drawn = with_lines(drawn, arguments.seed, number) if arguments.lines else drawn
        compared = drawn.sensible and arguments.compared and number % (2 * arguments.compared) == 0
        one = outcome(drawn, compared=bool(compared))
        outcomes.append(one)
        for what in one.broken:
            sys.stdout.write(f"{number} {'sensible' if one.sensible else 'corner'} {one.law}: {what[:400]}\n")
            if arguments.show:
                sys.stdout.write(json.dumps(drawn.__dict__, default=str) + "\n")
        sys.stdout.flush()
    for law in LAWS:
        for sensible in (True, False):
            own = [one for one in outcomes if one.law == law and one.sensible == sensible]
            seconds = sorted(one.seconds for one in own) or [0.0]
            sys.stdout.write(
                f"{law:15s} {'sensible' if sensible else 'corners':9s} {len(own):6d} runs, "
                f"median {1e3 * seconds[len(own) // 2]:7.1f} ms, worst {seconds[-1]:6.2f} s, "
                f"most attempts {max((one.attempts for one in own), default=0)}\n"
            )
    corners = [one for one in outcomes if not one.sensible]
    stopped = [one for one in corners if one.stopped]
    sys.stdout.write(
        f"{len(outcomes)} runs, {sum(bool(one.broken) for one in outcomes)} break a rule; {len(stopped)} of "
        f"{len(corners)} corners stopped (at most {MOST_STOPPED:.0%}); {sum(one.seconds for one in outcomes):.0f} s\n"
    )
    reasons = Counter(one.stopped.split(": ", 1)[-1][:70] for one in stopped)
    for reason, count in reasons.most_common(12):
        sys.stdout.write(f"{count:6d} {reason}\n")
    sys.exit(any(one.broken for one in outcomes) or len(stopped) > MOST_STOPPED * max(len(corners), 1 / MOST_STOPPED))


if __name__ == "__main__":
    main()
