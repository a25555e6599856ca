"""Results of every kind are read by one function, and two of one kind are compared in common units."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from pneudrive.cli.main import run as command
from pneudrive.errors import CommandError
from pneudrive.files.tables import open_table
from pneudrive.results import StoredResult, kind_of

ROOT = Path(__file__).parents[2]
KIDNEY = ROOT / "data/measurements/zillen-2021-pneumatic-piston"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with two runs, an ensemble, a circuit, a friction map and its fit."""
    folder = tmp_path_factory.mktemp("results")
    drive = pn.Drive.load("catalogue:reference")
    for name, mass in (("light", "1 kg"), ("heavy", "4 kg")):
        changed = drive.replace({"load.mass": mass})
        (folder / f"{name}.toml").write_text(changed.to_toml())
        made = pn.simulate(changed, "0 s: 0.6, 0.5 s: -0.6", "1 s")
        for suffix in ("parquet", "csv", "nc"):
            pn.save(made, folder / f"{name}.{suffix}")
    words = ["--vary", "load.mass = uniform(1 kg, 4 kg)", "--members", "8", "--command", "1", "--duration", "0.3 s"]
    for out in ("many.parquet", "many.csv", "many"):
        assert command(["sweep", "catalogue:reference", *words, "--out", str(folder / out)]) == 0
    recordings = [str(KIDNEY / f"friction/Kidney_{bar}bar.csv.xz") for bar in (1, 3)]
    layout = ["--layout", str(KIDNEY / "layout.toml")]
    assert command(["characterise", *recordings, *layout, "--out", str(folder / "friction")]) == 0
    return folder


def test_a_run_is_read_from_each_of_its_forms(folder):
    runs = [pn.load(folder / f"light.{suffix}") for suffix in ("parquet", "csv", "nc")]
    for each in runs:
        assert kind_of(each) == "run"
        assert np.array_equal(each["pressure_a"], runs[0]["pressure_a"])
        assert each["pressure_a"].attrs["units"] == "Pa"
    assert runs[0].pneu.info().rows == runs[2].pneu.info().rows
    quantities = {row.quantity for row in runs[0].pneu.info().rows}
    assert quantities >= {"stroke time", "peak pressure, absolute", "air into chambers, l ANR"}
    assert len(runs[2].pneu.plot().axes) == len(runs[0].pneu.plot().axes)


def test_the_air_of_a_run_is_that_of_its_gas(folder):
    """The piston goes to the end of chamber b: the air is the gas that chamber a has gained."""
    drive = pn.Drive.load(folder / "light.toml")
    made = pn.simulate(drive, "0 s: 0.6", "2 s", initial="position = 0 mm")
    samples = made, made.isel(time=slice(None, None, 50))
    air, coarse = (next(row.value for row in run.pneu.info().rows if row.key == "air") for run in samples)
    assert "--energy" in str(coarse)
    dead_m3 = float(drive.cylinder.dead_volume.a)
    volume = drive.cylinder.area_a_m2 * made.position.to_numpy() + dead_m3
    gas = made.pressure_a.to_numpy() * volume / (287.05 * made.temperature_a.to_numpy())
    assert air == pytest.approx((gas[-1] - gas[0]) / 1.185 * 1e3, rel=0.01)
    braked = pn.simulate(drive, "0 s: 0, 0.1 s: 0.6, 0.15 s: 0.3, 1 s: -1", "2 s", initial="position = 0 mm")
    rows = {row.key: row.value for row in braked.pneu.info().rows}
    assert rows["impact 1.stroke time"] == pytest.approx(
        rows["impact 1.time"] - 0.1
    )  # a weaker command is no new stroke


@pytest.mark.parametrize("name", ["many.parquet", "many.csv", "many"])
def test_an_ensemble_is_read_from_file_and_folder(folder, name):
    found = pn.load(folder / name)
    assert found.sizes["member"] == 8
    masses = pn.load(folder / "many.parquet")["load.mass"].to_numpy()
    assert np.allclose(found["load.mass"], masses)


def test_descriptions_fits_maps_and_folders_are_read(folder):
    assert isinstance(pn.load(folder / "light.toml"), pn.Drive)
    assert isinstance(pn.load(ROOT / "examples/two_cylinders.toml"), pn.Circuit)
    assert kind_of(pn.load(ROOT / "data/measurements/affetto-2024/regulator.toml")) == "regulator"
    assert kind_of(pn.load(folder / "friction/map.csv")) == "friction map"
    assert kind_of(pn.load(folder / "friction/fit.toml")) == "friction fit"
    found = pn.load(folder / "friction")
    assert isinstance(found, StoredResult)
    assert len(found.view().curves) == len({curve.label for curve in found.view().curves}) > 1


