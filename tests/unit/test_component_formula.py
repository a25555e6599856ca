"""Components with a formula of the user's: from files and from Python, with one message for what is wrong."""

from __future__ import annotations

import copy
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.describe.files.load import circuit_schema
from pneudrive.errors import DescriptionError

FORMULAS = Path(__file__).parents[2] / "examples" / "formulas"
FILLING = """
connections = ["mains -> path -> tank"]
initial = { tank = "2 bar abs" }
[components]
mains = { kind = "reservoir", pressure = "7 bar abs" }
tank = { kind = "tank", volume = "1 l" }

[components.path]
"""
OWN = (
    FILLING
    + """
kind = "restriction/formula"
formula = "file:formulas/iso6358.toml"
conductance = "1 dm3/(s bar)"
critical_pressure_ratio = 0.3
"""
)
FITTING = FILLING + 'kind = "fitting"\nconductance = "1 dm3/(s bar)"\ncritical_pressure_ratio = 0.3\n'


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(FORMULAS, tmp_path / "formulas")
    return tmp_path


def load(folder, text=OWN):
    path = folder / "circuit.toml"
    path.write_text(text)
    return pn.Circuit.load(path)


def test_iso_6358_from_a_file_is_a_fitting(folder):
    runs = [load(folder, text).simulate(None, "1 s", rtol=1e-10) for text in (OWN, FITTING)]
    for name in runs[1].data_vars:
        size = float(np.abs(runs[1][name]).max())
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=0.0, atol=1e-9 * size, err_msg=str(name))
    assert "iso6358-2013" in pn.citations(runs[0])


def test_written_and_read_back_without_the_file(folder):
    circuit = load(folder)
    text = circuit.to_toml()
    shutil.rmtree(folder / "formulas")
    again = pn.Circuit.load(text)
    assert again == circuit
    assert again.core_json() == circuit.core_json()
    assert pickle.loads(pickle.dumps(circuit)) == copy.deepcopy(circuit) == circuit
    wider = circuit.replace({"components.path.conductance": "2 dm3/(s bar)"})
    assert wider.components["path"].conductance_m3_s_pa == 2e-8
    assert wider.description_hash != circuit.description_hash
    assert pn.export_fmu(wider, folder / "own.fmu").path.is_file()


def test_what_is_wrong_is_told_with_its_place(folder):
    wrong = [
        ('"max(min(r, linear_above)', '"max(min(q, linear_above)', "the name 'q' is unknown"),
        ("sqrt(t_0/t_up)*phi", "(t_0/t_up)*p_up*phi", "kg/s is needed"),
        ('above = 0, meaning = "Sonic', 'over = 0, meaning = "Sonic', "over is not a known key"),
        ("mass_flow =", "massflow =", "output.massflow is not a known key"),
        ("[let]", "[lett]", "lett is not a known key"),
    ]
    file = folder / "formulas" / "iso6358.toml"
    good = file.read_text()
    for old, new, what in wrong:
        assert old in good
        file.write_text(good.replace(old, new))
        with pytest.raises(DescriptionError, match=what) as caught:
            load(folder)
        assert "iso6358.toml:" in str(caught.value)
    file.write_text(good)
    for old, new, what in [
        ('conductance = "1 dm3/(s bar)"', 'conductance = "1 bar"', r"path\.conductance"),
        ("file:formulas/iso6358.toml", "file:formulas/iso.toml", "names a file that does not exist"),
        ("file:formulas/iso6358.toml", "iso", "is not a formula of a restriction/formula"),
        ("file:formulas/iso6358.toml", "file:formulas/hydraulic_brake.toml", "needs mass_flow, in kg/s"),
        ('formula = "file:formulas/iso6358.toml"\n', "", r"path\.formula is missing"),
    ]:
        with pytest.raises(DescriptionError, match=what) as caught:
            load(folder, OWN.replace(old, new))
        assert "toml:" in str(caught.value)


def test_a_force_from_python_brakes_a_slide():
    """F = c v^2 takes the speed to v0/(1 + c v0 t/m); its command takes the force away."""
    formula = {
        "name": "drag",
        "parameters": {"coefficient": {"unit": "kg/m", "above": 0}},
        "output": {"force": "-coefficient*v*abs(v) + command*coefficient*v*v"},
    }
    circuit = pn.Circuit(
        components={
            "slide": {"kind": "slide", "mass": "2 kg"},
            "drag": {"kind": "force/formula", "formula": formula, "coefficient": "3 kg/m"},
        },
        connections=["slide -> drag"],
        initial={"slide": {"position": "0 mm", "velocity": "4 m/s"}},
    )
    free = circuit.simulate({"drag": 1.0}, "1 s")
    assert float(free["slide.velocity"][-1]) == pytest.approx(4.0)
    braked = circuit.simulate(None, "1 s", rtol=1e-9)
    assert float(braked["slide.velocity"][-1]) == pytest.approx(4.0 / 7.0, rel=1e-6)
    assert "drag.force" in braked


def test_it_is_listed_and_described(folder, printed):
    jsonschema, tomllib = map(pytest.importorskip, ("jsonschema", "tomllib"))
    jsonschema.Draft202012Validator(circuit_schema()).validate(tomllib.loads(OWN))
    out = printed(["components", "restriction/formula"])
    assert "p_up" in out
    assert "file:NAME.toml" in out
    assert "path" in repr(load(folder))


# --- Components that take points: how they are written, read back and refused.

TABLES = (Path(__file__).parents[1] / "data" / "component_formula_tables.toml").read_text("utf-8")


def test_points_are_written_with_units_and_read_back():
    circuit = pn.Circuit.load(TABLES)
    assert circuit.components["press"].points == ((0.0, 10.0), (0.1, 30.0))
    assert circuit.components["flap"].moment_of_inertia_kg_m2 == pytest.approx(0.02)
    again = pn.Circuit.load(circuit.to_toml())
    assert again.core_json() == circuit.core_json()
    # M v^2/2 = 10 N x + 1000 N/m x^2, where the lever adds J h^2/(h^2 + x^2)^2 to the mass.
    run = circuit.simulate(None, "0.1 s", rtol=1e-9)
    x, v = float(run["mass.position"][-1]), float(run["mass.velocity"][-1])
    mass = 2.0 + 0.02 * 0.01 / (0.01 + x * x) ** 2
    assert x > 0.01
    assert 0.5 * mass * v * v == pytest.approx(10.0 * x + 100.0 * x * x, rel=1e-6)


def test_a_lock_starts_as_its_first_command_has_it():
    circuit = pn.Circuit.load(TABLES)
    held = circuit.simulate({"lock": 1}, "0.1 s")
    assert float(held["mass.position"][-1]) == pytest.approx(10.0 / 1e7, rel=1e-3)
    assert float(held["lock.position"][0]) == 1.0


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ('[{ position = "0 mm", force = "10 N" }]', "press.points: the number of points is 1"),
        ('[{ position = "9 mm", force = "1 N" }, { position = "8 mm", force = "1 N" }]', "8 mm follows 9 mm"),
        ('[{ position = "9 mm" }, { position = "8 mm", force = "1 N" }]', "point 1"),
        ('[{ position = "0 mm", force = 3 }, { position = "8 mm", force = "1 N" }]', "force of point 1: 3 has no unit"),
        ("3", "is not a list of points"),
    ],
)
def test_wrong_points_are_told(points, said):
    text = TABLES.replace('[{ position = "0 mm", force = "10 N" }, { position = "0.1 m", force = "30 N" }]', points)
    with pytest.raises(DescriptionError, match=said):
        pn.Circuit.load(text)
