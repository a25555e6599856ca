"""A drive as an FMU does in FMPy, with its CVode too, what `pn.simulate` does; and bears whatever a tool does."""

from __future__ import annotations

import ctypes
import re
import subprocess
import sys
import threading
from itertools import pairwise
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu

import pneudrive as pn
from oracle import fmu_calls
from pneudrive import _core
from pneudrive.cli.main import run as command_line
from pneudrive.errors import CommandError, DescriptionError
from pneudrive.fmu import package
from pneudrive.fmu.variables import plan_of
from pneudrive.simulation.trajectory import meaning
from trials import random_circuits

SMOOTH = pn.Drive.load("catalogue:reference")  # bristles, no event
STICKY = SMOOTH.replace({"friction": {"law": "coulomb", "coulomb": "30 N", "viscous": "40 N s/m"}})
# The valve is slow behind a dead time: its command is a discrete input, and has events in time.
LATE = SMOOTH.circuit.replace({"components.valve.delay": "4 ms", "components.valve.frequency": "80 Hz"})
COMMAND = [(0.0, 0.03), (0.2, 0.0), (0.3, -0.05), (0.4, 0.3)]
DURATION = 0.6


def signal(name, command=COMMAND):
    """Return the command as tools have it in a table: a step is two rows of one time."""
    rows = [(0.0, command[0][1])]
    for (_, before), (at, value) in pairwise(command):
        rows += [(at, before), (at, value)]
    return np.array([*rows, (DURATION, command[-1][1])], dtype=[("time", float), (name, float)])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """FMUs by drive and version, as files."""
    folder, files = tmp_path_factory.mktemp("fmu"), {}

    def make(name, version="2.0"):
        if (name, version) not in files:
            drive = {"smooth": SMOOTH, "sticky": STICKY, "late": LATE}[name]
            start = "cylinder.position = 100 mm" if name == "late" else "position = 100 mm"
            path = folder / f"{name}{version}.fmu"
            files[name, version] = pn.export_fmu(drive, path, version=version, initial=start).path
        return str(files[name, version])

    return make


class Tool:
    """An instance of an FMU by FMI 2.0 in co-simulation, with the messages that it gives."""

    def __init__(self, path, token=None):
        self.folder, self.about = extract(path), read_model_description(path)
        self.messages = []
        self.reference = {one.name: one.valueReference for one in self.about.modelVariables}
        log = fmi2CallbackLoggerTYPE(lambda _env, _name, _status, _category, text: self.messages.append(text.decode()))
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = log
        self._kept = log
        self.fmu = FMU2Slave(
            guid=token or self.about.guid, unzipDirectory=self.folder, modelIdentifier="pneudrive", instanceName="one"
        )
        self.fmu.instantiate(callbacks=self.callbacks)

    def begin(self, **values):
        self.fmu.setupExperiment()
        self.set(**values)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def set(self, **values):
        names = [name.replace("__", ".") for name in values]
        self.fmu.setReal([self.reference[name] for name in names], list(values.values()))

    def get(self, *names):
        return np.array(self.fmu.getReal([self.reference[name] for name in names]))

    def refuses(self, act, message):
        before = len(self.messages)
        with pytest.raises(Exception, match="status"):
            act()
        assert message in " ".join(self.messages[before:])


def test_fmus_are_valid_and_move_as_simulate_does(made):
    for name, drive in {"smooth": SMOOTH, "sticky": STICKY, "late": LATE}.items():
        of = "cylinder." if name == "late" else ""
        command = {"valve": COMMAND} if name == "late" else COMMAND
        truth = pn.simulate(drive, command, DURATION, initial={f"{of}position": "100 mm"}, rtol=1e-9)
        position, pressure = truth[f"{of}position"].values, truth[f"{of}{'a.pressure' if of else 'pressure_a'}"].values
        given = signal("valve.command" if of else "command")
        for version in {"smooth": ("2.0", "3.0"), "sticky": ("2.0",), "late": ("3.0",)}[name]:
            path = made(name, version)
            assert validate_fmu(path) == []
            for kind, tolerance in (("CoSimulation", None), ("ModelExchange", 1e-6)):
                seen = simulate_fmu(
                    path, fmi_type=kind, stop_time=DURATION, output_interval=1e-3, input=given,
                    relative_tolerance=tolerance,
                )  # fmt: skip
                at = np.searchsorted(seen["time"], truth.time.values - 1e-9)
                away = np.abs(seen[f"{of}position"][at] - position).max()
                assert away < (0.02e-6 if kind == "CoSimulation" else 1e-6), (name, version, kind)
                assert np.abs(seen[f"{of}{'a.pressure' if of else 'pressure_a'}"][at] - pressure).max() < 50.0


