"""A drive in a C program, and its friction in a PLC: compiled or run, they give the core's numbers."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.cli.main import run as command_line
from pneudrive.identify.export import steady_friction

DRIVE = pn.Drive.load("catalogue:reference")
STRICT = ("-Wall", "-Wextra", "-Werror", "-pedantic", "-std=c99", "-fsanitize=address,undefined")
#: Calls that fail, and a drive that is put back: prints a line for each.
MISUSE = (Path(__file__).parents[1] / "data" / "misuse.c").read_text("utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder that a user exports."""
    made = tmp_path_factory.mktemp("c")
    (made / "drive.toml").write_text(DRIVE.to_toml(), encoding="utf-8")
    assert command_line(["export", str(made / "drive.toml"), "--to", "c", "--out", str(made)]) == 0
    return made


def compiled(folder, name):
    """Compile a program of the folder with all warnings, run it, and return its lines."""
    link = ("-L.", "-lpneudrive", "-Wl,-rpath,$ORIGIN", "-o", name)
    subprocess.run(["gcc", *STRICT, f"{name}.c", *link], cwd=folder, check=True, capture_output=True, text=True)
    done = subprocess.run([f"./{name}", "drive.json"], cwd=folder, check=True, capture_output=True, text=True)
    assert done.stderr == ""
    return done.stdout.splitlines()


def test_the_example_moves_as_a_session_does(folder):
    lines = compiled(folder, "example")
    session = DRIVE.start(rtol=1e-7)
    for k, line in enumerate(lines):
        assert float(line.split()[4]) == session.read("position_m"), line
        session.set("command", 1.0 if k < 50 else 0.0)
        session.advance(session.time + 1e-3)
    assert len(lines) == 101


def test_a_c_program_is_told_what_is_wrong_and_can_go_back(folder):
    (folder / "misuse.c").write_text(MISUSE, encoding="utf-8")
    told = compiled(folder, "misuse")
    expected = [
        r"1 the description cannot be read: EOF whi",  # as far as there is room
        r"1",
        r"1 valve\.command = 1\.5 is out of bounds.*",
        r'1 there is no variable "friction\.colomb"',
        *["0", "0"],
        r"1 friction\.coulomb is fixed: .*",
        *["0", "0", "0", "0"],
        r"0 0\.\d+",
        r"1 these bytes of a state are damaged|1 these bytes of a session are damaged",
        r"1 there is no drive",
    ]
    for line, pattern in zip(told, expected, strict=True):
        assert re.fullmatch(pattern, line), (line, pattern)
    session = DRIVE.replace({"friction.coulomb": "40 N", "load.force": "-20 N"}).start(rtol=1e-7)
    session.set("command", 0.6)
    for t in (0.05, 0.07):
        session.advance(t)
    assert float(told[-3].split()[1]) == session.read("position_m")


def run_text(text, velocities):
    """Run a function in structured text: its statements, word by word, as Python."""
    table = re.search(r":= \[(.*?)\];", text, re.DOTALL)
    body = re.search(r"END_VAR\n(s :=.*)END_FUNCTION", text, re.DOTALL)
    assert table is not None
    assert body is not None
    lines, depth = ["def friction(v):"], 1
    for line in body[1].replace("END_IF;", "END").split("\n"):
        own = line.strip().replace("PneudriveFriction", "out").removesuffix(";").replace(":=", "=")
        own = own.replace("RETURN", "return out").removesuffix(" THEN") + ":" * own.endswith("THEN")
        if own in ("END", "ELSE"):
            depth -= 1
        if own and own != "END":
            lines.append("    " * depth + own.replace("ELSE", "else:").replace("IF ", "if "))
        depth += own.endswith(("THEN", ":")) or own == "ELSE"
    numbers = [float(one) for one in table[1].split(",")]
    known = {"ABS": abs, "LN": np.log, "TRUNC": int, "MIN": min, "DINT_TO_LREAL": float, "c": numbers}
    exec("\n".join([*lines, "    return out"]), known)
    return np.array([known["friction"](v) for v in velocities])


@pytest.mark.parametrize("name", ["catalogue:reference", "catalogue:parker-osp-p25-sy5000"])
def test_friction_in_structured_text_is_that_of_the_core(name, tmp_path, printed):
    speeds = ["--speeds", "0.2 mm/s .. 2 m/s", "--pressure-a", "5 bar gauge"]
    text = printed(["export", name, "--to", "st", *speeds])
    rng = np.random.default_rng(3)
    inside = np.exp(rng.uniform(np.log(0.2e-3), np.log(2.0), 1000)) * rng.choice([-1.0, 1.0], 1000)
    own = steady_friction(pn.Drive.load(name).friction.core(), inside, 5e5, 0.0) * np.sign(inside)
    found = run_text(text, inside)
    assert np.abs(found / own - 1.0).max() < 1e-6
    outside = run_text(text, [0.0, 1e-4, -1e-4, 2e-4, 2.1])
    assert outside[:4] == pytest.approx([0.0, 0.5 * outside[3], -0.5 * outside[3], outside[3]])
    at = steady_friction(pn.Drive.load(name).friction.core(), np.array([2.0, 2.1]), 5e5, 0.0)
    assert outside[4] == pytest.approx(at[1], rel=1e-3), "beyond its range it goes on as a line"
