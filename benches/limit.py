"""Distance from the limit of a core: operations of a run over its time, compared with a loop of multiply-adds.

``python -m benches.limit`` prints only the table. The operations of a step attempt were counted once with a counting
number type, for the equations of the reference drive with their Jacobian, its elimination and all stages. An addition,
a multiplication, a division, a root and a comparison count as 1, a fused multiply-add as 2. Events and samples, the
other work of a run, are not included. The limit is measured in the same run by `limit.rs`.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from benches import ensemble, servo
from benches.problem import CASES, Case
from benches.solvers.ours import Pneudrive, motion
from benches.tables import text
from pneudrive.simulation.session import Session

#: Operations of an attempt by Rodas5P, and by Rodas3, which a servo's samples take.
RODAS5P, RODAS3 = 2630, 1065
LOOP = Path(__file__).with_name("limit.rs")
HEAD = ("run", "attempts", "Mflop", "Gflop/s", "share of the limit")


@lru_cache(maxsize=1)
def peak() -> float:
    """Return operations per second of one core, from a loop without other work."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "limit"
        subprocess.run(["rustc", "-O", "-C", "target-cpu=native", str(LOOP), "-o", str(program)], check=True)
        return float(subprocess.run([program], check=True, capture_output=True, text=True).stdout)


def attempts(case: Case, tol: float) -> int:
    """Return the attempts at a step of a case."""
    core = Pneudrive().drive
    if case.servo is None:
        return core.simulate(*motion(case), tol)["statistics"]["factorisations"]
    session = Session(core.start(case.data["initial"], tol))
    session.control(servo.compiled(*case.servo.gains), case.servo.period, case.data["duration_s"])
    return session.statistics["factorisations"]


def measure(cases: Mapping[str, tuple[float, float]]) -> list[tuple[str, ...]]:
    """Return the rows of the table.

    Parameters
    ----------
    cases : mapping
        Name of a case -> tolerance and milliseconds.
    """
    found = []
    for case in CASES:
        if case.name in cases:
            tol, milliseconds = cases[case.name]
            flops = RODAS5P if case.servo is None else RODAS3
            found.append(_row(f"case {case.name} at {tol:g}", attempts(case, tol), flops, 1e-3 * milliseconds))
    n = 2000
    seconds, outcome = _timed(lambda: ensemble.outcome(n, 1))
    found.append(_row(f"ensemble, {n} members, one core", outcome["attempts"], RODAS5P, seconds))
    return [*found, ("loop of multiply-adds, one core", "", "", f"{1e-9 * peak():.3g}", "1")]


def _row(name: str, count: int, flops: int, seconds: float) -> tuple[str, ...]:
    rate = count * flops / seconds
    return name, str(count), f"{1e-6 * count * flops:.3g}", f"{1e-9 * rate:.3g}", f"{rate / peak():.2g}"


def _timed(solve: Callable[[], Any]) -> tuple[float, Any]:
    """Return the least processor time of three calls, and the result of the last one."""
    solve()
    times = []
    for _ in range(3):
        begun = time.process_time()
        found = solve()
        times.append(time.process_time() - begun)
    return min(times), found  # pyright: ignore[reportPossiblyUnboundVariable]


if __name__ == "__main__":
    ours = Pneudrive()
    each = {}
    for case in CASES:
        tol = 1e-3 if case.servo else 1e-4
        each[case.name] = (tol, 1e3 * _timed(lambda case=case, tol=tol: ours.bare(case, tol))[0])
    print(text(HEAD, measure(each)))
