"""Figures can be read: every axis says its quantity and unit, curves differ in grey, equal data give equal files."""

import pytest

from pneudrive.report import style
from pneudrive.report.circuit.blocks import text_width
from pneudrive.report.page import Picture, Report, svg_text
from pneudrive.report.write import sections

UNITLESS = {"samples on the rise", "stroke in its direction"}


@pytest.fixture(scope="module")
def pictures(real, made):
    found, fits = real
    with style.applied():
        parts = Report("", [], sections(found, fits, made.addition(found))).sections
    return [block for part in parts for block in part.blocks if isinstance(block, Picture)]


def label_of(axis, which):
    """Return the label of an axis, of one that it shares its scale with, or of the whole figure."""
    own = getattr(axis, f"get_{which}label")()
    shared = getattr(axis, f"get_shared_{which}_axes")().get_siblings(axis)
    all_panels = getattr(axis.figure, f"get_sup{which}label")()
    return own or next((label for s in shared if (label := getattr(s, f"get_{which}label")())), "") or all_panels


def test_every_axis_says_its_quantity_and_unit(pictures):
    assert len(pictures) >= 18
    for picture in pictures:
        for axis in picture.figure.axes:
            if not (axis.get_visible() and axis.axison):
                continue
            assert " / " in label_of(axis, "x") or label_of(axis, "x") in UNITLESS, picture.name
            words = [label.get_text() for label in axis.get_yticklabels()]
            assert " / " in label_of(axis, "y") or "/\n" in label_of(axis, "y") or any(map(str.isalpha, words[0])), (
                picture.name
            )


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
    assert len({(str(look.linestyle), look.marker) for look in style.LOOKS}) == len(style.LOOKS)


def test_equal_data_give_equal_files(real):
    from pneudrive.report.recording.closure import draw

    with style.applied():
        once, again = (svg_text(draw(list(real[0].closures))) for _ in range(2))
    assert once == again


@pytest.mark.parametrize("order", [1, -1])
def test_a_run_keeps_its_marker_and_the_legend_leaves_the_points_free(order):
    from pneudrive.friction.pressure import LevelPoint
    from pneudrive.report.recording.pressure import draw_panel

    points = [
        LevelPoint(f"{run}/{bar}", "seal", run, bar * 1e5, 0.01, 2.0 + 0.1 * bar, 0.3)
        for run in ("1", "second")
        for bar in (1, 4, 7)
    ]
    figure = style.new_figure(2.5)
    axis = figure.subplots()
    with style.applied():
        draw_panel(axis, points[::order], None)
        axis.set_ylim(0, 12)
        figure.canvas.draw()
    legend = axis.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["run 1", "run second"]
    frame = legend.get_window_extent()
    places = axis.transData.transform([(p.pressure_pa / 1e5, p.friction_n) for p in points])
    assert not any(frame.contains(*place) for place in places)