def test_what_is_not_a_result_is_said(folder, tmp_path):
    (tmp_path / "table.csv").write_text("a,b\n1,2\n")
    for path, what in (
        (tmp_path / "none", "there is no"),
        (tmp_path, "not a result"),
        (tmp_path / "table.csv", "not a"),
    ):
        with pytest.raises(CommandError, match=what):
            pn.load(path)
    with pytest.raises(CommandError, match="only results of the same kind"):
        pn.compare_results(folder / "light.toml", folder / "light.parquet")
    text = (ROOT / "tests/web/inputs/validation.toml").read_text()
    (tmp_path / "validation.toml").write_text(text.replace("clean = ", "cleaned = "))
    with pytest.raises(CommandError, match=r"validation\.toml is incomplete: 'clean'"):
        pn.load(tmp_path / "validation.toml").view()


def test_two_circuits_are_compared_in_one_unit(tmp_path):
    text = (ROOT / "examples/two_cylinders.toml").read_text()
    assert 'volume = "0.5 l"' in text
    (tmp_path / "a.toml").write_text(text)
    (tmp_path / "b.toml").write_text(text.replace('volume = "0.5 l"', 'volume = "0.6 l"'))
    compared = pn.compare_results(tmp_path / "a.toml", tmp_path / "b.toml")
    (pair,) = compared.values
    assert (pair.key, pair.before, pair.after) == ("components.tank.volume", "500 cm3", "600 cm3")
    assert pair.change == pytest.approx(0.2)
    assert compared.sentence.endswith("components.tank.volume +20 %.")
    flow = 'check_nominal_flow = "203.4 l/min ANR"'  # 0.8 dm3/(s bar) with b = 0.3
    (tmp_path / "b.toml").write_text(text.replace('check_conductance = "0.8 dm3/(s bar)"', flow))
    pairs = pn.compare_results(tmp_path / "a.toml", tmp_path / "b.toml").values
    assert {pair.key.rpartition(".")[2] for pair in pairs} == {"check_conductance"}
    assert all(abs(pair.change) < 1e-3 for pair in pairs)


def test_needles_of_two_drives_are_compared_as_conductances():
    sizes = {"critical_pressure_ratio": 0.3, "check_conductance": "4 dm3/(s bar)"}
    first, second = (
        pn.Drive.load("catalogue:reference").replace({"flow_control": {"a": sizes | {key: size}}})
        for key, size in (("conductance", "2 dm3/(s bar)"), ("nominal_flow", "300 l/min ANR"))
    )
    (pair,) = pn.compare_results(first, second).values
    assert (pair.key, pair.after) == ("flow_control.a.conductance", "1.18 dm3/(s bar)")  # ISO 6358 by hand


def test_gauge_and_absolute_pressure_have_no_relative_change():
    drive = pn.Drive.load("catalogue:reference")
    both = (drive.replace({"supply.pressure": text}) for text in ("6 bar gauge", "7.013 bar abs"))
    assert [pair.change for pair in pn.compare_results(*both).values] == [None]


def test_two_runs_are_compared_by_values_and_curves(folder, tmp_path, printed, refusal):
    picture, files = tmp_path / "both.svg", [str(folder / f"{name}.parquet") for name in ("light", "heavy")]
    said = printed(["compare", *files, "--plot", picture])
    assert "curves differ" in said
    assert "impact 1.stroke time" in said
    head = next(line for line in said.splitlines() if line.startswith("value "))
    assert head.index("light.parquet") < head.index("heavy.parquet")
    assert next(line for line in said.splitlines() if line.startswith("air ")).count(" l ANR") == 2
    refusal(["compare", *files, "--out", str(tmp_path / "out")], "--out writes the report of two campaigns")
    assert picture.stat().st_size > 10_000
    compared = pn.compare_results(*files)
    position = next(pair for pair in compared.curves if pair.first.label == "position")
    light, heavy = (pl.read_parquet(file)["position_m"].to_numpy() for file in files)
    assert np.array_equal(position.difference, heavy - light)
    assert len(compared.figure().panels) == 8
    assert pn.compare_results(files[0], files[0]).sentence == "No value differs."


