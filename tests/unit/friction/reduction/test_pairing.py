"""Friction is half the difference of both directions at equal position; the offset is half the sum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.characterise import SourcePaper, characterise, characterise_recordings, read_map, write_map
from pneudrive.errors import CommandError, RecordingError
from pneudrive.signals.motion import Stroke, speed_levels
from pneudrive.signals.recording import CHANNELS


def test_an_offset_larger_than_friction_that_changes_along_the_stroke_drops_out(make):
    recording = make(friction=5.0, offset=lambda x: 30.0 - 900.0 * x)
    level = characterise_recordings(recording).levels[0]
    assert level.friction_n == pytest.approx(5.0, abs=0.02)
    assert level.offset_n == pytest.approx(30.0 - 900.0 * 0.02, abs=0.05)
    profile = level.profile
    inside = profile.in_window
    assert profile.offset_n[inside] == pytest.approx(30.0 - 900.0 * profile.position_m[inside], abs=0.15)
    assert profile.friction_n[inside] == pytest.approx(5.0, abs=0.15)


def test_friction_that_changes_along_the_stroke_is_resolved(make):
    recording = make(friction=lambda x: 5.0 + 50.0 * x, noise=0.02)
    level = characterise_recordings(recording).levels[0]
    inside = level.profile.in_window
    assert level.profile.friction_n[inside] == pytest.approx(5.0 + 50.0 * level.profile.position_m[inside], abs=0.06)


def test_friction_is_positive_against_the_motion_and_velocity_has_the_direction_s_sign(make):
    curves = characterise(make(friction=5.0))
    assert curves.direction.to_numpy().tolist() == [1, -1]
    assert curves.velocity_m_s.to_numpy() == pytest.approx([0.01, -0.01], rel=1e-3)
    assert curves.balance_n.to_numpy() == pytest.approx([5.0, -5.0], abs=0.03)
    assert curves.friction_n.to_numpy() == pytest.approx([5.0, 5.0], abs=0.03)
    reversed_sign = characterise(make(friction=-5.0))
    assert reversed_sign.friction_n.to_numpy() == pytest.approx([-5.0, -5.0], abs=0.03)


def test_pressure_in_either_chamber_is_taken_out_with_its_sign(make):
    recording = make(friction=5.0, swing=0.05e5)
    # The same push, with the pressure in chamber a: the pressures change sides and the force its sign.
    push = (recording.pressure_b_pa - 101325.0) * recording.area_b_m2
    in_a = replace(
        recording,
        pressure_a_pa=recording.pressure_b_pa,
        pressure_b_pa=recording.pressure_a_pa,
        force_n=recording.force_n - 2 * push,
    )
    for case in (recording, in_a):
        level = characterise_recordings(case).levels[0]
        assert level.friction_n == pytest.approx(5.0, abs=0.03)
        assert level.offset_n == pytest.approx(0.0, abs=0.03)


def test_weight_and_inertia_of_the_mass_beyond_the_sensor_are_taken_out(make):
    recording = make(friction=5.0, zero=3.0 * 9.80665 * np.sin(0.3), mass_beyond_sensor_kg=3.0, incline_rad=0.3)
    level = characterise_recordings(recording).levels[0]
    assert level.offset_n == pytest.approx(0.0, abs=0.05)


def test_a_direction_without_partner_is_unpaired(make):
    recording = make(friction=5.0, offset=1.0, strokes=1)
    row = characterise(recording)
    assert row.sizes["row"] == 1
    assert row.friction_n.item() == pytest.approx(row.direction.item() * row.balance_n.item())
    assert row.friction_n.item() == pytest.approx(6.0, abs=0.05)
    assert "unpaired" in row.flags.item().split(",")
    assert np.isnan(row.offset_n.item())
    paired = characterise(make(friction=5.0, offset=1.0, strokes=2))
    assert row.u_systematic_n.item() > 2 * paired.u_systematic_n[0].item(), "nothing cancels in one direction alone"


def test_a_gap_in_one_stroke_does_not_shift_the_mean(make):
    recording = make(friction=lambda x: 2.0 + 200.0 * x, noise=0.0)
    lost = (recording.time_s > 5.0) & (recording.time_s < 6.0)
    cut = replace(
        recording,
        **{
            c: getattr(recording, c)[~lost]
            for c in ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
        },
    )
    level = characterise_recordings(cut).levels[0]
    assert "gap" in level.flags
    assert level.friction_n == pytest.approx(characterise_recordings(recording).levels[0].friction_n, abs=0.005)


def test_source_paper_protocol_keeps_what_the_settling_criterion_drops(make):
    recording = make(friction=5.0, presliding=2e-3, noise=0.0)
    settled = characterise_recordings(recording).levels[0]
    paper = characterise_recordings(recording, protocol=SourcePaper()).levels[0]
    assert settled.friction_n == pytest.approx(5.0, abs=0.01)
    # 5 % of 40 mm is one presliding length: the mean over the rest is short by 2 exp(-1) * 2 / 38 of friction.
    assert paper.friction_n == pytest.approx(5.0 * (1 - 2 * np.exp(-1) * 2e-3 / 38e-3), abs=0.03)
    assert characterise(recording, protocol=SourcePaper()).attrs["protocol"] == "source-paper"


def test_a_force_of_the_wrong_sign_is_noticed(make):
    recording = make(friction=5.0)
    found = characterise_recordings(replace(recording, force_n=-recording.force_n))
    assert "negative_friction" in found.levels[0].flags
    assert any("check the sign of the force" in note for note in found.notes)


def joined(parts):
    starts = np.cumsum([0.0, *(part.time_s[-1] + 0.01 for part in parts[:-1])])
    return replace(
        parts[0],
        time_s=np.concatenate([part.time_s + start for part, start in zip(parts, starts, strict=True)]),
        **{channel: np.concatenate([getattr(part, channel) for part in parts]) for channel in CHANNELS},
    )


@pytest.mark.parametrize(("slower", "is_mixed"), [((1.4, 0.7, 1.9), True), ((1.4, 1.42, 1.38), False)])
def test_speeds_without_order_share_a_row_and_a_flag(make, slower, is_mixed):
    """Returns at other speeds than the strokes before them, which no class of set speeds holds."""
    parts = [make(speed=0.02, strokes=2, seed=i, rate=400.0) for i in range(3)]
    back = np.arange(len(parts[0])) > len(parts[0]) / 2
    times = [np.cumsum(np.where(back, ratio, 1.0)) / 400.0 for ratio in slower]
    (level,) = characterise_recordings(joined([replace(p, time_s=t) for p, t in zip(parts, times, strict=True)])).levels
    assert ("mixed_speeds" in level.flags) == is_mixed
    assert level.friction_n == pytest.approx(5.0, abs=0.1)


def test_speed_levels_of_a_controlled_recording_are_separate_rows(make):
    curves = characterise(
        joined([make(friction=f, speed=v, strokes=4, rate=400.0) for f, v in ((5.0, 0.01), (7.0, 0.04))])
    )
    assert np.abs(curves.velocity_m_s.to_numpy()) == pytest.approx([0.01, 0.01, 0.04, 0.04], rel=0.01)
    assert curves.friction_n.to_numpy() == pytest.approx([5.0, 5.0, 7.0, 7.0], abs=0.05)


def strokes_at(speeds):
    return [Stroke(i, 1 - 2 * (i % 2), 0, 9, 0.0, 0.04, v * (1 - 2 * (i % 2)), 0.0) for i, v in enumerate(speeds)]


def test_a_speed_that_drifts_or_scatters_is_one_level():
    rng = np.random.default_rng(2)
    for _ in range(20):
        drifts = np.repeat(np.linspace(0.012, 0.009, 10), 2) * (1 + 0.01 * rng.standard_normal(20))
        scatters = 0.05 * (1 + 0.06 * rng.standard_normal(20))
        assert len(speed_levels(strokes_at(drifts))) == 1
        assert len(speed_levels(strokes_at(scatters))) == 1
        held = np.repeat(np.geomspace(1e-3, 0.45, 8), 6) * (1 + 0.003 * rng.standard_normal(48))
        assert [len(level) for level in speed_levels(strokes_at(held))] == [6] * 8


def test_identical_recordings_count_once(make):
    found = characterise_recordings([make(name="first"), make(name="again"), make(name="other", seed=2)])
    assert [r.name for r in found.recordings] == ["first", "other"]
    assert found.skipped == (("again", "identical to first"),)
    assert any("again" in note and "counted once" in note for note in found.notes)


def test_no_motion_and_too_few_samples_are_refused(make):
    with pytest.raises(RecordingError, match="no motion"):
        characterise(make(travel=1e-6))
    with pytest.raises(RecordingError, match="too few samples"):
        characterise(make(strokes=1, rate=3.0))
    with pytest.raises(RecordingError, match="no recording is given"):
        characterise([])


def test_a_window_outside_the_motion_is_refused(make):
    with pytest.raises(RecordingError, match="window lies outside"):
        characterise(make(window_m=(0.1, 0.2)))


@pytest.mark.parametrize("slope", [-1.0, 1.0])
def test_an_offset_that_runs_along_the_stroke_does_not_look_like_a_transient(make, slope):
    # From end to end it changes by six times the friction: one level per direction would never call a stroke settled.
    recording = make(friction=2.5, offset=lambda x: slope * (400.0 * x + 8.0 * np.sin(80.0 * x)))
    (level,) = characterise_recordings(recording).levels
    assert level.friction_n == pytest.approx(2.5, abs=0.05)
    assert "unpaired" not in level.flags
    assert [row["strokes"] for row in level.rows] == [5, 5]


def test_friction_that_varies_over_position_has_settled_where_it_is_low(make):
    recording = make(friction=lambda x: 10.0 - 150.0 * x)
    (level,) = characterise_recordings(recording).levels
    assert level.friction_n == pytest.approx(7.0, abs=0.05)
    profile = level.profile
    assert np.isfinite(profile.friction_n[profile.in_window]).all()


# --- The friction map: exactly the contract's columns, the same numbers back from its files.

CONTRACT = [
    *("recording", "direction", "velocity_m_s", "pressure_a_pa", "pressure_b_pa", "balance_n", "friction_n"),
    *("offset_n", "stderr_n", "u_systematic_n", "samples", "strokes", "strokes_recorded", "position_from_m"),
    *("position_to_m", "breakaway_n", "dwell_s", "loading_rate_n_s", "flags", "ambient_pressure_pa"),
]


def test_dataset_has_the_contract_s_variables_with_units(make):
    assert characterise is pn.characterise  # one function, also for the folder of a campaign
    curves = characterise([make(), make(name="b", seed=2)])
    assert list(curves.data_vars) == CONTRACT
    assert dict(curves.sizes) == {"row": 4}
    assert all("units" in curves[name].attrs for name in CONTRACT)
    assert curves.friction_n.attrs["units"] == "N"
    assert curves.attrs["ambient_pressure_pa"] == 101325.0


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_files_hold_the_same_columns_and_numbers(make, tmp_path, suffix):
    import polars as pl

    curves = characterise([make(), make(name="7,5 bar", strokes=1)])  # NaN, empty flags and a comma in a name
    path = write_map(curves, tmp_path / f"map{suffix}")
    frame = pl.read_parquet(path) if suffix == ".parquet" else pl.read_csv(path)
    assert frame.columns == CONTRACT
    again = read_map(path)
    for name in CONTRACT:
        if curves[name].dtype == object:
            assert again[name].to_numpy().tolist() == curves[name].to_numpy().tolist()
        else:
            np.testing.assert_array_equal(again[name].to_numpy(), curves[name].to_numpy())
    assert again.attrs["ambient_pressure_pa"] == curves.attrs["ambient_pressure_pa"]
    assert not list(tmp_path.glob(".*"))


def test_a_map_of_earlier_versions_lacks_some_columns(make, tmp_path):
    old = characterise(make()).drop_vars(["ambient_pressure_pa", "strokes_recorded"])
    again = read_map(write_map(old, tmp_path / "map.parquet"))
    assert "ambient_pressure_pa" not in again.attrs
    assert "strokes_recorded" not in again


def test_what_cannot_be_written_or_read(make, tmp_path):
    curves = characterise(make())
    with pytest.raises(CommandError, match=r"'\.xlsx' cannot be written"):
        write_map(curves, tmp_path / "map.xlsx")
    with pytest.raises(CommandError, match="does not exist"):
        write_map(curves, tmp_path / "none" / "map.csv")
    (tmp_path / "a.csv").write_text("recording,direction\nx,1\n")
    with pytest.raises(RecordingError, match="lacks velocity_m_s"):
        read_map(tmp_path / "a.csv")
    with pytest.raises(RecordingError, match="there is no such file"):
        read_map(tmp_path / "none.parquet")


def test_the_map_keeps_every_label_so_that_a_fit_can_ask_for_it(make, tmp_path, printed):
    from pneudrive.identify import FrictionFit

    recordings = [
        make(name=f"{seal}{number}", friction=friction, seed=number, labels={"seal": seal, "run": f"0{number}"})
        for seal, friction in (("lip", 5.0), ("cup", 9.0))
        for number in (1, 2)
    ]
    path = write_map(characterise(recordings), tmp_path / "map.parquet")
    again = read_map(path)
    assert again["seal"].to_numpy().tolist() == [*["lip"] * 4, *["cup"] * 4]
    assert again["run"].to_numpy().tolist() == ["01", "01", "02", "02"] * 2
    fit = ["fit", str(path), "--laws", "coulomb", "--pressure", "none", "--out", str(tmp_path / "fit.toml")]
    said = printed(fit)
    warning = "the map has 2 values of seal (cup, lip) and the fit averages over them; --by seal fits each"
    assert warning in said
    assert said.startswith("! the map has")  # before the fit, not after it
    assert "2 values of run" in said
    assert "values of seal" not in printed([*fit, "--by", "seal"])
    levels = [FrictionFit.from_toml(tmp_path / f"fit-{seal}.toml").parameters["coulomb"] for seal in ("lip", "cup")]
    assert levels == pytest.approx([5.0, 9.0], abs=0.05)
