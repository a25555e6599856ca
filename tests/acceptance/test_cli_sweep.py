"""``pneudrive sweep``: tables, what is refused, and studies that are interrupted, killed or out of disk."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import xarray as xr

import pneudrive as pn
from pneudrive.cli.main import run
from pneudrive.ensemble.many import EnsembleStudy

CIRCUIT = str(Path(__file__).parents[2] / "examples" / "two_cylinders.toml")
NAMES = ("left.bore", "right.friction.coulomb")
HEAD = ["sweep", "catalogue:reference", "--command", "0 s: 1", "--duration", "0.02 s"]
VARY = ["--vary", "cylinder.bore = uniform(20 mm, 30 mm)", "--vary", "load.mass = normal(3 kg, 5 %)"]
STUDY = [*HEAD, *VARY, "--members", "23", "--seed", "5", "--chunk", "4"]


@pytest.fixture(scope="module")
def expected():
    vary = {"cylinder.bore": "uniform(20 mm, 30 mm)", "load.mass": "normal(3 kg, 5 %)"}
    return pn.simulate_many(pn.Drive.load("catalogue:reference"), "0 s: 1", "0.02 s", vary=vary, n=23, seed=5)


def test_tables_hold_what_python_gives(tmp_path, printed, expected):
    for ending in ("parquet", "csv", "nc"):
        out = tmp_path / f"many.{ending}"
        assert "23 members, 0 failed" in printed([*STUDY, "--out", out])
        assert [path.name for path in tmp_path.iterdir()] == [out.name]  # no parts are left
        if ending == "nc":
            with xr.open_dataset(out) as found:
                xr.testing.assert_equal(found.load(), expected)
        else:
            table = pl.read_parquet(out) if ending == "parquet" else pl.read_csv(out)
            assert table.columns[:5] == ["member", "status", "reason", "cylinder.bore_m", "load.mass_kg"]
            np.testing.assert_array_equal(table["final_position_m"], expected.final_position)
        out.unlink()


def test_designs_from_text_and_files(tmp_path, capsys, expected):
    rows = tmp_path / "rows.csv"
    pl.DataFrame({n: expected[n].values[:3] for n in ("cylinder.bore", "load.mass")}).write_csv(rows)
    assert run([*HEAD, "--vary", str(rows), "--out", str(tmp_path / "a.parquet")]) == 0
    table = pl.read_parquet(tmp_path / "a.parquet")
    np.testing.assert_array_equal(table["final_position_m"], expected.final_position[:3])
    grid = ["--vary", "cylinder.bore = grid(20 mm .. 30 mm, 3)", "--vary", "load.mass = grid(0 kg, 2 kg)"]
    output = ["--output", "top = max(velocity)", "--output", "samples(position, 1 kHz)"]
    assert run([*HEAD, *grid, *output, "--out", str(tmp_path / "folder")]) == 0
    (chunk,) = (tmp_path / "folder").glob("members-*.parquet")
    table = pl.read_parquet(chunk)
    assert table["load.mass_kg"].to_list() == [0.0, 2.0] * 3
    assert table["position_m"].to_numpy().shape == (6, 21)
    assert table["top_m_s"].is_sorted() is False


def test_a_circuit_file_is_swept(tmp_path, capsys, printed, refusal):
    """Commands have the names of valves, what varies those of components; a table may vary them too."""
    out, commands = tmp_path / "many.parquet", ["--command", "valve_l: 0 s: 1, 10 ms: -1", "--command", "valve_r: 0.4"]
    vary = ["--vary", "left.bore = uniform(30 mm, 34 mm)", "--vary", "right.friction.coulomb = normal(20 N, 10 %)"]
    head = ["sweep", CIRCUIT, *commands, "--duration", "20 ms", "--out", str(out)]
    assert "two cylinders on one tank: 5 members, 0 failed" in printed(
        [*head, *vary, "--members", "5", "--output", "final(left.position)"]
    )
    table = pl.read_parquet(out)
    assert table.columns[3:] == ["left.bore_m", "right.friction.coulomb_n", "final_left.position_m"]
    each = {"valve_l": "0 s: 1, 10 ms: -1", "valve_r": "0.4"}
    rows = {name: table[column].to_numpy() for name, column in zip(NAMES, table.columns[3:5], strict=True)}
    expected = pn.simulate_many(pn.Circuit.load(CIRCUIT), each, "20 ms", vary=rows, outputs=["final(left.position)"])
    np.testing.assert_array_equal(table["final_left.position_m"], expected["final_left.position"])
    rows = tmp_path / "rows.csv"
    table[table.columns[3:5]].write_csv(rows)
    assert run([*head, "--vary", str(rows), "--output", "final(left.position)"]) == 0
    np.testing.assert_array_equal(pl.read_parquet(out)["final_left.position_m"], expected["final_left.position"])
    refusal([*head, "--vary", "left.bor = 30 mm"], "Did you mean 'left.bore'")
    refusal(
        ["sweep", "catalogue:reference", "--duration", "1 s", *VARY, "--out", out],
        "the command of the valve is missing",
    )


@contextmanager
def stopped_after(chunks, monkeypatch):
    """Let Ctrl-C come after so many chunks; yields the chunks that were run."""
    ran, whole = [], EnsembleStudy.run

    def some(self, look=None):
        if len(ran) == chunks:
            raise KeyboardInterrupt
        ran.append(self.first)
        return whole(self, look)

    with monkeypatch.context() as patched:
        patched.setattr(EnsembleStudy, "run", some)
        yield ran


def test_an_interrupted_study_goes_on_where_it_was(tmp_path, capsys, monkeypatch, expected):
    out, parts = tmp_path / "many.parquet", tmp_path / "many.parquet.parts"
    with stopped_after(2, monkeypatch) as before:
        assert run([*STUDY, "--out", str(out)]) == 130
    assert len(list(parts.glob("members-*"))) == 2
    damaged = sorted(parts.glob("members-*"))[0]
    damaged.write_bytes(damaged.read_bytes()[:-9])
    capsys.readouterr()
    with stopped_after(99, monkeypatch) as after:
        assert run([*STUDY, "--out", str(out)]) == 0
    assert "1 of 6 chunks" in capsys.readouterr().err
    assert len(after) == 5
    assert before[0] in after
    assert before[1] not in after
    np.testing.assert_array_equal(pl.read_parquet(out)["stroke_time_s"], expected.stroke_time)
    np.testing.assert_array_equal(pl.read_parquet(out)["final_velocity_m_s"], expected.final_velocity)


def test_a_killed_study_goes_on_where_it_was(tmp_path, expected):
    out = tmp_path / "study"
    many = [*STUDY[:-2], "--members", "1000", "--chunk", "40", "--out", str(out)]
    command = [sys.executable, "-m", "pneudrive", *many]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        until = time.monotonic() + 60.0
        while len(list(out.glob("members-*"))) < 2 and time.monotonic() < until:
            time.sleep(0.005)
        os.kill(child.pid, signal.SIGKILL)
    kept = {path: path.read_bytes() for path in out.glob("members-*")}
    assert 2 <= len(kept) < 25
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    assert len(list(out.glob("members-*"))) == 25
    assert not [path for path in out.iterdir() if path.name.startswith(".")]
    assert all(path.read_bytes() == image for path, image in kept.items())
    every = pl.read_parquet(out / "members-*.parquet")
    assert every["member"].to_list() == list(range(1000))
    np.testing.assert_array_equal(every["final_position_m"][:23], expected.final_position)


def test_another_study_is_refused_and_the_chunks_are_kept(tmp_path, capsys, refusal):
    out = str(tmp_path / "study")
    assert run([*STUDY, "--out", out]) == 0
    before = sorted(path.name for path in (tmp_path / "study").iterdir())
    for changed, what in (
        (["--initial", "position = 20 mm"], "the same initial"),
        (["--vary", "friction.coulomb = uniform(20 N, 30 N)"], "the same vary"),
    ):
        refusal([*STUDY, *changed, "--out", out], "another study", what)
    assert sorted(path.name for path in (tmp_path / "study").iterdir()) == before
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").touch()
    assert run([*STUDY, "--out", str(tmp_path / "other")]) == 2


@contextmanager
def room_for(size):
    """Let no file grow beyond so many bytes, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_is_one_message_and_finished_chunks_are_kept(tmp_path, capsys):
    out, parts = tmp_path / "many.parquet", tmp_path / "many.parquet.parts"
    study = [*STUDY, "--out", str(out)]
    with room_for(3000):  # not for a chunk
        assert run(study) == 2
    assert capsys.readouterr().err.count("cannot be written") == 1
    assert run([*STUDY, "--out", str(tmp_path / "whole")]) == 0
    chunk = max(path.stat().st_size for path in (tmp_path / "whole").iterdir())
    with room_for(chunk):  # not for the table of all chunks, which says where it comes from
        assert run(study) == 2
    assert capsys.readouterr().err.count("cannot be written") == 1
    assert not out.exists()
    assert len(list(parts.glob("members-*"))) == 6
    assert run(study) == 0
    assert "6 of 6 chunks" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--vary", "cylinder.bor = 20 mm"], "Did you mean 'cylinder.bore'"),
        (["--vary", "cylinder.bore = 20 mm", "--vary", "cylinder.bore = 21 mm"], "cylinder.bore twice"),
        (["--vary", "cylinder.bore = 20 mm, 21 mm", "--vary", "load.mass = 1 kg"], "unequal lengths"),
        (["--vary", "cylinder.bore = 20 mm, 0 mm"], "row 1 of the design"),
        (["--vary", "nowhere.csv"], "nowhere.csv"),
        (["--vary", "fit.toml"], "--members is missing"),
        ([*VARY, "--members", "4", "--output", "final(rpm)"], "no signal rpm"),
    ],
)
def test_what_is_wrong_is_one_message_before_anything_runs(tmp_path, refusal, more, said):
    refusal([*HEAD, *more, "--out", tmp_path / "many.parquet"], said)
    assert not list(tmp_path.iterdir())


def test_members_without_a_value_are_counted_beside_the_quantiles(tmp_path, capsys):
    head = ["sweep", "catalogue:parker-osp-p25-sy5000", "--command", "1", "--duration", "0.13 s"]
    rows = ["--vary", "load.mass = 0.5 kg, 1 kg, 8 kg, 9 kg"]
    assert run([*head, *rows, "--output", "stroke_time", "--out", str(tmp_path / "a.csv")]) == 0
    times = pl.read_csv(tmp_path / "a.csv")["stroke_time_s"].to_numpy()
    assert np.isnan(times).tolist() == [False, False, True, True]
    said = capsys.readouterr().out
    assert "stroke_time has no value in 2 of 4 members" in said
    assert f"{np.nanmedian(times):.5g}" in said
