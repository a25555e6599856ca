"""Gases by name, ideal or not."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.constants import MOLAR_GAS_CONSTANT_J_MOL_K as MOLAR_GAS_CONSTANT
from pneudrive.describe.tables.parts import GASES, VIRIAL
from pneudrive.errors import DescriptionError, PneudriveWarning

#: Molar mass, g/mol, and mass flow through an orifice over that of air.
KNOWN = {
    "nitrogen": (28.0134, 0.983),
    "argon": (39.948, 1.245),
    "helium": (4.002602, 0.394),
    "carbon-dioxide": (44.0095, 1.198),
}


def flow(gas: dict[str, object]) -> float:
    circuit = pn.Circuit(
        gas=gas,
        components={
            "tank": {"kind": "tank", "volume": "1 l"},
            "hole": {"kind": "orifice", "diameter": "1 mm"},
        },
        connections=["tank -> hole -> ambient"],
        initial={"tank": "7 bar abs"},
    )
    return float(circuit.simulate(None, "1 ms")["hole.mass_flow"][0])


@pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")
@pytest.mark.parametrize("name", KNOWN)
def test_a_gas_flows_as_its_numbers_say(name):
    mass, ratio = KNOWN[name]
    assert GASES[name][1] == pytest.approx(MOLAR_GAS_CONSTANT / mass * 1e3, rel=5e-5)
    # Reference air is humid, another gas is dry: 0.29 %.
    assert flow({"name": name}) / flow({}) == pytest.approx(1.0029 * ratio, rel=1e-3)
    circuit = pn.Circuit(gas={"name": name}, components={"t": {"kind": "tank", "volume": "1 l"}}, plugged=["t.1"])
    assert pn.Circuit.load(circuit.to_toml()).gas == circuit.gas


def test_air_by_name_is_the_air_that_is_there_without():
    assert flow({"name": "air"}) == flow({})


def test_what_is_wrong_with_a_gas_is_told():
    with pytest.raises(DescriptionError, match=r"gas\.heat_capacity_ratio = 1\.4 differs from .* of gas\.name"):
        flow({"name": "helium", "heat_capacity_ratio": 1.4})
    with pytest.raises(DescriptionError, match="name"):
        flow({"name": "heliun"})
    with pytest.warns(PneudriveWarning, match="carbon dioxide as an ideal gas"):
        flow({"name": "carbon-dioxide"})


@pytest.mark.parametrize(
    ("name", "temperature", "second"),  # of another table: Atkins, de Paula, Keeler, Physical Chemistry, table 1C.1
    [
        ("nitrogen", 273.15, -10.5),
        ("nitrogen", 373.15, 6.2),
        ("argon", 273.15, -21.7),
        ("argon", 373.15, -4.2),
        ("carbon-dioxide", 373.15, -72.2),
        ("carbon-dioxide", 600.0, -12.4),
    ],
)
def test_virial_coefficients_are_those_of_another_table(name, temperature, second):
    a, b, c = VIRIAL[name]
    assert a - b * math.exp(c / temperature) == pytest.approx(second, abs=1.2)


def throttled(gas: dict[str, object], **more: object) -> object:
    parts = {"conductance": "0.1 dm3/(s bar)", "critical_pressure_ratio": 0.3}
    circuit = pn.Circuit(
        gas=gas,
        components={
            "mains": {"kind": "reservoir", "pressure": "10 bar abs"},
            "in": {"kind": "fitting"} | parts,
            "tank": {"kind": "tank", "volume": "10 cm3", "heat_transfer": "0 W/(m2 K)"},
            "out": {"kind": "fitting"} | parts,
        },
        connections=["mains -> in -> tank -> out -> ambient"],
        **more,
    )
    return circuit.simulate(None, "5 s", ledger=True)


@pytest.mark.parametrize("name", VIRIAL)
def test_a_gas_that_is_not_ideal_cools_in_a_throttle(name, recwarn):
    run = throttled({"name": name, "model": "virial"})
    p, t = (float(run[f"tank.{column}"][-1]) for column in ("pressure", "temperature"))
    a, b, c = VIRIAL[name]
    ratio, _ = GASES[name]
    cp = ratio * MOLAR_GAS_CONSTANT / (ratio - 1.0)  # J/(mol K)
    grown = b * math.exp(c / 293.15)
    coefficient = 1e-6 * (c / 293.15 * grown - (a - grown)) / cp
    assert 293.15 - t == pytest.approx((1e6 - p) * coefficient, rel=0.12)  # it grows as the gas cools
    assert abs(run.attrs["ledger"]["energy_error"]) < 1e-6
    assert "libretexts-virial" in run.attrs["citations"]
    assert not [one for one in recwarn if "ideal gas" in str(one.message)]


def test_a_drive_runs_on_a_gas_that_is_not_ideal():
    ideal, real = (
        pn.Drive.load("catalogue:reference").replace({"gas": {"name": "nitrogen", "model": model}})
        for model in ("ideal", "virial")
    )
    assert pn.Drive.load("catalogue:reference").replace(real.to_dict()).gas == real.gas
    assert ideal.core_json() != real.core_json()
    one, other = (pn.simulate(drive, "0 s: 0.5, 0.2 s: -0.5", "0.4 s") for drive in (ideal, real))
    apart = np.abs(one.position - other.position).max()
    assert 1e-6 < apart < 2e-3  # nitrogen is off by 0.2 % at 7 bar


def test_where_a_virial_coefficient_does_not_do_is_told():
    with pytest.raises(DescriptionError, match=r'gas\.model = "virial" has no coefficient for helium'):
        throttled({"name": "helium", "model": "virial"})
    drive = pn.Drive.load("catalogue:reference")
    printed = drive.replace({"gas": {"name": "argon", "model": "virial"}, "cylinder.chamber_law": "as-printed"})
    with pytest.raises(DescriptionError, match="needs an ideal gas"):
        pn.simulate(printed, 1, "0.1 s")
    dense = drive.replace({"gas": {"name": "carbon-dioxide", "model": "virial"}, "supply.pressure": "25 bar abs"})
    assert any("third virial coefficient" in one for one in pn.simulate(dense, 0, "1 ms").attrs["warnings"])
