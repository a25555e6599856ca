"""A trajectory as a picture, by the suffix of the file; wrong names are one message."""

from pathlib import Path

import pytest

import pneudrive as pn
from pneudrive.errors import CommandError, PneudriveWarning

STARTS = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF", ".html": b"<!DOCTYPE html>"}


@pytest.fixture(scope="module")
def run():
    return pn.simulate(pn.Drive.load("catalogue:parker-osp-p25-sy5000"), "0 s: 1, 0.2 s: -1", "0.4 s")


@pytest.mark.parametrize("suffix", STARTS)
def test_the_suffix_says_the_kind(run, tmp_path, suffix):
    pn.report.plot(run, tmp_path / f"run{suffix}")
    assert (tmp_path / f"run{suffix}").read_bytes().startswith(STARTS[suffix])
    assert len(list(tmp_path.iterdir())) == 1


def test_the_page_holds_the_picture_and_what_made_it(run, tmp_path, loads_from_elsewhere):
    pn.report.plot(run, tmp_path / "run.html")
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert loads_from_elsewhere(page) == []
    assert "<svg " in page
    assert run.attrs["description_hash"] in page


def test_variables_that_are_not_there_are_left_out(run):
    whole, some = pn.report.plot(run), pn.report.plot(run[["position", "command"]])
    assert some._repr_png_().startswith(STARTS[".png"])  # what a notebook shows of the bare name
    assert len(whole.axes) > len(some.axes) == 2


def test_wrong_names_are_one_message(run, tmp_path):
    with pytest.raises(CommandError, match="cannot be written"):
        pn.report.plot(run, tmp_path / "run.bmp")
    with pytest.raises(CommandError, match="does not exist"):
        pn.report.plot(run, tmp_path / "nowhere" / "run.png")
    assert list(tmp_path.iterdir()) == []


def test_the_position_of_a_valve_is_no_distance():
    circuit = pn.Circuit.load(Path(__file__).parents[3] / "examples" / "pwm_axis.toml")
    with pytest.warns(PneudriveWarning, match="not passive"):
        axes = pn.report.plot(circuit.simulate({"in_a": 1.0}, "10 ms")).axes
    lines = {axis.get_ylabel(): [line.get_label() for line in axis.get_lines()] for axis in axes}
    assert len(lines["position / mm"]) == 1
    assert lines["valve position"] == ["in_a", "out_a", "in_b", "out_b"]
