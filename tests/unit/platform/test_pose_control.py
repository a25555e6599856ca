"""Control of a pose: inverse dynamics, preview of the legs, rejected paths, a run with its score."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from oracle import platforms
from pneudrive import _core
from pneudrive.cli.main import run as command
from pneudrive.control import loop, motion
from pneudrive.control.pose.legs import check_path, demands, leg_circuit, leg_reference, leg_tunings
from pneudrive.control.setup import read_setup
from pneudrive.describe.system import System
from pneudrive.errors import CommandError, DescriptionError

TRIPOD = Path(__file__).parents[3] / "examples" / "controlled_tripod.toml"
CIRCLE = {"heave": "450 mm", "tilt_1": "circle 5 deg 1 Hz", "tilt_2": "circle 5 deg 1 Hz"}


@pytest.fixture(scope="module")
def tripod():
    return pn.Circuit.load(TRIPOD)


@pytest.mark.parametrize("kind", ["platform/3-rps", "platform/6-ups", "platform/linear-delta"])
def test_inverse_dynamics_give_the_accelerations_of_multipliers(kind):
    """Forces from the inverse dynamics, in a solver with other coordinates, give the accelerations back."""
    rng = np.random.default_rng(3)
    machine = platforms.random_machine(kind, rng)
    core = _core.Circuit(json.dumps(platforms.circuit(machine)))
    own = core.platforms[0]
    for _ in range(10):
        place, turn, rates = platforms.random_state(machine, rng)
        x, v = machine.positions(place, turn), machine.leg_rates(place, turn, rates)
        q, _ = own.locate(x[None])
        jacobian = own.evaluate(q, np.zeros_like(q))["jacobian"][0]
        platform = pn.platforms.Platform.__new__(pn.platforms.Platform)
        platform.core, platform.name = own, own.name
        platform.coordinates, platform.legs = tuple(own.coordinates), tuple(own.legs)
        turned = np.array([unit == "rad" for unit in platform.units])
        angle = np.where(turned, 2.0 * np.arcsin(np.where(turned, q[0], 0.0)), q[0])
        u = np.linalg.solve(jacobian, v)
        slopes = np.where(turned, 0.5 * np.cos(0.5 * angle), 1.0)
        second = rng.uniform(-5.0, 5.0, len(x))
        found = platform.dynamics(angle, u / slopes, second)
        expected = machine.accelerations(place, turn, rates, found.forces_n[0])[1]
        assert np.allclose(found.accelerations_m_s2[0], expected, rtol=1e-8, atol=1e-8)


def test_the_reference_of_a_leg_is_the_inverse_of_the_path(tripod):
    platform = pn.platform(tripod)
    path = pn.control.pose_path({**CIRCLE, "heave": "450 mm; 0.5 s: 470 mm in 0.4 s"}, platform)
    needs = demands(platform, path, 2.0)
    times = np.linspace(0.0, 2.0, 1501)
    exact = platform.inverse(path.at(times)[0])
    for leg in range(3):
        reference, efforts = leg_reference(needs, leg, "path")
        assert np.abs(reference.at(times)[:, 0] - exact[:, leg]).max() < 2e-8
        rates = np.gradient(np.array(efforts["rows"])[:, 1], efforts["period_s"])
        assert np.allclose(rates, np.array(efforts["rows"])[:, 2], atol=0.5)


def test_a_constant_preview_leaves_the_bits_of_an_axis():
    """Mass and load of the model, told at each time, change no bit of any controller."""
    axis = pn.Circuit.load(TRIPOD.with_name("controlled_axis.toml"))
    along = motion.Reference("a move", 0.25, pieces=tuple(motion.blended(0.05, 0.2, 0.25, 0.26)))
    for law in pn.control.laws():
        prepared = loop.prepare(axis, law, along, mismatch="mass+30", duration=0.4)
        columns = []
        for efforts in (None, {"period_s": 0.01, "rows": [[2.0, 0.0, 0.0]] * 60}):
            forms = prepared.tuning.core(), along.core() | {"efforts": efforts}, prepared.setup.core(1, 101325.0)
            axes = [tuple(json.dumps(form) for form in forms)]
            circuit = System(prepared.core_json).compiled()
            (own,), _, _ = _core.control_run(circuit, prepared.start, axes, [], 0.4, 1e-5)
            columns.append(own)
        for name in ("position_m", "command", "disturbance_n"):
            assert np.array_equal(columns[0][name], columns[1][name]), (law, name)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ({"heave": "sine 110 mm 0.5 Hz around 450 mm"}, r"a position of .* mm at t = .* s from leg_1.*mm outside"),
        ({"heave": "sine 30 mm 14 Hz around 450 mm"}, r"a (velocity|force) of .* at t = .* s from leg_\d.*outside"),
        ("R1", r'"R1" is not a reference of a platform.*a TOML file'),
        ({"heave": "440 mm; 0.1 s: 460 mm in 24 ms"}, r"a force of .* N at t = .* s from leg_\d.* N outside"),
    ],
)
def test_a_path_that_a_leg_cannot_follow_is_rejected(tripod, path, words):
    with pytest.raises(pn.PneudriveError) as error:
        pn.control.run_pose(tripod, reference=path)
    assert re.search(words, str(error.value), re.DOTALL), str(error.value)


def test_a_path_near_a_singular_pose_is_rejected(tripod):
    platform = pn.platform(tripod)
    needs = demands(platform, pn.control.pose_path(CIRCLE, platform), 1.0)
    tunings = leg_tunings(tripod, platform, needs, "pid", read_setup("ideal")[0])
    with pytest.raises(CommandError, match=r"nearly singular pose at t = .* s"):
        check_path(platform, tunings, needs._replace(singular_values=0.01 * needs.singular_values))
    quick = demands(platform, pn.control.pose_path({"heave": "sine 95 mm 3 Hz around 450 mm"}, platform), 1.0)
    assert 0.65 < check_path(platform, tunings, quick)["speed_share"] < 1.0  # accepted within its limits


def test_a_path_in_the_wrong_unit_names_file_line_and_remedy(tripod, tmp_path):
    file = tmp_path / "path.toml"
    file.write_text('schema = 1\nheave = "450 mm"\ntilt_1 = "sine 5 mm 1 Hz"\n', encoding="utf-8")
    with pytest.raises(DescriptionError) as error:
        pn.control.run_pose(tripod, reference=file)
    assert all(part in str(error.value) for part in (f"{file}:3", "tilt_1", "circle 5 deg 0.5 Hz"))


def test_circles_and_squares_are_closed_and_moves_repeat(tripod):
    platform = pn.platform(tripod)
    round_ = pn.control.pose_path(CIRCLE, platform).at(np.array([2.0, 2.25, 2.5, 2.9]))[0]
    assert np.allclose(np.hypot(round_[:, 1], round_[:, 2]), np.radians(5.0))
    square = {"tilt_1": "square 4 deg 0.5 Hz in 0.3 s", "tilt_2": "square 4 deg 0.5 Hz in 0.3 s"}
    corners = pn.control.pose_path(square, platform).at(np.array([2.45, 2.95, 3.45, 3.95]))[0]
    assert np.allclose(np.degrees(corners[:, 1:]), [[4.0, -4.0], [4.0, 4.0], [-4.0, 4.0], [-4.0, -4.0]])
    picks = "450 mm; 0.1 s: 430 mm in 0.2 s; 0.5 s: 450 mm in 0.2 s; every 1 s"
    own = pn.control.pose_path({"heave": picks}, platform)
    assert np.allclose(own.at(np.array([0.4, 3.4, 3.9]))[0][:, 0], [0.43, 0.43, 0.45])
    assert own.period_s == 1.0


def test_a_leg_is_an_axis_of_its_own_on_a_shared_tank():
    text = TRIPOD.read_text("utf-8")
    for i in (1, 2, 3):
        text = text.replace(f'"mains -> valve_{i}.1"', f'"tank -> valve_{i}.1"')
    text = text.replace("connections = [", 'connections = [\n    "mains -> inlet -> tank",')
    text += '[components.tank]\nkind = "tank"\nvolume = "1 l"\n'
    text += '[components.inlet]\nkind = "fitting"\nconductance = "8 dm3/(s bar)"\ncritical_pressure_ratio = 0.4\n'
    circuit = pn.Circuit.load(text)
    own = leg_circuit(circuit, pn.platform(circuit), 1, 2.4, -25.0)
    assert set(own.components) == {"mains", "inlet", "tank", "valve_2", "leg_2", "leg_2_load"}


def test_a_run_follows_a_circle_and_scores_payloads(tripod):
    run = pn.control.run_pose(tripod, "nmpc", reference=CIRCLE, duration="3 s", payload=["0 kg", "2 kg"])
    score = run.attrs["score"]
    assert score["stops_hit"] == 0
    assert not run.attrs["events"]
    errors = [score["coordinates"][key]["rmse"] for key in ("tilt_1", "tilt_2")]
    assert max(errors) < 0.005 * np.radians(5.0)
    off = run["tripod.tilt_1_reference"] - run["tripod.tilt_1"]
    assert np.isclose(np.sqrt(np.mean(off.to_numpy()[1:] ** 2)), errors[0], rtol=0.5)
    assert set(score["payload_spread"]) == {"0 kg", "2 kg"}
    assert score["air_per_cycle_anr_m3"] == pytest.approx(score["air_anr_m3_s"], rel=1e-9)


def test_zeros_of_pressure_sensors_act_on_both_chambers_of_a_leg_as_a_narrow_range_does(tripod):
    zeros = [pn.control.Mismatch(pressure_zero=zero) for zero in ("20 kPa", "20 kPa .. 20.001 kPa")]
    options = {"reference": CIRCLE, "duration": "0.2 s", "setup": "ideal"}  # noise would hide the zeros
    runs = (pn.control.run_pose(tripod, "pid", mismatch=zero, **options) for zero in zeros)
    assert np.allclose(*(run["leg_1.b.pressure"].to_numpy() for run in runs), rtol=1e-5)


def test_strongly_coupled_legs_are_told_and_follow_by_inversion():
    """A linear delta, in which 60 % of the force of a carriage acts on each other one."""
    text = TRIPOD.read_text("utf-8").replace('"platform/3-rps"', '"platform/linear-delta"')
    text = text.replace('length = "350 mm"', 'length = "400 mm"').replace('radius = "200 mm"', 'radius = "60 mm"')
    text = re.sub(r"(inertia|centre) = .*\n", "", text)
    circle = {"x": "circle 20 mm 1 Hz around 0 mm", "y": "circle 20 mm 1 Hz around 0 mm"}
    with pytest.warns(UserWarning, match=r"6\d % of the force of a leg of tripod acts on another leg"):
        pn.control.run_pose(pn.Circuit.load(text), "pid", reference=circle, duration="0.01 s")
    run = pn.control.run_pose(pn.Circuit.load(text), reference=circle, duration="4 s")
    assert max(run.attrs["score"]["coordinates"][key]["rmse"] for key in "xy") < 0.02 * 0.02


@pytest.fixture(scope="module")
def hexapod():
    """Text of a heavy hexapod: in leg coordinates its inertia lies between 1.5 and 214 kg."""
    rows = [f'"mains -> valve_{i}.1", "valve_{i}.4 -> leg_{i}.a", "valve_{i}.2 -> leg_{i}.b"' for i in (4, 5, 6)]
    rows += [f'"leg_{i}.rod -> tripod.{i}"' for i in (4, 5, 6)]
    text = TRIPOD.read_text("utf-8").replace("connections = [", f"connections = [{', '.join(rows)},")
    for name in ("valve", "leg"):
        text = text.replace(f'"{name}_3"]', f'"{name}_3", "{name}_4", "{name}_5", "{name}_6"]')
    angles = 'mass = "20 kg"\nbase_angle = "20 deg"\nplatform_angle = "20 deg"'
    return text.replace("3-rps", "6-ups").replace('mass = "6 kg"', angles)


@pytest.mark.parametrize("other", [{}, {"payload": "4 kg"}, {"mismatch": pn.control.Mismatch(delay="1.2 ms")}])
def test_controllers_that_share_the_inertia_hold_a_heavy_hexapod(hexapod, other):
    run = pn.control.run_pose(pn.Circuit.load(hexapod), reference={"z": "sine 20 mm 0.5 Hz"}, duration="2 s", **other)
    assert run.attrs["law"] == "inversion"
    assert not run.attrs["events"]
    for key, own in run.attrs["score"]["coordinates"].items():
        assert own["max_error"] < (2e-3 if key in "xyz" else np.radians(1.0)), key


def test_a_platform_that_loses_its_pose_is_a_failure(hexapod, tmp_path, capsys):
    """Controllers of single legs do not hold it."""
    (tmp_path / "hexapod.toml").write_text(hexapod)
    (tmp_path / "path.toml").write_text('z = "sine 20 mm 0.5 Hz"')
    words = ["control", "run", str(tmp_path / "hexapod.toml"), "--reference", str(tmp_path / "path.toml")]
    assert command([*words, "--law", "nmpc", "--duration", "2 s"]) == 1
    said = re.search(r"Lost: .* up to (.*) mm from", capsys.readouterr().out)
    assert 20.0 < float(said[1]) < 1e3 * 0.2
