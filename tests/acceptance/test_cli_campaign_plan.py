"""`pneudrive campaign plan` as users meet it: what would run, a verdict, or one message and exit status 2."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

import pneudrive as pn
from acceptance.test_cli_simulate import DRIVE
from pneudrive.cli.main import run

LONG = (Path(__file__).parents[1] / "data" / "cli_campaign_plan_long.toml").read_text("utf-8")


def plan(capsys, *arguments):
    assert run(["campaign", "plan", *arguments]) == 0
    out, err = capsys.readouterr()
    assert not err
    return out


def minutes(text):
    """Read the total time that a plan shows."""
    hours, rest = re.search(r"\n\d+ +- +\d+ +\d+ +\d+ +(\d+):(\d+) ", text).groups()
    return 60 * int(hours) + int(rest)


def test_a_quick_look_takes_less_than_five_minutes(capsys):
    out = plan(capsys, "quick-look", "--rig", "default")
    assert minutes(out) < 5
    for words in (
        "tare 1, sweep 8, stop 8",
        "pre-flight: passed",
        "synthetic",
        "note: repeats = 1",
        "bytes per sample",
    ):
        assert words in out


@pytest.mark.parametrize("name", ["paper-speed", "paper-pressure", "paper-stops", "stops-pressure"])
def test_ready_protocols_pass_on_the_default_rig_within_a_shift(capsys, name):
    assert minutes(plan(capsys, name)) <= 480


def test_a_protocol_beyond_the_envelope_is_refused_with_the_reason(refusal, tmp_path):
    file = tmp_path / "fast.toml"
    file.write_text('[speed]\nlist = ["100 mm/s", "5 m/s"]\n')
    told = refusal(["campaign", "plan", file], "ProtocolError", "1 of 2 cycles breaks limits of the rig", "Hint")
    assert "b1/sweep/v5000/a0/b0/r1" in told
    assert "5000 mm/s; at most" in told


def test_a_protocol_that_takes_too_long_and_unused_tables_are_noted(printed, tmp_path):
    file = tmp_path / "long.toml"
    file.write_text(LONG + "[adaptive]\nrepeats = 2\n")
    out = printed(["campaign", "plan", file])
    assert minutes(out) > 90
    assert "more than limits.time" in out
    assert "[adaptive] is not applied" in out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["plan", "quik-look"], "Did you mean 'quick-look'?"),
        (["plan", "nowhere.toml"], "there is no file nowhere.toml"),
        (["plan", "quick-look", "--rig", "default1"], "Did you mean 'default'?"),
        (["plann"], "Did you mean 'plan'?"),
    ],
)
def test_what_is_mistyped_is_named(refusal, monkeypatch, tmp_path, arguments, says):
    monkeypatch.chdir(tmp_path)
    refusal(["campaign", *arguments], says)
    assert list(tmp_path.iterdir()) == []


def test_a_level_that_the_simulated_rig_does_not_have_is_refused(refusal, tmp_path):
    file = tmp_path / "p.toml"
    file.write_text('[speed]\nlist = "100 mm/s"\n[mounting]\nlevels = ["on the moon"]\n')
    refusal(["campaign", "plan", file], "no mounting 'on the moon'", "p.toml:4")


# --- What somebody types first: the bare command, a completion, a plain number; notes are words, not lines of source.

#: Says at the end which heavy libraries were imported.
WATCHED = """
import sys, atexit
heavy = {'numpy', 'pandas', 'pint', 'polars', 'rich', 'scipy', 'xarray'}
atexit.register(lambda: sys.stderr.write(str(sorted(heavy & {*sys.modules}))))
from pneudrive.cli.main import main
main()
"""


@pytest.mark.parametrize("words", [[], ["campaign"], ["rig"]])
def test_a_bare_command_is_answered_by_its_help(words, printed):
    assert "Usage: pneudrive" in printed(words)


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
    assert done.stderr == "[]"


def test_a_run_goes_to_a_file_without_what_other_commands_need(tmp_path):
    """From the command to the Parquet file: what starts slowly is not imported, but for the writer of the file."""
    (tmp_path / "drive.toml").write_text(pn.Drive.load("catalogue:reference").to_toml())
    line = ["simulate", "drive.toml", "--command", "0 s: 1", "--duration", "0.2 s", "--out", "run.parquet"]
    words = [sys.executable, "-c", WATCHED, *line]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "['numpy', 'polars']"  # behind the notes
    assert done.stdout.splitlines()[-1] == "run.parquet"
    assert pl.read_parquet(tmp_path / "run.parquet")["time_s"][-1] == 0.2


def test_a_note_is_one_plain_line(tmp_path, capsys):
    path = tmp_path / "drive.toml"
    path.write_text(DRIVE.partition("law =")[0] + 'coulomb = "20 N"\nbreakaway = "30 N"\n')
    assert run(["simulate", str(path), "--command", "0.5", "--duration", "0.02 s"]) == 0
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
def test_only_a_drive_of_the_catalogue_becomes_a_file(words, what, refusal, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refusal(["catalogue", *words], what)
    assert list(tmp_path.iterdir()) == []
