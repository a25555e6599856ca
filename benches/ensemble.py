"""10,000 drives in one call: final state and stroke time of case A under random parameters, on one core and on all.

``python -m benches.ensemble`` prints only the table. On one core, processor time is used. On several cores, it is wall
time relative to the rate of as many independent processes in the same run.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from benches.problem import A
from benches.tables import text
from pneudrive import _core
from pneudrive.describe.base import key_of
from pneudrive.describe.system import System

if TYPE_CHECKING:
    from pneudrive._core import Outcome

MEMBERS, PEER_MEMBERS, TRACED_MEMBERS = 10_000, 1000, 100
#: Eleven numbers of the drive: path in the core, low, high, and index in the peers' parameters. The breakaway force is
#: 1.2 to 1.8 times the Coulomb force.
VARIED = (
    ("cylinder.moving_mass_kg", 1.0, 4.0, 9),
    ("valve.conductance_m3_s_pa", 1.4e-8, 2.6e-8, 12),
    ("valve.critical_pressure_ratio", 0.2, 0.45, 13),
    ("supply.pressure_pa", 5e5, 8e5, 2),
    ("cylinder.heat_transfer_w_m2_k", 10.0, 60.0, 10),
    ("friction.parameters.viscous", 20.0, 80.0, 22),
    ("friction.parameters.coulomb", 20.0, 40.0, 19),
    ("friction.parameters.stribeck_velocity", 0.01, 0.03, 21),
    ("cylinder.dead_volume_a_m3", 0.5e-5, 2e-5, 8),
    ("friction.parameters.bristle_stiffness", 0.7e5, 1.5e5, 23),
)
BREAKAWAY = ("friction.parameters.breakaway", 20)
LOOSEST = {"pneudrive": 1e-4, "numbalsoda": 3e-6, "diffrax": 1e-5}  # at which each keeps 1 um in case A


def rows(n: int) -> np.ndarray:
    """Return the varied numbers of `n` members, breakaway last, shape (n, 11)."""
    draws = np.random.default_rng(1).uniform(size=(n, len(VARIED) + 1))
    low, high = (np.array([one[k] for one in VARIED]) for k in (1, 2))
    varied = low + draws[:, :-1] * (high - low)
    coulomb = varied[:, [path for path, *_ in VARIED].index("friction.parameters.coulomb")]
    return np.column_stack([varied, coulomb * (1.2 + 0.6 * draws[:, -1])])


def parameters(n: int) -> np.ndarray:
    """Return the same for the peers, shape (n, 25); theirs is the conductance times the reference density."""
    from benches.solvers.rhs import PARAMETERS

    out = np.tile(np.array(PARAMETERS), (n, 1))
    for values, index in zip(rows(n).T, [*(one[3] for one in VARIED), BREAKAWAY[1]], strict=True):
        out[:, index] = values
    nominal = A.data["drive"]["valve"]["conductance_m3_s_pa"]
    out[:, 12] *= PARAMETERS[12] / nominal
    out[:, 15] = np.sqrt(1.0 - ((out[:, 14] - out[:, 13]) / (1.0 - out[:, 13])) ** 2)
    return out


def ours(n: int, threads: int, tol: float = LOOSEST["pneudrive"]) -> np.ndarray:
    """Return final position and velocity, and the stroke time, shape (n, 3)."""
    return np.column_stack(outcome(n, threads, tol)["outputs"])


def _path(name: str) -> str:
    """Return the path in the circuit; the numbers of the ambient air keep their units."""
    return name if name.startswith("ambient.") else key_of(name)


def outcome(n: int, threads: int, tol: float = LOOSEST["pneudrive"]) -> Outcome:
    """Return the core's result: these outputs, and its step attempts."""
    names = [*(path for path, *_ in VARIED), BREAKAWAY[0]]
    values = rows(n)
    drive = json.loads(json.dumps(A.data["drive"]))
    # both dead volumes are one number of the peers
    names.append("cylinder.dead_volume_b_m3")
    values = np.column_stack([values, values[:, names.index("cylinder.dead_volume_a_m3")]])
    in_circuit = [f"cylinder.{name}" if name.startswith("friction.") else _path(name) for name in names]
    system = System.of_drive(drive)
    ensemble = _core.Ensemble(system.json, in_circuit, system.names)
    times, commands = (list(column) for column in zip(*A.data["commands"], strict=True))
    start = [A.data["initial"].get(name, 0.0) for name in ensemble.start_names]
    stroke = drive["cylinder"]["stroke_m"]
    return ensemble.run(
        {
            "values": values,
            "plans": [(ensemble.inputs[0], times, np.tile(commands, (n, 1)))],
            "duration": np.full(n, A.data["duration_s"]),
            "initial": np.tile(start, (n, 1)),
            "outputs": [
                {"column": "position_m", "what": "final"},
                {"column": "velocity_m_s", "what": "final"},
                {"column": "position_m", "what": "time_when", "value": stroke, "above": True},
            ],
            "rtol": tol,
            "threads": threads,
        }
    )


