"""Figures can be read: every axis says its quantity and unit, curves differ in grey, equal data give equal files."""

import pytest

from pneudrive.figures import LOOKS, Drawing
from pneudrive.friction.pressure import LevelPoint
from pneudrive.report import style
from pneudrive.report.circuit.blocks import text_width
from pneudrive.report.page import Picture, Report, svg_text
from pneudrive.report.recordings import closures, pressure_panel, sections
from pneudrive.report.render import render

UNITLESS = {"samples on the rise", "stroke in its direction"}


@pytest.fixture(scope="module")
def pictures(real, made):
    found, fits = real
    parts = Report("", [], sections(found, fits, made.addition(found))).sections
    return [block for part in parts for block in part.blocks if isinstance(block, Picture)]


def test_every_axis_says_its_quantity_and_unit(pictures):
    assert len(pictures) >= 18
    for picture in pictures:
        for panel in filter(None, picture.figure.panels):
            if isinstance(panel.marks[0], Drawing):
                continue
            x, y = picture.figure.axes_of(panel)
            assert x.unit or x.label in UNITLESS, picture.name
            assert y.unit or y.names or picture.figure.share_y or picture.name == "paper-9-stop", picture.name


def test_captions_are_sentences_and_synthetic_ones_are_marked(pictures):
    for picture in pictures:
        assert picture.caption.endswith((".", "²."))
        assert picture.synthetic == picture.name.startswith(("recovered", "paper", "stick-slip", "chamber"))


def test_text_of_a_user_is_never_a_formula(tmp_path):
    """Dollars around an unknown command end matplotlib with a traceback; around a known one they vanish."""
    name = r"a $\x$ b"
    width = [text_width(text, 10.0) for text in ("x$_1$", "x$_1$ ")]
    assert width[0] > text_width("x_1", 10.0)  # a subscript is narrower
    figure = style.new_figure(2.0)
    axis = figure.subplots()
    axis.plot([20.0, 50.0], [0.0, 1.0], label=name)
    axis.set_yticks([0.0, 1.0], [name, name])
    axis.set_title(name)
    style.logarithmic(axis)
    axis.legend()
    with style.applied():
        figure.savefig(tmp_path / "a.svg")  # labels of ticks are made here
    figure.savefig(tmp_path / "b.svg", metadata={"Date": None})
    assert not any("$" in text.get_text() for text in axis.get_xticklabels(which="both"))


def test_looks_differ_without_colour():
    assert len({(str(look.dash), look.marker) for look in LOOKS}) == len(LOOKS)


def test_equal_data_give_equal_files(real):
    with style.applied():
        once, again = (svg_text(render(closures(list(real[0].closures)))) for _ in range(2))
    assert once == again


@pytest.mark.parametrize("order", [1, -1])
def test_a_run_keeps_its_marker_in_all_panels(order):
    points = [
        LevelPoint(f"{run}/{bar}", "seal", run, bar * 1e5, 0.01, 2.0 + 0.1 * bar, 0.3)
        for run in ("1", "second")
        for bar in (1, 4, 7)
    ]
    marks = pressure_panel(points[::order], None, ["0", "1", "second"]).marks
    assert [(mark.label.partition(",")[0], mark.look) for mark in marks] == [
        ("run 1", LOOKS[1]),
        ("run second", LOOKS[2]),
    ]
