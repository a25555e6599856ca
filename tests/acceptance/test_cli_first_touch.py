"""What somebody types first: the bare command, a completion, a plain number; notes are words, not lines of source."""

import os
import subprocess
import sys

import polars as pl
import pytest

import pneudrive as pn
from pneudrive.cli.main import run

DRIVE = """
[supply]
pressure = "6 bar gauge"
[cylinder]
kind = "rodless"
bore = "32 mm"
stroke = "100 mm"
dead_volume = { a = "8 cm3", b = "8 cm3" }
moving_mass = "1 kg"
[valve]
kind = "proportional-5/3"
nominal_flow = "350 l/min ANR"
critical_pressure_ratio = 0.3
[friction]
coulomb = "20 N"
breakaway = "30 N"
"""
#: Says at the end which heavy libraries were imported.
WATCHED = """
import sys, atexit
heavy = {'numpy', 'pandas', 'pint', 'polars', 'rich', 'scipy', 'xarray'}
atexit.register(lambda: sys.stderr.write(str(heavy & {*sys.modules})))
from pneudrive.cli.main import main
main()
"""


@pytest.mark.parametrize("words", [[], ["campaign"], ["rig"]])
def test_a_bare_command_is_answered_by_its_help(words, capsys):
    assert run(words) == 0
    assert "Usage: pneudrive" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("pneudrive sim", ["simulate"]),
        ("pneudrive campaign re", ["resume"]),
        ("pneudrive simulate --dur", ["--duration"]),
    ],
)
def test_the_shell_completes_without_loading_what_computes(line, wanted):
    words = {"COMP_WORDS": line, "COMP_CWORD": str(line.count(" ")), "_PNEUDRIVE_COMPLETE": "complete_bash"}
    done = subprocess.run(
        [sys.executable, "-c", WATCHED], env={**os.environ, **words}, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == wanted
    assert done.stderr == "set()"


def test_a_run_goes_to_a_file_without_what_other_commands_need(tmp_path):
    """From the command to the Parquet file the core does all: what starts slowly is not imported."""
    (tmp_path / "drive.toml").write_text(pn.Drive.load("catalogue:reference").to_toml())
    line = ["simulate", "drive.toml", "--command", "0 s: 1", "--duration", "0.2 s", "--out", "run.parquet"]
    words = [sys.executable, "-c", WATCHED, *line]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "set()"  # behind the notes
    assert done.stdout.splitlines()[-1] == "run.parquet"
    assert pl.read_parquet(tmp_path / "run.parquet")["time_s"][-1] == 0.2


def test_a_note_is_one_plain_line(tmp_path, capsys):
    path = tmp_path / "drive.toml"
    path.write_text(DRIVE)
    assert run(["simulate", str(path), "--command", "0.5", "--duration", "0.1 s"]) == 0
    notes = capsys.readouterr().err.splitlines()
    assert len(notes) == 1
    assert notes[0].startswith('Note: the friction table names no law, so law = "elasto-plastic" is used with assumed')
    assert ".py" not in notes[0]


def test_a_warning_points_at_the_line_of_the_user(tmp_path):
    script = tmp_path / "mine.py"
    script.write_text('import pneudrive as pn\nfriction = pn.Friction(coulomb="20 N", breakaway="30 N")\n')
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True)
    assert done.stderr.startswith(f"{script}:2: PneudriveWarning: the friction table names no law")


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["smc-sy3000", "--out", "x.toml"], "smc-sy3000 is a part, not a drive"),
        (["--out", "x.toml"], "--out needs the name of a drive"),
        (["starter", "--out", "x.csv"], "cannot be written"),
    ],
)
def test_only_a_drive_of_the_catalogue_becomes_a_file(words, what, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(["catalogue", *words]) == 2
    assert what in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
