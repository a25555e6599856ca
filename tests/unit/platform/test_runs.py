"""Runs of platforms: derivatives, couplings in place of rigid legs, saved sessions, end stops and messages."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from oracle import platform_air
from pneudrive import _core
from pneudrive.errors import DescriptionError, PneudriveWarning

TRIPOD = Path(__file__).parents[3] / "examples" / "tripod.toml"
COMMANDS = {
    "valve_1": [(0.0, 0.3), (0.15, -0.2), (0.3, 0.0)],
    "valve_2": [(0.0, 0.2), (0.15, -0.05), (0.3, 0.0)],
    "valve_3": [(0.0, 0.25), (0.15, -0.25), (0.3, 0.0)],
}
LEGS = [f"leg_{i}.position" for i in (1, 2, 3)]


LUGRE = re.search(r'friction = ({ law = "lugre".*})', TRIPOD.read_text("utf-8"))[1]
LEVELS = 'coulomb = "25 N", breakaway = "35 N", stribeck_velocity = "20 mm/s", viscous = "60 N s/m"'
TIMES = 'memory_time = "2 ms", recovery_time = "1 s"'
STICKING = {
    "coulomb": '{ law = "coulomb", coulomb = "25 N", viscous = "60 N s/m" }',
    "stribeck": f'{{ law = "stribeck", {LEVELS} }}',
    "armstrong": f'{{ law = "armstrong", {LEVELS}, bristle_stiffness = "1e6 N/m", {TIMES} }}',
    "karnopp": f'{{ law = "karnopp", {LEVELS}, dead_zone = "0.1 mm/s" }}',
}


def jointed(stiffness, friction=LUGRE):
    """Return the tripod with a coupling between each rod and the platform."""
    text = TRIPOD.read_text("utf-8").replace(LUGRE, friction)
    for i in (1, 2, 3):
        text = text.replace(f'"leg_{i}.rod -> tripod.{i}"', f'"leg_{i}.rod -> joint_{i} -> tripod.{i}"')
    table = f"""[components.joint]
kind = "coupling"
copies = ["joint_1", "joint_2", "joint_3"]
stiffness = "{stiffness:g} N/m"
damping = "{1e-4 * stiffness:g} N s/m"
"""
    return pn.Circuit.load(text.replace("[initial]", f"{table}\n[initial]"))


@pytest.mark.parametrize("kind", ["platform/3-rps", "platform/6-ups", "platform/linear-delta"])
def test_the_state_matrix_is_that_of_differences(kind):
    """The row of one coordinate's acceleration, by every state, in a moving state."""
    own = platform_air.machine(kind)
    circuit = _core.Circuit(json.dumps(platform_air.circuit(kind)))
    session = circuit.start(platform_air.start(own), 1e-6)
    for i, commands in enumerate(platform_air.COMMANDS[: len(own.frame)], start=1):
        session.set(f"valve_{i}.command", commands[0])
    session.advance(0.05)
    state, names = np.array(session.state), [name for name, _ in session.states]
    key = "heave" if kind == "platform/3-rps" else "z"
    row = np.asarray(session.linearise([])["a"])[names.index(f"platform.{key}_rate_m_s")]

    def acceleration(y):
        other = circuit.start(list(y), 1e-6)
        for i, commands in enumerate(platform_air.COMMANDS[: len(own.frame)], start=1):
            other.set(f"valve_{i}.command", commands[0])
        return other.read(f"platform.{key}_acceleration_m_s2")

    sizes = np.array([{"kg": 1e-4, "J": 10.0}.get(unit, 1.0) for _, unit in session.states])
    for j, size in enumerate(sizes):
        step = np.zeros(len(state))
        step[j] = 1e-6 * size if "deflection" not in names[j] else 1e-9
        slope = (acceleration(state + step) - acceleration(state - step)) / (2.0 * step[j])
        assert row[j] * size == pytest.approx(slope * size, rel=1e-6, abs=2e-6 * np.max(np.abs(row * sizes))), names[j]


def test_stiff_joints_come_near_rigid_legs_by_the_first_order():
    rigid = pn.Circuit.load(TRIPOD).simulate(COMMANDS, "0.3 s", rtol=1e-8)
    apart = []
    for stiffness in (1e6, 1e7, 1e8):
        run = jointed(stiffness).simulate(COMMANDS, "0.3 s", rtol=1e-8)
        apart.append(max(float(abs(run[leg] - rigid[leg]).max()) for leg in LEGS))
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.1)
    assert apart[1] / apart[2] == pytest.approx(10.0, rel=0.1)


@pytest.mark.parametrize("law", STICKING)
def test_laws_with_a_stick_mode_act_through_couplings(law):
    circuit = jointed(1e7, STICKING[law])
    ledger = circuit.simulate(COMMANDS, "0.3 s", ledger=True).attrs["ledger"]
    assert abs(ledger["energy_error"]) < 1e-9 * ledger["energy_turnover_j"]


@pytest.mark.parametrize("law", ["stribeck", "karnopp"])
def test_shut_valves_hold_a_tilted_platform(law):
    session = jointed(1e7, STICKING[law]).start({"tripod.tilt_1": "4 deg"})
    places = []
    for until in (10.0, 70.0):
        session.advance(until)
        places.append([session.read(f"leg_{i}.position_m") for i in (1, 2, 3)])
    assert max(places[0]) - min(places[0]) > 15e-3
    assert places[1] == pytest.approx(places[0], abs=1e-6)


