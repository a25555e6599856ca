"""A running drive is the simulated drive: within its tolerance, put back bit for bit, with exact derivatives.

What is wrong is said in one message and leaves the session as it was.
"""

from __future__ import annotations

import ctypes
import itertools
import math
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import pneudrive as pn
from pneudrive import _core
from pneudrive.errors import Cancelled, CommandError, SimulationError
from pneudrive.simulation.trajectory import meaning

REFERENCE = pn.Drive.load("catalogue:reference")
STICKS = REFERENCE.replace(
    {
        "friction": {
            "law": "stribeck",
            "coulomb": "30 N",
            "breakaway": "45 N",
            "stribeck_velocity": "20 mm/s",
            "viscous": "40 N s/m",
        }
    }
)
START = {"position": "0.25 m", "pressure_a": "3 bar abs", "pressure_b": "3 bar abs"}
PULSES = Path(__file__).parents[2] / "examples/pwm_axis.toml"
COLUMNS = ("position_m", "velocity_m_s", "pressure_a_pa", "temperature_b_k", "friction_force_n", "mass_flow_a_kg_s")


def track(session, times, seen, commands):
    """Position control at the rate of `times`; what is read, and the commands."""
    for now, until in itertools.pairwise(times):
        target = 0.25 + 0.1 * math.sin(2.0 * math.pi * 0.5 * now)
        error = target - session.read("position_m")
        u = min(1.0, max(-1.0, 8.0 * error - 0.25 * session.read("velocity_m_s")))
        session.set("command", u)
        commands.append((now, u))
        seen.append([session.read(name) for name in COLUMNS])
        session.advance(until)


@pytest.mark.parametrize("drive", [REFERENCE, STICKS], ids=["bristles", "modes"])
def test_ten_seconds_of_control_from_python_agree_with_the_simulation_at_less_work(drive):
    times = [k / 1000.0 for k in range(10_001)]
    seen, commands = [], []
    session = drive.start(START)
    track(session, times, seen, commands)
    seen.append([session.read(name) for name in COLUMNS])
    run = pn.simulate(drive, commands, 10.0, initial=START)
    batch = [run[meaning(name)[0]].to_numpy() for name in COLUMNS]
    difference = np.abs(np.array(seen) - np.stack(batch, axis=1)).max(axis=0)
    assert difference[0] < (20e-6 if drive is STICKS else 1e-6)
    assert (difference[2:4] / (3e5, 293.0) < (1e-3 if drive is STICKS else 1e-4)).all()
    assert np.ptp(batch[0]) > 0.15  # it moves
    work, whole = session.statistics, run.attrs["statistics"]
    assert work["right_hand_sides"] < 0.8 * whole["right_hand_sides"]
    assert (work["events"] > 20) == (drive is STICKS)


def test_a_controller_in_one_call_gives_the_bits_of_a_loop():
    """In Python or compiled: the session reads, sets and advances as a loop does."""
    times = [k * 1e-3 for k in range(501)]
    seen, commands = [], []
    track(REFERENCE.start(START), times, seen, commands)

    def law(t, x, v, *_):
        error = 0.25 + 0.1 * math.sin(2.0 * math.pi * 0.5 * t) - x
        return min(1.0, max(-1.0, 8.0 * error - 0.25 * v))

    run = REFERENCE.start(START).control(law, 1e-3, 0.5, reads=COLUMNS)
    # The loop reads after its command: the flows are those of the new opening.
    assert np.array_equal(np.stack([run[name][:-1] for name in COLUMNS[:4]], axis=1), np.array(seen)[:, :4])
    assert run["command"][:-1].tolist() == [u for _, u in commands]
    double = ctypes.c_double
    code = ctypes.CFUNCTYPE(double, double, ctypes.POINTER(double))(lambda t, read: law(t, read[0], read[1]))
    for compiled in (code, SimpleNamespace(ctypes=code)):  # as Numba has it
        other = REFERENCE.start(START).control(compiled, 1e-3, 0.5)
        assert np.array_equal(other["position_m"], run["position_m"])


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ((lambda *_: 0.0, 0.0, 0.1), "periods"),
        ((lambda *_: 0.0, 1e-3, -1.0), "periods"),
        ((lambda *_: 0.0, 0.1, 1.04), "periods"),
        ((0, 1e-3, 0.1), "of type int is not a controller"),
        ((SimpleNamespace(address=1), 1e-3, 0.1), "is not a controller"),
        ((ctypes.CFUNCTYPE(ctypes.c_double)(float), 1e-3, 0.1), "wrong types"),
        ((lambda t: t, 1e-3, 0.1), "takes 1 positional argument but 3"),
        ((lambda *_: 2.0, 1e-3, 0.1), "out of bounds"),
        ((lambda *_: 1 / 0, 1e-3, 0.1), "division"),
    ],
)
def test_a_controller_that_cannot_run_is_told(arguments, why):
    with pytest.raises((CommandError, TypeError, ZeroDivisionError), match=why):
        REFERENCE.start(START).control(*arguments)


