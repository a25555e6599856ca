"""Numbers that pages quote: each is stored in one file, and every page reads it from there.

`docs/conf.py` makes substitutions of them for the pages of the documentation; a test compares README with them.
"""

from __future__ import annotations

import json
from pathlib import Path

#: Where a bench writes, and the figures that `make record` takes from there.
OUT = Path("out/bench")
RESULTS = Path(__file__).parent / "results.json"
#: Counts inside their intervals, and all: profile intervals of hidden tubes and drives, predictions for seals.
COVERAGE = Path(__file__).parent / "coverage.json"
#: Rows of README's table, by case, and its columns, by solver.
CASES = {
    "A": "full stroke of a drive, 2 s",
    "B": "creeping with stick-slip, 5 s",
    "C": "10 s of position control at 1 kHz",
}
SOLVERS = (
    "numbalsoda LSODA, controller in Numba",
    "scikit-sundae CVODE, Numba rhs",
    "SciPy LSODA (solve_ivp), Numba rhs",
)


def quoted() -> dict[str, str]:
    """Return the quoted numbers as texts, by name."""
    results = json.loads(RESULTS.read_text(encoding="utf-8"))
    rows = {row[0]: row for table in results["tables"] for row in table[1:]}
    exact, loose = (rows[f"SciPy odeint, Python rhs, {tolerance}"] for tolerance in ("1e-09", "1e-06"))
    counts = json.loads(COVERAGE.read_text(encoding="utf-8"))
    return {
        "fit_seconds": rows["pneudrive (whole call)"][1],
        "fit_times_exact": f"{float(exact[2]):.0f}",
        "fit_times_loose": f"{float(loose[2]):.0f}",
        "fit_error_loose": loose[3],
        "ensemble_member_us": f"{float(rows['pneudrive'][1]):.0f}",
        "simulate_ms": f"{1e3 * results['doors_s']['pn.simulate of case A, to a labelled data set']:.2f}",
    } | {f"inside_{kind}": f"{inside} of {total}" for kind, (inside, total) in counts.items()}


def speed_table() -> list[str]:
    """Return the rows of README's table: how many times longer each solver takes than pneudrive."""
    entries = json.loads(RESULTS.read_text(encoding="utf-8"))["entries"]

    def took(solver: str, case: str) -> float:
        entry = next(e for e in entries if (e["solver"], e["case"]) == (solver, case))
        return entry["milliseconds"][f"{entry['loosest_tolerance']:g}"]

    rows = []
    for case, words in CASES.items():
        times = [took(solver, case) / took("pneudrive", case) for solver in SOLVERS]
        rows.append(f"| {words} | {' | '.join(f'{t:.1f}' if t < 10 else f'{t:.0f}' for t in times)} |")
    return rows
