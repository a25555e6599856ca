"""A run that leaves the range of the model warns with time, place and limit; a run inside it does not."""

import pytest

import pneudrive as pn
from pneudrive.cli.main import run
from pneudrive.simulation.exhaust import ExhaustAir

REFERENCE = pn.Drive.load("catalogue:reference")
START = {"position": "50 mm", "pressure_a": "7 bar abs", "pressure_b": "7 bar abs"}


def limits(described, command, duration, **more):
    found = pn.simulate(described, command, duration, **more).attrs["warnings"]
    return [line for line in found if "stated for" in line or "far from its law" in line or "leaves its stroke" in line]


def test_a_slow_run_has_no_warning():
    assert limits(REFERENCE, 0.02, "0.2 s", initial=START) == []


def test_cold_exhaust_air_is_a_value_and_one_note_after_ten_strokes():
    """Ice forms in the silencer of a drive that works on; the pressure dew point of the supply decides."""
    strokes = ", ".join(f"{0.4 * i} s: {1 - 2 * (i % 2)}" for i in range(14))
    few, many = (pn.simulate(REFERENCE, strokes, duration, initial=START) for duration in ("0.8 s", "5.6 s"))
    assert few.pneu.exhaust_air(REFERENCE).exhausts == 2
    air = many.pneu.exhaust_air(REFERENCE)
    assert air.exhausts >= 10
    assert 233.15 < air.mean_k < 273.15
    assert 168.0 < air.coldest_k < air.mean_k  # without heat: 293 K (1/7)^(0.4/1.4) = 168 K
    assert not any("exhaust air" in line for line in few.attrs["warnings"])
    (line,) = (line for line in many.attrs["warnings"] if "exhaust air" in line)
    # Frost at -20 degC and 1 bar is a dew point of 2 degC at 7 bar.
    assert ExhaustAir(253.15, 200.0, 10).frost_k(1e5, 7e5) - 273.15 == pytest.approx(2.0, abs=0.6)
    assert f"{air.frost_k(1.013e5, 7e5) - 273.15:.0f} degC" in line
    dry = REFERENCE.replace({"gas.dew_point": "-20 degC"})
    assert not any(
        "exhaust air" in line for line in pn.simulate(dry, strokes, "5.6 s", initial=START).attrs["warnings"]
    )


def test_hot_gas_has_another_heat_capacity():
    """The heat capacity of air is 2 % above the constant at 200 degC; argon has a constant one."""
    hot = {"supply.temperature": "320 degC"}
    for gas, expected in (("air", 1), ("argon", 0)):
        drive = pn.Drive.model_validate(REFERENCE.to_dict() | {"gas": {"name": gas}}).replace(hot)
        found = pn.simulate(drive, 1.0, "0.3 s", initial=START).attrs["warnings"]
        assert sum("heat capacity is" in line and "higher than the model's" in line for line in found) == expected


def test_pressure_above_20_bar():
    high = REFERENCE.replace({"supply.pressure": "30 bar abs"})
    found = limits(high, 0.5, "1 s", initial=START)
    assert sum("chamber a reaches 30 bar abs at" in line and "up to 20 bar abs" in line for line in found) == 1


@pytest.mark.parametrize(
    ("model", "supply", "expected"),
    [("ideal", "19 bar abs", 1), ("ideal", "4 bar abs", 0), ("virial", "14 bar abs", 0), ("virial", "30 bar abs", 1)],
)
def test_carbon_dioxide_far_from_its_law(model, supply, expected):
    """B = -123 cm3/mol at 20 degC: 5 % of the pressure at 10 bar, 10 % at 20 bar."""
    tables = REFERENCE.to_dict() | {"gas": {"name": "carbon-dioxide", "model": model}, "supply": {"pressure": supply}}
    found = limits(pn.Drive.model_validate(tables), 0.3, "1 s")
    assert sum("far from its law" in line for line in found) == expected


def test_a_piston_that_leaves_its_stroke():
    body = {"area_a": "1 cm2", "area_b": "1 cm2", "moving_mass": "1 kg"}
    for stroke, start, expected in (("20 m", "10 m", 0), ("11 m", "10 m", 1)):
        circuit = pn.Circuit(
            components={
                "body": {"kind": "piston", **body, "stroke": stroke, "friction": {"law": "coulomb", "coulomb": "10 N"}},
                "spring": {"kind": "spring", "stiffness": "1 N/m", "rest_position": "10 m"},
            },
            connections=["ambient -> body.a", "ambient -> body.b", "body.rod -> spring"],
            initial={"body": {"position": start, "velocity": "5 m/s"}},
        )
        found = limits(circuit, {}, "1 s")
        assert sum("body leaves its stroke" in line and "0 to 11000 mm" in line for line in found) == expected


def test_a_mass_that_is_as_good_as_zero():
    light = REFERENCE.replace({"cylinder.moving_mass": "1e-6 kg"})
    found = limits(light, 0.02, "0.05 s", initial=START)
    assert sum("cylinder.moving_mass" in line and "as good as zero" in line for line in found) == 1
    loaded = light.replace({"load.mass": "1 kg"})
    assert not any("as good as zero" in line for line in limits(loaded, 0.02, "0.05 s", initial=START))


def test_the_terminal_says_it_without_arrays(tmp_path, capsys):
    out = tmp_path / "run.parquet"
    assert (
        run(
            [
                "simulate",
                "catalogue:reference",
                "--command",
                "0 s: 1, 0.3 s: -1",
                "--duration",
                "0.8 s",
                "--out",
                str(out),
            ]
        )
        == 0
    )
    assert "impacts on the end stops" in capsys.readouterr().err
