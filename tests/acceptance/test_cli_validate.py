"""A user validates a drive and exports its friction from the command line: files, words, exit status."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from oracle.drive_records import drive, record
from pneudrive.cli.main import run
from pneudrive.describe.files import toml
from pneudrive.errors import FitError
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.export import steady_friction
from pneudrive.validate.motion import validate_friction

CIRCUIT = Path(__file__).parents[2] / "examples" / "two_cylinders.toml"


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    (folder / "drive.toml").write_text(drive().to_toml())
    own = record(drive(valve__conductance="1.6 dm3/(s bar)"), 3, duration_s=4.0)
    pl.DataFrame(own.columns).write_parquet(folder / "run.parquet")
    return folder


def test_validate_says_what_is_wrong_and_writes_report_and_numbers(bench, printed):
    out = bench / "validation"
    assert "less conductance C of the valve" in printed(
        ["validate", bench / "drive.toml", bench / "run.parquet", "--out", out]
    )
    page = (out / "report.html").read_text()
    assert "less conductance C of the valve" in page
    assert page.count("<figure>") == 1
    assert not re.search(r"(src|href)=\"https?:", page)
    kept = toml.tomllib.loads((out / "validation.toml").read_text())
    assert kept["diagnosis"]["culprit"][0]["what"] == "conductance"
    low, high = kept["diagnosis"]["culprit"][0]["interval"]
    assert low < -0.2 < high
    assert kept["record"][0]["position_m"]["free"]["fit_percent"] < 90.0
    assert [v["what"] for v in kept["verdict"]] == ["position", "pressure", "breakaway"]


def map_rows(speed: np.ndarray, direction: np.ndarray, **columns: object) -> pl.DataFrame:
    """Return rows of a friction map: 0 in each column that is not given."""
    rest = ("balance_n", "offset_n", "position_from_m", "position_to_m", "breakaway_n", "dwell_s", "loading_rate_n_s")
    texts = {"recording": "a", "flags": "", "samples": 100, "strokes": 5}
    own = {"direction": direction, "velocity_m_s": direction * speed}
    rows = dict.fromkeys(rest, 0.0) | texts | own | columns
    return pl.DataFrame({name: np.broadcast_to(values, speed.shape) for name, values in rows.items()})


def test_a_friction_map_is_validated_against_the_law(bench, printed):
    truth = drive()
    speed = np.tile(np.geomspace(2e-3, 0.4, 12), 2)
    direction = np.repeat([1, -1], 12)
    friction = 1.3 * steady_friction(truth.friction.core(), direction * speed, 2e5, 0.0)
    pressures = {"pressure_a_pa": 2e5 + truth.ambient.pressure_pa, "pressure_b_pa": truth.ambient.pressure_pa}
    random = dict.fromkeys(("offset_n", "stderr_n", "u_systematic_n"), 0.3)
    rows = map_rows(speed, direction, friction_n=friction, balance_n=direction * friction, **pressures, **random)
    rows.write_csv(bench / "map.csv")
    out = bench / "friction"
    said = printed(["validate", bench / "drive.toml", bench / "map.csv", "--out", out])
    assert "! fit" in said
    assert "within the band of 0 % of the points" in said
    table = list(csv.DictReader((out / "friction.csv").read_text().splitlines()))
    ratio = [float(row["friction_n"]) / float(row["model_n"]) for row in table]
    assert ratio == pytest.approx([1.3] * 24)
    assert (out / "report.html").is_file()


def test_export_of_a_drive_goes_to_the_terminal_or_a_file(bench, capsys, printed):
    source = [str(bench / "drive.toml"), "--speeds", "1 mm/s .. 400 mm/s"]
    assert "brkwy_frc = " in printed(["export", *source, "--to", "simscape"])
    target = bench / "friction.mo"
    assert run(["export", *source, "--to", "modelica", "--pressure-a", "3 bar gauge", "--out", str(target)]) == 0
    told = capsys.readouterr()
    assert str(target) in told.out
    assert "lost: dependence on the chamber pressures" in told.err
    assert "MassWithStopAndFriction" in target.read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["validate", "DRIVE", "nowhere.parquet"], "there is no such file"),
        (["validate", "DRIVE", "RUN", "--window", "5 mm"], "--window"),
        (["validate", "DRIVE", "RUN", "MAP"], "cannot be validated together"),
        (["export", "DRIVE", "--to", "simscape"], "has no range of measured speeds"),
        (["export", "DRIVE", "--to", "fmu"], "--out is missing: an FMU needs a file name"),
        (
            ["export", "DRIVE", "--to", "amesim", "--speeds", "1 mm/s .. 2 mm/s"],
            "the export to 'amesim' is not available",
        ),
        (["export", "DRIVE", "--to", "csv", "--pressure-a", "3 bar abs"], "is an absolute pressure"),
        (["export", "RUN", "--to", "csv"], "the file is binary"),
        (["export", "DRIVE", "--to", "fmu", "--out", "x.fmu", "--pressure-a", "3 bar gauge"], "--initial"),
        (
            ["export", "DRIVE", "--to", "fmu", "--out", "x.fmu", "--speeds", "1 mm/s .. 2 mm/s"],
            "--speeds has no effect",
        ),
        (["export", "DRIVE", "--to", "c", "--out", "x", "--fmi", "2.0"], "--fmi has no effect with --to c"),
        (["export", str(CIRCUIT), "--to", "st", "--speeds", "1 mm/s .. 2 mm/s"], "describes a circuit"),
    ],
)
def test_wrong_wishes_end_with_one_message_and_status_2(bench, refusal, words, message):
    files = {"DRIVE": "drive.toml", "RUN": "run.parquet", "MAP": "map.csv"}
    given = [str(bench / files[w]) if w in files else w for w in words]
    refusal(given, message)


def test_a_drive_is_identified_the_fit_put_into_it_and_exported_from_files_alone(tmp_path, capsys, printed, refusal):
    start, fit, applied = (tmp_path / name for name in ("drive.toml", "fit.toml", "identified.toml"))
    start.write_text(drive(friction__coulomb="24 N", valve__conductance="2.4 dm3/(s bar)").to_toml())
    for name, seed in (("run", 5), ("other", 6)):
        pl.DataFrame(record(drive(), seed, duration_s=3.0).columns).write_csv(tmp_path / f"{name}.csv")
    free = "friction.coulomb,valve.conductance"
    assert run(["identify", str(start), str(tmp_path / "run.csv"), "--free", free, "--out", str(fit)]) == 0
    said = capsys.readouterr()
    lines = (line.split("  ")[0].strip() for line in str(DriveFit.from_toml(fit)).splitlines())
    assert all(line in said.out for line in lines)
    with pytest.raises(FitError, match="Fit again"):
        DriveFit.from_toml(fit).profile()
    assert run(["apply", str(fit), "--out", str(applied)]) == 0
    found = pn.Drive.load(applied)
    assert found.friction.parameters["coulomb"] == pytest.approx(30.0, rel=0.01)
    assert set(found.provenance) == set(free.split(","))
    assert 'source = "run"' in printed(["apply", fit, "catalogue:reference"])
    out = str(tmp_path / "validation")
    assert "the balances close" in printed(["validate", applied, tmp_path / "other.csv", "--out", out])
    assert "recordings held out of the fit: 1 of 2" in printed(
        ["validate", fit, tmp_path / "run.csv", tmp_path / "other.csv", "--out", out]
    )
    kept = toml.tomllib.loads((tmp_path / "validation/validation.toml").read_text())
    assert [record["badge"] for record in kept["record"]] == ["made the fit", "held out"]
    assert kept["verdict"][0]["value"] == pytest.approx(kept["record"][1]["position_m"]["free"]["fit_percent"])
    assert "made the fit" in (tmp_path / "validation/report.html").read_text()
    assert "no recording was held out" in printed(["validate", applied, tmp_path / "run.csv", "--out", out])
    assert run(["export", str(fit), "--to", "csv", "--speeds", "1 mm/s .. 300 mm/s"]) == 0
    row = next(r for r in csv.reader(capsys.readouterr().out.splitlines()) if r[0] == "coulomb")
    assert float(row[3]) < 30.0 < float(row[4])
    refusal(["export", fit, "--to", "csv"], "--speeds")


def test_paired_friction_is_held_against_the_mean_of_both_directions(tmp_path):
    """A map's friction is half the difference of both directions, over the air of the room of each row."""
    room = np.tile([0.8e5, 1.0e5], 6)
    base = drive(ambient__pressure="0.8 bar abs")
    truth = base.replace({"friction.direction": {"positive": 1.2, "negative": 0.8}})
    speed, direction = np.tile(np.geomspace(2e-3, 0.4, 6), 2), np.repeat([1, -1], 6)
    pressures = {"pressure_a_pa": room + 2e5, "pressure_b_pa": room, "ambient_pressure_pa": room}
    known = dict.fromkeys(("stderr_n", "u_systematic_n", "breakaway_n", "dwell_s", "loading_rate_n_s"), 0.01)
    core = truth.friction.core()
    mean = 0.5 * (steady_friction(core, speed, 2e5, 0.0) + steady_friction(core, -speed, 2e5, 0.0))
    for flags, friction in (("", mean), ("unpaired", steady_friction(core, direction * speed, 2e5, 0.0))):
        rows = map_rows(speed, direction, friction_n=friction, flags=flags, **pressures, **known)
        rows.write_csv(tmp_path / "map.csv")
        for drive_of_the_law in (truth, truth.replace({"ambient.pressure": "1 bar abs"})):
            found = validate_friction(drive_of_the_law, tmp_path / "map.csv")
            assert found.metrics.largest < 1e-9
            assert set(found.points["direction"]) == ({0} if not flags else {1, -1})
