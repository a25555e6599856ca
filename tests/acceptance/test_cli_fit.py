"""`pneudrive fit` and `pneudrive design` from end to end: a law with its reasons, then the next points to measure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from oracle.campaigns import World, write_campaign
from pneudrive import _core
from pneudrive.characterise import read_map, write_map
from pneudrive.cli.identify import joined_maps
from pneudrive.cli.main import run
from pneudrive.friction.friction_map import AMBIENT
from pneudrive.identify import FrictionFit
from web.maps import friction_map

DATA = Path(__file__).resolve().parents[2] / "data" / "measurements" / "zillen-2021-pneumatic-piston" / "friction"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with the map of a seal whose friction grows with the pressure in chamber b, and its fit."""
    where = tmp_path_factory.mktemp("fit")

    def friction(speeds, gauges):
        laws = (
            {"coulomb": 20 + 1e-5 * gauge, "breakaway": 30 + 2e-5 * gauge, "stribeck_velocity": 0.012, "viscous": 60.0}
            for gauge in gauges
        )
        steady = (_core.steady_friction("stribeck", law, np.array([v])) for law, v in zip(laws, speeds, strict=True))
        return np.concatenate([*steady])

    whole = friction_map(friction, tuple(np.geomspace(2e-3, 0.4, 6)), (0.0, 2e5, 4e5, 6e5), 0.2)
    write_map(whole.drop_vars(AMBIENT).drop_attrs(), where / "map.parquet")  # of a version that did not write it
    assert run(["fit", str(where / "map.parquet"), "--laws", "stribeck", "--pressure", "linear",
                "--out", str(where / "fit.toml")]) == 0  # fmt: skip
    return where


def test_a_map_is_fitted_and_laws_are_compared(folder, tmp_path, capsys):
    target = tmp_path / "best.toml"
    assert run(["fit", str(folder / "map.parquet"), "--laws", "coulomb,stribeck", "--pressure", "linear",
                "--out", str(target)]) == 0  # fmt: skip
    said, aside = capsys.readouterr()
    assert "1.01325 bar is assumed" in aside
    assert "held out in turn: each of 4 conditions of pressure" in said
    assert "recommended: stribeck" in said
    assert FrictionFit.from_toml(target).law == "stribeck"


def test_real_recordings_that_a_straight_line_misses(tmp_path, printed):
    files = [str(DATA / f"NAPN_{bar}bar.csv.xz") for bar in (1, 3, 5, 7)]
    said = printed(["fit", *files, "--laws", "coulomb", "--out", tmp_path / "fit.toml"])
    assert "recommended: coulomb, quadratic in pressure" in said
    assert "a straight line in pressure does not hold: its error for a held-out pressure is up to 31 %" in said
    assert FrictionFit.from_toml(tmp_path / "fit.toml").model.pressure == "quadratic"


def test_several_seals_are_fitted_each_and_surveyed(tmp_path, printed):
    files = [str(path) for name in ("NAPN", "PK", "O-ring") for path in sorted(DATA.glob(f"{name}_*.csv.xz"))]
    said = printed(
        ["fit", *files, "--laws", "coulomb", "--pressure", "linear", "--by", "seal", "--out", tmp_path / "fit.toml"]
    )
    assert {path.name for path in tmp_path.glob("*.toml")} == {f"fit-{name}.toml" for name in ("NAPN", "PK", "O-ring")}
    assert "recordings of one seal scatter by" in said
    assert "no seal was run twice" in said


def test_a_seal_with_too_few_pressures_stops_no_other(tmp_path, printed):
    """The O-ring was measured at two pressures: none can be held out."""
    files = [str(path) for name in ("O-ring", "PK") for path in sorted(DATA.glob(f"{name}_*.csv.xz"))]
    command = ["fit", *files, "--laws", "coulomb", "--hold-out", "pressure", "--by", "seal"]
    assert "O-ring is not fitted: holding out one condition" in printed([*command, "--out", tmp_path / "fit.toml"])
    assert {path.name for path in tmp_path.glob("*.toml")} == {"fit-PK.toml"}
    assert run([*command[:2], *command[-6:], "--out", str(tmp_path / "alone.toml")]) == 2


def test_a_campaign_is_fitted_seal_by_seal(tmp_path, printed):
    campaign = write_campaign(tmp_path / "campaign", World(samples=200, repeats=1), 1)
    assert "coulomb friction from" in printed(
        ["fit", campaign, "--laws", "coulomb", "--by", "seal", "--out", tmp_path / "fit.toml"]
    )
    assert list(tmp_path.glob("fit*.toml"))


