"""A component that the core lists is in schema, file, trajectory, drawing, session and tables without a line of Python.

Its table is one that the core writes, for a formula, under a name that nothing in Python knows. What runs is that
formula: the name is turned back where the core takes the circuit, as a core with this component would know it itself.
"""

import json

import jsonschema
import numpy as np
import pytest

import pneudrive as pn
from pneudrive import _core
from pneudrive.cli.main import run
from pneudrive.describe import circuit as circuits
from pneudrive.describe.components import component_class
from pneudrive.describe.files.schema import circuit_schema
from pneudrive.describe.kinds import component_kinds

KIND = "toy/gap"
FORMULA = {
    "name": "gap",
    "parameters": {"permeance": {"unit": "m3/(s Pa)", "above": 0, "meaning": "Permeance of the gap"}},
    "output": {"mass_flow": "opening*permeance*(p_up - p_down)*rho_0"},
}
FILE = """
connections = ["mains -> gap -> tank"]
initial = { tank = "2 bar abs" }
[components]
mains = { kind = "reservoir", pressure = "7 bar abs" }
tank = { kind = "tank", volume = "1 l" }
gap = { kind = "toy/gap", permeance = "1 dm3/(s bar)" }
"""


@pytest.fixture
def by_formula():
    parts = {"mains": {"kind": "reservoir", "pressure": "7 bar abs"}, "tank": {"kind": "tank", "volume": "1 l"}}
    gap = {"kind": "restriction/formula", "formula": FORMULA, "permeance": "1 dm3/(s bar)"}
    return pn.Circuit(
        components=parts | {"gap": gap}, connections=["mains -> gap -> tank"], initial={"tank": "2 bar abs"}
    )


@pytest.fixture
def listed(by_formula, monkeypatch):
    """Let the core list the toy, and run it."""
    written = next(one["formula"] for one in json.loads(by_formula.core_json())["components"] if one["name"] == "gap")
    entry = _core.formula_component("restriction/formula", json.dumps(written))
    del entry["warnings"]
    entry |= {"kind": KIND, "title": "Toy gap", "formula": None}
    core, components = _core.Circuit, _core.components()

    def known(text, names):
        form = json.loads(text)
        for one in form["components"]:
            if one["kind"] == KIND:
                one |= {"kind": "restriction/formula", "formula": written}
        return core(json.dumps(form), names)

    caches = (component_kinds, component_class, circuits.compiled)
    monkeypatch.setattr(_core, "components", lambda: [*components, entry])
    monkeypatch.setattr(_core, "Circuit", known)
    for cache in caches:
        cache.cache_clear()
    yield
    monkeypatch.undo()
    for cache in caches:
        cache.cache_clear()


def test_a_component_of_the_core_needs_no_line_of_python(listed, by_formula, tmp_path, capsys):
    tomllib = pytest.importorskip("tomllib")
    validator = jsonschema.Draft202012Validator(circuit_schema())
    assert validator.is_valid(tomllib.loads(FILE))
    for wrong in ("permeance = -1", "permeance = true", 'permeanc = "1 dm3/(s bar)"'):
        assert not validator.is_valid(tomllib.loads(FILE.replace('permeance = "1 dm3/(s bar)"', wrong)))

    circuit = pn.Circuit.load(FILE)
    assert circuit.components["gap"].permeance_m3_s_pa == pytest.approx(1e-8)
    assert pn.Circuit.load(circuit.to_toml()) == circuit
    with pytest.raises(pn.errors.DescriptionError, match=r"gap\.permeance.* is out of bounds"):
        pn.Circuit.load(FILE.replace('"1 dm3', '"-1 dm3'))

    run_of_it, wanted = (one.simulate({"gap": 1.0}, "1 s") for one in (circuit, by_formula))
    flow = run_of_it["gap.mass_flow"]
    assert flow.attrs["units"] == "kg/s"
    assert "mass flow from port 1 to port 2" in flow.attrs["long_name"]
    assert np.array_equal(flow, wanted["gap.mass_flow"])
    assert float(flow[0]) == pytest.approx(1e-8 * 5e5 * 1.185)
    assert {"gap.command", "gap.mass_flow_kg_s"} <= {one.name for one in circuit.start().variables}

    assert run(["components", KIND]) == 0
    card = capsys.readouterr().out
    assert all(word in card for word in ("Toy gap", "permeance", "dm3/(s bar)", "Permeance of the gap", "mass_flow"))
    picture = tmp_path / "picture.svg"
    (tmp_path / "circuit.toml").write_text(FILE)
    assert run(["draw", str(tmp_path / "circuit.toml"), "--out", str(picture)]) == 0
    assert "gap" in picture.read_text()