def test_maps_and_fits_are_compared_with_their_bands(folder):
    friction = pn.load(folder / "friction/map.parquet")
    more = friction.assign(friction_n=friction["friction_n"] + 1.0, pressure_b_pa=friction["pressure_b_pa"] + 500.0)
    compared = pn.compare_results(friction, more)
    assert len(compared.curves) == len(pn.compare_results(friction, friction).curves) > 0
    for pair in compared.curves:
        assert np.allclose(pair.difference, 1.0)
        assert (pair.half_band > 0.0).all()
    less = pn.compare_results(friction, friction.assign(friction_n=friction["friction_n"] + 1e-6))
    assert less.sentence == "No curve differs beyond its 95 % interval."
    fit = pn.load(folder / "friction/fit.toml")
    assert not pn.compare_results(fit, fit).curve_rows()


def test_two_sizings_are_compared(tmp_path):
    parts = {"cylinder": "festo-dsbg-32-100", "valve": "smc-sy3000", "tube": "smc-tu0604", "flow_control": "none"}
    task = {"name": "lift", "mass": "2 kg", "stroke": "100 mm", "time": "0.3 s", "supply": {"pressure": "6 bar gauge"}}
    drive = {"parts": parts, "setting": {}, "draws": 16, "met": 16, "probability_bound": 0.8, "air": 1e-3}
    drive |= {"time_out": 0.2, "time_back": 0.2, "end_speed": 0.5, "energy": 1.0, "peak_pressure": 7e5, "sizes": []}
    drive |= {"margins": {"energy out": 0.5}, "worst": {"energy out": [1.0, 2.0, "J"]}, "measure": "", "explains": 0.0}
    counts = dict.fromkeys(("enumerated", "left", "tuned"), 1) | {"pruned": {}, "complete": True}
    for name, time, valve in (("a", 0.2, "smc-sy3000"), ("b", 0.25, "smc-sy5000")):
        (tmp_path / name).mkdir()
        content = counts | {"task": task, "ranked": [drive | {"time_out": time, "parts": parts | {"valve": valve}}]}
        (tmp_path / name / "result.json").write_text(json.dumps(content))
    air = next(row for row in pn.load(tmp_path / "a").view().rows if row.quantity == "air of a cycle, l ANR")
    assert air.value == pytest.approx(1e-3 / 1.185 * 1e3)  # stored in kg
    changes = [(pair.key, pair.after) for pair in pn.compare_results(tmp_path / "a", tmp_path / "b").values]
    assert changes == [("rank 1.time out", "0.250 s"), ("rank 1.parts", "festo-dsbg-32-100 + smc-sy5000 + smc-tu0604")]


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("python/pneudrive/web/drive/first_task.toml", "SizingTask"),
        ("python/pneudrive/data/demo/layout.toml", "Layout"),
        ("tests/old_files/4f85f3b/protocol.toml", "Protocol"),
        ("tests/old_files/motion-fit.toml", "FollowFit"),
    ],
)
def test_a_file_is_read_by_its_kind(file: str, name: str) -> None:
    assert type(pn.load(Path(__file__).parents[2] / file)).__name__ == name


@pytest.mark.parametrize("suffix", [".nc", ".parquet"])
def test_a_stored_run_lists_its_drive_by_the_path_from_its_folder(tmp_path: Path, suffix: str) -> None:
    axis = tmp_path / "axis.toml"
    axis.write_text(pn.Drive.load("catalogue:reference").to_toml())
    drive = pn.Drive.load(axis)
    (tmp_path / "runs" / "old").mkdir(parents=True)
    first, again = tmp_path / "runs" / f"run{suffix}", tmp_path / "runs" / "old" / f"run{suffix}"
    pn.save(pn.simulate(drive, "0.5", "20 ms"), first)
    pn.save(pn.load(first), again)
    for path, file in ((first, "../axis.toml"), (again, "../../axis.toml")):
        about = open_table(path, "netcdf" if suffix == ".nc" else "parquet").metadata
        known = json.loads(about["inputs"] if suffix == ".nc" else about["pneudrive"])
        (stored,) = known if suffix == ".nc" else known["inputs"]
        assert stored == {"kind": "drive", "name": drive.name, "file": file, "sha256": drive.description_hash}
        assert pn.load(path).attrs["inputs"] == [stored | {"file": str(axis.resolve())}]
