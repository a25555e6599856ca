"""Real recordings: friction in the window against an extraction by another route, and what is known of them.

The other route finds no strokes and forms no profiles: the work of the force balance around the whole record,
between the window's ends, is friction times the path; the offset's work cancels over as many strokes out as back.
"""

import lzma
from pathlib import Path

import numpy as np
import pytest

from oracle.held_out import held_out
from pneudrive.characterise import SourcePaper, characterise_recordings
from pneudrive.identify.static.fit import row_seals_and_runs
from pneudrive.identify.static.survey import survey

DATA = Path(__file__).resolve().parents[2] / "data" / "measurements" / "zillen-2021-pneumatic-piston"
FILES = sorted([*DATA.glob("friction/*.csv.xz"), *DATA.glob("repeatability/*.csv.xz")])
WINDOW_MM = (5.0, 30.0)


@pytest.fixture(scope="module")
def found():
    return characterise_recordings(FILES)


def friction_from_work(path: Path) -> float:
    """Work of the balance over the window, per path travelled there, N."""
    with lzma.open(path, "rt") as file:
        table = np.loadtxt(file)[15:]
    bore = 25.7e-3 if "257" in path.name else 25.0e-3
    balance = table[:, 6] - table[:, 5] * 1e5 * np.pi / 4 * bore**2
    position = table[:, 4]
    inside = np.clip(position, *WINDOW_MM)
    work = np.sum((balance[1:] + balance[:-1]) / 2 * np.diff(inside))
    side = np.sign((position >= WINDOW_MM[1]) * 1.0 - (position <= WINDOW_MM[0]))
    passages = np.diff(side[side != 0])
    out, back = np.sum(passages > 0), np.sum(passages < 0)
    assert out == back, "the offset's work cancels only over as many strokes out as back"
    return float(work / ((out + back) * (WINDOW_MM[1] - WINDOW_MM[0])))


def test_all_recordings_are_there():
    assert len(FILES) == 30


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.name.split(".csv")[0])
def test_friction_agrees_with_the_work_around_the_record(found, path):
    level = {level.recording: level for level in found.levels}[path.name.removesuffix(".csv.xz")]
    expected = friction_from_work(path)
    # The bar is 5 % or 0.3 N. Both routes see the same samples and agree far better.
    assert level.friction_n == pytest.approx(expected, rel=0.002)


def test_ten_strokes_each_way_at_the_stated_speeds(found):
    for level in found.levels:
        assert [row["strokes"] for row in level.rows] == [10, 10], level.recording
        out, back = (row["velocity_m_s"] for row in level.rows)
        assert 5e-3 < out < 14.5e-3, level.recording
        assert 11e-3 < -back < 15.5e-3, level.recording


def test_the_offset_exceeds_the_friction_where_the_piston_is_not_round(found):
    larger = {level.recording for level in found.levels if abs(level.offset_n) > level.friction_n}
    assert larger == {f"Kidney_lc_{bar}bar" for bar in (4, 5, 6, 7)}
    level = next(level for level in found.levels if level.recording == "Kidney_lc_7bar")
    offset = level.profile.offset_n[level.profile.in_window]
    assert offset[0] - offset[-1] > level.friction_n, "and it changes along the stroke by more than the friction"
    friction = level.profile.friction_n[level.profile.in_window]
    assert np.ptp(friction) < 5.0, "which the pairing survives"


def test_two_runs_of_one_seal_differ_by_15_to_35_percent(found):
    differences = {cell[0]: [] for cell in found.run_spread.cells}
    for seal, _, low, high, _ in found.run_spread.cells:
        differences[seal].append((high - low) / ((high + low) / 2))
    assert len(differences["O-ring257"]) == 4
    assert all(0.14 < d < 0.35 for d in differences["O-ring257"])


def test_the_prediction_band_is_wider_than_the_spread_between_runs(found):
    for line in found.pressure_lines:
        half = (line.band_high_n - line.band_low_n) / 2
        assert (half > 1.9 * found.run_spread.relative * np.abs(line.band_mean_n)).all(), line.seal


def test_u_is_not_the_naive_error_of_samples(found):
    for level in found.levels:
        profile = level.profile
        scatter = np.nanstd(profile.up_strokes_n[:, profile.in_window] - profile.up_n[profile.in_window])
        naive = scatter / np.sqrt(level.rows[0]["samples"])
        assert level.stderr_n > naive, level.recording
        assert 0.05 < level.expanded_n < 2.0, level.recording


def test_breakaway_peaks_are_called_spoiled(found):
    peaks = [peak for level in found.levels for peak in level.peaks]
    assert len(peaks) == 30 * 19
    spoiled = [peak for peak in peaks if {"undersampled", "pressure_transient"} & set(peak.flags)]
    assert len(spoiled) > 0.9 * len(peaks)


def test_no_stick_slip_at_these_speeds(found):
    assert not any("stick_slip" in level.flags for level in found.levels)


def test_gaps_are_counted(found):
    gaps = {r.name: r.flags.get("gap", 0) for r in found.recordings}
    assert gaps["Kidney_lc_4bar"] > 0
    assert gaps["Kidney_lc_2bar"] == 0


def test_source_paper_protocol_is_close_where_friction_is_even(found):
    seals = ("NAPN_1bar", "NAPN_3bar", "O-ring_1bar", "PK_1bar", "PK_3bar")
    paper = characterise_recordings([p for p in FILES if p.name.startswith(seals)], protocol=SourcePaper())
    settled = {level.recording: level.friction_n for level in found.levels}
    for level in paper.levels:
        assert level.friction_n == pytest.approx(settled[level.recording], rel=0.1)


@pytest.fixture(scope="module")
def left_out(found):
    seals, runs = row_seals_and_runs(found)

    def leave(**how):
        return held_out(found.friction_map, seals, runs, **how)

    return leave


def half_widths(values):
    return np.array([(v.upper_n - v.lower_n) / 2 / v.friction_n for v in values])


def test_left_out_pressures_lie_in_their_prediction_interval(left_out):
    values = left_out(by="pressure")
    assert len(values) == 30, "every pressure of every seal"
    assert np.mean([v.is_inside for v in values]) >= 0.8
    errors = np.array([v.error for v in values])
    assert np.sqrt(np.mean(errors**2)) < 0.17, "quoted in docs/theory/fit.md"
    # an interval of 90 % of what scatters by 15 % has a half width of 25 %: not wider by more than what it cannot know
    assert np.median(half_widths(values)) < 2.0 * np.sqrt(np.mean(errors**2))


def test_an_unseen_run_lies_in_its_prediction_interval(left_out):
    values = left_out(by="run")
    pairs = [v for v in values if v.seal == "O-ring257" or v.gauge_b_pa == pytest.approx(2e5, rel=0.1)]
    assert len(pairs) == 10, "five pressures at which a seal was run twice, either run unseen"
    assert sum(v.is_inside for v in pairs) >= 8
    assert np.median(half_widths(pairs)) < 0.6


def test_an_unseen_run_of_either_direction_lies_in_its_prediction_interval(left_out):
    values = [v for d in (1, -1) for v in left_out(by="run", direction=d) if v.seal == "O-ring257"]
    assert len(values) == 16, "four pressures, two runs, two directions"
    assert sum(v.is_inside for v in values) >= 12


def test_what_the_seals_share_is_said(found):
    said = " ".join(survey(found.friction_map, *row_seals_and_runs(found)).statements())
    assert "scatter by" in said
    assert "2 repeated runs" in said
    assert "O-ring: as many parameters as recordings" in said
