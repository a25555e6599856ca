"""A run that leaves the range of the model warns with time, place and limit; a run inside it does not."""

from __future__ import annotations

import math
import re
import threading
import tomllib
import warnings

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import Cancelled, CommandError, PneudriveWarning, SimulationError
from pneudrive.simulation.run_limits import ExhaustAir

REFERENCE = pn.Drive.load("catalogue:reference")
START = {"position": "50 mm", "pressure_a": "7 bar abs", "pressure_b": "7 bar abs"}


def limits(described, command, duration, **more):
    found = pn.simulate(described, command, duration, **more).attrs["warnings"]
    return [line for line in found if "valid up to" in line or "from its law" in line or "leaves its stroke" in line]


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
        assert sum("heat capacity is" in line and "higher than in the model" in line for line in found) == expected


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
    assert sum("deviates from its law" in line for line in found) == expected


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


# --- No impossible number without a word: covers, impacts, the budget of work, cancelling.

SOFT = {
    "cylinder.stroke": "100 mm",
    "cylinder.moving_mass": "5 kg",
    "cylinder.dead_volume": {"a": "0.5 cm3", "b": "0.5 cm3"},
}


def soft() -> pn.Drive:
    """Return a heavy piston before stops that are too soft for its dead length of 1 mm."""
    return pn.Drive.load("catalogue:reference").replace(SOFT)


def own_stops(drive: pn.Drive) -> pn.Drive:
    """Return the drive with the stops that follow from it."""
    tables = drive.to_dict()
    del tables["cylinder"]["end_stop"]
    return pn.Drive.model_validate(tables)


@pytest.mark.parametrize(
    ("rtol", "ledger", "rate"), [(1e-3, False, "50 Hz"), (1e-6, True, "20 kHz"), (1e-9, True, "50 Hz")]
)
def test_a_stop_that_is_pressed_through_ends_at_the_cover(rtol, ledger, rate):
    """The run goes on and says so: the deepest point is in the last fifth of the dead length, and energy closes."""
    drive = soft()
    with pytest.warns(PneudriveWarning, match=r"pressed the end stop through and met the cover .* end of chamber b"):
        run = pn.simulate(drive, "0 s: 1", "0.5 s", rtol=rtol, ledger=ledger, sample_rate=rate)
    length = 0.5e-6 / drive.cylinder.area_a_m2
    through = [impact for impact in run.attrs["impacts"] if impact["met_cover"]]
    assert through
    assert all(0.8 * length < impact["depth_m"] < length for impact in through)
    assert float(run.position.max()) < 0.1 + length
    # What it says would have held, holds.
    (said,) = (line for line in run.attrs["warnings"] if "pressed the end stop through" in line)
    stiffness = re.search(r"cylinder.end_stop.stiffness = (\S+ N/m) holds it", said)
    stiff = drive.replace({"cylinder.end_stop": {"stiffness": stiffness[1]}})
    held = simulated_quietly(stiff, "0 s: 1", "0.5 s", rtol=rtol, sample_rate=rate)
    assert not any(impact["met_cover"] for impact in held.attrs["impacts"])
    if ledger:
        assert abs(run.attrs["ledger"]["energy_error"]) < max(1e-3, 300.0 * rtol)
        assert abs(run.attrs["ledger"]["mass_error"]) < 1e-9


