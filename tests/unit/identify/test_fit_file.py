"""fit.toml keeps a fit: what is read back equals what was written, to the last bit."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import CommandError, FitError
from pneudrive.identify import FrictionFit, fit_friction
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.files import read_fit

SPEED = np.geomspace(1e-3, 0.45, 16)


def fits(make_map, friction_of):
    noise = 0.2 * np.random.default_rng(21).standard_normal(32)
    gauge = np.repeat([0.0, 2e5], 16)
    slopes = {"coulomb_a": 5e-6, "breakaway_a": 1e-5}
    speed = np.tile(SPEED, 2)
    data = make_map(
        speed, friction_of(speed, gauge, gauge, slopes) + noise, 0.2, gauge_a=gauge, gauge_b=gauge, systematic=0.1
    )
    yield fit_friction(data)
    yield fit_friction(data, pressure_dependence=True)
    yield fit_friction(data, "stribeck free")
    yield fit_friction(data, law="coulomb")
    yield fit_friction(make_map([0.01, 0.02], [5.0, 6.0], 0.1))


def test_written_and_read(make_map, friction_of, tmp_path):
    for fit in fits(make_map, friction_of):
        fit.to_toml(tmp_path / "fit.toml")
        again = FrictionFit.from_toml(tmp_path / "fit.toml")
        np.testing.assert_array_equal(again.covariance, fit.covariance)
        assert str(again) == str(fit)
        assert again.intervals == fit.intervals
        assert again.undetermined == fit.undetermined
        assert again.provenance == fit.provenance
        assert again.model == fit.model
        for one, other in zip(vars(again.predict(SPEED)).values(), vars(fit.predict(SPEED)).values(), strict=True):
            np.testing.assert_array_equal(one, other)
        assert [p.name for p in tmp_path.iterdir()] == ["fit.toml"]


def test_file_is_plain_toml_with_units(make_map, friction_of, tmp_path):
    fit = next(fits(make_map, friction_of))
    fit.to_toml(tmp_path / "fit.toml")
    content = tomllib.loads((tmp_path / "fit.toml").read_text())
    entry = content["parameters"]["stribeck_velocity"]
    assert entry["unit"] == "m/s"
    assert entry["interval"][0] < entry["value"] < entry["interval"][1]
    assert content["covariance"]["names"] == list(fit.free)
    assert len(content["provenance"]["map_sha256"]) == 64


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "is empty"), ("schema = 9", "another schema"), ("[", "is not TOML"), ("schema = 1", "not a complete")],
)
def test_files_that_are_no_fit(tmp_path, text, message):
    (tmp_path / "fit.toml").write_text(text)
    with pytest.raises(FitError, match=message):
        FrictionFit.from_toml(tmp_path / "fit.toml")
    with pytest.raises(FitError, match="there is no file"):
        FrictionFit.from_toml(tmp_path / "none.toml")


def test_place_that_cannot_be_written(make_map, tmp_path):
    fit = fit_friction(make_map([0.01, 0.02], [5.0, 6.0], 0.1))
    with pytest.raises(CommandError, match="cannot be written"):
        fit.to_toml(tmp_path / "missing" / "fit.toml")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("law", '"dahl"'),
        ("chambers", "[1, 2, 3]"),
        ("chambers", '["c"]'),
        ("names", "[]"),
        ("matrix", "[[1.0]]"),
        ("degrees_of_freedom", "nan"),
        ("degrees_of_freedom", "inf"),
        ("variance", "-1.0"),
        *((key, None) for key in ("law", "chambers", "names", "matrix", "degrees_of_freedom", "rms_n", "direction")),
    ],
)
def test_a_fit_whose_parts_do_not_fit_together(make_map, friction_of, tmp_path, key, value):
    """Found by users' hands in fit.toml: each ended in a traceback somewhere behind the reader."""
    path = tmp_path / "fit.toml"
    next(fits(make_map, friction_of)).to_toml(path)
    FrictionFit.from_toml(path)
    lines = path.read_text().splitlines()
    changed = [line for line in lines if value is not None or not line.startswith(f"{key} = ")]
    changed = [f"{key} = {value}" if line.startswith(f"{key} = ") else line for line in changed]
    assert changed != lines
    path.write_text("\n".join(changed))
    with pytest.raises(FitError, match="not a complete friction fit"):
        FrictionFit.from_toml(path)


@pytest.fixture
def drive_fit(tmp_path):
    """Return the path of a fit of a drive as `pneudrive identify` writes it, with two values."""
    drive = pn.Drive.load("catalogue:reference")
    fit = DriveFit(
        values={"friction.coulomb": 30.0, "friction.viscous": 40.0},
        units={"friction.coulomb": "N", "friction.viscous": "N s/m"},
        free=("friction.coulomb", "friction.viscous"),
        covariance=np.diag([1e-4, 4e-4]),
        intervals={"friction.coulomb": (29.98, 30.02), "friction.viscous": (39.96, 40.04)},
        statistics={"samples": 501.0, "rms.position": 1e-6, "fit_percent.position": 99.9},
        provenance={"version": "0.1.0", "recordings": [{"name": "run", "sha256": "0", "seconds": 0.5}]},
        sensors={},
        start=drive,
    )
    fit.to_toml(tmp_path / "fit.toml")
    return tmp_path / "fit.toml"


@pytest.mark.parametrize(
    ("line", "instead", "message"),
    [
        ('name = "run"', "", r"provenance\.recordings\.0\.name is missing"),
        ('name = "run"', "name = 3", r"recordings\.0\.name must be a text"),
        ("value = 30.0", 'value = "30 N"', r"friction\.coulomb\.value must be a number"),
        ('unit = "N"', "", r"friction\.coulomb\.unit is missing"),
        ("[statistics]", "[other]", "statistics is missing"),
        ("seconds = 0.5", "seconds = []", "seconds must be a number"),
        ("interval = [29.98, 30.02]", "interval = [29.98]", "interval"),
    ],
)
def test_an_incomplete_fit_of_a_drive_is_refused_with_key_and_line(drive_fit, line, instead, message):
    read_fit(drive_fit)
    text = drive_fit.read_text(encoding="utf-8")
    assert line in text
    drive_fit.write_text(text.replace(line, instead, 1), encoding="utf-8")
    with pytest.raises(FitError, match=message) as caught:
        read_fit(drive_fit)
    assert (f"{drive_fit}:" in str(caught.value)) is (line != "[statistics]")  # a missing table has no line


def test_older_fits_of_motions_and_regulators_are_read(tmp_path):
    """They had a table for each property of the values."""
    old = Path(__file__).parents[2] / "old_files"
    motion, lag = (read_fit(old / f"{kind}-fit.toml") for kind in ("motion", "regulator"))
    assert motion.values["upper.volume"] == 0.025002976032786055
    assert motion.intervals["upper.volume"] == (0.02498958781693419, 0.02501725748812891)
    assert motion.details["upper.volume"]["model_interval"] == [0.02499373165267061, 0.02501222383210136]
    assert motion.apply().components
    assert lag.values["gain_pa"] == 503417.26028572366
    assert lag.details["gain_pa"]["run_to_run"] == 0.0009706905030083219
    assert lag.statistics["held"] == 4.139061084138796 / 100.0
    assert list(lag.hashes) == ["run 0", "run 1", "run 2"]
    for fit in (motion, lag):
        fit.to_toml(tmp_path / "again.toml")
        again = read_fit(tmp_path / "again.toml")
        assert (str(again), again.intervals) == (str(fit), fit.intervals)
