"""`nmpc` as an FMU gives the same bits as in a run, and controls a drive that is an FMU."""

from __future__ import annotations

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

import pneudrive as pn
from pneudrive.cli.main import run as command_line
from pneudrive.errors import CommandError

AXIS = pn.Circuit.load("examples/controlled_axis.toml")
MOVE = "220 mm; 0.05 s: 280 mm in 0.3 s"


def _begun(path, stop=None):
    about = read_model_description(path)
    tool = FMU2Slave(
        guid=about.guid, unzipDirectory=extract(path), modelIdentifier="pneudrive", instanceName=about.modelName
    )
    tool.instantiate()
    tool.setupExperiment(startTime=0.0, stopTime=stop)
    tool.enterInitializationMode()
    tool.exitInitializationMode()
    places = {one.name: one.valueReference for one in about.modelVariables}

    def given(values):
        tool.setReal([places[name] for name in values], list(values.values()))

    def read(*names):
        return tool.getReal([places[name] for name in names])

    return tool, given, read


@pytest.fixture(scope="module")
def led():
    """Return a tuning of `nmpc`, and a run that it leads."""
    tuning = pn.control.tune(AXIS, "nmpc", setup="ideal")
    return tuning, pn.control.run(AXIS, reference=MOVE, controller=tuning, setup="ideal", duration="0.5 s")


def test_equal_samples_give_the_bits_of_a_run(tmp_path, led):
    tuning, run = led
    for version in ("3.0", "2.0"):
        given = {"setup": "ideal", "along": MOVE, "version": version}
        path = str(pn.control.export(tuning, "fmu", tmp_path / "law.fmu", **given)[0])
        assert validate_fmu(path) == []
        assert float(read_model_description(path).defaultExperiment.stepSize) == 1e-3, "a tool steps with its period"
    tool, given, read = _begun(path)
    commands, t = [], 0.0
    for k in range(run.sizes["time"]):
        row = {name: float(run[name][k]) for name in ("position", "pressure_a", "pressure_b")}
        if k == 100:
            kept = tool.getFMUstate()
            given({name: 1.1 * value for name, value in row.items()})
            tool.doStep(t, 0.003)
            tool.setFMUstate(kept)
        given(row)
        tool.doStep(t, 1e-3)
        t = (k + 1) * 1e-3
        commands.append(read("command")[0])
    assert np.array_equal(commands, run["command"].values)
    assert np.ptp(commands) > 0.05, "it moves"


def test_a_controller_and_a_drive_are_coupled_as_in_a_run(tmp_path, led):
    tuning, run = led
    law = str(pn.control.export(tuning, "fmu", tmp_path / "law.fmu", setup="ideal", along=MOVE)[0])
    cylinder, (valve,) = tuning.plant.cylinder, tuning.plant.valves
    start = {f"{cylinder}.position": "220 mm"}
    start |= {f"{cylinder}.{side}.pressure": f"{float(run[f'pressure_{side}'][0])!r} Pa abs" for side in "ab"}
    plant = str(pn.export_fmu(AXIS, tmp_path / "axis.fmu", initial=start).path)
    (one, tell, heard), (other, drive, seen) = _begun(law), _begun(plant)
    measured = (f"{cylinder}.position", f"{cylinder}.a.pressure", f"{cylinder}.b.pressure")
    away = []
    for k in range(500):
        t = k * 1e-3
        now = seen(*measured)
        away.append(abs(now[0] - float(run["position"][k])))
        tell(dict(zip(("position", "pressure_a", "pressure_b"), now, strict=True)))
        one.doStep(t, 1e-3)
        drive({f"{valve}.command": heard("command")[0]})
        other.doStep(t, 1e-3)
    assert max(away) < 0.1e-6
    tell({"emergency_stop": 1.0})
    one.doStep(0.5, 1e-3)
    assert heard("events")[0] == 1.0


def test_a_user_exports_a_law_as_an_fmu_and_is_told_what_is_missing(tmp_path, refusal):
    out, drive = tmp_path / "law.fmu", ["--drive", "examples/controlled_axis.toml"]
    refusal(["control", "export", "nmpc", "--to", "fmu", "--out", out, *drive], "needs the reference")
    assert (
        command_line(["control", "export", "nmpc", "--to", "fmu", "--out", str(out), *drive, "--reference", "R1"]) == 0
    )
    assert read_model_description(str(out)).coSimulation is not None
    assert read_model_description(str(out)).modelExchange is None
    with pytest.raises(CommandError, match="gets the reference as an input"):
        pn.control.export(pn.control.tune(AXIS, "pid"), "c", tmp_path, along=MOVE)
    tuning = pn.control.tune(AXIS, "nmpc")
    with pytest.raises(CommandError, match="stroke"):
        pn.control.export(tuning, "fmu", out, along="220 mm; 1 s: 900 mm in 1 s")
