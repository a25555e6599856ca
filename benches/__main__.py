"""``make bench``: every solver at its sufficient tolerance, all in one run.

Prints tables with ratios, writes ``out/bench/results.json`` and ``out/bench/results.md``.  Times never fail: the exit
status does not depend on them.  ``make record`` makes the written figures those of the pages (`benches.record`).
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
import warnings
from collections.abc import Sequence
from importlib.metadata import version
from importlib.util import find_spec
from math import inf
from pathlib import Path
from typing import Any

from benches import doors, ensemble, growth, identify, limit, page, tables
from benches.problem import CASES, GRID
from benches.quoted import OUT
from benches.sweep import Entry, interleave

ROUNDS = {"A": 21, "B": 21, "C": 3}
COMPILED = "numbalsoda LSODA"
# Promised speed-up: at least this factor compared with ...
GOALS = [
    ("A", COMPILED, 3.0),
    ("B", COMPILED, 3.0),
    ("C", COMPILED, 25.0),
    ("A", "pydiffsol BDF (LLVM)", 5.0),
    ("A", "scikit-sundae CVODE, Numba rhs", 50.0),
    ("A", "SciPy LSODA (solve_ivp), Numba rhs", 60.0),
    ("C", "pydiffsol BDF (LLVM)", 40.0),
]
FIT_GOAL = ("SciPy odeint, Python rhs, 1e-09", 100.0)
PACKAGES = ("numpy", "scipy", "numba", "pydiffsol", "scikit-sundae", "casadi", "diffrax", "jax", "numbalsoda")


def solvers(peers_only: bool) -> list[Any]:
    """Return ours and every peer, compiled; numbalsoda where a Fortran compiler has built it."""
    from benches.solvers import casadi, diffrax, diffsol, lsoda, rhs, sundae

    compiled, plain = rhs.numba_derivative(), rhs.python_derivative
    peers = [
        diffsol.Diffsol(),
        sundae.Sundae("scikit-sundae CVODE, Numba rhs", compiled),
        sundae.Sundae("scikit-sundae CVODE, Python rhs", plain, slow=True),
        lsoda.SolveIvp("SciPy LSODA (solve_ivp), Numba rhs", compiled),
        lsoda.SolveIvp("SciPy LSODA (solve_ivp), Python rhs", plain, slow=True),
        lsoda.OdeInt("SciPy LSODA (odeint), Numba rhs", compiled),
        lsoda.OdeInt("SciPy LSODA (odeint), Python rhs", plain, slow=True),
        lsoda.Radau("SciPy Radau, Numba rhs", compiled, slow=True),
        casadi.CasadiCvodes(),
        diffrax.Diffrax(3),
        diffrax.Diffrax(5),
    ]
    if find_spec("numbalsoda"):
        from benches.solvers import numbalsoda

        peers += [numbalsoda.NumbaLsoda(), numbalsoda.Compiled()]
    if peers_only:
        return peers
    from benches.solvers import ours

    return [ours.Pneudrive(), ours.Called(), ours.Columns(), *peers]


def machine() -> dict[str, Any]:
    """Return the data that a reader needs to judge the seconds."""
    cpu = platform.processor()
    info = Path("/proc/cpuinfo")
    if info.exists():
        cpu = next(
            (line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if "model name" in line), cpu
        )
    return {
        "cpu": cpu,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in PACKAGES if find_spec(name.replace("scikit-sundae", "sksundae"))},
    }


def measured(peers_only: bool, rounds: dict[str, int]) -> list[Entry]:
    """Sweep the tolerances, then time every entry, one after the other."""
    entries = [
        Entry(solver.name, case, solver.solve, solver.bare)
        for solver in solvers(peers_only)
        for case in CASES
        # thousands of segments with a Python right-hand side take minutes
        if case.servo is None or not solver.slow
    ]
    for entry in entries:
        entry.run_sweep(GRID)
    for case, n in rounds.items():
        interleave([e for e in entries if e.case.name == case], n)
    return entries


Table = tuple[Sequence[str], Sequence[Sequence[str]]]


def report(
    entries: list[Entry],
    more: Sequence[Table],
    waits: list[tuple[str, float, float]],
    fits: Sequence[identify.Compared],
) -> tuple[str, str]:
    """Return the report for the terminal and as Markdown: cases, further tables, goals."""
    printed, marked = [], []
    for case in CASES:
        title, body = case.title, tables.rows(entries, case.name)
        printed += [title, tables.text(tables.HEAD, body), ""]
        marked += [f"**{title}**", "", tables.markdown(tables.HEAD, body), ""]
    goals = [
        (f"case {case}: {name}", f"{found:.3g}", f">= {goal:g}", _met(found >= goal))
        for case, name, goal in GOALS
        if (found := tables.ratio(entries, case, name)) is not None
    ]
    goals += [
        (f"output-error fit: {one.name}", f"{one.ratio:.3g}", f">= {FIT_GOAL[1]:g}", _met(one.ratio >= FIT_GOAL[1]))
        for one in fits
        if one.name == FIT_GOAL[0]
    ]
    goals += [
        (what, f"{1e3 * took:.3g} ms", *(("", "") if bound == inf else (f"< {1e3 * bound:g} ms", _met(took < bound))))
        for what, took, bound in waits
    ]
    for head, body in more:
        printed += [tables.text(head, body), ""]
        marked += [tables.markdown(head, body), ""]
    head = ("goal", "measured", "wanted", "met")
    printed += [tables.text(head, goals)]
    marked += [tables.markdown(head, goals), ""]
    return "\n".join(printed), "\n".join(marked)


def _met(met: bool) -> str:
    return "yes" if met else "NO"


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benches", description=__doc__)
    parser.add_argument("--peers-only", action="store_true", help="leave the product out; writes nothing")
    parser.add_argument("--quick", action="store_true", help="3 rounds instead of 21; writes nothing")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # LSODA warns at every tolerance that it refuses; the table says so
    started = time.perf_counter()
    entries = measured(arguments.peers_only, {"A": 3, "B": 3, "C": 1} if arguments.quick else ROUNDS)
    waits = [] if arguments.peers_only else doors.measure()
    more: list[Table] = []
    fits: list[identify.Compared] = []
    if not arguments.peers_only:
        members = ensemble.measure()
        share = ("all cores, beside as many processes", f"{ensemble.share_of_processes():.3g}", "")
        fits = identify.measure()
        own = {e.case.name: (e.loosest, e.milliseconds(e.loosest)) for e in entries if e.solver == tables.OURS}
        timed = {case: (tol, took) for case, (tol, took) in own.items() if tol is not None and took is not None}
        more = [
            (ensemble.HEAD, [*members, share]),
            (growth.HEAD, growth.measure()),
            (identify.HEAD, identify.rows(fits)),
            (limit.HEAD, limit.measure(timed)),
            (page.HEAD, page.measure()),
        ]
    printed, marked = report(entries, more, waits, fits)
    took = time.perf_counter() - started
    print(printed + f"\n\n{took:.0f} s in all")
    if arguments.quick or arguments.peers_only:
        return
    results = {
        "machine": machine(),
        "rounds": ROUNDS,
        "entries": [entry.as_json() for entry in entries],
        "tables": [[head, *body] for head, body in more],
        "doors_s": {what: float(f"{seconds:.4g}") for what, seconds, _ in waits},
    }
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "results.json").write_text(json.dumps(results, indent=1) + "\n")
    cpu = f"{machine()['cpu']}, {machine()['cores']} cores"
    note = (
        f"{cpu}; processor time of one trajectory, median of interleaved rounds "
        f"({', '.join(f'{n} of {case}' for case, n in ROUNDS.items())}).\n"
        "Each solver, ours too, at the loosest tolerance at which it and every tighter one of "
        f"{GRID[0]:g} .. {GRID[-1]:g}\nstay within 1 um and 1e-4 of the golden trajectory."
    )
    (OUT / "results.md").write_text(f"<!-- written by `make bench` -->\n{note}\n\n{marked}")


if __name__ == "__main__":
    main()
