"""Files that change while they are shown, texts that are not saved, answers that come late."""

from __future__ import annotations

import os
import re
import threading
from itertools import count
from urllib.parse import quote

import polars as pl
from playwright.sync_api import expect

import pneudrive as pn
from page.conftest import DRIVE, Server
from page.test_journeys import Open, at_end, settled
from page.test_nothing_lost import go
from pneudrive.characterise import write_map
from web.maps import WIDE, friction_map, stribeck


def test_a_text_is_kept_and_the_disk_is_told(server: Server, open_tab: Open) -> None:
    (server.folder / "other.toml").write_text(DRIVE.replace("28 N", "20 N"))
    tab = open_tab(server.address)
    page = tab.page

    def go(name: str) -> None:
        page.click(".home")
        page.click(f"ul.files >> text={name}")
        page.wait_for_selector("[data-end=position_m]")
        settled(tab)

    go("other.toml")
    with_20 = at_end(tab, "position_m")
    go("axis.toml")
    saved = at_end(tab, "position_m")
    # Two values in quick succession, each by an answer that takes its time: both are in the text.
    page.click(".verbs >> text=Drive")
    page.wait_for_selector(".fields")
    page.route("**/api/edit", lambda route: (page.wait_for_timeout(150), route.continue_()))
    page.fill("input[aria-label='friction.coulomb']", "20 N")
    page.keyboard.press("Tab")
    page.fill("input[aria-label='load.mass']", "2 kg")
    page.keyboard.press("Tab")
    page.wait_for_selector(".cm-content >> text=2 kg")
    page.unroute("**/api/edit")
    expect(page.locator(".cm-content").first).to_contain_text("20 N")
    page.click("summary:has-text('other values')")
    page.fill("input[aria-label='valve.critical_pressure_ratio']", "0,4")
    page.keyboard.press("Tab")
    page.wait_for_selector(".problem >> text=valve.critical_pressure_ratio is no number")
    page.fill("input[aria-label='valve.critical_pressure_ratio']", "0.4")
    page.keyboard.press("Tab")
    page.wait_for_selector("text=No problems.")
    # The curves are those of the text; a command, which reads the file, would give others and is refused.
    page.click(".verbs >> text=Simulate")
    page.wait_for_selector("[data-end=position_m]")
    settled(tab)
    unsaved = at_end(tab, "position_m")
    assert len({saved, unsaved, with_20}) == 3
    page.click("text=Copy as command or Python")
    page.wait_for_selector(".problem >> text=unsaved changes")
    expect(page.locator("[data-copy=python]")).to_have_count(0)
    # Another file in between, and the file on disk another one by now: what was not saved is there again, and is told.
    go("other.toml")
    (server.folder / "axis.toml").write_text(DRIVE.replace("28 N", "44 N"))
    go("axis.toml")
    assert at_end(tab, "position_m") == unsaved
    page.click(".verbs >> text=Drive")
    page.click("text=Drop these changes and show the file")
    page.wait_for_selector(".cm-content >> text=44 N")
    # A text that is as it was read follows the disk.
    (server.folder / "axis.toml").write_text(DRIVE)
    go("axis.toml")
    page.wait_for_function(f"() => document.querySelector('[data-end=position_m]')?.dataset.si === '{saved!r}'")
    # The curves of one drive never stand under the name of another.
    page.fill("label:has-text('Duration') input", "2,5 s")
    page.wait_for_selector(".problem")
    page.click(".home")
    page.click("ul.files >> text=other.toml")
    page.wait_for_selector(".problem")
    expect(page.locator("[data-end=position_m]")).to_have_count(0)
    tab.complaints.clear()  # the refused copy
    tab.check()


