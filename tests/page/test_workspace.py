"""The workspace: ways to begin, objects with their verbs, tabs and addresses, plots that are saved, no view cut off."""

from __future__ import annotations

import csv
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import pytest
import xarray as xr
from playwright.sync_api import expect

import pneudrive as pn
from page.conftest import Server, Tab
from page.results import MEASURED, RECORDING
from page.test_journeys import Open, settled, violations
from page.test_nothing_lost import go
from pneudrive.characterise import write_map
from web.maps import WIDE, friction_map, stribeck

LONG = 120_000  # ms; a search on a busy machine


@pytest.fixture
def empty(tmp_path: Path) -> Iterator[Server]:
    folder = tmp_path / "empty"
    folder.mkdir()
    made = Server.start(folder)
    yield made
    made.end()


def test_four_ways_to_begin_in_an_empty_folder(empty: Server, open_tab: Open) -> None:
    tab = open_tab(empty.address)
    page = tab.page
    page.wait_for_selector("text=This folder is empty")
    expect(page.locator(".starts article")).to_have_count(4)
    assert violations(tab) == []
    tab.picture("begin")
    page.click("a:text-is('Open an example drive')")
    page.wait_for_selector("figure[data-plot=Position] canvas")
    page.click(".home")
    page.click("text=Use example recordings")
    page.wait_for_selector("figure[data-plot^=force] canvas")
    page.wait_for_selector("text=darker: towards +x")
    page.click(".home")
    page.click("text=Start with a task")
    page.click("button:text-is('Size')")
    page.click("text=Cancel the search", timeout=LONG)
    page.wait_for_selector("p[data-state=stopped]", timeout=LONG)
    tab.check()


