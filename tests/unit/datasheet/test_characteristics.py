"""Characteristics of the reference drive: numbers that were derived by hand or found by other programs."""

import csv
import math
from functools import cache

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.datasheet.characteristics.air import FULL_S, NORMAL_DENSITY_KG_M3, drawn_mass
from pneudrive.datasheet.characteristics.steady import velocity_gain
from pneudrive.datasheet.equilibrium import steady_state
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.datasheet.registry import characteristics
from pneudrive.datasheet.strokes import litres_anr
from pneudrive.describe.circuit import Circuit

DRIVE = pn.Drive.load("catalogue:reference")


def with_leak(share):
    tables = DRIVE.circuit.to_dict()
    tables["components"]["valve"] |= {"leakage": share}
    return Circuit.model_validate(tables)


def test_steady_velocities_under_command_and_load():
    found = {(u, load): pn.equilibrium(DRIVE, u, load=load) for u in (0.6, 1.0) for load in (0.0, -100.0)}
    shown = [f"{found[key].velocity_m_s:.4f}" for key in ((0.6, 0.0), (1.0, 0.0), (0.6, -100.0), (1.0, -100.0))]
    assert shown == ["2.4249", "3.7640", "2.0021", "2.7104"]
    assert f"{1e-5 * found[0.6, 0.0].pressure_b_pa:.3f}" == "2.726"
    back = pn.equilibrium(DRIVE, -1.0, load=100.0)
    assert back.velocity_m_s == pytest.approx(-found[1.0, -100.0].velocity_m_s, rel=1e-8)
    assert back.pressure_b_pa == pytest.approx(found[1.0, -100.0].pressure_a_pa, rel=1e-8)


def test_velocity_gain_is_that_of_choked_exhaust():
    slope, zone = velocity_gain(HeldDrive(DRIVE), 1.0)
    assert f"{slope:.4f}" == "4.0628"
    assert abs(zone) < 1e-9
    small = pn.equilibrium(DRIVE, 0.2, load=0.0)
    assert f"{1e-5 * small.pressure_a_pa:.4f}" == "5.3005"
    # The exhaust chokes up to 94.4 N: friction of the reference drive and load together.
    rest = 94.4 - abs(small.friction_n)
    gain = 4.062804 * 0.2
    assert pn.equilibrium(DRIVE, 0.2, load=-rest + 0.1).velocity_m_s == pytest.approx(gain, rel=1e-6)
    assert pn.equilibrium(DRIVE, 0.2, load=-rest - 3.0).velocity_m_s < gain * (1.0 - 1e-5)


@pytest.mark.parametrize(("load_n", "speed_m_s"), [(227.488, 0.521057), (232.179, 0.414715)])
def test_friction_that_falls_with_speed_leaves_a_steady_speed_near_the_stall_force(load_n, speed_m_s):
    drive = pn.Drive.load("catalogue:parker-osp-p25-mpye")
    for way in (1.0, -1.0):
        state = pn.equilibrium(drive, way, load=-way * load_n)
        assert way * state.velocity_m_s == pytest.approx(speed_m_s, abs=2e-5)
        assert way * state.load_n == pytest.approx(-load_n, abs=1e-6)


def test_force_at_full_supply():
    found = pn.drive_characteristic(DRIVE, "force-speed", points=2)
    assert f"{float(found.blocked_force[0]):.3f} {float(found.stall_force[0]):.1f}" == "293.886 248.9"


def test_pressure_gain_with_four_equal_leaks():
    leak = 0.01
    found = pn.drive_characteristic(with_leak(leak), "pressure-gain")
    assert f"{1e-5 * float(found.centre_pressure_a):.4f}" == "5.3005"
    # Each chamber between two equal edges, the exhaust choked: 7 bar phi(r) = p with r = p / 7 bar, so that the slope
    # over u / leak is p / (1 - phi'(r)) in a, and its negative in b.
    r = (0.6 + math.sqrt(0.36 + 4.0 * 1.49 * 0.4)) / (2.0 * 1.49)  # r^2 = 1 - ((r - 0.3) / 0.7)^2
    slope = 2.0 * 7.0 * r / (1.0 + (r - 0.3) / (0.49 * r))
    assert f"{slope:.4f}" == "4.7490"
    assert float(found.pressure_gain) * 1e-5 * leak == pytest.approx(slope, rel=2e-6)
    assert math.isinf(float(pn.drive_characteristic(DRIVE, "pressure-gain").pressure_gain))


