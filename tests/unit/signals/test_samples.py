"""Bad samples are flagged, counted, and kept out of the averages."""

from __future__ import annotations

import os
import re
import struct
from dataclasses import replace
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import polars as pl
import pytest
import xarray as xr

from pneudrive.characterise import characterise_recordings, from_run
from pneudrive.errors import RecordingError
from pneudrive.files import tables
from pneudrive.files.tables import open_table
from pneudrive.signals.load import COLUMNS, VARIABLES, from_trajectory
from pneudrive.signals.recording import clean


def changed(recording, channel, where, value):
    values = getattr(recording, channel).copy()
    values[where] = value
    return replace(recording, **{channel: values})


def test_a_clean_recording_has_no_flags(make):
    assert clean(make()).flags == {}
    assert clean(make(noise=0.0, position_noise=0.0)).flags == {}


def test_non_finite_samples(make):
    recording = changed(make(), "force_n", [100, 200], [np.nan, np.inf])
    assert clean(recording).flags == {"non_finite": 2}
    assert characterise_recordings(recording).levels[0].friction_n == pytest.approx(5.0, abs=0.03)


@pytest.mark.parametrize(("channel", "size"), [("force_n", 50.0), ("pressure_b_pa", 1e5), ("position_m", 0.01)])
def test_many_spikes_do_not_hide_each_other(make, channel, size):
    recording = make(strokes=20)
    recording = replace(
        recording, pressure_b_pa=recording.pressure_b_pa + np.random.default_rng(1).normal(0, 50, len(recording))
    )
    at = np.arange(150, len(recording) - 50, 97)  # 1 % of the samples
    noisy = changed(recording, channel, at, getattr(recording, channel)[at] + size)
    assert clean(noisy).flags == {"spike": at.size}


def test_a_reversal_is_no_spike(make):
    assert "spike" not in clean(make(presliding=1e-5, noise=0.0)).flags


def test_saturation(make):
    recording = make(friction=lambda x: 5.0 + 200.0 * x)
    clipped = clean(replace(recording, force_n=np.minimum(recording.force_n, 155.0)))
    assert clipped.flags["saturated"] == int((recording.force_n >= 155.0).sum()) > 100
    limited = replace(recording, limits={"force_n": (-1e3, 150.0)})
    assert clean(limited).flags["saturated"] == int((recording.force_n >= 150.0).sum())


def test_a_stuck_sensor(make):
    recording = make()
    stuck = changed(recording, "force_n", slice(600, 700), recording.force_n[600])
    assert clean(stuck).flags == {"stuck": 100, "gap": 1}
    frozen = changed(recording, "position_m", slice(600, 700), recording.position_m[600])
    assert clean(frozen).flags["stuck"] >= 90


def test_gaps_and_repeated_times(make):
    recording = make()
    keep = np.ones(len(recording), bool)
    keep[500:560] = False
    cut = replace(
        recording,
        **{
            c: getattr(recording, c)[keep]
            for c in ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
        },
    )
    assert clean(cut).flags == {"gap": 1}
    doubled = changed(recording, "time_s", 300, recording.time_s[299])
    assert clean(doubled).flags == {"repeated_time": 1}


# --- A trajectory is characterised like a recording: its friction, and the stick-slip in it.

PERIOD, STEP = 0.5, 0.005


@pytest.fixture
def columns():
    """Ten rests of 0.3 s and moves of 5 mm, friction 20 N at rest and 15 N in motion."""
    time = np.arange(0.0, 5.0, 0.002)
    move = np.clip((np.mod(time, PERIOD) / PERIOD - 0.6) / 0.4, 0.0, 1.0)
    position = STEP * (np.floor(time / PERIOD) + (1 - np.cos(np.pi * move)) / 2)
    values = dict.fromkeys(COLUMNS, np.full(time.size, 3e5))
    friction = np.where(move > 0, 15.0, 20.0)
    velocity = np.gradient(position, time)
    return {**values, "time_s": time, "position_m": position, "velocity_m_s": velocity, "friction_force_n": friction}


def write(columns, path):

    if path.suffix == ".nc":
        names = dict(zip(COLUMNS, VARIABLES, strict=True))
        xr.Dataset({names[c]: ("sample", v) for c, v in columns.items()}).to_netcdf(path, engine="h5netcdf")
    else:
        frame = pl.DataFrame(columns)
        frame.write_parquet(path) if path.suffix == ".parquet" else frame.write_csv(path)
    return path


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".nc"])
def test_files_need_no_layout(columns, tmp_path, suffix):
    found = characterise_recordings(write(columns, tmp_path / f"run{suffix}"))
    (level,) = found.levels
    assert {"unpaired", "stick_slip"} <= set(level.flags)
    assert 15.0 < level.friction_n < 20.0
    assert found.synthetic
    assert found.closures == ()
    (note,) = (n for n in found.notes if n.startswith("Stick-slip in run"))
    assert "period 0.5 s, step 5 mm" in note


