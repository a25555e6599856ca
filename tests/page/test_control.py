"""Laws of control on the page: a gain is dragged, laws are compared, cancelled, resumed, and their card is read."""

from __future__ import annotations

import polars as pl
import pytest
from playwright.sync_api import expect

import pneudrive as pn
from page.conftest import Server
from page.test_journeys import Open, drag, settled, violations
from waiting import until


def test_gains_are_dragged_and_laws_compared(server: Server, open_tab: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    tab = open_tab(server.address)
    page = tab.page
    page.click(".tree >> text=Controllers")
    page.wait_for_selector("[data-score=max_error_m]")
    page.select_option("label:has-text('Law') select", "pid")
    page.fill("label:has-text('Reference') input", "250 mm; 0.1 s: 300 mm in 0.3 s")
    page.keyboard.press("Tab")
    page.select_option("label:has-text('True drive') select", "mass+30")
    page.wait_for_selector("th:text-is('moving_mass')")
    before = settled(tab)
    drag(tab, "gain", 0.6)
    counts = settled(tab)
    assert int(counts["sent"]) > int(before["sent"]) + 3
    assert counts["mostOnTheWay"] == "1"
    page.click("text=The same as a command and as Python")
    monkeypatch.chdir(server.folder)
    names: dict = {}
    exec(page.inner_text("[data-copy=python]"), names)
    score = names["run"].attrs["score"]
    assert float(page.get_attribute("[data-score=max_error_m]", "data-si")) == score["max_error_m"]
    expect(page.locator("[data-copy=command]").first).to_contain_text("--controller axis-pid.toml")
    assert violations(tab) == []
    page.evaluate("() => scrollTo(0, 0)")
    tab.picture("control-run")

    page.fill("label:has-text('And along') input", "250 mm; 0.1 s: 300 mm in 0.3 s")
    for name in ("pid", "inversion"):
        page.check(f"fieldset >> label:has-text('{name}') >> nth=0")
    page.fill("label:has-text('Seeds') input", "40")
    page.keyboard.press("Tab")
    page.click("button:text-is('Compare')")
    page.wait_for_selector("progress[aria-label='Progress of results/laws']", state="attached", timeout=60_000)
    about = server.folder / "results" / "laws" / "comparison.json"
    until(about.is_file)
    page.click("text=Watch results/laws")
    page.wait_for_selector("[data-done]:not([data-done='0'])", timeout=60_000)
    page.wait_for_selector("[data-cell][data-si]")  # medians so far
    expect(page.locator("[data-done]").first).to_contain_text("can change")
    page.wait_for_selector("figure[data-plot=Errors] canvas")  # of the runs that are done
    expect(page.locator("button:text-is('Cancel results/laws')")).to_have_count(1)  # it still runs
    assert violations(tab) == []
    tab.picture("control-so-far")
    page.click("text=Cancel results/laws")
    page.wait_for_selector("[data-state=cancelled]", timeout=60_000)
    page.wait_for_selector("button:text-is('Resume')")
    expect(page.locator("main").first).to_contain_text("Not finished")
    page.close()

    drive = pn.Drive.load(server.folder / "axis.toml")  # a comparison of fewer seeds, which the page takes up
    short = {"seeds": 2, "mismatch": "mass+30"}
    made = pn.control.benchmark(
        drive, ["pid", "inversion"], ["R1", "R6"], **short, out=server.folder / "results" / "two"
    )
    tab = open_tab(server.address)
    page = tab.page
    page.click("ul.files >> text=results/two")
    page.wait_for_selector("figure[data-plot=Errors] canvas")
    table = pl.read_parquet(server.folder / "results" / "two" / "score.parquet")
    for law in ("pid", "inversion"):
        for name in ("R1", "R6"):
            own = table.filter((pl.col("law") == law) & (pl.col("reference") == made.references[name]))
            shown = float(page.get_attribute(f"[data-cell='{law}/{name}']", "data-si"))
            assert shown == pytest.approx(own["max_error_m"].median(), rel=1e-15)
    expect(page.locator("[data-cell='inversion/R1']").first).to_contain_text("★")
    page.focus("th button:text-is('R6')")
    page.keyboard.press("Enter")
    page.wait_for_selector("h2:has-text('Along R6')")
    held: list = []
    page.route("**/api/comparison?*measure=rest_error_m*", lambda route: held.append(route))  # noqa: PLW0108 - it takes no builtin
    with page.expect_request("**/api/comparison?*measure=rest_error_m*"):
        page.select_option("label:has-text('Measure') select", "rest_error_m")
    page.select_option("label:has-text('Measure') select", "max_error_m")
    with page.expect_response("**/api/comparison?*measure=max_error_m*"):
        held[0].continue_()  # the question about the newest measure waits for the answer about another one
    page.wait_for_timeout(100)
    assert float(page.get_attribute("[data-cell='inversion/R6']", "data-si")) == shown
    page.unroute("**/api/comparison?*measure=rest_error_m*")
    page.select_option("label:has-text('Measure') select", "rest_error_m")
    page.wait_for_selector("[data-cell='inversion/R1']:has-text('–')")  # a sine has no rest
    assert (
        page.locator("figure[data-figure^='error at rest']").get_attribute("data-points") == "4"
    )  # two seeds of each law
    page.wait_for_selector("figure[data-plot=Errors] canvas")
    assert violations(tab) == []
    tab.picture("control-card")
    tab.check()