def test_equilibrium_is_where_a_long_run_ends():
    circuit = with_leak(0.02)
    session = circuit.start({"cylinder.position": "250 mm"}, rtol=1e-10)
    session.set("valve.command", 0.002)
    session.advance(60.0)
    found = steady_state(HeldDrive(circuit), 0.002)
    assert abs(session.read("cylinder.velocity_m_s")) < 1e-9
    assert found.pressure_a_pa == pytest.approx(session.read("cylinder.a.pressure_pa"), rel=1e-6)
    assert found.pressure_b_pa == pytest.approx(session.read("cylinder.b.pressure_pa"), rel=1e-6)
    assert found.temperature_a_k == pytest.approx(session.read("cylinder.a.temperature_k"), rel=1e-6)


def test_a_shut_valve_holds_any_pressure():
    with pytest.raises(pn.PneudriveError, match="is not determined"):
        pn.equilibrium(DRIVE, 0.0)


def test_stiffness_and_natural_frequency():
    found = pn.drive_characteristic(DRIVE, "stiffness", pressures=["3 bar abs"])
    fast, slow = found.adiabatic_stiffness[:, 0], found.isothermal_stiffness[:, 0]
    middle = len(fast) // 2
    assert f"{float(fast[middle]):.1f} {float(slow[middle]):.1f} {float(fast[0]):.0f}" == "1525.1 1089.3 10516"
    assert float(found.largest_loss_factor) == pytest.approx(0.4 / (2.0 * math.sqrt(1.4)), rel=1e-3)
    both = pn.drive_characteristic(DRIVE, "natural-frequency", pressures=["3 bar abs"])
    frequency = both.natural_frequency[:, 0]
    plant = HeldDrive(DRIVE)
    at_mean = 4.395 * math.sqrt(0.5 * (plant.supply_pa + plant.ambient[0]) / 3e5)
    assert float(both.drive_frequency) == pytest.approx(at_mean, rel=2e-4)
    shown = [f"{float(frequency.sel(position=x)):.{n}f}" for x, n in ((0.25, 3), (0.125, 3), (0.5, 2))]
    assert shown == ["4.395", "4.956", "11.54"]


def test_gas_in_tubes_is_part_of_the_air_spring():
    """All of it, up to the valve: 3 m of 6 mm, without heat k p A^2 (1/V_a + 1/V_b)."""
    drive = DRIVE.replace({"tubing": {side: {"length": "3 m", "diameter": "6 mm"} for side in "ab"}})
    found = pn.drive_characteristic(drive, "natural-frequency", pressures=["3 bar abs"]).sel(pressure=3e5)
    x, area = found.position.values, 0.25 * math.pi * 0.025**2
    before = 1e-5 + 3.0 * 0.25 * math.pi * 0.006**2
    spring = 1.4 * 3e5 * area**2 * (1.0 / (before + area * x) + 1.0 / (before + area * (0.5 - x)))
    assert found.natural_frequency.values == pytest.approx(np.sqrt(spring / 2.0) / (2.0 * math.pi), rel=2e-3)
    assert found.mode_frequency.values == pytest.approx(found.natural_frequency.values, rel=0.01)
    middle = found.natural_frequency.sel(position=0.25)
    assert found.frequency_by_mass.sel(mass=2.0) == pytest.approx(float(middle), rel=1e-9)


def test_lines_of_a_shut_chamber_start_at_its_pressure():
    """Only the cooling of the gas is left of the fall of a drive without leak."""
    drive = DRIVE.replace({"tubing": {side: {"length": "2 m", "diameter": "4 mm"} for side in "ab"}})
    assert pn.drive_characteristic(drive, "leakage").fall.max() < 1e3


