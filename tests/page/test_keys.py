"""What the keyboard does in every view: the dialog that finds, and undo of all that is set."""

from __future__ import annotations

from playwright.sync_api import expect

from page.conftest import Server, Tab
from page.test_journeys import Open, at_end, settled, violations
from page.test_nothing_lost import go

FOUND = ".palette [role=option]"
AT_END = "[data-end=position_m]"


def test_files_values_and_actions_are_found_by_keyboard(server: Server, open_tab: Open) -> None:
    (server.folder / "drives").mkdir()
    (server.folder / "drives" / "other.toml").write_text((server.folder / "axis.toml").read_text())
    tab = open_tab(server.address)
    page = tab.page
    page.wait_for_selector("ul.files >> text=axis.toml")

    def find(text: str) -> None:
        page.keyboard.press("Control+K")
        page.wait_for_selector(".palette[open]")
        page.keyboard.type(text)

    find("other")
    page.wait_for_selector(f"{FOUND}[aria-selected=true] >> text=drives/other.toml")
    assert violations(tab) == []
    expect(page.locator(".palette input").first).to_have_attribute("aria-activedescendant", "found-0")
    page.keyboard.press("Enter")
    page.wait_for_selector(".palette", state="detached")
    page.wait_for_selector("[data-end=position_m]")
    assert page.url.endswith("#/simulate/drives%2Fother.toml")
    # A value of the open description: the field in Drive has the focus.
    find("critical")
    page.wait_for_selector(f"{FOUND}[aria-selected=true] >> text=valve.critical_pressure_ratio")
    page.keyboard.press("Enter")
    page.wait_for_function("() => document.activeElement.ariaLabel === 'valve.critical_pressure_ratio'")
    # A verb of the open object, by the arrows; what no entry has says so, and Escape leaves the focus where it was.
    find("drives/other.toml")
    page.wait_for_selector(f"{FOUND} >> text=Data sheet: drives/other.toml")
    rows = page.locator(FOUND).all_inner_texts()
    for _ in range(next(k for k, row in enumerate(rows) if "Data sheet" in row)):
        page.keyboard.press("ArrowDown")
    page.wait_for_selector(f"{FOUND}[aria-selected=true] >> text=Data sheet")
    page.keyboard.press("Enter")
    page.wait_for_selector("text=Write the data sheet")
    find("nothing has this")
    page.wait_for_selector(f"{FOUND} >> text=Nothing has these words")
    assert violations(tab) == []
    page.keyboard.press("Escape")
    page.wait_for_selector(".palette", state="detached")
    page.click("button:has-text('Find')")
    page.wait_for_selector(f"{FOUND} >> text=New study: start with a task")
    tab.check()


def undone(tab: Tab, keys: str) -> None:
    tab.page.keyboard.press(keys)
    settled(tab)


def test_sliders_choices_and_values_are_undone(tab: Tab) -> None:
    page = tab.page
    go(page, "simulate", "axis.toml")
    page.wait_for_selector("[data-end=position_m]")
    settled(tab)
    field = "input[aria-label='friction.coulomb, N']"
    ends = [at_end(tab, "position_m")]
    page.fill(field, "5")
    page.keyboard.press("Enter")
    page.wait_for_function(f"(before) => document.querySelector('{AT_END}').dataset.si !== String(before)", arg=ends[0])
    settled(tab)
    ends.append(at_end(tab, "position_m"))
    page.fill("label:has-text('Command, -1 to 1') input", "0 s: 0.3")
    page.keyboard.press("Tab")
    page.wait_for_function(f"(before) => document.querySelector('{AT_END}').dataset.si !== String(before)", arg=ends[1])
    undone(tab, "Control+Z")
    page.wait_for_selector(f"{AT_END}[data-si='{ends[1]!r}']")
    undone(tab, "Control+Z")
    page.wait_for_selector(f"{AT_END}[data-si='{ends[0]!r}']")
    expect(page.locator(field)).to_have_value("28")
    undone(tab, "Control+Shift+Z")
    page.wait_for_selector(f"{AT_END}[data-si='{ends[1]!r}']")
    expect(page.locator(field)).to_have_value("5")
    # Values of the text too, by the same keys, and in the order in which they were set.
    go(page, "drive", "axis.toml")
    for key, text in (("friction.coulomb", "31 N"), ("load.mass", "2 kg")):
        page.fill(f"input[aria-label='{key}']", text)
        page.keyboard.press("Tab")
        page.wait_for_selector(f".cm-content >> text={text}")
    for left in ("31 N", "28 N"):
        page.focus("#main")
        page.keyboard.press("Control+Z")
        page.wait_for_selector(".cm-content >> text=2 kg", state="detached")
        page.wait_for_selector(f".cm-content >> text={left}")
    # A key in a field undoes what is being typed there.
    page.focus("input[aria-label='friction.coulomb']")
    page.keyboard.type("9")
    page.keyboard.press("Control+Z")
    expect(page.locator(".cm-content").first).to_contain_text("28 N")
    tab.check()
