"""What goes wrong in a cycle costs that cycle, by name, and none of the others."""

from __future__ import annotations

import json

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from campaign.fake_rig import QUICK, protocol
from oracle.campaigns import BAR, World, hits, rewrite, write_campaign
from pneudrive.campaign.run import run_campaign
from pneudrive.characteristics import campaign_friction
from pneudrive.errors import CampaignError
from pneudrive.rig import load_rig
from pneudrive.rig.machine import Past


def change(frame: pl.DataFrame, column: str, rows, value) -> pl.DataFrame:
    values = frame[column].to_numpy().copy()
    values[rows] = value(values[rows]) if callable(value) else value
    return frame.with_columns(pl.Series(column, values))


DAMAGE = {
    "a few samples that are no number": (lambda f: change(f, "force_n", slice(50, 70), np.nan), "non_finite"),
    "most samples that are no number": (lambda f: change(f, "force_n", slice(50, 560), np.nan), None),
    "a clock that jumps back": (
        lambda f: change(f, "time_s", slice(560, None), lambda t: t - 0.3 * t[0]),
        "time_backwards",
    ),
    "a force that is wrong": (lambda f: change(f, "force_n", slice(None), lambda v: 0.5 * v), "outlier"),
    "a force that is stuck": (lambda f: change(f, "force_n", slice(30, None), 7.0), None),
    "samples twice": (lambda f: pl.concat([f[:200], f[150:]]), "time_backwards"),
    "one direction only": (lambda f: f[:300], "unpaired"),
    "nothing that moves": (lambda f: change(f, "position_m", slice(None), 0.1), None),
    "pressures below vacuum": (lambda f: change(f, "pressure_a_pa", slice(None), lambda p: p - 5e5), None),
    "positions in mm": (lambda f: change(f, "position_m", slice(None), lambda x: 1e3 * x), None),
}


def spoil(folder, at: int, how) -> str:
    path = sorted((folder / "cycles").glob("*-sweep-*.parquet"))[at]
    return rewrite(path, how)["cycle"]["key"]


@pytest.mark.parametrize("damage", DAMAGE)
def test_damage_is_named_and_costs_one_cycle(measured, quick, damage):
    how, flag = DAMAGE[damage]
    keys = []
    world = quick(cycle_share=0.005)
    found = measured(world, spoil=lambda folder: keys.append(spoil(folder, 5, how)))
    skipped = {s.key: s.reason for s in found.skipped}
    if flag is None:
        assert list(skipped) == keys
        assert len(skipped[keys[0]]) > 10
        assert keys[0] in " ".join(s.text for s in found.statements)
    else:
        assert not skipped
        (cycle,) = found.cycles.filter(key=keys[0]).iter_rows(named=True)
        if flag == "unpaired":
            assert np.isnan(cycle["friction_n"])
            rows = found.friction_map.to_dataframe().query(f"recording == '{keys[0]}'")
            assert rows["flags"].tolist() == ["unpaired"]
        elif flag:
            assert flag in cycle["flags"]
    curve = found.curves[0]
    assert hits(world, curve).mean() >= 0.8
    assert curve.cycles.sum() >= 21


def test_files_that_cannot_be_read_are_named(tmp_path):
    folder = write_campaign(tmp_path / "campaign", World(samples=200), 1)
    files = sorted((folder / "cycles").glob("*-sweep-*.parquet"))
    files[0].write_bytes(files[0].read_bytes()[:2000])
    files[1].write_bytes(b"not a cycle")
    rewrite(files[2], lambda frame: frame.drop("force_n"))
    found = campaign_friction(folder)
    assert {s.file.removeprefix("cycles/") for s in found.skipped} == {f.name for f in files[:3]}
    assert found.curves


