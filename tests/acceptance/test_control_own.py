"""Laws of one's own, laws as source code, and the environment of a learner, each from a description to a run."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
import types
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from oracle.structured_text import FunctionBlock
from pneudrive import own_code
from pneudrive.cli.main import run
from pneudrive.errors import CommandError

AXIS = Path(__file__).parents[2] / "examples" / "controlled_axis.toml"
STEP = "220 mm; 0.1 s: 240 mm in 0.2 s"
#: Start and target, m, begin and duration, s, of two moves.
FORTH_AND_BACK = ((0.22, 0.26, 0.1, 0.3), (0.26, 0.22, 0.46, 0.3))
CLOCK = "step_time_s"
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no compiler of C")

MINE = (Path(__file__).parents[1] / "data" / "own_law.py.txt").read_text("utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("own")
    (path / "mine.py").write_text(MINE)
    return path


def _compiled(folder, *files, name="mine.so", options=()):
    target = folder / name
    strict = ["gcc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O0", "-fPIC", "-shared", *options]
    subprocess.run([*strict, *map(str, files), "-o", str(target), "-lm"], check=True, cwd=folder)
    return target


def _command(*options, out=None):
    written = [] if out is None else ["--out", str(out)]
    return ["control", "run", str(AXIS), "--reference", STEP, "--duration", "0.4 s", *written, *options]


def test_one_law_from_a_file_a_class_and_an_object_gives_the_same_run(folder, axis, printed):
    out = folder / "run.parquet"
    assert "simulated" in printed(_command("--law", str(folder / "mine.py:Law"), out=out))
    first = pl.read_parquet(out).drop(CLOCK)
    law = own_code.load(f"{folder / 'mine.py'}:Law", CommandError)
    for given in (law, law()):
        again = pn.control.run(axis, given, reference=STEP, duration="0.4 s")
        assert again.attrs["law"] == "Law"
        assert np.abs(again.command.to_numpy() - first["command"].to_numpy()).max() < 1e-12
    error = (first["reference_m"] - first["position_m"]).abs()
    assert error[-1] < 2e-3 < error.max() < 2e-2  # it leads the piston, as well as such a law does


WRONG = {
    "raises": (["--law", "mine.py:Raises"], "fails at t = 0.05 s: ZeroDivisionError", "mine.py:14"),
    "no number": (["--law", "mine.py:NoNumber"], "it returns nan", "a finite number"),
    "nothing": (["--law", "mine.py:Forgets"], "fails at t = 0 s: it returns None", "on_fault"),
    "an exit": (["--law", "mine.py:Exits"], "fails at t = 0 s: SystemExit: 3", "mine.py:39"),
    "an input twice": (["--law", "mine.py:Twice"], "'position' is listed twice", "each input once"),
    "no arguments": (["--law", "mine.py:Alone"], "step cannot be called", "step(t, sample, preview)"),
    "input": (["--law", "mine.py:Asks"], "there is no input 'positon'", "'position'"),
    "inputs": (["--law", "mine.py:Text"], "inputs is the text 'position'", "inputs = ('position',)"),
    "no law": (["--law", "mine.py:Nothing"], "is not a controller: it has no inputs", "velocity"),
    "no class": (["--law", "mine.py:Lav"], "no function or class", "'Law'"),
    "no file": (["--law", "yours.py:Law"], "there is no file", "yours.py"),
    "a library": (["--law", "yours.so:law"], "is a compiled library", "ctypes"),
    "a file names code": (["--controller", "own.toml"], "this command or call does not allow", "--allow-code"),
    "two laws": (["--controller", "own.toml", "--law", "pid"], 'law = "pid" contradicts', "Give only one"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_law_that_fails_gives_one_message(case, folder, refusal, monkeypatch):
    monkeypatch.chdir(folder)
    Path("own.toml").write_text('schema = 1\nlaw = "mine.py:Law"\n')
    options, *words = WRONG[case]
    refusal(_command(*options), *words)


def test_a_controller_file_runs_code_that_the_user_allows(folder, refusal, monkeypatch):
    monkeypatch.chdir(folder)
    Path("own.toml").write_text('schema = 1\nlaw = "mine.py:Law"\nperiod = "0.5 ms"\n')
    allowed = own_code.sha256("mine.py:Law")
    assert run(_command("--controller", "own.toml", "--allow-code", allowed, out=Path("run.csv"))) == 0
    assert len(pl.read_csv("run.csv")) == 801  # at the file's period
    refusal(_command("--controller", "own.toml", "--allow-code", "0" * 64), "differs from the allowed code")
    assert run(_command("--controller", "own.toml", "--law", "mine.py:Law")) == 0


def test_a_comparison_keeps_a_law_that_fails_as_lost(folder, axis, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    compared = ["--laws", "inversion,mine.py:Law,mine.py:Raises", "--references", STEP, "--seeds", "1"]
    assert run(["control", "benchmark", str(AXIS), *compared, "--out", "compared"]) == 0
    table = pl.read_csv("compared/score.csv")
    reasons = dict(zip(table["law"], table["reason"], strict=True))
    assert not reasons["inversion"]
    assert not reasons["mine.py:Law"]
    assert "ZeroDivisionError" in reasons["mine.py:Raises"]
    said = " ".join(capsys.readouterr().out.split())
    assert "! 1 run of mine.py:Raises ended early: the law mine.py:Raises fails at t = 0.05 s" in said


def test_two_laws_of_one_file_are_not_taken_for_each_other(tmp_path, axis):
    """By a comparison that is resumed: one law falls over at once, the other one stands still."""
    file = tmp_path / "two.py"
    step = "    inputs = ()\n    def step(self, t, sample, preview):\n        return {}\n"
    file.write_text(f"class A:\n{step.format(0.0)}class B:\n{step.format(1.0)}")
    told = {"references": [STEP], "seeds": 2, "out": tmp_path / "compared"}
    found = [pn.control.benchmark(axis, f"{file}:{name}", **told) for name in "AB"]
    both = pn.control.benchmark(axis, [f"{file}:A", f"{file}:B"], **told)
    largest = [[run.score and run.score.max_error_m for run in one.runs] for one in (*found, both)]
    assert largest[0] + largest[1] == largest[2]
    assert not set(largest[0]) & set(largest[1])


def test_a_comparison_does_not_take_a_law_for_one_that_reads_something_else(tmp_path, axis):
    """What it imports or reads is not in its file: a finished comparison runs it anew, an interrupted one goes on."""
    law, read = tmp_path / "law.py", tmp_path / "gain.txt"
    step = f"return float(Path({str(read)!r}).read_text()) * (0.28 - sample.position)"
    lines = ["from pathlib import Path", "class Law:", "    inputs = ('position',)"]
    law.write_text("\n".join([*lines, f"    def step(self, t, sample, preview): {step}", ""]))
    out = tmp_path / "compared"

    def compared(gain):
        read.write_text(gain)
        made = pn.control.benchmark(axis, ["pid", f"{law}:Law"], [f"{STEP}; 1 s: 220 mm in 0.3 s"], seeds=1, out=out)
        return {run.law: (run.file.stat().st_mtime_ns, run.score.max_error_m) for run in made.runs}

    first, second = compared("0.1"), compared("2")
    assert second[f"{law}:Law"][1] != first[f"{law}:Law"][1]
    assert second["pid"] == first["pid"]
    for name in ("score.csv", "score.parquet"):  # as a kill leaves the folder
        (out / name).unlink()
    assert compared("2") == second
    (tmp_path / "helper.py").touch()
    (out / "score.parquet").unlink()
    assert compared("0.1")[f"{law}:Law"][1] == first[f"{law}:Law"][1]


def test_ctrl_c_within_a_law_ends_the_run(axis):
    law = types.SimpleNamespace(inputs=(), step=lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        pn.control.run(axis, law, reference=STEP)


class Exported:
    """A law of one's own that runs exported source, its reference too, and keeps what it was given and gave."""

    inputs = ("position", "pressure_a", "pressure_b")

    def __init__(self, library, name, gains, ahead_s):
        self.step_in_c, self.move_in_c = (ctypes.CDLL(str(library))[f"{name}_{own}"] for own in ("step", "move"))
        self.move_in_c.argtypes = [ctypes.c_double] * 5 + [ctypes.c_void_p]
        self.gains = ctypes.byref((ctypes.c_double * gains).in_dll(ctypes.CDLL(str(library)), f"{name}_tuned"))
        self.ahead_s, self.samples = ahead_s, []

    def start(self, model, period):
        self.memory = (ctypes.c_double * 400)()

    def step(self, t, sample, preview):
        now, then = (ctypes.c_double * 4)(), (ctypes.c_double * 4)()
        start, target, begin, lasts = FORTH_AND_BACK[t > 0.45]
        for at, wanted in ((t, now), (t + self.ahead_s, then)):
            self.move_in_c(start, target, begin, lasts, at, wanted)
        assert np.allclose(now, preview.at(t), rtol=1e-12, atol=1e-12)
        stands = float(not begin - self.ahead_s < t < begin + lasts)
        given = (ctypes.c_double * 13)(*sample, *now, *then, stands, 1.0)
        out = (ctypes.c_double * 5)()
        self.step_in_c(self.gains, self.memory, given, out)
        self.samples.append((list(given), list(out)))
        return out[0]