def test_the_linear_model_follows_a_small_step():
    drive = DRIVE.replace({"friction": {"law": "coulomb", "coulomb": "1e-6 N"}})
    control = pytest.importorskip("control")
    model = pn.linearise(drive, position="100 mm", pressures=("3 bar abs", "3 bar abs"), friction="none")
    times = np.linspace(0.0, 0.5, 251)
    force = 0.05
    linear = control.step_response(model[["position_m"], ["load_force_n"]], times).outputs.ravel() * force
    session = drive.start({"position": "100 mm", "pressure_a": "3 bar abs", "pressure_b": "3 bar abs"}, rtol=1e-9)
    session.set("load_force_n", force)
    full = []
    for t in times:
        session.advance(float(t))
        full.append(session.read("position_m") - 0.1)
    assert np.abs(np.array(full) - linear).max() < 0.01 * np.abs(linear).max()
    assert linear[-1] > 0.0


def test_a_shut_valve_has_two_slopes_and_friction_is_the_callers_choice():
    pytest.importorskip("control")
    slopes = [
        pn.linearise(DRIVE, pressures="5 bar abs", friction="none", opening=side).B[2:6, 0] for side in ("+", "-")
    ]
    assert slopes[0][0] > 0.0 > slopes[0][2]  # fills a, empties b
    assert slopes[1][0] > 0.0 > slopes[1][2]
    assert abs(slopes[0][0] / slopes[1][0] - 1.0) > 0.05
    pairs = {one: pn.linearise(DRIVE, pressures="3 bar abs", friction=one).poles() for one in ("presliding", "none")}
    assert np.abs(pairs["none"]).max() / (2.0 * math.pi) == pytest.approx(4.395, rel=1e-3)
    assert np.abs(pairs["presliding"]).max() > 200.0  # bristles: sqrt(1e5/2) rad/s


def test_minimum_pressure_is_breakaway_over_area():
    found = pn.drive_characteristic(DRIVE, "minimum-pressure")
    area = math.pi * 0.025**2 / 4.0
    assert f"{1e-5 * float(found.breakaway_force[0]) / area:.3f}" == "0.917"
    assert f"{1e-5 * float(found.minimum_pressure[0]):.3f}" == "0.917"


def test_a_step_has_the_known_numbers():
    found = pn.drive_characteristic(DRIVE, "step-response", command=0.6, position=0.05, pressures="3 bar abs")
    shown = (float(found.end_speed), float(found.end_energy), 1e3 * float(found.overshoot))
    assert "{:.2f} {:.1f} {:.2f}".format(*shown) == "2.39 5.7 1.59"


def test_air_and_exergy_of_a_full_cycle():
    stop = {"stiffness": "1e8 N/m", "damping": "2e4 N s/m", "damping_depth": "0.01 mm"}  # the usual one gives 0.05 %
    stiff = DRIVE.replace({"cylinder.end_stop": stop})
    mass = drawn_mass(HeldDrive(stiff), FULL_S)
    assert f"{litres_anr(mass):.3f} {1e3 * mass / NORMAL_DENSITY_KG_M3:.3f}" == "3.566 3.268"
    spent = pn.drive_characteristic(stiff, "exergy")
    assert (round(float(spent.drawn), 1), round(float(spent.open), 6)) == (687.3, 0.0)
    assert float(spent.lost.sum()) + float(spent.exhausted) == pytest.approx(float(spent.drawn), rel=1e-6)
    slow = DRIVE.replace({"valve.conductance": "0.01 dm3/(s bar)"})  # its stroke takes more than 20 s
    assert float(pn.drive_characteristic(slow, "air").full) == pytest.approx(3.566, rel=1e-3)


def test_the_test_stand_finds_conductance_and_ratio_again():
    found = pn.drive_characteristic(DRIVE, "flow")
    assert np.abs(found.conductance / 2e-8 - 1.0).max() < 1e-6
    assert np.abs(found.critical_ratio / 0.3 - 1.0).max() < 1e-6