def test_a_long_call_at_rest_and_a_tight_tolerance_keeps_the_work_of_high_order():
    """Low order serves the first attempts only: a command after many calls without work is not followed by it."""
    work = []
    for calls in (0, 40):
        session = REFERENCE.start(START, rtol=1e-10)
        for k in range(calls):
            session.advance(k + 1.0)
        session.set("command", 0.3)
        before = session.statistics["right_hand_sides"]
        session.advance(calls + 1.0)
        work.append(session.statistics["right_hand_sides"] - before)
    assert work[1] < 1.2 * work[0]


@pytest.mark.parametrize("drive", [REFERENCE, STICKS], ids=["bristles", "modes"])
def test_what_follows_a_restored_state_has_the_bits_that_it_had(drive):
    session, other = drive.start(START), drive.start({"position": "0.1 m"})
    session.schedule("command", [(0.0, 0.3), (0.4, -0.02), (0.9, 0.5)])
    session.schedule("load_force_n", [(0.7, 5.0), (1.1, -5.0)])
    session.advance(0.5)
    session.set("supply_pressure_pa", 6e5)
    saved = session.save()
    session.advance(1.2)
    after, work = [session.read(name) for name in session_columns(session)], session.statistics
    assert session.save() != saved
    for one in (session, other):  # back in time, and in a session that was never there
        one.restore(saved)
        assert one.save() == saved
        assert (one.time, one.read("supply_pressure_pa")) == (0.5, 6e5)
        one.advance(1.2)
        assert [one.read(name) for name in session_columns(one)] == after
        assert one.statistics == work


def session_columns(session):
    return [variable.name for variable in session.variables if variable.kind != "state"]


def test_what_meets_a_cover_is_put_back_and_linearised_too():
    """The cover behind a soft stop enters the equations when it is met: bytes and derivatives know whether it was."""
    soft = {"cylinder.stroke": "100 mm", "cylinder.moving_mass": "5 kg"}
    drive = REFERENCE.replace(soft | {"cylinder.dead_volume": {"a": "0.5 cm3", "b": "0.5 cm3"}})
    session = drive.start({"position": "50 mm"})
    session.set("command", 1.0)
    depth, seen = 0.0, []
    for k in range(2000):
        seen.append((session.save(), [session.read(name) for name in COLUMNS], session.statistics))
        session.advance(1e-4 * (k + 1))
        if (deep := session.read("position_m") - 0.1) > depth:
            depth, deepest = deep, session.save()
    end = session.save()
    for saved, read, statistics in seen[::400]:
        for again in (session, drive.start()):
            again.restore(saved)
            assert ([again.read(name) for name in COLUMNS], again.statistics) == (read, statistics)
            for k in range(round(1e4 * again.time), 2000):
                again.advance(1e-4 * (k + 1))
            assert again.save() == end
    session.restore(deepest)
    linear = session.linearise(["load_force_n"])
    stiffness = -linear.A[1, 0] / linear.B[1, 0]
    assert depth > 0.8e-3
    assert stiffness > 3.0 * drive.end_stop["stiffness_n_m"]


def test_a_schedule_is_the_same_as_setting_at_each_time():
    planned, by_hand = REFERENCE.start(START), REFERENCE.start(START)
    planned.schedule("command", [(0.1, 0.5), (0.0, 0.9), (0.1, -0.7), (0.25, 0.0)])
    planned.advance(0.3)
    for now, u in ((0.0, 0.9), (0.1, -0.7), (0.25, 0.0)):
        by_hand.advance(now)
        by_hand.set("command", u)
    by_hand.advance(0.3)
    assert [planned.read(name) for name in COLUMNS] == [by_hand.read(name) for name in COLUMNS]


