"""``pneudrive control``: from a description to a scored run, laws beside each other, and what is refused."""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from pneudrive.cli.commands import examples_of
from pneudrive.cli.control import export
from pneudrive.cli.main import run
from pneudrive.control.scores import score_of, view_of_score
from pneudrive.errors import CommandError, PneudriveWarning
from pneudrive.simulation.trajectory import columns

AXIS = Path(__file__).parents[2] / "examples" / "controlled_axis.toml"
STEP = "220 mm; 0.1 s: 280 mm in 0.3 s"
CLOCK = ("step_time_s", "least_step_time_s")  # the only columns that are not functions of the seed


def test_from_a_description_to_a_scored_run(tmp_path, capsys, printed, axis):
    """The file that `tune` writes gives the bits of the law's name; another seed gives others."""
    file, out, picture = tmp_path / "controller.toml", tmp_path / "run.parquet", tmp_path / "run.png"
    assert run(["control", "tune", str(AXIS), "--law", "super-twisting", "--out", str(file)]) == 0
    assert f'drive = "{os.path.relpath(AXIS, file.parent)}"' in file.read_text()
    said, aside = capsys.readouterr()
    assert "has an error" not in aside
    assert "integral_gain" in said
    assert "0.3 K_s^2/phi" in said  # the rule that the gain follows from
    head = ["control", "run", str(AXIS), "--reference", STEP, "--duration", "0.8 s"]
    written = ["--out", str(out), "--plot", str(picture)]
    assert "simulated" in printed([*head, "--controller", file, "--seed", "3", *written])
    assert picture.stat().st_size > 10_000
    table = pl.read_parquet(out).drop(*CLOCK)
    for seed, same in ((3, True), (4, False)):
        again = pn.control.run(axis, "super-twisting", reference=STEP, duration="0.8 s", seed=seed)
        assert pl.DataFrame(columns(again)).drop(*CLOCK).equals(table) is same
    assert abs(table["position_m"][-1] - 0.28) < 1e-4
    assert pn.control.score(again).to_dict() == again.attrs["score"]


@pytest.mark.parametrize(("frequency", "bounds_m"), [("0.5 Hz", (1.0e-4, 1.6e-4)), ("1 Hz", (1.2e-4, 1.7e-4))])
def test_laws_reach_what_is_known_of_them(axis, frequency, bounds_m):
    """Sines of 60 mm on a drive that the laws know: largest error in the last 4 s, for the median of three seeds."""
    for law, bound in zip(("nmpc", "super-twisting"), bounds_m, strict=True):
        runs = [
            pn.control.run(axis, law, reference=f"sine 60 mm {frequency} around 250 mm", duration="8 s", seed=seed)
            for seed in (1, 2, 3)
        ]
        errors = [one.attrs["score"]["max_error_m"] for one in runs]
        assert np.median(errors) < bound, (law, errors)


def test_a_score_is_what_its_name_says():
    """Of a track with a known error: 0.9 mm beyond the end of a move, 50 um behind it from 0.5 s on."""
    time = np.arange(0.0, 3.0005, 1e-3)
    reference = np.where(time < 1.0, 0.1, 0.2)
    x = np.where((time >= 1.0) & (time < 1.5), 0.2009, reference - 5e-5)
    named = {"position": x, "velocity": 0.0 * x, "reference": reference, "command": np.sign(time - 2.0)}
    motion = {"kind": "moves", "start_m": 0.1, "moves": [[0.9, 0.1, 0.2]]}
    named |= {"pressure_a": 4e5 + 1e6 * x, "pressure_b": 0.0 * x, "step_time": 0.0 * x, "least_step_time": 0.0 * x}
    found = score_of(time, named, motion)
    assert found.max_error_m == pytest.approx(9e-4)
    assert found.overshoot_m == pytest.approx(9e-4)
    sine = {"score": found.to_dict(), "motion": {"kind": "sine", "frequency_hz": 0.125}}
    assert "largest error (last 8 s)" in str(view_of_score(sine))
    assert found.settling_100_um_s == pytest.approx(0.5, abs=2e-3)
    assert found.settling_1000_um_s == 0.0
    assert found.rest_error_m == pytest.approx(5e-5)
    assert (found.hunting_m, found.slips, found.lost) == (0.0, 0, False)
    assert found.valve_travel_per_s == pytest.approx(2.0 / 3.0)
    assert found.peak_pressure_rate_pa_s == pytest.approx(1e6 * (0.2009 - 0.09995) / 1e-3)