#: Fractions of the stroke and commands with which a tool that integrates the whole position was 1.6 to 2.4 um off.
SLOW = [(0.0, 0.03), (0.2, 0.0), (0.3, -0.05)]
STEPS = [(0.0, 0.3), (0.2, -0.3), (0.4, 0.3)]
TOLD = [(0.02, [(0.0, 1.0), (0.3, -1.0)]), (0.75, SLOW), (0.02, STEPS), (0.25, STEPS), (0.75, STEPS)]


def exchanged(drive, folder, command, start, rtol):
    """Return the largest error of the position by FMPy's CVode, m."""
    truth = pn.simulate(drive, command, DURATION, initial=start, rtol=1e-10)
    seen = simulate_fmu(
        str(pn.export_fmu(drive, folder / "one.fmu", initial=start).path), fmi_type="ModelExchange",
        stop_time=DURATION, output_interval=1e-3, input=signal("command", command), relative_tolerance=rtol,
    )  # fmt: skip
    at = np.searchsorted(seen["time"], truth.time.values - 1e-9)
    return np.abs(seen["position"][at] - truth.position.values).max()


def test_a_drive_from_the_catalogue_is_within_a_micrometre_at_one_millionth(tmp_path):
    """A tool integrates changes since an event: its tolerance is not one of the whole position."""
    drive = pn.Drive.load("catalogue:parker-osp-p25-mpye")
    for share, command in TOLD:
        start = {"position": f"{share * drive.cylinder.stroke_m} m"}
        assert exchanged(drive, tmp_path, command, start, 1e-6) < 0.4e-6, (share, command)


def test_a_fast_reversal_does_not_pass_over_the_breakaway_peak(tmp_path):
    """Shut in between two chambers the piston swings: with the peak unseen it was 34 um off, at 1e-8 too."""
    law = {"law": "stribeck", "coulomb": "24 N", "breakaway": "60 N", "stribeck_velocity": "5 mm/s"}
    drive, start = SMOOTH.replace({"friction": law}), {"position": "150 mm", "pressure_a": "7 bar abs"}
    assert exchanged(drive, tmp_path, [(0.0, 0.0)], start, 1e-7) < 1e-6


def test_every_state_is_described_with_its_size(made):
    """Without one a tool takes 1: for the mass of the gas, 1e-5 kg, no tolerance at all."""
    for version, slave in (("2.0", FMU2Model), ("3.0", FMU3Model)):
        path = made("smooth", version)
        about = read_model_description(path)
        token = about.guid or about.instantiationToken
        fmu = slave(guid=token, unzipDirectory=extract(path), modelIdentifier="pneudrive")
        fmu.instantiate()
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        sizes = (ctypes.c_double * len(about.derivatives))()
        fmu.getNominalsOfContinuousStates(sizes, len(sizes))
        states = [one.variable.derivative for one in about.derivatives]
        assert [float(one.nominal) for one in states] == list(sizes)
        assert 1e-8 < float(next(one.nominal for one in states if one.name == "mass_a_change")) < 1e-5
        assert not [one.name for one in about.modelVariables if one.nominal and one not in states]


