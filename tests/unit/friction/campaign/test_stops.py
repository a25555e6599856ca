"""Stops: what was written into a campaign by hand (relaxation, breakaway, way back) comes out with its interval."""

import json
import tomllib
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest
from scipy.signal import lfilter

from oracle.campaigns import rewrite
from oracle.stop_campaigns import AMBIENT_PA, StopWorld, write_stops
from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.characteristics import campaign_friction, write_characteristics
from pneudrive.errors import CampaignError
from pneudrive.estimate.estimates import one_thread
from pneudrive.friction.campaign.stops.course import Running, bin_excess, find_phases
from pneudrive.friction.campaign.stops.dwell_law import fit_dwell
from pneudrive.friction.campaign.stops.stop import find_breakaway, find_stops
from pneudrive.rig.interface import Sampling
from pneudrive.signals.motion import noise_level
from pneudrive.signals.recording import Recording


def found(folder, world, seed=0):
    with one_thread():
        stops, skipped = find_stops(Campaign.open(write_stops(folder / f"c{seed}", world, seed)), 1)
        series, statements = fit_dwell(stops, AMBIENT_PA)
    return stops, skipped, series, statements


def gauge(condition):
    return condition.pressure_a_pa - AMBIENT_PA, condition.pressure_b_pa - AMBIENT_PA


def rise(time_s, increment_n, stiffness=2e5, speed=1e-3, length_m=3e-4):
    """Return force of a spring that loads a contact, which breaks away and recovers over a length."""
    way = speed * time_s
    past = np.maximum(way - (5.0 + increment_n) / stiffness, 0.0)
    spring, contact = 25.0 + stiffness * way, 30.0 + increment_n * np.exp(-past / length_m)
    return -0.2 * np.logaddexp(-spring / 0.2, -contact / 0.2)


@pytest.mark.parametrize(("increment_n", "noise_n"), [(0.5, 0.05), (4.0, 0.3)])
def test_peak_of_noisy_samples_is_not_their_largest(increment_n, noise_n):
    time = np.arange(0.0, 0.4, 2e-4)
    rng = np.random.default_rng(1)
    true = rise(np.linspace(0.0, 0.4, 400_001), increment_n).max()
    away, naive = [], []
    for _ in range(60):
        noisy = rise(time, increment_n) + noise_n * rng.standard_normal(time.size)
        peak = find_breakaway(time, 1e-3 * time, noisy, 30.0)[0]
        away.append((peak["breakaway_n"] - true) / peak["breakaway_stderr_n"])
        naive.append(noisy.max() - true)
    assert np.mean(naive) > 1.5 * noise_n  # what has to be avoided
    scaled = find_breakaway(time, 1e-3 * time, 8.0 * noisy, 240.0)[0]  # forces in another unit
    height = ["breakaway_n", "breakaway_stderr_n"]
    assert [scaled[name] for name in height] == pytest.approx([8.0 * peak[name] for name in height])
    assert abs(np.mean(away)) < 0.6
    assert np.mean(np.abs(away) < 2.0) > 0.75


@pytest.mark.parametrize(("noise_n", "stiffness", "most"), [(0.04, 2.5e5, 0.03), (0.005, 3e5, 0.02)])
def test_a_sharp_corner_is_neither_cut_nor_surer_than_it_is(noise_n, stiffness, most):
    """A rise of 0.05 N a sample ends at once: smoothing would lose several standard errors of it, wherever it falls."""
    time, rng = np.arange(0.0, 0.3, 2e-4), np.random.default_rng(5)
    away, doubt = [], []
    for _ in range(40):
        way = 1e-3 * (time - rng.uniform(0.0, 2e-4))
        past = np.maximum(way - 7.0 / stiffness, 0.0)
        sharp = np.minimum(25.0 + stiffness * way, 30.0 + 2.0 * np.exp(-past / 1e-4))
        peak = find_breakaway(time, 1e-3 * time, sharp + noise_n * rng.standard_normal(time.size), 30.0)[0]
        away.append(peak["breakaway_n"] - 32.0)
        doubt.append(peak["breakaway_stderr_n"])
    assert abs(np.mean(away)) < 0.008  # 0.025 when smoothed, 0.014 at the place of a wide parabola
    assert np.mean(np.abs(away) < 1.96 * np.array(doubt)) >= 0.85
    assert np.median(doubt) < most