def test_a_drive_is_taken_along_from_view_to_view(server: Server, open_tab: Open) -> None:
    (server.folder / "drives").mkdir()
    (server.folder / "drives" / "other.toml").write_text((server.folder / "axis.toml").read_text())
    tab = open_tab(server.address)
    page = tab.page
    page.wait_for_selector(".tree .files a")
    page.fill("input[aria-label='Search files']", "other")
    expect(page.locator(".tree .files a")).to_have_count(1)
    page.fill("input[aria-label='Search files']", "axis")
    page.click(".tree >> text=axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    page.click(".verbs >> text=Control")
    page.wait_for_selector("text=nmpc for my axis, every")
    assert page.url.endswith("#/control/axis.toml")
    page.click(".verbs >> text=Validate")
    page.wait_for_selector("label:has-text('Drive or fit') option:checked:text-is('axis.toml')", state="attached")
    page.click(".verbs >> text=Export")
    page.wait_for_selector("label:has-text('Drive or circuit') option:checked:text-is('axis.toml')", state="attached")
    for _ in range(2):
        page.go_back()
    page.wait_for_selector("text=nmpc for my axis, every")
    page.go_forward()
    page.wait_for_selector("text=Does my model hold?")
    go(page, "drive", "drives/other.toml")
    expect(page.locator(".tabs li")).to_have_count(2)
    page.click("button[aria-label='Close drives/other.toml']")
    page.wait_for_selector("text=Does my model hold?")  # the other tab, where it was left
    page.reload()
    expect(page.locator(".tabs li")).to_have_count(1)
    page.click(".home")
    page.click("button[aria-label='Rename drives/other.toml']")
    for name, said in (("drives/other.txt", "has another file extension"), ("axis.toml", "already exists")):
        page.fill("input[aria-label='New name of drives/other.toml']", name)
        page.keyboard.press("Enter")
        page.wait_for_selector(f".problem >> text={said}")
    page.fill("input[aria-label='New name of drives/other.toml']", "drives/mine.toml")
    page.keyboard.press("Enter")
    page.wait_for_selector(".tree [title='drives/mine.toml']")
    assert not (server.folder / "drives" / "other.toml").exists()
    assert {"400" in one for one in tab.complaints} == {True}, tab.complaints  # what was refused
    assert tab.foreign == []


def test_a_data_sheet_is_written_and_opened(server: Server, open_tab: Open) -> None:
    tab = open_tab(f"{server.address}")
    page = tab.page
    go(page, "datasheet", "axis.toml")
    page.click("text=Write the data sheet")
    with page.context.expect_page(timeout=LONG) as opened:
        page.click("text=Open the report", timeout=LONG)
    opened.value.wait_for_selector("text=my axis")
    opened.value.close()
    assert violations(tab) == []
    tab.check()


def test_two_seals_are_apart_and_each_point_has_a_marker(server: Server, open_tab: Open) -> None:
    maps = []
    for seal, more in (("O-ring", 0.0), ("Kidney", 9.0)):
        one = friction_map(lambda v, g, more=more: stribeck(v, g) + more, WIDE, (0.0, 2e5), 0.2)
        maps.append(one.assign(seal=("row", [seal] * one.sizes["row"])))
    both = xr.concat(maps, dim="row", combine_attrs="override")
    write_map(both, server.folder / "map.parquet")
    tab = open_tab(server.address)
    page = tab.page
    go(page, "friction", "map.parquet")
    figure = "figure[data-figure='Friction over speed']"
    page.wait_for_selector(f"{figure}[data-points='{both.sizes['row']}']")  # a panel for each seal
    expect(page.locator(f"{figure} .panel-drawing")).to_have_count(2)
    expect(page.locator("label:has-text('logarithmic') input")).to_be_checked()
    page.select_option("label:has-text('Seal or mounting') select", "Kidney")
    page.wait_for_selector(f"{figure}[data-points='{maps[1].sizes['row']}']")
    assert "seal=Kidney" in page.url
    tab.picture("seals")
    tab.check()


def test_plots_are_zoomed_together_and_saved(server: Server, tab: Tab) -> None:
    page = tab.page
    go(page, "simulate", "axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    settled(tab)
    box = page.locator("figure[data-plot=Velocity] .u-over").bounding_box()
    assert 62 <= box["height"] <= 124  # four panes, the piston and the command fit on one screen
    assert box["width"] > 700
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 60, steps=5)
    page.mouse.up()
    expect(page.locator("text=Reset zoom")).to_have_count(4)  # of each plot: all show that part
    page.locator("text=Reset zoom").first.click()
    expect(page.locator("text=Reset zoom")).to_have_count(0)
    expect(page.locator("figure[data-plot=Position] figcaption .value >> nth=1")).to_have_text("", use_inner_text=True)
    page.hover("figure[data-plot=Position] .u-over")
    assert float(page.inner_text("figure[data-plot=Position] figcaption .value >> nth=1"))
    page.click("figure[data-plot=Position] summary")
    saved = {}
    for kind in ("CSV", "SVG", "PNG"):
        with page.expect_download() as download:
            page.click(f"figure[data-plot=Position] button:text-is('{kind}')")
        assert download.value.suggested_filename == f"position.{kind.lower()}"
        saved[kind] = Path(download.value.path()).read_bytes()
    rows = list(csv.reader(saved["CSV"].decode().splitlines()))
    assert rows[0] == ["time, s", "position, mm"]
    run = pn.simulate(pn.Drive.load(server.folder / "axis.toml"), "0 s: 1, 1 s: -1", "2 s")
    assert float(rows[-1][1]) == pytest.approx(1e3 * float(run.position[-1]))
    drawn = ET.fromstring(saved["SVG"])
    assert max(len(one.get("d", "")) for one in drawn.iter("{http://www.w3.org/2000/svg}path")) > 5000
    assert saved["PNG"].startswith(b"\x89PNG")
    tab.check()


def test_a_recording_of_another_rig_gets_its_own_layout(server: Server, open_tab: Open) -> None:
    shutil.copy(MEASURED / "friction" / RECORDING, server.folder / "other.csv.xz")
    text = (MEASURED / "layout.toml").read_text()
    (server.folder / "layout.toml").write_text(text)  # it takes labels from names, and finds none in this one
    tab = open_tab(server.address)
    page = tab.page
    go(page, "recording", "other.csv.xz")
    page.wait_for_selector("text=The layout in this folder belongs to other files")
    expect(page.locator(".problem")).to_have_count(1)
    expect(page.locator("button:text-is('Characterise')")).to_have_count(0)
    page.click("button:text-is('Propose a layout for this file')")
    page.fill("textarea.text", text.replace('pattern = "{seal}_{pressure}bar"', ""))
    assert violations(tab) == []
    page.click("text=Accept: move the file into other/")
    page.wait_for_selector("text=darker: towards +x")
    assert (server.folder / "other" / "other.csv.xz").is_file()
    assert (server.folder / "layout.toml").read_text() == text
