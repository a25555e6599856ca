"""Uncertainty: spread between strokes, trend, the GUM budget, and U that covers the truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pneudrive.characterise import characterise_recordings, read_map
from pneudrive.friction.bins import pair_stderr, profile_stderr, spread_of
from pneudrive.friction.campaign.characteristics import recorded_characteristics
from pneudrive.friction.characterisation import _differences
from pneudrive.friction.strokes import StrokeUse


def test_spread_of_independent_strokes_is_the_textbook_standard_error():
    values = np.random.default_rng(3).normal(5.0, 0.3, 12)
    spread = spread_of(values)
    assert spread.stderr_n == pytest.approx(values.std(ddof=1) / np.sqrt(12))
    assert not spread.has_trend


def test_a_drift_is_found_and_leaves_fewer_independent_strokes():
    values = 5.0 + 0.1 * np.arange(10) + np.random.default_rng(4).normal(0.0, 0.05, 10)
    spread = spread_of(values)
    assert spread.has_trend
    assert spread.effective < 5
    assert spread.stderr_n > values.std(ddof=1) / np.sqrt(10)


def test_one_stroke_takes_the_other_direction_s_spread():
    up, down = spread_of(np.array([5.0])), spread_of(np.array([-5.0, -5.2, -4.8]))
    both = np.array([(s.deviation_n, s.effective) for s in (up, down)])
    assert pair_stderr(*both.T[:, None])[0] == pytest.approx(0.5 * np.sqrt(0.2**2 + 0.2**2 / 3))


def test_stroke_spread_and_not_samples_set_the_standard_error(make):
    level = characterise_recordings(make(stroke_spread=0.3, strokes=20, noise=0.05, seed=5)).levels[0]
    expected = 0.5 * np.sqrt(2 * 0.3**2 / 10)
    naive = 0.05 / np.sqrt(level.rows[0]["samples"])
    assert level.stderr_n == pytest.approx(expected, rel=0.5)
    assert level.stderr_n > 10 * naive


def test_u_covers_the_truth_in_about_95_of_100(make):
    covered = 0
    for seed in range(30):
        level = characterise_recordings(
            make(stroke_spread=0.3, strokes=20, seed=seed, accuracy={"force_n": 1e-6, "pressure_b_pa": 1e-3})
        ).levels[0]
        covered += abs(level.friction_n - 5.0) <= level.expanded_n
    # Expected 28.5 less the few per cent that 10 strokes a direction cost at k = 2; 22 has a chance below 1e-3.
    assert 24 <= covered <= 30


def test_profile_stderr_counts_correlated_bins_as_fewer():
    rng = np.random.default_rng(7)
    white = rng.normal(0.0, 1.0, 100)
    assert profile_stderr(white) == pytest.approx(0.1, rel=0.35)
    slow = np.convolve(rng.normal(0.0, 1.0, 109), np.ones(10), "valid") / np.sqrt(10)
    assert profile_stderr(slow) > 2 * profile_stderr(white)


@pytest.mark.parametrize("is_stated", [True, False])
def test_each_line_of_the_budget_is_what_its_error_does_to_half_difference_and_half_sum(make, is_stated):
    """By hand: 5 N of friction, 6 bar in chamber b that swing by 0.2 bar with the direction, a bore of 25 mm."""
    area, swing_pa, gauge_pa = np.pi / 4 * 0.025**2, 2e4, 6e5
    half, whole = 5.0 + swing_pa * area, gauge_pa * area  # of the force
    u_pa, u_n, bore = 5e3, 1.0, 5e-5 / 0.025
    accuracy = {"pressure_b_pa": u_pa, "force_n": u_n, "bore_m": 5e-5}
    if not is_stated:  # 0.5 % of 10 bar, 0.2 % of the largest force, 0.2 % of the bore
        u_pa, u_n, bore, accuracy = 5e3 / np.sqrt(3), 2e-3 * (half + whole) / np.sqrt(3), 2e-3, {}
    made = make(gauge_b=gauge_pa, swing=swing_pa, noise=0.0, position_noise=0.0, accuracy=accuracy)
    (level,) = characterise_recordings(made).levels
    lines = {entry.source: entry for entry in level.budget}
    turned = 1.0 / (3.0 * np.sqrt(2.0))  # a third of the accuracy, independent in the two directions
    expected = {
        "pressure b: common error": (u_pa * area * swing_pa / 1e6, u_pa * area),
        "pressure b: hysteresis": (u_pa * area * turned, u_pa * area * turned),
        "force: common error": (u_n * half / (half + whole), u_n),
        "force: hysteresis": (u_n * turned, u_n * turned),
        "bore (area)": (2.0 * bore * swing_pa * area, 2.0 * bore * whole),
        "alignment of the force axis": (
            (1.0 - np.cos(np.radians(1.0))) * half,
            (1.0 - np.cos(np.radians(1.0))) * whole,
        ),
    }
    found = {name: (lines[name].friction_n, lines[name].offset_n) for name in expected}
    for name, numbers in expected.items():
        assert found[name] == pytest.approx(numbers, rel=2e-3), name
    bases = [lines[name].basis for name in ("pressure b: common error", "force: common error", "bore (area)")]
    assert (set(bases), lines["alignment of the force axis"].basis) == (
        {"layout" if is_stated else "assumed"},
        "assumed",
    )
    total = np.sqrt(sum(entry.friction_n**2 for entry in level.budget))
    assert level.u_systematic_n == pytest.approx(total)
    assert level.expanded_n == pytest.approx(2 * np.hypot(level.stderr_n, total))


def test_what_is_assumed_is_said(make):
    notes = characterise_recordings(make()).notes
    assert any(note.startswith("Assumed") and "bore" in note and "hysteresis" in note for note in notes)


def test_wrong_area_and_zero_leave_friction_within_its_u(make):
    for gauge in (1e5, 3e5, 5e5, 7e5):
        level = characterise_recordings(
            make(friction=4.0, gauge_b=gauge, swing=0.04e5, area_error=0.02, zero=1.0, stroke_spread=0.05)
        ).levels[0]
        assert abs(level.friction_n - 4.0) <= level.expanded_n


def test_two_strokes_that_agree_by_chance_keep_the_error_of_their_noise(make):
    deviations, stated = [], []
    for seed in range(20):
        level = characterise_recordings(make(strokes=4, noise=0.3, rate=500.0, seed=seed)).levels[0]
        deviations.append(level.friction_n - 5.0)
        stated.append(level.stderr_n)
    noise = np.std(deviations)
    assert min(stated) > 0.5 * noise, "the spread of two stroke means alone would be ten times too small now and then"
    assert np.median(stated) == pytest.approx(noise, rel=0.4)


def test_friction_that_varies_over_position_makes_the_choice_of_the_window_uncertain(make):
    def entry(slope, window):
        recording = make(friction=lambda x: 5.0 * (1.0 + slope * (x - 0.02)), window_m=window)
        (found,) = (
            e for e in characterise_recordings(recording).levels[0].budget if e.source == "choice of the window"
        )
        return found.friction_n

    whole, half = (0.002, 0.038), (0.01, 0.03)
    assert entry(0.0, half) < 0.02
    # The deviation of a straight line over a length L is slope * L / sqrt(12); half of the travel is not seen.
    assert entry(20.0, half) == pytest.approx(100.0 * 0.02 / np.sqrt(12) * (1 - 0.5 * 0.95), rel=0.1)
    assert entry(20.0, whole) < 0.6 * entry(20.0, half)


@pytest.mark.parametrize(
    ("gauges", "is_said"), [((0.0, 3e5), True), ((3e5, 0.0), True), ((0.0, 0.0), False), ((2e5, 3e5), False)]
)
def test_one_side_is_under_pressure_only_if_the_other_one_is_not(make, gauges, is_said):
    """A sensor that never changes may be that of a vented chamber, or of one at constant pressure."""
    made = make(gauge_b=gauges[1])
    recording = replace(made, pressure_a_pa=np.full(len(made), made.ambient_pressure_pa + gauges[0]))
    notes = characterise_recordings(recording).notes
    assert any("one side is under pressure" in note for note in notes) == is_said


def test_a_cycle_has_the_scatter_of_its_strokes_as_a_speed_level_has(make):
    found = characterise_recordings(make(stroke_spread=0.3, strokes=20, seed=5))
    (level,), (cycle,) = found.levels, recorded_characteristics(found).cycles.iter_rows(named=True)
    assert cycle["stderr_n"] == pytest.approx(level.stderr_n, rel=1e-6)


# --- A stroke that does not enter the result is counted, and its reason stands in notes, map, terminal and report.

CHANNELS = ("position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
WINDOW_M = (0.015, 0.030)
LAYOUT = (Path(__file__).parents[3] / "data/window_layout.toml").read_text("utf-8")


@pytest.fixture
def partial(make):
    """Return a recording of ten whole strokes and six short ones; the last one damaged in the window of one stroke."""
    whole, short = make(strokes=10), make(strokes=6, travel=0.012, seed=2)
    joined = {c: np.concatenate([getattr(whole, c), getattr(short, c)]) for c in CHANNELS}
    time = np.concatenate([whole.time_s, short.time_s + whole.time_s[-1] + 0.01])
    lost = (time > 4.7) & (time < 7.6)  # settled samples of the second stroke, which returns through the window
    joined["force_n"][lost] = np.nan
    return replace(whole, time_s=time, **joined, window_m=WINDOW_M, name="partial")


def test_strokes_that_miss_the_window_are_counted_with_their_reason(partial):
    found = characterise_recordings(partial)
    use = found.stroke_uses["partial"]
    assert (use.recorded, use.used) == (16, 9)
    assert use.left_out == {"window": 6, "unsettled": 1}
    assert any(
        note == "partial: 9 of 16 strokes are used; not used: 6 that cross less than a quarter of the window, "
        "1 with too few settled samples in the window."
        for note in found.notes
    )
    rows = found.friction_map
    assert rows["strokes"].to_numpy().tolist() == [5, 4]
    assert rows["strokes_recorded"].to_numpy().tolist() == [8, 8]
    assert rows["friction_n"].to_numpy() == pytest.approx(5.0, abs=0.1)


def test_a_recording_whose_strokes_all_count_has_no_note(make):
    found = characterise_recordings(make(window_m=WINDOW_M))
    assert found.stroke_uses["made"] == StrokeUse(10, {})
    assert not any("strokes are used" in note for note in found.notes)


def test_terminal_map_and_report_say_the_same(partial, tmp_path, printed, undrawn):
    columns = np.column_stack([partial.time_s, *(getattr(partial, c) for c in ("position_m", "force_n"))])
    columns = np.column_stack([columns, partial.pressure_b_pa])
    head = "time_s,position_m,force_n,pressure_b_pa"
    np.savetxt(tmp_path / "partial.csv", columns, delimiter=",", header=head, comments="")
    (tmp_path / "layout.toml").write_text(LAYOUT)
    out = tmp_path / "out"
    said = " ".join(printed(["characterise", tmp_path / "partial.csv", "--out", out]).split())
    assert "9 of 16" in said
    assert "6 that cross less than a quarter of the window" in said
    assert read_map(out / "map.csv")["strokes_recorded"].to_numpy().tolist() == [8, 8]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "9 of 16 strokes are used" in page
    assert "6 that cross less than a quarter of the window" in page


@pytest.mark.parametrize(("off", "is_said"), [(0.0726, False), (0.2, True)])
def test_the_largest_of_several_differences_needs_more_than_the_u_of_one(off, is_said):
    """Two recordings of one truth, at four speeds in both directions: one of the differences exceeds its own U."""

    def recorded(name, *friction):
        same = {"recording": name, "gauge_pa": {"a": 0.0, "b": 0.0}, "seal": "", "sides": (1, -1), "budget": ()}
        pairs = enumerate(friction, 1)
        return SimpleNamespace(
            levels=[SimpleNamespace(**same, friction_n=one, stderr_n=0.0255, speed_m_s=0.02 * k) for k, one in pairs]
        )

    notes = _differences((recorded("first", 32.6, 28.4, 28.05, 31.0), recorded("again", 32.6, 28.4, 28.05 - off, 31.0)))
    assert bool(notes) == is_said
    assert all("difference of 0.2 N, 0.71 %" in note and "95 % for 8 comparisons" in note for note in notes)
