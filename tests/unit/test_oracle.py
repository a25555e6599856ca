"""The yardstick itself: the oracle against another author's trajectory, closed forms and conservation."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from oracle.cases import CASES, at, changed, motion, stribeck
from oracle.integrate import COLUMNS, run
from oracle.model import Drive, choked_flow_factor

GOLDEN = Path(__file__).resolve().parent.parent / "golden"


def test_the_oracle_reproduces_an_independently_computed_trajectory():
    """Case A of another author's model (Radau at 1e-12): the same motion to a thousandth of a micrometre."""
    case = json.loads((GOLDEN / "case_a.json").read_text())
    times, states, _ = run(case, "Radau", 1e-9)
    with np.load(GOLDEN / "case_a_reference.npz") as reference:
        np.testing.assert_allclose(times, reference["time_s"], rtol=0, atol=1e-12)
        assert np.abs(states[:, 0] - reference["position_m"]).max() < 1e-9
        for i in (2, 3, 4, 5):
            np.testing.assert_allclose(states[:, i], reference[COLUMNS[i]], rtol=1e-8)


@pytest.mark.parametrize("name", sorted(CASES))
def test_a_golden_file_belongs_to_the_case_that_the_code_describes(name):
    """A case that was edited without writing its trajectory again would compare nothing."""
    stored = json.loads((GOLDEN / f"{name}.json").read_text())
    case = CASES[name]()
    assert {key: stored[key] for key in case} == json.loads(json.dumps(case))
    with np.load(GOLDEN / f"{name}.npz") as data:
        samples = round(case["duration_s"] * case["sample_rate_hz"]) + 1
        assert {c: data[c].shape for c in data.files} == dict.fromkeys(COLUMNS, (samples,))
        assert (data["pressure_a_pa"] > 0).all()
        # the columns are where their names say: the file starts in the initial state
        for column in COLUMNS:
            assert data[column][0] == pytest.approx(case["initial"][column], rel=1e-10)


def test_gas_in_a_closed_adiabatic_chamber_keeps_its_isentrope():
    """A shut valve without heat transfer: p V^k is constant in both chambers while the piston rings."""
    drive = changed(cylinder={"heat_transfer_w_m2_k": 0.0})
    times, states, _ = run(motion(drive, [(0.0, 0.0)], 0.3, at(0.1, 5e5, 3e5)), "DOP853", 1e-11)
    model = Drive(drive)
    for length, p in ((states[:, 0], states[:, 2]), (model.stroke - states[:, 0], states[:, 4])):
        volume = model.chamber_a.volume(length)
        np.testing.assert_allclose(p * volume**1.4, p[0] * volume[0] ** 1.4, rtol=1e-8)
    assert np.ptp(states[:, 0]) > 0.03
    assert len(times) == 301


def test_mass_and_energy_rates_balance_for_any_state():
    """What the chambers gain is what crosses their ports, walls and piston faces (random states)."""
    random = np.random.default_rng(1)
    model = Drive(CASES["through_rod_spring"]()["drive"])
    c_v = model.r_gas / (model.k - 1.0)
    for _ in range(200):
        length, speed = random.uniform(0.0, 0.25), random.uniform(-3, 3)
        p, t = random.uniform(1e5, 8e5), random.uniform(200, 400)
        port = (random.uniform(1e5, 8e5), random.uniform(250, 350))
        opening = random.uniform(0, 1)
        chamber = model.chamber_a
        p_rate, t_rate = model.chamber_rates(chamber, length, speed, p, t, port, opening)
        flow = model.mass_flow(*port, p, t, opening)
        volume, volume_rate = chamber.volume(length), chamber.area * speed
        mass = p * volume / (model.r_gas * t)
        mass_rate = mass * (p_rate / p + volume_rate / volume - t_rate / t)
        assert mass_rate == pytest.approx(flow, rel=1e-9, abs=1e-12)
        heat = model.alpha * chamber.wall_area(length) * (model.t_wall - t)
        enthalpy = (c_v + model.r_gas) * flow * (port[1] if flow > 0 else t)
        energy_rate = (p_rate * volume + p * volume_rate) / (model.k - 1.0)
        assert energy_rate == pytest.approx(enthalpy + heat - p * volume_rate, rel=1e-9)
        assert c_v * (mass_rate * t + mass * t_rate) == pytest.approx(energy_rate, rel=1e-9)


def test_choked_flow_and_the_chord_near_pressure_balance():
    """Hand-computed: C rho0 p1 when choked; odd in the pressures; continuous where the chord begins."""
    model = Drive(changed())
    assert model.mass_flow(6e5, 293.15, 1e5, 293.15, 1.0) == pytest.approx(2e-8 * 1.185 * 6e5, rel=1e-14)
    assert model.mass_flow(2e5, 300.0, 3e5, 300.0, 0.5) == -model.mass_flow(3e5, 300.0, 2e5, 300.0, 0.5)
    assert model.flow_function(0.999 - 1e-12) == pytest.approx(model.flow_function(0.999 + 1e-12), rel=1e-8)
    assert model.flow_function(1.0) == 0.0
    assert choked_flow_factor(1.4) == pytest.approx(0.6847, abs=1e-4)


def test_a_piston_sticks_under_less_than_breakaway_and_leaves_above_it():
    """Exact sticking: v is 0.0 for ever under 0.99 Fs, and the direction of leaving is that of the force."""
    model = Drive(changed())
    area = model.chamber_a.area
    for share, moves in ((0.99, False), (1.01, True)):
        for sign in (1.0, -1.0):
            drive = changed(
                friction={"law": "stribeck", "parameters": stribeck(30.0, 45.0, 0.02, 40.0)},
                load={"force_n": sign * share * 45.0},
                cylinder={"heat_transfer_w_m2_k": 0.0},
            )
            _, states, statistics = run(motion(drive, [(0.0, 0.0)], 0.2, at(0.25, 3e5, 3e5)), "DOP853", 1e-10)
            assert bool(states[:, 1].any()) is moves
            assert statistics["rhs"] > 0
            if moves:
                assert math.copysign(1.0, states[50, 0] - 0.25) == sign
    assert area == pytest.approx(4.9087e-4, rel=1e-4)
