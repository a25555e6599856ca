"""Numbers of a drive from records of its motion: what was simulated is found again, from far off, with true intervals.

All records are synthetic: the drive of the catalogue, or one with elasto-plastic bristles, and noise from a seed.
"""

from __future__ import annotations

import tomllib
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from benches.servo import controller, follow_sine
from oracle.bootstrap import drive_bootstrap, intervals_of_draws
from pneudrive.errors import DescriptionError, FitError, PneudriveWarning
from pneudrive.free.parameters import numbers_of
from pneudrive.identify.dynamic.sensors import lagged
from pneudrive.identify.files import read_fit

pytestmark = pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")

UNITS = {"coulomb": "N", "breakaway": "N", "stribeck_velocity": "m/s", "viscous": "N s/m", "bristle_stiffness": "N/m"}
FRICTION = [f"friction.{name}" for name in UNITS]
START = {
    "position_m": 0.25,
    "velocity_m_s": 0.0,
    **{f"pressure_{c}_pa": 3e5 for c in "ab"},
    **{f"temperature_{c}_k": 293.15 for c in "ab"},
}


@cache
def reference() -> pn.Drive:
    return pn.Drive.load("catalogue:reference")


def off(drive: pn.Drive, factor: float) -> pn.Drive:
    values = drive.friction.parameters
    return drive.replace({f"friction.{n}": f"{factor * values[n]!r} {unit}" for n, unit in UNITS.items()})


def servo(
    drive: pn.Drive,
    seconds: float,
    *,
    amplitude: float = 0.1,
    frequency: float = 0.5,
    noise=(1e-6, 200.0),
    seed: int = 0,
) -> dict:
    """Record a servo that follows a sine at 1 kHz."""
    core = drive.system.compiled()
    run = follow_sine(core, controller(8.0, 0.25, amplitude, frequency, 0.25), seconds, 1000.0, START, 1e-8)
    n = len(run["time_s"])
    rng = np.random.default_rng(seed)
    return {
        "time_s": np.arange(n) * 1e-3,
        "command": run["command"],
        "position_m": run["position_m"] + noise[0] * rng.standard_normal(n),
        "pressure_a_pa": run["pressure_a_pa"] + noise[1] * rng.standard_normal(n),
        "pressure_b_pa": run["pressure_b_pa"] + noise[1] * rng.standard_normal(n),
    }


def recorded(run, seed: int, noise_m: float, noise_pa: float, names=("position", "pressure_a", "pressure_b")) -> dict:
    """Record a simulated run with noise."""
    rng = np.random.default_rng(seed)
    columns = {"time_s": run.time.values, "command": run.command.values}
    for name in names:
        noise, unit = (noise_m, "m") if name == "position" else (noise_pa, "pa")
        columns[f"{name}_{unit}"] = run[name].values + noise * rng.standard_normal(run.sizes["time"])
    return columns


def truth(drive: pn.Drive, names: list[str]) -> dict[str, float]:
    known = numbers_of(drive)
    return {name: known[name].value for name in names}


@cache
def servo_fit() -> object:
    return pn.identify(off(reference(), 1.5), servo(reference(), 4.0), FRICTION)


def test_friction_is_found_again_from_a_start_that_is_half_off() -> None:
    fit = servo_fit()
    assert fit.converged
    assert not fit.undetermined
    for name, value in truth(reference(), FRICTION).items():
        assert fit.values[name] == pytest.approx(value, rel=0.01), name
    assert fit.statistics["rms.position"] == pytest.approx(1e-6, rel=0.05)
    assert fit.statistics["rms.pressure_a"] == pytest.approx(200.0, rel=0.05)


def test_three_ways_to_an_interval_agree_where_the_model_is_right() -> None:
    fit = servo_fit()
    name = "friction.coulomb"
    lower, upper = fit.intervals[name]
    drawn = intervals_of_draws(fit.free, drive_bootstrap(fit.profiler.args[0], 300, 0))
    for other in (fit.profile([name])[name], drawn[name]):
        assert other[1] - other[0] == pytest.approx(upper - lower, rel=0.35)
        assert other[0] < fit.values[name] < other[1]
    assert np.all(np.linalg.eigvalsh(fit.correlation) > -1e-9)


def test_values_of_a_stick_slip_motion_are_found() -> None:
    drive = reference()
    run = pn.simulate(
        drive, [(0.0, 0.0016)], 6.0, initial="position = 50 mm, pressure_a = 3 bar abs, pressure_b = 3 bar abs"
    )
    cols = recorded(run, 0, 1e-6, 200.0)
    free = ["friction.coulomb", "friction.breakaway", "friction.stribeck_velocity"]
    known = {"friction.viscous": "40 N s/m", "friction.bristle_stiffness": "1e5 N/m"}
    start = off(drive, 1.5).replace(known)
    fit = pn.identify(start, cols, free)
    assert fit.converged
    for name, value in truth(drive, free).items():
        assert fit.values[name] == pytest.approx(value, rel=0.01), name


