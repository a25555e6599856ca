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

DRIVE = """
schema = 1
name = "Reference rodless drive"
ambient = { pressure = "1.013 bar abs", temperature = "293.15 K" }
supply = { pressure = "7 bar abs", temperature = "293.15 K" }
[cylinder]
kind = "rodless"
bore = "25 mm"
stroke = "500 mm"
dead_volume = { a = "10 cm3", b = "10 cm3" }
moving_mass = "2 kg"
incline = "0 deg"
heat_transfer = "30 W/(m2 K)"
wall_temperature = "293.15 K"
end_stop = { stiffness = "1e6 N/m", damping = "2000 N s/m", damping_depth = "0.1 mm" }
[valve]
kind = "proportional-5/3"
conductance = "2 dm3/(s bar)"
critical_pressure_ratio = 0.3
subsonic_index = 0.5
linear_above = 0.999
[friction]
law = "lugre"
coulomb = "30 N"
breakaway = "45 N"
stribeck_velocity = "20 mm/s"
stribeck_exponent = 2
viscous = "40 N s/m"
bristle_stiffness = "1e5 N/m"
bristle_damping = "300 N s/m"
"""
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
        path.write_text(DRIVE)
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
