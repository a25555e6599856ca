"""One form for terminal, notebook, report and page: what a reader sees of values and curves, in usual units."""

from __future__ import annotations

import copy
import dataclasses
import importlib
import json
import pickle
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive import repr_tables
from pneudrive.cli.main import run
from pneudrive.cli.terminal import show_view
from pneudrive.describe.base import Described
from pneudrive.errors import DescriptionError
from pneudrive.figures import MODEL, Figure, Line, Markers, Panel, Rule
from pneudrive.report.page import Report, view_section
from pneudrive.report.render import draw_figure
from pneudrive.views import Finding, ShownCurve, ShownFigure, ShownTable, ShownValue, View, Viewed


def test_a_table_has_a_row_for_each_label_and_names_a_common_unit_once():
    view = View(
        "two recordings",
        (
            ShownValue("1.v", "one", "speed", 0.0132, "m/s"),
            ShownValue("1.f", "one", "friction", 9.79, "N", (9.30, 10.28)),
            ShownValue("2.f", "two", "friction", -0.0001, "N", (-0.064, 0.064)),
            ShownValue("2.e", "two", "friction per pressure", float("nan"), "N/Pa"),
        ),
    )
    head, rows = view.table()
    assert head == ("", "speed mm/s", "friction N", "friction per pressure N/bar")
    assert rows == [("one", "13.2", "9.79 ± 0.49", ""), ("two", "", "0.000 ± 0.064", "")]
    assert "9.79 ± 0.49" in view._card().rows[0]


def test_the_band_of_a_curve_is_that_at_its_measured_points():
    speed, friction = np.array([0.01, 0.02, 0.1]), np.array([30.0, 20.0, 25.0])
    reach = np.array([1.0, 50.0, 3.0])  # wide between the measured points
    curve = ShownCurve(
        *("key", "1 bar", speed, friction, "speed", "friction", "m/s", "N", (friction - reach, friction + reach)),
        measured=np.array([True, False, True]),
    )
    assert curve.half_band == pytest.approx(2.0)
    head, rows = View("a campaign", curves=(curve,)).curve_table()
    assert head == ("curve", "points", "speed mm/s", "friction N", "95 % band")
    assert rows == [("1 bar", "2", "10 .. 100", "20.00 .. 30.00", "± 2")]


# --- A new class of results costs one function: terminal, notebook, report and page show its view.


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
            leading=(replace(peak, limit=5e5, state="bad"),),
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
    (peak,) = sent["leading"]
    assert (peak["text"], peak["unit"], peak["limit"], peak["state"]) == ("6.00 ± 0.10", "bar", "5 bar", "bad")
    jsonschema = pytest.importorskip("jsonschema")
    assert run(["schema", "view"]) == 0
    schema = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(schema).validate(sent)
    assert sent.keys() == schema["properties"].keys()


@pytest.mark.parametrize("dark", [False, True])
def test_a_figure_is_drawn_on_light_and_dark_paper_and_twice_alike(tmp_path, dark):
    shown = Leak(0.3).view().figures[0]
    files = [tmp_path / name for name in ("one.svg", "two.svg")]
    for path in files:
        draw_figure(shown.figure, path, synthetic=True, dark=dark)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert ("#14181d" in files[0].read_text(encoding="utf-8")) == dark


# --- A bare name shows a short table, escaped; a quantity shows its unit and computes as the SI number that it is.

REFERENCE = Path(__file__).parents[2] / "docs/reference/python.md"
#: No card is longer, whatever it shows.
MOST = 12_000


def test_names_read_as_in_the_file_and_show_their_unit():
    drive = pn.Drive.load("catalogue:starter")
    shown = [drive.cylinder.bore, drive.cylinder.dead_volume.a, drive.friction.coulomb, drive.friction.dwell.increment]
    assert [str(one) for one in shown] == ["25 mm", "10 cm3", "33 N", "1.2 N"]
    assert shown == [0.025, 1e-5, 33.0, 1.2]
    assert str(drive.friction.pressure.breakaway.b) == "1.3 N/bar"
    assert str(drive.load.mass) == "0 kg"
    assert str(drive.supply.pressure) == "6 bar gauge"
    assert drive.friction.parameters["coulomb"] == drive.friction.coulomb
    assert {"coulomb", "stribeck_velocity"} <= set(dir(drive.friction))
    with pytest.raises(AttributeError, match="Did you mean 'coulomb'"):
        _ = drive.friction.coulom


def tables(part, path=""):
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if isinstance(value, Described):
            yield from tables(value, f"{path}{field.alias or name}.")
    yield path, part


def test_every_key_of_the_file_is_a_name_in_python(drive_file, tmp_path):
    path = tmp_path / "drive.toml"
    path.write_text(drive_file)
    seen = 0
    for prefix, part in tables(pn.Drive.load(path)):
        for key in type(part).keys():  # noqa: SIM118 - not a dict
            if key not in {"schema", "law", "formula", "parameters", "given"}:
                value = getattr(part, key)
                assert not isinstance(value, str) or key in {"name", "kind", "model", "chamber_law", "growth"}, (
                    prefix + key
                )
                assert not callable(value), prefix + key
                seen += 1
    assert seen > 40


def test_a_quantity_is_a_number_and_goes_back_into_a_description():
    drive = pn.Drive.load("catalogue:starter")
    bore = drive.cylinder.bore
    assert np.asarray([bore]).dtype == np.float64
    assert json.dumps(bore) == "0.025"
    assert type(2 * bore) is float
    assert f"{bore:.1f}" == "25.0 mm"
    assert pickle.loads(pickle.dumps(bore)).unit == copy.copy(bore).unit == "mm"
    assert drive.ambient.temperature.to("degC") == 20.0
    same = drive.replace({"cylinder.bore": bore, "friction.coulomb": drive.friction.coulomb})
    assert same.description_hash == drive.description_hash
    with pytest.raises(DescriptionError, match="is a force"):
        drive.replace({"cylinder.bore": drive.friction.coulomb})
    with pytest.raises(DescriptionError, match="is not a number"):
        drive.replace({"gas.heat_capacity_ratio": bore})


def test_a_card_is_short_and_escaped():
    drive = pn.Drive.load("catalogue:reference").replace(
        {"name": "<script>alert(1)</script>", "labels.seal": "A" * 9999}
    )
    html = drive._repr_html_()
    assert "<script>" not in html
    assert "&lt;script&gt;" in html
    assert len(html) + len(repr(drive)) < MOST
    assert "bore 25 mm" in repr(drive)
    assert "bore  " in repr(drive.cylinder)
    assert "default" in repr(drive.cylinder)


def results():
    """Dataclasses of the reference that hold arrays, data sets or others that do."""
    big = ("ndarray", "Array", "xr.Dataset", "CampaignCharacteristics", "Recording")
    for path in re.findall(r"^   ~?(?:pn|pneudrive)\.(.+)$", REFERENCE.read_text(encoding="utf-8"), re.MULTILINE):
        module, _, name = f"pneudrive.{path}".rpartition(".")
        kind = getattr(importlib.import_module(module), name, None)
        types = [str(field.type) for field in dataclasses.fields(kind)] if dataclasses.is_dataclass(kind) else []
        if module not in ("pneudrive.views", "pneudrive.rig") and any(word in text for text in types for word in big):
            yield kind


def test_public_results_show_a_card():
    found = set(results())
    assert len(found) >= 12
    assert not [kind for kind in found if not issubclass(kind, repr_tables.Shown)]