def test_intervals_of_identified_values_go_through():
    origin = {"interval": ["29 N", "31 N"], "source": "recording.csv"}
    drive = DRIVE.replace({"provenance": {"friction.coulomb": origin}})
    found = pn.drive_characteristic(drive, "force-speed", points=1)
    low, high = (float(found[f"speed_{end}"][0, 0]) for end in ("low", "high"))
    by_hand = [
        pn.equilibrium(DRIVE.replace({"friction.coulomb": f"{n} N"}), 1.0, load=0.0).velocity_m_s for n in (31, 29)
    ]
    assert (low, high) == pytest.approx(tuple(by_hand), rel=1e-9)
    assert found.speed.attrs["confidence"] == 0.95
    assert low < float(found.speed[0, 0]) < high


def test_correlations_of_identified_values_narrow_or_widen_what_they_share():
    ends = {"friction.coulomb": ["29 N", "31 N"], "friction.viscous": ["39.5 N s/m", "40.5 N s/m"]}

    def width(share):
        origins = {name: {"interval": pair, "source": "one fit"} for name, pair in ends.items()}
        origins["friction.viscous"] |= {"correlation": {"friction.coulomb": share}}
        found = pn.drive_characteristic(DRIVE.replace({"provenance": origins}), "force-speed", points=1)
        return float(found.speed_high[0, 0] - found.speed_low[0, 0]) / 2.0

    against, none, along = (width(share) for share in (-0.9, 0.0, 0.9))
    assert along > none > against  # both friction values slow the piston: errors that go together add up
    assert (along**2 + against**2) / 2.0 == pytest.approx(none**2, rel=1e-6)
    assert along**2 - against**2 > none**2  # 4 * 0.9 d1 d2, and both values matter
    with pytest.raises(pn.PneudriveError, match="not more than 1"):
        width(1.5)


WRONG_SETTINGS = [
    *(("step-response", text) for text in ("command = abc", "command = 3", "position = 3", "position = 3 bar")),
    *(("force-speed", text) for text in ("points = 0", "points = 2.5", "points = 3, 4", "pressure = 1", "points")),
    *((name, "half_period = 0") for name in ("square-response", "air", "exergy")),
    ("describing-function", "frequencies = 0"),
    ("valve-times", "share = 0"),
]


def test_every_characteristic_says_what_it_is(tmp_path, printed):
    from pneudrive.cli.main import run
    from pneudrive.references import entries

    known = entries()
    for one in characteristics().values():
        assert one.definition.endswith(".")
        assert set(one.cites) <= set(known), one.name
    target = tmp_path / "stiffness.csv"
    assert run(["characteristic", "catalogue:reference", "stiffness", "--out", str(target)]) == 0
    with target.open() as stream:
        rows = [row for row in csv.DictReader(stream) if row["result"] == "adiabatic_stiffness"]
    assert {row["unit"] for row in rows} == {"N/m"}
    assert len(rows) == 15 * 4
    assert rows[1]["at"] == "position 0, pressure 3e+05"  # in SI, as all of the table
    assert "mass 4 kg, pressure 3 bar" in printed(["characteristic", "catalogue:reference", "natural-frequency"])
    assert run(["characteristic", "catalogue:reference", "stiffness-map"]) == 2
    step = ["characteristic", "catalogue:reference", "step-response", "--set", "command = 0.6"]
    start = ["--set", "position = 0.05", "--set", "pressures = 3 bar abs"]
    assert "0.208 s" in printed([*step, *start])
    for name, wrong in WRONG_SETTINGS:
        assert run(["characteristic", "catalogue:reference", name, "--set", wrong]) in (1, 2), wrong


def test_frequency_responses_meet_where_they_should():
    small = pn.drive_characteristic(DRIVE, "bode")
    assert f"{float(small.velocity_gain):.2f}" == "4.06"
    assert float(small.velocity_phase[0]) == pytest.approx(0.0, abs=3.0)
    large = pn.drive_characteristic(DRIVE, "describing-function", amplitudes=[0.3], frequencies=[2.0])
    assert 0.5 * 4.06 < float(large.gain[0, 0]) < 4.06  # friction takes some of a large sine
    assert -90.0 < float(large.phase[0, 0]) < 0.0
    assert 0.0 < float(large.distortion[0, 0]) < 0.3
    ends = pn.drive_characteristic(DRIVE, "describing-function", amplitudes=[1.0], frequencies=[0.5])
    assert math.isnan(float(ends.gain[0, 0]))