def test_states_begin_anew_at_an_event_and_saved_ones_keep_from_where(made):
    path = made("smooth")
    about, seen = read_model_description(path), []
    n, reference = len(about.derivatives), {one.name: one.valueReference for one in about.modelVariables}
    first, second = (
        FMU2Model(guid=about.guid, unzipDirectory=extract(path), modelIdentifier="pneudrive") for _ in range(2)
    )
    for fmu in (first, second):
        fmu.instantiate()
        fmu.setupExperiment()
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
    states = (ctypes.c_double * n)()
    first.enterContinuousTimeMode()
    first.setTime(1e-3)
    first.setContinuousStates((ctypes.c_double * n)(0.05), n)
    assert first.getReal([reference["position"], reference["position_change"]]) == pytest.approx([0.15, 0.05])
    first.enterEventMode()
    assert first.newDiscreteStates()[3], "the tool is told"
    assert not first.newDiscreteStates()[3]
    kept = first.serializeFMUstate(first.getFMUstate())
    second.setFMUstate(second.deSerializeFMUstate(kept))
    for fmu in (first, second):
        fmu.enterContinuousTimeMode()
        fmu.getContinuousStates(states, n)
        assert list(states) == [0.0] * n
        fmu.setContinuousStates((ctypes.c_double * n)(0.01), n)
        seen.append(fmu.getReal([reference["position"], reference["pressure_a"], reference["der(velocity)"]]))
    assert seen[0] == seen[1]
    assert seen[0][0] == pytest.approx(0.16)


def test_rollbacks_across_stick_and_slip_give_the_same_bits(made):
    tool, rng = Tool(made("sticky")).begin(command=0.03), np.random.default_rng(1)
    names = [one.name for one in tool.about.modelVariables if one.causality in ("output", "local")]
    t, moved = 0.0, []
    for _ in range(400):
        step, command = rng.uniform(1e-4, 3e-3), rng.choice([-0.3, 0.0, 0.3])
        state = tool.fmu.getFMUstate()
        seen = []
        for _ in range(2):
            tool.fmu.setFMUstate(state)
            tool.set(command=command)
            tool.fmu.doStep(t, step)
            seen.append(tool.get(*names))
        assert seen[0].tobytes() == seen[1].tobytes()
        tool.fmu.freeFMUstate(state)
        t += step
        moved.append(tool.get("velocity")[0] != 0.0)
    assert np.count_nonzero(np.diff(moved)) > 5, "the piston sticks and slips on the way"


def test_pulses_begin_with_the_command_that_is_set_on_their_edge(tmp_path):
    """Two valves of other widths, whose pulses begin at one instant: a master sets both there, and CVode goes on."""
    circuit = pn.Circuit.load(Path(__file__).parents[2] / "examples/pwm_axis.toml")
    given = {"in_a": [(0.0, 0.63), (0.02, 0.3)], "out_b": [(0.0, 0.47), (0.02, 0.6)]}
    truth = float(pn.simulate(circuit, given, "0.12 s", rtol=1e-9)["cylinder.position"][-1])
    path = str(pn.export_fmu(circuit, tmp_path / "pulses.fmu").path)
    tool = Tool(path).begin(in_a__command=0.63, out_b__command=0.47)
    tool.fmu.doStep(0.0, 0.02)
    tool.set(in_a__command=0.3, out_b__command=0.6)
    tool.fmu.doStep(0.02, 0.1)
    assert abs(tool.get("cylinder.position")[0] - truth) < 0.02e-6
    rows = [(0.0, 0.63, 0.47), (0.02, 0.63, 0.47), (0.02, 0.3, 0.6), (0.12, 0.3, 0.6)]
    seen = simulate_fmu(
        path, fmi_type="ModelExchange", stop_time=0.12, output_interval=1e-3, relative_tolerance=1e-6,
        input=np.array(rows, dtype=[("time", float), ("in_a.command", float), ("out_b.command", float)]),
    )  # fmt: skip
    assert abs(seen["cylinder.position"][-1] - truth) < 1e-6