def test_the_last_of_two_delayed_commands_holds_whatever_else_is_scheduled():
    tables = REFERENCE.circuit.to_dict()
    tables["components"]["valve"] |= {"delay": "20 ms"}
    late, positions = pn.Circuit.model_validate(tables), []
    for is_scheduled in (False, True):
        session = late.start({"cylinder.position": "0.25 m"})
        session.set("valve.command", -1.0)
        session.set("valve.command", 1.0)
        if is_scheduled:
            session.schedule("cylinder.load_force_n", [(0.1, 0.0)])
        session.advance(0.3)
        positions.append(session.read("cylinder.position_m"))
    assert positions[0] == pytest.approx(positions[1], abs=1e-6)
    assert positions[0] > 0.26


def test_a_command_on_the_edge_of_a_pulse_is_that_pulse_s():
    """However it comes there: from a simulation, set between two ways, or planned when the edge is due already."""
    circuit = pn.Circuit.load(PULSES)
    shares = [(k / 100.0, 0.1 + 0.06 * ((7 * k) % 11)) for k in range(20)]
    run = pn.simulate(circuit, {"in_a": shares, "out_b": 0.47}, 0.22)
    by_hand, late = circuit.start(), circuit.start()
    for session in (by_hand, late):
        session.set("out_b.command", 0.47)
    for at, share in shares:
        by_hand.advance(at)
        by_hand.set("in_a.command", share)
        late.advance(max(0.0, at - 0.004))
        late.schedule("in_a.command", [(at, share)])
    for session in (by_hand, late):
        session.advance(0.22)
        assert session.read("cylinder.position_m") == pytest.approx(float(run["cylinder.position"][-1]), abs=1e-9)
    assert np.ptp(run["cylinder.position"].to_numpy()) > 5e-3


def test_edges_by_themselves_are_the_valve():
    by_edge, by_command = REFERENCE.start(START), REFERENCE.start(START)
    by_command.set("command", -0.4)
    by_edge.set("opening_a_exhaust", 0.4)
    assert math.isnan(by_edge.read("command"))
    by_edge.set("opening_supply_b", 0.4)
    assert by_edge.read("command") == -0.4
    for session in (by_edge, by_command):
        session.advance(0.2)
    assert by_edge.read("position_m") == by_command.read("position_m") < 0.2
    by_edge.set("command", -0.4)
    assert by_edge.save() == by_command.save()


def test_derivatives_are_the_slopes_of_what_is_read():
    inputs = {"command": 1e-5, "opening_b_exhaust": 1e-5, "load_force_n": 1e-2, "supply_pressure_pa": 10.0}
    inputs["supply_temperature_k"] = 1e-2
    session = REFERENCE.start(START)
    session.set("command", 0.3)
    session.advance(0.03)
    saved, linear = session.save(), session.linearise(tuple(inputs))
    assert linear.D.shape == (len(linear.outputs), len(inputs))
    scale = np.maximum(np.abs(linear.output), 1e-6)
    moved = 0
    for i, (name, step) in enumerate(inputs.items()):
        reads = []
        for sign in (1.0, -1.0):
            session.restore(saved)
            session.set(name, session.read(name) + sign * step)
            reads.append(np.array([session.read(output) for output in linear.outputs]))
        slopes = (reads[0] - reads[1]) / (2.0 * step)
        assert np.abs((slopes - linear.D[:, i]) * step / scale).max() < 1e-9
        moved += np.abs(slopes).max() > 0.0
    assert moved == 5
    # The rates are the slopes of the states: advance a little.
    session.restore(saved)
    x, v = (linear.states.index(name) for name in ("position_m", "velocity_m_s"))
    assert linear.A[x, v] == 1.0
    assert linear.rates[x] == linear.state[v] == session.read("velocity_m_s")
    mass = REFERENCE.cylinder.moving_mass_kg + REFERENCE.carried.mass_kg
    assert linear.B[v, 2] == pytest.approx(1.0 / mass, rel=1e-12)


