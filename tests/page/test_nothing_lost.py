"""What is typed is kept or refused in words, and what is shown is what its heading says, whatever happens meanwhile."""

from __future__ import annotations

import shutil

import numpy as np
import polars as pl
from playwright.sync_api import expect

from page.conftest import DRIVE, ROOT, Server, Tab
from page.test_journeys import Open, at_end, settled
from waiting import until
from web.test_sizing import TASK

EDITOR = ".cm-content"


def type_at_end(page: object, text: str) -> None:
    page.click(EDITOR)
    page.keyboard.press("Control+End")
    page.keyboard.type(text)


def go(page: object, view: str, path: str = "") -> None:
    page.evaluate("([view, path]) => void (location.hash = `#/${view}/${encodeURIComponent(path)}`)", [view, path])


def held_answers(page: object) -> list:
    """Hold back what the server says to live views: pairs of socket and message, in their order."""
    held: list = []

    def through(own: object) -> None:
        there = own.connect_to_server()
        own.on_message(there.send)
        there.on_message(lambda message: held.append((own, message)))

    page.route_web_socket("**/api/live", through)
    return held


def test_a_comma_is_refused_in_words_and_no_digit_is_taken(tab: Tab) -> None:
    page = tab.page
    go(page, "simulate", "axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    settled(tab)
    before = at_end(tab, "position_m")
    field = page.locator("input[aria-label='friction.coulomb, N']")
    for text in ("12,5", "", "1 000"):
        field.click()
        page.keyboard.press("Control+A")
        page.keyboard.type(text or " ")
        page.keyboard.press("Tab")
        page.wait_for_selector(".slider [role=alert] >> text=with a point before decimals")
        expect(field).to_have_value("28")
    settled(tab)
    assert at_end(tab, "position_m") == before
    field.fill("12.5")
    field.press("Enter")
    page.wait_for_selector(".slider [role=alert]", state="detached")
    settled(tab)
    assert at_end(tab, "position_m") != before
    width = page.locator("input[aria-label='Half width of the spreads, per cent']")
    width.fill("91")
    width.press("Tab")
    page.wait_for_selector("[role=alert] >> text=from 0.1 up to 90")
    expect(width).to_have_value("10")
    # A slider's number is not that of another unit: an absolute pressure is no gauge pressure.
    page.locator("input[aria-label='supply.pressure, bar abs']").fill("5")
    page.keyboard.press("Enter")
    go(page, "drive", "axis.toml")
    page.fill("input[aria-label='supply.pressure']", "6 bar gauge")
    page.keyboard.press("Tab")
    page.wait_for_selector(".cm-content >> text=6 bar gauge")
    go(page, "simulate", "axis.toml")
    page.wait_for_selector("input[aria-label='supply.pressure, bar gauge']")
    expect(page.locator("input[aria-label='supply.pressure, bar gauge']")).to_have_value("6")
    expect(field).to_have_value("12.5")
    tab.check()


def test_values_that_give_no_run_are_not_the_ones_of_the_curves(tab: Tab) -> None:
    page = tab.page
    go(page, "simulate", "axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    page.focus("#slider-friction\\.coulomb")
    page.keyboard.press("End")  # above breakaway
    page.wait_for_selector(".top .problem >> text=must not be below")
    page.wait_for_selector(".top .banner >> text=belong to the last run")
    page.keyboard.press("Home")
    page.wait_for_selector(".top .problem:not(.severe)", state="detached")
    expect(page.locator(".top .banner")).to_have_count(0)
    tab.check()


def test_a_text_that_is_saved_while_another_one_is_opened(server: Server, open_tab: Open) -> None:
    (server.folder / "other.toml").write_text(DRIVE.replace("28 N", "20 N"))
    tab = open_tab(server.address)
    page = tab.page
    go(page, "drive", "axis.toml")
    page.wait_for_selector(EDITOR)
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    type_at_end(page, "# mine")
    page.wait_for_selector("button:text-is('Save')[aria-disabled=false]")
    page.wait_for_timeout(300)
    assert not [one for one in asked if "/api/file" in one]  # a key does not read the file again
    held: list = []
    page.route("**/api/file?path=axis.toml", lambda route: held.append(route))  # noqa: PLW0108 - it takes no builtin
    with page.expect_request("**/api/file?path=axis.toml"):
        page.click("button:text-is('Save')")
    go(page, "drive", "other.toml")
    page.wait_for_selector(f"{EDITOR} >> text=20 N")
    with page.expect_response("**/api/file?path=axis.toml"):
        held[0].continue_()
    page.unroute("**/api/file?path=axis.toml")
    page.wait_for_timeout(200)
    expect(page.locator("section[aria-label=Text] h2").first).to_have_text("other.toml", use_inner_text=True)
    go(page, "drive", "axis.toml")
    page.wait_for_selector(f"{EDITOR} >> text=# mine")
    expect(page.locator(EDITOR).first).to_contain_text("28 N")
    expect(page.locator("button:text-is('Save')").first).to_have_attribute("aria-disabled", "true")
    assert (server.folder / "axis.toml").read_text().endswith("# mine")
    tab.check()


def test_the_text_of_a_task_and_of_a_layout_is_kept(server: Server, open_tab: Open) -> None:
    (server.folder / "push.toml").write_text(TASK)
    (server.folder / "lift.toml").write_text(TASK.replace('"push"', '"lift"'))
    time = np.arange(4000) * 1e-3
    way = 100.0 * np.abs((time % 2.0) - 1.0)
    force = np.where((time % 2.0) < 1.0, -20.0, 20.0)
    pl.DataFrame({"time_s": time, "position_mm": way, "force_N": force}).write_csv(server.folder / "log.csv")
    tab = open_tab(server.address)
    page = tab.page
    go(page, "sizing", "push.toml")
    page.wait_for_selector(EDITOR)
    type_at_end(page, "# mine")
    go(page, "sizing", "lift.toml")
    page.wait_for_selector(f"{EDITOR} >> text=lift")
    assert "mine" not in page.inner_text(EDITOR)
    go(page, "recording", "log.csv")
    page.click("text=Propose a layout")
    page.wait_for_selector("textarea.text")
    page.fill("textarea.text", "nonsense =")
    (server.folder / "push.toml").write_text(f"{TASK}# theirs")
    go(page, "sizing", "push.toml")
    page.wait_for_selector(f"{EDITOR} >> text=# mine")
    page.wait_for_selector("text=push.toml has changed on disk since you opened it")
    page.click("button:text-is('Save')")
    page.wait_for_selector("text=push.toml changed on disk: nothing was written")
    page.click("text=Drop these changes")
    page.wait_for_selector(f"{EDITOR} >> text=# theirs")
    assert (server.folder / "push.toml").read_text().endswith("# theirs")
    go(page, "sizing", "none.toml")
    page.wait_for_selector(".problem >> text=there is no such file")
    expect(page.locator(EDITOR)).to_have_count(0)  # the text of another task stands under no other name
    # A layout that cannot be read is not written: it would hide the recordings beside it.
    go(page, "recording", "log.csv")
    page.click("text=Accept: write layout.toml")
    page.wait_for_selector("section[aria-label=Layout] .problem >> text=layout.toml, line 1")
    expect(page.locator("textarea.text")).to_have_value("nonsense =")
    assert not (server.folder / "layout.toml").exists()
    tab.complaints.clear()  # what was refused
    tab.check()


def test_what_is_typed_while_the_server_is_away_comes_into_the_text(own_server: Server, open_tab: Open) -> None:
    folder = own_server.folder
    tab = open_tab(own_server.address)
    page = tab.page
    go(page, "drive", "axis.toml")
    page.wait_for_selector(".fields")
    watching = open_tab(f"{tab.origin}/#/studies/").page
    watching.wait_for_selector("text=axis.toml")
    own_server.end()
    page.fill("input[aria-label='friction.coulomb']", "31 N")
    page.keyboard.press("Tab")
    page.wait_for_selector("[data-connection=lost]")
    again = Server.start(folder, own_server.port)
    try:
        for each in (page, watching):  # they look by themselves: another server, another token
            each.wait_for_selector("[data-connection=locked]")
        open_tab(again.address).page.wait_for_selector("text=axis.toml")
        page.wait_for_selector(f"{EDITOR} >> text=31 N")
        page.wait_for_selector("[data-connection=open]", state="attached")
        watching.wait_for_selector("ul.files >> text=axis.toml")
        expect(page.locator(".problem")).to_have_count(0)
        page.click("button:text-is('Save')")
        page.wait_for_selector("text=Saved axis.toml.")
        assert "31 N" in (folder / "axis.toml").read_text()
    finally:
        again.end()
    assert tab.foreign == []


def test_long_names_and_lines_stay_within_the_page(server: Server, open_tab: Open) -> None:
    long = f"{'x' * 180}.toml"
    (server.folder / long).write_text(f"{DRIVE}# {'a long line ' * 40}\n")
    tab = open_tab(server.address)
    page = tab.page
    page.wait_for_selector(f"text={long}")
    for width in (1400, 400):
        page.set_viewport_size({"width": width, "height": 900})
        for view, wait in (
            ("studies", "ul.files"),
            ("drive", EDITOR),
            ("validation", "select"),
            ("handover", "select"),
        ):
            go(page, view, long if view == "drive" else "")
            page.wait_for_selector(wait)
            assert page.evaluate("document.documentElement.scrollWidth") <= width, (view, width)
    tab.check()


def test_what_does_not_count_is_said(server: Server, open_tab: Open) -> None:
    for name in ("two_cylinders.toml", "axes/upright.toml"):
        shutil.copy(ROOT / "examples" / name, server.folder)
    tab = open_tab(server.address)
    page = tab.page
    go(page, "simulate", "axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    hazard = page.locator(".severe").first
    assert "are harder than a cylinder of this bore usually takes" in hazard.inner_text()
    assert hazard.bounding_box()["y"] < page.locator("[data-end] >> nth=0").bounding_box()["y"]  # above the curves
    page.select_option("label:has-text('Compare with') select", "upright.toml")
    page.wait_for_selector("text=upright.toml has none of these quantities under the same names")
    go(page, "simulate", "two_cylinders.toml")
    page.wait_for_selector("text=Pressure, absolute: 8 of 9 curves are drawn")
    page.click("summary:has-text('impacts on the end stops')")
    page.wait_for_selector("text=end of chamber b of right")
    impacts = page.locator("details:has(summary:has-text('impacts on the end stops'))")
    assert impacts.locator("li").count() == int(impacts.locator("summary").inner_text().split()[0])  # none is left out
    go(page, "drive", "axis.toml")
    page.wait_for_selector(".fields")
    page.fill("input[aria-label='friction.coulomb']", "31 N")
    page.keyboard.press("Tab")
    page.wait_for_selector(f"{EDITOR} >> text=31 N")
    said = "text=Changes of axis.toml that are not saved do not count here"
    go(page, "control")
    page.wait_for_selector(said)
    for view in ("handover", "validation"):
        go(page, view)
        page.select_option("label:has-text('Drive or') select", "axis.toml")
        page.wait_for_selector(said)
    tab.check()


def test_an_answer_of_another_drive_is_not_drawn(server: Server, open_tab: Open) -> None:
    (server.folder / "other.toml").write_text(DRIVE.replace("my axis", "the other"))
    tab = open_tab(server.address)
    page = tab.page
    held = held_answers(page)
    go(page, "control")
    until(lambda: len(held) >= 1, lambda pause_s: page.wait_for_timeout(1e3 * pause_s))
    with page.expect_response("**/api/control?path=other.toml"):
        page.select_option("label.choice:has-text('Drive') >> nth=0 >> select", "other.toml")
    page.wait_for_timeout(200)
    own, message = held[0]
    own.send(message)
    until(lambda: len(held) >= 2, lambda pause_s: page.wait_for_timeout(1e3 * pause_s))
    expect(page.locator("[data-score]")).to_have_count(0)
    own, message = held[1]
    own.send(message)
    page.wait_for_selector("summary:has-text('for the other, every')")


def test_another_recording_is_not_shown_with_the_spectrum_of_the_last_one(server: Server, open_tab: Open) -> None:
    rng = np.random.default_rng(1)
    for name in ("one", "two"):
        table = pl.DataFrame({"time": np.arange(4000) * 1e-3, "level": rng.standard_normal(4000)})
        table.write_parquet(server.folder / f"{name}.parquet")
    tab = open_tab(server.address)
    page = tab.page
    go(page, "recording", "one.parquet")
    page.check("text=spectrum of the view")
    page.wait_for_selector("figure[data-plot^=Spectrum]")
    held: list = []
    page.route("**/api/spectrum*", lambda route: held.append(route))  # noqa: PLW0108 - it takes no builtin
    with page.expect_request("**/api/spectrum?path=two*"):
        go(page, "recording", "two.parquet")
    expect(page.locator("figure[data-plot^=Spectrum]")).to_have_count(0)
    held[-1].continue_()
    page.wait_for_selector("figure[data-plot^=Spectrum]")
    tab.check()


def test_the_editor_of_a_task_outlives_its_text(server: Server, open_tab: Open) -> None:
    (server.folder / "push.toml").write_text(TASK)
    page = open_tab(server.address).page
    go(page, "sizing", "push.toml")
    page.click(EDITOR)
    page.keyboard.press("ControlOrMeta+A")
    page.keyboard.press("Delete")
    page.wait_for_selector("section[aria-label=Task] .problem")
    page.keyboard.type("name = 1")
    expect(page.locator(EDITOR).first).to_have_text("name = 1", use_inner_text=True)


def test_what_is_not_copied_is_not_said_to_be(tab: Tab) -> None:
    page = tab.page
    go(page, "simulate", "axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    page.click("text=Copy as command or Python")
    page.evaluate("() => { navigator.clipboard.writeText = () => Promise.reject(new Error('denied')); }")
    page.click("text=Copy the command")
    page.wait_for_selector(".copied >> text=Not copied")
    page.evaluate("() => { navigator.clipboard.writeText = () => Promise.resolve(); }")
    page.click("text=Copy the command")
    page.wait_for_selector(".copied >> text=Copied the command.")
    tab.check()
