"""Distribution of processor time: fractions for cases A, B, C and the ensemble, by kind of work.

``python -m benches.shares target/release/lib_core.so`` after ``cargo build --release -p pneudrive-python``, because the
installed core has no names of functions. It takes Linux' ``perf``, prints the table and writes ``shares.json``, which
the page "Where the time goes" shows.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from benches.tables import text

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
RATE_HZ, SECONDS = 2000, 4.0
HEAD = ("fraction of the time, %", "A", "B", "C", "ensemble")
#: What is done -> names of functions that do it; the first that fits counts.
WORK = {
    "eight members together: all of the next four": r"::within::",
    "right-hand side": r"add_rates|fused|physics::",
    "Jacobian": r"linearise|lifted",
    "elimination of W": r"ode::linear",
    "sums and products of stages": r"::attempt(_one)?$|stages",
    "error, step control": r"::error$|control|refusal|refresh|conclude|inside|approach|swing",
    "samples, events, outputs": r"dense|event|sample_times|reduction|passing|spread",
    "commands, session, lanes": r"session|servo|variables|lanes|failure_of|wiring|members|gather",
    "copies and memory": r"mem(move|cpy|set|cmp)|alloc|free|chunk|Clone|clone",
}
REST = "Python, the rest"
#: What is run and timed, in a process of its own.
LOOP = """
import sys, time
from benches import ensemble
from benches.problem import CASES
from benches.solvers.ours import Pneudrive
which, seconds, core = sys.argv[1], float(sys.argv[2]), Pneudrive()
case = {one.name: one for one in CASES}.get(which)
run = (lambda: ensemble.outcome(2000, 1)) if case is None else (lambda: core.bare(case, 1e-3 if case.servo else 1e-4))
run()
begun = time.process_time()
while time.process_time() - begun < seconds:
    run()
"""


def shares(which: str, package: Path) -> dict[str, float]:
    """Return the fraction of each kind of work in one run, %.

    Parameters
    ----------
    which : str
        Name of a case, or ``"ensemble"``.
    package : Path
        Folder with a package pneudrive whose core has names of functions.
    """
    with tempfile.NamedTemporaryFile(suffix=".data") as data:
        path = {"PYTHONPATH": f"{package}:{ROOT}", "OPENBLAS_NUM_THREADS": "1", "PATH": "/usr/bin:/bin"}
        record = ["perf", "record", "-q", "-e", "cpu-clock:u", "-F", str(RATE_HZ), "-o", data.name]
        subprocess.run([*record, sys.executable, "-c", LOOP, which, str(SECONDS)], check=True, env=path)
        report = ["perf", "report", "-i", data.name, "--stdio", "--no-children", "-F", "overhead,symbol"]
        told = subprocess.run(report, check=True, capture_output=True, text=True).stdout
    return by_work(told)


def by_work(told: str) -> dict[str, float]:
    """Sum the lines of perf's report by the purpose of the functions."""
    found = dict.fromkeys([*WORK, REST], 0.0)
    for line in told.splitlines():
        read = re.fullmatch(r"\s*([\d.]+)%\s+\[.\]\s+(.+?)\s*", line)
        if read is not None:
            work = next((work for work, names in WORK.items() if re.search(names, read[2])), REST)
            found[work] += float(read[1])
    return found


def rows(found: Mapping[str, Mapping[str, float]]) -> list[tuple[str, ...]]:
    """Return the rows of the table, from the distribution of each run's time."""
    return [(work, *(f"{found[which][work]:.0f}" for which in HEAD[1:])) for work in (*WORK, REST)]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benches.shares", description=__doc__)
    parser.add_argument("core", type=Path, help="the core as cargo builds it, with names of functions")
    core = parser.parse_args().core
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder)
        shutil.copytree(
            ROOT / "python" / "pneudrive", package / "pneudrive", ignore=shutil.ignore_patterns("_core*.so")
        )
        shutil.copy(core, package / "pneudrive" / "_core.abi3.so")
        found = {which: shares(which, package) for which in HEAD[1:]}
    (HERE / "shares.json").write_text(json.dumps({"head": HEAD, "rows": rows(found)}, indent=1) + "\n")
    print(text(HEAD, rows(found)))


if __name__ == "__main__":
    main()