def test_a_load_moves_the_piston_as_its_linear_model_says_and_friction_holds_it():
    from pneudrive.datasheet.equilibrium import SIDE, gas_at, linear_model

    smooth = DRIVE.replace({"friction": {"law": "coulomb", "coulomb": "1e-6 N", "viscous": "40 N s/m"}})
    settings = {"frequencies": [1.0, 8.0], "pressures": "3 bar abs"}
    found = pn.drive_characteristic(smooth, "load-describing-function", amplitudes=[2.0], **settings)
    linear = linear_model(HeldDrive(smooth), SIDE, 0.25, gas_at(HeldDrive(smooth), "3 bar abs"), "sliding")
    b = linear.B[:, linear.inputs.index("cylinder.load_force_n")]
    c = linear.C[linear.outputs.index("cylinder.position_m")]
    for k, f in enumerate(settings["frequencies"]):  # below and above the natural frequency, 4.4 Hz
        own = c @ np.linalg.solve(2j * math.pi * f * np.eye(len(b)) - linear.A, b)
        assert float(found.compliance[0, k]) == pytest.approx(abs(own), rel=0.01)
        assert float(found.phase[0, k]) == pytest.approx(math.degrees(np.angle(own)), abs=1.0)
    assert float(found.phase[0, 0]) > -45.0 > -135.0 > float(found.phase[0, 1])
    rough = pn.drive_characteristic(DRIVE, "load-describing-function", amplitudes=[20.0, 90.0], **settings)
    below, above = (float(value) for value in rough.compliance[:, 0])
    assert below < 2e-5 < 2e-4 < above < float(found.compliance[0, 0])  # 20 N against bristles of 1e5 N/m, then slip
    assert float(rough.distortion[1, 0]) > float(found.distortion[0, 0])


def test_sensitivities_are_exponents():
    found = pn.drive_characteristic(DRIVE, "sensitivity", numbers=["cylinder.moving_mass", "valve.conductance"])
    table = {name: found.sel(parameter=name) for name in found.parameter.values}
    mass, valve = table["cylinder.moving_mass"], table["valve.conductance"]
    assert float(mass.natural_frequency_sensitivity) == pytest.approx(-0.5, abs=1e-6)
    assert float(mass.steady_speed_sensitivity) == pytest.approx(0.0, abs=1e-9)
    assert float(valve.stall_force_sensitivity) == pytest.approx(0.0, abs=1e-9)
    assert 0.5 < float(valve.steady_speed_sensitivity) < 1.0
    assert float(valve.stroke_time_sensitivity) < -0.5


@cache
def published(name):
    return pn.drive_characteristic(pn.Drive.load(f"catalogue:{name}"), "published")


@pytest.mark.parametrize(
    ("name", "most"),
    [
        # force, force with friction (its curve is assumed), flow: SMC prints whole litres, 276, 746; the
        # breakaway of the CM2Y is written as 9.8 N, 0.2 % below 0.02 MPa times its area
        ("parker-osp-p25-sy5000", {"theoretical": 2e-3, "effective": 1.5e-2, "nominal": 0.5 / 746}),
        ("smc-cm2y-25-sy3000", {"minimum": 1.5e-3, "nominal": 0.5 / 276}),
    ],
)
def test_figures_that_makers_print_come_out_of_the_test_stands(name, most):
    found = published(name)
    seen = {
        str(figure).partition(": ")[2].split()[0]: abs(float(d))
        for figure, d in zip(found.figure.values, found.difference, strict=True)
    }
    assert seen.keys() == most.keys()
    assert all(seen[key] < limit for key, limit in most.items()), seen