def test_an_exact_trajectory_has_no_bad_samples(columns):
    # At rest at its end stop and at supply pressure for a third of the time: what a sensor would do when it is clipped.
    at_rest = np.mod(columns["time_s"], PERIOD) < 0.3 * PERIOD
    noise = np.random.default_rng(1).normal(0.0, 100.0, at_rest.size)
    columns["pressure_a_pa"] = np.where(at_rest, 7e5, 6.9e5 + noise)
    assert from_trajectory(columns, "run").flags == {}
    assert clean(from_trajectory(columns, "run")).flags == {}
    assert "saturated" in clean(replace(from_trajectory(columns, "run"), accuracy={})).flags


def test_the_dataset_of_a_simulation(columns):

    names = dict(zip(COLUMNS, VARIABLES, strict=True))
    time = columns.pop("time_s")
    run = xr.Dataset({names[c]: ("time", v) for c, v in columns.items()}, coords={"time": time})
    slips = characterise_recordings(run).levels[0].stick_slip
    assert slips[0].period_s == pytest.approx(PERIOD, rel=0.01)
    two = characterise_recordings([run, run.assign(friction_force=run.friction_force + 1.0)])
    assert [r.name for r in two.recordings] == ["trajectory-1", "trajectory-2"]
    with pytest.raises(RecordingError, match="lacks velocity"):
        characterise_recordings(run.drop_vars("velocity"))
    with pytest.raises(RecordingError, match="lacks velocity"):
        from_run(run.drop_vars("velocity"))


@pytest.mark.parametrize("given", [None, 3.0, np.zeros(4)])
def test_what_is_no_recording_is_refused(given):
    with pytest.raises(RecordingError, match="this is not a recording"):
        characterise_recordings([given])
    if not np.iterable(given):
        with pytest.raises(RecordingError, match="this is not a recording"):
            characterise_recordings(given)


# --- A small file states a large table: it is refused by its header, before anything is read.


def constants_netcdf(path: Path) -> None:
    """Write two columns of a fill value, which stands for any number of samples."""
    with h5py.File(path, "w") as file:
        for name in ("time", "position"):
            file.create_dataset(name, (400_000_000,), "f8", chunks=(1_000_000,), fillvalue=1.0)


def constants_mat(path: Path) -> None:
    """Write a fill value into a MAT file of version 7.3, which is HDF5."""
    with h5py.File(path, "w", userblock_size=512) as file:
        data = file.create_dataset("time", (1, 400_000_000), "f8", chunks=(1, 1_000_000), fillvalue=1.0)
        data.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def cells_mat(path: Path, *, inside: bool) -> None:
    """Write a cell array, alone or inside a structure, that states 400 million cells and holds none."""

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    def matrix(of_class: int, rows: int, name: bytes, rest: bytes) -> bytes:
        head = element(6, struct.pack("<II", of_class, 0)) + element(5, struct.pack("<ii", rows, 1))
        return element(14, head + element(1, name) + rest)

    cells = matrix(1, 400_000_000, b"" if inside else b"many", b"")
    if inside:
        cells = matrix(2, 1, b"record", struct.pack("<HHI", 5, 4, 8) + element(1, b"many".ljust(8, b"\0")) + cells)
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + cells)


def constants_parquet(path: Path) -> None:
    """Write equal values, which are stored once with their number."""
    pl.DataFrame({"time": pl.repeat(1.0, 20_000_000, eager=True)}).write_parquet(path)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.nc", constants_netcdf),
        ("b.mat", constants_mat),
        ("c.mat", partial(cells_mat, inside=False)),
        ("d.mat", partial(cells_mat, inside=True)),
        ("e.parquet", constants_parquet),
    ],
)
def test_a_small_file_does_not_fill_the_memory(tmp_path, name, write):
    """Each of these states 160 MB to 6 GB in at most 1 MB, and is refused by its header."""
    write(tmp_path / name)
    assert (tmp_path / name).stat().st_size < 1e6
    before = max(most_memory(), 5e8)  # the libraries of this process and of the reader
    with pytest.raises(RecordingError, match=r"unpacks to|Unable to allocate|MemoryError|cannot be read"):
        all_columns(tmp_path / name)
    assert most_memory() - before < 3e8


def all_columns(path: Path) -> None:
    opened = open_table(path, {".nc": "netcdf"}.get(path.suffix, path.suffix[1:]))
    opened.get(opened.names)


def most_memory() -> float:
    """Return the largest memory of this process and of the reader process so far, bytes."""
    process = tables._reader._process
    files = [Path(f"/proc/{pid}/status") for pid in (os.getpid(), process.pid if process else None)]
    found = [re.search(r"VmHWM:\s+(\d+)", one.read_text()) for one in files if one.exists()]
    return 1024.0 * sum(int(one[1]) for one in found if one)