@pytest.mark.parametrize(("per_count", "least"), [(1, 4), (3, 6), (5, 5)])
def test_bins_of_the_excess_hold_every_sample_in_motion_once(per_count, least):
    """Also with a coarse encoder, of which several samples have the same travel. White noise falls with the root."""
    time = 1e-3 * np.arange(400)
    travel = 1e-6 * np.floor(np.arange(1, 401) / per_count)
    friction = 30.0 + np.random.default_rng(3).standard_normal(time.size)
    rest = np.full(time.size, 1e5)
    recording = Recording("one", time, -travel, rest, rest, rest, area_a_m2=1e-4, area_b_m2=1e-4)
    running = Running(30.0, 0.1, 0.0, "approach", 0.0, np.array([]), np.array([]))
    bins, speed = bin_excess(recording, friction, slice(0, 400), -1, running)
    count, moves = (noise_level(friction) / bins[3]) ** 2, travel > travel[0]
    assert count.min() == pytest.approx(least)
    assert count.max() == pytest.approx(399.0 * (1.0 - 80.0 ** (-1.0 / 55.0)), abs=0.5 + per_count)  # 55 bins: 5 .. 399
    assert count @ bins.T[:, :3] == pytest.approx(
        [(one - one[0])[moves].sum() for one in (travel, time)] + [(friction - 30.0)[moves].sum()]
    )
    assert speed == pytest.approx(np.ptp(travel) / 0.399)
    assert bin_excess(recording, friction, slice(399 - 31, 400), -1, running) is None


@pytest.mark.parametrize("bandwidth_hz", [60.0, 500.0])
def test_what_the_lag_of_the_sensor_takes_off_a_peak_is_in_its_doubt(bandwidth_hz):
    step, rng = 2e-6, np.random.default_rng(3)
    fine = np.arange(0.0, 0.3, step)
    way = 1e-3 * fine
    true = np.minimum(25.0 + 2.5e5 * way, 30.0 + 2.0 * np.exp(-np.maximum(way - 2.8e-5, 0.0) / 1e-4))
    share = -np.expm1(-2.0 * np.pi * bandwidth_hz * step)
    shown, time = lfilter([share], [1.0, share - 1.0], true - 25.0)[::100] + 25.0, fine[::100]
    hits, added = {None: [], bandwidth_hz: []}, []
    for _ in range(10):
        samples = shown + 0.02 * rng.standard_normal(time.size)
        peaks = {hz: find_breakaway(time, 1e-3 * time, samples, 30.0, None, hz)[0] for hz in hits}
        assert peaks[None]["breakaway_n"] == peaks[bandwidth_hz]["breakaway_n"]
        for hz, peak in peaks.items():
            hits[hz].append(abs(peak["breakaway_n"] - 32.0) < 2.0 * peak["breakaway_stderr_n"])
        added.append(np.sqrt(np.subtract(*(peaks[hz]["breakaway_stderr_n"] ** 2 for hz in (bandwidth_hz, None)))))
    assert np.mean(hits[None]) <= 0.5 or bandwidth_hz > 200.0  # a short lag is within what the noise leaves open
    assert np.mean(hits[bandwidth_hz]) >= 0.8
    assert 0.5 * (32.0 - shown.max()) < np.mean(added) < 1.3 * (32.0 - shown.max())


def test_the_bandwidth_is_read_from_the_rig_file(tmp_path):
    folder = write_stops(tmp_path / "stops", StopWorld(durations_s=(10.0,), repeats=1, samples=400), 1)
    rig = json.loads((folder / "rig.json").read_text())
    doubts = []
    for bandwidth in ({}, {"bandwidth_hz": {"force_n": 20.0}}):
        (folder / "rig.json").write_text(json.dumps(rig | bandwidth))
        doubts.append(find_stops(Campaign.open(folder), 1)[0]["breakaway_stderr_n"])
    assert all(after > before for before, after in zip(*doubts, strict=True))
    (folder / "rig.json").write_text(json.dumps(rig | {"bandwidth_hz": {"force_n": 0.0}}))
    with pytest.raises(CampaignError, match=r"bandwidth_hz\.force_n"):
        Campaign.open(folder)


