"""The report of real recordings: sections in their order, figures as files, nothing loaded from elsewhere."""

import re
import xml.etree.ElementTree as ET

import pytest

from pneudrive.report import write_report

ORDER = [
    "measured",
    "record",
    "loops",
    "closure",
    "pressure",
    "speed",
    "drift",
    "reversals",
    "budget",
    "flags",
    "recovered",
    "paper",
    "stick-slip",
    "chambers",
    "provenance",
]


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
    without = {"recovered", "paper", "chambers"}  # nothing simulated here
    assert keys == [key for key in ORDER if key not in without]


def test_nothing_is_loaded_from_elsewhere(page, loads_from_elsewhere):
    assert loads_from_elsewhere(page) == []
    assert loads_from_elsewhere('<img src="https://x.org/a.png"><link rel="stylesheet" href="a.css">') != []


def test_every_figure_is_in_the_page_and_a_file_twice(page, folder):
    names = re.findall(r'href="figures/([^"]+)\.png"', page)
    assert len(names) >= 10
    assert page.count("<svg ") == len(names) == len(set(names))
    for name in names:
        assert (folder / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        ET.parse(folder / "figures" / f"{name}.svg")


def test_figures_inside_the_page_do_not_share_names(page):
    names = re.findall(r'\bid="([^"]+)"', page)
    assert len(names) == len(set(names))
    used = set(re.findall(r'(?:xlink:href="#|href="#|url\(#)([^")]+)', page))
    assert used <= set(names)


def test_the_verdict_is_five_lines_with_the_numbers_of_the_map(page, real):
    found, _ = real
    lines = re.findall(r"<li>(.*?)</li>", page[page.index('class="verdict"') : page.index("</ol>")])
    assert len(lines) == 5
    highest = max(found.levels, key=lambda level: level.friction_n)
    assert f"{highest.friction_n:.2f} ± {highest.expanded_n:.2f} N" in lines[0]
    assert "k = 2" in lines[0]
    assert f"{100 * found.run_spread.relative:.0f} %" in lines[1]
    assert "Stribeck velocity" in lines[3]


def test_files_are_named_with_their_hashes(page, real):
    for recording in real[0].recordings:
        assert recording.source.name in page
        assert recording.sha256[:16] in page


def test_the_offset_that_exceeds_friction_is_said(page, real):
    larger = [level for level in real[0].levels if abs(level.offset_n) > level.friction_n]
    assert larger, "the recordings were chosen so that one has it"
    assert all(f"{level.recording}: the offset, {level.offset_n:.1f} N, exceeds" in page for level in larger)


def test_what_is_real_and_what_cannot_be_determined_is_said(page):
    assert "Synthetic:" not in page
    assert "Real: the recordings" in page
    assert "Values that these data cannot determine" in page
    assert "CC0" in page  # the note of the source beside the recordings