WRONG = {
    "beyond the stroke": (["--reference", "250 mm; 1 s: 510 mm in 1 s"], "510 mm", "within the stroke"),
    "too fast": (["--reference", "100 mm; 1 s: 400 mm in 0.1 s"], "faster than the drive", "Stretch"),
    "no time of a move": (["--reference", "100 mm; 1 s: 400 mm"], "is not a move", "TIME: POSITION in DURATION"),
    "overlapping": (["--reference", "100 mm; 1 s: 200 mm in 1 s; 1.5 s: 100 mm in 1 s"], "begins at 1.5 s", "2 s"),
    "two laws": (["--reference", STEP, "--law", "fuzzy", "--controller", "pid"], "--controller pid", "Keep one"),
    "no sine": (["--reference", "sine 60 mm around 250 mm"], "is not a sine", "AMPLITUDE"),
    "unknown reference": (["--reference", "R9"], 'no reference "R9"', "R1 to R6"),
    "record of no number": (["--reference", "nan.csv"], "sample 3 is not valid", "position_m = nan"),
    "record that goes back": (["--reference", "back.csv"], "sample 4 is not valid", "times must rise"),
    "unit": (["--reference", "sine 60 mm 0.5 kg around 250 mm"], '"kg"', "a frequency is needed"),
    "a comma": (["--reference", "220 mm, 1 s: 280 mm in 0.3 s"], '"220 mm; 1 s: 280 mm', "semicolons"),
    "unknown law": (["--controller", "nmcp"], 'no law "nmcp"', "'nmpc'"),
    "capitals": (["--law", "PID"], 'no law "PID"', "Did you mean 'pid'"),
    "unknown setup": (["--setup", "reel"], 'no setup "reel"', "'real'"),
    "duration": (["--duration", "-1 s"], "duration", "greater than 0"),
    "folder": (["--out", "nowhere/run.parquet"], "does not exist", "mkdir"),
}
FILES = {
    "law": ('law = "pdi"', "law: 'pdi' is not known", "'pid'"),
    "period": ('law = "nmpc"\nperiod = "10 s"', "it must lie within", ":3"),
    "unknown gain": ('law = "nmpc"\n[gains]\nbandwith = "90 rad/s"', "not a gain of nmpc", "'bandwidth'"),
    "gain out of bounds": ('law = "nmpc"\n[gains]\nbandwidth = "-90 rad/s"', "out of bounds", ":4"),
    "gain of no number": ('law = "nmpc"\n[gains]\nmove_penalty = nan', "out of bounds", ":4"),
    "unit of a gain": ('law = "nmpc"\n[gains]\nbandwidth = "90 mm"', '"mm"', ":4"),
    "hold": ('law = "nmpc"\nhold = true', "True is not a table", "hold = false"),
    "no boolean": ('law = "nmpc"\nadaptation = "no"', "must be true or false", ":3"),
    "a gain in cycles": ('law = "nmpc"\n[gains]\nbandwidth = "10 Hz"', "counts cycles", "rad/s", ":4"),
    "own code": ('law = "mine.py:Law"', "this command or call does not allow", "--law mine.py:Law"),
    "setup": ('law = "nmpc"\nsetup = "chaep"', "no setup", "'cheap'", ":3"),
    "another drive": ('law = "nmpc"\ndrive = "nowhere.toml"', "nowhere.toml", "no file"),
}
RECORDS = {
    "nan.csv": ((0, 0.2), (1, 0.2), (2, "nan"), (3, 0.2), (4, 0.2)),
    "back.csv": ((0, 0.2), (1, 0.2), (2, 0.2), (1, 0.2), (4, 0.2)),
}
FALLING = '[[disturbances]]\nat = "2 s"\nforce = "1 N"\n[[disturbances]]\nat = "1 s"\nforce = "1 N"'
PRESSURES = """
[sensors.pressure_a]
range = "10 bar"
[sensors.pressure_b]
range = "10 bar"
[[faults]]
kind = "offset"
channel = "pressure_a"
at = "1 s"
"""
SETUPS = {
    "one pressure": ('[sensors.pressure_a]\nrange = "10 bar"', "without sensors.pressure_b", "Give both"),
    "bits": ("[converter]\nbits = 64", "64 is out of bounds", "4 to 32"),
    "slow computer": ('[computer]\ntime = "2 ms"', "0.002 s", "shorter than the period"),
    "fault": ('[[faults]]\nkind = "stuck"\nat = "1 s"', "needs a channel", "pressure_a"),
    "unit of a fault": ('[[faults]]\nkind = "clock"\nat = "1 s"\nvalue = "3 mm"', "faults", "a time"),
    "times fall": (FALLING, "1 s follows 2 s", "times of the disturbances must increase"),
    "switches": ('[switches]\nlow = "300 mm"\nhigh = "100 mm"', "switches.high = 100 mm", "above low = 300 mm"),
    "jitter of a sensor": ('[sensors.position]\njitter = "2 ms"', "sensors.position.jitter = 2 ms", "the period, 1 ms"),
    "jitter of the computer": ('[computer]\njitter = "1 ms"', "computer.jitter = 1 ms", "shorter than the period"),
    "no sensor": ('[[faults]]\nkind = "stuck"\nchannel = "pressure_a"\nat = "1 s"', "no sensor pressure_a", ":4"),
    "gauge": ('[[faults]]\nkind = "supply-fallen"\nat = "1 s"\nvalue = "3 bar gauge"', "is gauge", "3 bar abs"),
    "no difference": (f"{PRESSURES}value = '1 bar abs'", "is an absolute pressure", "0.2 bar"),
}