@pytest.mark.parametrize(
    "changes",
    [
        {"speeds_m_s": (0.05,), "repeats": 1, "sentinel_every": 0},
        {"speeds_m_s": (0.05,), "repeats": 8, "sentinel_every": 0},
        {"speeds_m_s": (0.05, 0.1), "repeats": 3},
        {"white_n": 0.0, "correlated_n": 0.0, "cycle_share": 0.0, "position_noise_m": 0.0, "pressure_noise_pa": 0.0},
        {"white_n": 100.0, "correlated_n": 50.0},
    ],
    ids=["one cycle", "one speed", "two speeds", "no noise at all", "noise beyond friction"],
)
def test_campaigns_at_the_edge_give_what_they_carry(measured, quick, changes):
    world = quick(**changes)
    found = measured(world)
    assert found.friction_map.sizes["row"] > 0
    if found.curves:
        assert hits(world, found.curves[0]).mean() >= 0.8
    else:
        assert any(s.topic == "curve" and not s.carried for s in found.statements)


def test_a_folder_that_is_no_campaign(tmp_path):
    with pytest.raises(CampaignError, match="not a campaign folder"):
        pn.characterise(tmp_path)
    folder = write_campaign(tmp_path / "campaign", World(samples=200), 1)
    for path in (folder / "cycles").glob("*.parquet"):
        path.unlink()
    with pytest.raises(CampaignError, match="no cycle that can be used"):
        pn.campaign_friction(folder)