def test_a_recording_that_goes_on_growing_is_drawn_and_stays_where_it_is_looked_at(
    server: Server, open_tab: Open
) -> None:
    place, is_full = server.folder / "log.csv", threading.Event()
    place.write_text("time,level\n")

    def grow() -> None:
        with place.open("a", buffering=1) as file:
            for k in count():
                file.write(f"{k / 1000},{k % 7}\n")
                if k > 1000 and is_full.wait(0.005):
                    return

    growing = threading.Thread(target=grow)
    growing.start()
    try:
        tab = open_tab(server.address)
        page = tab.page
        page.set_default_timeout(90_000)  # a busy machine reads in seconds, and rests five times as long between reads
        page.evaluate("location.hash = '#/recording/log.csv'")
        page.wait_for_selector("[data-plots] canvas")
        whole = [page.get_attribute("[role=status][data-to]", "data-to")]
        for _ in range(2):
            page.wait_for_selector(f"[role=status][data-to]:not([data-to='{whole[-1]}'])")
            page.wait_for_selector("[data-plots][aria-busy=false] canvas")
            whole.append(page.get_attribute("[role=status][data-to]", "data-to"))
        assert sorted(whole, key=float) == whole
        page.click("text=Closer")
        low, high = (page.get_attribute("[role=status][data-to]", f"data-{end}") for end in ("from", "to"))
        before = page.inner_text("[role=status][data-to]")
        page.wait_for_function(
            "(before) => document.querySelector('[role=status][data-to]').innerText.split(' of ')[1] !== before",
            arg=before.split(" of ")[1],
        )
        page.wait_for_selector(f"[role=status][data-from='{low}'][data-to='{high}']")
        expect(page.locator("[data-plots][aria-busy=false] canvas")).to_have_count(1)
    finally:
        is_full.set()
        growing.join()
    rows = place.read_text().count("\n") - 1
    page.click("text=Whole recording")
    page.wait_for_selector(f"[role=status][data-to='{(rows - 1) / 1000}'] >> text={rows:,} of {rows:,} samples")
    tab.check()


