"""Every shipped example and drive goes through every export, and the FMUs of circuits run as the core does."""

from __future__ import annotations

import json
import subprocess
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

import pneudrive as pn
from pneudrive.cli.main import run as command_line

EXAMPLES = Path(__file__).parents[2] / "examples"
FILES = sorted([*EXAMPLES.glob("*.toml"), *(EXAMPLES / "axes").glob("*.toml")])
DRIVES = sorted((EXAMPLES.parent / "data/catalogue/drives").glob("*.toml"))
#: Every second file is exported by either version: a kind of part stands in several of them.
VERSIONS = ("2.0", "3.0")
DURATION_S = 0.02
HEXAPOD = Path(__file__).parents[1] / "data" / "hexapod.toml"


@pytest.fixture
def export(monkeypatch):
    """Export without the compression of the library, which takes most of the time."""

    def exported(*words):
        with monkeypatch.context() as patch:
            plain = {"ZipFile": zipfile.ZipFile, "ZipInfo": zipfile.ZipInfo, "ZIP_DEFLATED": zipfile.ZIP_STORED}
            patch.setattr("pneudrive.fmu.package.zipfile", SimpleNamespace(**plain))
            assert command_line(["export", *map(str, words)]) == 0

    return exported


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_an_example_is_exported(path, tmp_path, export):
    circuit = pn.Circuit.load(path)
    file = tmp_path / "example.fmu"
    export(path, "--to", "fmu", "--fmi", VERSIONS[FILES.index(path) % 2], "--out", file)
    assert validate_fmu(str(file)) == []
    export(path, "--to", "c", "--out", tmp_path / "c")
    link = ("example.c", "-L.", "-lpneudrive", "-Wl,-rpath,$ORIGIN", "-o", "example")
    subprocess.run(["gcc", *link], cwd=tmp_path / "c", check=True)
    done = subprocess.run(["./example"], cwd=tmp_path / "c", check=True, capture_output=True)
    assert len(done.stdout.splitlines()) == 101
    (plan,) = [json.loads(file.read_text()) for file in (tmp_path / "c").rglob("*.json")]
    names = [variable["name"] for variable in plan["variables"]]
    assert len(names) == len(set(names))
    run = pn.simulate(circuit, None, DURATION_S)
    outputs = [name for name in run.data_vars if name in names and name.endswith("position")]
    found = simulate_fmu(str(file), stop_time=DURATION_S, output_interval=DURATION_S, output=outputs)
    for name in outputs:
        assert found[name][-1] == pytest.approx(float(run[name][-1]), abs=1e-7)


@pytest.mark.parametrize("path", DRIVES, ids=lambda path: path.stem)
def test_a_drive_of_the_catalogue_is_exported(path, tmp_path, export, refusal):
    drive = f"catalogue:{path.stem}"
    export(drive, "--to", "fmu", "--fmi", VERSIONS[DRIVES.index(path) % 2], "--out", tmp_path / "drive.fmu")
    assert validate_fmu(str(tmp_path / "drive.fmu")) == []
    export(drive, "--to", "c", "--out", tmp_path / "c")
    for tool in ("simscape", "modelica", "csv", "st"):
        export(drive, "--to", tool, "--speeds", "1 mm/s .. 500 mm/s", "--out", tmp_path / tool)
    refusal(["export", FILES[0], "--to", "modelica"], "Export the whole circuit with --to fmu or --to c")


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_a_platform_on_six_legs_runs_as_an_fmu(interface, tmp_path, export):
    """Its tilts are outputs as angles, and states as parts of a quaternion."""
    file = tmp_path / "hexapod.fmu"
    export(HEXAPOD, "--to", "fmu", "--out", file)
    found = simulate_fmu(
        str(file),
        stop_time=DURATION_S,
        output_interval=DURATION_S,
        fmi_type=interface,
        output=["tripod.tilt_1", "state.tripod.tilt_1"],
    )
    tilt = float(pn.simulate(pn.Circuit.load(HEXAPOD), None, DURATION_S)["tripod.tilt_1"][-1])
    assert abs(tilt) > 1e-4
    assert found["tripod.tilt_1"][-1] == pytest.approx(tilt, rel=1e-3)
    assert found["state.tripod.tilt_1"][-1] == pytest.approx(np.sin(0.5 * tilt), rel=1e-3)
