"""What other tools make of exported parameters is our curve, by their own published formulas, written here again."""

from __future__ import annotations

import csv
import math
import re

import numpy as np
import pytest

from pneudrive.describe import Drive, FrictionLaw
from pneudrive.errors import FitError
from pneudrive.identify import FrictionFit, fit_friction
from pneudrive.identify.export import SlidingCurve, curve_of_drive, export

SPEED = np.geomspace(1e-3, 0.45, 20)


def simscape(v: float, p: dict[str, float]) -> float:
    """Evaluate Translational Friction of Simscape [mathworks-friction]."""
    v_st, v_c = p["brkwy_vel"] * math.sqrt(2.0), p["brkwy_vel"] / 10.0
    stribeck = math.sqrt(2.0 * math.e) * (p["brkwy_frc"] - p["Col_frc"]) * math.exp(-((v / v_st) ** 2)) * v / v_st
    return stribeck + p["Col_frc"] * math.tanh(v / v_c) + p["visc_coef"] * v


def modelica(v: float, p: dict[str, float]) -> float:
    """Evaluate MassWithStopAndFriction of the Modelica Standard Library [modelica-mass-with-stop-and-friction]."""
    return p["F_Coulomb"] + p["F_prop"] * v + p["F_Stribeck"] * math.exp(-p["fexp"] * v)


FORMULAS = {"simscape": simscape, "modelica": modelica}


@pytest.fixture
def fit(make_map, friction_of):
    noise = 0.05 * np.random.default_rng(31).standard_normal(20)
    return fit_friction(make_map(SPEED, friction_of(SPEED) + noise, 0.05))


def _numbers(text: str) -> dict[str, float]:
    return {name: float(value) for name, value in re.findall(r"(\w+) ?= ?([-+0-9.e]+)", text)}


@pytest.mark.parametrize("tool", FORMULAS)
def test_the_other_tool_gives_our_curve_within_what_is_stated(fit, tool, tmp_path):
    done = fit.export(tool, tmp_path / "friction.txt")
    text = (tmp_path / "friction.txt").read_text()
    given = _numbers(text)
    speeds = done.curve.speed_m_s
    ours = fit.predict(speeds, 0.0, 0.0).friction_n
    theirs = np.array([FORMULAS[tool](v, given) for v in speeds])
    assert np.abs(theirs - ours).max() == pytest.approx(done.worst_n, rel=1e-6)
    assert (speeds[0], speeds[-1]) == pytest.approx((SPEED[0], SPEED[-1]))
    assert f"{done.worst_n:.3g} N" in text
    assert "presliding" in text
    assert done.worst_percent < {"simscape": 25.0, "modelica": 8.0}[tool]


def test_no_other_parameters_are_closer(fit):
    for tool, formula in FORMULAS.items():
        done = fit.export(tool)
        best = dict(done.parameters)
        speeds, ours = done.curve.speed_m_s, done.curve.friction_n

        def away(p, formula=formula, speeds=speeds, ours=ours):
            return sum((formula(v, p) - f) ** 2 for v, f in zip(speeds, ours, strict=True))

        for name in best:
            for factor in (0.98, 1.02):
                assert away({**best, name: factor * best[name]}) >= away(best) * (1.0 - 1e-9)


def test_an_exponential_curve_goes_over_to_modelica_exactly(make_map):
    friction = 30.0 + 15.0 * np.exp(-SPEED / 0.02) + 40.0 * SPEED
    done = fit_friction(make_map(SPEED, friction, 0.01), "stribeck exponential").export("modelica")
    assert done.worst_n < 1e-6
    values = {"F_Coulomb": 30.0, "F_Stribeck": 15.0, "fexp": 50.0, "F_prop": 40.0}
    for name, value in values.items():
        assert done.parameters[name] == pytest.approx(value, rel=1e-4)


def test_a_curve_of_simscape_goes_over_exactly(make_map):
    p = {"brkwy_frc": 50.0, "brkwy_vel": 0.01, "Col_frc": 30.0, "visc_coef": 40.0}

    speed = np.geomspace(1e-3, 0.45, 300)
    friction = np.array([simscape(v, p) for v in speed])
    done = export(SlidingCurve("as it is", "stribeck", "", speed, friction, 0.0, 0.0, (), ()), "simscape")
    assert done.worst_n < 1e-6
    for name, value in p.items():
        assert done.parameters[name] == pytest.approx(value, rel=1e-5)


def test_the_table_for_modelica_is_our_curve(fit):
    text = fit.export("modelica").text
    rows = re.search(r"f_pos=\[(.*?)\]", text, re.DOTALL)[1].split(";")
    speed, force = np.array([[float(x) for x in row.split(",")] for row in rows]).T
    assert speed[0] == 0.0
    ours = fit.predict(SPEED).friction_n
    assert np.abs(np.interp(SPEED, speed, force) - ours).max() < 0.01 * ours.max()


def test_the_table_of_values_has_intervals_sources_and_notes(fit, tmp_path):
    fit.to_toml(tmp_path / "fit.toml")
    FrictionFit.from_toml(tmp_path / "fit.toml").export("csv", tmp_path / "friction.csv")
    lines = [line for line in (tmp_path / "friction.csv").read_text().splitlines() if not line.startswith("#")]
    rows = {row["name"]: row for row in csv.DictReader(lines)}
    assert list(rows["coulomb"]) == ["name", "value", "unit", "low", "high", "source", "note"]
    assert float(rows["coulomb"]["low"]) < fit.parameters["coulomb"] < float(rows["coulomb"]["high"])
    assert float(rows["stribeck_velocity"]["value"]) == fit.parameters["stribeck_velocity"]
    assert rows["coulomb"]["source"]
    assert rows["stribeck_exponent"]["note"] == "fixed"


