"""A controller as source code in an FMU: it compiles as freestanding C, and gives the bits of the core."""

from __future__ import annotations

import ctypes
import shutil
import struct
import subprocess
import zipfile

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import pneudrive as pn

AXIS = pn.Circuit.load("examples/controlled_axis.toml")
LAWS = ("pid", "fuzzy", "sliding-mode", "super-twisting", "inversion")
STRICT = ["-std=c99", "-ffreestanding", "-ffp-contract=off", "-O0", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion"]
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")


def _numbers(bits):
    return [struct.unpack("<d", int(own, 16).to_bytes(8, "little"))[0] for own in bits.split()]


def _written(folder, law, version):
    tuning = pn.control.tune(AXIS, law, setup="real")
    return str(pn.control.export(tuning, "fmu", folder / "law.fmu", version=version, setup="real")[0])


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


@pytest.mark.parametrize(("law", "version"), [(law, "3.0" if law == "inversion" else "2.0") for law in LAWS])
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


def _along_a_move(law):
    """Return a tuning, the commands of a run, and the inputs of the code: also the reference when a command acts."""
    tuning = pn.control.tune(AXIS, law, setup="ideal")
    move = pn.control.reference("220 mm; 0.05 s: 280 mm in 0.3 s")
    run = pn.control.run(AXIS, law, reference=move, setup="ideal", duration="0.5 s")
    t = run["time"].values
    then = t + tuning.plant.lag_s
    measured = [run[name].values for name in ("position", "pressure_a", "pressure_b")]
    stands = (then < 0.05) | (t >= 0.35)
    given = np.column_stack([*measured, move.at(t), move.at(then), stands, np.ones(t.size)])
    return tuning, run["command"].values, given


@pytest.mark.parametrize("law", LAWS[2:])
def test_code_in_single_precision_commands_what_the_simulated_controller_does(tmp_path, law):
    """Single samples at the bound of the dead band differ by more than the others."""
    tuning, commands, given = _along_a_move(law)
    pn.control.export(tuning, "c", tmp_path, setup="ideal", name="own", precision="single")
    strict = [*STRICT[3:], "-Wdouble-promotion", "-Werror", "-shared", "-fPIC", "-o", "own.so", "own.c", "-lm"]
    subprocess.run(["gcc", "-std=c99", *strict], cwd=tmp_path, check=True)
    code, memory = ctypes.CDLL(str(tmp_path / "own.so")), (ctypes.c_float * 4000)()
    found = np.zeros((len(given), 5), np.float32)
    for row, answer in zip(given.astype(np.float32), found, strict=True):
        code.own_step(code.own_tuned, memory, row.ctypes, answer.ctypes)
    middle, most, worst = np.quantile(np.abs(found[:, 0] - commands), (0.5, 0.99, 1.0))
    assert (0 < middle < 5e-4, most < 5e-3, worst < 0.1) == (True, True, True)