def simulated_quietly(*arguments, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        return pn.simulate(*arguments, **options)


def test_no_cover_holds_what_no_cylinder_does():
    with pytest.raises(SimulationError, match=r"t = 0\.\d+ s: the piston .* cover of chamber b") as told:
        pn.simulate(soft(), "0 s: 1", "0.5 s", initial="position = 99 mm, velocity = 1000 m/s")
    assert "end_stop.stiffness" in str(told.value)


def test_gas_behind_the_end_of_the_stroke_takes_no_heat_from_what_is_warmer():
    """A soft stop far behind the stroke leaves less wall than none: the second law holds there, too."""
    tables = {
        "cylinder.bore": "9 mm",
        "cylinder.stroke": "100 mm",
        "cylinder.moving_mass": "20 g",
        "cylinder.dead_volume": {"a": "6 cm3", "b": "6 cm3"},
        "cylinder.end_stop": {"stiffness": "3 N/mm", "damping": "6 N s/m", "damping_depth": "1 mm"},
        "cylinder.heat_transfer": "1000 W/(m2 K)",
        "load.force": "10 N",
    }
    drive = pn.Drive.load("catalogue:reference").replace(tables)
    run = simulated_quietly(drive, "0 s: 0.2", "2 s", rtol=1e-8, ledger=True, initial="pressure_b = 8 bar abs")
    assert float(run.position.max()) > 0.105
    assert float(run.temperature_b.min()) > 150.0
    assert run.attrs["ledger"]["least_entropy_production_j_k"] > -1e-9


def test_shooting_and_measured_records_meet_the_same_covers():
    core = soft().system.compiled()
    start = np.array([[0.099, 1000.0, 1.013e5, 293.15, 1.013e5, 293.15, 0.0]])
    asked = {"times": [0.0], "commands": [1.0], "sample_times": np.linspace(0.0, 0.5, 26), "starts": [0]}
    shot = core.shoot("command", asked | {"initial": start, "outputs": ["pressure_b_pa"], "rtol": 1e-6})
    assert "cover of chamber b" in str(shot["failures"][0])
    given = shot["values"][np.isfinite(shot["values"])]
    assert 0 < given.size < 26
    assert given.min() > 0.0
    still, shut = np.full(3, 1e5), np.zeros((3, 4))
    with pytest.raises(RuntimeError, match=r"at t = 0\.1 s the piston is at 102 mm of 100 mm"):
        core.along(
            np.array([0.0, 0.1, 0.2]), np.array([0.05, 0.102, 0.05]), np.zeros(3), still, still, shut, [293.0] * 2
        )


def test_stops_that_follow_from_the_drive_keep_the_piston_off_the_cover():
    drive = own_stops(soft())
    run = pn.simulate(drive, "0 s: 1, 0.3 s: -1", "0.6 s", sample_rate="20 kHz")
    beyond = max(float(run.position.max()) - 0.1, -float(run.position.min()))
    assert 0.0 < beyond < 0.5 * 0.5e-6 / drive.cylinder.area_a_m2  # half of the dead length
    lines = [line for line in run.attrs["assumed"] if line.startswith("cylinder.end_stop")]
    assert re.match(r"cylinder.end_stop.stiffness = \S+ N/m, so that a mass of 5 kg at ", lines[0])


def test_stops_grow_with_mass_and_shrink_with_room_and_what_is_given_stays():
    base = own_stops(soft())
    stiffness = base.end_stop["stiffness_n_m"]
    throttled = base.replace({"valve.conductance": "0.05 dm3/(s bar)"})
    heavier = throttled.replace({"load.mass": "20 kg"})
    roomier = base.replace({"cylinder.dead_volume": {"a": "5 cm3", "b": "5 cm3"}})
    assert heavier.end_stop["stiffness_n_m"] > 3.0 * throttled.end_stop["stiffness_n_m"]
    assert roomier.end_stop["stiffness_n_m"] < 0.05 * stiffness
    given = base.replace({"cylinder.end_stop": {"stiffness": "3e6 N/m"}})
    assert given.end_stop["stiffness_n_m"] == 3e6
    assert given.end_stop["damping_n_s_m"] == pytest.approx(math.sqrt(3e6 * 5.0))  # 2 zeta sqrt(k M)
    assert not any("stiffness" in line for line in given.assumed())


def test_an_impact_is_told_as_the_spring_took_it():
    """Energy at first touch; depth and force obey the stop's own law; a piston that leaves has the impact behind it."""
    drive = own_stops(soft()).replace({"cylinder.end_stop": {"stiffness": "4e7 N/m", "damping": "0 N s/m"}})
    with pytest.warns(PneudriveWarning, match="harder than a cylinder of this bore usually takes"):
        run = pn.simulate(drive, "0 s: 1", "0.2 s", sample_rate="50 kHz")
    first = run.attrs["impacts"][0]
    touch = int(np.argmax(run.position.to_numpy() > 0.1))
    assert first["end"] == "b"
    assert first["time_s"] == pytest.approx(float(run.time[touch]), abs=2e-5)
    assert first["speed_m_s"] == pytest.approx(float(run.velocity[touch]), rel=1e-3)
    assert first["energy_j"] == pytest.approx(0.5 * 5.0 * first["speed_m_s"] ** 2)
    assert first["depth_m"] == pytest.approx(float(run.position.max()) - 0.1, rel=1e-3)
    assert first["peak_force_n"] == pytest.approx(4e7 * first["depth_m"], rel=1e-9)
    spring = 0.5 * 4e7 * first["depth_m"] ** 2
    assert spring == pytest.approx(first["energy_j"], rel=0.1)  # the gas does the rest
    assert any("harder than" in line for line in run.attrs["warnings"])


def test_what_a_friction_table_without_a_law_assumed_is_kept():
    tables = pn.Drive.load("catalogue:reference").to_dict()
    tables["friction"] = {"coulomb": "30 N", "breakaway": "45 N"}
    with pytest.warns(PneudriveWarning, match="names no law"):
        drive = pn.Drive.model_validate(tables)
    run = pn.simulate(drive, "0 s: 0.5", "0.05 s")
    assumed = {"friction.law = elasto-plastic, no law was named", "friction.viscous = 0 N s/m, no law was named"}
    assert assumed <= set(run.attrs["assumed"])
    assert assumed <= set(drive.replace({"supply.pressure": "5 bar gauge"}).assumed())
    assert "viscous" not in str(drive.replace({"friction.viscous": "9 N s/m"}).assumed())
    assert pn.Drive.model_validate(tomllib.loads(drive.to_toml())).assumed() == drive.assumed()
    again = pn.Circuit.load(drive.circuit.to_toml())  # the marks are in the file
    assert "cylinder.friction.viscous = 0 N s/m, no law was named" in again.assumed()
    assert (again.assumed(), again.core_json()) == (drive.circuit.assumed(), drive.circuit.core_json())
    assert any("names no law" in line for line in run.attrs["warnings"])


def test_work_is_bounded_by_a_budget_that_the_message_names():
    drive = pn.Drive.load("catalogue:reference")
    with pytest.raises(SimulationError, match=r"budget of 50 attempts .* --budget"):
        pn.simulate(drive, "0 s: 1", "0.5 s", budget=50)
    with pytest.raises(CommandError, match="budget = 0"):
        pn.simulate(drive, "0 s: 1", "0.5 s", budget=0)
    enough = pn.simulate(drive, "0 s: 1", "0.5 s", budget=10_000)
    assert enough.identical(pn.simulate(drive, "0 s: 1", "0.5 s"))


def test_a_long_run_tells_where_it_is_and_can_be_cancelled():
    drive = pn.Drive.load("catalogue:reference")
    said, flag = [], threading.Event()

    def progress(done, total, task):
        said.append((done, total, task))
        flag.set()

    # Pulses of the valve keep the solver busy for some 100,000 attempts.
    pulses = [(0.002 * i, float(1 - 2 * (i % 2))) for i in range(5_000)]
    with pytest.raises(Cancelled):
        pn.simulate(drive, pulses, "10 s", rtol=1e-9, sample_rate="10 Hz", progress=progress, cancel=flag)
    (first,) = said
    assert 0.0 < first[0] < first[1] == 10.0
    with pytest.raises(Cancelled):
        pn.simulate(drive, "0 s: 1", "0.1 s", cancel=flag)


def test_exact_friction_never_pushes():
    """Fault of 31 drives: against a stop, at 1e-13 to 1e-7 m/s, a sample slid backwards in its mode."""
    tables = pn.Drive.load("catalogue:reference").to_dict()
    tables["friction"] = {"law": "coulomb", "coulomb": "10 N"}
    drive = pn.Drive.model_validate(tables)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        for rtol in (1e-4, 1e-5, 1e-6):
            run = pn.simulate(
                drive, "0 s: -0.33, 0.7 s: 0.4", "1.6 s", rtol=rtol, sample_rate="5 kHz", initial="position = 4 mm"
            )
            assert float((run.friction_force * run.velocity).min()) >= 0.0


def test_a_mass_that_creeps_on_a_stiff_stop_leaves_it():
    """Rounding on 2e9 N/m is 3e-8 N: the event where it no longer slips came again and again, for 360,000 attempts."""
    tables = {
        "name": "creeps",
        "supply": {"pressure": "9.067460018536224 bar abs", "temperature": "353 K"},
        "cylinder": {
            "kind": "rodless",
            "bore": "250 mm",
            "stroke": "68.57470987145588 mm",
            "moving_mass": "15.086581676936477 kg",
            "dead_volume": {"a": "56.78174939263992 cm3", "b": "95.4928994830391 cm3"},
            "end_stop": {
                "stiffness": "2156338565.233538 N/m",
                "damping": "90182.83912076037 N s/m",
                "damping_depth": "1.3736396233368318e-05 m",
            },
            "heat_transfer": "100 W/(m2 K)",
        },
        "valve": {
            "kind": "proportional-5/3",
            "conductance": "6.0715114835233654 dm3/(s bar)",
            "critical_pressure_ratio": 0.16683326141847435,
        },
        "friction": {
            "law": "karnopp",
            "coulomb": "1076.5888524156906 N",
            "breakaway": "1373.4622459840741 N",
            "stribeck_velocity": "8.13714711760107 mm/s",
            "viscous": "4234.3223806799415 N s/m",
            "dead_zone": "0.041488994869485256 mm/s",
        },
        "load": {"force": "3814.31572986214 N"},
    }
    drive = pn.Drive.model_validate(tables)
    commands = [(0.0, 0.6923791849302829), (0.2982967474687605, 0.11626435845398264)]
    run = simulated_quietly(drive, commands, "0.4 s", initial="position = 0.03428735493572794 m", budget=2_000)
    assert run.attrs["statistics"]["steps"] < 1_000
