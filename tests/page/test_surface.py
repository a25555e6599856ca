"""A friction map in space: loaded when it is opened, turned by mouse and keyboard, and told in words."""

from __future__ import annotations

import re

import pytest

import pneudrive as pn
from page.conftest import Server, Tab
from page.test_journeys import Open, violations
from pneudrive.characterise import write_map
from web.maps import AIR_PA, WIDE, friction_map, stribeck

CANVAS = ".surface canvas"


def opened(server: Server, open_tab: Open, look: str = "light") -> Tab:
    """Open a map whose fast speeds were not measured at 4 bar."""
    curves = friction_map(stribeck, WIDE, (0.0, 2e5, 4e5), 0.6)
    is_measured = (curves["pressure_b_pa"] < AIR_PA + 3e5) | (abs(curves["velocity_m_s"]) < 0.05)
    curves = curves.where(is_measured, drop=True).astype(curves.dtypes)
    folder = server.folder / "results" / "rig"
    folder.mkdir(parents=True, exist_ok=True)
    write_map(curves, folder / "map.parquet")
    pn.fit_friction(curves, pressure_dependence=True).to_toml(folder / "fit.toml")
    tab = open_tab(server.address, look)
    tab.page.click("text=results/rig/map.parquet")
    tab.page.wait_for_selector("[data-heat]")
    return tab


def looks(tab: Tab, turn: int, tilt: int) -> None:
    tab.page.wait_for_selector(f"{CANVAS}[data-drawn='{turn} {tilt}']")


def test_a_map_is_opened_as_a_surface_and_turned(server: Server, open_tab: Open) -> None:
    tab = opened(server, open_tab)
    page = tab.page
    asked: list[str] = []
    page.on("request", lambda one: asked.append(one.url))
    page.keyboard.press("Tab")
    assert not [one for one in asked if "surface" in one]
    page.focus("button:text-is('Surface')")
    page.keyboard.press("Enter")
    looks(tab, -35, 25)
    assert len([one for one in asked if re.search(r"/assets/surface-\w+", one)]) == 1
    assert page.get_attribute(CANVAS, "data-points") == str(2 * 2 * (8 + 8 + 5))
    told = page.get_attribute(CANVAS, "aria-label")
    assert "over speed, 2 to 250 mm/s, and chamber b, 0 to 4 bar gauge" in told
    assert "12 % of the surface is extrapolated" in told
    assert violations(tab) == []
    page.locator("section[aria-label=Surface]").scroll_into_view_if_needed()
    tab.picture("friction-surface")

    page.focus("label:has-text('Turn') input")
    page.keyboard.press("ArrowRight")
    looks(tab, -34, 25)
    page.focus("label:has-text('Tilt') input")
    page.keyboard.press("Home")
    looks(tab, -34, 0)
    box = page.locator(CANVAS).bounding_box()
    page.mouse.move(box["x"] + 400, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 450, box["y"] + 300, steps=1)
    page.mouse.up()
    looks(tab, -14, 40)

    # From the front it is a plot over speed: the slowest points are at its left edge, and say what they are.
    page.click("button:text-is('Over speed')")
    looks(tab, 0, 0)
    for height in range(20, int(box["height"]), 8):
        page.mouse.move(box["x"] + 0.5 * box["width"] - 350, box["y"] + height)
        if page.get_attribute("[data-near]", "data-near") != "-1":
            break
    near = page.inner_text("[data-near]")
    found = re.fullmatch(r"\w+(-\d)?: ([\d.]+) N at 2 mm/s and (\d) bar gauge; the fit says ([\d.]+) N", near)
    assert found, near
    assert float(found[2]) == pytest.approx(stribeck(0.002, 1e5 * float(found[3])), abs=2.5)
    assert float(found[4]) == pytest.approx(stribeck(0.002, 1e5 * float(found[3])), abs=1.0)
    page.click("button:text-is('Surface')")
    page.wait_for_selector(CANVAS, state="detached")
    assert page.locator("[data-heat]").count() == 1
    tab.check()


def test_a_surface_fits_a_narrow_dark_page(server: Server, open_tab: Open) -> None:
    tab = opened(server, open_tab, "dark")
    page = tab.page
    page.click("button:text-is('Surface')")
    looks(tab, -35, 25)
    page.set_viewport_size({"width": 400, "height": 900})
    page.wait_for_function(f"() => document.querySelector('{CANVAS}').width < 400")
    assert page.evaluate("document.documentElement.scrollWidth") == 400
    page.emulate_media(color_scheme="light")
    inked = "() => document.querySelector('.surface canvas').getContext('2d').strokeStyle"
    page.wait_for_function(f"() => ({inked})() !== '#f2f2f2'")
    assert violations(tab) == []
    tab.check()


def test_a_browser_that_draws_nothing_says_so(server: Server, open_tab: Open) -> None:
    tab = opened(server, open_tab)
    page = tab.page
    page.evaluate("HTMLCanvasElement.prototype.getContext = () => null")
    page.click("button:text-is('Surface')")
    page.wait_for_selector(".surface .problem >> text=draws no canvas")
    assert "84 points" in page.inner_text(".surface .problem")
    assert page.locator("[data-heat] rect[data-kind]").count() == 3 * 24
    tab.check()
