"""A new class of results costs one function: terminal, notebook, report and page show its view."""

import json
from dataclasses import dataclass

import numpy as np
import pytest

from pneudrive.cli.terminal import show_view
from pneudrive.figures import MODEL, Figure, Line, Markers, Panel, Rule
from pneudrive.report.page import Report, view_section
from pneudrive.report.render import draw_figure
from pneudrive.views import Finding, LeadingValue, ShownFigure, ShownTable, ShownValue, View, Viewed


@dataclass(frozen=True, repr=False)
class Leak(Viewed):
    """A new result."""

    flow: float

    def view(self) -> View:
        """Return values, findings, a table and two figures."""
        time = np.linspace(0.0, 2.0, 50)
        pressure = 6e5 * np.exp(-self.flow * time)
        measured = Panel([Line(time, pressure, "measured"), Line(time, 6e5 - 2e5 * time, "model", MODEL)])
        rest = Panel([Markers(time, pressure - 6e5 + 2e5 * time), Rule(y=0.0)])
        peak = ShownValue("peak", "leak", "peak pressure", 6e5, "Pa", (5.9e5, 6.1e5))
        return View(
            "The leak is too large.",
            (peak,),
            state="bad",
            leading=(LeadingValue(peak, 5e5, "bad"),),
            findings=(Finding("The supply is known."), Finding("The seal leaks.", "bad", "Replace it.")),
            tables=(ShownTable("Seals.", ("seal", "state"), (("rod", "worn"),)),),
            figures=(
                ShownFigure("leak-pressure", "Pressure.", Figure([measured], "time / s", "pressure / bar abs")),
                ShownFigure("leak-rest", "Residual.", Figure([rest], "time / s", "residual / bar")),
            ),
        )


def test_one_function_is_enough_for_all_outputs(capsys, tmp_path):
    leak = Leak(0.3)
    texts = ("6.00 ± 0.10", "worn", "The seal leaks. Replace it.", "peak pressure")
    show_view(leak.view())
    printed = capsys.readouterr().out
    assert all(text in printed for text in texts)
    assert printed.index("The seal leaks") < printed.index("The supply is known")
    notebook = leak._repr_html_()
    assert notebook.count("<svg") == 2
    assert "The leak is too large." in notebook
    assert "6.00 ± 0.10" in notebook
    assert "The leak is too large." in repr(leak)
    Report("A leak", [], [view_section("leak", leak.view())]).write(tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(text in page for text in texts)
    assert {path.name for path in (tmp_path / "figures").glob("*.png")} == {"leak-pressure.png", "leak-rest.png"}
    sent = json.loads(json.dumps(leak.view().data(), allow_nan=False))
    axes = sent["figures"][0]["figure"]["y"]
    assert (sent["state"], sent["findings"][0]["text"]) == ("bad", "The seal leaks.")
    assert (axes["label"], axes["unit"], axes["size"]) == ("pressure / bar abs", "bar abs", 1e5)
    marks = sent["figures"][0]["figure"]["panels"][0]["marks"]
    assert [mark["kind"] for mark in marks] == ["line", "line"]
    assert marks[0]["y"][0] == 6e5


@pytest.mark.parametrize("dark", [False, True])
def test_a_figure_is_drawn_on_light_and_dark_paper_and_twice_alike(tmp_path, dark):
    shown = Leak(0.3).view().figures[0]
    files = [tmp_path / name for name in ("one.svg", "two.svg")]
    for path in files:
        draw_figure(shown.figure, path, synthetic=True, dark=dark)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert ("#14181d" in files[0].read_text(encoding="utf-8")) == dark


def test_more_than_five_leading_values_are_refused():
    value = LeadingValue(ShownValue("a", "a", "a", 1.0))
    with pytest.raises(ValueError, match="at most 5"):
        View("six", leading=(value,) * 6)
