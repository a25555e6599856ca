"""Work of the solver in counts: exact, the same on every machine, and asserted by the tests.

``python -m benches.counts`` writes ``benches/counts.json``. A change there is a change of the solver. State the reason
in the changelog.
"""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import pneudrive as pn
from benches import servo
from pneudrive.describe.system import System
from pneudrive.errors import PneudriveWarning
from pneudrive.simulation.session import Session

HERE = Path(__file__).resolve().parent
GOLDEN = HERE.parent / "tests" / "golden"
SNAPSHOT = HERE / "counts.json"
TWO_DRIVES = HERE.parent / "examples" / "two_cylinders.toml"
STROKES = {"valve_l.command": "0 s: 1, 0.5 s: -1, 1 s: 1", "valve_r.command": "0 s: -1, 0.5 s: 1, 1 s: 0.3"}
TUBE = {"model": "distributed", "length": "1 m", "diameter": "4 mm", "cells": 6}
CASES = {
    "case_a": (3e-5, 1e-6),
    "case_c": (1e-3, 1e-4, 1e-6),
    "creeps": (1e-6,),
    "stribeck_creeps": (1e-6,),
    "small_bore_slams": (1e-6,),
}


def count(name: str, tol: float) -> dict[str, int]:
    """Solve a golden case and return the solver's statistics."""
    case = json.loads((GOLDEN / f"{name}.json").read_text())
    drive = System.of_drive(case["drive"]).compiled()
    if "servo" in case:
        gains = (case["servo"][key] for key in ("kp", "kd", "amplitude_m", "frequency_hz"))
        control = servo.controller(*gains, 0.5 * case["drive"]["cylinder"]["stroke_m"])
        session = Session(drive.start(case["initial"], tol))
        session.control(control, 1.0 / case["servo"]["sample_rate_hz"], case["duration_s"])
        return session.statistics
    times, commands = (list(column) for column in zip(*case["commands"], strict=True))
    plans = [("command", times, commands)]
    run = drive.simulate(plans, case["duration_s"], case["sample_rate_hz"], case["initial"], tol)
    return dict(run["statistics"])


def count_of(system: pn.Drive | pn.Circuit, command: str | dict[str, str], duration: str) -> dict[str, int]:
    """Simulate at the default tolerance and return the solver's statistics."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        return dict(pn.simulate(system, command, duration=duration).attrs["statistics"])


def counts() -> dict[str, dict[str, int]]:
    """Return the statistics of all counted cases, by case and tolerance."""
    found = {f"{name} at {tol:g}": count(name, tol) for name, tols in CASES.items() for tol in tols}
    found["two drives on a tank at 1e-06"] = count_of(pn.Circuit.load(TWO_DRIVES), STROKES, "1.5 s")
    lines = pn.Drive.load("catalogue:reference").replace({"tubing": {"a": TUBE, "b": TUBE}})
    found["case a with lines of 6 cells at 1e-06"] = count_of(lines, "0 s: 0.6, 1 s: -0.6", "2 s")
    return found


if __name__ == "__main__":
    SNAPSHOT.write_text(json.dumps(counts(), indent=1) + "\n")
    print(SNAPSHOT.read_text())
