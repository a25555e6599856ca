"""`pneudrive simulate` as users meet it: a file appears, or one message on stderr and exit status 2; no traceback."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import polars as pl
import pytest

DRIVE = (Path(__file__).parents[1] / "data" / "simulated_axis.toml").read_text("utf-8")
GOOD = ["--command", "0 s: 0.6, 0.1 s: -0.6", "--duration", "0.2 s"]


def pneudrive(*arguments, cwd):
    program = Path(sys.executable).with_name("pneudrive")
    return subprocess.run([program, *arguments], capture_output=True, text=True, cwd=cwd, timeout=60, check=False)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "drive.toml").write_text(DRIVE)
    return tmp_path


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".nc"])
def test_a_trajectory_file_appears(folder, suffix):
    done = pneudrive("simulate", "drive.toml", *GOOD, "--sample-rate", "500 Hz", "--out", f"run{suffix}", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"run{suffix}" in done.stdout
    assert sorted(p.name for p in folder.iterdir()) == ["drive.toml", f"run{suffix}"]
    if suffix == ".parquet":
        table = pl.read_parquet(folder / "run.parquet")
        assert table["time_s"].to_list()[-1] == 0.2
        assert len(table) == 101
        assert table["position_m"].max() > 0.06  # it moved out, from mid stroke
        assert table["velocity_m_s"].min() < -0.1  # and back


WRONG = {
    "no such drive": (["simulate", "drv.toml", *GOOD], "there is no file drv.toml", "drive.toml"),
    "unknown start": (
        ["simulate", "drive.toml", *GOOD, "--initial", "positon = 1 mm"],
        "initial.positon",
        "Did you mean 'position'",
    ),
    "unknown suffix": (["simulate", "drive.toml", *GOOD, "--out", "run.xlsx"], "'.xlsx' cannot be written", ".parquet"),
    "unknown picture": (["simulate", "drive.toml", *GOOD, "--plot", "run.bmp"], "'.bmp' cannot be written", ".png"),
    "unknown command": (["simulat"], "there is no command 'simulat'", "Did you mean 'simulate'"),
    "missing option": (["simulate", "drive.toml", "--duration", "1 s"], "--command", ""),
}


@pytest.mark.parametrize(("arguments", "what", "also"), WRONG.values(), ids=WRONG)
def test_wrong_input_gets_one_message(folder, arguments, what, also, monkeypatch, refusal):
    monkeypatch.chdir(folder)
    refusal(arguments, what, also)
    assert [p.name for p in folder.iterdir()] == ["drive.toml"]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="needs a user for whom folders can be closed")
def test_a_closed_output_folder(folder):
    closed = folder / "closed"
    closed.mkdir(mode=0o500)
    done = pneudrive("simulate", "drive.toml", *GOOD, "--out", "closed/run.csv", cwd=folder)
    assert (done.returncode, list(closed.iterdir())) == (2, [])
    assert "cannot be written" in done.stderr


def test_a_wrong_file_names_its_line(folder):
    (folder / "drive.toml").write_text(DRIVE.replace('"12 mm"', '"50 mm"'))
    done = pneudrive("simulate", "drive.toml", *GOOD, cwd=folder)
    assert done.returncode == 2
    assert done.stderr == (
        "DescriptionError: cylinder.rod_diameter = 50 mm must be smaller than cylinder.bore = 32 mm.   drive.toml:7\n"
        '    rod_diameter = "50 mm"\n'
        "    Hint: Check whether bore and rod are swapped.\n"
    )


def test_interrupted(folder):
    """A piston on two air springs, without friction or heat, swings for ever."""
    swings = DRIVE[: DRIVE.index("[friction]")] + '[friction]\nlaw = "coulomb"\ncoulomb = "1e-9 N"\n'
    adiabatic = swings.replace("[valve]", 'heat_transfer = "0 W/(m2 K)"\n[valve]')
    (folder / "drive.toml").write_text(adiabatic)
    program = Path(sys.executable).with_name("pneudrive")
    line = [
        *("simulate", "drive.toml", "--command", "0 s: 0", "--duration", "1e6 s", "--sample-rate", "0.001 Hz"),
        *("--initial", "position = 50 mm, pressure_a = 5 bar abs, pressure_b = 3 bar abs", "--out", "run.csv"),
    ]
    started = subprocess.Popen([program, *line], cwd=folder, stderr=subprocess.PIPE, text=True)
    time.sleep(2.0)
    started.send_signal(signal.SIGINT)
    _, message = started.communicate(timeout=20)
    assert (started.returncode, message) == (130, "Interrupted; finished results are kept.\n")
    assert [p.name for p in folder.iterdir()] == ["drive.toml"]


def test_a_simulation_that_stops_is_no_wrong_input(folder):
    done = pneudrive("simulate", "drive.toml", *GOOD, "--initial", "velocity = 1e5 m/s", "--out", "run.csv", cwd=folder)
    assert (done.returncode, "Traceback" in done.stderr) == (1, False)
    assert done.stderr.startswith("SimulationError: ")
    assert [p.name for p in folder.iterdir()] == ["drive.toml"]


def test_catalogue_and_schema(printed, refusal):
    assert "smc-eus11-83" in printed(["catalogue", "smc-sy5000"])
    assert "assumed" in printed(["catalogue", "parker-osp-p25-sy5000"])
    assert '"stribeck_velocity"' in printed(["schema"])
    refusal(["catalogue", "smc-sy500"], "smc-sy500")