@needs_gcc
@pytest.mark.parametrize("law", ["pid", "fuzzy", "sliding-mode", "super-twisting", "inversion"])
def test_exported_c_runs_the_drive_as_its_law_does(law, tmp_path, axis):
    """Along moves and rests, in which it adapts and holds: the command in each sample, from sensors to valve."""
    assert run(["control", "export", law, "--drive", str(AXIS), "--to", "c", "--out", str(tmp_path)]) == 0
    name = f"pneudrive_{law.replace('-', '_')}"
    library = _compiled(tmp_path, f"{name}.c", name=f"{name}.so")
    ahead = float(re.search(r"now and (\S+) s later", (tmp_path / f"{name}.h").read_text())[1])
    told = {"reference": "220 mm; 0.1 s: 260 mm in 0.3 s; 0.46 s: 220 mm in 0.3 s", "duration": "1.2 s"}
    told["mismatch"] = pn.control.Mismatch(friction_level=1.5, moving_mass=1.3, conductance=0.8)
    expected = pn.control.run(axis, law, **told)
    fixed = pn.control.run(axis, controller=pn.control.Controller(law=law, adaptation=False), **told)
    assert np.abs(fixed.command.values - expected.command.values).max() > 1e-3
    exported = Exported(library, name, len(expected.attrs["gains"]), ahead)
    found = pn.control.run(axis, exported, **told)
    assert np.abs(found.command.values - expected.command.values).max() <= 1e-12
    if law == "inversion":
        assert expected.holds.values.any()
        _check_structured_text(tmp_path, exported.samples[:500])