def test_sensitivities_are_those_of_differences():
    names = ["tripod.mass", "tripod.centre_z", "tripod.frame_1_x", "leg_1.bore", "leg_2.friction.coulomb"]
    radius = 'platform_radius = "200 mm"'
    joint = 'frame_1 = { x = "255 mm", y = "-3 mm", z = "12 mm" }'
    circuit = pn.Circuit.load(TRIPOD.read_text("utf-8").replace(radius, f"{radius}\n{joint}"))
    start = {"tripod.heave": "440 mm", "tripod.tilt_1": "3 deg"}
    asked = {"vary": names, "outputs": ["final(tripod.heave)", "final(tripod.tilt_1)"], "initial": start, "rtol": 1e-11}
    of = pn.Differentiable(circuit, COMMANDS, "0.3 s", sample_rate="100 Hz", **asked)
    slopes = of.jacobian(of.start)
    for k, value in enumerate(of.start):
        step = np.zeros(len(names))
        step[k] = 1e-4 * value
        expected = (of(of.start + step) - of(of.start - step)) / (2e-4 * value)
        assert slopes[:, k] == pytest.approx(expected, rel=1e-5)


def test_a_restored_session_has_the_same_bits_and_hits_are_reported():
    circuit = pn.Circuit.load(TRIPOD)
    full = {"valve_1": [(0.0, 1.0)], "valve_2": [(0.0, 1.0)], "valve_3": [(0.0, 1.0)]}
    run = circuit.simulate(full, "0.5 s", ledger=True)
    impacts = run.attrs["impacts"]
    assert {impact["cylinder"] for impact in impacts} == {"leg_1", "leg_2", "leg_3"}
    assert all(impact["at_b"] if "at_b" in impact else impact["end"] == "b" for impact in impacts)
    assert abs(run.attrs["ledger"]["energy_error"]) < 1e-9 * run.attrs["ledger"]["energy_turnover_j"]
    session = circuit.start()
    session.set("valve_1.command", 0.3)
    session.advance(0.1)
    saved = session.save()
    session.advance(0.2)
    first = session.read("leg_1.position_m")
    session.restore(saved)
    session.advance(0.2)
    assert session.read("leg_1.position_m") == first


@pytest.mark.parametrize("name", ["published_3rps", "published_linear_delta"])
def test_the_arrangements_of_published_machines_run_and_mark_every_number(name):
    circuit = pn.Circuit.load(TRIPOD.with_name(f"{name}.toml"))
    run = circuit.simulate({"valve_1": [(0.0, 0.3)], "valve_2": [(0.0, -0.2)]}, "0.2 s", ledger=True)
    assert abs(run.attrs["ledger"]["energy_error"]) < 1e-9
    plain = [key for key, value in circuit.origin_of.items() if not value.assumed]
    assert plain == []


STAR = pn.Circuit.load(TRIPOD.parent / "published_linear_delta.toml").to_dict()


def star(z_mm, **changes):
    """Return the flat star of the examples, with its platform at this height, mm."""
    tables = json.loads(json.dumps(STAR))
    tables["initial"]["delta.z"] = f"{z_mm} mm"
    tables["components"]["delta"] |= changes
    return pn.Circuit.model_validate(tables)


def test_a_linear_delta_starts_in_the_pose_of_the_file():
    """Carriages in a star have the same places for a platform above and below them."""
    above, below = (star(z).simulate(None, "2 ms")["delta.z"] for z in (250.0, -250.0))
    assert [above[0], below[0]] == pytest.approx([0.25, -0.25], abs=1e-12)
    assert above[-1] + below[-1] < -1e-7  # both fall
    with pytest.raises(DescriptionError, match=r"(?s)also fit the pose .*z = -250 mm.*near = \{ z = \.\.\. \}"):
        star(-300.0).simulate(None, "2 ms", initial="delta.z = 250 mm")
    platform = pn.platform(star(250.0))
    assert platform.forward(platform.inverse([0.0, 0.0, 0.25])) == pytest.approx([0.0, 0.0, 0.25], abs=1e-9)


def test_a_platform_stands_on_guides_that_point_down():
    """Carriages are ahead of their platform: it is above them."""
    down = {f"direction_{i}": {"x": 0.0, "y": 0.0, "z": -1.0} for i in (1, 2, 3)}
    tables = json.loads(json.dumps(STAR))
    delta = tables["components"]["delta"]
    tables["components"]["delta"] = {key: delta[key] for key in delta if not key.startswith("direction")} | down
    circuit = pn.Circuit.model_validate(tables)
    z = circuit.simulate(None, "2 ms")["delta.z"]
    arm, across, half = 0.4, 0.1 - 0.06, 0.2
    assert z[0] == pytest.approx(np.sqrt(arm**2 - across**2) - half, abs=1e-9)


def test_a_run_through_a_singular_pose_warns():
    """The weight pulls a platform above a star through the plane of its arms."""
    with pytest.warns(PneudriveWarning, match="delta passes a singular pose at .* near x = 0 mm"):
        run = star(10.0).simulate(None, "0.5 s")
    assert run["delta.z"][-1] < 0.0 < run["delta.z"][0]
