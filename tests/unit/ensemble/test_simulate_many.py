"""Members of an ensemble: each is the single drive to the last bit, whatever runs beside it."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pneudrive as pn
from pneudrive import ensemble
from pneudrive.errors import Cancelled, CommandError, PneudriveWarning, SimulationError

DRIVE = pn.Drive.load("catalogue:reference")
COMMAND, DURATION = "0 s: 1, 0.06 s: -1", "0.1 s"
VARY = {
    "cylinder.bore": "uniform(20 mm, 30 mm)",
    "cylinder.stroke": "uniform(200 mm, 400 mm)",
    "friction.coulomb": "lognormal(30 N, 10 %)",
    "ambient.temperature": "triangular(0 degC, 20 degC, 40 degC)",
    "supply.pressure": "normal(6 bar gauge, 0.2 bar)",
    "initial.pressure_b": "uniform(1.2 bar abs, 2 bar abs)",
}
UNITS = {"cylinder.bore": "m", "cylinder.stroke": "m", "friction.coulomb": "N", "ambient.temperature": "K"}


def single(many, k, **options):
    """Simulate member k by itself, from what the data set says of it."""
    changes = {name: f"{float(many[name][k])!r} {unit}" for name, unit in UNITS.items()}
    changes["supply.pressure"] = f"{float(many['supply.pressure'][k])!r} Pa abs"
    initial = {"pressure_b": f"{float(many['initial.pressure_b'][k])!r} Pa abs"}
    return pn.simulate(DRIVE.replace(changes), COMMAND, DURATION, initial=initial, **options)


@pytest.fixture(scope="module")
def many():
    outputs = [
        *("final(position)", "final(temperature_a)", "samples(velocity, 100 Hz)", "max(velocity)", "min(pressure_b)"),
        *("mean(position)", "integral(velocity)", "time_when(position > 0.2 m)", "settling(velocity, 0.05 m/s)"),
        ensemble.own(lambda seen, t: seen["velocity"] @ np.gradient(t), ["velocity"], "way", unit="m"),
    ]
    return pn.simulate_many(DRIVE, COMMAND, DURATION, vary=VARY, n=40, outputs=outputs, seed=7)


def test_a_member_is_the_single_drive_to_the_last_bit(many):
    for k in (0, 17, 39):
        alone = single(many, k, sample_rate="100 Hz")
        assert alone.position[-1].item() == many.final_position[k].item()
        assert alone.temperature_a[-1].item() == many.final_temperature_a[k].item()
        np.testing.assert_array_equal(alone.velocity, many.velocity[k])


def test_reductions_are_those_of_the_trajectory(many):
    for k in (3, 20):
        fine = single(many, k, sample_rate="20 kHz")
        t, x, v = fine.time.values, fine.position.values, fine.velocity.values
        assert many.max_velocity[k].item() == pytest.approx(v.max(), rel=1e-4)
        assert many.min_pressure_b[k].item() == pytest.approx(fine.pressure_b.values.min(), rel=1e-4)
        assert many.mean_position[k].item() == pytest.approx(np.trapezoid(x, t) / t[-1], rel=1e-6)
        assert many.integral_velocity[k].item() == pytest.approx(x[-1] - x[0], abs=1e-6)
        assert many.integral_velocity.attrs["units"] == "m"
        assert many.way[k].item() == pytest.approx(x[-1] - x[0], abs=2e-3)
        passed = np.flatnonzero(x > 0.2)
        at = t[passed[0]] if passed.size else np.nan
        assert many.time_position_above[k].item() == pytest.approx(at, abs=6e-5, nan_ok=True)
        away = np.flatnonzero(np.abs(v - v[-1]) > 0.05)
        assert many.settling_time_velocity[k].item() == pytest.approx(t[away[-1]], abs=1e-3)


def test_order_and_chunks_do_not_matter(many):
    rows = {name: many[name].values for name in VARY}
    turned = {name: values[::-1].copy() for name, values in rows.items()}
    again = pn.simulate_many(
        DRIVE, COMMAND, DURATION, vary=turned, outputs=["final(position)", "max(velocity)"], threads=1
    )
    np.testing.assert_array_equal(again.final_position[::-1], many.final_position)
    np.testing.assert_array_equal(again.max_velocity[::-1], many.max_velocity)
    parts = pn.simulate_many(
        DRIVE, COMMAND, DURATION, vary=VARY, n=40, outputs="max(velocity)", seed=7, out=None, chunk=7
    )
    np.testing.assert_array_equal(parts.max_velocity, many.max_velocity)
    np.testing.assert_array_equal(parts["friction.coulomb"], many["friction.coulomb"])


def test_the_default_is_the_state_at_the_end_and_the_stroke_time():
    vary = {"cylinder.stroke": ["100 mm", "150 mm"]}
    out = pn.simulate_many(DRIVE, 1.0, "0.1 s", vary=vary, initial={"position": "20 mm"})
    assert {"final_position", "final_pressure_a", "final_temperature_b", "stroke_time", "status"} <= set(out.data_vars)
    fine = pn.simulate(
        DRIVE.replace({"cylinder.stroke": "150 mm"}), 1.0, "0.1 s", initial="position = 20 mm", sample_rate="20 kHz"
    )
    assert out.stroke_time[1].item() == pytest.approx(fine.time[fine.position > 0.15][0].item(), abs=6e-5)
    assert out.stroke_time[0] < out.stroke_time[1]
    for variable in out.variables.values():
        assert "long_name" in variable.attrs
    assert out.final_pressure_a.attrs["units"] == "Pa"
    assert out["cylinder.stroke"].attrs["units"] == "m"
    assert out.attrs["description_hash"] == DRIVE.description_hash
    json.dumps(out.attrs["vary"])


def test_a_member_that_fails_costs_the_others_nothing():
    vary = {"load.force": ["0 N", "1e6 N"], "initial.position": ["100 mm", "100 mm"]}
    options = {"vary": vary, "outputs": ["final(position)", "samples(velocity, 100 Hz)"]}
    with pytest.warns(PneudriveWarning, match="1 of 2 members failed"):
        out = pn.simulate_many(DRIVE, -1.0, "0.1 s", **options)
    assert out.status.values.tolist() == [0, 1]
    assert out.reason.values[0] == ""
    assert "the cover of chamber b" in out.reason.values[1]
    assert np.isnan(out.final_position[1])
    assert np.isnan(out.velocity[1]).all()
    alone = pn.simulate(DRIVE, -1.0, "0.1 s", initial="position = 100 mm")
    assert out.final_position[0].item() == alone.position[-1].item()


def test_more_members_than_memory_holds_are_in_the_folder_alone(tmp_path):
    options = {"vary": {"load.force": ["0 N", "1e6 N", "10 N"]}, "outputs": ["final(position)"], "chunk": 2}
    with pytest.raises(CommandError, match="max_members_in_memory"):
        pn.simulate_many(DRIVE, 1.0, "2 ms", max_members_in_memory=2, **options)
    for _ in range(2):  # the second time nothing is left to run
        with pytest.warns(PneudriveWarning, match="1 of 3 members failed"):
            out = pn.simulate_many(DRIVE, 1.0, "2 ms", max_members_in_memory=2, out=tmp_path / "study", **options)
        assert out.sizes["member"] == 0
        assert out.attrs["statistics"] == {"members": 3, "failed": 1}
    with pytest.warns(PneudriveWarning, match="1 of 3 members failed"):
        whole = pn.simulate_many(DRIVE, 1.0, "2 ms", out=tmp_path / "study", **options)
    assert whole.status.values.tolist() == [0, 1, 0]
    assert "cover of chamber b" in whole.reason.values[1]


def test_a_drive_with_tubes_is_varied_by_their_numbers():
    tubes = {"tubing": {"a": {"length": "1 m", "diameter": "6 mm"}, "b": {"length": "1 m", "diameter": "6 mm"}}}
    drive = DRIVE.replace(tubes)
    vary = {"tubing.a.length": ["0.5 m", "2 m"], "cylinder.stroke": ["300 mm", "400 mm"]}
    out = pn.simulate_many(drive, 1.0, "0.05 s", vary=vary, outputs=["final(position)"])
    alone = pn.simulate(drive.replace({"tubing.a.length": "2 m", "cylinder.stroke": "400 mm"}), 1.0, "0.05 s")
    assert out.final_position[1].item() == alone.position[-1].item()


def test_a_function_that_fails_is_named():
    bad = ensemble.own(lambda seen, t: t, ["velocity"], "wrong")
    with pytest.raises(SimulationError, match="output wrong: ValueError"):
        pn.simulate_many(DRIVE, 1.0, "0.01 s", vary={"load.mass": [0.0, 1.0]}, outputs=[bad])


def test_a_cancelled_study_ends():
    class Flag:
        def is_set(self):
            return True

    with pytest.raises(Cancelled):
        pn.simulate_many(DRIVE, 1.0, "0.01 s", vary={"load.mass": [0.0]}, cancel=Flag())


@pytest.mark.parametrize(
    ("vary", "n", "said"),
    [
        ({"cylinder.bor": [1.0]}, None, "cylinder.bor is not a number of this drive"),
        ({"cylinder.bore": [0.02], "load.mass": [1.0, 2.0]}, None, "unequal lengths"),
        ({"cylinder.bore": ["20 mm", "-3 mm", "5 mm"]}, None, "row 1 of the design"),
        ({"cylinder.bore": [0.02, np.nan]}, None, "row 1 of the design"),
        ({"friction.coulomb": "uniform(30 N, 300 N)"}, 64, "friction.breakaway"),
        ({"initial.position": ["800 mm"]}, None, "is outside the stroke"),
        ({"cylinder.bore": ["20 mm"], "load.mass": "uniform(1 kg, 2 kg)"}, 4, "mixes"),
        ({"cylinder.bore": "normal(20 mm, 1 kg)"}, 4, "cylinder.bore"),
        ({"cylinder.bore": "gauss(20 mm, 1 mm)"}, 4, "is not a distribution"),
        ({"cylinder.bore": "uniform(30 mm, 20 mm)"}, 4, "low < high"),
        ({"cylinder.bore": "uniform(20 mm, 30 mm)"}, None, "number of members is missing"),
        (
            {"ambient.pressure": ["1 bar abs"], "supply.pressure": ["6 bar gauge"]},
            None,
            "ambient pressure, which varies",
        ),
        ({"gas.gas_constant": [290.0]}, None, "gas"),
        ({"cylinder.bore": 0.02}, None, "cylinder.bore"),
        ({}, None, "vary is empty"),
    ],
)
def test_what_cannot_vary_is_refused_before_anything_runs(vary, n, said):
    with pytest.raises(CommandError) as told:
        pn.simulate_many(DRIVE, 1.0, "0.01 s", vary=vary, n=n)
    assert said in str(told.value)


@pytest.mark.parametrize(("key", "given"), [("n", 1.5), ("n", 0), ("seed", -1), ("chunk", 0), ("threads", "2")])
def test_a_count_is_a_whole_number_within_bounds(key, given):
    asked = {"vary": {"load.mass": "uniform(1 kg, 2 kg)"}, "n": 4} | {key: given}
    with pytest.raises(CommandError, match=rf"{key} = {given!r} is (not a whole number|out of bounds)"):
        pn.simulate_many(DRIVE, 1.0, "0.01 s", **asked)


@pytest.mark.parametrize(
    ("output", "said"),
    [
        ("final(positon)", "Did you mean 'position'"),
        ("median(position)", "is not an output"),
        ("final(position, velocity)", "has 2 arguments"),
        ("time_when(position)", "is not a condition"),
        ("time_when(pressure_a > 2 bar gauge)", "an absolute pressure"),
        ("time_when(position > 2 kg)", "a length is needed"),
    ],
)
def test_outputs_that_mean_nothing_are_refused(output, said):
    with pytest.raises(CommandError) as told:
        pn.simulate_many(DRIVE, 1.0, "0.01 s", vary={"load.mass": [0.0]}, outputs=[output])
    assert said in str(told.value)


def test_an_output_does_not_take_a_name_of_the_result():
    for name in ("status", "reason", "member", "load.mass"):
        with pytest.raises(CommandError, match=f'the name "{name}" is already used'):
            pn.simulate_many(DRIVE, 1.0, "1 ms", vary={"load.mass": ["1 kg"]}, outputs=[f"{name} = max(velocity)"])
    outputs = ["samples(position)", "time = max(velocity)"]
    with pytest.raises(CommandError, match='the name "time" is already used'):
        pn.simulate_many(DRIVE, 1.0, "1 ms", vary={"load.mass": ["1 kg"]}, outputs=outputs)


def test_a_band_of_settling_is_a_difference():
    outputs = ["a = settling(temperature_a, 5 degC)", "b = settling(temperature_a, 5 K)"]
    found = pn.simulate_many(DRIVE, 1.0, "0.3 s", vary={"load.mass": ["1 kg"]}, outputs=outputs)
    assert found.a[0].item() == found.b[0].item() > 0.0
