"""Identification: pneudrive compared with the same fit with SciPy's LSODA and finite differences.

``python -m benches.identify`` prints the comparisons that take too long for tests, all on synthetic records:

- speed, also in `make bench`. Five friction parameters from 10 s of servo motion at 1 kHz, with 1 um and 200 Pa of
  noise, from starts 50 % off. The comparison is output error with LSODA and finite differences. One simulation with
  LSODA is timed between two fits of pneudrive. Its time is multiplied by the runs of a Gauss-Newton step (one run, and
  one for each parameter and each start value) and by pneudrive's number of steps. This favours LSODA, because single
  shooting from such starts needs more steps or fails. The time of pneudrive is the whole call, with intervals and
  limits of the model error. The comparison uses the processor time of all threads. The error of each simulation, in
  units of the noise, is listed with its time. With `odeint` at 1e-6 it exceeds the noise, and a fit by finite
  differences then has errors of many standard errors (3 s of this record: Coulomb friction by 9, viscous by 15). At
  1e-9 the fit agrees with that of pneudrive. The comparison therefore uses the tolerance of equal accuracy.
- coverage: a laboratory's noise (10 um, 2 kPa), unknown offsets of 0.5 % of full scale on all sensors, valve C and b
  free.
"""

from __future__ import annotations

import argparse
import time
import warnings
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

import pneudrive as pn
from benches.servo import controller, follow_sine
from benches.tables import text

START = {"position_m": 0.25, "velocity_m_s": 0.0} | {f"pressure_{c}_pa": 3e5 for c in "ab"}
START |= {f"temperature_{c}_k": 293.15 for c in "ab"}
UNITS = {
    "coulomb": "N",
    "breakaway": "N",
    "stribeck_velocity": "m/s",
    "viscous": "N s/m",
    "bristle_stiffness": "N/m",
}
FRICTION = [f"friction.{name}" for name in UNITS]
FACTORS = [[0.5] * 5, [1.5] * 5, [0.5, 0.5, 1.5, 1.5, 0.5], [1.5, 0.5, 0.5, 1.5, 1.5], [0.5, 1.5, 0.5, 0.5, 1.5]]
FULL_SCALE = {"position": 0.5, "pressure_a": 1e6, "pressure_b": 1e6}
OFFSET_SHARE = 0.005
STATES = 7
#: Noise of position and pressures, and share of the record that is simulated for a time.
NOISE, SHARE = (1e-6, 200.0), 0.2


def servo(drive: Any, seconds: float, noise: tuple[float, float], seed: int) -> dict[str, np.ndarray]:
    """Record a servo that follows a sine, at 1 kHz."""
    core = drive.system.compiled()
    run = follow_sine(core, controller(8.0, 0.25, 0.1, 0.5, 0.25), seconds, 1000.0, START, 1e-8)
    rng = np.random.default_rng(seed)
    columns = {name: run[name] for name in ("time_s", "command")}
    for name, size in (("position_m", noise[0]), ("pressure_a_pa", noise[1]), ("pressure_b_pa", noise[1])):
        columns[name] = run[name] + size * rng.standard_normal(len(run["time_s"]))
    return columns


def away(drive: Any, factors: np.ndarray) -> Any:
    """Return the drive with friction off by factors, breakaway at least a little above Coulomb friction."""
    values = dict(drive.friction.parameters)
    start = {name: float(values[name] * f) for name, f in zip(UNITS, factors, strict=True)}
    start["breakaway"] = max(start["breakaway"], 1.02 * start["coulomb"])
    return drive.replace({f"friction.{n}": f"{v!r} {UNITS[n]}" for n, v in start.items()})


def scipy_run(
    columns: dict[str, np.ndarray], door: str, derivative: Any, tolerance: float, share: float
) -> tuple[float, np.ndarray]:
    """Time one simulation of the record with SciPy's LSODA, from a part of it.

    Returns
    -------
    float
        Seconds of processor time for the whole record.
    ndarray, shape (n, 3)
        Position and pressures of that share.
    """
    from benches.solvers import lsoda

    solver = getattr(lsoda, door)("LSODA", derivative)
    n = round(share * (len(columns["time_s"]) - 1))
    y = np.array([0.25, 0.0, 3e5, 293.15, 3e5, 293.15, 0.0])
    states = np.empty((n + 1, STATES))
    states[0] = y
    begin = time.process_time()
    for i in range(n):
        states[i + 1] = solver.segment(
            states[i], float(columns["command"][i]), columns["time_s"][i : i + 2], tolerance
        )[-1]
    seconds = time.process_time() - begin
    return seconds / share, states[:, [0, 2, 4]]


def our_run(drive: Any, columns: dict[str, np.ndarray], rtol: float, share: float) -> np.ndarray:
    """Simulate a part of the record with the core: position and pressures, shape (n, 3)."""
    n = round(share * (len(columns["time_s"]) - 1)) + 1
    times, start = columns["time_s"][:n], np.array([[0.25, 0.0, 3e5, 293.15, 3e5, 293.15, 0.0]])
    outputs = ["position_m", "pressure_a_pa", "pressure_b_pa"]
    core = drive.system.compiled()
    asked = {"times": times, "commands": columns["command"][:n], "sample_times": times, "starts": [0]}
    return core.shoot("command", asked | {"initial": start, "outputs": outputs, "rtol": rtol})["values"]


class Compared(NamedTuple):
    """Time of a fit, s, its ratio to ours, and the error of a simulation, in units of the noise."""

    name: str
    seconds: float
    ratio: float
    off: float


