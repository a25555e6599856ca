"""The commands of a driven spring, as a user types them: identify, validate and simulate along a recorded motion."""

import re

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from oracle.gas_spring import AREAS, CIRCUIT, Truth, record
from pneudrive.cli.main import run
from pneudrive.errors import CommandError, DescriptionError

LAYOUT = f"""
header = true
delimiter = "comma"
[columns]
time = {{ column = "t", unit = "s" }}
position = {{ column = "x", unit = "m" }}
force = {{ column = "F", unit = "N" }}
pressure_a = {{ column = "pa", unit = "Pa abs" }}
pressure_b = {{ column = "pb", unit = "Pa abs" }}
[geometry]
area_a = "{AREAS[0]} m2"
area_b = "{AREAS[1]} m2"
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    r = record(Truth(), seconds=60.0)
    rows = [r.time_s, r.position_m, r.force_n + r.parallel[0].force_n, r.pressure_a_pa, r.pressure_b_pa]
    text = "\n".join(["t,x,F,pa,pb", *(",".join(f"{v:.7g}" for v in row) for row in np.transpose(rows))])
    (tmp_path / "run.csv").write_text(text + "\n", encoding="utf-8")
    (tmp_path / "layout.toml").write_text(LAYOUT, encoding="utf-8")
    (tmp_path / "spring.toml").write_text(CIRCUIT, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def go(line):
    return run(line.split())


def test_the_way_of_a_user(folder, capsys):
    with_layout = "--layout layout.toml"
    assert not go(f"identify spring.toml run.csv {with_layout} --follow motion --out gas.toml --report page")
    said = capsys.readouterr().out
    assert re.search(r"a leak past the piston .* not determined; the sum of squares changes", said)
    assert (folder / "page/report.html").stat().st_size > 10_000
    kept = pn.load("gas.toml")
    assert {rival.name for rival in kept.rivals} >= {"held", "leak"}
    assert kept.apply().components
    assert not go(f"validate gas.toml run.csv {with_layout} --out check")
    assert "run, force: closes within" in capsys.readouterr().out
    assert (folder / "check/report.html").is_file()
    assert (folder / "check/validation.toml").is_file()
    assert not go(f"simulate gas.toml --motion run.csv {with_layout} --out run.parquet")
    table, measured = pl.read_parquet("run.parquet"), record(Truth(), seconds=60.0)
    assert np.ptp(table["upper.pressure_pa"].to_numpy()) == pytest.approx(np.ptp(measured.pressure_a_pa), rel=0.02)
    made = pn.validate("gas.toml", "run.csv", follow="motion", layout="layout.toml")
    assert made.badges == {"run": "made the fit"}
    assert "no recording was held out" in str(made)
    fit = pn.identify("spring.toml", ["run.csv"], ["volumes"], follow="motion", layout="layout.toml")
    assert set(fit.values) == {"upper.volume", "lower.volume"}
    for call in (pn.identify, pn.validate):
        with pytest.raises((CommandError, DescriptionError), match=r'in Python follow="motion"'):
            call(pn.Circuit.load("spring.toml"), ["run.csv"])
        with pytest.raises(CommandError, match="the only value"):
            call("spring.toml", ["run.csv"], follow="force")
    assert go("simulate gas.toml --out run.parquet") != 0
    assert "the duration is missing" in capsys.readouterr().err