@pytest.mark.parametrize("case", [*WRONG, *(f"controller: {name}" for name in FILES), *(f"setup: {n}" for n in SETUPS)])
def test_wrong_input_gives_one_message(case, tmp_path, refusal, monkeypatch):
    monkeypatch.chdir(tmp_path)
    kind, _, name = case.partition(": ")
    for name_of, numbers in RECORDS.items():
        rows = "\n".join(f"{t},{x}" for t, x in numbers)
        Path(name_of).write_text(f"time_s,position_m\n{rows}\n")
    if case in WRONG:
        options, *words = WRONG[case]
    else:
        text, *words = (FILES if kind == "controller" else SETUPS)[name]
        Path("given.toml").write_text(f"schema = 1\n{text}\n")
        options = [f"--{kind}", "given.toml"]
    usual = [] if "--reference" in options else ["--reference", STEP]
    refusal(["control", "run", AXIS, *usual, *options], *words)


def test_a_drive_on_valves_that_no_law_commands_is_refused(tmp_path, refusal):
    text = (Path(__file__).parents[2] / "examples/pwm_axis.toml").read_text()
    (tmp_path / "axis.toml").write_text(text.replace("pwm_model", 'normally = "open"\npwm_model'))
    refusal(["control", "tune", tmp_path / "axis.toml"], "in_a is normally open")


