"""A command is steps that hold: times rise from 0 s, values lie in [-1, 1]; anything else is one message."""

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.describe.tables.starts import read_initial
from pneudrive.errors import CommandError, DescriptionError
from pneudrive.simulation import command


def test_three_forms_of_one_command(tmp_path):
    path = tmp_path / "steps.csv"
    path.write_text("time_s,command\n0,0.6\n\n0.25,-0.6\n")
    wanted = ((0.0, 0.25), (0.6, -0.6))
    assert command.steps("0 s: 0.6, 250 ms: -0.6") == command.steps("0 s: 0.6; 250 ms: -0.6") == wanted
    assert command.steps([(0, 0.6), ("250 ms", -0.6)]) == wanted
    assert command.steps(np.array([[0.0, 0.6], [0.25, -0.6]])) == wanted
    assert command.steps(path) == command.steps(str(path)) == wanted


@pytest.mark.parametrize(
    ("given", "what"),
    [
        ("", "is empty"),
        ("1.2", "command = 1.2"),
        (float("nan"), "'nan' is not a number"),
        (lambda t: 1.0 + t, "command = 1.5 at 0.5 s"),
        (lambda t: None, "command at 0 s: 'None' is not a number"),
        (None, "the command has the type NoneType"),
        ("0 s: 0.6, : 1", "has no time"),
        ("0 s: 0,3", "a decimal point, not a comma"),
        ("0 mm: 0.6", "is a length"),
        ("1 s: 0.6", "begins at 1 s"),
        ("0 s: 0.6, 2 s: 0, 1 s: 1", "1 s follows 2 s"),
        ("0 s: 0.6, 0 s: 0", "0 s follows 0 s"),
        ([(0.0, float("nan"))], "'nan' is not a number"),
        ("0 s: 1.01", "command = 1.01 at 0 s"),
        ([(0.0, 0.5, 1.0)], "entry 1 of the command"),
    ],
)
def test_refusals(given, what):
    with pytest.raises(CommandError, match=what):
        command.steps(given, (0.0, 0.5))


@pytest.mark.parametrize(("given", "what"), [({}, "is empty"), ({"valve": 0.4}, "give it without a name")])
def test_tables_of_commands_for_a_drive(given, what):
    with pytest.raises(CommandError, match=what):
        pn.simulate(pn.Drive.load("catalogue:reference"), given, "0.1 s")


def test_a_number_holds_throughout_and_a_function_is_held_between_samples():
    assert command.steps(0.5) == command.steps("0.5") == command.steps(np.float64(0.5)) == ((0.0,), (0.5,))
    drive = pn.Drive.load("catalogue:reference")

    def wave(t):
        return 0.5 * np.sin(20.0 * t)

    asked = pn.simulate(drive, wave, "0.1 s", sample_rate="200 Hz")
    pairs = [(k / 200, wave(k / 200)) for k in range(20)]
    assert asked.equals(pn.simulate(drive, pairs, "0.1 s", sample_rate="200 Hz"))
    assert pn.simulate(drive, 0.5, "0.1 s").equals(pn.simulate(drive, "0 s: 0.5", "0.1 s"))


@pytest.mark.parametrize(
    ("content", "what", "line"),
    [
        (b"", "is empty", None),
        (b"time_s;command\n0,0;0,5\n", r"(?s)the first line is 'time_s;command'.*by commas", 1),
        (b"time_s,command\n", "has no entries", None),
        (b"time_s,command\n0,1\n1\n", r"entry 2 of the command is \['1'\]", 3),
        (b"time_s,command\n0,1\n1,\n", "command at 1 s: '' is not a number", 3),
        (b"time_s,command\n0,1\n2,0\n1,0\n", "1 s follows 2 s", 4),
        (b"\xff\xfe\x00", "is binary, not text", None),
    ],
)
def test_wrong_files_name_the_line(tmp_path, content, what, line):
    path = tmp_path / "steps.csv"
    path.write_bytes(content)
    with pytest.raises(CommandError, match=what) as caught:
        command.steps(path)
    assert line is None or caught.value.where == f"{path}:{line}"


def test_a_valve_may_say_what_its_voltage_means():
    plain = pn.Drive.load("catalogue:reference")
    drive = plain.replace({"valve.command": "0 V .. 10 V"})
    assert drive.description_hash == plain.description_hash
    assert drive.replace({"name": "again"}).valve.command == drive.valve.command
    assert command.steps("0 s: 7.5 V, 0.1 s: 0 V", None, drive.valve.command) == ((0.0, 0.1), (0.5, -1.0))
    milliamps = plain.replace({"valve.command": "4 mA .. 20 mA"}).valve.command
    assert command.steps([(0, "16 mA"), (0.1, -1)], None, milliamps) == ((0.0, 0.1), (pytest.approx(0.5), -1.0))
    with pytest.raises(CommandError, match=r"12 V is outside[\s\S]*valve.command = 0 V .. 10 V"):
        pn.simulate(drive, "12 V", "1 ms")
    with pytest.raises(CommandError, match=r'command = "0 V .. 10 V" under \[valve\]'):
        pn.simulate(plain, "5 V", "1 ms")
    for wrong in ("10 V", "10 V .. 0 V", "0 mm .. 1 mm"):
        with pytest.raises(DescriptionError, match=r"valve.command: .* is not a range"):
            plain.replace({"valve.command": wrong})


def test_the_start_state():
    made = read_initial("position = 50 mm, pressure_a = 2 bar gauge")
    assert (made.position_m, made.pressure_a.gauge, made.pressure_b) == (0.05, True, None)
    assert read_initial({"position": "50 mm", "pressure_a": "2 bar gauge"}) == read_initial(made) == made
    with pytest.raises(DescriptionError, match=r"Did you mean 'position'"):
        read_initial("positon = 50 mm")
    with pytest.raises(CommandError, match=r'Give \{"position": "50 mm"\}'):
        read_initial(0.05)
    with pytest.raises(CommandError, match="not have the form key = quantity"):
        read_initial("50 mm")
    with pytest.raises(CommandError, match="given twice"):
        read_initial("position = 50 mm, position = 60 mm")