def test_two_recordings_with_offsets_of_their_own_share_the_drive() -> None:
    table = {k: v for k, v in reference().friction.to_dict().items() if k != "law"}
    drive = reference().replace({"friction": {"law": "elasto-plastic", **table}})
    records, offsets = [], [(1e-3, 3e3), (-5e-4, -2e3)]
    for i, (ox, oa) in enumerate(offsets):
        cols = servo(drive, 3.0, amplitude=(0.1, 0.2)[i], frequency=(0.5, 0.8)[i], noise=(5e-6, 500.0), seed=i)
        records.append({**cols, "position_m": cols["position_m"] + ox, "pressure_a_pa": cols["pressure_a_pa"] + oa})
    free = ["cylinder.dead_volume.a", "cylinder.dead_volume.b", "cylinder.heat_transfer", "cylinder.moving_mass"]
    free += ["friction.coulomb"]
    start = drive.replace({"cylinder.dead_volume": {"a": "15 cm3", "b": "7 cm3"}, "friction.coulomb": "24 N"})
    start = start.replace({"cylinder.heat_transfer": "45 W/(m2 K)", "cylinder.moving_mass": "2.6 kg"})
    sensors = {"position": {"offset": "free", "offset_uncertainty": "1 mm"}, "pressure_a": {"offset": "free"}}
    fit = pn.identify(start, records, free, sensors=sensors)
    assert fit.converged
    for name, value in truth(drive, free).items():
        lower, upper = fit.intervals[name]
        assert fit.values[name] == pytest.approx(value, rel=0.1), name
        assert lower - (upper - lower) < value < upper + (upper - lower), name
    for i, (ox, oa) in enumerate(offsets):
        assert fit.sensors[f"position.offset [recording {i + 1}]"] == pytest.approx(ox, abs=3e-4)
        assert fit.sensors[f"pressure_a.offset [recording {i + 1}]"] == pytest.approx(oa, abs=100.0)
    assert fit.recordings == ("recording 1", "recording 2")


def test_lag_and_gain_of_a_sensor_are_found() -> None:
    cols = servo(reference(), 2.0)
    late = lagged(cols["time_s"], servo(reference(), 2.0, noise=(0.0, 0.0))["pressure_a_pa"], 6e-3)
    cols["pressure_a_pa"] = 1.02 * late + 200.0 * np.random.default_rng(5).standard_normal(late.size)
    sensors = {"pressure_a": {"lag": "free", "gain": "free"}}
    fit = pn.identify(reference(), cols, ["friction.coulomb"], sensors=sensors)
    assert fit.sensors["pressure_a.lag"] == pytest.approx(6e-3, rel=0.02)
    assert fit.sensors["pressure_a.gain"] == pytest.approx(1.02, rel=1e-3)
    assert fit.values["friction.coulomb"] == pytest.approx(30.0, rel=1e-3)


def test_lag_of_a_ramp_is_the_ramp_late_by_its_time_constant() -> None:
    time = np.array([0.0, 0.1, 0.15, 0.4, 1.0])
    assert lagged(time, 3.0 * time, 0.2) == pytest.approx(3.0 * (time - 0.2))
    even = np.linspace(0.0, 1.0, 101)
    assert lagged(even, 3.0 * even, 0.2) == pytest.approx(3.0 * (even - 0.2))


def test_what_cannot_be_told_apart_is_named_with_a_remedy_and_not_applied() -> None:
    free = ["cylinder.moving_mass", "load.mass", "friction.coulomb"]
    start = reference().replace({"load.mass": "0.5 kg", "cylinder.moving_mass": "1.6 kg", "friction.coulomb": "27 N"})
    fit = pn.identify(start, servo(reference(), 2.0), free)
    lost = {u.parameter: u for u in fit.undetermined}
    assert set(lost) == {"cylinder.moving_mass", "load.mass"}
    assert "load.mass" in lost["cylinder.moving_mass"].reason
    assert "weigh" in lost["load.mass"].remedy
    assert fit.values["cylinder.moving_mass"] + fit.values["load.mass"] == pytest.approx(2.0, rel=1e-3)
    applied = fit.apply()
    assert applied.cylinder.moving_mass_kg == 1.6
    assert applied.friction.parameters["coulomb"] == pytest.approx(30.0, rel=1e-3)


