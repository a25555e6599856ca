"""Growth of the cost with drives on one tank, cells of lines, members, and time: fitted exponents.

``python -m benches.growth`` prints only the table. ``CIRCUITS`` are counted in ``counts.json`` as well.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import pneudrive as pn
from benches import ensemble
from benches.tables import text

CYLINDER = """
[components.{name}]
kind = "cylinder/single-rod"
bore = "32 mm"
rod_diameter = "12 mm"
stroke = "100 mm"
dead_volume = {{ a = "8 cm3", b = "8 cm3" }}
moving_mass = "1.5 kg"

[components.{name}.friction]
law = "stribeck"
coulomb = "20 N"
breakaway = "30 N"
stribeck_velocity = "20 mm/s"
viscous = "40 N s/m"

[components.valve_{name}]
kind = "valve/proportional-5/3"
conductance = "1.2 dm3/(s bar)"
critical_pressure_ratio = 0.3
"""
MAINS = """schema = 1
name = "growth"
connections = [{connections}]

[components.mains]
kind = "reservoir"
pressure = "6 bar gauge"

[components.inlet]
kind = "fitting"
conductance = "1.5 dm3/(s bar)"
critical_pressure_ratio = 0.4

[components.tank]
kind = "tank"
volume = "0.5 l"
"""
TUBE = """
[components.tube_{chamber}]
kind = "tube/distributed"
length = "1 m"
diameter = "6 mm"
cells = {cells}
"""
COMMAND = "0 s: 1, 0.5 s: -1"


def drives_on_a_tank(n: int) -> pn.Circuit:
    """Return a circuit of `n` cylinders with a valve each on one tank."""
    names = [f"c{i}" for i in range(n)]
    joints = ["mains -> inlet -> tank", *(f"tank -> valve_{name}.1" for name in names)]
    joints += [
        f"valve_{name}.{port} -> {name}.{chamber}" for name in names for port, chamber in (("4", "a"), ("2", "b"))
    ]
    return _circuit(joints, "".join(CYLINDER.format(name=name) for name in names))


def drive_with_lines(cells: int) -> pn.Circuit:
    """Return a circuit of one cylinder between two tubes of so many cells."""
    joints = ["mains -> inlet -> tank -> valve_c0.1", "valve_c0.4 -> tube_a -> c0.a", "valve_c0.2 -> tube_b -> c0.b"]
    tubes = "".join(TUBE.format(chamber=chamber, cells=cells) for chamber in "ab")
    return _circuit(joints, CYLINDER.format(name="c0") + tubes)


def _circuit(joints: Sequence[str], components: str) -> pn.Circuit:
    written = MAINS.format(connections=", ".join(f'"{joint}"' for joint in joints)) + components
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "circuit.toml"
        path.write_text(written)
        return pn.Circuit.load(path)


def simulate(circuit: pn.Circuit, duration: float = 1.0) -> dict[str, int]:
    """Run a circuit and return its work counts."""
    run = circuit.simulate(dict.fromkeys(circuit.commandable, COMMAND), duration, sample_rate="100 Hz", rtol=1e-6)
    return run.attrs["statistics"]


def _least(run: Callable[[], object]) -> float:
    """Least processor time of three calls after one, s."""
    run()
    times = []
    for _ in range(3):
        begun = time.process_time()
        run()
        times.append(time.process_time() - begun)
    return min(times)


def _servo(duration: float) -> Callable[[], object]:
    drive = pn.Drive.load("catalogue:reference")
    return lambda: pn.simulate(drive, lambda t: 0.1 * np.sin(3.0 * t), duration, sample_rate="1 kHz")


def _run(circuit: pn.Circuit) -> Callable[[], object]:
    return lambda: simulate(circuit)


#: What grows, its sizes, and what runs at one of them.
STUDIES: tuple[tuple[str, tuple[int, ...], Callable[[int], Callable[[], object]]], ...] = (
    ("drives on a tank", (1, 2, 4, 8), lambda n: _run(drives_on_a_tank(n))),
    ("cells of two lines", (4, 8, 16, 32), lambda n: _run(drive_with_lines(n))),
    ("members of an ensemble", (250, 500, 1000, 2000), lambda n: lambda: ensemble.ours(n, 1)),
    ("seconds at 1 kHz", (1, 2, 4, 8), _servo),
)
HEAD = ("cost against", "sizes", "ms", "exponent")


def measure() -> list[tuple[str, str, str, str]]:
    """Return (what grows, sizes, ms at each, fitted exponent of the cost)."""
    found = []
    for name, sizes, of in STUDIES:
        took = [_least(of(size)) for size in sizes]
        exponent = np.polyfit(np.log(sizes), np.log(took), 1)[0]
        row = (", ".join(f"{size:g}" for size in sizes), ", ".join(f"{1e3 * t:.3g}" for t in took), f"{exponent:.2f}")
        found.append((name, *row))
    return found


if __name__ == "__main__":
    print(text(HEAD, measure()))