def test_a_shut_drive_swings_with_the_stiffness_of_its_air():
    """Adiabatic: m w^2 = k A^2 (p_a/V_a + p_b/V_b), damped by viscous friction alone (components of a gas spring)."""
    drive = REFERENCE.replace(
        {"cylinder.heat_transfer": "0 W/(m2 K)", "friction": {"law": "coulomb", "coulomb": "1 N", "viscous": "7 N s/m"}}
    )
    session = drive.start({**START, "velocity": "1e-9 m/s"})
    linear = session.linearise(["load_force_n"])
    area, stroke = math.pi / 4 * drive.cylinder.bore_m**2, drive.cylinder.stroke_m
    dead, mass = drive.cylinder.dead_volume_m3, drive.cylinder.moving_mass_kg + drive.carried.mass_kg
    volumes = [dead.a + area * stroke / 2, dead.b + area * stroke / 2]
    stiffness = 1.4 * area**2 * sum(3e5 / volume for volume in volumes)
    swings = [value for value in np.linalg.eigvals(linear.A) if value.imag > 1.0]
    assert len(swings) == 1
    assert abs(swings[0]) == pytest.approx(math.sqrt(stiffness / mass), rel=1e-6)
    assert -2.0 * swings[0].real == pytest.approx(7.0 / mass, rel=1e-6)


def test_cancelled_it_stands_before_its_end_and_goes_on():
    session, undisturbed = REFERENCE.start(START), REFERENCE.start(START)
    flag = threading.Event()
    flag.set()
    with pytest.raises(Cancelled):
        session.advance(1.0, cancel=flag)
    for one in (session, undisturbed):
        one.advance(1.0)
    assert session.save() == undisturbed.save()


def test_a_session_that_another_thread_advances_says_so():
    session, flag = REFERENCE.start(START), threading.Event()
    session.schedule("command", [(0.1 * k, 0.5 * (-1) ** k) for k in range(20_000)])

    def run():
        with pytest.raises(Cancelled):
            session.advance(2000.0, cancel=flag)

    def disturb():
        while thread.is_alive():
            session.set("load_force_n", 0.0)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        with pytest.raises(SimulationError, match="another thread advances the session"):
            disturb()
    finally:
        flag.set()
        thread.join()
    reached = session.time
    assert 0.0 < reached < 2000.0
    session.advance(reached + 0.01)


