"""Gases by name."""

from __future__ import annotations

import pytest

import pneudrive as pn
from pneudrive.describe.parts import GASES
from pneudrive.errors import DescriptionError, PneudriveWarning

MOLAR_GAS_CONSTANT = 8.314462618  # J/(mol K)
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
    with pytest.raises(DescriptionError, match=r"gas\.heat_capacity_ratio = 1\.4 is not that of gas\.name"):
        flow({"name": "helium", "heat_capacity_ratio": 1.4})
    with pytest.raises(DescriptionError, match="name"):
        flow({"name": "heliun"})
    with pytest.warns(PneudriveWarning, match="carbon dioxide as an ideal gas"):
        flow({"name": "carbon-dioxide"})
