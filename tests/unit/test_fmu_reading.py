"""An archive that is damaged, or is not an FMU, is refused in one sentence, whatever its libraries raise."""

from __future__ import annotations

import random
import zipfile
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import CommandError, FitError
from pneudrive.fmu.package import read_fmu
from pneudrive.simulation.trajectory import meaning

XML = (
    '<?xml version="1.0" encoding="{}"?><fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">'
    '<CoSimulation modelIdentifier="m"/><ModelVariables><Float64 name="x" causality="output" valueReference="1"/>'
    '<Boolean name="on" causality="parameter" start="true"/></ModelVariables></fmiModelDescription>'
)


def archive(path, text, name="modelDescription.xml"):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(name, text)
    return path


def test_a_sound_one_is_read(tmp_path):
    found = read_fmu(archive(tmp_path / "m.fmu", XML.format("utf-8")))
    assert (*found.kinds, *((v.name, v.start) for v in found.variables)) == ("CoSimulation", ("x", None), ("on", None))


@pytest.mark.parametrize("name", ["no-such", "utf-7", "idna", "base64"])
def test_an_unknown_encoding(tmp_path, name):
    with pytest.raises(CommandError, match="cannot be read as an FMU"):
        read_fmu(archive(tmp_path / "m.fmu", XML.format(name)))


def test_damaged_archives(tmp_path):
    path = archive(tmp_path / "m.fmu", XML.format("utf-8") + " " * 500)
    sound = path.read_bytes()
    refused = 0
    for seed in range(300):
        rng, data = random.Random(seed), bytearray(sound)
        for _ in range(rng.choice((1, 1, 3, 20))):
            data[rng.randrange(len(data))] = rng.randrange(256)
        path.write_bytes(data if rng.random() < 0.8 else data[: rng.randrange(len(data))])
        try:
            read_fmu(path)
        except CommandError:
            refused += 1
    assert refused > 200


# --- A drive with tubes is identified from a recording: its numbers and those of the tubes, by their names in the file.


def with_tubes(length_m: float, **changes: object) -> pn.Drive:
    tube = {"length": "1.5 m", "diameter": "4 mm"}
    tubing = {"tubing": {"a": tube | {"length": f"{length_m} m"}, "b": tube}}
    return pn.Drive.load("catalogue:reference").replace(tubing | changes)


@pytest.fixture(scope="module")
def recorded() -> dict[str, np.ndarray]:
    """Simulate a drive that the search does not know, with noise."""
    start = "position = 0.2 m, pressure_a = 3 bar abs, pressure_b = 3 bar abs"
    run = pn.simulate(with_tubes(2.0), "0 s: 0.3, 0.2 s: -0.3", "0.4 s", initial=start, sample_rate="500 Hz")
    return noisy(run, 7, 2e-5, 300.0)


def noisy(run, seed, position_m, pressure_pa):
    noise, out = np.random.default_rng(seed), {"time_s": run.time.to_numpy(), "command": run["command"].to_numpy()}
    for name, sd in (("position_m", position_m), ("pressure_a_pa", pressure_pa), ("pressure_b_pa", pressure_pa)):
        out[name] = run[meaning(name)[0]].to_numpy() + sd * noise.standard_normal(run.sizes["time"])
    return out


def test_starts_that_would_move_too_far_move_less():
    """The whole move of the gas in the tubes raises the misfit at the truth, half of it lowers it."""
    truth = pn.Drive.load(Path(__file__).parents[1] / "data" / "drive_with_tubes.toml")
    steps = "0 s: 0.369, 0.219 s: -0.285, 0.444 s: 0.594, 0.72 s: -0.437, 0.936 s: 0.44, 1.111 s: -0.126"
    run = pn.simulate(truth, f"{steps}, 1.431 s: 0.104, 1.776 s: -0.514", "2 s", initial="position = 100 mm")
    guess = truth.replace({"valve.conductance": "1.8 dm3/(s bar)", "friction.coulomb": "20 N"})
    fit = pn.identify(guess, noisy(run, 100, 5e-6, 500.0), ["valve.conductance", "friction.coulomb"])
    assert fit.intervals["friction.coulomb"] == pytest.approx((28.0, 28.0), abs=0.01)


def test_a_tube_and_the_drive_behind_it_are_found(recorded):
    truth, start = with_tubes(2.0), with_tubes(1.2, **{"valve.conductance": "1 dm3/(s bar)"})
    fit = pn.identify(start, recorded, free=["tubing.a.length", "valve.conductance"])
    known = {"tubing.a.length": 2.0, "valve.conductance": truth.valve.conductance_m3_s_pa}
    assert fit.converged
    assert fit.units["tubing.a.length"] == "m"
    for name, value in known.items():
        low, high = fit.intervals[name]
        assert low < value < high, (name, value, fit.intervals[name])
        assert high - low < 0.02 * value
    found = fit.apply()
    assert pn.units.parse(found.tubing["a"]["length"], "m") == pytest.approx(2.0, rel=0.01)
    assert "95 % interval" in found.with_origins()["tubing"]["a"]["length"]["note"]
    assert found.circuit.core_json() != start.circuit.core_json()


def test_what_a_line_has_no_derivative_by_is_refused(recorded):
    drive = with_tubes(2.0).replace({"tubing.a.kind": "tube/distributed", "tubing.a.cells": 2})
    with pytest.raises(FitError, match=r"tubing\.a\.cells cannot be free"):
        pn.identify(drive, recorded, free=["tubing.a.cells"])
    with pytest.raises(
        FitError, match=r"tubing\.a\.lengths is not a number of this drive\.\s+Hint: Did you mean 'tubing\.a\.length'"
    ):
        pn.identify(drive, recorded, free=["tubing.a.lengths"])


def test_a_model_with_another_tube_is_off_where_its_flows_are_and_closes_in_force(recorded):
    right, wrong = (pn.validate(with_tubes(length), recorded, window_s=0.1) for length in (2.0, 6.0))
    pressures = [found.pooled(["pressure_a_pa", "pressure_b_pa"]).nrmse for found in (right, wrong)]
    assert pressures[0] < 0.005
    assert pressures[1] > 0.1
    assert wrong.diagnosis().is_clean
    assert "tubes" in str(wrong)