def test_next_points_are_a_protocol_that_the_rig_takes(folder, tmp_path, printed):
    target = tmp_path / "next.toml"
    said = printed(["design", folder / "fit.toml", "--points", "8", "--out", target])
    assert "D-optimal: 8 points" in said
    assert "stribeck_velocity" in said
    assert "pre-flight: passed" in printed(["campaign", "plan", target])


def test_maps_are_fitted_together_at_their_gauge_pressures(folder, tmp_path, printed, refusal):
    path = folder / "map.parquet"
    both = ["fit", str(path), str(path), "--laws", "stribeck gaussian", "--pressure", "linear"]
    assert "from 96 values" in printed([*both, "--out", tmp_path / "fit.toml"])
    first = read_map(path).assign_attrs(ambient_pressure_pa=101325.0)
    low = {name: first[name] - 3000.0 for name in ("pressure_a_pa", "pressure_b_pa")}
    joined = joined_maps([path, path], [first, first.assign(low).assign_attrs(ambient_pressure_pa=98325.0)])
    assert sorted(set(joined["pressure_a_pa"].to_numpy())) == sorted(set(first["pressure_a_pa"].to_numpy()))
    (tmp_path / "recording.csv").write_text("1,2")
    refusal([*both[:2], tmp_path / "recording.csv"], "recordings cannot be fitted together with")


def test_next_stops_are_a_protocol_that_the_rig_takes(folder, tmp_path, printed):
    target = tmp_path / "stops.toml"
    assert "stops for the log law: 0.1 s" in printed(["design", folder / "fit.toml", "--stops", "log", "--out", target])
    assert "pre-flight: passed" in printed(["campaign", "plan", target])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fit", "nothing.csv"], "there is no nothing.csv"),
        (["fit", "{fit}"], 'a file of the kind "fit", not a recording or a friction map'),
        (["report", "{map}"], "this is a table, not a fit"),
        (["report", "{fit}", "--map", "{fit}"], "this is not a friction map"),
        (["fit", "{map}", "--laws", "stribek gaussian"], "Did you mean 'stribeck gaussian'"),
        (["fit", "{map}", "--pressure", "cubic"], "--pressure cubic is not known"),
        (["fit", "{map}", "--hold-out", "day"], "the friction map has no column 'day'"),
        (["fit", "{map}", "--out", "fit.txt"], "fit.txt: files ending in '.txt' cannot be written"),
        (["fit", "{map}", "--by", "seals"], "no column 'seals'"),
        (["design", "nothing.toml"], "there is no file nothing.toml"),
        (["design", "{fit}", "--points", "5", "--time", "1 h"], "cannot be given together"),
        (["design", "{fit}", "--criterion", "A"], "there is no criterion 'A'"),
        (["design", "{fit}", "--stops", "logarithm"], "there is no dwell law 'logarithm'"),
        (["design", "{fit}", "--out", "next.txt"], "a protocol cannot be written there"),
    ],
)
def test_wrong_input_is_one_message_and_status_2(folder, tmp_path, monkeypatch, refusal, arguments, words):
    monkeypatch.chdir(tmp_path)
    names = {"map": folder / "map.parquet", "fit": folder / "fit.toml"}
    refusal([word.format(**names) for word in arguments], words)


def test_a_page_of_a_fit_with_its_data_and_of_its_file(folder, tmp_path):
    """Values, intervals, what is open; residuals only with the data, which the page of a file says."""
    target, page = tmp_path / "fit.toml", tmp_path / "page"
    call = ["fit", str(folder / "map.parquet"), "--laws", "stribeck gaussian", "--pressure", "linear"]
    assert run([*call, "--report", str(page), "--out", str(target)]) == 0
    fit = FrictionFit.from_toml(target)
    assert ">mean friction, weighted<" in (page / "report.html").read_text("utf-8")
    assert run(["report", str(target), "--out", str(tmp_path / "again")]) == 0
    pages = [(where / "report.html").read_text("utf-8") for where in (page, tmp_path / "again")]
    row = next(row for row in fit.view().table()[1] if row[0] == "coulomb")
    for html in pages:
        assert all(cell in html for cell in row if cell)
    assert [("difference / N" in html, "without its data" in html) for html in pages] == [(True, False), (False, True)]
