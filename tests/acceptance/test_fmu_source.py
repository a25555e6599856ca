"""A controller as source code in an FMU: it compiles as freestanding C, and gives the bits of the core."""

from __future__ import annotations

import shutil
import struct
import subprocess
import zipfile

import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import pneudrive as pn
from pneudrive.errors import CommandError

AXIS = pn.Circuit.load("examples/controlled_axis.toml")
LAWS = ("pid", "fuzzy", "sliding-mode", "super-twisting", "inversion")
STRICT = ["-std=c99", "-ffreestanding", "-ffp-contract=off", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion"]
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")


def _numbers(bits):
    return [struct.unpack("<d", int(own, 16).to_bytes(8, "little"))[0] for own in bits.split()]


def _written(folder, law, version, setup="real"):
    tuning = pn.control.tune(AXIS, law, setup=setup)
    return str(pn.control.export(tuning, "fmu", folder / "law.fmu", version=version, setup=setup)[0])


def _begun(path, version):
    about = read_model_description(path)
    told = {"unzipDirectory": extract(path), "modelIdentifier": about.coSimulation.modelIdentifier}
    kind = FMU2Slave if version == "2.0" else FMU3Slave
    tool = kind(guid=about.guid or about.instantiationToken, instanceName="law", **told)
    tool.instantiate()
    if version == "2.0":
        tool.setupExperiment(startTime=0.0)
        tool.enterInitializationMode()
        get, put = tool.getReal, tool.setReal
    else:
        tool.enterInitializationMode(startTime=0.0)
        get, put = tool.getFloat64, tool.setFloat64
    tool.exitInitializationMode()
    places = {
        kind: [one.valueReference for one in about.modelVariables if one.causality == kind]
        for kind in ("input", "output")
    }
    return tool, (lambda values: put(places["input"], values)), (lambda: get(places["output"]))


@pytest.mark.parametrize(("law", "version"), [(law, "2.0") for law in LAWS] + [("inversion", "3.0")])
def test_source_code_gives_the_bits_of_the_core_and_compiles_freestanding(tmp_path, law, version):
    """Moves, two lost readings, a reference that jumps, disabled and enabled again, a lost sensor."""
    path = _written(tmp_path, law, version)
    assert validate_fmu(path) == []
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "own")
    sources = sorted((tmp_path / "own/sources").glob("*.c"))
    assert len(sources) == 2
    for source in sources:
        subprocess.run(["gcc", *STRICT, "-Werror", "-c", source.name, "-o", "own.o"], check=True, cwd=source.parent)
    rows = (tmp_path / "own/resources/conformance.txt").read_text().splitlines()
    tool, put, get = _begun(path, version)
    seen = set()
    for k, row in enumerate(row for row in rows if not row.startswith("#")):
        given, expected = row.split(" | ")
        put(_numbers(given))
        tool.doStep(k * 1e-3, 1e-3)
        found = get()
        bits = " ".join(f"{int.from_bytes(struct.pack('<d', own), 'little'):016x}" for own in found)
        assert bits == expected, f"sample {k}"
        seen.add(found[-1])
    assert seen == {0.0, 1.0, 2.0, 4.0}


def test_exported_code_controls_the_drive_as_its_controller_does(tmp_path):
    """The reference is an input: a move, sampled now and at the time at which a command acts."""
    tuning = pn.control.tune(AXIS, "inversion", setup="ideal")
    move = pn.control.reference("220 mm; 0.05 s: 280 mm in 0.3 s")
    run = pn.control.run(AXIS, "inversion", reference=move, setup="ideal", duration="0.5 s")
    path = _written(tmp_path, "inversion", "2.0", "ideal")
    tool, put, get = _begun(path, "2.0")
    ahead = tuning.plant.lag_s
    commands = []
    for k in range(run.sizes["time"]):
        t = k * 1e-3
        measured = [float(run[name][k]) for name in ("position", "pressure_a", "pressure_b")]
        now, then = (move.at([at])[0].tolist() for at in (t, t + ahead))
        put([*measured, *now, *then, float(t + ahead < 0.05 or t >= 0.35), 1.0])
        tool.doStep(t, 1e-3)
        commands.append(get()[0])
    # Time steps of a run are differences of times, which round.
    assert commands == pytest.approx(run["command"].values.tolist(), abs=1e-10)
    assert get()[-1] == 0.0


def test_a_controller_in_c_has_its_reference_as_an_input(tmp_path):
    with pytest.raises(CommandError, match="gets the reference as an input"):
        pn.control.export(pn.control.tune(AXIS, "pid"), "fmu", tmp_path / "law.fmu", along="R1")