REFUSED = {
    "crossed": ({"valve.4 -> cylinder.a": "valve.4 -> cylinder.b", "valve.2 -> cylinder.b": "valve.2 -> cylinder.a"},
                "valve.4 leads to cylinder.b"),
    "crossed behind a tube": (
        {"valve.4 -> cylinder.a": "valve.4 -> tube -> cylinder.b", "valve.2 -> cylinder.b": "valve.2 -> cylinder.a",
         "[labels]": '[components.tube]\nkind = "tube"\nlength = "1 m"\ndiameter = "4 mm"\n[labels]'},
        "valve.4 leads to cylinder.b",
    ),
    "single-acting": (
        {', "valve.2 -> cylinder.b"]': ']\nplugged = ["valve.2"]', "cylinder/rodless": "cylinder/single-acting",
         "moving_mass": 'rod_diameter = "10 mm"\nspring_stiffness = "100 N/m"\nspring_preload = "20 N"\n'
                        'breather_conductance = "1 dm3/(s bar)"\nmoving_mass'},
        "cylinder is a cylinder/single-acting",
    ),
    "slow": ({'delay = "1 ms"': 'delay = "2 s"'}, 'delay = "2 s"'),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_drive_that_the_model_is_not_of_is_refused(case, tmp_path, refusal):
    """It would be commanded as the drive of the model: away from where it is to go, or without its spring."""
    changes, says = REFUSED[case]
    text = AXIS.read_text()
    for old, new in changes.items():
        text = text.replace(old, new)
    (tmp_path / "axis.toml").write_text(text)
    refusal(["control", "tune", tmp_path / "axis.toml"], says, "axis.toml:")


def test_limit_switches_are_about_the_stroke_and_the_reference(axis):
    """Beyond the stroke they would hold the drive for good; within the reference they will, which is told."""
    told = {"reference": "220 mm; 10 ms: 280 mm in 0.3 s", "duration": "20 ms"}
    for low, high, leads in (("600 mm", "700 mm", None), ("5 mm", "260 mm", "from 220 mm to 280 mm")):
        setup = pn.control.Setup(switches={"low": low, "high": high})
        with (
            pytest.raises(CommandError, match="a part of the stroke")
            if leads is None
            else pytest.warns(PneudriveWarning, match=leads)
        ):
            pn.control.run(axis, "inversion", setup=setup, **told)


def test_tune_says_which_parts_of_cylinder_valve_and_supply_no_law_knows(tmp_path, printed):
    text = AXIS.read_text().replace("leakage = 0.003", 'stroke_time = "8 ms"')
    (tmp_path / "axis.toml").write_text(text.replace("moving_mass", 'leakage = "0.01 dm3/(s bar)"\nmoving_mass'))
    said = printed(["control", "tune", tmp_path / "axis.toml", "--law", "inversion"])
    words = ("does not model", "cylinder.leakage", "valve.stroke_time", "leakage 0.006 instead of")
    assert all(own in " ".join(said.split()) for own in words)
    told = {"reference": "250 mm", "duration": "20 ms"}
    assert pn.control.run(pn.Circuit.load(tmp_path / "axis.toml"), "inversion", mismatch="sag", **told).attrs["air"]
    assert pn.control.tune(pn.Circuit.load(AXIS)).plant.left_out == []


def test_tune_tries_the_law_and_warns_where_it_does_not_follow(tmp_path, capsys):
    """`inversion` swings behind a slow valve, whose lag it takes for the whole of what is late."""
    slow = tmp_path / "slow.toml"
    slow.write_text(AXIS.read_text().replace('"100 Hz"', '"15 Hz"'))
    assert run(["control", "tune", str(slow), "--law", "inversion"]) == 0
    said = capsys.readouterr()
    assert "Simulated on this drive as described, along 230 mm; 1 s: 290 mm" in said.out
    assert re.search(r"inversion has an error of up to \d\d\.?\d? mm in this test", said.err)


def test_a_controller_goes_to_another_folder_with_what_it_names(tmp_path):
    """The drive that a law believes in, and the code of one's own, are named from where the file is saved."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    (here / "believed.toml").write_text(AXIS.read_text().replace('"2 kg"', '"3 kg"'))
    (here / "inversion.toml").write_text('schema = 1\nlaw = "inversion"\ndrive = "believed.toml"\n')
    code = "class Law:\n    inputs = ()\n    def step(self, t, sample, preview):\n        return 0.0\n"
    (here / "mine.py").write_text(code)
    drive, mine = pn.Circuit.load(AXIS), f"{here / 'mine.py'}:Law"
    tuned = pn.control.tune(drive, controller=here / "inversion.toml")
    again = pn.control.tune(drive, controller=tuned.save(there / "inversion.toml"))
    assert again.core() == tuned.core()
    own = pn.control.tune(drive, mine).save(there / "own.toml")
    assert 'law = "../here/mine.py:Law"' in own.read_text()
    assert pn.control.tune(drive, mine, controller=own).law == mine


def test_a_controller_for_another_drive_cannot_lead_this_one_out_of_its_stroke(tmp_path, capsys, refusal):
    file = tmp_path / "longer.toml"
    file.write_text(f'schema = 1\nlaw = "inversion"\nperiod = "8 ms"\ndrive = {str(AXIS)!r}\n')  # a stroke of 500 mm
    told = ["control", "run", str(AXIS.parent / "axes/bench.toml"), "--controller", str(file)]
    refusal([*told, "--reference", "250 mm; 0.1 s: 400 mm in 0.3 s"], "within the stroke, 0 mm to 300 mm")
    assert run([*told, "--reference", "150 mm; 0.1 s: 160 mm in 0.3 s", "--duration", "0.5 s"]) == 0
    said = capsys.readouterr()
    assert "inversion, with a model of controlled axis, on bench" in said.out
    assert said.err.count("Note: period = 8 ms is too long") == 1


COMPARE = ["--laws", "inversion,nmpc", "--references", f"R6,{STEP}", "--seeds", "4"]


def test_a_comparison_with_other_numbers_does_not_show_the_scores_of_the_one_before(tmp_path, axis):
    """Of a file of the same name, where it is cancelled."""
    reference, out, cancelled = tmp_path / "a.toml", tmp_path / "out", threading.Event()
    move = 'schema = 1\nstart = "220 mm"\n[[moves]]\nat = "0.1 s"\nto = "{} mm"\nduration = "0.3 s"\n'
    reference.write_text(move.format(280))
    pn.control.benchmark(axis, "inversion", str(reference), seeds=1, out=out)
    reference.write_text(move.format(290))
    cancelled.set()
    with pytest.raises(pn.errors.Cancelled):
        pn.control.benchmark(axis, "inversion", str(reference), seeds=1, out=out, cancel=cancelled)
    assert not pn.control.read_comparison(out).is_finished


def test_what_has_no_effect_or_cannot_be_measured_is_told(tmp_path, capsys, printed):
    """A load behind the end of a run; pressures beyond their sensors; and a run that lost its drive."""
    high = tmp_path / "high.toml"
    high.write_text(AXIS.read_text().replace("7 bar abs", "16 bar abs"))
    given = ["--reference", STEP, "--law", "inversion", "--initial", "cylinder.position = 190 mm"]
    head = ["control", "run", str(high), *given]
    assert run([*head, "--mismatch", "load-step"]) == 0
    said = capsys.readouterr()
    assert "disturbances: the entry at 6.2 s has no effect, because the run ends at 2.4 s" in said.err
    assert "ends at 11.01 bar abs, below the supply pressure of 16 bar abs" in said.err
    assert "! Lost: an error exceeded 20 mm." in said.out
    assert "below the supply pressure of 16 bar abs" in printed(["control", "tune", high, "--law", "inversion"])
    assert run(["control", "run", str(AXIS), "--reference", STEP, "--law", "inversion"]) == 0
    assert "Note" not in capsys.readouterr().err


def _scores(folder):
    table = pl.read_csv(folder / "score.csv")
    return table.drop([name for name in table.columns if name.startswith("step_")])


def test_a_comparison_goes_on_after_a_kill(tmp_path, capsys):
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    command = [sys.executable, "-m", "pneudrive", "control", "benchmark", str(AXIS), *COMPARE, "--out", str(killed)]
    process = subprocess.Popen(command, env=os.environ, stderr=subprocess.DEVNULL)
    runs = killed / "runs"
    while len(list(runs.glob("[!.]*.parquet")) if runs.is_dir() else []) < 3:
        assert process.poll() is None
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = {path: path.stat().st_mtime_ns for path in runs.glob("[!.]*.parquet")}
    assert 3 <= len(before) < 16
    for folder in (killed, whole):
        assert run(["control", "benchmark", str(AXIS), *COMPARE, "--out", str(folder)]) == 0
    assert "simulated" in capsys.readouterr().out
    assert {path: path.stat().st_mtime_ns for path in before} == before  # finished runs were not run again
    assert _scores(killed).equals(_scores(whole))
    assert len(_scores(whole)) == 16
    page = (killed / "report.html").read_text("utf-8")
    assert page.count("has the smallest maximum error") == 2  # of both references


FAULTY = """schema = 1
[sensors.position]
resolution = "5 um"
noise = "1 um"
jitter = "10 us"
[computer]
time = "0.3 ms"
jitter = "20 us"
[[faults]]
kind = "offset"
channel = "position"
at = "0.3 s"
value = "20 mm"
"""


@pytest.mark.parametrize("value", ["3 bar", "3 bar abs"])
def test_a_supply_falls_to_an_absolute_pressure(value):
    fault = pn.control.Setup(faults=[{"kind": "supply-fallen", "at": "1 s", "value": value}]).faults[0]
    assert fault.core()["value"] == 3e5


def test_a_supervisor_tells_what_it_does_about_a_fault(tmp_path, printed, axis):
    """A sensor jumps during a move. The drive follows a ramp, or for 0.04 s only before its valve is shut."""
    setup, controller = tmp_path / "faulty.toml", tmp_path / "controller.toml"
    setup.write_text(FAULTY)
    tuned = pn.control.tune(axis, controller=pn.control.Controller(law="inversion", on_fault={"position": "stop"}))
    tuned.save(controller)
    assert 'position = "stop"' in controller.read_text()
    head = ["control", "run", str(AXIS), "--reference", STEP, "--duration", "1 s", "--setup", str(setup)]
    said = printed([*head, "--controller", controller])
    assert "0.302 s  position-lost" in said
    assert "stopped" in said
    shut = pn.control.run(axis, "inversion", reference=STEP, duration="1 s", setup=setup)
    assert [one["kind"] for one in shut.attrs["events"]] == ["position-predicted", "position-lost"]
    assert np.all(np.abs(shut.command.values[shut.time > 0.302 + 0.045]) < 1e-9)
    assert abs(float(shut.velocity[-1])) < 5e-3
    assert abs(float(shut.position[-1]) - 0.28) > 1e-3  # it does not arrive


def test_the_examples_of_export_in_the_help_work(tmp_path, monkeypatch):
    """The example of nmpc had no reference, and ended in an error."""
    (tmp_path / "axis.toml").write_text(AXIS.read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert run(["control", "tune", "axis.toml", "--law", "inversion", "--out", "controller.toml"]) == 0
    for line in "\n".join(examples_of(export)).replace("\\\n", "").splitlines():
        assert run(shlex.split(line)[1:]) == 0, line