def test_what_is_lost_is_said(make_map, friction_of):
    slopes = {"coulomb_a": 5e-6, "coulomb_b": 8e-6, "breakaway_a": 1.5e-5, "breakaway_b": 2.0e-5}
    gauges = np.array([(a, b) for a in (0.0, 2e5) for b in (0.0, 2e5)])
    speed = np.tile(SPEED, 4)
    a, b = np.repeat(gauges, 20, axis=0).T
    friction = friction_of(speed) + (slopes["coulomb_a"] * a + slopes["coulomb_b"] * b)
    fit = fit_friction(make_map(speed, friction, 0.1, gauge_a=a, gauge_b=b), pressure_dependence=True)
    low, high = (fit.export("modelica", gauge_a_pa=g, gauge_b_pa=0.0) for g in (0.0, 2e5))
    assert high.parameters["F_Coulomb"] - low.parameters["F_Coulomb"] == pytest.approx(1.0, abs=0.1)  # 5e-6 N/Pa, 2 bar
    assert "2 bar gauge in a" in high.text


def test_wrong_wishes_are_refused(fit, tmp_path):
    with pytest.raises(FitError, match="the export to 'simscap' is not available"):
        fit.export("simscap")
    with pytest.raises(FitError, match="0 < lowest < highest"):
        fit.export("csv", speeds_m_s=(0.1, 0.1))

    with pytest.raises(FitError, match="has no range of measured speeds"):
        curve_of_drive(Drive.load("catalogue:reference"), None)


LAWS = {
    "harmonics": {"position": {"slope": "20 %/m", "harmonics": [{"period": "50 mm", "amplitude": 0.1}]}},
    "table": {"position": {"table": [{"position": "0 mm", "factor": 1.0}, {"position": "300 mm", "factor": 1.5}]}},
    "dwell": {"dwell": {"growth": "log", "increment": "0.6 N", "time": "0.5 s", "distance": "0.03 mm"}},
    "wear": {"wear": {"run_in": 0.2, "slid": "10 m"}},
    "elements": {
        "law": "gms", "attraction": "2000 N/s",
        "elements": [{"stiffness": "8e4 N/m", "share": 0.3}, {"stiffness": "3e4 N/m", "share": 0.7}],
    },
}  # fmt: skip
SLIDING = {"coulomb": "19 N", "breakaway": "31 N", "stribeck_velocity": "9 mm/s", "viscous": "33 N s/m"}


def drive_with(more):
    return Drive.load("catalogue:reference").replace({"friction": {"law": "stribeck", **SLIDING, **more}})


@pytest.mark.parametrize("part", LAWS)
def test_the_table_of_a_drive_gives_its_friction_back(part):
    """Each part of the law is a row: from the rows alone follows the same law."""
    from pneudrive.describe.files import toml
    from pneudrive.describe.tables.friction import Friction

    drive = drive_with(LAWS[part])
    lines = export(curve_of_drive(drive, (1e-3, 1.0)), "csv").text.splitlines()
    assert not [line for line in lines if "lost" in line]
    tables: dict = {}
    for row in csv.DictReader(line for line in lines if not line.startswith("#")):
        is_number = row["unit"] not in ("", "1")
        value = f"{row['value']} {row['unit']}" if is_number else float(row["value"]) if row["unit"] else row["value"]
        toml.put(tables, row["name"], value)
    for table in (tables, *(one for one in tables.values() if isinstance(one, dict))):
        for key, inner in table.items():
            if isinstance(inner, dict) and "0" in inner:
                table[key] = list(inner.values())
    assert Friction(**tables).core() == drive.friction.core()


@pytest.mark.parametrize(
    ("part", "tool", "said"),
    [
        ("harmonics", "modelica", "lost: variation along the stroke: the curve is for position = 0 mm"),
        ("table", "st", "lost: variation along the stroke: the curve is for position = 0 mm"),
        ("wear", "modelica", "lost: change with the distance slid: the curve is for a sliding distance of 10 m"),
        ("elements", "simscape", "lost: the individual springs of the bristles"),
    ],
)
def test_a_curve_says_which_part_is_lost_and_where_it_is_taken(part, tool, said):

    done = export(curve_of_drive(drive_with(LAWS[part]), (1e-3, 1.0)), tool)
    assert said in done.text
    assert said in done.remarks()


def test_a_law_of_formulas_leaves_them_out_of_the_table_and_says_so():

    law = FrictionLaw(
        name="smooth",
        parameters={"coulomb": {"unit": "N", "above": 0}, "v0": {"unit": "m/s", "above": 0}},
        force="coulomb*tanh(v/v0)",
    )
    drive = Drive.load("catalogue:reference").replace({"friction": {"law": law, "coulomb": "20 N", "v0": "1 mm/s"}})
    assert "# lost: the formulas of law smooth\n" in export(curve_of_drive(drive, (1e-2, 1.0)), "csv").text


@pytest.mark.parametrize("tool", ["csv", "modelica"])
def test_what_was_measured_beside_sliding_is_not_lost_without_a_word(fit, tool):
    from dataclasses import replace

    from pneudrive.identify.identified import Dependences

    tables = {"direction": {"positive": 1.1}, "position": {"slope": "5 %/m"}}
    told = replace(fit, dependences=Dependences(friction=tables)).export(tool).text
    assert "lost: difference between the directions" in told
    assert "lost: variation along the stroke" in told
