"""How long a user waits (wall time) at the product's own doors: the Python call, the import, the command."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benches.problem import CASE_A
from benches.sweep import once

COMMAND = "0 s: 0.6, 1 s: -0.6"
INITIAL = "position = 50 mm, pressure_a = 3 bar abs, pressure_b = 3 bar abs"
ROUNDS = 5


def _wall(arguments: list[str]) -> float:
    started = time.perf_counter()
    subprocess.run(arguments, check=True, capture_output=True)
    return time.perf_counter() - started


def _least(measure: Callable[[], float], rounds: int = ROUNDS) -> float:
    """Least of some rounds: what stands in the way on a busy machine only adds."""
    return min(measure() for _ in range(rounds))


def measure() -> list[tuple[str, float, float]]:
    """Return (what, seconds, bound in seconds) for each door."""
    import pneudrive as pn

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.toml"
        path.write_text(pn.Drive.load("catalogue:reference").to_toml())
        drive = pn.Drive.load(path)
        commands = [tuple(entry) for entry in CASE_A["commands"]]
        initial = pn.Initial(position="50 mm", pressure_a="3 bar abs", pressure_b="3 bar abs")

        def call(rtol: float) -> None:
            pn.simulate(drive, command=commands, duration="2 s", initial=initial, sample_rate="1 kHz", rtol=rtol)

        call(1e-6)
        pneudrive = str(Path(sys.executable).with_name("pneudrive"))
        simulate = [pneudrive, "simulate", str(path), "--command", COMMAND, "--duration", "2 s", "--initial", INITIAL]
        python, bare = [sys.executable, "-c", "import pneudrive"], [sys.executable, "-c", "pass"]
        return [
            ("pn.simulate of case A, to a labelled data set", _least(lambda: once(call, 1e-6), 21), 1e-3),
            (
                "import pneudrive (beyond a bare interpreter)",
                _least(lambda: _wall(python)) - _least(lambda: _wall(bare)),
                0.3,
            ),
            (
                "pneudrive simulate to Parquet",
                _least(lambda: _wall([*simulate, "--out", f"{folder}/run.parquet"])),
                0.6,
            ),
        ]
