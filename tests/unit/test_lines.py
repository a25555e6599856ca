"""Speed and stroke time against tubes: choked speed by the rule for restrictions in series, strokes by simulation."""

from __future__ import annotations

import math

import polars as pl
import pytest

import pneudrive as pn
from pneudrive.cli.main import run
from pneudrive.datasheet.characteristics.steady import velocity_gain
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.errors import CommandError, DescriptionError

#: Length in m and bore in mm -> choked speed of the reference drive, m/s, worked out by hand.
CHOKED = {(0.5, 4): 2.707, (1.0, 4): 2.297, (2.0, 4): 1.830, (5.0, 4): 1.258, (1.0, 6): 3.636}


@pytest.fixture(scope="module")
def reference():
    return pn.Drive.load("catalogue:reference")


@pytest.fixture(scope="module")
def study(reference):
    return pn.lines(reference, ["0.5 m", 1.0, "2 m", "500 cm"], ["4 mm", "6 mm"])


def test_a_switching_valve_opens_fully():
    study = pn.lines(pn.Drive.load("catalogue:parker-osp-p25-sy5000"), ["1 m"], ["4 mm"])
    assert float(study.vent_speed[0, 0]) < study.without_tubes["vent_speed"] == pytest.approx(5.688, rel=1e-3)


def test_the_choked_speed_is_that_of_restrictions_in_series(study):
    """M choked behind a: C = C1 phi(r) with r = C/C2, and phi the ellipse with b1; both roots of it are known."""
    for (length, bore), speed in CHOKED.items():
        found = study.sel(length=length, diameter=bore * 1e-3, method="nearest")
        assert round(float(found.vent_speed), 3) == speed
        d = bore * 1e-3
        c1, c2 = 0.029 * d**2 / math.sqrt(length / d**1.25 + 510.0), 2e-8
        b1 = 474.0 * c1 / d**2
        a, e = c1 / c2, 1.0 - b1  # ((r - b1)/e)^2 + (r/a)^2 = 1, r the pressure between them over that before
        p, q, s = 1 / e**2 + 1 / a**2, -2 * b1 / e**2, b1**2 / e**2 - 1.0
        r = (-q + math.sqrt(q * q - 4 * p * s)) / (2 * p)
        assert float(found.vent_conductance) == pytest.approx(c2 * r if r > b1 else c1, rel=1e-9)
    assert study.attrs["without_tubes"]["vent_speed"] == pytest.approx(4.0628, abs=5e-5)


def test_the_choked_speed_of_cold_air_is_that_of_steady_motion(reference):
    cold = reference.replace({"ambient.temperature": "-20 degC"})
    speed = pn.lines(cold, ["1 m"], ["4 mm"]).attrs["without_tubes"]["vent_speed"]
    slope, _ = velocity_gain(HeldDrive(cold), 1.0)
    assert speed == pytest.approx(slope, rel=1e-4)


def test_a_stroke_of_the_study_is_that_of_the_drive(reference, study):
    tube = {"length": "2 m", "diameter": "4 mm"}
    drive = reference.replace({"tubing": {"a": tube, "b": tube}})
    ran = pn.simulate(drive, 1.0, "0.6 s", initial={"position": "0 mm", "pressure_b": "7 bar abs"})
    impact = ran.attrs["impacts"][0]
    found = study.sel(length=2.0, diameter=0.004)
    assert float(found.stroke_time_out) == pytest.approx(impact["time_s"], abs=2e-5)
    assert float(found.end_speed) == pytest.approx(impact["speed_m_s"], rel=1e-3)
    own = pn.lines(drive, [2.0], [0.004])
    assert own.attrs["as_described"]["stroke_time_out"] == pytest.approx(float(own.stroke_time_out[0, 0]), rel=1e-9)
    assert own.attrs["without_tubes"] == study.attrs["without_tubes"]


def test_a_drive_that_does_not_arrive_is_told(capsys, tmp_path):
    path = tmp_path / "drive.toml"
    path.write_text('drive = "catalogue:reference"\n[load]\nforce = "-400 N"\n')
    assert run(["lines", str(path), "--length", "1 m", "--diameter", "4 mm"]) == 0
    assert capsys.readouterr().out.splitlines()[3].split()[:7] == ["4", "mm", "1", "m", "1.131", "2.297", "never"]


def test_lines_on_the_command_line(tmp_path, printed):
    table, picture = tmp_path / "lines.csv", tmp_path / "lines.png"
    asked = ["--length", "1 m, 2 m", "--diameter", "4 mm", "--out", str(table), "--plot", str(picture)]
    said = printed(["lines", "catalogue:reference", *asked])
    assert "an empirical formula (assumed" in said
    assert [line.split()[:6] for line in said.splitlines()[3:5]] == [
        ["4", "mm", "1", "m", "1.131", "2.297"],
        ["4", "mm", "2", "m", "0.901", "1.830"],
    ]
    assert pl.read_csv(table).columns[:4] == ["diameter_m", "length_m", "vent_conductance_m3_s_pa", "vent_speed_m_s"]
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_wrong_input_gets_one_message(tmp_path, refusal, reference):
    refusal(["lines", "catalogue:reference", "--length", "1 bar"], 'length: unit "bar" is a pressure')
    refusal(["lines", "catalogue:reference", "--diameter", "0 mm"], "diameter = 0 mm is out of bounds")
    refusal(["lines", "catalogue:reference", "--length", ","], "is not a list of quantities")
    assert run(["lines", "catalogue:reference", "--plot", str(tmp_path / "x.html")]) == 2
    circuit = tmp_path / "circuit.toml"
    circuit.write_text(reference.circuit.to_toml())
    refusal(["lines", circuit], "the table of tubes needs a drive, but got a Circuit")
    with pytest.raises(CommandError, match="not a list"):
        pn.lines(reference, "1 m")
    with pytest.raises(DescriptionError, match="needs a drive"):
        pn.lines("drive.toml")
