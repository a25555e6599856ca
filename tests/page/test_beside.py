"""Beside a run: another drive with its differences, a band that follows a slider, p-V loops, and what moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

import pneudrive as pn
from page.conftest import DRIVE, Server, Tab
from page.test_journeys import Open, at_end, drag, settled, violations
from pneudrive.simulation.trajectory import save_columns

SINGLE_ACTING = (Path(__file__).parents[1] / "data" / "clamp.toml").read_text("utf-8")


def test_a_run_beside_others(server: Server, open_tab: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    (server.folder / "heavy.toml").write_text(DRIVE.replace("[friction]", '[load]\nmass = "5 kg"\n[friction]'))
    tab = open_tab(server.address)
    page = tab.page
    page.click("text=axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    page.fill("label:has-text('Command') input", "0 s: 0.3, 0.4 s: -0.3")
    page.fill("label:has-text('Duration') input", "0.8 s")
    page.select_option("label:has-text('Compare with') select", "heavy.toml")
    page.check("text=band of 200 members")
    page.check("text=p-V loops")
    page.click("summary:has-text('Circuit, as it moves')")
    page.wait_for_selector("[data-band=position_m]")
    page.wait_for_selector("figure[data-figure^='Pressure over volume'] >> text=cylinder, chamber b")
    before = settled(tab)
    drag(tab, "friction.coulomb", 0.36)
    for _ in range(30):  # an answer with a band takes longer than the look of `settled`
        counts = settled(tab)
        page.wait_for_timeout(300)
        if settled(tab) == counts:
            break
    assert int(counts["sent"]) > int(before["sent"])
    assert counts["mostOnTheWay"] == "1"
    page.click("text=Copy as command or Python")
    page.wait_for_selector("[data-copy=python]")
    monkeypatch.chdir(server.folder)
    names: dict = {}
    exec(page.inner_text("[data-copy=python]"), names)
    assert at_end(tab, "position_m") == names["run"].position[-1]
    other = names["run_1"]
    assert float(page.get_attribute("[data-other='heavy.toml/position_m']", "data-si")) == other.position[-1]
    largest = float(page.get_attribute("[data-largest='heavy.toml/velocity_m_s']", "data-si"))
    assert largest == np.abs(other.velocity.to_numpy() - names["run"].velocity.to_numpy()).max()
    low, high = (float(one) * 1e3 for one in names["band"]["position"].isel(time=-1))
    shown = page.inner_text("[data-band=position_m]").replace(" mm", "").split(" … ")
    assert [float(one) for one in shown] == pytest.approx([low, high], rel=1e-4)

    page.click("summary[aria-label^='Pressure over volume']")
    page.wait_for_selector("[aria-label^='Table of Pressure over volume']")
    assert page.locator("[aria-label^='Table of Pressure over volume'] tbody tr").count() >= 2 * 41
    expect(page.locator("button:text-is('Play')")).to_have_count(0)  # who asks for calm gets a slider alone
    run = names["run"]
    page.focus(".motion input[type=range]")
    page.keyboard.press("End")
    page.wait_for_selector(f"[data-piston=cylinder][data-position='{float(run.position[-1])!r}']")
    face = page.locator("[data-piston] rect >> nth=0")
    assert float(face.get_attribute("width")) == pytest.approx(11.2 * float(run.position[-1]) / 0.5, abs=1e-6)
    page.keyboard.press("Home")
    for _ in range(3):
        page.keyboard.press("PageUp")
    row = int(page.get_attribute(".motion", "data-row"))
    assert 200 < row < 300
    assert float(page.get_attribute("[data-piston]", "data-position")) == run.position[row]
    assert "bar, absolute" in page.get_attribute("[data-piston]", "aria-label")
    page.hover("figure.plot[data-plot=Position] .u-over", position={"x": 100, "y": 60})  # a plot is pointed at
    page.wait_for_selector(f".motion:not([data-row='{row}'])")
    page.check("label:has-text('energy') input")
    page.wait_for_selector("[data-value='air given, litres ANR.supply']")
    page.click("text=Copy as command or Python")
    page.wait_for_selector("[data-copy=python]:has-text('energy_balance')")
    exec(page.inner_text("[data-copy=python]"), names)
    given = float(page.get_attribute("[data-value='air given, litres ANR.supply']", "data-si"))
    assert given == names["energy"].air_litres_anr["supply"]
    assert violations(tab) == []
    page.locator(".energy").scroll_into_view_if_needed()
    tab.picture("simulate-energy")
    page.locator(".motion").scroll_into_view_if_needed()
    tab.picture("simulate-beside")

    page.emulate_media(reduced_motion="no-preference")
    page.focus(".motion input[type=range]")
    page.keyboard.press("Home")
    page.click("button:text-is('Play')")
    page.wait_for_selector(f".motion[data-row='{len(run.time) - 1}']")
    (server.folder / "clamp.toml").write_text(SINGLE_ACTING)
    page.evaluate("location.hash = '#/simulate/clamp.toml'")
    page.wait_for_selector("[data-without=loops]")  # what cannot be drawn is not left out without a word
    page.wait_for_selector("[data-without=motion]")
    tab.check()
    assert pn.Drive.load("axis.toml").load.mass_kg == 0.0  # nothing was written


def test_what_a_long_run_shows_at_a_time_is_of_that_time(server: Server, tab: Tab) -> None:
    """Its curves are lowest and highest values of pixels; numbers beside a time are not."""
    page = tab.page
    page.click("text=axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    command = ", ".join(f"{0.25 * k:g} s: {(-1) ** k}" for k in range(80))
    page.fill("label:has-text('Command') input", command)
    page.fill("label:has-text('Duration') input", "20 s")
    page.click("summary:has-text('Circuit, as it moves')")
    page.wait_for_selector("[data-samples='20001']")
    page.wait_for_selector(".motion")
    settled(tab)
    run = pn.simulate(pn.Drive.load(server.folder / "axis.toml"), command, "20 s")
    time, position = run.time.to_numpy(), run.position.to_numpy()
    page.focus(".motion input[type=range]")
    page.keyboard.press("Home")
    for _ in range(20):
        page.keyboard.press("ArrowRight")
        page.wait_for_timeout(30)
        told = float(page.inner_text(".motion output").split(" s")[0])
        row = int(np.abs(time - told).argmin())
        assert told == pytest.approx(time[row], abs=1e-9)
        assert float(page.get_attribute("[data-piston]", "data-position")) == position[row]
    page.locator("figure.plot[data-plot=Position] summary").click()
    page.wait_for_selector("[aria-label='Table of Position'] tbody tr")
    for line in page.locator("[aria-label='Table of Position'] tbody tr").all():
        told, shown = (float(one) for one in line.locator("th,td").all_inner_texts())
        assert shown == pytest.approx(1e3 * position[int(np.abs(time - told).argmin())], rel=1e-5, abs=1e-5)
    page.hover("figure.plot[data-plot=Position] .u-over", position={"x": 150, "y": 60})
    told, shown = page.locator("figure.plot[data-plot=Position] figcaption .value").all_inner_texts()[:2]
    row = int(np.abs(time - float(told)).argmin())
    assert float(shown) == pytest.approx(1e3 * position[row], rel=5e-3, abs=1e-4)  # three digits
    tab.check()


def test_the_spectrum_of_a_view(server: Server, open_tab: Open) -> None:
    time = np.arange(60_000) * 1e-3
    force = 0.1 * np.random.default_rng(2).standard_normal(len(time)) + np.sin(2.0 * np.pi * 40.0 * time)
    save_columns({"time_s": time, "force_n": force}, {}, server.folder / "rig.parquet")
    tab = open_tab(server.address)
    page = tab.page
    page.click("text=rig.parquet")
    page.wait_for_selector("[data-from]")
    page.check("text=spectrum of the view")
    plot = "figure[data-plot='Spectrum of force']"
    page.wait_for_selector(f"{plot} canvas")
    assert page.inner_text(f"{plot} .title") == "Spectrum of force, N/√Hz"
    page.click("text=Closer")
    page.wait_for_timeout(600)
    assert violations(tab) == []
    page.locator(plot).scroll_into_view_if_needed()
    tab.picture("spectrum")
    tab.check()