MISTAKES = {
    "force of the other sign": (lambda f: f.with_columns(-pl.col("force_n")), "negative"),
    "positions in millimetres": (lambda f: f.with_columns(pl.col("position_m") * 1e3), "more than on any pneumatic"),
    "times in milliseconds": (lambda f: f.with_columns(pl.col("time_s") * 1e3), "times the speed in"),
    "nothing": (lambda f: f, None),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_another_convention_in_all_cycles_is_no_silent_answer(measured, quick, mistake):
    how, word = MISTAKES[mistake]
    found = measured(
        quick(),
        spoil=lambda folder: [
            spoil(folder, at, how) for at in range(len(list((folder / "cycles").glob("*-sweep-*.parquet"))))
        ],
    )
    doubts = [s.text for s in found.statements if s.topic == "data" and not s.carried]
    assert any(word in text for text in doubts) if word else not doubts
    if word == "negative":
        assert all((c.friction_n[c.measured] > 0).all() for c in found.curves)


@pytest.mark.parametrize("gain", [-1.0, 1e3])
def test_friction_that_cannot_be_costs_its_cycle_even_where_several_fail(measured, quick, gain):
    def damage(folder):
        for at in (1, 4, 7):
            spoil(folder, at, lambda f: f.with_columns(pl.col("force_n") * gain))

    world = quick(cycle_share=0.005, repeats=2)
    found = measured(world, spoil=damage)
    assert hits(world, found.curves[0]).mean() >= 0.8
    assert (found.cycles["friction_n"] > 0).sum() > 15


def test_way_is_told_by_samples_where_no_steps_are_written(measured, quick):
    def without_steps(folder):
        for path in (folder / "cycles").glob("*.parquet"):
            rewrite(path, steps=[])

    planned, sampled = (measured(quick(), spoil=how) for how in (None, without_steps))
    ways = [found.cycles["travel_m"].to_numpy() for found in (planned, sampled)]
    # The first planned move starts at a place that no step tells: half a cycle's way at most.
    assert ways[1][-1] == pytest.approx(ways[0][-1], rel=0.03)
    assert (np.diff(ways[1]) > 0).all()


# --- Tares show the zeros of the pressure sensors: they are taken off, and what is left to say of a sensor is its gain.

ACCURACY_PA = 400.0
RANGE_PA = 2.5 * BAR  # the usual one that holds 2 bar
PLAN = {
    "gauges_pa": ((0.5 * BAR, 0.5 * BAR), (2.0 * BAR, 2.0 * BAR)),
    "pressure_accuracy_pa": ACCURACY_PA,
    "speeds_m_s": tuple(np.geomspace(2e-3, 0.4, 5)),
    "cycle_share": 0.002,
    "white_n": 0.05,
    "correlated_n": 0.05,
}


def half_widths(found, gauge_pa):
    """Half the width of the bands of one direction at this pressure in both chambers, N."""
    curves = [c for c in found.curves if c.direction and abs(c.condition.pressure_a_pa - 101325.0 - gauge_pa) < 200.0]
    return np.concatenate([(c.high_n - c.low_n)[c.measured] / 2.0 for c in curves])


def test_one_direction_is_known_better_and_its_band_still_holds_the_truth(measured, quick):
    draw = np.random.default_rng(7)
    inside = {1: [], -1: []}
    for seed in range(3):
        zeros, gains = ACCURACY_PA * draw.standard_normal((2, 2))
        world = quick(**PLAN, pressure_zeros_pa=tuple(zeros), pressure_gains=tuple(gains / RANGE_PA))
        found = measured(world, seed)
        for curve in found.curves:
            if curve.direction:
                inside[curve.direction] += hits(world, curve).tolist()
        rows = found.friction_map
        for side, gain in (("a", gains[0]), ("b", gains[1])):
            shown = rows[f"pressure_{side}_pa"].to_numpy() - 101325.0
            true = np.where(shown > 1.2 * BAR, 2.0 * BAR, 0.5 * BAR)
            assert shown == pytest.approx(true * (1.0 + gain / RANGE_PA), abs=50.0)
        assert found.zero.zero_n == pytest.approx(1.0, abs=0.05)  # of the force sensor alone
    assert all(np.mean(values) >= 0.90 for values in inside.values())
    # What is left of both sensors at a fifth of their range is a fifth of their accuracy.
    whole = 1.96 * np.sqrt(2.0) * ACCURACY_PA * 4.909e-4
    assert half_widths(found, 0.5 * BAR).min() < 0.5 * whole
    assert half_widths(found, 2.0 * BAR).min() > 0.8 * whole


def test_a_zero_that_no_accuracy_explains_is_said_and_not_taken_off(measured, quick):
    far = measured(quick(**PLAN, pressure_zeros_pa=(3000.0, 0.0)))
    said = [s for s in far.statements if s.topic == "zero" and not s.carried]
    assert len(said) == 1
    assert "chamber a" in said[0].text
    assert "tare-1: +3e+03 Pa" in said[0].text
    assert far.ranges.gauge_a_pa[1] == pytest.approx(2.0 * BAR + 3000.0, abs=50.0)
    without = measured(quick(**PLAN, pressure_zeros_pa=(300.0, 0.0), tare=False))
    assert not [s for s in without.statements if s.topic == "zero"]
    assert without.ranges.gauge_a_pa[1] == pytest.approx(2.0 * BAR + 300.0, abs=50.0)


def test_the_zeros_of_a_simulated_rig_are_told_apart(tmp_path):
    rig, true = load_rig("default", seed=3), {}
    d = rig.rig.description
    for file in run_campaign(protocol(), rig, tmp_path / "c", options=QUICK).campaign.cycles():
        past = Past.from_dict(file.head.memory)
        zero_n = d.force_sensor.zero + float(past.force_drift_n(d))
        true[past.key] = {"a": past.pressure_a_pa, "b": past.pressure_b_pa, "force_zero_n": zero_n}
    found = campaign_friction(tmp_path / "c", processes=1)
    rows = found.friction_map
    for side in ("a", "b"):
        pressure = [true[key][side] for key in rows["recording"].to_numpy()]
        # At most 0.5 bar of the range of 4 bar: three standard deviations of the gain error are 150 Pa.
        assert rows[f"pressure_{side}_pa"].to_numpy() == pytest.approx(pressure, abs=150.0)
    tare = next(values for key, values in true.items() if key.endswith("tare"))
    assert found.zero.zero_n == pytest.approx(tare["force_zero_n"], abs=0.02)
    shown = [s.text for s in found.statements if s.topic == "zero"]
    assert sum("subtracted from all cycles" in text for text in shown) == 2


def test_gauge_pressures_are_no_silent_answer(measured, quick):
    def lower(folder):
        for path in (folder / "cycles").glob("*.parquet"):
            head = json.loads(pl.read_parquet_metadata(path)["pneudrive"])
            frame = pl.read_parquet(path)
            for channel in ("pressure_a_pa", "pressure_b_pa"):
                head["cycle"][channel] -= 0.9e5
                if channel in frame.columns:
                    frame = frame.with_columns(pl.col(channel) - 0.9e5)
            frame.write_parquet(path, metadata={"pneudrive": json.dumps(head)})

    found = measured(quick(), spoil=lower)
    assert any("below ambient" in s.text and not s.carried for s in found.statements)
