"""Closed chambers along a recorded motion: volumes, heat, walls, leaks and clocks return with their intervals."""

from dataclasses import replace

import numpy as np
import pytest

import pneudrive as pn
from oracle.gas_spring import AREAS, CIRCUIT, Truth, positions, pressures, record
from pneudrive.describe.circuit import Circuit
from pneudrive.errors import FitError, RecordingError
from pneudrive.identify.follow.driven import DrivenCircuit, driven_recording
from pneudrive.identify.follow.fit import FollowFit, simulate_motion
from pneudrive.validate.motion import close_balance

ATMOSPHERE = 1.013e5


@pytest.fixture(scope="module")
def circuit():
    return Circuit.load(CIRCUIT)


def test_the_core_follows_a_motion_like_the_equations(circuit):
    """Pressures agree with an integration that shares no code with the core, within 1e-4 of the range."""
    truth = Truth(capacity=2000.0, outer=40.0, leak=4e-15)
    time = np.arange(0.0, 80.0, 0.1)
    x = positions(time, np.array([0.15, 0.5]))
    expected = pressures(truth, time, x, parts=10)
    driven = DrivenCircuit(circuit)
    numbers = driven.numbers_of(["volumes", "heat", "wall_a", "leak"])
    faces = [1.0 + 2.0 * area for area in AREAS]
    heat = [h / f for h, f in zip(truth.heat, faces, strict=True)]
    form = driven.values_form(numbers, [*truth.volumes, *heat, truth.capacity, truth.outer, truth.leak])
    quiet = replace(record(truth), time_s=time, position_m=x, force_n=0.0 * x, pressure_a_pa=expected[0],
                    pressure_b_pa=expected[1], parallel=())  # fmt: skip
    ends = [f"{driven.piston}.{side}.pressure_pa" for side in "ab"]
    found = [*driven.run(form, driven_recording(quiet), [*truth.pressures, 293.15, 293.15], 80.0, ends).values()]
    # The wall of the core exchanges through its own area, without the piston's faces.
    assert np.abs(found - expected).max() < 2e-3 * np.ptp(expected)


def test_a_through_rod_leaves_a_ring_in_both_chambers():
    cylinder = {"kind": "through-rod", "rod_diameter": "10 mm"}
    drive = pn.Drive.load("catalogue:reference").replace({f"cylinder.{key}": value for key, value in cylinder.items()})
    of = DrivenCircuit(drive.circuit).volumes_m3(np.array([0.1, 0.4]))
    assert np.diff(of["a"])[0] == pytest.approx(0.3 * np.pi / 4.0 * (0.025**2 - 0.01**2))
    assert np.diff(of["b"])[0] == pytest.approx(-0.3 * np.pi / 4.0 * (0.025**2 - 0.01**2))


def test_volumes_heat_and_delay_return(circuit, tmp_path):
    truth = Truth(delay_s=0.3)
    fit = pn.identify_motion(circuit, [record(truth)], ["volumes", "heat"], rivals=False)
    assert fit.converged
    for name, value in zip(("upper.volume", "lower.volume"), truth.volumes, strict=True):
        low, high = fit.intervals[name]
        assert low <= value <= high
        assert high - low < 0.01 * value
    heat = [
        fit.values[f"{tank}.heat_transfer"] * (1 + 2 * area)
        for tank, area in zip(("upper", "lower"), AREAS, strict=True)
    ]
    assert heat == pytest.approx(truth.heat, rel=0.02)
    assert max(fit.records[0].rms) < 0.002
    assert fit.records[0].delay_s[0] == pytest.approx(0.3, abs=0.01)
    # Another recording: start and delay are fitted, the rest is held; the file of the fit is enough.
    fit.to_toml(tmp_path / "gas.toml")
    other = Truth(pressures=(6e5, 1.2e6), delay_s=-0.2)
    found = pn.validate_motion(FollowFit.from_toml(tmp_path / "gas.toml"), [record(other, 5)])
    assert all(met for met, _ in found.verdicts)
    assert found.records[0].delay_s[0] == pytest.approx(-0.2, abs=0.01)
    assert any("clocks of the loggers differ" in doubt for doubt in found.doubts)
    columns, _ = simulate_motion(FollowFit.from_toml(tmp_path / "gas.toml"), record(truth))
    assert columns["upper.pressure_pa"].min() == pytest.approx(record(truth).pressure_a_pa.min(), rel=0.02)