def test_bristle_damping_is_held_where_the_encoder_does_not_see_the_bristles() -> None:
    free = ["friction.coulomb", "friction.bristle_damping"]
    sensors = {"position": {"resolution": "100 um"}}
    fit = pn.identify(reference(), servo(reference(), 2.0), free, sensors=sensors)
    assert tuple(fit.values) == ("friction.coulomb",)
    assert "a tenth" in fit.undetermined[0].reason
    assert any("held at 300" in note for note in fit.notes)


def test_a_search_that_is_interrupted_keeps_the_best_so_far() -> None:
    def stop(done: float, _total: float, _task: str) -> None:
        if done > 1:
            raise KeyboardInterrupt

    fit = pn.identify(off(reference(), 1.5), servo(reference(), 2.0), FRICTION, progress=stop)
    assert (fit.converged, fit.undetermined, len(fit.notes)) == (False, (), 2)  # interrupted, and without intervals
    assert any("interrupted" in note for note in fit.notes)
    assert abs(fit.values["friction.coulomb"] - 30.0) < 5.0


def test_presliding_gives_the_stiffness_of_the_law_that_made_the_loop(tmp_path: Path) -> None:
    from pneudrive.identify.dynamic.fit import _simulated_loop

    table = {k: v for k, v in reference().friction.to_dict().items() if k != "law"}
    drive = reference().replace({"friction": {"law": "elasto-plastic", **table}})
    loops = []
    for speed in (1e-3, 3e-3):
        time, position, friction = _simulated_loop(drive, 1e5, 45.0, speed)
        loops.append({"time_s": time, "position_m": position, "friction_n": friction})
    start = drive.replace({"friction.bristle_stiffness": "4e5 N/m"})
    found = pn.identify_presliding(start, loops)
    assert found.values["friction.bristle_stiffness"] == pytest.approx(1e5, rel=0.03)
    each = [column.measured for column in found.fitted.values()]
    assert (len(each[0]), found.statistics["reversals"]) == (6, 6.0)
    reach = [0.5 * (high - low) for low, high in found.intervals.values()]  # 2.5706: Student, 5 degrees of freedom
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(np.std(each, axis=1, ddof=1) / np.sqrt(6.0))
    assert reach == pytest.approx(2.5706 * np.sqrt(np.diag(found.covariance)), rel=1e-4)
    assert found.statistics["breakaway_n"] == pytest.approx(45.0, rel=0.01)
    found.to_toml(tmp_path / "fit.toml")
    read = read_fit(tmp_path / "fit.toml")
    assert str(read) == str(found)
    after = read.apply(start)
    assert after.friction.parameters["bristle_stiffness"] == pytest.approx(1e5, rel=0.03)
    assert set(after.provenance) == set(found.determined)
    name = "friction.bristle_stiffness"
    assert found.profile([name]) == {name: found.intervals[name]}


def test_bounds_of_states_that_no_channel_measures() -> None:
    """From simulated ones on: 80 K, 2 bar and four deflections of 30 N / 1e5 N/m, but at least 20 % of a pressure."""
    record = servo(reference(), 0.2, amplitude=1e-3)
    del record["pressure_b_pa"]
    (one,) = pn.identify(reference(), record, ["friction.coulomb"]).profiler.args[0].problem.experiments
    (lower, upper), still = one.limits, 293.15
    assert one.hidden.tolist() == [False, False, False, True, True, True, True]
    assert np.isinf([lower[:3], upper[:3]]).all()
    assert [upper[3], lower[5]] == pytest.approx([still + 80.0, still - 80.0], abs=0.1)
    assert upper[4] == pytest.approx(101300.0 + 2e5, rel=0.01)
    assert [lower[4], lower[6]] == pytest.approx([0.2 * 101300.0, -4.0 * 30.0 / 1e5], rel=1e-3)


def test_wrong_input_gets_one_message() -> None:
    cols = servo(reference(), 0.3)
    with pytest.raises(FitError, match=r"friction\.columb is not a number of this drive") as error:
        pn.identify(reference(), cols, ["friction.columb"])
    assert "friction.coulomb" in str(error.value)
    with pytest.raises(FitError, match=r"sensor pressure_a\.noise"):
        pn.identify(reference(), cols, ["friction.coulomb"], sensors={"pressure_a": {"noise": "1 mm"}})
    with pytest.raises(FitError, match="a sensor is described for velocity"):
        pn.identify(reference(), cols, ["friction.coulomb"], sensors={"velocity": {}})
    with pytest.raises(FitError, match="no parameter is free"):
        pn.identify(reference(), cols, [])