def test_a_stop_gives_relaxation_breakaway_and_way_back(tmp_path):
    world = StopWorld(durations_s=(3.0, 30.0, 300.0), repeats=4, ripple=(0.0, 1.0))
    stops, skipped, _, _ = found(tmp_path, world)
    assert not skipped
    assert len(stops) == 12
    rows = [SimpleNamespace(**row) for row in stops.iter_rows(named=True)]
    long = [s for s in rows if s.stop_s > 10.0]
    rate, since = world.relaxation
    for s in long:
        assert s.relaxation_form == "log"
        true = rate * np.log10(1.0 + s.stop_s / since)
        assert s.relaxation_n == pytest.approx(true, abs=0.2)
        assert s.relaxation_n_per_decade_low < rate < s.relaxation_n_per_decade_high + 0.03
        assert s.recovery_m == pytest.approx(world.length_m * np.log(20.0), rel=0.1)
        assert s.recovery_m_low <= s.recovery_m <= s.recovery_m_high
        assert s.recovery_s == pytest.approx(s.recovery_m / world.speed_m_s, rel=0.1)
        assert s.recovery_complete
    for s in rows:
        assert s.dwell_s == pytest.approx(s.stop_s, abs=0.01)
        assert s.loading_rate_n_s == pytest.approx(world.stiffness_n_m * world.speed_m_s, rel=0.3)
        assert s.basis == "approach and reference"
    away = [s.increment_n - float(world.increment(s.stop_s, (0.0, 0.0))) for s in rows]
    assert abs(np.mean(away)) < 0.2


def test_direction_and_missing_steps_change_nothing(tmp_path):
    base = StopWorld(durations_s=(1.0, 30.0), repeats=3)
    means = []
    for seed, world in enumerate(
        (
            base,
            StopWorld(durations_s=(1.0, 30.0), repeats=3, directions=(-1,)),
            StopWorld(durations_s=(1.0, 30.0), repeats=3, bring_steps=False),
        )
    ):
        stops, skipped, _, _ = found(tmp_path, world, seed)
        assert not skipped
        # running friction is that at the position of the peak
        peaks = (stops["breakaway_n"] - stops["running_n"]).to_numpy()
        assert peaks == pytest.approx(stops["increment_n"].to_numpy(), abs=1e-9)
        means.append([stops.filter(stop_s=t)["increment_n"].mean() for t in (1.0, 30.0)])
    assert np.ptp(means, axis=0) == pytest.approx([0.0, 0.0], abs=0.5)


@pytest.mark.parametrize("law", ["log", "exponential", "none"])
def test_slope_per_decade_under_laws(tmp_path, law):
    """All laws, with random campaigns, stand in ``make trials``."""
    world = StopWorld(law=law, repeats=4, samples=600)
    _, _, series, _ = found(tmp_path, world, 3)
    s = series[0]
    assert s.reference_s == 15.0
    assert s.slope.low <= world.slope(15.0, (0.0, 0.0)) <= s.slope.high
    assert s.mean_slope.low <= world.mean_slope((0.0, 0.0)) <= s.mean_slope.high
    wide = s.mean_slope.high - s.mean_slope.low
    assert wide < 0.5, "an interval that holds everything says nothing"
    supported = {fit.name for fit in s.laws if fit.delta < 10.0}
    assert law in supported
    if law != "none":
        assert "none" not in supported


def test_pressures_are_separated_where_the_pairs_allow_it(tmp_path):
    world = StopWorld(gauges_pa=((0.0, 0.0), (2e5, 0.0), (0.0, 2e5)), durations_s=(1.0, 10.0, 100.0), repeats=4)
    _, _, series, _ = found(tmp_path, world)
    effect = series[0].pressure
    true = (world.slope(10.0, (2e5, 0.0)) - world.slope(10.0, (0.0, 0.0))) / 2e5
    assert effect.slopes.keys() == {"a", "b"}
    for estimate in effect.slopes.values():
        assert estimate.low < true < estimate.high
    together = StopWorld(gauges_pa=((0.0, 0.0), (1e5, 1e5)), durations_s=(1.0, 10.0, 100.0), repeats=3)
    _, _, series, _ = found(tmp_path, together, 1)
    assert series[0].pressure.slopes.keys() == {"sum"}
    assert "cannot be separated" in series[0].pressure.statement


def test_what_the_stops_do_not_carry_is_said(tmp_path):
    def said(world, seed):
        return " ".join(f"{s.text} {s.remedy}" for s in found(tmp_path, world, seed)[3] if not s.carried)

    assert "not a law" in said(StopWorld(durations_s=(1.0, 100.0)), 0)
    assert "saturates" in said(StopWorld(law="stretched"), 1)
    drifts = said(StopWorld(order="ascending", drift_share=0.1, durations_s=(1.0, 10.0, 100.0)), 2)
    assert "drift" in drifts
    assert "randomise" in drifts
    assert "5 kHz" in said(StopWorld(burst_hz=0.0, samples=400, durations_s=(1.0, 10.0, 100.0)), 3)
    assert "do not determine" in said(StopWorld(durations_s=(10.0,), repeats=3), 4)
    slow = StopWorld(durations_s=(0.1, 1.0, 10.0), stiffness_n_m=2e4, speed_m_s=5e-4, released=True)
    assert "aged longer" in said(slow, 5).replace("\n", " ")


