"""An axis at a prescribed velocity: mean force, its derivative and its work."""

import json

import numpy as np
import pytest

import pneudrive as pn
from pneudrive import _core

LUGRE = {"coulomb": 30.0, "breakaway": 45.0, "stribeck_velocity": 0.02, "viscous": 40.0}
LUGRE |= {"bristle_stiffness": 1e5, "bristle_damping": 300.0, "damping_fade_velocity": 0.1}


def driven(law="lugre", parameters=LUGRE):
    form = json.loads(pn.Drive.load("catalogue:reference").system.json)
    form["components"].append({"name": "axis", "kind": "platform/driven", "numbers": {}})
    next(joint for joint in form["joints"] if "cylinder.rod" in joint).append("axis.1")
    next(own for own in form["components"] if own["name"] == "cylinder")["friction"] = {
        "law": law,
        "parameters": parameters,
    }
    return _core.Circuit(json.dumps(form))


def start(circuit):
    own = dict.fromkeys(circuit.start_names, 0.0) | {"cylinder.position_m": 0.1}
    own |= {name: 3e5 if name.endswith("pressure_pa") else own[name] for name in own}
    return own | {name: 293.15 for name in own if name.endswith("temperature_k")}


@pytest.fixture
def session():
    circuit = driven()
    own = circuit.start(start(circuit), 1e-9)
    own.set("valve.command", 0.4)
    return own


@pytest.mark.parametrize("velocity", [0.05, -0.3])
def test_the_slope_of_the_mean_force_is_that_of_differences(session, velocity):
    own = session.try_velocity(velocity, 2e-3)
    force, slope = session.velocity_slope(velocity, 2e-3)
    ends = [session.try_velocity(velocity + step, 2e-3) for step in (1e-4, -1e-4)]
    assert force == pytest.approx(own, rel=1e-9)
    assert slope == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-5)


def test_a_trial_leaves_the_session_until_it_is_accepted(session):
    before = session.save()
    first = session.try_velocity(0.2, 1e-3)
    assert session.save() == before
    assert session.try_velocity(0.2, 1e-3) == first
    session.accept()
    assert session.time == 1e-3
    assert session.read("cylinder.position_m") == pytest.approx(0.1002, abs=1e-15)


def test_the_work_on_the_program_closes_the_balance():
    circuit = driven()
    times = np.linspace(0.0, 0.3, 31)[:-1]
    plan = [
        ("axis.velocity_m_s", times, 0.4 * np.sin(20.0 * times)),
        ("valve.command", times, 0.5 * np.cos(9.0 * times)),
    ]
    run = circuit.simulate(plan, 0.3, 1e3, start(circuit), 1e-8, ledger=True)
    assert run["ledger"]["energy_turnover_j"] > 50.0
    assert abs(run["ledger"]["energy_error"]) < 1e-9


def test_a_law_that_sticks_as_a_mode_is_rejected():
    with pytest.raises(ValueError, match="put a coupling with the stiffness"):
        driven("coulomb", {"coulomb": 20.0})


def test_another_session_has_no_such_axis():
    session = pn.Drive.load("catalogue:reference").start({"position": "50 mm"})
    with pytest.raises(ValueError, match="no axis of this session has a prescribed velocity"):
        session._core.try_velocity(0.1, 1e-3)