def test_a_saved_state_goes_on_in_another_instance(made):
    first, second = Tool(made("sticky")).begin(command=0.03), Tool(made("sticky")).begin(command=-0.4)
    first.fmu.doStep(0.0, 0.05)
    state = first.fmu.getFMUstate()
    saved = first.fmu.serializeFMUstate(state)
    first.fmu.doStep(0.05, 0.05)
    other = second.fmu.deSerializeFMUstate(saved)
    second.fmu.setFMUstate(other)
    second.fmu.doStep(0.05, 0.05)
    assert second.get("position", "pressure_b").tobytes() == first.get("position", "pressure_b").tobytes()
    second.refuses(lambda: second.fmu.deSerializeFMUstate(saved[:-9]), "damaged")


def test_parameters_and_starts_are_those_of_another_drive_file(made):
    tool = Tool(made("smooth")).begin(
        command=0.5, friction__coulomb=40.0, cylinder__bore=0.03, supply__pressure=6e5, start__pressure_a=3e5
    )
    tool.fmu.doStep(0.0, 0.1)
    changes = {"friction.coulomb": "40 N", "cylinder.bore": "30 mm", "supply.pressure": "6 bar abs"}
    session = SMOOTH.replace(changes).start({"position": "100 mm", "pressure_a": "3 bar abs"}, rtol=1e-7)
    session.set("command", 0.5)
    session.advance(0.1)
    assert tool.get("position")[0] == session.read("position_m")


def test_tubes_begin_in_the_fmu_as_in_a_session(tmp_path):
    """Their gas follows the pressure of its chamber, not the temperature."""
    control = {"needle_conductance": "0.07 dm3/(s bar)", "throttles": "out"}
    tubes = {"a": {"length": "1 m", "diameter": "4 mm"}, "b": {"length": "0.5 m", "diameter": "4 mm"}}
    drive = pn.Drive.load("catalogue:starter").replace({"tubing": tubes, "flow_control": {"b": control}})
    values = {"start__pressure_a": 3e5, "start__temperature_a": 333.15, "start__position": 0.1}
    tool = Tool(str(pn.export_fmu(drive, tmp_path / "tubes.fmu").path)).begin(command=0.05, **values)
    start = {"position": "100 mm", "pressure_a": "3 bar abs", "temperature_a": "60 degC"}
    session = drive.start(start, rtol=1e-7)
    session.set("command", 0.05)
    outputs = {one.name: one for one in tool.about.modelVariables if one.causality == "output"}
    columns = {meaning(one.name)[0]: one.name for one in session.variables if one.kind == "output"}
    assert {"valve.4.temperature", "tube_a.mass_flow", "pressure_b"} <= outputs.keys() <= columns.keys()
    for until in (0.0, 0.2):
        tool.fmu.doStep(0.0, until)
        session.advance(until)
        assert list(tool.get(*outputs)) == [session.read(columns[name]) for name in outputs]


def test_variables_of_circuits_of_all_kinds_have_one_name_and_the_unit_of_the_core():
    seen = set()
    for number in range(50):
        _, circuit, _ = random_circuits.case(20_000, number)
        plan = plan_of(circuit)  # two variables of one name end it
        units = dict(circuit.system.compiled().start(plan.start, 1e-6).states)
        for name, one in circuit.components.items():
            units |= {f"{name}.{own['name']}": own["unit"] for own in one.entry["outputs"]}
            seen.add(one.entry["kind"])
        for own in plan.variables:
            core = units.get(str(own.role.get("of")))
            if core is not None:
                rate = {"s": -1} if own.rate_of else {}
                powers = package.exponents(core)
                wanted = {base: powers.get(base, 0) + rate.get(base, 0) for base in {*powers, *rate}}
                assert package.exponents(own.unit) == {base: p for base, p in wanted.items() if p}, own.name
    assert {"regulator/electro-pneumatic", "valve/proportional-5/3", "carriage"} <= seen
    columns = ("valve.speed_1_s", "reg.acting_set_pressure_rate_pa_s", "axis.jerk_m_s3")
    assert [meaning(one)[:2] for one in columns] == [
        ("valve.speed", "1/s"),
        ("reg.acting_set_pressure_rate", "Pa/s"),
        ("axis.jerk", "m/s^3"),
    ]