def peers() -> list[tuple[str, str, Any, float]]:
    """Return name, entry point, right-hand side and tolerance: each at equal accuracy, and odeint at 1e-6."""
    from benches.solvers import rhs

    plain = rhs.python_derivative
    found = [("SciPy odeint, Python rhs", "OdeInt", plain, 1e-9), ("SciPy odeint, Python rhs", "OdeInt", plain, 1e-6)]
    if find_spec("numba"):
        found.append(("SciPy odeint, Numba rhs", "OdeInt", rhs.numba_derivative(), 1e-9))
    return [*found, ("SciPy solve_ivp (LSODA), Python rhs", "SolveIvp", plain, 1e-9)]


def measure() -> list[Compared]:
    """Fit from each of the starts, and simulate with each of the peers between two fits; medians over these rounds."""
    drive = pn.Drive.load("catalogue:reference")
    columns = servo(drive, 10.0, NOISE, 0)
    pn.identify(drive, {k: v[:300] for k, v in columns.items()}, FRICTION)  # imports
    steps, ours = [], []
    others = peers()
    for _, door, derivative, tolerance in others:
        scipy_run(columns, door, derivative, tolerance, 1e-3)  # compiles
    theirs: list[list[float]] = [[] for _ in others]
    exact, noise = our_run(drive, columns, 1e-11, SHARE), np.array([*NOISE, NOISE[1]])
    away_by = [float(np.abs((our_run(drive, columns, 1e-6, SHARE) - exact) / noise).max())]
    for factors in FACTORS:
        begun = time.process_time()
        fit = pn.identify(away(drive, np.array(factors)), columns, FRICTION)
        ours.append(time.process_time() - begun)
        steps.append(fit.statistics["iterations"])
        worst = max(abs(fit.values[f"friction.{n}"] / drive.friction.parameters[n] - 1.0) for n in UNITS)
        print(
            f"starts x {factors}: {ours[-1]:.2f} s of processor time, {steps[-1]:.0f} steps, worst parameter off by "
            f"{100 * worst:.3f} %, converged: {fit.converged}"
        )
        for (_, door, derivative, tolerance), times in zip(others, theirs, strict=True):
            one, values = scipy_run(columns, door, derivative, tolerance, SHARE)
            times.append(one)
            if len(times) == 1:
                away_by.append(float(np.abs((values - exact) / noise).max()))
    runs, base = (1 + len(UNITS) + STATES) * float(np.median(steps)), float(np.median(ours))
    found = [Compared("pneudrive (whole call)", base, 1.0, away_by[0])]
    for (name, _, _, tolerance), times, off in zip(others, theirs, away_by[1:], strict=True):
        seconds = runs * float(np.median(times))
        found.append(Compared(f"{name}, {tolerance:g}", seconds, seconds / base, off))
    return found


def rows(found: list[Compared]) -> list[tuple[str, ...]]:
    """Return the rows of a table."""
    return [(one.name, f"{one.seconds:.3g}", f"{one.ratio:.3g}", f"{one.off:.2g}") for one in found]


HEAD = ("output-error fit, 5 parameters, 10 s at 1 kHz", "s", "times ours", "a simulation is off by (noise)")


def coverage(count: int) -> None:
    """Print how often intervals hold the truth at a laboratory's noise."""
    drive = pn.Drive.load("catalogue:reference")
    free = [*FRICTION, "valve.conductance", "valve.critical_pressure_ratio"]
    true = {f"friction.{n}": drive.friction.parameters[n] for n in UNITS}
    true |= {"valve.conductance": 2e-8, "valve.critical_pressure_ratio": 0.3}
    held, named, worst = dict.fromkeys(free, 0), dict.fromkeys(free, 0), dict.fromkeys(free, 0.0)
    done = 0
    for seed in range(count):
        rng = np.random.default_rng(1000 + seed)
        columns = servo(drive, 10.0, (1e-5, 2e3), seed)
        sensors = {}
        for name, scale in FULL_SCALE.items():
            key = f"{name}_{'m' if name == 'position' else 'pa'}"
            columns[key] = columns[key] + OFFSET_SHARE * scale * rng.uniform(-1.0, 1.0)
            sensors[name] = {"offset": "free", "offset_uncertainty": OFFSET_SHARE * scale}
        start = away(drive, np.where(rng.random(5) < 0.5, 0.5, 1.5)).replace(
            {
                "valve.conductance": f"{float(2e-8 * rng.choice([0.7, 1.3]))!r} m3/(s Pa)",
                "valve.critical_pressure_ratio": float(rng.choice([0.2, 0.4])),
            }
        )
        fit = pn.identify(start, columns, free, sensors=sensors)
        lost = {u.parameter for u in fit.undetermined}
        if not fit.converged:
            print(f"seed {seed}: not converged, {sorted(lost)} named")
            continue
        done += 1
        for name in free:
            lower, upper = fit.intervals[name]
            held[name] += lower <= true[name] <= upper
            named[name] += name in lost
            worst[name] = max(worst[name], abs(fit.values[name] / true[name] - 1.0))
    for name in free:
        print(f"{name:<32} held {held[name]}/{done}, named undetermined {named[name]}, worst {100 * worst[name]:.3f} %")


def main() -> None:
    """Run the requested benches."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--coverage", type=int, default=0, help="seeds of the coverage study; 0 leaves it out")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    print(text(HEAD, rows(measure())))
    if arguments.coverage:
        coverage(arguments.coverage)


if __name__ == "__main__":
    main()