def test_leak_wall_delay_and_ram_area_lie_in_their_intervals(circuit):
    rng = np.random.default_rng(100)
    truth = Truth(
        (rng.uniform(0.02, 0.03), rng.uniform(0.035, 0.06)),
        (rng.uniform(15, 40), rng.uniform(40, 90)),
        rng.uniform(800, 4000),
        rng.uniform(20, 80),
        10 ** rng.uniform(-14.6, -14),
        delay_s=rng.uniform(-0.3, 0.4),
        ram_gain=rng.uniform(0.95, 1.05),
    )
    one = record(truth)
    fit = pn.identify_motion(circuit, [one], ["volumes", "heat", "wall_a", "leak"], rivals=False)
    for name, value in (("upper.wall_capacity", truth.capacity), ("leak.coefficient", truth.leak)):
        low, high = fit.intervals[name]
        assert low <= value <= high
    delay, half = fit.records[0].delay_s
    assert abs(delay - truth.delay_s) < max(half, 1e-3)
    gain = close_balance(one).gains["ram"]
    assert gain.low <= truth.ram_gain <= gain.high


def test_a_wall_earns_its_place_only_where_there_is_one(circuit):
    walled = pn.identify_motion(circuit, [record(Truth(capacity=1500.0, outer=40.0))], ["volumes", "heat"])
    assert next(r for r in walled.rivals if r.name == "wall_a").earns
    assert np.ptp(walled.details["upper.volume"]["spread"]) > 0.0
    plain = pn.identify_motion(circuit, [record(Truth())], ["volumes", "heat"])
    assert not any(r.earns for r in plain.rivals)
    assert "not determined" in next(r for r in plain.rivals if r.name == "leak").verdict


def swap(r):
    return replace(r, pressure_a_pa=r.pressure_b_pa, pressure_b_pa=r.pressure_a_pa)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (swap, "rise as the gas of their chambers expands"),
        (lambda r: replace(r, position_m=25.4 * r.position_m), "beyond the stroke"),
        (lambda r: replace(r, pressure_a_pa=r.pressure_a_pa / 14.5e3), "pressure of chamber a falls to"),
    ],
)
def test_impossible_readings_are_refused(circuit, change, words):
    with pytest.raises(RecordingError, match=words):
        pn.identify_motion(circuit, [change(record(Truth()))], rivals=False)


def test_gauge_and_absolute_pressures_are_told_apart(circuit):
    r = record(Truth())
    for shift, word in ((-ATMOSPHERE, "gauge"), (ATMOSPHERE, "absolute"), (0.0, None)):
        shifted = replace(r, pressure_a_pa=r.pressure_a_pa + shift, pressure_b_pa=r.pressure_b_pa + shift)
        notes = " ".join(pn.identify_motion(circuit, [shifted], rivals=False).notes)
        assert f"seem to be {word}" in notes if word else "seem to be" not in notes


def test_a_position_in_another_unit_is_flagged(circuit):
    r = record(Truth())
    fit = pn.identify_motion(circuit, [replace(r, position_m=r.position_m / 25.4)], rivals=False)
    assert any("check the unit of the position" in note for note in fit.notes)


def test_open_chambers_determine_nothing(circuit):
    r = record(Truth())
    vented = replace(r, name="vented", pressure_a_pa=0 * r.force_n + 1e5, pressure_b_pa=0 * r.force_n + 1.02e5)
    with pytest.raises(FitError, match="the chambers are open"):
        pn.identify_motion(circuit, [vented], rivals=False)
    found = pn.validate_motion(circuit, [vented])
    assert (found.open, found.records) == (("vented",), ())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: replace(r, parallel=()), "a parallel force that the layout does not describe"),
        (lambda r: replace(r, force_n=-r.force_n), "the force has the wrong sign"),
        (swap, "pressure_a and pressure_b are swapped"),
        (
            lambda r: replace(r, parallel=(r.parallel[0]._replace(force_n=-r.parallel[0].force_n),)),
            "ram acts in the opposite direction",
        ),
    ],
)
def test_a_balance_that_does_not_close_names_the_cause(change, words):
    right = close_balance(record(Truth()))
    assert right.doubts == ()
    assert right.share < 0.005
    assert right.friction_n[1] == pytest.approx((400.0, 900.0), rel=0.1)
    (doubt,) = close_balance(change(record(Truth()))).doubts
    assert words in doubt


def test_a_number_without_effect_and_an_unknown_one_are_named(circuit):
    with pytest.raises(FitError, match="cannot be free"):
        pn.identify_motion(circuit, [record(Truth())], ["upper.colour"])
    still = circuit.replace({f"components.{tank}.heat_transfer": "0 W/(m2 K)" for tank in ("upper", "lower")})
    with pytest.raises(FitError, match=r"piston\.moving_mass has no effect"):
        pn.identify_motion(still, [record(Truth())], ["volumes", "piston.moving_mass"], rivals=False)
