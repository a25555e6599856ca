"""`pneudrive campaign plan` as users meet it: what would run, a verdict, or one message and exit status 2."""

import re

import pytest

from pneudrive.cli.main import run

LONG = """\
name = "Long"
repeats = 3
directions = "+x"
[stop]
durations = { from = "0.1 s", to = "100 s", count = 7 }
restart_speed = ["1 mm/s", "10 mm/s"]
approach = "2 mm"
recovery = "5 mm"
[pressure]
both = ["0 bar gauge", "0.5 bar gauge", "1 bar gauge"]
[order]
kind = "randomised"
[limits]
time = "90 min"
"""


def plan(capsys, *arguments):
    status = run(["campaign", "plan", *map(str, arguments)])
    out, err = capsys.readouterr()
    return status, out, err


def minutes(text):
    """Read the total time that a plan shows."""
    hours, rest = re.search(r"\n\d+ +- +\d+ +\d+ +\d+ +(\d+):(\d+) ", text).groups()
    return 60 * int(hours) + int(rest)


def test_a_quick_look_takes_less_than_five_minutes(capsys):
    status, out, err = plan(capsys, "quick-look", "--rig", "default")
    assert (status, err) == (0, "")
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
    status, out, err = plan(capsys, name)
    assert (status, err) == (0, "")
    assert minutes(out) <= 480


def test_a_protocol_beyond_the_envelope_is_refused_with_the_reason(capsys, tmp_path):
    file = tmp_path / "fast.toml"
    file.write_text('[speed]\nlist = ["100 mm/s", "5 m/s"]\n')
    status, out, err = plan(capsys, file)
    assert (status, out) == (2, "")
    for words in (
        "ProtocolError",
        "1 of 2 cycles breaks its limits",
        "b1/sweep/v5000/a0/b0/r1",
        "5000 mm/s; at most",
        "Hint",
    ):
        assert words in err


def test_a_protocol_that_takes_too_long_and_unused_tables_are_noted(capsys, tmp_path):
    file = tmp_path / "long.toml"
    file.write_text(LONG + "[adaptive]\nrepeats = 2\n")
    status, out, _ = plan(capsys, file)
    assert status == 0
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
def test_what_is_mistyped_is_named(capsys, monkeypatch, tmp_path, arguments, says):
    monkeypatch.chdir(tmp_path)
    assert run(["campaign", *arguments]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_a_level_that_the_simulated_rig_does_not_have_is_refused(capsys, tmp_path):
    file = tmp_path / "p.toml"
    file.write_text('[speed]\nlist = "100 mm/s"\n[mounting]\nlevels = ["on the moon"]\n')
    status, out, err = plan(capsys, file)
    assert (status, out) == (2, "")
    assert "no mounting 'on the moon'" in err
    assert "p.toml:4" in err