def test_directional_derivatives_are_those_of_differences(made):
    tool = Tool(made("smooth")).begin(command=0.5)
    tool.fmu.doStep(0.0, 0.02)
    unknown, known = tool.reference["der(velocity)"], tool.reference["force"]
    found = tool.fmu.getDirectionalDerivative([unknown], [known], [1.0])[0]
    ends = []
    for force in (1.0, -1.0):
        tool.set(force=force)
        ends.append(tool.get("der(velocity)")[0])
    assert found == pytest.approx((ends[0] - ends[1]) / 2.0, rel=1e-8)
    assert found == pytest.approx(1.0 / 2.0, rel=1e-9)  # the mass is 2 kg

    about = read_model_description(made("smooth", "3.0"))
    three = FMU3Slave(
        guid=about.instantiationToken, unzipDirectory=extract(made("smooth", "3.0")), modelIdentifier="pneudrive"
    )
    three.instantiate()
    three.setFloat64([tool.reference["command"]], [0.5])
    three.enterInitializationMode()
    three.exitInitializationMode()
    three.doStep(0.0, 0.02)
    unknowns = [tool.reference[name] for name in ("der(velocity)", "pressure_a", "mass_flow_b")]
    knowns = [tool.reference[name] for name in ("position", "mass_a", "force", "command")]
    columns = [three.getDirectionalDerivative(unknowns, [known], [1.0]) for known in knowns]
    weights = [0.3, 1e-4, -2.0]
    rows = three.getAdjointDerivative(unknowns, knowns, weights, nSensitivity=len(knowns))
    assert rows == pytest.approx(np.array(columns) @ weights, rel=1e-12)
    assert np.count_nonzero(columns) == 5, "pressure follows from energy and volume, so not from the mass of the gas"


def test_wrong_wishes_are_refused_with_a_message_in_every_phase(made):
    path = made("smooth")
    with pytest.raises(Exception, match="instantiate"):
        Tool(path, token="{another}")
    tool = Tool(path)
    tool.refuses(lambda: tool.set(command=float("nan")), "command = NaN is not a number")
    tool.refuses(lambda: tool.fmu.doStep(0.0, 1e-3), "not allowed in phase Instantiated")
    tool.refuses(lambda: tool.fmu.getReal([9999]), "no variable with value reference 9999")
    tool.refuses(
        lambda: tool.fmu.setupExperiment(startTime=1.0, stopTime=0.5), "must not be before the start time, 1 s"
    )
    tool.refuses(lambda: tool.begin(cylinder__bore=-1.0), "cylinder.bore = -1 m is out of bounds")
    tool.set(cylinder__bore=0.025)
    tool.set(cylinder__incline=62.0)
    tool.refuses(tool.fmu.exitInitializationMode, "cylinder.incline = 62 rad is out of bounds")
    tool.set(cylinder__incline=0.0, ambient__pressure=0.0)
    tool.refuses(tool.fmu.exitInitializationMode, "ambient.pressure = 0 Pa is out of bounds")
    tool.set(ambient__pressure=101325.0, cylinder__dead_volume__a=1e308)
    tool.refuses(tool.fmu.exitInitializationMode, "it must be at most 1e30 in size")
    tool.set(cylinder__dead_volume__a=1e-5)
    tool.fmu.exitInitializationMode()
    tool.refuses(lambda: tool.set(command=2.0), "valve.command = 2 is out of bounds")
    tool.refuses(lambda: tool.set(cylinder__bore=0.03), "cylinder.bore is fixed")
    tool.refuses(lambda: tool.set(position=0.03), "position cannot be set")
    tool.refuses(lambda: tool.fmu.doStep(0.5, 1e-3), "the present time is 0 s")
    tool.refuses(lambda: tool.fmu.getInteger([0]), "no variable of type Integer")
    tool.fmu.doStep(0.0, 1e-3)  # and it goes on