def _microseconds(solve, n: int, repeats: int = 3) -> float:
    """Least processor time of a member, us."""
    solve()
    times = []
    for _ in range(repeats):
        begun = time.process_time()
        solve()
        times.append(time.process_time() - begun)
    return 1e6 * min(times) / n


def _wall(n: int, threads: int) -> float:
    begun = time.perf_counter()
    ours(n, threads)
    return time.perf_counter() - begun


def share_of_processes(n: int = MEMBERS) -> float:
    """Rate on all cores, relative to one independent process on each core."""
    cores = len(os.sched_getaffinity(0))
    code = f"from benches.ensemble import ours; ours({n // cores}, 1)"
    timed = f"import time; from benches.ensemble import _wall; print(_wall({n // cores}, 1))"
    alone = []
    for _ in range(3):
        running = [
            subprocess.Popen([sys.executable, "-c", f"{code}; {timed}"], stdout=subprocess.PIPE) for _ in range(cores)
        ]
        alone.append(max(float(one.communicate()[0]) for one in running))
    together = min(_wall(n, cores) for _ in range(3))
    return min(alone) / together


def measure() -> list[tuple[str, str, str]]:
    """Return (solver, us a member and core, times ours)."""
    least = _microseconds(lambda: ours(MEMBERS, 1), MEMBERS)
    found = [("pneudrive", least)]
    if find_spec("numbalsoda"):
        from benches.solvers import numbalsoda

        peer = numbalsoda.NumbaLsoda()
        data = np.column_stack([np.zeros(PEER_MEMBERS), parameters(PEER_MEMBERS)])
        steps = (np.array([u for u, _ in A.segments]), np.array([t[0] for _, t in A.segments] + [A.times[-1]]))
        ends = np.empty((PEER_MEMBERS, 7))
        run = lambda: numbalsoda.ensemble(peer.address, A.initial, data, ends, steps, LOOSEST["numbalsoda"])  # noqa: E731
        found.append(("numbalsoda LSODA", _microseconds(run, PEER_MEMBERS)))
        far = np.abs(ends[:, 0] - ours(PEER_MEMBERS, 1)[:, 0]) * 1e6
        lost = np.count_nonzero(np.isnan(far))
        print(f"final positions differ from numbalsoda's by {np.nanmax(far):.2g} um at most; it loses {lost} members")
    if find_spec("diffrax"):
        from benches.solvers import diffrax

        many = diffrax.many(LOOSEST["diffrax"])
        given = parameters(TRACED_MEMBERS)
        found.append(
            ("diffrax Kvaerno3, vmap (XLA)", _microseconds(lambda: np.asarray(many(given)), TRACED_MEMBERS, 1))
        )
    return [(name, f"{took:.3g}", f"{took / least:.3g}") for name, took in found]


HEAD = ("ensemble of case A", "us a member and core", "times ours")

if __name__ == "__main__":
    print(text(HEAD, measure()))
    print(f"all cores: {share_of_processes():.3g} of independent processes")