def _check_structured_text(folder, samples):
    """Read the same law in structured text by a grammar of what it uses, and run it: no compiler for PLCs is here."""
    assert run(["control", "export", "inversion", "--drive", str(AXIS), "--to", "st", "--out", str(folder)]) == 0
    text = (folder / "pneudrive_inversion.st").read_text()
    block, move = (FunctionBlock(f"{own}END_FUNCTION_BLOCK") for own in text.split("END_FUNCTION_BLOCK")[:2])
    wanted = move.run(start=0.22, target=0.24, begin_time=0.1, duration=0.2, at_time=0.2)
    middle = {"position": 0.23, "velocity": 2.1875 * 0.02 / 0.2, "acceleration": 0.0, "jerk": -131.25}
    assert wanted == pytest.approx(middle)
    for given, out in samples:
        found = block.run(**dict(zip(block.inputs[: len(given)], given, strict=True)))
        assert found["command"] == pytest.approx(out[0], abs=1e-10)  # its tanh is made of exponentials
        assert found["velocity"] == pytest.approx(out[1], abs=1e-10)


@needs_gcc
def test_source_code_is_for_the_drive_that_is_named(tmp_path):
    """It goes before the drive that the controller's file names."""
    (tmp_path / "own.toml").write_text(f'schema = 1\nlaw = "inversion"\ndrive = "{AXIS}"\n')
    bench = AXIS.parent / "axes" / "bench.toml"
    for drive, of, name in ((["--drive", str(bench)], "bench", "left"), ([], "controlled axis", "right")):
        told = ["control", "export", str(tmp_path / "own.toml"), "--to", "c", "--out", str(tmp_path), *drive]
        assert run([*told, "--name", name]) == 0
        assert f"For {of}, description" in (tmp_path / f"{name}.h").read_text()
    assert _compiled(tmp_path, "left.c", "right.c").is_file()  # two axes in one program


@needs_gcc
def test_the_setup_of_a_controller_goes_into_its_file_its_code_and_its_example(tmp_path, printed):
    file = tmp_path / "cheap.toml"
    printed(["control", "tune", str(AXIS), "--law", "inversion", "--setup", "cheap", "--out", str(file)])
    told = ["control", "export", str(file), "--to", "c", "--out", str(tmp_path)]
    real = ["--setup", "real", "--precision", "single"]
    for more, name, has_pressures in (([], "cheap", False), (real, "real", True)):
        assert printed([*told, *more]).startswith(f"setup {name}\n")
        header = (tmp_path / "pneudrive_inversion.h").read_text()
        assert (f"setup {name};" in header, "pressure_a;" in header) == (True, has_pressures)
        words = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-o", "example"]
        subprocess.run(["gcc", *words, "example.c", "pneudrive_inversion.c", "-lm"], cwd=tmp_path, check=True)
        lines = subprocess.run(["./example"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
        assert lines.count("status 0\n") == 13


def test_what_cannot_be_exported_is_said(tmp_path, refusal):
    for law, to, told, said in (
        ("nmpc", "c", ["--drive", str(AXIS)], "--to fmu --reference"),
        ("pid", "c", ["--drive", str(AXIS), "--fmi", "3.0"], "--fmi has no effect with --to c"),
        ("pid", "c", [], "--drive"),
        ("pid", "ada", ["--drive", str(AXIS)], "ada"),
        ("pid", "st", ["--drive", str(AXIS), "--name", "if"], "structured text reserves this word"),
    ):
        refusal(["control", "export", law, "--to", to, "--out", tmp_path, *told], said)