def test_instances_live_apart_in_threads_and_leave_no_memory(made):
    path, seen = made("sticky"), {}

    def live(key, command):
        tool = Tool(path).begin(command=command)
        for k in range(200):
            tool.fmu.doStep(k * 1e-3, 1e-3)
        seen[key] = tool.get("position")[0]

    threads = [threading.Thread(target=live, args=(i, 0.6 if i % 2 else -0.6)) for i in range(4)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert seen[0] == seen[2]
    assert seen[1] == seen[3] > seen[0]

    tool = Tool(path)

    def lives(n):
        for _ in range(n):
            tool.fmu.fmi2FreeInstance(tool.fmu.component)  # freeInstance would take the library away too
            tool.fmu.instantiate(callbacks=tool.callbacks)
            tool.begin(command=0.6)
            tool.fmu.freeFMUstate(tool.fmu.getFMUstate())
        return _resident()

    before = lives(100)
    assert lives(400) - before < 2_000_000, "bytes of 400 lives"


def _resident():
    """Bytes of memory of this process."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * 4096


def test_calls_in_any_order_end_in_a_status(made):
    folder, about = extract(made("sticky")), read_model_description(made("sticky"))
    command = [sys.executable, fmu_calls.__file__, folder, about.guid]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr[-2000:]


def test_an_actuator_gives_the_force_of_the_drive_on_what_moves_it(tmp_path):
    drive, start = SMOOTH, {"position": "100 mm"}
    run = pn.simulate(drive, 0.1, 0.06, initial=start, sample_rate="20 kHz", rtol=1e-9)
    path = str(pn.export_fmu(drive, tmp_path / "actuator.fmu", version="3.0", actuator=True, initial=start).path)
    assert validate_fmu(path) == []
    about: ModelDescription = read_model_description(path)
    assert about.coSimulation is None
    given = np.rec.fromarrays(
        [run.time.values, run.position.values, run.velocity.values], names=["time", "position", "velocity"]
    )
    # FMPy holds inputs from one output to the next.
    seen = simulate_fmu(
        path, start_values={"command": 0.1}, stop_time=0.06, output_interval=1e-4, input=given, relative_tolerance=1e-8
    )
    at = np.searchsorted(run.time.values, seen["time"] - 1e-9)
    force = 2.0 * run.acceleration.values[at]  # the mass is 2 kg
    assert np.abs(seen["force"] - force)[2:].max() < 0.02 * np.abs(force).max()
    assert np.abs(seen["pressure_a"] - run.pressure_a.values[at]).max() < 100.0
    loaded = drive.replace({"load": {"force": "50 N", "spring": {"stiffness": "800 N/m", "rest_position": "20 mm"}}})
    other = str(pn.export_fmu(loaded, tmp_path / "loaded.fmu", actuator=True, initial=start).path)
    told = {"start_values": {"command": 0.1, "position": 0.1, "velocity": 0.1}, "stop_time": 1e-3}
    alone, without = simulate_fmu(other, **told), simulate_fmu(path, **told)
    assert alone["force"].tobytes() == without["force"].tobytes(), "the load is the tool's"
    with pytest.raises(DescriptionError, match="the law coulomb has a sticking mode"):
        pn.export_fmu(STICKY, tmp_path / "no.fmu", actuator=True)


def test_in_co_simulation_a_motor_moves_the_piston_and_tells_the_mean_force(tmp_path):
    joints = ("supply -> valve.1", "valve.4 -> cylinder.a", "valve.2 -> cylinder.b", "motor.1 -> cylinder.rod")
    rig = SMOOTH.circuit.replace({"components.motor": {"kind": "motor"}, "connections": joints})
    path = str(pn.export_fmu(rig, tmp_path / "rig.fmu", initial="cylinder.position = 100 mm").path)
    tool, session = Tool(path).begin(motor__velocity=0.1), rig.start("cylinder.position = 100 mm", rtol=1e-9)
    session.set("motor.velocity_m_s", 0.1)
    session.advance(0.5)
    tool.fmu.doStep(0.0, 0.5)
    before = tool.get("motor.impulse")[0]
    tool.fmu.doStep(0.5, 0.1)
    assert tool.get("cylinder.position")[0] == pytest.approx(0.16, abs=1e-4)
    impulse = session.read("motor.impulse_n_s")
    session.advance(0.6)
    mean = (session.read("motor.impulse_n_s") - impulse) / 0.1
    assert (tool.get("motor.impulse")[0] - before) / 0.1 == pytest.approx(mean, rel=1e-6)
    assert mean > 30.0, "at least Coulomb friction"


def test_the_library_has_every_function_of_the_standards():
    library = package.load_library()
    for version, count in (("2", 40), ("3", 70)):
        text = Path(fmpy.__file__).with_name("c-code").joinpath(f"fmi{version}FunctionTypes.h").read_text("utf-8")
        names = set(re.findall(rf"\b(fmi{version}\w+)TYPE\s*\(", text))
        assert len(names) > count
        assert [name for name in sorted(names) if not hasattr(library, name)] == []


def test_the_library_loads_where_there_is_no_python(tmp_path, monkeypatch):
    file = package.binary_path()
    source = """#include <dlfcn.h>
    #include <stdio.h>
    int main(int count, char **files) {
        for (int i = 1; i < count; i++) {
            void *own = dlopen(files[i], RTLD_NOW);
            if (!own) { puts("none"); continue; }
            puts(((const char *(*)(void))dlsym(own, "fmi3GetVersion"))());
        }
    }"""
    program = tmp_path / "program"
    subprocess.run(["gcc", "-x", "c", "-", "-o", program], input=source, text=True, check=True)
    found = subprocess.run([program, _core.__file__, file], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["none", "3.0"], "the core needs Python, the library of FMUs does not"
    monkeypatch.setattr(package, "__file__", __file__)
    with pytest.raises(CommandError, match=r"no library for FMUs[\s\S]*Install a wheel"):
        package.binary_path.__wrapped__()


def test_a_name_that_xml_cannot_hold_gives_an_fmu_that_tools_read(tmp_path):
    drive = SMOOTH.replace({"name": 'a\x01b\ud800 <&"> \n Ü \U0001f600'})
    path = str(pn.export_fmu(drive, tmp_path / "named.fmu").path)
    assert validate_fmu(path) == []
    assert read_model_description(path).modelName == 'a\ufffdb\ufffd <&"> \n Ü \U0001f600'


def test_a_user_exports_a_drive_file_and_runs_it_in_fmpy(tmp_path, printed):
    file, target = tmp_path / "drive.toml", tmp_path / "drive.fmu"
    file.write_text(SMOOTH.to_toml(), encoding="utf-8")
    said = printed(["export", file, "--to", "fmu", "--out", target, "--fmi", "3.0"])
    assert "inputs: command [1], force [N]" in said
    assert f"token {read_model_description(str(target)).instantiationToken}" in said
    first = target.read_bytes()
    assert command_line(["export", str(file), "--to", "fmu", "--out", str(target), "--fmi", "3.0"]) == 0
    assert target.read_bytes() == first, "one drive, one archive"
    assert simulate_fmu(str(target), stop_time=0.1, start_values={"command": 0.6})["position"][-1] > 0.27
    with pytest.raises(CommandError, match=r'FMI "1\.0" is not available'):
        pn.export_fmu(SMOOTH, target, version="1.0")


def test_a_contact_that_has_stood_before_the_start_is_as_old_in_the_fmu(tmp_path):
    drive, start = pn.Drive.load("catalogue:starter"), {"position": "100 mm", "contact_age": "1000 s"}
    path = str(pn.export_fmu(drive, tmp_path / "starter.fmu", initial=start).path)
    seen = []
    for age, values in (("1000 s", {}), ("20 s", {"start__contact_age": 20.0})):
        tool = Tool(path).begin(command=0.05, **values)
        tool.fmu.doStep(0.0, 0.2)
        session = drive.start(start | {"contact_age": age}, rtol=1e-7)
        session.set("command", 0.05)
        session.advance(0.2)
        seen.append(tool.get("position")[0])
        assert seen[-1] == session.read("position_m")
    assert seen[1] > seen[0], "a younger contact breaks away earlier"
