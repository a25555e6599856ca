"""Processor time of the product's entry points: the Python call, the import, the command."""

from __future__ import annotations

import math
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from benches.problem import A
from benches.sweep import once

COMMAND = "0 s: 0.6, 1 s: -0.6"
INITIAL = "position = 50 mm, pressure_a = 3 bar abs, pressure_b = 3 bar abs"
ROUNDS = 21


def _processor(arguments: list[str]) -> float:
    """Processor time of a process and its children, s: the waiting time of a user on a quiet machine."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(arguments, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def _least(*measures: Callable[[], float]) -> list[float]:
    """Least time of several rounds, in turns, because a busy machine can only add time."""
    rounds = [[measure() for measure in measures] for _ in range(ROUNDS)]
    return [min(times) for times in zip(*rounds, strict=True)]


def measure() -> list[tuple[str, float, float]]:
    """Return (name, seconds, bound in seconds) for each entry point."""
    import pneudrive as pn

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.toml"
        path.write_text(pn.Drive.load("catalogue:reference").to_toml())
        drive = pn.Drive.load(path)
        commands = [tuple(entry) for entry in A.data["commands"]]
        initial = pn.Initial(position="50 mm", pressure_a="3 bar abs", pressure_b="3 bar abs")

        def call() -> None:
            pn.simulate(drive, command=commands, duration="2 s", initial=initial, sample_rate="1 kHz", rtol=1e-6)

        call()
        pneudrive = str(Path(sys.executable).with_name("pneudrive"))
        simulate = [pneudrive, "simulate", str(path), "--command", COMMAND, "--duration", "2 s", "--initial", INITIAL]
        simulate += ["--out", f"{folder}/run.parquet"]
        processes = (["-c", "pass"], ["-c", "import numpy"], ["-c", "import pneudrive"])
        labelled, command, bare, numpy, package = _least(
            # The processes in between leave cold caches, which do not belong to the call.
            lambda: min(once(call) for _ in range(5)),
            lambda: _processor(simulate),
            *(lambda code=code: _processor([sys.executable, *code]) for code in processes),
        )
        return [
            ("pn.simulate of case A, to a labelled data set", labelled, 0.55e-3),
            ("pneudrive simulate to Parquet", command, 0.32),  # of it about 0.12 s for the import of polars
            ("Python that imports numpy, beside it", numpy, math.inf),
            ("import pneudrive (beyond a bare interpreter)", package - bare, 0.1),
        ]
