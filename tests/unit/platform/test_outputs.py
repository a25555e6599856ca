"""Forces along and across the legs of a moving platform, against Lagrange multipliers and against the gas of a run."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import pneudrive as pn
from oracle import platforms
from pneudrive import _core
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import CommandError
from pneudrive.platforms.kinematics import platform_outputs, pose_columns
from unit.platform.test_rigid_dynamics import KINDS, started

TRIPOD = Path(__file__).parents[3] / "examples" / "tripod.toml"


@pytest.mark.parametrize("kind", KINDS)
def test_forces_along_and_across_legs_are_those_of_multipliers(kind):
    rng = np.random.default_rng(7)
    gas = SimpleNamespace(core=lambda: {"heat_capacity_ratio": 1.4})
    for _ in range(3):
        machine = platforms.random_machine(kind, rng)
        circuit = _core.Circuit(json.dumps(platforms.circuit(machine)))
        air = SimpleNamespace(pressure_pa=1e5)
        surroundings = SimpleNamespace(components={}, ambient=air, gas=gas, core_parts={})
        own = pn.platforms.Platform(circuit.platforms[0], surroundings)
        names = [name for row in pose_columns(own) for name in row]
        for _ in range(10):
            place, turn, rates = platforms.random_state(machine, rng)
            forces = rng.uniform(-300.0, 300.0, len(machine.frame))
            session, _ = started(circuit, machine, place, turn, rates)
            for i, force in enumerate(forces, start=1):
                session.set(f"leg_{i}.load_force_n", force)
            found = platform_outputs(own, {name: np.array([session.read(name)]) for name in names})
            across = machine.side_forces(place, turn, rates, forces)
            size = np.max(np.abs(forces)) + np.max(across)
            for i, force in enumerate(forces):
                assert abs(found[f"platform.leg_{i + 1}_force_n"][0] - force) < 1e-9 * size
                assert abs(found[f"platform.leg_{i + 1}_side_force_n"][0] - across[i]) < 1e-7 * size


def test_the_force_of_a_leg_is_that_of_its_gas():
    circuit = pn.Circuit.load(TRIPOD)
    tripod = pn.platform(circuit)
    run = tripod.outputs(circuit.simulate({"valve_1": [(0.0, 0.3)], "valve_2": [(0.0, -0.2)]}, "0.2 s"))
    for leg in tripod.legs:
        a, b = leg.areas_m2
        gas = run[f"{leg.name}.a.pressure"] * a - run[f"{leg.name}.b.pressure"] * b - STANDARD_ATMOSPHERE_PA * (a - b)
        force = gas - run[f"{leg.name}.friction_force"] - run[f"{leg.name}.end_stop_force"]
        assert float(abs(run[f"tripod.{leg.name}_force"] - force).max()) < 1e-8
    assert run["tripod.leg_1_side_force"].attrs["units"] == "N"
    start = {key: float(run[f"tripod.{key}"][0]) for key in tripod.coordinates}
    assert run["tripod.smallest_singular_value"][0] == tripod.singular_values(start)[-1]
    with pytest.raises(CommandError, match=r"the run has no column tripod\.heave_m"):
        tripod.outputs(pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 1", "0.1 s"))
