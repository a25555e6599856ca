"""A trajectory is characterised like a recording: its friction, and the stick-slip in it."""

from dataclasses import replace

import numpy as np
import pytest

from pneudrive.characterise import characterise_recordings, from_run
from pneudrive.errors import RecordingError
from pneudrive.signals.load import COLUMNS, VARIABLES, from_trajectory
from pneudrive.signals.recording import clean

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
    import polars as pl
    import xarray as xr

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
    import xarray as xr

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
