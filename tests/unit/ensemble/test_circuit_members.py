"""Members of a circuit, and members each with a command, a duration and a start of its own: the single run's bits."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import CommandError, PneudriveWarning

EXAMPLES = Path(__file__).parents[3] / "examples"
CIRCUIT = pn.Circuit.load(EXAMPLES / "two_cylinders.toml")
AXIS = pn.Circuit.load(EXAMPLES / "cushioned_axis.toml")
DRIVE = pn.Drive.load("catalogue:reference")
STEPS = ["0 s: 1", "0 s: 1, 30 ms: -1", "0 s: 0.5", "0 s: 0.4, 30 ms: 1"]


class Elsewhere:
    """Runs chunks as another machine would: it gets no more than what was sent to it, the last one first."""

    def map(self, work, items):
        return (work(pickle.loads(sent)) for sent in [pickle.dumps(item) for item in items][::-1])


def same_bits(many, k, alone):
    kept = [name for name in many.data_vars if name.startswith("final_")]
    assert len(kept) >= 6
    for name in kept:
        assert many[name][k].item() == alone[name.removeprefix("final_")][-1].item(), name


def test_members_of_a_circuit_are_its_single_runs_to_the_last_bit():
    vary = {
        "left.bore": ["30 mm", "32 mm", "34 mm", "36 mm"],
        "right.friction.coulomb": ["18 N", "20 N", "22 N", "24 N"],
        "valve_l.conductance": ["1 dm3/(s bar)", "1.1 dm3/(s bar)", "1.2 dm3/(s bar)", "1.3 dm3/(s bar)"],
    }
    commands = {"valve_l": STEPS, "valve_r": 1.0}
    places = [{"left.position": f"{k} mm", "tank": "5 bar abs"} for k in range(4)]
    outputs = [f"final({name})" for name in ("left.position", "right.position", "left.velocity", "left.a.pressure")]
    outputs += ["final(valve_l.4.temperature)", "final(tank.pressure)", "samples(left.velocity, 1 kHz)"]
    many = pn.simulate_many(CIRCUIT, commands, "60 ms", vary=vary, initial=places, outputs=outputs)
    for k, steps in enumerate(STEPS):
        own = {f"components.{name}": values[k] for name, values in vary.items()}
        alone = CIRCUIT.replace(own).simulate({"valve_l": steps, "valve_r": 1.0}, "60 ms", initial=places[k])
        same_bits(many, k, alone)
        np.testing.assert_array_equal(many["left.velocity"][k], alone["left.velocity"])
    dicts = [{"valve_l": steps, "valve_r": 1.0} for steps in STEPS]
    options = {"initial": places, "outputs": outputs[:-1], "chunk": 3, "executor": Elsewhere()}
    again = pn.simulate_many(CIRCUIT, dicts, "60 ms", vary=vary, **options)
    for name in ("final_left.position", "final_tank.pressure"):
        np.testing.assert_array_equal(again[name], many[name])


def test_what_follows_from_a_number_of_a_circuit_moves_with_it():
    """The tank and the chambers start at the pressure of the mains, gauge pressures move with the ambient one."""
    vary = {"mains.pressure": ["5 bar abs", "7 bar abs"], "ambient.pressure": ["0.9 bar abs", "1.1 bar abs"]}
    vary |= {"left.stroke": ["0.1 m", "0.12 m"], "initial.left.b": ["3 bar abs", "4 bar abs"]}
    circuit = CIRCUIT.replace({"initial": {"right.position": "20 mm"}})
    many = pn.simulate_many(circuit, {"valve_l": 1.0}, "20 ms", vary=vary)
    for k in range(2):
        changes = {("" if name.startswith("ambient") else "components.") + name: x[k] for name, x in vary.items()}
        initial = {"left.b": changes.pop("components.initial.left.b")}
        same_bits(many, k, circuit.replace(changes).simulate({"valve_l": 1.0}, "20 ms", initial=initial))
    assert many["final_tank.pressure"][1] > many["final_tank.pressure"][0] + 1.5e5


def test_a_circuit_with_one_valve_takes_commands_without_a_name():
    vary = {"slide.mass": ["2 kg", "4 kg"]}
    many = pn.simulate_many(AXIS, ["0 s: 1", "0 s: 1, 0.1 s: -0.5"], ["0.12 s", "0.15 s"], vary=vary)
    for k, (steps, seconds) in enumerate((("0 s: 1", "0.12 s"), ("0 s: 1, 0.1 s: -0.5", "0.15 s"))):
        same_bits(many, k, AXIS.replace({"components.slide.mass": vary["slide.mass"][k]}).simulate(steps, seconds))


def test_each_member_of_a_drive_has_its_command_its_duration_and_its_start():
    vary, seconds = {"load.mass": [0.0, 1.0, 2.0, 3.0]}, [0.05, 0.08, 0.06, 0.07]
    starts = [{"position": f"{100 + k} mm"} for k in range(4)]
    many = pn.simulate_many(DRIVE, STEPS, seconds, vary=vary, initial=starts)
    for k, steps in enumerate(STEPS):
        alone = pn.simulate(DRIVE.replace({"load.mass": f"{k} kg"}), steps, seconds[k], initial=starts[k])
        same_bits(many, k, alone)
    pairs = np.array([[(0.0, 1.0), (0.03, u)] for u in (-1.0, 0.0, 0.5, 1.0)])
    by_array = pn.simulate_many(DRIVE, pairs, "60 ms", vary=vary)
    same_bits(by_array, 2, pn.simulate(DRIVE.replace({"load.mass": "2 kg"}), [(0.0, 1.0), (0.03, 0.5)], "60 ms"))
    constant = pn.simulate_many(DRIVE, np.array([1.0, -1.0, 0.5, 0.0]), "60 ms", vary=vary)
    same_bits(constant, 1, pn.simulate(DRIVE.replace({"load.mass": "1 kg"}), -1.0, "60 ms"))


def test_a_folder_knows_the_commands_of_its_members(tmp_path):
    vary, options = {"load.mass": [0.0, 1.0, 2.0]}, {"outputs": ["final(position)"], "chunk": 2}
    commands = ["0 s: 1", "0 s: 0.5", "0 s: 1"]
    many = pn.simulate_many(DRIVE, commands, "20 ms", vary=vary, out=tmp_path / "study", **options)
    again = pn.simulate_many(DRIVE, commands, "20 ms", vary=vary, out=tmp_path / "study", **options)
    np.testing.assert_array_equal(again.final_position, many.final_position)
    with pytest.raises(CommandError, match="only with the same command"):
        pn.simulate_many(DRIVE, [*commands[:2], "0.1"], "20 ms", vary=vary, out=tmp_path / "study", **options)


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"command": ["0 s: 1", "0 s: 0.5"]}, "the command of valve_l has 2 entries, but there are 3 members"),
        ({"command": {"valve_l": ["1", "2", "0"]}}, "valve_l: member 1: command = 2 at 0 s"),
        ({"command": {"valve_x": 1.0}}, 'no component "valve_x" takes a command'),
        ({"command": [{"valve_l": 1.0}, {"valve_r": 1.0}, {}]}, "commands of different components"),
        ({"command": {"valve_l": abs}}, "a function cannot command"),
        ({"duration": ["1 ms", "2 ms"]}, "duration has 2 entries, but there are 3 members"),
        ({"duration": [1e-3, 1e-3, 0.0]}, "duration of member 2 = 0.0"),
        ({"duration": [1e-3, 2e-3, 3e-3], "outputs": ["samples(left.position)"]}, "different durations"),
        ({"initial": [{"tank": "5 bar abs"}] * 2}, "initial has 2 start states, but there are 3 members"),
        ({"initial": [{"tank": "5 bar abs"}, {"left.a": "5 bar abs"}, {}]}, "different keys"),
        ({"initial": [{"left.position": f"{x} mm"} for x in (5, 500, 5)]}, "row 1 of the design: left.position = 500"),
        ({"vary": {"ambient.pressure": [1e5] * 3}, "initial": [{"tank": "5 bar gauge"}] * 3}, "which varies"),
        ({"vary": {"left.bor": [0.03]}}, "Did you mean 'left.bore'?"),
        ({"vary": {"left.bore": [0.03, 0.005, 0.03]}}, "row 1 of the design"),
        ({"vary": {"left.bore": [0.03, 0.01, 0.03], "left.rod_diameter": [0.012] * 3}}, "row 1 of the design"),
        ({"vary": {"left.friction.coulomb": [20.0, 60.0, 20.0]}}, "row 1 of the design"),
        ({"outputs": ["stroke_time"]}, "one piston"),
    ],
)
def test_what_does_not_fit_is_one_message_before_anything_runs(told, said):
    asked = {"command": {"valve_l": 1.0}, "duration": "1 ms", "vary": {"left.bore": [0.03, 0.031, 0.032]}} | told
    if isinstance(asked["command"], list) and isinstance(asked["command"][0], str):
        asked["command"] = {"valve_l": asked["command"]}
    with pytest.raises(CommandError) as found:
        pn.simulate_many(CIRCUIT, asked.pop("command"), asked.pop("duration"), **asked)
    assert said in str(found.value)


# --- Sensitivities through members of a drive: what physics says.


def test_few_points_show_what_moves_a_drive_and_what_does_not():
    vary = {
        "load.mass": "uniform(1 kg, 5 kg)",
        "friction.viscous": "normal(40 N s/m, 1 %)",
        "cylinder.end_stop.stiffness": "uniform(0.5 kN/mm, 2 kN/mm)",
    }
    found = pn.sensitivity(DRIVE, 1.0, "0.05 s", vary=vary, outputs=["max(velocity)"], n=16)
    total = found.total.sel(output="max_velocity")
    assert total.sel(number="load.mass") > 20 * total.sel(number="friction.viscous") > 0.0
    assert total.sel(number="cylinder.end_stop.stiffness") == 0.0  # the stop is not reached
    assert found.unit.values.tolist() == ["m/s"]


def test_points_with_a_failed_member_are_left_out_and_told():
    vary = {"load.force": "uniform(-100 N, 1e6 N)", "load.mass": "uniform(1 kg, 2 kg)"}
    with pytest.warns(PneudriveWarning, match="members failed; some members have no final_position"):
        found = pn.sensitivity(DRIVE, 1.0, "2 ms", vary=vary, outputs=["final(position)"], n=64, rtol=1e-3)
    assert 0 <= found.used.item() < 64


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"vary": {"load.mass": [1.0, 2.0]}}, "one distribution for each number"),
        ({"outputs": ["samples(position)"]}, "is sampled"),
        ({"n": 1}, "out of bounds"),
    ],
)
def test_what_has_no_sensitivity_is_refused(options, said):
    with pytest.raises(CommandError) as told:
        pn.sensitivity(DRIVE, 1.0, "1 ms", **{"vary": {"load.mass": "uniform(1 kg, 2 kg)"}, "n": 4, **options})
    assert said in str(told.value)


def test_members_and_sensitivities_have_a_view_with_fans_and_bars():
    vary = {"load.mass": "uniform(1 kg, 5 kg)", "friction.viscous": "normal(40 N s/m, 10 %)"}
    outputs = ["samples(position, 500 Hz)", "max(velocity)"]
    members = pn.simulate_many(DRIVE, 1.0, "20 ms", vary=vary, n=16, outputs=outputs).pneu.view()
    assert "16 members, 0 failed" in members.title
    assert [shown.name for shown in members.figures] == ["fan", "members"]
    found = pn.sensitivity(DRIVE, 1.0, "50 ms", vary=vary, outputs=["max(velocity)"], n=64)
    view = found.pneu.view()
    most = view.leading[0]
    assert most.quantity == "max_velocity, most by load.mass: total"
    assert most.value == found.total.sel(number="load.mass", output="max_velocity")
    assert most.interval == tuple(found.total_interval.sel(number="load.mass", output="max_velocity").values)
    assert view.figures[0].figure.panels[0].title == "max_velocity"
