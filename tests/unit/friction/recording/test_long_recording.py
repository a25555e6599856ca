"""A recording that is too long to be held gives what it gives when it is held, in the memory of one part of it."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from pneudrive.characterise import Layout, SourcePaper, characterise_recordings
from pneudrive.errors import RecordingError
from pneudrive.friction import level as extraction
from pneudrive.signals import load
from pneudrive.simulation.trajectory import save_columns

LAYOUT = """
format = "parquet"
[columns]
time = { column = "time_s", unit = "s" }
position = { column = "position_m", unit = "m" }
force = { column = "force_n", unit = "N" }
pressure_a = { column = "pressure_a_pa", unit = "Pa abs" }
pressure_b = { column = "pressure_b_pa", unit = "Pa abs" }
[geometry]
bore = "25 mm"
"""
COLUMNS = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")


def save(path, recordings) -> None:
    """One file of recordings one after the other, the clock going on."""
    parts, clock = [], 0.0
    for r in recordings:
        parts.append(pl.DataFrame({c: getattr(r, c) for c in COLUMNS}).with_columns(pl.col("time_s") + clock))
        clock = float(parts[-1]["time_s"][-1]) + 0.01
    pl.concat(parts).write_parquet(path, row_group_size=20_000)


@pytest.mark.parametrize("choice", [None, SourcePaper()])
def test_part_by_part_gives_what_the_whole_gives(make, tmp_path, monkeypatch, choice):
    two_speeds = [
        make(strokes=40, speed=speed, drift=0.01, seed=i, offset=lambda x: 3 * x, dwell=0.3)
        for i, speed in enumerate((0.01, 0.03))
    ]
    save(tmp_path / "a.parquet", two_speeds)
    layout = Layout.loads(LAYOUT)
    whole = characterise_recordings(tmp_path / "a.parquet", layout, choice)
    monkeypatch.setattr(extraction, "LONG_SAMPLES", 1000)
    monkeypatch.setattr(extraction, "PART_SAMPLES", 4000)
    parts = characterise_recordings(tmp_path / "a.parquet", layout, choice)
    assert any("was read in parts" in note for note in parts.notes)
    assert len(parts.levels) == len(whole.levels) == 2
    for a, b in zip(parts.levels, whole.levels, strict=True):
        assert [s.strokes for s in a.spreads.values()] == [s.strokes for s in b.spreads.values()]
        assert a.friction_n == pytest.approx(b.friction_n, rel=2e-3)
        assert a.offset_n == pytest.approx(b.offset_n, abs=2e-3)
        assert a.stderr_n == pytest.approx(b.stderr_n, rel=0.1)
        assert a.window_m == pytest.approx(b.window_m, abs=2e-5)
        assert a.u_systematic_n == pytest.approx(b.u_systematic_n, rel=0.05)
        assert a.rows[0]["breakaway_n"] == pytest.approx(b.rows[0]["breakaway_n"], abs=0.05, nan_ok=True)
        assert a.rows[0]["dwell_s"] == pytest.approx(b.rows[0]["dwell_s"], abs=0.02)
        assert set(a.flags) == set(b.flags)
    assert parts.results[0].recording.sha256 == whole.results[0].recording.sha256
    assert len(parts.results[0].recording) < 0.5 * len(whole.results[0].recording)


def test_a_long_trajectory_is_read_part_by_part_too(make, tmp_path, monkeypatch):
    r = make(strokes=40, drift=0.01, offset=lambda x: 3 * x, dwell=0.3)
    columns = {c: getattr(r, c) for c in COLUMNS if c != "force_n"} | {"friction_force_n": r.force_n}
    columns |= {"velocity_m_s": np.gradient(r.position_m, r.time_s), "command": np.zeros(len(r))}
    path = save_columns(columns, {}, tmp_path / "run.parquet")
    whole = characterise_recordings(path)
    monkeypatch.setattr(extraction, "LONG_SAMPLES", 1000)
    monkeypatch.setattr(extraction, "PART_SAMPLES", 4000)
    monkeypatch.setattr(load, "HASHED_ROWS", 700)
    parts = characterise_recordings(path)
    assert any("was read in parts" in note for note in parts.notes)
    assert not any("was read in parts" in note for note in whole.notes)
    for a, b in zip(parts.levels, whole.levels, strict=True):
        assert [s.strokes for s in a.spreads.values()] == [s.strokes for s in b.spreads.values()]
        assert a.friction_n == pytest.approx(b.friction_n, rel=2e-3)
        assert a.offset_n == pytest.approx(b.offset_n, abs=2e-3)
    found = parts.results[0].recording
    assert found.sha256 == whole.results[0].recording.sha256
    assert found.synthetic
    assert len(found) < 0.5 * len(r)


def test_strokes_longer_than_a_part_are_read_as_longer_parts_up_to_a_bound(make, tmp_path, monkeypatch):
    r = make(strokes=12, dwell=0.3)
    save(tmp_path / "a.parquet", [r])
    layout = Layout.loads(LAYOUT)
    whole = characterise_recordings(tmp_path / "a.parquet", layout)
    monkeypatch.setattr(extraction, "LONG_SAMPLES", 100)
    monkeypatch.setattr(extraction, "PART_SAMPLES", len(r) // 30)
    parts = characterise_recordings(tmp_path / "a.parquet", layout)
    assert [s.strokes for s in parts.levels[0].spreads.values()] == [
        s.strokes for s in whole.levels[0].spreads.values()
    ]
    monkeypatch.setattr(extraction, "LARGEST_PART", 2)
    with pytest.raises(RecordingError, match="samples contain"):
        characterise_recordings(tmp_path / "a.parquet", layout)


MEASURE = r"""
import re, sys
from importlib import import_module
one = import_module("pneudrive.friction.level")
from pneudrive.characterise import Layout, characterise_recordings
one.LONG_SAMPLES, one.PART_SAMPLES = 50_000, 100_000
found = characterise_recordings(sys.argv[1], Layout.loads(sys.stdin.read()))
own = re.search(r"VmHWM:\s+(\d+)", open("/proc/self/status").read())  # ru_maxrss is inherited from who started us
print(sum(s.strokes for s in found.levels[0].spreads.values()), own.group(1))
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the peak of memory is read from /proc")
def test_memory_does_not_grow_with_the_length(make, tmp_path):
    peak = {}
    for times in (2, 8):
        r = make(strokes=100 * times, rate=1000.0, dwell=0.01, travel=0.02)
        save(tmp_path / f"{times}.parquet", [r])
        done = subprocess.run(
            [sys.executable, "-c", MEASURE, str(tmp_path / f"{times}.parquet")],
            input=LAYOUT,
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        )
        strokes, peak[times] = map(int, done.stdout.split())
        assert strokes == 100 * times
        assert np.isfinite(peak[times])
    assert peak[8] < 1.1 * peak[2]
