"""Platforms on pneumatic legs against an independent model with multipliers, see oracle/platform_air.py."""

from __future__ import annotations

import json

import numpy as np
import pytest

from oracle import platform_air
from pneudrive import _core

KINDS = ["platform/3-rps", "platform/6-ups", "platform/linear-delta"]


def run(kind, rtol, *, ledger=False):
    """Simulate a machine of the oracle."""
    own = platform_air.machine(kind)
    circuit = _core.Circuit(json.dumps(platform_air.circuit(kind)))
    times = list(platform_air.TIMES[:-1])
    plans = [(f"valve_{i}.command", times, list(platform_air.COMMANDS[i - 1])) for i in range(1, len(own.frame) + 1)]
    start = platform_air.start(own)
    return circuit.simulate(plans, platform_air.TIMES[-1], 200.0, start, rtol, ledger, None, None)


@pytest.mark.parametrize("kind", KINDS)
def test_legs_move_as_by_multipliers(kind):
    expected = platform_air.positions(kind, 1e-11)
    errors = []
    for rtol in (1e-6, 1e-9):
        columns = run(kind, rtol)["columns"]
        own = np.column_stack([columns[f"leg_{i}.position_m"] for i in range(1, expected.shape[1] + 1)])
        errors.append(np.max(np.abs(own - expected)))
    assert np.ptp(expected, axis=0).max() > 1e-3  # the legs move
    assert errors[0] < 1e-8
    assert errors[1] < 1e-10


@pytest.mark.parametrize("kind", KINDS)
def test_mass_and_energy_are_kept(kind):
    ledger = run(kind, 1e-6, ledger=True)["ledger"]
    assert abs(ledger["energy_error"]) < 1e-9 * ledger["energy_turnover_j"]
    assert abs(ledger["mass_error"]) < 1e-12
