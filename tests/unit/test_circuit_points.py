"""Components that take points: how they are written, read back and refused."""

from __future__ import annotations

import pytest

import pneudrive as pn
from pneudrive.describe.files.schema import circuit_schema
from pneudrive.errors import DescriptionError

TABLES = """
connections = ["mass.1 -> press", "mass.1 -> flap", "mass.1 -> lock"]

[components.mass]
kind = "slide"
mass = "2 kg"

[components.press]
kind = "force/position"
points = [{ position = "0 mm", force = "10 N" }, { position = "0.1 m", force = "30 N" }]

[components.flap]
kind = "inertia/lever"
moment_of_inertia = "200 kg cm2"
distance = "100 mm"
centre = "0 mm"

[components.lock]
kind = "rod-lock"
holding_force = "800 N"
"""


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
        ('[{ position = "0 mm", force = "10 N" }]', "press.points: 1 points"),
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


def test_the_schema_knows_points():
    alternatives = circuit_schema()["properties"]["components"]["additionalProperties"]["oneOf"]
    (one,) = [form for form in alternatives if form["properties"].get("kind", {}).get("const") == "force/position"]
    assert one["properties"]["points"]["items"]["required"] == ["position", "force"]
    assert "points" in one["required"]