def test_held_and_released_are_told_apart(tmp_path):
    stops, _, series, _ = found(tmp_path, StopWorld(durations_s=(1.0, 10.0, 100.0), released=True))
    assert stops["relaxation_n"].is_nan().all()
    assert series[0].released
    assert "released" in series[0].name


def test_damaged_cycles_cost_only_themselves(tmp_path):
    folder = write_stops(tmp_path / "c", StopWorld(durations_s=(1.0, 10.0, 100.0), repeats=4), 0)
    files = sorted((folder / "cycles").glob("*.parquet"))
    rewrite(files[0], lambda frame: frame.filter(pl.col("step") < 3))  # ends before its stop
    rewrite(files[1], lambda frame: frame.with_columns(force_n=pl.lit(float("nan"))))
    files[2].write_bytes(files[2].read_bytes()[:2000])
    result = campaign_friction(folder, processes=1)
    assert len(result.stops) == 9
    assert len(result.skipped) == 3
    assert result.dwell[0].slope is not None
    write_characteristics(result, tmp_path)
    series = tomllib.loads((tmp_path / "effects.toml").read_text("utf-8"))["dwell"][0]
    assert (series["shortest_s"], series["longest_s"]) == pytest.approx((1.0, 100.0), abs=0.01)
    assert result.synthetic


@pytest.mark.parametrize(
    ("spoil", "flag"),
    [
        (-pl.col("force_n"), "negative_friction"),  # a sign that was mixed up
        (pl.col("force_n").clip(-33.0, 33.0), "saturated"),
        (pl.lit(3.0).alias("force_n"), "stuck"),
    ],
)
def test_peaks_that_are_none_are_flagged_and_not_counted(tmp_path, spoil, flag):
    folder = write_stops(tmp_path / "c", StopWorld(durations_s=(5.0, 50.0), repeats=2, samples=300), 1)
    for path in (folder / "cycles").glob("*.parquet"):
        rewrite(path, lambda frame: frame.with_columns(spoil))
    stops, _ = find_stops(Campaign.open(folder), 1)
    assert not stops["usable"].any()
    assert stops["flags"].list.contains(flag).all()
    series, statements = fit_dwell(stops, AMBIENT_PA)
    assert series[0].slope is None
    assert any("unusable" in s.text and not s.carried for s in statements)


@pytest.mark.parametrize("numbered", [True, False])
def test_stop_is_found_without_the_list_of_steps_where_moves_turn_within_a_sample(numbered):
    """Files written elsewhere have no list of steps; a slow move turns faster than the samples follow."""
    legs = [
        (0.0, 0.09, 0.1),
        (0.09, 0.04, 0.1),
        (0.04, 0.05, 2e-3),
        (0.05, 0.05, 3.0),
        (0.05, 0.06, 2e-3),
        (0.06, 0.0, 0.1),
    ]
    time, position, step = [], [], []
    began = 0.0
    for number, (start, end, pace) in enumerate(legs):
        duration = abs(end - start) / pace if end != start else pace
        t = np.arange(0.0, duration - 5e-4, 1e-3)
        time.append(began + t)
        position.append(start + (end - start) * t / duration)
        step.append(np.full(t.size, number))
        began += duration
    x = np.concatenate(position) + 3e-7 * np.random.default_rng(1).standard_normal(sum(map(len, time)))
    steps = np.concatenate(step) if numbered else np.zeros(x.size, dtype=np.int64)
    cycle = Cycle("one", "stop", (), Sampling(), 1.5e5, 1.5e5, speed_m_s=2e-3, stop_s=3.0)
    phases = find_phases(cycle, np.concatenate(time), x, steps)
    assert phases.direction == 1
    assert not phases.reversed
    assert phases.by_steps == numbered
    assert phases.dwell_s == pytest.approx(3.0, abs=0.02)
    assert x[phases.approach].min() == pytest.approx(0.04, abs=1e-4)
    assert x[phases.restart].max() == pytest.approx(0.06, abs=1e-4)
