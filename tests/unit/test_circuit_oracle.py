"""Circuits against an independent model of them, see tests/golden/README.md."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from oracle.circuit_cases import CASES, Case
from oracle.generate_circuits import GOLDEN, model_hash
from pneudrive.errors import CommandError, DescriptionError, SimulationError

#: m for positions of masses; of its range for any other column. Asked are 1 um and 1e-4.
POSITION, SHARE = 1e-8, 1e-5
ROOT = Path(__file__).parents[2]


def load(case: Case) -> pn.Circuit:
    return pn.Circuit.load(ROOT / case.file)


@pytest.mark.parametrize("name", CASES)
def test_a_circuit_runs_as_an_independent_model_of_it_does(name):
    case, golden = CASES[name](), np.load(GOLDEN / f"{name}.npz")
    run = load(case).simulate(
        case.commands or None, case.duration, initial=case.initial, sample_rate=case.rate, rtol=1e-8
    )
    for column in case.columns:
        expected, own = golden[column], run[column]
        bound = POSITION if own.attrs["units"] == "m" else SHARE * np.ptp(expected)
        np.testing.assert_allclose(own, expected, rtol=0.0, atol=bound, err_msg=column)


@pytest.mark.parametrize("name", CASES)
def test_golden_runs_are_those_of_the_model_as_it_stands(name):
    made = json.loads(str(np.load(GOLDEN / f"{name}.npz")["made"]))
    assert made["model_sha256"] == model_hash(), "run python tests/oracle/generate_circuits.py"
    # Two unrelated methods agree, far within the bounds.
    assert max(list(made["greatest_difference_of_range"].values())[1:]) < 0.3 * SHARE


# --- Circuits run: against the drive that they are, against a closed form, and as sessions.

EXAMPLE = Path(__file__).parents[2] / "examples" / "two_cylinders.toml"
DISCHARGE = {
    "components": {
        "tank": {"kind": "tank", "volume": "2 l", "heat_transfer": "0 W/(m2 K)"},
        "nozzle": {"kind": "fitting", "conductance": "0.5 dm3/(s bar)", "critical_pressure_ratio": 0.3},
    },
    "connections": ["tank -> nozzle -> ambient"],
    "initial": {"tank": "8 bar abs"},
}


def test_a_tank_runs_empty_as_the_closed_form_says():
    """Choked and adiabatic: p/p0 = (1 + (k-1)/2 t/tau)^(-2k/(k-1)), tau = V/(C rho0 R sqrt(T0 T))."""
    circuit = pn.Circuit(**DISCHARGE)
    run = circuit.simulate(None, "1.5 s", rtol=1e-9)
    k, r, t0 = 1.4, 287.05, 293.15
    tau = 2e-3 / (0.5e-8 * 1.185 * r * t0)
    expected = 8e5 * (1 + (k - 1) / 2 * run.time / tau) ** (-2 * k / (k - 1))
    choked = expected > 101325.0 / 0.3
    assert choked.sum() > 500
    np.testing.assert_allclose(run["tank.pressure"][choked], expected[choked], rtol=2e-7)
    assert run["tank.pressure"].attrs == {
        "units": "Pa", "long_name": "tank: absolute pressure", "column": "tank.pressure_pa",
    }  # fmt: skip
    assert run.attrs["description_hash"] == circuit.description_hash
    assert math.isclose(run["nozzle.mass_flow"][0], 8e5 * 0.5e-8 * 1.185, rel_tol=1e-9)


def test_a_tube_rings_at_a_quarter_of_a_wave_length():
    # c/(4 L), open at one end: of a wide tube, whose mouth chokes nothing, without friction and heat.
    tube = {
        "kind": "tube/distributed",
        "length": "2 m",
        "diameter": "40 mm",
        "friction_scale": 0,
        "heat_transfer": "0 W/(m2 K)",
    }
    circuit = pn.Circuit(
        components={
            "room": {"kind": "reservoir", "pressure": "1 bar abs"},
            "hose": tube | {"cells": 10},
            "end": {"kind": "tank", "volume": "0.001 cm3"},
        },
        connections=["room -> hose -> end"],
        initial={"end": "1 bar abs"},
    )
    rates = np.linalg.eigvals(np.asarray(circuit.start().linearise().A))
    frequencies = np.sort(np.abs(rates.imag)) / (2.0 * math.pi)
    first = frequencies[frequencies > 1.0][0]
    assert first == pytest.approx(math.sqrt(1.4 * 287.05 * 293.15) / 8.0, rel=2e-3)


def test_cells_of_a_tube_start_as_the_joint_before_it():
    circuit = pn.Circuit(
        components={
            "mains": {"kind": "reservoir", "pressure": "7 bar abs"},
            "hose": {"kind": "tube/distributed", "length": "3 m", "diameter": "4 mm"},
            "valve": {"kind": "valve/switching-2/2", "conductance": "1 dm3/(s bar)", "critical_pressure_ratio": 0.3}
            | {"time_on": "5 ms", "time_off": "5 ms"},
            "tank": {"kind": "tank", "volume": "0.1 l"},
        },
        connections=["mains -> hose -> valve -> tank"],
    )
    run = circuit.simulate("0 s: 0, 0.1 s: 1", "0.2 s", ledger=True)
    cells = [name for name in run.data_vars if name.startswith("hose.cell_") and name.endswith("pressure")]
    assert len(cells) == 4
    for cell in cells:
        assert np.ptp(run[cell].values[:100]) == 0.0
        assert run[cell].values[0] == pytest.approx(7e5, rel=1e-12)
    assert abs(run.attrs["ledger"]["energy_error"]) < 1e-4


def test_a_session_gives_the_bits_of_the_run():
    circuit = pn.Circuit.load(EXAMPLE)
    run = circuit.simulate({"valve_l": "0 s: 1, 0.1 s: -0.5"}, "0.2 s")
    session = circuit.start()
    session.set("valve_l.command", 1.0)
    session.advance(0.1)
    session.set("valve_l.command", -0.5)
    saved = session.save()
    session.advance(0.2)
    assert session.read("left.position_m") == run["left.position"][-1]
    session.restore(saved)
    session.set("left.load_force_n", -50.0)
    session.advance(0.2)
    assert session.read("left.position_m") < run["left.position"][-1]
    names = {variable.name: variable for variable in session.variables}
    assert names["left.a.pressure_pa"].unit == "Pa"
    with pytest.raises(CommandError, match=r"no input 'valve_x\.command'"):
        session.set("valve_x.command", 1.0)


def test_what_is_told_of_commands_and_starts():
    circuit = pn.Circuit(**DISCHARGE)
    with pytest.raises(CommandError, match="no component of the circuit takes a command"):
        circuit.simulate(1.0, "1 s")
    with pytest.raises(CommandError, match="the initial state has the type float"):
        circuit.simulate(None, "1 s", initial=1.0)
    with pytest.raises(pn.PneudriveError, match=r"tnak is not a start value"):
        circuit.start("tnak = 3 bar abs")


def test_commands_take_every_form_that_a_drive_takes(tmp_path):
    circuit = pn.Circuit.load(EXAMPLE).replace({"components.valve_l.command": "0 V .. 10 V"})
    file = tmp_path / "moves.csv"
    file.write_text("time_s,command\n0,0.5\n0.01,-0.5\n")
    expected = np.where(np.arange(21) < 10, 0.5, -0.5)
    for command in (
        "valve_l: 0 s: 7.5 V, 10 ms: 2.5 V",
        f"valve_l: {file}",
        {"valve_l": [(0.0, 0.5), (0.01, -0.5)]},
        {"valve_l.command": lambda t: 0.5 if t < 0.01 else -0.5},
    ):
        run = circuit.simulate(command, "20 ms")
        np.testing.assert_array_equal(run["valve_l.command"][:20], expected[:20])
        assert not run["valve_r.command"].any()


AXIS = EXAMPLE.with_name("cushioned_axis.toml")


def test_a_cushion_and_a_shock_absorber_take_the_axis_to_its_ends():
    circuit, command = pn.Circuit.load(AXIS), "0 s: 0.5, 0.8 s: -0.5"
    run = circuit.simulate(command, "1.6 s", ledger=True)
    assert abs(run.attrs["ledger"]["mass_error"]) < 1e-12
    assert abs(run.attrs["ledger"]["energy_error"]) < 1e-4
    assert float(run["slide.position"][0]) == 0.02  # where the cylinder is
    apart = run["axis.position"] - run["slide.position"]
    # Beyond the play on both sides.
    assert float(apart.max()) > 5e-5
    assert float(apart.min()) < -5e-5
    assert float(run["absorber.force"].max()) > 100.0
    # On the way back nothing but the cushion brakes: its chamber is far above its port.
    above = run["axis.a.pressure"] - run["axis.a.port_pressure"]
    wide = {f"components.axis.cushion_{end}_needle_conductance": "3 dm3/(s bar)" for end in "ab"}
    open_ = circuit.replace(wide).simulate(command, "1.6 s")
    assert float(above.max()) > 3e5 > float((open_["axis.a.pressure"] - open_["axis.a.port_pressure"]).max())
    hardest = [max(one["speed_m_s"] for one in of.attrs["impacts"]) for of in (run, open_)]
    assert hardest[0] < 0.6 * hardest[1]
    assert any(line.startswith("axis.cushion_b_check_conductance = ") for line in run.attrs["assumed"])
    assert not any("cushion" in line for line in pn.Circuit.load(EXAMPLE).assumed())


def test_a_cushion_is_given_whole():
    text = AXIS.read_text(encoding="utf-8").replace(', port_volume = "6 cm3" }', " }", 1)
    with pytest.raises(DescriptionError, match=r"(?s)cushion_a_port_volume is missing.*give all keys of cushion_a"):
        pn.Circuit.load(text)


def test_states_are_named_by_their_component_and_what_they_are():
    """As columns are: the slope of each is found by name, against the state that is read."""
    drive = pn.Drive.load("catalogue:reference").replace(
        {"tubing": {"a": {"length": "1 m", "diameter": "4 mm", "kind": "tube/distributed", "cells": 4}}}
    )
    session = drive.start("position = 0.25 m, pressure_a = 3 bar abs, pressure_b = 2 bar abs")
    session.set("command", 0.5)
    session.advance(0.05)
    linear = session.linearise(["load_force_n"])
    slope = {
        (one, other): linear.A[i, j] for i, one in enumerate(linear.states) for j, other in enumerate(linear.states)
    }
    rate = dict(zip(linear.states, linear.rates, strict=True))
    assert {"mass_b_kg", "internal_energy_a_j", "tube_a.cell_0.mass_kg", "bristle_deflection_m"} <= set(linear.states)
    assert len(set(linear.states)) == len(linear.states)
    assert (slope["position_m", "velocity_m_s"], rate["position_m"]) == (1.0, session.read("velocity_m_s"))
    # What a mass gains is what its column says.
    assert rate["mass_b_kg"] == pytest.approx(session.read("mass_flow_b_kg_s"), rel=1e-12)
    state = dict(zip(linear.states, linear.state, strict=True))
    volume = state["internal_energy_b_j"] * 0.4 / session.read("pressure_b_pa")
    assert state["mass_b_kg"] * 287.05 * session.read("temperature_b_k") == pytest.approx(
        session.read("pressure_b_pa") * volume, rel=1e-12
    )
    assert [v.unit for v in session.variables if v.name in ("mass_b_kg", "tube_a.cell_0.internal_energy_j")] == [
        "kg",
        "J",
    ]


def test_a_message_names_the_states_of_a_circuit():
    circuit = pn.Drive.load("catalogue:reference").circuit
    with pytest.raises(SimulationError, match=r"State: cylinder\.position_m = .*, cylinder\.a\.mass_kg = "):
        circuit.simulate("0 s: 1", "1 s", initial="cylinder.position = 50 mm", budget=20)


def test_members_of_one_topology_differ_in_numbers_alone():
    # Their heat transfer follows its law, whose numbers follow from the volume.
    law = DISCHARGE | {"components": DISCHARGE["components"] | {"tank": {"kind": "tank", "volume": "2 l"}}}
    circuit = pn.Circuit(**law)
    volumes = np.array([[1e-3], [2e-3], [5e-3]])
    members = circuit.system.compiled().members(["tank.volume"], volumes)
    assert len(members) == 3
    for member, (volume,) in enumerate(volumes):
        changed = pn.Circuit(**DISCHARGE | {"components": DISCHARGE["components"] | {
            "tank": {"kind": "tank", "volume": f"{1e3 * volume} l"}
        }})  # fmt: skip
        alone, session = changed.start(), members.start(member, changed.core_initial(), 1e-6)
        for one in (alone, session):
            one.advance(0.3)
        assert session.read("tank.pressure_pa") == alone.read("tank.pressure_pa")
    with pytest.raises(ValueError, match=r"tank\.volume = -1 m3 is out of bounds"):
        circuit.system.compiled().members(["tank.volume"], np.array([[-1.0]]))


def test_a_piston_in_the_open_air_stops_where_friction_and_spring_have_taken_its_energy():
    """v0^2/2 = x^2/2 + F x with m = 1 kg, k = 1 N/m, F = 10 N: x = sqrt(125) - 10, and there the spring is too weak."""
    body = {"area_a": "1 cm2", "area_b": "1 cm2", "stroke": "20 m", "moving_mass": "1 kg"}
    circuit = pn.Circuit(
        components={
            "body": {"kind": "piston", **body, "friction": {"law": "coulomb", "coulomb": "10 N"}},
            "spring": {"kind": "spring", "stiffness": "1 N/m", "rest_position": "10 m"},
        },
        connections=["ambient -> body.a", "ambient -> body.b", "body.rod -> spring"],
        initial={"body": {"position": "10 m", "velocity": "5 m/s"}},
    )
    run = circuit.simulate({}, "31 s", sample_rate="10 Hz")
    x = run["body.position"].to_numpy() - 10.0
    assert x[-1] == pytest.approx(math.sqrt(125.0) - 10.0, abs=1e-6)
    assert (x[10:] == x[-1]).all()
    tube = {"kind": "fitting", "conductance": "1 dm3/(s bar)", "critical_pressure_ratio": 0.3}
    with pytest.raises(DescriptionError, match="connects joint ambient with itself"):
        pn.Circuit(components={"leak": tube}, connections=["ambient -> leak -> ambient"])