def test_command_line_writes_a_fit(tmp_path) -> None:
    from pneudrive.cli.main import run

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        pn.save(pn.simulate(reference(), "0 s: 0.2, 0.3 s: -0.2", "0.6 s"), tmp_path / "run.parquet")
    arguments = ["identify", "catalogue:reference", str(tmp_path / "run.parquet"), "--free", "friction.viscous"]
    assert run([*arguments, "--sensor", "position: offset = free", "--out", str(tmp_path / "fit.toml")]) == 0
    written = tomllib.loads((tmp_path / "fit.toml").read_text())
    assert written["values"]["friction.viscous"]["value"] == pytest.approx(40.0, rel=1e-4)
    assert written["values"]["friction.viscous"]["sources"] == ["run"]


def test_a_pressure_that_was_sampled_less_often_counts_where_it_was() -> None:
    record = servo(reference(), 2.0)
    seldom = np.where(np.arange(record["time_s"].size) % 10 == 0, record["pressure_a_pa"], np.nan)
    start = reference().replace({"friction.coulomb": "22 N", "valve.conductance": "2.4 dm3/(s bar)"})
    fit = pn.identify(start, {**record, "pressure_a_pa": seldom}, ["friction.coulomb", "valve.conductance"])
    assert fit.values["friction.coulomb"] == pytest.approx(30.0, rel=1e-3)
    assert fit.values["valve.conductance"] == pytest.approx(2e-8, rel=1e-3)


def test_a_command_that_was_written_down_late_or_that_the_valve_follows_late_is_found() -> None:
    record = servo(reference(), 3.0)
    late = {**record, "command": np.r_[record["command"][:1], record["command"][:-1]]}
    early = {name: values[5:] for name, values in record.items()}
    early["command"] = np.r_[record["command"][8:], np.repeat(record["command"][-1], 3)]  # 3 ms before the valve
    free = ["friction.coulomb", "valve.conductance"]
    start = reference().replace({"friction.coulomb": "22 N", "valve.conductance": "2.4 dm3/(s bar)"})
    fit = pn.identify(start, [late, early], free, sensors={"command": {"delay": "free"}})
    assert fit.converged
    assert fit.sensors["command.delay [recording 1]"] == pytest.approx(-1e-3, abs=2e-5)
    assert fit.sensors["command.delay [recording 2]"] == pytest.approx(3e-3, abs=2e-5)
    assert fit.values["friction.coulomb"] == pytest.approx(30.0, rel=2e-3)
    known = pn.identify(start, early, free, sensors={"command": {"delay": "3 ms"}})
    assert known.values["friction.coulomb"] == pytest.approx(30.0, rel=2e-3)
    with pytest.raises(FitError, match="not a sensor"):
        pn.identify(start, early, free, sensors={"command": {"offset": "free"}})


def test_one_pressure_is_enough_from_near_values() -> None:
    run = pn.simulate(reference(), [(0.0, 0.1), (0.6, -0.15), (1.2, 0.2), (1.8, -0.1)], "2.4 s")
    record = recorded(run, 1, 5e-6, 500.0, ("position", "pressure_a"))
    start = reference().replace({"friction.coulomb": "27 N", "valve.conductance": "2.1 dm3/(s bar)"})
    fit = pn.identify(start, record, ["friction.coulomb", "valve.conductance"])
    assert fit.converged
    assert fit.values["friction.coulomb"] == pytest.approx(30.0, rel=2e-3)


def test_a_contact_ages_beyond_the_shortest_segment_and_a_valve_gets_its_conductance():
    """The starter drive stands in a stop for 0.5 s, and gives its valve by nominal flow."""
    drive = pn.Drive.load("catalogue:starter")
    run = pn.simulate(drive, "0 s: 0.4, 0.6 s: -0.5, 1.4 s: 0.3, 2.2 s: -0.2, 3 s: 0.6", "4 s")
    assert float(run.contact_age.max()) > 0.3
    record = recorded(run, 11, 1e-6, 200.0)
    fit = pn.identify(drive.replace({"friction.coulomb": "30 N"}), record, ["friction.coulomb", "valve.conductance"])
    assert fit.converged
    truth = drive.valve.conductance_m3_s_pa
    assert fit.values["valve.conductance"] == pytest.approx(truth, rel=1e-3)
    assert fit.values["friction.coulomb"] == pytest.approx(drive.friction.parameters["coulomb"], rel=1e-3)
    changed = fit.apply(drive)
    assert changed.valve.conductance_m3_s_pa == pytest.approx(truth, rel=1e-3)
    assert changed.valve.nominal_flow_m3_s_anr is None
    assert set(changed.provenance) == {"friction.coulomb", "valve.conductance"}


