"""Half the sum of both directions against pressure gives effective area and force zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from oracle.recordings import AMBIENT, make_recording
from pneudrive.characterise import characterise_recordings, write_map
from pneudrive.friction.campaign.characteristics import recorded_characteristics
from pneudrive.friction.characterisation import fit_closures, fit_pressure_lines, run_spread
from pneudrive.identify.static.fit import fit_characterisation, fit_file, fit_friction
from pneudrive.web.measured.friction import drawn_map


def test_area_error_and_force_zero_are_found(make):
    recordings = [
        make(friction=4.0 + p / 1e5, gauge_b=p, swing=0.04e5, area_error=0.02, zero=1.0, seed=i, name=f"{p:g}",
             stroke_spread=0.1, labels={"seal": "lip"})
        for i, p in enumerate((1e5, 2e5, 3e5, 5e5, 7e5))
    ]  # fmt: skip
    (fit,) = characterise_recordings(recordings).closures
    area = fit.areas_m2["b"]
    truth = 1.02 * fit.nominal_m2["b"]
    assert area.value == pytest.approx(truth, rel=0.005)
    assert area.low <= truth <= area.high
    assert area.low > fit.nominal_m2["b"], "an error of 2 % is seen"
    assert fit.force_zero_n.value == pytest.approx(1.0, abs=0.2)
    assert fit.force_zero_n.low <= 1.0 <= fit.force_zero_n.high
    assert fit.group == "lip"
    assert "not separable" in fit.statement


def test_area_of_chamber_a_has_its_own_sign(make):
    (fit,) = both(make, [(1e5, 0), (3e5, 0), (5e5, 0)]).closures
    assert list(fit.areas_m2) == ["a"]
    assert fit.areas_m2["a"].value == pytest.approx(1.02 * fit.nominal_m2["a"], rel=0.002)


def test_a_pressure_in_the_wrong_chamber_is_noticed(make):
    made = [make(gauge_b=p, seed=i, name=f"{p:g}") for i, p in enumerate((1e5, 3e5, 5e5))]
    swapped = [replace(r, pressure_a_pa=r.pressure_b_pa, pressure_b_pa=r.pressure_a_pa) for r in made]
    assert "probably wrong in the layout" in characterise_recordings(swapped).closures[0].statement
    assert "probably wrong" not in characterise_recordings(made).closures[0].statement


def test_one_pressure_says_nothing_about_the_area(make):
    found = characterise_recordings([make(seed=1), make(seed=2, name="b")])
    assert found.closures == ()
    assert any("cannot be determined" in note for note in found.notes)


def test_two_points_have_no_interval(make):
    (fit,) = characterise_recordings([make(gauge_b=1e5), make(gauge_b=5e5, name="b")]).closures
    assert fit.degrees_of_freedom == 0
    assert fit.areas_m2["b"].high == float("inf")
    assert "no interval" in fit.statement


def both(make, pairs, area_b=1.0, sensor=0.0):
    """Make recordings with gauge pressures (a, b); the true areas are 1.02 times what the recording says.

    ``sensor`` is the standard deviation of each recording's error of pressure, Pa.
    """
    recordings = []
    for i, (a, b) in enumerate(pairs):
        error = np.random.default_rng(i).normal(0.0, sensor, 2)
        made = make(gauge_b=0.0, seed=i, name=f"{a:g}/{b:g}")
        area_a, area_b_m2 = made.area_a_m2, made.area_b_m2 * area_b
        recordings.append(
            replace(
                made,
                pressure_a_pa=made.pressure_a_pa + a + error[0],
                pressure_b_pa=made.pressure_b_pa + b + error[1],
                area_b_m2=area_b_m2,
                force_n=made.force_n + 1.0 + 1.02 * (b * area_b_m2 - a * area_a),
            )
        )
    return characterise_recordings(recordings)


def test_both_areas_are_found_where_the_pressures_change_apart(make):
    (fit,) = both(make, [(0, 0), (2e5, 0), (0, 2e5), (4e5, 1e5), (1e5, 4e5)]).closures
    for side in ("a", "b"):
        assert fit.areas_m2[side].value == pytest.approx(1.02 * fit.nominal_m2[side], rel=0.002)
    assert fit.force_zero_n.value == pytest.approx(1.0, abs=0.1)


def test_pressures_that_change_together_give_the_net_area_or_nothing(make):
    equal = [(p, p) for p in (1e5, 2e5, 4e5, 6e5)]
    assert both(make, equal).closures == (), "on equal areas equal pressures cancel"
    found = both(make, equal, area_b=0.8)
    (fit,) = found.closures
    assert "neither area by itself" in fit.statement
    area_a, area_b = found.recordings[0].area_a_m2, found.recordings[0].area_b_m2
    assert fit.nominal_m2 == pytest.approx({"net": area_a - area_b})
    assert fit.areas_m2["net"].value == pytest.approx(1.02 * (area_a - area_b), rel=0.005)


@pytest.mark.parametrize("area_b", [1.0, 0.98])
def test_what_is_left_of_opposed_pressures_is_not_taken_for_a_signal_where_it_is_noise(make, area_b):
    # On noise alone the factor falls to zero: an area of -100 % with a narrow interval.
    found = both(make, [(p, p) for p in np.linspace(0.5e5, 7e5, 15)], area_b=area_b, sensor=0.05e5)
    assert found.closures == ()
    assert any("cannot be determined" in note for note in found.notes)


@pytest.mark.parametrize(("per_speed", "per_bar2", "words"), [(20.0, 0.0, "with speed"), (0.0, 0.1, "recordings")])
def test_offsets_that_no_zero_explains_leave_the_zero_open(per_speed, per_bar2, words):
    noise = iter(0.01 * np.random.default_rng(1).standard_normal(9))
    gauges, speeds = (0.0, 2e5, 4e5), (0.001, 0.01, 0.1)
    cases = [(p, v, 1.0 - per_speed * v + per_bar2 * (p / 1e5) ** 2 + next(noise)) for p in gauges for v in speeds]
    table = pl.DataFrame(cases, ("gauge_b_pa", "speed_m_s", "offset_n"), orient="row")
    known = dict.fromkeys(("weight_n", "gauge_a_pa", "u_a_pa", "u_b_pa", "area_a_m2"), 0.0) | {"area_b_m2": 5e-4}
    (fit,) = fit_closures(table.with_columns(recording=pl.col("gauge_b_pa").cast(str), seal=pl.lit(""), **known))
    assert not fit.has_interval
    assert words in fit.statement


# --- Friction against pressure per seal; the prediction interval knows the spread between runs.

COLUMNS = ("seal", "run", "pressure_pa", "speed_m_s", "friction_n", "speed_stderr_m_s")


def points(seal: str, runs: int, spread: float, rng: np.random.Generator, speed: float = 0.01) -> pl.DataFrame:
    def at(bar: int) -> float:
        return (3 + bar) * (1 + spread * rng.normal())

    rows = [(seal, str(run), bar * 1e5, speed, at(bar), 0.0) for run in range(runs) for bar in (1, 3, 5, 7)]
    return pl.DataFrame(rows, COLUMNS, orient="row")


def test_pooled_relative_spread_is_recovered():
    spread = run_spread(pl.concat(points(s, 3, 0.2, np.random.default_rng(ord(s))) for s in "abcdefgh"))
    assert spread.relative == pytest.approx(0.2, rel=0.2)
    assert spread.degrees_of_freedom == 8 * 4 * 2


def test_nothing_run_twice_is_said():
    rng = np.random.default_rng(1)
    assert run_spread(points("a", 1, 0.2, rng)) is None
    (line,) = fit_pressure_lines(points("a", 1, 0.02, rng))
    assert line.basis == "unknown"
    assert "too narrow" in line.statement


def test_a_further_run_falls_into_the_band_in_about_95_of_100():
    inside = total = 0
    for seed in range(50):
        rng = np.random.default_rng(seed)
        (line,) = fit_pressure_lines(points("a", 2, 0.2, rng))
        assert line.basis == "own"
        for pressure, friction in points("a", 1, 0.2, rng).select("pressure_pa", "friction_n").iter_rows():
            low = np.interp(pressure, line.band_pressure_pa, line.band_low_n)
            top = np.interp(pressure, line.band_pressure_pa, line.band_high_n)
            inside += low <= friction <= top
            total += 1
    assert 0.88 <= inside / total <= 0.995


def test_a_seal_with_one_run_borrows_the_spread_of_the_others():
    rng = np.random.default_rng(5)
    both = pl.concat([points("a", 4, 0.2, rng), points("b", 1, 0.0, rng)])
    lines = {line.seal: line for line in fit_pressure_lines(both)}
    half = (lines["b"].band_high_n - lines["b"].band_low_n) / 2
    assert lines["b"].basis == "pooled"
    assert (half >= 1.9 * 0.12 * lines["b"].band_mean_n).all()
    assert lines["b"].intercept_n == pytest.approx(3.0)
    assert lines["b"].slope_n_pa * 1e5 == pytest.approx(1.0)


def test_speed_and_pressure_that_change_together_from_level_to_level_are_confounded(make):
    names = ("position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
    recordings = []
    for seed in range(2):
        slow, fast = (make(gauge_b=p, speed=v, seed=seed, name=f"{seed}") for p, v in ((1e5, 0.005), (5e5, 0.02)))
        columns = {name: np.r_[getattr(slow, name), getattr(fast, name)] for name in names}
        recordings.append(replace(slow, time_s=np.r_[slow.time_s, slow.time_s[-1] + 0.01 + fast.time_s], **columns))
    notes = characterise_recordings(recordings).notes
    assert any("rises as pressure rises (correlation +1.00" in note for note in notes)


def test_confounded_speed_is_said():
    rng = np.random.default_rng(2)
    fast = points("a", 2, 0.1, rng).with_columns(speed_m_s=0.015 - pl.col("pressure_pa") * 1e-8)
    (line,) = fit_pressure_lines(fast)
    assert "speed falls with pressure (correlation -1.00)" in line.statement


def test_crossed_speeds_get_a_line_each():
    rng = np.random.default_rng(2)
    lines = fit_pressure_lines(pl.concat([points("a", 1, 0.0, rng, 0.01), points("a", 1, 0.0, rng, 0.1)]))
    assert [line.seal for line in lines] == ["a at 10 mm/s", "a at 100 mm/s"]


def test_a_speed_that_was_held_neither_falls_nor_rises_with_pressure(make):
    held = zip((149.9995e-3, 149.9954e-3, 150.0031e-3), (0.0, 2e5, 1e5), strict=True)
    recordings = [
        make(name=f"{p:g}", friction=5 + p * 1e-5, gauge_b=p, speed=v, travel=0.3, rate=1000.0, seed=int(p) + 1)
        for v, p in held
    ]
    found = characterise_recordings(recordings)
    said = [*found.notes, found.pressure_lines[0].statement, *fit_friction(found.friction_map, "coulomb").notes]
    assert not [note for note in said if "speed" in note.lower() and "pressure" in note]
    assert found.pressure_lines[0].slope_n_pa * 1e5 == pytest.approx(1.0, abs=0.05)


# --- Recordings are a campaign without a plan: curves, effects and sentences, and two seals never share a curve.

COULOMB_N = {"lip": 5.0, "cup": 9.0}
RISE_N_BAR = {"lip": 1.0, "cup": 2.0}
SPEEDS_M_S = (0.005, 0.015, 0.04, 0.1)


def friction_n(seal: str, speed_m_s, bar: float):
    return COULOMB_N[seal] * (1.0 + 0.5 * np.exp(-((speed_m_s / 0.02) ** 2))) + RISE_N_BAR[seal] * bar + 30 * speed_m_s


@pytest.fixture(scope="module")
def found():

    cases = [(s, run, p, v) for s in COULOMB_N for run in "12" for p in (1.0, 3.0) for v in SPEEDS_M_S]
    recordings = []
    for i, (seal, run, bar, v) in enumerate(cases):
        about = {"seed": i, "name": f"{seal}{run}-{bar:g}-{v:g}", "labels": {"seal": seal, "run": run}}
        moved = {"gauge_b": bar * 1e5, "speed": v, "rate": v * 2.5e5, "strokes": 4, "window_m": (0.012, 0.028)}
        recordings.append(make_recording(friction=friction_n(seal, v, bar), **moved, **about))
    return characterise_recordings(recordings)


def test_each_seal_has_its_own_curves_with_the_truth_in_their_bands(found):
    curves = [c for c in recorded_characteristics(found).curves if c.direction == 0]
    assert sorted({c.condition.seal for c in curves}) == ["cup", "lip"]
    assert len(curves) == 4
    for c in curves:
        truth = friction_n(c.condition.seal, c.speed_m_s, (c.condition.pressure_b_pa - AMBIENT) / 1e5)
        assert np.mean((c.low_n <= truth) & (truth <= c.high_n)) >= 0.9
        assert c.friction_n == pytest.approx(truth, rel=0.06)
        assert c.cycles.sum() == 8


def test_effects_and_sentences_are_those_of_a_campaign(found):
    result = recorded_characteristics(found)
    rise = {effect.levels: effect.means["b"].value * 1e5 for effect in result.pressure}
    assert rise == pytest.approx(RISE_N_BAR, abs=0.1)
    assert {pattern.levels for pattern in result.position} == set(RISE_N_BAR)  # each seal has its own pattern
    said = [statement.text for statement in result.statements]
    assert any(text.startswith("No speed was repeated in a known order") for text in said)
    assert any(text.startswith("A cycle repeats within") for text in said)
    assert result.friction_map is found.friction_map


def test_no_fit_is_over_both_seals_and_the_page_draws_each_by_its_own(found, tmp_path):
    fits, problems = fit_characterisation(found)
    assert not problems
    assert sorted(fits) == ["cup", "lip"]
    for seal, by_law in fits.items():
        by_law["stribeck"].to_toml(tmp_path / fit_file(seal))
    path = write_map(found.friction_map, tmp_path / "map.parquet")
    groups = drawn_map(path)["groups"]
    assert [group["label"].partition(":")[0] for group in groups] == ["lip", "lip", "cup", "cup"]
    for group in groups:
        bar = group["gauges"][1] / 1e5
        speed = np.array(group["curve"]["x"])
        truth = friction_n(group["assembly"], speed, bar)
        assert group["curve"]["y"] == pytest.approx(truth, rel=0.06)
    one = drawn_map(path, "fit-cup.toml")["groups"]
    assert ["curve" in group for group in one] == [False, False, True, True]
    mixed = drawn_map(path, "own.toml")
    assert not any("curve" in group for group in mixed["groups"])
    assert "several seals" in mixed["fit"]
