"""Platforms without air against Lagrange multipliers in other coordinates, see oracle/platforms.py."""

from __future__ import annotations

import json

import numpy as np
import pytest

from oracle import platforms
from pneudrive import _core

KINDS = ["platform/3-rps", "platform/3-upu", "platform/6-ups", "platform/linear-delta"]


def started(circuit, machine, place, turn, rates):
    """Start a session at the positions and velocities of the legs."""
    legs = zip(machine.positions(place, turn), machine.leg_rates(place, turn, rates), strict=True)
    start = {}
    for i, (x, v) in enumerate(legs, start=1):
        start |= {f"leg_{i}.position_m": x, f"leg_{i}.velocity_m_s": v}
    return circuit.start(start, 1e-6), start


@pytest.mark.parametrize("kind", KINDS)
def test_legs_accelerate_as_by_multipliers(kind):
    """Joints, hinges, lengths and masses are unequal. Forward kinematics of the start closes, too."""
    rng = np.random.default_rng(51)
    worst = closing = 0.0
    for _ in range(3):
        machine = platforms.random_machine(kind, rng)
        circuit = _core.Circuit(json.dumps(platforms.circuit(machine)))
        for _ in range(20):
            place, turn, rates = platforms.random_state(machine, rng)
            forces = rng.uniform(-300.0, 300.0, len(machine.frame))
            session, start = started(circuit, machine, place, turn, rates)
            for i, force in enumerate(forces, start=1):
                session.set(f"leg_{i}.load_force_n", force)
            own = np.array([session.read(f"leg_{i}.acceleration_m_s2") for i in range(1, len(forces) + 1)])
            expected = machine.accelerations(place, turn, rates, forces)[1]
            worst = max(worst, np.max(np.abs(own - expected)) / np.max(np.abs(expected)))
            closing = max(closing, *(abs(session.read(name) - value) for name, value in start.items()))
    assert worst < 1e-9
    assert closing < 1e-12
