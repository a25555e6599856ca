"""What users read: names to the letter, for brackets in them are no markup; of many alike warnings some."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys

import numpy as np
import polars as pl
import pytest
import xarray as xr

import pneudrive as pn
from pneudrive.cli import main
from pneudrive.cli.terminal import show_table
from pneudrive.errors import CommandError, PneudriveWarning, warn
from pneudrive.simulation import trajectory


def test_names_with_brackets_are_shown_as_they_are(capsys):
    show_table(("seal", "<runs"), [("NBR [/dry]", "! [/dry]: [1, 2], " * 20)])  # wider than the terminal
    said = capsys.readouterr().out
    assert "NBR [/dry]" in said
    assert "! [/dry]: [1, 2]" in said


def test_warnings_that_differ_only_in_numbers_are_printed_three_times_and_counted(capsys):
    with main._plain_warnings():
        for number in range(10):
            warn(f"the gas cools to -{number}.5 degC in chamber b at 0.{number} s")
            warn(f"recording r{number} is odd")
    notes = capsys.readouterr().err.splitlines()
    assert sum("gas" in note for note in notes) == 4
    assert notes[-1].startswith("Note: 7 more with other numbers")
    assert sum("recording" in note for note in notes) == 10


# --- A trajectory says what it is and where it comes from, in memory and in each file; a file is whole or not there.

ORDER = [
    *["time_s", "position_m", "velocity_m_s", "acceleration_m_s2", "pressure_a_pa", "temperature_a_k"],
    *["pressure_b_pa", "temperature_b_k", "friction_force_n", "end_stop_force_n", "command"],
    *["mass_flow_a_kg_s", "mass_flow_b_kg_s", "bristle_deflection_m"],
]


@pytest.fixture(scope="module")
def run():
    drive = pn.Drive.load("catalogue:reference").replace({"labels": {"seal": "NBR"}})
    return pn.simulate(drive, "0 s: 0.6, 0.02 s: -0.6", "50.4 ms", initial="position = 50 mm", sample_rate="2 kHz")


def test_samples_lie_where_they_should(run):
    assert run.sizes["time"] == 102
    assert run.time.to_numpy()[:-1] == pytest.approx(np.arange(101) / 2000, abs=1e-15)
    assert run.time[-1] == 0.0504
    assert run.position[0] == 0.05
    assert set(np.unique(run.command)) == {0.6, -0.6}


def test_the_force_balance_closes_in_the_end_stop():
    """At the end of chamber b the stop pushes back like friction: positive, against +x."""
    drive = pn.Drive.load("catalogue:reference")
    run = pn.simulate(drive, command=[(0.0, 0.6)], duration="0.3 s", sample_rate="2 kHz")
    inside = run.position > drive.cylinder.stroke_m
    assert inside.any()
    assert float(run.end_stop_force.max()) > 100.0
    assert float(run.end_stop_force.min()) == 0.0
    force = drive.cylinder.area_a_m2 * (run.pressure_a - run.pressure_b) - run.friction_force - run.end_stop_force
    assert np.abs(force - drive.cylinder.moving_mass_kg * run.acceleration).max() < 1e-6


def test_units_and_provenance(run):
    assert {name: v.attrs["units"] for name, v in run.data_vars.items()} == {
        "position": "m",
        "velocity": "m/s",
        "acceleration": "m/s^2",
        "friction_force": "N",
        "end_stop_force": "N",
        "pressure_a": "Pa",
        "pressure_b": "Pa",
        "temperature_a": "K",
        "temperature_b": "K",
        "command": "1",
        "mass_flow_a": "kg/s",
        "mass_flow_b": "kg/s",
        "bristle_deflection": "m",
    }
    assert all(v.attrs["long_name"] for v in run.variables.values())
    assert run.attrs["description_hash"] == pn.Drive.load("catalogue:reference").description_hash
    assert run.attrs["statistics"]["steps"] > 10
    assert run.attrs["labels"] == {"seal": "NBR"}
    assert "@article{canudas1995" in pn.citations(run)
    assert "@article{armstrong1994" not in pn.citations(run)  # the source of a law that was not used


def _rebuilt(run):
    """Make the data set again by the public constructor of xarray, of the same columns."""
    columns = {name: ("time", one.to_numpy(), one.attrs) for name, one in run.data_vars.items()}
    return xr.Dataset(columns, {"time": ("time", run.time.to_numpy(), run.time.attrs)}, run.attrs)


def test_a_run_is_what_the_public_constructor_makes(run):
    """The data set is put together by a private door of xarray: nothing that a user does with it may show that."""
    for other in (_rebuilt(run), pickle.loads(pickle.dumps(run)), run.copy(deep=True)):
        assert run.identical(other)
        assert list(run.data_vars) == list(other.data_vars)
        assert run.indexes["time"].equals(other.indexes["time"])
    late = run.sel(time=slice(0.02, None))
    assert late.identical(_rebuilt(run).sel(time=slice(0.02, None)))
    assert 0 < late.sizes["time"] < run.sizes["time"]
    joined = run.assign(late_position=late.position)  # aligned by the index
    assert joined.late_position.isnull().sum() == run.sizes["time"] - late.sizes["time"]
    assert run.to_dataframe().equals(_rebuilt(run).to_dataframe())


def test_files_hold_the_same_numbers(run, tmp_path):
    paths = [trajectory.save(run, tmp_path / f"run{suffix}") for suffix in trajectory.SUFFIXES]
    parquet, text = pl.read_parquet(paths[0]), pl.read_csv(paths[1])
    assert parquet.columns == text.columns == ORDER
    assert parquet.equals(text)
    with xr.open_dataset(paths[2], engine="h5netcdf") as netcdf:
        for column in ORDER:
            name = trajectory.meaning(column)[0]
            assert np.array_equal(netcdf[name], run[name]), name
            assert np.array_equal(parquet[column], run[name]), name
        assert netcdf.attrs["description_hash"] == run.attrs["description_hash"]
        assert json.loads(netcdf.attrs["statistics"]) == run.attrs["statistics"]
    provenance = json.loads(pl.read_parquet_metadata(paths[0])["pneudrive"])
    assert provenance["labels"] == {"seal": "NBR"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.csv", "run.nc", "run.parquet"]


def test_nothing_half_written_is_left(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("old")

    def fail():
        with trajectory.whole(path) as temporary:
            temporary.write_text("half")
            raise OSError(28, "No space left on device")

    with pytest.raises(CommandError, match=r"run\.csv cannot be written: No space left"):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("run.xlsx", "files ending in '.xlsx'"),
        ("run", "files ending in ''"),
        ("no/run.csv", "does not exist"),
        ("file/run.csv", "is not a folder"),
    ],
)
def test_targets_are_refused_before_any_work(tmp_path, name, what):
    (tmp_path / "file").touch()
    with pytest.raises(CommandError, match=what):
        trajectory.check_target(tmp_path / name)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"duration": "2"}, "duration: .* has no unit"),
        ({"duration": "2 mm"}, "duration: .* is a length"),
        ({"duration": "-1 s"}, "duration = -1 s is out of bounds"),
        ({"duration": float("nan")}, "duration = nan is out of bounds"),
        ({"duration": "1 us"}, "gives 0.001 samples"),
        ({"sample_rate": "0 Hz"}, "sample_rate = 0 Hz is out of bounds"),
        ({"sample_rate": "1e12 Hz"}, "gives 1e\\+10 samples"),
        ({"rtol": 0.0}, "rtol = 0.0 is out of bounds"),
        ({"rtol": float("nan")}, "rtol = nan is out of bounds"),
    ],
)
def test_wrong_arguments(change, what):
    given = {"command": [(0.0, 0.5)], "duration": "10 ms"} | change
    with pytest.raises(CommandError, match=what):
        pn.simulate(pn.Drive.load("catalogue:reference"), **given)


def test_a_law_that_is_not_passive_warns_once():
    with pytest.warns(PneudriveWarning, match="not passive") as caught:
        pn.simulate(pn.Drive.load("catalogue:reference"), [(0.0, 0.5)], "10 ms")
    assert len(caught) == 1


def shown_by(code):
    """Return what lines of Python show in a fresh process."""
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def test_heavy_libraries_wait_for_their_use():
    heavy = ["numpy", "pydantic", "xarray", "pint", "polars", "scipy", "matplotlib"]
    assert shown_by(f"import sys, pneudrive; print([m for m in {heavy} if m in sys.modules])") == "[]"


@pytest.mark.parametrize("first", ["pneudrive.simulation.simulate", "pneudrive.describe"])
def test_the_function_outranks_the_module_of_its_name(first):
    code = f"import {first}, pneudrive; from pneudrive.simulation.simulate import run; "
    assert shown_by(f"{code}print(callable(pneudrive.simulate))") == "True"


@pytest.mark.parametrize(
    ("drive", "initial", "words"),
    [
        ("drive.toml", None, "drive is a str"),
        (None, None, "drive is a NoneType"),
        ("catalogue", 0.05, "initial state has the type float"),
    ],
)
def test_what_is_no_description_is_refused(drive, initial, words):
    given = pn.Drive.load("catalogue:reference") if drive == "catalogue" else drive
    with pytest.raises(pn.PneudriveError, match=words):
        pn.simulate(given, "0 s: 0", "1 ms", initial=initial)


def test_seals_that_let_breakaway_fall_below_sliding_are_told(tmp_path):
    """Only the Coulomb force grows with pressure here: at 6 bar it exceeds the breakaway force."""
    text = pn.Drive.load("catalogue:reference").to_toml()
    text += '\n[friction.pressure]\ncoulomb = { a = "5 N/bar", b = "0 N/bar" }\n'
    path = tmp_path / "drive.toml"
    path.write_text(text)
    drive = pn.Drive.load(path)
    with pytest.warns(PneudriveWarning, match="breakaway force falls below"):
        pn.simulate(drive, command=[(0.0, 0.6)], duration="0.01 s")


def test_the_ledger_closes_and_changes_no_bit(tmp_path):
    """Accounts on demand: the books close, the motion is the same, and they survive a file."""
    drive = pn.Drive.load("catalogue:reference")
    plain, booked = (
        pn.simulate(drive, command=[(0.0, 0.6)], duration="0.3 s", rtol=1e-9, ledger=ledger) for ledger in (False, True)
    )
    assert "ledger" not in plain.attrs
    assert (plain.position == booked.position).all()
    books = booked.attrs["ledger"]
    assert abs(books["mass_error"]) < 1e-12
    assert abs(books["energy_error"]) < 1e-6
    assert books["energy_turnover_j"] > 100.0
    pn.save(booked, tmp_path / "run.nc")
    assert "energy_turnover_j" in str(xr.load_dataset(tmp_path / "run.nc").attrs["ledger"])
