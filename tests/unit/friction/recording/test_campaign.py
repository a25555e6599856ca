"""Campaigns: every cycle is treated as a recording of its own, in whatever process."""

import time

import numpy as np
import polars as pl
import pytest

from pneudrive import batching
from pneudrive.characterise import Layout, characterise, characterise_recordings
from pneudrive.errors import RecordingError
from pneudrive.friction import characterisation
from pneudrive.signals.load import RecordingFile, find_cycles

LAYOUT = Layout.loads("""
format = "parquet"

[columns]
cycle = { column = "cycle" }
time = { column = "time_s", unit = "s" }
position = { column = "position_m", unit = "m" }
force = { column = "force_n", unit = "N", positive = "+x" }
pressure_a = { column = "pressure_a_pa", unit = "Pa abs" }
pressure_b = { column = "pressure_b_pa", unit = "Pa abs" }

[geometry]
kind = "rodless"
bore = "25 mm"
""")


def truth(cycle: int) -> float:
    return 5.0 + 0.5 * cycle


@pytest.fixture
def recordings(make):
    return [
        make(friction=truth(i), strokes=2, rate=2000.0, speed=0.02, seed=i, name=f"plan/{i}", gauge_b=(1 + i % 3) * 1e5)
        for i in range(12)
    ]


@pytest.fixture
def plan(recordings, tmp_path):
    channels = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
    frames = [
        pl.DataFrame({c: getattr(r, c) for c in channels}).with_columns(pl.lit(i).alias("cycle"))
        for i, r in enumerate(recordings)
    ]
    pl.concat(frames).write_parquet(tmp_path / "plan.parquet", row_group_size=5000)
    return tmp_path / "plan.parquet"


def test_cycles_equal_recordings_one_by_one(plan, recordings):
    whole, single = characterise(plan, LAYOUT), characterise(recordings)
    for name in whole.data_vars:
        if whole[name].dtype == object:
            assert whole[name].to_numpy().tolist() == single[name].to_numpy().tolist()
        else:
            np.testing.assert_array_equal(whole[name].to_numpy(), single[name].to_numpy())
    assert whole.friction_n.to_numpy()[::2] == pytest.approx([truth(i) for i in range(12)], abs=0.05)


def test_32_bit_floats_are_enough(plan, recordings, tmp_path):
    frame = pl.read_parquet(plan).with_columns(pl.selectors.float().cast(pl.Float32))
    frame.write_parquet(tmp_path / "single.parquet")
    single = characterise(tmp_path / "single.parquet", LAYOUT).friction_n.to_numpy()
    assert single == pytest.approx(characterise(recordings).friction_n.to_numpy(), abs=0.005)


@pytest.fixture
def started(monkeypatch):
    """Collect the worker processes that are started."""
    processes = []
    start = batching.subprocess.Popen

    def collect(*args, **options):
        processes.append(start(*args, **options))
        return processes[-1]

    monkeypatch.setattr(batching.subprocess, "Popen", collect)
    return processes


def test_an_interrupt_leaves_no_worker_behind(monkeypatch, started):
    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(batching, "as_completed", interrupt)
    with pytest.raises(KeyboardInterrupt):
        batching.in_processes(time.sleep, [(60,), (60,)])
    assert len(started) == 2
    assert all(process.poll() is not None for process in started)


def test_a_worker_that_dies_is_an_error_and_stops_the_others(started):
    assert batching.in_processes(sorted, [([3, 1],), ([2],)]) == [[1, 3], [2]]
    started.clear()
    with pytest.raises(RecordingError, match="a worker process ended with status 9"):
        batching.in_processes(exec, [("import time; time.sleep(60)",), ("import os; os._exit(9)",)])
    assert all(process.poll() is not None for process in started)


def test_a_large_campaign_keeps_a_sample_of_curves(plan, monkeypatch):
    monkeypatch.setattr(characterisation, "KEPT_IN_FULL", 5)
    monkeypatch.setattr(characterisation, "SHOWN", 3)
    found = characterise_recordings(plan, LAYOUT)
    assert found.friction_map.sizes["row"] == 24
    assert [r.name for r in found.recordings] == ["plan/0", "plan/5", "plan/11"]
    assert len(found.table) == 12
    assert "12 recordings" in found.notes[0]
    (fit,) = found.closures
    assert fit.areas_m2["b"].value == pytest.approx(fit.nominal_m2["b"], rel=1e-3)


def test_one_bad_cycle_of_many_is_skipped_and_named(plan, monkeypatch, tmp_path):
    monkeypatch.setattr(characterisation, "KEPT_IN_FULL", 5)
    still = pl.when(pl.col("cycle") == 7).then(0.0).otherwise(pl.col("position_m")).alias("position_m")
    twin = pl.when(pl.col("cycle") == 9).then(8).otherwise(pl.col("cycle")).alias("cycle")
    frame = pl.read_parquet(plan).with_columns(still)
    frame.write_parquet(tmp_path / "bad.parquet")
    found = characterise_recordings(tmp_path / "bad.parquet", LAYOUT)
    assert found.skipped == (("bad/7", "no motion"),)
    assert found.friction_map.sizes["row"] == 22
    frame.filter(pl.col("cycle") != 8).with_columns(twin).write_parquet(tmp_path / "less.parquet")
    assert find_cycles(RecordingFile(tmp_path / "less.parquet", LAYOUT, "less"))[0].tolist() == [*range(9), 10, 11]


def test_files_that_are_no_campaign(plan, tmp_path):
    frame = pl.read_parquet(plan)
    frame.reverse().vstack(frame).write_parquet(tmp_path / "mixed.parquet")
    with pytest.raises(RecordingError, match=r"rows of cycle .* are not together"):
        characterise(tmp_path / "mixed.parquet", LAYOUT)
    frame.drop("cycle").write_parquet(tmp_path / "none.parquet")
    with pytest.raises(RecordingError, match="there is no column 'cycle'"):
        characterise(tmp_path / "none.parquet", LAYOUT)
    frame.drop("force_n").write_parquet(tmp_path / "less.parquet")
    with pytest.raises(RecordingError, match="there is no column 'force_n'"):
        characterise(tmp_path / "less.parquet", LAYOUT)
    with pytest.raises(RecordingError, match="no such file"):
        characterise(tmp_path / "absent.parquet", LAYOUT)
    frame.clear().write_parquet(tmp_path / "empty.parquet")
    with pytest.raises(RecordingError, match="no rows"):
        characterise(tmp_path / "empty.parquet", LAYOUT)