WRONG = {
    "name": (lambda s: s.set("commands", 0.5), CommandError, "Did you mean 'command'?"),
    "state": (lambda s: s.set("position_m", 0.5), CommandError, "no input 'position_m'"),
    "read": (lambda s: s.read("position"), CommandError, "Did you mean 'position_m'?"),
    "linear": (lambda s: s.linearise(["load_force"]), CommandError, "Did you mean 'load_force_n'?"),
    "nan": (lambda s: s.set("load_force_n", math.nan), CommandError, "Rule: finite"),
    "above": (lambda s: s.set("command", 1.5), CommandError, "not less than -1 and not more than 1"),
    "vacuum": (lambda s: s.set("supply_pressure_pa", 0.0), CommandError, "Rule: greater than 0"),
    "text": (lambda s: s.set("command", "0.5"), CommandError, "command = '0.5' is a str"),
    "backwards": (lambda s: s.advance(0.05), CommandError, "not before the present, 0.1 s"),
    "never": (lambda s: s.advance(math.inf), CommandError, "finite"),
    "past": (lambda s: s.schedule("command", [(0.2, 0.5), (0.05, 0.1)]), CommandError, "t = 0.05 s has passed"),
    "later": (lambda s: s.schedule("command", [(0.2, 0.5), (0.3, 2.0)]), CommandError, "command = 2"),
    "pairs": (lambda s: s.schedule("command", [0.2, 0.3]), CommandError, "not a list of (time, value)"),
    "shut": (lambda s: s.linearise(), CommandError, "the valve is shut"),
    "foreign": (lambda s: s.restore(STICKS.start(START).save()), CommandError, "of another drive"),
    "tolerance": (lambda s: s.restore(REFERENCE.start(START, rtol=1e-8).save()), CommandError, "another tolerance"),
    "time": (lambda s: s.advance("1 s"), CommandError, "until = '1 s' is a str"),
    "bytes": (lambda s: s.restore(b"pneudrive"), CommandError, "are not a session"),
    "cut": (lambda s: s.restore(s.save()[:-5]), CommandError, "damaged"),
    "empty": (lambda s: s.restore(s.save()[:8]), CommandError, "damaged"),
    "flipped": (lambda s: s.restore(s.save()[:40] + b"x" + s.save()[41:]), CommandError, "damaged"),
    "number": (lambda s: s.restore(5), CommandError, "a int is not a saved session"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_call_says_so_and_changes_nothing(case):
    call, kind, words = WRONG[case]
    session = REFERENCE.start(START)
    session.advance(0.1)
    before = session.save()
    with pytest.raises(kind) as told:
        call(session)
    assert words in str(told.value), told.value
    assert session.save() == before


def test_after_a_failure_only_a_restored_state_goes_on():
    soft = REFERENCE.replace({"cylinder.end_stop": {"stiffness": "1e3 N/m", "damping": "1 N s/m"}})
    session = soft.start({"position": "0.45 m"})
    saved = session.save()
    session.set("load_force_n", 1e8)  # no cover holds that
    with pytest.raises(SimulationError, match="gone through the end stop"):
        session.advance(1.0)
    for call in (lambda: session.advance(2.0), lambda: session.set("command", 0.0), session.save, session.linearise):
        with pytest.raises(SimulationError, match="the session cannot continue"):
            call()
    assert session.read("position_m") > 0.5  # where it ended can be read
    session.restore(saved)
    session.set("command", 0.0)
    session.advance(1.0)
    assert session.time == 1.0


def test_a_call_costs_two_microseconds_beside_the_integration():
    """Where there is nothing to integrate: the least of many rounds, so that nothing else on the machine counts."""
    session = REFERENCE.start(START)
    session.advance(0.01)

    def least(call, rounds=40, calls=500):
        times = []
        for _ in range(rounds):
            begun = time.perf_counter()
            for _ in range(calls):
                call()
            times.append((time.perf_counter() - begun) / calls)
        return min(times)

    assert least(lambda: session.advance(0.01)) < 2e-6
    assert least(lambda: session.set("command", 0.0)) < 2e-6


@pytest.mark.parametrize("valve", [{}, {"leakage": 0.01}, {"frequency": "100 Hz"}])
def test_outputs_of_a_linearised_circuit_have_their_own_names(valve):
    tables = REFERENCE.circuit.to_dict()
    tables["components"]["valve"] |= valve
    session = pn.Circuit.model_validate(tables).start()
    for command in (0.0, 0.4):
        session.set("valve.command", command)
        linear = session.linearise()
        assert [session.read(name) for name in linear.outputs] == pytest.approx(linear.output.tolist(), rel=1e-9)


@pytest.mark.parametrize(
    "lag", [{"delay": "20 ms"}, {"frequency": "60 Hz", "stroke_time": "15 ms"}, {"delay": "5 ms", "hysteresis": 0.1}]
)
def test_a_valve_begins_at_rest_wherever_its_first_command_comes_from(lag):
    """A command at 0 s acts after the lag: later by it than without, and as in a session and in an ensemble."""
    tables = REFERENCE.circuit.to_dict()
    tables["components"]["valve"] |= lag
    late, start = pn.Circuit.model_validate(tables), {"cylinder.position": "50 mm"}
    run = late.simulate("0 s: 1", "0.3 s", initial=start)
    assert float(run["valve.position"][0]) == 0.0
    session = late.start(start)
    session.set("valve.command", 1.0)
    session.advance(0.1)
    assert session.read("cylinder.position_m") == pytest.approx(float(run["cylinder.position"][100]), abs=1e-7)
    many = pn.simulate_many(
        late, 1.0, "0.1 s", vary={"cylinder.bore": ["25 mm"]}, outputs=["end = final(cylinder.position)"], initial=start
    )
    assert float(many["end"][0]) == pytest.approx(float(run["cylinder.position"][100]), abs=1e-7)
    if list(lag) == ["delay"]:  # the same run without delay, 20 ms later
        at_once = REFERENCE.circuit.simulate("0 s: 1", "0.28 s", initial=start)
        assert run["cylinder.position"][20:].to_numpy() == pytest.approx(
            at_once["cylinder.position"].to_numpy(), abs=2e-5
        )


# --- The core's runs with derivatives, as Python sees them: shapes, values of the plain run, derivatives, refusals.

NAMES = ["cylinder.friction.parameters.coulomb", "valve.conductance", "cylinder.friction.pressure.coulomb_a"]
OUTPUTS = ["position_m", "pressure_a_pa"]


@pytest.fixture(scope="module")
def drive() -> pn.Drive:
    return pn.Drive.load("catalogue:reference")


def shoot(drive: pn.Drive, names: list[str], with_initial: bool = False, coulomb: float = 30.0):
    drive = drive.replace({"friction.coulomb": f"{coulomb!r} N"})
    core = drive.system.compiled()
    t = np.arange(201) / 1000.0
    start = np.tile([0.25, 0.0, 3e5, 293.15, 3e5, 293.15, 0.0], (2, 1))
    asked = {"times": t, "commands": 0.3 * np.sin(20.0 * t), "sample_times": t, "starts": [0, 120]}
    asked |= {"initial": start, "parameters": names, "with_initial": with_initial}
    return core.shoot("command", asked | {"outputs": OUTPUTS, "rtol": 1e-8})


def test_derivatives_come_beside_the_values_of_the_plain_run(drive):
    plain, shot = shoot(drive, []), shoot(drive, NAMES, with_initial=True)
    assert shot["failures"] == [None, None]
    # To rounding only: lips that may press change the order of elimination.
    np.testing.assert_allclose(shot["values"], plain["values"], rtol=1e-11)
    assert shot["sensitivities"].shape == (201, 2, 10)
    assert shot["end_sensitivities"].shape == (2, 7, 10)
    assert np.isfinite(shot["sensitivities"]).all()
    step = 1e-3
    difference = (shoot(drive, [], coulomb=30.0 + step)["values"] - shoot(drive, [], coulomb=30.0 - step)["values"]) / (
        2 * step
    )
    scale = np.abs(difference).max(axis=0)
    assert np.abs((shot["sensitivities"][:, :, 0] - difference) / scale).max() < 1e-4
    # At its first sample a segment is its start.
    np.testing.assert_array_equal(shot["sensitivities"][120, 0, 3:], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_steady_friction_with_derivatives():
    parameters = {"coulomb": 20.0, "breakaway": 30.0, "stribeck_velocity": 0.02, "viscous": 40.0}
    v, zero = np.array([-0.05, 0.01, 0.1]), np.zeros(3)
    names = [f"friction.parameters.{key}" for key in ("coulomb", "viscous")] + ["friction.pressure.coulomb_b"]
    force, by = _core.steady_friction_sensitivity("stribeck", parameters, names, v, zero, zero + 1e5, zero)
    np.testing.assert_array_equal(force, _core.steady_friction("stribeck", parameters, v, 0.0, 1e5))
    left = 1.0 - np.exp(-((v / 0.02) ** 2))
    np.testing.assert_allclose(by, np.column_stack((np.sign(v) * left, v, np.sign(v) * left * 1e5)), rtol=1e-12)


def test_what_is_no_number_is_refused_with_the_choices(drive):
    with pytest.raises(ValueError, match=r'has no parameter "conductance_m3_s_pa"; it has conductance'):
        shoot(drive, ["valve.conductance_m3_s_pa"])


def test_a_leak_past_the_piston_evens_the_pressures_out():
    drive = pn.Drive.load("catalogue:reference")
    leaky = drive.replace({"cylinder.leakage": "0.01 dm3/(s bar)"})
    assert leaky.to_dict()["cylinder"]["leakage"] == "0.01 dm3/(s bar)"
    assert drive.description_hash != leaky.description_hash
    apart = [
        float((run.pressure_a - run.pressure_b)[-1])
        for run in (
            pn.simulate(d, "0 s: 0", "20 s", initial="pressure_a = 3.5 bar abs, pressure_b = 3 bar abs")
            for d in (drive, leaky)
        )
    ]
    assert apart[0] > 0.45e5
    assert abs(apart[1]) < 0.5 * apart[0]


def test_a_tolerance_that_no_run_keeps_is_refused():
    with pytest.raises(CommandError, match=r"rtol = 1\.0 is out of bounds"):
        REFERENCE.start(rtol=1.0)
