"""Parquet files of trajectories: whatever reads Parquet finds the numbers, the texts and the seal in them."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from pneudrive.errors import CommandError, RecordingError
from pneudrive.files import seal
from pneudrive.files.tables import open_table
from pneudrive.simulation import trajectory

GROUP = 1 << 18  # rows of a group


def _saved(tmp_path, columns, provenance=None):
    return trajectory.save_columns(columns, provenance or {}, tmp_path / "run.parquet")


@pytest.mark.parametrize("rows", [0, 1, 7, GROUP, 2 * GROUP + 3])
def test_each_number_comes_back(tmp_path, rows):
    rng = np.random.default_rng(rows)
    columns = {"time_s": np.arange(rows) / 1e3, "Kraft µN": rng.normal(size=rows)}
    columns["Kraft µN"][: rows // 2 : 3] = [np.nan, np.inf, -np.inf, -0.0, 5e-324][rows % 5]
    path = _saved(tmp_path, columns)
    read = pl.read_parquet(path)
    assert read.columns == list(columns)
    for name, values in columns.items():
        assert read[name].to_numpy().tobytes() == values.tobytes()
    part = open_table(path, "parquet").get(["time_s"], (rows // 2, rows))["time_s"]
    assert np.array_equal(part, columns["time_s"][rows // 2 :])


def test_a_group_is_left_out_only_where_it_has_none_of_the_values_asked(tmp_path):
    """Readers skip groups by their least and greatest value; nan has no order, and -0 equals 0."""
    values = np.concatenate([np.full(GROUP, 2.0), np.full(GROUP, -0.0), np.full(GROUP, 0.0)])
    values[5], values[9] = np.nan, 7.0
    scan = pl.scan_parquet(_saved(tmp_path, {"time_s": np.arange(values.size) * 1.0, "x": values}))
    assert scan.filter(pl.col("x") == 7.0).collect()["time_s"].to_list() == [9.0]
    assert scan.filter(pl.col("x") == 0.0).collect().height == 2 * GROUP
    assert scan.filter(pl.col("time_s") >= 3 * GROUP - 2).collect().height == 2


def test_texts_and_seal(tmp_path):
    path = _saved(tmp_path, {"time_s": np.arange(3.0)}, {"title": "Zylinder µ", "long": "x" * 5000})
    told = pl.read_parquet_metadata(path)
    assert json.loads(told["pneudrive"]) == {"title": "Zylinder µ", "long": "x" * 5000}
    assert seal.look(path, path.stat().st_size) == (None, True)
    damaged = bytearray(path.read_bytes())
    damaged[60] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(RecordingError, match="checksum"):
        open_table(path, "parquet")


def test_a_large_file_is_hashed_once_until_it_changes(tmp_path, monkeypatch):
    monkeypatch.setattr(seal, "STRETCH", 1 << 16)  # of a file of 1.6 MB
    path = _saved(tmp_path, {"x": np.random.default_rng(0).random(200_000)})
    assert open_table(path, "parquet").is_sealed
    with monkeypatch.context() as closed:
        closed.setattr(seal, "_look", None)
        assert open_table(path, "parquet").count() == 200_000
    with path.open("r+b") as file:
        file.seek(1_000_000)
        file.write(b"x")
    with pytest.raises(RecordingError, match="checksum"):
        open_table(path, "parquet")


def test_what_is_no_row_of_floats_is_written_too(tmp_path):
    drive = pn.Drive.load("catalogue:reference")
    found = pn.simulate(drive, "0 s: 0.6", "20 ms").isel(time=slice(None, None, 2))  # arrays with gaps
    found["phase"] = ("time", np.arange(found.sizes["time"]))
    path = trajectory.save(found, tmp_path / "run.parquet")
    read = pl.read_parquet(path)
    assert read["phase"].dtype == pl.Int64
    assert np.array_equal(read["position_m"], found.position)
    path = trajectory.save(found.drop_vars("phase"), path)
    assert np.array_equal(pl.read_parquet(path)["position_m"], found.position)


def test_a_file_that_cannot_be_written_says_why(tmp_path, monkeypatch):
    with pytest.raises(CommandError, match="does not exist"):
        trajectory.save_columns({"x": np.zeros(1)}, {}, tmp_path / "no" / "run.parquet")
    write = Path.write_bytes
    monkeypatch.setattr(Path, "write_bytes", lambda _, data: write(Path("/dev/full"), data))
    with pytest.raises(CommandError, match=r"run.parquet cannot be written: No space left"):
        _saved(tmp_path, {"x": np.random.default_rng(0).random(100_000)})
    assert not list(tmp_path.iterdir())


def test_columns_of_any_encoding_are_read_in_part(tmp_path):
    """Compressed, with missing values, with a dictionary, whole numbers, next to a column of tables."""
    x = np.repeat(np.arange(50.0), 40)
    frame = pl.DataFrame({"x": x, "gap": [None, *x[1:]], "whole": np.arange(x.size), "inner": [{"x": 1.0}] * x.size})
    path = tmp_path / "foreign.parquet"
    for compression in ("uncompressed", "zstd", "snappy"):
        frame.write_parquet(path, compression=compression)
        for name in ("x", "gap", "whole"):
            read = open_table(path, "parquet").get([name], (7, 90))[name]
            assert np.array_equal(read, frame[name].to_numpy()[7:90], equal_nan=True)


def test_a_file_that_changes_after_it_was_opened_is_named(tmp_path):
    path = tmp_path / "run.parquet"
    table = open_table(_saved(tmp_path, {"time_s": np.arange(9.0)}), "parquet")
    path.write_bytes(b"PAR1" + bytes(20) + b"PAR1")
    with pytest.raises(RecordingError, match="changed after it was opened"):
        table.get(["time_s"])
