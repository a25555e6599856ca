"""How much work the solver does, counted: exact, the same on every machine, and asserted by the tests.

``python -m benches.counts`` writes ``benches/counts.json``. A change there is a change of the solver:
say in the changelog why.
"""

from __future__ import annotations

import json
from pathlib import Path

from pneudrive import _core

HERE = Path(__file__).resolve().parent
GOLDEN = HERE.parent / "tests" / "golden"
SNAPSHOT = HERE / "counts.json"
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
    drive = _core.Drive(json.dumps(case["drive"]))
    if "servo" in case:
        servo = (case["servo"][key] for key in ("kp", "kd", "amplitude_m", "frequency_hz"))
        run = drive.servo(*servo, case["duration_s"], case["servo"]["sample_rate_hz"], case["initial"], tol)
    else:
        times, commands = (list(column) for column in zip(*case["commands"], strict=True))
        run = drive.simulate(times, commands, case["duration_s"], case["sample_rate_hz"], case["initial"], tol)
    return dict(run["statistics"])


def counts() -> dict[str, dict[str, int]]:
    """Return the statistics of all counted cases, by case and tolerance."""
    return {f"{name} at {tol:g}": count(name, tol) for name, tols in CASES.items() for tol in tols}


if __name__ == "__main__":
    SNAPSHOT.write_text(json.dumps(counts(), indent=1) + "\n")
    print(SNAPSHOT.read_text())
