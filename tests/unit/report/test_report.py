"""The report of real recordings: sections in their order, figures as files, nothing loaded from elsewhere."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.characterise import characterise_recordings, load_recordings
from pneudrive.figures import Drawing
from pneudrive.friction.sentences import flag_table
from pneudrive.identify.static.fit import fit_characterisation
from pneudrive.report import render as style
from pneudrive.report import write_report
from pneudrive.report.circuit.layout import text_width
from pneudrive.report.page import Report, svg_text
from pneudrive.report.recordings import characterisation_view, closures, recordings_report
from pneudrive.rig import SimulatedRig, sweep
from pneudrive.signals.load import from_run
from pneudrive.studies.bracha.figure import OPENING, START, slow_drive
from pneudrive.views import ShownFigure

FLAGS = flag_table()


@pytest.fixture(scope="module")
def folder(real, tmp_path_factory):
    found, fits = real
    out = tmp_path_factory.mktemp("report")
    assert write_report(found, fits, out) == out / "report.html"
    return out


@pytest.fixture(scope="module")
def page(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


def test_sections_come_in_order_and_only_where_there_are_data(page):
    keys = re.findall(r'<section id="([^"]+)">', page)
    assert keys == [
        "result",
        "measured",
        "record",
        "budget",
        "stick-slip-of-strokes",
        "provenance",
    ]  # without simulations


def test_nothing_is_loaded_from_elsewhere(page, loads_from_elsewhere):
    assert loads_from_elsewhere(page) == []
    assert loads_from_elsewhere('<img src="https://x.org/a.png"><link rel="stylesheet" href="a.css">') != []


def test_every_figure_is_in_the_page_and_a_file_twice(page, folder):
    names = re.findall(r'href="figures/([^"]+)\.png"', page)
    assert len(names) >= 9
    assert page.count("<svg ") == len(names) == len(set(names))
    for name in names:
        assert (folder / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        ET.parse(folder / "figures" / f"{name}.svg")


def test_figures_inside_the_page_do_not_share_names(page):
    names = re.findall(r'\bid="([^"]+)"', page)
    assert len(names) == len(set(names))
    used = set(re.findall(r'(?:xlink:href="#|href="#|url\(#)([^")]+)', page))
    assert used <= set(names)


def test_the_verdict_has_the_numbers_of_the_map(page, real):
    found, _ = real
    lines = re.findall(r"<li>(.*?)</li>", page[page.index('class="verdict"') : page.index("</ol>")])
    assert len(lines) == 5
    highest = max(found.levels, key=lambda level: level.friction_n)
    assert f"{highest.friction_n:.2f} ± {highest.expanded_n:.2f} N" in lines[1]
    assert f"{100 * found.run_spread.relative:.0f} %" in lines[3]


def test_a_doubtful_value_is_red_and_first_and_flags_have_remedies(make):
    found = characterise_recordings(make(friction=-4.0))
    view = characterisation_view(found, {})
    assert (view.state, view.findings[0].state) == ("bad", "bad")
    assert all(finding.remedy for finding in view.findings if finding.text.partition(":")[0] in FLAGS)
    page = recordings_report(found, {}).html()
    first = page[page.index('id="verdict"') :].partition("<li")[2]
    assert first.startswith(' class="fails">')


def test_a_map_and_a_recording_have_views_too(real):
    found, fits = real
    view = found.friction_map.pneu.view()
    assert [value.sentence for value in view.leading] == [value.sentence for value in found.view().leading[:2]]
    assert "stribeck_velocity" in " ".join(finding.text for finding in characterisation_view(found, fits).findings)
    own = pn.load(DATA / "friction" / "PK_1bar.csv.xz").view()
    assert [figure.name for figure in own.figures] == ["record"]
    for made in (view, own, found.view()):
        json.dumps(made.data(), allow_nan=False)


def test_files_are_named_with_their_hashes(page, real):
    for recording in real[0].recordings:
        assert recording.source.name in page
        assert recording.sha256[:16] in page


# --- Whatever the recordings hold, there is a report: sections that have no data are left out.

DATA = Path(__file__).resolve().parents[3] / "data" / "measurements" / "zillen-2021-pneumatic-piston"


def recording():
    return load_recordings([DATA / "friction" / "NAPN_5bar.csv.xz"])[0]


def part_of(whole, stop):
    channels = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
    return replace(whole, **{name: getattr(whole, name)[:stop] for name in channels})


def unpressurised(whole):
    return replace(whole, pressure_b_pa=np.full(len(whole), whole.ambient_pressure_pa), accuracy={}, labels={})


INPUTS = {
    "one stroke": lambda: [part_of(recording(), 700)],
    "no pressure, no labels": lambda: [unpressurised(recording())],
    "both chambers": lambda: sweep(SimulatedRig.default(), [0.04, 0.1], ((1e5, 0.0), (2e5, 1e5))),
}


@pytest.mark.parametrize("name", INPUTS)
def test_there_is_a_report(name, tmp_path):
    found = characterise_recordings(INPUTS[name]())
    fits, _ = fit_characterisation(found)
    page = write_report(found, fits, tmp_path).read_text(encoding="utf-8")
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL).lower().split()
    assert 2 <= len(found.view().leading) <= 5
    assert ("synthetic" in page.split("</nav>")[0].split("<nav")[1]) == found.synthetic


def test_stick_slip_of_a_recording_is_measured_and_drawn(tmp_path):
    run = pn.simulate(slow_drive("stribeck"), [(0.0, OPENING)], 20.0, initial=START, sample_rate="1 kHz")
    found = characterise_recordings([from_run(run.isel(time=slice(4000, None)))])
    page = write_report(found, {}, tmp_path).read_text(encoding="utf-8")
    assert "1 of 1 stroke show stick-slip" in page
    assert (tmp_path / "figures" / "stick-slip-recordings-phase.png").is_file()


def test_text_from_files_cannot_become_markup():
    name = "<script>alert(1)</script>"
    assert name not in Report(name, [name], []).html()


def test_signs_that_turn_a_text_are_shown_and_the_page_runs_nothing():
    name = f"seal {chr(0x202E)}raB 5{chr(0x202C)}{chr(7)}"
    page = Report(name, [name], []).html()
    assert "seal \\u202eraB 5\\u202c\\x07" in page
    assert not set(page) & {chr(0x202E), chr(0x202C), chr(7)}
    policy = page.partition("Content-Security-Policy")[2].partition(">")[0]
    assert "default-src &#39;none&#39;" in policy
    assert "script-src" not in policy


# --- Figures can be read: every axis says its quantity and unit, curves differ in grey, equal data give equal files.


@pytest.fixture(scope="module")
def pictures(real, made):
    found, fits = real
    parts = [*recordings_report(found, fits).sections, *made.report().sections]
    return [(part.synthetic, block) for part in parts for block in part.blocks if isinstance(block, ShownFigure)]


def test_every_axis_says_its_quantity_and_unit(pictures):
    assert len(pictures) >= 16
    for _, picture in pictures:
        for panel in filter(None, picture.figure.panels):
            if isinstance(panel.marks[0], Drawing):
                continue
            x, y = picture.figure.axes_of(panel)
            assert x.unit, picture.name
            assert y.unit or y.names or picture.figure.share_y or picture.name == "paper-9-stop", picture.name


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


def test_equal_data_give_equal_files(real):
    with style.applied():
        once, again = (svg_text(style.render(closures(list(real[0].closures)))) for _ in range(2))
    assert once == again