def test_times_of_a_switching_valve_and_what_it_cannot_have():
    tables = DRIVE.circuit.to_dict()
    tables["components"]["valve"] = {"use": "catalogue:ckd-m4ga1-r-2-position"}
    circuit = Circuit.model_validate(tables)
    found = pn.drive_characteristic(circuit, "valve-times")
    for time in (float(found.time_on), float(found.time_off)):
        assert 0.012 < time < 0.015  # 12 ms to the middle of the travel, then the outlet fills
    with pytest.raises(pn.PneudriveError, match="valve can only switch"):
        pn.drive_characteristic(circuit, "pressure-gain")
    with pytest.raises(pn.PneudriveError, match="times need a switching valve"):
        pn.drive_characteristic(DRIVE, "valve-times")


def test_lines_are_those_of_the_study():
    found = pn.drive_characteristic(DRIVE, "lines", lengths=["1 m"], diameters=["4 mm", "6 mm"])
    assert [f"{float(v):.3f}" for v in found.vent_speed[:, 0]] == ["2.297", "3.636"]


def test_a_cushion_brakes_less_what_is_heavier_and_does_not_touch_steady_motion():
    tables = DRIVE.circuit.to_dict()
    tables["components"]["cylinder"] |= {
        "cushion_b_length": "17 mm",
        "cushion_b_plunger_diameter": "12 mm",
        "cushion_b_needle_conductance": "0.03 dm3/(s bar)",
        "cushion_b_port_volume": "1.5 cm3",
        "heat_transfer": "30 W/(m2 K)",
    }
    tables["components"]["valve"] |= {"frequency": "100 Hz"}
    circuit = Circuit.model_validate(tables)
    found = pn.drive_characteristic(circuit, "cushion", end_speed=1.0)
    fast = found.sel(speed=2.0)
    assert (np.diff(fast.end_speed) > 0.0).all()
    # The gas brakes the lightest mass before the cushion does.
    assert (np.diff(found.peak_pressure, axis=1)[1:] > 0.0).all()
    assert ((found.end_speed <= 1.0) == (found.admissible == 1.0)).all()
    assert float(fast.end_speed[2]) < 2.0
    slow, plain = (pn.equilibrium(one, 0.6, load=0.0).velocity_m_s for one in (circuit, DRIVE))
    assert slow == pytest.approx(plain, rel=1e-9)
    with pytest.raises(pn.PneudriveError, match="has no cushion"):
        pn.drive_characteristic(DRIVE, "cushion")


def test_tubes_with_waves_have_no_steady_state_that_a_start_takes():
    tube = {"length": "1 m", "diameter": "4 mm", "model": "distributed"}
    drive = DRIVE.replace({"tubing": {"b": tube}})
    with pytest.raises(pn.PneudriveError, match="cannot be held"):
        pn.drive_characteristic(drive, "stiffness")
    steady = DRIVE.replace({"tubing": {"b": tube | {"model": "steady"}}})
    assert 0.0 < pn.equilibrium(steady, 1.0, load=0.0).velocity_m_s < 3.0
    control = {"conductance": "0.4 dm3/(s bar)", "throttles": "out"}
    gain = pn.drive_characteristic(steady.replace({"flow_control": {"b": control}}), "pressure-gain")
    assert gain.pressure_difference[[0, -1]].to_numpy() == pytest.approx([-5.987e5, 5.987e5], rel=1e-6)


def test_printed_figures_are_those_of_the_part_whatever_it_carries():
    drive = pn.Drive.load("catalogue:parker-osp-p25-sy5000")
    lifts = drive.replace({"cylinder.incline": "90 deg", "load.mass": "5 kg", "load.force": "-20 N"})
    tube = {"length": "2 m", "diameter": "4 mm"}
    origin = {"load.mass": {"interval": ["4.9 kg", "5.1 kg"], "confidence": 0.95, "source": "scales"}}
    far = lifts.replace({"tubing": {"a": tube, "b": tube}, "provenance": origin})
    np.testing.assert_allclose(
        pn.drive_characteristic(far, "published").computed,
        published("parker-osp-p25-sy5000").computed,
        rtol=1e-9,
    )
    blocked = [float(pn.drive_characteristic(one, "force-speed", points=1).blocked_force[0]) for one in (drive, lifts)]
    weight = (5.0 + drive.cylinder.moving_mass_kg) * 9.80665
    assert blocked[0] - blocked[1] == pytest.approx(weight + 20.0, rel=1e-6)