def test_late_and_other_answers(server: Server, open_tab: Open) -> None:
    for name, more in (("new", 0.0), ("worn", 4.0)):
        (server.folder / name).mkdir()
        curves = friction_map(lambda v, g, more=more: stribeck(v, g) + more, WIDE, (0.0, 2e5), 0.2)
        write_map(curves, server.folder / name / "map.parquet")
    span = pl.Series([0.001 * i for i in range(3000)])
    pl.DataFrame({"time": span, "level": span}).write_csv(server.folder / "log.csv")
    pl.DataFrame({"time_s": [3.0], "level": [1.0]}).write_parquet(server.folder / "one.parquet")
    (server.folder / os.fsdecode(b"bad\xffname.csv")).write_text("a\n1\n")
    tab = open_tab(server.address)
    page = tab.page
    page.wait_for_selector("text=1 names are not UTF-8 and are left out")

    def show(path: str, view: str) -> None:
        page.evaluate(f"location.hash = '#/{view}/{quote(path, safe='')}'")
        page.wait_for_selector(f"h2:has-text('{path}')")

    held: list = []
    page.route("**/api/map?path=worn*", lambda route: held.append(route))  # noqa: PLW0108 - it takes no builtin
    with page.expect_request("**/api/map?path=worn*"):
        show("worn/map.parquet", "friction")
    show("new/map.parquet", "friction")
    page.wait_for_selector("[data-figure='Friction over speed'] .panel-drawing")
    page.wait_for_selector("text=lowest friction")
    before = page.inner_text("main")
    with page.expect_response("**/api/map?path=worn*"):
        held[0].continue_()
    page.wait_for_timeout(100)
    expect(page.locator("main").first).to_have_text(before, use_inner_text=True)
    page.unroute("**/api/map?path=worn*")
    # Of fits beside a map none is said to be drawn before it is.
    pn.fit_friction(curves).to_toml(server.folder / "worn" / "other.toml")
    show("worn/map.parquet", "friction")
    choice = page.locator("label:has-text('Curves of') select")
    expect(choice).to_have_value("")
    choice.select_option("worn/other.toml")
    page.wait_for_selector("[aria-label='Behind the fit'] >> text=worn/other.toml")
    # A recording of one sample is shown, and the next one after it.
    show("one.parquet", "recording")
    page.wait_for_selector("[role=status][data-to='3.5'] >> text=1 of 1 samples")
    # A recording that is another one by now is shown whole.
    show("log.csv", "recording")
    page.wait_for_selector("[role=status][data-to='2.999']")
    long = pl.Series([0.001 * i for i in range(20_000)])
    pl.DataFrame({"time": long, "level": long}).write_csv(server.folder / "log.csv")
    page.wait_for_selector("[role=status][data-to='19.999']")
    # What is half written is said, over the view of what was there before, and the whole is shown once it is there.
    (server.folder / "log.csv").write_text("time,le")
    page.wait_for_selector(".problem >> text=no table of numbers was found")
    page.click("text=Closer")
    page.wait_for_selector("[data-plots][aria-busy=false]")
    page.wait_for_selector("[role=status][data-to='14.99925'] >> text=of 20,000 samples")
    page.click("text=Whole recording")
    pl.DataFrame({"time": span, "level": span}).write_csv(server.folder / "log.csv")
    page.wait_for_selector("[role=status][data-to='2.999'] >> text=3,000 of 3,000 samples")
    expect(page.locator(".problem")).to_have_count(0)
    # Two files that are compared are those of the folder as it is.
    (server.folder / "other.toml").write_text(DRIVE.replace("28 N", "20 N"))
    page.click(".home")
    for name in ("axis.toml", "other.toml"):
        page.check(f"input[aria-label='Compare {name}']")
    page.wait_for_selector("[data-differs='friction.coulomb'] >> text=20 N")
    page.wait_for_selector("section[aria-label=Differences] th >> text=other")
    (server.folder / "other.toml").write_text(DRIVE.replace("28 N", "21 N"))  # the folder is watched
    page.wait_for_selector("[data-differs='friction.coulomb'] >> text=21 N")
    # An address that was cut within a letter is one without such a file.
    page.evaluate("location.hash = '#/simulate/100%'")
    page.wait_for_selector(".problem")
    tab.complaints.clear()  # what was refused
    tab.check()


def test_files_of_another_program_appear_without_a_click(server: Server, open_tab: Open) -> None:
    """Within about 3 s on an idle machine, in both tabs; one that is open in the page shows its new text."""
    tab, other = open_tab(server.address), open_tab(server.address)
    page = tab.page
    go(other.page, "drive", "axis.toml")
    other.page.wait_for_selector(".cm-content >> text=28 N")
    page.wait_for_selector("main ul.files >> text=axis.toml")
    with page.expect_response(re.compile("/api/studies.*state=.")) as answer:
        pass
    assert len(answer.value.body()) < 100  # a folder without a change is not sent
    (server.folder / "new.toml").write_text(DRIVE)
    (server.folder / "axis.toml").write_text(DRIVE.replace("28 N", "33 N"))
    page.wait_for_selector("main ul.files >> text=new.toml")
    other.page.wait_for_selector(".tree >> text=new.toml")
    other.page.wait_for_selector(".cm-content >> text=33 N")
    # A text with changes that are not saved is kept, and the other one is told.
    other.page.fill("input[aria-label='friction.coulomb']", "31 N")
    other.page.keyboard.press("Tab")
    other.page.wait_for_selector(".cm-content >> text=31 N")
    (server.folder / "axis.toml").write_text(DRIVE.replace("28 N", "35 N"))
    other.page.wait_for_selector("text=Drop these changes and show the file")
    other.page.wait_for_selector(".cm-content >> text=31 N")
    (server.folder / "new.toml").unlink()
    page.wait_for_selector("main ul.files >> text=new.toml", state="detached")
    for one in (tab, other):
        one.check()