def test_numbers_of_a_circuit_are_found_from_values_of_a_data_sheet(tmp_path: Path) -> None:
    file = Path(__file__).parents[2] / "data/drive_with_tubes.toml"
    tables = tomllib.loads(file.read_text("utf-8"))
    tables["valve"] |= {"frequency": "80 Hz", "delay": "3 ms", "hysteresis": 0.01, "overlap": 0.02}
    circuit = pn.Circuit(**tables, load={"mass": "2 kg"})
    held = "cylinder.position = 100 mm, cylinder.a = 3 bar abs, cylinder.b = 3 bar abs"
    steps = [(0.25 * i, u) for i, u in enumerate([0.0, 0.4, -0.3, 0.15, -0.25, 0.6, -0.6, 0.1])]
    run = circuit.simulate(steps, "2 s", initial=held)
    rng = np.random.default_rng(0)
    for name, noise in (("cylinder.position", 5e-6), ("cylinder.a.pressure", 300.0), ("cylinder.b.pressure", 300.0)):
        run[name] = run[name] + noise * rng.standard_normal(run.sizes["time"])
    start = {"valve.frequency": "60 Hz", "valve.delay": "2.3 ms", "valve.overlap": 0.025, "valve.hysteresis": 0.013}
    start |= {"supply.pressure": "5.2 bar gauge", "cylinder.friction.coulomb": "33 N", "load.mass": "2.4 kg"}
    start |= {"cylinder.dead_volume_a": "18 cm3", "cylinder.dead_volume_b": "9 cm3"}
    fit = pn.identify(circuit.replace(start), run, list(start))
    assert (fit.converged, fit.determined) == (True, tuple(start))
    for name in start:
        lower, upper = fit.intervals[name]
        assert lower <= numbers_of(circuit)[name].value <= upper, name
    fit.to_toml(tmp_path / "fit.toml")
    valve = read_fit(tmp_path / "fit.toml").apply().components["valve"]
    assert valve.delay_s == pytest.approx(3e-3, rel=0.01)
    assert "95 % interval" in valve.to_dict()["frequency"]["note"]
    with pytest.raises(DescriptionError, match="cylinder: left, right"):
        pn.identify(pn.Circuit.load(Path(__file__).parents[3] / "examples/two_cylinders.toml"), run, ["left.bore"])


def test_a_delay_of_the_valve_with_an_interval_wider_than_itself_is_not_determined() -> None:
    circuit = reference().circuit.replace({"valve.frequency": "80 Hz", "valve.delay": "0.2 ms"})
    run = circuit.simulate([(0.0, 0.2), (0.3, -0.2), (0.6, 0.1)], "0.8 s", sample_rate="100 Hz")
    for name, noise in (("cylinder.position", 2e-4), ("cylinder.a.pressure", 2e4), ("cylinder.b.pressure", 2e4)):
        run[name] = run[name] + noise * np.random.default_rng(0).standard_normal(run.sizes["time"])
    fit = pn.identify(circuit, run, ["valve.delay", "cylinder.friction.coulomb"])
    assert [u.parameter for u in fit.undetermined] == ["valve.delay"]


@pytest.mark.parametrize(("name", "start"), [("cylinder.leakage", "0.01 dm3/(s bar)"), ("load.mass", "1 kg")])
def test_what_is_next_to_nothing_is_found_and_applied(name, start):
    """The recordings determine it well, though not as a share of itself: the start value must not stay."""
    unit = start.partition(" ")[2]
    truth = reference().replace({name: f"0 {unit}"})
    run = servo(truth, 3.0, noise=(5e-6, 500.0))
    begun = truth.replace({name: start})
    fit = pn.identify(begun, run, free=[name, "friction.coulomb"])
    guess = next(p.value for p in numbers_of(begun).values() if p.name == name)
    low, high = fit.intervals[name]
    assert not fit.undetermined
    assert 0.0 <= low < 1e-3 * guess
    assert high < 0.02 * guess
    applied = next((p.value for p in numbers_of(fit.apply()).values() if p.name == name), 0.0)
    assert applied < 0.02 * guess


def test_pressures_that_were_not_recorded_stay_above_zero():
    run = servo(reference(), 2.0)
    alone = {name: run[name] for name in ("time_s", "command", "position_m")}
    fit = pn.identify(reference(), alone, free=["friction.coulomb"])
    assert np.isfinite(fit.values["friction.coulomb"])
    assert fit.converged or any("record the chamber pressures" in note for note in fit.notes)
