"""Forces, flows and air as makers print them, against simulated test stands; each line has its source and its page.

A tolerance is half of the last printed digit, or the rounding that the source states in its own intermediate results.
Published stroke times with all values of their drive were not found, so that none is in this list.
"""

from __future__ import annotations

import pytest

import pneudrive as pn
from pneudrive.constants import AIR_GAS_CONSTANT_J_KG_K, ANR_DENSITY_KG_M3, ANR_TEMPERATURE_K
from pneudrive.datasheet.stands import FIGURES

#: Parker, OSP-P catalogue 0980, page 20 [parker-osp-p-0980]: bore in mm, theoretical force at 6 bar in N. The force of
#: bore 16 is cut, not rounded (120.6 N), so that a whole newton is the tolerance.
FORCES = {10: 47, 16: 120, 25: 295, 32: 483, 40: 754, 50: 1178, 63: 1870, 80: 3016}
#: SMC, SY series, CAT.EUS11-83B [smc-eus11-83]: drive of the catalogue with the valve, flow at 6 to 5 bar in l/min ANR.
FLOWS = {"smc-cm2y-25-sy3000": 276, "parker-osp-p25-sy5000": 746, "parker-osp-p40-sy7000": 1130}
LITRES_PER_CUBIC_FOOT = 28.316847


@pytest.mark.parametrize(("bore", "force"), FORCES.items())
def test_forces_of_parker(bore: int, force: int):
    drive = pn.Drive.load("catalogue:parker-osp-p25-sy5000").replace({"cylinder.bore": f"{bore} mm"})
    assert FIGURES["theoretical_force_6bar"][2](drive) == pytest.approx(force, abs=1.0)


@pytest.mark.parametrize(("name", "flow"), FLOWS.items())
def test_flows_of_smc(name: str, flow: int):
    found = FIGURES["nominal_flow"][2](pn.Drive.load(f"catalogue:{name}"))
    assert 6e4 * found == pytest.approx(flow, abs=1.0)


#: Mass of air that the reference atmosphere of a litre (65 % humidity) has less than dry air of its temperature.
HUMID = ANR_DENSITY_KG_M3 * AIR_GAS_CONSTANT_J_KG_K * ANR_TEMPERATURE_K / 1e5
SMALL = {"cylinder.dead_volume": {"a": "0.05 cm3", "b": "0.05 cm3"}}


def test_air_of_pneumax():
    """CATGEN-EN, page A|8 [pneumax-1077]: bore 63, rod 20, stroke 50 mm, 6 bar: 2.072 Nl, without dead volumes."""
    sizes = {"cylinder.bore": "63 mm", "cylinder.rod_diameter": "20 mm", "cylinder.stroke": "50 mm"}
    around = {"ambient": {"pressure": "1 bar abs", "temperature": "20 degC"}, "supply": {"pressure": "7 bar abs"}}
    drive = pn.Drive.load("catalogue:smc-cm2y-25-sy3000").replace(SMALL | sizes | around)
    air = float(pn.drive_characteristic(drive, "air").full)
    assert air * HUMID == pytest.approx(2.072, rel=1e-3)


def test_air_of_mead():
    """FAQ on cylinders, "How do I calculate the air consumption" [mead-faq]: 2.81 SCFM, without the volume of the rod.

    Bore 2 in, stroke 4 in, 30 cycles a minute, 80 psi; the standard state is that of the surroundings, 14.7 psi.
    """
    psi, kelvin = 6894.757, 294.26
    around = {
        "ambient": {"pressure": f"{14.7 * psi} Pa abs", "temperature": f"{kelvin} K"},
        "supply": {"pressure": f"{94.7 * psi} Pa abs"},
    }
    sizes = {"cylinder.bore": "50.8 mm", "cylinder.stroke": "101.6 mm"}
    drive = pn.Drive.load("catalogue:parker-osp-p25-sy5000").replace(SMALL | sizes | around)
    litres = float(pn.drive_characteristic(drive, "air").full) * HUMID
    standard = litres * 1e5 / (14.7 * psi) * kelvin / ANR_TEMPERATURE_K
    assert 30.0 * standard / LITRES_PER_CUBIC_FOOT == pytest.approx(2.81, abs=5e-3)
