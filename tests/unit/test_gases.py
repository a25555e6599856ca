"""Gases by name, ideal or not."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.constants import MOLAR_GAS_CONSTANT_J_MOL_K as MOLAR_GAS_CONSTANT
from pneudrive.describe.tables.parts import GASES, VIRIAL
from pneudrive.errors import DescriptionError, PneudriveWarning
from pneudrive.simulation.run_limits import dew_point, saturation_pressure, water_share

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
    with pytest.raises(DescriptionError, match=r"gas\.heat_capacity_ratio = 1\.4 differs from .* for gas\.name"):
        flow({"name": "helium", "heat_capacity_ratio": 1.4})
    with pytest.raises(DescriptionError, match="name"):
        flow({"name": "heliun"})
    with pytest.warns(PneudriveWarning, match="pressure of carbon dioxide"):
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
    with pytest.raises(DescriptionError, match=r'gas\.model = "virial" has no coefficients for helium'):
        throttled({"name": "helium", "model": "virial"})
    drive = pn.Drive.load("catalogue:reference")
    printed = drive.replace({"gas": {"name": "argon", "model": "virial"}, "cylinder.chamber_law": "as-printed"})
    with pytest.raises(DescriptionError, match="needs an ideal gas"):
        pn.simulate(printed, 1, "0.1 s")
    dense = drive.replace({"gas": {"name": "carbon-dioxide", "model": "virial"}, "supply.pressure": "25 bar abs"})
    assert any("third virial coefficient" in one for one in pn.simulate(dense, 0, "1 ms").attrs["warnings"])


# --- What a run tells of the water that its gas brings along.

COMMAND = "0 s: 1, 0.25 s: -1"


def drive(changes: dict[str, object]) -> pn.Drive:
    return pn.Drive.load("catalogue:reference").replace(changes)


def warned(described: pn.Drive | pn.Circuit, command: object = COMMAND, duration: str = "0.5 s") -> list[str]:
    said = pn.simulate(described, command, duration).attrs["warnings"]
    return [one for one in said if " may " in one]


@pytest.mark.parametrize(
    ("range_k", "coefficients"),
    [
        (np.linspace(273.15, 333.15, 61), (-6096.9385, 21.2409642, -2.711193e-2, 1.673952e-5, 2.433502)),
        (np.linspace(208.15, 273.0, 61), (-6024.5282, 29.32707, 1.0613868e-2, -1.3198825e-5, -0.49382577)),
    ],
)
def test_the_vapour_pressure_is_that_of_water_and_of_ice(range_k, coefficients):
    a, b, c, d, e = coefficients  # Sonntag 1994: ln e_s = a/T + b + c T + d T^2 + e ln T
    other = np.exp(a / range_k + b + c * range_k + d * range_k**2 + e * np.log(range_k))
    assert saturation_pressure(range_k) == pytest.approx(other, rel=5e-3)
    assert [dew_point(float(p)) for p in saturation_pressure(range_k)] == pytest.approx(range_k, abs=1e-9)


def test_the_share_of_water_follows_from_the_dew_point_under_pressure():
    # 757.9 Pa at 3 degC, in 8 bar abs at the dryer, or in the 7 bar abs of the supply.
    assert water_share(drive({"gas.dew_point": "3 degC", "gas.dew_point_pressure": "8 bar abs"})) == pytest.approx(
        757.9 / 8e5, rel=1e-3
    )
    own = drive({"gas.dew_point": "3 degC"})
    assert water_share(own) == pytest.approx(757.9 / own.supply_pressure_pa, rel=1e-3)
    assert water_share(own.circuit) == water_share(own)
    assert water_share(drive({})) is None
    assert pn.Drive.load("catalogue:reference").replace(own.to_dict()).gas == own.gas


def test_a_dew_point_moves_nothing_and_is_no_other_drive():
    dry, humid = drive({}), drive({"gas.dew_point": "3 degC"})
    assert humid.description_hash == dry.description_hash
    one, other = (pn.simulate(each, COMMAND, "0.5 s") for each in (dry, humid))
    assert all((one[name].to_numpy() == other[name].to_numpy()).all() for name in one.variables)
    assert "wmo2008" in other.attrs["citations"]
    assert "wmo2008" not in one.attrs["citations"]
    assert not [line for line in one.attrs["warnings"] if " may " in line]


def test_gas_that_expands_fogs_and_freezes():
    (line,) = [one for one in warned(drive({"gas.dew_point": "3 degC"})) if "chamber a" in one]
    run = pn.simulate(drive({}), COMMAND, "0.5 s")
    share = 757.9 / drive({}).supply_pressure_pa
    surplus = share * run.pressure_a.to_numpy() / saturation_pressure(run.temperature_a.to_numpy())
    at = int(surplus.argmax())
    assert line.startswith("fog or ice may form in chamber a and in its exhaust: ")
    assert f"at {float(run.time[at]):.3g} s and {float(run.pressure_a[at]) / 1e5:.3g} bar abs" in line
    assert f"the gas is at {float(run.temperature_a[at]) - 273.15:.1f} degC, below its frost point" in line
    # Dried by adsorption it stays clear as long as the gas is warmer than about -70 degC.
    assert not warned(drive({"gas.dew_point": "-75 degC"}))


def test_water_condenses_where_a_wall_is_below_the_dew_point():
    cold = {"gas.dew_point": "15 degC", "cylinder.wall_temperature": "8 degC"}
    on_wall = [one for one in warned(drive(cold), "0 s: 1", "1 s") if "wall" in one]
    assert [one.partition(":")[0] for one in on_wall] == ["water may condense on the wall of chamber a"]
    assert on_wall[0].endswith("the wall is at 8.0 degC")
    (ice,) = (
        one
        for one in warned(drive(cold | {"cylinder.wall_temperature": "-5 degC"}), 1, "1 s")
        if "wall of chamber a" in one
    )
    assert ice.startswith("ice may form on the wall")
    assert not [one for one in warned(drive(cold | {"cylinder.wall_temperature": "16 degC"})) if "wall" in one]


def tank(gas: dict[str, object], **more: object) -> pn.Circuit:
    return pn.Circuit(
        gas=gas,
        components={
            "tank": {"kind": "tank", "volume": "2 l"} | more,
            "nozzle": {"kind": "fitting", "conductance": "0.5 dm3/(s bar)", "critical_pressure_ratio": 0.5},
        },
        connections=["tank -> nozzle -> ambient"],
        initial={"tank": "7 bar abs"},
    )


def test_a_circuit_tells_of_its_volumes_by_name():
    gas = {"dew_point": "-20 degC", "dew_point_pressure": "6 bar gauge"}
    cooling = warned(tank(gas, heat_transfer="0 W/(m2 K)"), None, "4 s")
    assert [one.partition(":")[0] for one in cooling] == ["fog or ice may form in tank and in its exhaust"]
    wet = tank({"dew_point": "25 degC", "dew_point_pressure": "7 bar abs"}, wall_temperature="30 degC")
    assert not [one for one in warned(wet, None, "0.1 s") if "wall" in one]
    # A wall that stores heat and starts at 20 degC is below the dew point at first.
    wall = {"capacity": "500 J/K", "outer_area": "0.1 m2"}
    stores = tank({"dew_point": "25 degC", "dew_point_pressure": "7 bar abs"}, wall=wall, wall_temperature="20 degC")
    assert [one for one in warned(stores, None, "0.1 s") if one.endswith("the wall is at 20.0 degC")]


@pytest.mark.parametrize(
    ("gas", "said"),
    [
        ({"dew_point": "3 degC"}, r"gas\.dew_point needs a pressure: the circuit has no reservoir"),
        (
            {"dew_point_pressure": "7 bar abs"},
            r"gas\.dew_point_pressure = 7 bar abs has no effect without gas\.dew_point",
        ),
        (
            {"dew_point": "3 degC", "dew_point_pressure": "-2 bar gauge"},
            r"gas\.dew_point_pressure = .* is below vacuum",
        ),
        ({"dew_point": "3 K"}, "out of bounds"),
    ],
)
def test_what_is_wrong_with_a_dew_point_is_told(gas, said):
    with pytest.raises(DescriptionError, match=said):
        tank(gas)
