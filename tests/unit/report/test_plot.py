"""A trajectory as a picture, by the suffix of the file; wrong names are one message."""

from __future__ import annotations

import re
from pathlib import Path

import polars as pl
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import pneudrive as pn
from pneudrive.characterise import characterise_recordings
from pneudrive.errors import CommandError, PneudriveWarning
from pneudrive.figures import Figure, Line, Markers, Panel
from pneudrive.friction.characterisation import fit_pressure_lines
from pneudrive.friction.friction_map import COLUMNS, LEVEL_COLUMNS
from pneudrive.friction.sentences import flag_table
from pneudrive.report.recordings import pressure_panel
from pneudrive.report.render import draw_figure

STARTS = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


@pytest.fixture(scope="module")
def run():
    return pn.simulate(pn.Drive.load("catalogue:parker-osp-p25-sy5000"), "0 s: 1, 0.2 s: -1", "0.4 s")


def test_the_mark_of_synthetic_data_is_free_of_the_legend():
    marks = [Line([0.0, 1.0], [0.0, level], f"a curve with a long label, {level}") for level in range(8)]
    points = [Markers([1.0], [level], names=("2 bar",)) for level in (3.0, 3.01, 3.02)]
    made = draw_figure(Figure([Panel([*marks, *points])]), synthetic=True)
    FigureCanvasAgg(made).draw()
    lower, middle, upper = (name.get_window_extent() for name in made.axes[0].texts)
    assert not any(middle.overlaps(other) for other in (lower, upper))  # nor do names of points touch each other
    mark, (legend,) = next(t for t in made.texts if "synthetic" in t.get_text()), made.legends
    assert not any(text.get_window_extent().overlaps(mark.get_window_extent()) for text in legend.get_texts())


@pytest.mark.parametrize("suffix", STARTS)
def test_the_suffix_says_the_kind(run, tmp_path, suffix):
    pn.report.plot(run[["position"]], tmp_path / f"run{suffix}")
    assert (tmp_path / f"run{suffix}").read_bytes().startswith(STARTS[suffix])
    assert len(list(tmp_path.iterdir())) == 1


def test_variables_that_are_not_there_are_left_out(run):
    whole, some = pn.report.plot(run), pn.report.plot(run[["position", "command"]])
    assert some._repr_png_().startswith(STARTS[".png"])  # what a notebook shows of the bare name
    assert len(whole.axes) > len(some.axes) == 2


def test_wrong_names_are_one_message(run, tmp_path):
    with pytest.raises(CommandError, match="cannot be written"):
        pn.report.plot(run, tmp_path / "run.bmp")
    with pytest.raises(CommandError, match="does not exist"):
        pn.report.plot(run, tmp_path / "nowhere" / "run.png")
    with pytest.raises(CommandError, match="not the dataset of a run"):
        pn.report.plot(run.drop_vars("time"))
    assert list(tmp_path.iterdir()) == []


def test_the_position_of_a_valve_is_no_distance():
    circuit = pn.Circuit.load(Path(__file__).parents[3] / "examples" / "pwm_axis.toml")
    with pytest.warns(PneudriveWarning, match="not passive"):
        axes = pn.report.plot(circuit.simulate({"in_a": 1.0}, "10 ms")).axes
    lines = {axis.get_ylabel(): [line.get_label() for line in axis.get_lines()] for axis in axes}
    assert len(lines["position / mm"]) == 1
    assert lines["valve position"] == ["in_a", "out_a", "in_b", "out_b"]


# --- A figure says what the text says: the band of a line over pressure holds a further run only where one was seen.


@pytest.mark.parametrize("runs", [("1",), ("1", "2")])
def test_the_legend_promises_no_further_run_where_nothing_was_run_twice(runs):
    rows = [
        {"seal": "seal", "run": run, "pressure_pa": 1e5 * bar, "friction_n": 10.0 + 2.0 * bar + off}
        for run, more in zip(runs, (0.0, 0.8), strict=False)
        for bar, off in zip((1, 2, 4, 6), (more, more + 0.1, more - 0.1, more), strict=True)
    ]
    points = pl.DataFrame(rows).with_columns(speed_m_s=0.1, speed_stderr_m_s=0.0, expanded_n=0.1)
    (line,) = fit_pressure_lines(points)
    label = pressure_panel(points, line, runs).marks[0].label
    assert ("for a further run" in label) == (len(runs) > 1)
    assert ('two values of the label "run"' in line.statement) == (len(runs) == 1)
    assert "+-0.00" not in line.statement


# --- Every flag that a map can carry has a meaning and a remedy, which terminal, report, page and guide take.

FLAGS = flag_table()
GUIDE = Path(__file__).resolve().parents[3] / "docs" / "guide" / "recordings.md"


def test_the_guide_has_the_meanings_and_remedies_of_the_table():
    table = GUIDE.read_text(encoding="utf-8").partition("| --- | --- | --- |\n")[2].partition("\n\n")[0]
    rows = [re.findall(r"[^|]+", line) for line in table.splitlines()]
    assert len(rows) >= 26
    for name, means, do in rows:
        assert FLAGS[name.strip(" `")] == {"means": means.strip(), "do": do.strip()}


def test_the_reference_has_the_columns_of_the_map():
    text = (GUIDE.parents[1] / "reference" / "friction-map.md").read_text(encoding="utf-8")
    rows = [re.findall(r"[^|]+", line) for line in text.splitlines() if line.startswith("| `")]
    shown = {name.strip(" `"): [unit.strip().removeprefix("text"), meaning.strip()] for name, unit, meaning in rows}
    assert shown == COLUMNS | LEVEL_COLUMNS


def test_terminal_and_notebook_explain_the_raised_flags(make):
    found = characterise_recordings(make(friction=-4.0))
    text, flag = str(found.view()), FLAGS["negative_friction"]
    assert f"negative_friction: {flag['means']}" in text
    assert flag["do"] in text
    assert "unpaired:" not in text
