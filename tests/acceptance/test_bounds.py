"""Protocols, folders, fits and recordings that ask for too much, or hold nothing: one message, status 2, nothing left.

Each case is a file with one thing changed; all run in this process, without a rig that moves.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from oracle.campaigns import World, write_campaign
from pneudrive.campaign.planning.protocol import ready_protocols
from pneudrive.cli.main import run
from pneudrive.rig.description import DEFAULT
from pneudrive.signals.proposal import propose_layout

LOOK, STOPS = "quick-look", "paper-stops"
PROTOCOLS = {
    "count": (LOOK, "count = 4", "count = 1_000_000_000", "speed.count: .* is out of bounds"),
    "count, no whole number": (LOOK, "count = 4", "count = 1e9", "speed.count: .* is not a whole number"),
    "count, not a number": (LOOK, "count = 4", "count = nan", "speed.count: nan is not"),
    "range": (LOOK, '"300 mm/s"', '"1e300 mm/s"', "speed.to: .* is out of bounds"),
    "range of 9,999": (LOOK, "count = 4", "count = 9999", "do not differ in their first 4 significant digits"),
    "infinite": (LOOK, '"300 mm/s"', '"inf mm/s"', "speed.to: .* is not finite"),
    "seed": (LOOK, "seed = 1", "seed = -1", "seed: -1 is out of bounds"),
    "sentinels": (STOPS, "every = 12", "every = 0", "sentinel.every: 0 is out of bounds"),
    "stop": (LOOK, '"10 s"]', '"1e300 s"]', "stop.durations: .* is out of bounds"),
    "stop of no number": (LOOK, '"10 s"]', '"nan s"]', "stop.durations: .* is not finite"),
    "stop of months": (LOOK, '"10 s"]', '"1e7 s"]', "would have 200,00\\d,\\d{3} samples"),
    "samples": (LOOK, "[before_", "[sampling]\nsamples_per_stroke = 1_000_000_000_000\n[before_", "out of bounds"),
    "hold rate": (LOOK, "[before_", '[sampling]\nhold_rate = "1e12 Hz"\n[before_', "would have 999,999,999,999"),
    "below vacuum": (LOOK, '"0.5 bar gauge"]', '"-5 bar gauge"]', "-3.987 bar abs in chamber a"),
    "position": (STOPS, '"50 %"', '"500 %"', "stop.position: .* outside the range"),
}  # fmt: skip


def refused(arguments: list[str], said: str, folder: Path, capfd) -> str:
    """Run a command that must end in one message, and must leave everything as it was."""
    before = sorted((p, p.stat().st_size) for p in folder.rglob("*"))
    assert run(arguments) == 2
    told = capfd.readouterr().err
    assert "Traceback" not in told
    assert re.match(r"\w+Error: ", told), told
    assert re.search(said, told), told
    assert sorted((p, p.stat().st_size) for p in folder.rglob("*")) == before
    return told


@pytest.mark.parametrize("case", PROTOCOLS)
def test_a_protocol_that_asks_for_too_much(case, tmp_path, capfd):
    name, old, new, said = PROTOCOLS[case]
    text = ready_protocols()[name].read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "protocol.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    refused(["campaign", "plan", str(path)], said, tmp_path, capfd)
    refused(["campaign", "run", str(path), "--out", str(tmp_path / "new"), "--yes"], said, tmp_path, capfd)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory) -> Path:
    return write_campaign(tmp_path_factory.mktemp("sound") / "campaign", World(samples=200), 1)


COMMANDS = {
    "status": ["campaign", "status", "DIR"],
    "resume": ["campaign", "resume", "DIR", "--yes"],
    "characterise": ["characterise", "DIR", "--out", "OUT"],
    "fit": ["fit", "DIR", "--out", "OUT.toml"],
    "compare": ["compare", "DIR", "SOUND", "--out", "OUT"],
}
BRACKETS = "[" * 1000 + "]" * 1000
FOLDERS = {
    "cycles is a file": ("cycles", "x", "must be the folder of the cycles"),
    "the rig is nothing": ("rig.json", "{}", "area_a_m2 is missing"),
    "the rig is a list": ("rig.json", "[1]", "not a JSON object"),
    "the head is empty": ("campaign.json", "", "not JSON"),
    "the head is deep": ("campaign.json", BRACKETS, "nested deeper"),
    "the head is a folder": ("campaign.json", None, "this is a folder, but a file is needed"),
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("case", FOLDERS)
def test_a_folder_that_is_none(case, command, campaign, tmp_path, capfd):
    name, content, said = FOLDERS[case]
    folder = tmp_path / "campaign"
    shutil.copytree(campaign, folder)
    path = folder / name
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    if content is None:
        path.mkdir()
    else:
        path.write_text(content)
    words = {"DIR": str(folder), "SOUND": str(campaign), "OUT": str(tmp_path / "out")}
    words["OUT.toml"] = f"{words['OUT']}.toml"
    refused([words.get(word, word) for word in COMMANDS[command]], said, tmp_path, capfd)


def test_a_folder_whose_cycles_are_gone_can_go_on_or_says_so(campaign, tmp_path, capfd):
    folder = tmp_path / "campaign"
    shutil.copytree(campaign, folder)
    shutil.rmtree(folder / "cycles")
    refused(["characterise", str(folder)], "no cycle that can be used", tmp_path, capfd)
    assert run(["campaign", "status", str(folder)]) == 0


COLUMNS = ("Zeit [s]", "Weg [mm]", "Kraft [N]", "p_A [bar]", "p_B [bar]")
NOTHING = {"nan": ["nan"], "-1e308 and 1e308": ["1e308", "-1e308"], "empty": [""]}


def write_recording(path: Path, column: str, values: list[str]) -> None:
    t = np.arange(0.0, 3.0, 0.01)
    phase = t % 1.0
    table = [
        t,
        20.0 + 300.0 * np.where(phase < 0.5, 2.0 * phase, 2.0 - 2.0 * phase),
        np.where(phase < 0.5, 15.0, -15.0),
    ]
    texts = [[f"{v:.4f}" for v in one] for one in [*table, np.full(t.size, 2.0), np.full(t.size, 2.0)]]
    texts[COLUMNS.index(column)] = (values * t.size)[: t.size]
    path.write_text("\n".join([";".join(COLUMNS), *map(";".join, zip(*texts, strict=True))]) + "\n")


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of what NumPy makes of such numbers on the way
@pytest.mark.parametrize("values", NOTHING)
@pytest.mark.parametrize("column", COLUMNS[:3])
def test_a_column_without_numbers(column, values, tmp_path, monkeypatch, capfd):
    """A layout is proposed, with what it does not know; what needs the column says so."""
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "run.csv", column, NOTHING[values])
    propose_layout(tmp_path / "run.csv")
    given = "".join(
        f'{role} = {{ column = "{name}", unit = "{unit}" }}\n'
        for role, name, unit in zip(
            ("time", "position", "force", "pressure_a", "pressure_b"),
            COLUMNS,
            ("s", "mm", "N", "bar abs", "bar abs"),
            strict=True,
        )
    )
    text = f'delimiter = ";"\nheader = true\n[columns]\n{given}[geometry]\nbore = "25 mm"\n'
    (tmp_path / "layout.toml").write_text(text)
    for command, out in (("characterise", "out"), ("fit", "out.toml")):
        refused([command, "run.csv", "--layout", "layout.toml", "--out", out], "run", tmp_path, capfd)


@pytest.mark.parametrize("table", ["design", "schema", "a.b"])
def test_a_table_that_a_rig_file_has_not(table, tmp_path, capfd):
    path = tmp_path / "rig.toml"
    path.write_text(DEFAULT.read_text(encoding="utf-8") + f"\n[{table}]\nx = 1\n", encoding="utf-8")
    refused(["campaign", "plan", LOOK, "--rig", str(path)], r"is not a known key|TOML", tmp_path, capfd)
